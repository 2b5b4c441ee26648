//! Which triangle each sample sees.

use std::collections::HashSet;

use glam::{DVec2, DVec3};

use crate::geometry::{Mesh, NONE};

/// Slack of spans in parts of the largest coordinate: a few times the rounding of an interpolation,
/// far below a sample.
const SLACK: f64 = 1e-12;

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
        let mut known = HashSet::with_capacity(mesh.triangle_count());
        for t in 0..mesh.triangle_count() {
            // A copy is nowhere nearer than the first.
            if !known.insert(mesh.triangle(t)) {
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
            let Some(edges) = Edges::new(p.map(DVec3::truncate)) else { continue };
            let low = p[0].min(p[1]).min(p[2]);
            let high = p[0].max(p[1]).max(p[2]);
            let y0 = at_or_above(low.y - 0.5).max(first_row);
            let y1 = (high.y - 0.5).min((first_row + rows) as f64 - 1.0);
            if y1 < 0.0 {
                continue;
            }
            let scan = Scan::new(edges.p);
            for y in y0..=y1 as usize {
                // Only what the triangle has in this row: the box around a needle is nearly empty.
                // Most rows of a needle hold no sample, so that a row must cost little.
                let (left, right) = scan.span(y as f64 + 0.5);
                if !holds_a_sample(left, right) {
                    continue;
                }
                let last = (right - 0.5).min(width as f64 - 1.0);
                if last < 0.0 {
                    continue;
                }
                for x in at_or_above(left - 0.5)..=last as usize {
                    let Some(b) = edges.inside(DVec2::new(x as f64 + 0.5, y as f64 + 0.5)) else { continue };
                    let depth = (b[0] * p[0].z + b[1] * p[1].z + b[2] * p[2].z) as f32;
                    let i = (y - first_row) * width + x;
                    if depth < out.depth[i] {
                        out.depth[i] = depth;
                        out.triangle[i] = t;
                    }
                }
            }
        }
        out
    }
}

/// The edge functions of a triangle in the picture.
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

/// The courses of a triangle's sides from row to row.
struct Scan {
    /// From the lowest to the highest row.
    p: [DVec2; 3],
    /// Steps along x per row: of the side from the first corner to the last, from the first to the
    /// second, from the second to the last.
    steps: [f64; 3],
    slack: f64,
}

impl Scan {
    fn new(mut p: [DVec2; 3]) -> Self {
        for (i, j) in [(0, 1), (1, 2), (0, 1)] {
            if p[j].y < p[i].y {
                p.swap(i, j);
            }
        }
        // A side within a row is met at its end points alone.
        let step = |a: DVec2, b: DVec2| if b.y > a.y { (b.x - a.x) / (b.y - a.y) } else { 0.0 };
        let largest = p.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
        Self { p, steps: [step(p[0], p[2]), step(p[0], p[1]), step(p[1], p[2])], slack: SLACK * largest }
    }

    /// First and last place that the triangle may own in the row at `y`, which meets it; wider than
    /// it by more than rounding.
    fn span(&self, y: f64) -> (f64, f64) {
        let [a, b, _] = self.p;
        let through = a.x + (y - a.y) * self.steps[0];
        let around = if y < b.y { a.x + (y - a.y) * self.steps[1] } else { b.x + (y - b.y) * self.steps[2] };
        let (left, right) = if through < around { (through, around) } else { (around, through) };
        (left - self.slack, right + self.slack)
    }
}

/// Added and taken away again, it leaves the nearest whole number: between 2^52 and 2^53 doubles are
/// whole. A conversion takes several times as long.
const TO_WHOLE: f64 = 1.5 * (1u64 << 52) as f64;

/// Whether the centre of a sample lies between two places of a row.
#[inline(always)]
fn holds_a_sample(left: f64, right: f64) -> bool {
    let middle = 0.5 * (left + right) - 0.5;
    let nearest = (middle + TO_WHOLE) - TO_WHOLE;
    (middle - nearest).abs() <= 0.5 * (right - left)
}

/// The first whole number that is not below `x`, nor below zero: `ceil` is a call where the
/// processor's least features are assumed.
fn at_or_above(x: f64) -> usize {
    let whole = x as usize;
    whole.saturating_add(usize::from((whole as f64) < x))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn draw(points: &[(f64, f64, f64)], triangles: &[[u32; 3]], size: u32) -> Vec<u32> {
        let p: Vec<DVec3> = points.iter().map(|&(x, y, z)| DVec3::new(x, y, z)).collect();
        let mesh = Mesh::from_triangles("test", p.clone(), triangles);
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
    fn places_of_a_row_hold_a_sample_or_none() {
        for (left, right, held) in [
            (0.5, 0.5, true),
            (0.4, 0.45, false),
            (0.51, 1.49, false),
            (0.51, 1.51, true),
            (-3.0, -2.4, true),
            (-0.4, 0.4, false),
            (1e6 + 0.4, 1e6 + 0.6, true),
            (7.6, 8.4, false),
            (0.6, 3.1, true),
        ] {
            assert_eq!(holds_a_sample(left, right), held, "{left} to {right}");
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
