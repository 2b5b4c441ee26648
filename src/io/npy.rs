//! Arrays of numbers as NumPy files: `f64`, little-endian, C order.

use std::path::Path;

use npyz::WriterBuilder;

use super::{output, source};
use crate::{Error, Result};

/// Writes a matrix of `columns` values a row.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] if the values do not fill whole rows.
pub fn write_npy(path: impl AsRef<Path>, columns: usize, values: &[f64]) -> Result<()> {
    let path = path.as_ref();
    if columns == 0 || !values.len().is_multiple_of(columns) {
        let what = format!("{} values do not fill rows of {columns}", values.len());
        return Err(Error::input(what, "Give whole rows"));
    }
    let shape = [(values.len() / columns) as u64, columns as u64];
    output::write_atomically(path, |w| {
        let all = || {
            let options = npyz::WriteOptions::new().default_dtype().shape(&shape);
            let mut writer = options.writer(w).begin_nd()?;
            writer.extend(values)?;
            writer.finish()
        };
        all().map_err(output::failed(path))
    })
}

/// Reads a matrix of `f64` or `f32`: the number of columns, and the values row by row. A one-dimensional array is one column.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] on another kind of array, or one that is not as long as its header says.
pub fn read_npy(path: impl AsRef<Path>) -> Result<(usize, Vec<f64>)> {
    let path = path.as_ref();
    let bytes = source::read_all(path)?;
    let remedy = "Write it with barymap or numpy.save as a matrix of float64";
    let fail = |what: String| Error::format(path, None, what, remedy);
    // The format's header is at most 64 KiB by specification of version 1; longer ones are damage.
    let declared = match bytes.get(..12) {
        Some(&[0x93, b'N', b'U', b'M', b'P', b'Y', 1, _, a, b, ..]) => usize::from(u16::from_le_bytes([a, b])),
        Some(&[0x93, b'N', b'U', b'M', b'P', b'Y', 2 | 3, _, a, b, c, d]) => u32::from_le_bytes([a, b, c, d]) as usize,
        _ => return Err(fail("this is not a NumPy file".into())),
    };
    if declared > bytes.len() {
        return Err(fail("the header reaches beyond the end of the file".into()));
    }
    let file = npyz::NpyFile::new(&bytes[..]).map_err(|e| fail(format!("the header is damaged: {e}")))?;
    if file.order() != npyz::Order::C {
        return Err(fail("the array is in Fortran order".into()));
    }
    let shape = file.shape().to_vec();
    let columns = match shape[..] {
        [_] => 1,
        [_, columns] => columns as usize,
        _ => return Err(fail(format!("the array has {} dimensions, not 2", shape.len()))),
    };
    // The count must be that of the file before anything is allocated from it.
    let count = shape.iter().try_fold(1u64, |n, s| n.checked_mul(*s)).unwrap_or(u64::MAX);
    let width = match file.dtype() {
        npyz::DType::Plain(t) if t.type_char() == npyz::TypeChar::Float => t.size_field(),
        _ => 0,
    };
    if !matches!(width, 4 | 8) {
        return Err(fail("the array does not hold floating point numbers of 32 or 64 bits".into()));
    }
    if count.checked_mul(width).is_none_or(|n| n > bytes.len() as u64) {
        return Err(fail(format!("the header declares {count} numbers, the file is shorter")));
    }
    let values = if width == 8 {
        file.into_vec::<f64>()
    } else {
        file.into_vec::<f32>().map(|v| v.into_iter().map(f64::from).collect())
    };
    Ok((columns, values.map_err(|e| fail(format!("the array cannot be read: {e}")))?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_trip_and_damage() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.npy");
        let values = [0.1, -2.0, f64::NAN, 1e300, 0.0, f64::INFINITY];
        for columns in [1, 2, 3, 6] {
            write_npy(&path, columns, &values).unwrap();
            let (back_columns, back) = read_npy(&path).unwrap();
            assert_eq!(back_columns, columns);
            assert!(back.iter().zip(&values).all(|(a, b)| a.to_bits() == b.to_bits()));
        }
        let bytes = std::fs::read(&path).unwrap();
        assert!(bytes.windows(5).any(|w| w == b"'<f8'") && bytes.windows(5).any(|w| w == b"False"));
        for length in 0..bytes.len() {
            std::fs::write(&path, &bytes[..length]).unwrap();
            assert!(read_npy(&path).is_err(), "cut at {length}");
        }
        let huge = String::from_utf8_lossy(&bytes[10..118]).replace("1, 6", "99999999999, 6");
        let mut file = bytes[..8].to_vec();
        file.extend((huge.len() as u16).to_le_bytes());
        file.extend(huge.bytes());
        std::fs::write(&path, &file).unwrap();
        let message = read_npy(&path).unwrap_err().to_string();
        assert!(message.contains("declares"), "{message}");
        assert!(write_npy(&path, 4, &values).is_err() && write_npy(&path, 0, &[]).is_err());
        write_npy(&path, 8, &[]).unwrap();
        assert_eq!(read_npy(&path).unwrap(), (8, Vec::new()));
    }
}
