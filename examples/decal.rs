//! Figure 10 of the surface paper: a picture laid by four anchors. Left the built-in stout
//! character with a label drawn into the texture it has; right a chequered square on a lobed body,
//! on the smooth one and on the same with its vertices moved at random by up to one percent.
//!
//! `cargo run --release --example decal [PICTURE.png]`

use std::error::Error;

use barymap::engine::Engine;
use barymap::geometry::{ClosestPoints, Mesh, Topology};
use barymap::io::write_image;
use barymap::models::shapes::{Random, lobed_sphere};
use barymap::models::stout;
use barymap::picture::Image;
use barymap::progress::Quiet;
use barymap::tools::decal::{DecalAnchors, Layout, PaintOptions, composite, decal, paint, with_texcoords};
use barymap::tools::render::{Coloring, RenderOptions, render, side_by_side};
use barymap::tools::transfer::Filter;
use glam::{DVec2, DVec3};

/// The points of a mesh closest to a square across z, of half side `half`, around `centre`.
fn square(mesh: &Mesh, centre: DVec3, half: f64) -> DecalAnchors {
    let closest = ClosestPoints::new(mesh, &Topology::new(mesh));
    let at = [(-half, -half), (half, -half), (half, half), (-half, half)].map(|(x, y)| centre + DVec3::new(x, y, 0.0));
    DecalAnchors::corners(at.map(|p| closest.nearest(p).expect("the mesh has faces").0))
}

/// A round label with rings and spokes.
fn label(size: u32) -> barymap::Result<Image> {
    Image::from_fn(size, size, |x, y| {
        let p = (DVec2::new(f64::from(x), f64::from(y)) + 0.5) * 2.0 / f64::from(size) - 1.0;
        let spoke = (p.y.atan2(p.x) * 8.0 / std::f64::consts::TAU).rem_euclid(1.0) < 0.5;
        match p.length() {
            r if r > 0.98 => [0; 4],
            r if r > 0.8 => [250, 220, 60, 255],
            r if r > 0.3 && spoke => [200, 30, 40, 255],
            r if r > 0.3 => [255; 4],
            _ => [30, 60, 160, 255],
        }
    })
}

fn chequered(size: u32) -> barymap::Result<Image> {
    Image::from_fn(size, size, |x, y| {
        let dark = (x * 8 / size + y * 8 / size).is_multiple_of(2);
        if dark { [40, 60, 90, 255] } else { [240, 230, 200, 255] }
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    let output = std::env::args().nth(1).unwrap_or_else(|| "decal.png".into());
    let view = RenderOptions { width: 520, height: 620, azimuth: 20.0, ..RenderOptions::default() };

    // A label on the belly, drawn into the texture.
    let character = stout();
    let mesh = &character.mesh;
    let (low, high) = mesh.bounds().expect("it has faces");
    let middle = (low + high) * 0.5;
    let belly = DVec3::new(middle.x, low.y + 0.5 * (high.y - low.y), high.z);
    let made = decal(mesh, &Topology::new(mesh), &square(mesh, belly, 0.19), Layout::Plate, 1.0, &Quiet)?;
    println!("label: stretch efficiency {:.3}, {} faces", made.report.stretch_all, made.patch.len());
    assert!(made.report.stretch_all > 0.9 && made.report.flipped_faces == 0, "the decal has gone wrong");
    let texture = character.texture(1024);
    let options = PaintOptions {
        width: 1024,
        height: 1024,
        margin: 16,
        filter: Filter::Anisotropic,
        supersample: 1,
        linear_light: false,
        material: None,
        memory: 1 << 30,
    };
    let painted = paint(&Engine::cpu(), mesh, &made, &label(512)?, &options, &Quiet)?;
    let texture = composite(&texture, &painted.image, 1.0, false)?;
    let mut pictures = vec![render(mesh, Coloring::Texture(&texture), &[], &view)?];

    // The mapping itself, on a smooth body and on a rough one.
    let smooth = lobed_sphere(5, 0.3);
    let mut rough = smooth.clone();
    let mut random = Random::new(5);
    for p in &mut rough.positions {
        *p += DVec3::new(random.signed(), random.signed(), random.signed()) * 0.01;
    }
    let board = chequered(512)?;
    let mut stretch = Vec::new();
    for body in [&smooth, &rough] {
        let anchors = square(body, DVec3::new(0.0, 0.0, 1.2), 0.6);
        let made = decal(body, &Topology::new(body), &anchors, Layout::Plate, 1.0, &Quiet)?;
        println!("board: stretch efficiency {:.3}, {} faces", made.report.stretch_all, made.patch.len());
        stretch.push(made.report.stretch_all);
        pictures.push(render(&with_texcoords(body, &made, false), Coloring::Texture(&board), &anchors.points, &view)?);
    }
    assert!((stretch[0] - stretch[1]).abs() < 0.05, "noise should hardly matter");
    write_image(&side_by_side(&pictures, 10, [255; 4])?, &output)?;
    println!("{output}: a label in a texture; a chequered board on a smooth and on a rough body");
    Ok(())
}
