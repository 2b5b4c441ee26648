//! Normal maps and labels carried between two people of the same connectivity and texture
//! coordinates: the truth is the map itself.

use barymap::geometry::sampling::farthest_points;
use barymap::geometry::tangent_frames::TangentFrames;
use barymap::geometry::{Geodesics, Mesh, Topology};
use barymap::picture::{Depth, Image, Pixels};
use barymap::progress::Quiet;
use barymap::surface::anchors::vertex_point;
use barymap::surface::correspondence::{CorrespondenceOptions, Method, Shape, correspondence};
use barymap::surface::quality::vertex_normals;
use barymap::surface::{AnchorPairs, Embedding, EmbeddingOptions};
use barymap::tools::attributes::{Attribute, AttributeKind, Fill, VertexStatus, transfer_attributes};
use barymap::tools::transfer::{Background, Layer, LayerKind, TransferOptions, coverage, transfer};
use glam::DVec3;

use super::atlas::{rasterize, whole};
use super::whole::{bytes, options};
use crate::common::load;

const SIZE: u32 = 1024;

fn frames(mesh: &Mesh) -> TangentFrames {
    TangentFrames::new(mesh, &vertex_normals(mesh, &Topology::new(mesh)))
}

/// Waves of a sixth of the height with slopes up to a half, as a tangent-space map.
fn waves(mesh: &Mesh) -> Image {
    let frames = frames(mesh);
    let (low, high) = mesh.bounds().expect("vertices");
    let k = std::f64::consts::TAU * 6.0 / (high - low).max_element();
    let directions = [DVec3::new(1.0, 0.3, -0.2), DVec3::new(-0.4, 1.0, 0.5), DVec3::new(0.2, -0.6, 1.0)];
    let mut image = Image::zeros(SIZE, SIZE, 3, Depth::U8).expect("picture");
    for (i, t) in rasterize(mesh, SIZE, SIZE, whole(SIZE, SIZE)).iter().enumerate().filter(|(_, t)| t.is_covered()) {
        let p = t.point().unpack();
        let (x, n) = (p.position(mesh), frames.normal(p.face, p.barycentric));
        let gradient: DVec3 = directions.iter().map(|d| d.normalize()).map(|d| d * 0.2 * (k * d.dot(x)).cos()).sum();
        let normal = n - (gradient - n * n.dot(gradient));
        let v = frames.at(p.face, p.barycentric).to_frame(normal).expect("frame").normalize();
        (0..3).for_each(|c| image.set(i as u32 % SIZE, i as u32 / SIZE, c, (0.5 * v[c as usize] + 0.5) as f32));
    }
    image
}

/// The nearest of `count` vertices far from one another, from 1 on.
fn regions(mesh: &Mesh, count: usize) -> Image {
    let seeds = farthest_points(&Geodesics::new(&mesh.positions, &mesh.triangles()).unwrap(), 0, count);
    let mut labels = vec![0_u8; (SIZE * SIZE) as usize];
    for (i, t) in rasterize(mesh, SIZE, SIZE, whole(SIZE, SIZE)).iter().enumerate().filter(|(_, t)| t.is_covered()) {
        let x = t.point().unpack().position(mesh);
        let distance = |s: u32| mesh.positions[s as usize].distance_squared(x);
        let nearest = (0..count).min_by(|&a, &b| distance(seeds[a]).total_cmp(&distance(seeds[b])));
        labels[i] = nearest.expect("seeds") as u8 + 1;
    }
    Image::new(SIZE, SIZE, 1, Pixels::U8(labels)).expect("picture")
}

/// Smooth weights of bones at vertices far from one another: the four largest, of sum 1.
fn skin(mesh: &Mesh, bones: usize) -> Vec<f64> {
    let seeds = farthest_points(&Geodesics::new(&mesh.positions, &mesh.triangles()).unwrap(), 0, bones);
    let (low, high) = mesh.bounds().expect("vertices");
    let width = 0.07 * (high - low).max_element();
    let rows = mesh.positions.iter().flat_map(|p| {
        let mut row: Vec<f64> =
            seeds.iter().map(|&s| (-0.5 * (mesh.positions[s as usize].distance(*p) / width).powi(2)).exp()).collect();
        let mut sorted = row.clone();
        sorted.sort_by(|a, b| b.total_cmp(a));
        row.iter_mut().filter(|w| **w < sorted[3]).for_each(|w| *w = 0.0);
        let sum: f64 = row.iter().sum();
        row.into_iter().map(move |w| w / sum)
    });
    rows.collect()
}

