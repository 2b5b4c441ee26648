//! A piece of a surface flattened into the plane without folds (Tutte 1963; Floater 1997).

use std::collections::{HashMap, HashSet};

use glam::{DVec2, DVec3};

use crate::geometry::{NONE, SurfacePoint, Topology};
use crate::surface::long_fans::LONGEST;

/// Rings of triangles around the wanted ones: what is near the rim of a chart is squeezed.
const MARGIN: usize = 2;
/// The same where the rim of fewer touches itself.
const WIDEST: usize = 5;
/// Rings at most, until all wanted ones hang together.
const REACH: usize = 8;
/// Barycentric coordinates down to minus this lie inside.
const ROUNDING: f64 = 1e-12;
/// Triangles that a walk crosses at most.
const WALK: usize = 200;
/// Triangles at most.
const LARGEST: usize = 4000;
/// Bounds of the cotangents that serve as weights; positive weights are what keeps the chart from
/// folding.
const WEIGHTS: [f64; 2] = [0.05, 20.0];

/// A disk of triangles in the plane, all facing up.
#[derive(Debug)]
pub(super) struct Chart {
    /// Triangles of the surface, rising, and their corners in the chart.
    faces: Vec<u32>,
    corners: Vec<[u32; 3]>,
    points: Vec<DVec2>,
    /// Triangles of the chart across the sides opposite to corners.
    neighbours: Vec<[u32; 3]>,
}

impl Chart {
    /// Flattens the surroundings of some triangles; `None` where these are no disk or too large.
    pub(super) fn new(positions: &[DVec3], topology: &Topology, wanted: &[u32]) -> Option<Self> {
        (MARGIN..=WIDEST).find_map(|margin| Self::within_rings(positions, topology, region(topology, wanted, margin)?))
    }

    fn within_rings(positions: &[DVec3], topology: &Topology, faces: Vec<u32>) -> Option<Self> {
        let mut local = HashMap::new();
        let mut vertices = Vec::new();
        let corners: Vec<[u32; 3]> = faces
            .iter()
            .map(|&f| {
                topology.triangles[f as usize].map(|v| {
                    *local.entry(v).or_insert_with(|| {
                        vertices.push(v);
                        vertices.len() as u32 - 1
                    })
                })
            })
            .collect();
        let place: Vec<DVec3> = vertices.iter().map(|&v| positions[v as usize]).collect();
        let rim = rim(&corners)?;
        let points = flatten(&place, &corners, &rim)?;
        let across = |g: u32| faces.binary_search(&g).map_or(NONE, |t| t as u32);
        let neighbours = faces.iter().map(|&f| topology.neighbours[f as usize].map(across)).collect();
        let chart = Self { faces, corners, points, neighbours };
        (0..chart.faces.len()).all(|t| chart.doubled(t) > 0.0).then_some(chart)
    }

    fn doubled(&self, t: usize) -> f64 {
        let [a, b, c] = self.corners[t].map(|v| self.points[v as usize]);
        (b - a).perp_dot(c - a)
    }

    /// The place of a surface point; `None` outside.
    pub(super) fn place(&self, p: &SurfacePoint) -> Option<DVec2> {
        let t = self.faces.binary_search(&p.face).ok()?;
        Some((0..3).map(|k| self.points[self.corners[t][k] as usize] * p.barycentric[k]).sum())
    }

    /// Barycentric coordinates of a place in a triangle.
    fn within(&self, t: usize, q: DVec2) -> [f64; 3] {
        let [a, b, c] = self.corners[t].map(|v| self.points[v as usize]);
        let double = (b - a).perp_dot(c - a);
        [(c - b).perp_dot(q - b), (a - c).perp_dot(q - c), (b - a).perp_dot(q - a)].map(|x| x / double)
    }

    /// The surface point at a place, and its triangle in the chart; `None` outside. Walks there
    /// from the triangle `start` of the chart.
    pub(super) fn lift(&self, q: DVec2, start: usize) -> Option<(SurfacePoint, usize)> {
        let inside = |x: [f64; 3]| x.iter().all(|x| *x >= -ROUNDING);
        let mut t = start;
        for _ in 0..WALK {
            let x = self.within(t, q);
            if inside(x) {
                return Some((self.point(t, x), t));
            }
            let k = (0..3).fold(0, |k, i| if x[i] < x[k] { i } else { k });
            if self.neighbours[t][k] == NONE {
                break;
            }
            t = self.neighbours[t][k] as usize;
        }
        // A walk may end at a hole.
        let (t, x) = (0..self.faces.len()).map(|t| (t, self.within(t, q))).find(|(_, x)| inside(*x))?;
        Some((self.point(t, x), t))
    }

