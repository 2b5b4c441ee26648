//! Frames after frames, regions, parts without handles, single precision.

use barymap::encoding::decode::split_level;
use barymap::encoding::{Quality, V3};
use barymap::geometry::Mesh;
use barymap::io::cache::Cache;
use barymap::models::shapes::{icosphere, lobed_sphere};
use barymap::tools::deform::{Deformer, Handles};
use glam::{DQuat, DVec3};

use super::tube::{Pose, Tube};
use super::{deformer, spread};

#[test]
fn what_does_not_move_does_not_jitter() {
    let tube = Tube::small();
    let handles = tube.points();
    let mut deformer = deformer(&tube.mesh, &handles);
    let pose = |degrees: f64| tube.targets(&handles, Pose::Twist(degrees));
    let first = deformer.deform(&pose(40.0), &Quality::DEFAULT, true).unwrap();
    let again = deformer.deform(&pose(40.0), &Quality::DEFAULT, true).unwrap();
    assert_eq!(first.positions, again.positions);
    assert_eq!(again.report.iterations(), 0);
    // The next frame begins at this one and ends where a cold start ends.
    let warm = deformer.deform(&pose(42.0), &Quality::CONVERGED, true).unwrap();
    let cold = deformer.deform(&pose(42.0), &Quality::CONVERGED, false).unwrap();
    let distance = warm.positions.iter().zip(&cold.positions).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    assert!(distance < 1e-4, "{distance}");
    // Without the frame before the same call gives the same bits.
    let repeated = deformer.deform(&pose(42.0), &Quality::CONVERGED, false).unwrap();
    assert_eq!(repeated.positions, cold.positions);
}

#[test]
fn only_the_region_moves() {
    let mesh = lobed_sphere(4, 0.4);
    let region: Vec<u32> = (0..mesh.vertex_count() as u32).filter(|&v| mesh.positions[v as usize].x > 0.2).collect();
    let handle = *region
        .iter()
        .max_by(|a, b| mesh.positions[**a as usize].x.total_cmp(&mesh.positions[**b as usize].x))
        .unwrap();
    let wanted = Handles { vertices: vec![handle], region: Some(region.clone()) };
    let mut deformer = Deformer::new(&mesh, wanted, &Default::default(), &Cache::disabled()).unwrap();
    let target = mesh.positions[handle as usize] + DVec3::new(0.5, 0.3, 0.0);
    let result = deformer.deform(&[target], &Quality::CONVERGED, false).unwrap();
    assert_eq!(result.positions[handle as usize], target);
    let mut moved = 0;
    for v in 0..mesh.vertex_count() {
        if region.contains(&(v as u32)) {
            moved += usize::from(result.positions[v].distance(mesh.positions[v]) > 1e-3);
        } else {
            assert_eq!(result.positions[v], mesh.positions[v], "{v}");
        }
    }
    assert!(moved > region.len() / 2, "{moved} of {}", region.len());
    let m = deformer.measures(&result.positions);
    assert!(m.flipped == 0 && m.g > 0.0, "{m:?}");
}

#[test]
fn parts_without_handles_follow_their_neighbours() {
    let body = lobed_sphere(3, 0.3);
    let eye = icosphere(0.2, 1);
    let mut positions = body.positions.clone();
    positions.extend(eye.positions.iter().map(|p| *p + DVec3::new(1.1, 0.0, 0.2)));
    // A vertex of no face as well.
    positions.push(DVec3::splat(9.0));
    let n = body.vertex_count() as u32;
    let mut triangles = body.triangles();
    triangles.extend(eye.triangles().iter().map(|t| t.map(|v| v + n)));
    let mesh = Mesh::from_triangles("body and eye", positions, &triangles).unwrap();
    let handles = spread(&body, 6);
    let turn = DQuat::from_rotation_y(2.0);
    let mut deformer = deformer(&mesh, &handles);
    assert!(deformer.warnings.iter().any(|w| w.contains("no handle")), "{:?}", deformer.warnings);
    let targets: Vec<DVec3> = handles.iter().map(|&v| turn * mesh.positions[v as usize]).collect();
    let result = deformer.deform(&targets, &Quality::SPLITS, false).unwrap();
    for v in 0..mesh.vertex_count() - 1 {
        assert!(result.positions[v].distance(turn * mesh.positions[v]) < 1e-12, "{v}");
    }
    assert_eq!(result.positions[mesh.vertex_count() - 1], DVec3::splat(9.0));
}

#[test]
fn single_precision_decodes_to_two_millionths() {
    let tube = Tube::medium();
    let handles = tube.points();
    let mut deformer = deformer(&tube.mesh, &handles);
    let targets = tube.targets(&handles, Pose::Twist(90.0));
    let double = deformer.deform(&targets, &Quality::SPLITS, false).unwrap();
    let h = deformer.decoder().hierarchy();
    let single = h.split_encoding.to_precision::<f32>();
    let mut x: Vec<V3<f32>> = h.order.iter().map(|_| [0.0; 3]).collect();
    for (k, &v) in h.order[..h.base].iter().enumerate() {
        x[k] = double.positions[v as usize].to_array().map(|x| x as f32);
    }
    for l in h.level_start.windows(2) {
        split_level(&h.splits, &single, l[0] as usize..l[1] as usize, &mut x);
    }
    let worst = h
        .order
        .iter()
        .zip(&x)
        .map(|(&v, x)| double.positions[v as usize].distance(DVec3::from(x.map(f64::from))))
        .fold(0.0, f64::max);
    assert!(worst < 2e-6, "{worst}");
}

#[test]
fn sweeps_go_down_too() {
    let tube = Tube::small();
    let handles = tube.points();
    let mut deformer = deformer(&tube.mesh, &handles);
    let targets = tube.targets(&handles, Pose::Twist(60.0));
    let mut g = |sweeps: usize| {
        let result = deformer.deform(&targets, &Quality { sweeps, ..Quality::SPLITS }, false).unwrap();
        deformer.measures(&result.positions).g
    };
    let values = [g(0), g(1), g(4), g(16)];
    assert!(values.windows(2).all(|w| w[1] < w[0]), "{values:?}");
}

#[test]
fn hierarchies_are_kept_and_serve_every_pose() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::in_folder(folder.path());
    let tube = Tube::small();
    let make = || {
        let wanted = Handles { vertices: tube.points(), region: None };
        Deformer::new(&tube.mesh, wanted, &Default::default(), &cache).unwrap()
    };
    let pose = |d: &mut Deformer| {
        d.deform(&tube.targets(&tube.points(), Pose::Bend(50.0)), &Quality::DEFAULT, false).unwrap().positions
    };
    let fresh = pose(&mut make());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    assert_eq!(pose(&mut make()), fresh);
    // A damaged entry is made again.
    for entry in std::fs::read_dir(folder.path()).unwrap() {
        std::fs::write(entry.unwrap().path(), b"damaged").unwrap();
    }
    assert_eq!(pose(&mut make()), fresh);
}