/// Median angle in degrees, over the surface, between the normals that two maps shade `mesh` with.
fn median_angle(mesh: &Mesh, areas: &[(usize, f64)], points: &[(u32, [f64; 3])], a: &Image, b: &Image) -> f64 {
    let frames = frames(mesh);
    let mut angles: Vec<(f64, f64)> = areas
        .iter()
        .zip(points)
        .map(|(&(i, area), &(face, at))| {
            let frame = frames.at(face, at);
            let shaded = |image: &Image| {
                frame.to_space(DVec3::from_array([0, 1, 2].map(|c| 2.0 * f64::from(image.sample(3 * i + c)) - 1.0)))
            };
            (shaded(a).angle_between(shaded(b)).to_degrees(), area)
        })
        .collect();
    angles.sort_by(|a, b| a.0.total_cmp(&b.0));
    let all: f64 = angles.iter().map(|a| a.1).sum();
    let mut sum = 0.0;
    angles
        .iter()
        .find(|(_, area)| {
            sum += area;
            sum >= 0.5 * all
        })
        .map_or(f64::NAN, |a| a.0)
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn normals_and_labels_of_a_person_on_another() {
    let meshes = ["textured/human_female/human_female.obj", "textured/human_male/human_male.obj"].map(load);
    let [source, target] = &meshes;
    let topologies = [source, target].map(Topology::new);
    let embeddings = [0, 1].map(|k| {
        Embedding::compute(&meshes[k], &topologies[k], &EmbeddingOptions::default(), &Quiet).expect("embedding")
    });
    let vertices = farthest_points(&Geodesics::new(&target.positions, &target.triangles()).unwrap(), 0, 64);
    let of = |k: usize| {
        vertices.iter().map(|&v| vertex_point(&meshes[k], &topologies[k], v, "anchor")).collect::<Result<_, _>>()
    };
    let anchors = AnchorPairs { source: of(0).expect("anchors"), target: of(1).expect("anchors") };
    let shape = |k: usize| Shape { mesh: &meshes[k], topology: &topologies[k], embedding: Some(&embeddings[k]) };
    let method = CorrespondenceOptions { method: Method::Field, ..CorrespondenceOptions::default() };
    let map = correspondence(shape(0), shape(1), &anchors, &method).expect("map");
    let (normals, labels) = (waves(source), regions(source, 8));
    let layers = [
        Layer { kind: LayerKind::tangent_normal(), ..Layer::single("normals", &normals) },
        Layer { kind: LayerKind::Labels, ..Layer::single("labels", &labels) },
    ];
    let options = TransferOptions { background: Background::Color([0.0; 4]), ..options(SIZE, SIZE) };
    let out = transfer(source, &layers, target, map.as_ref(), &options, &Quiet).expect("transfer");
    // Area of the target behind each texel whose centre is covered.
    let (mut areas, mut points) = (Vec::new(), Vec::new());
    for (i, t) in rasterize(target, SIZE, SIZE, whole(SIZE, SIZE)).iter().enumerate() {
        if t.is_centre() && bytes(&out.coverage)[i] >= coverage::DOUBTFUL {
            let face = t.face as usize;
            let [a, b, c] = target.triangle_texcoords(face).expect("texture coordinates");
            areas.push((i, target.triangle_area(face) / (b - a).perp_dot(c - a).abs()));
            points.push((t.face, t.point().unpack().barycentric));
        }
    }
    let all: f64 = areas.iter().map(|a| a.1).sum();
    let (given, got) = (bytes(&labels), bytes(&out.layers[1]));
    let right: f64 = areas.iter().filter(|a| given[a.0] == got[a.0]).map(|a| a.1).sum();
    let angle = median_angle(target, &areas, &points, &out.layers[0], &normals);
    let mut upside_down = out.layers[0].clone();
    for i in 0..SIZE * SIZE {
        let green = upside_down.get(i % SIZE, i / SIZE, 1);
        upside_down.set(i % SIZE, i / SIZE, 1, 1.0 - green);
    }
    let wrong = median_angle(target, &areas, &points, &upside_down, &normals);
    println!(
        "  median angle {angle:.2} degrees (green turned over: {wrong:.1}), labels right on {:.2} % of the area",
        100.0 * right / all
    );
    assert!(angle <= 3.0 && wrong > 2.0 * angle, "{angle} {wrong}");
    assert!(right >= 0.98 * all, "{}", right / all);

    // Weights of 30 bones and the heaviest bone, on the vertices; vertex i is vertex i.
    let weights: Vec<f64> = skin(source, 30);
    let heaviest = |row: &[f64]| (0..30).max_by(|&a, &b| row[a].total_cmp(&row[b])).map_or(f64::NAN, |k| k as f64);
    let bones: Vec<f64> = weights.chunks_exact(30).map(heaviest).collect();
    let given = [
        Attribute { name: "weights".into(), kind: AttributeKind::Weights { keep: 4 }, columns: 30, values: weights },
        Attribute { name: "bones".into(), kind: AttributeKind::Labels, columns: 1, values: bones },
    ];
    let sides = ((source, &topologies[0]), (target, &topologies[1]));
    let out = transfer_attributes(sides.0, sides.1, map.as_ref(), &given, Fill::Smooth).expect("attributes");
    let count = target.vertex_count() as f64;
    let pairs = given[0].values.iter().zip(&out.attributes[0].values);
    let off = pairs.map(|(a, b)| (a - b).abs()).sum::<f64>() / count;
    let same = given[1].values.iter().zip(&out.attributes[1].values).filter(|(a, b)| a == b).count() as f64 / count;
    println!("  weights off by {off:.3} in all, the heaviest bone right at {:.1} % of the vertices", 100.0 * same);
    assert!(off < 0.08 && same > 0.95, "{off} {same}");
    assert_eq!(out.count(VertexStatus::Failed) + out.count(VertexStatus::Doubtful), 0);
}
