//! A pair of shapes moved, scaled and turned, and how the maps between them differ.
#![allow(dead_code, reason = "each test program uses a part of this")]

use barymap::engine::Engine;
use barymap::geometry::{ClosestPoints, Mesh, SurfacePoint, Topology};
use barymap::models::shapes::{icosphere, uv_sphere};
use barymap::progress::Quiet;
use barymap::surface::anchors::vertex_point;
use barymap::surface::correspondence::{CorrespondenceOptions, Method, Precision, Shape, correspondence};
use barymap::surface::gpu::correspondence_on;
use barymap::surface::{AnchorPairs, Embedding, EmbeddingOptions, PackedImage, PackedPoint, Status};
use glam::{DQuat, DVec3};

/// Coordinates are multiples of this: then shifts by whole numbers up to 2^24 round nothing.
const GRID: f64 = 1.0 / (1 << 20) as f64;

/// Turned, then shifted, then scaled.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    pub(crate) turn: DQuat,
    pub(crate) shift: DVec3,
    pub(crate) scale: f64,
}

impl Motion {
    pub(crate) const NONE: Self = Self { turn: DQuat::IDENTITY, shift: DVec3::ZERO, scale: 1.0 };

    pub(crate) fn shift(x: f64, y: f64, z: f64) -> Self {
        Self { shift: DVec3::new(x, y, z), ..Self::NONE }
    }

    pub(crate) fn scale(scale: f64) -> Self {
        Self { scale, ..Self::NONE }
    }

    pub(crate) fn turn(axis: DVec3, degrees: f64) -> Self {
        Self { turn: DQuat::from_axis_angle(axis.normalize(), degrees.to_radians()), ..Self::NONE }
    }

    pub(crate) fn point(&self, p: DVec3) -> DVec3 {
        let turned = if self.turn == DQuat::IDENTITY { p } else { self.turn * p };
        (turned + self.shift) * self.scale
    }

    pub(crate) fn mesh(&self, mesh: &Mesh) -> Mesh {
        let mut moved = mesh.clone();
        moved.positions.iter_mut().for_each(|p| *p = self.point(*p));
        moved
    }

    /// By how much coordinates of a shape of size 1 round, in parts of an edge.
    pub(crate) fn rounding(&self, edge: f64) -> f64 {
        f64::EPSILON * (1.0 + self.shift.abs().max_element()) / edge
    }
}

/// One side of a pair, ready to be mapped.
pub(crate) struct Side {
    pub(crate) mesh: Mesh,
    pub(crate) topology: Topology,
    pub(crate) embedding: Embedding,
}

impl Side {
    pub(crate) fn new(mesh: Mesh) -> Self {
        let topology = Topology::new(&mesh);
        // The small shapes are simplified, too.
        let landmarks = (mesh.vertex_count() / 6).min(400);
        let options = EmbeddingOptions { landmarks, mid_level: 3 * landmarks, ..EmbeddingOptions::default() };
        let embedding = Embedding::compute(&mesh, &topology, &options, &Quiet).unwrap();
        Self { mesh, topology, embedding }
    }

    pub(crate) fn shape(&self) -> Shape<'_> {
        Shape { mesh: &self.mesh, topology: &self.topology, embedding: Some(&self.embedding) }
    }
}

/// Two shapes of other connectivity without any symmetry, and anchors.
pub(crate) struct Pair {
    pub(crate) source: Side,
    pub(crate) target: Side,
    pub(crate) anchors: AnchorPairs,
}

/// A lopsided potato: `bend` makes two of them different.
fn potato(d: DVec3, bend: f64) -> DVec3 {
    let r = 1.0 + 0.25 * d.x * d.y + 0.2 * d.z * d.z * d.z + 0.15 * (2.0 * d.x + 0.4).sin();
    let p = d * r;
    let p = DVec3::new(p.x, 1.4 * p.y + bend * p.x * p.x, p.z + bend * 0.5 * p.y);
    // On the grid, the larger of them about 1 across.
    (p * 0.3 / GRID).round() * GRID
}

/// A pair at rest: 642 and 566 vertices, 24 anchors, some of them inside triangles; and for every
/// vertex of the target its true place on the source.
pub(crate) struct Rest {
    pub(crate) source: Mesh,
    pub(crate) target: Mesh,
    pub(crate) anchors: AnchorPairs,
    pub(crate) truth: Vec<SurfacePoint>,
}

pub(crate) fn at_rest() -> Rest {
    let shaped = |mesh: &Mesh, bend: f64| {
        let mut mesh = mesh.clone();
        mesh.positions.iter_mut().for_each(|p| *p = potato(p.normalize(), bend));
        mesh
    };
    let (ball, globe) = (icosphere(1.0, 3), uv_sphere(1.0, 28, 20));
    let closest = ClosestPoints::new(&ball, &Topology::new(&ball));
    let truth: Vec<SurfacePoint> = globe.positions.iter().map(|p| closest.nearest(*p).unwrap().0).collect();
    let (source, target) = (shaped(&ball, 0.0), shaped(&globe, 0.25));
    let around = Topology::new(&target);
    let mut anchors = AnchorPairs::default();
    for i in 0..24u32 {
        let v = (i * 229 + 17) % target.vertex_count() as u32;
        anchors.target.push(vertex_point(&target, &around, v, "anchor").unwrap());
        anchors.source.push(truth[v as usize]);
    }
    Rest { source, target, anchors, truth }
}

