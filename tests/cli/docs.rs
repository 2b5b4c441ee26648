//! The commands of the documentation run as they stand.
//!
//! Each page is a session of its own: its blocks of `sh` run in the order of the page, in an empty
//! folder after `barymap demo`. A block that needs more says so (`sh no-run: needs ...`); the
//! README has none.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::support::Folder;

/// The blocks of a page: what stands behind the fence, and the text.
fn blocks(page: &str) -> Vec<(String, String)> {
    let mut found = Vec::new();
    let mut open: Option<(String, String)> = None;
    for line in page.lines() {
        match (line.strip_prefix("```"), open.take()) {
            (Some(info), None) => open = Some((info.trim().to_owned(), String::new())),
            (Some(_), Some(block)) => found.push(block),
            (None, Some((info, text))) => open = Some((info, text + line + "\n")),
            (None, None) => {}
        }
    }
    found
}

/// The blocks that run, and the reasons of those that do not.
fn runnable(page: &str) -> (Vec<String>, Vec<String>) {
    let (mut run, mut reasons) = (Vec::new(), Vec::new());
    for (info, text) in blocks(page) {
        match info.strip_prefix("sh") {
            Some("") => run.push(text),
            Some(rest) => {
                let reason = rest.strip_prefix(" no-run: needs ");
                reasons.push(reason.unwrap_or_else(|| panic!("a block that says neither: ```{info}")).to_owned());
            }
            // Other languages, and outlines of a command with its options in brackets.
            None => assert!(
                !info.is_empty() || text.contains('[') || !text.lines().any(|l| l.starts_with("barymap ")),
                "commands in a block that is not checked: ```{info}\n{text}"
            ),
        }
    }
    (run, reasons)
}

#[test]
fn blocks_are_found_with_their_marks() {
    let page = "a\n```sh\nbarymap x\n```\nb\n```json\n{}\n```\n```sh no-run: needs a file\nbarymap y\n```\n";
    assert_eq!(runnable(page), (vec!["barymap x\n".into()], vec!["a file".into()]));
    assert!(std::panic::catch_unwind(|| runnable("```sh later\nbarymap z\n```\n")).is_err());
    assert!(std::panic::catch_unwind(|| runnable("```\nbarymap z\n```\n")).is_err());
}

/// Runs blocks in a folder, each in a shell that ends at the first fault.
fn run(blocks: &[String], folder: &Path, program: &Path, page: &str) -> Result<(), String> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let paths = std::env::split_paths(&path);
    let beside = program.parent().unwrap_or(Path::new("")).to_path_buf();
    let path = std::env::join_paths(std::iter::once(beside).chain(paths)).unwrap();
    for block in blocks {
        let mut shell = Command::new("bash");
        shell.args(["-euo", "pipefail", "-c", block]).current_dir(folder).env("PATH", &path);
        // Embeddings of the built-in characters are made once for all pages.
        shell.env("BARYMAP_CACHE", folder.parent().unwrap().join("cache"));
        let output = shell.output().map_err(|e| e.to_string())?;
        if !output.status.success() {
            return Err(format!("{page}:\n{block}\n{}", String::from_utf8_lossy(&output.stderr)));
        }
    }
    Ok(())
}

#[test]
#[cfg(unix)]
fn every_block_runs_in_an_empty_folder_after_the_demo() {
    let f = Folder::empty();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = PathBuf::from(env!("CARGO_BIN_EXE_barymap"));
    let demo = f.path("after");
    std::fs::create_dir(&demo).unwrap();
    run(&["barymap demo --size 512".into()], &demo, &program, "demo").unwrap();

    let mut pages: Vec<PathBuf> = std::fs::read_dir(root.join("docs")).unwrap().map(|e| e.unwrap().path()).collect();
    pages.retain(|p| p.extension().is_some_and(|e| e == "md"));
    pages.push(root.join("README.md"));
    pages.sort();
    let (mut ran, mut passed_over, mut faults) = (0, 0, Vec::new());
    for page in &pages {
        let name = page.file_name().unwrap().to_string_lossy().into_owned();
        let (blocks, reasons) = runnable(&std::fs::read_to_string(page).unwrap());
        assert!(name != "README.md" || (reasons.is_empty() && blocks.len() >= 4), "{reasons:?}");
        reasons.iter().for_each(|reason| println!("{name}: not run, needs {reason}"));
        passed_over += reasons.len();
        if blocks.is_empty() {
            continue;
        }
        let folder = f.path(&name.replace(".md", ""));
        let copied = Command::new("cp").arg("-r").args([&demo, &folder]).status().unwrap();
        assert!(copied.success());
        ran += blocks.len();
        faults.extend(run(&blocks, &folder, &program, &name).err());
    }
    println!("{ran} blocks ran, {passed_over} need more");
    assert!(faults.is_empty(), "{}", faults.join("\n\n"));
    // A block that fails is seen.
    assert!(run(&["barymap render nothing.obj -o x.png".into()], &demo, &program, "wrong").is_err());
}
