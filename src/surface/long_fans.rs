//! Fans of thousands of triangles, searched by halves: what looks through a fan for the nearest of
//! its triangles or vertices takes a time that grows with the logarithm of its length.
//!
//! A part of a fan lies in a cone around its vertex, and its outer vertices in a box. Both bound
//! the distance of a point from below: a distance `r` from the vertex at an angle `a` beyond the
//! cone's, every triangle of it is at least `r sin a` away.

use std::collections::HashMap;

use super::vector::{Vector, add_scaled, dot, scaled, sub};

/// A longer fan is searched by halves.
pub(super) const LONGEST: usize = 128;
/// Triangles of a part that is not halved.
const LEAF: usize = 8;
/// Parts whose bound exceeds the least distance by less than this are passed over: around the
/// vertex itself all triangles are equally near.
const TIE: f64 = 1e-9;
/// Rounding of the cones' cosines.
const ROUNDING: f64 = 1e-12;

/// A place in R^K and, in four more dimensions, its normal.
pub(super) type Spot<const K: usize> = (Vector<f64, K>, Vector<f64, 4>);

fn minus<const K: usize>(a: &Spot<K>, b: &Spot<K>) -> Spot<K> {
    (sub(&a.0, &b.0), sub(&a.1, &b.1))
}

fn product<const K: usize>(a: &Spot<K>, b: &Spot<K>) -> f64 {
    dot(&a.0, &b.0) + dot(&a.1, &b.1)
}

/// `None` for what has no direction.
fn unit<const K: usize>(a: &Spot<K>) -> Option<Spot<K>> {
    let length = product(a, a).sqrt();
    let over = 1.0 / length;
    (length > 0.0 && over.is_finite()).then(|| (scaled(over, &a.0), scaled(over, &a.1)))
}

/// The long fans of a surface.
#[derive(Clone, Debug, Default)]
pub(super) struct LongFans<const K: usize>(HashMap<u32, LongFan<K>>);

impl<const K: usize> LongFans<K> {
    /// Of the vertices with more than [`LONGEST`] triangles; `fan` gives those of each vertex.
    pub(super) fn new<'a>(
        vertices: usize,
        fan: impl Fn(u32) -> &'a [u32],
        corners: impl Fn(u32) -> [u32; 3],
        spot: impl Fn(u32) -> Spot<K>,
    ) -> Self {
        let long = (0..vertices as u32).filter(|&v| fan(v).len() > LONGEST);
        Self(long.map(|v| (v, LongFan::new(v, fan(v), &corners, &spot))).collect())
    }

    /// The fan of `v`; `None` if it has `count` triangles and these are few.
    #[inline(always)]
    pub(super) fn of(&self, v: u32, count: usize) -> Option<&LongFan<K>> {
        if count > LONGEST { self.0.get(&v) } else { None }
    }
}

/// A fan by halves.
#[derive(Clone, Debug)]
pub(super) struct LongFan<const K: usize> {
    /// The vertex.
    middle: Spot<K>,
    /// The whole first; the first half follows its whole.
    parts: Vec<Part<K>>,
    /// Of triangles with the same corners the lowest.
    triangles: Vec<u32>,
}

#[derive(Clone, Debug)]
struct Part<const K: usize> {
    axis: Spot<K>,
    /// Of the cone's angle; none where it is no less than a right one.
    cosine_sine: Option<(f64, f64)>,
    /// The box of the outer vertices.
    low: Spot<K>,
    high: Spot<K>,
    /// Of what is not halved the triangles; else the second half, and zero.
    first: u32,
    count: u32,
}

/// A triangle of a fan while that is halved: the directions to its outer vertices, and the middle
/// of these.
struct Item<const K: usize> {
    triangle: u32,
    outer: [u32; 2],
    middle: Spot<K>,
}

/// How far parts are at least.
#[derive(Clone, Copy, Debug)]
pub(super) enum Reach {
    /// Every point of a triangle counts.
    Triangles,
    /// The outer vertices count.
    Vertices,
}

impl<const K: usize> LongFan<K> {
    fn new(v: u32, fan: &[u32], corners: &impl Fn(u32) -> [u32; 3], spot: &impl Fn(u32) -> Spot<K>) -> Self {
        let middle = spot(v);
        let direction = |w: u32| unit(&minus(&spot(w), &middle));
        let nowhere = ([0.0; K], [0.0; 4]);
        let item = |&triangle: &u32| {
            let [a, b, c] = corners(triangle);
            let outer = if a == v {
                [b, c]
            } else if b == v {
                [c, a]
            } else {
                [a, b]
            };
            let [p, q] = outer.map(|w| direction(w).unwrap_or(nowhere));
            let middle = (add_scaled(&p.0, 1.0, &q.0), add_scaled(&p.1, 1.0, &q.1));
            Item { triangle, outer, middle }
        };
        let mut items: Vec<Item<K>> = fan.iter().map(item).collect();
        // Copies are never nearer.
        let key = |i: &Item<K>| (i.outer[0].min(i.outer[1]), i.outer[0].max(i.outer[1]));
        items.sort_unstable_by_key(|i| (key(i), i.triangle));
        items.dedup_by_key(|i| key(i));
        let mut result = Self { middle, parts: Vec::new(), triangles: Vec::new() };
        result.halve(&mut items, 0, &|w| (spot(w), direction(w)));
        result.triangles = items.iter().map(|i| i.triangle).collect();
        result
    }

