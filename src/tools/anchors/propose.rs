//! Proposals: the map by the pairs there are, registered by relief in both directions, and a choice of places where that is reliable.

use glam::DVec3;
use rayon::prelude::*;

use super::outliers::{Outlier, outliers};
use super::register::{Hold, Registration, mismatch_of, register};
use super::side::Side;
use super::{AnchorOptions, Origin, Proposal, Proposed};
use crate::error::Result;
use crate::geometry::{Geodesics, March, SurfacePoint};
use crate::progress::Progress;
use crate::surface::AnchorPairs;
use crate::surface::correspondence::{CorrespondenceOptions, Method, Shape, correspondence};
use crate::tools::vertex_map::vertex_map;

/// A mirror image disagrees by less than this part of what the surface as it is does.
const MIRRORED: f64 = 0.7;
/// Places that mismatch and slope of the relief leave more uncertain are passed over, at unit area.
const SIGMA: f64 = 0.05;
/// Places that the two registrations do not bring back as near are passed over.
const CYCLE: f64 = 0.015;
/// An expected error above this part of the square root of the area is flagged.
const DOUBTFUL: f64 = 0.02;

/// Both surfaces, and the maps between them.
pub(super) struct Couple<'a> {
    pub(super) shapes: [Shape<'a>; 2],
    /// Source, target.
    pub(super) sides: [Side<'a>; 2],
}

pub(super) fn swapped(pairs: &AnchorPairs) -> AnchorPairs {
    AnchorPairs { source: pairs.target.clone(), target: pairs.source.clone() }
}

impl<'a> Couple<'a> {
    pub(super) fn new(source: Shape<'a>, target: Shape<'a>) -> Result<Self> {
        let sides = [Side::new(source.mesh, source.topology)?, Side::new(target.mesh, target.topology)?];
        Ok(Self { shapes: [source, target], sides })
    }

    /// The images on surface `to` (0 the source, 1 the target) of the vertices of the other one.
    pub(super) fn images(&self, pairs: &AnchorPairs, to: usize) -> Result<Vec<Option<SurfacePoint>>> {
        let options =
            CorrespondenceOptions { method: Method::Field, confidence: false, ..CorrespondenceOptions::default() };
        let (a, b) = (self.shapes[to], self.shapes[1 - to]);
        let pairs = if to == 0 { pairs.clone() } else { swapped(pairs) };
        let map = correspondence(a, b, &pairs, &options)?;
        let found = vertex_map((a.mesh, a.topology), (b.mesh, b.topology), map.as_ref())?;
        Ok(found.images.iter().map(|i| i.point()).collect())
    }

    fn holds(&self, pairs: &AnchorPairs, to: usize) -> Vec<Hold> {
        let pairs = if to == 0 { pairs.clone() } else { swapped(pairs) };
        let from = &self.sides[1 - to];
        pairs
            .target
            .iter()
            .zip(&pairs.source)
            .map(|(t, s)| Hold {
                v: from.topology.triangles[t.face as usize],
                x: t.barycentric,
                to: self.sides[to].position(s),
            })
            .collect()
    }
}

/// Pairs that grow.
struct Growing<'c, 'a> {
    couple: &'c Couple<'a>,
    /// -1 where one surface is the mirror image of the other.
    handedness: f64,
    pairs: Vec<Proposed>,
}

impl Growing<'_, '_> {
    fn anchors(&self) -> AnchorPairs {
        AnchorPairs {
            source: self.pairs.iter().map(|p| p.source).collect(),
            target: self.pairs.iter().map(|p| p.target).collect(),
        }
    }

    /// Takes out proposals that the others contradict.
    fn drop_contradicted(&mut self, given: usize) -> Result<()> {
        let [s, t] = self.couple.shapes;
        let wrong: Vec<Outlier> = outliers(s, t, &self.anchors())?;
        let indices: Vec<usize> = wrong.iter().map(|o| o.index).filter(|i| *i >= given).collect();
        let mut k = 0;
        self.pairs.retain(|_| {
            k += 1;
            !indices.contains(&(k - 1))
        });
        Ok(())
    }
}

/// Grows `seeds` to a full set.
pub(super) fn propose(
    couple: &Couple<'_>,
    seeds: &AnchorPairs,
    origin: Origin,
    options: &AnchorOptions,
    progress: &dyn Progress,
) -> Result<Proposal> {
    let given = seeds.len();
    let points = seeds.source.iter().zip(&seeds.target);
    let pairs = points
        .map(|(&source, &target)| Proposed { source, target, origin, expected_error: 0.0, flagged: None })
        .collect();
    let [from, to] = &couple.sides;
    let images = couple.images(seeds, 0)?;
    let mirrored = mismatch_of(from, to, &images, -1.0)? < MIRRORED * mismatch_of(from, to, &images, 1.0)?;
    let mut growing = Growing { couple, handedness: if mirrored { -1.0 } else { 1.0 }, pairs };
    let spacing = 1.0 / (options.count as f64).sqrt();
    progress.stage("proposing anchors", 3);
    if given < options.count {
        let mut both = Vec::new();
        for to in 0..2 {
            let start = if to == 0 { images.clone() } else { couple.images(seeds, to)? };
            let (a, b) = (&couple.sides[to], &couple.sides[1 - to]);
            both.push(register(a, b, &start, &couple.holds(seeds, to), growing.handedness)?);
            progress.advance(1);
        }
        place(&mut growing, &both[0], &Reliability::new(couple, &both), options, spacing);
        growing.drop_contradicted(given)?;
        progress.advance(1);
    }
    let mut pairs = growing.pairs;
    for p in pairs.iter_mut().skip(given).filter(|p| p.expected_error > DOUBTFUL) {
        p.flagged = Some(format!("may be off by {:.3} of the square root of the area", p.expected_error));
    }
    let mut notes = Vec::new();
    if pairs.len() < options.count {
        notes.push(format!(
            "{} of {} pairs: elsewhere the relief of the two surfaces does not agree on a place",
            pairs.len(),
            options.count
        ));
    }
    if growing.handedness < 0.0 {
        notes.push("one surface is the mirror image of the other".to_owned());
    }
    Ok(Proposal { pairs, given, notes, ambiguity: None })
}

/// What speaks for the images of a registration at each vertex of the target.
pub(super) struct Reliability {
    /// Target to source and back, at unit area.
    pub(super) cycle: Vec<f64>,
    /// Where that comes back to.
    back: Vec<DVec3>,
    /// The error of the place that mismatch and slope of the relief leave open.
    pub(super) sigma: Vec<f64>,
}

impl Reliability {
    fn new(couple: &Couple<'_>, both: &[Registration]) -> Self {
        let [source, target] = &couple.sides;
        let n = target.positions.len();
        let back: Vec<DVec3> = (0..n)
            .into_par_iter()
            .map(|v| {
                let Some(p) = &both[0].images[v] else { return DVec3::INFINITY };
                let corners = source.topology.triangles[p.face as usize];
                let mut back = DVec3::ZERO;
                for k in 0..3 {
                    let Some(q) = &both[1].images[corners[k] as usize] else { return DVec3::INFINITY };
                    back += p.barycentric[k] * target.position(q);
                }
                back
            })
            .collect();
        let cycle = back.iter().zip(&target.positions).map(|(b, p)| b.distance(*p)).collect();
        let sigma = (0..n).map(|v| (both[0].mismatch[v] / (both[0].hold[v] + 1e-9)).sqrt()).collect();
        Self { cycle, back, sigma }
    }
}

/// Adds pairs far from all others where the registration is reliable.
fn place(
    growing: &mut Growing<'_, '_>,
    registration: &Registration,
    reliable: &Reliability,
    options: &AnchorOptions,
    spacing: f64,
) {
    let target = &growing.couple.sides[1];
    let geodesics = Geodesics::new(&target.positions, &target.triangles);
    let mut march = March::default();
    geodesics.clear(&mut march);
    let corner = |p: &SurfacePoint| target.topology.triangles[p.face as usize][p.dominant_corner()];
    for p in &growing.pairs {
        geodesics.add_source(corner(&p.target), &mut march);
    }
    let good = |v: usize| registration.images[v].is_some() && reliable.sigma[v] <= SIGMA && reliable.cycle[v] <= CYCLE;
    while growing.pairs.len() < options.count {
        let farthest = (0..target.positions.len())
            .filter(|&v| march.distances[v].is_finite() && good(v))
            .max_by(|&a, &b| march.distances[a].total_cmp(&march.distances[b]).then(b.cmp(&a)));
        let Some(v) = farthest.filter(|&v| march.distances[v] > 0.3 * spacing) else { break };
        geodesics.add_source(v as u32, &mut march);
        if let (Some(source), Some(point)) = (registration.images[v], target.topology.vertex_point(v as u32)) {
            // The two registrations err in different directions: their mean goes half as far as coming back does.
            let between = 0.5 * (target.positions[v] + reliable.back[v]);
            growing.pairs.push(Proposed {
                source,
                target: target.closest_near(between, point),
                origin: Origin::Relief,
                expected_error: (0.5 * reliable.sigma[v]).max(2.0 * reliable.cycle[v]),
                flagged: None,
            });
        }
    }
}
