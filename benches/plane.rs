//! Maps in the plane: points, Jacobians, their minimum, composites; on SIMD lanes and on the
//! device, against equations (8) and (9) of the paper as printed, in double precision, in one
//! program.
//!
//! `cargo bench --bench plane`. All times are process CPU time / 2, the best of several rounds
//! after a warm-up; the ratio is to the printed form. Compare within one run. With
//! `MESA_SHADER_CACHE_DISABLE=true` the first dispatch shows what compilation takes.

mod support;

use barymap::engine::{Backend, Engine, EngineOptions, Lanes};
use barymap::geometry::Polygon;
use barymap::mapping::plane::{
    Coordinates, Frame, SampleOptions, Step, jacobian_min, map_points, map_points_on_cpu, map_points_with_derivatives,
};
use barymap::models::polygons::star;
use glam::{DVec2, dvec2};
use support::{Result, Spent, best, once};

/// A frame of video.
const FRAME: [usize; 2] = [1920, 1080];
/// Of how many points the printed form does one.
const SPARSE: usize = 8;

/// A polygon of `n` vertices that fills a frame of video, at `t` between an oval and a wavy one.
fn polygon(n: usize, t: f64) -> Polygon {
    let vertex = |(k, v): (usize, &DVec2)| {
        let wave = 1.0 - 0.25 * t * (0.5 + 0.5 * (6.0 * std::f64::consts::TAU * k as f64 / n as f64).cos());
        *v * wave * dvec2(16.0, 9.0)
    };
    Polygon::from_loops(vec![star(n, &[1.0], 0.0, DVec2::ZERO).iter().enumerate().map(vertex).collect()])
}

/// The points of a frame, in the frame of `polygon`.
fn pixels(polygon: &Polygon, scale: f64, count: usize) -> Vec<[f32; 2]> {
    let (low, high) = polygon.bounds();
    let frame = Frame::of(polygon, scale);
    let [width, height] = FRAME;
    let stride = width * height / count;
    let pixel =
        |i: usize| dvec2((i % width) as f64 + 0.5, (i / width) as f64 + 0.5) / dvec2(width as f64, height as f64);
    (0..count).map(|i| frame.local(low + (high - low) * pixel(i * stride))).collect()
}

/// Equations (8) and (9) as printed: target vertices, gradients vertex by vertex.
struct Printed {
    v: Vec<[f64; 2]>,
    w: Vec<[f64; 2]>,
    s: Vec<[f64; 2]>,
    r: Vec<f64>,
    t: Vec<(f64, [f64; 2])>,
    weights: Vec<(f64, [f64; 2])>,
}

impl Printed {
    fn new(from: &Polygon, to: &Polygon, scale: f64) -> Self {
        let local = |polygon: &Polygon| -> Vec<[f64; 2]> {
            let frame = Frame::of(polygon, scale);
            polygon.vertices().map(|p| frame.local(p)).collect()
        };
        let n = from.vertex_count();
        let none = vec![(0.0, [0.0; 2]); n];
        Self { v: local(from), w: local(to), s: vec![[0.0; 2]; n], r: vec![0.0; n], t: none.clone(), weights: none }
    }

    /// Image and Jacobian.
    fn evaluate(&mut self, p: [f64; 2]) -> ([f64; 2], f64) {
        let Self { v, w, s, r, t, weights } = self;
        let n = v.len();
        for i in 0..n {
            s[i] = [v[i][0] - p[0], v[i][1] - p[1]];
            r[i] = (s[i][0] * s[i][0] + s[i][1] * s[i][1]).sqrt();
        }
        for i in 0..n {
            let k = if i + 1 == n { 0 } else { i + 1 };
            let area = s[i][0] * s[k][1] - s[i][1] * s[k][0];
            let below = r[i] * r[k] + s[i][0] * s[k][0] + s[i][1] * s[k][1];
            let tangent = area / below;
            let perpendicular = [v[i][1] - v[k][1], v[k][0] - v[i][0]];
            let gradient = [0, 1].map(|axis| {
                let radial = -s[i][axis] / r[i] * r[k] - r[i] * s[k][axis] / r[k];
                (perpendicular[axis] - tangent * (radial - s[i][axis] - s[k][axis])) / below
            });
            t[i] = (tangent, gradient);
        }
        let (mut sum, mut sums) = (0.0, [0.0; 2]);
        for i in 0..n {
            let (before, after) = (t[if i == 0 { n - 1 } else { i - 1 }], t[i]);
            let weight = (before.0 + after.0) / r[i];
            let gradient = [0, 1].map(|axis| (before.1[axis] + after.1[axis] + weight * s[i][axis] / r[i]) / r[i]);
            weights[i] = (weight, gradient);
            sum += weight;
            sums = [sums[0] + gradient[0], sums[1] + gradient[1]];
        }
        let (mut image, mut d) = ([0.0; 2], [[0.0; 2]; 2]);
        for (i, (weight, gradient)) in weights.iter().enumerate() {
            let b = weight / sum;
            for row in 0..2 {
                image[row] += b * w[i][row];
                for axis in 0..2 {
                    d[row][axis] += w[i][row] * (gradient[axis] - b * sums[axis]) / sum;
                }
            }
        }
        (image, d[0][0] * d[1][1] - d[0][1] * d[1][0])
    }
}

fn line(name: &str, spent: Spent, points: usize, baseline: f64) {
    let each = spent.per_item(points);
    println!("  {name:<44} {each:>9.1} ns  {:>7.1} Mpoint/s  {:>6.1} x", 1e3 / each, baseline / each);
}

