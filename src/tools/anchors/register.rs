//! Registration by relief: images of the target's vertices slide over the source until the shape
//! around image and vertex agree.

use faer::Mat;
use glam::{DMat3, DVec3};
use nalgebra::Matrix3;
use rayon::prelude::*;

use super::side::{CHANNELS, FRAME, Relief, Side};
use crate::control;
use crate::error::Result;
use crate::geometry::SurfacePoint;
use crate::geometry::bending::Bending;
use crate::geometry::cholesky::SparseCholesky;

/// Stiffness of the steps, beside the evidence of the relief.
const STIFFNESS: [f64; 3] = [1e-4, 1e-5, 3e-6];
/// Steps of each stiffness.
const STEPS: usize = 3;
/// Which channels count: relief at the two finest scales and normals. Coarser relief differs
/// between two bodies for other reasons than misplacement.
const COUNTS: [f64; CHANNELS] = [1.0, 1.0, 0.0, 0.0, 1.0];
/// Part of a channel's own size that counts as its least disagreement.
const FLOOR: f64 = 0.02;
/// Damping of a step, in parts of the mean evidence.
const DAMPING: f64 = 0.1;
/// Disagreement in parts of the usual one beyond which a vertex counts for little.
const ODD: f64 = 100.0;
/// The stiffness that keeps anchors, in mean masses of a vertex.
const ANCHOR: f64 = 1e5;
/// Steps of the conjugate gradients.
const INNER: usize = 30;
/// The scale over which evidence is gathered.
const WINDOW: usize = 2;

/// A point of the target held at a place of the source.
pub(super) struct Hold {
    pub(super) v: [u32; 3],
    pub(super) x: [f64; 3],
    pub(super) to: DVec3,
}

/// The state of a registration: where each vertex of the target lies on the source.
pub(super) struct Registration {
    pub(super) images: Vec<Option<SurfacePoint>>,
    /// Disagreement of the relief at each vertex after the last step.
    pub(super) mismatch: Vec<f64>,
    /// How well the relief determines the image there.
    pub(super) hold: Vec<f64>,
}

fn polar(cov: DMat3, handedness: f64) -> Option<DMat3> {
    if !cov.is_finite() {
        return None;
    }
    let m = Matrix3::from_column_slice(&cov.to_cols_array());
    let svd = m.svd(true, true);
    let (u, vt) = (svd.u?, svd.v_t?);
    let sign = (u.determinant() * vt.determinant()).signum() * handedness;
    // The last singular value is the smallest.
    let d = Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, 1.0, sign));
    let r = u * d * vt;
    Some(DMat3::from_cols_slice(r.as_slice()))
}

/// Local rotations of the map: those that fit the images around each vertex.
fn frames(target: &Side<'_>, places: &[DVec3], handedness: f64) -> Result<Vec<DMat3>> {
    let x = &target.positions;
    let (mx, mp) = (target.smooth(FRAME, x)?, target.smooth(FRAME, places)?);
    let mut columns = Vec::new();
    for j in 0..3 {
        let product: Vec<DVec3> = (0..x.len()).map(|v| places[v] * x[v][j]).collect();
        columns.push(target.smooth(FRAME, &product)?);
    }
    Ok((0..x.len())
        .into_par_iter()
        .map(|v| {
            let column = |j: usize| columns[j][v] - mp[v] * mx[v][j];
            polar(DMat3::from_cols(column(0), column(1), column(2)), handedness).unwrap_or(DMat3::IDENTITY)
        })
        .collect())
}

pub(super) fn relief_at(side: &Side<'_>, p: &SurfacePoint) -> Relief {
    let t = side.topology.triangles[p.face as usize];
    let mut sum = [DVec3::ZERO; CHANNELS];
    for k in 0..3 {
        let r = &side.relief[t[k] as usize];
        for c in 0..CHANNELS {
            sum[c] += p.barycentric[k] * r[c];
        }
    }
    sum
}

pub(super) type Gradient = [[DVec3; 3]; CHANNELS];

pub(super) fn gradient_at(side: &Side<'_>, gradients: &[Gradient], p: &SurfacePoint) -> Gradient {
    let t = side.topology.triangles[p.face as usize];
    let mut sum = [[DVec3::ZERO; 3]; CHANNELS];
    for k in 0..3 {
        let g = &gradients[t[k] as usize];
        for c in 0..CHANNELS {
            for i in 0..3 {
                sum[c][i] += p.barycentric[k] * g[c][i];
            }
        }
    }
    sum
}

