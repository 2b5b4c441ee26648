//! Semiregular quad remeshing and Laplacian smoothing on a surface (Panozzo et al. 2013, section
//! 4.1, Figure 7).
//!
//! A coarse mesh of quads is snapped to the surface. Each level splits every quad into four: the
//! middle of an edge is the average of its two ends on the surface, the middle of a face that of
//! its corners. Each smoothing step then moves every vertex towards the average of its neighbours,
//! all at once. Levels and steps are batches: every average reads the points of the stage before
//! and writes one point of the next.
//!
//! Each corner of a face that is no quad becomes a quad in the first level, as in the scheme of
//! Catmull and Clark 1978.

mod base;
mod measure;
mod quads;

use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;

pub use base::automatic_base;
#[doc(hidden)]
pub use measure::{Angles, EdgeLengths};
pub use measure::{Distances, Turned};

use crate::control;
use crate::engine::Engine;
use crate::error::{Error, Result};
use crate::forward_in_dimension as in_dimension;
use crate::geometry::off_mesh::{ELSEWHERE, FARTHEST, lies_off};
use crate::geometry::{ClosestPoints, Frame, Mesh, SurfacePoint, Topology};
use crate::surface::correspondence::Shape;
use crate::surface::forward::{AnyForward, Origin};
use crate::surface::gpu::{DeviceStencils, MOST_ROWS};
use crate::surface::stencils::Stencils;
use quads::{Polygons, Refined};

/// Largest number of vertices of a result.
const MOST_VERTICES: u64 = 1 << 24;
/// Bytes that a vertex of the result takes: with its faces, its place on the mesh and where it is
/// written. Measured on results of 410,000 and 1,640,000: 715 and 785.
const BYTES_PER_VERTEX: u64 = 800;
/// Averages of a batch below which a device is not worth its while.
const LEAST_ROWS: usize = 1024;
/// Smoothing steps that are computed in one go.
const TOGETHER: usize = 8;
/// Largest number of smoothing steps.
const MOST_STEPS: u32 = 10_000;

/// Rest lengths that [`Evenness::Auto`] tries, from the paper's on.
const TRIED: [f64; 6] = [0.0, 0.5, 0.75, 0.9, 1.0, 1.0];
/// Part of the step for the last of them.
const SHORT: f64 = 0.25;

/// Edges shorter than the rest length by more than this factor push no more than one of that
/// length.
const LARGEST_PUSH: f64 = 3.0;

/// What a smoothing step does about lengths of edges.
///
/// Neighbour `j` of vertex `i` pulls with the weight `1 - c m / |x_j - x_i|`, `m` being the mean
/// length of all edges, as a spring of rest length `c m` does. With `c = 0` all pull alike: the
/// paper's Laplacian smoothing, which makes angles right, but draws vertices of valence three
/// together and so may make lengths *less* even. With `c = 1` a step goes down the gradient of the
/// variance of lengths, and angles follow only as far as that lets them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Evenness {
    /// In each step the least `c` of a few with which the variance falls; where it falls with none,
    /// that step and all after leave the mesh as it is.
    #[default]
    Auto,
    /// The same `c`, 0..=1, in all steps.
    Fixed(f64),
}

/// How a surface is remeshed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RemeshOptions {
    /// Times every quad is split into four.
    pub levels: u32,
    /// Steps of smoothing.
    pub smooth: u32,
    /// How far a step goes towards the average of the neighbours: above 0, 1 is the paper's.
    pub step: f64,
    /// What a step does about lengths of edges.
    pub evenness: Evenness,
}

impl Default for RemeshOptions {
    fn default() -> Self {
        Self { levels: 3, smooth: 5, step: 1.0, evenness: Evenness::Auto }
    }
}

