//! Marching from eight neighbouring sources at once, in SIMD lanes.
//!
//! Fronts of neighbouring sources cross the rest of a mesh in nearly the same order. Each source
//! marches alone as far as [`NEAR`]; from there on a vertex is marched from with all its eight
//! distances, vertices with the least mean of them first. What falls later is marched from again.
//!
//! Whatever the order, the distances are those of eight single marches: the update of a vertex
//! never falls where a distance at an end of the base rises (the virtual source then turns about
//! the other end, away from the vertex), so that from above one limit is reached, up to
//! [`REOPEN`]. Where two fronts meet, the virtual source of both is none: a single march leaves the
//! update out because it reached the vertex before both ends of the base. The eight are marched in
//! an order that is none of theirs, so each lane is held against its own distances: both ends must
//! be nearer than the vertex, unless its angle is obtuse.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::DVec3;

use rayon::prelude::*;

use crate::engine::lane::{Lane, Lanes, Sweep};
use crate::error::Result;
use crate::geometry::Geodesics;
use crate::geometry::geodesics::{March, REOPEN, Wedge, key};

/// Sources marched from at once: a multiple of the lanes of every processor, so that results do not
/// depend on their number.
const TOGETHER: usize = 8;
/// Each source marches alone up to so many diameters of the group: nearer, the fronts cross the
/// same vertices in different directions. At 1.5 some meshes' vertices are marched from five times,
/// from 2 on twice (the built-in woman, a horse and a seated man).
const NEAR: f64 = 2.0;
/// Vertices are marched from so often in the mean at most; a group that needs more is marched one
/// by one, which takes about as long as six.
const MOST_MARCHES: usize = 5;
/// A vertex that is not queued.
const IDLE: u32 = u32::MAX;

/// Memory of the marches of a group, to be used again by the next.
#[derive(Debug, Default)]
struct Together {
    /// Of the single marches.
    alone: March,
    /// Distances of each vertex from the eight sources.
    distances: Vec<f64>,
    /// The key each vertex was last queued with, or [`IDLE`].
    queued: Vec<u32>,
    /// From how many sources each vertex was marched alone.
    finished: Vec<u8>,
    heap: BinaryHeap<Reverse<u64>>,
}

impl Together {
    /// Distance of vertex `v` from source `l`.
    fn distance(&self, v: u32, l: usize) -> f64 {
        self.distances[v as usize * TOGETHER + l]
    }
}

/// Indices of points in groups of eight neighbouring ones, and one of fewer: the points are halved
/// across the longest side of their box, again and again. O(n log^2 n).
fn groups(points: &[DVec3]) -> Vec<Vec<usize>> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    halve(points, &mut order);
    order.chunks(TOGETHER).map(<[usize]>::to_vec).collect()
}

fn halve(points: &[DVec3], part: &mut [usize]) {
    if part.len() <= TOGETHER {
        return;
    }
    let box_of = |(low, high): (DVec3, DVec3), &i: &usize| (low.min(points[i]), high.max(points[i]));
    let (low, high) = part.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), box_of);
    let axis = (high - low).max_position();
    part.sort_unstable_by(|&a, &b| points[a][axis].total_cmp(&points[b][axis]).then(a.cmp(&b)));
    let (one, other) = part.split_at_mut((part.len() / TOGETHER).div_ceil(2) * TOGETHER);
    halve(points, one);
    halve(points, other);
}

/// Distances between all pairs of `sources`, row-major; row i is marched from source i, so that the
/// matrix is symmetric only up to the marching error. Differs from [`Geodesics::matrix`] by less
/// than 1e-7 in the mean. Parallel over groups of eight; the same for any number of threads. O(S V
/// log V) for S sources. `done` hears of every row.
///
/// # Errors
/// Those of `done`, which end the marches.
///
/// # Panics
/// If a source does not exist.
pub(super) fn matrix(geodesics: &Geodesics, sources: &[u32], done: impl Fn() -> Result<()> + Sync) -> Result<Vec<f64>> {
    let (mesh, number) = geodesics.breadth_first();
    let sources: Vec<u32> = sources.iter().map(|&s| number[s as usize]).collect();
    let places: Vec<DVec3> = sources.iter().map(|&s| mesh.positions[s as usize]).collect();
    let lanes = Lanes::detect();
    let groups = groups(&places);
    let rows: Result<Vec<Vec<Vec<f64>>>> = groups
        .par_iter()
        .map_init(Together::default, |memory, group| {
            let own: Vec<u32> = group.iter().map(|&i| sources[i]).collect();
            let rows = memory.rows(&mesh, &own, &sources, lanes);
            own.iter().try_for_each(|_| done())?;
            Ok(rows)
        })
        .collect();
    let mut matrix = vec![0.0; sources.len() * sources.len()];
    for (i, row) in groups.concat().into_iter().zip(rows?.concat()) {
        matrix[i * sources.len()..][..sources.len()].copy_from_slice(&row);
    }
    Ok(matrix)
}

