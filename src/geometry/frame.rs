//! Coordinates about a point of the shape itself, at a size near 1.
//!
//! Georeferenced scans stand millions of sizes away from the origin, others measure in micrometres.
//! What is computed from raw coordinates there loses digits: products and sums of them round by the
//! size of the coordinates, not of the shape, and single precision has none left. Results must not
//! depend on where a shape stands or what unit it is measured in.
//!
//! Two ways lead there. The coordinates could be replaced as a file is read and put back as one is
//! written. Every position, length and area that enters or leaves a command would have to be
//! converted then, and one that is missed is wrong without a word. So meshes keep the coordinates
//! of the file, and whatever computes with more than differences of them takes a [`Frame`] of the
//! shape first. Modules that use only differences of positions (areas, normals, geodesics,
//! Laplacians, simplification) need none.
//!
//! The origin of a frame is *a vertex of the shape*, the scale a power of two. Then local
//! coordinates are the same bits for the same shape shifted by any vector for which the shift is
//! exact, and scaled by any power of two: a floating-point difference is the rounded value of the
//! exact one, and both vertices shift alike. Decisions made in local coordinates are the same for
//! both. The middle of a box would round with the shift.

use glam::DVec3;

use super::{Mesh, SurfacePoint};

/// Exponents of scales: beyond them squares and cubes of local coordinates would leave the range of
/// `f64`.
const EXPONENTS: std::ops::RangeInclusive<i32> = -1000..=1000;

/// Local coordinates of a shape: `(p - origin) * scale`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// The point of the shape whose local coordinates are 0.
    pub origin: DVec3,
    /// Local units in one unit of the file, a power of two: the longest side of the shape's box is
    /// 1/2 to 1.
    pub scale: f64,
}

impl Default for Frame {
    /// Coordinates as they are.
    fn default() -> Self {
        Self { origin: DVec3::ZERO, scale: 1.0 }
    }
}

impl Frame {
    /// The frame of some points: the origin is the one nearest to the middle of their box, the
    /// first on ties.
    /// Points that are not finite do not count; of none, coordinates stay as they are. O(n).
    pub fn of(points: impl Iterator<Item = DVec3> + Clone) -> Self {
        let finite = points.filter(|p| p.is_finite());
        let Some(first) = finite.clone().next() else { return Self::default() };
        let (low, high) =
            finite.clone().map(|p| p - first).fold((DVec3::ZERO, DVec3::ZERO), |(l, h), d| (l.min(d), h.max(d)));
        let middle = low + 0.5 * (high - low);
        let nearest = finite.fold((f64::INFINITY, first), |best, p| {
            // Of the largest coordinate: squares of very large or small ones leave the range.
            let off = (p - first - middle).abs().max_element();
            if off < best.0 { (off, p) } else { best }
        });
        let size = (high - low).max_element();
        let scale = if size > 0.0 && size.is_finite() {
            let exponent = size.log2().floor() as i32 + 1;
            f64::from(exponent.clamp(*EXPONENTS.start(), *EXPONENTS.end())).exp2().recip()
        } else {
            1.0
        };
        Self { origin: nearest.1, scale }
    }

    /// The frame of the vertices that triangles and polygons of `mesh` use. O(corners).
    pub fn of_mesh(mesh: &Mesh) -> Self {
        Self::of((0..mesh.polygon_count()).flat_map(|p| mesh.polygon(p)).map(|c| mesh.positions[c.vertex as usize]))
    }

    /// The same origin, lengths in the units of the file.
    pub fn in_units(self) -> Self {
        Self { scale: 1.0, ..self }
    }

    /// Into local coordinates.
    pub fn local(&self, p: DVec3) -> DVec3 {
        (p - self.origin) * self.scale
    }

    /// Back from local coordinates.
    pub fn world(&self, q: DVec3) -> DVec3 {
        q / self.scale + self.origin
    }

    /// The local place of a point of `mesh`, which does not round where its corners lie far from
    /// the origin.
    ///
    /// # Panics
    /// If the face is not a triangle of `mesh`.
    pub fn place(&self, p: &SurfacePoint, mesh: &Mesh) -> DVec3 {
        let [a, b, c] = mesh.triangle_positions(p.face as usize).map(|x| self.local(x));
        a * p.barycentric[0] + b * p.barycentric[1] + c * p.barycentric[2]
    }

    /// `mesh` in local coordinates; lengths are `scale` times as long. O(vertices + corners).
    pub fn mesh(&self, mesh: &Mesh) -> Mesh {
        let mut local = mesh.clone();
        local.positions.iter_mut().for_each(|p| *p = self.local(*p));
        local
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::shapes::lobed_sphere;

    /// Coordinates on a grid coarse enough for exact shifts up to `2^24`.
    fn snapped() -> Mesh {
        let mut mesh = lobed_sphere(2, 0.3);
        mesh.positions.iter_mut().for_each(|p| *p = (*p * f64::from(1 << 20)).round() / f64::from(1 << 20));
        mesh
    }

    #[test]
    fn local_coordinates_are_the_same_bits_wherever_and_however_large_the_shape_is() {
        let mesh = snapped();
        let frame = Frame::of_mesh(&mesh);
        let local = frame.mesh(&mesh).positions;
        let size = local.iter().fold(0.0, |m: f64, p| m.max(p.abs().max_element()));
        assert!(size > 0.25 && size < 1.0, "{size}");
        for shift in [DVec3::ZERO, DVec3::new(500_000.0, 4_600_000.0, 300.0), DVec3::splat(-0.375), DVec3::X * 1e7] {
            for scale in [1.0, 2f64.powi(-20), 2f64.powi(20), 2f64.powi(-300)] {
                let mut moved = mesh.clone();
                moved.positions.iter_mut().for_each(|p| *p = (*p + shift) * scale);
                let there = Frame::of_mesh(&moved);
                assert_eq!(there.mesh(&moved).positions, local, "{shift} {scale}");
                assert_eq!(there.scale, frame.scale / scale);
                for p in &moved.positions {
                    assert_eq!(there.world(there.local(*p)), *p);
                }
            }
        }
        // A shift that rounds is seen.
        let mut rounded = mesh.clone();
        rounded.positions.iter_mut().for_each(|p| *p += DVec3::splat(0.1));
        assert_ne!(Frame::of_mesh(&rounded).mesh(&rounded).positions, local);
    }

    #[test]
    fn points_of_no_triangle_and_nothing_at_all_do_not_matter() {
        let mut mesh = snapped();
        let frame = Frame::of_mesh(&mesh);
        mesh.positions.extend([DVec3::splat(1e9), DVec3::NAN]);
        assert_eq!(Frame::of_mesh(&mesh), frame);
        assert_eq!(Frame::of([].into_iter()), Frame::default());
        let one = Frame::of([DVec3::NAN, DVec3::X].into_iter());
        assert_eq!((one.origin, one.scale), (DVec3::X, 1.0));
        let p = SurfacePoint::new(3, [0.2, 0.3, 0.5]);
        assert!(frame.world(frame.place(&p, &mesh)).distance(p.position(&mesh)) < 1e-15);
    }
}
