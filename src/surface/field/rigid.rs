//! Maps that are rigid near every point, fitted to anchors by moving least squares.

use glam::DVec3;
use nalgebra::Matrix3;

use crate::surface::correspondence::procrustes::orthogonal;
use crate::surface::vector::{Vector, add_scaled, distance_squared, dot, sub};

/// Squared length, at unit area, that keeps weights at an anchor finite.
const LEAST: f64 = 1e-12;
/// Part of the wider fit in the rotation of space.
const WIDE: f64 = 0.3;
/// Squared length, at unit area, over which the wider fit looks.
const WIDTH: f64 = 0.02;

/// The image of `y` under the orthogonal map, times `scale`, and shift that fit the anchors `a ->
/// b` with weights `|y - a_i|^-4`, anchor `skip` left out.
pub(super) fn rigid<const D: usize>(
    y: &Vector<f64, D>,
    (a, b): (&[Vector<f64, D>], &[Vector<f64, D>]),
    completion: &[Vector<f64, D>; D],
    scale: f64,
    skip: Option<usize>,
) -> Vector<f64, D> {
    let weights = weights(y, a, skip, |d| d.powi(-2));
    let total: f64 = weights.iter().sum();
    let mean =
        |x: &[Vector<f64, D>]| x.iter().zip(&weights).fold([0.0; D], |sum, (x, w)| add_scaled(&sum, w / total, x));
    let (from, to) = (sub(y, &mean(a)), mean(b));
    let q = orthogonal(a, b, &weights, completion);
    std::array::from_fn(|i| to[i] + scale * dot(&q[i], &from))
}

/// Weights of the anchors by their squared distances from `y`.
fn weights<const D: usize>(
    y: &Vector<f64, D>,
    a: &[Vector<f64, D>],
    skip: Option<usize>,
    of: impl Fn(f64) -> f64,
) -> Vec<f64> {
    a.iter()
        .enumerate()
        .map(|(i, a)| if Some(i) == skip { 0.0 } else { of(distance_squared(a, y).max(LEAST)) })
        .collect()
}

/// How a map of space may turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Turn {
    /// By a reflection instead of a rotation.
    pub(super) mirror: bool,
    /// Lengths grow by this.
    pub(super) scale: f64,
}

/// The image of the point `x` of space, `y` in the embedding, under a rotation and shift fitted to
/// the anchors' places `s -> t` in space; how near anchors are is told by the embedding, so that an
/// arm does not drag the hip. Anchor `skip` is left out.
pub(super) fn rigid_in_space<const D: usize>(
    (y, x): (&Vector<f64, D>, DVec3),
    a: &[Vector<f64, D>],
    (s, t): (&[DVec3], &[DVec3]),
    turn: Turn,
    skip: Option<usize>,
) -> DVec3 {
    let near = weights(y, a, skip, |d| d.powi(-2));
    let wide = weights(y, a, skip, |d| 1.0 / (d + WIDTH));
    let mean = |p: &[DVec3], w: &[f64]| p.iter().zip(w).map(|(p, w)| *p * *w).sum::<DVec3>() / w.iter().sum::<f64>();
    let covariance = |w: &[f64]| {
        let (sm, tm) = (mean(s, w), mean(t, w));
        let mut h = Matrix3::zeros();
        for ((s, t), w) in s.iter().zip(t).zip(w) {
            let (p, q) = ((*s - sm).to_array(), (*t - tm).to_array());
            h += Matrix3::from_fn(|r, c| w * q[r] * p[c]);
        }
        let size = h.norm();
        if size > 0.0 { h / size } else { h }
    };
    let r = rotation(covariance(&near) + covariance(&wide) * WIDE, turn.mirror);
    let d = x - mean(s, &near);
    let turned = r * nalgebra::Vector3::new(d.x, d.y, d.z);
    mean(t, &near) + DVec3::new(turned.x, turned.y, turned.z) * turn.scale
}

/// The rotation (or reflection) nearest to `h`.
fn rotation(h: Matrix3<f64>, mirror: bool) -> Matrix3<f64> {
    // Without weights there is no fit; the decomposition does not end on what is not finite.
    if !h.iter().all(|x| x.is_finite()) {
        return Matrix3::identity();
    }
    let svd = h.svd(true, true);
    let (Some(u), Some(vt)) = (svd.u, svd.v_t) else { return Matrix3::identity() };
    let wanted = if mirror { -1.0 } else { 1.0 };
    // The direction with the least to say gives way.
    let mut last = Matrix3::identity();
    let k = svd.singular_values.imin();
    last[(k, k)] = if (u * vt).determinant() * wanted < 0.0 { -1.0 } else { 1.0 };
    u * last * vt
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::shapes::Random;
    use crate::surface::correspondence::procrustes::identity;

    fn cloud(n: usize, seed: u64) -> Vec<Vector<f64, 4>> {
        let mut random = Random::new(seed);
        (0..n).map(|_| std::array::from_fn(|_| random.signed())).collect()
    }

    #[test]
    fn a_rigid_motion_is_reproduced_also_by_what_is_left_out() {
        let a = cloud(9, 1);
        let motion = |p: &Vector<f64, 4>| [p[1] + 0.5, -p[0], p[2] - 1.0, -p[3]];
        let b: Vec<_> = a.iter().map(motion).collect();
        let y = [0.3, -0.2, 0.6, 0.1];
        for (i, skip) in [None, Some(0), Some(5)].into_iter().enumerate() {
            let found = rigid(&y, (&a, &b), &identity(), 1.0, skip);
            assert!(distance_squared(&found, &motion(&y)).sqrt() < 1e-4, "{i}");
        }
        let at = rigid(&a[3], (&a, &b), &identity(), 1.0, None);
        assert!(distance_squared(&at, &b[3]).sqrt() < 1e-9);
    }

    #[test]
    fn space_turns_or_mirrors_as_asked() {
        let a = cloud(9, 2);
        let s: Vec<DVec3> = a.iter().map(|p| DVec3::new(p[0], p[1], p[2])).collect();
        let turn = |p: DVec3| DVec3::new(-p.y, p.x, p.z) + 2.0;
        let flip = |p: DVec3| DVec3::new(p.x, -p.y, p.z);
        let x = DVec3::new(0.1, 0.4, -0.3);
        let y = [x.x, x.y, x.z, 0.0];
        for (mirror, map) in [(false, &turn as &dyn Fn(DVec3) -> DVec3), (true, &flip)] {
            let t: Vec<DVec3> = s.iter().map(|&p| map(p)).collect();
            let right = rigid_in_space((&y, x), &a, (&s, &t), Turn { mirror, scale: 1.0 }, None);
            assert!(right.distance(map(x)) < 1e-9);
            let wrong = rigid_in_space((&y, x), &a, (&s, &t), Turn { mirror: !mirror, scale: 1.0 }, None);
            assert!(wrong.distance(map(x)) > 1e-2);
        }
    }
}
