//! Closest points on a triangle mesh.
//!
//! A bounding volume hierarchy of our own: of the crates looked at, `bvh` and `parry3d-f64` leave
//! open which triangle is named when a vertex or an edge is closest, and here that must be the
//! lowest one; `kiddo` knows points only.

use glam::DVec3;
use rayon::prelude::*;

use super::{Frame, Mesh, SurfacePoint, Topology};

/// Triangles in a leaf.
const LEAF: usize = 4;
/// Distances that differ by less than this part of the mesh's extent (and of themselves) are ties.
const TIE: f64 = 1e-13;
/// Squared sine of a corner under which a triangle counts as a needle.
const FLAT: f64 = 1e-20;

#[derive(Clone, Copy, Debug)]
struct Node {
    low: DVec3,
    high: DVec3,
    /// Leaf: first of its triangles. Inner node: the second child; the first one follows its
    /// parent.
    first: u32,
    /// Number of triangles of a leaf, 0 for an inner node.
    count: u32,
}

impl Node {
    fn distance_squared(&self, p: DVec3) -> f64 {
        (p - p.clamp(self.low, self.high)).length_squared()
    }
}

/// Answers closest point queries on the usable triangles of a mesh.
#[derive(Clone, Debug)]
pub struct ClosestPoints {
    /// All of the following is in its coordinates.
    frame: Frame,
    nodes: Vec<Node>,
    faces: Vec<u32>,
    corners: Vec<[DVec3; 3]>,
    tie: f64,
}

impl ClosestPoints {
    /// Builds the hierarchy. O(F log F).
    pub fn new(mesh: &Mesh, topology: &Topology) -> Self {
        Self::of_faces(mesh, (0..mesh.triangle_count() as u32).filter(|&t| topology.usable[t as usize]))
    }

    /// The same for some of the usable triangles alone.
    pub fn of_faces(mesh: &Mesh, faces: impl IntoIterator<Item = u32>) -> Self {
        let frame = Frame::of_mesh(mesh);
        let mut items: Vec<(u32, [DVec3; 3])> =
            faces.into_iter().map(|t| (t, mesh.triangle_positions(t as usize).map(|p| frame.local(p)))).collect();
        let mut nodes = Vec::new();
        if !items.is_empty() {
            let all = items.len();
            build(&mut items, 0, all, &mut nodes);
        }
        let tie = nodes.first().map_or(0.0, |n: &Node| TIE * n.low.abs().max(n.high.abs()).max_element());
        let (faces, corners) = items.into_iter().unzip();
        Self { frame, nodes, faces, corners, tie }
    }

    /// The point of the mesh closest to `p`, with its distance; `None` if `p` is not finite or
    /// there is no usable triangle.
    ///
    /// Where several triangles are equally close (up to rounding), the lowest one is named. About
    /// O(log F).
    pub fn nearest(&self, p: DVec3) -> Option<(SurfacePoint, f64)> {
        self.nearest_local(self.frame.local(p)).map(|(q, d)| (q, d / self.frame.scale))
    }

    /// The frame of the mesh.
    pub fn frame(&self) -> Frame {
        self.frame
    }

    /// [`ClosestPoints::nearest`] in the coordinates of [`ClosestPoints::frame`], for points that
    /// are computed there.
    pub fn nearest_local(&self, p: DVec3) -> Option<(SurfacePoint, f64)> {
        if self.nodes.is_empty() || !p.is_finite() {
            return None;
        }
        let mut best = f64::INFINITY;
        self.visit(p, &mut best, |_, _, d, bound| *bound = bound.min(d));
        // A second descent, now with a tight bound, for the lowest triangle.
        let mut tied = (best.sqrt() * (1.0 + TIE) + self.tie).powi(2);
        let mut found: Option<(SurfacePoint, f64)> = None;
        self.visit(p, &mut tied, |face, barycentric, d, bound| {
            if d <= *bound && found.is_none_or(|f| face < f.0.face) {
                found = Some((SurfacePoint { face, barycentric }, d.sqrt()));
            }
        });
        found
    }

