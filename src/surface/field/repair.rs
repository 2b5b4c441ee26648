//! Turning back the few triangles whose image is turned over.
//!
//! Such triangles lie where a relaxation folds: around details much smaller than the error of a map
//! (lids, nails, lips) and at creases of the source. The vertices around them get new images: in a
//! flat chart of the source around the old ones ([`chart`]) the triangles are untangled
//! ([`untangle`]), then moved where the surface, which is not flat, turns them still, and at last
//! each vertex goes back as far as it can ([`upright`]), so that a map loses nothing that it need
//! not.

mod chart;
mod untangle;
mod upright;

use std::cell::Cell;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use self::chart::Chart;
use self::untangle::Patch;
use self::upright::{Image, Lifted, facing};
use super::closest::{Closest, ClosestOnSurface};
use super::pair::Shapes;
use super::{GUARD, start_face};
use crate::control;
use crate::error::Result;
use crate::geometry::{NONE, SurfacePoint};
use crate::surface::PhongSurface;
use crate::surface::project::Found;
use crate::surface::quality::{normal_at, vertex_normals};
use crate::surface::vector::Vector;

/// Rings around turned triangles that may move, at most.
const RINGS: usize = 6;
/// Ways to begin, one after the other with all rings: at the present images or (1) at averages; the
/// triangles right in the chart as well as on the surface, or (2, 3) on the surface alone; at last
/// (4) without a change in the chart first.
const WAYS: usize = 5;
/// Triangles of patches that are worked on at most, all in all, beside a quarter of the target's:
/// what bounds a repair.
const WORK: usize = 50_000;
/// Of a map that turns more than one triangle of so many an image moves no farther than this, over
/// the square root of the source's area, or than so many edges of the target: what must go farther
/// there is not a fold but a part that lies elsewhere, and a map loses more than it gains.
const MANY: usize = 100;
const FARTHEST: f64 = 0.04;
const EDGES: f64 = 2.0;
/// A map that turns more than one triangle of so many is not one to be repaired.
const HOPELESS: usize = 4;

/// The images of a target's vertices, as they are repaired.
pub(super) struct Images<'a, const K: usize> {
    pub(super) shapes: &'a Shapes<'a>,
    /// The source in double precision, whatever the field projects in: a repair decides by which
    /// side of a crease images lie, and must not decide otherwise on another back end.
    pub(super) source: &'a PhongSurface<f64, K>,
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
    pub(super) first: Vec<usize>,
    /// Those that are left.
    pub(super) left: Vec<usize>,
}

/// The image of a vertex, and where on the source it is.
type Seen = Option<(Image, SurfacePoint)>;

/// How patches are untangled.
#[derive(Clone, Copy, Debug)]
struct Way {
    mirrored: bool,
    /// Whether to begin at averages.
    average: bool,
    /// Whether triangles must be right in the chart.
    flat: bool,
    /// Whether they are untangled there first.
    planar: bool,
}

