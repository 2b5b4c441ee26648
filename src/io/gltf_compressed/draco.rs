//! Primitives that Draco compressed.

use std::collections::{HashMap, HashSet};

use draco_core::{DataType, DecodeLimits, DecoderBuffer, Mesh, MeshDecoder, PointAttribute, PointIndex};
use serde::Deserialize;
use serde_json::json;

use super::{LARGEST, add_buffer, drop_extension, entry};
use crate::Result;
use crate::io::gltf_document::Document;
use crate::io::gltf_parts::{ARRAY, ELEMENTS, FLOAT, UNSIGNED_INT};

/// The name of the extension.
pub(super) const NAME: &str = "KHR_draco_mesh_compression";

/// The extension of a primitive.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Compressed {
    buffer_view: usize,
    /// Numbers of the attributes in the compressed data.
    attributes: HashMap<String, u32>,
}

/// Puts decompressed attributes and indices behind the accessors of the primitives.
pub(super) fn expand(document: &mut Document) -> Result<()> {
    // Accessors that have their data: primitives may share them.
    let mut done = HashSet::new();
    for mesh in 0..document.root.meshes.len() {
        for primitive in 0..document.root.meshes[mesh].primitives.len() {
            let about = document.root.meshes[mesh].primitives[primitive].extensions.remove(NAME);
            let Some(about) = about else { continue };
            // The numbers are there uncompressed, too, for readers without the extension.
            let positions = document.root.meshes[mesh].primitives[primitive].attributes.get("POSITION");
            if positions.is_some_and(|&k| document.accessor(k).is_ok_and(|a| a.buffer_view.is_some())) {
                release(document, mesh, primitive);
                continue;
            }
            let fault = |document: &Document, what: String| {
                document.damaged(format!(
                    "primitive {primitive} of mesh {mesh} is compressed ({NAME}) and cannot be decompressed: {what}"
                ))
            };
            let about: Compressed = serde_json::from_value(about).map_err(|e| fault(document, e.to_string()))?;
            let decoded = decode(document.view(about.buffer_view)?.0).map_err(|what| fault(document, what))?;
            let data = &document.root.meshes[mesh].primitives[primitive];
            let indices = data.indices.ok_or_else(|| fault(document, "it names no accessor of indices".into()))?;
            let mut names: Vec<(&String, &u32)> = about.attributes.iter().collect();
            names.sort();
            let (mut put, mut weights) = (Vec::new(), Vec::new());
            for (name, &id) in names {
                let accessor = data.attributes.get(name).copied();
                let (Some(k), Some(attribute)) = (accessor, decoded.attribute_by_unique_id(id)) else {
                    return Err(fault(document, format!("there is no {name}")));
                };
                let accessor = document.accessor(k)?;
                let bytes = values(attribute, decoded.num_points(), accessor.component_type, &accessor.shape);
                let bytes = bytes.ok_or_else(|| fault(document, format!("{name} does not fit accessor {k}")))?;
                let floats = accessor.component_type == FLOAT && accessor.shape == "VEC4";
                if name.starts_with("WEIGHTS_") && floats {
                    weights.push((k, bytes));
                } else {
                    put.push((k, bytes, accessor.component_type, decoded.num_points(), ARRAY));
                }
            }
            share_out(&mut weights);
            put.extend(weights.into_iter().map(|(k, bytes)| (k, bytes, FLOAT, decoded.num_points(), ARRAY)));
            let corners = decoded.faces().iter().flatten().flat_map(|p| p.0.to_le_bytes()).collect();
            put.push((indices, corners, UNSIGNED_INT, 3 * decoded.num_faces(), ELEMENTS));
            for (k, bytes, component, count, target) in put {
                if done.insert(k) {
                    fill(document, k, bytes, component, count, target);
                }
            }
            if let Some(primitive) = release(document, mesh, primitive) {
                // Strips are decompressed into triangles.
                primitive["mode"] = 4.into();
            }
        }
    }
    Ok(())
}

/// Takes the extension off a primitive, which is returned.
fn release(document: &mut Document, mesh: usize, primitive: usize) -> Option<&mut serde_json::Value> {
    let primitive = entry(&mut document.json, "meshes", mesh)?.get_mut("primitives")?.get_mut(primitive)?;
    drop_extension(primitive, NAME);
    Some(primitive)
}

/// The mesh of compressed data; what is wrong with them.
fn decode(bytes: &[u8]) -> std::result::Result<Mesh, String> {
    let limits = DecodeLimits::default().with_max_decoded_bytes(LARGEST as u64);
    let mut mesh = Mesh::new();
    let mut buffer = DecoderBuffer::new(bytes).with_limits(limits);
    MeshDecoder::new().decode(&mut buffer, &mut mesh).map_err(|e| e.to_string())?;
    Ok(mesh)
}

