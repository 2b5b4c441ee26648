use super::*;
use crate::encoding::Connectivity;
use crate::encoding::decode::{encoding_residual, energy};
use crate::encoding::derivative::{Linearisation, encoding_apply, encoding_apply_transpose};
use crate::encoding::encode::Encoded;
use crate::encoding::gradients::encoding_diagonal;
use crate::models::shapes::{Random, lobed_sphere};

/// Roundings of a row: six neighbours with twelve products each, and as many again on the way back
/// to the vertices.
const ROUNDINGS: f64 = 2.0 * 6.0 * 12.0 * f32::EPSILON as f64 / 2.0;
const HELD: usize = 5;

struct Case {
    encoded: Encoded,
    single: Encoding<f32>,
    /// Frame after frame.
    positions: Vec<Vec<V3<f64>>>,
    directions: Vec<Vec<V3<f64>>>,
}

/// A lobed sphere, bent in another way in each frame, rounded to single precision.
fn case() -> Case {
    let mesh = lobed_sphere(2, 0.5);
    let rest: Vec<V3<f64>> = mesh.positions.iter().map(|p| p.to_array()).collect();
    let encoded = Encoded::new(&Connectivity::new(&mesh).rings, &rest, |_| true);
    let mut random = Random::new(5);
    let round = |x: f64| f64::from(x as f32);
    let positions =
        (0..WIDTH).map(|_| rest.iter().map(|p| p.map(|x| round(x + 0.05 * random.signed()))).collect()).collect();
    let mut random = Random::new(9);
    let mut vector = |v: usize| if v < HELD { [0.0; 3] } else { [0; 3].map(|_| round(random.signed())) };
    let directions = (0..WIDTH).map(|_| (0..rest.len()).map(&mut vector).collect()).collect();
    let single = encoded.encoding.to_precision();
    Case { encoded, single, positions, directions }
}

fn rows(frames: &[Vec<V3<f64>>]) -> Vec<Row3> {
    let one = |v: usize| std::array::from_fn(|c| std::array::from_fn(|lane| frames[lane][v][c] as f32));
    (0..frames[0].len()).map(one).collect()
}

/// The largest difference between free vertices of a frame in its lane and of the truth, over the
/// largest number of the truth.
fn off(rows: &[Row3], lane: usize, truth: &[V3<f64>]) -> f64 {
    let most = truth.iter().flatten().fold(0.0, |a: f64, b| a.max(b.abs()));
    let each = rows.iter().zip(truth).skip(HELD);
    let differences = each.flat_map(|(row, p)| (0..3).map(move |c| (f64::from(row[c][lane]) - p[c]).abs()));
    differences.fold(0.0, f64::max) / most
}

#[test]
fn rows_follow_the_reference_of_each_frame() {
    let case = case();
    let (s, e) = (&case.encoded.stencils, &case.encoded.encoding);
    let rings = Rings { stencils: s, w: &case.single.w, b: &case.single.b };
    let (positions, direction) = (rows(&case.positions), rows(&case.directions));
    for lanes in [Lanes::scalar(), Lanes::detect()] {
        let n = positions.len();
        let mut slopes = vec![SlopeRow::NONE; s.row_count()];
        let (mut z, mut gradient, mut product) = (vec![ZERO; s.neighbour.len()], vec![ZERO; n], vec![ZERO; n]);
        let mut diagonal = vec![NO_BLOCK; n];
        let (mut squares, mut again, mut curvature) = ([0.0; WIDTH], [0.0; WIDTH], [0.0; WIDTH]);
        lanes.run(Linearise {
            rings,
            positions: &positions,
            slopes: &mut slopes,
            z: &mut z,
            gradient: &mut gradient,
            diagonal: &mut diagonal,
            squares: &mut squares,
        });
        lanes.run(Squares { rings, positions: &positions, squares: &mut again });
        lanes.run(Product {
            rings,
            positions: &positions,
            slopes: &slopes,
            z: &z,
            direction: &direction,
            product: &mut product,
            squares: &mut curvature,
        });
        for lane in 0..WIDTH {
            let (x, d) = (&case.positions[lane], &case.directions[lane]);
            let at = Linearisation::new(s, e, x);
            let back = |y: &[V3<f64>]| {
                let mut out = vec![[0.0; 3]; n];
                encoding_apply_transpose(s, e, &at, x, y, HELD, &mut Vec::new(), &mut out);
                out
            };
            let mut residual = vec![[0.0; 3]; s.row_count()];
            encoding_residual(s, e, x, &mut residual);
            let g = 2.0 * energy(&residual);
            assert!((squares[lane] / g - 1.0).abs() < ROUNDINGS && (again[lane] / g - 1.0).abs() < ROUNDINGS);
            assert!(off(&gradient, lane, &back(&residual)) < ROUNDINGS, "gradient of {lane}");
            let mut forward = vec![[0.0; 3]; s.row_count()];
            encoding_apply(s, e, &at, x, d, &mut forward);
            assert!((curvature[lane] / (2.0 * energy(&forward)) - 1.0).abs() < ROUNDINGS);
            assert!(off(&product, lane, &back(&forward)) < ROUNDINGS, "product of {lane}");
            assert!(off(&product, (lane + 1) % WIDTH, &back(&forward)) > 0.01, "the measure sees another frame");
            // The reference has one over the diagonal.
            let truth = encoding_diagonal(s, e, &at, x, HELD);
            let plain: Vec<Row3> =
                diagonal.iter().map(|b| [b[0], b[3], b[5]].map(|row| row.map(|d| d + 1.0))).collect();
            let exact: Vec<V3<f64>> = truth.iter().map(|p| p.map(|d| if d > 0.0 { 1.0 / d } else { 0.0 })).collect();
            assert!(off(&plain, lane, &exact) < ROUNDINGS, "diagonal of {lane}");
        }
    }
}

