//! The whole transfer, band after band.

use super::band::Window;
use super::bands::Bands;
use super::bins::Atlas;
use super::charts::charts;
use super::coordinates;
use super::fill::{Fill, fill};
use super::gpu::{Resident, Stages, Work};
use super::kind::LayerKind;
use super::layer::{Layer, copy_padding};
use super::lookup::{Lookup, lookups};
use super::output::{Output, Scratch};
use super::pad::pad_seams;
use super::plan::{Plan, fixed};
use super::pyramids::Pyramids;
use super::rebase::{Rebase, renormalise};
use super::seams::seam_pairs;
use super::tables::target_triangles;
use super::tally::HOLE;
use super::{LARGEST_SIDE, TransferOptions, TransferOutput, TransferStats, coverage};
use crate::control;
use crate::engine::Engine;
use crate::error::{Error, Result};
use crate::geometry::{Mesh, NONE};
use crate::picture::{Depth, Image, Pixels};
use crate::progress::Progress;
use crate::surface::PointMap;
use crate::tools::stopwatch::Stopwatch;

/// Transfers the `layers` of `source` onto the texture of `target`, all stages but the map on the
/// CPU; see [`transfer_on`].
///
/// # Errors
/// As [`transfer_on`], but for the device's.
pub fn transfer(
    source: &Mesh,
    layers: &[Layer<'_>],
    target: &Mesh,
    map: &dyn PointMap,
    options: &TransferOptions,
    progress: &dyn Progress,
) -> Result<TransferOutput> {
    transfer_on(&Engine::cpu(), source, layers, target, map, options, progress)
}

/// Transfers the `layers` of `source` onto the texture of `target` where `engine` works.
///
/// `map` takes points of the target to points of the source; it works where it was made for. The
/// result is the same, byte for byte, for any number of threads and any memory limit, if the map's
/// is. A stage that the engine keeps on the CPU, or whose data are more than the device or
/// `options.memory` holds, runs there; [`TransferStats::notes`] says why. On devices colours may
/// round to a neighbouring value.
///
/// # Errors
/// If an option is out of range; a mesh has no texture coordinates, or one that is not finite; a
/// layer's pictures do not fit together; the work does not fit into `options.memory`; the map
/// fails; or the device does.
pub fn transfer_on(
    engine: &Engine,
    source: &Mesh,
    layers: &[Layer<'_>],
    target: &Mesh,
    map: &dyn PointMap,
    options: &TransferOptions,
    progress: &dyn Progress,
) -> Result<TransferOutput> {
    transfer_with(&Pyramids::new(engine), source, layers, target, map, options, progress)
}

/// As [`transfer_on`], where the engine of `pyramids` works, which are made for the pictures that
/// have none yet and serve the transfers that follow.
///
/// # Errors
/// As [`transfer_on`].
pub fn transfer_with<'a>(
    pyramids: &Pyramids<'a>,
    source: &Mesh,
    layers: &[Layer<'a>],
    target: &Mesh,
    map: &dyn PointMap,
    options: &TransferOptions,
    progress: &dyn Progress,
) -> Result<TransferOutput> {
    let engine = pyramids.engine();
    check(source, layers, target, options)?;
    let mut stages = Stages::new(engine, layers, map, options);
    let plan = plan(source, layers, target, options, &mut stages)?;
    let mut watch = Stopwatch::on(engine);
    let (lookups, lookup_of) = lookups(source, layers)?;
    let grid = |scale: u32| -> Result<Window<'_>> {
        let size = [options.width * scale, options.height * scale];
        let atlas = Atlas::new(target, size[0], size[1], options.region, options.material, plan.most_triangles)?;
        let target = target_triangles(target, source, size[0], size[1])?;
        Ok(Window::new(size, atlas, target, map, source.triangle_count(), plan.most_entries))
    };
    let mut coarse = grid(1)?;
    let mut fine = if options.supersample > 1 { Some(grid(options.supersample)?) } else { None };
    watch.lap("prepare");
    let rebases = rebases(&lookups, &lookup_of, layers, target, map)?;
    watch.lap("frames");
    let output = |(l, &lookup)| Output::new(l, source, lookup, options, rebases[lookup].as_ref(), pyramids);
    let mut outputs = layers.iter().zip(&lookup_of).map(output).collect::<Result<Vec<_>>>()?;
    let mut resident = resident(&mut stages, pyramids, &lookups, &coarse, &outputs, options, plan.rows)?;
    let mut sampler = None;
    if resident.is_none() {
        for window in [Some(&mut coarse), fine.as_mut()].into_iter().flatten() {
            window.rasterize_on(stages.rasterizer(&window.atlas().triangles, window.width)?);
        }
    }
    if resident.is_none() || outputs.iter().any(|o| !o.stays()) {
        let all = resident.is_none();
        let wanted = |o: &&mut Output<'_>| all || !o.stays();
        sampler =
            stages.sampler(|s| outputs.iter_mut().filter(wanted).try_for_each(|o| o.upload(s, pyramids, options)))?;
    }
    if sampler.is_none() {
        outputs.iter_mut().for_each(|o| o.device.clear());
        if resident.is_none() {
            pyramids.leave_device();
        }
    }
    watch.lap("mip");

    let (width, height) = (options.width as usize, options.height as usize);
    let mut covers = vec![coverage::NOTHING; width * height];
    let channels = coordinates::CHANNELS as u32;
    let mut stmap = match options.coordinates {
        true => Some(Image::zeros(options.width, options.height, channels, Depth::F32)?),
        false => None,
    };
    progress.stage("texels", (width * height) as u64);
    let bands = Bands {
        options,
        plan: &plan,
        lookups: &lookups,
        coarse: &mut coarse,
        fine: fine.as_mut(),
        outputs: &mut outputs,
        sampler: sampler.as_mut(),
        stmap: stmap.as_mut(),
        covers: &mut covers,
        watch: &mut watch,
        progress,
        scratch: Scratch::new(lookups.len()),
    };
    let counts = match &mut resident {
        Some(resident) => bands.on_device(resident)?,
        None => bands.on_host()?,
    };
    let padded = resident.as_ref().is_some_and(Resident::pads);
    let atlas = coarse.atlas();
    let mut stats = TransferStats {
        texels: (width * height) as u64,
        missing_texcoords: atlas.missing,
        degenerate_texcoords: atlas.degenerate,
        mirrored_texcoords: atlas.mirrored,
        size_ratio: rebases.iter().flatten().next().map(Rebase::size_ratio),
        memory: plan.bytes,
        ..counts
    };
    outputs.iter_mut().for_each(|o| o.device.clear());
    drop((coarse, fine, sampler, resident));
    let mut notes = Vec::new();
    if options.fill != Fill::None {
        let allowed = options.memory.saturating_sub(fixed(source, layers, target, options));
        stats.filled = fill_holes(&mut outputs, target, &mut covers, options, allowed, &mut notes)?;
        watch.lap("fill");
    }
    if padded {
        stats.padded = covers.iter().filter(|c| **c == coverage::PADDING).count() as u64;
    } else if options.margin > 0 {
        progress.stage("padding", height as u64);
        let mut nearest = Vec::new();
        let mut padder = stages.padder(&covers, width, options.margin)?;
        for start in (0..height).step_by(plan.rows) {
            control::check()?;
            let rows = start..(start + plan.rows).min(height);
            match &mut padder {
                Some(padder) => padder.nearest(rows.clone(), &mut nearest)?,
                None => pad_seams(&covers, width, rows.clone(), options.margin, &mut nearest),
            }
            let first = rows.start * width;
            for (from, _) in nearest.iter_mut().zip(&covers[first..]).filter(|(_, cover)| **cover == HOLE) {
                *from = NONE;
            }
            for output in &mut outputs {
                copy_padding(&mut output.image, first, &nearest);
            }
            if let Some(stmap) = &mut stmap {
                copy_padding(stmap, first, &nearest);
                coordinates::mark_padding(stmap, first, &nearest);
            }
            for (cover, &from) in covers[first..].iter_mut().zip(&nearest) {
                if from != NONE && *cover == coverage::NOTHING {
                    *cover = coverage::PADDING;
                    stats.padded += 1;
                }
            }
            progress.advance(rows.len() as u64);
        }
        watch.lap("pad_seams");
    }
    covers.iter_mut().filter(|c| **c == HOLE).for_each(|c| *c = coverage::NOTHING);
    stats.stages = watch.stages().to_vec();
    (stats.device_stages, stats.notes) = stages.report();
    stats.notes.append(&mut notes);
    let coverage = Image { width: options.width, height: options.height, channels: 1, pixels: Pixels::U8(covers) };
    let layers = outputs.into_iter().map(|o| o.image).collect();
    Ok(TransferOutput { layers, coverage, coordinates: stmap, stats })
}

/// How the work is divided: with as much on a device as `options.memory` allows.
fn plan(
    source: &Mesh,
    layers: &[Layer<'_>],
    target: &Mesh,
    options: &TransferOptions,
    stages: &mut Stages<'_>,
) -> Result<Plan> {
    let made = |stages: &Stages<'_>| Plan::new(source, layers, target, options, stages);
    match made(stages) {
        // Texels that return to the host need less of the device.
        Err(Error::Memory { .. }) if stages.any() => {
            stages.leave_resident();
        }
        plan => return plan,
    }
    match made(stages) {
        Err(Error::Memory { required, allowed, .. }) if stages.any() => {
            *stages = Stages::none(format!(
                "the transfer runs on the CPU: with the device's copies it needs {required} bytes, {allowed} are allowed"
            ));
            made(stages)
        }
        plan => plan,
    }
}

/// The transfer on a device, where all its stages run there.
fn resident<'a>(
    stages: &mut Stages<'a>,
    pyramids: &Pyramids<'_>,
    lookups: &[Lookup<'_>],
    coarse: &Window<'_>,
    outputs: &[Output<'_>],
    options: &TransferOptions,
    band: usize,
) -> Result<Option<Resident<'a, 'a>>> {
    let faces = lookups.first().map_or(0, |l| l.table.len());
    let shows = |t: usize, o: &Output<'_>| o.texture_of[t] != NONE && lookups[o.lookup].table[t].chart != NONE;
    let work = Work {
        size: [options.width as usize, options.height as usize],
        band,
        lookups: lookups.iter().map(|l| l.table.as_slice()).collect(),
        target: &coarse.target,
        colored: (0..faces).map(|t| outputs.iter().any(|o| shows(t, o))).collect(),
        mirrored: options.coordinates || options.fill != Fill::None || outputs.iter().any(|o| !o.stays()),
        lists: 1,
    };
    stages.resident(&work, |gpu, map, whole| {
        let staying = outputs.iter().filter(|o| o.stays());
        let plates = staying.map(|o| o.plate(gpu, pyramids, options.background)).collect::<Result<Vec<_>>>()?;
        Resident::new(gpu, map, &work, plates, coarse.atlas(), options, whole)
    })
}

/// What carries normals and heights, for each table of the source with layers that need it.
fn rebases<'a>(
    lookups: &'a [Lookup<'_>],
    lookup_of: &[usize],
    layers: &[Layer<'_>],
    target: &'a Mesh,
    map: &dyn PointMap,
) -> Result<Vec<Option<Rebase<'a>>>> {
    let of = |(k, lookup): (usize, &'a Lookup<'_>)| {
        let kinds = layers.iter().zip(lookup_of).filter(|(_, l)| **l == k).map(|(layer, _)| layer.kind);
        Rebase::for_kinds(kinds, &lookup.mesh, target, map)
    };
    lookups.iter().enumerate().map(of).collect()
}

/// Fills the holes of all pictures and returns how many texels got a colour; they are doubtful from
/// then on.
fn fill_holes(
    outputs: &mut [Output<'_>],
    target: &Mesh,
    covers: &mut [u8],
    options: &TransferOptions,
    allowed: u64,
    notes: &mut Vec<String>,
) -> Result<u64> {
    if outputs.iter().all(|o| o.holes.is_empty()) {
        return Ok(0);
    }
    let required = outputs.iter().map(|o| o.holes.texels.len() as u64).max().unwrap_or(0) * options.fill.bytes();
    if required > allowed {
        notes.push(format!(
            "holes stay without colour: filling them needs {required} bytes beside the pictures, {allowed} are allowed (--memory)"
        ));
        return Ok(0);
    }
    let size = [options.width, options.height];
    let seams = seam_pairs(target, &charts(target), size, options.region, options.material);
    let mut filled = Vec::new();
    for output in outputs {
        let holes = std::mem::take(&mut output.holes);
        let encoding = output.encoding;
        let how = if output.kind == LayerKind::Labels { Fill::Nearest } else { options.fill };
        let (kind, depth, channels) = (output.kind, output.image.depth(), output.image.channels as usize);
        let finish = |color: &mut [f32]| renormalise(kind, depth, channels, color);
        filled.append(&mut fill(&mut output.image, &holes, covers, &seams, how, encoding, finish)?);
    }
    filled.sort_unstable();
    filled.dedup();
    for &texel in &filled {
        let cover = &mut covers[texel as usize];
        if *cover == HOLE {
            *cover = coverage::DOUBTFUL;
        }
    }
    Ok(filled.len() as u64)
}

pub(super) fn check(source: &Mesh, layers: &[Layer<'_>], target: &Mesh, options: &TransferOptions) -> Result<()> {
    for (name, side) in [("width", options.width), ("height", options.height)] {
        if side == 0 || side > LARGEST_SIDE {
            return Err(Error::option(
                "size",
                format!("{name} {side}"),
                format!("Give a size from 1 to {LARGEST_SIDE}"),
            ));
        }
    }
    if !(1..=4).contains(&options.supersample) {
        return Err(Error::option("supersample", options.supersample.to_string(), "Give 1, 2, 3 or 4"));
    }
    if !(1..=16).contains(&options.taps) {
        return Err(Error::option("taps", options.taps.to_string(), "Give 1 to 16"));
    }
    if layers.is_empty() {
        return Err(Error::input("no texture to transfer", "Give at least one layer"));
    }
    layers.iter().try_for_each(|l| l.check(source))?;
    let needed = [(source, layers.iter().any(|l| l.needs_texcoords())), (target, true)];
    for (mesh, needed) in needed {
        if needed && !mesh.has_texcoords() {
            return Err(Error::mesh(
                &mesh.name,
                "has no texture coordinates",
                "Unwrap it first: the source needs them for its picture, the target for the result",
            ));
        }
    }
    Ok(())
}
