//! Writing a mesh as GLB, ready to view.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use serde_json::{Value, json};

use super::gltf_container::container;
use super::gltf_look::{Pictures, look};
use super::gltf_parts::Parts;
use super::gltf_scene::GltfScene;
use super::gltf_split::{Split, origin, vertex_normals};
use super::output;
use crate::geometry::{Mesh, NONE};
use crate::{Error, Result};

pub use super::gltf_look::{GlbMaterial, GlbTexture, own_materials};

/// Writes `mesh` as a binary glTF 2.0 file.
///
/// Corners keep their normals, so that hard edges stay hard; those without one get the smooth
/// normal of their vertex. `materials[k]` is used by the polygons with material `k`; polygons
/// without one, or beyond the list, use the first. With one entry the whole mesh uses it. Vertices
/// are repeated along texture seams and hard edges, as the format asks; unused ones and triangles
/// that repeat a vertex are left out. Positions become single precision; a mesh far from the origin
/// is written around it, and its node has the offset in double precision.
///
/// # Errors
/// [`Error::Io`]; [`Error::Mesh`] if there is no triangle, a position does not fit single
/// precision, or the file would exceed the format's 4 GiB.
pub fn write_glb(path: impl AsRef<Path>, mesh: &Mesh, materials: &[GlbMaterial]) -> Result<()> {
    output::write_bytes(path, &glb_bytes(mesh, materials)?)
}

/// [`glb_bytes`] where `material_of` names the entry of `materials` for each triangle, whatever the
/// mesh's own are; triangles whose entry is beyond the list use the first.
///
/// # Errors
/// As [`write_glb`].
pub fn glb_with_materials(mesh: &Mesh, materials: &[GlbMaterial], material_of: &[u32]) -> Result<Vec<u8>> {
    let of = |t: usize| material_of.get(t).copied().unwrap_or(NONE);
    glb_of(mesh, materials, of, |_, _| Ok(Vec::new()), |_, _| {})
}

/// The bytes [`write_glb`] writes.
///
/// # Errors
/// As [`write_glb`].
pub fn glb_bytes(mesh: &Mesh, materials: &[GlbMaterial]) -> Result<Vec<u8>> {
    glb_with(mesh, materials, |_, _| Ok(Vec::new()), |_, _| {})
}

/// [`glb_bytes`] with the morph targets that `targets` adds to each primitive, and what `finish`
/// adds to the document.
pub(super) fn glb_with(
    mesh: &Mesh,
    materials: &[GlbMaterial],
    targets: impl Fn(&Split, &mut Parts) -> Result<Vec<Value>>,
    finish: impl FnOnce(&mut Value, &mut Parts),
) -> Result<Vec<u8>> {
    glb_of(mesh, materials, |t| mesh.triangle_material(t), targets, finish)
}

/// The scene that [`write_glb`] makes of a mesh, to be changed before it is written, and for each
/// of its vertices the one of `mesh`.
///
/// # Errors
/// As [`write_glb`].
pub fn written_scene(mesh: &Mesh, materials: &[GlbMaterial]) -> Result<(Arc<GltfScene>, Vec<u32>)> {
    let mut sources = Vec::new();
    let mut note = |split: &Split| sources.extend(split.vertices.iter().map(|v| v.vertex));
    let plain = |split: &Split, _: &mut Parts| {
        note(split);
        Ok(Vec::new())
    };
    let bytes = glb_of(mesh, materials, |t| mesh.triangle_material(t), plain, |_, _| {})?;
    let scene = super::gltf_read::parse_gltf(&bytes, Path::new(&mesh.name))?.scene;
    let missing = || Error::mesh(&mesh.name, "it makes no scene", "Use a mesh with faces");
    Ok((scene.ok_or_else(missing)?, sources))
}

/// What the mesh is called: as its only group, else as its file.
fn name_of(mesh: &Mesh) -> String {
    match mesh.groups.as_slice() {
        [only] => only.clone(),
        _ => Path::new(&mesh.name).file_stem().unwrap_or_default().to_string_lossy().into_owned(),
    }
}

