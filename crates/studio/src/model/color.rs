//! Colours that tell pairs apart.

/// The colour of the pair with this number: neighbours in the list differ most, and none is the
/// red of wrong pairs. sRGB.
pub fn of_pair(id: u64) -> [u8; 3] {
    // The golden section spreads any number of hues; reds, within 25 degrees of 0, are left out.
    let turn = (id as f64 * 0.618_033_988_749_895).fract();
    let hue = (25.0 + 310.0 * turn) / 60.0;
    let value = if id.is_multiple_of(2) { 1.0 } else { 0.85 };
    hsv(hue, 0.75, value)
}

/// What is wrong.
pub const WRONG: [u8; 3] = [235, 40, 40];

fn hsv(hue: f64, saturation: f64, value: f64) -> [u8; 3] {
    let channel = |n: f64| {
        let k = (n + hue) % 6.0;
        let part = value - value * saturation * k.min(4.0 - k).clamp(0.0, 1.0);
        (255.0 * part).round() as u8
    };
    [channel(5.0), channel(3.0), channel(1.0)]
}

/// From distrust to trust: red, yellow, white-green. `x` in 0..=1; RGBA, opaque.
pub fn of_confidence(x: f32) -> [u8; 4] {
    let x = if x.is_finite() { x.clamp(0.0, 1.0) } else { 0.0 };
    let (low, middle, high) = ([200.0, 40.0, 40.0], [240.0, 200.0, 70.0], [90.0, 180.0, 110.0]);
    let mix = |a: [f32; 3], b: [f32; 3], t: f32| [0, 1, 2].map(|k| (a[k] + (b[k] - a[k]) * t).round() as u8);
    let [r, g, b] = if x < 0.5 { mix(low, middle, 2.0 * x) } else { mix(middle, high, 2.0 * x - 1.0) };
    [r, g, b, 255]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_differ_and_none_is_red() {
        let distance = |a: [u8; 3], b: [u8; 3]| (0..3).map(|k| a[k].abs_diff(b[k]) as u32).sum::<u32>();
        for id in 0..200 {
            assert!(distance(of_pair(id), of_pair(id + 1)) > 100, "{id}");
            let [r, g, b] = of_pair(id);
            assert!(r < 200 || g > 90 || b > 90, "{id}: {r} {g} {b}");
        }
    }

    #[test]
    fn confidence_runs_from_red_to_green() {
        assert_eq!(of_confidence(0.0), [200, 40, 40, 255]);
        assert_eq!(of_confidence(f32::NAN), of_confidence(-3.0));
        assert_eq!(of_confidence(1.0), [90, 180, 110, 255]);
    }
}
