//! Which triangle each sample sees.

use std::collections::HashSet;

use glam::{DVec2, DVec3};

use super::scan::{Scan, at_or_above};
use crate::geometry::{Mesh, NONE};

/// Triangles by the bands of sample rows they touch.
pub(super) struct Bands {
    width: u32,
    height: u32,
    rows: u32,
    triangles: Vec<Vec<u32>>,
}

/// What the samples of a band see.
pub(super) struct Fragments {
    /// Samples per row.
    pub(super) width: usize,
    /// First row of the band in the picture.
    pub(super) first_row: usize,
    /// Triangle seen by each sample or [`NONE`].
    pub(super) triangle: Vec<u32>,
    /// Its depth.
    pub(super) depth: Vec<f32>,
}

impl Bands {
    /// Sorts triangles into bands of `rows` rows of a grid of samples.
    pub(super) fn new(mesh: &Mesh, projected: &[DVec3], width: u32, height: u32, rows: u32) -> Self {
        let mut triangles = vec![Vec::new(); height.div_ceil(rows) as usize];
        let first = firsts(projected);
        let mut known = HashSet::with_capacity(mesh.triangle_count());
        for t in 0..mesh.triangle_count() {
            // A copy is nowhere nearer than the first, whatever its vertices are called.
            if !known.insert(mesh.triangle(t).map(|v| first[v as usize])) {
                continue;
            }
            let p = mesh.triangle(t).map(|v| projected[v as usize]);
            if !p.iter().all(|p| p.is_finite()) {
                continue;
            }
            let low = p[0].min(p[1]).min(p[2]);
            let high = p[0].max(p[1]).max(p[2]);
            if high.y < 0.0 || low.y >= f64::from(height) || high.x < 0.0 || low.x >= f64::from(width) {
                continue;
            }
            let first = low.y.max(0.0) as usize / rows as usize;
            let last = (high.y as usize / rows as usize).min(triangles.len() - 1);
            for band in &mut triangles[first..=last] {
                band.push(t as u32);
            }
        }
        Self { width, height, rows, triangles }
    }

    /// Draws one band: the nearest triangle wins, the lowest one on ties. A sample on an edge
    /// belongs to the triangle on its right or below (top-left rule), so that triangles that share
    /// an edge share no sample.
    pub(super) fn draw(&self, band: usize, mesh: &Mesh, projected: &[DVec3]) -> Fragments {
        let first_row = band * self.rows as usize;
        let rows = (self.height as usize - first_row).min(self.rows as usize);
        let width = self.width as usize;
        let mut out = Fragments {
            width,
            first_row,
            triangle: vec![NONE; width * rows],
            depth: vec![f32::INFINITY; width * rows],
        };
        for &t in &self.triangles[band] {
            let p = mesh.triangle(t as usize).map(|v| projected[v as usize]);
            let low = p[0].y.min(p[1].y).min(p[2].y);
            let high = p[0].y.max(p[1].y).max(p[2].y);
            let y0 = at_or_above(low - 0.5).max(first_row);
            let y1 = (high - 0.5).min((first_row + rows) as f64 - 1.0);
            if y1 >= y0 as f64 {
                out.draw(t, p, y0, y1 as usize);
            }
        }
        out
    }
}

/// For each vertex the lowest one at the same place. O(V log V).
fn firsts(projected: &[DVec3]) -> Vec<u32> {
    let place = |v: u32| projected[v as usize].to_array().map(f64::to_bits);
    let mut order: Vec<u32> = (0..projected.len() as u32).collect();
    let mut first = order.clone();
    order.sort_unstable_by(|&a, &b| place(a).cmp(&place(b)).then(a.cmp(&b)));
    for pair in order.windows(2).filter(|pair| place(pair[0]) == place(pair[1])) {
        first[pair[1] as usize] = first[pair[0] as usize];
    }
    first
}

