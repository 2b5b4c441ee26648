//! Tips of limbs: the peaks of the average geodesic distance, with how far they stand out.

use rayon::prelude::*;

use super::side::Side;
use crate::geometry::sampling::farthest_points;
use crate::geometry::{Geodesics, March, NONE};

/// Landmarks whose distances are averaged.
const LANDMARKS: usize = 128;
/// Most tips of a surface.
const MOST: usize = 48;
/// Least height of a peak above the saddle that joins it to a higher one, at unit area.
const LEAST: f64 = 0.012;

/// What counts as hardly lower than a tip.
const LEVEL: f64 = 0.003;

/// A tip.
#[derive(Clone, Debug, PartialEq)]
pub struct Extremity {
    /// The vertex.
    pub vertex: u32,
    /// Height above the saddle that joins it to a higher peak, at unit area: about the length of
    /// the limb.
    pub height: f64,
    /// Radius of the part around it that is hardly lower: how far its place is uncertain, at unit
    /// area.
    pub extent: f64,
}

/// The tips of a surface, longest limb first; components too small to carry one have none.
///
/// The average distance to all places (Hilaga et al. 2001) grows along every limb towards its tip.
/// Each of its peaks is followed down to the saddle where a higher one takes over; what rises less
/// than 0.012 of the square root of the area is left out, so that a sphere has none. O(128 V log
/// V).
pub(super) fn extremities(side: &Side<'_>, geodesics: &Geodesics) -> Vec<Extremity> {
    let n = side.positions.len();
    let mut average = vec![0.0; n];
    for component in 0..side.topology.component_count {
        let Some(seed) = side.topology.vertex_component.iter().position(|c| *c == component) else { continue };
        let landmarks = farthest_points(geodesics, seed as u32, LANDMARKS);
        let rows: Vec<Vec<f64>> = landmarks
            .par_iter()
            .map_init(March::default, |march, l| {
                geodesics.distances_from(*l, march);
                march.distances.clone()
            })
            .collect();
        for v in (0..n).filter(|&v| side.topology.vertex_component[v] == component) {
            average[v] = rows.iter().map(|r| r[v]).filter(|d| d.is_finite()).sum::<f64>() / rows.len() as f64;
        }
    }
    let mut found = peaks(side, &average, LEVEL);
    found.retain(|e| e.height >= LEAST);
    found.truncate(MOST);
    found
}

/// Peaks of a function on the vertices with their persistence (0-dimensional, of superlevel sets),
/// highest persistence first. The highest of each component persists to its lowest value.
pub(super) fn peaks(side: &Side<'_>, f: &[f64], level: f64) -> Vec<Extremity> {
    let n = f.len();
    let mut order: Vec<u32> = (0..n as u32).filter(|&v| side.topology.vertex_component[v as usize] != NONE).collect();
    order.sort_by(|&a, &b| f[b as usize].total_cmp(&f[a as usize]).then(a.cmp(&b)));
    let mut parent: Vec<u32> = vec![NONE; n];
    let mut out = Vec::new();
    let peak =
        |vertex: u32, below: f64| Extremity { vertex, height: f[vertex as usize] - below, extent: f64::INFINITY };
    for &v in &order {
        parent[v as usize] = v;
        for &t in side.topology.vertex_triangles(v) {
            for w in side.topology.triangles[t as usize] {
                if parent[w as usize] == NONE || w == v {
                    continue;
                }
                // The root of a set is its peak; the lower peak ends where two sets meet.
                let (a, b) = (root(&mut parent, v), root(&mut parent, w));
                if a == b {
                    continue;
                }
                let higher = |a: u32, b: u32| (f[a as usize], b) > (f[b as usize], a);
                let (high, low) = if higher(a, b) { (a, b) } else { (b, a) };
                if low != v {
                    out.push(peak(low, f[v as usize]));
                }
                parent[low as usize] = high;
            }
        }
    }
    for component in 0..side.topology.component_count {
        let mut all = order.iter().filter(|&&v| side.topology.vertex_component[v as usize] == component);
        if let (Some(&first), Some(&last)) = (all.next(), all.next_back()) {
            out.push(peak(first, f[last as usize]));
        }
    }
    for e in &mut out {
        e.extent = extent(side, f, e.vertex, level);
    }
    out.sort_by(|a, b| b.height.total_cmp(&a.height).then(a.vertex.cmp(&b.vertex)));
    out
}

/// Greatest distance from `peak` of the part around it that is lower by at most `level`; looked at
/// up to a quarter of the square root of the area.
fn extent(side: &Side<'_>, f: &[f64], peak: u32, level: f64) -> f64 {
    let mut seen = std::collections::BTreeSet::from([peak]);
    let mut stack = vec![peak];
    let mut far: f64 = 0.0;
    while let Some(v) = stack.pop() {
        for &t in side.topology.vertex_triangles(v) {
            for w in side.topology.triangles[t as usize] {
                if f[w as usize] >= f[peak as usize] - level && seen.insert(w) {
                    far = far.max(side.positions[w as usize].distance(side.positions[peak as usize]));
                    if far > 0.25 {
                        return far;
                    }
                    stack.push(w);
                }
            }
        }
    }
    far
}

fn root(parent: &mut [u32], mut v: u32) -> u32 {
    while parent[v as usize] != v {
        let up = parent[parent[v as usize] as usize];
        parent[v as usize] = up;
        v = up;
    }
    v
}
