//! A picture in a cage.

use barymap::picture::Image;
use egui_kittest::kittest::Queryable;

use crate::support::Window;

#[test]
fn a_vertex_is_dragged_and_the_picture_exported() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("board.png");
    let image =
        Image::from_fn(
            320,
            240,
            |x, y| {
                if (x / 20 + y / 20) % 2 == 0 { [230, 220, 200, 255] } else { [60, 90, 140, 255] }
            },
        );
    barymap::io::write_image(&image.unwrap(), &path).unwrap();
    let mut window = Window::new(&[]);
    window.harness.get_by_label("Warp").click();
    window.harness.run_steps(2);
    window.drop_file(&path);
    window.until("the picture", |s| s.warp().state().is_some_and(|w| w.settled));
    // The middle of the upper edge, far down.
    let loops = window.studio().document().warp.loops.clone();
    let (k, from) = (1, loops[0].target[1]);
    let at = window.studio().warp().place(from);
    let to = window.studio().warp().place(from + glam::DVec2::new(30.0, 150.0));
    window.harness.hover_at(at);
    window.harness.run_steps(1);
    window.harness.drag_at(at);
    window.harness.run_steps(1);
    for step in 1..=10 {
        window.harness.hover_at(at.lerp(to, step as f32 / 10.0));
        window.harness.run_steps(1);
    }
    window.harness.drop_at(to);
    window.harness.run_steps(2);
    let moved = window.studio().document().warp.loops[0].target[k];
    assert!(moved.distance(from) > 100.0, "{moved} from {from}");
    window.until("the map at rest", |s| {
        s.warp().state().is_some_and(|w| w.settled && w.single.is_some_and(|x| x <= 0.0))
    });
    let state = *window.studio().warp().state().unwrap();
    assert!(state.steps > 1 && !state.folds && state.minimum > 0.0, "{state:?}");
    window.picture("warp");
    window.harness.get_by_label("Show J at rest").click();
    let seen = window.studio().warp().updates();
    window.until("the heat map", |s| s.warp().updates() > seen && s.warp().has_heat());
    window.picture("heat");
    window.harness.get_by_label("Export picture").click();
    window.until("the export", |s| s.messages().list().any(|m| m.1.starts_with("written: ")));
    let warped = barymap::io::read_image(folder.path().join("board_warped.png")).unwrap();
    assert_eq!((warped.width, warped.height), (320, 240));
    barymap::io::cage::read_cage(folder.path().join("board_warped_cage.json")).unwrap();
    // The whole drag is one edit.
    window.key(egui::Modifiers::COMMAND, egui::Key::Z);
    assert_eq!(window.studio().document().warp.loops, loops);
}
