use std::path::Path;

use super::*;
use crate::io::motion::Skeleton;

/// A box of vertices, and a clip of its corners: scaled, turned to z up, walking and turning.
fn boxed() -> (Mesh, Motion, Similarity) {
    let corner = |k: usize| DVec3::new((k & 1) as f64, 2.0 * (k >> 1 & 1) as f64, 0.5 * (k >> 2) as f64);
    let triangles = [
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 5, 7],
        [1, 7, 3],
    ];
    let mesh = Mesh::of_triangles("box", (0..8).map(corner).collect(), &triangles);
    let to_clip = Similarity {
        rotation: DMat3::from_rotation_x(std::f64::consts::FRAC_PI_2),
        scale: 1000.0,
        shift: DVec3::new(300.0, 20.0, 0.0),
    };
    let moved = |f: usize, p: DVec3| DQuat::from_rotation_z(0.2 * f as f64) * p + DVec3::X * 50.0 * f as f64;
    let frames = (0..10).map(|f| (0..8).map(|k| Some(moved(f, to_clip.apply(corner(k))))).collect()).collect();
    let motion = Motion {
        path: Path::new("clip").into(),
        names: (0..8).map(|k| format!("M{k}")).collect(),
        rate: 100.0,
        frames,
        metres_per_unit: Some(0.001),
        skeleton: None,
        warnings: Vec::new(),
    };
    (mesh, motion, to_clip)
}

fn places(list: &[(&str, MarkerPlace)]) -> Vec<(String, MarkerPlace)> {
    list.iter().map(|(n, p)| ((*n).to_owned(), p.clone())).collect()
}

fn one(v: u32) -> MarkerPlace {
    MarkerPlace::Vertices(vec![v])
}

/// The largest change of a distance between two vertices.
fn bent(mesh: &Mesh, bonds: &[Bond], frame: &[DVec3]) -> f64 {
    let mut worst = 0.0f64;
    for (a, p) in bonds.iter().zip(frame) {
        for (b, q) in bonds.iter().zip(frame) {
            let rest = mesh.positions[a.vertex as usize].distance(mesh.positions[b.vertex as usize]);
            worst = worst.max((p.distance(*q) - rest).abs());
        }
    }
    worst
}

#[test]
fn a_rigid_clip_moves_the_vertices_rigidly() {
    let (mesh, motion, to_clip) = boxed();
    let given = places(&[
        ("M0", one(0)),
        ("M3", one(3)),
        ("M5", one(5)),
        ("M6", MarkerPlace::Position(DVec3::new(0.1, 2.1, 0.4))),
    ]);
    let binding = Binding::given(&motion, &mesh, &given, Reference::Frame(0)).unwrap();
    assert!((binding.fit.scale * to_clip.scale - 1.0).abs() < 1e-9 && binding.rms() < 1e-9, "{binding:?}");
    assert_eq!(binding.bonds[3].vertex, 6);
    let tracks: Vec<Vec<DVec3>> =
        motion.frames.iter().map(|f| binding.points().iter().map(|&p| f[p].unwrap()).collect()).collect();
    let frames = binding.trajectories(&motion, &motion, &mesh, &tracks).unwrap();
    for frame in &frames {
        assert!(bent(&mesh, &binding.bonds, frame) < 1e-9);
    }
    for (bond, p) in binding.bonds.iter().zip(&frames[0]) {
        assert!(p.distance(mesh.positions[bond.vertex as usize]) < 1e-9);
    }
    assert!(frames[9][0].distance(frames[0][0]) > 0.2, "the clip moves");
}

