//! Dense linear systems in storage that is kept: no allocation once the largest size has been seen.

use alloc::vec::Vec;

use resonarm_numeric::registers::{Task, widest};

use crate::error::AnalysisError;

/// Inverse iterations for null vectors.
const INVERSE_ITERATIONS: usize = 3;
/// Columns of L that are subtracted from a column at once.
const PANEL: usize = 8;

/// A square matrix, column by column, and its LU factors with partial pivoting (G. H. Golub, C. F. Van Loan, "Matrix
/// Computations", 4th edition 2013, Alg. 3.4.1, in blocks as in Sec. 3.2.11).
///
/// Row exchanges are not applied to the finished columns of L, so solving exchanges rows step by step.
#[derive(Clone, Debug, Default)]
pub(super) struct Lu {
    n: usize,
    a: Vec<f64>,
    pivots: Vec<usize>,
    /// The finished columns of a panel, from its first row on, with all row exchanges of the panel.
    panel: Vec<f64>,
}

impl Lu {
    /// An n × n matrix of zeros to be filled: element (i, j) is at i + n·j.
    pub fn zeroed(&mut self, n: usize) -> &mut [f64] {
        self.n = n;
        self.a.clear();
        self.a.resize(n * n, 0.0);
        &mut self.a
    }

    /// Replaces the matrix by its factors, PA = LU.
    ///
    /// # Errors
    /// [`AnalysisError::Singular`] if a column has no pivot, or the matrix holds something that is not a number.
    pub fn factor(&mut self) -> Result<(), AnalysisError> {
        let n = self.n;
        self.pivots.clear();
        for first in (0..n).step_by(PANEL) {
            let width = PANEL.min(n - first);
            self.factor_panel(first, width)?;
            self.subtract_panel(first, width);
        }
        Ok(())
    }

    /// Factors the columns of a panel, and exchanges rows in them alone.
    fn factor_panel(&mut self, first: usize, width: usize) -> Result<(), AnalysisError> {
        let n = self.n;
        let columns = &mut self.a[first * n..(first + width) * n];
        for k in first..first + width {
            let (left, right) = columns.split_at_mut((k - first + 1) * n);
            let column = &mut left[(k - first) * n..];
            let pivot = largest(&column[k..]) + k;
            column.swap(k, pivot);
            self.pivots.push(pivot);
            if !(column[k].is_finite() && column[k] != 0.0) {
                return Err(AnalysisError::Singular { size: n });
            }
            let inverse = 1.0 / column[k];
            column[k + 1..].iter_mut().for_each(|value| *value *= inverse);
            for other in right.chunks_exact_mut(n) {
                other.swap(k, pivot);
                let (head, tail) = other.split_at_mut(k + 1);
                subtract(tail, &column[k + 1..], head[k]);
            }
        }
        Ok(())
    }

    /// Subtracts the products of a panel's columns of L from the columns to its right. Each element has them subtracted in
    /// the order of the columns, as if they came one by one: the factors don't depend on the width of a panel.
    fn subtract_panel(&mut self, first: usize, width: usize) {
        let n = self.n;
        let rows = self.n - first;
        let (left, right) = self.a.split_at_mut((first + width) * n);
        let exchanges = &self.pivots[first..];
        self.panel.clear();
        for (k, column) in left[first * n..].chunks_exact(n).enumerate() {
            self.panel.extend_from_slice(&column[first..]);
            let copy = &mut self.panel[k * rows..];
            for (later, pivot) in exchanges.iter().enumerate().skip(k + 1) {
                copy.swap(later, pivot - first);
            }
        }
        // A panel that is not whole has no columns to its right.
        let Some((own, _)) = self.panel.split_first_chunk::<PANEL>().filter(|_| width == PANEL) else { return };
        let mut triangle = [*own; PANEL];
        for (own, column) in triangle.iter_mut().zip(self.panel.chunks_exact(rows)) {
            own.copy_from_slice(&column[..PANEL]);
        }
        for column in right.chunks_exact_mut(n) {
            let column = &mut column[first..];
            exchanges.iter().enumerate().for_each(|(k, pivot)| column.swap(k, pivot - first));
            let Some((factors, target)) = column.split_first_chunk_mut::<PANEL>() else { return };
            for (k, own) in triangle.iter().enumerate() {
                let factor = factors[k];
                for row in k + 1..PANEL {
                    factors[row] -= factor * own[row];
                }
            }
            widest(SubtractPanel { target, panel: &self.panel, factors });
        }
    }

