//! Decodes on devices: exactness, the standard set, what falls back to the CPU.

use barymap::encoding::{Connectivity, HierarchyOptions, Quality};
use barymap::engine::{Backend, Engine, EngineOptions};
use barymap::geometry::Mesh;
use barymap::io::cache::Cache;
use barymap::models::shapes::{Diagonal, irregular_plane, lobed_sphere, torus};
use barymap::tools::deform::{Deformer, Handles};
use glam::{DQuat, DVec3};

use crate::common::{data, load};
use crate::tube::{Pose, Tube};
use crate::{downlevel, engine};

fn deformer(engine: &Engine, mesh: &Mesh, handles: &[u32]) -> Deformer {
    let wanted = Handles { vertices: handles.to_vec(), region: None };
    let mut deformer = Deformer::new(mesh, wanted, &HierarchyOptions::default(), &Cache::disabled()).unwrap();
    deformer.decode_on(engine);
    deformer
}

/// `count` vertices of every component, spread over its numbering.
fn spread(mesh: &Mesh, count: usize) -> Vec<u32> {
    let c = Connectivity::new(mesh);
    (0..c.component_count)
        .flat_map(|k| {
            let members: Vec<u32> = (0..mesh.vertex_count() as u32).filter(|&v| c.component[v as usize] == k).collect();
            let n = count.min(members.len());
            (0..n).map(|i| members[i * members.len() / n]).collect::<Vec<_>>()
        })
        .collect()
}

/// The largest distance from where the similarity of all handles takes the mesh, over the image's
/// diagonal.
fn off(mesh: &Mesh, found: &[DVec3], image: impl Fn(DVec3) -> DVec3, size: f64) -> f64 {
    let used = (0..mesh.vertex_count()).filter(|&v| mesh.positions[v].is_finite());
    used.map(|v| found[v].distance(image(mesh.positions[v]))).fold(0.0, f64::max) / size
}

/// Rest, half a turn and more, growth, and a place far away; everything on the device in one pass.
fn check_similarities(engine: &Engine, mesh: &Mesh, quality: &Quality) {
    let handles = spread(mesh, 8);
    let mut deformer = deformer(engine, mesh, &handles);
    let (low, high) = mesh.bounds().unwrap();
    let diagonal = low.distance(high);
    for (degrees, scale, shift) in [(0.0, 1.0, 0.0), (180.0, 1.0, 0.0), (200.0, 2.5, 0.0), (77.0, 0.01, 50.0)] {
        let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), f64::to_radians(degrees));
        let image = |p: DVec3| turn * (p - low) * scale + low + DVec3::splat(shift * diagonal);
        let targets: Vec<DVec3> = handles.iter().map(|&v| image(mesh.positions[v as usize])).collect();
        let result = deformer.deform(&targets, quality, false).unwrap();
        let worst = off(mesh, &result.positions, image, diagonal * scale);
        println!("{}, {degrees} x {scale}: {worst:.1e}", mesh.name);
        assert!(worst <= 2e-6, "{}, {degrees} x {scale}: {worst:e}", mesh.name);
        // Nothing is iterated on the device, whatever the quality; far away the processor's stages
        // see the rounding of their numbers.
        let mut levels = result.report.levels.iter().filter(|l| l.on_device || shift == 0.0);
        assert!(levels.all(|l| l.iterations == 0), "{}, {degrees} x {scale}: {:?}", mesh.name, result.report);
        let mut wrong = result.positions.clone();
        wrong[handles[0] as usize].y += 1e-5 * diagonal * scale;
        assert!(off(mesh, &wrong, image, diagonal * scale) > 2e-6);
        let again = deformer.deform(&targets, quality, false).unwrap();
        assert_eq!(again.positions, result.positions, "not the same bytes");
    }
    let device = deformer.decoder().device().unwrap();
    assert!(device.ran().any(|s| s == "split_level") && device.notes().is_empty(), "{:?}", device.notes());
}

#[test]
fn similarities_are_exact_on_generated_meshes() {
    for engine in [engine(), downlevel()].into_iter().flatten() {
        for mesh in [
            lobed_sphere(3, 0.5),
            torus(2.0, 0.7, 40, 20, Diagonal::Forward),
            irregular_plane(20, 20, 1.0, 1.0, Diagonal::Alternating, 0.3, 7),
            Tube::small().mesh,
        ] {
            check_similarities(engine, &mesh, &Quality::SPLITS);
        }
        // Stages of the device find nothing to do.
        check_similarities(engine, &Tube::medium().mesh, &Quality::DEFAULT);
    }
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn similarities_are_exact_on_real_meshes() {
    let Some(engine) = engine() else { return };
    let mut files: Vec<_> =
        std::fs::read_dir(data("mesh")).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap()).collect();
    files.sort();
    files.retain(|f| f.ends_with(".obj"));
    for file in &files {
        check_similarities(engine, &load(&format!("mesh/{file}")), &Quality::SPLITS);
    }
    assert!(files.len() > 12, "{files:?}");
}

