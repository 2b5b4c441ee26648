//! The correspondence as the command line asks for it.

use barymap::Result;
use barymap::surface::correspondence::{CorrespondenceOptions, Method};
use barymap::surface::gpu::correspondence_on;
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
    /// An image for every vertex, predicted in the embedding and in space, relaxed onto the source
    Field,
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
            Self::Field => Method::Field,
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
    let options = CorrespondenceOptions { method, ..CorrespondenceOptions::default() };
    let (map, note) = correspondence_on(&session.engine, source.shape(), target.shape(), anchors, &options)?;
    if let Some(note) = note {
        session.warn(&note);
    }
    session.field = map.field().map(|f| serde_json::json!(f));
    session.watch.lap("correspondence");
    Ok(map)
}
