//! Tangent frames of a textured mesh: the axes that tangent-space normal maps refer to.
//!
//! The frames are those of MikkTSpace (Mikkelsen 2008, "Simulation of wrinkled surfaces
//! revisited"), which renderers and baking programs share: a normal and a tangent at every corner,
//! interpolated over the triangle without normalising them, the bitangent being their cross product
//! times the handedness of the triangle in the texture.

use std::collections::HashMap;

use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{DVec3, Vec3};

use super::{Frame, Mesh, NONE};

/// Triangles around one point beyond which its frames are made triangle by triangle: the
/// generator's recursion is as deep.
const MOST_AROUND: u32 = 2000;

/// Normal, tangent and handedness at a corner.
#[derive(Clone, Copy, Debug, PartialEq)]
struct CornerFrame {
    normal: Vec3,
    tangent: Vec3,
    /// 1, or -1 where the texture is mirrored.
    sign: f32,
}

/// Axes at a point of a surface, as a renderer uses them: neither of unit length nor exactly at
/// right angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TangentFrame {
    /// Along growing u.
    pub tangent: DVec3,
    /// Along growing v.
    pub bitangent: DVec3,
    /// Outward.
    pub normal: DVec3,
}

impl TangentFrame {
    /// The vector with the coordinates `n`, not normalised.
    pub fn to_space(&self, n: DVec3) -> DVec3 {
        self.tangent * n.x + self.bitangent * n.y + self.normal * n.z
    }

    /// The coordinates of the vector `v`, up to a positive factor: the inverse of
    /// [`TangentFrame::to_space`] by its adjugate; `None` if the axes do not span space.
    pub fn to_frame(&self, v: DVec3) -> Option<DVec3> {
        let rows =
            [self.bitangent.cross(self.normal), self.normal.cross(self.tangent), self.tangent.cross(self.bitangent)];
        let determinant = self.tangent.dot(rows[0]);
        let out = DVec3::new(rows[0].dot(v), rows[1].dot(v), rows[2].dot(v)) * determinant.signum();
        (determinant.abs() > 1e-12 && out.is_finite()).then_some(out)
    }
}

/// The frames of all triangle corners of a mesh.
#[derive(Clone, Debug, Default)]
pub struct TangentFrames {
    corners: Vec<[CornerFrame; 3]>,
}

impl TangentFrames {
    /// Bytes per triangle.
    pub const TRIANGLE_BYTES: usize = size_of::<[CornerFrame; 3]>();

    /// The frames of `mesh`, with the normals of its file where a triangle has them, else with
    /// `smooth`, one unit normal per vertex (zero for none). Texture coordinates are as in
    /// [`Mesh`], v up. Polygons count as the triangles of their fans. Triangles without texture
    /// coordinates or without area there get some tangent. O(triangles log triangles).
    ///
    /// # Panics
    /// If there are fewer normals than vertices.
    pub fn new(mesh: &Mesh, smooth: &[DVec3]) -> Self {
        // Coordinates near 1 about the mesh itself: their squares stay in the range of single
        // precision.
        let frame = Frame::of_mesh(mesh);
        let mut corners: Vec<[CornerFrame; 3]> = (0..mesh.triangle_count())
            .map(|t| {
                let normals = corner_normals(mesh, t, smooth);
                normals.map(|n| CornerFrame {
                    normal: n.as_vec3(),
                    tangent: n.any_orthonormal_vector().as_vec3(),
                    sign: 1.0,
                })
            })
            .collect();
        let usable = |t: &u32| {
            let t = *t as usize;
            mesh.triangle_texcoords(t).is_some_and(|uv| uv.iter().all(|p| p.as_vec2().is_finite()))
                && mesh.triangle_positions(t).iter().all(|p| p.is_finite())
        };
        let usable: Vec<u32> = (0..mesh.triangle_count() as u32).filter(usable).collect();
        let (crowded, usable) = split_crowded(mesh, &frame, usable);
        let mut found: Vec<[Option<(Vec3, f32)>; 3]> = Vec::new();
        for (faces, alone) in [(usable, false), (crowded, true)] {
            let chunk = if alone { 1 } else { faces.len().max(1) };
            for faces in faces.chunks(chunk) {
                found.clear();
                found.resize(faces.len(), [None; 3]);
                let mut job = Job { mesh, faces, corners: &corners, frame, found: &mut found };
                // The only errors of this version's type are none.
                if generate_tangents(&mut job).is_err() {
                    continue;
                }
                for (&t, tangents) in faces.iter().zip(&found) {
                    // A corner without an angle has no tangent of its own.
                    let some = tangents.iter().flatten().next();
                    for (corner, found) in corners[t as usize].iter_mut().zip(tangents) {
                        if let Some((tangent, sign)) = found.as_ref().or(some) {
                            (corner.tangent, corner.sign) = (*tangent, *sign);
                        }
                    }
                }
            }
        }
        Self { corners }
    }

