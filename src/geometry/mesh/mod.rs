//! Polygon meshes as files hold them, seen as triangles.

use std::collections::{BTreeMap, HashMap};

use glam::{DVec2, DVec3};

use super::material::Material;
use super::triangulate::triangulate;

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
}

impl Mesh {
    /// A mesh of triangles with no texture coordinates.
    pub fn from_triangles(name: impl Into<String>, positions: Vec<DVec3>, triangles: &[[u32; 3]]) -> Self {
        let mut builder = MeshBuilder::new(name);
        builder.mesh.positions = positions;
        for t in triangles {
            builder.polygon(t.iter().map(|&vertex| Corner { vertex, texcoord: NONE, normal: NONE }));
        }
        builder.build()
    }

    /// Number of vertices, used or not.
    pub fn vertex_count(&self) -> usize {
        self.positions.len()
    }

    /// Number of triangles, degenerate ones included.
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
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

    /// Where the three corners of triangle `t` stand in its polygon, ascending.
    pub fn triangle_places(&self, t: usize) -> [usize; 3] {
        let first = self.polygon_start[self.triangle_polygon[t] as usize];
        self.triangles[t].map(|c| (c - first) as usize)
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

    /// Joins vertices: `representatives[v]` stands for `v` in everything that is computed.
    ///
    /// Files repeat a vertex where texture coordinates or normals differ, or for every face. The
    /// surface is one there. Vertices keep their numbers and positions. Corners, and so triangles
    /// and topology, name the representative. What it stands for becomes a vertex of no triangle,
    /// and [`Mesh::file_polygon`] still gives the corners of the file. A second call replaces the
    /// first. O(corners).
    ///
    /// # Panics
    /// If the length differs from the number of vertices, a representative comes after a vertex
    /// that it stands for, or does not stand for itself.
    pub fn join(&mut self, representatives: Vec<u32>) {
        assert_eq!(representatives.len(), self.positions.len(), "one representative a vertex");
        for (v, &r) in representatives.iter().enumerate() {
            assert!(r as usize <= v && representatives[r as usize] == r, "vertex {v} is represented by {r}");
        }
        if self.file_vertices.is_empty() {
            self.file_vertices = self.corners.iter().map(|c| c.vertex).collect();
        }
        for (corner, &v) in self.corners.iter_mut().zip(&self.file_vertices) {
            corner.vertex = representatives[v as usize];
        }
        self.representatives = representatives;
        if !self.has_joined_vertices() {
            (self.file_vertices, self.representatives) = (Vec::new(), Vec::new());
        }
    }

    /// Joins vertices as they are joined in `other`, which has the same vertices.
    ///
    /// # Panics
    /// If the numbers of vertices differ.
    pub fn join_as(&mut self, other: &Self) {
        assert_eq!(self.vertex_count(), other.vertex_count(), "the same vertices");
        self.join((0..self.vertex_count() as u32).map(|v| other.representative(v)).collect());
    }

    /// Whether the polygons name the same vertices of their files, in the same order.
    pub fn has_polygons_of(&self, other: &Self) -> bool {
        let vertices = |m: &Self, p: usize| m.file_polygon(p).map(|c| c.vertex).collect::<Vec<_>>();
        self.vertex_count() == other.vertex_count()
            && self.polygon_start == other.polygon_start
            && (0..self.polygon_count()).all(|p| vertices(self, p) == vertices(other, p))
    }

    /// Takes the triangles and the joined vertices of `other`, which has the same polygons: the
    /// numbers of a triangulation depend on positions, and shapes of one connectivity need one.
    ///
    /// # Panics
    /// If the numbers of vertices or corners differ.
    pub fn connect_as(&mut self, other: &Self) {
        assert_eq!(self.corners.len(), other.corners.len(), "the same polygons");
        self.triangles.clone_from(&other.triangles);
        self.triangle_polygon.clone_from(&other.triangle_polygon);
        self.join_as(other);
    }

    /// The same mesh with what `change` makes of the texture coordinate and normal of each corner;
    /// the vertices stay.
    pub fn with_corners(&self, mut change: impl FnMut(Corner) -> Corner) -> Self {
        let mut mesh = self.clone();
        for corner in &mut mesh.corners {
            *corner = Corner { vertex: corner.vertex, ..change(*corner) };
        }
        mesh
    }

    /// Whether a vertex stands for another one.
    pub fn has_joined_vertices(&self) -> bool {
        self.representatives.iter().enumerate().any(|(v, &r)| v != r as usize)
    }

    /// The vertex that stands for `v` in everything that is computed: the lowest of those joined
    /// with it, or `v` itself.
    pub fn representative(&self, v: u32) -> u32 {
        self.representatives.get(v as usize).copied().unwrap_or(v)
    }

    /// Whether `v` is repeated by the file: another vertex stands for it.
    pub fn is_repeated(&self, v: u32) -> bool {
        self.representative(v) != v
    }

    /// Moves every joined vertex as its representative was moved from `self` to `positions`.
    pub fn spread_positions(&self, positions: &mut [DVec3]) {
        for v in 0..self.representatives.len().min(positions.len()) {
            let r = self.representatives[v] as usize;
            if r != v {
                // Exactly the same place where they lie on one another.
                positions[v] = positions[r] + (self.positions[v] - self.positions[r]);
            }
        }
    }

    /// As [`Mesh::spread`], for rows of `columns` values.
    pub fn spread_rows<T: Copy>(&self, columns: usize, values: &mut [T]) {
        for v in 0..self.representatives.len().min(values.len() / columns.max(1)) {
            let r = self.representatives[v] as usize;
            if r != v {
                values.copy_within(r * columns..(r + 1) * columns, v * columns);
            }
        }
    }

    /// Gives every joined vertex what its representative has. `values` holds one entry a vertex.
    pub fn spread<T: Clone>(&self, values: &mut [T]) {
        for v in 0..self.representatives.len().min(values.len()) {
            let r = self.representatives[v] as usize;
            if r != v {
                values[v] = values[r].clone();
            }
        }
    }

    /// The corners of polygon `p` with the vertices of the file, joined or not: what a writer
    /// needs.
    pub fn file_polygon(&self, p: usize) -> impl ExactSizeIterator<Item = Corner> + '_ {
        let range = self.polygon_start[p] as usize..self.polygon_start[p + 1] as usize;
        range.map(|c| {
            let vertex = self.file_vertices.get(c).copied().unwrap_or(self.corners[c].vertex);
            Corner { vertex, ..self.corners[c] }
        })
    }

