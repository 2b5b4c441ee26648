//! `barymap batch`: the texture of one mesh on many others.

use std::path::{Path, PathBuf};
use std::time::Instant;

use serde_json::{Value, json};

use crate::cli::batch_record::{self, Record};
use crate::cli::common::{Common, EmbeddingArguments, Session, Surface, anchor_pairs, usage};
use crate::cli::interrupt;
use crate::cli::layer_kinds::LayerKinds;
use crate::cli::method::MethodArguments;
use crate::cli::shard::{Shard, shard};
use crate::cli::transfer::{self, Job, Look, add, require_texcoords, target_charts};
use crate::cli::unwrap::Charts;
use crate::desk::Textures;
use crate::io::output_set::OutputFolder;
use crate::io::target_list::{TargetItem, read_targets};
use crate::tools::transfer::Pyramids;
use crate::{Error, Result};

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// The mesh with the texture
    #[arg(long)]
    source: PathBuf,
    /// A texture of the source, as for `transfer`; the results have its name
    #[arg(long)]
    texture: Vec<String>,
    /// File names of the new textures in each result's folder, in place of the textures' own: one
    /// for each layer, or one with <ROLE>; <UDIM> and <MATERIAL> as for `transfer`
    #[arg(long)]
    picture: Vec<String>,
    /// The targets: a folder of meshes with their anchors beside them (a.obj, a.json), or a list of
    /// both in JSON or CSV
    #[arg(long)]
    targets: PathBuf,
    /// Folder for the results, one folder in it for each target
    #[arg(long, short, value_name = "OUT_DIR")]
    output: PathBuf,
    /// Only the targets I, I + N, I + 2 N ... of all, sorted by name and counted from 1
    #[arg(long, default_value = "1/1", value_parser = shard, value_name = "I/N")]
    shard: Shard,
    /// Count results that are not usable as failed: exit code 4 if some are, 3 if all are
    #[arg(long)]
    strict: bool,
    #[command(flatten)]
    method: MethodArguments,
    #[command(flatten)]
    kinds: LayerKinds,
    /// What the results look like; `--coverage`, `--stmap`, `--model` and `--unwrapped` are names
    /// of files in each result's folder
    #[command(flatten)]
    look: Look,
    #[command(flatten)]
    charts: Charts,
    #[command(flatten)]
    embedding: EmbeddingArguments,
}

/// What became of an item.
enum Outcome {
    Done(Record),
    Skipped(Record),
    Failed(String),
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    interrupt::end_with_parent();
    arguments.charts.check(arguments.look.size, arguments.look.model.is_some())?;
    let items = arguments.shard.of(read_targets(&arguments.targets, Some(&arguments.source))?);
    std::fs::create_dir_all(&arguments.output)
        .map_err(|e| Error::io(&arguments.output, e, "Name a folder that can be made and written with -o"))?;
    let mut session = Session::start(common)?;
    let source = session.mesh(&arguments.source)?;
    let mut layers = crate::desk::textures(&arguments.texture, true, &source.mesh, &|text| session.warn(text))?;
    if layers.iter().any(Textures::needs_texcoords) {
        require_texcoords(&source)?;
    }
    arguments.kinds.set(&mut layers)?;
    let names = arguments.names(&layers)?;
    session.watch.lap("read");
    let key = batch_record::source_key(&source.mesh, &layers)
        .bytes(session.engine.description().backend.to_string().as_bytes())
        .bytes(arguments.options(&names).as_bytes());
    let pyramids = Pyramids::new(&session.engine);
    let mut batch = Batch { arguments, source, layers: &layers, pyramids: &pyramids, names, key };
    let mut rows = Vec::new();
    for (k, item) in items.iter().enumerate() {
        session.say(&format!("[{}/{}] {}", k + 1, items.len(), item.name));
        session.bars.item(k, items.len());
        let start = Instant::now();
        let outcome = batch
            .item(&mut session, item)
            .unwrap_or_else(|error| Outcome::Failed(crate::cli::as_option(error).to_string()));
        if let Outcome::Failed(what) = &outcome {
            // Errors are told even where nothing else is.
            crate::cli::common::note(&format!("{}: {what}", item.name));
        }
        rows.push((item.name.as_str(), outcome, start.elapsed().as_secs_f64()));
    }
    session.say(&table(&rows));
    worth(&rows).iter().for_each(|line| session.say(line));
    let report = report(&session, &rows);
    session.write_report(&report)?;
    fail(&rows, arguments.strict)
}

