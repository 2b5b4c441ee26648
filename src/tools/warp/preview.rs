//! Warped pictures for interaction: fast, and within a tenth of a pixel of the exact ones.

use glam::{DVec2, UVec2};
use rayon::prelude::*;

use crate::engine::Engine;
use crate::error::{Error, Result};
use crate::mapping::plane::{CompositeMap, Lattice, LatticeOptions, Preimages, fill_window};
use crate::picture::{Depth, Image, Pixels};

/// A picture under a map that changes: dragging a vertex of the cage calls [`Preview::drag`] with
/// each new map.
///
/// The map is evaluated at the nodes of a [`Lattice`] over the picture, finer near the vertices of
/// the cage, and interpolated between them: what a pixel shows comes from a point whose exact image
/// is within 0.1 pixels of it. Colours are interpolated bilinearly in 8 bits, between places a
/// 256th of a pixel apart: within two levels. Where the map shrinks, the full warp filters better.
/// Pixels that no point of the picture comes to are transparent.
#[derive(Clone, Debug)]
pub struct Preview {
    /// RGBA, multiplied by alpha, one texel of border on every side.
    pub(super) texels: Vec<u32>,
    pub(super) size: UVec2,
    canvas: UVec2,
    pub(super) lattice: Lattice,
}

impl Preview {
    /// A preview of `image` under `map`, whose polygons are in pixels of the picture (x right, y
    /// down); `canvas` is the size of the pictures made.
    ///
    /// # Errors
    /// [`Error::Input`] for a picture or canvas with no pixels or more than 2^28; [`Error::Device`]
    /// if the device fails.
    pub fn new(engine: &Engine, image: &Image, map: &CompositeMap, canvas: UVec2) -> Result<Self> {
        image.check("the picture of a preview")?;
        for (what, w, h) in [("picture", image.width, image.height), ("canvas", canvas.x, canvas.y)] {
            let pixels = u64::from(w) * u64::from(h);
            if pixels == 0 || pixels > 1 << 28 {
                return Err(Error::input(
                    format!("a preview with a {what} of {w} x {h} pixels"),
                    "Give 1 to 2^28 pixels",
                ));
            }
        }
        let rgba = image.converted(4, Depth::U8)?;
        let sample = |i: usize| (rgba.sample(i) * 255.0).round() as u8;
        let size = UVec2::new(image.width, image.height);
        let (w, h) = (size.x as usize, size.y as usize);
        let mut texels = vec![0; (w + 2) * (h + 2)];
        texels.par_chunks_mut(w + 2).enumerate().for_each(|(row, out)| {
            let y = row.saturating_sub(1).min(h - 1);
            for (column, texel) in out.iter_mut().enumerate() {
                let at = 4 * (y * w + column.saturating_sub(1).min(w - 1));
                let a = u32::from(sample(at + 3));
                let product = |c: u8| ((u32::from(c) * a + 127) / 255) as u8;
                *texel = u32::from_le_bytes([
                    product(sample(at)),
                    product(sample(at + 1)),
                    product(sample(at + 2)),
                    sample(at + 3),
                ]);
            }
        });
        // A lattice has at most so many cells in a row that a picture of 2^28 pixels has no more
        // nodes than are allowed.
        let cell = LatticeOptions::default().cell.max(f64::from(w.max(h) as u32) / 1024.0);
        let options = LatticeOptions { cell, ..LatticeOptions::default() };
        let lattice = Lattice::new(DVec2::ZERO, size.as_dvec2(), &options, |p| map.images_of_points(engine, p))?;
        Ok(Self { texels, size, canvas, lattice })
    }

    /// The map has changed: its values at the nodes are taken anew. Where the source of the cage
    /// has changed as well, make a new preview, whose lattice is fine at the new places.
    ///
    /// # Errors
    /// [`Error::Device`] if the device fails.
    pub fn drag(&mut self, engine: &Engine, map: &CompositeMap) -> Result<()> {
        self.lattice.update(|p| map.images_of_points(engine, p))
    }

    /// The map as it is sampled.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// Approximate pre-images of the pixels of the canvas.
    pub fn preimages(&self) -> Preimages {
        Preimages::of(&self.lattice, DVec2::ZERO, self.canvas)
    }

    /// The picture: RGBA of 8 bits, alpha straight.
    ///
    /// # Errors
    /// None once the preview is made.
    pub fn frame(&self) -> Result<Image> {
        let mut pixels = vec![[0; 4]; self.canvas.x as usize * self.canvas.y as usize];
        fill_window(&self.lattice, DVec2::ZERO, self.canvas, &mut pixels, |run, p, step| self.paint(run, p, step));
        Image::new(self.canvas.x, self.canvas.y, 4, Pixels::U8(pixels.into_flattened()))
    }