    /// The three corners of triangle `t` with the vertices of the file, joined or not.
    pub fn file_triangle_corners(&self, t: usize) -> [Corner; 3] {
        self.triangles[t].map(|c| {
            let corner = self.corners[c as usize];
            Corner { vertex: self.file_vertices.get(c as usize).copied().unwrap_or(corner.vertex), ..corner }
        })
    }

    /// Smallest and largest coordinates of the used vertices; `None` without any.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        self.corners.iter().map(|c| self.positions[c.vertex as usize]).fold(None, |b, p| match b {
            None => Some((p, p)),
            Some((lo, hi)) => Some((lo.min(p), hi.max(p))),
        })
    }
}

/// Builds a [`Mesh`] polygon by polygon.
///
/// Indices are not checked here: a reader checks them where it knows the line (`io`), and
/// [`MeshBuilder::build`] panics on an index out of range, which is a bug of the reader.
#[derive(Debug, Default)]
pub struct MeshBuilder {
    /// Positions, texture coordinates, normals, materials and groups are filled in directly.
    pub mesh: Mesh,
    /// Material of the polygons that follow, or [`NONE`].
    pub material: u32,
    /// Group of the polygons that follow, or [`NONE`].
    pub group: u32,
    /// Object of the polygons that follow, an index of the groups, or [`NONE`].
    pub object: u32,
    /// Smoothing group of the polygons that follow, 0 for none, or [`NONE`].
    pub smoothing: u32,
    /// Polygons that have their triangles.
    triangulated: usize,
    /// Joined vertices of a mesh that is built on.
    joined: Vec<u32>,
}

impl MeshBuilder {
    /// An empty mesh.
    pub fn new(name: impl Into<String>) -> Self {
        Self::of(Mesh { name: name.into(), polygon_start: vec![0], ..Mesh::default() })
    }

    fn of(mesh: Mesh) -> Self {
        let (material, group, object, smoothing) = (NONE, NONE, NONE, NONE);
        Self { mesh, material, group, object, smoothing, triangulated: 0, joined: Vec::new() }
    }

    /// An empty mesh with the name, materials and groups of another.
    pub fn like(mesh: &Mesh) -> Self {
        let mut builder = Self::new(mesh.name.clone());
        builder.mesh.materials.clone_from(&mesh.materials);
        builder.mesh.groups.clone_from(&mesh.groups);
        builder.mesh.spellings.clone_from(&mesh.spellings);
        builder
    }

