//! Pictures and data of vertices through a map.

use barymap::desk::{Textures, textures};
use barymap::geometry::{Mesh, Placement};
use barymap::picture::Image;
use barymap::progress::Progress;
use barymap::tools::attributes::{Attribute, AttributeKind, AttributeTransfer, VertexStatus, transfer_attributes};
use barymap::tools::transfer::{
    Background, Layer, LayerKind, TransferOptions, TransferOutput, check_beforehand, transfer_on,
};
use barymap::{Error, Result};
use numpy::ndarray::{Array1, Array2};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use serde_json::json;

use crate::arrays::{image, of_image};
use crate::point_map::PointMap;
use crate::settings::word;
use crate::work::run;

/// A layer of a transfer: a dictionary of the Python half. Without a picture `file` names it as the
/// command line's `--texture` does.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Given<'py> {
    role: String,
    kind: Option<String>,
    image: Option<Bound<'py, PyAny>>,
}

/// How it is transferred: a dictionary of the Python half.
#[derive(Clone, Debug, FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Look {
    width: u32,
    height: u32,
    margin: u32,
    fill: String,
    fill_doubtful: bool,
    linear_light: bool,
    filter: String,
    supersample: u32,
    stmap: bool,
    background: Option<[f32; 4]>,
    normal_y: String,
    relief: String,
    memory: u64,
}

impl Look {
    fn options(&self) -> Result<TransferOptions> {
        let options = TransferOptions {
            width: self.width,
            height: self.height,
            margin: self.margin,
            supersample: self.supersample,
            filter: word("filter", &self.filter)?,
            fill: word("fill", &self.fill)?,
            fill_doubtful: self.fill_doubtful,
            coordinates: self.stmap,
            background: self.background.map_or(Background::Transparent, Background::Color),
            memory: self.memory,
            ..TransferOptions::default()
        };
        if self.fill_doubtful && self.fill == "none" {
            return Err(Error::option("fill_doubtful", "nothing is filled", "Say how, with fill=\"smooth\""));
        }
        Ok(options)
    }

    /// What a layer holds: as it is said, else as its role says.
    fn kind(&self, role: &str, kind: Option<&str>) -> Result<LayerKind> {
        let (y, relief) = (word("normal_y", &self.normal_y)?, word("relief", &self.relief)?);
        let by_role = match role {
            "normal" => "normal",
            "label" => "labels",
            "displacement" => "displacement",
            _ => "color",
        };
        Ok(match kind.unwrap_or(by_role) {
            "color" => LayerKind::Color,
            "labels" => LayerKind::Labels,
            "normal" => LayerKind::TangentNormal { y, relief },
            "normal-object" => LayerKind::ObjectNormal { relief },
            "displacement" => LayerKind::Displacement { relief },
            other => {
                let what = format!("{other:?} is no kind of texture");
                let remedy = "Give one of color, labels, normal, normal-object, displacement";
                return Err(Error::option("kind", what, remedy));
            }
        })
    }
}

/// The placement that all materials of the source have; as it is without one.
fn placement(mesh: &Mesh) -> Placement {
    let mut all = mesh.materials.iter().map(|m| m.base_color_placement);
    let first = all.next().unwrap_or_default();
    if all.all(|p| p == first) { first } else { Placement::default() }
}

/// Pictures by role, coverage, ST-map, report.
type Transferred<'py> = (Vec<(String, Bound<'py, PyAny>)>, Bound<'py, PyAny>, Option<Bound<'py, PyAny>>, String);

/// The pictures of `layers`, or of the files `named`, on the target.
#[pyfunction]
pub(crate) fn transfer<'py>(
    py: Python<'py>,
    map: &PointMap,
    layers: Vec<Given<'py>>,
    named: Vec<String>,
    own: bool,
    look: Look,
    progress: Option<Py<PyAny>>,
) -> PyResult<Transferred<'py>> {
    let pictures: Vec<(String, Option<String>, Option<Image>)> = layers
        .into_iter()
        .map(|l| Ok((l.role, l.kind, l.image.as_ref().map(image).transpose()?)))
        .collect::<PyResult<_>>()?;
    let work = |progress: &dyn Progress| {
        let options = look.options()?;
        let mesh = &map.source.mesh;
        let mut notes = Vec::new();
        let mut given: Vec<Textures> = Vec::new();
        for (role, kind, picture) in pictures {
            let Some(picture) = picture else { continue };
            let kind = look.kind(&role, kind.as_deref())?;
            given.push(Textures { role, kind, placements: vec![placement(mesh)], ..Textures::single(picture) });
        }
        if own || !named.is_empty() {
            let told = std::cell::RefCell::new(Vec::new());
            let read = textures(&named, own, mesh, &|text| told.borrow_mut().push(text.to_owned()))?;
            notes.extend(told.into_inner());
            for mut read in read {
                read.kind = look.kind(&read.role, None)?;
                given.push(read);
            }
        }
        let made = map.transferred(&given, &look, &options, progress)?;
        let roles: Vec<String> = given.into_iter().map(|g| g.role).collect();
        Ok((roles, made, notes))
    };
    let (roles, made, notes) = run(py, progress.as_ref(), look.memory, work)?;
    let report = report(&made, &roles, &notes);
    let pictures = roles.into_iter().zip(made.layers).map(|(role, picture)| Ok((role, of_image(py, picture)?)));
    let pictures = pictures.collect::<PyResult<Vec<_>>>()?;
    let stmap = made.coordinates.map(|c| of_image(py, c)).transpose()?;
    Ok((pictures, of_image(py, made.coverage)?, stmap, report))
}

