//! Correspondence by a field: an image in R^K for every vertex of the target, predicted from the
//! anchors and relaxed onto the source, interpolated between them.
//!
//! Weighted averages ([`super::correspondence::WeightedAverages`]) solve an inverse problem at
//! every point, and their averages end off the surface by as much as the two embeddings disagree.
//! Here every *vertex* of the target gets a point `z = (y, lambda x)`: `y` predicted in the
//! embedding, which does not care about poses, `x` in space, which is exact where the poses agree;
//! `lambda` and the mixture of predictions are chosen by what anchors say that are left out. Then
//! `z` is drawn onto the source by displacements that are smooth over the target, anchors staying
//! where they are. A point between vertices is interpolated and projected (Phong projection of
//! Panozzo et al. 2013, in more dimensions): no pass over the anchors.

mod chosen;
pub(super) mod closest;
mod contradicted;
mod expected;
mod islands;
mod judges;
mod loosened;
mod made;
mod pair;
mod predict;
mod pulled;
mod radial;
mod relax;
mod relief;
mod repair;
mod report;
mod rigid;
mod rim;
mod session;
mod strain;

use rayon::prelude::*;

pub use self::contradicted::Contradicted;
pub use self::expected::Expected;
pub use self::pair::FieldPair;
#[doc(hidden)]
pub use self::relax::Relaxation;
pub(crate) use self::report::FEWEST;
pub use self::report::{FieldOptions, FieldReport};
pub use self::session::{Edit, FieldSession};
pub(crate) use self::strain::strain_of;

use self::closest::{ClosestOnSurface, FLAT};
use self::relax::stiffness;
use self::relief::Relief;
use crate::control;
use crate::engine::Real;
use crate::error::Result;
use crate::geometry::NONE;
use crate::surface::anchors::AnchorPairs;
use crate::surface::correspondence::{Evidence, Shape, Trust, Vouching, check_faces};
use crate::surface::project::{Found, Projection};
use crate::surface::vector::{Vector, cast, combine};
use crate::surface::{NearestVertex, PackedImage, PackedPoint, PhongSurface, PointMap};

/// A projection this many edges farther than 1.5 times the closest point is one onto another part
/// of the surface.
const GUARD: f64 = 0.5;
/// Points handled by one task.
const CHUNK: usize = 512;

/// The map from the target to the source by a field in R^K over an embedding in R^D, `K = D + 4`.
#[derive(Debug)]
pub struct Field<S: Real, const K: usize> {
    /// The source in R^K.
    source: PhongSurface<S, K>,
    /// The same in double precision, and its vertices, for what projections do not find.
    reference: PhongSurface<f64, K>,
    vertices: NearestVertex<K>,
    /// Triangles of the target.
    triangles: Vec<[u32; 3]>,
    /// Image of each vertex of the target, in the frame and edges of the source.
    z: Vec<Vector<S, K>>,
    /// For each vertex of the target a vertex of the source, for each triangle a triangle, to start
    /// from.
    starts: Vec<u32>,
    start_faces: Vec<u32>,
    /// For each vertex of the target the error to be expected; empty without evidence.
    drift: Vec<f64>,
    /// Triangles of the target that are turned over, rising.
    turned: Vec<usize>,
    /// What the relaxation compared beside places; none without it.
    relief: Option<Relief>,
    /// Mean edge of the source, along the surface, over the square root of its area.
    unit: f64,
    trust: Trust,
    report: FieldReport,
}

impl<S: Real, const K: usize> Clone for Field<S, K> {
    fn clone(&self) -> Self {
        self.on(self.source.clone(), self.z.clone())
    }
}

/// `(y, lambda x, 0)`.
fn joined<const D: usize, const K: usize>(y: &Vector<f64, D>, lambda: f64, x: [f64; 3]) -> Vector<f64, K> {
    std::array::from_fn(|k| {
        if k < D {
            y[k]
        } else if k < D + 3 {
            lambda * x[k - D]
        } else {
            0.0
        }
    })
}

impl<S: Real, const K: usize> Field<S, K> {
    /// Predicts and relaxes the images of all vertices of the target, for one set of anchors: see
    /// [`FieldPair::field`].
    ///
    /// # Errors
    /// As there, and as [`FieldPair::new`].
    pub fn new<const D: usize>(
        source: Shape<'_>,
        target: Shape<'_>,
        anchors: &AnchorPairs,
        options: &FieldOptions,
    ) -> Result<Self> {
        FieldPair::<D>::new(source, target)?.field(anchors, options)
    }

