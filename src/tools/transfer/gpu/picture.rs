//! Pictures of the result on a device: for each layer the pictures that it is sampled from, and
//! where its texels are stored.

use std::ops::Range;
use std::sync::Arc;

use super::device_picture::DevicePicture;
use super::items;
use super::locate::Chunk;
use super::runs::Runs;
use super::sample_texture::Texture;
use super::store_texel::{Background, Format, Store, StoreTo, step_table};
use super::tally::by_four;
use crate::engine::{Batch, BindGroup, Buffer, Gpu, Staging, Submission, Table};
use crate::error::Result;
use crate::picture::Image;
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
    background: Background,
    _tables: [Table; 2],
}

impl<'a> Picture<'a> {
    /// Room for `texels` texels of the layer in rows of `row`, coloured from the footprints of
    /// `runs`.
    pub(super) fn new(
        gpu: &'a Gpu,
        plate: &Plate<'_>,
        (texels, row): (usize, usize),
        runs: &Runs,
        chunk: &Chunk,
        options: &TransferOptions,
    ) -> Result<Self> {
        let format = Format::of(plate.image);
        let words = gpu.buffer("picture", texels * format.words())?;
        let textures = by_four(gpu, "textures", plate.texture_of.iter().copied())?;
        let light = plate.chains.iter().any(|c| c.encoding.linear_light);
        let steps = step_table(gpu, format.depth, light)?;
        let to = StoreTo { format, row, runs, chunk, picture: &words, textures: &textures, steps: &steps };
        let source = |(k, (chain, picture)): (u32, (&MipChain<'_>, &Arc<DevicePicture>))| {
            let texture = Texture::new(gpu, Arc::clone(picture), chain, (options.filter, options.taps), k)?;
            let group = texture.bind(gpu, &chunk.footprints, &chunk.colors, &textures)?;
            let store = to.bind(gpu, picture, chain, k)?;
            Ok((texture, group, store))
        };
        let sources = (0..).zip(plate.chains.iter().zip(&plate.pictures)).map(source).collect::<Result<Vec<_>>>()?;
        let background = Background::new(gpu, format, &plate.background, &words)?;
        let staging = Staging::new(gpu, "picture", words.len())?;
        Ok(Self { lookup: plate.lookup, format, words, staging, sources, background, _tables: [textures, steps] })
    }

    /// Records a picture of nothing but background.
    pub(super) fn clear(&self, batch: &mut Batch<'_>) -> Result<()> {
        self.background.record(batch, self.words.len() / self.format.words())
    }

    /// Submits the colours of the footprints of some runs, which go to rows from `origin` on.
    pub(super) fn submit(&self, gpu: &Gpu, texels: &Range<usize>, origin: usize) -> Result<Submission> {
        let mut batch: Batch<'_> = gpu.batch()?;
        self.record(&mut batch, texels, origin)?;
        batch.submit()
    }

    /// Records the same.
    pub(super) fn record(&self, batch: &mut Batch<'_>, texels: &Range<usize>, origin: usize) -> Result<()> {
        for (texture, group, store) in &self.sources {
            batch.dispatch(&texture.pipeline, group, texels.len())?;
            batch.dispatch_placed(&store.pipeline, &store.group, items(texels)?, origin as u32)?;
        }
        Ok(())
    }
}
