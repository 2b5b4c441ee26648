//! Characters in parts: what has no anchor follows what it lies beside, as a whole, by every
//! method; and what a map turns over is doubtful.

use std::ops::Range;

use barymap::geometry::{Mesh, SurfacePoint, Topology};
use barymap::models::shapes::{icosphere, lobed_sphere};
use barymap::progress::Quiet;
use barymap::surface::anchors::vertex_point;
use barymap::surface::correspondence::{CorrespondenceOptions, Method, Precision, Shape, correspondence};
use barymap::surface::quality::{flipped, normal_at, vertex_normals};
use barymap::surface::{AnchorPairs, Embedding, EmbeddingOptions, PackedImage, PackedPoint, Sampling, Status};
use barymap::tools::vertex_map::vertex_map;
use glam::{DQuat, DVec3};

const METHODS: [Method; 5] = [Method::Averages, Method::Transport, Method::Field, Method::Rbf, Method::Closest];

/// A mesh of shells, one after the other.
struct Shells {
    mesh: Mesh,
    vertices: Vec<Range<usize>>,
    faces: Vec<Range<u32>>,
}

impl Shells {
    fn new(shells: &[Mesh]) -> Self {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        let (mut vertices, mut faces) = (Vec::new(), Vec::new());
        for shell in shells {
            let (v, t) = (positions.len(), triangles.len() as u32);
            positions.extend(&shell.positions);
            triangles.extend(shell.triangles().iter().map(|t| t.map(|i| i + v as u32)));
            vertices.push(v..positions.len());
            faces.push(t..triangles.len() as u32);
        }
        Self { mesh: Mesh::from_triangles("shells", positions, &triangles).unwrap(), vertices, faces }
    }
}

/// A ball with radii along the axes.
fn ball(at: DVec3, radii: DVec3, level: u32) -> Mesh {
    let mut ball = icosphere(1.0, level);
    ball.positions.iter_mut().for_each(|p| *p = at + *p * radii);
    ball
}

/// Where a ray from the middle leaves the body.
fn on(body: &Mesh, direction: DVec3) -> DVec3 {
    let d = direction.normalize();
    let nearest = |p: &&DVec3| p.normalize().dot(d);
    *body.positions.iter().max_by(|a, b| nearest(a).total_cmp(&nearest(b))).unwrap()
}

/// A body with two eyes half sunk in, a row of flat buttons on it, two boots beside it and a bead
/// off it.
fn character(amplitude: f64, size: f64, parts: bool) -> Shells {
    let body = lobed_sphere(4, amplitude);
    let mut shells = vec![body.clone()];
    if parts {
        for x in [-0.35, 0.35] {
            shells.push(ball(on(&body, DVec3::new(x, 0.9, 0.4)), DVec3::splat(0.1 * size), 2));
        }
        for z in [-0.3, 0.0, 0.3] {
            shells.push(ball(on(&body, DVec3::new(0.1, -1.0, z)), DVec3::new(0.06, 0.02, 0.06) * size, 2));
        }
        for x in [-0.6, 0.6] {
            shells.push(ball(on(&body, DVec3::new(x, 0.0, -1.0)) * 1.1, DVec3::new(0.2, 0.3, 0.15) * size, 3));
        }
        shells.push(ball(on(&body, DVec3::X) * 1.3, DVec3::splat(0.08 * size), 2));
    }
    Shells::new(&shells)
}

/// Turned, doubled and moved, so that nothing lies where it was.
fn elsewhere(p: DVec3) -> DVec3 {
    DQuat::from_rotation_z(0.8) * (DQuat::from_rotation_x(0.5) * p) * SCALE + DVec3::new(5.0, -3.0, 1.0)
}

const SCALE: f64 = 2.0;

struct Side {
    shells: Shells,
    topology: Topology,
    embedding: Embedding,
}

impl Side {
    fn new(shells: Shells) -> Self {
        let topology = Topology::new(&shells.mesh);
        let options =
            EmbeddingOptions { landmarks: 300, sampling: Sampling::FarthestPoint, ..EmbeddingOptions::default() };
        let embedding = Embedding::compute(&shells.mesh, &topology, &options, &Quiet).unwrap();
        Self { shells, topology, embedding }
    }

    fn shape(&self) -> Shape<'_> {
        Shape { mesh: &self.shells.mesh, topology: &self.topology, embedding: Some(&self.embedding) }
    }

    /// Vertices of the body all over it, as anchors.
    fn anchors(&self) -> Vec<SurfacePoint> {
        let body = &self.shells.vertices[0];
        body.clone()
            .step_by(37)
            .map(|v| vertex_point(&self.shells.mesh, &self.topology, v as u32, "anchor").unwrap())
            .collect()
    }
}

