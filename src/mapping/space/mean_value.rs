//! Mean value coordinates of a closed triangle mesh that stay exact on faces, edges and corners
//! (Ju, Schaefer, Warren 2005).
//!
//! A point x sees the cage on the unit sphere around it; the mean value interpolant of data U on
//! the cage is the mean of U / r over that sphere, divided by the mean of 1 / r. Over a face whose
//! plane has the signed distance h (positive inside), with r the distance of x to a point of it,
//! that is
//!
//! - weight `Q = h ∫ dA / r^4`, moment `∫ U h dA / r^4 = Q U(q) + (h / 2) Σ_j E_j ∂U/∂m_j`
//!
//! where q is the foot of x in the plane, U(q) the value there of the linear function that U is on
//! the face, m_j the normal of edge j in the plane, to the inside, and `E_j = ∫ ds / r^2 = θ_j /
//! β_j` with the angle θ_j under which x sees the edge and the distance β_j to its line. No vertex
//! has to be summed by itself: faces contribute one after the other, and what divides by the
//! determinant of the corners elsewhere has no determinant here.
//!
//! `S = h Q` as Ju et al. have it, half the sum of θ_j b_j / β_j with b_j the signed distance of q
//! to the edges, cancels to h^2 wherever x comes near the plane of *any* face: in single precision
//! a cage of some hundred faces spoils it everywhere. Green's theorem with the antiderivative that
//! vanishes far away has the cancellation done:
//!
//! - `Q / h = I_4 = π / h^2 [q in the face] - 1/2 Σ_j sign(b_j) K_j`
//! - `K_j = φ_j / (β_j (β_j + |b_j|)) + |b_j| / β_j (φ_j - θ_j) / h^2`, with φ_j the angle under
//!   which q sees the edge,
//! - `tan(φ_j - θ_j) = h^2 l (|b| β - t_1 t_2) / (β + |b|) / ((b^2 + t_1 t_2)(β^2 + t_1 t_2) + |b|
//!   β l^2)`
//!
//! for an edge of length l whose ends lie at t_1 and t_2 along its line, from the foot of x.
//! Derivatives by x are as short, with `E4_j = ∫ ds / r^4` and `F_j = ∫ t ds / r^4`:
//!
//! - `∇Q = n (I_4 + Σ b_j E4_j) + h Σ m_j E4_j`, `∇E_j = 2 E4_j (h n - b_j m_j) + 2 F_j e_j`.
//!
//! A point in the plane of a face is worked on as if it were [`ON_FACE`] roundings off it, and one
//! right over a corner as if it were [`OVER_CORNER`] towards the middle: so far the map is that of
//! the limit, linear on the face. Displacements are taken relative to that of the closest place of
//! the cage, so that near it, where the weights grow without bound, only small numbers are
//! multiplied by large ones. The same form holds outside. Turning all faces over changes the signs
//! of all weights and no quotient.
//!
//! All of it is written once, over [`Lane`]: its instance on `f64` is the reference, the one on
//! `f32` mirrors the kernels, the others are the fast path of the CPU. O(faces) per point.

use super::angle::angle;
use super::face::Face;
use crate::engine::{Lane, Real};

/// Distance to a plane, in local units and roundings, that stands in for a smaller one on either
/// side. Which side of a face it is on rounding decides below that, and next to an edge the two
/// faces have to agree.
pub(super) const ON_FACE: f64 = 4.0;

/// Distance in the plane from a corner that stands in for none.
pub(super) const OVER_CORNER: f64 = 1e-15;

/// Distance to a vertex below which a point is at it.
pub(super) const AT_VERTEX: f64 = 1e-15;

/// A vector in lanes.
pub(super) type V3<L> = [L; 3];

#[inline(always)]
fn vector<L: Lane>(cpu: L::Cpu, v: [L::E; 3]) -> V3<L> {
    [L::splat(cpu, v[0]), L::splat(cpu, v[1]), L::splat(cpu, v[2])]
}

