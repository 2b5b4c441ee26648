//! Random pairs of polygons: nearly all must end without a fold.

use super::super::random_polygons::{Kind, cage, cage_with_holes};
use super::super::testing::Random;
use super::*;
use crate::progress::Quiet;

const KINDS: [Kind; 3] = [Kind::Star, Kind::Tour, Kind::Growth];

#[test]
fn study() {
    let mut random = Random(11);
    for trial in 0..100 {
        let n = 5 + (random.unit() * 60.0) as usize;
        let (a, b) = (KINDS[trial % 3], KINDS[trial / 3 % 3]);
        let cage = cage(a, b, n, &mut random);
        let nesting = cage.source.nesting().unwrap();
        let ok = |path: &dyn VertexPath| {
            (1..64).filter(|&k| super::super::path::polygon_at(path, f64::from(k) / 64.0, &nesting).is_err()).count()
        };
        let clock = std::time::Instant::now();
        let compatible = Compatible::new(&cage);
        let built = clock.elapsed().as_secs_f64();
        let c = compatible.as_ref().map(|p| ok(p)).map_err(|e| e.to_string());
        println!(
            "{trial} n {n} {a:?} {b:?}: intrinsic bad {} linear bad {} compatible {:?} built {:.3} s walked {:.3}",
            ok(&Intrinsic::new(&cage)),
            ok(&Linear::new(&cage)),
            c,
            built,
            clock.elapsed().as_secs_f64() - built
        );
    }
}
