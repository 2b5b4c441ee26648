//! Arrays of numbers as NumPy files: written as `f64`, little-endian, C order, or as the integers
//! that they came as.

use std::path::Path;

use npyz::{DType, NpyFile, Order, TypeChar, WriterBuilder};

use super::{finite, output, source};
use crate::{Error, Result};

/// Kinds of whole numbers in NumPy files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IntegerType {
    /// True and false.
    Bool,
    /// Eight bits with a sign.
    I8,
    /// Sixteen bits with a sign.
    I16,
    /// 32 bits with a sign.
    I32,
    /// 64 bits with a sign.
    I64,
    /// Eight bits.
    U8,
    /// Sixteen bits.
    U16,
    /// 32 bits.
    U32,
    /// 64 bits.
    U64,
}

/// A matrix of numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct NpyMatrix {
    /// Numbers of a row.
    pub columns: usize,
    /// Row after row.
    pub values: Vec<f64>,
    /// What the file stores, if that is whole numbers.
    pub integers: Option<IntegerType>,
}

/// Writes a matrix of `columns` values a row. Rows for which `blank` says so may be NaN: there is
/// nothing.
///
/// # Errors
/// [`Error::Io`]; [`Error::NotFinite`] for another value that is not finite; [`Error::Input`] if
/// the values do not fill whole rows.
pub fn write_npy(path: impl AsRef<Path>, columns: usize, values: &[f64], blank: impl Fn(usize) -> bool) -> Result<()> {
    let path = path.as_ref();
    let row = |i: usize| i / columns.max(1);
    let told = values.iter().enumerate().map(|(i, &x)| if x.is_nan() && blank(row(i)) { 0.0 } else { x });
    finite::numbers(path, told, |i| format!("row {}, column {}", row(i), i - row(i) * columns))?;
    write_as(path, columns, values, |v| v)
}

/// [`write_npy`] as whole numbers of a type.
///
/// # Errors
/// As [`write_npy`]; [`Error::Input`] naming the row of a number that the type does not hold, such
/// as NaN.
pub fn write_npy_integers(path: impl AsRef<Path>, columns: usize, values: &[f64], integers: IntegerType) -> Result<()> {
    let path = path.as_ref();
    let (low, high) = integers.range();
    // The upper end of 64 bits rounds up to a number that is not in the type.
    let fits = |v: f64| v.trunc() == v && v >= low && (v <= high && (v < high || high < 2f64.powi(53)));
    if let Some(k) = values.iter().position(|&v| !fits(v)) {
        let what = format!("{}: row {}: {} is no {integers:?}", path.display(), k / columns.max(1), values[k]);
        return Err(Error::input(what, "Write CSV or PLY"));
    }
    match integers {
        IntegerType::Bool => write_as(path, columns, values, |v| v != 0.0),
        IntegerType::I8 => write_as(path, columns, values, |v| v as i8),
        IntegerType::I16 => write_as(path, columns, values, |v| v as i16),
        IntegerType::I32 => write_as(path, columns, values, |v| v as i32),
        IntegerType::I64 => write_as(path, columns, values, |v| v as i64),
        IntegerType::U8 => write_as(path, columns, values, |v| v as u8),
        IntegerType::U16 => write_as(path, columns, values, |v| v as u16),
        IntegerType::U32 => write_as(path, columns, values, |v| v as u32),
        IntegerType::U64 => write_as(path, columns, values, |v| v as u64),
    }
}

impl IntegerType {
    /// The smallest and the largest number.
    fn range(self) -> (f64, f64) {
        match self {
            Self::Bool => (0.0, 1.0),
            Self::I8 => (i8::MIN.into(), i8::MAX.into()),
            Self::I16 => (i16::MIN.into(), i16::MAX.into()),
            Self::I32 => (i32::MIN.into(), i32::MAX.into()),
            Self::I64 => (i64::MIN as f64, i64::MAX as f64),
            Self::U8 => (0.0, u8::MAX.into()),
            Self::U16 => (0.0, u16::MAX.into()),
            Self::U32 => (0.0, u32::MAX.into()),
            Self::U64 => (0.0, u64::MAX as f64),
        }
    }
}

