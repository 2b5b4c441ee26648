//! Opening and saving.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use barymap::geometry::Material;
use barymap::models::character_pair;

use super::dialogs::Purpose;
use super::{Studio, Weight, Workspace};
use crate::model::Side;
use crate::model::document::Document;
use crate::model::history::History;
use crate::model::project;
use crate::worker::{OpenedShape, PlainPairs, Request};

/// Endings of files that are pictures.
const PICTURES: [&str; 17] = [
    "png", "jpg", "jpeg", "tif", "tiff", "exr", "webp", "tga", "bmp", "gif", "qoi", "hdr", "pnm", "ppm", "pgm", "pbm",
    "pam",
];

/// Endings of files that are meshes.
pub(super) const MESHES: [&str; 5] = ["obj", "ply", "off", "gltf", "glb"];

/// Whether the name of a file says that it is a picture.
pub(super) fn is_picture(path: &Path) -> bool {
    let ending = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    ending.is_some_and(|e| PICTURES.contains(&e.as_str()))
}

impl Studio {
    /// Opens a file of any kind: a project, pairs, a picture, a mesh for a side or the side that is
    /// still empty.
    pub fn open_any(&mut self, path: &Path, side: Option<Side>) {
        let path = project::absolute(path);
        let ending = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        if path.is_dir() {
            let text = format!("{} is a folder: open the files in it", path.display());
            self.messages.tell(Weight::Failed, text);
        } else if ending == "json" {
            let head = std::fs::read(&path).unwrap_or_default();
            if project::is_project(&String::from_utf8_lossy(&head)) {
                self.open_project(&path);
            } else {
                self.worker.send(Request::ReadPairs(path));
            }
        } else if is_picture(&path) {
            match self.workspace {
                Workspace::Transfer => self.history.edit(|d| d.transfer.texture = Some(path)),
                Workspace::Warp => self.open_picture(path),
            }
        } else {
            let empty =
                |s: &Side| self.transfer.opening[s.index()].is_none() && self.history.now().transfer.file(*s).is_none();
            let side = side.or_else(|| Side::BOTH.into_iter().find(empty)).unwrap_or(Side::Target);
            self.open_mesh(side, path);
        }
    }

    /// Opens a mesh: once it is read, the document has it.
    pub(super) fn open_mesh(&mut self, side: Side, path: PathBuf) {
        self.workspace = Workspace::Transfer;
        self.transfer.opening[side.index()] = Some(path.clone());
        self.worker.send(Request::Open(side, path));
    }

    /// A mesh was read.
    pub(super) fn opened(&mut self, side: Side, shape: Arc<OpenedShape>) {
        let path = shape.path.clone();
        if self.history.now().transfer.file(side) != Some(&path) {
            if self.transfer.opening[side.index()].as_ref() != Some(&path) {
                // Something else was asked for since.
                return;
            }
            // The worker has it already.
            let asked = &mut self.transfer.asked;
            asked.files[side.index()] = Some(path.clone());
            if side == Side::Source {
                asked.texture = None;
            } else {
                asked.unwrap = false;
            }
            self.history.edit(|d| {
                d.transfer.set_file(side, path);
                if side == Side::Target {
                    // A target without texture coordinates gets some: nothing can be seen else.
                    d.transfer.options.unwrap = !shape.has_texcoords;
                }
            });
        }
        self.transfer.opening[side.index()] = None;
        self.transfer.set_shape(side, shape);
    }

    /// Pairs of a file were found on the meshes.
    pub(super) fn read_pairs(&mut self, pairs: PlainPairs) {
        let count = pairs.len();
        self.history.edit(|d| {
            d.transfer.pairs.replace(pairs.into_iter().map(|(s, t)| ([Some(s), Some(t)], String::new())));
        });
        self.messages.tell(Weight::Done, format!("{count} pairs read"));
    }

    /// Opens a project in place of what there is.
    pub(super) fn open_project(&mut self, path: &Path) {
        match project::open(path) {
            Ok(opened) => {
                for missing in &opened.missing {
                    let text = format!("{} is not there: put it back, or open another file", missing.display());
                    self.messages.tell(Weight::Failed, text);
                }
                self.put(opened.document);
                self.project = Some(path.to_path_buf());
            }
            Err(error) => self.messages.tell(Weight::Failed, error.to_string()),
        }
    }

    /// Another document, without a past.
    fn put(&mut self, document: Document) {
        let warps = document.transfer.files.iter().all(Option::is_none) && document.warp.picture.is_some();
        self.workspace = if warps { Workspace::Warp } else { Workspace::Transfer };
        self.transfer.start_anew();
        self.history = History::new(document);
        self.saved = self.history.revision();
    }

