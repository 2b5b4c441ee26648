//! Mean value coordinates that stay exact on edges and at vertices (paper, section 4.2).
//!
//! Equation (8), w_i = (t_{i-1} + t_i) / r_i with t_i = tan(alpha_i / 2), is infinite on an edge,
//! and its gradient (9) loses all digits of single precision near one. Coordinates are ratios of
//! weights, so a common factor is free. With s_i = v_i - v, A = s_i x s_{i+1} and D = s_i . s_{i+1}
//! of each edge:
//!
//! - t = A / (r r' + D) where D >= 0, else (r r' - D) / A: neither denominator cancels. A is the
//!   cross product of the *nearer* end with the edge, which keeps its digits next to a vertex.
//! - The edge k seen under the widest obtuse angle sets tau = 1 / t_k = A_k / (r r' - D_k), and T_i
//!   = tau t_i replaces t_i: T_k = 1, the others are at most 1. tau is smooth through the edge and
//!   zero on it, where the weights become the linear ones.
//! - All weights are multiplied by the distance r_q to the nearest vertex q, so that nothing
//!   overflows there.
//!
//! The gradient of t is (1 + t^2) / 2 times that of the angle, and that is a' - a with a = (s_y,
//! -s_x) / r^2. The form is the same on both sides of an edge, outside the polygon and in its
//! holes, for any number of loops.

use super::outline::{Outline, cross, dot, sub};
use crate::engine::Real;

/// Distance, in local units, below which a point is at a vertex. Its square and the inverse of that
/// are normal numbers of single precision.
pub(super) const AT_VERTEX: f64 = 1e-15;

/// Vertices whose terms are added up by themselves before they are added to the rest. In single
/// precision the sums, not the terms, carry most of the error where there are many vertices: every
/// term costs a rounding of what the sum has grown to so far.
pub(super) const BLOCK: usize = 32;

/// Stands in for an area that is zero.
const NO_AREA: f64 = 1e-30;

/// What a first pass over the edges finds out about a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scan<R> {
    /// The nearest vertex; the first of those that are equally near.
    pub(super) nearest: usize,
    /// The square of its distance.
    pub(super) square: R,
    /// The edge seen under the widest angle, if that is obtuse; named by the vertex it leaves.
    pub(super) widest: Option<usize>,
    /// A and D of that edge.
    area: R,
    product: R,
}

impl<R: Real> Scan<R> {
    /// Whether the point lies on the edge `widest`.
    pub(super) fn on_edge(&self) -> bool {
        self.widest.is_some() && self.area == R::ZERO
    }

    /// Whether the point is at the vertex `nearest`.
    pub(super) fn at_vertex(&self) -> bool {
        self.square <= R::of(AT_VERTEX * AT_VERTEX)
    }
}

/// A with the digits of the nearer end.
#[inline(always)]
fn area<R: Real>(s: [R; 2], next: [R; 2], edge: [R; 2]) -> R {
    cross(if dot(next, next) < dot(s, s) { next } else { s }, edge)
}

/// The first pass.
pub(super) fn scan<R: Real>(outline: &Outline<R>, p: [R; 2]) -> Scan<R> {
    let mut found = Scan { nearest: 0, square: R::HUGE, widest: None, area: R::ONE, product: R::ZERO };
    for (i, k) in outline.edges() {
        let (v, w) = (outline.vertices[i], outline.vertices[k]);
        let (s, next) = (sub(v, p), sub(w, p));
        let square = dot(s, s);
        if square < found.square {
            (found.nearest, found.square) = (i, square);
        }
        let d = dot(s, next);
        if d < R::ZERO {
            let a = area(s, next, sub(w, v));
            // |A / D| falls as an obtuse angle widens; the products compare the quotients.
            if a.abs() * found.product.abs() < found.area.abs() * d.abs() {
                (found.widest, found.area, found.product) = (Some(i), a, d);
            }
        }
    }
    found
}

