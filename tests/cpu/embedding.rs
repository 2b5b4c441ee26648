//! The embedding as a whole, on built and on real meshes.

use barymap::error::Error;
use barymap::geometry::{Geodesics, March, Mesh, Topology};
use barymap::progress::Quiet;
use barymap::surface::{Embedding, EmbeddingOptions, Sampling};
use glam::DVec3;

use crate::common::load;

fn embed(mesh: &Mesh, options: &EmbeddingOptions) -> Embedding {
    Embedding::compute(mesh, &Topology::new(mesh), options, &Quiet).unwrap()
}

fn few() -> EmbeddingOptions {
    EmbeddingOptions { landmarks: 120, ..EmbeddingOptions::default() }
}

fn distance(e: &Embedding, a: usize, b: usize) -> f64 {
    e.point(a).iter().zip(e.point(b)).map(|(x, y)| (x - y) * (x - y)).sum::<f64>().sqrt()
}

/// A torus around the z axis, moved by `offset`.
fn torus(n: u32, m: u32, thickness: f64, offset: DVec3) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let turn = |i: u32, n: u32| f64::from(i) / f64::from(n) * std::f64::consts::TAU;
    let p = (0..n * m)
        .map(|k| {
            let (u, v) = (turn(k / m, n), turn(k % m, m));
            let r = 1.0 + thickness * v.cos();
            DVec3::new(r * u.cos(), r * u.sin(), thickness * v.sin()) + offset
        })
        .collect();
    let at = |i: u32, j: u32| i % n * m + j % m;
    let t = (0..n * m)
        .map(|k| (k / m, k % m))
        .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]])
        .collect();
    (p, t)
}

fn one_torus() -> Mesh {
    let (p, t) = torus(40, 16, 0.4, DVec3::ZERO);
    Mesh::from_triangles("torus", p, &t).unwrap()
}

/// Root of the mean squared relative error against fast marching, from a few vertices to all
/// farther than `least`.
fn relative_error(mesh: &Mesh, e: &Embedding, least: f64) -> f64 {
    let topology = Topology::new(mesh);
    let usable: Vec<[u32; 3]> =
        (0..mesh.triangle_count()).filter(|&t| topology.usable[t]).map(|t| mesh.triangle(t)).collect();
    let geodesics = Geodesics::new(&mesh.positions, &usable).unwrap();
    let mut march = March::default();
    let (mut sum, mut count) = (0.0, 0);
    for k in 0..12 {
        let source = k * mesh.vertex_count() / 12;
        geodesics.distances_from(source as u32, &mut march);
        for (v, &q) in march.distances.iter().enumerate().filter(|(_, q)| q.is_finite() && **q > least) {
            sum += (distance(e, v, source) / q - 1.0).powi(2);
            count += 1;
        }
    }
    (sum / f64::from(count)).sqrt()
}

#[test]
fn a_flat_sheet_is_embedded_without_distortion() {
    // A bent but developable sheet: geodesics are straight when it is unrolled.
    let n = 30u32;
    let p: Vec<DVec3> = (0..=n)
        .flat_map(|i| {
            (0..=n).map(move |j| {
                let (u, v) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
                DVec3::new(u.sin(), 1.0 - u.cos(), v)
            })
        })
        .collect();
    let at = |i, j| i * (n + 1) + j;
    let t: Vec<[u32; 3]> = (0..n * n)
        .map(|k| (k / n, k % n))
        .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]])
        .collect();
    let mesh = Mesh::from_triangles("sheet", p, &t).unwrap();
    let e = embed(&mesh, &few());
    assert!(e.relative_error() < 1e-3, "{}", e.relative_error());
    let chord = |a: u32, b: u32| {
        let (du, dv) = ((a / (n + 1)).abs_diff(b / (n + 1)), (a % (n + 1)).abs_diff(b % (n + 1)));
        f64::from(du).hypot(f64::from(dv)) / f64::from(n)
    };
    for (a, b) in [(0, 960), (30, 930), (5, 700), (480, 481), (0, 1), (930, 960), (29, 60)] {
        assert!((distance(&e, a as usize, b as usize) / chord(a, b) - 1.0).abs() < 0.02, "{a} {b}");
    }
}

