//! What texel kernels look up by triangle: the source's geometry and texture coordinates, the
//! target's texel sizes.

use std::collections::HashMap;

use bytemuck::{Pod, Zeroable};
use glam::{DVec2, DVec3};

use super::charts::charts;
use super::tiles::UvTile;
use crate::error::{Error, Result};
use crate::geometry::{Frame, Mesh, NONE, Wrap};

/// A triangle of the source. Positions are centred and scaled; texture coordinates are (u, 1 - v),
/// shifted by whole repeats (by the same for a whole chart), so that rows count down.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct SourceTriangle {
    /// Corners in space.
    pub position: [[f32; 3]; 3],
    /// Corners in the texture.
    pub texcoord: [[f32; 2]; 3],
    /// Gradients of the two texture coordinates over the triangle's plane; 0 if it has no area.
    pub gradient: [[f32; 3]; 2],
    /// Texture area (in units of the whole texture) over area in space; 0 if it has none.
    pub density: f32,
    /// Chart, or [`NONE`] without texture coordinates.
    pub chart: u32,
    /// Square root of width over height of its picture: times u, and over it v, are distances in
    /// texels up to a common factor.
    pub stretch: f32,
}

/// A triangle of the target.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct TargetTriangle {
    /// Chart, or [`NONE`] without texture coordinates.
    pub chart: u32,
    /// Area of a texel on the source, if the map kept ratios of areas, in the units of
    /// [`SourceTriangle::position`].
    pub texel_area: f32,
    /// Length of a step of one texel along x and y on the source, if the map kept ratios of
    /// lengths, in the same units.
    pub step: [f32; 2],
}

/// Beyond this, products leave the range of single precision; triangles that thin count as without
/// area.
const LARGEST: f32 = 1e18;

/// The used vertex nearest to the centre of their box ([`crate::geometry::frame`]) and the factor
/// that makes its longest side 1.
fn frame(mesh: &Mesh) -> (DVec3, f64) {
    let centre = Frame::of_mesh(mesh).origin;
    match mesh.bounds() {
        Some((low, high)) if (high - low).max_element() > 0.0 => (centre, 1.0 / (high - low).max_element()),
        _ => (centre, 1.0),
    }
}

fn check_positions(mesh: &Mesh) -> Result<()> {
    for t in 0..mesh.triangle_count() {
        if !mesh.triangle_positions(t).iter().all(|p| p.is_finite()) {
            return Err(Error::mesh(
                &mesh.name,
                format!("triangle {t} has a corner that is not finite"),
                "Give finite vertex positions",
            ));
        }
    }
    Ok(())
}

/// What a triangle of the source shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shown {
    /// Width and height of its picture.
    pub size: [u32; 2],
    /// What the picture shows beyond its borders.
    pub wrap: [Wrap; 2],
    /// Whether the picture has one colour, so that no texture coordinates are needed.
    pub plain: bool,
}

