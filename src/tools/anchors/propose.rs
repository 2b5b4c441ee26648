//! Proposals: vertices that are the same where connectivities agree; else the map by the pairs
//! there are, registered by relief in both directions, and a choice of places where that is
//! reliable.

use glam::DVec3;
use rayon::prelude::*;

use super::connectivity::{contradicting, same_vertices};
use super::outliers::outliers;
use super::register::{Hold, Registration, mismatch_of, register};
use super::side::Side;
use super::{AnchorOptions, Origin, Proposal, Proposed};
use crate::control;
use crate::error::Result;
use crate::geometry::{Geodesics, March, NONE, SurfacePoint};
use crate::progress::Progress;
use crate::surface::AnchorPairs;
use crate::surface::correspondence::{CorrespondenceOptions, Method, Shape, correspondence};
use crate::tools::vertex_map::vertex_map;

/// A mirror image disagrees by less than this part of what the surface as it is does.
pub(super) const MIRRORED: f64 = 0.7;
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
        let wrong = outliers(s, t, &self.anchors())?.outliers;
        let indices: Vec<usize> = wrong.iter().map(|o| o.index).filter(|i| *i >= given).collect();
        let mut k = 0;
        self.pairs.retain(|p| {
            k += 1;
            p.origin == Origin::Connectivity || !indices.contains(&(k - 1))
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
    let same = if options.connectivity { same_vertices(couple, &images) } else { vec![NONE; images.len()] };
    let known = same.iter().filter(|w| **w != NONE).count();
    let used = (0..same.len() as u32).filter(|&v| !to.topology.vertex_triangles(v).is_empty()).count();
    if given < options.count {
        let registered = (known < used).then(|| registered(couple, seeds, &images, growing.handedness, progress));
        let registered = registered.transpose()?;
        place(&mut growing, &same, registered.as_ref(), options, spacing);
        if registered.is_some() {
            growing.drop_contradicted(given)?;
        }
        progress.advance(1);
    }
    let mut pairs = growing.pairs;
    for p in pairs.iter_mut().skip(given).filter(|p| p.expected_error > DOUBTFUL) {
        p.flagged = Some(format!("may be off by {:.3} of the square root of the area", p.expected_error));
    }
    let mut notes = Vec::new();
    if known > 0 {
        let what = if known < used { format!("{known} of {used} vertices") } else { "all vertices".to_owned() };
        notes.push(format!("both meshes have the same connectivity at {what}: pairs there are exact (--ignore-connectivity goes by the shape alone)"));
        for (i, off) in contradicting(couple, seeds, &same) {
            let text =
                format!("lies {off:.3} of the square root of the area from where the common connectivity puts it");
            notes.push(format!("pair {i} {text}"));
            pairs[i].flagged = Some(text);
        }
    }
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

/// The images on the source by registration from `images`, and what speaks for them.
fn registered(
    couple: &Couple<'_>,
    seeds: &AnchorPairs,
    images: &[Option<SurfacePoint>],
    handedness: f64,
    progress: &dyn Progress,
) -> Result<(Registration, Reliability)> {
    let here = control::current();
    let one = |to: usize, start: &[Option<SurfacePoint>]| {
        let (a, b) = (&couple.sides[to], &couple.sides[1 - to]);
        let found = here.within(|| register(a, b, start, &couple.holds(seeds, to), handedness));
        progress.advance(1);
        found
    };
    let there = one(0, images)?;
    let back = one(1, &couple.images(seeds, 1)?)?;
    let reliable = Reliability::new(couple, &there, &back);
    Ok((there, reliable))
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
    fn new(couple: &Couple<'_>, there: &Registration, back: &Registration) -> Self {
        let [source, target] = &couple.sides;
        let n = target.positions.len();
        let places: Vec<DVec3> = (0..n)
            .into_par_iter()
            .map(|v| {
                let Some(p) = &there.images[v] else { return DVec3::INFINITY };
                let corners = source.topology.triangles[p.face as usize];
                let mut place = DVec3::ZERO;
                for k in 0..3 {
                    let Some(q) = &back.images[corners[k] as usize] else { return DVec3::INFINITY };
                    place += p.barycentric[k] * target.position(q);
                }
                place
            })
            .collect();
        let cycle = places.iter().zip(&target.positions).map(|(b, p)| b.distance(*p)).collect();
        let sigma = (0..n).map(|v| (there.mismatch[v] / (there.hold[v] + 1e-9)).sqrt()).collect();
        Self { cycle, back: places, sigma }
    }
}

/// Adds pairs far from all others where vertices are known to be the same or the registration is
/// reliable.
fn place(
    growing: &mut Growing<'_, '_>,
    same: &[u32],
    registered: Option<&(Registration, Reliability)>,
    options: &AnchorOptions,
    spacing: f64,
) {
    let [source, target] = &growing.couple.sides;
    let geodesics = Geodesics::of(&target.positions, &target.triangles);
    let mut march = March::default();
    geodesics.clear(&mut march);
    let corner = |p: &SurfacePoint| target.topology.triangles[p.face as usize][p.dominant_corner()];
    for p in &growing.pairs {
        geodesics.add_source(corner(&p.target), &mut march);
    }
    let exact = |v: usize| if same[v] == NONE { None } else { source.topology.vertex_point(same[v]) };
    let by_relief = |v: usize| -> Option<Proposed> {
        let (registration, reliable) = registered?;
        let good = reliable.sigma[v] <= SIGMA && reliable.cycle[v] <= CYCLE;
        // The two registrations err in different directions: their mean goes half as far as coming
        // back does.
        let between = 0.5 * (target.positions[v] + reliable.back[v]);
        Some(Proposed {
            source: registration.images[v].filter(|_| good)?,
            target: target.closest_near(between, target.topology.vertex_point(v as u32)?),
            origin: Origin::Relief,
            expected_error: (0.5 * reliable.sigma[v]).max(2.0 * reliable.cycle[v]),
            flagged: None,
        })
    };
    let at = |v: usize| -> Option<Proposed> {
        let Some(source) = exact(v) else { return by_relief(v) };
        let target = target.topology.vertex_point(v as u32)?;
        Some(Proposed { source, target, origin: Origin::Connectivity, expected_error: 0.0, flagged: None })
    };
    let possible: Vec<usize> = (0..target.positions.len()).filter(|&v| at(v).is_some()).collect();
    while growing.pairs.len() < options.count {
        let distance = |v: usize| march.distances[v];
        let farthest = possible
            .iter()
            .copied()
            .filter(|&v| distance(v).is_finite() || same[v] != NONE)
            .max_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(b.cmp(&a)));
        let Some(v) = farthest.filter(|&v| distance(v) > 0.3 * spacing) else { break };
        geodesics.add_source(v as u32, &mut march);
        growing.pairs.extend(at(v));
    }
}
