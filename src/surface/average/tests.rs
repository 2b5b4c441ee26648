//! Theory of the inverse problem, asserted on the scalar code. All scenes are random anchors and
//! query points on a wavy surface in R^D of size about 1, multiplied by a scale.

use nalgebra::{DMatrix, DVector};

use super::*;

/// A small deterministic generator (splitmix64); values in -1..1.
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// A point of the wavy surface and the plane of its tangents, tilted a little as Psi is.
pub(super) fn surface<const D: usize>(u: f64, v: f64, scale: f64) -> ([f64; D], [[f64; D]; 2]) {
    let mut y = [0.0; D];
    let mut basis = [[0.0; D]; 2];
    for k in 0..D {
        let (a, b) = (1.0 + 0.7 * k as f64, 2.0 - 0.6 * k as f64);
        let size = if k < 2 { 0.1 } else { 0.3 / (k as f64 + 1.0) };
        y[k] = scale * (size * (a * u + b * v).sin() + [u, v].get(k).copied().unwrap_or(0.0));
        let slope = size * (a * u + b * v).cos();
        basis[0][k] = slope * a + if k == 0 { 1.0 } else { 0.02 };
        basis[1][k] = slope * b + if k == 1 { 1.0 } else { -0.01 };
    }
    (y, basis)
}

pub(super) struct Scene<const D: usize> {
    pub(super) table: AnchorTable<f64, D>,
    pub(super) queries: Vec<([f64; D], [[f64; D]; 2])>,
    pub(super) scale: f64,
}

/// Length of an edge of the meshes these surfaces stand for, at scale 1.
pub(super) const EDGE: f64 = 0.05;

impl<const D: usize> Scene<D> {
    /// `n` anchors and queries at random, rounded to f32 so that both precisions see the same
    /// input.
    pub(super) fn new(n: usize, queries: usize, scale: f64, seed: u64) -> Self {
        let mut random = Random(seed);
        let round = |v: [f64; D]| v.map(|x| f64::from(x as f32));
        let mut own = Vec::new();
        let mut image = Vec::new();
        for _ in 0..n {
            let (u, v) = (random.next(), random.next());
            own.push(round(surface::<D>(u, v, scale).0));
            image.push(round(surface::<D>(0.9 * u + 0.2 * v * v, v - 0.1 * u, 1.0).0));
        }
        let queries = (0..queries)
            .map(|_| {
                let (y, psi) = surface::<D>(0.9 * random.next(), 0.9 * random.next(), scale);
                (round(y), orthonormalise(psi).map(round))
            })
            .collect();
        Self { table: AnchorTable { own, image }, queries, scale }
    }

    /// Queries at `distance` edges from anchor `i mod n`, in the direction of the surface there.
    pub(super) fn near(mut self, distance: f64, seed: u64) -> Self {
        let mut random = Random(seed);
        let n = self.table.len();
        for (i, (y, basis)) in self.queries.iter_mut().enumerate() {
            let angle = 3.2 * random.next();
            let anchor = self.table.own[i % n];
            for k in 0..D {
                let along = angle.cos() * basis[0][k] + angle.sin() * basis[1][k];
                y[k] = f64::from((anchor[k] + self.scale * EDGE * distance * along) as f32);
            }
        }
        self
    }

    pub(super) fn squared_scale(&self) -> f64 {
        16.0 * (EDGE * self.scale).powi(2)
    }
}

pub(super) fn cast<S: Real, const D: usize>(v: &[f64; D]) -> [S; D] {
    v.map(S::of)
}

fn solve<S: Real, const D: usize>(scene: &Scene<D>, query: usize) -> Vec<f64> {
    let (y, basis) = &scene.queries[query];
    let table = scene.table.cast::<S>();
    let mut out = vec![S::ZERO; table.len()];
    weights(&cast(y), &basis.each_ref().map(cast), &table.own, &mut out);
    out.iter().map(|w| w.to_f64()).collect()
}

