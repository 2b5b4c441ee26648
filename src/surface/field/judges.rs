//! The anchors that judge predictions: those that lie apart.
//!
//! Anchors are often set in clusters, a face full of them and few on the back. Left out of a
//! cluster an anchor is found again by its neighbours whatever the prediction, and so many easy
//! votes would choose predictions for a surface that is mostly far from any anchor.

use super::predict::Known;
use crate::surface::vector::distance_squared;

/// Anchors that cover a surface of unit area evenly, `k` of them, lie about `1 / sqrt k` apart; one
/// that is nearer than this part of it to those taken repeats them. Sets spread by farthest points
/// are taken whole.
const APART: f64 = 0.4;
/// As many judge in any case: fewer say little.
const FEWEST: usize = 8;

impl<const D: usize> Known<D> {
    /// The anchors that lie apart, where those are not all: farthest points of the embedding, until
    /// the next one repeats. O(n k).
    pub(super) fn judges(&self) -> Option<Self> {
        let n = self.a.len();
        let mut kept = Vec::new();
        let mut apart = vec![f64::INFINITY; n];
        let mut next = (n > 0).then_some(0);
        while let Some(i) = next {
            kept.push(i);
            for (d, a) in apart.iter_mut().zip(&self.a) {
                *d = d.min(distance_squared(a, &self.a[i]).sqrt());
            }
            let least = if kept.len() < FEWEST { 0.0 } else { APART / (kept.len() as f64).sqrt() };
            next = (0..n).max_by(|&x, &y| apart[x].total_cmp(&apart[y]).then(y.cmp(&x))).filter(|&x| apart[x] > least);
        }
        kept.sort_unstable();
        (kept.len() < n).then(|| self.of(&kept))
    }

    /// These anchors alone.
    fn of(&self, kept: &[usize]) -> Self {
        fn take<T: Copy>(x: &[T], kept: &[usize]) -> Vec<T> {
            kept.iter().map(|&i| x[i]).collect()
        }
        Self {
            places: take(&self.places, kept),
            a: take(&self.a, kept),
            b: take(&self.b, kept),
            s: take(&self.s, kept),
            t: take(&self.t, kept),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn known(points: &[[f64; 2]]) -> Known<4> {
        let a: Vec<[f64; 4]> = points.iter().map(|p| [p[0], p[1], 0.0, 0.0]).collect();
        let s: Vec<DVec3> = points.iter().map(|p| DVec3::new(p[0], p[1], 0.0)).collect();
        Known { places: a.iter().map(|a| (*a, [[0.0; 4]; 2])).collect(), b: a.clone(), a, t: s.clone(), s }
    }

    #[test]
    fn of_a_cluster_few_judge_and_of_spread_anchors_all() {
        let grid: Vec<[f64; 2]> = (0..36).map(|i| [f64::from(i % 6) / 6.0, f64::from(i / 6) / 6.0]).collect();
        assert!(known(&grid).judges().is_none());
        // A cluster in one corner, first: one or two of it are taken.
        let mut both: Vec<[f64; 2]> = (0..40).map(|i| [0.001 * f64::from(i % 8), 0.001 * f64::from(i / 8)]).collect();
        both.extend(&grid[1..]);
        let judges = known(&both).judges().unwrap();
        let inside = judges.s.iter().filter(|p| p.x < 0.01 && p.y < 0.01).count();
        assert!(inside <= 2 && judges.s.len() - inside == 35, "{inside} {}", judges.s.len());
    }

    #[test]
    fn a_cluster_alone_is_judged_by_some_and_coinciding_anchors_by_one() {
        let cluster: Vec<[f64; 2]> = (0..20).map(|i| [1e-3 * f64::from(i), 0.0]).collect();
        assert_eq!(known(&cluster).judges().unwrap().a.len(), FEWEST);
        assert_eq!(known(&[[0.5, 0.5]; 9]).judges().unwrap().a.len(), 1);
        assert!(known(&[]).judges().is_none());
    }
}
