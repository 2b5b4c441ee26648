//! An embedded mesh with tangent planes, ready for projections.

use std::sync::Arc;

use crate::engine::Real;
use crate::error::{Error, Result};
use crate::geometry::{SurfacePoint, Topology};

use super::gauge::gauge;
use super::long_fans::LongFans;
use super::psi::{Orthogonal2, TangentTriangle};
use super::search::TriangleBound;
use super::tangents::vertex_tangents;
use super::vector::{Vector, cast};

/// A vertex: its point in R^D and an orthonormal basis of its tangent plane.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Vertex<S, const D: usize> {
    /// The point, centred and scaled.
    pub y: Vector<S, D>,
    /// The two rows of the basis.
    pub t: [Vector<S, D>; 2],
}

/// A triangle: its vertices, its neighbours and the matrices `G_k` of its tangent planes.
#[derive(Clone, Copy, Debug)]
pub struct Triangle<S> {
    /// Vertices.
    pub v: [u32; 3],
    /// Triangle across the edge opposite to each corner, or [`crate::geometry::NONE`].
    pub neighbours: [u32; 3],
    /// `G_k` (see [`super::psi`]).
    pub gauge: [Orthogonal2<S>; 6],
}

/// A triangle mesh in R^D with interpolated tangent planes (paper, section 3.2).
///
/// Points are centred and divided by the mean embedded edge length in double precision before they
/// are rounded to `S`, so that every length inside is in mean edges and single precision is used
/// fully.
#[derive(Clone, Debug)]
pub struct PhongSurface<S, const D: usize> {
    /// Vertices, one per vertex of the mesh; unused ones lie at the centre.
    pub vertices: Vec<Vertex<S, D>>,
    /// Triangles, one per triangle of the mesh.
    pub triangles: Vec<Triangle<S>>,
    /// Whether a triangle can be the result of a projection.
    pub usable: Vec<bool>,
    /// For each triangle what rules out projections on it at once.
    pub bounds: Vec<TriangleBound<S, D>>,
    ring_start: Vec<u32>,
    ring: Vec<u32>,
    fan_start: Vec<u32>,
    fan: Vec<u32>,
    /// Fans too long to look through for each projection.
    pub(super) long: Arc<LongFans<D>>,
    /// What was subtracted from embedded points.
    pub centre: Vector<f64, D>,
    /// Mean embedded edge length, by which points were divided.
    pub edge: f64,
}

impl<S: Real, const D: usize> PhongSurface<S, D> {
    /// The surface of an embedding: `points` has one row of `D` numbers per vertex, NaN where
    /// unused. O(F D).
    ///
    /// # Errors
    /// If there is not one row a vertex, a used vertex has a point that is not finite, or no
    /// triangle is usable.
    pub fn new(topology: &Topology, points: &[f64]) -> Result<Self> {
        let n = topology.vertex_count();
        if points.len() != n * D {
            let what = format!("the embedding has {} numbers, not {D} for each of {n} vertices", points.len());
            return Err(Error::input(what, "Embed this mesh"));
        }
        let used = |v: usize| !topology.vertex_triangles(v as u32).is_empty();
        let row = |v: usize| -> Vector<f64, D> { std::array::from_fn(|i| points[v * D + i]) };
        if let Some(v) = (0..n).find(|&v| used(v) && row(v).iter().any(|x| !x.is_finite())) {
            return Err(Error::numeric(
                format!("the embedding of vertex {v} is not finite"),
                "Check the mesh for extremely thin triangles around it",
            ));
        }
        let count = (0..n).filter(|&v| used(v)).count();
        if count == 0 {
            return Err(Error::input("the mesh has no usable triangle", "Give a mesh with triangles of positive area"));
        }
        let mut centre = [0.0; D];
        for v in (0..n).filter(|&v| used(v)) {
            for (c, x) in centre.iter_mut().zip(row(v)) {
                *c += x / count as f64;
            }
        }
        let centred: Vec<Vector<f64, D>> = (0..n)
            .map(|v| if used(v) { std::array::from_fn(|i| points[v * D + i] - centre[i]) } else { [0.0; D] })
            .collect();
        let (mut sum, mut edges) = (0.0, 0usize);
        for (t, tri) in topology.triangles.iter().enumerate().filter(|(t, _)| topology.usable[*t]) {
            let _ = t;
            for k in 0..3 {
                sum += super::vector::distance_squared(&centred[tri[k] as usize], &centred[tri[(k + 1) % 3] as usize])
                    .sqrt();
                edges += 1;
            }
        }
        let edge = sum / edges as f64;
        if !(edge > 0.0 && edge.is_finite()) {
            return Err(Error::numeric(
                "the embedding collapses to a point",
                "Check that the mesh has an extent and its landmarks differ",
            ));
        }
        let scaled: Vec<Vector<f64, D>> = centred.iter().map(|y| y.map(|x| x / edge)).collect();
        let tangents = vertex_tangents(topology, &scaled);
        let triangles: Vec<(Triangle<S>, [Orthogonal2<f64>; 6])> = {
            use rayon::prelude::*;
            (0..topology.triangles.len())
                .into_par_iter()
                .map(|t| {
                    let v = topology.triangles[t];
                    let g = gauge([&tangents[v[0] as usize], &tangents[v[1] as usize], &tangents[v[2] as usize]]);
                    (Triangle { v, neighbours: topology.neighbours[t], gauge: g.map(Orthogonal2::cast) }, g)
                })
                .collect()
        };
        let bounds = {
            use rayon::prelude::*;
            let basis = |v: u32| (&scaled[v as usize], &tangents[v as usize]);
            triangles
                .par_iter()
                .zip(&topology.triangles)
                .map(|(t, v): (&(Triangle<S>, [Orthogonal2<f64>; 6]), _)| {
                    let [a, b, c] = v.map(basis);
                    let triangle = TangentTriangle { v: [a.0, b.0, c.0], t: [a.1, b.1, c.1], gauge: &t.1 };
                    TriangleBound::new(&triangle).cast()
                })
                .collect()
        };
        let triangles = triangles.into_iter().map(|t| t.0).collect();
        let vertices =
            (0..n).map(|v| Vertex { y: cast(&scaled[v]), t: [cast(&tangents[v][0]), cast(&tangents[v][1])] }).collect();
        let (mut ring_start, mut ring) = (vec![0u32], Vec::new());
        let (mut fan_start, mut fan) = (vec![0u32], Vec::new());
        for v in 0..n as u32 {
            let around = topology.vertex_triangles(v);
            let first = ring.len();
            ring.extend(around.iter().flat_map(|&t| topology.triangles[t as usize]).filter(|&w| w != v));
            ring[first..].sort_unstable();
            let mut keep = first;
            for i in first..ring.len() {
                if i == first || ring[i] != ring[keep - 1] {
                    ring[keep] = ring[i];
                    keep += 1;
                }
            }
            ring.truncate(keep);
            ring_start.push(ring.len() as u32);
            fan.extend_from_slice(around);
            fan_start.push(fan.len() as u32);
        }
        let fan_of = |v: u32| &fan[fan_start[v as usize] as usize..fan_start[v as usize + 1] as usize];
        let corners = |t: u32| topology.triangles[t as usize];
        let long = Arc::new(LongFans::new(n, fan_of, corners, |v| (scaled[v as usize], [0.0; 4])));
        Ok(Self {
            vertices,
            triangles,
            usable: topology.usable.clone(),
            bounds,
            ring_start,
            ring,
            fan_start,
            fan,
            long,
            centre,
            edge,
        })
    }

