//! Rows of 8-byte words: NumPy sees their bytes as structured arrays.
//!
//! A row is a whole number of words: a float or an integer each; a truth value or a shorter integer in the first bytes
//! of a word. Every word is little-endian, whatever the machine; the types through which Python reads them say so
//! (`resonarm/_dtypes.py`).

use pyo3::prelude::*;
use pyo3::types::PyByteArray;

const WORD: usize = size_of::<u64>();

/// Rows that are being collected.
#[derive(Debug, Default)]
pub struct Rows {
    words: Vec<u64>,
}

impl Rows {
    /// An integer; a truth value as 0 or 1.
    pub fn word(&mut self, word: impl Into<u64>) {
        self.words.push(word.into());
    }

    /// Adds floating-point numbers to the row.
    pub fn numbers(&mut self, numbers: &[f64]) {
        self.words.extend(numbers.iter().map(|number| number.to_bits()));
    }

    /// Bytes, padded with zeros to a whole number of words.
    pub fn bytes(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(WORD) {
            let mut word = [0; WORD];
            word[..chunk.len()].copy_from_slice(chunk);
            // `written` writes words as little-endian, so that the bytes come out in this order on every machine.
            self.words.push(u64::from_le_bytes(word));
        }
    }

    /// The words as bytes, row by row, copied once.
    pub fn into_bytes(self, py: Python<'_>) -> PyResult<Bound<'_, PyByteArray>> {
        written(py, self.words.len(), self.words.iter())
    }

    /// The words of this many rows as bytes, column by column: the first word of every row, then the second. They are
    /// copied once.
    pub fn into_columns(self, py: Python<'_>, rows: usize) -> PyResult<Bound<'_, PyByteArray>> {
        let columns = self.words.len().checked_div(rows).unwrap_or(0);
        written(py, self.words.len(), (0..columns).flat_map(|k| self.words.iter().skip(k).step_by(columns)))
    }
}

fn written<'py, 'w>(
    py: Python<'py>,
    count: usize,
    words: impl Iterator<Item = &'w u64>,
) -> PyResult<Bound<'py, PyByteArray>> {
    PyByteArray::new_with(py, WORD * count, |bytes| {
        for (bytes, word) in bytes.chunks_exact_mut(WORD).zip(words) {
            bytes.copy_from_slice(&word.to_le_bytes());
        }
        Ok(())
    })
}

/// The numbers in an array of Python, given as its bytes, each little-endian.
pub fn numbers(bytes: &[u8]) -> Vec<f64> {
    let (words, _rest) = bytes.as_chunks::<WORD>();
    words.iter().map(|word| f64::from_le_bytes(*word)).collect()
}
