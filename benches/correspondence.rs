//! Inverse and forward problem: 100,000 random points of one mesh (table 1 of Panozzo et al. 2013),
//! and the map between two surfaces on every back end.
//!
//! `cargo bench --bench correspondence`. Figures are process CPU time / 2 in ns per point, best of
//! three rounds after a warm-up. The driver's shader cache is off, so that the first dispatch of
//! each kernel shows what compiling it takes.

mod support;

use barymap::engine::{Backend, Buffer, Compaction, Engine, EngineOptions, Gpu, Kernel, LaneScalar, Lanes, Matching};
use barymap::geometry::{NONE, SurfacePoint};
use barymap::models::{character_pair, stout, strider};
use barymap::surface::average::{AveragedChunk, SweepAnchors, orthonormalise, weights};
use barymap::surface::correspondence::{CorrespondenceOptions, Method, WeightedAverages};
use barymap::surface::gpu::{AverageParams, DeviceMap, KERNELS, ProjectParams, Projected, SurfaceTables};
use barymap::surface::project::{Projection, SearchLimits};
use barymap::surface::{AnchorPairs, NearestVertex, PackedImage, PackedPoint, PhongSurface, PointMap};
use rayon::prelude::*;
use support::{Result, Spent, Surface, best, data, once, random_points};

const D: usize = 8;
const ANCHORS: usize = 93;
const ANCHOR_COUNTS: [usize; 3] = [27, 64, ANCHORS];
/// Points of table 1 of the paper.
const POINTS: usize = 100_000;
/// Points of a map: the largest tile of the device.
const MAPPED: usize = 131_072;
const ROUNDS: usize = 3;
/// Points of a task.
const TASK: usize = 512;

/// One row of table 1: weights of random points as such (f64) and fused with the average (f32
/// lanes), then the projections of these averages, searched from the nearest anchor or from the
/// nearest vertex of all.
fn table_row(name: &str, surface: &Surface) -> Result<()> {
    let phong = PhongSurface::<f64, D>::new(&surface.topology, &surface.embedding.points)?;
    let vertices = surface.farthest(ANCHORS);
    let anchors: Vec<[f64; D]> = vertices.iter().map(|&v| phong.vertices[v as usize].y).collect();
    let points = random_points(&surface.mesh, POINTS, 1);
    let n = anchors.len();
    let mut rows = vec![0.0; POINTS * n];
    let inverse = best(ROUNDS, || {
        rows.par_chunks_mut(n).zip(&points).for_each(|(row, p)| {
            let (t, x) = (phong.triangle(p.face), p.unpack().barycentric);
            weights(&t.point(&x), &orthonormalise(t.psi(&x)), &anchors, row);
        });
        Ok(())
    })?;
    let nearest = NearestVertex::new(&phong);
    let phong = phong.cast::<f32>();
    let own: Vec<[f32; D]> = vertices.iter().map(|&v| phong.vertices[v as usize].y).collect();
    let mut means = vec![[0.0; D]; POINTS];
    let fused = best(ROUNDS, || {
        means.par_chunks_mut(TASK).zip(points.par_chunks(TASK)).for_each_init(
            AveragedChunk::<f32, D>::new,
            |chunk, (means, points)| {
                let anchors = SweepAnchors { own: &own, images: &[&own], transport: None };
                chunk.compute(Lanes::detect(), &phong, anchors, points);
                means.iter_mut().enumerate().for_each(|(i, m)| *m = chunk.mean(0, i));
            },
        );
        Ok(())
    })?;
    let project = |start: &(dyn Fn(&[f32; D]) -> Projection<f32> + Sync)| -> Result<_> {
        let mut found = Vec::new();
        let spent = best(ROUNDS, || {
            means.par_iter().map(start).collect_into_vec(&mut found);
            Ok(())
        })?;
        let edge = surface.mesh.mean_edge_length();
        let at = |f: u32, x: [f64; 3]| SurfacePoint::new(f, x).position(&surface.mesh);
        let returned = points.iter().zip(&found).filter(|(p, f)| {
            f.face != NONE && at(p.face, p.unpack().barycentric).distance(at(f.face, f.x.map(f64::from))) <= edge
        });
        Ok((spent.per_item(POINTS), 100.0 * returned.count() as f64 / POINTS as f64))
    };
    let limits = SearchLimits::SECOND;
    let from_anchor = project(&|mean| phong.project(mean, &vertices, limits))?;
    let from_vertex = project(&|mean| phong.project(mean, &[nearest.find(mean)], limits))?;
    println!(
        "| {name} | {} | {n} | {:.0} | {:.0} | {:.0} | {:.1} % | {:.0} | {:.1} % |",
        surface.mesh.triangle_count(),
        inverse.per_item(POINTS),
        fused.per_item(POINTS),
        from_anchor.0,
        from_anchor.1,
        from_vertex.0,
        from_vertex.1
    );
    Ok(())
}

