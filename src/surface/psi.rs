//! The interpolated tangent plane Psi of a triangle (paper, section 3.2, eq. 10-12) and Newton's
//! method on it.
//!
//! With `A_k` the six bases of eq. 12 and `s = x1 x2 + x2 x3 + x3 x1`, eq. 11 is a convex
//! combination of them:
//!
//! ```text
//! Psi(x) = sum c_k A_k,   c_k = m_k / s,   sum c_k = 1,   h = x1 x2 x3 / 2
//! m = (x1^2 x2 + h, x1 x2^2 + h, x2^2 x3 + h, x2 x3^2 + h, x3^2 x1 + h, x3 x1^2 + h)
//! ```
//!
//! Every `A_k = G_k T_i(k)` is one of the three vertex bases turned or mirrored in its plane by
//! `G_k` in O(2), i = (1, 2, 2, 3, 3, 1). The division by `s` stays inside the iteration: the
//! polynomial `s Psi` vanishes at all three vertices and would have spurious roots there.

use crate::engine::Real;

use super::vector::{Vector, dot, sub};

/// The corner whose tangent basis `A_k` is made of.
pub const CORNER_OF_BASIS: [usize; 6] = [0, 1, 1, 2, 2, 0];

/// An element of O(2): the matrix `[[c, -f s], [s, f c]]`, a rotation for `f = 1`, a reflection for
/// `f = -1`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orthogonal2<S> {
    /// Cosine.
    pub c: S,
    /// Sine.
    pub s: S,
    /// Determinant, 1 or -1.
    pub f: S,
}

/// A 2x2 matrix in row order.
pub type Matrix2<S> = [S; 4];

impl<S: Real> Orthogonal2<S> {
    /// The identity.
    pub const IDENTITY: Self = Self { c: S::ONE, s: S::ZERO, f: S::ONE };

    /// `Ort(A)`, the nearest element of O(2) to `A` in the Frobenius norm (eq. 10), in closed form:
    /// the nearest rotation where `det A >= 0`, else the nearest reflection; the identity for `A =
    /// 0`.
    pub fn nearest(a: Matrix2<S>) -> Self {
        let [a, b, c, d] = a;
        let f = if a * d - b * c >= S::ZERO { S::ONE } else { -S::ONE };
        let (x, y) = (a + f * d, c - f * b);
        let n = (x * x + y * y).sqrt();
        if n > S::ZERO { Self { c: x / n, s: y / n, f } } else { Self::IDENTITY }
    }

    /// The matrix.
    #[inline(always)]
    pub fn matrix(self) -> Matrix2<S> {
        [self.c, -(self.f * self.s), self.s, self.f * self.c]
    }

    /// The transpose, which is the inverse.
    pub fn transpose(self) -> Self {
        if self.f > S::ZERO { Self { s: -self.s, ..self } } else { self }
    }

    /// The product `self * other`.
    pub fn times(self, other: Self) -> Self {
        Self {
            c: self.c * other.c - self.f * self.s * other.s,
            s: self.s * other.c + self.f * self.c * other.s,
            f: self.f * other.f,
        }
    }

    /// The product with a vector.
    #[inline(always)]
    pub fn apply(self, p: [S; 2]) -> [S; 2] {
        let fy = self.f * p[1];
        [self.c * p[0] - self.s * fy, self.s * p[0] + self.c * fy]
    }

    /// Converts the scalars.
    pub fn cast<T: Real>(self) -> Orthogonal2<T> {
        Orthogonal2 { c: T::of(self.c.to_f64()), s: T::of(self.s.to_f64()), f: T::of(self.f.to_f64()) }
    }
}

/// The product of two 2x2 matrices.
pub fn times<S: Real>(a: Matrix2<S>, b: Matrix2<S>) -> Matrix2<S> {
    [a[0] * b[0] + a[1] * b[2], a[0] * b[1] + a[1] * b[3], a[2] * b[0] + a[3] * b[2], a[2] * b[1] + a[3] * b[3]]
}

