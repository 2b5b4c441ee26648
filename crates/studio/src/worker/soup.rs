//! Triangles as they are drawn: each with corners of its own.

use barymap::desk::Textures;
use barymap::geometry::{Mesh, NONE};
use bytemuck::{Pod, Zeroable};
use glam::DVec3;

/// A corner of a triangle.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Corner {
    /// From the centre of the shape.
    pub position: [f32; 3],
    /// Of length one.
    pub normal: [f32; 3],
    /// Texture coordinates, v downwards.
    pub uv: [f32; 2],
}

/// Triangles that show one picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Its corners.
    pub corners: std::ops::Range<u32>,
    /// The number of its picture, if it has one.
    pub picture: Option<usize>,
}

/// All triangles of a shape.
#[derive(Clone, Debug)]
pub struct Soup {
    /// Three for each triangle.
    pub corners: Vec<Corner>,
    /// The vertex of the mesh that each corner is.
    pub vertices: Vec<u32>,
    /// By picture.
    pub parts: Vec<Part>,
    /// Pairs of corners: every edge once.
    pub edges: Vec<u32>,
    /// What positions are counted from.
    pub centre: DVec3,
}

impl Soup {
    /// The triangles of a mesh with the pictures of a layer, if there is one. O(F log F).
    pub fn new(mesh: &Mesh, layer: Option<&Textures>) -> Self {
        let centre = mesh.bounds().map_or(DVec3::ZERO, |(low, high)| 0.5 * (low + high));
        let normals = normals(mesh);
        let count = mesh.triangle_count();
        let picture = |t: usize| layer.map_or(NONE, |l| picture_of(l, mesh, t));
        let pictures: Vec<u32> = (0..count).map(picture).collect();
        let mut order: Vec<u32> = (0..count as u32).collect();
        order.sort_by_key(|&t| (pictures[t as usize], t));
        let (mut corners, mut vertices) = (Vec::with_capacity(3 * count), Vec::with_capacity(3 * count));
        let mut parts: Vec<Part> = Vec::new();
        let mut sides = Vec::with_capacity(3 * count);
        for &t in &order {
            let t = t as usize;
            let triangle = mesh.triangle(t);
            let shown = (pictures[t] != NONE).then_some(pictures[t] as usize);
            let first = corners.len() as u32;
            match parts.last_mut().filter(|p| p.picture == shown) {
                Some(part) => part.corners.end = first + 3,
                None => parts.push(Part { corners: first..first + 3, picture: shown }),
            }
            let uv = mesh.triangle_texcoords(t);
            let placement =
                layer.filter(|l| l.face_texture.is_none()).zip(shown).and_then(|(l, k)| l.placements.get(k));
            for k in 0..3 {
                let v = triangle[k] as usize;
                let uv = uv.map_or(glam::DVec2::ZERO, |uv| uv[k]);
                let uv = placement.map_or(uv, |p| p.transform.transform_point2(uv));
                let position = (mesh.positions[v] - centre).as_vec3().to_array();
                corners.push(Corner { position, normal: normals[v], uv: [uv.x as f32, 1.0 - uv.y as f32] });
                vertices.push(triangle[k]);
                let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
                sides.push(([a.min(b), a.max(b)], [first + k as u32, first + (k as u32 + 1) % 3]));
            }
        }
        sides.sort_unstable();
        sides.dedup_by_key(|s| s.0);
        let edges = sides.into_iter().flat_map(|s| s.1).collect();
        Self { corners, vertices, parts, edges, centre }
    }
}

/// The picture of a triangle of a layer, or [`NONE`].
fn picture_of(layer: &Textures, mesh: &Mesh, t: usize) -> u32 {
    if let Some(faces) = &layer.face_texture {
        return faces[t];
    }
    let material = mesh.triangle_material(t) as usize;
    layer.material_texture.get(material).copied().unwrap_or(layer.default_texture)
}

/// Of vertices: the mean of their triangles', by area.
fn normals(mesh: &Mesh) -> Vec<[f32; 3]> {
    let mut sums = vec![DVec3::ZERO; mesh.vertex_count()];
    for t in 0..mesh.triangle_count() {
        let normal = mesh.triangle_area_normal(t);
        if normal.is_finite() {
            mesh.triangle(t).iter().for_each(|&v| sums[v as usize] += normal);
        }
    }
    sums.into_iter().map(|n| n.try_normalize().unwrap_or(DVec3::Z).as_vec3().to_array()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use barymap::models::shapes::uv_sphere;
    use barymap::picture::{Depth, Image};

    #[test]
    fn a_closed_mesh_has_three_halves_as_many_edges_as_triangles() {
        let mesh = uv_sphere(2.0, 12, 8);
        let soup = Soup::new(&mesh, None);
        let sound = mesh.triangle_count();
        assert_eq!(soup.corners.len(), 3 * sound);
        assert_eq!(soup.parts, [Part { corners: 0..3 * sound as u32, picture: None }]);
        assert_eq!(soup.edges.len(), 3 * sound);
        for (corner, &v) in soup.corners.iter().zip(&soup.vertices) {
            let p = mesh.positions[v as usize] - soup.centre;
            assert!((p.as_vec3() - glam::Vec3::from(corner.position)).length() < 1e-6);
            // Normals of a sphere point away from its centre.
            assert!(p.normalize().as_vec3().dot(corner.normal.into()) > 0.9);
        }
    }

    #[test]
    fn parts_have_one_picture_each() {
        let mesh = uv_sphere(1.0, 6, 4);
        let mut layer = Textures::single(Image::zeros(2, 2, 3, Depth::U8).unwrap());
        layer.face_texture =
            Some((0..mesh.triangle_count() as u32).map(|t| if t % 3 == 2 { NONE } else { t % 3 }).collect());
        let soup = Soup::new(&mesh, Some(&layer));
        let pictures: Vec<_> = soup.parts.iter().map(|p| p.picture).collect();
        assert_eq!(pictures, [Some(0), Some(1), None]);
        assert_eq!(soup.parts.last().unwrap().corners.end as usize, soup.corners.len());
    }
}
