//! The files that a command line names: none is written twice, and none that is read is overwritten
//! unless that is asked for.

use std::any::TypeId;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Command};

use crate::{Error, Result};

/// What a command does with a file that an argument names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    Read,
    Written,
}

/// Arguments that name files to write, in any command.
const WRITTEN: [&str; 13] = [
    "output",
    "out",
    "report",
    "coverage",
    "stmap",
    "model",
    "heatmap",
    "grid",
    "overlay",
    "layout",
    "unwrapped",
    "sheet",
    "compatible",
];
/// Arguments that name files to read and hold more than a path.
const READ: [&str; 4] = ["anchors", "texture", "pairs", "picture"];

/// What argument `id` of `command` is, if it names files.
pub(crate) fn role(command: &str, argument: &Arg) -> Option<Role> {
    let id = argument.get_id().as_str();
    let is_path = argument.get_value_parser().type_id() == TypeId::of::<PathBuf>();
    match id {
        "picture" if command == "anchors" => Some(Role::Written),
        // Names within the folder of each target.
        _ if command == "batch" && WRITTEN.contains(&id) && !["output", "report"].contains(&id) => None,
        _ if WRITTEN.contains(&id) => Some(Role::Written),
        _ if is_path || READ.contains(&id) => Some(Role::Read),
        _ => None,
    }
}

/// The files that a value names: all of it, or what stands between commas and behind `=`, as in
/// `ROLE=FILE` and `S.vts,T.vts`.
fn files(value: &OsStr) -> Vec<PathBuf> {
    let whole = PathBuf::from(value);
    if whole.exists() {
        return vec![whole];
    }
    let text = value.to_string_lossy();
    let parts = text.split(',').map(|part| part.rsplit_once('=').map_or(part, |(_, file)| file));
    parts.map(PathBuf::from).filter(|p| p.exists()).collect()
}

/// A path by which two names of one file are known as such.
fn identity(path: &Path) -> PathBuf {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let there = path.canonicalize().or_else(|_| Ok(folder.canonicalize()?.join(path.file_name().unwrap_or_default())));
    there.or_else(|_: std::io::Error| std::path::absolute(path)).unwrap_or_else(|_| path.to_path_buf())
}

/// As the user spells the argument.
fn spelt(argument: &Arg) -> String {
    argument.get_long().map_or_else(|| argument.get_id().to_string(), |long| format!("--{long}"))
}

/// What a command line is to write.
#[derive(Debug, Default)]
pub(crate) struct Outputs {
    /// The files.
    pub(crate) planned: Vec<PathBuf>,
    /// The folders that were made for them, the innermost first.
    pub(crate) made: Vec<PathBuf>,
}

/// Fails for a file that would be written twice, and for one that is read and written unless
/// `--overwrite` is given. Makes the folders of outputs that are missing.
///
/// # Errors
/// [`Error::Option`] that names both arguments.
pub(crate) fn check(program: &Command, matches: &ArgMatches, overwrite: bool) -> Result<Outputs> {
    let Some((name, given)) = matches.subcommand() else { return Ok(Outputs::default()) };
    let Some(command) = program.find_subcommand(name) else { return Ok(Outputs::default()) };
    // Files, each with the argument that names it.
    let mut read: Vec<(PathBuf, String)> = Vec::new();
    let mut written: Vec<(PathBuf, String)> = Vec::new();
    for argument in command.get_arguments() {
        let Some(role) = role(name, argument) else { continue };
        let id = argument.get_id().as_str();
        if given.value_source(id) != Some(ValueSource::CommandLine) {
            continue;
        }
        for value in given.get_raw(id).into_iter().flatten() {
            let path = Path::new(value);
            match role {
                Role::Read => read.extend(files(value).iter().map(|p| (identity(p), spelt(argument)))),
                // What a shell or a device takes is taken as it comes.
                Role::Written if path.starts_with("/dev") => {}
                Role::Written => {
                    let place = identity(path);
                    if let Some((_, other)) = written.iter().find(|(p, _)| *p == place) {
                        let what = format!("{} would be written twice, for {other} too", path.display());
                        return Err(Error::option(spelt(argument), what, "Give each output a name of its own"));
                    }
                    written.push((place, spelt(argument)));
                }
            }
        }
    }
    for (place, option) in &written {
        if let Some((_, other)) = read.iter().find(|(p, _)| p == place && !overwrite) {
            let what = format!("{} is the file that {other} reads", place.display());
            return Err(Error::option(option, what, "Name another file, or give --overwrite"));
        }
    }
    let planned: Vec<PathBuf> = written.into_iter().map(|(place, _)| place).collect();
    let mut made = Vec::new();
    planned.iter().try_for_each(|place| make_folders(place, &mut made))?;
    made.reverse();
    Ok(Outputs { planned, made })
}