/// The values of an attribute for all points, as an accessor has them; `None` where it has another
/// kind of numbers.
fn values(attribute: &PointAttribute, points: usize, component: u32, shape: &str) -> Option<Vec<u8>> {
    let width = match shape {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" => 4,
        _ => return None,
    };
    if usize::from(attribute.num_components()) != width {
        return None;
    }
    if component == FLOAT {
        return Some(attribute.read_f32s(points, width).iter().flat_map(|x| x.to_le_bytes()).collect());
    }
    let (from, to) = (size_of(attribute.data_type())?, [1, 1, 2, 2, 0, 4].get(component.checked_sub(5120)? as usize)?);
    let (data, stride) = (attribute.buffer().data(), usize::try_from(attribute.byte_stride()).ok()?);
    let mut bytes = Vec::with_capacity(points * width * to);
    for point in 0..points as u32 {
        let at = (attribute.mapped_index(PointIndex(point)).0 as usize).checked_mul(stride)?;
        for number in data.get(at..at.checked_add(width * from)?)?.chunks_exact(from) {
            // Whole numbers, from the least significant byte on.
            let mut wide = [0; 4];
            wide[..from].copy_from_slice(number);
            bytes.extend_from_slice(&wide[..*to]);
        }
    }
    Some(bytes)
}

/// Makes the weights of each vertex, in all sets, sum to one, as the format asks: quantisation
/// takes that from them.
fn share_out(sets: &mut [(usize, Vec<u8>)]) {
    let vertices = sets.iter().map(|s| s.1.len() / 16).min().unwrap_or(0);
    for v in 0..vertices {
        let four = |bytes: &[u8]| [0, 1, 2, 3].map(|c| f32_at(&bytes[16 * v..16 * v + 16], c));
        let sum: f32 = sets.iter().flat_map(|s| four(&s.1)).sum();
        if !(sum > 0.0 && sum.is_finite()) {
            continue;
        }
        for (_, bytes) in &mut *sets {
            let shares: Vec<u8> = four(bytes).iter().flat_map(|w| (w / sum).to_le_bytes()).collect();
            bytes[16 * v..16 * v + 16].copy_from_slice(&shares);
        }
    }
}

/// Bytes of a whole number; `None` of others.
fn size_of(kind: DataType) -> Option<usize> {
    match kind {
        DataType::Int8 | DataType::Uint8 | DataType::Bool => Some(1),
        DataType::Int16 | DataType::Uint16 => Some(2),
        DataType::Int32 | DataType::Uint32 => Some(4),
        _ => None,
    }
}

/// Gives accessor `k` its data.
fn fill(document: &mut Document, k: usize, mut bytes: Vec<u8>, component: u32, count: usize, target: u32) {
    let width = bytes.len() / count.max(1);
    let aligned = width.next_multiple_of(4);
    let mut view = json!({"byteLength": bytes.len(), "target": target});
    // Attributes of vertices begin at multiples of four bytes.
    if target == ARRAY && aligned != width {
        bytes = bytes.chunks_exact(width).flat_map(|e| e.iter().copied().chain(vec![0; aligned - width])).collect();
        view["byteLength"] = bytes.len().into();
        view["byteStride"] = aligned.into();
    }
    // The bounds are those of the numbers before compression, which the decompressed ones may
    // leave.
    let floats = |c: usize| bytes.chunks_exact(width).map(move |e| f32_at(e, c));
    let bounds = (component == FLOAT).then(|| {
        let column = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..width / 4).map(|c| floats(c).reduce(pick).unwrap_or(0.0)).collect()
        };
        (column(f32::min), column(f32::max))
    });
    view["buffer"] = add_buffer(document, bytes).into();
    let number = document.json["bufferViews"].as_array_mut().map_or(0, |views| {
        views.push(view);
        views.len() - 1
    });
    let Some(accessor) = entry(&mut document.json, "accessors", k) else { return };
    accessor["bufferView"] = number.into();
    accessor["componentType"] = component.into();
    accessor["count"] = count.into();
    accessor["byteOffset"] = 0.into();
    match bounds.filter(|_| accessor.get("min").is_some()) {
        Some((low, high)) => (accessor["min"], accessor["max"]) = (json!(low), json!(high)),
        None => {
            if let Some(accessor) = accessor.as_object_mut() {
                accessor.remove("min");
                accessor.remove("max");
            }
        }
    }
}

fn f32_at(element: &[u8], component: usize) -> f32 {
    element.get(4 * component..4 * component + 4).map_or(0.0, |b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
}
