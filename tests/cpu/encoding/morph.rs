//! Morphs of a tube that is bent and twisted.

use std::f64::consts::TAU;

use barymap::encoding::MarchQuality;
use barymap::geometry::Mesh;
use barymap::models::shapes::lobed_sphere;
use barymap::tools::morph::Morpher;
use glam::{DQuat, DVec3};

/// Without a stiffness.
const SOFT: MarchQuality = MarchQuality { stiffness: 0.0, ..MarchQuality::CONVERGED };

/// A slender closed tube of diagonal about one, and its image under `place`, which takes the
/// distance along it (0 to 1) and the offset.
fn body(place: impl Fn(f64, DVec3) -> DVec3) -> Mesh {
    let (around, rings) = (16, 44);
    let mut positions = Vec::new();
    for j in 0..rings {
        let z = j as f64 / (rings - 1) as f64;
        let r = 0.125 * (1.0 + 0.06 * (12.0 * z).sin());
        for i in 0..around {
            let u = TAU * (i as f64 + 0.5 * (j % 2) as f64) / around as f64;
            positions.push(place(z, DVec3::new(0.0, r * u.cos(), r * u.sin())));
        }
    }
    let id = |j: usize, i: usize| (j * around + i % around) as u32;
    let mut triangles = Vec::new();
    for j in 0..rings - 1 {
        for i in 0..around {
            let (a, b, c, d) = (id(j, i), id(j, i + 1), id(j + 1, i), id(j + 1, i + 1));
            triangles.extend(if j % 2 == 0 { [[a, c, b], [b, c, d]] } else { [[a, c, d], [a, d, b]] });
        }
    }
    for j in [0, rings - 1] {
        let centre = positions.len() as u32;
        positions.push(place(j as f64 / (rings - 1) as f64, DVec3::ZERO));
        triangles.extend((0..around).map(|i| {
            let (a, b) = (id(j, i), id(j, i + 1));
            if j == 0 { [a, b, centre] } else { [b, a, centre] }
        }));
    }
    Mesh::from_triangles("body", positions, &triangles).unwrap()
}

fn bent(degrees: f64) -> Mesh {
    let angle = degrees.to_radians();
    body(|z, offset| {
        let a = angle * z;
        let axis = if angle == 0.0 { DVec3::X * z } else { DVec3::new(a.sin(), 1.0 - a.cos(), 0.0) / angle };
        axis + DQuat::from_rotation_z(a) * offset
    })
}

fn twisted(degrees: f64) -> Mesh {
    body(|z, offset| DVec3::X * z + DQuat::from_rotation_x(degrees.to_radians() * z) * offset)
}

fn distance(a: &[DVec3], b: &Mesh) -> f64 {
    a.iter().zip(&b.positions).map(|(p, q)| p.distance(*q)).fold(0.0, f64::max)
}

fn march(a: &Mesh, b: &Mesh, quality: &MarchQuality, between: impl Fn(f64) -> Mesh) -> Vec<f64> {
    let mut morpher = Morpher::new(&[a, b], None, &Default::default()).unwrap();
    [0.0, 0.25, 0.5, 0.75, 1.0]
        .map(|t| {
            let (shape, _) = morpher.shape(&[1.0 - t, t], quality).unwrap();
            assert!(shape.iter().all(|p| p.is_finite()));
            distance(&shape, &between(t))
        })
        .to_vec()
}

#[test]
fn a_bend_of_180_is_half_a_bend_in_the_middle() {
    let d = march(&bent(0.0), &bent(180.0), &MarchQuality::CONVERGED, |t| bent(180.0 * t));
    println!("{d:?}");
    assert!(d[0] < 1e-12 && d[4] < 1e-9, "{d:?}");
    assert!(d[1..4].iter().all(|d| *d < 0.01), "{d:?}");
}

#[test]
fn full_bends_and_half_twists_stay_near_the_arc() {
    let bend = march(&bent(0.0), &bent(360.0), &MarchQuality::CONVERGED, |t| bent(360.0 * t));
    let twist = march(&twisted(0.0), &twisted(180.0), &MarchQuality::CONVERGED, |t| twisted(180.0 * t));
    println!("{bend:?}\n{twist:?}");
    for d in [bend, twist] {
        assert!(d[0] < 1e-12 && d[4] < 1e-9, "{d:?}");
        assert!(d[1..4].iter().all(|d| *d < 0.05), "{d:?}");
    }
}

#[test]
fn a_full_twist_is_better_than_a_blend_of_positions() {
    let (a, b) = (twisted(0.0), twisted(360.0));
    let d = march(&a, &b, &MarchQuality::CONVERGED, |t| twisted(360.0 * t));
    println!("{d:?}");
    assert!(d[0] < 1e-12 && d[4] < 1e-9, "{d:?}");
    for (k, t) in [(1, 0.25), (2, 0.5), (3, 0.75)] {
        let linear: Vec<DVec3> = a.positions.iter().zip(&b.positions).map(|(p, q)| p.lerp(*q, t)).collect();
        let worst = distance(&linear, &twisted(360.0 * t));
        assert!(d[k] < 0.5 * worst, "{t}: {} for {worst}", d[k]);
    }
}

