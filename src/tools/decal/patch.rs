//! Which triangles show the picture.

use std::collections::BTreeSet;

use glam::DVec2;

use super::DecalAnchors;
use super::domain::Domain;
use crate::error::{Error, Result};
use crate::geometry::{Mesh, NONE, SurfacePoint, Topology};

/// Triangles turned over that are enclosed in the patch belong to it up to this part of its area: a
/// crease in the picture is better than a hole.
const CREASE: f64 = 0.02;
/// Rings of triangles around an anchor that tell which way the picture is turned there: single
/// triangles of a rough surface do not.
const RINGS: usize = 3;
/// Points along a side of the picture at which it is counted how often it is shown.
const GRID: usize = 128;

/// The part of a surface that shows the picture.
#[derive(Debug)]
pub(super) struct Patch {
    /// Ascending.
    pub(super) triangles: Vec<u32>,
    /// Whether the picture is turned over, seen from outside.
    pub(super) mirrored: bool,
}

/// The corners of triangle `t` in the picture, if all have a place there.
fn corners_of(mesh: &Mesh, uv: &[Option<DVec2>], t: u32) -> Option<[DVec2; 3]> {
    let [a, b, c] = mesh.triangle(t as usize).map(|v| uv[v as usize]);
    Some([a?, b?, c?])
}

/// Area of triangle `t` in the unit square, positive if it is counter-clockwise; 0 where it has no
/// place.
pub(super) fn signed_area(mesh: &Mesh, uv: &[Option<DVec2>], t: u32) -> f64 {
    corners_of(mesh, uv, t).map_or(0.0, |[a, b, c]| 0.5 * (b - a).perp_dot(c - a))
}

/// Whether a triangle meets the open unit square: no axis separates them.
fn meets_square(corners: [DVec2; 3]) -> bool {
    let apart = |low: f64, high: f64, from: f64, to: f64| high <= from || low >= to;
    let range = |f: &dyn Fn(DVec2) -> f64| {
        let v = corners.map(f);
        (v[0].min(v[1]).min(v[2]), v[0].max(v[1]).max(v[2]))
    };
    let (x, y) = (range(&|p| p.x), range(&|p| p.y));
    if apart(x.0, x.1, 0.0, 1.0) || apart(y.0, y.1, 0.0, 1.0) {
        return false;
    }
    (0..3).all(|k| {
        let normal = (corners[(k + 1) % 3] - corners[k]).perp();
        let (low, high) = range(&|p| normal.dot(p));
        // The square's own range along the normal.
        let (from, to) = (normal.x.min(0.0) + normal.y.min(0.0), normal.x.max(0.0) + normal.y.max(0.0));
        !apart(low, high, from, to)
    })
}

/// The triangles within [`RINGS`] of a vertex.
fn around(topology: &Topology, v: u32) -> Vec<u32> {
    let mut found = topology.vertex_triangles(v).to_vec();
    for _ in 1..RINGS {
        let vertices: BTreeSet<u32> = found.iter().flat_map(|&t| topology.triangles[t as usize]).collect();
        found = vertices.iter().flat_map(|&v| topology.vertex_triangles(v)).copied().collect();
        found.sort_unstable();
        found.dedup();
    }
    found
}

