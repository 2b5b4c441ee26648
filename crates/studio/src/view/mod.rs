//! The window.

mod bar;
mod dialogs;
mod exports;
mod files;
mod keys;
mod messages;
mod options;
mod pair_list;
mod port;
mod transfer;
mod warp;

use std::path::PathBuf;
use std::time::Instant;

use eframe::egui_wgpu::RenderState;

use crate::draw;
use crate::model::Side;
use crate::model::document::Document;
use crate::model::history::History;
use crate::model::recovery::{self, Recovery};
use crate::worker::{Report, Request, Worker};
use dialogs::Dialogs;
use exports::Exports;
pub use messages::{Messages, Weight};
pub use transfer::{Overlay, TransferView};
pub use warp::WarpView;

/// What the window is for at the moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Workspace {
    /// The texture of one mesh on another.
    #[default]
    Transfer,
    /// A picture in a cage.
    Warp,
}

/// How a studio starts.
#[derive(Clone, Debug, Default)]
pub struct Setup {
    /// Files to open.
    pub files: Vec<PathBuf>,
    /// The program that exports, as [`crate::export`] starts it; this one if not given.
    pub program: Option<PathBuf>,
    /// The folder for recovery files and built-in models; that of the library's cache if not given.
    pub folder: Option<PathBuf>,
}

/// The studio.
pub struct Studio {
    state: RenderState,
    ctx: egui::Context,
    history: History<Document>,
    /// The revision of the document that is in its file.
    saved: u64,
    project: Option<PathBuf>,
    worker: Worker,
    workspace: Workspace,
    transfer: TransferView,
    warp: WarpView,
    messages: Messages,
    /// Whether the worker had nothing to do when its reports were taken.
    at_rest: bool,
    /// What goes on in the background.
    busy: Option<(String, u64, u64)>,
    exports: Exports,
    dialogs: Dialogs,
    folder: Option<PathBuf>,
    recovery: Option<Recovery>,
    /// Files that a crash left.
    left: Vec<PathBuf>,
    /// Whether closing was confirmed.
    closing: bool,
    /// Whether the window asks before it closes.
    asking: bool,
}

impl std::fmt::Debug for Studio {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Studio").field("project", &self.project).field("busy", &self.busy).finish_non_exhaustive()
    }
}

impl Studio {
    /// Makes the window's content.
    ///
    /// # Errors
    /// If the window has no device.
    pub fn new(cc: &eframe::CreationContext<'_>, setup: Setup) -> Result<Self, String> {
        let state = cc.wgpu_render_state.clone().ok_or("the window has no graphics device")?;
        draw::prepare(&state);
        let ctx = cc.egui_ctx.clone();
        ctx.options_mut(|o| o.zoom_with_keyboard = true);
        let cache = barymap::io::Cache::from_environment();
        let folder = setup.folder.or_else(|| cache.folder().map(|f| f.join("studio")));
        let waking = ctx.clone();
        let waking_too = ctx.clone();
        let mut studio = Self {
            worker: Worker::start(move || waking.request_repaint()),
            warp: WarpView::new(move || waking_too.request_repaint()),
            history: History::new(Document::default()),
            saved: 0,
            project: None,
            workspace: Workspace::default(),
            transfer: TransferView::default(),
            messages: Messages::default(),
            at_rest: false,
            busy: None,
            exports: Exports::new(setup.program.or_else(|| std::env::current_exe().ok())),
            dialogs: Dialogs::default(),
            recovery: folder.as_deref().map(Recovery::new),
            left: folder.as_deref().map(recovery::left).unwrap_or_default(),
            folder,
            closing: false,
            asking: false,
            state,
            ctx,
        };
        for path in setup.files {
            studio.open_any(&path, None);
        }
        Ok(studio)
    }

    /// The document.
    pub fn document(&self) -> &Document {
        self.history.now()
    }

    /// Whether all that was asked for is done.
    pub fn is_at_rest(&self) -> bool {
        self.at_rest
    }

    /// Texels along a side of the texture that is exported.
    pub fn set_size(&mut self, size: u32) {
        self.history.edit(|d| d.transfer.options.size = size);
    }

    /// Saves the project.
    pub fn save_project(&mut self, path: &std::path::Path) {
        self.save_as(path);
    }

    /// The arguments of `barymap` that write the textured target as `model`, from pairs that are in
    /// a file; none without both meshes.
    pub fn transfer_command(&self, model: &std::path::Path, pairs: &std::path::Path) -> Option<Vec<String>> {
        let outputs = crate::model::command::Outputs { pairs, model, texture: None, coverage: None };
        crate::model::command::transfer(&self.history.now().transfer, &outputs)
    }

    /// The transfer workspace, for cameras.
    pub fn transfer_mut(&mut self) -> &mut TransferView {
        &mut self.transfer
    }

    /// What the transfer workspace has.
    pub fn transfer(&self) -> &TransferView {
        &self.transfer
    }

    /// What the warp workspace has.
    pub fn warp(&self) -> &WarpView {
        &self.warp
    }

    /// What the user was told.
    pub fn messages(&self) -> &Messages {
        &self.messages
    }

