//! Seams of a texture: texels that lie side by side on the surface and apart in the picture.

use std::collections::HashMap;

use glam::DVec2;
use rayon::prelude::*;

use super::UvRegion;
use super::atlas::{AtlasTexel, Tile, rasterize_atlas};
use super::bins::{Atlas, Bins};
use super::charts::charts;
use crate::error::{Error, Result};
use crate::geometry::{Mesh, NONE};
use crate::picture::Image;

/// Places along one edge at most, in multiples of the picture's half circumference.
const MOST_ALONG: f64 = 4.0;

/// Two texels on either side of a seam, as row times width plus column, with the charts they lie
/// in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct SeamPair {
    /// The texels, the lower one first.
    pub texels: [u32; 2],
    /// The charts of their triangles.
    pub charts: [u32; 2],
}

/// The pairs of texels along all seams: edges whose two triangles have different texture
/// coordinates there. They stand half a texel inside the charts, a texel apart along the longer
/// side. `chart` is that of each triangle ([`charts`]); triangles of other squares or materials
/// than `region` and `material` name are left out.
///
/// Sorted, without repeats. O(triangles + length of the seams in texels).
pub fn seam_pairs(
    mesh: &Mesh,
    chart: &[u32],
    size: [u32; 2],
    region: UvRegion,
    material: Option<u32>,
) -> Vec<SeamPair> {
    let mut edges: HashMap<[u64; 6], Vec<(u32, u8, bool)>> = HashMap::new();
    for t in 0..mesh.triangle_count() {
        if chart[t] == NONE || material.is_some_and(|m| mesh.triangle_material(t) != m) {
            continue;
        }
        // Adding zero makes -0 and 0 the same bits.
        let p = mesh.triangle_positions(t).map(|p| [p.x, p.y, p.z].map(|c| (c + 0.0).to_bits()));
        for k in 0..3 {
            let (a, b) = (p[(k + 1) % 3], p[(k + 2) % 3]);
            let (low, high) = if a <= b { (a, b) } else { (b, a) };
            let key = [low[0], low[1], low[2], high[0], high[1], high[2]];
            edges.entry(key).or_default().push((t as u32, k as u8, a <= b));
        }
    }
    let mut pairs = Vec::new();
    for sides in edges.values() {
        // Where more than two triangles meet, each borders on the first.
        // Which way an edge is walked is the first one's, wherever the mesh lies.
        let (first, way) = ((sides[0].0, sides[0].1, true), sides[0].2);
        for &(t, k, forward) in sides.iter().skip(1) {
            along(mesh, chart, size, region, [first, (t, k, forward == way)], &mut pairs);
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

/// One side of an edge in texels: its ends, and the way half a texel into the triangle.
fn side(mesh: &Mesh, size: [u32; 2], (t, k, forward): (u32, u8, bool)) -> Option<([DVec2; 2], DVec2)> {
    let size = DVec2::new(f64::from(size[0]), f64::from(size[1]));
    let uv = mesh.triangle_texcoords(t as usize)?.map(|p| DVec2::new(p.x, 1.0 - p.y) * size);
    let k = k as usize;
    let (mut a, mut b) = (uv[(k + 1) % 3], uv[(k + 2) % 3]);
    if !forward {
        std::mem::swap(&mut a, &mut b);
    }
    let e = (b - a).try_normalize()?;
    let height = (uv[k] - a) - e * e.dot(uv[k] - a);
    let inward = height.try_normalize()? * height.length().min(1.0) * 0.5;
    Some(([a, b], inward))
}

fn along(
    mesh: &Mesh,
    chart: &[u32],
    size: [u32; 2],
    region: UvRegion,
    sides: [(u32, u8, bool); 2],
    pairs: &mut Vec<SeamPair>,
) {
    let (Some(one), Some(two)) = (side(mesh, size, sides[0]), side(mesh, size, sides[1])) else { return };
    if one.0 == two.0 {
        return;
    }
    let length = one.0[0].distance(one.0[1]).max(two.0[0].distance(two.0[1]));
    let n = length.ceil().clamp(1.0, MOST_ALONG * f64::from(size[0] + size[1]));
    for i in 0..n as u32 {
        let s = (f64::from(i) + 0.5) / n;
        let at = |(ends, inward): &([DVec2; 2], DVec2)| texel(ends[0].lerp(ends[1], s) + *inward, size, region);
        if let (Some(a), Some(b)) = (at(&one), at(&two)) {
            let (a, b) = ((a, chart[sides[0].0 as usize]), (b, chart[sides[1].0 as usize]));
            let (a, b) = if a <= b { (a, b) } else { (b, a) };
            if a.0 != b.0 {
                pairs.push(SeamPair { texels: [a.0, b.0], charts: [a.1, b.1] });
            }
        }
    }
}

/// The texel that holds a point given in texels, if the picture shows it.
fn texel(p: DVec2, size: [u32; 2], region: UvRegion) -> Option<u32> {
    let p = match region {
        UvRegion::Repeat => p,
        UvRegion::Square([i, j]) => {
            p - DVec2::new(f64::from(i) * f64::from(size[0]), -f64::from(j) * f64::from(size[1]))
        }
    };
    let cell = [p.x.floor() as i64, p.y.floor() as i64];
    let mut at = [0; 2];
    for a in 0..2 {
        let n = i64::from(size[a]);
        at[a] = match region {
            UvRegion::Repeat => cell[a].rem_euclid(n),
            UvRegion::Square(_) => Some(cell[a]).filter(|c| (0..n).contains(c))?,
        };
    }
    Some((at[1] * i64::from(size[0]) + at[0]) as u32)
}

/// The largest differences of neighbouring texels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SeamSteps {
    /// Of texels on either side of a seam, over all channels.
    pub across: f32,
    /// Of texels side by side in one chart.
    pub inside: f32,
    /// Pairs of texels on seams that were compared.
    pub pairs: u64,
}

/// Measures whether the seams of a texture show: a picture without visible seams has steps across
/// them like those inside its charts. Only texels that `coverage` calls coloured (from 128 on) and
/// whose centres lie in their chart count.
///
/// O(texels + triangles).
///
/// # Errors
/// If the pictures differ in size, or a texture coordinate is not finite.
pub fn seam_steps(mesh: &Mesh, image: &Image, coverage: &Image, region: UvRegion) -> Result<SeamSteps> {
    if [image.width, image.height] != [coverage.width, coverage.height] {
        return Err(Error::input("the picture and its coverage differ in size", "Take both from one transfer"));
    }
    let size = [image.width, image.height];
    let (width, height) = (size[0] as usize, size[1] as usize);
    let chart = charts(mesh);
    let atlas = Atlas::new(mesh, size[0], size[1], region, None, usize::MAX)?;
    let mut of = vec![NONE; width * height];
    const ROWS: usize = 256;
    let mut texels = Vec::new();
    for (band, of) in of.chunks_mut(ROWS * width).enumerate() {
        let tile = Tile { x: 0, y: (band * ROWS) as u32, width: size[0], height: (of.len() / width) as u32 };
        texels.resize(tile.texels(), AtlasTexel::EMPTY);
        rasterize_atlas(&tile, &Bins::new(&tile, &atlas, usize::MAX)?, &atlas.triangles, &mut texels);
        for (i, (of, texel)) in of.iter_mut().zip(&texels).enumerate() {
            let shown = coverage.sample((band * ROWS * width + i) * coverage.channels as usize) >= 128.0 / 255.0;
            *of = if texel.is_centre() && shown { chart[texel.face as usize] } else { NONE };
        }
    }
    let step = |a: usize, b: usize| {
        let n = image.channels as usize;
        (0..n).map(|c| (image.sample(a * n + c) - image.sample(b * n + c)).abs()).fold(0.0, f32::max)
    };
    let inside = (0..height).into_par_iter().map(|y| {
        let mut most = 0.0_f32;
        for x in 0..width {
            let i = y * width + x;
            if x + 1 < width && of[i] != NONE && of[i] == of[i + 1] {
                most = most.max(step(i, i + 1));
            }
            if y + 1 < height && of[i] != NONE && of[i] == of[i + width] {
                most = most.max(step(i, i + width));
            }
        }
        most
    });
    let mut steps = SeamSteps { inside: inside.reduce(|| 0.0, f32::max), ..SeamSteps::default() };
    for pair in seam_pairs(mesh, &chart, size, region, None) {
        let [a, b] = pair.texels.map(|t| t as usize);
        if [of[a], of[b]] == pair.charts {
            steps.pairs += 1;
            steps.across = steps.across.max(step(a, b));
        }
    }
    Ok(steps)
}
