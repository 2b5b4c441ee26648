//! Changing a glTF document: what is not changed is written as it was.
//!
//! Nodes, meshes, primitives, materials and accessors keep their numbers, so that everything that
//! refers to them, known here or not, stays right. What is replaced takes the place of what it
//! replaces, unless something else uses that, too. The output is one binary chunk: the buffers'
//! parts that are still used, in file order, then what is new.

use serde_json::{Map, Value, json};

use super::gltf_container::container;
use super::gltf_document::{Accessor, Document};
use super::gltf_layout::{ALIGNED, Layout};
use super::gltf_parts::{ARRAY, FLOAT};
use crate::Result;

/// A document being changed.
#[derive(Debug)]
pub(super) struct Edit<'a> {
    pub(super) document: &'a Document,
    pub(super) json: Value,
    /// What the user should know of the output.
    pub(super) notes: Vec<String>,
    views: Vec<Content>,
    /// References to each buffer view in the file.
    view_users: Vec<usize>,
    /// References to each accessor.
    users: Vec<usize>,
}

/// The content of a buffer view.
#[derive(Debug)]
enum Content {
    /// That of a view of the file.
    File(usize),
    New(Vec<u8>),
}

/// New content of an accessor.
pub(super) struct Elements<'b> {
    pub(super) bytes: &'b [u8],
    pub(super) count: usize,
    pub(super) component: u32,
    pub(super) shape: &'b str,
    pub(super) normalized: bool,
    pub(super) target: Option<u32>,
}

impl<'a> Edit<'a> {
    pub(super) fn new(document: &'a Document) -> Self {
        let mut json = document.json.clone();
        for list in ["bufferViews", "accessors"] {
            list_of(&mut json, list);
        }
        let views: Vec<Content> = (0..document.root.buffer_views.len()).map(Content::File).collect();
        let mut users = vec![0; json["accessors"].as_array().map_or(0, Vec::len)];
        let mut used = |value: &Value| {
            if let Some(count) = value.as_u64().and_then(|k| users.get_mut(k as usize)) {
                *count += 1;
            }
        };
        walk(&json, &mut |key, value| match (key, value) {
            ("attributes", Value::Object(attributes)) => attributes.values().for_each(&mut used),
            ("targets", Value::Array(targets)) => {
                targets.iter().filter_map(Value::as_object).flat_map(Map::values).for_each(&mut used);
            }
            ("indices" | "inverseBindMatrices" | "input" | "output", number) => used(number),
            _ => {}
        });
        let view_users = view_users(&json, views.len());
        Self { document, json, notes: Vec::new(), views, view_users, users }
    }

    /// The description of a primitive.
    pub(super) fn primitive(&mut self, mesh: usize, primitive: usize) -> &mut Value {
        &mut self.json["meshes"][mesh]["primitives"][primitive]
    }

    /// A new buffer view.
    pub(super) fn view(&mut self, bytes: Vec<u8>, stride: Option<usize>, target: Option<u32>) -> usize {
        let mut view = json!({"buffer": 0, "byteLength": bytes.len()});
        if let Some(stride) = stride {
            view["byteStride"] = stride.into();
        }
        if let Some(target) = target {
            view["target"] = target.into();
        }
        list_of(&mut self.json, "bufferViews").push(view);
        self.views.push(Content::New(bytes));
        self.views.len() - 1
    }

    /// Puts new elements in the place of accessor `old`, or adds one where others use that; its
    /// number.
    pub(super) fn replace(&mut self, old: Option<usize>, new: &Elements<'_>) -> usize {
        let width = new.bytes.len() / new.count.max(1);
        // Attributes of vertices begin at multiples of four bytes.
        let aligned = if new.target == Some(ARRAY) { width.next_multiple_of(4) } else { width };
        let mut bytes = Vec::with_capacity(aligned * new.count);
        for element in new.bytes.chunks_exact(width.max(1)) {
            bytes.extend_from_slice(element);
            bytes.resize(bytes.len().next_multiple_of(aligned), 0);
        }
        let stride = (aligned != width).then_some(aligned);
        let view = self.view(bytes, stride, new.target);
        let mut value = json!({
            "bufferView": view, "componentType": new.component, "count": new.count, "type": new.shape});
        if new.normalized {
            value["normalized"] = true.into();
        }
        self.put(old, value)
    }

    /// Puts a description in the place of accessor `old`, or adds it where others use that; its
    /// number.
    pub(super) fn put(&mut self, old: Option<usize>, mut value: Value) -> usize {
        let accessors = list_of(&mut self.json, "accessors");
        if let Some(k) = old.filter(|&k| self.users.get(k) == Some(&1)) {
            for key in ["name", "extras"] {
                if let Some(kept) = accessors[k].get(key) {
                    value[key] = kept.clone();
                }
            }
            accessors[k] = value;
            return k;
        }
        if let Some(users) = old.and_then(|k| self.users.get_mut(k)) {
            *users -= 1;
        }
        accessors.push(value);
        self.users.push(1);
        accessors.len() - 1
    }

