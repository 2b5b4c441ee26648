//! Every kernel is parsed, validated for the smallest device and held against its host half. Needs
//! no adapter: kernels compile at their first use, so without this a user would find the fault.

use std::collections::BTreeSet;
use std::path::Path;

use barymap::conformance::kernels;
use barymap::engine::reflect;

#[test]
fn every_kernel_is_sound() {
    let kernels = kernels();
    assert!(!kernels.is_empty(), "found no kernels");
    let mut found = Vec::new();
    for kernel in &kernels {
        found.extend(reflect::faults(kernel).into_iter().map(|f| format!("{}: {f}", kernel.name)));
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
    println!("checked {} kernels", kernels.len());
}

#[test]
fn every_file_has_its_kernel_and_every_kernel_one_name() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders");
    let files: BTreeSet<String> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(|p| p.extension().is_some_and(|e| e == "wgsl"))
        .map(|p| p.file_stem().unwrap().to_string_lossy().into_owned())
        .collect();
    let names: BTreeSet<String> = kernels().iter().map(|k| k.name.to_string()).collect();
    // The variants of a kernel share its file and differ in their constants.
    let variants: BTreeSet<String> =
        kernels().iter().map(|k| format!("{} {:?} {}", k.name, k.constants, k.source.len())).collect();
    assert_eq!(variants.len(), kernels().len(), "two kernels share a name");
    assert_eq!(files, names, "files in shaders/ (left) and kernels of the tables (right)");
}

#[test]
fn library_files_hold_no_bindings() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders/lib");
    let mut count = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(!text.contains("@binding") && !text.contains("var<workgroup>"), "{}", path.display());
        count += 1;
    }
    assert!(count > 0, "found no library files");
}
