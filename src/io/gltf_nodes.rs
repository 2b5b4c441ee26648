//! Where the nodes of a scene stand, and which meshes are taken.

use glam::{DMat4, DQuat, DVec3};

use super::gltf_document::{Document, Node};
use super::source::Notes;
use crate::Result;

/// A mesh of the scene, and the node at which it is taken.
pub(super) struct Placed {
    pub(super) mesh: usize,
    pub(super) node: usize,
}

/// The meshes of the default scene in the order of the file's list of meshes, each at the first
/// node that shows it (depth first). A note names the other nodes.
pub(super) fn placed_meshes(document: &Document, notes: &mut Notes) -> Result<Vec<Placed>> {
    let root = &document.root;
    let mut users: Vec<Vec<usize>> = vec![Vec::new(); root.meshes.len()];
    for index in shown_nodes(document)? {
        if let Some(mesh) = root.nodes[index].mesh {
            let Some(users) = users.get_mut(mesh) else {
                return Err(document.damaged(format!("there is no mesh {mesh}")));
            };
            users.push(index);
        }
    }
    let hidden: Vec<usize> = (0..users.len()).filter(|&m| users[m].is_empty()).collect();
    if let (false, true) = (hidden.is_empty(), hidden.len() < users.len()) {
        let name = |m: &usize| match &root.meshes[*m].name {
            Some(name) => format!("{:?}", super::obj::shortened(name)),
            None => m.to_string(),
        };
        let listed: Vec<String> = hidden.iter().take(5).map(name).collect();
        let more = if hidden.len() > 5 { " ..." } else { "" };
        notes.say(format!("meshes that are not in the scene that is shown are not read: {}{more}", listed.join(", ")));
    }
    let mut placed = Vec::new();
    for (mesh, users) in users.iter().enumerate() {
        let Some((&node, others)) = users.split_first() else { continue };
        placed.push(Placed { mesh, node });
        if !others.is_empty() {
            let listed: Vec<String> = others.iter().take(5).map(|&n| node_name(document, n)).collect();
            let more = if others.len() > 5 { " ..." } else { "" };
            notes.say(format!(
                "mesh {mesh} is shown by {} nodes: it is taken at {}, not at {}{more}",
                users.len(),
                node_name(document, node),
                listed.join(", ")
            ));
        }
    }
    Ok(placed)
}

/// A node as messages name it.
pub(super) fn node_name(document: &Document, node: usize) -> String {
    match document.root.nodes.get(node).and_then(|n| n.name.as_deref()) {
        Some(name) => format!("node {node} ({:?})", super::obj::shortened(name)),
        None => format!("node {node}"),
    }
}

/// The nodes of the default scene, depth first; all nodes in a file without scenes.
fn shown_nodes(document: &Document) -> Result<Vec<usize>> {
    let root = &document.root;
    let parents = parents(document)?;
    let mut stack: Vec<usize> = match root.scenes.get(root.scene.unwrap_or(0)) {
        Some(scene) => scene.nodes.iter().rev().copied().collect(),
        None => (0..root.nodes.len()).rev().filter(|&n| parents[n].is_none()).collect(),
    };
    let mut seen = vec![false; root.nodes.len()];
    let mut shown = Vec::new();
    while let Some(index) = stack.pop() {
        let Some(node) = root.nodes.get(index) else {
            return Err(document.damaged(format!("there is no node {index}")));
        };
        if std::mem::replace(&mut seen[index], true) {
            return Err(document.damaged(format!("node {index} has two parents")));
        }
        shown.push(index);
        stack.extend(node.children.iter().rev());
    }
    Ok(shown)
}

/// The node above each node.
pub(super) fn parents(document: &Document) -> Result<Vec<Option<usize>>> {
    let nodes = &document.root.nodes;
    let mut parents = vec![None; nodes.len()];
    for (index, node) in nodes.iter().enumerate() {
        for &child in &node.children {
            let Some(parent) = parents.get_mut(child) else {
                return Err(document.damaged(format!("there is no node {child}")));
            };
            if parent.replace(index).is_some() {
                return Err(document.damaged(format!("node {child} has two parents")));
            }
        }
    }
    Ok(parents)
}

/// From the coordinates of each node to those of the scene. O(nodes).
pub(super) fn global_transforms(document: &Document) -> Result<Vec<DMat4>> {
    let nodes = &document.root.nodes;
    let parents = parents(document)?;
    let mut done: Vec<Option<DMat4>> = vec![None; nodes.len()];
    let mut way = Vec::new();
    for start in 0..nodes.len() {
        let mut at = Some(start);
        while let Some(n) = at.filter(|&n| done[n].is_none()) {
            if way.len() > nodes.len() {
                return Err(document.damaged(format!("node {start} is below itself")));
            }
            way.push(n);
            at = parents[n];
        }
        while let Some(n) = way.pop() {
            let above = parents[n].and_then(|p| done[p]).unwrap_or(DMat4::IDENTITY);
            done[n] = Some(above * local_transform(&nodes[n]));
        }
    }
    Ok(done.into_iter().map(Option::unwrap_or_default).collect())
}

fn local_transform(node: &Node) -> DMat4 {
    if let Some(matrix) = &node.matrix {
        return DMat4::from_cols_array(matrix);
    }
    let rotation = DQuat::from_array(node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
    // Rotations are stored in single precision.
    let rotation = if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
    let scale = DVec3::from(node.scale.unwrap_or([1.0; 3]));
    DMat4::from_scale_rotation_translation(scale, rotation, DVec3::from(node.translation.unwrap_or([0.0; 3])))
}