pub(super) fn register(
    source: &Side<'_>,
    target: &Side<'_>,
    start: &[Option<SurfacePoint>],
    holds: &[Hold],
    handedness: f64,
) -> Result<Registration> {
    let n = target.positions.len();
    let mut images = start.to_vec();
    let gradients = source.gradients();
    let mass = &target.laplacian.mass;
    let total_mass: f64 = mass.iter().sum();
    let at = |images: &[Option<SurfacePoint>]| -> Vec<DVec3> {
        images.iter().map(|p| p.as_ref().map_or(DVec3::ZERO, |p| source.position(p))).collect()
    };
    let origin = at(&images);
    let bending = Bending::new(&target.positions, &target.triangles)?;
    let ties: Vec<([u32; 3], [f64; 3])> = holds.iter().map(|h| (h.v, h.x)).collect();
    let mut out = Registration { images: Vec::new(), mismatch: vec![0.0; n], hold: vec![0.0; n] };
    let mut factor: Option<(f64, f64, SparseCholesky)> = None;
    let mut last: Vec<(DMat3, f64, DVec3)> = Vec::new();
    for stiffness in STIFFNESS {
        for _ in 0..STEPS {
            control::check()?;
            let places = at(&images);
            let frames = frames(target, &places, handedness)?;
            // What the relief says.
            let wanted: Vec<Relief> = (0..n).map(|v| target.relief[v].map(|r| frames[v] * r)).collect();
            let found: Vec<Relief> = images
                .par_iter()
                .map(|p| p.as_ref().map_or([DVec3::ZERO; CHANNELS], |p| relief_at(source, p)))
                .collect();
            let mut weight = [0.0; CHANNELS];
            for c in 0..CHANNELS {
                let (mut off, mut size) = (0.0, 0.0);
                for v in (0..n).filter(|&v| images[v].is_some()) {
                    off += mass[v] * (wanted[v][c] - found[v][c]).length_squared();
                    size += mass[v] * wanted[v][c].length_squared();
                }
                weight[c] = COUNTS[c] * total_mass / (off + FLOOR * size + 1e-12);
            }
            let systems: Vec<(DMat3, DVec3, f64)> = (0..n)
                .into_par_iter()
                .map(|v| {
                    let Some(p) = &images[v] else { return (DMat3::ZERO, DVec3::ZERO, 0.0) };
                    let g = gradient_at(source, &gradients, p);
                    let mut off = 0.0;
                    for c in 0..CHANNELS {
                        off += weight[c] * (wanted[v][c] - found[v][c]).length_squared();
                    }
                    let robust = (1.0 + off / ODD).powi(-2);
                    let (mut a, mut b) = (DMat3::ZERO, DVec3::ZERO);
                    for c in 0..CHANNELS {
                        let r = wanted[v][c] - found[v][c];
                        for i in 0..3 {
                            let g = g[c][i];
                            let w = robust * weight[c];
                            a += DMat3::from_cols(g * g.x, g * g.y, g * g.z) * w;
                            b += g * (w * r[i]);
                        }
                    }
                    (a, b, off)
                })
                .collect();
            let traces: f64 =
                (0..n).map(|v| mass[v] * (systems[v].0.x_axis.x + systems[v].0.y_axis.y + systems[v].0.z_axis.z)).sum();
            let scale = traces / (3.0 * total_mass);
            let normal = |v: usize| {
                images[v].as_ref().map_or(DVec3::ZERO, |p| {
                    let [a, b, c] = source.topology.triangles[p.face as usize].map(|v| source.positions[v as usize]);
                    (b - a).cross(c - a).normalize_or_zero()
                })
            };
            let blocks: Vec<DMat3> = (0..n)
                .map(|v| {
                    let m = normal(v);
                    systems[v].0
                        + DMat3::from_cols(m * m.x, m * m.y, m * m.z) * scale
                        + DMat3::from_diagonal(DVec3::splat(DAMPING * scale))
                })
                .collect();
            let eps = stiffness * scale;
            if factor.as_ref().is_none_or(|(s, e, _)| (*s / scale - 1.0).abs() > 0.5 || *e != stiffness) {
                let f = bending.factorise(stiffness, &ties, ANCHOR * bending.mean_mass)?;
                factor = Some((scale, stiffness, f));
            }
            let Some((preconditioner_scale, _, factor)) = &factor else { break };
            let hold = ANCHOR * bending.mean_mass * scale;
            let displacement: Vec<DVec3> = (0..n).map(|v| places[v] - origin[v]).collect();
            let apply = |d: &[DVec3]| -> Vec<DVec3> {
                let bend = bend(target, &bending, d);
                let mut y: Vec<DVec3> = (0..n).map(|v| mass[v] * (blocks[v] * d[v]) + eps * bend[v]).collect();
                for h in holds {
                    let here: DVec3 = (0..3).map(|k| h.x[k] * d[h.v[k] as usize]).sum();
                    for k in 0..3 {
                        y[h.v[k] as usize] += hold * h.x[k] * here;
                    }
                }
                y
            };
            let mut right: Vec<DVec3> =
                (0..n).map(|v| mass[v] * (systems[v].1 + blocks[v] * displacement[v])).collect();
            for h in holds {
                let from: DVec3 = (0..3).map(|k| h.x[k] * origin[h.v[k] as usize]).sum();
                for k in 0..3 {
                    right[h.v[k] as usize] += hold * h.x[k] * (h.to - from);
                }
            }
            let precondition = |r: &[DVec3]| -> Result<Vec<DVec3>> {
                let mut x = Mat::from_fn(n, 3, |v, i| r[v][i] / preconditioner_scale);
                factor.solve(&mut x)?;
                Ok((0..n).map(|v| DVec3::from_array(std::array::from_fn(|i| x[(v, i)]))).collect())
            };
            let solution = conjugate_gradients(apply, precondition, &right, displacement, INNER)?;
            last = (0..n).map(|v| (systems[v].0, systems[v].2, normal(v))).collect();
            images = (0..n)
                .into_par_iter()
                .map(|v| images[v].map(|p| source.closest_near(origin[v] + solution[v], p)))
                .collect();
        }
    }
    out.images = images;
    let column = |j: usize| target.smooth(WINDOW, &last.iter().map(|l| l.0.col(j)).collect::<Vec<_>>());
    let columns = [column(0)?, column(1)?, column(2)?];
    let off = target.smooth(WINDOW, &last.iter().map(|l| DVec3::splat(l.1)).collect::<Vec<_>>())?;
    for v in 0..n {
        let m = last[v].2;
        let e1 = m.any_orthonormal_vector();
        let e2 = m.cross(e1);
        let a = DMat3::from_cols(columns[0][v], columns[1][v], columns[2][v]);
        let (p, q, r) = (e1.dot(a * e1), e1.dot(a * e2), e2.dot(a * e2));
        let least = 0.5 * (p + r) - (0.25 * (p - r) * (p - r) + q * q).sqrt();
        out.mismatch[v] = off[v].x;
        out.hold[v] = if m == DVec3::ZERO { 0.0 } else { least.max(0.0) };
    }
    Ok(out)
}

