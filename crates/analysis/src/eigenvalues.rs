//! Eigenvalues of a real matrix, without vectors: balanced by powers of two (B. N. Parlett, C. Reinsch, Numer. Math. 13
//! (1969)), brought to Hessenberg form by elimination, and by the QR algorithm with double shifts on the part that is
//! left (R. S. Martin, G. Peters, J. H. Wilkinson, "The QR algorithm for real Hessenberg matrices", Numer. Math. 14
//! (1970)):
//!
//! ```text
//! H ← P⁻¹ H P,  P reflecting the first column of (H − σI)(H − σ̄I) onto e₁, then H back to Hessenberg form
//! ```
//!
//! with the eigenvalues σ, σ̄ of the last two rows, until a subdiagonal element vanishes and one eigenvalue or two are
//! split off. A complete Schur form, as the library for matrices has it, takes several times as long.

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::{Complex, Matrix4};

/// The most steps for an eigenvalue, and the number after which an exceptional shift is tried.
const STEPS: usize = 40;
const EXCEPTIONAL: usize = 10;
/// A row and its column are scaled if that reduces their sum of magnitudes below this part.
const BALANCED: f64 = 0.95;

const NAN: Complex<f64> = Complex::new(f64::NAN, f64::NAN);

/// A square matrix by rows.
struct Matrix<'a> {
    n: usize,
    a: &'a mut [f64],
}

/// All eigenvalues of a matrix of n rows, given by rows, which is overwritten; none if the algorithm doesn't converge.
pub(crate) fn eigenvalues(n: usize, a: &mut [f64]) -> Option<Vec<Complex<f64>>> {
    let (mut factors, mut found) = (vec![0.0; n], vec![NAN; n]);
    find(a, &mut factors, &mut found).then_some(found)
}

/// Those of a matrix of order 4; NaN if the algorithm doesn't converge. Allocates nothing.
pub(crate) fn of_four(matrix: &Matrix4<f64>) -> [Complex<f64>; 4] {
    // By columns: those of the transpose are the same.
    let mut a: [f64; 16] = core::array::from_fn(|k| matrix[k]);
    let mut found = [NAN; 4];
    if find(&mut a, &mut [0.0; 4], &mut found) { found } else { [NAN; 4] }
}

/// Writes the eigenvalues of `a` to `found`, with storage for the factors of elimination; `false` if the algorithm
/// doesn't converge.
fn find(a: &mut [f64], factors: &mut [f64], found: &mut [Complex<f64>]) -> bool {
    let mut matrix = Matrix { n: found.len(), a };
    matrix.balance();
    matrix.reduce(factors);
    let (mut end, mut moved) = (matrix.n, 0.0);
    while end > 0 {
        let mut steps = 0;
        loop {
            let start = matrix.split(end);
            if end - start <= 2 {
                matrix.last(moved, start, &mut found[start..end]);
                end = start;
                break;
            }
            if steps == STEPS {
                return false;
            }
            steps += 1;
            moved += matrix.step(start, end, steps % EXCEPTIONAL == 0);
        }
    }
    found.iter().all(|value| value.norm_sqr().is_finite())
}

