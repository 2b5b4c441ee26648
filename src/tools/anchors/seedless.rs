//! First pairs where none are given: tips of limbs matched by the distances between them.

use glam::DVec3;

use super::extremities::{Extremity, extremities};
use super::propose::Couple;
use super::register::mismatch_of;
use crate::control;
use crate::error::{Error, Result};
use crate::geometry::{Geodesics, SurfacePoint};
use crate::surface::AnchorPairs;

/// Tips that are matched: the longest limbs, which both surfaces have.
const LIMBS: usize = 8;
/// A limb is a tip at least this long over the square root of the area.
const LIMB: f64 = 0.1;
/// Fewest tips that say anything.
const FEWEST: usize = 4;
/// Partial matches kept at each step of the search.
const BEAM: usize = 400;
/// Cost of a tip without a partner.
const ALONE: f64 = 0.6;
/// Complete matches that are tried as maps: those whose distances fit as well as the best, up to
/// this much.
const TRIED: usize = 8;
const AS_WELL: f64 = 0.35;
/// Two maps whose relief disagrees by less than this part cannot be told apart by it.
const ALIKE: f64 = 0.15;

/// Pairs found without seeds.
#[derive(Clone, Debug)]
pub(super) struct Seedless {
    pub(super) pairs: AnchorPairs,
    /// What could not be decided, in words.
    pub(super) ambiguity: Option<String>,
    /// What was found, in words.
    pub(super) note: String,
}

/// A match: for each tip of the target the tip of the source or none.
#[derive(Clone, Debug)]
struct Match {
    partner: Vec<Option<usize>>,
    cost: f64,
}

/// Tips and distances between them.
struct Tips {
    tips: Vec<Extremity>,
    distance: Vec<f64>,
}

impl Tips {
    fn new(couple: &Couple<'_>, side: usize) -> Result<Self> {
        let side = &couple.sides[side];
        let geodesics = Geodesics::of(&side.positions, &side.triangles);
        let mut tips = extremities(side, &geodesics);
        tips.retain(|t| t.height >= LIMB);
        tips.truncate(LIMBS);
        let vertices: Vec<u32> = tips.iter().map(|t| t.vertex).collect();
        let here = control::current();
        let distance = geodesics.matrix(&vertices, || here.check())?;
        Ok(Self { tips, distance })
    }

    fn between(&self, i: usize, j: usize) -> f64 {
        let n = self.tips.len();
        0.5 * (self.distance[i * n + j] + self.distance[j * n + i])
    }
}

/// Matches the tips of two surfaces.
///
/// Assignments are searched by beam: a pair of tips costs the relative difference of its distances
/// to all pairs before it. Distances along the surface do not tell left from right; the few
/// assignments that fit as well as the best are each made a map, and that whose relief agrees best
/// over the whole surface is taken: a mirrored map shows bumps where there are dents.
///
/// # Errors
/// [`Error::Unusable`] if either surface has fewer than four limbs, or no assignment fits.
pub(super) fn match_tips(couple: &Couple<'_>) -> Result<Seedless> {
    let (source, target) = (Tips::new(couple, 0)?, Tips::new(couple, 1)?);
    for (tips, shape) in [(&source, couple.shapes[0]), (&target, couple.shapes[1])] {
        if tips.tips.len() < FEWEST {
            return Err(Error::unusable(
                format!(
                    "{} has {} limbs that stand out (at least {FEWEST} are needed to match two surfaces without a first pair)",
                    shape.mesh.name,
                    tips.tips.len()
                ),
                "Give a few pairs with --anchors, better eight: vertex numbers or positions, as any 3D program shows them",
            ));
        }
    }
    let mut matches = search(&source, &target);
    let best = matches.first().map_or(0.0, |m| m.cost);
    matches.retain(|m| m.cost <= best + AS_WELL && m.partner.iter().flatten().count() >= FEWEST);
    matches.truncate(TRIED);
    let mut tried = Vec::new();
    for m in &matches {
        let pairs = anchors(couple, &source, &target, m);
        let images = couple.images(&pairs, 0)?;
        let off = mismatch_of(&couple.sides[0], &couple.sides[1], &images, 1.0)?;
        tried.push((off, spatial(couple, &pairs), pairs, m));
    }
    tried.sort_by(|a, b| a.0.total_cmp(&b.0));
    let Some((off, near, pairs, chosen)) = tried.first().cloned() else {
        return Err(Error::unusable(
            "no assignment of the limbs of one surface to those of the other keeps the distances between them",
            "Give a few pairs with --anchors, better eight: vertex numbers or positions, as any 3D program shows them",
        ));
    };
    let rivals: Vec<_> = tried[1..].iter().filter(|t| t.0 <= off * (1.0 + ALIKE)).collect();
    // Where the relief cannot tell, the poses decide.
    let mut result = (off, near, pairs, chosen);
    let mut ambiguity = None;
    if !rivals.is_empty() {
        if let Some(r) = rivals.iter().min_by(|a, b| a.1.total_cmp(&b.1)).filter(|r| r.1 < near) {
            result = (r.0, r.1, r.2.clone(), r.3);
        }
        ambiguity = Some(format!(
            "{} assignments of the limbs fit nearly as well (left and right, or front and back, may be exchanged); the one nearest in space was taken: look at the pairs",
            rivals.len() + 1
        ));
    }
    let note = format!(
        "{} limbs matched without seeds out of {} and {}",
        result.2.len(),
        source.tips.len(),
        target.tips.len()
    );
    Ok(Seedless { pairs: result.2, ambiguity, note })
}

