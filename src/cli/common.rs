//! What the commands share: options, meshes with their embeddings, anchors, reports.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::conformance::kernels;

pub(crate) use crate::desk::Subject as Surface;
use crate::desk::find_pairs;
use crate::engine::{Backend, Engine, EngineOptions};
use crate::geometry::up_axis::stands_along_z;
use crate::geometry::{Mesh, SurfacePoint, UpAxis, Weld};
use crate::io::anchors::AnchorList;
use crate::io::cache::Cache;
use crate::io::{Companions, LoadedMesh, ReadOptions, Taken, write_obj_with};
use crate::progress::Progress;
use crate::surface::Sampling;
use crate::surface::{AnchorPairs, EmbeddingOptions};
use crate::tools::stopwatch::{StageTime, Stopwatch};
use crate::{Error, Result, memory};
use clap::Args;
use serde_json::{Value, json};

use crate::cli::machine::Machine;
use crate::cli::plan::Stages;
use crate::cli::progress_bar::Bars;
use crate::cli::streams::{as_given, stdout_taken};
use crate::cli::told::Told;

/// Options of every command.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Options of every command")]
pub(crate) struct Common {
    /// Where the work is done: auto takes a hardware adapter, else the CPU; gpu takes a software
    /// adapter too; reference is double precision
    #[arg(long, value_enum, default_value = "auto", global = true)]
    pub(crate) backend: Backend,
    /// Part of the name of the adapter to use (see `barymap devices`)
    #[arg(long, global = true)]
    pub(crate) adapter: Option<String>,
    /// A kernel that stays on the CPU, by the name of its file in shaders/; may be given several
    /// times. It tells which kernel a driver gets wrong
    #[arg(long, value_name = "KERNEL", global = true, hide_short_help = true)]
    pub(crate) host: Vec<String>,
    /// Write a JSON report here
    #[arg(long, global = true)]
    pub(crate) report: Option<PathBuf>,
    /// Memory that the process may use, in bytes or with K, M, G: work that takes more is refused
    /// with the number. The program itself (100 MB, 400 with a software adapter) comes on top
    #[arg(long, default_value = "4G", value_parser = bytes, global = true)]
    pub(crate) memory: u64,
    /// Which axis of the meshes points up (y if not given): pictures show it upright, and glTF,
    /// which is y up, is written turned
    #[arg(long, value_enum, global = true)]
    pub(crate) up: Option<UpAxis>,
    /// Neither read nor write cached embeddings and hierarchies
    #[arg(long, global = true)]
    pub(crate) no_cache: bool,
    /// Threads that work in parallel, at most four for each core; as many as there are cores if not
    /// given. Results do not depend on it
    #[arg(long, global = true, value_name = "N")]
    pub(crate) threads: Option<usize>,
    /// Read files that other files name (material libraries, textures, buffers, meshes of a list)
    /// only from the folder of the file that names them and from folders below it
    #[arg(long, global = true)]
    pub(crate) confine: bool,
    /// Overwrite what is read, and files that have the names of companions of an output (material
    /// libraries, textures)
    #[arg(long, global = true)]
    pub(crate) overwrite: bool,
    /// Say nothing but errors
    #[arg(long, short, global = true)]
    pub(crate) quiet: bool,
    /// Join open edges of a mesh that lie within this distance of one another, which keeps vertex
    /// numbers; 0 joins those on one another, no joins none
    #[arg(long, value_name = "TOLERANCE|no", default_value = "0", value_parser = weld, global = true)]
    pub(crate) weld: Weld,
    /// Which set of texture coordinates of glTF files is used: one number, or the source's and the
    /// target's. Without it, the one that the material's base colour has
    #[arg(long, value_name = "N[,N]", value_delimiter = ',', num_args = 1..=2, global = true)]
    pub(crate) uv_set: Vec<usize>,
    /// The stages of the command.
    #[arg(skip)]
    pub(crate) stages: Stages,
}

impl Common {
    /// How meshes are read: the only one, or the source.
    pub(crate) fn read_options(&self) -> ReadOptions {
        ReadOptions { weld: self.weld, uv_set: self.uv_set.first().copied() }
    }

    /// How targets are read.
    pub(crate) fn target_options(&self) -> ReadOptions {
        ReadOptions { uv_set: self.uv_set.last().copied(), ..self.read_options() }
    }
}

