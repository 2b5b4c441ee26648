//! Writing Wavefront OBJ.

use std::borrow::Cow;
use std::collections::HashSet;
use std::io::Write;
use std::path::{Component, Path, PathBuf};

use super::companion::{Companions, Taken};
use super::locate::path_bytes;
use super::material_library::{self as library, keyword};
use super::source::Notes;
use super::{finite, output};
use crate::geometry::material::{BASE_COLOR, TextureContent, Wrap};
use crate::geometry::{Material, Mesh, NONE};
use crate::picture::linear_to_srgb;
use crate::{Error, Result};

/// Writes `mesh` as OBJ, and its materials, if it has any, as an MTL file of the same name beside
/// it; where they are those of the libraries that the mesh was read with, these are referred to.
/// Another file of that name stays, and the MTL file gets a free one ([`write_obj_with`]).
///
/// Vertex order, polygons, texture coordinates, normals, colours, groups, smoothing groups and
/// materials are kept, names with the bytes they had in the file, numbers with as many digits as
/// read back to the same value. Textures are referred to where they lie; embedded ones are written
/// beside the file. Each file appears whole or not at all, the OBJ last.
///
/// # Errors
/// [`crate::Error::Io`] if a file cannot be written; [`crate::Error::NotFinite`] for a coordinate
/// that is not finite.
pub fn write_obj(mesh: &Mesh, path: impl AsRef<Path>) -> Result<()> {
    write_obj_with(mesh, path, Taken::Stays).map(drop)
}

/// As [`write_obj`], with what becomes of files that have the names of its companions; returns the
/// companions.
///
/// # Errors
/// As [`write_obj`].
#[doc(hidden)]
pub fn write_obj_with(mesh: &Mesh, path: impl AsRef<Path>, taken: Taken) -> Result<Companions> {
    let path = path.as_ref();
    finite::mesh(path, mesh)?;
    let mut companions = Companions::default();
    let libraries = if mesh.materials.is_empty() {
        Vec::new()
    } else if let Some(unchanged) = unchanged_libraries(mesh, path) {
        companions.referred.clone_from(&mesh.libraries);
        unchanged
    } else {
        let text = material_library(mesh, path, taken, &mut companions)?;
        let library = companions.write(&path.with_extension("mtl"), &text, taken)?;
        vec![path_bytes(Path::new(library.file_name().unwrap_or_default()))]
    };
    output::write_atomically(path, |w| write_statements(mesh, &libraries, w).map_err(output::failed(path)))?;
    Ok(companions)
}

/// The libraries that the mesh was read with, as seen from the folder of `path`, if they define its
/// materials as these are now. The first of two that define a name is the last one here, which
/// counts for readers.
fn unchanged_libraries(mesh: &Mesh, path: &Path) -> Option<Vec<Vec<u8>>> {
    if mesh.libraries.is_empty() {
        return None;
    }
    let read = |file: &PathBuf| library::read(file, &mut Notes::default()).ok();
    let defined: Vec<_> = mesh.libraries.iter().map(read).collect::<Option<Vec<_>>>()?.into_iter().flatten().collect();
    let same = |(material, name): (&Material, Vec<u8>)| match defined.iter().find(|d| d.name == name) {
        Some(d) => Material { name: material.name.clone(), ..d.material.clone() } == *material,
        None => Material { name: material.name.clone(), ..Material::default() } == *material,
    };
    if !mesh.materials.iter().zip(Names { mesh }.materials()).all(same) {
        return None;
    }
    let names: Vec<Vec<u8>> = mesh.libraries.iter().rev().map(|l| path_bytes(&relative(l, path))).collect();
    // What would not be read back as it is written.
    let awkward = |n: &Vec<u8>| n.iter().any(|b| b.is_ascii_control() || b"\"\\#".contains(b));
    (!names.iter().any(awkward)).then_some(names)
}

