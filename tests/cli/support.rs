//! A folder with two meshes, a texture and anchors, and the program run in it.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::LazyLock;
use std::time::{Duration, Instant, SystemTime};

use barymap::engine::Engine;
use barymap::geometry::Mesh;
use barymap::models::shapes::uv_sphere;
use barymap::picture::{Image, Pixels};
use glam::DVec3;
use serde_json::{Value, json};

use crate::gltf_validator;

/// The target is the source stretched by these factors along its axes.
pub(crate) const STRETCH: DVec3 = DVec3::new(1.1, 1.3, 0.9);

/// What a run of the program left.
#[derive(Debug)]
pub(crate) struct Ran {
    /// Exit code; `None` if a signal ended it.
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
    /// Largest memory that was in use, in bytes, where the system tells.
    pub peak_memory: Option<u64>,
}

impl Ran {
    /// The run ended well.
    #[track_caller]
    pub(crate) fn succeeds(self) -> Self {
        assert_eq!(self.code, Some(0), "{}\n{}", self.stdout, self.stderr);
        self
    }

    /// The run ended with `code` and one paragraph on stderr that holds each of `words`.
    #[track_caller]
    pub(crate) fn fails(self, code: i32, words: &[&str]) -> Self {
        self.fails_like(code, words);
        self
    }

    /// As [`Ran::fails`].
    #[track_caller]
    pub(crate) fn fails_like(&self, code: i32, words: &[&str]) {
        assert_eq!(self.code, Some(code), "{}\n{}", self.stdout, self.stderr);
        let message = self.message();
        for word in words {
            assert!(message.contains(word), "{word:?} is not in: {message}");
        }
    }

    /// The error, which is one paragraph and ends the output.
    #[track_caller]
    pub(crate) fn message(&self) -> &str {
        assert!(!self.stderr.contains("panicked"), "{}", self.stderr);
        let start = self.stderr.find("barymap: ").unwrap_or_else(|| panic!("no message: {:?}", self.stderr));
        let message = self.stderr[start..].trim_end();
        assert!(!message.contains("\n\n") && message.len() < 2000, "not one paragraph: {message}");
        message
    }
}

/// The surroundings of the program: its folder and cache, no input, and the best adapter by name,
/// so that `--backend auto` takes it though it may be software.
fn prepared(command: &mut Command, folder: &Path) {
    static ADAPTER: LazyLock<Option<String>> =
        LazyLock::new(|| Engine::adapters().into_iter().next().map(|adapter| adapter.name));
    command
        .current_dir(folder)
        .env("BARYMAP_CACHE", Path::new(env!("CARGO_TARGET_TMPDIR")).join("cache"))
        .stdin(Stdio::null());
    if let Some(name) = ADAPTER.as_ref() {
        command.env("WGPU_ADAPTER_NAME", name);
    }
}

/// A folder of its own for a test, removed at the end.
pub(crate) struct Folder(tempfile::TempDir);

impl Folder {
    /// An empty folder.
    pub(crate) fn empty() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// `s.obj`, `t.obj`, `s.png` and `a.json`: two spheres of different connectivity whose texture
    /// coordinates correspond, so that the transferred texture is known: it is the source's own.
    pub(crate) fn spheres() -> Self {
        let folder = Self::empty();
        barymap::io::write_obj(&uv_sphere(1.0, 24, 16), folder.path("s.obj")).unwrap();
        barymap::io::write_obj(&stretched(30, 18), folder.path("t.obj")).unwrap();
        barymap::io::write_image(&waves(128), folder.path("s.png")).unwrap();
        folder.anchors("a.json", 40, |p| p);
        folder
    }

    /// `count` anchor pairs spread over the spheres; `turn` moves the source's.
    pub(crate) fn anchors(&self, name: &str, count: usize, turn: impl Fn(DVec3) -> DVec3) {
        let directions: Vec<DVec3> = directions(count).collect();
        let entry = |p: DVec3| json!({"position": [p.x, p.y, p.z]});
        let source: Vec<Value> = directions.iter().map(|&d| entry(turn(d))).collect();
        let target: Vec<Value> = directions.iter().map(|&d| entry(d * STRETCH)).collect();
        self.write(name, &json!({"source": source, "target": target}).to_string());
    }

    /// Pairs as of [`Folder::anchors`] whose sources are half of them farther on: no map fits.
    pub(crate) fn wrong_anchors(&self, name: &str, count: usize) {
        let mut sources: Vec<DVec3> = directions(count).collect();
        sources.rotate_left(count / 2);
        let next = std::cell::RefCell::new(sources.into_iter());
        self.anchors(name, count, |_| next.borrow_mut().next().unwrap());
    }

