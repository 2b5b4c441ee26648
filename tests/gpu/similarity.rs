//! Maps on a device do not depend on where the meshes lie and how large they are.

use barymap::engine::Engine;

use crate::similar::{Difference, Motion, Pair, difference, exact, off_the_grid, sides, ways};
use crate::surface::P99;
use crate::{downlevel, engine};

/// Two maps in single precision, each as near to the truth as kernels are held to.
fn agrees(d: &Difference, input: f64) -> Result<(), String> {
    let ok = d.quantile(0.5) <= 2.0 * 5e-6 + input
        && d.quantile(0.99) <= 2.0 * P99 + input
        && d.statuses * 200 <= d.distances.len();
    if ok { Ok(()) } else { Err(format!("{:?}, {} statuses", [0.5, 0.99, 1.0].map(|q| d.quantile(q)), d.statuses)) }
}

fn agree(engine: &Engine) {
    let rest = Pair::moved(&Motion::NONE, &Motion::NONE);
    let maps: Vec<_> = ways(false).into_iter().map(|way| (way, rest.map(&way, Some(engine)))).collect();
    for (i, motion) in exact().into_iter().enumerate() {
        let (source, target) = sides(motion)[i % 3];
        let moved = Pair::moved(&source, &target);
        for (way, images) in &maps {
            assert!(moved.map(way, Some(engine)) == *images, "{way:?} {motion:?}");
        }
    }
    let rest = Pair::of(off_the_grid(), &Motion::NONE, &Motion::NONE);
    let maps: Vec<_> = ways(false).into_iter().map(|way| (way, rest.map(&way, Some(engine)))).collect();
    let edge = rest.source.mesh.mean_edge_length();
    for (i, motion) in
        [Motion::scale(1e-6), Motion::shift(5e5 + 0.1, 4.6e6 + 0.7, 300.3), Motion::scale(1e6)].into_iter().enumerate()
    {
        let (source, target) = sides(motion)[i % 3];
        let moved = Pair::of(off_the_grid(), &source, &target);
        for (way, images) in &maps {
            let d = difference(&moved.map(way, Some(engine)), images, &rest.source.mesh);
            agrees(&d, 100.0 * motion.rounding(edge)).unwrap_or_else(|e| panic!("{way:?} {motion:?}: {e}"));
            // The comparator sees one image in fifty moved by a fiftieth of an edge.
            let mut wrong = images.clone();
            wrong.iter_mut().step_by(50).for_each(|i| i.b0 += 0.02 * if i.b0 > 0.5 { -1.0 } else { 1.0 });
            assert!(agrees(&difference(&wrong, images, &rest.source.mesh), 0.0).is_err());
        }
    }
}

#[test]
fn shifts_and_scales_change_what_rounding_explains() {
    for engine in [engine(), downlevel()].into_iter().flatten() {
        agree(engine);
    }
}
