//! The transfer workspace: two shapes side by side, and the points on them.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use barymap::geometry::SurfacePoint;
use barymap::surface::correspondence::Method;
use barymap::tools::anchors::MirrorPlane;
use egui::{Align2, Color32, FontId, Pos2, Rect, Response, Role, Sense, Stroke, Vec2};

use super::port::{Port, steer};
use super::{Studio, Weight};
use crate::draw::{self, Surface, View};
use crate::model::camera::Camera;
use crate::model::{Side, color};
use crate::worker::{GuessFrom, OpenedShape, PairList, Proposed, Report, Request, Shown, Suggested};

/// A click this near to a point, in points of the window, is a click on it.
const REACH: f32 = 11.0;
/// Radius of a point.
const DOT: f32 = 6.0;
/// What may lie before a point that is seen, in radii of the shape.
const SLACK: f64 = 4e-3;

/// What is laid over the target.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Overlay {
    /// The transferred texture.
    #[default]
    Result,
    /// The texture, and what of it can be trusted.
    Coverage,
    /// How far each vertex can be trusted.
    Confidence,
    /// A checker by texture coordinates.
    Checker,
    /// Plain grey.
    Grey,
}

impl Overlay {
    pub(super) const ALL: [(Self, &'static str, &'static str); 5] = [
        (Self::Result, "Result", "The transferred texture"),
        (Self::Coverage, "Coverage", "Green: vouched for. Orange: doubtful. Red: no colour"),
        (Self::Confidence, "Confidence", "Green: sure. Yellow: less. Red: not at all"),
        (Self::Checker, "Checker", "A checker by texture coordinates"),
        (Self::Grey, "Grey", "The shape alone"),
    ];
}

/// What the worker was asked for.
#[derive(Debug, Default)]
pub(super) struct Asked {
    pub(super) files: [Option<PathBuf>; 2],
    pub(super) texture: Option<PathBuf>,
    pub(super) unwrap: bool,
    pub(super) method: Option<Method>,
    pub(super) pairs: Option<(PairList, bool)>,
}

/// A point that is being dragged.
#[derive(Clone, Copy, Debug)]
struct Drag {
    id: u64,
    side: Side,
}

/// The state of the workspace that is no part of the document.
#[derive(Debug)]
pub struct TransferView {
    pub(super) asked: Asked,
    /// Files that are being read.
    pub(super) opening: [Option<PathBuf>; 2],
    shapes: [Option<Arc<OpenedShape>>; 2],
    pub(super) drawn: [bool; 2],
    mirrors: [Option<MirrorPlane>; 2],
    cameras: [Camera; 2],
    rects: [Rect; 2],
    pub(super) overlay: Overlay,
    pub(super) wireframe: bool,
    pub(super) checker: bool,
    pub(super) linked: bool,
    pub(super) labels: bool,
    /// Whether pairs are set on both sides at once.
    pub(super) mirror: bool,
    pub(super) selected: Option<u64>,
    /// The partner of the open pair's point, as the map has it.
    guess: Option<(GuessFrom, Option<SurfacePoint>)>,
    drag: Option<Drag>,
    pub(super) left_out: HashMap<u64, f64>,
    pub(super) wrong: HashMap<u64, f64>,
    pub(super) proposed: Vec<Proposed>,
    pub(super) suggested: Vec<Suggested>,
    pub(super) has_confidence: bool,
    result: Option<Shown>,
    /// Pictures of the target that came.
    updates: u64,
    /// What is missing for a result.
    missing: String,
    /// Texels along a side of the picture at rest.
    pub(super) rest_size: u32,
    /// Whether the list of keys is shown.
    pub(super) help: bool,
    /// Whether the keyboard asked for an export.
    pub(super) wants_export: bool,
}

impl Default for TransferView {
    fn default() -> Self {
        Self {
            asked: Asked::default(),
            opening: [None, None],
            shapes: [None, None],
            drawn: [false; 2],
            mirrors: [None, None],
            cameras: [Camera::default(); 2],
            rects: [Rect::NOTHING; 2],
            overlay: Overlay::default(),
            wireframe: false,
            checker: false,
            linked: false,
            labels: true,
            mirror: false,
            selected: None,
            guess: None,
            drag: None,
            left_out: HashMap::new(),
            wrong: HashMap::new(),
            proposed: Vec::new(),
            suggested: Vec::new(),
            has_confidence: false,
            result: None,
            updates: 0,
            missing: String::new(),
            rest_size: 1024,
            help: false,
            wants_export: false,
        }
    }
}

