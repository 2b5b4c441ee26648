//! The theory that a step has to satisfy, in double precision.

use glam::dvec2;

use super::Frame;
use super::step::{Branch, Coordinates, Step, coordinates};
use super::testing::{Random, hexagons, nested_squares, pairs, ring, square, star};
use crate::geometry::Polygon;

fn step(from: &Polygon, to: &Polygon) -> Step<f64> {
    Step::new(Coordinates::MeanValue, from, to, Frame::common_scale([from, to]))
}

/// Polygons with reflex vertices, holes, and none of both.
fn polygons() -> Vec<Polygon> {
    vec![square(0.0), square(0.7), star(10, 1.0, 0.4, [0.1, -0.2]), nested_squares(0.3), hexagons().0]
}

/// Points around a polygon, inside and outside.
fn points(polygon: &Polygon, count: usize, reach: f64) -> Vec<glam::DVec2> {
    let mut random = Random(17);
    let (centre, size) = (polygon.centre(), polygon.size() * reach);
    (0..count).map(|_| centre + dvec2(random.unit() - 0.5, random.unit() - 0.5) * size).collect()
}

#[test]
fn coordinates_sum_to_one_and_reproduce_the_point() {
    for polygon in polygons() {
        for p in points(&polygon, 300, 3.0) {
            let b = coordinates(Coordinates::MeanValue, &polygon, p).unwrap();
            let sum: f64 = b.iter().sum();
            let at = b.iter().zip(polygon.vertices()).fold(glam::DVec2::ZERO, |at, (b, v)| at + v * *b);
            assert!((sum - 1.0).abs() < 1e-12 && (at - p).length() < 1e-12, "{sum} {at} {p}");
        }
    }
}

#[test]
fn coordinates_are_linear_on_edges_and_one_at_vertices() {
    for polygon in polygons() {
        let all: Vec<_> = polygon.vertices().collect();
        for corner in polygon.corners() {
            let b = coordinates(Coordinates::MeanValue, &polygon, all[corner.index]).unwrap();
            assert!(b.iter().enumerate().all(|(i, b)| *b == f64::from(u8::from(i == corner.index))));
            for s in [1e-9, 0.01, 0.3, 0.5, 0.99] {
                let p = all[corner.index].lerp(all[corner.after], s);
                let b = coordinates(Coordinates::MeanValue, &polygon, p).unwrap();
                for (i, b) in b.iter().enumerate() {
                    let expected = if i == corner.index {
                        1.0 - s
                    } else if i == corner.after {
                        s
                    } else {
                        0.0
                    };
                    assert!((b - expected).abs() < 1e-12, "{b} for {expected}");
                }
            }
        }
    }
}

#[test]
fn the_identity_is_exact() {
    for polygon in polygons() {
        let map = step(&polygon, &polygon);
        let frame = Frame::of(&polygon, Frame::common_scale([&polygon]));
        for p in points(&polygon, 100, 4.0) {
            let p = frame.local(p);
            let e = map.evaluate(p);
            assert_eq!((e.point, e.jacobian, map.map(p)), (p, 1.0, p));
        }
    }
}

#[test]
fn the_derivative_is_that_of_the_map() {
    for (name, from, to) in pairs() {
        let map = step(&from, &to);
        let frame = Frame::of(&from, Frame::common_scale([&from, &to]));
        for p in points(&from, 200, 2.0) {
            let p: [f64; 2] = frame.local(p);
            let e = map.evaluate(p);
            assert_eq!(e.point, map.map(p), "both forms of the image");
            let h = 1e-5;
            for axis in 0..2 {
                let moved = |by: f64| map.map(std::array::from_fn(|k| p[k] + if k == axis { by } else { 0.0 }));
                let (a, b) = (moved(-h), moved(h));
                for row in 0..2 {
                    let difference = (b[row] - a[row]) / (2.0 * h);
                    // Truncation of the difference next to a notch: h^2 / r^2.
                    assert!((difference - e.derivative[row][axis]).abs() < 1e-5, "{name} at {p:?}: {difference} {e:?}");
                }
            }
        }
    }
}

