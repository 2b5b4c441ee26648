//! Enclosures of the Jacobian over a box of parameters.

use super::chart::Chart;
use super::domain::{Domain, Vector, dot};
use super::interval::Interval;
use super::jet::{Jet, index};
use super::weights::Weights;

/// What is known of the Jacobian over a box.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    /// All values over the box lie here.
    pub(super) range: Interval,
    /// The value at the centre lies here.
    pub(super) centre: Interval,
    /// Which of the two parameters is better cut in half.
    pub(super) cut: usize,
}

/// The weights of the latest box, kept to reuse their memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Workspace {
    thin: Weights<6>,
    wide: Weights<10>,
}

/// A component of a derivative of the map over the box, s and t the parameters from the centre:
/// `value + slope . (s, t) + curvature . (s^2, s t, t^2)`, the curvature holding Lagrange's
/// intermediate coefficients.
#[derive(Clone, Copy, Debug)]
struct Expansion {
    value: Interval,
    slope: Vector,
    curvature: [Interval; 3],
}

/// Encloses the Jacobian of the mean value map over the box `at` with centre `centre`.
///
/// **Preconditioning.** Mean value coordinates reproduce affine maps, so `f = L + sum b_i (vhat_i -
/// L(v_i))` for every affine L. L is taken close to f at the centre (any L will do, its rounding is
/// of no consequence), so that the residual map `g = sum b_i u_i`, `u_i = vhat_i - L(v_i)`, and its
/// derivative nearly vanish there, and overestimates are multiplied by what the map has of
/// curvature, not by its displacements.
///
/// **Taylor's theorem.** Numerator and denominator of g are expanded at the centre to degree 2
/// (weights at a point) and over the box to degree 3, the latter sharpened by the former
/// ([`Jet::sharpen`]). Quotients of the two give the coefficients g_ij at the centre and, of degree
/// 3, over the box, and for each component `dg/dx = g_10 + 2 g_20 s + g_11 t + [3 g_30 s^2 + 2 g_21
/// s t + g_12 t^2]`, the bracket with coefficients somewhere in the box (Lagrange's remainder),
/// likewise for y. Derivatives of f are those of g and L together.
///
/// **Determinant.** Two such derivatives are multiplied out: constant and linear terms, the
/// quadratic terms, and the rest. The error of the enclosure is of third order in the size of the
/// box for the rest, while the quadratic terms are bounded one by one.
///
/// **At a vertex** (chart `Fan`) the residual map divided by lambda is smooth: `h = sum over i != k
/// of w_i u_i / (w_k + lambda sum over i != k of w_i)`, `f = L + lambda h` (with `L(v_k) = vhat_k`,
/// so u_k = 0). Then `f_lambda = L' q + (lambda h)_lambda` and `f_mu / lambda = L' (last - first) +
/// h_mu`, and the Jacobian is their cross product over `first x last`: lambda cancels, and lambda =
/// 0 gives the one-sided limits of the Jacobian at the vertex in all directions.
///
/// NaN bounds: nothing is known (the box is too large or the step degenerate).
pub(super) fn enclose(
    domain: &Domain,
    chart: &Chart,
    at: [Interval; 2],
    centre: [f64; 2],
    work: &mut Workspace,
) -> Bounds {
    let edge = nearby_edge(domain, chart, centre);
    let thin_at = centre.map(Interval::point);
    work.thin.fill(domain, chart, thin_at, edge);
    let affine = nearby_affine(domain, chart, centre, &work.thin);
    let residuals = residuals(domain, chart, &affine);
    let step = [0, 1].map(|i| at[i] - thin_at[i]);
    let (thin_sums, lambda) = sums(chart, thin_at[0], &work.thin, &residuals);
    let thin = ratios(&thin_sums, &lambda);
    let wide = if at == thin_at {
        None
    } else {
        work.wide.fill(domain, chart, at, edge);
        let (mut wide_sums, lambda) = sums(chart, at[0], &work.wide, &residuals);
        for (wide, thin) in wide_sums.iter_mut().zip(&thin_sums) {
            wide.sharpen(thin, step);
        }
        Some(ratios(&wide_sums, &lambda))
    };
    let columns = [0, 1].map(|column| {
        [0, 1].map(|row| {
            let curvature = wide.as_ref().map_or([Interval::ZERO; 3], |w| curvature(&w[column][row], column));
            derivative(&thin[column][row], column, curvature)
        })
    });
    let (columns, area) = with_affine(chart, columns, &affine, thin_at);
    let inverse = area.recip();
    let [steep, shallow] = [[0.5, 1.0], [1.0, 0.5]].map(|f| {
        let step = [0, 1].map(|i| Interval::new(step[i].lo * f[i], step[i].hi * f[i]));
        determinant(&columns, step).1.lo
    });
    let (value, range) = determinant(&columns, step);
    Bounds { range: range * inverse, centre: value * inverse, cut: usize::from(steep < shallow) }
}

