//! How far single precision may be from the references, to first order in the unit roundoff:
//! standard error analysis of the formulas of `encoding::decode` and `encoding::derivative`, for
//! inputs that both sides read as the same single-precision numbers.
//!
//! A ring far from its own plane, or nearly without area, has large bounds; they say so truthfully.

use barymap::encoding::derivative::Linearisation;
use barymap::encoding::{Encoding, Stencils, V3};
use glam::DVec3;

/// Unit roundoff of single precision, doubled: the bounds are of first order, and drivers round
/// square roots and divisions by up to 2.5 units in the last place.
pub(crate) const ROUNDOFF: f64 = 2.0 * 5.96e-8;

/// A row and its errors, in units of [`ROUNDOFF`].
#[derive(Clone, Debug)]
pub(crate) struct RowBound {
    /// Of the normal, and relative of the area.
    pub(crate) normal: f64,
    /// Of F, without the rounding of the result.
    pub(crate) value: f64,
    /// Of the offset sum w b d.
    offset: f64,
    g: f64,
    h: f64,
    /// Of z, a slot each.
    z: Vec<f64>,
    /// The row's own quantities.
    n: DVec3,
    over_length: f64,
    s: f64,
    own_g: DVec3,
    own_h: DVec3,
    slots: Vec<SlotValues>,
}

#[derive(Clone, Copy, Debug)]
struct SlotValues {
    w: f64,
    z: DVec3,
    chord: DVec3,
}

impl RowBound {
    pub(crate) fn new(
        stencils: &Stencils,
        encoding: &Encoding<f64>,
        at: &Linearisation<f64>,
        x: &[V3<f64>],
        row: usize,
    ) -> Self {
        let slots = stencils.slots(row);
        let (w, b) = (&encoding.w[slots.clone()], &encoding.b[slots.clone()]);
        let ring: Vec<DVec3> = stencils.ring(row).iter().map(|&v| DVec3::from(x[v as usize])).collect();
        let m = ring.len();
        let terms = m as f64;
        let p: Vec<DVec3> = ring.iter().map(|&v| v - ring[0]).collect();
        let d = &at.rows[row];
        let (n, s) = (DVec3::from(d.normal), d.offset);
        // Sums of m terms of relative error four each.
        let crossed: f64 = (0..m).map(|k| p[k].length() * p[(k + m - 1) % m].length()).sum();
        let normal = (terms + 6.0) * (1.0 + crossed * d.inverse_length);
        let centre: DVec3 = p.iter().zip(w).map(|(p, w)| *p * *w).sum();
        let centre_error = (terms + 2.0) * p.iter().zip(w).map(|(p, w)| p.length() * w.abs()).sum::<f64>();
        let mean: DVec3 = p.iter().copied().sum::<DVec3>() / terms;
        let square: f64 = p.iter().map(|p| p.length_squared()).sum::<f64>() / terms;
        let spread = (square - mean.length_squared()).max(0.0);
        let (mut value, mut offset, mut g, mut h) = (0.0, 0.0, 0.0, 0.0);
        let (mut kappa, mut kappa_error) = (0.0, 0.0);
        let mut z = Vec::with_capacity(m);
        for k in 0..m {
            let r = centre - p[k];
            let along = n.dot(r);
            let plane = r - n * along;
            let length = (plane.length_squared() + 1e-6 * spread).sqrt();
            let wb = (w[k] * b[k]).abs();
            let part = centre_error + (4.0 + 2.0 * normal) * r.length();
            let regular = 1e-6 * (terms + 4.0) * square / (2.0 * length).max(f64::MIN_POSITIVE);
            let length_error =
                part.min(part * plane.length() / length + part * part * ROUNDOFF / length) + regular + 3.0 * length;
            offset += wb * (length_error + (terms + 3.0) * length);
            let direction = (part + length_error) / length + 3.0;
            g += wb * (direction + terms + 3.0);
            h += wb * (along.abs() * (direction + terms + 4.0) + part);
            z.push(wb * (direction + 2.0));
            kappa += wb / length;
            kappa_error += wb / length * (length_error / length + terms + 3.0);
        }
        for k in 0..m {
            let arm = (p[k] - mean).length();
            z[k] += 1e-6 / terms * (kappa_error * arm + kappa * (3.0 * arm + (terms + 2.0) * square.sqrt()));
        }
        value += centre_error + offset + s.abs() * (normal + 1.0) + 2.0 * (centre.length() + s.abs());
        let values = |k: usize| SlotValues {
            w: w[k],
            z: DVec3::from(at.z[slots.start + k]),
            chord: ring[(k + 1) % m] - ring[(k + m - 1) % m],
        };
        Self {
            normal,
            value,
            offset,
            g,
            h,
            z,
            n,
            over_length: d.inverse_length,
            s,
            own_g: DVec3::from(d.g),
            own_h: DVec3::from(d.h),
            slots: (0..m).map(values).collect(),
        }
    }