    /// The axes at the point of triangle `face` with these barycentric coordinates.
    ///
    /// # Panics
    /// If there is no such triangle.
    pub fn at(&self, face: u32, barycentric: [f64; 3]) -> TangentFrame {
        let corners = &self.corners[face as usize];
        let mut normal = DVec3::ZERO;
        let mut tangent = DVec3::ZERO;
        for (c, b) in corners.iter().zip(barycentric) {
            normal += c.normal.as_dvec3() * b;
            tangent += c.tangent.as_dvec3() * b;
        }
        if normal.cross(tangent).length_squared() < 1e-12 {
            normal = if normal.length_squared() > 1e-12 { normal } else { DVec3::Z };
            tangent = normal.normalize().any_orthonormal_vector();
        }
        // All corners of a triangle are turned the same way in the texture.
        TangentFrame { tangent, bitangent: normal.cross(tangent) * f64::from(corners[0].sign), normal }
    }

    /// The unit normal at a point; see [`TangentFrames::at`].
    ///
    /// # Panics
    /// If there is no such triangle.
    pub fn normal(&self, face: u32, barycentric: [f64; 3]) -> DVec3 {
        let corners = &self.corners[face as usize];
        let sum: DVec3 = corners.iter().zip(barycentric).map(|(c, b)| c.normal.as_dvec3() * b).sum();
        sum.try_normalize().unwrap_or(DVec3::Z)
    }
}

/// Normals of a triangle's corners: the file's if all are usable, else the smooth ones, else the
/// triangle's own.
fn corner_normals(mesh: &Mesh, t: usize, smooth: &[DVec3]) -> [DVec3; 3] {
    let corners = mesh.triangle_corners(t);
    let unit = |n: DVec3| n.try_normalize().filter(|n| n.is_finite());
    let own = corners.map(|c| if c.normal == NONE { None } else { unit(mesh.normals[c.normal as usize]) });
    if let [Some(a), Some(b), Some(c)] = own {
        return [a, b, c];
    }
    let flat = unit(mesh.triangle_area_normal(t)).unwrap_or(DVec3::Z);
    corners.map(|c| unit(smooth[c.vertex as usize]).unwrap_or(flat))
}

/// Triangles at points with too many of them, and the others.
fn split_crowded(mesh: &Mesh, frame: &Frame, faces: Vec<u32>) -> (Vec<u32>, Vec<u32>) {
    // The generator merges corners by position.
    let key = |v: u32| frame.local(mesh.positions[v as usize]).to_array().map(|c| (c as f32 + 0.0).to_bits());
    let mut around: HashMap<[u32; 3], u32> = HashMap::new();
    for &t in &faces {
        for v in mesh.triangle(t as usize) {
            *around.entry(key(v)).or_default() += 1;
        }
    }
    faces.into_iter().partition(|&t| mesh.triangle(t as usize).iter().any(|&v| around[&key(v)] > MOST_AROUND))
}

/// Some triangles, as the generator sees them.
struct Job<'a> {
    mesh: &'a Mesh,
    faces: &'a [u32],
    corners: &'a [[CornerFrame; 3]],
    frame: Frame,
    found: &'a mut [[Option<(Vec3, f32)>; 3]],
}

