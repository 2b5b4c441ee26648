//! The kernels of the encoding against double precision, row by row with derived bounds; decodes on
//! devices.

use barymap::encoding::decode::{encoding_residual, ring_value};
use barymap::encoding::derivative::{Linearisation, encoding_apply, encoding_apply_transpose};
use barymap::encoding::gpu::{SplitLevels, StageKernels, dot_on_device};
use barymap::encoding::gradients::{dot_product, encoding_diagonal};
use barymap::encoding::{Connectivity, Encoding, Hierarchy, HierarchyOptions, Stencils, V3};
use barymap::engine::Gpu;
use barymap::geometry::Mesh;
use barymap::models::shapes::{Diagonal, Random, irregular_plane, lobed_sphere, torus};
use glam::{DQuat, DVec3};

use crate::common::load;
use crate::devices;
use crate::encoding_bounds::{ROUNDOFF, RowBound};
use crate::tube::Tube;

/// A mesh with its hierarchy, at diagonal one about the origin.
struct Case {
    name: String,
    rest: Vec<V3<f64>>,
    hierarchy: Hierarchy,
}

/// A vertex in single precision, as the kernels read it, in double.
fn single(p: DVec3) -> V3<f64> {
    p.to_array().map(|x| f64::from(x as f32))
}

fn narrow(list: &[V3<f64>]) -> Vec<V3<f32>> {
    list.iter().map(|p| p.map(|x| x as f32)).collect()
}

/// Coefficients in single precision, as the kernels read them, in double.
fn rounded(encoding: &Encoding<f64>) -> Encoding<f64> {
    let round = |list: &[f64]| list.iter().map(|&x| f64::from(x as f32)).collect();
    Encoding { w: round(&encoding.w), b: round(&encoding.b) }
}

impl Case {
    fn new(mesh: &Mesh, handles: usize) -> Self {
        let connectivity = Connectivity::new(mesh);
        let (low, high) = mesh.bounds().unwrap();
        let (centre, size) = ((low + high) * 0.5, low.distance(high));
        let rest: Vec<V3<f64>> = mesh.positions.iter().map(|&p| single((p - centre) / size)).collect();
        let mut held: Vec<u32> = (0..connectivity.component_count)
            .flat_map(|k| {
                let members: Vec<u32> =
                    (0..rest.len() as u32).filter(|&v| connectivity.component[v as usize] == k).collect();
                let n = handles.min(members.len());
                (0..n).map(|i| members[i * members.len() / n]).collect::<Vec<_>>()
            })
            .collect();
        held.sort_unstable();
        let hierarchy = Hierarchy::new(&connectivity, &rest, &held, &HierarchyOptions::default()).unwrap();
        Self { name: mesh.name.clone(), rest, hierarchy }
    }

    /// The whole mesh, with coefficients as the kernels read them.
    fn stage(&self) -> (&Stencils, Encoding<f64>) {
        let stage = self.hierarchy.stages.last().unwrap();
        (&stage.stencils, rounded(&stage.encoding))
    }

    /// The rest shape in the hierarchy's numbering, twisted, and shaken by a part of an edge.
    fn bent(&self, turn: f64) -> Vec<V3<f64>> {
        let mut random = Random::new(3);
        let shake = 0.05 / (self.rest.len() as f64).sqrt();
        let place = |&v: &u32| {
            let p = DVec3::from(self.rest[v as usize]);
            let p = DQuat::from_rotation_x(turn * p.x) * p;
            single(p + shake * DVec3::new(random.signed(), random.signed(), random.signed()))
        };
        self.hierarchy.order.iter().map(place).collect()
    }
}

fn generated() -> Vec<Case> {
    let meshes = [
        lobed_sphere(3, 0.5),
        torus(2.0, 0.7, 40, 20, Diagonal::Forward),
        irregular_plane(20, 20, 1.0, 1.0, Diagonal::Alternating, 0.3, 7),
        Tube::small().mesh,
    ];
    meshes.iter().map(|m| Case::new(m, 8)).collect()
}

/// Real ones: closed, open, of genus 0 to 4.
fn real() -> Vec<Case> {
    ["mesh/horse_8k.obj", "mesh/3holes_7k.obj", "mesh/fertility_9k.obj", "mesh/camelhead_23k.obj", "mesh/hand_16k.obj"]
        .iter()
        .map(|f| Case::new(&load(f), 12))
        .collect()
}

