//! Rounds of proposals: marks matched through the current map, then a registration by relief, then a choice.

use glam::DVec3;
use rayon::prelude::*;

use super::marks::{Kind, Mark, marks};
use super::outliers::{Outlier, outliers};
use super::register::{Hold, Registration, register};
use super::side::Side;
use super::{AnchorOptions, Origin, Proposal, Proposed};
use crate::error::Result;
use crate::geometry::{Geodesics, March, SurfacePoint};
use crate::progress::Progress;
use crate::surface::AnchorPairs;
use crate::surface::correspondence::{CorrespondenceOptions, Method, Shape, correspondence};
use crate::tools::vertex_map::vertex_map;

/// How far from where the map sends it the partner of a mark is looked for, and how much a mark must stand out, round by round.
const ROUNDS: [(f64, f64); 4] = [(0.10, 0.35), (0.06, 0.2), (0.04, 0.1), (0.03, 0.1)];
/// A partner is taken if the next best costs this many times as much.
const DISTINCT: f64 = 1.4;
/// Largest cost of a partner.
const DEAREST: f64 = 0.75;
/// The same of pits, which folds of the skin make and unmake.
const DEAREST_PIT: f64 = 0.3;
/// Marks that differ by more are no partners; the second for pits.
const UNLIKE: [f64; 2] = [0.3, 0.15];
/// Expected error of a mark per unit of cost.
const EXPECTED: f64 = 0.02;
/// Marks nearer to an anchor than this part of the spacing add nothing.
const CROWDED: f64 = 0.5;
/// Registrations, each from the map by what the one before it placed.
const PLACINGS: usize = 2;
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
    pairs: Vec<Proposed>,
}

impl Growing<'_, '_> {
    fn anchors(&self) -> AnchorPairs {
        AnchorPairs {
            source: self.pairs.iter().map(|p| p.source).collect(),
            target: self.pairs.iter().map(|p| p.target).collect(),
        }
    }

    /// Whether a point of surface `side` lies within `distance` of a pair.
    fn crowded(&self, side: usize, p: DVec3, distance: f64) -> bool {
        let s = &self.couple.sides[side];
        self.pairs.iter().any(|q| s.position(if side == 0 { &q.source } else { &q.target }).distance(p) < distance)
    }