    /// What goes on in the background, if anything does.
    pub fn busy(&self) -> Option<&str> {
        self.busy.as_ref().map(|b| b.0.as_str())
    }

    /// Whether the document differs from its file.
    pub fn is_changed(&self) -> bool {
        self.history.revision() != self.saved
    }

    /// Takes what the worker did.
    fn listen(&mut self) {
        self.at_rest = self.worker.is_at_rest();
        for report in self.worker.take() {
            match report {
                Report::Opened(side, shape) => self.opened(side, shape),
                Report::Drawn(side, drawn) => {
                    draw::set_shape(&self.state, side, &drawn);
                    self.transfer.drawn[side.index()] = true;
                }
                Report::Shown(shown) => {
                    draw::set_picture(&self.state, Side::Target, &shown.picture, &shown.coverage);
                    self.transfer.show(shown);
                }
                Report::Nothing(why) => {
                    draw::drop_picture(&self.state, Side::Target);
                    self.transfer.forget_result(why);
                }
                Report::Confidence(trust) => {
                    let colors: Vec<_> = trust.iter().map(|&x| crate::model::color::of_confidence(x)).collect();
                    draw::set_colors(&self.state, Side::Target, &colors);
                    self.transfer.has_confidence = true;
                }
                Report::Guess(from, point) => self.guessed(&from, point),
                Report::Read(pairs) => self.read_pairs(pairs),
                Report::Busy(what, done, total) => self.busy = Some((what, done, total)),
                Report::Idle => self.busy = None,
                Report::Unopened(side, path, why) => {
                    let opening = &mut self.transfer.opening[side.index()];
                    opening.take_if(|p| *p == path);
                    self.messages.tell(Weight::Failed, why);
                }
                Report::NoTexture(path, why) => {
                    self.transfer.asked.texture = None;
                    self.history.edit(|d| d.transfer.texture.take_if(|p| *p == path));
                    self.messages.tell(Weight::Failed, why);
                }
                Report::Note(text) => self.messages.tell(Weight::Note, text),
                Report::Failed(text) => {
                    self.busy = None;
                    self.messages.tell(Weight::Failed, text);
                }
                other => {
                    if let Some(note) = self.transfer.listen(other) {
                        self.messages.tell(Weight::Note, note);
                    }
                }
            }
        }
        if self.worker.has_failed() {
            let waking = self.ctx.clone();
            self.worker = Worker::start(move || waking.request_repaint());
            self.transfer.asked = Default::default();
            let what = "The background work ended by a fault of the program. It was started again; save your work";
            self.messages.tell(Weight::Failed, what);
        }
    }

    /// Tells the worker what the document wants.
    fn ask(&mut self) {
        let document = &self.history.now().transfer;
        let asked = &mut self.transfer.asked;
        let mut closed = Vec::new();
        for side in Side::BOTH {
            let file = document.file(side);
            if file != asked.files[side.index()].as_ref() {
                asked.files[side.index()] = file.cloned();
                if side == Side::Source {
                    asked.texture = None;
                }
                if side == Side::Target {
                    asked.unwrap = false;
                }
                match file {
                    Some(path) => self.worker.send(Request::Open(side, path.clone())),
                    None => closed.push(side),
                }
            }
        }
        if document.texture != asked.texture {
            asked.texture.clone_from(&document.texture);
            self.worker.send(Request::Texture(document.texture.clone()));
        }
        if document.options.unwrap != asked.unwrap {
            asked.unwrap = document.options.unwrap;
            self.worker.send(Request::Unwrap(asked.unwrap));
        }
        let method = document.options.method;
        if asked.method.replace(method) != Some(method) {
            self.worker.send(Request::Method(method));
        }
        let pairs = (document.pairs.complete(), self.history.in_gesture());
        if asked.pairs.as_ref() != Some(&pairs) {
            asked.pairs = Some(pairs.clone());
            self.worker.send(Request::Pairs(pairs.0, pairs.1));
        }
        closed.into_iter().for_each(|side| self.transfer.close(side));
    }

    /// Writes what a crash would lose.
    fn keep(&mut self) {
        let (revision, changed) = (self.history.revision(), self.is_changed());
        let Some(recovery) = self.recovery.as_mut().filter(|_| changed) else { return };
        match recovery.keep(self.history.now(), revision, Instant::now()) {
            Ok(_) => self.ctx.request_repaint_after(recovery::EVERY),
            Err(error) => {
                self.recovery = None;
                self.messages.tell(Weight::Failed, error.to_string());
            }
        }
    }
}

impl eframe::App for Studio {
    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        self.listen();
        self.dropped(ui);
        self.chosen();
        self.keys(ui);
        self.bars(ui);
        match self.workspace {
            Workspace::Transfer => self.transfer_workspace(ui),
            Workspace::Warp => self.warp_workspace(ui),
        }
        self.overwriting(ui);
        self.ask();
        self.exports_ended();
        self.keep();
        self.close_requested(ui);
    }
}

impl Drop for Studio {
    fn drop(&mut self) {
        // A regular end, saved or thrown away by the user's own decision.
        if let Some(recovery) = &mut self.recovery {
            recovery.forget();
        }
    }
}