/// The first entry further from the truth than its bound allows, and the largest part of a bound
/// that is used.
fn compare(found: &[V3<f32>], truth: &[V3<f64>], bound: impl Fn(usize) -> f64) -> Result<f64, String> {
    let mut most = 0.0_f64;
    if found.len() != truth.len() {
        return Err(format!("{} entries for {}", found.len(), truth.len()));
    }
    for (k, (a, b)) in found.iter().zip(truth).enumerate() {
        let error = DVec3::from(a.map(f64::from)).distance(DVec3::from(*b));
        let bound = bound(k);
        if !(error <= bound) {
            return Err(format!("entry {k}: {a:?} for {b:?}, off by {error:e}, allowed {bound:e}"));
        }
        most = most.max(if bound > 0.0 { error / bound } else { 0.0 });
    }
    Ok(most)
}

/// A list that passes must not pass with one entry in a hundred thousand parts of its size off.
fn check(what: &str, found: &[V3<f32>], truth: &[V3<f64>], scale: f64, bound: impl Fn(usize) -> f64) {
    let most = compare(found, truth, &bound).unwrap_or_else(|e| panic!("{what}: {e}"));
    println!("{what}: {:.3} of the bound", most);
    let Some(k) = (0..found.len()).filter(|&k| bound(k) > 0.0).min_by(|&a, &b| bound(a).total_cmp(&bound(b))) else {
        panic!("{what}: nothing was compared");
    };
    let mut wrong = found.to_vec();
    wrong[k][1] += (3e-3 * scale) as f32;
    assert!(compare(&wrong, truth, &bound).is_err(), "{what}: a wrong entry passes (its bound is {:e})", bound(k));
}

fn bounds(s: &Stencils, e: &Encoding<f64>, at: &Linearisation<f64>, x: &[V3<f64>]) -> Vec<RowBound> {
    let bounds: Vec<RowBound> = (0..s.row_count()).map(|row| RowBound::new(s, e, at, x, row)).collect();
    let degenerate = bounds.iter().filter(|b| b.is_degenerate()).count();
    assert!(degenerate * 100 <= bounds.len(), "{degenerate} of {} rows say nothing", bounds.len());
    bounds
}

fn random(n: usize, seed: u64) -> Vec<V3<f64>> {
    let mut random = Random::new(seed);
    (0..n).map(|_| single(DVec3::new(random.signed(), random.signed(), random.signed()))).collect()
}

