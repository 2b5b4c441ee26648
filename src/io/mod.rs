//! Files: meshes, images, anchors, points, cages, outlines, arrays, reports and the cache.
//!
//! Readers take what real files hold: they tell what they passed over in warnings, and what cannot
//! be used in errors that name the file, the line and the remedy. No header makes them allocate
//! more than the file can fill. Writers go through [`output`], so that a file appears whole or not
//! at all.

pub mod anchors;
mod assemble;
#[doc(hidden)]
pub mod attribute_table;
pub mod cache;
pub mod cage;
mod cage_outline;
mod companion;
pub mod decal_anchors;
mod encoding;
#[doc(hidden)]
pub mod finite;
mod finite_gltf;
pub mod geojson;
#[doc(hidden)]
pub mod gltf_animation;
mod gltf_colors;
mod gltf_components;
mod gltf_compressed;
mod gltf_container;
mod gltf_document;
mod gltf_edit;
mod gltf_edit_frames;
mod gltf_edit_looks;
mod gltf_edit_pictures;
mod gltf_edit_shape;
mod gltf_edit_skin;
mod gltf_edit_uv;
mod gltf_extensions;
mod gltf_layout;
mod gltf_look;
mod gltf_materials;
mod gltf_nodes;
mod gltf_parts;
mod gltf_pose;
#[doc(hidden)]
pub mod gltf_read;
#[cfg(test)]
mod gltf_samples;
mod gltf_scene;
mod gltf_skin;
mod gltf_split;
pub mod gltf_upright;
#[cfg(test)]
#[path = "../../tests/common/gltf_validator.rs"]
mod gltf_validator;
pub mod gltf_write;
pub mod handles;
pub mod image_file;
pub(crate) mod kept;
mod locate;
pub mod markers;
pub mod mask;
mod material_library;
pub mod motion;
#[cfg(test)]
mod mutants;
#[doc(hidden)]
pub mod npy;
#[doc(hidden)]
pub mod obj;
pub mod obj_write;
#[doc(hidden)]
pub mod off;
mod open;
pub mod outline;
pub mod output;
pub mod output_set;
#[doc(hidden)]
pub mod ply;
mod ply_header;
#[doc(hidden)]
pub mod ply_write;
#[doc(hidden)]
pub mod point_table;
pub mod points;
pub mod polyline;
pub mod report;
mod source;
mod spelling;
pub mod svg;
mod svg_path;
mod svg_transform;
pub mod table;
mod table_dialect;
mod table_number;
pub mod target_list;
mod text_lines;
pub mod texture_name;
mod vertex_colors;

use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use glam::DVec3;

use crate::geometry::{Mesh, RANGE, Weld, weld};
use crate::{Error, Result};

#[doc(hidden)]
pub use anchors::ResolvedAnchor;
pub use anchors::{AnchorList, AnchorPairs, AnchorSpec};
pub use cache::{Cache, CacheKey};
#[doc(hidden)]
pub use companion::{Companions, Taken};
#[doc(hidden)]
pub use gltf_animation::write_animated_glb;
pub use gltf_animation::{GlbAnimation, GlbAnimationReport, MorphForm};
pub use gltf_scene::{GltfScene, KeepTextures, SceneEdit, SkinWeights};
#[doc(hidden)]
pub use gltf_skin::SkinTable;
pub use gltf_write::{GlbMaterial, GlbTexture, write_glb};
pub use handles::{check_handles, read_handles_on, read_vertices_on};
#[doc(hidden)]
pub use handles::{read_handles, read_vertex_list};
pub use image_file::{read_image, read_picture, read_texture, write_image, write_picture};
pub use locate::confined;
#[doc(hidden)]
pub use markers::MarkerPlace;
pub use markers::read_markers;
pub use mask::read_mask;
pub use motion::{Motion, read_motion};
pub use obj_write::write_obj;
#[doc(hidden)]
pub use obj_write::write_obj_with;
pub use output::check_writable;
#[doc(hidden)]
pub use output::write_atomically;
pub use ply_write::write_ply;
pub use report::write_report;
pub use texture_name::TextureName;

/// A mesh read from a file, with what was passed over or mended on the way.
#[derive(Clone, Debug)]
pub struct LoadedMesh {
    /// The mesh.
    pub mesh: Mesh,
    /// One sentence each; empty for a clean file.
    pub warnings: Vec<String>,
    /// What a glTF file holds beside the mesh.
    pub scene: Option<Arc<GltfScene>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum MeshFormat {
    Obj,
    Ply,
    Off,
    Gltf,
}

/// How a mesh is read.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// Which repeated vertices are joined for the computation.
    pub weld: Weld,
    /// Which set of texture coordinates of glTF files; without it, that of the material's base
    /// colour.
    pub uv_set: Option<usize>,
}