#[test]
fn scales_with_the_mesh() {
    let mesh = one_torus();
    let e = embed(&mesh, &few());
    for scale in [1e-3, 1e3, 1e-60] {
        let mut scaled = mesh.clone();
        scaled.positions.iter_mut().for_each(|p| *p *= scale);
        let s = embed(&scaled, &few());
        assert_eq!(s.landmarks, e.landmarks);
        assert!((s.stress / e.stress - 1.0).abs() < 1e-6);
        // Up to a motion of R^8: distances scale.
        for (a, b) in [(0, 1), (5, 300), (17, 600), (100, 420)] {
            assert!((distance(&s, a, b) / scale / distance(&e, a, b) - 1.0).abs() < 1e-4, "scale {scale}");
        }
    }
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let (p, t) = torus(80, 40, 0.4, DVec3::ZERO);
    let mesh = Mesh::from_triangles("torus", p, &t).unwrap();
    let options = EmbeddingOptions { mid_level: 900, ..few() };
    let bytes = [1, 2, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| embed(&mesh, &options)).to_bytes()
    });
    assert!(bytes[0] == bytes[1] && bytes[0] == bytes[2]);
}

#[test]
fn the_mid_level_mesh_costs_little_accuracy() {
    let (p, t) = torus(120, 60, 0.4, DVec3::ZERO);
    let mesh = Mesh::from_triangles("torus", p, &t).unwrap();
    let exact = embed(&mesh, &EmbeddingOptions { mid_level: usize::MAX / 8, ..few() });
    let quick = embed(&mesh, &EmbeddingOptions { mid_level: 1500, ..few() });
    let (a, b) = (relative_error(&mesh, &exact, 0.1), relative_error(&mesh, &quick, 0.1));
    assert!((a - b).abs() < 0.01 && a < 0.1, "{a} {b}");
}

#[test]
fn components_are_apart_and_each_as_if_alone() {
    let (mut p, mut t) = torus(40, 16, 0.4, DVec3::ZERO);
    let alone = Mesh::from_triangles("one", p.clone(), &t).unwrap();
    let first = p.len();
    let (q, s) = torus(20, 8, 0.3, DVec3::new(0.5, 0.0, 0.0));
    p.extend(q.iter().map(|x| *x * 0.3));
    t.extend(s.iter().map(|t| t.map(|v| v + first as u32)));
    // A single triangle, and a vertex that nothing uses.
    let second = p.len();
    p.extend([DVec3::ZERO, DVec3::X * 0.01, DVec3::Y * 0.01, DVec3::Z]);
    t.push([second as u32, second as u32 + 1, second as u32 + 2]);
    let mesh = Mesh::from_triangles("three", p, &t).unwrap();
    let e = embed(&mesh, &few());
    assert_eq!(e.warnings.len(), 2, "{:?}", e.warnings);
    assert!(e.warnings[0].contains("3 components") && e.warnings[1].contains("1 vert"));
    assert!(e.point(second + 3).iter().all(|x| x.is_nan()));
    let within = (0..first).map(|v| distance(&e, 0, v)).fold(0.0, f64::max);
    let between = (0..first).flat_map(|a| (first..second + 3).map(move |b| (a, b)));
    assert!(between.map(|(a, b)| distance(&e, a, b)).fold(f64::INFINITY, f64::min) > within);
    let single = embed(&alone, &few());
    assert!((relative_error(&alone, &e, 0.1) - relative_error(&alone, &single, 0.1)).abs() < 0.01);
    // The triangle keeps its shape.
    let (a, b) = (distance(&e, second, second + 1), distance(&e, second + 1, second + 2));
    assert!((a / 0.01 - 1.0).abs() < 1e-6 && (b / 0.01f64.hypot(0.01) - 1.0).abs() < 1e-6, "{a} {b}");
}

#[test]
fn thousands_of_components_stay_cheap_and_apart() {
    let n = 3000u32;
    let p: Vec<DVec3> = (0..3 * n)
        .map(|k| {
            let base = DVec3::new(f64::from(k / 3), f64::from(k / 3 % 7), 0.0);
            base + [DVec3::ZERO, DVec3::X * 0.5, DVec3::Y * 0.5][(k % 3) as usize]
        })
        .collect();
    let t: Vec<[u32; 3]> = (0..n).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    let mesh = Mesh::from_triangles("confetti", p, &t).unwrap();
    let e = embed(&mesh, &EmbeddingOptions::default());
    assert!(e.warnings[0].contains("3000 components") && e.warnings[0].contains("more"));
    assert!(e.stress < 1e-20);
    for (a, b) in [(0, 3), (0, 8999), (4500, 4503), (10, 2000)] {
        assert!(distance(&e, a, b) > 0.75, "{a} {b}");
    }
}

