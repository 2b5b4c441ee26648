//! Stanford PLY, text and binary of either byte order.
//!
//! Kept: positions, normals, colours (`vertex_colors`), texture coordinates of vertices (`s t`, `u
//! v`, `texture_u texture_v`) and of face corners (the `texcoord` list of MeshLab, with `texnumber`
//! and its `TextureFile` comments). Other elements and properties are passed over. Counts of the
//! header are only believed as far as the file goes: nothing is allocated from them.

use std::path::Path;

use glam::{DVec2, DVec3};

use super::LoadedMesh;
use super::assemble::{self, Faces, TexcoordPool};
use super::locate::locate;
use super::ply_header::{Encoding, Header, Kind, Property, Scalar};
use super::source::{self, Notes};
use super::spelling::{self, Spellings};
use super::text_lines::line_at;
use super::vertex_colors::{self, ColorColumn, Colors};
use crate::geometry::{Corner, Material, MeshBuilder, NONE};
use crate::{Error, Result};

/// A result whose error still lacks its place in the file.
type Told<T> = std::result::Result<T, String>;

/// Reads a PLY file. O(file size) time and memory.
///
/// # Errors
/// [`Error::Io`], or [`Error::Format`] naming the header line, or the element at which the body
/// fails.
pub fn read_ply(path: impl AsRef<Path>) -> Result<LoadedMesh> {
    let path = path.as_ref();
    parse_ply(&source::read_all(path)?, path)
}

/// Reads PLY content; `path` names it in messages and locates its textures.
///
/// # Errors
/// As [`read_ply`].
pub fn parse_ply(bytes: &[u8], path: &Path) -> Result<LoadedMesh> {
    parse(bytes, path, Faces::Needed)
}

/// Reads a PLY file that may hold points alone.
pub(super) fn read_points(path: &Path) -> Result<LoadedMesh> {
    parse(&source::read_all(path)?, path, Faces::Optional)
}

fn parse(bytes: &[u8], path: &Path, faces: Faces) -> Result<LoadedMesh> {
    source::refuse_utf16(path, bytes)?;
    let header = Header::parse(bytes, path)?;
    let mut body = Body { bytes, at: header.length, encoding: header.encoding, path };
    let mut builder = MeshBuilder::new(path.display().to_string());
    let mut notes = Notes::default();
    let mut spellings = Spellings::new(spelling::guess(header.textures.iter().map(Vec::as_slice)));
    for written in &header.textures {
        let found = locate(path, written);
        notes.texture(written, &found);
        let name = spellings.text(written);
        let material = Material { name, base_color_texture: Some(found.into_path()), ..Material::default() };
        builder.mesh.materials.push(material);
    }
    builder.mesh.spellings = spellings.into_bytes().collect();
    for element in &header.elements {
        let mut item = Item::new(&element.properties.iter().map(|p| p.kind).collect::<Vec<_>>());
        let find = |names: &[&str], list: bool| {
            let is_list = |k: Kind| matches!(k, Kind::List(..));
            element.properties.iter().position(|p| names.contains(&p.name.as_str()) && is_list(p.kind) == list)
        };
        match element.name.as_str() {
            "vertex" => {
                let slots = VertexSlots::find(&find, path)?;
                let mut columns = color_columns(&element.properties);
                body.each(&element.name, element.count, &mut item, |item| {
                    columns.iter_mut().for_each(|(k, c)| c.values.push(item.scalars[*k]));
                    slots.store(item, &mut builder)
                })?;
                let columns: Vec<VertexColumn> = columns.into_iter().map(|(_, c)| c).collect();
                if let Some(colors) = colors(&columns) {
                    builder.mesh.colors = colors.rgba();
                    colors.note.into_iter().for_each(|note| notes.say(note));
                }
            }
            "face" => {
                let Some(indices) = find(&["vertex_indices", "vertex_index"], true) else {
                    let remedy = "Export the mesh with faces as lists of vertex indices";
                    return Err(Error::format(path, None, "the faces have no list vertex_indices", remedy));
                };
                let texcoords = find(&["texcoord"], true);
                let texture = find(&["texnumber"], false);
                let mut pool = TexcoordPool::default();
                let slots = FaceSlots { indices, texcoords, texture };
                body.each(&element.name, element.count, &mut item, |item| {
                    slots.store(item, &mut builder, &mut pool, &mut notes)
                })?;
            }
            // An element without properties takes no bytes, whatever its count.
            _ if element.properties.is_empty() => {}
            _ => body.each(&element.name, element.count, &mut item, |_| Ok(()))?,
        }
    }
    if builder.mesh.polygon_count() == 0 && header.elements.iter().any(|e| e.name == "tristrips") {
        let remedy = "Export the mesh with plain triangles";
        return Err(Error::format(path, None, "the surface is stored as triangle strips", remedy));
    }
    let mesh = &mut builder.mesh;
    if !mesh.normals.is_empty() && mesh.normals.len() != mesh.positions.len() {
        mesh.normals.clear();
    }
    assemble::finish_as(builder, notes, path, faces)
}

