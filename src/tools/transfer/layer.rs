//! Layers: the textures of a source that one correspondence carries over together.

use rayon::prelude::*;

use super::Background;
use super::color::Sample;
use super::footprint::Footprint;
use super::kind::LayerKind;
use super::mip::{Alpha, Encoding, MipChain};
use super::pyramids::Pyramids;
use crate::error::{Error, Result};
use crate::geometry::{Mesh, NONE, Placement, Wrap};
use crate::picture::{Depth, Image, Pixels};

/// One texture of the source (colour, roughness, normals ...), as a picture for all of it or one
/// per material.
#[derive(Clone, Debug)]
pub struct Layer<'a> {
    /// Name, used in messages.
    pub name: String,
    /// The pictures.
    pub images: Vec<&'a Image>,
    /// Picture of each of the source's materials, [`NONE`] for a material without.
    pub material_texture: Vec<u32>,
    /// Picture of triangles without material, or whose material is not listed; [`NONE`] if they
    /// have none.
    pub default_texture: u32,
    /// How each picture lies on the source; empty where all lie on its texture coordinates as they
    /// are, and repeat. A picture that lies differently on two materials is listed twice.
    pub placements: Vec<Placement>,
    /// Picture of each triangle of the source, [`NONE`] for one without, where materials do not
    /// decide it: tiles of UDIM textures. These lie on the texture coordinates of the file, each on
    /// its unit square, and end at their borders.
    pub face_texture: Option<Vec<u32>>,
    /// Colours of the source's vertices (RGBA, 0..1), which are the layer in place of pictures.
    pub vertices: Option<&'a [[f32; 4]]>,
    /// How samples are averaged, if they are colours.
    pub encoding: Encoding,
    /// What samples mean.
    pub kind: LayerKind,
}

impl<'a> Layer<'a> {
    /// A layer with one picture for the whole source.
    pub fn single(name: impl Into<String>, image: &'a Image) -> Self {
        Self {
            name: name.into(),
            images: vec![image],
            material_texture: Vec::new(),
            default_texture: 0,
            placements: Vec::new(),
            face_texture: None,
            vertices: None,
            encoding: Encoding::default(),
            kind: LayerKind::default(),
        }
    }

    /// A layer of colours of vertices, one for each vertex of the source's file.
    pub fn of_vertices(name: impl Into<String>, colors: &'a [[f32; 4]]) -> Self {
        Self {
            name: name.into(),
            images: Vec::new(),
            material_texture: Vec::new(),
            default_texture: 0,
            placements: Vec::new(),
            face_texture: None,
            vertices: Some(colors),
            encoding: Encoding::default(),
            kind: LayerKind::default(),
        }
    }

    /// Whether it shows pictures of more than one texel, for which the source needs texture
    /// coordinates.
    pub(super) fn needs_texcoords(&self) -> bool {
        self.images.iter().any(|i| (i.width, i.height) != (1, 1))
    }

    /// How picture `k` lies on the source.
    pub(super) fn placement(&self, k: u32) -> Placement {
        match &self.face_texture {
            Some(_) => Placement { wrap: [Wrap::Clamp; 2], ..Placement::default() },
            None => self.placements.get(k as usize).copied().unwrap_or_default(),
        }
    }

    pub(super) fn check(&self, source: &Mesh) -> Result<()> {
        if let Some(colors) = self.vertices {
            return self.check_vertices(colors, source);
        }
        if let Some(n) = Some(self.placements.len()).filter(|&n| n != 0 && n != self.images.len()) {
            let what = format!("layer {} has {n} placements for {} pictures", self.name, self.images.len());
            return Err(Error::input(what, "Give one for each picture, or none"));
        }
        let triangles = source.triangle_count();
        if let Some(n) = self.face_texture.as_ref().map(Vec::len).filter(|&n| n != triangles) {
            return Err(Error::input(
                format!("layer {} names pictures for {n} triangles, the source has {triangles}", self.name),
                "Name one for each triangle, or none",
            ));
        }
        for (i, image) in self.images.iter().enumerate() {
            image.check(&format!("layer {}, picture {i}", self.name))?;
        }
        self.check_kind()?;
        let count = self.images.len();
        let named =
            self.material_texture.iter().chain(self.face_texture.iter().flatten()).chain([&self.default_texture]);
        let bad = named.into_iter().find(|&&t| t != NONE && t as usize >= count);
        match bad {
            _ if count == 0 => {
                Err(Error::input(format!("layer {} has no picture", self.name), "Give it one, or leave the layer out"))
            }
            Some(t) => Err(Error::input(
                format!("layer {} refers to picture {t} of {count}", self.name),
                "Give an index below the number of its pictures",
            )),
            None => Ok(()),
        }
    }

