//! The glTF validator of Khronos over the files that tests write.
//!
//! It is an npm package. `tests/run.sh` installs it into the folder `gltf-validator` beside the
//! build where node and npm are; elsewhere tests say that they skip it, or fail with
//! `BARYMAP_REQUIRE_GLTF_VALIDATOR` set.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Fails on errors and warnings about GLB and glTF files of kinds that the `inputs` have not.
#[track_caller]
pub(crate) fn check(files: &[PathBuf], inputs: &[PathBuf]) {
    if let Some(faults) = faults(files, inputs) {
        panic!("the glTF validator finds faults:\n{faults}");
    }
}

/// Errors and warnings about GLB and glTF files that are not those of the inputs; nothing where all
/// are valid, or where there is no validator.
fn faults(files: &[PathBuf], inputs: &[PathBuf]) -> Option<String> {
    if files.is_empty() {
        return None;
    }
    let Some(folder) = installed() else {
        assert!(
            std::env::var_os("BARYMAP_REQUIRE_GLTF_VALIDATOR").is_none(),
            "BARYMAP_REQUIRE_GLTF_VALIDATOR is set and there is no glTF validator: bash tests/run.sh installs it"
        );
        println!("SKIPPED: no glTF validator (bash tests/run.sh installs it where node and npm are)");
        return None;
    };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/gltf_validator/validate.cjs");
    let run = Command::new("node").arg(script).arg(folder).args(files).arg("--").args(inputs).output().expect("node");
    let said = [run.stdout, run.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
    (!run.status.success()).then_some(said)
}

/// The folder in which the package is installed: beside the build, of which this program is a part.
fn installed() -> Option<PathBuf> {
    let program = std::env::current_exe().ok()?;
    let mut folders = program.ancestors().map(|above| above.join("gltf-validator"));
    folders.find(|folder| folder.join("node_modules/gltf-validator").is_dir())
}

/// The validator sees what is wrong.
#[test]
fn a_damaged_file_has_faults() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.gltf");
    std::fs::write(&path, r#"{"asset": {"version": "2.0"}, "scene": 3}"#).unwrap();
    let said = faults(std::slice::from_ref(&path), &[]);
    assert!(installed().is_none() || said.is_some_and(|s| s.contains("UNRESOLVED_REFERENCE")));
    // An input with the same fault excuses it, one without does not.
    let good = folder.path().join("good.gltf");
    std::fs::write(&good, r#"{"asset": {"version": "2.0"}}"#).unwrap();
    let files = [path, good];
    assert_eq!(faults(&files[..1], &files[..1]), None);
    assert!(installed().is_none() || faults(&files[..1], &files[1..]).is_some());
    assert_eq!(faults(&files[1..], &[]), None);
}
