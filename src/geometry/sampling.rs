//! Well-spread samples of the vertices of a mesh.

use super::geodesics::{Geodesics, March};

/// Distances closer than this part of the largest count as equal, so that rounding does not choose
/// between symmetric places.
const TIE: f64 = 1e-9;

/// The lowest of the vertices that are farthest away among the reached ones, with its distance.
fn farthest(distances: &[f64]) -> Option<(u32, f64)> {
    let largest = distances.iter().copied().filter(|d| d.is_finite()).fold(-1.0, f64::max);
    let v = distances.iter().position(|&d| d.is_finite() && d >= largest * (1.0 - TIE))?;
    Some((v as u32, distances[v]))
}

/// Up to `count` vertices of the component of vertex `seed`, each farthest from all before it.
///
/// The first is the vertex farthest from `seed`, so that the samples begin at an extremity whatever
/// the seed is. Fewer are returned if the component has no more vertices apart from one another.
/// Ties go to the lowest vertex. Time: about ln(`count`) marches over the component and `count`
/// passes over the vertices. None if there is no vertex `seed`.
pub fn farthest_points(geodesics: &Geodesics, seed: u32, count: usize) -> Vec<u32> {
    let mut march = March::default();
    geodesics.distances_from(seed, &mut march);
    let Some((first, size)) = farthest(&march.distances) else { return Vec::new() };
    let mut samples = Vec::new();
    geodesics.clear(&mut march);
    let mut next = first;
    while samples.len() < count {
        samples.push(next);
        geodesics.add_source(next, &mut march);
        match farthest(&march.distances) {
            Some((v, d)) if d > TIE * size => next = v,
            _ => break,
        }
    }
    samples
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    /// A strip of `n` squares along x.
    fn strip(n: u32) -> Geodesics {
        let positions: Vec<DVec3> =
            (0..=n).flat_map(|i| [DVec3::new(f64::from(i), 0.0, 0.0), DVec3::new(f64::from(i), 0.1, 0.0)]).collect();
        let triangles: Vec<[u32; 3]> =
            (0..n).flat_map(|i| [[2 * i, 2 * i + 2, 2 * i + 3], [2 * i, 2 * i + 3, 2 * i + 1]]).collect();
        Geodesics::of(&positions, &triangles)
    }

    #[test]
    fn samples_start_at_the_ends_and_halve_the_gaps() {
        let g = strip(8);
        let s = farthest_points(&g, 8, 3);
        let x: Vec<u32> = s.iter().map(|v| v / 2).collect();
        assert!(x[..2] == [0, 8] || x[..2] == [8, 0], "{x:?}");
        assert_eq!(x[2], 4);
    }

    #[test]
    fn no_more_than_there_are() {
        let mut s = farthest_points(&strip(2), 0, 100);
        s.sort_unstable();
        assert_eq!(s, vec![0, 1, 2, 3, 4, 5]);
    }
}
