//! Tests of what the paper proves about Phong projection and its interpolated planes (section 3.2),
//! on surfaces that bend in R^8.

use super::PhongSurface;
use super::average::orthonormalise;
use super::project::{Found, SearchLimits};
use super::psi::{Root, slack};
use super::vector::{Vector, add_scaled, combine, distance_squared, dot};
use crate::engine::Real;
use crate::geometry::{Mesh, NONE, Topology};
use crate::models::shapes::{Diagonal, Random, irregular_plane, lobed_sphere, plane_grid, tube};

/// A mesh lifted smoothly to R^8: space in the first three coordinates, quadratic bumps in the
/// others.
pub(super) fn lift(mesh: &Mesh) -> Vec<f64> {
    mesh.positions
        .iter()
        .flat_map(|p| {
            [
                p.x,
                p.y,
                p.z,
                0.4 * p.x * p.y,
                0.4 * p.y * p.z,
                0.3 * p.z * p.x,
                0.3 * (p.x * p.x - p.y * p.y),
                0.2 * p.z * p.z,
            ]
        })
        .collect()
}

fn surface(mesh: &Mesh) -> PhongSurface<f64, 8> {
    PhongSurface::new(&Topology::new(mesh), &lift(mesh)).unwrap()
}

fn flat(mesh: &Mesh) -> PhongSurface<f64, 8> {
    let points: Vec<f64> = mesh.positions.iter().flat_map(|p| [p.x, p.y, p.z, 0.0, 0.0, 0.0, 0.0, 0.0]).collect();
    PhongSurface::new(&Topology::new(mesh), &points).unwrap()
}

fn barycentric(rng: &mut Random) -> [f64; 3] {
    let (a, b) = (rng.unit(), rng.unit());
    if a + b > 1.0 { [1.0 - a, 1.0 - b, a + b - 1.0] } else { [a, b, 1.0 - a - b] }
}

/// `rows` spans the plane of the orthonormal `basis`: nothing is left after projecting each row
/// onto it.
fn same_plane(rows: &[Vector<f64, 8>; 2], basis: &[Vector<f64, 8>; 2], tolerance: f64) -> bool {
    orthonormalise(*rows).iter().all(|r| {
        let rest = add_scaled(&add_scaled(r, -dot(r, &basis[0]), &basis[0]), -dot(r, &basis[1]), &basis[1]);
        dot(&rest, &rest).sqrt() < tolerance
    })
}

#[test]
fn property_1_points_of_the_surface_are_their_own_projections() {
    let s = surface(&lobed_sphere(3, 0.3));
    let mut rng = Random::new(1);
    for _ in 0..500 {
        let t = (rng.unit() * s.triangles.len() as f64) as u32;
        let x = barycentric(&mut rng);
        let y = s.triangle(t).point(&x);
        let p = s.project(&y, &[s.triangles[t as usize].v[0]], SearchLimits::FIRST);
        assert_ne!(p.found, Found::Nothing);
        assert!(p.distance_squared.sqrt() < 1e-10, "{t} {x:?} {p:?}");
    }
}

#[test]
fn property_2_on_a_plane_it_is_the_euclidean_projection() {
    let mesh = irregular_plane(9, 7, 3.0, 2.0, Diagonal::Alternating, 0.3, 5);
    let s = flat(&mesh);
    let mut rng = Random::new(2);
    for _ in 0..300 {
        let t = (rng.unit() * s.triangles.len() as f64) as u32;
        let y = s.triangle(t).point(&barycentric(&mut rng));
        let normal: Vector<f64, 8> = std::array::from_fn(|i| if i < 2 { 0.0 } else { 3.0 * rng.signed() });
        let p = s.project(&add_scaled(&y, 1.0, &normal), &[0], SearchLimits::SECOND);
        let image = s.triangle(p.face).point(&p.x);
        assert!(distance_squared(&image, &y).sqrt() < 1e-9, "{p:?}");
    }
}

#[test]
fn property_3_a_vertex_seen_along_its_normal_space_is_a_projection() {
    let s = surface(&lobed_sphere(3, 0.3));
    let mut rng = Random::new(3);
    for v in (0..s.vertices.len()).step_by(7) {
        let vertex = &s.vertices[v];
        let mut d: Vector<f64, 8> = std::array::from_fn(|_| rng.signed());
        for t in &vertex.t {
            d = add_scaled(&d, -dot(&d, t), t);
        }
        // Within the radius of curvature, so that the projection is the nearest one too.
        let mean = add_scaled(&vertex.y, 0.3, &d);
        let p = s.project(&mean, &[v as u32], SearchLimits::FIRST);
        let image = s.triangle(p.face).point(&p.x);
        assert!(distance_squared(&image, &vertex.y).sqrt() < 1e-8, "vertex {v}: {p:?}");
    }
}

