//! The binary chunk of a GLB as it grows, and the buffer views and accessors that describe it.

use serde_json::{Value, json};

/// A buffer view of vertices.
pub(super) const ARRAY: u32 = 34962;
/// A buffer view of indices.
pub(super) const ELEMENTS: u32 = 34963;
/// Component type of single precision.
pub(super) const FLOAT: u32 = 5126;
/// Component type of 32-bit indices.
pub(super) const UNSIGNED_INT: u32 = 5125;

/// The binary chunk as it grows, and what describes it.
#[derive(Default)]
pub(super) struct Parts {
    pub(super) bytes: Vec<u8>,
    pub(super) views: Vec<Value>,
    pub(super) accessors: Vec<Value>,
}

impl Parts {
    pub(super) fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        let mut view = json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()});
        if let Some(target) = target {
            view["target"] = target.into();
        }
        self.bytes.extend_from_slice(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(view);
        self.views.len() - 1
    }

    pub(super) fn accessor(&mut self, bytes: &[u8], target: u32, component: u32, count: usize, shape: &str) -> usize {
        let view = self.view(bytes, Some(target));
        self.accessors.push(json!({"bufferView": view, "componentType": component, "count": count, "type": shape}));
        self.accessors.len() - 1
    }
}
