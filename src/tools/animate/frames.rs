//! Frames of a moving mesh as numbered files, and several of them in one picture.

use std::path::Path;

use glam::DVec3;

use crate::error::{Error, Result};
use crate::geometry::Mesh;
use crate::io::output_set::OutputFolder;
use crate::io::{write_obj, write_ply};
use crate::picture::Image;
use crate::tools::render::canvas::Canvas;
use crate::tools::render::{Coloring, MAX_SIZE, RenderOptions, render};
use crate::words::words;

/// Format of a sequence of meshes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameFormat {
    /// Everything the mesh has.
    Obj,
    /// Positions and polygons.
    Ply,
}

words! { FrameFormat, "format", "a format of frames":
    Obj => "obj",
    Ply => "ply",
}

/// A folder of numbered meshes, `frame_0000.obj` and so on, that appears whole or not at all.
#[derive(Debug)]
pub struct FrameFolder {
    folder: OutputFolder,
    format: FrameFormat,
    digits: usize,
    first: usize,
    written: usize,
}

impl FrameFolder {
    /// Begins a part of a sequence of `count` frames, from number `first` on, at `place`, which
    /// must not exist or be an empty folder.
    ///
    /// # Errors
    /// [`Error::Io`] if it exists with content or its parent cannot be written.
    pub fn create(place: impl AsRef<Path>, count: usize, first: usize, format: FrameFormat) -> Result<Self> {
        let folder = OutputFolder::create(place)?;
        let digits = count.saturating_sub(1).max(1).to_string().len().max(4);
        Ok(Self { folder, format, digits, first, written: 0 })
    }

    /// Writes the next frame: `mesh` with its vertices at `positions`.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] if there are not as many positions as vertices.
    pub fn write(&mut self, mesh: &Mesh, positions: &[DVec3]) -> Result<()> {
        let moved = moved(mesh, positions)?;
        let name = format!("frame_{:0digits$}", self.first + self.written, digits = self.digits);
        match self.format {
            FrameFormat::Obj => write_obj(&moved, self.folder.path().join(name + ".obj"))?,
            FrameFormat::Ply => write_ply(&moved, None, self.folder.path().join(name + ".ply"))?,
        }
        self.written += 1;
        Ok(())
    }

    /// Gives the folder its name. Returns the number of frames.
    ///
    /// # Errors
    /// [`Error::Io`] if that is not possible; the frames are removed then.
    pub fn finish(self) -> Result<usize> {
        self.folder.finish()?;
        Ok(self.written)
    }
}

/// `mesh` with its vertices at `positions`. Normals of the file belong to the shape at rest and are
/// left out.
fn moved(mesh: &Mesh, positions: &[DVec3]) -> Result<Mesh> {
    if positions.len() != mesh.vertex_count() {
        let what = format!("{} positions for the {} vertices of {}", positions.len(), mesh.vertex_count(), mesh.name);
        return Err(Error::input(what, "Give one a vertex"));
    }
    let mut moved = mesh.clone();
    moved.positions = positions.to_vec();
    Ok(moved)
}

/// Pictures of several shapes of one mesh in rows of `columns`, all at the same scale, each with
/// its middle in the middle of its cell.
///
/// `options` gives the size of a cell and the view. Left to right, top to bottom.
///
/// # Errors
/// [`Error::Option`] for no shapes, no columns or a sheet larger than [`MAX_SIZE`];
/// [`Error::Input`] for shapes of another mesh.
pub fn contact_sheet(
    mesh: &Mesh,
    coloring: Coloring<'_>,
    shapes: &[Vec<DVec3>],
    columns: usize,
    options: &RenderOptions,
) -> Result<Image> {
    let columns = columns.min(shapes.len());
    if columns == 0 {
        return Err(Error::option("frames", "there is nothing to draw", "Choose at least one frame and one column"));
    }
    let rows = shapes.len().div_ceil(columns) as u64;
    let (width, height) = (columns as u64 * u64::from(options.width), rows * u64::from(options.height));
    if width.max(height) > u64::from(MAX_SIZE) {
        let what = format!("the sheet would be {width} x {height} pixels");
        return Err(Error::option("size", what, format!("Use fewer or smaller pictures: {MAX_SIZE} is the limit")));
    }
    let mut used = vec![false; mesh.vertex_count()];
    for t in 0..mesh.triangle_count() {
        mesh.triangle(t).iter().for_each(|&v| used[v as usize] = true);
    }
    let middle_and_size = |shape: &[DVec3]| {
        let all = shape.iter().zip(&used).filter(|(p, used)| **used && p.is_finite()).map(|(p, _)| *p);
        let (low, high) = all.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
        if low.x <= high.x { ((low + high) * 0.5, high - low) } else { (DVec3::ZERO, DVec3::ZERO) }
    };
    let boxes: Vec<(DVec3, DVec3)> = shapes.iter().map(|s| middle_and_size(s)).collect();
    let largest = boxes.iter().fold(DVec3::ZERO, |m, b| m.max(b.1));
    let mut sheet = Canvas::new(width as u32, height as u32, options.background);
    for (k, (shape, (middle, _))) in shapes.iter().zip(&boxes).enumerate() {
        let mut framed = moved(mesh, shape)?;
        framed.positions.iter_mut().for_each(|p| *p -= *middle);
        // Triangles without area at the corners of the largest box give all pictures one scale.
        let framed = with_corners(&framed, largest * 0.5);
        let picture = render(&framed, coloring, &[], options)?;
        let (x, y) = ((k % columns) as u32, (k / columns) as u32);
        sheet.put(&picture, x * options.width, y * options.height);
    }
    sheet.into_image()
}

