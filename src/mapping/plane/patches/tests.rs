use super::*;
use crate::geometry::Polygon;
use crate::mapping::plane::random_polygons::{Kind, ring};
use crate::mapping::plane::testing::{Random, between, pairs};
use crate::mapping::plane::{CompositeMap, Coordinates};

impl Maps for CompositeMap {
    fn exact(&self, points: &[DVec2]) -> Result<Vec<Mapped>> {
        Ok(self.forward_in_double(points))
    }

    fn cheap(&self, points: &[DVec2]) -> Result<Vec<Mapped>> {
        Ok(self.forward_in_parts(points))
    }
}

/// A map in double precision.
struct Plain<'a>(&'a dyn Fn(DVec2) -> Mapped);

impl Maps for Plain<'_> {
    fn exact(&self, points: &[DVec2]) -> Result<Vec<Mapped>> {
        Ok(points.iter().map(|p| (self.0)(*p)).collect())
    }
}

fn placed(polygon: &Polygon, scale: f64, offset: DVec2) -> Polygon {
    Polygon::from_loops(polygon.loops().iter().map(|ring| ring.iter().map(|v| *v * scale + offset).collect()).collect())
}

/// The map along the straight path, in equal steps.
fn map(from: &Polygon, to: &Polygon, steps: u32) -> CompositeMap {
    let polygons = (0..=steps).map(|k| between(from, to, f64::from(k) / f64::from(steps))).collect();
    CompositeMap::new(Coordinates::MeanValue, polygons).unwrap()
}

/// As many as a picture of 400 x 380 has pixels, nearly.
const EVALUATIONS: usize = 1 << 17;

fn patches(map: &CompositeMap, low: DVec2, high: DVec2, canvas: UVec2) -> Patches {
    let options = PatchOptions {
        cell: 64.0,
        tolerance: map.tolerance(),
        worth: 8.0,
        canvas: [DVec2::ZERO, canvas.as_dvec2()],
        vertices: map.source().vertices().collect(),
        evaluations: EVALUATIONS,
    };
    Patches::new(low, high, &options, map).unwrap()
}

/// The largest error of exact pre-images over what is allowed; and the shares of pixels that are
/// exact, and that are found at all.
fn judge(map: &CompositeMap, patches: &Patches, canvas: UVec2, every: usize) -> (f64, f64, f64) {
    let mut found = Found::default();
    patches.find(0, canvas, &mut found);
    let (mut exact, mut all) = (Vec::new(), 0);
    for (i, leaf) in found.leaf.iter().enumerate() {
        all += usize::from(*leaf != NOWHERE);
        if let Some(leaf @ Leaf::Bounded(_)) = patches.leaves.get(*leaf as usize) {
            let q = DVec2::new((i % canvas.x as usize) as f64, (i / canvas.x as usize) as f64) + 0.5;
            exact.push((q, leaf.point(found.solved[i].at)));
        }
    }
    let worst = exact.par_iter().step_by(every).map(|(q, p)| {
        // A step of Newton's method in double precision says how far off the pre-image is.
        let Mapped { point, derivative } = map.forward(*p);
        let [x, y] = [derivative.x_axis, derivative.y_axis];
        (derivative.inverse() * (point - *q)).length() * (x.length_squared() + y.length_squared()).sqrt()
    });
    let pixels = found.leaf.len() as f64;
    (worst.reduce(|| 0.0, f64::max) / map.tolerance(), exact.len() as f64 / pixels, all as f64 / pixels)
}

#[test]
fn pre_images_keep_the_bound_where_polynomials_give_them() {
    let (mut cheaply, mut mostly) = (0, 0);
    for (name, from, to) in pairs() {
        let (from, to) = [from, to].map(|p| placed(&p, 150.0, DVec2::new(200.0, 190.0))).into();
        let map = map(&from, &to, 8);
        let canvas = UVec2::new(400, 380);
        let patches = patches(&map, DVec2::splat(-16.0), canvas.as_dvec2() + 16.0, canvas);
        let (worst, exact, all) = judge(&map, &patches, canvas, 1);
        assert!(worst < 1.0, "{name}: {worst}");
        // The picture is small and the maps are wild; of one a third of the canvas is seen. Where a
        // map is slanted, the products in A^-1 q cancel, and single precision keeps the bound in
        // smaller squares only.
        assert!(exact > 0.4 * all && all > 0.2, "{name}: {exact} of {all}");
        mostly += usize::from(exact > 0.75 * all);
        let Evaluated { exact, cheap } = patches.evaluations;
        // Wild maps on small pictures take all that they may.
        assert!(exact + cheap <= EVALUATIONS, "{name}: {exact} {cheap}");
        // The quarters of a square have four anchors and 28 nodes and points held out.
        assert!(cheap < exact || exact <= EVALUATIONS / 8, "{name}: {exact} {cheap}");
        cheaply += usize::from(cheap > exact);
    }
    assert!(cheaply > 0 && 2 * mostly > pairs().len(), "{cheaply} {mostly}");
}

