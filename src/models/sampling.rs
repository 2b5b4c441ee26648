//! Triangulations of the base surface, and where a point of one lies on another.
//!
//! Every triangle lies within one quad of the cage in parameter space, and the parameters are
//! linear on it. So a vertex of one triangulation, whose parameters are known, has exactly one
//! place on any other: the triangle there that contains the parameters. This is the ground truth of
//! correspondences.

use glam::{DVec2, DVec3};

use super::cage::Cage;
use super::shapes::Random;
use super::subdivision::{BaseSurface, Parameter};
use crate::geometry::SurfacePoint;

/// How a character is cut into triangles.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sampling {
    /// Wanted edge length, metres.
    pub(super) edge: f64,
    /// Parameters move at random by up to this share of the spacing (below 0.4, so that no triangle
    /// turns over).
    pub(super) jitter: f64,
    /// Seed of the movement.
    pub(super) seed: u64,
    /// Cut grid cells by the shorter diagonal; otherwise in turns like a chess board.
    pub(super) shorter_diagonal: bool,
}

/// A triangulated base surface.
#[derive(Clone, Debug)]
pub(super) struct Sampled {
    /// Each vertex by one of its names (a vertex on an edge of the cage has two, on a corner
    /// several).
    pub(super) parameters: Vec<Parameter>,
    /// Vertices of each triangle.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Parameters of each triangle's corners, all in its quad.
    pub(super) corners: Vec<[DVec2; 3]>,
    /// Triangles of quad `q`: `quad_start[q]..quad_start[q + 1]`.
    pub(super) quad_start: Vec<u32>,
}

impl Sampled {
    /// Cuts every quad of the cage into triangles; quads that share an edge share its vertices.
    pub(super) fn new(cage: &Cage, surface: &BaseSurface, sampling: &Sampling) -> Self {
        let segments = segments(cage, surface, sampling.edge);
        let mut random = Random::new(sampling.seed);
        let mut parameters: Vec<Parameter> = Vec::new();
        let mut corner_vertex = vec![u32::MAX; cage.vertices.len()];
        // Vertices and parameters along each edge in the direction of its first quad.
        let mut edge_vertices: Vec<Vec<(u32, f64)>> = vec![Vec::new(); cage.edge_count];
        let mut triangles = Vec::new();
        let mut corners = Vec::new();
        let mut quad_start = vec![0];
        for q in 0..cage.quads.len() {
            let n = [segments[cage.edges[q][0] as usize], segments[cage.edges[q][1] as usize]];
            let width = n[0] + 1;
            let mut grid = vec![(u32::MAX, DVec2::ZERO); width * (n[1] + 1)];
            for e in 0..4 {
                let count = n[e % 2];
                // Grid place and parameters of step k along edge e.
                let step = |k: usize, t: f64| match e {
                    0 => (k, DVec2::new(t, 0.0)),
                    1 => (k * width + n[0], DVec2::new(1.0, t)),
                    2 => (n[1] * width + n[0] - k, DVec2::new(1.0 - t, 1.0)),
                    _ => ((n[1] - k) * width, DVec2::new(0.0, 1.0 - t)),
                };
                let mut push = |p: DVec2| {
                    parameters.push(Parameter { quad: q as u32, u: p.x, v: p.y });
                    parameters.len() as u32 - 1
                };
                let (place, p) = step(0, 0.0);
                let control = cage.quads[q][e] as usize;
                if corner_vertex[control] == u32::MAX {
                    corner_vertex[control] = push(p);
                }
                grid[place] = (corner_vertex[control], p);
                let along = &mut edge_vertices[cage.edges[q][e] as usize];
                let first_visit = along.is_empty() && cage.neighbours[q][e].0 as usize > q;
                for k in 1..count {
                    if first_visit {
                        let t = (k as f64 + sampling.jitter * random.signed()) / count as f64;
                        let (place, p) = step(k, t);
                        along.push((push(p), t));
                        grid[place] = (along[k - 1].0, p);
                    } else {
                        let (vertex, t) = along[count - 1 - k];
                        let (place, p) = step(k, 1.0 - t);
                        grid[place] = (vertex, p);
                    }
                }
            }
            for j in 1..n[1] {
                for i in 1..n[0] {
                    let p = DVec2::new(
                        (i as f64 + sampling.jitter * random.signed()) / n[0] as f64,
                        (j as f64 + sampling.jitter * random.signed()) / n[1] as f64,
                    );
                    parameters.push(Parameter { quad: q as u32, u: p.x, v: p.y });
                    grid[j * width + i] = (parameters.len() as u32 - 1, p);
                }
            }
            let place = |p: DVec2| surface.position(Parameter { quad: q as u32, u: p.x, v: p.y });
            for j in 0..n[1] {
                for i in 0..n[0] {
                    let c = [j * width + i, j * width + i + 1, (j + 1) * width + i + 1, (j + 1) * width + i]
                        .map(|k| grid[k]);
                    let x = c.map(|c| place(c.1));
                    let (forward, backward) = (x[0].distance(x[2]), x[1].distance(x[3]));
                    let cut_forward = if sampling.shorter_diagonal && (forward - backward).abs() > 1e-6 * forward {
                        forward < backward
                    } else {
                        (i + j) % 2 == 0
                    };
                    let cut = if cut_forward { [[0, 1, 2], [0, 2, 3]] } else { [[0, 1, 3], [1, 2, 3]] };
                    for t in cut {
                        triangles.push(t.map(|k| c[k].0));
                        corners.push(t.map(|k| c[k].1));
                    }
                }
            }
            quad_start.push(triangles.len() as u32);
        }
        Self { parameters, triangles, corners, quad_start }
    }

