//! Meshes of the same connectivity, a character and its posed or sculpted copy: there the vertices
//! themselves say what corresponds.
//!
//! Programs renumber vertices and triangles when they write a file, so nothing is taken from
//! numbers: each component is walked over triangle by triangle (`geometry::isomorphism`). A
//! symmetric mesh can be laid upon itself in several ways; the one nearest to the map by the given
//! pairs is meant, if that can tell.

use std::collections::HashMap;

use glam::DVec3;

use super::propose::Couple;
use crate::geometry::isomorphism::{Dart, Walker, colours};
use crate::geometry::{NONE, SurfacePoint, Topology};
use crate::surface::AnchorPairs;

/// A way of laying a component upon another must be as near to the map by the given pairs, in the
/// median over the area, over the square root of the area.
const NEAR: f64 = 0.05;
/// The next best way must be farther than this many times the best one.
const CLEARER: f64 = 2.0;
/// A given pair that is farther off than this is not meant there, over the square root of the area.
const ELSEWHERE: f64 = 0.03;
/// Crumbs of more components than this are not compared: each looks at all others.
const MOST_COMPONENTS: usize = 1000;
/// Vertices of the source that are tried as the image of the first one, the nearest to where the
/// map sends it.
const STARTS: usize = 16;

/// For each vertex of the target the vertex of the source it is, or [`NONE`] where the
/// connectivities differ or do not tell. O(F log F) and, for each component, a look at all vertices
/// of one colour and at most `2 STARTS` walks for each triangle around a vertex.
pub(super) fn same_vertices(couple: &Couple<'_>, images: &[Option<SurfacePoint>]) -> Vec<u32> {
    let [source, target] = &couple.sides;
    let (from, to) = (target.topology, source.topology);
    let places: Vec<Option<DVec3>> = images.iter().map(|p| p.as_ref().map(|p| source.position(p))).collect();
    let (own, others) = (colours(from), colours(to));
    let mut by_colour: HashMap<u64, Vec<u32>> = HashMap::new();
    for (v, c) in others.iter().enumerate().filter(|(_, c)| **c != 0) {
        by_colour.entry(*c).or_default().push(v as u32);
    }
    let (sizes, other_sizes) = (sizes(from), sizes(to));
    let mut walker = Walker::new(from, to);
    let mut used = vec![false; other_sizes.len()];
    let mut same = vec![NONE; own.len()];
    if sizes.len() > MOST_COMPONENTS {
        return same;
    }
    for (component, first) in rarest(from, &own).into_iter().enumerate() {
        let Some(place) = places[first as usize] else { continue };
        let component_of = |w: u32| to.vertex_component[w as usize] as usize;
        let mut starts: Vec<u32> = by_colour.get(&own[first as usize]).cloned().unwrap_or_default();
        starts.retain(|&w| !used[component_of(w)] && other_sizes[component_of(w)] == sizes[component]);
        let apart = |w: u32| source.positions[w as usize].distance_squared(place);
        let nearer = |x: &u32, y: &u32| apart(*x).total_cmp(&apart(*y)).then(x.cmp(y));
        if starts.len() > STARTS {
            starts.select_nth_unstable_by(STARTS, nearer);
            starts.truncate(STARTS);
        }
        starts.sort_by(nearer);
        let (mut best, mut next) = ((f64::INFINITY, Vec::new()), f64::INFINITY);
        for (a, b) in
            starts.iter().flat_map(|&w| darts(from, first).take(1).flat_map(move |a| darts(to, w).map(move |b| (a, b))))
        {
            for mirrored in [false, true] {
                let Some(pairs) = walker.walk(a, b, mirrored).filter(|p| p.len() == sizes[component].0) else {
                    continue;
                };
                let off = off(&pairs, &places, couple);
                if off < best.0 {
                    next = best.0;
                    best = (off, pairs);
                } else {
                    next = next.min(off);
                }
            }
        }
        let (off, pairs) = best;
        if pairs.is_empty() || off > NEAR || next <= CLEARER * off {
            continue;
        }
        used[component_of(pairs[0].1)] = true;
        pairs.iter().for_each(|&(v, w)| same[v as usize] = w);
    }
    same
}

/// Vertices and triangles of each component.
fn sizes(topology: &Topology) -> Vec<(usize, usize)> {
    let mut sizes = vec![(0, 0); topology.component_count as usize];
    topology.vertex_component.iter().filter(|c| **c != NONE).for_each(|&c| sizes[c as usize].0 += 1);
    let triangles = (0..topology.triangles.len() as u32).map(|t| topology.triangle_component(t));
    triangles.filter(|c| *c != NONE).for_each(|c| sizes[c as usize].1 += 1);
    sizes
}

/// For each component a vertex whose colour fewest share.
fn rarest(topology: &Topology, colours: &[u64]) -> Vec<u32> {
    let mut share: HashMap<(u32, u64), usize> = HashMap::new();
    for key in topology.vertex_component.iter().zip(colours).filter(|(c, _)| **c != NONE) {
        *share.entry((*key.0, *key.1)).or_default() += 1;
    }
    let mut best = vec![(usize::MAX, NONE); topology.component_count as usize];
    for (v, (&c, &colour)) in topology.vertex_component.iter().zip(colours).enumerate().filter(|(_, k)| *k.0 != NONE) {
        best[c as usize] = best[c as usize].min((share[&(c, colour)], v as u32));
    }
    best.into_iter().map(|b| b.1).collect()
}

/// The corners at a vertex.
fn darts(topology: &Topology, v: u32) -> impl Iterator<Item = Dart> {
    let around = topology.vertex_triangles(v).iter();
    around.filter_map(move |&triangle| Some(Dart { triangle, corner: topology.corner_of(triangle, v)? }))
}

/// How far a way of laying the target upon the source is from the map: the median over the area,
/// since one wrong pair spoils the map of a limb.
fn off(pairs: &[(u32, u32)], places: &[Option<DVec3>], couple: &Couple<'_>) -> f64 {
    let [source, target] = &couple.sides;
    let apart = |&(v, w): &(u32, u32)| {
        let off = places[v as usize].map_or(1.0, |p| p.distance(source.positions[w as usize]));
        (off, target.laplacian.mass[v as usize])
    };
    let mut all: Vec<(f64, f64)> = pairs.iter().map(apart).collect();
    all.sort_by(|x, y| x.0.total_cmp(&y.0));
    let mut left = 0.5 * all.iter().map(|a| a.1).sum::<f64>();
    for (off, mass) in all {
        left -= mass;
        if left <= 0.0 {
            return off;
        }
    }
    1.0
}

/// The pairs that lie elsewhere than the vertices around them say, with how far off they are.
pub(super) fn contradicting(couple: &Couple<'_>, pairs: &AnchorPairs, same: &[u32]) -> Vec<(usize, f64)> {
    let [source, target] = &couple.sides;
    let off = |i: usize| {
        let p = &pairs.target[i];
        let corners = target.topology.triangles[p.face as usize].map(|v| same[v as usize]);
        if corners.contains(&NONE) {
            return None;
        }
        let place: DVec3 = (0..3).map(|k| p.barycentric[k] * source.positions[corners[k] as usize]).sum();
        Some((i, place.distance(source.position(&pairs.source[i]))))
    };
    (0..pairs.len()).filter_map(off).filter(|o| o.1 > ELSEWHERE).collect()
}
