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

use glam::DVec3;
use rayon::prelude::*;

pub use self::contradicted::Contradicted;
pub use self::expected::Expected;
pub use self::pair::FieldPair;
use self::pair::Shapes;
#[doc(hidden)]
pub use self::relax::Relaxation;
pub use self::report::{FieldOptions, FieldReport};
pub use self::session::{Edit, FieldSession};

use self::closest::{ClosestOnSurface, FLAT};
use self::islands::Islands;
use self::predict::Point;
use self::relax::{Pins, Tie, factors, relax, stiffness};
use self::relief::Relief;
use self::repair::{Images, Repaired};
use crate::control;
use crate::engine::Real;
use crate::error::{Error, Result};
use crate::geometry::{NONE, SurfacePoint};
use crate::surface::anchors::AnchorPairs;
use crate::surface::correspondence::drift::spread_drift;
use crate::surface::correspondence::{Evidence, Shape, Trust, Vouching, check_faces};
use crate::surface::correspondence::{Warp, dense_bytes};
use crate::surface::project::{Found, Projection};
use crate::surface::vector::{Vector, cast, combine};
use crate::surface::{NearestVertex, PackedImage, PackedPoint, PhongSurface, PointMap};

/// Bounds of lambda, where one of the two predictions is exact.
const LAMBDA: [f64; 2] = [0.05, 20.0];
/// Errors of anchors left out below this say no more than rounding, over the square root of the
/// area.
const EXACT: f64 = 1e-6;
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

/// Where everything goes in R^K before it is drawn onto the source.
struct Predicted<'a, const K: usize> {
    /// The vertices of the source.
    source: Vec<Vector<f64, K>>,
    /// The image of a vertex of the target.
    image: &'a (dyn Fn(usize) -> Vector<f64, K> + Sync),
    /// The image of each anchor.
    anchors: Vec<Vector<f64, K>>,
    /// How many of them lie apart.
    apart: usize,
    /// What a unit of length in space is there.
    unit: f64,
    /// The error to be expected of the images, in space at unit area.
    error: f64,
}

/// The error to be expected where none is known: a part of the distance between anchors.
fn usual_error(anchors: usize) -> f64 {
    0.1 / (anchors.max(1) as f64).sqrt()
}

impl<S: Real> Field<S, 4> {
    /// Radial basis functions in space
    /// ([`Method::Rbf`](crate::surface::correspondence::Method::Rbf)), the images relaxed onto the
    /// source as those of a field are: what the relaxation does for a prediction that knows nothing
    /// of surfaces. No embeddings are needed, and no point gets a confidence.
    ///
    /// # Errors
    /// If the system of the radial basis functions or the relaxation breaks down.
    pub fn radial(source: Shape<'_>, target: Shape<'_>, anchors: &AnchorPairs) -> Result<Self> {
        let shapes = Shapes::new(source, target)?;
        let place = |p: DVec3| joined::<0, 4>(&[], 1.0, p.to_array());
        let (from, to) = (shapes.on_target(anchors), shapes.on_source(anchors));
        let warp = Warp::radial(&from, &to)?;
        let predicted = Predicted {
            source: (0..source.mesh.vertex_count()).map(|v| place(shapes.source_position(v))).collect(),
            image: &|v| place(warp.apply(shapes.target_position(v))),
            anchors: to.into_iter().map(place).collect(),
            apart: anchors.len(),
            unit: 1.0,
            error: usual_error(anchors.len()),
        };
        Self::drawn(&shapes, predicted, anchors, Relaxation::Planes, true)
    }
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

