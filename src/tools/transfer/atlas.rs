//! `rasterize_atlas`: which point of the mesh each texel of its texture shows.
//!
//! Decisions are exact. Texture coordinates are snapped to 1/256 texel once, as every graphics device does, and from there on
//! only integers decide. An edge function at a texel centre is `E0 + 256 (A i + B j)` with the texel (i, j) of its bin, so its
//! sign is that of `floor(E0 / 256) + A i + B j`: the host stores the quotient, clamped to what cannot change the sign, and the
//! kernel needs 32-bit integers only.

use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;

use super::bins::Bins;
use crate::geometry::NONE;
use crate::surface::PackedPoint;

/// Texels along a side of a bin.
pub const BIN: u32 = 8;
/// Steps of the grid that texture coordinates are snapped to, per texel.
pub const SUBTEXEL: i32 = 256;

/// A triangle of the target in the texture, one record for each repeat that it shows in.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct AtlasTriangle {
    /// Triangle of the mesh.
    pub face: u32,
    /// 1 if corners 1 and 2 were exchanged to make the area positive.
    pub swapped: u32,
    /// Corners in sub-texels, x right and y down, with positive area.
    pub corners: [[i32; 2]; 3],
    /// Change of barycentric coordinates 0 and 1 (in the mesh's corner order) per texel along x and
    /// y.
    pub gradient: [[f32; 2]; 2],
}

/// A triangle in one bin: its edge functions and barycentric coordinates at the centre of the bin's
/// first texel.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct BinEntry {
    /// Index of the [`AtlasTriangle`].
    pub triangle: u32,
    /// Triangle of the mesh.
    pub face: u32,
    /// Edge functions opposite to corners 0, 1, 2 divided by 256, rounded down, clamped.
    pub quotient: [i32; 3],
    /// What the divisions leave, 8 bits each, corner 0 lowest.
    pub remainder: u32,
    /// Barycentric coordinates 0 and 1 in the mesh's corner order.
    pub barycentric: [f32; 2],
}

/// What a texel shows.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct AtlasTexel {
    /// Triangle of the target, or [`NONE`].
    pub face: u32,
    /// Barycentric coordinate of corner 0.
    pub b0: f32,
    /// Barycentric coordinate of corner 1.
    pub b1: f32,
    /// [`AtlasTexel::CENTRE`] or [`AtlasTexel::FOOTPRINT`] if covered, with
    /// [`AtlasTexel::OVERLAP`]; else 0.
    pub cover: u32,
}

impl AtlasTexel {
    /// Nothing is shown.
    pub const EMPTY: Self = Self { face: NONE, b0: 0.0, b1: 0.0, cover: 0 };
    /// The texel's centre lies in the triangle.
    pub const CENTRE: u32 = 1;
    /// Only a part of the texel's square does; the point is the closest to the centre.
    pub const FOOTPRINT: u32 = 2;
    /// More than one triangle holds the centre; the lowest one is taken.
    pub const OVERLAP: u32 = 4;

    /// Whether some point is shown.
    pub fn is_covered(&self) -> bool {
        self.face != NONE
    }

    /// Whether the centre lies in a triangle.
    pub fn is_centre(&self) -> bool {
        self.cover & Self::CENTRE != 0
    }

    /// The point of the target.
    pub fn point(&self) -> PackedPoint {
        PackedPoint { face: self.face, b0: self.b0, b1: self.b1 }
    }
}

/// A rectangle of texels of a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tile {
    /// Column of the first texel.
    pub x: u32,
    /// Row of the first texel.
    pub y: u32,
    /// Texels along a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Tile {
    /// Number of texels.
    pub fn texels(&self) -> usize {
        self.width as usize * self.height as usize
    }
}

/// Rasterises the texels of a tile, row after row.
///
/// A texel whose centre lies in one triangle or more shows the point of the lowest one; centres on
/// an edge shared by two triangles belong to exactly one of them (a centre on an edge counts as
/// moved to the left by an infinitesimal, and by a smaller one down). A texel whose centre lies in
/// none but whose open unit square touches triangles shows the point closest to its centre in the
/// closest of them, the lowest on ties.
///
/// Time O(texels x triangles per bin). Section 4.3 of Panozzo et al. 2013 takes texel centres only.
pub fn rasterize_atlas(tile: &Tile, bins: &Bins, triangles: &[AtlasTriangle], texels: &mut [AtlasTexel]) {
    let width = tile.width as usize;
    texels[..tile.texels()].par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
        let y = tile.y + y as u32;
        let bin_row = (y / BIN - bins.first[1]) * bins.columns;
        for (x, texel) in (tile.x..).zip(row) {
            let entries = bins.of(bin_row + x / BIN - bins.first[0]);
            *texel = rasterize_texel(entries, triangles, [x, y]);
        }
    });
}

