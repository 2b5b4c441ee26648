//! Where a texel of the target lies in the source's texture, and how its square is stretched there.

use bytemuck::{Pod, Zeroable};

use super::atlas::AtlasTexel;
use super::tables::{SourceTriangle, TargetTriangle};
use crate::geometry::NONE;
use crate::surface::{PackedImage, Status};

/// A neighbour whose image is farther away than this many times what ratios of areas let expect is
/// across a jump of the map.
pub const JUMP: f32 = 8.0;
/// Two one-sided differences whose lengths differ by more than this factor are not averaged; the
/// shorter is taken.
pub const AGREE: f32 = 4.0;

/// A texel seen in the source's texture; units are those of [`SourceTriangle::texcoord`].
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Footprint {
    /// Image of the texel's point.
    pub centre: [f32; 2],
    /// Change along the texel's width.
    pub dx: [f32; 2],
    /// Change along the texel's height.
    pub dy: [f32; 2],
    /// Triangle of the source, or [`NONE`] if there is no colour.
    pub face: u32,
}

impl Footprint {
    /// No colour.
    pub const NOWHERE: Self = Self { centre: [0.0; 2], dx: [0.0; 2], dy: [0.0; 2], face: NONE };
}

/// Where a texel's point lies on the source.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Located {
    /// Position, in the units of [`SourceTriangle::position`].
    pub position: [f32; 3],
    /// Texture coordinates, in the units of [`SourceTriangle::texcoord`].
    pub texcoord: [f32; 2],
    /// Triangle of the source, or [`NONE`] if there is no colour.
    pub face: u32,
    /// Chart of the source.
    pub chart: u32,
    /// Chart of the target if the texel's centre is covered, else [`NONE`]: only such texels have
    /// meaningful differences.
    pub target_chart: u32,
}

impl Located {
    /// No colour.
    pub const NOWHERE: Self =
        Self { position: [0.0; 3], texcoord: [0.0; 2], face: NONE, chart: NONE, target_chart: NONE };
}

/// Looks up where a texel's point lies on the source: nowhere if its image is nowhere, failed, or
/// without texture coordinates.
#[inline]
pub fn locate(
    texel: &AtlasTexel,
    image: &PackedImage,
    source: &[SourceTriangle],
    target: &[TargetTriangle],
) -> Located {
    if texel.face == NONE || image.face == NONE || image.status() == Status::Failed {
        return Located::NOWHERE;
    }
    let triangle = &source[image.face as usize];
    if triangle.chart == NONE {
        return Located::NOWHERE;
    }
    let (b0, b1) = (image.b0, image.b1);
    let b2 = 1.0 - b0 - b1;
    let (p, q) = (&triangle.position, &triangle.texcoord);
    Located {
        position: [0, 1, 2].map(|a| b0 * p[0][a] + b1 * p[1][a] + b2 * p[2][a]),
        texcoord: [0, 1].map(|a| b0 * q[0][a] + b1 * q[1][a] + b2 * q[2][a]),
        face: image.face,
        chart: triangle.chart,
        target_chart: if texel.is_centre() { target[texel.face as usize].chart } else { NONE },
    }
}

/// The footprint of a texel from where it and its neighbours to the left, right, above and below
/// lie ([`Located::NOWHERE`] beyond the texture's border).
///
/// Differences of positions in space are turned into texture coordinates by the gradient of the
/// texel's own source triangle, so that seams of the source's texture do not matter; where both
/// images are of one chart and their texture coordinates differ by no more than that suggests, that
/// difference is taken itself, being exact. Neighbours count if their centres are covered, by the
/// same chart, with a usable image that is not across a jump. What is missing is filled in from the
/// ratio of areas.
#[inline]
pub fn footprint(
    located: &Located,
    neighbours: [&Located; 4],
    triangle: &SourceTriangle,
    expected: &TargetTriangle,
) -> Footprint {
    let difference = |n: &Located, sign: f32, step: f32| -> Option<[f32; 2]> {
        if located.target_chart == NONE || n.target_chart != located.target_chart {
            return None;
        }
        let d = [0, 1, 2].map(|a| sign * (n.position[a] - located.position[a]));
        if dot3(&d, &d) > (JUMP * step) * (JUMP * step) {
            return None;
        }
        let predicted = [dot3(&triangle.gradient[0], &d), dot3(&triangle.gradient[1], &d)];
        let direct = [0, 1].map(|a| sign * (n.texcoord[a] - located.texcoord[a]));
        let near = dot2(direct, direct) <= AGREE * AGREE * dot2(predicted, predicted);
        Some(if n.chart == located.chart && near { direct } else { predicted })
    };
    let axis = |before: &Located, after: &Located, step: f32| match (
        difference(before, -1.0, step),
        difference(after, 1.0, step),
    ) {
        (Some(a), Some(b)) => {
            let (la, lb) = (dot2(a, a), dot2(b, b));
            if la > AGREE * AGREE * lb {
                Some(b)
            } else if lb > AGREE * AGREE * la {
                Some(a)
            } else {
                Some([0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])])
            }
        }
        (a, b) => a.or(b),
    };
    let [left, right, above, below] = neighbours;
    let (area, stretch) = (expected.texel_area * triangle.density, triangle.stretch);
    let (dx, dy) = match (axis(left, right, expected.step[0]), axis(above, below, expected.step[1])) {
        (Some(x), Some(y)) => (x, y),
        (Some(x), None) => (x, across(x, area, stretch)),
        (None, Some(y)) => (across(y, area, stretch), y),
        (None, None) => {
            let side = area.sqrt();
            ([side / stretch, 0.0], [0.0, side * stretch])
        }
    };
    Footprint { centre: located.texcoord, dx, dy, face: located.face }
}

/// A vector at a right angle to `v`, in texels, that spans `area` with it, within a factor of two
/// of the side of a square of that area.
fn across(v: [f32; 2], area: f32, stretch: f32) -> [f32; 2] {
    let side = area.sqrt();
    let w = [v[0] * stretch, v[1] / stretch];
    let length = dot2(w, w).sqrt();
    if length > 0.0 {
        let other = (area / length).clamp(0.5 * side, 2.0 * side) / length;
        [-w[1] * other / stretch, w[0] * other * stretch]
    } else {
        [side / stretch, 0.0]
    }
}

#[inline]
fn dot2(a: [f32; 2], b: [f32; 2]) -> f32 {
    a[0] * b[0] + a[1] * b[1]
}

#[inline]
fn dot3(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
