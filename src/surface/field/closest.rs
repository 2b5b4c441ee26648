//! The closest point of a surface in R^K, by the vertices nearby.

use crate::geometry::NONE;
use crate::surface::project::SearchLimits;
use crate::surface::vector::{Vector, combine, distance_squared, dot, sub};
use crate::surface::{NearestVertex, PhongSurface};

/// A closest point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Closest {
    pub(super) face: u32,
    pub(super) x: [f64; 3],
    pub(super) distance_squared: f64,
}

/// Answers closest point queries on a surface in R^K.
#[derive(Debug)]
pub(super) struct ClosestOnSurface<'a, const K: usize> {
    surface: &'a PhongSurface<f64, K>,
    vertices: &'a NearestVertex<K>,
}

impl<'a, const K: usize> ClosestOnSurface<'a, K> {
    pub(super) fn new(surface: &'a PhongSurface<f64, K>, vertices: &'a NearestVertex<K>) -> Self {
        Self { surface, vertices }
    }

    /// The closest point of the triangles around the nearest vertex, then around the corners of the triangle found, until none is closer; the lowest triangle on ties. A
    /// local minimum that begins at the exactly nearest vertex: where triangles are much larger than the distance to another part of the surface it may
    /// not be the global one. `None` for a point that is not finite.
    pub(super) fn find(&self, z: &Vector<f64, K>) -> Option<Closest> {
        self.around(z, self.vertices.find(z))
    }

    /// The same from the vertex that a walk from `start` comes to, twenty times as fast: the closest point of the same part of the surface, for points that have moved little. An unknown
    /// start (`NONE`) begins as [`Self::find`] does.
    pub(super) fn near(&self, z: &Vector<f64, K>, start: u32) -> Option<Closest> {
        if start == NONE || !z.iter().all(|x| x.is_finite()) {
            return self.find(z);
        }
        self.around(z, self.surface.walk_vertices(z, start, SearchLimits::FIRST.vertex_steps))
    }

    /// A vertex near a point that was found, to start from when it has moved.
    pub(super) fn vertex(&self, c: &Closest) -> u32 {
        let [a, b, d] = c.x;
        let k = if a >= b && a >= d { 0 } else { 1 + usize::from(d > b) };
        self.surface.triangles[c.face as usize].v[k]
    }

    fn around(&self, z: &Vector<f64, K>, v: u32) -> Option<Closest> {
        if v == NONE {
            return None;
        }
        let mut best = self.closer(z, v, None);
        loop {
            let found = best?;
            for v in self.surface.triangles[found.face as usize].v {
                best = self.closer(z, v, best);
            }
            if best == Some(found) {
                return best;
            }
        }
    }

    /// The closest of `best` and the points of the triangles around `v`.
    fn closer(&self, z: &Vector<f64, K>, v: u32, best: Option<Closest>) -> Option<Closest> {
        self.surface
            .fan(v)
            .iter()
            .map(|&t| self.on_triangle(z, t))
            .chain(best)
            .reduce(|b, c| if (c.distance_squared, c.face) < (b.distance_squared, b.face) { c } else { b })
    }

    /// The place of a point that was found.
    pub(super) fn point(&self, c: &Closest) -> Vector<f64, K> {
        combine(&c.x, self.surface.triangles[c.face as usize].v.map(|v| &self.surface.vertices[v as usize].y))
    }

    fn on_triangle(&self, z: &Vector<f64, K>, face: u32) -> Closest {
        let corners = self.surface.triangles[face as usize].v.map(|v| &self.surface.vertices[v as usize].y);
        let x = closest_barycentric(z, corners);
        let p = combine(&x, corners);
        Closest { face, x, distance_squared: distance_squared(&p, z) }
    }
}

/// Barycentric coordinates of the point of a triangle closest to `z`: inside by the Gram matrix of its edges, else the best of its three sides.
fn closest_barycentric<const K: usize>(z: &Vector<f64, K>, [a, b, c]: [&Vector<f64, K>; 3]) -> [f64; 3] {
    let (ab, ac, az) = (sub(b, a), sub(c, a), sub(z, a));
    let (bb, bc, cc) = (dot(&ab, &ab), dot(&ab, &ac), dot(&ac, &ac));
    let (db, dc) = (dot(&ab, &az), dot(&ac, &az));
    let determinant = bb * cc - bc * bc;
    if determinant > 1e-20 * bb * cc {
        let (v, w) = ((cc * db - bc * dc) / determinant, (bb * dc - bc * db) / determinant);
        if v >= 0.0 && w >= 0.0 && v + w <= 1.0 {
            return [1.0 - v - w, v, w];
        }
    }
    let side = |p: &Vector<f64, K>, q: &Vector<f64, K>| {
        let e = sub(q, p);
        let length = dot(&e, &e);
        if length > 0.0 { (dot(&sub(z, p), &e) / length).clamp(0.0, 1.0) } else { 0.0 }
    };
    let (u, v, w) = (side(a, b), side(b, c), side(c, a));
    let candidates = [[1.0 - u, u, 0.0], [0.0, 1.0 - v, v], [w, 0.0, 1.0 - w]];
    let distance = |x: &[f64; 3]| distance_squared(&combine(x, [a, b, c]), z);
    candidates.into_iter().reduce(|x, y| if distance(&y) < distance(&x) { y } else { x }).unwrap_or([1.0, 0.0, 0.0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{ClosestPoints, Topology};
    use crate::models::shapes::{Random, lobed_sphere};
    use glam::DVec3;

    #[test]
    fn in_space_it_is_the_closest_point_of_the_mesh() {
        let mesh = lobed_sphere(3, 0.3);
        let topology = Topology::new(&mesh);
        let points: Vec<f64> = mesh.positions.iter().flat_map(|p| [p.x, p.y, p.z, 0.0]).collect();
        let surface = PhongSurface::<f64, 4>::new(&topology, &points).unwrap();
        let vertices = NearestVertex::new(&surface);
        let here = ClosestOnSurface::new(&surface, &vertices);
        let truth = ClosestPoints::new(&mesh, &topology);
        let mut random = Random::new(5);
        for _ in 0..300 {
            let p = DVec3::new(random.signed(), random.signed(), random.signed()) * 1.5;
            // Near the middle no point of the surface is clearly the closest.
            if p.length() < 0.6 {
                continue;
            }
            let z = std::array::from_fn(|k| (if k < 3 { p[k] } else { 0.0 } - surface.centre[k]) / surface.edge);
            let (found, wanted) = (here.find(&z).unwrap(), truth.nearest(p).unwrap());
            assert!((found.distance_squared.sqrt() * surface.edge - wanted.1).abs() < 1e-9);
            // A walk comes to the same from nearby.
            assert_eq!(here.near(&z, here.vertex(&found)), Some(found));
            assert_eq!(here.near(&z, NONE), Some(found));
        }
        assert!(here.find(&[f64::NAN; 4]).is_none());
    }
}
