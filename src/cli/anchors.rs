//! `barymap anchors`: anchors proposed from a few pairs or none, wrong ones named, and where the
//! next ones would help most.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::cli::common::{Common, EmbeddingArguments, Session, Surface, anchor_pairs, check_outputs, usage};
use crate::cli::verdict::Verdict;
use crate::geometry::SurfacePoint;
use crate::io::anchors::PairRemark;
use crate::surface::AnchorPairs;
use crate::tools::anchors::{
    AnchorOptions, Contradictions, Outlier, Proposal, Suggestion, contradicted, propose, suggest,
};
use crate::tools::render::{Coloring, RenderOptions, render, side_by_side};
use crate::{Error, Result};

/// Most places suggested at once.
const MOST_SUGGESTED: usize = 1000;

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// The mesh with the texture
    source: PathBuf,
    /// The mesh that is to receive it
    target: PathBuf,
    /// The pairs: JSON, read by every command that takes anchors
    #[arg(long, short)]
    output: Option<PathBuf>,
    /// Pairs to begin with, better eight; without them limbs are matched
    #[arg(long)]
    anchors: Option<String>,
    /// Pairs wanted in all
    #[arg(long, default_value_t = AnchorOptions::default().count)]
    count: usize,
    /// Go by the shape alone, also where both meshes have the same connectivity
    #[arg(long)]
    ignore_connectivity: bool,
    /// Only look at the given pairs: name those the others contradict, propose none
    #[arg(long, requires = "anchors")]
    check: bool,
    /// Leave out given pairs that the others contradict
    #[arg(long, requires = "anchors")]
    drop_outliers: bool,
    /// Print the N places of the target where a pair made by hand would help most
    #[arg(long, value_name = "N", default_value_t = 0)]
    suggest: usize,
    /// Write pairs though all of them are doubtful
    #[arg(long)]
    force: bool,
    /// End with exit code 3 if the pairs are not usable
    #[arg(long)]
    strict: bool,
    /// A picture of both meshes with the pairs, or with the suggested places and where the map
    /// sends them
    #[arg(long)]
    picture: Option<PathBuf>,
    #[command(flatten)]
    embedding: EmbeddingArguments,
}

