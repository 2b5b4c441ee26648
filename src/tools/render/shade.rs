//! Colours and light of the samples, and their average.

use std::collections::HashMap;

use glam::{DVec2, DVec3, Vec3};

use super::camera::Camera;
use super::raster::{Edges, Fragments};
use super::{Coloring, RenderOptions};
use crate::geometry::{Corner, Mesh, NONE, Placement, Wrap};
use crate::picture::{Image, Pixels, linear_to_srgb, srgb_to_linear};

/// Shown where there is no colour.
const GREY: [u8; 3] = [176, 176, 176];
/// Mip levels beyond this would mix neighbouring charts.
const MAX_LEVEL: usize = 3;

/// sRGB to linear light.
pub(super) fn linear(c: u8) -> f32 {
    srgb_to_linear(f32::from(c) / 255.0)
}

/// Linear light to sRGB.
pub(super) fn encode(c: f32) -> u8 {
    (linear_to_srgb(c.clamp(0.0, 1.0)) * 255.0 + 0.5) as u8
}

fn linear_color([r, g, b]: [u8; 3]) -> Vec3 {
    Vec3::new(linear(r), linear(g), linear(b))
}

/// A texture and its halved copies in linear light.
struct Mips(Vec<(usize, usize, Vec<Vec3>)>);

impl Mips {
    fn new(texture: &Image) -> Option<Self> {
        let (mut w, mut h) = (texture.width as usize, texture.height as usize);
        texture.check("texture").ok()?;
        let table: Vec<f32> = (0..=255).map(linear).collect();
        let light = |i: usize| match &texture.pixels {
            Pixels::U8(s) => table[usize::from(s[i])],
            Pixels::U16(_) => srgb_to_linear(texture.sample(i)),
            Pixels::F32(s) => s[i],
        };
        let channels = texture.channels as usize;
        let colours = if channels < 3 { [0; 3] } else { [0, 1, 2] };
        let mut texels: Vec<Vec3> = (0..w * h).map(|i| Vec3::from(colours.map(|c| light(i * channels + c)))).collect();
        let mut levels = Vec::new();
        while levels.len() < MAX_LEVEL && w > 1 && h > 1 {
            let (half_w, half_h) = (w / 2, h / 2);
            let half = (0..half_h)
                .flat_map(|y| (0..half_w).map(move |x| (x, y)))
                .map(|(x, y)| {
                    let i = 2 * y * w + 2 * x;
                    (texels[i] + texels[i + 1] + texels[i + w] + texels[i + w + 1]) * 0.25
                })
                .collect();
            levels.push((w, h, std::mem::replace(&mut texels, half)));
            (w, h) = (half_w, half_h);
        }
        levels.push((w, h, texels));
        Some(Self(levels))
    }

    /// Bilinear sample at the place `uv` of the picture, row 0 at v = 1.
    fn sample(&self, uv: DVec2, wrap: [Wrap; 2], level: usize) -> Vec3 {
        let (w, h, texels) = &self.0[level.min(self.0.len() - 1)];
        let x = uv.x * *w as f64 - 0.5;
        let y = (1.0 - uv.y) * *h as f64 - 0.5;
        let (i, j) = (x.floor(), y.floor());
        let (s, t) = ((x - i) as f32, (y - j) as f32);
        let at = |i: f64, j: f64| {
            let (i, j) = (wrap[0].texel(i as i64, *w as u32), wrap[1].texel(j as i64, *h as u32));
            texels[j as usize * w + i as usize]
        };
        at(i, j).lerp(at(i + 1.0, j), s).lerp(at(i, j + 1.0).lerp(at(i + 1.0, j + 1.0), s), t)
    }
}

/// Colours samples.
pub(super) struct Shader<'a> {
    mesh: &'a Mesh,
    coloring: Coloring<'a>,
    camera: Camera,
    options: &'a RenderOptions,
    normals: Vec<DVec3>,
    textures: Vec<Option<(Mips, Placement)>>,
}

impl<'a> Shader<'a> {
    pub(super) fn new(mesh: &'a Mesh, coloring: Coloring<'a>, camera: &Camera, options: &'a RenderOptions) -> Self {
        let textures = match coloring {
            Coloring::Texture(t) => vec![Mips::new(t).map(|mips| (mips, Placement::default()))],
            Coloring::Materials(all) => {
                all.iter().map(|t| t.and_then(|t| Some((Mips::new(t.image)?, t.placement)))).collect()
            }
            _ => Vec::new(),
        };
        let normals = if options.lighting { smooth_normals(mesh) } else { Vec::new() };
        Self { mesh, coloring, camera: *camera, options, normals, textures }
    }

