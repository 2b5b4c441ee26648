//! Pairs that the others contradict.

use glam::DVec3;

use crate::error::Result;
use crate::geometry::Frame;
use crate::surface::correspondence::{CorrespondenceOptions, Method, Shape, correspondence};
use crate::surface::field::FEWEST;
use crate::surface::{AnchorPairs, PackedPoint};

/// A pair that the others contradict.
#[derive(Clone, Debug, PartialEq)]
pub struct Outlier {
    /// Index of the pair.
    pub index: usize,
    /// How far from its place on the source the others send it, over the square root of the
    /// source's area.
    pub off: f64,
}

/// What pairs say of one another.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contradictions {
    /// Pairs that the others contradict, worst first.
    pub outliers: Vec<Outlier>,
    /// What half of them are missed by where most must be wrong, and none can be named
    /// ([`FieldReport::at_odds`](crate::surface::field::FieldReport::at_odds)).
    pub at_odds: Option<f64>,
    /// Whether there are too few to say anything.
    pub too_few: bool,
}

/// Least error of a wrong pair, over the square root of the area.
const LEAST: f64 = 0.03;
/// A wrong pair is off by more than this many times the distance to the next one.
const OF_SPACING: f64 = 0.8;
/// The same of tips, which no others surround: there the map is carried on beyond what is known.
const OF_SPACING_AT_TIPS: f64 = 2.5;
/// Pairs whose direction to their neighbours has at least this mean lie at a tip.
const ONE_SIDED: f64 = 0.6;
/// Neighbours that are looked at.
const NEIGHBOURS: usize = 5;
/// A wrong pair is off by this many times the median.
const OF_MEDIAN: f64 = 4.0;
/// Pairs taken out one after the other.
const MOST: usize = 16;

/// Names the pairs that the others contradict, worst first. What was taken out while another wrong
/// pair accused it is put back in the end.
pub(super) fn outliers(source: Shape<'_>, target: Shape<'_>, pairs: &AnchorPairs) -> Result<Contradictions> {
    let options = CorrespondenceOptions {
        method: Method::Field,
        confidence: false,
        keep_all: true,
        ..CorrespondenceOptions::default()
    };
    let (here, there) = (Frame::of_mesh(target.mesh), Frame::of_mesh(source.mesh));
    let length = target.mesh.area().sqrt() * here.scale;
    let at: Vec<DVec3> = pairs.target.iter().map(|p| here.place(p, target.mesh) / length).collect();
    let mut kept: Vec<usize> = (0..pairs.len()).collect();
    let mut out: Vec<Outlier> = Vec::new();
    let map_of = |kept: &[usize]| correspondence(source, target, &pairs.part(kept), &options);
    let mut usual = 0.0;
    let mut at_odds = None;
    while kept.len() >= FEWEST && out.len() < MOST {
        let map = map_of(&kept)?;
        let Some(report) = map.field() else { break };
        let mut sorted = report.left_out.clone();
        sorted.sort_by(f64::total_cmp);
        usual = sorted[sorted.len() / 2];
        at_odds = report.at_odds();
        let worst = (0..kept.len())
            .map(|k| Outlier { index: kept[k], off: report.left_out[k] })
            .filter(|o| o.off > bound(&at, &kept, o.index, usual))
            .max_by(|a, b| a.off.total_cmp(&b.off).then(b.index.cmp(&a.index)));
        let Some(worst) = worst else { break };
        kept.retain(|i| *i != worst.index);
        out.push(worst);
    }
    let said = |outliers| Contradictions { outliers, at_odds, too_few: pairs.len() < FEWEST };
    if out.len() < 2 {
        return Ok(said(out));
    }
    let map = map_of(&kept)?;
    let points: Vec<PackedPoint> = out.iter().map(|o| pairs.target[o.index].into()).collect();
    let mut images = Vec::new();
    map.map(&points, &mut images)?;
    let unit = source.mesh.area().sqrt() * there.scale;
    for (o, image) in out.iter_mut().zip(&images) {
        let place = there.place(&pairs.source[o.index], source.mesh);
        o.off = image.point().map_or(1.0, |p| there.place(&p, source.mesh).distance(place) / unit);
    }
    out.retain(|o| o.off > bound(&at, &kept, o.index, usual));
    out.sort_by(|a, b| b.off.total_cmp(&a.off).then(a.index.cmp(&b.index)));
    Ok(said(out))
}

/// The error beyond which pair `i` counts as wrong beside the pairs `kept`; `usual` is the median
/// error.
fn bound(at: &[DVec3], kept: &[usize], i: usize, usual: f64) -> f64 {
    let mut others: Vec<DVec3> = kept.iter().filter(|j| **j != i).map(|&j| at[j] - at[i]).collect();
    others.sort_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    others.truncate(NEIGHBOURS);
    let next = others.first().map_or(0.0, |d| d.length());
    let mean = others.iter().map(|d| d.normalize_or_zero()).sum::<DVec3>() / others.len().max(1) as f64;
    let part = if mean.length() > ONE_SIDED { OF_SPACING_AT_TIPS } else { OF_SPACING };
    LEAST.max(OF_MEDIAN * usual).max(part * next)
}
