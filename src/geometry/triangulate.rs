//! Polygons of a mesh as triangles that lie inside them.
//!
//! A polygon of n corners has n - 2 triangles. It keeps the fan from its first corner where all
//! triangles of the fan have positive area on the polygon's best plane, which is so for every
//! convex one. Else two triangles of the other diagonal are taken for four corners, and the
//! constrained Delaunay triangulation on that plane for more. Corners may lie on an edge, and a
//! hole may be joined to the outline by an edge there and back. What is no outline of a region (it
//! crosses itself, has no area, is not finite) has no inside and keeps the fan.
//!
//! Triangles name corners in ascending order, which is the orientation of the polygon, and are
//! sorted by them.

use std::collections::HashMap;

use glam::{DVec2, DVec3};
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation as _};

/// A triangle turns by at least this sine at its first corner; what turns less is a line, within
/// rounding.
const LEAST_TURN: f64 = 1e-9;
/// Coordinates below this fraction of the polygon are zero: the triangulation has no room for
/// smaller ones.
const ZERO: f64 = 1e-30;

/// The triangles of a polygon as numbers of its corners, at least three. O(n), for a polygon
/// without a valid fan O(n log n).
pub(crate) fn triangulate(corners: &[DVec3]) -> Vec<[u32; 3]> {
    let n = corners.len() as u32;
    let fan = || (2..n).map(|k| [0, k - 1, k]).collect();
    if n == 3 {
        return fan();
    }
    let normal = area_normal(corners).normalize_or_zero();
    let is_inside = |[a, b, c]: [u32; 3]| {
        let [a, b, c] = [a, b, c].map(|k| corners[k as usize]);
        (b - a).cross(c - a).dot(normal) > LEAST_TURN * (b - a).length() * (c - a).length()
    };
    if normal == DVec3::ZERO || (2..n).all(|k| is_inside([0, k - 1, k])) {
        return fan();
    }
    if n == 4 {
        let other = [[0, 1, 3], [1, 2, 3]];
        return if other.into_iter().all(is_inside) { other.to_vec() } else { fan() };
    }
    Outline::new(corners, normal).and_then(|outline| outline.triangles()).unwrap_or_else(fan)
}

/// Twice the area of a polygon as a vector along its normal (Newell's method), about the first
/// corner.
fn area_normal(corners: &[DVec3]) -> DVec3 {
    let origin = corners[0];
    corners.windows(2).map(|w| (w[0] - origin).cross(w[1] - origin)).sum()
}

/// A polygon on its plane, and the triangles between its points.
struct Outline {
    /// The point of every corner; corners on one place share it.
    point: Vec<usize>,
    /// The corners at every point.
    corners: Vec<Vec<u32>>,
    /// Anticlockwise.
    faces: Vec<[usize; 3]>,
    /// The face to the left of a directed edge.
    left: HashMap<(usize, usize), usize>,
}

