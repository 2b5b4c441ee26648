//! A character: mesh, parameters, texture.

use std::collections::HashMap;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::atlas::{Atlas, AtlasStyle};
use super::body::Body;
use super::cage::Cage;
use super::cast;
use super::paint;
use super::sampling::{Sampled, Sampling, quad_lengths};
use super::subdivision::{BaseSurface, Parameter};
use crate::geometry::{Corner, Mesh, MeshBuilder, NONE, SurfacePoint};
use crate::picture::{Image, Pixels};

/// Texels around the charts that continue the picture.
const PADDING: usize = 12;
/// Texels along a side of a texture at most.
const MAX_SIZE: u32 = 16_384;

/// A character with texture coordinates and known parameters.
#[derive(Clone, Debug)]
pub struct Character {
    /// The mesh: closed, of genus 0, in metres, y up, facing about +z.
    pub mesh: Mesh,
    /// Place of each vertex on the neutral body, which stands straight with its arms out to the
    /// sides: colours and distances between landmarks are defined there.
    pub neutral: Vec<DVec3>,
    /// Chart of each triangle.
    pub charts: Vec<u32>,
    sampled: Sampled,
}

impl Character {
    /// The character of `body` cut by `sampling`, with an atlas of `style`.
    pub(super) fn new(body: &Body, sampling: &Sampling, style: AtlasStyle) -> Self {
        let cage = Cage::new();
        let surface = BaseSurface::new(&cage.quads, &body.control_positions(&cage));
        let neutral = BaseSurface::new(&cage.quads, &cast::neutral().control_positions(&cage));
        let sampled = Sampled::new(&cage, &surface, sampling);
        let lengths: Vec<_> = (0..cage.quads.len()).map(|q| quad_lengths(&surface, q as u32)).collect();
        let atlas = Atlas::new(&cage, &lengths, style);

        let mut builder = MeshBuilder::new(body.name);
        builder.mesh.positions = sampled.positions(&surface);
        // A vertex has one texture coordinate per place of the atlas it lies at.
        let mut known: HashMap<(u32, [i64; 2]), u32> = HashMap::new();
        let mut charts = Vec::with_capacity(sampled.triangles.len());
        for (t, (triangle, corners)) in sampled.triangles.iter().zip(&sampled.corners).enumerate() {
            let quad = sampled.quad_of(t as u32);
            charts.push(atlas.charts[quad as usize]);
            let texcoords = &mut builder.mesh.texcoords;
            let corners = [0, 1, 2].map(|k| {
                let uv = atlas.texcoord(quad, corners[k]);
                let key = (triangle[k], (uv * 1e9).round().to_array().map(|x| x as i64));
                let texcoord = *known.entry(key).or_insert_with(|| {
                    texcoords.push(uv);
                    texcoords.len() as u32 - 1
                });
                Corner { vertex: triangle[k], texcoord, normal: NONE }
            });
            builder.polygon(corners);
        }
        Self { mesh: builder.finish(), neutral: sampled.positions(&neutral), charts, sampled }
    }

    /// The parameters of a point of the mesh: equal parameters are corresponding points of any two
    /// characters.
    pub fn parameter(&self, point: &SurfacePoint) -> Parameter {
        self.sampled.parameter(point)
    }

    /// The point of the mesh with the given parameters. Exact: parameters are linear on each
    /// triangle.
    pub fn locate(&self, parameter: Parameter) -> SurfacePoint {
        self.sampled.locate(parameter)
    }

    /// Parameters of vertex `v`.
    pub fn vertex_parameter(&self, v: usize) -> Parameter {
        self.sampled.parameters[v]
    }