    /// Averages the samples of a band into its pixels.
    pub(super) fn resolve(&self, fragments: &Fragments, projected: &[DVec3], pixels: &mut [u8], depths: &mut [f32]) {
        let n = self.options.supersampling as usize;
        let width = fragments.width / n;
        let [br, bg, bb, ba] = self.options.background;
        let back = linear_color([br, bg, bb]);
        let opacity = f32::from(ba) / 255.0;
        for (i, (pixel, depth)) in pixels.chunks_exact_mut(4).zip(depths).enumerate() {
            let (x, y) = (i % width, i / width);
            let mut sum = Vec3::ZERO;
            let mut covered = 0.0;
            // Samples of a pixel mostly see the same triangle: its set-up is kept.
            let mut last: Option<(u32, Facet)> = None;
            for k in 0..n * n {
                let (sx, sy) = (x * n + k % n, y * n + k / n);
                let s = sy * fragments.width + sx;
                let t = fragments.triangle[s];
                if t == NONE {
                    continue;
                }
                *depth = depth.min(fragments.depth[s]);
                if last.as_ref().is_none_or(|l| l.0 != t) {
                    last = self.facet(t, projected).map(|f| (t, f));
                }
                if let Some((_, facet)) = &last {
                    let at = DVec2::new(sx as f64 + 0.5, (fragments.first_row + sy) as f64 + 0.5);
                    sum += self.color(facet, at);
                    covered += 1.0;
                }
            }
            if covered == 0.0 {
                continue;
            }
            let share = covered / (n * n) as f32;
            let alpha = share + (1.0 - share) * opacity;
            let color = (sum / covered * share + back * ((1.0 - share) * opacity)) / alpha;
            for (p, c) in pixel.iter_mut().zip([color.x, color.y, color.z].map(encode)) {
                *p = c;
            }
            pixel[3] = (alpha * 255.0 + 0.5) as u8;
        }
    }

    fn facet(&self, t: u32, projected: &[DVec3]) -> Option<Facet> {
        let vertices = self.mesh.triangle(t as usize);
        let p = vertices.map(|v| projected[v as usize]);
        let flat = p.map(DVec3::truncate);
        let edges = Edges::new(flat)?;
        let material = match self.coloring {
            Coloring::Materials(_) => self.mesh.triangle_material(t as usize) as usize,
            _ => 0,
        };
        let texture = self.textures.get(material).and_then(Option::as_ref);
        let placed = texture.and_then(|(mips, placement)| {
            let bare = || ((mips.0[0].0, mips.0[0].1) == (1, 1)).then_some([DVec2::ZERO; 3]);
            let uv = self.mesh.triangle_texcoords(t as usize).or_else(bare)?;
            Some((mips, uv.map(|uv| placement.apply(uv))))
        });
        let usable = |uv: &[DVec2; 3]| uv.iter().all(|uv| uv.is_finite() && uv.abs().max_element() < 1e6);
        let texture = placed.filter(|(_, uv)| usable(uv)).map(|(mips, uv)| {
            // The level at which a sample covers about one texel, by the ratio of areas.
            let (w, h, _) = &mips.0[0];
            let texels = ((uv[1] - uv[0]).perp_dot(uv[2] - uv[0])).abs() * (*w * *h) as f64;
            let samples = (flat[1] - flat[0]).perp_dot(flat[2] - flat[0]).abs();
            let level = 0.5 * (texels / samples).max(1.0).log2() + 0.25;
            (material, uv, level as usize)
        });
        // Heights of the corners over their opposite edges, in samples: turns barycentrics into
        // distances for the wireframe. Where every sample sees another triangle, what is not needed
        // must not be computed.
        let heights = if self.options.wireframe {
            let area = (flat[1] - flat[0]).perp_dot(flat[2] - flat[0]).abs();
            let drawn = outer_edges(self.mesh, t as usize);
            let height = |k: usize| area / flat[(k + 1) % 3].distance(flat[(k + 2) % 3]);
            [0, 1, 2].map(|k| if drawn[k] { height(k) } else { f64::INFINITY })
        } else {
            [0.0; 3]
        };
        // Vertices that the file repeats may have normals and colours of their own.
        let corners = self.mesh.file_triangle_corners(t as usize);
        let own = |c: &Corner| self.mesh.normals.get(c.normal as usize).and_then(|n| n.try_normalize());
        let wanted = self.options.lighting && !self.mesh.normals.is_empty();
        let normals = match wanted.then(|| [0, 1, 2].map(|k| own(&corners[k]))) {
            Some([Some(a), Some(b), Some(c)]) => Some([a, b, c]),
            _ => None,
        };
        Some(Facet {
            front: edges.front(),
            edges,
            vertices,
            file_vertices: corners.map(|c| c.vertex),
            normals,
            weights: p.map(|p| self.camera.inverse_distance(p.z)),
            texture,
            heights,
        })
    }

