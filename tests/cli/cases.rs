//! The cases in the folder `cases` beside `BARYMAP_DATA`: small inputs after public reports, each
//! with its command and what is expected.
//!
//! Every folder there is a test. Its command is run as its README prints it, in a copy of the
//! folder, and what comes out is judged: by `expected.png`, or by the judge of that name in
//! [`JUDGES`], which asserts the values that the README expects. A folder without either fails.

mod judges;
mod named;

use std::any::Any;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use barymap::picture::{Image, Pixels};

use crate::support::{Folder, Ran};
use judges::JUDGES;

/// Mean difference that filtering may make.
const FILTERING: f32 = 6.0 / 255.0;
/// Texels along the edges of a picture that are not compared.
const BORDER: u32 = 2;
/// Cases whose part is not built yet.
const PENDING: [&str; 0] = [];

/// A case that has been run.
struct Case {
    /// Its folder among the others.
    given: PathBuf,
    /// Its copy, with what the command wrote.
    folder: Folder,
    ran: Ran,
}

/// The commands of a README: the first block of shell, else the first indented line that begins
/// with `barymap`.
fn command(readme: &str) -> Option<String> {
    if let Some((_, block)) = readme.split_once("```sh\n") {
        return block.split_once("```").map(|(commands, _)| commands.to_owned());
    }
    readme.lines().find(|l| l.starts_with("    barymap ")).map(|l| l.trim().to_owned())
}

/// Copies the folder of a case and runs its command there.
fn run(given: &Path) -> Case {
    let readme = fs::read_to_string(given.join("README.md")).unwrap();
    let command = command(&readme).unwrap_or_else(|| panic!("the README has no command"));
    let folder = Folder::empty();
    for entry in fs::read_dir(given).unwrap() {
        let entry = entry.unwrap();
        fs::copy(entry.path(), folder.path(entry.file_name().to_str().unwrap())).unwrap();
    }
    let ran = folder.shell(&command);
    Case { given: given.to_owned(), folder, ran }
}

fn judge(given: &Path) {
    let name = given.file_name().unwrap().to_str().unwrap();
    let special = JUDGES.iter().find(|j| j.0 == name).map(|j| j.1);
    assert!(special.is_some() || given.join("expected.png").exists(), "the case has no judge");
    let case = run(given);
    if given.join("expected.png").exists() {
        assert_eq!(case.ran.code, Some(0), "{}", case.ran.stderr);
        if let Some(what) = unlike(&case.folder.image("out.png"), &case.folder.image("expected.png")) {
            panic!("{what}\n{}", case.ran.stderr);
        }
    }
    if let Some(special) = special {
        special(&case);
    }
}

/// In what way a picture is not the expected one, but for filtering.
fn unlike(picture: &Image, expected: &Image) -> Option<String> {
    if (picture.width, picture.height) != (expected.width, expected.height) {
        return Some(format!(
            "{} x {} instead of {} x {}",
            picture.width, picture.height, expected.width, expected.height
        ));
    }
    // Grey is what it is in colour, and what has no alpha is opaque.
    let texel = |image: &Image, x: u32, y: u32| {
        let colors = if image.channels < 3 { [0, 0, 0] } else { [0, 1, 2] };
        let alpha = if image.channels.is_multiple_of(2) { image.get(x, y, image.channels - 1) } else { 1.0 };
        (colors.map(|c| image.get(x, y, c)), alpha)
    };
    let (mut sum, mut count) = (0.0, 0.0);
    for y in BORDER..picture.height.saturating_sub(BORDER) {
        for x in BORDER..picture.width.saturating_sub(BORDER) {
            let ((a, here), (b, there)) = (texel(picture, x, y), texel(expected, x, y));
            if (here - there).abs() > 0.5 {
                return Some(format!("texel {x}, {y} has the alpha {here} instead of {there}"));
            }
            sum += a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f32>();
            count += 3.0;
        }
    }
    (sum / count >= FILTERING).then(|| format!("the mean difference is {:.1} of 255", 255.0 * sum / count))
}

