//! A camera that turns around what it looks at.

use barymap::geometry::UpAxis;
use glam::{DMat4, DVec2, DVec3, DVec4};

/// Half of the angle that the height of the picture spans, as its tangent.
const HALF_HEIGHT: f64 = 0.36;
/// Largest angle above or below the horizon.
const STEEPEST: f64 = 1.55;
/// Nearest and farthest distance to the focus, in radii of the shape.
const DISTANCES: [f64; 2] = [0.02, 60.0];

/// A camera that turns around what it looks at. Angles in radians, lengths in units of the mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// What it looks at.
    pub focus: DVec3,
    /// The distance of the eye from there.
    pub distance: f64,
    /// The turn about the axis that points up; 0 looks at the front.
    pub yaw: f64,
    /// The angle above the horizon.
    pub pitch: f64,
    /// The axis of the mesh that points up.
    pub up: UpAxis,
    /// The radius of the shape, by which near and far planes are set.
    pub radius: f64,
}

impl Default for Camera {
    fn default() -> Self {
        Self { focus: DVec3::ZERO, distance: 3.0, yaw: 0.0, pitch: 0.1, up: UpAxis::Y, radius: 1.0 }
    }
}

/// A ray; `direction` has length one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts.
    pub origin: DVec3,
    /// Where it goes.
    pub direction: DVec3,
}

impl Camera {
    /// Sees the whole of a box, from the direction that it has, in a picture of this width over
    /// height.
    pub fn frame(&mut self, (low, high): (DVec3, DVec3), aspect: f64) {
        let radius = 0.5 * low.distance(high);
        self.radius = if radius > 0.0 { radius } else { 1.0 };
        self.focus = 0.5 * (low + high);
        let half = HALF_HEIGHT * aspect.clamp(0.2, 1.0);
        self.distance = self.radius * (1.0 + half * half).sqrt() / half;
    }

    /// From the focus to the eye.
    fn outward(&self) -> DVec3 {
        let (sy, cy) = self.yaw.sin_cos();
        let (sp, cp) = self.pitch.sin_cos();
        self.up.from_y(DVec3::new(sy * cp, sp, cy * cp))
    }

    /// Where the eye is.
    pub fn eye(&self) -> DVec3 {
        self.focus + self.distance * self.outward()
    }

    /// To the right, up and towards the eye, as the picture has them.
    pub fn axes(&self) -> [DVec3; 3] {
        let back = self.outward();
        let right = self.up.from_y(DVec3::Y).cross(back).normalize();
        [right, back.cross(right), back]
    }

    /// Turns by parts of a half turn: the shape follows the mouse.
    pub fn orbit(&mut self, by: DVec2) {
        self.yaw -= std::f64::consts::PI * by.x;
        self.pitch = (self.pitch + std::f64::consts::PI * by.y).clamp(-STEEPEST, STEEPEST);
    }

    /// Looks at what faces along `direction`, from there.
    pub fn face(&mut self, direction: DVec3) {
        let Some(d) = (self.up.to_y() * direction).try_normalize() else { return };
        self.yaw = d.x.atan2(d.z);
        self.pitch = d.y.asin().clamp(-STEEPEST, STEEPEST);
    }

    /// Moves what is seen, by parts of the height of the picture.
    pub fn pan(&mut self, by: DVec2) {
        let [right, up, _] = self.axes();
        let height = 2.0 * HALF_HEIGHT * self.distance;
        self.focus -= height * (by.x * right - by.y * up);
    }

    /// Comes nearer by a factor below 1, farther by one above. The point at `at`, in -1..1 of the
    /// picture with y up, stays where it is.
    pub fn zoom(&mut self, factor: f64, at: DVec2, aspect: f64) {
        let [near, far] = DISTANCES.map(|d| d * self.radius);
        let distance = (self.distance * factor).clamp(near, far);
        let [right, up, _] = self.axes();
        let offset = HALF_HEIGHT * (at.x * aspect * right + at.y * up);
        self.focus += (self.distance - distance) * offset;
        self.distance = distance;
    }

    /// From space to the clip space of the device, whose depth is 0 to 1.
    pub fn matrix(&self, aspect: f64) -> DMat4 {
        let [right, up, back] = self.axes();
        let eye = self.eye();
        let view = DMat4::from_cols(
            DVec4::new(right.x, up.x, back.x, 0.0),
            DVec4::new(right.y, up.y, back.y, 0.0),
            DVec4::new(right.z, up.z, back.z, 0.0),
            DVec4::new(-right.dot(eye), -up.dot(eye), -back.dot(eye), 1.0),
        );
        let far = self.distance + 4.0 * self.radius;
        let near = (self.distance - 2.0 * self.radius).max(1e-3 * far);
        let depth = far / (near - far);
        let perspective = DMat4::from_cols(
            DVec4::new(1.0 / (HALF_HEIGHT * aspect), 0.0, 0.0, 0.0),
            DVec4::new(0.0, 1.0 / HALF_HEIGHT, 0.0, 0.0),
            DVec4::new(0.0, 0.0, depth, -1.0),
            DVec4::new(0.0, 0.0, depth * near, 0.0),
        );
        perspective * view
    }

