//! Samples as numbers to average: the sRGB transfer function and depths.

use std::sync::LazyLock;

pub use crate::picture::{linear_to_srgb, srgb_to_linear};

/// A depth of samples.
pub(crate) trait Sample: Copy + Default + Send + Sync + 'static {
    /// What a sample's number is multiplied by to become a value.
    const UNIT: f32;
    /// The number that is stored.
    fn number(self) -> f32;
    /// The value to average: in 0..1 for integers; light if `light`.
    fn decode(self, light: bool) -> f32;
    /// The nearest sample to a value.
    fn encode(value: f32, light: bool) -> Self;
}

static LIGHT_8: LazyLock<Vec<f32>> = LazyLock::new(|| light_table(255));
static LIGHT_16: LazyLock<Vec<f32>> = LazyLock::new(|| light_table(65535));

/// The light of all sRGB samples of `count` values (256 or 65,536); nothing for 0.
pub(super) fn light_values(count: usize) -> &'static [f32] {
    match count {
        0 => &[],
        256 => &LIGHT_8,
        _ => &LIGHT_16,
    }
}

fn light_table(most: u32) -> Vec<f32> {
    (0..=most).map(|i| srgb_to_linear(i as f32 / most as f32)).collect()
}

impl Sample for u8 {
    const UNIT: f32 = 1.0 / 255.0;

    #[inline]
    fn number(self) -> f32 {
        f32::from(self)
    }

    #[inline]
    fn decode(self, light: bool) -> f32 {
        if light { LIGHT_8[self as usize] } else { self.number() * Self::UNIT }
    }

    #[inline]
    fn encode(value: f32, light: bool) -> Self {
        let value = if light { linear_to_srgb(value) } else { value };
        // A cast saturates and takes NaN to 0.
        (value * 255.0 + 0.5) as Self
    }
}

impl Sample for u16 {
    const UNIT: f32 = 1.0 / 65535.0;

    #[inline]
    fn number(self) -> f32 {
        f32::from(self)
    }

    #[inline]
    fn decode(self, light: bool) -> f32 {
        if light { LIGHT_16[self as usize] } else { self.number() * Self::UNIT }
    }

    #[inline]
    fn encode(value: f32, light: bool) -> Self {
        let value = if light { linear_to_srgb(value) } else { value };
        (value * 65535.0 + 0.5) as Self
    }
}

/// Floats hold light already.
impl Sample for f32 {
    const UNIT: f32 = 1.0;

    #[inline]
    fn number(self) -> f32 {
        self
    }

    #[inline]
    fn decode(self, _light: bool) -> f32 {
        self
    }

    #[inline]
    fn encode(value: f32, _light: bool) -> Self {
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn round_trips<T: Sample + PartialEq>(values: impl Iterator<Item = T>) -> bool {
        values.into_iter().all(|x| [false, true].into_iter().all(|light| T::encode(x.decode(light), light) == x))
    }

    #[test]
    fn every_sample_survives() {
        assert!(round_trips(0..=u8::MAX));
        assert!(round_trips(0..=u16::MAX));
        assert!(round_trips([-1.0_f32, 0.0, 0.25, 7.5].into_iter()));
    }

    #[test]
    fn rounds_to_nearest_and_saturates() {
        assert_eq!(u8::encode(0.4999 / 255.0, false), 0);
        assert_eq!(u8::encode(0.5001 / 255.0, false), 1);
        assert_eq!(u8::encode(-3.0, false), 0);
        assert_eq!(u16::encode(3.0, false), u16::MAX);
        assert_eq!(u8::encode(f32::NAN, true), 0);
    }

    #[test]
    fn srgb_reference_values() {
        // Middle grey 0.5 is 0.2140411 of the light (IEC 61966-2-1).
        assert!((srgb_to_linear(0.5) - 0.214_041_14).abs() < 1e-6);
        assert!((linear_to_srgb(0.214_041_14) - 0.5).abs() < 1e-6);
        assert_eq!(srgb_to_linear(1.0), 1.0);
    }
}
