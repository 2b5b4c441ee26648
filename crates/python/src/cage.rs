//! Maps of the plane by cages.

use barymap::engine::Engine;
use barymap::geometry::Side;
use barymap::glam::DVec2;
use barymap::mapping::plane::{
    Cage as Polygons, CertifyOptions, CompositeMap, Coordinates, Mapped, Partition, PartitionKind, PartitionOptions,
    SampleOptions, Verdict, certify, partition,
};
use barymap::progress::Progress;
use barymap::tools::transfer::Encoding;
use barymap::tools::warp::frames::cut;
use barymap::tools::warp::{Outside, Placement, WarpOptions, warp_picture};
use barymap::{Error, Result};
use numpy::ndarray::{Array1, Array2};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use serde_json::{Value, json};

use crate::arrays::{image, of_image, of_points2, points2};
use crate::settings::{Common, word};
use crate::work::run;

/// How a cage becomes a map: a dictionary of the Python half.
#[derive(Clone, Debug, FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Mapping {
    path: String,
    partition: String,
    eps: f64,
    resolution: u32,
    coordinates: String,
    certify: bool,
    boxes: u64,
    strict: bool,
}

impl Mapping {
    fn options(&self) -> Result<PartitionOptions> {
        let coordinates: Coordinates = word("coordinates", &self.coordinates)?;
        if self.certify && coordinates != Coordinates::MeanValue {
            return Err(Error::option("certify", "only mean value coordinates can be certified", "Leave one out"));
        }
        Ok(PartitionOptions {
            kind: kind(&self.partition)?,
            path: word("path", &self.path)?,
            eps: self.eps,
            samples: SampleOptions { resolution: self.resolution },
            coordinates,
        })
    }
}

/// `binary`, `uniform:8` and the like.
fn kind(text: &str) -> Result<PartitionKind> {
    let steps = text.strip_prefix("uniform:").and_then(|m| m.parse::<u32>().ok()).filter(|&m| m > 0);
    Ok(match (text, steps) {
        ("direct", _) => PartitionKind::Direct,
        ("binary", _) => PartitionKind::Binary,
        ("continuous", _) => PartitionKind::Continuous,
        ("uniform:auto", _) => PartitionKind::UniformAuto,
        (_, Some(m)) => PartitionKind::Uniform(m),
        _ => {
            let remedy = "Give binary, direct, uniform:M, uniform:auto or continuous";
            return Err(Error::option("partition", format!("{text:?} is no partition"), remedy));
        }
    })
}

/// A cage that has become a map.
#[pyclass(frozen, module = "barymap._barymap")]
pub(crate) struct Cage {
    cage: Polygons,
    partition: Partition,
    map: CompositeMap,
    verdicts: Vec<Verdict>,
    engine: Engine,
    common: Common,
    eps: f64,
}

impl Cage {
    fn made(loops: [Vec<Vec<DVec2>>; 2], mapping: &Mapping, common: Common, progress: &dyn Progress) -> Result<Self> {
        let [source, target] = loops;
        let options = mapping.options()?;
        let cage = Polygons::new(source, target)?;
        let engine = common.engine()?;
        let found = partition(&engine, &cage, &options, progress)?;
        let mut verdicts = Vec::new();
        if mapping.certify && !found.folds {
            let budget = CertifyOptions { boxes: mapping.boxes, ..CertifyOptions::default() };
            for pair in found.polygons.windows(2) {
                verdicts.push(certify(&pair[0], &pair[1], &budget, progress)?);
            }
        }
        let map = CompositeMap::new(options.coordinates, found.polygons.clone())?;
        let made = Self { cage, partition: found, map, verdicts, engine, common, eps: mapping.eps };
        if mapping.strict && made.word() == "failed" {
            let remedy = "Use partition=\"binary\" with a smaller eps, or move the cage less";
            return Err(Error::numeric("the map folds, and strict forbids that", remedy));
        }
        Ok(made)
    }

    fn word(&self) -> &'static str {
        if self.partition.folds || self.verdicts.iter().any(|v| matches!(v, Verdict::Folds { .. })) {
            "failed"
        } else if !self.verdicts.is_empty() && self.verdicts.iter().all(|v| matches!(v, Verdict::Certified { .. })) {
            "certified"
        } else {
            "sampled"
        }
    }

    /// The map at a share of the way; the whole map at 1.
    fn at(&self, t: f64) -> Result<CompositeMap> {
        CompositeMap::new(self.map.coordinates(), cut(&self.cage, &self.partition, t)?)
    }
}

/// A picture, the Jacobian at its pixels where that is asked for, and counts.
type Warped<'py> = (Bound<'py, PyAny>, Option<Bound<'py, PyArray2<f32>>>, String);
/// Points, whether each has an image, and the Jacobian there.
type Points<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<bool>>, Bound<'py, PyArray1<f64>>);

/// How a picture is warped: a dictionary of the Python half.
#[derive(Clone, Debug, FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Look {
    units: String,
    filter: String,
    outside: String,
    size: Option<(u32, u32)>,
    linear_light: bool,
    jacobian: bool,
    time: f64,
}

#[pymethods]
impl Cage {
    #[new]
    fn new(
        py: Python<'_>,
        source: Vec<PyReadonlyArray2<'_, f64>>,
        target: Vec<PyReadonlyArray2<'_, f64>>,
        mapping: Mapping,
        common: Common,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let loops = [source, target].map(|loops| loops.iter().map(points2).collect::<Vec<_>>());
        let memory = common.memory;
        run(py, progress.as_ref(), memory, move |progress| Self::made(loops, &mapping, common, progress))
    }