#[test]
fn random_cages_keep_the_bound() {
    // These cages chose nothing: SAFETY and the rest are from the pairs and from theory.
    let mut random = Random(2026);
    let mut worst: f64 = 0.0;
    for (k, kind) in [Kind::Star, Kind::Tour, Kind::Growth].into_iter().cycle().take(18).enumerate() {
        let n = 4 + 5 * k;
        let source = ring(kind, n, &mut random);
        // A target that is simple all the way there, moved as far as may be.
        let source = Polygon::from_loops(vec![source]);
        let moves: Vec<DVec2> = (0..n).map(|_| DVec2::new(random.unit() - 0.5, random.unit() - 0.5)).collect();
        let target = |reach: f64| {
            let moved = source.vertices().zip(&moves).map(|(v, by)| v + reach * *by);
            Polygon::from_loops(vec![moved.collect()])
        };
        let simple =
            |reach: f64| (1..=4).all(|t| between(&source, &target(reach), f64::from(t) / 4.0).nesting().is_ok());
        let reach = (0..80).map(|k| 0.4 * 0.7_f64.powi(k)).find(|reach| simple(*reach)).unwrap();
        let [from, to] = [source.clone(), target(reach)].map(|p| placed(&p, 240.0, DVec2::splat(130.0)));
        let map = map(&from, &to, 1 + k as u32 % 4);
        let canvas = UVec2::new(300, 310);
        let patches = patches(&map, DVec2::splat(-16.0), canvas.as_dvec2() + 16.0, canvas);
        let (off, exact, all) = judge(&map, &patches, canvas, 3);
        worst = worst.max(off);
        assert!(off < 1.0, "{kind:?} {n}: {off}");
        assert!(exact > 0.5 && all > 0.8, "{kind:?} {n}: {exact} of {all}");
    }
    assert!(worst > 0.01, "the comparison sees errors: {worst}");
}

#[test]
fn next_to_vertices_and_edges_and_far_away() {
    // The canvas shows a vertex, an edge and a place far from the cage, ever larger.
    let (_, from, to) = pairs().into_iter().next().unwrap();
    let (vertex, edge) = (from.vertices().next().unwrap(), {
        let v: Vec<DVec2> = from.vertices().collect();
        0.7 * v[0] + 0.3 * v[1]
    });
    for (what, at) in [("vertex", vertex), ("edge", edge), ("far", DVec2::new(40.0, 25.0))] {
        for zoom in [30.0, 3e3, 3e5] {
            let plain = map(&from, &to, 6);
            let middle = plain.forward(at).point;
            // In the source, 3 pixels are shown on a canvas of 120.
            let (scale, canvas) = (zoom, UVec2::new(120, 120));
            let polygons = plain.polygons().iter().enumerate();
            let shift = polygons.map(|(k, p)| {
                let here = if k == 0 { at } else { middle };
                placed(p, scale, DVec2::splat(60.0) - scale * here)
            });
            let map = CompositeMap::new(Coordinates::MeanValue, shift.collect()).unwrap();
            let patches = patches(&map, DVec2::splat(-60.0), DVec2::splat(180.0), canvas);
            let (worst, exact, all) = judge(&map, &patches, canvas, 1);
            assert!(worst < 1.0, "{what} {zoom}: {worst}");
            assert!(exact > 0.2 && all > 0.4, "{what} {zoom}: {exact} of {all}");
        }
    }
}

#[test]
fn a_wrong_polynomial_is_seen() {
    let (_, from, to) = pairs().into_iter().next().unwrap();
    let (from, to) = [from, to].map(|p| placed(&p, 150.0, DVec2::new(200.0, 190.0))).into();
    let map = map(&from, &to, 8);
    let canvas = UVec2::new(400, 380);
    let mut patches = patches(&map, DVec2::splat(-16.0), canvas.as_dvec2() + 16.0, canvas);
    for leaf in &mut patches.leaves {
        if let Leaf::Bounded(patch) = leaf {
            patch.bend[0][9] += 1e-4;
        }
    }
    assert!(judge(&map, &patches, canvas, 5).0 > 2.0);
}

