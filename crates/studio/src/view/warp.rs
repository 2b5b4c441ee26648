//! The warp workspace: a picture, and the cage around it.

use std::path::{Path, PathBuf};

use egui::{Align2, Color32, FontId, Key, Modifiers, PointerButton, Pos2, Rect, Role, Sense, Stroke, Vec2};
use glam::DVec2;

use super::dialogs::Purpose;
use super::exports::Beside;
use super::{Studio, Weight};
use crate::model::cage::{Loop, Stage, VertexId};
use crate::model::{command, project};
use crate::worker::Rgba;
use crate::worker::warp::{WarpReport, WarpRequest, WarpState, WarpWorker};

/// A vertex is caught this near to it, in points of the window.
const REACH: f32 = 10.0;
/// How much of the workspace the picture fills.
const ROOM: f32 = 0.86;

/// The state of the workspace that is no part of the document.
#[derive(Debug)]
pub struct WarpView {
    worker: WarpWorker,
    /// The picture that is there, and its size.
    opened: Option<(PathBuf, [u32; 2])>,
    opening: Option<PathBuf>,
    original: Option<Picture>,
    warped: Option<Picture>,
    heat: Option<Picture>,
    state: Option<WarpState>,
    /// Pictures that came.
    updates: u64,
    failed: Option<String>,
    stage: Stage,
    selected: Vec<VertexId>,
    dragging: bool,
    /// The part of the picture, from the left, that is shown as it was.
    before: f32,
    show_heat: bool,
    asked: Option<(Vec<Loop>, bool, bool)>,
    rect: Rect,
}

/// A picture on the device of the window.
struct Picture(egui::TextureHandle);

impl std::fmt::Debug for Picture {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Picture").field(&self.0.size()).finish()
    }
}

impl Picture {
    /// Brings a picture to the device; one of the same size is written over.
    fn put(place: &mut Option<Self>, ctx: &egui::Context, name: &str, picture: &Rgba) {
        let size = [picture.width as usize, picture.height as usize];
        let image = egui::ColorImage::from_rgba_unmultiplied(size, &picture.bytes);
        match place {
            Some(old) if old.0.size() == size => old.0.set(image, egui::TextureOptions::LINEAR),
            _ => *place = Some(Self(ctx.load_texture(name, image, egui::TextureOptions::LINEAR))),
        }
    }
}

impl WarpView {
    pub(super) fn new(wake: impl Fn() + Send + 'static) -> Self {
        Self {
            worker: WarpWorker::start(wake),
            opened: None,
            opening: None,
            original: None,
            warped: None,
            heat: None,
            state: None,
            updates: 0,
            failed: None,
            stage: Stage::Drag,
            selected: Vec::new(),
            dragging: false,
            before: 0.0,
            show_heat: false,
            asked: None,
            rect: Rect::NOTHING,
        }
    }

    /// What the map is like.
    pub fn state(&self) -> Option<&WarpState> {
        self.state.as_ref()
    }

    /// Why there is no map, if there is none.
    pub fn failed(&self) -> Option<&str> {
        self.failed.as_deref()
    }

    /// Whether the Jacobian is there to be shown.
    pub fn has_heat(&self) -> bool {
        self.heat.is_some()
    }

    /// Warped pictures that came so far.
    pub fn updates(&self) -> u64 {
        self.updates
    }

    /// Pixels of the picture for a point of the window.
    fn scale(&self) -> f64 {
        let width = self.opened.as_ref().map_or(1, |o| o.1[0]);
        f64::from(width) / f64::from(self.rect.width().max(1.0))
    }

    /// Where a pixel is in the window.
    pub fn place(&self, p: DVec2) -> Pos2 {
        let at = p / self.scale();
        self.rect.min + Vec2::new(at.x as f32, at.y as f32)
    }

    fn pixel(&self, p: Pos2) -> DVec2 {
        let d = p - self.rect.min;
        DVec2::new(f64::from(d.x), f64::from(d.y)) * self.scale()
    }
}

