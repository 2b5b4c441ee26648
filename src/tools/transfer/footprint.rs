//! Where a texel of the target lies in the source's texture, and how its square is stretched there.

use bytemuck::{Pod, Zeroable};

use super::atlas::AtlasTexel;
use super::tables::{SourceTriangle, TargetTriangle};
use crate::geometry::NONE;
use crate::surface::{PackedImage, Status};

/// A neighbour whose image is farther away than this many times what ratios of areas let expect is across a jump of the map.
pub const JUMP: f32 = 8.0;
/// Two one-sided differences whose lengths differ by more than this factor are not averaged; the shorter is taken.
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

/// A texel's target point and source image.
#[derive(Clone, Copy, Debug)]
pub struct MappedTexel {
    /// What the texel shows of the target.
    pub texel: AtlasTexel,
    /// Where that is on the source.
    pub image: PackedImage,
}

/// Rounds off to nothing where the map is the identity.
fn at(triangle: &SourceTriangle, image: &PackedImage) -> ([f32; 3], [f32; 2]) {
    let (b0, b1) = (image.b0, image.b1);
    let b2 = 1.0 - b0 - b1;
    let p = &triangle.position;
    let q = &triangle.texcoord;
    (
        [0, 1, 2].map(|a| b0 * p[0][a] + b1 * p[1][a] + b2 * p[2][a]),
        [0, 1].map(|a| b0 * q[0][a] + b1 * q[1][a] + b2 * q[2][a]),
    )
}

/// The footprint of a texel from its image and those of its neighbours to the left, right, above and below.
///
/// Differences of positions in space are turned into texture coordinates by the gradient of the texel's own source triangle, so
/// that seams of the source's texture do not matter; where both images are of one chart and their texture coordinates differ by
/// no more than that suggests, that difference is taken itself, being exact. Neighbours count if their centres are
/// covered, by the same chart, with a usable image that is not across a jump. What is missing is filled in from the ratio of areas.
///
/// No colour where the image is nowhere, failed, or its triangle has no texture coordinates.
pub fn footprint(
    texel: &MappedTexel,
    neighbours: &[Option<MappedTexel>; 4],
    source: &[SourceTriangle],
    target: &[TargetTriangle],
) -> Footprint {
    let image = &texel.image;
    if texel.texel.face == NONE || image.face == NONE || image.status() == Status::Failed {
        return Footprint::NOWHERE;
    }
    let triangle = &source[image.face as usize];
    if triangle.chart == NONE {
        return Footprint::NOWHERE;
    }
    let expected = &target[texel.texel.face as usize];
    let (position, centre) = at(triangle, image);
    let difference = |neighbour: &Option<MappedTexel>, sign: f32, step: f32| -> Option<[f32; 2]> {
        let n = neighbour.as_ref()?;
        let usable = texel.texel.is_centre()
            && n.texel.is_centre()
            && n.image.face != NONE
            && n.image.status() != Status::Failed
            && target[n.texel.face as usize].chart == expected.chart;
        if !usable {
            return None;
        }
        let other = &source[n.image.face as usize];
        let (p, q) = at(other, &n.image);
        let d = [0, 1, 2].map(|a| sign * (p[a] - position[a]));
        if dot3(&d, &d) > (JUMP * step) * (JUMP * step) {
            return None;
        }
        let predicted = triangle.gradient.map(|g| dot3(&g, &d));
        let direct = [0, 1].map(|a| sign * (q[a] - centre[a]));
        let near = dot2(direct, direct) <= AGREE * AGREE * dot2(predicted, predicted);
        Some(if other.chart == triangle.chart && near { direct } else { predicted })
    };
    let axis = |before: &Option<MappedTexel>, after: &Option<MappedTexel>, step: f32| match (
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
    let area = expected.texel_area * triangle.density;
    let side = area.sqrt();
    let (dx, dy) = match (axis(left, right, expected.step[0]), axis(above, below, expected.step[1])) {
        (Some(x), Some(y)) => (x, y),
        (Some(x), None) => (x, across(x, area, side)),
        (None, Some(y)) => (across(y, area, side), y),
        (None, None) => ([side, 0.0], [0.0, side]),
    };
    Footprint { centre, dx, dy, face: image.face }
}

/// A vector at a right angle to `v` that spans `area` with it, within a factor of two of `side`.
fn across(v: [f32; 2], area: f32, side: f32) -> [f32; 2] {
    let length = dot2(v, v).sqrt();
    if length > 0.0 {
        let other = (area / length).clamp(0.5 * side, 2.0 * side) / length;
        [-v[1] * other, v[0] * other]
    } else {
        [side, 0.0]
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
