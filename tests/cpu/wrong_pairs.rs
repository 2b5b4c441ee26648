//! Pairs that are wrong, exchanged or not exact: what the method `field` makes of them, on shapes
//! made here, whose truth is known.

use barymap::geometry::{Geodesics, March, Mesh, SurfacePoint};
use barymap::models::shapes::{Random, lobed_sphere};
use barymap::surface::correspondence::{CorrespondenceOptions, Precision, correspondence};
use barymap::surface::field::Contradicted;
use barymap::surface::{AnchorPairs, EmbeddingOptions};
use barymap::tools::vertex_map::vertex_map;
use glam::DVec3;

use crate::embedded::Embedded;

const ANCHORS: usize = 20;

fn embedded(mesh: Mesh) -> Embedded {
    Embedded::new(mesh, &EmbeddingOptions { landmarks: 400, ..EmbeddingOptions::default() })
}

/// The vertex nearest to a distance from another, along the surface, over the square root of the
/// area.
fn at_distance(side: &Embedded, from: u32, distance: f64) -> u32 {
    let mut march = March::default();
    let geodesics = Geodesics::new(&side.mesh.positions, &side.mesh.triangles()).unwrap();
    geodesics.distances_from(from, &mut march);
    let unit = side.mesh.area().sqrt();
    let miss = |v: &u32| (march.distances[*v as usize] / unit - distance).abs();
    (0..side.mesh.vertex_count() as u32).min_by(|a, b| miss(a).total_cmp(&miss(b))).unwrap()
}

/// A lumpy body, and the same bent.
struct Pair {
    source: Embedded,
    target: Embedded,
    vertices: Vec<u32>,
}

impl Pair {
    /// The body has a length of 6; it is bent to a circle of this radius.
    fn new(radius: f64) -> Self {
        let mut straight = lobed_sphere(4, 0.25);
        straight.positions.iter_mut().for_each(|p| p.x *= 3.0);
        let mut bent = straight.clone();
        for p in &mut bent.positions {
            let (sin, cos) = (p.x / radius).sin_cos();
            *p = DVec3::new((radius + p.y) * sin, (radius + p.y) * cos, p.z);
        }
        let target = embedded(bent);
        let vertices = target.spread(ANCHORS);
        Self { source: embedded(straight), target, vertices }
    }

    fn exact(&self) -> AnchorPairs {
        let points = |s: &Embedded| self.vertices.iter().map(|&v| s.point(v)).collect();
        AnchorPairs { source: points(&self.source), target: points(&self.target) }
    }

    /// The mean error over the square root of the area, and what was left out.
    fn map(&self, anchors: &AnchorPairs, options: &CorrespondenceOptions) -> (f64, Vec<Contradicted>) {
        let (s, t) = (&self.source, &self.target);
        let map = correspondence(s.shape(), t.shape(), anchors, options).unwrap();
        let found = vertex_map((&s.mesh, &s.topology), (&t.mesh, &t.topology), map.as_ref()).unwrap();
        let unit = s.mesh.area().sqrt();
        let places = found.positions.iter().zip(&s.mesh.positions);
        let sum: f64 = places.map(|(p, truth)| p.map_or(1.0, |p| p.distance(*truth) / unit)).sum();
        (sum / s.mesh.vertex_count() as f64, map.field().map_or(Vec::new(), |f| f.contradicted.clone()))
    }
}

fn default() -> CorrespondenceOptions {
    CorrespondenceOptions::default()
}

fn keeping() -> CorrespondenceOptions {
    CorrespondenceOptions { keep_all: true, ..default() }
}

fn without(anchors: &AnchorPairs, wrong: &[usize]) -> AnchorPairs {
    let kept = |points: &[SurfacePoint]| (0..points.len()).filter(|i| !wrong.contains(i)).map(|i| points[i]).collect();
    AnchorPairs { source: kept(&anchors.source), target: kept(&anchors.target) }
}

fn indices(found: &[Contradicted]) -> Vec<usize> {
    found.iter().map(|c| c.index).collect()
}

