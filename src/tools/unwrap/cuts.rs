//! Where charts are cut apart besides the edges that the segmentation chose.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use crate::geometry::texcoords::Islands;
use crate::geometry::{Mesh, NONE};

/// Edges that charts must end at, and polygons that need not stay whole.
#[derive(Clone, Debug)]
pub(super) struct Cuts {
    /// `seams[t][k]`: the edge from corner `k` of triangle `t` to the next.
    pub(super) seams: Vec<[bool; 3]>,
    /// Triangles whose polygon is cut into triangles.
    pub(super) loose: Vec<bool>,
}

impl Cuts {
    pub(super) fn new(mesh: &Mesh) -> Self {
        let n = mesh.triangle_count();
        Self { seams: vec![[false; 3]; n], loose: vec![false; n] }
    }

    /// How much is cut; grows with every cut.
    pub(super) fn count(&self) -> usize {
        let edges: usize = self.seams.iter().flatten().filter(|s| **s).count();
        edges + self.loose.iter().filter(|l| **l).count()
    }

    /// Cuts triangles out of their charts; from the third round on the whole charts into triangles,
    /// each of which is flat by itself.
    pub(super) fn around(&mut self, faulty: &[u32], islands: &Islands, round: u32) {
        let charts: BTreeSet<u32> = faulty.iter().map(|&t| islands.island_of[t as usize]).collect();
        let whole = round >= 2;
        let cut = |t: &usize| {
            let island = islands.island_of[*t];
            island != NONE && charts.contains(&island)
        };
        let all: Vec<usize> = if whole && !charts.is_empty() {
            (0..self.seams.len()).filter(cut).collect()
        } else {
            faulty.iter().map(|&t| t as usize).collect()
        };
        for t in all {
            self.seams[t] = [true; 3];
            self.loose[t] = true;
        }
    }

    /// Cuts each ring into disks: from border to border along two shortest paths that are far from
    /// each other.
    pub(super) fn part_rings(&mut self, mesh: &Mesh, islands: &Islands) {
        let mut members: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for (t, &i) in islands.island_of.iter().enumerate() {
            if islands.islands.get(i as usize).is_some_and(|island| !island.is_disk()) {
                members.entry(i).or_default().push(t as u32);
            }
        }
        for triangles in members.values() {
            let ring = Ring::new(mesh, triangles);
            for [v, w] in ring.paths() {
                for &(t, k) in ring.edges.get(&[v.min(w), v.max(w)]).into_iter().flatten() {
                    self.seams[t as usize][k] = true;
                    self.loose[t as usize] = true;
                }
            }
        }
    }
}

/// A chart with holes. Its vertices are places in the texture, where the atlas has joined what is
/// one point of the surface.
struct Ring {
    /// The sides, as triangle and corner, of each edge.
    edges: BTreeMap<[u32; 2], Vec<(u32, usize)>>,
    /// Neighbours over inner edges.
    around: BTreeMap<u32, Vec<u32>>,
    /// Which closed line of the border a vertex is on.
    line: BTreeMap<u32, usize>,
    lines: usize,
}

impl Ring {
    fn new(mesh: &Mesh, triangles: &[u32]) -> Self {
        let mut ids: BTreeMap<[u64; 2], u32> = BTreeMap::new();
        let mut edges: BTreeMap<[u32; 2], Vec<(u32, usize)>> = BTreeMap::new();
        for &t in triangles {
            let Some(uv) = mesh.triangle_texcoords(t as usize) else { continue };
            let corners = uv.map(|p| {
                let next = ids.len() as u32;
                *ids.entry([p.x, p.y].map(|c| (c + 0.0).to_bits())).or_insert(next)
            });
            for k in 0..3 {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                edges.entry([a.min(b), a.max(b)]).or_default().push((t, k));
            }
        }
        let mut around: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        let mut border: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for ([a, b], sides) in &edges {
            let lists = if sides.len() == 1 { &mut border } else { &mut around };
            lists.entry(*a).or_default().push(*b);
            lists.entry(*b).or_default().push(*a);
        }
        let mut line: BTreeMap<u32, usize> = BTreeMap::new();
        let mut lines = 0;
        for &start in border.keys() {
            if line.contains_key(&start) {
                continue;
            }
            let mut open = vec![start];
            while let Some(v) = open.pop() {
                if line.insert(v, lines).is_none() {
                    open.extend(&border[&v]);
                }
            }
            lines += 1;
        }
        Self { edges, around, line, lines }
    }