/// Fails where targets did, and with `strict` where results are not usable.
///
/// # Errors
/// [`Error::Unusable`] if all of them are so, [`Error::Incomplete`] if some are.
fn fail(rows: &[(&str, Outcome, f64)], strict: bool) -> Result<()> {
    let named =
        |wrong: &dyn Fn(&Outcome) -> bool| -> Vec<&str> { rows.iter().filter(|r| wrong(&r.1)).map(|r| r.0).collect() };
    let failed = named(&|outcome| matches!(outcome, Outcome::Failed(_)));
    let unusable = named(&|outcome| strict && outcome.is_unusable());
    let sentence = |which: &[&str], what: &str| {
        let shown = which.iter().take(10).copied().collect::<Vec<_>>().join(", ");
        let more = if which.len() > 10 { ", ..." } else { "" };
        (!which.is_empty()).then(|| format!("{} of {} {what}: {shown}{more}", which.len(), rows.len()))
    };
    let told = [sentence(&failed, "targets failed"), sentence(&unusable, "results are not usable")];
    let what = told.into_iter().flatten().collect::<Vec<_>>().join("; ");
    let remedy = match (failed.is_empty(), unusable.is_empty()) {
        (true, true) => return Ok(()),
        (true, false) => "Add pairs to the targets that the lines above name",
        _ => "Mend what the notes above say and run the command again: only what is not done is tried",
    };
    if failed.len() + unusable.len() == rows.len() {
        return Err(Error::unusable(what, remedy));
    }
    Err(Error::Incomplete { what, remedy: remedy.into() })
}

impl Arguments {
    /// Everything but the content of files that decides on the results; no paths, so that a file
    /// may be named in several ways. `names`: of the layers of a result.
    fn options(&self, names: &[String]) -> String {
        format!("{names:?} {:?} {:?} {:?} {:?} {:?}", self.method, self.kinds, self.look, self.charts, self.embedding)
    }

    /// File names of the layers of a result: those of `--picture`, else those of their textures,
    /// else their roles.
    ///
    /// # Errors
    /// If two files of a result had the same name, or one is not a plain name.
    fn names(&self, layers: &[Textures]) -> Result<Vec<String>> {
        let own = |k: usize| self.texture.get(k).filter(|t| layers.len() == self.texture.len() && !t.contains('='));
        let name = |(k, layer): (usize, &Textures)| match own(k) {
            Some(texture) => layer_name(texture),
            None => format!("{}.png", layer.role),
        };
        let derived: Vec<String> = layers.iter().enumerate().map(name).collect();
        let names = if self.picture.is_empty() { &derived } else { &self.picture };
        transfer::layer_names(names, layers)?;
        let path = |p: &Option<PathBuf>| p.as_ref().map(|p| p.to_string_lossy().into_owned());
        let others = [
            ("--coverage", self.look.coverage.clone()),
            ("--stmap", self.look.stmap.clone()),
            ("--model", path(&self.look.model)),
            ("--unwrapped", path(&self.charts.unwrapped)),
        ];
        let others = others.into_iter().filter_map(|(option, name)| Some((option, name?)));
        let mut taken = vec![batch_record::FILE.to_owned()];
        for (option, name) in names.iter().map(|n| ("--picture", n.clone())).chain(others) {
            let plain = Path::new(&name).file_name().is_some_and(|n| n == name.as_str());
            if !plain || taken.contains(&name) {
                let what = if plain {
                    format!("two files of a result would be {name}")
                } else {
                    format!("{name:?} is a path")
                };
                let remedy = "Give names that differ, without folders: they are in the folder of each result";
                return Err(usage(option, &what, remedy));
            }
            taken.push(name);
        }
        self.look.check_model()?;
        Ok(names.clone())
    }
}

