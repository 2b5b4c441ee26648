//! Correspondence by weighted averages (paper, section 4.3) with residual transport.

use rayon::prelude::*;

use crate::control;
use crate::engine::{LaneScalar, Lanes, Real};
use crate::error::{Error, Result};
use crate::geometry::{NONE, SurfacePoint};
use crate::surface::anchors::AnchorPairs;
use crate::surface::average::{AnchorTable, AveragedChunk, FusedWeights, SweepAnchors, orthonormalise, weights};
use crate::surface::packed::{PackedImage, PackedPoint, PointMap};
use crate::surface::project::{Found, Projection, SearchLimits};
use crate::surface::vector::{Vector, add_scaled, cast, combine, distance_squared, dot, sub};
use crate::surface::{NearestVertex, PhongSurface};

use super::confidence::{Evidence, Trust};
use super::drift::{Anchors, expected_drift, nearness};
use super::procrustes::{identity, orthogonal};
use super::{CorrespondenceOptions, Method, Shape, check_faces};

/// Squared length of the order of the distance measure near an anchor, in mean edges squared (notes
/// on the fused form: it only keeps sums in range).
pub(crate) const AVERAGE_SCALE: f64 = 16.0;

/// Points handled by one task: whole tiles of the sweep, and enough work to hide scheduling.
const CHUNK: usize = 512;

/// What a vertex adds to the averages near it: `(Q_v - Q) r_v` and the length of `r_v`.
#[derive(Clone, Copy, Debug)]
pub struct Correction<S, const D: usize> {
    /// `d_v`, in edges of the source.
    pub d: Vector<S, D>,
    /// `|r_v|`, in edges of the target.
    pub residual: S,
}

/// The barycentric coordinates of a packed point.
#[inline(always)]
fn coordinates<S: Real>(point: PackedPoint) -> [S; 3] {
    let (b0, b1) = (S::of(f64::from(point.b0)), S::of(f64::from(point.b1)));
    [b0, b1, S::ONE - b0 - b1]
}

/// `d_v` and `|r_v|` of every vertex: `Q_v` is fitted to the anchors with weights `1/D_i^2`, those
/// of eq. 13, and completed by the global fit `q`. Weights that fall off more slowly, or a part of
/// the global fit in the local one, were measured to be less accurate: far anchors decide only what
/// near ones leave open. O(V (n D^2 + D^3)).
fn local_corrections<const D: usize>(
    target: &PhongSurface<f64, D>,
    a: &[Vector<f64, D>],
    b: &[Vector<f64, D>],
    q: &[Vector<f64, D>; D],
    scale: f64,
) -> Vec<Correction<f64, D>> {
    target
        .vertices
        .par_iter()
        .map(|vertex| {
            let mut w = vec![0.0; a.len()];
            weights(&vertex.y, &vertex.t, a, &mut w);
            let own = w.iter().zip(a).fold([0.0; D], |sum, (&w, a)| add_scaled(&sum, w, a));
            let r = sub(&vertex.y, &own);
            let local = orthogonal(a, b, &nearness(&(vertex.y, vertex.t), a), q);
            let d = std::array::from_fn(|i| scale * (dot(&local[i], &r) - dot(&q[i], &r)));
            Correction { d, residual: dot(&r, &r).sqrt() }
        })
        .collect()
}

/// The two averages of a point.
#[derive(Clone, Copy, Debug)]
pub struct Scratch<S, const D: usize> {
    /// The point on the target.
    pub y: Vector<S, D>,
    /// `sum w_i a_i`: the average of the target's own anchors; `None` where neither the method nor
    /// its evidence needs it.
    pub own: Option<Vector<S, D>>,
    /// `ybar` on the source, the residual carried over where the method does so.
    pub mean: Vector<S, D>,
}

