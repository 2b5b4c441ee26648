//! Morphing and blending of shapes of the same connectivity through their encodings (section 4.3);
//! shapes of another connectivity get that of the first through a correspondence
//! ([`compatible_mesh`]).
//!
//! In-betweens turn where a blend of positions would shrink. They are reached in small steps from
//! an input (`encoding::march`); those of one path are finished in parallel.

mod anchors;
mod compatible;
mod frame;
mod goal;
mod untangle;

use glam::DVec3;
use rayon::prelude::*;

use crate::control;
use crate::encoding::{Blend, Connectivity, DecodeReport, Hierarchy, HierarchyOptions, MarchQuality, Marcher, Mix, V3};
use crate::error::{Error, Result};
use crate::geometry::{Corner, Frame, Mesh, NONE};

use anchors::Anchors;
pub use compatible::{Compatible, CompatibleReport, LONG, compatible_mesh};
pub use frame::{FrameReport, FrameWatch};
use goal::{Goal, Mask, Reached};

/// Largest change of a weight in one step.
const STEP: f64 = 1.0 / 16.0;

/// In-betweens that are finished at once. A fixed number bounds the memory.
const BLOCK: usize = 8;

/// Blends a list of shapes.
#[derive(Debug)]
pub struct Morpher {
    first: Mesh,
    marcher: Marcher,
    blend: Blend,
    anchors: Anchors,
    /// As given; vertices outside the hierarchy are blended linearly.
    originals: Vec<Vec<DVec3>>,
    /// In the hierarchy's numbering, each about its centre, the first with diagonal one.
    shapes: Vec<Vec<V3<f64>>>,
    /// The same vertex in all shapes.
    centres: Vec<DVec3>,
    diagonal: f64,
    /// Where the march stands; infinite where it is at no blend.
    weights: Vec<f64>,
    /// What is odd but no error, a sentence each.
    pub warnings: Vec<String>,
}

impl Morpher {
    /// Encodes `meshes`, two or more with the same triangles. `anchors` are vertices that carry the
    /// position, turn and size of an in-between: four or more, best near one another where the
    /// shapes move least; they are chosen so where none are given.
    ///
    /// # Errors
    /// [`Error::Input`] for fewer than two meshes, different connectivity (naming the first
    /// difference) or anchors out of range; [`Error::Mesh`] for a mesh without triangles.
    pub fn new(meshes: &[&Mesh], anchors: Option<&[u32]>, options: &HierarchyOptions) -> Result<Self> {
        let [first, others @ ..] = meshes else {
            return Err(Error::input("there is nothing to morph", "Give two or more meshes"));
        };
        if others.is_empty() {
            return Err(Error::input("one mesh alone cannot be morphed", "Give two or more meshes"));
        }
        others.iter().try_for_each(|other| same_connectivity(first, other))?;
        let connectivity = Connectivity::new(first);
        let used = |v: usize| !connectivity.rings[v].is_empty();
        let frame = Frame::of((0..first.vertex_count()).filter(|&v| used(v)).map(|v| first.positions[v]));
        // The same vertex of every mesh: wherever they stand, none is far from its own.
        let middle = first.positions.iter().position(|p| *p == frame.origin).unwrap_or(0);
        let centres: Vec<DVec3> = meshes.iter().map(|m| m.positions[middle]).collect();
        let (low, high) = (0..first.vertex_count())
            .filter(|&v| used(v))
            .map(|v| first.positions[v] - frame.origin)
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
        let diagonal = low.distance(high);
        if !(diagonal > 0.0) || !diagonal.is_finite() {
            return Err(Error::mesh(&first.name, "there is no triangle to morph", "Use a mesh with faces"));
        }
        let local = |(mesh, &centre): (&&Mesh, &DVec3)| -> Vec<V3<f64>> {
            mesh.positions
                .iter()
                .enumerate()
                .map(|(v, &p)| if used(v) { ((p - centre) / diagonal).to_array() } else { [0.0; 3] })
                .collect()
        };
        let locals: Vec<Vec<V3<f64>>> = meshes.iter().zip(&centres).map(local).collect();
        if let Some(k) = locals.iter().position(|l| l.iter().flatten().any(|x| !x.is_finite())) {
            return Err(Error::mesh(&meshes[k].name, "a used position is not finite", "Export the surface again"));
        }
        let anchors: Option<Vec<u32>> = anchors.map(|a| a.iter().map(|&v| first.representative(v)).collect());
        let away: Vec<DVec3> = centres.iter().map(|c| (*c - frame.origin) / diagonal).collect();
        let anchors = Anchors::new(&connectivity, &locals, &away, anchors.as_deref())?;
        let hierarchy = Hierarchy::new(&connectivity, &locals[0], &anchors.held, options)?;
        let shapes: Vec<Vec<V3<f64>>> =
            locals.iter().map(|l| hierarchy.order.iter().map(|&v| l[v as usize]).collect()).collect();
        let blend = Blend::new(&hierarchy, &shapes)?;
        let mut warnings = Vec::new();
        if blend.borrowed > 0 {
            let what = "rings have no area in some shape: their detail is the first shape's";
            warnings.push(format!("{} {what}", blend.borrowed));
        }
        let mut marcher = Marcher::new(hierarchy)?;
        marcher.begin(&shapes[0]);
        let mut weights = vec![0.0; meshes.len()];
        weights[0] = 1.0;
        Ok(Self {
            first: (*first).clone(),
            marcher,
            blend,
            anchors,
            originals: meshes.iter().map(|m| m.positions.clone()).collect(),
            shapes,
            centres,
            diagonal,
            weights,
            warnings,
        })
    }

