//! A surface at unit area with what its shape says of each place: relief against smoothed copies of
//! itself, and how that changes along the surface.

use faer::Mat;
use glam::DVec3;
use rayon::prelude::*;

use crate::error::Result;
use crate::geometry::cholesky::SparseCholesky;
use crate::geometry::laplacian::{Laplacian, SparseRows};
use crate::geometry::{Frame, Mesh, SurfacePoint, Topology};

/// Diffusion times of the smoothed copies, at unit area: widths of 0.02 to 0.16.
pub(super) const SCALES: [f64; 4] = [5e-5, 2e-4, 8e-4, 3.2e-3];
/// Vectors per vertex: relief at each scale, and the normal.
pub(super) const CHANNELS: usize = SCALES.len() + 1;
/// The scale over which a map's local rotation is measured.
pub(super) const FRAME: usize = 3;

/// Part of the area that makes a component the main one.
const MAIN: f64 = 0.7;

/// One vector per channel.
pub(super) type Relief = [DVec3; CHANNELS];

/// A surface at unit area.
pub(super) struct Side<'a> {
    pub(super) topology: &'a Topology,
    /// Positions over the square root of the area; unused vertices at the origin.
    pub(super) positions: Vec<DVec3>,
    /// The usable triangles.
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) laplacian: Laplacian,
    /// The stiffness without boundary flow.
    pub(super) flow: SparseRows,
    pub(super) normals: Vec<DVec3>,
    /// Relief of each vertex.
    pub(super) relief: Vec<Relief>,
    smoothers: Vec<SparseCholesky>,
}

impl<'a> Side<'a> {
    /// O(V) factorisations, one per scale.
    pub(super) fn new(mesh: &'a Mesh, topology: &'a Topology) -> Result<Self> {
        let frame = Frame::of_mesh(mesh);
        let length = mesh.area().sqrt() * frame.scale;
        let used = |v: usize| !topology.vertex_triangles(v as u32).is_empty();
        let positions: Vec<DVec3> = (0..mesh.vertex_count())
            .map(|v| if used(v) { frame.local(mesh.positions[v]) / length } else { DVec3::ZERO })
            .collect();
        let triangles: Vec<[u32; 3]> =
            topology.triangles.iter().zip(&topology.usable).filter(|(_, u)| **u).map(|(t, _)| *t).collect();
        let laplacian = Laplacian::new(&positions, &triangles);
        let smoothers = SCALES.iter().map(|t| smoother(&laplacian, *t)).collect::<Result<Vec<_>>>()?;
        let mut normals = vec![DVec3::ZERO; positions.len()];
        for t in &triangles {
            let [a, b, c] = t.map(|v| positions[v as usize]);
            let n = (b - a).cross(c - a);
            t.iter().for_each(|v| normals[*v as usize] += n);
        }
        normals.iter_mut().for_each(|n| *n = n.normalize_or_zero());
        let flow = laplacian.without_boundary_flow(&positions, &triangles);
        let mut side = Self { topology, positions, triangles, laplacian, flow, normals, relief: Vec::new(), smoothers };
        let mut relief: Vec<Relief> = side.normals.iter().map(|n| [*n; CHANNELS]).collect();
        for (k, t) in SCALES.iter().enumerate() {
            let smooth = side.smooth(k, &side.positions)?;
            for (v, r) in relief.iter_mut().enumerate() {
                r[k] = (side.positions[v] - smooth[v]) / t.sqrt();
            }
        }
        side.relief = relief;
        Ok(side)
    }

    /// The component that has most of the area, the body beside eyes and buckles; none where no one
    /// does. O(F).
    pub(super) fn main_component(&self) -> Option<u32> {
        let mut areas = vec![0.0; self.topology.component_count as usize];
        for t in &self.triangles {
            let [a, b, c] = t.map(|v| self.positions[v as usize]);
            areas[self.topology.vertex_component[t[0] as usize] as usize] += (b - a).cross(c - a).length();
        }
        let all: f64 = areas.iter().sum();
        (0..).zip(areas).find(|(_, area)| *area >= MAIN * all).map(|(component, _)| component)
    }

