//! The files that a command line names: none is written twice, and none that is read is overwritten
//! unless that is asked for.

use std::any::TypeId;
use std::ffi::{OsStr, OsString};
use std::path::{Component, Path, PathBuf};

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

/// Endings of meshes and pictures, which tables and reports do not have.
const SHAPES_AND_PICTURES: [&str; 19] = [
    "obj", "ply", "glb", "gltf", "off", "stl", "png", "jpg", "jpeg", "webp", "gif", "apng", "bmp", "tga", "tif",
    "tiff", "exr", "hdr", "svg",
];

/// What an argument of `command` writes whatever its file is called: the name, and an ending that
/// it may have though others of its kind may not.
fn one_format(command: &str, id: &str) -> Option<(&'static str, &'static str)> {
    match (command, id) {
        (_, "report") => Some(("JSON", "json")),
        ("anchors", "output") => Some(("JSON", "json")),
        ("map" | "average", "output") => Some(("a table (CSV)", "csv")),
        ("embed" | "weights", "output") => Some(("NPY", "npy")),
        ("check", "output") => Some(("PLY", "ply")),
        _ => None,
    }
}

/// Fails where a name says another format than the one that is written.
fn check_format(command: &str, id: &str, option: &str, path: &Path) -> Result<()> {
    let Some((format, own)) = one_format(command, id) else { return Ok(()) };
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    if ending == own || !SHAPES_AND_PICTURES.contains(&ending.as_str()) {
        return Ok(());
    }
    let what = format!("{} is written as {format}, and its name says something else", path.display());
    Err(Error::option(option, what, format!("End the name in .{own}")))
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

/// A path by which two names of one file are known as such, whether the file and its folders are
/// there or not.
fn identity(path: &Path) -> PathBuf {
    let place = crate::io::output::followed(path);
    if let Ok(there) = place.canonicalize() {
        return there;
    }
    // What is there of it, then the rest by its words: `new/../new` is `new`.
    let mut found = PathBuf::new();
    for part in std::path::absolute(&place).unwrap_or(place).components() {
        match part {
            Component::ParentDir => drop(found.pop()),
            part => found.push(part),
        }
        found = found.canonicalize().unwrap_or(found);
    }
    found
}

/// As the user spells the argument.
fn spelt(argument: &Arg) -> String {
    argument.get_long().map_or_else(|| argument.get_id().to_string(), |long| format!("--{long}"))
}

/// What a command line is to write.
#[derive(Debug, Default)]
pub(crate) struct Outputs {
    /// The files, each with the option that names it.
    pub(crate) planned: Vec<(PathBuf, String)>,
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
                    check_format(name, id, &spelt(argument), path)?;
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
    let mut made = Vec::new();
    written.iter().try_for_each(|(place, _)| make_folders(place, &mut made))?;
    made.reverse();
    Ok(Outputs { planned: written, made })
}

/// Makes the folders above `place` that are missing, the outermost first.
fn make_folders(place: &Path, made: &mut Vec<PathBuf>) -> Result<()> {
    let mut missing: Vec<&Path> = place.ancestors().skip(1).take_while(|folder| !folder.exists()).collect();
    while let Some(folder) = missing.pop().filter(|folder| !folder.as_os_str().is_empty()) {
        // Places to fill in are known later.
        if crate::io::TextureName::new(folder.to_string_lossy()).has_place() {
            return Ok(());
        }
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
        says(&format!("{deform} @/b --report @/./b"), &["written twice", "--report", "--output"]);
        says(&format!("{deform} @/b.glb --report @/r.png"), &["--report", "JSON"]);
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
