//! What `warp` and `warp-points` share: the cage, its partition, its certificate, and the report
//! about them.

use std::path::{Path, PathBuf};

use clap::builder::{PossibleValuesParser, TypedValueParser};
use serde_json::{Value, json};

use crate::cli::common::{Session, usage};
use crate::cli::repeated::Repeated;
use crate::engine::Engine;
use crate::io::cage::CageUnits;
use crate::mapping::plane::{
    Cage, CertifyOptions, CompositeMap, Coordinates, Partition, PartitionKind, PartitionOptions, PathKind,
    SampleOptions, Verdict, certify, partition,
};
use crate::{Error, Result};

/// How a cage becomes a map.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct MappingArguments {
    /// The cage: JSON with the polygons `source` and `target`, each one loop [[x,y],...] or a list
    /// of nested loops
    #[arg(long)]
    pub(crate) cage: PathBuf,
    /// How the vertices move from source to target; where a path fails, the next one is taken
    #[arg(long, value_parser = path_kind(), default_value = "intrinsic")]
    path: PathKind,
    /// How the map is cut into steps that do not fold: binary, direct, uniform:M, uniform:auto or
    /// continuous
    #[arg(long, default_value = "binary", value_parser = partition_kind)]
    partition: PartitionKind,
    /// Steps no longer than this are not halved any more; those of the compatible path, the last
    /// resort, may be, to a 65,536th of it (a note says so, and `steps_below_eps` of the report
    /// counts them)
    #[arg(long, default_value_t = PartitionOptions::default().eps)]
    eps: f64,
    /// Samples along the longer side of a polygon, for its smallest Jacobian
    #[arg(long, default_value_t = SampleOptions::default().resolution)]
    resolution: u32,
    /// The barycentric coordinates; Wachspress coordinates want convex polygons
    #[arg(long, value_enum, default_value = "mean-value")]
    pub(crate) coordinates: Coordinates,
    /// Prove that no step folds (mean value coordinates only)
    #[arg(long)]
    certify: bool,
    /// Boxes that the proof of one step may examine
    #[arg(long, default_value_t = CertifyOptions::default().boxes)]
    boxes: u64,
    /// End with an error, and without an output, if the map folds
    #[arg(long)]
    strict: bool,
}

/// The paths one may ask for: the fourth is what these become where they must change continuously.
fn path_kind() -> impl TypedValueParser<Value = PathKind> {
    let asked = [PathKind::Intrinsic, PathKind::Linear, PathKind::Compatible];
    PossibleValuesParser::new(asked.map(PathKind::word)).try_map(|word| word.parse::<PathKind>())
}

/// `binary`, `uniform:8` and the like.
fn partition_kind(text: &str) -> std::result::Result<PartitionKind, String> {
    Ok(match text {
        "direct" => PartitionKind::Direct,
        "binary" => PartitionKind::Binary,
        "continuous" => PartitionKind::Continuous,
        "uniform:auto" => PartitionKind::UniformAuto,
        other => match other.strip_prefix("uniform:").and_then(|m| m.parse::<u32>().ok()) {
            Some(m) if m > 0 => PartitionKind::Uniform(m),
            _ => {
                return Err(format!(
                    "{text:?} is no partition: write binary, direct, uniform:M, uniform:auto or continuous"
                ));
            }
        },
    })
}

/// A cage that has become a map.
pub(crate) struct CageMap {
    pub(crate) cage: Cage,
    pub(crate) partition: Partition,
    pub(crate) map: CompositeMap,
    pub(crate) options: PartitionOptions,
    verdicts: Vec<Verdict>,
    strict: bool,
}

impl CageMap {
    /// Reads the cage, cuts the map into steps and, if that is wanted, proves them.
    pub(crate) fn new(session: &mut Session<'_>, arguments: &MappingArguments) -> Result<(Self, Option<CageUnits>)> {
        let file = crate::io::cage::read_cage(&arguments.cage)?;
        let cage = Cage::new(file.source, file.target).map_err(|e| in_file(&arguments.cage, e))?;
        session.watch.lap("read");
        let coordinates = arguments.coordinates;
        if arguments.certify && coordinates != Coordinates::MeanValue {
            return Err(usage("--certify", "only mean value coordinates can be certified", "Leave one of the two out"));
        }
        let options = PartitionOptions {
            kind: arguments.partition,
            path: arguments.path,
            eps: arguments.eps,
            samples: SampleOptions { resolution: arguments.resolution },
            coordinates,
        };
        let found =
            partition(&session.engine, &cage, &options, session.progress()).map_err(|e| in_file(&arguments.cage, e))?;
        session.watch.lap("partition");
        for note in &found.notes {
            session.warn(note);
        }
        let mut verdicts = Vec::new();
        if arguments.certify && !found.folds {
            let budget = CertifyOptions { boxes: arguments.boxes, ..CertifyOptions::default() };
            let progress = Repeated::new(&session.bars, found.polygons.len() - 1);
            for pair in found.polygons.windows(2) {
                verdicts.push(certify(&pair[0], &pair[1], &budget, &progress)?);
            }
            session.watch.lap("certify");
        }
        let map = CompositeMap::new(coordinates, found.polygons.clone())?;
        let made = Self { cage, partition: found, map, options, verdicts, strict: arguments.strict };
        made.tell(session);
        Ok((made, file.units))
    }