fn average_of<const D: usize>(w: &[f64], image: &[[f64; D]]) -> [f64; D] {
    let mut mean = [0.0; D];
    for (w, v) in w.iter().zip(image) {
        for k in 0..D {
            mean[k] += w * v[k];
        }
    }
    mean
}

pub(super) fn distance<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// Largest condition of the 2x2 system met in these scenes; errors of the weights are this many
/// times those of its entries.
pub(super) const CONDITION: f64 = 32.0;
/// Relative error of the system's entries in units of epsilon: a dot product of D <= 16 terms on
/// each of three levels, sums over n <= 93.
pub(super) const TERMS: f64 = 16.0 * 3.0 + 93.0;

/// Bound on |basis (y - sum w own)|, given the sum of |w| |own - y|.
fn linear_tolerance<S: Real>(spread: f64) -> f64 {
    CONDITION * TERMS * S::EPSILON.to_f64() * spread
}

fn check_theory<S: Real, const D: usize>(scene: &Scene<D>) {
    for q in 0..scene.queries.len() {
        let (y, basis) = &scene.queries[q];
        let w = solve::<S, D>(scene, q);
        assert!(w.iter().all(|w| w.is_finite()));
        let mass: f64 = w.iter().map(|w| w.abs()).sum();
        let sum: f64 = w.iter().sum();
        assert!((sum - 1.0).abs() <= TERMS * S::EPSILON.to_f64() * mass, "sum of weights {sum}");
        // From offsets: y - sum w own would carry rounding errors of the size of y, not of the
        // offsets.
        let offsets: Vec<[f64; D]> = scene.table.own.iter().map(|own| std::array::from_fn(|k| own[k] - y[k])).collect();
        let rest = average_of(&w, &offsets);
        let spread: f64 = w.iter().zip(&scene.table.own).map(|(w, own)| w.abs() * distance(own, y)).sum();
        let residual = dot(&basis[0], &rest).hypot(dot(&basis[1], &rest));
        assert!(residual <= linear_tolerance::<S>(spread), "residual {residual}, spread {spread}, query {q}");
    }
}

#[test]
fn weights_sum_to_one_and_reproduce_the_point_in_its_plane() {
    for n in [3, 4, 27, 93] {
        check_theory::<f64, 4>(&Scene::new(n, 50, 1.0, 1));
        check_theory::<f64, 8>(&Scene::new(n, 200, 1.0, 2));
        check_theory::<f64, 12>(&Scene::new(n, 50, 1.0, 3));
        check_theory::<f64, 16>(&Scene::new(n, 50, 1.0, 4));
    }
    check_theory::<f32, 8>(&Scene::new(27, 200, 1.0, 5));
    check_theory::<f32, 8>(&Scene::new(93, 200, 1.0, 6));
}

#[test]
fn near_anchors_and_at_any_scale_the_theory_holds() {
    for scale in [1e-3, 1.0, 1e3] {
        for near in [1e-3, 1e-2, 0.1] {
            check_theory::<f64, 8>(&Scene::new(93, 93, scale, 7).near(near, 8));
            check_theory::<f32, 8>(&Scene::new(93, 93, scale, 7).near(near, 8));
        }
    }
}

fn check_anchors<S: Real>() {
    for scale in [1e-3, 1.0, 1e3] {
        let mut scene = Scene::<8>::new(40, 40, scale, 9).near(0.0, 1);
        // Anchors 0 and 39 at one place: the lowest index wins.
        scene.table.own[39] = scene.table.own[0];
        let table = scene.table.cast::<S>();
        for i in 0..39 {
            let basis = scene.queries[i].1.each_ref().map(cast);
            let mut w = vec![S::ZERO; 40];
            weights(&table.own[i], &basis, &table.own, &mut w);
            for (j, &w) in w.iter().enumerate() {
                assert!(w == if i == j { S::ONE } else { S::ZERO }, "anchor {i}, weight {j}: {w}");
            }
            let fused = FusedWeights::solve(&table.own[i], &basis, &table.own, S::of(scene.squared_scale()));
            assert_eq!((fused.average(&table.image), fused.nearest), (table.image[i], i as u32));
        }
    }
}

