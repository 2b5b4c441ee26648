//! Surface points through frames and sweep against the scalar path, on a lobed sphere bent into
//! R^8.

use super::tests::{CONDITION, TERMS, distance};
use super::*;
use crate::engine::{LaneScalar, Lanes, TILE};
use crate::geometry::{NONE, Topology};
use crate::models::shapes::{Random, lobed_sphere};
use crate::surface::theory::lift;
use crate::surface::{PackedPoint, PhongSurface};

fn surface() -> PhongSurface<f64, 8> {
    let mesh = lobed_sphere(3, 0.3);
    // Both precisions are to start from the same numbers.
    PhongSurface::<f64, 8>::new(&Topology::new(&mesh), &lift(&mesh)).unwrap().cast::<f32>().cast()
}

/// Points on random faces, corners and edges among them.
fn points(surface: &PhongSurface<f64, 8>, count: usize) -> Vec<PackedPoint> {
    let mut random = Random::new(count as u64);
    (0..count)
        .map(|i| {
            let face = (random.unit() * surface.triangles.len() as f64) as u32;
            let (b0, b1) = (random.unit() as f32, random.unit() as f32);
            match i % 8 {
                0 => PackedPoint { face, b0: 1.0, b1: 0.0 },
                1 => PackedPoint { face, b0: 0.0, b1: 0.0 },
                2 => PackedPoint { face, b0, b1: 1.0 - b0 },
                _ => PackedPoint { face, b0: 0.5 * b0, b1: 0.5 * b1 },
            }
        })
        .collect()
}

/// y and the basis of a point by the scalar code, and whether the plane is well determined.
fn frame(surface: &PhongSurface<f64, 8>, p: PackedPoint) -> ([f64; 8], [[f64; 8]; 2]) {
    let t = surface.triangle(p.face);
    // As the sweep has it in f32: the third coordinate is what is left to one.
    let x = [f64::from(p.b0), f64::from(p.b1), f64::from(1.0 - p.b0 - p.b1)];
    (t.point(&x), orthonormalise(t.psi(&x)))
}

/// Largest error of y, in mean edges, and of the bases.
fn frame_errors<E: LaneScalar>(surface: &PhongSurface<f64, 8>, points: &[PackedPoint], input: &[E]) -> [f64; 2] {
    let mut worst = [0.0f64; 2];
    for (i, &p) in points.iter().enumerate() {
        let row = |r: usize| -> [f64; 8] {
            std::array::from_fn(|k| input[i / TILE * 24 * TILE + (8 * r + k) * TILE + i % TILE].to_f64())
        };
        let (y, basis) = frame(surface, p);
        worst[0] = worst[0].max(distance(&row(0), &y));
        worst[1] = worst[1].max(distance(&row(1), &basis[0])).max(distance(&row(2), &basis[1]));
    }
    worst
}

/// A point is a sum of three products and a basis vector comes from some dozens, in coordinates of
/// up to 30 edges.
const POINT_TOLERANCE: f64 = 4.0 * 30.0;
/// Psi's rows have length 0.9 or more here, at angles that orthonormalising hardly amplifies.
const BASIS_TOLERANCE: f64 = 64.0;

fn check_frames<E: LaneScalar>() {
    let surface = surface();
    for count in [0, 1, 63, 64, 65, 500] {
        let points = points(&surface, count);
        let mut input = vec![E::ONE; 7];
        for lanes in [Lanes::detect(), Lanes::scalar()] {
            frame_tiles(lanes, &surface.cast::<E>(), &points, &mut input);
            assert_eq!(input.len(), count.div_ceil(TILE) * 24 * TILE);
            let [y, basis] = frame_errors(&surface, &points, &input).map(|e| e / E::EPSILON.to_f64());
            // 1 - b0 - b1 in f64 differs from that in f32 by an epsilon of f32.
            let slack = if E::EPSILON < E::of(1e-10) { 2f64.powi(29) } else { 1.0 };
            assert!(y <= POINT_TOLERANCE * slack && basis <= BASIS_TOLERANCE * slack, "{y} {basis} epsilons");
        }
    }
    let points = points(&surface, 100);
    let mut input = Vec::new();
    frame_tiles(Lanes::detect(), &surface.cast::<E>(), &points, &mut input);
    input[24 * TILE + 17 * TILE + 5] += E::of(0.01);
    assert!(frame_errors(&surface, &points, &input)[1] > 5e-3, "the comparison sees a wrong entry");
}

