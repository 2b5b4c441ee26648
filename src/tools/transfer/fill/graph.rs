//! The texels of holes and what they border on, as a graph.

use super::holes::Holes;
use crate::geometry::NONE;
use crate::tools::transfer::pad::COVERED;
use crate::tools::transfer::seams::SeamPair;

/// Texels without colour (nodes), the edges among them, and those to texels with one.
#[derive(Debug)]
pub(super) struct Graph {
    /// Texels per row.
    pub(super) width: u32,
    /// Index of each node's texel, rising.
    pub(super) unknown: Vec<u32>,
    /// Connected part of each node within its chart, from 0.
    pub(super) part: Vec<u32>,
    /// Number of parts.
    pub(super) parts: u32,
    /// Texels with colour that nodes border on, rising.
    pub(super) known: Vec<u32>,
    /// Nodes beside each node in its chart: left, right, above, below, or [`NONE`].
    pub(super) beside: Vec<[u32; 4]>,
    /// Known texels (places in `known`) that each node borders on: pairs, sorted by node; across
    /// seams, too.
    pub(super) border: Vec<(u32, u32)>,
    /// Nodes across seams: pairs both ways, sorted.
    pub(super) across: Vec<(u32, u32)>,
}

impl Graph {
    /// Of holes with the texels around them. `covers` tells which texels beyond seams have a
    /// colour.
    pub(super) fn new(holes: &Holes, covers: &[u8], seams: &[SeamPair], width: u32) -> Self {
        let texels = &holes.texels;
        let find = |index: u32| texels.binary_search_by_key(&index, |t| t.index).ok();
        let mut node = vec![NONE; texels.len()];
        let mut unknown = Vec::new();
        for (k, t) in texels.iter().enumerate().filter(|(_, t)| t.hole) {
            node[k] = unknown.len() as u32;
            unknown.push(t.index);
        }
        // Borders by texel at first: known texels get their places when all are there.
        let mut border: Vec<(u32, u32)> = Vec::new();
        let mut beside = vec![[NONE; 4]; unknown.len()];
        for (k, t) in texels.iter().enumerate().filter(|(_, t)| t.hole) {
            let x = t.index % width;
            let places = [
                (x > 0).then(|| t.index.wrapping_sub(1)),
                (x + 1 < width).then(|| t.index + 1),
                t.index.checked_sub(width),
                t.index.checked_add(width),
            ];
            for (d, place) in places.into_iter().enumerate() {
                let Some(j) = place.and_then(find).filter(|&j| texels[j].chart == t.chart) else { continue };
                if texels[j].hole {
                    beside[node[k] as usize][d] = node[j];
                } else {
                    border.push((node[k], texels[j].index));
                }
            }
        }
        let mut across = Vec::new();
        for pair in seams {
            let ends = [0, 1].map(|s| (pair.texels[s], find(pair.texels[s]), pair.charts[s]));
            // A place may lie in another chart where charts are closer than a texel.
            if ends.iter().any(|(_, at, chart)| at.is_some_and(|k| texels[k].chart != *chart)) {
                continue;
            }
            let as_node = ends.map(|(_, at, _)| at.map_or(NONE, |k| node[k]));
            match as_node {
                [NONE, NONE] => {}
                [a, NONE] | [NONE, a] => {
                    let other = if as_node[0] == NONE { ends[0].0 } else { ends[1].0 };
                    if covers[other as usize] >= COVERED {
                        border.push((a, other));
                    }
                }
                [a, b] => across.extend([(a, b), (b, a)]),
            }
        }
        across.sort_unstable();
        across.dedup();
        border.sort_unstable();
        border.dedup();
        let mut known: Vec<u32> = border.iter().map(|b| b.1).collect();
        known.sort_unstable();
        known.dedup();
        for (_, texel) in &mut border {
            *texel = known.binary_search(texel).unwrap_or_default() as u32;
        }
        let (part, parts) = parts(&beside);
        Self { width, unknown, part, parts, known, beside, border, across }
    }

    /// Column and row of a node.
    pub(super) fn place(&self, node: usize) -> [u32; 2] {
        [self.unknown[node] % self.width, self.unknown[node] / self.width]
    }
}

/// Connected parts, numbered in the order of their first nodes.
fn parts(beside: &[[u32; 4]]) -> (Vec<u32>, u32) {
    let mut part = vec![NONE; beside.len()];
    let mut count = 0;
    let mut stack = Vec::new();
    for first in 0..beside.len() {
        if part[first] != NONE {
            continue;
        }
        part[first] = count;
        stack.push(first);
        while let Some(n) = stack.pop() {
            for &m in beside[n].iter().filter(|&&m| m != NONE) {
                if part[m as usize] == NONE {
                    part[m as usize] = count;
                    stack.push(m as usize);
                }
            }
        }
        count += 1;
    }
    (part, count)
}