/// The edge whose pole matters at the centre, if any: the one with an obtuse angle and the largest
/// tangent, if that exceeds 1.
fn nearby_edge(domain: &Domain, chart: &Chart, centre: [f64; 2]) -> Option<usize> {
    let p = chart.position(domain, centre.map(Interval::point)).map(Interval::mid);
    let toward = |i: usize| match chart {
        Chart::Fan(fan) if fan.vertex == i => fan.direction(Interval::point(centre[1])).map(|c| -c.mid()),
        _ => [domain.vertices[i][0] - p[0], domain.vertices[i][1] - p[1]],
    };
    let mut best = (1.0, None);
    for i in 0..domain.len() {
        let (a, b) = (toward(i), toward(domain.after[i]));
        let (cross, dot) = (a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]);
        let ratio = cross.abs() / (a[0].hypot(a[1]) * b[0].hypot(b[1]) - dot);
        if dot < 0.0 && ratio < best.0 {
            best = (ratio, Some(i));
        }
    }
    best.1
}

/// `v -> image + matrix (v - origin)`, in plain doubles: what it is exactly does not matter.
#[derive(Clone, Copy, Debug)]
struct AffineMap {
    origin: [f64; 2],
    image: [f64; 2],
    /// Columns.
    matrix: [[f64; 2]; 2],
}

/// The map's affine part at the centre.
fn nearby_affine(domain: &Domain, chart: &Chart, centre: [f64; 2], weights: &Weights<6>) -> AffineMap {
    let base = match chart {
        Chart::Plane => 0,
        Chart::Fan(fan) => fan.vertex,
    };
    // Value and both derivatives of sum w and of sum w (vhat - vhat_base), and of their ratio.
    let (mut sum, mut moment) = ([0.0; 3], [[0.0; 2]; 3]);
    let lambda = [centre[0], 1.0, 0.0];
    for (i, w) in weights.of.iter().enumerate() {
        let w = [w.0[0].mid(), w.0[1].mid(), w.0[2].mid()];
        let u = [0, 1].map(|d| domain.images[i][d] - domain.images[base][d]);
        let in_fan = matches!(chart, Chart::Fan(_)) && i != base;
        for a in 0..3 {
            sum[a] += match (in_fan, a) {
                (false, _) => w[a],
                (true, 0) => lambda[0] * w[0],
                (true, _) => lambda[a] * w[0] + lambda[0] * w[a],
            };
            for d in 0..2 {
                moment[a][d] += w[a] * u[d];
            }
        }
    }
    let ratio = [0, 1].map(|d| moment[0][d] / sum[0]);
    let slope = [1, 2].map(|a| [0, 1].map(|d| (moment[a][d] - ratio[d] * sum[a]) / sum[0]));
    match chart {
        Chart::Plane => {
            let image = [0, 1].map(|d| domain.images[0][d] + ratio[d]);
            AffineMap { origin: centre, image, matrix: slope }
        }
        Chart::Fan(fan) => {
            // The matrix takes q to (lambda h)_lambda and last - first to h_mu.
            let q = fan.direction(Interval::point(centre[1])).map(Interval::mid);
            let e = fan.sweep().map(Interval::mid);
            let p = [0, 1].map(|d| ratio[d] + centre[0] * slope[0][d]);
            let inverse = 1.0 / (q[0] * e[1] - q[1] * e[0]);
            let matrix = [
                [0, 1].map(|d| (p[d] * e[1] - slope[1][d] * q[1]) * inverse),
                [0, 1].map(|d| (slope[1][d] * q[0] - p[d] * e[0]) * inverse),
            ];
            AffineMap { origin: domain.vertices[base], image: domain.images[base], matrix }
        }
    }
}

impl AffineMap {
    /// The linear part of `v`.
    fn linear(&self, v: Vector) -> Vector {
        [0, 1].map(|d| Interval::point(self.matrix[0][d]) * v[0] + Interval::point(self.matrix[1][d]) * v[1])
    }
}

/// `vhat_i - L(v_i)`; zero at the vertex of a fan, where it is so exactly.
fn residuals(domain: &Domain, chart: &Chart, affine: &AffineMap) -> Vec<Vector> {
    let residual = |i: usize| {
        if matches!(chart, Chart::Fan(fan) if fan.vertex == i) {
            return [Interval::ZERO; 2];
        }
        let v = [0, 1].map(|d| Interval::point(domain.vertices[i][d]) - Interval::point(affine.origin[d]));
        let moved = affine.linear(v);
        [0, 1].map(|d| Interval::point(domain.images[i][d]) - Interval::point(affine.image[d]) - moved[d])
    };
    (0..domain.len()).map(residual).collect()
}

