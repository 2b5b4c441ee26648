use glam::DVec2;

use super::*;
use crate::geometry::{Corner, MeshBuilder, NONE};
use crate::io::image_file::encode_png;
use crate::picture::{Depth, Image};

/// A strip of textured triangles with a seam in the middle, two materials, and an unused vertex in
/// front.
fn strip(n: u32) -> Mesh {
    let mut builder = MeshBuilder::new("strip");
    builder.mesh.positions = vec![DVec3::ONE * 9.0];
    builder.mesh.materials = vec![Default::default(), Default::default()];
    for k in 0..n {
        for y in 0..2 {
            builder.mesh.positions.push(DVec3::new(f64::from(k), f64::from(y), 0.0));
            builder.mesh.texcoords.push(DVec2::new(f64::from(k) / f64::from(n), f64::from(y)));
        }
    }
    builder.mesh.texcoords.push(DVec2::splat(0.5));
    for k in 0..n - 1 {
        builder.material = u32::from(k > n / 2);
        let corner =
            |v: u32| Corner { vertex: v + 1, texcoord: if k == 2 && v == 4 { 2 * n } else { v }, normal: NONE };
        builder.polygon([2 * k, 2 * k + 2, 2 * k + 3, 2 * k + 1].map(corner));
    }
    builder.finish()
}

fn materials() -> [GlbMaterial; 2] {
    let png = encode_png(&Image::zeros(3, 2, 3, Depth::U8).unwrap()).unwrap();
    [
        GlbMaterial { name: "a".into(), base_color: [1.0; 4], texture: Some(png.into()), ..GlbMaterial::default() },
        GlbMaterial { name: "b".into(), base_color: [0.5, 0.25, 0.0, 1.0], ..GlbMaterial::default() },
    ]
}

/// The strip rolls up; in every other frame only its end moves.
fn rolled(mesh: &Mesh, f: usize) -> Vec<Vec3> {
    let roll = |p: &DVec3| {
        if f % 2 == 1 && p.x < 5.0 {
            return p.as_vec3();
        }
        let a = 0.1 * f as f64 * (p.x + 1.0) / 8.0;
        DVec3::new(p.x * a.cos(), p.y, p.x * a.sin()).as_vec3()
    };
    mesh.positions.iter().map(roll).collect()
}

/// Vertices of the first primitive at frame `f`, as a viewer computes them: rest plus weighted
/// targets, then the node.
fn played(bytes: &[u8], f: usize) -> Vec<Vec3> {
    let (document, buffers, _) = ::gltf::import_slice(bytes).unwrap();
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(|b| Some(&buffers[b.index()]));
    let mut points: Vec<Vec3> = reader.read_positions().unwrap().map(Vec3::from).collect();
    let count = primitive.morph_targets().count();
    let (mut weights, mut turn, mut shift) = (vec![0.0; count], glam::Quat::IDENTITY, Vec3::ZERO);
    for channel in document.animations().next().unwrap().channels() {
        let reader = channel.reader(|b| Some(&buffers[b.index()]));
        let times = reader.read_inputs().unwrap().count();
        match reader.read_outputs().unwrap() {
            ::gltf::animation::util::ReadOutputs::MorphTargetWeights(all) => {
                let all: Vec<f32> = all.into_f32().collect();
                assert_eq!(all.len(), times * count);
                weights.copy_from_slice(&all[f * count..(f + 1) * count]);
            }
            ::gltf::animation::util::ReadOutputs::Translations(mut all) => shift = Vec3::from(all.nth(f).unwrap()),
            ::gltf::animation::util::ReadOutputs::Rotations(all) => {
                turn = glam::Quat::from_array(all.into_f32().nth(f).unwrap());
            }
            ::gltf::animation::util::ReadOutputs::Scales(_) => panic!("nothing is scaled"),
        }
    }
    for ((positions, normals, _), w) in reader.read_morph_targets().zip(&weights) {
        assert_eq!(normals.unwrap().count(), points.len());
        for (p, d) in points.iter_mut().zip(positions.unwrap()) {
            *p += Vec3::from(d) * *w;
        }
    }
    points.iter().map(|p| turn * *p + shift).collect()
}

fn largest_distance(mesh: &Mesh, played: &[Vec3], wanted: &[Vec3]) -> f32 {
    // The first primitive writes vertices by first use, a second time across the seam.
    played
        .iter()
        .map(|p| wanted[1..].iter().map(|w| w.distance(*p)).fold(f32::INFINITY, f32::min))
        .fold(0.0, f32::max)
        .max(if mesh.vertex_count() == 0 { 1.0 } else { 0.0 })
}

#[test]
fn played_frames_are_the_frames() {
    let mesh = strip(9);
    let frames: Vec<Vec<Vec3>> = (0..12).map(|f| rolled(&mesh, f)).collect();
    let times: Vec<f32> = (0..12).map(|f| f as f32 / 24.0).collect();
    let turn = |f: usize| (DQuat::from_rotation_y(0.7 * f as f64), DVec3::new(f as f64, 0.0, 1.0));
    let placements: Vec<_> = (0..12).map(turn).collect();
    for (form, components) in
        [(MorphForm::Auto, false), (MorphForm::Frames, false), (MorphForm::Components { tolerance: 1e-3 }, true)]
    {
        for placements in [&[][..], &placements] {
            let animation = GlbAnimation { name: "roll", times: &times, frames: &frames, placements, form };
            let (bytes, report) = animated_glb_bytes(&mesh, &materials(), &animation).unwrap();
            assert_eq!((report.components, report.bytes), (components, bytes.len()));
            assert!(report.largest_error <= if components { 1e-3 } else { 1e-6 }, "{report:?}");
            assert!(report.targets <= 12);
            for f in [0, 5, 11] {
                let (turn, shift) = placements.get(f).copied().unwrap_or((DQuat::IDENTITY, DVec3::ZERO));
                let wanted: Vec<Vec3> = frames[f].iter().map(|p| (turn * p.as_dvec3() + shift).as_vec3()).collect();
                let off = largest_distance(&mesh, &played(&bytes, f), &wanted);
                assert!(off <= report.largest_error as f32 + 2e-6, "frame {f}: {off}, {report:?}");
                // The comparison sees a wrong frame.
                assert!(largest_distance(&mesh, &played(&bytes, (f + 3) % 12), &wanted) > 0.01);
            }
        }
    }
}

