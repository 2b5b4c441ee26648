//! Markers brought down onto the whole mesh: the fine end of the guess.
//!
//! First they slide: distances to the planes of the nearest vertices are made small (Chen, Medioni
//! 1992), so that a marker may pass from vertex to vertex. Then they meet the vertices themselves
//! (Besl, McKay 1992), which is exact where markers lie on them.

use glam::{DMat3, DQuat, DVec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use nalgebra::{SMatrix, SVector};

use crate::encoding::Similarity;
use crate::geometry::Mesh;

/// Most steps of each kind.
const STEPS: usize = 40;
/// Part of the diagonal that is added to the normal equations: what no marker tells stays as it is.
const DAMPING: f64 = 1e-4;

/// Unit normals of the `used` vertices, weighted by area.
pub(super) fn normals(mesh: &Mesh, used: &[u32]) -> Vec<DVec3> {
    let mut all = vec![DVec3::ZERO; mesh.vertex_count()];
    for t in 0..mesh.triangle_count() {
        let triangle = mesh.triangle(t);
        let [a, b, c] = triangle.map(|v| mesh.positions[v as usize]);
        let area = (b - a).cross(c - a);
        if area.is_finite() {
            triangle.iter().for_each(|&v| all[v as usize] += area);
        }
    }
    used.iter().map(|&v| all[v as usize].normalize_or_zero()).collect()
}

/// The similarity near `start` that lays the markers of `clip` onto the vertices. Markers farther
/// than `far` and a tenth of the others have no say; the size stays within the factor `growth`,
/// since one way alone a clip would shrink into the surface.
pub(super) fn onto_surface(
    clip: &[DVec3],
    vertices: &[DVec3],
    normals: &[DVec3],
    start: Similarity,
    [far, growth]: [f64; 2],
) -> Similarity {
    let points: Vec<[f64; 3]> = vertices.iter().map(|p| p.to_array()).collect();
    let tree = ImmutableKdTree::<f64, 3>::new_from_slice(&points);
    let mut fit = start;
    for slide in [true, false] {
        let mut best = (f64::INFINITY, fit);
        for _ in 0..STEPS {
            let near = |p: &DVec3| {
                let found = tree.nearest_one::<SquaredEuclidean>(&fit.apply(*p).to_array());
                (found.distance.sqrt(), *p, found.item as usize)
            };
            let mut pairs: Vec<(f64, DVec3, usize)> = clip.iter().map(near).filter(|pair| pair.0 <= far).collect();
            pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
            pairs.truncate((pairs.len() * 9).div_ceil(10));
            if pairs.len() < 4 || 2 * pairs.len() < clip.len() {
                break;
            }
            let off = |pair: &(f64, DVec3, usize)| {
                let d = vertices[pair.2] - fit.apply(pair.1);
                if slide { d.dot(normals[pair.2]).powi(2) } else { d.length_squared() }
            };
            let error = pairs.iter().map(off).sum::<f64>() / pairs.len() as f64;
            if !(error < best.0 * (1.0 - 1e-6)) {
                break;
            }
            best = (error, fit);
            let next = if slide {
                let planes: Vec<[DVec3; 3]> =
                    pairs.iter().map(|p| [fit.apply(p.1), vertices[p.2], normals[p.2]]).collect();
                sliding(&planes).map(|step| fit.then(&step))
            } else {
                let met: Vec<(DVec3, DVec3)> = pairs.iter().map(|p| (p.1, vertices[p.2])).collect();
                Some(Similarity::fit(&met))
            };
            let within = |next: &Similarity| (start.scale / growth..=start.scale * growth).contains(&next.scale);
            let Some(next) = next.filter(within) else { break };
            fit = next;
        }
        fit = best.1;
    }
    fit
}

/// The small similarity that brings points nearest to the planes through others: entries are the
/// point, a point of its plane, and the normal.
fn sliding(planes: &[[DVec3; 3]]) -> Option<Similarity> {
    let centre = planes.iter().map(|p| p[0]).sum::<DVec3>() / planes.len() as f64;
    let size = (planes.iter().map(|p| p[0].distance_squared(centre)).sum::<f64>() / planes.len() as f64).sqrt();
    let (mut matrix, mut right) = (SMatrix::<f64, 7, 7>::zeros(), SVector::<f64, 7>::zeros());
    for [p, q, n] in planes {
        let arm = (*p - centre) / size;
        let turn = arm.cross(*n);
        let row = SVector::<f64, 7>::from([turn.x, turn.y, turn.z, n.x, n.y, n.z, arm.dot(*n)]);
        matrix += row * row.transpose();
        right += row * ((*q - *p).dot(*n) / size);
    }
    for k in 0..7 {
        matrix[(k, k)] += DAMPING * planes.len() as f64;
    }
    let x = matrix.cholesky()?.solve(&right);
    let turn = DVec3::new(x[0], x[1], x[2]).clamp_length_max(0.3);
    let rotation = DMat3::from_quat(DQuat::from_scaled_axis(turn));
    let scale = 1.0 + x[6].clamp(-0.05, 0.05);
    let moved = DVec3::new(x[3], x[4], x[5]) * size;
    Some(Similarity { rotation, scale, shift: centre + moved - rotation * centre * scale })
}