impl Fragments {
    /// Draws what the triangle `t` with corners `p` has in the rows from `y0` to `y1`.
    fn draw(&mut self, t: u32, p: [DVec3; 3], y0: usize, y1: usize) {
        let flat = p.map(DVec3::truncate);
        let scan = Scan::new(flat);
        // A needle without a sample in the band needs no edge functions.
        let mut made = None;
        for course in scan.courses(y0, y1) {
            for rows in course.groups() {
                for y in rows {
                    let edges = match made {
                        Some(edges) => edges,
                        None => match Edges::new(flat) {
                            Some(edges) => *made.insert(edges),
                            // Without area in the picture it owns no sample.
                            None => return,
                        },
                    };
                    self.draw_row(t, p, &edges, y, scan.span(y as f64 + 0.5));
                }
            }
        }
    }

    /// Draws a row of the triangle `t`, whose samples lie between `left` and `right`.
    #[inline]
    fn draw_row(&mut self, t: u32, p: [DVec3; 3], edges: &Edges, y: usize, (left, right): (f64, f64)) {
        let last = (right - 0.5).min(self.width as f64 - 1.0);
        if last < 0.0 {
            return;
        }
        for x in at_or_above(left - 0.5)..=last as usize {
            let Some(b) = edges.inside(DVec2::new(x as f64 + 0.5, y as f64 + 0.5)) else { continue };
            let depth = (b[0] * p[0].z + b[1] * p[1].z + b[2] * p[2].z) as f32;
            let i = (y - self.first_row) * self.width + x;
            if depth < self.depth[i] {
                self.depth[i] = depth;
                self.triangle[i] = t;
            }
        }
    }
}

/// The edge functions of a triangle in the picture.
#[derive(Clone, Copy)]
pub(super) struct Edges {
    p: [DVec2; 3],
    area: f64,
    /// Whether samples on the edge opposite to a corner belong to the triangle.
    owned: [bool; 3],
}

impl Edges {
    /// `None` if the triangle has no area in the picture.
    pub(super) fn new(p: [DVec2; 3]) -> Option<Self> {
        let area = (p[1] - p[0]).perp_dot(p[2] - p[0]);
        if !area.is_finite() || area == 0.0 {
            return None;
        }
        let owned = [0, 1, 2].map(|k| {
            let d = (p[(k + 2) % 3] - p[(k + 1) % 3]) * area.signum();
            // With y down and positive area, left edges run up and top edges run to the right.
            d.y < 0.0 || (d.y == 0.0 && d.x > 0.0)
        });
        Some(Self { p, area, owned })
    }

    /// Barycentric coordinates of a point in the picture's plane.
    pub(super) fn barycentric(&self, x: DVec2) -> [f64; 3] {
        [0, 1, 2].map(|k| {
            let (a, b) = (self.p[(k + 1) % 3], self.p[(k + 2) % 3]);
            // From the end with the lower coordinates, so that both triangles of an edge round
            // alike.
            let swap = (b.x, b.y) < (a.x, a.y);
            let (a, b) = if swap { (b, a) } else { (a, b) };
            let e = (b - a).perp_dot(x - a);
            (if swap { -e } else { e }) / self.area
        })
    }

    /// Whether the front is seen: with y down, counter-clockwise triangles have negative area.
    pub(super) fn front(&self) -> bool {
        self.area < 0.0
    }

