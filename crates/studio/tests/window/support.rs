//! A studio in a window without a display.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use barymap::geometry::{Material, SurfacePoint};
use barymap::models::{ModelPair, character_pair};
use barymap_studio::model::Side;
use barymap_studio::view::{Setup, Studio};
use egui_kittest::Harness;
use tempfile::TempDir;

/// A test that waits longer than this has failed: no result depends on it.
const PATIENCE: Duration = Duration::from_secs(300);

/// A file that was dropped.
#[derive(Debug)]
struct Dropped(PathBuf);

impl egui::DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        std::fs::read(&self.0).map_err(|e| e.to_string())
    }
}

/// A studio and its folder.
pub(crate) struct Window {
    pub(crate) harness: Harness<'static, Studio>,
    pub(crate) folder: TempDir,
}

impl Window {
    pub(crate) fn new(files: &[PathBuf]) -> Self {
        Self::in_folder(tempfile::tempdir().unwrap(), files)
    }

    pub(crate) fn in_folder(folder: TempDir, files: &[PathBuf]) -> Self {
        let setup = Setup {
            files: files.to_vec(),
            program: Some(env!("CARGO_BIN_EXE_barymap-studio").into()),
            folder: Some(folder.path().join("studio")),
        };
        let harness = Harness::builder()
            .with_size([1280.0, 800.0])
            .wgpu_setup(barymap_studio::start::wgpu_setup())
            .build_eframe(move |cc| Studio::new(cc, setup).unwrap());
        Self { harness, folder }
    }

    pub(crate) fn studio(&self) -> &Studio {
        self.harness.state()
    }

    /// Runs frames until something is so.
    pub(crate) fn until(&mut self, what: &str, mut so: impl FnMut(&Studio) -> bool) {
        let begun = Instant::now();
        while !so(self.harness.state()) {
            let told = || self.harness.state().messages().list().map(|m| m.1.clone()).collect::<Vec<_>>();
            assert!(begun.elapsed() < PATIENCE, "waited in vain for {what}; messages: {:?}", told());
            self.harness.run_steps(1);
            std::thread::sleep(Duration::from_millis(2));
        }
        self.harness.run_steps(1);
    }

    pub(crate) fn until_opened(&mut self) {
        self.until("both meshes", |s| Side::BOTH.into_iter().all(|side| s.transfer().shape(side).is_some()));
    }

    /// A click of the left button.
    pub(crate) fn click(&mut self, at: egui::Pos2) {
        self.harness.hover_at(at);
        self.harness.run_steps(1);
        self.harness.drag_at(at);
        self.harness.run_steps(1);
        self.harness.drop_at(at);
        self.harness.run_steps(2);
    }

    /// Presses a key.
    pub(crate) fn key(&mut self, modifiers: egui::Modifiers, key: egui::Key) {
        self.harness.key_press_modifiers(modifiers, key);
        self.harness.run_steps(2);
    }

    /// Turns a side so that a point faces the eye, and clicks at the nearest pixel.
    pub(crate) fn click_point(&mut self, side: Side, point: &SurfacePoint) {
        let normal = self.studio().transfer().shape(side).unwrap().mesh.triangle_area_normal(point.face as usize);
        // From where it is seen, as near to its front as can be: other parts may stand before it.
        let normal = normal.normalize();
        let mut from: Vec<glam::DVec3> = (0..400)
            .map(|k| {
                let (turn, height) = (2.399963 * f64::from(k), (f64::from(k) + 0.5) / 200.0 - 1.0);
                glam::DVec3::new(turn.cos(), 0.0, turn.sin()) * (1.0 - height * height).sqrt() + height * glam::DVec3::Y
            })
            .chain([normal])
            .collect();
        from.sort_by(|a, b| b.dot(normal).total_cmp(&a.dot(normal)));
        let seen = from.into_iter().any(|direction| {
            // From near by, so that the points of other pairs lie apart.
            let place = point.position(&self.studio().transfer().shape(side).unwrap().mesh);
            let camera = self.harness.state_mut().transfer_mut().camera_mut(side);
            camera.face(direction);
            (camera.focus, camera.distance) = (place, 0.8 * camera.radius);
            self.harness.state().transfer().sees(side, point)
        });
        self.harness.run_steps(1);
        assert!(seen && self.studio().transfer().sees(side, point), "{point:?} is hidden from everywhere");
        let at = self.studio().transfer().place(side, point).unwrap();
        self.click(egui::Pos2::new(at.x.floor() + 0.5, at.y.floor() + 0.5));
    }

    /// Drops a file onto the window.
    pub(crate) fn drop_file(&mut self, path: &Path) {
        let file = std::sync::Arc::new(Dropped(path.to_path_buf()));
        self.harness.input_mut().dropped_files.push(file);
        self.harness.run_steps(2);
    }

    /// Saves a picture of the window where `STUDIO_PICTURES` names a folder, to be looked at.
    pub(crate) fn picture(&mut self, name: &str) {
        if let Some(folder) = std::env::var_os("STUDIO_PICTURES") {
            let path = PathBuf::from(folder).join(format!("{name}.png"));
            self.harness.render().unwrap().save(path).unwrap();
        }
    }
}

/// The built-in characters as files: source with a texture, and target.
pub(crate) fn built_in(folder: &Path) -> (ModelPair, [PathBuf; 2]) {
    let pair = character_pair();
    let files = ["source.obj", "target.obj"].map(|n| folder.join(n));
    let texture = folder.join("skin.png");
    barymap::io::write_image(&pair.source.texture(512), &texture).unwrap();
    let mut painted = pair.source.mesh.clone();
    painted.set_material(Material { name: "skin".into(), base_color_texture: Some(texture), ..Material::default() });
    barymap::io::write_obj(&painted, &files[0]).unwrap();
    barymap::io::write_obj(&pair.target.mesh, &files[1]).unwrap();
    (pair, files)
}
