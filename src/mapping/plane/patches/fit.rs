//! The polynomial of a square: fitted to values and derivatives, judged where it was not fitted.

use std::sync::LazyLock;

use glam::{DMat2, DVec2};
use nalgebra::DMatrix;

use super::Patch;
use crate::mapping::plane::composite::Mapped;

/// Terms of degree 2 to 5: those that bend. In the order in which rows of equal power of v are
/// evaluated.
pub(super) const BENDS: usize = 18;
/// All terms: those of degree 0 and 1 come first.
const TERMS: usize = 3 + BENDS;
/// Powers of u and v in each term.
const POWERS: [[i32; 2]; TERMS] = {
    let mut powers = [[0; 2]; TERMS];
    (powers[1], powers[2]) = ([1, 0], [0, 1]);
    let (mut k, mut j) = (3, 0);
    while j <= 5 {
        let mut i = if j < 2 { 2 - j } else { 0 };
        while i + j <= 5 {
            powers[k] = [i, j];
            (k, i) = (k + 1, i + 1);
        }
        j += 1;
    }
    powers
};

/// What a derivative counts beside a value in the fit, the side of the square being 2. With it the
/// error between the nodes is no larger than elsewhere.
const SLOPE: f64 = 0.35;
/// What an error of a derivative counts beside one of a value where the fit is judged: either may
/// vanish by symmetry.
const SEEN_SLOPE: f64 = 0.4;
/// Points of the square are taken to belong to it this far outside, so that none is lost between
/// squares.
pub(super) const MARGIN: f64 = 0.03;
/// The largest error in a square and its margin over the largest one seen, at the nodes and at the
/// points held out. For what the fit leaves of the terms of degree 6, the first it cannot have, the
/// ratio is below this: the test `the_largest_error_is_bounded_by_those_seen` computes it. For maps
/// as they are beside a vertex, half a side outside or farther, terms of all degrees included, it
/// was 1.7 at most.
pub(super) const SAFETY: f64 = 4.2;
/// A rounding of single precision.
const UNIT: f64 = 1.0 / 16_777_216.0;
/// Roundings, in units of half the side, with which a point of a square is found where its image is
/// given: those of the bend, whose terms are below 0.3 in sum, of the residual, of the correction
/// and of the point itself. Fused products have fewer.
const ROUNDING: f64 = 6.0 * UNIT;
/// Roundings of each product in A^-1 q, where q is the image from that of the centre: of both
/// factors, of the product and of the sum.
const GOAL_ROUNDING: f64 = 4.0 * UNIT;
/// The most that the derivative of the bend may be, as the norm of the largest row sum: then the
/// polynomial is one to one in the square, and Newton's method has its root.
const MOST_BEND: f64 = 0.5;

/// Values of the terms at a point of the square, or their derivatives by u or v.
fn terms(p: DVec2, by: Option<usize>) -> [f64; TERMS] {
    POWERS.map(|[i, j]| {
        let power = |x: f64, n: i32| if n <= 0 { 1.0 } else { x.powi(n) };
        match by {
            None => power(p.x, i) * power(p.y, j),
            Some(0) => f64::from(i) * power(p.x, i - 1) * power(p.y, j),
            Some(_) => f64::from(j) * power(p.x, i) * power(p.y, j - 1),
        }
    })
}

/// The nodes of the fit: corners, middles of the sides and centre.
pub(super) fn nodes() -> [DVec2; 9] {
    std::array::from_fn(|k| DVec2::new((k % 3) as f64 - 1.0, (k / 3) as f64 - 1.0))
}

/// The points where it is judged: the centres of the quarters.
pub(super) fn held_out() -> [DVec2; 4] {
    std::array::from_fn(|k| DVec2::new((k % 2) as f64 - 0.5, (k / 2) as f64 - 0.5))
}

/// Data of a fit: value, derivative by u and by v of each node.
const DATA: usize = 27;

