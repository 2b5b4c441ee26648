//! A layer and its result.

use rayon::prelude::*;

use super::atlas::AtlasTexel;
use super::band::Window;
use super::exact::copy_coinciding;
use super::fill::Holes;
use super::footprint::Footprint;
use super::gpu::{DeviceTexture, Plate, Sampler};
use super::kind::LayerKind;
use super::layer::{Layer, blank, store};
use super::mip::{Encoding, MipChain};
use super::nearest::nearest_texels;
use super::pyramids::Pyramids;
use super::rebase::{Rebase, Samples, renormalise};
use super::sample::{SampleParams, sample_texture};
use super::vertex_colors::VertexColors;
use super::{Background, TransferOptions};
use crate::engine::Gpu;
use crate::error::Result;
use crate::geometry::{Mesh, NONE};
use crate::picture::{Depth, Image};

/// Buffers of a band, kept to be reused.
#[derive(Default)]
pub(super) struct Scratch {
    /// By the tables of the source.
    pub(super) footprints: Vec<Vec<Footprint>>,
    pub(super) fine_footprints: Vec<Vec<Footprint>>,
    pub(super) colors: Vec<f32>,
    pub(super) fine_colors: Vec<f32>,
}

impl Scratch {
    /// For so many tables of the source.
    pub(super) fn new(lookups: usize) -> Self {
        let empty = || vec![Vec::new(); lookups];
        Self { footprints: empty(), fine_footprints: empty(), ..Self::default() }
    }
}

/// A layer and its result.
pub(super) struct Output<'a> {
    pub(super) chains: Vec<MipChain<'a>>,
    /// What it has in place of pictures.
    vertices: Option<VertexColors<'a>>,
    pub(super) encoding: Encoding,
    /// Number of its table of the source.
    pub(super) lookup: usize,
    /// The chains on a device, if sampling works there.
    pub(super) device: Vec<DeviceTexture>,
    pub(super) texture_of: Vec<u32>,
    pub(super) image: Image,
    /// Where there is no colour, if that is to be filled.
    pub(super) holes: Holes,
    pub(super) kind: LayerKind,
    /// What carries normals and heights to the target, if some layer holds them.
    rebase: Option<&'a Rebase<'a>>,
}

impl<'a> Output<'a> {
    pub(super) fn new<'p: 'a>(
        layer: &Layer<'p>,
        source: &'a Mesh,
        lookup: usize,
        options: &TransferOptions,
        rebase: Option<&'a Rebase<'a>>,
        pyramids: &Pyramids<'p>,
    ) -> Result<Self> {
        let (channels, depth) = layer.output_format(options.background);
        let encoding = layer.reading();
        Ok(Self {
            chains: (0..layer.images.len()).map(|k| layer.chain(k, pyramids)).collect::<Result<Vec<_>>>()?,
            vertices: layer.vertices.map(|colors| VertexColors::new(source, colors, encoding)),
            encoding,
            lookup,
            holes: Holes::default(),
            device: Vec::new(),
            texture_of: layer.texture_of(source),
            image: blank(options.width, options.height, channels, depth, options.background)?,
            kind: layer.kind,
            rebase,
        })
    }

    /// Whether a device alone can make it, from what it holds of the texels: colours of pictures.
    pub(super) fn stays(&self) -> bool {
        self.kind == LayerKind::Color && self.vertices.is_none()
    }