/// Values (n, columns) and status (n,).
type Carried<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<u8>>);

/// Data (n, columns) of the source's vertices on the target's, with the status of each.
#[pyfunction]
pub(crate) fn attributes<'py>(
    py: Python<'py>,
    map: &PointMap,
    values: PyReadonlyArray2<'py, f64>,
    kind: &str,
    keep: usize,
    fill: &str,
    progress: Option<Py<PyAny>>,
) -> PyResult<Carried<'py>> {
    let columns = values.as_array().ncols();
    let values: Vec<f64> = values.as_array().iter().copied().collect();
    let work = |_: &dyn Progress| {
        let kind = match kind {
            "scalars" | "colors" => AttributeKind::Scalars,
            "weights" => AttributeKind::Weights { keep },
            "labels" => AttributeKind::Labels,
            "vectors" => AttributeKind::Vectors,
            "normals" => AttributeKind::Normals,
            "tangents" => AttributeKind::Tangents,
            other => {
                let remedy = "Give one of scalars, weights, labels, vectors, normals, tangents, colors";
                return Err(Error::option("kind", format!("{other:?} is no kind of data"), remedy));
            }
        };
        let given = [Attribute { name: "values".into(), kind, columns, values }];
        given[0].check(&map.source.mesh)?;
        let (s, t) = (&map.source, &map.target);
        let fill = word("fill", fill)?;
        transfer_attributes((&s.mesh, &s.topology), (&t.mesh, &t.topology), map.map.as_ref(), &given, fill)
    };
    let AttributeTransfer { attributes, status, .. } = run(py, progress.as_ref(), map.common.memory, work)?;
    let rows = status.len();
    let flat = attributes.into_iter().next().map_or_else(Vec::new, |a| a.values);
    let status = Array1::from_iter(status.into_iter().map(VertexStatus::number)).into_pyarray(py);
    Ok((Array2::from_shape_fn((rows, columns), |(i, k)| flat[i * columns + k]).into_pyarray(py), status))
}

impl PointMap {
    fn transferred(
        &self,
        given: &[Textures],
        look: &Look,
        options: &TransferOptions,
        progress: &dyn Progress,
    ) -> Result<TransferOutput> {
        let (source, target) = (&self.source.mesh, &self.target.mesh);
        let layers: Vec<Layer<'_>> = given.iter().map(|t| t.layer(look.linear_light)).collect();
        if layers.is_empty() {
            return Err(Error::input("images: there is none", "Give a picture, or several by their roles"));
        }
        if let Some(mesh) = [source, target].into_iter().find(|m| !m.has_texcoords()) {
            let needed = std::ptr::eq(mesh, target) || given.iter().any(Textures::needs_texcoords);
            if needed {
                let remedy = "Give uv to barymap.Mesh, or make some with barymap.unwrap";
                return Err(Error::mesh(&mesh.name, "it has no texture coordinates", remedy));
            }
        }
        check_beforehand(source, &layers, target, options)?;
        transfer_on(&self.engine, source, &layers, target, self.map.as_ref(), options, progress)
    }
}

fn report(made: &TransferOutput, roles: &[String], notes: &[String]) -> String {
    let s = &made.stats;
    let seconds: serde_json::Map<String, serde_json::Value> =
        s.stages.iter().map(|t| (t.name.to_owned(), json!(t.seconds))).collect();
    json!({
        "texels": s.texels,
        "covered": s.covered,
        "valid": s.valid,
        "doubtful": s.doubtful,
        "colorless": s.colorless,
        "filled": s.filled,
        "padded": s.padded,
        "overlapping": s.overlapping,
        "valid_fraction": s.valid_fraction,
        "size_ratio": s.size_ratio,
        "memory": s.memory,
        "bands": s.bands,
        "roles": roles,
        "device_stages": s.device_stages,
        "seconds": seconds,
        "notes": notes.iter().chain(&s.notes).collect::<Vec<_>>(),
    })
    .to_string()
}
