//! A mesh of rings that vertices are removed from by half-edge collapses.

use super::cost::{RULES, Rules, collapse_cost};
use super::rings::{LONGEST, Rings};
use super::{Connectivity, V3};

// Neither a vertex of a long ring is removed nor another one moved onto it.
const _: () = assert!(RULES[RULES.len() - 1].most_neighbours + 3 <= LONGEST);

/// The cheapest collapse of a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Candidate {
    pub(crate) cost: f64,
    pub(crate) to: u32,
}

/// The rings while vertices are removed. Every vertex keeps an ordered ring, so that no triangles
/// are needed.
#[derive(Debug)]
pub(crate) struct Collapser<'a> {
    positions: &'a [V3<f64>],
    pub(crate) rings: Rings,
    open: Vec<bool>,
    irregular: Vec<bool>,
}

impl<'a> Collapser<'a> {
    pub(crate) fn new(positions: &'a [V3<f64>], connectivity: &Connectivity) -> Self {
        Self {
            positions,
            rings: Rings::new(connectivity.rings.clone()),
            open: connectivity.open.clone(),
            irregular: connectivity.irregular.clone(),
        }
    }

    /// The ring of `v` as seen from the collapse onto its neighbour number `k`, which comes first.
    /// An open ring must begin or end there.
    fn seen_from(&self, v: u32, k: usize, out: &mut Vec<u32>) -> bool {
        out.clear();
        let Some(ring) = self.rings.short(v) else { return false };
        if !self.open[v as usize] {
            out.extend_from_slice(&ring[k..]);
            out.extend_from_slice(&ring[..k]);
        } else if k == 0 {
            out.extend_from_slice(ring);
        } else if k + 1 == ring.len() {
            out.extend(ring.iter().rev());
        } else {
            return false;
        }
        true
    }

    /// Whether `v` may go to `ring[0]` without changing the topology: the link condition, and no
    /// vertex left with too few neighbours.
    fn may_collapse(&self, v: u32, ring: &[u32]) -> bool {
        let to = ring[0];
        let open = self.open[v as usize];
        if self.irregular[to as usize] || ring.len() < 2 {
            return false;
        }
        let Some(far) = self.rings.short(to) else { return false };
        // The common neighbours must be the opposite corners of the triangles at the edge.
        let opposite = if open { 1 } else { 2 };
        if ring[1..].iter().filter(|x| far.contains(x)).count() != opposite {
            return false;
        }
        let least = |x: u32| if self.open[x as usize] { 2 } else { 3 };
        let count = |x: u32| self.rings.count(x);
        let last = ring[ring.len() - 1];
        let lose_one = |x: u32| count(x) > least(x);
        if !lose_one(ring[1]) || (!open && !lose_one(last)) {
            return false;
        }
        let gained = if open { ring.len() - 2 } else { ring.len() - 3 };
        // `v` stands beside the first opposite corner in the ring of `to`.
        let beside = |a: u32, b: u32| {
            let m = far.len();
            (0..m).any(|i| far[i] == a && (far[(i + 1) % m] == b || far[(i + m - 1) % m] == b))
        };
        count(to) + gained > least(to) && beside(v, ring[1])
    }

    /// The cheapest collapse of `v` that the rules allow.
    pub(crate) fn best(&self, v: u32, mean_edge: f64, rules: &Rules) -> Option<Candidate> {
        // A longer ring gives every neighbour too many.
        if self.irregular[v as usize] || self.rings.count(v) > rules.most_neighbours + 3 {
            return None;
        }
        let mut best: Option<Candidate> = None;
        let mut ring = Vec::new();
        for k in 0..self.rings.count(v) {
            if !self.seen_from(v, k, &mut ring) {
                continue;
            }
            if let Some(cost) = self.cost(v, &ring, mean_edge, rules) {
                let to = ring[0];
                if best.is_none_or(|b| (cost, to) < (b.cost, b.to)) {
                    best = Some(Candidate { cost, to });
                }
            }
        }
        best
    }

    fn cost(&self, v: u32, ring: &[u32], mean_edge: f64, rules: &Rules) -> Option<f64> {
        let open = self.open[v as usize];
        let gained = ring.len() - if open { 2 } else { 3 };
        if self.rings.count(ring[0]) + gained > rules.most_neighbours + 1 || !self.may_collapse(v, ring) {
            return None;
        }
        let boundary = open.then(|| ring[ring.len() - 1]);
        collapse_cost(self.positions, v, ring, boundary, mean_edge, rules)
    }

    /// Whether the collapse of `v` onto `to` is still allowed.
    pub(crate) fn still_allowed(&self, v: u32, to: u32, mean_edge: f64, rules: &Rules) -> bool {
        let mut ring = Vec::new();
        let place = self.rings.of(v).position(|x| x == to);
        place.is_some_and(|k| self.seen_from(v, k, &mut ring) && self.cost(v, &ring, mean_edge, rules).is_some())
    }

