//! The correspondence as the command line asks for it.

use barymap::Result;
use barymap::engine::Backend;
use barymap::surface::correspondence::{CorrespondenceOptions, Method, Precision, WeightedAverages, correspondence};
use barymap::surface::gpu::DeviceMap;
use barymap::surface::{AnchorPairs, PointMap};
use clap::ValueEnum;

use crate::common::{EmbeddingArguments, Session, Surface};

/// Names of the methods.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum MethodName {
    /// The paper: inverse problem on the target, forward problem on the source
    Averages,
    /// The paper with the residual carried over
    Transport,
    /// Spatial radial basis functions, then the closest point
    Rbf,
    /// Alignment by the anchors, then the closest point
    Closest,
}

impl MethodName {
    pub(crate) fn method(self) -> Method {
        match self {
            Self::Averages => Method::Averages,
            Self::Transport => Method::Transport,
            Self::Rbf => Method::Rbf,
            Self::Closest => Method::Closest,
        }
    }
}

/// Embeds both surfaces where the method needs it, and prepares the map.
pub(crate) fn prepare(
    session: &mut Session<'_>,
    source: &mut Surface,
    target: &mut Surface,
    anchors: &AnchorPairs,
    method: Method,
    embedding: &EmbeddingArguments,
) -> Result<Box<dyn PointMap + Send>> {
    if method.needs_embedding() {
        let options = embedding.options();
        session.embed(source, &options)?;
        session.embed(target, &options)?;
    }
    if method.needs_embedding() && session.engine.backend() == Backend::Gpu {
        let dimension = embedding.options().dimension;
        match DeviceMap::obstacle(&session.engine, dimension, anchors.len()) {
            Some(why) => session.warn(&format!("{why}: the correspondence is computed on the CPU")),
            None => {
                let options = CorrespondenceOptions { method, ..CorrespondenceOptions::default() };
                let map = WeightedAverages::<f32, 8>::new(source.shape(), target.shape(), anchors, &options)?;
                let map = DeviceMap::new(&session.engine, map)?;
                session.watch.lap("correspondence");
                return Ok(Box::new(map));
            }
        }
    }
    let precision = if session.engine.backend() == Backend::Reference { Precision::Double } else { Precision::Single };
    let options = CorrespondenceOptions { method, precision, ..CorrespondenceOptions::default() };
    let map = correspondence(source.shape(), target.shape(), anchors, &options)?;
    session.watch.lap("correspondence");
    Ok(map)
}