    /// Gives the polygons that follow what polygon `p` of another mesh has: material, group, object
    /// and smoothing.
    pub fn follow(&mut self, mesh: &Mesh, p: usize) {
        (self.material, self.group) = (mesh.polygon_material(p), mesh.polygon_group(p));
        (self.object, self.smoothing) = (mesh.polygon_object(p), mesh.polygon_smoothing(p));
    }

    /// Replaces the material of every polygon that has one.
    pub fn map_materials(&mut self, new: impl Fn(u32) -> u32) {
        self.mesh.polygon_material.iter_mut().filter(|m| **m != NONE).for_each(|m| *m = new(*m));
    }

    /// Adds to a mesh, whose numbers, triangles and joined vertices stay.
    pub fn onto(mut mesh: Mesh) -> Self {
        let joined = mesh.representatives.clone();
        mesh.join((0..mesh.vertex_count() as u32).collect());
        Self { triangulated: mesh.polygon_count(), joined, ..Self::of(mesh) }
    }

    /// Appends a polygon. Fewer than three corners make a polygon without triangles.
    pub fn polygon(&mut self, corners: impl IntoIterator<Item = Corner>) {
        let m = &mut self.mesh;
        m.corners.extend(corners);
        m.polygon_start.push(m.corners.len() as u32);
        m.polygon_material.push(self.material);
        m.polygon_group.push(self.group);
        m.polygon_object.push(self.object);
        m.polygon_smoothing.push(self.smoothing);
    }

    /// Whether some polygon has three corners or more.
    pub fn has_faces(&self) -> bool {
        self.mesh.polygon_start.windows(2).any(|w| w[1] - w[0] > 2)
    }

    /// All corners so far, for readers that can check an index only at the end of the file.
    pub fn corners_mut(&mut self) -> &mut [Corner] {
        &mut self.mesh.corners
    }

    /// The finished mesh, with its triangles. O(corners log corners) at worst.
    ///
    /// # Panics
    /// If a corner, material or group index is out of range.
    pub fn build(self) -> Mesh {
        let mut m = self.mesh;
        let ok = |i: u32, n: usize| i == NONE || (i as usize) < n;
        for c in &m.corners {
            assert!((c.vertex as usize) < m.positions.len(), "vertex {} of {}", c.vertex, m.positions.len());
            assert!(
                ok(c.texcoord, m.texcoords.len()) && ok(c.normal, m.normals.len()),
                "corner attribute out of range"
            );
        }
        assert!(m.polygon_material.iter().all(|&i| ok(i, m.materials.len())), "material out of range");
        let groups = m.polygon_group.iter().chain(&m.polygon_object);
        assert!(groups.into_iter().all(|&i| ok(i, m.groups.len())), "group out of range");
        for p in self.triangulated..m.polygon_count() {
            let first = m.polygon_start[p];
            let positions: Vec<DVec3> = m.polygon(p).iter().map(|c| m.positions[c.vertex as usize]).collect();
            let triangles = if positions.len() < 3 { Vec::new() } else { triangulate(&positions) };
            m.triangle_polygon.extend(triangles.iter().map(|_| p as u32));
            m.triangles.extend(triangles.into_iter().map(|t| t.map(|k| first + k)));
        }
        if !self.joined.is_empty() {
            let mut joined = self.joined;
            joined.extend(joined.len() as u32..m.vertex_count() as u32);
            m.join(joined);
        }
        m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of two triangles, each with its own three vertices.
    fn halves() -> Mesh {
        let p = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let positions = p.map(|[x, y]| DVec3::new(x, y, 0.0)).to_vec();
        Mesh::from_triangles("halves", positions, &[[0, 1, 2], [3, 4, 5]])
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
        let more = builder.build();
        assert_eq!(more.triangles(), [[0, 1, 2], [0, 2, 5], [0, 2, 6]]);
        assert_eq!(more.file_triangle_corners(2).map(|c| c.vertex), [3, 4, 6]);
        let moved: Vec<DVec3> = mesh.positions.iter().map(|p| *p * 2.0).collect();
        let mut spread = moved.clone();
        (spread[3], spread[4]) = (DVec3::ONE, DVec3::ONE);
        mesh.spread_positions(&mut spread);
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
        let mut mesh = builder.build();
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
