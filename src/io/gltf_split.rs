//! The vertices of a mesh as glTF has them: one for each combination of position, texture
//! coordinate and normal.

use std::collections::HashMap;

use glam::{DVec2, DVec3, Vec3};
use serde_json::{Value, json};

use super::gltf_parts::{ARRAY, ELEMENTS, FLOAT, Parts, UNSIGNED_INT};
use crate::geometry::{Mesh, NONE};
use crate::picture::srgb_to_linear;
use crate::{Error, Result};

/// A vertex that is written.
#[derive(Clone, Copy)]
pub(super) struct SplitVertex {
    /// Vertex of the mesh.
    pub(super) vertex: u32,
    texcoord: u32,
    pub(super) normal: Vec3,
}

/// The vertices and triangles of one material.
pub(super) struct Split {
    pub(super) vertices: Vec<SplitVertex>,
    pub(super) indices: Vec<u32>,
    textured: bool,
}

impl Split {
    /// The triangles that are `wanted`; `smooth` are the normals of vertices whose corners have
    /// none.
    pub(super) fn new(mesh: &Mesh, smooth: &[DVec3], wanted: impl Fn(usize) -> bool) -> Self {
        let mut index = HashMap::new();
        let mut split = Self { vertices: Vec::new(), indices: Vec::new(), textured: false };
        for t in (0..mesh.file_triangle_count()).filter(|&t| wanted(t)) {
            let corners = mesh.file_triangle(t);
            let [a, b, c] = corners.map(|c| mesh.representative(c.vertex));
            if a == b || b == c || c == a {
                continue;
            }
            for corner in corners {
                let own = mesh.normals.get(corner.normal as usize).and_then(|n| n.try_normalize());
                let normal = own.unwrap_or_else(|| smooth[mesh.representative(corner.vertex) as usize]).as_vec3();
                // Adding zero makes -0 equal to 0.
                let key = (corner.vertex, corner.texcoord, (normal + Vec3::ZERO).to_array().map(f32::to_bits));
                split.textured |= corner.texcoord != NONE;
                split.indices.push(*index.entry(key).or_insert_with(|| {
                    split.vertices.push(SplitVertex { vertex: corner.vertex, texcoord: corner.texcoord, normal });
                    split.vertices.len() as u32 - 1
                }));
            }
        }
        split
    }

    /// The description of the primitive; its positions are relative to `origin`. With `pictured` it
    /// has texture coordinates where the mesh has none, too: pictures need some. With `colored` it
    /// has the colours of the mesh's vertices.
    pub(super) fn write(
        &self,
        mesh: &Mesh,
        origin: DVec3,
        pictured: bool,
        colored: bool,
        out: &mut Parts,
    ) -> Result<Value> {
        let mut bytes = Vec::with_capacity(12 * self.vertices.len());
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for &SplitVertex { vertex, .. } in &self.vertices {
            let p = (mesh.positions[vertex as usize] - origin).as_vec3();
            if !p.is_finite() {
                let what = format!("the position of vertex {vertex} does not fit single precision");
                return Err(Error::mesh(&mesh.name, what, "Scale the mesh or correct the vertex"));
            }
            for (k, x) in p.to_array().into_iter().enumerate() {
                low[k] = low[k].min(x);
                high[k] = high[k].max(x);
                bytes.extend_from_slice(&x.to_le_bytes());
            }
        }
        let count = self.vertices.len();
        let positions = out.accessor(&bytes, ARRAY, FLOAT, count, "VEC3");
        out.accessors[positions]["min"] = json!(low);
        out.accessors[positions]["max"] = json!(high);
        bytes.clear();
        for v in &self.vertices {
            bytes.extend(v.normal.to_array().into_iter().flat_map(f32::to_le_bytes));
        }
        let normals = out.accessor(&bytes, ARRAY, FLOAT, count, "VEC3");
        let mut attributes = json!({"POSITION": positions, "NORMAL": normals});
        if self.textured || pictured {
            bytes.clear();
            for v in &self.vertices {
                let uv = mesh.texcoords.get(v.texcoord as usize).copied().unwrap_or(DVec2::ZERO);
                // The format's v runs down from the top of the picture.
                for x in [uv.x as f32, (1.0 - uv.y) as f32] {
                    bytes.extend_from_slice(&if x.is_finite() { x } else { 0.0 }.to_le_bytes());
                }
            }
            attributes["TEXCOORD_0"] = out.accessor(&bytes, ARRAY, FLOAT, count, "VEC2").into();
        }
        if colored {
            attributes["COLOR_0"] = self.colors(mesh, out).into();
        }
        let bytes: Vec<u8> = self.indices.iter().flat_map(|i| i.to_le_bytes()).collect();
        let indices = out.accessor(&bytes, ELEMENTS, UNSIGNED_INT, self.indices.len(), "SCALAR");
        Ok(json!({"attributes": attributes, "indices": indices}))
    }

    /// An accessor of the colours of the vertices: light (glTF 2.0, section 3.7.2.1), with opacity
    /// where some are not opaque.
    fn colors(&self, mesh: &Mesh, out: &mut Parts) -> usize {
        let of = |v: &SplitVertex| mesh.colors.get(v.vertex as usize).copied().unwrap_or([1.0; 4]);
        let opaque = self.vertices.iter().all(|v| of(v)[3] >= 1.0);
        let width = if opaque { 3 } else { 4 };
        let light = |v: &SplitVertex| {
            let [r, g, b, a] = of(v).map(|x| if x.is_finite() { x.clamp(0.0, 1.0) } else { 1.0 });
            let [r, g, b] = [r, g, b].map(srgb_to_linear);
            [r, g, b, a].into_iter().take(width).flat_map(f32::to_le_bytes)
        };
        let bytes: Vec<u8> = self.vertices.iter().flat_map(light).collect();
        out.accessor(&bytes, ARRAY, FLOAT, self.vertices.len(), if opaque { "VEC3" } else { "VEC4" })
    }
}

