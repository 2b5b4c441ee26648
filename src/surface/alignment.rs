//! Aligning the embeddings of two surfaces: the scaling of one is done again, started from its image on the other.
//!
//! The stress of an embedding has many minima that are nearly as good, and two surfaces that are embedded apart may end in different ones. A scaling that starts from where the other surface's is
//! ends beside it: the distances stay as true, and the two agree better. Whether that makes the map better is asked of the anchors.

use std::time::Instant;

use serde::Serialize;

use super::anchors::{AnchorPairs, vertex_point};
use super::correspondence::{CorrespondenceOptions, Method, Shape, correspondence};
use super::embedding::{Embedding, EmbeddingOptions, Rescaling};
use super::packed::{PackedPoint, PointMap};
use crate::error::{Error, Result};
use crate::geometry::SurfacePoint;
use crate::progress::{Progress, Quiet};

/// Anchors without which nothing is learnt from those that are left out.
const LEAST_ANCHORS: usize = 5;
/// Parts that the anchors are left out in.
const FOLDS: usize = 5;

/// How embeddings are aligned, and when that counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlignmentOptions {
    /// What the target's embedding was made with.
    pub embedding: EmbeddingOptions,
    /// How often the target is sent to the source and scaled again. Default 2; more change next to nothing.
    pub rounds: usize,
    /// Largest number of sweeps of each scaling. Default 100.
    pub sweeps: usize,
    /// Whether the fields between are relaxed. Default true; as the field that is wanted in the end.
    pub relax: bool,
    /// The alignment is kept if anchors left out are missed by less than `1 - gain` times as much. Default 0.05.
    pub gain: f64,
}

impl Default for AlignmentOptions {
    fn default() -> Self {
        Self { embedding: EmbeddingOptions::default(), rounds: 2, sweeps: 100, relax: true, gain: 0.05 }
    }
}

/// What anchors left out say of an alignment.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AlignmentReport {
    /// Mean distance by which the field misses anchors it does not know, in space over the square root of the source's area.
    pub before: f64,
    /// The same with embeddings that were aligned without these anchors.
    pub after: f64,
    /// Whether the aligned embedding is used.
    pub kept: bool,
    /// Wall-clock seconds.
    pub seconds: f64,
}

/// The result of [`align`].
#[derive(Clone, Debug)]
pub struct Alignment {
    /// The target's embedding, beside the source's; `None` if that is no better than the one there is.
    pub embedding: Option<Embedding>,
    /// Why.
    pub report: AlignmentReport,
}

/// Aligns the target's embedding with the source's, for [`Method::Field`] through `anchors`.
///
/// The field sends the landmarks of the target to the source; the scaling of the target starts again from where they are in the source's embedding, with the target's own distances, and the other
/// vertices follow as a least-squares mesh; that twice. An anchor that took part in this is met better whether the alignment is right or not, so that leaving it out of the predictions alone
/// flatters the alignment. Here a fifth of the anchors at a time is left out of everything: alignment, predictions, relaxation. The field misses them by some distance with either embedding, and the
/// alignment, then made with all anchors, is kept only if that is less by [`AlignmentOptions::gain`].
///
/// A component of the target whose landmarks go to several components of the source is scaled from where it was. Mirrored pairs need no care: distances do not know them. Deterministic for any
/// number of threads. Costs the distances of the embedding once more, six times [`AlignmentOptions::rounds`] fields, scalings and least-squares meshes, and ten fields.
///
/// Source: the alignment is not in the paper; its authors embed every mesh by itself (section 3.5).
///
/// # Errors
/// [`Error::Input`] for fewer than five anchors, anchors that do not fit ([`AnchorPairs::check`]) and a target's embedding that [`Embedding::compute`] does not make of the target with these
/// options ([`Rescaling::new`]); [`Error::Option`] for a gain that is no part.
pub fn align(
    source: Shape<'_>,
    target: Shape<'_>,
    anchors: &AnchorPairs,
    options: &AlignmentOptions,
    progress: &dyn Progress,
) -> Result<Alignment> {
    let clock = Instant::now();
    if !(0.0..1.0).contains(&options.gain) {
        return Err(Error::option("gain", format!("{} is not in 0..1", options.gain), "Use 0.05"));
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
    progress.stage("alignment", FOLDS as u64 + 1);
    let mut missed = [Vec::new(), Vec::new()];
    for fold in 0..FOLDS {
        let (known, held) = split(anchors, fold);
        missed[0].extend(aligner.missed(target, &known, &held)?);
        let aligned = aligner.aligned(&known)?;
        missed[1].extend(aligner.missed(Shape { embedding: Some(&aligned), ..target }, &known, &held)?);
        progress.advance(1);
    }
    let [before, after] = missed.map(|m| m.iter().sum::<f64>() / m.len() as f64);
    let kept = is_better(before, after, options.gain);
    let embedding = if kept { Some(aligner.aligned(anchors)?) } else { None };
    progress.advance(1);
    Ok(Alignment { embedding, report: AlignmentReport { before, after, kept, seconds: clock.elapsed().as_secs_f64() } })
}

/// Whether `after` is less than `before` by the part `gain` of it.
fn is_better(before: f64, after: f64, gain: f64) -> bool {
    after < (1.0 - gain) * before
}

/// The anchors but those of one fold, and those.
fn split(anchors: &AnchorPairs, fold: usize) -> (AnchorPairs, AnchorPairs) {
    let (mut known, mut held) = (AnchorPairs::default(), AnchorPairs::default());
    for (i, (s, t)) in anchors.source.iter().zip(&anchors.target).enumerate() {
        let to = if i % FOLDS == fold { &mut held } else { &mut known };
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
    fn field(&self, target: Shape<'_>, anchors: &AnchorPairs) -> Result<Box<dyn PointMap + Send>> {
        let options = CorrespondenceOptions {
            method: Method::Field,
            confidence: false,
            relax: Some(self.options.relax),
            ..CorrespondenceOptions::default()
        };
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
    fn missed(&self, target: Shape<'_>, known: &AnchorPairs, held: &AnchorPairs) -> Result<Vec<f64>> {
        let images = Self::images(self.field(target, known)?.as_ref(), &held.target)?;
        let (mesh, unit) = (self.source.mesh, self.source.mesh.area().sqrt());
        let off = |p: &SurfacePoint, to: &SurfacePoint| p.position(mesh).distance(to.position(mesh)) / unit;
        Ok(images.iter().zip(&held.source).map(|(p, to)| p.map_or(1.0, |p| off(&p, to))).collect())
    }

    /// The target's embedding, scaled from its image.
    fn aligned(&self, anchors: &AnchorPairs) -> Result<Embedding> {
        let mut embedding: Option<Embedding> = None;
        for _ in 0..self.options.rounds.max(1) {
            let target = Shape { embedding: embedding.as_ref().or(self.target.embedding), ..self.target };
            let start = self.start(self.field(target, anchors)?.as_ref())?;
            embedding = Some(self.rescaling.restart(&start, self.options.sweeps, &Quiet)?);
        }
        embedding.ok_or_else(|| Error::numeric("there was no round of the alignment", "Ask for one or more"))
    }

    /// Where the landmarks of the target are in the source's embedding, in the target's units: a row for each.
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
