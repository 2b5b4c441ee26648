//! Dense correspondence between two surfaces from pairs of anchors (paper, section 4.3), and the
//! baselines it is measured against.

mod baseline;
mod checked;
mod confidence;
pub(crate) mod drift;
mod parts;
pub(crate) mod procrustes;
mod weighted;

#[doc(hidden)]
pub use baseline::Baseline;
pub(crate) use baseline::{Warp, dense_bytes};
pub(crate) use checked::DOUBT;
#[doc(hidden)]
pub use confidence::{Evidence, Trust, Vouching};
pub(crate) use weighted::AVERAGE_SCALE;
#[doc(hidden)]
pub use weighted::{Scratch, WeightedAverages};

use crate::engine::LaneScalar;
use crate::error::{Error, Result};
use crate::geometry::{Mesh, Topology};
use crate::words::words;

use self::checked::Checked;
use self::parts::{Anchored, Followed};
use super::anchors::AnchorPairs;
use super::embedding::Embedding;
use super::field::{Field, FieldOptions};
use super::packed::{PackedPoint, PointMap};

/// How points of the target are carried to the source.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Weighted averages as published: inverse problem on the target, forward problem on the
    /// source.
    Averages,
    /// Weighted averages with the residual of the inverse problem carried over; the identity for
    /// equal surfaces.
    Transport,
    /// An image for every vertex, predicted in the embedding and in space and relaxed onto the
    /// source ([`super::field`]): the most accurate.
    #[default]
    Field,
    /// Spatial radial basis functions through the anchors, then the closest point.
    Rbf,
    /// Similarity alignment by the anchors, then the closest point.
    Closest,
}

words! { Method, "method", "a method":
    Averages => "averages" "The paper: inverse problem on the target, forward problem on the source",
    Transport => "transport" "The paper with the residual carried over",
    Field => "field" "An image for every vertex, predicted in the embedding and in space, relaxed onto the source",
    Rbf => "rbf" "Spatial radial basis functions, then the closest point",
    Closest => "closest" "Alignment by the anchors, then the closest point",
}

impl Method {
    /// Whether the method needs embeddings.
    pub fn needs_embedding(self) -> bool {
        matches!(self, Self::Averages | Self::Transport | Self::Field)
    }
}

/// A mesh with what the methods need of it.
#[derive(Clone, Copy, Debug)]
pub struct Shape<'a> {
    /// The mesh.
    pub mesh: &'a Mesh,
    /// Its adjacency.
    pub topology: &'a Topology,
    /// Its embedding; `None` for the spatial baselines.
    pub embedding: Option<&'a Embedding>,
}

/// The precision of the CPU back ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// `f32` with SIMD sweeps: the `cpu` back end.
    #[default]
    Single,
    /// `f64`: the `reference` back end.
    Double,
}

/// Options of [`correspondence`].
#[derive(Clone, Copy, Debug)]
pub struct CorrespondenceOptions {
    /// Default [`Method::Field`].
    pub method: Method,
    /// Default single.
    pub precision: Precision,
    /// Whether each point gets a confidence and a status by the checks of section 4.4; without them
    /// every point that was found is valid. Default true.
    pub confidence: bool,
    /// Whether the images of [`Method::Field`] and [`Method::Rbf`] are relaxed onto the source;
    /// other methods have nothing to relax. `None` is as the method is known: a field is, radial
    /// basis functions are not. Default `None`.
    pub relax: Option<bool>,
    /// Whether [`Method::Field`] uses pairs that the others contradict as well. Default false: they
    /// are left out, and [`super::field::FieldReport::contradicted`] names them.
    pub keep_all: bool,
    /// What pairs are off by, root mean square, over the square root of the source's area, for
    /// [`Method::Field`]: they are moved towards where the others send them. Default 0.
    pub anchor_error: f64,
}

impl CorrespondenceOptions {
    pub(crate) fn field(&self) -> FieldOptions {
        FieldOptions {
            relax: self.relax.unwrap_or(true),
            relaxation: None,
            lambda: None,
            confidence: self.confidence,
            keep_all: self.keep_all,
            anchor_error: self.anchor_error,
        }
    }
}

impl Default for CorrespondenceOptions {
    fn default() -> Self {
        Self {
            method: Method::default(),
            precision: Precision::default(),
            confidence: true,
            relax: None,
            keep_all: false,
            anchor_error: 0.0,
        }
    }
}

/// The map from the target to the source on the CPU.
///
/// Whatever the method, points in triangles of the target that it turns over are doubtful (with
/// [`CorrespondenceOptions::confidence`]), and parts of the target without an anchor follow the
/// nearest part that has one, as a whole; they are doubtful too, and [`AnchorPairs::check`] names
/// them.
///
/// # Errors
/// If the anchors do not fit ([`AnchorPairs::check`]), or the embeddings are missing or differ in
/// dimension.
pub fn correspondence(
    source: Shape<'_>,
    target: Shape<'_>,
    anchors: &AnchorPairs,
    options: &CorrespondenceOptions,
) -> Result<Box<dyn PointMap + Send>> {
    anchors.check((source.mesh, source.topology), (target.mesh, target.topology))?;
    completed(source, target, anchors, options, |source, target| on_cpu(source, target, anchors, options))
}

