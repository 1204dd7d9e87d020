//! Breakpoints and pulses as comma-separated values.

use alloc::borrow::ToOwned;
use alloc::string::String;
use alloc::vec::Vec;

use crate::GRAVITY_M_S2;
use crate::error::SpecificationError;
use crate::profile::Corner;

/// Longest part of a line that a message quotes, characters.
const QUOTED: usize = 60;

/// Reads breakpoints of a table with two columns, frequency, Hz, and level. Columns are separated by a comma, a semicolon, a
/// tab or blanks. Empty lines and lines that begin with `#` are left out, and so is a first line of words, the names of the
/// columns.
///
/// # Errors
/// [`SpecificationError::Csv`] names the first line without two numbers.
pub fn breakpoints(text: &str, file: &str) -> Result<Vec<[f64; 2]>, SpecificationError> {
    Ok(table(text, file, "a frequency, Hz, and a level")?.rows)
}

/// Reads the points of a pulse, times, s, and accelerations, m/s², of a table like that of [`breakpoints`] whose first line names
/// the columns with their units: `time_s` or `time_ms`, then `acceleration_m_s2` or `acceleration_g`.
///
/// # Errors
/// [`SpecificationError::Csv`] if the first line does not name the columns, or names the first line without two numbers.
pub fn pulse(text: &str, file: &str) -> Result<Vec<[f64; 2]>, SpecificationError> {
    let Table { heading, rows } = table(text, file, "a time and an acceleration")?;
    let expected = "time_s or time_ms, and acceleration_m_s2 or acceleration_g";
    let unnamed = |at: (usize, &str)| damaged(file, at, "does not name the columns of a pulse", expected);
    // A file without a heading begins with a point, and an empty one with nothing.
    let (line, heading) = heading.ok_or_else(|| unnamed(lines(text).next().unwrap_or((1, ""))))?;
    let units = match fields(heading)[..] {
        [time, acceleration] => {
            let seconds = [("time_s", 1.0), ("time_ms", 1e-3)];
            let accelerations = [("acceleration_m_s2", 1.0), ("acceleration_g", GRAVITY_M_S2)];
            unit(seconds, time).zip(unit(accelerations, acceleration))
        }
        _ => None,
    };
    let (seconds, m_s2) = units.ok_or_else(|| unnamed((line, heading)))?;
    Ok(rows.iter().map(|[time, acceleration]| [seconds * time, m_s2 * acceleration]).collect())
}

/// Returns the factor of a unit by its name.
fn unit(units: [(&str, f64); 2], name: &str) -> Option<f64> {
    units.into_iter().find(|(known, _)| *known == name).map(|(_, factor)| factor)
}

/// Rows of two numbers, with the line of words before them and its number, if there is one.
struct Table<'a> {
    heading: Option<(usize, &'a str)>,
    rows: Vec<[f64; 2]>,
}

/// Returns the lines of a table with their numbers, without empty ones and comments.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    // Spreadsheets begin a file with a byte order mark, which is no part of its first number.
    let lines = (1..).zip(text.trim_start_matches('\u{feff}').lines().map(str::trim));
    lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

fn fields(line: &str) -> Vec<&str> {
    line.split(|c: char| matches!(c, ',' | ';') || c.is_whitespace()).filter(|field| !field.is_empty()).collect()
}

fn table<'a>(text: &'a str, file: &str, expected: &'static str) -> Result<Table<'a>, SpecificationError> {
    let mut table = Table { heading: None, rows: Vec::new() };
    for (index, (number, line)) in lines(text).enumerate() {
        let numbers: Vec<Option<f64>> = fields(line).iter().map(|field| field.parse().ok()).collect();
        match numbers[..] {
            [Some(first), Some(second)] => table.rows.push([first, second]),
            // A heading has no number at all; a line with one is a damaged row.
            _ if index == 0 && numbers.iter().all(Option::is_none) => table.heading = Some((number, line)),
            _ => return Err(damaged(file, (number, line), "has no two numbers", expected)),
        }
    }
    Ok(table)
}

/// Makes the error of a line.
fn damaged(file: &str, (line, got): (usize, &str), fault: &'static str, expected: &'static str) -> SpecificationError {
    SpecificationError::Csv { file: file.to_owned(), line, got: got.chars().take(QUOTED).collect(), fault, expected }
}

/// Returns the corners of a profile, from the file itself or from a table that it names.
pub(crate) fn corners(
    section: &'static str,
    entries: Option<&[Corner]>,
    file: Option<&str>,
    read: &mut dyn FnMut(&str) -> Result<String, String>,
) -> Result<Vec<Corner>, SpecificationError> {
    match (entries, file) {
        (Some(entries), None) => Ok(entries.to_vec()),
        (None, Some(file)) => {
            let text = read(file).map_err(|message| SpecificationError::File { file: file.to_owned(), message })?;
            Ok(breakpoints(&text, file)?.into_iter().map(Corner::Point).collect())
        }
        (entries, file) => {
            let got = usize::from(entries.is_some()) + usize::from(file.is_some());
            Err(SpecificationError::OneOf { section, keys: &["breakpoints", "file"], got })
        }
    }
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

    #[test]
    fn pulses_have_the_units_of_their_heading() {
        let points = pulse("time_ms,acceleration_g\n0,0\n10,2\n", "pulse.csv").unwrap();
        assert_eq!(points, [[0.0, 0.0], [0.01, 2.0 * 9.80665]]);
        assert_eq!(pulse("# a pulse\ntime_s acceleration_m_s2\n0 1\n", "pulse.csv").unwrap(), [[0.0, 1.0]]);
        for (text, expected) in [
            ("0,0\n1,1\n", "pulse.csv, line 1: `0,0` does not name the columns of a pulse: "),
            ("\n\ntime,acceleration_g\n0,0\n", "pulse.csv, line 3: `time,acceleration_g` does not name"),
            ("acceleration_g,time_s\n0,0\n", "pulse.csv, line 1: `acceleration_g,time_s` does not name"),
            ("", "pulse.csv, line 1: `` does not name"),
            ("time_s,acceleration_g\n0,x\n", "pulse.csv, line 2: `0,x` has no two numbers: expected a time"),
        ] {
            let error = pulse(text, "pulse.csv").unwrap_err().to_string();
            assert!(error.starts_with(expected), "{error}");
        }
    }
}