/// G on a device beside G on the processor; `stages` of the device's own.
fn check_minima(engine: &Engine, tube: &Tube, pose: Pose, quality: &Quality, stages: usize) {
    let handles = tube.caps();
    let targets = tube.targets(&handles, pose);
    let mut on_cpu = deformer(&Engine::cpu(), &tube.mesh, &handles);
    let mut on_device = deformer(engine, &tube.mesh, &handles);
    let expected = on_cpu.deform(&targets, quality, false).unwrap();
    let found = on_device.deform(&targets, quality, false).unwrap();
    let (a, b) = (on_cpu.measures(&expected.positions), on_device.measures(&found.positions));
    println!("{pose:?}: G {:.4e} for {:.4e} on the processor", b.g, a.g);
    assert!(b.g <= 1.05 * a.g && b.flipped == a.flipped, "{pose:?}: {b:?} for {a:?}");
    assert_eq!(found.report.levels.iter().filter(|l| l.on_device).count(), stages, "{:?}", found.report);
    let last = found.report.levels.last().unwrap();
    assert!(last.gradient_steps > 10 && last.after < 0.5 * last.before, "{last:?}");
    // What the device says of itself is what double precision finds.
    assert!((last.after / b.g - 1.0).abs() < 0.01, "{last:?} {b:?}");
    let again = on_device.deform(&targets, quality, false).unwrap();
    assert_eq!(again.positions, found.positions, "not the same bytes");
    for (&v, t) in handles.iter().zip(&targets) {
        assert_eq!(found.positions[v as usize], *t);
    }
}

#[test]
fn the_tube_is_as_good_as_on_the_processor() {
    if let Some(engine) = engine() {
        check_minima(engine, &Tube::medium(), Pose::Twist(90.0), &Quality::DEFAULT, 1);
    }
    for engine in [engine(), downlevel()].into_iter().flatten() {
        for pose in [Pose::Twist(90.0), Pose::Bend(120.0)] {
            check_minima(engine, &Tube::small(), pose, &Quality { direct: 100, ..Quality::DEFAULT }, 2);
        }
    }
}

#[test]
fn frames_follow_one_another_and_a_stiffness_is_the_processors_work() {
    let Some(engine) = engine() else { return };
    let tube = Tube::small();
    let handles = tube.points();
    let mut deformer = deformer(engine, &tube.mesh, &handles);
    let quality = Quality { direct: 100, ..Quality::DEFAULT };
    let mut frame = |degrees: f64, quality: &Quality, warm: bool| {
        deformer.deform(&tube.targets(&handles, Pose::Bend(degrees)), quality, warm).unwrap()
    };
    frame(120.0, &quality, false);
    let warm = frame(122.0, &quality, true);
    assert!(warm.report.levels.iter().any(|l| l.on_device));
    // Nothing moves if nothing moves.
    assert_eq!(frame(122.0, &quality, true).positions, warm.positions);
    let stiff = frame(122.0, &Quality { stiffness: 1.0, ..quality }, false);
    assert!(stiff.report.levels.iter().all(|l| !l.on_device));
}

#[test]
fn what_a_device_cannot_hold_the_processor_does() {
    if engine().is_none() {
        return;
    }
    let tube = Tube::medium();
    let handles = tube.points();
    let targets = tube.targets(&handles, Pose::Twist(60.0));
    let expected = deformer(&Engine::cpu(), &tube.mesh, &handles).deform(&targets, &Quality::DEFAULT, false).unwrap();
    let options = |memory, stages: &[&str]| EngineOptions {
        backend: Backend::Gpu,
        memory,
        cpu_stages: stages.iter().map(|s| s.to_string()).collect(),
        ..EngineOptions::default()
    };
    // 4 MiB hold the splits but no stage; 256 KiB neither.
    for (memory, notes, ran) in [(4 << 20, 1, 1), (256 << 10, 1, 0)] {
        let engine = Engine::new(options(Some(memory), &[])).unwrap();
        let mut tight = deformer(&engine, &tube.mesh, &handles);
        let result = tight.deform(&targets, &Quality::DEFAULT, false).unwrap();
        let device = tight.decoder().device().unwrap();
        println!("{memory} bytes: {:?}, ran {:?}", device.notes(), device.ran().collect::<Vec<_>>());
        assert!(device.notes().len() >= notes && device.ran().count() == ran, "{:?}", device.notes());
        if ran == 0 {
            assert_eq!(result.positions, expected.positions);
        }
        assert!(tight.measures(&result.positions).g <= 1.05 * tight.measures(&expected.positions).g);
    }
    let engine = Engine::new(options(None, &["split_level", "encoding_apply"])).unwrap();
    let mut kept = deformer(&engine, &tube.mesh, &handles);
    assert!(kept.decoder().device().is_none());
    assert_eq!(kept.deform(&targets, &Quality::DEFAULT, false).unwrap().positions, expected.positions);
}