    fn check_vertices(&self, colors: &[[f32; 4]], source: &Mesh) -> Result<()> {
        if colors.len() != source.vertex_count() || !self.images.is_empty() {
            let (n, vertices) = (colors.len(), source.vertex_count());
            let what = format!("layer {} has {n} colours for {vertices} vertices, or pictures beside them", self.name);
            return Err(Error::input(what, "Give one colour for each vertex, and no picture"));
        }
        if self.kind != LayerKind::Color {
            let what = format!("layer {} holds {}, and colours of vertices", self.name, self.kind.name());
            return Err(Error::input(what, "Carry them over as colours"));
        }
        Ok(())
    }

    /// Whether the pictures can be what the kind says.
    fn check_kind(&self) -> Result<()> {
        let normals = matches!(self.kind, LayerKind::TangentNormal { .. } | LayerKind::ObjectNormal { .. });
        if let Some(i) = self.images.iter().position(|i| normals && i.channels < 3) {
            return Err(Error::input(
                format!("layer {}, picture {i}: a normal map of {} channels", self.name, self.images[i].channels),
                "Give a picture with red, green and blue, or --kind displacement for heights",
            ));
        }
        let format = |i: &Image| (i.channels, i.depth());
        let labels = self.kind == LayerKind::Labels;
        if labels && self.images.iter().any(|i| format(i) != format(self.images[0])) {
            return Err(Error::input(
                format!("layer {}: label pictures of different channels or depths", self.name),
                "Labels would change their numbers: save all of them in one format",
            ));
        }
        Ok(())
    }

    /// How samples are read: what is no colour is neither light nor weighted by alpha.
    pub(super) fn reading(&self) -> Encoding {
        match self.kind {
            LayerKind::Color => self.encoding,
            _ => Encoding { linear_light: false, alpha: Alpha::Data },
        }
    }

