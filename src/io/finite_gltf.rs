//! The numbers of a GLB file that is about to be written.

use std::path::Path;

use serde_json::Value;

use super::finite;
use crate::Result;

/// `componentType` of single precision numbers.
const FLOAT: u64 = 5126;

/// Fails if an accessor of a GLB file holds a single precision number that is not finite. Bytes
/// that are no GLB file pass.
///
/// # Errors
/// [`crate::Error::NotFinite`] naming the accessor, what it is and the element.
pub(super) fn check(file: &Path, bytes: &[u8]) -> Result<()> {
    let word = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let (true, Some(length)) = (bytes.starts_with(b"glTF"), word(12)) else { return Ok(()) };
    let Some(root) = bytes.get(20..20 + length).and_then(|json| serde_json::from_slice::<Value>(json).ok()) else {
        return Ok(());
    };
    let Some(binary) = bytes.get(28 + length..) else { return Ok(()) };
    let list = |key: &str| root.get(key).and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
    let number = |value: &Value, key: &str| value.get(key).and_then(Value::as_u64).unwrap_or(0) as usize;
    for (index, accessor) in list("accessors").iter().enumerate() {
        let view = accessor.get("bufferView").and_then(Value::as_u64).and_then(|v| list("bufferViews").get(v as usize));
        let (Some(view), Some(FLOAT)) = (view, accessor.get("componentType").and_then(Value::as_u64)) else { continue };
        let width = match accessor.get("type").and_then(Value::as_str) {
            Some("SCALAR") => 1,
            Some("VEC2") => 2,
            Some("VEC3") => 3,
            Some("VEC4" | "MAT2") => 4,
            Some("MAT3") => 9,
            _ => 16,
        };
        let stride = Some(number(view, "byteStride")).filter(|s| *s > 0).unwrap_or(4 * width);
        let start = number(view, "byteOffset") + number(accessor, "byteOffset");
        let count = number(accessor, "count");
        let at = |i: usize| start + i / width * stride + i % width * 4;
        let values = (0..count * width).map_while(|i| binary.get(at(i)..at(i) + 4));
        let values = values.map(|b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])));
        let role = role(&root, index);
        finite::numbers(file, values, |i| format!("{role}element {} of accessor {index}", i / width))?;
    }
    Ok(())
}

/// What an accessor is in the first primitive that names it, as `POSITION, `.
fn role(root: &Value, accessor: usize) -> String {
    let meshes = root.get("meshes").and_then(Value::as_array).into_iter().flatten();
    let primitives = meshes.filter_map(|m| m.get("primitives").and_then(Value::as_array)).flatten();
    let sets = primitives.flat_map(|p| {
        let targets = p.get("targets").and_then(Value::as_array).into_iter().flatten();
        p.get("attributes").into_iter().chain(targets).filter_map(Value::as_object)
    });
    let mut named = sets.flatten().filter(|(_, index)| index.as_u64() == Some(accessor as u64));
    named.next().map_or_else(String::new, |(name, _)| format!("{name}, "))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file of one triangle whose numbers are `positions`.
    fn glb(positions: [f32; 9]) -> Vec<u8> {
        let root = serde_json::json!({
            "asset": {"version": "2.0"}, "buffers": [{"byteLength": 36}], "bufferViews": [{"buffer": 0, "byteLength": 36}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        });
        let mut json = root.to_string().into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut bytes = b"glTF\x02\0\0\0".to_vec();
        bytes.extend(((28 + json.len() + 36) as u32).to_le_bytes());
        bytes.extend((json.len() as u32).to_le_bytes());
        bytes.extend(b"JSON");
        bytes.extend(&json);
        bytes.extend(36u32.to_le_bytes());
        bytes.extend(b"BIN\0");
        bytes.extend(positions.iter().flat_map(|x| x.to_le_bytes()));
        bytes
    }

    #[test]
    fn numbers_that_are_not_finite_are_found_in_the_bytes() {
        let good = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let file = Path::new("m.glb");
        check(file, &glb(good)).unwrap();
        for (place, value, words) in
            [(4, f32::NAN, "element 1 of accessor 0 would be NaN"), (8, f32::INFINITY, "element 2")]
        {
            let mut bad = good;
            bad[place] = value;
            let message = check(file, &glb(bad)).unwrap_err().to_string();
            assert!(message.starts_with("m.glb: POSITION, ") && message.contains(words), "{message}");
        }
        for other in [&b""[..], b"glTF", b"glTF\x02\0\0\0\0\0\0\0\xff\xff\xff\xff", b"\x89PNG"] {
            check(file, other).unwrap();
        }
    }
}
