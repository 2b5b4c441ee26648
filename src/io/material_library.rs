//! Material libraries of OBJ files (MTL).

use std::path::Path;

use super::obj::parse_number;
use super::source::{self, Notes};
use super::texture_name::TextureName;
use crate::Result;
use crate::geometry::Material;
use crate::geometry::material::{BASE_COLOR, RoleTexture, TextureContent};

/// Reads names, diffuse colour, opacity and textures of the materials of an MTL file, in file order.
pub(crate) fn read(path: &Path, notes: &mut Notes) -> Result<Vec<Material>> {
    let bytes = source::read_all(path)?;
    source::refuse_utf16(path, &bytes)?;
    let text = String::from_utf8_lossy(&bytes);
    let mut materials: Vec<Material> = Vec::new();
    for line in text.trim_start_matches('\u{feff}').lines().map(str::trim) {
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        if keyword.eq_ignore_ascii_case("newmtl") {
            materials.push(Material { name: rest.to_owned(), ..Material::default() });
        }
        let Some(material) = materials.last_mut() else { continue };
        let number = |word: &str| parse_number(word).filter(|x| x.is_finite()).map(|x| x as f32);
        match keyword.to_ascii_lowercase().as_str() {
            "kd" => {
                let values: Vec<f32> = rest.split_whitespace().take(3).map_while(number).collect();
                match values[..] {
                    [r, g, b] => material.base_color[..3].copy_from_slice(&[r, g, b]),
                    [grey] => material.base_color[..3].fill(grey),
                    _ => {}
                }
            }
            "d" => {
                if let Some(opacity) = rest.split_whitespace().last().and_then(number) {
                    material.base_color[3] = opacity;
                }
            }
            keyword if role(keyword).is_some() => {
                let name = after_options(rest);
                if let (Some(role), false) = (role(keyword), name.is_empty()) {
                    let file = source::sibling(path, name);
                    if !file.is_file() && !TextureName::new(name).has_tile() {
                        notes.say(format!(
                            "material {:?}: its {role} texture {} does not exist",
                            material.name,
                            file.display()
                        ));
                    }
                    if role == BASE_COLOR {
                        material.base_color_texture = Some(file);
                    } else if !material.textures.iter().any(|t| t.role == role) {
                        let content = TextureContent::File(file);
                        material.textures.push(RoleTexture { role: role.to_owned(), content });
                    }
                }
            }
            _ => {}
        }
    }
    Ok(materials)
}

/// Keywords of textures and their roles: the format's, and those of its extension for physically based materials. The first of a role is written.
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

/// The file name of a texture statement, with its options (`-s 1 1 1`, `-clamp on`) taken off; it may hold spaces.
fn after_options(mut rest: &str) -> &str {
    while rest.starts_with('-') {
        let (option, after) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
        // How many words follow at least and at most; all but the least must be numbers.
        let (least, most) = match option {
            "-s" | "-o" | "-t" => (1, 3),
            "-mm" => (2, 2),
            "-blendu" | "-blendv" | "-boost" | "-texres" | "-clamp" | "-imfchan" | "-cc" | "-type" | "-bm" => (1, 1),
            _ => return rest,
        };
        rest = after.trim_start();
        for k in 0..most {
            let (word, after) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
            if k >= least && (word.parse::<f64>().is_err() || after.trim_start().is_empty()) {
                break;
            }
            rest = after.trim_start();
        }
    }
    rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_taken_off() {
        for (line, name) in [
            ("a b.png", "a b.png"),
            ("-s 1 1 1 -o 0 0 a.png", "a.png"),
            ("-clamp on -mm 0 1 dir/a b.png", "dir/a b.png"),
            ("-s 2 5", "5"),
            ("-odd.png", "-odd.png"),
            ("-clamp on", ""),
        ] {
            assert_eq!(after_options(line), name, "{line}");
        }
    }

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
        assert_eq!(materials[0].base_color, [0.5, 0.25, 1.0, 0.5]);
        assert!(materials[0].base_color_texture.as_ref().unwrap().is_file());
        assert_eq!((materials[1].name.as_str(), materials[1].base_color), ("b c", [1.0; 4]));
        assert!(notes.into_warnings()[0].contains("gone.png"));
    }

    #[test]
    fn textures_have_roles_and_tiles() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("m.mtl");
        let text = "newmtl a\nmap_Kd a.<UDIM>.png\nmap_pr r.<UDIM>.png\nnorm -bm 2 n.<UDIM>.png\nbump -bm 0.5 h.<UDIM>.png\nmap_bump x.png";
        std::fs::write(&file, text).unwrap();
        let mut notes = Notes::default();
        let material = read(&file, &mut notes).unwrap().remove(0);
        assert_eq!(material.roles().collect::<Vec<_>>(), ["base_color", "roughness", "normal", "height"]);
        let Some(TextureContent::File(normal)) = material.texture("normal") else { panic!("no file") };
        assert!(normal.ends_with("n.<UDIM>.png"));
        // Tiles are looked for when it is known which are used; the second of a role is one too many.
        assert_eq!(notes.into_warnings().len(), 1);
    }
}
