//! Mean value coordinates in space: points through cages of n faces, on lanes, one at a time and on
//! a device, beside the formulas as Ju, Schaefer and Warren 2005 print them.

use std::hint::black_box;
use std::time::Instant;

use barymap::engine::{Engine, Lanes};
use barymap::mapping::space::{Frame, Samples, Step, jacobian_min_3d, map_points_3d};
use barymap::models::shapes::{Random, uv_sphere};
use glam::DVec3;

/// Best of `rounds`, in seconds.
fn best(rounds: usize, mut work: impl FnMut()) -> f64 {
    work();
    let once = |_| {
        let clock = Instant::now();
        work();
        clock.elapsed().as_secs_f64()
    };
    (0..rounds).map(once).fold(f64::INFINITY, f64::min)
}

/// The coordinates as printed, in double precision, and the image of one point.
fn printed(triangles: &[[u32; 3]], from: &[DVec3], to: &[DVec3], x: DVec3) -> DVec3 {
    let (mut sum, mut total) = (DVec3::ZERO, 0.0);
    for t in triangles {
        let p = t.map(|v| from[v as usize] - x);
        let d = p.map(DVec3::length);
        let u = [0, 1, 2].map(|i| p[i] / d[i]);
        let theta = [0, 1, 2].map(|i| 2.0 * (0.5 * (u[(i + 1) % 3] - u[(i + 2) % 3]).length()).asin());
        let h = theta.iter().sum::<f64>() / 2.0;
        let side = u[0].dot(u[1].cross(u[2])).signum();
        let sines = theta.map(f64::sin);
        let c =
            [0, 1, 2].map(|i| 2.0 * h.sin() * (h - theta[i]).sin() / (sines[(i + 1) % 3] * sines[(i + 2) % 3]) - 1.0);
        let s = c.map(|c| side * (1.0 - c * c).max(0.0).sqrt());
        for i in 0..3 {
            let (k, l) = ((i + 1) % 3, (i + 2) % 3);
            let w = (theta[i] - c[k] * theta[l] - c[l] * theta[k]) / (2.0 * d[i] * sines[k] * s[l]);
            sum += w * to[t[i] as usize];
            total += w;
        }
    }
    sum / total
}

fn main() {
    let gpu =
        Engine::new(barymap::engine::EngineOptions { backend: barymap::engine::Backend::Gpu, ..Default::default() });
    let (cpu, lanes) = (Engine::cpu(), Lanes::detect());
    println!("lanes: {}, {} threads", lanes.name(), rayon::current_num_threads());
    if let Ok(gpu) = &gpu {
        println!("device: {}", gpu.description());
    }
    let mut random = Random::new(1);
    let mut point = || [0, 1, 2].map(|_| random.signed() * 0.3);
    let many: Vec<[f64; 3]> = (0..28_000).map(|_| point()).collect();
    println!("faces | points | f32 lanes, ns a pair | f64 lanes | f32 with Jacobian | device | as printed, 1 thread");
    for (slices, stacks) in [(4, 3), (8, 6), (16, 11), (32, 20)] {
        let mesh = uv_sphere(1.0, slices, stacks);
        let to: Vec<DVec3> = mesh.positions.iter().map(|p| *p * DVec3::new(1.1, 0.9, 1.0)).collect();
        let (triangles, scale) = (mesh.triangles(), Frame::common_scale([&mesh.positions[..], &to[..]]));
        let step = Step::new(&triangles, &mesh.positions, &to, scale);
        let points = &many[..if triangles.len() > 500 { 7_000 } else { 28_000 }];
        let pairs = (points.len() * triangles.len()) as f64 * 1e-9;
        let narrow: Vec<[f32; 3]> = points.iter().map(|p| p.map(|x| x as f32)).collect();
        let single = step.cast::<f32>();
        let f32_time = best(3, || single.map_all(lanes, black_box(&mut narrow.clone())));
        let f64_time = best(2, || step.map_all(lanes, black_box(&mut points.to_vec())));
        let jacobian = best(2, || {
            black_box(single.evaluate_all(lanes, &narrow));
        });
        let device = gpu.as_ref().map_or(f64::NAN, |gpu| {
            best(1, || {
                let fault = map_points_3d(gpu, std::slice::from_ref(&step), black_box(&mut narrow.clone()));
                assert!(fault.is_ok(), "{fault:?}");
            })
        });
        let few = &points[..700];
        let old = best(2, || {
            few.iter().for_each(|p| {
                black_box(printed(&triangles, &mesh.positions, &to, DVec3::from(*p) / scale));
            });
        }) * (points.len() / few.len()) as f64;
        let per = |seconds: f64| seconds / pairs;
        println!(
            "{} | {} | {:.1} | {:.1} | {:.1} | {:.1} | {:.1}",
            triangles.len(),
            points.len(),
            per(f32_time),
            per(f64_time),
            per(jacobian),
            per(device),
            per(old)
        );
    }
    // The sentence of the requirement: 28,000 vertices, 330 faces, 20 steps.
    let mesh = uv_sphere(1.0, 15, 12);
    let to: Vec<DVec3> = mesh.positions.iter().map(|p| *p * DVec3::new(1.01, 0.99, 1.0)).collect();
    let scale = Frame::common_scale([&mesh.positions[..], &to[..]]);
    let steps = vec![Step::new(&mesh.triangles(), &mesh.positions, &to, scale); 20];
    let narrow: Vec<[f32; 3]> = many.iter().map(|p| p.map(|x| x as f32)).collect();
    let time = best(2, || {
        let fault = map_points_3d(&cpu, &steps, black_box(&mut narrow.clone()));
        assert!(fault.is_ok(), "{fault:?}");
    });
    println!(
        "{} points x {} faces x {} steps on the CPU: {time:.2} s",
        narrow.len(),
        mesh.triangle_count(),
        steps.len()
    );
    let frame = Frame::of(&mesh.positions, scale);
    let found = best(2, || {
        let samples = Samples::new(&steps[0], 24);
        let minimum = samples.and_then(|s| jacobian_min_3d(&cpu, &steps[0], &frame, &s, &narrow));
        assert!(minimum.is_ok(), "{minimum:?}");
    });
    println!("smallest Jacobian of one step over its samples and {} vertices: {found:.2} s", narrow.len());
}
