//! glTF 2.0 as data: the part of the JSON that describes surfaces, the buffers, and bounds-checked access to their numbers.
//!
//! Every index and length of the JSON is checked where it is used, and nothing is allocated beyond what the buffers hold, so that damaged files
//! end in an error with the place.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use serde::Deserialize;
use serde_json::Value;

use super::locate::{Located, locate, percent_decoded};
use super::source;
use crate::{Error, Result};

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(crate) struct Root {
    pub(crate) extensions_required: Vec<String>,
    pub(crate) scene: Option<usize>,
    pub(crate) scenes: Vec<Scene>,
    pub(crate) nodes: Vec<Node>,
    pub(crate) meshes: Vec<MeshData>,
    pub(crate) materials: Vec<MaterialData>,
    pub(crate) textures: Vec<Texture>,
    pub(crate) samplers: Vec<Sampler>,
    pub(crate) images: Vec<Image>,
    accessors: Vec<Accessor>,
    buffer_views: Vec<View>,
    buffers: Vec<Buffer>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Scene {
    pub(crate) nodes: Vec<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Node {
    pub(crate) name: Option<String>,
    pub(crate) children: Vec<usize>,
    pub(crate) mesh: Option<usize>,
    pub(crate) skin: Option<usize>,
    pub(crate) matrix: Option<[f64; 16]>,
    pub(crate) translation: Option<[f64; 3]>,
    pub(crate) rotation: Option<[f64; 4]>,
    pub(crate) scale: Option<[f64; 3]>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct MeshData {
    pub(crate) name: Option<String>,
    pub(crate) primitives: Vec<Primitive>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Primitive {
    pub(crate) attributes: HashMap<String, usize>,
    pub(crate) indices: Option<usize>,
    pub(crate) material: Option<usize>,
    pub(crate) mode: Option<u32>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(crate) struct MaterialData {
    pub(crate) name: Option<String>,
    pub(crate) pbr_metallic_roughness: Option<Pbr>,
    pub(crate) normal_texture: Option<TextureUse>,
    pub(crate) occlusion_texture: Option<TextureUse>,
    pub(crate) emissive_texture: Option<TextureUse>,
    pub(crate) emissive_factor: Option<[f32; 3]>,
    pub(crate) alpha_mode: Option<String>,
    pub(crate) alpha_cutoff: Option<f32>,
    pub(crate) double_sided: bool,
    pub(crate) extensions: HashMap<String, Value>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(crate) struct Pbr {
    pub(crate) base_color_factor: Option<[f32; 4]>,
    pub(crate) base_color_texture: Option<TextureUse>,
    pub(crate) metallic_factor: Option<f32>,
    pub(crate) roughness_factor: Option<f32>,
    pub(crate) metallic_roughness_texture: Option<TextureUse>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(crate) struct TextureUse {
    pub(crate) index: usize,
    pub(crate) tex_coord: usize,
    /// Of normals.
    pub(crate) scale: Option<f32>,
    /// Of occlusion.
    pub(crate) strength: Option<f32>,
    pub(crate) extensions: HashMap<String, Value>,
}

impl TextureUse {
    /// The set of texture coordinates that it uses; KHR_texture_transform may name another one.
    pub(crate) fn set(&self) -> usize {
        let moved = self.extensions.get("KHR_texture_transform").and_then(|t| t["texCoord"].as_u64());
        moved.map_or(self.tex_coord, |s| s as usize)
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Texture {
    pub(crate) source: Option<usize>,
    pub(crate) sampler: Option<usize>,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(crate) struct Sampler {
    pub(crate) wrap_s: Option<u32>,
    pub(crate) wrap_t: Option<u32>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(crate) struct Image {
    pub(crate) uri: Option<String>,
    pub(crate) buffer_view: Option<usize>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Accessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: usize,
    component_type: u32,
    count: usize,
    #[serde(rename = "type")]
    shape: String,
    #[serde(default)]
    normalized: bool,
    sparse: Option<Sparse>,
}

#[derive(Debug, Deserialize)]
struct Sparse {
    count: usize,
    indices: SparseIndices,
    values: SparseValues,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct SparseIndices {
    buffer_view: usize,
    #[serde(default)]
    byte_offset: usize,
    component_type: u32,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct SparseValues {
    buffer_view: usize,
    #[serde(default)]
    byte_offset: usize,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct View {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: Option<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Buffer {
    uri: Option<String>,
}

/// The JSON with the bytes of its buffers.
pub(crate) struct Document<'a> {
    pub(crate) root: Root,
    buffers: Vec<Option<Cow<'a, [u8]>>>,
    /// Bytes of the file and its buffers, the measure of what it may expand to.
    pub(crate) byte_count: usize,
    path: &'a Path,
}

impl<'a> Document<'a> {
    /// Parses `.glb` or `.gltf` content and loads the buffers.
    pub(crate) fn parse(bytes: &'a [u8], path: &'a Path) -> Result<Self> {
        let (json, binary) = if bytes.starts_with(b"glTF") { split(bytes, path)? } else { (bytes, None) };
        let root: Root = serde_json::from_slice(json).map_err(|e| {
            let what = format!("the JSON is not that of a glTF 2.0 file: {e}");
            Error::format(path, None, what, "The file is damaged: export the model again")
        })?;
        let mut document = Self { root, buffers: Vec::new(), byte_count: bytes.len(), path };
        document.check_extensions()?;
        let mut files: HashMap<String, usize> = HashMap::new();
        for k in 0..document.root.buffers.len() {
            let loaded = match document.root.buffers[k].uri.as_deref() {
                None => (k == 0).then_some(binary).flatten().map(Cow::Borrowed),
                // The same file again is the same buffer: a list of one file a million times is not loaded a million times.
                Some(uri) if files.contains_key(uri) => {
                    let what = format!("buffers {} and {k} are the same file {uri:?}", files[uri]);
                    return Err(document.error(what, "Export the model again, best as .glb"));
                }
                Some(uri) => {
                    let bytes = document.resource(uri)?;
                    files.insert(uri.to_owned(), k);
                    document.byte_count += bytes.len();
                    Some(Cow::Owned(bytes))
                }
            };
            document.buffers.push(loaded);
        }
        Ok(document)
    }

    pub(crate) fn error(&self, what: impl Into<String>, remedy: &str) -> Error {
        Error::format(self.path, None, what, remedy)
    }

    fn damaged(&self, what: impl Into<String>) -> Error {
        self.error(what, "The file is damaged or incomplete: export the model again")
    }

    fn check_extensions(&self) -> Result<()> {
        for name in &self.root.extensions_required {
            let known = ["KHR_mesh_quantization", "KHR_texture_transform", "KHR_lights_punctual"].contains(&&**name)
                || name.starts_with("KHR_materials_");
            if name.contains("draco") || name.contains("meshopt") {
                let what = format!("the mesh is compressed ({name})");
                return Err(self.error(what, "Export it without compression"));
            }
            if !known {
                let what = format!("the file needs the extension {name:?}, which is not read");
                return Err(self.error(what, "Export it without that extension"));
            }
        }
        Ok(())
    }

    /// The bytes a URI stands for: embedded as base64, or a file beside this one.
    fn resource(&self, uri: &str) -> Result<Vec<u8>> {
        if let Some(data) = uri.strip_prefix("data:") {
            let decoded = data.split_once(";base64,").and_then(|(_, text)| base64(text.as_bytes()));
            return decoded.ok_or_else(|| self.damaged("embedded data is not valid base64"));
        }
        source::read_all(self.file(uri)?.path())
    }

    /// The file a URI names, with its percent codes or without them.
    pub(crate) fn file(&self, uri: &str) -> Result<Located> {
        if uri.contains("://") && !uri.to_ascii_lowercase().starts_with("file:") {
            let what = format!("it refers to {:?}", super::obj::shortened(uri));
            return Err(self.error(what, "Download that file and refer to it by its name"));
        }
        let decoded = locate(self.path, &percent_decoded(uri.as_bytes()));
        Ok(if decoded.is_missing() {
            Some(locate(self.path, uri.as_bytes())).filter(|l| !l.is_missing()).unwrap_or(decoded)
        } else {
            decoded
        })
    }

    /// The encoded bytes of image `k`, if the file holds them itself.
    pub(crate) fn embedded_image(&self, k: usize) -> Result<Option<Arc<[u8]>>> {
        let Some(image) = self.root.images.get(k) else {
            return Err(self.damaged(format!("there is no image {k}")));
        };
        match (&image.buffer_view, &image.uri) {
            (Some(view), _) => Ok(Some(self.view(*view)?.0.into())),
            (None, Some(uri)) if uri.starts_with("data:") => Ok(Some(self.resource(uri)?.into())),
            _ => Ok(None),
        }
    }

    /// The bytes of a buffer view and its stride.
    fn view(&self, k: usize) -> Result<(&[u8], Option<usize>)> {
        let view = self.root.buffer_views.get(k).ok_or_else(|| self.damaged(format!("there is no buffer view {k}")))?;
        let buffer = self.buffers.get(view.buffer).and_then(|b| b.as_deref());
        let buffer = buffer.ok_or_else(|| self.damaged(format!("buffer {} has no data", view.buffer)))?;
        let end = view.byte_offset.checked_add(view.byte_length);
        let bytes = end.and_then(|end| buffer.get(view.byte_offset..end)).ok_or_else(|| {
            let what = format!("buffer view {k} reaches beyond the {} bytes of buffer {}", buffer.len(), view.buffer);
            self.damaged(what)
        })?;
        Ok((bytes, view.byte_stride))
    }

    /// All numbers of accessor `k`, `components` an element.
    pub(crate) fn numbers(&self, k: usize, components: usize) -> Result<Vec<f64>> {
        let accessor = self.root.accessors.get(k).ok_or_else(|| self.damaged(format!("there is no accessor {k}")))?;
        let declared = match accessor.shape.as_str() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 0,
        };
        if declared != components {
            let what = format!("accessor {k} is a {:?}, {components} numbers an element are needed", accessor.shape);
            return Err(self.damaged(what));
        }
        let mut values = match accessor.buffer_view {
            Some(view) => self.elements(k, view, accessor.byte_offset, accessor.count, components, accessor)?,
            None if accessor.sparse.is_some() && accessor.count <= self.byte_count => {
                vec![0.0; accessor.count * components]
            }
            None => return Err(self.damaged(format!("accessor {k} has no data"))),
        };
        if let Some(sparse) = &accessor.sparse {
            let indices = Accessor {
                buffer_view: None,
                byte_offset: 0,
                component_type: sparse.indices.component_type,
                count: sparse.count,
                shape: String::new(),
                normalized: false,
                sparse: None,
            };
            let SparseIndices { buffer_view, byte_offset, .. } = sparse.indices;
            let at = self.elements(k, buffer_view, byte_offset, sparse.count, 1, &indices)?;
            let SparseValues { buffer_view, byte_offset } = sparse.values;
            let new = self.elements(k, buffer_view, byte_offset, sparse.count, components, accessor)?;
            for (index, value) in at.iter().zip(new.chunks_exact(components)) {
                let start = (*index as usize).saturating_mul(components);
                let slot = values.get_mut(start..start.saturating_add(components));
                slot.ok_or_else(|| self.damaged(format!("accessor {k} replaces an element it does not have")))?
                    .copy_from_slice(value);
            }
        }
        Ok(values)
    }

    fn elements(
        &self,
        k: usize,
        view: usize,
        offset: usize,
        count: usize,
        components: usize,
        kind: &Accessor,
    ) -> Result<Vec<f64>> {
        let (bytes, stride) = self.view(view)?;
        let size = match kind.component_type {
            5120 | 5121 => 1,
            5122 | 5123 => 2,
            5125 | 5126 => 4,
            other => return Err(self.damaged(format!("accessor {k} has the unknown component type {other}"))),
        };
        let width = size * components;
        let stride = stride.unwrap_or(width);
        if count == 0 {
            return Ok(Vec::new());
        }
        // A stride below the element's width would let a small buffer hold a huge accessor.
        let end = (count - 1).checked_mul(stride).and_then(|n| n.checked_add(offset)?.checked_add(width));
        if stride < width || end.is_none_or(|end| end > bytes.len()) {
            let what = format!("accessor {k} reaches beyond the {} bytes of buffer view {view}", bytes.len());
            return Err(self.damaged(what));
        }
        let scale = |x: f64, most: f64| if kind.normalized { (x / most).max(-1.0) } else { x };
        let read = |b: &[u8]| match kind.component_type {
            5120 => scale(f64::from(b[0] as i8), 127.0),
            5121 => scale(f64::from(b[0]), 255.0),
            5122 => scale(f64::from(i16::from_le_bytes([b[0], b[1]])), 32767.0),
            5123 => scale(f64::from(u16::from_le_bytes([b[0], b[1]])), 65535.0),
            5125 => f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
            _ => f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        };
        let mut values = Vec::with_capacity(count * components);
        for element in 0..count {
            let start = offset + element * stride;
            values.extend(bytes[start..start + width].chunks_exact(size).map(read));
        }
        Ok(values)
    }
}

/// The JSON and binary chunks of a GLB container.
fn split<'a>(bytes: &'a [u8], path: &Path) -> Result<(&'a [u8], Option<&'a [u8]>)> {
    let remedy = "The file is damaged or cut short: export the model again";
    let word = |at: usize| -> Option<u32> { Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?)) };
    match word(4) {
        Some(2) => {}
        Some(version) => {
            let what = format!("glTF version {version} is not read");
            return Err(Error::format(path, None, what, "Export the model as glTF 2.0"));
        }
        None => return Err(Error::format(path, None, "the header is cut short", remedy)),
    }
    let mut at = 12;
    let (mut json, mut binary) = (None, None);
    while let (Some(length), Some(kind)) = (word(at), word(at + 4)) {
        let end = (at + 8).saturating_add(length as usize);
        let Some(chunk) = bytes.get(at + 8..end) else {
            let what = format!("a chunk of {length} bytes reaches beyond the end of the file");
            return Err(Error::format(path, None, what, remedy));
        };
        match kind {
            0x4e4f_534a if json.is_none() => json = Some(chunk),
            0x004e_4942 if binary.is_none() => binary = Some(chunk),
            _ => {}
        }
        at = end.next_multiple_of(4);
    }
    let json = json.ok_or_else(|| Error::format(path, None, "the JSON chunk is missing", remedy))?;
    Ok((json, binary))
}

/// Decodes standard base64, with or without padding; `None` on any other character.
fn base64(text: &[u8]) -> Option<Vec<u8>> {
    let text = text.trim_ascii();
    let text = text.strip_suffix(b"==").or_else(|| text.strip_suffix(b"=")).unwrap_or(text);
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3 + 2);
    let (mut bits, mut held) = (0u32, 0);
    for &c in text {
        let value = match c {
            b'A'..=b'Z' => c - b'A',
            b'a'..=b'z' => c - b'a' + 26,
            b'0'..=b'9' => c - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        };
        bits = bits << 6 | u32::from(value);
        held += 6;
        if held >= 8 {
            held -= 8;
            bytes.push((bits >> held) as u8);
        }
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_and_percent_codes() {
        assert_eq!(base64(b"aGVsbG8=").as_deref(), Some(&b"hello"[..]));
        assert_eq!(base64(b"aGVsbG8h").as_deref(), Some(&b"hello!"[..]));
        assert_eq!(base64(b"a*"), None);
        assert_eq!(percent_decoded(b"a%20b%zz%e4%bd%a0%"), "a b%zz\u{4f60}%".as_bytes());
    }
}
