//! The forward problem for points anywhere on a surface: weighted averages of surface points
//! (paper, section 3.3), in double precision.

use crate::engine::Real;
use crate::error::{Error, Result};
use crate::geometry::{NONE, SurfacePoint};

use super::correspondence::Shape;
use super::field::closest::{ClosestOnSurface, FLAT};
use super::project::{Found, Projection, SearchLimits};
use super::vector::{Vector, add_scaled};
use super::{NearestVertex, PhongSurface};

/// A projection this many mean edges farther than `FARTHER` times the closest point is one onto
/// another part of the surface.
const GUARD: f64 = 1.0;
const FARTHER: f64 = 1.5;

/// Which definition a weighted average follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// All averaged points lie in one triangle: see [`Forward::common_face`].
    Planar,
    /// The Phong projection of the average in the embedding (Definition 2).
    Projection,
    /// The closest point of the embedded surface: there is no Phong projection near, as beyond the
    /// boundary of an open mesh.
    Closest,
}

/// A weighted average on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Average {
    /// The point.
    pub point: SurfacePoint,
    /// Where it comes from.
    pub origin: Origin,
    /// Squared distance from the average in the embedding, in mean edges squared; 0 for planar
    /// averages.
    pub distance_squared: f64,
}

/// A surface embedded in R^D, on which any points can be averaged.
#[derive(Debug)]
pub struct Forward<const D: usize> {
    surface: PhongSurface<f64, D>,
    nearest: NearestVertex<D>,
}

impl<const D: usize> Forward<D> {
    /// Prepares the surface of `shape`. O(F D + V log V).
    ///
    /// # Errors
    /// [`Error::Input`] if the embedding is missing or not in D dimensions; as
    /// [`PhongSurface::new`].
    pub fn new(shape: Shape<'_>) -> Result<Self> {
        let Some(embedding) = shape.embedding.filter(|e| e.dimension == D) else {
            return Err(Error::input("an embedding is missing", format!("Embed the mesh in {D} dimensions")));
        };
        let surface = PhongSurface::new(shape.topology, &embedding.points)?;
        let nearest = NearestVertex::new(&surface);
        Ok(Self { surface, nearest })
    }

    /// The embedded surface.
    pub fn surface(&self) -> &PhongSurface<f64, D> {
        &self.surface
    }

    /// The point of R^D of a surface point, centred and in mean edges.
    pub fn embed(&self, p: &SurfacePoint) -> Vector<f64, D> {
        self.surface.embed(p)
    }

    /// A usable triangle that all points lie in, on its edges and corners included; the lowest one
    /// that the first point names or touches.
    ///
    /// Within one triangle the embedding is linear, so an average with nonnegative weights lies
    /// *on* the embedded triangle: its Phong projection is itself, at distance zero, which no other
    /// candidate of Definition 2 undercuts. The average is then the plain one of barycentric
    /// coordinates, without any iteration and exact to rounding.
    pub fn common_face(&self, points: &[SurfacePoint]) -> Option<u32> {
        let first = points.first()?;
        let holds = |t: u32| points.iter().all(|p| self.coordinates_in(p, t).is_some());
        if holds(first.face) {
            return Some(first.face);
        }
        // Another triangle can hold all only if the first point lies on its border.
        let v = self.surface.triangles[first.face as usize].v;
        let corner = (0..3).find(|&k| first.barycentric[k] > 0.0)?;
        if first.barycentric.iter().all(|b| *b > 0.0) {
            return None;
        }
        self.surface.fan(v[corner]).iter().copied().find(|&t| holds(t))
    }

    /// The barycentric coordinates of a point with respect to triangle `t`, if it lies in it.
    pub fn coordinates_in(&self, p: &SurfacePoint, t: u32) -> Option<[f64; 3]> {
        if p.face == t {
            return Some(p.barycentric);
        }
        let from = self.surface.triangles[p.face as usize].v;
        let to = self.surface.triangles[t as usize].v;
        let mut x = [0.0; 3];
        for (v, b) in from.into_iter().zip(p.barycentric).filter(|(_, b)| *b != 0.0) {
            x[to.iter().position(|&w| w == v)?] = b;
        }
        Some(x)
    }

