//! The pictures that a transfer writes: one for each layer, tile and material, whole sets or none.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};

use crate::geometry::{Mesh, NONE};
use crate::io::TextureName;
use crate::io::image_file::Metadata;
use crate::io::output_set::OutputSet;
use crate::picture::Image;
use crate::tools::transfer::{TilesUsed, UvRegion, UvTile};

use crate::error::{Error, Result};

/// What of the target one picture shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Only this material, where each has pictures of its own.
    pub material: Option<u32>,
    /// Only this tile, where each has a picture of its own.
    pub tile: Option<UvTile>,
}

impl Part {
    /// The part of the plane of texture coordinates.
    pub fn region(&self) -> UvRegion {
        self.tile.map_or(UvRegion::Repeat, |t| UvRegion::Square(t.corner()))
    }

    fn file(&self, name: &TextureName, role: &str, target: &Mesh) -> PathBuf {
        let material = self.material.and_then(|m| target.materials.get(m as usize)).map_or("none", |m| &m.name);
        name.file(self.tile.map(UvTile::corner), role, material)
    }
}

/// The names of everything that is written.
#[derive(Debug)]
pub struct Names<'a> {
    /// For each layer, none without `-o`.
    pub layers: Vec<TextureName>,
    /// Of the coverage.
    pub coverage: Option<TextureName>,
    /// Of the ST-map.
    pub stmap: Option<TextureName>,
    /// The model with everything attached.
    pub model: Option<&'a Path>,
}

impl Names<'_> {
    fn all(&self) -> impl Iterator<Item = (&'static str, &TextureName)> {
        let layers = self.layers.iter().map(|n| ("output", n));
        let others = [("coverage", &self.coverage), ("stmap", &self.stmap)];
        layers.chain(others.into_iter().filter_map(|(option, n)| n.as_ref().map(|n| (option, n))))
    }

    /// The parts of the target that get pictures: by tiles if names have `<UDIM>`, by materials if
    /// they have `<MATERIAL>`.
    ///
    /// # Errors
    /// [`Error::Option`] if some names have `<UDIM>` or `<MATERIAL>` and others do not;
    /// [`Error::Mesh`] if no triangle lies in a tile.
    pub fn parts(&self, target: &Mesh, tell: &dyn Fn(&str)) -> Result<Vec<Part>> {
        let (tiles, materials) = (self.all().any(|n| n.1.has_tile()), self.all().any(|n| n.1.has_material()));
        let incomplete = |(_, n): &(&str, &TextureName)| n.has_tile() != tiles || n.has_material() != materials;
        if let Some((option, name)) = self.all().find(incomplete) {
            let what =
                format!("{:?} would be written several times: other names have <UDIM> or <MATERIAL>", name.text());
            return Err(Error::option(option, what, "Put the same of <UDIM> and <MATERIAL> into every name"));
        }
        let used = TilesUsed::of(target, |_| true);
        // With a model alone nobody can say it; tiles are told by the texture coordinates then.
        let tiles = tiles || (self.layers.is_empty() && used.beyond_the_unit_square() && used.crossing.0 == 0);
        if !tiles && used.beyond_the_unit_square() {
            tell(&format!(
                "{}: texture coordinates leave the unit square and are wrapped into one picture; name one file a tile with <UDIM>",
                target.name
            ));
        }
        if let (true, (n @ 1.., t)) = (tiles, used.unnumbered) {
            tell(&format!(
                "{}: {n} triangles lie in squares that have no UDIM number, first {t}; they get no picture",
                target.name
            ));
        }
        if let (true, (n @ 1.., t)) = (tiles, used.crossing) {
            tell(&format!("{}: {n} triangles reach over the border of a tile, first {t}", target.name));
        }
        let of_material: Vec<Option<u32>> = match materials {
            false => vec![None],
            true => {
                let mut used: Vec<u32> = (0..target.triangle_count()).map(|t| target.triangle_material(t)).collect();
                used.sort_unstable();
                used.dedup();
                used.into_iter().map(Some).collect()
            }
        };
        let mut parts = Vec::new();
        for material in of_material {
            let wanted = |t: usize| material.is_none_or(|m| target.triangle_material(t) == m);
            match tiles {
                false => parts.push(Part { material, tile: None }),
                true => {
                    let used = TilesUsed::of(target, wanted);
                    parts.extend(used.tiles.keys().map(|&tile| Part { material, tile: Some(tile) }));
                }
            }
        }
        if parts.is_empty() {
            let remedy = "Move the texture coordinates to columns 0 to 9 and rows from 0, or leave <UDIM> out";
            return Err(Error::mesh(&target.name, "no triangle lies in a tile with a UDIM number", remedy));
        }
        Ok(parts)
    }

    /// Fails where two pictures would get the same name, or one could not be written.
    ///
    /// # Errors
    /// [`Error::Option`], and what writing there would return.
    pub fn check(&self, parts: &[Part], roles: &[&str], target: &Mesh) -> Result<()> {
        let mut seen = HashSet::new();
        for part in parts {
            let layers = self.layers.iter().zip(roles).map(|(n, role)| ("output", n, *role));
            let others = [("coverage", &self.coverage, "coverage"), ("stmap", &self.stmap, "stmap")];
            let others = others.into_iter().filter_map(|(o, n, role)| n.as_ref().map(|n| (o, n, role)));
            for (option, name, role) in layers.chain(others) {
                let file = part.file(name, role, target);
                crate::io::output::check_writable(&file)?;
                if !seen.insert(file.clone()) && !special(&file) {
                    let what = format!("{} would be written twice", file.display());
                    return Err(Error::option(option, what, "Give each output a name of its own"));
                }
            }
        }
        Ok(())
    }

    /// File of layer `layer` for a part.
    pub fn layer(&self, layer: usize, role: &str, part: &Part, target: &Mesh) -> Option<PathBuf> {
        self.layers.get(layer).map(|n| part.file(n, role, target))
    }

    /// File of the coverage of a part.
    pub fn coverage(&self, part: &Part, target: &Mesh) -> Option<PathBuf> {
        self.coverage.as_ref().map(|n| part.file(n, "coverage", target))
    }

    /// File of the ST-map of a part.
    pub fn stmap(&self, part: &Part, target: &Mesh) -> Option<PathBuf> {
        self.stmap.as_ref().map(|n| part.file(n, "stmap", target))
    }
}

