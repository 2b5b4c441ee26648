//! Shaded pictures of meshes, made on the processor: to look at results.
//!
//! Triangles are sorted into bands of rows, the bands are drawn in parallel, each with its own
//! depth buffer, so that the picture does not depend on the number of threads. Sampling is regular,
//! [`RenderOptions::supersampling`] squared samples a pixel, averaged in linear light.

mod camera;
pub(crate) mod canvas;
mod marks;
mod raster;
mod scan;
mod shade;

use glam::DVec3;
use rayon::prelude::*;

use crate::control;
use crate::error::{Error, Result};
use crate::geometry::{Mesh, Placement, SurfacePoint, UpAxis};
use crate::picture::Image;
use camera::Camera;
use canvas::Canvas;
use shade::Shader;

/// Largest width and height of a picture.
#[doc(hidden)]
pub const MAX_SIZE: u32 = 16384;

/// How a mesh gets its colours.
#[derive(Clone, Copy, Debug)]
pub enum Coloring<'a> {
    /// One colour, sRGB.
    Plain([u8; 3]),
    /// One texture for all triangles that have texture coordinates (wrapped, row 0 at v = 1); the
    /// others are grey. Alpha is left out; 8 and 16 bits are sRGB, floats are light.
    Texture(&'a Image),
    /// A texture per material by its index; triangles without one are grey. A texture of one texel
    /// needs no texture coordinates.
    Materials(&'a [Option<PlacedTexture<'a>>]),
    /// A colour per vertex of the file, sRGB, interpolated; vertices beyond the end of the slice
    /// are grey.
    Vertices(&'a [[u8; 3]]),
}

/// A texture and how it lies on the surface.
#[derive(Clone, Copy, Debug)]
pub struct PlacedTexture<'a> {
    /// The texture; row 0 is v = 1.
    pub image: &'a Image,
    /// How it lies.
    pub placement: Placement,
}

/// What a picture looks like.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderOptions {
    /// Pixels per row.
    pub width: u32,
    /// Pixels per column.
    pub height: u32,
    /// The axis of the mesh that points up in the picture.
    pub up: UpAxis,
    /// Where the camera stands, degrees around the axis that points up: 0 looks at the front (the
    /// +z side, with z up the -y side), 90 at the +x side.
    pub azimuth: f64,
    /// Height of the camera above the horizon, degrees.
    pub elevation: f64,
    /// Vertical angle of view, degrees; 0 is an orthographic camera.
    pub field_of_view: f64,
    /// Free space around the shape, as a fraction of the picture.
    pub margin: f64,
    /// Samples per pixel along each axis, 1 to 8.
    pub supersampling: u32,
    /// Draw the triangles' edges.
    pub wireframe: bool,
    /// Shade by light; otherwise colours appear as they are.
    pub lighting: bool,
    /// sRGB and opacity (0 is transparent).
    pub background: [u8; 4],
    /// Radius of anchor dots in pixels; 0 takes one that suits the size.
    pub anchor_radius: f64,
    /// Write each anchor's index beside it.
    pub anchor_numbers: bool,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self {
            width: 800,
            height: 800,
            up: UpAxis::Y,
            azimuth: 20.0,
            elevation: 8.0,
            field_of_view: 25.0,
            margin: 0.04,
            supersampling: 3,
            wireframe: false,
            lighting: true,
            background: [255; 4],
            anchor_radius: 0.0,
            anchor_numbers: false,
        }
    }
}

