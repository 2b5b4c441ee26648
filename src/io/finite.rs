//! What is not finite is not written.
//!
//! Every writer passes its numbers through here before anything of them reaches a file. A number
//! that is NaN or infinite comes from a computation that overflowed or had no result; a reader of
//! the file would take it for data. Where a format has a sign for "there is none" (an empty cell, a
//! row of NaN), the writer says so and checks the rest.

use std::path::Path;

use crate::geometry::Mesh;
use crate::picture::{Image, Pixels};
use crate::{Error, Result};

const REMEDY: &str = "Look in the input for coordinates that are no numbers and remove them, and for very large or small ones and scale the model; if there are none, report this as a fault";

/// The error of an output with a number that is not finite: `element` says where in the file it
/// would have been.
pub fn refused(file: &Path, element: impl Into<String>, value: f64) -> Error {
    Error::NotFinite { path: file.to_path_buf(), element: element.into(), value, remedy: REMEDY.into() }
}

/// Fails for the first of `numbers` that is not finite; `element` names it by its place among them.
///
/// # Errors
/// [`Error::NotFinite`].
pub fn numbers(
    file: &Path,
    numbers: impl IntoIterator<Item = f64>,
    element: impl FnOnce(usize) -> String,
) -> Result<()> {
    match numbers.into_iter().enumerate().find(|(_, x)| !x.is_finite()) {
        Some((i, x)) => Err(refused(file, element(i), x)),
        None => Ok(()),
    }
}

/// Fails if a position, texture coordinate, normal or colour of `mesh` is not finite.
///
/// # Errors
/// [`Error::NotFinite`].
pub fn mesh(file: &Path, mesh: &Mesh) -> Result<()> {
    positions(file, &mesh.positions, "vertex")?;
    numbers(file, mesh.texcoords.iter().flat_map(|t| t.to_array()), |i| format!("texture coordinate {}", i / 2))?;
    positions(file, &mesh.normals, "normal")?;
    numbers(file, mesh.colors.iter().flatten().map(|&c| f64::from(c)), |i| format!("colour of vertex {}", i / 4))
}

/// Fails if one of `positions` is not finite; `each` is the word for one.
///
/// # Errors
/// [`Error::NotFinite`].
pub fn positions(file: &Path, positions: &[glam::DVec3], each: &str) -> Result<()> {
    numbers(file, positions.iter().flat_map(|p| p.to_array()), |i| {
        format!("{each} {}, {}", i / 3, ["x", "y", "z"][i % 3])
    })
}

/// Whether all samples of a picture are finite.
pub fn is_finite(image: &Image) -> bool {
    match &image.pixels {
        Pixels::F32(samples) => samples.iter().all(|x| x.is_finite()),
        _ => true,
    }
}

/// Fails if `image`, made out of other pictures, has a sample that is not finite where those have
/// none (`sources_are`): pictures of depth, say, have such samples for what
/// is infinitely far.
///
/// # Errors
/// [`Error::NotFinite`] naming the pixel.
pub fn picture(file: &Path, image: &Image, sources_are: bool) -> Result<()> {
    let Pixels::F32(samples) = &image.pixels else { return Ok(()) };
    if !sources_are {
        return Ok(());
    }
    numbers(file, samples.iter().map(|&x| f64::from(x)), |i| {
        let pixel = (i / image.channels as usize) as u32;
        format!("pixel ({}, {})", pixel % image.width, pixel / image.width)
    })
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};

    use super::*;

    #[test]
    fn pictures_may_have_what_their_sources_have() {
        let image = |last: f32| Image::new(2, 2, 1, Pixels::F32(vec![0.0, 1.0, 2.0, last])).unwrap();
        let file = Path::new("out.exr");
        let (good, far, none) = (image(3.0), image(f32::INFINITY), image(f32::NAN));
        assert!(is_finite(&good) && !is_finite(&far) && !is_finite(&none));
        picture(file, &good, true).unwrap();
        picture(file, &far, false).unwrap();
        for bad in [&far, &none] {
            let message = picture(file, bad, true).unwrap_err().to_string();
            assert!(message.contains("out.exr: pixel (1, 1) would be"), "{message}");
        }
    }

    #[test]
    fn the_first_number_that_is_not_finite_is_named() {
        let file = Path::new("out.obj");
        let triangle = || {
            let mut mesh = Mesh::of_triangles("m", vec![DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]]);
            mesh.texcoords = vec![DVec2::ZERO; 2];
            mesh.normals = vec![DVec3::Z];
            mesh
        };
        mesh(file, &triangle()).unwrap();
        let says = |mesh: &Mesh, words: &str| {
            let message = super::mesh(file, mesh).unwrap_err().to_string();
            assert!(
                message.starts_with("out.obj: ") && message.contains(words) && message.contains("scale"),
                "{message}"
            );
        };
        let mut wrong = triangle();
        wrong.positions[2].y = f64::NAN;
        says(&wrong, "vertex 2, y would be NaN");
        let mut wrong = triangle();
        wrong.texcoords[1].x = f64::NEG_INFINITY;
        says(&wrong, "texture coordinate 1 would be -inf");
        let mut wrong = triangle();
        wrong.normals[0].z = f64::INFINITY;
        says(&wrong, "normal 0, z would be inf");
    }
}
