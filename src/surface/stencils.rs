//! Weighted averages of surface points in batches: every average of a few points of a list, as
//! subdivision and smoothing take them.

use rayon::prelude::*;

use super::forward::{Average, Forward};
use super::vector::{Vector, distance_squared};
use crate::geometry::{NONE, SurfacePoint};

/// Averages computed by one task.
const CHUNK: usize = 256;
/// Points farther than this, in mean edges, from the one a search would begin at are averaged by a
/// search over the whole surface.
const FAR: f64 = 8.0;

/// Weighted averages of points of a list: a row each, of entries with weights and of the row's own
/// point, which has the rest of the weight and near which a search begins.
#[derive(Clone, Debug, PartialEq)]
pub struct Stencils {
    start: Vec<u32>,
    own: Vec<u32>,
    entries: Vec<u32>,
    weights: Vec<f64>,
}

impl Default for Stencils {
    fn default() -> Self {
        Self { start: vec![0], own: Vec::new(), entries: Vec::new(), weights: Vec::new() }
    }
}

impl Stencils {
    /// Appends a row of equal weights that sum to `sum`; without entries it is its own point.
    pub fn push(&mut self, own: u32, entries: impl IntoIterator<Item = u32>, sum: f64) {
        let first = self.entries.len();
        self.entries.extend(entries);
        let each = sum / (self.entries.len() - first).max(1) as f64;
        self.weights.resize(self.entries.len(), each);
        self.start.push(self.entries.len() as u32);
        self.own.push(own);
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.own.len()
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.own.is_empty()
    }

    /// A row's own point, its entries and their weights.
    pub fn row(&self, r: usize) -> (u32, &[u32], &[f64]) {
        let range = self.start[r] as usize..self.start[r + 1] as usize;
        (self.own[r], &self.entries[range.clone()], &self.weights[range])
    }

    /// Multiplies the weight of each entry by a factor of its row's own point and the entry.
    pub fn scale(&mut self, factor: impl Fn(u32, u32) -> f64 + Sync) {
        for r in 0..self.own.len() {
            for k in self.start[r] as usize..self.start[r + 1] as usize {
                self.weights[k] *= factor(self.own[r], self.entries[k]);
            }
        }
    }
}

impl<const D: usize> Forward<D> {
    /// The averages of all rows, in parallel. Each search begins at the row's own point, or where
    /// that is far off everywhere. O(rows).
    ///
    /// The same, bit for bit, as [`Self::average_row`] for each row, for any number of threads.
    pub fn averages(&self, points: &[SurfacePoint], rows: &Stencils) -> Vec<Average> {
        let embedded: Vec<Vector<f64, D>> = points.par_iter().with_min_len(CHUNK).map(|p| self.embed(p)).collect();
        (0..rows.len()).into_par_iter().with_min_len(CHUNK).map(|r| self.row(points, &embedded, rows, r)).collect()
    }

    /// Whether an entry of some row is so far from the row's own point that its average is searched
    /// on the whole surface.
    pub fn reaches_far(&self, points: &[SurfacePoint], rows: &Stencils) -> bool {
        (0..rows.len()).into_par_iter().with_min_len(CHUNK).any(|r| {
            let (own, entries, _) = rows.row(r);
            let y = self.embed(&points[own as usize]);
            entries.iter().any(|&i| distance_squared(&y, &self.embed(&points[i as usize])) > FAR * FAR)
        })
    }

    /// The average of one row.
    pub fn average_row(&self, points: &[SurfacePoint], rows: &Stencils, r: usize) -> Average {
        let (own, entries, weights) = rows.row(r);
        let (local, embedded): (Vec<SurfacePoint>, Vec<Vector<f64, D>>) =
            [own].iter().chain(entries).map(|&i| (points[i as usize], self.embed(&points[i as usize]))).unzip();
        let one = Stencils {
            start: vec![0, entries.len() as u32],
            own: vec![0],
            entries: (1..=entries.len() as u32).collect(),
            weights: weights.to_vec(),
        };
        self.row(&local, &embedded, &one, 0)
    }

    fn row(&self, points: &[SurfacePoint], embedded: &[Vector<f64, D>], rows: &Stencils, r: usize) -> Average {
        let (own, entries, weights) = rows.row(r);
        let rest = 1.0 - weights.iter().sum::<f64>();
        // What rounding leaves of a weight of zero would only keep the average from being planar.
        let rest = if rest.abs() < 1e-15 * (1 + entries.len()) as f64 { 0.0 } else { rest };
        let own_point = &points[own as usize];
        let all = || entries.iter().copied().zip(weights.iter().copied()).chain([(own, rest)]).filter(|e| e.1 != 0.0);
        let beside =
            entries.first().is_none_or(|&i| self.coordinates_in(&points[i as usize], own_point.face).is_some());
        if beside && all().all(|e| e.1 > 0.0) {
            let here: Vec<SurfacePoint> = all().map(|e| points[e.0 as usize]).collect();
            if let Some(face) = self.common_face(&here) {
                let x = here.iter().zip(all()).fold([0.0; 3], |sum, (p, (_, w))| {
                    let x = self.coordinates_in(p, face).unwrap_or_default();
                    std::array::from_fn(|k| sum[k] + w * x[k])
                });
                return super::forward::planar(face, x);
            }
        }
        let mut mean = [0.0; D];
        for (i, w) in all() {
            for (m, y) in mean.iter_mut().zip(&embedded[i as usize]) {
                *m += w * y;
            }
        }
        let far = distance_squared(&mean, &embedded[own as usize]) > FAR * FAR;
        self.project(&mean, if far { NONE } else { own_point.face })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Topology;
    use crate::models::shapes::{Random, lobed_sphere};
    use crate::surface::correspondence::Shape;
    use crate::surface::{Embedding, EmbeddingOptions};

    #[test]
    fn batches_are_what_single_averages_are() {
        let mesh = lobed_sphere(3, 0.2);
        let topology = Topology::new(&mesh);
        let options = EmbeddingOptions { landmarks: 100, ..EmbeddingOptions::default() };
        let embedding = Embedding::compute(&mesh, &topology, &options, &crate::progress::Quiet).unwrap();
        let shape = Shape { mesh: &mesh, topology: &topology, embedding: Some(&embedding) };
        let forward = Forward::<8>::new(shape).unwrap();
        let mut random = Random::new(3);
        let points: Vec<SurfacePoint> = (0..500)
            .map(|_| {
                let (a, b) = (random.unit(), random.unit());
                let face = (random.unit() * mesh.triangle_count() as f64) as u32;
                SurfacePoint::new(face, [a * b, a * (1.0 - b), 1.0 - a])
            })
            .collect();
        for sum in [1.0, 0.5] {
            let mut rows = Stencils::default();
            for r in 0..400u32 {
                rows.push(r, (0..r % 6).map(|k| (r * 7 + k * 13) % 500), sum);
            }
            let batch = forward.averages(&points, &rows);
            let one: Vec<Average> = (0..400).map(|r| forward.average_row(&points, &rows, r)).collect();
            assert_eq!(batch, one);
            // Rows without entries are their own points.
            assert_eq!(batch[6].point, points[6]);
            // The comparison rejects an average with other weights.
            let mut wrong = rows.clone();
            wrong.scale(|_, _| 0.99);
            assert_ne!(forward.averages(&points, &wrong), batch);
        }
    }
}