    /// `(M + t S)^-1 M x`: `x` diffused for the time of scale `k`.
    pub(super) fn smooth(&self, k: usize, x: &[DVec3]) -> Result<Vec<DVec3>> {
        let mut right = Mat::from_fn(x.len(), 3, |v, i| self.laplacian.mass[v] * x[v][i]);
        self.smoothers[k].solve(&mut right)?;
        Ok((0..x.len()).map(|v| DVec3::from_array(std::array::from_fn(|i| right[(v, i)]))).collect())
    }

    pub(super) fn position(&self, p: &SurfacePoint) -> DVec3 {
        let t = self.topology.triangles[p.face as usize];
        (0..3).map(|k| p.barycentric[k] * self.positions[t[k] as usize]).sum()
    }

    /// The closest point of the surface near `from`: downhill from triangle to triangle, so that it
    /// stays on the same part.
    pub(super) fn closest_near(&self, to: DVec3, from: SurfacePoint) -> SurfacePoint {
        let on = |face: u32| {
            let x = crate::geometry::closest::closest_barycentric(
                to,
                self.topology.triangles[face as usize].map(|v| self.positions[v as usize]),
            );
            let p = SurfacePoint::new(face, x);
            (self.position(&p).distance_squared(to), p)
        };
        let mut best = on(from.face);
        loop {
            let before = best.1.face;
            for v in self.topology.triangles[before as usize] {
                for &t in self.topology.vertex_triangles(v) {
                    let c = on(t);
                    if c.0 < best.0 {
                        best = c;
                    }
                }
            }
            if best.1.face == before {
                return best.1;
            }
        }
    }

    /// Derivatives along the surface of each channel at each vertex, `[channel][component]`:
    /// area-weighted means over the triangles around.
    pub(super) fn gradients(&self) -> Vec<[[DVec3; 3]; CHANNELS]> {
        (0..self.positions.len() as u32)
            .into_par_iter()
            .map(|v| {
                let mut sum = [[DVec3::ZERO; 3]; CHANNELS];
                let mut total = 0.0;
                for &t in self.topology.vertex_triangles(v) {
                    let corners = self.topology.triangles[t as usize];
                    let [a, b, c] = corners.map(|v| self.positions[v as usize]);
                    let n = (b - a).cross(c - a);
                    let twice = n.length();
                    // Gradients of the hat functions times twice the area.
                    let n = n / twice;
                    let hats = [n.cross(c - b), n.cross(a - c), n.cross(b - a)];
                    total += twice;
                    for k in 0..CHANNELS {
                        for i in 0..3 {
                            for (corner, hat) in corners.iter().zip(hats) {
                                sum[k][i] += hat * self.relief[*corner as usize][k][i];
                            }
                        }
                    }
                }
                if total > 0.0 { sum.map(|s| s.map(|g| g / total)) } else { sum }
            })
            .collect()
    }
}

/// Factorises `M + t S`.
fn smoother(laplacian: &Laplacian, t: f64) -> Result<SparseCholesky> {
    let n = laplacian.mass.len();
    let (mut starts, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
    for r in 0..n {
        let (columns, entries) = laplacian.stiffness.row(r);
        let mut diagonal = if laplacian.mass[r] > 0.0 { laplacian.mass[r] } else { 1.0 };
        let mut below = Vec::new();
        for (&c, &x) in columns.iter().zip(entries) {
            match (c as usize).cmp(&r) {
                std::cmp::Ordering::Equal => diagonal += t * x,
                std::cmp::Ordering::Greater => below.push((c as usize, t * x)),
                std::cmp::Ordering::Less => {}
            }
        }
        rows.push(r);
        values.push(diagonal);
        for (c, x) in below {
            rows.push(c);
            values.push(x);
        }
        starts.push(rows.len());
    }
    SparseCholesky::new("diffusion over the surface", starts, rows, values, 0)?.ok_or_else(|| {
        crate::Error::numeric("diffusion over the surface breaks down", "Check the mesh for extremely thin triangles")
    })
}