/// A coarse mesh on a surface, with all that does not depend on where its vertices are.
#[derive(Debug)]
pub struct Remesher<'a> {
    mesh: &'a Mesh,
    topology: &'a Topology,
    /// At the mesh's own size.
    frame: Frame,
    closest: ClosestPoints,
    forward: AnyForward,
    device: Option<DeviceStencils>,
    name: String,
    base: Vec<SurfacePoint>,
    /// The vertices of the base mesh that are used, by their numbers there.
    used: Vec<u32>,
    snapped: Vec<f64>,
    polygons: Polygons,
    others: usize,
    levels: Vec<Refined>,
    smoothing: Stencils,
    edges: Vec<[u32; 2]>,
    steps: u32,
    evenness: Evenness,
    /// The rest lengths of the last frame's steps.
    rest_lengths: Vec<f64>,
    /// The points of the last frame, before and after smoothing; empty without one.
    unsmoothed: Vec<SurfacePoint>,
    points: Vec<SurfacePoint>,
    /// Lengths of edges before smoothing and after each step.
    lengths: Vec<EdgeLengths>,
    without_projection: usize,
}

/// The points after each of some steps, and a number of closest points.
type Steps = (Vec<Vec<SurfacePoint>>, usize);

/// What the result of a remeshing is like.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct RemeshReport {
    /// Vertices.
    pub vertices: usize,
    /// Faces.
    pub faces: usize,
    /// Faces of the base mesh that are no quads.
    pub base_others: usize,
    /// How far the vertices of the base mesh were moved onto the surface: the largest distance.
    pub snap_largest: f64,
    /// The same, their mean.
    pub snap_mean: f64,
    /// Vertices of the result for which there was no Phong projection.
    pub without_projection: usize,
    /// Lengths of edges: before smoothing, and after each step.
    pub edge_lengths: Vec<EdgeLengths>,
    /// The rest length of each step that was done, in mean lengths.
    pub rest_lengths: Vec<f64>,
    /// Angles of the result.
    pub angles: Angles,
    /// Faces turned over before smoothing and in the result.
    pub turned: [Turned; 2],
    /// Distances of the result.
    pub distances: Distances,
}

