//! The Euclidean embedding of a surface (section 3.5): every vertex gets a point of R^D such that
//! straight distances in R^D are close to geodesic ones.
//!
//! Landmarks are spread over the surface ([`EmbeddingOptions::landmarks`]), the geodesic distances
//! between them are measured by fast marching (on a simplified mesh if the mesh is large),
//! multidimensional scaling gives them positions, and the other vertices follow as a least-squares
//! mesh. The components of a mesh are embedded apart and put far from one another.

mod cache;
mod landmarks;
mod least_squares;
mod parts;
mod rescaling;
mod scaling;
mod together;

use web_time::Instant;

pub use cache::{ALGORITHM_VERSION, cache_key};
pub use rescaling::Rescaling;

use crate::control;
use crate::error::{Error, Result};
use crate::geometry::{Mesh, Topology};
use crate::progress::{Progress, Quiet};
use crate::words::words;

/// Landmarks that every component gets at least, if it has as many vertices.
const LEAST_LANDMARKS: usize = 24;
/// Largest number of landmarks: their distances are a dense matrix, and setting up the scaling
/// takes the cube of their number.
const MOST_LANDMARKS: usize = 5000;
/// Components with fewer vertices report no progress of their own.
const SHOWN: usize = 2000;
/// Components that are named one by one in the warnings.
const NAMED: usize = 8;

/// How landmarks are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sampling {
    /// Each as far as possible from all before it, along the surface. Somewhat better for far
    /// distances on plump shapes.
    FarthestPoint,
    /// What half-edge collapses by least change of normals leave over, as in the paper: more
    /// landmarks where the surface is curved. Much better on thin and detailed parts (fingers,
    /// ears, mouths), which farthest points miss and the least-squares mesh then flattens.
    #[default]
    Decimation,
}

words! { Sampling, "sampling", "a sampling":
    FarthestPoint => "farthest",
    Decimation => "decimation",
}

/// How an embedding is computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmbeddingOptions {
    /// Number of landmarks, shared out to the components by area; 4 to 5000.
    pub landmarks: usize,
    /// How they are chosen.
    pub sampling: Sampling,
    /// Dimension of the space: 4, 8, 12 or 16.
    pub dimension: usize,
    /// Largest number of sweeps of the scaling.
    pub sweeps: usize,
    /// The scaling stops when ten sweeps lower the stress by less than this part of it.
    pub tolerance: f64,
    /// Geodesic distances are measured on a mesh simplified to about this many vertices if there
    /// are more (at least four times the landmarks).
    pub mid_level: usize,
}

impl Default for EmbeddingOptions {
    fn default() -> Self {
        Self {
            landmarks: 2000,
            sampling: Sampling::default(),
            dimension: 8,
            sweeps: 300,
            tolerance: 1e-3,
            mid_level: 8_000,
        }
    }
}

impl EmbeddingOptions {
    /// # Errors
    /// [`Error::Option`] naming the first option out of range.
    fn check(&self) -> Result<()> {
        if !(4..=MOST_LANDMARKS).contains(&self.landmarks) {
            let what = format!("{} is not between 4 and {MOST_LANDMARKS}", self.landmarks);
            return Err(Error::option("landmarks", what, "2000 is enough for nearly every mesh"));
        }
        if ![4, 8, 12, 16].contains(&self.dimension) {
            let what = format!("{} is not 4, 8, 12 or 16", self.dimension);
            return Err(Error::option("dimension", what, "8 is enough for nearly every mesh"));
        }
        if self.tolerance.is_nan() || self.tolerance < 0.0 {
            let what = format!("{} is not a number from 0 on", self.tolerance);
            return Err(Error::option("tolerance", what, "Use 1e-3"));
        }
        Ok(())
    }
}

/// Wall-clock seconds of the stages.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seconds {
    /// Making the mid-level mesh.
    pub simplification: f64,
    /// Choosing landmarks.
    pub sampling: f64,
    /// Distances between landmarks.
    pub geodesics: f64,
    /// Multidimensional scaling.
    pub scaling: f64,
    /// The least-squares mesh.
    pub upsampling: f64,
}