    /// What a device makes it of.
    pub(super) fn plate(&self, gpu: &Gpu, pyramids: &Pyramids<'_>, background: Background) -> Result<Plate<'_>> {
        let image = &self.image;
        Ok(Plate {
            lookup: self.lookup,
            pictures: self.chains.iter().map(|c| pyramids.on_device(gpu, c)).collect::<Result<_>>()?,
            chains: &self.chains,
            texture_of: &self.texture_of,
            background: blank(1, 1, image.channels, image.depth(), background)?,
            image,
        })
    }

    /// Brings the chains to the device that samples.
    pub(super) fn upload(
        &mut self,
        sampler: &Sampler<'_>,
        pyramids: &Pyramids<'_>,
        options: &TransferOptions,
    ) -> Result<()> {
        // Labels are looked up, not sampled.
        for chain in self.chains.iter().filter(|_| self.kind != LayerKind::Labels) {
            let picture = pyramids.on_device(sampler.gpu(), chain)?;
            self.device.push(sampler.bind(picture, chain, options.filter, options.taps)?);
        }
        Ok(())
    }

    /// Colours at footprints.
    pub(super) fn colors(
        &self,
        footprints: &[Footprint],
        options: &TransferOptions,
        colors: &mut Vec<f32>,
        mut sampler: Option<&mut Sampler<'_>>,
    ) -> Result<()> {
        let channels = self.image.channels;
        colors.clear();
        colors.resize(footprints.len() * channels as usize, 0.0);
        if let Some(vertices) = &self.vertices {
            vertices.sample(channels as usize, footprints, colors);
        }
        for (texture, chain) in self.chains.iter().enumerate() {
            if self.kind == LayerKind::Labels {
                let texture = texture as u32;
                nearest_texels(chain, texture, channels as usize, &self.texture_of, footprints, colors);
                continue;
            }
            let params = SampleParams { filter: options.filter, taps: options.taps, channels, texture: texture as u32 };
            match (&mut sampler, self.device.get(texture)) {
                (Some(s), Some(device)) => s.sample(device, chain, &params, &self.texture_of, footprints, colors)?,
                _ => sample_texture(chain, &params, &self.texture_of, footprints, colors),
            }
        }
        Ok(())
    }

    /// Fills the rows of the result.
    pub(super) fn sample(
        &mut self,
        rows: &std::ops::Range<usize>,
        coarse: &Window<'_>,
        fine: Option<&Window<'_>>,
        scratch: &mut Scratch,
        options: &TransferOptions,
        mut sampler: Option<&mut Sampler<'_>>,
    ) -> Result<()> {
        let footprints = &scratch.footprints[self.lookup];
        self.colors(footprints, options, &mut scratch.colors, sampler.as_deref_mut())?;
        self.rebase(coarse, rows, footprints, &mut scratch.colors);
        if let Some(fine) = fine.filter(|_| self.kind != LayerKind::Labels) {
            let k = options.supersample as usize;
            let fine_footprints = &scratch.fine_footprints[self.lookup];
            self.colors(fine_footprints, options, &mut scratch.fine_colors, sampler)?;
            let fine_rows = rows.start * k..rows.end * k;
            self.rebase(fine, &fine_rows, fine_footprints, &mut scratch.fine_colors);
            self.average(rows, coarse, fine, scratch, k);
            renormalise(self.kind, self.image.depth(), self.image.channels as usize, &mut scratch.colors);
        }
        let first = rows.start * coarse.width;
        let palette =
            Palette { chains: &self.chains, texture_of: &self.texture_of, kind: self.kind, encoding: self.encoding };
        let footprints = &scratch.footprints[self.lookup];
        palette.write(&mut self.image, first, footprints, &scratch.colors, fine.is_none());
        Ok(())
    }

    /// Where its colours come from.
    pub(super) fn palette(&self) -> Palette<'_> {
        Palette { chains: &self.chains, texture_of: &self.texture_of, kind: self.kind, encoding: self.encoding }
    }

    /// Expresses normals and heights on the target.
    fn rebase(&self, window: &Window<'_>, rows: &std::ops::Range<usize>, footprints: &[Footprint], colors: &mut [f32]) {
        let Some(rebase) = self.rebase else { return };
        let depths: Vec<Depth> = self.chains.iter().map(MipChain::depth).collect();
        let samples = Samples {
            kind: self.kind,
            depths: &depths,
            depth: self.image.depth(),
            channels: self.image.channels as usize,
            texture_of: &self.texture_of,
        };
        rebase.apply(&samples, window, rows, footprints, colors);
    }

    /// Replaces the colour of each texel by the mean of its samples whose centres lie in the same
    /// chart, if there are any.
    fn average(
        &self,
        rows: &std::ops::Range<usize>,
        coarse: &Window<'_>,
        fine: &Window<'_>,
        scratch: &mut Scratch,
        k: usize,
    ) {
        let (width, channels) = (coarse.width, self.image.channels as usize);
        let texels = coarse.texels(rows);
        let fine_texels = fine.texels(&(rows.start * k..rows.end * k));
        let Scratch { colors, fine_colors, fine_footprints, .. } = scratch;
        let fine_footprints = &fine_footprints[self.lookup];
        let shown = |f: &Footprint| f.face != NONE && self.texture_of[f.face as usize] != NONE;
        colors.par_chunks_mut(width * channels).enumerate().for_each(|(y, row)| {
            for (x, color) in row.chunks_exact_mut(channels).enumerate() {
                let chart = coarse.chart(&texels[y * width + x]);
                if chart == NONE {
                    continue;
                }
                let mut sum = [0.0_f32; 4];
                let mut count = 0;
                for j in 0..k {
                    for i in (y * k + j) * width * k + x * k..(y * k + j) * width * k + x * k + k {
                        let sample: &AtlasTexel = &fine_texels[i];
                        if sample.is_centre() && fine.chart(sample) == chart && shown(&fine_footprints[i]) {
                            count += 1;
                            for (s, c) in sum.iter_mut().zip(&fine_colors[i * channels..(i + 1) * channels]) {
                                *s += c;
                            }
                        }
                    }
                }
                if count > 0 {
                    for (c, s) in color.iter_mut().zip(sum) {
                        *c = s / count as f32;
                    }
                }
            }
        });
    }
}

/// Where the colours of a layer come from.
pub(super) struct Palette<'a> {
    chains: &'a [MipChain<'a>],
    texture_of: &'a [u32],
    kind: LayerKind,
    encoding: Encoding,
}

impl Palette<'_> {
    /// Writes colours into a picture of the result's format from texel `first` on; texels of the
    /// source at their own size come over `exact`ly, if so asked.
    pub(super) fn write(&self, image: &mut Image, first: usize, footprints: &[Footprint], colors: &[f32], exact: bool) {
        store(image, first, self.encoding, self.texture_of, footprints, colors);
        // What is expressed on the target is not the source's texel.
        if exact && matches!(self.kind, LayerKind::Color | LayerKind::Labels) {
            for (texture, chain) in self.chains.iter().enumerate() {
                copy_coinciding(image, first, chain, texture as u32, self.texture_of, footprints);
            }
        }
    }
}
