//! What the averages are measured against: closest point after alignment, and spatial radial basis
//! functions.

use glam::DVec3;
use nalgebra::{DMatrix, Matrix3};
use rayon::prelude::*;

use crate::control;
use crate::error::{Error, Result};
use crate::geometry::{ClosestPoints, Frame, Mesh};
use crate::surface::anchors::AnchorPairs;
use crate::surface::packed::{PackedImage, PackedPoint, PointMap, Status};

use super::{Method, Shape, check_faces};

/// Points of one task.
const CHUNK: usize = 512;

/// Part of the widest direction of some anchors below which they do not span a direction: more than
/// the rounding of coordinates 1e7 sizes from the origin.
const RANK: f64 = 1e-7;

/// A smooth map of space followed by the closest point of the source. Every point is claimed valid:
/// nothing in these methods tells right from wrong but the triangles they turn over
/// ([`super::correspondence`]).
#[derive(Debug)]
pub struct Baseline {
    /// In its own frame; the warp goes from there to that of the source.
    target: Mesh,
    closest: ClosestPoints,
    warp: Warp,
}

/// `to + scale rotation (x - from)`; the rotation may be a reflection.
#[derive(Clone, Debug)]
pub(crate) struct Similarity {
    pub(crate) rotation: Matrix3<f64>,
    pub(crate) scale: f64,
    pub(crate) from: DVec3,
    pub(crate) to: DVec3,
}

/// Bytes of `copies` dense square systems of `n` unknowns.
pub(crate) fn dense_bytes(n: u64, copies: u64) -> u64 {
    n.saturating_mul(n).saturating_mul(copies * size_of::<f64>() as u64)
}

/// A map of space.
#[derive(Debug)]
pub(crate) enum Warp {
    Similarity(Similarity),
    Radial { centres: Vec<DVec3>, coefficients: Vec<DVec3>, affine: [DVec3; 4], origin: DVec3, unit: f64 },
}

impl Baseline {
    /// Fits the map to the anchors: [`Method::Rbf`] interpolates them, [`Method::Closest`] aligns
    /// them by a similarity.
    ///
    /// # Errors
    /// If no triangle of the source is usable or the system of the radial basis functions breaks
    /// down.
    pub fn new(source: Shape<'_>, target: Shape<'_>, anchors: &AnchorPairs, method: Method) -> Result<Self> {
        let closest = ClosestPoints::new(source.mesh, source.topology);
        let (here, there) = (Frame::of_mesh(target.mesh), closest.frame());
        let from: Vec<DVec3> = anchors.target.iter().map(|p| here.place(p, target.mesh)).collect();
        let to: Vec<DVec3> = anchors.source.iter().map(|p| there.place(p, source.mesh)).collect();
        let warp = match method {
            Method::Rbf => Warp::radial(&from, &to)?,
            _ => {
                let usual = (source.mesh.area() / target.mesh.area()).sqrt() * there.scale / here.scale;
                Warp::Similarity(Similarity::fit(&from, &to, usual))
            }
        };
        Ok(Self { target: here.mesh(target.mesh), closest, warp })
    }

    fn map_point(&self, p: PackedPoint) -> PackedImage {
        let x = self.warp.apply(p.unpack().position(&self.target));
        match self.closest.nearest_local(x) {
            Some((q, _)) => {
                let packed = PackedPoint::from(q);
                PackedImage {
                    face: packed.face,
                    b0: packed.b0,
                    b1: packed.b1,
                    confidence: 1.0,
                    status: Status::Valid as u32,
                }
            }
            None => PackedImage::NOWHERE,
        }
    }
}

impl PointMap for Baseline {
    fn map(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> Result<()> {
        check_faces(points, self.target.triangle_count())?;
        let here = control::current();
        images.clear();
        images.resize(points.len(), PackedImage::NOWHERE);
        images.par_chunks_mut(CHUNK).zip(points.par_chunks(CHUNK)).try_for_each(|(out, points)| {
            points.iter().zip(out).for_each(|(p, image)| *image = self.map_point(*p));
            here.check()
        })
    }
}

impl Warp {
    /// Radial basis functions through pairs of points.
    ///
    /// # Errors
    /// If their system breaks down.
    pub(crate) fn radial(from: &[DVec3], to: &[DVec3]) -> Result<Self> {
        radial(from, to)
    }