/// A point of R^D for every vertex of a mesh.
#[derive(Clone, Debug)]
pub struct Embedding {
    /// D.
    pub dimension: usize,
    /// One row of D coordinates per vertex, in the mesh's units; NaN where the vertex is in no
    /// usable triangle.
    pub points: Vec<f64>,
    /// The landmarks, as vertices of the mesh, component by component.
    pub landmarks: Vec<u32>,
    /// Mean of (1 - d/Q)^2 over the pairs of landmarks of the same component; d is the distance in
    /// R^D, Q the geodesic one.
    pub stress: f64,
    /// Sweeps of the scaling (of the component that took most).
    pub sweeps: u64,
    /// Time it took.
    pub seconds: Seconds,
    /// What the user should know, in full sentences.
    pub warnings: Vec<String>,
}

impl Embedding {
    /// Embeds `mesh`, whose adjacency is `topology`.
    ///
    /// Deterministic for any number of threads, and scales with the mesh. Time: O(L V' log V') for
    /// the distances of L landmarks on a mid-level mesh of V' vertices, O(L^3 + sweeps L^2 D) for
    /// the scaling, and a sparse factorisation over V vertices.
    ///
    /// Source: section 3.5, equations 14 and 15.
    ///
    /// # Errors
    /// [`Error::Option`] for options out of range, [`Error::Mesh`] if the mesh has no usable
    /// triangle or does not fit `topology`, [`Error::Numeric`] if a factorisation breaks down.
    pub fn compute(
        mesh: &Mesh,
        topology: &Topology,
        options: &EmbeddingOptions,
        progress: &dyn Progress,
    ) -> Result<Self> {
        options.check()?;
        topology.check(mesh)?;
        let unit = parts::unit_length(mesh, topology);
        if topology.component_count == 0 || !unit.is_finite() || unit <= 0.0 {
            return Err(Error::mesh(
                &mesh.name,
                "it has no triangle with an area that could be embedded",
                "Check that the file holds faces and that their vertices do not coincide",
            ));
        }
        let parts = parts::split(mesh, topology, unit);
        let counts = parts::share(&parts, options.landmarks, LEAST_LANDMARKS);
        let most = counts.iter().copied().max().unwrap_or(0);
        control::require(bytes(mesh.vertex_count(), most), || {
            format!("embedding {} with {} vertices and {most} landmarks", mesh.name, mesh.vertex_count())
        })?;
        let mut seconds = Seconds::default();
        let mut landmarks = Vec::new();
        let (mut stress, mut pairs, mut sweeps) = (0.0, 0usize, 0);
        let mut embedded = Vec::with_capacity(parts.len());
        for (part, &count) in parts.iter().zip(&counts) {
            // Small parts among larger ones are done before a bar could be read.
            let quiet = parts.len() > 1 && part.vertices.len() < SHOWN;
            let progress = if quiet { &Quiet } else { progress };
            let one = embed_part(part, count, options, &mut seconds, progress)?;
            let here = one.landmarks.len() * (one.landmarks.len() - 1);
            stress += one.stress * here as f64;
            pairs += here;
            sweeps = sweeps.max(one.sweeps);
            landmarks.extend(one.landmarks.iter().map(|&v| part.vertices[v as usize]));
            embedded.push(one.points);
        }
        Ok(Self {
            dimension: options.dimension,
            points: assemble(mesh.vertex_count(), &parts, &embedded, options.dimension, unit),
            landmarks,
            stress: stress / pairs.max(1) as f64,
            sweeps,
            seconds,
            warnings: warnings(mesh, topology, &parts),
        })
    }

    /// The point of vertex `v`.
    ///
    /// # Panics
    /// If there is no such vertex.
    pub fn point(&self, v: usize) -> &[f64] {
        &self.points[v * self.dimension..(v + 1) * self.dimension]
    }

    /// Root of the mean squared relative error of distances between landmarks: the square root of
    /// [`Embedding::stress`].
    pub fn relative_error(&self) -> f64 {
        self.stress.sqrt()
    }
}

/// Bytes that an embedding takes while it is made: those of the factor of the least-squares mesh,
/// or of the matrices of distances between landmarks, which come one after the other. Measured on
/// meshes of 8,000 to 300,000 vertices: 3,900 to 4,500 bytes a vertex, 45 to 54 a pair of
/// landmarks.
fn bytes(vertices: usize, landmarks: usize) -> u64 {
    const VERTEX: u64 = 4200;
    const PAIR: u64 = 48;
    (VERTEX * vertices as u64).max(PAIR * (landmarks as u64).pow(2))
}

/// One embedded component, in its own numbering and unit.
struct PartEmbedding {
    points: Vec<f64>,
    landmarks: Vec<u32>,
    stress: f64,
    sweeps: u64,
}

