//! How texture coordinates stretch a surface, and how much of it they cut.

use glam::DVec2;

use super::islands::{Islands, orientation};
use crate::geometry::{Mesh, Topology};

/// Distortion of texture coordinates, weighted by area on the surface.
///
/// With the singular values s1 >= s2 of the map from surface to texture on a triangle, scaled so
/// that both have the same area in all: `angle` is (s1 / s2 + s2 / s1) / 2, and `stretch` max(s1, 1
/// / s2); both are 1 for an isometry.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distortion {
    /// Median of the angle distortion.
    pub angle_median: f64,
    /// 95th percentile of the angle distortion.
    pub angle_p95: f64,
    /// Median of the stretch.
    pub stretch_median: f64,
    /// 95th percentile of the stretch.
    pub stretch_p95: f64,
    /// Area in the texture over the area of the unit square.
    pub texture_area: f64,
}

/// The distortion over the triangles that have an area on the surface and in the texture. O(n log
/// n).
pub fn distortion(mesh: &Mesh) -> Distortion {
    let mut rows = Vec::new();
    let (mut area, mut texture_area) = (0.0, 0.0);
    for t in 0..mesh.triangle_count() {
        let Some(uv) = mesh.triangle_texcoords(t).filter(|uv| orientation(uv) != 0) else { continue };
        let [a, b, c] = mesh.triangle_positions(t);
        let surface = mesh.triangle_area(t);
        let x = b - a;
        let length = x.length();
        let (du, dv) = (uv[1] - uv[0], uv[2] - uv[0]);
        let in_texture = 0.5 * du.perp_dot(dv).abs();
        if !(surface > 0.0 && surface.is_finite() && length > 0.0 && in_texture > 0.0) {
            continue;
        }
        // Corners in the triangle's plane: (0, 0), (length, 0), (qx, qy).
        let (qx, qy) = ((c - a).dot(x) / length, 2.0 * surface / length);
        let ds: DVec2 = du / length;
        let dt: DVec2 = (dv - ds * qx) / qy;
        // Squares of the singular values are the eigenvalues of J^T J.
        let (e, f, g) = (ds.length_squared(), ds.dot(dt), dt.length_squared());
        let (mean, half) = (0.5 * (e + g), (0.25 * (e - g).powi(2) + f * f).sqrt());
        let s1 = (mean + half).sqrt();
        // Their product is the determinant; the difference would lose digits.
        let s2 = ds.perp_dot(dt).abs() / s1;
        area += surface;
        texture_area += in_texture;
        rows.push((s1, s2, surface));
    }
    if rows.is_empty() {
        return Distortion::default();
    }
    let scale = (area / texture_area).sqrt();
    let quantiles = |of: &dyn Fn(f64, f64) -> f64| {
        let mut values: Vec<(f64, f64)> = rows.iter().map(|&(s1, s2, w)| (of(s1 * scale, s2 * scale), w)).collect();
        values.sort_by(|a, b| a.0.total_cmp(&b.0));
        [0.5, 0.95].map(|q| {
            let mut left = q * area;
            let found = values.iter().find(|(_, w)| {
                left -= w;
                left <= 0.0
            });
            found.or(values.last()).map_or(1.0, |v| v.0)
        })
    };
    let [angle_median, angle_p95] = quantiles(&|s1, s2| 0.5 * (s1 / s2 + s2 / s1));
    let [stretch_median, stretch_p95] = quantiles(&|s1, s2| s1.max(1.0 / s2));
    Distortion { angle_median, angle_p95, stretch_median, stretch_p95, texture_area }
}

/// Length on the surface of the edges between two usable triangles over which the texture is cut.
pub fn seam_length(mesh: &Mesh, topology: &Topology, islands: &Islands) -> f64 {
    let mut sum = 0.0;
    for (t, neighbours) in topology.neighbours.iter().enumerate() {
        for (k, &n) in neighbours
            .iter()
            .enumerate()
            .filter(|(_, n)| **n as usize > t && (**n as usize) < topology.neighbours.len())
        {
            let ends = [1, 2].map(|d| mesh.triangle(t)[(k + d) % 3]);
            let texcoord = |t: usize, v: u32| {
                let uv = mesh.triangle_texcoords(t)?;
                topology.corner_of(t as u32, v).map(|c| uv[c])
            };
            let one_island = islands.island_of[t] == islands.island_of[n as usize];
            if !one_island || ends.iter().any(|&v| texcoord(t, v) != texcoord(n as usize, v)) {
                sum += mesh.positions[ends[0] as usize].distance(mesh.positions[ends[1] as usize]);
            }
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::shapes::{Diagonal, plane_grid, tube};
    use std::f64::consts::TAU;

    #[test]
    fn isometries_similarities_and_a_squeeze() {
        let mut mesh = plane_grid(6, 5, 3.0, 2.0, Diagonal::default());
        for (t, p) in mesh.texcoords.iter_mut().zip(&mesh.positions) {
            *t = DVec2::new(0.1 * p.x - 0.2 * p.y, 0.2 * p.x + 0.1 * p.y);
        }
        let d = distortion(&mesh);
        for value in [d.angle_median, d.angle_p95, d.stretch_median, d.stretch_p95] {
            assert!((value - 1.0).abs() < 1e-9, "{d:?}");
        }
        assert!((d.texture_area - 6.0 * 0.05).abs() < 1e-12);
        // Twice as long along one axis: s1 / s2 = 2, and s1 = sqrt 2 when the areas are equal.
        for t in &mut mesh.texcoords {
            t.x *= 2.0;
        }
        let d = distortion(&mesh);
        assert!((d.angle_median - 1.25).abs() < 1e-9 && (d.stretch_p95 - 2f64.sqrt()).abs() < 1e-9, "{d:?}");
    }

    #[test]
    fn a_tube_is_cut_along_its_height() {
        let mesh = tube(1.0, 3.0, 24, 6, Diagonal::default());
        let topology = Topology::new(&mesh);
        let islands = Islands::new(&mesh);
        assert!((seam_length(&mesh, &topology, &islands) - 3.0).abs() < 1e-9);
        assert!(TAU * 3.0 - mesh.area() < 0.1);
    }
}