    /// [`ClosestPoints::nearest`] of many points, in parallel; one entry per point.
    pub fn nearest_all(&self, points: &[DVec3]) -> Vec<Option<(SurfacePoint, f64)>> {
        points.par_iter().map(|&p| self.nearest(p)).collect()
    }

    /// Calls `leaf` with face, barycentric coordinates, squared distance and the bound for each
    /// triangle whose box is not beyond the bound.
    fn visit(&self, p: DVec3, bound: &mut f64, mut leaf: impl FnMut(u32, [f64; 3], f64, &mut f64)) {
        let mut stack = vec![(0u32, self.nodes[0].distance_squared(p))];
        while let Some((n, d)) = stack.pop() {
            if d > *bound {
                continue;
            }
            let node = &self.nodes[n as usize];
            if node.count > 0 {
                for i in node.first as usize..(node.first + node.count) as usize {
                    let b = closest_barycentric(p, self.corners[i]);
                    let [x, y, z] = self.corners[i];
                    let q = x * b[0] + y * b[1] + z * b[2];
                    leaf(self.faces[i], b, q.distance_squared(p), bound);
                }
                continue;
            }
            let children = [n + 1, node.first];
            let [a, b] = children.map(|c| (c, self.nodes[c as usize].distance_squared(p)));
            // The nearer child is looked at first.
            if a.1 <= b.1 { stack.extend([b, a]) } else { stack.extend([a, b]) }
        }
    }
}

/// Appends the node of `items[begin..end]` and all below it. Halves at the median centroid of the
/// longest axis, so the depth is logarithmic.
fn build(items: &mut [(u32, [DVec3; 3])], begin: usize, end: usize, nodes: &mut Vec<Node>) {
    let part = &mut items[begin..end];
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (mut center_low, mut center_high) = (low, high);
    let center = |c: &[DVec3; 3]| c[0] / 3.0 + c[1] / 3.0 + c[2] / 3.0;
    for (_, c) in part.iter() {
        low = c.iter().fold(low, |l, p| l.min(*p));
        high = c.iter().fold(high, |h, p| h.max(*p));
        center_low = center_low.min(center(c));
        center_high = center_high.max(center(c));
    }
    let here = nodes.len();
    let count = end - begin;
    nodes.push(Node { low, high, first: begin as u32, count: if count <= LEAF { count as u32 } else { 0 } });
    if count <= LEAF {
        return;
    }
    let axis = (center_high - center_low).max_position();
    part.select_nth_unstable_by(count / 2, |a, b| {
        center(&a.1)[axis].total_cmp(&center(&b.1)[axis]).then(a.0.cmp(&b.0))
    });
    build(items, begin, begin + count / 2, nodes);
    nodes[here].first = nodes.len() as u32;
    build(items, begin + count / 2, end, nodes);
}