#[test]
fn an_anchor_is_interpolated_exactly() {
    check_anchors::<f64>();
    check_anchors::<f32>();
}

/// Eq. 13 as printed, solved with the pseudo-inverse: w = D^-1 (C D^-1)^+ c, C = [Psi (y_i - y);
/// 1].
fn textbook(y: &[f64; 8], basis: &[[f64; 8]; 2], own: &[[f64; 8]]) -> DVector<f64> {
    let n = own.len();
    let offset = |j: usize| -> [f64; 8] { std::array::from_fn(|k| own[j][k] - y[k]) };
    let d = DVector::from_fn(n, |j, _| {
        let v = offset(j);
        let within = dot(&basis[0], &v).powi(2) + dot(&basis[1], &v).powi(2);
        within + GAMMA * (dot(&v, &v) - within)
    });
    let c = DMatrix::from_fn(3, n, |i, j| (if i < 2 { dot(&basis[i], &offset(j)) } else { 1.0 }) / d[j]);
    let inverse = c.pseudo_inverse(1e-14).expect("a positive tolerance");
    (inverse * DVector::from_vec(vec![0.0, 0.0, 1.0])).component_div(&d)
}

/// Agreement of the elimination with eq. 13 typed literally: the 3x3 form loses about condition^2
/// epsilon.
const TEXTBOOK_TOLERANCE: f64 = 1e-9;

fn agrees_with_textbook(scene: &Scene<8>, w: &[f64], query: usize) -> bool {
    let (y, basis) = &scene.queries[query];
    let expected = textbook(y, basis, &scene.table.own);
    w.iter().zip(expected.iter()).all(|(a, b)| (a - b).abs() <= TEXTBOOK_TOLERANCE)
}

#[test]
fn elimination_solves_equation_13() {
    for n in [3, 5, 27, 93] {
        let scene = Scene::<8>::new(n, 60, 1.0, 10 + n as u64);
        for q in 0..60 {
            let w = solve::<f64, 8>(&scene, q);
            assert!(agrees_with_textbook(&scene, &w, q), "{n} anchors, query {q}");
            // The comparator must see a change of one millionth, also one that keeps the sum.
            let mut wrong = w.clone();
            wrong[0] += 1e-6;
            wrong[1] -= 1e-6;
            assert!(!agrees_with_textbook(&scene, &wrong, q));
        }
    }
}

#[test]
fn the_basis_of_the_plane_does_not_matter() {
    let scene = Scene::<8>::new(30, 50, 1.0, 21);
    for (q, (y, basis)) in scene.queries.iter().enumerate() {
        let expected = solve::<f64, 8>(&scene, q);
        for (angle, mirror) in [(0.7f64, 1.0), (2.5, -1.0)] {
            let (s, c) = angle.sin_cos();
            let turned = [0, 1].map(|row| -> [f64; 8] {
                let (a, b) = if row == 0 { (c, s) } else { (-s * mirror, c * mirror) };
                std::array::from_fn(|k| a * basis[0][k] + b * basis[1][k])
            });
            let mut w = vec![0.0; 30];
            weights(y, &turned, &scene.table.own, &mut w);
            for (a, b) in w.iter().zip(&expected) {
                // The bases are rounded to f32: orthonormal to 1e-7 only, which turning does not
                // keep.
                assert!((a - b).abs() <= 1e-5, "{a} {b}");
            }
            // A basis that is orthonormal to f64 is turned without loss.
            let clean = orthonormalise(*basis);
            let turned = [0, 1].map(|row| -> [f64; 8] {
                let (a, b) = if row == 0 { (c, s) } else { (-s * mirror, c * mirror) };
                std::array::from_fn(|k| a * clean[0][k] + b * clean[1][k])
            });
            let (mut w0, mut w1) = (vec![0.0; 30], vec![0.0; 30]);
            weights(y, &clean, &scene.table.own, &mut w0);
            weights(y, &turned, &scene.table.own, &mut w1);
            for (a, b) in w0.iter().zip(&w1) {
                assert!((a - b).abs() <= CONDITION * TERMS * f64::EPSILON, "{a} {b}");
            }
        }
    }
}