#[test]
fn property_4_planes_and_projections_agree_across_edges() {
    let s = surface(&lobed_sphere(2, 0.4));
    let mut rng = Random::new(4);
    for t in 0..s.triangles.len() as u32 {
        for k in 0..3 {
            let other = s.triangles[t as usize].neighbours[k];
            assert_ne!(other, NONE);
            let u = rng.unit();
            let mut x = [0.0; 3];
            x[(k + 1) % 3] = u;
            x[(k + 2) % 3] = 1.0 - u;
            let v = s.triangles[t as usize].v;
            let mirrored = s.triangles[other as usize].v.map(|w| v.iter().position(|&a| a == w).map_or(0.0, |i| x[i]));
            let basis = orthonormalise(s.triangle(t).psi(&x));
            assert!(same_plane(&s.triangle(other).psi(&mirrored), &basis, 1e-9), "triangle {t}, edge {k}, {u}");
            // A point that projects onto the edge from one side does so from the other.
            let mut d: Vector<f64, 8> = std::array::from_fn(|_| 0.3 * rng.signed());
            for b in &basis {
                d = add_scaled(&d, -dot(&d, b), b);
            }
            let mean = add_scaled(&s.triangle(t).point(&x), 1.0, &d);
            for (t, x) in [(t, x), (other, mirrored)] {
                let f = s.triangle(t).residual(&mean, &x);
                assert!(f[0].abs().max(f[1].abs()) < 1e-9, "{f:?}");
            }
        }
    }
}

#[test]
fn planes_at_vertices_are_the_vertices_own() {
    let s = surface(&lobed_sphere(2, 0.4));
    for t in 0..s.triangles.len() as u32 {
        for k in 0..3 {
            let mut x = [0.0; 3];
            x[k] = 1.0;
            let own = s.vertices[s.triangles[t as usize].v[k] as usize].t;
            assert!(same_plane(&s.triangle(t).psi(&x), &own, 1e-9));
            // And the approach is continuous from any direction.
            let x = [0, 1, 2].map(|i| {
                if i == k {
                    1.0 - 3e-7
                } else if i == (k + 1) % 3 {
                    1e-7
                } else {
                    2e-7
                }
            });
            assert!(same_plane(&s.triangle(t).psi(&x), &own, 1e-5));
        }
    }
}

#[test]
fn every_vertex_is_found_from_every_triangle_around_it() {
    // Newton's method comes to a vertex from any side, also from beyond it, where Psi is not
    // defined.
    for mesh in [lobed_sphere(3, 0.4), irregular_plane(12, 12, 1.0, 1.0, Diagonal::Alternating, 0.45, 3)] {
        let s = surface(&mesh);
        let single = s.cast::<f32>();
        for v in 0..s.vertices.len() as u32 {
            for &t in s.fan(v) {
                let y = s.vertices[v as usize].y;
                let root = s.triangle(t).project(&y, 2.0);
                assert!(matches!(root, Root::Inside(x) if x.iter().any(|&x| x > 1.0 - 1e-12)), "{v} {t} {root:?}");
                let y = single.vertices[v as usize].y;
                let root = single.triangle(t).project(&y, 2.0);
                assert!(matches!(root, Root::Inside(x) if x.iter().any(|&x| x > 0.9995)), "single {v} {t} {root:?}");
            }
        }
    }
}

/// Roots at small distances from a vertex or an edge are found from the triangle they lie in, off
/// the surface too.
fn roots_found_next_to_borders<S: Real>(s: &PhongSurface<f64, 8>, tolerance: f64) {
    let rounded: PhongSurface<S, 8> = s.cast();
    let mut rng = Random::new(13);
    for height in [0.0, 0.3, 1.0, 3.0] {
        for distance in [0.0, 1e-12, 1e-10, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1] {
            for i in 0..200 {
                let t = (rng.unit() * s.triangles.len() as f64) as u32;
                let (k, u) = (i % 3, rng.unit());
                let (near, beyond) = if i % 2 == 0 { (1.0 - distance, distance) } else { (distance, 1.0 - distance) };
                let mut x = [near; 3];
                x[(k + 1) % 3] = beyond * u;
                x[(k + 2) % 3] = beyond * (1.0 - u);
                let tri = s.triangle(t);
                let mut d: Vector<f64, 8> = std::array::from_fn(|_| rng.signed());
                for b in &orthonormalise(tri.psi(&x)) {
                    d = add_scaled(&d, -dot(&d, b), b);
                }
                let y = tri.point(&x);
                let mean = add_scaled(&y, height / dot(&d, &d).sqrt(), &d);
                match rounded.triangle(t).project(&mean.map(S::of), S::of(2.0)) {
                    Root::Inside(r) => {
                        let off = distance_squared(&tri.point(&r.map(|r| r.to_f64())), &y).sqrt();
                        assert!(off < tolerance, "triangle {t}, {height}, {distance:.0e}: {x:?} {r:?} {off:.1e}");
                    }
                    Root::Outside(r) => {
                        panic!("triangle {t}, {height}, {distance:.0e}: {x:?} not found, ended at {r:?}")
                    }
                }
            }
        }
    }
}