fn write_statements(mesh: &Mesh, libraries: &[Vec<u8>], w: &mut impl Write) -> std::io::Result<()> {
    for library in libraries {
        w.write_all(b"mtllib ")?;
        w.write_all(library)?;
        writeln!(w)?;
    }
    write_vertices(mesh, w)?;
    let names = Names { mesh };
    let materials = names.materials();
    let (mut object, mut group, mut material, mut smoothing) = (NONE, NONE, NONE, NONE);
    // A statement without a name ends the group or material before it.
    let name = |w: &mut dyn Write, keyword: &str, name: Option<&[u8]>| -> std::io::Result<()> {
        write!(w, "{keyword} ")?;
        w.write_all(name.unwrap_or_default())?;
        writeln!(w)
    };
    for p in 0..mesh.polygon_count() {
        if mesh.polygon_object(p) != object {
            object = mesh.polygon_object(p);
            group = object;
            name(w, "o", names.group(object).as_deref())?;
        }
        if mesh.polygon_group(p) != group {
            group = mesh.polygon_group(p);
            name(w, "g", names.group(group).as_deref())?;
        }
        if mesh.polygon_material(p) != material {
            material = mesh.polygon_material(p);
            name(w, "usemtl", materials.get(material as usize).map(Vec::as_slice))?;
        }
        if mesh.polygon_smoothing(p) != smoothing {
            smoothing = mesh.polygon_smoothing(p);
            match smoothing {
                0 | NONE => writeln!(w, "s off")?,
                number => writeln!(w, "s {number}")?,
            }
        }
        write!(w, "f")?;
        for c in mesh.file_polygon(p) {
            match (c.texcoord, c.normal) {
                (NONE, NONE) => write!(w, " {}", c.vertex + 1)?,
                (t, NONE) => write!(w, " {}/{}", c.vertex + 1, t + 1)?,
                (NONE, n) => write!(w, " {}//{}", c.vertex + 1, n + 1)?,
                (t, n) => write!(w, " {}/{}/{}", c.vertex + 1, t + 1, n + 1)?,
            }
        }
        writeln!(w)?;
    }
    Ok(())
}

fn write_vertices(mesh: &Mesh, w: &mut impl Write) -> std::io::Result<()> {
    for (v, p) in mesh.positions.iter().enumerate() {
        match mesh.colors.get(v) {
            Some([r, g, b, _]) => writeln!(w, "v {:?} {:?} {:?} {r:?} {g:?} {b:?}", p.x, p.y, p.z)?,
            None => writeln!(w, "v {:?} {:?} {:?}", p.x, p.y, p.z)?,
        }
    }
    for t in mesh.file_texcoords() {
        writeln!(w, "vt {:?} {:?}", t.x, t.y)?;
    }
    for n in mesh.file_normals() {
        writeln!(w, "vn {:?} {:?} {:?}", n.x, n.y, n.z)?;
    }
    Ok(())
}

/// The names of a mesh as OBJ can hold them.
struct Names<'a> {
    mesh: &'a Mesh,
}

impl Names<'_> {
    fn group(&self, g: u32) -> Option<Cow<'_, [u8]>> {
        Some(self.one_line(self.mesh.groups.get(g as usize)?))
    }

    /// A name as it was spelt, or as OBJ can hold it: on one line, not empty, without a backslash
    /// at its end that joins lines.
    fn one_line(&self, name: &str) -> Cow<'_, [u8]> {
        if let Some(bytes) = self.mesh.spellings.get(name) {
            return Cow::Borrowed(bytes);
        }
        let name: String = name.trim().chars().map(|c| if c.is_control() { '_' } else { c }).collect();
        match name.as_str() {
            "" => Cow::Borrowed(b"_"),
            // Behind a blank, or alone, it would go on on the next line.
            _ if name == "\\" || name.ends_with([' ', '\t']) || name.ends_with(" \\") => {
                Cow::Owned(format!("{}_", name.trim_end_matches(['\\', ' '])).into_bytes())
            }
            _ => Cow::Owned(name.into_bytes()),
        }
    }

    /// The materials' names, each once: OBJ knows a material by its name.
    fn materials(&self) -> Vec<Vec<u8>> {
        let mut taken = HashSet::new();
        let unique = |(k, m): (usize, &Material)| {
            let mut name = self.one_line(&m.name).into_owned();
            while !taken.insert(name.clone()) {
                name.extend_from_slice(format!("_{k}").as_bytes());
            }
            name
        };
        self.mesh.materials.iter().enumerate().map(unique).collect()
    }
}

