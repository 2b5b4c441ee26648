//! Material libraries of OBJ files (MTL).

mod texture;

use std::path::Path;

use super::locate::{Located, locate};
use super::obj::parse_number;
use super::source::{self, Notes};
use super::text_lines::StatementLines;
use crate::Result;
use crate::geometry::Material;
use crate::geometry::material::{BASE_COLOR, RoleTexture, Statement, TextureContent};
use crate::picture::srgb_to_linear;
use texture::TextureStatement;

/// A material and its name as the file spells it.
#[derive(Clone, Debug)]
pub(crate) struct LibraryMaterial {
    pub(crate) name: Vec<u8>,
    pub(crate) material: Material,
}

/// Reads names, colours, opacity and textures of the materials of an MTL file, in file order. Other
/// statements are kept as they are.
pub(crate) fn read(path: &Path, notes: &mut Notes) -> Result<Vec<LibraryMaterial>> {
    let bytes = source::read_all(path)?;
    source::refuse_utf16(path, &bytes)?;
    let mut lines = StatementLines::new(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes));
    let mut materials: Vec<LibraryMaterial> = Vec::new();
    let mut line = Vec::new();
    // Comments before the first material, which often say whose work it is.
    let mut head = Vec::new();
    while lines.read(&mut line, path)? {
        let line = line.trim_ascii();
        let split = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
        let (keyword, rest) = (String::from_utf8_lossy(&line[..split]), line[split..].trim_ascii());
        if keyword.is_empty() {
            continue;
        }
        if keyword.eq_ignore_ascii_case("newmtl") {
            let material = Material { statements: std::mem::take(&mut head), ..Material::default() };
            materials.push(LibraryMaterial { name: rest.to_vec(), material });
            continue;
        }
        let Some(entry) = materials.last_mut() else {
            if keyword.starts_with('#') {
                head.push(Statement { text: line.to_vec(), file: None });
            }
            continue;
        };
        if keyword.starts_with('#') {
            entry.material.statements.push(Statement { text: line.to_vec(), file: None });
            continue;
        }
        match role(&keyword) {
            Some(role) => texture(entry, path, role, line, rest, notes),
            None if is_texture(&keyword) => {
                let (read, found) = TextureStatement::read(rest, |name| locate(path, name));
                let before = line.len() - read.name_from_end;
                let file = Some(found.into_path());
                entry.material.statements.push(Statement { text: line[..before].to_vec(), file });
            }
            None => plain(&mut entry.material, &keyword.to_ascii_lowercase(), line, rest),
        }
    }
    Ok(materials)
}

/// A statement without a file.
fn plain(material: &mut Material, keyword: &str, line: &[u8], rest: &[u8]) {
    let text = String::from_utf8_lossy(rest);
    let number = |word: &str| parse_number(word).filter(|x| x.is_finite()).map(|x| x as f32);
    let words = text.split_whitespace().take_while(|w| !w.starts_with('#'));
    let color = || -> Option<[f32; 3]> {
        match words.clone().take(3).map_while(number).collect::<Vec<_>>()[..] {
            [r, g, b] => Some([r, g, b]),
            // One number is a grey.
            [grey] => Some([grey; 3]),
            _ => None,
        }
    };
    match keyword {
        "kd" => {
            if let Some(color) = color() {
                material.base_color[..3].copy_from_slice(&color);
                (material.has_base_color, material.srgb_base_color) = (true, true);
                return;
            }
        }
        "d" => {
            if let Some(opacity) = words.clone().last().and_then(number) {
                material.base_color[3] = opacity;
                if words.clone().count() == 1 {
                    return;
                }
            }
        }
        "ke" => {
            if let Some(color) = color() {
                material.look.emissive = color.map(srgb_to_linear);
            }
        }
        "pr" => material.look.roughness = words.clone().next().and_then(number).unwrap_or(material.look.roughness),
        "pm" => material.look.metallic = words.clone().next().and_then(number).unwrap_or(material.look.metallic),
        _ => {}
    }
    material.statements.push(Statement { text: line.to_vec(), file: None });
}

/// A statement with a texture of a role.
fn texture(entry: &mut LibraryMaterial, path: &Path, role: &str, line: &[u8], rest: &[u8], notes: &mut Notes) {
    let name = String::from_utf8_lossy(&entry.name).into_owned();
    let material = &mut entry.material;
    let (read, found) = TextureStatement::read(rest, |name| locate(path, name));
    if read.name.is_empty() {
        return;
    }
    let written = String::from_utf8_lossy(&read.name).into_owned();
    match &found {
        Located::AsWritten(_) => {}
        Located::Elsewhere(file) => notes
            .say(format!("material {name:?}: its {role} texture {written} is not there; {} is taken", file.display())),
        Located::Outside(_) => notes.outside(&format!("{role} texture"), &written),
        Located::Missing(file) => {
            notes.say(format!("material {name:?}: its {role} texture {} does not exist", file.display()));
        }
    }
    for what in &read.passed_over {
        notes.say(format!("material {name:?}: {what} of its {role} texture is passed over"));
    }
    let (file, placement) = (found.into_path(), read.placement());
    let second = role != BASE_COLOR && material.textures.iter().any(|t| t.role == role);
    if !second {
        // A second base colour takes the place of the first.
        material.texture_options.retain(|(of, _)| of != role);
        if !read.kept.is_empty() {
            material.texture_options.push((role.to_owned(), read.kept));
        }
    }
    if role == BASE_COLOR {
        material.base_color_texture = Some(file);
        material.base_color_placement = placement;
        return;
    }
    if second {
        // The first of a role is its texture; the second is only kept.
        let before = line.len() - read.name_from_end;
        material.statements.push(Statement { text: line[..before].to_vec(), file: Some(file) });
        return;
    }
    let strength = if role == "normal" {
        material.look.normal_scale = read.bump;
        1.0
    } else {
        read.bump
    };
    let content = TextureContent::File(file);
    material.textures.push(RoleTexture { placement, strength, ..RoleTexture::new(role, content) });
}

