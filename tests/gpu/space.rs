//! The kernels of maps in space, against double precision and against the CPU.

use barymap::engine::{Engine, Lanes};
use barymap::mapping::space::gpu::MOST_FACES;
use barymap::mapping::space::{
    Frame, PIECE, PieceMinimum3d, Samples, Step, jacobian_min_3d, map_points_3d, piece_minima, piece_minima_on_cpu,
};
use barymap::models::shapes::{Random, icosphere, torus, uv_sphere};
use glam::DVec3;

use crate::{downlevel, engine};

fn engines() -> Vec<&'static Engine> {
    [engine(), downlevel()].into_iter().flatten().collect()
}

/// Faces, and a source and a target whose vertices moved by up to `amount`.
type Pair = (Vec<[u32; 3]>, Vec<DVec3>, Vec<DVec3>);

fn pair(mesh: &barymap::geometry::Mesh, amount: f64) -> Pair {
    let mut random = Random::new(7);
    let to = mesh.positions.iter().map(|&p| p + amount * DVec3::new(random.signed(), random.signed(), random.signed()));
    (mesh.triangles(), mesh.positions.clone(), to.collect())
}

fn step(pair: &Pair) -> (Step<f64>, Frame) {
    let scale = Frame::common_scale([&pair.1[..], &pair.2[..]]);
    (Step::new(&pair.0, &pair.1, &pair.2, scale), Frame::of(&pair.1, scale))
}

/// Inside, outside, at vertices, and on faces and edges as far as single precision goes.
fn points(pair: &Pair, frame: &Frame, count: usize) -> Vec<[f32; 3]> {
    let mut random = Random::new(9);
    let at = |v: u32| pair.1[v as usize];
    let mut all: Vec<[f32; 3]> = Vec::with_capacity(count);
    for k in 0..count {
        let [a, b, c] = pair.0[k % pair.0.len()].map(at);
        all.push(match k % 5 {
            0 => frame.local(a),
            1 => frame.local(a * 0.3 + b * 0.7),
            2 => frame.local(a * 0.3 + b * 0.5 + c * 0.2),
            _ => [0, 1, 2].map(|_| random.signed() as f32 * 0.4),
        });
    }
    all
}

/// The largest difference of points.
fn difference(a: &[[f32; 3]], b: &[[f32; 3]]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter()
        .zip(b)
        .flat_map(|(p, q)| (0..3).map(|k| (p[k] - q[k]).abs()))
        .fold(0.0, |m, d| if d > m || d.is_nan() { d } else { m })
}

#[test]
fn points_go_where_double_precision_takes_them() {
    for engine in engines() {
        for (mesh, amount) in [(icosphere(1.0, 1), 0.2), (uv_sphere(1.0, 12, 8), 0.1)] {
            let pair = pair(&mesh, amount);
            let (step, frame) = step(&pair);
            // Around a group.
            for count in [0, 1, 63, 64, 65, 700] {
                let start = points(&pair, &frame, count);
                let (mut found, mut again, mut truth) = (start.clone(), start.clone(), start);
                map_points_3d(engine, std::slice::from_ref(&step), &mut found).unwrap();
                map_points_3d(engine, std::slice::from_ref(&step), &mut again).unwrap();
                map_points_3d(&Engine::reference(), std::slice::from_ref(&step), &mut truth).unwrap();
                let off = difference(&found, &truth);
                assert!(off < 5e-6, "{count} points: {off:e}");
                assert_eq!(found, again, "not the same bytes");
                if count > 0 {
                    found[count / 2][1] += 1e-4;
                    assert!(!(difference(&found, &truth) < 5e-6), "a wrong image passes");
                }
            }
        }
    }
}

#[test]
fn steps_ping_pong_and_large_cages_go_to_the_cpu() {
    let Some(engine) = engine() else { return };
    let pair = pair(&icosphere(1.0, 1), 0.02);
    let (step, frame) = step(&pair);
    for count in [1, 2, 5] {
        let steps = vec![step.clone(); count];
        let start = points(&pair, &frame, 200);
        let (mut found, mut truth) = (start.clone(), start);
        map_points_3d(engine, &steps, &mut found).unwrap();
        map_points_3d(&Engine::reference(), &steps, &mut truth).unwrap();
        assert!(difference(&found, &truth) < 1e-5, "{count} steps");
    }
    // One face block, several, all of them, and more than there are.
    for n in [46, 47, 93, 186, 187] {
        let pair = self::pair(&torus(1.0, 0.4, n, 3, Default::default()), 0.01);
        let (step, frame) = self::step(&pair);
        assert_eq!(pair.0.len() > MOST_FACES, n > 62);
        let start = points(&pair, &frame, 60);
        let (mut found, mut truth) = (start.clone(), start);
        map_points_3d(engine, std::slice::from_ref(&step), &mut found).unwrap();
        map_points_3d(&Engine::reference(), std::slice::from_ref(&step), &mut truth).unwrap();
        assert!(difference(&found, &truth) < 5e-6, "{n}: {:e}", difference(&found, &truth));
    }
}

/// Whether the minima of pieces are those of the reference; Jacobians are known to `tolerance`
/// there.
fn agree(a: &[PieceMinimum3d], b: &[PieceMinimum3d], tolerance: f32) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a.value - b.value).abs() <= tolerance * (1.0 + b.value.abs()))
}

#[test]
fn minima_of_pieces_are_those_of_the_reference() {
    for engine in engines() {
        for (mesh, amount) in [(icosphere(1.0, 1), 0.3), (uv_sphere(1.0, 12, 8), 0.05)] {
            let pair = pair(&mesh, amount);
            let (step, frame) = step(&pair);
            let samples = Samples::new(&step, 10).unwrap();
            for count in [0, 1, PIECE - 1, PIECE, PIECE + 1, samples.count()] {
                let points = &samples.points()[samples.count() - count..];
                let found = piece_minima(engine, &step, points).unwrap();
                let like = piece_minima_on_cpu(Lanes::scalar(), &step.cast(), points);
                assert!(agree(&found, &like, 2e-3), "{count}: {found:?} {like:?}");
                let mut spoilt = found.clone();
                if let Some(one) = spoilt.iter_mut().find(|m| m.value.abs() < 1e3) {
                    one.value += 0.1;
                    assert!(!agree(&spoilt, &like, 2e-3), "a wrong minimum passes");
                }
            }
            // What is reported was judged in double precision.
            let minimum = |engine: &Engine| jacobian_min_3d(engine, &step, &frame, &samples, &[]).unwrap();
            let (found, truth) = (minimum(engine), minimum(&Engine::reference()));
            assert!((found.value - truth.value).abs() < 1e-9 && found.at == truth.at, "{found:?} {truth:?}");
        }
    }
}
