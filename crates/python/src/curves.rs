//! Splines, decals and charts.

use std::sync::Arc;

use barymap::desk::Subject;
use barymap::geometry::{ClosestPoints, Placement, SurfacePoint};
use barymap::io::anchors::AnchorSpec;
use barymap::picture::Image;
use barymap::progress::Progress;
use barymap::tools::decal::{DecalAnchors, PaintOptions, composite, decal as lay, paint_placed};
use barymap::tools::spline::{CurvePoint, SplineOptions, SplineSurface};
use barymap::tools::unwrap::{UnwrapOptions, unwrap as cut};
use barymap::{Error, Result};
use numpy::ndarray::Array1;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use serde_json::json;

use crate::anchors::Side;
use crate::arrays::{Places, image, of_image, of_places, of_points3, points2};
use crate::settings::{Common, Embedded, word};
use crate::shape::Shape;
use crate::work::{run, run_apart};

/// What a spline is like: a dictionary of the Python half.
#[derive(Clone, Debug, FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Curve {
    kind: String,
    degree: usize,
    closed: bool,
    mode: String,
    tolerance: f64,
    samples: usize,
}

/// Positions, faces and coordinates, parameters, first points of runs, report.
type Traced<'py> =
    (Bound<'py, PyArray2<f64>>, Places<'py>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<i64>>, String);

/// A curve on a mesh.
#[pyfunction]
pub(crate) fn spline<'py>(
    py: Python<'py>,
    mesh: &Shape,
    points: Side,
    curve: Curve,
    embedded: Embedded,
    common: Common,
    progress: Option<Py<PyAny>>,
) -> PyResult<Traced<'py>> {
    let work = |progress: &dyn Progress| {
        let options = SplineOptions {
            kind: word("kind", &curve.kind)?,
            degree: curve.degree,
            closed: curve.closed,
            evaluation: word("mode", &curve.mode)?,
            tolerance: curve.tolerance,
            samples: curve.samples,
        };
        let (controls, off) = snapped(&mesh.subject, &points)?;
        let (subject, notes) = mesh.embedded(&embedded.options()?, &common, progress)?;
        let splines = SplineSurface::new(subject.shape())?;
        let made = splines.trace(&controls, &options)?;
        let jumps: Vec<_> = made
            .jumps
            .iter()
            .map(|j| json!({"parameter": j.parameter, "length": j.length, "bridged": j.bridged}))
            .collect();
        let report = json!({
            "points": made.points().count(), "length": made.length(), "closed": made.closed, "spans": made.spans,
            "levels": made.levels, "jumps": jumps, "without_projection": made.without_projection(),
            "control_points": controls.len(), "snap_distance": off, "notes": notes,
        });
        Ok((made, report.to_string()))
    };
    let (made, report) = run(py, progress.as_ref(), common.memory, work)?;
    let all: Vec<&CurvePoint> = made.points().collect();
    let at: Vec<_> = all.iter().map(|p| p.position).collect();
    let places: Vec<SurfacePoint> = all.iter().map(|p| p.point).collect();
    let parameters = Array1::from_iter(all.iter().map(|p| p.parameter)).into_pyarray(py);
    let mut first = 0;
    let starts: Vec<i64> = made
        .runs
        .iter()
        .map(|r| {
            let here = first;
            first += r.len() as i64;
            here
        })
        .collect();
    let places = of_places(py, &places, &mesh.subject.mesh);
    Ok((of_points3(py, &at), places, parameters, starts.into_pyarray(py), report))
}

/// Points on a mesh, and how far each was moved onto it.
fn snapped(subject: &Subject, points: &Side) -> Result<(Vec<SurfacePoint>, Vec<f64>)> {
    let closest = ClosestPoints::new(&subject.mesh, &subject.topology);
    let nearest = |p| closest.nearest(p).unwrap_or((SurfacePoint::new(0, [1.0, 0.0, 0.0]), f64::INFINITY));
    let found = points.list("points").resolve(&subject.mesh, &subject.topology, &nearest)?;
    Ok((found.iter().map(|r| r.point).collect(), found.iter().map(|r| r.snap_distance).collect()))
}

/// How a decal is drawn: a dictionary of the Python half.
#[derive(Clone, Debug, FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Paint {
    layout: String,
    width: u32,
    height: u32,
    opacity: f32,
    margin: u32,
    filter: String,
    supersample: u32,
    linear_light: bool,
    material: Option<String>,
}

/// Anchors farther off the mesh than this part of its diagonal are a mistake.
const OFF: f64 = 0.1;