fn embed_part(
    part: &parts::Part,
    count: usize,
    options: &EmbeddingOptions,
    seconds: &mut Seconds,
    progress: &dyn Progress,
) -> Result<PartEmbedding> {
    let dimension = options.dimension;
    let marks = landmarks::choose(part, count, options, seconds, progress)?;
    let m = marks.vertices.len();
    let clock = Instant::now();
    progress.stage("multidimensional scaling", options.sweeps as u64);
    let start = scaling::classical(&marks.distances, m, dimension)?;
    let stop = scaling::Stop { sweeps: options.sweeps, tolerance: options.tolerance, enough: scaling::ENOUGH };
    control::check()?;
    let scaled = scaling::smacof(&marks.distances, start, stop, || progress.advance(1))?;
    seconds.scaling += clock.elapsed().as_secs_f64();
    let clock = Instant::now();
    progress.stage("least-squares mesh", 1);
    let targets: Vec<f64> = (0..m * dimension).map(|k| scaled.points[(k / dimension, k % dimension)]).collect();
    let points =
        least_squares::least_squares_mesh(&part.positions, &part.triangles, &marks.vertices, &targets, dimension)?;
    progress.advance(1);
    seconds.upsampling += clock.elapsed().as_secs_f64();
    Ok(PartEmbedding {
        points,
        landmarks: marks.vertices,
        stress: scaled.stress.last().copied().unwrap_or(0.0),
        sweeps: scaled.stress.len() as u64 - 1,
    })
}

/// Centres each part, puts the parts apart and goes back to the mesh's units. Two points of
/// different parts are farther from each other than any two of the same part.
fn assemble(
    vertex_count: usize,
    parts: &[parts::Part],
    embedded: &[Vec<f64>],
    dimension: usize,
    unit: f64,
) -> Vec<f64> {
    let middles: Vec<Vec<f64>> = embedded
        .iter()
        .map(|x| {
            let (mut low, mut high) = (vec![f64::INFINITY; dimension], vec![f64::NEG_INFINITY; dimension]);
            for row in x.chunks_exact(dimension) {
                for k in 0..dimension {
                    low[k] = low[k].min(row[k]);
                    high[k] = high[k].max(row[k]);
                }
            }
            low.iter().zip(&high).map(|(l, h)| 0.5 * (l + h)).collect()
        })
        .collect();
    let radius = embedded.iter().zip(&middles).fold(0.0f64, |r, (x, middle)| {
        x.chunks_exact(dimension)
            .map(|row| row.iter().zip(middle).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt())
            .fold(r, f64::max)
    });
    // The largest part at the origin.
    let mut order: Vec<usize> = (0..parts.len()).collect();
    order.sort_by(|&a, &b| parts[b].area.total_cmp(&parts[a].area).then(a.cmp(&b)));
    let centers = parts::centers(parts.len(), dimension, 5.0 * radius);
    let mut points = vec![f64::NAN; vertex_count * dimension];
    for (place, &c) in order.iter().enumerate() {
        for (&v, row) in parts[c].vertices.iter().zip(embedded[c].chunks_exact(dimension)) {
            for k in 0..dimension {
                points[v as usize * dimension + k] = (row[k] - middles[c][k] + centers[place][k]) * unit;
            }
        }
    }
    points
}

/// What should be said about the mesh.
fn warnings(mesh: &Mesh, topology: &Topology, parts: &[parts::Part]) -> Vec<String> {
    let mut out = Vec::new();
    if parts.len() > 1 {
        let mut text = format!(
            "mesh {} has {} components, which are embedded apart: a point only follows anchors on its own component. They are",
            mesh.name,
            parts.len()
        );
        for (c, part) in parts.iter().enumerate().take(NAMED) {
            let share = 100.0 * part.area;
            text += &format!(
                "{} component {c} (vertex {} and {} others, {share:.1} % of the area)",
                if c > 0 { "," } else { "" },
                part.vertices[0],
                part.vertices.len() - 1
            );
        }
        if parts.len() > NAMED {
            text += &format!(" and {} more", parts.len() - NAMED);
        }
        out.push(text + ".");
    }
    // A vertex that the file repeats is embedded where the one is that stands for it.
    let is_unused = |v: &u32| topology.vertex_component[mesh.representative(*v) as usize] == crate::geometry::NONE;
    let unused = (0..mesh.vertex_count() as u32).filter(is_unused).count();
    if unused > 0 {
        out.push(format!("mesh {}: {unused} vertices are in no usable triangle and have no embedding.", mesh.name));
    }
    out
}
