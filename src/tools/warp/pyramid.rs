//! A picture and its halvings, read in windows of decoded texels.

use rayon::prelude::*;

use crate::engine::{Lane, Lanes, Sweep};
use crate::error::Result;
use crate::picture::{Image, Pixels};
use crate::tools::transfer::color::Sample;
use crate::tools::transfer::{Alpha, Encoding};

/// One decoded texel: light or stored values, colours multiplied by alpha, in the order of the
/// picture; unused channels are 0.
pub type Texel = [f32; 4];

/// The first level that is kept in memory: finer ones are averaged when a window is read, at no
/// more than 16 pixels a texel, so that a pyramid takes no more than a ninth of the picture's
/// pixels, as floats, whatever its depth.
const FIRST_KEPT: u32 = 3;

/// The level whose texels are whole pictures.
fn top_level(side: u32) -> u32 {
    32 - (side.max(1) - 1).leading_zeros()
}

/// Levels of the pyramid of a picture, itself included; the last has one texel.
pub(super) fn level_count(image: &Image) -> u32 {
    top_level(image.width.max(image.height)) + 1
}

/// Texels per row, and rows, of a level.
pub(super) fn level_size(image: &Image, level: u32) -> [u32; 2] {
    [image.width, image.height].map(|n| ((n - 1) >> level.min(31)) + 1)
}

/// A picture at 1, 1/2, 1/4 ... of its size.
///
/// Texel (i, j) of level l is the mean of the pixels with i 2^l <= x < (i + 1) 2^l, and y alike,
/// that the picture has, so that a point p of the picture is the point p / 2^l of every level, also
/// where the sides are odd.
#[derive(Debug)]
pub struct Pyramid<'a> {
    image: &'a Image,
    encoding: Encoding,
    kept: Vec<Kept>,
    levels: u32,
}

/// A level in memory.
#[derive(Debug)]
struct Kept {
    size: [u32; 2],
    texels: Vec<Texel>,
}

/// A rectangle of decoded texels of one level, continued beyond the picture by its border.
#[derive(Clone, Debug, Default)]
pub struct Window {
    /// Texel of the level that is the first of the window.
    pub origin: [i32; 2],
    /// Texels in a row of the window.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Row by row.
    pub texels: Vec<Texel>,
}

impl<'a> Pyramid<'a> {
    /// The pyramid of `image`. O(pixels).
    ///
    /// # Errors
    /// If the picture's sizes and samples do not fit together.
    pub fn new(image: &'a Image, encoding: Encoding) -> Result<Self> {
        image.check("picture")?;
        let levels = level_count(image);
        let mut pyramid = Self { image, encoding, kept: Vec::new(), levels };
        for level in FIRST_KEPT..levels {
            let [width, height] = pyramid.size(level);
            let mut texels = vec![[0.0; 4]; width as usize * height as usize];
            let below = pyramid.kept.last();
            texels.par_chunks_mut(width as usize).enumerate().for_each(|(y, row)| match below {
                None => pyramid.means(level, 0, y as u32, row),
                Some(below) => halve(below, &pyramid, level, y as u32, row),
            });
            pyramid.kept.push(Kept { size: [width, height], texels });
        }
        Ok(pyramid)
    }

    /// Bytes that a pyramid keeps beside a picture of this size.
    pub fn bytes(width: u32, height: u32) -> u64 {
        (FIRST_KEPT..=top_level(width.max(height)))
            .map(|l| {
                (u64::from(width) >> l).saturating_add(1) * ((u64::from(height) >> l) + 1) * size_of::<Texel>() as u64
            })
            .sum()
    }