    /// Puts numbers in the place of accessor `old` of `shape`, in its own bytes where that can be;
    /// its number.
    pub(super) fn floats(&mut self, old: Option<usize>, values: &[f32], shape: &str, bounds: bool) -> Result<usize> {
        let width = match shape {
            "VEC2" => 2,
            "VEC3" => 3,
            _ => 4,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        let place = match old.filter(|&k| self.document.accessor(k).is_ok_and(|a| a.count == values.len() / width)) {
            Some(k) => self.own_bytes(k, 4 * width)?,
            None => None,
        };
        let k = match (old, place) {
            (Some(k), Some((view, offset, stride))) => {
                if let Content::File(original) = self.views[view] {
                    self.views[view] = Content::New(self.document.view(original)?.0.to_vec());
                }
                if let Content::New(content) = &mut self.views[view] {
                    for (i, element) in bytes.chunks_exact(4 * width).enumerate() {
                        content[offset + i * stride..][..4 * width].copy_from_slice(element);
                    }
                }
                k
            }
            _ => {
                let (count, target) = (values.len() / width, Some(ARRAY));
                let new = Elements { bytes: &bytes, count, component: FLOAT, shape, normalized: false, target };
                self.replace(old, &new)
            }
        };
        let accessor = &mut self.json["accessors"][k];
        if bounds {
            let extreme = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
                let column = |c: usize| values.iter().skip(c).step_by(width).copied().reduce(pick).unwrap_or(0.0);
                (0..width).map(column).collect()
            };
            accessor["min"] = json!(extreme(f32::min));
            accessor["max"] = json!(extreme(f32::max));
        } else if let Some(accessor) = accessor.as_object_mut() {
            accessor.remove("min");
            accessor.remove("max");
        }
        Ok(k)
    }

    /// The view, offset and stride of an accessor of `width` bytes an element in single precision,
    /// if nothing else has a part in its bytes.
    fn own_bytes(&self, k: usize, width: usize) -> Result<Option<(usize, usize, usize)>> {
        let Some(accessor) = self.document.root.accessors.get(k) else { return Ok(None) };
        let (Some(view), None, FLOAT, Some(1)) =
            (accessor.buffer_view, &accessor.sparse, accessor.component_type, self.users.get(k))
        else {
            return Ok(None);
        };
        let stride = self.document.view(view)?.1.unwrap_or(width);
        let reach = |a: &Accessor| a.byte_offset..a.byte_offset + a.count.saturating_mul(stride);
        let own = reach(accessor);
        let apart = |other: &Accessor| {
            let theirs = reach(other);
            let lane = |offset: usize| offset % stride;
            // Interleaved elements have lanes of their own.
            theirs.start >= own.end
                || own.start >= theirs.end
                || width < stride
                    && (lane(other.byte_offset) >= lane(own.start) + width
                        || lane(other.byte_offset) + 4 <= lane(own.start))
        };
        let others = self.document.root.accessors.iter().enumerate();
        let mut others =
            others.filter(|(i, a)| *i != k && a.buffer_view == Some(view) && self.users.get(*i) != Some(&0));
        Ok(others.all(|(_, a)| apart(a)).then_some((view, accessor.byte_offset, stride)))
    }

    /// The bytes of the file, and the notes.
    pub(super) fn finish(mut self) -> Result<(Vec<u8>, Vec<String>)> {
        self.embed_pictures();
        if !self.document.compression.is_empty() {
            let names = self.document.compression.join(", ");
            self.notes.push(format!(
                "what is written is not compressed, as its input was ({names}): gltfpack or gltf-transform does so again"
            ));
        }
        self.drop_unused_views();
        let of_file = |content: &Content| match content {
            Content::File(k) => Some(*k),
            Content::New(_) => None,
        };
        let mut used = Vec::new();
        for k in self.views.iter().filter_map(of_file) {
            // Fails where the view reaches beyond its buffer.
            self.document.view(k)?;
            let view = &self.document.root.buffer_views[k];
            used.push((view.buffer, view.byte_offset..view.byte_offset + view.byte_length));
        }
        let layout = Layout::new(used);
        let mut binary = layout.bytes(self.document);
        let views = list_of(&mut self.json, "bufferViews");
        for (view, content) in views.iter_mut().zip(&self.views) {
            view["buffer"] = 0.into();
            view["byteOffset"] = match content {
                Content::File(k) => {
                    let view = &self.document.root.buffer_views[*k];
                    layout.place(view.buffer, view.byte_offset).into()
                }
                Content::New(bytes) => {
                    let at = binary.len();
                    binary.extend_from_slice(bytes);
                    binary.resize(binary.len().next_multiple_of(ALIGNED), 0);
                    at.into()
                }
            };
        }
        self.json["buffers"] = if binary.is_empty() { json!([]) } else { json!([{"byteLength": binary.len()}]) };
        for list in ["bufferViews", "accessors", "buffers"] {
            // The format forbids empty lists.
            if self.json[list].as_array().is_some_and(Vec::is_empty)
                && let Some(root) = self.json.as_object_mut()
            {
                root.remove(list);
            }
        }
        let name = self.document.path.display().to_string();
        Ok((container(&name, self.json.to_string().into_bytes(), &binary)?, self.notes))
    }