impl TransferView {
    /// The shape of a side.
    pub fn shape(&self, side: Side) -> Option<&OpenedShape> {
        self.shapes[side.index()].as_deref()
    }

    /// The transferred texture as it is shown.
    pub fn result(&self) -> Option<&Shown> {
        self.result.as_ref()
    }

    /// How many pictures of the target came so far.
    pub fn updates(&self) -> u64 {
        self.updates
    }

    /// Whether both shapes are on the screen with their looks.
    pub fn is_drawn(&self) -> bool {
        self.drawn == [true; 2]
    }

    /// Of how many pairs it is known how far the others would miss them.
    pub fn left_out_count(&self) -> usize {
        self.left_out.len()
    }

    /// Where the map puts the partner of the open pair's point, if that is known.
    pub fn guess(&self) -> Option<SurfacePoint> {
        self.guess.and_then(|g| g.1)
    }

    /// Where a point of a side is in the window, whether or not something hides it.
    pub fn place(&self, side: Side, point: &SurfacePoint) -> Option<Pos2> {
        let shape = self.shape(side)?;
        self.port(side).place(point.position(&shape.mesh))
    }

    /// Whether nothing hides a point of a side.
    pub fn sees(&self, side: Side, point: &SurfacePoint) -> bool {
        let Some(shape) = self.shape(side) else { return false };
        let camera = &self.cameras[side.index()];
        shape.bvh.is_visible(camera.eye(), point.position(&shape.mesh), SLACK * camera.radius)
    }

    /// The camera of a side.
    pub fn camera_mut(&mut self, side: Side) -> &mut Camera {
        &mut self.cameras[side.index()]
    }

    /// The viewport that a place of the window is in.
    pub(super) fn side_at(&self, at: Pos2) -> Option<Side> {
        Side::BOTH.into_iter().find(|s| self.rects[s.index()].contains(at))
    }

    fn port(&self, side: Side) -> Port {
        Port { rect: self.rects[side.index()], camera: self.cameras[side.index()] }
    }

    pub(super) fn set_shape(&mut self, side: Side, shape: Arc<OpenedShape>) {
        let aspect = self.port(side).aspect();
        let camera = &mut self.cameras[side.index()];
        *camera = Camera { up: shape.up, ..Camera::default() };
        camera.frame(shape.mesh.bounds().unwrap_or_default(), aspect);
        self.missing = "The shapes are being measured: pairs can be set already".into();
        self.mirrors[side.index()] = None;
        self.shapes[side.index()] = Some(shape);
        self.drawn[side.index()] = false;
        self.proposed.clear();
        self.suggested.clear();
        self.wrong.clear();
        self.left_out.clear();
    }

    /// Another document is there: the worker is asked for everything again.
    pub(super) fn start_anew(&mut self) {
        let TransferView { cameras, overlay, wireframe, checker, linked, labels, rects, rest_size, .. } =
            std::mem::take(self);
        *self = Self { cameras, overlay, wireframe, checker, linked, labels, rects, rest_size, ..Self::default() };
    }

    /// A side has no file any more.
    pub(super) fn close(&mut self, side: Side) {
        self.shapes[side.index()] = None;
        self.drawn[side.index()] = false;
    }

    pub(super) fn show(&mut self, shown: Shown) {
        self.updates += 1;
        self.result = Some(shown);
    }

    pub(super) fn forget_result(&mut self, why: String) {
        (self.result, self.has_confidence, self.missing) = (None, false, why);
        self.left_out.clear();
        self.wrong.clear();
    }

    /// Takes a report; what there is to say.
    pub(super) fn listen(&mut self, report: Report) -> Option<String> {
        match report {
            Report::Mirror(side, plane) => self.mirrors[side.index()] = plane,
            Report::LeftOut(list) => self.left_out = list.into_iter().collect(),
            Report::Wrong(list) => self.wrong = list.into_iter().collect(),
            Report::Proposed(pairs, notes) => {
                let count = pairs.len();
                self.proposed = pairs;
                let notes = notes.join(". ");
                return Some(format!("{count} pairs proposed: accept or reject them in the list. {notes}"));
            }
            Report::Suggested(list) => {
                let count = list.len();
                self.suggested = list;
                return Some(format!("{count} places on the target where a pair would help, marked there: click one"));
            }
            _ => (),
        }
        None
    }