    pub(crate) fn apply(&self, x: DVec3) -> DVec3 {
        match self {
            Self::Similarity(s) => s.apply(x),
            Self::Radial { centres, coefficients, affine, origin, unit } => {
                let x = (x - *origin) / *unit;
                let linear = affine[0] + affine[1] * x.x + affine[2] * x.y + affine[3] * x.z;
                centres.iter().zip(coefficients).fold(linear, |sum, (c, k)| sum + *k * x.distance(*c))
            }
        }
    }
}

pub(super) fn mean(x: &[DVec3]) -> DVec3 {
    x.iter().sum::<DVec3>() / x.len() as f64
}

/// Root mean square distance from `m`.
pub(super) fn spread(x: &[DVec3], m: DVec3) -> f64 {
    (x.iter().map(|p| p.distance_squared(m)).sum::<f64>() / x.len() as f64).sqrt()
}

/// The mean of `(q - b) (p - a)^T`.
fn covariance((from, a): (&[DVec3], DVec3), (to, b): (&[DVec3], DVec3)) -> Matrix3<f64> {
    let mut sum = Matrix3::zeros();
    for (p, q) in from.iter().zip(to) {
        let (p, q) = ((*p - a).to_array(), (*q - b).to_array());
        sum += Matrix3::from_fn(|r, c| q[r] * p[c]);
    }
    sum / from.len() as f64
}

impl Similarity {
    /// The similarity that fits the anchors best in the least squares sense, a reflection where
    /// that fits better (mirrored pairs). Where fewer than three anchors leave the rotation open
    /// nothing turns; where they lie at one place lengths grow by `usual`.
    pub(super) fn fit(from: &[DVec3], to: &[DVec3], usual: f64) -> Self {
        let (a, b) = (mean(from), mean(to));
        let (sa, sb) = (spread(from, a), spread(to, b));
        let scale = if sa > 0.0 && sb > 0.0 { sb / sa } else { usual };
        if from.len() < 3 {
            return Self { rotation: Matrix3::identity(), scale, from: a, to: b };
        }
        let svd = covariance((from, a), (to, b)).svd(true, true);
        let rotation = match (svd.u, svd.v_t) {
            (Some(u), Some(vt)) => u * vt,
            _ => Matrix3::identity(),
        };
        Self { rotation, scale, from: a, to: b }
    }

    /// The similarity of some of the points, mirrored as this one is and no more than twice as
    /// large or small: where the points leave it open, this one's rotation and scale, which count
    /// as `prior` of their covariance.
    pub(super) fn local(&self, from: &[DVec3], to: &[DVec3], prior: f64) -> Self {
        if from.is_empty() {
            return self.clone();
        }
        let (a, b) = (mean(from), mean(to));
        let (sa, sb) = (spread(from, a), spread(to, b));
        let open = Self { from: a, to: b, ..self.clone() };
        if !(sa > 0.0) {
            return open;
        }
        let svd = (covariance((from, a), (to, b)) + self.rotation * (prior * self.scale * sa * sa)).svd(true, true);
        let (Some(u), Some(vt)) = (svd.u, svd.v_t) else { return open };
        // The least singular value comes last.
        let sign = (u * vt).determinant() * self.rotation.determinant();
        let rotation = u * Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, 1.0, sign.signum())) * vt;
        Self { rotation, scale: (sb / sa).clamp(0.5 * self.scale, 2.0 * self.scale), ..open }
    }

    /// The same linear part times `factor`, taking `from` to `to`.
    pub(super) fn moved(&self, from: DVec3, to: DVec3, factor: f64) -> Self {
        Self { scale: factor * self.scale, from, to, ..self.clone() }
    }

    pub(super) fn apply(&self, x: DVec3) -> DVec3 {
        let d = x - self.from;
        let r = self.rotation * nalgebra::Vector3::new(d.x, d.y, d.z);
        self.to + DVec3::new(r.x, r.y, r.z) * self.scale
    }
}

