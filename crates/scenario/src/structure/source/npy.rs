//! Square matrices of NumPy's format .npy, versions 1 to 3 (the documentation of `numpy.lib.format`): float64,
//! little-endian.
//!
//! A file is `\x93NUMPY`, two bytes of version, the length of the header in two bytes or, from version 2 on, four, the
//! header, a dictionary of Python with the keys `descr`, `fortran_order` and `shape`, and the numbers.

use nalgebra::DMatrix;

use super::error::MatrixError;

const MAGIC: &[u8] = b"\x93NUMPY";
/// Largest number of rows. The eigenvalue problem of this size takes seconds.
pub(super) const MOST_ROWS: usize = 1000;

/// Reads a square matrix.
pub(super) fn square(bytes: &[u8]) -> Result<DMatrix<f64>, MatrixError> {
    let not_npy = |what| MatrixError::NotNpy { what };
    let rest = bytes.strip_prefix(MAGIC).ok_or(not_npy("it does not begin with \\x93NUMPY"))?;
    let (header, numbers) = match *rest {
        [1, 0, a, b, ref rest @ ..] => rest.split_at_checked(u16::from_le_bytes([a, b]).into()),
        [2 | 3, 0, a, b, c, d, ref rest @ ..] => {
            let length = usize::try_from(u32::from_le_bytes([a, b, c, d]));
            length.ok().and_then(|length| rest.split_at_checked(length))
        }
        _ => return Err(not_npy("its version is not 1.0, 2.0 or 3.0")),
    }
    .ok_or(not_npy("it ends inside the header"))?;
    let header = str::from_utf8(header).map_err(|_| not_npy("the header is no text"))?;
    // The header is a Python dictionary. NumPy writes its keys in a fixed order and quoting, so a search for
    // the key is enough and no parser of Python is needed.
    let of = |key| value(header, key).ok_or(not_npy("the header lacks `descr`, `fortran_order` or `shape`"));
    let kind = of("'descr':")?;
    let order = of("'fortran_order':")?;
    let shape = of("'shape':")?;
    let kind = kind.trim_start_matches('\'').split('\'').next().unwrap_or_default();
    if kind != "<f8" {
        return Err(MatrixError::Type { got: kind.to_owned() });
    }
    let by_columns = match order {
        _ if order.starts_with("True") => true,
        _ if order.starts_with("False") => false,
        _ => return Err(not_npy("`fortran_order` is neither True nor False")),
    };
    let rows = rows(shape)?;
    // `rows` is at most 1000, so the product can't overflow.
    let expected = rows * rows * 8;
    if numbers.len() != expected {
        return Err(MatrixError::Length { got: numbers.len(), expected });
    }
    let (numbers, _) = numbers.as_chunks::<8>();
    let numbers = numbers.iter().map(|bytes| f64::from_le_bytes(*bytes));
    let matrix = match by_columns {
        true => DMatrix::from_iterator(rows, rows, numbers),
        false => DMatrix::from_row_iterator(rows, rows, numbers),
    };
    Ok(matrix)
}

/// Returns the text behind a key of the header.
fn value<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    header.split_once(key).map(|(_, value)| value.trim_start())
}

/// Returns the number of rows of a square shape, `(3, 3)`.
fn rows(shape: &str) -> Result<usize, MatrixError> {
    let inner = shape.strip_prefix('(').and_then(|shape| shape.split_once(')')).map_or("", |(inner, _)| inner);
    let sizes: Option<Vec<usize>> = inner.split(',').map(|size| size.trim().parse().ok()).collect();
    match sizes.as_deref() {
        Some(&[rows, columns]) if rows == columns && (1..=MOST_ROWS).contains(&rows) => Ok(rows),
        _ => Err(MatrixError::Shape { got: format!("({inner})"), most: MOST_ROWS }),
    }
}
