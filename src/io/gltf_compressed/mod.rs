//! Compressed parts of a glTF document made plain when it is read, so that all that reads, changes
//! or writes it meets plain buffers; what is written is not compressed.

mod draco;
mod meshopt;

use serde::Deserialize;
use serde_json::{Value, json};

use super::gltf_document::{Bytes, Document, Root};
use super::gltf_edit::{drop_extension, forget_extension};
use crate::Result;

/// The largest size of a buffer that is decompressed: beyond it a file is taken for damaged.
const LARGEST: usize = 1 << 30;

/// Decompresses buffer views (EXT_meshopt_compression, KHR_meshopt_compression) and primitives
/// (KHR_draco_mesh_compression), and takes the extensions off the document.
///
/// # Errors
/// [`crate::Error::Format`] for data that cannot be decompressed.
pub(super) fn expand(document: &mut Document) -> Result<()> {
    for name in [meshopt::NAMES[0], meshopt::NAMES[1], draco::NAME] {
        let lists = [&document.root.extensions_used, &document.root.extensions_required];
        if !lists.into_iter().flatten().any(|used| used == name) {
            continue;
        }
        if name == draco::NAME {
            draco::expand(document)?
        } else {
            meshopt::expand(document, name)?
        }
        forget_extension(&mut document.json, name);
        document.root = Root::deserialize(&document.json)
            .map_err(|e| document.damaged(format!("what is left without {name} is no glTF 2.0: {e}")))?;
        document.compression.push(name);
    }
    Ok(())
}

/// Adds a buffer; its number.
fn add_buffer(document: &mut Document, bytes: Vec<u8>) -> usize {
    document.byte_count += bytes.len();
    let entry = json!({"byteLength": bytes.len()});
    if let Some(buffers) = document.json["buffers"].as_array_mut() {
        buffers.push(entry);
    }
    document.buffers.push(Some(Bytes::from(bytes)));
    document.buffers.len() - 1
}

/// An entry of a list of the document's JSON, as an object; `None` where it is something else.
fn entry<'v>(json: &'v mut Value, list: &str, k: usize) -> Option<&'v mut Value> {
    json.get_mut(list)?.get_mut(k).filter(|value| value.is_object())
}

#[cfg(test)]
pub(super) mod tests;
