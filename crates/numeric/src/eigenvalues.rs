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
//! split off. The complete Schur form of a matrix library takes several times as long.
//!
//! A large matrix is computed with the widest registers of the processor, and its rows have a margin so that they fill
//! whole lanes.

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::Complex;

use crate::registers::{Task, widest};

/// The most steps for an eigenvalue, and the number after which an exceptional shift is tried.
const STEPS: usize = 40;
const EXCEPTIONAL: usize = 10;
/// A row and its column are scaled if that reduces their sum of magnitudes below this part.
const BALANCED: f64 = 0.95;

/// Numbers whose squares neither overflow nor vanish.
const SQUARES: core::ops::Range<f64> = 1e-100..1e100;

const NAN: Complex<f64> = Complex::new(f64::NAN, f64::NAN);

/// Numbers side by side.
const LANES: usize = 8;
/// From this order on a matrix has a margin.
const LARGE: usize = 16;

/// A square matrix by rows.
struct Matrix<'a> {
    n: usize,
    /// Distance between the starts of two rows.
    stride: usize,
    a: &'a mut [f64],
}

/// I − w uᵀ with u = (1, `u`) on two or three rows and columns from k on.
#[derive(Clone, Copy)]
struct Reflection {
    k: usize,
    three: bool,
    w: [f64; 3],
    u: [f64; 2],
}

/// Returns all eigenvalues of a matrix of n rows, given by rows, which is overwritten; `None` if the algorithm doesn't
/// converge.
pub fn eigenvalues(n: usize, a: &mut [f64]) -> Option<Vec<Complex<f64>>> {
    let mut factors = vec![0.0; n];
    let mut found = vec![NAN; n];
    if n < LARGE {
        return find(a, n, &mut factors, &mut found).then_some(found);
    }
    let stride = n + LANES;
    let mut wide = vec![0.0; n * stride];
    wide.chunks_exact_mut(stride).zip(a.chunks_exact(n)).for_each(|(wide, row)| wide[..n].copy_from_slice(row));
    widest(Find { a: &mut wide, stride, factors: &mut factors, found: &mut found }).then_some(found)
}

/// [`find`] as a task.
struct Find<'a> {
    a: &'a mut [f64],
    stride: usize,
    factors: &'a mut [f64],
    found: &'a mut [Complex<f64>],
}

impl Task for Find<'_> {
    type Output = bool;

    #[inline(always)]
    fn run(self) -> bool {
        find(self.a, self.stride, self.factors, self.found)
    }
}

/// Writes the eigenvalues of `a` to `found`, with storage for the factors of elimination; `false` if the algorithm
/// doesn't converge.
#[inline(always)]
fn find(a: &mut [f64], stride: usize, factors: &mut [f64], found: &mut [Complex<f64>]) -> bool {
    let mut matrix = Matrix { n: found.len(), stride, a };
    matrix.balance();
    matrix.reduce(factors);
    let mut end = matrix.n;
    let mut moved = 0.0;
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
            // What exceptional shifts take off the diagonal is added again to every eigenvalue found from here on.
            moved += matrix.step(start, end, steps % EXCEPTIONAL == 0);
        }
    }
    found.iter().all(|value| value.norm_sqr().is_finite())
}

/// Σ |a|, in four parts.
#[inline(always)]
fn magnitude<'a>(mut of: impl Iterator<Item = &'a f64>) -> f64 {
    let mut sums = [0.0; 4];
    loop {
        for sum in &mut sums {
            match of.next() {
                Some(value) => *sum += value.abs(),
                None => return (sums[0] + sums[1]) + (sums[2] + sums[3]),
            }
        }
    }
}

/// Σ ab, in lanes.
#[inline(always)]
fn product(a: &[f64], b: &[f64]) -> f64 {
    let (a, a_rest) = a.as_chunks::<LANES>();
    let (b, b_rest) = b.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for (a, b) in a.iter().zip(b) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    let [a, b, c, d, e, f, g, h] = sums;
    ((a + e) + (c + g)) + ((b + f) + (d + h)) + rest
}

/// target −= factor · source, in lanes.
#[inline(always)]
fn subtract(target: &mut [f64], source: &[f64], factor: f64) {
    let (a, a_rest) = target.as_chunks_mut::<LANES>();
    let (b, b_rest) = source.as_chunks::<LANES>();
    for (a, b) in a.iter_mut().zip(b) {
        for lane in 0..LANES {
            a[lane] -= factor * b[lane];
        }
    }
    a_rest.iter_mut().zip(b_rest).for_each(|(a, b)| *a -= factor * b);
}

impl Reflection {
    /// Applies the reflection to three numbers of a column, from the left.
    #[inline(always)]
    fn left(&self, a: &mut f64, b: &mut f64, c: &mut f64) {
        let sum = *a + self.u[0] * *b + self.u[1] * *c;
        *a -= sum * self.w[0];
        *b -= sum * self.w[1];
        *c -= sum * self.w[2];
    }

