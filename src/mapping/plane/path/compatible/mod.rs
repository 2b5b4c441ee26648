//! A path that never intersects itself: convex combinations in compatible triangulations.
//!
//! Source and target are drawn in one convex frame. Every region between loops, the surroundings
//! included, is cut open to a disc in the same way in both drawings and triangulated in each; the
//! two triangulations laid over one another ([`overlay`]) are one triangulation with two drawings.
//! In each, every vertex off the frame is a convex combination of its neighbours, by their mean
//! value weights. Mixtures of the two rows are convex combinations as well, and a triangulation
//! with a convex frame drawn by convex combinations has no intersections (Tutte 1963; Floater 1997,
//! 2003; Gotsman, Surazhsky 2001): so for every `t` the solution of a sparse system has the loops
//! simple, disjoint and nested as they are. The new vertices lie off the loops.
//!
//! Shape only is treated so: scale, position and a common rotation are taken out before and put
//! back, linearly in `t`.

mod cut;
mod overlay;
mod system;
#[cfg(test)]
mod tests;
mod triangulation;

use std::collections::BTreeSet;

use glam::DVec2;

use crate::error::{Error, Result};
use crate::geometry::Polygon;
use crate::geometry::polygon::Nesting;
use crate::mapping::plane::Cage;

use super::placement::Placement;
use super::{PathKind, VertexPath};
use cut::{Drawings, Region};
use system::System;
use triangulation::Triangulation;

/// Crossings of diagonals, at most: bounds memory and the time of a solve.
const MOST_CROSSINGS: usize = 30_000;
/// Vertices of the cage, at most: all pairs of diagonals are looked at.
const MOST_VERTICES: usize = 2_048;
/// Half the side of the frame, in the distance of the farthest vertex from the barycentre.
const FRAME: f64 = 1.5;

/// A path without self-intersections (Gotsman, Surazhsky 2001), also between polygons of several
/// loops.
///
/// Both polygons and their surroundings in a convex frame are triangulated compatibly (Aronov,
/// Seidel, Souvaine 1993); each vertex is a convex combination of its neighbours by mean value
/// weights in either, the combinations are mixed linearly in `t`, and a sparse system gives the
/// vertices. Area, barycentre and rotation of the outermost loop go linearly. Loops stay simple,
/// disjoint and nested for every `t` in exact arithmetic; in double precision very thin parts may
/// fail.
///
/// Building it takes O(n^2) time and new vertices at most, for n vertices; a polygon of the path
/// takes one sparse solve.
#[derive(Clone, Debug)]
pub struct Compatible {
    cage: Cage,
    /// Loop that is around all others.
    outermost: usize,
    source: Placement,
    target: Placement,
    system: System,
}

fn failure(what: &str) -> Error {
    Error::numeric(
        format!("the compatible path fails: {what}"),
        "Remove very thin parts of source and target, or use fewer vertices",
    )
}

impl Compatible {
    /// The compatible path between the polygons of `cage`.
    ///
    /// # Errors
    /// [`Error::Numeric`] where the polygons have too many vertices, or parts so thin that double
    /// precision does not hold their triangulations.
    pub fn new(cage: &Cage) -> Result<Self> {
        if cage.source.vertex_count() > MOST_VERTICES {
            return Err(failure(&format!("{} vertices are more than {MOST_VERTICES}", cage.source.vertex_count())));
        }
        let nesting = cage.source.nesting().map_err(|defect| failure(&defect.to_string()))?;
        let outermost = nesting.parents.iter().position(Option::is_none).unwrap_or(0);
        let [source, mut target] = [&cage.source, &cage.target].map(|p| Placement::of(&p.loops()[outermost]));
        let (mut cross, mut dot) = (0.0, 0.0);
        for (p, q) in cage.source.vertices().zip(cage.target.vertices()) {
            let (p, q) = (source.normal(p), target.normal(q));
            cross += p.perp_dot(q);
            dot += p.dot(q);
        }
        target.angle = f64::atan2(cross, dot);
        let drawings = [(&cage.source, source), (&cage.target, target)]
            .map(|(polygon, place)| polygon.vertices().map(|v| place.normal(v)).collect::<Vec<DVec2>>());
        let system = triangulate(&cage.source, &nesting, drawings)?;
        Ok(Self { cage: cage.clone(), outermost, source, target, system })
    }
}