/// Linear kernel `|x - t_i|` with an affine part, interpolating. Coincident anchors are merged to
/// their mean; where the anchors do not span space, the affine part is the one of least norm.
/// Directions that they span by less than [`RANK`] count as none: those of a tilted plane are
/// rounding.
fn radial(from: &[DVec3], to: &[DVec3]) -> Result<Warp> {
    control::require(dense_bytes(from.len() as u64 + 4, 2), || {
        format!("the system of radial basis functions of {} pairs", from.len())
    })?;
    let origin = mean(from);
    let extent = spread(from, origin);
    let unit = if extent > 0.0 { extent } else { 1.0 };
    let mut merged: Vec<(DVec3, DVec3, f64)> = Vec::new();
    for (&p, &q) in from.iter().zip(to) {
        match merged.iter_mut().find(|(m, ..)| *m == p) {
            Some((_, sum, n)) => {
                *sum += q;
                *n += 1.0;
            }
            None => merged.push((p, q, 1.0)),
        }
    }
    let centres: Vec<DVec3> = merged.iter().map(|(p, ..)| (*p - origin) / unit).collect();
    let n = centres.len();
    let broken =
        || Error::numeric("the radial basis functions cannot be fitted", "Move anchors that nearly coincide apart");
    // What of affine functions the centres tell apart: orthonormal columns.
    let svd = DMatrix::from_fn(n, 4, |r, c| if c == 0 { 1.0 } else { centres[r][c - 1] }).svd(true, true);
    let (Some(u), Some(vt)) = (svd.u, svd.v_t) else { return Err(broken()) };
    let sizes = svd.singular_values;
    let kept: Vec<usize> = (0..sizes.len()).filter(|&k| sizes[k] > RANK * sizes.max()).collect();
    let size = n + kept.len();
    let system = DMatrix::from_fn(size, size, |r, c| match (r < n, c < n) {
        (true, true) => centres[r].distance(centres[c]),
        (true, false) => u[(r, kept[c - n])],
        (false, true) => u[(c, kept[r - n])],
        (false, false) => 0.0,
    });
    let values = DMatrix::from_fn(size, 3, |r, c| if r < n { merged[r].1[c] / merged[r].2 } else { 0.0 });
    let solution =
        system.full_piv_lu().solve(&values).filter(|s| s.iter().all(|x| x.is_finite())).ok_or_else(broken)?;
    let at = |r: usize| DVec3::new(solution[(r, 0)], solution[(r, 1)], solution[(r, 2)]);
    let affine = |q: usize| kept.iter().enumerate().map(|(k, &s)| at(n + k) * (vt[(s, q)] / sizes[s])).sum::<DVec3>();
    Ok(Warp::Radial { coefficients: (0..n).map(at).collect(), affine: [0, 1, 2, 3].map(affine), centres, origin, unit })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn anchors() -> (Vec<DVec3>, Vec<DVec3>) {
        let from: Vec<DVec3> =
            (0..12).map(|i| DVec3::new(f64::from(i * 7 % 5), f64::from(i * 3 % 7), f64::from(i * i % 4))).collect();
        let to = from.iter().map(|p| DVec3::new(2.0 - p.y, 1.0 + p.x, 0.5 * p.z * p.z)).collect();
        (from, to)
    }

    #[test]
    fn radial_interpolates() {
        let (from, to) = anchors();
        let warp = radial(&from, &to).unwrap();
        for (p, q) in from.iter().zip(&to) {
            assert!(warp.apply(*p).distance(*q) < 1e-9, "{p} to {q}");
        }
        assert!(warp.apply(from[0]).distance(to[1]) > 1e-3, "the comparison can fail");
    }

    #[test]
    fn affine_maps_are_reproduced() {
        let (from, _) = anchors();
        let f = |p: DVec3| DVec3::new(1.0 + p.x - p.z, 2.0 * p.y, p.x + p.y + p.z);
        let warp = radial(&from, &from.iter().map(|p| f(*p)).collect::<Vec<_>>()).unwrap();
        let x = DVec3::new(0.3, -4.0, 9.0);
        assert!(warp.apply(x).distance(f(x)) < 1e-9);
    }

    #[test]
    fn flat_and_doubled_anchors_are_finite() {
        let from = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::X, DVec3::new(1.0, 1.0, 0.0)];
        let warp = radial(&from, &from).unwrap();
        assert!(warp.apply(DVec3::new(0.5, 0.5, 0.0)).distance(DVec3::new(0.5, 0.5, 0.0)) < 1e-9);
        let one = radial(&from[..1], &[DVec3::Y]).unwrap();
        assert!(one.apply(DVec3::X).is_finite());
    }

    #[test]
    fn similarity_recovers_mirror_and_scale() {
        let (from, _) = anchors();
        let to: Vec<DVec3> = from.iter().map(|p| DVec3::new(-3.0 * p.x + 1.0, 3.0 * p.y, 3.0 * p.z)).collect();
        let warp = Similarity::fit(&from, &to, 1.0);
        assert!(from.iter().zip(&to).all(|(p, q)| warp.apply(*p).distance(*q) < 1e-9));
    }

    #[test]
    fn local_similarities_follow_their_points_and_keep_what_those_leave_open() {
        let (from, _) = anchors();
        let whole = Similarity::fit(&from, &from.iter().map(|p| 2.0 * *p).collect::<Vec<_>>(), 1.0);
        // A quarter turn about z, a little larger: nearly all of it is followed.
        let turned: Vec<DVec3> = from.iter().map(|p| DVec3::new(5.0 - 2.4 * p.y, 2.4 * p.x, 2.4 * p.z)).collect();
        let local = whole.local(&from, &turned, 0.01);
        assert!((local.scale - 2.4).abs() < 1e-9);
        assert!(from.iter().zip(&turned).all(|(p, q)| local.apply(*p).distance(*q) < 0.3));
        // One point, or points on a line, leave the turn open; never a mirror image; the scale
        // stays within a factor of two.
        let one = whole.local(&from[..1], &turned[..1], 0.01);
        assert!(one.apply(from[0] + DVec3::X).distance(turned[0] + 2.0 * DVec3::X) < 1e-9);
        let flat: Vec<DVec3> = from.iter().map(|p| DVec3::new(p.x, p.y, 0.0)).collect();
        let local = whole.local(&flat, &flat.iter().map(|p| 100.0 * *p).collect::<Vec<_>>(), 0.01);
        assert!(local.rotation.determinant() > 0.0 && (local.scale - 4.0).abs() < 1e-9);
        assert!(local.apply(local.from + DVec3::Z).distance(local.to + 4.0 * DVec3::Z) < 1e-9);
    }
}