    /// Colours at points of the picture from `start` on, each a `step` further, to a 256th of a
    /// texel.
    fn paint(&self, out: &mut [[u8; 4]], start: DVec2, step: DVec2) {
        let stride = self.size.x as usize + 2;
        // The centre of texel (0, 0) of the bordered picture is at (-1/2, -1/2).
        let place = |p: DVec2| (p + 0.5) * 256.0 + 0.5;
        let least = DVec2::ZERO;
        let most = 256.0 * self.size.as_dvec2() + 255.0;
        let fixed = |v: f64| (v * FINE) as i64;
        for (part, out) in out.chunks_mut(RUN).enumerate() {
            let first = place(start + step * (part * RUN) as f64);
            let last = first + step * (256.0 * (out.len() - 1) as f64);
            // A run within the picture needs no look at its border; half a 256th is more than what
            // the roundings of all its steps add up to.
            let within = |p: DVec2| p.cmpge(least + 0.5).all() && p.cmple(most - 0.5).all();
            if within(first) && within(last) {
                let [mut x, mut y] = [fixed(first.x), fixed(first.y)];
                let [dx, dy] = [fixed(256.0 * step.x), fixed(256.0 * step.y)];
                for out in out {
                    *out = self.color((x >> FINE_BITS) as usize, (y >> FINE_BITS) as usize, stride);
                    (x, y) = (x + dx, y + dy);
                }
            } else {
                for (k, out) in out.iter_mut().enumerate() {
                    // Not a number becomes 0.
                    let p = (first + step * (256.0 * k as f64)).clamp(least, most);
                    *out = self.color(p.x as usize, p.y as usize, stride);
                }
            }
        }
    }

    /// The colour at a place of the bordered picture, in 256ths of a texel.
    #[inline(always)]
    fn color(&self, x: usize, y: usize, stride: usize) -> [u8; 4] {
        let at = (y >> 8) * stride + (x >> 8);
        let row = |at: usize| {
            let two = &self.texels[at..at + 2];
            between(spread(two[0]), spread(two[1]), (x & 255) as u32)
        };
        straight(between(row(at), row(at + stride), (y & 255) as u32))
    }
}

/// Bits of a place after those of the 256ths.
const FINE_BITS: u32 = 20;
/// Two to that power.
const FINE: f64 = (1 << FINE_BITS) as f64;
/// Pixels whose places are sums of steps.
const RUN: usize = 4096;

/// The channels of a texel in lanes of 16 bits.
#[inline(always)]
fn spread(texel: u32) -> u64 {
    let t = u64::from(texel);
    let t = (t | t << 16) & 0x0000_ffff_0000_ffff;
    (t | t << 8) & LANES
}

/// What of every lane a channel takes.
const LANES: u64 = 0x00ff_00ff_00ff_00ff;

/// The rounded mean of two texels in lanes, with the weight `w`, of 256, on the second. No lane
/// overflows: 255 * 256 + 128 is below 2^16.
#[inline(always)]
fn between(a: u64, b: u64, w: u32) -> u64 {
    const HALF: u64 = 0x0080_0080_0080_0080;
    ((a * u64::from(256 - w) + b * u64::from(w) + HALF) >> 8) & LANES
}

