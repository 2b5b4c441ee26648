//! Aligning the embeddings of two surfaces: the scaling of one is done again, started from its
//! image on the other.
//!
//! Surfaces that are bent alike only nearly have embeddings that are alike only nearly, and a map
//! between them inherits the difference. Started from where the other surface's is, a scaling first
//! mends what is most wrong: a few sweeps bring the distances of neighbours right and leave the
//! rest where it agrees. More sweeps lead back to where the embedding was, since it is a minimum
//! that does not depend on the start. Whether that makes the map better is asked of the anchors.

use serde::Serialize;
use web_time::Instant;

use super::anchors::{AnchorPairs, vertex_point};
use super::correspondence::{CorrespondenceOptions, Method, Shape, correspondence};
use super::embedding::{Embedding, EmbeddingOptions, Rescaling};
use super::packed::{PackedPoint, PointMap};
use crate::error::{Error, Result};
use crate::geometry::{Frame, SurfacePoint};
use crate::progress::{Progress, Quiet};

/// Anchors without which nothing is learnt from those that are left out.
const LEAST_ANCHORS: usize = 5;
/// Standard errors that a gain has at least: the outermost anchors, left out, are missed by far
/// with any embedding, and a few of them decide on the mean.
const LEAST_CERTAINTY: f64 = 2.0;
/// Parts that the anchors are left out in, each anchor by itself if there are no more. With fewer
/// parts what is known is so much less than all that an alignment looks better than it will be.
const FOLDS: usize = 20;

/// How embeddings are aligned, and when that counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlignmentOptions {
    /// What the target's embedding was made with.
    pub embedding: EmbeddingOptions,
    /// How often the target is sent to the source and scaled again. Default 1: in what was measured
    /// a second time was no better (docs/methods.md).
    pub rounds: usize,
    /// Sweeps of each scaling, by majorisation alone. Default 3: more lose the agreement again
    /// before they gain anything (docs/methods.md).
    pub sweeps: usize,
    /// Whether the fields between are relaxed. Default true; as the field that is wanted in the
    /// end.
    pub relax: bool,
    /// The alignment is kept if anchors left out are missed by less than `1 - gain` times as much,
    /// and the difference is at least two standard errors. Default 0.05; minus infinity keeps it
    /// whatever they say.
    pub gain: f64,
}

impl Default for AlignmentOptions {
    fn default() -> Self {
        Self { embedding: EmbeddingOptions::default(), rounds: 1, sweeps: 3, relax: true, gain: 0.05 }
    }
}

/// What anchors left out say of an alignment.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AlignmentReport {
    /// Mean distance by which the field misses anchors it does not know, in space over the square
    /// root of the source's area.
    pub before: f64,
    /// The same with embeddings that were aligned without these anchors.
    pub after: f64,
    /// Mean of the differences over its standard error.
    pub standard_errors: f64,
    /// Whether the aligned embedding is used.
    pub kept: bool,
    /// Wall-clock seconds.
    pub seconds: f64,
}

/// The result of [`align`].
#[derive(Clone, Debug)]
pub struct Alignment {
    /// The target's embedding, beside the source's; `None` if that is no better than the one there
    /// is.
    pub embedding: Option<Embedding>,
    /// Why.
    pub report: AlignmentReport,
}