impl Geometry for Job<'_> {
    fn num_faces(&self) -> usize {
        self.faces.len()
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, vert: usize) -> [f32; 3] {
        let v = self.mesh.triangle(self.faces[face] as usize)[vert];
        self.frame.local(self.mesh.positions[v as usize]).as_vec3().to_array()
    }

    fn normal(&self, face: usize, vert: usize) -> [f32; 3] {
        self.corners[self.faces[face] as usize][vert].normal.to_array()
    }

    fn tex_coord(&self, face: usize, vert: usize) -> [f32; 2] {
        let uv = self.mesh.triangle_texcoords(self.faces[face] as usize);
        uv.map_or([0.0; 2], |uv| uv[vert].as_vec2().to_array())
    }

    fn set_tangent(&mut self, tangent_space: Option<TangentSpace>, face: usize, vert: usize) {
        self.found[face][vert] = tangent_space.and_then(|s| {
            let [x, y, z, sign] = s.tangent_encoded();
            let tangent = Vec3::new(x, y, z);
            (tangent.is_finite() && tangent.length_squared() > 0.25).then_some((tangent, sign))
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Corner, MeshBuilder, Topology};
    use crate::models::shapes::uv_sphere;
    use glam::DVec2;

    /// Two triangles of a unit square in the plane z = 0, seen from above; texture coordinates by
    /// `uv`.
    fn square(uv: impl Fn(DVec2) -> DVec2) -> Mesh {
        let mut b = MeshBuilder::new("square");
        for p in [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y] {
            b.mesh.positions.push(p.extend(0.0));
            b.mesh.texcoords.push(uv(p));
        }
        for t in [[0, 1, 2], [0, 2, 3]] {
            b.polygon(t.map(|i| Corner { vertex: i, texcoord: i, normal: NONE }));
        }
        b.finish()
    }

    fn up(mesh: &Mesh) -> Vec<DVec3> {
        vec![DVec3::Z; mesh.vertex_count()]
    }

    #[test]
    fn axes_follow_texture_coordinates() {
        let third = [1.0 / 3.0; 3];
        type Unwrap = fn(DVec2) -> DVec2;
        let cases: [(Unwrap, DVec3, DVec3); 3] = [
            (|p| p, DVec3::X, DVec3::Y),
            (|p| DVec2::new(p.y, 1.0 - p.x), DVec3::Y, DVec3::NEG_X),
            // Mirrored: u runs along -x while v still runs along y.
            (|p| DVec2::new(1.0 - p.x, p.y), DVec3::NEG_X, DVec3::Y),
        ];
        for (uv, tangent, bitangent) in cases {
            let mesh = square(uv);
            let frame = TangentFrames::new(&mesh, &up(&mesh)).at(1, third);
            assert!(frame.tangent.distance(tangent) < 1e-6 && frame.bitangent.distance(bitangent) < 1e-6, "{frame:?}");
            let v = DVec3::new(0.3, -0.2, 0.9);
            let there = frame.to_frame(v).unwrap();
            assert!(frame.to_space(there).normalize().distance(v.normalize()) < 1e-6);
        }
    }

    #[test]
    fn scale_of_the_mesh_does_not_matter() {
        let sphere = uv_sphere(1.0, 16, 9);
        let normals = crate::surface::quality::vertex_normals(&sphere, &Topology::new(&sphere));
        let frames = TangentFrames::new(&sphere, &normals);
        for factor in [2.0_f64.powi(-60), 2.0_f64.powi(70)] {
            let mut scaled = sphere.clone();
            scaled.positions.iter_mut().for_each(|p| *p *= factor);
            assert_eq!(TangentFrames::new(&scaled, &normals).corners, frames.corners);
        }
    }

    #[test]
    fn the_files_normals_win() {
        let mut b = MeshBuilder::new("tilted");
        b.mesh.positions = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        b.mesh.texcoords = vec![DVec2::ZERO, DVec2::X, DVec2::Y];
        b.mesh.normals = vec![DVec3::new(0.0, 0.6, 0.8)];
        b.polygon([0, 1, 2].map(|i| Corner { vertex: i, texcoord: i, normal: 0 }));
        let mesh = b.finish();
        assert!(
            TangentFrames::new(&mesh, &up(&mesh)).normal(0, [1.0, 0.0, 0.0]).distance(DVec3::new(0.0, 0.6, 0.8)) < 1e-6
        );
    }

    #[test]
    fn bad_triangles_get_some_frame() {
        let mut b = MeshBuilder::new("bad");
        b.mesh.positions = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::splat(f64::NAN), DVec3::splat(1e300)];
        b.mesh.texcoords = vec![DVec2::ZERO, DVec2::X, DVec2::splat(f64::INFINITY)];
        for (t, uv) in [
            ([0, 1, 2], [0, 0, 0]),
            ([0, 1, 3], [0, 1, 0]),
            ([0, 1, 2], [0, 1, 2]),
            ([0, 0, 0], [0, 1, 1]),
            ([0, 1, 4], [0, 1, 0]),
        ] {
            b.polygon((0..3).map(|k| Corner { vertex: t[k], texcoord: uv[k], normal: NONE }));
        }
        let mesh = b.finish();
        let frames = TangentFrames::new(&mesh, &up(&mesh));
        for t in 0..mesh.triangle_count() as u32 {
            let frame = frames.at(t, [0.2, 0.3, 0.5]);
            assert!(frame.to_frame(DVec3::Z).is_some(), "{t}: {frame:?}");
        }
    }

    #[test]
    fn a_fan_of_many_triangles_does_not_exhaust_the_stack() {
        let count = 200_000_u32;
        let mut b = MeshBuilder::new("fan");
        b.mesh.positions.push(DVec3::ZERO);
        b.mesh.texcoords.push(DVec2::splat(0.5));
        for i in 0..count {
            let a = f64::from(i) / f64::from(count) * std::f64::consts::TAU;
            b.mesh.positions.push(DVec3::new(a.cos(), a.sin(), 0.0));
            b.mesh.texcoords.push(DVec2::new(0.5 + 0.5 * a.cos(), 0.5 + 0.5 * a.sin()));
        }
        for i in 0..count {
            let t = [0, 1 + i, 1 + (i + 1) % count];
            b.polygon(t.map(|i| Corner { vertex: i, texcoord: i, normal: NONE }));
        }
        let mesh = b.finish();
        let frame = TangentFrames::new(&mesh, &up(&mesh)).at(77, [0.2, 0.4, 0.4]);
        assert!(frame.tangent.distance(DVec3::X) < 1e-2, "{frame:?}");
    }
}
