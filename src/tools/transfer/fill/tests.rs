use super::holes::Texel;
use super::*;
use crate::tools::transfer::coverage;
use crate::tools::transfer::mip::Alpha;

const DATA: Encoding = Encoding { linear_light: false, alpha: Alpha::Data };

/// A picture of one chart, or the charts that `chart` names, with holes.
struct Scene {
    image: Image,
    holes: Holes,
    covers: Vec<u8>,
}

fn scene(
    size: u32,
    value: impl Fn(u32, u32) -> f32,
    chart: impl Fn(u32, u32) -> u32,
    hole: impl Fn(u32, u32) -> bool,
) -> Scene {
    let places = || (0..size * size).map(|i| (i % size, i / size));
    let samples = places().map(|(x, y)| if hole(x, y) { 0.0 } else { value(x, y) }).collect();
    let covers = places().map(|(x, y)| if hole(x, y) { 1 } else { coverage::VALID }).collect();
    let texel = |(x, y): (u32, u32)| Texel { index: y * size + x, chart: chart(x, y), hole: hole(x, y) };
    Scene {
        image: Image::new(size, size, 1, Pixels::F32(samples)).unwrap(),
        // More known texels than those beside holes do no harm.
        holes: Holes { texels: places().map(texel).collect() },
        covers,
    }
}

impl Scene {
    fn filled(&self, how: Fill, seams: &[SeamPair]) -> (Image, Vec<u32>) {
        let mut image = self.image.clone();
        let written = fill(&mut image, &self.holes, &self.covers, seams, how, DATA, |_| {}).unwrap();
        (image, written)
    }
}

/// Largest difference from `value`.
fn worst(image: &Image, value: impl Fn(u32, u32) -> f32) -> f32 {
    let n = image.width;
    (0..n * n).map(|i| (image.get(i % n, i / n, 0) - value(i % n, i / n)).abs()).fold(0.0, f32::max)
}

fn ragged(x: u32, y: u32) -> bool {
    let (dx, dy) = (x as f32 - 31.0, y as f32 - 29.0);
    let r = 20.0 + 6.0 * (5.0 * dy.atan2(dx)).sin();
    dx * dx + dy * dy < r * r && (x, y) != (33, 30)
}

#[test]
fn smooth_holes_continue_linear_colours_exactly() {
    // Linear functions are harmonic on a grid, whatever the shape of the hole.
    let ramp = |x: u32, y: u32| 0.03 * x as f32 - 0.01 * y as f32 + 0.2;
    let s = scene(64, ramp, |_, _| 0, ragged);
    let (image, written) = s.filled(Fill::Smooth, &[]);
    assert_eq!(written.len(), s.holes.texels.iter().filter(|t| t.hole).count());
    assert!(worst(&image, ramp) < 1e-5, "{}", worst(&image, ramp));
    assert!(worst(&s.image, ramp) > 0.5, "the comparison sees holes");
    // Pull-push stays within the colours around, and near them.
    let (image, _) = s.filled(Fill::PullPush, &[]);
    let range =
        (0..64 * 64).map(|i| image.get(i % 64, i / 64, 0)).fold((f32::MAX, f32::MIN), |r, v| (r.0.min(v), r.1.max(v)));
    assert!(range.0 >= ramp(0, 63) - 1e-5 && range.1 <= ramp(63, 0) + 1e-5, "{range:?}");
    assert!(worst(&image, ramp) < 0.35, "{}", worst(&image, ramp));
}

#[test]
fn charts_do_not_mix_but_across_their_seams() {
    // Two charts side by side; the hole of the right one touches the left one in the picture only.
    let value = |x: u32, _: u32| if x < 16 { 0.0 } else { 1.0 };
    let hole = |x: u32, y: u32| (16..24).contains(&x) && (8..24).contains(&y);
    let s = scene(32, value, |x, _| u32::from(x >= 16), hole);
    for how in [Fill::PullPush, Fill::Smooth, Fill::Nearest] {
        let (image, _) = s.filled(how, &[]);
        assert!(worst(&image, value) < 1e-6, "{how:?}");
        // On the surface the hole's left side borders on the far left column.
        let seam: Vec<SeamPair> = (8..24).map(|y| SeamPair { texels: [y * 32, y * 32 + 16], charts: [0, 1] }).collect();
        let (image, _) = s.filled(how, &seam);
        assert!(image.get(16, 16, 0) < 0.5, "{how:?}: {}", image.get(16, 16, 0));
        // A seam that names another chart than the texel's is of a triangle too thin to be seen.
        let wrong: Vec<SeamPair> = seam.iter().map(|p| SeamPair { charts: [0, 7], ..*p }).collect();
        assert!(worst(&s.filled(how, &wrong).0, value) < 1e-6);
    }
}