#[test]
fn roots_next_to_vertices_and_edges_are_found() {
    // A gentle surface, where three edges are well within the radius of curvature. The vertex
    // itself stands for roots within the slack of it.
    let s = surface(&lobed_sphere(4, 0.3));
    roots_found_next_to_borders::<f64>(&s, 2.0 * slack::<f64>());
    roots_found_next_to_borders::<f32>(&s, 2.0 * f64::from(slack::<f32>()));
}

/// Turns or mirrors every vertex basis within its plane.
fn other_gauge(mesh: &Mesh, s: &PhongSurface<f64, 8>) -> PhongSurface<f64, 8> {
    let mut other = s.clone();
    let mut rng = Random::new(9);
    for v in &mut other.vertices {
        let (sin, cos) = (6.3 * rng.unit()).sin_cos();
        let f = if rng.unit() < 0.5 { 1.0 } else { -1.0 };
        let [a, b] = v.t;
        v.t = [combine(&[cos, sin, 0.0], [&a, &b, &a]), combine(&[-f * sin, f * cos, 0.0], [&a, &b, &a])];
    }
    for (t, triangle) in other.triangles.iter_mut().enumerate() {
        let v = mesh.triangle(t);
        triangle.gauge = super::gauge::gauge([0, 1, 2].map(|k| &other.vertices[v[k] as usize].t));
    }
    other
}

#[test]
fn nothing_depends_on_the_bases_chosen_for_the_planes() {
    let mesh = lobed_sphere(2, 0.4);
    let s = surface(&mesh);
    let other = other_gauge(&mesh, &s);
    let mut rng = Random::new(6);
    for t in 0..s.triangles.len() as u32 {
        let x = barycentric(&mut rng);
        let basis = orthonormalise(s.triangle(t).psi(&x));
        assert!(same_plane(&other.triangle(t).psi(&x), &basis, 1e-9), "triangle {t}");
    }
    // The comparison can fail: the plane of another triangle is another plane.
    let basis = orthonormalise(s.triangle(0).psi(&[0.3, 0.3, 0.4]));
    assert!(!same_plane(&s.triangle(200).psi(&[0.3, 0.3, 0.4]), &basis, 1e-3));
}

#[test]
fn the_jacobian_is_the_derivative() {
    // Newton's method converges quadratically only with the true Jacobian: from 1/3 each, four
    // steps reach rounding.
    let s = surface(&lobed_sphere(3, 0.3));
    let mut rng = Random::new(7);
    for _ in 0..300 {
        let t = (rng.unit() * s.triangles.len() as f64) as u32;
        let x = barycentric(&mut rng);
        let tri = s.triangle(t);
        let basis = orthonormalise(tri.psi(&x));
        let mut d: Vector<f64, 8> = std::array::from_fn(|_| 0.2 * rng.signed());
        for b in &basis {
            d = add_scaled(&d, -dot(&d, b), b);
        }
        let mean = add_scaled(&tri.point(&x), 1.0, &d);
        match tri.project(&mean, 2.0) {
            Root::Inside(r) => {
                let f = tri.residual(&mean, &r);
                assert!(f[0].abs().max(f[1].abs()) < 1e-9, "{f:?}");
                assert!(r.iter().zip(x).all(|(a, b)| (a - b).abs() < 1e-6), "{r:?} {x:?}");
            }
            Root::Outside(r) => panic!("triangle {t}: {x:?} not found, ended at {r:?}"),
        }
    }
}

