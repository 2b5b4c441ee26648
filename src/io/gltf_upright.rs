//! Binary glTF from meshes that are z up: the format is y up, so a node above each root turns what
//! is below it.

use std::borrow::Cow;

use serde_json::{Value, json};

use crate::geometry::UpAxis;
use crate::{Error, Result};

/// Bytes of the container's header and of the header of its first chunk.
const HEAD: usize = 20;

/// `glb` with everything in it turned to y up; positions, animations and skins stay as they are.
/// With y up already, it is returned as it is.
///
/// # Errors
/// [`Error::Input`] if it is not the content of a GLB file, or would exceed the format's 4 GiB.
pub fn turned_upright(glb: &[u8], up: UpAxis) -> Result<Cow<'_, [u8]>> {
    if up == UpAxis::Y {
        return Ok(glb.into());
    }
    let fail = || Error::input("what is to be turned upright is no GLB", "Give the content of a GLB file");
    let length = glb.get(12..16).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes).ok_or_else(fail)? as usize;
    let text = glb.get(HEAD..HEAD + length).filter(|_| glb.starts_with(b"glTF")).ok_or_else(fail)?;
    let mut document: Value = serde_json::from_slice(text).map_err(|_| fail())?;
    turn(&mut document, up);
    let mut text = document.to_string().into_bytes();
    // Chunks end on multiples of four bytes, JSON with blanks.
    text.resize(text.len().next_multiple_of(4), b' ');
    let rest = &glb[HEAD + length..];
    let size = |bytes: usize| {
        u32::try_from(bytes)
            .map_err(|_| Error::input("the GLB would exceed 4 GiB", "Write fewer frames or a smaller mesh"))
    };
    let mut out = Vec::with_capacity(HEAD + text.len() + rest.len());
    out.extend_from_slice(&glb[..8]);
    out.extend(size(HEAD + text.len() + rest.len())?.to_le_bytes());
    out.extend(size(text.len())?.to_le_bytes());
    out.extend_from_slice(&glb[16..HEAD]);
    out.extend(text);
    out.extend_from_slice(rest);
    Ok(out.into())
}

/// Puts a node above each root of the scenes. Roots that scenes share keep one node above them: a
/// node has one parent.
fn turn(document: &mut Value, up: UpAxis) {
    let rotation = up.to_y().to_array();
    let mut above: Vec<(u64, u64)> = Vec::new();
    let mut nodes = document["nodes"].as_array().cloned().unwrap_or_default();
    for scene in document.get_mut("scenes").and_then(Value::as_array_mut).into_iter().flatten() {
        for root in scene.get_mut("nodes").and_then(Value::as_array_mut).into_iter().flatten() {
            let Some(old) = root.as_u64() else { continue };
            let new = above.iter().find(|a| a.0 == old).map(|a| a.1).unwrap_or_else(|| {
                nodes.push(json!({"name": "z up to y up", "rotation": rotation, "children": [old]}));
                above.push((old, nodes.len() as u64 - 1));
                nodes.len() as u64 - 1
            });
            *root = json!(new);
        }
    }
    if !nodes.is_empty() {
        document["nodes"] = nodes.into();
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Mat4, Vec3};

    use super::*;
    use crate::io::gltf_write::glb_bytes;
    use crate::models::shapes::uv_sphere;

    #[test]
    fn z_up_meshes_stand_in_a_y_up_world() {
        let mut mesh = uv_sphere(1.0, 8, 6);
        mesh.positions.iter_mut().for_each(|p| *p = UpAxis::Z.from_y(*p * DVec3::new(1.0, 3.0, 0.5)));
        let plain = glb_bytes(&mesh, &[]).unwrap();
        assert_eq!(turned_upright(&plain, UpAxis::Y).unwrap(), plain);
        let turned = turned_upright(&plain, UpAxis::Z).unwrap();
        let (before, _, _) = gltf::import_slice(&plain).unwrap();
        let (document, buffers, _) = gltf::import_slice(&turned).unwrap();
        let root = document.default_scene().or(document.scenes().next()).unwrap().nodes().next().unwrap();
        let node = root.children().next().unwrap();
        let place =
            Mat4::from_cols_array_2d(&root.transform().matrix()) * Mat4::from_cols_array_2d(&node.transform().matrix());
        let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
        let positions = primitive.reader(|b| Some(&buffers[b.index()])).read_positions().unwrap();
        let heights: Vec<f32> = positions.map(|p| place.transform_point3(Vec3::from(p)).y).collect();
        let (low, high) = heights.iter().fold((f32::MAX, f32::MIN), |(l, h), y| (l.min(*y), h.max(*y)));
        assert!((low + 3.0).abs() < 1e-5 && (high - 3.0).abs() < 1e-5, "{low} {high}");
        assert_eq!(document.nodes().count(), before.nodes().count() + 1);
        assert!(turned_upright(b"no glb", UpAxis::Z).is_err() && turned_upright(&[], UpAxis::Z).is_err());
    }

    #[test]
    fn every_root_is_turned_once() {
        let mut document = json!({
            "scenes": [{"nodes": [0, 2]}, {"nodes": [2]}, {}],
            "nodes": [{"children": [1]}, {"name": "inner"}, {"mesh": 0}],
        });
        turn(&mut document, UpAxis::Z);
        let nodes = document["nodes"].as_array().unwrap();
        assert_eq!(nodes.len(), 5);
        let roots = |k: usize| &document["scenes"][k]["nodes"];
        assert_eq!((roots(0), roots(1), &document["scenes"][2]), (&json!([3, 4]), &json!([4]), &json!({})));
        assert_eq!((&nodes[3]["children"], &nodes[4]["children"]), (&json!([0]), &json!([2])));
        assert!((nodes[3]["rotation"][0].as_f64().unwrap() + std::f64::consts::FRAC_1_SQRT_2).abs() < 1e-12);
    }
}
