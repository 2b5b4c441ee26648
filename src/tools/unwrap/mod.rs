//! Texture coordinates for meshes that have none: charts, flattened and packed.
//!
//! The crate `uvunwrap` grows charts by their normals, flattens them (least squares conformal maps,
//! Levy, Petitjean, Ray and Maillot 2002, then as rigid as possible, Liu, Zhang, Xu, Gotsman and
//! Gortler 2008) and packs them by their shapes. What it gives is not taken on trust: every
//! triangle's orientation and every pair of triangles is checked in exact arithmetic
//! ([`texcoords::overlaps`](crate::geometry::texcoords::overlaps)), in the precision that files
//! keep, and what fails is cut apart and flattened again. Charts that are rings are cut in two.

mod cuts;
mod fans;
mod rebuild;

use crate::control;
use crate::error::{Error, Result};
use crate::geometry::texcoords::{Distortion, Islands, OverlapOptions, Overlaps, distortion, overlaps, seam_length};
use crate::geometry::{Mesh, NONE, Topology};
use cuts::Cuts;
use fans::Fans;

/// How a mesh is unwrapped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnwrapOptions {
    /// Side of the square texture, in texels, that `gap` refers to: 16 to 16384.
    pub size: u32,
    /// Texels between charts, and twice those at the texture's border; at least 1. Rounded up to an
    /// even number.
    pub gap: u32,
    /// Largest angle between a triangle's normal and the mean of its chart, in degrees, 1 to 89.
    /// Smaller makes flatter charts and more seams.
    pub angle: f64,
}

impl Default for UnwrapOptions {
    fn default() -> Self {
        Self { size: 2048, gap: 16, angle: 70.0 }
    }
}

/// What became of a mesh's surface.
#[derive(Clone, Debug, PartialEq)]
pub struct UnwrapReport {
    /// Number of charts.
    pub charts: usize,
    /// Charts that are no topological disks: rings that could not be cut in two.
    pub not_disks: usize,
    /// Triangles without area in the texture, ascending: they have none on the surface, or are too
    /// thin for single precision.
    pub flat: Vec<u32>,
    /// Faces around vertices of many that have the corners of another face, and its place in the
    /// texture.
    pub copies: usize,
    /// Polygons that had to be cut into their triangles, because they are bent too much for one
    /// chart.
    pub cut_polygons: usize,
    /// Triangles that overlap others in the texture, or are mirrored; none unless all attempts
    /// failed.
    pub faulty: Vec<u32>,
    /// Times that charts were cut apart and packed again.
    pub rounds: u32,
    /// Angle and area distortion, and the texture's share that is used (`texture_area`).
    pub distortion: Distortion,
    /// Length of the cuts on the surface, in its units.
    pub seam_length: f64,
    /// Texels along a unit of length on the surface, at the options' size.
    pub texels_per_unit: f64,
    /// Texels between charts.
    pub gap: u32,
}

/// A mesh with charts.
#[derive(Clone, Debug)]
pub struct Unwrapped {
    /// The mesh: vertices, triangles and their order as before, every triangle with texture
    /// coordinates in 0..1, counter-clockwise.
    pub mesh: Mesh,
    /// What it is like.
    pub report: UnwrapReport,
}

/// Attempts to mend charts by cutting.
const ROUNDS: u32 = 6;

/// Makes texture coordinates for `mesh`; those it has are passed over.
///
/// Charts are connected, do not overlap, keep within materials, and have equal texel density. They
/// end at edges of more than two triangles and at boundaries. Triangles without area get a single
/// point of the texture. A fan of more than 512 triangles around a vertex is unfolded by itself, in
/// sectors, and copies of a face around such a vertex lie on one another. Deterministic for any
/// number of threads. A mesh of 100,000 triangles takes seconds.
///
/// # Errors
/// [`Error::Option`] for an option out of range; [`Error::Mesh`] if no triangle has an area; if the
/// charts are too many for the texture's size.
pub fn unwrap(mesh: &Mesh, topology: &Topology, options: &UnwrapOptions) -> Result<Unwrapped> {
    check(mesh, topology, options)?;
    if mesh.file_triangle_count() == mesh.triangle_count() {
        return unwrap_whole(mesh, topology, options);
    }
    // Charts are of the faces of the file: at a T-junction there is a seam.
    let whole = mesh.with_whole_triangles();
    let mut made = unwrap_whole(&whole, &Topology::new(&whole), options)?;
    made.mesh.cut_as(mesh);
    Ok(made)
}

