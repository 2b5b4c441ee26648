//! Pictures of shapes side by side, for the examples of the encoding.

use std::error::Error;

use barymap::geometry::Mesh;
use barymap::io::write_image;
use barymap::tools::animate::frames::contact_sheet;
use barymap::tools::render::{Coloring, RenderOptions};
use glam::DVec3;

/// The first argument, or `name`.
pub(crate) fn output(name: &str) -> String {
    std::env::args().nth(1).unwrap_or_else(|| name.into())
}

/// Shapes of one mesh, all at one scale, in rows of `columns` pictures of `size` pixels, seen from
/// `view` (azimuth and elevation in degrees).
pub(crate) fn picture(
    mesh: &Mesh,
    shapes: &[Vec<DVec3>],
    columns: usize,
    size: [u32; 2],
    view: (f64, f64),
    output: &str,
) -> Result<(), Box<dyn Error>> {
    let [width, height] = size;
    let options = RenderOptions { width, height, azimuth: view.0, elevation: view.1, ..RenderOptions::default() };
    let sheet = contact_sheet(mesh, Coloring::Plain([186, 190, 200]), shapes, columns, &options)?;
    write_image(&sheet, output)?;
    println!("{output}");
    Ok(())
}