/// All products on one mesh at one shape.
fn check_products(gpu: &Gpu, case: &Case) {
    let (s, e) = case.stage();
    let held = case.hierarchy.held;
    let x = case.bent(1.5);
    let at = Linearisation::new(s, &e, &x);
    let bounds = bounds(s, &e, &at, &x);
    let vertex = |row: usize| DVec3::from(x[s.vertex[row] as usize]);
    let name = |what: &str| format!("{}, {what}", case.name);
    let edge = 1.0 / (s.row_count() as f64).sqrt();
    let kernels = StageKernels::new(gpu, s, &case.hierarchy.stages.last().unwrap().encoding, held).unwrap();

    let mut truth = vec![[0.0; 3]; s.row_count()];
    encoding_residual(s, &e, &x, &mut truth);
    let allowed =
        |row: usize| if bounds[row].is_degenerate() { f64::INFINITY } else { bounds[row].residual(vertex(row)) };
    let found = kernels.linearise(gpu, &narrow(&x)).unwrap();
    check(&name("residual"), &found, &truth, edge, allowed);

    // Several shapes at once: the same numbers for the same shape, wherever it stands.
    let shapes = [narrow(&case.bent(0.7)), narrow(&x), narrow(&x)].concat();
    let several = kernels.residuals(gpu, &shapes).unwrap();
    check(&name("residual of the second of three"), &several[s.row_count()..2 * s.row_count()], &truth, edge, allowed);
    assert_eq!(several[s.row_count()..2 * s.row_count()], several[2 * s.row_count()..]);
    assert_ne!(several[..s.row_count()], several[s.row_count()..2 * s.row_count()]);

    let mut direction = random(x.len(), 5);
    direction[..held].iter_mut().for_each(|d| *d = [0.0; 3]);
    let mut forward = vec![[0.0; 3]; s.row_count()];
    encoding_apply(s, &e, &at, &x, &direction, &mut forward);
    let applied = kernels.apply(gpu, &narrow(&direction)).unwrap();
    check(&name("apply"), &applied, &forward, 1.0, |row| {
        let around: Vec<DVec3> = s.ring(row).iter().map(|&v| DVec3::from(direction[v as usize])).collect();
        let own = DVec3::from(direction[s.vertex[row] as usize]).length() + DVec3::from(forward[row]).length();
        if bounds[row].is_degenerate() { f64::INFINITY } else { bounds[row].derivative(&around) + 2.0 * ROUNDOFF * own }
    });

    let y = random(s.row_count(), 6);
    let mut back = vec![[0.0; 3]; x.len()];
    encoding_apply_transpose(s, &e, &at, &x, &y, held, &mut Vec::new(), &mut back);
    let returned = kernels.apply_transpose(gpu, &narrow(&y)).unwrap();
    let named = |v: usize| s.incoming(v).iter().map(|&slot| (slot as usize, s.slot_row[slot as usize] as usize));
    check(&name("apply, transposed"), &returned, &back, 1.0, |v| {
        if v < held {
            return 0.0;
        }
        if named(v).any(|(_, row)| bounds[row].is_degenerate()) {
            return f64::INFINITY;
        }
        let (mut error, mut size, mut count) = (0.0, 3.0, 2.0);
        for (slot, row) in named(v) {
            let (e, s) = bounds[row].transposed(slot - s.start[row] as usize, DVec3::from(y[row]));
            (error, size, count) = (error + e, size + s, count + 1.0);
        }
        error + ROUNDOFF * count * size
    });

    // <J x, y> = <x, Jᵀ y>, summed in double precision; a wrong product must not pass.
    let inner = |a: &[V3<f32>], b: &[V3<f64>]| -> (f64, f64) {
        let terms = a.iter().zip(b).map(|(a, b)| DVec3::from(a.map(f64::from)).dot(DVec3::from(*b)));
        terms.fold((0.0, 0.0), |(sum, size), t| (sum + t, size + t.abs()))
    };
    let ((left, size), (right, _)) = (inner(&applied, &y), inner(&returned, &direction));
    // Errors of single entries are independent: they grow like the root of their number.
    let allowed = 1e-5 * size / (s.row_count() as f64).sqrt();
    assert!((left - right).abs() <= allowed, "{}: {left} and {right}, allowed {allowed:e}", case.name);
    let mut wrong = returned.clone();
    wrong.swap(held + 3, held + 5);
    assert!((left - inner(&wrong, &direction).0).abs() > allowed);

    let diagonal = encoding_diagonal(s, &e, &at, &x, held);
    let found = kernels.inverse_diagonal(gpu).unwrap();
    check(&name("diagonal"), &found, &diagonal, 1.0, |v| {
        if v < held {
            return 0.0;
        }
        if named(v).any(|(_, row)| bounds[row].is_degenerate()) {
            return f64::INFINITY;
        }
        // The largest entry 1 / D changes by the change of D over D squared; a column of length l
        // contributes l².
        let inverse = diagonal[v].iter().copied().fold(0.0, f64::max);
        let mut change = 0.0;
        for (slot, row) in named(v) {
            for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                let mut unit = vec![DVec3::ZERO; s.ring(row).len()];
                unit[slot - s.start[row] as usize] = axis;
                let error = bounds[row].derivative(&unit);
                let column =
                    (1.0 / inverse).sqrt().max(1.0 / diagonal[v].iter().copied().fold(f64::INFINITY, f64::min).sqrt());
                change += 2.0 * column * error + error * error;
            }
        }
        inverse * (inverse * change + ROUNDOFF * (named(v).count() as f64 + 8.0)) * 3f64.sqrt()
    });
    assert_eq!(kernels.inverse_diagonal(gpu).unwrap(), found, "not the same bytes");
}