/// The map from the target to the source by inverse and forward problem.
///
/// For a point of the target with embedding `y` and weights `w` of eq. 13 with respect to the
/// target's anchors `a_i`, the source's anchors `b_i` are averaged: `ybar = sum w_i b_i` as
/// published, or `ybar = sum w_i b_i + Q r` with residual transport, `r = y - sum w_i a_i` being
/// what the target's own anchors leave over and `Q` the orthogonal map that fits the anchors best.
/// The second is computed as `Q y + sum w_i (b_i - Q a_i)`, so that it costs one matrix product per
/// point. A `Q_v` of its own for each vertex `v` of the target, fitted to the anchors near it, is
/// more accurate; its difference `d_v = (Q_v - Q) r_v` is interpolated, scaled by `|r|` over the
/// interpolated `|r_v|` so that anchors stay interpolated and the identity stays the identity.
/// `ybar` is then projected onto the source.
#[derive(Debug)]
pub struct WeightedAverages<S: Real, const D: usize> {
    /// The surface that points are on.
    pub target: PhongSurface<S, D>,
    /// The surface they are carried to.
    pub source: PhongSurface<S, D>,
    /// The target's anchors and what is averaged.
    pub table: AnchorTable<S, D>,
    /// `Q`, rows, from target edges to source edges; `None` as published.
    pub transport: Option<[Vector<S, D>; D]>,
    /// `d_v` and `|r_v|` of each vertex of the target; empty as published.
    pub corrections: Vec<Correction<S, D>>,
    /// For each vertex of the target the vertex of the source nearest to its image, or [`NONE`].
    pub starts: Vec<u32>,
    /// For each triangle of the target the triangle of the source that its centroid goes to, or
    /// [`NONE`].
    pub start_faces: Vec<u32>,
    /// For each vertex of the target the vertex of the target nearest to the average of its own
    /// anchors; empty with transport.
    pub own_starts: Vec<u32>,
    /// For each vertex of the target how far its image may be off, over the square root of the
    /// source's area; empty without evidence.
    pub drift: Vec<f64>,
    /// Mean edge of the embedded source over the square root of its area.
    pub unit: f64,
    /// What the evidence is judged by.
    pub trust: Trust,
    confidence: bool,
}