impl Together {
    /// Distances from each of `own` to `targets`.
    fn rows(&mut self, mesh: &Geodesics, own: &[u32], targets: &[u32], lanes: Lanes) -> Vec<Vec<f64>> {
        if let Ok(eight) = <&[u32; TOGETHER]>::try_from(own)
            && self.march(mesh, eight, MOST_MARCHES * mesh.vertex_count(), lanes)
        {
            return (0..TOGETHER).map(|l| targets.iter().map(|&t| self.distance(t, l)).collect()).collect();
        }
        own.iter()
            .map(|&source| {
                mesh.distances_from(source, &mut self.alone);
                targets.iter().map(|&t| self.alone.distances[t as usize]).collect()
            })
            .collect()
    }

    /// Distances from eight sources; `false` if vertices would have to be marched from more often
    /// than `budget`.
    fn march(&mut self, mesh: &Geodesics, sources: &[u32; TOGETHER], budget: usize, lanes: Lanes) -> bool {
        let n = mesh.vertex_count();
        let Self { alone: march, distances, queued, finished, heap } = self;
        distances.clear();
        distances.resize(n * TOGETHER, f64::INFINITY);
        queued.clear();
        queued.resize(n, IDLE);
        finished.clear();
        finished.resize(n, 0);
        heap.clear();
        let place = |l: usize| mesh.positions[sources[l] as usize];
        let pairs = (0..TOGETHER * TOGETHER).map(|k| place(k / TOGETHER).distance(place(k % TOGETHER)));
        let bound = NEAR * pairs.fold(0.0, f64::max);
        let mut touched = Vec::new();
        mesh.clear(march);
        for (l, &source) in sources.iter().enumerate() {
            let first = touched.len();
            mesh.spread(source, march, bound, |v| {
                finished[v as usize] += 1;
                touched.push(v);
            });
            touched.extend(march.heap.drain().map(|Reverse(top)| (top & u64::from(u32::MAX)) as u32));
            // A vertex may stand in the heap several times.
            for &v in &touched[first..] {
                distances[v as usize * TOGETHER + l] = march.distances[v as usize];
            }
            for &v in &touched[first..] {
                (march.distances[v as usize], march.marched[v as usize]) = (f64::INFINITY, f64::INFINITY);
            }
        }
        for v in touched {
            if (finished[v as usize] as usize) < TOGETHER {
                queue(v as usize, distances, queued, heap);
            }
        }
        let mut complete = false;
        lanes.run(Rest { geodesics: mesh, distances, queued, heap, budget, complete: &mut complete });
        complete
    }
}

/// Queues a vertex at the mean of its distances, or at the largest of those there are.
#[inline(always)]
fn queue(v: usize, distances: &[f64], queued: &mut [u32], heap: &mut BinaryHeap<Reverse<u64>>) {
    let row = &distances[v * TOGETHER..][..TOGETHER];
    let sum = ((row[0] + row[1]) + (row[2] + row[3])) + ((row[4] + row[5]) + (row[6] + row[7]));
    let at = if sum.is_finite() {
        sum / TOGETHER as f64
    } else {
        row.iter().copied().filter(|d| d.is_finite()).fold(0.0, f64::max)
    };
    let key = key(at, v as u32);
    let order = (key >> 32) as u32;
    if queued[v] != order {
        queued[v] = order;
        heap.push(Reverse(key));
    }
}

/// The marches of all eight from the queued vertices on.
struct Rest<'a> {
    geodesics: &'a Geodesics,
    distances: &'a mut [f64],
    queued: &'a mut [u32],
    heap: &'a mut BinaryHeap<Reverse<u64>>,
    /// Vertices to be marched from at most.
    budget: usize,
    complete: &'a mut bool,
}