/// The parts of the target go where they belong on the source, each as a whole.
fn follow(source: &Side, target: &Side, has_parts: bool) {
    let anchors = AnchorPairs { source: source.anchors(), target: target.anchors() };
    let notes = anchors
        .check((&source.shells.mesh, &source.topology), (&target.shells.mesh, &target.topology))
        .unwrap()
        .join("\n");
    for (v, f) in target.shells.vertices.iter().zip(&target.shells.faces).skip(1) {
        let name = format!("from face {} on ({} vertices)", f.start, v.len());
        assert!(notes.contains(&name), "{name}: {notes}");
    }
    let (mesh, topology) = (&source.shells.mesh, &source.topology);
    for method in METHODS {
        for precision in [Precision::Double, Precision::Single] {
            let options = CorrespondenceOptions { method, precision, ..CorrespondenceOptions::default() };
            let map = correspondence(source.shape(), target.shape(), &anchors, &options).unwrap();
            let found = vertex_map((mesh, topology), (&target.shells.mesh, &target.topology), map.as_ref()).unwrap();
            let body = target.shells.vertices[0].clone();
            let valid = body.clone().filter(|&v| found.images[v].status() == Status::Valid).count();
            assert!(valid * 10 > body.len() * 8, "{method:?}: {valid} of {} valid", body.len());
            for (k, part) in target.shells.vertices.iter().enumerate().skip(1) {
                let images: Vec<DVec3> = part.clone().map(|v| found.positions[v].unwrap()).collect();
                let centre = images.iter().sum::<DVec3>() / images.len() as f64;
                let own = part.clone().map(|v| target.shells.mesh.positions[v]).sum::<DVec3>() / part.len() as f64;
                let radius = part.clone().map(|v| target.shells.mesh.positions[v].distance(own)).fold(0.0, f64::max);
                for (v, p) in part.clone().zip(&images) {
                    let image = found.images[v];
                    assert_eq!(image.status(), Status::Doubtful, "{method:?}, part {k}");
                    assert!(image.confidence < 0.5);
                    // On the part of the source that plays its role; without it on one patch of the
                    // body.
                    let wanted = if has_parts { k } else { 0 };
                    assert!(source.shells.faces[wanted].contains(&image.face), "{method:?}, part {k}: {image:?}");
                    let there = elsewhere(target.shells.mesh.positions[v]);
                    let most = if has_parts { 0.5 } else { 2.0 } * SCALE * radius;
                    assert!(p.distance(there) < most + 0.3 * SCALE, "{method:?}, part {k}: {p} {there}");
                    assert!(p.distance(centre) <= 2.0 * SCALE * radius, "{method:?}, part {k} scatters");
                }
                // Neighbours stay neighbours, between vertices as well.
                for t in target.shells.faces[k].clone() {
                    let v = target.topology.triangles[t as usize];
                    let p = v.map(|v| target.shells.mesh.positions[v as usize]);
                    let longest = [0, 1, 2].map(|i| p[i].distance(p[(i + 1) % 3])).into_iter().fold(0.0, f64::max);
                    let mut inside = Vec::new();
                    map.map(&[PackedPoint { face: t, b0: 0.3, b1: 0.3 }], &mut inside).unwrap();
                    let middle = inside[0].point().unwrap().position(mesh);
                    for v in v {
                        let d = found.positions[v as usize].unwrap().distance(middle);
                        assert!(d <= 3.0 * SCALE * longest, "{method:?}, part {k}, triangle {t}: {d} {longest}");
                    }
                }
                if has_parts {
                    // The image is not collapsed: it covers the part.
                    let size = images.iter().map(|p| p.distance(centre)).fold(0.0, f64::max);
                    assert!(size > 0.6 * SCALE * radius, "{method:?}, part {k}: {size} of {}", SCALE * radius);
                }
            }
        }
    }
}

#[test]
fn parts_without_anchors_go_to_the_parts_that_play_their_role() {
    let target = Side::new(character(0.25, 1.0, true));
    let mut shells = character(0.3, 1.2, true);
    shells.mesh.positions.iter_mut().for_each(|p| *p = elsewhere(*p));
    follow(&Side::new(shells), &target, true);
}

#[test]
fn parts_that_the_source_lacks_go_to_one_patch_beside_them() {
    let target = Side::new(character(0.25, 1.0, true));
    let mut shells = character(0.3, 1.0, false);
    shells.mesh.positions.iter_mut().for_each(|p| *p = elsewhere(*p));
    follow(&Side::new(shells), &target, false);
}

