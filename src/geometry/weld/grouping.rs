//! From pairs of edges to the vertices that stand for others.

use super::sides::{Pair, Side};
use crate::geometry::Topology;
use crate::geometry::union_find::UnionFind;

/// The representative of every vertex once all `pairs` of sides, and `joins` of vertices, are
/// joined that leave the surface a surface; and the number of pairs that are one edge then.
///
/// A set of vertices is taken apart again if a triangle would have two corners in it, or if an
/// inner edge that ends in it would get more triangles than its two. Each round takes some apart,
/// so there is an end; one round is the rule.
pub(super) fn representatives(
    topology: &Topology,
    sides: &[Side],
    pairs: &[Pair],
    joins: &[Pair],
) -> (Vec<u32>, usize) {
    let mut apart = vec![false; topology.vertex_count()];
    let mut open = vec![[false; 3]; topology.triangles.len()];
    for side in sides {
        open[side.triangle as usize][side.corner as usize] = true;
    }
    for &(s, t) in pairs {
        for side in [sides[s as usize], sides[t as usize]] {
            open[side.triangle as usize][side.corner as usize] = false;
        }
    }
    loop {
        let mut sets = UnionFind::new(topology.vertex_count());
        let mut join = |a: u32, b: u32| {
            if !apart[a as usize] && !apart[b as usize] {
                sets.join(a, b);
            }
        };
        for &(s, t) in pairs {
            let (s, t) = (sides[s as usize], sides[t as usize]);
            join(s.from, t.to);
            join(s.to, t.from);
        }
        joins.iter().for_each(|&(a, b)| join(a, b));
        let root: Vec<u32> = (0..topology.vertex_count() as u32).map(|v| sets.root(v)).collect();
        let bad = faults(topology, &root, &open);
        if bad.is_empty() {
            let one = |a: u32, b: u32| root[a as usize] == root[b as usize];
            let is_joined = |&&(s, t): &&Pair| {
                let (s, t) = (sides[s as usize], sides[t as usize]);
                one(s.from, t.to) && one(s.to, t.from)
            };
            let edges = pairs.iter().filter(is_joined).count();
            return (root, edges);
        }
        let mut is_bad = vec![false; root.len()];
        bad.into_iter().for_each(|r| is_bad[r as usize] = true);
        (0..root.len()).filter(|v| is_bad[root[*v] as usize]).for_each(|v| apart[v] = true);
    }
}

/// The sets, of more than one vertex, that make a triangle collapse, or an inner edge lie on
/// another edge.
///
/// `open[t][k]`: the edge opposite to corner `k` of triangle `t` stays open. Several of those may
/// share their vertices:
/// the surface is cut there with or without.
fn faults(topology: &Topology, root: &[u32], open: &[[bool; 3]]) -> Vec<u32> {
    let mut several = vec![false; root.len()];
    for (v, &r) in root.iter().enumerate().filter(|(v, r)| *v != **r as usize) {
        (several[v], several[r as usize]) = (true, true);
    }
    let mut bad = Vec::new();
    // The edge of the surface, the edge of the file, and whether it is open.
    let mut edges: Vec<([u32; 2], [u32; 2], bool)> = Vec::new();
    for (t, tri) in topology.triangles.iter().enumerate().filter(|(t, _)| topology.usable[*t]) {
        for k in 0..3 {
            let (a, b) = (tri[(k + 1) % 3], tri[(k + 2) % 3]);
            let (ra, rb) = (root[a as usize], root[b as usize]);
            if ra == rb {
                bad.push(ra);
            } else if several[a as usize] || several[b as usize] {
                edges.push(([ra.min(rb), ra.max(rb)], [a.min(b), a.max(b)], open[t][k]));
            }
        }
    }
    edges.sort_unstable();
    for group in edges.chunk_by(|a, b| a.0 == b.0).filter(|group| group.len() > 2) {
        let in_file = group.iter().all(|e| e.1 == group[0].1);
        if !in_file && group.iter().any(|e| !e.2) {
            bad.extend(group[0].0.into_iter().filter(|r| several[*r as usize]));
        }
    }
    bad
}