    /// The same, its images rounded to the precision in which it projects.
    fn into_precision<T: Real>(self) -> Field<T, K> {
        Field {
            source: self.reference.cast(),
            reference: self.reference,
            vertices: self.vertices,
            triangles: self.triangles,
            z: self.z.iter().map(cast).collect(),
            starts: self.starts,
            start_faces: self.start_faces,
            drift: self.drift,
            turned: self.turned,
            relief: self.relief,
            unit: self.unit,
            trust: self.trust,
            report: self.report,
        }
    }

    /// The same, its anchors being off by `error` themselves; `before` is the report of the field
    /// of the anchors as they were given.
    fn vouched_less(mut self, error: f64, before: FieldReport) -> Self {
        self.drift.iter_mut().for_each(|d| *d = d.hypot(error));
        let expected = self.report.expected.map(|e| e.with(error));
        self.report =
            FieldReport { left_out: before.left_out, contradicted: before.contradicted, expected, ..self.report };
        self
    }

    /// A point of R^K in the frame and edges of the source there.
    fn framed(&self, z: Vector<f64, K>) -> Vector<f64, K> {
        framed(&self.reference, z)
    }

    /// Takes new images of the vertices that moved, and what begins there.
    fn move_to(&mut self, z: &[Vector<f64, K>], moved: &[bool], triangles: &[u32]) {
        let closest = ClosestOnSurface::new(&self.reference, &self.vertices);
        let starts = &self.starts;
        let starts: Vec<u32> = (0..z.len())
            .into_par_iter()
            .map(|v| {
                if !moved[v] || starts[v] == NONE {
                    return starts[v];
                }
                closest.follow_from((&z[v], &FLAT), starts[v]).map_or(NONE, |c| closest.vertex(&c))
            })
            .collect();
        let start = |&t: &u32| start_face(&closest, z, &starts, self.triangles[t as usize]);
        let faces: Vec<u32> = triangles.par_iter().map(start).collect();
        triangles.iter().zip(faces).for_each(|(&t, face)| self.start_faces[t as usize] = face);
        self.z = z.iter().map(cast).collect();
        self.starts = starts;
    }

    /// Takes over the images of another state of this field, and where searches start.
    pub(in crate::surface) fn follow(&mut self, other: &Self) {
        self.z.clone_from(&other.z);
        self.starts.clone_from(&other.starts);
        self.start_faces.clone_from(&other.start_faces);
    }

    /// Triangles of the target.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The source in R^K.
    pub fn source(&self) -> &PhongSurface<S, K> {
        &self.source
    }

    /// The image of each vertex of the target, in the frame of [`Self::source`].
    pub fn images(&self) -> &[Vector<S, K>] {
        &self.z
    }

    /// The same field, its images as they are rounded, projected in double precision: what the
    /// decisions of single precision are judged by.
    pub fn in_double(&self) -> Field<f64, K> {
        self.on(self.reference.clone(), self.z.iter().map(cast).collect())
    }

    /// The same field on another copy of the source, with these images.
    fn on<T: Real>(&self, source: PhongSurface<T, K>, z: Vec<Vector<T, K>>) -> Field<T, K> {
        Field {
            source,
            reference: self.reference.clone(),
            vertices: NearestVertex::new(&self.reference),
            triangles: self.triangles.clone(),
            z,
            starts: self.starts.clone(),
            start_faces: self.start_faces.clone(),
            drift: self.drift.clone(),
            turned: self.turned.clone(),
            relief: self.relief.clone(),
            unit: self.unit,
            trust: self.trust,
            report: self.report.clone(),
        }
    }

    /// Where the search for the image of a point of a triangle of the target starts: three vertices
    /// of the source and a triangle.
    pub fn starts_of(&self, face: u32) -> [u32; 4] {
        let [a, b, c] = self.triangles[face as usize].map(|v| self.starts[v as usize]);
        [a, b, c, self.start_faces[face as usize]]
    }

    /// Whether a projection needs no second look: it is no farther than any projection may be.
    pub fn stays_near(&self, image: &Projection<S>) -> bool {
        image.face != NONE && image.distance_squared.to_f64().sqrt() <= GUARD
    }

    /// What the images of points are judged by.
    pub(in crate::surface) fn vouching(&self) -> Vouching {
        let evidence = !self.drift.is_empty();
        Vouching {
            evidence,
            unit: self.unit,
            trust: self.trust,
            guard: Some(GUARD),
            faces: self.source.triangles.len(),
        }
    }

