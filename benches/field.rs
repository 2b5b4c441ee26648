//! The method `field`: preparation, edits of anchors, a texture that follows them, and the map on
//! every back end beside `transport`.
//!
//! `cargo bench --bench field`. With `BARYMAP_DATA` two people of about 13,000 vertices, else the
//! built-in characters. Figures are process CPU time / 2 (what two idle cores take at best) and
//! wall time, best of three rounds after a warm-up.

mod support;

use barymap::engine::{Backend, Engine, EngineOptions};
use barymap::geometry::SurfacePoint;
use barymap::models::character_pair;
use barymap::picture::{Image, Pixels};
use barymap::progress::Quiet;
use barymap::surface::correspondence::{CorrespondenceOptions, Method, Precision, correspondence};
use barymap::surface::field::{Edit, Field, FieldOptions, FieldPair, FieldSession};
use barymap::surface::gpu::{DeviceMap, correspondence_on};
use barymap::surface::{AnchorPairs, PackedImage, PackedPoint, PointMap};
use barymap::tools::transfer::{DeviceLiveTransfer, Layer, LiveTransfer, TransferOptions, transfer};
use support::{Result, Spent, Surface, best, data, once, random_points};

const ANCHORS: [usize; 2] = [27, 93];
const POINTS: usize = 131_072;
const ROUNDS: usize = 3;

fn row(what: &str, s: Spent, items: usize) {
    if items > 1 {
        let wall = s.wall / items as f64 * 1e9;
        println!("| {what} | {:.0} ns per point | {wall:.0} ns |", s.per_item(items));
    } else {
        println!("| {what} | {:.1} ms | {:.1} ms |", s.cpu / 2.0 * 1e3, s.wall * 1e3);
    }
}

fn pair() -> Result<(Surface, Surface)> {
    match data() {
        Some(folder) => {
            let read = |who: &str| Surface::read(folder.join(format!("textured/human_{who}/human_{who}.obj")));
            Ok((read("male")?, read("female")?))
        }
        None => {
            let pair = character_pair();
            Ok((Surface::new(pair.source.mesh)?, Surface::new(pair.target.mesh)?))
        }
    }
}

/// Anchors far from one another on the target; on the source the same vertices where the meshes
/// have them in common, as the people do, else the built-in truth.
fn anchors(source: &Surface, target: &Surface, count: usize) -> Result<AnchorPairs> {
    if source.mesh.vertex_count() != target.mesh.vertex_count() {
        let (source, target) = character_pair().anchors(count);
        return Ok(AnchorPairs { source, target });
    }
    let vertices = target.farthest(count);
    let on = |s: &Surface| vertices.iter().map(|&v| s.vertex(v)).collect::<Result<Vec<SurfacePoint>>>();
    Ok(AnchorPairs { source: on(source)?, target: on(target)? })
}

/// A vertex next to the one at `p`.
fn beside(surface: &Surface, p: &SurfacePoint) -> Result<SurfacePoint> {
    surface.vertex(surface.mesh.triangle(p.face as usize)[(p.dominant_corner() + 1) % 3])
}

fn edits(source: &Surface, target: &Surface, anchors: &AnchorPairs) -> Result<()> {
    let n = anchors.len();
    let prepare = best(ROUNDS, || {
        FieldPair::<8>::new(source.shape(), target.shape())?;
        Ok(())
    })?;
    row(&format!("both surfaces prepared ({n} anchors)"), prepare, 1);
    let pair = FieldPair::<8>::new(source.shape(), target.shape())?;
    for relax in [true, false] {
        let options = FieldOptions { relax, ..FieldOptions::default() };
        let whole = best(ROUNDS, || {
            pair.field::<f32, 12>(anchors, &options)?;
            Ok(())
        })?;
        row(if relax { "whole field, for an edit" } else { "the same, not relaxed" }, whole, 1);
    }
    let (session, begun) = once(|| FieldSession::<f32, 8, 12>::new(pair, anchors.clone(), &FieldOptions::default()));
    let mut session = session?;
    row("session begun", begun, 1);
    // To the next vertex and back, on the source, on both.
    let (s, t) = (anchors.source[n / 2], anchors.target[n / 2]);
    let (s2, t2) = (beside(source, &s)?, beside(target, &t)?);
    for (what, there) in [("dragged on the source", (s2, t)), ("dragged on both", (s2, t2))] {
        let mut away = false;
        let spent = best(2 * ROUNDS, || {
            away = !away;
            let (a, b) = if away { there } else { (s, t) };
            session.edit(&[Edit::Move(n / 2, a, b)])?;
            Ok(())
        })?;
        row(what, spent, 1);
    }
    let added = best(ROUNDS, || {
        session.edit(&[Edit::Remove(0)])?;
        session.edit(&[Edit::Add(anchors.source[0], anchors.target[0])])?;
        Ok(())
    })?;
    row("removed and added again", added, 1);
    Ok(())
}

