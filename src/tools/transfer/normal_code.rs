//! Normals and heights as samples, and back.

use glam::DVec3;

use super::kind::NormalY;
use crate::picture::Depth;

/// How a depth holds numbers that may be negative.
///
/// Integers hold x in -1..1 as (x + 1) / 2, so that 0 falls between two steps; programs write it as
/// the upper one, 128 of 255 or 32768 of
/// 65535. That step is read as 0 along the surface's axes, so that what is flat stays flat however
///        the axes turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct NormalCode {
    /// The value (0..1) that means 0.
    zero: f64,
    /// Vectors that are shorter or longer than 1 by no more are so by rounding.
    tolerance: f64,
}

impl NormalCode {
    /// Of tangent-space normals.
    pub(super) fn tangent(depth: Depth) -> Self {
        match depth {
            // Half a step and the zero's half step along two axes, half a step along the third.
            Depth::U8 => Self { zero: 128.0 / 255.0, tolerance: 0.012 },
            Depth::U16 => Self { zero: 32768.0 / 65535.0, tolerance: 5e-5 },
            // Half floats.
            Depth::F32 => Self { zero: 0.5, tolerance: 1e-3 },
        }
    }

    /// Of normals in the mesh's axes: no direction is special.
    pub(super) fn object(depth: Depth) -> Self {
        Self { zero: 0.5, ..Self::tangent(depth) }
    }

    /// The vector of a sample, pointing up the picture, of length 1 or what rounding left of it;
    /// `None` if it says nothing.
    pub(super) fn decode(self, c: &[f32], y: NormalY) -> Option<DVec3> {
        let [a, b, c] = [0, 1, 2].map(|k| f64::from(c[k]));
        let green = if y == NormalY::Down { -1.0 } else { 1.0 };
        // The third axis is outward and reaches 1.
        let n = DVec3::new(2.0 * (a - self.zero), green * 2.0 * (b - self.zero), 2.0 * c - 1.0);
        let length = n.length();
        if !(length > 1e-3 && length.is_finite()) {
            return None;
        }
        Some(if (length - 1.0).abs() <= self.tolerance { n } else { n / length })
    }

    /// Writes a vector as a sample.
    pub(super) fn encode(self, n: DVec3, y: NormalY, out: &mut [f32]) {
        let green = if y == NormalY::Down { -1.0 } else { 1.0 };
        out[0] = (0.5 * n.x + self.zero) as f32;
        out[1] = (0.5 * green * n.y + self.zero) as f32;
        out[2] = (0.5 * n.z + 0.5) as f32;
    }
}

/// The value that means no displacement.
pub(super) fn zero_height(depth: Depth) -> f64 {
    match depth {
        Depth::U8 => 128.0 / 255.0,
        Depth::U16 => 32768.0 / 65535.0,
        Depth::F32 => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flat_is_flat_at_every_depth() {
        for (depth, most) in [(Depth::U8, 255.0_f64), (Depth::U16, 65535.0)] {
            let half = (0.5 * most).round() / most;
            let flat = [half as f32, half as f32, 1.0];
            let n = NormalCode::tangent(depth).decode(&flat, NormalY::Up).unwrap();
            assert!(n.truncate().length() < 1e-7 && (n.z - 1.0).abs() < 1e-7, "{n}");
        }
    }

    #[test]
    fn every_unit_vector_survives_rounding() {
        let step = |x: f32| (x * 255.0).round() / 255.0;
        for i in 0..500 {
            let (a, z) = (f64::from(i) * 2.4, f64::from(i) / 500.0);
            let r = (1.0 - z * z).sqrt();
            let n = DVec3::new(r * a.cos(), r * a.sin(), z);
            for y in [NormalY::Up, NormalY::Down] {
                // As other programs write it: no special zero.
                let mut c = [0.0; 3];
                NormalCode::object(Depth::U8).encode(n, y, &mut c);
                let stored = c.map(step);
                let code = NormalCode::tangent(Depth::U8);
                let read = code.decode(&stored, y).unwrap();
                let mut again = [0.0; 3];
                code.encode(read, y, &mut again);
                assert_eq!(again.map(step), stored);
                assert!(read.angle_between(n).to_degrees() < 0.7, "{n} {read}");
            }
        }
    }

    #[test]
    fn green_down_is_the_mirror_image_and_nothing_is_nothing() {
        let code = NormalCode::tangent(Depth::F32);
        let c = [0.7_f32, 0.8, 0.9];
        let (up, down) = (code.decode(&c, NormalY::Up).unwrap(), code.decode(&c, NormalY::Down).unwrap());
        assert_eq!(up, DVec3::new(down.x, -down.y, down.z));
        assert_eq!(code.decode(&[0.5; 3], NormalY::Up), None);
        assert_eq!(code.decode(&[f32::NAN; 3], NormalY::Up), None);
    }
}