/// The name of a layer's picture: that of its texture, without the number of a tile, in a format
/// that holds all it can have (JPEG becomes PNG).
fn layer_name(texture: &str) -> String {
    let path = Path::new(texture);
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    let kept = matches!(extension.as_str(), "png" | "tif" | "tiff" | "exr");
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let stem = stem.split(['<', '%']).next().unwrap_or_default().trim_end_matches(['.', '_', '-', ' ']);
    let stem = if stem.is_empty() { "texture" } else { stem };
    format!("{stem}.{}", if kept { &extension } else { "png" })
}

/// What all items share.
struct Batch<'a> {
    arguments: &'a Arguments,
    source: Surface,
    layers: &'a [Textures],
    /// Made once for all targets.
    pyramids: &'a Pyramids<'a>,
    names: Vec<String>,
    /// Of the source, its textures and the options.
    key: crate::io::CacheKey,
}

impl Batch<'_> {
    /// Makes the result of one target, unless it is there.
    fn item(&mut self, session: &mut Session<'_>, item: &TargetItem) -> Result<Outcome> {
        let (mesh, anchors) = match &item.files {
            Ok(files) => files,
            Err(what) => return Ok(Outcome::Failed(what.clone())),
        };
        let place = self.arguments.output.join(&item.name);
        let loaded = crate::io::read_mesh_with(mesh, &session.common.target_options())?;
        let key = batch_record::target_key(self.key.clone(), &loaded.mesh, anchors)?;
        let there = batch_record::read(&place);
        match there {
            Some(record) if record.key == key && record.is_whole(&place) => return Ok(Outcome::Skipped(record)),
            None if place.exists() && std::fs::read_dir(&place).is_ok_and(|mut d| d.next().is_some()) => {
                let what = std::io::Error::new(std::io::ErrorKind::AlreadyExists, "the folder holds something else");
                return Err(Error::io(&place, what, "Name another output folder, or remove this one"));
            }
            _ => {}
        }
        for warning in &loaded.warnings {
            session.warn(&format!("{}: {warning}", mesh.display()));
        }
        let mut target = Surface { scene: loaded.scene, ..session.surface(loaded.mesh)? };
        session.watch.lap("read");
        let pairs = anchor_pairs(anchors, &self.source, &target, session)?;
        let folder = OutputFolder::replace(&place)?;
        let inside = |name: &Path| folder.path().join(name);
        let text = |name: &String| inside(Path::new(name)).to_string_lossy().into_owned();
        let outputs = transfer::layer_names(&self.names.iter().map(text).collect::<Vec<_>>(), self.layers)?;
        let charts = Charts {
            unwrapped: self.arguments.charts.unwrapped.as_deref().map(inside),
            ..self.arguments.charts.clone()
        };
        let look = Look {
            coverage: self.arguments.look.coverage.as_ref().map(text),
            stmap: self.arguments.look.stmap.as_ref().map(text),
            model: self.arguments.look.model.as_deref().map(inside),
            ..self.arguments.look.clone()
        };
        let charts = target_charts(session, &mut target, &charts, &look, &outputs)?;
        let job = Job {
            layers: self.layers,
            pyramids: self.pyramids,
            anchors: &pairs,
            method: self.arguments.method,
            embedding: &self.arguments.embedding,
            look: &look,
            outputs: &outputs,
        };
        let (result, _, mut report) = job.run(session, "batch", &mut self.source, &mut target)?;
        add(&mut report, &charts);
        report["verdict"] = transfer::verdict(&result, &report).describe();
        let record = Record::new(&item.name, key, report, folder.path())?;
        record.write(folder.path())?;
        folder.finish()?;
        Ok(Outcome::Done(record))
    }
}