    /// The anchors in use.
    pub fn anchors(&self) -> &[u32] {
        &self.anchors.held
    }

    /// Name of the first mesh.
    pub fn name(&self) -> &str {
        &self.first.name
    }

    /// The shape at `weights` (one an input, summing to one), reached from the one before, or from
    /// the nearest input if that is nearer.
    ///
    /// # Errors
    /// [`Error::Option`] for weights that do not fit; [`Error::Numeric`] if no finite shape was
    /// found.
    pub fn shape(&mut self, weights: &[f64], quality: &MarchQuality) -> Result<(Vec<DVec3>, DecodeReport)> {
        self.check(weights)?;
        let reached = self.reach(weights, quality)?;
        self.complete(reached, quality)
    }

    /// The shapes at each of `path`, as [`Morpher::shape`] makes them in this order. The finer
    /// stages of several in-betweens are solved at once. `sink` receives the shapes in order and
    /// may end the work with an error.
    ///
    /// # Errors
    /// As [`Morpher::shape`]; what `sink` returns.
    pub fn frames(
        &mut self,
        path: &[Vec<f64>],
        quality: &MarchQuality,
        sink: impl FnMut(usize, Vec<DVec3>, DecodeReport) -> Result<()>,
    ) -> Result<()> {
        path.iter().try_for_each(|weights| self.check(weights))?;
        self.in_blocks(path, |morpher, weights| morpher.reach(weights, quality), quality, sink)
    }

    /// The shape with weights of its own at every vertex: `weights` holds one an input, vertex by
    /// vertex of the mesh. Position, turn and size are those of the mean weights at the anchors.
    ///
    /// # Errors
    /// As [`Morpher::shape`].
    pub fn masked(&mut self, weights: &[f64], quality: &MarchQuality) -> Result<(Vec<DVec3>, DecodeReport)> {
        let mut result = None;
        self.toward_mask(weights, &[1.0], quality, |_, shape, report| {
            result = Some((shape, report));
            Ok(())
        })?;
        result.ok_or_else(|| Error::numeric("the march to the mask made no shape", "Use fewer meshes"))
    }

