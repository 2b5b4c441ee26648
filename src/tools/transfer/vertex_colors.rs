//! Colours of vertices as a layer: interpolated over the triangles of the source.

use rayon::prelude::*;

use super::color::srgb_to_linear;
use super::footprint::Footprint;
use super::mip::{Alpha, Encoding};
use crate::geometry::{Mesh, NONE};

/// Footprints of one parallel task.
const TASK: usize = 4096;

/// Decoded, premultiplied colours of the vertices of each triangle.
pub(super) struct VertexColors<'a> {
    mesh: &'a Mesh,
    colors: Vec<[f32; 4]>,
}

impl<'a> VertexColors<'a> {
    pub(super) fn new(mesh: &'a Mesh, colors: &[[f32; 4]], encoding: Encoding) -> Self {
        let decode = |&[r, g, b, a]: &[f32; 4]| {
            let weight = if encoding.alpha == Alpha::Opacity { a } else { 1.0 };
            let [r, g, b] = [r, g, b].map(|c| weight * if encoding.linear_light { srgb_to_linear(c) } else { c });
            [r, g, b, a]
        };
        Self { mesh, colors: colors.iter().map(decode).collect() }
    }

    /// The colours at the centres of footprints in the table of vertices: their texture coordinates
    /// are barycentric.
    /// `out` gets `channels` (3 or 4) values a footprint. O(footprints).
    pub(super) fn sample(&self, channels: usize, footprints: &[Footprint], out: &mut [f32]) {
        let tasks = footprints.par_chunks(TASK).zip(out.par_chunks_mut(TASK * channels));
        tasks.for_each(|(footprints, out)| {
            for (f, out) in footprints.iter().zip(out.chunks_exact_mut(channels)) {
                if f.face == NONE {
                    continue;
                }
                // A vertex that the file repeats may have two colours: the file's corners count.
                let corners = self.mesh.file_triangle_corners(f.face as usize);
                let [a, b, c] = corners.map(|c| self.colors[c.vertex as usize]);
                let [s, t] = f.centre;
                for (k, out) in out.iter_mut().enumerate() {
                    *out = a[k] + s * (b[k] - a[k]) + t * (c[k] - a[k]);
                }
                if channels == 3 {
                    continue;
                }
                out[3] = out[3].clamp(0.0, 1.0);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn colours_are_linear_over_a_triangle() {
        let mesh = Mesh::of_triangles("one", vec![DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]]);
        let colors = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.5]];
        let at = |s, t| Footprint { centre: [s, t], face: 0, ..Footprint::NOWHERE };
        let footprints = [at(0.0, 0.0), at(0.25, 0.5), Footprint::NOWHERE];
        let layer = VertexColors::new(&mesh, &colors, Encoding::default());
        let mut out = [9.0; 12];
        layer.sample(4, &footprints, &mut out);
        // Weighted by opacity.
        assert_eq!(out, [1.0, 0.0, 0.0, 1.0, 0.25, 0.25, 0.25, 0.75, 9.0, 9.0, 9.0, 9.0]);
    }
}