impl<S: Real, const D: usize> WeightedAverages<S, D> {
    /// Prepares the map. The images of the target's vertices are solved for here, once, each
    /// starting from the exactly nearest vertex.
    ///
    /// # Errors
    /// If an embedding is missing or not of dimension `D`, or an anchor is not embedded.
    pub fn new(
        source: Shape<'_>,
        target: Shape<'_>,
        anchors: &AnchorPairs,
        options: &CorrespondenceOptions,
    ) -> Result<Self> {
        let surface = |shape: &Shape<'_>| -> Result<PhongSurface<f64, D>> {
            match shape.embedding {
                Some(e) if e.dimension == D => PhongSurface::new(shape.topology, &e.points),
                _ => Err(Error::input("an embedding is missing", "Embed both meshes with the same --dimension")),
            }
        };
        let (source_surface, target_surface) = (surface(&source)?, surface(&target)?);
        let a: Vec<Vector<f64, D>> = anchors.target.iter().map(|p| target_surface.embed(p)).collect();
        let b: Vec<Vector<f64, D>> = anchors.source.iter().map(|p| source_surface.embed(p)).collect();
        // Edges of one surface to edges of the other, both seen at unit area.
        let unit = |s: &PhongSurface<f64, D>, shape: &Shape<'_>| s.edge / shape.mesh.area().sqrt();
        let unit_source = unit(&source_surface, &source);
        let scale = unit(&target_surface, &target) / unit_source;
        let global =
            (options.method == Method::Transport).then(|| orthogonal(&a, &b, &vec![1.0; a.len()], &identity()));
        let transport = global.map(|q| q.map(|row| row.map(|x| x * scale)));
        let image: Vec<Vector<f64, D>> = match &transport {
            None => b.clone(),
            Some(q) => a.iter().zip(&b).map(|(a, b)| std::array::from_fn(|i| b[i] - dot(&q[i], a))).collect(),
        };
        let corrections = match &global {
            None => Vec::new(),
            Some(q) => local_corrections(&target_surface, &a, &b, q, scale),
        };
        let drift = if options.confidence {
            let known = Anchors { a: &a, b: &b };
            expected_drift(&source_surface, &target_surface, anchors, known, global.map(|_| scale))
        } else {
            Vec::new()
        };
        let table = AnchorTable::new(a, image)?.cast();
        let mut map = Self {
            target: target_surface.cast(),
            source: source_surface.cast(),
            table,
            transport: transport.map(|q| q.map(|row| cast(&row))),
            corrections: corrections
                .iter()
                .map(|c| Correction { d: cast(&c.d), residual: S::of(c.residual) })
                .collect(),
            starts: Vec::new(),
            start_faces: Vec::new(),
            own_starts: Vec::new(),
            drift: drift.iter().map(|d| d * unit_source).collect(),
            unit: unit_source,
            trust: Trust::default(),
            confidence: options.confidence,
        };
        map.solve_starts(target);
        Ok(map)
    }

    /// Solves for the images of vertices and centroids, from which the searches of all other points
    /// start.
    fn solve_starts(&mut self, target: Shape<'_>) {
        let nearest = NearestVertex::new(&self.source);
        let map = &*self;
        let corner = |v: u32| {
            let p = target.topology.vertex_point(v)?;
            Some((p.face, p.barycentric.map(S::of)))
        };
        let starts = (0..target.mesh.vertex_count() as u32)
            .into_par_iter()
            .map(|v| {
                let Some((t, x)) = corner(v) else { return NONE };
                let mean = map.average(t, x).mean;
                let start = nearest.find(&mean);
                let p = map.source.project(&mean, &[start], SearchLimits::FIRST);
                if p.face == NONE {
                    return start;
                }
                let k = SurfacePoint::new(p.face, p.x.map(|v| v.to_f64())).dominant_corner();
                map.source.triangles[p.face as usize].v[k]
            })
            .collect();
        let start_faces = (0..target.mesh.triangle_count() as u32)
            .into_par_iter()
            .map(|t| {
                let mean = map.average(t, [S::of(1.0 / 3.0); 3]).mean;
                map.source.project(&mean, &[nearest.find(&mean)], SearchLimits::FIRST).face
            })
            .collect();
        let own_starts = if self.transport.is_none() && self.confidence {
            let nearest = NearestVertex::new(&self.target);
            (0..target.mesh.vertex_count() as u32)
                .into_par_iter()
                .map(|v| {
                    let own = corner(v).and_then(|(t, x)| map.average(t, x).own);
                    own.map_or(NONE, |own| nearest.find(&own))
                })
                .collect()
        } else {
            Vec::new()
        };
        (self.starts, self.start_faces, self.own_starts) = (starts, start_faces, own_starts);
    }

    /// The point `x` of the target's triangle `face` and an orthonormal basis of its interpolated
    /// tangent plane.
    pub fn frame(&self, face: u32, x: [S; 3]) -> (Vector<S, D>, [Vector<S, D>; 2]) {
        let t = self.target.triangle(face);
        (t.point(&x), orthonormalise(t.psi(&x)))
    }

    /// Inverse problem on the target fused with the averages.
    pub fn average(&self, face: u32, x: [S; 3]) -> Scratch<S, D> {
        let (y, basis) = self.frame(face, x);
        let weights = FusedWeights::solve(&y, &basis, &self.table.own, S::of(AVERAGE_SCALE));
        let own = self.averages_own().then(|| weights.average(&self.table.own));
        let mean = self.carry(&y, &weights.average(&self.table.image));
        Scratch { y, own, mean: self.correct(face, &x, &y, own.as_ref(), mean) }
    }

    /// Whether the target's own anchors are averaged too: for the residual, or for the round trip.
    pub(crate) fn averages_own(&self) -> bool {
        self.transport.is_some() || self.confidence
    }

    /// Adds the interpolated local correction.
    #[inline(always)]
    fn correct(
        &self,
        face: u32,
        x: &[S; 3],
        y: &Vector<S, D>,
        own: Option<&Vector<S, D>>,
        mean: Vector<S, D>,
    ) -> Vector<S, D> {
        let Some(own) = own.filter(|_| !self.corrections.is_empty()) else { return mean };
        let [a, b, c] = self.target.triangles[face as usize].v.map(|v| &self.corrections[v as usize]);
        let expected = x[0] * a.residual + x[1] * b.residual + x[2] * c.residual;
        let r = sub(y, own);
        let size = dot(&r, &r).sqrt();
        if !(expected > S::ZERO) {
            return mean;
        }
        let factor = (size / expected).minimum(S::ONE);
        add_scaled(&mean, factor, &combine(x, [&a.d, &b.d, &c.d]))
    }

    /// Adds `Q y` where the residual is carried over.
    #[inline(always)]
    fn carry(&self, y: &Vector<S, D>, mean: &Vector<S, D>) -> Vector<S, D> {
        match &self.transport {
            None => *mean,
            Some(q) => std::array::from_fn(|i| mean[i] + dot(&q[i], y)),
        }
    }

    /// The source vertices from which the search of a point of the target's triangle `face` starts.
    pub fn starts_of(&self, face: u32) -> [u32; 3] {
        self.target.triangles[face as usize].v.map(|v| self.starts[v as usize])
    }

    /// Forward problem: projects an average of a point of the target's triangle `face` onto the
    /// source.
    #[inline(always)]
    pub fn forward(&self, face: u32, mean: &Vector<S, D>) -> Projection<S> {
        self.source.project_near(mean, self.start_faces[face as usize], &self.starts_of(face))
    }

    /// The expected error of a point, between those of the vertices around it.
    pub fn drift_at(&self, point: PackedPoint) -> f64 {
        if self.drift.is_empty() {
            return 0.0;
        }
        let v = self.target.triangles[point.face as usize].v;
        coordinates::<f64>(point).iter().zip(v).map(|(x, v)| x * self.drift[v as usize]).sum::<f64>().max(0.0)
    }

    /// What speaks for and against the image of a point.
    pub fn evidence(&self, point: PackedPoint, scratch: &Scratch<S, D>, image: &Projection<S>) -> Evidence {
        let face = point.face;
        Evidence {
            residual: image.distance_squared.to_f64().sqrt() * self.unit,
            drift: self.drift_at(point),
            round_trip: scratch
                .own
                .filter(|_| self.transport.is_none())
                .map(|own| self.round_trip(face, &scratch.y, &own)),
            found: image.found,
        }
    }

    /// Distance, in mean edges, between a point and the forward problem's answer to its own weights
    /// on its own surface (section 4.4).
    pub fn round_trip(&self, face: u32, y: &Vector<S, D>, own: &Vector<S, D>) -> f64 {
        let starts = self.target.triangles[face as usize].v.map(|v| self.own_starts[v as usize]);
        let back = self.target.project(own, &starts, SearchLimits::FIRST);
        if back.face == NONE || back.found == Found::Nothing {
            return f64::INFINITY;
        }
        distance_squared(&self.target.triangle(back.face).point(&back.x), y).to_f64().sqrt()
    }

    /// Maps one point.
    pub fn map_point(&self, point: PackedPoint) -> PackedImage {
        let scratch = self.average(point.face, coordinates(point));
        self.finish(point, &scratch)
    }

    fn finish(&self, point: PackedPoint, scratch: &Scratch<S, D>) -> PackedImage {
        let image = self.forward(point.face, &scratch.mean);
        if image.face == NONE {
            return PackedImage::NOWHERE;
        }
        let (confidence, status) = if self.confidence {
            self.trust.judge(&self.evidence(point, scratch, &image))
        } else {
            Trust::unchecked(image.found)
        };
        PackedImage {
            face: image.face,
            b0: image.x[0].to_f64() as f32,
            b1: image.x[1].to_f64() as f32,
            confidence: confidence as f32,
            status: status as u32,
        }
    }

    /// Whether evidence is gathered for every point.
    pub fn gathers_evidence(&self) -> bool {
        self.confidence
    }
}

