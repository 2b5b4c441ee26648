//! Points that are dragged for a long time.

use barymap_studio::model::Side;

use crate::support::{Window, built_in};

/// Resident memory in bytes, where the system tells.
fn resident() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find(|l| l.starts_with("VmRSS:"))?;
    line.split_whitespace().nth(1)?.parse::<u64>().ok().map(|kilobytes| 1024 * kilobytes)
}

/// Drags; the texture follows at least once for each [`SPAN`] of them, and memory stays.
const DRAGS: usize = 500;
const SPAN: usize = 50;
/// What allocators may keep between two looks.
const SLACK: u64 = 64 << 20;

#[test]
fn a_pair_is_dragged_and_the_texture_follows_without_growth() {
    let folder = tempfile::tempdir().unwrap();
    let (pair, files) = built_in(folder.path());
    let mut window = Window::new(&files);
    window.until_opened();
    let (source, target) = pair.anchors(20);
    for (s, t) in source.iter().zip(&target) {
        window.harness.state_mut().set_point(Side::Source, *s);
        window.harness.state_mut().set_point(Side::Target, *t);
    }
    window.until("the first result", |s| s.transfer().result().is_some_and(|r| !r.coarse));
    let (before, point) = (window.studio().document().clone(), target[7]);
    let normal = window.studio().transfer().shape(Side::Target).unwrap().mesh.triangle_area_normal(point.face as usize);
    window.harness.state_mut().transfer_mut().camera_mut(Side::Target).face(normal);
    window.harness.run_steps(1);
    let start = window.studio().transfer().place(Side::Target, &point).unwrap();
    window.harness.hover_at(start);
    window.harness.run_steps(1);
    window.harness.drag_at(start);
    window.harness.run_steps(1);
    let mut settled = None;
    let mut times = Vec::new();
    for k in 0..DRAGS {
        let angle = k as f32 * 0.37;
        let at = start + egui::Vec2::new(angle.cos(), angle.sin()) * (9.0 + (k % 5) as f32);
        window.harness.hover_at(at);
        window.harness.run_steps(1);
        if k % SPAN == SPAN - 1 {
            let seen = window.studio().transfer().updates();
            window.until("a picture of the drag", |s| s.transfer().updates() > seen);
            times.push(window.studio().transfer().result().unwrap().milliseconds);
            if k == DRAGS / 4 {
                settled = resident();
            }
        }
        if k == DRAGS / 5 {
            settled = resident();
        }
    }
    let end = resident();
    assert!(window.studio().transfer().result().unwrap().coarse, "the drag goes on");
    window.picture("dragging");
    window.harness.drop_at(start + egui::Vec2::new(6.0, 0.0));
    window.harness.run_steps(2);
    let after = window.studio().document().clone();
    assert_ne!(after, before);
    window.until("the full size", |s| s.transfer().result().is_some_and(|r| !r.coarse));
    println!("milliseconds from a move to its picture: {times:.0?}");
    if let (Some(settled), Some(end)) = (settled, end) {
        println!("resident: {} MB after {} drags, {} MB after {DRAGS}", settled >> 20, DRAGS / 5, end >> 20);
        assert!(end < settled + SLACK, "{settled} bytes grew to {end}");
    }
    // The whole drag is one edit.
    window.key(egui::Modifiers::COMMAND, egui::Key::Z);
    assert_eq!(*window.studio().document(), before);
}