    /// The error to be expected at the corners of a triangle of the target; zeros where nothing is
    /// known of it.
    pub(in crate::surface) fn drift_of(&self, face: u32) -> [f64; 3] {
        self.triangles[face as usize].map(|v| self.drift.get(v as usize).copied().unwrap_or(0.0))
    }

    /// The closest point of the source to what is interpolated, if the projection is much farther
    /// from it: then that leads astray.
    fn guarded(&self, z: &Vector<S, K>, image: Projection<S>) -> Projection<S> {
        if self.stays_near(&image) {
            return image;
        }
        let Some(c) = ClosestOnSurface::new(&self.reference, &self.vertices).find(&cast(z)) else { return image };
        let (distance, nearest) = (image.distance_squared.to_f64().sqrt(), c.distance_squared.sqrt());
        if image.face != NONE && image.found != Found::Nothing && distance <= 1.5 * nearest + GUARD {
            return image;
        }
        Projection {
            face: c.face,
            x: c.x.map(S::of),
            distance_squared: S::of(c.distance_squared),
            found: Found::Search,
        }
    }

    /// The image in R^K of a point of the target.
    pub fn interpolate(&self, point: PackedPoint) -> Vector<S, K> {
        let x = [S::of(f64::from(point.b0)), S::of(f64::from(point.b1))];
        let x = [x[0], x[1], S::ONE - x[0] - x[1]];
        combine(&x, self.triangles[point.face as usize].map(|v| &self.z[v as usize]))
    }

    /// Maps one point.
    pub fn map_point(&self, point: PackedPoint) -> PackedImage {
        let z = self.interpolate(point);
        let [a, b, c, face] = self.starts_of(point.face);
        let image = self.guarded(&z, self.source.project_near(&z, face, &[a, b, c]));
        if image.face == NONE { PackedImage::NOWHERE } else { self.judged(point, &image) }
    }

    /// The image of a point that was projected, with its confidence.
    pub fn judged(&self, point: PackedPoint, image: &Projection<S>) -> PackedImage {
        let (confidence, status) = if self.drift.is_empty() {
            Trust::unchecked(image.found)
        } else {
            let corners = self.triangles[point.face as usize];
            let drift = combine_scalars(point, corners.map(|v| self.drift[v as usize]));
            let residual = image.distance_squared.to_f64().sqrt() * self.unit;
            self.trust.judge(&Evidence { residual, drift, round_trip: None, found: image.found })
        };
        PackedImage {
            face: image.face,
            b0: image.x[0].to_f64() as f32,
            b1: image.x[1].to_f64() as f32,
            confidence: confidence as f32,
            status: status as u32,
        }
    }
}

/// A point of R^K in the frame and edges of `surface`.
fn framed<const K: usize>(surface: &PhongSurface<f64, K>, z: Vector<f64, K>) -> Vector<f64, K> {
    std::array::from_fn(|k| (z[k] - surface.centre[k]) / surface.edge)
}

/// The middle of a triangle.
fn middle<const K: usize>(z: &[Vector<f64, K>], t: [u32; 3]) -> Vector<f64, K> {
    combine(&[1.0 / 3.0; 3], t.map(|v| &z[v as usize]))
}

/// The triangle of the source from which the images of a triangle's points are looked for.
/// Repair and field must start from the same triangle, or the repair turns back images that the
/// field never has.
fn start_face<const K: usize>(
    closest: &ClosestOnSurface<'_, K>,
    z: &[Vector<f64, K>],
    starts: &[u32],
    t: [u32; 3],
) -> u32 {
    closest.follow_from((&middle(z, t), &FLAT), starts[t[0] as usize]).map_or(NONE, |c| c.face)
}

fn combine_scalars(point: PackedPoint, at: [f64; 3]) -> f64 {
    let x = point.unpack().barycentric;
    x.iter().zip(at).filter(|(x, _)| **x != 0.0).map(|(x, d)| x * d).sum::<f64>().max(0.0)
}

impl<S: Real, const K: usize> PointMap for Field<S, K> {
    fn map(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> Result<()> {
        check_faces(points, self.triangles.len())?;
        images.clear();
        images.resize(points.len(), PackedImage::NOWHERE);
        let here = control::current();
        images.par_chunks_mut(CHUNK).zip(points.par_chunks(CHUNK)).try_for_each(|(out, points)| {
            points.iter().zip(out).for_each(|(p, image)| *image = self.map_point(*p));
            here.check()
        })
    }

    fn field(&self) -> Option<&FieldReport> {
        (!self.report.left_out.is_empty()).then_some(&self.report)
    }
}

#[cfg(test)]
mod tests;
