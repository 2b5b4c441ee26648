//! A surface as kernels look it up.

use std::collections::{BTreeSet, HashMap};

use bytemuck::{Pod, Zeroable};

use crate::engine::{Gpu, Table};
use crate::error::Result;
use crate::geometry::NONE;
use crate::surface::PhongSurface;
use crate::surface::project::SearchLimits;

/// Five texels: vertices and signs of `G_k`, neighbours, cosine and sine of `G_k`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct TriangleRecord {
    vertices: [u32; 3],
    mirrored: u32,
    neighbours: [u32; 3],
    unused: u32,
    gauge: [[f32; 2]; 6],
}

/// One texel: a neighbour of a vertex and the triangle between it and the stop before, or [`NONE`].
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
struct Stop {
    vertex: u32,
    triangle: u32,
    unused: [u32; 2],
}

impl Stop {
    fn new(vertex: u32, triangle: u32) -> Self {
        Self { vertex, triangle, unused: [0; 2] }
    }
}

/// The tables of a surface on a device.
#[derive(Debug)]
pub struct SurfaceTables {
    /// Points, tangents, stops of vertices.
    pub vertices: Table,
    /// Vertices, neighbours, `G_k` of triangles.
    pub triangles: Table,
    /// The stops of all vertices.
    pub stops: Table,
    /// For each triangle what rules out projections on it.
    pub bounds: Table,
    /// The triangles around each vertex, level by level, that a search looks at.
    pub near: Table,
    /// Most stops of a vertex, which bounds the loops of kernels.
    pub most_stops: u32,
    /// Most triangles of a neighbourhood, which does so too.
    pub most_near: u32,
}

/// Longest neighbourhood held; a longer one (around vertices with very many triangles) is left to
/// the reference, as an empty one.
const MOST_NEAR: usize = 512;

impl SurfaceTables {
    /// Uploads a surface of R^8 or R^12. O(F).
    ///
    /// # Errors
    /// If it does not fit the device.
    pub fn new<const D: usize>(gpu: &Gpu, label: &str, surface: &PhongSurface<f32, D>) -> Result<Self> {
        let mut stops = Vec::new();
        let mut near: Vec<u32> = Vec::new();
        let (mut most_stops, mut most_near) = (0, 0);
        // Of each vertex its point, the two rows of its tangent basis, and one texel: its first
        // stop and their number, the first texel of its neighbourhood and the triangles in it.
        let mut vertices = Vec::with_capacity(surface.vertices.len() * (3 * D / 4 + 1));
        for (vertex, v) in surface.vertices.iter().zip(0..) {
            let first = stops.len();
            around(surface, v, &mut stops);
            let count = (stops.len() - first) as u32;
            most_stops = most_stops.max(count);
            let first_near = near.len();
            surface.neighbourhood(v, SearchLimits::FIRST.triangles, &mut near);
            if near.len() - first_near > MOST_NEAR {
                near.truncate(first_near);
            }
            let count_near = (near.len() - first_near) as u32;
            most_near = most_near.max(count_near);
            near.resize(near.len().next_multiple_of(4), 0);
            append_rows(&[vertex.y, vertex.t[0], vertex.t[1]], &mut vertices);
            vertices.push([first as u32, count, (first_near / 4) as u32, count_near]);
        }
        let triangles: Vec<TriangleRecord> = surface
            .triangles
            .iter()
            .map(|t| TriangleRecord {
                vertices: t.v,
                mirrored: t.gauge.iter().zip(0..).map(|(g, k)| u32::from(g.f < 0.0) << k).sum(),
                neighbours: t.neighbours,
                unused: 0,
                gauge: t.gauge.map(|g| [g.c, g.s]),
            })
            .collect();
        // What rules out projections on a triangle at once: centre, basis, and a texel with reach
        // and spread.
        let mut bounds = Vec::with_capacity(surface.bounds.len() * (3 * D / 4 + 1));
        for b in &surface.bounds {
            append_rows(&[b.centre, b.basis[0], b.basis[1]], &mut bounds);
            bounds.push([b.reach.to_bits(), b.spread.to_bits(), 0, 0]);
        }
        let near: &[[u32; 4]] = bytemuck::cast_slice(&near);
        Ok(Self {
            vertices: gpu.table(&format!("{label} vertices"), &vertices)?,
            triangles: gpu.table(&format!("{label} triangles"), &triangles)?,
            stops: gpu.table(&format!("{label} stops"), &stops)?,
            bounds: gpu.table(&format!("{label} bounds"), &bounds)?,
            near: gpu.table(&format!("{label} neighbourhoods"), near)?,
            most_stops,
            most_near,
        })
    }
}