    /// The mip chain of picture `k`, made where `pyramids` have none yet; labels have no levels.
    pub(super) fn chain(&self, k: usize, pyramids: &Pyramids<'a>) -> Result<MipChain<'a>> {
        let (image, encoding) = (self.images[k], self.reading());
        let wrap = self.placement(k as u32).wrap;
        match self.kind {
            LayerKind::Labels => Ok(MipChain { image, encoding, levels: [].into(), wrap }),
            _ => Ok(MipChain { wrap, ..pyramids.chain(image, encoding)? }),
        }
    }

    /// Picture of each triangle of the source.
    pub(super) fn texture_of(&self, source: &Mesh) -> Vec<u32> {
        if self.vertices.is_some() {
            return vec![0; source.triangle_count()];
        }
        if let Some(texture_of) = &self.face_texture {
            return texture_of.clone();
        }
        let of = |t| {
            let material = source.triangle_material(t) as usize;
            self.material_texture.get(material).copied().unwrap_or(self.default_texture)
        };
        (0..source.triangle_count()).map(of).collect()
    }

    /// Channels and depth of the result: enough for every picture, and alpha for a transparent
    /// background.
    pub(super) fn output_format(&self, background: Background) -> (u32, Depth) {
        let color = self.vertices.is_some() || self.images.iter().any(|i| i.channels > 2);
        let opaque = self.vertices.is_none_or(|colors| colors.iter().all(|c| c[3] >= 1.0));
        let alpha = background == Background::Transparent || !opaque || self.images.iter().any(|i| i.has_alpha());
        let depth = self.images.iter().map(|i| i.depth()).max_by_key(|d| d.bytes()).unwrap_or(Depth::U8);
        (if color { 3 } else { 1 } + u32::from(alpha), depth)
    }
}

/// The background as samples of a picture with this many channels.
fn background_values(background: Background, channels: usize) -> Vec<f32> {
    let c = match background {
        Background::Transparent => [0.0; 4],
        Background::Color(c) => c,
    };
    match channels {
        1 => vec![c[0]],
        2 => vec![c[0], c[3]],
        n => c[..n].to_vec(),
    }
}

/// A picture of nothing but background.
pub(super) fn blank(width: u32, height: u32, channels: u32, depth: Depth, background: Background) -> Result<Image> {
    fn fill<T: Sample>(samples: &mut [T], values: &[f32]) {
        let values: Vec<T> = values.iter().map(|&v| T::encode(v, false)).collect();
        samples.par_chunks_mut(values.len() * 4096).for_each(|part| {
            part.chunks_exact_mut(values.len()).for_each(|texel| texel.copy_from_slice(&values));
        });
    }
    let mut image = Image::zeros(width, height, channels, depth)?;
    let values = background_values(background, channels as usize);
    if values.iter().any(|&v| v != 0.0) {
        match &mut image.pixels {
            Pixels::U8(v) => fill(v, &values),
            Pixels::U16(v) => fill(v, &values),
            Pixels::F32(v) => fill(v, &values),
        }
    }
    Ok(image)
}

/// Writes colours (decoded, premultiplied) into a picture from texel `first` on, where the
/// footprint's triangle has a texture.
pub(super) fn store(
    image: &mut Image,
    first: usize,
    encoding: Encoding,
    texture_of: &[u32],
    footprints: &[Footprint],
    colors: &[f32],
) {
    fn run<T: Sample>(
        out: &mut [T],
        channels: usize,
        encoding: Encoding,
        texture_of: &[u32],
        footprints: &[Footprint],
        colors: &[f32],
    ) {
        const TASK: usize = 4096;
        let tasks = footprints.par_chunks(TASK).zip(colors.par_chunks(TASK * channels));
        tasks.zip(out.par_chunks_mut(TASK * channels)).for_each(|((footprints, colors), out)| {
            let texels = colors.chunks_exact(channels).zip(out.chunks_exact_mut(channels));
            for (f, (color, out)) in footprints.iter().zip(texels) {
                if f.face != NONE && texture_of[f.face as usize] != NONE {
                    encode(color, out, encoding);
                }
            }
        });
    }
    let channels = image.channels as usize;
    let range = first * channels..first * channels + colors.len();
    match &mut image.pixels {
        Pixels::U8(v) => run(&mut v[range], channels, encoding, texture_of, footprints, colors),
        Pixels::U16(v) => run(&mut v[range], channels, encoding, texture_of, footprints, colors),
        Pixels::F32(v) => run(&mut v[range], channels, encoding, texture_of, footprints, colors),
    }
}

/// One texel: colours divided by alpha, rounded to nearest.
#[inline]
pub(super) fn encode<T: Sample>(color: &[f32], out: &mut [T], encoding: Encoding) {
    let n = color.len();
    if !n.is_multiple_of(2) {
        for (out, &c) in out.iter_mut().zip(color) {
            *out = T::encode(c, encoding.linear_light);
        }
        return;
    }
    let alpha = color[n - 1];
    let scale = match encoding.alpha {
        Alpha::Data => 1.0,
        Alpha::Opacity if alpha > 0.0 => 1.0 / alpha,
        // No colour is left where nothing is opaque.
        Alpha::Opacity => 0.0,
    };
    for (out, &c) in out.iter_mut().zip(&color[..n - 1]) {
        *out = T::encode(c * scale, encoding.linear_light);
    }
    out[n - 1] = T::encode(alpha, false);
}

/// Copies to each texel from `first` on the texel that `nearest` names, if it is another.
pub(super) fn copy_padding(image: &mut Image, first: usize, nearest: &[u32]) {
    fn run<T: Copy>(samples: &mut [T], channels: usize, first: usize, nearest: &[u32]) {
        for (i, &from) in nearest.iter().enumerate() {
            let to = first + i;
            if from != NONE && from as usize != to {
                let from = from as usize * channels;
                samples.copy_within(from..from + channels, to * channels);
            }
        }
    }
    let channels = image.channels as usize;
    match &mut image.pixels {
        Pixels::U8(v) => run(v, channels, first, nearest),
        Pixels::U16(v) => run(v, channels, first, nearest),
        Pixels::F32(v) => run(v, channels, first, nearest),
    }
}
