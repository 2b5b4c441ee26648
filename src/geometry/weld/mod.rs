//! Which vertices of a file are one point of the surface.
//!
//! Files repeat vertices: for every face (STL converters, flat-shaded exports), or where texture
//! coordinates or normals differ (game exports). The surface is connected there, and a method that
//! takes it as cut tears it. Joining all vertices of equal position would be wrong too: it glues
//! shells that touch and lips that are closed. The rule therefore works on *open edges*, which have
//! one usable triangle each:
//!
//! 1. Two open edges that lie on one another in opposite directions are joined, and so are their
//!    end vertices. Nothing else joins vertices: shells and parts that touch in a vertex, or with
//!    edges that are not open, stay apart.
//! 2. Two open edges in the *same* direction stay apart: one of the faces is turned over.
//! 3. More than two on one place would make an edge of more than two triangles. They are joined two
//!    at a time where it is clear which belong together, looked for in this order: copies of the
//!    same face are taken copy by copy, in file order; two edges of opposite direction that are
//!    alone in their connected part; faces around the edge that bound separate bodies, each pair
//!    with its inside between. What is left stays apart.
//! 4. A *slit* stays open: closed lips, eyelids. Topologically it is like the seam of a texture, a
//!    boundary loop that folds onto itself. A seam has a reason that the file shows: texture
//!    coordinates or normals differ across it, the loop lies on another loop (charts, faces of
//!    their own), a part of it lies on nothing (the seam reaches an open border), or it branches. A
//!    loop that folds wholly onto itself, as one path without branches, with equal corners on both
//!    sides, has no such reason and is a slit. Normals that differ count although those of closed
//!    lips do as well, each side's being made by itself: among files with normals and without
//!    texture coordinates, seams whose coordinates were dropped are commoner than lips, and a note
//!    tells what is joined.
//! 5. Vertices that lie apart in another layer stay apart: a morph target, or a second mesh of the
//!    same faces.
//! 6. Two faces back to back, with three common places, are two sheets and are not folded at their
//!    border. What would make an inner edge have more than two triangles, or a triangle have two
//!    equal corners, stays apart.
//!
//! 7. Where open edges run along one another and end at different places (T-junctions), the
//!    vertices on an edge become corners of its triangle, which is cut into pieces ([`Mesh`]). The
//!    numbers of the file stay, and what is written has its faces; vertices that are moved stay on
//!    the edges that they lie on.
//!
//! Positions are equal within rounding ([`ROUNDING`]), so that a point computed twice is one point.
//! Within a tolerance of the user's, edges that are still open are joined with the nearest one, if
//! each is the nearest of the other. The lowest vertex stands for those joined with it, at its own
//! position.

mod grouping;
#[cfg(test)]
mod junction_tests;
mod junctions;
mod pairing;
mod places;
mod sides;
#[cfg(test)]
mod tests;

use glam::DVec3;

use super::{Mesh, Topology};
use crate::{Error, Result};

/// Positions within this fraction of the mesh's diagonal are equal: far above what double precision
/// loses on the way through a few transformations (1e-15 each), far below what files tell apart
/// (single precision: 6e-8).
pub const ROUNDING: f64 = 1e-10;

/// What is joined.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Weld {
    /// Nothing: the surface is cut wherever the file repeats a vertex.
    No,
    /// Open edges that lie on one another, within rounding.
    #[default]
    Exact,
    /// Also open edges whose ends are within this distance, in units of the mesh.
    Within(f64),
}

/// What was joined, and what was not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Welded {
    /// Vertices that another one stands for.
    pub vertices: usize,
    /// Pairs of open edges that are one now.
    pub edges: usize,
    /// Pairs of open edges that lie on one another in the same direction; they stay apart.
    pub turned: usize,
    /// Open edges with more than one partner of which none is the right one; they stay apart.
    pub crowded: usize,
    /// Pairs of open edges in closed slits; they stay apart.
    pub slits: usize,
    /// Open edges on which others end; their triangles are cut there.
    pub junctions: usize,
    /// Those whose ends may not be joined; they stay apart.
    pub cracks: usize,
}

impl Welded {
    /// What deserves to be told, a sentence each.
    pub fn notes(&self) -> Vec<String> {
        let counted = |count: usize, one: &str, many: &str| format!("{count} {}", if count == 1 { one } else { many });
        let mut said = Vec::new();
        if self.vertices > 0 {
            said.push(format!(
                "{} of its vertices are repeated along {} and are joined for the computation; numbers stay those of \
                 the file (--weld no keeps them apart)",
                self.vertices,
                counted(self.edges, "edge", "edges")
            ));
        }
        if self.turned > 0 {
            said.push(format!(
                "{} on one another with faces oriented against each other and stay apart: orient the faces alike",
                counted(self.turned, "pair of open edges lies", "pairs of open edges lie")
            ));
        }
        if self.crowded > 0 {
            said.push(format!(
                "{} on several others and stay apart: the surface is cut there",
                counted(self.crowded, "open edge lies", "open edges lie")
            ));
        }
        if self.slits > 0 {
            said.push(format!(
                "a slit whose sides lie on one another stays open along {}, since nothing in the file differs across \
                 it: merge its vertices if the surface is connected there",
                counted(self.slits, "edge", "edges")
            ));
        }
        if self.junctions > 0 {
            said.push(format!(
                "{} along several shorter ones (T-junctions) and {} joined with them for the computation; faces stay \
                 those of the file",
                counted(self.junctions, "open edge runs", "open edges run"),
                if self.junctions == 1 { "is" } else { "are" }
            ));
        }
        if self.cracks > 0 {
            said.push(format!(
                "{} along several shorter ones (T-junctions) and stay apart: split the long edges at the corners on \
                 them",
                counted(self.cracks, "open edge runs", "open edges run")
            ));
        }
        said
    }
}

