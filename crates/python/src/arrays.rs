//! Arrays in and out.

use barymap::glam::{DVec2, DVec3};
use barymap::picture::{Image, Pixels};
use barymap::surface::PackedImage;
use barymap::{Error, Result};
use numpy::ndarray::{Array1, Array2, Array3};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

/// Rows of three numbers.
pub(crate) fn points3(array: &PyReadonlyArray2<'_, f64>) -> Vec<DVec3> {
    array.as_array().rows().into_iter().map(|r| DVec3::new(at(r, 0), at(r, 1), at(r, 2))).collect()
}

/// Rows of two numbers.
pub(crate) fn points2(array: &PyReadonlyArray2<'_, f64>) -> Vec<DVec2> {
    array.as_array().rows().into_iter().map(|r| DVec2::new(at(r, 0), at(r, 1))).collect()
}

/// Rows of three indices.
pub(crate) fn triples(array: &PyReadonlyArray2<'_, u32>) -> Vec<[u32; 3]> {
    array.as_array().rows().into_iter().map(|r| [0, 1, 2].map(|k| r.get(k).copied().unwrap_or(u32::MAX))).collect()
}

fn at(row: numpy::ndarray::ArrayView1<'_, f64>, k: usize) -> f64 {
    row.get(k).copied().unwrap_or(f64::NAN)
}

/// An array of shape (n, 3).
pub(crate) fn of_points3<'py>(py: Python<'py>, points: &[DVec3]) -> Bound<'py, PyArray2<f64>> {
    Array2::from_shape_fn((points.len(), 3), |(i, k)| points[i][k]).into_pyarray(py)
}

/// An array of shape (n, 2).
pub(crate) fn of_points2<'py>(py: Python<'py>, points: &[DVec2]) -> Bound<'py, PyArray2<f64>> {
    Array2::from_shape_fn((points.len(), 2), |(i, k)| points[i][k]).into_pyarray(py)
}

/// A picture from an array (h, w, c) of uint8, uint16 or float32.
pub(crate) fn image(array: &Bound<'_, PyAny>) -> PyResult<Image> {
    fn taken<T: Copy>(samples: numpy::ndarray::ArrayView3<'_, T>) -> ([usize; 3], Vec<T>) {
        let (h, w, c) = samples.dim();
        ([h, w, c], samples.iter().copied().collect())
    }
    let (size, pixels) = if let Ok(a) = array.extract::<PyReadonlyArray3<'_, u8>>() {
        let (size, samples) = taken(a.as_array());
        (size, Pixels::U8(samples))
    } else if let Ok(a) = array.extract::<PyReadonlyArray3<'_, u16>>() {
        let (size, samples) = taken(a.as_array());
        (size, Pixels::U16(samples))
    } else if let Ok(a) = array.extract::<PyReadonlyArray3<'_, f32>>() {
        let (size, samples) = taken(a.as_array());
        (size, Pixels::F32(samples))
    } else {
        return Err(PyTypeError::new_err("a picture is an array (h, w, c) of uint8, uint16 or float32"));
    };
    let [h, w, c] = size.map(|n| u32::try_from(n).unwrap_or(u32::MAX));
    Image::new(w, h, c, pixels).map_err(|e| crate::failure::exception(array.py(), &e))
}

/// The samples of a picture, handed over without a copy: (h, w, c).
pub(crate) fn of_image<'py>(py: Python<'py>, image: Image) -> PyResult<Bound<'py, PyAny>> {
    let shape = (image.height as usize, image.width as usize, image.channels as usize);
    let fits = |e: numpy::ndarray::ShapeError| PyTypeError::new_err(e.to_string());
    Ok(match image.pixels {
        Pixels::U8(v) => Array3::from_shape_vec(shape, v).map_err(fits)?.into_pyarray(py).into_any(),
        Pixels::U16(v) => Array3::from_shape_vec(shape, v).map_err(fits)?.into_pyarray(py).into_any(),
        Pixels::F32(v) => Array3::from_shape_vec(shape, v).map_err(fits)?.into_pyarray(py).into_any(),
    })
}

