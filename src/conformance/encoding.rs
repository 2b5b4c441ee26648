//! Poses from mean-value encodings.

use glam::{DQuat, DVec3};

use super::{Check, Outcome, Timed, largest, outcome, timed};
use crate::encoding::{HierarchyOptions, Quality};
use crate::engine::Engine;
use crate::error::Result;
use crate::geometry::Mesh;
use crate::io::cache::Cache;
use crate::models::shapes::lobed_sphere;
use crate::tools::deform::{Deformer, Handles};

pub(super) const CHECKS: &[Check] = &[
    Check {
        name: "pose by splits",
        kernels: &["split_level"],
        unit: "diagonals",
        // Half a turn is exact but for rounding; a hundred levels of splits.
        tolerance: 2e-6,
        measure: splits,
    },
    Check {
        name: "pose by gradients",
        kernels: &[
            "encoding_apply",
            "encoding_apply_transpose",
            "encoding_diagonal",
            "encoding_residual",
            "gradient_direction",
            "gradient_step",
            "line_search",
            "dot",
            "split_level",
        ],
        unit: "parts of G",
        // Both stop at a step that gains less than this.
        tolerance: 0.05,
        measure: gradients,
    },
];

/// The mesh, and eight of its vertices.
fn posed(engine: &Engine) -> Result<(Mesh, Vec<u32>, Deformer)> {
    let mesh = lobed_sphere(5, 0.5);
    let n = mesh.vertex_count() as u32;
    let handles: Vec<u32> = (0..8).map(|k| k * (n - 1) / 7).collect();
    let wanted = Handles { vertices: handles.clone(), region: None };
    let mut deformer = Deformer::new(&mesh, wanted, &HierarchyOptions::default(), &Cache::disabled())?;
    deformer.decode_on(engine);
    Ok((mesh, handles, deformer))
}

fn decode(deformer: &mut Deformer, targets: &[DVec3], quality: &Quality) -> Result<Timed<Vec<DVec3>>> {
    timed(|| Ok(deformer.deform(targets, quality, false)?.positions))
}

fn splits(engine: &Engine) -> Result<Outcome> {
    let (mesh, handles, mut on_device) = posed(engine)?;
    let (_, _, mut on_cpu) = posed(&Engine::cpu())?;
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), std::f64::consts::PI);
    let targets: Vec<DVec3> = handles.iter().map(|&v| turn * mesh.positions[v as usize]).collect();
    let found = decode(&mut on_device, &targets, &Quality::SPLITS)?;
    let expected = decode(&mut on_cpu, &targets, &Quality::SPLITS)?;
    let diagonal = mesh.bounds().map_or(1.0, |(low, high)| low.distance(high));
    let off = found.value.iter().zip(&mesh.positions).map(|(q, p)| q.distance(turn * *p) / diagonal);
    Ok(outcome(&found, &expected, largest(off)))
}

fn gradients(engine: &Engine) -> Result<Outcome> {
    let (mesh, handles, mut on_device) = posed(engine)?;
    let (_, _, mut on_cpu) = posed(&Engine::cpu())?;
    // One half is turned against the other.
    let turn = DQuat::from_rotation_x(0.8);
    let place = |p: DVec3| if p.x > 0.0 { turn * p + DVec3::X * 0.2 } else { p };
    let targets: Vec<DVec3> = handles.iter().map(|&v| place(mesh.positions[v as usize])).collect();
    let found = decode(&mut on_device, &targets, &Quality::DEFAULT)?;
    let expected = decode(&mut on_cpu, &targets, &Quality::DEFAULT)?;
    let (a, b) = (on_device.measures(&found.value).g, on_cpu.measures(&expected.value).g);
    Ok(outcome(&found, &expected, (a / b - 1.0).max(0.0)))
}