/// The compatible triangulations of both drawings and of their surroundings, as a system of convex
/// combinations.
fn triangulate(polygon: &Polygon, nesting: &Nesting, loops: [Vec<DVec2>; 2]) -> Result<System> {
    let half = FRAME * loops.iter().flatten().map(|v| v.length()).fold(0.0, f64::max);
    let frame = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| DVec2::new(x, y) * half);
    let points = loops.map(|loops| frame.iter().copied().chain(loops).collect());
    let mut drawings = Drawings { points, kept: BTreeSet::new() };
    let corners: Vec<usize> = (0..frame.len()).collect();
    let mut first = frame.len();
    let rings: Vec<Vec<usize>> = polygon
        .loops()
        .iter()
        .map(|ring| {
            let start = first;
            first += ring.len();
            (start..first).collect()
        })
        .collect();
    for ring in rings.iter().chain([&corners]) {
        drawings.keep_loop(ring);
    }
    // The region around everything, then the one inside of each loop. Loops have the domain to
    // their left, so that the regions that are not in the domain see them the other way round.
    let children = |parent: Option<usize>| (0..rings.len()).filter(move |&ring| nesting.parents[ring] == parent);
    let turned = |ring: usize, domain: bool| {
        let mut ring = rings[ring].clone();
        if !domain {
            ring.reverse();
        }
        ring
    };
    let mut regions = vec![Region { outer: corners, inner: children(None).map(|ring| turned(ring, false)).collect() }];
    regions.extend((0..rings.len()).map(|ring| {
        let domain = nesting.depths[ring].is_multiple_of(2);
        let inner = children(Some(ring)).map(|inner| turned(inner, domain)).collect();
        Region { outer: turned(ring, domain), inner }
    }));
    let thin = || failure("it has parts too thin to triangulate");
    let words: Vec<Vec<usize>> =
        regions.into_iter().map(|region| drawings.cut_open(region)).collect::<Option<_>>().ok_or_else(thin)?;
    let Drawings { mut points, kept } = drawings;
    let base = points.clone();
    let sides = [0, 1].map(|side| Triangulation::new(&base[side], &kept));
    let [Some(source), Some(target)] = sides else { return Err(thin()) };
    let mut triangles = Vec::new();
    for word in &words {
        let (Some(a), Some(b)) = (source.disc(word), target.disc(word)) else { return Err(thin()) };
        let room = MOST_CROSSINGS.saturating_sub(points[0].len() - base[0].len());
        let overlay = overlay::overlay(word, &[a, b], &base, points[0].len(), room)
            .ok_or_else(|| failure("source and target differ so much that too many new vertices are needed"))?;
        for (points, new) in points.iter_mut().zip(overlay.points) {
            points.extend(new);
        }
        triangles.extend(overlay.triangles);
    }
    System::new(&points, &triangles, frame.len()).ok_or_else(thin)
}

impl VertexPath for Compatible {
    fn polygon(&self, t: f64) -> Result<Polygon> {
        if t == 0.0 || t == 1.0 {
            return Ok(if t == 0.0 { self.cage.source.clone() } else { self.cage.target.clone() });
        }
        let solved = self.system.solve(t).ok_or_else(|| failure(&format!("its system has no solution at t = {t}")))?;
        let mut rest = solved[self.system.frame()..].iter().copied();
        let loops: Vec<Vec<DVec2>> =
            self.cage.source.loops().iter().map(|ring| rest.by_ref().take(ring.len()).collect()).collect();
        // Area, position and rotation go as they do on the intrinsic path, whatever the
        // triangulation made of them.
        let shape = Placement::of(&loops[self.outermost]);
        let mix = |a: f64, b: f64| (1.0 - t) * a + t * b;
        let (a, b) = (&self.source, &self.target);
        let place = Placement {
            centre: a.centre * (1.0 - t) + b.centre * t,
            scale: mix(a.scale * a.scale, b.scale * b.scale).sqrt(),
            angle: mix(a.angle, b.angle),
        };
        let loops = loops.into_iter().map(|ring| ring.into_iter().map(|v| place.place(shape.normal(v))).collect());
        Ok(Polygon::from_loops(loops.collect()))
    }

    fn kind(&self) -> PathKind {
        PathKind::Compatible
    }
}
