//! The encoding of rings (section 2.1): weights w and offsets b.

use super::decode::{REGULARISATION, ring_value};
use super::rings::LONGEST;
use super::vector::{add_scaled, cross, dot, length, scale, sub};
use super::weights::mean_value_weights;
use super::{Stencils, V3};
use crate::engine::Real;

/// Largest sum of |w| that a vertex may have; rounding errors grow with it.
pub(crate) const LARGEST_WEIGHTS: f64 = 200.0;
/// Smallest twice-the-area of a projected ring, in parts of its squared rms radius times its
/// length: below, the ring has no reliable normal.
const LEAST_AREA: f64 = 2e-3;
/// Largest error of a vertex decoded from its own ring, in parts of the ring's rms radius.
const LARGEST_ERROR: f64 = 1e-11;
/// Vertices around a vertex among which a substitute triangle is looked for.
const SUBSTITUTES: usize = 24;
/// Twice the area of a substitute triangle in parts of the sum of its squared sides, at least.
const LEAST_SHAPE: f64 = 0.02;
/// No triangle has a better shape, as these are measured: an equilateral one has 0.289.
const BEST_SHAPE: f64 = 0.29;

/// The coefficients of [`Stencils`], slot by slot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Encoding<R> {
    /// Mean value weights, summing to one over each row.
    pub w: Vec<R>,
    /// Offset along the ring's normal over distance in its plane (equation 9, b = h / d), positive
    /// against the normal of equation 2, which points inward for outward-oriented rings.
    pub b: Vec<R>,
}

impl Encoding<f64> {
    /// Encodes every row of `stencils` at `positions`; rows that cannot be encoded are listed.
    pub fn new(stencils: &Stencils, positions: &[V3<f64>]) -> (Self, Vec<u32>) {
        let mut result = Self { w: vec![0.0; stencils.neighbour.len()], b: vec![0.0; stencils.neighbour.len()] };
        let mut failed = Vec::new();
        for row in 0..stencils.row_count() {
            let slots = stencils.slots(row);
            let (w, b) = (&mut result.w[slots.clone()], &mut result.b[slots]);
            if encode_ring(positions, stencils.vertex[row], stencils.ring(row), w, b).is_none() {
                failed.push(row as u32);
            }
        }
        (result, failed)
    }

    /// The nearest coefficients in another precision.
    pub fn to_precision<R: Real>(&self) -> Encoding<R> {
        let convert = |x: &[f64]| x.iter().map(|&x| R::of(x)).collect();
        Encoding { w: convert(&self.w), b: convert(&self.b) }
    }
}

/// Encodes vertex `v` with respect to `ring` and returns sum |w|.
///
/// `None` (and zero coefficients) where that gives no reliable result: fewer than three neighbours,
/// a ring without area, weights that cancel, or a decoded position that is not the vertex's
/// (equation 13 is evaluated and compared).
///
/// Offsets are taken over sqrt(d² + tau² rho²) instead of d, rho being the rms radius of the ring,
/// in the decoder too: exact all the same, finite at d = 0 and differentiable there.
pub(crate) fn encode_ring(positions: &[V3<f64>], v: u32, ring: &[u32], w: &mut [f64], b: &mut [f64]) -> Option<f64> {
    let result = try_encode(positions, v, ring, w, b);
    if result.is_none() {
        w.iter_mut().chain(b.iter_mut()).for_each(|x| *x = 0.0);
    }
    result
}