    /// The mirror image of a point about the plane of its shape; none near the plane itself or
    /// where the shape is not symmetric.
    fn mirrored(&self, side: Side, point: &SurfacePoint) -> Option<SurfacePoint> {
        let (shape, plane) = (self.shape(side)?, self.mirrors[side.index()].as_ref()?);
        let p = point.position(&shape.mesh);
        let size = shape.mesh.area().sqrt();
        let (image, distance) = shape.closest.nearest(plane.reflect(p))?;
        let apart = image.position(&shape.mesh).distance(p) > 0.02 * size;
        (apart && distance < 0.05 * size).then_some(image)
    }

    /// Whether both shapes are there.
    pub(super) fn shapes_ready(&self) -> bool {
        self.shapes.iter().all(Option::is_some)
    }

    /// The document has changed otherwise than by clicks.
    pub(super) fn forget_guess(&mut self) {
        self.guess = None;
    }

    /// Whether both shapes are their own mirror images.
    pub(super) fn is_symmetric(&self) -> bool {
        self.mirrors.iter().all(Option::is_some)
    }
}

impl Studio {
    pub(super) fn transfer_workspace(&mut self, ui: &mut egui::Ui) {
        self.transfer_side_panel(ui);
        egui::CentralPanel::no_frame().show(ui, |ui| {
            let whole = ui.max_rect();
            ui.painter().rect_filled(whole, 0.0, ui.visuals().window_stroke.color);
            let half = Vec2::new(0.5 * (whole.width() - 2.0), whole.height());
            let left = Rect::from_min_size(whole.min, half);
            let right = Rect::from_min_size(Pos2::new(whole.max.x - half.x, whole.min.y), half);
            self.viewport(ui, Side::Source, left);
            self.viewport(ui, Side::Target, right);
        });
    }

    fn viewport(&mut self, ui: &mut egui::Ui, side: Side, rect: Rect) {
        let k = side.index();
        self.transfer.rects[k] = rect;
        let response = ui.interact(rect, ui.scope_id().with(("viewport", k)), Sense::click_and_drag());
        response.widget_info(|| egui::WidgetInfo::labeled(Role::Canvas, true, format!("{} view", side.word())));
        let painter = ui.painter_at(rect);
        let dark = ui.visuals().dark_mode;
        let background = if dark { [0.12, 0.12, 0.14] } else { [0.93, 0.93, 0.95] };
        if self.transfer.shapes[k].is_some() {
            self.mouse(&response, side);
        }
        if self.transfer.drawn[k] && rect.width() >= 1.0 && rect.height() >= 1.0 {
            let port = self.transfer.port(side);
            let pixels = (rect.size() * ui.pixels_per_point()).round();
            let view = View {
                matrix: port.camera.matrix(port.aspect()),
                light: port.camera.axes()[2],
                surface: self.surface(side),
                over: side == Side::Target && self.transfer.overlay == Overlay::Coverage,
                wireframe: self.transfer.wireframe,
                background,
            };
            painter.add(draw::shape(side, rect, [pixels.x as u32, pixels.y as u32], view));
        } else {
            let [r, g, b] = background.map(|c: f32| (255.0 * c) as u8);
            painter.rect_filled(rect, 0.0, Color32::from_rgb(r, g, b));
        }
        self.dots(&painter, &response, side);
        self.caption(&painter, side, rect, dark);
    }

    fn surface(&self, side: Side) -> Surface {
        let view = &self.transfer;
        match (side, view.overlay) {
            (Side::Source, _) if view.checker => Surface::Checker,
            (Side::Source, _) => Surface::Picture,
            (_, Overlay::Checker) => Surface::Checker,
            (_, Overlay::Confidence) if view.has_confidence => Surface::Colors,
            (_, Overlay::Grey | Overlay::Confidence) => Surface::Grey,
            (_, _) if view.result.is_none() => Surface::Grey,
            _ => Surface::Picture,
        }
    }