/// Takes the data to the terms of least squared errors.
static FIT: LazyLock<Box<[[f64; DATA]; TERMS]>> = LazyLock::new(|| {
    let mut design = DMatrix::<f64>::zeros(DATA, TERMS);
    for (k, p) in nodes().into_iter().enumerate() {
        for (row, by, weight) in [(3 * k, None, 1.0), (3 * k + 1, Some(0), SLOPE), (3 * k + 2, Some(1), SLOPE)] {
            terms(p, by).iter().enumerate().for_each(|(c, t)| design[(row, c)] = weight * t);
        }
    }
    // The columns are independent: 27 numbers tell polynomials of degree 5 apart.
    let inverse = design.pseudo_inverse(1e-12).unwrap_or_else(|_| DMatrix::zeros(TERMS, DATA));
    let mut fit = Box::new([[0.0; DATA]; TERMS]);
    for (r, row) in fit.iter_mut().enumerate() {
        row.iter_mut().enumerate().for_each(|(c, x)| *x = inverse[(r, c)] * if c % 3 == 0 { 1.0 } else { SLOPE });
    }
    fit
});

/// The coefficients for values and derivatives (by u and v) at the nodes.
fn fit(data: &[[DVec2; 3]; 9]) -> [DVec2; TERMS] {
    let fit = &*FIT;
    std::array::from_fn(|t| {
        let row = &fit[t];
        (0..9).fold(DVec2::ZERO, |sum, k| {
            sum + data[k][0] * row[3 * k] + data[k][1] * row[3 * k + 1] + data[k][2] * row[3 * k + 2]
        })
    })
}

/// Value and derivatives at a point of the square, of a map given in units of the source.
fn data(m: &Mapped, half: f64) -> [DVec2; 3] {
    [m.point, m.derivative.x_axis * half, m.derivative.y_axis * half]
}

/// The sum of the terms.
fn sum(coefficients: &[DVec2], terms: &[f64]) -> DVec2 {
    coefficients.iter().zip(terms).fold(DVec2::ZERO, |sum, (c, t)| sum + *c * *t)
}

/// The points of [`nodes`], then those of [`held_out`].
fn seen() -> impl Iterator<Item = DVec2> {
    nodes().into_iter().chain(held_out())
}

/// The largest error of a value, or weighted one of a derivative, at the [`seen`] points; in the
/// units of the image after `unit`.
fn seen_error<'a>(
    coefficients: &[DVec2; TERMS],
    truth: impl Iterator<Item = &'a Mapped>,
    half: f64,
    unit: DMat2,
) -> f64 {
    let mut most = 0.0;
    for (p, truth) in seen().zip(truth) {
        let truth = data(truth, half);
        for (k, (by, weight)) in [(None, 1.0), (Some(0), SEEN_SLOPE), (Some(1), SEEN_SLOPE)].into_iter().enumerate() {
            let off = unit * (sum(coefficients, &terms(p, by)) - truth[k]);
            most = f64::max(most, weight * off.abs().max_element());
        }
    }
    most
}