#[test]
fn fused_weights_are_the_weights() {
    let mut worst = [0.0f64; 2];
    for near in [None, Some(1e-3), Some(1e-2), Some(0.1)] {
        for scale in [1e-3, 1.0, 1e3] {
            let mut scene = Scene::<8>::new(93, 300, scale, 31);
            if let Some(near) = near {
                scene = scene.near(near, 32);
            }
            let single = scene.table.cast::<f32>();
            let c = scene.squared_scale();
            for (q, (y, basis)) in scene.queries.iter().enumerate() {
                let w = solve::<f64, 8>(&scene, q);
                let truth = average_of(&w, &scene.table.image);
                let double = FusedWeights::solve(y, basis, &scene.table.own, c);
                let (y, basis) = (cast(y), basis.each_ref().map(cast));
                let float = FusedWeights::solve(&y, &basis, &single.own, c as f32);
                let mean = float.average(&single.image);
                worst[0] = worst[0].max(distance(&double.average(&scene.table.image), &truth));
                worst[1] = worst[1].max(distance(&mean.map(f64::from), &truth));
                assert!(mean.iter().all(|x| x.is_finite()));
                assert!(double.regular && float.regular);
                for (j, w) in w.iter().enumerate() {
                    assert!((double.of(j) - w).abs() <= FUSED_TOLERANCE * f64::EPSILON, "{} {w}", double.of(j));
                }
            }
        }
    }
    eprintln!("fused against weights in f64: f64 {:.1e}, f32 {:.1e}", worst[0], worst[1]);
    assert!(worst[0] <= FUSED_TOLERANCE * f64::EPSILON, "{worst:?}");
    assert!(worst[1] <= FUSED_TOLERANCE * f64::from(f32::EPSILON), "{worst:?}");
}

/// Error of the fused form in epsilons for images of size 1: the moments' relative error times the
/// system's condition.
const FUSED_TOLERANCE: f64 = CONDITION * TERMS;

#[test]
fn few_or_degenerate_anchors_give_finite_weights_that_sum_to_one() {
    fn check<S: Real>(own: &[[f64; 8]], query: f64, plane_spanned: bool) {
        let (y, psi) = surface::<8>(query, 0.3 * query, 1.0);
        let (y, basis) = (cast::<S, 8>(&y), orthonormalise(psi.each_ref().map(cast::<S, 8>)));
        let table = AnchorTable { own: own.iter().map(cast).collect(), image: own.iter().map(cast).collect() };
        let mut w = vec![S::ZERO; own.len()];
        let regular = weights(&y, &basis, &table.own, &mut w);
        let fused = FusedWeights::solve(&y, &basis, &table.own, S::of(0.04));
        assert_eq!((regular, fused.regular), (plane_spanned, plane_spanned), "{} anchors", own.len());
        let sum: f64 = w.iter().map(|w| w.to_f64()).sum();
        let mass: f64 = w.iter().map(|w| w.to_f64().abs()).sum();
        assert!(mass < 30.0 && (sum - 1.0).abs() <= 30.0 * S::EPSILON.to_f64() * mass, "{w:?}");
        assert!(fused.average(&table.image).iter().all(|x| x.to_f64().abs() < 30.0), "{fused:?}");
    }
    let at = |u: f64, v: f64| surface::<8>(u, v, 1.0).0;
    let line = |s: f64| -> [f64; 8] { std::array::from_fn(|k| 0.3 * s + 0.1 * k as f64) };
    let (a, b, c) = (at(0.5, 0.1), at(-0.3, 0.4), at(0.1, -0.6));
    let all_on_a_line: Vec<_> = (0..93).map(|i| line(f64::from(i) / 50.0 - 1.0)).collect();
    for query in [0.0, 0.2, -0.7, 0.5] {
        for (own, spanned) in [
            (vec![a], false),
            (vec![a, b], false),
            (vec![a, a], false),
            (vec![a, a, a, b], false),
            (vec![a, b, c], true),
            (vec![a, b, c, a, b, c], true),
            (all_on_a_line.clone(), false),
        ] {
            check::<f64>(&own, query, spanned);
            check::<f32>(&own, query, spanned);
        }
    }
    assert!(!weights::<f64, 8>(&a, &orthonormalise([a, b]), &[], &mut []));
}