impl Studio {
    /// Opens a picture: once it is read, the document has it.
    pub(super) fn open_picture(&mut self, path: PathBuf) {
        self.workspace = super::Workspace::Warp;
        self.warp.opening = Some(path.clone());
        self.warp.worker.send(WarpRequest::Open(path));
    }

    fn listen_to_warp(&mut self) {
        for report in self.warp.worker.take() {
            let view = &mut self.warp;
            match report {
                WarpReport::Opened(path, size, shown) => {
                    Picture::put(&mut view.original, &self.ctx, "picture", &shown);
                    (view.warped, view.heat, view.state, view.asked) = (None, None, None, None);
                    view.opened = Some((path.clone(), size));
                    view.opening = None;
                    if self.history.now().warp.picture.as_ref() != Some(&path) {
                        self.history.edit(|d| {
                            d.warp.picture = Some(path);
                            d.warp.rectangle(size.map(f64::from), 3);
                        });
                    }
                }
                WarpReport::Warped(picture, state) => {
                    Picture::put(&mut view.warped, &self.ctx, "warped", &picture);
                    (view.state, view.failed) = (Some(state), None);
                    view.updates += 1;
                }
                WarpReport::Heat(picture) => Picture::put(&mut view.heat, &self.ctx, "heat", &picture),
                WarpReport::Failed(why) => {
                    view.opening = None;
                    if view.opened.is_none() || view.dragging {
                        view.failed = Some(why);
                    } else {
                        view.failed = Some(why.clone());
                        self.messages.tell(Weight::Failed, why);
                    }
                }
            }
        }
    }

    fn ask_warp(&mut self) {
        let document = &self.history.now().warp;
        let view = &mut self.warp;
        let there = view.opened.as_ref().map(|o| &o.0);
        if document.picture.as_ref() != there {
            if let Some(path) = document.picture.clone()
                && view.opening.as_ref() != Some(&path)
            {
                view.opening = Some(path.clone());
                view.worker.send(WarpRequest::Open(path));
            }
            return;
        }
        let wanted = (document.loops.clone(), view.dragging, view.show_heat);
        if there.is_some() && view.asked.as_ref() != Some(&wanted) {
            view.asked = Some(wanted.clone());
            view.worker.send(WarpRequest::Cage(wanted.0, wanted.1, wanted.2));
        }
    }

    pub(super) fn warp_workspace(&mut self, ui: &mut egui::Ui) {
        self.listen_to_warp();
        self.warp_side_panel(ui);
        egui::CentralPanel::default().show(ui, |ui| {
            let whole = ui.max_rect();
            let Some((_, size)) = self.warp.opened.clone() else {
                let text = match &self.warp.opening {
                    Some(path) => format!("Opening {} ...", path.display()),
                    None => "Drop a picture here\nor File, Open picture to warp".to_owned(),
                };
                let color = ui.visuals().text_color();
                ui.painter().text(whole.center(), Align2::CENTER_CENTER, text, FontId::proportional(17.0), color);
                return;
            };
            let [w, h] = size.map(|s| s as f32);
            let scale = ROOM * (whole.width() / w).min(whole.height() / h);
            self.warp.rect = Rect::from_center_size(whole.center(), Vec2::new(w, h) * scale);
            let response = ui.interact(whole, ui.scope_id().with("cage"), Sense::click_and_drag());
            response.widget_info(|| egui::WidgetInfo::labeled(Role::Canvas, true, "picture and cage"));
            self.warp_mouse(&response);
            self.paint_warp(&ui.painter_at(whole), &response);
        });
        self.ask_warp();
    }

