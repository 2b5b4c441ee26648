//! Pairs set by clicks.

use barymap::desk::Subject;
use barymap::engine::Engine;
use barymap::io::{Cache, ReadOptions};
use barymap::models::ModelPair;
use barymap::progress::Quiet;
use barymap::surface::{AnchorPairs, EmbeddingOptions};
use barymap::tools::vertex_map::vertex_map;
use barymap_studio::model::Side;
use egui::{Key, Modifiers};
use egui_kittest::kittest::Queryable;

use crate::support::{Window, built_in};

/// Mean distance of the target's vertices' images from the truth, over the square root of the area.
fn error(pair: &ModelPair, subjects: &[Subject; 2], anchors: &AnchorPairs) -> f64 {
    let [source, target] = subjects;
    let options = EmbeddingOptions::default();
    let choice = barymap::desk::Choice { keep_all: true, ..Default::default() };
    let made = barymap::desk::correspond(&Engine::cpu(), source, target, anchors, &choice, &options, &Quiet).unwrap();
    let (from, to) = ((&source.mesh, &source.topology), (&target.mesh, &target.topology));
    let images = vertex_map(from, to, made.map.as_ref()).unwrap();
    let size = source.mesh.area().sqrt();
    let errors: Vec<f64> = pair
        .truth
        .iter()
        .zip(&images.positions)
        .map(|(t, p)| p.map_or(1.0, |p| p.distance(t.position(&source.mesh)) / size))
        .collect();
    errors.iter().sum::<f64>() / errors.len() as f64
}

#[test]
fn twenty_pairs_clicked_are_as_good_as_given_ones() {
    let folder = tempfile::tempdir().unwrap();
    let (pair, files) = built_in(folder.path());
    let mut window = Window::new(&files);
    window.until_opened();
    window.until("the textures", |s| s.transfer().is_drawn());
    window.picture("opened");
    let (source, target) = pair.anchors(20);
    for (k, (s, t)) in source.iter().zip(&target).enumerate() {
        window.click_point(Side::Source, s);
        let open = window.studio().document().transfer.pairs.open().cloned();
        assert!(open.is_some(), "pair {k} was not begun");
        window.click_point(Side::Target, t);
        assert_eq!(window.studio().document().transfer.pairs.complete().len(), k + 1, "pair {k}");
    }
    window.until("the texture at full size", |s| s.transfer().result().is_some_and(|r| !r.coarse));
    window.until("errors of pairs", |s| s.transfer().left_out_count() == 20);
    window.harness.state_mut().transfer_mut().camera_mut(Side::Target).face(glam::DVec3::Z);
    window.harness.state_mut().transfer_mut().camera_mut(Side::Source).face(glam::DVec3::Z);
    window.harness.run_steps(2);
    window.picture("twenty");
    for key in [Key::Num2, Key::Num3, Key::Num4] {
        window.key(Modifiers::NONE, key);
        window.picture(&format!("overlay {key:?}"));
    }
    window.harness.get_by_label("20 pairs");

    let mut subjects = files.map(|f| Subject::open(f, &ReadOptions::default()).unwrap());
    for subject in &mut subjects {
        subject.embed(&EmbeddingOptions::default(), &Cache::from_environment(), &Quiet).unwrap();
    }
    let clicked = window.studio().document().transfer.pairs.complete();
    let clicked =
        AnchorPairs { source: clicked.iter().map(|p| p.1).collect(), target: clicked.iter().map(|p| p.2).collect() };
    let given = AnchorPairs { source, target };
    let (by_clicks, exact) = (error(&pair, &subjects, &clicked), error(&pair, &subjects, &given));
    println!("mean error: {by_clicks:.5} clicked, {exact:.5} given");
    assert!(by_clicks <= 1.1 * exact, "{by_clicks} against {exact}");
    // The comparison sees pairs that are off: the same, each with the partner of the next one.
    let mut wrong = given.clone();
    wrong.target.rotate_left(1);
    assert!(error(&pair, &subjects, &wrong) > 2.0 * exact);
}

#[test]
fn clicks_keys_and_undo() {
    let folder = tempfile::tempdir().unwrap();
    let (pair, files) = built_in(folder.path());
    let mut window = Window::new(&files);
    window.until_opened();
    let (source, target) = pair.anchors(6);
    for k in 0..5 {
        window.click_point(Side::Source, &source[k]);
        window.click_point(Side::Target, &target[k]);
    }
    window.until("a result", |s| s.transfer().result().is_some());
    // The sixth: the program shows the partner, and a key takes it.
    window.click_point(Side::Source, &source[5]);
    window.until("the partner", |s| s.transfer().guess().is_some());
    let guess = window.studio().transfer().guess().unwrap();
    window.key(Modifiers::NONE, Key::Enter);
    let pairs = window.studio().document().transfer.pairs.complete();
    assert_eq!((pairs.len(), pairs[5].2), (6, guess));
    // Five pairs say little: it is on the same part of the body.
    let mesh = &window.studio().transfer().shape(Side::Target).unwrap().mesh;
    let off = guess.position(mesh).distance(target[5].position(mesh)) / mesh.area().sqrt();
    assert!(off < 0.5, "{off}");
    // Delete, undo, redo.
    window.key(Modifiers::NONE, Key::Delete);
    assert_eq!(window.studio().document().transfer.pairs.complete().len(), 5);
    window.key(Modifiers::COMMAND, Key::Z);
    assert_eq!(window.studio().document().transfer.pairs.complete(), pairs);
    window.key(Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
    assert_eq!(window.studio().document().transfer.pairs.complete().len(), 5);
    // A half pair is dropped by Escape.
    window.click_point(Side::Target, &target[5]);
    assert!(window.studio().document().transfer.pairs.open().is_some());
    window.key(Modifiers::NONE, Key::Escape);
    assert!(window.studio().document().transfer.pairs.open().is_none());
    // Buttons that a screen reader finds.
    window.harness.get_by_label("delete pair 1").click();
    window.harness.run_steps(2);
    assert_eq!(window.studio().document().transfer.pairs.complete().len(), 4);
    for label in ["source view", "target view", "Propose pairs", "Undo"] {
        window.harness.get_by_label(label);
    }
}