/// Inverse problem and average alone, in lanes: of the source's anchors, or of the target's own
/// too.
fn average<E: LaneScalar>(map: &WeightedAverages<E, D>, points: &[PackedPoint], lists: usize) -> Result<Spent> {
    let images = [map.table.image.as_slice(), map.table.own.as_slice()];
    best(ROUNDS, || {
        points.par_chunks(TASK).for_each_init(AveragedChunk::<E, D>::new, |chunk, points| {
            let transport = map.transport.as_ref();
            let anchors = SweepAnchors { own: &map.table.own, images: &images[..lists], transport };
            chunk.compute(Lanes::detect(), &map.target, anchors, points);
        });
        Ok(())
    })
}

fn whole(map: &dyn PointMap, points: &[PackedPoint]) -> Result<Spent> {
    let mut images: Vec<PackedImage> = Vec::new();
    best(ROUNDS, || Ok(map.map(points, &mut images)?))
}

/// The kernels one by one: what the first dispatch takes with its compilation, and what they take
/// warm.
fn kernels(gpu: &Gpu, map: &WeightedAverages<f32, D>, points: &[PackedPoint], first: bool) -> Result<()> {
    let n = points.len();
    let (target, source) =
        (SurfaceTables::new(gpu, "target", &map.target)?, SurfaceTables::new(gpu, "source", &map.source)?);
    let starts: Vec<[u32; 4]> = (0..map.target.triangles.len() as u32)
        .map(|t| {
            let [a, b, c] = map.starts_of(t);
            [a, b, c, map.start_faces[t as usize]]
        })
        .collect();
    let starts = gpu.table("starts", &starts)?;
    let corrections: Vec<[f32; 12]> = map
        .corrections
        .iter()
        .map(|c| {
            std::array::from_fn(|i| {
                if i < D {
                    c.d[i]
                } else if i == D {
                    c.residual
                } else {
                    0.0
                }
            })
        })
        .collect();
    let corrections = gpu.table("corrections", &corrections)?;
    let block: Vec<[f32; D]> = map.table.own.iter().zip(&map.table.image).flat_map(|(a, b)| [*a, *b]).collect();
    let anchors = gpu.uniform_blocks("anchors", &block)?;
    let limits = SearchLimits::FIRST;
    let most = u64::from(source.most_stops) + 1;
    let vertex_steps = (u64::from(gpu.capabilities().loop_budget) / 2 / most).min(u64::from(limits.vertex_steps));
    let project_params: ProjectParams =
        bytemuck::cast([6, 0, 0, vertex_steps as u32, limits.triangle_steps, 0u32, 0, 0]);
    let (average_params, project_params) = (
        gpu.uniform("average parameters", &AverageParams::new(map, 0))?,
        gpu.uniform("projection parameters", &project_params)?,
    );

    let input = gpu.upload("points", points)?;
    let averages: Buffer<[f32; D]> = gpu.buffer("averages", 3 * n)?;
    let results: Buffer<Projected> = gpu.buffer("projections", n)?;
    let words = |bytes: usize| (bytes / size_of::<u32>()) as u32;
    let (stride, offset) = (words(size_of::<Projected>()), words(std::mem::offset_of!(Projected, found)));
    let matching = Matching { stride, offset, value: Projected::LEFT, mask: Projected::HOW };
    let left = Compaction::new(gpu, &results, n, matching)?;
    let bindings = |kernel: &Kernel| {
        let (v, t) = (source.vertices.bind(), source.triangles.bind());
        let p = project_params.bind(0);
        match kernel.name {
            "average_anchors" => vec![
                average_params.bind(0),
                anchors.bind(0),
                input.bind(),
                averages.bind(),
                target.vertices.bind(),
                target.triangles.bind(),
                corrections.bind(),
            ],
            "project_phong" => {
                vec![p, averages.bind(), input.bind(), results.bind(), v, t, source.stops.bind(), starts.bind()]
            }
            _ => {
                let list = left.list().bind();
                vec![p, averages.bind(), list, results.bind(), v, t, source.bounds.bind(), source.near.bind()]
            }
        }
    };
    // The three in R^8; those of fields are timed by benches/field.rs as a whole.
    for &kernel in KERNELS.iter().filter(|k| !k.source.contains("vector12")) {
        let (prepared, compiled) = once(|| -> Result<_> {
            let pipeline = gpu.pipeline(kernel)?;
            let group = gpu.bind(&pipeline, &bindings(kernel))?;
            let mut batch = gpu.batch()?;
            batch.dispatch(&pipeline, &group, 64)?;
            gpu.wait(&batch.submit()?)?;
            Ok((pipeline, group))
        });
        let (pipeline, group) = prepared?;
        let warm = best(ROUNDS, || {
            let mut batch = gpu.batch()?;
            batch.dispatch(&pipeline, &group, n)?;
            Ok(gpu.wait(&batch.submit()?)?)
        })?;
        // The list of what the walk left is what the search works on.
        let mut batch = gpu.batch()?;
        left.record(&mut batch, n)?;
        gpu.wait(&batch.submit()?)?;
        // One thread compiles: its CPU time is what an idle machine waits.
        let compiling = if first {
            format!("{:.0} | {:.0}", 1e3 * compiled.wall, 1e3 * compiled.cpu)
        } else {
            "compiled | compiled".into()
        };
        println!("| {} | {} | {compiling} | {:.0} |", map.table.len(), kernel.name, warm.per_item(n));
    }
    Ok(())
}