/// Straight colour of one in lanes that is multiplied by its alpha.
#[inline(always)]
fn straight(lanes: u64) -> [u8; 4] {
    let [r, g, b, a] = [0, 16, 32, 48].map(|k| (lanes >> k) as u8);
    if a == 255 {
        return [r, g, b, a];
    }
    // Casts round down and saturate; 0 / 0 gives 0.
    let up = 255.0 / f32::from(a);
    let [r, g, b] = [r, g, b].map(|c| (f32::from(c) * up + 0.5) as u8);
    [r, g, b, a]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Polygon;
    use crate::mapping::plane::Coordinates;
    use crate::models::polygons::twisted_star;

    const SIDE: u32 = 400;

    /// The star over the picture, its tips turned by a share of the whole way, in equal steps.
    fn map(share: f64) -> CompositeMap {
        let pair = twisted_star();
        let at = |t: f64| {
            let (a, b) = (pair.source.vertices(), pair.target.vertices());
            Polygon::from_loops(vec![a.zip(b).map(|(a, b)| a.lerp(b, t) * 190.0 + f64::from(SIDE) / 2.0).collect()])
        };
        let polygons = (0..=8).map(|k| at(share * f64::from(k) / 8.0)).collect();
        CompositeMap::new(Coordinates::MeanValue, polygons).unwrap()
    }

    fn picture() -> Image {
        let shade = |i: u32| ((i % SIDE / 8 + i / SIDE / 8) % 2 * 200 + 20) as u8;
        let samples = (0..SIDE * SIDE).flat_map(|i| [shade(i), shade(i + 3), 90]).collect();
        Image::new(SIDE, SIDE, 3, Pixels::U8(samples)).unwrap()
    }

    /// Distance on the canvas between a pixel and the exact image of its approximate pre-image, at
    /// most.
    fn worst(preview: &Preview, map: &CompositeMap) -> f64 {
        let found = preview.preimages();
        let seen: Vec<usize> = (0..found.points.len()).filter(|&i| found.covered[i]).collect();
        assert!(seen.len() * 2 > found.points.len());
        let points: Vec<DVec2> = seen.iter().map(|&i| DVec2::from(found.points[i].map(f64::from))).collect();
        let images = map.images_of_points(&Engine::reference(), &points).unwrap();
        let pixel = |i: usize| DVec2::new((i as u32 % SIDE) as f64 + 0.5, (i as u32 / SIDE) as f64 + 0.5);
        seen.iter().zip(images).map(|(&i, q)| (q - pixel(i)).length()).fold(0.0, f64::max)
    }

    #[test]
    fn pixels_show_what_the_exact_map_brings_there_to_a_tenth_of_a_pixel() {
        let engine = Engine::cpu();
        let mut preview = Preview::new(&engine, &picture(), &map(1.0), UVec2::splat(SIDE)).unwrap();
        assert!(worst(&preview, &map(1.0)) < 0.1, "{}", worst(&preview, &map(1.0)));
        preview.drag(&engine, &map(0.9)).unwrap();
        assert!(worst(&preview, &map(0.9)) < 0.1, "{}", worst(&preview, &map(0.9)));
        assert!(worst(&preview, &map(1.0)) > 1.0, "the measure sees another map");
    }

    #[test]
    fn the_identity_shows_the_picture() {
        let preview = Preview::new(&Engine::cpu(), &picture(), &map(0.0), UVec2::splat(SIDE)).unwrap();
        let (frame, truth) = (preview.frame().unwrap(), picture().converted(4, Depth::U8).unwrap());
        let (Pixels::U8(a), Pixels::U8(b)) = (&frame.pixels, &truth.pixels) else { panic!("other depth") };
        // A step of 200 grey levels per pixel, moved by the roundings of f32 at 400 pixels.
        assert!(a.iter().zip(b).all(|(a, b)| a.abs_diff(*b) <= 1));
    }

    #[test]
    fn transparent_texels_lend_no_colour() {
        let mut image = Image::zeros(4, 4, 4, Depth::U8).unwrap();
        for (x, y) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            [1.0, 0.0, 0.0, 1.0].iter().enumerate().for_each(|(c, v)| image.set(x, y, c as u32, *v));
        }
        let small = |t: f64| {
            let square = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]].map(DVec2::from);
            Polygon::from_loops(vec![square.map(|v| v + DVec2::new(t, 0.0)).to_vec()])
        };
        let map = CompositeMap::new(Coordinates::MeanValue, vec![small(0.0), small(0.5)]).unwrap();
        let frame = Preview::new(&Engine::cpu(), &image, &map, UVec2::new(4, 4)).unwrap().frame().unwrap();
        // Half of a red and half of a transparent texel: red with half the alpha.
        assert_eq!([0, 1, 2, 3].map(|c| frame.get(2, 0, c)), [1.0, 0.0, 0.0, 128.0 / 255.0]);
    }

    #[test]
    fn lanes_are_means_of_channels() {
        let (a, b) = ([0, 255, 7, 200], [255, 0, 9, 255]);
        for w in 0..256 {
            let lanes = between(spread(u32::from_le_bytes(a)), spread(u32::from_le_bytes(b)), w);
            for c in 0..4 {
                let exact = f64::from(a[c]) + (f64::from(b[c]) - f64::from(a[c])) * f64::from(w) / 256.0;
                let found = f64::from((lanes >> (16 * c)) as u16);
                assert!((found - exact).abs() <= 0.5, "{w} {c}: {found} {exact}");
            }
        }
        assert_eq!(straight(spread(u32::from_le_bytes([64, 128, 0, 128]))), [128, 255, 0, 128]);
        assert_eq!(straight(0), [0; 4]);
    }

    #[test]
    fn empty_and_huge_canvases_are_refused() {
        for canvas in [UVec2::ZERO, UVec2::new(1, 0), UVec2::splat(1 << 20)] {
            assert!(Preview::new(&Engine::cpu(), &picture(), &map(0.0), canvas).is_err());
        }
    }
}
