//! The curve between light and the values that pictures of 8 and 16 bits store.

/// Light from an sRGB value (IEC 61966-2-1); values outside 0..1 follow the same curves, mirrored
/// at 0.
#[doc(hidden)]
pub fn srgb_to_linear(x: f32) -> f32 {
    let a = x.abs();
    (if a <= 0.04045 { a / 12.92 } else { ((a + 0.055) / 1.055).powf(2.4) }).copysign(x)
}

/// The sRGB value of light, the inverse of [`srgb_to_linear`].
#[doc(hidden)]
pub fn linear_to_srgb(x: f32) -> f32 {
    let a = x.abs();
    (if a <= 0.003_130_8 { a * 12.92 } else { 1.055 * a.powf(1.0 / 2.4) - 0.055 }).copysign(x)
}
