//! Menus, the status line, help, and what is asked before the window closes.

use super::dialogs::Purpose;
use super::{Studio, Workspace, keys};
use crate::model::Side;
use crate::worker::Request;

impl Studio {
    pub(super) fn bars(&mut self, ui: &mut egui::Ui) {
        egui::Panel::top("menu").show(ui, |ui| {
            egui::MenuBar::new().ui(ui, |ui| {
                ui.menu_button("File", |ui| self.file_menu(ui));
                ui.menu_button("View", Self::theme_menu);
                ui.menu_button("Help", |ui| self.help_menu(ui));
                ui.separator();
                ui.selectable_value(&mut self.workspace, Workspace::Transfer, "Transfer")
                    .on_hover_text("The texture of one mesh on another. Ctrl 1");
                ui.selectable_value(&mut self.workspace, Workspace::Warp, "Warp")
                    .on_hover_text("A picture in a cage. Ctrl 2");
                ui.separator();
                if ui.add_enabled(self.history.can_undo(), egui::Button::new("Undo")).on_hover_text("Ctrl Z").clicked()
                {
                    self.undo();
                }
                if ui
                    .add_enabled(self.history.can_redo(), egui::Button::new("Redo"))
                    .on_hover_text("Ctrl Shift Z")
                    .clicked()
                {
                    self.redo();
                }
                ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                    let name = self.project.as_ref().and_then(|p| p.file_name());
                    let name = name.map_or("not saved yet".into(), |n| n.to_string_lossy().into_owned());
                    ui.weak(if self.is_changed() { format!("{name} *") } else { name });
                });
            });
        });
        self.left_bar(ui);
        egui::Panel::bottom("status").show(ui, |ui| {
            ui.horizontal(|ui| {
                if let Some((what, done, total)) = &self.busy {
                    ui.spinner();
                    if ui.button("Cancel").on_hover_text("Ends what goes on in the background").clicked() {
                        self.worker.send(Request::Cancel);
                    }
                    let part =
                        if *total > 0 { format!(" {} %", 100 * (*done).min(*total) / total) } else { String::new() };
                    ui.label(format!("{what}{part}"));
                    ui.separator();
                }
                if let Some(shown) = self.transfer.result() {
                    let size = shown.picture.width;
                    let text = format!("{size} x {size}, {:.0} ms", shown.milliseconds);
                    ui.weak(text).on_hover_text("Size of the texture shown, and the time from your last change to it");
                    ui.separator();
                }
                self.messages.show(ui);
            });
        });
        let ctx = ui.ctx().clone();
        self.dialogs.show(&ctx);
        self.help(&ctx);
    }

    fn file_menu(&mut self, ui: &mut egui::Ui) {
        let ctx = ui.ctx().clone();
        let items = [
            ("Open...  Ctrl O", Purpose::Any),
            ("Open source mesh...", Purpose::Mesh(Side::Source)),
            ("Open target mesh...", Purpose::Mesh(Side::Target)),
            ("Texture for the source...", Purpose::Texture),
            ("Read pairs...", Purpose::Pairs),
            ("Open picture to warp...", Purpose::Picture),
        ];
        for (text, purpose) in items {
            if ui.button(text).clicked() {
                self.dialogs.ask(&ctx, purpose);
                ui.close();
            }
        }
        ui.separator();
        if ui.button("Built-in characters").on_hover_text("Two models to try things on").clicked() {
            self.open_built_in();
            ui.close();
        }
        ui.separator();
        if ui.button("Save project  Ctrl S").clicked() {
            self.save();
            ui.close();
        }
        if ui.button("Save project as...").clicked() {
            self.dialogs.ask(&ctx, Purpose::SaveProject);
            ui.close();
        }
        ui.separator();
        if ui.button("Quit").clicked() {
            ctx.send_viewport_cmd(egui::ViewportCommand::Close);
            ui.close();
        }
    }

    fn theme_menu(ui: &mut egui::Ui) {
        use egui::ThemePreference::{Dark, Light, System};
        let mut theme = ui.ctx().options(|o| o.theme_preference);
        for (one, word) in [(Light, "Light"), (Dark, "Dark"), (System, "As the system")] {
            if ui.radio_value(&mut theme, one, word).clicked() {
                ui.ctx().set_theme(theme);
                ui.close();
            }
        }
    }

    fn help_menu(&mut self, ui: &mut egui::Ui) {
        if ui.button("Keys and mouse  F1").clicked() {
            self.transfer.help = true;
            ui.close();
        }
        if ui.button("Messages").clicked() {
            self.messages.open = true;
            ui.close();
        }
    }

    fn help(&mut self, ctx: &egui::Context) {
        let mut open = self.transfer.help;
        egui::Window::new("Keys and mouse").open(&mut open).collapsible(false).show(ctx, |ui| {
            egui::Grid::new("keys").num_columns(2).spacing([18.0, 6.0]).striped(true).show(ui, |ui| {
                for (key, what) in keys::HELP {
                    ui.strong(key);
                    ui.label(what);
                    ui.end_row();
                }
            });
        });
        self.transfer.help = open;
    }

    /// The bar that offers what a crash left.
    fn left_bar(&mut self, ui: &mut egui::Ui) {
        let Some(path) = self.left.first().cloned() else { return };
        egui::Panel::top("left").show(ui, |ui| {
            ui.horizontal(|ui| {
                ui.label("There is work that was not saved before the studio ended last time.");
                if ui.button("Bring it back").clicked() {
                    self.recover(&path);
                }
                if ui.button("Throw it away").clicked() {
                    self.drop_left(&path);
                }
            });
        });
    }

    /// Closing with work that is not saved is asked about.
    pub(super) fn close_requested(&mut self, ui: &egui::Ui) {
        let ctx = ui.ctx();
        if ctx.input(|i| i.viewport().close_requested()) && self.is_changed() && !self.closing {
            ctx.send_viewport_cmd(egui::ViewportCommand::CancelClose);
            self.asking = true;
        }
        if !self.asking {
            return;
        }
        let mut answer = None;
        egui::Modal::new(egui::Id::unique("close")).show(ctx, |ui| {
            ui.heading("Close without saving?");
            ui.horizontal(|ui| {
                if ui.button("Save").clicked() {
                    answer = Some(Some(true));
                }
                if ui.button("Close without saving").clicked() {
                    answer = Some(Some(false));
                }
                if ui.button("Stay").clicked() || ui.input(|i| i.key_pressed(egui::Key::Escape)) {
                    answer = Some(None);
                }
            });
        });
        match answer {
            None => return,
            Some(Some(true)) => self.save(),
            Some(Some(false)) => {
                self.closing = true;
                ctx.send_viewport_cmd(egui::ViewportCommand::Close);
            }
            Some(None) => (),
        }
        self.asking = false;
    }
}
