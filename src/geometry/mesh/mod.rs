//! Polygon meshes as files hold them, seen as triangles.

mod arrays;
mod builder;
mod file;

use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;

use glam::{DVec2, DVec3};

pub use arrays::Texcoords;
pub use builder::MeshBuilder;

use super::material::Material;
use super::pieces::Pieces;
use crate::error::Result;

/// Marks a missing index (no texture coordinate, no neighbour).
pub const NONE: u32 = u32::MAX;

/// One corner of a polygon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Corner {
    /// 0-based vertex.
    pub vertex: u32,
    /// 0-based texture coordinate or [`NONE`].
    pub texcoord: u32,
    /// 0-based normal or [`NONE`].
    pub normal: u32,
}

/// A polygon mesh with texture coordinates, groups and materials in file order, and its triangles.
///
/// A vertex index is the position of its line in the file whatever is unused. A polygon of n
/// corners has n - 2 triangles: the fan from its first corner where that lies inside it, as it does
/// in every convex polygon, else triangles between its corners that do (`geometry::triangulate`).
/// Triangle indices count them polygon by polygon in file order, those of one polygon in the order
/// of their lowest, then middle, then highest corner, which is also the order in which a triangle
/// names its corners. Degenerate triangles keep their number, and moving vertices changes none.
/// Triangles that are cut at T-junctions ([`crate::geometry::weld`]) have pieces beyond the
/// triangles of the file ([`Mesh::file_triangle_count`]).
/// Positions are in the file's units and axes; texture row v = 1 is the top of the picture.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Where it came from; used in messages.
    pub name: String,
    /// Vertex positions.
    pub positions: Vec<DVec3>,
    /// Texture coordinates, referred to by corners.
    pub texcoords: Vec<DVec2>,
    /// Normals, referred to by corners.
    pub normals: Vec<DVec3>,
    /// Materials, referred to by polygons.
    pub materials: Vec<Material>,
    /// Group or object names, referred to by polygons.
    pub groups: Vec<String>,
    /// Colours of vertices, as viewers show them (sRGB), RGBA, 0..1; empty without. One for each
    /// vertex of the file.
    pub colors: Vec<[f32; 4]>,
    /// Names of groups and materials whose bytes in the file are not UTF-8, with those bytes.
    pub spellings: BTreeMap<String, Vec<u8>>,
    /// Material libraries that it was read with, in the order in which the file names them.
    #[doc(hidden)]
    pub libraries: Vec<PathBuf>,
    /// With vertices joined: every vertex is the one that stands for it.
    corners: Vec<Corner>,
    /// The vertex of each corner as the file has it; empty where no vertices are joined.
    file_vertices: Vec<u32>,
    /// The vertex that stands for each vertex; empty where no vertices are joined.
    representatives: Vec<u32>,
    /// First corner of each polygon, and the number of corners at the end.
    polygon_start: Vec<u32>,
    polygon_material: Vec<u32>,
    polygon_group: Vec<u32>,
    polygon_object: Vec<u32>,
    polygon_smoothing: Vec<u32>,
    /// Corner indices of each triangle.
    triangles: Vec<[u32; 3]>,
    triangle_polygon: Vec<u32>,
    /// Triangles that are cut; their further corners come after those of the polygons.
    pieces: Pieces,
}

/// A builder that has triangles without texture coordinates.
fn builder_of(name: impl Into<String>, positions: Vec<DVec3>, triangles: &[[u32; 3]]) -> MeshBuilder {
    let mut builder = MeshBuilder::new(name);
    builder.mesh.positions = positions;
    for t in triangles {
        builder.polygon(t.iter().map(|&vertex| Corner { vertex, texcoord: NONE, normal: NONE }));
    }
    builder
}

impl Mesh {
    /// A mesh of triangles with no texture coordinates.
    ///
    /// # Errors
    /// [`Error::Mesh`](crate::Error::Mesh) naming the face and corner whose vertex does not exist.
    pub fn from_triangles(name: impl Into<String>, positions: Vec<DVec3>, triangles: &[[u32; 3]]) -> Result<Self> {
        builder_of(name, positions, triangles).build()
    }

    /// As [`Mesh::from_triangles`], for triangles that are right by construction.
    pub(crate) fn of_triangles(name: impl Into<String>, positions: Vec<DVec3>, triangles: &[[u32; 3]]) -> Self {
        builder_of(name, positions, triangles).finish()
    }

    /// Gives all polygons one material, in place of those that they have.
    pub fn set_material(&mut self, material: Material) {
        self.materials = vec![material];
        self.polygon_material.fill(0);
    }

    /// Number of vertices, used or not.
    pub fn vertex_count(&self) -> usize {
        self.positions.len()
    }

    /// Number of triangles, degenerate ones included, and the pieces of those that are cut.
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// Number of triangles of the file, degenerate ones included; they come first.
    pub fn file_triangle_count(&self) -> usize {
        self.triangles.len() - self.pieces.beyond()
    }

