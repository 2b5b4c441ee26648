//! First pairs where none are given: tips of limbs matched by the distances between them.

use super::extremities::{Extremity, extremities};
use super::hypotheses::{Assignment, Chosen, choose};
use super::propose::Couple;
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
/// Matches that are looked at: those whose distances fit best.
const LOOKED_AT: usize = 8;
/// Of these, the ones from which others are made by one exchange.
const VARIED: usize = 1;
const GIVE_PAIRS: &str =
    "Give a few pairs with --anchors, better eight: vertex numbers or positions, as any 3D program shows them";

/// Pairs found without seeds.
#[derive(Clone, Debug)]
pub(super) struct Seedless {
    pub(super) pairs: AnchorPairs,
    /// The error to be expected of each: how far the ends of its limbs are blunt, at unit area.
    pub(super) errors: Vec<f64>,
    /// What could not be decided, in words.
    pub(super) ambiguity: Option<String>,
    /// What was found, in words.
    pub(super) note: String,
}

/// A match, and how badly distances fit.
#[derive(Clone, Debug)]
struct Match {
    partner: Assignment,
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
        if let Some(main) = side.main_component() {
            tips.retain(|t| side.topology.vertex_component[t.vertex as usize] == main);
        }
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
/// to all pairs before it. Distances between tips are coarse evidence: the best assignments, and
/// those that differ from them by one exchange or one tip less, are each made a map, which is
/// judged as a whole ([`super::hypotheses`]).
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
                GIVE_PAIRS,
            ));
        }
    }
    let assignments = hypotheses(&search(&source, &target));
    let named = |m: &Assignment| anchors(couple, &source, &target, m);
    let Some(Chosen { assignment, rival, mirrored, lost }) = choose(couple, &assignments, named)? else {
        return Err(Error::unusable(
            "no assignment of the limbs of one surface to those of the other makes a map",
            GIVE_PAIRS,
        ));
    };
    let ambiguity = match rival {
        Some(other) => Some(question(couple, &source, &target, &assignment, &other)),
        None if mirrored => Some(
            "the only assignment of the limbs that fits makes one surface the mirror image of the other: give one pair \
             of a left or right limb with --anchors"
                .to_owned(),
        ),
        None => lost.then(|| {
            "under no assignment of the limbs do the shapes agree between them: the one that strains least is taken; \
             give a few pairs with --anchors, a limb each"
                .to_owned()
        }),
    };
    let pairs = named(&assignment);
    let errors = assignment
        .iter()
        .zip(&target.tips)
        .filter_map(|(s, t)| Some(0.5 * source.tips[(*s)?].extent.max(t.extent)))
        .collect();
    let note =
        format!("{} limbs matched without seeds out of {} and {}", pairs.len(), source.tips.len(), target.tips.len());
    Ok(Seedless { pairs, errors, ambiguity, note })
}

/// What could not be decided, and the pair that would decide it.
fn question(couple: &Couple<'_>, source: &Tips, target: &Tips, taken: &Assignment, other: &Assignment) -> String {
    let place = |side: usize, v: u32| {
        let p = couple.shapes[side].mesh.positions[v as usize];
        format!("({:.4} {:.4} {:.4})", p.x, p.y, p.z)
    };
    // Tips are sorted by the length of their limbs.
    let both = taken
        .iter()
        .zip(other)
        .zip(&target.tips)
        .find_map(|((a, b), tip)| Some((tip, (*a)?, (*b)?)).filter(|x| x.1 != x.2));
    let which = both.map_or_else(String::new, |(tip, a, b)| {
        format!(
            ": is the partner of the limb that ends at {} on {} at {} or at {} on {}? Give that pair with --anchors",
            place(1, tip.vertex),
            couple.shapes[1].mesh.name,
            place(0, source.tips[a].vertex),
            place(0, source.tips[b].vertex),
            couple.shapes[0].mesh.name,
        )
    });
    format!(
        "another assignment of the limbs fits nearly as well (left and right, or front and back, may be exchanged){which}"
    )
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

/// The best matches, and what differs from the first of them by the exchange of two tips or by one
/// tip less: distances do not tell left from right, and a limb that one of the surfaces lacks
/// finds a partner all the same.
fn hypotheses(matches: &[Match]) -> Vec<Assignment> {
    let matched = |m: &Assignment| m.iter().flatten().count();
    let mut all: Vec<Assignment> = Vec::new();
    let add = |m: Assignment, all: &mut Vec<Assignment>| {
        if matched(&m) >= FEWEST && !all.contains(&m) {
            all.push(m);
        }
    };
    let usable = matches.iter().filter(|m| matched(&m.partner) >= FEWEST);
    usable.take(LOOKED_AT).for_each(|m| add(m.partner.clone(), &mut all));
    for m in all.clone().into_iter().take(VARIED) {
        for i in 0..m.len() {
            for j in (0..i).filter(|&j| m[i] != m[j]) {
                let mut other = m.clone();
                other.swap(i, j);
                add(other, &mut all);
            }
            let mut less = m.clone();
            less[i] = None;
            add(less, &mut all);
        }
    }
    all
}

fn anchors(couple: &Couple<'_>, source: &Tips, target: &Tips, m: &Assignment) -> AnchorPairs {
    let point = |side: usize, v: u32| -> Option<SurfacePoint> { couple.sides[side].topology.vertex_point(v) };
    let mut pairs = AnchorPairs::default();
    for (t, s) in m.iter().enumerate() {
        let Some(s) = s else { continue };
        if let (Some(a), Some(b)) = (point(0, source.tips[*s].vertex), point(1, target.tips[t].vertex)) {
            pairs.source.push(a);
            pairs.target.push(b);
        }
    }
    pairs
}
