//! Composites: twisted cubes, round trips, inverses, partitions.

use glam::DVec3;

use super::testing::box_cage;
use super::*;
use crate::engine::Engine;
use crate::error::Result;
use crate::progress::Quiet;

/// A cube of `n` x `n` quads a side, and the same with its top turned about the y axis by `degrees`
/// against the bottom, most of it in the middle.
fn twisted(n: usize, degrees: f64) -> Cage {
    let (triangles, source) = box_cage(n);
    Cage { triangles, target: source.iter().map(|&p| turned(p, degrees)).collect(), source: source.clone() }
}

fn turned(p: DVec3, degrees: f64) -> DVec3 {
    glam::DQuat::from_rotation_y(degrees.to_radians() * (2.7 * p.y).clamp(-0.5, 0.5)) * p
}

/// The twist itself as a path.
struct Twist<'a>(&'a Cage, f64);

impl VertexPath for Twist<'_> {
    fn positions(&self, t: f64) -> Result<Vec<DVec3>> {
        Ok(self.0.source.iter().map(|&p| turned(p, self.1 * t)).collect())
    }

    fn name(&self) -> &str {
        "twist"
    }
}

fn inside(count: usize) -> Vec<DVec3> {
    let mut random = crate::models::shapes::Random::new(11);
    (0..count).map(|_| 0.49 * DVec3::new(random.signed(), random.signed(), random.signed())).collect()
}

fn cut(cage: &Cage, path: &dyn VertexPath, kind: PartitionKind, model: &[DVec3]) -> Partition {
    let options = PartitionOptions { kind, resolution: 12, ..PartitionOptions::default() };
    partition(&Engine::cpu(), cage, path, model, &options, &Quiet).unwrap()
}

fn composite(cage: &Cage, found: &Partition) -> CompositeMap {
    CompositeMap::new(cage.triangles.clone(), found.polyhedra.clone()).unwrap()
}

#[test]
fn a_cube_twisted_by_90_degrees_folds_directly_and_not_in_steps() {
    // Cut into nine quads a side; and the bare cube, by 80 degrees: by 90 its diagonals meet on the
    // axis.
    for (n, degrees) in [(3, 90.0), (1, 80.0), (1, -80.0)] {
        let cage = twisted(n, degrees);
        let path = Twist(&cage, degrees);
        let model = inside(500);
        let direct = cut(&cage, &path, PartitionKind::Direct, &model);
        assert!(direct.folds() && direct.intersections.is_empty(), "{n}: {direct:?}");
        for kind in [PartitionKind::Binary, PartitionKind::Continuous] {
            let found = cut(&cage, &path, kind, &model);
            assert!(!found.folds() && found.intersections.is_empty(), "{n} {kind:?}: {:?}", found.steps);
            assert!(found.steps.len() > 1 && found.knots.windows(2).all(|k| k[0] < k[1]));
            // The composite turns no point over, and none leaves the cage.
            let images = composite(&cage, &found).forward(&model);
            assert!(images.iter().all(|m| m.jacobian() > 0.0));
            let points: Vec<DVec3> = images.iter().map(|m| m.point).collect();
            let map = composite(&cage, &found);
            assert!(map.inside(map.step_count(), &points).into_iter().all(|inside| inside));
        }
        // The direct map does turn points over.
        assert!(composite(&cage, &direct).forward(&model).iter().any(|m| m.jacobian() < 0.0));
    }
}

#[test]
fn the_identity_is_one_step_with_the_jacobian_one() {
    let (triangles, source) = box_cage(2);
    let cage = Cage { triangles, target: source.clone(), source };
    for kind in [PartitionKind::Direct, PartitionKind::Uniform(3), PartitionKind::Binary, PartitionKind::Continuous] {
        let found = cut(&cage, &Linear::new(&cage), kind, &inside(50));
        assert!(found.steps.iter().all(|s| s.minimum.value == 1.0), "{:?}", found.steps);
        assert_eq!(found.steps.len(), if kind == PartitionKind::Uniform(3) { 3 } else { 1 });
    }
}