    /// The picture.
    pub fn image(&self) -> &'a Image {
        self.image
    }

    /// How its samples are read.
    pub fn encoding(&self) -> Encoding {
        self.encoding
    }

    /// Number of levels, the picture included; the last has one texel.
    pub fn levels(&self) -> u32 {
        self.levels
    }

    /// Texels per row, and rows, of a level.
    pub fn size(&self, level: u32) -> [u32; 2] {
        level_size(self.image, level)
    }

    /// Fills `window` with `size` texels of `level` from `origin` on.
    pub fn read(&self, level: u32, origin: [i32; 2], size: [usize; 2], window: &mut Window) {
        let level = level.min(self.levels - 1);
        window.origin = origin;
        [window.width, window.height] = size;
        // Every texel is written below.
        window.texels.resize(size[0] * size[1], [0.0; 4]);
        if window.texels.is_empty() {
            return;
        }
        let [columns, rows] = self.size(level);
        // Columns of the window that the level has; beyond them the first and the last are
        // repeated.
        let first = (-i64::from(origin[0])).clamp(0, size[0] as i64 - 1) as usize;
        let end = (i64::from(columns) - i64::from(origin[0])).clamp(first as i64 + 1, size[0] as i64) as usize;
        let x = (i64::from(origin[0]) + first as i64).clamp(0, i64::from(columns) - 1) as u32;
        let end = end.min(first + (columns - x) as usize);
        let mut before: Option<u32> = None;
        for j in 0..size[1] {
            let y = (i64::from(origin[1]) + j as i64).clamp(0, i64::from(rows) - 1) as u32;
            let start = j * size[0];
            if before == Some(y) {
                window.texels.copy_within(start - size[0]..start, start);
                continue;
            }
            before = Some(y);
            let row = &mut window.texels[start..start + size[0]];
            self.row(level, x, y, &mut row[first..end]);
            let (left, right) = (row[first], row[end - 1]);
            row[..first].fill(left);
            row[end..].fill(right);
        }
    }

    /// Texels of one row of a level, all within it.
    fn row(&self, level: u32, x: u32, y: u32, out: &mut [Texel]) {
        match level {
            0 => self.pixels(x, y, out),
            1..FIRST_KEPT => self.means(level, x, y, out),
            _ => {
                let kept = &self.kept[(level - FIRST_KEPT) as usize];
                let start = y as usize * kept.size[0] as usize + x as usize;
                out.copy_from_slice(&kept.texels[start..start + out.len()]);
            }
        }
    }

    /// Decodes pixels of one row.
    fn pixels(&self, x: u32, y: u32, out: &mut [Texel]) {
        let start = y as usize * self.image.width as usize + x as usize;
        self.visit(Decode { start, encoding: self.encoding, out });
    }

    /// Calls `job` with the picture's samples.
    pub(super) fn visit(&self, job: impl OnSamples) {
        match (&self.image.pixels, self.image.channels) {
            (Pixels::U8(v), 1) => job.run::<u8, 1>(v),
            (Pixels::U8(v), 2) => job.run::<u8, 2>(v),
            (Pixels::U8(v), 3) => job.run::<u8, 3>(v),
            (Pixels::U8(v), _) => job.run::<u8, 4>(v),
            (Pixels::U16(v), 1) => job.run::<u16, 1>(v),
            (Pixels::U16(v), 2) => job.run::<u16, 2>(v),
            (Pixels::U16(v), 3) => job.run::<u16, 3>(v),
            (Pixels::U16(v), _) => job.run::<u16, 4>(v),
            (Pixels::F32(v), 1) => job.run::<f32, 1>(v),
            (Pixels::F32(v), 2) => job.run::<f32, 2>(v),
            (Pixels::F32(v), 3) => job.run::<f32, 3>(v),
            (Pixels::F32(v), _) => job.run::<f32, 4>(v),
        }
    }

    /// Texels of one row of a level, averaged from the pixels.
    fn means(&self, level: u32, x: u32, y: u32, out: &mut [Texel]) {
        let side = 1usize << level;
        let first = (x as usize) << level;
        let last = (first + out.len() * side).min(self.image.width as usize);
        let rows = (y as usize) << level..((y as usize + 1) << level).min(self.image.height as usize);
        let mut row = vec![[0.0; 4]; last - first];
        out.fill([0.0; 4]);
        for y in rows.clone() {
            self.pixels(first as u32, y as u32, &mut row);
            for (sum, pixels) in out.iter_mut().zip(row.chunks(side)) {
                for pixel in pixels {
                    add(sum, pixel, 1.0);
                }
            }
        }
        for (sum, pixels) in out.iter_mut().zip(row.chunks(side)) {
            let share = 1.0 / (pixels.len() * rows.len()) as f32;
            sum.iter_mut().for_each(|c| *c *= share);
        }
    }
}

