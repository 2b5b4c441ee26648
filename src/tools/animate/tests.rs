use super::*;
use crate::models::shapes::uv_sphere;
use crate::progress::Quiet;

/// A ball with six markers on it that rolls, stands still, and rolls on.
fn rolling(mesh: &Mesh) -> Motion {
    let chosen = [0usize, 40, 77, 123, 160, 200];
    let at = |f: usize| match f {
        0..4 => f,
        4..7 => 4,
        _ => f - 2,
    };
    let pose = |f: usize, p: DVec3| DQuat::from_rotation_z(0.6 * at(f) as f64) * p + DVec3::X * at(f) as f64;
    Motion {
        path: "clip".into(),
        names: (0..6).map(|k| format!("M{k}")).collect(),
        rate: 50.0,
        frames: (0..10).map(|f| chosen.iter().map(|&v| Some(pose(f, mesh.positions[v]))).collect()).collect(),
        metres_per_unit: None,
        skeleton: None,
        warnings: Vec::new(),
    }
}

fn bound(motion: &Motion, mesh: &Mesh) -> Binding {
    let bonds =
        [0u32, 40, 77, 123, 160, 200].iter().enumerate().map(|(point, &vertex)| Bond { vertex, point }).collect();
    Binding::fitted(motion, mesh, bonds, Similarity::IDENTITY, Reference::Frame(0)).unwrap()
}

#[test]
fn a_rigid_clip_moves_the_mesh_rigidly_and_standing_still_is_still() {
    let mesh = uv_sphere(1.0, 20, 12);
    let motion = rolling(&mesh);
    let binding = bound(&motion, &mesh);
    let mut shapes = Vec::new();
    let report = animate(
        &mesh,
        &motion,
        &motion,
        &binding,
        &AnimateOptions::default(),
        &Cache::disabled(),
        &Quiet,
        |f, shape| {
            assert_eq!(f, shapes.len());
            shapes.push(shape);
            Ok(())
        },
    )
    .unwrap();
    assert!(shapes.len() == 10 && report.gaps.is_empty() && report.found_anew.is_empty(), "{report:?}");
    for (shape, frame) in shapes.iter().zip(&motion.frames) {
        let (rigid, (turn, shift)) = without_rigid_motion(&mesh, shape);
        for (p, q) in rigid.iter().zip(&mesh.positions) {
            assert!(p.as_dvec3().distance(*q) < 1e-6);
        }
        assert!((turn * mesh.positions[40] + shift).distance(frame[1].unwrap()) < 1e-9);
    }
    assert!(shapes[4] == shapes[5] && shapes[5] == shapes[6], "no jitter");
    assert!(shapes[6] != shapes[7]);
}

#[test]
fn the_receiver_can_end_the_work() {
    let mesh = uv_sphere(1.0, 20, 12);
    let motion = rolling(&mesh);
    let mut seen = 0;
    let stop = |f: usize, _| {
        seen = f;
        if f == 2 { Err(crate::Error::input("stop", "now")) } else { Ok(()) }
    };
    let result = animate(
        &mesh,
        &motion,
        &motion,
        &bound(&motion, &mesh),
        &AnimateOptions::default(),
        &Cache::disabled(),
        &Quiet,
        stop,
    );
    assert!(result.is_err() && seen == 2);
}