/// Keywords of textures and their roles: the format's, and those of its extension for physically
/// based materials. The first of a role is written.
const KEYWORDS: [(&str, &str); 11] = [
    ("map_Kd", BASE_COLOR),
    ("map_Pr", "roughness"),
    ("map_Pm", "metallic"),
    ("map_Ke", "emissive"),
    ("map_Ks", "specular"),
    ("map_d", "opacity"),
    ("norm", "normal"),
    ("map_Kn", "normal"),
    ("map_bump", "height"),
    ("bump", "height"),
    ("disp", "displacement"),
];

/// The role of the texture that a keyword names, in whatever case.
fn role(keyword: &str) -> Option<&'static str> {
    KEYWORDS.iter().find(|(k, _)| k.eq_ignore_ascii_case(keyword)).map(|(_, role)| *role)
}

/// The keyword of a role, if the format has one.
pub(crate) fn keyword(role: &str) -> Option<&'static str> {
    KEYWORDS.iter().find(|(_, r)| *r == role).map(|(keyword, _)| *keyword)
}

/// Whether a keyword is followed by a file, in a role that is not known.
fn is_texture(keyword: &str) -> bool {
    let keyword = keyword.to_ascii_lowercase();
    keyword.starts_with("map_") || matches!(keyword.as_str(), "refl" | "decal")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Wrap;

    #[test]
    fn materials_are_read_and_missing_textures_told() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("m.mtl");
        std::fs::write(dir.path().join("there.png"), b"").unwrap();
        let text = "Kd 9 9 9\nnewmtl a\n\tKd 0.5 0.25 1\nd -halo 0.5\nmap_Kd -clamp on .\\there.png\r\nnewmtl b c\nmap_Kd gone.png\nKd nan 0 0";
        std::fs::write(&file, text).unwrap();
        let mut notes = Notes::default();
        let materials = read(&file, &mut notes).unwrap();
        assert_eq!(materials.len(), 2);
        let [a, b] = [0, 1].map(|k: usize| materials[k].material.clone());
        assert_eq!((a.base_color, a.has_base_color, a.srgb_base_color), ([0.5, 0.25, 1.0, 0.5], true, true));
        assert!(a.base_color_texture.as_ref().unwrap().is_file());
        assert_eq!(a.base_color_placement.wrap, [Wrap::Clamp; 2]);
        assert_eq!((materials[1].name.as_slice(), b.base_color, b.has_base_color), (&b"b c"[..], [1.0; 4], false));
        assert!(notes.into_warnings()[0].contains("gone.png"));
    }

    #[test]
    fn textures_have_roles_and_tiles() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("m.mtl");
        let text = "newmtl a\nmap_Kd a.<UDIM>.png\nmap_pr r.<UDIM>.png\nnorm -bm 2 n.<UDIM>.png\nbump -bm 0.5 h.<UDIM>.png\nmap_bump x.png";
        std::fs::write(&file, text).unwrap();
        let mut notes = Notes::default();
        let material = read(&file, &mut notes).unwrap().remove(0).material;
        assert_eq!(material.roles().collect::<Vec<_>>(), ["base_color", "roughness", "normal", "height"]);
        let Some(TextureContent::File(normal)) = material.texture("normal") else { panic!("no file") };
        assert!(normal.ends_with("n.<UDIM>.png"));
        assert_eq!((material.look.normal_scale, material.textures[2].strength), (2.0, 0.5));
        // Of tiles none is there; the second of a role is kept for writing.
        assert_eq!(notes.into_warnings().len(), 5);
        assert_eq!(
            material.statements,
            [Statement { text: b"map_bump ".to_vec(), file: Some(dir.path().join("x.png")) }]
        );
    }

    #[test]
    fn what_is_not_understood_is_kept() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("m.mtl");
        std::fs::write(dir.path().join("ns.png"), b"").unwrap();
        let text = "# by hand\rnewmtl a # one\rNs 96.078431\rKd 1 0 0 # red\rillum 2\rmap_Ns -clamp on C:\\x\\ns.png\rPr 0.25\rKe 1 1 1\r\
            Kd spectral a.rfl\rd -halo 0.5\rmap_Kd -blendu off -s 2 -mm 0.1 0.9 ns.png -imfchan r";
        std::fs::write(&file, text).unwrap();
        let mut notes = Notes::default();
        let entry = read(&file, &mut notes).unwrap().remove(0);
        assert_eq!(entry.name, b"a # one");
        let kept: Vec<String> = (entry.material.statements.iter())
            .map(|s| format!("{}{}", String::from_utf8_lossy(&s.text), if s.file.is_some() { "FILE" } else { "" }))
            .collect();
        let plain = ["# by hand", "Ns 96.078431", "illum 2", "map_Ns -clamp on FILE", "Pr 0.25", "Ke 1 1 1"];
        assert_eq!(kept, [plain.as_slice(), &["Kd spectral a.rfl", "d -halo 0.5"]].concat());
        let options = b" -blendu off -mm 0.1 0.9 -imfchan r".to_vec();
        assert_eq!(entry.material.texture_options, [("base_color".to_owned(), options)]);
        assert_eq!(entry.material.statements[3].file, Some(dir.path().join("ns.png")));
        assert_eq!((entry.material.look.roughness, entry.material.look.emissive), (0.25, [1.0; 3]));
        assert_eq!(entry.material.base_color, [1.0, 0.0, 0.0, 0.5]);
    }
}
