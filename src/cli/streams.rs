//! `-` and what shells make of pipes: what comes in is copied to a file before the command begins,
//! since files are read more than once; what is to go out is written to a file first.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use crate::cli::named::names_output;
use crate::io::output_set::OutputFolder;
use crate::{Error, Result};

/// Most bytes of a stream.
const MOST: u64 = 4 << 30;

/// Whether stdout holds a result; lines for people go to stderr then.
static STDOUT_TAKEN: AtomicBool = AtomicBool::new(false);

/// The files that stand for streams, and what was given in their place.
static GIVEN: Mutex<Vec<(String, String)>> = Mutex::new(Vec::new());

/// A text in which streams have the names that they were given.
pub(crate) fn as_given(text: &str) -> String {
    let given = GIVEN.lock().unwrap_or_else(PoisonError::into_inner);
    given.iter().fold(text.to_owned(), |text, (file, given)| text.replace(file, given))
}

fn stands_for(file: &Path, given: &str) -> String {
    let file = file.display().to_string();
    GIVEN.lock().unwrap_or_else(PoisonError::into_inner).push((file.clone(), given.to_owned()));
    file
}

/// The ending of what a command writes to plain `-`, where its format goes by one.
fn ending(command: &str) -> &'static str {
    match command {
        "decal" | "render" | "transfer" | "warp" => ".png",
        "animate" | "cage" | "deform" | "morph" | "unwrap" => ".glb",
        _ => "",
    }
}

/// Whether a value is `-`, or `-` with an ending.
fn is_dash(value: &str) -> bool {
    let plain =
        |e: &str| e.starts_with(|c: char| c.is_ascii_alphabetic()) && e.chars().all(|c| c.is_ascii_alphanumeric());
    value == "-" || value.strip_prefix("-.").is_some_and(plain)
}

/// Whether a result goes to stdout.
pub(crate) fn stdout_taken() -> bool {
    STDOUT_TAKEN.load(Ordering::Relaxed)
}

/// The files that stand for streams; they go away with it.
#[derive(Debug, Default)]
pub(crate) struct Streams {
    folder: Option<OutputFolder>,
    copied: Vec<PathBuf>,
    /// What goes to stdout at the end.
    output: Option<PathBuf>,
}

impl Streams {
    /// Puts files in the place of streams: `-` as an input and as an output, either of which may
    /// have an ending (`-.png`), and `/dev/stdin`, `/dev/fd/N` among inputs.
    ///
    /// # Errors
    /// [`Error::Io`] for a stream that cannot be read or copied; [`Error::Option`] for two outputs
    /// on stdout.
    pub(crate) fn redirect(arguments: Vec<OsString>) -> Result<(Vec<OsString>, Self)> {
        STDOUT_TAKEN.store(false, Ordering::Relaxed);
        GIVEN.lock().unwrap_or_else(PoisonError::into_inner).clear();
        let mut streams = Self::default();
        let command = arguments.iter().skip(1).map(|a| a.to_string_lossy()).find(|a| !ending(a).is_empty());
        let natural = ending(command.as_deref().unwrap_or_default());
        let mut redirected: Vec<OsString> = Vec::with_capacity(arguments.len());
        for (k, argument) in arguments.iter().enumerate() {
            let text = argument.to_string_lossy();
            let split = text.split_once('=').filter(|(option, _)| option.starts_with("--"));
            let (option, value) = match split {
                Some((option, value)) => (Some(OsString::from(option)), value.to_owned()),
                None => (k.checked_sub(1).map(|before| arguments[before].clone()), text.to_string()),
            };
            let written = option.as_ref().is_some_and(names_output);
            let replaced = if k == 0 {
                None
            } else if written {
                streams.output(option.as_deref().unwrap_or_default(), &value, natural)?
            } else {
                streams.input(&value)?
            };
            redirected.push(match (replaced, split) {
                (Some(file), Some((option, _))) => format!("{option}={file}").into(),
                (Some(file), None) => file.into(),
                (None, _) => argument.clone(),
            });
        }
        let frames = redirected.iter().any(|a| a == "--frames" || a.to_string_lossy().starts_with("--frames="));
        let picture = streams.output.as_ref().and_then(|o| o.extension()).is_some_and(|e| e == "png");
        if frames && picture {
            let what = "a sequence of pictures has many files, and stdout is one";
            return Err(Error::option("--frames", what, "Write -.gif or -.apng, or name a file"));
        }
        Ok((redirected, streams))
    }