#[test]
fn all_dimensions_and_both_samplings() {
    let mesh = one_torus();
    let mut last = f64::INFINITY;
    for dimension in [4, 8, 12, 16] {
        let e = embed(&mesh, &EmbeddingOptions { dimension, ..few() });
        assert_eq!((e.dimension, e.points.len()), (dimension, dimension * mesh.vertex_count()));
        assert!(e.stress <= last * 1.01, "more dimensions cannot make it worse");
        last = e.stress;
    }
    let e = embed(&mesh, &EmbeddingOptions { sampling: Sampling::Decimation, ..few() });
    assert_eq!(e.landmarks.len(), 120);
    assert!(e.relative_error() < 0.1);
}

#[test]
fn bad_input_is_named() {
    let mesh = one_torus();
    let topology = Topology::new(&mesh);
    let compute = |m: &Mesh, t: &Topology, o: EmbeddingOptions| Embedding::compute(m, t, &o, &Quiet).unwrap_err();
    for o in [
        EmbeddingOptions { landmarks: 3, ..few() },
        EmbeddingOptions { landmarks: usize::MAX, ..few() },
        EmbeddingOptions { dimension: 7, ..few() },
        EmbeddingOptions { tolerance: f64::NAN, ..few() },
    ] {
        assert!(matches!(compute(&mesh, &topology, o), Error::Option { .. }));
    }
    let flat = Mesh::from_triangles("line", vec![DVec3::ZERO, DVec3::X, DVec3::X * 2.0], &[[0, 1, 2]]).unwrap();
    assert!(matches!(compute(&flat, &Topology::new(&flat), few()), Error::Mesh { .. }));
    let none = Mesh::from_triangles("none", vec![], &[]).unwrap();
    assert!(matches!(compute(&none, &Topology::new(&none), few()), Error::Mesh { .. }));
    assert!(matches!(compute(&mesh, &Topology::new(&flat), few()), Error::Mesh { .. }));
}

#[test]
fn damaged_meshes_do_not_panic() {
    let mesh = one_torus();
    let spoil: [fn(&mut Vec<DVec3>); 5] = [
        |p| p[7].x = f64::NAN,
        |p| p[9].y = f64::INFINITY,
        |p| (0..200).for_each(|i| p[i] = p[0]),
        |p| p.iter_mut().for_each(|x| x.z *= 1e-14),
        |p| p[3] *= 1e9,
    ];
    for change in spoil {
        let mut damaged = mesh.clone();
        change(&mut damaged.positions);
        let topology = Topology::new(&damaged);
        if let Ok(e) = Embedding::compute(&damaged, &topology, &few(), &Quiet) {
            for v in 0..damaged.vertex_count() {
                let used = topology.vertex_component[v] != barymap::geometry::NONE;
                assert!(e.point(v).iter().all(|x| x.is_finite() == used));
            }
        }
    }
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn real_meshes_of_any_genus_and_with_boundary() {
    for (file, bound) in
        [("mesh/3holes_7k.obj", 0.08), ("mesh/alligator_6k.obj", 0.08), ("mesh/fertility_9k.obj", 0.12)]
    {
        let mesh = load(file);
        let e = embed(&mesh, &EmbeddingOptions { landmarks: 400, ..EmbeddingOptions::default() });
        assert!(e.relative_error() < bound, "{file}: {}", e.relative_error());
        let least = 0.1 * mesh.area().sqrt();
        assert!(relative_error(&mesh, &e, least) < 1.5 * bound, "{file}: {}", relative_error(&mesh, &e, least));
        assert!(e.warnings.is_empty(), "{:?}", e.warnings);
    }
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn human_models_reach_the_stress_of_the_paper() {
    let mesh = load("textured/human_male/human_male.obj");
    let e = embed(&mesh, &EmbeddingOptions::default());
    assert!(e.relative_error() < 0.07, "{}", e.relative_error());
}
