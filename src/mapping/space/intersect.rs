//! Whether a triangle mesh intersects itself, by exact predicates (Shewchuk's, from the crate
//! `robust`).
//!
//! Two triangles meet where an edge of one meets the other; neighbours may share their common
//! corner or edge and nothing else. Pairs are found by sweeping boxes along one axis. O(F log F +
//! pairs whose boxes overlap along it).

use glam::DVec3;
use rayon::prelude::*;
use robust::{Coord, Coord3D, orient2d, orient3d};

fn side(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> f64 {
    let p = |v: DVec3| Coord3D { x: v.x, y: v.y, z: v.z };
    let s = orient3d(p(a), p(b), p(c), p(d));
    if s > 0.0 {
        1.0
    } else if s < 0.0 {
        -1.0
    } else {
        0.0
    }
}

/// A triangle and its plane's projection that is not flat.
struct Flat {
    corners: [Coord<f64>; 3],
}

impl Flat {
    /// Along the largest component of the normal; the projection keeps collinear points collinear
    /// exactly.
    fn along(axis: usize, corners: [DVec3; 3]) -> Self {
        Self { corners: corners.map(|v| Self::point(axis, v)) }
    }

    fn point(axis: usize, v: DVec3) -> Coord<f64> {
        Coord { x: v[(axis + 1) % 3], y: v[(axis + 2) % 3] }
    }

    fn contains(&self, p: Coord<f64>) -> bool {
        let s = [0, 1, 2].map(|i| orient2d(self.corners[i], self.corners[(i + 1) % 3], p));
        s.iter().all(|s| *s >= 0.0) || s.iter().all(|s| *s <= 0.0)
    }
}

/// Whether two closed segments in a plane have a common point.
fn cross(a: Coord<f64>, b: Coord<f64>, c: Coord<f64>, d: Coord<f64>) -> bool {
    let (p, q) = (orient2d(a, b, c), orient2d(a, b, d));
    let (r, s) = (orient2d(c, d, a), orient2d(c, d, b));
    if p == 0.0 && q == 0.0 {
        let over =
            |f: fn(&Coord<f64>) -> f64| f(&a).min(f(&b)) <= f(&c).max(f(&d)) && f(&c).min(f(&d)) <= f(&a).max(f(&b));
        return over(|v| v.x) && over(|v| v.y);
    }
    !((p > 0.0 && q > 0.0) || (p < 0.0 && q < 0.0) || (r > 0.0 && s > 0.0) || (r < 0.0 && s < 0.0))
}

/// The axis along which a triangle is seen widest.
fn axis_of(t: [DVec3; 3]) -> usize {
    let n = (t[1] - t[0]).cross(t[2] - t[0]).abs();
    (0..3).fold(0, |best, k| if n[k] > n[best] { k } else { best })
}

/// Whether the closed segment p-q meets the closed triangle t.
fn segment_meets(p: DVec3, q: DVec3, t: [DVec3; 3]) -> bool {
    let [a, b, c] = t;
    let (sp, sq) = (side(a, b, c, p), side(a, b, c, q));
    if sp * sq > 0.0 {
        return false;
    }
    if sp == 0.0 && sq == 0.0 {
        let axis = axis_of(t);
        let flat = Flat::along(axis, t);
        let (p, q) = (Flat::point(axis, p), Flat::point(axis, q));
        let edge = |i: usize| cross(p, q, flat.corners[i], flat.corners[(i + 1) % 3]);
        return flat.contains(p) || flat.contains(q) || (0..3).any(edge);
    }
    let s = [side(p, q, a, b), side(p, q, b, c), side(p, q, c, a)];
    s.iter().all(|s| *s >= 0.0) || s.iter().all(|s| *s <= 0.0)
}

/// Whether two triangles with the vertices `s` and `t` meet anywhere but in what they share.
fn meet(s: [u32; 3], t: [u32; 3], positions: &[DVec3]) -> bool {
    let at = |t: [u32; 3]| t.map(|v| positions[v as usize]);
    let (here, there) = (at(s), at(t));
    let shared: Vec<(usize, usize)> =
        (0..3).filter_map(|i| t.iter().position(|v| *v == s[i]).map(|k| (i, k))).collect();
    match shared[..] {
        [] => (0..3).any(|i| {
            segment_meets(here[i], here[(i + 1) % 3], there) || segment_meets(there[i], there[(i + 1) % 3], here)
        }),
        // Around a common corner, the opposite edges tell.
        [(i, k)] => {
            segment_meets(here[(i + 1) % 3], here[(i + 2) % 3], there)
                || segment_meets(there[(k + 1) % 3], there[(k + 2) % 3], here)
        }
        // Across a common edge, only triangles folded flat onto each other.
        [(i, k), (j, l)] => {
            let (p, q) = (here[3 - i - j], there[3 - k - l]);
            let (a, b) = (here[i], here[j]);
            side(a, b, p, q) == 0.0 && {
                let axis = axis_of(here);
                let [a, b, p, q] = [a, b, p, q].map(|v| Flat::point(axis, v));
                orient2d(a, b, p) * orient2d(a, b, q) > 0.0
            }
        }
        // The same triangle twice.
        _ => true,
    }
}

/// Pairs of triangles that intersect, the first index below the second, ascending; at most `most`
/// of them.
pub fn self_intersections(triangles: &[[u32; 3]], positions: &[DVec3], most: usize) -> Vec<(u32, u32)> {
    let mut boxes: Vec<(DVec3, DVec3, u32)> = triangles
        .iter()
        .enumerate()
        .map(|(f, t)| {
            let [a, b, c] = t.map(|v| positions[v as usize]);
            (a.min(b).min(c), a.max(b).max(c), f as u32)
        })
        .collect();
    // Along the longest side of them all.
    let all = boxes.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), b| (l.min(b.0), h.max(b.1)));
    let size = all.1 - all.0;
    let axis = (0..3).fold(0, |best, k| if size[k] > size[best] { k } else { best });
    boxes.sort_by(|a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.2.cmp(&b.2)));
    let mut found: Vec<(u32, u32)> = (0..boxes.len())
        .into_par_iter()
        .flat_map_iter(|i| {
            let (low, high, f) = boxes[i];
            let near = boxes[i + 1..].iter().take_while(move |b| b.0[axis] <= high[axis]);
            near.filter(move |b| b.0.cmple(high).all() && low.cmple(b.1).all())
                .filter(move |b| meet(triangles[f as usize], triangles[b.2 as usize], positions))
                .map(move |b| (f.min(b.2), f.max(b.2)))
                .collect::<Vec<_>>()
        })
        .collect();
    found.sort_unstable();
    found.truncate(most);
    found
}