impl<S: LaneScalar, const D: usize> WeightedAverages<S, D> {
    /// Maps a chunk of points: frames and averages in SIMD lanes, then each projection for itself.
    fn map_chunk(&self, points: &[PackedPoint], out: &mut [PackedImage], chunk: &mut AveragedChunk<S, D>) {
        let both = [self.table.image.as_slice(), self.table.own.as_slice()];
        let images = if self.averages_own() { &both[..] } else { &both[..1] };
        let anchors = SweepAnchors { own: &self.table.own, images, transport: self.transport.as_ref() };
        chunk.compute(Lanes::detect(), &self.target, anchors, points);
        for (i, (point, image)) in points.iter().zip(out).enumerate() {
            let (y, own) = (chunk.point(i), self.averages_own().then(|| chunk.mean(1, i)));
            let mean = self.correct(point.face, &coordinates(*point), &y, own.as_ref(), chunk.mean(0, i));
            *image = self.finish(*point, &Scratch { y, own, mean });
        }
    }
}

impl<S: LaneScalar, const D: usize> PointMap for WeightedAverages<S, D> {
    fn map(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> Result<()> {
        check_faces(points, self.target.triangles.len())?;
        images.clear();
        images.resize(points.len(), PackedImage::NOWHERE);
        let here = control::current();
        images.par_chunks_mut(CHUNK).zip(points.par_chunks(CHUNK)).try_for_each_init(
            AveragedChunk::new,
            |chunk, (out, points)| {
                self.map_chunk(points, out, chunk);
                here.check()
            },
        )
    }
}