/// Joins the vertices of shapes of one connectivity alike: those that are one point in all of them.
/// The shapes with the polygons of the first take its triangles as well; others stay as they are.
///
/// # Errors
/// As [`weld`].
pub fn weld_alike(meshes: &mut [Mesh], rule: Weld) -> Result<()> {
    let Some((first, others)) = meshes.split_first_mut() else { return Ok(()) };
    let mut alike: Vec<&mut Mesh> = others.iter_mut().filter(|m| m.has_polygons_of(first)).collect();
    if alike.is_empty() {
        return Ok(());
    }
    let layers: Vec<&[DVec3]> = alike.iter().map(|m| &m.positions[..]).collect();
    weld(first, rule, &layers)?;
    alike.iter_mut().for_each(|m| m.connect_as(first));
    Ok(())
}

/// Joins the vertices of `mesh` that are one point of the surface (`Mesh::join`), by the rule of
/// this module, and cuts triangles at T-junctions.
///
/// `layers` are further positions of the same vertices, such as morph targets: vertices are joined
/// only if they are equal in all of them. An earlier join is replaced. O((V + F) log (V + F)) for
/// any valence.
///
/// # Errors
/// [`Error::Option`] for a tolerance that is negative, not finite, or longer than the mean edge;
/// [`Error::Mesh`] for a layer that does not have one position a vertex.
pub fn weld(mesh: &mut Mesh, weld: Weld, layers: &[&[DVec3]]) -> Result<Welded> {
    if let Some((k, layer)) = layers.iter().enumerate().find(|(_, l)| l.len() != mesh.vertex_count()) {
        let what = format!("layer {k} has {} positions for {} vertices", layer.len(), mesh.vertex_count());
        return Err(Error::mesh(&mesh.name, what, "Give one position a vertex in every layer"));
    }
    mesh.join((0..mesh.vertex_count() as u32).collect());
    let wide = match weld {
        Weld::No => return Ok(Welded::default()),
        Weld::Exact => None,
        Weld::Within(tolerance) => {
            let mean = mesh.mean_edge_length();
            if !(tolerance >= 0.0 && tolerance <= mean) {
                let what = format!("{tolerance} is not between 0 and the mean edge, {mean:.4}");
                return Err(Error::option("weld", what, "Give a distance shorter than the details of the mesh"));
            }
            Some(tolerance)
        }
    };
    let topology = Topology::new(mesh);
    if topology.boundary_edges < 2 {
        return Ok(Welded::default());
    }
    let sides = sides::open_sides(&topology);
    let all: Vec<&[DVec3]> = std::iter::once(&mesh.positions[..]).chain(layers.iter().copied()).collect();
    let place = places::places(&topology, &sides, &all);
    let mut found = pairing::pairs(mesh, &topology, &sides, &place);
    if let Some(tolerance) = wide {
        pairing::nearest(&sides, &all, tolerance, &mut found);
    }
    let size = mesh.bounds().map_or(0.0, |(low, high)| low.distance(high));
    let zips = junctions::zips(&sides, &found.alone(), &place, &all, size);
    let (pairs, slits) = sides::without_slits(mesh, &topology, &sides, found.pairs);
    let joins: Vec<sides::Pair> = zips.iter().flat_map(|zip| &zip.joins).copied().collect();
    let (representatives, edges) = grouping::representatives(&topology, &sides, &pairs, &joins);
    let closes = |zip: &&junctions::Zip| {
        let one = |a: u32, b: u32| representatives[a as usize] == representatives[b as usize];
        let corners = |t: u32| topology.triangles[t as usize];
        zip.joins.iter().all(|&(a, b)| one(a, b))
            && zip.cuts.iter().all(|cut| corners(cut.triangle).iter().all(|&c| !one(c, cut.vertex)))
    };
    let (closed, open): (Vec<_>, Vec<_>) = zips.iter().partition(closes);
    let count = |zips: &[&junctions::Zip]| zips.iter().map(|zip| zip.edges).sum();
    let mut welded = Welded { edges, turned: found.turned, crowded: found.crowded, slits, ..Welded::default() };
    (welded.junctions, welded.cracks) = (count(&closed), count(&open));
    welded.vertices = representatives.iter().enumerate().filter(|(v, r)| *v != **r as usize).count();
    let mut cuts: Vec<_> = closed.iter().flat_map(|zip| &zip.cuts).copied().collect();
    cuts.sort_by(|a, b| (a.triangle, a.corner).cmp(&(b.triangle, b.corner)).then(a.along.total_cmp(&b.along)));
    mesh.join(representatives);
    mesh.cut(&cuts);
    Ok(welded)
}
