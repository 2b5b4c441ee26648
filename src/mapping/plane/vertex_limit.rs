//! What a mean value map does next to a vertex: limits in closed form.
//!
//! The gradient of the map does not exist at a vertex v_k: it depends on the direction from which
//! v_k is approached. With beta the interior angle and phi in [-beta/2, beta/2] measured from its
//! bisector, the map is vhat_k + r (p0 + p1 cos phi + p2 sin phi) + O(r^2), and with E+ and E- the
//! images of the unit vectors along both edges
//!
//! - Q = sum over the other edges of t (d_i / r_i + d_j / r_j), t and r seen from v_k, d the images
//!   relative to vhat_k,
//! - p0 = (E+ + E-) / 2 - cot(beta/2) Q / 2, p1 = Q / (2 sin(beta/2)), p2 = (E- - E+) / (2
//!   sin(beta/2)),
//! - J(phi) = p1 x p2 + (p0 x p2) cos phi - (p0 x p1) sin phi.
//!
//! The smallest Jacobian of a map is nearly always such a limit, where no pixel lies.

use super::outline::{Outline, cross, dot, sub};
use crate::engine::Real;

/// The map next to one vertex.
#[derive(Clone, Copy, Debug)]
pub(super) struct VertexLimit<R> {
    /// Unit vector of the bisector into the polygon, and the one to its left.
    bisector: [R; 2],
    across: [R; 2],
    /// cos(beta/2), sin(beta/2).
    half: [R; 2],
    /// p0, p1, p2.
    p: [[R; 2]; 3],
}

impl<R: Real> VertexLimit<R> {
    /// The limit at vertex `k` between the vertices `before` and `after` of its loop. O(n).
    pub(super) fn new(outline: &Outline<R>, before: usize, k: usize, after: usize) -> Self {
        let (v, u) = (&outline.vertices, &outline.displacements);
        let two = R::of(2.0);
        // By linearity of the map in the images, displacements give what is to be added to the
        // identity.
        let along = |j: usize| {
            let (s, d) = (sub(v[j], v[k]), sub(u[j], u[k]));
            let inverse = R::ONE / dot(s, s).sqrt();
            (s.map(|x| x * inverse), d.map(|x| x * inverse))
        };
        let ((a, plus), (b, minus)) = (along(after), along(before));
        let mut q = [R::ZERO; 2];
        for (i, j) in outline.edges() {
            if i == k || j == k {
                continue;
            }
            let (s, next) = (sub(v[i], v[k]), sub(v[j], v[k]));
            let (r, r_next) = (dot(s, s).sqrt(), dot(next, next).sqrt());
            let area = cross(if r_next < r { next } else { s }, sub(v[j], v[i]));
            let d = dot(s, next);
            let t = if d < R::ZERO { (r * r_next - d) / area } else { area / (r * r_next + d) };
            let (c, c_next) = (t / r, t / r_next);
            for axis in 0..2 {
                q[axis] += c * (u[i][axis] - u[k][axis]) + c_next * (u[j][axis] - u[k][axis]);
            }
        }
        // |b - a| = 2 sin(beta/2), |a + b| = 2 |cos(beta/2)|; the cosine is negative at reflex vertices.
        let (difference, sum) = (sub(b, a), [a[0] + b[0], a[1] + b[1]]);
        let length = dot(difference, difference).sqrt();
        let cos = dot(sum, sum).sqrt() / two;
        let half = [if cross(a, b) < R::ZERO { -cos } else { cos }, length / two];
        let across = difference.map(|x| x / length);
        let bisector = [across[1], -across[0]];
        let cot = half[0] / half[1];
        let mut p = [[R::ZERO; 2], bisector, across];
        for axis in 0..2 {
            p[0][axis] = (plus[axis] + minus[axis] - cot * q[axis]) / two;
            p[1][axis] += q[axis] / length;
            p[2][axis] += (minus[axis] - plus[axis]) / length;
        }
        Self { bisector, across, half, p }
    }

    /// Derivative (rows: of each coordinate of the image) along the bisector, where cos phi = 1.
    pub(super) fn derivative(&self) -> [[R; 2]; 2] {
        self.derivative_at(R::ONE, R::ZERO)
    }

    /// The unit vector in the direction phi.
    #[cfg(test)]
    pub(super) fn direction(&self, cos: R, sin: R) -> [R; 2] {
        std::array::from_fn(|axis| self.bisector[axis] * cos + self.across[axis] * sin)
    }

    /// beta / 2.
    #[cfg(test)]
    pub(super) fn half_angle(&self) -> f64 {
        self.half[1].to_f64().atan2(self.half[0].to_f64())
    }

    /// Derivative in the direction phi, given by its cosine and sine.
    pub(super) fn derivative_at(&self, cos: R, sin: R) -> [[R; 2]; 2] {
        let [p0, p1, p2] = self.p;
        std::array::from_fn(|row| {
            let radial = p0[row] + p1[row] * cos + p2[row] * sin;
            let around = p2[row] * cos - p1[row] * sin;
            std::array::from_fn(|axis| {
                let e = self.bisector[axis] * cos + self.across[axis] * sin;
                let f = self.across[axis] * cos - self.bisector[axis] * sin;
                radial * e + around * f
            })
        })
    }

    /// The smallest limit of the Jacobian over all directions into the polygon, both edges
    /// included.
    pub(super) fn smallest(&self) -> R {
        let [p0, p1, p2] = self.p;
        let (c, s) = (cross(p0, p2), -cross(p0, p1));
        let amplitude = (c * c + s * s).sqrt();
        // The sinusoid is lowest opposite to (c, s), unless that direction is outside.
        let wave = if amplitude > R::ZERO && -c / amplitude >= self.half[0] {
            -amplitude
        } else {
            c * self.half[0] - (s * self.half[1]).abs()
        };
        cross(p1, p2) + wave
    }
}
