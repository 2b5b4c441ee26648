//! What makes coordinates barycentric, and derivatives derivatives: inside, outside, and on and
//! next to every part of the cage.

use glam::DVec3;

use super::Step;
use super::testing::{box_cage, cube, dented, places, sphere};
use crate::engine::{Lane, LaneScalar, Lanes, Real};

/// A(x) = x + B x + c moved by `amount`.
fn affine(p: DVec3, amount: f64) -> DVec3 {
    let b = glam::DMat3::from_cols_array(&[0.2, -0.4, 0.1, 0.5, 0.3, -0.2, 0.1, 0.6, -0.3]);
    p + amount * (b * p + DVec3::new(0.3, -0.2, 0.5))
}

fn local(p: DVec3) -> [f64; 3] {
    p.to_array()
}

/// A name, triangles and vertices.
type Case = (&'static str, Vec<[u32; 3]>, Vec<DVec3>);

/// The cages of the tests: already in local coordinates, so that a step with the scale 1 changes
/// nothing.
fn cages() -> Vec<Case> {
    let all = [("cube", cube()), ("box", box_cage(3)), ("dented", dented()), ("sphere", sphere())];
    all.into_iter().map(|(name, (triangles, vertices))| (name, triangles, vertices)).collect()
}

#[test]
fn coordinates_are_barycentric_everywhere() {
    for (name, triangles, vertices) in cages() {
        let step = Step::new(&triangles, &vertices, &vertices, 1.0);
        for (place, p) in places(&triangles, &vertices) {
            let b = step.coordinates_of(local(p));
            let sum: f64 = b.iter().sum();
            let back: DVec3 = b.iter().zip(&vertices).map(|(&b, &v)| b * v).sum();
            let size: f64 = b.iter().map(|b| b.abs()).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{name}, {place}: sum {sum}");
            assert!(back.distance(p) < 2e-11 * size, "{name}, {place}: {p} {back} {:e}", back.distance(p));
        }
        for (i, v) in vertices.iter().enumerate() {
            let b = step.coordinates_of(local(*v));
            assert!(b.iter().enumerate().all(|(k, b)| *b == f64::from(u8::from(k == i))), "{name}, vertex {i}");
        }
        // On a face only its corners count.
        for t in &triangles {
            let corner = t.map(|v| vertices[v as usize]);
            let b = step.coordinates_of(local(corner[0] * 0.2 + corner[1] * 0.5 + corner[2] * 0.3));
            for (k, expected) in t.iter().zip([0.2, 0.5, 0.3]) {
                assert!((b[*k as usize] - expected).abs() < 1e-10, "{name} {t:?}: {b:?}");
            }
        }
    }
}

/// Ju, Schaefer, Warren 2005, their Figure 4, with distances on faces.
fn published(triangles: &[[u32; 3]], vertices: &[DVec3], x: DVec3) -> Vec<f64> {
    let mut w = vec![0.0; vertices.len()];
    for t in triangles {
        let p = t.map(|v| vertices[v as usize] - x);
        let d = p.map(|p| p.length());
        let u = [0, 1, 2].map(|i| p[i] / d[i]);
        let theta = [0, 1, 2].map(|i| 2.0 * (0.5 * (u[(i + 1) % 3] - u[(i + 2) % 3]).length()).asin());
        let h = theta.iter().sum::<f64>() / 2.0;
        let side = u[0].dot(u[1].cross(u[2])).signum();
        let c = [0, 1, 2].map(|i| {
            2.0 * h.sin() * (h - theta[i]).sin() / (theta[(i + 1) % 3].sin() * theta[(i + 2) % 3].sin()) - 1.0
        });
        let s = c.map(|c| side * (1.0 - c * c).max(0.0).sqrt());
        for i in 0..3 {
            let (k, l) = ((i + 1) % 3, (i + 2) % 3);
            w[t[i] as usize] += (theta[i] - c[k] * theta[l] - c[l] * theta[k]) / (2.0 * d[i] * theta[k].sin() * s[l]);
        }
    }
    let total: f64 = w.iter().sum();
    w.iter().map(|w| w / total).collect()
}

#[test]
fn away_from_the_cage_they_are_the_published_ones() {
    for (name, triangles, vertices) in cages() {
        let step = Step::new(&triangles, &vertices, &vertices, 1.0);
        for p in
            [DVec3::new(0.0312, 0.0217, -0.0153), DVec3::new(-0.0931, 0.1217, 0.0853), DVec3::new(1.31, -0.72, 0.91)]
        {
            let (ours, theirs) = (step.coordinates_of(local(p)), published(&triangles, &vertices, p));
            for (a, b) in ours.iter().zip(&theirs) {
                assert!((a - b).abs() < 1e-10, "{name} at {p}: {a} {b}");
            }
        }
    }
}

#[test]
fn affine_maps_are_reproduced_with_their_derivative() {
    for (name, triangles, vertices) in cages() {
        let to: Vec<DVec3> = vertices.iter().map(|&v| affine(v, 1.0)).collect();
        // The frame of the image has another origin.
        let shift = super::Frame::of(&to, 1.0).origin();
        let step = Step::new(&triangles, &vertices, &to, 1.0);
        let slope = affine(DVec3::X, 1.0) - affine(DVec3::ZERO, 1.0);
        for (place, p) in places(&triangles, &vertices) {
            let e = step.evaluate(local(p));
            let off = DVec3::from(e.point).distance(affine(p, 1.0) - shift);
            assert!(off < 1e-10, "{name}, {place}: {off:e}");
            let column = DVec3::new(e.derivative[0][0], e.derivative[1][0], e.derivative[2][0]);
            assert!(column.distance(slope) < 2e-6, "{name}, {place}: {column} {slope}");
            let plain = DVec3::from(step.map(local(p)));
            assert!(plain.distance(e.point.into()) < 1e-10, "{name}, {place}: with and without derivative");
        }
    }
}

#[test]
fn the_identity_has_the_jacobian_one() {
    for (name, triangles, vertices) in cages() {
        let step = Step::new(&triangles, &vertices, &vertices, 1.0);
        for (place, p) in places(&triangles, &vertices) {
            let e = step.evaluate(local(p));
            assert_eq!((e.point, e.jacobian), (local(p), 1.0), "{name}, {place}");
        }
    }
}

/// Distance to the nearest edge.
fn to_edges(triangles: &[[u32; 3]], vertices: &[DVec3], p: DVec3) -> f64 {
    let distance = |a: DVec3, b: DVec3| {
        let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        p.distance(a + (b - a) * t)
    };
    let at = |v: u32| vertices[v as usize];
    let each = |t: &[u32; 3]| (0..3).map(|k| distance(at(t[k]), at(t[(k + 1) % 3]))).fold(f64::INFINITY, f64::min);
    triangles.iter().map(each).fold(f64::INFINITY, f64::min)
}

/// Vertices moved at random.
fn moved(vertices: &[DVec3], amount: f64) -> Vec<DVec3> {
    let mut random = crate::models::shapes::Random::new(5);
    vertices.iter().map(|&v| v + amount * DVec3::new(random.signed(), random.signed(), random.signed())).collect()
}

#[test]
fn derivatives_are_those_of_differences() {
    for (name, triangles, vertices) in cages() {
        let step = Step::new(&triangles, &vertices, &moved(&vertices, 0.2), 1.0);
        for (place, p) in places(&triangles, &vertices) {
            // Away from where the map has no derivative, by more than the stencil.
            if to_edges(&triangles, &vertices, p) < 1e-3 {
                continue;
            }
            let e = step.evaluate(local(p));
            let s = 2e-5;
            for axis in 0..3 {
                let step_by = |k: f64| DVec3::from(step.map(local(p + DVec3::AXES[axis] * k * s)));
                let slope = (step_by(-2.0) - step_by(2.0) + 8.0 * (step_by(1.0) - step_by(-1.0))) / (12.0 * s);
                for row in 0..3 {
                    let off = (slope[row] - e.derivative[row][axis]).abs();
                    assert!(
                        off < 1e-6,
                        "{name}, {place} at {p}: row {row} by {axis}: {} {}",
                        slope[row],
                        e.derivative[row][axis]
                    );
                }
            }
        }
    }
}

fn double<E: Real>(x: E) -> f64 {
    x.to_f64()
}

/// Worst difference from double precision of the map, and of the Jacobian.
fn difference<E: LaneScalar + Lane<Cpu = (), E = E>>(lanes: Lanes) -> (f64, f64) {
    let (mut map, mut jacobian): (f64, f64) = (0.0, 0.0);
    for (name, triangles, vertices) in cages() {
        // Both get the same rounded input.
        let round = |p: DVec3| DVec3::from(p.to_array().map(|x| f64::from(x as f32)));
        let from: Vec<DVec3> = vertices.iter().map(|&v| round(v)).collect();
        let wide = Step::new(&triangles, &from, &moved(&from, 0.2), 1.0);
        let step = wide.cast::<E>();
        let all: Vec<(String, DVec3)> = places(&triangles, &from).into_iter().map(|(n, p)| (n, round(p))).collect();
        let points: Vec<[E; 3]> = all.iter().map(|(_, p)| p.to_array().map(<E as Real>::of)).collect();
        let swept = step.evaluate_all(lanes, &points);
        let mut plain = points.clone();
        step.map_all(lanes, &mut plain);
        for (((place, p), e), alone) in all.iter().zip(&swept).zip(&plain) {
            let truth = wide.evaluate(local(*p));
            for k in 0..3 {
                let off = (double(e.point[k]) - truth.point[k]).abs().max((double(alone[k]) - truth.point[k]).abs());
                assert!(off < 1e-5, "{name}, {place} at {p}: {off:e}");
                map = map.max(off);
            }
            // Within single precision's idea of an edge derivatives are one-sided on a side of
            // rounding's choice.
            if to_edges(&triangles, &vertices, *p) > 1e-3 {
                let off = (double(e.jacobian) - truth.jacobian).abs();
                jacobian = jacobian.max(off);
            }
        }
    }
    (map, jacobian)
}

#[test]
fn single_precision_and_lanes_agree_with_double() {
    for lanes in [Lanes::scalar(), Lanes::detect()] {
        let (map, jacobian) = difference::<f32>(lanes);
        assert!(map < 2e-6 && jacobian < 2e-4, "{}: {map:e} {jacobian:e}", lanes.name());
        let (map, jacobian) = difference::<f64>(lanes);
        assert!(map < 1e-11 && jacobian < 1e-9, "{}: {map:e} {jacobian:e}", lanes.name());
    }
}

#[test]
fn turning_all_faces_over_changes_nothing() {
    let (triangles, vertices) = dented();
    let to = moved(&vertices, 0.2);
    let over: Vec<[u32; 3]> = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
    let (one, other) = (Step::new(&triangles, &vertices, &to, 1.0), Step::new(&over, &vertices, &to, 1.0));
    for p in [DVec3::new(0.03, 0.02, -0.01), DVec3::new(0.9, 0.7, -0.8)] {
        let (a, b) = (one.evaluate(local(p)), other.evaluate(local(p)));
        assert!(DVec3::from(a.point).distance(b.point.into()) < 1e-13 && (a.jacobian - b.jacobian).abs() < 1e-11);
    }
}