impl Patch {
    /// The patch of a square, given the map at the nodes and at the points held out, with the bound
    /// of the error of pre-images times the derivative there, or `None` if that is above
    /// `tolerance`.
    ///
    /// Images are c + A (p + g(p)) for p in the square from -1 to 1, where g has the terms of
    /// degree 2 to 5. With |g'| <= θ < 1 a residual r of the map, in units of the square, moves a
    /// pre-image by at most r / (1 - θ), and the derivative is at most (1 + θ) times that of A.
    pub(super) fn new(
        centre: DVec2,
        half: f64,
        nodes: &[Mapped; 9],
        held: &[Mapped; 4],
        tolerance: f64,
    ) -> Option<(Self, f64)> {
        let coefficients = fit(&nodes.each_ref().map(|m| data(m, half)));
        let forward = DMat2::from_cols(coefficients[1], coefficients[2]);
        let inverse = forward.inverse();
        if !(coefficients.iter().all(|c| c.is_finite()) && inverse.is_finite()) {
            return None;
        }
        let bend: [DVec2; BENDS] = std::array::from_fn(|k| inverse * coefficients[3 + k]);
        let corner = DVec2::splat(1.0 + MARGIN);
        let bound = |by: Option<usize>| {
            bend.iter().zip(&terms(corner, by)[3..]).fold(DVec2::ZERO, |sum, (c, t)| sum + c.abs() * *t)
        };
        let theta = (bound(Some(0)) + bound(Some(1))).max_element();
        if !(theta <= MOST_BEND) {
            return None;
        }
        let reach = bound(None);
        let modulus = |m: DMat2| DMat2::from_cols(m.x_axis.abs(), m.y_axis.abs());
        // The sums of the moduli of those products; where A is slanted they cancel.
        let products = (modulus(inverse) * (modulus(forward) * (corner + reach))).max_element();
        let rounding = ROUNDING + GOAL_ROUNDING * products;
        let residual = SAFETY * seen_error(&coefficients, nodes.iter().chain(held), half, inverse) + rounding;
        let off = std::f64::consts::SQRT_2 * residual / (1.0 - theta);
        let steepest = (forward.x_axis.length_squared() + forward.y_axis.length_squared()).sqrt() * (1.0 + theta);
        let error = off * steepest;
        if !(error <= tolerance) {
            return None;
        }
        let patch = Self {
            centre,
            half,
            image: coefficients[0],
            inverse,
            bend: [bend.map(|c| c.x as f32), bend.map(|c| c.y as f32)],
            reach,
        };
        Some((patch, error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mapped(f: &impl Fn(DVec2) -> DVec2, p: DVec2) -> Mapped {
        let e = 1e-4;
        let slope =
            |d: DVec2| (8.0 * (f(p + e * d) - f(p - e * d)) - (f(p + 2.0 * e * d) - f(p - 2.0 * e * d))) / (12.0 * e);
        Mapped { point: f(p), derivative: DMat2::from_cols(slope(DVec2::X), slope(DVec2::Y)) }
    }

    #[test]
    fn polynomials_of_degree_five_are_found() {
        let wanted: [DVec2; TERMS] = std::array::from_fn(|k| DVec2::new(1.0 / (k + 1) as f64, (k as f64).sin()));
        let at = |p: DVec2| [None, Some(0), Some(1)].map(|by| sum(&wanted, &terms(p, by)));
        let found = fit(&nodes().map(at));
        for (a, b) in found.iter().zip(&wanted) {
            assert!((*a - *b).length() < 1e-12, "{a} {b}");
        }
        let exact = |p: DVec2| {
            let [point, u, v] = at(p);
            Mapped { point, derivative: DMat2::from_cols(u, v) }
        };
        let truth: Vec<Mapped> = seen().map(exact).collect();
        assert!(seen_error(&found, truth.iter(), 1.0, DMat2::IDENTITY) < 1e-12);
        let mut other = found;
        other[20] += DVec2::X * 1e-3;
        assert!(seen_error(&other, truth.iter(), 1.0, DMat2::IDENTITY) > 9e-4, "it sees another polynomial");
    }

    #[test]
    fn the_largest_error_is_bounded_by_those_seen() {
        // What the fit leaves of the seven terms of degree 6, at the points seen (value and
        // derivatives, 39 numbers) and anywhere: the second is a linear function of the first, and
        // a sum of moduli bounds the ratio.
        let powers: Vec<[i32; 2]> = (0..7).map(|j| [6 - j, j]).collect();
        let monomial = |[i, j]: [i32; 2], p: DVec2| {
            let (x, y) = (p.x.powi(i - 1), p.y.powi(j - 1));
            let (x, y) = (if i == 0 { 0.0 } else { x }, if j == 0 { 0.0 } else { y });
            [p.x.powi(i) * p.y.powi(j), f64::from(i) * x * p.y.powi(j), f64::from(j) * y * p.x.powi(i)]
                .map(|v| DVec2::new(v, 0.0))
        };
        let fits: Vec<[DVec2; TERMS]> = powers.iter().map(|k| fit(&nodes().map(|p| monomial(*k, p)))).collect();
        let left = |t: usize, p: DVec2, by: Option<usize>| {
            let own = monomial(powers[t], p)[by.map_or(0, |b| b + 1)];
            (own - sum(&fits[t], &terms(p, by))).x
        };
        let points: Vec<DVec2> = seen().collect();
        let seen = DMatrix::from_fn(39, 7, |r, t| match r % 3 {
            0 => left(t, points[r / 3], None),
            k => SEEN_SLOPE * left(t, points[r / 3], Some(k - 1)),
        });
        let inverse = seen.clone().pseudo_inverse(1e-10).unwrap();
        assert!((&inverse * &seen - DMatrix::identity(7, 7)).norm() < 1e-9, "nothing of degree 6 goes unseen");
        let mut most: f64 = 0.0;
        for k in 0..41 * 41 {
            let p = DVec2::new((k % 41) as f64 / 20.0 - 1.0, (k / 41) as f64 / 20.0 - 1.0) * (1.0 + MARGIN);
            let row = DMatrix::from_fn(1, 7, |_, t| left(t, p, None));
            most = most.max((row * &inverse).abs().sum());
        }
        assert!(most < SAFETY && most > 0.5 * SAFETY, "{most}");
    }

    #[test]
    fn maps_beside_a_vertex_stay_within_the_bound() {
        // Vertices half a side outside and farther, at all heights; the map is as beside them.
        for (k, far) in [2.0, 2.5, 3.0, 4.0, 7.0].into_iter().enumerate() {
            for side in 0..9 {
                let vertex = DVec2::new(far, far * (f64::from(side) / 4.0 - 1.0));
                for bend in [DVec2::new(0.3, 0.0), DVec2::new(-0.1, 0.25)] {
                    let map = move |p: DVec2| {
                        let s = p - vertex;
                        s + bend * s.length() + DVec2::new(0.02, 0.05) * s.x * s.y / s.length()
                    };
                    let (nodes, held) = (nodes().map(|p| mapped(&map, p)), held_out().map(|p| mapped(&map, p)));
                    // The smallest tolerance that is kept, by halving.
                    let (mut low, mut high) = (0.0, 1.0);
                    for _ in 0..50 {
                        let middle = 0.5 * (low + high);
                        let kept = Patch::new(DVec2::ZERO, 1.0, &nodes, &held, middle).is_some();
                        (low, high) = if kept { (low, middle) } else { (middle, high) };
                    }
                    let Some((patch, _)) = Patch::new(DVec2::ZERO, 1.0, &nodes, &held, high) else {
                        // Beside a vertex a square may be divided whatever it seems; farther off
                        // not.
                        assert!(k < 2, "{far} {side}");
                        continue;
                    };
                    let mut most: f64 = 0.0;
                    for n in 0..33 * 33 {
                        let p = DVec2::new((n % 33) as f64 / 16.0 - 1.0, (n / 33) as f64 / 16.0 - 1.0) * 1.029;
                        let m = mapped(&map, p);
                        let (x, y) = (m.derivative.x_axis, m.derivative.y_axis);
                        let steep = (x.length_squared() + y.length_squared()).sqrt();
                        let found = patch.solve(m.point).unwrap();
                        most = most.max((found - p).length() * steep);
                    }
                    assert!(most <= high, "{far} {side}: {most} {high}");
                    // The bound is not idle.
                    assert!(most > 0.01 * (high - 8.0 * (ROUNDING + GOAL_ROUNDING)), "{far} {side}: {most} {high}");
                }
            }
        }
    }

    #[test]
    fn what_cannot_be_bounded_is_refused() {
        let patch = |map: &dyn Fn(DVec2) -> DVec2, tolerance: f64| {
            let all = |p: DVec2| mapped(&|p| map(p), p);
            Patch::new(DVec2::ZERO, 1.0, &nodes().map(all), &held_out().map(all), tolerance)
        };
        assert!(patch(&|p| p, 1e-5).is_some());
        assert!(patch(&|p| p, 1e-8).is_none(), "single precision rounds more");
        assert!(patch(&|_| DVec2::NAN, 1.0).is_none() && patch(&|_| DVec2::ONE, 1.0).is_none());
        assert!(patch(&|p| p * p, 10.0).is_none(), "a fold");
        assert!(patch(&|p| p + 0.2 * p.length(), 1e-3).is_none(), "a vertex inside");
    }
}
