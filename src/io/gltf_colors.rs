//! COLOR_0 of glTF primitives.

use super::gltf_document::{Document, Primitive};
use crate::Result;
use crate::picture::linear_to_srgb;

/// Colours of the vertices of a primitive as viewers show them (sRGB, RGBA, 0..1); nothing where it
/// has none. The file holds light (glTF 2.0, section 3.7.2.1), as RGB or RGBA, floats or parts of
/// 255 or 65535.
///
/// # Errors
/// Damaged data.
pub(super) fn read(document: &Document, primitive: &Primitive) -> Result<Option<Vec<[f32; 4]>>> {
    let Some(&accessor) = primitive.attributes.get("COLOR_0") else { return Ok(None) };
    let (numbers, channels) = match document.numbers(accessor, 4) {
        Ok(numbers) => (numbers, 4),
        Err(_) => (document.numbers(accessor, 3)?, 3),
    };
    let unit = |x: f64| if x.is_finite() { x.clamp(0.0, 1.0) as f32 } else { 1.0 };
    let shown = |c: &[f64]| {
        let [r, g, b] = [c[0], c[1], c[2]].map(|x| linear_to_srgb(unit(x)));
        [r, g, b, c.get(3).map_or(1.0, |&a| unit(a))]
    };
    Ok(Some(numbers.chunks_exact(channels).map(shown).collect()))
}
