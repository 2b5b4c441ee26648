//! Correspondence by a field: an image in R^K for every vertex of the target, predicted from the anchors and relaxed onto the source, interpolated between them.
//!
//! Weighted averages ([`super::correspondence::WeightedAverages`]) solve an inverse problem at every point, and their averages end off the surface by as much as the two
//! embeddings disagree. Here every *vertex* of the target gets a point `z = (y, lambda x)`: `y` predicted in the embedding, which does not care about poses, `x` in space, which is exact where the
//! poses agree; `lambda` and the mixture of predictions are chosen by what anchors say that are left out. Then `z` is drawn onto the source by displacements that are smooth over the target, anchors
//! staying where they are. A point between vertices is interpolated and projected (Phong projection of Panozzo et al. 2013, in more dimensions): no pass over the anchors.

mod closest;
mod predict;
mod radial;
mod relax;
mod rigid;

use glam::DVec3;
use rayon::prelude::*;

use self::closest::ClosestOnSurface;
use self::predict::{Known, Point};
use self::relax::{Pin, relax};
use crate::engine::Real;
use crate::error::{Error, Result};
use crate::geometry::bending::Bending;
use crate::geometry::{Mesh, NONE, SurfacePoint};
use crate::surface::anchors::AnchorPairs;
use crate::surface::correspondence::drift::{Place, place, spread_drift};
use crate::surface::correspondence::{Evidence, Shape, Trust, check_faces};
use crate::surface::project::{Found, Projection};
use crate::surface::vector::{Vector, cast, combine};
use crate::surface::{NearestVertex, PackedImage, PackedPoint, PhongSurface, PointMap};

/// How much more than their ratio of errors the places in space count beside the embedding.
const SPACE: f64 = 1.5;
/// Bounds of lambda, where one of the two predictions is exact.
const LAMBDA: [f64; 2] = [0.05, 20.0];
/// A projection this many edges farther than 1.5 times the closest point is one onto another part of the surface.
const GUARD: f64 = 0.5;
/// Points handled by one task.
const CHUNK: usize = 512;

/// What a field is made of.
#[derive(Clone, Copy, Debug)]
pub struct FieldOptions {
    /// Whether the images of vertices are drawn onto the source. Default true; without it a change of anchors costs far less.
    pub relax: bool,
    /// Whether points get a confidence. Default true.
    pub confidence: bool,
}

impl Default for FieldOptions {
    fn default() -> Self {
        Self { relax: true, confidence: true }
    }
}

/// What was chosen, for the report.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct FieldReport {
    /// Predictions in the embedding, with their weights.
    pub embedded: Vec<(&'static str, f64)>,
    /// Predictions in space, with their weights.
    pub spatial: Vec<(&'static str, f64)>,
    /// Weight of places in space.
    pub lambda: f64,
    /// For each anchor how far the others would have missed it, over the square root of the source's area.
    pub left_out: Vec<f64>,
}

/// The map from the target to the source by a field in R^K over an embedding in R^D, `K >= D + 3`.
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
    /// For each vertex of the target a vertex of the source, for each triangle a triangle, to start from.
    starts: Vec<u32>,
    start_faces: Vec<u32>,
    /// For each vertex of the target the error to be expected; empty without evidence.
    drift: Vec<f64>,
    /// Mean edge of the source in R^K over the square root of its area.
    unit: f64,
    trust: Trust,
    report: FieldReport,
}

/// A surface at unit area.
struct Side<const D: usize> {
    surface: PhongSurface<f64, D>,
    /// Square root of the mesh's area, and edges of the embedding at unit area.
    length: f64,
    edge: f64,
}

impl<const D: usize> Side<D> {
    fn new(shape: &Shape<'_>) -> Result<Self> {
        let Some(e) = shape.embedding.filter(|e| e.dimension == D) else {
            return Err(Error::input("an embedding is missing", "Embed both meshes with the same --dimension"));
        };
        let surface = PhongSurface::<f64, D>::new(shape.topology, &e.points)?;
        let length = shape.mesh.area().sqrt();
        let edge = surface.edge / length;
        Ok(Self { surface, length, edge })
    }

    fn place(&self, p: &SurfacePoint) -> Place<D> {
        let (y, basis) = place(&self.surface, p);
        (y.map(|x| x * self.edge), basis)
    }