    /// Shapes on the way from the mesh that rules at the anchors to the one [`Morpher::masked`]
    /// makes: at each of `times`, which ascend from 0 to 1, the vertices have that share of their
    /// mask. `sink` receives them in order and may end the work with an error.
    ///
    /// # Errors
    /// As [`Morpher::shape`]; what `sink` returns.
    pub fn toward_mask(
        &mut self,
        weights: &[f64],
        times: &[f64],
        quality: &MarchQuality,
        sink: impl FnMut(usize, Vec<DVec3>, DecodeReport) -> Result<()>,
    ) -> Result<()> {
        let k = self.shapes.len();
        let n = self.originals[0].len();
        if weights.len() != k * n {
            let what = format!("{} weights for {n} vertices and {k} meshes", weights.len());
            return Err(Error::option("weights", what, "Give one a mesh for every vertex"));
        }
        weights.chunks_exact(k).try_for_each(|w| self.check(w))?;
        let mask = Mask::new(self, weights);
        self.marcher.begin(&self.shapes[mask.corner]);
        // The next call of `shape` begins at an input.
        self.weights = vec![f64::INFINITY; k];
        let mut before = 0.0;
        let reach = |morpher: &mut Self, &time: &f64| {
            let steps = ((time - before) / STEP).ceil().max(1.0) as usize;
            let at =
                |step: usize| if step == steps { time } else { before + (time - before) * step as f64 / steps as f64 };
            let goals = (0..steps).map(|step| mask.goal(at(step + 1)));
            let reached = morpher.march(goals, quality);
            before = time;
            reached
        };
        self.in_blocks(times, reach, quality, sink)
    }

    /// Follows the path `frames` and finishes its in-betweens block by block.
    fn in_blocks<T>(
        &mut self,
        frames: &[T],
        mut reach: impl FnMut(&mut Self, &T) -> Result<Reached>,
        quality: &MarchQuality,
        mut sink: impl FnMut(usize, Vec<DVec3>, DecodeReport) -> Result<()>,
    ) -> Result<()> {
        for (block, part) in frames.chunks(BLOCK).enumerate() {
            let reached: Vec<Reached> = part.iter().map(|frame| reach(self, frame)).collect::<Result<_>>()?;
            let whole: &Self = self;
            let here = control::current();
            let done: Vec<_> =
                reached.into_par_iter().map(|r| here.within(|| whole.complete(r, quality))).collect::<Result<_>>()?;
            for (k, (shape, report)) in done.into_iter().enumerate() {
                sink(block * BLOCK + k, shape, report)?;
            }
        }
        Ok(())
    }

    /// The coarse stage at `weights`, reached from where it is or from the nearest input.
    fn reach(&mut self, weights: &[f64], quality: &MarchQuality) -> Result<Reached> {
        let (corner, weight) =
            weights.iter().enumerate().fold((0, f64::MIN), |b, (k, &w)| if w > b.1 { (k, w) } else { b });
        let far = self.weights.iter().zip(weights).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        if 1.0 - weight < far || weight == 1.0 {
            self.weights = (0..weights.len()).map(|k| if k == corner { 1.0 } else { 0.0 }).collect();
            self.marcher.begin(&self.shapes[corner]);
        }
        if weight == 1.0 {
            // Not decoded, but as given, to the last bit.
            return Ok(Reached::Input(corner));
        }
        let from = std::mem::replace(&mut self.weights, weights.to_vec());
        let far = from.iter().zip(weights).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let steps = (far / STEP).ceil().max(1.0) as usize;
        let goals = (0..steps).map(|step| {
            let step = step + 1;
            let s = step as f64 / steps as f64;
            let between = || from.iter().zip(weights).map(|(a, b)| a + s * (b - a)).collect();
            Goal { mean: if step == steps { weights.to_vec() } else { between() }, each: Vec::new() }
        });
        self.march(goals, quality)
    }

