//! The closest point of a surface in R^K, by the vertices nearby; with normals as four more
//! coordinates where they count.

use rayon::prelude::*;

use crate::geometry::NONE;
use crate::surface::long_fans::{LongFan, LongFans, Reach};
use crate::surface::project::SearchLimits;
use crate::surface::vector::{Vector, combine, distance_squared, dot, sub};
use crate::surface::{NearestVertex, PhongSurface};

/// A weighted normal, the fourth component zero.
pub(in crate::surface) type Normal = Vector<f64, 4>;

/// A triangle whose squared sine at its first corner is no more than this has no tangent plane.
const THIN: f64 = 1e-12;

/// Borders crossed one by one before the fan of a vertex of very many triangles is searched.
const NEEDLES: usize = 8;

/// A point whose normal does not count.
pub(in crate::surface) const FLAT: Normal = [0.0; 4];

/// A closest point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::surface) struct Closest {
    pub(in crate::surface) face: u32,
    pub(in crate::surface) x: [f64; 3],
    /// Normals included.
    pub(in crate::surface) distance_squared: f64,
}

/// A point of R^K and its normal.
pub(in crate::surface) type Place<'a, const K: usize> = (&'a Vector<f64, K>, &'a Normal);

/// Answers closest point queries on a surface in R^K.
#[derive(Debug)]
pub(in crate::surface) struct ClosestOnSurface<'a, const K: usize> {
    surface: &'a PhongSurface<f64, K>,
    vertices: &'a NearestVertex<K>,
    /// Of each vertex; empty where they do not count.
    normals: &'a [Normal],
    /// Of each triangle the scalar products 00, 01, 11 of its two edges from the first corner,
    /// normals included; empty as they are.
    edges: Vec<[f64; 3]>,
    /// Long fans with normals; without, the surface has its own.
    long: Option<LongFans<K>>,
}

impl<'a, const K: usize> ClosestOnSurface<'a, K> {
    pub(in crate::surface) fn new(surface: &'a PhongSurface<f64, K>, vertices: &'a NearestVertex<K>) -> Self {
        Self { surface, vertices, normals: &[], edges: Vec::new(), long: None }
    }

    /// The same, with normals of the vertices. O(F K).
    pub(super) fn with_normals(&self, normals: &'a [Normal]) -> Self {
        let edges = |v: [u32; 3]| {
            let [a, b, c] = v.map(|v| &self.surface.vertices[v as usize].y);
            let [l, m, n] = v.map(|v| &normals[v as usize]);
            let (e, f) = ((sub(b, a), sub(m, l)), (sub(c, a), sub(n, l)));
            [dot(&e.0, &e.0) + dot(&e.1, &e.1), dot(&e.0, &f.0) + dot(&e.1, &f.1), dot(&f.0, &f.0) + dot(&f.1, &f.1)]
        };
        let edges = self.surface.triangles.par_iter().map(|t| edges(t.v)).collect();
        let surface = self.surface;
        let corners = |t: u32| surface.triangles[t as usize].v;
        let spot = |v: u32| (surface.vertices[v as usize].y, normals[v as usize]);
        let long = LongFans::new(surface.vertices.len(), |v| surface.fan(v), corners, spot);
        Self { surface, vertices: self.vertices, normals, edges, long: Some(long) }
    }

    /// The closest point of the triangles around the nearest vertex, then around the corners of the
    /// triangle found, until none is closer; the lowest triangle on ties. A local minimum that
    /// begins at the exactly nearest vertex: where triangles are much larger than the distance to
    /// another part of the surface it may not be the global one. `None` for a point that is not
    /// finite.
    pub(in crate::surface) fn find(&self, z: &Vector<f64, K>) -> Option<Closest> {
        self.near((z, &FLAT), NONE)
    }

    /// The same from the vertex that a walk from `start` comes to, several times as fast: the
    /// closest point of the same part of the surface, for points that have moved little. An unknown
    /// start (`NONE`) is the nearest vertex, normals aside.
    pub(in crate::surface) fn near(&self, place: Place<'_, K>, start: u32) -> Option<Closest> {
        if !finite(place) {
            return None;
        }
        let start = if start == NONE { self.vertices.find_one(place.0) } else { start };
        self.around(place, self.walk(place, start))
    }