    fn point(&self, t: usize, x: [f64; 3]) -> SurfacePoint {
        let x = x.map(|x| x.max(0.0));
        let sum: f64 = x.iter().sum();
        SurfacePoint::new(self.faces[t], x.map(|x| x / sum))
    }
}

/// The wanted triangles, rings around them until they hang together, and a margin; rising. Around a
/// vertex of thousands a ring goes on by what is beside one another, not by all of its triangles.
fn region(topology: &Topology, wanted: &[u32], widest: usize) -> Option<Vec<u32>> {
    let mut faces: Vec<u32> = wanted.to_vec();
    faces.sort_unstable();
    faces.dedup();
    let mut inside: HashSet<u32> = faces.iter().copied().collect();
    let mut seen: HashSet<u32> = HashSet::new();
    let mut margin = 0;
    for _ in 0..REACH + widest {
        let mut next: Vec<u32> = Vec::new();
        for &f in &faces {
            for v in topology.triangles[f as usize] {
                let around = topology.vertex_triangles(v);
                // Whose triangles are inside has no more.
                if around.len() > LONGEST || !seen.insert(v) {
                    continue;
                }
                next.extend(around.iter().copied().filter(|&g| inside.insert(g)));
            }
        }
        faces.extend(next);
        if faces.len() > LARGEST {
            return None;
        }
        if margin > 0 || connected(topology, &faces, &inside) {
            margin += 1;
        }
        if margin > widest {
            break;
        }
    }
    if margin <= widest {
        return None;
    }
    faces.sort_unstable();
    Some(faces)
}

fn connected(topology: &Topology, faces: &[u32], inside: &HashSet<u32>) -> bool {
    let Some(&first) = faces.first() else { return false };
    let mut seen: HashSet<u32> = HashSet::from([first]);
    let mut stack = vec![first];
    while let Some(f) = stack.pop() {
        for g in topology.neighbours[f as usize] {
            if g != NONE && inside.contains(&g) && seen.insert(g) {
                stack.push(g);
            }
        }
    }
    seen.len() == faces.len()
}

/// The longest of the loops around the triangles, in order; `None` where loops touch.
fn rim(corners: &[[u32; 3]]) -> Option<Vec<u32>> {
    let mut edges: HashSet<(u32, u32)> = HashSet::new();
    for t in corners {
        for k in 0..3 {
            if !edges.insert((t[k], t[(k + 1) % 3])) {
                return None;
            }
        }
    }
    let mut next = HashMap::new();
    let mut starts = Vec::new();
    for t in corners {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            if !edges.contains(&(b, a)) {
                if next.insert(a, b).is_some() {
                    return None;
                }
                starts.push(a);
            }
        }
    }
    let mut longest = Vec::new();
    for a in starts {
        let mut around = Vec::new();
        let mut v = a;
        while let Some(w) = next.remove(&v) {
            around.push(v);
            v = w;
        }
        if around.len() > longest.len() {
            longest = around;
        }
    }
    (longest.len() >= 3).then_some(longest)
}

