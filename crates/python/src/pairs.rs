//! Pairs of anchors: proposed, doubted, suggested; and shapes made alike by them.

use barymap::progress::Progress;
use barymap::surface::AnchorPairs;
use barymap::tools::anchors::{AnchorOptions, Contradictions, contradicted, propose, suggest};
use barymap::tools::morph::compatible_mesh;
use barymap::{Error, Result};
use numpy::PyArray2;
use pyo3::prelude::*;
use serde_json::json;

use crate::anchors::Given;
use crate::arrays::{Places, of_places, of_points3};
use crate::point_map::PointMap;
use crate::settings::{Common, Embedded};
use crate::shape::Shape;
use crate::work::run;

/// What is wanted: a dictionary of the Python half.
#[derive(Clone, Debug, FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Wanted {
    count: usize,
    connectivity: bool,
    check: bool,
    drop_outliers: bool,
    suggest: usize,
}

/// Most places that are suggested at once.
const MOST_SUGGESTED: usize = 1000;

/// Pairs of anchors, and what is said of them as JSON.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "two shapes, pairs, and what is wanted")]
pub(crate) fn anchors<'py>(
    py: Python<'py>,
    source: &Shape,
    target: &Shape,
    given: Option<Given>,
    wanted: Wanted,
    embedded: Embedded,
    common: Common,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Places<'py>, Places<'py>, String)> {
    let work = |progress: &dyn Progress| {
        if wanted.suggest > MOST_SUGGESTED {
            let remedy = format!("Give at most {MOST_SUGGESTED}");
            return Err(Error::option("suggest", format!("{} places", wanted.suggest), remedy));
        }
        let found = given.map(|g| g.find(&source.subject, &target.subject)).transpose()?;
        let (mut seeds, mut notes) = found.unwrap_or_default();
        let options = embedded.options()?;
        let (a, told) = source.embedded(&options, &common, progress)?;
        notes.extend(told);
        let (b, told) = target.embedded(&options, &common, progress)?;
        notes.extend(told);
        let mut said = Contradictions::default();
        if !seeds.is_empty() {
            said = contradicted(a.shape(), b.shape(), &seeds)?;
        }
        let Contradictions { outliers, at_odds, too_few } = said;
        if wanted.drop_outliers {
            seeds = without(&seeds, &outliers.iter().map(|o| o.index).collect::<Vec<_>>());
        }
        let proposal = if wanted.check {
            None
        } else {
            let options = AnchorOptions { count: wanted.count, connectivity: wanted.connectivity };
            Some(propose(a.shape(), b.shape(), &seeds, &options, progress)?)
        };
        let pairs = proposal.as_ref().map_or_else(|| seeds.clone(), |p| p.anchors());
        let mut report = json!({
            "outliers": outliers.iter().map(|o| json!({"pair": o.index, "off": o.off})).collect::<Vec<_>>(),
            "at_odds": at_odds,
            "too_few": too_few,
        });
        if let Some(p) = &proposal {
            notes.extend(p.notes.iter().cloned());
            report["given"] = json!(p.given);
            report["ambiguity"] = json!(p.ambiguity);
            let each = p
                .pairs
                .iter()
                .map(|p| json!({"origin": p.origin.word(), "expected_error": p.expected_error, "flagged": p.flagged}));
            report["pairs"] = each.collect();
        }
        if wanted.suggest > 0 {
            let known = if seeds.is_empty() { &pairs } else { &seeds };
            let places = suggest(a.shape(), b.shape(), known, wanted.suggest)?;
            let each = places.iter().map(|s| {
                let guess = s.guess.map(|g| {
                    let here = a.mesh.point_in_file(g);
                    let position = g.position(&a.mesh).to_array();
                    json!({"face": here.face, "barycentric": here.barycentric, "position": position})
                });
                json!({"target": {"vertex": s.vertex}, "source": guess, "expected_error": s.expected_error})
            });
            report["suggestions"] = each.collect();
        }
        report["notes"] = json!(notes);
        Ok((pairs, report.to_string()))
    };
    let (pairs, report) = run(py, progress.as_ref(), common.memory, work)?;
    let on_source = of_places(py, &pairs.source, &source.subject.mesh);
    Ok((on_source, of_places(py, &pairs.target, &target.subject.mesh), report))
}

fn without(pairs: &AnchorPairs, dropped: &[usize]) -> AnchorPairs {
    let (mut kept, all) = (AnchorPairs::default(), pairs.source.iter().zip(&pairs.target).enumerate());
    for (_, (s, t)) in all.filter(|(i, _)| !dropped.contains(i)) {
        kept.source.push(*s);
        kept.target.push(*t);
    }
    kept
}

/// The source's shape on the target's vertices (n, 3), mended where triangles turned over, and what
/// was done as JSON.
#[pyfunction]
pub(crate) fn compatible<'py>(py: Python<'py>, map: &PointMap) -> PyResult<(Bound<'py, PyArray2<f64>>, String)> {
    let work = |_: &dyn Progress| -> Result<_> {
        let (s, t) = (&map.source, &map.target);
        let (from, to) = ((&t.mesh, &t.topology), (&s.mesh, &s.topology));
        let made = compatible_mesh(from, to, map.map.as_ref(), &map.pairs.target)?;
        let r = made.report;
        let report = json!({
            "valid": r.valid, "doubtful": r.doubtful, "filled": r.filled, "bad_before": r.bad_before, "bad": r.bad,
            "bad_area": r.bad_area, "moved": r.moved, "off": r.off, "stretch_all": r.stretch_all,
            "stretch_best95": r.stretch_best95, "long_edges": r.long_edges,
        });
        Ok((made.mesh.positions, report.to_string()))
    };
    let (positions, report) = run(py, None, map.common.memory, work)?;
    Ok((of_points3(py, &positions), report))
}
