//! A whole transfer of a texture.

use super::{Check, Outcome, Scene, device, outcome, quantile, timed};
use crate::engine::Engine;
use crate::error::Result;
use crate::picture::{Depth, Image};
use crate::progress::Quiet;
use crate::surface::correspondence::CorrespondenceOptions;
use crate::surface::gpu::correspondence_on;
use crate::tools::transfer::{DeviceLiveTransfer, Layer, TransferOptions, transfer_on};

pub(super) const CHECKS: &[Check] = &[
    TRANSFER,
    Check {
        name: "live transfer of a texture",
        kernels: &["blank_texels", "show_texels", "coverage_bits", "pad_seams", "copy_padding"],
        measure: live,
        ..TRANSFER
    },
];

const TRANSFER: Check = Check {
    name: "transfer of a texture",
    kernels: &[
        "rasterize_atlas",
        "judge_image",
        "list_points",
        "gather_left",
        "place_images",
        "locate",
        "footprint",
        "sample_texture",
        "fill_background",
        "store_texel",
        "tally",
        "coverage_bits",
        "pad_columns",
        "pad_seams",
        "copy_padding",
    ],
    unit: "levels of 255, 999 of 1000 texels",
    // A colour between two levels rounds either way.
    tolerance: 1.0,
    measure: transfer,
};

/// Waves of colour.
pub(super) fn picture(width: u32, height: u32) -> Result<Image> {
    let mut image = Image::zeros(width, height, 3, Depth::U8)?;
    for y in 0..height {
        for x in 0..width {
            let (u, v) = (f64::from(x) / f64::from(width), f64::from(y) / f64::from(height));
            for (c, w) in [(0, 9.0 * u), (1, 7.0 * v + 3.0 * u), (2, 5.0 * (u + v))] {
                image.set(x, y, c, (0.5 + 0.4 * w.sin()) as f32);
            }
        }
    }
    Ok(image)
}

fn transfer(engine: &Engine) -> Result<Outcome> {
    let scene = Scene::textured(60);
    let (source, target) = scene.shapes();
    let picture = picture(512, 512)?;
    let options = TransferOptions { width: 512, height: 512, ..TransferOptions::default() };
    let run = |engine: &Engine| {
        let (map, _) = correspondence_on(engine, source, target, &scene.anchors, &CorrespondenceOptions::default())?;
        timed(|| {
            let layers = [Layer::single("colour", &picture)];
            let result = transfer_on(engine, source.mesh, &layers, target.mesh, map.as_ref(), &options, &Quiet)?;
            Ok((result.layers, result.coverage))
        })
    };
    let (found, on_cpu) = (run(engine)?, run(&Engine::cpu())?);
    let (a, b) = (&found.value, &on_cpu.value);
    let mut apart = levels(&a.0[0], &b.0[0]);
    apart.extend(levels(&a.1, &b.1));
    Ok(outcome(&found, &on_cpu, quantile(apart, 0.999)))
}

/// Every texel done anew by frames, against a transfer on the CPU.
fn live(engine: &Engine) -> Result<Outcome> {
    let scene = Scene::textured(60);
    let (source, target) = scene.shapes();
    let picture = picture(512, 512)?;
    let layers = [Layer::single("colour", &picture)];
    let options = TransferOptions { width: 512, height: 512, ..TransferOptions::default() };
    let method = CorrespondenceOptions::default();
    let (map, _) = correspondence_on(engine, source, target, &scene.anchors, &method)?;
    let mut live = DeviceLiveTransfer::new(engine, source.mesh, &layers, target.mesh, map.as_ref(), &options)?;
    let all: Vec<u32> = (0..target.mesh.triangle_count() as u32).collect();
    let found = timed(|| {
        live.update(&all)?;
        loop {
            let (frame, submission) = live.draw(map.as_ref(), 1 << 16)?;
            device(engine)?.wait(&submission)?;
            if frame.left == 0 {
                return live.read();
            }
        }
    })?;
    let (map, _) = correspondence_on(&Engine::cpu(), source, target, &scene.anchors, &method)?;
    let on_cpu = timed(|| {
        transfer_on(&Engine::cpu(), source.mesh, &layers, target.mesh, map.as_ref(), &options, &Quiet)
            .map(|whole| (whole.layers, whole.coverage))
    })?;
    let (a, b) = (&found.value, &on_cpu.value);
    let mut apart = levels(&a.0[0], &b.0[0]);
    apart.extend(levels(&a.1, &b.1));
    Ok(outcome(&found, &on_cpu, quantile(apart, 0.999)))
}

/// The differences of two pictures at all texels and channels, in 255ths.
pub(super) fn levels(a: &Image, b: &Image) -> Vec<f64> {
    let places = (0..a.height).flat_map(|y| (0..a.width).flat_map(move |x| (0..a.channels).map(move |c| (x, y, c))));
    places.map(|(x, y, c)| f64::from((a.get(x, y, c) - b.get(x, y, c)).abs() * 255.0).round()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_with_a_wrong_patch_fails() {
        let a = picture(64, 64).unwrap();
        let mut b = a.clone();
        assert_eq!(quantile(levels(&a, &b), 0.999), 0.0);
        for (x, y) in (0..4).flat_map(|y| (0..4).map(move |x| (x, y))) {
            b.set(x, y, 0, a.get(x, y, 0) + 0.1);
        }
        assert!(quantile(levels(&a, &b), 0.999) > CHECKS[0].tolerance);
    }
}