    /// The point of a surface that a point of R^D stands for: its Phong projection, else the
    /// closest point.
    ///
    /// With a triangle `start` near the result (a warm start: paper, section 3.3) the search begins
    /// there and takes about a microsecond; with [`NONE`] at the exactly nearest vertex. A
    /// projection much farther away than the closest point lies on another part of the surface and
    /// does not count.
    pub fn project(&self, mean: &Vector<f64, D>, start: u32) -> Average {
        let corners = if start == NONE {
            [self.nearest.find(mean), NONE, NONE]
        } else {
            self.surface.triangles[start as usize].v
        };
        let projection = if start == NONE {
            self.surface.project(mean, &corners, SearchLimits::SECOND)
        } else {
            self.surface.project_near(mean, start, &corners)
        };
        let found = projection.found != Found::Nothing;
        if found && projection.distance_squared <= GUARD * GUARD {
            return average(&projection, Origin::Projection);
        }
        let vertex = self.surface.nearest_of(mean, &corners);
        let Some(c) = ClosestOnSurface::new(&self.surface, &self.nearest).near((mean, &FLAT), vertex) else {
            return average(&projection, Origin::Closest);
        };
        if found && projection.distance_squared.sqrt() <= FARTHER * c.distance_squared.sqrt() + GUARD {
            return average(&projection, Origin::Projection);
        }
        let point = SurfacePoint::new(c.face, c.x);
        Average { point, origin: Origin::Closest, distance_squared: c.distance_squared }
    }

    /// The weighted average of surface points; the weights sum to one. `start` as for
    /// [`Self::project`].
    ///
    /// Planar where all points of nonzero weight lie in one triangle and no weight is negative.
    pub fn average(&self, points: &[SurfacePoint], weights: &[f64], start: u32) -> Average {
        if weights.iter().all(|w| *w >= 0.0)
            && let Some(face) = self.common_face(points)
        {
            let x = points.iter().zip(weights).fold([0.0; 3], |sum, (p, w)| {
                let x = self.coordinates_in(p, face).unwrap_or_default();
                std::array::from_fn(|k| sum[k] + w * x[k])
            });
            return planar(face, x);
        }
        let mean = points.iter().zip(weights).fold([0.0; D], |sum, (p, w)| add_scaled(&sum, *w, &self.embed(p)));
        self.project(&mean, start)
    }
}

/// [`Forward`] in any dimension that embeddings have.
#[derive(Debug)]
pub enum AnyForward {
    /// In R^4.
    Four(Box<Forward<4>>),
    /// In R^8.
    Eight(Box<Forward<8>>),
    /// In R^12.
    Twelve(Box<Forward<12>>),
    /// In R^16.
    Sixteen(Box<Forward<16>>),
}

impl AnyForward {
    /// Prepares the surface of `shape`.
    ///
    /// # Errors
    /// [`Error::Input`] if the embedding is missing; [`Error::Mesh`] for the adjacency or embedding
    /// of another mesh; [`Error::Option`] if it is in another dimension than 4, 8, 12 and 16; as
    /// [`Forward::new`].
    pub fn new(shape: Shape<'_>) -> Result<Self> {
        shape.topology.check(shape.mesh)?;
        Ok(match super::correspondence::dimension(&shape, &shape)? {
            4 => Self::Four(Box::new(Forward::new(shape)?)),
            8 => Self::Eight(Box::new(Forward::new(shape)?)),
            12 => Self::Twelve(Box::new(Forward::new(shape)?)),
            16 => Self::Sixteen(Box::new(Forward::new(shape)?)),
            d => {
                let what = format!("{d} is not 4, 8, 12 or 16");
                return Err(Error::option("dimension", what, "Embed with one of these"));
            }
        })
    }
}