#[test]
fn a_map_of_one_part_is_the_same_whatever_lies_beside_it() {
    // Anchors on all parts: nothing follows; and points of the body do not depend on parts without
    // anchors.
    let (with, without) = (Side::new(character(0.25, 1.0, true)), Side::new(character(0.25, 1.0, false)));
    let source = Side::new(character(0.3, 1.0, false));
    let anchors = |side: &Side| AnchorPairs { source: source.anchors(), target: side.anchors() };
    for method in [Method::Rbf, Method::Closest] {
        let options = CorrespondenceOptions { method, ..CorrespondenceOptions::default() };
        let images = |side: &Side| {
            let map = correspondence(source.shape(), side.shape(), &anchors(side), &options).unwrap();
            let sides = ((&source.shells.mesh, &source.topology), (&side.shells.mesh, &side.topology));
            vertex_map(sides.0, sides.1, map.as_ref()).unwrap().images
        };
        let (a, b) = (images(&with), images(&without));
        let mesh = &source.shells.mesh;
        for (v, (a, b)) in a.iter().zip(&b).enumerate() {
            let at = |i: &PackedImage| i.point().unwrap().position(mesh);
            // Up to rounding in the frame of the whole mesh; images are packed in single precision.
            assert!(at(a).distance(at(b)) < 1e-6 && a.status == b.status, "{method:?}, {v}: {a:?} {b:?}");
        }
    }
}

#[test]
fn what_is_turned_over_is_doubtful_by_every_method() {
    // A body bent back onto itself, with few anchors: spatial maps fold.
    let mut source = lobed_sphere(4, 0.25);
    source.positions.iter_mut().for_each(|p| p.x *= 6.0);
    let mut target = source.clone();
    for p in &mut target.positions {
        let (sin, cos) = (p.x * std::f64::consts::PI / 12.0).sin_cos();
        *p = DVec3::new((3.8 + p.y) * sin, (3.8 + p.y) * cos, p.z);
    }
    let side = |mesh: Mesh| {
        let all = 0..mesh.vertex_count();
        let faces = 0..mesh.triangle_count() as u32;
        Side::new(Shells { mesh, vertices: vec![all], faces: vec![faces] })
    };
    let (source, target) = (side(source), side(target));
    let some = |s: &Side| s.anchors().into_iter().step_by(6).collect::<Vec<_>>();
    let anchors = AnchorPairs { source: some(&source), target: some(&target) };
    let mut turned = Vec::new();
    for method in METHODS {
        let options = CorrespondenceOptions { method, ..CorrespondenceOptions::default() };
        let map = correspondence(source.shape(), target.shape(), &anchors, &options).unwrap();
        let (mesh, topology) = (&source.shells.mesh, &source.topology);
        let found = vertex_map((mesh, topology), (&target.shells.mesh, &target.topology), map.as_ref()).unwrap();
        let of_source = vertex_normals(mesh, topology);
        let normals: Vec<DVec3> =
            found.images.iter().map(|i| i.point().map_or(DVec3::ZERO, |p| normal_at(mesh, &of_source, &p))).collect();
        // Whether a collapsed triangle is turned over is for rounding to say.
        let area = |t: u32| {
            let [a, b, c] = target.topology.triangles[t as usize].map(|v| found.positions[v as usize].unwrap());
            (b - a).cross(c - a).length()
        };
        let (over, collapsed): (Vec<u32>, Vec<u32>) =
            flipped(&target.shells.mesh, &target.topology, &found.positions, &normals)
                .into_iter()
                .chain((0..target.topology.triangles.len() as u32).filter(|&t| area(t) <= 1e-12))
                .partition(|&t| area(t) > 1e-12);
        assert!(found.distortion.flipped_faces.abs_diff(over.len()) <= collapsed.len());
        turned.push(over.len());
        let points: Vec<PackedPoint> = over.iter().map(|&face| PackedPoint { face, b0: 0.2, b1: 0.5 }).collect();
        let mut inside = Vec::new();
        map.map(&points, &mut inside).unwrap();
        assert!(inside.iter().all(|i| i.status() != Status::Valid && i.confidence < 0.5), "{method:?}");
        for v in over.iter().flat_map(|&t| target.topology.triangles[t as usize]) {
            assert_ne!(found.images[v as usize].status(), Status::Valid, "{method:?}, vertex {v}");
        }
        // What is not turned over and not beside it is as the method has it: spatial ones claim all
        // of it.
        if matches!(method, Method::Rbf | Method::Closest) {
            let mut beside = vec![false; target.shells.mesh.vertex_count()];
            let mut unclear = beside.clone();
            let corners = |faces: &[u32], of: &mut [bool]| {
                faces.iter().flat_map(|&t| target.topology.triangles[t as usize]).for_each(|v| of[v as usize] = true);
            };
            corners(&over, &mut beside);
            corners(&collapsed, &mut unclear);
            let claimed = |v: usize| found.images[v].status() == Status::Valid;
            assert!((0..beside.len()).all(|v| claimed(v) != beside[v] || (unclear[v] && !beside[v])));
            assert!(found.valid_fraction < 1.0 - found.distortion.flipped_area);
        }
        let sure = CorrespondenceOptions { confidence: false, ..options };
        let map = correspondence(source.shape(), target.shape(), &anchors, &sure).unwrap();
        map.map(&points, &mut inside).unwrap();
        assert!(inside.iter().all(|i| i.status() != Status::Doubtful), "without checks nothing is doubted");
    }
    assert!(turned[3] > 100 && turned[4] > 100, "{turned:?}");
}
