//! Turning back the few triangles whose image is turned over.

mod chart;
mod untangle;
mod upright;

use std::cell::Cell;
use std::collections::HashMap;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use self::chart::Chart;
use self::untangle::Patch;
use self::upright::{Image, Lifted, facing};
use super::{GUARD, middle};
use super::closest::{Closest, ClosestOnSurface, FLAT};
use super::pair::Shapes;
use crate::engine::Real;
use crate::geometry::{NONE, SurfacePoint};
use crate::surface::PhongSurface;
use crate::surface::project::Found;
use crate::surface::quality::{normal_at, vertex_normals};
use crate::surface::vector::{Vector, cast};

/// Rings around turned triangles that may move, at most. Larger patches turn hardly a triangle more back and can lose what their vertices know.
const RINGS: usize = 6;
/// The images of a target's vertices, as they are repaired.
pub(super) struct Images<'a, S: Real, const K: usize> {
    pub(super) shapes: &'a Shapes<'a>,
    /// The source as the field projects to it.
    pub(super) source: &'a PhongSurface<S, K>,
    pub(super) closest: &'a ClosestOnSurface<'a, K>,
    /// Of each vertex in R^K.
    pub(super) z: &'a mut [Vector<f64, K>],
    /// Vertices of the source near them.
    pub(super) starts: &'a mut [u32],
    /// For each triangle of the target a triangle of the source to start from.
    pub(super) start_faces: &'a [u32],
}

/// What a repair did.
#[derive(Debug, Default)]
pub(super) struct Repaired {
    /// Turned triangles before.
    pub(super) before: usize,
    /// Those that are left.
    pub(super) left: Vec<usize>,
}

/// Position of an image on the source, and the normal there.
type Seen = Option<(Image, SurfacePoint)>;