impl Arguments {
    fn check(&self) -> Result<()> {
        if self.output.is_none() && !self.check && self.suggest == 0 && self.picture.is_none() {
            return Err(usage(
                "--output",
                "there is nothing to do",
                "Give -o A.json, --check, --suggest N or --picture P.png",
            ));
        }
        if self.suggest > MOST_SUGGESTED {
            let what = format!("{} places", self.suggest);
            return Err(usage("--suggest", &what, &format!("Give at most {MOST_SUGGESTED}")));
        }
        check_outputs([&self.output, &self.picture].into_iter().flatten().map(PathBuf::as_path))?;
        self.picture.as_deref().map_or(Ok(()), crate::io::image_file::check_image_extension)
    }
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    arguments.check()?;
    let mut session = Session::start_on_cpu(common)?;
    let (mut source, mut target) = (session.mesh(&arguments.source)?, session.target(&arguments.target)?);
    let mut seeds = match &arguments.anchors {
        Some(path) => anchor_pairs(path, &source, &target, &session)?,
        None => AnchorPairs::default(),
    };
    let options = arguments.embedding.options();
    session.embed(&mut source, &options)?;
    session.embed(&mut target, &options)?;
    let mut said = Contradictions::default();
    let mut dropped = Vec::new();
    let given = seeds.len();
    if !seeds.is_empty() {
        said = contradicted(source.shape(), target.shape(), &seeds)?;
        let outliers = &said.outliers;
        say_outliers(&session, outliers, arguments.drop_outliers);
        if arguments.drop_outliers {
            dropped = outliers.iter().map(|o| o.index).collect();
            seeds = without(&seeds, &dropped);
        }
        session.watch.lap("check");
    }
    let Contradictions { outliers, at_odds, too_few } = said;
    if arguments.check && outliers.is_empty() && at_odds.is_none() && !too_few {
        session.say(&format!("{} pairs, none contradicts the others", seeds.len()));
    }
    let proposal = if arguments.check {
        None
    } else {
        let options = AnchorOptions { count: arguments.count, connectivity: !arguments.ignore_connectivity };
        let proposal = propose(source.shape(), target.shape(), &seeds, &options, session.progress())?;
        session.watch.lap("propose");
        Some(proposal)
    };
    let pairs = proposal.as_ref().map_or_else(|| seeds.clone(), Proposal::anchors);
    if let Some(p) = &proposal {
        say_proposal(&session, p);
    }
    let remarks = remarks(proposal.as_ref(), &pairs, &outliers, arguments.drop_outliers);
    let doubtful = remarks.iter().filter(|r| r.flagged.is_some()).count();
    // Pairs none of which can be trusted are worse than none.
    let withheld = doubtful > 0 && doubtful == pairs.len() && !arguments.force;
    if let Some(path) = arguments.output.as_ref().filter(|_| !withheld) {
        crate::io::anchors::write_pairs(path, (&source.mesh, &pairs.source), (&target.mesh, &pairs.target), &remarks)?;
        session.say(&format!("{}: {} pairs", path.display(), pairs.len()));
    }
    let mut suggestions = Vec::new();
    if arguments.suggest > 0 {
        // The places are those that the pairs made by hand leave open, not those that were proposed
        // for them.
        let known = if seeds.is_empty() { &pairs } else { &seeds };
        suggestions = suggest(source.shape(), target.shape(), known, arguments.suggest)?;
        say_suggestions(&session, &source, &target, &suggestions);
        session.watch.lap("suggest");
    }
    if let Some(path) = &arguments.picture {
        let (on_source, on_target) = if suggestions.is_empty() {
            (pairs.source.clone(), pairs.target.clone())
        } else {
            let shown: Vec<(SurfacePoint, SurfacePoint)> =
                suggestions.iter().filter_map(|s| Some((s.guess?, target.topology.vertex_point(s.vertex)?))).collect();
            shown.into_iter().unzip()
        };
        picture(path, &source, &target, &on_source, &on_target, &session)?;
        session.watch.lap("picture");
    }
    let mut report = session.report("anchors");
    fill(&mut report, proposal.as_ref(), &outliers, &dropped, &suggestions, &source);
    let mut verdict = Verdict::default();
    let share = doubtful as f64 / pairs.len().max(1) as f64;
    // The others are worth having, and the file says which are which.
    verdict.share(share, 0.0, 0.99, "of the pairs are doubtful (--picture shows them)");
    if pairs.is_empty() {
        verdict.unusable.push("there are no pairs".to_owned());
    }
    verdict.unusable.extend(at_odds.map(odds));
    if too_few {
        verdict.look_at.push(format!("{given} pairs are too few to tell whether one of them is wrong (six are not)"));
    }
    let wanted = if proposal.is_some() { arguments.count } else { 0 };
    if 2 * pairs.len() < wanted && !pairs.is_empty() {
        verdict.look_at.push(format!("{} of {wanted} pairs were found", pairs.len()));
    }
    report["verdict"] = verdict.describe();
    session.write_report(&report)?;
    let remedy = "Give some pairs by hand with --anchors, eight or more, where limbs and faces are told apart";
    if withheld && arguments.output.is_some() {
        let what = format!("all {doubtful} pairs are doubtful, and no file is written");
        return Err(Error::unusable(what, format!("{remedy}; --force writes them")));
    }
    verdict.tell(&session, arguments.strict, remedy)
}

/// The sentence about pairs most of which are wrong.
pub(crate) fn odds(usual: f64) -> String {
    format!(
        "the pairs contradict one another: where each is left out, half of them are missed by {usual:.2} of the square \
         root of the area or more"
    )
}

fn without(pairs: &AnchorPairs, dropped: &[usize]) -> AnchorPairs {
    let keep =
        |x: &[SurfacePoint]| x.iter().enumerate().filter(|(i, _)| !dropped.contains(i)).map(|(_, p)| *p).collect();
    AnchorPairs { source: keep(&pairs.source), target: keep(&pairs.target) }
}

fn say_outliers(session: &Session<'_>, outliers: &[Outlier], dropped: bool) {
    for o in outliers {
        session.warn(&format!(
            "pair {} contradicts the others: they would send it {:.3} of the square root of the area away{}",
            o.index,
            o.off,
            if dropped { "; it is left out" } else { " (--drop-outliers leaves it out)" }
        ));
    }
}