impl<const K: usize> Images<'_, K> {
    /// Gives the vertices of turned triangles new images, then those of rings around them where
    /// that does not help. A patch is kept only if fewer of its triangles are turned and, where
    /// many are, no image moves far. Vertices of `held` stay. `O(F)`, and what turned triangles take,
    /// within bounds.
    ///
    /// # Errors
    /// [`Error::Cancelled`](crate::Error::Cancelled).
    pub(super) fn repair(&mut self, held: &[bool]) -> Result<Repaired> {
        let source = self.shapes.source;
        let normals = vertex_normals(source.mesh, source.topology);
        let first = |v: usize| Some(self.start_faces[self.first(v)?]);
        let mut seen: Vec<Seen> = (0..self.z.len()).into_par_iter().map(|v| self.see(v, first(v)?, &normals)).collect();
        let triangles = &self.shapes.target.topology.triangles;
        let usable = &self.shapes.target.topology.usable;
        let all: Vec<usize> = (0..triangles.len()).filter(|&t| usable[t]).collect();
        // A mirrored pair turns them all.
        let over = |seen: &[Seen], t: usize| turned(seen, triangles[t]);
        let mirrored = 2 * all.iter().filter(|&&t| over(&seen, t)).count() > all.len();
        let bad = |seen: &[Seen], t: usize| usable[t] && over(seen, t) != mirrored;
        let mut left: Vec<usize> = all.iter().copied().filter(|&t| bad(&seen, t)).collect();
        let first = left.clone();
        // Of as many equilateral triangles.
        let edge = (4.0 / (3.0_f64.sqrt() * all.len().max(1) as f64)).sqrt();
        let farthest = if MANY * first.len() > all.len() { FARTHEST.max(EDGES * edge) } else { f64::INFINITY };
        let mut work = all.len() / 4 + WORK;
        for (way, rings) in (0..WAYS).flat_map(|way| (0..=RINGS).map(move |rings| (way, rings))) {
            if left.is_empty() || HOPELESS * left.len() > all.len() {
                break;
            }
            control::check()?;
            let way = Way { mirrored, average: way % 2 == 1, flat: way < 2, planar: way < 4 };
            let mut touched = Vec::new();
            let mut tasks = Vec::new();
            for patch in self.patches(&left, rings, held) {
                let around = self.triangles_of(&patch);
                // What a start changes may reach the other corners, and the triangles around these.
                let corners = self.corners_of(&around);
                let reached = self.triangles_of(&corners);
                if around.len() <= work && reached.iter().any(|&t| bad(&seen, t)) {
                    work -= around.len();
                    tasks.push((patch, around, corners, reached));
                }
            }
            // Patches share no vertex and have no vertex of another one as a corner, so that they
            // do not depend on each other.
            let this = &*self;
            let found: Vec<_> = tasks.par_iter().map(|t| this.untangled(&t.0, &t.1, &seen, &normals, way)).collect();
            for ((patch, _, corners, reached), images) in tasks.into_iter().zip(found) {
                let Some(images) = images else { continue };
                let far = |(&v, p): (&usize, &SurfacePoint)| {
                    seen[v].is_some_and(|(image, _)| self.shapes.source_point(p).distance(image.0) > farthest)
                };
                if patch.iter().zip(&images).any(far) {
                    continue;
                }
                let count = |seen: &[Seen]| reached.iter().filter(|&&t| bad(seen, t)).count();
                let was = count(&seen);
                let replace = |p: &SurfacePoint| Closest { face: p.face, x: p.barycentric, distance_squared: 0.0 };
                let new: Vec<_> =
                    images.iter().map(replace).map(|c| (self.closest.point(&c), self.closest.vertex(&c))).collect();
                let kept = self.exchange(&patch, new);
                let seen_before: Vec<Seen> = corners.iter().map(|&v| seen[v]).collect();
                for &v in &corners {
                    seen[v] = self.start(v).and_then(|start| self.see(v, start, &normals));
                }
                if count(&seen) < was {
                    // Not only those that were turned before.
                    touched.extend(reached);
                } else {
                    self.exchange(&patch, kept);
                    corners.iter().zip(seen_before).for_each(|(&v, image)| seen[v] = image);
                }
            }
            left.extend(touched);
            left.sort_unstable();
            left.dedup();
            left.retain(|&t| bad(&seen, t));
        }
        Ok(Repaired { first, left: all.into_iter().filter(|&t| bad(&seen, t)).collect() })
    }

    /// Gives vertices other images and starts, and returns those they had.
    fn exchange(&mut self, patch: &[usize], new: Vec<(Vector<f64, K>, u32)>) -> Vec<(Vector<f64, K>, u32)> {
        let mut one = |(&v, (z, start)): (&usize, (Vector<f64, K>, u32))| {
            (std::mem::replace(&mut self.z[v], z), std::mem::replace(&mut self.starts[v], start))
        };
        patch.iter().zip(new).map(&mut one).collect()
    }

    /// The triangle as a corner of which a vertex is mapped.
    fn first(&self, v: usize) -> Option<usize> {
        self.shapes.target.topology.vertex_triangles(v as u32).first().map(|&t| t as usize)
    }

    /// Where the search for the image of a vertex starts, found anew.
    fn start(&self, v: usize) -> Option<u32> {
        let corners = self.shapes.target.topology.triangles[self.first(v)?];
        Some(start_face(self.closest, self.z, self.starts, corners))
    }

    /// Where a vertex goes, the search starting from a triangle of the source.
    fn see(&self, v: usize, start: u32, normals: &[DVec3]) -> Seen {
        let starts = self.shapes.target.topology.triangles[self.first(v)?].map(|v| self.starts[v as usize]);
        let image = self.source.project_near(&self.z[v], start, &starts);
        let projected = SurfacePoint::new(image.face, image.x);
        let distance = image.distance_squared.sqrt();
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
        Some((self.image(&p, normals), p))
    }

    /// The image of a point of the source itself: where its surface is creased sharply, the
    /// projection of a point need not be that point.
    fn projected(&self, p: &SurfacePoint, normals: &[DVec3]) -> Option<Image> {
        let c = Closest { face: p.face, x: p.barycentric, distance_squared: 0.0 };
        let image = self.source.project_near(&self.closest.point(&c), p.face, &[self.closest.vertex(&c); 3]);
        let there = SurfacePoint::new(image.face, image.x);
        (image.face != NONE).then(|| self.image(&there, normals))
    }

    fn image(&self, p: &SurfacePoint, normals: &[DVec3]) -> Image {
        let mesh = self.shapes.source.mesh;
        (self.shapes.source_point(p), normal_at(mesh, normals, p))
    }

    /// The vertices within some rings of triangles, the held ones left out, by connected patches;
    /// each rising.
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

    /// New images of the vertices of a patch, the other corners of the triangles around it staying;
    /// `None` if there is no chart for them, or no way to place them in it.
    fn untangled(
        &self,
        patch: &[usize],
        around: &[usize],
        seen: &[Seen],
        normals: &[DVec3],
        way: Way,
    ) -> Option<Vec<SurfacePoint>> {
        let (source, target) = (self.shapes.source, self.shapes.target);
        let vertices = self.corners_of(around);
        let local = |v: usize| vertices.binary_search(&v).ok().map(|k| k as u32);
        let images: Vec<SurfacePoint> = vertices.iter().map(|&v| Some(seen[v]?.1)).collect::<Option<_>>()?;
        let wanted: Vec<u32> = images.iter().map(|p| p.face).collect();
        let chart = Chart::new(&self.shapes.source_places, source.topology, &wanted)?;
        let from: Vec<DVec2> = images.iter().map(|p| chart.place(p)).collect::<Option<_>>()?;
        let (mut triangles, mut sides) = (Vec::new(), Vec::new());
        for &t in around {
            let [a, b, c] = target.topology.triangles[t].map(|v| local(v as usize));
            let p = target.mesh.triangle_positions(t);
            let square = [0, 1, 2].map(|k| p[(k + 1) % 3].distance_squared(p[(k + 2) % 3]));
            // What is mirrored is right the other way round.
            let order = if way.mirrored { [0, 2, 1] } else { [0, 1, 2] };
            let corners = [a?, b?, c?];
            triangles.push(order.map(|k| corners[k]));
            sides.push(order.map(|k| square[k]));
        }
        let free: Vec<u32> = patch.iter().map(|&v| local(v)).collect::<Option<_>>()?;
        let planar = Patch { triangles: &triangles, sides: &sides, free: &free };
        let mut points = from.clone();
        let mut done = !way.planar || (!way.average && planar.untangle(&mut points));
        if !done {
            points.clone_from(&from);
            planar.average(&mut points);
            done = planar.untangle(&mut points);
        }
        if way.flat && !done {
            return None;
        }
        let near = Cell::new(0);
        let lift = |q: DVec2| {
            let (p, t) = chart.lift(q, near.get())?;
            near.set(t);
            Some(p)
        };
        let on_surface = Lifted {
            triangles: &triangles,
            free: &free,
            flat: way.flat,
            lift: |q| lift(q).and_then(|p| self.projected(&p, normals)),
        };
        on_surface.set_upright(&mut points);
        on_surface.give_back(&mut points, &from);
        free.iter().map(|&v| lift(points[v as usize])).collect()
    }
}