    /// The ray through a place of the picture, in -1..1 with y up.
    pub fn ray(&self, at: DVec2, aspect: f64) -> Ray {
        let [right, up, back] = self.axes();
        let direction = HALF_HEIGHT * (at.x * aspect * right + at.y * up) - back;
        Ray { origin: self.eye(), direction: direction.normalize() }
    }

    /// Where a point is in the picture, in -1..1 with y up; none behind the eye.
    pub fn project(&self, p: DVec3, aspect: f64) -> Option<DVec2> {
        let [right, up, back] = self.axes();
        let from_eye = p - self.eye();
        let depth = -from_eye.dot(back);
        let at = DVec2::new(from_eye.dot(right) / aspect, from_eye.dot(up)) / (HALF_HEIGHT * depth);
        (depth > 0.0).then_some(at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        let mut camera = Camera { yaw: 0.7, pitch: -0.3, ..Camera::default() };
        camera.frame((DVec3::new(-1.0, 0.0, 2.0), DVec3::new(3.0, 5.0, 4.0)), 1.0);
        camera
    }

    #[test]
    fn matrix_ray_and_projection_agree() {
        for up in [UpAxis::Y, UpAxis::Z] {
            let camera = Camera { up, ..camera() };
            let at = DVec2::new(0.3, -0.6);
            let ray = camera.ray(at, 1.5);
            let p = ray.origin + 4.0 * ray.direction;
            assert!(camera.project(p, 1.5).unwrap().distance(at) < 1e-12);
            let clip = camera.matrix(1.5) * p.extend(1.0);
            assert!((DVec2::new(clip.x, clip.y) / clip.w).distance(at) < 1e-12);
            assert!(camera.project(ray.origin - ray.direction, 1.5).is_none());
        }
    }

    #[test]
    fn a_framed_box_is_seen_whole_and_within_the_planes() {
        for (aspect, i) in [0.6, 1.0, 1.7].into_iter().flat_map(|a| (0..8).map(move |i| (a, i))) {
            let mut camera = camera();
            camera.frame((DVec3::new(-1.0, 0.0, 2.0), DVec3::new(3.0, 5.0, 4.0)), aspect);
            let pick = |k: usize, a: f64, b: f64| if i >> k & 1 == 0 { a } else { b };
            let p = DVec3::new(pick(0, -1.0, 3.0), pick(1, 0.0, 5.0), pick(2, 2.0, 4.0));
            let at = camera.project(p, aspect).unwrap();
            assert!(at.abs().max_element() <= 1.0, "{at}");
            let clip = camera.matrix(aspect) * p.extend(1.0);
            assert!((0.0..=1.0).contains(&(clip.z / clip.w)));
        }
    }

    #[test]
    fn zooming_holds_the_place_under_the_mouse() {
        let mut camera = camera();
        let at = DVec2::new(-0.4, 0.2);
        // A point in the plane of the focus.
        let ray = camera.ray(at, 1.2);
        let [_, _, back] = camera.axes();
        let p = ray.origin + camera.distance / -ray.direction.dot(back) * ray.direction;
        camera.zoom(0.5, at, 1.2);
        assert!(camera.project(p, 1.2).unwrap().distance(at) < 1e-9);
        camera.zoom(1e-9, at, 1.2);
        assert!(camera.distance > 0.0);
    }

    #[test]
    fn panning_moves_by_parts_of_the_height() {
        let mut camera = camera();
        let before = camera.project(camera.focus, 1.0).unwrap();
        let focus = camera.focus;
        camera.pan(DVec2::new(0.25, 0.0));
        let after = camera.project(focus, 1.0).unwrap();
        assert!((after - before).distance(DVec2::new(0.5, 0.0)) < 1e-9);
    }

    #[test]
    fn a_camera_faces_what_it_is_told_to() {
        for up in [UpAxis::Y, UpAxis::Z] {
            let mut camera = Camera { up, ..camera() };
            let direction = DVec3::new(0.3, -0.5, -0.7).normalize();
            camera.face(direction);
            assert!(camera.axes()[2].distance(direction) < 1e-9);
            camera.face(DVec3::ZERO);
            assert!(camera.axes()[2].distance(direction) < 1e-9, "nothing faces nowhere");
        }
    }

    #[test]
    fn turning_stops_below_the_pole() {
        let mut camera = camera();
        camera.orbit(DVec2::new(0.1, 5.0));
        assert!(camera.axes().iter().all(|a| a.is_finite() && (a.length() - 1.0).abs() < 1e-9));
    }
}
