//! Seams of transferred textures, on the built-in characters with their true correspondence.

use barymap::geometry::NONE;
use barymap::models::{ModelPair, character_pair};
use barymap::picture::{Image, Pixels};
use barymap::progress::Quiet;
use barymap::surface::{PackedImage, PackedPoint, PointMap, Status};
use barymap::tools::transfer::pad::pad_seams;
use barymap::tools::transfer::{Layer, UvRegion, seam_steps, transfer};
use glam::DVec3;

use super::atlas::{rasterize, whole};
use super::whole::options;

/// The true map of the pair.
struct Truth<'a>(&'a ModelPair);

impl PointMap for Truth<'_> {
    fn map(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> barymap::Result<()> {
        images.clear();
        images.extend(points.iter().map(|p| {
            let PackedPoint { face, b0, b1 } = self.0.true_source(&p.unpack()).into();
            PackedImage { face, b0, b1, confidence: 1.0, status: Status::Valid as u32 }
        }));
        Ok(())
    }
}

/// A texture of the source that varies smoothly over the neutral body, in 16 bits, padded.
fn smooth_texture(pair: &ModelPair, size: u32) -> Image {
    let mesh = &pair.source.mesh;
    let texels = rasterize(mesh, size, size, whole(size, size));
    let color = |p: DVec3| {
        let wave = |k: DVec3| ((0.5 + 0.4 * k.dot(p).sin()) * 65535.0) as u16;
        [wave(DVec3::new(5.0, 1.0, 2.0)), wave(DVec3::new(-1.0, 6.0, 1.0)), wave(DVec3::new(2.0, -2.0, 7.0))]
    };
    let mut samples: Vec<[u16; 3]> = texels
        .iter()
        .map(|t| match t.is_covered() {
            false => [0; 3],
            true => {
                let corners = mesh.triangle(t.face as usize).map(|v| pair.source.neutral[v as usize]);
                let (b0, b1) = (f64::from(t.b0), f64::from(t.b1));
                color(corners[0] * b0 + corners[1] * b1 + corners[2] * (1.0 - b0 - b1))
            }
        })
        .collect();
    let covers: Vec<u8> = texels.iter().map(|t| if t.is_covered() { 255 } else { 0 }).collect();
    let mut nearest = Vec::new();
    pad_seams(&covers, size as usize, 0..size as usize, 12, &mut nearest);
    for i in (0..samples.len()).filter(|&i| nearest[i] != NONE) {
        samples[i] = samples[nearest[i] as usize];
    }
    Image::new(size, size, 3, Pixels::U16(samples.concat())).expect("picture")
}

#[test]
fn seams_are_no_larger_than_steps_inside_charts() {
    let pair = character_pair();
    let image = smooth_texture(&pair, 1024);
    let out = transfer(
        &pair.source.mesh,
        &[Layer::single("colour", &image)],
        &pair.target.mesh,
        &Truth(&pair),
        &options(512, 512),
        &Quiet,
    )
    .expect("transfer");
    let steps = |image: &Image| seam_steps(&pair.target.mesh, image, &out.coverage, UvRegion::Repeat).expect("steps");
    let found = steps(&out.layers[0]);
    println!("  {found:?}");
    assert!(found.pairs > 1000 && found.inside < 0.1, "{found:?}");
    assert!(found.across <= 2.0 * found.inside, "{found:?}");

    // Charts of different brightness have seams that show, and the comparison sees them.
    let mut corrupted = out.layers[0].clone();
    let texels = rasterize(&pair.target.mesh, 512, 512, whole(512, 512));
    for (i, t) in texels.iter().enumerate().filter(|(_, t)| t.is_covered()) {
        let (x, y) = (i as u32 % 512, i as u32 / 512);
        let chart = pair.target.charts[t.face as usize];
        let value = corrupted.get(x, y, 0) * if chart.is_multiple_of(2) { 1.0 } else { 0.5 };
        corrupted.set(x, y, 0, value);
    }
    let wrong = steps(&corrupted);
    assert!(wrong.across > 2.0 * wrong.inside, "{wrong:?}");
}
