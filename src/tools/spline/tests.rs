use std::f64::consts::TAU;

use super::*;
use crate::geometry::ClosestPoints;
use crate::models::shapes::{icosphere, lobed_sphere, torus};
use crate::surface::{Embedding, EmbeddingOptions};

struct Model {
    mesh: Mesh,
    topology: Topology,
    embedding: Embedding,
}

impl Model {
    fn new(mesh: Mesh) -> Self {
        let topology = Topology::new(&mesh);
        let options = EmbeddingOptions { landmarks: 150, ..EmbeddingOptions::default() };
        let embedding = Embedding::compute(&mesh, &topology, &options, &crate::progress::Quiet).unwrap();
        Self { mesh, topology, embedding }
    }

    fn shape(&self) -> Shape<'_> {
        Shape { mesh: &self.mesh, topology: &self.topology, embedding: Some(&self.embedding) }
    }

    fn nearest(&self, points: &[DVec3]) -> Vec<SurfacePoint> {
        let closest = ClosestPoints::new(&self.mesh, &self.topology);
        points.iter().map(|p| closest.nearest(*p).unwrap().0).collect()
    }

    /// Points around the equator of a sphere of radius 1, at an angle of `tilt` up and down.
    fn around(&self, count: usize, tilt: f64) -> Vec<SurfacePoint> {
        let at = |i: usize| {
            let a = TAU * i as f64 / count as f64;
            let z = if i.is_multiple_of(2) { tilt } else { -tilt };
            DVec3::new(a.cos() * z.cos(), z.sin(), a.sin() * z.cos())
        };
        self.nearest(&(0..count).map(at).collect::<Vec<_>>())
    }
}

/// Every segment lies in a triangle, every point on the surface, parameters rise.
#[track_caller]
fn is_cut_at_edges(model: &Model, curve: &SurfaceCurve) {
    for run in &curve.runs {
        for pair in run.windows(2) {
            assert!(pair[0].parameter <= pair[1].parameter);
            let corners = |p: &CurvePoint| -> Vec<u32> {
                let v = model.mesh.triangle(p.point.face as usize);
                (0..3).filter(|&k| p.point.barycentric[k] != 0.0).map(|k| v[k]).collect()
            };
            let mut all = corners(&pair[0]);
            all.extend(corners(&pair[1]));
            all.sort_unstable();
            all.dedup();
            let shared = model.topology.vertex_triangles(all[0]).iter().any(|&t| {
                let v = model.topology.triangles[t as usize];
                all.iter().all(|w| v.contains(w))
            });
            assert!(shared, "{pair:?}");
        }
        for p in run {
            assert!(p.point.is_valid(&model.mesh, 0.0) && p.position == p.point.position(&model.mesh));
        }
    }
}

#[test]
fn within_a_face_the_curve_is_planar_to_rounding() {
    let model = Model::new(lobed_sphere(2, 0.3));
    let surface = SplineSurface::new(model.shape()).unwrap();
    let t = 37;
    // The third control point lies on an edge and is named by the triangle across it, the last is a
    // vertex.
    let mut controls = vec![
        SurfacePoint::new(t, [0.8, 0.1, 0.1]),
        SurfacePoint::new(t, [0.05, 0.9, 0.05]),
        SurfacePoint::new(t, [0.0, 0.5, 0.5]),
        SurfacePoint::new(t, [0.0, 0.0, 1.0]),
    ];
    let expected: Vec<DVec3> = controls.iter().map(|p| p.position(&model.mesh)).collect();
    let across = model.topology.neighbours[t as usize][0];
    let v = model.topology.triangles[t as usize];
    let x = model.topology.triangles[across as usize].map(|w| if w == v[1] || w == v[2] { 0.5 } else { 0.0 });
    controls[2] = SurfacePoint::new(across, x);
    let bezier = |s: f64| {
        let r = 1.0 - s;
        let w = [r * r * r, 3.0 * r * r * s, 3.0 * r * s * s, s * s * s];
        expected.iter().zip(w).fold(DVec3::ZERO, |sum, (p, w)| sum + *p * w)
    };
    for (kind, evaluation) in [SplineKind::BSpline, SplineKind::Bezier]
        .into_iter()
        .flat_map(|k| [(k, Evaluation::Direct), (k, Evaluation::Subdivision)])
    {
        let options = SplineOptions { kind, evaluation, ..SplineOptions::default() };
        let parameters: Vec<f64> = (0..=1000).map(|i| f64::from(i) / 1000.0).collect();
        for p in surface.points(&controls, &options, &parameters).unwrap() {
            assert!(p.position.distance(bezier(p.parameter)) < 1e-14, "{p:?}");
            assert_eq!(p.origin, Origin::Planar);
        }
        let traced = surface.trace(&controls, &options).unwrap();
        assert!(traced.jumps.is_empty() && traced.points().all(|p| p.position.distance(bezier(p.parameter)) < 1e-14));
    }
}

