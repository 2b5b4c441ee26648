//! A source and a target polyhedron that belong together.

use std::collections::HashMap;

use glam::DVec3;

use crate::error::{Error, Result};
use crate::geometry::Mesh;

/// Most triangles of a cage: the work of a map grows with points times triangles.
pub const MAX_FACES: usize = 16_384;

/// A face counts as one without area below this part of the square of the cage's diameter.
const NO_AREA: f64 = 1e-14;

/// Two closed polyhedra with the same faces.
///
/// Polygons are cut into triangles as fans from the first corner they have in the source, the same
/// way in both. Vertices of no face are kept and do not count. Orientation is normalised on
/// construction: triangles run anticlockwise seen from outside.
#[derive(Clone, Debug, PartialEq)]
pub struct Cage {
    /// The faces of both.
    pub triangles: Vec<[u32; 3]>,
    /// What the map starts from.
    pub source: Vec<DVec3>,
    /// What it ends at.
    pub target: Vec<DVec3>,
}

impl Cage {
    /// Pairs the vertices of two meshes by their numbers. Their polygons have to be the same; they
    /// may come in another order, begin at another corner, and all of them may run the other way
    /// round.
    ///
    /// # Errors
    /// [`Error::Mesh`] that names the mesh, the element and the remedy: where there are no faces or
    /// too many, where vertex counts or polygons differ, for open and non-manifold edges and faces
    /// that are oriented against each other, for positions that are not finite, for faces without
    /// an area, and for a target that is inside out. O(F log F) for F faces.
    pub fn new(source: &Mesh, target: &Mesh) -> Result<Self> {
        let wrong = |mesh: &Mesh, what: String, remedy: &str| Err(Error::mesh(&mesh.name, what, remedy));
        for mesh in [source, target] {
            if mesh.triangle_count() == 0 {
                return wrong(mesh, "the cage has no faces".into(), "Give a closed mesh");
            }
            if mesh.triangle_count() > MAX_FACES {
                let what = format!("the cage has {} triangles, {MAX_FACES} are supported", mesh.triangle_count());
                return wrong(mesh, what, "Give a coarse mesh around the model");
            }
            if let Some(v) = mesh.triangles().into_iter().flatten().find(|&v| !mesh.positions[v as usize].is_finite()) {
                return wrong(mesh, format!("vertex {v} of the cage is not finite"), "Export the cage again");
            }
        }
        let alike = "Both cages need the same vertices and polygons; deform a copy of the first to make the second";
        if source.vertex_count() != target.vertex_count() {
            let what = format!(
                "the cage has {} vertices, that of {} has {}",
                target.vertex_count(),
                source.name,
                source.vertex_count()
            );
            return wrong(target, what, alike);
        }
        same_polygons(source, target, alike)?;
        let mut triangles = source.triangles();
        closed(&source.name, &triangles)?;
        for mesh in [source, target] {
            let (low, high) = mesh.bounds().unwrap_or_default();
            let least = NO_AREA * (high - low).length_squared();
            if !least.is_finite() {
                return wrong(mesh, "the coordinates of the cage are too large".into(), "Scale it");
            }
            let flat = |t: &[u32; 3]| !(area_normal(t, &mesh.positions).length() > least);
            if let Some(t) = triangles.iter().position(flat) {
                let what = format!(
                    "triangle {t} of the cage ({:?}, of polygon {}) has no area",
                    triangles[t],
                    source.triangle_polygon(t)
                );
                return wrong(mesh, what, "Move its vertices apart, or remove the face");
            }
        }
        let (mut from, mut to) = (volume(&triangles, &source.positions), volume(&triangles, &target.positions));
        if from < 0.0 {
            triangles.iter_mut().for_each(|t| t.swap(1, 2));
            (from, to) = (-from, -to);
        }
        if !(from > 0.0) {
            return wrong(source, "the cage encloses no volume".into(), "Give a closed mesh around the model");
        }
        if !(to > 0.0) {
            let what = "the target cage is inside out: no map without folds reaches a mirrored shape".into();
            return wrong(target, what, "Mirror it back, or check the order of its vertices");
        }
        Ok(Self { triangles, source: source.positions.clone(), target: target.positions.clone() })
    }

    /// The same cages the other way round.
    pub fn reversed(&self) -> Self {
        Self { triangles: self.triangles.clone(), source: self.target.clone(), target: self.source.clone() }
    }
}

/// Twice the area of a triangle, as a normal.
pub(super) fn area_normal(t: &[u32; 3], positions: &[DVec3]) -> DVec3 {
    let [a, b, c] = t.map(|v| positions[v as usize]);
    (b - a).cross(c - a)
}

/// The volume that closed triangles enclose, negative where they run clockwise seen from outside.
pub fn volume(triangles: &[[u32; 3]], positions: &[DVec3]) -> f64 {
    let origin = triangles.first().map_or(DVec3::ZERO, |t| positions[t[0] as usize]);
    let part = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| positions[v as usize] - origin);
        a.dot(b.cross(c))
    };
    triangles.iter().map(part).sum::<f64>() / 6.0
}

/// A polygon from its lowest vertex on.
fn canonical(mesh: &Mesh, p: usize) -> Vec<u32> {
    let mut ring: Vec<u32> = mesh.polygon(p).iter().map(|c| c.vertex).collect();
    if let Some(first) = (0..ring.len()).min_by_key(|&i| ring[i]) {
        ring.rotate_left(first);
    }
    ring
}

