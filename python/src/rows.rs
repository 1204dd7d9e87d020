//! Rows of 8-byte words: NumPy sees their bytes as structured arrays.
//!
//! A row is a whole number of words: a float or an integer each; a truth value in the first byte of a word. The types
//! that Python looks at them through stand in `resonarm/_dtypes.py`.

use pyo3::prelude::*;
use pyo3::types::PyByteArray;

/// Rows that are being gathered.
#[derive(Debug, Default)]
pub struct Rows {
    words: Vec<u64>,
}

impl Rows {
    /// An integer; a truth value as 0 or 1.
    pub fn word(&mut self, word: impl Into<u64>) {
        self.words.push(word.into().to_le());
    }

    /// Numbers.
    pub fn numbers(&mut self, numbers: &[f64]) {
        self.words.extend(numbers.iter().map(|number| number.to_bits()));
    }

    /// Bytes, filled up with zeros to a whole number of words.
    pub fn bytes(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.words.push(u64::from_ne_bytes(word));
        }
    }

    /// The words as bytes, which are copied once.
    pub fn into_bytes(self, py: Python<'_>) -> PyResult<Bound<'_, PyByteArray>> {
        PyByteArray::new_with(py, 8 * self.words.len(), |bytes| {
            for (bytes, word) in bytes.chunks_exact_mut(8).zip(&self.words) {
                bytes.copy_from_slice(&word.to_ne_bytes());
            }
            Ok(())
        })
    }
}

/// The numbers of an array of Python, given as its bytes.
pub fn numbers(bytes: &[u8]) -> Vec<f64> {
    let number = |chunk: &[u8]| chunk.iter().rev().fold(0, |word, &byte| word << 8 | u64::from(byte));
    bytes.chunks_exact(8).map(|chunk| f64::from_bits(number(chunk))).collect()
}