impl Outline {
    /// `None` where edges cross or nothing can be triangulated.
    fn new(positions: &[DVec3], normal: DVec3) -> Option<Self> {
        let (x, y) = normal.any_orthonormal_pair();
        let flat: Vec<DVec2> =
            positions.iter().map(|p| *p - positions[0]).map(|p| DVec2::new(p.dot(x), p.dot(y))).collect();
        let size = flat.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
        let number = |x: f64| if (x / size).abs() < ZERO { 0.0 } else { x / size };
        let mut index: HashMap<[u64; 2], usize> = HashMap::new();
        let (mut points, mut corners): (Vec<Point2<f64>>, Vec<Vec<u32>>) = (Vec::new(), Vec::new());
        let mut point = Vec::with_capacity(flat.len());
        for (k, p) in flat.iter().enumerate() {
            let p = Point2::new(number(p.x), number(p.y));
            let i = *index.entry([p.x.to_bits(), p.y.to_bits()]).or_insert_with(|| {
                points.push(p);
                corners.push(Vec::new());
                points.len() - 1
            });
            corners[i].push(k as u32);
            point.push(i);
        }
        let edges: Vec<[usize; 2]> =
            (0..point.len()).map(|k| [point[k], point[(k + 1) % point.len()]]).filter(|[a, b]| a != b).collect();
        let mut crossings = 0;
        let delaunay =
            ConstrainedDelaunayTriangulation::<Point2<f64>>::try_bulk_load_cdt(points, edges.clone(), |_| {
                crossings += 1
            })
            .ok()?;
        let faces: Vec<[usize; 3]> = delaunay.inner_faces().map(|f| f.vertices().map(|v| v.index())).collect();
        let sides = |f: &[usize; 3]| [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])];
        let left: HashMap<(usize, usize), usize> =
            faces.iter().enumerate().flat_map(|(i, f)| sides(f).map(|side| (side, i))).collect();
        // An edge through another corner was cut in two there.
        let whole = edges.iter().all(|&[a, b]| left.contains_key(&(a, b)) || left.contains_key(&(b, a)));
        (crossings == 0 && whole).then_some(Self { point, corners, faces, left })
    }

    /// The triangles inside, if the outline goes around each of them once and there are two fewer
    /// than corners.
    fn triangles(&self) -> Option<Vec<[u32; 3]>> {
        let winding = self.winding();
        let mut triangles = Vec::with_capacity(self.point.len() - 2);
        for (face, _) in self.faces.iter().zip(&winding).filter(|(_, w)| **w != 0) {
            let mut corners = [0; 3];
            for k in 0..3 {
                corners[k] = self.corner(face[k], face[(k + 1) % 3])?;
            }
            corners.sort_unstable();
            triangles.push(corners);
        }
        triangles.sort_unstable();
        (winding.iter().all(|w| *w == 0 || *w == 1) && triangles.len() + 2 == self.point.len()).then_some(triangles)
    }

    /// How often the outline goes around each face.
    fn winding(&self) -> Vec<i32> {
        let mut steps: HashMap<(usize, usize), i32> = HashMap::new();
        for k in 0..self.point.len() {
            let (a, b) = (self.point[k], self.point[(k + 1) % self.point.len()]);
            *steps.entry((a, b)).or_default() += 1;
            *steps.entry((b, a)).or_default() -= 1;
        }
        // Entering a face through its directed side from the right.
        let step = |a: usize, b: usize| steps.get(&(a, b)).copied().unwrap_or(0);
        let mut winding: Vec<Option<i32>> = vec![None; self.faces.len()];
        let mut stack = Vec::new();
        for (i, f) in self.faces.iter().enumerate() {
            let outer = (0..3).map(|k| (f[k], f[(k + 1) % 3])).find(|&(a, b)| !self.left.contains_key(&(b, a)));
            if let (Some((a, b)), None) = (outer, winding[i]) {
                winding[i] = Some(step(a, b));
                stack.push(i);
            }
        }
        while let Some(i) = stack.pop() {
            for k in 0..3 {
                let (a, b) = (self.faces[i][k], self.faces[i][(k + 1) % 3]);
                if let Some(&j) = self.left.get(&(b, a)).filter(|&&j| winding[j].is_none()) {
                    winding[j] = winding[i].map(|w| w + step(b, a));
                    stack.push(j);
                }
            }
        }
        winding.into_iter().map(|w| w.unwrap_or(0)).collect()
    }

    /// The corner at point `p` whose inside holds the face to the left of the edge from `p` to `q`.
    fn corner(&self, p: usize, mut q: usize) -> Option<u32> {
        if let [only] = self.corners[p][..] {
            return Some(only);
        }
        let n = self.point.len() as u32;
        // Clockwise to the edge at which the inside begins.
        for _ in 0..self.faces.len() {
            let begins = |c: &&u32| self.point[((**c + 1) % n) as usize] == q;
            if let Some(&corner) = self.corners[p].iter().find(begins) {
                return Some(corner);
            }
            let across = self.faces[*self.left.get(&(q, p))?];
            q = across.into_iter().find(|&v| v != p && v != q)?;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(points: &[[f64; 2]]) -> Vec<DVec3> {
        points.iter().map(|p| DVec3::new(p[0], p[1], 0.0)).collect()
    }

    fn area(p: &[DVec3], t: [u32; 3]) -> f64 {
        let [a, b, c] = t.map(|k| p[k as usize]);
        0.5 * (b - a).cross(c - a).z
    }

    /// The triangles have the sides of the polygon once, all others twice in opposite directions,
    /// and cover its area without turning over: they are a triangulation of it.
    fn assert_fills(points: &[DVec3], triangles: &[[u32; 3]]) {
        let n = points.len() as u32;
        assert_eq!(triangles.len() + 2, points.len());
        let mut sides: HashMap<(u32, u32), u32> = HashMap::new();
        for t in triangles {
            for k in 0..3 {
                *sides.entry((t[k], t[(k + 1) % 3])).or_default() += 1;
            }
        }
        for (&(a, b), &count) in &sides {
            assert_eq!(count, 1, "side {a} {b}");
            assert!((a + 1) % n == b || sides.contains_key(&(b, a)), "side {a} {b} is open");
        }
        assert!((0..n).all(|k| sides.contains_key(&(k, (k + 1) % n))), "a side of the polygon is missing");
        let whole = 0.5 * area_normal(points).z;
        let covered: f64 = triangles.iter().map(|t| area(points, *t).abs()).sum();
        assert!((covered - whole).abs() <= 1e-12 * whole, "{covered} of {whole}");
    }

    #[test]
    fn every_rotation_of_an_l_is_filled() {
        let l = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        for shift in 0..6 {
            let mut points = flat(&l);
            points.rotate_left(shift);
            let triangles = triangulate(&points);
            assert_fills(&points, &triangles);
            // From the inner corner, and from the one opposite to it, the fan is valid and stays.
            let is_fan = triangles == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]];
            assert_eq!(is_fan, shift % 3 == 0, "first corner {shift}");
        }
    }

    #[test]
    fn the_check_refuses_what_is_no_triangulation() {
        let l = flat(&[[2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0], [0.0, 0.0]]);
        for wrong in [
            vec![[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]],
            vec![[0, 1, 2], [0, 2, 5], [2, 4, 5]],
            vec![[0, 1, 2], [0, 2, 5], [2, 4, 5], [2, 4, 5]],
        ] {
            assert!(std::panic::catch_unwind(|| assert_fills(&l, &wrong)).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn convex_polygons_keep_the_fan() {
        for n in [4, 5, 17, 2000] {
            let points: Vec<[f64; 2]> = (0..n)
                .map(|k| f64::from(k) / f64::from(n) * std::f64::consts::TAU)
                .map(|a| [3.0 * a.cos(), a.sin()])
                .collect();
            let fan: Vec<[u32; 3]> = (2..n as u32).map(|k| [0, k - 1, k]).collect();
            assert_eq!(triangulate(&flat(&points)), fan);
        }
    }

    #[test]
    fn a_dart_takes_its_inner_diagonal() {
        let dart = flat(&[[0.0, 0.0], [4.0, 0.0], [1.0, 1.0], [0.0, 4.0]]);
        for shift in 0..4 {
            let mut points = dart.clone();
            points.rotate_left(shift);
            assert_fills(&points, &triangulate(&points));
        }
    }

    #[test]
    fn corners_on_an_edge_are_kept() {
        let points = flat(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [3.0, 3.0], [0.0, 3.0]]);
        for shift in 0..6 {
            let mut points = points.clone();
            points.rotate_left(shift);
            let triangles = triangulate(&points);
            assert_fills(&points, &triangles);
            assert!(triangles.iter().all(|t| area(&points, *t) > 0.1));
        }
    }

    #[test]
    fn a_hole_on_an_edge_there_and_back() {
        let mut points = flat(&[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0], [0.0, 0.0]]);
        points.extend(flat(&[[1.0, 1.0], [1.0, 3.0], [3.0, 3.0], [3.0, 1.0], [1.0, 1.0]]));
        for shift in 0..10 {
            let mut points = points.clone();
            points.rotate_left(shift);
            assert_fills(&points, &triangulate(&points));
        }
        assert!((0.5 * area_normal(&points).z - 12.0).abs() < 1e-12);
    }

    #[test]
    fn random_stars_are_filled_on_any_plane() {
        let mut state = 7u64;
        let mut random = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        for n in 5..60 {
            let star: Vec<DVec3> = (0..n)
                .map(|k| (f64::from(k) / f64::from(n) * std::f64::consts::TAU, 0.05 + random()))
                .map(|(a, r)| DVec3::new(r * a.cos(), r * a.sin(), 0.0))
                .collect();
            let triangles = triangulate(&star);
            assert_fills(&star, &triangles);
            // Turned, shifted, and bent a little out of its plane.
            let turn = glam::DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 1.0 + random());
            let moved: Vec<DVec3> = star.iter().map(|p| turn * *p * 8.0 + DVec3::new(5.0, -3.0, 1.0)).collect();
            let back: Vec<DVec3> = star.clone();
            assert_fills(&back, &triangulate(&moved));
        }
    }

    #[test]
    fn a_comb_of_twenty_thousand_corners() {
        let n = 10_000;
        let mut points: Vec<[f64; 2]> = (0..n).map(|k| [f64::from(k), if k % 2 == 0 { 0.0 } else { 9.0 }]).collect();
        points.extend((0..n).rev().map(|k| [f64::from(k), if k % 2 == 0 { 1.0 } else { 10.0 }]));
        let points = flat(&points);
        assert_fills(&points, &triangulate(&points));
    }

    #[test]
    fn what_has_no_inside_keeps_the_fan() {
        let bow = [[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0], [-1.0, 1.0]];
        let line = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [4.0, 0.0]];
        let point = [[1.0, 1.0]; 5];
        let broken = [[0.0, 0.0], [f64::NAN, 0.0], [2.0, 0.0], [3.0, f64::INFINITY], [4.0, 0.0]];
        let huge = [[0.0, 0.0], [1e300, 0.0], [1e300, 1e300], [1e299, 1e299], [0.0, 1e300]];
        for points in [bow, line, point, broken, huge] {
            assert_eq!(triangulate(&flat(&points)).len(), 3, "{points:?}");
        }
    }
}
