//! The multiresolution hierarchy (section 3.1): vertices removed in independent sets, the rings
//! they left, and the meshes between.

use rayon::prelude::*;

use super::collapse::{Candidate, Collapser};
use super::cost::{RULES, Rules};
use super::encode::{Encoded, encode_ring, substitute};
use super::vector::{length, sub};
use super::{Connectivity, Encoding, Stencils, V3};
use crate::error::{Error, Result};
use crate::geometry::NONE;

/// How the hierarchy is cut into stages.
#[derive(Clone, Debug, PartialEq)]
pub struct HierarchyOptions {
    /// Numbers of free vertices, ascending, at which a mesh with an encoding of its own is kept;
    /// the whole mesh always is one.
    pub stages: Vec<usize>,
}

impl Default for HierarchyOptions {
    fn default() -> Self {
        Self { stages: vec![100, 400, 1500, 6000, 20_000] }
    }
}

/// A mesh of the cascade: the vertices before `vertices` in the hierarchy's numbering.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stage {
    /// Number of vertices of this mesh.
    pub vertices: usize,
    /// The levels of splits (entries of [`Hierarchy::level_start`]) that lead here from the stage
    /// before.
    pub levels: std::ops::Range<usize>,
    /// Rings of the vertices whose residual a free vertex can change.
    pub stencils: Stencils,
    /// Their coefficients.
    pub encoding: Encoding<f64>,
}

/// Rings, levels and stages for one mesh and one set of held vertices.
///
/// Vertices are numbered anew: the held ones, the free ones of the base mesh, then the removed ones
/// level by level in the order in which they come back. Vertices without triangles and those of
/// components without a held vertex have no number here.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hierarchy {
    /// Mesh vertex of each number.
    pub order: Vec<u32>,
    /// Number of held vertices; they come first.
    pub held: usize,
    /// Number of vertices of the base mesh.
    pub base: usize,
    /// The ring of every removed vertex; row r restores vertex `base + r`.
    pub splits: Stencils,
    /// Their coefficients.
    pub split_encoding: Encoding<f64>,
    /// First row of each level of splits, and the number of rows at the end. The rings of a level
    /// lie wholly before it.
    pub level_start: Vec<u32>,
    /// The cascade, coarse to fine; the last one is the whole mesh.
    pub stages: Vec<Stage>,
    /// Mesh vertices of the whole mesh encoded in a substitute triangle because their ring cannot
    /// serve.
    pub substituted: Vec<u32>,
    /// Mesh vertices of the whole mesh without any encoding.
    pub left_out: Vec<u32>,
}

/// A removed vertex, its ring and coefficients, in the mesh's numbering.
struct Removed {
    vertex: u32,
    ring: Vec<u32>,
    w: Vec<f64>,
    b: Vec<f64>,
}

/// Rings at one moment.
struct Snapshot {
    alive: Vec<u32>,
    start: Vec<u32>,
    flat: Vec<u32>,
    /// Removed vertices before it, in the order of removal.
    removed: usize,
}

impl Hierarchy {
    /// Removes all vertices but the `held` ones, as far as topology and shape allow, and stores
    /// what is needed to bring them back.
    ///
    /// `positions` is the rest shape, best with a diagonal of about one. Deterministic, about O(V
    /// log V).
    ///
    /// # Errors
    /// [`Error::Input`] if no vertex is held, or a held one is out of range or part of no triangle.
    pub fn new(
        connectivity: &Connectivity,
        positions: &[V3<f64>],
        held: &[u32],
        options: &HierarchyOptions,
    ) -> Result<Self> {
        let n = positions.len();
        let mut is_held = vec![false; n];
        let mut has_anchor = vec![false; connectivity.component_count as usize];
        for &v in held {
            let ring = connectivity.rings.get(v as usize).ok_or_else(|| {
                let what = format!("vertex {v} is held, the mesh has {n}");
                Error::input(what, "Vertex indices count from 0")
            })?;
            if ring.is_empty() {
                return Err(Error::input(format!("vertex {v} is held but part of no triangle"), "Choose another one"));
            }
            is_held[v as usize] = true;
            has_anchor[connectivity.component[v as usize] as usize] = true;
        }
        if held.is_empty() {
            return Err(Error::input("no vertex is held", "Give at least one handle"));
        }
        let active: Vec<bool> = (0..n)
            .map(|v| {
                let c = connectivity.component[v];
                c != NONE && has_anchor[c as usize] && !connectivity.rings[v].is_empty()
            })
            .collect();
        let free: Vec<u32> = (0..n as u32).filter(|&v| active[v as usize] && !is_held[v as usize]).collect();
        let mut rounds = Rounds::new(connectivity, positions, free);
        let mut snapshots = vec![rounds.snapshot(&active)];
        let mut targets: Vec<usize> = options.stages.iter().copied().filter(|&t| t > 0).collect();
        targets.sort_unstable();
        for &target in targets.iter().rev() {
            // A stage must be worth its solve.
            if target * 4 <= rounds.free.len() * 3 {
                rounds.run(target);
                if rounds.free.len() < snapshots[snapshots.len() - 1].alive.len() - held.len() {
                    snapshots.push(rounds.snapshot(&active));
                }
            }
        }
        rounds.run(0);
        snapshots.reverse();
        Ok(assemble(positions, &active, &is_held, rounds, &snapshots))
    }