    /// Matches the marks of both surfaces through the maps.
    fn match_marks(&mut self, all: &[Vec<Mark>; 2], radius: f64, least: f64, spacing: f64) -> Result<()> {
        let anchors = self.anchors();
        let (forward, backward) = (self.couple.images(&anchors, 0)?, self.couple.images(&anchors, 1)?);
        let [source, target] = &self.couple.sides;
        let strong = |side: usize| all[side].iter().filter(move |m| m.height >= least).collect::<Vec<_>>();
        let (on_source, on_target) = (strong(0), strong(1));
        let sent = |image: &Option<SurfacePoint>, side: &Side<'_>| image.as_ref().map(|p| side.position(p));
        let to_source: Vec<Option<DVec3>> =
            on_target.iter().map(|m| sent(&forward[m.vertex as usize], source)).collect();
        let to_target: Vec<Option<DVec3>> =
            on_source.iter().map(|m| sent(&backward[m.vertex as usize], target)).collect();
        let cost = |s: usize, t: usize| -> f64 {
            let (a, b) = (on_source[s], on_target[t]);
            let (Some(p), Some(q)) = (to_source[t], to_target[s]) else { return f64::INFINITY };
            if a.kind != b.kind {
                return f64::INFINITY;
            }
            let off =
                p.distance(source.positions[a.vertex as usize]).max(q.distance(target.positions[b.vertex as usize]));
            let unlike = a.difference(b);
            if unlike > UNLIKE[usize::from(matches!(a.kind, Kind::Pit(_)))] {
                f64::INFINITY
            } else {
                off / radius + unlike
            }
        };
        let best = |costs: &mut dyn Iterator<Item = (f64, usize)>| -> Option<(f64, usize, f64)> {
            let (mut first, mut second) = ((f64::INFINITY, usize::MAX), f64::INFINITY);
            for c in costs {
                if c.0 < first.0 {
                    (first, second) = (c, first.0);
                } else {
                    second = second.min(c.0);
                }
            }
            (first.0 <= DEAREST).then_some((first.0, first.1, second))
        };
        let mut found = Vec::new();
        for t in 0..on_target.len() {
            let Some((c, s, next)) = best(&mut (0..on_source.len()).map(|s| (cost(s, t), s))) else { continue };
            let Some((_, back, other)) = best(&mut (0..on_target.len()).map(|t| (cost(s, t), t))) else { continue };
            let dearest = if matches!(on_target[t].kind, Kind::Pit(_)) { DEAREST_PIT } else { DEAREST };
            if back == t && c <= dearest && next.min(other) > DISTINCT * c {
                found.push((c, s, t));
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
        for (c, s, t) in found {
            let (s, t) = (on_source[s], on_target[t]);
            let apart = CROWDED * spacing;
            if self.crowded(0, source.positions[s.vertex as usize], apart)
                || self.crowded(1, target.positions[t.vertex as usize], apart)
            {
                continue;
            }
            let expected_error = (EXPECTED * c).max(0.5 * s.extent.min(t.extent));
            let (Some(source), Some(target)) =
                (source.topology.vertex_point(s.vertex), target.topology.vertex_point(t.vertex))
            else {
                continue;
            };
            self.pairs.push(Proposed { source, target, origin: Origin::Mark, expected_error, flagged: None });
        }
        Ok(())
    }

    /// Takes out marks that the others contradict.
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
    let mut growing = Growing { couple, pairs };
    let spacing = 1.0 / (options.count as f64).sqrt();
    let all = [marks(&couple.sides[0]), marks(&couple.sides[1])];
    progress.stage("proposing anchors", (ROUNDS.len() + 1 + 2 * PLACINGS) as u64);
    for (radius, least) in ROUNDS {
        if growing.pairs.len() < options.count {
            growing.match_marks(&all, radius, least, spacing)?;
        }
        progress.advance(1);
    }
    growing.drop_contradicted(given)?;
    progress.advance(1);
    // What no mark stands at is placed by the relief around it.
    if growing.pairs.len() < options.count {
        let marked = growing.anchors();
        for _ in 0..PLACINGS {
            let now = growing.anchors();
            let mut both = Vec::new();
            for to in 0..2 {
                let start = couple.images(&now, to)?;
                let (a, b) = (&couple.sides[to], &couple.sides[1 - to]);
                both.push(register(a, b, &start, &couple.holds(&marked, to))?);
                progress.advance(1);
            }
            growing.pairs.truncate(marked.len());
            place(&mut growing, &both[0], &Reliability::new(couple, &both), options, spacing);
        }
        growing.drop_contradicted(given)?;
    }
    let mut pairs = growing.pairs;
    if pairs.len() > options.count.max(given) {
        pairs = spread(couple, pairs, given, options.count);
    }
    for p in pairs.iter_mut().skip(given).filter(|p| p.expected_error > DOUBTFUL) {
        p.flagged = Some(format!("may be off by {:.3} of the square root of the area", p.expected_error));
    }
    let mut notes = Vec::new();
    if pairs.len() < options.count {
        notes.push(format!(
            "{} of {} pairs: elsewhere the surfaces have no features in common that determine a place",
            pairs.len(),
            options.count
        ));
    }
    Ok(Proposal { pairs, given, notes, ambiguity: None })
}

/// What speaks for the images of a registration at each vertex of the target.
pub(super) struct Reliability {
    /// Target to source and back, at unit area.
    pub(super) cycle: Vec<f64>,
    /// The error of the place that mismatch and slope of the relief leave open.
    pub(super) sigma: Vec<f64>,
}

impl Reliability {
    fn new(couple: &Couple<'_>, both: &[Registration]) -> Self {
        let [source, target] = &couple.sides;
        let n = target.positions.len();
        let cycle = (0..n)
            .into_par_iter()
            .map(|v| {
                let Some(p) = &both[0].images[v] else { return f64::INFINITY };
                let corners = source.topology.triangles[p.face as usize];
                let mut back = DVec3::ZERO;
                for k in 0..3 {
                    let Some(q) = &both[1].images[corners[k] as usize] else { return f64::INFINITY };
                    back += p.barycentric[k] * target.position(q);
                }
                back.distance(target.positions[v])
            })
            .collect();
        let sigma = (0..n).map(|v| (both[0].mismatch[v] / (both[0].hold[v] + 1e-9)).sqrt()).collect();
        Self { cycle, sigma }
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
            growing.pairs.push(Proposed {
                source,
                target: point,
                origin: Origin::Relief,
                expected_error: (0.5 * reliable.sigma[v]).max(2.0 * reliable.cycle[v]),
                flagged: None,
            });
        }
    }
}

/// The given pairs and, of the others, those farthest from one another.
fn spread(couple: &Couple<'_>, pairs: Vec<Proposed>, given: usize, count: usize) -> Vec<Proposed> {
    let target = &couple.sides[1];
    let at: Vec<DVec3> = pairs.iter().map(|p| target.position(&p.target)).collect();
    let mut nearest: Vec<f64> = vec![f64::INFINITY; pairs.len()];
    let mut chosen: Vec<usize> = (0..given).collect();
    let near = |nearest: &mut Vec<f64>, i: usize| {
        for (d, p) in nearest.iter_mut().zip(&at) {
            *d = d.min(p.distance(at[i]));
        }
    };
    chosen.iter().for_each(|&i| near(&mut nearest, i));
    while chosen.len() < count {
        let next = (given..pairs.len())
            .filter(|i| !chosen.contains(i))
            .max_by(|&a, &b| nearest[a].total_cmp(&nearest[b]).then(b.cmp(&a)));
        let Some(i) = next else { break };
        chosen.push(i);
        near(&mut nearest, i);
    }
    chosen.sort_unstable();
    chosen.into_iter().map(|i| pairs[i].clone()).collect()
}
