//! The triangles around a vertex as rows that continue one another, and these as sectors.

use std::collections::{HashMap, HashSet};
use std::f64::consts::TAU;

use glam::DVec2;

use super::Sector;
use crate::geometry::{Mesh, Topology};

/// Largest angle of a sector, in radians, as far as polygons are not cut for it.
const WIDEST: f64 = 3.0;
/// A sector wider than this would come to lie on itself.
const TURN: f64 = 0.98 * TAU;
/// A closed fan whose angles differ from a full turn by no more than this part is a disk.
const FLAT: f64 = 0.01;
/// Wide triangles of a sector, about.
pub(super) const PARTS: f64 = 48.0;

/// A vertex of many triangles, and which of them may be unfolded.
pub(super) struct Hub<'a> {
    mesh: &'a Mesh,
    topology: &'a Topology,
    v: u32,
    may: HashSet<u32>,
}

impl<'a> Hub<'a> {
    /// Triangles are left out that have no height, are taken, or are a part of a polygon that is
    /// not wholly around the vertex.
    pub(super) fn new(mesh: &'a Mesh, topology: &'a Topology, v: u32, least_height: f64, taken: &[bool]) -> Self {
        let around = topology.vertex_triangles(v);
        let mut of_polygon: HashMap<u32, usize> = HashMap::new();
        around.iter().for_each(|&t| *of_polygon.entry(mesh.triangle_polygon(t as usize)).or_default() += 1);
        let may = |&t: &u32| {
            let polygon = mesh.triangle_polygon(t as usize);
            let whole = of_polygon.get(&polygon).map_or(0, |n| *n) + 2 == mesh.polygon(polygon as usize).len();
            let p = mesh.triangle_positions(t as usize);
            let longest = (0..3).map(|k| p[k].distance(p[(k + 1) % 3])).fold(0.0, f64::max);
            let high = 2.0 * mesh.triangle_area(t as usize) > least_height * longest;
            whole && high && !taken[t as usize]
        };
        Self { mesh, topology, v, may: around.iter().copied().filter(may).collect() }
    }

    /// The corner of a triangle at the vertex.
    fn corner(&self, t: u32) -> usize {
        self.topology.corner_of(t, self.v).unwrap_or(0)
    }

    /// The triangle that continues the fan after `t`, oriented as it and of its material.
    fn after(&self, t: u32) -> Option<u32> {
        let k = self.corner(t);
        let next = self.topology.neighbours[t as usize][(k + 1) % 3];
        let alike = |n: u32| self.mesh.triangle_material(n as usize) == self.mesh.triangle_material(t as usize);
        let (a, b) = (self.topology.triangles[t as usize], self.topology.triangles.get(next as usize)?);
        (self.may.contains(&next) && alike(next) && b[(self.corner(next) + 1) % 3] == a[(k + 2) % 3]).then_some(next)
    }

    /// Rows of triangles that continue one another, and whether they close.
    pub(super) fn runs(&self, around: &[u32]) -> Vec<(Vec<u32>, bool)> {
        let allowed: Vec<u32> = around.iter().copied().filter(|t| self.may.contains(t)).collect();
        let follows: HashMap<u32, u32> = allowed.iter().filter_map(|&t| Some((self.after(t)?, t))).collect();
        let mut done: HashSet<u32> = HashSet::new();
        let mut runs = Vec::new();
        // Open ones from their beginnings; what is left closes.
        for open in [true, false] {
            for &start in &allowed {
                if done.contains(&start) || (open && follows.contains_key(&start)) {
                    continue;
                }
                let mut run = Vec::new();
                let mut at = Some(start);
                while let Some(t) = at.filter(|t| done.insert(*t)) {
                    run.push(t);
                    at = self.after(t);
                }
                let closed = !open && at == Some(start);
                runs.push((run, closed));
            }
        }
        runs
    }

    /// The sectors of a run; `None` if one would come to lie on itself.
    pub(super) fn sectors(&self, mut run: Vec<u32>, closed: bool) -> Option<Vec<Sector>> {
        let polygon = |t: u32| self.mesh.triangle_polygon(t as usize);
        if closed {
            // Polygons stay whole.
            let begins = |i: &usize| polygon(run[*i]) != polygon(run[(*i + run.len() - 1) % run.len()]);
            let first = (0..run.len()).find(begins).unwrap_or(0);
            run.rotate_left(first);
        }
        let angles: Vec<f64> = run.iter().map(|&t| self.sides(t).2).collect();
        let total: f64 = angles.iter().sum();
        let disk = closed && (total / TAU - 1.0).abs() <= FLAT;
        let limit = if disk { f64::INFINITY } else { total / (total / WIDEST).ceil() };
        let mut sectors = Vec::new();
        let (mut begin, mut angle) = (0, 0.0);
        for i in 0..=run.len() {
            let ends = i == run.len() || (angle >= limit && polygon(run[i]) != polygon(run[i - 1]));
            if ends && i > begin {
                if !disk && angle > TURN {
                    return None;
                }
                // A disk that is nearly flat is flattened.
                let scale = if disk { TAU / total } else { 1.0 };
                sectors.push(self.sector(&run[begin..i], &angles[begin..i], scale, disk));
                (begin, angle) = (i, 0.0);
            }
            angle += angles.get(i).copied().unwrap_or(0.0);
        }
        Some(sectors)
    }

    /// Lengths of a triangle's sides at the vertex, and the angle between them.
    fn sides(&self, t: u32) -> (f64, f64, f64) {
        let p = self.mesh.triangle_positions(t as usize);
        let k = self.corner(t);
        let (a, b) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
        (a.length(), b.length(), a.cross(b).length().atan2(a.dot(b)))
    }

    fn sector(&self, triangles: &[u32], angles: &[f64], scale: f64, closed: bool) -> Sector {
        let n = triangles.len();
        let mut angle = vec![0.0];
        angles.iter().for_each(|a| angle.push(angle[angle.len() - 1] + scale * a));
        let mut radius: Vec<f64> = triangles.iter().map(|&t| self.sides(t).0).collect();
        radius.push(self.sides(triangles[n - 1]).1);
        let outer = radius.iter().zip(&angle).map(|(r, a)| *r * DVec2::from_angle(*a)).collect();
        // Parts of equal angles; a wide triangle is one by itself.
        let widest = angle[n] / PARTS;
        let mut parts = vec![0];
        for k in 1..n {
            let begin = parts[parts.len() - 1];
            if angle[k + 1] - angle[begin] > widest {
                parts.push(k);
            }
        }
        parts.push(n);
        // The chord between the ends must lie beyond everything in the part.
        let mut reach = vec![0.0_f64; parts.len()];
        for i in 0..parts.len() - 1 {
            let (a, b) = (parts[i], parts[i + 1]);
            let most = radius[a..=b].iter().copied().fold(0.0, f64::max);
            let far = if b == a + 1 { most } else { most / (0.5 * (angle[b] - angle[a])).cos() * 1.001 };
            (reach[i], reach[i + 1]) = (reach[i].max(far), reach[i + 1].max(far));
        }
        if closed {
            let last = parts.len() - 1;
            (reach[0], reach[last]) = (reach[0].max(reach[last]), reach[0].max(reach[last]));
        }
        let hub = triangles.iter().map(|&t| self.corner(t)).collect();
        Sector { triangles: triangles.to_vec(), hub, closed, outer, angle, parts, reach }
    }
}
