//! Components without a handle (eyes, buttons): each moves as the nearest part of the others does.

use std::num::NonZero;

use glam::DVec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};

use crate::encoding::{Connectivity, Hierarchy, Similarity, V3};
use crate::geometry::NONE;

/// Vertices of a component that look for a neighbour.
const SAMPLES: usize = 64;
/// Neighbours each of them takes.
const NEAREST: NonZero<usize> = NonZero::new(4).expect("not zero");

/// The components without a handle, with the numbers of the vertices they follow.
#[derive(Debug, Default)]
pub(super) struct Followers {
    /// How many there are.
    pub(super) components: usize,
    /// Mesh vertices of each, and what it follows (numbers of the hierarchy).
    parts: Vec<(Vec<u32>, Vec<u32>)>,
}

impl Followers {
    pub(super) fn new(connectivity: &Connectivity, rest: &[V3<f64>], hierarchy: &Hierarchy) -> Self {
        let mut led = vec![false; connectivity.component_count as usize];
        for &v in &hierarchy.order {
            led[connectivity.component[v as usize] as usize] = true;
        }
        let mut members = vec![Vec::new(); led.len()];
        for (v, &c) in connectivity.component.iter().enumerate() {
            if c != NONE && !led[c as usize] && !connectivity.rings[v].is_empty() {
                members[c as usize].push(v as u32);
            }
        }
        members.retain(|m| !m.is_empty());
        if members.is_empty() {
            return Self::default();
        }
        let points: Vec<V3<f64>> = hierarchy.order.iter().map(|&v| rest[v as usize]).collect();
        let tree = ImmutableKdTree::<f64, 3>::new_from_slice(&points);
        let parts = members
            .into_iter()
            .map(|vertices| {
                let stride = vertices.len().div_ceil(SAMPLES);
                let mut near: Vec<u32> = vertices
                    .iter()
                    .step_by(stride)
                    .flat_map(|&v| tree.nearest_n::<SquaredEuclidean>(&rest[v as usize], NEAREST))
                    .map(|found| found.item as u32)
                    .collect();
                near.sort_unstable();
                near.dedup();
                (vertices, near)
            })
            .collect::<Vec<_>>();
        Self { components: parts.len(), parts }
    }

    /// Calls `put` with the new position of every vertex of these components.
    pub(super) fn place(
        &self,
        rest: &[V3<f64>],
        hierarchy: &Hierarchy,
        decoded: &[V3<f64>],
        mut put: impl FnMut(u32, V3<f64>),
    ) {
        for (vertices, near) in &self.parts {
            let pairs: Vec<(DVec3, DVec3)> = near
                .iter()
                .map(|&k| (DVec3::from(rest[hierarchy.order[k as usize] as usize]), DVec3::from(decoded[k as usize])))
                .collect();
            let fit = Similarity::fit(&pairs);
            vertices.iter().for_each(|&v| put(v, fit.apply(DVec3::from(rest[v as usize])).to_array()));
        }
    }
}