/// One row of the level above `below`: means of up to four texels, each counting as the pixels it
/// has.
fn halve(below: &Kept, pyramid: &Pyramid<'_>, level: u32, y: u32, out: &mut [Texel]) {
    let [width, height] = below.size;
    let pixels = |i: u32, n: u32| ((u64::from(i) + 1) << (level - 1)).min(u64::from(n)) - (u64::from(i) << (level - 1));
    for (x, out) in (0u32..).zip(out) {
        let mut weight = 0.0;
        for j in 2 * y..(2 * y + 2).min(height) {
            for i in 2 * x..(2 * x + 2).min(width) {
                let share = pixels(i, pyramid.image.width) as f32 * pixels(j, pyramid.image.height) as f32;
                add(out, &below.texels[j as usize * width as usize + i as usize], share);
                weight += share;
            }
        }
        out.iter_mut().for_each(|c| *c /= weight);
    }
}

#[inline(always)]
fn add(sum: &mut Texel, texel: &Texel, weight: f32) {
    for c in 0..4 {
        sum[c] += texel[c] * weight;
    }
}

/// Work on samples whose kind and channels are known when it is compiled.
pub(super) trait OnSamples {
    /// Does it; `samples` are all of the picture.
    fn run<T: Sample, const C: usize>(self, samples: &[T]);
}

/// Texel `at` of a picture, decoded.
#[inline(always)]
fn texel<T: Sample, const C: usize>(samples: &[T], at: usize, encoding: Encoding) -> Texel {
    let mut texel = [0.0; 4];
    let decoded: [f32; C] = encoding.decode(&samples[at * C..at * C + C]);
    texel[..C].copy_from_slice(&decoded);
    texel
}

/// Texel `at` of a picture and the one after it, decoded: [`texel`] with fewer instructions.
#[inline(always)]
pub(super) fn pair<L: Lane<E = f32>, T: Sample, const C: usize>(
    cpu: L::Cpu,
    samples: &[T],
    at: usize,
    encoding: Encoding,
) -> [Texel; 2] {
    let mut pair = [[0.0; 4]; 2];
    if C == 4 && !encoding.linear_light && 8 % L::N == 0 {
        // Eight samples are converted as one, and multiplied as one by what is the factor of each.
        let numbers = pair.as_flattened_mut();
        for (number, sample) in numbers.iter_mut().zip(&samples[at * C..at * C + 8]) {
            *number = sample.number();
        }
        for k in (0..8).step_by(L::N) {
            (L::load(cpu, &numbers[k..]) * L::splat(cpu, T::UNIT)).store(&mut numbers[k..]);
        }
        if encoding.alpha == Alpha::Opacity {
            let factors = [[numbers[3]; 4], [numbers[7]; 4]];
            let colors = [[0.0_f32, 0.0, 0.0, 1.0]; 2];
            for k in (0..8).step_by(L::N) {
                let (v, factor) = (L::load(cpu, &numbers[k..]), L::load(cpu, &factors.as_flattened()[k..]));
                let color = L::load(cpu, &colors.as_flattened()[k..]).lt(L::splat(cpu, 0.5));
                L::select(color, v * factor, v).store(&mut numbers[k..]);
            }
        }
    } else if let (3, Some(samples)) = (C, samples.get(at * C..at * C + 7)) {
        // Four samples at once, the last of them not wanted.
        for (texel, four) in pair.iter_mut().zip([&samples[..4], &samples[3..7]]) {
            let decoded: [f32; 4] = Encoding { alpha: Alpha::Data, ..encoding }.decode(four);
            texel[..3].copy_from_slice(&decoded[..3]);
        }
    } else {
        pair = [texel::<T, C>(samples, at, encoding), texel::<T, C>(samples, at + 1, encoding)];
    }
    pair
}

/// Decodes as many pixels as there is room for.
struct Decode<'a> {
    start: usize,
    encoding: Encoding,
    out: &'a mut [Texel],
}

impl OnSamples for Decode<'_> {
    fn run<T: Sample, const C: usize>(self, samples: &[T]) {
        Lanes::detect().run(DecodeSamples::<T, C> { job: self, samples });
    }
}

