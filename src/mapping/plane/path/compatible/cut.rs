//! Regions between loops, cut open to discs in the same way in both drawings.

use std::collections::BTreeSet;

use glam::DVec2;

use super::triangulation::{Triangulation, undirected};

/// Two drawings of the same vertices: where the source has them, where the target has them.
pub(super) struct Drawings {
    pub(super) points: [Vec<DVec2>; 2],
    /// Edges of loops and cuts.
    pub(super) kept: BTreeSet<(usize, usize)>,
}

/// A region between loops. Its boundaries have it to their left.
pub(super) struct Region {
    /// The boundary around it.
    pub(super) outer: Vec<usize>,
    /// The boundaries within.
    pub(super) inner: Vec<Vec<usize>>,
}

impl Drawings {
    /// Adds the edges of a closed boundary.
    pub(super) fn keep_loop(&mut self, ring: &[usize]) {
        self.kept.extend((0..ring.len()).map(|i| undirected(ring[i], ring[(i + 1) % ring.len()])));
    }

    /// The boundary of the region after cuts that join its inner boundaries to the outer one: a
    /// closed word of vertices in which those of a cut appear twice. The cuts become kept edges,
    /// their inner points new vertices. `None` where rounding gets in the way.
    pub(super) fn cut_open(&mut self, region: Region) -> Option<Vec<usize>> {
        let mut word = region.outer;
        let mut inner = region.inner;
        // A vertex carries one cut of a region at most: then its place in the word says on which
        // side of it the cut leaves.
        let mut taken: BTreeSet<usize> = BTreeSet::new();
        while !inner.is_empty() {
            let (place, ring, start) = self.closest(&word, &inner, &taken)?;
            let ring = inner.swap_remove(ring);
            let (u, w) = (word[place], ring[start]);
            let after = |ring: &[usize], i: usize| ring[(i + 1) % ring.len()];
            let cut = self.cut((u, after(&word, place)), (w, after(&ring, start)))?;
            taken.extend([u, w]);
            taken.extend(&cut);
            let around = ring[start..].iter().chain(&ring[..=start]);
            let there_and_back = cut.iter().chain(around).chain(cut.iter().rev()).chain([&u]).copied();
            word =
                word[..=place].iter().copied().chain(there_and_back).chain(word[place + 1..].iter().copied()).collect();
        }
        Some(word)
    }

    /// Where the next cut goes: a place in the word, an inner boundary and a place in that, close
    /// together in both drawings.
    fn closest(&self, word: &[usize], inner: &[Vec<usize>], taken: &BTreeSet<usize>) -> Option<(usize, usize, usize)> {
        let apart = |a: usize, b: usize| -> f64 { self.points.iter().map(|p| p[a].distance_squared(p[b])).sum() };
        let mut best: Option<(f64, (usize, usize, usize))> = None;
        for (place, &u) in word.iter().enumerate().filter(|(_, u)| !taken.contains(u)) {
            for (index, ring) in inner.iter().enumerate() {
                for (start, &w) in ring.iter().enumerate() {
                    let cost = apart(u, w);
                    if best.is_none_or(|(least, _)| cost < least) {
                        best = Some((cost, (place, index, start)));
                    }
                }
            }
        }
        best.map(|(_, place)| place)
    }

    /// The inner points of a cut between two wedges, the same number of them in both drawings: new
    /// vertices.
    fn cut(&mut self, from: (usize, usize), to: (usize, usize)) -> Option<Vec<usize>> {
        let mut lines: Vec<Vec<DVec2>> = Vec::new();
        for points in &self.points {
            let crossed = Triangulation::new(points, &self.kept)?.crossed(from, to)?;
            let middles = crossed.into_iter().map(|(a, b)| (points[a] + points[b]) / 2.0);
            lines.push([points[from.0]].into_iter().chain(middles).chain([points[to.0]]).collect());
        }
        let most = lines[0].len().max(lines[1].len());
        for line in &mut lines {
            while line.len() < most {
                let length = |i: &usize| line[*i].distance_squared(line[i + 1]);
                let longest = (0..line.len() - 1).reduce(|a, b| if length(&b) > length(&a) { b } else { a })?;
                line.insert(longest + 1, (line[longest] + line[longest + 1]) / 2.0);
            }
        }
        let first = self.points[0].len();
        let cut: Vec<usize> = (first..first + most - 2).collect();
        for (points, line) in self.points.iter_mut().zip(&lines) {
            points.extend(&line[1..most - 1]);
        }
        let line: Vec<usize> = [from.0].into_iter().chain(cut.iter().copied()).chain([to.0]).collect();
        self.kept.extend(line.windows(2).map(|w| undirected(w[0], w[1])));
        Some(cut)
    }
}