#[test]
fn the_derivative_is_continuous_through_edges() {
    for (name, from, to) in pairs() {
        let map = step(&from, &to);
        let all = &map.outline.vertices;
        for (i, k) in map.outline.edges() {
            for s in [0.2, 0.5, 0.9] {
                let (a, b) = (all[i], all[k]);
                let on = [a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])];
                let e = map.evaluate(on);
                for side in [-1e-9, 1e-9] {
                    let near = map.evaluate([on[0] - side * (b[1] - a[1]), on[1] + side * (b[0] - a[0])]);
                    assert!((near.jacobian - e.jacobian).abs() < 1e-6, "{name}: {near:?} next to {e:?}");
                }
            }
        }
    }
}

#[test]
fn branches_are_told() {
    let map = step(&square(0.0), &square(0.5));
    assert_eq!(map.evaluate([0.0, 0.0]).branch, Branch::Inside);
    let edge = map.outline.vertices[1];
    assert_eq!(map.evaluate([edge[0], 0.0]).branch, Branch::OnEdge(1));
    let e = map.evaluate(map.outline.vertices[2]);
    assert_eq!((e.branch, e.point), (Branch::AtVertex(2), map.outline.images[2]));
}

#[test]
fn limits_at_vertices_are_those_of_the_map() {
    for (name, from, to) in pairs().into_iter().chain([("nested", nested_squares(0.0), nested_squares(0.4))]) {
        let map = step(&from, &to);
        for corner in from.corners() {
            let v = map.outline.vertices[corner.index];
            let limit = map.limit(corner.index);
            let (mut smallest, half) = (f64::INFINITY, limit.half_angle());
            for j in 0..=40 {
                let phi = half * (f64::from(j) / 20.0 - 1.0) * (1.0 - 1e-12);
                let (direction, derivative) =
                    (limit.direction(phi.cos(), phi.sin()), limit.derivative_at(phi.cos(), phi.sin()));
                for r in [1e-5, 1e-6, 1e-7] {
                    let e = map.evaluate([v[0] + r * direction[0], v[1] + r * direction[1]]);
                    for row in 0..2 {
                        for axis in 0..2 {
                            // The next term of the expansion is linear in r; its factor is of the
                            // size of the derivative over the shortest edge.
                            let (found, limit) = (e.derivative[row][axis], derivative[row][axis]);
                            let bound = 50.0 * r * (1.0 + limit.abs());
                            assert!((found - limit).abs() < bound, "{name} vertex {} at {phi}, {r}", corner.index);
                        }
                    }
                    if r < 2e-7 {
                        smallest = smallest.min(e.jacobian);
                    }
                }
            }
            let inf = limit.smallest();
            // At 41 samples of phi the sinusoid is at most 0.3 % of its amplitude above its lowest
            // point.
            let amplitude = 1.0 + smallest.abs() * 10.0;
            assert!(inf < smallest + 1e-5 * amplitude, "{name} vertex {}: {inf} {smallest}", corner.index);
            assert!(inf > smallest - 3e-3 * amplitude, "{name} vertex {}: {inf} {smallest}", corner.index);
        }
    }
}

#[test]
fn wachspress_has_the_properties_of_coordinates() {
    for polygon in [
        square(0.0),
        square(0.3),
        hexagons().0,
        star(7, 1.0, 1.0, [0.0; 2]),
        ring(&[[0.0, 0.0], [3.0, 1.0], [1.0, 2.0]]),
    ] {
        let all: Vec<_> = polygon.vertices().collect();
        let mut random = Random(5);
        for _ in 0..100 {
            // A random convex combination is inside; powers push it towards vertices and edges.
            let w: Vec<f64> = all.iter().map(|_| random.unit().powi(6)).collect();
            let total: f64 = w.iter().sum();
            let p = w.iter().zip(&all).fold(glam::DVec2::ZERO, |p, (w, v)| p + *v * (w / total));
            let b = coordinates(Coordinates::Wachspress, &polygon, p).unwrap();
            let at = b.iter().zip(&all).fold(glam::DVec2::ZERO, |at, (b, v)| at + *v * *b);
            assert!((b.iter().sum::<f64>() - 1.0).abs() < 1e-12 && (at - p).length() < 1e-11, "{b:?}");
            assert!(b.iter().all(|b| *b > -1e-14));
        }
        for corner in polygon.corners() {
            let b =
                coordinates(Coordinates::Wachspress, &polygon, all[corner.index].lerp(all[corner.after], 0.3)).unwrap();
            assert!((b[corner.index] - 0.7).abs() < 1e-11 && (b[corner.after] - 0.3).abs() < 1e-11, "{b:?}");
        }
    }
}

