//! Loads from a table of numbers.

use alloc::string::{String, ToString};
use alloc::sync::Arc;
use alloc::vec::Vec;

use thiserror::Error;

use super::error::{ExcitationError, samples};
use resonarm_numeric::number::short;

/// Loads of a file in any unit: they are scaled so that the amplitude is their peak.
#[derive(Clone, Debug, PartialEq)]
pub enum LoadFile {
    /// One load per sample.
    Sampled(Arc<[f64]>),
    /// Pairs of time, s, which increases, and load.
    Timed(Arc<[[f64; 2]]>),
}

/// Reason why a text is not a load file.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum LoadFileError {
    /// A cell is not a finite number.
    #[error("line {line}: `{got}` is not a finite number")]
    NotANumber {
        /// Line of the cell, from 1 on.
        line: usize,
        /// Text of the cell.
        got: String,
    },
    /// A line has another number of columns than the others.
    #[error("line {line} has {got} columns: there must be {expected}")]
    Columns {
        /// Line number, from 1 on.
        line: usize,
        /// Number of columns in the line.
        got: usize,
        /// Required number of columns, in words.
        expected: &'static str,
    },
    /// The time does not increase.
    #[error("line {line}: time goes from {before} to {got} s: it must increase", before = short(.before), got = short(.got))]
    Time {
        /// Line number, from 1 on.
        line: usize,
        /// Time in this line, s.
        got: f64,
        /// Time in the line before, s.
        before: f64,
    },
    /// The file has no load other than zero.
    #[error("it has no load other than 0: give a line with a load for each sample, or with time and load")]
    NoLoad,
}

impl LoadFile {
    /// Reads CSV: lines with one load per sample, or with time, s, and load, which are interpolated linearly. Commas
    /// separate the columns; empty lines, text after a `#`, and a first line of names are ignored.
    ///
    /// # Errors
    /// [`LoadFileError`] names the first line that is wrong.
    pub fn parse(text: &str) -> Result<LoadFile, LoadFileError> {
        let lines =
            text.lines().enumerate().map(|(index, line)| (index + 1, line.split('#').next().unwrap_or("").trim()));
        let mut lines = lines.filter(|(_, line)| !line.is_empty()).peekable();
        let is_name = |cell: &str| cell.trim().parse::<f64>().is_err();
        let _names = lines.next_if(|(_, line)| line.split(',').all(is_name));
        let timed = lines.peek().is_some_and(|(_, line)| line.contains(','));
        let file = if timed { LoadFile::Timed(timed_rows(lines)?) } else { LoadFile::Sampled(sampled_rows(lines)?) };
        if file.peak() > 0.0 { Ok(file) } else { Err(LoadFileError::NoLoad) }
    }

    /// Returns the largest magnitude of a load.
    fn peak(&self) -> f64 {
        let largest = |peak: f64, load: &f64| peak.max(libm::fabs(*load));
        match self {
            LoadFile::Sampled(loads) => loads.iter().fold(0.0, largest),
            LoadFile::Timed(rows) => rows.iter().map(|[_, load]| load).fold(0.0, largest),
        }
    }

    /// Returns the loads at the samples of `rate_hz`, in the file's unit; a file with times starts at its first
    /// time.
    pub(super) fn samples(&self, rate_hz: f64) -> Result<Vec<f64>, ExcitationError> {
        const ROUNDING: f64 = 1e-6;
        let (rows, period_s) = match self {
            LoadFile::Sampled(loads) => return Ok(loads.to_vec()),
            LoadFile::Timed(rows) => (rows, 1.0 / rate_hz),
        };
        let steps_s = rows.windows(2).map(|pair| pair[1][0] - pair[0][0]);
        let step_s = steps_s.fold(f64::INFINITY, f64::min);
        // Points closer than the samples would alias when they are interpolated at the samples.
        if step_s < period_s * (1.0 - ROUNDING) {
            return Err(ExcitationError::FileTooDense { step_s, period_s });
        }
        let (Some([start_s, first]), Some([end_s, _])) = (rows.first(), rows.last()) else { return Ok(Vec::new()) };
        // The last sample is the last one that is not after the last point.
        let last = libm::floor((end_s - start_s) * rate_hz + ROUNDING);
        let count = samples("path", (last + 0.5) / rate_hz, rate_hz)?;
        let at = |n: usize| {
            let t_s = start_s + n as f64 / rate_hz;
            // Times increase, so a binary search finds the interval.
            let after = rows.partition_point(|[time_s, _]| *time_s <= t_s);
            match (rows.get(after.wrapping_sub(1)), rows.get(after)) {
                (Some([t0, y0]), Some([t1, y1])) => y0 + (y1 - y0) * ((t_s - t0) / (t1 - t0)),
                (Some([_, last]), None) => *last,
                (None, _) => *first,
            }
        };
        Ok((0..count).map(at).collect())
    }
}

fn sampled_rows<'a>(lines: impl Iterator<Item = (usize, &'a str)>) -> Result<Arc<[f64]>, LoadFileError> {
    let row = |(line, text): (usize, &str)| {
        let [load] = cells(line, text, "1, the load, as in the lines before")?;
        Ok(load)
    };
    lines.map(row).collect::<Result<Vec<_>, _>>().map(Arc::from)
}

fn timed_rows<'a>(lines: impl Iterator<Item = (usize, &'a str)>) -> Result<Arc<[[f64; 2]]>, LoadFileError> {
    let mut rows: Vec<[f64; 2]> = Vec::new();
    for (line, text) in lines {
        let row: [f64; 2] = cells(line, text, "1, the load, or 2, time and load, in all lines")?;
        if let Some([before, _]) = rows.last().copied().filter(|[before, _]| row[0] <= *before) {
            return Err(LoadFileError::Time { line, got: row[0], before });
        }
        rows.push(row);
    }
    Ok(Arc::from(rows))
}

/// Returns the numbers of a line.
fn cells<const N: usize>(line: usize, text: &str, expected: &'static str) -> Result<[f64; N], LoadFileError> {
    let mut numbers = [0.0; N];
    let got = text.split(',').count();
    if got != N {
        return Err(LoadFileError::Columns { line, got, expected });
    }
    for (number, cell) in numbers.iter_mut().zip(text.split(',')) {
        let read = cell.trim().parse::<f64>().ok().filter(|number| number.is_finite());
        *number = read.ok_or_else(|| LoadFileError::NotANumber { line, got: cell.trim().to_string() })?;
    }
    Ok(numbers)
}