/// What is written as it comes: devices, pipes, and files behind links.
fn special(path: &Path) -> bool {
    path.is_symlink() || std::fs::metadata(path).is_ok_and(|m| !m.is_file())
}

/// Files that appear together, folder by folder.
#[derive(Debug, Default)]
pub struct Writer {
    sets: BTreeMap<PathBuf, OutputSet>,
    /// Everything written, in order.
    pub files: Vec<String>,
}

impl Writer {
    /// Writes a picture of which nothing is told.
    ///
    /// # Errors
    /// As [`Writer::picture`].
    pub fn image(&mut self, image: &Image, path: &Path) -> Result<()> {
        self.picture(image, &Metadata::default(), path).map(drop)
    }

    /// Writes a picture with what is told of it; returns what its format has no place for.
    ///
    /// # Errors
    /// What writing a file returns.
    pub fn picture(&mut self, image: &Image, metadata: &Metadata, path: &Path) -> Result<Vec<String>> {
        let place = self.place(path)?;
        crate::io::write_picture(image, metadata, place)
    }

    /// Writes a file.
    ///
    /// # Errors
    /// What writing a file returns.
    pub fn bytes(&mut self, bytes: &[u8], path: &Path) -> Result<()> {
        let place = self.place(path)?;
        crate::io::output::write_bytes(place, bytes)
    }

    fn place(&mut self, path: &Path) -> Result<PathBuf> {
        self.files.push(path.display().to_string());
        if special(path) {
            return Ok(path.to_path_buf());
        }
        let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
        if !self.sets.contains_key(&folder) {
            self.sets.insert(folder.clone(), OutputSet::beside(path)?);
        }
        match self.sets.get_mut(&folder) {
            Some(set) => set.file(path),
            None => Ok(path.to_path_buf()),
        }
    }

    /// Lets all files appear, and returns their names in order.
    ///
    /// # Errors
    /// What renaming a file returns.
    pub fn finish(self) -> Result<Vec<String>> {
        self.sets.into_values().try_for_each(OutputSet::finish)?;
        Ok(self.files)
    }
}

/// Part of each triangle: its place in `parts`, or [`NONE`]. One that reaches over several tiles is
/// in that of its centre.
pub fn part_of(parts: &[Part], target: &Mesh) -> Vec<u32> {
    let by_tile = parts.iter().any(|p| p.tile.is_some());
    let by_material = parts.iter().any(|p| p.material.is_some());
    let places: HashMap<(Option<u32>, Option<UvTile>), u32> =
        parts.iter().enumerate().map(|(k, p)| ((p.material, p.tile), k as u32)).collect();
    let of = |t: usize| {
        let tile = target.triangle_texcoords(t).map(|uv| UvTile::of(&uv)).filter(|_| by_tile);
        let material = by_material.then(|| target.triangle_material(t));
        places.get(&(material, tile)).copied().unwrap_or(NONE)
    };
    (0..target.triangle_count()).map(of).collect()
}