fn write_as<T: npyz::AutoSerialize>(
    path: &Path,
    columns: usize,
    values: &[f64],
    cast: impl Fn(f64) -> T,
) -> Result<()> {
    if columns == 0 || !values.len().is_multiple_of(columns) {
        let what = format!("{} values do not fill rows of {columns}", values.len());
        return Err(Error::input(what, "Give whole rows"));
    }
    let shape = [(values.len() / columns) as u64, columns as u64];
    output::write_atomically(path, |w| {
        let all = || {
            let options = npyz::WriteOptions::new().default_dtype().shape(&shape);
            let mut writer = options.writer(w).begin_nd()?;
            writer.extend(values.iter().map(|&v| cast(v)))?;
            writer.finish()
        };
        all().map_err(output::failed(path))
    })
}

/// Reads a matrix of floating point numbers of 16, 32 or 64 bits, whole numbers of any width or
/// truth values, in either byte order and in C or Fortran order. A one-dimensional array is one
/// column.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] on another kind of array, one that is not as long as its header
/// says, or whole numbers that double precision does not hold.
pub fn read_npy(path: impl AsRef<Path>) -> Result<NpyMatrix> {
    let path = path.as_ref();
    let bytes = source::read_all(path)?;
    let remedy = "Write it with barymap or numpy.save as a matrix of numbers";
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
    let file = NpyFile::new(&bytes[..]).map_err(|e| fail(format!("the header is damaged: {e}")))?;
    let shape = file.shape().to_vec();
    let (rows, columns) = match shape[..] {
        [rows] => (rows, 1),
        [rows, columns] => (rows, columns),
        _ => return Err(fail(format!("the array has {} dimensions, not 2", shape.len()))),
    };
    // The count must be that of the file before anything is allocated from it.
    let count = rows.saturating_mul(columns);
    let (kind, width) = match file.dtype() {
        DType::Plain(t) => (t.type_char(), t.size_field()),
        _ => return Err(fail("the array holds records, not numbers".into())),
    };
    if count.checked_mul(width.max(1)).is_none_or(|n| n > bytes.len() as u64) {
        return Err(fail(format!("the header declares {count} numbers, the file is shorter")));
    }
    let fortran = file.order() == Order::Fortran;
    let (values, integers) = match (kind, width) {
        (TypeChar::Float, 8) => (cast(file, |v: f64| Some(v)), None),
        (TypeChar::Float, 4) => (cast(file, |v: f32| Some(v.into())), None),
        (TypeChar::Float, 2) => (cast(file, |v: half::f16| Some(v.into())), None),
        (TypeChar::Bool, 1) => (cast(file, |v: bool| Some(u8::from(v).into())), Some(IntegerType::Bool)),
        (TypeChar::Int, 1) => (cast(file, |v: i8| Some(v.into())), Some(IntegerType::I8)),
        (TypeChar::Int, 2) => (cast(file, |v: i16| Some(v.into())), Some(IntegerType::I16)),
        (TypeChar::Int, 4) => (cast(file, |v: i32| Some(v.into())), Some(IntegerType::I32)),
        (TypeChar::Int, 8) => {
            (cast(file, |v: i64| Some(v as f64).filter(|f| *f as i128 == v.into())), Some(IntegerType::I64))
        }
        (TypeChar::Uint, 1) => (cast(file, |v: u8| Some(v.into())), Some(IntegerType::U8)),
        (TypeChar::Uint, 2) => (cast(file, |v: u16| Some(v.into())), Some(IntegerType::U16)),
        (TypeChar::Uint, 4) => (cast(file, |v: u32| Some(v.into())), Some(IntegerType::U32)),
        (TypeChar::Uint, 8) => {
            (cast(file, |v: u64| Some(v as f64).filter(|f| *f as i128 == v.into())), Some(IntegerType::U64))
        }
        _ => return Err(fail(format!("the array holds {kind:?} of {width} bytes, not real numbers"))),
    };
    let values = values.map_err(|what| fail(format!("the array cannot be read: {what}")))?;
    let (rows, columns) = (rows as usize, columns as usize);
    let values = if fortran && columns > 1 {
        (0..rows).flat_map(|r| values.iter().skip(r).step_by(rows.max(1)).copied()).collect()
    } else {
        values
    };
    Ok(NpyMatrix { columns, values, integers })
}