#[test]
fn frames_are_the_points_and_planes_of_the_surface() {
    check_frames::<f32>();
    check_frames::<f64>();
}

#[test]
fn undetermined_planes_and_missing_faces_stay_finite() {
    let mut surface = surface().cast::<f32>();
    for (v, vertex) in surface.vertices.iter_mut().enumerate() {
        match v % 3 {
            0 => vertex.t = [[0.0; 8]; 2],
            1 => vertex.t[1] = vertex.t[0],
            _ => {}
        }
    }
    let mut points = points(&surface.cast(), 130);
    points[7].face = NONE;
    points[129].face = surface.triangles.len() as u32;
    let mut input = Vec::new();
    frame_tiles(Lanes::detect(), &surface, &points, &mut input);
    assert!(input.iter().all(|x| x.is_finite()));
    for (i, p) in points.iter().enumerate() {
        let row = |r: usize| -> [f32; 8] {
            std::array::from_fn(|k| input[i / TILE * 24 * TILE + (8 * r + k) * TILE + i % TILE])
        };
        for (a, b, length) in [(1, 1, 1.0), (2, 2, 1.0), (1, 2, 0.0)] {
            assert!((dot(&row(a), &row(b)) - length).abs() < 64.0 * f32::EPSILON, "point {i}");
        }
        assert!((p.face as usize) < surface.triangles.len() || row(0) == [0.0; 8]);
    }
}

#[test]
fn chunks_give_what_the_scalar_path_gives() {
    let surface = surface();
    let own: Vec<[f64; 8]> = (0..60).map(|i| surface.vertices[i * surface.vertices.len() / 60].y).collect();
    let turn = |v: &[f64; 8]| -> [f64; 8] { std::array::from_fn(|k| 0.8 * v[(k + 3) % 8] - 0.6 * v[(k + 1) % 8]) };
    let mut matrix = [[0.0; 8]; 8];
    for (k, row) in matrix.iter_mut().enumerate() {
        row[(k + 3) % 8] = 0.8;
        row[(k + 1) % 8] = -0.6;
    }
    let image: Vec<[f64; 8]> = own.iter().map(|v| std::array::from_fn(|k| v[k] * v[(k + 1) % 8] * 0.1)).collect();
    let (single, table) = (surface.cast::<f32>(), AnchorTable::new(own, image).unwrap());
    let table32 = table.cast::<f32>();
    let matrix32 = matrix.map(|row| row.map(|x| x as f32));
    let points = points(&surface, 200);
    let mut chunk = AveragedChunk::<f32, 8>::new();
    let images = [table32.image.as_slice(), table32.own.as_slice()];
    let anchors = SweepAnchors { own: &table32.own, images: &images, transport: Some(&matrix32) };
    // A longer chunk first: what it leaves must not show.
    chunk.compute(Lanes::detect(), &single, anchors, &points);
    chunk.compute(Lanes::detect(), &single, anchors, &points[..150]);
    let size = 30.0;
    let tolerance = CONDITION * TERMS * f64::from(f32::EPSILON) * size;
    for (i, &p) in points[..150].iter().enumerate() {
        let (y, basis) = frame(&surface, p);
        let mut w = vec![0.0; table.len()];
        weights(&y, &basis, &table.own, &mut w);
        let mean = |list: &[[f64; 8]]| -> [f64; 8] {
            std::array::from_fn(|k| w.iter().zip(list).map(|(w, v)| w * v[k]).sum())
        };
        let (first, turned) = (mean(&table.image), turn(&y));
        let carried: [f64; 8] = std::array::from_fn(|k| first[k] + turned[k]);
        assert!(distance(&chunk.point(i).map(f64::from), &y) <= tolerance);
        assert!(distance(&chunk.mean(0, i).map(f64::from), &carried) <= tolerance, "point {i}");
        assert!(distance(&chunk.mean(1, i).map(f64::from), &mean(&table.own)) <= tolerance, "point {i}");
        assert!(distance(&first, &carried) > 10.0 * tolerance, "the transport is seen");
    }
}
