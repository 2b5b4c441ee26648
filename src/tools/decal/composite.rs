//! Pictures over pictures.

use glam::DVec2;
use rayon::prelude::*;

use crate::control;
use crate::error::{Error, Result};
use crate::picture::{Image, Pixels};
use crate::tools::transfer::color::Sample;

/// Texels of transparency around a picture, at least, and in parts of its longer side.
const FRAME: (u32, f64) = (4, 1.0 / 16.0);
/// Texels of one parallel task.
const TASK: usize = 4096;

/// The picture as RGBA in its own depth, with a transparent frame; the frame's width in parts of
/// the result's sides. Colours go on into the frame, only alpha ends.
///
/// # Errors
/// If the result is too large.
pub(super) fn framed(picture: &Image) -> Result<(Image, DVec2)> {
    picture.check("decal")?;
    let (w, h) = (picture.width, picture.height);
    let frame = FRAME.0.max((f64::from(w.max(h)) * FRAME.1).ceil() as u32);
    let size = |side: u32| side.checked_add(2 * frame).filter(|s| *s <= 1 << 20);
    let (Some(width), Some(height)) = (size(w), size(h)) else {
        return Err(Error::input(format!("the decal has {w} x {h} texels"), "Use a smaller picture"));
    };
    let bytes = 4 * u64::from(width) * u64::from(height) * picture.depth().bytes() as u64;
    control::require(bytes, || format!("a border around the decal of {w} x {h} texels"))?;
    let mut out = Image::zeros(width, height, 4, picture.depth())?;
    let channels = picture.channels as usize;
    let place = |x: u32, y: u32| {
        let inside = |a: u32, n: u32| (frame..frame + n).contains(&a);
        let clamp = |a: u32, n: u32| a.saturating_sub(frame).min(n - 1);
        let from = (clamp(y, h) as usize * w as usize + clamp(x, w) as usize) * channels;
        (from, inside(x, w) && inside(y, h))
    };
    fn fill<T: Copy + Send + Sync>(
        out: &mut [T],
        from: &[T],
        width: usize,
        channels: usize,
        [zero, full]: [T; 2],
        place: impl Fn(u32, u32) -> (usize, bool) + Sync,
    ) {
        out.par_chunks_mut(4 * width).enumerate().for_each(|(y, row)| {
            for (x, texel) in row.chunks_exact_mut(4).enumerate() {
                let (at, inside) = place(x as u32, y as u32);
                let color = |c: usize| from[at + if channels > 2 { c } else { 0 }];
                let alpha = if channels.is_multiple_of(2) { from[at + channels - 1] } else { full };
                texel.copy_from_slice(&[color(0), color(1), color(2), if inside { alpha } else { zero }]);
            }
        });
    }
    match (&mut out.pixels, &picture.pixels) {
        (Pixels::U8(out), Pixels::U8(p)) => fill(out, p, width as usize, channels, [0, u8::MAX], place),
        (Pixels::U16(out), Pixels::U16(p)) => fill(out, p, width as usize, channels, [0, u16::MAX], place),
        (Pixels::F32(out), Pixels::F32(p)) => fill(out, p, width as usize, channels, [0.0, 1.0], place),
        _ => unreachable!("both have the picture's depth"),
    }
    let frame = f64::from(frame);
    Ok((out, DVec2::new(frame / f64::from(width), frame / f64::from(height))))
}

/// `over` (RGBA, straight alpha times `opacity`) upon `base`, a picture of the same size. The
/// result has the base's depth, and its channels, but is coloured where `over` is. Texels without
/// any of `over` keep their stored values. With `linear_light` light is blended, not stored sRGB
/// values.
///
/// # Errors
/// [`Error::Input`] if sizes differ or `over` has no four channels.
pub fn composite(base: &Image, over: &Image, opacity: f32, linear_light: bool) -> Result<Image> {
    base.check("texture")?;
    over.check("decal")?;
    if (base.width, base.height) != (over.width, over.height) || over.channels != 4 {
        let what = format!("{} x {} upon {} x {}", over.width, over.height, base.width, base.height);
        return Err(Error::input(format!("pictures do not fit: {what}"), "Give an RGBA picture of the same size"));
    }
    let alpha = base.has_alpha();
    let mut out = base.clone();
    if base.channels < 3 {
        let channels = 3 + u32::from(alpha);
        out = Image::zeros(base.width, base.height, channels, base.depth())?;
        let n = base.channels as usize;
        match (&mut out.pixels, &base.pixels) {
            (Pixels::U8(out), Pixels::U8(b)) => widen(out, b, n),
            (Pixels::U16(out), Pixels::U16(b)) => widen(out, b, n),
            (Pixels::F32(out), Pixels::F32(b)) => widen(out, b, n),
            _ => unreachable!("both have the base's depth"),
        }
    }
    let over_at = |i: usize| -> [f32; 4] {
        match &over.pixels {
            Pixels::U8(v) => decoded(&v[4 * i..], 4, linear_light),
            Pixels::U16(v) => decoded(&v[4 * i..], 4, linear_light),
            Pixels::F32(v) => decoded(&v[4 * i..], 4, linear_light),
        }
    };
    let n = out.channels as usize;
    match &mut out.pixels {
        Pixels::U8(v) => blend(v, n, opacity, linear_light, over_at),
        Pixels::U16(v) => blend(v, n, opacity, linear_light, over_at),
        Pixels::F32(v) => blend(v, n, opacity, linear_light, over_at),
    }
    Ok(out)
}

/// Colour and alpha of a texel of three or four channels.
fn decoded<T: Sample>(texel: &[T], channels: usize, light: bool) -> [f32; 4] {
    let alpha = if channels == 4 { texel[3].decode(false).clamp(0.0, 1.0) } else { 1.0 };
    [texel[0].decode(light), texel[1].decode(light), texel[2].decode(light), alpha]
}

/// Porter and Duff's "over" on straight alpha, texel by texel.
fn blend<T: Sample>(
    out: &mut [T],
    channels: usize,
    opacity: f32,
    light: bool,
    over: impl Fn(usize) -> [f32; 4] + Sync,
) {
    out.par_chunks_mut(channels * TASK).enumerate().for_each(|(task, part)| {
        for (k, texel) in part.chunks_exact_mut(channels).enumerate() {
            let top = over(task * TASK + k);
            let a = top[3] * opacity;
            if !(a > 0.0) {
                continue;
            }
            let bottom = decoded(texel, channels, light);
            let below = bottom[3] * (1.0 - a);
            for c in 0..3 {
                texel[c] = T::encode((a * top[c] + below * bottom[c]) / (a + below), light);
            }
            if channels == 4 {
                texel[3] = T::encode(a + below, false);
            }
        }
    });
}

/// Grey, with alpha or not, as colour.
fn widen<T: Copy>(out: &mut [T], base: &[T], channels: usize) {
    for (to, from) in out.chunks_exact_mut(channels + 2).zip(base.chunks_exact(channels)) {
        to[..3].fill(from[0]);
        if channels == 2 {
            to[3] = from[1];
        }
    }
}
