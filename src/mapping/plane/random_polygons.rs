//! Seeded random cages for tests: simple polygons of three kinds, alone and with holes.

use glam::{DVec2, dvec2};

use super::Cage;
use super::testing::Random;
use crate::geometry::{Polygon, Side};

/// How a random polygon comes about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Random radii around a centre.
    Star,
    /// Random points, joined by a tour whose crossings are undone one by one.
    Tour,
    /// A triangle that grows a vertex at a time out of a random edge.
    Growth,
}

fn simple(ring: &[DVec2]) -> bool {
    Polygon::from_loops(vec![ring.to_vec()]).nesting().is_ok()
}

fn anticlockwise(mut ring: Vec<DVec2>) -> Vec<DVec2> {
    if crate::geometry::polygon::signed_area(&ring) < 0.0 {
        ring.reverse();
    }
    ring
}

/// A simple anticlockwise loop of `n` vertices in the unit square or so.
pub(super) fn ring(kind: Kind, n: usize, random: &mut Random) -> Vec<DVec2> {
    loop {
        let candidate = match kind {
            Kind::Star => star(n, random),
            Kind::Tour => tour(n, random),
            Kind::Growth => growth(n, random),
        };
        if simple(&candidate) {
            return anticlockwise(candidate);
        }
    }
}

fn star(n: usize, random: &mut Random) -> Vec<DVec2> {
    let steps: Vec<f64> = (0..n).map(|_| 0.3 + random.unit()).collect();
    let total: f64 = steps.iter().sum();
    let mut angle = random.unit();
    steps
        .into_iter()
        .map(|step| {
            angle += step / total * std::f64::consts::TAU;
            DVec2::from_angle(angle) * (0.3 + 0.7 * random.unit())
        })
        .collect()
}

fn tour(n: usize, random: &mut Random) -> Vec<DVec2> {
    let mut ring: Vec<DVec2> = (0..n).map(|_| dvec2(random.unit(), random.unit())).collect();
    let cross = |a: DVec2, b: DVec2, c: DVec2, d: DVec2| {
        let side = |p: DVec2, q: DVec2, r: DVec2| (q - p).perp_dot(r - p) > 0.0;
        side(a, b, c) != side(a, b, d) && side(c, d, a) != side(c, d, b)
    };
    // Undoing a crossing shortens the tour: this ends.
    'again: loop {
        for i in 0..n {
            for j in i + 2..n {
                if (j + 1) % n != i && cross(ring[i], ring[i + 1], ring[j], ring[(j + 1) % n]) {
                    ring[i + 1..=j].reverse();
                    continue 'again;
                }
            }
        }
        return ring;
    }
}

fn growth(n: usize, random: &mut Random) -> Vec<DVec2> {
    let mut ring = vec![dvec2(0.0, 0.0), dvec2(1.0, 0.0), dvec2(0.5, 0.9)];
    while ring.len() < n {
        let i = (random.unit() * ring.len() as f64) as usize;
        let (a, b) = (ring[i], ring[(i + 1) % ring.len()]);
        let out = (b - a).perp() * (random.unit() - 0.5) * 2.0;
        let mut candidate = ring.clone();
        candidate.insert(i + 1, a.lerp(b, 0.2 + 0.6 * random.unit()) + out);
        if simple(&candidate) {
            ring = candidate;
        }
    }
    ring
}

/// A pair of unrelated simple polygons with the same number of vertices.
pub(super) fn cage(source: Kind, target: Kind, n: usize, random: &mut Random) -> Cage {
    let (source, target) = (ring(source, n, random), ring(target, n, random));
    Cage::new(vec![source], vec![target]).expect("the generator makes simple loops")
}

/// A pair of unrelated simple polygons with `holes` star-shaped holes in each.
pub(super) fn cage_with_holes(kind: Kind, n: usize, holes: usize, random: &mut Random) -> Cage {
    loop {
        let sizes: Vec<usize> = (0..holes).map(|_| 3 + (random.unit() * 5.0) as usize).collect();
        let sides = [holed(kind, n, &sizes, random), holed(kind, n, &sizes, random)];
        if let [Some(source), Some(target)] = sides {
            return Cage::new(source, target).expect("the generator nests its loops");
        }
    }
}

fn holed(kind: Kind, n: usize, sizes: &[usize], random: &mut Random) -> Option<Vec<Vec<DVec2>>> {
    let mut loops = vec![ring(kind, n, random)];
    for &size in sizes {
        let (low, high) = Polygon::from_loops(loops.clone()).bounds();
        let place = |random: &mut Random, scale: f64| {
            let centre = low + (high - low) * dvec2(random.unit(), random.unit());
            let mut hole: Vec<DVec2> = star(size, random).into_iter().map(|v| centre + v * scale).collect();
            hole.reverse();
            (centre, hole)
        };
        let found = (0..400).find_map(|trial| {
            let (centre, hole) = place(random, 0.2 / (1.0 + f64::from(trial) / 100.0));
            let inside = Polygon::from_loops(loops.clone()).contains(centre) == Side::Inside;
            let candidate = Polygon::from_loops(loops.iter().cloned().chain([hole.clone()]).collect());
            (inside && candidate.check().is_ok()).then_some(hole)
        });
        loops.push(found?);
    }
    Some(loops)
}
