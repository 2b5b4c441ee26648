//! A new shape for the meshes of a scene: positions, normals and tangents go back to the pose in
//! which they are stored.

use glam::{DMat3, DVec3};

use super::gltf_edit::Edit;
use super::gltf_nodes::global_transforms;
use super::gltf_pose::{Pose, inverse};
use super::gltf_read::triangle_elements;
use super::gltf_scene::{GltfScene, Part};
use super::source::Notes;
use crate::geometry::Mesh;
use crate::{Error, Result};

/// What was stored and is shown of a part.
struct Before {
    pose: Pose,
    stored: Vec<DVec3>,
    shown: Vec<DVec3>,
}

/// Gives the scene the positions and normals of `mesh`, which is the one that was read from it, in
/// another shape.
///
/// What is equal to what was read keeps its bytes. Tangents turn with the triangles around them.
pub(super) fn set_shape(edit: &mut Edit<'_>, scene: &GltfScene, mesh: &Mesh) -> Result<()> {
    let document = &scene.document;
    let globals = global_transforms(document)?;
    let mut lost = 0;
    for part in &scene.parts {
        let primitive = &document.root.meshes[part.mesh].primitives[part.primitive];
        let new = &mesh.positions[part.first_vertex..part.first_vertex + part.vertices];
        let Some(&accessor) = primitive.attributes.get("POSITION") else { continue };
        let stored = document.vectors(accessor, part.vertices)?;
        let pose = Pose::new(document, &globals, part.node, primitive, part.vertices, &mut Notes::default())?;
        let shown: Vec<DVec3> = stored.iter().enumerate().map(|(v, &p)| pose.place(v, p)).collect();
        let before = Before { pose, stored, shown };
        let moved = before.shown.iter().zip(new).any(|(a, b)| a != b);
        if moved {
            let values = before.positions(new, mesh, part, &mut lost)?;
            let k = edit.floats(Some(accessor), &values, "VEC3", true)?;
            edit.primitive(part.mesh, part.primitive)["attributes"]["POSITION"] = k.into();
        }
        if let (Some(first), Some(&accessor)) = (part.first_normal, primitive.attributes.get("NORMAL")) {
            let new = &mesh.normals[first..first + part.vertices];
            let old = document.vectors(accessor, part.vertices)?;
            let values: Vec<DVec3> = before.normals(&old, new).collect();
            if values != old {
                let k = edit.floats(Some(accessor), &flat(&values), "VEC3", false)?;
                edit.primitive(part.mesh, part.primitive)["attributes"]["NORMAL"] = k.into();
            }
        }
        if let (true, Some(&accessor)) = (moved, primitive.attributes.get("TANGENT")) {
            let old = document.numbers(accessor, 4)?;
            if old.len() < 4 * part.vertices {
                return Err(document.damaged(format!("accessor {accessor} ends before the last vertex")));
            }
            let elements = triangle_elements(document, primitive, part.vertices)?;
            let values = before.tangents(&old, new, &elements);
            let k = edit.floats(Some(accessor), &values, "VEC4", false)?;
            edit.primitive(part.mesh, part.primitive)["attributes"]["TANGENT"] = k.into();
        }
    }
    if lost > 0 {
        edit.notes.push(format!(
            "{lost} vertices stay as they were stored: their joints or nodes flatten space, so that no stored position \
             is shown at the new one"
        ));
    }
    Ok(())
}

fn flat(vectors: &[DVec3]) -> Vec<f32> {
    vectors.iter().flat_map(|v| v.as_vec3().to_array()).collect()
}

impl Before {
    /// The stored positions that are shown at `new`.
    fn positions(&self, new: &[DVec3], mesh: &Mesh, part: &Part, lost: &mut usize) -> Result<Vec<f32>> {
        let mut values = Vec::with_capacity(new.len());
        for (v, &p) in new.iter().enumerate() {
            let stored = if p == self.shown[v] { Some(self.stored[v]) } else { self.pose.stored(v, p) };
            *lost += usize::from(stored.is_none());
            let stored = stored.unwrap_or(self.stored[v]).as_vec3();
            if !stored.is_finite() {
                let what = format!("the position of vertex {} does not fit single precision", part.first_vertex + v);
                return Err(Error::mesh(&mesh.name, what, "Scale the mesh or correct the vertex"));
            }
            values.push(stored.to_array());
        }
        Ok(values.concat())
    }

    /// The stored normals that are shown along `new`; `old` ones where nothing changed.
    fn normals<'b>(&'b self, old: &'b [DVec3], new: &'b [DVec3]) -> impl Iterator<Item = DVec3> + 'b {
        old.iter().zip(new).enumerate().map(|(v, (&old, &new))| {
            let same = self.pose.normal(v, old) == new || new == DVec3::ZERO;
            if same { old } else { self.pose.stored_normal(v, new) }
        })
    }

    /// Tangents, turned by the mean over the triangles around a vertex of what takes their old
    /// edges to their new ones.
    fn tangents(&self, old: &[f64], new: &[DVec3], elements: &[[u32; 3]]) -> Vec<f32> {
        let mut turned = vec![DVec3::ZERO; new.len()];
        let unit = |t: &[DVec3; 3]| (t[1] - t[0]).cross(t[2] - t[0]).try_normalize();
        for t in elements {
            let (a, b) = (t.map(|v| self.shown[v as usize]), t.map(|v| new[v as usize]));
            let (Some(n), Some(m)) = (unit(&a), unit(&b)) else { continue };
            let from = DMat3::from_cols(a[1] - a[0], a[2] - a[0], n);
            let to = DMat3::from_cols(b[1] - b[0], b[2] - b[0], m);
            let map = to * from.inverse() * (a[1] - a[0]).cross(a[2] - a[0]).length();
            for v in t.map(|v| v as usize) {
                let tangent = DMat3::from_mat4(self.pose.matrix(v)) * DVec3::from_slice(&old[4 * v..4 * v + 3]);
                turned[v] += map * tangent;
            }
        }
        let stored = |v: usize| {
            let kept = DVec3::from_slice(&old[4 * v..4 * v + 3]);
            let back = inverse(&self.pose.matrix(v)).map(|m| DMat3::from_mat4(m) * turned[v]);
            let tangent = back.and_then(DVec3::try_normalize).unwrap_or(kept).as_vec3();
            [tangent.x, tangent.y, tangent.z, old[4 * v + 3] as f32]
        };
        (0..new.len()).flat_map(stored).collect()
    }
}
