//! A soft border: the warped picture fades into what is below it along the border of the cage.

use glam::DVec2;
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::picture::Image;

/// Share of the warped picture at each pixel of a canvas, row by row: 0 on the border of `loops`,
/// in pixels, 1 from `width` pixels away on, smooth in between. O(pixels + edges x pixels near
/// them).
pub fn feather(loops: &[Vec<DVec2>], [columns, rows]: [u32; 2], width: f64) -> Vec<f32> {
    let mut shares = vec![1.0_f32; columns as usize * rows as usize];
    if columns == 0 || !(width > 0.0) {
        return shares;
    }
    let edges: Vec<[DVec2; 2]> =
        loops.iter().flat_map(|ring| (0..ring.len()).map(|i| [ring[i], ring[(i + 1) % ring.len()]])).collect();
    shares.par_chunks_mut(columns as usize).enumerate().for_each(|(j, row)| {
        let y = j as f64 + 0.5;
        for &[a, b] in edges.iter().filter(|[a, b]| (a.y.min(b.y) - width..=a.y.max(b.y) + width).contains(&y)) {
            // Casts end at the sides of the picture.
            let first = (a.x.min(b.x) - width).floor().max(0.0) as usize;
            let end = ((a.x.max(b.x) + width).ceil().max(0.0) as usize).min(row.len());
            for (i, share) in row.iter_mut().enumerate().take(end).skip(first) {
                let distance = distance_to(DVec2::new(i as f64 + 0.5, y), a, b);
                let t = (distance / width).min(1.0);
                *share = share.min((t * t * (3.0 - 2.0 * t)) as f32);
            }
        }
    });
    shares
}

/// Distance of a point to a segment.
fn distance_to(p: DVec2, a: DVec2, b: DVec2) -> f64 {
    let along = b - a;
    let t = (p - a).dot(along) / along.length_squared();
    // Of a segment without length it is that of its point.
    p.distance(a + along * if t.is_finite() { t.clamp(0.0, 1.0) } else { 0.0 })
}

/// `above` with these shares over `below`, or over nothing: its alpha then.
///
/// # Errors
/// [`Error::Input`] if the pictures do not fit together, or there is neither a picture below nor
/// alpha.
pub fn blended(above: &Image, below: Option<&Image>, shares: &[f32]) -> Result<Image> {
    let shape = |i: &Image| (i.width, i.height, i.channels);
    let fits = below.map_or(above.has_alpha(), |below| shape(below) == shape(above));
    if !fits || shares.len() != above.width as usize * above.height as usize {
        return Err(Error::input("the pictures that are blended do not fit together", "Report this as a fault"));
    }
    let mut out = above.clone();
    let alpha = above.has_alpha().then(|| above.channels - 1);
    let at = |i: &Image, x: u32, y: u32| alpha.map_or(1.0, |c| i.get(x, y, c));
    for y in 0..above.height {
        for x in 0..above.width {
            let share = shares[(y * above.width + x) as usize];
            if share >= 1.0 {
                continue;
            }
            let (a, b) = (share * at(above, x, y), (1.0 - share) * below.map_or(0.0, |below| at(below, x, y)));
            if let (Some(below), true) = (below, a + b > 0.0) {
                for c in (0..above.channels).filter(|c| Some(*c) != alpha) {
                    out.set(x, y, c, (a * above.get(x, y, c) + b * below.get(x, y, c)) / (a + b));
                }
            }
            if let Some(c) = alpha {
                out.set(x, y, c, a + b);
            }
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::Pixels;

    #[test]
    fn shares_rise_from_the_border_to_the_width() {
        let square = vec![[4.0, 28.0].into(), [28.0, 28.0].into(), [28.0, 4.0].into(), [4.0, 4.0].into()];
        let shares = feather(&[square], [32, 32], 5.0);
        let at = |x: usize, y: usize| f64::from(shares[32 * y + x]);
        // Half a pixel from the border, and half of the way.
        assert!((at(4, 16) - 0.1f64.powi(2) * 2.8).abs() < 1e-6 && (at(16, 25) - 0.5).abs() < 1e-6);
        assert_eq!((at(16, 16), at(9, 9)), (1.0, at(9, 22)));
        assert!((0..12).all(|k| at(4 + k, 16) <= at(5 + k, 16)));
        assert!(feather(&[], [4, 4], 3.0).iter().all(|s| *s == 1.0));
    }

    #[test]
    fn a_share_mixes_colours_and_takes_alpha() {
        let picture = |channels: u32, value: [u8; 4]| {
            Image::new(1, 1, channels, Pixels::U8(value[..channels as usize].to_vec())).unwrap()
        };
        let samples =
            |image: Image| (0..image.channels).map(|c| (255.0 * image.get(0, 0, c)).round()).collect::<Vec<_>>();
        let (red, blue) = (picture(3, [200, 0, 0, 0]), picture(3, [0, 0, 100, 0]));
        assert_eq!(samples(blended(&red, Some(&blue), &[0.5]).unwrap()), [100.0, 0.0, 50.0]);
        let clear = picture(4, [200, 0, 0, 255]);
        assert_eq!(samples(blended(&clear, None, &[0.2]).unwrap()), [200.0, 0.0, 0.0, 51.0]);
        // What is not there has no colour.
        let nothing = picture(4, [0, 0, 250, 0]);
        assert_eq!(samples(blended(&clear, Some(&nothing), &[0.4]).unwrap()), [200.0, 0.0, 0.0, 102.0]);
        assert!(blended(&red, None, &[0.5]).is_err() && blended(&red, Some(&clear), &[0.5]).is_err());
    }
}
