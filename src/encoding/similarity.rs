//! The similarity that takes one list of points to another.

use glam::{DMat3, DQuat, DVec3};
use nalgebra::{Matrix4, SymmetricEigen};

/// x -> scale * rotation x + shift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Similarity {
    /// Turning.
    pub rotation: DMat3,
    /// Growth, positive.
    pub scale: f64,
    /// Moved by so much afterwards.
    pub shift: DVec3,
}

impl Similarity {
    /// Leaves everything where it is.
    pub const IDENTITY: Self = Self { rotation: DMat3::IDENTITY, scale: 1.0, shift: DVec3::ZERO };

    /// The image of a point.
    pub fn apply(&self, p: DVec3) -> DVec3 {
        self.rotation * p * self.scale + self.shift
    }

    /// Fits pairs (from, to): the rotation is the best one in the sense of least squares, the scale
    /// the ratio of the rms distances to the mean, so that an exact similarity is found exactly and
    /// a bent or twisted shape is not shrunk.
    ///
    /// Where the points leave the rotation open (one point, or all on a line) it is the one nearest
    /// to none; a single point, or points that coincide on either side, keep the scale. No pairs
    /// give [`Self::IDENTITY`]. Horn 1987 (unit quaternions: 180 degrees are nothing special).
    pub fn fit(pairs: &[(DVec3, DVec3)]) -> Self {
        if pairs.is_empty() {
            return Self::IDENTITY;
        }
        let n = pairs.len() as f64;
        let (a, b) = pairs.iter().fold((DVec3::ZERO, DVec3::ZERO), |m, p| (m.0 + p.0, m.1 + p.1));
        let (a, b) = (a / n, b / n);
        let (mut from, mut to) = (0.0, 0.0);
        let mut s = DMat3::ZERO;
        for &(p, q) in pairs {
            let (p, q) = (p - a, q - b);
            from += p.length_squared();
            to += q.length_squared();
            s += DMat3::from_cols(p * q.x, p * q.y, p * q.z);
        }
        let size = (from * to).sqrt();
        // Points that agree but for rounding have no directions.
        let extent = a.length_squared() + from;
        if !(from > 1e-24 * extent) || !(size > 0.0) || !size.is_finite() {
            return Self { shift: b - a, ..Self::IDENTITY };
        }
        let s = s * (1.0 / size);
        // s.col(j)[i] = sum p_i q_j.
        let m = |i: usize, j: usize| s.col(j)[i];
        let horn = Matrix4::new(
            m(0, 0) + m(1, 1) + m(2, 2),
            m(1, 2) - m(2, 1),
            m(2, 0) - m(0, 2),
            m(0, 1) - m(1, 0),
            m(1, 2) - m(2, 1),
            m(0, 0) - m(1, 1) - m(2, 2),
            m(0, 1) + m(1, 0),
            m(2, 0) + m(0, 2),
            m(2, 0) - m(0, 2),
            m(0, 1) + m(1, 0),
            m(1, 1) - m(0, 0) - m(2, 2),
            m(1, 2) + m(2, 1),
            m(0, 1) - m(1, 0),
            m(2, 0) + m(0, 2),
            m(1, 2) + m(2, 1),
            m(2, 2) - m(0, 0) - m(1, 1),
        );
        let eigen = SymmetricEigen::new(horn);
        let top = eigen.eigenvalues.max();
        // Of equally good rotations the one nearest to the identity: its quaternion (1, 0, 0, 0)
        // projected on theirs.
        let mut q = [0.0; 4];
        let mut first = None;
        for k in (0..4).filter(|&k| eigen.eigenvalues[k] > top - 1e-9) {
            let v = eigen.eigenvectors.column(k);
            first.get_or_insert([v[0], v[1], v[2], v[3]]);
            for (q, x) in q.iter_mut().zip(v.iter()) {
                *q += v[0] * x;
            }
        }
        if q.iter().map(|x| x * x).sum::<f64>() < 1e-12 {
            q = first.unwrap_or([1.0, 0.0, 0.0, 0.0]);
        }
        let rotation = DMat3::from_quat(DQuat::from_xyzw(q[1], q[2], q[3], q[0]).normalize());
        let scale = (to / from).sqrt();
        Self { rotation, scale, shift: b - rotation * a * scale }
    }

    /// First this, then `next`.
    pub fn then(&self, next: &Self) -> Self {
        Self { rotation: next.rotation * self.rotation, scale: next.scale * self.scale, shift: next.apply(self.shift) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(points: &[DVec3], s: &Similarity) -> Vec<(DVec3, DVec3)> {
        points.iter().map(|&p| (p, s.apply(p))).collect()
    }

    #[test]
    fn similarities_are_found_at_any_angle() {
        let points = [DVec3::ZERO, DVec3::X, DVec3::Y * 2.0, DVec3::new(0.3, 0.4, 1.5)];
        for degrees in [0.0, 30.0, 179.999, 180.0, 200.0, 270.0] {
            let rotation = DMat3::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), f64::to_radians(degrees));
            let s = Similarity { rotation, scale: 2.5, shift: DVec3::new(4.0, 5.0, -6.0) };
            for n in [3, 4] {
                let found = Similarity::fit(&image(&points[..n], &s));
                for p in points {
                    assert!(found.apply(p).distance(s.apply(p)) < 1e-13, "{degrees}, {n}: {found:?}");
                }
            }
        }
    }

    #[test]
    fn open_rotations_turn_as_little_as_possible() {
        // One point is moved only.
        let one = Similarity::fit(&[(DVec3::X, DVec3::Z)]);
        assert!(one.rotation == DMat3::IDENTITY && one.scale == 1.0 && one.apply(DVec3::X) == DVec3::Z);
        // A line turned by 90 degrees about z: no roll about itself.
        let two = Similarity::fit(&[(DVec3::ZERO, DVec3::ZERO), (DVec3::X, DVec3::Y * 2.0)]);
        assert!(two.apply(DVec3::Z).distance(DVec3::Z * 2.0) < 1e-12, "{two:?}");
        assert!(two.apply(DVec3::X).distance(DVec3::Y * 2.0) < 1e-12);
        // Reversed: any half turn, but a rotation.
        let back = Similarity::fit(&[(DVec3::ZERO, DVec3::ZERO), (DVec3::X, -DVec3::X)]);
        assert!(back.apply(DVec3::X).distance(-DVec3::X) < 1e-12 && back.rotation.determinant() > 0.999);
        assert_eq!(Similarity::fit(&[]), Similarity::IDENTITY);
        assert_eq!(Similarity::fit(&[(DVec3::X, DVec3::Y), (DVec3::X, DVec3::Y)]).scale, 1.0);
    }
}
