//! Decals on textures that materials move, repeat, mirror or clamp.
//!
//! Where a decal leaves the unit square, the texture is drawn unfolded: every repeat beside the
//! others, in the orientation that its faces see, and folded together again. So a face may lie
//! across the border of two repeats, and faces of one repeat do not hide the decal on another's.
//! What a clamped picture shows beyond its borders are its border texels, in which nothing can be
//! drawn.

use glam::DVec2;

use super::Decal;
use super::paint::{PaintOptions, Painted, paint};
use crate::engine::Engine;
use crate::error::{Error, Result};
use crate::geometry::Mesh;
use crate::geometry::material::{Placement, Wrap};
use crate::picture::Image;
use crate::progress::Progress;

/// Longest side of an unfolded texture.
const LARGEST: u32 = 16384;

/// As [`paint`], where the texture lies on the surface as the `placements` of the mesh's materials
/// say: a texel gets what of the decal it shows. Those without one lie on the texture coordinates
/// as they are.
///
/// # Errors
/// Those of [`paint`]; [`Error::Input`] where mirrored repeats side by side are more than 16384
/// texels wide or high.
pub fn paint_placed(
    engine: &Engine,
    mesh: &Mesh,
    placements: &[Placement],
    decal: &Decal,
    picture: &Image,
    options: &PaintOptions,
    progress: &dyn Progress,
) -> Result<Painted> {
    let of = |t: usize| placements.get(mesh.triangle_material(t) as usize).copied().unwrap_or_default();
    let wanted = |t: &u32| options.material.is_none_or(|m| mesh.triangle_material(*t as usize) == m);
    let mut wraps: Vec<[Wrap; 2]> = Vec::new();
    for wrap in decal.patch.iter().filter(|t| wanted(t)).map(|&t| of(t as usize).wrap) {
        if !wraps.contains(&wrap) {
            wraps.push(wrap);
        }
    }
    let mut placed = mesh.clone();
    let place = |p: usize| placements.get(mesh.polygon_material(p) as usize).copied().unwrap_or_default();
    placed.map_texcoords(|p, uv| place(p).apply(uv));
    let inside = |uv: DVec2| uv == uv.clamp(DVec2::ZERO, DVec2::ONE);
    let shown = decal.patch.iter().filter(|t| wanted(t)).filter_map(|&t| placed.triangle_texcoords(t as usize));
    let all_inside = shown.flatten().all(inside);
    if wraps.iter().all(|w| *w == [Wrap::Repeat; 2]) {
        let cells = Cells::of(&placed, decal.patch.iter().map(|&t| t as usize).filter(|t| wanted(&(*t as u32))));
        // A pattern of many repeats has the decal in all of them anyway.
        if all_inside || cells.size(options).is_err() {
            return paint(engine, &placed, decal, picture, options, progress);
        }
    }
    let mut result: Option<Painted> = None;
    for wrap in wraps {
        let shows = |t: usize| of(t).wrap == wrap && wanted(&(t as u32));
        let cells = Cells::of(&placed, decal.patch.iter().map(|&t| t as usize).filter(|&t| shows(t)));
        let (width, height) = cells.size(options)?;
        let unfolded = cells.unfolded(&placed, |p| place(p).wrap == wrap);
        let options = PaintOptions { width, height, ..*options };
        let painted = paint(engine, &unfolded, decal, picture, &options, progress)?;
        let folded = cells.folded(painted, wrap)?;
        result = Some(match result {
            None => folded,
            Some(mut all) => {
                all.stats.overlapping += lay(&mut all.image, &folded.image);
                all.texels += folded.texels;
                all
            }
        });
    }
    result.ok_or_else(|| Error::numeric("the decal shows no faces", "Report this with the files"))
}

/// The repeats that faces reach into, along u and along v.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cells {
    first: [f64; 2],
    count: [u32; 2],
}

impl Cells {
    fn of(mesh: &Mesh, triangles: impl Iterator<Item = usize>) -> Self {
        let (mut low, mut high) = (DVec2::ZERO, DVec2::ONE);
        for uv in triangles.filter_map(|t| mesh.triangle_texcoords(t)).flatten().filter(|uv| uv.is_finite()) {
            (low, high) = (low.min(uv.floor()), high.max(uv.ceil()));
        }
        let count = (high - low).min(DVec2::splat(f64::from(u32::MAX)));
        Self { first: low.to_array(), count: count.to_array().map(|n| n as u32) }
    }