    /// The painted texture of `size` by `size` texels (16 to 16,384), 8-bit RGBA, opaque, row 0 at
    /// v = 1. Each texel is the mean of four samples. O(size^2), in parallel; the same bytes for
    /// any number of threads.
    pub fn texture(&self, size: u32) -> Image {
        let size = size.clamp(16, MAX_SIZE) as usize;
        let owner = self.owners(size);
        let affine: Vec<[DVec3; 3]> = (0..self.mesh.triangle_count()).map(|t| self.texel_map(t, size)).collect();
        let mut samples = [148, 140, 132, 255].repeat(size * size);
        samples.par_chunks_mut(4 * size).enumerate().for_each(|(y, row)| {
            for x in 0..size {
                let t = owner[y * size + x];
                if t == NONE {
                    continue;
                }
                let [origin, dx, dy] = affine[t as usize];
                let mut sum = DVec3::ZERO;
                for k in 0..4 {
                    let (sx, sy) = (f64::from(k % 2) / 2.0 + 0.25, f64::from(k / 2) / 2.0 + 0.25);
                    let p = origin + dx * (x as f64 + sx) + dy * (y as f64 + sy);
                    sum += paint::color(p);
                }
                let c = (sum / 4.0 * 255.0 + 0.5).clamp(DVec3::ZERO, DVec3::splat(255.0));
                row[4 * x..4 * x + 3].copy_from_slice(&[c.x as u8, c.y as u8, c.z as u8]);
            }
        });
        Image { width: size as u32, height: size as u32, channels: 4, pixels: Pixels::U8(samples) }
    }

    /// Neutral position as an affine function of the texel coordinates (x right, y down) on
    /// triangle `t`.
    fn texel_map(&self, t: usize, size: usize) -> [DVec3; 3] {
        let p = self.mesh.triangle(t).map(|v| self.neutral[v as usize]);
        let [a, b, c] = self.texel_corners(t, size);
        let area = (b - a).perp_dot(c - a);
        let (e, f) = (p[1] - p[0], p[2] - p[0]);
        let dx = (e * (c - a).y - f * (b - a).y) / area;
        let dy = (f * (b - a).x - e * (c - a).x) / area;
        [p[0] - dx * a.x - dy * a.y, dx, dy]
    }

    fn texel_corners(&self, t: usize, size: usize) -> [DVec2; 3] {
        let uv = self.mesh.triangle_texcoords(t).unwrap_or_default();
        uv.map(|uv| DVec2::new(uv.x, 1.0 - uv.y) * size as f64)
    }

    /// The triangle that colours each texel: the one over its centre, around the charts that of the
    /// nearest such texel.
    fn owners(&self, size: usize) -> Vec<u32> {
        let mut owner = vec![NONE; size * size];
        let mut frontier = Vec::new();
        for t in 0..self.mesh.triangle_count() {
            let [a, b, c] = self.texel_corners(t, size);
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            let area = (b - a).perp_dot(c - a);
            let last = size as f64 - 1.0;
            let range =
                |low: f64, high: f64| (low - 0.5).ceil().max(0.0) as usize..=(high - 0.5).floor().min(last) as usize;
            if high.x < 0.5 || high.y < 0.5 || area == 0.0 {
                continue;
            }
            for y in range(low.y, high.y) {
                for x in range(low.x, high.x) {
                    let p = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                    let w = [
                        (b - p).perp_dot(c - p) / area,
                        (c - p).perp_dot(a - p) / area,
                        (a - p).perp_dot(b - p) / area,
                    ];
                    let i = y * size + x;
                    if owner[i] == NONE && w.iter().all(|w| *w >= -1e-12) {
                        owner[i] = t as u32;
                        frontier.push(i);
                    }
                }
            }
        }
        frontier.sort_unstable();
        for _ in 0..PADDING {
            let mut next = Vec::new();
            for &i in &frontier {
                let (x, y) = (i % size, i / size);
                let beside = [
                    (x > 0).then(|| i - 1),
                    (x + 1 < size).then_some(i + 1),
                    (y > 0).then(|| i - size),
                    (y + 1 < size).then_some(i + size),
                ];
                for j in beside.into_iter().flatten() {
                    if owner[j] == NONE {
                        owner[j] = owner[i];
                        next.push(j);
                    }
                }
            }
            frontier = next;
        }
        owner
    }
}
