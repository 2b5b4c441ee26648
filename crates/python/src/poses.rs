//! Mean-value encodings: poses, sequences, blends.

use std::sync::{Arc, Mutex, PoisonError};

use barymap::desk::Subject;
use barymap::encoding::{HierarchyOptions, MarchQuality, Quality, SequenceQuality};
use barymap::geometry::Mesh;
use barymap::glam::DVec3;
use barymap::progress::Progress;
use barymap::tools::deform::{Deformer, Handles};
use barymap::tools::morph::Morpher;
use barymap::{Error, Result};
use numpy::ndarray::Array3;
use numpy::{IntoPyArray, PyArray2, PyArray3, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use serde_json::json;

use crate::arrays::{of_points3, points3};
use crate::settings::Common;
use crate::shape::Shape;
use crate::work::run;

/// A mesh with handles, prepared for poses.
#[pyclass(frozen, module = "barymap._barymap")]
pub(crate) struct Poser {
    subject: Arc<Subject>,
    deformer: Mutex<Deformer>,
    handles: usize,
    common: Common,
    warnings: Vec<String>,
}

/// The quality of a single pose.
fn quality(name: &str, stiffness: f64, sweeps: usize) -> Result<Quality> {
    if !(0.0..=1e6).contains(&stiffness) {
        return Err(Error::option("stiffness", format!("{stiffness} is out of range"), "Give a number from 0 to 1e6"));
    }
    if sweeps > 1000 {
        return Err(Error::option(
            "sweeps",
            format!("{sweeps} is more than 1000"),
            "Use quality=\"converged\" instead",
        ));
    }
    let quality = match name {
        "splits" => Quality::SPLITS,
        "preview" => Quality::PREVIEW,
        "default" => Quality::DEFAULT,
        "converged" => Quality::CONVERGED,
        other => return Err(no_quality(other, "splits, preview, default or converged")),
    };
    Ok(Quality { sweeps, stiffness, ..quality })
}

fn no_quality(name: &str, known: &str) -> Error {
    Error::option("quality", format!("{name:?} is no quality"), format!("Give {known}"))
}

#[pymethods]
impl Poser {
    #[new]
    fn new(
        py: Python<'_>,
        mesh: &Shape,
        vertices: Vec<u32>,
        region: Option<Vec<u32>>,
        common: Common,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let (subject, handles) = (Arc::clone(&mesh.subject), vertices.len());
        let work = |_: &dyn Progress| {
            let wanted = Handles { vertices, region };
            let engine = common.engine()?;
            let cache = common.cache();
            let mut deformer = Deformer::new(&subject.mesh, wanted, &HierarchyOptions::default(), &cache)?;
            deformer.decode_on(&engine);
            let warnings = deformer.warnings.clone();
            let deformer = Mutex::new(deformer);
            Ok(Self { subject: Arc::clone(&subject), deformer, handles, common: common.clone(), warnings })
        };
        run(py, progress.as_ref(), common.memory, work)
    }

    #[getter]
    fn notes(&self) -> Vec<String> {
        self.warnings.clone()
    }

    /// Positions (n, 3) of all vertices for those (k, 3) of the handles, and measures.
    #[expect(clippy::too_many_arguments, reason = "handles, and the options of a pose")]
    fn deform<'py>(
        &self,
        py: Python<'py>,
        positions: PyReadonlyArray2<'py, f64>,
        name: &str,
        stiffness: f64,
        sweeps: usize,
        warm: bool,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, String)> {
        let positions = points3(&positions);
        let work = |_: &dyn Progress| {
            let quality = quality(name, stiffness, sweeps)?;
            self.expect(positions.len())?;
            let mut deformer = self.deformer.lock().unwrap_or_else(PoisonError::into_inner);
            let made = deformer.deform(&positions, &quality, warm)?;
            let m = deformer.measures(&made.positions);
            let report = json!({
                "g": m.g, "g_normalised": m.g_normalised, "edge_rms": m.edge_rms, "edge_max": m.edge_max,
                "volume_ratio": m.volume_ratio, "dihedral_rms_degrees": m.dihedral_rms, "flipped": m.flipped,
                "iterations": made.report.iterations(),
            });
            Ok((made.positions, report.to_string()))
        };
        let (positions, report) = run(py, progress.as_ref(), self.common.memory, work)?;
        Ok((of_points3(py, &positions), report))
    }

    /// Positions (t, n, 3) for a sequence (t, k, 3) of the handles', and frames found anew.
    fn animate<'py>(
        &self,
        py: Python<'py>,
        frames: PyReadonlyArray3<'py, f64>,
        name: &str,
        stiffness: f64,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(Bound<'py, PyArray3<f64>>, Vec<usize>)> {
        let frames: Vec<Vec<DVec3>> = frames
            .as_array()
            .outer_iter()
            .map(|f| f.rows().into_iter().map(|r| DVec3::new(r[0], r[1], r[2])).collect())
            .collect();
        let work = |progress: &dyn Progress| {
            let quality = match name {
                "preview" => SequenceQuality::PREVIEW,
                "default" => SequenceQuality::DEFAULT,
                other => return Err(no_quality(other, "preview or default")),
            };
            frames.first().map_or(Ok(()), |f| self.expect(f.len()))?;
            let quality = SequenceQuality { stiffness, ..quality };
            let deformer = self.deformer.lock().unwrap_or_else(PoisonError::into_inner);
            progress.stage("frames", frames.len() as u64);
            let (mut all, mut anew) = (Vec::with_capacity(frames.len()), Vec::new());
            deformer.play(&frames, 0..frames.len(), &quality, |f, played| {
                if played.anew {
                    anew.push(f);
                }
                all.push(played.positions);
                progress.advance(1);
                Ok(())
            })?;
            Ok((all, anew))
        };
        let (all, anew) = run(py, progress.as_ref(), self.common.memory, work)?;
        Ok((frames_of(py, &all, self.subject.mesh.vertex_count()), anew))
    }
}