#[cfg(test)]
mod tests {
    use super::super::testing::{box_cage, dented, sphere};
    use super::*;

    #[test]
    fn simple_shapes_do_not_intersect_themselves() {
        for (triangles, positions) in [box_cage(1), box_cage(3), dented(), sphere()] {
            assert_eq!(self_intersections(&triangles, &positions, 9), []);
        }
    }

    #[test]
    fn every_way_to_intersect_is_found() {
        // A corner pulled through the opposite side, exactly onto it, and not quite.
        let (triangles, positions) = box_cage(2);
        let corner = positions.iter().position(|p| *p == DVec3::splat(0.5)).unwrap();
        for (z, meets) in [(-0.75, true), (-0.5, true), (-0.5 + 1e-15, false)] {
            let mut moved = positions.clone();
            moved[corner] = DVec3::new(0.1, 0.2, z);
            assert_eq!(!self_intersections(&triangles, &moved, 9).is_empty(), meets, "{z}");
        }
        // Two triangles folded onto each other along their edge, and the same opened by a hair.
        let fold = |z: f64| [DVec3::ZERO, DVec3::X, DVec3::new(0.3, 1.0, 0.0), DVec3::new(0.6, 0.5, z)];
        assert_eq!(self_intersections(&[[0, 1, 2], [1, 0, 3]], &fold(0.0), 9), [(0, 1)]);
        assert_eq!(self_intersections(&[[0, 1, 2], [1, 0, 3]], &fold(1e-300), 9), []);
        // In one plane: apart, overlapping, one in the other, and sharing a corner.
        let flat =
            |x: f64, s: f64| [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)].map(|(a, b)| DVec3::new(x + s * a, x + s * b, 1.0));
        for (x, s, meets) in [(2.0, 1.0, false), (0.2, 1.0, true), (0.1, 0.2, true), (0.5, 1.0, true)] {
            let all = [flat(0.0, 1.0), flat(x, s)].concat();
            assert_eq!(!self_intersections(&[[0, 1, 2], [3, 4, 5]], &all, 9).is_empty(), meets, "{x} {s}");
        }
        // Through a common corner.
        let through = [
            DVec3::ZERO,
            DVec3::new(1., 0., 0.),
            DVec3::new(0., 1., 0.),
            DVec3::new(0.3, 0.3, -0.1),
            DVec3::new(0.3, 0.3, 0.1),
        ];
        assert_eq!(self_intersections(&[[0, 1, 2], [0, 3, 4]], &through, 9), [(0, 1)]);
        assert_eq!(self_intersections(&[[0, 1, 2], [0, 1, 2]], &through, 9), [(0, 1)]);
    }
}
