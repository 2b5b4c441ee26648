//! How far the map may drift between anchors, foretold from anchors left out.
//!
//! A wrong map can be smooth, and its averages can lie on the source: then no residual and no round
//! trip betrays it. What remains is to ask each anchor where the others would have sent it.

use rayon::prelude::*;

use super::procrustes::{identity, orthogonal};
use crate::geometry::SurfacePoint;
use crate::surface::PhongSurface;
use crate::surface::anchors::AnchorPairs;
use crate::surface::average::{GAMMA, orthonormalise, weights};
use crate::surface::vector::{Vector, add_scaled, distance_squared, dot, sub};

/// A point of a surface with its tangent plane.
pub(crate) type Place<const D: usize> = (Vector<f64, D>, [Vector<f64, D>; 2]);

/// The anchors in both embeddings.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Anchors<'a, const D: usize> {
    /// On the target.
    pub(crate) a: &'a [Vector<f64, D>],
    /// On the source.
    pub(crate) b: &'a [Vector<f64, D>],
}

/// Weights `1/D_i^2` of eq. 13 of the anchors `a` at a point; a thousandth of an edge squared keeps
/// that of an anchor at the point finite.
pub(crate) fn nearness<const D: usize>((y, t): &Place<D>, a: &[Vector<f64, D>]) -> Vec<f64> {
    a.iter()
        .map(|a| {
            let d = sub(a, y);
            let (p, q) = (dot(&d, &t[0]), dot(&d, &t[1]));
            let tangential = p * p + q * q;
            (tangential + GAMMA * (dot(&d, &d) - tangential).max(0.0) + 1e-6).powi(-2)
        })
        .collect()
}

pub(crate) fn place<const D: usize>(surface: &PhongSurface<f64, D>, p: &SurfacePoint) -> Place<D> {
    let triangle = surface.triangle(p.face);
    (triangle.point(&p.barycentric), orthonormalise(triangle.psi(&p.barycentric)))
}

/// The orthogonal map that fits all anchors, with edges of the source per edge of the target.
pub(crate) type Carry<const D: usize> = ([Vector<f64, D>; D], f64);

/// Where the anchors send a point of the target; `carry` ([`global_fit`] of the same anchors) where
/// residuals are carried over.
pub(crate) fn predict<const D: usize>(
    at: &Place<D>,
    anchors: Anchors<'_, D>,
    carry: Option<&Carry<D>>,
) -> Vector<f64, D> {
    let Anchors { a, b } = anchors;
    let mut w = vec![0.0; a.len()];
    weights(&at.0, &at.1, a, &mut w);
    let average = |x: &[Vector<f64, D>]| w.iter().zip(x).fold([0.0; D], |sum, (&w, x)| add_scaled(&sum, w, x));
    let mean = average(b);
    let Some((global, scale)) = carry else { return mean };
    let q = orthogonal(a, b, &nearness(at, a), global);
    let r = sub(&at.0, &average(a));
    std::array::from_fn(|i| mean[i] + scale * dot(&q[i], &r))
}

/// The orthogonal map that fits all anchors alike.
pub(crate) fn global_fit<const D: usize>(anchors: Anchors<'_, D>) -> [Vector<f64, D>; D] {
    orthogonal(anchors.a, anchors.b, &vec![1.0; anchors.a.len()], &identity())
}

/// For each anchor the distance, along the source's tangent plane and in its edges, between its
/// place and where all others send it. O(n^2 D^2).
fn left_out<const D: usize>(
    source: &PhongSurface<f64, D>,
    target: &PhongSurface<f64, D>,
    pairs: &AnchorPairs,
    anchors: Anchors<'_, D>,
    scale: Option<f64>,
) -> Vec<f64> {
    (0..pairs.target.len())
        .into_par_iter()
        .map(|i| {
            let without = |x: &[Vector<f64, D>]| [&x[..i], &x[i + 1..]].concat();
            let (a, b) = (without(anchors.a), without(anchors.b));
            let others = Anchors { a: &a, b: &b };
            let carry = scale.map(|scale| (global_fit(others), scale));
            let sent = predict(&place(target, &pairs.target[i]), others, carry.as_ref());
            let (y, basis) = place(source, &pairs.source[i]);
            let off = sub(&sent, &y);
            dot(&off, &basis[0]).hypot(dot(&off, &basis[1]))
        })
        .collect()
}

/// Anchors nearer to one another than this part of the largest distance are one.
const SAME: f64 = 1e-9;

/// The expected error at every vertex of the target, in edges of the source. O(V n D + n^2 D^2).
pub(crate) fn expected_drift<const D: usize>(
    source: &PhongSurface<f64, D>,
    target: &PhongSurface<f64, D>,
    pairs: &AnchorPairs,
    anchors: Anchors<'_, D>,
    scale: Option<f64>,
) -> Vec<f64> {
    spread_drift(target, 1.0, anchors.a, &left_out(source, target, pairs, anchors, scale))
}

