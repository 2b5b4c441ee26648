//! Finds which vertex is which between two meshes of equal connectivity that number their vertices
//! differently.

use super::{NONE, Topology};

/// Rounds of colouring: a vertex's colour tells what lies this many edges around it.
const ROUNDS: usize = 6;

/// A number for each vertex that no renumbering changes (colour refinement; Weisfeiler and Leman,
/// 1968): vertices of different colours never correspond. 0 for vertices of no usable triangle.
/// O(F).
pub(crate) fn colours(topology: &Topology) -> Vec<u64> {
    let n = topology.vertex_count();
    let boundary = |t: u32, k: usize| topology.neighbours[t as usize][k] == NONE;
    let mut colours: Vec<u64> = (0..n as u32)
        .map(|v| {
            let around = topology.vertex_triangles(v);
            let open =
                around.iter().flat_map(|&t| (0..3).map(move |k| (t, k))).filter(|&(t, k)| boundary(t, k)).count();
            if around.is_empty() { 0 } else { mixed(around.len() as u64 + ((open as u64) << 32)) }
        })
        .collect();
    for _ in 0..ROUNDS {
        // Sums do not depend on an order.
        let around = |v: u32| -> u64 {
            let others = topology.vertex_triangles(v).iter().flat_map(|&t| topology.triangles[t as usize]);
            others.fold(0, |sum: u64, w| sum.wrapping_add(mixed(colours[w as usize])))
        };
        let next = (0..n as u32).map(|v| if colours[v as usize] == 0 { 0 } else { mixed(around(v)) });
        colours = next.collect();
    }
    colours
}

/// Spreads the bits of a number over all of it; never 0 (the finaliser of SplitMix64).
fn mixed(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (x ^ (x >> 31)) | 1
}

/// A corner of a triangle, from which a map spreads.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dart {
    pub(crate) triangle: u32,
    pub(crate) corner: usize,
}

/// Looks for maps of components of one mesh onto components of another; holds what every attempt
/// needs.
#[derive(Debug)]
pub(crate) struct Walker<'a> {
    from: &'a Topology,
    to: &'a Topology,
    image: Vec<u32>,
    preimage: Vec<u32>,
    /// For each triangle its image, and the corner there of each of its corners.
    triangles: Vec<(u32, [usize; 3])>,
    taken: Vec<bool>,
    reached: Vec<u32>,
}

impl<'a> Walker<'a> {
    pub(crate) fn new(from: &'a Topology, to: &'a Topology) -> Self {
        Self {
            from,
            to,
            image: vec![NONE; from.vertex_count()],
            preimage: vec![NONE; to.vertex_count()],
            triangles: vec![(NONE, [0; 3]); from.triangles.len()],
            taken: vec![false; to.triangles.len()],
            reached: Vec::new(),
        }
    }

    /// The one map of triangles onto triangles, neighbours onto neighbours, that sends corner `a`
    /// to corner `b`, turning round with the orientation or, `mirrored`, against it: pairs of
    /// vertices, for all that is joined to `a` across edges. `None` if there is none, which mostly
    /// shows within a few triangles; O(F) else.
    pub(crate) fn walk(&mut self, a: Dart, b: Dart, mirrored: bool) -> Option<Vec<(u32, u32)>> {
        let mut corners = [0; 3];
        for i in 0..3 {
            corners[(a.corner + i) % 3] = (b.corner + if mirrored { 3 - i } else { i }) % 3;
        }
        let found = self.spread(a.triangle, b.triangle, corners);
        let mut pairs = Vec::new();
        for t in std::mem::take(&mut self.reached) {
            self.taken[self.triangles[t as usize].0 as usize] = false;
            self.triangles[t as usize].0 = NONE;
            for v in self.from.triangles[t as usize] {
                let w = std::mem::replace(&mut self.image[v as usize], NONE);
                if w != NONE {
                    self.preimage[w as usize] = NONE;
                    pairs.push((v, w));
                }
            }
        }
        found.then_some(pairs)
    }

    fn spread(&mut self, a: u32, b: u32, corners: [usize; 3]) -> bool {
        if !self.take(a, b, corners) {
            return false;
        }
        let mut next = 0;
        while let Some(&t) = self.reached.get(next) {
            next += 1;
            let (image, corners) = self.triangles[t as usize];
            for k in 0..3 {
                let (n, m) = (self.from.neighbours[t as usize][k], self.to.neighbours[image as usize][corners[k]]);
                if (n == NONE) != (m == NONE) {
                    return false;
                }
                if n == NONE {
                    continue;
                }
                if self.triangles[n as usize].0 != NONE {
                    if self.triangles[n as usize].0 != m {
                        return false;
                    }
                    continue;
                }
                let Some(across) = self.across(t, k, n, m) else { return false };
                if !self.take(n, m, across) {
                    return false;
                }
            }
        }
        true
    }

