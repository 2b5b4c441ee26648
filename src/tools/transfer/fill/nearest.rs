//! The nearest texel with a colour.

use std::collections::VecDeque;

use super::graph::Graph;
use crate::geometry::NONE;

/// For each node the texel whose colour it takes: the nearest in steps along rows, columns and
/// across seams, the lowest one of the first node on ties; [`NONE`] where there is none. O(nodes).
pub(super) fn nearest(graph: &Graph) -> Vec<u32> {
    let mut from = vec![NONE; graph.unknown.len()];
    let mut queue = VecDeque::new();
    // Sorted by node, then by texel: the first one of a node is the lowest.
    for &(u, k) in &graph.border {
        if from[u as usize] == NONE {
            from[u as usize] = graph.known[k as usize];
            queue.push_back(u);
        }
    }
    while let Some(u) = queue.pop_front() {
        let first = graph.across.partition_point(|&(a, _)| a < u);
        let across = graph.across[first..].iter().take_while(|&&(a, _)| a == u).map(|&(_, b)| b);
        for v in graph.beside[u as usize].into_iter().filter(|&v| v != NONE).chain(across) {
            if from[v as usize] == NONE {
                from[v as usize] = from[u as usize];
                queue.push_back(v);
            }
        }
    }
    from
}
