//! Pictures that commands read and write: with what their files tell, and with notes on what a
//! format has no place for.

use std::path::Path;

use crate::Result;
use crate::cli::common::{Session, usage};
use crate::io::image_file::{Metadata, Picture, is_jpeg, read_picture, read_texture, write_picture};
use crate::picture::Image;

/// Quality of JPEG files.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct Quality {
    /// Quality of a JPEG file, 1 to 100; without it that of the JPEG file it is made from, else 95
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=100))]
    quality: Option<u8>,
}

impl Quality {
    /// Fails if a quality is given for files that have none.
    pub(crate) fn check<P: AsRef<Path>>(self, outputs: impl IntoIterator<Item = P>) -> Result<()> {
        if self.quality.is_some() && !outputs.into_iter().any(is_jpeg) {
            return Err(usage("--quality", "no output is a JPEG file", "Leave it out, or end --output in .jpg"));
        }
        Ok(())
    }

    /// Sets the quality that a file is written with, where one is given.
    pub(crate) fn apply(self, metadata: &mut Metadata) {
        metadata.quality = self.quality.or(metadata.quality);
    }
}

impl Session<'_> {
    /// A picture as viewers show it.
    pub(crate) fn picture(&self, path: &Path) -> Result<Picture> {
        self.told(read_picture(path)?, path)
    }

    /// A texture as it is stored.
    pub(crate) fn texture(&self, path: &Path) -> Result<Picture> {
        self.told(read_texture(path)?, path)
    }

    fn told(&self, picture: Picture, path: &Path) -> Result<Picture> {
        self.warn_of(&picture.notes, path);
        Ok(picture)
    }

    /// Writes a picture with what is told of it.
    pub(crate) fn write_picture(&self, image: &Image, metadata: &Metadata, path: &Path) -> Result<()> {
        self.warn_of(&write_picture(image, metadata, path)?, path);
        Ok(())
    }

    /// Writes a picture of which nothing is told.
    pub(crate) fn write_image(&self, image: &Image, path: &Path) -> Result<()> {
        self.write_picture(image, &Metadata::default(), path)
    }

    /// Notes on a file.
    pub(crate) fn warn_of(&self, notes: &[String], path: &Path) {
        for note in notes {
            self.warn(&format!("{}: {note}", path.display()));
        }
    }
}