    /// An index of the vertices by place in space and normal: the nearest of them may lie on
    /// another part of the surface than the nearest in R^K.
    pub(super) fn facing(&self) -> NearestVertex<8> {
        let used = (0..self.surface.vertices.len() as u32).filter(|&v| !self.surface.fan(v).is_empty()).collect();
        NearestVertex::of_points(used, |v| facing(&self.surface.vertices[v as usize].y, self.normal(v)))
    }

    /// The closer of what follows from `last` ([`Self::follow`]) and what is near the vertex that
    /// `index` gives.
    pub(super) fn near_or_facing(
        &self,
        place: Place<'_, K>,
        last: Option<&Closest>,
        index: &NearestVertex<8>,
    ) -> Option<Closest> {
        if !finite(place) {
            return None;
        }
        let Some(last) = last else { return self.near(place, NONE) };
        let a = self.follow(place, last.face)?;
        let start = self.walk(place, index.find_one(&facing(place.0, place.1)));
        if self.surface.triangles[a.face as usize].v.contains(&start) {
            return Some(a);
        }
        let b = self.around(place, start)?;
        Some(if (b.distance_squared, b.face) < (a.distance_squared, a.face) { b } else { a })
    }

    /// The closest point of the triangle `face`, or of those that come closer when its border is
    /// crossed: a tenth of the work again, for points that follow the one found last.
    pub(super) fn follow(&self, place: Place<'_, K>, face: u32) -> Option<Closest> {
        let mut best = self.on_triangle(place, face);
        if !best.distance_squared.is_finite() {
            return None;
        }
        for step in 1.. {
            let triangle = &self.surface.triangles[best.face as usize];
            let outside = best.x.map(|x| x <= 0.0);
            let closer = match outside.iter().filter(|o| **o).count() {
                0 => None,
                1 => {
                    let k = outside.iter().position(|o| *o).unwrap_or(0);
                    let t = triangle.neighbours[k];
                    (t != NONE).then(|| self.on_triangle(place, t))
                }
                // Two coordinates vanish: the corner of the third.
                _ => self.closer(place, triangle.v[outside.iter().position(|o| !*o).unwrap_or(0)], None),
            };
            match closer {
                Some(c) if (c.distance_squared, c.face) < (best.distance_squared, best.face) => best = c,
                _ => break,
            }
            if step % NEEDLES == 0 {
                // Around a vertex of thousands it may be a long way, needle by needle.
                for v in self.surface.triangles[best.face as usize].v {
                    if self.long(v, self.surface.fan(v).len()).is_some() {
                        best = self.closer(place, v, Some(best)).unwrap_or(best);
                    }
                }
            }
        }
        Some(self.lowest(best))
    }

    /// The same from a triangle at the vertex `start`; from the nearest vertex where that is
    /// unknown (`NONE`).
    pub(super) fn follow_from(&self, place: Place<'_, K>, start: u32) -> Option<Closest> {
        let fan = if start == NONE { &[] } else { self.surface.fan(start) };
        fan.first().map_or_else(|| self.near(place, NONE), |&t| self.follow(place, t))
    }

    /// A vertex near a point that was found, to start from when it has moved.
    pub(super) fn vertex(&self, c: &Closest) -> u32 {
        let [a, b, d] = c.x;
        let k = if a >= b && a >= d { 0 } else { 1 + usize::from(d > b) };
        self.surface.triangles[c.face as usize].v[k]
    }

    /// The place of a point that was found.
    pub(super) fn point(&self, c: &Closest) -> Vector<f64, K> {
        combine(&c.x, self.surface.triangles[c.face as usize].v.map(|v| &self.surface.vertices[v as usize].y))
    }

    /// The part of a displacement in R^K along the surface at a point that was found: its
    /// projection to the tangent plane of the surface with normals, where a step along the surface
    /// costs what it turns. Zero for degenerate triangles.
    pub(super) fn along(&self, c: &Closest, d: &Vector<f64, K>) -> Vector<f64, K> {
        let v = self.surface.triangles[c.face as usize].v.map(|v| &self.surface.vertices[v as usize].y);
        let (e, f) = (sub(v[1], v[0]), sub(v[2], v[0]));
        let Some([ee, ef, ff]) = self.edges.get(c.face as usize).copied() else { return [0.0; K] };
        let determinant = ee * ff - ef * ef;
        if determinant <= THIN * ee * ff {
            return [0.0; K];
        }
        let (de, df) = (dot(&e, d), dot(&f, d));
        let (x, y) = ((ff * de - ef * df) / determinant, (ee * df - ef * de) / determinant);
        std::array::from_fn(|k| x * e[k] + y * f[k])
    }