/// `4G` and the like.
fn bytes(text: &str) -> std::result::Result<u64, String> {
    let (digits, unit) = match text.char_indices().last() {
        Some((i, c)) if c.is_ascii_alphabetic() => (&text[..i], c.to_ascii_uppercase()),
        _ => (text, 'B'),
    };
    let factor = match unit {
        'B' => 1u64,
        'K' => 1 << 10,
        'M' => 1 << 20,
        'G' => 1 << 30,
        _ => return Err(format!("{text:?} is no size: write 4G, 512M or a number of bytes")),
    };
    let number: u64 =
        digits.trim().parse().map_err(|_| format!("{text:?} is no size: write 4G, 512M or a number of bytes"))?;
    number.checked_mul(factor).filter(|&n| n > 0).ok_or_else(|| format!("{text:?} is out of range"))
}

/// `no` or a distance.
fn weld(text: &str) -> std::result::Result<Weld, String> {
    match text.trim().parse::<f64>() {
        _ if text.trim() == "no" => Ok(Weld::No),
        Ok(0.0) => Ok(Weld::Exact),
        Ok(tolerance) if tolerance > 0.0 && tolerance.is_finite() => Ok(Weld::Within(tolerance)),
        _ => Err(format!("{text:?} is no distance: write 0.001 or the like in units of the mesh, or no")),
    }
}

/// A line on stdout, or on stderr where stdout holds a result. Where nobody reads it any more
/// (`barymap ... | head -1`), the work goes on without it.
pub(crate) fn line(text: &str) {
    let text = as_given(text);
    // There is nobody to tell that nobody listens.
    let _ = match stdout_taken() {
        true => writeln!(std::io::stderr(), "{text}"),
        false => writeln!(std::io::stdout(), "{text}"),
    };
}

/// A note on stderr, as [`line`].
pub(crate) fn note(text: &str) {
    let _ = writeln!(std::io::stderr(), "note: {}", as_given(text));
}

/// Tells why the command ends, on stderr; returns its exit code.
pub(crate) fn failed(error: Error) -> u8 {
    let error = crate::cli::as_option(error);
    let _ = writeln!(std::io::stderr(), "barymap: {}", as_given(&error.to_string()));
    crate::cli::code(&error)
}

/// A command at work: its engine, progress and clock.
pub(crate) struct Session<'a> {
    pub(crate) common: &'a Common,
    pub(crate) engine: Engine,
    pub(crate) bars: Bars,
    pub(crate) watch: Stopwatch,
    /// What the method `field` chose, for the report.
    pub(crate) field: Option<Value>,
    /// What became of the alignment of its embeddings, for the report.
    pub(crate) alignment: Option<Value>,
    /// Points of the map that kernels handed back to the CPU, for the report; none where no kernel
    /// mapped any.
    pub(crate) handed_back: Option<u64>,
    cache: Cache,
    told: Mutex<Told>,
}

impl Drop for Session<'_> {
    fn drop(&mut self) {
        if !self.common.quiet {
            self.told.lock().unwrap_or_else(PoisonError::into_inner).rest().for_each(|text| note(&text));
        }
    }
}

impl<'a> Session<'a> {
    /// Starts the engine and checks early that the report can be written.
    pub(crate) fn start(common: &'a Common) -> Result<Self> {
        Self::with_backend(common, common.backend)
    }

    fn with_backend(common: &'a Common, backend: Backend) -> Result<Self> {
        if let Some(report) = &common.report {
            crate::io::output::check_writable(report)?;
        }
        if let Some(name) = common.host.iter().find(|name| kernels().iter().all(|k| k.name != name.as_str())) {
            let mut known: Vec<&str> = kernels().iter().map(|k| k.name).collect();
            known.dedup();
            return Err(Error::option(
                "--host",
                format!("there is no kernel {name}"),
                format!("Give one of {}", known.join(", ")),
            ));
        }
        // A driver that gets no threads or addresses ends the process.
        let auto_on_cpu = backend == Backend::Auto && !Machine::here().is_roomy();
        let engine = Engine::new(EngineOptions {
            backend: if auto_on_cpu { Backend::Cpu } else { backend },
            adapter: common.adapter.clone(),
            cpu_stages: common.host.clone(),
            // Of a software adapter it is the process's own.
            memory: Some(common.memory),
            ..EngineOptions::default()
        })?;
        if engine.gpu().is_some() {
            memory::allow_driver();
        }
        let session = Self {
            common,
            bars: Bars::new(common.quiet, common.stages),
            watch: Stopwatch::on(&engine),
            engine,
            field: None,
            alignment: None,
            handed_back: None,
            cache: if common.no_cache { Cache::disabled() } else { Cache::from_environment() },
            told: Mutex::default(),
        };
        if let Some(note) = session.engine.note() {
            session.warn(note);
        }
        Ok(session)
    }

    /// A session for work that always runs on the CPU: no adapter is looked for.
    pub(crate) fn start_on_cpu(common: &'a Common) -> Result<Self> {
        Self::with_backend(common, Backend::Cpu)
    }

