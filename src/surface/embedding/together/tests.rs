use super::*;
use crate::models::shapes::{icosphere, lobed_sphere, uv_sphere};

/// A square of n x n squares, sheared.
fn grid(n: u32, shear: f64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let at = |i: u32, j: u32| i * (n + 1) + j;
    let place = |i: u32, j: u32| DVec3::new(f64::from(j) + shear * f64::from(i), f64::from(i), 0.0) / f64::from(n);
    let positions = (0..=n).flat_map(|i| (0..=n).map(move |j| place(i, j))).collect();
    let squares = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
    let halves = |(i, j)| [[at(i, j), at(i, j + 1), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i + 1, j)]];
    (positions, squares.flat_map(halves).collect())
}

/// The mean and the largest relative difference between marches together and single ones.
fn difference(geodesics: &Geodesics, lanes: Lanes) -> (f64, f64) {
    let n = geodesics.vertex_count();
    let sources: Vec<usize> = (0..64).map(|k| k * n / 64).collect();
    let place: Vec<DVec3> = sources.iter().map(|&s| geodesics.positions[s]).collect();
    let (mut sum, mut most, mut count) = (0.0, 0.0f64, 0.0);
    let (mut memory, mut march) = (Together::default(), March::default());
    let all: Vec<u32> = (0..n as u32).collect();
    for group in groups(&place) {
        let own: Vec<u32> = group.iter().map(|&i| sources[i] as u32).collect();
        for (&source, row) in own.iter().zip(memory.rows(geodesics, &own, &all, lanes)) {
            geodesics.distances_from(source, &mut march);
            for v in (0..n).filter(|&v| v != source as usize) {
                let off = (row[v] / march.distances[v] - 1.0).abs();
                (sum, most, count) = (sum + off, most.max(off), count + 1.0);
            }
        }
    }
    (sum / count, most)
}

#[test]
fn distances_are_those_of_single_marches() {
    let of = |mesh: &crate::geometry::Mesh| Geodesics::of(&mesh.positions, &mesh.triangles());
    let (flat, sheared) = (grid(40, 0.0), grid(40, 2.5));
    for (name, geodesics) in [
        ("grid", Geodesics::of(&flat.0, &flat.1)),
        ("obtuse grid", Geodesics::of(&sheared.0, &sheared.1)),
        ("sphere", of(&icosphere(1.0, 4))),
        ("lobes", of(&lobed_sphere(4, 0.5))),
        ("thin triangles", of(&uv_sphere(1.0, 200, 16))),
    ] {
        for lanes in [Lanes::detect(), Lanes::scalar()] {
            let (mean, most) = difference(&geodesics, lanes);
            // Each of a hundred vertices on the way may be left up to REOPEN too far. What single
            // marches leave out depends on their own order: here and there one vertex.
            assert!(mean < 100.0 * REOPEN && most < 1e-2, "{name}: {mean:e} in the mean, {most:e} at most");
        }
    }
}

#[test]
fn a_matrix_is_that_of_single_marches_at_any_size() {
    let mesh = icosphere(1.0, 3);
    let (p, t) = (&mesh.positions, mesh.triangles());
    let sources: Vec<u32> = (0..75).map(|k| k * 3).collect();
    let single = Geodesics::of(p, &t);
    let mut march = March::default();
    for size in [1.0, 2f64.powi(100), 2f64.powi(-100)] {
        let scaled: Vec<DVec3> = p.iter().map(|p| *p * size).collect();
        let matrix = matrix(&Geodesics::of(&scaled, &t), &sources, || Ok(())).unwrap();
        for (i, &source) in sources.iter().enumerate() {
            single.distances_from(source, &mut march);
            for (j, &target) in sources.iter().enumerate() {
                let (d, e) = (matrix[i * sources.len() + j] / size, march.distances[target as usize]);
                assert!((d - e).abs() <= 1e-3 * e, "{source} to {target} at {size:e}: {d} and {e}");
            }
        }
    }
}

#[test]
fn groups_are_near_and_hold_every_point_once() {
    let points: Vec<DVec3> = (0..75).map(|k| DVec3::new(f64::from(k * 7 % 75), f64::from(k % 2), 0.0)).collect();
    let groups = groups(&points);
    assert!(groups[..9].iter().all(|g| g.len() == TOGETHER) && groups[9].len() == 3);
    let mut all = groups.concat();
    all.sort_unstable();
    assert_eq!(all, (0..75).collect::<Vec<_>>());
    for group in groups {
        let x: Vec<f64> = group.iter().map(|&i| points[i].x).collect();
        let spread = x.iter().copied().fold(0.0, f64::max) - x.iter().copied().fold(75.0, f64::min);
        assert_eq!(spread, x.len() as f64 - 1.0);
    }
    assert!(super::groups(&[]).is_empty());
}

#[test]
fn what_is_not_reached_is_infinitely_far() {
    let (p, t) = grid(12, 0.2);
    let far: Vec<DVec3> = p.iter().map(|p| *p + DVec3::Z).collect();
    let shift = p.len() as u32;
    let both = [p.clone(), far].concat();
    let triangles: Vec<[u32; 3]> = t.iter().copied().chain(t.iter().map(|t| t.map(|v| v + shift))).collect();
    let geodesics = Geodesics::of(&both, &triangles);
    // Four sources on either part, one of them twice.
    let sources = [0, 1, 14, 14, shift, shift + 1, shift + 13, shift + 14];
    let mut memory = Together::default();
    assert!(!memory.march(&geodesics, &sources, 10, Lanes::detect()));
    assert!(memory.march(&geodesics, &sources, MOST_MARCHES * both.len(), Lanes::detect()));
    for v in 0..2 * shift {
        for (l, &s) in sources.iter().enumerate() {
            assert_eq!(memory.distance(v, l).is_finite(), (v < shift) == (s < shift), "{v} from {s}");
        }
    }
    assert_eq!(memory.distance(14, 2), 0.0);
}