    fn normal(&self, v: u32) -> &Normal {
        self.normals.get(v as usize).unwrap_or(&FLAT)
    }

    /// Greedy walk over edges to a vertex no farther than its neighbours, the lowest on ties.
    fn walk(&self, (z, n): Place<'_, K>, start: u32) -> u32 {
        if start == NONE || self.normals.is_empty() {
            return if start == NONE {
                NONE
            } else {
                self.surface.walk_vertices(z, start, SearchLimits::FIRST.vertex_steps)
            };
        }
        let distance =
            |v: u32| distance_squared(&self.surface.vertices[v as usize].y, z) + distance_squared(self.normal(v), n);
        let mut v = start;
        let mut least = distance(v);
        loop {
            let mut next = v;
            let ring = self.surface.ring(v);
            if let Some(fan) = self.long(v, ring.len()) {
                fan.search(&(*z, *n), Reach::Vertices, least, |t| {
                    for w in self.surface.triangles[t as usize].v.into_iter().filter(|&w| w != v) {
                        let d = distance(w);
                        if d < least || (d == least && next != v && w < next) {
                            (least, next) = (d, w);
                        }
                    }
                    least
                });
            } else {
                for &w in ring {
                    let d = distance(w);
                    if d < least {
                        (least, next) = (d, w);
                    }
                }
            }
            if next == v {
                return v;
            }
            v = next;
        }
    }

    fn around(&self, place: Place<'_, K>, v: u32) -> Option<Closest> {
        if v == NONE {
            return None;
        }
        let mut best = self.closer(place, v, None);
        // The corners of the last triangle have been looked around, too.
        let mut seen = [v; 3];
        loop {
            let found = best?;
            let corners = self.surface.triangles[found.face as usize].v;
            for v in corners.into_iter().filter(|v| !seen.contains(v)) {
                best = self.closer(place, v, best);
            }
            if best == Some(found) {
                return Some(self.lowest(found));
            }
            seen = corners;
        }
    }

    /// A point of an edge or vertex as one of the lowest triangle there. Off a convex part of a
    /// surface whole regions are closest to an edge: which of its triangles is named would be a
    /// matter of rounding, and what is along the surface depends on it.
    fn lowest(&self, c: Closest) -> Closest {
        let triangles = &self.surface.triangles;
        let corners = triangles[c.face as usize].v;
        let place = |zero: bool| c.x.iter().position(|x| (*x == 0.0) == zero).unwrap_or(0);
        let face = match c.x.iter().filter(|x| **x == 0.0).count() {
            0 => return c,
            1 => triangles[c.face as usize].neighbours[place(true)],
            _ => self.surface.fan(corners[place(false)]).first().copied().unwrap_or(c.face),
        };
        // No triangle is the highest number.
        if face >= c.face {
            return c;
        }
        let own = |v: u32| corners.iter().position(|w| *w == v).map_or(0.0, |k| c.x[k]);
        Closest { face, x: triangles[face as usize].v.map(own), ..c }
    }

    /// The closest of `best` and the points of the triangles around `v`.
    fn closer(&self, place: Place<'_, K>, v: u32, best: Option<Closest>) -> Option<Closest> {
        let nearer = |b: Closest, c: Closest| {
            if (c.distance_squared, c.face) < (b.distance_squared, b.face) { c } else { b }
        };
        let fan = self.surface.fan(v);
        if let Some(long) = self.long(v, fan.len()) {
            let mut found = best;
            let least = best.map_or(f64::INFINITY, |b| b.distance_squared);
            long.search(&(*place.0, *place.1), Reach::Triangles, least, |t| {
                let here = self.on_triangle(place, t);
                let now = found.map_or(here, |b| nearer(b, here));
                found = Some(now);
                now.distance_squared
            });
            return found;
        }
        fan.iter().map(|&t| self.on_triangle(place, t)).chain(best).reduce(nearer)
    }