#[test]
fn wachspress_derivatives_are_those_of_the_map_even_at_vertices() {
    let (from, to) = hexagons();
    let map = Step::<f64>::new(Coordinates::Wachspress, &from, &to, 0.5);
    let inside = |p: [f64; 2]| super::samples::contains(&map.outline, p);
    let centre = [0.0, 0.0];
    for corner in from.corners() {
        let v = map.outline.vertices[corner.index];
        for t in [0.0, 1e-9, 0.1, 0.5, 1.0] {
            let p = [v[0] + t * (centre[0] - v[0]), v[1] + t * (centre[1] - v[1])];
            let e = map.evaluate(p);
            let h = 1e-6;
            let moved = map.map([p[0] + h * (0.3 - v[0]), p[1] - h * v[1]]);
            for row in 0..2 {
                let along = e.derivative[row][0] * (0.3 - v[0]) - e.derivative[row][1] * v[1];
                assert!(((moved[row] - e.point[row]) / h - along).abs() < 1e-2 * (1.0 + along.abs()), "{corner:?} {t}");
            }
            assert!(t < 0.1 || inside(p));
        }
    }
}

#[test]
fn wachspress_refuses_what_is_not_convex() {
    for (polygon, what) in [
        (star(10, 1.0, 0.4, [0.0; 2]), "vertex 1"),
        (nested_squares(0.0), "2"),
        (ring(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [1.0, 1.0]]), "vertex 1"),
        (ring(&[[1.0, 0.0], [-0.8, 0.6], [0.3, -0.95], [0.3, 0.95], [-0.8, -0.6]]), "simple"),
    ] {
        let e = coordinates(Coordinates::Wachspress, &polygon, dvec2(0.1, 0.1)).unwrap_err().to_string();
        assert!(e.contains(what) && e.contains("mean-value"), "{e}");
    }
    assert_eq!("wachspress".parse::<Coordinates>().unwrap(), Coordinates::Wachspress);
    assert!("green".parse::<Coordinates>().unwrap_err().to_string().contains("green"));
}

#[test]
fn gradients_of_coordinates_reproduce_linear_functions_and_are_their_differences() {
    let (star, convex) = (star(10, 1.0, 0.4, [0.0, 0.1]), hexagons().0);
    for (kind, polygon) in
        [(Coordinates::MeanValue, &star), (Coordinates::MeanValue, &convex), (Coordinates::Wachspress, &convex)]
    {
        let map = Step::<f64>::new(kind, polygon, polygon, 0.5);
        for p in [[0.05, 0.1], [0.4, 0.005], [0.15, 0.05]] {
            let gradients = map.gradients_of(p);
            for axis in 0..2 {
                let sum =
                    |of: &dyn Fn(usize) -> f64| (0..gradients.len()).map(|i| of(i) * gradients[i][axis]).sum::<f64>();
                assert!(sum(&|_| 1.0).abs() < 1e-11);
                for row in 0..2 {
                    let moment = sum(&|i| map.outline.vertices[i][row]);
                    assert!((moment - f64::from(u8::from(row == axis))).abs() < 1e-11, "{kind} {moment}");
                }
                let h = 1e-6;
                let beside = |h: f64| {
                    let mut q = p;
                    q[axis] += h;
                    map.coordinates_of(q)
                };
                let (after, before) = (beside(h), beside(-h));
                for (i, g) in gradients.iter().enumerate() {
                    assert!((g[axis] - (after[i] - before[i]) / (2.0 * h)).abs() < 1e-6, "{kind} {i}");
                }
            }
        }
    }
}