#[test]
fn what_the_fit_leaves_turns_with_the_body() {
    let (mesh, mut motion, _) = boxed();
    // Markers on stalks: each away from its vertex in its own direction, fixed to the body.
    for (f, frame) in motion.frames.iter_mut().enumerate() {
        for (k, p) in frame.iter_mut().enumerate() {
            let stalk = DVec3::new(40.0 * (k as f64).sin(), 30.0 * (k as f64 * 2.0).cos(), 10.0 * k as f64);
            *p = p.map(|p| p + DQuat::from_rotation_z(0.2 * f as f64) * stalk);
        }
    }
    let given = places(&[("M0", one(0)), ("M3", one(3)), ("M5", one(5)), ("M6", one(6)), ("M7", one(7))]);
    let binding = Binding::given(&motion, &mesh, &given, Reference::Frame(2)).unwrap();
    assert!(binding.rms() > 0.01);
    let tracks: Vec<Vec<DVec3>> =
        motion.frames.iter().map(|f| binding.points().iter().map(|&p| f[p].unwrap()).collect()).collect();
    let frames = binding.trajectories(&motion, &motion, &mesh, &tracks).unwrap();
    for (f, frame) in frames.iter().enumerate() {
        assert!(bent(&mesh, &binding.bonds, frame) < 1e-9, "frame {f}: {}", bent(&mesh, &binding.bonds, frame));
    }
    for (bond, p) in binding.bonds.iter().zip(&frames[2]) {
        assert!(p.distance(mesh.positions[bond.vertex as usize]) < 1e-9);
    }
}

#[test]
fn vertices_of_one_joint_turn_with_it() {
    // One joint that stays in place and turns: its position says nothing, its vertices go around.
    let (mesh, mut motion, _) = boxed();
    let rest = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
    motion.names = ["a", "b", "c"].map(str::to_owned).to_vec();
    motion.frames = vec![rest.iter().map(|p| Some(*p)).collect(); 4];
    let rotations =
        (0..4).map(|f| vec![DQuat::from_rotation_x(0.5 * f as f64), DQuat::IDENTITY, DQuat::IDENTITY]).collect();
    motion.skeleton = Some(Skeleton { segments: Vec::new(), rest: rest.clone(), rotations });
    let given = places(&[("a", MarkerPlace::Vertices(vec![2, 3, 4])), ("b", one(1)), ("c", one(6))]);
    let binding = Binding::given(&motion, &mesh, &given, Reference::Rest).unwrap();
    let tracks = vec![rest; 4];
    let frames = binding.trajectories(&motion, &motion, &mesh, &tracks).unwrap();
    let of = |joint: usize| {
        binding.bonds.iter().enumerate().filter(move |(_, b)| b.point == joint).map(|(k, _)| k).collect::<Vec<_>>()
    };
    for k in of(0) {
        assert!(frames[3][k].distance(frames[0][k]) > 0.1);
        assert!(
            (frames[3][k].distance(frames[3][of(0)[0]]) - frames[0][k].distance(frames[0][of(0)[0]])).abs() < 1e-12
        );
    }
    for k in of(1).into_iter().chain(of(2)) {
        assert_eq!(frames[3][k], frames[0][k]);
    }
}

#[test]
fn bindings_that_cannot_be_used_are_refused() {
    let (mesh, mut motion, _) = boxed();
    motion.frames[0][5] = None;
    let message = |list: &[(&str, MarkerPlace)], reference| {
        Binding::given(&motion, &mesh, &places(list), reference).unwrap_err().to_string()
    };
    let (a, b) = (("M0", one(0)), ("M3", one(3)));
    for (text, expected) in [
        (message(&[a.clone(), b.clone(), ("M9", one(1))], Reference::Frame(0)), "M9"),
        (message(&[a.clone(), b.clone(), ("M2", one(8))], Reference::Frame(0)), "vertex 8"),
        (message(&[a.clone(), b.clone(), ("M2", one(3))], Reference::Frame(0)), "bound to M3 and to M2"),
        (message(&[a.clone(), b.clone(), ("M5", one(5))], Reference::Frame(0)), "not seen"),
        (message(&[a.clone(), b.clone()], Reference::Frame(0)), "three markers"),
        (message(&[a.clone(), b.clone(), ("M6", one(6))], Reference::Rest), "no pose at rest"),
        (message(&[a, b, ("M6", one(6))], Reference::Frame(10)), "frame 10 of 10"),
    ] {
        assert!(text.contains(expected), "{text}");
    }
    assert_eq!(fullest_frame(&motion, &[0, 5]), 1);
}