impl<'a> Remesher<'a> {
    /// Snaps the vertices of `base` to the surface of `shape` and prepares all levels. O(F D + V
    /// log V + result).
    ///
    /// # Errors
    /// [`Error::Option`] for options out of range; [`Error::Mesh`] naming the face of `base`: fewer
    /// than three corners, a vertex twice, corners on different components of the surface, or no
    /// face; [`Error::Input`] for a vertex of `base` that is not finite or farther from the surface
    /// than 100 times its diagonal, or all of them closest to one point; as [`AnyForward::new`].
    pub fn new(shape: Shape<'a>, base: &Mesh, options: &RemeshOptions) -> Result<Self> {
        if !(options.step > 0.0 && options.step <= 1.0) {
            let what = format!("{} is not above 0 and at most 1", options.step);
            return Err(Error::option("step", what, "1 goes all the way to the average, 0.5 half of it"));
        }
        if let Evenness::Fixed(c) = options.evenness
            && !(0.0..=1.0).contains(&c)
        {
            let what = format!("{c} is not between 0 and 1");
            return Err(Error::option("even", what, "0 is plain Laplacian smoothing, 1 evens lengths of edges"));
        }
        if options.smooth > MOST_STEPS {
            let what = format!("{} is more than {MOST_STEPS}", options.smooth);
            return Err(Error::option("smooth", what, "A few steps are usual"));
        }
        let (polygons, used) = Polygons::of(base)?;
        // A level takes four times as many vertices, about one for each corner.
        let after = (polygons.corners.len() as u64 + polygons.vertices as u64)
            .saturating_mul(4u64.saturating_pow(options.levels.saturating_sub(1)));
        if after > MOST_VERTICES {
            let what =
                format!("{} levels of {} faces are more than {MOST_VERTICES} vertices", options.levels, polygons.len());
            return Err(Error::option("levels", what, "Give fewer levels"));
        }
        let levels = options.levels;
        control::require(after * BYTES_PER_VERTEX, || format!("{levels} levels of {} faces", polygons.len()))?;
        let closest = ClosestPoints::new(shape.mesh, shape.topology);
        let places: Vec<DVec3> = used.iter().map(|&v| base.positions[v as usize]).collect();
        let diagonal = shape.mesh.bounds().map_or(0.0, |(low, high)| low.distance(high));
        let mut points = Vec::with_capacity(places.len());
        let mut snapped = Vec::with_capacity(places.len());
        for (found, &v) in closest.nearest_all(&places).into_iter().zip(&used) {
            let Some((point, distance)) = found else {
                let what = format!("vertex {v} of {} is not finite", base.name);
                return Err(Error::input(what, "Correct its coordinates"));
            };
            if !(distance <= FARTHEST * diagonal) {
                let what = format!("vertex {v} of {} {}", base.name, lies_off(distance, diagonal));
                return Err(Error::input(what, ELSEWHERE));
            }
            points.push(point);
            snapped.push(distance);
        }
        let landed = |p: &SurfacePoint| p.position(shape.mesh);
        if let Some(first) = points.first().map(landed)
            && points.iter().all(|p| landed(p) == first)
        {
            let what =
                format!("all vertices of {} are closest to one point of {}, {first}", base.name, shape.mesh.name);
            return Err(Error::input(what, "Move the base mesh to where the surface is"));
        }
        let component = |v: u32| shape.topology.triangle_component(points[v as usize].face);
        for p in 0..polygons.len() {
            let c = polygons.polygon(p);
            if let Some(&v) = c.iter().find(|&&v| component(v) != component(c[0])) {
                let what = format!(
                    "face {p} has corners on components {} and {} of {}: vertices {} and {}",
                    component(c[0]),
                    component(v),
                    shape.mesh.name,
                    used[c[0] as usize],
                    used[v as usize]
                );
                return Err(Error::mesh(&base.name, what, "Give each part of the surface its own faces"));
            }
        }
        let others = polygons.others();
        let mut levels: Vec<Refined> = Vec::new();
        for _ in 0..options.levels {
            let next = levels.last().map_or(&polygons, |l| &l.polygons).refined();
            levels.push(next);
        }
        let finest = levels.last().map_or(&polygons, |l| &l.polygons);
        let smoothing = finest.smoothing(options.step);
        let edges = finest.edges().into_iter().map(|e| e.0).collect();
        Ok(Self {
            mesh: shape.mesh,
            frame: closest.frame().in_units(),
            topology: shape.topology,
            closest,
            forward: AnyForward::new(shape)?,
            device: None,
            name: base.name.clone(),
            base: points,
            used,
            snapped,
            polygons,
            others,
            levels,
            smoothing,
            edges,
            steps: options.smooth,
            evenness: options.evenness,
            rest_lengths: Vec::new(),
            unsmoothed: Vec::new(),
            points: Vec::new(),
            lengths: Vec::new(),
            without_projection: 0,
        })
    }

