//! Telling what a picture holds by its texels.

use crate::picture::Image;

/// Texels that are looked at, at most.
const LOOKED_AT: usize = 1 << 14;
/// Lengths of normals may be off by this much: pictures are rounded to eight bits, compressed and
/// reduced.
const LENGTH: f32 = 0.15;
/// Samples that differ by less are equal: grey.
const GREY: f32 = 3.0 / 255.0;
/// Share of the texels in use that must be normals.
const SHARE: f64 = 0.9;

/// Whether a picture holds tangent-space normals: bluish vectors of unit length, and not greys.
/// Black and fully transparent texels count as unused. O(1): some texels of a regular grid are
/// looked at.
pub fn holds_normals(image: &Image) -> bool {
    let n = image.channels as usize;
    if n < 3 {
        return false;
    }
    let texels = image.pixels.len() / n;
    let step = texels.div_ceil(LOOKED_AT).max(1);
    let (mut used, mut normals) = (0_u64, 0_u64);
    for t in (0..texels).step_by(step) {
        let [r, g, b] = [0, 1, 2].map(|c| image.sample(t * n + c));
        if (n == 4 && image.sample(t * n + 3) == 0.0) || (r, g, b) == (0.0, 0.0, 0.0) {
            continue;
        }
        used += 1;
        let length = [r, g, b].iter().map(|c| (2.0 * c - 1.0).powi(2)).sum::<f32>().sqrt();
        let grey = (r - g).abs() < GREY && (g - b).abs() < GREY;
        normals += u64::from(!grey && b > 0.5 && (length - 1.0).abs() < LENGTH);
    }
    used > 0 && normals as f64 >= SHARE * used as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::Depth;

    fn picture(texel: impl Fn(u32, u32) -> [f32; 3]) -> Image {
        let mut image = Image::zeros(32, 16, 3, Depth::U8).unwrap();
        for y in 0..16 {
            for x in 0..32 {
                texel(x, y).into_iter().enumerate().for_each(|(c, v)| image.set(x, y, c as u32, v));
            }
        }
        image
    }

    #[test]
    fn normals_are_told_from_heights_and_colours() {
        let normal = |x: u32, y: u32| {
            let (u, v) = (0.03 * (x as f32 - 16.0), 0.05 * (y as f32 - 8.0));
            let l = (u * u + v * v + 1.0).sqrt();
            [u, v, 1.0].map(|c| 0.5 + 0.5 * c / l)
        };
        assert!(holds_normals(&picture(normal)));
        assert!(holds_normals(&picture(|x, y| if x < 12 { [0.0; 3] } else { normal(x, y) })), "with unused texels");
        assert!(!holds_normals(&picture(|x, _| [x as f32 / 31.0; 3])), "heights");
        assert!(!holds_normals(&picture(|_, _| [0.79; 3])), "a grey whose vector has unit length");
        assert!(!holds_normals(&picture(|x, y| [x as f32 / 31.0, y as f32 / 15.0, 0.4])), "colours");
        assert!(
            !holds_normals(&picture(|x, y| if x % 2 == 0 { normal(x, y) } else { [0.9, 0.2, 0.1] })),
            "half of them"
        );
        assert!(!holds_normals(&picture(|_, _| [0.0; 3])));
        assert!(!holds_normals(&Image::zeros(4, 4, 1, Depth::U8).unwrap()));
    }
}
