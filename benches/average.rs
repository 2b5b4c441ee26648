//! Inverse problem fused with the weighted average: SIMD lanes against the scalar forms, in one program.
//!
//! `cargo bench --bench average [-- TEXELS]`. Prints process CPU time divided by 2 per texel, best of several rounds after a
//! warm-up, and the ratio to the f64 scalar weights (the truth). Noise between runs is about 20 %: compare within one.

use std::time::Instant;

use barymap::engine::{LaneScalar, Lanes, Real, TILE};
use barymap::surface::average::{AnchorTable, SweepAnchors, average_fused, average_tiles, orthonormalise, weights};
use rayon::prelude::*;

const D: usize = 8;
/// Tiles a rayon task works on.
const TASK: usize = 16;

/// CPU seconds of all threads of this process; wall time where the system does not tell.
fn cpu_seconds(start: Instant) -> f64 {
    let threads = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let nanoseconds: f64 = threads
        .filter_map(|t| std::fs::read_to_string(t.path().join("schedstat")).ok())
        .filter_map(|s| s.split(' ').next()?.parse::<f64>().ok())
        .sum();
    if nanoseconds > 0.0 {
        nanoseconds * 1e-9
    } else {
        start.elapsed().as_secs_f64() * rayon::current_num_threads() as f64
    }
}

/// Best of `rounds`, nanoseconds of CPU time / 2 per texel.
fn time(start: Instant, texels: usize, rounds: usize, mut job: impl FnMut()) -> f64 {
    job();
    let once = |job: &mut dyn FnMut()| {
        let before = cpu_seconds(start);
        job();
        (cpu_seconds(start) - before) / 2.0 / texels as f64 * 1e9
    };
    (0..rounds).map(|_| once(&mut job)).fold(f64::INFINITY, f64::min)
}

fn scene<E: Real>(anchors: usize, texels: usize) -> (AnchorTable<E, D>, Vec<E>) {
    let mut state = 1u64;
    let mut random = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1u32 << 30) - 1.0
    };
    let mut any = || -> [E; D] { std::array::from_fn(|_| E::of(random())) };
    let table =
        AnchorTable { own: (0..anchors).map(|_| any()).collect(), image: (0..anchors).map(|_| any()).collect() };
    let mut input = vec![E::ZERO; texels.div_ceil(TILE) * 3 * D * TILE];
    for i in 0..texels {
        let start = i / TILE * 3 * D * TILE + i % TILE;
        let [b0, b1] = orthonormalise([any(), any()]);
        for (row, x) in any().into_iter().chain(b0).chain(b1).enumerate() {
            input[start + row * TILE] = x;
        }
    }
    (table, input)
}

fn lanes<E: LaneScalar>(
    start: Instant,
    lanes: Lanes,
    anchors: usize,
    texels: usize,
    sets: usize,
    negative: bool,
) -> f64 {
    let (table, input) = scene::<E>(anchors, texels);
    let tiles = input.len() / (3 * D * TILE);
    let mut mean = vec![E::ZERO; tiles * sets * D * TILE];
    let mut sums = vec![E::ZERO; tiles * TILE];
    let images = [table.image.as_slice(), table.own.as_slice()];
    time(start, texels, 5, || {
        mean.par_chunks_mut(TASK * sets * D * TILE)
            .zip(sums.par_chunks_mut(TASK * TILE))
            .zip(input.par_chunks(TASK * 3 * D * TILE))
            .for_each(|((mean, sums), input)| {
                let anchors = SweepAnchors { own: &table.own, images: &images[..sets] };
                average_tiles(lanes, anchors, input, mean, negative.then_some(sums));
            });
    })
}

fn scalar<E: Real>(start: Instant, anchors: usize, texels: usize, fused: bool) -> f64 {
    let (table, input) = scene::<E>(anchors, texels);
    let mut mean = vec![[E::ZERO; D]; texels];
    time(start, texels, 2, || {
        mean.par_chunks_mut(1024).enumerate().for_each(|(task, mean)| {
            let mut w = vec![E::ZERO; anchors];
            for (i, mean) in mean.iter_mut().enumerate() {
                let i = task * 1024 + i;
                let at = i / TILE * 3 * D * TILE + i % TILE;
                let row = |r: usize| -> [E; D] { std::array::from_fn(|k| input[at + (r * D + k) * TILE]) };
                let (y, basis) = (row(0), [row(1), row(2)]);
                if fused {
                    *mean = average_fused(&y, &basis, &table, E::of(0.04)).mean;
                } else {
                    weights(&y, &basis, &table.own, &mut w);
                    *mean = [E::ZERO; D];
                    for (w, image) in w.iter().zip(&table.image) {
                        for k in 0..D {
                            mean[k] += *w * image[k];
                        }
                    }
                }
            }
        });
    })
}

fn main() {
    let texels = std::env::args().skip(1).find_map(|a| a.parse().ok()).unwrap_or(1 << 17);
    let start = Instant::now();
    let detected = Lanes::detect();
    println!(
        "inverse + average in R^8, {texels} texels, {} threads, lanes {}; CPU time / 2, ns per texel (ratio to f64 scalar)",
        rayon::current_num_threads(),
        detected.name()
    );
    for anchors in [27, 64, 93] {
        let few = (texels / 8).max(TILE);
        let truth = scalar::<f64>(start, anchors, few, false);
        println!("n = {anchors}");
        let row = |name: &str, ns: f64| println!("  {name:<44} {ns:8.1}  ({:.2} x)", truth / ns);
        row("f64 scalar, weights then average", truth);
        row("f64 scalar, one pass", scalar::<f64>(start, anchors, few, true));
        row("f32 scalar, one pass", scalar::<f32>(start, anchors, few, true));
        row("f32 sweep, scalar instance", lanes::<f32>(start, Lanes::scalar(), anchors, few, 1, false));
        row("f64 lanes", lanes::<f64>(start, detected, anchors, texels, 1, false));
        row("f32 lanes", lanes::<f32>(start, detected, anchors, texels, 1, false));
        row("f32 lanes, two images, negative weights", lanes::<f32>(start, detected, anchors, texels, 2, true));
    }
}