/// The MTL text; writes embedded textures on the way.
fn material_library(mesh: &Mesh, path: &Path, taken: Taken, companions: &mut Companions) -> Result<Vec<u8>> {
    let mut text = Vec::new();
    for (k, (material, name)) in mesh.materials.iter().zip(Names { mesh }.materials()).enumerate() {
        text.extend_from_slice(b"newmtl ");
        text.extend_from_slice(&name);
        text.push(b'\n');
        let [r, g, b] = kd(material);
        if material.has_base_color || material.base_color[..3] != [1.0; 3] {
            text.extend_from_slice(format!("Kd {r:?} {g:?} {b:?}\n").as_bytes());
        }
        if material.base_color[3] != 1.0 {
            text.extend_from_slice(format!("d {:?}\n", material.base_color[3]).as_bytes());
        }
        for statement in &material.statements {
            text.extend_from_slice(&statement.text);
            if let Some(file) = &statement.file {
                text.extend_from_slice(&path_bytes(&on_one_line(relative(file, path))?));
            }
            text.push(b'\n');
        }
        let texture = match (&material.base_color_texture, &material.embedded_texture) {
            (Some(texture), _) => Some(on_one_line(relative(texture, path))?),
            (None, Some(bytes)) => {
                let extension = if bytes.starts_with(&[0xff, 0xd8]) { "jpg" } else { "png" };
                let stem = path.file_stem().unwrap_or_default().to_string_lossy();
                let file = path.with_file_name(format!("{stem}_{k}.{extension}"));
                companions.write(&file, bytes, taken)?.file_name().map(PathBuf::from)
            }
            (None, None) => None,
        };
        if let Some(texture) = texture {
            statement(&mut text, material, BASE_COLOR, 1.0, &texture);
        }
        for other in &material.textures {
            // Embedded ones in other roles stay behind: OBJ files seldom name them.
            let TextureContent::File(file) = &other.content else { continue };
            let strength = if other.role == "normal" { material.look.normal_scale } else { other.strength };
            statement(&mut text, material, &other.role, strength, &on_one_line(relative(file, path))?);
        }
    }
    Ok(text)
}

/// The base colour as MTL files have it, as viewers show it.
fn kd(material: &Material) -> [f32; 3] {
    let [r, g, b, _] = material.base_color;
    // Full light is full, whatever rounding makes of it.
    let shown = |c: f32| if c == 1.0 { c } else { linear_to_srgb(c) };
    if material.srgb_base_color { [r, g, b] } else { [r, g, b].map(shown) }
}

/// A statement that names a texture, if the format has one for its role.
fn statement(text: &mut Vec<u8>, material: &Material, role: &str, strength: f32, file: &Path) {
    let Some(keyword) = keyword(role) else { return };
    let placement = material.placement(role);
    text.extend_from_slice(keyword.as_bytes());
    if strength != 1.0 {
        text.extend_from_slice(format!(" -bm {strength:?}").as_bytes());
    }
    // Turns and mirrored repeats have no options.
    let transform = placement.transform;
    let (scale, offset) = ([transform.matrix2.x_axis.x, transform.matrix2.y_axis.y], transform.translation);
    if scale != [1.0; 2] {
        text.extend_from_slice(format!(" -s {:?} {:?}", scale[0], scale[1]).as_bytes());
    }
    if offset != glam::DVec2::ZERO {
        text.extend_from_slice(format!(" -o {:?} {:?}", offset.x, offset.y).as_bytes());
    }
    if placement.wrap.contains(&Wrap::Clamp) {
        text.extend_from_slice(b" -clamp on");
    }
    let kept = material.texture_options.iter().filter(|(of, _)| of == role);
    kept.for_each(|(_, options)| text.extend_from_slice(options));
    text.push(b' ');
    text.extend_from_slice(&path_bytes(file));
    text.push(b'\n');
}

/// Fails for a file whose name has a line break: a statement is a line.
fn on_one_line(file: PathBuf) -> Result<PathBuf> {
    if file.to_string_lossy().contains(['\n', '\r']) {
        let what = format!("{file:?} has a line break in its name, and a material library has no place for it");
        return Err(Error::input(what, "Give the file and its folders names on one line, or write a GLB file"));
    }
    Ok(file)
}