#[inline(always)]
fn dot<L: Lane>(a: V3<L>, b: V3<L>) -> L {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

#[inline(always)]
fn sub<L: Lane>(a: V3<L>, b: V3<L>) -> V3<L> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn choose<L: Lane>(mask: L::Mask, a: V3<L>, b: V3<L>) -> V3<L> {
    [L::select(mask, a[0], b[0]), L::select(mask, a[1], b[1]), L::select(mask, a[2], b[2])]
}

/// `sum + s v`.
#[inline(always)]
fn add<L: Lane>(sum: &mut V3<L>, s: L, v: V3<L>) {
    for axis in 0..3 {
        sum[axis] = s.mul_add(v[axis], sum[axis]);
    }
}

/// A face as the points see it.
struct View<L> {
    /// Distance to the plane along the normal.
    h: L,
    /// From the foot in the plane to the corners.
    a: [V3<L>; 3],
    /// Signed distances of the foot to the edges, positive inside.
    b: [L; 3],
}

#[inline(always)]
fn view<L: Lane>(cpu: L::Cpu, face: &Face<L::E>, x: V3<L>) -> View<L> {
    let n = vector::<L>(cpu, face.normal);
    let mut height = [x[0]; 3];
    let mut a = [x; 3];
    let mut square = [x[0]; 3];
    for i in 0..3 {
        let p = sub(vector(cpu, face.corners[i]), x);
        height[i] = dot(n, p);
        a[i] = p;
        add(&mut a[i], -height[i], n);
        let s = dot(a[i], a[i]);
        let over = s.lt(L::num(cpu, OVER_CORNER * OVER_CORNER));
        let toward = vector::<L>(cpu, face.toward[i]).map(|t| t * L::num(cpu, -OVER_CORNER));
        a[i] = choose(over, toward, a[i]);
        square[i] = L::select(over, L::num(cpu, OVER_CORNER * OVER_CORNER), s);
    }
    // Distances are measured from the nearest corner, whose digits are the best.
    let first = square[1].lt(square[0]);
    let (least, mut h) = (L::select(first, square[1], square[0]), L::select(first, height[1], height[0]));
    h = L::select(square[2].lt(least), height[2], h);
    let floor = L::num(cpu, ON_FACE * L::E::EPSILON.to_f64());
    h = L::select(h.abs().lt(floor), floor, h);
    let mut b = [h; 3];
    for j in 0..3 {
        let (k, l) = ((j + 1) % 3, (j + 2) % 3);
        b[j] = -dot(vector(cpu, face.inward[j]), choose(square[l].lt(square[k]), a[l], a[k]));
    }
    View { h, a, b }
}

impl<L: Lane> View<L> {
    /// The smallest of the distances to the edges: negative where the foot lies outside the face.
    #[inline(always)]
    fn margin(&self) -> L {
        self.b[0].minimum(self.b[1]).minimum(self.b[2])
    }

    /// The linear displacement of the face at the foot.
    #[inline(always)]
    fn displacement(&self, cpu: L::Cpu, face: &Face<L::E>) -> V3<L> {
        let mut u = vector::<L>(cpu, face.displacement);
        for row in 0..3 {
            u[row] = u[row] - dot(vector(cpu, face.gradient[row]), self.a[0]);
        }
        u
    }
}

/// The place of the cage that is closest to a point.
pub(super) struct Closest<L> {
    /// Squared distance to the nearest vertex, and its displacement.
    pub(super) vertex: L,
    pub(super) corner: V3<L>,
    /// Squared distance to the nearest place of all edges; not looked for by [`nearest_vertex`].
    pub(super) edge: L,
    /// Displacement of the closest place.
    pub(super) base: V3<L>,
}

/// The nearest vertex only; `base` is its displacement.
#[inline(always)]
pub(super) fn nearest_vertex<L: Lane>(
    cpu: L::Cpu,
    vertices: &[[L::E; 3]],
    displacements: &[[L::E; 3]],
    x: V3<L>,
) -> Closest<L> {
    let mut best = L::splat(cpu, L::E::HUGE);
    let mut corner = [L::num(cpu, 0.0); 3];
    for (v, u) in vertices.iter().zip(displacements) {
        let p = sub(vector(cpu, *v), x);
        let square = dot(p, p);
        let closer = square.lt(best);
        best = L::select(closer, square, best);
        corner = choose(closer, vector(cpu, *u), corner);
    }
    Closest { vertex: best, corner, edge: best, base: corner }
}

/// The closest place of all vertices, edges and faces. Where the foot lies in the closest face the
/// base is, to the last digit, what the sums over the faces find there.
#[inline(always)]
pub(super) fn closest<L: Lane>(
    cpu: L::Cpu,
    faces: &[Face<L::E>],
    vertices: &[[L::E; 3]],
    displacements: &[[L::E; 3]],
    x: V3<L>,
) -> Closest<L> {
    let mut found = nearest_vertex(cpu, vertices, displacements, x);
    let zero = L::num(cpu, 0.0);
    let mut best = found.vertex;
    for face in faces {
        let seen = view(cpu, face, x);
        let flat = seen.h * seen.h;
        let here = seen.displacement(cpu, face);
        for j in 0..3 {
            let (k, l) = ((j + 1) % 3, (j + 2) % 3);
            let e = vector::<L>(cpu, face.edges[j]);
            let square = seen.b[j].mul_add(seen.b[j], flat);
            // Not beside the edge: the nearest vertex is there.
            let beside = (dot(e, seen.a[k]) * dot(e, seen.a[l])).lt(zero);
            let square = L::select(beside, square, L::splat(cpu, L::E::HUGE));
            found.edge = found.edge.minimum(square);
            let closer = square.lt(best);
            best = L::select(closer, square, best);
            let mut there = here;
            add(&mut there, -seen.b[j], vector(cpu, face.slopes[j]));
            found.base = choose(closer, there, found.base);
        }
        let square = L::select(seen.margin().lt(zero), L::splat(cpu, L::E::HUGE), flat);
        // Also where an edge is equally near.
        let farther = best.lt(square);
        best = L::select(farther, best, square);
        found.base = choose(farther, found.base, here);
    }
    found
}

/// Sums over the faces.
#[derive(Clone, Copy)]
pub(super) struct Sums<L> {
    pub(super) weight: L,
    pub(super) moved: V3<L>,
    pub(super) weight_gradient: V3<L>,
    pub(super) moved_gradient: [V3<L>; 3],
}

impl<L: Lane> Sums<L> {
    #[inline(always)]
    pub(super) fn none(cpu: L::Cpu) -> Self {
        let zero = [L::num(cpu, 0.0); 3];
        Self { weight: zero[0], moved: zero, weight_gradient: zero, moved_gradient: [zero; 3] }
    }

    #[inline(always)]
    pub(super) fn join(&mut self, other: &Self) {
        let one = |a: &mut V3<L>, b: &V3<L>| (0..3).for_each(|axis| a[axis] = a[axis] + b[axis]);
        self.weight = self.weight + other.weight;
        one(&mut self.moved, &other.moved);
        one(&mut self.weight_gradient, &other.weight_gradient);
        for row in 0..3 {
            one(&mut self.moved_gradient[row], &other.moved_gradient[row]);
        }
    }
}

/// What an edge contributes.
pub(super) struct Edge<L> {
    /// sign(b) K.
    pub(super) k: L,
    /// E = ∫ ds / r^2.
    pub(super) e: L,
    /// ∫ ds / r^4 and ∫ t ds / r^4.
    fourth: L,
    tilt: L,
}

/// The edge with its ends at `t1` and `t2` along it and the foot `b` beside it, for h^2 and its
/// inverse.
#[inline(always)]
fn edge<L: Lane, const GRADIENT: bool>(cpu: L::Cpu, length: L, b: L, [h2, over]: [L; 2], t1: L, t2: L) -> Edge<L> {
    let (zero, half) = (L::num(cpu, 0.0), L::num(cpu, 0.5));
    let across = b.abs();
    let (b2, tau) = (b * b, t1 * t2);
    let beta2 = b2 + h2;
    let beta = beta2.sqrt();
    let inverse = L::num(cpu, 1.0) / beta;
    let (near, far) = (b2 + tau, beta2 + tau);
    let phi = angle(cpu, across * length, near);
    let theta = angle(cpu, beta * length, far);
    let part = L::num(cpu, 1.0) / (beta + across);
    // The angle phi - theta over h^2.
    let product = across * beta;
    let s = h2 * (length * (product - tau) * part);
    let c = near.mul_add(far, product * (length * length));
    let shift = angle(cpu, s.abs(), c) * over;
    let shift = L::select(s.lt(zero), -shift, shift);
    let mut k = inverse * (phi * part + across * shift);
    let e = theta * inverse;
    let (mut fourth, mut tilt) = (zero, zero);
    if GRADIENT {
        let (r1, r2) = (t1.mul_add(t1, beta2), t2.mul_add(t2, beta2));
        let both = length / (r1 * r2);
        fourth = half * both.mul_add(beta2 - tau, e) * (inverse * inverse);
        tilt = half * both * (t1 + t2);
        // On the edge's line beyond its ends terms of K and of E4 cancel; there the integrands are
        // series in beta / t.
        let nearest = t1.abs().minimum(t2.abs());
        let bound = L::num(cpu, L::E::EPSILON.to_f64().sqrt().sqrt()) * (nearest * nearest);
        let one = L::num(cpu, 1.0);
        let (p, q) = (one / t1, one / t2);
        let (p2, q2, pq) = (p * p, q * q, p * q);
        // (p^3 - q^3) / 3, (p^5 - q^5) / 5 and (p^7 - q^7) / 7, for p - q = l p q.
        let scale = length * pq;
        let middle = p2 + pq + q2;
        let cubes = scale * middle * L::num(cpu, 1.0 / 3.0);
        let fifths = scale * (p2 * p2 + pq * middle + q2 * q2) * L::num(cpu, 0.2);
        let sevenths =
            scale * (p2 * p2 * p2 + q2 * q2 * q2 + pq * (p2 * p2 + q2 * q2 + pq * middle)) * L::num(cpu, 1.0 / 7.0);
        let e4 = cubes + beta2 * (L::num(cpu, 3.0) * beta2 * sevenths - (fifths + fifths));
        let k4 = across * (cubes - (b2 + beta2) * fifths + (b2 * b2 + beta2 * (b2 + beta2)) * sevenths);
        let beyond = zero.lt(L::select(beta2.lt(bound), tau, -one));
        fourth = L::select(beyond, e4, fourth);
        k = L::select(beyond, k4, k);
    }
    Edge { k: L::select(b.lt(zero), -k, k), e, fourth, tilt }
}

/// Adds a face to the sums; displacements are relative to `base`.
#[inline(always)]
pub(super) fn add_face<L: Lane, const GRADIENT: bool>(
    cpu: L::Cpu,
    face: &Face<L::E>,
    x: V3<L>,
    base: V3<L>,
    sums: &mut Sums<L>,
) {
    let (zero, half) = (L::num(cpu, 0.0), L::num(cpu, 0.5));
    let seen = view(cpu, face, x);
    let h = seen.h;
    let h2 = h * h;
    let over = L::num(cpu, 1.0) / h2;
    let n = vector::<L>(cpu, face.normal);
    let inside = L::select(seen.margin().lt(zero), zero, L::num(cpu, std::f64::consts::PI));
    let moved = sub(seen.displacement(cpu, face), base);
    let mut green = zero;
    // Σ E_j ∂U/∂m_j, Σ b_j E4_j and Σ m_j E4_j.
    let (mut tangent, mut outward, mut along) = ([zero; 3], zero, [zero; 3]);
    for j in 0..3 {
        let (k, l) = ((j + 1) % 3, (j + 2) % 3);
        let direction = vector::<L>(cpu, face.edges[j]);
        let (t1, t2) = (dot(direction, seen.a[k]), dot(direction, seen.a[l]));
        let b = seen.b[j];
        let part = edge::<L, GRADIENT>(cpu, L::splat(cpu, face.lengths[j]), b, [h2, over], t1, t2);
        green = green + part.k;
        let slope = vector::<L>(cpu, face.slopes[j]);
        add(&mut tangent, part.e, slope);
        if GRADIENT {
            let m = vector::<L>(cpu, face.inward[j]);
            outward = b.mul_add(part.fourth, outward);
            add(&mut along, part.fourth, m);
            // The gradient of (h / 2) E_j.
            let mut y = [zero; 3];
            add(&mut y, h2 * part.fourth - half * part.e, n);
            add(&mut y, -(h * b * part.fourth), m);
            add(&mut y, h * part.tilt, direction);
            for row in 0..3 {
                add(&mut sums.moved_gradient[row], slope[row], y);
            }
        }
    }
    let fourth = inside * over - half * green;
    let weight = h * fourth;
    sums.weight = sums.weight + weight;
    add(&mut sums.moved, weight, moved);
    add(&mut sums.moved, half * h, tangent);
    if GRADIENT {
        let mut gradient = [zero; 3];
        add(&mut gradient, fourth + outward, n);
        add(&mut gradient, h, along);
        add(&mut sums.weight_gradient, L::num(cpu, 1.0), gradient);
        for row in 0..3 {
            add(&mut sums.moved_gradient[row], moved[row], gradient);
            add(&mut sums.moved_gradient[row], weight, vector(cpu, face.gradient[row]));
        }
    }
}

/// The weights of the three corners of a face, in the units of [`Sums::weight`].
pub(super) fn corner_weights(face: &Face<f64>, x: [f64; 3]) -> [f64; 3] {
    let seen = view::<f64>((), face, x);
    let h2 = seen.h * seen.h;
    let mut green = 0.0;
    let mut e = [0.0; 3];
    for j in 0..3 {
        let (k, l) = ((j + 1) % 3, (j + 2) % 3);
        let (t1, t2) = (dot(face.edges[j], seen.a[k]), dot(face.edges[j], seen.a[l]));
        let part = edge::<f64, false>((), face.lengths[j], seen.b[j], [h2, 1.0 / h2], t1, t2);
        green += part.k;
        e[j] = part.e;
    }
    let inside = if seen.margin() < 0.0 { 0.0 } else { std::f64::consts::PI };
    let weight = seen.h * (inside / h2 - 0.5 * green);
    [0, 1, 2].map(|i| {
        let tangent: f64 = (0..3).map(|j| e[j] * dot(face.inward[i], face.inward[j])).sum();
        (weight * seen.b[i] + 0.5 * seen.h * tangent) / face.heights[i]
    })
}
