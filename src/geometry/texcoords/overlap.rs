//! Where triangles lie on one another in the texture, exactly.

use std::collections::BTreeMap;

use glam::{DVec2, IVec2};
use rayon::prelude::*;
use robust::{Coord, orient2d};

use super::islands::{Islands, orientation};
use crate::geometry::{Mesh, NONE};

/// Pairs of triangles that are compared at most; more are met only where the texture coordinates
/// are of no use, and the rest is told to be unknown.
const MOST_PAIRS: u64 = 4_000_000;
/// Repeats of the texture that a triangle is followed over, per axis.
const MOST_REPEATS: i32 = 8;

/// What counts as an overlap. By default any, however small, in the plane of texture coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OverlapOptions {
    /// Coordinates outside 0..1 wrap around, as in a repeated texture.
    pub repeat: bool,
    /// Triangles of different materials are on different textures.
    pub by_material: bool,
    /// Pairs whose common area is at most this share of the smaller triangle are passed over:
    /// islands that touch overlap a little where a file keeps few digits.
    pub slack: f64,
}

/// Two islands (or one with itself) of which triangles overlap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overlap {
    /// The islands, the lower first.
    pub islands: [u32; 2],
    /// Sum over pairs of triangles of what both cover, in areas of the texture.
    pub area: f64,
    /// Pairs of triangles.
    pub pairs: u64,
}

/// What overlaps in a texture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Overlaps {
    /// By islands.
    pub overlaps: Vec<Overlap>,
    /// Triangles that share a part of the texture with another, ascending.
    pub triangles: Vec<u32>,
    /// All pairs were compared. Where not, there may be more.
    pub complete: bool,
}

/// A triangle of the texture, counter-clockwise, moved into the square 0..1 as far as it is
/// repeated there.
struct Placed {
    triangle: u32,
    corners: [DVec2; 3],
    low: DVec2,
    high: DVec2,
    /// Which of several textures it is on.
    texture: u32,
}

/// The overlaps of triangles in the texture.
///
/// Two triangles overlap if their interiors meet, which is decided exactly (for coordinates that
/// are not moved by a repeat): none of the six edges separates them. Triangles of no island are
/// left out. Time O(n) for an atlas without many overlaps.
pub fn overlaps(mesh: &Mesh, islands: &Islands, options: &OverlapOptions) -> Overlaps {
    let mut complete = true;
    let placed = place(mesh, islands, options, &mut complete);
    let Some((low, high)) = placed.iter().fold(None, |b: Option<(DVec2, DVec2)>, p| match b {
        None => Some((p.low, p.high)),
        Some((l, h)) => Some((l.min(p.low), h.max(p.high))),
    }) else {
        return Overlaps { complete, ..Overlaps::default() };
    };
    let grid = Grid::new(&placed, low, high);
    let mut budget = MOST_PAIRS;
    let mut cells = Vec::new();
    for group in grid.entries.chunk_by(|a, b| a.0 == b.0) {
        let pairs = (group.len() as u64) * (group.len() as u64 - 1) / 2;
        let kept = if pairs > budget { ((2 * budget) as f64).sqrt() as usize } else { group.len() };
        complete &= kept == group.len();
        budget -= pairs.min(budget);
        if kept > 1 {
            cells.push(&group[..kept]);
        }
    }
    let parts: Vec<Part> = cells.par_iter().map(|cell| grid.compare(cell, &placed, islands, options.slack)).collect();
    let mut found = BTreeMap::<[u32; 2], (f64, u64)>::new();
    let mut triangles = Vec::new();
    for part in parts {
        for (key, (area, pairs)) in part.islands {
            let sum = found.entry(key).or_default();
            (sum.0, sum.1) = (sum.0 + area, sum.1 + pairs);
        }
        triangles.extend(part.triangles);
    }
    triangles.sort_unstable();
    triangles.dedup();
    let overlaps = found.into_iter().map(|(islands, (area, pairs))| Overlap { islands, area, pairs }).collect();
    Overlaps { overlaps, triangles, complete }
}