/// A scalar property of the vertices of a PLY file.
#[derive(Clone, Debug)]
pub(crate) struct VertexColumn {
    pub(crate) name: String,
    /// Whether it is stored as whole numbers of one byte without sign.
    pub(crate) byte: bool,
    /// One for each vertex, as stored.
    pub(crate) values: Vec<f64>,
}

/// The colours among columns of vertices.
pub(crate) fn colors(columns: &[VertexColumn]) -> Option<Colors> {
    fn column(c: &VertexColumn) -> ColorColumn<'_> {
        ColorColumn { name: &c.name, byte: c.byte, values: &c.values }
    }
    vertex_colors::find(&columns.iter().map(column).collect::<Vec<_>>())
}

/// Empty columns for the properties that may be colours, with their places.
fn color_columns(properties: &[Property]) -> Vec<(usize, VertexColumn)> {
    let column = |(k, p): (usize, &Property)| match p.kind {
        Kind::Scalar(scalar) if vertex_colors::may_be(&p.name) => {
            let byte = matches!(scalar, Scalar::U8);
            Some((k, VertexColumn { name: p.name.clone(), byte, values: Vec::new() }))
        }
        _ => None,
    };
    properties.iter().enumerate().filter_map(column).collect()
}

/// The scalar properties of the vertices of a PLY file, in its order; of several with one name the
/// first.
///
/// # Errors
/// As [`read_ply`].
pub(crate) fn read_vertex_columns(path: &Path) -> Result<Vec<VertexColumn>> {
    let bytes = source::read_all(path)?;
    let header = Header::parse(&bytes, path)?;
    let mut body = Body { bytes: &bytes, at: header.length, encoding: header.encoding, path };
    for element in header.elements.iter().filter(|e| !e.properties.is_empty()) {
        let mut item = Item::new(&element.properties.iter().map(|p| p.kind).collect::<Vec<_>>());
        if element.name != "vertex" {
            body.each(&element.name, element.count, &mut item, |_| Ok(()))?;
            continue;
        }
        let mut columns: Vec<(usize, VertexColumn)> = Vec::new();
        for (k, p) in element.properties.iter().enumerate() {
            if let Kind::Scalar(scalar) = p.kind
                && !columns.iter().any(|(_, c)| c.name == p.name)
            {
                let byte = matches!(scalar, Scalar::U8);
                columns.push((k, VertexColumn { name: p.name.clone(), byte, values: Vec::new() }));
            }
        }
        body.each(&element.name, element.count, &mut item, |item| {
            columns.iter_mut().for_each(|(k, c)| c.values.push(item.scalars[*k]));
            Ok(())
        })?;
        return Ok(columns.into_iter().map(|(_, c)| c).collect());
    }
    Ok(Vec::new())
}

