//! Decals: a picture laid onto a part of a surface by a few anchors, and the texture coordinates
//! that do it.
//!
//! Anchors pair points of the surface with points of the picture's unit square. Between them the
//! surface gets texture coordinates ([`decal`]), by weighted averages of the anchors' own (Panozzo
//! et al. 2013, sections 3.4 and 4.2, Fig. 10) or by a plate that bends as little as it can. What
//! of the surface shows the picture is drawn into its texture by the stages of [`super::transfer`]
//! ([`paint`]), or taken as it is ([`with_texcoords`]).

mod anchors;
mod composite;
mod domain;
mod paint;
mod patch;
mod plate;
mod unfold;

use glam::{DVec2, DVec3};

pub use anchors::DecalAnchors;
pub use composite::composite;
pub use paint::{PaintOptions, Painted, paint};
pub use unfold::paint_placed;

use crate::error::{Error, Result};
use crate::geometry::{Corner, Mesh, MeshBuilder, NONE, SurfacePoint, Topology};
use crate::progress::Progress;
use crate::surface::correspondence::Shape;
use crate::surface::quality::distortion;
use crate::surface::single::WeightedPoints;
use crate::surface::{Embedding, EmbeddingOptions};
use crate::words::words;
use domain::Domain;
use patch::Patch;

/// How texture coordinates spread from the anchors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Layout {
    /// A thin plate on the surface through the anchors: exact on flat and developable surfaces,
    /// needs no embedding.
    #[default]
    Plate,
    /// The paper's: weights of each point with respect to the anchors (eq. 13), applied to their
    /// texture coordinates. The part around the anchors is embedded by itself, which distorts it
    /// less than an embedding of the whole surface.
    Averages,
}

words! { Layout, "layout", "a layout":
    Plate => "plate" "A thin plate on the surface that bends as little as it can",
    Averages => "averages" "Weighted averages of the anchors, as in the paper",
}

/// Landmarks of the embedding of a part.
const LANDMARKS: usize = 300;

/// Texture coordinates of a part of a surface.
#[derive(Clone, Debug)]
pub struct Decal {
    /// For each vertex near the anchors, its place in the picture's unit square or outside; `None`
    /// for the others.
    pub uv: Vec<Option<DVec2>>,
    /// The triangles that show a part of the picture and are connected with the anchors, ascending.
    pub patch: Vec<u32>,
    /// What can be said of it.
    pub report: DecalReport,
}

/// What can be said of a decal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DecalReport {
    /// Area of the patch in parts of the surface's.
    pub area: f64,
    /// Symmetrised L2 stretch efficiency of the patch, with the picture's proportions
    /// ([`distortion`]): 1 for an isometry.
    pub stretch_all: f64,
    /// The same over the best 95 % of the area.
    pub stretch_best95: f64,
    /// Triangles of the patch that are turned over in the picture.
    pub flipped_faces: usize,
    /// Their share of its area.
    pub flipped_area: f64,
    /// Whether the picture appears as in a mirror, seen from outside.
    pub mirrored: bool,
    /// Share of the picture that is shown.
    pub shown: f64,
    /// Share of the picture that is shown more than once.
    pub shown_twice: f64,
    /// Largest distance, in the unit square, of an anchor from where it should be.
    pub anchor_error: f64,
}

