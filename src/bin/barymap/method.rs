//! The correspondence as the command line asks for it.

use barymap::Result;
use barymap::surface::correspondence::{CorrespondenceOptions, Method, Shape};
use barymap::surface::gpu::correspondence_on;
use barymap::surface::{AlignmentOptions, AnchorPairs, Embedding, PointMap, align};
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
    /// Whether images are drawn onto the source by a smooth relaxation: yes for `field`, no for
    /// `rbf` unless asked for
    #[arg(long, value_name = "yes|no", num_args = 0..=1, default_missing_value = "yes", value_parser = yes_or_no)]
    relax: Option<bool>,
    /// Embed the target once more, from where its landmarks are on the source, and keep that if
    /// anchors left out say it is better; with `field`, from five anchors on
    #[arg(long)]
    align: bool,
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

    /// The method for a source that is no surface: radial basis functions where another one is
    /// asked for.
    pub(crate) fn for_points(self) -> Self {
        match self.method {
            MethodName::Rbf | MethodName::Closest => Self { relax: Some(false), ..self },
            _ => Self { method: MethodName::Rbf, relax: Some(false), align: false },
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
        if self.align && method != Method::Field {
            let what = format!("the method {} has no use for it", method.name());
            return Err(usage("--align", &what, "Use it with --method field"));
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
    session.alignment = None;
    let aligned = if method.align { aligned(session, source, target, anchors, method, embedding)? } else { None };
    let shape = Shape { embedding: aligned.as_ref().or(target.embedding.as_ref()), ..target.shape() };
    let (map, note) = correspondence_on(&session.engine, source.shape(), shape, anchors, &correspondence)?;
    if let Some(note) = note {
        session.warn(&note);
    }
    session.field = map.field().map(|f| serde_json::json!(f));
    session.watch.lap("correspondence");
    Ok(map)
}

/// The target's embedding aligned with the source's for these anchors, where that is better. The
/// target keeps its own: another pair may want another.
fn aligned(
    session: &mut Session<'_>,
    source: &Surface,
    target: &Surface,
    anchors: &AnchorPairs,
    method: MethodArguments,
    embedding: &EmbeddingArguments,
) -> Result<Option<Embedding>> {
    let options = AlignmentOptions {
        embedding: embedding.options(),
        relax: method.relax.unwrap_or(true),
        ..AlignmentOptions::default()
    };
    let alignment = align(source.shape(), target.shape(), anchors, &options, session.progress())?;
    let r = alignment.report;
    let done = if r.kept { "the target is embedded anew" } else { "the embeddings stay as they are" };
    session.say(&format!(
        "alignment: anchors left out are missed by {:.5} of the square root of the area, {:.5} before; {done}",
        r.after, r.before
    ));
    session.alignment = Some(serde_json::json!(r));
    session.watch.lap("align");
    Ok(alignment.embedding)
}