    /// The fan of `v` of `count` triangles, if it is long.
    fn long(&self, v: u32, count: usize) -> Option<&LongFan<K>> {
        match &self.long {
            Some(with_normals) => with_normals.of(v, count),
            None => self.surface.long.of(v, count),
        }
    }

    fn on_triangle(&self, (z, n): Place<'_, K>, face: u32) -> Closest {
        let v = self.surface.triangles[face as usize].v;
        let corners = v.map(|v| &self.surface.vertices[v as usize].y);
        if self.normals.is_empty() {
            let edges = [sub(corners[1], corners[0]), sub(corners[2], corners[0]), sub(z, corners[0])];
            return closest(face, gram(&edges));
        }
        let normals = v.map(|v| self.normal(v));
        let edges = [sub(corners[1], corners[0]), sub(corners[2], corners[0]), sub(z, corners[0])];
        let turns = [sub(normals[1], normals[0]), sub(normals[2], normals[0]), sub(n, normals[0])];
        let [bb, bc, cc] = self.edges[face as usize];
        let way = |k: usize| dot(&edges[k], &edges[2]) + dot(&turns[k], &turns[2]);
        closest(face, [bb, bc, cc, way(0), way(1), way(2)])
    }
}

fn finite<const K: usize>((z, n): Place<'_, K>) -> bool {
    z.iter().chain(n).all(|x| x.is_finite())
}

/// The part of a place that lies in space, and the normal.
fn facing<const K: usize>(z: &Vector<f64, K>, n: &Normal) -> [f64; 8] {
    const { assert!(K >= 4) };
    [z[K - 4], z[K - 3], z[K - 2], n[0], n[1], n[2], 0.0, 0.0]
}

/// Scalar products of three vectors: 00, 01, 11, 02, 12, 22.
fn gram<const K: usize>([a, b, c]: &[Vector<f64, K>; 3]) -> [f64; 6] {
    [dot(a, a), dot(a, b), dot(b, b), dot(a, c), dot(b, c), dot(c, c)]
}

