//! `pad_seams` against brute force, mip chains, and what they keep.

use barymap::geometry::NONE;
use barymap::picture::{Image, Pixels};
use barymap::tools::transfer::pad::pad_seams;
use barymap::tools::transfer::{Alpha, Encoding, mip::MipChain};

use super::Random;

fn nearest_by_brute_force(coverage: &[u8], width: usize, margin: u32) -> Vec<u32> {
    let place = |i: usize| ((i % width) as i64, (i / width) as i64);
    (0..coverage.len())
        .map(|i| {
            let (x, y) = place(i);
            (0..coverage.len())
                .filter(|&j| coverage[j] >= 128)
                .map(|j| ((place(j).0 - x).pow(2) + (place(j).1 - y).pow(2), j as u32))
                .filter(|&(d, _)| d <= i64::from(margin).pow(2))
                .min()
                .map_or(NONE, |(_, j)| j)
        })
        .collect()
}

#[test]
fn padding_is_exact_by_distance_and_index() {
    let mut r = Random(11);
    for (w, h) in [(1, 1), (17, 9), (40, 33), (300, 2), (2, 300)] {
        for density in [0, 1, 20, 900] {
            let cover: Vec<u8> = (0..w * h)
                .map(|_| match r.next() % 1000 {
                    n if n < density => [128, 255][(r.next() % 2) as usize],
                    // Padding that is there already is not copied from.
                    n if n < density + 30 => 64,
                    _ => 0,
                })
                .collect();
            for margin in [0, 1, 2, 5, 16, 1000, 3_000_000_000] {
                let expected = nearest_by_brute_force(&cover, w, margin);
                let mut nearest = Vec::new();
                pad_seams(&cover, w, 0..h, margin, &mut nearest);
                assert_eq!(nearest, expected, "{w}x{h}, margin {margin}");
                let mut bands = Vec::new();
                for y in (0..h).step_by(7) {
                    pad_seams(&cover, w, y..(y + 7).min(h), margin, &mut nearest);
                    bands.extend_from_slice(&nearest);
                }
                assert_eq!(bands, expected, "{w}x{h} in bands, margin {margin}");
            }
        }
    }
}

#[test]
fn every_mip_level_has_the_mean_of_the_picture() {
    let mut r = Random(5);
    for (w, h) in [(1, 1), (2, 2), (3, 3), (5, 7), (64, 64), (1000, 3), (33, 31), (1, 17)] {
        for channels in 1..=4_u32 {
            let samples: Vec<f32> = (0..w * h * channels).map(|_| r.unit() as f32).collect();
            let image = Image::new(w, h, channels, Pixels::F32(samples.clone())).expect("picture");
            let encoding = Encoding { alpha: Alpha::Data, ..Encoding::default() };
            let chain = MipChain::new(&image, encoding).expect("chain");
            let mean = |texels: &[f32], c: usize| {
                let part = texels.iter().skip(c).step_by(channels as usize);
                part.map(|&v| f64::from(v)).sum::<f64>() / (texels.len() as f64 / f64::from(channels))
            };
            for level in chain.levels.iter() {
                for c in 0..channels as usize {
                    let error = mean(&level.texels, c) - mean(&samples, c);
                    assert!(error.abs() < 2e-6, "{w}x{h}, {} wide: {error}", level.width);
                }
            }
            let last = chain.levels.last().map_or((w, h), |l| (l.width, l.height));
            assert_eq!(last, (1, 1));
            let bytes: usize = chain.levels.iter().map(|l| l.texels.len() * 4).sum();
            assert_eq!(bytes as u64, MipChain::bytes(w, h, channels));
        }
    }
}

#[test]
fn colours_are_averaged_by_opacity_and_as_light() {
    // Opaque black beside white that nobody sees: their mean is half-transparent black.
    let image = Image::new(2, 1, 4, Pixels::U8(vec![0, 0, 0, 255, 255, 255, 255, 0])).expect("picture");
    let chain = MipChain::new(&image, Encoding::default()).expect("chain");
    assert_eq!(chain.levels[0].texels, [0.0, 0.0, 0.0, 0.5]);
    let data = MipChain::new(&image, Encoding { alpha: Alpha::Data, linear_light: false }).expect("chain");
    assert_eq!(data.levels[0].texels, [0.5, 0.5, 0.5, 0.5]);
    // Black and white lines seen from afar have half the light of white.
    let lines = Image::new(2, 1, 1, Pixels::U8(vec![0, 255])).expect("picture");
    let light = MipChain::new(&lines, Encoding { linear_light: true, alpha: Alpha::Opacity }).expect("chain");
    assert_eq!(light.levels[0].texels, [0.5]);
}