/// The same of another size, whose coordinates round with every shift.
pub(crate) fn off_the_grid() -> Rest {
    let mut rest = at_rest();
    for mesh in [&mut rest.source, &mut rest.target] {
        mesh.positions.iter_mut().for_each(|p| *p *= 1.1 / 3.0);
    }
    rest
}

/// Coordinates rounded to the grid.
pub(crate) fn snapped(mut mesh: Mesh) -> Mesh {
    mesh.positions.iter_mut().for_each(|p| *p = (*p / GRID).round() * GRID);
    mesh
}

impl Pair {
    /// The pair at rest with each side moved in its way.
    pub(crate) fn moved(source: &Motion, target: &Motion) -> Self {
        Self::of(at_rest(), source, target)
    }

    /// A pair with each side moved in its way.
    pub(crate) fn of(rest: Rest, source: &Motion, target: &Motion) -> Self {
        Self {
            source: Side::new(source.mesh(&rest.source)),
            target: Side::new(target.mesh(&rest.target)),
            anchors: rest.anchors,
        }
    }

    fn points(&self) -> Vec<PackedPoint> {
        let vertices = (0..self.target.mesh.vertex_count() as u32).filter_map(|v| self.target.topology.vertex_point(v));
        let inner = (0..self.target.mesh.triangle_count() as u32)
            .filter(|t| self.target.topology.usable[*t as usize])
            .map(|t| SurfacePoint::new(t, [0.5, 0.25, 0.25]));
        vertices.chain(inner).map(PackedPoint::from).collect()
    }

    /// The images of all vertices and of a point of every triangle.
    pub(crate) fn map(&self, way: &Way, on: Option<&Engine>) -> Vec<PackedImage> {
        let (source, target) = (self.source.shape(), self.target.shape());
        let options = CorrespondenceOptions {
            method: way.method,
            relax: way.relax,
            precision: if way.double { Precision::Double } else { Precision::Single },
            ..CorrespondenceOptions::default()
        };
        let map = match on {
            None => correspondence(source, target, &self.anchors, &options).unwrap(),
            Some(engine) => correspondence_on(engine, source, target, &self.anchors, &options).unwrap().0,
        };
        let mut images = Vec::new();
        map.map(&self.points(), &mut images).unwrap();
        images
    }
}

/// A method with its options.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Way {
    pub(crate) method: Method,
    pub(crate) relax: Option<bool>,
    pub(crate) double: bool,
}

/// Every method with its options.
pub(crate) fn ways(double: bool) -> Vec<Way> {
    [
        (Method::Averages, None),
        (Method::Transport, None),
        (Method::Field, None),
        (Method::Field, Some(false)),
        (Method::Rbf, None),
        (Method::Rbf, Some(true)),
        (Method::Closest, None),
    ]
    .map(|(method, relax)| Way { method, relax, double })
    .to_vec()
}

/// How two maps of the same points differ.
#[derive(Debug)]
pub(crate) struct Difference {
    /// Distances of images on the source at rest, in mean edges, rising; infinite where only one
    /// map has an image.
    pub(crate) distances: Vec<f64>,
    /// Points with another status.
    pub(crate) statuses: usize,
}

impl Difference {
    pub(crate) fn quantile(&self, q: f64) -> f64 {
        self.distances[((self.distances.len() - 1) as f64 * q) as usize]
    }
}

/// The images of one map beside those of another, both placed on `source` at rest.
pub(crate) fn difference(a: &[PackedImage], b: &[PackedImage], source: &Mesh) -> Difference {
    assert_eq!(a.len(), b.len());
    let edge = source.mean_edge_length();
    let off = |(a, b): (&PackedImage, &PackedImage)| match (a.point(), b.point()) {
        (Some(p), Some(q)) => p.position(source).distance(q.position(source)) / edge,
        (None, None) => 0.0,
        _ => f64::INFINITY,
    };
    let mut distances: Vec<f64> = a.iter().zip(b).map(off).collect();
    distances.sort_by(f64::total_cmp);
    Difference { distances, statuses: a.iter().zip(b).filter(|(a, b)| a.status != b.status).count() }
}

/// Share of the points that are valid.
pub(crate) fn valid(images: &[PackedImage]) -> f64 {
    images.iter().filter(|i| i.status() == Status::Valid).count() as f64 / images.len() as f64
}

/// Motions that change no bit of local coordinates.
pub(crate) fn exact() -> Vec<Motion> {
    vec![
        Motion::shift(1000.0, -2000.0, 500.0),
        Motion::shift(-1e5, 3.0, 1e5),
        Motion::shift(1e7, -9e6, 1.0),
        Motion::shift(500_000.0, 4_600_000.0, 300.0),
        Motion::scale(2f64.powi(-20)),
        Motion::scale(2f64.powi(20)),
        Motion { scale: 2f64.powi(-13), ..Motion::shift(1e6, 1e6, 1e6) },
    ]
}

/// Each side alone, then both.
pub(crate) fn sides(motion: Motion) -> [(Motion, Motion); 3] {
    [(motion, Motion::NONE), (Motion::NONE, motion), (motion, motion)]
}