/// Errors of left out anchors spread over the vertices of the target; `edge` is the unit of the
/// anchors `a`.
///
/// An anchor left out, with the next one at a distance s, comes out wrong by L: a drift of L / s
/// per unit of distance. The drift at a vertex is the average of these over the anchors with
/// weights `1/d^4` of their distances d, times the distance of the nearest anchor; it is 0 on
/// anchors, and everywhere if the two surfaces with their anchors are congruent and residuals are
/// carried over. Distances are those of the embedding. On pairs with known truth it ranks what is
/// smooth but wrong, which the residual does not (docs/measurements.md). O(V n D).
pub(crate) fn spread_drift<const D: usize>(
    target: &PhongSurface<f64, D>,
    edge: f64,
    a: &[Vector<f64, D>],
    left_out: &[f64],
) -> Vec<f64> {
    let rates: Vec<f64> = left_out
        .iter()
        .enumerate()
        .map(|(i, l)| {
            let others = || (0..a.len()).filter(|j| *j != i).map(|j| distance_squared(&a[i], &a[j]));
            // One that is given again, as a copy of its vertex may be, is no other place.
            let least = SAME * SAME * others().fold(0.0, f64::max);
            let next = others().filter(|d| *d > least).fold(f64::INFINITY, f64::min).sqrt();
            // A single anchor says nothing.
            if next.is_finite() && !l.is_nan() { l / next.max(f64::MIN_POSITIVE) } else { f64::MAX }
        })
        .collect();
    target
        .vertices
        .par_iter()
        .map(|vertex| {
            let y = vertex.y.map(|x| x * edge);
            let nearest = a.iter().map(|a| distance_squared(a, &y)).fold(f64::INFINITY, f64::min);
            if !(nearest > f64::MIN_POSITIVE) {
                return 0.0;
            }
            let (mut sum, mut total) = (0.0, 0.0);
            for (a, rate) in a.iter().zip(&rates) {
                let weight = (nearest / distance_squared(a, &y)).powi(2);
                sum += weight * rate;
                total += weight;
            }
            let drift = sum / total * nearest.sqrt();
            if drift.is_finite() { drift } else { f64::MAX }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Mesh, Topology};
    use crate::models::shapes::lobed_sphere;
    use crate::surface::anchors::vertex_point;

    /// A surface "embedded" by its own positions, with anchors at every 31st vertex.
    fn surface(mesh: &Mesh) -> (PhongSurface<f64, 4>, Vec<SurfacePoint>) {
        let topology = Topology::new(mesh);
        let points: Vec<f64> = mesh.positions.iter().flat_map(|p| [p.x, p.y, p.z, 0.0]).collect();
        let anchors =
            (0..mesh.vertex_count() as u32).step_by(31).map(|v| vertex_point(mesh, &topology, v, "anchor").unwrap());
        (PhongSurface::new(&topology, &points).unwrap(), anchors.collect())
    }

    fn drift(source: &Mesh, target: &Mesh, rotate: usize) -> Vec<f64> {
        let ((s, mut on_source), (t, on_target)) = (surface(source), surface(target));
        on_source[3..6].rotate_left(rotate);
        let a: Vec<_> = on_target.iter().map(|p| t.embed(p)).collect();
        let b: Vec<_> = on_source.iter().map(|p| s.embed(p)).collect();
        let pairs = AnchorPairs { source: on_source, target: on_target };
        expected_drift(&s, &t, &pairs, Anchors { a: &a, b: &b }, Some(1.0))
    }

    #[test]
    fn nothing_drifts_between_congruent_surfaces() {
        let mesh = lobed_sphere(3, 0.3);
        let mut turned = mesh.clone();
        turned.positions.iter_mut().for_each(|p| *p = glam::DVec3::new(-p.y, p.x, p.z) + 2.0);
        let drift = drift(&turned, &mesh, 0);
        assert!(drift.iter().all(|&d| d < 1e-5), "{:?}", drift.iter().copied().fold(0.0, f64::max));
    }

    #[test]
    fn an_anchor_given_again_changes_nothing_elsewhere() {
        let mesh = lobed_sphere(3, 0.3);
        let (surface, points) = surface(&mesh);
        let mut a: Vec<_> = points.iter().map(|p| surface.embed(p)).collect();
        let errors = vec![0.01; a.len()];
        let once = spread_drift(&surface, 1.0, &a, &errors);
        // Left out, it is where its copy has it, but for rounding.
        a.push(a[2]);
        let mut again = errors.clone();
        again.push(1e-17);
        again[2] = 1e-17;
        let twice = spread_drift(&surface, 1.0, &a, &again);
        assert!(once.iter().zip(&twice).all(|(one, two)| *two <= 2.0 * one + 1e-12));
    }

    #[test]
    fn drift_is_zero_on_anchors_and_grows_where_anchors_are_wrong() {
        let mesh = lobed_sphere(3, 0.3);
        let mut swollen = mesh.clone();
        swollen.positions.iter_mut().for_each(|p| *p *= 1.0 + 0.2 * p.x.sin());
        let right = drift(&swollen, &mesh, 0);
        assert!(right.iter().step_by(31).all(|&d| d == 0.0));
        assert!(right.iter().all(|&d| d >= 0.0) && right.iter().any(|&d| d > 1e-3));
        // Three anchors in a circle: each is then contradicted by all the others.
        let wrong = drift(&swollen, &mesh, 1);
        let near = 4 * 31 + 1;
        assert!(wrong[near] > 5.0 * right[near].max(1e-3), "{} {}", wrong[near], right[near]);
    }

    #[test]
    fn anchors_at_one_place_and_few_of_them_give_finite_numbers() {
        let mesh = lobed_sphere(2, 0.3);
        let (s, points) = surface(&mesh);
        for chosen in [&points[..1], &points[..2], &[points[0], points[0], points[1]]] {
            let a: Vec<_> = chosen.iter().map(|p| s.embed(p)).collect();
            let pairs = AnchorPairs { source: chosen.to_vec(), target: chosen.to_vec() };
            for scale in [None, Some(1.0)] {
                let drift = expected_drift(&s, &s, &pairs, Anchors { a: &a, b: &a }, scale);
                assert!(drift.iter().all(|d| d.is_finite() && *d >= 0.0));
            }
        }
    }
}
