//! Wachspress coordinates of a strictly convex polygon, the paper's second basis (Fig. 2).
//!
//! w_i = C_i / (A_{i-1} A_i), with A_e twice the area that the point spans with edge e and C_i that
//! of the corner. They are rational, so they have derivatives at vertices as everywhere in the
//! closed polygon. All weights are divided by the largest, w_q: on an edge or at a vertex the areas
//! that vanish there are then in numerators only.

use super::outline::{Outline, cross, dot, sub};
use crate::engine::Real;
use crate::error::{Error, Result};
use crate::geometry::Polygon;

/// Stands in for an area that is zero, where weights are compared.
const NO_AREA: f64 = 1e-15;

/// Refuses what is not one strictly convex loop, anticlockwise.
///
/// # Errors
/// [`Error::Input`] naming the vertex.
pub(super) fn check(polygon: &Polygon) -> Result<()> {
    let remedy = "Use mean value coordinates (--coordinates mean-value), which take any polygon";
    let [ring] = polygon.loops() else {
        let what = format!("Wachspress coordinates need one convex loop, the polygon has {}", polygon.loops().len());
        return Err(Error::input(what, remedy));
    };
    let n = ring.len();
    let mut turning = 0;
    for i in 0..n {
        let (a, b) = (ring[(i + 1) % n] - ring[i], ring[(i + 2) % n] - ring[(i + 1) % n]);
        // Rounding of the coordinates must not decide.
        if !(a.perp_dot(b) > 1e-12 * a.length() * b.length()) {
            let what = format!("Wachspress coordinates need a strictly convex polygon, vertex {} is not", (i + 1) % n);
            return Err(Error::input(what, remedy));
        }
        turning += usize::from((a.y < 0.0) != (b.y < 0.0));
    }
    // A convex loop goes up once and down once; a star polygon turns left everywhere too.
    if n < 3 || turning > 2 {
        return Err(Error::input("Wachspress coordinates need a simple convex polygon of at least 3 vertices", remedy));
    }
    Ok(())
}

/// The vertex of the largest weight.
pub(super) fn pivot<R: Real>(outline: &Outline<R>, p: [R; 2]) -> usize {
    let n = outline.len();
    let mut best = (0, -R::ONE);
    for i in 0..n {
        let floor = |a: R| a.abs().maximum(R::of(NO_AREA));
        let w = corner(outline, i) / (floor(area(outline, p, (i + n - 1) % n)) * floor(area(outline, p, i)));
        if w > best.1 {
            best = (i, w);
        }
    }
    best.0
}

/// A of the edge that leaves vertex `i`, with the digits of its nearer end.
#[inline(always)]
fn area<R: Real>(outline: &Outline<R>, p: [R; 2], i: usize) -> R {
    let (v, w) = (outline.vertices[i], outline.vertices[(i + 1) % outline.len()]);
    let (s, next) = (sub(v, p), sub(w, p));
    cross(if dot(next, next) < dot(s, s) { next } else { s }, sub(w, v))
}

/// Gradient of that.
#[inline(always)]
fn slope<R: Real>(outline: &Outline<R>, i: usize) -> [R; 2] {
    let e = sub(outline.vertices[(i + 1) % outline.len()], outline.vertices[i]);
    [-e[1], e[0]]
}

#[inline(always)]
fn corner<R: Real>(outline: &Outline<R>, i: usize) -> R {
    let n = outline.len();
    let v = outline.vertices[i];
    cross(sub(v, outline.vertices[(i + n - 1) % n]), sub(outline.vertices[(i + 1) % n], v))
}

/// As [`super::mean_value::visit`], relative to the weight of vertex `q` ([`pivot`]).
#[inline(always)]
pub(super) fn visit<R: Real, const GRADIENT: bool>(
    outline: &Outline<R>,
    p: [R; 2],
    q: usize,
    mut each: impl FnMut(usize, R, [R; 2]),
) {
    let n = outline.len();
    if n == 0 {
        return;
    }
    let before = |i: usize| (i + n - 1) % n;
    let own = corner(outline, q);
    for i in 0..n {
        if i == q {
            each(i, R::ONE, [R::ZERO; 2]);
            continue;
        }
        let c = corner(outline, i) / own;
        // Quotients A_over / A_under; a neighbour of q shares an edge with it, whose areas cancel.
        let pairs = if before(i) == q {
            [(before(q), i), (q, q)]
        } else if i == before(q) {
            [(q, before(i)), (q, q)]
        } else {
            [(before(q), before(i)), (q, i)]
        };
        let mut value = c;
        let mut gradient = [R::ZERO; 2];
        for (over, under) in pairs.into_iter().filter(|(over, under)| over != under) {
            let (a, b) = (area(outline, p, over), area(outline, p, under));
            let quotient = a / b;
            if GRADIENT {
                let (da, db) = (slope(outline, over), slope(outline, under));
                for axis in 0..2 {
                    gradient[axis] = gradient[axis] * quotient + value * (da[axis] - quotient * db[axis]) / b;
                }
            }
            value *= quotient;
        }
        each(i, value, gradient);
    }
}
