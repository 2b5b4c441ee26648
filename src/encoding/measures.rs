//! How far a deformed shape is from its rest shape.

use super::decode::{encoding_residual, energy};
use super::encode::Encoded;
use super::vector::{cross, dot, length, sub};
use super::{Connectivity, V3};

/// Measures of a deformation; edges and triangles are those of the mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measures {
    /// G (equation 15) over all vertices, in squared units of the positions given.
    pub g: f64,
    /// G over the squared diagonal of the rest shape and the number of vertices.
    pub g_normalised: f64,
    /// Root mean square of the relative changes of the edges' lengths.
    pub edge_rms: f64,
    /// Largest relative change of an edge's length.
    pub edge_max: f64,
    /// Volume inside, new over old; 1 where the rest volume vanishes.
    pub volume_ratio: f64,
    /// Root mean square change of the dihedral angles, in degrees.
    pub dihedral_rms: f64,
    /// Triangles that oppose the mean normal of their neighbours and did not at rest.
    pub flipped: usize,
}

/// Compares `positions` with `rest` on the triangles of a mesh.
pub fn measure(
    connectivity: &Connectivity,
    triangles: &[[u32; 3]],
    rest: &[V3<f64>],
    positions: &[V3<f64>],
) -> Measures {
    let encoded = Encoded::new(&connectivity.rings, rest, |_| true);
    let mut residual = vec![[0.0; 3]; encoded.stencils.row_count()];
    encoding_residual(&encoded.stencils, &encoded.encoding, positions, &mut residual);
    let g = energy(&residual);
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for (p, _) in rest.iter().zip(&connectivity.rings).filter(|(_, ring)| !ring.is_empty()) {
        for c in 0..3 {
            (low[c], high[c]) = (low[c].min(p[c]), high[c].max(p[c]));
        }
    }
    let diagonal = length(sub(high, low));
    let rows = encoded.stencils.row_count().max(1) as f64;
    let (mut squares, mut worst, mut edges) = (0.0, 0.0_f64, 0usize);
    for (v, ring) in connectivity.rings.iter().enumerate() {
        for &u in ring.iter().filter(|&&u| (u as usize) > v) {
            let old = length(sub(rest[u as usize], rest[v]));
            if old > 0.0 {
                let change = length(sub(positions[u as usize], positions[v])) / old - 1.0;
                squares += change * change;
                worst = worst.max(change.abs());
                edges += 1;
            }
        }
    }
    let volume = |x: &[V3<f64>]| -> f64 {
        // About a vertex, so that the sum does not cancel far from the origin.
        let o = triangles.first().map_or([0.0; 3], |t| x[t[0] as usize]);
        triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|v| sub(x[v as usize], o));
                dot(a, cross(b, c))
            })
            .sum()
    };
    let (old, new) = (volume(rest), volume(positions));
    let (flipped, dihedral_rms) = folds(triangles, rest, positions);
    Measures {
        g,
        g_normalised: if diagonal > 0.0 { g / (diagonal * diagonal * rows) } else { 0.0 },
        edge_rms: (squares / edges.max(1) as f64).sqrt(),
        edge_max: worst,
        volume_ratio: if old.abs() > 1e-9 * diagonal.powi(3) { new / old } else { 1.0 },
        dihedral_rms,
        flipped,
    }
}

/// Newly flipped triangles and the change of dihedral angles.
fn folds(triangles: &[[u32; 3]], rest: &[V3<f64>], positions: &[V3<f64>]) -> (usize, f64) {
    let mut edges: Vec<(u32, u32, u32)> = Vec::with_capacity(3 * triangles.len());
    for (t, tri) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (tri[k], tri[(k + 1) % 3]);
            if a != b {
                edges.push((a.min(b), a.max(b), t as u32));
            }
        }
    }
    edges.sort_unstable();
    let normals = |x: &[V3<f64>]| -> Vec<V3<f64>> {
        triangles
            .iter()
            .map(|t| cross(sub(x[t[1] as usize], x[t[0] as usize]), sub(x[t[2] as usize], x[t[0] as usize])))
            .collect()
    };
    let (old, new) = (normals(rest), normals(positions));
    let mut around = vec![([0.0; 3], [0.0; 3]); triangles.len()];
    let (mut squares, mut count) = (0.0, 0usize);
    for pair in edges.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
        let [(a, b, s), (_, _, t)] = pair else { continue };
        let (s, t) = (*s as usize, *t as usize);
        for (i, j) in [(s, t), (t, s)] {
            around[i].0 = super::vector::add(around[i].0, old[j]);
            around[i].1 = super::vector::add(around[i].1, new[j]);
        }
        let angle = |n: &[V3<f64>], x: &[V3<f64>]| {
            let e = sub(x[*b as usize], x[*a as usize]);
            let sine = dot(cross(n[s], n[t]), e) / length(e).max(f64::MIN_POSITIVE);
            sine.atan2(dot(n[s], n[t]))
        };
        let mut change = angle(&new, positions) - angle(&old, rest);
        change -= (change / std::f64::consts::TAU).round() * std::f64::consts::TAU;
        if change.is_finite() {
            squares += change * change;
            count += 1;
        }
    }
    let flipped =
        (0..triangles.len()).filter(|&t| dot(new[t], around[t].1) < 0.0 && !(dot(old[t], around[t].0) < 0.0)).count();
    (flipped, (squares / count.max(1) as f64).sqrt().to_degrees())
}