fn same_polygons(source: &Mesh, target: &Mesh, remedy: &str) -> Result<()> {
    if source.polygon_count() != target.polygon_count() {
        let (here, there) = (target.polygon_count(), source.polygon_count());
        let what = format!("the cage has {here} polygons, that of {} has {there}", source.name);
        return Err(Error::mesh(&target.name, what, remedy));
    }
    let mut counts: HashMap<Vec<u32>, isize> = HashMap::new();
    for p in 0..target.polygon_count() {
        *counts.entry(canonical(target, p)).or_default() += 1;
    }
    let turned = |mut ring: Vec<u32>| {
        // The lowest vertex stays the first.
        ring.get_mut(1..).into_iter().for_each(<[u32]>::reverse);
        ring
    };
    let lacking = |turn: bool| {
        let mut left = counts.clone();
        (0..source.polygon_count()).find(|&p| {
            let ring = canonical(source, p);
            let count = left.entry(if turn { turned(ring) } else { ring }).or_default();
            *count -= 1;
            *count < 0
        })
    };
    match lacking(false) {
        Some(p) if lacking(true).is_some() => {
            let what = format!("polygon {p} of {} ({:?}) has no counterpart here", source.name, canonical(source, p));
            Err(Error::mesh(&target.name, what, remedy))
        }
        _ => Ok(()),
    }
}

/// Refuses what is open, not manifold along an edge, or not oriented.
fn closed(name: &str, triangles: &[[u32; 3]]) -> Result<()> {
    let mut edges: Vec<(u32, u32, bool, usize)> = Vec::with_capacity(3 * triangles.len());
    for (t, triangle) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
            if a == b {
                let what = format!("triangle {t} of the cage names vertex {a} twice");
                return Err(Error::mesh(name, what, "Remove the face"));
            }
            edges.push((a.min(b), a.max(b), a < b, t));
        }
    }
    edges.sort_unstable();
    for group in edges.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
        let (a, b, _, t) = group[0];
        let fault = match group {
            [_] => Some((format!("the cage is open at the edge {a}-{b} of triangle {t}"), "Close its holes")),
            [x, y] if x.2 == y.2 => Some((
                format!(
                    "triangles {} and {} of the cage are oriented against each other at the edge {a}-{b}",
                    x.3, y.3
                ),
                "Make the normals of the cage consistent",
            )),
            [_, _] => None,
            _ => Some((
                format!("{} triangles of the cage meet at the edge {a}-{b}", group.len()),
                "Give a manifold cage: two triangles at every edge",
            )),
        };
        if let Some((what, remedy)) = fault {
            return Err(Error::mesh(name, what, remedy));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::testing::box_cage;
    use super::*;

    fn mesh(triangles: &[[u32; 3]], positions: &[DVec3]) -> Mesh {
        Mesh::of_triangles("cage.obj", positions.to_vec(), triangles)
    }

    #[test]
    fn orientation_is_normalised_in_both_together() {
        let (triangles, positions) = box_cage(1);
        let over: Vec<[u32; 3]> = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
        let (right, turned) = (mesh(&triangles, &positions), mesh(&over, &positions));
        for (a, b) in [(&right, &right), (&turned, &turned), (&turned, &right), (&right, &turned)] {
            let cage = Cage::new(a, b).unwrap();
            assert!((volume(&cage.triangles, &cage.source) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn polygons_may_come_in_another_order_and_begin_elsewhere() {
        let (mut triangles, positions) = box_cage(1);
        let one = mesh(&triangles, &positions);
        triangles.reverse();
        triangles.iter_mut().for_each(|t| t.rotate_left(1));
        assert_eq!(Cage::new(&one, &mesh(&triangles, &positions)).unwrap().triangles, one.triangles());
    }

    #[test]
    fn what_is_no_cage_is_refused_by_name() {
        let (triangles, positions) = box_cage(1);
        let good = mesh(&triangles, &positions);
        let says = |a: &Mesh, b: &Mesh, words: &str| {
            let message = Cage::new(a, b).unwrap_err().to_string();
            assert!(message.contains(words) && message.contains("cage.obj"), "{message}");
        };
        says(&mesh(&[], &[]), &good, "no faces");
        let open = mesh(&triangles[1..], &positions);
        says(&open, &open, "open at the edge");
        let mut third = triangles.clone();
        third.push([triangles[0][1], triangles[0][0], 7]);
        let third = mesh(&third, &positions);
        says(&third, &third, "meet at the edge");
        let mut against = triangles.clone();
        against[0].swap(0, 1);
        let against = mesh(&against, &positions);
        says(&against, &against, "oriented against each other");
        let mut more = positions.clone();
        more.push(DVec3::ZERO);
        says(&good, &mesh(&triangles, &more), "9 vertices");
        let mut other = triangles.clone();
        (other[0], other[1]) = ([other[0][0], other[0][1], other[1][2]], [other[0][1], other[0][2], other[1][2]]);
        says(&good, &mesh(&other, &positions), "has no counterpart");
        says(&good, &mesh(&triangles[2..], &positions), "10 polygons");
        let mirrored: Vec<DVec3> = positions.iter().map(|p| DVec3::new(-p.x, p.y, p.z)).collect();
        says(&good, &mesh(&triangles, &mirrored), "inside out");
        let mut nan = positions.clone();
        nan[3].y = f64::NAN;
        says(&good, &mesh(&triangles, &nan), "vertex 3 of the cage is not finite");
        let mut flat = positions.clone();
        flat[triangles[5][0] as usize] = flat[triangles[5][1] as usize];
        says(&good, &mesh(&triangles, &flat), "has no area");
        let huge: Vec<DVec3> = positions.iter().map(|p| p * 1e200).collect();
        says(&good, &mesh(&triangles, &huge), "too large");
    }
}
