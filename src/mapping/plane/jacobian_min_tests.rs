//! The smallest Jacobian against closed forms and stored cases.

use super::testing::{between, hexagons, nested_squares, pairs, ring, square, star};
use super::{Coordinates, Minimum, MinimumKind, SampleOptions, jacobian_min};
use crate::engine::Engine;
use crate::geometry::Polygon;

fn smallest(from: &Polygon, to: &Polygon, resolution: u32) -> Minimum {
    let options = SampleOptions { resolution };
    let pairs = [(from.clone(), to.clone())];
    jacobian_min(&Engine::reference(), Coordinates::MeanValue, &pairs, &options).unwrap()[0]
}

#[test]
fn the_unit_square_has_its_closed_form_at_every_resolution() {
    // The sign changes at s = 0.546918; at 0.5475 no pixel sees it.
    for s in [0.1, 0.3, 0.5, 0.54691, 0.54693, 0.5475, 0.7, 0.9, 0.995] {
        for resolution in [32, 33, 64, 100, 256, 1024] {
            let found = smallest(&square(0.0), &square(s), resolution);
            assert_eq!(found.value > 0.0, s < 0.546_918);
            let expected = 1.0 - (8f64.sqrt() - 1.0) * s;
            assert!((found.value - expected).abs() < 1e-6, "s = {s} at {resolution}: {found:?} for {expected}");
            assert_eq!(found.kind, MinimumKind::Vertex);
            assert!((found.at - glam::DVec2::ONE).length() < 1e-12);
        }
    }
}

/// Listing 1 on a linear path.
fn partition(from: &Polygon, to: &Polygon, resolution: u32) -> Vec<f64> {
    fn refine(from: &Polygon, to: &Polygon, a: f64, b: f64, resolution: u32, knots: &mut Vec<f64>) {
        let found = smallest(&between(from, to, a), &between(from, to, b), resolution);
        if found.value <= 0.0 && b - a > 0.01 {
            let c = 0.5 * (a + b);
            refine(from, to, a, c, resolution, knots);
            refine(from, to, c, b, resolution, knots);
        } else {
            knots.push(b);
        }
    }
    let mut knots = vec![0.0];
    refine(from, to, 0.0, 1.0, resolution, &mut knots);
    knots
}

#[test]
fn partitions_are_those_of_the_notes_at_every_resolution() {
    let [a, b, c] = pairs();
    let (h, k) = hexagons();
    for (name, from, to, steps) in [
        ("nested", nested_squares(0.0), nested_squares(1.0), 5),
        (a.0, a.1, a.2, 4),
        (b.0, b.1, b.2, 4),
        (c.0, c.1, c.2, 5),
        ("hexagons", h, k, 2),
    ] {
        let fine = partition(&from, &to, 256);
        for resolution in [32, 64, 128] {
            assert_eq!(partition(&from, &to, resolution), fine, "{name} at {resolution}");
        }
        assert!(fine.len() <= steps + 1, "{name}: {fine:?}");
        if name == "nested" {
            assert_eq!(fine, [0.0, 0.25, 0.5, 0.75, 0.875, 1.0]);
        }
    }
}

#[test]
fn the_minimum_does_not_depend_on_the_raster() {
    let mut cases: Vec<(Polygon, Polygon)> = pairs().into_iter().map(|(_, a, b)| (a, b)).collect();
    cases.push(hexagons());
    cases.push((nested_squares(0.0), nested_squares(0.2)));
    for (from, to) in cases {
        for t in [0.125, 0.5, 1.0] {
            let to = between(&from, &to, t);
            let fine = smallest(&from, &to, 512);
            for resolution in [24, 64, 150] {
                let coarse = smallest(&from, &to, resolution);
                assert!((coarse.value - fine.value).abs() < 1e-7, "{resolution}: {coarse:?} {fine:?}");
                assert_eq!(coarse.kind, fine.kind);
            }
        }
    }
}

#[test]
fn minima_inside_and_on_edges_are_found() {
    let (from, to) = hexagons();
    let kinds = [32, 64, 300].map(|resolution| smallest(&from, &to, resolution));
    assert!(kinds.iter().all(|m| m.kind == MinimumKind::Interior && (m.value - kinds[0].value).abs() < 1e-9));
    // The notes have it from a raster of 1024.
    assert!((kinds[0].value + 0.013_15).abs() < 2e-5 && (kinds[0].at - glam::dvec2(-0.300, -0.914)).length() < 2e-3);
    // Against every point of a fine raster of its own.
    for (_, from, to) in pairs() {
        let found = smallest(&from, &to, 64);
        let step = super::Step::<f64>::new(Coordinates::MeanValue, &from, &to, 0.25);
        let raster = super::samples::Raster::new(&step.outline, 400);
        let centres = raster.runs.iter().flat_map(|r| (0..r.count).map(|i| raster.centre(r.row, r.first + i)));
        let lowest = centres.map(|p| step.evaluate(p).jacobian).fold(f64::INFINITY, f64::min);
        assert!(found.value <= lowest + 1e-12, "{found:?} {lowest}");
    }
}

#[test]
fn collapsed_images_are_folds_and_bad_pairs_are_refused() {
    let flat = ring(&[[0.0, 0.0]; 4]);
    assert!(smallest(&square(0.0), &flat, 32).value <= 0.0);
    let refused = |from: Polygon, to: Polygon, resolution: u32, coordinates| {
        let options = SampleOptions { resolution };
        jacobian_min(&Engine::reference(), coordinates, &[(from, to)], &options).unwrap_err().to_string()
    };
    let mean = Coordinates::MeanValue;
    assert!(refused(square(0.0), star(5, 1.0, 1.0, [0.0; 2]), 32, mean).contains("different numbers"));
    assert!(refused(square(0.0), ring(&[[f64::NAN; 2]; 4]), 32, mean).contains("vertex 0"));
    assert!(refused(square(0.0), square(0.1), 0, mean).contains("option resolution"));
    assert!(refused(square(0.6), square(0.1), 32, Coordinates::Wachspress).contains("vertex 2"));
    assert!(refused(ring(&[[0.0, 0.0], [1.0, 0.0]]), ring(&[[0.0, 0.0], [1.0, 0.0]]), 32, mean).contains("3 vertices"));
}
