//! Names of texture files with places to fill in: `<UDIM>`, `<UVTILE>`, `<ROLE>` and `<MATERIAL>`.

use std::path::PathBuf;

/// Spellings of the place of a UDIM number: ours and Mari's, and Houdini's and Katana's.
const UDIM: [&str; 3] = ["<UDIM>", "<udim>", "%(UDIM)d"];
/// Spellings of the place of column and row counted from 1, as `u1_v1`.
const UVTILE: [&str; 3] = ["<UVTILE>", "<uvtile>", "%(UVTILE)d"];
const ROLE: [&str; 2] = ["<ROLE>", "<role>"];
const MATERIAL: [&str; 2] = ["<MATERIAL>", "<material>"];

/// A file name as the user writes it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TextureName(String);

impl TextureName {
    /// Any text.
    pub fn new(text: impl Into<String>) -> Self {
        Self(text.into())
    }

    /// The text as it was given.
    pub fn text(&self) -> &str {
        &self.0
    }

    /// Whether the name stands for one file a tile.
    pub fn has_tile(&self) -> bool {
        self.has(&UDIM) || self.has(&UVTILE)
    }

    /// Whether the name stands for one file a role.
    pub fn has_role(&self) -> bool {
        self.has(&ROLE)
    }

    /// Whether the name stands for one file a material.
    pub fn has_material(&self) -> bool {
        self.has(&MATERIAL)
    }

    /// Whether any place is to be filled in.
    pub fn has_place(&self) -> bool {
        self.has_tile() || self.has_role() || self.has_material()
    }

    fn has(&self, places: &[&str]) -> bool {
        places.iter().any(|p| self.0.contains(p))
    }

    /// Whether `file` is this name with some tile filled in.
    pub(crate) fn matches_tile(&self, file: &str) -> bool {
        let tile = |places: &[&str]| places.iter().find_map(|p| self.0.split_once(p));
        let Some((before, after)) = tile(&UDIM).or_else(|| tile(&UVTILE)) else { return false };
        let number = file.strip_prefix(before).and_then(|rest| rest.strip_suffix(after));
        number.is_some_and(|n| !n.is_empty() && n.chars().all(|c| c.is_ascii_digit() || "uv_".contains(c)))
    }

    /// The file of the tile with the lower corner `(u, v)`, not negative; names of roles and
    /// materials have what file systems forbid replaced by `_`.
    pub fn file(&self, tile: Option<[i32; 2]>, role: &str, material: &str) -> PathBuf {
        let mut text = self.0.clone();
        let mut put = |places: &[&str], value: &str| {
            for place in places {
                text = text.replace(place, value);
            }
        };
        if let Some([u, v]) = tile {
            put(&UDIM, &(1001 + i64::from(u) + 10 * i64::from(v)).to_string());
            put(&UVTILE, &format!("u{}_v{}", i64::from(u) + 1, i64::from(v) + 1));
        }
        put(&ROLE, &plain(role));
        put(&MATERIAL, &plain(material));
        text.into()
    }
}

/// A name without separators, control characters and what some file systems reserve.
fn plain(name: &str) -> String {
    let plain: String =
        name.chars().map(|c| if c.is_control() || r#"/\:*?"<>|"#.contains(c) { '_' } else { c }).collect();
    match plain.trim().trim_matches('.') {
        "" => "_".to_owned(),
        plain => plain.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_filled_in() {
        let file = |text: &str, tile| TextureName::new(text).file(tile, "base_color", "a/b").display().to_string();
        assert_eq!(file("t/skin.<UDIM>.png", Some([2, 1])), "t/skin.1013.png");
        assert_eq!(file("t/skin.%(UDIM)d.png", Some([0, 0])), "t/skin.1001.png");
        assert_eq!(file("<MATERIAL>_<ROLE>_<UVTILE>.exr", Some([2, 1])), "a_b_base_color_u3_v2.exr");
        assert_eq!(file("plain.png", None), "plain.png");
        let name = TextureName::new("x_<udim>_<role>.png");
        assert_eq!((name.has_tile(), name.has_role(), name.has_material()), (true, true, false));
    }

    #[test]
    fn no_material_leads_out_of_the_folder() {
        for evil in ["..", "../../x", "", "/etc", "a\nb", "."] {
            let file = TextureName::new("o/<MATERIAL>").file(None, "r", evil);
            assert_eq!(file.parent().unwrap(), std::path::Path::new("o"), "{evil:?}");
            assert!(file.file_name().is_some(), "{evil:?}");
        }
    }
}