    /// Overwrites b by A⁻¹ b.
    pub fn solve(&self, b: &mut [f64]) {
        let n = self.n;
        for (k, column) in self.a.chunks_exact(n).enumerate() {
            b.swap(k, self.pivots[k]);
            let (head, tail) = b.split_at_mut(k + 1);
            subtract(tail, &column[k + 1..], head[k]);
        }
        for (k, column) in self.a.chunks_exact(n).enumerate().rev() {
            let (head, tail) = b.split_at_mut(k);
            tail[0] /= column[k];
            subtract(head, &column[..k], tail[0]);
        }
    }

    /// Overwrites b by A⁻ᵀ b.
    pub fn solve_transposed(&self, b: &mut [f64]) {
        let n = self.n;
        for (k, column) in self.a.chunks_exact(n).enumerate() {
            b[k] = (b[k] - dot(&column[..k], &b[..k])) / column[k];
        }
        for (k, column) in self.a.chunks_exact(n).enumerate().rev() {
            b[k] -= dot(&column[k + 1..], &b[k + 1..n]);
            b.swap(k, self.pivots[k]);
        }
    }

    /// Unit vectors near the null vectors of A and Aᵀ, where A is nearly singular, by inverse iteration ("Matrix
    /// Computations", as above, Sec. 8.2.2) from a vector with a component in every direction.
    pub fn null_vectors(&self) -> [Vec<f64>; 2] {
        let iterate = |solve: &dyn Fn(&mut [f64])| {
            let mut vector: Vec<f64> = (0..self.n).map(|i| 1.0 / (1 + i) as f64).collect();
            for _ in 0..INVERSE_ITERATIONS {
                solve(&mut vector);
                normalise(&mut vector);
            }
            vector
        };
        [iterate(&|b| self.solve(b)), iterate(&|b| self.solve_transposed(b))]
    }

    /// The determinant as sign and logarithm, since a product of many pivots overflows.
    pub fn determinant(&self) -> Determinant {
        // Each exchange of two rows changes the sign.
        let exchanges = self.pivots.iter().enumerate().filter(|&(k, &pivot)| k != pivot).count();
        let start = Determinant { sign: if exchanges.is_multiple_of(2) { 1.0 } else { -1.0 }, log_magnitude: 0.0 };
        self.a.iter().step_by(self.n + 1).fold(start, |d, diagonal| Determinant {
            sign: if *diagonal < 0.0 { -d.sign } else { d.sign },
            log_magnitude: d.log_magnitude + libm::log(diagonal.abs()),
        })
    }
}

/// A determinant that may be too large or too small for a number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Determinant {
    /// Its sign, 1 or −1.
    pub sign: f64,
    /// Natural logarithm of the determinant's magnitude.
    pub log_magnitude: f64,
}

/// The index of the element of largest magnitude; the first, if none is a number.
fn largest(values: &[f64]) -> usize {
    let mut best = 0;
    for (i, value) in values.iter().enumerate() {
        if value.abs() > values[best].abs() {
            best = i;
        }
    }
    best
}

/// Subtracts the products of the columns of a panel, below its own rows, and these factors.
struct SubtractPanel<'a> {
    target: &'a mut [f64],
    panel: &'a [f64],
    factors: &'a [f64; PANEL],
}

impl Task for SubtractPanel<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let count = self.target.len();
        let rows = self.target.len() + PANEL;
        let column = |k: usize| &self.panel[k * rows + PANEL..][..count];
        let columns: [&[f64]; PANEL] = core::array::from_fn(column);
        for (i, target) in self.target.iter_mut().enumerate() {
            let mut value = *target;
            for (column, factor) in columns.iter().zip(self.factors) {
                value -= factor * column[i];
            }
            *target = value;
        }
    }
}

