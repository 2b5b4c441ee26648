//! A map sampled on an adaptive lattice of its source: for previews, and for starts of exact
//! inverses.

use std::collections::HashMap;

use glam::{DVec2, UVec2};

use crate::error::{Error, Result};

/// How fine a [`Lattice`] is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LatticeOptions {
    /// Side of the coarsest cells, in the units of the polygons. Nodes are half as far apart.
    pub cell: f64,
    /// How many times a cell may be halved.
    pub depth: u32,
    /// A cell is divided while the distance of an image inside it from its interpolation is
    /// estimated above this.
    pub tolerance: f64,
    /// Most nodes; no more cells are divided when there are as many.
    pub nodes: usize,
}

impl Default for LatticeOptions {
    /// For pictures, in pixels: nodes 8 apart, 0.5 near the vertices of a cage, error below 0.05.
    fn default() -> Self {
        Self { cell: 16.0, depth: 6, tolerance: 0.04, nodes: 1 << 22 }
    }
}

/// Triangles in the source with the images of their vertices: a continuous, piecewise linear
/// approximation of a map.
///
/// A quadtree of square cells over a rectangle. Each cell knows the images of its corners, of the
/// middles of its sides and of its centre; where these are far from the means of the corners the
/// map bends, and the cell is divided. Cells are cut into triangles around their centres through
/// every node on their sides, so that cells of different size leave no crack.
#[derive(Clone, Debug)]
pub struct Lattice {
    /// Nodes in the source.
    pub points: Vec<DVec2>,
    /// Their images.
    pub images: Vec<DVec2>,
    /// Triangles of nodes, anticlockwise in the source.
    pub triangles: Vec<[u32; 3]>,
}

/// A square of the quadtree, in units of the finest nodes.
#[derive(Clone, Copy)]
struct Cell {
    corner: UVec2,
    /// Half the side.
    half: u32,
}

impl Cell {
    /// Corners, middles of the sides and centre.
    fn nodes(self) -> [UVec2; 9] {
        let h = self.half;
        std::array::from_fn(|i| self.corner + UVec2::new(i as u32 % 3 * h, i as u32 / 3 * h))
    }
}

/// Nodes by their place, in the order they were asked for.
struct Nodes {
    index: HashMap<UVec2, u32>,
    places: Vec<UVec2>,
}

impl Nodes {
    fn want(&mut self, place: UVec2) {
        let next = self.places.len() as u32;
        if *self.index.entry(place).or_insert(next) == next {
            self.places.push(place);
        }
    }
}

impl Lattice {
    /// Samples a map over the rectangle from `low` to `high`; `map` gives the images of many points
    /// at once and is called once for every depth.
    ///
    /// # Errors
    /// Those of `map`; [`Error::Input`] if the rectangle or the options are empty or not finite, or
    /// the coarsest cells alone have more nodes than allowed.
    pub fn new(
        low: DVec2,
        high: DVec2,
        options: &LatticeOptions,
        mut map: impl FnMut(&[DVec2]) -> Result<Vec<DVec2>>,
    ) -> Result<Self> {
        let size = high - low;
        let depth = options.depth.min(12);
        // One more than the cells in a row, so that the count is right for sides that are no
        // multiple of a cell.
        let across = (size / options.cell).ceil().max(DVec2::ONE);
        let nodes = (2.0 * across.x + 1.0) * (2.0 * across.y + 1.0);
        if !(size.x > 0.0 && size.y > 0.0 && nodes <= options.nodes as f64 && options.tolerance > 0.0) {
            return Err(Error::input(
                format!("a lattice of {} x {} with cells of {}", size.x, size.y, options.cell),
                format!(
                    "Give a rectangle with an area, and cells so large that there are at most {} nodes",
                    options.nodes
                ),
            ));
        }
        let half = 1_u32 << depth;
        let unit = options.cell / f64::from(2 * half);
        let mut nodes = Nodes { index: HashMap::new(), places: Vec::new() };
        let mut open: Vec<Cell> = (0..across.y as u32)
            .flat_map(|y| (0..across.x as u32).map(move |x| Cell { corner: UVec2::new(x, y) * 2 * half, half }))
            .collect();
        let mut leaves = Vec::new();
        let (mut points, mut images): (Vec<DVec2>, Vec<DVec2>) = (Vec::new(), Vec::new());
        while !open.is_empty() {
            for place in open.iter().flat_map(|c| c.nodes()) {
                nodes.want(place);
            }
            let fresh: Vec<DVec2> = nodes.places[points.len()..].iter().map(|p| low + p.as_dvec2() * unit).collect();
            images.extend(map(&fresh)?);
            points.extend(fresh);
            let image = |p: UVec2| images[nodes.index[&p] as usize];
            let room = (options.nodes.saturating_sub(points.len()) / 16).max(1);
            let mut divided = Vec::new();
            for cell in open {
                if cell.half > 1 && divided.len() / 4 < room && bend(cell.nodes().map(image)) > options.tolerance {
                    let half = cell.half / 2;
                    let quarter = [(0, 0), (1, 0), (0, 1), (1, 1)];
                    divided.extend(
                        quarter.map(|(x, y)| Cell { corner: cell.corner + UVec2::new(x, y) * cell.half, half }),
                    );
                } else {
                    leaves.push(cell);
                }
            }
            open = divided;
        }
        let mut triangles = Vec::with_capacity(8 * leaves.len());
        let mut ring = Vec::new();
        for cell in leaves {
            ring.clear();
            let [a, _, b, _, centre, _, d, _, c] = cell.nodes();
            for (from, to) in [(a, b), (b, c), (c, d), (d, a)] {
                side(&nodes.index, from, to, &mut ring);
            }
            let centre = nodes.index[&centre];
            triangles.extend((0..ring.len()).map(|i| [centre, ring[i], ring[(i + 1) % ring.len()]]));
        }
        Ok(Self { points, images, triangles })
    }