/// The texel at a column and row of the texture, from the entries of its bin.
#[inline]
fn rasterize_texel(entries: &[BinEntry], triangles: &[AtlasTriangle], at: [u32; 2]) -> AtlasTexel {
    let [i, j] = at.map(|c| (c % BIN) as i32);
    let centre = at.map(|c| c as i32 * SUBTEXEL + SUBTEXEL / 2);
    let mut found = AtlasTexel::EMPTY;
    for entry in entries {
        let triangle = &triangles[entry.triangle as usize];
        if !holds_centre(entry, triangle, i, j) {
            continue;
        }
        if found.cover != 0 {
            found.cover |= AtlasTexel::OVERLAP;
            return found;
        }
        let g = &triangle.gradient;
        let (x, y) = (i as f32, j as f32);
        let b0 = entry.barycentric[0] + x * g[0][0] + y * g[0][1];
        let b1 = entry.barycentric[1] + x * g[1][0] + y * g[1][1];
        found = AtlasTexel { face: entry.face, b0, b1, cover: AtlasTexel::CENTRE };
        if !(b0 >= 0.0 && b1 >= 0.0 && b0 + b1 <= 1.0) {
            // Snapping moved an edge over the centre: at most 1/256 texel away.
            let (b, _) = closest_on_boundary(triangle, centre);
            (found.b0, found.b1) = (b[0], b[1]);
        }
    }
    if found.cover != 0 {
        return found;
    }
    let mut best = f32::MAX;
    for entry in entries {
        let triangle = &triangles[entry.triangle as usize];
        if !touches_square(entry, triangle, i, j, centre) {
            continue;
        }
        let (b, distance) = closest_on_boundary(triangle, centre);
        if distance < best {
            best = distance;
            found = AtlasTexel { face: entry.face, b0: b[0], b1: b[1], cover: AtlasTexel::FOOTPRINT };
        }
    }
    found
}

/// Coefficients of x and y of the edge function opposite to corner `k`, which is positive inside.
#[inline]
pub(super) fn edge(corners: &[[i32; 2]; 3], k: usize) -> [i32; 2] {
    let (a, b) = (corners[(k + 1) % 3], corners[(k + 2) % 3]);
    [a[1] - b[1], b[0] - a[0]]
}

/// Whether the triangle holds the centre of texel (i, j).
#[inline]
fn holds_centre(entry: &BinEntry, triangle: &AtlasTriangle, i: i32, j: i32) -> bool {
    (0..3).all(|k| {
        let [a, b] = edge(&triangle.corners, k);
        let included = a < 0 || (a == 0 && b > 0);
        let exact = (entry.remainder >> (8 * k)) & 255 == 0;
        let borrow = i32::from(exact && !included);
        entry.quotient[k] - borrow + a * i + b * j >= 0
    })
}

/// Whether the closed triangle meets the open square of texel (i, j): no axis separates them.
#[inline]
fn touches_square(entry: &BinEntry, triangle: &AtlasTriangle, i: i32, j: i32, centre: [i32; 2]) -> bool {
    let edges = (0..3).all(|k| {
        let [a, b] = edge(&triangle.corners, k);
        // E + 128 (|A| + |B|) > 0, divided by 256 and rounded down.
        let reach = a.abs() + b.abs();
        let rest = ((entry.remainder >> (8 * k)) & 255) as i32 + (reach & 1) * 128 - 1;
        entry.quotient[k] + (reach >> 1) + (rest >> 8) + a * i + b * j >= 0
    });
    edges && {
        let half = SUBTEXEL / 2;
        (0..2).all(|axis| {
            let v = triangle.corners.map(|p| p[axis]);
            v[0].min(v[1]).min(v[2]) < centre[axis] + half && v[0].max(v[1]).max(v[2]) > centre[axis] - half
        })
    }
}

/// Barycentric coordinates (in the mesh's corner order) of the point of the triangle's boundary
/// closest to `c`, and its squared distance.
#[inline]
fn closest_on_boundary(triangle: &AtlasTriangle, c: [i32; 2]) -> ([f32; 3], f32) {
    let mut best = ([0.0; 3], f32::MAX);
    for k in 0..3 {
        let (mut s, mut e) = ((k + 1) % 3, (k + 2) % 3);
        // The same edge gives the same distance in both of its triangles only if walked in one
        // direction.
        if triangle.corners[e] < triangle.corners[s] {
            (s, e) = (e, s);
        }
        let (from, to) = (triangle.corners[s], triangle.corners[e]);
        let p = [(from[0] - c[0]) as f32, (from[1] - c[1]) as f32];
        let d = [(to[0] - from[0]) as f32, (to[1] - from[1]) as f32];
        let along = -(p[0] * d[0] + p[1] * d[1]);
        let length = d[0] * d[0] + d[1] * d[1];
        let t = if along <= 0.0 {
            0.0
        } else if along >= length {
            1.0
        } else {
            along / length
        };
        let q = [p[0] + t * d[0], p[1] + t * d[1]];
        let distance = q[0] * q[0] + q[1] * q[1];
        if distance < best.1 {
            let mut b = [0.0; 3];
            b[s] = 1.0 - t;
            b[e] = t;
            best = (b, distance);
        }
    }
    if triangle.swapped != 0 {
        best.0.swap(1, 2);
    }
    best
}
