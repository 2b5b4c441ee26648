//! Meshes, polygon by polygon.

use glam::DVec3;

use super::{Corner, Mesh, NONE};
use crate::geometry::triangulate::triangulate;

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
