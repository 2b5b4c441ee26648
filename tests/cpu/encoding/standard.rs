//! The standard set: twists and bends of the bumpy tube; and the paper's Fig. 3.

use barymap::encoding::{Connectivity, V3};
use barymap::encoding::{Decoder, Hierarchy, HierarchyOptions, Quality};
use barymap::geometry::Mesh;
use glam::{DQuat, DVec3};

use super::deformer;
use super::tube::{Pose, Tube};

/// G where Gauss-Newton on the whole mesh ends, from the given shape, by direct solves and to the
/// last digits.
fn optimum(tube: &Tube, handles: &[u32], shape: &[DVec3]) -> f64 {
    let connectivity = Connectivity::new(&tube.mesh);
    let rest: Vec<V3<f64>> = tube.mesh.positions.iter().map(|p| p.to_array()).collect();
    let mut held = handles.to_vec();
    held.sort_unstable();
    let options = HierarchyOptions { stages: Vec::new() };
    let hierarchy = Hierarchy::new(&connectivity, &rest, &held, &options).unwrap();
    let mut x: Vec<V3<f64>> = hierarchy.order.iter().map(|&v| shape[v as usize].to_array()).collect();
    let tight = Quality { direct: 100_000, decrease: 1e-7, direct_iterations: 60, ..Quality::CONVERGED };
    Decoder::new(hierarchy, &rest).refine(&mut x, 1.0, &tight).unwrap().after
}

#[test]
fn the_small_tube_reaches_the_minimum() {
    let tube = Tube::small();
    for handles in [tube.caps(), tube.points()] {
        let mut deformer = deformer(&tube.mesh, &handles);
        for (pose, limit) in [(Pose::Twist(90.0), 4.5e-6), (Pose::Bend(120.0), 4.2e-5), (Pose::Twist(180.0), 1.25e-5)] {
            let targets = tube.targets(&handles, pose);
            let converged = deformer.deform(&targets, &Quality::CONVERGED, false).unwrap();
            let m = deformer.measures(&converged.positions);
            let best = optimum(&tube, &handles, &converged.positions);
            println!("{} handles, {pose:?}: optimum {best:.3e}, {m:?}", handles.len());
            assert!(m.g <= 1.05 * best && m.g <= limit, "{pose:?}: {} for {best}", m.g);
            let default = deformer.deform(&targets, &Quality::DEFAULT, false).unwrap();
            assert!(deformer.measures(&default.positions).g <= 1.5 * best, "{pose:?}");
            assert_eq!(m.flipped, 0, "{pose:?}");
            for (&v, t) in handles.iter().zip(&targets) {
                assert_eq!(converged.positions[v as usize], *t);
            }
        }
    }
}

#[test]
fn the_medium_tube_is_better_than_every_peer() {
    let tube = Tube::medium();
    let handles = tube.caps();
    let mut deformer = deformer(&tube.mesh, &handles);
    let result = deformer.deform(&tube.targets(&handles, Pose::Twist(90.0)), &Quality::DEFAULT, false).unwrap();
    let m = deformer.measures(&result.positions);
    println!("{m:?}");
    // As-rigid-as-possible implementations reach 2.7e-4, Laplacian Deform 2.9e-6.
    assert!(m.g <= 1e-6 && m.flipped == 0 && m.edge_max < 0.25, "{m:?}");
}

#[test]
fn the_medium_tube_reaches_the_minimum() {
    let tube = Tube::medium();
    for (handles, pose) in [(tube.caps(), Pose::Twist(90.0)), (tube.points(), Pose::Bend(120.0))] {
        let mut deformer = deformer(&tube.mesh, &handles);
        let converged = deformer.deform(&tube.targets(&handles, pose), &Quality::CONVERGED, false).unwrap();
        let m = deformer.measures(&converged.positions);
        let best = optimum(&tube, &handles, &converged.positions);
        println!("{} handles, {pose:?}: optimum {best:.3e}, {m:?}", handles.len());
        assert!(m.g <= 1.05 * best && m.flipped == 0, "{pose:?}: {} for {best}", m.g);
    }
}

#[test]
fn the_large_tube_comes_near_the_minimum_by_default() {
    let tube = Tube::large();
    let handles = tube.caps();
    let mut deformer = deformer(&tube.mesh, &handles);
    let result = deformer.deform(&tube.targets(&handles, Pose::Twist(90.0)), &Quality::DEFAULT, false).unwrap();
    let m = deformer.measures(&result.positions);
    let best = optimum(&tube, &handles, &result.positions);
    println!("optimum {best:.3e}, {m:?}");
    assert!(m.g <= 1.5 * best && m.flipped == 0, "{} for {best}", m.g);
}

