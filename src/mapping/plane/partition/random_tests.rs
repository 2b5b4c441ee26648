//! Random pairs of polygons: nearly all must end without a fold.

use super::super::random_polygons::{Kind, cage, cage_with_holes};
use super::super::testing::Random;
use super::*;
use crate::progress::Quiet;

const KINDS: [Kind; 3] = [Kind::Star, Kind::Tour, Kind::Growth];

/// How many of `cages` end in a partition that does not fold; every other one says why.
fn bijective(cages: impl Iterator<Item = Cage>) -> usize {
    // Vertices and edges, where the minimum nearly always is, do not depend on the resolution.
    let options = PartitionOptions { samples: SampleOptions { resolution: 8 }, ..PartitionOptions::default() };
    let good = |cage: &Cage| match partition(&Engine::reference(), cage, &options, &Quiet) {
        Ok(found) if !found.folds => {
            assert_eq!((&found.polygons[0], found.polygons.last()), (&cage.source, Some(&cage.target)));
            true
        }
        Ok(found) => {
            assert!(found.notes.last().unwrap().contains("no path avoids folds"), "{:?}", found.notes);
            assert!(found.notes.iter().any(|note| note.contains("smallest Jacobian")), "{:?}", found.notes);
            false
        }
        Err(error) => {
            assert!(error.to_string().contains("path fails"), "{error}");
            false
        }
    };
    cages.filter(good).count()
}

/// Unrelated polygons of all kinds, of 5 to 64 vertices; more small ones than large ones, for the
/// time this takes.
fn pairs(count: usize, seed: u64) -> impl Iterator<Item = Cage> {
    let mut random = Random(seed);
    (0..count).map(move |trial| {
        let n = 5 + (random.unit().powi(2) * 60.0) as usize;
        cage(KINDS[trial % 3], KINDS[trial / 3 % 3], n, &mut random)
    })
}

fn pairs_with_holes(count: usize, seed: u64) -> impl Iterator<Item = Cage> {
    let mut random = Random(seed);
    (0..count).map(move |trial| {
        let n = 5 + (random.unit() * 30.0) as usize;
        cage_with_holes(KINDS[trial % 3], n, 1 + trial % 3, &mut random)
    })
}

#[test]
fn some_random_pairs_end_without_a_fold() {
    assert_eq!(bijective(pairs(9, 3)) + bijective(pairs_with_holes(3, 3)), 12);
}

#[test]
#[ignore = "minutes of work; run with --include-ignored"]
fn random_pairs_end_without_a_fold() {
    let found = bijective(pairs(100, 11));
    assert!(found >= 95, "{found} of 100");
}

#[test]
#[ignore = "a minute of work; run with --include-ignored"]
fn random_pairs_with_holes_end_without_a_fold() {
    let found = bijective(pairs_with_holes(20, 5));
    assert!(found >= 18, "{found} of 20");
}
