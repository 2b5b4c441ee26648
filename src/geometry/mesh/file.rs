//! A mesh as it is computed with, and as its file has it: vertices that are joined, triangles that
//! are cut.

use std::collections::BTreeSet;

use glam::{DVec2, DVec3};

use super::{Corner, Mesh, NONE};
use crate::geometry::SurfacePoint;
use crate::geometry::pieces::{OnEdge, Pieces};

impl Mesh {
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
    pub(crate) fn join(&mut self, representatives: Vec<u32>) {
        assert_eq!(representatives.len(), self.positions.len(), "one representative a vertex");
        self.mend();
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

    /// Cuts triangles at vertices that lie on their edges, sorted by triangle, corner and place
    /// along the edge, so that what lies beyond each part of an edge is its neighbour. The
    /// triangles keep their numbers, which their first pieces have. [`Mesh::join`] takes the cuts
    /// back. O(pieces).
    pub(crate) fn cut(&mut self, vertices: &[OnEdge]) {
        self.mend();
        let first = self.corners.len() as u32;
        let file = self.triangles.len();
        self.pieces = Pieces::cut(vertices, first, &mut self.triangles);
        let polygons: Vec<u32> = (file..self.triangles.len())
            .map(|t| self.triangle_polygon[self.pieces.triangle(t as u32) as usize])
            .collect();
        self.triangle_polygon.extend(polygons);
        for v in vertices {
            let vertex = self.representative(v.vertex);
            self.corners.push(Corner { vertex, texcoord: NONE, normal: NONE });
            if !self.file_vertices.is_empty() {
                self.file_vertices.push(v.vertex);
            }
        }
        let ends = |v: &OnEdge| {
            let whole = self.whole_triangle(v.triangle as usize);
            [1, 2].map(|k| self.corners[whole[(v.corner as usize + k) % 3] as usize].vertex)
        };
        let hanging = vertices.iter().map(|v| (self.representative(v.vertex), ends(v), v.along)).collect();
        self.pieces.hang(hanging);
        self.renew_further_corners();
    }

    /// Cuts triangles as they are cut in `other`, which has the same triangles and joined vertices.
    pub(crate) fn cut_as(&mut self, other: &Self) {
        self.cut(&other.pieces.vertices);
    }

    /// Takes the cuts of triangles back.
    fn mend(&mut self) {
        let (texcoords, normals) = (self.file_texcoords().len(), self.file_normals().len());
        self.texcoords.truncate(texcoords);
        self.normals.truncate(normals);
        let triangles = self.file_triangle_count();
        self.triangles.truncate(triangles);
        self.triangle_polygon.truncate(triangles);
        let pieces = std::mem::take(&mut self.pieces);
        pieces.restore(&mut self.triangles);
        let corners = self.polygon_corners();
        self.corners.truncate(corners);
        self.file_vertices.truncate(corners);
    }

    /// Number of corners of polygons.
    pub(super) fn polygon_corners(&self) -> usize {
        self.polygon_start.last().map_or(0, |n| *n as usize)
    }

    /// Texture coordinates and normals of further corners: those of the edges that they lie on.
    pub(super) fn renew_further_corners(&mut self) {
        let (texcoords, normals) = (self.file_texcoords().len(), self.file_normals().len());
        self.texcoords.truncate(texcoords);
        self.normals.truncate(normals);
        let first = self.polygon_corners();
        for (i, (t, place)) in self.pieces.corners.iter().enumerate() {
            let whole = self.pieces.whole(*t).unwrap_or_default().map(|c| self.corners[c as usize]);
            let ends = || whole.iter().zip(place).filter(|(_, w)| **w > 0.0);
            let corner = &mut self.corners[first + i];
            (corner.texcoord, corner.normal) = (NONE, NONE);
            if ends().all(|(c, _)| (c.texcoord as usize) < texcoords) {
                corner.texcoord = self.texcoords.len() as u32;
                let uv = ends().map(|(c, w)| self.texcoords[c.texcoord as usize] * *w).sum();
                self.texcoords.push(uv);
            }
            if ends().all(|(c, _)| (c.normal as usize) < normals) {
                corner.normal = self.normals.len() as u32;
                let normal: DVec3 = ends().map(|(c, w)| self.normals[c.normal as usize] * *w).sum();
                self.normals.push(normal.normalize_or_zero());
            }
        }
        self.pieces.texcoords = self.texcoords.len() - texcoords;
        self.pieces.normals = self.normals.len() - normals;
    }

    /// The same mesh with triangles as in the file: cut at T-junctions again where it is cut there.
    pub fn with_whole_triangles(&self) -> Self {
        let mut mesh = self.clone();
        mesh.mend();
        mesh
    }

    /// A point of the triangles of the file as a point of those that are computed with.
    pub fn point_from_file(&self, p: SurfacePoint) -> SurfacePoint {
        self.pieces.located(p)
    }

    /// A point of the triangles that are computed with as a point of those of the file.
    pub fn point_in_file(&self, p: SurfacePoint) -> SurfacePoint {
        self.pieces.in_file(p)
    }

    /// Joins vertices as they are joined in `other`, which has the same vertices.
    ///
    /// # Panics
    /// If the numbers of vertices differ.
    pub(crate) fn join_as(&mut self, other: &Self) {
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
    pub(crate) fn connect_as(&mut self, other: &Self) {
        assert_eq!(self.polygon_corners(), other.polygon_corners(), "the same polygons");
        self.join_as(other);
        let triangles = 0..other.file_triangle_count();
        self.triangles = triangles.clone().map(|t| other.whole_triangle(t)).collect();
        self.triangle_polygon = other.triangle_polygon[triangles].to_vec();
        self.cut_as(other);
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

    /// Moves every joined vertex as its representative was moved from `self` to `positions`, and
    /// those that lie on an edge of another triangle as that edge was, so that no gap opens; but
    /// for those that `stay`.
    pub fn spread_positions(&self, positions: &mut [DVec3], stay: impl Fn(u32) -> bool) {
        self.close_junctions(positions, stay);
        for v in 0..self.representatives.len().min(positions.len()) {
            let r = self.representatives[v] as usize;
            if r != v {
                // Exactly the same place where they lie on one another.
                positions[v] = positions[r] + (self.positions[v] - self.positions[r]);
            }
        }
    }

    /// Moves the vertices that lie on an edge of another triangle, and those joined with them, as
    /// that edge was moved from `self` to `positions`; but for those that `stay`.
    pub fn close_junctions(&self, positions: &mut [DVec3], stay: impl Fn(u32) -> bool) {
        let hanging = || self.pieces.hanging.iter().filter(|h| !stay(h.0));
        for &(v, [a, b], along) in hanging() {
            let line = |p: &[DVec3]| p[a as usize].lerp(p[b as usize], along);
            // Exactly the same place where nothing moved.
            positions[v as usize] = self.positions[v as usize] + (line(positions) - line(&self.positions));
        }
        let moved: BTreeSet<u32> = hanging().map(|h| h.0).collect();
        for (v, &r) in self.representatives.iter().enumerate() {
            if moved.contains(&r) && r as usize != v {
                positions[v] = positions[r as usize] + (self.positions[v] - self.positions[r as usize]);
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
        self.triangles[t].map(|c| self.file_corner(c))
    }

    /// The three corners of triangle `t` of the file, cut or not, with its vertices: what a writer
    /// of triangles needs.
    pub fn file_triangle(&self, t: usize) -> [Corner; 3] {
        self.whole_triangle(t).map(|c| self.file_corner(c))
    }

    fn file_corner(&self, c: u32) -> Corner {
        let corner = self.corners[c as usize];
        Corner { vertex: self.file_vertices.get(c as usize).copied().unwrap_or(corner.vertex), ..corner }
    }

    /// The texture coordinates of the file, without those of further corners.
    pub fn file_texcoords(&self) -> &[DVec2] {
        &self.texcoords[..self.texcoords.len().saturating_sub(self.pieces.texcoords)]
    }

    /// The normals of the file, without those of further corners.
    pub fn file_normals(&self) -> &[DVec3] {
        &self.normals[..self.normals.len().saturating_sub(self.pieces.normals)]
    }
}
