//! Square matrices of the Matrix Market format (R. F. Boisvert, R. Pozo, K. A. Remington, "The Matrix Market Exchange
//! Formats: Initial Design", NISTIR 5935, 1996): real or integer, general or symmetric, all entries (`array`) or those
//! that are not zero (`coordinate`).
//!
//! A file is a line `%%MatrixMarket matrix FORMAT FIELD SYMMETRY`, lines of comments, `%`, a line of sizes, and an
//! entry a line: a number, by columns, or row, column and number, counted from 1. A symmetric matrix has the lower
//! triangle.

use nalgebra::DMatrix;

use super::error::MatrixError;
use super::npy::MOST_ROWS;

/// First word of a Matrix Market file.
pub(super) const BANNER: &str = "%%MatrixMarket";

/// Reads a square matrix.
pub(super) fn square(bytes: &[u8]) -> Result<DMatrix<f64>, MatrixError> {
    let text = str::from_utf8(bytes).map_err(|_| refused(1, "the file is no text"))?;
    let (is_array, is_symmetric) = banner(text.lines().next().unwrap_or_default())?;
    // Matrix Market allows blank lines and comments between the entries. Line numbers are kept for messages.
    let is_data = |line: &str| !line.trim().is_empty() && !line.starts_with('%');
    let mut lines = text.lines().zip(1..).skip(1).filter(|(line, _)| is_data(line));
    let (sizes, number) = lines.next().ok_or(refused(1, "the line of sizes is missing"))?;
    let parsed: Option<Vec<usize>> = sizes.split_whitespace().map(|size| size.parse().ok()).collect();
    let (rows, entries) = match (parsed.as_deref(), is_array) {
        (Some(&[rows, columns]), true) if rows == columns => (rows, None),
        (Some(&[rows, columns, entries]), false) if rows == columns => (rows, Some(entries)),
        (Some([_, _] | [_, _, _]), _) => {
            return Err(MatrixError::Shape { got: format!("({})", sizes.trim()), most: MOST_ROWS });
        }
        _ => {
            return Err(refused(
                number,
                "the sizes must be rows and columns, and of `coordinate` the number of entries",
            ));
        }
    };
    if !(1..=MOST_ROWS).contains(&rows) {
        return Err(MatrixError::Shape { got: format!("({rows}, {rows})"), most: MOST_ROWS });
    }
    // Of a symmetric `array` only the lower triangle is listed, with the diagonal.
    let all = if is_symmetric { rows * (rows + 1) / 2 } else { rows * rows };
    let expected = entries.unwrap_or(all);
    let mut matrix = DMatrix::zeros(rows, rows);
    // A second entry for the same place is an error, and not summed as some readers do. The bitmap also finds
    // an `array` entry beyond the last place.
    let mut given = vec![false; rows * rows];
    let mut places =
        (0..rows).flat_map(|column| (if is_symmetric { column } else { 0 }..rows).map(move |row| (row, column)));
    let mut got = 0;
    for (line, number) in lines {
        got += 1;
        let ((row, column), value) = match is_array {
            true => (places.next().ok_or(MatrixError::Entries { got, expected })?, of_text(line.trim(), number)?),
            false => coordinate(line, number, (rows, is_symmetric))?,
        };
        if std::mem::replace(&mut given[row * rows + column], true) {
            return Err(refused(number, "this entry is given twice: give their sum once"));
        }
        matrix[(row, column)] = value;
        if is_symmetric {
            matrix[(column, row)] = value;
        }
    }
    if got == expected { Ok(matrix) } else { Err(MatrixError::Entries { got, expected }) }
}

/// Reads the first line: whether all entries are listed, and whether the matrix is symmetric.
fn banner(line: &str) -> Result<(bool, bool), MatrixError> {
    let words: Vec<String> = line.split_whitespace().map(str::to_lowercase).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let [banner, "matrix", format, field, symmetry] = words[..] else {
        return Err(refused(1, "it must be `%%MatrixMarket matrix`, format, field and symmetry"));
    };
    if banner != BANNER.to_lowercase() {
        return Err(refused(1, "it must begin with %%MatrixMarket"));
    }
    let is_array = match format {
        "array" => true,
        "coordinate" => false,
        _ => return Err(refused(1, "the format must be `array` or `coordinate`")),
    };
    if !matches!(field, "real" | "double" | "integer") {
        return Err(refused(1, "the field must be `real` or `integer`"));
    }
    match symmetry {
        "general" => Ok((is_array, false)),
        "symmetric" => Ok((is_array, true)),
        _ => Err(refused(1, "the symmetry must be `general` or `symmetric`")),
    }
}

/// Reads an entry of the coordinate format: row and column, converted to count from 0, and the value.
fn coordinate(
    line: &str,
    number: usize,
    (rows, is_symmetric): (usize, bool),
) -> Result<((usize, usize), f64), MatrixError> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let [row, column, value] = words[..] else {
        return Err(refused(number, "it must be row, column and number"));
    };
    let index = |word: &str| word.parse().ok().filter(|index| (1..=rows).contains(index)).map(|index| index - 1);
    let outside = || refused(number, "row and column count from 1, up to the size");
    let at = (index(row).ok_or_else(outside)?, index(column).ok_or_else(outside)?);
    if is_symmetric && at.0 < at.1 {
        return Err(refused(number, "only the lower triangle of a symmetric matrix may be given"));
    }
    Ok((at, of_text(value, number)?))
}

fn of_text(word: &str, line: usize) -> Result<f64, MatrixError> {
    word.parse().map_err(|_| refused(line, "it has no number"))
}

const fn refused(line: usize, what: &'static str) -> MatrixError {
    MatrixError::NotMtx { line, what }
}