#[test]
fn closed_curves_are_closed_and_all_curves_are_cut_at_edges() {
    let model = Model::new(icosphere(1.0, 4));
    let surface = SplineSurface::new(model.shape()).unwrap();
    let controls = model.around(12, 0.3);
    for (kind, degree, closed, evaluation) in (1..=5)
        .flat_map(|d| {
            [false, true].into_iter().flat_map(move |c| {
                [Evaluation::Direct, Evaluation::Subdivision].map(|e| (SplineKind::BSpline, d, c, e))
            })
        })
        .chain([
            (SplineKind::Bezier, 3, true, Evaluation::Direct),
            (SplineKind::Bezier, 3, true, Evaluation::Subdivision),
        ])
    {
        let options = SplineOptions { kind, degree, closed, evaluation, ..SplineOptions::default() };
        let curve = surface.trace(&controls, &options).unwrap();
        assert!(curve.jumps.is_empty(), "{options:?}: {:?}", curve.jumps);
        is_cut_at_edges(&model, &curve);
        let points = &curve.runs[0];
        let (first, last) = (points[0], points[points.len() - 1]);
        assert_eq!((first.parameter, last.parameter, curve.closed), (0.0, 1.0, closed));
        if closed {
            assert_eq!((first.point, first.position), (last.point, last.position));
        } else {
            assert!(first.position.distance(controls[0].position(&model.mesh)) < 1e-9);
            assert!(last.position.distance(controls[11].position(&model.mesh)) < 1e-9);
        }
        // The control points go round the equator in whole, so do the curves, and none is longer
        // than the polygon.
        assert!((0.8 * TAU..9.6).contains(&curve.length()), "{options:?}: {}", curve.length());
        // Where curves cross an edge they agree with a dense evaluation.
        let parameters: Vec<f64> = points.iter().map(|p| p.parameter).collect();
        for (a, b) in surface.points(&controls, &options, &parameters).unwrap().iter().zip(points) {
            assert!(a.position.distance(b.position) < 1e-7, "{options:?} {a:?} {b:?}");
        }
    }
}

#[test]
fn polylines_are_as_near_as_asked_for_and_do_not_depend_on_threads() {
    let model = Model::new(torus(1.0, 0.4, 40, 24, crate::models::shapes::Diagonal::Alternating));
    let surface = SplineSurface::new(model.shape()).unwrap();
    let at = |i: usize| {
        let a = TAU * i as f64 / 8.0;
        let b = 2.0 * a;
        DVec3::new((1.0 + 0.4 * b.cos()) * a.cos(), (1.0 + 0.4 * b.cos()) * a.sin(), 0.4 * b.sin())
    };
    let controls = model.nearest(&(0..8).map(at).collect::<Vec<_>>());
    let diagonal = surface.diagonal;
    let mut counts = Vec::new();
    for tolerance in [1e-3, 1e-5, 1e-7] {
        let options = SplineOptions { tolerance, closed: true, ..SplineOptions::default() };
        let curve = surface.trace(&controls, &options).unwrap();
        is_cut_at_edges(&model, &curve);
        let run = &curve.runs[0];
        let dense: Vec<f64> = (0..=5000).map(|i| f64::from(i) / 5000.0).collect();
        let mut k = 0;
        for p in surface.points(&controls, &options, &dense).unwrap() {
            while run[k + 1].parameter < p.parameter {
                k += 1;
            }
            let (a, b) = (run[k].position, run[k + 1].position);
            let w = ((p.position - a).dot(b - a) / (b - a).length_squared().max(1e-300)).clamp(0.0, 1.0);
            assert!(p.position.distance(a + w * (b - a)) < 1.5 * tolerance * diagonal + 1e-12, "{tolerance} {p:?}");
        }
        counts.push(run.len());
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        assert_eq!(pool.install(|| surface.trace(&controls, &options).unwrap()), curve);
    }
    assert!(counts[0] < counts[1] && counts[1] < counts[2], "{counts:?}");
}

