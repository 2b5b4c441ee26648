//! Smooth lines and small figures on a picture of 8-bit colours.

use glam::DVec2;

use crate::error::Result;
use crate::picture::{Depth, Image, Pixels};

/// A picture of 8-bit RGB to draw on.
#[derive(Clone, Debug, PartialEq)]
pub struct Canvas {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
}

impl Canvas {
    /// One colour everywhere.
    pub fn new(width: u32, height: u32, color: [u8; 3]) -> Self {
        let (width, height) = (width as usize, height as usize);
        Self { width, height, pixels: color.repeat(width * height) }
    }

    /// A copy of a picture of any kind; what is transparent shows white.
    ///
    /// # Errors
    /// If the picture's samples do not fit its size.
    pub fn of(image: &Image) -> Result<Self> {
        let rgba = image.converted(4, Depth::F32)?;
        let mut pixels = Vec::with_capacity(rgba.pixels.len() / 4 * 3);
        if let Pixels::F32(samples) = &rgba.pixels {
            for p in samples.chunks_exact(4) {
                let a = p[3].clamp(0.0, 1.0);
                pixels.extend(p[..3].iter().map(|c| ((c * a + 1.0 - a) * 255.0 + 0.5) as u8));
            }
        }
        Ok(Self { width: image.width as usize, height: image.height as usize, pixels })
    }

    /// The finished picture.
    ///
    /// # Errors
    /// If it has no pixels.
    pub fn into_image(self) -> Result<Image> {
        Image::new(self.width as u32, self.height as u32, 3, Pixels::U8(self.pixels))
    }

    /// Mixes a colour into a pixel; nothing outside.
    pub fn mix(&mut self, x: i64, y: i64, color: [u8; 3], share: f64) {
        if x < 0 || y < 0 || x >= self.width as i64 || y >= self.height as i64 || !(share > 0.0) {
            return;
        }
        let at = (y as usize * self.width + x as usize) * 3;
        for (p, c) in self.pixels[at..at + 3].iter_mut().zip(color) {
            *p = (f64::from(*p) + (f64::from(c) - f64::from(*p)) * share.min(1.0) + 0.5) as u8;
        }
    }

    /// A line of `width` pixels with round ends.
    pub fn line(&mut self, a: DVec2, b: DVec2, width: f64, color: [u8; 3]) {
        let Some((a, b)) = self.clip(a, b, width + 2.0) else { return };
        let reach = 0.5 * width + 0.5;
        // Along the longer side, across it as far as the line is wide there.
        let steep = (b - a).y.abs() > (b - a).x.abs();
        let turn = |p: DVec2| if steep { DVec2::new(p.y, p.x) } else { p };
        let (a, b) = (turn(a), turn(b));
        let (a, b) = if a.x <= b.x { (a, b) } else { (b, a) };
        let slope = if b.x > a.x { (b.y - a.y) / (b.x - a.x) } else { 0.0 };
        let across = reach * (1.0 + slope * slope).sqrt() + 1.0;
        for x in (a.x - reach).floor() as i64..=(b.x + reach).ceil() as i64 {
            let middle = a.y + slope * ((x as f64 + 0.5).clamp(a.x, b.x) - a.x);
            for y in (middle - across).floor() as i64..=(middle + across).ceil() as i64 {
                let p = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let along = b - a;
                let t = ((p - a).dot(along) / along.length_squared().max(1e-300)).clamp(0.0, 1.0);
                let share = (reach - p.distance(a + along * t)).clamp(0.0, 1.0);
                let (px, py) = if steep { (y, x) } else { (x, y) };
                self.mix(px, py, color, share);
            }
        }
    }

    /// Lines through points; from the last one back to the first if `closed`.
    pub fn polyline(&mut self, points: &[DVec2], closed: bool, width: f64, color: [u8; 3]) {
        for pair in points.windows(2) {
            self.line(pair[0], pair[1], width, color);
        }
        if let (true, [first, .., last]) = (closed, points) {
            self.line(*last, *first, width, color);
        }
    }

    /// A filled disc.
    pub fn disc(&mut self, centre: DVec2, radius: f64, color: [u8; 3]) {
        self.line(centre, centre, 2.0 * radius, color);
    }

    /// A filled rectangle of whole pixels.
    pub fn rectangle(&mut self, x: i64, y: i64, width: i64, height: i64, color: [u8; 3]) {
        let (columns, rows) = (self.width as i64, self.height as i64);
        for j in y.max(0)..(y + height).min(rows) {
            for i in x.max(0)..(x + width).min(columns) {
                self.mix(i, j, color, 1.0);
            }
        }
    }