/// A picture on a part of a surface; on `texture` where there is one.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "a mesh, two pictures, anchors, and how it is drawn")]
pub(crate) fn decal<'py>(
    py: Python<'py>,
    mesh: &Shape,
    picture: &Bound<'py, PyAny>,
    anchors: Side,
    uv: Option<PyReadonlyArray2<'py, f64>>,
    texture: Option<Bound<'py, PyAny>>,
    look: Paint,
    common: Common,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Bound<'py, PyAny>, String)> {
    let picture = image(picture)?;
    let texture = texture.as_ref().map(image).transpose()?;
    let uv = uv.as_ref().map(points2);
    let subject = &mesh.subject;
    let work = |progress: &dyn Progress| {
        if !(0.0..=1.0).contains(&look.opacity) {
            return Err(Error::option("opacity", format!("{}", look.opacity), "Give a number from 0 to 1"));
        }
        let (points, off) = snapped(subject, &anchors)?;
        let diagonal = subject.mesh.bounds().map_or(0.0, |(low, high)| low.distance(high));
        let list = anchors.list("anchors").anchors;
        let far = |(spec, off): (&AnchorSpec, &f64)| matches!(spec, AnchorSpec::Position(_)) && *off > OFF * diagonal;
        if let Some(k) = list.iter().zip(&off).position(far) {
            let what = format!("anchors: anchor {k} is {:.3e} off {}", off[k], subject.mesh.name);
            return Err(Error::input(what, "Check that the anchors belong to this mesh and are in its units"));
        }
        let placed = match uv {
            Some(uv) => DecalAnchors { points, uv },
            None => match <[SurfacePoint; 4]>::try_from(points) {
                Ok(corners) => DecalAnchors::corners(corners),
                Err(points) => {
                    let what = format!("anchors: {} without uv", points.len());
                    return Err(Error::input(what, "Give uv for each, or exactly four, the picture's corners"));
                }
            },
        };
        let aspect = f64::from(picture.width) / f64::from(picture.height);
        let layout = word("layout", &look.layout)?;
        let made = lay(&subject.mesh, &subject.topology, &placed, layout, aspect, progress)?;
        let options = options(&look, subject, &common)?;
        let placements: Vec<Placement> = subject.mesh.materials.iter().map(|m| m.base_color_placement).collect();
        let engine = common.engine()?;
        let drawn = paint_placed(&engine, &subject.mesh, &placements, &made, &picture, &options, progress)?;
        let base = match texture {
            Some(texture) => texture,
            None => Image::zeros(look.width, look.height, 4, drawn.image.depth())?,
        };
        let result = composite(&base, &drawn.image, look.opacity, look.linear_light)?;
        let r = &made.report;
        let report = json!({
            "layout": look.layout, "anchors": list.len(), "faces": made.patch.len(), "area": r.area,
            "stretch_all": r.stretch_all, "stretch_best95": r.stretch_best95, "flipped_faces": r.flipped_faces,
            "flipped_area": r.flipped_area, "mirrored": r.mirrored, "shown": r.shown, "shown_twice": r.shown_twice,
            "anchor_error": r.anchor_error, "texels": drawn.texels, "notes": drawn.stats.notes,
        });
        Ok((result, report.to_string()))
    };
    let (result, report) = run(py, progress.as_ref(), common.memory, work)?;
    Ok((of_image(py, result)?, report))
}

fn options(look: &Paint, subject: &Subject, common: &Common) -> Result<PaintOptions> {
    let material = |name: &String| {
        let all = &subject.mesh.materials;
        all.iter().position(|m| m.name == *name).map(|k| k as u32).ok_or_else(|| {
            let names: Vec<&str> = all.iter().take(12).map(|m| m.name.as_str()).collect();
            Error::option("material", format!("{name:?} is no material of the mesh"), format!("It has: {names:?}"))
        })
    };
    Ok(PaintOptions {
        width: look.width,
        height: look.height,
        margin: look.margin,
        filter: word("filter", &look.filter)?,
        supersample: look.supersample,
        linear_light: look.linear_light,
        material: look.material.as_ref().map(material).transpose()?,
        memory: common.memory,
    })
}

/// The mesh with charts.
#[pyfunction]
pub(crate) fn unwrap(
    py: Python<'_>,
    mesh: &Shape,
    size: u32,
    margin: u32,
    chart_angle: f64,
    common: Common,
) -> PyResult<(Shape, String)> {
    let subject = Arc::clone(&mesh.subject);
    let work = move || {
        // On a small texture a wide margin would leave no room for the charts.
        let gap = margin.clamp(1, (size / 64).max(2));
        let made = cut(&subject.mesh, &subject.topology, &UnwrapOptions { size, gap, angle: chart_angle })?;
        let (r, d) = (&made.report, made.report.distortion);
        let report = json!({
            "charts": r.charts, "not_disks": r.not_disks, "gap": r.gap, "rounds": r.rounds,
            "angle_distortion": {"median": d.angle_median, "p95": d.angle_p95},
            "stretch": {"median": d.stretch_median, "p95": d.stretch_p95},
            "packing_efficiency": d.texture_area, "seam_length": r.seam_length, "texels_per_unit": r.texels_per_unit,
            "flat_faces": r.flat, "overlapping_faces": r.faulty, "repeated_faces": r.copies,
            "cut_polygons": r.cut_polygons,
        });
        Ok((Shape::of(Subject::new(made.mesh)?), report.to_string()))
    };
    run_apart(py, common.memory, work)
}