    fn warp_mouse(&mut self, response: &egui::Response) {
        let (reach, stage) = (f64::from(REACH) * self.warp.scale(), self.warp.stage);
        let nearest = |s: &Self, at: Pos2| s.history.now().warp.nearest(s.warp.pixel(at), reach, stage);
        if response.drag_started_by(PointerButton::Primary)
            && let Some(at) = response.ctx.input(|i| i.pointer.press_origin())
        {
            let hit = nearest(self, at);
            let document = &self.history.now().warp;
            // An edge is dragged by both of its vertices.
            let edge = document.nearest_edge(self.warp.pixel(at), reach, stage).map(|(id, _)| {
                let n = document.loops[id.0].source.len();
                vec![id, (id.0, (id.1 + 1) % n)]
            });
            let caught = hit.map(|id| vec![id]).or(edge);
            if let Some(caught) = caught {
                if !caught.iter().all(|id| self.warp.selected.contains(id)) {
                    self.warp.selected = caught;
                }
                self.warp.dragging = true;
                self.history.begin();
            }
        }
        if self.warp.dragging {
            let delta = response.drag_delta();
            let by = DVec2::new(f64::from(delta.x), f64::from(delta.y)) * self.warp.scale();
            let selected = self.warp.selected.clone();
            if by != DVec2::ZERO {
                self.history.edit(|d| selected.iter().for_each(|id| d.warp.move_by(*id, by, stage)));
            }
            if response.drag_stopped() || !response.dragged() {
                self.warp.dragging = false;
                self.history.end();
            }
        }
        if response.clicked()
            && let Some(at) = response.interact_pointer_pos()
        {
            let more = response.ctx.input(|i| i.modifiers.shift);
            match nearest(self, at) {
                Some(id) if more => match self.warp.selected.iter().position(|s| *s == id) {
                    Some(k) => _ = self.warp.selected.remove(k),
                    None => self.warp.selected.push(id),
                },
                Some(id) => self.warp.selected = vec![id],
                None => self.warp.selected.clear(),
            }
        }
        if response.double_clicked()
            && let Some(at) = response.interact_pointer_pos()
            && let Some((edge, t)) = self.history.now().warp.nearest_edge(self.warp.pixel(at), reach, stage)
        {
            let new = self.history.edit(|d| d.warp.insert(edge, t));
            self.warp.selected = new.into_iter().collect();
        }
    }

