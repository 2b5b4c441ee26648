//! Meshes with what is known of them.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use barymap::desk::Subject;
use barymap::geometry::weld::{Weld, weld};
use barymap::geometry::{Mesh, NONE, Texcoords};
use barymap::io::{ReadOptions, read_mesh_with, write_glb, write_obj, write_ply};
use barymap::progress::Progress;
use barymap::surface::{Embedding, EmbeddingOptions};
use barymap::tools::cage::pose;
use barymap::{Error, Result};
use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray, PyArray2, PyArray3, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;

use crate::arrays::{of_points3, points2, points3, triples};
use crate::settings::Common;
use crate::work::run;

/// A mesh, its adjacency, and the embeddings that were made of it.
#[pyclass(frozen, module = "barymap._barymap")]
pub(crate) struct Shape {
    pub(crate) subject: Arc<Subject>,
    embeddings: Mutex<Vec<(EmbeddingOptions, Arc<Embedding>)>>,
}

/// Repeated vertices: a negative distance joins none.
fn rule(tolerance: f64) -> Weld {
    match tolerance {
        t if t < 0.0 => Weld::No,
        0.0 => Weld::Exact,
        t => Weld::Within(t),
    }
}

impl Shape {
    pub(crate) fn of(subject: Subject) -> Self {
        Self { subject: Arc::new(subject), embeddings: Mutex::default() }
    }

    /// The shape with its embedding, which is made once for the same options.
    pub(crate) fn embedded(
        &self,
        options: &EmbeddingOptions,
        common: &Common,
        progress: &dyn Progress,
    ) -> Result<(Subject, Vec<String>)> {
        let mut subject = (*self.subject).clone();
        let kept = || self.embeddings.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, known)) = kept().iter().find(|(o, _)| o == options) {
            subject.embedding = Some((**known).clone());
            return Ok((subject, Vec::new()));
        }
        let notes = subject.embed(options, &common.cache(), progress)?;
        if let Some(made) = &subject.embedding {
            let mut kept = kept();
            // Options are few; the last ones are those that are used again.
            kept.truncate(3);
            kept.insert(0, (*options, Arc::new(made.clone())));
        }
        Ok((subject, notes))
    }
}

#[pymethods]
impl Shape {
    /// From arrays: positions (n, 3), triangles (m, 3), and texture coordinates a vertex (n, 2), a
    /// corner (m, 3, 2), or a list (k, 2) with the indices of the corners (m, 3).
    #[staticmethod]
    #[pyo3(signature = (name, vertices, faces, uv, corners, uv_faces, tolerance))]
    #[expect(clippy::too_many_arguments, reason = "the three forms of texture coordinates")]
    fn from_arrays(
        py: Python<'_>,
        name: String,
        vertices: PyReadonlyArray2<'_, f64>,
        faces: PyReadonlyArray2<'_, u32>,
        uv: Option<PyReadonlyArray2<'_, f64>>,
        corners: Option<PyReadonlyArray3<'_, f64>>,
        uv_faces: Option<PyReadonlyArray2<'_, u32>>,
        tolerance: f64,
    ) -> PyResult<Self> {
        let (positions, triangles) = (points3(&vertices), triples(&faces));
        let uv = uv.as_ref().map(points2);
        let indices = uv_faces.as_ref().map(triples);
        let corners = corners.map(|c| {
            let c = c.as_array();
            let at = |i: usize, k: usize, j: usize| c.get([i, k, j]).copied().unwrap_or(f64::NAN);
            let corner = |i: usize| [0, 1, 2].map(|k| barymap::glam::DVec2::new(at(i, k, 0), at(i, k, 1)));
            (0..c.shape()[0]).map(corner).collect::<Vec<_>>()
        });
        let work = move |_: &dyn Progress| {
            let texcoords = match (&corners, &uv, &indices) {
                (Some(corners), _, _) => Texcoords::Corners(corners),
                (None, Some(uv), Some(indices)) => Texcoords::Indexed(uv, indices),
                (None, Some(uv), None) => Texcoords::Vertices(uv),
                (None, None, _) => Texcoords::None,
            };
            let mut mesh = Mesh::from_arrays(name, positions, &triangles, texcoords)?;
            weld(&mut mesh, rule(tolerance), &[])?;
            Ok(Self::of(Subject::new(mesh)?))
        };
        run(py, None, u64::MAX, work)
    }

