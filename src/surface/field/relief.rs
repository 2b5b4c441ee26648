//! Normals as coordinates: what keeps a relaxation on the right side of a fold and on the right
//! slope of a bump.
//!
//! The closest point alone lets images slide along the source. Where the target, bent as its images
//! lie in space, faces another way than the source there, the image is at the wrong place; so
//! normals are compared as well (as in non-rigid registration); what that gains stands in
//! docs/methods.md.

use glam::DVec3;
use rayon::prelude::*;

use super::closest::{Closest, FLAT, Normal};
use crate::surface::vector::Vector;

/// How much a turn by a radian counts, in parts of the error to be expected of a prediction: where
/// predictions are poor, normals may move images far, and where they are good, the little by which
/// two shapes differ must not.
const WEIGHT: f64 = 2.0;

/// The normals of a source, and how those of a target are compared with them.
#[derive(Clone, Debug)]
pub(super) struct Relief {
    /// Of each vertex of the source, weighted.
    pub(super) source: Vec<Normal>,
    weight: f64,
    /// -1 for a mirror image.
    sign: f64,
}

impl Relief {
    /// `error` is that of the images, in their frame.
    /// Zero for one that compares nothing.
    pub(super) fn new(positions: &[DVec3], triangles: &[[u32; 3]], error: f64) -> Self {
        let weight = WEIGHT * error;
        let source = normals(positions, triangles, weight);
        Self { source, weight, sign: 1.0 }
    }

    /// Learns from the first closest points whether the pair is mirrored. Surfaces whose normals
    /// agree nowhere (triangles that are not oriented alike) get none.
    pub(super) fn orient(&mut self, target: &[Normal], closest: &[Option<Closest>], triangles: &[[u32; 3]]) {
        let (mut sum, mut total) = (0.0, 0.0);
        for (n, c) in target.iter().zip(closest) {
            let Some(c) = c else { continue };
            let corner = triangles[c.face as usize].map(|v| self.source[v as usize]);
            let agreement: f64 = (0..3).map(|k| n[k] * (0..3).map(|i| c.x[i] * corner[i][k]).sum::<f64>()).sum();
            sum += agreement;
            total += agreement.abs();
        }
        self.sign = if sum < 0.0 { -1.0 } else { 1.0 };
        if sum.abs() < 0.5 * total {
            self.weight = 0.0;
            self.source.fill(FLAT);
        }
    }

    /// The weighted normals of the target bent so that its vertices lie at the part of `z` in
    /// space.
    pub(super) fn of<const K: usize>(&self, z: &[Vector<f64, K>], triangles: &[[u32; 3]]) -> Vec<Normal> {
        const { assert!(K >= 4) };
        let positions: Vec<DVec3> = z.par_iter().map(|z| DVec3::new(z[K - 4], z[K - 3], z[K - 2])).collect();
        normals(&positions, triangles, self.sign * self.weight)
    }
}

/// Normals of vertices, by area, of length `weight`; zero where triangles have no area.
fn normals(positions: &[DVec3], triangles: &[[u32; 3]], weight: f64) -> Vec<Normal> {
    let mut sums = vec![DVec3::ZERO; positions.len()];
    for t in triangles {
        let [a, b, c] = t.map(|v| positions[v as usize]);
        let area = (b - a).cross(c - a);
        t.iter().for_each(|&v| sums[v as usize] += area);
    }
    let weighted = |n: DVec3| {
        let n = n.normalize_or_zero() * weight;
        [n.x, n.y, n.z, 0.0]
    };
    sums.into_iter().map(weighted).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::shapes::lobed_sphere;

    #[test]
    fn mirror_images_are_told_and_soups_have_no_normals() {
        let mesh = lobed_sphere(2, 0.2);
        let triangles = mesh.triangles().to_vec();
        let own: Vec<Option<Closest>> = (0..mesh.vertex_count() as u32)
            .map(|v| {
                let face = triangles.iter().position(|t| t.contains(&v)).unwrap();
                let x = triangles[face].map(|w| f64::from(u8::from(w == v)));
                Some(Closest { face: face as u32, x, distance_squared: 0.0 })
            })
            .collect();
        let images = |mirror: f64| -> Vec<Vector<f64, 4>> {
            mesh.positions.iter().map(|p| [mirror * p.x, p.y, p.z, 0.0]).collect()
        };
        for mirror in [1.0, -1.0] {
            // The source is the image itself, its triangles turned where it is mirrored.
            let positions: Vec<DVec3> = images(mirror).iter().map(|z| DVec3::new(z[0], z[1], z[2])).collect();
            let oriented: Vec<[u32; 3]> =
                triangles.iter().map(|t| if mirror < 0.0 { [t[0], t[2], t[1]] } else { *t }).collect();
            let mut relief = Relief::new(&positions, &oriented, 0.05);
            relief.orient(&relief.of(&images(mirror), &triangles), &own, &triangles);
            for (n, m) in relief.of(&images(mirror), &triangles).iter().zip(&relief.source) {
                assert!((0..3).all(|k| (n[k] - m[k]).abs() < 1e-12), "{n:?} {m:?}");
                assert!((n.iter().map(|x| x * x).sum::<f64>().sqrt() - 0.1).abs() < 1e-12);
            }
        }
        // Every other triangle turned round: what is left says nothing.
        let soup: Vec<[u32; 3]> =
            triangles.iter().enumerate().map(|(i, t)| if i % 2 == 0 { [t[0], t[2], t[1]] } else { *t }).collect();
        let mut relief = Relief::new(&mesh.positions, &soup, 0.05);
        relief.orient(&relief.of(&images(1.0), &triangles), &own, &triangles);
        assert!(relief.source.iter().all(|n| *n == FLAT));
        assert!(relief.of(&images(1.0), &triangles).iter().flatten().all(|x| *x == 0.0));
    }
}
