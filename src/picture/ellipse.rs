//! Elliptical weighted averages: the ellipse that a pixel of the result sees of a picture.
//!
//! Paul Heckbert, "Fundamentals of Texture Mapping and Image Warping", 1989, sections 3.5 and 4: a
//! round kernel about the output pixel is, by the derivative of the map, an elliptical one on the
//! picture, and the colour is the weighted mean over it. Deviations: the kernel is (1 - q)^3, which
//! is 0 beyond a finite radius and needs no exponential; an ellipse narrower than a pixel is
//! widened to one (the picture's own samples are no finer); and large ellipses are gathered from
//! halved pictures, whose own averaging is subtracted from the ellipse, so that the result does not
//! jump where the level changes.

/// Second moment of the kernel along an axis, in output pixels squared. The kernel's radius is
/// `sqrt(10 x)`: 1.5 pixels.
pub const VARIANCE: f32 = 0.225;
/// Second moment of (1 - q)^3 over the unit disc, along an axis, inverted.
pub(crate) const MOMENT: f32 = 10.0;
/// Smallest width of the narrow side, in texels of the level that is read: wide enough that the
/// steps between texels do not show, narrow enough that at most 20 of them are read across.
pub(crate) const FINEST: f32 = 1.5;
/// Ellipses are at most this much longer than wide.
pub const LONGEST: f32 = 16.0;
/// Up to this width the picture is interpolated: rounding must not blur what is only moved.
pub(crate) const INTERPOLATED: f32 = 1.0 + 1.0 / 64.0;
/// From this width on it is averaged; in between, both are mixed so that the seam does not show.
pub(crate) const AVERAGED: f32 = 1.5;

/// The ellipse of one output pixel on a level of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipse {
    /// Level of the pyramid.
    pub level: u32,
    /// Share of the average in the result; the rest is interpolated.
    pub share: f32,
    /// `q(d) = a dx^2 + b dx dy + c dy^2`, 1 on the border, in texels of the level.
    pub form: [f32; 3],
    /// Half its extent along x and y.
    pub reach: [f32; 2],
}

impl Ellipse {
    /// The ellipse of the derivative whose columns `dx` and `dy` are the pixels that the pre-image
    /// moves by when the output pixel moves right and down; `levels` is the number of levels there
    /// are.
    #[inline]
    pub fn new(dx: [f32; 2], dy: [f32; 2], levels: u32) -> Self {
        // Wider than the picture at its coarsest is as good as this; the squares stay finite.
        let most = (1u64 << levels.min(32)) as f32;
        let limit = |v: f32| v.clamp(-most, most);
        let (dx, dy) = (dx.map(limit), dy.map(limit));
        // Eigenvalues of M M^T are the squares of the widths.
        let (a, b, c) = (dx[0] * dx[0] + dy[0] * dy[0], dx[0] * dx[1] + dy[0] * dy[1], dx[1] * dx[1] + dy[1] * dy[1]);
        let (mean, half) = (0.5 * (a + c), 0.5 * (a - c));
        let root = (half * half + b * b).sqrt();
        let wide = (mean + root).sqrt();
        let narrow = if wide > 0.0 { (dx[0] * dy[1] - dx[1] * dy[0]).abs() / wide } else { 0.0 };
        let share = ((wide - INTERPOLATED) / (AVERAGED - INTERPOLATED)).clamp(0.0, 1.0);
        let share = share * share * (3.0 - 2.0 * share);
        let wide = wide.max(1.0);
        let narrow = narrow.max(1.0).max(wide * (1.0 / LONGEST));
        // Halvings until the narrow side is between one and two of the finest.
        let mut level = 0;
        let mut scale = 1.0;
        while narrow * scale >= 2.0 * FINEST && level + 1 < levels {
            level += 1;
            scale *= 0.5;
        }
        // What the boxes of the level have averaged already, beyond the picture's own pixels.
        let boxed = (1.0 - scale * scale) * (1.0 / 12.0);
        let radius = |width: f32| MOMENT * (VARIANCE * (width * scale) * (width * scale) - boxed).max(VARIANCE);
        let (long, short) = (radius(wide), radius(narrow));
        // The direction of the wide side, from whichever of the two forms of the eigenvector does
        // not cancel.
        let axis = if half >= 0.0 { [half + root, b] } else { [b, root - half] };
        let length = (axis[0] * axis[0] + axis[1] * axis[1]).sqrt();
        let [u, v] = if length > 0.0 { [axis[0] / length, axis[1] / length] } else { [1.0, 0.0] };
        let (along, across) = (1.0 / long, 1.0 / short);
        let form = [along * u * u + across * v * v, 2.0 * (along - across) * u * v, along * v * v + across * u * u];
        let reach = [(long * u * u + short * v * v).sqrt(), (long * v * v + short * u * u).sqrt()];
        Self { level, share, form, reach }
    }
}
