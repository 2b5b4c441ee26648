//! Properties of the certificate as a whole.

use std::f64::consts::TAU;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::DVec2;
use proptest::prelude::*;

use super::bounds::{Bounds, Workspace, enclose};
use super::boxes::{Cell, Corner, Fate};
use super::chart::Chart;
use super::domain::Domain;
use super::interval::Interval;
use super::reference::{jacobian, limit, place, sampled_minimum};
use super::{CertifyOptions, Verdict, certificate, certify};
use crate::geometry::Polygon;
use crate::models::polygons::{
    PolygonPair, convex_witness, inverted_star, nested_squares, square_corner, twisted_star,
};
use crate::progress::{Progress, Quiet};

/// A pair's polygons at two times of the linear path.
fn step(pair: &PolygonPair, from: f64, to: f64) -> (Polygon, Polygon) {
    let at = |t: f64| {
        let mut targets = pair.target.vertices();
        let mut moved = |v: &DVec2| targets.next().map_or(*v, |w| *v + (w - *v) * t);
        Polygon::from_loops(pair.source.loops().iter().map(|l| l.iter().map(&mut moved).collect()).collect())
    };
    (at(from), at(to))
}

fn verdict(from: &Polygon, to: &Polygon) -> Verdict {
    certify(from, to, &CertifyOptions { boxes: 15_000, ..CertifyOptions::default() }, &Quiet).expect("valid polygons")
}

/// Steps that are known to have a positive Jacobian, with the value sampled on 768 x 768 pixels
/// where it was measured.
fn good_steps() -> Vec<(Polygon, Polygon)> {
    let knots: [(PolygonPair, &[f64]); 5] = [
        (nested_squares(), &[0.0, 0.25, 0.5, 0.75, 0.875, 1.0]),
        (square_corner(0.8), &[0.0, 0.5, 0.75, 0.875, 0.9375, 1.0]),
        (inverted_star(), &[0.0, 0.5, 0.75, 0.875, 1.0]),
        (twisted_star(), &[0.0, 0.5, 0.75, 0.875, 1.0]),
        (convex_witness(), &[0.0, 0.5, 1.0]),
    ];
    knots.iter().flat_map(|(pair, t)| t.windows(2).map(|w| step(pair, w[0], w[1])).collect::<Vec<_>>()).collect()
}

/// A star-shaped loop with these radii at evenly spaced angles.
fn star_shaped(radii: &[f64]) -> Vec<DVec2> {
    let turn = TAU / radii.len() as f64;
    radii.iter().enumerate().map(|(i, r)| DVec2::from_angle(i as f64 * turn + 0.1) * *r).collect()
}

/// Two star-shaped polygons, sometimes with a hole that turns; many fold.
fn warps() -> impl Strategy<Value = (Polygon, Polygon)> {
    let radii = |n: usize| prop::collection::vec(0.35..1.0f64, n);
    (3..9usize, any::<bool>(), -0.6..0.6f64, 0.0..1.0f64)
        .prop_flat_map(move |(n, hole, turn, share)| (radii(n), radii(n), Just((hole, turn, share))))
        .prop_map(|(a, b, (hole, turn, share))| {
            let b: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a + (b - a) * share).collect();
            let square = |turn: f64| {
                (0..4).rev().map(|i| DVec2::from_angle(TAU * i as f64 / 4.0 + turn) * 0.08).collect::<Vec<_>>()
            };
            let with = |outer: Vec<DVec2>, turn: f64| {
                Polygon::from_loops(if hole { vec![outer, square(turn)] } else { vec![outer] })
            };
            (with(star_shaped(&a), 0.0), with(star_shaped(&b), turn))
        })
}

/// The sampled values of J over a box that are farther than rounding from the bounds' range.
fn outside(range: Interval, samples: &[f64]) -> usize {
    let slack = |v: f64| 1e-8 * (1.0 + v.abs());
    samples.iter().filter(|&&v| !(v >= range.lo - slack(v) && v <= range.hi + slack(v))).count()
}

