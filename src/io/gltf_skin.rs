//! Skin weights as a table: a column for each joint, a row for each vertex of the mesh.

use std::collections::HashMap;

use super::gltf_pose::influences;
use super::gltf_scene::GltfScene;
use crate::Result;

/// The weights of the skins of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct SkinTable {
    /// The node of each joint in the file.
    pub joints: Vec<usize>,
    /// The name of each joint: that of its node, with the node's number where names repeat or are
    /// missing.
    pub names: Vec<String>,
    /// A weight for each joint, vertex after vertex; those of a vertex sum to one, or are all zero
    /// where it has none.
    pub weights: Vec<f64>,
}

impl GltfScene {
    /// The weights by which the vertices of the mesh follow joints; `None` for a file without
    /// skins.
    ///
    /// Joints come in the order of the skins, each once. O(vertices x joints) memory.
    ///
    /// # Errors
    /// [`crate::Error::Format`] for damaged data.
    pub fn skin_weights(&self) -> Result<Option<SkinTable>> {
        let root = &self.document.root;
        let mut column: HashMap<usize, usize> = HashMap::new();
        let mut joints = Vec::new();
        let skins = self.parts.iter().filter_map(|p| root.skins.get(root.nodes[p.node].skin?));
        for &joint in skins.flat_map(|s| &s.joints) {
            column.entry(joint).or_insert_with(|| {
                joints.push(joint);
                joints.len() - 1
            });
        }
        if joints.is_empty() {
            return Ok(None);
        }
        let vertices = self.parts.last().map_or(0, |p| p.first_vertex + p.vertices);
        let mut weights = vec![0.0; vertices * joints.len()];
        for part in &self.parts {
            let Some(skin) = root.nodes[part.node].skin.and_then(|s| root.skins.get(s)) else { continue };
            let primitive = &root.meshes[part.mesh].primitives[part.primitive];
            let found = influences(&self.document, primitive, skin.joints.len(), part.vertices)?;
            let Some(found) = found else { continue };
            for (v, vertex) in found.all.chunks_exact(found.width).enumerate() {
                let sum: f64 = vertex.iter().map(|i| i.1).sum();
                let row = &mut weights[(part.first_vertex + v) * joints.len()..][..joints.len()];
                for &(joint, weight) in vertex.iter().filter(|i| i.1 > 0.0) {
                    row[column[&skin.joints[joint as usize]]] += weight / sum;
                }
            }
        }
        let names = self.joint_names(&joints);
        Ok(Some(SkinTable { joints, names, weights }))
    }

    fn joint_names(&self, joints: &[usize]) -> Vec<String> {
        let own = |j: usize| self.document.root.nodes.get(j).and_then(|n| n.name.clone()).filter(|n| !n.is_empty());
        let mut count: HashMap<String, usize> = HashMap::new();
        joints.iter().filter_map(|&j| own(j)).for_each(|name| *count.entry(name).or_default() += 1);
        let name = |&j: &usize| match own(j) {
            Some(name) if count.get(&name) == Some(&1) => name,
            Some(name) => format!("{name}.{j}"),
            None => format!("joint{j}"),
        };
        joints.iter().map(name).collect()
    }
}
