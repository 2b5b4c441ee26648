//! What is written.

use std::path::{Path, PathBuf};

use super::dialogs::Purpose;
use super::{Studio, Weight};
use crate::export::{Ended, Export};
use crate::model::command::{self, Outputs};
use crate::model::{Side, project};

/// Exports, and the fields for them.
#[derive(Debug)]
pub(super) struct Exports {
    program: Option<PathBuf>,
    running: Option<(Export, PathBuf)>,
    /// The textured model.
    pub(super) model: String,
    /// Whether the texture and the coverage are written beside it.
    texture: bool,
    coverage: bool,
    /// The warped picture.
    pub(super) picture: String,
    /// What waits for the user's word that files may be replaced.
    asking: Option<Waiting>,
}

#[derive(Clone, Debug)]
struct Waiting {
    taken: Vec<PathBuf>,
    words: Vec<String>,
    result: PathBuf,
    /// The file that is to be written before, and what it holds.
    beside: Beside,
}

/// What the command line reads and the studio writes.
#[derive(Clone, Debug)]
pub(super) enum Beside {
    /// The pairs.
    Pairs(PathBuf),
    /// The cage.
    Cage(PathBuf, String),
}

impl Beside {
    fn path(&self) -> &Path {
        match self {
            Self::Pairs(path) | Self::Cage(path, _) => path,
        }
    }
}

impl Exports {
    pub(super) fn new(program: Option<PathBuf>) -> Self {
        Self {
            program,
            running: None,
            model: String::new(),
            texture: false,
            coverage: false,
            picture: String::new(),
            asking: None,
        }
    }

    /// Whether one goes on.
    pub(super) fn is_running(&self) -> bool {
        self.running.is_some()
    }

    pub(super) fn cancel(&mut self) {
        if let Some((export, _)) = &mut self.running {
            export.cancel();
        }
    }
}

/// A name beside another one: `out.glb` and `_pairs.json` give `out_pairs.json`.
fn beside(model: &Path, ending: &str) -> PathBuf {
    let stem = model.file_stem().unwrap_or_default().to_string_lossy();
    model.with_file_name(format!("{stem}{ending}"))
}

impl Studio {
    pub(super) fn export_panel(&mut self, ui: &mut egui::Ui) {
        let document = self.history.now();
        if self.exports.model.is_empty()
            && let Some(target) = document.transfer.file(Side::Target)
        {
            self.exports.model = beside(target, "_textured.glb").display().to_string();
        }
        ui.horizontal(|ui| {
            let label = ui.label("To");
            ui.add(egui::TextEdit::singleline(&mut self.exports.model).desired_width(170.0)).labelled_by(label.id);
            if ui.button("...").on_hover_text("Choose a file").clicked() {
                self.dialogs.ask(ui.ctx(), Purpose::Export);
            }
        });
        let mut size = document.transfer.options.size;
        ui.horizontal(|ui| {
            let label = ui.label("Texture size");
            let field = egui::DragValue::new(&mut size).range(16..=16384).speed(16);
            ui.add(field).labelled_by(label.id);
            for s in [1024, 2048, 4096] {
                if ui.small_button(s.to_string()).clicked() {
                    size = s;
                }
            }
        });
        if size != self.history.now().transfer.options.size {
            self.history.edit(|d| d.transfer.options.size = size);
        }
        ui.checkbox(&mut self.exports.texture, "The texture as PNG, too");
        ui.checkbox(&mut self.exports.coverage, "A picture of the coverage, too");
        let model = project::absolute(Path::new(self.exports.model.trim()));
        let pairs = beside(&model, "_pairs.json");
        let (texture, coverage) = (beside(&model, ".png"), beside(&model, "_coverage.png"));
        let outputs = Outputs {
            pairs: &pairs,
            model: &model,
            texture: self.exports.texture.then_some(texture.as_path()),
            coverage: self.exports.coverage.then_some(coverage.as_path()),
        };
        let words = command::transfer(&self.history.now().transfer, &outputs);
        let count = self.history.now().transfer.pairs.complete().len();
        let ready =
            words.is_some() && count >= 1 && !self.exports.is_running() && !self.exports.model.trim().is_empty();
        ui.horizontal(|ui| {
            let button = egui::Button::new("Export");
            let hint = "Writes the target with its new texture, and the pairs beside it. Ctrl E";
            if ui.add_enabled(ready, button).on_hover_text(hint).clicked()
                || (ready && std::mem::take(&mut self.transfer.wants_export))
            {
                let others = [outputs.texture, outputs.coverage].into_iter().flatten();
                let files = std::iter::once(model.as_path()).chain(others).map(Path::to_path_buf);
                let words = words.clone().unwrap_or_default();
                self.export(words, files.collect(), Beside::Pairs(pairs.clone()));
            }
            if self.exports.is_running() {
                ui.spinner();
                if ui.button("Cancel export").clicked() {
                    self.exports.cancel();
                }
            }
        });
        if let Some(words) = &words {
            ui.collapsing("The same on the command line", |ui| {
                let mut text = command::shown(words);
                ui.add(egui::TextEdit::multiline(&mut text).font(egui::TextStyle::Monospace).desired_rows(5));
                if ui.button("Copy").clicked() {
                    ui.ctx().copy_text(command::shown(words));
                }
            });
        }
    }