    /// Barycentric coordinates of a point the triangle owns.
    fn inside(&self, x: DVec2) -> Option<[f64; 3]> {
        let b = self.barycentric(x);
        (0..3).all(|k| b[k] > 0.0 || (b[k] == 0.0 && self.owned[k])).then_some(b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn draw(points: &[(f64, f64, f64)], triangles: &[[u32; 3]], size: u32) -> Vec<u32> {
        let p: Vec<DVec3> = points.iter().map(|&(x, y, z)| DVec3::new(x, y, z)).collect();
        let mesh = Mesh::of_triangles("test", p.clone(), triangles);
        let bands = Bands::new(&mesh, &p, size, size, 3);
        (0..size.div_ceil(3) as usize).flat_map(|band| bands.draw(band, &mesh, &p).triangle).collect()
    }

    #[test]
    fn a_known_triangle_covers_exactly_its_samples() {
        // Right angle at the origin, legs of 4: samples (x + 1/2, y + 1/2) with x + y + 1 < 4; the
        // diagonal x + y + 1 = 4 is a right edge, hence not owned.
        let seen = draw(&[(0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (0.0, 4.0, 0.0)], &[[0, 1, 2]], 5);
        for y in 0..5 {
            for x in 0..5 {
                let expected = if x + y + 1 < 4 { 0 } else { NONE };
                assert_eq!(seen[y * 5 + x], expected, "({x}, {y})");
            }
        }
    }

    #[test]
    fn copies_are_drawn_once_whatever_their_vertices_are_called() {
        let corners = [DVec3::ZERO, DVec3::new(4.0, 0.0, 0.0), DVec3::new(0.0, 4.0, 0.0)];
        let p: Vec<DVec3> = corners.into_iter().cycle().take(300).chain([DVec3::new(0.0, 4.0, 1.0)]).collect();
        let mut triangles: Vec<[u32; 3]> = (0..100).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        triangles.push([0, 1, 300]);
        let mesh = Mesh::of_triangles("copies", p.clone(), &triangles);
        assert_eq!(Bands::new(&mesh, &p, 5, 5, 5).triangles, [[0, 100]]);
    }

    #[test]
    fn spans_leave_no_sample_of_a_needle_out() {
        // Needles in all directions, against a look at every sample.
        let size = 40;
        for k in 0..200 {
            let angle = f64::from(k) / 200.0 * std::f64::consts::TAU;
            let tip = DVec2::new(20.0, 20.5) + 19.0 * DVec2::from_angle(angle);
            let side = DVec2::from_angle(angle + 1.5) * [1e-3, 0.3, 0.9][k as usize % 3];
            let p = [DVec2::new(20.0, 20.5), tip, tip + side];
            let edges = Edges::new(p).unwrap();
            let seen = draw(&p.map(|p| (p.x, p.y, 0.0)), &[[0, 1, 2]], size);
            for (i, &t) in seen.iter().enumerate() {
                let at = DVec2::new((i as u32 % size) as f64 + 0.5, (i as u32 / size) as f64 + 0.5);
                assert_eq!(t == 0, edges.inside(at).is_some(), "needle {k} at {at}");
            }
        }
    }

    #[test]
    fn neighbours_share_no_sample_and_leave_none_out() {
        // Both halves of a square through sample centres, in both orientations and alone: each
        // sample has exactly one owner.
        let square = [(0.5, 0.5, 0.0), (4.5, 0.5, 0.0), (4.5, 4.5, 0.0), (0.5, 4.5, 0.0)];
        for (a, b) in [([0, 1, 2], [0, 2, 3]), ([0, 2, 1], [0, 3, 2]), ([0, 1, 2], [0, 3, 2])] {
            let (one, other) = (draw(&square, &[a], 6), draw(&square, &[b], 6));
            for y in 0..6 {
                for x in 0..6 {
                    let owners = [&one, &other].iter().filter(|s| s[y * 6 + x] == 0).count();
                    assert_eq!(owners, usize::from(x < 4 && y < 4), "({x}, {y})");
                }
            }
        }
    }

    #[test]
    fn the_nearest_wins_in_any_order() {
        let p = [(0.0, 0.0, 1.0), (9.0, 0.0, 1.0), (0.0, 9.0, 1.0), (0.0, 0.0, 0.5), (9.0, 0.0, 0.5), (0.0, 9.0, 0.5)];
        assert_eq!(draw(&p, &[[0, 1, 2], [3, 4, 5]], 4)[0], 1);
        assert_eq!(draw(&p, &[[3, 4, 5], [0, 1, 2]], 4)[0], 0);
        assert_eq!(draw(&p, &[[0, 1, 2], [0, 1, 2]], 4)[0], 0);
    }

    #[test]
    fn what_is_not_finite_or_flat_is_left_out() {
        let p = [(f64::NAN, 0.0, 0.0), (4.0, 0.0, 0.0), (0.0, 4.0, 0.0), (2.0, 0.0, 0.0)];
        assert!(draw(&p, &[[0, 1, 2], [1, 1, 2], [1, 3, 3]], 5).iter().all(|&t| t == NONE));
    }
}
