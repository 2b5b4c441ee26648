use super::super::footprint::{Footprint, Footprints};
use super::*;
use crate::picture::ellipse::VARIANCE;
use crate::picture::lanczos::tests::exact_weights;
use crate::picture::{Image, Pixels};
use crate::tools::transfer::{Alpha, Encoding};

/// Pre-images of a block under `p = a q + b`.
fn affine(width: usize, height: usize, a: [[f64; 2]; 2], b: [f64; 2]) -> (Footprints, [i32; 2]) {
    let base = [b[0] as i32, b[1] as i32];
    let mut footprints = Footprints::new(width * height, true);
    for i in 0..width * height {
        let (x, y) = ((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
        let at = |r: usize| (a[r][0] * x + a[r][1] * y + b[r] - f64::from(base[r])) as f32;
        let footprint = Footprint {
            at: [at(0), at(1)],
            dx: [a[0][0] as f32, a[1][0] as f32],
            dy: [a[0][1] as f32, a[1][1] as f32],
            cover: 1.0,
        };
        footprints.set(i, footprint);
    }
    (footprints, base)
}

fn warped(image: &Image, filter: Filter, width: usize, height: usize, a: [[f64; 2]; 2], b: [f64; 2]) -> Vec<Texel> {
    let pyramid = Pyramid::new(image, Encoding::default()).unwrap();
    let (footprints, base) = affine(width, height, a, b);
    let mut out = vec![[0.0; 4]; width * height];
    let block = Block { width, base, seen: footprints.seen() };
    warp_image(&pyramid, filter, &block, &mut Window::default(), &mut out);
    out
}

fn picture(width: u32, height: u32, f: impl Fn(f64, f64) -> f64) -> Image {
    let samples =
        (0..width * height).map(|i| f(f64::from(i % width) + 0.5, f64::from(i / width) + 0.5) as f32).collect();
    Image::new(width, height, 1, Pixels::F32(samples)).unwrap()
}

const FILTERS: [Filter; 7] = [
    Filter::Ewa,
    Filter::Anisotropic,
    Filter::Trilinear,
    Filter::Bilinear,
    Filter::Nearest,
    Filter::Lanczos,
    Filter::Lanczos4,
];

#[test]
fn the_identity_keeps_every_sample() {
    let image = picture(40, 30, |x, y| (x * 7.3).sin() * (y * 3.1).cos());
    let pyramid = Pyramid::new(&image, Encoding::default()).unwrap();
    let mut window = Window::default();
    pyramid.read(0, [0, 0], [40, 30], &mut window);
    for filter in FILTERS {
        let out = warped(&image, filter, 40, 30, [[1.0, 0.0], [0.0, 1.0]], [0.0, 0.0]);
        assert_eq!(out, window.texels, "{filter:?}");
    }
}

#[test]
fn constants_stay_under_any_map() {
    let image = picture(50, 41, |_, _| 0.625);
    for filter in FILTERS {
        for scale in [1e-6, 0.1, 0.9, 1.2, 2.7, 11.0, 90.0, 1e4, 1e9] {
            for turn in [0.0_f64, 0.3, 0.8] {
                let (s, c) = (turn.sin() * scale, turn.cos() * scale);
                for thin in [1.0, 0.03] {
                    let a = [[c, -s * thin], [s, c * thin]];
                    let b = [25.0 - 4.0 * (a[0][0] + a[0][1]), 20.0 - 4.0 * (a[1][0] + a[1][1])];
                    for texel in warped(&image, filter, 8, 8, a, b) {
                        assert!((texel[0] - 0.625).abs() < 4e-6, "{filter:?} {scale} {turn} {thin}: {texel:?}");
                    }
                }
            }
        }
    }
}

/// The frequency response of the kernel (1 - q)^3 to a wave with this phase advance per kernel
/// radius, by quadrature.
fn response(advance: f64) -> f64 {
    let n = 4000;
    let (mut sum, mut weights) = (0.0, 0.0);
    for i in 0..n {
        // The kernel's projection on the direction of the wave is (1 - x^2)^(7/2), up to a factor.
        let x = (f64::from(i) + 0.5) / f64::from(n);
        let w = (1.0 - x * x).powf(3.5);
        sum += w * (advance * x).cos();
        weights += w;
    }
    sum / weights
}

#[test]
fn waves_under_affine_maps_fade_as_the_kernel_says() {
    let image = picture(1024, 1024, |x, y| (0.11 * x + 0.07 * y).cos());
    let radius = f64::from(VARIANCE * 10.0).sqrt();
    // Turned, sheared and scaled by 2 to 40 along, 2 to 12 across.
    for (along, across, turn) in
        [(2.0, 2.0, 0.3), (4.0, 2.5, 1.1), (7.0, 6.5, 0.7), (20.0, 4.0, 2.3), (40.0, 12.0, 0.9)]
    {
        let (s, c) = f64::sin_cos(turn);
        let a = [[c * along, -s * across], [s * along, c * across]];
        let b = [512.0 - 3.0 * (a[0][0] + a[0][1]), 512.0 - 3.0 * (a[1][0] + a[1][1])];
        let out = warped(&image, Filter::Ewa, 6, 6, a, b);
        // The wave's advance in output pixels: A^T k.
        let k = [0.11 * a[0][0] + 0.07 * a[1][0], 0.11 * a[0][1] + 0.07 * a[1][1]];
        let expected = response(k[0].hypot(k[1]) * radius);
        for (i, texel) in out.iter().enumerate() {
            let q = [(i % 6) as f64 + 0.5, (i / 6) as f64 + 0.5];
            let p = [0, 1].map(|r| a[r][0] * q[0] + a[r][1] * q[1] + b[r]);
            let exact = expected * (0.11 * p[0] + 0.07 * p[1]).cos();
            // What the boxes of the levels and the steps of the sums change.
            assert!((f64::from(texel[0]) - exact).abs() < 0.02, "{along} {across}: {} {exact}", texel[0]);
        }
    }
}

#[test]
fn checks_and_rings_that_are_reduced_become_grey() {
    let checker = picture(1024, 1024, |x, y| f64::from((x as u32 + y as u32) % 2));
    let rings = picture(1024, 1024, |x, y| 0.5 + 0.5 * ((x * x + y * y) * std::f64::consts::PI / 2048.0).cos());
    for (scale, turn) in [(6.3, 0.0_f64), (8.0, 0.4), (21.7, 1.0), (100.0, 0.2)] {
        let (s, c) = (turn.sin() * scale, turn.cos() * scale);
        let a = [[c, -s], [s, c]];
        let b = [700.0 - 2.0 * (a[0][0] + a[0][1]), 700.0 - 2.0 * (a[1][0] + a[1][1])];
        for (name, image) in [("checker", &checker), ("rings", &rings)] {
            for texel in warped(image, Filter::Ewa, 4, 4, a, b) {
                assert!((texel[0] - 0.5).abs() < 0.02, "{name} at 1/{scale}: {}", texel[0]);
            }
            // The comparison must see aliasing.
            let aliased = warped(image, Filter::Bilinear, 4, 4, a, b);
            assert!(name == "checker" || aliased.iter().any(|t| (t[0] - 0.5).abs() > 0.1), "{name} at 1/{scale}");
        }
    }
}

#[test]
fn levels_do_not_show() {
    // Growing scale on smooth content: neighbours never jump where the level changes.
    let image = picture(2048, 64, |x, _| (x * 0.05).sin());
    let at = |scale: f64| {
        warped(&image, Filter::Ewa, 1, 1, [[scale, 0.0], [0.0, scale]], [1000.0 - scale * 0.5, 32.0 - scale * 0.5])[0]
            [0]
    };
    let mut before = at(1.0);
    for n in 1..600 {
        let now = at(1.0 + f64::from(n) * 0.05);
        assert!((now - before).abs() < 0.015, "at scale {}: {before} then {now}", 1.0 + f64::from(n) * 0.05);
        before = now;
    }
}

#[test]
fn far_places_are_as_sharp_as_near_ones() {
    // A picture 70,000 pixels wide: single precision holds its positions to 1/128 only.
    let image = Image::new(70_000, 3, 1, Pixels::U8((0..210_000).map(|i| (i % 199) as u8).collect())).unwrap();
    for filter in FILTERS {
        for x in [10.0, 69_950.25] {
            let out = warped(&image, filter, 8, 1, [[1.0, 0.0], [0.0, 1.0]], [x, 1.0]);
            let (i, f) = (x as u32, (x.fract()) as f32);
            for (k, texel) in (0u32..).zip(&out) {
                let (a, b) = (image.get(i + k, 1, 0), image.get(i + k + 1, 1, 0));
                if filter == Filter::Bilinear {
                    assert!((texel[0] - (a + f * (b - a))).abs() < 1e-6);
                }
                assert!((texel[0] - (a + f * (b - a))).abs() < 0.15);
            }
        }
    }
}

#[test]
fn scattered_pixels_stay_within_memory() {
    // Each pixel looks elsewhere: windows must be split.
    let image = picture(4096, 4096, |x, _| x / 4096.0);
    let pyramid = Pyramid::new(&image, Encoding::default()).unwrap();
    let place = |i: usize| [(i * 2477 % 4096) as f32, (i * 1531 % 4096) as f32];
    let mut footprints = Footprints::new(1024, true);
    for i in 0..1024 {
        footprints.set(i, Footprint { at: place(i), dx: [1.0, 0.0], dy: [0.0, 1.0], cover: 1.0 });
    }
    for filter in FILTERS {
        let (mut window, mut out) = (Window::default(), vec![[0.0; 4]; 1024]);
        warp_image(
            &pyramid,
            filter,
            &Block { width: 32, base: [0, 0], seen: footprints.seen() },
            &mut window,
            &mut out,
        );
        assert!(window.texels.capacity() < 1 << 18, "{filter:?}: {}", window.texels.capacity());
        for (i, o) in out.iter().enumerate() {
            assert!((o[0] - place(i)[0] / 4096.0).abs() < 1e-3, "{filter:?}");
        }
    }
}

/// The filters one tap at a time, in double precision, from decoded texels continued by the border.
fn by_hand<const TAPS: usize>(
    image: &Image,
    alpha: Alpha,
    weights: impl Fn(f64) -> [f64; TAPS],
    p: [f64; 2],
) -> [f64; 4] {
    let channels = image.channels as usize;
    let texel = |x: i64, y: i64| {
        let x = x.clamp(0, i64::from(image.width) - 1) as u32;
        let y = y.clamp(0, i64::from(image.height) - 1) as u32;
        let mut t = [0.0; 4];
        (0..channels).for_each(|c| t[c] = f64::from(image.get(x, y, c as u32)));
        if image.has_alpha() && alpha == Alpha::Opacity {
            (0..channels - 1).for_each(|c| t[c] *= t[channels - 1]);
        }
        t
    };
    let q = p.map(|v| v - 0.5);
    let first = q.map(|v| v.floor() as i64 - (TAPS as i64 / 2 - 1));
    let [wx, wy] = q.map(|v| weights(v - v.floor()));
    let mut sum = [0.0; 4];
    for j in 0..TAPS {
        for i in 0..TAPS {
            let t = texel(first[0] + i as i64, first[1] + j as i64);
            (0..4).for_each(|c| sum[c] += wx[i] * wy[j] * t[c]);
        }
    }
    sum
}

#[test]
fn every_kind_of_samples_is_filtered_as_by_hand() {
    let (w, h) = (45, 38);
    let value = |i: usize| (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
    for channels in 1..=4_u32 {
        let count = (w * h * channels) as usize;
        let kinds = [
            Pixels::U8((0..count).map(|i| value(i) as u8).collect()),
            Pixels::U16((0..count).map(|i| value(i) as u16).collect()),
            Pixels::F32((0..count).map(|i| (value(i) & 1023) as f32 / 1023.0).collect()),
        ];
        for pixels in kinds {
            let image = Image::new(w, h, channels, pixels).unwrap();
            for alpha in [Alpha::Opacity, Alpha::Data] {
                let pyramid = Pyramid::new(&image, Encoding { alpha, ..Encoding::default() }).unwrap();
                // Within the picture to its last sample, so that nothing is continued, and over its
                // borders.
                for (a, b) in [([[0.9, 0.1], [-0.07, 0.8]], [2.0, 4.5]), ([[1.2, -0.3], [0.2, 1.3]], [-5.0, -6.0])] {
                    let (mut footprints, base) = affine(33, 34, a, b);
                    footprints.set(7, Footprint::default());
                    let corner = [44.499 - base[0] as f32, 37.499 - base[1] as f32];
                    footprints.set(8, Footprint { at: corner, cover: 0.5, ..Footprint::default() });
                    let seen = footprints.seen();
                    for filter in [Filter::Bilinear, Filter::Lanczos, Filter::Lanczos4] {
                        let mut out = vec![[7.0; 4]; seen.len()];
                        let block = Block { width: 33, base, seen };
                        warp_image(&pyramid, filter, &block, &mut Window::default(), &mut out);
                        for (i, out) in out.iter().enumerate() {
                            if i == 7 {
                                assert_eq!(*out, [7.0; 4], "pixels that look nowhere are left alone");
                                continue;
                            }
                            let p = [0, 1].map(|a| f64::from(seen.place(i)[a]) + f64::from(base[a]));
                            let expected = match filter {
                                Filter::Bilinear => by_hand(&image, alpha, |f| [1.0 - f, f], p),
                                Filter::Lanczos => by_hand(&image, alpha, exact_weights::<6>, p),
                                _ => by_hand(&image, alpha, exact_weights::<8>, p),
                            };
                            for c in 0..4 {
                                let off = (f64::from(out[c]) - expected[c]).abs();
                                assert!(off < 2e-5, "{filter:?} {channels} {alpha:?} pixel {i}: {off}");
                            }
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn samples_read_directly_are_those_of_windows() {
    for channels in 1..=4 {
        let samples = (0..400 * channels).map(|i| (i * i % 251) as u8).collect();
        let image = Image::new(20, 20, channels, Pixels::U8(samples)).unwrap();
        let (a, b) = ([[0.93, 0.21], [-0.17, 0.88]], [8.0, 9.0]);
        let direct = warped(&image, Filter::Bilinear, 8, 8, a, b);
        let pyramid = Pyramid::new(&image, Encoding::default()).unwrap();
        let (footprints, base) = affine(8, 8, a, b);
        let block = Block { width: 8, base, seen: footprints.seen() };
        let (mut out, whole) = (vec![[0.0; 4]; 64], Part { x: 0, y: 0, width: 8, height: 8 });
        assert!(direct::bilinear(&pyramid, &block, &bounds(&block, whole), &mut out.clone()));
        run(&pyramid, &block, &Fixed { block: &block, filter: Bilinear }, whole, &mut Window::default(), &mut out);
        assert_eq!(out, direct);
    }
}
