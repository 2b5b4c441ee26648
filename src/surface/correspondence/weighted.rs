//! Correspondence by weighted averages (paper, section 4.3) with residual transport.

use rayon::prelude::*;

use crate::engine::{LaneScalar, Lanes, Real};
use crate::error::{Error, Result};
use crate::geometry::{NONE, SurfacePoint};
use crate::surface::anchors::AnchorPairs;
use crate::surface::average::{AnchorTable, AveragedChunk, SweepAnchors, average_fused, orthonormalise};
use crate::surface::packed::{PackedImage, PackedPoint, PointMap};
use crate::surface::project::{Found, Projection, SearchLimits};
use crate::surface::vector::{Vector, cast, distance_squared, dot, sub};
use crate::surface::{NearestVertex, PhongSurface};

use super::confidence::{Evidence, Trust};
use super::procrustes::orthogonal;
use super::{CorrespondenceOptions, Method, Shape, check_faces};

/// Squared length of the order of the distance measure near an anchor, in mean edges squared (notes on the fused form: it only keeps
/// sums in range).
pub(crate) const AVERAGE_SCALE: f64 = 16.0;

/// Points handled by one task: whole tiles of the sweep, and enough work to hide scheduling.
const CHUNK: usize = 512;

/// The two averages of a point.
#[derive(Clone, Copy, Debug)]
pub struct Scratch<S, const D: usize> {
    /// The point on the target.
    pub y: Vector<S, D>,
    /// `sum w_i a_i`: the average of the target's own anchors.
    pub own: Vector<S, D>,
    /// `ybar` on the source, the residual carried over where the method does so.
    pub mean: Vector<S, D>,
}

/// The map from the target to the source by inverse and forward problem.
///
/// For a point of the target with embedding `y` and weights `w` of eq. 13 with respect to the target's anchors `a_i`, the source's anchors `b_i` are averaged:
/// `ybar = sum w_i b_i` as published, or `ybar = sum w_i b_i + Q (y - sum w_i a_i)` with residual transport, `Q` being the orthogonal map that
/// fits the anchors best. The second is computed as `Q y + sum w_i (b_i - Q a_i)`, so that it costs one matrix product per point. `ybar` is then
/// projected onto the source.
#[derive(Debug)]
pub struct WeightedAverages<S: Real, const D: usize> {
    /// The surface that points are on.
    pub target: PhongSurface<S, D>,
    /// The surface they are carried to.
    pub source: PhongSurface<S, D>,
    /// The target's anchors and what is averaged.
    pub table: AnchorTable<S, D>,
    /// The target's anchors averaged with their own weights, for the round trip.
    pub own: AnchorTable<S, D>,
    /// `Q`, rows, from target edges to source edges; `None` as published.
    pub transport: Option<[Vector<S, D>; D]>,
    /// For each vertex of the target the vertex of the source nearest to its image, or [`NONE`].
    pub starts: Vec<u32>,
    /// What the evidence is judged by.
    pub trust: Trust,
    confidence: bool,
}