/// J at points spread over a box, by the printed formulas.
fn samples(from: &Polygon, to: &Polygon, domain: &Domain, cell: &Cell) -> Vec<f64> {
    let mut values = Vec::new();
    for i in 0..=6 {
        for j in 0..=6 {
            let at = [(0, i), (1, j)].map(|(d, i)| {
                let Interval { lo, hi } = cell.at[d];
                (lo + (hi - lo) * f64::from(i) / 6.0).clamp(lo, hi)
            });
            if let (Chart::Fan(fan), true) = (&cell.chart, at[0] == 0.0) {
                let (value, _) = limit(from, to, fan.vertex);
                let q = DVec2::from(fan.direction(Interval::point(at[1])).map(Interval::mid));
                let v: Vec<DVec2> = from.vertices().collect();
                let out = v[domain.after[fan.vertex]] - v[fan.vertex];
                values.push(value(out.perp_dot(q).atan2(out.dot(q)).rem_euclid(TAU)));
                continue;
            }
            let p = cell.chart.position(domain, at.map(Interval::point)).map(Interval::mid);
            let p = domain.world(p);
            if place(from, p).0 > 1e-4 {
                values.push(jacobian(from, to, p));
            }
        }
    }
    values
}

/// Boxes of many sizes and places in both charts, those on the boundary among them.
fn many_cells(domain: &Domain, seed: u64) -> Vec<Cell> {
    let mut state = seed | 1;
    let mut unit = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut cells = Vec::new();
    for k in 0..domain.len() {
        let size = 0.1 * 0.5f64.powf(8.0 * unit());
        // About a point of the edge, and about one between the vertex and the origin.
        for (a, b) in [(domain.vertices[domain.after[k]], unit()), ([0.0; 2], unit())] {
            let centre = [0, 1].map(|d| domain.vertices[k][d] + (a[d] - domain.vertices[k][d]) * b);
            let at = [0, 1].map(|d| Interval::new(centre[d] - size * unit(), centre[d] + size * unit()));
            cells.push(Cell::new(Chart::Plane, at, 0.0));
        }
        for fan in Corner::new(domain, k).expect("a plain corner").fans {
            for start in [0.0, unit()] {
                let (a, b, w) = (start, unit(), 0.5f64.powf(1.0 + 5.0 * unit()));
                let at = [Interval::new(a, (a + w).min(1.0)), Interval::new(b, (b + w).min(1.0))];
                cells.push(Cell::new(Chart::Fan(fan), at, 0.0));
            }
        }
    }
    cells
}

fn bounds(domain: &Domain, cell: &Cell) -> Bounds {
    enclose(domain, &cell.chart, cell.at, cell.centre(), &mut Workspace::default())
}

#[test]
fn enclosures_hold_the_samples_and_little_more() {
    let (mut known, mut refuted, mut count) = (0, 0, 0);
    for (seed, (from, to)) in good_steps().iter().enumerate() {
        let domain = Domain::new(from, to).expect("valid polygons");
        for cell in many_cells(&domain, seed as u64) {
            count += 1;
            let b = bounds(&domain, &cell);
            if !b.range.is_known() {
                continue;
            }
            known += 1;
            let range = Interval::new(b.range.lo * domain.jacobian_unit, b.range.hi * domain.jacobian_unit);
            let values = samples(from, to, &domain, &cell);
            assert_eq!(outside(range, &values), 0, "step {seed}, {cell:?}: {range:?} {values:?}");
            assert!(b.centre.lo >= b.range.lo && b.centre.hi <= b.range.hi);
            // Bounds of half the width must be caught.
            let (m, r) = (range.mid(), 0.25 * (range.hi - range.lo));
            refuted += usize::from(outside(Interval::new(m - r, m + r), &values) > 0);
        }
    }
    assert!(known > count / 2, "{known} of {count}");
    assert!(refuted > known / 3, "{refuted} of {known}");
}

#[test]
fn the_excess_is_of_higher_order() {
    let (from, to) = step(&inverted_star(), 0.0, 0.5);
    let domain = Domain::new(&from, &to).expect("valid polygons");
    let fan = Corner::new(&domain, 3).expect("a plain corner").fans[1];
    for (chart, centre, r) in
        [(Chart::Plane, [0.02, -0.01], 0.01), (Chart::Plane, [0.1, 0.0], 0.01), (Chart::Fan(fan), [0.3, 0.4], 0.1)]
    {
        let excess = |r: f64| {
            let cell = Cell::new(chart, centre.map(|c| Interval::new(c - r, c + r)), 0.0);
            let range = bounds(&domain, &cell).range.lo * domain.jacobian_unit;
            samples(&from, &to, &domain, &cell).into_iter().fold(f64::INFINITY, f64::min) - range
        };
        let (coarse, fine) = (excess(r), excess(0.5 * r));
        assert!(fine > -1e-9 && fine < coarse / 3.5, "{chart:?}: {coarse} {fine}");
    }
}