    /// Copies another picture with its upper left corner at (x, y).
    pub fn paste(&mut self, other: &Self, x: i64, y: i64) {
        for j in 0..other.height {
            for i in 0..other.width {
                let at = (j * other.width + i) * 3;
                let color = [other.pixels[at], other.pixels[at + 1], other.pixels[at + 2]];
                self.mix(x + i as i64, y + j as i64, color, 1.0);
            }
        }
    }

    /// Digits, points, signs and `/` of 3 x 5 squares of `size` pixels, with the upper left corner
    /// at (x, y).
    pub fn figures(&mut self, text: &str, x: i64, y: i64, size: i64, color: [u8; 3]) {
        let mut left = x;
        for c in text.chars() {
            let rows = glyph(c);
            for (j, row) in (0i64..).zip(rows) {
                for i in (0i64..3).filter(|i| row >> (2 - i) & 1 == 1) {
                    self.rectangle(left + i * size, y + j * size, size, size, color);
                }
            }
            left += 4 * size;
        }
    }

    /// The part of a line near the picture (Liang and Barsky 1984); `None` if there is none, or it
    /// is not finite.
    fn clip(&self, a: DVec2, b: DVec2, margin: f64) -> Option<(DVec2, DVec2)> {
        let high = DVec2::new(self.width as f64, self.height as f64) + margin;
        let along = b - a;
        if !(a.is_finite() && along.is_finite()) {
            return None;
        }
        let (mut from, mut to) = (0.0, 1.0);
        for (d, low, far) in [(along.x, a.x + margin, high.x - a.x), (along.y, a.y + margin, high.y - a.y)] {
            // Position within [-margin, high]: low is the room to the lower side, far to the upper.
            if d == 0.0 {
                if low < 0.0 || far < 0.0 {
                    return None;
                }
                continue;
            }
            let (enter, leave) = if d > 0.0 { (-low / d, far / d) } else { (far / d, -low / d) };
            from = f64::max(from, enter);
            to = f64::min(to, leave);
        }
        (from <= to).then(|| (a + along * from, a + along * to))
    }
}

/// Rows of a glyph, three bits each.
fn glyph(c: char) -> [u8; 5] {
    match c {
        '0' => [7, 5, 5, 5, 7],
        '1' => [2, 6, 2, 2, 7],
        '2' => [7, 1, 7, 4, 7],
        '3' => [7, 1, 7, 1, 7],
        '4' => [5, 5, 7, 1, 1],
        '5' => [7, 4, 7, 1, 7],
        '6' => [7, 4, 7, 5, 7],
        '7' => [7, 1, 2, 2, 2],
        '8' => [7, 5, 7, 5, 7],
        '9' => [7, 5, 7, 1, 7],
        '.' => [0, 0, 0, 0, 2],
        '-' => [0, 0, 7, 0, 0],
        '+' => [0, 2, 7, 2, 0],
        '/' => [1, 1, 2, 4, 4],
        '<' => [1, 2, 4, 2, 1],
        _ => [0; 5],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_have_their_width_and_end_inside() {
        let mut canvas = Canvas::new(60, 40, [0; 3]);
        canvas.line(DVec2::new(10.0, 10.0), DVec2::new(50.0, 30.0), 3.0, [255; 3]);
        let sum: f64 = canvas.pixels.iter().map(|p| f64::from(*p) / 255.0).sum::<f64>() / 3.0;
        let area = 3.0 * 40.0f64.hypot(20.0) + std::f64::consts::PI * 2.25;
        assert!((sum - area).abs() < 0.05 * area, "{sum} {area}");
        let mut clipped = Canvas::new(60, 40, [0; 3]);
        clipped.line(DVec2::new(-1e12, 20.0), DVec2::new(1e12, 20.0), 2.0, [255; 3]);
        assert_eq!(clipped.pixels.iter().filter(|p| **p == 255).count(), 60 * 2 * 3);
        let mut none = Canvas::new(8, 8, [9; 3]);
        none.line(DVec2::new(f64::NAN, 0.0), DVec2::ONE, 2.0, [255; 3]);
        none.line(DVec2::new(-50.0, 100.0), DVec2::new(100.0, 100.0), 2.0, [255; 3]);
        assert!(none.pixels.iter().all(|p| *p == 9));
    }

    #[test]
    fn transparent_pictures_show_white() {
        let image = Image::new(1, 1, 4, Pixels::U8(vec![10, 20, 30, 0])).unwrap();
        assert_eq!(Canvas::of(&image).unwrap().pixels, [255; 3]);
    }
}