/// Lays a picture of proportion `aspect` (width over height) onto a surface by anchors.
///
/// Coordinates are found at the vertices near the anchors; the patch is what lies inside the unit
/// square, is connected with the anchors over edges and is not turned over. O(n log n) in the
/// number of vertices, and the sparse factorisation of those near the anchors for the plate.
///
/// # Errors
/// Those of [`DecalAnchors::check`]; [`Error::Input`] if the anchors' order folds the picture;
/// [`Error::Option`] for an aspect that is not positive; those of the factorisation.
pub fn decal(
    mesh: &Mesh,
    topology: &Topology,
    anchors: &DecalAnchors,
    layout: Layout,
    aspect: f64,
    progress: &dyn Progress,
) -> Result<Decal> {
    if !(aspect > 0.0) || !aspect.is_finite() {
        return Err(Error::option("aspect", format!("{aspect}"), "Give the picture's width over its height"));
    }
    anchors.check(mesh, topology)?;
    let corners: Vec<u32> =
        anchors.points.iter().map(|p| mesh.triangle(p.face as usize)[p.dominant_corner()]).collect();
    let domain = Domain::new(mesh, topology, anchors, &corners)?;
    let found = match layout {
        Layout::Plate => {
            let tie =
                |p: &SurfacePoint| (mesh.triangle(p.face as usize).map(|v| domain.number[v as usize]), p.barycentric);
            let ties: Vec<_> = anchors.points.iter().map(tie).collect();
            plate::plate(&domain.positions, &domain.triangles, &ties, &anchors.uv)?
        }
        Layout::Averages => averages(&domain, anchors, progress)?,
    };
    if found.iter().any(|q| !q.is_finite()) {
        return Err(Error::numeric("the decal's coordinates are not finite", "Move the anchors apart"));
    }
    let mut uv = vec![None; mesh.vertex_count()];
    for (&v, &q) in domain.vertices.iter().zip(&found) {
        uv[v as usize] = Some(q);
    }
    let patch = Patch::new(mesh, topology, &domain, &uv, anchors, &corners)?;
    let anchor_error = anchors
        .points
        .iter()
        .zip(&anchors.uv)
        .map(|(p, wanted)| {
            let v = mesh.triangle(p.face as usize);
            let at: DVec2 = (0..3).filter_map(|k| Some(uv[v[k] as usize]? * p.barycentric[k])).sum();
            at.distance(*wanted)
        })
        .fold(0.0, f64::max);
    let report = measure(mesh, &patch, &uv, aspect, anchor_error);
    Ok(Decal { uv, patch: patch.triangles, report })
}

/// The coordinates of the domain's vertices by weighted averages in its own embedding.
fn averages(domain: &Domain, anchors: &DecalAnchors, progress: &dyn Progress) -> Result<Vec<DVec2>> {
    let part = Mesh::of_triangles("the part around the anchors", domain.positions.clone(), &domain.triangles);
    let topology = Topology::new(&part);
    let options = EmbeddingOptions { landmarks: LANDMARKS, ..EmbeddingOptions::default() };
    let embedding = Embedding::compute(&part, &topology, &options, progress)?;
    let place = |p: &SurfacePoint| SurfacePoint::new(domain.face(p.face), p.barycentric);
    let points: Vec<SurfacePoint> = anchors.points.iter().map(place).collect();
    let shape = Shape { mesh: &part, topology: &topology, embedding: Some(&embedding) };
    let vertices: Vec<SurfacePoint> =
        (0..part.vertex_count() as u32).filter_map(|v| topology.vertex_point(v)).collect();
    if vertices.len() < part.vertex_count() {
        return Err(Error::mesh(
            "the part around the anchors",
            "a triangle is too small",
            "Remove degenerate triangles",
        ));
    }
    let weights = WeightedPoints::new(shape, &points)?.weights(&vertices)?;
    let average = |row: &[f64]| row.iter().zip(&anchors.uv).map(|(w, uv)| *uv * *w).sum();
    Ok(weights.chunks_exact(anchors.uv.len()).map(average).collect())
}