/// The numbers that the vertices of a PLY file have under each of `names`, or nothing. Whole
/// numbers of one byte are read as parts of 255, as colours are.
///
/// # Errors
/// As [`read_ply`].
pub(crate) fn read_vertex_properties(path: &Path, names: &[&str]) -> Result<Vec<Option<Vec<f64>>>> {
    let columns = read_vertex_columns(path)?;
    let scaled = |c: &VertexColumn| c.values.iter().map(|v| if c.byte { v / 255.0 } else { *v }).collect();
    Ok(names.iter().map(|name| columns.iter().find(|c| c.name == *name).map(scaled)).collect())
}

/// The values of one element: scalars, and lists in one buffer.
struct Item {
    kinds: Vec<Kind>,
    scalars: Vec<f64>,
    lists: Vec<Vec<f64>>,
}

impl Item {
    fn new(kinds: &[Kind]) -> Self {
        Self { kinds: kinds.to_vec(), scalars: vec![0.0; kinds.len()], lists: vec![Vec::new(); kinds.len()] }
    }
}

struct VertexSlots {
    position: [usize; 3],
    normal: Option<[usize; 3]>,
    texcoord: Option<[usize; 2]>,
}

impl VertexSlots {
    fn find(find: &impl Fn(&[&str], bool) -> Option<usize>, path: &Path) -> Result<Self> {
        let mut position = [0; 3];
        for (slot, name) in position.iter_mut().zip(["x", "y", "z"]) {
            *slot = find(&[name], false).ok_or_else(|| {
                let what = format!("the vertices have no property {name}");
                Error::format(path, None, what, "Export the mesh with positions x, y and z")
            })?;
        }
        let all =
            |names: [&str; 3]| Some([find(&[names[0]], false)?, find(&[names[1]], false)?, find(&[names[2]], false)?]);
        let pair = |u: &str, v: &str| Some([find(&[u], false)?, find(&[v], false)?]);
        let texcoord = pair("s", "t").or_else(|| pair("u", "v")).or_else(|| pair("texture_u", "texture_v"));
        Ok(Self { position, normal: all(["nx", "ny", "nz"]), texcoord })
    }

    fn store(&self, item: &Item, builder: &mut MeshBuilder) -> Told<()> {
        let at = |k: usize| item.scalars[k];
        let vector = |[x, y, z]: [usize; 3]| DVec3::new(at(x), at(y), at(z));
        let mesh = &mut builder.mesh;
        if mesh.positions.len() as u64 >= u64::from(NONE) - 1 {
            return Err("more vertices than 32-bit indices can number".into());
        }
        mesh.positions.push(vector(self.position));
        if let Some(normal) = self.normal {
            mesh.normals.push(vector(normal));
        }
        if let Some([u, v]) = self.texcoord {
            mesh.texcoords.push(DVec2::new(at(u), at(v)));
        }
        Ok(())
    }
}

struct FaceSlots {
    indices: usize,
    texcoords: Option<usize>,
    texture: Option<usize>,
}

impl FaceSlots {
    fn store(&self, item: &Item, builder: &mut MeshBuilder, pool: &mut TexcoordPool, notes: &mut Notes) -> Told<()> {
        let indices = &item.lists[self.indices];
        if indices.len() < 3 {
            notes.count("faces with fewer than three corners were left out", None);
            return Ok(());
        }
        if builder.corners_mut().len() as u64 + indices.len() as u64 >= u64::from(NONE) - 1 {
            return Err("more face corners than 32-bit indices can number".into());
        }
        let wedge = self.texcoords.map(|k| &item.lists[k]).filter(|uv| !uv.is_empty());
        if wedge.is_some_and(|uv| uv.len() != 2 * indices.len()) {
            notes.count("faces whose texture coordinates do not match their corners lost them", None);
        }
        let wedge = wedge.filter(|uv| uv.len() == 2 * indices.len());
        let by_vertex = self.texcoords.is_none() && !builder.mesh.texcoords.is_empty();
        let by_vertex_normals = !builder.mesh.normals.is_empty();
        let mut corners = Vec::with_capacity(indices.len());
        for (k, &index) in indices.iter().enumerate() {
            if !(index >= 0.0 && index < f64::from(NONE - 1) && index.fract() == 0.0) {
                return Err(format!("{index} is not a vertex index"));
            }
            let vertex = index as u32;
            let texcoord = match wedge {
                Some(uv) => pool.add(vertex, DVec2::new(uv[2 * k], uv[2 * k + 1]), &mut builder.mesh.texcoords),
                None if by_vertex => vertex,
                None => NONE,
            };
            corners.push(Corner { vertex, texcoord, normal: if by_vertex_normals { vertex } else { NONE } });
        }
        let materials = builder.mesh.materials.len();
        let number = self.texture.map_or(0.0, |k| item.scalars[k]);
        builder.material = if number >= 0.0 && number < materials as f64 { number as u32 } else { NONE };
        builder.polygon(corners);
        Ok(())
    }
}

