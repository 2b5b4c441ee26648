//! Texture transfer: exact coverage, padding and mip chains; footprints; whole transfers through simple maps.

mod atlas;
mod cases;
mod filter;
mod pictures;
mod real;
mod whole;

use barymap::geometry::{Corner, Mesh, MeshBuilder, NONE};
use glam::{DVec2, DVec3};

/// Numbers without a crate: splitmix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// A mesh whose corners have their own vertices and texture coordinates.
fn soup(triangles: &[[[f64; 2]; 3]]) -> Mesh {
    let mut b = MeshBuilder::new("soup");
    for t in triangles {
        let first = b.mesh.texcoords.len() as u32;
        for p in t {
            b.mesh.texcoords.push(DVec2::new(p[0], p[1]));
            b.mesh.positions.push(DVec3::new(p[0], p[1], 0.0));
        }
        b.polygon((first..first + 3).map(|i| Corner { vertex: i, texcoord: i, normal: NONE }));
    }
    b.build()
}

/// A grid of `n` x `n` squares with jittered inner points, in texture coordinates and space alike.
fn grid(n: usize, jitter: f64, seed: u64) -> Mesh {
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
    b.build()
}
