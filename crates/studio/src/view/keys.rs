//! The keyboard.

use egui::{Key, KeyboardShortcut, Modifiers};

use super::dialogs::Purpose;
use super::{Studio, Workspace};
use crate::model::Side;

/// A half turn has so many presses of an arrow.
const TURN: f64 = 1.0 / 24.0;

/// Keys and what they do, for the help.
pub(super) const HELP: [(&str, &str); 17] = [
    ("Left click", "sets a point on the surface; the next click on the other side completes the pair"),
    ("Enter", "takes the partner that the program proposes (yellow ring)"),
    ("Left drag on a point", "moves it along the surface"),
    ("Left drag elsewhere, arrows", "turns"),
    ("Right or middle drag, Shift and left drag", "moves the view"),
    ("Wheel, + and -", "nearer and farther"),
    ("F", "shows the whole"),
    ("Delete", "removes the selected pair (or vertex)"),
    ("Escape", "drops the half pair; selects nothing"),
    ("N and P", "the next and the previous pair"),
    ("Ctrl Z, Ctrl Shift Z", "undo, redo"),
    ("Ctrl O, Ctrl S", "open, save the project"),
    ("Ctrl E", "export"),
    ("W, L, M", "edges; turn together; mirror new pairs"),
    ("1 to 5", "result, coverage, confidence, checker, grey"),
    ("Ctrl 1, Ctrl 2", "Transfer, Warp"),
    ("F1", "this list"),
];

impl Studio {
    /// Does what keys ask for, unless a field has them.
    pub(super) fn keys(&mut self, ui: &egui::Ui) {
        let ctx = ui.ctx().clone();
        let press = |modifiers, key| ctx.input_mut(|i| i.consume_shortcut(&KeyboardShortcut::new(modifiers, key)));
        if press(Modifiers::NONE, Key::F1) {
            self.messages.open = false;
            self.transfer.help = !self.transfer.help;
        }
        let command = Modifiers::COMMAND;
        if press(command, Key::Num1) {
            self.workspace = Workspace::Transfer;
        }
        if press(command, Key::Num2) {
            self.workspace = Workspace::Warp;
        }
        if press(command, Key::O) {
            self.dialogs.ask(&ctx, Purpose::Any);
        }
        if press(command, Key::S) {
            self.save();
        }
        if press(command, Key::E) {
            self.transfer.wants_export = true;
        }
        if ctx.text_edit_focused() {
            return;
        }
        if press(command | Modifiers::SHIFT, Key::Z) || press(command, Key::Y) {
            self.redo();
        }
        if press(command, Key::Z) {
            self.undo();
        }
        match self.workspace {
            Workspace::Transfer => self.transfer_keys(&press),
            Workspace::Warp => self.warp_keys(&press),
        }
    }

    fn transfer_keys(&mut self, press: &dyn Fn(Modifiers, Key) -> bool) {
        let plain = |key| press(Modifiers::NONE, key);
        if plain(Key::Enter) {
            self.accept_guess();
        }
        if plain(Key::Delete) || plain(Key::Backspace) {
            self.delete_selected();
        }
        if plain(Key::Escape) {
            self.history.edit(|d| d.transfer.pairs.drop_open());
            self.transfer.selected = None;
        }
        if plain(Key::F) {
            self.frame_shapes();
        }
        let view = &mut self.transfer;
        for (key, flag) in [(Key::W, &mut view.wireframe), (Key::L, &mut view.linked)] {
            if plain(key) {
                *flag = !*flag;
            }
        }
        if plain(Key::M) && view.is_symmetric() {
            view.mirror = !view.mirror;
        }
        let digits = [Key::Num1, Key::Num2, Key::Num3, Key::Num4, Key::Num5];
        for (key, (overlay, _, _)) in digits.into_iter().zip(super::transfer::Overlay::ALL) {
            if plain(key) {
                view.overlay = overlay;
            }
        }
        let arrows = [
            (Key::ArrowLeft, [-TURN, 0.0]),
            (Key::ArrowRight, [TURN, 0.0]),
            (Key::ArrowUp, [0.0, -TURN]),
            (Key::ArrowDown, [0.0, TURN]),
        ];
        for (key, by) in arrows {
            if plain(key) {
                Side::BOTH.into_iter().for_each(|s| view.camera_mut(s).orbit(by.into()));
            }
        }
        for (keys, factor) in [([Key::Plus, Key::Equals], 0.85), ([Key::Minus, Key::Minus], 1.0 / 0.85)] {
            if keys.into_iter().any(plain) {
                Side::BOTH.into_iter().for_each(|s| view.camera_mut(s).zoom(factor, glam::DVec2::ZERO, 1.0));
            }
        }
        for (key, step) in [(Key::N, 1), (Key::P, -1)] {
            if plain(key) {
                self.select_beside(step);
            }
        }
    }

    /// Selects the pair that comes so many places after the selected one, and looks at it.
    fn select_beside(&mut self, step: isize) {
        let pairs = &self.history.now().transfer.pairs;
        let count = pairs.list().len() as isize;
        if count == 0 {
            return;
        }
        let at = self.transfer.selected.and_then(|id| pairs.position(id)).map_or(-step.min(0), |k| k as isize + step);
        let id = pairs.list()[at.rem_euclid(count) as usize].id;
        self.transfer.selected = Some(id);
        self.look_at(id);
    }

    /// Goes back by one edit.
    pub(super) fn undo(&mut self) {
        self.history.undo();
        self.transfer.forget_guess();
    }

    /// Takes back an undo.
    pub(super) fn redo(&mut self) {
        self.history.redo();
        self.transfer.forget_guess();
    }
}
