//! Breakpoints as comma-separated values.

use alloc::borrow::ToOwned;
use alloc::string::String;
use alloc::vec::Vec;

use crate::SpecificationError;

/// Longest part of a line that a message quotes, characters.
const QUOTED: usize = 60;

/// Reads breakpoints of a table with two columns, frequency, Hz, and level. Columns are separated by a comma, a semicolon, a
/// tab or blanks. Empty lines and lines that begin with `#` are left out, and so is a first line of words, the names of the
/// columns.
///
/// # Errors
/// [`SpecificationError::Csv`] names the first line without two numbers.
pub fn breakpoints(text: &str, file: &str) -> Result<Vec<[f64; 2]>, SpecificationError> {
    let mut points = Vec::new();
    let mut is_first = true;
    for (line, number) in text.trim_start_matches('\u{feff}').lines().zip(1..) {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let fields: Vec<&str> = line
            .split(|c: char| matches!(c, ',' | ';') || c.is_whitespace())
            .filter(|field| !field.is_empty())
            .collect();
        let numbers: Vec<Option<f64>> = fields.iter().map(|field| field.parse().ok()).collect();
        match numbers[..] {
            [Some(hz), Some(level)] => points.push([hz, level]),
            // A heading has no number at all; a line with one is a damaged breakpoint.
            _ if is_first && numbers.iter().all(Option::is_none) => {}
            _ => {
                let got: String = line.chars().take(QUOTED).collect();
                return Err(SpecificationError::Csv { file: file.to_owned(), line: number, got });
            }
        }
        is_first = false;
    }
    Ok(points)
}

#[cfg(test)]
mod tests {
    use alloc::string::ToString;

    use super::*;

    #[test]
    fn tables_with_and_without_a_heading_are_read() {
        let expected = [[20.0, 0.01], [80.0, 0.04]];
        for text in [
            "frequency_hz,density\n20,0.01\n80,0.04\n",
            "\u{feff}20;1e-2\r\n\r\n80;4e-2",
            "# g2/Hz\n20\t.01\n 80  0.04",
        ] {
            assert_eq!(breakpoints(text, "profile.csv").unwrap(), expected, "{text:?}");
        }
    }

    #[test]
    fn damaged_lines_are_named() {
        for (text, line) in [("20,0.01\nabc,0.04", 2), ("20,0.01,3", 1), ("20,x", 1), ("f,p\n20", 2)] {
            let error = breakpoints(text, "profile.csv").unwrap_err();
            assert!(matches!(error, SpecificationError::Csv { line: got, .. } if got == line), "{error}");
            assert!(error.to_string().starts_with(&alloc::format!("profile.csv, line {line}: ")), "{error}");
        }
    }
}