    /// What the mouse does in a viewport.
    fn mouse(&mut self, response: &Response, side: Side) {
        let primary = egui::PointerButton::Primary;
        if response.drag_started_by(primary)
            && let Some(at) = response.ctx.input(|i| i.pointer.press_origin())
            && let Some(id) = self.dot_at(side, at)
        {
            self.transfer.drag = Some(Drag { id, side });
            self.transfer.selected = Some(id);
            self.history.begin();
        }
        if let Some(drag) = self.transfer.drag.filter(|d| d.side == side) {
            if let Some(at) = response.interact_pointer_pos()
                && let Some(point) = self.pick(side, at)
            {
                self.history.edit(|d| d.transfer.pairs.move_to(drag.id, side, point));
            }
            if response.drag_stopped() || !response.dragged() {
                self.transfer.drag = None;
                self.history.end();
                self.ask_for_guess();
            }
        }
        let turns = self.transfer.drag.is_none();
        let before = self.transfer.cameras[side.index()];
        steer(&mut self.transfer.cameras[side.index()], response, turns);
        if self.transfer.linked {
            let after = self.transfer.cameras[side.index()];
            let other = &mut self.transfer.cameras[side.other().index()];
            (other.yaw, other.pitch) = (after.yaw, after.pitch);
            // Distances in radii, so that both seem equally large.
            other.distance *= (after.distance / before.distance).clamp(0.1, 10.0);
        }
        if response.clicked()
            && let Some(at) = response.interact_pointer_pos()
        {
            self.click(side, at);
        }
    }

    /// The point of the shape under a place of the window.
    fn pick(&self, side: Side, at: Pos2) -> Option<SurfacePoint> {
        let shape = self.transfer.shape(side)?;
        let port = self.transfer.port(side);
        let ray = port.camera.ray(port.local(at), port.aspect());
        shape.bvh.hit(&ray).map(|hit| hit.point)
    }

    /// The pair whose point is under a place of the window: the nearest of those that are seen.
    fn dot_at(&self, side: Side, at: Pos2) -> Option<u64> {
        let view = &self.transfer;
        let dots = self.history.now().transfer.pairs.list().iter().filter_map(|pair| {
            let point = pair.on(side)?;
            let distance = view.place(side, &point)?.distance(at);
            (distance <= REACH && view.sees(side, &point)).then_some((distance, pair.id))
        });
        dots.min_by(|a, b| a.0.total_cmp(&b.0)).map(|d| d.1)
    }

    /// A click: on a point it selects, on a ghost it accepts, on the surface it sets a point.
    fn click(&mut self, side: Side, at: Pos2) {
        if let Some(id) = self.dot_at(side, at) {
            self.transfer.selected = Some(id);
            return;
        }
        let near = |p: &SurfacePoint| {
            self.transfer.place(side, p).is_some_and(|q| q.distance(at) <= REACH) && self.transfer.sees(side, p)
        };
        let of = |p: &Proposed| if side == Side::Source { p.source } else { p.target };
        if let Some(k) = self.transfer.proposed.iter().position(|p| near(&of(p))) {
            self.accept_proposed(k..k + 1);
            return;
        }
        if side == Side::Target
            && let Some(k) = self.transfer.suggested.iter().position(|s| near(&s.target))
        {
            let suggested = self.transfer.suggested.remove(k);
            self.set_point(Side::Target, suggested.target);
            return;
        }
        let Some(point) = self.pick(side, at) else {
            self.transfer.selected = None;
            return;
        };
        self.set_point(side, point);
    }

    /// Sets a point as a click does.
    pub fn set_point(&mut self, side: Side, point: SurfacePoint) {
        let mirror = self.transfer.mirror;
        let view = &self.transfer;
        let mut id = 0;
        self.history.edit(|d| {
            let pairs = &mut d.transfer.pairs;
            id = pairs.click(side, point);
            let both = pairs.list().iter().find(|p| p.id == id).and_then(|p| p.both().map(|b| (b, p.label.clone())));
            if mirror
                && let Some(((s, t), label)) = both
                && let Some((s, t)) = view.mirrored(Side::Source, &s).zip(view.mirrored(Side::Target, &t))
            {
                let label = if label.is_empty() { label } else { format!("{label}, mirrored") };
                pairs.add(s, t, label);
            }
        });
        self.transfer.selected = Some(id);
        self.transfer.guess = None;
        self.ask_for_guess();
    }

    /// Asks where the map puts the partner of the open pair's point.
    fn ask_for_guess(&mut self) {
        self.transfer.guess = None;
        let Some(open) = self.history.now().transfer.pairs.open() else { return };
        let Some((side, point)) = Side::BOTH.into_iter().find_map(|s| open.on(s).map(|p| (s, p))) else { return };
        let from = GuessFrom { id: open.id, side, point };
        if self.transfer.result.is_some() {
            self.worker.send(Request::Guess(from));
        }
    }

