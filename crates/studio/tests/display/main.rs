//! The whole program on a display, by mouse and keyboard: `bash tests/studio.sh` starts one (Xvfb)
//! and runs this with `xdotool`.

use std::path::Path;
use std::process::{Child, Command};
use std::time::{Duration, Instant};

use barymap::geometry::Material;
use barymap::models::character_pair;
use barymap_studio::model::{Side, project};
use barymap_studio::view::{Setup, Studio};
use egui_kittest::Harness;

/// Size of the display and of the window, which fills it.
const SIZE: [f32; 2] = [1280.0, 800.0];
/// Pairs that are clicked.
const PAIRS: usize = 16;
/// Points are clicked at least this far apart.
const APART: f32 = 26.0;
/// What is waited for at most.
const PATIENCE: Duration = Duration::from_secs(240);

/// Ends the program however the test ends.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // One that has ended needs no end.
        _ = self.0.kill();
        _ = self.0.wait();
    }
}

fn xdotool(words: &[&str]) {
    let status = Command::new("xdotool").args(words).status().expect("xdotool is installed");
    assert!(status.success(), "xdotool {words:?}");
    std::thread::sleep(Duration::from_millis(120));
}

fn click(at: egui::Pos2) {
    let (x, y) = (at.x.round().to_string(), at.y.round().to_string());
    xdotool(&["mousemove", &x, &y]);
    xdotool(&["click", "1"]);
}

fn until(what: &str, mut so: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !so() {
        assert!(begun.elapsed() < PATIENCE, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(100));
    }
}

fn screenshot(name: &str) {
    if let Some(folder) = std::env::var_os("STUDIO_PICTURES") {
        let path = Path::new(&folder).join(name);
        // A picture for people: without ImageMagick there is none.
        _ = Command::new("import").args(["-window", "root"]).arg(path).status();
    }
}

#[test]
#[ignore = "needs a display of 1280 x 800 and xdotool: bash tests/studio.sh"]
fn sixteen_pairs_by_mouse_a_drag_and_an_export() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let pair = character_pair();
    barymap::io::write_image(&pair.source.texture(512), at("skin.png")).unwrap();
    let mut painted = pair.source.mesh.clone();
    painted.set_material(Material { base_color_texture: Some(at("skin.png")), ..Material::default() });
    barymap::io::write_obj(&painted, at("source.obj")).unwrap();
    barymap::io::write_obj(&pair.target.mesh, at("target.obj")).unwrap();
    let files = [at("source.obj"), at("target.obj")];

    // Where points are on the screen: by a window of the same size without a display.
    let setup = Setup { files: files.to_vec(), folder: Some(at("other")), ..Setup::default() };
    let mut twin = Harness::builder()
        .with_size(SIZE)
        .wgpu_setup(barymap_studio::start::wgpu_setup())
        .build_eframe(move |cc| Studio::new(cc, setup).unwrap());
    until("the twin's meshes", || {
        twin.run_steps(1);
        Side::BOTH.into_iter().all(|s| twin.state().transfer().shape(s).is_some())
    });
    twin.run_steps(2);
    let (source, target) = pair.anchors(400);
    let mut clicks: Vec<[egui::Pos2; 2]> = Vec::new();
    let view = twin.state().transfer();
    for (s, t) in source.iter().zip(&target) {
        let seen = view.sees(Side::Source, s) && view.sees(Side::Target, t);
        let places = view.place(Side::Source, s).zip(view.place(Side::Target, t));
        let Some((a, b)) = places.filter(|_| seen) else { continue };
        if clicks.iter().all(|c| c[0].distance(a) > APART && c[1].distance(b) > APART) && clicks.len() < PAIRS {
            clicks.push([a, b]);
        }
    }
    assert_eq!(clicks.len(), PAIRS, "points that are seen from the front");
    drop(twin);

    let program = env!("CARGO_BIN_EXE_barymap-studio");
    let child = Command::new(program).args(&files).current_dir(folder.path()).env("BARYMAP_CACHE", at("cache")).spawn();
    let mut running = Running(child.unwrap());
    until("the window", || {
        let found = Command::new("xdotool").args(["search", "--name", "barymap studio"]).output();
        found.is_ok_and(|o| !o.stdout.is_empty())
    });
    // The meshes are small; the window says when it has read them, but only to people.
    std::thread::sleep(Duration::from_secs(8));
    screenshot("display_opened.png");
    for [a, b] in &clicks {
        click(*a);
        click(*b);
    }
    screenshot("display_clicked.png");
    let project = at("work.json");
    let save = |first: bool| {
        xdotool(&["mousemove", "200", "780"]);
        xdotool(&["key", "ctrl+s"]);
        if first {
            std::thread::sleep(Duration::from_millis(600));
            xdotool(&["key", "ctrl+a"]);
            xdotool(&["type", "--delay", "20", &project.to_string_lossy()]);
            xdotool(&["key", "Return"]);
        }
    };
    save(true);
    let saved = || project::open(&project).ok().map(|o| o.document.transfer.pairs.complete());
    until("the saved project", || saved().is_some_and(|p| p.len() == PAIRS));
    let before = saved().unwrap();

    // The first point on the target goes to the right and down.
    let from = clicks[0][1];
    xdotool(&["mousemove", &from.x.round().to_string(), &from.y.round().to_string()]);
    xdotool(&["mousedown", "1"]);
    for _ in 0..8 {
        xdotool(&["mousemove_relative", "1", "1"]);
    }
    screenshot("display_dragging.png");
    xdotool(&["mouseup", "1"]);
    save(false);
    until("the saved drag", || saved().is_some_and(|p| p != before));
    let after = saved().unwrap();
    assert_eq!(after[1..], before[1..], "one point moved");
    assert_eq!(after[0].1, before[0].1);

    xdotool(&["key", "ctrl+e"]);
    let model = at("target_textured.glb");
    until("the exported model", || model.exists());
    std::thread::sleep(Duration::from_secs(1));
    screenshot("display_exported.png");
    assert!(running.0.try_wait().unwrap().is_none(), "the studio runs");
    // The same by the command line, from the pairs that were written.
    let other = at("other.glb");
    let words = ["--as-command-line", "transfer", "--keep-all", "--size", "2048"];
    let status = Command::new(program)
        .args(words)
        .arg("--source")
        .arg(&files[0])
        .arg("--target")
        .arg(&files[1])
        .arg("--anchors")
        .arg(at("target_textured_pairs.json"))
        .arg("--model")
        .arg(&other)
        .env("BARYMAP_CACHE", at("cache"))
        .status();
    assert!(status.unwrap().success());
    assert!(std::fs::read(&model).unwrap() == std::fs::read(&other).unwrap(), "both exports are the same");
}