/// `texture` as seen from the folder of `file`, or absolute where there is no way between them.
fn relative(texture: &Path, file: &Path) -> PathBuf {
    let folder = file.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let (Ok(texture), Ok(folder)) = (std::path::absolute(texture), folder.canonicalize()) else {
        return texture.to_path_buf();
    };
    let texture = texture.canonicalize().unwrap_or(texture);
    let common = texture.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
    if common == 0 {
        return texture;
    }
    let up = folder.components().skip(common).map(|_| Component::ParentDir);
    up.chain(texture.components().skip(common)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::obj::{parse_obj, read_obj};

    /// The first difference of two meshes as the format sees them.
    fn difference(a: &Mesh, b: &Mesh) -> Option<String> {
        let bits = |m: &Mesh| -> Vec<[u64; 3]> { m.positions.iter().map(|p| p.to_array().map(f64::to_bits)).collect() };
        if bits(a) != bits(b) {
            return Some("positions".into());
        }
        if a.colors != b.colors {
            return Some("colours".into());
        }
        if a.texcoords != b.texcoords || a.normals != b.normals {
            return Some("texcoords or normals".into());
        }
        if a.polygon_count() != b.polygon_count() {
            return Some("polygon count".into());
        }
        (0..a.polygon_count()).find_map(|p| {
            let group = |m: &Mesh| m.groups.get(m.polygon_group(p) as usize).cloned();
            let material = |m: &Mesh| m.materials.get(m.polygon_material(p) as usize).cloned();
            let object = |m: &Mesh| m.groups.get(m.polygon_object(p) as usize).cloned();
            let same = a.polygon(p) == b.polygon(p)
                && (group(a), object(a)) == (group(b), object(b))
                && material(a) == material(b)
                && a.polygon_smoothing(p) == b.polygon_smoothing(p);
            (!same).then(|| format!("polygon {p}"))
        })
    }

    const AWKWARD: &str = "mtllib in.mtl\nv 5 5 5\nv 0.1 0.30000000000000004 1e-300\nv 1 0 0\nv 123456789.123456789 0 0\nv 0 1 0\n\
        vt 0.5 -3.25\nvt 1 0.1\nvn 0 0 1\nf 2 3 4\ng left arm\nf 2/1 3/2 4/1 5/2\nusemtl skin\ng right\nf 2//1 3//1 4//1\n\
        g left arm\nf 2/1/1 3/2/1 4/1/1\no hand\ns 3\nf 2 3 5\ng left arm\ns off\nf 2 3 5\no\ng\nusemtl\nf 3 4 5\n";

    #[test]
    fn a_number_that_is_not_finite_is_not_written() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("out.obj");
        std::fs::write(&path, "old").unwrap();
        // Even where nothing uses it.
        let mesh = parse_obj("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nv nan 0 0\n".as_bytes(), &path).unwrap().mesh;
        let message = write_obj(&mesh, &path).unwrap_err().to_string();
        assert!(message.contains("out.obj: vertex 3, x would be NaN"), "{message}");
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
    }

    #[test]
    fn a_round_trip_keeps_everything() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(dir.path().join("a/textures")).unwrap();
        std::fs::create_dir_all(dir.path().join("b/c")).unwrap();
        std::fs::write(dir.path().join("a/textures/skin 1.png"), b"").unwrap();
        std::fs::write(dir.path().join("a/in.mtl"), "newmtl skin\nKd 0.2 0.4 0.6\nd 0.5\nmap_Kd textures/skin 1.png\n")
            .unwrap();
        std::fs::write(dir.path().join("a/in.obj"), AWKWARD).unwrap();
        let first = read_obj(dir.path().join("a/in.obj")).unwrap().mesh;
        let out = dir.path().join("b/c/out.obj");
        write_obj(&first, &out).unwrap();
        let mut second = read_obj(&out).unwrap();
        assert!(second.warnings.is_empty(), "{:?}", second.warnings);
        let texture = second.mesh.materials[0].base_color_texture.take().unwrap();
        assert_eq!(texture, dir.path().join("b/c/../../a/textures/skin 1.png"));
        second.mesh.materials[0].base_color_texture = first.materials[0].base_color_texture.clone();
        assert_eq!(difference(&first, &second.mesh), None);
        // The comparison must see a change of each kind.
        for (from, to) in [
            ("v 5 5 5", "v 5 5 5.000001"),
            ("vt 1 0.1", "vt 1 0.2"),
            ("f 2//1 3//1 4//1", "f 3//1 4//1 2//1"),
            ("g right", "g wrong"),
            ("f 2 3 4\n", "f 2 3 4\nf 2 3 4\n"),
            ("s 3", "s 4"),
            ("o hand", "o foot"),
            ("o hand", "g hand"),
        ] {
            let changed = AWKWARD.replace(from, to);
            let changed = parse_obj(changed.as_bytes(), &dir.path().join("a/in.obj")).unwrap().mesh;
            assert!(difference(&first, &changed).is_some(), "{from} -> {to}");
        }
    }

    #[test]
    fn the_bytes_of_names_and_the_options_of_textures_stay() {
        let dir = tempfile::tempdir().unwrap();
        let place = |name: &str| dir.path().join(name);
        std::fs::write(place("t.png"), b"").unwrap();
        let mtl = b"newmtl K\xf6rper\nNs 10.5\nKd 0.2 0.4 0.6\nmap_Kd -s 2.0 3.0 -o 0.5 0.0 -clamp on -blendu off t.png\nbump -bm 0.25 -texres 64 t.png\n\
            newmtl K\xfcrper\nillum 2\nmap_Ns -clamp on t.png\n";
        let obj = b"mtllib in.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\ng Arm\x83\x5c\nusemtl K\xf6rper\nf 1 2 3\ng Bein\\\nusemtl K\xfcrper\nf 1 2 3\n";
        std::fs::write(place("in.mtl"), mtl).unwrap();
        std::fs::write(place("in.obj"), obj).unwrap();
        let mut loaded = read_obj(place("in.obj")).unwrap();
        assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
        // As if they had been changed; else the file refers to the library.
        loaded.mesh.libraries.clear();
        let names: Vec<&str> = loaded.mesh.materials.iter().map(|m| m.name.as_str()).collect();
        assert_eq!(names.len(), 2);
        assert_ne!(names[0], names[1]);
        write_obj(&loaded.mesh, place("out.obj")).unwrap();
        let (obj, written) = (std::fs::read(place("out.obj")).unwrap(), std::fs::read(place("out.mtl")).unwrap());
        let has = |text: &[u8], part: &[u8]| text.windows(part.len()).any(|w| w == part);
        for part in [&b"\ng Arm\x83\x5c\n"[..], b"\nusemtl K\xf6rper\n", b"\nusemtl K\xfcrper\n", b"\ng Bein\\\n"] {
            assert!(has(&obj, part), "{}", String::from_utf8_lossy(&obj));
        }
        for line in mtl.split(|b| *b == b'\n').filter(|l| !l.is_empty()) {
            assert!(has(&written, line.trim_ascii()), "{}", String::from_utf8_lossy(&written));
        }
        assert_eq!(difference(&loaded.mesh, &read_obj(place("out.obj")).unwrap().mesh), None);
    }

    #[test]
    fn names_of_other_formats_cannot_break_the_file() {
        let dir = tempfile::tempdir().unwrap();
        let mut builder = crate::geometry::MeshBuilder::new("m");
        builder.mesh.positions = vec![glam::DVec3::ZERO, glam::DVec3::X, glam::DVec3::Y];
        builder.mesh.groups = vec!["a\nf 1 1 1".into(), "b \\".into(), " ".into()];
        let texture: std::sync::Arc<[u8]> = b"\x89PNG"[..].into();
        builder.mesh.materials = ["m\r\nx", "m__x", "", ""]
            .map(|name| Material { name: name.into(), embedded_texture: Some(texture.clone()), ..Material::default() })
            .to_vec();
        for k in 0..4 {
            (builder.group, builder.material) = (k % 3, k);
            builder.polygon([0, 1, 2].map(|vertex| crate::geometry::Corner { vertex, texcoord: NONE, normal: NONE }));
        }
        let path = dir.path().join("out.obj");
        write_obj(&builder.finish(), &path).unwrap();
        let back = read_obj(&path).unwrap();
        assert!(back.warnings.is_empty(), "{:?}", back.warnings);
        assert_eq!((back.mesh.triangle_count(), back.mesh.groups.len(), back.mesh.materials.len()), (4, 3, 4));
        let textures: HashSet<_> = back.mesh.materials.iter().map(|m| m.base_color_texture.clone().unwrap()).collect();
        assert!(textures.len() == 4 && textures.iter().all(|t| std::fs::read(t).unwrap() == *texture));
    }
}