    fn of<const D: usize>(pair: &FieldPair<'_, D>, anchors: &AnchorPairs, options: &FieldOptions) -> Result<Self> {
        // The place in space comes after the embedding, and one zero.
        const { assert!(K == D + 4) };
        let FieldPair { shapes, from, to } = pair;
        // The kernel, the system with its polynomials, its factors and its inverse.
        let system = dense_bytes(anchors.target.len() as u64 + K as u64 + 1, 4);
        control::require(system, || format!("the field of {} pairs", anchors.target.len()))?;
        let known = pair.known(anchors);
        if pair.is_self_map() {
            return Self::of_self(pair, &known, anchors, options);
        }
        let judges = known.judges();
        control::check()?;
        let (embedded, spatial) = (known.embedded(judges.as_ref()), known.spatial(judges.as_ref()));
        let (Some(embedded), Some(spatial)) = (embedded, spatial) else {
            return Err(Error::input("there are no anchors", "Give at least one pair, better twenty or more"));
        };
        let ratio = (embedded.error() + EXACT) / (spatial.error() + EXACT);
        // Weights by errors would be their ratio; its square relies on the better one more than
        // that, and maps are better for it (docs/methods.md).
        let usual = if ratio.is_finite() { ratio * ratio } else { 1.0 };
        let lambda = options.lambda.unwrap_or(usual).clamp(LAMBDA[0], LAMBDA[1]);
        let image = |v: usize| {
            let vertex = &from.surface.vertices[v];
            let place = (vertex.y.map(|x| x * from.edge), vertex.t);
            let point: Point<D> = (place, shapes.target_position(v));
            joined(&embedded.at(&point), lambda, spatial.at(&point))
        };
        // The source with its places in space.
        let row = |v: usize| {
            let y: Vector<f64, D> = to.surface.vertices[v].y.map(|x| x * to.edge);
            joined::<D, K>(&y, lambda, shapes.source_position(v).to_array())
        };
        let predicted = Predicted {
            source: (0..shapes.source.mesh.vertex_count()).map(row).collect(),
            image: &image,
            anchors: known.b.iter().zip(&known.t).map(|(b, t)| joined(b, lambda, t.to_array())).collect(),
            apart: judges.as_ref().map_or(known.a.len(), |j| j.a.len()),
            unit: lambda,
            error: if spatial.error().is_finite() { spatial.error() } else { usual_error(known.a.len()) },
        };
        let mut field = Self::drawn(shapes, predicted, anchors, options.relaxation(), options.relax)?;
        // A step along the surface is this much longer in both spaces together, and so is what a
        // projection is off by.
        field.unit /= (1.0 + lambda * lambda).sqrt();

        control::check()?;
        // What anchors left out would have missed, on the surface.
        let closest = ClosestOnSurface::new(&field.reference, &field.vertices);
        let left_out: Vec<f64> = (0..known.a.len())
            .map(|i| {
                let (y, x) = (embedded.left_out[i], spatial.left_out[i]);
                let y: Vector<f64, D> = std::array::from_fn(|k| known.b[i][k] + y[k]);
                let x = std::array::from_fn(|k| known.t[i][k] + x[k]);
                closest
                    .find(&field.framed(joined(&y, lambda, x)))
                    .map_or(1.0, |c| shapes.source_point(&SurfacePoint::new(c.face, c.x)).distance(known.t[i]))
            })
            .collect();
        let mut beyond_rim = 0;
        if options.confidence {
            let times = few(left_out.len()) * options.relaxation().surprise();
            let counted: Vec<f64> = left_out.iter().map(|l| l * times).collect();
            field.drift = spread_drift(&from.surface, from.edge, &known.a, &counted);
            field.doubt_turned();
            beyond_rim = field.doubt_what_is_beyond(shapes, image);
        }
        let (turned, reseated) = (field.report.turned, field.report.reseated);
        field.report = FieldReport {
            turned,
            reseated,
            embedded: embedded.parts.clone(),
            spatial: spatial.parts.clone(),
            lambda,
            lambda_by_strain: options.lambda.is_some(),
            relaxation: Some(options.relaxation()),
            left_out,
            contradicted: Vec::new(),
            expected: field.expected(shapes),
            beyond_rim,
        };
        Ok(field)
    }

    /// Nobody vouches for what is turned over.
    fn doubt_turned(&mut self) {
        for v in self.turned.iter().flat_map(|&t| self.triangles[t]) {
            self.drift[v as usize] = f64::INFINITY;
        }
    }