    /// The images again, of a map that has changed, at the same nodes: what a frame of dragging
    /// needs.
    ///
    /// # Errors
    /// Those of `map`.
    pub fn update(&mut self, mut map: impl FnMut(&[DVec2]) -> Result<Vec<DVec2>>) -> Result<()> {
        self.images = map(&self.points)?;
        Ok(())
    }
}

/// Estimate of the interpolation's error in a cell of nine nodes. The triangles have half the side
/// of the cell, so that they leave a quarter of what the corners alone leave at the other nodes.
fn bend(f: [DVec2; 9]) -> f64 {
    let off = |a: usize, b: usize, middle: usize| (f[a] + f[b]) * 0.5 - f[middle];
    let all = [off(0, 2, 1), off(0, 6, 3), off(2, 8, 5), off(6, 8, 7), off(0, 8, 4), off(2, 6, 4)];
    let most = all.iter().fold(0.0, |m, d| f64::max(m, d.length_squared()));
    0.25 * most.sqrt()
}

/// All nodes from `from` to just before `to`, in order: finer neighbours have put more of them
/// between.
fn side(index: &HashMap<UVec2, u32>, from: UVec2, to: UVec2, out: &mut Vec<u32>) {
    let sum = from + to;
    let middle = sum / 2;
    if sum % 2 == UVec2::ZERO && from != to && middle != from && index.contains_key(&middle) {
        side(index, from, middle, out);
        side(index, middle, to, out);
    } else {
        out.push(index[&from]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bent(p: DVec2) -> DVec2 {
        // A cone at (20, 12): bent most where it has no derivative, as maps are at the vertices of
        // a cage.
        let r = (p - DVec2::new(20.0, 12.0)).length();
        p + DVec2::new(0.3 * r, 0.0)
    }

    fn lattice(tolerance: f64) -> Lattice {
        let options = LatticeOptions { tolerance, ..LatticeOptions::default() };
        Lattice::new(DVec2::ZERO, DVec2::new(64.0, 48.0), &options, |p| Ok(p.iter().map(|p| bent(*p)).collect()))
            .unwrap()
    }

    fn area(p: &[DVec2], t: [u32; 3]) -> f64 {
        let [a, b, c] = t.map(|i| p[i as usize]);
        0.5 * (b - a).perp_dot(c - a)
    }

    #[test]
    fn triangles_tile_the_rectangle_without_cracks() {
        let l = lattice(0.02);
        let sum: f64 = l.triangles.iter().map(|t| area(&l.points, *t)).sum();
        assert!((sum - 64.0 * 48.0).abs() < 1e-9, "{sum}");
        assert!(l.triangles.iter().all(|t| area(&l.points, *t) > 0.0));
        // An inner edge has two triangles, in opposite directions; an edge of the rectangle has
        // one.
        let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
        for t in &l.triangles {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                *edges.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
            }
        }
        let on_rim = |i: u32| {
            let p = l.points[i as usize];
            p.x == 0.0 || p.y == 0.0 || p.x == 64.0 || p.y == 48.0
        };
        assert!(edges.iter().all(|(&(a, b), &n)| n == 0 || (on_rim(a) && on_rim(b))));
    }

    #[test]
    fn it_is_fine_only_where_the_map_bends_and_as_accurate_as_asked() {
        let (coarse, fine) = (lattice(10.0), lattice(0.05));
        assert_eq!(coarse.points.len(), 9 * 7, "a loose tolerance leaves the coarsest cells");
        assert!(fine.points.len() > 63 && fine.points.len() < 1000, "{}", fine.points.len());
        let worst = |l: &Lattice| {
            l.triangles.iter().fold(0.0, |m, t| {
                let middle = |p: &[DVec2]| t.iter().map(|&i| p[i as usize]).sum::<DVec2>() / 3.0;
                f64::max(m, (bent(middle(&l.points)) - middle(&l.images)).length())
            })
        };
        assert!(worst(&fine) < 0.1, "{}", worst(&fine));
        assert!(worst(&coarse) > 0.1, "the measure sees a coarse lattice: {}", worst(&coarse));
    }

    #[test]
    fn hostile_rectangles_are_refused() {
        let id = |p: &[DVec2]| Ok(p.to_vec());
        for (high, cell) in [(DVec2::ZERO, 16.0), (DVec2::NAN, 16.0), (DVec2::splat(1e9), 1.0), (DVec2::ONE, 0.0)] {
            let options = LatticeOptions { cell, ..LatticeOptions::default() };
            assert!(Lattice::new(DVec2::ZERO, high, &options, id).is_err());
        }
    }
}
