//! Warped pictures for interaction that stay on a device.

use glam::UVec2;

use super::gpu::lattice::{Painter, device};
use super::preview::Preview;
use crate::engine::{CommandEncoder, Engine, Submission, TextureView};
use crate::error::Result;
use crate::mapping::plane::{CompositeMap, MappedNodes};
use crate::picture::{Image, Pixels};

/// A [`Preview`] that is made on a device and shown from there.
///
/// The picture and the lattice go up once. Of a changed map its steps go up, 48 bytes a vertex and
/// step; lattice and canvas are made in the caller's commands. Nothing is submitted, waited for or
/// allocated in a frame, unless the map has more steps than any before, or other loops.
///
/// A pixel shows what [`Preview::frame`] shows there, but for roundings: nodes are mapped in single
/// precision, and their images on the canvas have a few of its digits less. Where triangles meet
/// the neighbour may be taken, which has the same place there unless the map folds.
#[derive(Debug)]
pub struct DevicePreview {
    engine: Engine,
    nodes: MappedNodes,
    painter: Painter,
}

impl DevicePreview {
    /// A preview of `image` under `map`, as by [`Preview::new`], on the device of `engine`, which
    /// may be borrowed. The first [`DevicePreview::drag`] draws it.
    ///
    /// # Errors
    /// As [`Preview::new`]; [`Error::Capability`](crate::Error::Capability) for an engine without a
    /// device, and where picture or canvas do not fit a texture.
    pub fn new(engine: &Engine, image: &Image, map: &CompositeMap, canvas: UVec2) -> Result<Self> {
        let gpu = device(engine)?;
        let preview = Preview::new(engine, image, map, canvas)?;
        let nodes = MappedNodes::new(gpu, preview.lattice.points.clone(), map)?;
        let (size, canvas) = (preview.size.to_array(), canvas.to_array());
        let painter = Painter::new(gpu, &preview.lattice, &nodes, &preview.texels, size, canvas)?;
        Ok(Self { engine: engine.clone(), nodes, painter })
    }

    /// Adds the frame of `map` to commands of the caller, who submits them before the next frame is
    /// added.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device) if the device is lost or refuses.
    pub fn drag(&mut self, map: &CompositeMap, encoder: &mut CommandEncoder) -> Result<()> {
        let gpu = device(&self.engine)?;
        let mut batch = gpu.batch_into(encoder)?;
        let images = self.nodes.record(&self.engine, gpu, &mut batch, map)?;
        self.painter.record(gpu, &mut batch, images)?;
        batch.encode()
    }

    /// The frame of `map` in commands of its own, which are submitted and not waited for.
    ///
    /// # Errors
    /// As [`DevicePreview::drag`].
    pub fn draw(&mut self, map: &CompositeMap) -> Result<Submission> {
        let gpu = device(&self.engine)?;
        let mut batch = gpu.batch()?;
        let images = self.nodes.record(&self.engine, gpu, &mut batch, map)?;
        self.painter.record(gpu, &mut batch, images)?;
        batch.submit()
    }

    /// The canvas, to draw it: RGBA of 8 bits, alpha straight. It is the same one in every frame.
    pub fn view(&self) -> &TextureView {
        self.painter.canvas().view()
    }

    /// The canvas after everything submitted, brought to the host.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device) if the device is lost or does not answer in time.
    pub fn frame(&self) -> Result<Image> {
        let canvas = self.painter.canvas();
        let [width, height] = canvas.size();
        let pixels = device(&self.engine)?.read_canvas(canvas)?;
        Image::new(width, height, 4, Pixels::U8(pixels.into_flattened()))
    }
}
