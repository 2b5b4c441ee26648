//! Which of several assignments of limbs is right, judged by the map that each makes.
//!
//! Distances between tips are a few numbers; a map is thousands. A wrong assignment stretches and
//! folds the surface somewhere, in one direction or in both, so that its strain is larger. Where a
//! shape is its own mirror image, the mirrored assignment may strain less, but then the relief
//! agrees with that of a mirror image only: bumps lie where there are dents. Where neither tells,
//! poses do: people make their models stand alike.

use glam::DVec3;

use super::propose::{Couple, MIRRORED, swapped};
use super::register::mismatch_of;
use crate::error::Result;
use crate::geometry::SurfacePoint;
use crate::surface::AnchorPairs;
use crate::surface::correspondence::{CorrespondenceOptions, Method, correspondence};
use crate::surface::field::strain_of;
use crate::tools::vertex_map::vertex_map;

/// For each tip of the target a tip of the source, or none.
pub(super) type Assignment = Vec<Option<usize>>;

/// Assignments whose maps are relaxed: those that strain least without.
const RELAXED: usize = 6;
/// The strain of another one is more by this part, or it may be the right one.
const CLEAR: f64 = 0.25;
/// The relief of another one disagrees by more than so many times, or it may be the right one.
const BUMPS: f64 = 1.3;

/// Relief that disagrees by more says nothing for a map: that of two surfaces without anything in
/// common disagrees by about 2, of right maps between people or animals by 0.2 to 0.9.
const LOST: f64 = 1.2;

/// What speaks for an assignment; less is better.
#[derive(Clone, Copy, Debug)]
struct Evidence {
    /// Strain of the maps in both directions.
    strain: f64,
    /// Disagreement of the relief.
    relief: f64,
    /// Whether that of a mirror image is far less.
    mirrored: bool,
    /// How far pairs are apart in space.
    apart: f64,
}

/// The assignment that was chosen.
pub(super) struct Chosen {
    pub(super) assignment: Assignment,
    /// One that may be right as well.
    pub(super) rival: Option<Assignment>,
    /// Whether its map turns the surface into its mirror image.
    pub(super) mirrored: bool,
    /// Whether the relief says nothing for it.
    pub(super) lost: bool,
}

/// The assignment whose map is the best, and the next one where that is not clear; none where no
/// assignment makes a map. Two fields an assignment, relaxed for the best six.
///
/// # Errors
/// As [`correspondence`], for other reasons than pairs.
pub(super) fn choose(
    couple: &Couple<'_>,
    assignments: &[Assignment],
    named: impl Fn(&Assignment) -> AnchorPairs,
) -> Result<Option<Chosen>> {
    let mut quick = Vec::new();
    for m in assignments {
        let (there, back) = (strained(couple, &named(m), 0, false)?.0, strained(couple, &named(m), 1, false)?.0);
        quick.push((there + back, m));
    }
    quick.sort_by(|a, b| a.0.total_cmp(&b.0));
    // What is a part of another one that strains less says the same with less.
    let mut tried: Vec<&Assignment> = Vec::new();
    for (_, m) in quick {
        if tried.len() < RELAXED && !tried.iter().any(|other| is_part(m, other)) {
            tried.push(m);
        }
    }
    let mut judged = Vec::new();
    for m in tried {
        let pairs = named(m);
        let (there, images) = strained(couple, &pairs, 0, true)?;
        let back = strained(couple, &pairs, 1, true)?.0;
        let relief = [1.0, -1.0].map(|handedness| mismatch_of(&couple.sides[0], &couple.sides[1], &images, handedness));
        let [relief, mirrored] = relief;
        let (relief, mirrored) = (relief?, mirrored?);
        let evidence = Evidence {
            strain: there + back,
            relief,
            mirrored: mirrored < MIRRORED * relief,
            apart: apart(couple, &pairs),
        };
        judged.push((evidence, m));
    }
    // Shapes are rarely mirror images of one another: such a map is taken where there is no other.
    if judged.iter().any(|(e, _)| !e.mirrored) {
        judged.retain(|(e, _)| !e.mirrored);
    }
    let Some(least) = judged.iter().map(|(e, _)| e.strain).min_by(f64::total_cmp) else { return Ok(None) };
    let mut close: Vec<&(Evidence, &Assignment)> =
        judged.iter().filter(|(e, _)| e.strain <= least * (1.0 + CLEAR)).collect();
    close.sort_by(|a, b| a.0.relief.total_cmp(&b.0.relief));
    let first = close[0];
    let rivals = close[1..].iter().filter(|c| c.0.relief < BUMPS * first.0.relief && !agree(c.1, first.1));
    let rivals: Vec<_> = rivals.copied().collect();
    let nearest = rivals.iter().copied().chain([first]).min_by(|a, b| a.0.apart.total_cmp(&b.0.apart)).unwrap_or(first);
    let rival = rivals.into_iter().chain([first]).find(|r| !agree(r.1, nearest.1));
    Ok(Some(Chosen {
        assignment: nearest.1.clone(),
        rival: rival.map(|r| r.1.clone()),
        mirrored: nearest.0.mirrored,
        lost: nearest.0.relief > LOST,
    }))
}

/// Whether all that an assignment says another one says too.
fn is_part(a: &Assignment, of: &Assignment) -> bool {
    a.iter().zip(of).all(|(a, of)| a.is_none() || a == of)
}

/// Whether no tip has different partners in two assignments.
fn agree(a: &Assignment, b: &Assignment) -> bool {
    a.iter().zip(b).all(|(a, b)| a.is_none() || b.is_none() || a == b)
}

/// Strain of the map to surface `to` (0 the source, 1 the target), and the images of the other
/// one's vertices.
fn strained(
    couple: &Couple<'_>,
    pairs: &AnchorPairs,
    to: usize,
    relax: bool,
) -> Result<(f64, Vec<Option<SurfacePoint>>)> {
    let options = CorrespondenceOptions {
        method: Method::Field,
        confidence: false,
        relax: Some(relax),
        ..CorrespondenceOptions::default()
    };
    let (a, b) = (couple.shapes[to], couple.shapes[1 - to]);
    let pairs = if to == 0 { pairs.clone() } else { swapped(pairs) };
    let map = correspondence(a, b, &pairs, &options)?;
    let found = vertex_map((a.mesh, a.topology), (b.mesh, b.topology), map.as_ref())?;
    let images: Vec<Option<SurfacePoint>> = found.images.iter().map(|i| i.point()).collect();
    let (from, on) = (&couple.sides[1 - to], &couple.sides[to]);
    let corner = |v: u32| from.positions[v as usize];
    let image = |v: u32| images[v as usize].map(|p| on.position(&p));
    Ok((strain_of(from.triangles.iter().copied(), corner, image), images))
}

/// How far the pairs are apart in space as the files have them, both centred.
fn apart(couple: &Couple<'_>, pairs: &AnchorPairs) -> f64 {
    let at = |side: usize, points: &[SurfacePoint]| -> Vec<DVec3> {
        let x: Vec<DVec3> = points.iter().map(|p| couple.sides[side].position(p)).collect();
        let mean = x.iter().sum::<DVec3>() / x.len().max(1) as f64;
        x.into_iter().map(|p| p - mean).collect()
    };
    let squares: f64 = at(0, &pairs.source).iter().zip(at(1, &pairs.target)).map(|(a, b)| a.distance_squared(b)).sum();
    (squares / pairs.len().max(1) as f64).sqrt()
}