    /// A path in the folder.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes a text file.
    pub(crate) fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).unwrap();
    }

    /// Reads a text file.
    pub(crate) fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }

    /// Reads bytes.
    pub(crate) fn bytes(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()
    }

    /// Reads a report.
    pub(crate) fn json(&self, name: &str) -> Value {
        serde_json::from_str(&self.read(name)).unwrap()
    }

    /// The files in a folder within it.
    pub(crate) fn files(&self, folder: &str) -> Vec<PathBuf> {
        fs::read_dir(self.path(folder)).unwrap().map(|e| e.unwrap().path()).collect()
    }

    /// Reads a picture.
    pub(crate) fn image(&self, name: &str) -> Image {
        barymap::io::read_image(self.path(name)).unwrap()
    }

    /// The names of everything in it.
    pub(crate) fn names(&self) -> BTreeSet<String> {
        fs::read_dir(self.0.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
    }

    /// Runs `barymap` here with the words of `command`.
    #[track_caller]
    pub(crate) fn run(&self, command: &str) -> Ran {
        self.run_with(command, &[])
    }

    /// Runs `barymap` here with the words of `command` and environment variables.
    #[track_caller]
    pub(crate) fn run_with(&self, command: &str, environment: &[(&str, &str)]) -> Ran {
        let words: Vec<&str> = command.split_whitespace().collect();
        let mut command = self.command();
        command.args(words).envs(environment.iter().copied());
        self.finish(&mut command)
    }

    /// The program in this folder, with the cache that all tests share.
    pub(crate) fn command(&self) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_barymap"));
        prepared(&mut command, self.0.path());
        command
    }

    /// Runs commands here as a shell does, up to the first that fails; `barymap` is the built
    /// program.
    #[track_caller]
    pub(crate) fn shell(&self, commands: &str) -> Ran {
        let program = Path::new(env!("CARGO_BIN_EXE_barymap")).parent().unwrap();
        let others = std::env::var_os("PATH").unwrap_or_default();
        let folders = std::iter::once(program.to_owned()).chain(std::env::split_paths(&others));
        let mut command = Command::new("sh");
        command.args(["-e", "-c", commands]).env("PATH", std::env::join_paths(folders).unwrap());
        prepared(&mut command, self.0.path());
        self.finish(&mut command)
    }

    /// Runs a command to its end; one that takes longer than two minutes hangs. The glTF files that
    /// a command writes have no faults that its inputs had not.
    #[track_caller]
    pub(crate) fn finish(&self, command: &mut Command) -> Ran {
        let mut before = BTreeMap::new();
        gltf_files(self.0.path(), &mut before);
        let outputs = tempfile::tempdir().unwrap();
        let file = |name: &str| File::create(outputs.path().join(name)).unwrap();
        let mut child = command.stdout(file("stdout")).stderr(file("stderr")).spawn().unwrap();
        let started = Instant::now();
        let mut peak_memory = None;
        let status = loop {
            peak_memory = peak_memory.max(peak_of(child.id()));
            if let Some(status) = child.try_wait().unwrap() {
                break status;
            }
            if started.elapsed() > Duration::from_secs(120) {
                child.kill().unwrap();
                panic!("{command:?} hangs");
            }
            std::thread::sleep(Duration::from_millis(5));
        };
        let text = |name: &str| String::from_utf8_lossy(&fs::read(outputs.path().join(name)).unwrap()).into_owned();
        if status.success() {
            let mut after = BTreeMap::new();
            gltf_files(self.0.path(), &mut after);
            after.retain(|path, written| before.get(path) != Some(written));
            let inputs: Vec<PathBuf> = before.into_keys().filter(|path| !after.contains_key(path)).collect();
            gltf_validator::check(&after.into_keys().collect::<Vec<_>>(), &inputs);
        }
        Ran { code: status.code(), stdout: text("stdout"), stderr: text("stderr"), peak_memory }
    }
}

/// The GLB and glTF files in a folder and those below it, with the time and size of each.
fn gltf_files(folder: &Path, found: &mut BTreeMap<PathBuf, (SystemTime, u64)>) {
    for entry in fs::read_dir(folder).unwrap().flatten() {
        let (path, about) = (entry.path(), entry.metadata().unwrap());
        if about.is_dir() {
            gltf_files(&path, found);
        } else if path.extension().is_some_and(|e| e == "glb" || e == "gltf") {
            found.insert(path, (about.modified().unwrap(), about.len()));
        }
    }
}

/// Largest memory that a running process has used so far, in bytes; Linux tells.
fn peak_of(process: u32) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok().map(|k| k << 10)
}

/// The target.
pub(crate) fn stretched(slices: usize, stacks: usize) -> Mesh {
    let mut mesh = uv_sphere(1.0, slices, stacks);
    for p in &mut mesh.positions {
        *p *= STRETCH;
    }
    mesh
}

/// Directions spread evenly on a spiral.
fn directions(count: usize) -> impl Iterator<Item = DVec3> {
    (0..count).map(move |i| {
        let y = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
        let angle = TAU * i as f64 * 0.618_033_988_749_895;
        let r = (1.0 - y * y).sqrt();
        DVec3::new(r * angle.cos(), y, r * angle.sin())
    })
}

/// A smooth texture without a jump where u wraps.
pub(crate) fn waves(size: u32) -> Image {
    let at = |i: u32| TAU * (f64::from(i) + 0.5) / f64::from(size);
    let level = |x: f64| (127.5 + 100.0 * x) as u8;
    let samples = (0..size * size)
        .flat_map(|i| {
            let (u, v) = (at(i % size), at(i / size));
            [level(u.sin()), level(u.cos()), level((v / 2.0).cos())]
        })
        .collect();
    Image::new(size, size, 3, Pixels::U8(samples)).unwrap()
}

/// Mean absolute difference, 0..1, of two pictures of the same size over the texels that `coverage`
/// calls valid.
pub(crate) fn difference(a: &Image, b: &Image, coverage: &Image) -> f64 {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let (mut sum, mut count) = (0.0, 0u32);
    for y in 0..a.height {
        for x in (0..a.width).filter(|&x| (coverage.get(x, y, 0) * 255.0).round() == 255.0) {
            for c in 0..3 {
                sum += f64::from((a.get(x, y, c) - b.get(x, y, c)).abs());
                count += 1;
            }
        }
    }
    assert!(count > 0, "nothing is covered");
    sum / f64::from(count)
}
