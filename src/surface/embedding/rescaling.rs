//! The scaling of an embedding once more, from another start: the same landmarks and distances, another of the many nearly equal minima of the stress.

use faer::Mat;

use super::scaling::{Problem, Stop, descend};
use super::{Embedding, EmbeddingOptions, LEAST_LANDMARKS, assemble, landmarks, least_squares, parts};
use crate::error::{Error, Result};
use crate::geometry::{Mesh, NONE, Topology};
use crate::progress::Progress;

/// The scaling of one component.
#[derive(Debug)]
struct Component {
    /// Its landmarks, in its own numbering, and where they stand among all.
    landmarks: Vec<u32>,
    first: usize,
    problem: Problem,
}

/// The embedding of a mesh, ready to be scaled again from other starts ([`Rescaling::restart`]).
#[derive(Debug)]
pub struct Rescaling<'a> {
    embedding: &'a Embedding,
    parts: Vec<parts::Part>,
    /// One for each part.
    components: Vec<Component>,
    vertex_count: usize,
    /// Length of the parts' unit in the mesh's.
    unit: f64,
}

impl<'a> Rescaling<'a> {
    /// Measures the distances between the landmarks of `embedding` again, which [`Embedding::compute`] made of this mesh with these options, and sets up the scaling. O(L V log V) for the distances
    /// and O(L^3); 3 L^2 numbers are kept.
    ///
    /// # Errors
    /// [`Error::Input`] if the embedding is not one that [`Embedding::compute`] makes of this mesh with these options, as far as its landmarks tell; [`Error::Numeric`] as there.
    pub fn new(
        mesh: &Mesh,
        topology: &Topology,
        embedding: &'a Embedding,
        options: &EmbeddingOptions,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let other = |what: &str| {
            Error::input(
                format!("the embedding of {} cannot be scaled again: {what}", mesh.name),
                "Give it as Embedding::compute makes it, with the same mesh and options",
            )
        };
        if topology.vertex_count() != mesh.vertex_count()
            || embedding.dimension != options.dimension
            || ![4, 8, 12, 16].contains(&embedding.dimension)
            || embedding.points.len() != mesh.vertex_count() * embedding.dimension
        {
            return Err(other("it is of another mesh or dimension"));
        }
        if embedding.landmarks.is_empty() {
            return Err(other("it has no landmarks"));
        }
        let unit = parts::unit_length(mesh, topology);
        let parts = parts::split(mesh, topology, unit);
        let counts = parts::share(&parts, options.landmarks, LEAST_LANDMARKS);
        let component = |v: u32| topology.vertex_component.get(v as usize).copied().unwrap_or(NONE);
        let mut components = Vec::with_capacity(parts.len());
        let mut first = 0;
        for (c, (part, count)) in parts.iter().zip(counts).enumerate() {
            let rest = &embedding.landmarks[first..];
            let own = &rest[..rest.iter().take_while(|&&v| component(v) == c as u32).count()];
            let place: Option<Vec<u32>> =
                own.iter().map(|v| part.vertices.binary_search(v).ok().map(|i| i as u32)).collect();
            let landmarks = place.filter(|l| !l.is_empty() && distinct(l));
            let landmarks = landmarks.ok_or_else(|| other(&format!("component {c} has no landmarks of its own")))?;
            let distances = landmarks::measure(part, count, &landmarks, options, progress)
                .ok_or_else(|| other("its landmarks were chosen with other options"))?;
            let problem = Problem::new(&distances, landmarks.len())?;
            components.push(Component { landmarks, first, problem });
            first += own.len();
        }
        if first != embedding.landmarks.len() {
            return Err(other("some landmarks are on no component"));
        }
        Ok(Self { embedding, parts, components, vertex_count: mesh.vertex_count(), unit })
    }

    /// Scales from `start`, a row for each of [`Embedding::landmarks`] in the mesh's units, by at most `sweeps` sweeps; the other vertices follow as a least-squares mesh. The stress never rises
    /// above the start's. A component some of whose rows are not finite starts from where it is. O(sweeps L^2 D) and a sparse factorisation over all vertices.
    ///
    /// # Errors
    /// [`Error::Input`] for a wrong number of rows, [`Error::Numeric`] if a factorisation breaks down.
    pub fn restart(&self, start: &[f64], sweeps: usize, progress: &dyn Progress) -> Result<Embedding> {
        let (old, dimension) = (self.embedding, self.embedding.dimension);
        if start.len() != old.landmarks.len() * dimension {
            let what =
                format!("{} numbers for {} landmarks in {dimension} dimensions", start.len(), old.landmarks.len());
            return Err(Error::input(what, "Give a row for each landmark"));
        }
        progress.stage("multidimensional scaling", sweeps as u64 * self.components.len() as u64);
        let stop = Stop { sweeps, tolerance: EmbeddingOptions::default().tolerance };
        let one = |(c, part): (&Component, &parts::Part)| -> Result<(Vec<f64>, f64, u64)> {
            let m = c.landmarks.len();
            let rows = &start[c.first * dimension..][..m * dimension];
            let own = || -> Vec<f64> {
                old.landmarks[c.first..][..m].iter().flat_map(|&v| old.point(v as usize)).copied().collect()
            };
            let rows = if rows.iter().all(|x| x.is_finite()) { rows.to_vec() } else { own() };
            // Near the origin, where rounding is least.
            let middle: Vec<f64> =
                (0..dimension).map(|k| rows.iter().skip(k).step_by(dimension).sum::<f64>() / m as f64).collect();
            let begin = Mat::from_fn(m, dimension, |i, k| (rows[i * dimension + k] - middle[k]) / self.unit);
            let scaled = descend(&c.problem, begin, stop, || progress.advance(1));
            let targets: Vec<f64> = (0..m * dimension).map(|k| scaled.points[(k / dimension, k % dimension)]).collect();
            let points =
                least_squares::least_squares_mesh(&part.positions, &part.triangles, &c.landmarks, &targets, dimension)?;
            Ok((points, scaled.stress.last().copied().unwrap_or(0.0), scaled.stress.len() as u64 - 1))
        };
        let made: Vec<(Vec<f64>, f64, u64)> =
            self.components.iter().zip(&self.parts).map(one).collect::<Result<_>>()?;
        let pairs = |c: &Component| (c.landmarks.len() * (c.landmarks.len() - 1)) as f64;
        let stress: f64 = self.components.iter().zip(&made).map(|(c, m)| pairs(c) * m.1).sum();
        let sweeps = made.iter().map(|m| m.2).max().unwrap_or(0);
        let points: Vec<Vec<f64>> = made.into_iter().map(|m| m.0).collect();
        Ok(Embedding {
            points: assemble(self.vertex_count, &self.parts, &points, dimension, self.unit),
            stress: stress / self.components.iter().map(pairs).sum::<f64>().max(1.0),
            sweeps,
            ..old.clone()
        })
    }
}

fn distinct(landmarks: &[u32]) -> bool {
    let mut sorted = landmarks.to_vec();
    sorted.sort_unstable();
    sorted.windows(2).all(|w| w[0] < w[1])
}
