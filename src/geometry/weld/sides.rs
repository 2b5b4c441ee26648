//! Open edges, the boundary loops that they form, and the loops that are slits.

use crate::geometry::union_find::UnionFind;
use crate::geometry::{Corner, Mesh, NONE, Topology};

/// An edge with one usable triangle, seen from it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side {
    pub(super) triangle: u32,
    /// The corner that it lies opposite to.
    pub(super) corner: u32,
    /// Vertices in the direction of the triangle.
    pub(super) from: u32,
    pub(super) to: u32,
}

/// Two sides that lie on one another in opposite directions.
pub(super) type Pair = (u32, u32);

/// All open edges, by triangle and corner.
pub(super) fn open_sides(topology: &Topology) -> Vec<Side> {
    let mut bare = Vec::new();
    for (t, tri) in topology.triangles.iter().enumerate().filter(|(t, _)| topology.usable[*t]) {
        for k in 0..3 {
            if topology.neighbours[t][k] == NONE {
                let (from, to) = (tri[(k + 1) % 3], tri[(k + 2) % 3]);
                bare.push(((from.min(to), from.max(to)), Side { triangle: t as u32, corner: k as u32, from, to }));
            }
        }
    }
    // An edge of more than two triangles has no neighbours either, but is not open.
    bare.sort_unstable_by_key(|(edge, side)| (*edge, side.triangle, side.corner));
    let mut sides: Vec<Side> =
        bare.chunk_by(|a, b| a.0 == b.0).filter(|group| group.len() == 1).map(|group| group[0].1).collect();
    sides.sort_unstable_by_key(|side| (side.triangle, side.corner));
    sides
}

/// Removes the pairs of closed slits, as the module defines them; also returns their number.
pub(super) fn without_slits(
    mesh: &Mesh,
    topology: &Topology,
    sides: &[Side],
    mut pairs: Vec<Pair>,
) -> (Vec<Pair>, usize) {
    let mut loops = loops(topology, sides);
    let label: Vec<u32> = (0..sides.len() as u32).map(|s| loops.root(s)).collect();
    // A loop is a slit until something speaks against it.
    let mut slit = vec![true; sides.len()];
    let mut paired = vec![false; sides.len()];
    let mut points = UnionFind::new(topology.vertex_count());
    for &(a, b) in &pairs {
        let (s, t) = (sides[a as usize], sides[b as usize]);
        (paired[a as usize], paired[b as usize]) = (true, true);
        if label[a as usize] != label[b as usize] || differ(mesh, s, t) {
            (slit[label[a as usize] as usize], slit[label[b as usize] as usize]) = (false, false);
        }
        points.join(s.from, t.to);
        points.join(s.to, t.from);
    }
    for s in (0..sides.len()).filter(|s| !paired[*s]) {
        slit[label[s] as usize] = false;
    }
    // A path that folds visits a point twice, a branch three times.
    let mut visits: Vec<(u32, u32)> =
        (0..sides.len()).filter(|s| slit[label[*s] as usize]).map(|s| (label[s], points.root(sides[s].from))).collect();
    visits.sort_unstable();
    for group in visits.chunk_by(|a, b| a == b).filter(|group| group.len() > 2) {
        slit[group[0].0 as usize] = false;
    }
    let before = pairs.len();
    pairs.retain(|&(a, _)| !slit[label[a as usize] as usize]);
    let slits = before - pairs.len();
    (pairs, slits)
}

/// Sets of sides: those of one boundary loop.
fn loops(topology: &Topology, sides: &[Side]) -> UnionFind {
    let mut loops = UnionFind::new(sides.len());
    for (s, side) in sides.iter().enumerate() {
        for v in [side.from, side.to] {
            let (t, k) = fan_end(topology, side.triangle, side.corner, v);
            // The far end of the fan may lie on an edge of many triangles, which is no side.
            if let Ok(other) = sides.binary_search_by_key(&(t, k), |side| (side.triangle, side.corner)) {
                loops.join(s as u32, other as u32);
            }
        }
    }
    loops
}

/// The bare edge at the other end of the fan around `v` that begins at the bare edge opposite to
/// corner `k` of `t`.
fn fan_end(topology: &Topology, mut t: u32, mut k: u32, v: u32) -> (u32, u32) {
    loop {
        let tri = topology.triangles[t as usize];
        let c = topology.corner_of(t, v).unwrap_or(0) as u32;
        let exit = 3 - k - c;
        let across = topology.neighbours[t as usize][exit as usize];
        if across == NONE {
            return (t, exit);
        }
        let shared = tri[k as usize];
        k = topology.triangles[across as usize].iter().position(|&w| w != v && w != shared).unwrap_or(0) as u32;
        t = across;
    }
}

/// Whether texture coordinates or normals differ across a pair.
fn differ(mesh: &Mesh, s: Side, t: Side) -> bool {
    let ends = |side: Side| {
        let corners = mesh.triangle_corners(side.triangle as usize);
        [corners[(side.corner as usize + 1) % 3], corners[(side.corner as usize + 2) % 3]]
    };
    let ([a, b], [c, d]) = (ends(s), ends(t));
    let unlike = |a: Corner, b: Corner| {
        let texcoord = |c: Corner| mesh.texcoords.get(c.texcoord as usize);
        let normal = |c: Corner| mesh.normals.get(c.normal as usize);
        texcoord(a) != texcoord(b) || normal(a) != normal(b)
    };
    unlike(a, d) || unlike(b, c)
}