    /// The partner of a point was found.
    pub(super) fn guessed(&mut self, from: &GuessFrom, point: Option<SurfacePoint>) {
        let open = self.history.now().transfer.pairs.open();
        if open.is_some_and(|o| o.id == from.id && o.on(from.side) == Some(from.point)) {
            self.transfer.guess = Some((*from, point));
        }
    }

    /// Takes the partner that the map proposes. Whether there was one.
    pub(super) fn accept_guess(&mut self) -> bool {
        let Some((from, Some(point))) = self.transfer.guess.take() else { return false };
        let open = self.history.now().transfer.pairs.open().map(|o| o.id);
        if open == Some(from.id) {
            self.set_point(from.side.other(), point);
        }
        open == Some(from.id)
    }

    /// Takes over proposed pairs.
    pub(super) fn accept_proposed(&mut self, range: std::ops::Range<usize>) {
        let taken: Vec<Proposed> = self.transfer.proposed.drain(range).collect();
        self.history.edit(|d| {
            for p in taken {
                d.transfer.pairs.add(p.source, p.target, String::new());
            }
        });
    }

    /// Takes the selected pair away.
    pub(super) fn delete_selected(&mut self) {
        if let Some(id) = self.transfer.selected.take() {
            self.history.edit(|d| d.transfer.pairs.remove(id));
            self.transfer.guess = None;
        }
    }

    /// Adds the mirror images of all pairs.
    pub(super) fn mirror_all(&mut self) {
        let view = &self.transfer;
        let images: Vec<_> = self
            .history
            .now()
            .transfer
            .pairs
            .complete()
            .iter()
            .filter_map(|(_, s, t)| view.mirrored(Side::Source, s).zip(view.mirrored(Side::Target, t)))
            .collect();
        // A side that has a pair of its own there needs none.
        let size = view.shape(Side::Target).map_or(1.0, |s| s.mesh.area().sqrt());
        let place = |p: &SurfacePoint| view.shape(Side::Target).map(|s| p.position(&s.mesh));
        let taken: Vec<_> = self.history.now().transfer.pairs.complete().iter().filter_map(|p| place(&p.2)).collect();
        let free = |t: &SurfacePoint| place(t).is_some_and(|q| taken.iter().all(|p| p.distance(q) > 0.03 * size));
        let new: Vec<_> = images.into_iter().filter(|(_, t)| free(t)).collect();
        let count = new.len();
        self.history.edit(|d| new.into_iter().for_each(|(s, t)| _ = d.transfer.pairs.add(s, t, String::new())));
        self.messages.tell(Weight::Done, format!("{count} mirrored pairs added"));
    }

    /// The points on a shape, ghosts, and marks of suggestions.
    fn dots(&self, painter: &egui::Painter, response: &Response, side: Side) {
        let view = &self.transfer;
        let pairs = &self.history.now().transfer.pairs;
        let [dark, light] = [Color32::from_black_alpha(200), Color32::WHITE];
        let ghost = |at: Pos2, text: &str, color: Color32| {
            painter.circle_stroke(at, DOT, Stroke::new(3.0, dark));
            painter.circle_stroke(at, DOT, Stroke::new(1.5, color));
            label(painter, at, text, color);
        };
        for p in &view.proposed {
            let point = if side == Side::Source { p.source } else { p.target };
            if let Some(at) = view.place(side, &point).filter(|_| view.sees(side, &point)) {
                ghost(at, if p.flagged.is_some() { "?" } else { "" }, Color32::from_rgb(150, 220, 255));
            }
        }
        for s in view.suggested.iter().filter(|_| side == Side::Target) {
            if let Some(at) = view.place(side, &s.target).filter(|_| view.sees(side, &s.target)) {
                ghost(at, "+", Color32::from_rgb(255, 210, 80));
            }
        }
        for (k, pair) in pairs.list().iter().enumerate() {
            let Some(point) = pair.on(side) else { continue };
            let Some(at) = view.place(side, &point) else { continue };
            let seen = view.sees(side, &point);
            let wrong = view.wrong.contains_key(&pair.id);
            let [r, g, b] = if wrong { color::WRONG } else { color::of_pair(pair.id) };
            if !seen {
                painter.circle_filled(at, 2.0, Color32::from_rgba_unmultiplied(r, g, b, 90));
                continue;
            }
            let hovered = response.hover_pos().is_some_and(|h| h.distance(at) <= REACH);
            let radius = if hovered { DOT + 2.0 } else { DOT };
            painter.circle(at, radius, Color32::from_rgb(r, g, b), Stroke::new(1.5, dark));
            if view.selected == Some(pair.id) {
                painter.circle_stroke(at, radius + 3.0, Stroke::new(2.0, light));
            }
            if view.labels || hovered || view.selected == Some(pair.id) {
                let text = match pair.label.as_str() {
                    "" => (k + 1).to_string(),
                    name => format!("{} {name}", k + 1),
                };
                label(painter, at, &text, light);
            }
        }
        if let Some((from, Some(point))) = &view.guess
            && from.side.other() == side
            && let Some(at) = view.place(side, point)
        {
            let text = if view.sees(side, point) { "Enter: here" } else { "Enter: here, behind" };
            ghost(at, text, Color32::from_rgb(255, 255, 120));
        }
    }

