//! How a field is made: its parts are predicted from the anchors, joined, drawn onto the source,
//! and judged by what anchors left out would have missed.

use glam::DVec3;
use rayon::prelude::*;

use super::closest::{ClosestOnSurface, FLAT};
use super::islands::Islands;
use super::pair::{FieldPair, Shapes};
use super::predict::Point;
use super::relax::{Pins, Relaxation, Tie, factors, relax};
use super::relief::Relief;
use super::repair::{Images, Repaired};
use super::rim::BeyondRim;
use super::{Field, FieldOptions, FieldReport, framed, joined, start_face};
use crate::control;
use crate::engine::Real;
use crate::error::{Error, Result};
use crate::geometry::{NONE, SurfacePoint};
use crate::surface::anchors::AnchorPairs;
use crate::surface::correspondence::drift::spread_drift;
use crate::surface::correspondence::{Shape, Trust, Warp, dense_bytes};
use crate::surface::vector::{Vector, cast};
use crate::surface::{NearestVertex, PhongSurface};

/// Bounds of lambda, where one of the two predictions is exact.
const LAMBDA: [f64; 2] = [0.05, 20.0];
/// Errors of anchors left out below this say no more than rounding, over the square root of the
/// area.
const EXACT: f64 = 1e-6;

/// Where everything goes in R^K before it is drawn onto the source.
pub(super) struct Predicted<'a, const K: usize> {
    /// The vertices of the source.
    pub(super) source: Vec<Vector<f64, K>>,
    /// The image of a vertex of the target.
    pub(super) image: &'a (dyn Fn(usize) -> Vector<f64, K> + Sync),
    /// The image of each anchor.
    pub(super) anchors: Vec<Vector<f64, K>>,
    /// How many of them lie apart.
    pub(super) apart: usize,
    /// What a unit of length in space is there.
    pub(super) unit: f64,
    /// The error to be expected of the images, in space at unit area.
    pub(super) error: f64,
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
        Ok(Self::drawn(&shapes, predicted, anchors, Relaxation::Planes, true)?.0)
    }
}

impl<S: Real, const K: usize> Field<S, K> {
    pub(super) fn of<const D: usize>(
        pair: &FieldPair<'_, D>,
        anchors: &AnchorPairs,
        options: &FieldOptions,
    ) -> Result<Self> {
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
        let (mut field, first) = Self::drawn(shapes, predicted, anchors, options.relaxation(), options.relax)?;
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
        let mut rim = BeyondRim::default();
        if options.confidence {
            let times = few(left_out.len()) * options.relaxation().surprise();
            let counted: Vec<f64> = left_out.iter().map(|l| l * times).collect();
            field.drift = spread_drift(&from.surface, from.edge, &known.a, &counted);
            field.doubt_turned();
            rim = field.doubt_what_is_beyond(shapes, image);
        }
        let FieldReport { turned, reseated, .. } = field.report;
        field.report = FieldReport {
            turned,
            reseated,
            turned_within: first.iter().filter(|t| !rim.has(field.triangles[**t])).count(),
            embedded: embedded.parts.clone(),
            spatial: spatial.parts.clone(),
            lambda,
            lambda_by_strain: false,
            relaxation: Some(options.relaxation()),
            left_out,
            contradicted: Vec::new(),
            expected: field.expected(shapes),
            beyond_rim: rim.count(),
        };
        Ok(field)
    }

    /// Nobody vouches for what is turned over.
    pub(super) fn doubt_turned(&mut self) {
        for v in self.turned.iter().flat_map(|&t| self.triangles[t]) {
            self.drift[v as usize] = f64::INFINITY;
        }
    }

    /// The field of a prediction, drawn onto the source, and its turned triangles turned back, if
    /// so asked; and the triangles that were turned over before. It vouches for every point, since
    /// nothing is known of errors.
    pub(super) fn drawn(
        shapes: &Shapes<'_>,
        predicted: Predicted<'_, K>,
        anchors: &AnchorPairs,
        relaxation: Relaxation,
        repaired: bool,
    ) -> Result<(Self, Vec<usize>)> {
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
        if turned.first.len() > turned.left.len() {
            start_faces = faces(&z, &starts);
        }
        let unit = reference.edge;
        let report =
            FieldReport { reseated, turned: [turned.first.len(), turned.left.len()], ..FieldReport::default() };
        let field = Self {
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
            report,
            turned: turned.left,
        };
        Ok((field, turned.first))
    }
}

/// How much more anchors left out are made to count where there are few: four determine an affine
/// map of space, and a mixture fits what so few say by chance.
fn few(anchors: usize) -> f64 {
    if anchors > 4 { anchors as f64 / (anchors - 4) as f64 } else { f64::INFINITY }
}
