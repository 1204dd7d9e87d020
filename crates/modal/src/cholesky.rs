//! Cholesky's factors of positive semidefinite matrices.

use alloc::vec;
use alloc::vec::Vec;

/// A pivot below this part of its diagonal element belongs to a column that depends on those before it.
const DEPENDENT: f64 = 1e-13;

/// A = L Lᵀ of a symmetric matrix that may be singular (G. H. Golub, C. F. Van Loan, "Matrix Computations", 4th edition
/// 2013, section 4.2.8, without exchanges): a column that depends on those before it is left out, and its unknown is 0. The
/// factors of a leading block of A are the leading block of L.
#[derive(Clone, Debug)]
pub(crate) struct Cholesky {
    n: usize,
    /// L by rows, without its diagonal.
    l: Vec<f64>,
    /// 1 over the diagonal of L; 0 for a column that is left out.
    inverses: Vec<f64>,
    /// Scales √aᵢᵢ, by which rows and columns are divided before they are factored.
    scales: Vec<f64>,
}

impl Cholesky {
    /// Factors the first n rows and columns of a matrix by rows, whose rows are `stride` apart.
    pub fn new(n: usize, a: &[f64], stride: usize) -> Cholesky {
        let scales: Vec<f64> = (0..n)
            .map(|i| libm::sqrt(a[i * stride + i]))
            .map(|scale| if scale > 0.0 && scale.is_finite() { scale } else { 0.0 })
            .collect();
        let mut factor = Cholesky { n, l: vec![0.0; n * n], inverses: vec![0.0; n], scales };
        for i in 0..n {
            let (above, rest) = factor.l.split_at_mut(i * n);
            let row = &mut rest[..n];
            for j in 0..i {
                let scale = factor.scales[i] * factor.scales[j];
                let element = if scale > 0.0 { a[i * stride + j] / scale } else { 0.0 };
                row[j] = (element - dot(&row[..j], &above[j * n..j * n + j])) * factor.inverses[j];
            }
            // The diagonal is scaled to 1: the pivot is the part of a column that those before it don't explain.
            let pivot = 1.0 - dot(&row[..i], &row[..i]);
            // An inverse that stays 0 makes the column of L and the unknown 0 wherever they are used, without a further
            // test.
            if factor.scales[i] > 0.0 && pivot > DEPENDENT {
                factor.inverses[i] = 1.0 / libm::sqrt(pivot);
            }
        }
        factor
    }

    /// Returns whether an unknown is determined, and not left out.
    pub fn determines(&self, unknown: usize) -> bool {
        self.inverses[unknown] > 0.0
    }

    /// Overwrites b by L⁻¹ b.
    pub fn forward(&self, b: &mut [f64]) {
        for i in 0..self.n {
            let known = dot(&self.l[i * self.n..i * self.n + i], &b[..i]);
            let scaled = if self.scales[i] > 0.0 { b[i] / self.scales[i] } else { 0.0 };
            b[i] = (scaled - known) * self.inverses[i];
        }
    }

    /// Overwrites the first `size` numbers of b by L⁻ᵀ b of the leading block of that size.
    pub fn backward(&self, size: usize, b: &mut [f64]) {
        for i in (0..size).rev() {
            let value = b[i] * self.inverses[i];
            for (known, l) in b[..i].iter_mut().zip(&self.l[i * self.n..i * self.n + i]) {
                *known -= value * l;
            }
            b[i] = value;
        }
        for (value, scale) in b[..size].iter_mut().zip(&self.scales) {
            *value = if *scale > 0.0 { *value / scale } else { 0.0 };
        }
    }

    /// Overwrites b by A⁻¹ b.
    pub fn solve(&self, b: &mut [f64]) {
        self.forward(b);
        self.backward(self.n, b);
    }
}

/// Σ aᵢ bᵢ in four sums.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a, a_rest) = a.as_chunks::<4>();
    let (b, b_rest) = b.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (a, b) in a.iter().zip(b) {
        (0..4).for_each(|lane| sums[lane] += a[lane] * b[lane]);
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

#[cfg(test)]
mod tests {
    use resonarm_numeric::noise::Noise;

    use super::*;

    /// A = BᵀB of random B with columns of very different sizes; leading blocks, too.
    #[test]
    fn systems_are_solved() {
        let mut noise = Noise::new(1, 0);
        let n = 9;
        let rows = 20;
        let b: Vec<f64> = (0..rows * n).map(|k| noise.normal() * libm::exp2((2 * (k % n)) as f64)).collect();
        let element = |i: usize, j: usize| (0..rows).map(|r| b[r * n + i] * b[r * n + j]).sum::<f64>();
        let a: Vec<f64> = (0..n * n).map(|k| element(k / n, k % n)).collect();
        let factor = Cholesky::new(n, &a, n);
        let x: Vec<f64> = (0..n).map(|_| noise.normal()).collect();
        for size in [4, n] {
            let mut right: Vec<f64> = (0..n).map(|i| (0..size).map(|j| a[i * n + j] * x[j]).sum()).collect();
            factor.forward(&mut right);
            factor.backward(size, &mut right);
            for i in 0..size {
                assert!((right[i] - x[i]).abs() < 1e-9 * x[i].abs().max(1.0), "{size} {i}");
            }
        }
    }

    /// The second column is twice the first one, the third is zero.
    #[test]
    fn dependent_columns_are_left_out() {
        let a = [1.0, 2.0, 0.0, 1.0, 2.0, 4.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 0.0, 3.0];
        let factor = Cholesky::new(4, &a, 4);
        assert_eq!([0, 1, 2, 3].map(|k| factor.determines(k)), [true, false, false, true]);
        let mut b = [2.0, 4.0, 0.0, 4.0];
        factor.solve(&mut b);
        assert!((b[0] - 1.0).abs() < 1e-14 && (b[3] - 1.0).abs() < 1e-14, "{b:?}");
        assert_eq!([b[1], b[2]], [0.0, 0.0]);
    }
}