#[test]
fn round_trips_fall_like_one_over_m_and_the_inverse_is_exact() {
    let cage = twisted(3, 60.0);
    let path = Twist(&cage, 60.0);
    let points = inside(100);
    let mut products = Vec::new();
    for m in [8, 16, 32] {
        let map = composite(&cage, &cut(&cage, &path, PartitionKind::Uniform(m), &[]));
        let there = map.forward_points(&Engine::reference(), &points).unwrap();
        let back = map.backward().forward_points(&Engine::reference(), &there).unwrap();
        let off = points.iter().zip(&back).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        products.push(off * f64::from(m));
        for (p, found) in points.iter().zip(map.inverse(&there)) {
            let found = found.unwrap();
            assert!(found.point.distance(*p) < 1e-9, "{m} steps: {:e}", found.point.distance(*p));
            let forward = map.forward(&[*p])[0].derivative;
            assert!((found.derivative - forward).to_cols_array().iter().all(|d| d.abs() < 1e-6));
        }
        // Single precision on the way there.
        let single = map.forward_points(&Engine::cpu(), &points).unwrap();
        assert!(single.iter().zip(&there).all(|(a, b)| a.distance(*b) < 1e-5));
    }
    assert!(products[2] < 1.1 * products[1] && products[2] > 0.9 * products[1], "{products:?}");
    let nowhere = composite(&cage, &cut(&cage, &path, PartitionKind::Direct, &[])).inverse(&[DVec3::NAN]);
    assert!(nowhere[0].is_none());
}

#[test]
fn crossings_on_the_way_are_told_with_their_knots() {
    // A corner that goes in a circle through the opposite side, and back.
    let (triangles, source) = box_cage(2);
    let cage = Cage { triangles, target: source.clone(), source };
    struct Through<'a>(&'a Cage);
    impl VertexPath for Through<'_> {
        fn positions(&self, t: f64) -> Result<Vec<DVec3>> {
            let mut all = self.0.source.clone();
            all[0] *= 1.0 - 8.0 * t * (1.0 - t);
            Ok(all)
        }

        fn name(&self) -> &str {
            "through"
        }
    }
    let found = cut(&cage, &Through(&cage), PartitionKind::Uniform(4), &[]);
    let knots: Vec<f64> = found.intersections.iter().map(|i| i.knot).collect();
    assert_eq!(knots, [0.5]);
    assert!(found.intersections.iter().all(|i| i.pairs > 0 && i.first.0 < i.first.1));
}

#[test]
fn outside_is_told_from_inside() {
    let cage = twisted(3, 60.0);
    let map = CompositeMap::new(cage.triangles.clone(), vec![cage.source.clone(), cage.target.clone()]).unwrap();
    let mut random = crate::models::shapes::Random::new(2);
    let points: Vec<DVec3> = (0..300).map(|_| DVec3::new(random.signed(), random.signed(), random.signed())).collect();
    let within = map.inside(0, &points);
    for (p, inside) in points.iter().zip(within) {
        assert_eq!(inside, p.abs().max_element() < 0.5, "{p}");
    }
}

#[test]
fn options_out_of_range_are_refused() {
    let cage = twisted(1, 10.0);
    let path = Linear::new(&cage);
    let says = |options: PartitionOptions, word: &str| {
        let error = partition(&Engine::cpu(), &cage, &path, &[], &options, &Quiet).unwrap_err();
        assert!(matches!(error, crate::error::Error::Option { .. }) && error.to_string().contains(word), "{error}");
    };
    let options = PartitionOptions::default();
    says(PartitionOptions { eps: 0.0, ..options }, "option eps");
    says(PartitionOptions { eps: f64::NAN, ..options }, "option eps");
    says(PartitionOptions { resolution: 0, ..options }, "option resolution");
    says(PartitionOptions { resolution: 100_000, ..options }, "option resolution");
    says(PartitionOptions { kind: PartitionKind::Uniform(0), ..options }, "option partition");
    says(PartitionOptions { kind: PartitionKind::Uniform(u32::MAX), ..options }, "option partition");
    assert!(CompositeMap::new(cage.triangles.clone(), vec![cage.source.clone()]).is_err());
    assert!(CompositeMap::new(cage.triangles.clone(), vec![cage.source[..3].to_vec(), cage.target.clone()]).is_err());
}
