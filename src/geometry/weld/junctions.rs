//! T-junctions: an open edge on one side of a crack, and several shorter ones, end to end, on the
//! other.

use std::collections::HashMap;

use glam::DVec3;

use super::sides::Side;

/// A corner lies on an edge within this part of its length; files round corners to six digits or
/// so.
const ON_EDGE: f64 = 1e-5;
/// More open edges than this that begin at one place are not looked through.
const CROWD: usize = 64;

/// How many of the sides `alone` run along several others in the opposite direction. O(n) for any
/// valence.
pub(super) fn count(sides: &[Side], alone: &[u32], place: &[u32], positions: &[DVec3]) -> usize {
    let mut beginning: HashMap<u32, Vec<u32>> = HashMap::new();
    for &s in alone {
        beginning.entry(place[sides[s as usize].from as usize]).or_default().push(s);
    }
    let runs_along_others = |&&s: &&u32| {
        let side = sides[s as usize];
        let (start, end) = (positions[side.to as usize], positions[side.from as usize]);
        let (way, goal) = (end - start, place[side.from as usize]);
        let along = |p: DVec3| (p - start).dot(way) / way.length_squared();
        let (mut here, mut reached, mut pieces) = (place[side.to as usize], 0.0, 0);
        while here != goal {
            let candidates = beginning.get(&here).map_or(&[][..], Vec::as_slice);
            let next = candidates.iter().take(CROWD).find_map(|&c| {
                let other = sides[c as usize];
                let p = positions[other.to as usize];
                let t = along(p);
                let near = (p - start - t * way).length() <= ON_EDGE * way.length();
                (near && t > reached && t <= 1.0 + ON_EDGE).then_some((place[other.to as usize], t))
            });
            let Some((there, t)) = next else { return false };
            (here, reached, pieces) = (there, t, pieces + 1);
        }
        pieces > 1
    };
    alone.iter().filter(runs_along_others).count()
}