/// What every method has in common around the map that `make` makes of the parts with anchors:
/// parts without one follow, what is turned over is doubtful.
pub(crate) fn completed(
    source: Shape<'_>,
    target: Shape<'_>,
    anchors: &AnchorPairs,
    options: &CorrespondenceOptions,
    make: impl FnOnce(Shape<'_>, Shape<'_>) -> Result<Box<dyn PointMap + Send>>,
) -> Result<Box<dyn PointMap + Send>> {
    let map: Box<dyn PointMap + Send> = match Anchored::new(source, target, anchors) {
        None => make(source, target)?,
        Some(a) => {
            let map = make(Shape { topology: &a.source, ..source }, Shape { topology: &a.target, ..target })?;
            Box::new(Followed::new(map, source, target, anchors, &a)?)
        }
    };
    Ok(if options.confidence { Box::new(Checked::new(map, source, target)?) } else { map })
}

fn on_cpu(
    source: Shape<'_>,
    target: Shape<'_>,
    anchors: &AnchorPairs,
    options: &CorrespondenceOptions,
) -> Result<Box<dyn PointMap + Send>> {
    if options.method == Method::Rbf && options.relax == Some(true) {
        return Ok(match options.precision {
            Precision::Single => Box::new(Field::<f32, 4>::radial(source, target, anchors)?),
            Precision::Double => Box::new(Field::<f64, 4>::radial(source, target, anchors)?),
        });
    }
    if !options.method.needs_embedding() {
        return Ok(Box::new(Baseline::new(source, target, anchors, options.method)?));
    }
    match options.precision {
        Precision::Single => weighted::<f32>(source, target, anchors, options),
        Precision::Double => weighted::<f64>(source, target, anchors, options),
    }
}

fn weighted<S: LaneScalar>(
    source: Shape<'_>,
    target: Shape<'_>,
    anchors: &AnchorPairs,
    options: &CorrespondenceOptions,
) -> Result<Box<dyn PointMap + Send>> {
    let dimension = dimension(&source, &target)?;
    if options.method == Method::Field {
        let options = options.field();
        return Ok(match dimension {
            4 => Box::new(Field::<S, 8>::new::<4>(source, target, anchors, &options)?),
            8 => Box::new(Field::<S, 12>::new::<8>(source, target, anchors, &options)?),
            12 => Box::new(Field::<S, 16>::new::<12>(source, target, anchors, &options)?),
            16 => Box::new(Field::<S, 20>::new::<16>(source, target, anchors, &options)?),
            d => return Err(other_dimension(d)),
        });
    }
    Ok(match dimension {
        4 => Box::new(WeightedAverages::<S, 4>::new(source, target, anchors, options)?),
        8 => Box::new(WeightedAverages::<S, 8>::new(source, target, anchors, options)?),
        12 => Box::new(WeightedAverages::<S, 12>::new(source, target, anchors, options)?),
        16 => Box::new(WeightedAverages::<S, 16>::new(source, target, anchors, options)?),
        d => return Err(other_dimension(d)),
    })
}

fn other_dimension(d: usize) -> Error {
    Error::option("dimension", format!("{d} is not 4, 8, 12 or 16"), "Embed with one of these dimensions")
}

/// The common dimension of two embedded shapes.
pub(crate) fn dimension(source: &Shape<'_>, target: &Shape<'_>) -> Result<usize> {
    for (shape, e) in [source, target].into_iter().filter_map(|s| s.embedding.map(|e| (s, e))) {
        if e.points.len() != e.dimension * shape.mesh.vertex_count() {
            return Err(Error::mesh(&shape.mesh.name, "its embedding is that of another mesh", "Embed this mesh"));
        }
    }
    match (source.embedding, target.embedding) {
        (Some(a), Some(b)) if a.dimension == b.dimension => Ok(a.dimension),
        (Some(a), Some(b)) => Err(Error::input(
            format!("the source is embedded in {} dimensions, the target in {}", a.dimension, b.dimension),
            "Embed both with the same --dimension",
        )),
        _ => Err(Error::input("an embedding is missing", "Compute the embeddings of both meshes first")),
    }
}

/// Every point lies on a triangle of a target with `count` of them.
pub(crate) fn check_faces(points: &[PackedPoint], count: usize) -> Result<()> {
    match points.iter().position(|p| p.face as usize >= count) {
        None => Ok(()),
        Some(i) => Err(Error::input(
            format!("point {i} lies on face {}, the target has {count}", points[i].face),
            "Faces are counted from 0 after fan triangulation",
        )),
    }
}