impl Poser {
    fn expect(&self, count: usize) -> Result<()> {
        if count == self.handles {
            return Ok(());
        }
        let what = format!("positions: {count} for {} handles", self.handles);
        Err(Error::input(what, "Give one for each handle, in their order"))
    }
}

fn frames_of<'py>(py: Python<'py>, frames: &[Vec<DVec3>], vertices: usize) -> Bound<'py, PyArray3<f64>> {
    Array3::from_shape_fn((frames.len(), vertices, 3), |(t, v, k)| frames[t][v][k]).into_pyarray(py)
}

/// Blends (t, n, 3) of shapes of one connectivity; `weights` (t, shapes).
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "shapes, and the options of a blend")]
pub(crate) fn morph<'py>(
    py: Python<'py>,
    mesh: &Shape,
    others: Vec<PyReadonlyArray2<'py, f64>>,
    weights: Vec<Vec<f64>>,
    anchors: Option<Vec<u32>>,
    name: &str,
    common: Common,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let first = &mesh.subject.mesh;
    let others: Vec<Vec<DVec3>> = others.iter().map(points3).collect();
    let work = |progress: &dyn Progress| {
        let quality = match name {
            "preview" => MarchQuality::PREVIEW,
            "default" if weights.len() > 1 => MarchQuality::FRAMES,
            "default" => MarchQuality::DEFAULT,
            "converged" => MarchQuality::CONVERGED,
            other => return Err(no_quality(other, "preview, default or converged")),
        };
        let mut meshes: Vec<Mesh> = vec![first.clone()];
        for (k, positions) in others.into_iter().enumerate() {
            if positions.len() != first.vertex_count() {
                let what = format!("shapes: shape {k} has {} vertices, not {}", positions.len(), first.vertex_count());
                return Err(Error::input(what, "Give one position for each vertex of the mesh"));
            }
            let mut other = first.clone();
            other.positions = positions;
            meshes.push(other);
        }
        let borrowed: Vec<&Mesh> = meshes.iter().collect();
        let mut morpher = Morpher::new(&borrowed, anchors.as_deref(), &HierarchyOptions::default())?;
        progress.stage("morphing", weights.len() as u64);
        let mut all = Vec::with_capacity(weights.len());
        morpher.frames(&weights, &quality, |_, shape, _| {
            all.push(shape);
            progress.advance(1);
            Ok(())
        })?;
        Ok(all)
    };
    let all = run(py, progress.as_ref(), common.memory, work)?;
    Ok(frames_of(py, &all, first.vertex_count()))
}
