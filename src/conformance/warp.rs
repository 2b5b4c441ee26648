//! A whole warp of a picture.

use glam::DVec2;

use super::textures::{levels, picture};
use super::{Check, Outcome, outcome, quantile, timed};
use crate::engine::Engine;
use crate::error::Result;
use crate::mapping::plane::{Cage, CompositeMap, PartitionKind, PartitionOptions, PathKind, partition};
use crate::progress::Quiet;
use crate::tools::warp::{DevicePreview, Filter, Preview, WarpOptions, warp_picture};

pub(super) const CHECKS: &[Check] = &[
    Check { name: "warp, bilinear", measure: |engine| warp(engine, Filter::Bilinear), ..WARP },
    Check { name: "warp, Lanczos", measure: |engine| warp(engine, Filter::Lanczos), ..WARP },
    Check { name: "warp, elliptical averages", measure: |engine| warp(engine, Filter::Ewa), ..WARP },
    // The Jacobian of every pixel is the host's, and the picture comes in windows.
    Check {
        name: "warp with its Jacobian",
        kernels: &["jacobian_min", "warp_image"],
        measure: |engine| warp_with(engine, &WarpOptions { jacobian: true, ..WarpOptions::default() }),
        ..WARP
    },
    Check {
        name: "preview of a warp",
        kernels: &["map_points", "paint_lattice", "paint_wide", "show_lattice"],
        // A place between two that the picture is read at takes either, as does a colour between
        // two levels.
        tolerance: 2.0,
        measure: preview,
        ..WARP
    },
];

const WARP: Check = Check {
    name: "",
    kernels: &[
        "jacobian_min",
        "halve_texels",
        "place_pixels",
        "place_left",
        "filter_pixels",
        "store_pixels",
        "count_pixels",
    ],
    unit: "levels of 255, 999 of 1000 pixels",
    // A colour between two levels rounds either way.
    tolerance: 1.0,
    measure: |engine| warp(engine, Filter::Bilinear),
};

/// Columns and rows of the picture.
const SIZE: [u32; 2] = [640, 360];

/// A star of 24 vertices whose tips turn.
fn cage() -> Result<Cage> {
    let [w, h] = SIZE.map(f64::from);
    let star = |turn: f64| -> Vec<Vec<DVec2>> {
        let at = |k: usize| {
            let (r, turn) = if k.is_multiple_of(2) { (0.48, turn) } else { (0.36, 0.0) };
            let direction = DVec2::from_angle(std::f64::consts::TAU * k as f64 / 24.0 + turn);
            DVec2::new(w, h) * (DVec2::splat(0.5) + r * direction)
        };
        vec![(0..24).map(at).collect()]
    };
    Cage::new(star(0.0), star(0.1))
}

fn warp(engine: &Engine, filter: Filter) -> Result<Outcome> {
    warp_with(engine, &WarpOptions { filter, ..WarpOptions::default() })
}

fn warp_with(engine: &Engine, options: &WarpOptions) -> Result<Outcome> {
    let picture = picture(SIZE[0], SIZE[1])?;
    let cage = cage()?;
    let steps =
        PartitionOptions { kind: PartitionKind::Uniform(3), path: PathKind::Linear, ..PartitionOptions::default() };
    let run = |engine: &Engine| {
        timed(|| {
            let found = partition(engine, &cage, &steps, &Quiet)?;
            let map = CompositeMap::new(steps.coordinates, found.polygons)?;
            Ok(warp_picture(engine, &picture, &map, options, &Quiet)?.image)
        })
    };
    let (found, on_cpu) = (run(engine)?, run(&Engine::cpu())?);
    let apart = levels(&found.value, &on_cpu.value);
    Ok(outcome(&found, &on_cpu, quantile(apart, 0.999)))
}

/// A dragged frame, on one lattice.
fn preview(engine: &Engine) -> Result<Outcome> {
    let picture = picture(SIZE[0], SIZE[1])?;
    let cage = cage()?;
    let steps =
        PartitionOptions { kind: PartitionKind::Uniform(3), path: PathKind::Linear, ..PartitionOptions::default() };
    let polygons = partition(&Engine::cpu(), &cage, &steps, &Quiet)?.polygons;
    let map = CompositeMap::new(steps.coordinates, polygons)?;
    let mut drawn = DevicePreview::new(engine, &picture, &map, SIZE.into())?;
    let found = timed(|| {
        drawn.draw(&map)?;
        drawn.frame()
    })?;
    let preview = Preview::new(engine, &picture, &map, SIZE.into())?;
    let on_cpu = timed(|| preview.frame())?;
    let apart = levels(&found.value, &on_cpu.value);
    Ok(outcome(&found, &on_cpu, quantile(apart, 0.999)))
}