/// How much the relief of two surfaces disagrees under a map of all vertices of the target, from 0
/// (congruent) to about 2, a mean over the area; turns of the surface in space do not count;
/// `handedness` is -1 where reflections do not count either, and turns do.
pub(super) fn mismatch_of(
    source: &Side<'_>,
    target: &Side<'_>,
    images: &[Option<SurfacePoint>],
    handedness: f64,
) -> Result<f64> {
    let places: Vec<DVec3> = images.iter().map(|p| p.as_ref().map_or(DVec3::ZERO, |p| source.position(p))).collect();
    let frames = frames(target, &places, handedness)?;
    let (mut off, mut size) = ([0.0; CHANNELS], [0.0; CHANNELS]);
    for (v, p) in images.iter().enumerate() {
        let Some(p) = p else { continue };
        let found = relief_at(source, p);
        for c in 0..CHANNELS {
            let wanted = frames[v] * target.relief[v][c];
            off[c] += target.laplacian.mass[v] * (wanted - found[c]).length_squared();
            size[c] += 0.5 * target.laplacian.mass[v] * (wanted.length_squared() + found[c].length_squared());
        }
    }
    Ok((0..CHANNELS).map(|c| off[c] / size[c].max(f64::MIN_POSITIVE)).sum::<f64>() / CHANNELS as f64)
}

/// `L' M^-1 L x`.
fn bend(side: &Side<'_>, bending: &Bending, x: &[DVec3]) -> Vec<DVec3> {
    let rows = &side.flow;
    let n = x.len();
    let y: Vec<DVec3> = (0..n)
        .into_par_iter()
        .map(|r| {
            let (c, w) = rows.row(r);
            c.iter().zip(w).map(|(&c, w)| *w * x[c as usize]).sum::<DVec3>() / bending.mass[r]
        })
        .collect();
    let mut out = vec![DVec3::ZERO; n];
    for r in 0..n {
        let (c, w) = rows.row(r);
        for (&c, w) in c.iter().zip(w) {
            out[c as usize] += *w * y[r];
        }
    }
    out
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}

fn conjugate_gradients(
    apply: impl Fn(&[DVec3]) -> Vec<DVec3>,
    precondition: impl Fn(&[DVec3]) -> Result<Vec<DVec3>>,
    right: &[DVec3],
    start: Vec<DVec3>,
    steps: usize,
) -> Result<Vec<DVec3>> {
    let mut x = start;
    let mut r: Vec<DVec3> = right.iter().zip(apply(&x)).map(|(b, a)| *b - a).collect();
    let mut z = precondition(&r)?;
    let mut p = z.clone();
    let mut rz = dot(&r, &z);
    let first = rz;
    for _ in 0..steps {
        if !(rz > 1e-8 * first) {
            break;
        }
        let q = apply(&p);
        let alpha = rz / dot(&p, &q);
        if !alpha.is_finite() {
            break;
        }
        for v in 0..x.len() {
            x[v] += alpha * p[v];
            r[v] -= alpha * q[v];
        }
        z = precondition(&r)?;
        let next = dot(&r, &z);
        let beta = next / rz;
        rz = next;
        for v in 0..x.len() {
            p[v] = z[v] + beta * p[v];
        }
    }
    Ok(x)
}