/// All numbers of a file in its own order.
fn cast<T: npyz::Deserialize>(
    file: NpyFile<&[u8]>,
    value: impl Fn(T) -> Option<f64>,
) -> std::result::Result<Vec<f64>, String> {
    let numbers = file.into_vec::<T>().map_err(|e| e.to_string())?;
    let mut values = Vec::with_capacity(numbers.len());
    for (k, number) in numbers.into_iter().enumerate() {
        let value = value(number)
            .ok_or_else(|| format!("number {k} is beyond 2^53, where not every whole number can be told"))?;
        values.push(value);
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_trip_and_damage() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.npy");
        let values = [0.1, -2.0, f64::NAN, 1e300, 0.0, -1e-300];
        for columns in [1, 2, 3, 6] {
            write_npy(&path, columns, &values, |row| row == 2 / columns).unwrap();
            let back = read_npy(&path).unwrap();
            assert_eq!((back.columns, back.integers), (columns, None));
            assert!(back.values.iter().zip(&values).all(|(a, b)| a.to_bits() == b.to_bits()));
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
        let all = |_: usize| true;
        assert!(write_npy(&path, 4, &values, all).is_err() && write_npy(&path, 0, &[], all).is_err());
        write_npy(&path, 8, &[], all).unwrap();
        assert_eq!(read_npy(&path).unwrap(), NpyMatrix { columns: 8, values: Vec::new(), integers: None });
    }

    /// A file as NumPy writes it.
    fn numpy(descr: &str, fortran: bool, shape: &str, data: &[u8]) -> Vec<u8> {
        let order = if fortran { "True" } else { "False" };
        let mut header = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}");
        while (10 + header.len() + 1) % 64 != 0 {
            header.push(' ');
        }
        header.push('\n');
        [&b"\x93NUMPY\x01\x00"[..], &(header.len() as u16).to_le_bytes(), header.as_bytes(), data].concat()
    }

    #[test]
    fn every_kind_of_number_is_read() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.npy");
        let read = |descr: &str, fortran: bool, shape: &str, data: &[u8]| {
            std::fs::write(&path, numpy(descr, fortran, shape, data)).unwrap();
            read_npy(&path)
        };
        let all = |bytes: &[&[u8]]| bytes.concat();
        for (descr, data, expected, kind) in [
            ("<i8", all(&[&(-3i64).to_le_bytes(), &7i64.to_le_bytes()]), [-3.0, 7.0], Some(IntegerType::I64)),
            (">i4", all(&[&(-3i32).to_be_bytes(), &7i32.to_be_bytes()]), [-3.0, 7.0], Some(IntegerType::I32)),
            ("<i2", all(&[&(-3i16).to_le_bytes(), &7i16.to_le_bytes()]), [-3.0, 7.0], Some(IntegerType::I16)),
            ("|i1", vec![253, 7], [-3.0, 7.0], Some(IntegerType::I8)),
            (">u8", all(&[&3u64.to_be_bytes(), &7u64.to_be_bytes()]), [3.0, 7.0], Some(IntegerType::U64)),
            ("<u4", all(&[&3u32.to_le_bytes(), &u32::MAX.to_le_bytes()]), [3.0, 4294967295.0], Some(IntegerType::U32)),
            (">u2", all(&[&3u16.to_be_bytes(), &7u16.to_be_bytes()]), [3.0, 7.0], Some(IntegerType::U16)),
            ("|u1", vec![3, 255], [3.0, 255.0], Some(IntegerType::U8)),
            ("|b1", vec![1, 0], [1.0, 0.0], Some(IntegerType::Bool)),
            (">f8", all(&[&0.1f64.to_be_bytes(), &7f64.to_be_bytes()]), [0.1, 7.0], None),
            (">f4", all(&[&0.5f32.to_be_bytes(), &7f32.to_be_bytes()]), [0.5, 7.0], None),
            ("<f2", vec![0x00, 0x38, 0x00, 0xc0], [0.5, -2.0], None),
            (">f2", vec![0x38, 0x00, 0xc0, 0x00], [0.5, -2.0], None),
        ] {
            let expected = NpyMatrix { columns: 1, values: expected.to_vec(), integers: kind };
            assert_eq!(read(descr, false, "(2,)", &data).unwrap(), expected, "{descr}");
            assert_eq!(read(descr, true, "(2, 1)", &data).unwrap(), expected, "{descr}");
        }
        // Column after column in the file.
        let columns = read("|u1", true, "(3, 2)", &[1, 2, 3, 10, 20, 30]).unwrap();
        assert_eq!((columns.columns, &columns.values[..]), (2, &[1.0, 10.0, 2.0, 20.0, 3.0, 30.0][..]));
        assert!(read("|u1", true, "(0, 2)", &[]).unwrap().values.is_empty());

        for (descr, shape, data, expected) in [
            ("<i8", "(1,)", (i64::MAX - 1).to_le_bytes().to_vec(), "2^53"),
            ("<c8", "(1,)", vec![0; 8], "Complex"),
            ("<U4", "(1,)", vec![0; 16], "not real numbers"),
            ("|u1", "(18446744073709551615, 2)", vec![0; 8], "declares"),
            ("|u1", "(4294967296, 4294967296)", vec![0; 8], "declares"),
            ("|u1", "(99999999999999999999, 1)", vec![0; 8], "header"),
            ("<f8", "(2305843009213693952, 1)", vec![0; 8], "declares"),
            ("|u1", "(2, 2, 2)", vec![0; 8], "3 dimensions"),
            ("|u1", "()", vec![0; 8], "0 dimensions"),
        ] {
            let message = read(descr, false, shape, &data).unwrap_err().to_string();
            assert!(message.contains(expected), "{descr} {shape}: {message}");
        }
    }

    #[test]
    fn whole_numbers_stay_what_they_were() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.npy");
        use IntegerType::{Bool, I8, I16, I32, I64, U8, U16, U32, U64};
        for kind in [Bool, I8, I16, I32, I64, U8, U16, U32, U64] {
            let (low, high) = kind.range();
            let ends = if high < 2f64.powi(53) { [low, high] } else { [low.max(-2f64.powi(53)), 2f64.powi(53)] };
            write_npy_integers(&path, 2, &ends, kind).unwrap();
            assert_eq!(read_npy(&path).unwrap(), NpyMatrix { columns: 2, values: ends.to_vec(), integers: Some(kind) });
            for wrong in [f64::NAN, 0.5, low - 4096.0, high * 1.5 + 1.0, f64::INFINITY] {
                let message = write_npy_integers(&path, 1, &[1.0, wrong], kind).unwrap_err().to_string();
                assert!(message.contains("row 1"), "{kind:?} {wrong}: {message}");
            }
        }
        assert!(write_npy_integers(&path, 1, &[2f64.powi(63)], I64).is_err());
        assert!(write_npy_integers(&path, 1, &[2f64.powi(64)], U64).is_err());
    }

    #[test]
    fn only_blank_rows_are_not_numbers() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.npy");
        let message = |values: &[f64], blank: usize| {
            let error = write_npy(&path, 2, values, |row| row == blank).unwrap_err();
            assert!(!path.exists());
            error.to_string()
        };
        let nan = [0.0, 1.0, f64::NAN, f64::NAN];
        assert!(message(&nan, 0).contains("row 1, column 0 would be NaN"));
        assert!(message(&[0.0, 1.0, 2.0, f64::INFINITY], 1).contains("row 1, column 1 would be inf"));
        write_npy(&path, 2, &nan, |row| row == 1).unwrap();
    }
}