/// The numbers after the header.
struct Body<'a> {
    bytes: &'a [u8],
    at: usize,
    encoding: Encoding,
    path: &'a Path,
}

impl Body<'_> {
    /// Reads `count` items one after the other; stops at the end of the file, which comes long
    /// before an absurd count.
    fn each(
        &mut self,
        name: &str,
        count: u64,
        item: &mut Item,
        mut store: impl FnMut(&Item) -> Told<()>,
    ) -> Result<()> {
        if item.kinds.is_empty() {
            return Ok(());
        }
        for k in 0..count {
            if let Err(what) = self.item(item).and_then(|()| store(item)) {
                let line = (self.encoding == Encoding::Ascii).then(|| line_at(self.bytes, self.at));
                let what = format!("{name} {k} of {count}: {what}");
                return Err(Error::format(self.path, line, what, "The file is damaged: export the mesh again"));
            }
        }
        Ok(())
    }

    fn item(&mut self, item: &mut Item) -> Told<()> {
        for (k, kind) in item.kinds.iter().enumerate() {
            match *kind {
                Kind::Scalar(scalar) => item.scalars[k] = self.number(scalar)?,
                Kind::List(length, scalar) => {
                    let length = self.number(length)?;
                    let least = if self.encoding == Encoding::Ascii { 1 } else { scalar.size() };
                    let room = (self.bytes.len() - self.at) / least;
                    if !(length >= 0.0 && length <= room as f64 && length.fract() == 0.0) {
                        return Err(format!("a list of length {length} where {room} numbers can follow"));
                    }
                    item.lists[k].clear();
                    for _ in 0..length as usize {
                        let number = self.number(scalar)?;
                        item.lists[k].push(number);
                    }
                }
            }
        }
        Ok(())
    }

    fn number(&mut self, scalar: Scalar) -> Told<f64> {
        let rest = &self.bytes[self.at..];
        if self.encoding == Encoding::Ascii {
            let skip = rest.iter().position(|b| !b.is_ascii_whitespace()).ok_or("the file ends here")?;
            let word = rest[skip..].split(u8::is_ascii_whitespace).next().unwrap_or_default();
            let text = String::from_utf8_lossy(word);
            let value = super::obj::parse_number(&text)
                .ok_or_else(|| format!("{:?} is not a number", super::obj::shortened(&text)))?;
            self.at += skip + word.len();
            return Ok(value);
        }
        let value = scalar.read(rest, self.encoding).ok_or("the file ends here")?;
        self.at += scalar.size();
        Ok(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(bytes: &[u8]) -> Result<LoadedMesh> {
        parse_ply(bytes, Path::new("test.ply"))
    }

    const ASCII: &str = "ply\r\nformat ascii 1.0\r\ncomment made by hand\r\ncomment TextureFile a b.png\r\nelement vertex 4\r\n\
        property float x\r\nproperty double y\r\nproperty float z\r\nproperty uchar red\r\nproperty float s\r\nproperty float t\r\n\
        element face 2\r\nproperty list uchar int vertex_indices\r\nproperty uchar flags\r\nend_header\r\n\
        0 0 0 255 0 0\r\n1 0 0 255 1 0\r\n1 1 0 9 1 1\r\n0 1 0.5 0 0 1\r\n4 0 1 2 3 7\r\n3 3 2 1 7\r\n";

    #[test]
    fn text_with_texture_coordinates_of_vertices() {
        let mesh = parse(ASCII.as_bytes()).unwrap().mesh;
        assert_eq!(mesh.triangles(), [[0, 1, 2], [0, 2, 3], [3, 2, 1]]);
        assert_eq!(mesh.positions[3], DVec3::new(0.0, 1.0, 0.5));
        assert_eq!(mesh.triangle_texcoords(2).unwrap()[0], DVec2::new(0.0, 1.0));
        assert_eq!((mesh.materials[0].name.as_str(), mesh.polygon_material(1)), ("a b.png", 0));
    }

    #[test]
    fn binary_of_both_orders_with_texture_coordinates_of_corners() {
        for order in ["little", "big"] {
            let mut bytes = format!(
                "ply\nformat binary_{order}_endian 1.0\nelement camera 1\nproperty double f\nelement vertex 3\nproperty float x\n\
                 property float y\nproperty float z\nelement face 2\nproperty list uchar uint vertex_index\n\
                 property list uchar float texcoord\nproperty int texnumber\nend_header\n"
            )
            .into_bytes();
            let put = |bytes: &mut Vec<u8>, le: &[u8]| {
                let reversed = le.iter().rev().copied().collect::<Vec<u8>>();
                bytes.extend(if order == "little" { le } else { &reversed });
            };
            put(&mut bytes, &1.5f64.to_le_bytes());
            for x in [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
                put(&mut bytes, &x.to_le_bytes());
            }
            for _ in 0..2 {
                bytes.push(3);
                for i in [0u32, 1, 2] {
                    put(&mut bytes, &i.to_le_bytes());
                }
                bytes.push(6);
                for x in [0.0f32, 0.25, 0.5, 0.25, 0.75, 1.0] {
                    put(&mut bytes, &x.to_le_bytes());
                }
                put(&mut bytes, &(-1i32).to_le_bytes());
            }
            let mesh = parse(&bytes).unwrap().mesh;
            assert_eq!(mesh.positions[1], DVec3::X, "{order}");
            assert_eq!(mesh.triangle_texcoords(1).unwrap()[2], DVec2::new(0.75, 1.0));
            // Equal values at a vertex share an index.
            assert_eq!((mesh.texcoords.len(), mesh.triangle_corners(0)), (3, mesh.triangle_corners(1)));
            assert_eq!(mesh.polygon_material(0), NONE);
            for length in 0..bytes.len() {
                assert!(parse(&bytes[..length]).is_err(), "{order}: cut at {length}");
            }
        }
    }

    #[test]
    fn faults_name_their_place() {
        let replaced = |from: &str, to: &str| parse(ASCII.replace(from, to).as_bytes()).unwrap_err().to_string();
        for (from, to, expected) in [
            ("vertex 4", "vertex 99999999999999", "vertex 5 of"),
            ("vertex 4", "vertex -4", "line 5"),
            ("property double y", "property double why", "no property y"),
            ("property double y", "property quad y", "line 7"),
            ("vertex_indices", "corners", "no list vertex_indices"),
            ("4 0 1 2 3 7", "4000000000 0 1 2 3 7", "a list of length"),
            ("4 0 1 2 3 7", "-1 0 1 2 3 7", "a list of length"),
            ("4 0 1 2 3 7", "4 0 1 2 9 7", "face 0 refers to vertex 9"),
            ("4 0 1 2 3 7", "4 0 1 2 0.5 7", "0.5 is not a vertex index"),
            ("1 1 0 9", "1 1 inf 9", "position of vertex 2 is not finite"),
            ("1 1 0 9", "1 one 0 9", "line 18: vertex 2 of 4: \"one\" is not a number"),
            ("ascii", "base64", "base64"),
            ("face 2", "face 0", "no face with three"),
            ("ply", "pli", "ply"),
        ] {
            let message = replaced(from, to);
            assert!(message.contains(expected), "{from} -> {to}: {message:?} lacks {expected:?}");
        }
        let endless = ASCII.replace("element face", "element nothing 18446744073709551615\r\nelement face");
        assert!(parse(endless.as_bytes()).is_ok());
    }
}
