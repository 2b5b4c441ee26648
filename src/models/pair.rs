//! Two characters and the true correspondence between them.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::atlas::AtlasStyle;
use super::cast;
use super::character::Character;
use super::sampling::Sampling;
use crate::geometry::{Mesh, SurfacePoint, Topology};

/// A source, a target and, for every vertex of the target, its true place on the source.
#[derive(Clone, Debug)]
pub struct ModelPair {
    /// The shape with the texture.
    pub source: Character,
    /// The shape that is to receive it.
    pub target: Character,
    /// Per target vertex the corresponding point of the source.
    pub truth: Vec<SurfacePoint>,
}

/// A tall and thin character who strides with an arm raised.
pub fn strider() -> Character {
    let sampling = Sampling { edge: 0.0185, jitter: 0.0, seed: 1, shorter_diagonal: false };
    Character::new(&cast::strider(), &sampling, AtlasStyle::Unrolled)
}

/// A short and stout character who stands with the arms out.
pub fn stout() -> Character {
    let sampling = Sampling { edge: 0.0225, jitter: 0.3, seed: 7, shorter_diagonal: true };
    Character::new(&cast::stout(), &sampling, AtlasStyle::Halves)
}

/// The two characters of the demonstration: from the strider to the stout one. They share no
/// connectivity.
pub fn character_pair() -> ModelPair {
    ModelPair::new(strider(), stout())
}

impl ModelPair {
    /// Pairs two characters.
    pub fn new(source: Character, target: Character) -> Self {
        let truth = (0..target.mesh.vertex_count()).map(|v| source.locate(target.vertex_parameter(v))).collect();
        Self { source, target, truth }
    }

    /// The pair with source and target exchanged.
    pub fn reversed(self) -> Self {
        Self::new(self.target, self.source)
    }

    /// The true source point of any point of the target.
    pub fn true_source(&self, point: &SurfacePoint) -> SurfacePoint {
        self.source.locate(self.target.parameter(point))
    }

    /// `n` anchor pairs (at most one per target vertex), spread over the target by farthest-point
    /// sampling along its edges: the source points and the target points, index by index. The first
    /// `m` of `anchors(n)` are `anchors(m)`.
    ///
    /// The target points are vertices. O(n * vertices * log(vertices)) at most, much less in
    /// practice.
    pub fn anchors(&self, n: usize) -> (Vec<SurfacePoint>, Vec<SurfacePoint>) {
        let vertices = farthest_points(&self.target.mesh, n);
        let topology = Topology::new(&self.target.mesh);
        let point = |v: u32| {
            let face = topology.vertex_triangles(v)[0];
            let mut b = [0.0; 3];
            b[topology.corner_of(face, v).unwrap_or(0)] = 1.0;
            SurfacePoint::new(face, b)
        };
        let source = vertices.iter().map(|&v| self.truth[v as usize]).collect();
        (source, vertices.iter().map(|&v| point(v)).collect())
    }
}

/// Vertices spread by farthest-point sampling with distances along edges, the first one farthest
/// from vertex 0.
fn farthest_points(mesh: &Mesh, n: usize) -> Vec<u32> {
    let mut edges = vec![Vec::new(); mesh.vertex_count()];
    for t in 0..mesh.triangle_count() {
        let t = mesh.triangle(t);
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            edges[a as usize].push((b, mesh.positions[a as usize].distance(mesh.positions[b as usize])));
        }
    }
    let mut distance = vec![f64::INFINITY; mesh.vertex_count()];
    // Only vertices that come nearer are visited, so later points are cheap.
    let spread = |from: u32, distance: &mut [f64]| {
        distance[from as usize] = 0.0;
        // Nonnegative floats order like their bits.
        let mut heap = BinaryHeap::from([Reverse((0u64, from))]);
        while let Some(Reverse((bits, v))) = heap.pop() {
            let d = f64::from_bits(bits);
            if d > distance[v as usize] {
                continue;
            }
            for &(w, length) in &edges[v as usize] {
                if d + length < distance[w as usize] {
                    distance[w as usize] = d + length;
                    heap.push(Reverse(((d + length).to_bits(), w)));
                }
            }
        }
    };
    let farthest = |distance: &[f64]| -> Option<u32> {
        let best = (0..distance.len()).reduce(|a, b| if distance[b] > distance[a] { b } else { a })?;
        (distance[best] > 0.0).then_some(best as u32)
    };
    if n == 0 || mesh.vertex_count() == 0 {
        return Vec::new();
    }
    spread(0, &mut distance);
    let Some(first) = farthest(&distance) else { return vec![0] };
    distance.fill(f64::INFINITY);
    let mut points = vec![first];
    spread(first, &mut distance);
    while points.len() < n {
        let Some(next) = farthest(&distance) else { break };
        points.push(next);
        spread(next, &mut distance);
    }
    points
}