/// The same for a mesh whose triangles are not cut.
fn unwrap_whole(mesh: &Mesh, topology: &Topology, options: &UnwrapOptions) -> Result<Unwrapped> {
    let fans = Fans::new(mesh, topology);
    if fans.is_empty() {
        let made = charts(mesh, options)?;
        return Ok(report(made, 0, mesh, topology, options));
    }
    let coarse = fans.coarse(mesh);
    let made = charts(&coarse, options)?;
    let (texcoords, of_corner) = fans.texcoords(&made.mesh);
    let (unwrapped, cut_polygons) = rebuild::with_texcoords(mesh, (texcoords, &of_corner));
    let mut faulty: Vec<u32> = made.faulty.iter().flat_map(|&t| fans.triangles_of(t as usize)).collect();
    let islands = Islands::new(&unwrapped);
    // Within single precision sectors are as good as they were unfolded; said if they are not.
    let mirrored = |t: &u32| islands.islands.get(islands.island_of[*t as usize] as usize).is_some_and(|i| i.mirrored);
    faulty.extend((0..mesh.triangle_count() as u32).filter(mirrored));
    faulty.sort_unstable();
    faulty.dedup();
    let made = Charts { mesh: unwrapped, islands, cut_polygons, faulty, rounds: made.rounds };
    Ok(report(made, fans.copies(), mesh, topology, options))
}

/// A mesh with charts, and what its report needs.
struct Charts {
    mesh: Mesh,
    islands: Islands,
    cut_polygons: usize,
    faulty: Vec<u32>,
    rounds: u32,
}

/// Charts by the atlas crate, mended as far as they can be.
fn charts(mesh: &Mesh, options: &UnwrapOptions) -> Result<Charts> {
    let mut cuts = Cuts::new(mesh);
    let mut input = rebuild::Input::new(mesh);
    let mut rounds = 0;
    loop {
        control::check()?;
        let atlas = input.atlas(&cuts, options, &mesh.name)?;
        let (unwrapped, cut_polygons) = rebuild::with_texcoords(mesh, rebuild::texcoords(&atlas));
        let islands = Islands::new(&unwrapped);
        let found = overlaps(&unwrapped, &islands, &OverlapOptions::default());
        let faulty = faulty(&islands, &found);
        let before = cuts.count();
        if rounds < ROUNDS {
            cuts.around(&faulty, &islands, rounds);
            cuts.part_rings(&unwrapped, &islands);
        }
        if cuts.count() == before {
            return Ok(Charts { mesh: unwrapped, islands, cut_polygons, faulty, rounds });
        }
        // What is good stays as it is: only what is cut changes.
        input.keep(&atlas);
        rounds += 1;
    }
}

fn report(made: Charts, copies: usize, mesh: &Mesh, topology: &Topology, options: &UnwrapOptions) -> Unwrapped {
    let distortion = distortion(&made.mesh);
    let texels_per_unit = (distortion.texture_area / mesh.area()).sqrt() * f64::from(options.size);
    let islands = &made.islands;
    let report = UnwrapReport {
        charts: islands.islands.len(),
        not_disks: islands.islands.iter().filter(|i| !i.is_disk()).count(),
        flat: islands.flat.clone(),
        copies,
        cut_polygons: made.cut_polygons,
        seam_length: seam_length(&made.mesh, topology, islands),
        faulty: made.faulty,
        rounds: made.rounds,
        distortion,
        texels_per_unit,
        gap: 2 * options.gap.div_ceil(2),
    };
    Unwrapped { mesh: made.mesh, report }
}

fn check(mesh: &Mesh, topology: &Topology, options: &UnwrapOptions) -> Result<()> {
    if !(16..=16384).contains(&options.size) {
        return Err(Error::option("size", options.size.to_string(), "Give a size from 16 to 16384"));
    }
    if options.gap == 0 || options.gap > options.size / 4 {
        let what = format!("{} texels between charts of a texture of {}", options.gap, options.size);
        return Err(Error::option("gap", what, "Give 1 up to a quarter of the size"));
    }
    if !(1.0..=89.0).contains(&options.angle) {
        return Err(Error::option("chart_angle", options.angle.to_string(), "Give 1 to 89 degrees"));
    }
    if !topology.usable.contains(&true) {
        return Err(Error::mesh(&mesh.name, "no triangle has an area", "Check the mesh and its units"));
    }
    Ok(())
}

/// Triangles that are mirrored or overlap others, ascending.
fn faulty(islands: &Islands, found: &Overlaps) -> Vec<u32> {
    let mirrored = (0..islands.island_of.len())
        .filter(|&t| islands.island_of[t] != NONE && islands.islands[islands.island_of[t] as usize].mirrored);
    let mut faulty: Vec<u32> = mirrored.map(|t| t as u32).chain(found.triangles.iter().copied()).collect();
    faulty.sort_unstable();
    faulty.dedup();
    faulty
}

#[cfg(test)]
mod tests;