impl<S: Real, const K: usize> Images<'_, S, K> {
    /// Replaces the images around turned triangles by averages of those around them (Tutte), drawn onto the source: their own vertices first, rings around them where that does not help. A patch is kept only if fewer of its
    /// triangles are turned. Vertices of `held` stay. `O(F)` and little more, since turned triangles are few.
    pub(super) fn repair(&mut self, held: &[bool]) -> Repaired {
        let source = self.shapes.source;
        let normals = vertex_normals(source.mesh, source.topology);
        let mut seen: Vec<Seen> = (0..self.z.len()).into_par_iter().map(|v| self.see(v, &normals, false)).collect();
        let triangles = &self.shapes.target.topology.triangles;
        let usable = &self.shapes.target.topology.usable;
        let all: Vec<usize> = (0..triangles.len()).filter(|&t| usable[t]).collect();
        // A mirrored pair turns them all.
        let over = |seen: &[Seen], t: usize| turned(seen, triangles[t]);
        let mirrored = 2 * all.iter().filter(|&&t| over(&seen, t)).count() > all.len();
        let bad = |seen: &[Seen], t: usize| usable[t] && over(seen, t) != mirrored;
        let mut left: Vec<usize> = all.iter().copied().filter(|&t| bad(&seen, t)).collect();
        let before = left.len();
        for (round, rings) in (0..3).flat_map(|round| (0..=RINGS).map(move |r| (round, r))) {
            if left.is_empty() || 10 * left.len() > all.len() {
                break;
            }
            let mut also = Vec::new();
            for patch in self.patches(&left, rings, held) {
                let around = self.triangles_of(&patch);
                let count = |seen: &[Seen]| around.iter().filter(|&&t| bad(seen, t)).count();
                let was = count(&seen);
                if was == 0 {
                    continue;
                }
                let kept: Vec<_> = patch.iter().map(|&v| (self.z[v], self.starts[v])).collect();
                let before_seen: Vec<(usize, Seen)> = self.corners_of(&around).into_iter().map(|v| (v, seen[v])).collect();
                if !self.untangle(&patch, &around, &seen, &normals, mirrored, round) {
                    continue;
                }
                for &(v, _) in &before_seen {
                    seen[v] = self.see(v, &normals, true);
                }
                if std::env::var("SAY").is_ok() { println!("   rings {rings} patch {} was {was} now {}", patch.len(), count(&seen)); }
                if count(&seen) >= was {
                    for (&v, (z, start)) in patch.iter().zip(kept) {
                        (self.z[v], self.starts[v]) = (z, start);
                    }
                    before_seen.into_iter().for_each(|(v, image)| seen[v] = image);
                } else {
                    // Others than before, maybe.
                    also.extend(around);
                }
            }
            left.extend(also);
            left.sort_unstable();
            left.dedup();
            left.retain(|&t| bad(&seen, t));
        }
        Repaired { before, left: all.into_iter().filter(|&t| bad(&seen, t)).collect() }
    }

    /// Where a vertex goes.
    fn see(&self, v: usize, normals: &[DVec3], again: bool) -> Seen {
        let first = self.shapes.target.topology.vertex_point(v as u32)?.face as usize;
        let corners = self.shapes.target.topology.triangles[first];
        let starts = corners.map(|v| self.starts[v as usize]);
        let start = if again {
            self.closest.near((&middle(self.z, corners), &FLAT), starts[0]).map_or(NONE, |c| c.face)
        } else {
            self.start_faces[first]
        };
        let image = self.source.project_near(&cast(&self.z[v]), start, &starts);
        let projected = SurfacePoint::new(image.face, image.x.map(|x| x.to_f64()));
        let distance = image.distance_squared.to_f64().sqrt();
        // As the field itself guards them.
        let p = if image.face != NONE && distance <= GUARD {
            projected
        } else {
            let c = self.closest.find(&self.z[v])?;
            let near = distance <= 1.5 * c.distance_squared.sqrt() + GUARD;
            if near && image.face != NONE && image.found != Found::Nothing {
                projected
            } else {
                SurfacePoint::new(c.face, c.x)
            }
        };
        let mesh = self.shapes.source.mesh;
        Some(((p.position(mesh), normal_at(mesh, normals, &p)), p))
    }

    /// The vertices within some rings of triangles, the held ones left out, by connected patches; each rising.
    fn patches(&self, triangles: &[usize], rings: usize, held: &[bool]) -> Vec<Vec<usize>> {
        let t = &self.shapes.target.topology;
        let mut inside = vec![false; self.z.len()];
        let mut front: Vec<u32> = triangles.iter().flat_map(|&f| t.triangles[f]).collect();
        for _ in 0..=rings {
            front.iter().for_each(|&v| inside[v as usize] = true);
            front = front.iter().flat_map(|&v| self.neighbours(v as usize)).filter(|&v| !inside[v as usize]).collect();
        }
        let mut patches = Vec::new();
        for v in 0..inside.len() {
            if !inside[v] || held[v] {
                continue;
            }
            let mut patch = vec![v];
            inside[v] = false;
            let mut next = 0;
            while next < patch.len() {
                for w in self.neighbours(patch[next]) {
                    if inside[w as usize] && !held[w as usize] {
                        inside[w as usize] = false;
                        patch.push(w as usize);
                    }
                }
                next += 1;
            }
            patch.sort_unstable();
            patches.push(patch);
        }
        patches
    }

    /// Vertices that share a usable triangle with `v`, rising.
    fn neighbours(&self, v: usize) -> Vec<u32> {
        let t = &self.shapes.target.topology;
        let mut around: Vec<u32> = t
            .vertex_triangles(v as u32)
            .iter()
            .flat_map(|&f| t.triangles[f as usize])
            .filter(|&w| w as usize != v)
            .collect();
        around.sort_unstable();
        around.dedup();
        around
    }

    /// Corners of triangles, rising.
    fn corners_of(&self, triangles: &[usize]) -> Vec<usize> {
        let t = &self.shapes.target.topology;
        let mut corners: Vec<usize> = triangles.iter().flat_map(|&f| t.triangles[f]).map(|v| v as usize).collect();
        corners.sort_unstable();
        corners.dedup();
        corners
    }

    fn triangles_of(&self, patch: &[usize]) -> Vec<usize> {
        let t = &self.shapes.target.topology;
        let mut around: Vec<usize> =
            patch.iter().flat_map(|&v| t.vertex_triangles(v as u32)).map(|&f| f as usize).collect();
        around.sort_unstable();
        around.dedup();
        around
    }

    /// Places the vertices of a patch anew so that no triangle is turned in a chart of the source around their images. Says whether there is such a chart.
    fn untangle(&mut self, patch: &[usize], around: &[usize], seen: &[Seen], normals: &[DVec3], mirrored: bool, round: usize) -> bool {
        let (source, target) = (self.shapes.source, self.shapes.target);
        let mut local = HashMap::new();
        let mut vertices = Vec::new();
        let mut triangles: Vec<[u32; 3]> = around
            .iter()
            .map(|&t| {
                target.topology.triangles[t].map(|v| {
                    *local.entry(v).or_insert_with(|| {
                        vertices.push(v as usize);
                        vertices.len() as u32 - 1
                    })
                })
            })
            .collect();
        let Some(images) = vertices.iter().map(|&v| seen[v].map(|s| s.1)).collect::<Option<Vec<_>>>() else {
            return false;
        };
        let wanted: Vec<u32> = images.iter().map(|p| p.face).collect();
        let Some(chart) = Chart::new(&source.mesh.positions, source.topology, &wanted) else { return false };
        let Some(mut points) = images.iter().map(|p| chart.place(p)).collect::<Option<Vec<DVec2>>>() else {
            return false;
        };
        let mut sides: Vec<[f64; 3]> = around
            .iter()
            .map(|&t| {
                let p = target.mesh.triangle_positions(t);
                [0, 1, 2].map(|k| p[(k + 1) % 3].distance_squared(p[(k + 2) % 3]))
            })
            .collect();
        if mirrored {
            triangles.iter_mut().for_each(|t| t.swap(1, 2));
            sides.iter_mut().for_each(|s| s.swap(1, 2));
        }
        let free: Vec<u32> = patch.iter().filter_map(|&v| local.get(&(v as u32)).copied()).collect();
        let from = points.clone();
        let planar = Patch { triangles: &triangles, sides: &sides, free: &free };
        let mut done = round != 1 && planar.untangle(&mut points);
        if !done {
            points.clone_from(&from);
            planar.average(&mut points);
            done = planar.untangle(&mut points);
        }
        if round < 2 && !done {
            if std::env::var("SAY").is_ok() { println!("notdone patch {} of {}", patch.len(), around.len()); }
            return false;
        }
        let near = Cell::new(0);
        let lift = |q: DVec2| {
            let mut t = near.get();
            let p = chart.lift(q, &mut t)?;
            near.set(t);
            Some(p)
        };
        let mesh = source.mesh;
        let on_surface = Lifted {
            triangles: &triangles,
            free: &free,
            flat: round < 2,
            sign: if mirrored { -1.0 } else { 1.0 },
            lift: |q| lift(q).map(|p| (p.position(mesh), normal_at(mesh, normals, &p))),
        };
        on_surface.set_upright(&mut points);
        on_surface.give_back(&mut points, &from);
        if std::env::var("SAY").is_ok() {
            println!("patch {} triangles {} done {done}", patch.len(), around.len());
        }
        for &v in &free {
            let Some(p) = lift(points[v as usize]) else { continue };
            let c = Closest { face: p.face, x: p.barycentric, distance_squared: 0.0 };
            let v = vertices[v as usize];
            self.z[v] = self.closest.point(&c);
            self.starts[v] = self.closest.vertex(&c);
        }
        true
    }
}

/// Whether the image of a triangle faces against the source there; one without image does not.
fn turned(seen: &[Seen], t: [u32; 3]) -> bool {
    let [Some(a), Some(b), Some(c)] = t.map(|v| seen[v as usize]) else { return false };
    let (n, m) = facing([a.0, b.0, c.0]);
    n.dot(m) < 0.0
}