/// `c_k` at barycentric coordinates `x`. At a vertex, where they depend on the direction of
/// approach but the plane does not, both bases of the vertex get one half.
#[inline(always)]
pub fn coefficients<S: Real>(x: &[S; 3]) -> [S; 6] {
    let s = x[0] * x[1] + x[1] * x[2] + x[2] * x[0];
    if s <= at_vertex::<S>() {
        let half = S::of(0.5);
        return if x[0] >= x[1] && x[0] >= x[2] {
            [half, S::ZERO, S::ZERO, S::ZERO, S::ZERO, half]
        } else if x[1] >= x[2] {
            [S::ZERO, half, half, S::ZERO, S::ZERO, S::ZERO]
        } else {
            [S::ZERO, S::ZERO, S::ZERO, half, half, S::ZERO]
        };
    }
    let r = S::ONE / s;
    weights(x).map(|m| m * r)
}

/// `m_k`.
#[inline(always)]
fn weights<S: Real>(x: &[S; 3]) -> [S; 6] {
    let h = S::of(0.5) * x[0] * x[1] * x[2];
    [
        x[0] * x[0] * x[1] + h,
        x[0] * x[1] * x[1] + h,
        x[1] * x[1] * x[2] + h,
        x[1] * x[2] * x[2] + h,
        x[2] * x[2] * x[0] + h,
        x[2] * x[0] * x[0] + h,
    ]
}

/// `s` below which a point counts as a vertex: `s` is about the distance to the vertex in
/// barycentric units, and the quotients `m_k / s` lose `EPSILON / s` of their value.
#[inline(always)]
pub fn at_vertex<S: Real>() -> S {
    S::of(8.0) * S::EPSILON
}

/// A triangle of a surface in R^D as a projection needs it.
#[derive(Clone, Copy, Debug)]
pub struct TangentTriangle<'a, S, const D: usize> {
    /// Vertices.
    pub v: [&'a Vector<S, D>; 3],
    /// Orthonormal tangent bases at the vertices.
    pub t: [&'a [Vector<S, D>; 2]; 3],
    /// `G_k`.
    pub gauge: &'a [Orthogonal2<S>; 6],
}

/// A triangle and a point as seen in the tangent planes of its three corners.
#[derive(Clone, Copy, Debug)]
struct Tangential<S> {
    /// `edges[l][i] = T_i (v_l - v_3)`.
    edges: [[[S; 2]; 3]; 2],
    /// `T_i (v_3 - ybar)`.
    offset: [[S; 2]; 3],
    /// Length that the rounding of coordinates leaves open.
    rounding: S,
}

/// How Newton's method on a triangle ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Root<S> {
    /// A root within the triangle, up to [`slack`]; clamped and renormalised.
    Inside([S; 3]),
    /// The iteration left the triangle; the coordinates where it was given up.
    Outside([S; 3]),
}

/// How far outside a triangle a root may lie and still count as on its edge: without it, roots on
/// edges fall between two triangles. It bounds the rounding of a root of a well-conditioned
/// triangle and is far below a texel.
#[inline(always)]
pub fn slack<S: Real>() -> S {
    // 1e-4 in single, 1e-9 in double precision (the values of the prototype's study), as one
    // function of the precision.
    if S::EPSILON > S::of(1e-10) { S::of(1e-4) } else { S::of(1e-9) }
}

/// How far a point given to be projected may be off, in units in the last place of its largest
/// coordinate: its coordinates, those of the vertices and their combination are rounded by half a
/// unit each, and the length of a vector of sixteen such errors is four times as large: `3 / 2 *
/// sqrt(16)`.
pub(super) const ROUNDING: f64 = 6.0;

/// Steps after which Newton's method is given up; three or four are usual.
pub const NEWTON_STEPS: usize = 12;

