//! T-junctions: an open edge on one side of a crack, and several shorter ones, end to end, on the
//! other; or several on both sides that end at different places.

use std::collections::HashMap;

use glam::DVec3;

use super::sides::{Pair, Side};
use crate::geometry::pieces::OnEdge;

/// A corner lies on an edge within this part of its length.
const ON_EDGE: f64 = 1e-5;
/// It also does within this part of the size of the mesh: files round positions to six digits.
const SIX_DIGITS: f64 = 1e-6;
/// But never farther than this part of the edge's length.
const FAR: f64 = 1e-2;
/// More open edges than this that begin at one place are not looked through.
const CROWD: usize = 64;

/// Two rows of open edges that run along one another in opposite directions from a common place to
/// the next one.
#[derive(Debug)]
pub(super) struct Zip {
    /// Vertices that are one: at both ends, and between the edges of a row.
    pub(super) joins: Vec<Pair>,
    /// Vertices of one row on the edges of the other.
    pub(super) cuts: Vec<OnEdge>,
    /// The edges that have some.
    pub(super) edges: usize,
}

/// All of them among the sides `alone`; `layers` are positions of the vertices, and a vertex lies
/// on an edge if it does in each. O(n) for any valence.
pub(super) fn zips(sides: &[Side], alone: &[u32], place: &[u32], layers: &[&[DVec3]], size: f64) -> Vec<Zip> {
    let at = |v: u32| place[v as usize];
    let (mut beginning, mut ending) = (HashMap::<u32, Vec<u32>>::new(), HashMap::<u32, Vec<u32>>::new());
    for &s in alone {
        beginning.entry(at(sides[s as usize].from)).or_default().push(s);
        ending.entry(at(sides[s as usize].to)).or_default().push(s);
    }
    let walk = Walk { sides, place, layers, size, beginning, ending };
    let mut taken = vec![false; sides.len()];
    let mut found = Vec::new();
    for &s in alone {
        let Some(rows) = walk.rows(s).filter(|rows| rows.concat().iter().all(|r| !taken[*r as usize])) else {
            continue;
        };
        rows.concat().iter().for_each(|r| taken[*r as usize] = true);
        found.extend(walk.zip(&rows));
    }
    found
}

struct Walk<'a> {
    sides: &'a [Side],
    place: &'a [u32],
    layers: &'a [&'a [DVec3]],
    size: f64,
    /// Sides by the place that they begin at, and end at.
    beginning: HashMap<u32, Vec<u32>>,
    ending: HashMap<u32, Vec<u32>>,
}

impl Walk<'_> {
    /// Where vertex `v` lies along the edge from `a` to `b`, if it lies on it between the ends.
    fn along(&self, v: u32, [a, b]: [u32; 2]) -> Option<f64> {
        let [p, a, b] = [v, a, b].map(|v| v as usize);
        let first = self.layers[0];
        let way = first[b] - first[a];
        let along = (first[p] - first[a]).dot(way) / way.length_squared();
        let near = |layer: &&[DVec3]| {
            let length = layer[a].distance(layer[b]);
            let most = (ON_EDGE * length).max(SIX_DIGITS * self.size).min(FAR * length);
            layer[p].distance(layer[a].lerp(layer[b], along)) <= most
        };
        (along > 0.0 && along < 1.0 && self.layers.iter().all(near)).then_some(along)
    }

    /// The far end of the last side of a row; row 1 runs against the direction of its sides.
    fn far(&self, rows: &[Vec<u32>; 2], row: usize) -> Option<u32> {
        let side = self.sides[*rows[row].last()? as usize];
        Some(if row == 0 { side.to } else { side.from })
    }

    /// Which row is behind, and where on the other one's last side its end lies; the row is `None`
    /// where both end at one place. `None` where the rows part.
    fn behind(&self, rows: &[Vec<u32>; 2]) -> Option<(Option<usize>, f64)> {
        let ends = [self.far(rows, 0)?, self.far(rows, 1)?];
        if self.place[ends[0] as usize] == self.place[ends[1] as usize] {
            return Some((None, 0.0));
        }
        (0..2).find_map(|row| {
            let other = self.sides[*rows[1 - row].last()? as usize];
            self.along(ends[row], [other.from, other.to]).map(|along| (Some(row), along))
        })
    }

    /// The two rows that begin with side `s`, if they come to a common place again.
    fn rows(&self, s: u32) -> Option<[Vec<u32>; 2]> {
        let start = self.place[self.sides[s as usize].from as usize];
        let partners = self.ending.get(&start)?.iter().take(CROWD);
        partners.map(|&t| [vec![s], vec![t]]).find_map(|mut rows| {
            loop {
                let Some(row) = self.behind(&rows)?.0 else {
                    // Two single sides on one another were looked at before.
                    return (rows[0].len() + rows[1].len() > 2).then_some(rows);
                };
                let here = self.place[self.far(&rows, row)? as usize];
                let next = if row == 0 { &self.beginning } else { &self.ending };
                let last = *rows[row].last()?;
                let other = *rows[1 - row].last()?;
                let next = next.get(&here)?.iter().take(CROWD).copied().find(|&t| {
                    let mut tried = [vec![other], vec![other]];
                    tried[row] = vec![t];
                    self.goes_on(last, t) && self.behind(&tried).is_some()
                })?;
                rows[row].push(next);
            }
        })
    }

    /// Whether side `t` leads on from side `last` of the same row, and does not turn back.
    fn goes_on(&self, last: u32, t: u32) -> bool {
        let way = |s: u32| {
            let side = self.sides[s as usize];
            self.layers[0][side.to as usize] - self.layers[0][side.from as usize]
        };
        way(last).dot(way(t)) > 0.0
    }

    /// What two rows make one.
    fn zip(&self, rows: &[Vec<u32>; 2]) -> Option<Zip> {
        let side = |row: usize, k: usize| self.sides[rows[row][k] as usize];
        let [m, n] = [rows[0].len(), rows[1].len()];
        let mut joins = vec![(side(0, 0).from, side(1, 0).to), (side(0, m - 1).to, side(1, n - 1).from)];
        joins.extend((1..m).map(|k| (side(0, k - 1).to, side(0, k).from)));
        joins.extend((1..n).map(|k| (side(1, k - 1).from, side(1, k).to)));
        let mut cuts = Vec::new();
        let mut edges = Vec::new();
        let mut reached = [vec![rows[0][0]], vec![rows[1][0]]];
        let mut next = [1, 1];
        while let (Some(row), along) = self.behind(&reached)? {
            let cut = *reached[1 - row].last()?;
            let Side { triangle, corner, .. } = self.sides[cut as usize];
            cuts.push(OnEdge { triangle, corner, along, vertex: self.far(&reached, row)? });
            edges.push(cut);
            reached[row].push(*rows[row].get(next[row])?);
            next[row] += 1;
        }
        edges.sort_unstable();
        edges.dedup();
        Some(Zip { joins, cuts, edges: edges.len() })
    }
}
