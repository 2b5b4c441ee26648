//! Writing a mesh as GLB, ready to view.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use glam::{DVec2, DVec3};
use serde_json::{Value, json};

use super::output;
use crate::geometry::material::{AlphaMode, BASE_COLOR, Look, TextureContent};
use crate::geometry::{Material, Mesh, NONE};
use crate::{Error, Result};

/// The look of a part of a model.
#[derive(Clone, Debug, Default)]
pub struct GlbMaterial {
    /// Its name.
    pub name: String,
    /// Base colour factor, RGBA, linear; multiplied with the texture.
    pub base_color: [f32; 4],
    /// Base colour texture as the bytes of a PNG or JPEG file.
    pub texture: Option<Arc<[u8]>>,
    /// Textures in other roles: `metallic_roughness`, `normal`, `occlusion` or `emissive`, as the bytes of a PNG or JPEG file. Textures that
    /// several materials share are written once.
    pub textures: Vec<(String, Arc<[u8]>)>,
    /// Factors, and how opacity is used.
    pub look: Look,
}

/// Writes `mesh` as a binary glTF 2.0 file with computed smooth normals.
///
/// `materials[k]` is used by the polygons with material `k`; polygons without one, or beyond the list, use the first. With one entry the whole mesh
/// uses it. Vertices are repeated along texture seams, as the format asks; unused ones and triangles that repeat a vertex are left out. Positions
/// become single precision.
///
/// # Errors
/// [`Error::Io`]; [`Error::Mesh`] if there is no triangle, a position does not fit single precision, or the file would exceed the format's 4 GiB.
pub fn write_glb(path: impl AsRef<Path>, mesh: &Mesh, materials: &[GlbMaterial]) -> Result<()> {
    output::write_bytes(path, &glb_bytes(mesh, materials)?)
}

/// [`glb_bytes`] where `material_of` names the entry of `materials` for each triangle, whatever the mesh's own are; triangles whose entry is beyond the
/// list use the first.
///
/// # Errors
/// As [`write_glb`].
pub fn glb_with_materials(mesh: &Mesh, materials: &[GlbMaterial], material_of: &[u32]) -> Result<Vec<u8>> {
    let of = |t: usize| material_of.get(t).copied().unwrap_or(NONE);
    glb_of(mesh, materials, of, |_, _| Ok(Vec::new()), |_, _| {})
}

/// The materials that `mesh` itself names, with the textures that the format has a place for: PNG and JPEG files as they are, others as PNG.
///
/// # Errors
/// As [`super::read_image`].
pub fn own_materials(mesh: &Mesh) -> Result<Vec<GlbMaterial>> {
    let bytes = |content: TextureContent| -> Result<Arc<[u8]>> {
        let (content, name): (Arc<[u8]>, _) = match content {
            TextureContent::Embedded(bytes) => (bytes, mesh.name.clone()),
            TextureContent::File(path) => (super::source::read_all(&path)?.into(), path.display().to_string()),
        };
        if content.starts_with(&[0xff, 0xd8]) || content.starts_with(b"\x89PNG") {
            return Ok(content);
        }
        Ok(super::image_file::encode_png(&super::image_file::decode_image(&content, &name)?)?.into())
    };
    let material = |m: &Material| {
        let others = m.textures.iter().filter(|t| ROLES.contains(&t.role.as_str()));
        Ok(GlbMaterial {
            name: m.name.clone(),
            base_color: m.base_color,
            texture: m.texture(BASE_COLOR).map(bytes).transpose()?,
            textures: others.map(|t| Ok((t.role.clone(), bytes(t.content.clone())?))).collect::<Result<_>>()?,
            look: Look { double_sided: true, ..m.look },
        })
    };
    mesh.materials.iter().map(material).collect()
}

/// The roles beside the base colour that glTF has a place for.
const ROLES: [&str; 4] = ["metallic_roughness", "normal", "occlusion", "emissive"];

/// The bytes [`write_glb`] writes.
///
/// # Errors
/// As [`write_glb`].
pub fn glb_bytes(mesh: &Mesh, materials: &[GlbMaterial]) -> Result<Vec<u8>> {
    glb_with(mesh, materials, |_, _| Ok(Vec::new()), |_, _| {})
}

/// [`glb_bytes`] with the morph targets that `targets` adds to each primitive, and what `finish` adds to the document.
pub(super) fn glb_with(
    mesh: &Mesh,
    materials: &[GlbMaterial],
    targets: impl Fn(&Split, &mut Parts) -> Result<Vec<Value>>,
    finish: impl FnOnce(&mut Value, &mut Parts),
) -> Result<Vec<u8>> {
    glb_of(mesh, materials, |t| mesh.triangle_material(t), targets, finish)
}