    /// Starts an export; asks first where it would replace files.
    pub(super) fn export(&mut self, words: Vec<String>, files: Vec<PathBuf>, beside: Beside) {
        let all = files.iter().map(PathBuf::as_path).chain([beside.path()]);
        let taken: Vec<PathBuf> = all.filter(|p| p.exists()).map(Path::to_path_buf).collect();
        let result = files.first().cloned().unwrap_or_default();
        let waiting = Waiting { taken, words, result, beside };
        if waiting.taken.is_empty() {
            self.begin_export(waiting);
        } else {
            self.exports.asking = Some(waiting);
        }
    }

    fn begin_export(&mut self, waiting: Waiting) {
        let Waiting { words, result, beside, .. } = waiting;
        let written = match &beside {
            Beside::Pairs(path) => self.write_pairs(path),
            Beside::Cage(path, text) => barymap::io::write_atomically(path, |file| {
                std::io::Write::write_all(file, text.as_bytes())
                    .map_err(|e| barymap::Error::io(path, e, "Choose another place"))
            }),
        };
        if let Err(error) = written {
            self.messages.tell(Weight::Failed, error.to_string());
            return;
        }
        let Some(program) = &self.exports.program else {
            self.messages.tell(Weight::Failed, "The studio's program is not found: copy the command line");
            return;
        };
        let ctx = self.ctx.clone();
        match Export::start(program, &words, move || ctx.request_repaint()) {
            Ok(export) => {
                self.messages.tell(Weight::Note, format!("exporting {}", result.display()));
                self.exports.running = Some((export, result));
            }
            Err(why) => self.messages.tell(Weight::Failed, why),
        }
    }

    /// Writes the pairs as the command line reads them.
    fn write_pairs(&self, path: &Path) -> barymap::Result<()> {
        let (Some(source), Some(target)) = (self.transfer.shape(Side::Source), self.transfer.shape(Side::Target))
        else {
            return Err(barymap::Error::input("a mesh is missing", "Open two meshes"));
        };
        let pairs = self.history.now().transfer.pairs.complete();
        let on_source: Vec<_> = pairs.iter().map(|p| p.1).collect();
        let on_target: Vec<_> = pairs.iter().map(|p| p.2).collect();
        barymap::io::anchors::write_pairs(path, (&source.mesh, &on_source), (&target.mesh, &on_target), &[])
    }

    /// Asks whether files may be replaced.
    pub(super) fn overwriting(&mut self, ui: &egui::Ui) {
        let Some(waiting) = self.exports.asking.clone() else { return };
        let mut answer = None;
        egui::Modal::new(egui::Id::unique("replace")).show(ui.ctx(), |ui| {
            ui.heading("Replace files?");
            for path in &waiting.taken {
                ui.label(path.display().to_string());
            }
            ui.horizontal(|ui| {
                if ui.button("Replace").clicked() {
                    answer = Some(true);
                }
                if ui.button("Keep them").clicked() || ui.input(|i| i.key_pressed(egui::Key::Escape)) {
                    answer = Some(false);
                }
            });
        });
        if let Some(replace) = answer {
            self.exports.asking = None;
            if replace {
                self.begin_export(waiting);
            }
        }
    }

    /// Says how an export ended.
    pub(super) fn exports_ended(&mut self) {
        let Some((export, result)) = &mut self.exports.running else { return };
        let Some(ended) = export.ended() else { return };
        let name = result.display().to_string();
        self.exports.running = None;
        match ended {
            Ended::Done(said) => {
                said.lines().for_each(|line| self.messages.tell(Weight::Note, line));
                self.messages.tell(Weight::Done, format!("written: {name}"));
            }
            Ended::Failed(said) => self.messages.tell(Weight::Failed, said),
            Ended::Cancelled => {
                self.messages.tell(Weight::Note, format!("{name} is not written: the export was ended"))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stand_beside_the_model() {
        assert_eq!(beside(Path::new("/a/b.c.glb"), "_pairs.json"), PathBuf::from("/a/b.c_pairs.json"));
    }
}