/// Reads a mesh from an OBJ, PLY, OFF, glTF or GLB file, with the default options.
///
/// # Errors
/// As [`read_mesh_with`].
pub fn read_mesh(path: impl AsRef<Path>) -> Result<LoadedMesh> {
    read_mesh_with(path, &ReadOptions::default())
}

/// Reads a mesh from an OBJ, PLY, OFF, glTF or GLB file.
///
/// The content decides where it is unmistakable, else the extension. See [`obj`], [`ply`], [`off`]
/// and [`gltf_read`] for what is kept. Vertices that the file repeats are joined ([`weld`]); the
/// readers of the single formats leave them apart.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] with the line or element and the remedy; [`Error::Option`] for
/// a tolerance that does not fit the mesh.
pub fn read_mesh_with(path: impl AsRef<Path>, options: &ReadOptions) -> Result<LoadedMesh> {
    let path = path.as_ref();
    let mut head = Vec::new();
    let read = source::open(path)?.take(256).read_to_end(&mut head);
    read.map_err(|e| Error::io(path, e, "Check that the file may be read"))?;
    let by_content = sniff(&head);
    let by_name = by_extension(path);
    let unnamed = || resembles_obj(&head).then_some(MeshFormat::Obj);
    let format = by_content.or(by_name).or_else(unnamed).ok_or_else(|| {
        let what = if head.is_empty() { "the file is empty" } else { "this is not a mesh of a known kind" };
        Error::format(path, None, what, "Convert it to OBJ, PLY, OFF, glTF or GLB")
    })?;
    let mut loaded = match format {
        MeshFormat::Obj => obj::read_obj(path),
        MeshFormat::Ply => ply::read_ply(path),
        MeshFormat::Off => off::read_off(path),
        MeshFormat::Gltf => gltf_read::read_gltf_with(path, options),
    }?;
    check_range(path, &loaded.mesh)?;
    if by_name.is_some_and(|named| named != format) {
        loaded.warnings.push(format!("the content is {format:?}, whatever the extension says"));
    }
    if format != MeshFormat::Gltf {
        if let Some(set) = options.uv_set.filter(|&set| set > 0) {
            let what = format!("there is no set {set} of texture coordinates: the format has one");
            return Err(Error::format(path, None, what, "Name set 0, for source and target each: --uv-set 1,0"));
        }
        let welded = weld::weld(&mut loaded.mesh, options.weld, &[])?;
        loaded.warnings.extend(welded.notes());
    }
    Ok(loaded)
}

/// Reads the points and colours of an OBJ or PLY file as a mesh that may have no triangles. Points
/// that no face uses are not joined, and the content decides on the format as for [`read_mesh`].
///
/// # Errors
/// As [`read_mesh`].
pub fn read_points(path: impl AsRef<Path>) -> Result<LoadedMesh> {
    let path = path.as_ref();
    let mut head = Vec::new();
    let read = source::open(path)?.take(256).read_to_end(&mut head);
    read.map_err(|e| Error::io(path, e, "Check that the file may be read"))?;
    let loaded = match sniff(&head).or(by_extension(path)) {
        Some(MeshFormat::Ply) => ply::read_points(path),
        Some(MeshFormat::Obj) => obj::read_points(path),
        _ => read_mesh(path),
    }?;
    check_range(path, &loaded.mesh)?;
    Ok(loaded)
}

/// Fails for coordinates whose products overflow, and for a mesh whose products vanish. Coordinates
/// that are not finite are what they are: such vertices are passed over and told of.
fn check_range(path: &Path, mesh: &Mesh) -> Result<()> {
    let beyond = |p: &DVec3| p.is_finite() && p.abs().max_element() > *RANGE.end();
    if let Some(v) = mesh.positions.iter().position(beyond) {
        let what = format!(
            "vertex {v} is at {}, beyond {:e}: computing with such numbers overflows",
            place(mesh.positions[v]),
            RANGE.end()
        );
        return Err(Error::format(path, None, what, "Scale the model, or remove the vertex if nothing belongs there"));
    }
    let size = mesh.bounds().map_or(0.0, |(low, high)| (high - low).max_element());
    if size > 0.0 && size < *RANGE.start() {
        let what =
            format!("the model is {size:e} wide, less than {:e}: computing with such numbers gives 0", RANGE.start());
        return Err(Error::format(path, None, what, "Scale the model"));
    }
    Ok(())
}

/// A place for messages: with as many digits as there are, and exponents where numbers are large or
/// small.
pub(crate) fn place(p: DVec3) -> String {
    format!("({:?}, {:?}, {:?})", p.x, p.y, p.z)
}

