//! Writing Wavefront OBJ.

use std::collections::HashSet;
use std::fmt::Write as _;
use std::io::Write;
use std::path::{Component, Path, PathBuf};

use super::material_library::keyword;
use super::output;
use crate::Result;
use crate::geometry::material::TextureContent;
use crate::geometry::{Material, Mesh, NONE};

/// Writes `mesh` as OBJ, and its materials, if it has any, as an MTL file of the same name beside it.
///
/// Vertex order, polygons, texture coordinates, normals, groups and materials are kept, numbers with as many digits as read back to the same value.
/// Textures are referred to where they lie; embedded ones are written beside the file. Each file appears whole or not at all, the OBJ last.
///
/// # Errors
/// [`crate::Error::Io`] if a file cannot be written.
pub fn write_obj(mesh: &Mesh, path: impl AsRef<Path>) -> Result<()> {
    let path = path.as_ref();
    if !mesh.materials.is_empty() {
        let library = path.with_extension("mtl");
        let text = material_library(mesh, path)?;
        output::write_bytes(&library, text.as_bytes())?;
    }
    output::write_atomically(path, |w| write_statements(mesh, path, w).map_err(output::failed(path)))
}

fn write_statements(mesh: &Mesh, path: &Path, w: &mut impl Write) -> std::io::Result<()> {
    if !mesh.materials.is_empty() {
        writeln!(w, "mtllib {}", path.with_extension("mtl").file_name().unwrap_or_default().to_string_lossy())?;
    }
    for p in &mesh.positions {
        writeln!(w, "v {:?} {:?} {:?}", p.x, p.y, p.z)?;
    }
    for t in &mesh.texcoords {
        writeln!(w, "vt {:?} {:?}", t.x, t.y)?;
    }
    for n in &mesh.normals {
        writeln!(w, "vn {:?} {:?} {:?}", n.x, n.y, n.z)?;
    }
    let materials = material_names(mesh);
    let (mut group, mut material) = (NONE, NONE);
    for p in 0..mesh.polygon_count() {
        // A statement without a name ends the group or material before it.
        if mesh.polygon_group(p) != group {
            group = mesh.polygon_group(p);
            writeln!(w, "g {}", mesh.groups.get(group as usize).map_or_else(String::new, |g| one_line(g)))?;
        }
        if mesh.polygon_material(p) != material {
            material = mesh.polygon_material(p);
            writeln!(w, "usemtl {}", materials.get(material as usize).map_or("", |m| m))?;
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

/// A name of another format as OBJ can hold it: on one line, not empty, not ending in the sign that joins lines.
fn one_line(name: &str) -> String {
    let name: String = name.trim().chars().map(|c| if c.is_control() { '_' } else { c }).collect();
    let end = name.trim_end_matches('\\').len();
    if end == 0 { "_".to_owned() } else { name[..end].to_owned() }
}

/// The materials' names, each once: OBJ knows a material by its name.
fn material_names(mesh: &Mesh) -> Vec<String> {
    let mut taken = HashSet::new();
    let unique = |(k, m): (usize, &Material)| {
        let mut name = one_line(&m.name);
        while !taken.insert(name.clone()) {
            name.push_str(&format!("_{k}"));
        }
        name
    };
    mesh.materials.iter().enumerate().map(unique).collect()
}

/// The MTL text; writes embedded textures on the way.
fn material_library(mesh: &Mesh, path: &Path) -> Result<String> {
    let mut text = String::new();
    for (k, (material, name)) in mesh.materials.iter().zip(material_names(mesh)).enumerate() {
        let Material { base_color: [r, g, b, a], .. } = material;
        // Writing to a string cannot fail.
        let _ = write!(text, "newmtl {name}\nKd {r:?} {g:?} {b:?}\n");
        if *a != 1.0 {
            let _ = writeln!(text, "d {a:?}");
        }
        let texture = match (&material.base_color_texture, &material.embedded_texture) {
            (Some(texture), _) => Some(relative(texture, path)),
            (None, Some(bytes)) => {
                let extension = if bytes.starts_with(&[0xff, 0xd8]) { "jpg" } else { "png" };
                let stem = path.file_stem().unwrap_or_default().to_string_lossy();
                let file = path.with_file_name(format!("{stem}_{k}.{extension}"));
                output::write_bytes(&file, bytes)?;
                file.file_name().map(PathBuf::from)
            }
            (None, None) => None,
        };
        if let Some(texture) = texture {
            let _ = writeln!(text, "map_Kd {}", texture.to_string_lossy().replace('\\', "/"));
        }
        for other in &material.textures {
            // Embedded ones in other roles stay behind: OBJ files seldom name them.
            if let (Some(keyword), TextureContent::File(file)) = (keyword(&other.role), &other.content) {
                let _ = writeln!(text, "{keyword} {}", relative(file, path).to_string_lossy().replace('\\', "/"));
            }
        }
    }
    Ok(text)
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
        if a.texcoords != b.texcoords || a.normals != b.normals {
            return Some("texcoords or normals".into());
        }
        if a.polygon_count() != b.polygon_count() {
            return Some("polygon count".into());
        }
        (0..a.polygon_count()).find_map(|p| {
            let group = |m: &Mesh| m.groups.get(m.polygon_group(p) as usize).cloned();
            let material = |m: &Mesh| m.materials.get(m.polygon_material(p) as usize).cloned();
            let same = a.polygon(p) == b.polygon(p) && group(a) == group(b) && material(a) == material(b);
            (!same).then(|| format!("polygon {p}"))
        })
    }

    const AWKWARD: &str = "mtllib in.mtl\nv 5 5 5\nv 0.1 0.30000000000000004 1e-300\nv 1 0 0\nv 123456789.123456789 0 0\nv 0 1 0\n\
        vt 0.5 -3.25\nvt 1 0.1\nvn 0 0 1\nf 2 3 4\ng left arm\nf 2/1 3/2 4/1 5/2\nusemtl skin\ng right\nf 2//1 3//1 4//1\n\
        g left arm\nf 2/1/1 3/2/1 4/1/1\ng\nusemtl\nf 3 4 5\nv nan 0 0\n";

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
        assert_eq!(second.warnings.len(), 1, "{:?}", second.warnings);
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
        ] {
            let changed = AWKWARD.replace(from, to);
            let changed = parse_obj(changed.as_bytes(), &dir.path().join("a/in.obj")).unwrap().mesh;
            assert!(difference(&first, &changed).is_some(), "{from} -> {to}");
        }
    }

    #[test]
    fn names_of_other_formats_cannot_break_the_file() {
        let dir = tempfile::tempdir().unwrap();
        let mut builder = crate::geometry::MeshBuilder::new("m");
        builder.mesh.positions = vec![glam::DVec3::ZERO, glam::DVec3::X, glam::DVec3::Y];
        builder.mesh.groups = vec!["a\nf 1 1 1".into(), "b\\".into(), " ".into()];
        let texture: std::sync::Arc<[u8]> = b"\x89PNG"[..].into();
        builder.mesh.materials = ["m\r\nx", "m__x", "", ""]
            .map(|name| Material { name: name.into(), embedded_texture: Some(texture.clone()), ..Material::default() })
            .to_vec();
        for k in 0..4 {
            (builder.group, builder.material) = (k % 3, k);
            builder.polygon([0, 1, 2].map(|vertex| crate::geometry::Corner { vertex, texcoord: NONE, normal: NONE }));
        }
        let path = dir.path().join("out.obj");
        write_obj(&builder.build(), &path).unwrap();
        let back = read_obj(&path).unwrap();
        assert!(back.warnings.is_empty(), "{:?}", back.warnings);
        assert_eq!((back.mesh.triangle_count(), back.mesh.groups.len(), back.mesh.materials.len()), (4, 3, 4));
        let textures: HashSet<_> = back.mesh.materials.iter().map(|m| m.base_color_texture.clone().unwrap()).collect();
        assert!(textures.len() == 4 && textures.iter().all(|t| std::fs::read(t).unwrap() == *texture));
    }
}