    /// Follows the coarse stage through `goals`.
    fn march(&mut self, goals: impl ExactSizeIterator<Item = Goal>, quality: &MarchQuality) -> Result<Reached> {
        let (mut left, mut reached) = (goals.len(), None);
        for goal in goals {
            left -= 1;
            let held = self.anchors.blended(&self.shapes, self.marcher.hierarchy().held, &goal.mean);
            let mix = self.blend.mix(self.marcher.hierarchy(), self.marcher.stages(false), |v| goal.at(v));
            let coarse = self.marcher.follow(&held, &mix, quality, left == 0)?;
            reached = Some(Reached::Between(Box::new((goal, coarse))));
        }
        reached.ok_or_else(|| Error::numeric("the march has no steps", "Use fewer meshes"))
    }

    /// The whole mesh of what was reached, in the meshes' units.
    fn complete(&self, reached: Reached, quality: &MarchQuality) -> Result<(Vec<DVec3>, DecodeReport)> {
        let (goal, coarse) = match reached {
            Reached::Input(only) => return Ok((self.originals[only].clone(), DecodeReport::default())),
            Reached::Between(between) => *between,
        };
        let mix: Mix = self.blend.mix(self.marcher.hierarchy(), self.marcher.stages(true), |v| goal.at(v));
        let (decoded, report) = self.marcher.finish(coarse, &mix, quality)?;
        Ok((self.place(&decoded, &goal), report))
    }

    fn check(&self, weights: &[f64]) -> Result<()> {
        let wrong = |what: String| Error::option("weights", what, "Give one nonnegative number a mesh, summing to 1");
        if weights.len() != self.shapes.len() {
            return Err(wrong(format!("{} weights for {} meshes", weights.len(), self.shapes.len())));
        }
        let sum: f64 = weights.iter().sum();
        if weights.iter().any(|w| !(*w >= 0.0)) || !((sum - 1.0).abs() < 1e-9) {
            return Err(wrong(format!("the weights {weights:?} are negative or sum to {sum}")));
        }
        Ok(())
    }

    /// Decoded positions in the meshes' units; vertices that the hierarchy does not have are
    /// blended linearly.
    fn place(&self, decoded: &[V3<f64>], goal: &Goal) -> Vec<DVec3> {
        let shared = self.centres[0];
        let centre = shared + self.centres.iter().zip(&goal.mean).map(|(c, &w)| (*c - shared) * w).sum::<DVec3>();
        let numbers = self.marcher.hierarchy().order.len();
        let mut result: Vec<DVec3> = (0..self.originals[0].len())
            .map(|v| {
                // Weights of vertices without a number come after those that have one.
                let weights = goal.at((numbers + v) as u32);
                self.originals.iter().zip(weights).map(|(o, &w)| if w == 0.0 { DVec3::ZERO } else { o[v] * w }).sum()
            })
            .collect();
        for (&v, &p) in self.marcher.hierarchy().order.iter().zip(decoded) {
            result[v as usize] = DVec3::from(p) * self.diagonal + centre;
        }
        self.first.spread_positions(&mut result, |_| false);
        result
    }
}

/// The same mesh with corners that name no normal: those of an in-between would be wrong, and
/// readers make their own.
pub fn without_normals(mesh: &Mesh) -> Mesh {
    let mut bare = mesh.with_corners(|c| Corner { normal: NONE, ..c });
    bare.normals.clear();
    bare
}

/// Fails at the first difference.
fn same_connectivity(a: &Mesh, b: &Mesh) -> Result<()> {
    let wrong = |what: String| {
        Err(Error::input(
            format!("{} and {} differ: {what}", a.name, b.name),
            "Meshes of different connectivity need pairs of anchors (--pairs P.json)",
        ))
    };
    if a.vertex_count() != b.vertex_count() {
        return wrong(format!("{} and {} vertices", a.vertex_count(), b.vertex_count()));
    }
    if a.triangle_count() != b.triangle_count() {
        return wrong(format!("{} and {} triangles", a.triangle_count(), b.triangle_count()));
    }
    match (0..a.triangle_count()).find(|&t| a.triangle(t) != b.triangle(t)) {
        Some(t) => wrong(format!("triangle {t} is {:?} and {:?}", a.triangle(t), b.triangle(t))),
        None => Ok(()),
    }
}
