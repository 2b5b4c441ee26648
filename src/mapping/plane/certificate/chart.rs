//! Two kinds of parameters for the plane: its own coordinates, and coordinates about a vertex.

use super::domain::{Domain, Vector, cross, dot, minus, point};
use super::interval::Interval;
use super::jet::Jet;

/// Parameters of a part of the plane.
#[derive(Clone, Copy, Debug)]
pub(super) enum Chart {
    /// The coordinates (x, y) themselves.
    Plane,
    /// A triangle with its tip at a vertex.
    Fan(Fan),
}

/// Points `v_k + lambda q(mu)` with `q(mu) = first + mu (last - first)`, lambda and mu in [0, 1].
///
/// Polar coordinates without angles: lambda is the radius and mu the direction, but everything
/// stays algebraic, so that no sine has to be bounded. The vertex is the edge lambda = 0 of the
/// parameter square. The Jacobian of the parameters is `lambda (first x last)`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fan {
    pub(super) vertex: usize,
    pub(super) first: [f64; 2],
    pub(super) last: [f64; 2],
}

impl Fan {
    /// `last - first`.
    pub(super) fn sweep(&self) -> Vector {
        minus(point(self.last), point(self.first))
    }

    /// q over `mu`.
    pub(super) fn direction(&self, mu: Interval) -> Vector {
        let sweep = self.sweep();
        [0, 1].map(|i| Interval::point(self.first[i]) + mu * sweep[i])
    }

    /// `first x last`: the constant factor of the parameters' Jacobian.
    pub(super) fn area(&self) -> Interval {
        cross(point(self.first), point(self.last))
    }
}

/// The position p = v - base as a function of the parameters, expanded about parameters `at` (a
/// point or a box).
///
/// `p(at + s) = value + gradient[0] s_0 + gradient[1] s_1 + mixed s_0 s_1`; the base is the origin
/// or the fan's vertex.
#[derive(Clone, Copy, Debug)]
pub(super) struct Position<const N: usize> {
    pub(super) value: Vector,
    pub(super) gradient: [Vector; 2],
    pub(super) mixed: Vector,
    /// |p(at + s) - value|^2.
    square: Jet<N>,
}

impl<const N: usize> Position<N> {
    pub(super) fn new(chart: &Chart, at: [Interval; 2]) -> Self {
        let zero = Interval::ZERO;
        let one = Interval::ONE;
        let (value, gradient, mixed) = match chart {
            Chart::Plane => (at, [[one, zero], [zero, one]], [zero; 2]),
            Chart::Fan(fan) => {
                let (q, sweep) = (fan.direction(at[1]), fan.sweep());
                (q.map(|c| c * at[0]), [q, sweep.map(|c| c * at[0])], sweep)
            }
        };
        let mut square = Jet::ZERO;
        let squared = |v: Vector| v[0].square() + v[1].square();
        square.0[3] = squared(gradient[0]);
        square.0[4] = dot(gradient[0], gradient[1]).scaled(2.0);
        square.0[5] = squared(gradient[1]);
        if N > 8 {
            square.0[7] = dot(gradient[0], mixed).scaled(2.0);
            square.0[8] = dot(gradient[1], mixed).scaled(2.0);
        }
        Self { value, gradient, mixed, square }
    }

    /// `|o - p|^2`.
    pub(super) fn squared_distance(&self, o: Vector) -> Jet<N> {
        let s = minus(o, self.value);
        self.quadratic(s[0].square() + s[1].square(), s.map(|c| c.scaled(2.0)))
    }

    /// `(o - p) . (o + e - p)`, as `|m|^2 - |e|^2 / 4` with m the vector to the middle: every
    /// unknown occurs once.
    pub(super) fn dot_product(&self, o: Vector, e: Vector) -> Jet<N> {
        let m = minus([0, 1].map(|i| o[i] + e[i].scaled(0.5)), self.value);
        let quarter = (e[0].square() + e[1].square()).scaled(0.25);
        self.quadratic(m[0].square() + m[1].square() - quarter, m.map(|c| c.scaled(2.0)))
    }

    /// `value - twice . (p - p(at)) + |p - p(at)|^2`.
    fn quadratic(&self, value: Interval, twice: Vector) -> Jet<N> {
        let mut jet = self.square;
        jet.0[0] = value;
        jet.0[1] = -dot(twice, self.gradient[0]);
        jet.0[2] = -dot(twice, self.gradient[1]);
        jet.0[4] = jet.0[4] - dot(twice, self.mixed);
        jet
    }

    /// `(o - p) x e`.
    pub(super) fn cross_product(&self, o: Vector, e: Vector) -> Jet<N> {
        let mut jet = Jet::constant(cross(minus(o, self.value), e));
        jet.0[1] = -cross(self.gradient[0], e);
        jet.0[2] = -cross(self.gradient[1], e);
        jet.0[4] = -cross(self.mixed, e);
        jet
    }
}

/// What the two edges at the vertex of a fan need: all of it with the factor lambda taken out of
/// `v_k - v = -lambda q`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tip<const N: usize> {
    q: Vector,
    sweep: Vector,
    lambda: Interval,
    /// lambda |q|^2.
    square: Jet<N>,
    /// |q|.
    pub(super) length: Jet<N>,
}

impl<const N: usize> Tip<N> {
    pub(super) fn new(fan: &Fan, at: [Interval; 2]) -> Self {
        let (lambda, q, sweep) = (at[0], fan.direction(at[1]), fan.sweep());
        let mut length = Jet::ZERO;
        length.0[0] = q[0].square() + q[1].square();
        length.0[2] = dot(q, sweep).scaled(2.0);
        length.0[5] = sweep[0].square() + sweep[1].square();
        let mut square = length.scale(lambda);
        square.0[1] = length.0[0];
        square.0[4] = length.0[2];
        if N > 8 {
            square.0[8] = length.0[5];
        }
        Self { q, sweep, lambda, square, length: length.sqrt() }
    }

    /// `-q . (o - lambda q)`: the scalar product of the edge from the vertex to its neighbour at
    /// `o`, over lambda.
    pub(super) fn dot_product(&self, o: Vector) -> Jet<N> {
        let mut jet = self.square;
        jet.0[0] = -dot(self.q, [0, 1].map(|i| o[i] - self.lambda * self.q[i]));
        jet.0[2] = jet.0[2] - dot(self.sweep, o);
        jet
    }

    /// `o x q`: the cross product `s_k x s_(k+1)` of the edge from the vertex to its neighbour at
    /// `o`, over lambda.
    pub(super) fn cross_product(&self, o: Vector) -> Jet<N> {
        let mut jet = Jet::constant(cross(o, self.q));
        jet.0[2] = cross(o, self.sweep);
        jet
    }
}

impl Chart {
    /// The vector from the chart's base to vertex `i`.
    pub(super) fn offset(&self, domain: &Domain, i: usize) -> Vector {
        match self {
            Chart::Plane => point(domain.vertices[i]),
            Chart::Fan(fan) => minus(point(domain.vertices[i]), point(domain.vertices[fan.vertex])),
        }
    }

    /// All points of the box `at` of the parameters.
    pub(super) fn position(&self, domain: &Domain, at: [Interval; 2]) -> Vector {
        match self {
            Chart::Plane => at,
            Chart::Fan(fan) => {
                let (q, v) = (fan.direction(at[1]), point(domain.vertices[fan.vertex]));
                [0, 1].map(|i| v[i] + at[0] * q[i])
            }
        }
    }
}