/// Whether the image of a triangle faces against the source there; one without image does not.
fn turned(seen: &[Seen], t: [u32; 3]) -> bool {
    let [Some(a), Some(b), Some(c)] = t.map(|v| seen[v as usize]) else { return false };
    let (n, m) = facing([a.0, b.0, c.0]);
    n.dot(m) < 0.0
}

#[cfg(test)]
mod tests {
    use super::super::middle;
    use super::*;
    use crate::geometry::Topology;
    use crate::models::shapes::lobed_sphere;
    use crate::surface::NearestVertex;
    use crate::surface::correspondence::Shape;

    /// Repairs the identity of a closed surface, some images pushed along it by `push`; gives what
    /// the repair says and how far images are from where they belong, in edges.
    fn repaired(mirror: bool, push: &[(usize, f64)], held: &[usize]) -> (Repaired, Vec<f64>) {
        let source = lobed_sphere(3, 0.3);
        let mut target = source.clone();
        if mirror {
            target.positions.iter_mut().for_each(|p| p.x = -p.x);
        }
        let (st, tt) = (Topology::new(&source), Topology::new(&target));
        let shapes = Shapes::new(
            Shape { mesh: &source, topology: &st, embedding: None },
            Shape { mesh: &target, topology: &tt, embedding: None },
        )
        .unwrap();
        let rows: Vec<f64> = source.positions.iter().flat_map(|p| [p.x, p.y, p.z, 0.0]).collect();
        let reference = PhongSurface::<f64, 4>::new(&st, &rows).unwrap();
        let vertices = NearestVertex::new(&reference);
        let closest = ClosestOnSurface::new(&reference, &vertices);
        let right: Vec<Vector<f64, 4>> = reference.vertices.iter().map(|v| v.y).collect();
        let mut z = right.clone();
        for &(v, part) in push {
            // Beyond a neighbour.
            let w = reference.ring(v as u32)[0] as usize;
            let beyond: Vector<f64, 4> = std::array::from_fn(|k| z[v][k] + part * (right[w][k] - right[v][k]));
            z[v] = closest.point(&closest.find(&beyond).unwrap());
        }
        let mut starts: Vec<u32> = z.iter().map(|z| closest.vertex(&closest.find(z).unwrap())).collect();
        let faces: Vec<u32> =
            tt.triangles.iter().map(|&t| closest.find(&middle(&z, t)).map_or(NONE, |c| c.face)).collect();
        let mut stays = vec![false; z.len()];
        held.iter().for_each(|&v| stays[v] = true);
        let report = Images {
            shapes: &shapes,
            source: &reference,
            closest: &closest,
            z: &mut z,
            starts: &mut starts,
            start_faces: &faces,
        }
        .repair(&stays)
        .unwrap();
        let off = |(a, b): (&Vector<f64, 4>, &Vector<f64, 4>)| crate::surface::vector::distance_squared(a, b).sqrt();
        (report, z.iter().zip(&right).map(off).collect())
    }

