//! Maps do not depend on where the meshes lie, how large they are and how they are turned.

use barymap::geometry::{Mesh, SurfacePoint, Topology};
use barymap::surface::AnchorPairs;
use barymap::surface::PackedImage;
use barymap::surface::anchors::vertex_point;
use barymap::surface::quality::{Distortion, distortion, vertex_normals};
use glam::DVec3;

use crate::common::{data, load};
use crate::similar::{
    Difference, Motion, Pair, Rest, Side, Way, at_rest, difference, exact, off_the_grid, sides, snapped, valid, ways,
};

/// Images of the vertices come first.
fn quality(pair: &Pair, images: &[PackedImage]) -> Distortion {
    let count = pair.target.mesh.vertex_count();
    let places: Vec<Option<DVec3>> =
        images[..count].iter().map(|i| i.point().map(|p| p.position(&pair.source.mesh))).collect();
    let all = vertex_normals(&pair.source.mesh, &pair.source.topology);
    let normal = |i: &PackedImage| {
        i.point().map_or(DVec3::ZERO, |p| barymap::surface::quality::normal_at(&pair.source.mesh, &all, &p))
    };
    let normals: Vec<DVec3> = images[..count].iter().map(normal).collect();
    distortion(&pair.target.mesh, &pair.target.topology, &places, &normals, pair.source.mesh.area())
}

fn all_ways() -> Vec<Way> {
    [ways(true), ways(false)].concat()
}

#[test]
fn exact_shifts_and_scalings_by_powers_of_two_change_no_bit() {
    let rest = Pair::moved(&Motion::NONE, &Motion::NONE);
    let maps: Vec<_> = all_ways().into_iter().map(|way| (way, rest.map(&way, None))).collect();
    for (i, motion) in exact().into_iter().enumerate() {
        // All motions, each on another side; the first on every one.
        let chosen = if i == 0 { sides(motion).to_vec() } else { vec![sides(motion)[i % 3]] };
        for (source, target) in chosen {
            let moved = Pair::moved(&source, &target);
            for (side, other, scale) in
                [(&moved.source, &rest.source, source.scale), (&moved.target, &rest.target, target.scale)]
            {
                assert_eq!(side.embedding.landmarks, other.embedding.landmarks, "{motion:?}");
                let scaled: Vec<f64> = other.embedding.points.iter().map(|x| x * scale).collect();
                assert!(side.embedding.points == scaled, "the embedding is the same, {motion:?}");
            }
            // Both precisions in turns: the first motion in both.
            for (way, images) in maps.iter().filter(|(way, _)| i == 0 || way.double == (i % 2 == 0)) {
                let found = moved.map(way, None);
                let differ = found.iter().zip(images).filter(|(a, b)| a != b).count();
                assert_eq!(differ, 0, "of {} images, {way:?} {source:?} {target:?}", images.len());
            }
        }
    }
    // What must be refused: a source that is bent.
    let Rest { mut source, target, anchors, .. } = at_rest();
    source.positions.iter_mut().for_each(|p| p.x += 1e-3 * p.y * p.y);
    let bent = Pair { source: Side::new(source), target: Side::new(target), anchors };
    assert!(maps.iter().all(|(way, images)| bent.map(way, None) != *images));
}

/// Largest difference in double precision that rounding explains, in mean edges.
fn bound(pair: &Pair, motion: &Motion) -> f64 {
    1e-6 + 100.0 * motion.rounding(pair.source.mesh.mean_edge_length())
}

fn agrees(d: &Difference, way: &Way, most: f64) -> Result<(), String> {
    // In single precision as the kernels are held to: tests/gpu/surface.rs.
    let ok = if way.double {
        d.quantile(1.0) <= most && d.statuses == 0
    } else {
        d.quantile(0.5) <= 2e-5 && d.quantile(0.99) <= 1e-4 + most && d.statuses * 200 <= d.distances.len()
    };
    let what = format!(
        "{way:?}: median {:.1e}, 99 % {:.1e}, largest {:.1e} of {most:.1e}; {} statuses",
        d.quantile(0.5),
        d.quantile(0.99),
        d.quantile(1.0),
        d.statuses
    );
    if ok { Ok(()) } else { Err(what) }
}