#[test]
fn maps_that_are_no_numbers_or_fold_are_left_open() {
    let options = |vertices: Vec<DVec2>| PatchOptions {
        cell: 64.0,
        tolerance: 1e-3,
        worth: 32.0,
        canvas: [DVec2::ZERO, DVec2::splat(100.0)],
        vertices,
        evaluations: 1 << 14,
    };
    let all = |f: &dyn Fn(DVec2) -> Mapped| {
        Patches::new(DVec2::ZERO, DVec2::splat(100.0), &options(vec![DVec2::NAN]), &Plain(f)).unwrap()
    };
    let none = all(&|_| Mapped { point: DVec2::NAN, derivative: DMat2::IDENTITY });
    let mut found = Found::default();
    none.find(0, UVec2::splat(50), &mut found);
    assert!(none.leaves.iter().all(|l| matches!(l, Leaf::Open(_))) && found.leaf.iter().all(|l| *l == NOWHERE));
    // Folded along x = 50: every pixel to the left is there twice, none to the right.
    let fold = all(&|p| Mapped {
        point: DVec2::new(50.0 - 0.01 * (p.x - 50.0).powi(2), p.y),
        derivative: DMat2::from_cols(DVec2::new(-0.02 * (p.x - 50.0), 0.0), DVec2::Y),
    });
    fold.find(0, UVec2::splat(100), &mut found);
    for (i, leaf) in found.leaf.iter().enumerate() {
        let (x, y) = ((i % 100) as f64 + 0.5, (i / 100) as f64 + 0.5);
        let shown = (26.0..49.0).contains(&x);
        assert!(!shown || *leaf != NOWHERE, "{x} {y}");
        if let Some(Leaf::Bounded(patch)) = fold.leaves.get(*leaf as usize) {
            let p = patch.point(found.solved[i].at);
            assert!((50.0 - 0.01 * (p.x - 50.0).powi(2) - x).abs() < 1e-3 && (p.y - y).abs() < 1e-3);
        }
    }
    let many = options(Vec::new());
    for high in [DVec2::ZERO, DVec2::NAN, DVec2::splat(1e12)] {
        let identity = |p: DVec2| Mapped { point: p, derivative: DMat2::IDENTITY };
        assert!(Patches::new(DVec2::ZERO, high, &many, &Plain(&identity)).is_err());
    }
}

/// The identity, whose cheap form is off by `noise` at points that are not `spared`.
struct Noisy<F> {
    noise: F,
}

impl<F: Fn(DVec2) -> DVec2> Maps for Noisy<F> {
    fn exact(&self, points: &[DVec2]) -> Result<Vec<Mapped>> {
        Ok(points.iter().map(|p| Mapped { point: *p, derivative: DMat2::IDENTITY }).collect())
    }

    fn cheap(&self, points: &[DVec2]) -> Result<Vec<Mapped>> {
        Ok(points.iter().map(|p| Mapped { point: *p + (self.noise)(*p), derivative: DMat2::IDENTITY }).collect())
    }
}

#[test]
fn the_cheap_map_is_taken_where_it_is_near_and_moved_to_the_exact_one() {
    let options = PatchOptions {
        cell: 64.0,
        tolerance: 1e-3,
        worth: 8.0,
        canvas: [DVec2::ZERO, DVec2::splat(128.0)],
        vertices: Vec::new(),
        evaluations: 1 << 14,
    };
    let patches = |noise: f64| {
        Patches::new(DVec2::ZERO, DVec2::splat(128.0), &options, &Noisy { noise: |_| DVec2::splat(noise) }).unwrap()
    };
    let worst = |patches: &Patches| {
        let mut found = Found::default();
        patches.find(0, UVec2::splat(128), &mut found);
        let off = |(i, leaf): (usize, &u32)| {
            let q = DVec2::new((i % 128) as f64, (i / 128) as f64) + 0.5;
            (patches.leaves[*leaf as usize].point(found.solved[i].at) - q).length()
        };
        found.leaf.iter().enumerate().map(off).fold(0.0, f64::max)
    };
    let near = patches(5e-5);
    assert!(near.evaluations.exact == 8 && near.evaluations.cheap > 40, "{:?}", near.evaluations);
    assert!(worst(&near) < 4e-5, "the constant part is gone: {}", worst(&near));
    let far = patches(5e-4);
    assert!(far.evaluations.cheap == 4 && far.evaluations.exact > 40, "{:?}", far.evaluations);
    assert!(worst(&far) < 4e-5, "{}", worst(&far));
}
