//! Places: vertices that lie on one another, within rounding, in every layer.

use std::cmp::Ordering;

use glam::DVec3;

use super::ROUNDING;
use super::sides::Side;
use crate::geometry::union_find::UnionFind;
use crate::geometry::{NONE, Topology};

/// A cell of more points than this is too dense for its tolerance: nothing in it is moved.
const CROWD: usize = 64;

/// The place of every corner of a triangle with an open side; [`NONE`] for all other vertices. O(n
/// log n).
pub(super) fn places(topology: &Topology, sides: &[Side], layers: &[&[DVec3]]) -> Vec<u32> {
    let mut corners: Vec<u32> = sides.iter().flat_map(|s| topology.triangles[s.triangle as usize]).collect();
    corners.sort_unstable();
    corners.dedup();
    let compare =
        |a: u32, b: u32| layers.iter().fold(Ordering::Equal, |order, layer| order.then_with(|| order_of(layer, a, b)));
    let mut sorted = corners;
    sorted.sort_by(|&a, &b| compare(a, b));
    // The lowest vertex of each place: the sort is stable.
    let mut place = vec![NONE; layers[0].len()];
    let mut distinct: Vec<u32> = Vec::new();
    for group in sorted.chunk_by(|&a, &b| compare(a, b) == Ordering::Equal) {
        for &v in group {
            place[v as usize] = distinct.len() as u32;
        }
        distinct.push(group[0]);
    }
    let tolerances: Vec<f64> = layers.iter().map(|layer| rounding(layer, topology)).collect();
    let mut sets = UnionFind::new(distinct.len());
    let grid = Grid::new(&distinct, layers[0], tolerances[0]);
    for (i, &v) in distinct.iter().enumerate() {
        grid.near(layers[0][v as usize], |j| {
            let w = distinct[j as usize] as usize;
            let near = |(layer, tolerance): (&&[DVec3], &f64)| layer[v as usize].distance(layer[w]) <= *tolerance;
            if (j as usize) < i && layers.iter().zip(&tolerances).all(near) {
                sets.join(i as u32, j);
            }
        });
    }
    for p in place.iter_mut().filter(|p| **p != NONE) {
        *p = sets.root(*p);
    }
    place
}

/// The order of two vertices by x, y, z; -0 equals 0.
fn order_of(layer: &[DVec3], a: u32, b: u32) -> Ordering {
    let (a, b) = (layer[a as usize], layer[b as usize]);
    let pairs = [(a.x, b.x), (a.y, b.y), (a.z, b.z)];
    pairs.into_iter().fold(Ordering::Equal, |order, (x, y)| order.then_with(|| (x + 0.0).total_cmp(&(y + 0.0))))
}

/// What rounding may do to these positions: a fraction of their diagonal, or a few units in the
/// last place of coordinates far from the origin. 0 where that is no number.
fn rounding(layer: &[DVec3], topology: &Topology) -> f64 {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for (p, _) in layer.iter().zip(&topology.vertex_component).filter(|(_, c)| **c != NONE) {
        (low, high) = (low.min(*p), high.max(*p));
    }
    let last_place = 4.0 * f64::EPSILON * low.abs().max(high.abs()).max_element();
    let tolerance = (ROUNDING * low.distance(high)).max(last_place);
    if tolerance.is_finite() { tolerance } else { 0.0 }
}

/// Points in cubes of a size that fits a tolerance, found by sorting.
pub(super) struct Grid {
    tolerance: f64,
    cell: f64,
    /// Cell and index, ascending.
    entries: Vec<([i64; 3], u32)>,
}

impl Grid {
    /// The points `positions[vertices[i]]`, to be found within `tolerance`.
    pub(super) fn new(vertices: &[u32], positions: &[DVec3], tolerance: f64) -> Self {
        let mut grid = Self { tolerance, cell: 16.0 * tolerance, entries: Vec::new() };
        if tolerance > 0.0 {
            grid.entries =
                (0..vertices.len()).map(|i| (grid.cell_of(positions[vertices[i] as usize]), i as u32)).collect();
            grid.entries.sort_unstable();
        }
        grid
    }

    fn cell_of(&self, p: DVec3) -> [i64; 3] {
        (p / self.cell).floor().to_array().map(|x| x as i64)
    }

    /// Visits the indices of all points in the cells within the tolerance of `p`, in an order that
    /// depends on the points alone. Crowded cells are passed over.
    pub(super) fn near(&self, p: DVec3, mut visit: impl FnMut(u32)) {
        if self.entries.is_empty() {
            return;
        }
        let (low, high) = (self.cell_of(p - self.tolerance), self.cell_of(p + self.tolerance));
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    let cell = [x, y, z];
                    let first = self.entries.partition_point(|e| e.0 < cell);
                    let here = self.entries[first..].iter().take(CROWD + 1).take_while(|e| e.0 == cell);
                    if here.clone().count() <= CROWD {
                        here.for_each(|e| visit(e.1));
                    }
                }
            }
        }
    }
}
