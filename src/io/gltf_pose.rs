//! The pose in which viewers show a mesh: morph targets at their default weights, then the skin, or
//! the node.
//!
//! A vertex with stored position p is shown at M (p + sum of w_k d_k): d_k is its displacement by
//! morph target k, w_k the default weight, M the transform of the node or, with a skin, the sum of
//! joint transforms x inverse bind matrices by the vertex's weights (glTF 2.0, sections 3.7.2.2 and
//! 3.7.3). Weights are divided by their sum, as viewers do; a vertex whose weights are all zero
//! follows its first joint. Animations are not applied.

use glam::{DMat3, DMat4, DVec3};

use super::gltf_document::{Document, Primitive};
use super::source::Notes;
use crate::Result;

/// Sets of joints and weights that are read: no exporter writes more.
const SETS: usize = 16;

/// The transforms of a mesh's vertices.
pub(super) enum Transform {
    /// One for all.
    Rigid(DMat4),
    /// Blended from those of joints.
    Skinned(Skinning),
}

/// Joint matrices, and how much of each is in a vertex.
pub(super) struct Skinning {
    /// Joint transform x inverse bind matrix.
    matrices: Vec<DMat4>,
    /// Those of a vertex sum to one.
    weights: VertexWeights,
}

/// The pose of a primitive.
pub(super) struct Pose {
    pub(super) transform: Transform,
    /// Whether triangles are turned over: by the node's transform, with a skin, too (glTF 2.0,
    /// section 3.7.4).
    pub(super) reflects: bool,
    /// Displacements by morph targets, before the placement; empty for none.
    shifts: Vec<DVec3>,
    /// The same of normals.
    normal_shifts: Vec<DVec3>,
}

impl Pose {
    /// The pose of `primitive`, whose mesh stands at `node`, with `count` vertices; `globals` are
    /// the transforms of all nodes.
    pub(super) fn new(
        document: &Document,
        globals: &[DMat4],
        node: usize,
        primitive: &Primitive,
        count: usize,
        notes: &mut Notes,
    ) -> Result<Self> {
        let transform = match document.root.nodes[node].skin {
            Some(skin) => match Skinning::new(document, globals, skin, primitive, count, notes)? {
                Some(skinning) => Transform::Skinned(skinning),
                // Without weights there is nothing to blend: the node's own transform is all there
                // is.
                None => Transform::Rigid(globals[node]),
            },
            None => Transform::Rigid(globals[node]),
        };
        let weights = default_weights(document, node);
        let shifts = morphed(document, primitive, "POSITION", &weights, count)?;
        let normal_shifts = morphed(document, primitive, "NORMAL", &weights, count)?;
        Ok(Self { transform, reflects: globals[node].determinant() < 0.0, shifts, normal_shifts })
    }

    /// The transform of vertex `v` of the primitive.
    pub(super) fn matrix(&self, v: usize) -> DMat4 {
        match &self.transform {
            Transform::Rigid(matrix) => *matrix,
            Transform::Skinned(skinning) => skinning.matrix(v),
        }
    }

    /// Where vertex `v` with stored position `p` is shown.
    pub(super) fn place(&self, v: usize, p: DVec3) -> DVec3 {
        self.matrix(v).transform_point3(p + self.shift(v))
    }

    /// The unit normal shown for a stored one; zero where there is none.
    pub(super) fn normal(&self, v: usize, n: DVec3) -> DVec3 {
        self.turned_normal(v, n + self.normal_shifts.get(v).copied().unwrap_or_default())
    }

    /// A normal turned as vertex `v` is, without morph targets.
    pub(super) fn turned_normal(&self, v: usize, n: DVec3) -> DVec3 {
        (normal_matrix(&self.matrix(v)) * n).normalize_or_zero()
    }

    /// The stored position of vertex `v` that is shown at `p`; `None` where its transform has no
    /// inverse.
    pub(super) fn stored(&self, v: usize, p: DVec3) -> Option<DVec3> {
        let stored = inverse(&self.matrix(v))?.transform_point3(p) - self.shift(v);
        stored.is_finite().then_some(stored)
    }

    /// The stored unit normal that is shown along `n`.
    pub(super) fn stored_normal(&self, v: usize, n: DVec3) -> DVec3 {
        let turned = DMat3::from_mat4(self.matrix(v)).transpose() * n;
        let shift = self.normal_shifts.get(v).copied().unwrap_or_default();
        (turned.normalize_or_zero() - shift).normalize_or_zero()
    }

    fn shift(&self, v: usize) -> DVec3 {
        self.shifts.get(v).copied().unwrap_or_default()
    }
}

/// The inverse; `None` where a direction is lost, up to rounding of single precision.
pub(super) fn inverse(matrix: &DMat4) -> Option<DMat4> {
    let linear = DMat3::from_mat4(*matrix);
    let size = linear.x_axis.length() * linear.y_axis.length() * linear.z_axis.length();
    (linear.determinant().abs() > 1e-9 * size).then(|| matrix.inverse())
}

/// What turns normals: the cofactors, which are the inverse transposed up to scale and are there
/// for singular matrices, too. Reflections keep normals outside.
fn normal_matrix(matrix: &DMat4) -> DMat3 {
    let m = DMat3::from_mat4(*matrix);
    let cofactors = DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
    cofactors * if m.determinant() < 0.0 { -1.0 } else { 1.0 }
}

