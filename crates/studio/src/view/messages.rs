//! What the user was told, newest last.

use std::collections::VecDeque;

/// Messages kept at most.
const MOST: usize = 200;

/// How important a message is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weight {
    /// Good to know.
    Note,
    /// Something was done.
    Done,
    /// Something failed.
    Failed,
}

/// Messages.
#[derive(Debug, Default)]
pub struct Messages {
    list: VecDeque<(Weight, String)>,
    total: u64,
    /// Whether all are shown.
    pub(super) open: bool,
}

impl Messages {
    /// Adds one; the same as the last one is told once.
    pub fn tell(&mut self, weight: Weight, text: impl Into<String>) {
        let text = text.into();
        if self.list.back().is_some_and(|last| last.1 == text) {
            return;
        }
        self.total += 1;
        self.list.push_back((weight, text));
        if self.list.len() > MOST {
            self.list.pop_front();
        }
    }

    /// All of them.
    pub fn list(&self) -> impl DoubleEndedIterator<Item = &(Weight, String)> {
        self.list.iter()
    }

    /// How many there were so far.
    pub fn total(&self) -> u64 {
        self.total
    }

    /// The last one.
    pub fn last(&self) -> Option<&(Weight, String)> {
        self.list.back()
    }

    /// The last one and the list of all, as a line of the window.
    pub(super) fn show(&mut self, ui: &mut egui::Ui) {
        let color = |weight, ui: &egui::Ui| match weight {
            Weight::Note => ui.visuals().text_color(),
            Weight::Done => egui::Color32::from_rgb(60, 160, 80),
            Weight::Failed => ui.visuals().error_fg_color,
        };
        if let Some((weight, text)) = self.list.back() {
            let label = egui::Label::new(egui::RichText::new(text).color(color(*weight, ui))).truncate();
            let response = ui.add(label.sense(egui::Sense::click())).on_hover_text(text);
            if response.clicked() {
                self.open = !self.open;
            }
        }
        let ctx = ui.ctx().clone();
        let mut open = self.open;
        egui::Window::new("Messages").open(&mut open).default_size([560.0, 240.0]).show(&ctx, |ui| {
            egui::ScrollArea::vertical().stick_to_bottom(true).auto_shrink(false).show(ui, |ui| {
                for (weight, text) in &self.list {
                    ui.label(egui::RichText::new(text).color(color(*weight, ui)));
                }
            });
        });
        self.open = open;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeated_messages_are_told_once_and_old_ones_go() {
        let mut messages = Messages::default();
        (0..3).for_each(|_| messages.tell(Weight::Failed, "same"));
        assert_eq!(messages.list().count(), 1);
        (0..2 * MOST).for_each(|k| messages.tell(Weight::Note, k.to_string()));
        assert_eq!((messages.list().count(), messages.last().unwrap().1.as_str()), (MOST, "399"));
    }
}