    /// Appends the part of `items`, of which the first is number `first` of all, and its halves.
    fn halve(&mut self, items: &mut [Item<K>], first: usize, at: &impl Fn(u32) -> (Spot<K>, Option<Spot<K>>)) {
        let sum = items.iter().fold(([0.0; K], [0.0; 4]), |s: Spot<K>, i| {
            (add_scaled(&s.0, 1.0, &i.middle.0), add_scaled(&s.1, 1.0, &i.middle.1))
        });
        let axis = unit(&sum);
        let mut cosine = 1.0_f64;
        let (mut low, mut high) =
            (([f64::INFINITY; K], [f64::INFINITY; 4]), ([-f64::INFINITY; K], [-f64::INFINITY; 4]));
        for w in items.iter().flat_map(|i| i.outer) {
            let (spot, direction) = at(w);
            let along = axis.zip(direction).map_or(-1.0, |(a, d)| product(&a, &d));
            cosine = if along < cosine || along.is_nan() { along } else { cosine };
            for k in 0..K {
                (low.0[k], high.0[k]) = (low.0[k].min(spot.0[k]), high.0[k].max(spot.0[k]));
            }
            for k in 0..4 {
                (low.1[k], high.1[k]) = (low.1[k].min(spot.1[k]), high.1[k].max(spot.1[k]));
            }
        }
        let cosine = cosine - ROUNDING;
        let cosine_sine = (cosine > 0.0).then(|| (cosine, (1.0 - cosine * cosine).max(0.0).sqrt()));
        let here = self.parts.len();
        let leaf = items.len() <= LEAF;
        self.parts.push(Part {
            axis: axis.unwrap_or(([0.0; K], [0.0; 4])),
            cosine_sine,
            low,
            high,
            first: first as u32,
            count: if leaf { items.len() as u32 } else { 0 },
        });
        if leaf {
            return;
        }
        // At the median along the axis in which directions differ most.
        let coordinate = |i: &Item<K>, k: usize| if k < K { i.middle.0[k] } else { i.middle.1[k - K] };
        let extent = |k: usize| {
            let (low, high) = items.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), i| {
                (l.min(coordinate(i, k)), h.max(coordinate(i, k)))
            });
            high - low
        };
        let widest = (0..K + 4).map(|k| (extent(k), k)).fold((0.0, 0), |a, b| if b.0 > a.0 { b } else { a }).1;
        let half = items.len() / 2;
        items.select_nth_unstable_by(half, |a, b| {
            coordinate(a, widest).total_cmp(&coordinate(b, widest)).then(a.triangle.cmp(&b.triangle))
        });
        let (one, other) = items.split_at_mut(half);
        self.halve(one, first, at);
        self.parts[here].first = self.parts.len() as u32;
        self.halve(other, first + half, at);
    }

    /// The triangles, of those with the same corners the lowest.
    pub(super) fn triangles(&self) -> &[u32] {
        &self.triangles
    }

    /// Calls `look` with the triangles that may be nearest to `to`, nearer parts first, and passes
    /// over those that are no nearer than the least squared distance so far, which `look` returns
    /// and which begins as `least`. The number of calls.
    pub(super) fn search(&self, to: &Spot<K>, reach: Reach, mut least: f64, mut look: impl FnMut(u32) -> f64) -> usize {
        let from = minus(to, &self.middle);
        let squared = product(&from, &from);
        let bound = |n: usize| match reach {
            Reach::Triangles => self.parts[n].beyond_cone(&from, squared),
            Reach::Vertices => self.parts[n].beyond_box(to),
        };
        let mut looks = 0;
        let mut stack = vec![(0, bound(0))];
        while let Some((n, distance)) = stack.pop() {
            if distance >= least * (1.0 - TIE) {
                continue;
            }
            let part = &self.parts[n];
            if part.count > 0 {
                for &t in &self.triangles[part.first as usize..(part.first + part.count) as usize] {
                    least = look(t);
                    looks += 1;
                }
                continue;
            }
            let [a, b] = [n + 1, part.first as usize].map(|n| (n, bound(n)));
            if a.1 <= b.1 { stack.extend([b, a]) } else { stack.extend([a, b]) }
        }
        looks
    }
}