/// Runs the same code for the [`Forward`] of each dimension.
#[macro_export]
#[doc(hidden)]
macro_rules! forward_in_dimension {
    ($any:expr, $forward:ident => $work:expr) => {
        match $any {
            $crate::surface::forward::AnyForward::Four($forward) => $work,
            $crate::surface::forward::AnyForward::Eight($forward) => $work,
            $crate::surface::forward::AnyForward::Twelve($forward) => $work,
            $crate::surface::forward::AnyForward::Sixteen($forward) => $work,
        }
    };
}

/// A planar average.
pub fn planar(face: u32, x: [f64; 3]) -> Average {
    Average { point: SurfacePoint::new(face, x), origin: Origin::Planar, distance_squared: 0.0 }
}

fn average<S: Real>(p: &Projection<S>, origin: Origin) -> Average {
    let x = p.x.map(|x| x.to_f64());
    // A point that is not finite has no projection and no closest point either.
    let face = if p.face == NONE { 0 } else { p.face };
    Average { point: SurfacePoint::new(face, x), origin, distance_squared: p.distance_squared.to_f64() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Topology;
    use crate::models::shapes::{lobed_sphere, plane_grid};
    use crate::surface::{Embedding, EmbeddingOptions};

    #[test]
    fn planar_averages_are_phong_projections() {
        let mesh = lobed_sphere(3, 0.2);
        let topology = Topology::new(&mesh);
        let options = EmbeddingOptions { landmarks: 100, ..EmbeddingOptions::default() };
        let embedding = Embedding::compute(&mesh, &topology, &options, &crate::progress::Quiet).unwrap();
        let shape = Shape { mesh: &mesh, topology: &topology, embedding: Some(&embedding) };
        let forward = Forward::<8>::new(shape).unwrap();
        for t in (0..mesh.triangle_count() as u32).step_by(11) {
            let points = [[0.8, 0.1, 0.1], [0.1, 0.8, 0.1], [0.0, 0.3, 0.7]].map(|b| SurfacePoint::new(t, b));
            let weights = [0.5, 0.2, 0.3];
            let exact = forward.average(&points, &weights, NONE);
            assert_eq!((exact.origin, exact.point.face), (Origin::Planar, t));
            let mean = points.iter().zip(weights).fold([0.0; 8], |sum, (p, w)| add_scaled(&sum, w, &forward.embed(p)));
            for start in [NONE, t] {
                let found = forward.project(&mean, start);
                assert_eq!((found.origin, found.point.face), (Origin::Projection, t));
                for k in 0..3 {
                    assert!((found.point.barycentric[k] - exact.point.barycentric[k]).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn points_of_a_border_lie_in_both_triangles() {
        let mesh = plane_grid(4, 4, 1.0, 1.0, crate::models::shapes::Diagonal::Forward);
        let topology = Topology::new(&mesh);
        let options = EmbeddingOptions { landmarks: 20, ..EmbeddingOptions::default() };
        let embedding = Embedding::compute(&mesh, &topology, &options, &crate::progress::Quiet).unwrap();
        let shape = Shape { mesh: &mesh, topology: &topology, embedding: Some(&embedding) };
        let forward = Forward::<8>::new(shape).unwrap();
        let (t, k) = (0..mesh.triangle_count() as u32)
            .flat_map(|t| (0..3).map(move |k| (t, k)))
            .find(|&(t, k)| topology.neighbours[t as usize][k] != NONE)
            .unwrap();
        let s = topology.neighbours[t as usize][k];
        let mut edge = [0.5; 3];
        edge[k] = 0.0;
        let (on_edge, inside) = (SurfacePoint::new(t, edge), SurfacePoint::new(s, [0.3, 0.3, 0.4]));
        assert_eq!(forward.common_face(&[on_edge, inside]), Some(s));
        assert_eq!(forward.common_face(&[inside, on_edge]), Some(s));
        assert_eq!(forward.common_face(&[SurfacePoint::new(t, [0.3, 0.3, 0.4]), inside]), None);
        // Far outside the mesh there is no projection, but a closest point.
        let far = forward.embed(&inside).map(|x| x * 1e3);
        assert_eq!(forward.project(&far, NONE).origin, Origin::Closest);
    }
}
