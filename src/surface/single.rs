//! The inverse and the forward problem on one surface (paper, sections 3.3 and 3.4), in double
//! precision.

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::geometry::{NONE, SurfacePoint};

use super::average::{orthonormalise, weights};
use super::correspondence::Shape;
use super::project::{Found, Projection, SearchLimits};
use super::vector::{Vector, add_scaled};
use super::{NearestVertex, PhongSurface};

/// A weighted average on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AveragePoint {
    /// The point.
    pub point: SurfacePoint,
    /// Whether it is a Phong projection of the average; otherwise the nearest vertex stands in.
    pub found: bool,
}

/// Anchors on an embedded surface, for weights of points and averages of weights.
pub struct WeightedPoints(Box<dyn Solve>);

impl std::fmt::Debug for WeightedPoints {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("WeightedPoints")
    }
}

trait Solve: Send + Sync {
    fn weights(&self, points: &[SurfacePoint]) -> Vec<f64>;
    fn averages(&self, weights: &[Vec<f64>]) -> Vec<AveragePoint>;
    fn faces(&self) -> usize;
    fn anchors(&self) -> usize;
}

struct Solver<const D: usize> {
    surface: PhongSurface<f64, D>,
    anchors: Vec<Vector<f64, D>>,
    /// The triangles they lie on.
    anchor_faces: Vec<u32>,
    nearest: NearestVertex<D>,
}

impl WeightedPoints {
    /// Embeds the anchors.
    ///
    /// # Errors
    /// If the shape has no embedding, there is no anchor, or one is not on the mesh.
    pub fn new(shape: Shape<'_>, anchors: &[SurfacePoint]) -> Result<Self> {
        let pairs = super::AnchorPairs { source: anchors.to_vec(), target: anchors.to_vec() };
        pairs.check((shape.mesh, shape.topology), (shape.mesh, shape.topology))?;
        Ok(Self(match super::correspondence::dimension(&shape, &shape)? {
            4 => Box::new(Solver::<4>::new(shape, anchors)?),
            8 => Box::new(Solver::<8>::new(shape, anchors)?),
            12 => Box::new(Solver::<12>::new(shape, anchors)?),
            16 => Box::new(Solver::<16>::new(shape, anchors)?),
            d => {
                return Err(Error::option(
                    "dimension",
                    format!("{d} is not 4, 8, 12 or 16"),
                    "Embed with one of these",
                ));
            }
        }))
    }

    /// The inverse problem (eq. 13): a row of weights per point, one per anchor, summing to one.
    /// O(points x anchors x D).
    ///
    /// # Errors
    /// If a point is not on the mesh.
    pub fn weights(&self, points: &[SurfacePoint]) -> Result<Vec<f64>> {
        match points
            .iter()
            .position(|p| p.face as usize >= self.0.faces() || !p.barycentric.iter().all(|x| x.is_finite()))
        {
            None => Ok(self.0.weights(points)),
            Some(i) => Err(Error::input(
                format!("point {i} (face {}) is not on the mesh of {} faces", points[i].face, self.0.faces()),
                "Faces are counted from 0 after fan triangulation",
            )),
        }
    }

    /// The forward problem: the Phong projection of each weighted average, searched from the
    /// exactly nearest vertex and from the heaviest anchor.
    ///
    /// # Errors
    /// If a row has another number of weights than there are anchors, or does not sum to one within
    /// 1e-6.
    pub fn averages(&self, weights: &[Vec<f64>]) -> Result<Vec<AveragePoint>> {
        for (i, row) in weights.iter().enumerate() {
            let sum: f64 = row.iter().sum();
            if row.len() != self.0.anchors() || !((sum - 1.0).abs() <= 1e-6) {
                return Err(Error::input(
                    format!("row {i} has {} weights of sum {sum}", row.len()),
                    format!("Give {} weights that sum to one", self.0.anchors()),
                ));
            }
        }
        Ok(self.0.averages(weights))
    }
}

