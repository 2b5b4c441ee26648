//! Maps from points of a target to points of a source.

use std::sync::{Arc, Mutex, PoisonError};

use barymap::Result;
use barymap::desk::{Choice, Subject, correspond};
use barymap::engine::Engine;
use barymap::geometry::SurfacePoint;
use barymap::progress::Progress;
use barymap::surface::{AnchorPairs, IdentityMap, PackedImage, PackedPoint, PointMap as Map};
use barymap::tools::inverse_map::{PreImage, inverse_map};
use barymap::tools::vertex_map::{VertexMap, vertex_map};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use serde_json::{Value, json};

use crate::anchors::Given;
use crate::arrays::{Images, Places, of_images, of_places, places};
use crate::settings::{Common, Embedded, word};
use crate::shape::Shape;
use crate::work::run;

/// The choice of a method: a dictionary of the Python half.
#[derive(Clone, Debug, FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Chosen {
    method: String,
    relax: Option<bool>,
    align: bool,
    keep_all: bool,
    anchor_error: f64,
    mirror: bool,
}

impl Chosen {
    pub(crate) fn choice(&self) -> Result<Choice> {
        Ok(Choice {
            method: word("method", &self.method)?,
            relax: self.relax,
            align: self.align,
            keep_all: self.keep_all,
            anchor_error: self.anchor_error,
            mirror: self.mirror,
        })
    }
}

/// A map, and the meshes it is between.
#[pyclass(frozen, module = "barymap._barymap")]
pub(crate) struct PointMap {
    pub(crate) source: Arc<Subject>,
    pub(crate) target: Arc<Subject>,
    pub(crate) map: Box<dyn Map + Send>,
    pub(crate) engine: Engine,
    pub(crate) common: Common,
    pub(crate) pairs: AnchorPairs,
    report: Value,
    vertices: Mutex<Option<Arc<VertexMap>>>,
}

/// A map between two shapes by pairs, with what there is to say of it.
pub(crate) struct Prepared {
    pub(crate) map: Box<dyn Map + Send>,
    pub(crate) report: Value,
}

/// Embeds both where the method needs it, and makes the map, as the command line does.
#[expect(clippy::too_many_arguments, reason = "two shapes, pairs, and the options of the method")]
pub(crate) fn prepare(
    engine: &Engine,
    source: &Shape,
    target: &Shape,
    pairs: &AnchorPairs,
    mut notes: Vec<String>,
    choice: &Choice,
    embedded: &Embedded,
    common: &Common,
    progress: &dyn Progress,
) -> Result<Prepared> {
    let options = embedded.options()?;
    let (from, to) = (&source.subject, &target.subject);
    notes.extend(engine.note().map(str::to_owned));
    notes.splice(0..0, from.notes.iter().chain(&to.notes).cloned());
    let d = engine.description();
    let mut report = json!({
        "method": choice.name(),
        "anchors": pairs.len(),
        "backend": {"kind": d.backend, "name": d.name, "driver": d.driver},
    });
    if IdentityMap::fits(&from.mesh, &to.mesh, pairs) {
        let same = "source and target are the same surface with the same anchors: every point stays where it is";
        notes.push(same.to_owned());
        report["notes"] = json!(notes);
        return Ok(Prepared { map: Box::new(IdentityMap), report });
    }
    let (mut a, mut b) = ((**from).clone(), (**to).clone());
    if choice.options()?.method.needs_embedding() {
        let (made, told) = source.embedded(&options, common, progress)?;
        (a, notes) = (made, notes.into_iter().chain(told).collect());
        let (made, told) = target.embedded(&options, common, progress)?;
        (b, notes) = (made, notes.into_iter().chain(told).collect());
    }
    let made = correspond(engine, &a, &b, pairs, choice, &options, progress)?;
    notes.extend(made.notes);
    report["stress"] = json!({
        "source": a.embedding.as_ref().map(|e| e.stress),
        "target": b.embedding.as_ref().map(|e| e.stress),
    });
    report["mirrored"] = json!(made.mirrored);
    if let Some(alignment) = &made.alignment {
        report["alignment"] = json!(alignment);
    }
    if let Some(field) = made.map.field() {
        report["field"] = json!(field);
    }
    report["notes"] = json!(notes);
    Ok(Prepared { map: made.map, report })
}

impl PointMap {
    /// The map of the target's vertices, made once.
    pub(crate) fn of_vertices(&self) -> Result<Arc<VertexMap>> {
        if let Some(known) = &*self.vertices.lock().unwrap_or_else(PoisonError::into_inner) {
            return Ok(Arc::clone(known));
        }
        let (s, t) = (&self.source, &self.target);
        let made = Arc::new(vertex_map((&s.mesh, &s.topology), (&t.mesh, &t.topology), self.map.as_ref())?);
        *self.vertices.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::clone(&made));
        Ok(made)
    }
}