impl Outcome {
    fn word(&self) -> &'static str {
        match self {
            Self::Done(_) => "done",
            Self::Skipped(_) => "skipped",
            Self::Failed(_) => "failed",
        }
    }

    fn is_unusable(&self) -> bool {
        self.measures().is_some_and(|report| report["verdict"]["word"] == "not usable")
    }

    fn measures(&self) -> Option<&Value> {
        match self {
            Self::Done(record) | Self::Skipped(record) => Some(&record.report),
            Self::Failed(_) => None,
        }
    }
}

/// A line for each item.
fn table(rows: &[(&str, Outcome, f64)]) -> String {
    let width = rows.iter().map(|r| r.0.chars().count()).max().unwrap_or(0).max("target".len());
    let mut text = format!("{:width$}  {:8} {:>8} {:>9} {:>9}", "target", "status", "valid", "flipped", "seconds");
    for (name, outcome, seconds) in rows {
        let percent = |key: &str| {
            let value = outcome.measures().and_then(|m| m[key].as_f64());
            value.map_or_else(|| "-".to_owned(), |v| format!("{:.2} %", 100.0 * v))
        };
        let (valid, flipped) = (percent("valid_fraction"), percent("flipped_area"));
        text += &format!("\n{name:width$}  {:8} {valid:>8} {flipped:>9} {seconds:9.2}", outcome.word());
    }
    let count = |word: &str| rows.iter().filter(|r| r.1.word() == word).count();
    text + &format!("\n{} done, {} skipped, {} failed", count("done"), count("skipped"), count("failed"))
}

/// What the results are worth: those with something to be seen to, and how many of each kind.
fn worth(rows: &[(&str, Outcome, f64)]) -> Vec<String> {
    let judged = || rows.iter().filter_map(|r| Some((r.0, &r.1.measures()?["verdict"])));
    let because = |verdict: &Value| {
        let reasons: Vec<&str> =
            verdict["because"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        reasons.join("; ")
    };
    let mut lines: Vec<String> = judged()
        .filter_map(|(name, verdict)| match verdict["word"].as_str()? {
            "look" => Some(format!("{name}: look at the result: {}", because(verdict))),
            "not usable" => Some(format!("{name}: not usable, because {}", because(verdict))),
            _ => None,
        })
        .collect();
    let count = |word: &str| judged().filter(|(_, verdict)| verdict["word"] == word).count();
    let (good, look, unusable) = (count("good"), count("look"), count("not usable"));
    lines.push(format!("{good} good, {look} to look at, {unusable} not usable"));
    lines
}

fn report(session: &Session<'_>, rows: &[(&str, Outcome, f64)]) -> Value {
    let item = |(name, outcome, seconds): &(&str, Outcome, f64)| {
        let mut item = json!({"name": name, "status": outcome.word(), "seconds": seconds});
        match outcome {
            Outcome::Failed(what) => item["error"] = json!(what),
            Outcome::Done(record) | Outcome::Skipped(record) => item["report"] = record.report.clone(),
        }
        item
    };
    let count = |word: &str| rows.iter().filter(|r| r.1.word() == word).count();
    let mut report = session.report("batch");
    // They are the last item's.
    for own in ["field", "alignment"] {
        report.as_object_mut().map(|r| r.remove(own));
    }
    report["done"] = json!(count("done"));
    report["skipped"] = json!(count("skipped"));
    report["failed"] = json!(count("failed"));
    report["verdict"] = json!(worth(rows).pop());
    report["items"] = rows.iter().map(item).collect();
    report
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_keep_their_names() {
        for (texture, name) in
            [("a/skin.png", "skin.png"), ("b.EXR", "b.exr"), ("c.jpg", "c.png"), ("d/skin.<UDIM>.tif", "skin.tif")]
        {
            assert_eq!(layer_name(texture), name);
        }
    }
}