/// Distances from the origin, in sizes of the mesh, up to which positions are written as they are:
/// four bits of single precision.
const NEAR: f64 = 16.0;

/// What is subtracted from positions before they become single precision: zero unless the mesh lies
/// far from the origin.
///
/// It is a multiple of a power of two above the mesh's size, so that the subtraction is exact, and
/// the differences need the bits of the mesh's own size only.
pub(super) fn origin(mesh: &Mesh) -> DVec3 {
    let Some((low, high)) = mesh.bounds() else { return DVec3::ZERO };
    let (middle, size) = (low.midpoint(high), (high - low).max_element());
    if !(middle.abs().max_element() > NEAR * size && size > 0.0 && middle.is_finite()) {
        return DVec3::ZERO;
    }
    let step = size.log2().ceil().exp2();
    let origin = (middle / step).round() * step;
    if origin.is_finite() { origin } else { DVec3::ZERO }
}

/// Unit normals of the vertices at `positions`, those of the triangles around by their angles, as
/// meshes without normals are shaded; up where there is none.
pub(super) fn vertex_normals(mesh: &Mesh, positions: &[DVec3]) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; mesh.vertex_count()];
    for t in 0..mesh.triangle_count() {
        let p = mesh.triangle(t).map(|v| positions[v as usize]);
        let Some(n) = (p[1] - p[0]).cross(p[2] - p[0]).try_normalize() else { continue };
        for (k, v) in mesh.triangle(t).into_iter().enumerate() {
            let (a, b) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
            let angle = a.cross(b).length().atan2(a.dot(b));
            if angle.is_finite() {
                normals[v as usize] += n * angle;
            }
        }
    }
    normals.into_iter().map(|n| n.try_normalize().unwrap_or(DVec3::Z)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Corner, MeshBuilder};

    /// A roof of two triangles with a ridge along y, and a normal for each face or for each vertex.
    fn roof(hard: bool) -> Mesh {
        let mut builder = MeshBuilder::new("roof");
        builder.mesh.positions =
            [[0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]].map(DVec3::from).into();
        builder.mesh.normals = vec![DVec3::new(-0.6, 0.0, 0.8), DVec3::new(0.6, 0.0, 0.8), DVec3::Z];
        for (face, t) in [[0, 1, 2], [1, 0, 3]].into_iter().enumerate() {
            let normal = |v: u32| if hard || v > 1 { face as u32 } else { 2 };
            builder.polygon(t.map(|vertex| Corner { vertex, texcoord: NONE, normal: normal(vertex) }));
        }
        builder.finish()
    }

    #[test]
    fn hard_edges_stay_hard_and_smooth_ones_smooth() {
        let split = |mesh: &Mesh| Split::new(mesh, &vertex_normals(mesh, &mesh.positions), |_| true);
        let hard = split(&roof(true));
        assert_eq!(hard.vertices.len(), 6);
        assert!(hard.vertices[..3].iter().all(|v| v.normal == Vec3::new(-0.6, 0.0, 0.8)));
        assert!(hard.vertices[3..].iter().all(|v| v.normal == Vec3::new(0.6, 0.0, 0.8)));
        let smooth = split(&roof(false));
        assert_eq!(smooth.vertices.len(), 4);
        assert_eq!(smooth.vertices[0].normal, Vec3::Z);
        // Without normals the ridge gets the mean of its faces.
        let mut bare = roof(true);
        bare.normals = vec![DVec3::ZERO; 3];
        let bare = split(&bare);
        assert_eq!((bare.vertices.len(), bare.vertices[0].normal), (4, Vec3::Z));
    }

    #[test]
    fn positions_near_the_origin_stay_and_far_ones_are_exact() {
        for (offset, step) in
            [(DVec3::ZERO, 0.5), (DVec3::new(5.0, -3.0, 0.0), 0.5), (DVec3::new(5e5, 4.6e6, 0.0), 0.125)]
        {
            let positions =
                (0..9).map(|k| offset + DVec3::new(f64::from(k % 3), f64::from(k / 3), 0.0) * step).collect();
            let mesh = Mesh::of_triangles("grid", positions, &[[0, 1, 3], [8, 7, 5], [2, 4, 6]]);
            let o = origin(&mesh);
            assert_eq!(o == DVec3::ZERO, offset.length() < 10.0, "{o}");
            for p in &mesh.positions {
                assert_eq!((*p - o).as_vec3().as_dvec3() + o, *p);
            }
        }
        let scaled = |s: f64| {
            let p = |x: f64, y: f64| DVec3::new(1e9 + x, y, 0.0) * s;
            origin(&Mesh::of_triangles("t", vec![p(0.0, 0.0), p(3.0, 0.0), p(0.0, 3.0)], &[[0, 1, 2]]))
        };
        // The choice scales with powers of two.
        assert_eq!(scaled(2.0_f64.powi(-20)), scaled(1.0) * 2.0_f64.powi(-20));
    }
}
