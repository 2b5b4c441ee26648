//! How the shapes look, and how the texture is carried.

use barymap::surface::correspondence::Method;
use barymap::tools::transfer::Fill;

use super::Studio;
use super::transfer::Overlay;
use crate::model::Side;
use crate::worker::Request;

const METHODS: [(Method, &str, &str); 5] = [
    (Method::Field, "Field", "The most accurate; follows while you drag"),
    (Method::Transport, "Transport", "Weighted averages, with what is left over carried along"),
    (Method::Averages, "Averages", "Weighted averages, as published"),
    (Method::Rbf, "Radial functions", "Fast, for shapes in the same pose"),
    (Method::Closest, "Closest point", "For shapes that lie on one another"),
];

const FILLS: [(Fill, &str); 4] = [
    (Fill::None, "Nothing"),
    (Fill::PullPush, "Averages of what is around"),
    (Fill::Smooth, "A smooth surface"),
    (Fill::Nearest, "The nearest colour"),
];

/// Sides of the texture at rest.
const SIZES: [u32; 4] = [512, 1024, 2048, 4096];

impl Studio {
    pub(super) fn look(&mut self, ui: &mut egui::Ui) {
        let view = &mut self.transfer;
        ui.horizontal_wrapped(|ui| {
            for (overlay, word, hint) in Overlay::ALL {
                ui.selectable_value(&mut view.overlay, overlay, word).on_hover_text(hint);
            }
        });
        ui.horizontal_wrapped(|ui| {
            ui.checkbox(&mut view.wireframe, "Edges").on_hover_text("W");
            ui.checkbox(&mut view.checker, "Checker on the source");
            ui.checkbox(&mut view.labels, "Numbers");
            ui.checkbox(&mut view.linked, "Turn together").on_hover_text("L: both shapes turn with one another");
        });
        let mut frame = false;
        ui.horizontal(|ui| {
            ui.label("Up:");
            for side in Side::BOTH {
                let camera = view.camera_mut(side);
                let z = camera.up == barymap::geometry::UpAxis::Z;
                let text = format!("{} {}", side.word(), if z { "z" } else { "y" });
                if ui.button(text).on_hover_text("Which axis of the file points up").clicked() {
                    camera.up = if z { barymap::geometry::UpAxis::Y } else { barymap::geometry::UpAxis::Z };
                }
            }
            frame = ui.button("Frame").on_hover_text("F: shows the whole of both").clicked();
        });
        if frame {
            self.frame_shapes();
        }
    }

    pub(super) fn how(&mut self, ui: &mut egui::Ui) {
        let mut options = self.history.now().transfer.options.clone();
        let word = METHODS.iter().find(|m| m.0 == options.method).map_or("", |m| m.1);
        egui::ComboBox::from_label("Method").selected_text(word).show_ui(ui, |ui| {
            for (method, word, hint) in METHODS {
                ui.selectable_value(&mut options.method, method, word).on_hover_text(hint);
            }
        });
        let word = FILLS.iter().find(|f| f.0 == options.fill).map_or("", |f| f.1);
        egui::ComboBox::from_label("Holes get").selected_text(word).show_ui(ui, |ui| {
            for (fill, word) in FILLS {
                ui.selectable_value(&mut options.fill, fill, word);
            }
        });
        let hint = "For a target without, or whose own ones overlap";
        ui.checkbox(&mut options.unwrap, "Make texture coordinates").on_hover_text(hint);
        let mut size = self.transfer.rest_size;
        egui::ComboBox::from_label("Size in this window").selected_text(size.to_string()).show_ui(ui, |ui| {
            for s in SIZES {
                ui.selectable_value(&mut size, s, s.to_string());
            }
        });
        if size != self.transfer.rest_size {
            self.transfer.rest_size = size;
            self.worker.send(Request::Size(size));
        }
        if options != self.history.now().transfer.options {
            self.history.edit(|d| d.transfer.options = options);
        }
    }
}