    /// The place of a parameter on this triangulation. O(triangles of the quad).
    pub(super) fn locate(&self, p: Parameter) -> SurfacePoint {
        let x = DVec2::new(p.u, p.v);
        let mut best = (f64::NEG_INFINITY, SurfacePoint::new(0, [1.0, 0.0, 0.0]));
        for t in self.quad_start[p.quad as usize]..self.quad_start[p.quad as usize + 1] {
            let [a, b, c] = self.corners[t as usize];
            let area = (b - a).perp_dot(c - a);
            let w = [(b - x).perp_dot(c - x) / area, (c - x).perp_dot(a - x) / area, (a - x).perp_dot(b - x) / area];
            let inside = w[0].min(w[1]).min(w[2]);
            if inside > best.0 {
                best = (inside, SurfacePoint::new(t, w));
            }
        }
        let w = best.1.barycentric.map(|w| w.max(0.0));
        let sum: f64 = w.iter().sum();
        SurfacePoint::new(best.1.face, w.map(|w| w / sum))
    }

    /// The quad that holds a triangle.
    pub(super) fn quad_of(&self, triangle: u32) -> u32 {
        self.quad_start.partition_point(|&s| s <= triangle) as u32 - 1
    }

    /// Parameters of a point of this triangulation.
    pub(super) fn parameter(&self, p: &SurfacePoint) -> Parameter {
        let quad = self.quad_of(p.face);
        let x: DVec2 = (0..3).map(|k| self.corners[p.face as usize][k] * p.barycentric[k]).sum();
        Parameter { quad, u: x.x, v: x.y }
    }

    /// Positions of the vertices on a base surface.
    pub(super) fn positions(&self, surface: &BaseSurface) -> Vec<DVec3> {
        self.parameters.iter().map(|&p| surface.position(p)).collect()
    }
}

/// Mean lengths of a quad's sides along its two parameters.
pub(super) fn quad_lengths(surface: &BaseSurface, quad: u32) -> [f64; 2] {
    let length = |place: &dyn Fn(f64) -> (f64, f64)| -> f64 {
        let at = |k: usize| {
            let (u, v) = place(k as f64 / 4.0);
            surface.position(Parameter { quad, u, v })
        };
        (0..4).map(|k| at(k).distance(at(k + 1))).sum()
    };
    let mean = |along_u: bool| -> f64 {
        [0.0, 0.5, 1.0].iter().map(|&s| length(&|t| if along_u { (t, s) } else { (s, t) })).sum::<f64>() / 3.0
    };
    [mean(true), mean(false)]
}

/// Number of segments of each edge: equal for opposite edges of a quad, by the mean length of all
/// edges tied so.
fn segments(cage: &Cage, surface: &BaseSurface, edge: f64) -> Vec<usize> {
    let mut parent: Vec<usize> = (0..cage.edge_count).collect();
    fn root(parent: &mut [usize], mut i: usize) -> usize {
        while parent[i] != i {
            parent[i] = parent[parent[i]];
            i = parent[i];
        }
        i
    }
    for edges in &cage.edges {
        for e in 0..2 {
            let (a, b) = (root(&mut parent, edges[e] as usize), root(&mut parent, edges[e + 2] as usize));
            parent[a.max(b)] = a.min(b);
        }
    }
    let mut sums = vec![(0.0, 0.0); cage.edge_count];
    for (q, edges) in cage.edges.iter().enumerate() {
        let lengths = quad_lengths(surface, q as u32);
        for e in 0..2 {
            let class = root(&mut parent, edges[e] as usize);
            sums[class].0 += lengths[e];
            sums[class].1 += 1.0;
        }
    }
    (0..cage.edge_count)
        .map(|e| {
            let (sum, count) = sums[root(&mut parent, e)];
            ((sum / count / edge).round() as usize).clamp(2, 32)
        })
        .collect()
}