    /// The neighbours of a vertex, ascending.
    #[inline]
    pub fn ring(&self, v: u32) -> &[u32] {
        &self.ring[self.ring_start[v as usize] as usize..self.ring_start[v as usize + 1] as usize]
    }

    /// The usable triangles around a vertex, ascending.
    #[inline]
    pub fn fan(&self, v: u32) -> &[u32] {
        &self.fan[self.fan_start[v as usize] as usize..self.fan_start[v as usize + 1] as usize]
    }

    /// Triangle `t` as a projection needs it.
    #[inline(always)]
    pub fn triangle(&self, t: u32) -> TangentTriangle<'_, S, D> {
        let triangle = &self.triangles[t as usize];
        let [a, b, c] = triangle.v.map(|v| &self.vertices[v as usize]);
        TangentTriangle { v: [&a.y, &b.y, &c.y], t: [&a.t, &b.t, &c.t], gauge: &triangle.gauge }
    }

    /// The embedded point of a surface point, centred and in mean edges.
    pub fn embed(&self, p: &SurfacePoint) -> Vector<S, D> {
        self.triangle(p.face).point(&p.barycentric.map(S::of))
    }

    /// The offsets and entries of all rings, for upload.
    pub fn ring_table(&self) -> (&[u32], &[u32]) {
        (&self.ring_start, &self.ring)
    }

    /// The offsets and entries of all fans, for upload.
    pub fn fan_table(&self) -> (&[u32], &[u32]) {
        (&self.fan_start, &self.fan)
    }

    /// The same surface with other scalars.
    pub fn cast<T: Real>(&self) -> PhongSurface<T, D> {
        PhongSurface {
            vertices: self
                .vertices
                .iter()
                .map(|v| Vertex { y: cast(&v.y), t: [cast(&v.t[0]), cast(&v.t[1])] })
                .collect(),
            triangles: self
                .triangles
                .iter()
                .map(|t| Triangle { v: t.v, neighbours: t.neighbours, gauge: t.gauge.map(Orthogonal2::cast) })
                .collect(),
            usable: self.usable.clone(),
            bounds: self.bounds.iter().map(TriangleBound::cast).collect(),
            ring_start: self.ring_start.clone(),
            ring: self.ring.clone(),
            fan_start: self.fan_start.clone(),
            fan: self.fan.clone(),
            long: self.long.clone(),
            centre: self.centre,
            edge: self.edge,
        }
    }
}
