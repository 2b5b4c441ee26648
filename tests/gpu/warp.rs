//! `warp_image` against its reference.

use barymap::picture::Filter;
use barymap::picture::{Image, Pixels};
use barymap::tools::transfer::Encoding;
use barymap::tools::warp::band::Band;
use barymap::tools::warp::footprint::{Footprint, Footprints};
use barymap::tools::warp::gpu::warp_image;
use barymap::tools::warp::pyramid::Pyramid;

use super::devices;

/// A band whose pixels are moved, turned, reduced and stretched, more towards the right; every
/// fifth sees nothing.
fn band(rows: usize, width: usize, strength: f32, far: i32) -> (Band, Vec<[i32; 2]>, Footprints) {
    let band = Band { first: 0, rows, width };
    let mut seen = Footprints::new(band.len(), true);
    let mut bases = Vec::new();
    for place in band.places() {
        let base = [far + place.x as i32, place.y as i32];
        bases.push(base);
        for j in 0..place.height {
            for i in 0..place.width {
                let (x, y) = ((place.x + i) as f32 + 0.5, (place.y + j) as f32 + 0.5);
                let s = 1.0 + strength * x / width as f32;
                let p = [x * s + 5.0 * (0.1 * y).sin(), y * s - 4.0 * (0.07 * x).cos()];
                let footprint = Footprint {
                    at: [p[0] - place.x as f32, p[1] - place.y as f32],
                    dx: [s, 0.28 * (0.07 * x).sin()],
                    dy: [0.5 * (0.1 * y).cos() * s * 3.0, s],
                    cover: if (place.x + i + place.y + j).is_multiple_of(5) { 0.0 } else { 1.0 },
                };
                seen.set(place.start + j * place.width + i, footprint);
            }
        }
    }
    (band, bases, seen)
}

fn picture(width: u32, height: u32) -> Image {
    let count = (width * height * 4) as usize;
    Image::new(width, height, 4, Pixels::U8((0..count).map(|i| ((i * 2_654_435_761) >> 11) as u8).collect())).unwrap()
}

#[test]
fn colours_are_the_references() {
    let image = picture(300, 200);
    let pyramid = Pyramid::new(&image, Encoding::default()).unwrap();
    for gpu in devices() {
        for filter in [Filter::Bilinear, Filter::Lanczos, Filter::Ewa] {
            // One pixel, one group less and more, several blocks; moved, reduced and reduced a lot.
            for (rows, width, strength) in [(1, 1, 0.0), (1, 63, 0.2), (5, 13, 1.0), (70, 97, 2.0), (40, 33, 30.0)] {
                let (band, bases, seen) = band(rows, width, strength, 0);
                let mut expected = vec![[0.25; 4]; band.len()];
                let mut found = expected.clone();
                band.gather(&pyramid, filter, &bases, seen.seen(), &mut expected);
                assert!(warp_image(gpu, &pyramid, filter, band, &bases, seen.seen(), &mut found).unwrap());
                let apart = |a: &[[f32; 4]], b: &[[f32; 4]]| {
                    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
                };
                // Sums of up to a thousand weighted samples below 1, in another order.
                let worst = apart(&expected, &found);
                assert!(worst < 2e-5, "{filter:?} {rows} x {width} by {strength}: {worst}");
                let mut broken = found.clone();
                broken[band.len() / 2][1] += 1e-3;
                assert!(apart(&expected, &broken) > 2e-5, "the comparison sees one sample");
            }
        }
    }
}

#[test]
fn far_columns_and_scattered_pixels() {
    let image = Image::new(70_000, 4, 1, Pixels::U8((0..280_000u32).map(|i| (i % 251) as u8).collect())).unwrap();
    let pyramid = Pyramid::new(&image, Encoding::default()).unwrap();
    for gpu in devices() {
        let (band, bases, seen) = band(4, 64, 0.0, 69_900);
        let (mut expected, mut found) = (vec![[0.0; 4]; band.len()], vec![[0.0; 4]; band.len()]);
        band.gather(&pyramid, Filter::Ewa, &bases, seen.seen(), &mut expected);
        assert!(warp_image(gpu, &pyramid, Filter::Ewa, band, &bases, seen.seen(), &mut found).unwrap());
        assert!(expected.iter().zip(&found).all(|(a, b)| (a[0] - b[0]).abs() < 2e-5));
        // Pixels that see places far apart do not fit, and are left to the reference.
        let big = picture(3000, 3000);
        let pyramid = Pyramid::new(&big, Encoding::default()).unwrap();
        let mut apart = Footprints::new(2, false);
        for (i, x) in [10.0, 2990.0].into_iter().enumerate() {
            apart.set(i, Footprint { at: [x, x], dx: [1.0, 0.0], dy: [0.0, 1.0], cover: 1.0 });
        }
        let mut colors = [[0.5; 4]; 2];
        let band = Band { first: 0, rows: 1, width: 2 };
        let done = warp_image(gpu, &pyramid, Filter::Bilinear, band, &[[0, 0]], apart.seen(), &mut colors);
        assert!(!done.unwrap());
        assert_eq!(colors, [[0.5; 4]; 2]);
    }
}