/// Aligns the target's embedding with the source's, for [`Method::Field`] through `anchors`.
///
/// The field sends the landmarks of the target to the source; the scaling of the target starts
/// again from where they are in the source's embedding, with the target's own distances, for a few
/// sweeps, and the other vertices follow as a least-squares mesh. An anchor that took part in this
/// is met better whether the alignment is right or not, so that leaving it out of the predictions
/// alone flatters the alignment. Here one anchor (of more than twenty, a twentieth) at a time is
/// left out of everything: alignment, predictions, relaxation. The field misses them by some
/// distance with either embedding, and the alignment, then made with all anchors, is kept only if
/// that is less by [`AlignmentOptions::gain`] and not by chance.
///
/// A component of the target whose landmarks go to several components of the source is scaled from
/// where it was. Mirrored pairs need no care: distances do not know them. Deterministic for any
/// number of threads. Costs the distances of the embedding once more, 21 times
/// [`AlignmentOptions::rounds`] fields, scalings and least-squares meshes, and 40 fields.
///
/// Source: the alignment is not in the paper; its authors embed every mesh by itself (section 3.5).
///
/// # Errors
/// [`Error::Input`] for fewer than five anchors, anchors that do not fit ([`AnchorPairs::check`])
/// and a target's embedding that [`Embedding::compute`] does not make of the target with these
/// options ([`Rescaling::new`]); [`Error::Option`] for a gain of 1 or more.
pub fn align(
    source: Shape<'_>,
    target: Shape<'_>,
    anchors: &AnchorPairs,
    options: &AlignmentOptions,
    progress: &dyn Progress,
) -> Result<Alignment> {
    let clock = Instant::now();
    if !(options.gain < 1.0) {
        return Err(Error::option("gain", format!("{} is not below 1", options.gain), "Use 0.05"));
    }
    anchors.check((source.mesh, source.topology), (target.mesh, target.topology))?;
    if anchors.len() < LEAST_ANCHORS {
        let what = format!("{} anchors cannot tell whether aligned embeddings are better", anchors.len());
        return Err(Error::input(what, format!("Give {LEAST_ANCHORS} or more, or do not align")));
    }
    let Some(embedding) = target.embedding else {
        return Err(Error::input("an embedding is missing", "Compute the embeddings of both meshes first"));
    };
    let rescaling = Rescaling::new(target.mesh, target.topology, embedding, &options.embedding, progress)?;
    let aligner = Aligner { source, target, rescaling, options };
    let folds = FOLDS.min(anchors.len());
    progress.stage("alignment", 2 * folds as u64 + 1);
    let mut missed = [Vec::new(), Vec::new()];
    for fold in 0..folds {
        let (known, held) = split(anchors, fold, folds);
        missed[0].extend(aligner.missed(None, &known, &held)?);
        progress.advance(1);
        let aligned = aligner.aligned(&known)?;
        missed[1].extend(aligner.missed(Some(&aligned), &known, &held)?);
        progress.advance(1);
    }
    let mut report = AlignmentReport::new(&missed[0], &missed[1]);
    report.kept = report.is_better(options.gain);
    let embedding = if report.kept { Some(aligner.aligned(anchors)?) } else { None };
    progress.advance(1);
    report.seconds = clock.elapsed().as_secs_f64();
    Ok(Alignment { embedding, report })
}

impl AlignmentReport {
    /// From what was missed, anchor by anchor.
    fn new(before: &[f64], after: &[f64]) -> Self {
        let n = before.len() as f64;
        let mean = |x: &[f64]| x.iter().sum::<f64>() / n;
        let gains: Vec<f64> = before.iter().zip(after).map(|(b, a)| b - a).collect();
        let gain = mean(&gains);
        let variance = gains.iter().map(|g| (g - gain) * (g - gain)).sum::<f64>() / (n - 1.0);
        let standard_errors = if gain == 0.0 { 0.0 } else { gain / (variance / n).sqrt() };
        Self { before: mean(before), after: mean(after), standard_errors, kept: false, seconds: 0.0 }
    }

    /// Whether less is missed by the part `gain`, and that hardly by chance.
    fn is_better(&self, gain: f64) -> bool {
        gain == f64::NEG_INFINITY || self.after < (1.0 - gain) * self.before && self.standard_errors >= LEAST_CERTAINTY
    }
}

/// The anchors but those of one fold, and those.
fn split(anchors: &AnchorPairs, fold: usize, folds: usize) -> (AnchorPairs, AnchorPairs) {
    let (mut known, mut held) = (AnchorPairs::default(), AnchorPairs::default());
    for (i, (s, t)) in anchors.source.iter().zip(&anchors.target).enumerate() {
        let to = if i % folds == fold { &mut held } else { &mut known };
        to.source.push(*s);
        to.target.push(*t);
    }
    (known, held)
}

/// A pair whose target is scaled again.
struct Aligner<'a> {
    source: Shape<'a>,
    target: Shape<'a>,
    rescaling: Rescaling<'a>,
    options: &'a AlignmentOptions,
}

