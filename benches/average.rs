//! Inverse problem fused with the weighted average: SIMD lanes against the scalar forms, in one
//! program.
//!
//! `cargo bench --bench average [-- TEXELS]`. Prints process CPU time divided by 2 per texel, best
//! of several rounds after a warm-up, and the ratio to the f64 scalar weights (the truth). Noise
//! between runs is about 20 %: compare within one.

mod support;

use std::time::Instant;

use barymap::engine::{LaneScalar, Lanes, Real, TILE};
use barymap::geometry::Topology;
use barymap::models::shapes::lobed_sphere;
use barymap::surface::average::{
    AnchorTable, AveragedChunk, FusedWeights, SweepAnchors, average_tiles, frame_tiles, orthonormalise, weights,
};
use barymap::surface::{PackedPoint, PhongSurface};
use rayon::prelude::*;
use support::cpu_seconds;

const D: usize = 8;
/// Tiles a rayon task works on.
const TASK: usize = 16;

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

fn lanes<E: LaneScalar>(start: Instant, lanes: Lanes, anchors: usize, texels: usize, sets: usize) -> f64 {
    let (table, input) = scene::<E>(anchors, texels);
    let tiles = input.len() / (3 * D * TILE);
    let mut mean = vec![E::ZERO; tiles * sets * D * TILE];
    let images = [table.image.as_slice(), table.own.as_slice()];
    time(start, texels, 5, || {
        mean.par_chunks_mut(TASK * sets * D * TILE).zip(input.par_chunks(TASK * 3 * D * TILE)).for_each(
            |(mean, input)| {
                let anchors = SweepAnchors { own: &table.own, images: &images[..sets], transport: None };
                average_tiles(lanes, anchors, input, mean);
            },
        );
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
                    *mean = FusedWeights::solve(&y, &basis, &table.own, E::of(0.04)).average(&table.image);
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

/// A surface in R^8 of 20,480 triangles and points on it: runs of `run` neighbours on one face, as
/// along the rows of an atlas.
fn surface<E: Real>(texels: usize, run: usize) -> (PhongSurface<E, D>, Vec<PackedPoint>) {
    let mesh = lobed_sphere(5, 0.3);
    let lifted: Vec<f64> = mesh
        .positions
        .iter()
        .flat_map(|p| {
            [p.x, p.y, p.z, 0.4 * p.x * p.y, 0.4 * p.y * p.z, 0.3 * p.z * p.x, 0.3 * p.x * p.x, 0.2 * p.z * p.z]
        })
        .collect();
    let surface = PhongSurface::<f64, D>::new(&Topology::new(&mesh), &lifted).expect("a sound mesh").cast::<E>();
    let faces = surface.triangles.len();
    let points = (0..texels)
        .map(|i| PackedPoint {
            face: ((i / run) * 7919 % faces) as u32,
            b0: 0.1 + 0.3 * (i % run) as f32 / run as f32,
            b1: 0.2 + 0.01 * (i % 13) as f32,
        })
        .collect();
    (surface, points)
}

/// Preparation alone (no list of images), with the average of one, or of two and transport.
fn from_points<E: LaneScalar>(start: Instant, anchors: usize, texels: usize, run: usize, lists: usize) -> f64 {
    let (surface, points) = surface::<E>(texels, run);
    let own: Vec<[E; D]> = (0..anchors).map(|i| surface.vertices[i * surface.vertices.len() / anchors].y).collect();
    let images = [own.as_slice(), own.as_slice()];
    let matrix = [[E::of(0.1); D]; D];
    let lanes = Lanes::detect();
    time(start, texels, 5, || {
        points.par_chunks(TASK * TILE).for_each_init(
            || (AveragedChunk::<E, D>::new(), Vec::new()),
            |(chunk, input), points| {
                if lists == 0 {
                    frame_tiles(lanes, &surface, points, input);
                } else {
                    let transport = (lists > 1).then_some(&matrix);
                    let anchors = SweepAnchors { own: &own, images: &images[..lists], transport };
                    chunk.compute(lanes, &surface, anchors, points);
                }
            },
        );
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
        row("f64 scalar, fused", scalar::<f64>(start, anchors, few, true));
        row("f32 scalar, fused", scalar::<f32>(start, anchors, few, true));
        row("f32 sweep, scalar instance", lanes::<f32>(start, Lanes::scalar(), anchors, few, 1));
        row("f64 lanes", lanes::<f64>(start, detected, anchors, texels, 1));
        row("f32 lanes", lanes::<f32>(start, detected, anchors, texels, 1));
        row("f32 lanes, two images", lanes::<f32>(start, detected, anchors, texels, 2));
    }
    println!("from points of a surface, f32 lanes, n = 93");
    for (name, run) in [("8 texels in a row on each face", 8), ("every texel on another face", 1)] {
        println!("  {name}");
        for (what, lists) in [("preparation alone", 0), ("with average", 1), ("with two averages and transport", 2)] {
            println!("    {what:<42} {:8.1}", from_points::<f32>(start, 93, texels, run, lists));
        }
    }
}
