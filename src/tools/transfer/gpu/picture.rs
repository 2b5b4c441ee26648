//! Pictures of the result on a device: for each layer the pictures that it is sampled from, and where
//! its texels are stored.

use std::sync::Arc;

use super::device_picture::DevicePicture;
use super::sample_texture::{FootprintRecord, Texture};
use super::store_texel::{Format, Store, StoreTo, step_table};
use super::tally::by_four;
use crate::engine::{Batch, BindGroup, Buffer, Gpu, Staging, Submission, Table};
use crate::error::Result;
use crate::raster::Image;
use crate::tools::transfer::TransferOptions;
use crate::tools::transfer::mip::MipChain;

/// What a layer is made of.
pub(in crate::tools::transfer) struct Plate<'p> {
    /// Number of its table of the source.
    pub(in crate::tools::transfer) lookup: usize,
    /// Its pictures, on the host and on the device.
    pub(in crate::tools::transfer) chains: &'p [MipChain<'p>],
    pub(in crate::tools::transfer) pictures: Vec<Arc<DevicePicture>>,
    /// The picture of each triangle of the source.
    pub(in crate::tools::transfer) texture_of: &'p [u32],
    /// The result, of the right format.
    pub(in crate::tools::transfer) image: &'p Image,
    /// A picture of nothing but background, in that format.
    pub(in crate::tools::transfer) background: Image,
}

/// A picture of the result.
pub(super) struct Picture<'a> {
    pub(super) lookup: usize,
    pub(super) format: Format,
    pub(super) words: Buffer<u32>,
    pub(super) staging: Staging<'a, u32>,
    sources: Vec<(Texture, BindGroup, Store)>,
    _tables: [Table; 2],
}

impl<'a> Picture<'a> {
    /// Room for `texels` texels of the layer, coloured from `footprints` by way of `colors`.
    pub(super) fn new(
        gpu: &'a Gpu,
        plate: &Plate<'_>,
        texels: usize,
        footprints: &Buffer<FootprintRecord>,
        colors: &Buffer<[f32; 4]>,
        options: &TransferOptions,
    ) -> Result<Self> {
        let format = Format::of(plate.image);
        let words = gpu.buffer("picture", texels * format.words())?;
        let textures = by_four(gpu, "textures", plate.texture_of.iter().copied())?;
        let light = plate.chains.iter().any(|c| c.encoding.linear_light);
        let steps = step_table(gpu, format.depth, light)?;
        let to = StoreTo {
            format,
            background: &plate.background,
            footprints,
            colors,
            picture: &words,
            textures: &textures,
            steps: &steps,
        };
        let source = |(k, (chain, picture)): (u32, (&MipChain<'_>, &Arc<DevicePicture>))| {
            let texture = Texture::new(gpu, Arc::clone(picture), chain, (options.filter, options.taps), k)?;
            let group = texture.bind(gpu, footprints, colors, &textures)?;
            let store = to.bind(gpu, picture, chain, k)?;
            Ok((texture, group, store))
        };
        let sources = (0..).zip(plate.chains.iter().zip(&plate.pictures)).map(source).collect::<Result<Vec<_>>>()?;
        let staging = Staging::new(gpu, "picture", words.len())?;
        Ok(Self { lookup: plate.lookup, format, words, staging, sources, _tables: [textures, steps] })
    }

    /// Submits the colours of `count` footprints, which go to texel `first` and on.
    pub(super) fn submit(&self, gpu: &Gpu, first: usize, count: usize) -> Result<Submission> {
        let mut batch: Batch<'_> = gpu.batch()?;
        for (texture, group, store) in &self.sources {
            batch.dispatch_range(&texture.pipeline, group, 0, count as u32)?;
            batch.dispatch_range(&store.pipeline, &store.group, first as u32, count as u32)?;
        }
        batch.submit()
    }
}