fn glb_of(
    mesh: &Mesh,
    materials: &[GlbMaterial],
    material_of: impl Fn(usize) -> u32,
    targets: impl Fn(&Split, &mut Parts) -> Result<Vec<Value>>,
    finish: impl FnOnce(&mut Value, &mut Parts),
) -> Result<Vec<u8>> {
    let mut out = Parts::default();
    let normals = vertex_normals(mesh, &mesh.positions);
    let mut primitives = Vec::new();
    for k in 0..materials.len().max(1) {
        let wanted = |t: usize| {
            let m = material_of(t);
            let m = if m == NONE || m as usize >= materials.len() { 0 } else { m as usize };
            m == k
        };
        let split = Split::new(mesh, wanted);
        if split.indices.is_empty() {
            continue;
        }
        let mut primitive = split.write(mesh, &normals, &mut out)?;
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
    let looks: Vec<Value> = materials.iter().map(|m| look(m, &mut pictures, &mut out)).collect();
    let mut root = json!({
        "asset": {"version": "2.0", "generator": concat!("barymap ", env!("CARGO_PKG_VERSION"))},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": primitives}],
    });
    // The format forbids empty lists.
    if !looks.is_empty() {
        root["materials"] = looks.into();
    }
    if !pictures.images.is_empty() {
        root["textures"] = (0..pictures.images.len()).map(|k| json!({"source": k, "sampler": 0})).collect();
        root["images"] = pictures.images.into();
        // Repeating, with mip-maps: texture coordinates outside the unit square repeat as everywhere in this crate.
        root["samplers"] = json!([{"magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 10497}]);
    }
    finish(&mut root, &mut out);
    root["accessors"] = std::mem::take(&mut out.accessors).into();
    root["bufferViews"] = std::mem::take(&mut out.views).into();
    root["buffers"] = json!([{"byteLength": out.bytes.len()}]);
    container(&mesh.name, root.to_string().into_bytes(), &out.bytes)
}

/// The pictures written so far.
#[derive(Default)]
struct Pictures {
    images: Vec<Value>,
    known: HashMap<Arc<[u8]>, usize>,
}

impl Pictures {
    /// The reference to a picture, written once.
    fn texture(&mut self, bytes: &Arc<[u8]>, out: &mut Parts) -> Value {
        let index = *self.known.entry(bytes.clone()).or_insert_with(|| {
            let kind = if bytes.starts_with(&[0xff, 0xd8]) { "image/jpeg" } else { "image/png" };
            let view = out.view(bytes, None);
            self.images.push(json!({"bufferView": view, "mimeType": kind}));
            self.images.len() - 1
        });
        json!({"index": index})
    }
}

/// The description of a material.
fn look(material: &GlbMaterial, pictures: &mut Pictures, out: &mut Parts) -> Value {
    let l = &material.look;
    let unit = |x: f32| if x.is_finite() { x.clamp(0.0, 1.0) } else { 1.0 };
    let mut pbr = json!({
        "baseColorFactor": material.base_color,
        "metallicFactor": unit(l.metallic),
        "roughnessFactor": unit(l.roughness),
    });
    let mut value = json!({"name": material.name, "doubleSided": l.double_sided});
    if let Some(bytes) = &material.texture {
        pbr["baseColorTexture"] = pictures.texture(bytes, out);
    }
    for (role, bytes) in &material.textures {
        match role.as_str() {
            "metallic_roughness" => pbr["metallicRoughnessTexture"] = pictures.texture(bytes, out),
            "normal" => {
                value["normalTexture"] = pictures.texture(bytes, out);
                value["normalTexture"]["scale"] = json!(l.normal_scale);
            }
            "occlusion" => {
                value["occlusionTexture"] = pictures.texture(bytes, out);
                value["occlusionTexture"]["strength"] = json!(unit(l.occlusion_strength));
            }
            "emissive" => value["emissiveTexture"] = pictures.texture(bytes, out),
            // The format has no place for others.
            _ => {}
        }
    }
    value["pbrMetallicRoughness"] = pbr;
    if l.emissive != [0.0; 3] {
        value["emissiveFactor"] = json!(l.emissive.map(unit));
    }
    match l.alpha {
        AlphaMode::Opaque => {}
        AlphaMode::Mask(cutoff) => {
            value["alphaMode"] = "MASK".into();
            value["alphaCutoff"] = json!(cutoff.max(0.0));
        }
        AlphaMode::Blend => value["alphaMode"] = "BLEND".into(),
    }
    value
}

/// The two chunks, padded as the format asks.
fn container(name: &str, mut json: Vec<u8>, binary: &[u8]) -> Result<Vec<u8>> {
    json.resize(json.len().next_multiple_of(4), b' ');
    let total = 12 + 8 + json.len() + 8 + binary.len();
    if u32::try_from(total).is_err() {
        let what = format!("the file would have {total} bytes, GLB allows 4 GiB");
        return Err(Error::mesh(name, what, "Use smaller textures"));
    }
    let mut file = Vec::with_capacity(total);
    for word in [0x4654_6c67, 2, total as u32, json.len() as u32, 0x4e4f_534a] {
        file.extend_from_slice(&u32::to_le_bytes(word));
    }
    file.extend_from_slice(&json);
    for word in [binary.len() as u32, 0x004e_4942] {
        file.extend_from_slice(&u32::to_le_bytes(word));
    }
    file.extend_from_slice(binary);
    Ok(file)
}

/// The binary chunk as it grows, and what describes it.
#[derive(Default)]
pub(super) struct Parts {
    pub(super) bytes: Vec<u8>,
    views: Vec<Value>,
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

    fn accessor(&mut self, bytes: &[u8], target: u32, component: u32, count: usize, shape: &str) -> usize {
        let view = self.view(bytes, Some(target));
        self.accessors.push(json!({"bufferView": view, "componentType": component, "count": count, "type": shape}));
        self.accessors.len() - 1
    }
}

pub(super) const ARRAY: u32 = 34962;
const ELEMENTS: u32 = 34963;
pub(super) const FLOAT: u32 = 5126;
pub(super) const UNSIGNED_INT: u32 = 5125;

/// The vertices of one material, one for each pair of a vertex and a texture coordinate.
pub(super) struct Split {
    /// A vertex of the mesh and a texture coordinate for each vertex written.
    pub(super) pairs: Vec<(u32, u32)>,
    indices: Vec<u32>,
    textured: bool,
}

impl Split {
    fn new(mesh: &Mesh, wanted: impl Fn(usize) -> bool) -> Self {
        let mut index = HashMap::new();
        let mut split = Self { pairs: Vec::new(), indices: Vec::new(), textured: false };
        for t in (0..mesh.triangle_count()).filter(|&t| wanted(t)) {
            let corners = mesh.triangle_corners(t);
            let [a, b, c] = corners.map(|c| c.vertex);
            if a == b || b == c || c == a {
                continue;
            }
            for corner in corners {
                let pair = (corner.vertex, corner.texcoord);
                split.textured |= corner.texcoord != NONE;
                split.indices.push(*index.entry(pair).or_insert_with(|| {
                    split.pairs.push(pair);
                    split.pairs.len() as u32 - 1
                }));
            }
        }
        split
    }

    fn write(&self, mesh: &Mesh, normals: &[DVec3], out: &mut Parts) -> Result<Value> {
        let mut bytes = Vec::with_capacity(12 * self.pairs.len());
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for &(v, _) in &self.pairs {
            let p = mesh.positions[v as usize].as_vec3();
            if !p.is_finite() {
                let what = format!("the position of vertex {v} does not fit single precision");
                return Err(Error::mesh(&mesh.name, what, "Scale the mesh or correct the vertex"));
            }
            for (k, x) in p.to_array().into_iter().enumerate() {
                low[k] = low[k].min(x);
                high[k] = high[k].max(x);
                bytes.extend_from_slice(&x.to_le_bytes());
            }
        }
        let positions = out.accessor(&bytes, ARRAY, FLOAT, self.pairs.len(), "VEC3");
        out.accessors[positions]["min"] = json!(low);
        out.accessors[positions]["max"] = json!(high);
        bytes.clear();
        for &(v, _) in &self.pairs {
            let n = normals[v as usize].as_vec3();
            bytes.extend(n.to_array().into_iter().flat_map(f32::to_le_bytes));
        }
        let normals = out.accessor(&bytes, ARRAY, FLOAT, self.pairs.len(), "VEC3");
        let mut attributes = json!({"POSITION": positions, "NORMAL": normals});
        if self.textured {
            bytes.clear();
            for &(_, t) in &self.pairs {
                let uv = mesh.texcoords.get(t as usize).copied().unwrap_or(DVec2::ZERO);
                // The format's v runs down from the top of the picture.
                for x in [uv.x as f32, (1.0 - uv.y) as f32] {
                    bytes.extend_from_slice(&if x.is_finite() { x } else { 0.0 }.to_le_bytes());
                }
            }
            attributes["TEXCOORD_0"] = out.accessor(&bytes, ARRAY, FLOAT, self.pairs.len(), "VEC2").into();
        }
        let bytes: Vec<u8> = self.indices.iter().flat_map(|i| i.to_le_bytes()).collect();
        let indices = out.accessor(&bytes, ELEMENTS, UNSIGNED_INT, self.indices.len(), "SCALAR");
        Ok(json!({"attributes": attributes, "indices": indices}))
    }
}

/// Area-weighted unit normals of the vertices at `positions`; up where there is none.
pub(super) fn vertex_normals(mesh: &Mesh, positions: &[DVec3]) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; mesh.vertex_count()];
    for t in 0..mesh.triangle_count() {
        let [a, b, c] = mesh.triangle(t).map(|v| positions[v as usize]);
        let n = (b - a).cross(c - a);
        if n.is_finite() {
            for v in mesh.triangle(t) {
                normals[v as usize] += n;
            }
        }
    }
    normals.into_iter().map(|n| n.try_normalize().unwrap_or(DVec3::Z)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Corner, MeshBuilder};
    use crate::io::gltf_read::parse_gltf;
    use crate::io::image_file::{decode_image, encode_png};
    use crate::raster::{Depth, Image};

    /// Two textured triangles with a seam between them, one of the second material, and one that repeats a vertex.
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
        builder.build()
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
        let far = Mesh::from_triangles("far", vec![DVec3::X * 1e300, DVec3::Y, DVec3::Z], &[[0, 1, 2]]);
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