#[test]
fn products_keep_their_bounds_on_generated_meshes() {
    for gpu in devices() {
        for case in generated() {
            check_products(gpu, &case);
        }
    }
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn products_keep_their_bounds_on_real_meshes() {
    for gpu in devices() {
        for case in real() {
            check_products(gpu, &case);
        }
    }
}

/// Every split from the device's own positions before it: only the arithmetic of one ring differs.
fn check_splits(gpu: &Gpu, case: &Case) {
    let h = &case.hierarchy;
    let e = rounded(&h.split_encoding);
    let levels = 0..h.level_start.len() - 1;
    let known = case.bent(1.0);
    let start: Vec<[f32; 4]> = narrow(&known).iter().map(|&[x, y, z]| [x, y, z, 0.0]).collect();
    let mut single_shape = start.clone();
    single_shape[h.base..].iter_mut().for_each(|p| *p = [f32::NAN; 4]);
    let one = SplitLevels::new(gpu, h, 1).unwrap();
    one.place(gpu, levels.clone(), &mut single_shape).unwrap();
    let x: Vec<V3<f64>> = single_shape.iter().map(|p| [p[0], p[1], p[2]].map(f64::from)).collect();
    let at = Linearisation::new(&h.splits, &e, &x);
    let bounds = bounds(&h.splits, &e, &at, &x);
    let rows = h.splits.row_count();
    let value = |row: usize| {
        let slots = h.splits.slots(row);
        ring_value(&x, h.splits.ring(row), &e.w[slots.clone()], &e.b[slots])
    };
    let truth: Vec<V3<f64>> = (0..rows).map(value).collect();
    let found: Vec<V3<f32>> = single_shape[h.base..].iter().map(|p| [p[0], p[1], p[2]]).collect();
    check(&format!("{}, splits", case.name), &found, &truth, 1.0, |row| {
        if bounds[row].is_degenerate() { f64::INFINITY } else { bounds[row].residual(DVec3::from(truth[row])) }
    });
    // The same bytes again, in parts, and for every one of several shapes.
    let mut again = start.clone();
    let middle = levels.end / 2;
    one.place(gpu, 0..middle, &mut again).unwrap();
    one.place(gpu, middle..levels.end, &mut again).unwrap();
    assert_eq!(again[h.base..], single_shape[h.base..]);
    for frames in [2, 5, 70] {
        let n = start.len();
        let many = SplitLevels::new(gpu, h, frames).unwrap();
        let mut shapes = start.repeat(frames);
        let half = (frames / 2) * n;
        shapes[half..half + h.base].iter_mut().for_each(|p| p[0] += 0.25);
        many.place(gpu, levels.clone(), &mut shapes).unwrap();
        for frame in (0..frames).filter(|f| *f != frames / 2) {
            assert_eq!(shapes[frame * n..(frame + 1) * n], single_shape[..], "shape {frame} of {frames}");
        }
        assert_ne!(shapes[half..half + n], single_shape[..]);
        assert!(many.place(gpu, levels.clone(), &mut shapes[1..]).is_err());
    }
}

#[test]
fn splits_keep_their_bounds_on_generated_meshes() {
    for gpu in devices() {
        for case in generated() {
            check_splits(gpu, &case);
        }
    }
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn splits_keep_their_bounds_on_real_meshes() {
    for gpu in devices() {
        for case in real() {
            check_splits(gpu, &case);
        }
    }
}

#[test]
fn sums_keep_their_bounds_at_every_size() {
    for gpu in devices() {
        for n in [0, 1, 63, 64, 65, 1023, 1024, 1025, 70_000, 1_048_577] {
            let (a, b) = (random(n, 1), random(n, 2));
            let (f, g) = (narrow(&a), narrow(&b));
            let found = f64::from(dot_on_device(gpu, &f, &g).unwrap());
            let truth = dot_product(&a, &b);
            let size: f64 = a.iter().zip(&b).map(|(a, b)| (0..3).map(|k| (a[k] * b[k]).abs()).sum::<f64>()).sum();
            // Three products; 16 entries of a lane and 64 lanes, at each of at most three levels.
            let bound = ROUNDOFF * (3.0 + 3.0 * 80.0) * size;
            assert!((found - truth).abs() <= bound, "{n}: {found} for {truth}");
            assert_eq!(found.to_bits(), f64::from(dot_on_device(gpu, &f, &g).unwrap()).to_bits());
            if n > 0 {
                // One missing entry must show: entries are at most one.
                assert!(n > 1000 || dot_on_device(gpu, &f[1..], &g[1..]).unwrap() as f64 != found);
            }
        }
        // Whole numbers add exactly in any order.
        let ones = vec![[1.0f32, 1.0, 0.0]; 1_048_577];
        assert_eq!(dot_on_device(gpu, &ones, &ones).unwrap(), 2.0 * 1_048_577.0);
        assert!(dot_on_device(gpu, &ones, &ones[1..]).is_err());
    }
}
