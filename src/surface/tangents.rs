//! Tangent planes of an embedded mesh at its vertices: limit stencils of Loop subdivision (paper,
//! section 3.2), with the boundary rules of Hoppe et al. 1994.

use std::f64::consts::PI;

use nalgebra::{DMatrix, SymmetricEigen};

use crate::geometry::Topology;

use super::vector::{Vector, add_scaled, dot, scaled, sub};

/// Below this sine of the angle between the two stencil vectors, or this length relative to the
/// longest ring edge, a stencil is degenerate.
const DEGENERATE: f64 = 1e-3;

/// Orthonormal bases (two rows) of the tangent planes at all vertices; O(n D).
///
/// A vertex whose triangles form no single fan, or whose stencil degenerates, gets the two main
/// directions of its neighbours instead; a vertex without neighbours gets the first two axes.
pub fn vertex_tangents<const D: usize>(topology: &Topology, points: &[Vector<f64, D>]) -> Vec<[Vector<f64, D>; 2]> {
    use rayon::prelude::*;
    (0..points.len()).into_par_iter().map(|v| vertex_tangent(topology, points, v as u32)).collect()
}

fn vertex_tangent<const D: usize>(topology: &Topology, points: &[Vector<f64, D>], v: u32) -> [Vector<f64, D>; 2] {
    let ring = topology.one_ring(v);
    let p: Vec<Vector<f64, D>> = ring.vertices.iter().map(|&w| sub(&points[w as usize], &points[v as usize])).collect();
    let longest = p.iter().map(|e| dot(e, e)).fold(0.0, f64::max).sqrt();
    let stencil = match (ring.fan, ring.boundary) {
        (true, false) => Some(interior(&p)),
        (true, true) => Some(boundary(&p)),
        _ => None,
    };
    stencil.and_then(|s| orthonormal(s, longest)).unwrap_or_else(|| main_directions(&p))
}

fn interior<const D: usize>(p: &[Vector<f64, D>]) -> [Vector<f64, D>; 2] {
    let k = p.len() as f64;
    let mut t = [[0.0; D]; 2];
    for (j, e) in p.iter().enumerate() {
        let (sin, cos) = (2.0 * PI * j as f64 / k).sin_cos();
        t = [add_scaled(&t[0], cos, e), add_scaled(&t[1], sin, e)];
    }
    t
}

fn boundary<const D: usize>(p: &[Vector<f64, D>]) -> [Vector<f64, D>; 2] {
    let k = p.len();
    let along = sub(&p[k - 1], &p[0]);
    let across = match k {
        2 => add_scaled(&p[0], 1.0, &p[1]),
        3 => p[1],
        _ => {
            let theta = PI / (k - 1) as f64;
            let ends = scaled(theta.sin(), &add_scaled(&p[0], 1.0, &p[k - 1]));
            (1..k - 1).fold(ends, |t, i| add_scaled(&t, (2.0 * theta.cos() - 2.0) * (i as f64 * theta).sin(), &p[i]))
        }
    };
    [along, across]
}

/// Gram-Schmidt; `None` for a degenerate pair.
fn orthonormal<const D: usize>(t: [Vector<f64, D>; 2], longest: f64) -> Option<[Vector<f64, D>; 2]> {
    let (a, b) = (dot(&t[0], &t[0]).sqrt(), dot(&t[1], &t[1]).sqrt());
    if !(a > DEGENERATE * longest && b > DEGENERATE * longest) {
        return None;
    }
    let e0 = scaled(1.0 / a, &t[0]);
    let e1 = scaled(1.0 / b, &t[1]);
    let rest = add_scaled(&e1, -dot(&e0, &e1), &e0);
    let n = dot(&rest, &rest).sqrt();
    (n > DEGENERATE).then(|| [e0, scaled(1.0 / n, &rest)])
}

/// The plane of the two largest principal directions of the neighbours, seen from the vertex.
fn main_directions<const D: usize>(p: &[Vector<f64, D>]) -> [Vector<f64, D>; 2] {
    let mut axes = [[0.0; D]; 2];
    axes[0][0] = 1.0;
    axes[1][1] = 1.0;
    let scale = p.iter().map(|e| dot(e, e)).fold(0.0, f64::max);
    if !(scale > 0.0 && scale.is_finite()) {
        return axes;
    }
    let covariance = DMatrix::from_fn(D, D, |i, j| p.iter().map(|e| e[i] * e[j]).sum::<f64>() / scale);
    let eigen = SymmetricEigen::new(covariance);
    let mut order: Vec<usize> = (0..D).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let axis = |k: usize| std::array::from_fn(|i| eigen.eigenvectors[(i, order[k])]);
    [axis(0), axis(1)]
}
