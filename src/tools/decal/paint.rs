//! A decal drawn into the texture of its surface, by the stages of a texture transfer: the picture
//! is the texture of a flat source.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::Decal;
use super::composite::framed;
use crate::engine::Engine;
use crate::error::{Error, Result};
use crate::geometry::{Corner, Mesh, MeshBuilder, NONE};
use crate::picture::Image;
use crate::progress::Progress;
use crate::surface::{PackedImage, PackedPoint, PointMap, Status};
use crate::tools::transfer::{Encoding, Filter, Layer, TransferOptions, TransferStats, transfer_on};

/// How a decal is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaintOptions {
    /// Texels per row of the texture.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Texels around charts that are padded.
    pub margin: u32,
    /// How the picture is averaged.
    pub filter: Filter,
    /// Samples along a texel's side, 1 to 4.
    pub supersample: u32,
    /// Average light instead of stored values.
    pub linear_light: bool,
    /// Only triangles of this material, if given.
    pub material: Option<u32>,
    /// Bytes that may be allocated.
    pub memory: u64,
}

/// A decal in the texture of its surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Painted {
    /// The picture's colours with alpha, transparent elsewhere.
    pub image: Image,
    /// Texels that show a part of the picture's frame or its inside.
    pub texels: u64,
    /// What is known of the transfer.
    pub stats: TransferStats,
}

/// Draws `picture` into a transparent texture of `mesh` where `decal` shows it, averaged over each
/// texel's footprint. Beyond the picture's borders it is transparent, so that these are smooth.
///
/// # Errors
/// Those of [`transfer_on`]; a mesh without texture coordinates.
pub fn paint(
    engine: &Engine,
    mesh: &Mesh,
    decal: &Decal,
    picture: &Image,
    options: &PaintOptions,
    progress: &dyn Progress,
) -> Result<Painted> {
    if !mesh.has_texcoords() {
        return Err(Error::mesh(
            &mesh.name,
            "it has no texture coordinates to draw a decal by",
            "Make some with `barymap unwrap`, or write the decal's own coordinates (-o OUT.obj)",
        ));
    }
    let (framed, frame) = framed(picture)?;
    let flat = Flat::new(mesh, decal, frame);
    let layer = Layer {
        encoding: Encoding { linear_light: options.linear_light, ..Encoding::default() },
        ..Layer::single("decal", &framed)
    };
    let settings = TransferOptions {
        width: options.width,
        height: options.height,
        margin: options.margin,
        supersample: options.supersample,
        filter: options.filter,
        material: options.material,
        memory: options.memory,
        ..TransferOptions::default()
    };
    let source = flat.source(mesh, decal);
    let mut output = transfer_on(engine, &source, &[layer], mesh, &flat, &settings, progress)?;
    let Some(image) = output.layers.pop() else {
        return Err(Error::numeric("the transfer made no picture", "Report this with the files"));
    };
    Ok(Painted { image, texels: output.stats.covered - output.stats.colorless, stats: output.stats })
}

/// The map from the mesh to the framed picture: two triangles, and a third that stands for the rest
/// of the surface.
struct Flat {
    /// Coordinates of each triangle's corners, in the framed picture; `None` outside the patch.
    corners: Vec<Option<[DVec2; 3]>>,
}

/// Triangle of the source without a texture.
const REST: u32 = 2;

impl Flat {
    /// `frame` is the transparent border's width along u and v, in parts of the framed picture.
    fn new(mesh: &Mesh, decal: &Decal, frame: DVec2) -> Self {
        let mut corners = vec![None; mesh.triangle_count()];
        for &t in &decal.patch {
            let c = mesh.triangle(t as usize).map(|v| decal.uv[v as usize]);
            if let [Some(a), Some(b), Some(c)] = c {
                corners[t as usize] = Some([a, b, c].map(|q| frame + q * (DVec2::ONE - 2.0 * frame)));
            }
        }
        Self { corners }
    }

    /// The unit square with its own coordinates, and a triangle without any that makes the ratio of
    /// its area to the mesh's that of the picture to the patch: footprints are judged by it.
    fn source(&self, mesh: &Mesh, decal: &Decal) -> Mesh {
        let picture: f64 = self.corners.iter().flatten().map(|[a, b, c]| 0.5 * (*b - *a).perp_dot(*c - *a).abs()).sum();
        let patch: f64 = decal.patch.iter().map(|&t| mesh.triangle_area(t as usize)).sum();
        let rest = (picture / patch * mesh.area() - 1.0).max(0.0);
        let side = if rest.is_finite() { (2.0 * rest).sqrt() } else { 0.0 };
        let mut builder = MeshBuilder::new("decal");
        let square = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
        builder.mesh.positions = square.iter().map(|p| p.extend(0.0)).collect();
        builder.mesh.positions.extend([DVec3::ZERO, DVec3::X * side, DVec3::Y * side]);
        builder.mesh.texcoords = square.to_vec();
        for t in [[0, 1, 2], [0, 2, 3]] {
            builder.polygon(t.map(|vertex| Corner { vertex, texcoord: vertex, normal: NONE }));
        }
        builder.polygon([4, 5, 6].map(|vertex| Corner { vertex, texcoord: NONE, normal: NONE }));
        builder.finish()
    }
}

impl PointMap for Flat {
    fn map(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> Result<()> {
        images.clear();
        points
            .par_iter()
            .map(|p| {
                let image = |face, b0: f64, b1: f64| PackedImage {
                    face,
                    b0: b0 as f32,
                    b1: b1 as f32,
                    confidence: 1.0,
                    status: Status::Valid as u32,
                };
                let Some(corners) = self.corners.get(p.face as usize).copied().flatten() else {
                    return image(REST, 1.0, 0.0);
                };
                let b = p.unpack().barycentric;
                let q: DVec2 = (0..3).map(|k| corners[k] * b[k]).sum();
                let q = q.clamp(DVec2::ZERO, DVec2::ONE);
                if q.y <= q.x { image(0, 1.0 - q.x, q.x - q.y) } else { image(1, 1.0 - q.y, q.x) }
            })
            .collect_into_vec(images);
        Ok(())
    }
}