    /// A line on stderr, unless quiet.
    pub(crate) fn warn(&self, text: &str) {
        self.bars.finish();
        if !self.common.quiet && self.told.lock().unwrap_or_else(PoisonError::into_inner).is_new(text) {
            note(text);
        }
    }

    /// The axis that points up.
    pub(crate) fn up(&self) -> UpAxis {
        self.common.up.unwrap_or_default()
    }

    /// A note where a mesh seems to stand along z and no axis is given. For commands whose pictures
    /// or files depend on it.
    pub(crate) fn warn_of_up(&self, mesh: &Mesh) {
        if self.common.up.is_none() && stands_along_z(mesh) {
            self.warn(&format!(
                "{}: it seems to stand along z, as a body with its feet there: --up z shows it upright",
                mesh.name
            ));
        }
    }

    /// What was passed over in a table.
    pub(crate) fn warn_of_table(&self, path: &Path, notes: &[String]) {
        notes.iter().for_each(|note| self.warn(&format!("{}: {note}", path.display())));
    }

    /// A line on stdout, unless quiet.
    pub(crate) fn say(&self, text: &str) {
        self.bars.finish();
        if !self.common.quiet {
            line(text);
        }
    }

    /// Reads a mesh as the common options say, and tells what the reader says.
    pub(crate) fn load(&self, path: &Path) -> Result<LoadedMesh> {
        let loaded = crate::io::read_mesh_with(path, &self.common.read_options())?;
        for warning in &loaded.warnings {
            self.warn(&format!("{}: {warning}", path.display()));
        }
        Ok(loaded)
    }

    /// Reads a mesh alone, as [`Session::load`].
    pub(crate) fn read(&self, path: &Path) -> Result<Mesh> {
        Ok(self.load(path)?.mesh)
    }

    /// Reads a mesh and tells what is wrong with it.
    pub(crate) fn mesh(&mut self, path: &Path) -> Result<Surface> {
        self.open(path, &self.common.read_options())
    }

    /// As [`Session::mesh`], for a target.
    pub(crate) fn target(&mut self, path: &Path) -> Result<Surface> {
        self.open(path, &self.common.target_options())
    }

    fn open(&mut self, path: &Path, options: &ReadOptions) -> Result<Surface> {
        let surface = Surface::open(path, options)?;
        self.warn_all(&surface.notes);
        self.watch.lap("read");
        Ok(surface)
    }

    /// Notes of the library.
    pub(crate) fn warn_all(&self, notes: &[String]) {
        notes.iter().for_each(|note| self.warn(note));
    }

    /// A mesh made in memory, with its adjacency.
    pub(crate) fn surface(&self, mesh: Mesh) -> Result<Surface> {
        let surface = Surface::new(mesh)?;
        self.warn_all(&surface.notes);
        Ok(surface)
    }

    /// Embeds a surface, or takes its embedding from the cache. The options are the same for a
    /// whole command: a surface that has an embedding keeps it.
    pub(crate) fn embed(&mut self, surface: &mut Surface, options: &EmbeddingOptions) -> Result<()> {
        if surface.embedding.is_some() {
            return Ok(());
        }
        let notes = surface.embed(options, &self.cache, &self.bars)?;
        self.bars.finish();
        self.warn_all(&notes);
        self.watch.lap("embed");
        Ok(())
    }

    /// Finds anchors on a mesh and names those that were moved to it.
    pub(crate) fn find(&self, surface: &Surface, list: &AnchorList) -> Result<Vec<SurfacePoint>> {
        let found = surface.find(list)?;
        self.warn_all(&found.notes);
        Ok(found.points)
    }