/// Points and Jacobians through one step.
fn one_step(n: usize, count: usize, gpu: Option<&Engine>) -> Result<f64> {
    println!("one step, {n} vertices, {count} points; per point on two cores, ratio to the printed form");
    let (from, to) = (polygon(n, 0.0), polygon(n, 0.3));
    let scale = Frame::common_scale([&from, &to]);
    let step = Step::<f32>::new(Coordinates::MeanValue, &from, &to, scale);
    let (wide, steps) = (step.cast::<f64>(), std::slice::from_ref(&step));
    let points = pixels(&from, scale, count);
    let double: Vec<[f64; 2]> = points.iter().map(|p| p.map(f64::from)).collect();

    let mut printed = Printed::new(&from, &to, scale);
    let few: Vec<[f64; 2]> = double.iter().step_by(SPARSE).copied().collect();
    let spent = best(3, || {
        few.iter().for_each(|p| {
            std::hint::black_box(printed.evaluate(*p));
        });
        Ok(())
    })?;
    let baseline = spent.per_item(few.len());
    line("printed (8), (9), f64 scalar: map, J", spent, few.len(), baseline);
    let spent = best(3, || {
        few.iter().for_each(|p| {
            std::hint::black_box(wide.evaluate(*p));
        });
        Ok(())
    })?;
    line("reference, f64 scalar: map, J", spent, few.len(), baseline);

    let mut derivatives = vec![[[0.0; 2]; 2]; count];
    let mut products = vec![[[0.0; 2]; 2]; count];
    let spent = best(3, || {
        let mut images = double.clone();
        map_points_on_cpu(Lanes::detect(), std::slice::from_ref(&wide), &mut images, Some(&mut products));
        Ok(())
    })?;
    line("lanes f64: map, derivative", spent, count, baseline);
    for (name, engine) in [("lanes f32", Some(&Engine::cpu())), ("device", gpu)] {
        let Some(engine) = engine else { continue };
        let spent = best(4, || Ok(map_points(engine, steps, &mut points.clone())?))?;
        line(&format!("{name}: map"), spent, count, baseline);
        let spent = best(4, || Ok(map_points_with_derivatives(engine, steps, &mut points.clone(), &mut derivatives)?))?;
        line(&format!("{name}: map, derivative"), spent, count, baseline);
    }
    Ok(baseline)
}

/// A frame of video: the minimum of the Jacobian at full resolution, and a composite of nine steps.
fn frame(n: usize, baseline: f64, gpu: Option<&Engine>) -> Result<()> {
    let count = FRAME[0] * FRAME[1];
    println!("{} x {}, {n} vertices; seconds on two cores, ratio to the printed form", FRAME[0], FRAME[1]);
    let polygons: Vec<Polygon> = (0..=9).map(|k| polygon(n, f64::from(k) / 9.0)).collect();
    let scale = Frame::common_scale(&polygons);
    let steps: Vec<Step<f32>> =
        polygons.windows(2).map(|p| Step::new(Coordinates::MeanValue, &p[0], &p[1], scale)).collect();
    let points = pixels(&polygons[0], scale, count);
    let pairs = [(polygons[0].clone(), polygons[3].clone())];
    let options = SampleOptions { resolution: FRAME[0] as u32 };
    for (name, engine) in [("lanes f32", Some(&Engine::cpu())), ("device", gpu)] {
        let Some(engine) = engine else { continue };
        let spent = best(2, || {
            jacobian_min(engine, Coordinates::MeanValue, &pairs, &options)?;
            Ok(())
        })?;
        let inside = std::f64::consts::FRAC_PI_4 * count as f64;
        let seconds = spent.cpu / 2.0;
        println!("  {name}: smallest Jacobian {seconds:.3} s, {:.1} x", baseline * 1e-9 * inside / seconds);
        let spent = best(1, || Ok(map_points(engine, &steps, &mut points.clone())?))?;
        let seconds = spent.cpu / 2.0;
        println!("  {name}: nine steps {seconds:.3} s, {:.1} x", 9.0 * baseline * 1e-9 * count as f64 / seconds);
    }
    Ok(())
}

fn main() -> Result<()> {
    let gpu = Engine::new(EngineOptions { backend: Backend::Gpu, ..EngineOptions::default() });
    match &gpu {
        Ok(engine) => println!("{}", engine.description()),
        Err(e) => println!("no device: {e}"),
    }
    println!("lanes: {}", Lanes::detect().name());
    let gpu = gpu.as_ref().ok();
    if let Some(engine) = gpu {
        let (from, to) = (polygon(5, 0.0), polygon(5, 0.3));
        let step = Step::<f32>::new(Coordinates::MeanValue, &from, &to, 0.03);
        let (done, spent) = once(|| map_points(engine, std::slice::from_ref(&step), &mut [[0.0; 2]]));
        done?;
        println!("first dispatch of map_points: {:.3} s of CPU time", spent.cpu);
        let options = SampleOptions { resolution: 1 };
        let (done, spent) = once(|| jacobian_min(engine, Coordinates::MeanValue, &[(from, to)], &options));
        done?;
        println!("first dispatch of jacobian_min: {:.3} s of CPU time", spent.cpu);
    }
    one_step(8, 1 << 19, gpu)?;
    let baseline = one_step(64, 1 << 18, gpu)?;
    one_step(512, 1 << 15, gpu)?;
    frame(64, baseline, gpu)
}
