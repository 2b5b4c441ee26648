//! Property 1 of Panozzo et al. 2013, section 3.2: a point of the surface is its own Phong
//! projection; next to vertices and edges too, where Psi has its pole or two triangles meet.
//!
//! Lengths are in mean edges of the embedded surface.

use barymap::engine::Real;
use barymap::geometry::{Mesh, NONE, SurfacePoint, Topology};
use barymap::models::shapes::{Diagonal, Random, irregular_plane, lobed_sphere};
use barymap::progress::Quiet;
use barymap::surface::correspondence::{CorrespondenceOptions, Method, Precision, Shape, correspondence};
use barymap::surface::project::SearchLimits;
use barymap::surface::psi::slack;
use barymap::surface::single::WeightedPoints;
use barymap::surface::vector::{Vector, distance_squared};
use barymap::surface::{
    AnchorPairs, Embedding, EmbeddingOptions, NearestVertex, PackedPoint, PhongSurface, Sampling, Status,
};

use crate::common::load;

/// Barycentric distances from a vertex or an edge.
const DISTANCES: [f64; 12] = [0.0, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2];

struct Body {
    mesh: Mesh,
    topology: Topology,
    embedding: Embedding,
}

impl Body {
    fn new(mesh: Mesh, landmarks: usize) -> Self {
        let topology = Topology::new(&mesh);
        let options = EmbeddingOptions { landmarks, sampling: Sampling::FarthestPoint, ..EmbeddingOptions::default() };
        let embedding = Embedding::compute(&mesh, &topology, &options, &Quiet).unwrap();
        Self { mesh, topology, embedding }
    }

    fn shape(&self) -> Shape<'_> {
        Shape { mesh: &self.mesh, topology: &self.topology, embedding: Some(&self.embedding) }
    }

    fn surface(&self) -> PhongSurface<f64, 8> {
        PhongSurface::new(&self.topology, &self.embedding.points).unwrap()
    }

    /// `n` points at this distance from a vertex, then as many from an edge; every tenth on the
    /// line to a corner.
    fn points(&self, distance: f64, n: usize, random: &mut Random) -> Vec<SurfacePoint> {
        let usable: Vec<u32> =
            (0..self.mesh.triangle_count() as u32).filter(|&t| self.topology.usable[t as usize]).collect();
        (0..2 * n)
            .map(|i| {
                let face = usable[(random.unit() * usable.len() as f64) as usize];
                let k = (random.unit() * 3.0) as usize;
                let part = if i % 10 == 0 { 0.0 } else { random.unit() };
                let beyond = if i < n { distance } else { 1.0 - distance };
                let mut x = [0.0; 3];
                x[(k + 1) % 3] = beyond * part;
                x[(k + 2) % 3] = beyond * (1.0 - part);
                x[k] = if i < n { 1.0 - distance } else { distance };
                SurfacePoint::new(face, x)
            })
            .collect()
    }
}

/// How far the projection of a point of the surface may be off where it was found in triangle
/// `face`: a root outside it by the slack is moved onto its border, which takes it no farther than
/// twice that part of its longest edge; and coordinates, the largest `largest`, are rounded in the
/// surface, the point and the sum over D of them.
fn tolerance<S: Real>(surface: &PhongSurface<f64, 8>, largest: f64, face: u32) -> f64 {
    let v = surface.triangles[face as usize].v.map(|v| surface.vertices[v as usize].y);
    let longest = [0, 1, 2].map(|k| distance_squared(&v[k], &v[(k + 1) % 3]).sqrt()).into_iter().fold(0.0, f64::max);
    2.0 * slack::<S>().to_f64() * longest + 2.0 * 8f64.sqrt() * S::EPSILON.to_f64() * largest
}

/// The largest coordinate of a surface.
fn largest(surface: &PhongSurface<f64, 8>) -> f64 {
    surface.vertices.iter().flat_map(|v| v.y).fold(0.0, |m: f64, x| m.max(x.abs()))
}

/// Where a search starts: at the triangle itself, at the one across an edge, at the nearest vertex
/// of all. Where a surface is crumpled, another part of it comes nearer to a point than the corners
/// of its triangle, and a search that begins there may stay there: then only the first is sure.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Start {
    Itself,
    Beside,
    Nearest,
}

/// The points that are not found: how far off, in mean edges, and in words.
fn missed<S: Real>(body: &Body, n: usize, from: &[Start]) -> Vec<(f64, String)> {
    let surface = body.surface();
    let rounded: PhongSurface<S, 8> = surface.cast();
    let nearest = NearestVertex::new(&surface);
    let largest = largest(&surface);
    let mut random = Random::new(17);
    let mut missed = Vec::new();
    for distance in DISTANCES {
        for p in body.points(distance, n, &mut random) {
            let y = surface.embed(&p);
            let mean: Vector<S, 8> = y.map(S::of);
            for &from in from {
                let beside = surface.triangles[p.face as usize].neighbours.into_iter().find(|&t| t != NONE);
                let found = match from {
                    Start::Itself => rounded.project_near(&mean, p.face, &surface.triangles[p.face as usize].v),
                    Start::Beside => {
                        let t = beside.unwrap_or(p.face);
                        rounded.project_near(&mean, t, &surface.triangles[t as usize].v)
                    }
                    Start::Nearest => rounded.project(&mean, &[nearest.find(&y)], SearchLimits::FIRST),
                };
                let there = surface.triangle(found.face).point(&found.x.map(|x| x.to_f64()));
                let off = distance_squared(&there, &y).sqrt();
                if !(off <= tolerance::<S>(&surface, largest, found.face)) {
                    let what = format!("{distance:.0e}, {from:?}: {p:?} goes to {found:?}, {off:.1e} away");
                    missed.push((off, what));
                }
            }
        }
    }
    missed
}