#[test]
fn the_two_evaluations_agree_where_control_points_are_near_and_not_where_they_are_far() {
    let model = Model::new(icosphere(1.0, 4));
    let surface = SplineSurface::new(model.shape()).unwrap();
    let options = SplineOptions { closed: true, ..SplineOptions::default() };
    let many = surface.compare(&model.around(48, 0.2), &options).unwrap();
    let few = surface.compare(&model.around(6, 0.8), &options).unwrap();
    assert!(many.distance < 0.01 && many.intervals.is_empty(), "{many:?}");
    assert!(few.distance > 3.0 * many.distance && (0.0..=1.0).contains(&few.parameter), "{few:?}");
    assert!(few.mean < few.distance);
    // What is told is what the points show.
    let at = |e| {
        surface.points(&model.around(6, 0.8), &SplineOptions { evaluation: e, ..options }, &[few.parameter]).unwrap()[0]
    };
    let distance = at(Evaluation::Direct).position.distance(at(Evaluation::Subdivision).position);
    assert!((distance - few.distance).abs() < 1e-9, "{distance} {few:?}");
}

#[test]
fn a_curve_is_as_long_far_from_the_origin() {
    // Coordinates in steps of 2^-20, so that a shift by 2^24 is exact.
    let grid = f64::from(1 << 20);
    let mut mesh = lobed_sphere(3, 0.3);
    mesh.positions.iter_mut().for_each(|p| *p = (*p * grid).round() / grid);
    let near = Model::new(mesh);
    let mut mesh = near.mesh.clone();
    mesh.positions.iter_mut().for_each(|p| *p += f64::from(1 << 24));
    let far = Model::new(mesh);
    let controls = near.around(5, 0.9);
    let options = SplineOptions { closed: true, ..SplineOptions::default() };
    let [a, b] = [&near, &far].map(|m| SplineSurface::new(m.shape()).unwrap().trace(&controls, &options).unwrap());
    assert_eq!(a.length(), b.length());
    // The places themselves are rounded there.
    let chords = |c: &SurfaceCurve| -> f64 {
        c.runs.iter().flat_map(|r| r.windows(2)).map(|w| w[0].position.distance(w[1].position)).sum()
    };
    assert!((chords(&a) - a.length()).abs() < 1e-12 * a.length(), "{} {}", chords(&a), a.length());
    assert!((chords(&b) - b.length()).abs() > 1e-10 * a.length(), "{} {}", chords(&b), b.length());
}

#[test]
fn bad_input_is_named() {
    let model = Model::new(lobed_sphere(2, 0.3));
    let surface = SplineSurface::new(model.shape()).unwrap();
    let p = |f| SurfacePoint::new(f, [0.2, 0.3, 0.5]);
    let good = [p(0), p(5), p(9), p(14), p(20)];
    let d = SplineOptions::default();
    let nan = SurfacePoint::new(3, [f64::NAN, 0.5, 0.5]);
    for (controls, options, expected) in [
        (&good[..3], d, "4 control points or more, there are 3"),
        (&[][..], d, "there are 0"),
        (&[][..], SplineOptions { closed: true, ..d }, "there are 0"),
        (&good[..2], SplineOptions { closed: true, ..d }, "3 control points or more"),
        (&good, SplineOptions { degree: 6, ..d }, "6 is not 1 to 5"),
        (&good, SplineOptions { kind: SplineKind::Bezier, degree: 3, ..d }, "3 k + 1 control points, there are 5"),
        (&good, SplineOptions { tolerance: 0.0, ..d }, "option tolerance"),
        (&good, SplineOptions { tolerance: f64::NAN, ..d }, "option tolerance"),
        (&good, SplineOptions { samples: usize::MAX, ..d }, "option samples"),
        (&[p(0), p(1), nan, p(2)], d, "control point 2"),
        (&[p(0), p(1), p(2), p(1 << 20)], d, "control point 3"),
    ] {
        let message = surface.trace(controls, &options).unwrap_err().to_string();
        assert!(message.contains(expected), "{message:?} lacks {expected:?}");
    }
    assert!(surface.points(&good, &d, &[0.5, 1.5]).unwrap_err().to_string().contains("1.5"));
    // A curve that would take more memory than there is.
    let long: Vec<SurfacePoint> = (0..200_000).map(|i| p(i * 7919 % 320)).collect();
    let message = surface.trace(&long, &SplineOptions { tolerance: 1e-9, ..d }).unwrap_err().to_string();
    assert!(message.contains("fewer control points"), "{message}");
    // All control points the same: a curve of no length, not a fault.
    let still = surface.trace(&[p(7); 5], &d).unwrap();
    assert!(still.length() < 1e-12 && still.jumps.is_empty());
}