    /// Whether the ring has so little area that first order says nothing.
    pub(crate) fn is_degenerate(&self) -> bool {
        !(self.normal * ROUNDOFF < 1e-2) || self.over_length == 0.0
    }

    /// Error of F and of V - F, the vertex being at `v`.
    pub(crate) fn residual(&self, v: DVec3) -> f64 {
        ROUNDOFF * (self.value + 2.0 * v.length())
    }

    /// Error of dF times vectors of given values, a slot each.
    pub(crate) fn derivative(&self, x: &[DVec3]) -> f64 {
        let terms = x.len() as f64;
        let (mut moved, mut moved_size, mut turned, mut turned_size) = (DVec3::ZERO, 0.0, DVec3::ZERO, 0.0);
        let (mut offset, mut offset_error) = (0.0, 0.0);
        for ((slot, &x), z_error) in self.slots.iter().zip(x).zip(&self.z) {
            moved += slot.w * x;
            moved_size += slot.w.abs() * x.length();
            turned += slot.chord.cross(x);
            turned_size += slot.chord.length() * x.length();
            offset += slot.z.dot(x);
            offset_error += x.length() * (z_error + (terms + 4.0) * slot.z.length());
        }
        let moved_error = (terms + 1.0) * moved_size;
        let along = (turned - self.n * self.n.dot(turned)) * self.over_length;
        let along_error = self.over_length * ((terms + 8.0) * turned_size + 3.0 * self.normal * turned.length())
            + along.length() * (self.normal + 2.0);
        offset += self.own_g.dot(moved) - self.own_h.dot(along);
        offset_error += (self.g + 4.0 * self.own_g.length()) * moved.length()
            + self.own_g.length() * moved_error
            + (self.h + 4.0 * self.own_h.length()) * along.length()
            + self.own_h.length() * along_error
            + 3.0 * offset.abs();
        let total = moved_error
            + self.s.abs() * along_error
            + self.offset * along.length()
            + offset_error
            + offset.abs() * (self.normal + 3.0)
            + 3.0 * (moved.length() + self.s.abs() * along.length());
        ROUNDOFF * total
    }

    /// Error and size of what slot `k` contributes to the transposed product with the row's entry
    /// `y`.
    pub(crate) fn transposed(&self, k: usize, y: DVec3) -> (f64, f64) {
        let slot = &self.slots[k];
        let along = self.n.dot(y);
        let along_error = (self.normal + 4.0) * y.length();
        let c = self.s * y - along * self.own_h;
        let c_error = (self.offset + 3.0 * self.s.abs()) * y.length()
            + along_error * self.own_h.length()
            + along.abs() * (self.h + 3.0 * self.own_h.length());
        let curl = (c - self.n * self.n.dot(c)) * self.over_length;
        let curl_error =
            self.over_length * (c_error + (3.0 * self.normal + 6.0) * c.length()) + curl.length() * self.normal;
        let mean = y + along * self.own_g;
        let mean_error = 3.0 * mean.length()
            + along_error * self.own_g.length()
            + along.abs() * (self.g + 2.0 * self.own_g.length());
        let size = slot.w.abs() * mean.length() + along.abs() * slot.z.length() + curl.length() * slot.chord.length();
        let error = slot.w.abs() * mean_error
            + along_error * slot.z.length()
            + along.abs() * self.z[k]
            + curl_error * slot.chord.length()
            + 6.0 * size;
        (ROUNDOFF * error, size)
    }
}