fn place(mesh: &Mesh, islands: &Islands, options: &OverlapOptions, complete: &mut bool) -> Vec<Placed> {
    let mut placed = Vec::with_capacity(mesh.triangle_count());
    for (t, _) in islands.island_of.iter().enumerate().filter(|(_, i)| **i != NONE) {
        let Some(mut uv) = mesh.triangle_texcoords(t) else { continue };
        if orientation(&uv) < 0 {
            uv.swap(1, 2);
        }
        let texture = if options.by_material { mesh.triangle_material(t) } else { 0 };
        let (low, high) = bounds(&uv);
        // Coordinates too large for whole numbers have no place in a texture.
        let reach = |c: f64| c.clamp(-1e6, 1e6) as i32;
        let (first, mut last) = if options.repeat {
            let f = IVec2::new(reach(low.x.floor()), reach(low.y.floor()));
            let l = IVec2::new(reach(high.x.ceil()) - 1, reach(high.y.ceil()) - 1);
            (f, l.max(f))
        } else {
            (IVec2::ZERO, IVec2::ZERO)
        };
        *complete &= (last - first).max_element() < MOST_REPEATS;
        last = last.min(first + IVec2::splat(MOST_REPEATS - 1));
        for ry in first.y..=last.y {
            for rx in first.x..=last.x {
                let corners = uv.map(|p| p - DVec2::new(f64::from(rx), f64::from(ry)));
                let (low, high) = bounds(&corners);
                placed.push(Placed { triangle: t as u32, corners, low, high, texture });
            }
        }
    }
    placed
}

fn bounds(p: &[DVec2; 3]) -> (DVec2, DVec2) {
    (p[0].min(p[1]).min(p[2]), p[0].max(p[1]).max(p[2]))
}

/// Triangles by the cells that their boxes meet.
struct Grid {
    low: DVec2,
    cell: DVec2,
    side: u32,
    /// Cell and index into the placed triangles, sorted.
    entries: Vec<(u32, u32)>,
}

/// What a cell of the grid holds.
struct Part {
    islands: BTreeMap<[u32; 2], (f64, u64)>,
    triangles: Vec<u32>,
}

impl Grid {
    fn new(placed: &[Placed], low: DVec2, high: DVec2) -> Self {
        let mut side = (placed.len() as f64).sqrt().clamp(1.0, 2048.0) as u32;
        loop {
            let cell = ((high - low) / f64::from(side)).max(DVec2::splat(f64::MIN_POSITIVE));
            let mut grid = Self { low, cell, side, entries: Vec::new() };
            let needed: usize = placed.iter().map(|p| grid.count(p)).sum();
            // Large triangles fill many cells: coarser ones then.
            if side > 1 && needed > 16 * placed.len() + 1_000_000 {
                side = side.div_ceil(2);
                continue;
            }
            grid.entries.reserve_exact(needed);
            for (i, p) in placed.iter().enumerate() {
                let ([x0, y0], [x1, y1]) = (grid.at(p.low), grid.at(p.high));
                for y in y0..=y1 {
                    grid.entries.extend((x0..=x1).map(|x| (y * side + x, i as u32)));
                }
            }
            grid.entries.par_sort_unstable();
            return grid;
        }
    }

    fn at(&self, p: DVec2) -> [u32; 2] {
        let c = ((p - self.low) / self.cell).clamp(DVec2::ZERO, DVec2::splat(f64::from(self.side - 1)));
        [c.x as u32, c.y as u32]
    }

    fn count(&self, p: &Placed) -> usize {
        let ([x0, y0], [x1, y1]) = (self.at(p.low), self.at(p.high));
        (x1 - x0 + 1) as usize * (y1 - y0 + 1) as usize
    }