#[test]
fn targets_that_move_little_are_sparse_and_all_is_kept() {
    let mesh = strip(40);
    let mut frame: Vec<Vec3> = mesh.positions.iter().map(|p| p.as_vec3()).collect();
    let still = frame.clone();
    frame[7] += Vec3::Z;
    let size = |frames: &[Vec<Vec3>]| {
        let times: Vec<f32> = (0..frames.len()).map(|f| f as f32).collect();
        let animation = GlbAnimation { name: "a", times: &times, frames, placements: &[], form: MorphForm::Frames };
        animated_glb_bytes(&mesh, &materials(), &animation).unwrap().0
    };
    let bytes = size(&[still.clone(), frame.clone(), still.clone()]);
    let text = String::from_utf8_lossy(&bytes);
    assert!(text.contains("\"sparse\""));
    let (document, _, images) = ::gltf::import_slice(&bytes).unwrap();
    assert_eq!((images.len(), document.materials().len(), document.animations().len()), (1, 2, 1));
    for primitive in document.meshes().next().unwrap().primitives() {
        assert!(primitive.get(&::gltf::Semantic::TexCoords(0)).is_some());
        assert_eq!(primitive.morph_targets().count(), 3);
    }
    let full: Vec<Vec3> = still.iter().map(|p| *p + Vec3::Z).collect();
    assert!(size(&[still.clone(), full, still]).len() > bytes.len() + 12 * mesh.vertex_count() / 2);
}

#[test]
fn a_clip_at_rest_has_no_targets_and_one_frame_is_enough() {
    let mesh = strip(5);
    let still: Vec<Vec3> = mesh.positions.iter().map(|p| p.as_vec3()).collect();
    let form = MorphForm::Components { tolerance: 1e-3 };
    let animation =
        GlbAnimation { name: "a", times: &[0.0, 1.0], frames: &[still.clone(), still.clone()], placements: &[], form };
    let (bytes, report) = animated_glb_bytes(&mesh, &[], &animation).unwrap();
    assert_eq!(report.targets, 0);
    assert_eq!(::gltf::import_slice(&bytes).unwrap().0.animations().len(), 0);
    let animation = GlbAnimation { times: &[0.0], frames: &[rolled(&mesh, 3)], form: MorphForm::Auto, ..animation };
    let (bytes, report) = animated_glb_bytes(&mesh, &[], &animation).unwrap();
    assert_eq!(report.targets, 1);
    assert!(largest_distance(&mesh, &played(&bytes, 0), &rolled(&mesh, 3)) < 1e-6);
}

#[test]
fn frames_that_do_not_fit_are_refused() {
    let mesh = strip(4);
    let still: Vec<Vec3> = mesh.positions.iter().map(|p| p.as_vec3()).collect();
    let frames = [still.clone(), still.clone()];
    let base = GlbAnimation { name: "a", times: &[0.0, 1.0], frames: &frames, placements: &[], form: MorphForm::Auto };
    let message = |a: &GlbAnimation<'_>| animated_glb_bytes(&mesh, &[], a).unwrap_err().to_string();
    let mut short = frames.clone();
    short[1].pop();
    let mut nan = frames.clone();
    nan[1][2].y = f32::NAN;
    assert!(message(&GlbAnimation { times: &[0.0], ..base }).contains("2 frames with 1 times"));
    assert!(message(&GlbAnimation { times: &[1.0, 1.0], ..base }).contains("frame 1"));
    assert!(message(&GlbAnimation { times: &[-1.0, 1.0], ..base }).contains("frame 0"));
    assert!(message(&GlbAnimation { times: &[0.0, f32::NAN], ..base }).contains("frame 1"));
    assert!(message(&GlbAnimation { times: &[], frames: &[], ..base }).contains("at least one"));
    assert!(message(&GlbAnimation { frames: &short, ..base }).contains("frame 1 has"));
    assert!(message(&GlbAnimation { frames: &nan, ..base }).contains("vertex 2 of frame 1"));
    assert!(message(&GlbAnimation { placements: &[(DQuat::IDENTITY, DVec3::ZERO)], ..base }).contains("1 placements"));
}

#[test]
fn the_validator_accepts_what_is_written() {
    let mesh = strip(9);
    let frames: Vec<Vec<Vec3>> = (0..12).map(|f| rolled(&mesh, f)).collect();
    let times: Vec<f32> = (0..12).map(|f| f as f32 / 24.0).collect();
    let placements: Vec<_> = (0..12).map(|f| (DQuat::from_rotation_y(0.7 * f as f64), DVec3::X * f as f64)).collect();
    let mut files = Vec::new();
    for form in [MorphForm::Frames, MorphForm::Components { tolerance: 1e-3 }] {
        for placements in [&[][..], &placements] {
            let animation = GlbAnimation { name: "roll", times: &times, frames: &frames, placements, form };
            let (bytes, _) = animated_glb_bytes(&mesh, &materials(), &animation).unwrap();
            files.push((format!("{}", files.len()), bytes));
        }
    }
    crate::io::gltf_samples::check_valid(&files);
}