impl<const D: usize> Solver<D> {
    fn new(shape: Shape<'_>, anchors: &[SurfacePoint]) -> Result<Self> {
        let points = shape.embedding.map(|e| e.points.as_slice()).unwrap_or_default();
        let surface = PhongSurface::<f64, D>::new(shape.topology, points)?;
        let anchor_faces = anchors.iter().map(|p| p.face).collect();
        let anchors = anchors.iter().map(|p| surface.embed(p)).collect();
        let nearest = NearestVertex::new(&surface);
        Ok(Self { surface, anchors, anchor_faces, nearest })
    }

    /// The projection of an average: the closer of what is found from the nearest vertex and from
    /// the anchor that weighs most (paper, section 3.3). Where the surface is crumpled, the nearest
    /// vertex of a point need not belong to its triangle.
    fn average(&self, row: &[f64]) -> Projection<f64> {
        let mean = row.iter().zip(&self.anchors).fold([0.0; D], |sum, (&w, a)| add_scaled(&sum, w, a));
        let found = self.surface.project(&mean, &[self.nearest.find(&mean)], SearchLimits::SECOND);
        let heaviest = (0..row.len()).fold(0, |k, i| if row[i] > row[k] { i } else { k });
        match self.surface.project_from(&mean, self.anchor_faces[heaviest], &[]) {
            Some(p) if found.found == Found::Nothing || p.distance_squared < found.distance_squared => p,
            _ => found,
        }
    }
}

impl<const D: usize> Solve for Solver<D> {
    fn weights(&self, points: &[SurfacePoint]) -> Vec<f64> {
        let n = self.anchors.len();
        let mut all = vec![0.0; points.len() * n];
        all.par_chunks_mut(n).zip(points).for_each(|(row, p)| {
            let t = self.surface.triangle(p.face);
            weights(&t.point(&p.barycentric), &orthonormalise(t.psi(&p.barycentric)), &self.anchors, row);
        });
        all
    }

    fn averages(&self, weights: &[Vec<f64>]) -> Vec<AveragePoint> {
        weights
            .par_iter()
            .map(|row| {
                let p = self.average(row);
                let point = SurfacePoint::new(if p.face == NONE { 0 } else { p.face }, p.x);
                AveragePoint { point, found: p.found != Found::Nothing }
            })
            .collect()
    }

    fn faces(&self) -> usize {
        self.surface.triangles.len()
    }

    fn anchors(&self) -> usize {
        self.anchors.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Topology;
    use crate::models::shapes::lobed_sphere;
    use crate::surface::Embedding;
    use crate::surface::EmbeddingOptions;

    #[test]
    fn averages_of_weights_return_to_the_points() {
        let mesh = lobed_sphere(3, 0.2);
        let topology = Topology::new(&mesh);
        let options = EmbeddingOptions { landmarks: 200, ..EmbeddingOptions::default() };
        let embedding = Embedding::compute(&mesh, &topology, &options, &crate::progress::Quiet).unwrap();
        let shape = Shape { mesh: &mesh, topology: &topology, embedding: Some(&embedding) };
        let spread = |step: usize, b| -> Vec<SurfacePoint> {
            (0..mesh.triangle_count()).step_by(step).map(|t| SurfacePoint::new(t as u32, b)).collect()
        };
        let solver = WeightedPoints::new(shape, &spread(29, [1.0, 0.0, 0.0])).unwrap();
        let points = spread(7, [0.2, 0.5, 0.3]);
        let weights = solver.weights(&points).unwrap();
        let rows: Vec<Vec<f64>> = weights.chunks(weights.len() / points.len()).map(<[f64]>::to_vec).collect();
        let back = solver.averages(&rows).unwrap();
        let off = points
            .iter()
            .zip(&back)
            .filter(|(p, q)| p.position(&mesh).distance(q.point.position(&mesh)) > 1e-6 * mesh.mean_edge_length())
            .count();
        // Well covered by 45 anchors: what is left are other candidates as near as the right one.
        assert!(off * 50 <= points.len(), "{off} of {}", points.len());
        assert!(solver.averages(&[vec![1.0; 3]]).is_err());
        assert!(solver.averages(&[vec![2.0; rows[0].len()]]).is_err());
    }
}