    /// Compares the triangles of a cell with one another.
    fn compare(&self, cell: &[(u32, u32)], placed: &[Placed], islands: &Islands, slack: f64) -> Part {
        let mut part = Part { islands: BTreeMap::new(), triangles: Vec::new() };
        for (k, &(number, i)) in cell.iter().enumerate() {
            let a = &placed[i as usize];
            for &(_, j) in &cell[k + 1..] {
                let b = &placed[j as usize];
                let (low, high) = (a.low.max(b.low), a.high.min(b.high));
                // Pairs that meet in several cells are compared where the lowest corner of their
                // common box is.
                let [x, y] = self.at(low);
                if low.cmpge(high).any() || y * self.side + x != number || a.triangle == b.triangle {
                    continue;
                }
                if a.texture != b.texture || !interiors_meet(&a.corners, &b.corners) {
                    continue;
                }
                let common = common_area(&a.corners, &b.corners);
                let area = |p: &Placed| 0.5 * (p.corners[1] - p.corners[0]).perp_dot(p.corners[2] - p.corners[0]);
                if slack > 0.0 && common <= slack * area(a).min(area(b)) {
                    continue;
                }
                let of = |p: &Placed| islands.island_of[p.triangle as usize];
                let key = [of(a).min(of(b)), of(a).max(of(b))];
                let sum = part.islands.entry(key).or_default();
                *sum = (sum.0 + common, sum.1 + 1);
                part.triangles.extend([a.triangle, b.triangle]);
            }
        }
        part.triangles.sort_unstable();
        part.triangles.dedup();
        part
    }
}

/// Whether the interiors of two counter-clockwise triangles meet, exactly: no edge has the other
/// triangle on its outer side.
pub fn interiors_meet(a: &[DVec2; 3], b: &[DVec2; 3]) -> bool {
    let coord = |p: DVec2| Coord { x: p.x, y: p.y };
    let separates = |a: &[DVec2; 3], b: &[DVec2; 3]| {
        (0..3).any(|k| {
            let (s, e) = (coord(a[k]), coord(a[(k + 1) % 3]));
            b.iter().all(|&p| orient2d(s, e, coord(p)) <= 0.0)
        })
    };
    !separates(a, b) && !separates(b, a)
}

