//! Curves on a character by control points on it (Panozzo et al. 2013, Figure 2): their control
//! polygons, which are splines of degree one, cubic B-splines, and what one average a point does
//! where control points are far apart, beside repeated averages.
//!
//! `cargo run --release --example spline [PICTURE.png]`

#[path = "shared/lines.rs"]
mod lines;

use std::error::Error;

use barymap::geometry::{ClosestPoints, SurfacePoint, Topology};
use barymap::io::write_image;
use barymap::models::character_pair;
use barymap::progress::Quiet;
use barymap::surface::correspondence::Shape;
use barymap::surface::{Embedding, EmbeddingOptions};
use barymap::tools::render::{Coloring, RenderOptions, render, side_by_side};
use barymap::tools::spline::{Evaluation, SplineOptions, SplineSurface, SurfaceCurve};
use glam::DVec3;
use lines::{Line, with_lines};

const RED: [u8; 3] = [200, 40, 30];
const YELLOW: [u8; 3] = [250, 190, 20];
const BLUE: [u8; 3] = [30, 90, 200];

fn line(curve: &SurfaceCurve, radius: f64, color: [u8; 3]) -> impl Iterator<Item = Line> + '_ {
    curve.runs.iter().map(move |r| Line { points: r.iter().map(|p| p.position).collect(), radius, color })
}

fn main() -> Result<(), Box<dyn Error>> {
    let output = std::env::args().nth(1).unwrap_or_else(|| "spline.png".into());
    let mesh = character_pair().target.mesh;
    let topology = Topology::new(&mesh);
    let options = EmbeddingOptions { landmarks: 600, ..EmbeddingOptions::default() };
    let embedding = Embedding::compute(&mesh, &topology, &options, &Quiet)?;
    let splines = SplineSurface::new(Shape { mesh: &mesh, topology: &topology, embedding: Some(&embedding) })?;
    let (low, high) = mesh.bounds().ok_or("an empty model")?;
    let size = high.y - low.y;

    // Control points: on a wave around the trunk, and far apart.
    let closest = ClosestPoints::new(&mesh, &topology);
    let place = |x: f64, y: f64, z: f64| DVec3::new(0.5 * (low.x + high.x) + size * x, low.y + size * y, size * z);
    let find = |points: &[DVec3]| -> Vec<SurfacePoint> {
        points.iter().filter_map(|p| closest.nearest(*p)).map(|(p, _)| p).collect()
    };
    let belt: Vec<DVec3> = (0..10u32)
        .map(|i| {
            let a = std::f64::consts::TAU * f64::from(i) / 10.0;
            place(0.25 * a.sin(), if i.is_multiple_of(2) { 0.4 } else { 0.6 }, 0.25 * a.cos())
        })
        .collect();
    let far: Vec<DVec3> = [(-0.5, 0.7, 0.0), (0.1, 0.1, 0.4), (0.0, 1.1, 0.2), (0.5, 0.7, 0.0), (0.1, 0.3, -0.4)]
        .map(|(x, y, z)| place(x, y, z))
        .to_vec();

    let closed = SplineOptions { closed: true, ..SplineOptions::default() };
    let polygon = SplineOptions { degree: 1, ..closed };
    let subdivided = SplineOptions { evaluation: Evaluation::Subdivision, ..closed };
    let radius = 0.004 * size;
    let mut pictures = Vec::new();
    for (controls, azimuth) in [(find(&belt), 20.0), (find(&belt), 200.0), (find(&far), 20.0)] {
        let (curve, corners) = (splines.trace(&controls, &closed)?, splines.trace(&controls, &polygon)?);
        let repeated = splines.trace(&controls, &subdivided)?;
        let apart = splines.compare(&controls, &closed)?;
        println!(
            "{} control points: {} points, {:.3} long, {} jumps; by repeated averages {:.3} long, {} jumps; at most {:.4} apart, at parameter {:.3}",
            controls.len(),
            curve.points().count(),
            curve.length(),
            curve.jumps.len(),
            repeated.length(),
            repeated.jumps.len(),
            apart.distance,
            apart.parameter
        );
        assert!(curve.closed && repeated.closed, "a closed curve is open");
        let mut all: Vec<Line> = line(&corners, 0.6 * radius, RED).collect();
        all.extend(line(&repeated, 0.8 * radius, BLUE));
        all.extend(line(&curve, radius, YELLOW));
        let (shape, colors) = with_lines(&mesh, [190, 192, 200], &all)?;
        let options = RenderOptions { width: 560, height: 560, azimuth, ..RenderOptions::default() };
        pictures.push(render(&shape, Coloring::Vertices(&colors), &controls, &options)?);
    }
    write_image(&side_by_side(&pictures, 12, [255; 4])?, &output)?;
    println!("{output}");
    Ok(())
}