/// The point of a triangle closest to another, from the scalar products of its edges and of the way
/// there from its first corner: inside, else the best of its three sides.
fn closest(face: u32, [bb, bc, cc, db, dc, dd]: [f64; 6]) -> Closest {
    // |p - z|^2 at barycentric coordinates (1 - v - w, v, w).
    let squared = |v: f64, w: f64| {
        let d = dd + v * (v * bb + 2.0 * w * bc - 2.0 * db) + w * (w * cc - 2.0 * dc);
        // Rounding, but not what is not a number.
        if d < 0.0 { 0.0 } else { d }
    };
    let determinant = bb * cc - bc * bc;
    if determinant > 1e-20 * bb * cc {
        let (v, w) = ((cc * db - bc * dc) / determinant, (bb * dc - bc * db) / determinant);
        if v >= 0.0 && w >= 0.0 && v + w <= 1.0 {
            return Closest { face, x: [1.0 - v - w, v, w], distance_squared: squared(v, w) };
        }
    }
    let along = |way: f64, length: f64| if length > 0.0 { (way / length).clamp(0.0, 1.0) } else { 0.0 };
    let (v, w) = (along(db, bb), along(dc, cc));
    // From the second corner to the third.
    let u = along(dc - db - bc + bb, bb - 2.0 * bc + cc);
    let candidates = [
        ([1.0 - v, v, 0.0], squared(v, 0.0)),
        ([0.0, 1.0 - u, u], squared(1.0 - u, u)),
        ([1.0 - w, 0.0, w], squared(0.0, w)),
    ];
    let (x, distance_squared) = candidates.into_iter().fold(candidates[0], |a, b| if b.1 < a.1 { b } else { a });
    Closest { face, x, distance_squared }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{ClosestPoints, Topology};
    use crate::models::shapes::{Random, lobed_sphere, uv_sphere};
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
            assert_eq!(here.near((&z, &FLAT), here.vertex(&found)), Some(found));
            assert_eq!(here.near((&z, &FLAT), NONE), Some(found));
            // Crossing borders never leads away, and from there to itself.
            for &t in surface.fan(here.vertex(&found)) {
                let again = here.follow((&z, &FLAT), t).unwrap();
                assert!(again.distance_squared <= here.on_triangle((&z, &FLAT), t).distance_squared);
                assert!(again.distance_squared >= found.distance_squared - 1e-9);
            }
            assert_eq!(here.follow((&z, &FLAT), found.face), Some(found));
        }
        assert!(here.find(&[f64::NAN; 4]).is_none() && here.follow((&[f64::NAN; 4], &FLAT), 0).is_none());
    }

    #[test]
    fn around_a_vertex_of_thousands_the_closest_is_found_from_anywhere() {
        let mesh = uv_sphere(1.0, 4000, 2);
        let topology = Topology::new(&mesh);
        let points: Vec<f64> = mesh.positions.iter().flat_map(|p| [p.x, p.y, p.z, 0.0]).collect();
        let surface = PhongSurface::<f64, 4>::new(&topology, &points).unwrap();
        let vertices = NearestVertex::new(&surface);
        let plain = ClosestOnSurface::new(&surface, &vertices);
        let normals: Vec<Normal> = mesh.positions.iter().map(|p| [0.1 * p.x, 0.1 * p.y, 0.1 * p.z, 0.0]).collect();
        let with_normals = plain.with_normals(&normals);
        let mut random = Random::new(7);
        for k in 0..60 {
            let t = (random.unit() * surface.triangles.len() as f64) as u32;
            let x = [random.unit(), random.unit(), random.unit()];
            let x = x.map(|b| b / x.iter().sum::<f64>());
            let corners = surface.triangles[t as usize].v;
            let mut z = combine(&x, corners.map(|v| &surface.vertices[v as usize].y));
            z.iter_mut().take(3).for_each(|c| *c *= 1.0 + 0.1 * random.unit());
            let n = combine(&x, corners.map(|v| &normals[v as usize]));
            let (here, place) = if k % 2 == 0 { (&plain, (&z, &FLAT)) } else { (&with_normals, (&z, &n)) };
            let all = (0..surface.triangles.len() as u32).map(|t| here.on_triangle(place, t).distance_squared);
            let least = all.fold(f64::INFINITY, f64::min);
            // From a triangle anywhere around the tip.
            let hub = corners.into_iter().max_by_key(|&v| surface.fan(v).len()).unwrap();
            let from = surface.fan(hub)[(random.unit() * surface.fan(hub).len() as f64) as usize];
            for found in [here.near(place, corners[0]), here.near(place, hub), here.follow(place, from)] {
                let distance = found.unwrap().distance_squared;
                assert!(distance <= least * (1.0 + 1e-6) + 1e-12, "{k}: {distance:e} {least:e}");
            }
        }
    }

    #[test]
    fn with_normals_it_is_the_closest_point_in_more_dimensions() {
        let mesh = lobed_sphere(3, 0.3);
        let topology = Topology::new(&mesh);
        let points: Vec<f64> = mesh.positions.iter().flat_map(|p| [p.x, p.y, p.z, 0.0]).collect();
        let surface = PhongSurface::<f64, 4>::new(&topology, &points).unwrap();
        let vertices = NearestVertex::new(&surface);
        let normals: Vec<Normal> = crate::surface::quality::vertex_normals(&mesh, &topology)
            .into_iter()
            .map(|n| [2.0 * n.x, 2.0 * n.y, 2.0 * n.z, 0.0])
            .collect();
        let here = ClosestOnSurface::new(&surface, &vertices).with_normals(&normals);
        let mut elsewhere = 0;
        for v in (0..mesh.vertex_count() as u32).step_by(7) {
            // A point a third of an edge off, with the normal of a vertex two edges on.
            let mut z = surface.vertices[v as usize].y;
            z[(v % 3) as usize] += 0.3;
            let beyond = surface.ring(surface.ring(v)[0])[0];
            let place = (&z, &normals[beyond as usize]);
            let found = here.near(place, v).unwrap();
            let all = (0..surface.triangles.len() as u32).map(|t| here.on_triangle(place, t).distance_squared);
            let least = all.fold(f64::INFINITY, f64::min);
            assert!(found.distance_squared <= least + 1e-9, "{v}: {} {least}", found.distance_squared);
            assert_eq!(here.follow(place, found.face), Some(found));
            elsewhere += usize::from(here.find(&z).unwrap().face != found.face);
        }
        assert!(elsewhere > 10, "normals count: {elsewhere}");
    }
}
