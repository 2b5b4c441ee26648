//! The smallest Jacobian of a step, over samples of the inside and of the model.
//!
//! Three sets are looked at: the centres of the cells of a grid over the polyhedron, four points
//! next to every face, and the vertices of the model. Nothing is claimed of what lies between.
//! Samples are swept in single precision, on the device where there is one; the smallest are judged
//! again in double precision, so that what is reported is the Jacobian there.

use glam::DVec3;

use super::{Evaluation, Frame, Step, gpu};
use crate::engine::{Backend, Engine, Lanes, Real};
use crate::error::{Error, Result};

/// Most cells along the longest side.
pub const MOST_RESOLUTION: u32 = 256;

/// Samples judged at once in double precision, and how far single precision may be off.
const JUDGED: usize = 64;
const DOUBT: f64 = 1e-3;

/// Rounds of them.
const ROUNDS: usize = 64;

/// Samples of which only the smallest Jacobian is kept.
pub const PIECE: usize = 16;

/// Cells along the longest side where nothing is said.
pub const RESOLUTION: u32 = 24;

/// How far inside samples of faces lie, in local units: about that part of the polyhedron's
/// diameter.
const OFF_FACE: f64 = 1e-4;

/// Barycentric coordinates, of the samples of a face: the middles of the four triangles its edges'
/// middles cut it into.
const ON_FACE: [[f64; 3]; 4] = [
    [1.0 / 3.0; 3],
    [2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0],
    [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0],
    [1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0],
];

/// Which sample a minimum was found at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MinimumKind {
    /// A cell of the grid inside.
    Interior,
    /// A point of a face.
    Face,
    /// A vertex of the model, inside the polyhedron.
    Model,
}

impl MinimumKind {
    /// The word of the reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Interior => "interior",
            Self::Face => "face",
            Self::Model => "model",
        }
    }
}

/// The smallest Jacobian of a step that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Minimum {
    /// Its value; `-inf` where the map is not finite, which is a fold.
    pub value: f64,
    /// Where it is: in the polyhedron the step starts from, in the units of the file.
    pub at: DVec3,
    /// What was sampled there.
    pub kind: MinimumKind,
}

impl Minimum {
    /// Whether the step does not fold as far as was sampled. Zero and NaN are folds.
    pub fn positive(&self) -> bool {
        self.value > 0.0
    }
}

/// The smallest Jacobian of the samples of a piece that lie inside, and which of them it is; twin
/// of the struct in `shaders/jacobian_min_3d.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct PieceMinimum3d {
    /// [`Real::HUGE`] where none lies inside.
    pub value: f32,
    /// Counted from the first sample of the piece.
    pub index: u32,
}

/// The samples of the inside of a step's polyhedron.
#[derive(Clone, Debug)]
pub struct Samples {
    points: Vec<[f32; 3]>,
    cells: usize,
}

impl Samples {
    /// `resolution` cells along the longest side of the bounding box, and four points of every
    /// face, moved 1e-4 of the polyhedron's diameter to the inside.
    ///
    /// # Errors
    /// [`Error::Option`] if the resolution is 0 or over [`MOST_RESOLUTION`].
    pub fn new(step: &Step<f64>, resolution: u32) -> Result<Self> {
        if !(1..=MOST_RESOLUTION).contains(&resolution) {
            let what = format!("{resolution} cells along the longest side");
            let remedy = format!("Give 1 to {MOST_RESOLUTION}; the default is {RESOLUTION}");
            return Err(Error::option("resolution", what, remedy));
        }
        let mut points = grid(step, resolution);
        let cells = points.len();
        for face in &step.faces {
            let [a, b, c] = face.corners.map(DVec3::from);
            let off = DVec3::from(face.normal) * OFF_FACE;
            points.extend(ON_FACE.map(|w| (a * w[0] + b * w[1] + c * w[2] - off).to_array().map(|x| x as f32)));
        }
        Ok(Self { points, cells })
    }

    /// No samples.
    pub fn none() -> Self {
        Self { points: Vec::new(), cells: 0 }
    }

    /// How many there are, those outside included.
    pub fn count(&self) -> usize {
        self.points.len()
    }

    /// Their local coordinates.
    pub fn points(&self) -> &[[f32; 3]] {
        &self.points
    }
}