/// target += factor · source.
pub(super) fn add(target: &mut [f64], source: &[f64], factor: f64) {
    target.iter_mut().zip(source).for_each(|(target, source)| *target += factor * source);
}

/// target −= factor · source.
fn subtract(target: &mut [f64], source: &[f64], factor: f64) {
    for (t, s) in target.iter_mut().zip(source) {
        *t -= factor * s;
    }
}

/// Σ aᵢ bᵢ, in four running sums.
#[inline(always)]
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Four independent sums keep the processor's adders busy. Their order is fixed, so the result is the same on every
    // machine.
    let mut sums = [0.0; 4];
    let heads = a.chunks_exact(4);
    let others = b.chunks_exact(4);
    let rest: f64 = heads.remainder().iter().zip(others.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in heads.zip(others) {
        for lane in 0..4 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

/// Euclidean norm √Σ aᵢ².
pub(super) fn norm(a: &[f64]) -> f64 {
    libm::sqrt(dot(a, a))
}

/// Divides a vector by its length.
pub(super) fn normalise(vector: &mut [f64]) {
    let length = norm(vector);
    vector.iter_mut().for_each(|value| *value /= length);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_what_needs_pivoting_both_ways() {
        let n = 7;
        let element = |i: usize, j: usize| {
            if i == j { 0.0 } else { libm::sin((3 * i + 5 * j * j + 1) as f64) }
        };
        let mut lu = Lu::default();
        let a = lu.zeroed(n);
        (0..n * n).for_each(|at| a[at] = element(at % n, at / n));
        lu.factor().unwrap();
        let x: Vec<f64> = (0..n).map(|i| i as f64 - 2.5).collect();
        let product = |e: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
            (0..n).map(|i| (0..n).map(|j| e(i, j) * x[j]).sum()).collect()
        };
        let close = |b: &[f64]| assert!(b.iter().zip(&x).all(|(b, x)| (b - x).abs() < 1e-12), "{b:?}");
        let mut b = product(&|i, j| element(i, j));
        lu.solve(&mut b);
        close(&b);
        let mut b = product(&|i, j| element(j, i));
        lu.solve_transposed(&mut b);
        close(&b);
        let truth = nalgebra::SMatrix::<f64, 7, 7>::from_fn(element).determinant();
        let determinant = lu.determinant();
        assert!((determinant.sign * libm::exp(determinant.log_magnitude) / truth - 1.0).abs() < 1e-12);
    }

    /// The factors are those of elimination column by column, to the last bit.
    #[test]
    fn panels_change_no_bit() {
        let n = 3 * PANEL + 5;
        let element = |at: usize| libm::sin((at * at + 3 * at + 1) as f64);
        let mut lu = Lu::default();
        lu.zeroed(n).iter_mut().enumerate().for_each(|(at, value)| *value = element(at));
        let mut plain: Vec<f64> = (0..n * n).map(element).collect();
        let mut pivots = Vec::new();
        for k in 0..n {
            let (left, right) = plain.split_at_mut((k + 1) * n);
            let column = &mut left[k * n..];
            let pivot = largest(&column[k..]) + k;
            pivots.push(pivot);
            column.swap(k, pivot);
            let inverse = 1.0 / column[k];
            column[k + 1..].iter_mut().for_each(|value| *value *= inverse);
            for other in right.chunks_exact_mut(n) {
                other.swap(k, pivot);
                let (head, tail) = other.split_at_mut(k + 1);
                subtract(tail, &column[k + 1..], head[k]);
            }
        }
        lu.factor().unwrap();
        assert_eq!((&lu.pivots, &lu.a), (&pivots, &plain));
    }

    #[test]
    fn a_matrix_without_an_inverse_is_an_error() {
        let mut lu = Lu::default();
        lu.zeroed(3);
        assert_eq!(lu.factor(), Err(AnalysisError::Singular { size: 3 }));
        lu.zeroed(2).fill(f64::NAN);
        assert_eq!(lu.factor(), Err(AnalysisError::Singular { size: 2 }));
    }
}
