//! Pairs that the others contradict.

use crate::error::Result;
use crate::surface::AnchorPairs;
use crate::surface::correspondence::{CorrespondenceOptions, Method, Shape, correspondence};

/// A pair that the others contradict.
#[derive(Clone, Debug, PartialEq)]
pub struct Outlier {
    /// Index of the pair.
    pub index: usize,
    /// How far from its place on the source the others send it, over the square root of the source's area.
    pub off: f64,
}

/// Least error of a wrong pair, over the square root of the area.
const LEAST: f64 = 0.03;
/// A wrong pair is off by more than this part of the distance to the next anchor; tips of limbs, which no others surround, are off by less.
const OF_SPACING: f64 = 0.6;
/// A wrong pair is off by this many times the median.
const OF_MEDIAN: f64 = 4.0;
/// Pairs taken out one after the other.
const MOST: usize = 16;
/// Fewer pairs say nothing about one another.
const FEWEST: usize = 6;

/// Names the pairs that the others contradict, worst first.
pub(super) fn outliers(source: Shape<'_>, target: Shape<'_>, pairs: &AnchorPairs) -> Result<Vec<Outlier>> {
    let options =
        CorrespondenceOptions { method: Method::Field, confidence: false, ..CorrespondenceOptions::default() };
    let length = target.mesh.area().sqrt();
    let mut kept: Vec<usize> = (0..pairs.len()).collect();
    let mut out = Vec::new();
    while kept.len() >= FEWEST && out.len() < MOST {
        let now = AnchorPairs {
            source: kept.iter().map(|&i| pairs.source[i]).collect(),
            target: kept.iter().map(|&i| pairs.target[i]).collect(),
        };
        let map = correspondence(source, target, &now, &options)?;
        let Some(report) = map.field() else { break };
        let left_out = &report.left_out;
        let mut sorted = left_out.clone();
        sorted.sort_by(f64::total_cmp);
        let median = sorted[sorted.len() / 2];
        let at: Vec<_> = now.target.iter().map(|p| p.position(target.mesh) / length).collect();
        let worst = (0..kept.len())
            .filter(|&i| {
                let others = (0..kept.len()).filter(|&j| j != i);
                let next = others.map(|j| at[i].distance(at[j])).fold(f64::INFINITY, f64::min);
                left_out[i] > LEAST && left_out[i] > OF_MEDIAN * median && left_out[i] > OF_SPACING * next
            })
            .max_by(|&a, &b| left_out[a].total_cmp(&left_out[b]).then(b.cmp(&a)));
        let Some(i) = worst else { break };
        out.push(Outlier { index: kept[i], off: left_out[i] });
        kept.remove(i);
    }
    Ok(out)
}
