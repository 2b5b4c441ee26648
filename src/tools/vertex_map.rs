//! The map of all vertices of a target, with what can be said about it.

use glam::DVec3;

use crate::error::Result;
use crate::geometry::{Frame, Mesh, SurfacePoint, Topology};
use crate::surface::quality::{Distortion, distortion, normal_at, vertex_normals};
use crate::surface::{PackedImage, PackedPoint, PointMap, Status};

/// Images of the target's vertices on the source.
#[derive(Clone, Debug)]
pub struct VertexMap {
    /// One per vertex of the target; nowhere for vertices of no usable triangle.
    pub images: Vec<PackedImage>,
    /// The images in space.
    pub positions: Vec<Option<DVec3>>,
    /// Stretch and flips over the triangles that were mapped.
    pub distortion: Distortion,
    /// Share of the target's area whose vertices are all valid.
    pub valid_fraction: f64,
}

/// The image of every vertex of `target`, as a corner of its lowest usable triangle; nowhere for
/// vertices of none. Joined vertices have one.
///
/// # Errors
/// Those of the map.
#[doc(hidden)]
pub fn vertex_images(target: &Mesh, topology: &Topology, map: &dyn PointMap) -> Result<Vec<PackedImage>> {
    let mut vertices = Vec::new();
    let mut points = Vec::new();
    for v in 0..target.vertex_count() as u32 {
        if let Some(point) = topology.vertex_point(v) {
            vertices.push(v as usize);
            points.push(PackedPoint::from(point));
        }
    }
    let mut found = Vec::new();
    if !points.is_empty() {
        map.map(&points, &mut found)?;
    }
    let mut images = vec![PackedImage::NOWHERE; target.vertex_count()];
    for (&v, &image) in vertices.iter().zip(&found) {
        images[v] = image;
    }
    target.spread(&mut images);
    Ok(images)
}

/// Maps every vertex of `target`, as a corner of its lowest usable triangle.
///
/// # Errors
/// Those of the map.
pub fn vertex_map(source: (&Mesh, &Topology), target: (&Mesh, &Topology), map: &dyn PointMap) -> Result<VertexMap> {
    let (mesh, topology) = target;
    let images = vertex_images(mesh, topology, map)?;
    let on_source: Vec<Option<SurfacePoint>> = images.iter().map(|i| i.point()).collect();
    let positions: Vec<Option<DVec3>> = on_source.iter().map(|p| p.map(|p| p.position(source.0))).collect();
    // Measured in a frame of the source, where places do not round.
    let frame = Frame::of_mesh(source.0);
    let places: Vec<Option<DVec3>> = on_source.iter().map(|p| p.map(|p| frame.place(&p, source.0))).collect();
    let source_normals = vertex_normals(source.0, source.1);
    let normals: Vec<DVec3> =
        on_source.iter().map(|p| p.map_or(DVec3::ZERO, |p| normal_at(source.0, &source_normals, &p))).collect();
    let (mut all, mut valid) = (0.0, 0.0);
    for t in (0..mesh.triangle_count()).filter(|&t| topology.usable[t]) {
        let area = mesh.triangle_area(t);
        all += area;
        if mesh.triangle(t).iter().all(|&v| images[v as usize].status() == Status::Valid) {
            valid += area;
        }
    }
    Ok(VertexMap {
        distortion: distortion(mesh, topology, &places, &normals, source.0.area() * frame.scale * frame.scale),
        images,
        positions,
        valid_fraction: if all > 0.0 { valid / all } else { 0.0 },
    })
}