/// Barycentric coordinates of the point of a triangle closest to `p`: nonnegative, summing to one.
///
/// The Voronoi regions of the corners and edges are told apart by scalar products (Ericson,
/// Real-Time Collision Detection, 5.1.5).
pub fn closest_barycentric(p: DVec3, [a, b, c]: [DVec3; 3]) -> [f64; 3] {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let t = d1 / (d1 - d3);
        return [1.0 - t, t, 0.0];
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let t = d2 / (d2 - d6);
        return [1.0 - t, 0.0, t];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - t, t];
    }
    let sum = va + vb + vc;
    if sum > FLAT * ab.length_squared() * ac.length_squared() {
        let (v, w) = (vb / sum, vc / sum);
        return [(1.0 - v - w).max(0.0), v, w];
    }
    // A needle: the signs above are rounding errors. One of its sides is as close as its inside.
    let on_side = |k: usize| {
        let corners = [a, b, c];
        let (from, to) = (corners[k], corners[(k + 1) % 3]);
        let t = ((p - from).dot(to - from) / (to - from).length_squared()).clamp(0.0, 1.0);
        let t = if t.is_nan() { 0.0 } else { t };
        let mut b = [0.0; 3];
        (b[k], b[(k + 1) % 3]) = (1.0 - t, t);
        (from.lerp(to, t).distance_squared(p), b)
    };
    [on_side(1), on_side(2)].into_iter().fold(on_side(0), |x, y| if y.0 < x.0 { y } else { x }).1
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;
    use std::f64::consts::FRAC_PI_4;

    /// Numbers in 0..1 that look random.
    fn noise(n: usize) -> f64 {
        let x = (n as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (x >> 11) as f64 / (1u64 << 53) as f64
    }

    fn soup(n: usize) -> (Mesh, Topology) {
        let point = |k: usize| DVec3::new(noise(3 * k), noise(3 * k + 1), noise(3 * k + 2));
        let positions: Vec<DVec3> = (0..3 * n).map(|k| point(k / 3 * 3) + 0.2 * point(k + 7777)).collect();
        let triangles: Vec<[u32; 3]> = (0..n as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let mesh = Mesh::of_triangles("soup", positions, &triangles);
        let topology = Topology::new(&mesh);
        (mesh, topology)
    }

    #[test]
    fn equals_brute_force() {
        let (mesh, topology) = soup(300);
        let index = ClosestPoints::new(&mesh, &topology);
        let points: Vec<DVec3> =
            (0..500).map(|k| DVec3::new(noise(k + 9), noise(k + 99), noise(k + 999)) * 3.0 - 1.0).collect();
        for (p, found) in points.iter().zip(index.nearest_all(&points)) {
            let (point, distance) = found.unwrap();
            let brute = (0..300)
                .map(|t| {
                    let b = closest_barycentric(*p, mesh.triangle_positions(t));
                    SurfacePoint::new(t as u32, b).position(&mesh).distance(*p)
                })
                .fold(f64::INFINITY, f64::min);
            assert!((distance - brute).abs() < 1e-12);
            assert!((point.position(&mesh).distance(*p) - distance).abs() < 1e-12 && point.is_valid(&mesh, 0.0));
        }
    }

    #[test]
    fn no_sampled_point_of_a_triangle_is_closer() {
        for k in 0..400 {
            let q = |i: usize| DVec3::new(noise(20 * k + i), noise(20 * k + i + 5), noise(20 * k + i + 10));
            let (corners, p) = ([q(0), q(1), q(2)], q(3) * 2.0 - 0.5);
            let b = closest_barycentric(p, corners);
            let at = |b: [f64; 3]| corners[0] * b[0] + corners[1] * b[1] + corners[2] * b[2];
            let best = at(b).distance(p);
            for i in 0..=20 {
                for j in 0..=20 - i {
                    let (u, v) = (f64::from(i) / 20.0, f64::from(j) / 20.0);
                    assert!(at([u, v, 1.0 - u - v]).distance(p) >= best - 1e-12);
                }
            }
        }
    }

    #[test]
    fn ties_go_to_the_lowest_triangle() {
        // Eight triangles around a vertex, in an order unrelated to space.
        let middle = DVec3::new(0.1, 0.2, 0.3);
        let rim = (0..8).map(|k| middle + DQuat::from_rotation_z(f64::from(k) * FRAC_PI_4) * DVec3::X);
        let positions: Vec<DVec3> = std::iter::once(middle).chain(rim).collect();
        let mut triangles: Vec<[u32; 3]> = (0..8).map(|k| [0, 1 + k, 1 + (k + 1) % 8]).collect();
        triangles.rotate_left(3);
        let mesh = Mesh::of_triangles("fan", positions, &triangles);
        let index = ClosestPoints::new(&mesh, &Topology::new(&mesh));
        for p in [mesh.positions[0], mesh.positions[0] + DVec3::Z * 0.7] {
            let (point, _) = index.nearest(p).unwrap();
            assert_eq!((point.face, point.barycentric[0]), (0, 1.0));
        }
    }

    #[test]
    fn nothing_to_find() {
        let (mesh, topology) = soup(0);
        assert!(ClosestPoints::new(&mesh, &topology).nearest(DVec3::ZERO).is_none());
        let (mesh, topology) = soup(5);
        assert!(ClosestPoints::new(&mesh, &topology).nearest(DVec3::new(f64::NAN, 0.0, 0.0)).is_none());
    }
}