/// `sum w` and the two components of `sum w u`, in the scaling of the chart; and lambda as a jet in
/// a fan.
fn sums<const N: usize>(
    chart: &Chart,
    lambda: Interval,
    weights: &Weights<N>,
    residuals: &[Vector],
) -> ([Jet<N>; 3], Option<Jet<N>>) {
    let [mut sum, mut x, mut y] = [Jet::ZERO; 3];
    let tip = match chart {
        Chart::Plane => None,
        Chart::Fan(fan) => Some(fan.vertex),
    };
    for (i, w) in weights.of.iter().enumerate().filter(|(i, _)| Some(*i) != tip) {
        sum = sum + *w;
        x.accumulate(residuals[i][0], w);
        y.accumulate(residuals[i][1], w);
    }
    let Some(tip) = tip else { return ([sum, x, y], None) };
    let mut radius = Jet::constant(lambda);
    radius.0[1] = Interval::ONE;
    ([weights.of[tip] + sum.times(&radius), x, y], Some(radius))
}

/// The functions whose derivatives are wanted, by parameter and component: g twice, or `lambda h`
/// and `h` in a fan.
fn ratios<const N: usize>([sum, x, y]: &[Jet<N>; 3], lambda: &Option<Jet<N>>) -> [[Jet<N>; 2]; 2] {
    let ratio = [x.over(sum), y.over(sum)];
    match lambda {
        None => [ratio, ratio],
        Some(lambda) => [ratio.map(|r| r.times(lambda)), ratio],
    }
}

/// The derivative by parameter `column` of a function known at the centre.
fn derivative(jet: &Jet<6>, column: usize, curvature: [Interval; 3]) -> Expansion {
    let c = &jet.0;
    let [value, own, mixed] = [c[index(1, column)], c[index(2, 2 * column)].scaled(2.0), c[index(2, 1)]];
    Expansion { value, slope: if column == 0 { [own, mixed] } else { [mixed, own] }, curvature }
}

/// The coefficients of second degree of that derivative, over the box.
fn curvature(jet: &Jet<10>, column: usize) -> [Interval; 3] {
    let c = &jet.0[6..];
    let three = Interval::point(3.0);
    match column {
        0 => [c[0] * three, c[1].scaled(2.0), c[2]],
        _ => [c[1], c[2].scaled(2.0), c[3] * three],
    }
}

/// Adds the affine map's part: columns of derivatives of f, and what their cross product is to be
/// divided by.
fn with_affine(
    chart: &Chart,
    mut columns: [[Expansion; 2]; 2],
    affine: &AffineMap,
    centre: [Interval; 2],
) -> ([[Expansion; 2]; 2], Interval) {
    let (directions, area) = match chart {
        Chart::Plane => ([[Interval::ONE, Interval::ZERO], [Interval::ZERO, Interval::ONE]], Interval::ONE),
        Chart::Fan(fan) => ([fan.direction(centre[1]), fan.sweep()], fan.area()),
    };
    for (column, direction) in columns.iter_mut().zip(directions) {
        let moved = affine.linear(direction);
        for d in 0..2 {
            column[d].value = column[d].value + moved[d];
        }
    }
    if let Chart::Fan(fan) = chart {
        // q turns with mu.
        let moved = affine.linear(fan.sweep());
        for d in 0..2 {
            columns[0][d].slope[1] = columns[0][d].slope[1] + moved[d];
        }
    }
    (columns, area)
}

/// The cross product of the columns: at the centre, and over the box.
fn determinant([p, q]: &[[Expansion; 2]; 2], step: [Interval; 2]) -> (Interval, Interval) {
    let cross = |a: Vector, b: Vector| a[0] * b[1] - a[1] * b[0];
    let part = |column: &[Expansion; 2], f: fn(&Expansion) -> Interval| [f(&column[0]), f(&column[1])];
    let [pv, qv] = [p, q].map(|c| part(c, |a| a.value));
    let [ps, qs] = [p, q].map(|c| part(c, |a| a.slope[0]));
    let [pt, qt] = [p, q].map(|c| part(c, |a| a.slope[1]));
    let [s, t] = step;
    let second = [s.square(), s * t, t.square()];
    let [pr, qr] = [p, q].map(|c| {
        [0, 1].map(|d| {
            let [ss, st, tt] = c[d].curvature;
            ss * second[0] + st * second[1] + tt * second[2]
        })
    });
    let value = cross(pv, qv);
    let linear = [cross(ps, qv) + cross(pv, qs), cross(pt, qv) + cross(pv, qt)];
    let quadratic = [cross(ps, qs), cross(ps, qt) + cross(pt, qs), cross(pt, qt)];
    let affine = |c: &[Expansion; 2]| [0, 1].map(|d| c[d].value + dot(c[d].slope, step));
    let full = affine(q);
    let rest = cross(affine(p), qr) + cross(pr, [0, 1].map(|d| full[d] + qr[d]));
    let range = value
        + linear[0] * s
        + linear[1] * t
        + quadratic[0] * second[0]
        + quadratic[1] * second[1]
        + quadratic[2] * second[2]
        + rest;
    (value, range)
}