/// The area that two counter-clockwise triangles have in common, up to rounding.
fn common_area(a: &[DVec2; 3], b: &[DVec2; 3]) -> f64 {
    let mut polygon: Vec<DVec2> = a.to_vec();
    for k in 0..3 {
        let (s, e) = (b[k], b[(k + 1) % 3]);
        let side = |p: DVec2| (e - s).perp_dot(p - s);
        let mut inside = Vec::with_capacity(polygon.len() + 1);
        for (i, &p) in polygon.iter().enumerate() {
            let q = polygon[(i + 1) % polygon.len()];
            let (dp, dq) = (side(p), side(q));
            if dp >= 0.0 {
                inside.push(p);
            }
            if (dp > 0.0 && dq < 0.0) || (dp < 0.0 && dq > 0.0) {
                inside.push(p.lerp(q, dp / (dp - dq)));
            }
        }
        polygon = inside;
    }
    let Some(&o) = polygon.first() else { return 0.0 };
    0.5 * polygon.windows(2).map(|w| (w[0] - o).perp_dot(w[1] - o)).sum::<f64>().max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::shapes::{Diagonal, Random, plane_grid};
    use glam::DVec3;

    fn soup(n: usize, seed: u64) -> Mesh {
        let mut random = Random::new(seed);
        let mut mesh = crate::geometry::MeshBuilder::new("soup");
        for t in 0..n as u32 {
            let (x, y) = (random.unit(), random.unit());
            for _ in 0..3 {
                mesh.mesh.positions.push(DVec3::new(random.unit(), random.unit(), random.unit()));
                mesh.mesh.texcoords.push(DVec2::new(x + 0.1 * random.signed(), y + 0.1 * random.signed()));
            }
            mesh.polygon([3 * t, 3 * t + 1, 3 * t + 2].map(|v| crate::geometry::Corner {
                vertex: v,
                texcoord: v,
                normal: NONE,
            }));
        }
        mesh.finish()
    }

    #[test]
    fn the_grid_finds_what_brute_force_finds() {
        for (n, seed) in [(2, 1), (40, 2), (300, 3)] {
            let mesh = soup(n, seed);
            let islands = Islands::new(&mesh);
            let found = overlaps(&mesh, &islands, &OverlapOptions::default());
            let uv = |t: usize| {
                let mut uv = mesh.triangle_texcoords(t).unwrap();
                if orientation(&uv) < 0 {
                    uv.swap(1, 2);
                }
                uv
            };
            let mut pairs = 0;
            for a in 0..n {
                pairs += (a + 1..n).filter(|&b| interiors_meet(&uv(a), &uv(b))).count() as u64;
            }
            assert_eq!(found.overlaps.iter().map(|o| o.pairs).sum::<u64>(), pairs);
            assert!(found.complete && (pairs == 0) == found.triangles.is_empty());
        }
    }

    #[test]
    fn neighbours_touch_and_a_nudge_of_one_bit_overlaps() {
        let mut mesh = plane_grid(12, 9, 1.0, 1.0, Diagonal::default());
        assert_eq!(
            overlaps(&mesh, &Islands::new(&mesh), &OverlapOptions::default()),
            Overlaps { complete: true, ..Overlaps::default() }
        );
        // Two triangles that share an edge in space but not in the texture, one moved into the
        // other by the smallest step.
        let cut = mesh.texcoords.len() as u32;
        let (a, b, c) = (DVec2::new(0.25, 0.25), DVec2::new(0.75, 0.25), DVec2::new(0.5, 0.75));
        mesh.texcoords.extend([a, b, c, b, a, DVec2::new(0.5, 0.0)]);
        let corner = |k: u32| crate::geometry::Corner { vertex: k % 3, texcoord: cut + k, normal: NONE };
        let two = |mesh: &Mesh| {
            let mut two = crate::geometry::MeshBuilder::new("two");
            two.mesh.positions = mesh.positions[..3].to_vec();
            two.mesh.texcoords = mesh.texcoords.clone();
            two.polygon([0, 1, 2].map(corner));
            two.polygon([3, 4, 5].map(corner));
            two.finish()
        };
        let count = |mesh: &Mesh| overlaps(mesh, &Islands::new(mesh), &OverlapOptions::default()).triangles.len();
        assert_eq!(count(&two(&mesh)), 0);
        mesh.texcoords[cut as usize + 3].y = f64::from_bits(0.25f64.to_bits() + 1);
        assert_eq!(count(&two(&mesh)), 2);
    }

    #[test]
    fn repeats_wrap_around() {
        let mut mesh = soup(1, 1);
        let square = |x: f64| [DVec2::new(x, 0.2), DVec2::new(x + 0.3, 0.2), DVec2::new(x, 0.5)];
        mesh.texcoords = square(0.1).into_iter().chain(square(2.15)).collect();
        let mut builder = crate::geometry::MeshBuilder::new("two");
        builder.mesh.positions = (0..6).map(|k| DVec3::new(f64::from(k), f64::from(k * k), 0.0)).collect();
        builder.mesh.texcoords = mesh.texcoords.clone();
        for t in 0..2u32 {
            builder.polygon([0, 1, 2].map(|k| crate::geometry::Corner {
                vertex: 3 * t + k,
                texcoord: 3 * t + k,
                normal: NONE,
            }));
        }
        let mesh = builder.finish();
        let islands = Islands::new(&mesh);
        assert!(overlaps(&mesh, &islands, &OverlapOptions::default()).overlaps.is_empty());
        let found = overlaps(&mesh, &islands, &OverlapOptions { repeat: true, ..OverlapOptions::default() });
        // The common part is a right triangle with legs 0.25.
        let little = OverlapOptions { repeat: true, slack: 0.9, ..OverlapOptions::default() };
        assert!(overlaps(&mesh, &islands, &little).triangles.is_empty());
        assert!((found.overlaps[0].area - 0.5 * 0.25 * 0.25).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn hopeless_textures_end() {
        // All triangles on the same place.
        let n = 4000;
        let mut mesh = soup(n, 4);
        for t in 0..n {
            for (k, uv) in [DVec2::ZERO, DVec2::X, DVec2::Y].into_iter().enumerate() {
                mesh.texcoords[3 * t + k] = uv;
            }
        }
        let found =
            overlaps(&mesh, &Islands::new(&mesh), &OverlapOptions { repeat: true, ..OverlapOptions::default() });
        assert!(!found.complete && found.triangles.len() > 1000);
    }
}