/// One end of an edge, seen from the point.
#[derive(Clone, Copy)]
struct Spoke<R> {
    s: [R; 2],
    r: R,
    /// 1 / r.
    inverse: R,
}

/// T of an edge and its gradient.
#[derive(Clone, Copy)]
struct Half<R> {
    t: R,
    gradient: [R; 2],
}

/// Calls `each` with every vertex, its scaled weight and, if `GRADIENT`, the gradient of the
/// latter. Scaled weights are a common multiple of the weights of (8); the point is not at a
/// vertex. Within a loop the first vertex comes last.
#[inline(always)]
pub(super) fn visit<R: Real, const GRADIENT: bool>(
    outline: &Outline<R>,
    p: [R; 2],
    found: &Scan<R>,
    mut each: impl FnMut(usize, R, [R; 2]),
) {
    let half = R::of(0.5);
    let scale = found.square.sqrt();
    let spoke = |i: usize| {
        let s = sub(outline.vertices[i], p);
        let r = dot(s, s).sqrt();
        Spoke { s, r, inverse: R::ONE / r }
    };
    // Gradient of the angle under which an edge is seen.
    let turn = |a: &Spoke<R>, b: &Spoke<R>| {
        let (i, k) = (a.inverse * a.inverse, b.inverse * b.inverse);
        [b.s[1] * k - a.s[1] * i, a.s[0] * i - b.s[0] * k]
    };
    let mut tau = R::ONE;
    let mut tau_gradient = [R::ZERO; 2];
    if let Some(k) = found.widest {
        let end = outline
            .loops
            .iter()
            .find(|ring| ring.contains(&k))
            .map_or(k, |ring| if k + 1 == ring.end { ring.start } else { k + 1 });
        let (a, b) = (spoke(k), spoke(end));
        tau = found.area / (a.r * b.r - found.product);
        let factor = -half * (R::ONE + tau * tau);
        tau_gradient = turn(&a, &b).map(|g| factor * g);
    }
    let edge = |i: usize, k: usize, a: &Spoke<R>, b: &Spoke<R>| {
        if found.widest == Some(i) {
            return Half { t: R::ONE, gradient: [R::ZERO; 2] };
        }
        let area = area(a.s, b.s, sub(outline.vertices[k], outline.vertices[i]));
        let (d, rr) = (dot(a.s, b.s), a.r * b.r);
        let t = if d < R::ZERO {
            // Zero only where edges touch, which no valid polygon has.
            (rr - d) / if area == R::ZERO { R::of(NO_AREA) } else { area }
        } else {
            area / (rr + d)
        };
        let scaled = tau * t;
        let mut gradient = [R::ZERO; 2];
        if GRADIENT {
            let g = turn(a, b);
            let factor = half * (tau + scaled * t);
            gradient = [t * tau_gradient[0] + factor * g[0], t * tau_gradient[1] + factor * g[1]];
        }
        Half { t: scaled, gradient }
    };
    let mut finish = |i: usize, a: &Spoke<R>, before: &Half<R>, after: &Half<R>| {
        let c = scale * a.inverse;
        let w = c * (before.t + after.t);
        let mut gradient = [R::ZERO; 2];
        if GRADIENT {
            let radial = w * a.inverse * a.inverse;
            for axis in 0..2 {
                gradient[axis] = c * (before.gradient[axis] + after.gradient[axis]) + radial * a.s[axis];
            }
        }
        each(i, w, gradient);
    };
    for ring in &outline.loops {
        let first = spoke(ring.start);
        if ring.len() < 2 {
            continue;
        }
        let mut here = spoke(ring.start + 1);
        let leaving = edge(ring.start, ring.start + 1, &first, &here);
        let mut before = leaving;
        for i in ring.start + 1..ring.end {
            let next = if i + 1 == ring.end { ring.start } else { i + 1 };
            let there = if next == ring.start { first } else { spoke(next) };
            let after = edge(i, next, &here, &there);
            finish(i, &here, &before, &after);
            (here, before) = (there, after);
        }
        finish(ring.start, &first, &before, &leaving);
    }
}