    /// Sides of the unfolded texture.
    fn size(&self, options: &PaintOptions) -> Result<(u32, u32)> {
        let side = |n: u32, count: u32| n.checked_mul(count).filter(|s| *s <= LARGEST.max(n));
        match (side(options.width, self.count[0]), side(options.height, self.count[1])) {
            (Some(width), Some(height)) => Ok((width, height)),
            _ => Err(Error::input(
                format!(
                    "the decal reaches over {} x {} repeats of a texture of {} x {} texels, some of them mirrored or clamped",
                    self.count[0], self.count[1], options.width, options.height
                ),
                "Draw on a smaller texture, or unwrap the mesh first",
            )),
        }
    }

    /// The mesh with its texture coordinates in the unfolded texture; faces that are not wanted, or
    /// reach beyond it, have none of it.
    fn unfolded(&self, mesh: &Mesh, wanted: impl Fn(usize) -> bool) -> Mesh {
        let first = DVec2::from(self.first);
        let count = DVec2::from(self.count.map(f64::from));
        let within = |p: usize| {
            let mut corners = mesh.polygon(p).iter().filter_map(|c| mesh.texcoords.get(c.texcoord as usize));
            let inside = |x: DVec2| x == x.clamp(DVec2::ZERO, count);
            wanted(p) && corners.all(|uv| inside(*uv - first))
        };
        let kept: Vec<bool> = (0..mesh.polygon_count()).map(within).collect();
        let mut unfolded = mesh.clone();
        // A face whose corners lie in one point covers nothing.
        unfolded.map_texcoords(|p, uv| if kept[p] { (uv - first) / count } else { DVec2::ZERO });
        unfolded
    }

    /// The repeats laid on one another.
    fn folded(&self, painted: Painted, wrap: [Wrap; 2]) -> Result<Painted> {
        let wide = painted.image;
        let (width, height) = (wide.width / self.count[0], wide.height / self.count[1]);
        let mut image = Image::zeros(width, height, wide.channels, wide.depth())?;
        let (mut stats, mut texels) = (painted.stats, painted.texels);
        for row in 0..self.count[1] {
            for column in 0..self.count[0] {
                // Rows run down, v runs up.
                let cell = [self.first[0] + f64::from(column), self.first[1] + f64::from(self.count[1] - 1 - row)];
                if (0..2).any(|axis| wrap[axis] == Wrap::Clamp && cell[axis] != 0.0) {
                    continue;
                }
                let mirrored = [0, 1].map(|axis| wrap[axis] == Wrap::Mirror && cell[axis].rem_euclid(2.0) == 1.0);
                let mut repeat = Image::zeros(width, height, wide.channels, wide.depth())?;
                for y in 0..height {
                    for x in 0..width {
                        let to =
                            [if mirrored[0] { width - 1 - x } else { x }, if mirrored[1] { height - 1 - y } else { y }];
                        for c in 0..wide.channels {
                            repeat.set(to[0], to[1], c, wide.get(column * width + x, row * height + y, c));
                        }
                    }
                }
                stats.overlapping += lay(&mut image, &repeat);
            }
        }
        if wrap.contains(&Wrap::Clamp) {
            // What lies beyond the border was not kept.
            let (n, channels) = (image.pixels.len(), image.channels as usize);
            texels = (channels - 1..n).step_by(channels).filter(|&k| image.sample(k) > 0.0).count() as u64;
        }
        Ok(Painted { image, texels, stats })
    }
}

/// Lays a picture over another, texel by texel the one that hides more; how many texels both have.
fn lay(under: &mut Image, over: &Image) -> u64 {
    let (mut both, alpha) = (0, under.channels - 1);
    for y in 0..under.height {
        for x in 0..under.width {
            let (a, b) = (under.get(x, y, alpha), over.get(x, y, alpha));
            both += u64::from(a > 0.0 && b > 0.0);
            if b > a {
                (0..under.channels).for_each(|c| under.set(x, y, c, over.get(x, y, c)));
            }
        }
    }
    both
}