/// Images under a map: faces (-1 for nowhere), barycentric coordinates, status, confidence.
pub(crate) type Images<'py> =
    (Bound<'py, PyArray1<i32>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<u8>>, Bound<'py, PyArray1<f32>>);

/// Images as arrays; `place` gives the numbers of the file.
pub(crate) fn of_images<'py>(
    py: Python<'py>,
    images: &[PackedImage],
    place: impl Fn(barymap::geometry::SurfacePoint) -> barymap::geometry::SurfacePoint,
) -> Images<'py> {
    let placed: Vec<Option<barymap::geometry::SurfacePoint>> = images.iter().map(|i| i.point().map(&place)).collect();
    let faces = placed.iter().map(|p| p.map_or(-1, |p| p.face as i32));
    let status = |i: &PackedImage| if i.point().is_some() { i.status().word() } else { "failed" };
    let number = |word| match word {
        "valid" => 2u8,
        "doubtful" => 1,
        _ => 0,
    };
    (
        Array1::from_iter(faces).into_pyarray(py),
        Array2::from_shape_fn((images.len(), 3), |(i, k)| placed[i].map_or(0.0, |p| p.barycentric[k])).into_pyarray(py),
        Array1::from_iter(images.iter().map(|i| number(status(i)))).into_pyarray(py),
        Array1::from_iter(images.iter().map(|i| i.confidence)).into_pyarray(py),
    )
}

/// Faces and barycentric coordinates.
pub(crate) type Places<'py> = (Bound<'py, PyArray1<i32>>, Bound<'py, PyArray2<f64>>);

/// Points of a surface in the numbers of its file.
pub(crate) fn of_places<'py>(
    py: Python<'py>,
    points: &[barymap::geometry::SurfacePoint],
    mesh: &barymap::geometry::Mesh,
) -> Places<'py> {
    let placed: Vec<_> = points.iter().map(|p| mesh.point_in_file(*p)).collect();
    (
        Array1::from_iter(placed.iter().map(|p| p.face as i32)).into_pyarray(py),
        Array2::from_shape_fn((placed.len(), 3), |(i, k)| placed[i].barycentric[k]).into_pyarray(py),
    )
}

/// Points of a surface from faces and barycentric coordinates in the numbers of its file.
///
/// # Errors
/// [`Error::Input`] naming the first point that is not on the mesh.
pub(crate) fn places(
    argument: &str,
    faces: &[u32],
    barycentric: &PyReadonlyArray2<'_, f64>,
    mesh: &barymap::geometry::Mesh,
) -> Result<Vec<barymap::geometry::SurfacePoint>> {
    use barymap::geometry::SurfacePoint;
    let rows = barycentric.as_array();
    if rows.nrows() != faces.len() || rows.ncols() != 3 {
        let what = format!("{argument}: {} faces and {:?} barycentric coordinates", faces.len(), rows.shape());
        return Err(Error::input(what, "Give three coordinates for each face"));
    }
    let count = mesh.file_triangle_count();
    let mut points = Vec::with_capacity(faces.len());
    for (i, (&face, row)) in faces.iter().zip(rows.rows()).enumerate() {
        if face as usize >= count {
            let what = format!("{argument}: point {i} is on face {face}, {} has {count}", mesh.name);
            return Err(Error::input(what, "Faces count from 0"));
        }
        let point = SurfacePoint::new(face, [row[0], row[1], row[2]]);
        if !point.is_valid(mesh, 1e-6) {
            let what = format!("{argument}: the coordinates of point {i} are {:?}", point.barycentric);
            return Err(Error::input(what, "Barycentric coordinates are nonnegative and sum to one"));
        }
        points.push(mesh.point_from_file(point));
    }
    Ok(points)
}
