//! Ever coarser cells over the texels of holes, and pull-push on them.

use super::graph::Graph;
use crate::geometry::NONE;

/// Times that colours may pass on from part to part across seams.
const ROUNDS: usize = 64;

/// The cells of a level: squares of 2^l texels' side, of one part each.
#[derive(Debug)]
pub(super) struct Level {
    /// Number of cells.
    pub(super) count: usize,
    /// For each cell of the level below (nodes for the first), up to four cells here and their
    /// bilinear weights, which sum to 1.
    pub(super) parents: Vec<[(u32, f32); 4]>,
}

/// Levels over a graph's nodes, up to one cell for each part.
#[derive(Debug)]
pub(super) struct Pyramid {
    pub(super) levels: Vec<Level>,
}

fn key(part: u32, x: u32, y: u32) -> u64 {
    u64::from(part) << 32 | u64::from(y) << 16 | u64::from(x)
}

impl Pyramid {
    /// O(n log n); the levels together have at most about 4/3 as many cells as nodes, thin parts
    /// twice as many.
    pub(super) fn new(graph: &Graph) -> Self {
        let mut below: Vec<(u32, u32, u32)> = (0..graph.unknown.len())
            .map(|n| {
                let [x, y] = graph.place(n);
                (graph.part[n], x, y)
            })
            .collect();
        let mut levels = Vec::new();
        while below.len() > graph.parts as usize {
            let mut cells: Vec<u64> = below.iter().map(|&(p, x, y)| key(p, x / 2, y / 2)).collect();
            cells.sort_unstable();
            cells.dedup();
            let parents = below.iter().map(|&c| parents(&cells, c)).collect();
            below = cells.iter().map(|&k| ((k >> 32) as u32, (k & 0xffff) as u32, (k >> 16 & 0xffff) as u32)).collect();
            levels.push(Level { count: below.len(), parents });
        }
        Self { levels }
    }
}

/// The cell around a cell's centre and the nearer ones beside it, as far as they are there.
fn parents(cells: &[u64], (part, x, y): (u32, u32, u32)) -> [(u32, f32); 4] {
    let other = |c: u32| if c.is_multiple_of(2) { (c / 2).checked_sub(1) } else { Some(c / 2 + 1) };
    let (ox, oy) = (other(x), other(y));
    let find = |x: Option<u32>, y: Option<u32>| {
        x.zip(y).and_then(|(x, y)| cells.binary_search(&key(part, x, y)).ok()).map_or(NONE, |i| i as u32)
    };
    let mut out = [
        (find(Some(x / 2), Some(y / 2)), 9.0 / 16.0),
        (find(ox, Some(y / 2)), 3.0 / 16.0),
        (find(Some(x / 2), oy), 3.0 / 16.0),
        (find(ox, oy), 1.0 / 16.0),
    ];
    let sum: f32 = out.iter().filter(|(i, _)| *i != NONE).map(|(_, w)| w).sum();
    for (i, w) in &mut out {
        *w = if *i == NONE { 0.0 } else { *w / sum };
        // Any cell will do where the weight is 0.
        *i = if *i == NONE { 0 } else { *i };
    }
    out
}

/// Values of the nodes, and which of them have one. Parts that border on no colour are filled from
/// parts that were filled before, across seams.
pub(super) fn pull_push(graph: &Graph, pyramid: &Pyramid, known: &[f64]) -> (Vec<f64>, Vec<bool>) {
    let n = graph.unknown.len();
    let (mut values, mut filled) = (vec![0.0; n], vec![false; n]);
    for _ in 0..ROUNDS {
        // The mean of what a node borders on, weighted by how much of its border that is.
        let (mut sum, mut weight) = (vec![0.0; n], vec![0.0_f64; n]);
        for &(u, k) in &graph.border {
            sum[u as usize] += known[k as usize];
            weight[u as usize] += 1.0;
        }
        for &(u, v) in graph.across.iter().filter(|(_, v)| filled[*v as usize]) {
            sum[u as usize] += values[v as usize];
            weight[u as usize] += 1.0;
        }
        for u in 0..n {
            if weight[u] > 0.0 {
                sum[u] /= weight[u];
                weight[u] = weight[u].min(1.0);
            }
        }
        let (pushed, reached) = sweep(pyramid, sum, weight);
        let mut more = false;
        for u in 0..n {
            if reached[u] && !filled[u] {
                (values[u], filled[u], more) = (pushed[u], true, true);
            }
        }
        if !more || graph.across.is_empty() {
            break;
        }
    }
    (values, filled)
}

/// Up: weighted means, weights saturating at 1; down: what is missing from 1 comes from above.
fn sweep(pyramid: &Pyramid, value: Vec<f64>, weight: Vec<f64>) -> (Vec<f64>, Vec<bool>) {
    let mut pulled = vec![(value, weight)];
    for level in &pyramid.levels {
        let (below, below_weight) = &pulled[pulled.len() - 1];
        let (mut value, mut weight) = (vec![0.0; level.count], vec![0.0_f64; level.count]);
        for (c, parents) in level.parents.iter().enumerate().filter(|(c, _)| below_weight[*c] > 0.0) {
            for &(p, w) in parents {
                let w = f64::from(w) * below_weight[c];
                value[p as usize] += w * below[c];
                weight[p as usize] += w;
            }
        }
        for (v, w) in value.iter_mut().zip(&mut weight) {
            if *w > 0.0 {
                *v /= *w;
                *w = w.min(1.0);
            }
        }
        pulled.push((value, weight));
    }
    let (mut value, mut weight) = pulled.pop().unwrap_or_default();
    for level in pyramid.levels.iter().rev() {
        let (mut below, mut below_weight) = pulled.pop().unwrap_or_default();
        for (c, parents) in level.parents.iter().enumerate() {
            let rest = 1.0 - below_weight[c];
            if rest <= 0.0 {
                continue;
            }
            let (mut from, mut total) = (0.0, 0.0);
            for &(p, w) in parents.iter().filter(|(p, _)| weight[*p as usize] > 0.0) {
                from += f64::from(w) * value[p as usize];
                total += f64::from(w);
            }
            if total > 0.0 {
                below[c] = below_weight[c] * below[c] + rest * from / total;
                below_weight[c] = 1.0;
            }
        }
        (value, weight) = (below, below_weight);
    }
    let reached = weight.iter().map(|w| *w > 0.0).collect();
    (value, reached)
}