    /// Number of polygons.
    pub fn polygon_count(&self) -> usize {
        self.polygon_start.len().saturating_sub(1)
    }

    /// The corners of polygon `p`.
    pub fn polygon(&self, p: usize) -> &[Corner] {
        &self.corners[self.polygon_start[p] as usize..self.polygon_start[p + 1] as usize]
    }

    /// Material of polygon `p`, or [`NONE`].
    pub fn polygon_material(&self, p: usize) -> u32 {
        self.polygon_material[p]
    }

    /// Group of polygon `p`, or [`NONE`]: the last group or object that the file names before it.
    pub fn polygon_group(&self, p: usize) -> u32 {
        self.polygon_group[p]
    }

    /// Object of polygon `p` among the groups, or [`NONE`].
    pub fn polygon_object(&self, p: usize) -> u32 {
        self.polygon_object[p]
    }

    /// Smoothing group of polygon `p`: 0 for none, [`NONE`] where the file says nothing.
    pub fn polygon_smoothing(&self, p: usize) -> u32 {
        self.polygon_smoothing[p]
    }

    /// The polygon that triangle `t` is part of.
    pub fn triangle_polygon(&self, t: usize) -> u32 {
        self.triangle_polygon[t]
    }

    /// Material of triangle `t`, or [`NONE`].
    pub fn triangle_material(&self, t: usize) -> u32 {
        self.polygon_material[self.triangle_polygon[t] as usize]
    }

    /// The three corners of triangle `t`.
    pub fn triangle_corners(&self, t: usize) -> [Corner; 3] {
        self.triangles[t].map(|c| self.corners[c as usize])
    }

    /// The three vertices of triangle `t`.
    pub fn triangle(&self, t: usize) -> [u32; 3] {
        self.triangles[t].map(|c| self.corners[c as usize].vertex)
    }

    /// Where the three corners of triangle `t` of the file stand in its polygon, ascending.
    pub fn triangle_places(&self, t: usize) -> [usize; 3] {
        let first = self.polygon_start[self.triangle_polygon[t] as usize];
        self.whole_triangle(t).map(|c| (c - first) as usize)
    }

    /// The corners of triangle `t` of the file, cut or not.
    fn whole_triangle(&self, t: usize) -> [u32; 3] {
        self.pieces.whole(t as u32).unwrap_or(self.triangles[t])
    }