#[test]
fn limits_at_vertices_are_the_closed_form() {
    for s in [0.1, 0.5, 0.54, 0.55, 0.8] {
        let PolygonPair { source, target } = square_corner(s);
        let domain = Domain::new(&source, &target).expect("valid polygons");
        let fans = Corner::new(&domain, 2).expect("a plain corner").fans;
        let least = fans
            .iter()
            .flat_map(|fan| {
                let domain = &domain;
                (0..=512).map(move |i| {
                    let at = [Interval::ZERO, Interval::point(f64::from(i) / 512.0)];
                    bounds(domain, &Cell::new(Chart::Fan(*fan), at, 0.0)).centre
                })
            })
            .map(|v| {
                assert!(v.hi - v.lo < 1e-12);
                v.lo * domain.jacobian_unit
            })
            .fold(f64::INFINITY, f64::min);
        let expected = 1.0 - (2.0 * 2.0f64.sqrt() - 1.0) * s;
        assert!((least - expected).abs() < 1e-9, "{s}: {least} {expected}");
    }
}

#[test]
fn known_steps_are_certified_close_to_their_minimum() {
    for (i, (from, to)) in good_steps().iter().enumerate() {
        let sampled = sampled_minimum(from, to, 96);
        match verdict(from, to) {
            Verdict::Certified { lower_bound } => {
                assert!(
                    lower_bound > 0.85 * sampled && lower_bound <= sampled + 1e-9,
                    "step {i}: {lower_bound} {sampled}"
                );
            }
            other => panic!("step {i}: {other:?}, sampled {sampled}"),
        }
    }
}