    /// `certified`, `sampled` or `failed`.
    pub(crate) fn bijective(&self) -> &'static str {
        if self.partition.folds || self.verdicts.iter().any(|v| matches!(v, Verdict::Folds { .. })) {
            "failed"
        } else if !self.verdicts.is_empty() && self.verdicts.iter().all(|v| matches!(v, Verdict::Certified { .. })) {
            "certified"
        } else {
            "sampled"
        }
    }

    /// Warnings about folds and about what could not be proved.
    fn tell(&self, session: &Session<'_>) {
        let steps = &self.partition.steps;
        if let Some(step) = steps.iter().find(|s| !s.minimum.positive()) {
            session.warn(&format!(
                "the map folds: between t = {} and {} its Jacobian goes down to {:.4} at ({}, {})",
                step.from, step.to, step.minimum.value, step.minimum.at.x, step.minimum.at.y
            ));
        }
        for (step, verdict) in steps.iter().zip(&self.verdicts) {
            let between = format!("between t = {} and {}", step.from, step.to);
            match verdict {
                Verdict::Certified { .. } => {}
                Verdict::Undecided { boxes, .. } => session
                    .warn(&format!("{between} nothing is proved within {boxes} boxes; a larger --boxes may do it")),
                Verdict::Folds { at, value } => session.warn(&format!(
                    "{between} the map is proved to fold: the Jacobian is {value:.4e} at ({}, {})",
                    at.x, at.y
                )),
            }
        }
    }

    /// Adds what is known about the map to a report.
    pub(crate) fn describe(&self, report: &mut Value) {
        let p = &self.partition;
        let steps: Vec<Value> = p
            .steps
            .iter()
            .enumerate()
            .map(|(k, s)| {
                let mut step = json!({
                    "from": s.from,
                    "to": s.to,
                    "j_min": s.minimum.value,
                    "at": [s.minimum.at.x, s.minimum.at.y],
                    "kind": s.minimum.kind.name(),
                });
                if let Some(Verdict::Certified { lower_bound }) = self.verdicts.get(k) {
                    step["lower_bound"] = json!(lower_bound);
                }
                step
            })
            .collect();
        let b = p.sufficient_bound();
        let bounds: Vec<Value> = b
            .steps
            .iter()
            .map(|s| json!({"displacement": s.displacement, "lemma_1": s.lemma_1, "lemma_2": s.lemma_2}))
            .collect();
        report["coordinates"] = json!(self.map.coordinates().word());
        report["vertices"] = json!(self.cage.source.vertex_count());
        report["partition"] = json!(p.knots);
        report["steps"] = json!(steps);
        report["path"] = json!(p.path.word());
        // A step longer than eps may be halved, so that half of it is the least that eps allows.
        let lengths = || p.knots.windows(2).map(|k| k[1] - k[0]);
        report["eps"] = json!(self.options.eps);
        report["shortest_step"] = json!(lengths().fold(1.0, f64::min));
        report["steps_below_eps"] = json!(lengths().filter(|length| *length < 0.5 * self.options.eps).count());
        report["bijective"] = json!(self.bijective());
        report["sufficient_bound"] = json!({
            "sampled": true,
            "gradient": b.gradient,
            "displacement": b.displacement,
            "limit": b.limit,
            "holds": b.holds(),
            "steps": bounds,
        });
        report["notes"] = json!(p.notes);
    }

    /// With `--strict`, a map that folds ends the command once its report is written.
    pub(crate) fn refuse_folds(&self, session: &Session<'_>, command: &str) -> Result<()> {
        if !self.strict || self.bijective() != "failed" {
            return Ok(());
        }
        let mut report = session.report(command);
        self.describe(&mut report);
        session.write_report(&report)?;
        Err(Error::numeric(
            "the map folds, and --strict forbids that",
            "Use --partition binary with a smaller --eps, or move the cage less",
        ))
    }

    /// One line about the map.
    pub(crate) fn summary(&self, engine: &Engine) -> String {
        let least = self.partition.steps.iter().map(|s| s.minimum.value).fold(f64::INFINITY, f64::min);
        format!(
            "{} steps along the {} path, smallest Jacobian of a step {:.4}, bijective: {}, by {}",
            self.partition.steps.len(),
            self.partition.path.word(),
            least,
            self.bijective(),
            engine.description()
        )
    }
}

/// An error about a cage, with the name of its file.
fn in_file(path: &Path, error: Error) -> Error {
    match error {
        Error::Input { what, remedy } => Error::format(path, None, what, remedy),
        Error::Numeric { what, remedy } => Error::format(path, None, what, remedy),
        other => other,
    }
}
