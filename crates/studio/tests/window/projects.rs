//! Projects: saved, opened, recovered.

use barymap_studio::model::Side;
use barymap_studio::view::{Setup, Studio};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use crate::support::{Window, built_in};

#[test]
fn a_project_is_saved_and_opened_again() {
    let folder = tempfile::tempdir().unwrap();
    let (pair, files) = built_in(folder.path());
    let mut window = Window::new(&files);
    window.until_opened();
    let (source, target) = pair.anchors(4);
    for (s, t) in source.iter().zip(&target) {
        window.harness.state_mut().set_point(Side::Source, *s);
        window.harness.state_mut().set_point(Side::Target, *t);
    }
    window.harness.run_steps(2);
    assert!(window.studio().is_changed());
    let path = folder.path().join("work.json");
    window.harness.state_mut().save_project(&path);
    assert!(!window.studio().is_changed());
    let document = window.studio().document().clone();
    drop(window);
    let mut again = Window::new(std::slice::from_ref(&path));
    again.until_opened();
    assert_eq!(*again.studio().document(), document);
    again.until("a result", |s| s.transfer().result().is_some());
    drop(again);
    // A missing file is named; the rest is there.
    std::fs::remove_file(&files[1]).unwrap();
    let mut without = Window::new(&[path]);
    without.until("the source", |s| s.transfer().shape(Side::Source).is_some());
    assert_eq!(without.studio().document().transfer.pairs, document.transfer.pairs);
    assert!(without.studio().messages().list().any(|m| m.1.contains("target.obj")));
}

#[test]
fn work_that_was_not_saved_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let (pair, files) = built_in(folder.path());
    let mut window = Window::new(&files);
    window.until_opened();
    let (source, target) = pair.anchors(1);
    window.harness.state_mut().set_point(Side::Source, source[0]);
    window.harness.state_mut().set_point(Side::Target, target[0]);
    let kept = window.folder.path().join("studio");
    let file = |folder: &std::path::Path| {
        std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path()).find(|p| p.is_file())
    };
    let points = |s: &Studio| s.document().transfer.pairs.complete().len();
    window.until("the recovery file", |_| {
        file(&kept).and_then(|p| std::fs::read_to_string(p).ok()).is_some_and(|t| t.contains("barycentric"))
    });
    // As a crash leaves it: of a process that is gone.
    let left = tempfile::tempdir().unwrap();
    let crashed = left.path().join("recovery-4294967294.json");
    std::fs::copy(file(&kept).unwrap(), &crashed).unwrap();
    drop(window);
    assert_eq!(file(&kept), None, "a regular end leaves nothing");
    let setup = Setup { folder: Some(left.path().to_path_buf()), ..Setup::default() };
    let mut harness = Harness::builder()
        .with_size([900.0, 600.0])
        .wgpu_setup(barymap_studio::start::wgpu_setup())
        .build_eframe(move |cc| Studio::new(cc, setup).unwrap());
    harness.run_steps(2);
    harness.get_by_label("Bring it back").click();
    harness.run_steps(2);
    assert_eq!(points(harness.state()), 1);
    assert!(!crashed.exists());
}