fn by_extension(path: &Path) -> Option<MeshFormat> {
    let extension = path.extension()?.to_string_lossy().to_ascii_lowercase();
    Some(match extension.as_str() {
        "obj" => MeshFormat::Obj,
        "ply" => MeshFormat::Ply,
        "off" | "coff" | "noff" | "stoff" => MeshFormat::Off,
        "gltf" | "glb" => MeshFormat::Gltf,
        _ => return None,
    })
}

/// The format whose opening mark is there.
fn sniff(head: &[u8]) -> Option<MeshFormat> {
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).trim_ascii_start();
    let first = text.split(u8::is_ascii_whitespace).next().unwrap_or_default();
    if first == b"ply" {
        Some(MeshFormat::Ply)
    } else if head.starts_with(b"glTF") || text.starts_with(b"{") {
        Some(MeshFormat::Gltf)
    } else if first.ends_with(b"OFF") && first.len() <= 8 {
        Some(MeshFormat::Off)
    } else {
        None
    }
}

/// Whether the first statement of a text is one of OBJ, which has no mark of its own.
fn resembles_obj(head: &[u8]) -> bool {
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    let mut words = text.split(|b| *b == b'\n' || *b == b'\r').map(|line| line.trim_ascii());
    let first = words.find(|line| !line.is_empty() && !line.starts_with(b"#")).unwrap_or_default();
    let word = first.split(u8::is_ascii_whitespace).next().unwrap_or_default();
    [&b"v"[..], b"vn", b"vt", b"mtllib", b"usemtl", b"o", b"g", b"s"].contains(&word)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeated_vertices_are_joined_unless_told_otherwise() {
        let dir = tempfile::tempdir().unwrap();
        let halves = "0 0 0\n1 0 0\n1 1 0\n0 0 0\n1 1 0\n0 1 0\n";
        let obj = format!("{}f 1 2 3\nf 4 5 6\n", halves.lines().map(|l| format!("v {l}\n")).collect::<String>());
        let head = "property float x\nproperty float y\nproperty float z\nelement face 2\nproperty list uchar int vertex_indices";
        let ply = format!("ply\nformat ascii 1.0\nelement vertex 6\n{head}\nend_header\n{halves}3 0 1 2\n3 3 4 5\n");
        let off = format!("OFF\n6 2 0\n{halves}3 0 1 2\n3 3 4 5\n");
        for (name, text) in [("a.obj", obj), ("a.ply", ply), ("a.off", off)] {
            let path = dir.path().join(name);
            std::fs::write(&path, text).unwrap();
            let loaded = read_mesh(&path).unwrap();
            assert_eq!(loaded.mesh.triangles(), [[0, 1, 2], [0, 2, 5]], "{name}");
            assert!(
                loaded.warnings[0].starts_with("2 of its vertices are repeated along 1 edge"),
                "{:?}",
                loaded.warnings
            );
            let apart = read_mesh_with(&path, &ReadOptions { weld: Weld::No, ..ReadOptions::default() }).unwrap();
            assert_eq!((apart.mesh.triangles(), apart.warnings.len()), (vec![[0, 1, 2], [3, 4, 5]], 0), "{name}");
        }
    }

    #[test]
    fn content_wins_over_the_extension() {
        let dir = tempfile::tempdir().unwrap();
        let off = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
        for (name, text, warnings) in [
            ("a.off", off, 0),
            ("a.obj", off, 1),
            ("noname", off, 0),
            ("stdin", "# from somewhere\n\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", 0),
            ("b.OBJ", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", 0),
        ] {
            let path = dir.path().join(name);
            std::fs::write(&path, text).unwrap();
            let loaded = read_mesh(&path).unwrap();
            assert_eq!((loaded.mesh.triangles(), loaded.warnings.len()), (vec![[0, 1, 2]], warnings), "{name}");
        }
        for (name, text, expected) in [
            ("c.stl", "solid", "not a mesh"),
            ("d", "", "empty"),
            ("e.ply", "", "end_header"),
            ("f.obj", "", "no face"),
            ("g.obj", "v 0 0 0\nv 1 0 0\nv 0 -1e155 0\nf 1 2 3\n", "vertex 2 is at (0.0, -1e155, 0.0), beyond 1e100"),
            ("h.obj", "v 0 0 0\nv 1e-200 0 0\nv 0 1e-201 0\nf 1 2 3\n", "1e-200 wide"),
        ] {
            let path = dir.path().join(name);
            std::fs::write(&path, text).unwrap();
            let message = read_mesh(&path).unwrap_err().to_string();
            assert!(message.contains(expected) && message.contains(name), "{message}");
        }
        assert!(read_mesh(dir.path()).unwrap_err().to_string().contains("folder"));
        assert!(read_mesh(dir.path().join("gone.obj")).unwrap_err().to_string().contains("gone.obj"));
    }
}