    /// The vertices of all triangles.
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        (0..self.triangle_count()).map(|t| self.triangle(t)).collect()
    }

    /// Positions of the three corners of triangle `t`.
    pub fn triangle_positions(&self, t: usize) -> [DVec3; 3] {
        self.triangle(t).map(|v| self.positions[v as usize])
    }

    /// Texture coordinates of the corners of triangle `t`, if all three have one.
    pub fn triangle_texcoords(&self, t: usize) -> Option<[DVec2; 3]> {
        let c = self.triangle_corners(t);
        c.iter().all(|c| c.texcoord != NONE).then(|| c.map(|c| self.texcoords[c.texcoord as usize]))
    }

    /// Replaces the texture coordinates by what `new` makes of them for the polygons that use them.
    /// Those that were one stay one as far as they stay equal. O(corners).
    pub fn map_texcoords(&mut self, new: impl Fn(usize, DVec2) -> DVec2) {
        let old = std::mem::take(&mut self.texcoords);
        let mut known: HashMap<(u32, [u64; 2]), u32> = HashMap::new();
        for p in 0..self.polygon_count() {
            for c in self.polygon_start[p]..self.polygon_start[p + 1] {
                let corner = &mut self.corners[c as usize];
                let Some(&uv) = old.get(corner.texcoord as usize) else { continue };
                let placed = new(p, uv);
                let key = (corner.texcoord, placed.to_array().map(f64::to_bits));
                corner.texcoord = *known.entry(key).or_insert_with(|| {
                    self.texcoords.push(placed);
                    self.texcoords.len() as u32 - 1
                });
            }
        }
        self.pieces.texcoords = 0;
        self.renew_further_corners();
    }

    /// Whether some triangle has texture coordinates.
    pub fn has_texcoords(&self) -> bool {
        self.corners.iter().any(|c| c.texcoord != NONE)
    }

    /// Area-weighted normal of triangle `t`: its length is twice the area, counter-clockwise is
    /// outside.
    pub fn triangle_area_normal(&self, t: usize) -> DVec3 {
        let [a, b, c] = self.triangle_positions(t);
        (b - a).cross(c - a)
    }

    /// Area of triangle `t`.
    pub fn triangle_area(&self, t: usize) -> f64 {
        0.5 * self.triangle_area_normal(t).length()
    }

    /// Area of all triangles.
    pub fn area(&self) -> f64 {
        (0..self.triangle_count()).map(|t| self.triangle_area(t)).sum()
    }

    /// Mean length of the triangles' edges (inner edges count once per triangle); 0 without
    /// triangles.
    pub fn mean_edge_length(&self) -> f64 {
        let n = self.triangle_count();
        if n == 0 {
            return 0.0;
        }
        let sum: f64 = (0..n)
            .map(|t| {
                let [a, b, c] = self.triangle_positions(t);
                a.distance(b) + b.distance(c) + c.distance(a)
            })
            .sum();
        sum / (3 * n) as f64
    }

    /// The same mesh with what `change` makes of the texture coordinate and normal of each corner;
    /// the vertices stay.
    pub fn with_corners(&self, mut change: impl FnMut(Corner) -> Corner) -> Self {
        let mut mesh = self.clone();
        let corners = mesh.polygon_corners();
        for corner in &mut mesh.corners[..corners] {
            *corner = Corner { vertex: corner.vertex, ..change(*corner) };
        }
        mesh.renew_further_corners();
        mesh
    }

    /// Smallest and largest coordinates of the used vertices; `None` without any.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        self.corners[..self.polygon_corners()].iter().map(|c| self.positions[c.vertex as usize]).fold(None, |b, p| {
            match b {
                None => Some((p, p)),
                Some((lo, hi)) => Some((lo.min(p), hi.max(p))),
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of two triangles, each with its own three vertices.
    fn halves() -> Mesh {
        let p = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let positions = p.map(|[x, y]| DVec3::new(x, y, 0.0)).to_vec();
        Mesh::of_triangles("halves", positions, &[[0, 1, 2], [3, 4, 5]])
    }

    #[test]
    fn joined_vertices_are_one_in_triangles_and_two_in_the_file() {
        let mut mesh = halves();
        mesh.join(vec![0, 1, 2, 0, 2, 5]);
        assert_eq!(mesh.triangles(), [[0, 1, 2], [0, 2, 5]]);
        assert_eq!(mesh.file_polygon(1).map(|c| c.vertex).collect::<Vec<_>>(), [3, 4, 5]);
        assert_eq!(mesh.file_triangle_corners(1).map(|c| c.vertex), [3, 4, 5]);
        assert_eq!((mesh.representative(4), mesh.representative(5)), (2, 5));
        let mut values = [10, 11, 12, 13, 14, 15];
        mesh.spread(&mut values);
        assert_eq!(values, [10, 11, 12, 10, 12, 15]);
        // Joining anew starts from the file.
        mesh.join(vec![0, 1, 2, 3, 4, 5]);
        assert_eq!(mesh.triangles(), [[0, 1, 2], [3, 4, 5]]);
        assert!(!mesh.has_joined_vertices());
    }

    #[test]
    fn a_mesh_that_is_built_on_keeps_its_numbers() {
        let mut mesh = halves();
        mesh.join(vec![0, 1, 2, 0, 2, 5]);
        let mut builder = MeshBuilder::onto(mesh.clone());
        builder.mesh.positions.push(DVec3::Z);
        builder.polygon([3, 4, 6].map(|vertex| Corner { vertex, texcoord: NONE, normal: NONE }));
        let more = builder.finish();
        assert_eq!(more.triangles(), [[0, 1, 2], [0, 2, 5], [0, 2, 6]]);
        assert_eq!(more.file_triangle_corners(2).map(|c| c.vertex), [3, 4, 6]);
        let moved: Vec<DVec3> = mesh.positions.iter().map(|p| *p * 2.0).collect();
        let mut spread = moved.clone();
        (spread[3], spread[4]) = (DVec3::ONE, DVec3::ONE);
        mesh.spread_positions(&mut spread, |_| false);
        assert_eq!(spread, moved);
    }

    #[test]
    fn polygons_are_triangulated_inside_and_moving_changes_no_number() {
        let mut builder = MeshBuilder::new("l");
        let l = [[2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0], [0.0, 0.0]];
        builder.mesh.positions = l.map(|[x, y]| DVec3::new(x, y, 0.0)).to_vec();
        let corner = |vertex| Corner { vertex, texcoord: NONE, normal: NONE };
        builder.polygon([0, 1, 2].map(corner));
        builder.polygon([0, 1].map(corner));
        builder.polygon([0, 1, 2, 3, 4, 5].map(corner));
        assert!(builder.has_faces());
        let mut mesh = builder.finish();
        assert_eq!((mesh.triangle_count(), mesh.triangle_polygon(1)), (5, 2));
        assert!((mesh.area() - 3.5).abs() < 1e-15);
        for t in 1..5 {
            assert_eq!(mesh.triangle_places(t).map(|k| k as u32), mesh.triangle(t));
        }
        let triangles = mesh.triangles();
        mesh.positions[2] = DVec3::new(3.0, 3.0, 0.0);
        assert_eq!(mesh.with_corners(|c| c).triangles(), triangles);
    }

    #[test]
    #[should_panic(expected = "represented")]
    fn chains_of_representatives_are_refused() {
        halves().join(vec![0, 0, 1, 3, 4, 5]);
    }
}