    fn paint_warp(&self, painter: &egui::Painter, response: &egui::Response) {
        let view = &self.warp;
        let rect = view.rect;
        let white = Color32::WHITE;
        let uv = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0));
        let (shown, drawn) = match view.stage {
            Stage::Draw => (&view.original, &view.original),
            Stage::Drag => {
                (if view.show_heat && view.heat.is_some() { &view.heat } else { &view.warped }, &view.original)
            }
        };
        if let Some(picture) = shown.as_ref().or(drawn.as_ref()) {
            // The heat map has its scale on the right.
            let wide = picture.0.size()[0] as f32 / picture.0.size()[1] as f32 * rect.height();
            painter.image(picture.0.id(), Rect::from_min_size(rect.min, Vec2::new(wide, rect.height())), uv, white);
        }
        if let (true, Some(picture)) = (view.before > 0.0 && view.stage == Stage::Drag, &view.original) {
            let x = rect.min.x + view.before * rect.width();
            let part = Rect::from_min_max(rect.min, Pos2::new(x, rect.max.y));
            painter.image(picture.0.id(), part, Rect::from_min_max(Pos2::ZERO, Pos2::new(view.before, 1.0)), white);
            painter.vline(x, rect.y_range(), Stroke::new(2.0, white));
        }
        let folds = view.state.is_some_and(|s| s.folds) || view.failed.is_some();
        let line = match (folds, view.stage) {
            (true, _) => Color32::from_rgb(240, 50, 50),
            (false, Stage::Draw) => Color32::from_rgb(70, 120, 255),
            (false, Stage::Drag) => Color32::from_rgb(255, 150, 40),
        };
        for (l, one) in self.history.now().warp.loops.iter().enumerate() {
            let points = if view.stage == Stage::Draw { &one.source } else { &one.target };
            let places: Vec<Pos2> = points.iter().map(|p| view.place(*p)).collect();
            painter.add(egui::Shape::closed_line(places.clone(), Stroke::new(4.0, Color32::from_black_alpha(110))));
            painter.add(egui::Shape::closed_line(places.clone(), Stroke::new(2.0, line)));
            for (v, at) in places.into_iter().enumerate() {
                let near = response.hover_pos().is_some_and(|h| h.distance(at) <= REACH);
                let radius = if near { 7.0 } else { 5.0 };
                painter.circle(at, radius, line, Stroke::new(1.5, Color32::from_black_alpha(200)));
                if view.selected.contains(&(l, v)) {
                    painter.circle_stroke(at, radius + 2.5, Stroke::new(2.0, white));
                }
            }
        }
        let dark = painter.ctx().global_style().visuals.dark_mode;
        let ink = if dark { Color32::from_gray(220) } else { Color32::from_gray(40) };
        let hint = match (view.stage, self.history.now().warp.loops.is_empty()) {
            (_, true) => "Make a cage: a rectangle, on the right",
            (Stage::Draw, _) => {
                "The cage on the picture: drag vertices, double-click an edge for a new one, Delete removes one"
            }
            (Stage::Drag, _) => {
                "Drag vertices or edges to where they go; Shift and click selects several; double-click an edge for a new vertex"
            }
        };
        let at = painter.clip_rect().center_bottom() - Vec2::new(0.0, 8.0);
        painter.text(at, Align2::CENTER_BOTTOM, hint, FontId::proportional(13.0), ink);
    }

    fn warp_side_panel(&mut self, ui: &mut egui::Ui) {
        egui::Panel::right("warp panel").default_size(290.0).show(ui, |ui| {
            egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                egui::CollapsingHeader::new("Cage").default_open(true).show(ui, |ui| self.cage_panel(ui));
                egui::CollapsingHeader::new("Map").default_open(true).show(ui, |ui| self.map_panel(ui));
                egui::CollapsingHeader::new("Export ").default_open(true).show(ui, |ui| self.warp_export(ui));
            });
        });
    }

    fn cage_panel(&mut self, ui: &mut egui::Ui) {
        ui.horizontal(|ui| {
            ui.selectable_value(&mut self.warp.stage, Stage::Draw, "Draw the cage")
                .on_hover_text("Vertices are placed on the picture");
            ui.selectable_value(&mut self.warp.stage, Stage::Drag, "Drag it")
                .on_hover_text("Vertices go where you drag them, and the picture follows");
        });
        let size = self.warp.opened.as_ref().map(|o| o.1.map(f64::from));
        ui.horizontal_wrapped(|ui| {
            for (text, side) in [("Rectangle of 4", 1), ("8", 2), ("12", 3), ("20", 5)] {
                let clicked = ui.add_enabled(size.is_some(), egui::Button::new(text)).clicked();
                if let (true, Some(size)) = (clicked, size) {
                    self.history.edit(|d| d.warp.rectangle(size, side));
                    self.warp.selected.clear();
                }
            }
        });
        ui.horizontal(|ui| {
            let hint = "Four vertices in the middle: what they enclose is no part of the map";
            if ui.add_enabled(size.is_some(), egui::Button::new("Add a hole")).on_hover_text(hint).clicked()
                && let Some([w, h]) = size
            {
                let (c, r) = (DVec2::new(0.5 * w, 0.5 * h), 0.1 * w.min(h));
                // The other way round than the outline.
                let corners = [[-r, -r], [-r, r], [r, r], [r, -r]].map(|d| c + DVec2::from(d));
                self.history.edit(|d| d.warp.add_loop(corners.to_vec()));
            }
            if ui.button("Back to rest").on_hover_text("Every vertex goes back to where it is on the picture").clicked()
            {
                self.history.edit(|d| d.warp.reset());
            }
        });
    }

    fn map_panel(&mut self, ui: &mut egui::Ui) {
        let view = &mut self.warp;
        if let Some(why) = &view.failed {
            ui.colored_label(ui.visuals().error_fg_color, why);
        }
        if let Some(s) = &view.state {
            let steps = if s.steps == 1 { "1 step".to_owned() } else { format!("{} steps", s.steps) };
            let words = match (s.folds, s.steps) {
                (true, _) => format!("It folds, even in {steps}"),
                (false, 1) => "No fold, in one step".to_owned(),
                (false, _) => format!("No fold, in {steps}"),
            };
            let color = if s.folds { ui.visuals().error_fg_color } else { ui.visuals().text_color() };
            ui.colored_label(color, words);
            if let Some(single) = s.single.filter(|x| *x <= 0.0) {
                ui.label(format!("A single map would fold: its smallest J is {single:.3}"));
            } else if s.steps > 1 && !s.settled {
                ui.label("A single map would fold");
            }
            ui.label(format!("Smallest J of a step: {:.3}", s.minimum))
                .on_hover_text("The factor by which areas change; below 0 the picture would be turned over");
            ui.weak(format!("{:.0} ms{}", s.milliseconds, if s.settled { ", judged in full" } else { "" }));
        }
        ui.checkbox(&mut view.show_heat, "Show J at rest").on_hover_text("Blue shrinks, red stretches, magenta folds");
        ui.add(egui::Slider::new(&mut view.before, 0.0..=1.0).show_value(false).text("Before and after"));
    }

    fn warp_export(&mut self, ui: &mut egui::Ui) {
        let Some((path, _)) = self.warp.opened.clone() else {
            ui.weak("Open a picture first");
            return;
        };
        if self.exports.picture.is_empty() {
            let stem = path.file_stem().unwrap_or_default().to_string_lossy();
            self.exports.picture = path.with_file_name(format!("{stem}_warped.png")).display().to_string();
        }
        ui.horizontal(|ui| {
            let label = ui.label("To");
            ui.add(egui::TextEdit::singleline(&mut self.exports.picture).desired_width(170.0)).labelled_by(label.id);
            if ui.button("...").on_hover_text("Choose a file").clicked() {
                self.dialogs.ask(ui.ctx(), Purpose::ExportWarp);
            }
        });
        let output = project::absolute(Path::new(self.exports.picture.trim()));
        let stem = output.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let cage = output.with_file_name(format!("{stem}_cage.json"));
        let name = |p: &Path| p.to_string_lossy().into_owned();
        let words: Vec<String> =
            ["warp".into(), name(&path), "--cage".into(), name(&cage), "--output".into(), name(&output)].into();
        let ready = !self.exports.is_running() && !self.history.now().warp.loops.is_empty();
        let hint = "Writes the picture at its full size, and the cage beside it. Ctrl E";
        ui.horizontal(|ui| {
            let clicked = ui.add_enabled(ready, egui::Button::new("Export picture")).on_hover_text(hint).clicked();
            if clicked || (ready && std::mem::take(&mut self.transfer.wants_export)) {
                let text = self.history.now().warp.to_json().to_string();
                self.export(words.clone(), vec![output.clone()], Beside::Cage(cage.clone(), text));
            }
            if self.exports.is_running() {
                ui.spinner();
                if ui.button("Cancel export").clicked() {
                    self.exports.cancel();
                }
            }
        });
        ui.collapsing("The same on the command line ", |ui| {
            ui.monospace(command::shown(&words));
        });
    }

    pub(super) fn warp_keys(&mut self, press: &dyn Fn(Modifiers, Key) -> bool) {
        let plain = |key| press(Modifiers::NONE, key);
        if plain(Key::Delete) || plain(Key::Backspace) {
            let mut selected = std::mem::take(&mut self.warp.selected);
            // The last ones first, so that the numbers of the others stay.
            selected.sort_unstable();
            self.history.edit(|d| selected.iter().rev().for_each(|id| _ = d.warp.remove(*id)));
        }
        if plain(Key::Escape) {
            self.warp.selected.clear();
        }
        let step = 1.0 * self.warp.scale();
        let arrows = [
            (Key::ArrowLeft, [-step, 0.0]),
            (Key::ArrowRight, [step, 0.0]),
            (Key::ArrowUp, [0.0, -step]),
            (Key::ArrowDown, [0.0, step]),
        ];
        for (key, by) in arrows {
            if plain(key) {
                let (selected, stage) = (self.warp.selected.clone(), self.warp.stage);
                self.history.edit(|d| selected.iter().for_each(|id| d.warp.move_by(*id, by.into(), stage)));
            }
        }
    }
}
