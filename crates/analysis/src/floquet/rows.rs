//! A flow by rows: an operation on states is one on whole rows, with all columns side by side.

use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

use nalgebra::DMatrix;

use crate::dense::add;

/// A square matrix, row by row.
pub(super) struct Rows {
    pub width: usize,
    data: Vec<f64>,
    product: Vec<f64>,
}

impl Rows {
    pub fn identity(width: usize) -> Rows {
        let mut data = vec![0.0; width * width];
        data.iter_mut().step_by(width + 1).for_each(|diagonal| *diagonal = 1.0);
        Rows { width, data, product: vec![] }
    }

    /// Returns some rows, one after the other.
    pub fn rows(&self, rows: Range<usize>) -> &[f64] {
        &self.data[rows.start * self.width..rows.end * self.width]
    }

    /// Returns the first rows, and one row beyond.
    pub fn split(&mut self, first: usize, beyond: usize) -> (&[f64], &mut [f64]) {
        let (head, tail) = self.data.split_at_mut(first * self.width);
        (head, &mut tail[beyond * self.width..(beyond + 1) * self.width])
    }

    /// Adds a multiple of a row to another vector.
    pub fn add_to(&self, target: &mut [f64], row: usize, factor: f64) {
        add(target, &self.data[row * self.width..(row + 1) * self.width], factor);
    }

    /// Adds a multiple of some rows to the ones from `first` on.
    pub fn add(&mut self, first: usize, rows: &[f64], factor: f64) {
        add(&mut self.data[first * self.width..], rows, factor);
    }

    /// Replaces the first rows by their product with a square matrix, given by rows.
    pub fn multiply(&mut self, matrix: &[f64]) {
        let width = self.width;
        let n = matrix.len().isqrt();
        // The storage is kept between the many products of a period; emptied, it is filled with the zeros from which
        // the sums start.
        self.product.clear();
        self.product.resize(n * width, 0.0);
        for (product, factors) in self.product.chunks_exact_mut(width).zip(matrix.chunks_exact(n)) {
            for (row, factor) in self.data.chunks_exact(width).zip(factors) {
                add(product, row, *factor);
            }
        }
        self.data[..n * width].copy_from_slice(&self.product);
    }

    pub fn matrix(&self) -> DMatrix<f64> {
        DMatrix::from_row_slice(self.width, self.width, &self.data)
    }
}

/// Overwrites B by A⁻¹B, both by rows, for a matrix A of n rows that needs no pivots, as a mass matrix; `None` if A has
/// no inverse.
pub(super) fn eliminate(a: &mut [f64], b: &mut [f64], n: usize) -> Option<()> {
    let width = b.len() / n;
    for k in 0..n {
        let pivot = a[k * n + k];
        if !(pivot.is_finite() && pivot != 0.0) {
            return None;
        }
        let (upper, lower) = a.split_at_mut((k + 1) * n);
        let (above, below) = b.split_at_mut((k + 1) * width);
        for (row, right) in lower.chunks_exact_mut(n).zip(below.chunks_exact_mut(width)) {
            let factor = -row[k] / pivot;
            add(&mut row[k..], &upper[k * n + k..], factor);
            add(right, &above[k * width..], factor);
        }
    }
    for k in (0..n).rev() {
        let (head, tail) = b.split_at_mut((k + 1) * width);
        let right = &mut head[k * width..];
        for (j, solved) in tail.chunks_exact(width).enumerate() {
            add(right, solved, -a[k * n + k + 1 + j]);
        }
        let inverse = 1.0 / a[k * n + k];
        right.iter_mut().for_each(|value| *value *= inverse);
    }
    Some(())
}