fn glb_of(
    mesh: &Mesh,
    materials: &[GlbMaterial],
    material_of: impl Fn(usize) -> u32,
    mut targets: impl FnMut(&Split, &mut Parts) -> Result<Vec<Value>>,
    finish: impl FnOnce(&mut Value, &mut Parts),
) -> Result<Vec<u8>> {
    let mut out = Parts::default();
    let normals = vertex_normals(mesh, &mesh.positions);
    let origin = origin(mesh);
    // Colours of vertices multiply pictures, which have colours of their own.
    let colored = !mesh.colors.is_empty() && !materials.iter().any(|m| m.texture.is_some());
    let mut primitives = Vec::new();
    for k in 0..materials.len().max(1) {
        let wanted = |t: usize| {
            let m = material_of(t);
            let m = if m == NONE || m as usize >= materials.len() { 0 } else { m as usize };
            m == k
        };
        let split = Split::new(mesh, &normals, wanted);
        if split.indices.is_empty() {
            continue;
        }
        let pictured = materials.get(k).is_some_and(GlbMaterial::has_pictures);
        let mut primitive = split.write(mesh, origin, pictured, colored, &mut out)?;
        let morphs = targets(&split, &mut out)?;
        if !morphs.is_empty() {
            primitive["targets"] = morphs.into();
        }
        if !materials.is_empty() {
            primitive["material"] = k.into();
        }
        primitives.push(primitive);
    }
    if primitives.is_empty() {
        return Err(Error::mesh(&mesh.name, "there is no triangle to write", "Use a mesh with faces"));
    }
    let mut pictures = Pictures::default();
    let looks: Vec<Value> = materials.iter().map(|m| look(m, &mut |t| pictures.reference(t, &mut out))).collect();
    let name = name_of(mesh);
    let mut root = json!({
        "asset": {"version": "2.0", "generator": concat!("barymap ", env!("CARGO_PKG_VERSION"))},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": name, "mesh": 0}],
        "meshes": [{"name": name, "primitives": primitives}],
    });
    if origin != DVec3::ZERO {
        root["nodes"][0]["translation"] = json!(origin.to_array());
    }
    // The format forbids empty lists.
    if !looks.is_empty() {
        root["materials"] = looks.into();
    }
    pictures.write(&mut root);
    finish(&mut root, &mut out);
    root["accessors"] = std::mem::take(&mut out.accessors).into();
    root["bufferViews"] = std::mem::take(&mut out.views).into();
    root["buffers"] = json!([{"byteLength": out.bytes.len()}]);
    container(&mesh.name, root.to_string().into_bytes(), &out.bytes)
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::geometry::{Corner, MeshBuilder};
    use crate::io::gltf_read::parse_gltf;
    use crate::io::image_file::{decode_image, encode_png};
    use crate::picture::{Depth, Image};

    /// Two textured triangles with a seam between them, one of the second material, and one that
    /// repeats a vertex.
    fn seamed() -> Mesh {
        let mut builder = MeshBuilder::new("seamed");
        let mesh = &mut builder.mesh;
        mesh.positions = vec![DVec3::ONE * 9.0, DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(1.0, 1.0, 0.0), DVec3::Z];
        mesh.texcoords = vec![DVec2::new(0.0, 0.25), DVec2::X, DVec2::Y, DVec2::new(0.5, 0.5)];
        mesh.materials = vec![Default::default(), Default::default()];
        let corner = |vertex, texcoord| Corner { vertex, texcoord, normal: NONE };
        builder.material = 0;
        builder.polygon([corner(1, 0), corner(2, 1), corner(3, 2)]);
        builder.polygon([corner(3, 2), corner(2, 3), corner(4, 0)]);
        builder.polygon([corner(3, 2), corner(3, 3), corner(4, 0)]);
        builder.material = 1;
        builder.polygon([corner(1, NONE), corner(3, NONE), corner(5, NONE)]);
        builder.finish()
    }

    #[test]
    fn the_written_file_is_valid_and_reads_back() {
        let png = encode_png(&Image::zeros(3, 2, 3, Depth::U8).unwrap()).unwrap();
        let materials = [
            GlbMaterial {
                name: "a".into(),
                base_color: [1.0; 4],
                texture: Some(png.clone().into()),
                ..GlbMaterial::default()
            },
            GlbMaterial { name: "b".into(), base_color: [0.5, 0.25, 0.0, 1.0], ..GlbMaterial::default() },
        ];
        let mesh = seamed();
        let bytes = glb_bytes(&mesh, &materials).unwrap();
        // An independent reader validates the document and decodes it.
        let (document, buffers, images) = ::gltf::import_slice(&bytes).unwrap();
        assert_eq!((images.len(), images[0].width, document.materials().len()), (1, 3, 2));
        let primitives: Vec<_> = document.meshes().next().unwrap().primitives().collect();
        assert_eq!(primitives.len(), 2);
        let reader = primitives[0].reader(|b| Some(&buffers[b.index()]));
        // Vertices 1, 2, 3, 4, and vertex 2 once more on the other side of the seam.
        assert_eq!(reader.read_positions().unwrap().count(), 5);
        assert_eq!(reader.read_indices().unwrap().into_u32().count(), 6);
        assert!(reader.read_normals().unwrap().all(|n| (n.iter().map(|x| x * x).sum::<f32>() - 1.0).abs() < 1e-5));
        let bounds = primitives[0].bounding_box();
        assert_eq!((bounds.min, bounds.max), ([0.0; 3], [1.0, 1.0, 0.0]));
        assert!(primitives[1].get(&::gltf::Semantic::TexCoords(0)).is_none());

        let back = parse_gltf(&bytes, Path::new("x.glb")).unwrap();
        assert_eq!(back.mesh.triangle_count(), 3);
        for (t, original) in [0, 1, 3].into_iter().enumerate() {
            assert_eq!(back.mesh.triangle_positions(t), mesh.triangle_positions(original));
            assert_eq!(back.mesh.triangle_texcoords(t), mesh.triangle_texcoords(original));
            assert_eq!(back.mesh.triangle_material(t), mesh.triangle_material(original));
        }
        // The seam does not cut the surface.
        assert_eq!(back.mesh.triangle(0)[1], back.mesh.triangle(1)[1]);
        assert!(back.warnings[0].contains("joined"), "{:?}", back.warnings);
        let embedded = back.mesh.materials[0].embedded_texture.clone().unwrap();
        assert_eq!(*embedded, png[..]);
        assert_eq!(decode_image(&embedded, "embedded").unwrap().width, 3);
        assert_eq!(back.mesh.materials[1].base_color, [0.5, 0.25, 0.0, 1.0]);
    }

    #[test]
    fn one_material_covers_all_and_faults_are_refused() {
        let one = [GlbMaterial { name: "all".into(), base_color: [1.0; 4], ..GlbMaterial::default() }];
        for materials in [&one[..], &[]] {
            let bytes = glb_bytes(&seamed(), materials).unwrap();
            let (document, ..) = ::gltf::import_slice(&bytes).unwrap();
            assert_eq!(document.meshes().next().unwrap().primitives().len(), 1);
        }
        assert!(glb_bytes(&Mesh::default(), &one).is_err());
        let far = Mesh::of_triangles("far", vec![DVec3::X * 1e300, DVec3::Y, DVec3::Z], &[[0, 1, 2]]);
        assert!(glb_bytes(&far, &one).unwrap_err().to_string().contains("vertex 0"));
    }

    #[test]
    fn every_truncation_is_an_error() {
        let bytes = glb_bytes(&seamed(), &[]).unwrap();
        for length in 0..bytes.len() {
            assert!(parse_gltf(&bytes[..length], Path::new("cut.glb")).is_err(), "cut at {length}");
        }
    }
}