    /// How far each used vertex of the base mesh was moved onto the surface, with its number there.
    pub fn snapped(&self) -> impl Iterator<Item = (u32, f64)> + '_ {
        self.used.iter().copied().zip(self.snapped.iter().copied())
    }

    /// The vertices of the base mesh on the surface: those that are used, in their order.
    pub fn base(&self) -> &[SurfacePoint] {
        &self.base
    }

    /// Moves a vertex of the base mesh for the next frame.
    ///
    /// # Errors
    /// [`Error::Input`] if there is no such vertex (of [`Self::base`]) or the point is not on the
    /// surface.
    pub fn move_vertex(&mut self, v: usize, point: SurfacePoint) -> Result<()> {
        if v >= self.base.len() || !point.is_valid(self.mesh, 1e-6) || !self.topology.usable[point.face as usize] {
            let what = format!("vertex {v} of {} cannot go to face {}", self.base.len(), point.face);
            return Err(Error::input(what, "Name a vertex of the base mesh and a point of the surface"));
        }
        self.base[v] = point;
        Ok(())
    }

    /// Has large batches computed on the device of `engine` from now on, in single precision. Where
    /// there is a device that cannot do this work, the CPU goes on and the reason comes back, in
    /// one line.
    ///
    /// # Errors
    /// As [`DeviceStencils::new`].
    pub fn compute_on(&mut self, engine: &Engine) -> Result<Option<String>> {
        self.device = None;
        if engine.gpu().is_none() {
            return Ok(None);
        }
        let finest = self.finest().vertices;
        let surface = match &self.forward {
            AnyForward::Eight(forward) if finest <= MOST_ROWS => forward.surface(),
            AnyForward::Eight(_) => return Ok(Some(format!("more than {MOST_ROWS} vertices are remeshed on the CPU"))),
            _ => return Ok(Some("the kernels work in 8 dimensions: the CPU remeshes".into())),
        };
        if let Some(why) = DeviceStencils::obstacle(engine, 8) {
            return Ok(Some(format!("the CPU remeshes: {why}")));
        }
        self.device = Some(DeviceStencils::new(engine, &surface.cast())?);
        Ok(None)
    }

    /// Computes all vertices, in batches; each search begins at one of the points that are
    /// averaged. The vertices come as points of the surface: those of the base mesh first, then the
    /// middles of edges and faces level by level.
    ///
    /// About a microsecond an average on the CPU: O(vertices (1 + steps)).
    ///
    /// # Errors
    /// Those of the device, where there is one ([`Self::compute_on`]).
    pub fn frame(&mut self) -> Result<&[SurfacePoint]> {
        let mut without = 0;
        let mut now = self.base.clone();
        for level in &self.levels {
            let (found, closest) = self.batch(&now, &level.rows, 1)?;
            without += closest;
            now.extend(found.into_iter().flatten());
        }
        let unsmoothed = now.clone();
        let lengths = |p: &[SurfacePoint]| measure::edge_lengths(&self.edges, &self.places(p));
        let mut all = vec![lengths(&now)];
        let mut rest_lengths = Vec::new();
        // Steps that are known beforehand are sent together.
        let most = if self.evenness == Evenness::Fixed(0.0) { TOGETHER } else { 1 };
        while rest_lengths.len() < self.steps as usize {
            let together = most.min(self.steps as usize - rest_lengths.len());
            let Some(((found, closest), c)) = self.smoothed(&now, together)? else { break };
            without = closest;
            rest_lengths.resize(rest_lengths.len() + found.len(), c);
            for step in found {
                all.push(lengths(&step));
                now = step;
            }
        }
        self.rest_lengths = rest_lengths;
        self.without_projection = without;
        self.lengths = all;
        self.unsmoothed = unsmoothed;
        self.points = now;
        Ok(&self.points)
    }

    /// Some steps, and the rest length they were done with; `None` where no step lowers the
    /// variance.
    fn smoothed(&self, points: &[SurfacePoint], together: usize) -> Result<Option<(Steps, f64)>> {
        if let Evenness::Fixed(c) = self.evenness {
            return Ok(Some((self.batch(points, &self.pulls(points, c, 1.0), together)?, c)));
        }
        let variance = |p: &[SurfacePoint]| measure::edge_lengths(&self.edges, &self.places(p)).variance;
        let now = variance(points);
        for (k, &c) in TRIED.iter().enumerate() {
            let part = if k + 1 == TRIED.len() { SHORT } else { 1.0 };
            let steps = self.batch(points, &self.pulls(points, c, part), 1)?;
            if steps.0.last().is_some_and(|p| variance(p) < now) {
                return Ok(Some((steps, c)));
            }
        }
        Ok(None)
    }

    /// The averages of a step with rest length `c`, and `part` of its length.
    fn pulls(&self, points: &[SurfacePoint], c: f64, part: f64) -> Stencils {
        let mut rows = self.smoothing.clone();
        if c == 0.0 && part == 1.0 {
            return rows;
        }
        let x = self.places(points);
        let rest = c * measure::edge_lengths(&self.edges, &x).mean;
        rows.scale(|i, j| {
            let length = x[i as usize].distance(x[j as usize]);
            // Neighbours in one place do not push each other anywhere.
            if length > 0.0 { part * (1.0 - (rest / length).min(LARGEST_PUSH)) } else { part }
        });
        rows
    }

    /// The points after each of some steps of the same averages, and how many of the last are
    /// closest points for want of a projection.
    fn batch(&self, points: &[SurfacePoint], rows: &Stencils, steps: usize) -> Result<Steps> {
        in_dimension!(&self.forward, forward => {
            if let Some(device) = &self.device
                && rows.len() >= LEAST_ROWS
                && !forward.reaches_far(points, rows)
            {
                let closest = AtomicUsize::new(0);
                let rest = |points: &[SurfacePoint], r: usize| {
                    let found = forward.average_row(points, rows, r);
                    closest.fetch_add(usize::from(found.origin == Origin::Closest), Ordering::Relaxed);
                    found.point
                };
                let begin: Vec<SurfacePoint> = (0..rows.len()).map(|r| points[rows.row(r).0 as usize]).collect();
                let found = device.steps(points, rows, &begin, steps, &rest)?;
                return Ok((found, closest.into_inner() / steps.max(1)));
            }
            let mut all: Vec<Vec<SurfacePoint>> = Vec::with_capacity(steps);
            let mut closest = 0;
            for _ in 0..steps {
                control::check()?;
                let found = forward.averages(all.last().map_or(points, |p| p), rows);
                closest = found.iter().filter(|a| a.origin == Origin::Closest).count();
                all.push(found.iter().map(|a| a.point).collect());
            }
            Ok((all, closest))
        })
    }

    fn finest(&self) -> &Polygons {
        self.levels.last().map_or(&self.polygons, |l| &l.polygons)
    }

    /// Places about the origin of the frame: lengths and angles of them do not round far from that
    /// of the file.
    fn places(&self, points: &[SurfacePoint]) -> Vec<DVec3> {
        points.iter().map(|p| self.frame.place(p, self.mesh)).collect()
    }

    /// The faces and points of the last frame; without one, those of the base mesh.
    fn current(&self) -> (&Polygons, [&[SurfacePoint]; 2]) {
        if self.points.is_empty() {
            return (&self.polygons, [&self.base; 2]);
        }
        (self.finest(), [&self.unsmoothed, &self.points])
    }

    /// The quad mesh of the last frame; without one, the base mesh on the surface.
    pub fn mesh(&self) -> Mesh {
        let (polygons, [_, points]) = self.current();
        polygons.mesh(&self.name, points.iter().map(|p| p.position(self.mesh)).collect())
    }

    /// What [`Self::mesh`] is like. O(vertices log F).
    pub fn report(&self) -> RemeshReport {
        let (finest, [unsmoothed, points]) = self.current();
        let positions = self.places(points);
        let turned =
            |points: &[SurfacePoint]| measure::turned(finest, &self.places(points), points, (self.mesh, self.topology));
        RemeshReport {
            vertices: finest.vertices,
            faces: finest.len(),
            base_others: self.others,
            snap_largest: self.snapped.iter().copied().fold(0.0, f64::max),
            snap_mean: self.snapped.iter().sum::<f64>() / self.snapped.len().max(1) as f64,
            without_projection: self.without_projection,
            edge_lengths: self.lengths.clone(),
            rest_lengths: self.rest_lengths.clone(),
            angles: measure::angles(finest, &positions),
            turned: [turned(unsmoothed), turned(points)],
            distances: measure::distances(finest, &self.mesh(), (self.mesh, &self.closest)),
        }
    }

    /// The same averages as the last frame (with fixed evenness), one by one, for comparison.
    pub fn one_by_one(&self) -> Vec<SurfacePoint> {
        let mut now = self.base.clone();
        let one = |points: &[SurfacePoint], rows: &Stencils| -> Vec<SurfacePoint> {
            in_dimension!(&self.forward, forward => {
                (0..rows.len()).map(|r| forward.average_row(points, rows, r).point).collect()
            })
        };
        for level in &self.levels {
            let found = one(&now, &level.rows);
            now.extend(found);
        }
        for &c in &self.rest_lengths {
            now = one(&now, &self.pulls(&now, c, 1.0));
        }
        now
    }
}

#[cfg(test)]
mod tests;