impl<S: Real, const D: usize> WeightedAverages<S, D> {
    /// Prepares the map. The images of the target's vertices are solved for here, once, each starting from the exactly nearest vertex.
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
        let scale = unit(&target_surface, &target) / unit(&source_surface, &source);
        let transport =
            (options.method == Method::Transport).then(|| orthogonal(&a, &b).map(|row| row.map(|x| x * scale)));
        let image: Vec<Vector<f64, D>> = match &transport {
            None => b.clone(),
            Some(q) => a.iter().zip(&b).map(|(a, b)| std::array::from_fn(|i| b[i] - dot(&q[i], a))).collect(),
        };
        let table = AnchorTable::new(a.clone(), image)?.cast();
        let own = AnchorTable::new(a.clone(), a)?.cast();
        let mut map = Self {
            target: target_surface.cast(),
            source: source_surface.cast(),
            table,
            own,
            transport: transport.map(|q| q.map(|row| cast(&row))),
            starts: Vec::new(),
            trust: Trust::default(),
            confidence: options.confidence,
        };
        map.solve_starts(target);
        Ok(map)
    }

    fn solve_starts(&mut self, target: Shape<'_>) {
        let nearest = NearestVertex::new(&self.source);
        let map = &*self;
        self.starts = (0..target.mesh.vertex_count() as u32)
            .into_par_iter()
            .map(|v| {
                let Some(&t) = target.topology.vertex_triangles(v).first() else { return NONE };
                let x = target.topology.triangles[t as usize].map(|w| if w == v { S::ONE } else { S::ZERO });
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
    }

    /// The point `x` of the target's triangle `face` and an orthonormal basis of its interpolated tangent plane.
    pub fn frame(&self, face: u32, x: [S; 3]) -> (Vector<S, D>, [Vector<S, D>; 2]) {
        let t = self.target.triangle(face);
        (t.point(&x), orthonormalise(t.psi(&x)))
    }

    /// Inverse problem on the target fused with the averages.
    pub fn average(&self, face: u32, x: [S; 3]) -> Scratch<S, D> {
        let (y, basis) = self.frame(face, x);
        let scale = S::of(AVERAGE_SCALE);
        let mean = self.carry(&y, &average_fused(&y, &basis, &self.table, scale).mean);
        let own = if self.confidence { average_fused(&y, &basis, &self.own, scale).mean } else { y };
        Scratch { y, own, mean }
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

    /// Forward problem: projects an average onto the source; a second, longer search for what the first one leaves.
    pub fn forward(&self, face: u32, mean: &Vector<S, D>) -> Projection<S> {
        let starts = self.starts_of(face);
        let first = self.source.project(mean, &starts, SearchLimits::FIRST);
        if first.found == Found::Nothing && first.face != NONE {
            return self.source.project(mean, &starts, SearchLimits::SECOND);
        }
        first
    }

    /// What speaks for and against the image of a point.
    pub fn evidence(&self, face: u32, scratch: &Scratch<S, D>, image: &Projection<S>) -> Evidence {
        let back = self.target.project(&scratch.own, &self.target.triangles[face as usize].v, SearchLimits::FIRST);
        let round_trip = if back.face == NONE || back.found == Found::Nothing {
            f64::INFINITY
        } else {
            distance_squared(&self.target.triangle(back.face).point(&back.x), &scratch.y).to_f64().sqrt()
        };
        let r = sub(&scratch.y, &scratch.own);
        Evidence {
            round_trip,
            own_residual: dot(&r, &r).to_f64().sqrt(),
            residual: image.distance_squared.to_f64().sqrt(),
            found: image.found,
        }
    }

    /// Maps one point.
    pub fn map_point(&self, point: PackedPoint) -> PackedImage {
        let x = [S::of(f64::from(point.b0)), S::of(f64::from(point.b1))];
        let x = [x[0], x[1], S::ONE - x[0] - x[1]];
        let scratch = self.average(point.face, x);
        self.finish(point.face, &scratch)
    }

    fn finish(&self, face: u32, scratch: &Scratch<S, D>) -> PackedImage {
        let image = self.forward(face, &scratch.mean);
        if image.face == NONE {
            return PackedImage::NOWHERE;
        }
        let (confidence, status) = if self.confidence {
            self.trust.judge(&self.evidence(face, scratch, &image))
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
}

impl<S: LaneScalar, const D: usize> WeightedAverages<S, D> {
    /// Maps a chunk of points: frames and averages in SIMD lanes, then each projection for itself.
    fn map_chunk(&self, points: &[PackedPoint], out: &mut [PackedImage], chunk: &mut AveragedChunk<S, D>) {
        let both = [self.table.image.as_slice(), self.own.own.as_slice()];
        let anchors = SweepAnchors {
            own: &self.own.own,
            images: if self.confidence { &both } else { &both[..1] },
            transport: self.transport.as_ref(),
        };
        chunk.compute(Lanes::detect(), &self.target, anchors, points);
        for (i, (point, image)) in points.iter().zip(out).enumerate() {
            let y = chunk.point(i);
            let own = if self.confidence { chunk.mean(1, i) } else { y };
            *image = self.finish(point.face, &Scratch { y, own, mean: chunk.mean(0, i) });
        }
    }
}

impl<S: LaneScalar, const D: usize> PointMap for WeightedAverages<S, D> {
    fn map(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> Result<()> {
        check_faces(points, self.target.triangles.len())?;
        images.clear();
        images.resize(points.len(), PackedImage::NOWHERE);
        images
            .par_chunks_mut(CHUNK)
            .zip(points.par_chunks(CHUNK))
            .for_each_init(AveragedChunk::new, |chunk, (out, points)| self.map_chunk(points, out, chunk));
        Ok(())
    }
}
