//! Exports: files that the command line writes as well.

use barymap_studio::model::Side;
use barymap_studio::view::Weight;
use egui::{Key, Modifiers};
use egui_kittest::kittest::Queryable;

use crate::support::{Window, built_in};

#[test]
fn an_export_is_what_the_command_line_writes() {
    let folder = tempfile::tempdir().unwrap();
    let (pair, files) = built_in(folder.path());
    let mut window = Window::new(&files);
    window.until_opened();
    let (source, target) = pair.anchors(8);
    for (s, t) in source.iter().zip(&target) {
        window.harness.state_mut().set_point(Side::Source, *s);
        window.harness.state_mut().set_point(Side::Target, *t);
    }
    window.harness.state_mut().set_size(256);
    window.until("a result", |s| s.transfer().result().is_some());
    window.harness.get_by_label("The texture as PNG, too").click();
    window.harness.run_steps(2);
    window.harness.get_by_role_and_label(egui::Role::Button, "Export").click();
    let model = folder.path().join("target_textured.glb");
    let done = |s: &barymap_studio::view::Studio, count: usize| {
        let failed: Vec<_> = s.messages().list().filter(|m| m.0 == Weight::Failed).collect();
        assert!(failed.is_empty(), "{failed:?}");
        s.messages().list().filter(|m| m.1.starts_with("written: ")).count() == count
    };
    window.until("the export", |s| done(s, 1));
    let (skin, pairs) = (folder.path().join("target_textured.png"), folder.path().join("target_textured_pairs.json"));
    let read = barymap::io::anchors::read_pairs(&pairs.to_string_lossy()).unwrap();
    assert_eq!(read.source.anchors.len(), 8);
    let first = [&model, &skin, &pairs].map(|p| std::fs::read(p).unwrap());
    // The same by the words that the window shows.
    let other = folder.path().join("other.glb");
    let words = window.studio().transfer_command(&other, &pairs).unwrap();
    let program = env!("CARGO_BIN_EXE_barymap-studio");
    let status = std::process::Command::new(program).arg("--as-command-line").args(&words).status().unwrap();
    assert!(status.success());
    assert_eq!(std::fs::read(&other).unwrap(), first[0]);
    // Files that are there are asked about, and stay when the answer is no.
    std::fs::write(&model, "mine").unwrap();
    window.key(Modifiers::COMMAND, Key::E);
    window.harness.get_by_label("Keep them").click();
    window.harness.run_steps(2);
    assert_eq!(std::fs::read(&model).unwrap(), b"mine");
    window.key(Modifiers::COMMAND, Key::E);
    window.picture("replace");
    window.harness.get_by_label("Replace").click();
    window.until("the second export", |s| done(s, 2));
    assert_eq!(std::fs::read(&model).unwrap(), first[0]);
}