    /// Words in the corner of a viewport: what it shows, and what to do.
    fn caption(&self, painter: &egui::Painter, side: Side, rect: Rect, dark: bool) {
        let ink = if dark { Color32::from_gray(220) } else { Color32::from_gray(40) };
        let (title, name) = match side {
            Side::Source => ("Source: has the texture", self.transfer.shape(side)),
            Side::Target => ("Target: gets the texture", self.transfer.shape(side)),
        };
        let name = name.and_then(|s| s.path.file_name()).map(|n| format!("  {}", n.to_string_lossy()));
        let text = format!("{title}{}", name.unwrap_or_default());
        painter.text(rect.min + Vec2::splat(8.0), Align2::LEFT_TOP, text, FontId::proportional(13.0), ink);
        let open = self.history.now().transfer.pairs.open();
        let hint = match (&self.transfer.shapes[side.index()], open) {
            (None, _) => match &self.transfer.opening[side.index()] {
                Some(path) => format!("Opening {} ...", path.display()),
                None => "Drop a mesh here\nor File, Open (Ctrl O)".to_owned(),
            },
            (Some(_), Some(open)) if open.on(side).is_none() => "Click the same place here".to_owned(),
            _ if side == Side::Target && self.transfer.result.is_none() => self.transfer.missing.clone(),
            _ => String::new(),
        };
        let empty = self.transfer.shapes[side.index()].is_none();
        let (at, align) = if empty {
            (rect.center(), Align2::CENTER_CENTER)
        } else {
            (rect.center_bottom() - Vec2::new(0.0, 14.0), Align2::CENTER_BOTTOM)
        };
        let size = if empty { 17.0 } else { 14.0 };
        painter.text(at, align, hint, FontId::proportional(size), ink);
    }

    /// Turns the cameras so that the points of a pair are seen, where they are hidden.
    pub(super) fn look_at(&mut self, id: u64) {
        let pair = self.history.now().transfer.pairs.list().iter().find(|p| p.id == id).cloned();
        for side in Side::BOTH {
            let Some(point) = pair.as_ref().and_then(|p| p.on(side)) else { continue };
            if self.transfer.sees(side, &point) {
                continue;
            }
            let Some(shape) = self.transfer.shapes[side.index()].clone() else { continue };
            let normal = shape.mesh.triangle_area_normal(point.face as usize);
            self.transfer.cameras[side.index()].face(normal);
        }
    }

    /// Shows the whole of both shapes.
    pub(super) fn frame_shapes(&mut self) {
        for side in Side::BOTH {
            let aspect = self.transfer.port(side).aspect();
            if let Some(shape) = &self.transfer.shapes[side.index()] {
                self.transfer.cameras[side.index()].frame(shape.mesh.bounds().unwrap_or_default(), aspect);
            }
        }
    }
}

/// A label beside a point, readable on anything.
fn label(painter: &egui::Painter, at: Pos2, text: &str, color: Color32) {
    let font = FontId::proportional(12.0);
    let at = at + Vec2::new(DOT + 3.0, -DOT - 1.0);
    for d in [[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]] {
        painter.text(at + Vec2::from(d), Align2::LEFT_CENTER, text, font.clone(), Color32::from_black_alpha(190));
    }
    painter.text(at, Align2::LEFT_CENTER, text, font, color);
}
