//! A viewport: a rectangle of the window through which a shape is seen.

use egui::{Pos2, Rect, Response, Vec2};
use glam::{DVec2, DVec3};

use crate::model::camera::Camera;

/// A factor of the distance for a pixel of scrolling.
const ZOOM: f64 = 0.998;

/// Places of a rectangle as a camera has them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Port {
    pub(super) rect: Rect,
    pub(super) camera: Camera,
}

impl Port {
    /// Width over height.
    pub(super) fn aspect(&self) -> f64 {
        f64::from(self.rect.width().max(1.0)) / f64::from(self.rect.height().max(1.0))
    }

    /// A place of the window in -1..1 of the viewport, y up.
    pub(super) fn local(&self, p: Pos2) -> DVec2 {
        let (c, s) = (self.rect.center(), self.rect.size().max(Vec2::splat(1.0)));
        DVec2::new(f64::from((p.x - c.x) / s.x), f64::from((c.y - p.y) / s.y)) * 2.0
    }

    /// Where a point of space is in the window.
    pub(super) fn place(&self, p: DVec3) -> Option<Pos2> {
        let at = self.camera.project(p, self.aspect())?;
        let (c, s) = (self.rect.center(), self.rect.size());
        Some(Pos2::new(c.x + 0.5 * s.x * at.x as f32, c.y - 0.5 * s.y * at.y as f32))
    }
}

/// What the mouse does to a camera this frame: turns with the left button where `turns`, moves with
/// the others or with shift, comes nearer with the wheel.
pub(super) fn steer(camera: &mut Camera, response: &Response, turns: bool) {
    use egui::PointerButton::{Middle, Primary, Secondary};
    let size = response.rect.size().max(Vec2::splat(1.0));
    let delta = response.drag_delta();
    let by = DVec2::new(f64::from(delta.x), f64::from(delta.y)) / f64::from(size.y);
    let shift = response.ctx.input(|i| i.modifiers.shift);
    if response.dragged_by(Middle) || response.dragged_by(Secondary) || (response.dragged_by(Primary) && turns && shift)
    {
        camera.pan(by);
    } else if response.dragged_by(Primary) && turns {
        camera.orbit(by);
    }
    if let Some(at) = response.hover_pos() {
        let (scroll, pinch) = response.ctx.input(|i| (i.smooth_scroll_delta.y, i.zoom_delta()));
        let factor = ZOOM.powf(f64::from(scroll)) / f64::from(pinch);
        if factor != 1.0 && factor.is_finite() {
            let port = Port { rect: response.rect, camera: *camera };
            let (at, aspect) = (port.local(at), port.aspect());
            camera.zoom(factor, at, aspect);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_go_there_and_back() {
        let rect = Rect::from_min_size(Pos2::new(100.0, 50.0), Vec2::new(400.0, 200.0));
        let port = Port { rect, camera: Camera::default() };
        assert_eq!(port.local(rect.min), DVec2::new(-1.0, 1.0));
        let p = Pos2::new(333.0, 71.0);
        let ray = port.camera.ray(port.local(p), port.aspect());
        let back = port.place(ray.origin + 2.0 * ray.direction).unwrap();
        assert!(back.distance(p) < 1e-3);
    }
}