impl<const K: usize> Part<K> {
    /// A bound of the squared distance of a point from all triangles, seen from the vertex.
    fn beyond_cone(&self, from: &Spot<K>, squared: f64) -> f64 {
        let Some((cosine, sine)) = self.cosine_sine else { return 0.0 };
        let along = product(from, &self.axis);
        // Never more than it is: what cancels here may be all there is.
        let across = (squared * (1.0 - ROUNDING) - along * along).max(0.0).sqrt();
        // The point at an angle b from the axis, the cone's being a: r cos(b - a), r sin(b - a).
        if along * cosine + across * sine <= 0.0 {
            return squared;
        }
        let beyond = (across * cosine - along * sine).max(0.0);
        beyond * beyond
    }

    /// The same from all outer vertices.
    fn beyond_box(&self, to: &Spot<K>) -> f64 {
        let one = |x: f64, low: f64, high: f64| (x - x.clamp(low, high)).powi(2);
        let place: f64 = (0..K).map(|k| one(to.0[k], self.low.0[k], self.high.0[k])).sum();
        place + (0..4).map(|k| one(to.1[k], self.low.1[k], self.high.1[k])).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::closest::closest_barycentric;
    use crate::models::shapes::Random;
    use glam::DVec3;

    const N: u32 = 20_000;

    /// A cone of bumpy radius around vertex 0, and a copy of each of its first triangles.
    fn cone() -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let tip = DVec3::new(0.3, -0.2, 0.1);
        let mut positions = vec![tip];
        positions.extend((0..N).map(|i| {
            let a = f64::from(i) / f64::from(N);
            let r = 1.0 + 0.3 * (a * 60.0).sin();
            let (s, c) = (a * std::f64::consts::TAU).sin_cos();
            tip + DVec3::new(r * c, r * s, -0.7 + 0.1 * (a * 90.0).cos())
        }));
        let mut triangles: Vec<[u32; 3]> = (0..N).map(|i| [1 + i, 1 + (i + 1) % N, 0]).collect();
        triangles.extend_from_within(..100);
        (positions, triangles)
    }

    #[test]
    fn the_nearest_is_found_by_a_few_looks() {
        let (positions, triangles) = cone();
        let fan: Vec<u32> = (0..triangles.len() as u32).collect();
        let spot = |v: u32| {
            let p = positions[v as usize];
            ([p.x, p.y, p.z, 0.0], [0.0; 4])
        };
        let fans = LongFans::new(1, |_| &fan[..], |t| triangles[t as usize], spot);
        let long = fans.of(0, fan.len()).unwrap();
        assert!(fans.of(0, LONGEST).is_none() && fans.of(1, fan.len()).is_none());
        let mut random = Random::new(3);
        let mut looks = [0; 3];
        for k in 0..300 {
            let any = DVec3::new(random.signed(), random.signed(), random.signed());
            // Anywhere, near the surface, near the vertex.
            let p = match k % 3 {
                0 => 2.0 * any,
                1 => positions[1 + (k * 61) % N as usize].lerp(positions[0], random.unit()) + 0.01 * any,
                _ => positions[0] + 1e-6 * any,
            };
            let to = ([p.x, p.y, p.z, 0.0], [0.0; 4]);
            let from_triangle = |t: u32| {
                let corners = triangles[t as usize].map(|v| positions[v as usize]);
                let b = closest_barycentric(p, corners);
                (corners[0] * b[0] + corners[1] * b[1] + corners[2] * b[2]).distance_squared(p)
            };
            let from_vertices = |t: u32| {
                let [a, b, _] = triangles[t as usize].map(|v| positions[v as usize].distance_squared(p));
                a.min(b)
            };
            let ways: [(Reach, &dyn Fn(u32) -> f64); 2] =
                [(Reach::Triangles, &from_triangle), (Reach::Vertices, &from_vertices)];
            for (reach, distance) in ways {
                let mut least = f64::INFINITY;
                let count = long.search(&to, reach, least, |t| {
                    least = least.min(distance(t));
                    least
                });
                let truth = fan.iter().map(|&t| distance(t)).fold(f64::INFINITY, f64::min);
                assert!(least >= truth && least * (1.0 - 2.0 * TIE) <= truth, "{reach:?} {k}: {least:e} {truth:e}");
                looks[k % 3] += count;
                // Nothing is nearer than the nearest.
                assert_eq!(long.search(&to, reach, 0.0, |_| 0.0), 0);
            }
        }
        // By brute force they were four millions each. Where the whole rim is about equally far
        // most has to be looked at.
        assert!(looks[0] + looks[1] + looks[2] < 500_000 && looks[1] < 100_000, "{looks:?}");
    }

    #[test]
    fn copies_are_looked_at_once() {
        let (positions, _) = cone();
        let triangles: Vec<[u32; 3]> = (0..N as usize).map(|i| [[0, 1, 2], [2, 0, 1], [0, 2, 1]][i % 3]).collect();
        let fan: Vec<u32> = (0..N).collect();
        let spot = |v: u32| (positions[v as usize].extend(0.0).to_array(), [0.0; 4]);
        let fans = LongFans::new(3, |_| &fan[..], |t| triangles[t as usize], spot);
        for v in 0..3 {
            assert_eq!(fans.of(v, fan.len()).map(|long| long.triangles()), Some(&[0][..]));
        }
    }
}
