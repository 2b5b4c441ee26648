//! A camera that looks at the whole shape.

use glam::{DVec2, DVec3};

use super::RenderOptions;
use crate::geometry::{Frame, Mesh};

/// Maps points to pixels. Depth grows away from the camera.
#[derive(Clone, Copy, Debug)]
pub(super) struct Camera {
    /// The shape's.
    pub(super) frame: Frame,
    /// In the frame, as all lengths here.
    centre: DVec3,
    pub(super) right: DVec3,
    pub(super) up: DVec3,
    /// From the shape to the camera.
    pub(super) back: DVec3,
    /// From the centre, or `None` for an orthographic camera.
    distance: Option<f64>,
    /// Half the size of the shape.
    pub(super) radius: f64,
    scale: f64,
    offset: DVec2,
}

impl Camera {
    /// The camera of the options, with all triangles in the picture; `None` if there is nothing
    /// finite to see.
    pub(super) fn fitted(mesh: &Mesh, options: &RenderOptions) -> Option<Self> {
        let mut seen = vec![false; mesh.vertex_count()];
        for t in 0..mesh.triangle_count() {
            let t = mesh.triangle(t);
            if t.iter().all(|&v| mesh.positions[v as usize].is_finite()) {
                t.iter().for_each(|&v| seen[v as usize] = true);
            }
        }
        let seen = || mesh.positions.iter().zip(&seen).filter(|(_, s)| **s).map(|(p, _)| *p);
        let frame = Frame::of(seen());
        let points = || seen().map(|p| frame.local(p));
        let low = points().fold(DVec3::INFINITY, DVec3::min);
        let high = points().fold(DVec3::NEG_INFINITY, DVec3::max);
        let centre = low + 0.5 * (high - low);
        let radius = 0.5 * (high - low).length();
        if !(centre.is_finite() && radius.is_finite()) {
            return None;
        }
        let radius = if radius > 0.0 { radius } else { 1.0 };
        let (sin_a, cos_a) = options.azimuth.to_radians().sin_cos();
        let (sin_e, cos_e) = options.elevation.to_radians().sin_cos();
        let back = options.up.from_y(DVec3::new(sin_a * cos_e, sin_e, cos_a * cos_e));
        let right = options.up.from_y(DVec3::new(cos_a, 0.0, -sin_a));
        let half = 0.5 * options.field_of_view.to_radians();
        let distance = (half > 0.0).then(|| radius / half.sin());
        let mut camera = Self {
            frame,
            centre,
            right,
            up: back.cross(right),
            back,
            distance,
            radius,
            scale: 1.0,
            offset: DVec2::ZERO,
        };
        // What of the picture the shape would take, then made to fit.
        let low = points().map(|p| camera.project_local(p).truncate()).fold(DVec2::INFINITY, DVec2::min);
        let high = points().map(|p| camera.project_local(p).truncate()).fold(DVec2::NEG_INFINITY, DVec2::max);
        let size = DVec2::new(f64::from(options.width), f64::from(options.height));
        let room = size * (1.0 - 2.0 * options.margin) / (high - low).max(DVec2::splat(1e-9));
        camera.scale = room.min_element();
        camera.offset = 0.5 * size - 0.5 * (low + high) * camera.scale;
        camera.scale.is_finite().then_some(camera)
    }

    /// Pixel coordinates (x right, y down, pixel centres at halves) and depth. The depth is
    /// projective under a perspective camera (linear in the picture) and distance along the view
    /// otherwise, in units of the shape's radius.
    pub(super) fn project(&self, p: DVec3) -> DVec3 {
        self.project_local(self.frame.local(p))
    }

    /// The same for a point in the camera's frame.
    pub(super) fn project_local(&self, p: DVec3) -> DVec3 {
        let q = (p - self.centre) / self.radius;
        let (x, y, z) = (q.dot(self.right), -q.dot(self.up), -q.dot(self.back));
        match self.distance {
            None => DVec3::new(x * self.scale + self.offset.x, y * self.scale + self.offset.y, z),
            Some(d) => {
                let d = d / self.radius;
                let w = 1.0 / (d + z);
                // 1 - d w: zero at the centre, growing with the distance, linear in the picture
                // like w.
                DVec3::new(d * x * w * self.scale + self.offset.x, d * y * w * self.scale + self.offset.y, 1.0 - d * w)
            }
        }
    }

    /// Factor by which a corner with this depth counts in perspective-correct interpolation.
    pub(super) fn inverse_distance(&self, depth: f64) -> f64 {
        if self.distance.is_some() { 1.0 - depth } else { 1.0 }
    }
}