/// A mesh mapped to itself, one anchor dragged to and fro: its texture follows.
fn self_map(mesh: &Surface, count: usize) -> Result<()> {
    const SIDE: u32 = 2048;
    let points = mesh.farthest(count).into_iter().map(|v| mesh.vertex(v)).collect::<Result<Vec<SurfacePoint>>>()?;
    let anchors = AnchorPairs { source: points.clone(), target: points.clone() };
    let pair = FieldPair::<8>::new(mesh.shape(), mesh.shape())?;
    let mut session = FieldSession::<f32, 8, 12>::new(pair, anchors, &FieldOptions::default())?;
    let samples = (0..SIDE * SIDE * 3).map(|i| (i.wrapping_mul(0x9e37_79b9) >> 24) as u8).collect();
    let image = Image::new(SIDE, SIDE, 3, Pixels::U8(samples))?;
    let layers = [Layer::single("colour", &image)];
    let options = TransferOptions { width: SIDE, height: SIDE, ..TransferOptions::default() };
    let whole = best(ROUNDS, || {
        transfer(&mesh.mesh, &layers, &mesh.mesh, session.field(), &options, &Quiet)?;
        Ok(())
    })?;
    row(&format!("self-map, {count} anchors: whole texture, {SIDE} x {SIDE}"), whole, 1);
    let mut live = LiveTransfer::new(&mesh.mesh, &layers, &mesh.mesh, session.field(), &options)?;
    let start = points[count / 2];
    let there = beside(mesh, &start)?;
    let mut away = false;
    let (mut recolored, mut all) = (0, 0);
    let spent = best(2 * ROUNDS, || {
        away = !away;
        let triangles = session.edit(&[Edit::Move(count / 2, start, if away { there } else { start })])?;
        let followed = live.update(session.field(), &triangles)?;
        recolored = recolored.max(followed.recolored);
        all = live.covered();
        Ok(())
    })?;
    let share = 100.0 * recolored as f64 / all as f64;
    row(&format!("the same, an anchor dragged, {share:.1} % of the texels coloured again"), spent, 1);
    let Ok(engine) = Engine::new(EngineOptions { backend: Backend::Gpu, ..EngineOptions::default() }) else {
        return Ok(());
    };
    let Some(gpu) = engine.gpu() else { return Ok(()) };
    let mut map = DeviceMap::<Field<f32, 12>>::new(&engine, session.field().clone())?;
    let mut live = DeviceLiveTransfer::new(&engine, &mesh.mesh, &layers, &mesh.mesh, &map, &options)?;
    let (mut frames, mut edits, before) = (0, 0, gpu.traffic());
    let spent = best(2 * ROUNDS, || {
        away = !away;
        let triangles = session.edit(&[Edit::Move(count / 2, start, if away { there } else { start })])?;
        map.follow(session.field(), &triangles)?;
        live.update(&triangles)?;
        edits += 1;
        loop {
            frames += 1;
            let (frame, submission) = live.draw(&map, 1 << 17)?;
            gpu.wait(&submission)?;
            if frame.left == 0 {
                return Ok(());
            }
        }
    })?;
    let up = (gpu.traffic() - before).bytes_up / edits / 1000;
    row(&format!("the same on a device, {} frames and {up} kB up an edit", frames / edits), spent, 1);
    Ok(())
}

fn whole(map: &dyn PointMap, points: &[PackedPoint]) -> Result<Spent> {
    let mut images: Vec<PackedImage> = Vec::new();
    best(ROUNDS, || Ok(map.map(points, &mut images)?))
}

fn main() -> Result<()> {
    support::without_shader_cache()?;
    let (source, target) = pair()?;
    let (s, t) = (source.mesh.vertex_count(), target.mesh.vertex_count());
    println!("source {s} vertices, target {t}; {} threads", rayon::current_num_threads());
    println!("| what | CPU / 2 | wall |\n|---|---|---|");
    for n in ANCHORS {
        edits(&source, &target, &anchors(&source, &target, n)?)?;
    }
    self_map(&source, ANCHORS[1])?;
    let anchors = anchors(&source, &target, ANCHORS[1])?;
    let mut points = random_points(&target.mesh, POINTS, 2);
    points.sort_by_key(|p| p.face);
    for method in [Method::Transport, Method::Field] {
        for precision in [Precision::Double, Precision::Single] {
            let options = CorrespondenceOptions { method, precision, ..CorrespondenceOptions::default() };
            let map = correspondence(source.shape(), target.shape(), &anchors, &options)?;
            row(&format!("{} mapped, {precision:?} precision", method.word()), whole(map.as_ref(), &points)?, POINTS);
        }
        if let Ok(engine) = Engine::new(EngineOptions { backend: Backend::Gpu, ..EngineOptions::default() }) {
            let options = CorrespondenceOptions { method, ..CorrespondenceOptions::default() };
            let (map, _) = correspondence_on(&engine, source.shape(), target.shape(), &anchors, &options)?;
            row(&format!("{} mapped, device", method.word()), whole(map.as_ref(), &points)?, POINTS);
        }
    }
    // The field's own accuracy is benches/accuracy.rs.
    let field = Field::<f32, 12>::new::<8>(source.shape(), target.shape(), &anchors, &FieldOptions::default())?;
    println!("turned triangles before and after the repair: {:?}", field.field().map(|f| f.turned));
    Ok(())
}
