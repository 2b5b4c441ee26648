//! Asking for files: a field for a path, and the dialog of the system where it has one.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, channel};

use super::files::MESHES;
use crate::model::Side;

/// What a file is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    Mesh(Side),
    Texture,
    Picture,
    Pairs,
    Any,
    SaveProject,
    Export,
    ExportWarp,
}

impl Purpose {
    fn title(self) -> &'static str {
        match self {
            Self::Mesh(Side::Source) => "Open the source: the mesh with the texture",
            Self::Mesh(Side::Target) => "Open the target: the mesh that gets the texture",
            Self::Texture => "Open a texture for the source",
            Self::Picture => "Open a picture",
            Self::Pairs => "Read pairs",
            Self::Any => "Open a project, mesh, picture or pairs",
            Self::SaveProject => "Save the project",
            Self::Export => "Export to",
            Self::ExportWarp => "Export the warped picture to",
        }
    }

    fn saves(self) -> bool {
        matches!(self, Self::SaveProject | Self::Export | Self::ExportWarp)
    }
}

/// A file that was chosen, or why there is none.
pub(super) type Chosen = Result<(Purpose, PathBuf), String>;

/// Files that are asked for.
#[derive(Debug)]
pub(super) struct Dialogs {
    pub(super) sender: Sender<Chosen>,
    chosen: Receiver<Chosen>,
    open: Option<Purpose>,
    text: String,
    /// The field gets the focus once.
    fresh: bool,
}

impl Default for Dialogs {
    fn default() -> Self {
        let (sender, chosen) = channel();
        Self { sender, chosen, open: None, text: String::new(), fresh: false }
    }
}

impl Dialogs {
    /// Asks for a file.
    pub(super) fn ask(&mut self, ctx: &egui::Context, purpose: Purpose) {
        (self.open, self.fresh) = (Some(purpose), true);
        if purpose.saves() && self.text.is_empty() {
            self.text = "project.json".into();
        }
        ctx.request_repaint();
    }

    /// A file that was chosen.
    pub(super) fn chosen(&mut self) -> Option<Chosen> {
        self.chosen.try_recv().ok()
    }

    /// The window with the field.
    pub(super) fn show(&mut self, ctx: &egui::Context) {
        let Some(purpose) = self.open else { return };
        let mut open = true;
        let mut path = None;
        egui::Window::new(purpose.title()).open(&mut open).collapsible(false).resizable(false).show(ctx, |ui| {
            ui.horizontal(|ui| {
                let label = ui.label("Path");
                let field = egui::TextEdit::singleline(&mut self.text).desired_width(420.0);
                let field = ui.add(field).labelled_by(label.id);
                if std::mem::take(&mut self.fresh) {
                    field.request_focus();
                }
                if field.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter)) {
                    path = Some(self.text.clone());
                }
            });
            ui.horizontal(|ui| {
                let word = if purpose.saves() { "Choose" } else { "Open" };
                if ui.button(word).clicked() {
                    path = Some(self.text.clone());
                }
                if ui.button("Browse...").on_hover_text("The dialog of your system").clicked() {
                    browse(purpose, self.sender.clone(), ui.ctx().clone());
                    self.open = None;
                }
                if ui.button("Cancel").clicked() || ui.input(|i| i.key_pressed(egui::Key::Escape)) {
                    self.open = None;
                }
            });
            ui.weak("Files can be dropped onto the window, too.");
        });
        if let Some(path) = path.filter(|p| !p.trim().is_empty()) {
            // The receiver lives as long as this.
            _ = self.sender.send(Ok((purpose, PathBuf::from(path.trim()))));
            self.open = None;
        }
        if !open {
            self.open = None;
        }
    }
}

/// The dialog of the system, waited for in a thread of its own.
fn browse(purpose: Purpose, sender: Sender<Chosen>, ctx: egui::Context) {
    let mut dialog = rfd::AsyncFileDialog::new().set_title(purpose.title());
    if let Purpose::Mesh(_) = purpose {
        dialog = dialog.add_filter("Meshes", &MESHES);
    }
    // Some systems want the dialog made in the thread of the window.
    let file: std::pin::Pin<Box<dyn Future<Output = Option<rfd::FileHandle>> + Send>> =
        if purpose.saves() { Box::pin(dialog.save_file()) } else { Box::pin(dialog.pick_file()) };
    std::thread::spawn(move || {
        if let Some(file) = pollster::block_on(file) {
            // A window that is gone wants no file.
            _ = sender.send(Ok((purpose, file.path().to_path_buf())));
            ctx.request_repaint();
        }
    });
}
