//! Flat meshes with texture coordinates, simple maps between them, and noise.

use barymap::Result;
use barymap::geometry::{Corner, Mesh, MeshBuilder, NONE};
use barymap::picture::{Image, Pixels};
use barymap::surface::{PackedImage, PackedPoint, PointMap, Status};
use glam::{DVec2, DVec3};

/// Numbers without a crate: splitmix64.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub(crate) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// A mesh whose corners have their own vertices and texture coordinates.
pub(crate) fn soup(triangles: &[[[f64; 2]; 3]]) -> Mesh {
    let mut b = MeshBuilder::new("soup");
    for t in triangles {
        let first = b.mesh.texcoords.len() as u32;
        for p in t {
            b.mesh.texcoords.push(DVec2::new(p[0], p[1]));
            b.mesh.positions.push(DVec3::new(p[0], p[1], 0.0));
        }
        b.polygon((first..first + 3).map(|i| Corner { vertex: i, texcoord: i, normal: NONE }));
    }
    b.build().unwrap()
}

/// A grid of `n` x `n` squares with jittered inner points, in texture coordinates and space alike.
pub(crate) fn grid(n: usize, jitter: f64, seed: u64) -> Mesh {
    let mut r = Random(seed);
    let mut b = MeshBuilder::new("grid");
    for j in 0..=n {
        for i in 0..=n {
            let inner = i > 0 && j > 0 && i < n && j < n;
            let mut at = |k: usize| {
                let d = (r.unit() - 0.5) * jitter;
                (k as f64 + if inner { d } else { 0.0 }) / n as f64
            };
            let p = DVec2::new(at(i), at(j));
            b.mesh.texcoords.push(p);
            b.mesh.positions.push(DVec3::new(p.x, p.y, 0.0));
        }
    }
    let id = |i: usize, j: usize| (j * (n + 1) + i) as u32;
    for j in 0..n {
        for i in 0..n {
            let q = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
            for t in [[q[0], q[1], q[2]], [q[0], q[2], q[3]]] {
                b.polygon(t.map(|v| Corner { vertex: v, texcoord: v, normal: NONE }));
            }
        }
    }
    b.build().unwrap()
}

/// Every point is its own image.
pub(crate) struct Identity;

impl PointMap for Identity {
    fn map(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> Result<()> {
        images.clear();
        images.extend(points.iter().map(|p| PackedImage {
            face: p.face,
            b0: p.b0,
            b1: p.b1,
            confidence: 1.0,
            status: Status::Valid as u32,
        }));
        Ok(())
    }
}

/// A function of the unit square from a flat target to a flat source, both with their texture
/// coordinates as positions.
pub(crate) struct Planar<'a, F> {
    pub(crate) source: &'a Mesh,
    pub(crate) target: &'a Mesh,
    pub(crate) function: F,
}

impl<F: Fn(DVec2) -> (DVec2, Status) + Sync> PointMap for Planar<'_, F> {
    fn map(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> Result<()> {
        images.clear();
        for p in points {
            let at = p.unpack().position(self.target).truncate();
            let (q, status) = (self.function)(at);
            let found = (0..self.source.triangle_count()).find_map(|t| {
                let [a, b, c] = self.source.triangle_positions(t).map(|p| p.truncate());
                let area = (b - a).perp_dot(c - a);
                let w = [(b - q).perp_dot(c - q) / area, (c - q).perp_dot(a - q) / area];
                (w[0] >= -1e-9 && w[1] >= -1e-9 && w[0] + w[1] <= 1.0 + 1e-9).then_some((t as u32, w))
            });
            images.push(match found {
                Some((face, b)) => {
                    PackedImage { face, b0: b[0] as f32, b1: b[1] as f32, confidence: 1.0, status: status as u32 }
                }
                None => PackedImage::NOWHERE,
            });
        }
        Ok(())
    }
}

pub(crate) fn noise(width: u32, height: u32, channels: u32, seed: u64) -> Image {
    let mut r = Random(seed);
    let samples = (0..width * height * channels).map(|_| r.next() as u8).collect();
    Image::new(width, height, channels, Pixels::U8(samples)).expect("picture")
}