/// Stretch and flips of the patch as a surface of its own.
fn measure(mesh: &Mesh, patch: &Patch, uv: &[Option<DVec2>], aspect: f64, anchor_error: f64) -> DecalReport {
    let (part, vertices) = part_of(mesh, &patch.triangles);
    let flat: Vec<Option<DVec3>> =
        vertices.iter().map(|&v| uv[v as usize].map(|q| DVec3::new(q.x * aspect, q.y, 0.0))).collect();
    let up = vec![DVec3::Z; vertices.len()];
    let image: f64 = patch.triangles.iter().map(|&t| patch::signed_area(mesh, uv, t).abs() * aspect).sum();
    let d = distortion(&part, &Topology::new(&part), &flat, &up, image);
    let (shown, shown_twice) = patch::shown(mesh, &patch.triangles, uv);
    DecalReport {
        area: part.area() / mesh.area(),
        stretch_all: d.stretch_all,
        stretch_best95: d.stretch_best95,
        flipped_faces: d.flipped_faces,
        flipped_area: d.flipped_area,
        mirrored: patch.mirrored,
        shown,
        shown_twice,
        anchor_error,
    }
}

/// Triangles of a mesh as one of their own, and its vertices' numbers in the whole.
fn part_of(mesh: &Mesh, triangles: &[u32]) -> (Mesh, Vec<u32>) {
    let mut vertices: Vec<u32> = triangles.iter().flat_map(|&t| mesh.triangle(t as usize)).collect();
    vertices.sort_unstable();
    vertices.dedup();
    let number = |v: u32| vertices.partition_point(|&w| w < v) as u32;
    let positions = vertices.iter().map(|&v| mesh.positions[v as usize]).collect();
    let renumbered: Vec<[u32; 3]> = triangles.iter().map(|&t| mesh.triangle(t as usize).map(number)).collect();
    (Mesh::of_triangles(mesh.name.clone(), positions, &renumbered), vertices)
}

/// The mesh with the decal's coordinates as its texture coordinates. Polygons that show none of the
/// picture have none; with `only_patch` they are left out, with the vertices that only they use.
pub fn with_texcoords(mesh: &Mesh, decal: &Decal, only_patch: bool) -> Mesh {
    let mut shows = vec![false; mesh.polygon_count()];
    for &t in &decal.patch {
        shows[mesh.triangle_polygon(t as usize) as usize] = true;
    }
    // The corners of a polygon that is only partly near the anchors may be without coordinates.
    for (p, shows) in shows.iter_mut().enumerate() {
        *shows = *shows && mesh.polygon(p).iter().all(|c| decal.uv[c.vertex as usize].is_some());
    }
    // Joined vertices are apart again in what is written, with one coordinate.
    let mut used = vec![false; mesh.vertex_count()];
    for p in (0..mesh.polygon_count()).filter(|&p| shows[p]) {
        mesh.file_polygon(p)
            .zip(mesh.polygon(p))
            .flat_map(|(a, b)| [a.vertex, b.vertex])
            .for_each(|v| used[v as usize] = true);
    }
    let mut builder = MeshBuilder::like(mesh);
    // The picture is the decal's, whatever the materials show.
    builder.mesh.materials.clear();
    let (mut place, mut coordinate) = (vec![NONE; mesh.vertex_count()], vec![NONE; mesh.vertex_count()]);
    for v in 0..mesh.vertex_count() {
        if used[v] || !only_patch {
            place[v] = builder.mesh.positions.len() as u32;
            builder.mesh.positions.push(mesh.positions[v]);
        }
        if let (true, Some(uv)) = (used[v], decal.uv[v]) {
            coordinate[v] = builder.mesh.texcoords.len() as u32;
            builder.mesh.texcoords.push(uv);
        }
    }
    builder.mesh.normals = mesh.file_normals().to_vec();
    for p in (0..mesh.polygon_count()).filter(|&p| shows[p] || !only_patch) {
        builder.follow(mesh, p);
        builder.material = NONE;
        builder.polygon(mesh.file_polygon(p).zip(mesh.polygon(p)).map(|(c, joined)| Corner {
            vertex: place[c.vertex as usize],
            texcoord: if shows[p] { coordinate[joined.vertex as usize] } else { NONE },
            normal: c.normal,
        }));
    }
    let mut made = builder.finish();
    if !only_patch {
        made.join_as(mesh);
    }
    made
}

#[cfg(test)]
mod tests;