    /// Takes over what a crash left.
    pub(super) fn recover(&mut self, path: &Path) {
        match project::open(path) {
            Ok(opened) => {
                self.put(opened.document);
                // It is not in a file of its own yet.
                self.saved = u64::MAX;
                self.project = None;
                self.messages.tell(Weight::Done, "Your work is back: save it");
                self.drop_left(path);
            }
            Err(error) => self.messages.tell(Weight::Failed, error.to_string()),
        }
    }

    /// What a crash left is not wanted.
    pub(super) fn drop_left(&mut self, path: &Path) {
        // Where it is gone already nothing is to be done.
        _ = std::fs::remove_file(path);
        self.left.retain(|p| p != path);
    }

    /// Saves the project where it was, or asks where.
    pub(super) fn save(&mut self) {
        match self.project.clone() {
            Some(path) => self.save_as(&path),
            None => self.dialogs.ask(&self.ctx, Purpose::SaveProject),
        }
    }

    /// Saves the project.
    pub(super) fn save_as(&mut self, path: &Path) {
        let mut path = project::absolute(path);
        if path.extension().is_none() {
            path.set_extension("json");
        }
        match project::save(self.history.now(), &path) {
            Ok(()) => {
                self.saved = self.history.revision();
                self.messages.tell(Weight::Done, format!("saved as {}", path.display()));
                self.project = Some(path);
                if let Some(recovery) = &mut self.recovery {
                    recovery.forget();
                }
            }
            Err(error) => self.messages.tell(Weight::Failed, error.to_string()),
        }
    }

    /// Writes the built-in characters as files and opens them.
    pub(super) fn open_built_in(&mut self) {
        let Some(folder) = self.folder.as_ref().map(|f| f.join("built-in")) else {
            self.messages.tell(
                Weight::Failed,
                "There is no folder for the built-in models: run `barymap demo` and open its files",
            );
            return;
        };
        let (sender, ctx) = (self.dialogs.sender.clone(), self.ctx.clone());
        std::thread::spawn(move || {
            // A window that is gone wants no files.
            match write_built_in(&folder) {
                Ok(files) => {
                    Side::BOTH.into_iter().zip(files).for_each(|(s, f)| _ = sender.send(Ok((Purpose::Mesh(s), f))))
                }
                Err(error) => _ = sender.send(Err(error.to_string())),
            }
            ctx.request_repaint();
        });
    }

    /// Files that were dropped onto the window.
    pub(super) fn dropped(&mut self, ui: &egui::Ui) {
        let files = ui.input(|i| i.raw.dropped_files.clone());
        let at = ui.input(|i| i.pointer.latest_pos());
        for file in files {
            let side = at.and_then(|at| self.transfer.side_at(at)).filter(|_| !is_picture(file.path()));
            self.open_any(file.path(), side);
        }
    }

    /// Files that were chosen in dialogs.
    pub(super) fn chosen(&mut self) {
        while let Some(chosen) = self.dialogs.chosen() {
            let (purpose, path) = match chosen {
                Ok(chosen) => chosen,
                Err(why) => {
                    self.messages.tell(Weight::Failed, why);
                    continue;
                }
            };
            match purpose {
                Purpose::Mesh(side) => self.open_mesh(side, project::absolute(&path)),
                Purpose::Texture => self.history.edit(|d| d.transfer.texture = Some(project::absolute(&path))),
                Purpose::Picture => self.open_picture(project::absolute(&path)),
                Purpose::Pairs => self.worker.send(Request::ReadPairs(path)),
                Purpose::Any => self.open_any(&path, None),
                Purpose::SaveProject => self.save_as(&path),
                Purpose::Export => self.exports.model = path.display().to_string(),
                Purpose::ExportWarp => self.exports.picture = path.display().to_string(),
            }
        }
    }
}

/// The built-in characters as OBJ files with a texture, in a folder; those that are there already
/// are taken.
fn write_built_in(folder: &Path) -> barymap::Result<[PathBuf; 2]> {
    let names = ["strider.png", "strider.obj", "stout.obj"].map(|n| folder.join(n));
    let [texture, source, target] = &names;
    if !names.iter().all(|p| p.exists()) {
        let remedy = "Run `barymap demo` and open its files";
        std::fs::create_dir_all(folder).map_err(|e| barymap::Error::io(folder, e, remedy))?;
        let pair = character_pair();
        barymap::io::write_image(&pair.source.texture(1024), texture)?;
        let mut painted = pair.source.mesh;
        painted.set_material(Material {
            name: "skin".into(),
            base_color_texture: Some(texture.clone()),
            ..Material::default()
        });
        barymap::io::write_obj(&painted, source)?;
        barymap::io::write_obj(&pair.target.mesh, target)?;
    }
    Ok([source.clone(), target.clone()])
}