/// Appends vectors, a texel for four numbers.
pub(super) fn append_rows<const D: usize>(rows: &[[f32; D]], texels: &mut Vec<[u32; 4]>) {
    const { assert!(D.is_multiple_of(4)) };
    for four in rows.iter().flat_map(|row| row.chunks_exact(4)) {
        texels.push(std::array::from_fn(|k| four[k].to_bits()));
    }
}

/// Appends the stops around `v`: its fan as chains of triangles, each beginning with a stop that
/// closes no triangle. Every neighbour occurs, and every triangle of the fan once.
fn around<const D: usize>(surface: &PhongSurface<f32, D>, v: u32, stops: &mut Vec<Stop>) {
    // Of each triangle the two other vertices, in its orientation.
    let fan: Vec<(u32, u32, u32)> = surface
        .fan(v)
        .iter()
        .filter_map(|&t| {
            let w = surface.triangles[t as usize].v;
            let k = w.iter().position(|&x| x == v)?;
            Some((w[(k + 1) % 3], w[(k + 2) % 3], t))
        })
        .collect();
    // Those left: by the vertex that they begin with, how many end at each vertex, and those that
    // nothing ends before.
    let mut left: BTreeSet<usize> = (0..fan.len()).collect();
    let mut from: HashMap<u32, BTreeSet<usize>> = HashMap::new();
    let mut ending: HashMap<u32, usize> = HashMap::new();
    for (i, a) in fan.iter().enumerate() {
        from.entry(a.0).or_default().insert(i);
        *ending.entry(a.1).or_default() += 1;
    }
    let mut first: BTreeSet<usize> = left.iter().copied().filter(|&i| !ending.contains_key(&fan[i].0)).collect();
    // A chain begins where no other triangle ends, or anywhere on a closed fan.
    while let Some(begin) = first.first().or(left.first()).copied() {
        stops.push(Stop::new(fan[begin].0, NONE));
        let mut next = Some(begin);
        while let Some(i) = next {
            let (a, b, t) = fan[i];
            left.remove(&i);
            first.remove(&i);
            from.entry(a).or_default().remove(&i);
            let ends = ending.entry(b).or_default();
            *ends = ends.saturating_sub(1);
            let after = from.get(&b);
            if *ends == 0 {
                first.extend(after.into_iter().flatten());
            }
            stops.push(Stop::new(b, t));
            next = after.and_then(|after| after.first()).copied();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Mesh, Topology};
    use crate::models::shapes::{Diagonal, irregular_plane, lobed_sphere, uv_sphere};

    #[test]
    fn stops_hold_every_neighbour_and_every_triangle_once() {
        // Closed fans, and open ones along a boundary.
        check(&lobed_sphere(1, 0.3));
        check(&uv_sphere(1.0, 600, 2));
        check(&irregular_plane(5, 4, 3.0, 2.0, Diagonal::Alternating, 0.3, 5));
    }

    fn check(mesh: &Mesh) {
        let topology = Topology::new(mesh);
        let points: Vec<f64> = mesh.positions.iter().flat_map(|p| [p.x, p.y, p.z, 0.0, 0.0, 0.0, 0.0, 0.0]).collect();
        let surface = PhongSurface::<f64, 8>::new(&topology, &points).unwrap().cast::<f32>();
        for v in 0..surface.vertices.len() as u32 {
            let mut stops = Vec::new();
            around(&surface, v, &mut stops);
            let mut neighbours: Vec<u32> = stops.iter().map(|s| s.vertex).collect();
            neighbours.sort_unstable();
            neighbours.dedup();
            assert_eq!(neighbours, surface.ring(v));
            let mut triangles: Vec<u32> = stops.iter().map(|s| s.triangle).filter(|&t| t != NONE).collect();
            triangles.sort_unstable();
            assert_eq!(triangles, surface.fan(v));
            for pair in stops.windows(2).filter(|p| p[1].triangle != NONE) {
                let mut w = surface.triangles[pair[1].triangle as usize].v;
                let mut expected = [v, pair[0].vertex, pair[1].vertex];
                w.sort_unstable();
                expected.sort_unstable();
                assert_eq!(w, expected);
            }
        }
    }
}
