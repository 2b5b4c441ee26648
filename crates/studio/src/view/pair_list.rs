//! The panel beside the viewports: the pairs, what is known of them, and proposals.

use egui::{Color32, RichText};

use super::Studio;
use crate::model::color;
use crate::worker::Request;

/// Pairs that are proposed in all.
const PROPOSED: usize = 32;
/// Places that are suggested.
const SUGGESTED: usize = 5;

impl Studio {
    pub(super) fn transfer_side_panel(&mut self, ui: &mut egui::Ui) {
        egui::Panel::right("transfer panel").default_size(290.0).show(ui, |ui| {
            egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                egui::CollapsingHeader::new("Pairs").default_open(true).show(ui, |ui| self.pairs(ui));
                egui::CollapsingHeader::new("Look").default_open(true).show(ui, |ui| self.look(ui));
                egui::CollapsingHeader::new("How").default_open(false).show(ui, |ui| self.how(ui));
                egui::CollapsingHeader::new("Export").default_open(true).show(ui, |ui| self.export_panel(ui));
            });
        });
    }

    fn pairs(&mut self, ui: &mut egui::Ui) {
        let pairs = &self.history.now().transfer.pairs;
        let count = pairs.complete().len();
        ui.label(match count {
            0 => "No pairs yet: click a place left and the same place right. Begin with hands, feet and the head."
                .to_owned(),
            1 => "1 pair".to_owned(),
            n => format!("{n} pairs"),
        });
        if let Some(result) = self.transfer.result() {
            let text = format!("{:.0} % of the texture vouched for", 100.0 * result.valid);
            ui.label(text).on_hover_text("The rest is doubtful: look at Coverage, and set pairs there");
        }
        ui.horizontal_wrapped(|ui| {
            let ready = self.transfer.shapes_ready();
            let propose = egui::Button::new("Propose pairs");
            let hint = "Finds pairs by the shapes alone, or from those that you have set. They appear as rings: accept or reject them";
            if ui.add_enabled(ready, propose).on_hover_text(hint).clicked() {
                self.worker.send(Request::Propose(PROPOSED.max(count + 12)));
            }
            let suggest = egui::Button::new("Where next?");
            let hint = "Marks the places on the target where the next pairs would help most";
            if ui.add_enabled(ready && count >= 3, suggest).on_hover_text(hint).clicked() {
                self.worker.send(Request::Suggest(SUGGESTED));
            }
        });
        ui.horizontal_wrapped(|ui| {
            let symmetric = self.transfer.is_symmetric();
            let hint = if symmetric {
                "Each new pair is set on both sides of the body at once"
            } else {
                "Only where both shapes are their own mirror images"
            };
            let mirror = egui::Checkbox::new(&mut self.transfer.mirror, "Mirror new pairs");
            ui.add_enabled(symmetric, mirror).on_hover_text(hint).on_disabled_hover_text(hint);
            if ui.add_enabled(symmetric && count > 0, egui::Button::new("Mirror all")).clicked() {
                self.mirror_all();
            }
        });
        self.proposals(ui);
        self.rows(ui);
    }

    fn proposals(&mut self, ui: &mut egui::Ui) {
        let (proposed, suggested) = (self.transfer.proposed.len(), self.transfer.suggested.len());
        if proposed > 0 {
            ui.horizontal(|ui| {
                ui.label(format!("{proposed} proposed"));
                if ui.button("Accept all").clicked() {
                    self.accept_proposed(0..proposed);
                }
                if ui.button("Reject").on_hover_text("Click single rings to accept those alone").clicked() {
                    self.transfer.proposed.clear();
                }
            });
        }
        if suggested > 0 {
            ui.horizontal(|ui| {
                ui.label(format!("{suggested} places marked"));
                if ui.button("Hide").clicked() {
                    self.transfer.suggested.clear();
                }
            });
        }
    }

    /// A row for each pair, the worst first where errors are known.
    fn rows(&mut self, ui: &mut egui::Ui) {
        let view = &self.transfer;
        let pairs = &self.history.now().transfer.pairs;
        let mut rows: Vec<(usize, u64, String, bool)> =
            pairs.list().iter().enumerate().map(|(k, p)| (k, p.id, p.label.clone(), p.both().is_some())).collect();
        let error = |id: &u64| view.left_out.get(id).copied().unwrap_or(0.0);
        rows.sort_by(|a, b| error(&b.1).total_cmp(&error(&a.1)).then(a.0.cmp(&b.0)));
        if !view.left_out.is_empty() {
            ui.weak("Worst first: how far the others would miss each one");
        }
        let (mut chosen, mut removed, mut renamed) = (None, None, None);
        for (k, id, mut name, whole) in rows {
            ui.horizontal(|ui| {
                let wrong = view.wrong.get(&id);
                let [r, g, b] = if wrong.is_some() { color::WRONG } else { color::of_pair(id) };
                let (dot, _) = ui.allocate_exact_size(egui::Vec2::splat(12.0), egui::Sense::hover());
                ui.painter().circle_filled(dot.center(), 5.0, Color32::from_rgb(r, g, b));
                let number = egui::Button::selectable(view.selected == Some(id), (k + 1).to_string());
                let number = ui.add_sized([34.0, 18.0], number);
                if number.on_hover_text(format!("Pair {}: click selects it, Delete removes it", k + 1)).clicked() {
                    chosen = Some(id);
                }
                let field = egui::TextEdit::singleline(&mut name).desired_width(86.0).hint_text("name");
                let field = ui.add(field);
                field.widget_info(|| {
                    egui::WidgetInfo::labeled(egui::Role::TextInput, true, format!("name of pair {}", k + 1))
                });
                if field.changed() {
                    renamed = Some((id, name));
                }
                if !whole {
                    ui.label(RichText::new("one side").italics());
                } else if let Some(left_out) = view.left_out.get(&id) {
                    let text = format!("{:.1} %", 100.0 * left_out);
                    let text = RichText::new(text).color(if wrong.is_some() {
                        Color32::from_rgb(235, 60, 60)
                    } else {
                        ui.visuals().text_color()
                    });
                    ui.label(text).on_hover_text("Of the square root of the source's area");
                }
                if wrong.is_some() {
                    let hint = "The other pairs contradict it: drag it where it belongs, or delete it";
                    ui.label(RichText::new("wrong?").color(Color32::from_rgb(235, 60, 60))).on_hover_text(hint);
                }
                let delete = ui.small_button("x").on_hover_text("Delete this pair");
                delete.widget_info(|| {
                    egui::WidgetInfo::labeled(egui::Role::Button, true, format!("delete pair {}", k + 1))
                });
                if delete.clicked() {
                    removed = Some(id);
                }
            });
        }
        if let Some(id) = chosen {
            self.transfer.selected = Some(id);
            self.look_at(id);
        }
        if let Some((id, name)) = renamed {
            self.history.edit(|d| d.transfer.pairs.rename(id, &name));
        }
        if let Some(id) = removed {
            self.transfer.selected = Some(id);
            self.delete_selected();
        }
    }
}