    #[test]
    fn turned_triangles_are_turned_back_and_nothing_else_moves() {
        for mirror in [false, true] {
            let push = [(40, 2.5), (41, 3.0), (200, 1.8), (300, -2.2)];
            let (report, off) = repaired(mirror, &push, &[]);
            assert!(report.first.len() >= 8 && report.left.is_empty(), "{mirror} {report:?}");
            assert!(off.iter().all(|d| *d < 2.0), "{off:?}");
            assert!(off.iter().filter(|d| **d > 0.0).count() < 80);
            let (report, off) = repaired(mirror, &[], &[]);
            assert!(report.first.is_empty() && report.left.is_empty() && off.iter().all(|d| *d == 0.0));
        }
    }

    #[test]
    fn a_held_vertex_stays_though_others_must_give_way() {
        let (report, off) = repaired(false, &[(200, 2.0)], &[200]);
        let (_, pushed) = repaired(false, &[(200, 2.0)], &(0..642).collect::<Vec<_>>());
        assert!(!report.first.is_empty() && report.left.is_empty(), "{report:?}");
        assert_eq!(off[200], pushed[200]);
        assert!(pushed[200] > 1.0 && off.iter().filter(|d| **d > 0.0).count() > 1);
    }

    #[test]
    fn a_map_turned_over_everywhere_is_left_alone() {
        let push: Vec<(usize, f64)> = (0..642).map(|v| (v, if v % 2 == 0 { 3.0 } else { -3.0 })).collect();
        let (report, off) = repaired(false, &push, &[]);
        let (_, pushed) = repaired(false, &push, &(0..642).collect::<Vec<_>>());
        assert!(report.first.len() > 128 && report.left == report.first);
        assert_eq!(off, pushed);
    }
}
