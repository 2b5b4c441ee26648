//! The correspondence as the command line asks for it.

use crate::Result;
use crate::cli::common::{EmbeddingArguments, Session, Surface};
use crate::cli::needs;
use crate::desk::{Choice, correspond};
use crate::surface::correspondence::Method;
use crate::surface::field::{Contradicted, Expected};
use crate::surface::{AnchorPairs, PointMap};

/// How points are carried.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct MethodArguments {
    /// How points are carried
    #[arg(long, value_enum, default_value = "field")]
    method: Method,
    /// Whether images are drawn onto the source by a smooth relaxation: yes for `field`, no for
    /// `rbf` unless asked for
    #[arg(long, value_name = "yes|no", num_args = 0..=1, default_missing_value = "yes", value_parser = yes_or_no)]
    relax: Option<bool>,
    /// Embed the target once more, from where its landmarks are on the source, and keep that if
    /// anchors left out say it is better; with `field`, from five anchors on
    #[arg(long)]
    align: bool,
    /// Use every pair: `field` leaves out pairs that the others contradict, and names them
    #[arg(long)]
    keep_all: bool,
    /// What pairs set by eye are off by, over the square root of the area (0.01, 0.02): `field`
    /// moves them towards where the others send them
    #[arg(long, value_name = "PART", default_value_t = 0.0)]
    anchor_error: f64,
    /// Pairs of one side count for both: where both shapes stand symmetrically, half the clicks
    #[arg(long)]
    mirror: bool,
}

fn yes_or_no(text: &str) -> std::result::Result<bool, String> {
    match text {
        "yes" => Ok(true),
        "no" => Ok(false),
        other => Err(format!("'{other}' is neither yes nor no")),
    }
}

impl MethodArguments {
    fn choice(self) -> Choice {
        Choice {
            method: self.method,
            relax: self.relax,
            align: self.align,
            keep_all: self.keep_all,
            anchor_error: self.anchor_error,
            mirror: self.mirror,
        }
    }

    /// The method for a source that is no surface.
    pub(crate) fn for_points(self) -> Self {
        let Choice { method, relax, align, keep_all, anchor_error, mirror } = self.choice().for_points();
        Self { method, relax, align, keep_all, anchor_error, mirror }
    }

    /// The name in reports and messages.
    pub(crate) fn name(self) -> &'static str {
        self.choice().name()
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
    let (choice, options) = (method.choice(), embedding.options());
    if choice.relax.unwrap_or(choice.method == Method::Field) {
        needs::check_field(&source.mesh, &target.mesh)?;
    }
    if choice.options()?.method.needs_embedding() {
        session.embed(source, &options)?;
        session.embed(target, &options)?;
    }
    let made = correspond(&session.engine, source, target, anchors, &choice, &options, session.progress())?;
    session.bars.finish();
    session.warn_all(&made.notes);
    if choice.mirror {
        session.say(&format!(
            "pairs of one side count for both: {} given, {} of them on the middle line, {} added",
            anchors.len(),
            made.middle,
            made.mirrored.len()
        ));
    }
    session.alignment = made.alignment.map(|r| {
        let done = if r.kept { "the target is embedded anew" } else { "the embeddings stay as they are" };
        session.say(&format!(
            "alignment: anchors left out are missed by {:.5} of the square root of the area, {:.5} before; {done}",
            r.after, r.before
        ));
        serde_json::json!(r)
    });
    if let Some(field) = made.map.field() {
        let told: Vec<String> =
            field.contradicted.iter().map(|c| contradiction(c, anchors.len(), &made.mirrored)).collect();
        session.warn_all(&told);
        if let Some(usual) = field.at_odds() {
            session.warn(&format!("{}; look at them with `barymap anchors --picture`", super::anchors::odds(usual)));
        }
        if let Some(expected) = &field.expected {
            session.say(&foretold(expected, &target.mesh.name));
        }
    }
    session.field = made.map.field().map(|f| serde_json::json!(f));
    session.watch.lap("correspondence");
    Ok(made.map)
}

/// The sentence about how good the map is.
fn foretold(expected: &Expected, target: &str) -> String {
    let [x, y, z] = expected.place;
    let within = |e: Option<f64>| e.map_or("unknown".to_owned(), |e| format!("{:.1} %", 100.0 * e));
    format!(
        "expected error, in parts of the square root of the area: {} for half of {target}, {} for 95 %; {:.0} % of it \
         beyond 2 %; a pair would help most at vertex {} ({:.4} {:.4} {:.4})",
        within(expected.median),
        within(expected.p95),
        100.0 * expected.beyond,
        expected.next,
        x,
        y,
        z
    )
}

/// The sentence about a pair that was left out; those after `pairs` are mirror images.
fn contradiction(c: &Contradicted, pairs: usize, mirrored: &[usize]) -> String {
    let Contradicted { index, off, exchanged_with } = *c;
    let name = |i: usize| match i.checked_sub(pairs).and_then(|k| mirrored.get(k)) {
        Some(of) => format!("the mirror image of pair {of}"),
        None => format!("pair {i}"),
    };
    let what = match exchanged_with {
        Some(other) => format!("it looks exchanged with {}: exchange their points on one side", name(other)),
        None => "correct it, or use it with --keep-all".to_owned(),
    };
    format!(
        "{} of {pairs} is left out: the others send it {off:.2} of the square root of the area away; {what}",
        name(index)
    )
}