    /// Applies the reflection to three numbers of a row, from the right.
    #[inline(always)]
    fn right(&self, a: &mut f64, b: &mut f64, c: &mut f64) {
        let sum = self.w[0] * *a + self.w[1] * *b + self.w[2] * *c;
        *a -= sum;
        *b -= sum * self.u[0];
        *c -= sum * self.u[1];
    }

    /// Applies the reflection to two numbers of a row.
    #[inline(always)]
    fn right_of_two(&self, a: &mut f64, b: &mut f64) {
        let sum = self.w[0] * *a + self.w[1] * *b;
        *a -= sum;
        *b -= sum * self.u[0];
    }
}

impl Matrix<'_> {
    #[inline(always)]
    fn at(&self, row: usize, column: usize) -> f64 {
        self.a[row * self.stride + column]
    }

    /// Returns a row, and another below it.
    #[inline(always)]
    fn two(&mut self, row: usize, below: usize) -> (&mut [f64], &mut [f64]) {
        let (head, tail) = self.a.split_at_mut(below * self.stride);
        (&mut head[row * self.stride..(row + 1) * self.stride], &mut tail[..self.stride])
    }

    /// Scales rows and columns by powers of two, so that the sums of a row and its column are alike.
    #[inline(always)]
    fn balance(&mut self) {
        let n = self.n;
        let stride = self.stride;
        let mut done = false;
        while !done {
            done = true;
            for i in 0..n {
                let (before, after) = self.a[i * stride..][..n].split_at(i);
                let row = magnitude(before.iter()) + magnitude(after[1..].iter());
                let column = || self.a[i..].iter().step_by(stride);
                let column = magnitude(column().take(i)) + magnitude(column().skip(i + 1));
                let ratio = row / column;
                if !(ratio.is_finite() && ratio > 0.0) {
                    continue;
                }
                // A power of two scales without rounding, so that balancing leaves the eigenvalues as they are.
                let factor = libm::exp2(libm::round(0.5 * libm::log2(ratio)));
                if column * factor + row / factor >= BALANCED * (column + row) {
                    continue;
                }
                done = false;
                self.a[i * stride..(i + 1) * stride].iter_mut().for_each(|value| *value /= factor);
                self.a[i..].iter_mut().step_by(stride).for_each(|value| *value *= factor);
            }
        }
    }

    /// Reduces to Hessenberg form: row i ← row i − yᵢ row m, column m ← column m + Σ yᵢ column i, for each m.
    #[inline(always)]
    fn reduce(&mut self, y: &mut [f64]) {
        let n = self.n;
        for m in 1..n.saturating_sub(1) {
            let to = self.to(m, n);
            let size = |row: usize| self.at(row, m - 1).abs();
            // The largest element as pivot keeps every factor y at 1 or below, so that elimination does not amplify
            // rounding.
            let pivot = (m..n).fold(m, |best, row| if size(row) > size(best) { row } else { best });
            if self.at(pivot, m - 1) == 0.0 {
                continue;
            }
            if pivot != m {
                let (a, b) = self.two(m, pivot);
                a.swap_with_slice(b);
                // A similarity exchanges the columns along with the rows; exchanging rows alone would change the
                // eigenvalues.
                self.a.chunks_exact_mut(self.stride).for_each(|row| row.swap(m, pivot));
            }
            (m + 1..n).for_each(|i| y[i] = self.at(i, m - 1) / self.at(m, m - 1));
            // Row m, which the others need as it is, comes after them.
            for i in (0..n).rev() {
                if i > m {
                    let (above, row) = self.two(m, i);
                    row[m - 1] = 0.0;
                    subtract(&mut row[m..to], &above[m..to], y[i]);
                }
                let row = &mut self.a[i * self.stride..][..n];
                row[m] += product(&row[m + 1..], &y[m + 1..]);
            }
        }
    }

    /// The first row of the last block up to `end`, whose subdiagonal element vanishes.
    #[inline(always)]
    fn split(&mut self, end: usize) -> usize {
        for row in (1..end).rev() {
            let beside = self.at(row - 1, row - 1).abs() + self.at(row, row).abs();
            if self.at(row, row - 1).abs() <= f64::EPSILON * beside {
                self.a[row * self.stride + row - 1] = 0.0;
                return row;
            }
        }
        0
    }

    /// The eigenvalues of the one or two rows from `start` on.
    #[inline(always)]
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
        // The solution of larger magnitude first, and the other from the product of both, so that nothing cancels.
        let far = half + root.copysign(half);
        let other = if far == 0.0 { 0.0 } else { product / far };
        [*first, *second] = [far, -other].map(|re| Complex::new(x + re + moved, 0.0));
    }

    /// A step on the rows from `start` to `end`, at least three; returns what an exceptional shift takes off the
    /// diagonal.
    #[inline(always)]
    fn step(&mut self, start: usize, end: usize, exceptional: bool) -> f64 {
        let n = self.stride;
        let last = end - 1;
        let mut x = self.at(last, last);
        let mut y = self.at(last - 1, last - 1);
        let mut product = self.at(last, last - 1) * self.at(last - 1, last);
        let mut moved = 0.0;
        if exceptional {
            moved = x;
            (0..end).for_each(|i| self.a[i * n + i] -= x);
            let size = self.at(last, last - 1).abs() + self.at(last - 1, last - 2).abs();
            // The exceptional shift of Martin, Peters and Wilkinson.
            x = 0.75 * size;
            y = 0.75 * size;
            product = -0.4375 * size * size;
        }
        // Starts at the last row where two subdiagonal elements in turn are small.
        let mut first = last - 2;
        let column = loop {
            let z = self.at(first, first);
            let below = self.at(first + 1, first);
            let r = x - z;
            let s = y - z;
            let next = self.at(first + 1, first + 1);
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
    #[inline(always)]
    fn chase(&mut self, start: usize, end: usize, first: usize, mut column: [f64; 3]) {
        let n = self.stride;
        let last = end - 1;
        for row in first + 2..end {
            self.a[row * n + row - 2] = 0.0;
            if row > first + 2 {
                self.a[row * n + row - 3] = 0.0;
            }
        }
        for k in first..last {
            let three = k + 1 < last;
            let mut scale = 1.0;
            if k > first {
                column = [self.at(k, k - 1), self.at(k + 1, k - 1), if three { self.at(k + 2, k - 1) } else { 0.0 }];
                let sum: f64 = column.iter().map(|value| value.abs()).sum();
                if sum == 0.0 {
                    continue;
                }
                if !SQUARES.contains(&sum) {
                    scale = sum;
                    column = column.map(|value| value / scale);
                }
            }
            let [p, q, r] = column;
            // With the sign of p the sum p + size below has no cancellation.
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
            // Two reciprocals in place of five divisions, which take several times as long as products.
            let [by_size, by_p] = [size, p].map(f64::recip);
            let w = [p * by_size, q * by_size, r * by_size];
            let u = [q * by_p, r * by_p];
            self.reflect([start, end], Reflection { k, three, w, u });
        }
    }

    /// Returns the end to which rows that are needed from k to `end` are extended: whole lanes if there is room, since
    /// what is beyond `end` no longer counts.
    #[inline(always)]
    fn to(&self, k: usize, end: usize) -> usize {
        let whole = k + (end - k).next_multiple_of(LANES);
        if whole <= self.stride { whole } else { end }
    }

    /// Rows and columns of the part from `start` to `end`.
    #[inline(always)]
    fn reflect(&mut self, [start, end]: [usize; 2], by: Reflection) {
        let n = self.stride;
        let k = by.k;
        self.reflect_rows(self.to(k, end), &by);
        let rows = &mut self.a[start * n..(k + 4).min(end) * n];
        for row in rows.chunks_exact_mut(n) {
            match &mut row[k..] {
                [a, b, c, ..] if by.three => by.right(a, b, c),
                [a, b, ..] => by.right_of_two(a, b),
                _ => {}
            }
        }
    }

    /// Two or three rows up to a column.
    #[inline(always)]
    fn reflect_rows(&mut self, to: usize, by: &Reflection) {
        let n = self.stride;
        let k = by.k;
        let (head, tail) = self.a[k * n..].split_at_mut(n);
        let (middle, tail) = tail.split_at_mut(n);
        let a = &mut head[k..to];
        let b = &mut middle[k..to];
        if !by.three {
            for (a, b) in a.iter_mut().zip(b) {
                let sum = *a + by.u[0] * *b;
                *a -= sum * by.w[0];
                *b -= sum * by.w[1];
            }
            return;
        }
        let (a, a_rest) = a.as_chunks_mut::<LANES>();
        let (b, b_rest) = b.as_chunks_mut::<LANES>();
        let (c, c_rest) = tail[k..to].as_chunks_mut::<LANES>();
        for ((a, b), c) in a.iter_mut().zip(b).zip(c) {
            let [mut x, mut y, mut z] = [*a, *b, *c];
            for lane in 0..LANES {
                by.left(&mut x[lane], &mut y[lane], &mut z[lane]);
            }
            *a = x;
            *b = y;
            *c = z;
        }
        a_rest.iter_mut().zip(b_rest).zip(c_rest).for_each(|((a, b), c)| by.left(a, b, c));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Noise;

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

    /// Near the limits of the range of numbers, where squares would leave it, too.
    #[test]
    fn eigenvalues_scale_with_the_matrix() {
        let mut noise = Noise::new(12, 0);
        let a: Vec<f64> = (0..20 * 20).map(|_| noise.normal()).collect();
        let plain = eigenvalues(20, &mut a.clone()).unwrap();
        for scale in [libm::exp2(-500.0), libm::exp2(500.0)] {
            let mut got = eigenvalues(20, &mut a.iter().map(|value| value * scale).collect::<Vec<_>>()).unwrap();
            for expected in &plain {
                let at = got.iter().position(|value| (value / scale - expected).norm_sqr() < 1e-20);
                got.swap_remove(at.unwrap_or_else(|| panic!("{scale}: no {expected}")));
            }
        }
    }
}