fn say_proposal(session: &Session<'_>, proposal: &Proposal) {
    for note in &proposal.notes {
        session.warn(note);
    }
    let flagged: Vec<String> =
        proposal.pairs.iter().enumerate().filter(|(_, p)| p.flagged.is_some()).map(|(i, _)| i.to_string()).collect();
    if !flagged.is_empty() {
        session.warn(&format!("doubtful pairs, flagged in the file: {}", flagged.join(", ")));
    }
}

fn say_suggestions(session: &Session<'_>, source: &Surface, target: &Surface, suggestions: &[Suggestion]) {
    session.say("place  target vertex  position                       source guess (face, position)                    expected error");
    for (i, s) in suggestions.iter().enumerate() {
        let at = target.mesh.positions[s.vertex as usize];
        let guess = s.guess.map_or_else(
            || "none".to_owned(),
            |g| {
                let p = g.position(&source.mesh);
                format!("{} ({:.4}, {:.4}, {:.4})", source.mesh.point_in_file(g).face, p.x, p.y, p.z)
            },
        );
        let at = format!("({:.4}, {:.4}, {:.4})", at.x, at.y, at.z);
        session.say(&format!("{i:<5}  {:<13}  {at:<29}  {guess:<46}  {:.4}", s.vertex, s.expected_error));
    }
    if suggestions.is_empty() {
        session.say("(no place is left: every vertex has an anchor)");
    }
}

/// What the file says of each pair.
fn remarks(proposal: Option<&Proposal>, pairs: &AnchorPairs, outliers: &[Outlier], dropped: bool) -> Vec<PairRemark> {
    let mut remarks: Vec<PairRemark> = match proposal {
        Some(p) => p
            .pairs
            .iter()
            .map(|p| PairRemark {
                origin: p.origin.word(),
                expected_error: p.expected_error,
                flagged: p.flagged.clone(),
            })
            .collect(),
        None => vec![PairRemark { origin: "given", expected_error: 0.0, flagged: None }; pairs.len()],
    };
    if !dropped {
        for o in outliers {
            remarks[o.index].flagged =
                Some(format!("the others would send it {:.3} of the square root of the area away", o.off));
        }
    }
    remarks
}

/// Both meshes from in front and from behind, with the points numbered alike.
fn picture(
    path: &Path,
    source: &Surface,
    target: &Surface,
    on_source: &[SurfacePoint],
    on_target: &[SurfacePoint],
    session: &Session<'_>,
) -> Result<()> {
    let mut views = Vec::new();
    for (surface, points) in [(source, on_source), (target, on_target)] {
        session.warn_of_up(&surface.mesh);
        for azimuth in [20.0, 200.0] {
            let options = RenderOptions { up: session.up(), azimuth, anchor_numbers: true, ..RenderOptions::default() };
            views.push(render(&surface.mesh, Coloring::Plain([190, 190, 196]), points, &options)?);
        }
    }
    let row = side_by_side(&views, 8, [255; 4])?;
    crate::io::write_image(&row, path)
}

fn fill(
    report: &mut Value,
    proposal: Option<&Proposal>,
    outliers: &[Outlier],
    dropped: &[usize],
    suggestions: &[Suggestion],
    source: &Surface,
) {
    report["outliers"] = outliers.iter().map(|o| json!({"pair": o.index, "off": o.off})).collect();
    report["dropped"] = json!(dropped);
    if let Some(p) = proposal {
        report["given"] = json!(p.given);
        report["pairs"] = p
            .pairs
            .iter()
            .map(|p| json!({"origin": p.origin.word(), "expected_error": p.expected_error, "flagged": p.flagged}))
            .collect();
        report["notes"] = json!(p.notes);
        report["ambiguity"] = json!(p.ambiguity);
    }
    report["suggestions"] = suggestions
        .iter()
        .map(|s| {
            let guess = s.guess.map(|g| {
                let here = source.mesh.point_in_file(g);
                let position = g.position(&source.mesh).to_array();
                json!({"face": here.face, "barycentric": here.barycentric, "position": position})
            });
            json!({"target": {"vertex": s.vertex}, "source": guess, "expected_error": s.expected_error})
        })
        .collect();
}