#[test]
fn local_search_finds_what_brute_force_finds_near_the_surface() {
    let s = surface(&lobed_sphere(3, 0.3));
    let mut rng = Random::new(8);
    let mut different = 0;
    for _ in 0..300 {
        let t = (rng.unit() * s.triangles.len() as f64) as u32;
        let y = s.triangle(t).point(&barycentric(&mut rng));
        let mean: Vector<f64, 8> = std::array::from_fn(|i| y[i] + 0.4 * rng.signed());
        let local = s.project(&mean, &[s.triangles[t as usize].v[1]], SearchLimits::FIRST);
        let global = s.project_exhaustive(&mean).unwrap();
        let f = s.triangle(local.face).residual(&mean, &local.x);
        assert!(f[0].abs().max(f[1].abs()) < 1e-7, "always a Phong projection: {f:?}");
        different += usize::from((local.distance_squared - global.distance_squared).abs() > 1e-9);
    }
    assert!(different <= 1, "{different} of 300 differ from brute force");
}

#[test]
fn single_precision_decides_and_lands_like_double() {
    let s = surface(&lobed_sphere(3, 0.3));
    let single = s.cast::<f32>();
    let mut rng = Random::new(10);
    for _ in 0..500 {
        let t = (rng.unit() * s.triangles.len() as f64) as u32;
        let y = s.triangle(t).point(&barycentric(&mut rng));
        // Both get the same rounded point.
        let mean: Vector<f32, 8> = std::array::from_fn(|i| (y[i] + 0.3 * rng.signed()) as f32);
        let start = [s.triangles[t as usize].v[0]];
        let a = single.project(&mean, &start, SearchLimits::FIRST);
        let b = s.project(&mean.map(f64::from), &start, SearchLimits::FIRST);
        let pa = s.triangle(a.face).point(&a.x.map(f64::from));
        let pb = s.triangle(b.face).point(&b.x);
        // Coordinates of about 10 edges carry 1e-6; the slack on edges is 1e-4.
        let tolerance = if a.face == b.face { 5e-5 } else { 2.0 * f64::from(slack::<f32>()) };
        assert!(distance_squared(&pa, &pb).sqrt() < tolerance, "{a:?} {b:?}");
    }
}

#[test]
fn open_surfaces_project_at_their_boundary_or_say_so() {
    let s = surface(&tube(1.0, 2.0, 24, 8, Diagonal::Forward));
    let above: Vector<f64, 8> = std::array::from_fn(|i| if i == 2 { 50.0 } else { 0.1 });
    let p = s.project(&above, &[0], SearchLimits::SECOND);
    assert_ne!(p.face, NONE);
    assert!(p.x.iter().all(|x| x.finite()));
    let nan = [f64::NAN; 8];
    assert_eq!(s.project(&nan, &[0], SearchLimits::FIRST).face, NONE);
    assert_eq!(s.project(&above, &[], SearchLimits::FIRST).face, NONE);
}

#[test]
fn the_order_of_triangles_does_not_matter() {
    let mesh = lobed_sphere(2, 0.4);
    let mut triangles = mesh.triangles();
    triangles.reverse();
    let turned: Vec<[u32; 3]> = triangles.iter().map(|t| [t[1], t[2], t[0]]).collect();
    let other = Mesh::of_triangles("turned", mesh.positions.clone(), &turned);
    let (a, b) = (surface(&mesh), PhongSurface::<f64, 8>::new(&Topology::new(&other), &lift(&mesh)).unwrap());
    let mut rng = Random::new(11);
    for _ in 0..200 {
        let t = (rng.unit() * a.triangles.len() as f64) as u32;
        let y = a.triangle(t).point(&barycentric(&mut rng));
        let mean: Vector<f64, 8> = std::array::from_fn(|i| y[i] + 0.2 * rng.signed());
        let start = [a.triangles[t as usize].v[0]];
        let (p, q) = (a.project(&mean, &start, SearchLimits::FIRST), b.project(&mean, &start, SearchLimits::FIRST));
        let (p, q) = (a.triangle(p.face).point(&p.x), b.triangle(q.face).point(&q.x));
        assert!(distance_squared(&p, &q).sqrt() < 1e-7);
    }
}

#[test]
fn a_plane_far_away_and_tiny_is_the_same_plane() {
    for (scale, offset) in [(1e-3, 0.0), (1.0, 1e3), (1e3, 1e6)] {
        let mut mesh = plane_grid(6, 6, 1.0, 1.0, Diagonal::Forward);
        for p in &mut mesh.positions {
            *p = *p * scale + offset;
        }
        let s = flat(&mesh).cast::<f32>();
        let y = s.triangle(17).point(&[0.2, 0.3, 0.5]);
        let p = s.project(&y, &[3], SearchLimits::FIRST);
        assert!(p.distance_squared.sqrt() < 1e-5, "{scale} {p:?}");
    }
}