    fn position(&self, mesh: &Mesh, p: &SurfacePoint) -> DVec3 {
        p.position(mesh) / self.length
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
    /// Predicts and relaxes the images of all vertices of the target. `O(V n D^2)` for the prediction, three sparse factorisations and 16 rounds of closest points for the relaxation.
    ///
    /// # Errors
    /// If an embedding is missing or not of dimension `D`, or the relaxation breaks down.
    pub fn new<const D: usize>(
        source: Shape<'_>,
        target: Shape<'_>,
        anchors: &AnchorPairs,
        options: &FieldOptions,
    ) -> Result<Self> {
        const { assert!(K >= D + 3) };
        let (from, to) = (Side::<D>::new(&target)?, Side::<D>::new(&source)?);
        let places: Vec<Place<D>> = anchors.target.iter().map(|p| from.place(p)).collect();
        let known = Known {
            a: places.iter().map(|p| p.0).collect(),
            places,
            b: anchors.source.iter().map(|p| to.place(p).0).collect(),
            s: anchors.target.iter().map(|p| from.position(target.mesh, p)).collect(),
            t: anchors.source.iter().map(|p| to.position(source.mesh, p)).collect(),
        };
        let (Some(embedded), Some(spatial)) = (known.embedded(), known.spatial()) else {
            return Err(Error::input("there are no anchors", "Give at least one pair, better twenty or more"));
        };
        let ratio = embedded.error() / spatial.error();
        let lambda = if ratio.is_finite() { (SPACE * ratio).clamp(LAMBDA[0], LAMBDA[1]) } else { SPACE };

        // The source with its places in space.
        let n = source.mesh.vertex_count();
        let mut rows = Vec::with_capacity(n * K);
        for v in 0..n {
            let y: Vector<f64, D> = to.surface.vertices[v].y.map(|x| x * to.edge);
            rows.extend(joined::<D, K>(&y, lambda, (source.mesh.positions[v] / to.length).to_array()));
        }
        let reference = PhongSurface::<f64, K>::new(source.topology, &rows)?;
        let framed = |z: Vector<f64, K>| -> Vector<f64, K> {
            std::array::from_fn(|k| (z[k] - reference.centre[k]) / reference.edge)
        };
        let vertices = NearestVertex::new(&reference);
        let closest = ClosestOnSurface::new(&reference, &vertices);

        let used = |v: usize| !target.topology.vertex_triangles(v as u32).is_empty();
        let count = target.mesh.vertex_count();
        let mut z: Vec<Vector<f64, K>> = (0..count)
            .into_par_iter()
            .map(|v| {
                if !used(v) {
                    return [0.0; K];
                }
                let vertex = &from.surface.vertices[v];
                let place = (vertex.y.map(|x| x * from.edge), vertex.t);
                let point: Point<D> = (place, target.mesh.positions[v] / from.length);
                framed(joined(&embedded.at(&point), lambda, spatial.at(&point)))
            })
            .collect();
        if options.relax {
            let positions: Vec<DVec3> = target
                .mesh
                .positions
                .iter()
                .enumerate()
                .map(|(v, p)| if used(v) { *p / from.length } else { DVec3::ZERO })
                .collect();
            let bending = Bending::new(&positions, &usable_triangles(&target));
            let pins: Vec<Pin<K>> = anchors
                .target
                .iter()
                .enumerate()
                .map(|(i, p)| Pin {
                    v: target.topology.triangles[p.face as usize],
                    x: p.barycentric,
                    to: framed(joined(&known.b[i], lambda, known.t[i].to_array())),
                })
                .collect();
            relax(&bending, &closest, &pins, &mut z)?;
        }

        // What anchors left out would have missed, on the surface.
        let left_out: Vec<f64> = (0..known.a.len())
            .map(|i| {
                let (y, x) = (embedded.left_out[i], spatial.left_out[i]);
                let y: Vector<f64, D> = std::array::from_fn(|k| known.b[i][k] + y[k]);
                let x = std::array::from_fn(|k| known.t[i][k] + x[k]);
                closest.find(&framed(joined(&y, lambda, x))).map_or(1.0, |c| {
                    let p = SurfacePoint::new(c.face, c.x).position(source.mesh) / to.length;
                    p.distance(known.t[i])
                })
            })
            .collect();
        let drift = if options.confidence {
            let counted: Vec<f64> = left_out.iter().map(|l| l * few(left_out.len())).collect();
            spread_drift(&from.surface, from.edge, &known.a, &counted)
        } else {
            Vec::new()
        };
        let image = |z: &Vector<f64, K>| closest.find(z);
        let starts = (0..count)
            .into_par_iter()
            .map(|v| {
                image(&z[v]).filter(|_| used(v)).map_or(NONE, |c| {
                    let k = SurfacePoint::new(c.face, c.x).dominant_corner();
                    reference.triangles[c.face as usize].v[k]
                })
            })
            .collect();
        let triangles = target.topology.triangles.clone();
        let start_faces = triangles
            .par_iter()
            .map(|t| image(&combine(&[1.0 / 3.0; 3], t.map(|v| &z[v as usize]))).map_or(NONE, |c| c.face))
            .collect();
        let report = FieldReport { embedded: embedded.parts.clone(), spatial: spatial.parts.clone(), lambda, left_out };
        let unit = reference.edge;
        Ok(Self {
            source: reference.cast(),
            reference,
            vertices,
            triangles,
            z: z.iter().map(cast).collect(),
            starts,
            start_faces,
            drift,
            unit,
            trust: Trust::default(),
            report,
        })
    }

    /// The closest point of the source to what is interpolated, and how far the projection is from it: a projection much farther than that leads astray.
    fn guarded(&self, z: &Vector<S, K>, image: Projection<S>) -> Projection<S> {
        let distance = image.distance_squared.to_f64().sqrt();
        if image.face != NONE && distance <= GUARD {
            return image;
        }
        let Some(c) = ClosestOnSurface::new(&self.reference, &self.vertices).find(&cast(z)) else { return image };
        let nearest = c.distance_squared.sqrt();
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

    fn map_point(&self, point: PackedPoint) -> PackedImage {
        let corners = self.triangles[point.face as usize];
        let x = point.unpack().barycentric.map(S::of);
        let z = combine(&x, corners.map(|v| &self.z[v as usize]));
        let starts = corners.map(|v| self.starts[v as usize]);
        let image = self.source.project_near(&z, self.start_faces[point.face as usize], &starts);
        let image = self.guarded(&z, image);
        if image.face == NONE {
            return PackedImage::NOWHERE;
        }
        let (confidence, status) = if self.drift.is_empty() {
            Trust::unchecked(image.found)
        } else {
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

/// How much more anchors left out are made to count where there are few: four determine an affine map of space, and a mixture fits what so few say by chance.
fn few(anchors: usize) -> f64 {
    if anchors > 4 { anchors as f64 / (anchors - 4) as f64 } else { f64::INFINITY }
}

fn combine_scalars(point: PackedPoint, at: [f64; 3]) -> f64 {
    point.unpack().barycentric.iter().zip(at).map(|(x, d)| x * d).sum::<f64>().max(0.0)
}

fn usable_triangles(shape: &Shape<'_>) -> Vec<[u32; 3]> {
    let t = shape.topology;
    t.triangles.iter().zip(&t.usable).filter(|(_, u)| **u).map(|(t, _)| *t).collect()
}

impl<S: Real, const K: usize> PointMap for Field<S, K> {
    fn map(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> Result<()> {
        check_faces(points, self.triangles.len())?;
        images.clear();
        images.resize(points.len(), PackedImage::NOWHERE);
        images.par_chunks_mut(CHUNK).zip(points.par_chunks(CHUNK)).for_each(|(out, points)| {
            points.iter().zip(out).for_each(|(p, image)| *image = self.map_point(*p));
        });
        Ok(())
    }

    fn field(&self) -> Option<&FieldReport> {
        Some(&self.report)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Topology;
    use crate::models::shapes::lobed_sphere;
    use crate::surface::anchors::vertex_point;
    use crate::surface::embedding::{Embedding, Seconds};

    /// A mesh "embedded" by its own positions.
    fn embedded(mesh: &Mesh) -> (Topology, Embedding) {
        let points: Vec<f64> = mesh.positions.iter().flat_map(|p| [p.x, p.y, p.z, 0.0, 0.0, 0.0, 0.0, 0.0]).collect();
        let embedding = Embedding {
            dimension: 8,
            points,
            landmarks: Vec::new(),
            stress: 0.0,
            sweeps: 0,
            seconds: Seconds::default(),
            warnings: Vec::new(),
        };
        (Topology::new(mesh), embedding)
    }

    fn pairs(source: &Mesh, target: &Mesh, vertices: &[u32]) -> AnchorPairs {
        let points = |mesh: &Mesh| {
            let topology = Topology::new(mesh);
            vertices.iter().map(|&v| vertex_point(mesh, &topology, v, "anchor").unwrap()).collect()
        };
        AnchorPairs { source: points(source), target: points(target) }
    }

    /// Distances between the images of all vertices and the source's vertices of the same number, over the source's size, and the statuses.
    fn errors(source: &Mesh, target: &Mesh, vertices: &[u32], relax: bool) -> (Vec<f64>, Vec<PackedImage>) {
        let ((st, se), (tt, te)) = (embedded(source), embedded(target));
        let shape = |mesh, topology, embedding| Shape { mesh, topology, embedding: Some(embedding) };
        let options = FieldOptions { relax, ..FieldOptions::default() };
        let anchors = pairs(source, target, vertices);
        let field =
            Field::<f64, 12>::new::<8>(shape(source, &st, &se), shape(target, &tt, &te), &anchors, &options).unwrap();
        let points: Vec<PackedPoint> =
            (0..target.vertex_count() as u32).map(|v| tt.vertex_point(v).unwrap().into()).collect();
        let mut images = Vec::new();
        field.map(&points, &mut images).unwrap();
        let unit = source.area().sqrt();
        let off =
            images.iter().zip(&source.positions).map(|(i, p)| i.point().unwrap().position(source).distance(*p) / unit);
        (off.collect(), images)
    }

    fn most(e: &[f64]) -> f64 {
        e.iter().copied().fold(0.0, f64::max)
    }

    #[test]
    fn a_congruent_surface_is_met_exactly() {
        let target = lobed_sphere(3, 0.3);
        let mut source = target.clone();
        source.positions.iter_mut().for_each(|p| *p = DVec3::new(-p.y, p.x, p.z) * 3.0 + 1.0);
        let vertices: Vec<u32> = (0..target.vertex_count() as u32).step_by(29).collect();
        for relax in [false, true] {
            let (off, images) = errors(&source, &target, &vertices, relax);
            assert!(most(&off) < 1e-5, "{}", most(&off));
            assert!(images.iter().all(|i| i.status() == crate::surface::Status::Valid));
        }
        // A mirror image too.
        source.positions.iter_mut().for_each(|p| p.x = -p.x);
        assert!(most(&errors(&source, &target, &vertices, true).0) < 1e-5);
        // The measure can fail: two anchors exchanged.
        let mut wrong = vertices.clone();
        wrong.swap(2, 9);
        let (st, se) = embedded(&source);
        let (tt, te) = embedded(&target);
        let anchors = AnchorPairs {
            source: pairs(&source, &target, &wrong).source,
            target: pairs(&source, &target, &vertices).target,
        };
        let (s, t) = (
            Shape { mesh: &source, topology: &st, embedding: Some(&se) },
            Shape { mesh: &target, topology: &tt, embedding: Some(&te) },
        );
        let field = Field::<f64, 12>::new::<8>(s, t, &anchors, &FieldOptions::default()).unwrap();
        assert!(most(&field.report.left_out) > 0.1);
    }

    #[test]
    fn anchors_stay_where_they_are_put_and_few_give_a_result() {
        let target = lobed_sphere(3, 0.3);
        let mut source = target.clone();
        source.positions.iter_mut().for_each(|p| *p *= 1.0 + 0.25 * (2.0 * p.x).sin());
        let vertices: Vec<u32> = (0..target.vertex_count() as u32).step_by(29).collect();
        let (off, _) = errors(&source, &target, &vertices, true);
        for &v in &vertices {
            assert!(off[v as usize] < 1e-5, "{v}: {}", off[v as usize]);
        }
        assert!(off.iter().sum::<f64>() / (off.len() as f64) < 0.03);
        for count in 1..=5 {
            let (off, images) = errors(&source, &target, &vertices[..count], true);
            assert!(off.iter().all(|e| e.is_finite()), "{count}");
            // Few anchors tell nothing of one another.
            assert!(
                count > 4 || images.iter().filter(|i| i.status() == crate::surface::Status::Valid).count() <= count
            );
        }
    }
}