/// The centres of the cells over the whole bounding box, in local coordinates; whether they lie
/// inside the evaluation tells.
fn grid(step: &Step<f64>, resolution: u32) -> Vec<[f32; 3]> {
    let vertices: Vec<DVec3> = step.vertices.iter().map(|&v| DVec3::from(v)).collect();
    let (low, high) = super::frame::bounds(&vertices);
    let cell = (high - low).max_element() / f64::from(resolution);
    if !(cell > 0.0) {
        return Vec::new();
    }
    let counts = ((high - low) / cell).ceil().max(DVec3::ONE);
    let [nx, ny, nz] = counts.to_array().map(|n| (n as u32).min(resolution));
    // Centred in the box.
    let start = (low + high - counts * cell) * 0.5;
    let mut all = Vec::with_capacity((nx * ny * nz) as usize);
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                let p = start + (DVec3::new(f64::from(x), f64::from(y), f64::from(z)) + 0.5) * cell;
                all.push(p.to_array().map(|x| x as f32));
            }
        }
    }
    all
}

/// The smallest Jacobian of `step` at those of the `samples` and of the vertices of the `model`,
/// all in local coordinates, that lie in its polyhedron; `frame` is its frame. O(faces) per sample.
///
/// The same input gives the same result for any number of threads; ties go to the lowest index,
/// samples before the model. A value that is not finite counts as a fold and is given as negative
/// infinity. Infinity where no sample lies inside.
///
/// # Errors
/// [`Error::Device`] and [`Error::Memory`] of the device.
pub fn jacobian_min_3d(
    engine: &Engine,
    step: &Step<f64>,
    frame: &Frame,
    samples: &Samples,
    model: &[[f32; 3]],
) -> Result<Minimum> {
    let mut best = Minimum { value: f64::INFINITY, at: frame.origin(), kind: MinimumKind::Interior };
    for (points, model) in [(&samples.points[..], false), (model, true)] {
        let pieces = piece_minima(engine, step, points)?;
        let mut order: Vec<usize> = (0..pieces.len()).filter(|&k| pieces[k].value < f32::HUGE).collect();
        order.sort_by(|&a, &b| pieces[a].value.total_cmp(&pieces[b].value).then(a.cmp(&b)));
        for round in order.chunks(JUDGED).take(ROUNDS) {
            if f64::from(pieces[round[0]].value) > best.value + DOUBT {
                break;
            }
            let index = |&k: &usize| k * PIECE + (pieces[k].index as usize).min(PIECE - 1);
            let chosen: Vec<usize> = round.iter().map(index).filter(|&i| i < points.len()).collect();
            let exact: Vec<[f64; 3]> = chosen.iter().map(|&i| points[i].map(f64::from)).collect();
            let found = step.evaluate_all(Lanes::detect(), &exact);
            for ((e, p), &i) in found.iter().zip(&exact).zip(&chosen) {
                let value = if e.jacobian.is_finite() { e.jacobian } else { f64::NEG_INFINITY };
                if e.inside && value < best.value {
                    let kind = match (model, i < samples.cells) {
                        (true, _) => MinimumKind::Model,
                        (false, true) => MinimumKind::Interior,
                        (false, false) => MinimumKind::Face,
                    };
                    best = Minimum { value, at: frame.world(*p), kind };
                }
            }
        }
    }
    Ok(best)
}

/// The smallest Jacobian inside of every [`PIECE`] points, where `engine` works. What the kernel
/// cannot do the CPU does.
///
/// # Errors
/// [`Error::Device`] and [`Error::Memory`] of the device.
pub fn piece_minima(engine: &Engine, step: &Step<f64>, points: &[[f32; 3]]) -> Result<Vec<PieceMinimum3d>> {
    if engine.backend() == Backend::Reference {
        let wide: Vec<[f64; 3]> = points.iter().map(|p| p.map(f64::from)).collect();
        return Ok(pieces_of(&step.evaluate_all(Lanes::scalar(), &wide)));
    }
    if let Some(device) = engine.gpu_for("jacobian_min_3d").filter(|_| gpu::fits(step)) {
        return gpu::piece_minima_on_device(device, step, points);
    }
    Ok(piece_minima_on_cpu(Lanes::detect(), &step.cast(), points))
}

/// The smallest Jacobian inside of every [`PIECE`] points in single precision: the reference of the
/// kernel.
pub fn piece_minima_on_cpu(lanes: Lanes, step: &Step<f32>, points: &[[f32; 3]]) -> Vec<PieceMinimum3d> {
    pieces_of(&step.evaluate_all(lanes, points))
}

fn pieces_of<R: Real>(samples: &[Evaluation<R>]) -> Vec<PieceMinimum3d> {
    let least = |piece: &[Evaluation<R>]| {
        let mut found = PieceMinimum3d { value: f32::HUGE, index: 0 };
        for (index, e) in piece.iter().enumerate().filter(|(_, e)| e.inside) {
            let j = e.jacobian.to_f64() as f32;
            // What is not finite, or beyond all measure, is a fold.
            let value = if j.abs() < f32::HUGE { j } else { -f32::HUGE };
            if value < found.value {
                found = PieceMinimum3d { value, index: index as u32 };
            }
        }
        found
    };
    samples.chunks(PIECE).map(least).collect()
}
