//! Normals and heights after sampling: expressed on the target instead of on the source.
//!
//! A normal n at a point of the source is read as the slope of a relief over the smooth surface:
//! with the unit smooth normal N, n is parallel to N - grad h. The map's differential J, from the
//! tangent plane of the target at a texel to that of the source at its image, makes a gradient of
//! heights on the source one on the target (`differential.rs`), and that gives the normal there. J
//! is fitted to the steps from a texel to its neighbours, on the target and between their images;
//! where neighbours are missing or across a jump, to the edges of the texel's triangle and the
//! images of its corners. By default gradients are only turned, by the rotation closest to J
//! ([`Relief::Turned`]): as J depends on no texture coordinates, that has no seams. Else they are
//! carried as the covectors they are, by the transpose of J, heights being multiplied by the local
//! ratio of sizes 1/sqrt(det J) ([`Relief::Local`]) or by the ratio for the mesh as a whole
//! ([`Relief::Mesh`]). In all three a scaled copy of a mesh keeps its maps.

use glam::DVec3;
use rayon::prelude::*;

use super::band::Window;
use super::footprint::{Footprint, JUMP};
use super::kind::{LayerKind, NormalY, Relief};
use super::normal_code::{NormalCode, zero_height};
use crate::error::Result;
use crate::geometry::tangent_frames::TangentFrames;
use crate::geometry::{Frame, Mesh, NONE, SurfacePoint, Topology};
use crate::picture::Depth;
use crate::surface::quality::vertex_normals;
use crate::surface::{PointMap, Status};
use crate::tools::differential::Differential;
use crate::tools::vertex_map::vertex_images;

/// Normals are at most this far from the smooth one: the cosine of 88 degrees.
const LEAST_COSINE: f64 = 0.035;

/// A mesh with what is looked up on it.
struct Side<'a> {
    mesh: &'a Mesh,
    /// Where places are told, in the units of the mesh.
    frame: Frame,
    frames: TangentFrames,
}

impl<'a> Side<'a> {
    fn new(mesh: &'a Mesh, topology: &Topology) -> Self {
        Self {
            mesh,
            frame: Frame::of_mesh(mesh).in_units(),
            frames: TangentFrames::new(mesh, &vertex_normals(mesh, topology)),
        }
    }

    fn position(&self, face: u32, b: [f64; 3]) -> DVec3 {
        self.frame.place(&SurfacePoint::new(face, b), self.mesh)
    }
}

/// What samples are, where they go, and how both are stored.
pub(super) struct Samples<'a> {
    pub(super) kind: LayerKind,
    /// Depth of each of the layer's pictures.
    pub(super) depths: &'a [Depth],
    /// Depth of the result.
    pub(super) depth: Depth,
    /// Channels of `colors`.
    pub(super) channels: usize,
    /// Picture of each triangle of the source.
    pub(super) texture_of: &'a [u32],
}

/// Source and target with their frames, and the map between them.
pub(super) struct Rebase<'a> {
    source: Side<'a>,
    target: Side<'a>,
    /// Images of the target's vertices that the map vouches for.
    images: Vec<Option<DVec3>>,
    /// Length on the target per length on the source, over all.
    size_ratio: f64,
}

impl<'a> Rebase<'a> {
    /// Makes the tables if some layer needs them.
    pub(super) fn for_kinds(
        kinds: impl IntoIterator<Item = LayerKind>,
        source: &'a Mesh,
        target: &'a Mesh,
        map: &dyn PointMap,
    ) -> Result<Option<Self>> {
        if kinds.into_iter().any(needs_frames) { Self::new(source, target, map).map(Some) } else { Ok(None) }
    }