    fn color(&self, facet: &Facet, at: DVec2) -> Vec3 {
        let flat = facet.edges.barycentric(at);
        let w = [0, 1, 2].map(|k| flat[k] * facet.weights[k]);
        let sum = w[0] + w[1] + w[2];
        let b = w.map(|w| w / sum);
        let mut color = match self.coloring {
            Coloring::Plain(c) => linear_color(c),
            Coloring::Vertices(colors) => (0..3)
                .map(|k| {
                    let color = colors.get(facet.file_vertices[k] as usize).copied();
                    linear_color(color.unwrap_or(GREY)) * b[k] as f32
                })
                .sum(),
            Coloring::Texture(_) | Coloring::Materials(_) => match &facet.texture {
                Some((material, uv, level)) => {
                    let uv = uv[0] * b[0] + uv[1] * b[1] + uv[2] * b[2];
                    self.textures[*material].as_ref().map_or(linear_color(GREY), |(t, p)| t.sample(uv, p.wrap, *level))
                }
                None => linear_color(GREY),
            },
        };
        if self.options.lighting {
            let smooth = |k: usize| self.normals[facet.vertices[k] as usize];
            let n: DVec3 = (0..3).map(|k| facet.normals.map_or_else(|| smooth(k), |n| n[k]) * b[k]).sum();
            color = self.light(color, n.normalize_or(self.camera.back), facet.front);
        }
        if self.options.wireframe {
            let distance = (0..3).map(|k| flat[k].max(0.0) * facet.heights[k]).fold(f64::INFINITY, f64::min);
            let width = 0.45 * f64::from(self.options.supersampling);
            let line = (1.0 - (distance - width).max(0.0)).clamp(0.0, 1.0) as f32;
            color = color.lerp(Vec3::new(0.02, 0.03, 0.05), 0.75 * line);
        }
        color
    }

    /// Sky and ground light, a key light from the upper left, a fill from the right and a faint
    /// edge light.
    fn light(&self, color: Vec3, normal: DVec3, front: bool) -> Vec3 {
        let camera = &self.camera;
        let n = DVec3::new(normal.dot(camera.right), normal.dot(camera.up), normal.dot(camera.back));
        let n = if front { n } else { -n };
        let lambert = |d: DVec3, wrap: f64| ((n.dot(d.normalize()) + wrap) / (1.0 + wrap)).max(0.0);
        let key = lambert(DVec3::new(-0.45, 0.65, 0.75), 0.25);
        let fill = lambert(DVec3::new(0.8, 0.1, 0.4), 0.3);
        let sky = 0.5 + 0.5 * n.y;
        let edge = (1.0 - n.z.clamp(0.0, 1.0)).powi(4);
        let strength = 0.22 + 0.14 * sky + 0.62 * key * key.sqrt() + 0.16 * fill;
        let half = DVec3::new(-0.45, 0.65, 1.75).normalize();
        let gloss = n.dot(half).max(0.0).powi(40) * 0.05 + edge * 0.035 * sky;
        let lit = color * strength as f32 + Vec3::splat(gloss as f32);
        if front { lit } else { lit * 0.35 }
    }
}

/// Which sides of a triangle are sides of its polygon, by the corner opposite; the others are
/// diagonals. All of a piece that was cut off along another face's vertices.
fn outer_edges(mesh: &Mesh, t: usize) -> [bool; 3] {
    let polygon = mesh.polygon(mesh.triangle_polygon(t) as usize);
    if polygon.len() <= 3 || t >= mesh.file_triangle_count() {
        return [true; 3];
    }
    let corners = mesh.triangle(t);
    let side = |a: u32, b: u32| {
        let next = |i: usize| polygon[(i + 1) % polygon.len()].vertex;
        (0..polygon.len()).any(|i| matches!((polygon[i].vertex, next(i)), p if p == (a, b) || p == (b, a)))
    };
    [0, 1, 2].map(|k| side(corners[(k + 1) % 3], corners[(k + 2) % 3]))
}

/// What the samples of a triangle share.
struct Facet {
    edges: Edges,
    front: bool,
    vertices: [u32; 3],
    /// The same in the file, where it repeats them.
    file_vertices: [u32; 3],
    /// Unit normals of the corners, if the file has them.
    normals: Option<[DVec3; 3]>,
    weights: [f64; 3],
    texture: Option<(usize, [DVec2; 3], usize)>,
    heights: [f64; 3],
}

/// Normals by the angles of the triangles around, over all vertices at the same place, so that
/// files that split vertices at seams look smooth.
fn smooth_normals(mesh: &Mesh) -> Vec<DVec3> {
    let mut place: HashMap<[u64; 3], usize> = HashMap::with_capacity(mesh.vertex_count());
    let representative: Vec<usize> = mesh
        .positions
        .iter()
        .enumerate()
        // Adding zero makes the two zeros one place.
        .map(|(v, p)| *place.entry(p.to_array().map(|c| (c + 0.0).to_bits())).or_insert(v))
        .collect();
    let mut sums = vec![DVec3::ZERO; mesh.vertex_count()];
    for t in 0..mesh.triangle_count() {
        let p = mesh.triangle_positions(t);
        let normal = (p[1] - p[0]).cross(p[2] - p[0]).normalize_or_zero();
        if !normal.is_finite() {
            continue;
        }
        for (k, v) in mesh.triangle(t).into_iter().enumerate() {
            let (a, b) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
            let angle = a.cross(b).length().atan2(a.dot(b));
            if angle.is_finite() {
                sums[representative[v as usize]] += normal * angle;
            }
        }
    }
    representative.into_iter().map(|r| sums[r].normalize_or_zero()).collect()
}