    /// From a file.
    #[staticmethod]
    fn open(py: Python<'_>, path: PathBuf, tolerance: f64, uv_set: Option<usize>) -> PyResult<Self> {
        let work = move |_: &dyn Progress| {
            let loaded = read_mesh_with(&path, &ReadOptions { weld: rule(tolerance), uv_set })?;
            Ok(Self::of(Subject::loaded(&path, loaded)?))
        };
        run(py, None, u64::MAX, work)
    }

    /// The same with vertices elsewhere.
    fn moved(&self, py: Python<'_>, vertices: PyReadonlyArray2<'_, f64>) -> PyResult<Self> {
        let positions = points3(&vertices);
        let mut mesh = self.subject.mesh.clone();
        let work = move |_: &dyn Progress| {
            pose(&mut mesh, positions)?;
            Ok(Self::of(Subject::new(mesh)?))
        };
        run(py, None, u64::MAX, work)
    }

    /// Writes OBJ, PLY or GLB, by the extension.
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let mesh = &self.subject.mesh;
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        let work = move |_: &dyn Progress| match extension.as_str() {
            "obj" => write_obj(mesh, &path),
            "ply" => write_ply(mesh, None, &path),
            "glb" => write_glb(&path, mesh, &[]),
            _ => Err(Error::option(
                "path",
                format!("{} is neither OBJ, PLY nor GLB", path.display()),
                "Name one that is",
            )),
        };
        run(py, None, u64::MAX, work)
    }

    #[getter]
    fn name(&self) -> &str {
        &self.subject.mesh.name
    }

    #[getter]
    fn notes(&self) -> Vec<String> {
        self.subject.notes.clone()
    }

    #[getter]
    fn area(&self) -> f64 {
        self.subject.mesh.area()
    }

    #[getter]
    fn materials(&self) -> Vec<String> {
        self.subject.mesh.materials.iter().map(|m| m.name.clone()).collect()
    }

    #[getter]
    fn counts(&self) -> (usize, usize) {
        (self.subject.mesh.vertex_count(), self.subject.mesh.file_triangle_count())
    }

    #[getter]
    fn has_uv(&self) -> bool {
        self.subject.mesh.has_texcoords()
    }

    /// Positions (n, 3).
    fn vertices<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        of_points3(py, &self.subject.mesh.positions)
    }

    /// Vertices of triangles (m, 3).
    fn faces<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<i32>> {
        let mesh = &self.subject.mesh;
        let faces: Vec<[u32; 3]> =
            (0..mesh.file_triangle_count()).map(|t| mesh.file_triangle(t).map(|c| c.vertex)).collect();
        Array2::from_shape_fn((faces.len(), 3), |(t, k)| faces[t][k] as i32).into_pyarray(py)
    }

    /// Texture coordinates of corners (m, 3, 2), NaN where there are none.
    fn uv<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray3<f64>>> {
        let mesh = &self.subject.mesh;
        if !mesh.has_texcoords() {
            return None;
        }
        let of = |t: usize| {
            mesh.file_triangle(t).map(|c| match c.texcoord {
                NONE => [f64::NAN; 2],
                i => mesh.texcoords[i as usize].to_array(),
            })
        };
        let all: Vec<[[f64; 2]; 3]> = (0..mesh.file_triangle_count()).map(of).collect();
        Some(Array3::from_shape_fn((all.len(), 3, 2), |(t, k, j)| all[t][k][j]).into_pyarray(py))
    }

    /// Colours of vertices (n, 4), 0 to 1.
    fn colors<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f32>>> {
        let colors = &self.subject.mesh.colors;
        (!colors.is_empty()).then(|| Array2::from_shape_fn((colors.len(), 4), |(i, k)| colors[i][k]).into_pyarray(py))
    }
}
