//! Texture coordinates that bend as little as they can between anchors: a thin plate on the
//! surface.

use faer::Mat;
use glam::{DVec2, DVec3};

use crate::error::Result;
use crate::geometry::bending::Bending;

/// Stiffness of the plate on a surface of area one, in parts of the mass that keeps it where the
/// step before left it.
const STIFFNESS: f64 = 1e3;
/// Stiffness of the ties to the anchors, in the same parts.
const TIE: f64 = 1e8;
/// Edges over which roughness is smoothed away before the plate is laid. Noise of half an edge
/// costs 0.05 to 0.4 of the stretch without, 0.01 with; 2 and more take off shape too.
const REACH: f64 = 1.0;
/// Most steps of the iteration.
const STEPS: usize = 60;
/// The iteration ends when no coordinate moves more than this in a step.
const DONE: f64 = 1e-11;

/// Functions u and v on a surface of area one that take the values `uv` at the points `ties`
/// (triangle's vertices and barycentric coordinates) and have the smallest energy `integral
/// (laplace u)^2` among those, with free borders. On flat surfaces, bent or not, values that are a
/// linear function of the place are met by that function exactly.
///
/// Roughness is taken off the surface first. Two factorisations and a few solutions: the matrix
/// alone is singular, so each step minimises `|x - before|^2 + stiffness E(x) + tie |B x + y -
/// uv|^2`, y being what the steps before missed (the method of multipliers).
///
/// # Errors
/// If the factorisation fails.
pub(super) fn plate(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    ties: &[([u32; 3], [f64; 3])],
    uv: &[DVec2],
) -> Result<Vec<DVec2>> {
    let smoothed = smoothed(positions, triangles)?;
    let bending = Bending::new(&smoothed, triangles)?;
    let factor = bending.factorise(STIFFNESS, ties, TIE)?;
    let n = positions.len();
    let mut at = vec![uv.iter().sum::<DVec2>() / uv.len().max(1) as f64; n];
    let mut missed = vec![DVec2::ZERO; ties.len()];
    for _ in 0..STEPS {
        let mut right = Mat::zeros(n, 2);
        for v in 0..n {
            right[(v, 0)] = bending.mass[v] * at[v].x;
            right[(v, 1)] = bending.mass[v] * at[v].y;
        }
        for ((corners, x), wanted) in ties.iter().zip(uv.iter().zip(&missed).map(|(t, m)| *t + *m)) {
            for (&v, x) in corners.iter().zip(x) {
                right[(v as usize, 0)] += TIE * x * wanted.x;
                right[(v as usize, 1)] += TIE * x * wanted.y;
            }
        }
        factor.solve(&mut right)?;
        let mut moved = 0.0_f64;
        for (v, at) in at.iter_mut().enumerate() {
            let next = DVec2::new(right[(v, 0)], right[(v, 1)]);
            moved = moved.max(next.distance(*at));
            *at = next;
        }
        for (k, (corners, x)) in ties.iter().enumerate() {
            let here: DVec2 = corners.iter().zip(x).map(|(&v, &x)| at[v as usize] * x).sum();
            missed[k] += uv[k] - here;
        }
        if !(moved > DONE) {
            break;
        }
    }
    Ok(at)
}

/// The surface with roughness finer than about [`REACH`] edges taken off by the same energy, one
/// step of `M x' + h^4 E x' = M x`: the plate shall follow the surface, not its noise. Flat
/// surfaces stay exactly as they are.
fn smoothed(positions: &[DVec3], triangles: &[[u32; 3]]) -> Result<Vec<DVec3>> {
    let bending = Bending::new(positions, triangles)?;
    let length: f64 = triangles
        .iter()
        .flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]])
        .map(|[i, j]| positions[i as usize].distance(positions[j as usize]))
        .sum();
    let edge = length / (3 * triangles.len()).max(1) as f64;
    let factor = bending.factorise((REACH * edge).powi(4), &[], 0.0)?;
    let mut x = Mat::from_fn(positions.len(), 3, |v, k| bending.mass[v] * positions[v][k]);
    factor.solve(&mut x)?;
    Ok((0..positions.len()).map(|v| DVec3::new(x[(v, 0)], x[(v, 1)], x[(v, 2)])).collect())
}