/// The averages of single anchors: their own places.
fn averages(body: &Body, n: usize) -> Vec<String> {
    let surface = body.surface();
    let largest = largest(&surface);
    let mut random = Random::new(19);
    let mut missed = Vec::new();
    for distance in DISTANCES {
        let points = body.points(distance, n, &mut random);
        let solver = WeightedPoints::new(body.shape(), &points).unwrap();
        let row = |i: usize| (0..points.len()).map(|k| f64::from(u8::from(k == i))).collect();
        let rows: Vec<Vec<f64>> = (0..points.len()).map(row).collect();
        for (p, q) in points.iter().zip(solver.averages(&rows).unwrap()) {
            let off = distance_squared(&surface.embed(p), &surface.embed(&q.point)).sqrt();
            if !q.found || !(off <= tolerance::<f64>(&surface, largest, q.point.face)) {
                missed.push(format!("{distance:.0e}: {p:?} goes to {q:?}, {off:.1e} away"));
            }
        }
    }
    missed
}

#[test]
fn points_next_to_vertices_and_edges_are_their_own_projections() {
    use Start::{Beside, Itself, Nearest};
    for mesh in [lobed_sphere(3, 0.3), irregular_plane(20, 15, 3.0, 2.0, Diagonal::Alternating, 0.4, 5)] {
        let body = Body::new(mesh, 200);
        let all = [Itself, Beside, Nearest];
        assert_eq!(missed::<f64>(&body, 100, &all), vec![], "{}", body.mesh.name);
        assert_eq!(missed::<f32>(&body, 100, &all), vec![], "{}", body.mesh.name);
        assert_eq!(averages(&body, 50), Vec::<String>::new());
    }
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn points_of_real_meshes_are_their_own_projections() {
    use Start::Itself;
    for file in [
        "textured/human_male/human_male.obj",
        "mesh/horse_8k.obj",
        "mesh/cat_16k.obj",
        "mesh/fertility_9k.obj",
        "mesh/alligator_6k.obj",
    ] {
        let body = Body::new(load(file), 1000);
        assert_eq!(missed::<f64>(&body, 100, &[Itself]), vec![], "{file}");
        // In single precision the edges of a few triangles of a hundredth of an edge fall between
        // two triangles; the search finds the root beside them, no farther away than they are long.
        let single = missed::<f32>(&body, 100, &[Itself]);
        assert!(single.len() <= 2 && single.iter().all(|(off, _)| *off <= 0.01), "{file}: {single:?}");
        assert_eq!(averages(&body, 100), Vec::<String>::new(), "{file}");
    }
}

/// Anchors next to vertices go to their partners by every method that interpolates them, in both
/// precisions.
fn anchors_return(source: &Body, target: &Body, faces: &[u32]) {
    let mut random = Random::new(23);
    for (i, distance) in [1e-9, 1e-6, 1e-4, 1e-3].into_iter().enumerate() {
        let points: Vec<SurfacePoint> = faces
            .iter()
            .map(|&face| {
                let u = random.unit();
                let mut x = [distance * u, distance * (1.0 - u), 1.0 - distance];
                x.rotate_left(i % 3);
                SurfacePoint::new(face, x)
            })
            .collect();
        let anchors = AnchorPairs { source: points.clone(), target: points.clone() };
        let packed: Vec<PackedPoint> = points.iter().map(|&p| p.into()).collect();
        let surface = source.surface();
        let largest = largest(&surface);
        for method in [Method::Averages, Method::Transport, Method::Field] {
            for precision in [Precision::Double, Precision::Single] {
                let options = CorrespondenceOptions { method, precision, ..CorrespondenceOptions::default() };
                let map = correspondence(source.shape(), target.shape(), &anchors, &options).unwrap();
                let mut images = Vec::new();
                map.map(&packed, &mut images).unwrap();
                for (p, image) in points.iter().zip(&images) {
                    let q = image.point().unwrap();
                    let off = distance_squared(&surface.embed(p), &surface.embed(&q)).sqrt();
                    // Points are packed in single precision; the relaxation of a field gives way by
                    // 1e-4 of an edge.
                    let most = 2e-4 + tolerance::<f32>(&surface, largest, q.face);
                    assert!(
                        off <= most,
                        "{method:?} {precision:?} {distance:.0e}: {p:?} goes to {image:?}, {off:.1e} away"
                    );
                    assert_ne!(image.status(), Status::Failed);
                }
            }
        }
    }
}

#[test]
fn anchors_next_to_vertices_go_to_their_partners() {
    let (source, target) = (Body::new(lobed_sphere(3, 0.2), 200), Body::new(lobed_sphere(3, 0.3), 200));
    let faces: Vec<u32> = (0..source.mesh.triangle_count() as u32).step_by(31).collect();
    anchors_return(&source, &target, &faces);
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn anchors_next_to_vertices_of_real_meshes_go_to_their_partners() {
    let (source, target) =
        (Body::new(load("gt/smpl_same/man.obj"), 1000), Body::new(load("gt/smpl_same/woman.obj"), 1000));
    let count = source.mesh.triangle_count();
    let faces: Vec<u32> = (0..93).map(|i| ((i * count) / 93) as u32).collect();
    anchors_return(&source, &target, &faces);
}