#[test]
fn blocks_are_inverted_or_their_diagonals_are() {
    let block = |entries: [f32; 6]| entries.map(|x| [x; WIDTH]);
    // A vertex with a row has one more on the diagonal.
    let sound = [2.0, 0.5, -0.25, 3.0, 0.75, 1.0];
    let flat = [4.0, 4.0, 4.0, 4.0, 4.0, 4.0];
    let mut diagonal = vec![block(sound), block(flat), block([0.0; 6])];
    Lanes::detect().run(Invert { row_of: &[0, crate::geometry::NONE, crate::geometry::NONE], diagonal: &mut diagonal });
    let full =
        |b: &Block| [[b[0], b[1], b[2]], [b[1], b[3], b[4]], [b[2], b[4], b[5]]].map(|r| r.map(|x| f64::from(x[3])));
    let matrix = [[3.0, 0.5, -0.25], [0.5, 4.0, 0.75], [-0.25, 0.75, 2.0]];
    let inverse = full(&diagonal[0]);
    for r in 0..3 {
        for c in 0..3 {
            let sum: f64 = (0..3).map(|k| matrix[r][k] * inverse[k][c]).sum();
            assert!((sum - f64::from(u8::from(r == c))).abs() < 1e-6);
        }
    }
    assert_eq!(full(&diagonal[1]), [[0.25, 0.0, 0.0], [0.0, 0.25, 0.0], [0.0, 0.0, 0.25]]);
    assert_eq!(full(&diagonal[2]), [[0.0; 3]; 3]);
}

#[test]
fn steps_go_down_in_every_lane_and_a_broken_frame_breaks_no_other() {
    let case = case();
    let (s, e) = (case.encoded.stencils.clone(), case.encoded.encoding.clone());
    let n = s.vertex_count();
    let stage = Stage { vertices: n, levels: 0..0, stencils: s, encoding: e };
    let hierarchy = Hierarchy {
        order: (0..n as u32).collect(),
        held: HELD,
        base: n,
        level_start: vec![0],
        stages: vec![stage],
        ..Hierarchy::default()
    };
    let abreast = Abreast::new(&hierarchy, 0);
    let quality = SequenceQuality { fine: 30, ..SequenceQuality::DEFAULT };
    let far = [1e3, -2e3, 5e2];
    let run = |frames: &[Vec<V3<f64>>], size: f64| {
        let placed: Vec<Vec<V3<f64>>> =
            frames.iter().map(|f| f.iter().map(|p| std::array::from_fn(|c| p[c] * size + far[c])).collect()).collect();
        let list: Vec<Frame<'_>> = placed.iter().map(|p| Frame { held: &p[..HELD], scale: size }).collect();
        let mut parts: Vec<Part<'_, '_>> =
            list.iter().zip(&placed).map(|(frame, p)| Part { frame, positions: p.clone() }).collect();
        abreast.finish(&mut Workspace::default(), &mut parts, &quality).unwrap();
        parts.into_iter().map(|p| p.positions).collect::<Vec<_>>()
    };
    let value = |x: &[V3<f64>]| {
        let stage = &hierarchy.stages[0];
        let mut residual = vec![[0.0; 3]; stage.stencils.row_count()];
        encoding_residual(&stage.stencils, &stage.encoding, x, &mut residual);
        energy(&residual)
    };
    let whole = run(&case.positions, 1.0);
    for (lane, (x, start)) in whole.iter().zip(&case.positions).enumerate() {
        // The start is the shape at rest plus noise on every vertex, held ones too.
        assert!(value(x) < 0.3 * value(start), "frame {lane}: {} of {}", value(x), value(start));
        assert!((0..HELD).all(|v| (0..3).all(|c| x[v][c] == start[v][c] + far[c])));
    }
    // Alone, and beside a frame without a number, each is the same.
    let mut broken = case.positions[..3].to_vec();
    broken[1][40] = [f64::NAN; 3];
    let beside = run(&broken, 1.0);
    assert!(beside[0] == whole[0] && beside[2] == whole[2] && beside[1].iter().flatten().any(|x| x.is_nan()));
    assert!(run(&case.positions[2..3], 1.0)[0] == whole[2]);
    // A shape of another size goes as far down.
    let large = run(&case.positions[..1], 1e6);
    assert!((value(&large[0]) / value(&whole[0]) / 1e12 - 1.0).abs() < 0.01);
}