    /// Warps a picture.
    fn warp<'py>(
        &self,
        py: Python<'py>,
        picture: &Bound<'py, PyAny>,
        look: Look,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Warped<'py>> {
        let picture = image(picture)?;
        let work = |progress: &dyn Progress| {
            let [width, height] = look.size.map_or([picture.width, picture.height], |(w, h)| [w, h]);
            let placement = |rows: u32| match look.units.as_str() {
                "pixel" => Ok(Placement::pixels()),
                "unit" => Ok(Placement::upward(picture.height, rows)),
                other => Err(Error::option("units", format!("{other:?} are no units"), "Give pixel or unit")),
            };
            let mut outside: Outside = word("outside", &look.outside)?;
            if outside == Outside::Map && self.map.coordinates() == Coordinates::Wachspress {
                outside = Outside::Transparent;
            }
            let options = WarpOptions {
                filter: word("filter", &look.filter)?,
                outside,
                encoding: Encoding { linear_light: look.linear_light, ..Encoding::default() },
                canvas: Some([width, height]),
                source: placement(picture.height)?,
                target: placement(height)?,
                jacobian: look.jacobian,
                memory: self.common.memory,
            };
            let map = self.at(look.time)?;
            warp_picture(&self.engine, &picture, &map, &options, progress)
        };
        let made = run(py, progress.as_ref(), self.common.memory, work)?;
        let s = &made.stats;
        let report = json!({
            "pixels": s.pixels, "mapped": s.mapped, "empty": s.empty, "memory": s.memory, "resident": s.resident,
            "failed": {"inside": s.failed_inside, "outside": s.failed_outside},
        });
        let (w, h) = (made.image.width as usize, made.image.height as usize);
        let jacobian = made.jacobian.map(|j| Array2::from_shape_fn((h, w), |(y, x)| j[y * w + x]).into_pyarray(py));
        Ok((of_image(py, made.image)?, jacobian, report.to_string()))
    }

    /// Images or pre-images of points, in double precision.
    fn points<'py>(&self, py: Python<'py>, points: PyReadonlyArray2<'py, f64>, inverse: bool) -> PyResult<Points<'py>> {
        let points = points2(&points);
        let found = run(py, None, self.common.memory, |_| mapped(&self.engine, &self.map, inverse, &points))?;
        let place = |m: &Option<Mapped>| m.map_or(DVec2::NAN, |m| m.point);
        let at: Vec<DVec2> = found.iter().map(place).collect();
        Ok((
            of_points2(py, &at),
            Array1::from_iter(found.iter().map(Option::is_some)).into_pyarray(py),
            Array1::from_iter(found.iter().map(|m| m.map_or(f64::NAN, |m| m.jacobian()))).into_pyarray(py),
        ))
    }

    /// What is known of the map, as JSON.
    fn report(&self) -> String {
        let p = &self.partition;
        let step = |(k, s): (usize, &barymap::mapping::plane::StepReport)| {
            let mut step = json!({
                "from": s.from, "to": s.to, "j_min": s.minimum.value, "at": [s.minimum.at.x, s.minimum.at.y],
                "kind": s.minimum.kind.name(),
            });
            match self.verdicts.get(k) {
                Some(Verdict::Certified { lower_bound }) => step["lower_bound"] = json!(lower_bound),
                Some(Verdict::Undecided { boxes, .. }) => step["undecided_after_boxes"] = json!(boxes),
                Some(Verdict::Folds { at, value }) => step["folds"] = json!({"at": [at.x, at.y], "value": value}),
                None => {}
            }
            step
        };
        let steps: Vec<Value> = p.steps.iter().enumerate().map(step).collect();
        json!({
            "bijective": self.word(),
            "coordinates": self.map.coordinates().word(),
            "vertices": self.cage.source.vertex_count(),
            "partition": p.knots,
            "steps": steps,
            "path": p.path.word(),
            "eps": self.eps,
            "notes": p.notes,
        })
        .to_string()
    }
}

/// Points that are mapped between two looks at whether the work is to end.
const CHUNK: usize = 1 << 14;

/// Images, or pre-images, in double precision, as the command line has them.
fn mapped(engine: &Engine, map: &CompositeMap, inverse: bool, points: &[DVec2]) -> Result<Vec<Option<Mapped>>> {
    let reference = Engine::reference();
    // Wachspress coordinates have poles outside their polygon.
    let bounded = map.coordinates() == Coordinates::Wachspress;
    let outside = |p: DVec2| bounded && map.source().contains(p) == Side::Outside;
    let mut all = Vec::with_capacity(points.len());
    for part in points.chunks(CHUNK) {
        if inverse {
            let found = map.inverse_points(engine, part, None)?;
            // Single precision finds them, double precision finishes.
            let guess: Vec<DVec2> = found.iter().zip(part).map(|(m, q)| m.map_or(*q, |m| m.point)).collect();
            let exact = map.inverse_points(&reference, part, Some(&guess))?;
            all.extend(exact.into_iter().map(|m| m.filter(|m| !outside(m.point))));
        } else {
            let images = map.forward_points(&reference, part)?;
            all.extend(images.into_iter().zip(part).map(|(m, p)| (!outside(*p)).then_some(m)));
        }
    }
    Ok(all.into_iter().map(|m| m.filter(|m| m.point.is_finite())).collect())
}
