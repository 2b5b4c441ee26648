use std::f64::consts::TAU;

use super::*;
use crate::geometry::{Corner, MeshBuilder, NONE};
use crate::models::shapes::{Diagonal, icosphere, plane_grid, torus};
use crate::surface::{Embedding, EmbeddingOptions};

struct Model {
    mesh: Mesh,
    topology: Topology,
    embedding: Embedding,
}

impl Model {
    fn new(mesh: Mesh) -> Self {
        let topology = Topology::new(&mesh);
        let options = EmbeddingOptions { landmarks: 300, ..EmbeddingOptions::default() };
        let embedding = Embedding::compute(&mesh, &topology, &options, &crate::progress::Quiet).unwrap();
        Self { mesh, topology, embedding }
    }

    fn shape(&self) -> Shape<'_> {
        Shape { mesh: &self.mesh, topology: &self.topology, embedding: Some(&self.embedding) }
    }
}

fn quads(positions: Vec<DVec3>, faces: &[Vec<u32>]) -> Mesh {
    let mut builder = MeshBuilder::new("base");
    builder.mesh.positions = positions;
    for f in faces {
        builder.polygon(f.iter().map(|&vertex| Corner { vertex, texcoord: NONE, normal: NONE }));
    }
    builder.finish()
}

fn cube() -> Mesh {
    let positions = (0..8).map(|i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)) * 2.0 - 1.0);
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    quads(positions.collect(), &faces.map(|f| f.to_vec()))
}

/// A ring of `n` by `m` quads about a torus, its rings moved a little along it by turns, so that
/// there is something to smooth.
fn ring(n: u32, m: u32) -> Mesh {
    let at = |i: u32, j: u32| {
        let a = TAU * (f64::from(i) + if i.is_multiple_of(2) { 0.2 } else { -0.2 }) / f64::from(n);
        let b = TAU * f64::from(j) / f64::from(m);
        DVec3::new((1.0 + 0.4 * b.cos()) * a.cos(), (1.0 + 0.4 * b.cos()) * a.sin(), 0.4 * b.sin())
    };
    let index = |i: u32, j: u32| (i % n) * m + j % m;
    let positions = (0..n).flat_map(|i| (0..m).map(move |j| at(i, j))).collect();
    let faces: Vec<Vec<u32>> = (0..n)
        .flat_map(|i| (0..m).map(move |j| vec![index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)]))
        .collect();
    quads(positions, &faces)
}

fn falls(lengths: &[EdgeLengths]) -> bool {
    lengths.windows(2).all(|w| w[1].variance < w[0].variance)
}

#[test]
fn spheres_and_tori_are_remeshed_without_inverted_quads() {
    for (name, surface, base, options) in [
        ("sphere", icosphere(1.0, 4), cube(), RemeshOptions { levels: 3, smooth: 5, ..RemeshOptions::default() }),
        (
            "torus",
            torus(1.0, 0.4, 48, 32, Diagonal::Alternating),
            ring(8, 6),
            RemeshOptions { levels: 2, smooth: 5, ..RemeshOptions::default() },
        ),
    ] {
        let model = Model::new(surface);
        let mut remesher = Remesher::new(model.shape(), &base, &options).unwrap();
        let points = remesher.frame().unwrap().to_vec();
        let report = remesher.report();
        assert_eq!(report.turned, [Turned::default(); 2], "{name}");
        assert_eq!(report.edge_lengths.len(), 6);
        assert!(falls(&report.edge_lengths), "{name}: {:?} {:?}", report.rest_lengths, report.edge_lengths);
        assert!(report.distances.vertices < 1e-14, "{name}: {:?}", report.distances);
        assert!(points.iter().all(|p| p.is_valid(&model.mesh, 0.0)));
        assert_eq!((report.base_others, report.without_projection), (0, 0));
        assert!(report.angles.least > 30.0 && report.angles.most < 150.0, "{name}: {:?}", report.angles);
        let mesh = remesher.mesh();
        assert_eq!((mesh.vertex_count(), mesh.polygon_count()), (report.vertices, report.faces));
        // Again, with one thread.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        assert_eq!(pool.install(|| remesher.frame().unwrap().to_vec()), points, "{name}");
    }
}