fn try_encode(positions: &[V3<f64>], v: u32, ring: &[u32], w: &mut [f64], b: &mut [f64]) -> Option<f64> {
    let m = ring.len();
    if m < 3 {
        return None;
    }
    let at = positions[v as usize];
    let origin = positions[ring[0] as usize];
    // The ring relative to its first vertex, and its vector area (equation 2; the centroid
    // cancels).
    let local = |k: usize| sub(positions[ring[k % m] as usize], origin);
    let (mut c, mut mean) = ([0.0; 3], [0.0; 3]);
    for k in 0..m {
        c = add_scaled(c, cross(local(k + 1), local(k)), 1.0);
        mean = add_scaled(mean, local(k), 1.0 / m as f64);
    }
    let spread = (0..m).map(|k| dot(sub(local(k), mean), sub(local(k), mean))).sum::<f64>() / m as f64;
    let area = length(c);
    // A regular ring has less and less of it the longer it is; it has a normal all the same.
    if !(area > LEAST_AREA * spread * m.min(LONGEST) as f64) || !area.is_finite() {
        return None;
    }
    let normal = scale(c, 1.0 / area);
    // A basis of the plane, as far from the normal as it gets.
    let axis = (0..3).min_by(|&i, &j| normal[i].abs().total_cmp(&normal[j].abs()))?;
    let mut e1 = [0.0; 3];
    e1[axis] = 1.0;
    e1 = add_scaled(e1, normal, -normal[axis]);
    let e1 = scale(e1, 1.0 / length(e1));
    let e2 = cross(normal, e1);
    let points: Vec<[f64; 2]> = ring
        .iter()
        .map(|&k| {
            let s = sub(positions[k as usize], at);
            [dot(s, e1), dot(s, e2)]
        })
        .collect();
    let size = mean_value_weights(&points, w)?;
    if size > LARGEST_WEIGHTS {
        return None;
    }
    let tau = REGULARISATION * REGULARISATION * spread;
    for k in 0..m {
        let h = dot(sub(at, positions[ring[k] as usize]), normal);
        b[k] = h / (points[k][0] * points[k][0] + points[k][1] * points[k][1] + tau).sqrt();
    }
    let error = length(sub(ring_value(positions, ring, w, b), at));
    (error <= LARGEST_ERROR * size * spread.sqrt()).then_some(size)
}

/// Three vertices near `v` in whose triangle it can be encoded, for a vertex whose ring cannot
/// serve (two neighbours at a corner, a ring on a line or crossing itself): of the vertices within
/// two, else three rings of `v` those with the best shaped triangle and the smallest weights.
///
/// `short` gives the ring of a vertex if that is not long ([`LONGEST`]): whoever has thousands of
/// neighbours says nothing about which vertices are near, and as many vertices would look through
/// them all.
pub(crate) fn substitute<'a>(
    positions: &[V3<f64>],
    v: u32,
    ring: &[u32],
    short: &impl Fn(u32) -> Option<&'a [u32]>,
) -> Option<[u32; 3]> {
    let mut near = ring.to_vec();
    for _ in 0..2 {
        let wider: Vec<u32> = near.iter().filter_map(|&u| short(u)).flatten().copied().collect();
        near.extend(wider);
        near.sort_unstable();
        near.dedup();
        near.retain(|&u| u != v);
        if let Some(found) = best_triangle(positions, v, &near) {
            return Some(found);
        }
    }
    None
}

fn best_triangle(positions: &[V3<f64>], v: u32, near: &[u32]) -> Option<[u32; 3]> {
    let distance = |u: u32| length(sub(positions[u as usize], positions[v as usize]));
    let mut candidates: Vec<(f64, u32)> = near.iter().map(|&u| (distance(u), u)).collect();
    let order = |a: &(f64, u32), b: &(f64, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
    if candidates.len() > SUBSTITUTES {
        candidates.select_nth_unstable_by(SUBSTITUTES, order);
        candidates.truncate(SUBSTITUTES);
    }
    candidates.sort_unstable_by(order);
    let place: Vec<V3<f64>> = candidates.iter().map(|c| positions[c.1 as usize]).collect();
    let n = place.len();
    let mut squares = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..i {
            let e = sub(place[i], place[j]);
            squares[i * n + j] = dot(e, e);
        }
    }
    let mut best: Option<(f64, [u32; 3])> = None;
    for i in 2..n {
        for j in 1..i {
            for k in 0..j {
                let triangle = [candidates[k], candidates[j], candidates[i]];
                let far: f64 = triangle.iter().map(|c| c.0).sum();
                if best.is_some_and(|b| far > BEST_SHAPE * b.0) {
                    continue;
                }
                let normal = cross(sub(place[j], place[k]), sub(place[i], place[k]));
                let sides = squares[j * n + k] + squares[i * n + k] + squares[i * n + j];
                // Nearly all that are looked at among needles.
                if dot(normal, normal) < 0.99 * (LEAST_SHAPE * sides).powi(2) {
                    continue;
                }
                let triangle = triangle.map(|c| c.1);
                let shape = length(normal) / sides;
                // A right-angled triangle has 0.25.
                if !(shape > LEAST_SHAPE) || !(best.is_none_or(|b| far / shape < b.0)) {
                    continue;
                }
                let (mut w, mut b) = ([0.0; 3], [0.0; 3]);
                if encode_ring(positions, v, &triangle, &mut w, &mut b).is_some_and(|size| size < 20.0) {
                    best = Some((far / shape, triangle));
                }
            }
        }
    }
    best.map(|b| b.1)
}

