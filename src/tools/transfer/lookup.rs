//! What layers look up on the source: its triangles with texture coordinates as the layer's
//! pictures lie on them.
//!
//! Layers whose pictures lie alike share a table, and so the footprints of texels. Others have
//! tables of their own.

use std::borrow::Cow;

use super::layer::Layer;
use super::tables::{Shown, SourceTriangle, source_triangles, vertex_triangles};
use crate::error::Result;
use crate::geometry::{Mesh, NONE, Placement};

/// Texture coordinates of the source for some layers.
pub(super) struct Lookup<'a> {
    /// The source with the places in the pictures as texture coordinates.
    pub(super) mesh: Cow<'a, Mesh>,
    pub(super) table: Vec<SourceTriangle>,
    /// Whether pictures are tiles.
    pub(super) tiled: bool,
    ways: Ways,
}

/// How pictures lie on a source.
#[derive(Clone, Debug, PartialEq)]
enum Ways {
    /// There are none: vertices have colours.
    Vertices,
    /// On the texture coordinates as they are. Triangles without show a picture of one colour, or
    /// nothing.
    Plain { tiled: bool, bare: Vec<u32> },
    /// Each triangle in its own way.
    Placed { ways: Vec<Placement>, bare: Vec<u32> },
}

impl Ways {
    fn of(layer: &Layer<'_>, source: &Mesh, texture_of: &[u32]) -> Self {
        if layer.vertices.is_some() {
            return Self::Vertices;
        }
        let picture = |t: usize| layer.images.get(texture_of[t] as usize);
        let one_texel = |t: usize| picture(t).is_some_and(|i| (i.width, i.height) == (1, 1));
        let bare = (0..texture_of.len()).filter(|&t| one_texel(t) && source.triangle_texcoords(t).is_none());
        let bare = bare.map(|t| t as u32).collect();
        let tiled = layer.face_texture.is_some();
        if tiled || layer.placements.iter().all(|p| *p == Placement::default()) {
            return Self::Plain { tiled, bare };
        }
        let way = |&k: &u32| if k == NONE { Placement::default() } else { layer.placement(k) };
        Self::Placed { ways: texture_of.iter().map(way).collect(), bare }
    }
}

/// The tables of all layers, and the number of each layer's.
///
/// # Errors
/// As [`source_triangles`].
pub(super) fn lookups<'a>(source: &'a Mesh, layers: &[Layer<'_>]) -> Result<(Vec<Lookup<'a>>, Vec<usize>)> {
    let mut lookups: Vec<Lookup<'a>> = Vec::new();
    let mut numbers = Vec::with_capacity(layers.len());
    for layer in layers {
        let texture_of = layer.texture_of(source);
        let ways = Ways::of(layer, source, &texture_of);
        if let Some(known) = lookups.iter().position(|l| l.ways == ways) {
            numbers.push(known);
            continue;
        }
        numbers.push(lookups.len());
        lookups.push(Lookup::new(source, layer, &texture_of, ways)?);
    }
    Ok((lookups, numbers))
}

impl<'a> Lookup<'a> {
    fn new(source: &'a Mesh, layer: &Layer<'_>, texture_of: &[u32], ways: Ways) -> Result<Self> {
        let mut mesh = Cow::Borrowed(source);
        if let Ways::Placed { ways, .. } = &ways
            && ways.iter().any(|w| !w.keeps_coordinates())
        {
            // Triangles of a polygon have one material, and so one way.
            let mut of_polygon = vec![Placement::default(); source.polygon_count()];
            for (t, way) in ways.iter().enumerate() {
                of_polygon[source.triangle_polygon(t) as usize] = *way;
            }
            mesh.to_mut().map_texcoords(|p, uv| of_polygon[p].apply(uv));
        }
        let tiled = layer.face_texture.is_some();
        let shown = |t: usize| {
            let k = texture_of[t];
            let image = layer.images.get(k as usize).or(layer.images.first());
            Shown {
                size: image.map_or([1; 2], |i| [i.width, i.height]),
                wrap: if k == NONE { Placement::default().wrap } else { layer.placement(k).wrap },
                plain: k != NONE && image.is_some_and(|i| (i.width, i.height) == (1, 1)),
            }
        };
        let table = match &ways {
            Ways::Vertices => vertex_triangles(source)?,
            _ => source_triangles(&mesh, tiled, shown)?,
        };
        Ok(Self { mesh, table, tiled, ways })
    }

    /// Whether its texture coordinates are places in pictures.
    pub(super) fn has_pictures(&self) -> bool {
        self.ways != Ways::Vertices
    }

    /// How triangle `t` shows its picture.
    pub(super) fn placement(&self, t: usize) -> Placement {
        match &self.ways {
            Ways::Placed { ways, .. } => ways[t],
            _ => Placement::default(),
        }
    }
}