#[test]
fn a_pair_that_is_far_off_is_left_out_and_named_and_exact_pairs_are_not() {
    let pair = Pair::new(4.0);
    let exact = pair.exact();
    let (right, none) = pair.map(&exact, &default());
    assert!(none.is_empty(), "{none:?}");
    assert_eq!(pair.map(&exact, &keeping()).0, right, "nothing else changes");
    for (i, by) in [(3, 0.2), (15, 0.6)] {
        let mut anchors = exact.clone();
        anchors.source[i] = pair.source.point(at_distance(&pair.source, pair.vertices[i], by));
        let (found, named) = pair.map(&anchors, &default());
        assert_eq!(indices(&named), [i], "pair {i} by {by}");
        assert!((named[0].off - by).abs() < 0.4 * by && named[0].exchanged_with.is_none(), "{named:?}");
        let (ideal, _) = pair.map(&without(&anchors, &[i]), &keeping());
        assert_eq!(found, ideal);
        let (kept, all) = pair.map(&anchors, &keeping());
        assert!(kept > 1.15 * ideal && all.is_empty(), "pair {i}: {kept} {ideal}");
        // Every precision leaves out the same.
        let double = CorrespondenceOptions { precision: Precision::Double, ..default() };
        assert_eq!(pair.map(&anchors, &double).1, named);
    }
}

#[test]
fn two_exchanged_pairs_name_each_other() {
    let pair = Pair::new(4.0);
    for (i, j) in [(2, 5), (7, 12)] {
        let mut anchors = pair.exact();
        anchors.source.swap(i, j);
        let (found, named) = pair.map(&anchors, &default());
        assert_eq!(indices(&named), [i, j]);
        assert_eq!([named[0].exchanged_with, named[1].exchanged_with], [Some(j), Some(i)]);
        let (ideal, _) = pair.map(&without(&anchors, &[i, j]), &keeping());
        assert_eq!(found, ideal);
    }
}

#[test]
fn pairs_set_by_eye_are_moved_towards_what_the_others_say() {
    let pair = Pair::new(40.0);
    let exact = pair.exact();
    let (right, _) = pair.map(&exact, &default());
    let noise = 0.02;
    let mut random = Random::new(3);
    let (mut held, mut told) = (0.0, 0.0);
    for _ in 0..3 {
        let mut anchors = exact.clone();
        for (at, &v) in anchors.source.iter_mut().zip(&pair.vertices) {
            // Some vertex of those about so far away.
            let near = at_distance(&pair.source, v, noise * (0.5 + random.unit()));
            *at = pair.source.point(near);
        }
        held += pair.map(&anchors, &keeping()).0;
        told += pair.map(&anchors, &CorrespondenceOptions { anchor_error: noise, ..default() }).0;
    }
    assert!(told < 0.9 * held && held > 3.0 * right, "told {told}, held {held}, exact {right}");
    // Exact pairs are harmed by less than the tolerance that was told.
    let (moved, _) = pair.map(&exact, &CorrespondenceOptions { anchor_error: 0.005, ..default() });
    assert!(moved < right + 0.005, "{moved} {right}");
}

#[test]
fn few_pairs_are_all_kept() {
    let pair = Pair::new(4.0);
    let exact = pair.exact();
    let mut few = without(&exact, &(8..ANCHORS).collect::<Vec<_>>());
    few.source[2] = pair.source.point(at_distance(&pair.source, pair.vertices[2], 0.4));
    assert!(pair.map(&few, &default()).1.is_empty());
}

#[test]
fn a_pair_that_pulls_the_texture_of_one_mesh_is_kept() {
    let mut pair = Pair::new(4.0);
    pair.target = embedded(pair.source.mesh.clone());
    let mut anchors = pair.exact();
    anchors.source[3] = pair.source.point(at_distance(&pair.source, pair.vertices[3], 0.2));
    let (pulled, named) = pair.map(&anchors, &default());
    assert!(named.is_empty(), "{named:?}");
    assert_eq!(pulled, pair.map(&anchors, &keeping()).0);
    assert!(pulled > 10.0 * pair.map(&pair.exact(), &default()).0, "{pulled}");
}