#[test]
fn inexact_shifts_and_scales_change_what_rounding_explains() {
    let rest = Pair::of(off_the_grid(), &Motion::NONE, &Motion::NONE);
    let maps: Vec<_> = all_ways().into_iter().map(|way| (way, rest.map(&way, None))).collect();
    let third = 1.0 / 3.0;
    let motions = [
        Motion::scale(1e-6),
        Motion::scale(1e6),
        Motion::shift(1000.0 * third, 70.0 * third, -third),
        Motion::shift(500_000.0 + 0.1, 4_600_000.0 + 0.7, 300.3),
        Motion::shift(1e7 * third, -1e7 * third, 1e7),
        Motion { scale: 1e-3, ..Motion::shift(1e5 * third, 0.0, 1e4) },
    ];
    let mut failures = Vec::new();
    for (i, motion) in motions.into_iter().enumerate() {
        let (source, target) = sides(motion)[i % 3];
        let moved = Pair::of(off_the_grid(), &source, &target);
        for (way, images) in &maps {
            let d = difference(&moved.map(way, None), images, &rest.source.mesh);
            if let Err(what) = agrees(&d, way, bound(&rest, &motion)) {
                failures.push(format!("{motion:?} {what}"));
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    // The comparator sees one image in a hundred moved by a fiftieth of an edge, and statuses.
    for (way, images) in &maps {
        let mut wrong = images.clone();
        wrong.iter_mut().step_by(50).for_each(|i| i.b0 += 0.02 * if i.b0 > 0.5 { -1.0 } else { 1.0 });
        assert!(agrees(&difference(&wrong, images, &rest.source.mesh), way, 1e-4).is_err());
        let mut other = images.clone();
        other.iter_mut().step_by(100).for_each(|i| i.status = 2 - i.status.min(2));
        assert!(agrees(&difference(&other, images, &rest.source.mesh), way, 1e-4).is_err());
    }
}

/// Mean distance from the truth, in mean edges.
fn error(images: &[PackedImage], truth: &[SurfacePoint], source: &Mesh) -> f64 {
    let off = |(i, t): (&PackedImage, &SurfacePoint)| {
        i.point().map_or(10.0, |p| p.position(source).distance(t.position(source)) / source.mean_edge_length())
    };
    images.iter().zip(truth).map(off).sum::<f64>() / truth.len() as f64
}

#[test]
fn turns_leave_the_quality_of_maps() {
    let truth = at_rest().truth;
    let rest = Pair::moved(&Motion::NONE, &Motion::NONE);
    let maps: Vec<_> = all_ways().into_iter().map(|way| (way, rest.map(&way, None))).collect();
    let motions = [
        Motion::turn(DVec3::new(1.0, 2.0, -0.5), 71.0),
        Motion { shift: DVec3::new(5e5, 4.6e6, 300.0), ..Motion::turn(DVec3::new(-1.0, 0.3, 0.7), 163.0) },
        Motion { scale: 1e-6, ..Motion::turn(DVec3::X, 90.0) },
    ];
    let mut failures = Vec::new();
    for (i, motion) in motions.into_iter().enumerate() {
        let (source, target) = sides(motion)[i % 3];
        let moved = Pair::moved(&source, &target);
        for (way, images) in &maps {
            let found = moved.map(way, None);
            let (was, is) = (quality(&rest, images), quality(&moved, &found));
            let errors = [images, &found].map(|images| error(images, &truth, &rest.source.mesh));
            let within = |a: f64, b: f64| (a - b).abs() <= 0.01 * a.abs().max(b.abs()).max(0.01);
            let same = within(valid(images), valid(&found))
                && within(was.stretch_best95, is.stretch_best95)
                && within(was.flipped_area, is.flipped_area)
                && within(errors[0], errors[1]);
            if !same {
                failures.push(format!("{motion:?} {way:?}: {errors:?}, {was:?} {is:?}"));
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// The bodies of a man and a woman with 80 anchors: 13,000 vertices.
fn bodies() -> Rest {
    let [source, target] = ["man.obj", "woman.obj"].map(|f| snapped(load(&format!("gt/smpl_same/{f}"))));
    let [of_source, of_target] = [&source, &target].map(Topology::new);
    let text = std::fs::read_to_string(data("gt/smpl_same/anchors_80.txt")).unwrap();
    let mut anchors = AnchorPairs::default();
    for line in text.lines() {
        let pair: Vec<u32> = line.split_whitespace().map(|w| w.parse().unwrap()).collect();
        anchors.source.push(vertex_point(&source, &of_source, pair[0], "anchor").unwrap());
        anchors.target.push(vertex_point(&target, &of_target, pair[1], "anchor").unwrap());
    }
    // The same vertices.
    let truth = (0..target.vertex_count() as u32).filter_map(|v| of_source.vertex_point(v)).collect();
    Rest { source, target, anchors, truth }
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn a_real_pair_is_mapped_alike_in_map_coordinates() {
    let rest = Pair::of(bodies(), &Motion::NONE, &Motion::NONE);
    let far = Motion::shift(500_000.0, 4_600_000.0, 300.0);
    let moved = Pair::of(bodies(), &far, &Motion { scale: 2f64.powi(-10), ..Motion::NONE });
    for way in [ways(true)[2], ways(false)[2], ways(false)[5]] {
        let (a, b) = (rest.map(&way, None), moved.map(&way, None));
        assert!(a == b, "{way:?}: {} differ", a.iter().zip(&b).filter(|(a, b)| a != b).count());
        assert!(valid(&a) > 0.9, "{way:?}: {}", valid(&a));
    }
    // Rounded and turned: the same quality.
    let turned = Motion { turn: Motion::turn(DVec3::new(0.3, 1.0, 0.2), 40.0).turn, ..far };
    let turned = Pair::of(bodies(), &turned, &Motion::scale(1e-3));
    let way = ways(true)[2];
    let (a, b) = (rest.map(&way, None), turned.map(&way, None));
    let (was, is) = (quality(&rest, &a), quality(&turned, &b));
    assert!((valid(&a) - valid(&b)).abs() <= 0.01, "{} {}", valid(&a), valid(&b));
    assert!((was.stretch_best95 - is.stretch_best95).abs() <= 0.01, "{was:?} {is:?}");
    let errors = [&a, &b].map(|images| error(images, &bodies().truth, &rest.source.mesh));
    assert!((errors[0] - errors[1]).abs() <= 0.01 * errors[0], "{errors:?}");
}
