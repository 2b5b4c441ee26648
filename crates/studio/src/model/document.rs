//! What a user makes: a transfer and a warp, with all that an undo brings back.

use std::path::PathBuf;

use barymap::surface::correspondence::Method;
use barymap::tools::transfer::Fill;

use super::Side;
use super::cage::CageDocument;
use super::pairs::Pairs;

/// How the texture is carried and what is written.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// How points are carried.
    pub method: Method,
    /// Texels along a side of the texture that is written.
    pub size: u32,
    /// Texels of padding around the charts.
    pub margin: u32,
    /// What parts get that the map leaves without colour.
    pub fill: Fill,
    /// Whether the target gets new texture coordinates.
    pub unwrap: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { method: Method::Field, size: 2048, margin: 16, fill: Fill::None, unwrap: false }
    }
}

/// The texture of one mesh on another.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TransferDocument {
    /// The files of source and target.
    pub files: [Option<PathBuf>; 2],
    /// A picture for the source in place of those that its file names.
    pub texture: Option<PathBuf>,
    /// Corresponding points.
    pub pairs: Pairs,
    /// How.
    pub options: Options,
}

impl TransferDocument {
    /// The file of a side.
    pub fn file(&self, side: Side) -> Option<&PathBuf> {
        self.files[side.index()].as_ref()
    }

    /// Another mesh on a side: points on the old one mean nothing on it.
    pub fn set_file(&mut self, side: Side, path: PathBuf) {
        if self.files[side.index()].as_ref() != Some(&path) {
            self.pairs.clear();
            if side == Side::Source {
                self.texture = None;
            }
        }
        self.files[side.index()] = Some(path);
    }
}

/// Everything that a project file holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Document {
    /// The texture of one mesh on another.
    pub transfer: TransferDocument,
    /// A picture in a cage.
    pub warp: CageDocument,
}

#[cfg(test)]
mod tests {
    use super::*;
    use barymap::geometry::SurfacePoint;

    #[test]
    fn another_mesh_takes_the_pairs_away_and_the_same_one_does_not() {
        let mut document = TransferDocument::default();
        document.set_file(Side::Source, "a.obj".into());
        document.texture = Some("skin.png".into());
        let p = SurfacePoint::new(0, [1.0, 0.0, 0.0]);
        document.pairs.add(p, p, String::new());
        document.set_file(Side::Source, "a.obj".into());
        assert_eq!((document.pairs.list().len(), document.texture.is_some()), (1, true));
        document.set_file(Side::Target, "b.obj".into());
        assert_eq!((document.pairs.list().len(), document.texture.is_some()), (0, true));
        document.set_file(Side::Source, "c.obj".into());
        assert_eq!(document.texture, None);
    }
}