    fn new(source: &'a Mesh, target: &'a Mesh, map: &dyn PointMap) -> Result<Self> {
        let (around_source, around_target) = (Topology::new(source), Topology::new(target));
        let (source, target) = (Side::new(source, &around_source), Side::new(target, &around_target));
        let images: Vec<Option<DVec3>> = vertex_images(target.mesh, &around_target, map)?
            .iter()
            .map(|i| i.point().filter(|p| i.status() == Status::Valid && p.is_valid(source.mesh, 1e-2)))
            .map(|p| p.map(|p| source.frame.place(&p, source.mesh)))
            .collect();
        let (mut area, mut image_area) = (0.0, 0.0);
        for t in 0..target.mesh.triangle_count() {
            if let [Some(a), Some(b), Some(c)] = target.mesh.triangle(t).map(|v| images[v as usize]) {
                area += target.mesh.triangle_area(t);
                image_area += 0.5 * (b - a).cross(c - a).length();
            }
        }
        let ratio = (area / image_area).sqrt();
        let size_ratio = if ratio.is_finite() && ratio > 0.0 { ratio } else { 1.0 };
        Ok(Self { source, target, images, size_ratio })
    }

    /// Length on the target per length on the source, over all: what the strength of a displacement
    /// map is to be multiplied by.
    pub(super) fn size_ratio(&self) -> f64 {
        self.size_ratio
    }

    /// Rewrites the samples of the texels of `rows`.
    pub(super) fn apply(
        &self,
        samples: &Samples<'_>,
        window: &Window<'_>,
        rows: &std::ops::Range<usize>,
        footprints: &[Footprint],
        colors: &mut [f32],
    ) {
        let (width, channels) = (window.width, samples.channels);
        if let LayerKind::Color | LayerKind::Labels = samples.kind {
            return;
        }
        colors.par_chunks_mut(width * channels).enumerate().for_each(|(row, colors)| {
            for (x, color) in colors.chunks_exact_mut(channels).enumerate() {
                let face = footprints[row * width + x].face;
                if face == NONE || samples.texture_of[face as usize] == NONE {
                    continue;
                }
                let depth = samples.depths[samples.texture_of[face as usize] as usize];
                self.texel(samples, depth, window, x, rows.start + row, color);
            }
        });
    }

    fn texel(&self, samples: &Samples<'_>, depth: Depth, window: &Window<'_>, x: usize, y: usize, color: &mut [f32]) {
        let Some((texel, image)) = window.at(x, y) else { return };
        let (here, there) = (texel.point().unpack(), image.point());
        let Some(there) = there else { return };
        let normal = self.target.frames.normal(here.face, here.barycentric);
        let image_normal = self.source.frames.normal(there.face, there.barycentric);
        let differential = || self.differential(window, x, y, normal, image_normal);
        match samples.kind {
            LayerKind::Color | LayerKind::Labels => {}
            LayerKind::Displacement { relief } => {
                let (zero, new_zero) = (zero_height(depth), zero_height(samples.depth));
                let size = if relief == Relief::Local { differential().map(|d| d.size()) } else { None };
                let factor = size.map_or(1.0, |size| 1.0 / (size * self.size_ratio));
                let heights = if samples.channels.is_multiple_of(2) { samples.channels - 1 } else { samples.channels };
                if factor != 1.0 || zero != new_zero {
                    for c in &mut color[..heights] {
                        *c = (new_zero + factor * (f64::from(*c) - zero)) as f32;
                    }
                }
            }
            LayerKind::ObjectNormal { relief } => {
                let n = NormalCode::object(depth).decode(color, NormalY::Up).unwrap_or(image_normal);
                let carried = self.carry(n, normal, image_normal, relief, differential());
                NormalCode::object(samples.depth).encode(carried, NormalY::Up, color);
            }
            LayerKind::TangentNormal { y: green, relief } => {
                let n = NormalCode::tangent(depth).decode(color, green).unwrap_or(DVec3::Z);
                let in_space = self.source.frames.at(there.face, there.barycentric).to_space(n);
                let unit = in_space.try_normalize().unwrap_or(image_normal);
                let carried = self.carry(unit, normal, image_normal, relief, differential());
                let frame = self.target.frames.at(here.face, here.barycentric);
                let n2 = frame.to_frame(carried).and_then(|v| v.try_normalize()).unwrap_or(DVec3::Z);
                NormalCode::tangent(samples.depth).encode(n2 * n.length(), green, color);
            }
        }
    }

