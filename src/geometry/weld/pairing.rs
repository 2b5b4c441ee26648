//! Which open edges belong together.

use glam::DVec3;

use super::places::Grid;
use super::sides::{Pair, Side};
use crate::geometry::union_find::UnionFind;
use crate::geometry::{Mesh, NONE, Topology};

/// Angles of faces around an edge within this are equal: rounding of two cross products of unit
/// vectors.
const SAME_ANGLE: f64 = 1e-9;

/// Pairs, and what has none.
#[derive(Debug, Default)]
pub(super) struct Found {
    pub(super) pairs: Vec<Pair>,
    /// Pairs in the same direction.
    pub(super) turned: usize,
    /// Sides that lie on several others.
    pub(super) crowded: usize,
    /// Sides that lie on no other.
    alone: Vec<u32>,
}

impl Found {
    /// The sides that lie on no other and were not paired since.
    pub(super) fn alone(&self) -> Vec<u32> {
        let mut paired: Vec<u32> = self.pairs.iter().flat_map(|&(s, t)| [s, t]).collect();
        paired.sort_unstable();
        self.alone.iter().copied().filter(|s| paired.binary_search(s).is_err()).collect()
    }
}

/// The pairs among sides that lie on one another. O(n log n).
pub(super) fn pairs(mesh: &Mesh, topology: &Topology, sides: &[Side], place: &[u32]) -> Found {
    let copy = copies(topology, sides, place);
    let at = |v: u32| place[v as usize];
    let mut keyed: Vec<([u32; 3], u32)> = Vec::with_capacity(sides.len());
    for (s, side) in sides.iter().enumerate() {
        let (a, b) = (at(side.from), at(side.to));
        // Without length, within rounding, it lies on nothing.
        if a != b {
            keyed.push(([a.min(b), a.max(b), copy[s]], s as u32));
        }
    }
    keyed.sort_unstable();
    let forward = |s: u32| at(sides[s as usize].from) < at(sides[s as usize].to);
    let third = |s: u32| {
        let side = sides[s as usize];
        at(topology.triangles[side.triangle as usize][side.corner as usize])
    };
    let mut found = Found::default();
    let mut crowds: Vec<Vec<u32>> = Vec::new();
    for group in keyed.chunk_by(|a, b| a.0 == b.0) {
        match *group {
            [(_, s)] => found.alone.push(s),
            // Two faces back to back are two sheets, and their common border is no fold.
            [(_, s), (_, t)] if third(s) == third(t) => {}
            [(_, s), (_, t)] if forward(s) != forward(t) => found.pairs.push((s, t)),
            [_, _] => found.turned += 1,
            _ => crowds.push(group.iter().map(|g| g.1).collect()),
        }
    }
    let mut parts = parts(topology, sides, &found.pairs);
    for crowd in crowds {
        let rest = pair_within_parts(sides, &mut parts, crowd, &forward, &mut found.pairs);
        match pair_bodies(mesh, sides, &rest, &forward) {
            Some(pairs) => found.pairs.extend(pairs),
            None => found.crowded += rest.len(),
        }
    }
    found.alone.sort_unstable();
    found
}

/// How many triangles with the corners of a side's triangle, in the same orientation, come before
/// it.
fn copies(topology: &Topology, sides: &[Side], place: &[u32]) -> Vec<u32> {
    let mut triangles: Vec<u32> = sides.iter().map(|s| s.triangle).collect();
    triangles.dedup();
    let mut keyed: Vec<([u32; 3], u32)> = triangles
        .iter()
        .map(|&t| {
            let mut corners = topology.triangles[t as usize].map(|v| place[v as usize]);
            let lowest = (0..3).min_by_key(|&k| corners[k]).unwrap_or(0);
            corners.rotate_left(lowest);
            (corners, t)
        })
        .collect();
    keyed.sort_unstable();
    let mut copy = vec![0; topology.triangles.len()];
    for group in keyed.chunk_by(|a, b| a.0 == b.0) {
        for (k, &(_, t)) in group.iter().enumerate() {
            copy[t as usize] = k as u32;
        }
    }
    sides.iter().map(|s| copy[s.triangle as usize]).collect()
}

/// The connected parts of the surface, as sets of vertices, once `pairs` are joined.
fn parts(topology: &Topology, sides: &[Side], pairs: &[Pair]) -> UnionFind {
    let mut parts = UnionFind::new(topology.vertex_count());
    for (t, &[a, b, c]) in topology.triangles.iter().enumerate() {
        if topology.usable[t] {
            parts.join(a, b);
            parts.join(b, c);
        }
    }
    for &(s, t) in pairs {
        parts.join(sides[s as usize].from, sides[t as usize].to);
    }
    parts
}

