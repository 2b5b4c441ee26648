//! The correspondence as the command line asks for it.

use barymap::Result;
use barymap::surface::correspondence::{CorrespondenceOptions, Method};
use barymap::surface::gpu::correspondence_on;
use barymap::surface::{AnchorPairs, PointMap};
use clap::ValueEnum;

use crate::common::{EmbeddingArguments, Session, Surface, usage};

/// Names of the methods.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum MethodName {
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

/// How points are carried.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct MethodArguments {
    /// How points are carried
    #[arg(long, value_enum, default_value = "field")]
    method: MethodName,
    /// Whether images are drawn onto the source by a smooth relaxation: yes for `field`, no for `rbf` unless asked for
    #[arg(long, value_name = "yes|no", num_args = 0..=1, default_missing_value = "yes", value_parser = yes_or_no)]
    relax: Option<bool>,
}

fn yes_or_no(text: &str) -> std::result::Result<bool, String> {
    match text {
        "yes" => Ok(true),
        "no" => Ok(false),
        other => Err(format!("'{other}' is neither yes nor no")),
    }
}

impl MethodArguments {
    pub(crate) fn method(self) -> Method {
        match self.method {
            MethodName::Averages => Method::Averages,
            MethodName::Transport => Method::Transport,
            MethodName::Field => Method::Field,
            MethodName::Rbf => Method::Rbf,
            MethodName::Closest => Method::Closest,
        }
    }

    /// The name in reports and messages.
    pub(crate) fn name(self) -> &'static str {
        match (self.method(), self.relax) {
            (Method::Rbf, Some(true)) => "rbf, relaxed",
            (Method::Field, Some(false)) => "field, not relaxed",
            (method, _) => method.name(),
        }
    }

    fn options(self) -> Result<CorrespondenceOptions> {
        let method = self.method();
        if self.relax.is_some() && !matches!(method, Method::Field | Method::Rbf) {
            let what = format!("the method {} has nothing to relax", method.name());
            return Err(usage("--relax", &what, "Use it with --method field or rbf"));
        }
        Ok(CorrespondenceOptions { method, relax: self.relax, ..CorrespondenceOptions::default() })
    }
}

/// Embeds both surfaces where the method needs it, and prepares the map.
pub(crate) fn prepare(
    session: &mut Session<'_>,
    source: &mut Surface,
    target: &mut Surface,
    anchors: &AnchorPairs,
    method: MethodArguments,
    embedding: &EmbeddingArguments,
) -> Result<Box<dyn PointMap + Send>> {
    let correspondence = method.options()?;
    if correspondence.method.needs_embedding() {
        let options = embedding.options();
        session.embed(source, &options)?;
        session.embed(target, &options)?;
    }
    let (map, note) = correspondence_on(&session.engine, source.shape(), target.shape(), anchors, &correspondence)?;
    if let Some(note) = note {
        session.warn(&note);
    }
    session.field = map.field().map(|f| serde_json::json!(f));
    session.watch.lap("correspondence");
    Ok(map)
}