    /// The word of reports for where a stage ran.
    pub(crate) fn ran_on(&self, stage: &StageTime) -> &'static str {
        match self.engine.backend() {
            _ if stage.on_device() => "gpu",
            Backend::Reference => "reference",
            _ => "cpu",
        }
    }

    /// The beginning of every report. The back end is the one that did the work: the CPU where no
    /// kernel ran.
    pub(crate) fn report(&self, command: &str) -> Value {
        let on_device = self.watch.stages().iter().any(StageTime::on_device);
        let cpu = (self.engine.gpu().is_some() && !on_device).then(Engine::cpu);
        let d = cpu.as_ref().unwrap_or(&self.engine).description();
        let mut report = json!({
            "command": command,
            "version": env!("CARGO_PKG_VERSION"),
            "backend": {"kind": d.backend, "name": d.name, "driver": d.driver},
            "seconds": {},
            "cpu_seconds": {},
            "stages_on": {},
        });
        self.report_stages(&mut report, "", self.watch.stages());
        if let Some(points) = self.handed_back {
            report["handed_back"] = json!(points);
        }
        if let Some(field) = &self.field {
            report["field"] = field.clone();
        }
        if let Some(alignment) = &self.alignment {
            report["alignment"] = alignment.clone();
        }
        report
    }

    /// Adds stages to a report: time, place and, with a device, traffic. `within` is the stage that
    /// they are parts of, with a dot, or empty.
    pub(crate) fn report_stages(&self, report: &mut Value, within: &str, stages: &[StageTime]) {
        for stage in stages {
            let key = format!("{within}{}", stage.name);
            report["seconds"][&key] = json!(stage.seconds);
            if let Some(seconds) = stage.cpu_seconds {
                report["cpu_seconds"][&key] = json!(seconds);
            }
            report["stages_on"][&key] = json!(self.ran_on(stage));
            if self.engine.gpu().is_some() {
                let t = stage.traffic;
                report["traffic"][&key] = json!({
                    "bytes_up": t.bytes_up,
                    "bytes_up_once": t.bytes_up_once,
                    "bytes_down": t.bytes_down,
                    "dispatches": t.dispatches,
                    "submissions": t.submissions,
                    "waits": t.waits,
                    "allocations": t.allocations,
                });
            }
        }
    }

    /// Writes the report where one is asked for.
    pub(crate) fn write_report(&self, report: &Value) -> Result<()> {
        match &self.common.report {
            Some(path) => crate::io::report::write_report(path, report),
            // What is told would be wrong as well.
            None => crate::io::report::check_report(Path::new("the summary"), report),
        }
    }

    /// Writes a mesh as OBJ and tells of the files beside it.
    pub(crate) fn write_obj(&self, mesh: &Mesh, path: &Path) -> Result<()> {
        let taken = if self.common.overwrite { Taken::Overwritten } else { Taken::Stays };
        self.tell_companions(path, &write_obj_with(mesh, path, taken)?);
        Ok(())
    }

    /// Tells of the files beside an output.
    pub(crate) fn tell_companions(&self, path: &Path, companions: &Companions) {
        for file in &companions.written {
            let taken = companions.renamed.iter().find(|(_, new)| new == file);
            let why = taken.map_or_else(String::new, |(old, _)| {
                format!("; {} is another file and stays (--overwrite takes its name)", old.display())
            });
            self.say(&format!("{}: written beside {}{why}", file.display(), path.display()));
        }
        for file in &companions.referred {
            self.say(&format!("{}: unchanged, {} refers to it", file.display(), path.display()));
        }
    }

    /// Where costly results are kept.
    pub(crate) fn cache(&self) -> &Cache {
        &self.cache
    }

    /// The progress receiver.
    pub(crate) fn progress(&self) -> &dyn Progress {
        &self.bars
    }
}

/// Reads anchor pairs and finds them on their meshes.
pub(crate) fn anchor_pairs(
    path: &str,
    source: &Surface,
    target: &Surface,
    session: &Session<'_>,
) -> Result<AnchorPairs> {
    let found = find_pairs(&crate::io::anchors::read_pairs(path)?, source, target)?;
    session.warn_all(&found.notes);
    Ok(found.pairs)
}

/// Options of the embedding, for the commands that need one.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct EmbeddingArguments {
    /// Number of landmarks
    #[arg(long, default_value_t = EmbeddingOptions::default().landmarks)]
    pub(crate) landmarks: usize,
    /// How landmarks are chosen
    #[arg(long, value_enum, default_value = "decimation")]
    pub(crate) sampling: Sampling,
    /// Dimension of the embedding: 4, 8, 12 or 16
    #[arg(long, default_value_t = 8)]
    pub(crate) dimension: usize,
}

impl EmbeddingArguments {
    pub(crate) fn options(&self) -> EmbeddingOptions {
        EmbeddingOptions {
            landmarks: self.landmarks,
            sampling: self.sampling,
            dimension: self.dimension,
            ..EmbeddingOptions::default()
        }
    }
}

/// Fails early where several outputs could not be written.
pub(crate) fn check_outputs<'p>(paths: impl IntoIterator<Item = &'p Path>) -> Result<()> {
    paths.into_iter().try_for_each(crate::io::output::check_writable)
}

/// `WxH` or one number for a square.
pub(crate) fn size(text: &str) -> std::result::Result<(u32, u32), String> {
    let parse = |s: &str| s.trim().parse::<u32>().map_err(|_| format!("{text:?} is no size: write 2048 or 2048x1024"));
    match text.split_once(['x', 'X']) {
        Some((w, h)) => Ok((parse(w)?, parse(h)?)),
        None => parse(text).map(|n| (n, n)),
    }
}

/// An [`Error::Option`] for a wrong combination of options.
pub(crate) fn usage(option: &str, what: &str, remedy: &str) -> Error {
    Error::option(option, what, remedy)
}