    /// Mesh vertices to numbers; [`NONE`] for those without one. `vertex_count` is the mesh's.
    pub fn numbers(&self, vertex_count: usize) -> Vec<u32> {
        let mut numbers = vec![NONE; vertex_count];
        for (k, &v) in self.order.iter().enumerate() {
            numbers[v as usize] = k as u32;
        }
        numbers
    }
}

/// Removal in rounds of independent sets, cheapest first.
struct Rounds<'a> {
    positions: &'a [V3<f64>],
    collapser: Collapser<'a>,
    /// Free vertices that are left, ascending.
    free: Vec<u32>,
    best: Vec<Option<Candidate>>,
    stale: Vec<bool>,
    alive: Vec<bool>,
    removed: Vec<Removed>,
    rules: usize,
}

impl<'a> Rounds<'a> {
    fn new(connectivity: &Connectivity, positions: &'a [V3<f64>], free: Vec<u32>) -> Self {
        let n = positions.len();
        Self {
            positions,
            collapser: Collapser::new(positions, connectivity),
            free,
            best: vec![None; n],
            stale: vec![true; n],
            alive: vec![true; n],
            removed: Vec::new(),
            rules: 0,
        }
    }

    /// Removes vertices until `target` free ones are left or none can go any more.
    fn run(&mut self, target: usize) {
        while self.free.len() > target {
            if self.round(self.free.len() - target) == 0 {
                if self.rules + 1 == RULES.len() {
                    return;
                }
                self.rules += 1;
                self.free.iter().for_each(|&v| self.stale[v as usize] = true);
            }
        }
    }

    /// One independent set of at most `most` vertices; the number of those removed.
    fn round(&mut self, most: usize) -> usize {
        let rules = RULES[self.rules];
        let mean_edge = self.mean_edge();
        let stale: Vec<u32> = self.free.iter().copied().filter(|&v| self.stale[v as usize]).collect();
        let collapser = &self.collapser;
        let fresh: Vec<Option<Candidate>> =
            stale.par_iter().with_min_len(256).map(|&v| collapser.best(v, mean_edge, &rules)).collect();
        for (&v, best) in stale.iter().zip(fresh) {
            self.best[v as usize] = best;
            self.stale[v as usize] = false;
        }
        let mut queue: Vec<(f64, u32)> =
            self.free.iter().filter_map(|&v| self.best[v as usize].map(|b| (b.cost, v))).collect();
        queue.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        // A set is independent if no ring holds another removed vertex.
        let mut blocked = vec![false; self.positions.len()];
        let mut count = 0;
        for (_, v) in queue {
            if count == most {
                break;
            }
            let Some(Candidate { to, .. }) = self.best[v as usize].filter(|_| !blocked[v as usize]) else { continue };
            if !self.collapser.still_allowed(v, to, mean_edge, &rules) {
                self.stale[v as usize] = true;
                continue;
            }
            let Some(removed) = self.encode(v, &rules) else {
                // Neither this neighbour nor another makes its ring better; another round may.
                self.best[v as usize] = None;
                continue;
            };
            self.collapser.collapse(v, to);
            for &x in &removed.ring {
                blocked[x as usize] = true;
            }
            for x in self.collapser.rings.of(v).chain(self.collapser.rings.of(to)) {
                self.stale[x as usize] = true;
            }
            for x in self.collapser.rings.of(v) {
                blocked[x as usize] = true;
            }
            self.stale[to as usize] = true;
            self.alive[v as usize] = false;
            self.removed.push(removed);
            count += 1;
        }
        let alive = &self.alive;
        self.free.retain(|&v| alive[v as usize]);
        count
    }

    /// The ring of `v` and its coefficients.
    fn encode(&self, v: u32, rules: &Rules) -> Option<Removed> {
        // Only vertices of few neighbours are removed.
        let ring = self.collapser.rings.short(v)?;
        let (mut w, mut b) = (vec![0.0; ring.len()], vec![0.0; ring.len()]);
        if encode_ring(self.positions, v, ring, &mut w, &mut b).is_some_and(|size| size <= rules.largest_weights) {
            return Some(Removed { vertex: v, ring: ring.to_vec(), w, b });
        }
        if !rules.substitute {
            return None;
        }
        let ring = substitute(self.positions, v, ring, &|u| self.collapser.rings.short(u))?.to_vec();
        let (mut w, mut b) = (vec![0.0; 3], vec![0.0; 3]);
        encode_ring(self.positions, v, &ring, &mut w, &mut b)?;
        Some(Removed { vertex: v, ring, w, b })
    }