impl Aligner<'_> {
    /// The field through these anchors, the target with this embedding or its own.
    fn field(&self, embedding: Option<&Embedding>, anchors: &AnchorPairs) -> Result<Box<dyn PointMap + Send>> {
        let options = CorrespondenceOptions {
            method: Method::Field,
            confidence: false,
            keep_all: true,
            relax: Some(self.options.relax),
            ..CorrespondenceOptions::default()
        };
        let target = Shape { embedding: embedding.or(self.target.embedding), ..self.target };
        correspondence(self.source, target, anchors, &options)
    }

    /// Where points of the target go.
    fn images(map: &dyn PointMap, points: &[SurfacePoint]) -> Result<Vec<Option<SurfacePoint>>> {
        let points: Vec<PackedPoint> = points.iter().map(|&p| p.into()).collect();
        let mut images = Vec::new();
        map.map(&points, &mut images)?;
        Ok(images.iter().map(|i| i.point()).collect())
    }

    /// How far the field through `known` misses `held`, one by one.
    fn missed(&self, embedding: Option<&Embedding>, known: &AnchorPairs, held: &AnchorPairs) -> Result<Vec<f64>> {
        let images = Self::images(self.field(embedding, known)?.as_ref(), &held.target)?;
        let (mesh, frame) = (self.source.mesh, Frame::of_mesh(self.source.mesh));
        let unit = mesh.area().sqrt() * frame.scale;
        let off = |p: &SurfacePoint, to: &SurfacePoint| frame.place(p, mesh).distance(frame.place(to, mesh)) / unit;
        Ok(images.iter().zip(&held.source).map(|(p, to)| p.map_or(1.0, |p| off(&p, to))).collect())
    }

    /// The target's embedding, scaled from its image.
    fn aligned(&self, anchors: &AnchorPairs) -> Result<Embedding> {
        let scaled = |embedding: Option<&Embedding>| {
            let start = self.start(self.field(embedding, anchors)?.as_ref())?;
            self.rescaling.restart(&start, self.options.sweeps, &Quiet)
        };
        let mut embedding = scaled(None)?;
        for _ in 1..self.options.rounds {
            embedding = scaled(Some(&embedding))?;
        }
        Ok(embedding)
    }

    /// Where the landmarks of the target are in the source's embedding, in the target's units: a
    /// row for each.
    fn start(&self, map: &dyn PointMap) -> Result<Vec<f64>> {
        let (Some(onto), Some(of)) = (self.source.embedding, self.target.embedding) else {
            return Err(Error::input("an embedding is missing", "Compute the embeddings of both meshes first"));
        };
        let point = |&v: &u32| vertex_point(self.target.mesh, self.target.topology, v, "landmark");
        let points: Vec<SurfacePoint> = of.landmarks.iter().map(point).collect::<Result<_>>()?;
        let images = Self::images(map, &points)?;
        // Components of an embedding stand apart: one that is torn between them has no place.
        let mut goes = vec![None; self.target.topology.component_count as usize];
        let mut torn = vec![false; goes.len()];
        for (from, to) in points.iter().zip(&images) {
            let c = self.target.topology.triangle_component(from.face) as usize;
            let to = to.map(|p| self.source.topology.triangle_component(p.face));
            torn[c] |= to.is_none() || *goes[c].get_or_insert(to) != to;
        }
        let scale = self.target.mesh.area().sqrt() / self.source.mesh.area().sqrt();
        let row = |(from, to): (&SurfacePoint, &Option<SurfacePoint>)| -> Vec<f64> {
            let c = self.target.topology.triangle_component(from.face) as usize;
            let Some(p) = to.filter(|_| !torn[c]) else { return vec![f64::NAN; onto.dimension] };
            let corners = self.source.topology.triangles[p.face as usize].map(|v| onto.point(v as usize));
            let at = |k: usize| (0..3).map(|c| p.barycentric[c] * corners[c][k]).sum::<f64>() * scale;
            (0..onto.dimension).map(at).collect()
        };
        Ok(points.iter().zip(&images).flat_map(row).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Mesh, Topology};
    use crate::models::shapes::lobed_sphere;
    use crate::surface::correspondence::procrustes::{identity, orthogonal};
    use crate::surface::vector::{Vector, distance_squared, dot, sub};

    struct Side(Mesh, Topology, Embedding);

    impl Side {
        fn new(mesh: Mesh, options: &EmbeddingOptions) -> Self {
            let topology = Topology::new(&mesh);
            let embedding = Embedding::compute(&mesh, &topology, options, &Quiet).unwrap();
            Self(mesh, topology, embedding)
        }

        fn shape(&self) -> Shape<'_> {
            Shape { mesh: &self.0, topology: &self.1, embedding: Some(&self.2) }
        }
    }

    fn embedding() -> EmbeddingOptions {
        EmbeddingOptions { landmarks: 200, ..EmbeddingOptions::default() }
    }

    fn options() -> AlignmentOptions {
        AlignmentOptions { embedding: embedding(), ..AlignmentOptions::default() }
    }

    fn pairs(source: &Side, target: &Side, vertices: &[u32]) -> AnchorPairs {
        let points = |s: &Side| vertices.iter().map(|&v| s.1.vertex_point(v).unwrap()).collect();
        AnchorPairs { source: points(source), target: points(target) }
    }

    /// How far the embeddings of surfaces of the same connectivity are from being congruent: rms
    /// distance after the best orthogonal map, over the rms distance from the middle.
    fn disagreement(a: &Embedding, b: &Embedding) -> f64 {
        let points = |e: &Embedding| -> Vec<Vector<f64, 8>> {
            let all: Vec<Vector<f64, 8>> = e.points.chunks_exact(8).map(|y| std::array::from_fn(|k| y[k])).collect();
            let mean: Vector<f64, 8> =
                std::array::from_fn(|k| all.iter().map(|y| y[k]).sum::<f64>() / all.len() as f64);
            all.iter().map(|y| sub(y, &mean)).collect()
        };
        let (a, b) = (points(a), points(b));
        let q = orthogonal(&a, &b, &vec![1.0; a.len()], &identity());
        let turned = |y: &Vector<f64, 8>| -> Vector<f64, 8> { std::array::from_fn(|k| dot(&q[k], y)) };
        let off: f64 = a.iter().zip(&b).map(|(a, b)| distance_squared(&turned(a), b)).sum();
        (off / b.iter().map(|y| dot(y, y)).sum::<f64>()).sqrt()
    }

    /// A lumpy body, and the same with a part of it reflected in a plane: bent, but to nobody on
    /// it.
    fn dented() -> [Mesh; 2] {
        let whole = lobed_sphere(4, 0.2);
        let mut dented = whole.clone();
        dented.positions.iter_mut().filter(|p| p.z > 0.5).for_each(|p| p.z = 1.0 - p.z);
        [whole, dented]
    }

    /// A long lumpy body, and the same bent by a quarter of a turn.
    fn bodies() -> [Mesh; 2] {
        let mut straight = lobed_sphere(4, 0.25);
        straight.positions.iter_mut().for_each(|p| p.x *= 6.0);
        let mut bent = straight.clone();
        let radius = 24.0 / std::f64::consts::PI;
        for p in &mut bent.positions {
            let (sin, cos) = (p.x / radius).sin_cos();
            (p.x, p.y) = ((radius + p.y) * sin, (radius + p.y) * cos);
        }
        [straight, bent]
    }

    #[test]
    fn aligned_embeddings_agree_better() {
        let [source, target] = dented().map(|m| Side::new(m, &embedding()));
        let vertices: Vec<u32> = (0..source.0.vertex_count() as u32).step_by(97).collect();
        let anchors = pairs(&source, &target, &vertices);
        // Whatever the anchors say of it.
        let options = AlignmentOptions { gain: f64::NEG_INFINITY, ..options() };
        let rescaling = Rescaling::new(&target.0, &target.1, &target.2, &options.embedding, &Quiet).unwrap();
        let aligner = Aligner { source: source.shape(), target: target.shape(), rescaling, options: &options };
        let aligned = aligner.aligned(&anchors).unwrap();
        let (before, after) = (disagreement(&source.2, &target.2), disagreement(&source.2, &aligned));
        println!("disagreement {before:.4}, aligned {after:.4}, stress {:.6} {:.6}", target.2.stress, aligned.stress);
        assert!(after < 0.8 * before, "{before} {after}");
        assert!(aligned.stress < 2.0 * target.2.stress);
        // The measure can fail.
        let mut moved = aligned.clone();
        moved.points.rotate_left(8);
        assert!(disagreement(&source.2, &moved) > after + 0.01);
    }

    #[test]
    fn what_helps_nothing_is_not_kept() {
        let side = Side::new(lobed_sphere(2, 0.3), &embedding());
        let vertices: Vec<u32> = (0..side.0.vertex_count() as u32).step_by(7).collect();
        let anchors = pairs(&side, &side, &vertices);
        let same = align(side.shape(), side.shape(), &anchors, &options(), &Quiet).unwrap();
        assert!(!same.report.kept && same.embedding.is_none() && same.report.before < 1e-4, "{:?}", same.report);
        // The measure can fail: two anchors exchanged are missed.
        let mut wrong = anchors.clone();
        wrong.source.swap(2, 9);
        let wrong = align(side.shape(), side.shape(), &wrong, &options(), &Quiet).unwrap().report;
        assert!(wrong.before > 0.02, "{wrong:?}");

        // A gain that is small, due to one anchor, or none.
        let kept = |before: &[f64], after: &[f64]| AlignmentReport::new(before, after).is_better(0.05);
        assert!(kept(&[1.0, 2.0, 1.5, 1.2], &[0.8, 1.7, 1.2, 1.1]));
        assert!(!kept(&[1.0, 2.0, 1.5, 1.2], &[0.98, 1.97, 1.47, 1.18]));
        assert!(!kept(&[1.0, 2.0, 1.5, 9.0], &[1.1, 2.1, 1.5, 2.0]));
        for [before, after] in [[1.0, 1.5], [1.0, 1.0], [0.0, 0.0], [f64::NAN, 0.1], [1.0, f64::NAN]] {
            assert!(!kept(&[before; 6], &[after; 6]), "{before} {after}");
        }
    }

    #[test]
    fn a_mirrored_source_makes_no_difference() {
        let [straight, target] = bodies().map(|mut m| {
            // A coarser one: the same vertices come first.
            let coarse = lobed_sphere(2, 0.25);
            m.positions.truncate(coarse.vertex_count());
            Mesh::of_triangles(&m.name, m.positions, &coarse.triangles())
        });
        let mut mirrored = straight.clone();
        mirrored.positions.iter_mut().for_each(|p| p.y = -p.y);
        let [source, target, mirrored] = [straight, target, mirrored].map(|m| Side::new(m, &embedding()));
        let vertices: Vec<u32> = (0..source.0.vertex_count() as u32).step_by(11).collect();
        let anchors = pairs(&source, &target, &vertices);
        let [a, b] =
            [&source, &mirrored].map(|s| align(s.shape(), target.shape(), &anchors, &options(), &Quiet).unwrap());
        assert_eq!(a.report.kept, b.report.kept);
        assert!((a.report.before - b.report.before).abs() < 0.05 * a.report.before, "{:?} {:?}", a.report, b.report);
    }

    #[test]
    fn what_cannot_be_asked_is_refused() {
        let side = Side::new(lobed_sphere(2, 0.3), &embedding());
        let anchors = pairs(&side, &side, &[0, 20, 40, 60, 80, 100]);
        let refused = |target: Shape<'_>, anchors: &AnchorPairs, options: &AlignmentOptions, words: &str| {
            let error = align(side.shape(), target, anchors, options, &Quiet).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        };
        let few = pairs(&side, &side, &[0, 20, 40, 60]);
        refused(side.shape(), &few, &options(), "4 anchors cannot tell");
        refused(Shape { embedding: None, ..side.shape() }, &anchors, &options(), "embedding is missing");
        refused(side.shape(), &anchors, &AlignmentOptions { gain: f64::NAN, ..options() }, "gain");
        let own = Embedding { landmarks: Vec::new(), ..side.2.clone() };
        refused(Shape { embedding: Some(&own), ..side.shape() }, &anchors, &options(), "no landmarks");
    }
}