impl<S: Real, const D: usize> TangentTriangle<'_, S, D> {
    /// What the iteration needs of the triangle and the point: both as seen in the three tangent
    /// planes, and where to start.
    #[inline(always)]
    fn tangential(&self, mean: &Vector<S, D>) -> (Tangential<S>, [S; 3]) {
        let e = [sub(self.v[0], self.v[2]), sub(self.v[1], self.v[2])];
        let d = sub(self.v[2], mean);
        let along = |t: &[Vector<S, D>; 2], x: &Vector<S, D>| [dot(&t[0], x), dot(&t[1], x)];
        let all = |x: &Vector<S, D>| [along(self.t[0], x), along(self.t[1], x), along(self.t[2], x)];
        let largest = mean.iter().fold(S::ZERO, |m, y| m.maximum(y.abs()));
        let rounding = S::of(ROUNDING) * S::EPSILON * largest;
        (Tangential { edges: [all(&e[0]), all(&e[1])], offset: all(&d), rounding }, start(&e, &d))
    }

    /// Phong projection of `mean` onto the triangle by Newton's method (eq. 7 and 8), from the
    /// projection onto the flat triangle.
    ///
    /// In two unknowns: `f = Psi (sum x_j v_j - ybar) = sum_k c_k u_k` with `u_k = G_k p_i(k)`,
    /// `p_i = T_i (sum_j x_j v_j - ybar)`, and its analytic Jacobian. `patience` is the barycentric
    /// distance outside the triangle at which the iteration is given up. About 520 flops to set up
    /// and 300 per step.
    ///
    /// Near a vertex `f` is nearly homogeneous in the offset from it, so that a step from afar
    /// lands about the square of its length beside the root, on either side of the vertex. Beyond
    /// the vertex `s` is negative and Psi as smooth as before it: the iteration goes on there and
    /// comes back. Only on the pole itself, `s = 0`, there is no next step.
    pub fn project(&self, mean: &Vector<S, D>, patience: S) -> Root<S> {
        let (p, mut x) = self.tangential(mean);
        let tolerance = S::of(8.0) * S::EPSILON;
        let mut last = S::HUGE;
        for _ in 0..NEWTON_STEPS {
            let Some([dx, dy]) = self.newton_step(&p, &x) else {
                return Root::Outside(x);
            };
            x = [x[0] + dx, x[1] + dy, x[2] - dx - dy];
            let lowest = x[0].minimum(x[1]).minimum(x[2]);
            if !(lowest >= -patience) {
                return Root::Outside(x);
            }
            let s = x[0] * x[1] + x[1] * x[2] + x[2] * x[0];
            if s.abs() <= at_vertex::<S>() {
                return self.vertex_root(&p, &x).map_or(Root::Outside(x), Root::Inside);
            }
            let step = dx.abs().maximum(dy.abs());
            // Quadratic convergence, at the scale of the distance to the vertex: after a step h the
            // next one is about h^2 / s.
            if step <= tolerance || (step <= S::of(1e-4) && step * step <= S::EPSILON * s.abs() && last < S::HUGE) {
                return inside_or_not(x, &p);
            }
            last = step;
        }
        if last <= S::of(1e-3) { inside_or_not(x, &p) } else { Root::Outside(x) }
    }

    /// The vertex nearest to `x`, if it is a root.
    ///
    /// At a vertex Psi spans the vertex's own tangent plane whatever the direction, so the vertex
    /// is a root where `T_i (v_i - ybar)` vanishes.
    fn vertex_root(&self, p: &Tangential<S>, x: &[S; 3]) -> Option<[S; 3]> {
        let i = usize::from(x[1] > x[0]);
        let i = if x[2] > x[i] { 2 } else { i };
        let size = |q: [S; 2]| q[0].abs().maximum(q[1].abs());
        let [e0, e1] = [p.edges[0][i], p.edges[1][i]];
        let offset = match i {
            0 => [p.offset[0][0] + e0[0], p.offset[0][1] + e0[1]],
            1 => [p.offset[1][0] + e1[0], p.offset[1][1] + e1[1]],
            _ => p.offset[2],
        };
        // Edges as seen in the vertex's tangent plane give the scale; the slack is the one of
        // edges.
        let most = (slack::<S>() * size(e0).maximum(size(e1))).maximum(p.rounding);
        let mut e = [S::ZERO; 3];
        e[i] = S::ONE;
        (size(offset) <= most).then_some(e)
    }

    /// One Newton step `(dx1, dx2)`; `None` where the Jacobian is singular.
    ///
    /// With `m_k` the numerators of `c_k` and `H_i` the sum of `c_k G_k` over the two bases of
    /// corner `i`, the derivative by `x_l` (the coordinates taken as independent) is `(sum_k dm_kl
    /// u_k - f ds_l) / s + sum_i H_i T_i v_l`. Each `dm_kl` is one of three common terms (the
    /// derivatives of `h`) plus, for four of the six bases, a square or twice a product.
    #[inline(always)]
    fn newton_step(&self, p: &Tangential<S>, x: &[S; 3]) -> Option<[S; 2]> {
        let [x1, x2, x3] = *x;
        let half = S::of(0.5);
        let two = S::of(2.0);
        let (x12, x23, x31) = (x1 * x2, x2 * x3, x3 * x1);
        let s = x12 + x23 + x31;
        let r = S::ONE / s;
        let c = weights(x).map(|m| m * r);
        let mut u = [[S::ZERO; 2]; 6];
        let mut f = [S::ZERO; 2];
        let mut sum = [S::ZERO; 2];
        let mut h = [[S::ZERO; 4]; 3];
        for k in 0..6 {
            let i = CORNER_OF_BASIS[k];
            let pi = [
                p.offset[i][0] + x1 * p.edges[0][i][0] + x2 * p.edges[1][i][0],
                p.offset[i][1] + x1 * p.edges[0][i][1] + x2 * p.edges[1][i][1],
            ];
            let g = self.gauge[k].matrix();
            u[k] = [g[0] * pi[0] + g[1] * pi[1], g[2] * pi[0] + g[3] * pi[1]];
            for e in 0..4 {
                h[i][e] += c[k] * g[e];
            }
            for e in 0..2 {
                f[e] += c[k] * u[k][e];
                sum[e] += u[k][e];
            }
        }
        let mut d = [[S::ZERO; 2]; 3];
        for e in 0..2 {
            let common = half * sum[e];
            d[0][e] = x23 * common + two * x12 * u[0][e] + x2 * x2 * u[1][e] + x3 * x3 * u[4][e] + two * x31 * u[5][e]
                - f[e] * (x2 + x3);
            d[1][e] = x31 * common + x1 * x1 * u[0][e] + two * x12 * u[1][e] + two * x23 * u[2][e] + x3 * x3 * u[3][e]
                - f[e] * (x3 + x1);
            d[2][e] = x12 * common + x2 * x2 * u[2][e] + two * x23 * u[3][e] + two * x31 * u[4][e] + x1 * x1 * u[5][e]
                - f[e] * (x1 + x2);
        }
        let mut j = [[S::ZERO; 2]; 2];
        for l in 0..2 {
            for e in 0..2 {
                j[l][e] = (d[l][e] - d[2][e]) * r;
                for i in 0..3 {
                    j[l][e] += h[i][2 * e] * p.edges[l][i][0] + h[i][2 * e + 1] * p.edges[l][i][1];
                }
            }
        }
        let [[a, c], [b, d]] = j;
        let det = a * d - b * c;
        let (diagonal, across) = (a.abs().maximum(d.abs()), b.abs().maximum(c.abs()));
        if !(det.abs() > S::EPSILON * (diagonal * diagonal + across * across)) {
            return None;
        }
        let q = S::ONE / det;
        Some([(b * f[1] - d * f[0]) * q, (c * f[0] - a * f[1]) * q])
    }

    /// `Psi(x)`: two rows of R^D spanning the interpolated tangent plane, not orthonormal.
    #[inline(always)]
    pub fn psi(&self, x: &[S; 3]) -> [Vector<S, D>; 2] {
        let c = coefficients(x);
        // The two bases of a corner share its tangents, so their matrices add up first.
        let mut h = [[S::ZERO; 4]; 3];
        for k in 0..6 {
            let m = self.gauge[k].matrix();
            for e in 0..4 {
                h[CORNER_OF_BASIS[k]][e] += c[k] * m[e];
            }
        }
        let mut rows = [[S::ZERO; D]; 2];
        for i in 0..3 {
            for e in 0..D {
                rows[0][e] += h[i][0] * self.t[i][0][e] + h[i][1] * self.t[i][1][e];
                rows[1][e] += h[i][2] * self.t[i][0][e] + h[i][3] * self.t[i][1][e];
            }
        }
        rows
    }

    /// The point with barycentric coordinates `x`.
    #[inline(always)]
    pub fn point(&self, x: &[S; 3]) -> Vector<S, D> {
        super::vector::combine(x, self.v)
    }

    /// `Psi(x) (sum x_j v_j - ybar)`: zero at a Phong projection (eq. 7). In units of the surface.
    pub fn residual(&self, mean: &Vector<S, D>, x: &[S; 3]) -> [S; 2] {
        let psi = self.psi(x);
        let d = sub(&self.point(x), mean);
        [dot(&psi[0], &d), dot(&psi[1], &d)]
    }
}

