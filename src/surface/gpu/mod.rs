//! The correspondence on a device: host halves of the kernels of the main job, in R^8 and, for
//! fields, R^12.
//!
//! | kernel | what it does | reference |
//! |---|---|---|
//! | `average_anchors` | inverse problem and average | [`FusedWeights`](crate::surface::average::FusedWeights) |
//! | `average_stencils` | averages of surface points, for subdivision and smoothing | [`Forward::averages`](crate::surface::forward::Forward::averages) |
//! | `interpolate_field` | images of vertices, interpolated in R^12 | [`Field::interpolate`](crate::surface::field::Field::interpolate) |
//! | `project_phong` | projection by walks over vertices and triangles | [`PhongSurface::project`](crate::surface::PhongSurface::project) |
//! | `search_phong` | the first level of the search, for what the walks leave | the same |
//! | `judge_image` | whether an image can be trusted | `judge_image` |
//!
//! What they leave, a few points in a thousand, goes through the references. A map takes points
//! from the host and gives images back to it ([`PointMap`]), or finds images where the points lie
//! ([`ResidentMap`](crate::surface::packed::ResidentMap)).

mod average_anchors;
mod average_stencils;
mod averages;
mod interpolate_field;
mod judge_image;
mod map;
mod project_phong;
mod resident;
mod tables;
mod tile;

#[doc(hidden)]
pub use average_anchors::{AverageParams, BLOCK_ANCHORS};
#[doc(hidden)]
pub use average_stencils::{DeviceStencils, MOST_ROWS, StencilParams};
#[doc(hidden)]
pub use judge_image::{JUDGE_ROUNDING, JudgeParams, judge_image};
pub use map::DeviceMap;
#[doc(hidden)]
pub use map::HostMap;
#[doc(hidden)]
pub use project_phong::{ProjectParams, Projected};
#[doc(hidden)]
pub use tables::SurfaceTables;

use crate::engine::{Backend, Engine, Kernel};
use crate::error::Result;
use crate::surface::Embedding;
use crate::surface::anchors::AnchorPairs;
use crate::surface::correspondence::{
    CorrespondenceOptions, Method, Precision, Shape, WeightedAverages, completed, correspondence, dimension,
};
use crate::surface::field::Field;
use crate::surface::packed::PointMap;

/// The kernels of this folder.
#[doc(hidden)]
pub const KERNELS: &[&Kernel] = &[
    &average_anchors::AVERAGE_ANCHORS,
    &average_stencils::AVERAGE_STENCILS,
    &interpolate_field::INTERPOLATE_FIELD,
    &judge_image::JUDGE_IMAGE,
    &project_phong::PROJECT_PHONG,
    &project_phong::PROJECT_PHONG_12,
    &project_phong::SEARCH_PHONG,
    &project_phong::SEARCH_PHONG_12,
];

/// An embedding in fewer dimensions as one in 8: zeros change no distance.
fn padded(shape: &Shape<'_>) -> Option<Embedding> {
    let embedding = shape.embedding.filter(|e| e.dimension < 8)?;
    let mut points = Vec::with_capacity(embedding.points.len() / embedding.dimension * 8);
    for point in embedding.points.chunks_exact(embedding.dimension) {
        points.extend_from_slice(point);
        points.resize(points.len() + 8 - point.len(), 0.0);
    }
    Some(Embedding { dimension: 8, points, ..embedding.clone() })
}

/// The map from the target to the source where `engine` works: on its device, or on the CPU in the
/// engine's precision. Where there is a device that cannot do this work, the CPU does it and the
/// second value says why, in one line.
///
/// # Errors
/// As [`correspondence`], and if the tables do not fit the device.
pub fn correspondence_on(
    engine: &Engine,
    source: Shape<'_>,
    target: Shape<'_>,
    anchors: &AnchorPairs,
    options: &CorrespondenceOptions,
) -> Result<(Box<dyn PointMap + Send>, Option<String>)> {
    let precision = if engine.backend() == Backend::Reference { Precision::Double } else { Precision::Single };
    let options = CorrespondenceOptions { precision, ..*options };
    let on_cpu = |note| Ok((correspondence(source, target, anchors, &options)?, note));
    if engine.gpu().is_none() {
        return on_cpu(None);
    }
    if !options.method.needs_embedding() {
        return on_cpu(Some(format!("method {} runs on the CPU", options.method.word())));
    }
    let dimension = dimension(&source, &target)?;
    let obstacle = match options.method {
        Method::Field => DeviceMap::<Field<f32, 12>>::obstacle(engine, dimension),
        _ => DeviceMap::<WeightedAverages<f32, 8>>::obstacle(engine, dimension),
    };
    if let Some(why) = obstacle {
        return on_cpu(Some(format!("the correspondence runs on the CPU: {why}")));
    }
    anchors.check((source.mesh, source.topology), (target.mesh, target.topology))?;
    let (padded_source, padded_target) = (padded(&source), padded(&target));
    let source = Shape { embedding: padded_source.as_ref().or(source.embedding), ..source };
    let target = Shape { embedding: padded_target.as_ref().or(target.embedding), ..target };
    let map = completed(source, target, anchors, &options, |source, target| {
        if options.method == Method::Field {
            let field = Field::new::<8>(source, target, anchors, &options.field())?;
            return Ok(Box::new(DeviceMap::<Field<f32, 12>>::new(engine, field)?));
        }
        let map = WeightedAverages::new(source, target, anchors, &options)?;
        Ok(Box::new(DeviceMap::<WeightedAverages<f32, 8>>::new(engine, map)?))
    })?;
    Ok((map, None))
}

/// The constants of the shaders that are these of Rust.
#[cfg(test)]
pub(crate) fn twins() -> Vec<crate::twins::Twin> {
    use crate::geometry::NONE;
    use crate::surface::packed::{Doubts, PackedImage, Status};
    use crate::surface::project::{ASIDE, BESIDE, Found, SEARCH_PATIENCE, WALK_PATIENCE};
    use crate::surface::{psi, search};
    use crate::twins::of;
    [
        of("project_phong", [("PATIENCE", WALK_PATIENCE)]),
        of(
            "search_phong",
            [
                ("PATIENCE", SEARCH_PATIENCE),
                ("BESIDE", BESIDE),
                ("ASIDE", ASIDE),
                ("NEW_LEVEL", search::NEW_LEVEL.into()),
            ],
        ),
        of(
            "lib/newton",
            [
                ("SLACK", psi::slack::<f32>().into()),
                ("NEWTON_STEPS", psi::NEWTON_STEPS as f64),
                ("EPSILON", f32::EPSILON.into()),
                ("ROUNDING", psi::ROUNDING),
            ],
        ),
        of("lib/none", [("NONE", NONE.into())]),
        of("lib/phong", [("AT_VERTEX", psi::at_vertex::<f32>().into())]),
        of(
            "lib/projected",
            [
                ("NOTHING", f64::from(Found::Nothing as u32)),
                ("BY_WALK", f64::from(Found::Walk as u32)),
                ("BY_SEARCH", f64::from(Found::Search as u32)),
                ("LEFT", Projected::LEFT.into()),
                ("HOW", Projected::HOW.into()),
            ],
        ),
        of(
            "lib/image",
            [
                ("FAILED", f64::from(Status::Failed as u32)),
                ("DOUBTFUL", f64::from(Status::Doubtful as u32)),
                ("VALID", f64::from(Status::Valid as u32)),
                ("LEFT_TO_REFERENCE", PackedImage::LEFT.into()),
            ],
        ),
        of("judge_image", [("TURNED", Doubts::TURNED.into())]),
    ]
    .concat()
}