    /// The edges of two sets of paths, each of which joins all lines of the border.
    fn paths(&self) -> Vec<[u32; 2]> {
        let all: BTreeSet<u32> = self.line.keys().copied().collect();
        let Some(first) = self.join(&all, &BTreeSet::new(), &BTreeSet::new()) else { return Vec::new() };
        let cut: BTreeSet<[u32; 2]> = first.iter().map(|[v, w]| [*v.min(w), *v.max(w)]).collect();
        let taken: BTreeSet<u32> = first.iter().flatten().copied().collect();
        // On each line the vertex that is farthest from the first set, the lowest on ties.
        let from_first = self.search(taken.iter().copied(), |_| false, &BTreeSet::new(), &BTreeSet::new()).0;
        let mut far: BTreeMap<usize, (u32, u32)> = BTreeMap::new();
        for (v, line) in &self.line {
            let distance = from_first.get(v).map_or(0, |x| x.1);
            let best = far.entry(*line).or_insert((*v, distance));
            if distance > best.1 {
                *best = (*v, distance);
            }
        }
        let far: BTreeSet<u32> = far.values().map(|f| f.0).collect();
        // In a narrow ring they have to meet at vertices.
        let second = self
            .join(&far, &taken, &BTreeSet::new())
            .or_else(|| self.join(&all, &taken, &BTreeSet::new()))
            .or_else(|| self.join(&all, &BTreeSet::new(), &cut));
        first.into_iter().chain(second.into_iter().flatten()).collect()
    }

    /// Paths that join all lines of the border, from the vertices `starts` of those that are joined
    /// already to any of another, not over the vertices and edges given; `None` if there are none.
    fn join(
        &self,
        starts: &BTreeSet<u32>,
        not_over: &BTreeSet<u32>,
        not_along: &BTreeSet<[u32; 2]>,
    ) -> Option<Vec<[u32; 2]>> {
        let mut joined = BTreeSet::from([0]);
        let mut path = Vec::new();
        while joined.len() < self.lines {
            let from = starts.iter().copied().filter(|v| joined.contains(&self.line[v]) && !not_over.contains(v));
            let other = |v: u32| self.line.get(&v).is_some_and(|l| !joined.contains(l));
            let (reached, end) = self.search(from, other, not_over, not_along);
            let mut v = end?;
            joined.insert(self.line[&v]);
            while let Some(&(w, _)) = reached.get(&v).filter(|x| x.0 != NONE) {
                path.push([v, w]);
                v = w;
            }
        }
        Some(path)
    }

    /// Breadth first over inner edges: the predecessor and distance of each vertex reached, and the
    /// first that is an `end`.
    fn search(
        &self,
        from: impl Iterator<Item = u32>,
        end: impl Fn(u32) -> bool,
        not_over: &BTreeSet<u32>,
        not_along: &BTreeSet<[u32; 2]>,
    ) -> (BTreeMap<u32, (u32, u32)>, Option<u32>) {
        let mut reached: BTreeMap<u32, (u32, u32)> = from.map(|v| (v, (NONE, 0))).collect();
        let mut open: VecDeque<u32> = reached.keys().copied().collect();
        while let Some(v) = open.pop_front() {
            if end(v) {
                return (reached, Some(v));
            }
            let distance = reached[&v].1;
            for &w in self.around.get(&v).into_iter().flatten() {
                if !reached.contains_key(&w) && !not_over.contains(&w) && !not_along.contains(&[v.min(w), v.max(w)]) {
                    reached.insert(w, (v, distance + 1));
                    open.push_back(w);
                }
            }
        }
        (reached, None)
    }
}