/// Places with the rim on a circle, every other point the weighted mean of its neighbours; by
/// conjugate gradients.
fn flatten(place: &[DVec3], corners: &[[u32; 3]], rim: &[u32]) -> Option<Vec<DVec2>> {
    let n = place.len();
    let mut weights: Vec<Vec<(u32, f64)>> = vec![Vec::new(); n];
    for t in corners {
        for k in 0..3 {
            let (o, a, b) = (t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
            let (e, f) = (place[a as usize] - place[o as usize], place[b as usize] - place[o as usize]);
            let w = (e.dot(f) / e.cross(f).length()).clamp(WEIGHTS[0], WEIGHTS[1]);
            let w = if w.is_finite() { w } else { WEIGHTS[0] };
            weights[a as usize].push((b, w));
            weights[b as usize].push((a, w));
        }
    }
    let mut points = vec![DVec2::ZERO; n];
    let mut fixed = vec![false; n];
    let length = |k: usize| place[rim[k] as usize].distance(place[rim[(k + 1) % rim.len()] as usize]);
    let around: f64 = (0..rim.len()).map(length).sum();
    if !(around > 0.0 && around.is_finite()) {
        return None;
    }
    let mut walked = 0.0;
    for (k, &v) in rim.iter().enumerate() {
        points[v as usize] = DVec2::from_angle(std::f64::consts::TAU * walked / around);
        fixed[v as usize] = true;
        // Nothing on the circle coincides.
        walked += length(k).max(1e-3 * around / rim.len() as f64);
    }
    let diagonal: Vec<f64> = weights.iter().map(|w| w.iter().map(|w| w.1).sum()).collect();
    let apply =
        |x: &[DVec2], v: usize| x[v] * diagonal[v] - weights[v].iter().map(|&(w, c)| x[w as usize] * c).sum::<DVec2>();
    let free: Vec<usize> = (0..n).filter(|&v| !fixed[v]).collect();
    let mut residual = vec![DVec2::ZERO; n];
    let mut direction = vec![DVec2::ZERO; n];
    for &v in &free {
        residual[v] = -apply(&points, v);
        direction[v] = residual[v] / diagonal[v];
    }
    let product = |r: &[DVec2]| free.iter().map(|&v| r[v].length_squared() / diagonal[v]).sum::<f64>();
    let mut size = product(&residual);
    let enough = 1e-24 * size;
    let mut image = vec![DVec2::ZERO; n];
    for _ in 0..4 * free.len() {
        if size <= enough {
            break;
        }
        for &v in &free {
            image[v] = apply(&direction, v);
        }
        let step = size / free.iter().map(|&v| direction[v].dot(image[v])).sum::<f64>();
        for &v in &free {
            points[v] += direction[v] * step;
            residual[v] -= image[v] * step;
        }
        let now = product(&residual);
        for &v in &free {
            direction[v] = residual[v] / diagonal[v] + direction[v] * (now / size);
        }
        size = now;
    }
    Some(points)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::shapes::{Diagonal, lobed_sphere, plane_grid, uv_sphere};

    #[test]
    fn places_and_points_correspond() {
        let mesh = lobed_sphere(3, 0.3);
        let topology = Topology::new(&mesh);
        let chart = Chart::new(&mesh.positions, &topology, &[3, 7]).unwrap();
        assert!(chart.faces.contains(&3) && chart.faces.contains(&7) && chart.faces.len() < 300);
        for t in 0..chart.faces.len() {
            let p = SurfacePoint::new(chart.faces[t], [0.2, 0.5, 0.3]);
            let (q, found) = chart.lift(chart.place(&p).unwrap(), 0).unwrap();
            assert_eq!(found, t);
            assert!(q.position(&mesh).distance(p.position(&mesh)) < 1e-9);
        }
        assert!(chart.lift(DVec2::new(2.0, 0.0), 0).is_none() && chart.lift(DVec2::NAN, 0).is_none());
        let outside = (0..mesh.triangle_count() as u32).find(|f| !chart.faces.contains(f)).unwrap();
        assert!(chart.place(&SurfacePoint::new(outside, [1.0, 0.0, 0.0])).is_none());
    }

    #[test]
    fn around_a_vertex_of_thousands_a_region_stays_small() {
        let mesh = uv_sphere(1.0, 2000, 2);
        let topology = Topology::new(&mesh);
        let faces = region(&topology, &[10, 12], MARGIN).unwrap();
        assert!(faces.len() < 100 && [10, 11, 12].iter().all(|f| faces.contains(f)), "{faces:?}");
    }

    #[test]
    fn what_is_no_disk_has_no_chart() {
        // All of a closed surface, nothing, and two triangles that never come together.
        let mesh = lobed_sphere(1, 0.1);
        let topology = Topology::new(&mesh);
        let all: Vec<u32> = (0..mesh.triangle_count() as u32).collect();
        assert!(Chart::new(&mesh.positions, &topology, &all).is_none());
        assert!(Chart::new(&mesh.positions, &topology, &[]).is_none());
        let plane = plane_grid(60, 60, 1.0, 1.0, Diagonal::Forward);
        let topology = Topology::new(&plane);
        let last = plane.triangle_count() as u32 - 1;
        assert!(Chart::new(&plane.positions, &topology, &[0, last]).is_none());
        // A grid with a hole has one: the rim is the longer loop.
        let holed: Vec<[u32; 3]> = plane_grid(6, 6, 1.0, 1.0, Diagonal::Forward).triangles();
        let positions = plane_grid(6, 6, 1.0, 1.0, Diagonal::Forward).positions;
        let usable: Vec<bool> = (0..holed.len()).map(|t| t != 30).collect();
        let topology = Topology::from_triangles(positions.len(), holed, usable);
        let chart = Chart::new(&positions, &topology, &[29]).unwrap();
        assert!(!chart.faces.contains(&30));
    }
}