#[test]
fn folds_are_found_wherever_they_lie() {
    // In the limit at a vertex only: no raster sees s = 0.5475.
    let PolygonPair { source, target } = square_corner(0.5475);
    assert!(matches!(verdict(&source, &target), Verdict::Folds { at, value } if at == DVec2::ONE && value < 0.0));
    // Inside, near the boundary of the hexagon, by a hundredth.
    let PolygonPair { source, target } = convex_witness();
    match verdict(&source, &target) {
        Verdict::Folds { at, value } => {
            assert!(place(&source, at).1 && jacobian(&source, &target, at) <= value + 1e-9);
        }
        other => panic!("{other:?}"),
    }
    for pair in [nested_squares(), inverted_star(), twisted_star(), square_corner(0.8)] {
        assert!(matches!(verdict(&pair.source, &pair.target), Verdict::Folds { value, .. } if value < 0.0));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn a_fold_is_never_certified((from, to) in warps()) {
        let sampled = sampled_minimum(&from, &to, 40);
        match verdict(&from, &to) {
            Verdict::Certified { lower_bound } => prop_assert!(lower_bound > 0.0 && lower_bound <= sampled + 1e-7, "{lower_bound} {sampled}"),
            Verdict::Undecided { .. } => prop_assert!(sampled < 0.05, "{sampled}"),
            Verdict::Folds { at, value } => {
                prop_assert!(value < 0.0);
                let vertex = from.vertices().position(|v| v == at);
                let there = match vertex {
                    Some(k) => {
                        let (value, beta) = limit(&from, &to, k);
                        (0..=256).map(|i| value(beta * f64::from(i) / 256.0)).fold(f64::INFINITY, f64::min)
                    }
                    None => jacobian(&from, &to, at),
                };
                prop_assert!(there < 1e-3 * value.abs(), "{there} {value}");
            }
        }
    }

    #[test]
    fn every_point_is_covered((from, to) in warps(), points in prop::collection::vec((0.0..1.0f64, 0.0..1.0f64, any::<bool>()), 64)) {
        let domain = Domain::new(&from, &to).expect("valid polygons");
        let corners: Vec<Corner> = (0..domain.len()).map(|k| Corner::new(&domain, k).expect("a plain corner")).collect();
        for (n, (a, b, on_edge)) in points.into_iter().enumerate() {
            let k = n % domain.len();
            let [v, next] = [k, domain.after[k]].map(|i| DVec2::from(domain.vertices[i]));
            let p = if on_edge { v + (next - v) * a * a } else { v * b + (next - v) * a * b };
            if !on_edge && domain.winding(p.to_array()) != Some(1) {
                continue;
            }
            let near = (0..domain.len()).find(|&k| DVec2::from(domain.vertices[k]).distance(p) <= corners[k].radius);
            if let Some(k) = near {
                let s = p - DVec2::from(domain.vertices[k]);
                let holds = corners[k].fans.iter().any(|f| {
                    // s = x first + y last with lambda = x + y, mu = y / lambda.
                    let [a, b] = [f.first, f.last].map(DVec2::from);
                    let [x, y] = [s.perp_dot(b) / a.perp_dot(b), a.perp_dot(s) / a.perp_dot(b)];
                    x >= -1e-13 && y >= -1e-13 && x + y <= 1.0 + 1e-13
                });
                prop_assert!(holds, "{p} at vertex {k}");
                continue;
            }
            let bounds = [0, 1].map(|d| {
                let along = || domain.vertices.iter().map(move |v| v[d]);
                Interval::new(along().fold(f64::INFINITY, f64::min), along().fold(f64::NEG_INFINITY, f64::max))
            });
            let mut cell = Cell::new(Chart::Plane, bounds, 0.0);
            for depth in 0..30 {
                prop_assert!(cell.fate(&domain, &corners) != Fate::Drop, "{p} dropped with {cell:?}");
                cell.cut = depth % 2;
                let halves = cell.halves().expect("room");
                cell = if p[cell.cut] <= halves[0].at[cell.cut].hi { halves[0] } else { halves[1] };
            }
        }
    }
}

#[test]
fn units_and_places_do_not_matter() {
    let (from, to) = step(&square_corner(0.8), 0.0, 0.5);
    let moved = |p: &Polygon, factor: f64, by: DVec2| {
        Polygon::from_loops(p.loops().iter().map(|l| l.iter().map(|v| *v * factor + by).collect()).collect())
    };
    let Verdict::Certified { lower_bound } = verdict(&from, &to) else { panic!("not certified") };
    for (a, b) in [(1e-3, 1e-3), (1e6, 1e6), (2.0, 3.0), (1e60, 1e-60)] {
        let found = verdict(&moved(&from, a, DVec2::ZERO), &moved(&to, b, DVec2::new(3.0, -2.0) * b));
        let Verdict::Certified { lower_bound: found } = found else { panic!("{a} {b}: {found:?}") };
        let expected = lower_bound * (b / a).powi(2);
        assert!((found / expected - 1.0).abs() < 0.1, "{a} {b}: {found} {expected}");
    }
    let far = DVec2::new(1e6, -3e5);
    assert!(
        matches!(verdict(&moved(&from, 1.0, far), &moved(&to, 1.0, far)), Verdict::Certified { lower_bound } if lower_bound > 0.2)
    );
}

#[test]
fn affine_maps_have_their_determinant_everywhere() {
    // Mean value coordinates reproduce them.
    let source = nested_squares().source;
    for (x, y) in [(DVec2::X, DVec2::Y), (DVec2::new(0.3, 2.0), DVec2::new(-1.5, 0.2))] {
        let moved = |v: &DVec2| x * v.x + y * v.y + DVec2::new(5.0, 7.0);
        let target = Polygon::from_loops(source.loops().iter().map(|l| l.iter().map(moved).collect()).collect());
        let Verdict::Certified { lower_bound } = verdict(&source, &target) else { panic!("not certified") };
        let determinant = x.perp_dot(y);
        assert!(lower_bound > 0.9 * determinant && lower_bound < determinant + 1e-9, "{lower_bound} {determinant}");
    }
    // A reflection folds everywhere.
    let target =
        Polygon::from_loops(source.loops().iter().map(|l| l.iter().map(|v| DVec2::new(-v.x, v.y)).collect()).collect());
    assert!(matches!(verdict(&source, &target), Verdict::Folds { value, .. } if (value + 1.0).abs() < 1e-9));
}

#[test]
fn needles_and_slits_are_certified() {
    // A tip and, in a square, a slit of this width.
    for width in [0.1, 1e-2, 1e-3] {
        let needle = |w: f64| vec![[0.0, 0.0], [1.0, -w], [3.0, 0.0], [1.0, w]];
        let slit =
            |w: f64| vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.5 + w, 1.0], [0.5, 0.4], [0.5 - w, 1.0], [0.0, 1.0]];
        for shape in [needle, slit] as [fn(f64) -> Vec<[f64; 2]>; 2] {
            let polygon = |w: f64| Polygon::from_loops(vec![shape(w).into_iter().map(DVec2::from).collect()]);
            let (from, to) = (polygon(width), polygon(1.1 * width));
            let found = certificate(&from, &to, &CertifyOptions::default(), &Quiet).expect("valid polygons");
            let least = sampled_minimum(&from, &to, 64);
            let Verdict::Certified { lower_bound } = found.verdict else { panic!("{width}: {found:?}") };
            assert!(lower_bound > 0.85 * least && lower_bound <= least + 1e-9, "{width}: {found:?} {least}");
            assert!((found.sampled - least).abs() < 1e-3 * least, "{width}: {found:?} {least}");
        }
    }
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let mut cases = good_steps();
    cases.truncate(7);
    cases.push((convex_witness().source, convex_witness().target));
    for (from, to) in cases {
        for boxes in [100, 1000, 40_000] {
            let options = CertifyOptions { boxes, ..CertifyOptions::default() };
            let [one, four] = [1, 4].map(|threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                pool.install(|| certify(&from, &to, &options, &Quiet)).expect("valid polygons")
            });
            assert_eq!(format!("{one:?}"), format!("{four:?}"));
        }
    }
}