    /// Where the corners of `n`, across edge `k` of `t`, go in `m`.
    fn across(&self, t: u32, k: usize, n: u32, m: u32) -> Option<[usize; 3]> {
        let own = self.from.triangles[n as usize];
        let shared = [1, 2].map(|i| self.from.triangles[t as usize][(k + i) % 3]);
        let mut out = [usize::MAX; 3];
        for v in shared {
            out[own.iter().position(|w| *w == v)?] = self.to.corner_of(m, self.image[v as usize])?;
        }
        let third = out.iter().position(|c| *c == usize::MAX)?;
        out[third] = (0..3).find(|c| !out.contains(c))?;
        Some(out)
    }

    /// Sends a triangle to another; false where that contradicts what is known.
    fn take(&mut self, t: u32, image: u32, corners: [usize; 3]) -> bool {
        if self.taken[image as usize] {
            return false;
        }
        self.taken[image as usize] = true;
        self.triangles[t as usize] = (image, corners);
        self.reached.push(t);
        for k in 0..3 {
            let (v, w) = (self.from.triangles[t as usize][k], self.to.triangles[image as usize][corners[k]]);
            let (known, back) = (self.image[v as usize], self.preimage[w as usize]);
            if known == NONE && back == NONE {
                self.image[v as usize] = w;
                self.preimage[w as usize] = v;
            } else if known != w || back != v {
                return false;
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::shapes::{Random, icosphere, lobed_sphere};

    /// The same triangles with vertices, triangles and first corners in another order, turned round
    /// if so asked; and where each vertex went.
    pub(crate) fn renumbered(topology: &Topology, seed: u64, turned: bool) -> (Topology, Vec<u32>) {
        let mut random = Random::new(seed);
        let mut shuffled = |n: usize| -> Vec<u32> {
            let mut keys: Vec<(f64, u32)> = (0..n as u32).map(|i| (random.signed(), i)).collect();
            keys.sort_by(|a, b| a.0.total_cmp(&b.0));
            keys.into_iter().map(|k| k.1).collect()
        };
        let n = topology.vertex_count();
        let new = shuffled(n);
        let order = shuffled(topology.triangles.len());
        let triangles: Vec<[u32; 3]> = order
            .iter()
            .map(|&t| {
                let mut c = topology.triangles[t as usize].map(|v| new[v as usize]);
                c.rotate_left(t as usize % 3);
                if turned { [c[0], c[2], c[1]] } else { c }
            })
            .collect();
        let usable = vec![true; triangles.len()];
        (Topology::from_triangles(n, triangles, usable), new)
    }

    fn first(topology: &Topology, v: u32) -> Dart {
        let triangle = topology.vertex_triangles(v)[0];
        Dart { triangle, corner: topology.corner_of(triangle, v).unwrap() }
    }

    /// All maps that begin at vertex 0.
    fn all(a: &Topology, b: &Topology) -> Vec<Vec<(u32, u32)>> {
        let mut walker = Walker::new(a, b);
        let mut found = Vec::new();
        for w in 0..b.vertex_count() as u32 {
            for &t in b.vertex_triangles(w) {
                let onto = Dart { triangle: t, corner: b.corner_of(t, w).unwrap() };
                for mirrored in [false, true] {
                    found.extend(walker.walk(first(a, 0), onto, mirrored));
                }
            }
        }
        found
    }

    #[test]
    fn a_renumbered_mesh_is_found_and_colours_are_kept() {
        // An icosahedron's subdivision has its 120 symmetries, half of them mirrored: one of them
        // is the renumbering, and every one keeps colours.
        let topology = Topology::new(&icosphere(1.0, 2));
        for turned in [false, true] {
            let (other, new) = renumbered(&topology, 5, turned);
            let (a, b) = (colours(&topology), colours(&other));
            assert!((0..new.len()).all(|v| a[v] == b[new[v] as usize]));
            let found = all(&topology, &other);
            assert_eq!(found.len(), 120);
            let right = |pairs: &[(u32, u32)]| pairs.iter().all(|&(v, w)| new[v as usize] == w);
            assert_eq!(found.iter().filter(|f| right(f)).count(), 1);
            assert!(
                found.iter().all(|f| f.len() == new.len() && f.iter().all(|&(v, w)| a[v as usize] == b[w as usize]))
            );
        }
    }

    #[test]
    fn one_turned_edge_is_another_connectivity() {
        let mesh = lobed_sphere(2, 0.2);
        let topology = Topology::new(&mesh);
        let mut triangles = mesh.triangles().to_vec();
        // The edge between triangle 0 and its neighbour across corner 0.
        let n = topology.neighbours[0][0] as usize;
        let [p, q, r] = triangles[0];
        let s = triangles[n].into_iter().find(|v| ![q, r].contains(v)).unwrap();
        triangles[0] = [p, q, s];
        triangles[n] = [p, s, r];
        let usable = vec![true; triangles.len()];
        let other = Topology::from_triangles(topology.vertex_count(), triangles, usable);
        assert!(all(&topology, &other).is_empty());
        // A failed attempt leaves nothing behind.
        let mut walker = Walker::new(&topology, &topology);
        walker.walk(first(&topology, 0), first(&topology, 7), false);
        assert!(walker.walk(first(&topology, 0), first(&topology, 0), false).is_some());
        assert!(walker.image.iter().chain(&walker.preimage).all(|x| *x == NONE));
        assert!(walker.taken.iter().all(|t| !t) && walker.triangles.iter().all(|t| t.0 == NONE));
    }
}
