//! Polygons that move apart from themselves, until they are convex.
//!
//! Every vertex is repelled by the edges that do not end there, edges by vertices, by an energy of
//! the kind that unfolds linkages (Cantarella, Demaine, Iben, O'Brien 2004): a simple polygon that
//! is not convex has an expansive motion (Connelly, Demaine, Rote 2003), and an energy that falls
//! as distances grow has no rest before that is done. The energy of a pair counts as far as its
//! distance is shorter than the way along the loop (O'Hara 1991), so that a straight chain of many
//! short edges is at rest. A step moves each vertex by a weighted mean of the distances it is to
//! gain; it never meets an edge. All of this is as smooth in the polygon as distances are: no
//! choice is made on the way.

use glam::DVec2;

use super::clearance::{Pair, closest};
use super::placement::Placement;
use crate::geometry::Polygon;

/// Steps from the polygon to the end of its relaxation.
const STEPS: usize = 128;
/// The part of the weighted mean that a step moves by; two parts are less than the distance of a
/// pair.
const PACE: f64 = 0.15;

/// A polygon on its way to being convex.
#[derive(Clone, Debug)]
pub(super) struct Relaxation {
    outermost: usize,
    placement: Placement,
    /// Loops after each step, about the origin and of area 1; the first are the polygon's.
    states: Vec<Vec<Vec<DVec2>>>,
}

impl Relaxation {
    /// The relaxation of a simple polygon with these pairs; `None` where double precision does not
    /// hold it. O(n^2).
    pub(super) fn new(polygon: &Polygon, pairs: &[Pair], outermost: usize) -> Option<Self> {
        let placement = Placement::of(&polygon.loops()[outermost]);
        let normal =
            |ring: &Vec<DVec2>, place: &Placement| -> Vec<DVec2> { ring.iter().map(|&v| place.normal(v)).collect() };
        let mut loops: Vec<Vec<DVec2>> = polygon.loops().iter().map(|ring| normal(ring, &placement)).collect();
        let mut states = vec![loops.clone()];
        for _ in 0..STEPS {
            loops = step(&loops, pairs)?;
            let place = Placement::of(&loops[outermost]);
            loops = loops.iter().map(|ring| normal(ring, &place)).collect();
            loops.iter().flatten().all(|v| v.is_finite()).then_some(())?;
            states.push(loops.clone());
        }
        Some(Self { outermost, placement, states })
    }

    /// The polygon relaxed by `part`, 0..=1: of the same area about the same barycentre.
    pub(super) fn at(&self, part: f64) -> Polygon {
        let time = part.clamp(0.0, 1.0) * STEPS as f64;
        let before = (time as usize).min(STEPS - 1);
        let between = time - before as f64;
        let rings = self.states[before].iter().zip(&self.states[before + 1]);
        let mix = |(a, b): (&DVec2, &DVec2)| a.lerp(*b, between);
        let loops: Vec<Vec<DVec2>> = rings.map(|(a, b)| a.iter().zip(b).map(mix).collect()).collect();
        let place = Placement::of(&loops[self.outermost]);
        let placed = |ring: &Vec<DVec2>| ring.iter().map(|&v| self.placement.place(place.normal(v))).collect();
        Polygon::from_loops(loops.iter().map(placed).collect())
    }
}

/// Lengths along every loop, from its first vertex to each, and its whole length, by number of the
/// vertex.
fn ways(loops: &[Vec<DVec2>]) -> Vec<(f64, f64)> {
    let mut ways = Vec::new();
    for ring in loops {
        let mut way = 0.0;
        let starts: Vec<f64> = (0..ring.len())
            .map(|i| {
                let here = way;
                way += ring[i].distance(ring[(i + 1) % ring.len()]);
                here
            })
            .collect();
        ways.extend(starts.into_iter().map(|start| (start, way)));
    }
    ways
}

/// One step of the relaxation.
fn step(loops: &[Vec<DVec2>], pairs: &[Pair]) -> Option<Vec<Vec<DVec2>>> {
    let points: Vec<DVec2> = loops.iter().flatten().copied().collect();
    let ways = ways(loops);
    // Weighted sums of what each vertex is to gain, and the weights.
    let mut gain = vec![(DVec2::ZERO, 0.0); points.len()];
    for pair in pairs {
        let (along, apart) = closest(&points, pair);
        let squared = apart.length_squared();
        let [a, b] = pair.edge;
        let bent = if pair.same {
            let whole = ways[a].1;
            let forth = (ways[a].0 + along * points[a].distance(points[b]) - ways[pair.vertex].0).rem_euclid(whole);
            let way = forth.min(whole - forth);
            (1.0 - squared / (way * way)).max(0.0).powi(2)
        } else {
            1.0
        };
        let weight = bent / squared.powi(2);
        if !weight.is_finite() {
            return None;
        }
        for (vertex, part, to) in [(pair.vertex, 1.0, apart), (a, 1.0 - along, -apart), (b, along, -apart)] {
            gain[vertex].0 += to * (part * weight);
            gain[vertex].1 += part * weight;
        }
    }
    let mut moved =
        points.iter().zip(&gain).map(|(&p, &(sum, weight))| if weight > 0.0 { p + sum * (PACE / weight) } else { p });
    Some(loops.iter().map(|ring| moved.by_ref().take(ring.len()).collect()).collect())
}
