//! What holds for composite maps whatever the path: interpolation, derivative, inverse, and how the
//! backward map converges.

use glam::DVec2;

use super::composite::CompositeMap;
use super::step::Coordinates;
use crate::engine::Engine;
use crate::geometry::Polygon;
use crate::models::polygons::{PolygonPair, inverted_star, nested_squares, square_corner, twisted_star};

/// The map through the given knots of the linear path.
fn linear(pair: &PolygonPair, knots: &[f64]) -> CompositeMap {
    let at = |t: f64| {
        let loops = pair.source.loops().iter().zip(pair.target.loops());
        Polygon::from_loops(loops.map(|(a, b)| a.iter().zip(b).map(|(a, b)| a.lerp(*b, t)).collect()).collect())
    };
    CompositeMap::new(Coordinates::MeanValue, knots.iter().map(|t| at(*t)).collect()).unwrap()
}

fn uniform(pair: &PolygonPair, m: usize) -> CompositeMap {
    linear(pair, &(0..=m).map(|k| k as f64 / m as f64).collect::<Vec<_>>())
}

/// Points strictly inside, found by the winding number of each loop.
fn inside(polygon: &Polygon, count: usize) -> Vec<DVec2> {
    let (low, high) = polygon.bounds();
    let winding = |p: DVec2| -> i32 {
        let vertices: Vec<DVec2> = polygon.vertices().collect();
        let turns = polygon.corners().map(|c| {
            let (a, b) = (vertices[c.index] - p, vertices[c.after] - p);
            let left = a.perp_dot(b);
            i32::from(a.y <= 0.0 && b.y > 0.0 && left > 0.0) - i32::from(a.y > 0.0 && b.y <= 0.0 && left < 0.0)
        });
        turns.sum()
    };
    // Points of a lattice with irrational steps, so that none is on an edge.
    let step = |i: usize, s: f64| (i as f64 * s).fract();
    (1..)
        .map(|i| low + (high - low) * DVec2::new(step(i, 2.0_f64.sqrt()), step(i, 3.0_f64.sqrt())))
        .filter(|p| winding(*p) == 1)
        .take(count)
        .collect()
}

#[test]
fn boundaries_are_interpolated() {
    for pair in [inverted_star(), twisted_star(), nested_squares(), square_corner(0.8)] {
        let map = uniform(&pair, 8);
        let (source, target): (Vec<_>, Vec<_>) = (pair.source.vertices().collect(), pair.target.vertices().collect());
        for c in pair.source.corners() {
            for t in [0.0, 0.1, 0.5, 0.999] {
                let image = map.forward(source[c.index].lerp(source[c.after], t)).point;
                let truth = target[c.index].lerp(target[c.after], t);
                assert!((image - truth).length() < 1e-13, "edge {} at {t}: {image} is not {truth}", c.index);
            }
        }
    }
}

#[test]
fn the_derivative_is_the_limit_of_differences() {
    let map = uniform(&twisted_star(), 5);
    for p in inside(map.source(), 50) {
        let h = 1e-6;
        let columns =
            [DVec2::X, DVec2::Y].map(|e| (map.forward(p + e * h).point - map.forward(p - e * h).point) / (2.0 * h));
        let d = map.forward(p).derivative;
        let off = (d.x_axis - columns[0]).length() + (d.y_axis - columns[1]).length();
        // Central differences: h^2 times the third derivative, and the rounding of the values over
        // h.
        assert!(off < 1e-6, "at {p}: {off}");
    }
}

#[test]
fn inverses_are_exact_inside() {
    let knots = [0.0, 0.5, 0.75, 0.875, 1.0];
    for (pair, knots) in [
        (inverted_star(), &knots[..]),
        (twisted_star(), &knots[..]),
        (nested_squares(), &[0.0, 0.25, 0.5, 0.75, 0.875, 1.0][..]),
        (square_corner(0.8), &[0.0, 0.5, 0.75, 0.875, 0.9375, 1.0][..]),
    ] {
        let map = linear(&pair, knots);
        for q in inside(map.target(), 400) {
            let p = map.inverse(q).unwrap_or_else(|| panic!("no pre-image of {q}"));
            let back = map.forward(p.point);
            assert!((back.point - q).length() < 1e-12, "{q}: {}", (back.point - q).length());
            assert!(p.jacobian() > 0.0 && (p.derivative - back.derivative).x_axis.length() < 1e-6);
            let refined = map.refine(q, p.point + DVec2::new(1e-3, -2e-3)).unwrap();
            assert!((refined.point - p.point).length() < 1e-10);
        }
        for (v, w) in map.source().vertices().zip(map.target().vertices()) {
            assert!((map.inverse(w).unwrap().point - v).length() < 1e-12, "vertex {w}");
        }
    }
}

