//! The pictures of a layer as they are read, and which material shows which.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::geometry::material::{Placement, TextureContent};
use crate::geometry::{Mesh, NONE};
use crate::io::TextureName;
use crate::io::image_file::read_texture;
use crate::picture::Image;
use crate::tools::transfer::{TilesUsed, UvTile};
use crate::{Error, Result};

use super::appearance::{self, Appearance};
use super::textures::Textures;

/// A layer as its pictures are read.
pub(super) struct Reader<'a> {
    pub(super) layer: Textures,
    source: &'a Mesh,
    tell: &'a dyn Fn(&str),
    /// Pictures of files, by how they lie.
    known: Vec<(PathBuf, Placement, u32)>,
    /// Whether a file told of its colours yet.
    told: bool,
}

impl<'a> Reader<'a> {
    pub(super) fn new(layer: Textures, source: &'a Mesh, tell: &'a dyn Fn(&str)) -> Self {
        Self { layer, source, tell, known: Vec::new(), told: false }
    }

    fn warn(&self, text: &str) {
        (self.tell)(text);
    }

    /// Indices of the materials of a name.
    pub(super) fn materials(&self, name: Option<&str>) -> Vec<u32> {
        let all = self.source.materials.iter().enumerate();
        all.filter(|(_, m)| Some(m.name.as_str()) == name).map(|(k, _)| k as u32).collect()
    }

    /// Reads a picture that lies on the source in this way.
    fn picture(&mut self, path: PathBuf, placement: Placement) -> Result<u32> {
        if let Some((.., known)) = self.known.iter().find(|(p, placed, _)| *p == path && *placed == placement) {
            return Ok(*known);
        }
        let image = self.read(&path)?;
        let index = self.push(image, placement);
        self.known.push((path, placement, index));
        Ok(index)
    }

    /// The pixels of a file; what it tells of their colours is kept for the layer.
    fn read(&mut self, path: &Path) -> Result<Image> {
        let picture = read_texture(path)?;
        for note in &picture.notes {
            self.warn(&format!("{}: {note}", path.display()));
        }
        let (known, next) = (&mut self.layer.metadata, picture.metadata.of_colors());
        if !std::mem::replace(&mut self.told, true) {
            *known = next;
            return Ok(picture.image);
        }
        known.quality = known.quality.max(next.quality);
        known.half &= next.half;
        if known.icc != next.icc {
            known.icc = None;
            self.warn(&format!(
                "the pictures of {} have different colour profiles: none is written, and colours may look different",
                self.layer.role
            ));
        }
        Ok(picture.image)
    }

    fn push(&mut self, image: Image, placement: Placement) -> u32 {
        self.layer.images.push(image);
        self.layer.placements.push(placement);
        self.layer.images.len() as u32 - 1
    }

    /// What material `m` shows in the layer's role: its picture times its factors, or its colour.
    pub(super) fn add_appearance(&mut self, appearance: &Appearance<'_>, m: usize) -> Result<()> {
        let material = &self.source.materials[m];
        let role = self.layer.role.clone();
        let Some((content, placement)) = appearance.picture(m, &role) else {
            if let Some(colour) = appearance.colour(m, &role)? {
                let k = self.push(colour, Placement::default());
                self.show(m as u32, k);
            }
            return Ok(());
        };
        if let Some(name) = appearance::tiles(&content) {
            if placement != Placement::default() {
                let name = name.text();
                self.warn(&format!(
                    "{name}: tiles lie on the texture coordinates as they are; other placements are passed over"
                ));
            }
            return self.add(&name, |k| k == m as u32);
        }
        let k = match (&content, appearance::factors(&role, material)) {
            (TextureContent::File(path), None) => self.picture(path.clone(), placement)?,
            (TextureContent::File(path), Some(factors)) => {
                let mut image = self.read(path)?;
                appearance::multiply(&mut image, &role, factors)?;
                self.push(image, placement)
            }
            (TextureContent::Embedded(_), factors) => {
                let mut image = appearance::read(&content, self.source)?;
                if let Some(factors) = factors {
                    appearance::multiply(&mut image, &role, factors)?;
                }
                self.push(image, placement)
            }
        };
        // Samplers of glTF files say that their pictures repeat; other files cannot tell.
        let silent = material.srgb_base_color || !material.has_base_color;
        if let (TextureContent::File(path), true) = (&content, silent && placement == Placement::default()) {
            self.note_repeats(&path.to_string_lossy(), |k| k == m as u32);
        }
        self.show(m as u32, k);
        Ok(())
    }

    /// Tells that texture coordinates leave the unit square, which for some means tiles.
    fn note_repeats(&self, name: &str, wanted: impl Fn(u32) -> bool) {
        let source = self.source;
        if TilesUsed::of(source, |t| wanted(source.triangle_material(t))).beyond_the_unit_square() {
            self.warn(&format!(
                "{}: texture coordinates leave the unit square, where {name} repeats; name one file a tile with <UDIM>",
                source.name
            ));
        }
    }

    /// Lets material `m` show picture `k`.
    fn show(&mut self, m: u32, k: u32) {
        self.layer.material_texture[m as usize] = k;
        let source = self.source;
        if let Some(faces) = &mut self.layer.face_texture {
            let shown = faces.iter_mut().enumerate().filter(|(t, _)| source.triangle_material(*t) == m);
            shown.for_each(|(_, f)| *f = k);
        }
    }