impl Sweep<f64> for Rest<'_> {
    #[inline(always)]
    fn run<L: Lane<E = f64>>(mut self, cpu: L::Cpu) {
        while let Some(Reverse(top)) = self.heap.pop() {
            let v = (top & u64::from(u32::MAX)) as usize;
            if self.queued[v] != (top >> 32) as u32 {
                continue;
            }
            self.queued[v] = IDLE;
            if self.budget == 0 {
                return;
            }
            self.budget -= 1;
            let mut here = [0.0; TOGETHER];
            here.copy_from_slice(&self.distances[v * TOGETHER..][..TOGETHER]);
            for wedge in self.geodesics.wedges_at(v) {
                for side in 0..2 {
                    self.update::<L>(cpu, &here, wedge, side);
                }
            }
        }
        *self.complete = true;
    }
}

impl Rest<'_> {
    /// Lowers the distances of end `side` of a wedge to those over the vertex at its corner, whose
    /// distances are `here`.
    #[inline(always)]
    fn update<L: Lane<E = f64>>(&mut self, cpu: L::Cpu, here: &[f64; TOGETHER], wedge: &Wedge, side: usize) {
        let row = |v: u32| &self.distances[v as usize * TOGETHER..][..TOGETHER];
        let (old, beside) = (row(wedge.ends[side]), row(wedge.ends[1 - side]));
        let (zero, infinite) = (L::num(cpu, 0.0), L::num(cpu, f64::INFINITY));
        if !wedge.obtuse[side] {
            let mut least = zero;
            for c in (0..TOGETHER).step_by(L::N) {
                // Not a number where both are infinite, which is passed over.
                least = (L::load(cpu, &here[c..]) - L::load(cpu, &old[c..])).minimum(least);
            }
            if !L::any(cpu, least.lt(zero)) {
                return;
            }
        }
        let base = Base::<L>::new(cpu, wedge, side);
        let worth = L::num(cpu, (1.0 - REOPEN) * (1.0 - REOPEN));
        let (mut squares, mut most) = ([0.0; TOGETHER], zero);
        for c in (0..TOGETHER).step_by(L::N) {
            let [here, old, end] = [here, old, beside].map(|row| L::load(cpu, &row[c..]));
            let mut across = base.across(cpu, here, end);
            if !wedge.obtuse[side] {
                across = L::select(here.maximum(end).lt(old), across, infinite);
            }
            let along = here + base.reach;
            let square = across.minimum(along * along);
            most = (old * old * worth - square).maximum(most);
            square.store(&mut squares[c..]);
        }
        if !L::any(cpu, zero.lt(most)) {
            return;
        }
        let target = wedge.ends[side] as usize;
        let out = &mut self.distances[target * TOGETHER..][..TOGETHER];
        for c in (0..TOGETHER).step_by(L::N) {
            let (old, square) = (L::load(cpu, &out[c..]), L::load(cpu, &squares[c..]));
            L::select(square.lt(old * old * worth), square.sqrt(), old).store(&mut out[c..]);
        }
        queue(target, self.distances, self.queued, self.heap);
    }
}

/// The base of a triangle as `across` of [`Geodesics`] puts it into the plane.
#[derive(Clone, Copy)]
struct Base<L> {
    /// From the corner to the target.
    reach: L,
    length: L,
    square: L,
    half: L,
    tx: L,
    ty: L,
}

impl<L: Lane<E = f64>> Base<L> {
    #[inline(always)]
    fn new(cpu: L::Cpu, wedge: &Wedge, side: usize) -> Self {
        let (base, reach) = (wedge.lengths[1 - side], wedge.lengths[side]);
        let put = |x: f64| L::splat(cpu, x);
        Self {
            reach: put(reach),
            length: put(base),
            square: put(base * base),
            half: put(0.5 / base),
            tx: put(reach * wedge.cos),
            ty: put(reach * wedge.sin),
        }
    }

    /// Squares of the distances of the target from the virtual sources, `d` away from the corner
    /// and `e` from the other end; infinite where `across` of [`Geodesics`] has none.
    #[inline(always)]
    fn across(&self, cpu: L::Cpu, d: L, e: L) -> L {
        let (zero, infinite) = (L::num(cpu, 0.0), L::num(cpu, f64::INFINITY));
        let sx = (d - e).mul_add(d + e, self.square) * self.half;
        let square = (d - sx) * (d + sx);
        let sy = L::select(zero.lt(square), square, zero).sqrt();
        let crossing = sx.mul_add(self.ty, self.tx * sy);
        let height = sy + self.ty;
        let aside = self.tx - sx;
        let reached = aside.mul_add(aside, height * height);
        let reached = L::select(zero.lt(square), reached, infinite);
        let reached = L::select(crossing.lt(zero), infinite, reached);
        L::select((self.length * height).lt(crossing), infinite, reached)
    }
}

#[cfg(test)]
mod tests;