fn search(source: &Tips, target: &Tips) -> Vec<Match> {
    let mut beam = vec![Match { partner: Vec::new(), cost: 0.0 }];
    for t in 0..target.tips.len() {
        let mut next = Vec::new();
        for m in &beam {
            let mut alone = m.clone();
            alone.partner.push(None);
            alone.cost += ALONE;
            next.push(alone);
            for s in 0..source.tips.len() {
                if m.partner.contains(&Some(s)) {
                    continue;
                }
                let mut cost = 0.0;
                let mut known = 0;
                for (u, p) in m.partner.iter().enumerate() {
                    let Some(p) = p else { continue };
                    let (a, b) = (source.between(s, *p), target.between(t, u));
                    if a.is_finite() != b.is_finite() {
                        cost += 1.0;
                    } else if a.is_finite() {
                        cost += (a / b).ln().abs();
                    }
                    known += 1;
                }
                let limbs = (source.tips[s].height / target.tips[t].height).ln().abs();
                let mut with = m.clone();
                with.partner.push(Some(s));
                with.cost += cost / f64::from(known.max(1)) + 0.25 * limbs;
                next.push(with);
            }
        }
        next.sort_by(|a, b| a.cost.total_cmp(&b.cost).then_with(|| a.partner.cmp(&b.partner)));
        next.truncate(BEAM);
        beam = next;
    }
    beam
}

fn anchors(couple: &Couple<'_>, source: &Tips, target: &Tips, m: &Match) -> AnchorPairs {
    let point = |side: usize, v: u32| -> Option<SurfacePoint> { couple.sides[side].topology.vertex_point(v) };
    let mut pairs = AnchorPairs::default();
    for (t, s) in m.partner.iter().enumerate() {
        let Some(s) = s else { continue };
        if let (Some(a), Some(b)) = (point(0, source.tips[*s].vertex), point(1, target.tips[t].vertex)) {
            pairs.source.push(a);
            pairs.target.push(b);
        }
    }
    pairs
}

/// How far the pairs are apart in space as the files have them, both centred: people pose their
/// models alike.
fn spatial(couple: &Couple<'_>, pairs: &AnchorPairs) -> f64 {
    let at = |side: usize, points: &[SurfacePoint]| -> Vec<DVec3> {
        let x: Vec<DVec3> = points.iter().map(|p| couple.sides[side].position(p)).collect();
        let mean = x.iter().sum::<DVec3>() / x.len().max(1) as f64;
        x.into_iter().map(|p| p - mean).collect()
    };
    at(0, &pairs.source).iter().zip(at(1, &pairs.target)).map(|(a, b)| a.distance_squared(b)).sum()
}