/// The stencils of all vertices of a mesh, those with no usable ring by [`substitute`] triangles.
#[derive(Clone, Debug, Default)]
pub(crate) struct Encoded {
    pub(crate) stencils: Stencils,
    pub(crate) encoding: Encoding<f64>,
    /// Vertices encoded in a substitute triangle.
    pub(crate) substituted: Vec<u32>,
    /// Vertices with neighbours that could not be encoded at all.
    pub(crate) left_out: Vec<u32>,
}

impl Encoded {
    /// Encodes the vertices of `rings` for which `wanted` holds.
    pub(crate) fn new(rings: &[Vec<u32>], positions: &[V3<f64>], wanted: impl Fn(u32) -> bool) -> Self {
        let mut result = Self::default();
        let mut rows: Vec<(u32, &[u32])> = Vec::with_capacity(rings.len());
        let mut triangles: Vec<(u32, [u32; 3])> = Vec::new();
        let (mut w, mut b) = (Vec::new(), Vec::new());
        for v in (0..rings.len() as u32).filter(|&v| !rings[v as usize].is_empty() && wanted(v)) {
            let ring = rings[v as usize].as_slice();
            let base = w.len();
            w.resize(base + ring.len(), 0.0);
            b.resize(base + ring.len(), 0.0);
            if encode_ring(positions, v, ring, &mut w[base..], &mut b[base..]).is_some() {
                rows.push((v, ring));
                continue;
            }
            w.truncate(base);
            b.truncate(base);
            let short = |u: u32| Some(rings[u as usize].as_slice()).filter(|ring| ring.len() <= LONGEST);
            match substitute(positions, v, ring, &short) {
                Some(triangle) => {
                    let (mut tw, mut tb) = ([0.0; 3], [0.0; 3]);
                    encode_ring(positions, v, &triangle, &mut tw, &mut tb);
                    w.extend(tw);
                    b.extend(tb);
                    result.substituted.push(v);
                    triangles.push((v, triangle));
                    rows.push((v, &[]));
                }
                None => result.left_out.push(v),
            }
        }
        let mut substitutes = triangles.iter();
        let rows = rows.into_iter().map(|(v, ring)| match ring {
            [] => (v, substitutes.next().map_or(&[][..], |t| &t.1[..])),
            _ => (v, ring),
        });
        result.stencils = Stencils::new(rings.len(), rows);
        result.encoding = Encoding { w, b };
        result
    }
}

#[cfg(test)]
mod tests {
    use super::super::Connectivity;
    use super::*;
    use crate::geometry::Mesh;
    use crate::models::shapes::{Diagonal, lobed_sphere, plane_grid, torus, tube, uv_sphere};

    pub(crate) fn flat(mesh: &Mesh) -> Vec<V3<f64>> {
        mesh.positions.iter().map(|p| p.to_array()).collect()
    }

    fn worst(encoded: &Encoded, positions: &[V3<f64>]) -> f64 {
        let s = &encoded.stencils;
        (0..s.row_count())
            .map(|r| {
                let slots = s.slots(r);
                let (w, b) = (&encoded.encoding.w[slots.clone()], &encoded.encoding.b[slots]);
                length(sub(ring_value(positions, s.ring(r), w, b), positions[s.vertex[r] as usize]))
            })
            .fold(0.0, f64::max)
    }

