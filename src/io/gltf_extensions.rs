//! Which extensions of glTF are read, and what is said of the others.

/// Whether a file that requires the extension is read as it is meant.
pub(super) fn is_read(name: &str) -> bool {
    let known = [
        "KHR_mesh_quantization",
        "KHR_texture_transform",
        "KHR_lights_punctual",
        "KHR_animation_pointer",
        "KHR_xmp_json_ld",
        "EXT_texture_webp",
        "EXT_meshopt_compression",
        "KHR_meshopt_compression",
        "KHR_draco_mesh_compression",
    ];
    known.contains(&name) || name.starts_with("KHR_materials_")
}

/// What is wrong with a required extension that is not read, and the remedy.
pub(super) fn refusal(name: &str) -> (String, &'static str) {
    if name == "KHR_texture_basisu" {
        let what = format!("its textures are KTX2 files ({name}), which are not read");
        return (
            what,
            "Convert them to PNG, as with `gltf-transform ktxdecompress IN.glb OUT.glb`, or export with PNG or JPEG",
        );
    }
    (format!("the file needs the extension {name:?}, which is not read"), "Export it without that extension")
}

/// The extensions among `used` whose part of the picture is not read; one sentence, if there are
/// any.
pub(super) fn note<'a>(used: impl IntoIterator<Item = &'a String>) -> Option<String> {
    let names: Vec<&str> = used.into_iter().map(String::as_str).filter(|n| changes_the_picture(n)).collect();
    (!names.is_empty()).then(|| format!("what these extensions add to the picture is not read: {}", names.join(", ")))
}

fn changes_the_picture(name: &str) -> bool {
    let read = [
        "KHR_materials_unlit",
        "KHR_materials_variants",
        "KHR_materials_pbrSpecularGlossiness",
        "KHR_materials_emissive_strength",
    ];
    let others = [
        "EXT_mesh_gpu_instancing",
        "KHR_node_visibility",
        "KHR_texture_basisu",
        "KHR_gaussian_splatting",
        "EXT_texture_avif",
        "MSFT_lod",
        "MSFT_texture_dds",
    ];
    name.starts_with("KHR_materials_") && !read.contains(&name) || others.contains(&name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_required_extension_is_read_or_named_with_a_remedy() {
        for (name, tool) in [("KHR_texture_basisu", "gltf-transform"), ("VENDOR_thing", "without that extension")] {
            let (what, remedy) = refusal(name);
            assert!(!is_read(name) && what.contains(name) && remedy.contains(tool), "{what} {remedy}");
        }
        assert!(is_read("KHR_mesh_quantization") && is_read("KHR_materials_volume"));
    }

    #[test]
    fn only_what_changes_the_picture_is_noted() {
        let used = ["KHR_lights_punctual", "KHR_materials_clearcoat", "EXT_mesh_gpu_instancing"].map(str::to_owned);
        let said = note(&used).unwrap();
        assert!(said.contains("clearcoat, EXT_mesh") && !said.contains("lights"), "{said}");
        assert_eq!(note(&used[..1]), None);
    }
}