#[test]
fn an_exhausted_budget_is_said() {
    let (from, to) = step(&inverted_star(), 0.0, 0.5);
    for boxes in [0, 1, 300] {
        let options = CertifyOptions { boxes, ..CertifyOptions::default() };
        match certify(&from, &to, &options, &Quiet).expect("valid polygons") {
            Verdict::Undecided { boxes: spent, worst, bound } => {
                assert!(spent >= boxes && spent < boxes + 1000 && worst.is_finite() && !(bound > 0.0));
            }
            other => panic!("{other:?}"),
        }
    }
    // J = 0 at the vertex: neither proof nor refutation exists in interval arithmetic.
    let PolygonPair { source, target } = square_corner(1.0 / (2.0 * 2.0f64.sqrt() - 1.0));
    assert!(!matches!(verdict(&source, &target), Verdict::Certified { lower_bound } if lower_bound > 1e-12));
}

#[test]
fn progress_adds_up() {
    struct Sum(AtomicU64, AtomicU64);
    impl Progress for Sum {
        fn stage(&self, _name: &str, total: u64) {
            self.0.store(total, Ordering::Relaxed);
        }
        fn advance(&self, count: u64) {
            self.1.fetch_add(count, Ordering::Relaxed);
        }
    }
    let (from, to) = step(&nested_squares(), 0.0, 0.25);
    let sum = Sum(AtomicU64::new(0), AtomicU64::new(0));
    certify(&from, &to, &CertifyOptions::default(), &sum).expect("valid polygons");
    assert_eq!(sum.0.into_inner(), sum.1.into_inner());
}

#[test]
fn bad_input_is_refused_by_name() {
    let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let polygon = |v: &[[f64; 2]]| Polygon::from_loops(vec![v.iter().map(|v| DVec2::from(*v)).collect()]);
    let good = polygon(&square);
    let message = |from: &Polygon, to: &Polygon| match certify(from, to, &CertifyOptions::default(), &Quiet) {
        Err(e) => e.to_string(),
        Ok(v) => panic!("{v:?}"),
    };
    let empty = Polygon::from_loops(Vec::new());
    assert!(message(&good, &polygon(&square[..3])).contains("[4] and [3]"));
    assert!(message(&polygon(&square[..2]), &polygon(&square[..2])).contains("loop 0 has 2"));
    assert!(message(&empty, &empty).contains("empty"));
    let with = |i: usize, v: [f64; 2]| {
        let mut vertices = square;
        vertices[i] = v;
        polygon(&vertices)
    };
    assert!(message(&with(2, [f64::NAN, 0.0]), &good).contains("vertex 2 of the source"));
    assert!(message(&good, &with(1, [0.0, f64::INFINITY])).contains("vertex 1 of the target"));
    assert!(message(&with(1, [0.0, 0.0]), &good).contains("vertex 0 of the source and the next"));
    assert!(message(&polygon(&[[1.0; 2]; 4]), &good).contains("size"));
    let reversed: Vec<[f64; 2]> = square.iter().rev().copied().collect();
    assert!(message(&polygon(&reversed), &good).contains("left of its edges"));
    let pair = nested_squares();
    let loops = pair.source.loops();
    let wrong = Polygon::from_loops(vec![loops[0].clone(), loops[1].iter().rev().copied().collect()]);
    assert!(message(&wrong, &wrong).contains("left of its edges at vertex 4"));
    let options = CertifyOptions { tolerance: 0.0, ..CertifyOptions::default() };
    assert!(certify(&good, &good, &options, &Quiet).is_err());
    // Degenerate, crossing and flat polygons end without a certificate.
    for bad in [
        with(2, [0.0, 0.0]),
        with(2, [0.5, 0.0]),
        polygon(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]),
        polygon(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [1.5, 0.0]]),
        polygon(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1e-300], [0.0, 1.0]]),
    ] {
        let found = certify(&bad, &good, &CertifyOptions { boxes: 5000, ..CertifyOptions::default() }, &Quiet);
        assert!(!matches!(found, Ok(Verdict::Certified { .. })), "{bad:?}: {found:?}");
    }
}