#[test]
fn turns_beyond_a_whole_one_go_by_a_key() {
    // Straight, twisted by 270 degrees, by 540: each part turns by 270.
    let keys = [twisted(0.0), twisted(270.0), twisted(540.0)];
    let borrowed: Vec<&Mesh> = keys.iter().collect();
    let mut morpher = Morpher::new(&borrowed, None, &Default::default()).unwrap();
    for (weights, degrees) in [([0.5, 0.5, 0.0], 135.0), ([0.0, 1.0, 0.0], 270.0), ([0.0, 0.5, 0.5], 405.0)] {
        let (shape, _) = morpher.shape(&weights, &MarchQuality::CONVERGED).unwrap();
        let off = distance(&shape, &twisted(degrees));
        println!("{degrees}: {off}");
        assert!(off < 0.05, "{degrees}: {off}");
    }
}

#[test]
fn masks_and_several_shapes() {
    let shapes = [lobed_sphere(3, 0.1), lobed_sphere(3, 0.3), lobed_sphere(3, 0.5)];
    let borrowed: Vec<&Mesh> = shapes.iter().collect();
    let mut morpher = Morpher::new(&borrowed, None, &Default::default()).unwrap();
    for k in 0..3 {
        let weights: Vec<f64> = (0..3).map(|i| if i == k { 1.0 } else { 0.0 }).collect();
        assert!(distance(&morpher.shape(&weights, &SOFT).unwrap().0, &shapes[k]) < 1e-9);
    }
    let (mixed, _) = morpher.shape(&[0.25, 0.5, 0.25], &SOFT).unwrap();
    assert!(distance(&mixed, &shapes[1]) < 0.1, "{}", distance(&mixed, &shapes[1]));
    // A mask that says "the third" everywhere is the third.
    let n = shapes[0].vertex_count();
    let all: Vec<f64> = (0..n).flat_map(|_| [0.0, 0.0, 1.0]).collect();
    assert!(distance(&morpher.masked(&all, &SOFT).unwrap().0, &shapes[2]) < 1e-9);
    let half: Vec<f64> = shapes[0]
        .positions
        .iter()
        .flat_map(|p| {
            let s = (0.5 + 2.0 * p.y).clamp(0.0, 1.0);
            [1.0 - s, 0.0, s]
        })
        .collect();
    let (pasted, report) = morpher.masked(&half, &SOFT).unwrap();
    assert!(pasted.iter().all(|p| p.is_finite()) && !report.levels.is_empty());
}

#[test]
fn meshes_and_weights_that_do_not_fit_are_told() {
    let (a, b) = (lobed_sphere(2, 0.1), lobed_sphere(3, 0.1));
    let message = |meshes: &[&Mesh], anchors: Option<&[u32]>| {
        Morpher::new(meshes, anchors, &Default::default()).map(|_| ()).unwrap_err().to_string()
    };
    assert!(message(&[&a, &b], None).contains("162 and 642"));
    assert!(message(&[&a], None).contains("two"));
    assert!(message(&[&a, &a], Some(&[999])).contains("999"));
    let mut triangles = a.triangles();
    triangles[7].swap(0, 1);
    let flipped = Mesh::from_triangles("flipped", a.positions.clone(), &triangles).unwrap();
    assert!(message(&[&a, &flipped], None).contains("triangle 7"));
    let mut morpher = Morpher::new(&[&a, &a], None, &Default::default()).unwrap();
    for weights in [&[1.0][..], &[0.5, 0.6], &[-0.5, 1.5], &[f64::NAN, 1.0]] {
        assert!(morpher.shape(weights, &MarchQuality::DEFAULT).is_err(), "{weights:?}");
    }
}

#[test]
fn frames_are_shapes_one_after_another_on_any_number_of_threads() {
    let (a, b) = (bent(0.0), bent(180.0));
    let path: Vec<Vec<f64>> = (0..11).map(|k| vec![1.0 - f64::from(k) / 10.0, f64::from(k) / 10.0]).collect();
    let morpher = || Morpher::new(&[&a, &b], None, &Default::default()).unwrap();
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut frames = Vec::new();
        let keep = |k: usize, shape: Vec<DVec3>, _| {
            assert_eq!(k, frames.len());
            frames.push(shape);
            Ok(())
        };
        pool.install(|| morpher().frames(&path, &MarchQuality::FRAMES, keep)).unwrap();
        frames
    };
    let frames = on(2);
    assert!(frames == on(1) && frames[0] == a.positions && frames[10] == b.positions);
    let mut one = morpher();
    for (weights, frame) in path.iter().zip(&frames) {
        assert!(one.shape(weights, &MarchQuality::FRAMES).unwrap().0 == *frame, "{weights:?}");
    }
    // A sink ends the work.
    let mut seen = 0;
    let stop = |_: usize, _: Vec<DVec3>, _| {
        seen += 1;
        if seen == 3 { Err(barymap::Error::input("enough", "None")) } else { Ok(()) }
    };
    assert!(morpher().frames(&path, &MarchQuality::FRAMES, stop).is_err() && seen == 3);
}
