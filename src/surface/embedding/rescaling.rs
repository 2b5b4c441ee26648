//! The scaling of an embedding once more, from another start: the same landmarks and distances, on
//! the way to the minimum by plain majorisation.

use faer::Mat;

use super::scaling::{ENOUGH, Problem, Step, Stop, descend};
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
    /// Measures the distances between the landmarks of `embedding` again, which
    /// [`Embedding::compute`] made of this mesh with these options, and sets up the scaling. O(L V
    /// log V) for the distances and O(L^3); 3 L^2 numbers are kept.
    ///
    /// # Errors
    /// [`Error::Input`] if the embedding is not one that [`Embedding::compute`] makes of this mesh
    /// with these options, as far as its landmarks tell; [`Error::Numeric`] as there.
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
        let mut own = Vec::with_capacity(parts.len());
        let mut first = 0;
        for (c, part) in parts.iter().enumerate() {
            let rest = &embedding.landmarks[first..];
            let here = &rest[..rest.iter().take_while(|&&v| component(v) == c as u32).count()];
            let place: Option<Vec<u32>> =
                here.iter().map(|v| part.vertices.binary_search(v).ok().map(|i| i as u32)).collect();
            let landmarks = place.filter(|l| l.len() > 1 && distinct(l));
            own.push((landmarks.ok_or_else(|| other(&format!("component {c} has no landmarks of its own")))?, first));
            first += here.len();
        }
        if first != embedding.landmarks.len() {
            return Err(other("some landmarks are on no component"));
        }
        let mut components = Vec::with_capacity(parts.len());
        for ((part, count), (landmarks, first)) in parts.iter().zip(counts).zip(own) {
            let distances = landmarks::measure(part, count, &landmarks, options, progress)?
                .ok_or_else(|| other("its landmarks were chosen with other options"))?;
            let problem = Problem::new(&distances, landmarks.len())?;
            components.push(Component { landmarks, first, problem });
        }
        Ok(Self { embedding, parts, components, vertex_count: mesh.vertex_count(), unit })
    }

    /// Scales from `start`, a row for each of [`Embedding::landmarks`] in the mesh's units, by at
    /// most `sweeps` sweeps; the other vertices follow as a least-squares mesh. The stress never
    /// rises above the start's. A component some of whose rows are not finite starts from where it
    /// is. O(sweeps L^2 D) and a sparse factorisation over all vertices.
    ///
    /// # Errors
    /// [`Error::Input`] for a wrong number of rows, [`Error::Numeric`] if a factorisation breaks
    /// down.
    pub fn restart(&self, start: &[f64], sweeps: usize, progress: &dyn Progress) -> Result<Embedding> {
        let (old, dimension) = (self.embedding, self.embedding.dimension);
        if start.len() != old.landmarks.len() * dimension {
            let what =
                format!("{} numbers for {} landmarks in {dimension} dimensions", start.len(), old.landmarks.len());
            return Err(Error::input(what, "Give a row for each landmark"));
        }
        progress.stage("multidimensional scaling", sweeps as u64 * self.components.len() as u64);
        let stop = Stop { sweeps, tolerance: EmbeddingOptions::default().tolerance, enough: ENOUGH };
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
            let scaled = descend(&c.problem, begin, Step::Plain, stop, || progress.advance(1))?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::shapes::lobed_sphere;
    use crate::progress::Quiet;

    fn options() -> EmbeddingOptions {
        EmbeddingOptions { landmarks: 100, mid_level: 400, ..EmbeddingOptions::default() }
    }

    fn embedded(mesh: &Mesh) -> (Topology, Embedding) {
        let topology = Topology::new(mesh);
        let embedding = Embedding::compute(mesh, &topology, &options(), &Quiet).unwrap();
        (topology, embedding)
    }

    fn rows(e: &Embedding) -> Vec<f64> {
        e.landmarks.iter().flat_map(|&v| e.point(v as usize)).copied().collect()
    }

    /// Root of the mean squared distance between points of the same number, over that from the
    /// middle.
    fn apart(a: &Embedding, b: &Embedding) -> f64 {
        let square = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
        let difference: Vec<f64> = a.points.iter().zip(&b.points).map(|(x, y)| x - y).collect();
        (square(&difference) / square(&a.points)).sqrt()
    }

    #[test]
    fn from_where_it_is_little_changes_and_a_turned_start_turns_it() {
        // Not in the mesh's units by chance, and measured on a simplified mesh.
        let mut mesh = lobed_sphere(3, 0.3);
        mesh.positions.iter_mut().for_each(|p| *p = *p * 7.0 + 2.0);
        let (topology, e) = embedded(&mesh);
        let scaling = Rescaling::new(&mesh, &topology, &e, &options(), &Quiet).unwrap();
        let same = scaling.restart(&rows(&e), 100, &Quiet).unwrap();
        assert!(
            same.stress <= e.stress * (1.0 + 1e-9) && same.stress >= 0.97 * e.stress,
            "{} {}",
            same.stress,
            e.stress
        );
        assert!(apart(&e, &same) < 0.02, "{}", apart(&e, &same));
        assert_eq!(same.landmarks, e.landmarks);
        let blank = vec![f64::NAN; rows(&e).len()];
        assert_eq!(scaling.restart(&blank, 100, &Quiet).unwrap().to_bytes(), same.to_bytes());

        let turn =
            |x: &[f64]| -> Vec<f64> { x.chunks_exact(8).flat_map(|y| (0..8).map(|k| -y[(k + 3) % 8])).collect() };
        let turned = scaling.restart(&turn(&rows(&e)), 100, &Quiet).unwrap();
        let wanted = Embedding { points: turn(&same.points), ..same.clone() };
        assert!(apart(&wanted, &turned) < 1e-3, "{}", apart(&wanted, &turned));
        assert!(apart(&same, &turned) > 0.5);

        // The measure can fail: a start that is off has more stress, and what was swept has less
        // again.
        let off: Vec<f64> = rows(&e).iter().enumerate().map(|(i, x)| x * (1.0 + 0.3 * (i as f64).sin())).collect();
        let [none, some] = [0, 100].map(|sweeps| scaling.restart(&off, sweeps, &Quiet).unwrap().stress);
        assert!(none > 2.0 * e.stress && some < 0.5 * none, "{none} {some} {}", e.stress);
    }

    #[test]
    fn components_stay_apart() {
        let (one, mut two) = (lobed_sphere(2, 0.3), lobed_sphere(2, 0.1));
        two.positions.iter_mut().for_each(|p| p.x += 4.0);
        let n = one.vertex_count() as u32;
        let triangles = [one.triangles(), two.triangles().iter().map(|t| t.map(|v| v + n)).collect()].concat();
        let mesh = Mesh::of_triangles("two", [one.positions, two.positions].concat(), &triangles);
        let (topology, e) = embedded(&mesh);
        let scaling = Rescaling::new(&mesh, &topology, &e, &options(), &Quiet).unwrap();
        // Only the second is given a start, somewhere else.
        let mut start = rows(&e);
        for (i, y) in e.landmarks.iter().zip(start.chunks_exact_mut(8)) {
            y.iter_mut().for_each(|x| *x = if *i < n { f64::NAN } else { *x + 50.0 });
        }
        let again = scaling.restart(&start, 100, &Quiet).unwrap();
        assert!(apart(&e, &again) < 0.02, "{}", apart(&e, &again));
    }

    #[test]
    fn other_embeddings_are_refused() {
        let mesh = lobed_sphere(3, 0.3);
        let (topology, e) = embedded(&mesh);
        let refused = |e: &Embedding, options: &EmbeddingOptions, words: &str| {
            let error = Rescaling::new(&mesh, &topology, e, options, &Quiet).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        };
        let o = options();
        refused(&Embedding { landmarks: Vec::new(), ..e.clone() }, &o, "no landmarks");
        refused(&Embedding { landmarks: vec![3, 3], ..e.clone() }, &o, "component 0");
        refused(&Embedding { landmarks: vec![3, 4, u32::MAX], ..e.clone() }, &o, "on no component");
        refused(&Embedding { points: e.points[8..].to_vec(), ..e.clone() }, &o, "another mesh");
        refused(&e, &EmbeddingOptions { dimension: 4, ..o }, "dimension");
        // Of another simplified mesh.
        let every: Vec<u32> = (0..mesh.vertex_count() as u32).collect();
        refused(&Embedding { landmarks: every, ..e.clone() }, &o, "other options");
        let scaling = Rescaling::new(&mesh, &topology, &e, &o, &Quiet).unwrap();
        assert!(scaling.restart(&rows(&e)[8..], 10, &Quiet).is_err());
    }
}
