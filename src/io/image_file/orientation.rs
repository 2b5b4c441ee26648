//! Turning a picture as its EXIF orientation says.

use crate::picture::{Image, Pixels};

/// How a stored picture is to be shown: a value of the EXIF and TIFF tag 274, 1 to 8.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Orientation {
    /// Rows become columns.
    transposed: bool,
    /// Columns run from right to left, of the picture as shown.
    flip_x: bool,
    /// Rows run from bottom to top, of the picture as shown.
    flip_y: bool,
}

impl Orientation {
    /// Of the number in the file; those that the standard does not define are normal.
    pub(super) fn of_tag(value: u16) -> Self {
        let (transposed, flip_x, flip_y) = match value {
            2 => (false, true, false),
            3 => (false, true, true),
            4 => (false, false, true),
            5 => (true, false, false),
            6 => (true, true, false),
            7 => (true, true, true),
            8 => (true, false, true),
            _ => (false, false, false),
        };
        Self { transposed, flip_x, flip_y }
    }

    /// Whether there is nothing to do.
    pub(super) fn is_normal(self) -> bool {
        self == Self::default()
    }

    /// Whether width and height change places.
    pub(super) fn is_transposed(self) -> bool {
        self.transposed
    }

    /// The picture as a viewer shows it.
    pub(super) fn upright(self, image: Image) -> Image {
        if self.is_normal() {
            return image;
        }
        let (width, height) = if self.transposed { (image.height, image.width) } else { (image.width, image.height) };
        let channels = image.channels as usize;
        let size = [width as usize, height as usize, image.width as usize];
        let pixels = match &image.pixels {
            Pixels::U8(s) => Pixels::U8(self.turn(s, size, channels)),
            Pixels::U16(s) => Pixels::U16(self.turn(s, size, channels)),
            Pixels::F32(s) => Pixels::F32(self.turn(s, size, channels)),
        };
        Image { width, height, channels: image.channels, pixels }
    }

    fn turn<T: Copy>(self, samples: &[T], [width, height, stored]: [usize; 3], channels: usize) -> Vec<T> {
        let mut out = Vec::with_capacity(samples.len());
        for y in 0..height {
            for x in 0..width {
                let x = if self.flip_x { width - 1 - x } else { x };
                let y = if self.flip_y { height - 1 - y } else { y };
                let (column, row) = if self.transposed { (y, x) } else { (x, y) };
                let at = (row * stored + column) * channels;
                out.extend_from_slice(&samples[at..at + channels]);
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_orientation_shows_the_letter_upright() {
        // What a viewer shows; its first row and first column tell where the rows and columns of
        // the file belong.
        let shown = Image::new(3, 2, 1, Pixels::U8(vec![1, 2, 3, 4, 5, 6])).unwrap();
        // The standard's words for each value: where row 0 and column 0 of the file are shown.
        let stored: [(u16, u32, [u8; 6]); 8] = [
            (1, 3, [1, 2, 3, 4, 5, 6]), // top, left
            (2, 3, [3, 2, 1, 6, 5, 4]), // top, right
            (3, 3, [6, 5, 4, 3, 2, 1]), // bottom, right
            (4, 3, [4, 5, 6, 1, 2, 3]), // bottom, left
            (5, 2, [1, 4, 2, 5, 3, 6]), // left, top
            (6, 2, [3, 6, 2, 5, 1, 4]), // right, top
            (7, 2, [6, 3, 5, 2, 4, 1]), // right, bottom
            (8, 2, [4, 1, 5, 2, 6, 3]), // left, bottom
        ];
        for (value, width, samples) in stored {
            let file = Image::new(width, 6 / width, 1, Pixels::U8(samples.to_vec())).unwrap();
            assert_eq!(Orientation::of_tag(value).upright(file), shown, "orientation {value}");
        }
        assert!(Orientation::of_tag(0).is_normal() && Orientation::of_tag(9).is_normal());
    }

    #[test]
    fn all_channels_move_together() {
        let file = Image::new(1, 2, 3, Pixels::F32(vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0])).unwrap();
        let shown = Orientation::of_tag(6).upright(file);
        assert_eq!((shown.width, shown.height), (2, 1));
        assert_eq!(shown.pixels, Pixels::F32(vec![4.0, 5.0, 6.0, 1.0, 2.0, 3.0]));
    }
}