#[test]
fn two_anchors_reproduce_the_nearest_point_of_their_line() {
    let (a, b) = (surface::<8>(0.5, 0.1, 1.0).0, surface::<8>(-0.3, 0.4, 1.0).0);
    let (y, psi) = surface::<8>(0.1, 0.1, 1.0);
    let basis = orthonormalise(psi);
    let mut w = [0.0; 2];
    weights(&y, &basis, &[a, b], &mut w);
    let project = |v: &[f64; 8]| [dot(&basis[0], v), dot(&basis[1], v)];
    let (a, b, y) = (project(&a), project(&b), project(&y));
    let along = [b[0] - a[0], b[1] - a[1]];
    let s = ((y[0] - a[0]) * along[0] + (y[1] - a[1]) * along[1]) / (along[0].powi(2) + along[1].powi(2));
    assert!((w[1] - s).abs() < TERMS * f64::EPSILON && (w[0] - (1.0 - s)).abs() < TERMS * f64::EPSILON);
}

#[test]
fn orthonormal_whatever_comes() {
    fn check<S: Real, const D: usize>(psi: [[S; D]; 2]) {
        let b = orthonormalise(psi);
        let tolerance = S::of(4.0 * D as f64) * S::EPSILON;
        for (i, j, expected) in [(0, 0, S::ONE), (1, 1, S::ONE), (0, 1, S::ZERO)] {
            assert!((dot(&b[i], &b[j]) - expected).abs() <= tolerance, "{psi:?} -> {b:?}");
        }
    }
    fn all<S: Real, const D: usize>() {
        let e: [S; D] = axis(1);
        let zero = [S::ZERO; D];
        let mut random = Random(5);
        let any: [S; D] = std::array::from_fn(|_| S::of(random.next()));
        let nearly: [S; D] = std::array::from_fn(|k| any[k] + S::of(1e-2 * random.next()));
        for psi in [[e, any], [any, e], [any, nearly], [any, any], [any, zero], [zero, any], [zero, zero], [e, e]] {
            for scale in [1e-20, 1e-3, 1.0, 1e3, 1e20] {
                check(psi.map(|row| row.map(|x| x * S::of(scale))));
            }
        }
    }
    all::<f64, 4>();
    all::<f64, 8>();
    all::<f64, 12>();
    all::<f32, 8>();
    all::<f32, 16>();
}

#[test]
fn tables_refuse_what_cannot_be_averaged() {
    let ok = vec![[0.0f64; 8]; 2];
    assert!(AnchorTable::new(ok.clone(), ok.clone()).is_ok());
    assert!(AnchorTable::<f64, 8>::new(vec![], vec![]).unwrap_err().to_string().contains("no anchors"));
    assert!(
        AnchorTable::new(ok.clone(), vec![[0.0; 8]]).unwrap_err().to_string().contains("2 anchors are paired with 1")
    );
    let mut bad = ok.clone();
    bad[1][3] = f64::NAN;
    assert!(AnchorTable::new(ok, bad).unwrap_err().to_string().contains("anchor 1"));
}
