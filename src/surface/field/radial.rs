//! Interpolation by radial basis functions with a polynomial part.

use nalgebra::DMatrix;

/// Singular values of the polynomial part below this fraction of the largest count as zero: anchors
/// in a plane do not determine a map of space across it, and the part of least norm is taken. Ten
/// times what is left of flatness 1e7 sizes from the origin.
const RANK: f64 = 1e-7;
/// What is taken off the diagonal of the kernel, in parts of its largest entry, so that coinciding
/// centres do not make it singular.
const RIDGE: f64 = 1e-10;

/// `f(x) = sum c_i phi(x, i) + p(x) . d` with `f(x_i)` given, `sum c_i p(x_i) = 0`, and what each
/// value would be if it were not given.
#[derive(Clone, Debug)]
pub(super) struct Radial {
    /// `c`, one row a centre.
    coefficients: DMatrix<f64>,
    /// `d`, one row a polynomial.
    polynomial: DMatrix<f64>,
    /// Given value minus the one found without it, one row a centre.
    pub(super) left_out: DMatrix<f64>,
}

impl Radial {
    /// Fits `values` (a row per centre); `kernel` holds `phi` between centres, negative
    /// semidefinite on vectors orthogonal to the columns of `polynomials` (a row per centre).
    ///
    /// Leaving out one centre at a time costs nothing: the error is `c_i` over the diagonal entry
    /// of the system's inverse (Rippa, 1999). `None` if the system is singular. O(n^3).
    pub(super) fn fit(kernel: &DMatrix<f64>, polynomials: &DMatrix<f64>, values: &DMatrix<f64>) -> Option<Self> {
        let n = kernel.nrows();
        // The decomposition does not end on what is not finite.
        if !polynomials.iter().chain(kernel.iter()).all(|x| x.is_finite()) {
            return None;
        }
        let svd = polynomials.clone().svd(true, true);
        let (u, vt) = (svd.u?, svd.v_t?);
        let largest = svd.singular_values.max();
        let kept: Vec<usize> =
            (0..svd.singular_values.len()).filter(|&k| svd.singular_values[k] > RANK * largest).collect();
        let r = kept.len();
        let ridge = RIDGE * kernel.amax();
        let system = DMatrix::from_fn(n + r, n + r, |i, j| match (i < n, j < n) {
            (true, true) => kernel[(i, j)] - if i == j { ridge } else { 0.0 },
            (true, false) => u[(i, kept[j - n])],
            (false, true) => u[(j, kept[i - n])],
            (false, false) => 0.0,
        });
        let inverse = system.try_inverse()?;
        let solved = inverse.columns(0, n) * values;
        let coefficients = solved.rows(0, n).into_owned();
        let polynomial = DMatrix::from_fn(polynomials.ncols(), values.ncols(), |q, m| {
            kept.iter().enumerate().map(|(k, &s)| vt[(s, q)] / svd.singular_values[s] * solved[(n + k, m)]).sum()
        });
        // Where the polynomials alone fit every value there is nothing to learn from leaving one
        // out.
        let least = 1e-12 * inverse.view((0, 0), (n, n)).amax();
        let left_out = DMatrix::from_fn(n, values.ncols(), |i, m| {
            let d = inverse[(i, i)];
            if d.abs() > least { coefficients[(i, m)] / d } else { f64::INFINITY }
        });
        coefficients.iter().chain(polynomial.iter()).all(|x| x.is_finite()).then_some(Self {
            coefficients,
            polynomial,
            left_out,
        })
    }

    /// The value where `phi` and `p` are these.
    pub(super) fn at<const M: usize>(&self, phi: &[f64], p: &[f64]) -> [f64; M] {
        std::array::from_fn(|m| {
            let c = self.coefficients.column(m);
            let d = self.polynomial.column(m);
            phi.iter().zip(c.iter()).map(|(a, b)| a * b).sum::<f64>()
                + p.iter().zip(d.iter()).map(|(a, b)| a * b).sum::<f64>()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fitted(points: &[[f64; 2]], f: impl Fn([f64; 2]) -> f64, affine: bool) -> Radial {
        let n = points.len();
        let distance = |i: usize, j: usize| f64::hypot(points[i][0] - points[j][0], points[i][1] - points[j][1]);
        let kernel = DMatrix::from_fn(n, n, distance);
        let row = |i: usize| [1.0, points[i][0], points[i][1]];
        let polynomials = DMatrix::from_fn(n, if affine { 3 } else { 1 }, |i, k| row(i)[k]);
        Radial::fit(&kernel, &polynomials, &DMatrix::from_fn(n, 1, |i, _| f(points[i]))).unwrap()
    }

    fn evaluate(r: &Radial, points: &[[f64; 2]], x: [f64; 2], affine: bool) -> f64 {
        let phi: Vec<f64> = points.iter().map(|p| f64::hypot(p[0] - x[0], p[1] - x[1])).collect();
        let p = [1.0, x[0], x[1]];
        r.at::<1>(&phi, &p[..if affine { 3 } else { 1 }])[0]
    }

    const POINTS: [[f64; 2]; 6] = [[0.0, 0.0], [1.0, 0.1], [0.2, 1.3], [1.1, 1.0], [0.5, 0.4], [2.0, -0.7]];

    #[test]
    fn it_interpolates_and_reproduces_its_polynomials() {
        let wavy = |x: [f64; 2]| (3.0 * x[0]).sin() + x[1] * x[1];
        let r = fitted(&POINTS, wavy, true);
        for p in POINTS {
            assert!((evaluate(&r, &POINTS, p, true) - wavy(p)).abs() < 1e-8);
        }
        let affine = |x: [f64; 2]| 2.0 - x[0] + 0.5 * x[1];
        let r = fitted(&POINTS, affine, true);
        assert!((evaluate(&r, &POINTS, [7.0, -3.0], true) - affine([7.0, -3.0])).abs() < 1e-8);
        assert!(r.left_out.amax() < 1e-8);
        // In a row, the affine part is not determined across it: finite, and right along it.
        let row = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [4.0, 0.0]];
        let r = fitted(&row, affine, true);
        assert!((evaluate(&r, &row, [3.0, 0.0], true) - affine([3.0, 0.0])).abs() < 1e-8);
    }

    #[test]
    fn left_out_is_what_a_fit_without_the_centre_misses_by() {
        let wavy = |x: [f64; 2]| (3.0 * x[0]).sin() + x[1] * x[1];
        for affine in [false, true] {
            let r = fitted(&POINTS, wavy, affine);
            for i in 0..POINTS.len() {
                let others: Vec<[f64; 2]> = (0..POINTS.len()).filter(|&j| j != i).map(|j| POINTS[j]).collect();
                let without = fitted(&others, wavy, affine);
                let missed = wavy(POINTS[i]) - evaluate(&without, &others, POINTS[i], affine);
                assert!((r.left_out[(i, 0)] - missed).abs() < 1e-6 * missed.abs().max(1.0), "{i} {missed}");
            }
        }
    }

    #[test]
    fn coinciding_centres_are_no_obstacle() {
        let points = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]];
        let r = fitted(&points, |x| x[0] * x[1], true);
        assert!((evaluate(&r, &points, [1.0, 1.0], true) - 1.0).abs() < 1e-4);
    }
}