    /// Takes pictures that are files of their own, or text, into the file: the output may stand
    /// elsewhere, and has a place for bytes.
    fn embed_pictures(&mut self) {
        for k in 0..self.document.root.images.len() {
            let Some(uri) = self.json["images"][k]["uri"].as_str() else { continue };
            let bytes = match self.document.root.images.iter().position(|i| i.uri.as_deref() == Some(uri)) {
                Some(image) if uri.starts_with("data:") => {
                    self.document.embedded_image(image).map(|bytes| bytes.unwrap_or_default().to_vec())
                }
                _ => self.document.file(uri).and_then(|file| super::source::read_all(file.path())),
            };
            let bytes = match bytes {
                Ok(bytes) => bytes,
                Err(error) => {
                    self.notes.push(format!("a picture is not in the file that is written: {error}"));
                    continue;
                }
            };
            let kind = picture_kind(&bytes);
            let view = self.view(bytes, None, None);
            if let Some(image) = self.json["images"][k].as_object_mut() {
                image.remove("uri");
                image.insert("bufferView".to_owned(), view.into());
                image.insert("mimeType".to_owned(), kind.into());
            }
        }
    }

    /// Removes buffer views that nothing refers to any more.
    fn drop_unused_views(&mut self) {
        // What refers to views in other ways cannot be renumbered.
        if self.view_users.contains(&0) {
            return;
        }
        let users = view_users(&self.json, self.views.len());
        let mut number = Vec::with_capacity(users.len());
        let mut next = 0;
        for count in &users {
            number.push(next);
            next += usize::from(*count > 0);
        }
        let mut keep = users.iter().map(|count| *count > 0);
        self.views.retain(|_| keep.next().unwrap_or(true));
        let mut keep = users.iter().map(|count| *count > 0);
        list_of(&mut self.json, "bufferViews").retain(|_| keep.next().unwrap_or(true));
        walk_mut(&mut self.json, &mut |key, value| {
            if let ("bufferView", Some(&new)) = (key, value.as_u64().and_then(|k| number.get(k as usize))) {
                *value = new.into();
            }
        });
    }
}

/// Takes an extension off the lists of those that a document uses.
pub(super) fn forget_extension(json: &mut Value, name: &str) {
    for list in ["extensionsUsed", "extensionsRequired"] {
        if let Some(names) = json.get_mut(list).and_then(Value::as_array_mut) {
            names.retain(|n| n != name);
            if names.is_empty()
                && let Some(root) = json.as_object_mut()
            {
                root.remove(list);
            }
        }
    }
}

/// Removes an extension of an object.
pub(super) fn drop_extension(value: &mut Value, name: &str) {
    let Some(object) = value.as_object_mut() else { return };
    let Some(extensions) = object.get_mut("extensions").and_then(Value::as_object_mut) else { return };
    extensions.remove(name);
    if extensions.is_empty() {
        object.remove("extensions");
    }
}

/// The media type of a picture by its first bytes.
pub(super) fn picture_kind(bytes: &[u8]) -> &'static str {
    match bytes {
        [0xff, 0xd8, ..] => "image/jpeg",
        [b'R', b'I', b'F', b'F', ..] => "image/webp",
        [0xab, b'K', b'T', b'X', ..] => "image/ktx2",
        _ => "image/png",
    }
}

/// The list under `name`, made where it is missing.
pub(super) fn list_of<'v>(json: &'v mut Value, name: &str) -> &'v mut Vec<Value> {
    let entry = &mut json[name];
    if !entry.is_array() {
        *entry = Value::Array(Vec::new());
    }
    match entry {
        Value::Array(list) => list,
        _ => unreachable!("it is a list now"),
    }
}

fn view_users(json: &Value, count: usize) -> Vec<usize> {
    let mut users = vec![0; count];
    walk(json, &mut |key, value| {
        if let ("bufferView", Some(k)) = (key, value.as_u64())
            && let Some(users) = users.get_mut(k as usize)
        {
            *users += 1;
        }
    });
    users
}

/// Visits every entry of every object but those of applications.
fn walk(value: &Value, visit: &mut dyn FnMut(&str, &Value)) {
    match value {
        Value::Array(list) => list.iter().for_each(|v| walk(v, visit)),
        Value::Object(entries) => {
            for (key, v) in entries.iter().filter(|(key, _)| *key != "extras") {
                visit(key, v);
                walk(v, visit);
            }
        }
        _ => {}
    }
}

/// As [`walk`], for changes.
fn walk_mut(value: &mut Value, visit: &mut dyn FnMut(&str, &mut Value)) {
    match value {
        Value::Array(list) => list.iter_mut().for_each(|v| walk_mut(v, visit)),
        Value::Object(entries) => {
            for (key, v) in entries.iter_mut().filter(|(key, _)| *key != "extras") {
                visit(key, v);
                walk_mut(v, visit);
            }
        }
        _ => {}
    }
}