#[test]
fn pre_images_of_many_points_are_exact_to_the_stated_tolerance() {
    let knots = [0.0, 0.5, 0.75, 0.875, 1.0];
    for pair in [inverted_star(), twisted_star(), square_corner(0.6)] {
        // Far from the origin and large, as pixels can be.
        let moved = |p: &Polygon| {
            let place = |v: &DVec2| *v * 700.0 + DVec2::new(9000.0, -500.0);
            Polygon::from_loops(p.loops().iter().map(|l| l.iter().map(place).collect()).collect())
        };
        let map = linear(&PolygonPair { source: moved(&pair.source), target: moved(&pair.target) }, &knots);
        let size = map.source().size().max(map.target().size());
        let mut q = inside(map.target(), 3000);
        q.extend(map.target().vertices());
        for engine in [Engine::cpu(), Engine::reference()] {
            let near: Vec<DVec2> = q.iter().map(|q| map.inverse(*q).unwrap().point + DVec2::new(0.3, -0.2)).collect();
            for guess in [None, Some(&near[..])] {
                let found = map.inverse_points(&engine, &q, guess).unwrap();
                for (q, p) in q.iter().zip(&found) {
                    let p = p.unwrap_or_else(|| panic!("no pre-image of {q}"));
                    let truth = map.forward(p.point);
                    assert!((truth.point - *q).length() <= 4.8e-7 * size, "{q}: {}", (truth.point - *q).length());
                }
            }
        }
        let odd = [DVec2::NAN, DVec2::INFINITY, DVec2::splat(1e300)];
        assert!(map.inverse_points(&Engine::cpu(), &odd, None).unwrap()[..2].iter().all(Option::is_none));
        assert!(map.inverse_points(&Engine::cpu(), &q, Some(&odd)).is_err(), "three guesses for many points");
    }
}

#[test]
fn images_of_many_points_are_those_of_single_ones() {
    let map = uniform(&twisted_star(), 9);
    let p = inside(map.source(), 500);
    for (engine, tolerance) in [(Engine::cpu(), 1e-6), (Engine::reference(), 1e-13)] {
        for (p, found) in p.iter().zip(map.forward_points(&engine, &p).unwrap()) {
            let truth = map.forward(*p);
            assert!((truth.point - found.point).length() < tolerance);
            // Products of nine derivatives of a few roundings each.
            assert!((truth.jacobian() - found.jacobian()).abs() < 100.0 * tolerance * truth.jacobian().abs().max(1.0));
        }
    }
}

#[test]
fn the_error_of_the_backward_map_falls_like_one_over_m() {
    for pair in [inverted_star(), twisted_star(), square_corner(0.8)] {
        let points = inside(&pair.source, 300);
        let scaled = [64, 128, 256, 512].map(|m| {
            let map = uniform(&pair, m);
            let back = map.backward();
            let off = |p: &DVec2| (back.forward(map.forward(*p).point).point - *p).length();
            m as f64 * points.iter().map(off).fold(0.0, f64::max)
        });
        let (least, most) =
            (scaled.iter().fold(f64::MAX, |a, b| a.min(*b)), scaled.iter().fold(0.0, |a: f64, b| a.max(*b)));
        assert!(most / least < 1.04 && least > 0.1, "{scaled:?}");
    }
}

#[test]
fn polygons_that_do_not_match_are_refused() {
    let (star, square) = (inverted_star().source, square_corner(0.1).source);
    assert!(CompositeMap::new(Coordinates::MeanValue, vec![star.clone()]).is_err());
    assert!(CompositeMap::new(Coordinates::MeanValue, vec![star, square]).is_err());
}

#[test]
fn points_in_two_parts_lose_less_than_rounded_ones() {
    // The local size of the polygons is between a half and 1. Their vertices are rounded to single
    // precision, 2^-25 for each component at most, and images move with them; roundings of
    // displacements, a few hundredths long, are below a tenth of that.
    const VERTICES: f64 = 2.0 / 33_554_432.0;
    for pair in [twisted_star(), square_corner(0.5)] {
        let map = uniform(&pair, 32);
        let points = inside(map.source(), 2000);
        let scale = map.frame(0).scale;
        let off = |all: Vec<super::Mapped>| {
            let off = |(p, m): (&DVec2, &super::Mapped)| (map.forward(*p).point - m.point).length() * scale;
            points.iter().zip(&all).map(off).fold(0.0, f64::max)
        };
        let parts = off(map.forward_in_parts(&points));
        let rounded = off(map.forward_points(&Engine::cpu(), &points).unwrap());
        assert!(parts < 2.0 * VERTICES && parts < 0.7 * rounded, "{parts} {rounded}");
    }
    // At vertices, too, where the derivative takes the second part.
    let map = uniform(&twisted_star(), 4);
    let vertices: Vec<DVec2> = map.source().vertices().collect();
    for (m, v) in map.forward_in_parts(&vertices).iter().zip(map.target().vertices()) {
        assert!((m.point - v).length() * map.frame(0).scale < 2.0 * VERTICES);
    }
}