#[test]
fn moved_vertices_move_the_mesh_near_them() {
    let model = Model::new(icosphere(1.0, 4));
    let options = RemeshOptions { evenness: Evenness::Fixed(0.0), ..RemeshOptions::default() };
    let mut remesher = Remesher::new(model.shape(), &cube(), &options).unwrap();
    // Before any frame there is the base mesh.
    assert_eq!((remesher.mesh().polygon_count(), remesher.report().faces), (6, 6));
    let before = remesher.frame().unwrap().to_vec();
    let to = ClosestPoints::new(&model.mesh, &model.topology).nearest(DVec3::new(-1.0, -0.5, -1.0)).unwrap().0;
    remesher.move_vertex(0, to).unwrap();
    let after = remesher.frame().unwrap().to_vec();
    let fresh = {
        let mut other = Remesher::new(model.shape(), &cube(), &options).unwrap();
        other.move_vertex(0, to).unwrap();
        other.frame().unwrap().to_vec()
    };
    let distance = |a: &SurfacePoint, b: &SurfacePoint| a.position(&model.mesh).distance(b.position(&model.mesh));
    // Nothing depends on the frame before.
    assert_eq!(after, fresh);
    // The vertex opposite is farther from it than smoothing reaches.
    assert!(distance(&before[0], &after[0]) > 0.1 && distance(&before[7], &after[7]) < 1e-12);
    assert!(remesher.move_vertex(8, to).is_err());
    assert!(remesher.move_vertex(0, SurfacePoint::new(1 << 20, [1.0, 0.0, 0.0])).is_err());
    assert!(remesher.move_vertex(0, SurfacePoint::new(0, [f64::NAN, 0.0, 0.0])).is_err());
}

#[test]
fn measures_see_what_is_wrong() {
    let model = Model::new(plane_grid(12, 12, 1.0, 1.0, Diagonal::Alternating));
    let (low, high) = model.mesh.bounds().unwrap();
    let at = |x: f64, y: f64| {
        let d = high - low;
        low + DVec3::new(d.x * x, d.y * y, d.z * if d.y > 0.0 { 0.0 } else { y })
    };
    let faces = [vec![0, 1, 4, 3], vec![1, 2, 5, 4], vec![3, 4, 7, 6], vec![4, 5, 8, 7]];
    let base = |middle: DVec3| {
        let mut p: Vec<DVec3> =
            (0..9).map(|i| at(0.1 + 0.4 * f64::from(i % 3), 0.1 + 0.4 * f64::from(i / 3))).collect();
        p[4] = middle;
        quads(p, &faces)
    };
    let report = |middle: DVec3, smooth: u32| {
        let options = RemeshOptions { levels: 0, smooth, ..RemeshOptions::default() };
        let mut r = Remesher::new(model.shape(), &base(middle), &options).unwrap();
        r.frame().unwrap();
        r.report()
    };
    let good = report(at(0.5, 0.5), 0);
    assert_eq!(good.turned, [Turned::default(); 2]);
    assert!(good.angles.off_right < 1e-9 && good.edge_lengths[0].variance < 1e-12, "{good:?}");
    assert!(good.distances.surface > 0.05, "the outer tenth is not covered: {:?}", good.distances);
    // The middle vertex beyond a corner turns faces over; smoothing mends it, the boundary stays.
    let bad = report(at(0.98, 0.98), 0);
    assert!(bad.turned[1].inverted >= 1 && bad.turned[1].folded >= 2, "{:?}", bad.turned);
    let mended = report(at(0.98, 0.98), 1);
    assert_eq!((mended.turned[0], mended.turned[1].folded), (bad.turned[1], 0));
    // Oriented the other way as a whole nothing is inverted.
    let mut reversed = faces.clone();
    reversed.iter_mut().for_each(|f| f.reverse());
    let other = quads(base(at(0.5, 0.5)).positions, &reversed);
    let options = RemeshOptions { levels: 1, smooth: 0, ..RemeshOptions::default() };
    let mut r = Remesher::new(model.shape(), &other, &options).unwrap();
    r.frame().unwrap();
    assert_eq!(r.report().turned, [Turned::default(); 2]);
}

