//! Buffer views that meshoptimizer compressed, as gltfpack writes them.

use meshoptimizer_rs::codec::{
    decode_filter_color, decode_filter_exp, decode_filter_oct, decode_filter_quat, decode_index_buffer,
    decode_index_sequence, decode_vertex_buffer,
};
use meshoptimizer_rs::{Limits, Workspace};
use serde::Deserialize;

use super::{LARGEST, add_buffer, drop_extension, entry};
use crate::Result;
use crate::io::gltf_document::Document;

/// The names of the extension. That of Khronos has one filter more, and a newer codec.
pub(super) const NAMES: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// The extension of a buffer view.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Compressed {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: usize,
    count: usize,
    mode: String,
    filter: Option<String>,
}

/// Puts decompressed buffers in the place of those that the views of the document refer to.
pub(super) fn expand(document: &mut Document, name: &str) -> Result<()> {
    for k in 0..document.root.buffer_views.len() {
        let Some(view) = entry(&mut document.json, "bufferViews", k) else { continue };
        let Some(about) = view.get("extensions").and_then(|e| e.get(name)).cloned() else { continue };
        let fault = |document: &Document, what: &str| {
            document.damaged(format!("buffer view {k} is compressed ({name}) and cannot be decompressed: {what}"))
        };
        let about: Compressed = serde_json::from_value(about).map_err(|e| fault(document, &e.to_string()))?;
        // The numbers are there uncompressed, too, for readers without the extension.
        let plain = document.root.buffer_views[k].buffer;
        if plain != about.buffer && document.buffers.get(plain).is_some_and(Option::is_some) {
            if let Some(view) = entry(&mut document.json, "bufferViews", k) {
                drop_extension(view, name);
            }
            continue;
        }
        let source = document.buffers.get(about.buffer).and_then(|b| b.as_deref());
        let end = about.byte_offset.saturating_add(about.byte_length);
        let source = source.and_then(|b| b.get(about.byte_offset..end));
        let source = source.ok_or_else(|| fault(document, "its data reach beyond their buffer"))?;
        let bytes = decode(&about, source).map_err(|what| fault(document, &what))?;
        if bytes.len() != document.root.buffer_views[k].byte_length {
            return Err(fault(document, "it holds another number of bytes than the view says"));
        }
        let buffer = add_buffer(document, bytes);
        let Some(view) = entry(&mut document.json, "bufferViews", k) else { continue };
        view["buffer"] = buffer.into();
        view["byteOffset"] = 0.into();
        drop_extension(view, name);
    }
    Ok(())
}

/// The numbers of a view; what is wrong with them.
fn decode(about: &Compressed, source: &[u8]) -> std::result::Result<Vec<u8>, String> {
    let (count, stride) = (about.count, about.byte_stride);
    if count.saturating_mul(stride) > LARGEST {
        return Err(format!("{count} elements of {stride} bytes are more than a file holds"));
    }
    let limits = Limits { max_bytes: 2 * LARGEST, ..Limits::default() };
    let mut space = Workspace::new(limits);
    let said = |e: meshoptimizer_rs::Error| e.to_string();
    let mut bytes = match about.mode.as_str() {
        "ATTRIBUTES" => decode_vertex_buffer(count, stride, source, &mut space),
        "TRIANGLES" => decode_index_buffer(count, stride, source, &mut space),
        "INDICES" => decode_index_sequence(count, stride, source, &mut space),
        other => return Err(format!("the mode {other:?} is not known")),
    }
    .map_err(said)?;
    let filter = match about.filter.as_deref() {
        None | Some("NONE") => return Ok(bytes),
        Some("OCTAHEDRAL") => decode_filter_oct,
        Some("QUATERNION") => decode_filter_quat,
        Some("EXPONENTIAL") => decode_filter_exp,
        Some("COLOR") => decode_filter_color,
        Some(other) => return Err(format!("the filter {other:?} is not known")),
    };
    filter(&mut bytes, count, stride, &mut space).map_err(said)?;
    Ok(bytes)
}