    #[test]
    fn meshes_of_every_kind_are_reproduced() {
        // Closed, with poles of many neighbours, of genus 1, open with straight boundaries and
        // corners, an open tube, one triangle pair.
        let single = Mesh::of_triangles(
            "pair",
            [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.1], [0.0, 1.0, 0.3]].map(glam::DVec3::from).to_vec(),
            &[[0, 1, 2], [0, 2, 3]],
        );
        for (mesh, substituted) in [
            (lobed_sphere(3, 0.5), 0),
            (uv_sphere(1.0, 40, 12), 0),
            (torus(2.0, 0.7, 24, 12, Diagonal::Forward), 0),
            (plane_grid(6, 5, 3.0, 2.0, Diagonal::Forward), 2),
            (tube(1.0, 3.0, 12, 8, Diagonal::Alternating), 0),
            (single, 2),
        ] {
            let positions = flat(&mesh);
            let encoded = Encoded::new(&Connectivity::new(&mesh).rings, &positions, |_| true);
            assert!(encoded.left_out.is_empty(), "{}", mesh.name);
            assert_eq!(encoded.substituted.len(), substituted, "{}", mesh.name);
            assert_eq!(encoded.stencils.row_count(), mesh.vertex_count());
            assert!(worst(&encoded, &positions) < 2e-14, "{}: {}", mesh.name, worst(&encoded, &positions));
            // Similarity: turned, scaled, moved far away.
            let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 1.0, -2.0, 3.1);
            let image = |p: &glam::DVec3| (turn * *p * 7.0 + glam::DVec3::new(3.0, -2.0, 5.0)).to_array();
            let moved: Vec<V3<f64>> = mesh.positions.iter().map(image).collect();
            assert!(worst(&encoded, &moved) < 1e-12, "{}: {}", mesh.name, worst(&encoded, &moved));
            // The check must see a changed vertex.
            let mut wrong = positions.clone();
            wrong[1][0] += 1e-6;
            assert!(worst(&encoded, &wrong) > 1e-8);
        }
    }

    #[test]
    fn around_a_vertex_of_many_all_are_encoded_by_what_is_near() {
        // A double cone: the rings of its rim have hardly any area, and its tips have it all.
        let mesh = uv_sphere(1.0, 10_000, 2);
        let rings = Connectivity::new(&mesh).rings;
        let positions = flat(&mesh);
        let encoded = Encoded::new(&rings, &positions, |_| true);
        assert!(encoded.left_out.is_empty(), "{:?}", encoded.left_out);
        assert!(encoded.substituted.len() > 9000, "{}", encoded.substituted.len());
        assert!(worst(&encoded, &positions) < 1e-10, "{}", worst(&encoded, &positions));
        // Without the tips' rings: each looks at a few vertices.
        let looks = std::cell::Cell::new(0);
        for v in (1..2001).step_by(100) {
            let short = |u: u32| {
                let ring = Some(rings[u as usize].as_slice()).filter(|ring| ring.len() <= LONGEST);
                looks.set(looks.get() + ring.map_or(0, <[u32]>::len));
                ring
            };
            assert!(substitute(&positions, v, &rings[v as usize], &short).is_some());
        }
        assert!(looks.get() < 20 * 64, "{}", looks.get());
    }

    #[test]
    fn rings_that_cannot_serve_are_refused() {
        let mut w = [0.0; 4];
        let mut b = [0.0; 4];
        let ring = [1, 2, 3, 4];
        let mut encode = |p: [V3<f64>; 5]| encode_ring(&p, 0, &ring, &mut w, &mut b);
        // On a line; all at one place; a figure eight without area; not a number.
        assert_eq!(encode([[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]), None);
        assert_eq!(encode([[0.0; 3], [1.0; 3], [1.0; 3], [1.0; 3], [1.0; 3]]), None);
        assert_eq!(encode([[0.0; 3], [-1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, 1.0, 0.0]]), None);
        assert_eq!(encode([[f64::NAN; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]), None);
        // Above a neighbour, and far outside: both are fine.
        assert!(
            encode([[1.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]).is_some()
        );
        assert!(
            encode([[3.0, 1.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]).is_some()
        );
    }
}