fn message(panic: &(dyn Any + Send)) -> String {
    let text =
        panic.downcast_ref::<String>().cloned().or_else(|| panic.downcast_ref::<&str>().map(|s| (*s).to_owned()));
    text.unwrap_or_else(|| "a panic without words".to_owned())
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn every_case_comes_out_as_expected() {
    let data = PathBuf::from(std::env::var_os("BARYMAP_DATA").expect("BARYMAP_DATA"));
    let mut cases: Vec<PathBuf> =
        fs::read_dir(data.join("../cases")).unwrap().map(|e| e.unwrap().path()).filter(|p| p.is_dir()).collect();
    cases.sort();
    assert!(cases.len() > 30, "{} cases", cases.len());
    let wanted = std::env::var("BARYMAP_CASE").ok();
    let mut wrong = Vec::new();
    for given in &cases {
        let name = given.file_name().unwrap().to_str().unwrap();
        if wanted.as_ref().is_some_and(|w| w != name) {
            continue;
        }
        // All of them are heard.
        let verdict = catch_unwind(AssertUnwindSafe(|| judge(given)));
        if let Err(panic) = verdict {
            let what = format!("{name}: {}", message(panic.as_ref()));
            println!("{what}");
            if !PENDING.contains(&name) {
                wrong.push(what);
            }
        }
    }
    assert!(wrong.is_empty(), "{} cases:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn a_case_without_a_judge_fails() {
    let folder = Folder::empty();
    folder.write("README.md", "    barymap --version\n");
    let verdict = catch_unwind(AssertUnwindSafe(|| judge(&folder.path("")))).unwrap_err();
    assert!(message(verdict.as_ref()).contains("no judge"));
    assert_eq!(command("# a\n\n```sh\nbarymap x 'a b'\nbarymap y\n```\n").unwrap(), "barymap x 'a b'\nbarymap y\n");
    assert_eq!(command("text\n\n    ls\n    barymap z -o a # b\n").unwrap(), "barymap z -o a # b");
    assert_eq!(command("barymap"), None);
}

#[test]
fn commands_run_as_a_shell_runs_them() {
    let folder = Folder::empty();
    folder.write("a b.txt", "");
    let ran = folder.shell("barymap --version && ls 'a b.txt'");
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    assert!(ran.stdout.starts_with("barymap ") && ran.stdout.ends_with("a b.txt\n"), "{}", ran.stdout);
    assert_ne!(folder.shell("barymap no-such-command").code, Some(0));
    assert_ne!(folder.shell("barymap no-such-command\nbarymap --version").code, Some(0));
}

#[test]
fn a_wrong_picture_is_told_from_a_filtered_one() {
    let picture = |channels: u32, value: &dyn Fn(u32, u32, u32) -> u8| {
        let samples =
            (0..16 * 16 * channels).map(|i| value(i / channels % 16, i / channels / 16, i % channels)).collect();
        Image::new(16, 16, channels as _, Pixels::U8(samples)).unwrap()
    };
    let ramp = |x: u32, y: u32, c: u32| (10 * x + 2 * y + 20 * c) as u8;
    let expected = picture(3, &ramp);
    assert_eq!(unlike(&expected, &expected), None);
    // Within what filtering does; beyond it; edges do not count.
    assert_eq!(unlike(&picture(3, &|x, y, c| ramp(x, y, c) + 5), &expected), None);
    assert!(unlike(&picture(3, &|x, y, c| ramp(x, y, c) + 7), &expected).unwrap().contains("7.0 of 255"));
    let edge = |x: u32, y: u32, c: u32| if x.min(y) < 2 || x.max(y) > 13 { 255 - ramp(x, y, c) } else { ramp(x, y, c) };
    assert_eq!(unlike(&picture(3, &edge), &expected), None);
    // Mirrored, turned, of another size, with a hole.
    assert!(unlike(&picture(3, &|x, y, c| ramp(15 - x, y, c)), &expected).is_some());
    assert!(unlike(&picture(3, &|x, y, c| ramp(y, x, c)), &expected).is_some());
    assert!(unlike(&Image::new(8, 32, 3, Pixels::U8(vec![0; 768])).unwrap(), &expected).unwrap().contains("8 x 32"));
    let hole = |x: u32, y: u32, c: u32| if c < 3 { ramp(x, y, c) } else { 255 * u8::from((x, y) != (5, 9)) };
    assert!(unlike(&picture(4, &hole), &expected).unwrap().contains("texel 5, 9"));
    // Grey is the same in one channel and in three.
    let grey = |x: u32, y: u32, _: u32| ramp(x, y, 0);
    assert_eq!(unlike(&picture(1, &grey), &picture(3, &grey)), None);
}
