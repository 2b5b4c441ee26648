//! Maps in the plane on the CPU in single precision, against double precision.

use barymap::engine::Engine;
use barymap::geometry::{Polygon, Side};
use barymap::mapping::plane::{
    CompositeMap, Coordinates, Lattice, LatticeOptions, Preimages, Step, map_points, map_points_with_derivatives,
};
use barymap::models::polygons::twisted_star;
use glam::{DVec2, UVec2};

use crate::plane_cases::{
    Case, check_accuracy, drift, far_fault, far_points, mapped, notched, pairs, points, to_regular,
};

#[test]
fn single_precision_keeps_its_bounds() {
    check_accuracy(&Engine::cpu());
}

#[test]
fn one_point_at_a_time_keeps_them_too() {
    // The scalar reference in single precision, which the kernels mirror.
    for (name, pair) in pairs() {
        let case = Case::new(&name, &pair, 1.0, glam::DVec2::ZERO);
        let points = points(&case, 12);
        let each: Vec<_> = points.inside.iter().map(|p| case.step.evaluate(*p)).collect();
        let found = crate::plane_cases::Mapped {
            images: each.iter().map(|e| e.point).collect(),
            derivatives: each.iter().map(|e| e.derivative).collect(),
        };
        assert_eq!(crate::plane_cases::fault(&case, &points, &found), None);
        let far = far_points(&case);
        let images: Vec<_> = far.iter().map(|p| case.step.map(*p)).collect();
        assert_eq!(far_fault(&case, &far, &images), None);
    }
}

#[test]
fn four_thousand_vertices_are_mapped() {
    // Small teeth, and notches a third of the radius deep between edges that all but touch.
    for depth in [0.001, 0.15] {
        let case = Case::new("4096", &notched(4096, depth), 1.0, glam::DVec2::ZERO);
        let points = points(&case, 10);
        let found = mapped(&Engine::cpu(), &case.step, &points.inside);
        assert_eq!(crate::plane_cases::fault(&case, &points, &found), None);
    }
}

#[test]
fn composites_do_not_drift() {
    // 0.05 pixels of 4,096 after 512 steps; fewer steps in proportion, so that the test is quick.
    for (n, steps) in [(8, 512), (64, 128)] {
        let found = drift(&Engine::cpu(), n, steps) * 4096.0;
        assert!(found <= 0.05 * steps as f64 / 512.0, "{n} vertices, {steps} steps: {found} pixels");
    }
}

#[test]
fn the_reference_back_end_works_in_double_precision() {
    let case = Case::new("regular 8", &to_regular(8), 1.0, glam::DVec2::ZERO);
    let points = points(&case, 20);
    let found = mapped(&Engine::reference(), &case.step, &points.inside);
    for (p, q) in points.inside.iter().zip(&found.images) {
        let truth = case.truth.map(p.map(f64::from)).map(|x| x as f32);
        assert!((q[0] - truth[0]).abs() <= 6e-8 && (q[1] - truth[1]).abs() <= 6e-8);
    }
}

#[test]
fn threads_do_not_matter_and_lists_must_match() {
    let case = Case::new("regular 64", &to_regular(64), 1.0, glam::DVec2::ZERO);
    let points = points(&case, 40);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let alone = one.install(|| mapped(&Engine::cpu(), &case.step, &points.inside));
    let many = mapped(&Engine::cpu(), &case.step, &points.inside);
    assert!(alone.images == many.images && alone.derivatives == many.derivatives);
    let refused =
        map_points_with_derivatives(&Engine::cpu(), std::slice::from_ref(&case.step), &mut [[0.0; 2]; 2], &mut []);
    assert!(refused.unwrap_err().to_string().contains("2 points"));
    map_points(&Engine::cpu(), std::slice::from_ref(&case.step), &mut []).unwrap();
    let mut still = [[0.25, 0.5]];
    map_points(&Engine::cpu(), &[], &mut still).unwrap();
    assert_eq!(still, [[0.25, 0.5]], "no steps, no change");
}

#[test]
fn hostile_steps_do_not_panic() {
    let ring = |points: &[[f64; 2]]| {
        barymap::geometry::Polygon::from_loops(vec![points.iter().map(|p| glam::DVec2::from(*p)).collect()])
    };
    let polygons = [
        ring(&[]),
        ring(&[[0.0, 0.0]]),
        ring(&[[0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]),
        ring(&[[f64::NAN, 0.0], [1.0, f64::INFINITY], [0.0, 1e300]]),
        ring(&[[0.0, 0.0], [1e-300, 0.0], [0.0, 1e-300]]),
        barymap::geometry::Polygon::from_loops(vec![]),
    ];
    for polygon in &polygons {
        for coordinates in [Coordinates::MeanValue, Coordinates::Wachspress] {
            let step = Step::<f32>::new(coordinates, polygon, polygon, 1.0);
            if polygon.vertex_count() > 0 {
                step.evaluate([0.1, 0.2]);
            }
            let mut points = [[0.0; 2], [f32::NAN; 2], [f32::INFINITY, 1.0], [1e38, -1e38]];
            map_points(&Engine::cpu(), std::slice::from_ref(&step), &mut points).unwrap();
        }
    }
}

#[test]
fn every_pixel_of_a_large_picture_has_an_exact_pre_image() {
    const SIDE: u32 = 2048;
    // Every step has J >= 0.05: .171, .100, .321 and .158.
    let pair = twisted_star();
    let at = |t: f64| {
        let (a, b) = (pair.source.vertices(), pair.target.vertices());
        let place = |v: DVec2| (v + 1.02) * (f64::from(SIDE) / 2.04);
        Polygon::from_loops(vec![a.zip(b).map(|(a, b)| place(a.lerp(b, t))).collect()])
    };
    let map = CompositeMap::new(Coordinates::MeanValue, [0.0, 0.5, 0.75, 0.875, 1.0].map(at).to_vec()).unwrap();
    let engine = Engine::cpu();
    let lattice = Lattice::new(DVec2::ZERO, DVec2::splat(f64::from(SIDE)), &LatticeOptions::default(), |p| {
        map.images_of_points(&engine, p)
    })
    .unwrap();
    let rough = Preimages::of(&lattice, DVec2::ZERO, UVec2::splat(SIDE));
    let (mut pixels, mut guesses) = (Vec::new(), Vec::new());
    for i in 0..SIDE * SIDE {
        let q = DVec2::new(f64::from(i % SIDE), f64::from(i / SIDE)) + 0.5;
        if map.target().contains(q) == Side::Inside {
            assert!(rough.covered[i as usize], "the lattice misses pixel {q}");
            pixels.push(q);
            guesses.push(DVec2::from(rough.points[i as usize].map(f64::from)));
        }
    }
    assert!(pixels.len() > 600_000, "{}", pixels.len());
    let found = map.inverse_points(&engine, &pixels, Some(&guesses)).unwrap();
    let points: Vec<DVec2> = found.iter().map(|p| p.expect("one pre-image each").point).collect();
    let back = map.images_of_points(&Engine::reference(), &points).unwrap();
    let worst = pixels.iter().zip(&back).map(|(q, b)| (*q - *b).length()).fold(0.0, f64::max);
    assert!(worst <= 1e-3, "{worst} pixels");
    let rough_worst = pixels.iter().zip(map.images_of_points(&Engine::reference(), &guesses).unwrap());
    assert!(rough_worst.map(|(q, b)| (*q - b).length()).fold(0.0, f64::max) > 1e-3, "the measure sees rough starts");
}