/// The weights of morph targets in the default state: the node's, else the mesh's.
pub(super) fn default_weights(document: &Document, node: usize) -> Vec<f64> {
    let node = &document.root.nodes[node];
    let mesh = node.mesh.and_then(|m| document.root.meshes.get(m));
    let weights = node.weights.as_ref().or(mesh.and_then(|m| m.weights.as_ref()));
    weights.cloned().unwrap_or_default()
}

fn morphed(
    document: &Document,
    primitive: &Primitive,
    attribute: &str,
    weights: &[f64],
    count: usize,
) -> Result<Vec<DVec3>> {
    let mut shifts = Vec::new();
    for (target, &weight) in primitive.targets.iter().zip(weights) {
        let Some(&accessor) = target.get(attribute).filter(|_| weight != 0.0) else { continue };
        shifts.resize(count, DVec3::ZERO);
        let values = document.vectors(accessor, count)?;
        shifts.iter_mut().zip(values).for_each(|(shift, d)| *shift += d * weight);
    }
    Ok(shifts)
}

/// The transforms of a skin's joints, each with its inverse bind matrix.
pub(super) fn joint_matrices(document: &Document, globals: &[DMat4], skin: usize) -> Result<Vec<DMat4>> {
    let Some(skin_data) = document.root.skins.get(skin) else {
        return Err(document.damaged(format!("there is no skin {skin}")));
    };
    let binds = match skin_data.inverse_bind_matrices {
        Some(accessor) => document.numbers(accessor, 16)?,
        None => DMat4::IDENTITY.to_cols_array().repeat(skin_data.joints.len()),
    };
    if binds.len() < 16 * skin_data.joints.len() {
        let what = format!("skin {skin} has {} joints and {} matrices", skin_data.joints.len(), binds.len() / 16);
        return Err(document.damaged(what));
    }
    let joints = skin_data.joints.iter().zip(binds.chunks_exact(16));
    joints
        .map(|(&joint, bind)| {
            let global = globals.get(joint).ok_or_else(|| document.damaged(format!("there is no node {joint}")))?;
            Ok(*global * DMat4::from_cols_slice(bind))
        })
        .collect()
}

/// The joints and weights of the vertices of a primitive.
pub(super) struct VertexWeights {
    /// Joint and weight, `width` a vertex.
    pub(super) all: Vec<(u32, f64)>,
    pub(super) width: usize,
}

/// The joints and weights of a primitive as stored; `None` without any.
pub(super) fn influences(
    document: &Document,
    primitive: &Primitive,
    joints: usize,
    count: usize,
) -> Result<Option<VertexWeights>> {
    let sets = (0..SETS).map_while(|k| {
        let of = |name: &str| primitive.attributes.get(&format!("{name}_{k}")).copied();
        of("JOINTS").zip(of("WEIGHTS"))
    });
    let sets: Vec<(usize, usize)> = sets.collect();
    if sets.is_empty() {
        return Ok(None);
    }
    let width = 4 * sets.len();
    let mut all = vec![(0, 0.0); width * count];
    for (k, (joint, weight)) in sets.into_iter().enumerate() {
        let (of, by) = (document.numbers(joint, 4)?, document.numbers(weight, 4)?);
        if of.len() < 4 * count || by.len() < 4 * count {
            return Err(document.damaged(format!("accessors {joint} and {weight} end before the last vertex")));
        }
        for v in 0..count {
            for i in 0..4 {
                let (joint, weight) = (of[4 * v + i], by[4 * v + i]);
                let weight = if weight.is_finite() { weight.max(0.0) } else { 0.0 };
                if weight > 0.0 && !(joint < joints as f64) {
                    return Err(document.damaged(format!("vertex {v} follows joint {joint} of {joints}")));
                }
                all[width * v + 4 * k + i] = (if joint < joints as f64 { joint as u32 } else { 0 }, weight);
            }
        }
    }
    Ok(Some(VertexWeights { all, width }))
}

impl Skinning {
    fn new(
        document: &Document,
        globals: &[DMat4],
        skin: usize,
        primitive: &Primitive,
        count: usize,
        notes: &mut Notes,
    ) -> Result<Option<Self>> {
        let matrices = joint_matrices(document, globals, skin)?;
        let Some(mut weights) = influences(document, primitive, matrices.len(), count)? else {
            notes.say("a mesh with a skin has no weights: it stands where its node is".to_owned());
            return Ok(None);
        };
        if matrices.is_empty() {
            return Err(document.damaged(format!("skin {skin} has no joints")));
        }
        let mut loose = 0;
        for vertex in weights.all.chunks_exact_mut(weights.width) {
            let sum: f64 = vertex.iter().map(|i| i.1).sum();
            if sum > 0.0 {
                vertex.iter_mut().for_each(|i| i.1 /= sum);
            } else {
                vertex[0].1 = 1.0;
                loose += 1;
            }
        }
        if loose > 0 {
            notes.say(format!("{loose} vertices have no weight of any joint: they follow their first one"));
        }
        Ok(Some(Self { matrices, weights }))
    }

    fn matrix(&self, v: usize) -> DMat4 {
        let width = self.weights.width;
        let influences = &self.weights.all[width * v..width * (v + 1)];
        influences.iter().filter(|i| i.1 > 0.0).map(|&(joint, weight)| self.matrices[joint as usize] * weight).sum()
    }
}