impl Patch {
    /// The triangles of the domain that meet the unit square, are connected with the anchors over
    /// such triangles, and are turned like the picture at the anchors; with what is enclosed and
    /// turned over.
    ///
    /// # Errors
    /// [`Error::Input`] if the picture is turned over at some anchor against the others, or nothing
    /// of it is shown.
    pub(super) fn new(
        mesh: &Mesh,
        topology: &Topology,
        domain: &Domain,
        uv: &[Option<DVec2>],
        anchors: &DecalAnchors,
        corners: &[u32],
    ) -> Result<Self> {
        let turns: Vec<f64> =
            corners.iter().map(|&v| around(topology, v).iter().map(|&t| signed_area(mesh, uv, t)).sum()).collect();
        let mirrored = 2 * turns.iter().filter(|a| **a < 0.0).count() > turns.len();
        if let Some(i) = turns.iter().position(|a| !(*a != 0.0 && (*a < 0.0) == mirrored)) {
            return Err(Error::input(
                format!("the anchors contradict one another: the picture is turned over at anchor {i}"),
                "Give the points of the picture in the order of the anchors: the corners go around, and do not cross",
            ));
        }
        let mut inside = vec![false; mesh.triangle_count()];
        let mut upright = vec![false; mesh.triangle_count()];
        for &t in &domain.faces {
            inside[t as usize] = corners_of(mesh, uv, t).is_some_and(meets_square);
            let area = signed_area(mesh, uv, t);
            upright[t as usize] = inside[t as usize] && area != 0.0 && (area < 0.0) == mirrored;
        }
        let around_anchor = |p: &SurfacePoint| -> Vec<u32> {
            let v = mesh.triangle(p.face as usize)[p.dominant_corner()];
            let mut all = topology.vertex_triangles(v).to_vec();
            all.push(p.face);
            all
        };
        let mut stack: Vec<u32> =
            anchors.points.iter().flat_map(around_anchor).filter(|&t| upright[t as usize]).collect();
        if stack.is_empty() {
            // No anchor is in the picture: its part nearest to its centre is between them.
            stack.extend(domain.faces.iter().copied().filter(|&t| upright[t as usize]).min_by(|&a, &b| {
                let off =
                    |t| corners_of(mesh, uv, t).map_or(f64::INFINITY, |c| ((c[0] + c[1] + c[2]) / 3.0 - 0.5).length());
                off(a).total_cmp(&off(b)).then(a.cmp(&b))
            }));
        }
        let mut taken = vec![false; mesh.triangle_count()];
        let mut area = 0.0;
        while let Some(t) = stack.pop() {
            if std::mem::replace(&mut taken[t as usize], true) {
                continue;
            }
            area += mesh.triangle_area(t as usize);
            let beside = topology.neighbours[t as usize];
            stack.extend(beside.into_iter().filter(|&n| n != NONE && upright[n as usize] && !taken[n as usize]));
        }
        add_creases(mesh, topology, &inside, &mut taken, CREASE * area);
        let triangles: Vec<u32> = domain.faces.iter().copied().filter(|&t| taken[t as usize]).collect();
        if triangles.is_empty() {
            return Err(Error::input(
                "no part of the surface shows the picture",
                "Put anchors around or inside the unit square, nearer to one another",
            ));
        }
        Ok(Self { triangles, mirrored })
    }
}

/// Takes connected groups of triangles inside the square that are not taken, if they are small and
/// touch the patch.
fn add_creases(mesh: &Mesh, topology: &Topology, inside: &[bool], taken: &mut [bool], most: f64) {
    let mut seen = vec![false; inside.len()];
    for first in 0..inside.len() as u32 {
        if !inside[first as usize] || taken[first as usize] || seen[first as usize] {
            continue;
        }
        let (mut group, mut stack, mut area, mut touches) = (Vec::new(), vec![first], 0.0, false);
        seen[first as usize] = true;
        while let Some(t) = stack.pop() {
            group.push(t);
            area += mesh.triangle_area(t as usize);
            for n in topology.neighbours[t as usize].into_iter().filter(|&n| n != NONE && inside[n as usize]) {
                if taken[n as usize] {
                    touches = true;
                } else if !std::mem::replace(&mut seen[n as usize], true) {
                    stack.push(n);
                }
            }
        }
        if touches && area <= most {
            group.iter().for_each(|&t| taken[t as usize] = true);
            // So that a group beside this one does not count as enclosed.
            group.iter().for_each(|&t| seen[t as usize] = true);
        }
    }
}

/// Shares of the picture that the triangles show, and that they show more than once, on a grid of
/// points.
pub(super) fn shown(mesh: &Mesh, triangles: &[u32], uv: &[Option<DVec2>]) -> (f64, f64) {
    let mut count = vec![0u8; GRID * GRID];
    let n = GRID as f64;
    for &t in triangles {
        let Some(mut c) = corners_of(mesh, uv, t) else { continue };
        if (c[1] - c[0]).perp_dot(c[2] - c[0]) < 0.0 {
            c.swap(1, 2);
        }
        let low = (c[0].min(c[1]).min(c[2]) * n - 0.5).ceil().max(DVec2::ZERO);
        let high = (c[0].max(c[1]).max(c[2]) * n - 0.5).floor().min(DVec2::splat(n - 1.0));
        for y in low.y as usize..(high.y + 1.0).max(0.0) as usize {
            for x in low.x as usize..(high.x + 1.0).max(0.0) as usize {
                let p = (DVec2::new(x as f64, y as f64) + 0.5) / n;
                let holds = (0..3).all(|k| {
                    let side = (c[(k + 1) % 3] - c[k]).perp_dot(p - c[k]);
                    // An edge between two triangles belongs to one.
                    side > 0.0 || (side == 0.0 && c[k].to_array() < c[(k + 1) % 3].to_array())
                });
                if holds {
                    let at = &mut count[y * GRID + x];
                    *at = at.saturating_add(1);
                }
            }
        }
    }
    let share = |least: u8| count.iter().filter(|c| **c >= least).count() as f64 / (n * n);
    (share(1), share(2))
}