impl RenderOptions {
    fn check(&self) -> Result<()> {
        for (name, size) in [("width", self.width), ("height", self.height)] {
            if !(1..=MAX_SIZE).contains(&size) {
                return Err(Error::option(name, format!("{size} pixels"), format!("Give a size from 1 to {MAX_SIZE}")));
            }
        }
        if !(1..=8).contains(&self.supersampling) {
            let what = format!("{} samples per axis", self.supersampling);
            return Err(Error::option("supersampling", what, "Give a number from 1 to 8"));
        }
        if !(self.azimuth.is_finite() && self.elevation.is_finite()) {
            return Err(Error::option("view", "the angles are not finite", "Give azimuth and elevation in degrees"));
        }
        if !(0.0..=150.0).contains(&self.field_of_view) {
            let what = format!("{} degrees", self.field_of_view);
            return Err(Error::option("field_of_view", what, "Give an angle from 0 (orthographic) to 150"));
        }
        if !(0.0..0.5).contains(&self.margin) {
            return Err(Error::option("margin", format!("{}", self.margin), "Give a fraction from 0 to below 0.5"));
        }
        Ok(())
    }
}

/// Draws `mesh` from outside, fitted into the picture, with `anchors` as dots on top where they are
/// visible.
///
/// Triangles with positions that are not finite are left out, and so are anchors that do not exist
/// on the mesh; a mesh with nothing to draw gives the background. Triangles seen from their back
/// are darker. O(triangles + samples).
///
/// # Errors
/// [`Error::Option`] if an option is out of its range; [`Error::Memory`].
pub fn render(mesh: &Mesh, coloring: Coloring<'_>, anchors: &[SurfacePoint], options: &RenderOptions) -> Result<Image> {
    options.check()?;
    let (w, h) = (options.width, options.height);
    // A colour and a depth for each pixel, a place for each vertex, bands for each triangle.
    let bytes = 8 * u64::from(w) * u64::from(h) + 24 * mesh.positions.len() as u64 + 40 * mesh.triangle_count() as u64;
    control::require(bytes, || format!("a picture of {w} x {h} pixels"))?;
    let mut picture = Canvas::new(options.width, options.height, options.background);
    let Some(camera) = Camera::fitted(mesh, options) else {
        return picture.into_image();
    };
    let samples = options.supersampling;
    let projected: Vec<DVec3> = mesh
        .positions
        .iter()
        .map(|&p| camera.project(p) * DVec3::new(f64::from(samples), f64::from(samples), 1.0))
        .collect();
    let shader = Shader::new(mesh, coloring, &camera, options);
    let bands = raster::Bands::new(mesh, &projected, options.width * samples, options.height * samples, 8 * samples);
    let (width, rows) = (options.width as usize, 8);
    let mut depth_of_pixels = vec![f32::INFINITY; width * options.height as usize];
    picture
        .pixels
        .as_flattened_mut()
        .par_chunks_mut(4 * width * rows)
        .zip(depth_of_pixels.par_chunks_mut(width * rows))
        .enumerate()
        .for_each(|(band, (pixels, depths))| {
            let fragments = bands.draw(band, mesh, &projected);
            shader.resolve(&fragments, &projected, pixels, depths);
        });
    marks::draw_anchors(&mut picture, &depth_of_pixels, mesh, anchors, &camera, options);
    picture.into_image()
}

/// Pictures beside one another, centred vertically, `gap` pixels apart, on a background of sRGB and
/// opacity: 8-bit RGBA.
///
/// # Errors
/// [`Error::Option`] if there are none or the result would be wider than four times [`MAX_SIZE`].
pub fn side_by_side(pictures: &[Image], gap: u32, background: [u8; 4]) -> Result<Image> {
    if pictures.is_empty() {
        return Err(Error::option("pictures", "there is nothing to show", "Give at least one picture"));
    }
    let gaps = u64::from(gap) * pictures.len().saturating_sub(1) as u64;
    let width = pictures.iter().map(|p| u64::from(p.width)).sum::<u64>() + gaps;
    let height = pictures.iter().map(|p| p.height).max().unwrap_or(0);
    let limit = u64::from(MAX_SIZE) * 4;
    if width > limit {
        let what = format!("the row of pictures would be {width} pixels wide");
        return Err(Error::option("width", what, format!("Make fewer or smaller pictures: {limit} is the limit")));
    }
    let mut row = Canvas::new(width as u32, height, background);
    let mut x = 0;
    for picture in pictures {
        row.put(picture, x, (height - picture.height) / 2);
        x += picture.width + gap;
    }
    row.into_image()
}