    fn mean_edge(&self) -> f64 {
        let (mut sum, mut count) = (0.0, 0);
        for &v in &self.free {
            for u in self.collapser.rings.of(v) {
                sum += length(sub(self.positions[u as usize], self.positions[v as usize]));
                count += 1;
            }
        }
        if sum > 0.0 { sum / f64::from(count) } else { 1.0 }
    }

    fn snapshot(&self, active: &[bool]) -> Snapshot {
        let alive: Vec<u32> =
            (0..active.len() as u32).filter(|&v| active[v as usize] && self.alive[v as usize]).collect();
        let (mut start, mut flat) = (vec![0], Vec::new());
        for &v in &alive {
            flat.extend(self.collapser.rings.of(v));
            start.push(flat.len() as u32);
        }
        Snapshot { alive, start, flat, removed: self.removed.len() }
    }
}

/// Numbers the vertices and writes everything in that numbering. Snapshots come coarse to fine.
fn assemble(
    positions: &[V3<f64>],
    active: &[bool],
    is_held: &[bool],
    rounds: Rounds<'_>,
    snapshots: &[Snapshot],
) -> Hierarchy {
    let n = positions.len();
    let mut order: Vec<u32> = (0..n as u32).filter(|&v| active[v as usize] && is_held[v as usize]).collect();
    let held = order.len();
    order.extend(&rounds.free);
    let base = order.len();
    // Levels counted anew from each stage; the removed ones come back last to first.
    let mut level = vec![0u32; n];
    let mut level_start = vec![0u32];
    let mut sequence: Vec<usize> = Vec::with_capacity(rounds.removed.len());
    let mut stage_levels = Vec::new();
    let mut end = rounds.removed.len();
    for snapshot in snapshots {
        let begin = snapshot.removed;
        let mut here: Vec<(u32, u32, usize)> = Vec::with_capacity(end - begin);
        for k in (begin..end).rev() {
            let r = &rounds.removed[k];
            let l = 1 + r.ring.iter().map(|&u| level[u as usize]).max().unwrap_or(0);
            level[r.vertex as usize] = l;
            here.push((l, r.vertex, k));
        }
        here.sort_unstable();
        let first_level = level_start.len() - 1;
        let mut current = 1;
        for &(l, v, k) in &here {
            if l != current {
                level_start.push(sequence.len() as u32);
                current = l;
            }
            sequence.push(k);
            order.push(v);
        }
        if !here.is_empty() {
            level_start.push(sequence.len() as u32);
        }
        stage_levels.push(first_level..level_start.len() - 1);
        here.iter().for_each(|h| level[h.1 as usize] = 0);
        end = begin;
    }
    let mut numbers = vec![NONE; n];
    for (k, &v) in order.iter().enumerate() {
        numbers[v as usize] = k as u32;
    }
    let rings: Vec<Vec<u32>> =
        sequence.iter().map(|&k| rounds.removed[k].ring.iter().map(|&u| numbers[u as usize]).collect()).collect();
    let splits =
        Stencils::new(order.len(), rings.iter().enumerate().map(|(r, ring)| ((base + r) as u32, ring.as_slice())));
    let gather = |f: &dyn Fn(&Removed) -> &[f64]| -> Vec<f64> {
        sequence.iter().flat_map(|&k| f(&rounds.removed[k])).copied().collect()
    };
    let split_encoding = Encoding { w: gather(&|r| &r.w), b: gather(&|r| &r.b) };
    let local: Vec<V3<f64>> = order.iter().map(|&v| positions[v as usize]).collect();
    let mut hierarchy = Hierarchy { order, held, base, splits, split_encoding, level_start, ..Hierarchy::default() };
    for (snapshot, levels) in snapshots.iter().zip(stage_levels) {
        let vertices = snapshot.alive.len();
        let mut rings = vec![Vec::new(); vertices];
        for (k, &v) in snapshot.alive.iter().enumerate() {
            let ring = &snapshot.flat[snapshot.start[k] as usize..snapshot.start[k + 1] as usize];
            rings[numbers[v as usize] as usize] = ring.iter().map(|&u| numbers[u as usize]).collect();
        }
        let touches = |v: u32| v as usize >= held || rings[v as usize].iter().any(|&u| u as usize >= held);
        let encoded = Encoded::new(&rings, &local[..vertices], touches);
        if vertices == hierarchy.order.len() {
            let back = |list: &[u32]| list.iter().map(|&v| hierarchy.order[v as usize]).collect();
            hierarchy.substituted = back(&encoded.substituted);
            hierarchy.left_out = back(&encoded.left_out);
        }
        hierarchy.stages.push(Stage { vertices, levels, stencils: encoded.stencils, encoding: encoded.encoding });
    }
    hierarchy
}