#[test]
fn stiffness_keeps_what_plain_encoding_pinches() {
    let tube = Tube::small();
    let handles = tube.caps();
    let mut deformer = deformer(&tube.mesh, &handles);
    let targets = tube.targets(&handles, Pose::Twist(180.0));
    let mut measure = |stiffness: f64| {
        let quality = Quality { stiffness, ..Quality::CONVERGED };
        let result = deformer.deform(&targets, &quality, false).unwrap();
        deformer.measures(&result.positions)
    };
    let (plain, stiff) = (measure(0.0), measure(1.0));
    println!("{plain:?}\n{stiff:?}");
    assert!(stiff.volume_ratio > plain.volume_ratio + 0.08, "{stiff:?}");
    assert!(stiff.edge_rms < 0.65 * plain.edge_rms && stiff.flipped == 0 && plain.flipped == 0, "{stiff:?}");
}

/// The surface of a slab of cubes with two holes, smoothed: genus 2, long along x.
fn figure_eight() -> Mesh {
    let solid = |x: i32, y: i32, z: i32| {
        (0..20).contains(&x)
            && (0..8).contains(&y)
            && (0..4).contains(&z)
            && !((3..8).contains(&x) && (3..5).contains(&y))
            && !((12..17).contains(&x) && (3..5).contains(&y))
    };
    let mut index = std::collections::BTreeMap::new();
    let mut quads: Vec<[u32; 4]> = Vec::new();
    for x in 0..20 {
        for y in 0..8 {
            for z in 0..4 {
                if !solid(x, y, z) {
                    continue;
                }
                for axis in 0..3 {
                    for side in [0, 1] {
                        let mut next = [x, y, z];
                        next[axis] += 2 * side - 1;
                        if solid(next[0], next[1], next[2]) {
                            continue;
                        }
                        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                        let mut corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(a, b)| {
                            let mut c = [x, y, z];
                            c[axis] += side;
                            c[u] += a;
                            c[v] += b;
                            let n = index.len() as u32;
                            *index.entry(c).or_insert(n)
                        });
                        if side == 0 {
                            corners.reverse();
                        }
                        quads.push(corners);
                    }
                }
            }
        }
    }
    let mut positions = vec![DVec3::ZERO; index.len()];
    for (c, &v) in &index {
        positions[v as usize] = DVec3::new(f64::from(c[0]), f64::from(c[1]), f64::from(c[2])) / 21.9;
    }
    for _ in 0..3 {
        let mut sum = vec![(DVec3::ZERO, 0.0); positions.len()];
        for q in &quads {
            for k in 0..4 {
                let (a, b) = (q[k] as usize, q[(k + 1) % 4] as usize);
                sum[a] = (sum[a].0 + positions[b], sum[a].1 + 1.0);
            }
        }
        positions = positions.iter().zip(&sum).map(|(p, s)| *p * 0.4 + s.0 / s.1 * 0.6).collect();
    }
    let triangles: Vec<[u32; 3]> = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
    Mesh::from_triangles("figure eight", positions, &triangles).unwrap()
}

#[test]
fn figure_three_needs_about_nine_iterations() {
    let mesh = figure_eight();
    let (low, high) = mesh.bounds().unwrap();
    let centre = (low + high) * 0.5;
    // Eight anchors: the vertices nearest to the corners of the box.
    let handles: Vec<u32> = (0..8)
        .map(|k| {
            let corner = DVec3::select(glam::BVec3::new(k & 4 != 0, k & 2 != 0, k & 1 != 0), high, low);
            let nearest = |a: &u32, b: &u32| {
                let d = |v: u32| mesh.positions[v as usize].distance(corner);
                d(*a).total_cmp(&d(*b))
            };
            (0..mesh.vertex_count() as u32).min_by(nearest).unwrap()
        })
        .collect();
    let rest: Vec<V3<f64>> = mesh.positions.iter().map(|p| (*p - centre).to_array()).collect();
    let connectivity = Connectivity::new(&mesh);
    let mut held = handles.clone();
    held.sort_unstable();
    let hierarchy = Hierarchy::new(&connectivity, &rest, &held, &HierarchyOptions { stages: Vec::new() }).unwrap();
    let mut x: Vec<V3<f64>> = hierarchy.order.iter().map(|&v| rest[v as usize]).collect();
    for p in x[..hierarchy.held].iter_mut().filter(|p| p[0] > 0.0) {
        *p = (DQuat::from_rotation_x(90_f64.to_radians()) * DVec3::from(*p)).to_array();
    }
    let before = x.clone();
    let quality = Quality { decrease: 1e-6, direct_iterations: 50, ..Quality::CONVERGED };
    let report = Decoder::new(hierarchy, &rest).refine(&mut x, 1.0, &quality).unwrap();
    println!("{} vertices: {report:?}", rest.len());
    assert!((7..=10).contains(&report.iterations), "{report:?}");
    assert!(report.after < 0.1 * report.before);
    assert!(x.iter().zip(&before).any(|(a, b)| a != b));
}