    /// Moves `v` onto its neighbour `to`; the ring of `v` stays as it was.
    pub(crate) fn collapse(&mut self, v: u32, to: u32) {
        let Some(k) = self.rings.of(v).position(|x| x == to) else { return };
        let mut ring = Vec::new();
        if !self.seen_from(v, k, &mut ring) {
            return;
        }
        let m = ring.len();
        let open = self.open[v as usize];
        // Neighbours between the opposite corners get `to` for `v`; on an open ring the last one
        // too.
        let end = if open { m } else { m - 1 };
        let inner = if end > 2 { &ring[2..end] } else { &[][..] };
        for &x in inner {
            self.rings.replace(x, v, to);
        }
        self.rings.remove(ring[1], v);
        if !open {
            self.rings.remove(ring[m - 1], v);
        }
        let Some(far) = self.rings.short(to) else { return };
        if let Some(p) = far.iter().position(|&y| y == v) {
            let before = far[(p + far.len() - 1) % far.len()];
            // With both neighbours equal (a fan of two) either way is right.
            let forward = before == ring[1] && !(self.open[to as usize] && p == 0);
            let inner: Vec<u32> = if forward { inner.to_vec() } else { inner.iter().rev().copied().collect() };
            self.rings.splice(to, p, inner);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::cost::RULES;
    use super::*;
    use crate::geometry::{Mesh, Topology};
    use crate::models::shapes::{Diagonal, Random, icosphere, plane_grid, torus, uv_sphere};

    /// The rings as a set of triangles, and whether they agree with one another.
    fn triangles(c: &Collapser<'_>, alive: &[bool]) -> Option<Vec<[u32; 3]>> {
        let mut seen = std::collections::BTreeMap::new();
        for v in (0..alive.len() as u32).filter(|&v| alive[v as usize]) {
            let ring: Vec<u32> = c.rings.of(v).collect();
            let n = if c.open[v as usize] { ring.len() - 1 } else { ring.len() };
            for k in 0..n {
                let (a, b) = (ring[k], ring[(k + 1) % ring.len()]);
                if !alive[a as usize] || !alive[b as usize] {
                    return None;
                }
                let mut t = [v, a, b];
                let first = (0..3).min_by_key(|&i| t[i])?;
                t.rotate_left(first);
                *seen.entry(t).or_insert(0) += 1;
            }
        }
        seen.values().all(|&n| n == 3).then(|| seen.into_keys().collect())
    }

    fn characteristic(mesh: &Mesh, keep: usize) -> (i64, usize) {
        let positions: Vec<V3<f64>> = mesh.positions.iter().map(|p| p.to_array()).collect();
        let connectivity = Connectivity::new(mesh);
        let mut c = Collapser::new(&positions, &connectivity);
        let mut alive = vec![true; positions.len()];
        let mut left = positions.len();
        let mut random = Random::new(3);
        // Any order must keep the rings in agreement, not only the cheapest first.
        for _ in 0..40 * positions.len() {
            let v = (random.unit() * positions.len() as f64) as u32;
            if left <= keep {
                break;
            }
            if !alive[v as usize] {
                continue;
            }
            if let Some(best) = c.best(v, 0.3, &RULES[2]) {
                assert!(c.still_allowed(v, best.to, 0.3, &RULES[2]));
                c.collapse(v, best.to);
                alive[v as usize] = false;
                left -= 1;
            }
        }
        let triangles = triangles(&c, &alive).expect("rings agree");
        let topology = Topology::from_triangles(positions.len(), triangles.clone(), vec![true; triangles.len()]);
        assert_eq!((topology.nonmanifold_edges, topology.misoriented_edges), (0, 0));
        let edges = (3 * triangles.len() + topology.boundary_edges) / 2;
        (left as i64 - edges as i64 + triangles.len() as i64, left)
    }

    #[test]
    fn collapses_keep_the_topology() {
        let (sphere, left) = characteristic(&icosphere(1.0, 3), 0);
        assert!(sphere == 2 && left <= 6, "{sphere} {left}");
        let (ring, left) = characteristic(&torus(2.0, 0.7, 24, 12, Diagonal::Forward), 0);
        assert!(ring == 0 && (7..=24).contains(&left), "{ring} {left}");
        let (sheet, left) = characteristic(&plane_grid(9, 7, 3.0, 2.0, Diagonal::Forward), 0);
        assert!(sheet == 1 && left <= 8, "{sheet} {left}");
        // The rim of a double cone, whose tips have longer rings than any vertex that is moved.
        let (cone, left) = characteristic(&uv_sphere(1.0, 400, 2), 0);
        assert!(cone == 2 && left <= 200, "{cone} {left}");
    }
}