    /// How the picture of material `m` lies in the layer's role, by its own texture in that role.
    fn placement(&self, m: u32) -> Placement {
        self.source.materials.get(m as usize).map_or_else(Placement::default, |m| m.placement(&self.layer.role))
    }

    /// Reads a picture, or the tiles of one, for the materials that `wanted` names ([`NONE`]:
    /// triangles without).
    pub(super) fn add(&mut self, name: &TextureName, wanted: impl Fn(u32) -> bool) -> Result<()> {
        let source = self.source;
        let shown = |t: usize| wanted(source.triangle_material(t));
        let used = TilesUsed::of(source, shown);
        if !name.has_tile() {
            for m in (0..source.materials.len() as u32).filter(|&m| wanted(m)) {
                let placement = self.placement(m);
                let picture = self.picture(PathBuf::from(name.text()), placement)?;
                self.show(m, picture);
                if !placement.keeps_coordinates() {
                    let material = &source.materials[m as usize].name;
                    self.warn(&format!("{} lies as material {material:?} says of its own texture", name.text()));
                }
            }
            if wanted(NONE) {
                self.layer.default_texture = self.picture(PathBuf::from(name.text()), Placement::default())?;
                let default = self.layer.default_texture;
                if let Some(faces) = &mut self.layer.face_texture {
                    let bare = faces.iter_mut().enumerate().filter(|(t, _)| source.triangle_material(*t) == NONE);
                    bare.for_each(|(_, f)| *f = default);
                }
            }
            self.note_repeats(name.text(), wanted);
            return Ok(());
        }
        let mut pictures: BTreeMap<UvTile, u32> = BTreeMap::new();
        let mut missing = Vec::new();
        for (&tile, &triangles) in &used.tiles {
            let path = name.file(Some(tile.corner()), &self.layer.role, "");
            if path.exists() {
                pictures.insert(tile, self.picture(path, Placement::default())?);
            } else {
                missing.push((tile, triangles, path));
            }
        }
        if let (true, Some((_, _, path))) = (pictures.is_empty(), missing.first()) {
            let found =
                std::io::Error::new(std::io::ErrorKind::NotFound, "none of the tiles that the source uses exists");
            return Err(Error::io(
                path,
                found,
                "Check the name before <UDIM>, and the texture coordinates of the source",
            ));
        }
        self.tile_notes(name, &used, &missing);
        let mut faces = self.layer.face_texture.take().unwrap_or_else(|| self.layer.of_faces(source));
        for (t, face) in faces.iter_mut().enumerate().filter(|(t, _)| shown(*t)) {
            let tile = source.triangle_texcoords(t).map(|uv| UvTile::of(&uv));
            *face = tile.and_then(|tile| pictures.get(&tile).copied()).unwrap_or(NONE);
        }
        self.layer.face_texture = Some(faces);
        Ok(())
    }

    fn tile_notes(&self, name: &TextureName, used: &TilesUsed, missing: &[(UvTile, u64, PathBuf)]) {
        let name = name.text();
        if !missing.is_empty() {
            let tiles: Vec<String> =
                missing.iter().filter_map(|(tile, ..)| tile.udim()).map(|n| n.to_string()).collect();
            let triangles: u64 = missing.iter().map(|m| m.1).sum();
            self.warn(&format!(
                "{name}: no file for the tiles {}; {triangles} triangles of the source have no {} there",
                tiles.join(", "),
                self.layer.role
            ));
        }
        let source = &self.source.name;
        if let (n @ 1.., t) = used.unnumbered {
            self.warn(&format!(
                "{source}: {n} triangles lie in squares that have no UDIM number, first {t}; they have no texture"
            ));
        }
        if let (n @ 1.., t) = used.crossing {
            self.warn(&format!(
                "{source}: {n} triangles reach over the border of a tile, first {t}; they show the one of their centre"
            ));
        }
    }

    /// The layer, with a note on materials that it leaves out.
    pub(super) fn finish(self) -> Result<Textures> {
        let faces = match &self.layer.face_texture {
            Some(faces) => faces.clone(),
            None => self.layer.of_faces(self.source),
        };
        let mut without: BTreeMap<u32, u64> = BTreeMap::new();
        let mut with = BTreeSet::new();
        for (t, face) in faces.iter().enumerate() {
            let material = self.source.triangle_material(t);
            if *face == NONE {
                *without.entry(material).or_insert(0) += 1;
            } else {
                with.insert(material);
            }
        }
        if with.is_empty() {
            let undefined = without.keys().find_map(|&m| self.source.materials.get(m as usize));
            let what = match undefined {
                Some(m) => format!(
                    "{}: material {:?} and all others that faces show have no {}",
                    self.source.name, m.name, self.layer.role
                ),
                None => format!("{}: its faces have no material, and so no {}", self.source.name, self.layer.role),
            };
            return Err(Error::option("texture", what, "Name a picture, or mend the material library"));
        }
        without.retain(|m, _| !with.contains(m));
        if !without.is_empty() {
            let name = |m: u32| self.source.materials.get(m as usize).map_or("(no material)", |m| m.name.as_str());
            let names: Vec<&str> = without.keys().take(20).map(|&m| name(m)).collect();
            let triangles: u64 = without.values().sum();
            self.warn(&format!(
                "{}: no {} for the materials {}; what is mapped to their {triangles} triangles gets no colour",
                self.source.name,
                self.layer.role,
                names.join(", ")
            ));
        }
        Ok(self.layer)
    }
}