fn map_rows(
    source: &Surface,
    target: &Surface,
    anchors: &AnchorPairs,
    points: &[PackedPoint],
    gpu: Option<&Engine>,
) -> Result<()> {
    for method in [Method::Averages, Method::Transport] {
        for confidence in [false, true] {
            let options = CorrespondenceOptions { method, confidence, ..CorrespondenceOptions::default() };
            let double = WeightedAverages::<f64, D>::new(source.shape(), target.shape(), anchors, &options)?;
            let single = WeightedAverages::<f32, D>::new(source.shape(), target.shape(), anchors, &options)?;
            let lists = if confidence || method == Method::Transport { 2 } else { 1 };
            let reference = (average(&double, points, lists)?, whole(&double, points)?);
            let cpu = (average(&single, points, lists)?, whole(&single, points)?);
            let row = |name: &str, average: Option<Spent>, whole: Spent| {
                let ns = |s: Spent| s.per_item(points.len());
                println!(
                    "| {} | {} | {} | {name} | {} | {:.0} | {:.0} | {:.2} |",
                    anchors.len(),
                    method.word(),
                    if confidence { "yes" } else { "no" },
                    average.map_or("".into(), |s| format!("{:.0}", ns(s))),
                    ns(whole),
                    whole.wall / points.len() as f64 * 1e9,
                    ns(reference.1) / ns(whole)
                );
            };
            row("f64 lanes", Some(reference.0), reference.1);
            row("f32 lanes", Some(cpu.0), cpu.1);
            if let Some(engine) = gpu {
                let map = DeviceMap::<WeightedAverages<f32, 8>>::new(engine, single)?;
                row("device", None, whole(&map, points)?);
            }
        }
    }
    Ok(())
}

fn main() -> Result<()> {
    support::without_shader_cache()?;
    let pair = character_pair();
    let (source, target) = (Surface::new(pair.source.mesh.clone())?, Surface::new(pair.target.mesh.clone())?);
    let anchors = |n: usize| {
        let (source, target) = pair.anchors(n);
        AnchorPairs { source, target }
    };
    // In the order of faces, as the texels of an atlas lie.
    let mut points = random_points(&target.mesh, MAPPED, 2);
    points.sort_by_key(|p| p.face);
    println!(
        "average (inverse problem and average) and whole map, ns per point; {MAPPED} points, source {} faces, target {}; {} threads, lanes {}",
        source.mesh.triangle_count(),
        target.mesh.triangle_count(),
        rayon::current_num_threads(),
        Lanes::detect().name()
    );
    let engine = match Engine::new(EngineOptions { backend: Backend::Gpu, ..EngineOptions::default() }) {
        Ok(engine) => Some(engine),
        Err(e) => {
            println!("no device: {e}");
            None
        }
    };
    if let Some(engine) = &engine {
        println!("device: {}; shader cache off", engine.description());
        println!("| anchors | kernel | first dispatch (64 points), wall ms | CPU ms | warm, CPU / 2, ns per point |");
        println!("|---|---|---|---|---|");
        let options = CorrespondenceOptions::default();
        for (i, n) in ANCHOR_COUNTS.into_iter().enumerate() {
            let map = WeightedAverages::<f32, D>::new(source.shape(), target.shape(), &anchors(n), &options)?;
            if let Some(gpu) = engine.gpu() {
                kernels(gpu, &map, &points, i == 0)?;
            }
        }
    }
    println!(
        "\n| anchors | method | confidence | back end | average | average + projection | the same, wall | f64 / this |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for n in ANCHOR_COUNTS {
        map_rows(&source, &target, &anchors(n), &points, engine.as_ref())?;
    }

    println!("\n{POINTS} random points of one mesh, without initial guess; ns per point");
    println!(
        "| mesh | faces | anchors | weights, f64 | weights and average, f32 lanes | projection from the nearest anchor, f32 | returned within an edge | from the nearest vertex | returned |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    table_row("strider", &Surface::new(strider().mesh)?)?;
    table_row("stout", &Surface::new(stout().mesh)?)?;
    if let Some(folder) = data() {
        for name in ["textured/human_male/human_male", "mesh/horse_40k", "mesh/igea_150k"] {
            table_row(name, &Surface::read(folder.join(format!("{name}.obj")))?)?;
        }
    }
    Ok(())
}
