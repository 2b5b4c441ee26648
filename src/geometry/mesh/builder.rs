//! Meshes, polygon by polygon.

use glam::DVec3;

use super::{Corner, Mesh, NONE};
use crate::error::{Error, Result};
use crate::geometry::triangulate::triangulate;

/// The remedy for an index that is out of range.
const COUNT: &str = "Indices count from 0: correct the index, or give what it names";

/// Builds a [`Mesh`] polygon by polygon.
///
/// Indices are checked by [`MeshBuilder::build`]. A reader checks them before, where it has the
/// line (`io`).
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
        builder.mesh.libraries.clone_from(&mesh.libraries);
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
    #[cfg(any(test, feature = "files"))]
    pub(crate) fn onto(mut mesh: Mesh) -> Self {
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
    /// # Errors
    /// [`Error::Mesh`] naming the face and corner, or the face, whose index is out of range; for
    /// colours that are not one a vertex; for more than 2^32 - 2 vertices or corners.
    pub fn build(self) -> Result<Mesh> {
        match self.fault() {
            None => Ok(self.finish()),
            Some((what, remedy)) => Err(Error::mesh(self.mesh.name, what, remedy)),
        }
    }

    /// As [`MeshBuilder::build`], for indices that are right by construction.
    pub(crate) fn finish(self) -> Mesh {
        debug_assert_eq!(self.fault(), None);
        let mut m = self.mesh;
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

    /// The first thing that keeps the mesh from being built, and its remedy.
    fn fault(&self) -> Option<(String, &'static str)> {
        let m = &self.mesh;
        for (what, count) in [("vertices", m.positions.len()), ("corners", m.corners.len())] {
            if count >= NONE as usize {
                return Some((format!("{count} {what} are more than 2^32 - 2"), "Split the mesh"));
            }
        }
        if ![0, m.positions.len()].contains(&m.colors.len()) {
            let what = format!("there are {} colours for {} vertices", m.colors.len(), m.positions.len());
            return Some((what, "Give one colour a vertex, or none"));
        }
        let beyond = |i: u32, n: usize| i != NONE && i as usize >= n;
        for p in 0..m.polygon_count() {
            for (k, c) in m.polygon(p).iter().enumerate() {
                if c.vertex as usize >= m.positions.len() {
                    let what = format!("face {p}, corner {k}: there is no vertex {}", c.vertex);
                    return Some((format!("{what}, there are {}", m.positions.len()), COUNT));
                }
                for (name, index, count) in
                    [("texture coordinate", c.texcoord, m.texcoords.len()), ("normal", c.normal, m.normals.len())]
                {
                    if beyond(index, count) {
                        return Some((
                            format!("face {p}, corner {k}: there is no {name} {index}, there are {count}"),
                            COUNT,
                        ));
                    }
                }
            }
            for (name, index, count) in [
                ("material", m.polygon_material[p], m.materials.len()),
                ("group", m.polygon_group[p], m.groups.len()),
                ("object", m.polygon_object[p], m.groups.len()),
            ] {
                if beyond(index, count) {
                    return Some((format!("face {p}: there is no {name} {index}, there are {count}"), COUNT));
                }
            }
        }
        None
    }
}
