//! Maps on a device do not depend on where the meshes lie and how large they are.

use barymap::engine::Engine;

use crate::similar::{Difference, Motion, Pair, Way, difference, off_the_grid, ways};
use crate::surface::P99;
use crate::{downlevel, engine};

/// Two maps in single precision, each as near to the truth as kernels are held to.
fn agrees(d: &Difference, input: f64) -> Result<(), String> {
    let ok = d.quantile(0.5) <= 2.0 * 5e-6 + input
        && d.quantile(0.99) <= 2.0 * P99 + input
        && d.statuses * 200 <= d.distances.len();
    if ok { Ok(()) } else { Err(format!("{:?}, {} statuses", [0.5, 0.99, 1.0].map(|q| d.quantile(q)), d.statuses)) }
}

/// The methods that have kernels.
fn kernels() -> Vec<Way> {
    ways(false)[..3].to_vec()
}

fn exactly(engine: &Engine, motions: &[(Motion, Motion)]) {
    let rest = Pair::moved(&Motion::NONE, &Motion::NONE);
    let maps: Vec<_> = kernels().into_iter().map(|way| (way, rest.map(&way, Some(engine)))).collect();
    for (source, target) in motions {
        let moved = Pair::moved(source, target);
        for (way, images) in &maps {
            assert!(moved.map(way, Some(engine)) == *images, "{way:?} {source:?} {target:?}");
        }
    }
}

fn nearly(engine: &Engine) {
    let rest = Pair::of(off_the_grid(), &Motion::NONE, &Motion::NONE);
    let edge = rest.source.mesh.mean_edge_length();
    let far = Motion::shift(5e5 + 0.1, 4.6e6 + 0.7, 300.3);
    let moved = Pair::of(off_the_grid(), &far, &Motion::scale(1e-6));
    for way in kernels() {
        let images = rest.map(&way, Some(engine));
        let d = difference(&moved.map(&way, Some(engine)), &images, &rest.source.mesh);
        agrees(&d, 100.0 * far.rounding(edge)).unwrap_or_else(|e| panic!("{way:?}: {e}"));
        // The comparator sees one image in fifty moved by a fiftieth of an edge.
        let mut wrong = images.clone();
        wrong.iter_mut().step_by(50).for_each(|i| i.b0 += 0.02 * if i.b0 > 0.5 { -1.0 } else { 1.0 });
        assert!(agrees(&difference(&wrong, &images, &rest.source.mesh), 0.0).is_err());
    }
}

#[test]
fn exact_shifts_and_scales_change_no_bit() {
    let far = Motion::shift(500_000.0, 4_600_000.0, 300.0);
    let small = Motion { scale: 2f64.powi(-20), ..Motion::shift(1e7, -9e6, 1.0) };
    if let Some(engine) = engine() {
        exactly(engine, &[(far, Motion::NONE), (Motion::scale(2f64.powi(20)), small)]);
    }
    if let Some(engine) = downlevel() {
        exactly(engine, &[(small, far)]);
    }
}

#[test]
fn inexact_ones_change_what_rounding_explains() {
    if let Some(engine) = engine() {
        nearly(engine);
    }
}
