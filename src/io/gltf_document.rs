//! glTF 2.0 as data: the part of the JSON that describes surfaces, the buffers, and bounds-checked
//! access to their numbers.
//!
//! Every index and length of the JSON is checked where it is used, and nothing is allocated beyond
//! what the buffers hold, so that damaged files end in an error with the place.

use std::collections::HashMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;
use serde::Deserialize;
use serde_json::Value;

use super::gltf_container::{base64, split};
use super::locate::{Located, locate, percent_decoded};
use super::{gltf_compressed, gltf_extensions, source};
use crate::{Error, Result};

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(crate) struct Root {
    pub(crate) extensions_used: Vec<String>,
    pub(crate) extensions_required: Vec<String>,
    pub(crate) scene: Option<usize>,
    pub(crate) scenes: Vec<Scene>,
    pub(crate) nodes: Vec<Node>,
    pub(crate) meshes: Vec<MeshData>,
    pub(crate) materials: Vec<MaterialData>,
    pub(crate) textures: Vec<Texture>,
    pub(crate) samplers: Vec<Sampler>,
    pub(crate) images: Vec<Image>,
    pub(crate) skins: Vec<Skin>,
    pub(crate) accessors: Vec<Accessor>,
    pub(crate) buffer_views: Vec<View>,
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
    /// Of morph targets; the mesh's own where they are left out.
    pub(crate) weights: Option<Vec<f64>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(crate) struct Skin {
    pub(crate) inverse_bind_matrices: Option<usize>,
    pub(crate) joints: Vec<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct MeshData {
    pub(crate) name: Option<String>,
    pub(crate) primitives: Vec<Primitive>,
    /// Of morph targets.
    pub(crate) weights: Option<Vec<f64>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Primitive {
    pub(crate) attributes: HashMap<String, usize>,
    pub(crate) targets: Vec<HashMap<String, usize>>,
    pub(crate) indices: Option<usize>,
    pub(crate) material: Option<usize>,
    pub(crate) mode: Option<u32>,
    pub(crate) extensions: HashMap<String, Value>,
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
pub(crate) struct Accessor {
    pub(crate) buffer_view: Option<usize>,
    #[serde(default)]
    pub(crate) byte_offset: usize,
    pub(crate) component_type: u32,
    pub(crate) count: usize,
    #[serde(rename = "type")]
    pub(crate) shape: String,
    #[serde(default)]
    pub(crate) normalized: bool,
    pub(crate) sparse: Option<Sparse>,
}

#[derive(Debug, Deserialize)]
pub(crate) struct Sparse {
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
pub(crate) struct View {
    pub(crate) buffer: usize,
    #[serde(default)]
    pub(crate) byte_offset: usize,
    pub(crate) byte_length: usize,
    pub(crate) byte_stride: Option<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Buffer {
    uri: Option<String>,
}

/// A part of bytes that several owners share.
#[derive(Clone, Debug)]
pub(crate) struct Bytes {
    data: Arc<Vec<u8>>,
    range: Range<usize>,
}

impl From<Vec<u8>> for Bytes {
    fn from(data: Vec<u8>) -> Self {
        let range = 0..data.len();
        Self { data: Arc::new(data), range }
    }
}

impl std::ops::Deref for Bytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.data[self.range.clone()]
    }
}

/// The JSON with the bytes of its buffers.
#[derive(Debug)]
pub(crate) struct Document {
    /// All of the JSON, for writing.
    pub(crate) json: Value,
    /// What is read of it.
    pub(crate) root: Root,
    pub(crate) buffers: Vec<Option<Bytes>>,
    /// Bytes of the file and its buffers, the measure of what it may expand to.
    pub(crate) byte_count: usize,
    pub(crate) path: PathBuf,
    /// The extensions that compressed it, which are gone.
    pub(crate) compression: Vec<&'static str>,
}

impl Document {
    /// Parses `.glb` or `.gltf` content and loads the buffers.
    pub(crate) fn parse(bytes: Vec<u8>, path: &Path) -> Result<Self> {
        let bytes = Bytes::from(bytes);
        let (json, binary) =
            if bytes.starts_with(b"glTF") { split(&bytes, path)? } else { (bytes.range.clone(), None) };
        let text = &bytes[json];
        let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
        let not_gltf = |e: serde_json::Error| {
            let what = format!("the JSON is not that of a glTF 2.0 file: {e}");
            Error::format(path, None, what, "The file is damaged: export the model again")
        };
        let json: Value = serde_json::from_slice(text).map_err(not_gltf)?;
        let root = Root::deserialize(&json).map_err(not_gltf)?;
        let (byte_count, path) = (bytes.len(), path.to_owned());
        let mut document = Self { json, root, buffers: Vec::new(), byte_count, path, compression: Vec::new() };
        document.check_extensions()?;
        // The same file again is the same buffer: a list of one file a million times is not loaded
        // a million times.
        let mut files: HashMap<String, Bytes> = HashMap::new();
        for k in 0..document.root.buffers.len() {
            let loaded = match document.root.buffers[k].uri.as_deref() {
                None if k == 0 => binary.clone().map(|range| Bytes { data: bytes.data.clone(), range }),
                None => None,
                Some(uri) if files.contains_key(uri) => files.get(uri).cloned(),
                Some(uri) => {
                    let bytes = Bytes::from(document.resource(uri)?);
                    document.byte_count += bytes.len();
                    files.insert(uri.to_owned(), bytes.clone());
                    Some(bytes)
                }
            };
            document.buffers.push(loaded);
        }
        gltf_compressed::expand(&mut document)?;
        Ok(document)
    }

    pub(crate) fn error(&self, what: impl Into<String>, remedy: &str) -> Error {
        Error::format(&self.path, None, what, remedy)
    }

    pub(crate) fn damaged(&self, what: impl Into<String>) -> Error {
        self.error(what, "The file is damaged or incomplete: export the model again")
    }

    /// Fails on a required extension that is not read.
    fn check_extensions(&self) -> Result<()> {
        match self.root.extensions_required.iter().find(|name| !gltf_extensions::is_read(name)) {
            Some(name) => Err(self.unread_extension(name)),
            None => Ok(()),
        }
    }

    /// An error that names an extension and what to do about it.
    pub(crate) fn unread_extension(&self, name: &str) -> Error {
        let (what, remedy) = gltf_extensions::refusal(name);
        self.error(what, remedy)
    }

    /// The bytes a URI stands for: embedded as base64, or a file beside this one.
    fn resource(&self, uri: &str) -> Result<Vec<u8>> {
        if let Some(data) = uri.strip_prefix("data:") {
            let decoded = data.split_once(";base64,").and_then(|(_, text)| base64(text.as_bytes()));
            return decoded.ok_or_else(|| self.damaged("embedded data is not valid base64"));
        }
        let found = self.file(uri)?;
        if let Located::Outside(_) = found {
            let what = format!("it refers to {:?}, outside its folder", super::obj::shortened(uri));
            return Err(self.error(what, "Move that file beside it, or leave out --confine"));
        }
        source::read_all(found.path())
    }

    /// The file a URI names, with its percent codes or without them.
    pub(crate) fn file(&self, uri: &str) -> Result<Located> {
        if uri.contains("://") && !uri.to_ascii_lowercase().starts_with("file:") {
            let what = format!("it refers to {:?}", super::obj::shortened(uri));
            return Err(self.error(what, "Download that file and refer to it by its name"));
        }
        let decoded = locate(&self.path, &percent_decoded(uri.as_bytes()));
        Ok(if decoded.is_missing() {
            Some(locate(&self.path, uri.as_bytes())).filter(|l| !l.is_missing()).unwrap_or(decoded)
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
    pub(crate) fn view(&self, k: usize) -> Result<(&[u8], Option<usize>)> {
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

    /// Accessor `k`.
    pub(crate) fn accessor(&self, k: usize) -> Result<&Accessor> {
        self.root.accessors.get(k).ok_or_else(|| self.damaged(format!("there is no accessor {k}")))
    }

    /// All numbers of accessor `k`, `components` an element.
    pub(crate) fn numbers(&self, k: usize, components: usize) -> Result<Vec<f64>> {
        let accessor = self.accessor(k)?;
        let declared = match accessor.shape.as_str() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            "MAT4" => 16,
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
            let at = self.sparse_indices(k, sparse)?;
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

    /// The first `count` elements of accessor `k` as vectors.
    pub(crate) fn vectors(&self, k: usize, count: usize) -> Result<Vec<DVec3>> {
        let numbers = self.numbers(k, 3)?;
        if numbers.len() < 3 * count {
            return Err(self.damaged(format!("accessor {k} ends before the last of {count} vertices")));
        }
        Ok(numbers.chunks_exact(3).take(count).map(DVec3::from_slice).collect())
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
        let size = self.component_size(k, kind.component_type)?;
        let scale = |x: f64, most: f64| if kind.normalized { (x / most).max(-1.0) } else { x };
        let read = |b: &[u8]| match kind.component_type {
            5120 => scale(f64::from(b[0] as i8), 127.0),
            5121 => scale(f64::from(b[0]), 255.0),
            5122 => scale(f64::from(i16::from_le_bytes([b[0], b[1]])), 32767.0),
            5123 => scale(f64::from(u16::from_le_bytes([b[0], b[1]])), 65535.0),
            5125 => f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
            _ => f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        };
        let slices = self.slices(k, view, offset, count, size * components)?;
        Ok(slices.flat_map(|element| element.chunks_exact(size).map(read)).collect())
    }

    fn component_size(&self, k: usize, component_type: u32) -> Result<usize> {
        match component_type {
            5120 | 5121 => Ok(1),
            5122 | 5123 => Ok(2),
            5125 | 5126 => Ok(4),
            other => Err(self.damaged(format!("accessor {k} has the unknown component type {other}"))),
        }
    }

    /// The bytes of `count` elements of `width` bytes in a view.
    fn slices(
        &self,
        k: usize,
        view: usize,
        offset: usize,
        count: usize,
        width: usize,
    ) -> Result<impl Iterator<Item = &[u8]>> {
        let (bytes, stride) = self.view(view)?;
        let stride = stride.unwrap_or(width);
        // A stride below the element's width would let a small buffer hold a huge accessor.
        let last = count
            .checked_sub(1)
            .map_or(Some(0), |last| last.checked_mul(stride)?.checked_add(offset)?.checked_add(width));
        if count > 0 && stride < width || last.is_none_or(|end| end > bytes.len()) {
            let what = format!("accessor {k} reaches beyond the {} bytes of buffer view {view}", bytes.len());
            return Err(self.damaged(what));
        }
        Ok((0..count).map(move |element| &bytes[offset + element * stride..][..width]))
    }

    /// The elements of accessor `k` as they are stored, one after the other, and the bytes of each.
    pub(crate) fn raw(&self, k: usize) -> Result<(Vec<u8>, usize)> {
        let accessor = self.accessor(k)?;
        let components = match accessor.shape.as_str() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            other => return Err(self.damaged(format!("accessor {k} of vertices is a {other:?}"))),
        };
        let width = components * self.component_size(k, accessor.component_type)?;
        let mut bytes = match accessor.buffer_view {
            Some(view) => {
                self.slices(k, view, accessor.byte_offset, accessor.count, width)?.flatten().copied().collect()
            }
            None if accessor.count <= self.byte_count => vec![0; accessor.count * width],
            None => return Err(self.damaged(format!("accessor {k} has no data"))),
        };
        if let Some(sparse) = &accessor.sparse {
            let at = self.sparse_indices(k, sparse)?;
            let SparseValues { buffer_view, byte_offset } = sparse.values;
            for (index, value) in at.iter().zip(self.slices(k, buffer_view, byte_offset, sparse.count, width)?) {
                let start = (*index as usize).saturating_mul(width);
                let slot = bytes.get_mut(start..start.saturating_add(width));
                slot.ok_or_else(|| self.damaged(format!("accessor {k} replaces an element it does not have")))?
                    .copy_from_slice(value);
            }
        }
        Ok((bytes, width))
    }

    /// The elements that a sparse accessor replaces.
    fn sparse_indices(&self, k: usize, sparse: &Sparse) -> Result<Vec<f64>> {
        let SparseIndices { buffer_view, byte_offset, component_type } = sparse.indices;
        let indices = Accessor {
            buffer_view: None,
            byte_offset: 0,
            component_type,
            count: sparse.count,
            shape: String::new(),
            normalized: false,
            sparse: None,
        };
        self.elements(k, buffer_view, byte_offset, sparse.count, 1, &indices)
    }
}