/// The table of the source; `shown` tells what each triangle shows. With `tiled`, charts end at the
/// borders of unit squares and are shifted by the corners of theirs ([`UvTile`]), so that a
/// picture's own coordinates lie in 0..1.
///
/// # Errors
/// If a position, or a texture coordinate of a textured triangle, is not finite, or a texture
/// coordinate is beyond 1e6.
pub fn source_triangles(mesh: &Mesh, tiled: bool, shown: impl Fn(usize) -> Shown) -> Result<Vec<SourceTriangle>> {
    check_positions(mesh)?;
    let (centre, scale) = frame(mesh);
    let mut chart = charts(mesh);
    if tiled {
        cut_at_tiles(mesh, &mut chart);
    }
    let mut period = vec![[1.0_f64; 2]; chart.iter().filter(|&&c| c != NONE).max().map_or(0, |&c| c as usize + 1)];
    for (t, &c) in chart.iter().enumerate().filter(|(_, c)| **c != NONE) {
        for (period, wrap) in period[c as usize].iter_mut().zip(shown(t).wrap) {
            *period = match wrap {
                Wrap::Repeat => *period,
                Wrap::Mirror => period.max(2.0),
                // Nothing comes again.
                Wrap::Clamp => f64::INFINITY,
            };
        }
    }
    let mut low = vec![DVec2::INFINITY; chart.iter().filter(|&&c| c != NONE).max().map_or(0, |&c| c as usize + 1)];
    let texcoords = |t: usize| mesh.triangle_texcoords(t).map(|uv| uv.map(|p| DVec2::new(p.x, 1.0 - p.y)));
    for (t, &c) in chart.iter().enumerate() {
        let Some(uv) = texcoords(t) else { continue };
        if !uv.iter().all(|p| p.x.abs() <= 1e6 && p.y.abs() <= 1e6) {
            return Err(Error::mesh(
                &mesh.name,
                format!("triangle {t} has the texture coordinates {:?}", mesh.triangle_texcoords(t)),
                "Give finite texture coordinates between -1e6 and 1e6",
            ));
        }
        low[c as usize] = uv.iter().fold(low[c as usize], |l, &p| l.min(p));
    }
    let plain_chart = low.len() as u32;
    let triangle = |t: usize| {
        let p = mesh.triangle_positions(t).map(|p| (p - centre) * scale);
        let single = |v: DVec3| [v.x as f32, v.y as f32, v.z as f32];
        let mut out = SourceTriangle {
            position: p.map(single),
            texcoord: [[0.0; 2]; 3],
            gradient: [[0.0; 3]; 2],
            density: 0.0,
            chart: chart[t],
            stretch: (f64::from(shown(t).size[0]) / f64::from(shown(t).size[1])).sqrt() as f32,
        };
        let Some(uv) = texcoords(t) else {
            if shown(t).plain {
                out.chart = plain_chart;
            }
            return out;
        };
        let shift = if tiled {
            let tile = UvTile::of(&uv.map(|p| DVec2::new(p.x, 1.0 - p.y)));
            DVec2::new(f64::from(tile.u), -f64::from(tile.v))
        } else {
            let (low, [u, v]) = (low[chart[t] as usize], period[chart[t] as usize]);
            let whole = |x: f64, period: f64| if period.is_finite() { (x / period).floor() * period } else { 0.0 };
            DVec2::new(whole(low.x, u), whole(low.y, v))
        };
        out.texcoord = uv.map(|q| [(q.x - shift.x) as f32, (q.y - shift.y) as f32]);
        let (e, f) = (p[1] - p[0], p[2] - p[0]);
        let (a, b) = (uv[1] - uv[0], uv[2] - uv[0]);
        let normal = e.cross(f);
        let square = normal.length_squared();
        // Gradients of barycentric coordinates 1 and 2.
        let (g1, g2) = (f.cross(normal) / square, normal.cross(e) / square);
        let (gu, gv) = (g1 * a.x + g2 * b.x, g1 * a.y + g2 * b.y);
        let density = a.perp_dot(b).abs() / square.sqrt();
        let values = [single(gu), single(gv)];
        if values.iter().flatten().all(|c| c.abs() < LARGEST) && (density as f32) < LARGEST {
            out.gradient = values;
            out.density = density as f32;
        }
        out
    };
    Ok((0..mesh.triangle_count()).map(triangle).collect())
}

/// The table of a source whose vertices have the colours: texture coordinates are the barycentric
/// coordinates of the second and third corner.
///
/// # Errors
/// If a position is not finite.
pub(super) fn vertex_triangles(mesh: &Mesh) -> Result<Vec<SourceTriangle>> {
    check_positions(mesh)?;
    let (centre, scale) = frame(mesh);
    let triangle = |t: usize| SourceTriangle {
        position: mesh.triangle_positions(t).map(|p| {
            let p = (p - centre) * scale;
            [p.x as f32, p.y as f32, p.z as f32]
        }),
        texcoord: [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
        gradient: [[0.0; 3]; 2],
        density: 0.0,
        chart: 0,
        stretch: 1.0,
    };
    Ok((0..mesh.triangle_count()).map(triangle).collect())
}

/// Makes the parts of a chart in different unit squares different charts.
fn cut_at_tiles(mesh: &Mesh, chart: &mut [u32]) {
    let mut parts: HashMap<(u32, UvTile), u32> = HashMap::new();
    for (t, chart) in chart.iter_mut().enumerate() {
        if let Some(uv) = mesh.triangle_texcoords(t) {
            let next = parts.len() as u32;
            *chart = *parts.entry((*chart, UvTile::of(&uv))).or_insert(next);
        }
    }
}

/// The table of the target for a texture of `width` x `height` texels.
///
/// # Errors
/// If a position is not finite.
pub fn target_triangles(target: &Mesh, source: &Mesh, width: u32, height: u32) -> Result<Vec<TargetTriangle>> {
    check_positions(target)?;
    let chart = charts(target);
    // A similarity takes the target's area to the source's.
    let ratio = source.area() / target.area();
    let scale = frame(source).1 * if ratio.is_finite() && ratio > 0.0 { ratio.sqrt() } else { 1.0 };
    let triangle = |t: usize| {
        let mut out = TargetTriangle { chart: chart[t], texel_area: 0.0, step: [0.0; 2] };
        let Some(uv) = target.triangle_texcoords(t) else { return out };
        let p = target.triangle_positions(t);
        let (e, f) = ((p[1] - p[0]) * scale, (p[2] - p[0]) * scale);
        let size = DVec2::new(f64::from(width), f64::from(height));
        let (a, b) = ((uv[1] - uv[0]) * size, (uv[2] - uv[0]) * size);
        let area = a.perp_dot(b);
        let x = (e * b.y - f * a.y) / area;
        let y = (f * a.x - e * b.x) / area;
        let values = [x.cross(y).length() as f32, x.length() as f32, y.length() as f32];
        if values.iter().all(|&c| c < LARGEST) {
            out.texel_area = values[0];
            out.step = [values[1], values[2]];
        }
        out
    };
    Ok((0..target.triangle_count()).map(triangle).collect())
}