impl Matrix<'_> {
    fn at(&self, row: usize, column: usize) -> f64 {
        self.a[row * self.n + column]
    }

    /// A row, and another below it.
    fn two(&mut self, row: usize, below: usize) -> (&mut [f64], &mut [f64]) {
        let (head, tail) = self.a.split_at_mut(below * self.n);
        (&mut head[row * self.n..(row + 1) * self.n], &mut tail[..self.n])
    }

    /// Scales rows and columns by powers of two, so that the sums of a row and its column are alike.
    fn balance(&mut self) {
        let n = self.n;
        let mut done = false;
        while !done {
            done = true;
            for i in 0..n {
                let others = || (0..n).filter(move |j| *j != i);
                let row: f64 = others().map(|j| self.at(i, j).abs()).sum();
                let column: f64 = others().map(|j| self.at(j, i).abs()).sum();
                let ratio = row / column;
                if !(ratio.is_finite() && ratio > 0.0) {
                    continue;
                }
                let factor = libm::exp2(libm::round(0.5 * libm::log2(ratio)));
                if column * factor + row / factor >= BALANCED * (column + row) {
                    continue;
                }
                done = false;
                self.a[i * n..(i + 1) * n].iter_mut().for_each(|value| *value /= factor);
                self.a[i..].iter_mut().step_by(n).for_each(|value| *value *= factor);
            }
        }
    }

    /// To Hessenberg form: row i ← row i − yᵢ row m, column m ← column m + Σ yᵢ column i, for each m.
    fn reduce(&mut self, y: &mut [f64]) {
        let n = self.n;
        for m in 1..n.saturating_sub(1) {
            let size = |row: usize| self.at(row, m - 1).abs();
            let pivot = (m..n).fold(m, |best, row| if size(row) > size(best) { row } else { best });
            if self.at(pivot, m - 1) == 0.0 {
                continue;
            }
            if pivot != m {
                let (a, b) = self.two(m, pivot);
                a.swap_with_slice(b);
                self.a.chunks_exact_mut(n).for_each(|row| row.swap(m, pivot));
            }
            for (i, factor) in (m + 1..n).zip(&mut y[m + 1..]) {
                let (above, row) = self.two(m, i);
                *factor = row[m - 1] / above[m - 1];
                row[m - 1] = 0.0;
                row[m..].iter_mut().zip(&above[m..]).for_each(|(value, above)| *value -= *factor * above);
            }
            for row in self.a.chunks_exact_mut(n) {
                row[m] += row[m + 1..].iter().zip(&y[m + 1..]).map(|(value, y)| value * y).sum::<f64>();
            }
        }
    }

    /// The first row of the last block up to `end`, whose subdiagonal element vanishes.
    fn split(&mut self, end: usize) -> usize {
        for row in (1..end).rev() {
            let beside = self.at(row - 1, row - 1).abs() + self.at(row, row).abs();
            if self.at(row, row - 1).abs() <= f64::EPSILON * beside {
                self.a[row * self.n + row - 1] = 0.0;
                return row;
            }
        }
        0
    }

    /// The eigenvalues of the one or two rows from `start` on.
    fn last(&self, moved: f64, start: usize, found: &mut [Complex<f64>]) {
        let last = start + found.len() - 1;
        let x = self.at(last, last);
        let [first, second] = found else {
            found.fill(Complex::new(x + moved, 0.0));
            return;
        };
        let product = self.at(last, start) * self.at(start, last);
        let half = 0.5 * (self.at(start, start) - x);
        let square = half * half + product;
        let root = libm::sqrt(square.abs());
        if square < 0.0 {
            [*first, *second] = [root, -root].map(|im| Complex::new(x + half + moved, im));
            return;
        }
        let far = half + root.copysign(half);
        let other = if far == 0.0 { 0.0 } else { product / far };
        [*first, *second] = [far, -other].map(|re| Complex::new(x + re + moved, 0.0));
    }

    /// A step on the rows from `start` to `end`, at least three; returns what an exceptional shift takes off the
    /// diagonal.
    fn step(&mut self, start: usize, end: usize, exceptional: bool) -> f64 {
        let (n, last) = (self.n, end - 1);
        let (mut x, mut y) = (self.at(last, last), self.at(last - 1, last - 1));
        let (mut product, mut moved) = (self.at(last, last - 1) * self.at(last - 1, last), 0.0);
        if exceptional {
            moved = x;
            (0..end).for_each(|i| self.a[i * n + i] -= x);
            let size = self.at(last, last - 1).abs() + self.at(last - 1, last - 2).abs();
            (x, y, product) = (0.75 * size, 0.75 * size, -0.4375 * size * size);
        }
        // Starts at the last row where two subdiagonal elements in turn are small.
        let mut first = last - 2;
        let column = loop {
            let (z, below) = (self.at(first, first), self.at(first + 1, first));
            let (r, s, next) = (x - z, y - z, self.at(first + 1, first + 1));
            let column = [
                (r * s - product) / below + self.at(first, first + 1),
                next - z - r - s,
                self.at(first + 2, first + 1),
            ];
            let size: f64 = column.iter().map(|value| value.abs()).sum();
            let column = column.map(|value| value / size);
            if first == start {
                break column;
            }
            let small = self.at(first, first - 1).abs() * (column[1].abs() + column[2].abs());
            let beside = self.at(first - 1, first - 1).abs() + z.abs() + next.abs();
            if small <= f64::EPSILON * column[0].abs() * beside {
                break column;
            }
            first -= 1;
        };
        self.chase(start, end, first, column);
        moved
    }

    /// Reflects `column` onto its first element, and then what is below the subdiagonal of each column, down to `end`.
    fn chase(&mut self, start: usize, end: usize, first: usize, mut column: [f64; 3]) {
        let (n, last) = (self.n, end - 1);
        for row in first + 2..end {
            self.a[row * n + row - 2] = 0.0;
            if row > first + 2 {
                self.a[row * n + row - 3] = 0.0;
            }
        }
        for k in first..last {
            let (three, mut scale) = (k + 1 < last, 1.0);
            if k > first {
                column = [self.at(k, k - 1), self.at(k + 1, k - 1), if three { self.at(k + 2, k - 1) } else { 0.0 }];
                scale = column.iter().map(|value| value.abs()).sum();
                if scale == 0.0 {
                    continue;
                }
                column = column.map(|value| value / scale);
            }
            let [p, q, r] = column;
            let size = libm::sqrt(p * p + q * q + r * r).copysign(p);
            if size == 0.0 {
                continue;
            }
            if k > first {
                self.a[k * n + k - 1] = -size * scale;
            } else if start < first {
                self.a[k * n + k - 1] = -self.a[k * n + k - 1];
            }
            let p = p + size;
            self.reflect([start, k, end], three, [p / size, q / size, r / size], [q / p, r / p]);
        }
    }

    /// Rows and columns k, k + 1 and, of three, k + 2 of the part from `start` to `end` by I − w uᵀ with u = (1, `u`).
    fn reflect(&mut self, [start, k, end]: [usize; 3], three: bool, w: [f64; 3], u: [f64; 2]) {
        let n = self.n;
        let (head, tail) = self.a[k * n..].split_at_mut(n);
        let (middle, tail) = tail.split_at_mut(n);
        let (a, b) = (&mut head[k..end], &mut middle[k..end]);
        if three {
            for ((a, b), c) in a.iter_mut().zip(b).zip(&mut tail[k..end]) {
                let sum = *a + u[0] * *b + u[1] * *c;
                *a -= sum * w[0];
                *b -= sum * w[1];
                *c -= sum * w[2];
            }
        } else {
            for (a, b) in a.iter_mut().zip(b) {
                let sum = *a + u[0] * *b;
                *a -= sum * w[0];
                *b -= sum * w[1];
            }
        }
        let bottom = (k + 4).min(end);
        for row in self.a[start * n..bottom * n].chunks_exact_mut(n) {
            if three {
                let [a, b, c] = [row[k], row[k + 1], row[k + 2]];
                let sum = w[0] * a + w[1] * b + w[2] * c;
                (row[k], row[k + 1], row[k + 2]) = (a - sum, b - sum * u[0], c - sum * u[1]);
            } else {
                let [a, b] = [row[k], row[k + 1]];
                let sum = w[0] * a + w[1] * b;
                (row[k], row[k + 1]) = (a - sum, b - sum * u[0]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use resonarm_numeric::noise::Noise;

    use super::*;

    /// Polynomials with known roots, by their companion matrices; and random matrices of many scales, whose eigenvalues
    /// have the sums of powers that their traces are.
    #[test]
    fn eigenvalues_are_roots() {
        for (matrix, expected) in [
            (vec![2.0], vec![[2.0, 0.0]]),
            (vec![0.0, -1.0, 1.0, 0.0], vec![[0.0, 1.0], [0.0, -1.0]]),
            (vec![0.0, 0.0, 6.0, 1.0, 0.0, -11.0, 0.0, 1.0, 6.0], vec![[1.0, 0.0], [2.0, 0.0], [3.0, 0.0]]),
            (
                vec![0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
                vec![[1.0, 0.0], [-0.5, 0.75_f64.sqrt()], [-0.5, -0.75_f64.sqrt()]],
            ),
        ] {
            let mut got = eigenvalues(expected.len(), &mut matrix.clone()).unwrap();
            for [re, im] in expected {
                let at = got.iter().position(|value| (value - Complex::new(re, im)).norm_sqr() < 1e-24);
                got.swap_remove(at.unwrap_or_else(|| panic!("{got:?}: no {re} {im}")));
            }
        }
    }

    /// Cyclic permutations are the classical matrices on which the double shift goes round in circles.
    #[test]
    fn eigenvalues_of_orthogonal_matrices_are_found() {
        for n in [4, 5, 16, 64] {
            let mut cycle = vec![0.0; n * n];
            (0..n).for_each(|row| cycle[row * n + (row + 1) % n] = 1.0);
            let mut got = eigenvalues(n, &mut cycle).unwrap();
            for k in 0..n {
                let (im, re) = libm::sincos(core::f64::consts::TAU * k as f64 / n as f64);
                let at = got.iter().position(|value| (value - Complex::new(re, im)).norm_sqr() < 1e-26);
                got.swap_remove(at.unwrap_or_else(|| panic!("{got:?}: no {re} {im}")));
            }
        }
    }

    #[test]
    fn sums_of_eigenvalues_are_traces() {
        let mut noise = Noise::new(11, 0);
        for n in [5, 12, 40] {
            let a: Vec<f64> = (0..n * n)
                .map(|k| noise.normal() * libm::exp2((((k / n) * 7) % 20) as f64 - (((k % n) * 7) % 20) as f64))
                .collect();
            let found = eigenvalues(n, &mut a.clone()).unwrap();
            let sum: Complex<f64> = found.iter().sum();
            let squares: Complex<f64> = found.iter().map(|value| value * value).sum();
            let size = found.iter().map(|value| value.norm_sqr()).sum::<f64>();
            let trace: f64 = (0..n).map(|i| a[i * n + i]).sum();
            let trace2: f64 = (0..n * n).map(|k| a[k] * a[(k % n) * n + k / n]).sum();
            assert!((sum - trace).norm_sqr() < 1e-22 * size, "{n}: {sum} {trace}");
            assert!((squares - trace2).norm_sqr() < 1e-22 * size * size, "{n}: {squares} {trace2}");
        }
    }
}