/// Pairs two sides of opposite direction that are alone in their part; returns the others.
fn pair_within_parts(
    sides: &[Side],
    parts: &mut UnionFind,
    crowd: Vec<u32>,
    forward: &impl Fn(u32) -> bool,
    pairs: &mut Vec<Pair>,
) -> Vec<u32> {
    let mut parted: Vec<(u32, u32)> = crowd.into_iter().map(|s| (parts.root(sides[s as usize].from), s)).collect();
    parted.sort_unstable();
    let mut rest = Vec::new();
    for group in parted.chunk_by(|a, b| a.0 == b.0) {
        match *group {
            [(_, s), (_, t)] if forward(s) != forward(t) => pairs.push((s, t)),
            _ => rest.extend(group.iter().map(|g| g.1)),
        }
    }
    rest
}

/// Pairs the sides around an edge so that each pair has the inside of a body between, if all do.
///
/// Looking along the edge, a side in its direction has the inside on the right of its face and the
/// outside on the left, where angles grow; an opposite side the other way round. Bodies that touch
/// in the edge have opposite sides and sides in its direction in turn. Where two faces lie on one
/// another, the body that comes first is closed first.
fn pair_bodies(mesh: &Mesh, sides: &[Side], crowd: &[u32], forward: &impl Fn(u32) -> bool) -> Option<Vec<Pair>> {
    let first = crowd.first().map(|&s| sides[s as usize])?;
    let ends = [first.from, first.to].map(|v| mesh.positions[v as usize]);
    let mut axis = (ends[1] - ends[0]).normalize_or_zero();
    if !forward(crowd[0]) {
        axis = -axis;
    }
    let outward = |s: u32| {
        let side = sides[s as usize];
        let third = mesh.triangle(side.triangle as usize)[side.corner as usize];
        (mesh.positions[third as usize] - ends[0]).reject_from_normalized(axis).normalize_or_zero()
    };
    let x = outward(crowd[0]);
    let y = axis.cross(x);
    let mut around: Vec<(f64, bool, u32)> = crowd
        .iter()
        .map(|&s| {
            let d = outward(s);
            let angle = d.dot(y).atan2(d.dot(x)).rem_euclid(std::f64::consts::TAU);
            (if angle > std::f64::consts::TAU - SAME_ANGLE { 0.0 } else { angle }, forward(s), s)
        })
        .collect();
    around.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
    for group in around.chunk_by_mut(|a, b| b.0 - a.0 <= SAME_ANGLE) {
        group.sort_unstable_by_key(|(_, forward, s)| (!*forward, *s));
    }
    let n = around.len();
    let in_turn = n.is_multiple_of(2) && (0..n).all(|i| around[i].1 != around[(i + 1) % n].1);
    in_turn.then(|| (0..n).filter(|&i| !around[i].1).map(|i| (around[i].2, around[(i + 1) % n].2)).collect())
}

/// Adds pairs of sides that lie on no other but are each other's nearest within `tolerance`. O(n
/// log n).
pub(super) fn nearest(sides: &[Side], layers: &[&[DVec3]], tolerance: f64, found: &mut Found) {
    let starts: Vec<u32> = found.alone.iter().map(|&s| sides[s as usize].from).collect();
    let grid = Grid::new(&starts, layers[0], tolerance);
    let gap = |s: Side, t: Side| {
        let gaps = layers.iter().flat_map(|layer| {
            let distance = |a: u32, b: u32| layer[a as usize].distance(layer[b as usize]);
            [distance(s.from, t.to), distance(s.to, t.from)]
        });
        gaps.fold(0.0, f64::max)
    };
    // The nearest partner of each, if no other is as near.
    let best: Vec<u32> = (0..found.alone.len())
        .map(|i| {
            let side = sides[found.alone[i] as usize];
            let (mut best, mut least) = (NONE, f64::INFINITY);
            grid.near(layers[0][side.to as usize], |j| {
                let distance = gap(side, sides[found.alone[j as usize] as usize]);
                if j as usize != i && distance <= tolerance && distance <= least {
                    best = if distance == least { NONE } else { j };
                    least = distance;
                }
            });
            best
        })
        .collect();
    for (i, &j) in best.iter().enumerate() {
        if j != NONE && i < j as usize && best[j as usize] == i as u32 {
            found.pairs.push((found.alone[i], found.alone[j as usize]));
        }
    }
}