#[test]
fn bad_bases_are_named_and_others_than_quads_are_split() {
    let model = Model::new(icosphere(1.0, 3));
    let tetrahedron = crate::models::shapes::tetrahedron();
    let mut r =
        Remesher::new(model.shape(), &tetrahedron, &RemeshOptions { levels: 2, ..RemeshOptions::default() }).unwrap();
    r.frame().unwrap();
    let report = r.report();
    assert_eq!((report.base_others, report.faces), (4, 48));
    assert_eq!(report.turned[1], Turned::default());
    assert!((0..48).all(|p| r.mesh().polygon(p).len() == 4));
    let fails =
        |base: &Mesh, options: RemeshOptions| Remesher::new(model.shape(), base, &options).unwrap_err().to_string();
    let d = RemeshOptions::default();
    assert!(fails(&cube(), RemeshOptions { levels: 40, ..d }).contains("option levels"));
    assert!(fails(&cube(), RemeshOptions { levels: u32::MAX, ..d }).contains("option levels"));
    assert!(fails(&cube(), RemeshOptions { step: f64::NAN, ..d }).contains("option step"));
    assert!(fails(&cube(), RemeshOptions { smooth: u32::MAX, ..d }).contains("option smooth"));
    let mut nan = cube();
    nan.positions[3].y = f64::NAN;
    assert!(fails(&nan, d).contains("vertex 3"));
    assert!(fails(&Mesh::default(), d).contains("no face"));
}

#[test]
fn a_batch_is_what_one_by_one_is_and_the_papers_smoothing_rights_angles() {
    let model = Model::new(torus(1.0, 0.4, 48, 32, Diagonal::Alternating));
    let mut off_right = Vec::new();
    for (smooth, evenness) in [(0, Evenness::Auto), (3, Evenness::Fixed(0.0)), (3, Evenness::Fixed(1.0))] {
        let options = RemeshOptions { levels: 2, smooth, evenness, ..RemeshOptions::default() };
        let mut remesher = Remesher::new(model.shape(), &ring(8, 6), &options).unwrap();
        let points = remesher.frame().unwrap().to_vec();
        assert_eq!(remesher.one_by_one(), points);
        let mut other = points.clone();
        other[5].barycentric.swap(0, 1);
        assert_ne!(remesher.one_by_one(), other);
        off_right.push(remesher.report().angles.off_right);
    }
    assert!(off_right[1] < off_right[0] && off_right[1] < off_right[2], "{off_right:?}");
}

#[test]
fn smoothing_ends_where_no_step_evens_lengths() {
    // A square grid on a plane is even from the beginning.
    let model = Model::new(plane_grid(12, 12, 1.0, 1.0, Diagonal::Alternating));
    let mesh = &model.mesh;
    let at = |i: u32| {
        let (low, high) = mesh.bounds().unwrap();
        let d = (high - low) * 0.25;
        low + d * DVec3::from_array([0, 1, 2].map(|k| {
            let first = if d.x > 0.0 { 0 } else { 1 };
            f64::from(if k == first { 1 + i % 3 } else { 1 + i / 3 })
        }))
    };
    let base =
        quads((0..9).map(at).collect(), &[vec![0, 1, 4, 3], vec![1, 2, 5, 4], vec![3, 4, 7, 6], vec![4, 5, 8, 7]]);
    let options = RemeshOptions { levels: 0, smooth: 4, ..RemeshOptions::default() };
    let mut r = Remesher::new(model.shape(), &base, &options).unwrap();
    r.frame().unwrap();
    let report = r.report();
    assert!(report.edge_lengths.len() <= 5 && falls(&report.edge_lengths), "{:?}", report.edge_lengths);
    assert_eq!(report.edge_lengths.len(), report.rest_lengths.len() + 1);
    assert!(report.edge_lengths[0].variance < 1e-20);
}