    /// The field of a prediction, drawn onto the source, and its turned triangles turned back, if
    /// so asked. It vouches for every point, since nothing is known of errors.
    fn drawn(
        shapes: &Shapes<'_>,
        predicted: Predicted<'_, K>,
        anchors: &AnchorPairs,
        relaxation: Relaxation,
        repaired: bool,
    ) -> Result<Self> {
        let relaxed = relaxation.draws();
        let triangles = shapes.target.topology.triangles.clone();
        // Sequential work beside the prediction.
        let surface = || {
            let surface = PhongSurface::<f64, K>::new(shapes.source.topology, &predicted.source.concat())?;
            let vertices = NearestVertex::new(&surface);
            Ok::<_, Error>((surface, vertices))
        };
        let ties: Vec<Tie> = anchors.target.iter().map(|p| (triangles[p.face as usize], p.barycentric)).collect();
        let factors = || relaxed.then(|| factors(&shapes.bending, &ties, predicted.apart)).transpose();
        let image = |v: usize| if shapes.used[v] { (predicted.image)(v) } else { [0.0; K] };
        let images = || -> Vec<Vector<f64, K>> { (0..shapes.used.len()).into_par_iter().map(image).collect() };
        let ((surface, factors), mut z) = rayon::join(|| rayon::join(surface, factors), images);
        let (reference, vertices) = surface?;
        control::check()?;
        z.iter_mut().for_each(|z| *z = framed(&reference, *z));
        let closest = ClosestOnSurface::new(&reference, &vertices);
        let mut held = vec![false; z.len()];
        for (v, _) in ties.iter().flat_map(|(v, x)| v.iter().zip(x)).filter(|(_, x)| **x > 0.0) {
            held[*v as usize] = true;
        }
        let (mut near, mut relief, mut reseated) = (vec![NONE; z.len()], None, 0);
        if let Some(factors) = factors? {
            let own = &shapes.source.topology.triangles;
            let unit = predicted.unit / reference.edge;
            let error = if relaxation.compares_normals() { predicted.error * unit } else { 0.0 };
            let begun = Relief::new(&shapes.source_places, own, error);
            let places: Vec<Vector<f64, K>> = predicted.anchors.iter().map(|to| framed(&reference, *to)).collect();
            let pins = Pins { ties: &ties, to: &places, factors: &factors, relaxation };
            let relaxed = relax(&shapes.bending, &closest, begun, [&triangles, own], &pins, &shapes.used, &mut z)?;
            near = relaxed.0;
            relief = Some(relaxed.1);
            reseated = Islands { shapes, closest: &closest, held: &held }.reseat(&mut z, &mut near);
        }
        let mut starts: Vec<u32> = (0..z.len())
            .into_par_iter()
            .map(|v| {
                if !shapes.used[v] {
                    return NONE;
                }
                let place = (&z[v], &FLAT);
                let found = if near[v] == NONE { closest.near(place, NONE) } else { closest.follow(place, near[v]) };
                found.map_or(NONE, |c| closest.vertex(&c))
            })
            .collect();
        let faces = |z: &[Vector<f64, K>], starts: &[u32]| -> Vec<u32> {
            triangles.par_iter().map(|&t| start_face(&closest, z, starts, t)).collect()
        };
        let mut start_faces = faces(&z, &starts);
        let mut turned = Repaired::default();
        if repaired {
            let (z, starts) = (&mut z[..], &mut starts[..]);
            let start_faces = &start_faces;
            turned = Images { shapes, source: &reference, closest: &closest, z, starts, start_faces }.repair(&held)?;
        }
        if turned.before > turned.left.len() {
            start_faces = faces(&z, &starts);
        }
        let unit = reference.edge;
        Ok(Self {
            source: reference.cast(),
            reference,
            vertices,
            triangles,
            z: z.iter().map(cast).collect(),
            starts,
            start_faces,
            drift: Vec::new(),
            relief,
            unit,
            trust: Trust::default(),
            report: FieldReport { reseated, turned: [turned.before, turned.left.len()], ..FieldReport::default() },
            turned: turned.left,
        })
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

/// How much more anchors left out are made to count where there are few: four determine an affine
/// map of space, and a mixture fits what so few say by chance.
fn few(anchors: usize) -> f64 {
    if anchors > 4 { anchors as f64 / (anchors - 4) as f64 } else { f64::INFINITY }
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