#[pymethods]
impl PointMap {
    #[new]
    #[expect(clippy::too_many_arguments, reason = "as `prepare`")]
    fn new(
        py: Python<'_>,
        source: &Shape,
        target: &Shape,
        anchors: Given,
        chosen: Chosen,
        embedded: Embedded,
        common: Common,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let work = |progress: &dyn Progress| {
            let choice = chosen.choice()?;
            let (pairs, notes) = anchors.find(&source.subject, &target.subject)?;
            let engine = common.engine()?;
            let made = prepare(&engine, source, target, &pairs, notes, &choice, &embedded, &common, progress)?;
            Ok(Self {
                source: Arc::clone(&source.subject),
                target: Arc::clone(&target.subject),
                map: made.map,
                engine,
                common: common.clone(),
                pairs,
                report: made.report,
                vertices: Mutex::default(),
            })
        };
        run(py, progress.as_ref(), common.memory, work)
    }

    /// Images of points of the target.
    fn apply<'py>(
        &self,
        py: Python<'py>,
        faces: PyReadonlyArray1<'py, u32>,
        barycentric: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Images<'py>> {
        let faces: Vec<u32> = faces.as_array().to_vec();
        let points = places("faces", &faces, &barycentric, &self.target.mesh);
        let points = points.map_err(|e| crate::failure::exception(py, &e))?;
        let work = |_: &dyn Progress| {
            let packed: Vec<PackedPoint> = points.iter().map(|&p| p.into()).collect();
            let mut images = Vec::new();
            self.map.map(&packed, &mut images)?;
            Ok(images)
        };
        let images = run(py, None, self.common.memory, work)?;
        Ok(of_images(py, &images, |p| self.source.mesh.point_in_file(p)))
    }

    /// Images of the target's vertices.
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Images<'py>> {
        let made = run(py, None, self.common.memory, |_| self.of_vertices())?;
        Ok(of_images(py, &made.images, |p| self.source.mesh.point_in_file(p)))
    }

    /// For every vertex of the source the point of the target that goes there, and its residual.
    fn inverse<'py>(&self, py: Python<'py>) -> PyResult<(Images<'py>, Bound<'py, PyArray1<f64>>)> {
        let work = |_: &dyn Progress| {
            let (source, target) = (&self.source, &self.target);
            let points: Vec<Option<SurfacePoint>> = (0..source.mesh.vertex_count() as u32)
                .map(|v| source.topology.vertex_point(source.mesh.representative(v)))
                .collect();
            let used: Vec<SurfacePoint> = points.iter().flatten().copied().collect();
            let vertices = self.of_vertices()?;
            let found = inverse_map(&source.mesh, &target.mesh, self.map.as_ref(), &vertices, &used)?;
            let mut found = found.into_iter();
            Ok(points.iter().map(|p| p.and_then(|_| found.next())).collect::<Vec<Option<PreImage>>>())
        };
        let found = run(py, None, self.common.memory, work)?;
        let images: Vec<PackedImage> = found.iter().map(|f| f.map_or(PackedImage::NOWHERE, |f| f.point)).collect();
        let residuals: Vec<f64> = found.iter().map(|f| f.map_or(f64::NAN, |f| f.residual)).collect();
        Ok((of_images(py, &images, |p| self.target.mesh.point_in_file(p)), residuals.into_pyarray(py)))
    }

    /// The anchors as they were found: on the source, on the target.
    fn anchors<'py>(&self, py: Python<'py>) -> (Places<'py>, Places<'py>) {
        (of_places(py, &self.pairs.source, &self.source.mesh), of_places(py, &self.pairs.target, &self.target.mesh))
    }

    /// What there is to say, as JSON.
    fn report(&self, py: Python<'_>) -> PyResult<String> {
        let vertices = run(py, None, self.common.memory, |_| self.of_vertices())?;
        let (d, mut report) = (vertices.distortion, self.report.clone());
        report["valid_fraction"] = json!(vertices.valid_fraction);
        report["flipped_area"] = json!(d.flipped_area);
        report["flipped_faces"] = json!(d.flipped_faces);
        report["stretch_all"] = json!(d.stretch_all);
        report["stretch_best95"] = json!(d.stretch_best95);
        report["handed_back"] = json!(self.map.handed_back());
        Ok(report.to_string())
    }
}