    /// A normal of the source, in space, as one of the target, as long as it was; without a
    /// differential the smooth one.
    fn carry(&self, n: DVec3, normal: DVec3, image_normal: DVec3, relief: Relief, by: Option<Differential>) -> DVec3 {
        let Some(d) = by else { return normal * n.length() };
        let tilt = n - image_normal * n.dot(image_normal);
        let gradient = -tilt / n.dot(image_normal).max(LEAST_COSINE * n.length());
        let carried = match relief {
            Relief::Turned => d.turn_gradient(gradient),
            Relief::Local => d.pull_gradient(gradient, 1.0 / d.size()),
            Relief::Mesh => d.pull_gradient(gradient, self.size_ratio),
        };
        (normal - carried).normalize_or(normal) * n.length()
    }

    /// The map's differential at a texel.
    fn differential(
        &self,
        window: &Window<'_>,
        x: usize,
        y: usize,
        normal: DVec3,
        image_normal: DVec3,
    ) -> Option<Differential> {
        let (texel, image) = window.at(x, y)?;
        let pair = |x: usize, y: usize| {
            let (t, i) = window.at(x, y)?;
            if !t.is_centre() || window.chart(t) != window.chart(texel) {
                return None;
            }
            let (p, q) = (t.point().unpack(), i.point()?);
            Some((self.target.position(p.face, p.barycentric), self.source.position(q.face, q.barycentric)))
        };
        let (p, q) = (texel.point().unpack(), image.point()?);
        let p = self.target.position(p.face, p.barycentric);
        let q = self.source.position(q.face, q.barycentric);
        let near = |e: DVec3, f: DVec3| f.length() * self.size_ratio <= f64::from(JUMP) * e.length();
        let beside =
            [(x.checked_sub(1), Some(y)), (Some(x + 1), Some(y)), (Some(x), y.checked_sub(1)), (Some(x), Some(y + 1))];
        let steps = beside.into_iter().filter_map(|(x, y)| {
            let (a, b) = pair(x?, y?)?;
            Some((a - p, b - q)).filter(|&(e, f)| near(e, f))
        });
        let edges = || {
            let [v0, v1, v2] = self.target.mesh.triangle(texel.face as usize).map(|v| v as usize);
            let (a, b, c) = (self.images[v0]?, self.images[v1]?, self.images[v2]?);
            let [o, e, f] = self.target.mesh.triangle_positions(texel.face as usize);
            let steps = [(e - o, b - a), (f - o, c - a), (f - e, c - b)];
            if !steps.iter().all(|&(e, f)| near(e, f)) {
                return None;
            }
            Differential::fit(normal, image_normal, steps)
        };
        Differential::fit(normal, image_normal, steps)
            .or_else(edges)
            .or_else(|| Differential::shortest_turn(normal, image_normal))
    }
}

/// Whether samples of this kind depend on where they are on the surface.
pub(super) fn needs_frames(kind: LayerKind) -> bool {
    !matches!(kind, LayerKind::Color | LayerKind::Labels)
}

/// Bytes of the tables.
pub(super) fn bytes(source: &Mesh, target: &Mesh) -> u64 {
    let triangles = (source.triangle_count() + target.triangle_count()) as u64;
    // Frames, and adjacency and the generator's work while they are made.
    triangles * (TangentFrames::TRIANGLE_BYTES as u64 + 400) + 64 * target.vertex_count() as u64
}

/// Makes normals that were averaged unit vectors again.
pub(super) fn renormalise(kind: LayerKind, depth: Depth, channels: usize, colors: &mut [f32]) {
    let code = match kind {
        LayerKind::TangentNormal { .. } => NormalCode::tangent(depth),
        LayerKind::ObjectNormal { .. } => NormalCode::object(depth),
        _ => return,
    };
    colors.par_chunks_mut(channels * 4096).for_each(|part| {
        for color in part.chunks_exact_mut(channels) {
            if let Some(n) = code.decode(color, NormalY::Up) {
                code.encode(n, NormalY::Up, color);
            }
        }
    });
}

#[cfg(test)]
mod tests;