    /// What stands for an output, if that is stdout; `natural` is the ending that `-` has.
    fn output(&mut self, option: &OsStr, value: &str, natural: &str) -> Result<Option<String>> {
        if !is_dash(value) {
            return Ok(None);
        }
        let option = option.to_string_lossy();
        let is_main = option == "-o" || option == "--output";
        let ending = match (value, &*option) {
            ("-", _) if is_main => natural,
            ("-", "--model") => ".glb",
            _ => &value[1..],
        };
        if self.output.is_some() {
            let what = "two outputs would be written to stdout";
            return Err(Error::option(option, what, "Give the other a name"));
        }
        if value.eq_ignore_ascii_case("-.obj") {
            let what = "an OBJ file refers to others beside it, and stdout has no place";
            return Err(Error::option(option, what, "Write -.ply or -.glb, or name a file"));
        }
        let file = self.folder()?.join(format!("stdout{ending}"));
        STDOUT_TAKEN.store(true, Ordering::Relaxed);
        let shown = stands_for(&file, value);
        self.output = Some(file);
        Ok(Some(shown))
    }

    /// What stands for an input whose streams have been copied, if it has any.
    fn input(&mut self, value: &str) -> Result<Option<String>> {
        if is_dash(value) {
            return Ok(Some(self.copy(Path::new("/dev/stdin"), &format!("stdin{}", &value[1..]), value)?));
        }
        if !value.contains("/dev/") && !value.contains("/proc/self/fd/") {
            return Ok(None);
        }
        let mut replaced = false;
        let mut whole = String::with_capacity(value.len());
        for part in value.split_inclusive([',', '=']) {
            let path = part.trim_end_matches([',', '=']);
            if is_stream(path) {
                let name = path.trim_start_matches('/').replace('/', "-");
                whole.push_str(&self.copy(Path::new(path), &name, path)?);
                whole.push_str(&part[path.len()..]);
                replaced = true;
            } else {
                whole.push_str(part);
            }
        }
        Ok(replaced.then_some(whole))
    }

    /// Copies a stream once; returns where. Messages call it as it was `given`.
    fn copy(&mut self, stream: &Path, name: &str, given: &str) -> Result<String> {
        let is_stdin = stream == Path::new("/dev/stdin");
        let place = self.folder()?.join(name);
        if !self.copied.contains(&place) {
            let failed = |e: io::Error| Error::io(stream, e, "Check what writes to it, or name a file");
            let mut file = File::create_new(&place).map_err(failed)?;
            let count = if is_stdin {
                io::copy(&mut io::stdin().lock().take(MOST), &mut file)
            } else {
                File::open(stream).and_then(|stream| io::copy(&mut stream.take(MOST), &mut file))
            };
            if count.map_err(failed)? == MOST {
                return Err(failed(io::Error::new(io::ErrorKind::FileTooLarge, "it has more than 4 GiB")));
            }
            self.copied.push(place.clone());
            return Ok(stands_for(&place, given));
        }
        Ok(place.display().to_string())
    }

    fn folder(&mut self) -> Result<PathBuf> {
        let folder = match self.folder.take() {
            Some(folder) => folder,
            None => OutputFolder::replace(std::env::temp_dir().join("barymap-streams"))?,
        };
        let path = folder.path().to_path_buf();
        self.folder = Some(folder);
        Ok(path)
    }

    /// Writes what goes to stdout.
    ///
    /// # Errors
    /// [`Error::Io`]; a reader that has gone is none.
    pub(crate) fn finish(self) -> Result<()> {
        let Some(file) = &self.output else { return Ok(()) };
        let mut out = io::stdout().lock();
        let sent = File::open(file).and_then(|mut f| io::copy(&mut f, &mut out)).and_then(|_| out.flush());
        match sent {
            Err(e) if e.kind() != io::ErrorKind::BrokenPipe => {
                Err(Error::io("stdout", e, "Check what reads it, or name a file"))
            }
            _ => Ok(()),
        }
    }
}

/// Whether a path is that of a stream of this process, and no file stands behind it.
fn is_stream(path: &str) -> bool {
    let number = |rest: &str| !rest.is_empty() && rest.bytes().all(|b| b.is_ascii_digit());
    let named = path == "/dev/stdin"
        || path.strip_prefix("/dev/fd/").or(path.strip_prefix("/proc/self/fd/")).is_some_and(number);
    named && fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir())
}