/// `mesh` and eight invisible triangles that extend its bounding box to `-corner .. corner`.
fn with_corners(mesh: &Mesh, corner: DVec3) -> Mesh {
    use crate::geometry::{Corner, MeshBuilder, NONE};
    let mut builder = MeshBuilder::onto(mesh.clone());
    let count = mesh.vertex_count() as u32;
    let sign = |k: u32, bit: u32| if k >> bit & 1 == 0 { -1.0 } else { 1.0 };
    builder.mesh.positions.extend((0..8).map(|k| corner * DVec3::new(sign(k, 0), sign(k, 1), sign(k, 2))));
    for vertex in count..count + 8 {
        builder.polygon([Corner { vertex, texcoord: NONE, normal: NONE }; 3]);
    }
    builder.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::read_mesh;

    fn tetrahedron() -> Mesh {
        let positions = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        Mesh::of_triangles("tetrahedron", positions, &[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    }

    #[test]
    fn sequences_appear_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let place = dir.path().join("out");
        let mesh = tetrahedron();
        for format in [FrameFormat::Obj, FrameFormat::Ply] {
            let mut folder = FrameFolder::create(&place, 3, 0, format).unwrap();
            for f in 0..3 {
                folder.write(&mesh, &mesh.positions.iter().map(|p| *p * f64::from(f + 1)).collect::<Vec<_>>()).unwrap();
                assert!(!place.join("frame_0000.obj").exists() && !place.join("frame_0000.ply").exists());
            }
            assert!(folder.write(&mesh, &[]).is_err());
            assert_eq!(folder.finish().unwrap(), 3);
            let extension = if format == FrameFormat::Obj { "obj" } else { "ply" };
            let last = read_mesh(place.join(format!("frame_0002.{extension}"))).unwrap().mesh;
            assert_eq!(last.positions[1], DVec3::X * 3.0);
            // What is there is not overwritten.
            assert!(FrameFolder::create(&place, 3, 0, format).unwrap_err().to_string().contains("not empty"));
            std::fs::remove_dir_all(&place).unwrap();
            std::fs::create_dir(&place).unwrap();
        }
        // Given up: nothing is left.
        let mut folder = FrameFolder::create(&place, 3, 0, FrameFormat::Ply).unwrap();
        folder.write(&mesh, &mesh.positions).unwrap();
        drop(folder);
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
        assert!(FrameFolder::create(dir.path().join("no/out"), 3, 0, FrameFormat::Ply).is_err());
    }

    #[test]
    fn cells_have_one_scale() {
        let mesh = tetrahedron();
        let half: Vec<DVec3> = mesh.positions.iter().map(|p| *p * 0.5).collect();
        let options = RenderOptions { width: 60, height: 60, supersampling: 1, ..RenderOptions::default() };
        let shapes = [mesh.positions.clone(), half, mesh.positions.iter().map(|p| *p + 50.0).collect()];
        let sheet = contact_sheet(&mesh, Coloring::Plain([90, 90, 90]), &shapes, 2, &options).unwrap();
        assert_eq!((sheet.width, sheet.height), (120, 120));
        let drawn = |x0: u32, y0: u32| {
            let cell = (0..3600).map(|i| sheet.pixel(x0 + i % 60, y0 + i / 60));
            cell.filter(|p| *p != [255; 4]).count() as f64
        };
        let (whole, small, far, empty) = (drawn(0, 0), drawn(60, 0), drawn(0, 60), drawn(60, 60));
        assert!(whole > 300.0 && (small / whole - 0.25).abs() < 0.05, "{small} of {whole}");
        assert!((far / whole - 1.0).abs() < 0.02 && empty == 0.0, "{far} of {whole}, {empty}");
        assert!(contact_sheet(&mesh, Coloring::Plain([0; 3]), &[], 2, &options).is_err());
        let large = RenderOptions { width: 16000, ..options };
        assert!(contact_sheet(&mesh, Coloring::Plain([0; 3]), &shapes, 2, &large).is_err());
    }
}