/// Makes the folders above `place` that are missing, the outermost first.
fn make_folders(place: &Path, made: &mut Vec<PathBuf>) -> Result<()> {
    // Places to fill in are known later.
    if place.to_string_lossy().contains(['<', '%']) {
        return Ok(());
    }
    let mut missing: Vec<&Path> = place.ancestors().skip(1).take_while(|folder| !folder.exists()).collect();
    while let Some(folder) = missing.pop().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir(folder)
            .map_err(|e| Error::io(folder, e, "Check the permissions of the folder that it is in"))?;
        made.push(folder.to_path_buf());
    }
    Ok(())
}

/// Whether the word before a value says that it is written: `-o`, `--report`.
pub(crate) fn names_output(option: &OsString) -> bool {
    let text = option.to_string_lossy();
    text == "-o" || text.strip_prefix("--").is_some_and(|long| WRITTEN.contains(&long))
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::cli::Cli;

    fn checked(line: &str) -> Result<Outputs> {
        let mut program = Cli::command();
        let matches = program.try_get_matches_from_mut(line.split_whitespace()).unwrap();
        check(&program, &matches, line.contains("--overwrite"))
    }

    #[test]
    fn every_path_of_every_command_is_read_or_written() {
        let mut program = Cli::command();
        program.build();
        let mut written = Vec::new();
        for command in program.get_subcommands() {
            for argument in command.get_arguments() {
                if role(command.get_name(), argument) == Some(Role::Written) {
                    written.push((command.get_name().to_owned(), argument.get_id().to_string()));
                }
                // Help speaks of what is written as the table does.
                let help = argument.get_help().map(ToString::to_string).unwrap_or_default();
                if argument.get_value_parser().type_id() == TypeId::of::<PathBuf>()
                    && help.starts_with("Write ")
                    && command.get_name() != "batch"
                {
                    assert_eq!(role(command.get_name(), argument), Some(Role::Written), "{command} {argument}");
                }
            }
        }
        for name in WRITTEN {
            assert!(written.iter().any(|(_, id)| id == name), "no command has {name}");
        }
        assert!(written.contains(&("anchors".into(), "picture".into())));
        assert!(!written.contains(&("batch".into(), "picture".into())));
    }

    #[test]
    fn nothing_is_written_twice_or_over_what_is_read() {
        let dir = tempfile::tempdir().unwrap();
        let place = dir.path().display().to_string();
        for name in ["a.obj", "h.json", "t.png"] {
            std::fs::write(dir.path().join(name), "").unwrap();
        }
        let says = |line: &str, words: &[&str]| {
            let message = checked(&line.replace('@', &place)).unwrap_err().to_string();
            assert!(words.iter().all(|w| message.contains(w)), "{line}: {message}");
        };
        let deform = "barymap deform @/a.obj --handles @/h.json -o";
        says(&format!("{deform} @/b.obj --report @/./b.obj"), &["written twice", "--report", "--output"]);
        says(&format!("{deform} @/../{}/a.obj", dir.path().file_name().unwrap().display()), &["mesh", "--overwrite"]);
        says(&format!("{deform} @/b.obj --report @/h.json"), &["--handles", "--overwrite"]);
        says("barymap warp @/t.png --cage @/h.json -o @/w.png --heatmap @/w.png", &["written twice"]);
        says(
            "barymap transfer --source @/a.obj --target @/a.obj --anchors @/h.json --texture base_color=@/t.png -o @/t.png",
            &["--texture", "--overwrite"],
        );
        for fine in [
            format!("{deform} @/a.obj --overwrite"),
            format!("{deform} @/b.obj --report @/b.json"),
            format!("{deform} /dev/null --report /dev/null"),
            format!("{deform} @/new/b.obj"),
        ] {
            checked(&fine.replace('@', &place)).unwrap();
        }
        assert!(dir.path().join("new").is_dir());
    }
}