/// Where Newton's method starts, from the two edges `v_l - v_3` and `v_3 - ybar`: the orthogonal
/// projection of `ybar` onto the flat triangle. A point of the surface is that already, and near a
/// vertex it is as far from it as the root is, up to a constant. Outside coordinates are reflected
/// into the triangle, which keeps that distance; where the flat triangle has no area, its centre.
#[inline(always)]
fn start<S: Real, const D: usize>([e, f]: &[Vector<S, D>; 2], d: &Vector<S, D>) -> [S; 3] {
    let (ee, ef, ff) = (dot(e, e), dot(e, f), dot(f, f));
    let (de, df) = (dot(e, d), dot(f, d));
    let determinant = ee * ff - ef * ef;
    if !(determinant > S::EPSILON * ee * ff) {
        return [S::of(1.0 / 3.0); 3];
    }
    let (x, y) = ((ef * df - ff * de) / determinant, (ef * de - ee * df) / determinant);
    // Not on the vertex itself, where Psi has no direction.
    let inside = [x, y, S::ONE - x - y].map(|v| v.abs().maximum(S::EPSILON));
    let r = S::ONE / (inside[0] + inside[1] + inside[2]);
    inside.map(|v| v * r)
}

/// Accepts coordinates that lie outside by no more than the slack, or than a length that rounding
/// leaves open: on a triangle of a hundredth of an edge the slack is less than that, and where
/// triangles fold over one another at a vertex, a rounded point beside them would belong to none.
/// They are clamped to the triangle.
#[inline(always)]
fn inside_or_not<S: Real>(x: [S; 3], p: &Tangential<S>) -> Root<S> {
    let inside = x.map(|v| v.maximum(S::ZERO));
    let r = S::ONE / (inside[0] + inside[1] + inside[2]);
    let inside = inside.map(|v| v * r);
    if x[0] >= -slack::<S>() && x[1] >= -slack::<S>() && x[2] >= -slack::<S>() {
        return Root::Inside(inside);
    }
    // How far that moves the point, as seen in the planes of the three corners.
    let (a, b) = (inside[0] - x[0], inside[1] - x[1]);
    let moved = |i: usize| {
        let d = [0, 1].map(|k| (a * p.edges[0][i][k] + b * p.edges[1][i][k]).abs());
        d[0].maximum(d[1])
    };
    let moved = moved(0).maximum(moved(1)).maximum(moved(2));
    if moved <= p.rounding { Root::Inside(inside) } else { Root::Outside(x) }
}