struct DecodeSamples<'a, T, const C: usize> {
    job: Decode<'a>,
    samples: &'a [T],
}

impl<T: Sample, const C: usize> Sweep<f32> for DecodeSamples<'_, T, C> {
    #[inline(always)]
    fn run<L: Lane<E = f32>>(self, cpu: L::Cpu) {
        let Decode { start, encoding, out } = self.job;
        let samples = &self.samples[start * C..];
        // What is constant for the compiler, it need not ask for every texel.
        if encoding.linear_light {
            texels::<L, T, C>(cpu, samples, encoding, out);
        } else if encoding.alpha == Alpha::Opacity {
            texels::<L, T, C>(cpu, samples, Encoding { linear_light: false, alpha: Alpha::Opacity }, out);
        } else {
            texels::<L, T, C>(cpu, samples, Encoding { linear_light: false, alpha: Alpha::Data }, out);
        }
    }
}

#[inline(always)]
fn texels<L: Lane<E = f32>, T: Sample, const C: usize>(
    cpu: L::Cpu,
    samples: &[T],
    encoding: Encoding,
    out: &mut [Texel],
) {
    let (pairs, last) = out.as_chunks_mut();
    for (i, out) in pairs.iter_mut().enumerate() {
        *out = pair::<L, T, C>(cpu, samples, 2 * i, encoding);
    }
    for out in last {
        *out = texel::<T, C>(samples, 2 * pairs.len(), encoding);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(width: u32, height: u32, channels: u32) -> Image {
        let samples = (0..width * height * channels).map(|i| (i * 7 % 251) as u8).collect();
        Image::new(width, height, channels, Pixels::U8(samples)).unwrap()
    }

    #[test]
    fn every_level_is_the_mean_of_its_pixels() {
        for (w, h) in [(1, 1), (2, 1), (7, 5), (33, 17), (64, 64), (100, 3), (1, 37)] {
            let image = ramp(w, h, 3);
            let pyramid = Pyramid::new(&image, Encoding::default()).unwrap();
            assert_eq!(pyramid.size(pyramid.levels() - 1), [1, 1]);
            for level in 0..pyramid.levels() {
                let [cw, ch] = pyramid.size(level);
                let mut window = Window::default();
                pyramid.read(level, [0, 0], [cw as usize, ch as usize], &mut window);
                for (k, texel) in window.texels.iter().enumerate() {
                    let (i, j) = (k as u32 % cw, k as u32 / cw);
                    let (mut sum, mut count) = (0.0, 0);
                    for y in j << level..((j + 1) << level).min(h) {
                        for x in i << level..((i + 1) << level).min(w) {
                            sum += f64::from(image.get(x, y, 1));
                            count += 1;
                        }
                    }
                    let mean = sum / f64::from(count);
                    assert!((f64::from(texel[1]) - mean).abs() < 1e-5, "{w} x {h} level {level} at {i} {j}");
                    assert_eq!(texel[3], 0.0);
                }
            }
        }
    }

    #[test]
    fn windows_repeat_the_border() {
        let image = ramp(5, 4, 1);
        let pyramid = Pyramid::new(&image, Encoding::default()).unwrap();
        let mut window = Window::default();
        for origin in [[-3, -2], [2, 1], [-20, 9], [7, -30], [0, 0]] {
            pyramid.read(0, origin, [9, 8], &mut window);
            for (k, texel) in window.texels.iter().enumerate() {
                let x = (origin[0] + k as i32 % 9).clamp(0, 4) as u32;
                let y = (origin[1] + k as i32 / 9).clamp(0, 3) as u32;
                assert!((texel[0] - image.get(x, y, 0)).abs() < 1e-7, "{origin:?} {k}");
            }
        }
    }

    #[test]
    fn colours_are_multiplied_by_alpha() {
        let image = Image::new(1, 1, 2, Pixels::U8(vec![200, 51])).unwrap();
        let pyramid = Pyramid::new(&image, Encoding::default()).unwrap();
        let mut window = Window::default();
        pyramid.read(0, [0, 0], [1, 1], &mut window);
        assert!((window.texels[0][0] - 200.0 / 255.0 * 0.2).abs() < 1e-6 && (window.texels[0][1] - 0.2).abs() < 1e-6);
    }
}