#[test]
fn a_chart_without_any_colour_gets_it_across_seams_or_stays_empty() {
    let value = |x: u32, _: u32| if x < 8 { 0.25 } else { 0.0 };
    let s = scene(16, value, |x, _| x / 4, |x, _| x >= 8);
    for how in [Fill::PullPush, Fill::Smooth, Fill::Nearest] {
        assert_eq!(s.filled(how, &[]).1.len(), 0, "nothing around them has a colour");
        // The first chart borders on the third, that on the fourth.
        let seam = [SeamPair { texels: [0, 8], charts: [0, 2] }, SeamPair { texels: [11, 12], charts: [2, 3] }];
        let (image, written) = s.filled(how, &seam);
        assert_eq!(written.len(), 128);
        assert!(worst(&image, |_, _| 0.25).max(0.0) <= 0.25 + 1e-6);
        let columns = (8..16).all(|x| (0..16).all(|y| (image.get(x, y, 0) - 0.25).abs() < 1e-5));
        assert!(columns, "{how:?}");
    }
}

#[test]
fn the_number_of_steps_hardly_grows() {
    let steps = |size: u32| {
        let hole = |x: u32, y: u32| x > 0 && y > 0 && x + 1 < size && y + 1 < size;
        let value = |x: u32, y: u32| if (x / 7 + y / 5).is_multiple_of(2) { 1.0 } else { 0.0 };
        let s = scene(size, value, |_, _| 0, hole);
        let graph = Graph::new(&s.holes, &s.covers, &[], size);
        let known: Vec<f64> = graph.known.iter().map(|&t| f64::from(s.image.sample(t as usize))).collect();
        let pyramid = pyramid::Pyramid::new(&graph);
        let (mut values, filled) = pyramid::pull_push(&graph, &pyramid, &known);
        smooth::solve(&graph, &pyramid, &known, &filled, &mut values).unwrap()
    };
    let (small, large) = (steps(34), steps(514));
    assert!(large < 60 && large < 2 * small + 10, "{small} steps for 32 x 32, {large} for 512 x 512");
}

#[test]
fn infinite_and_missing_numbers_do_no_harm() {
    for bad in [f32::INFINITY, f32::NAN] {
        let s = scene(
            8,
            |x, _| if x == 0 { bad } else { 1.0 },
            |_, _| 0,
            |x, y| (2..6).contains(&x) && (2..6).contains(&y),
        );
        for how in [Fill::PullPush, Fill::Smooth] {
            assert_eq!(s.filled(how, &[]).1.len(), 16);
        }
        let s = scene(
            8,
            |x, _| if x == 1 { bad } else { 1.0 },
            |_, _| 0,
            |x, y| (2..6).contains(&x) && (2..6).contains(&y),
        );
        assert_eq!(s.filled(Fill::Smooth, &[]).1.len(), 16);
    }
}

#[test]
fn nearest_copies_and_never_mixes() {
    let value = |x: u32, _: u32| if x < 20 { 3.0 } else { 7.0 };
    let s = scene(64, value, |_, _| 0, ragged);
    let (image, written) = s.filled(Fill::Nearest, &[]);
    assert_eq!(written.len(), s.holes.texels.iter().filter(|t| t.hole).count());
    assert!((0..64 * 64).all(|i| [3.0, 7.0].contains(&image.get(i % 64, i / 64, 0))));
    let mixed = s.filled(Fill::Smooth, &[]).0;
    assert!(!(0..64 * 64).all(|i| [3.0, 7.0].contains(&mixed.get(i % 64, i / 64, 0))), "the comparison sees mixtures");
}
