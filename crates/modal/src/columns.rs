//! Columns of complex numbers over the lines of a spectrum, and sums of their products.
//!
//! A column holds the real parts of all lines and then their imaginary parts, each filled up with zeros to whole lanes. So
//! the sum of products of two columns is Re Σ conj(a) b, the inner product of linear least squares with real coefficients.
//!
//! Almost all the time of a fit is spent here. Sums are formed in tiles of 3 × 4 columns that stay in registers, over blocks
//! of lines that stay in the cache.

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::Complex;
use resonarm_numeric::registers::{Task, four_wide};

/// Numbers that are computed side by side.
pub(crate) const LANES: usize = 4;
/// Numbers of neighbouring lines.
pub(crate) type Lane = [f64; LANES];
/// Lanes of a block: 35 columns of it fill 70 KiB, a part of the second-level cache.
const BLOCK: usize = 64;
/// Lanes of a strip, in which residuals stay in registers.
const STRIP: usize = 4;
/// Columns of a tile.
const ROWS: usize = 3;
const COLUMNS: usize = 4;

/// Returns the values of some lines in lanes, filled up with zeros.
pub(crate) fn lanes(lines: usize, value: impl Fn(usize) -> f64) -> Vec<Lane> {
    let mut lanes = vec![[0.0; LANES]; lines.div_ceil(LANES)];
    (0..lines).for_each(|k| lanes[k / LANES][k % LANES] = value(k));
    lanes
}

/// Several columns of the same number of lines.
#[derive(Clone, Debug, Default)]
pub(crate) struct Columns {
    /// Lanes of a column, those of its real parts and as many of its imaginary parts.
    lanes: usize,
    data: Vec<Lane>,
}

impl Columns {
    /// Returns `count` columns of zeros over `lines` lines.
    pub fn zeros(lines: usize, count: usize) -> Columns {
        let lanes = 2 * lines.div_ceil(LANES);
        Columns { lanes, data: vec![[0.0; LANES]; lanes * count] }
    }

    /// Returns columns of complex numbers.
    pub fn of_values<'a>(lines: usize, columns: impl ExactSizeIterator<Item = &'a [Complex<f64>]>) -> Columns {
        let mut all = Columns::zeros(lines, columns.len());
        columns.enumerate().for_each(|(index, values)| all.set(index, values));
        all
    }

    /// Replaces the numbers of a column.
    pub fn set(&mut self, index: usize, values: &[Complex<f64>]) {
        let [re, im] = self.parts_mut(index);
        for (n, value) in values.iter().enumerate() {
            re[n / LANES][n % LANES] = value.re;
            im[n / LANES][n % LANES] = value.im;
        }
    }

    /// Returns the number of columns.
    pub fn count(&self) -> usize {
        self.data.len().checked_div(self.lanes).unwrap_or(0)
    }

    /// Returns the numbers of a column, in lanes.
    pub fn column(&self, index: usize) -> &[Lane] {
        &self.data[index * self.lanes..(index + 1) * self.lanes]
    }

    /// Returns a column for writing.
    pub fn column_mut(&mut self, index: usize) -> &mut [Lane] {
        &mut self.data[index * self.lanes..(index + 1) * self.lanes]
    }

    /// Returns the real and the imaginary parts of a column.
    pub fn parts(&self, index: usize) -> [&[Lane]; 2] {
        self.column(index).split_at(self.lanes / 2).into()
    }

    /// Returns the real and the imaginary parts of a column for writing.
    pub fn parts_mut(&mut self, index: usize) -> [&mut [Lane]; 2] {
        let half = self.lanes / 2;
        self.column_mut(index).split_at_mut(half).into()
    }

    /// Returns all columns in their order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &[Lane]> {
        self.data.chunks_exact(self.lanes.max(1))
    }

    /// Returns the complex number of a column at a line.
    pub fn value(&self, index: usize, line: usize) -> Complex<f64> {
        let [re, im] = self.parts(index);
        Complex::new(re[line / LANES][line % LANES], im[line / LANES][line % LANES])
    }
}

/// Returns the sums of products of all pairs of columns, a symmetric matrix by rows; with weights, each product is
/// multiplied by the weight of its line. The weights are a column whose real and imaginary parts are alike.
pub(crate) fn gram(columns: &[&[Lane]], weights: Option<&[Lane]>) -> Vec<f64> {
    let count = columns.len();
    let mut sums = vec![0.0; count * count];
    four_wide(Gram { columns, weights, sums: &mut sums });
    for i in 0..count {
        for j in 0..i {
            sums[i * count + j] = sums[j * count + i];
        }
    }
    sums
}

/// Returns the sums of products of all columns on the left with all on the right: row i belongs to left column i.
pub(crate) fn products(left: &[&[Lane]], right: &[&[Lane]]) -> Vec<f64> {
    let mut sums = vec![0.0; left.len() * right.len()];
    four_wide(Products { left, right, sums: &mut sums });
    sums
}

/// A residual and its sums of products.
pub(crate) struct Residual {
    /// target − Σ coefficient · column.
    pub values: Vec<Lane>,
    /// Sum of its squares, weighted.
    pub square: f64,
    /// Sums of its products with all columns, weighted.
    pub products: Vec<f64>,
}

/// Returns what is left of each target after its `coefficients` times the first columns, with its sums of products with all
/// columns. The weights are those of all targets.
pub(crate) fn residuals(
    targets: &[&[Lane]],
    columns: &[&[Lane]],
    coefficients: &[&[f64]],
    weights: Option<&[Lane]>,
) -> Vec<Residual> {
    let found =
        |target: &&[Lane]| Residual { values: target.to_vec(), square: 0.0, products: vec![0.0; columns.len()] };
    let mut found: Vec<Residual> = targets.iter().map(found).collect();
    four_wide(Rest { columns, coefficients, weights, found: &mut found });
    found
}

/// Returns the sum of the squares of a column, weighted.
pub(crate) fn square(column: &[Lane], weights: Option<&[Lane]>) -> f64 {
    let mut squares = [0.0; LANES];
    for (index, value) in column.iter().enumerate() {
        let weight = weights.map_or([1.0; LANES], |weights| weights[index]);
        (0..LANES).for_each(|lane| squares[lane] += value[lane] * value[lane] * weight[lane]);
    }
    total(squares)
}

/// Writes weight · Σ coefficient · column to `target`.
pub(crate) fn combine(columns: &[&[Lane]], coefficients: &[f64], weights: Option<&[Lane]>, target: &mut [Lane]) {
    four_wide(Combine { columns, coefficients, weights, target });
}

/// Adds conj(gain) · column to `target`, line by line; each as real and imaginary parts.
pub(crate) fn add_conjugate_product(target: [&mut [Lane]; 2], gain: [&[Lane]; 2], column: [&[Lane]; 2]) {
    four_wide(ConjugateProduct { target, gain, column });
}

/// [`gram`] as a task; only the upper triangle is filled.
struct Gram<'a> {
    columns: &'a [&'a [Lane]],
    weights: Option<&'a [Lane]>,
    sums: &'a mut [f64],
}

impl Task for Gram<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let count = self.columns.len();
        let lanes = self.columns.first().map_or(0, |column| column.len());
        let mut roots = vec![[0.0; LANES]; if self.weights.is_some() { BLOCK } else { 0 }];
        let mut scaled = vec![[0.0; LANES]; roots.len() * count];
        for start in (0..lanes).step_by(BLOCK) {
            let block = start..(start + BLOCK).min(lanes);
            let length = block.len();
            if let Some(weights) = self.weights {
                // Every column gets the root of the weight, so that each product has the weight itself, and is formed
                // once.
                for (root, weight) in roots.iter_mut().zip(&weights[block.clone()]) {
                    (0..LANES).for_each(|lane| root[lane] = libm::sqrt(weight[lane]));
                }
                for (target, column) in scaled.chunks_exact_mut(BLOCK).zip(self.columns) {
                    for ((target, value), root) in target.iter_mut().zip(&column[block.clone()]).zip(&roots) {
                        (0..LANES).for_each(|lane| target[lane] = value[lane] * root[lane]);
                    }
                }
            }
            let part = |index: usize| {
                // Beyond the last column its sums are computed again, and not used.
                let index = index.min(count - 1);
                if self.weights.is_some() {
                    &scaled[index * BLOCK..index * BLOCK + length]
                } else {
                    &self.columns[index][block.clone()]
                }
            };
            for i in (0..count).step_by(ROWS) {
                for j in (i..count).step_by(COLUMNS) {
                    let tile = tile([0, 1, 2].map(|k| part(i + k)), [0, 1, 2, 3].map(|k| part(j + k)));
                    add_tile(self.sums, [count, count], [i, j], tile);
                }
            }
        }
    }
}

/// [`products`] as a task.
struct Products<'a> {
    left: &'a [&'a [Lane]],
    right: &'a [&'a [Lane]],
    sums: &'a mut [f64],
}

impl Task for Products<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let size = [self.left.len(), self.right.len()];
        let lanes = self.left.first().map_or(0, |column| column.len());
        for start in (0..lanes).step_by(BLOCK) {
            let block = start..(start + BLOCK).min(lanes);
            for i in (0..size[0]).step_by(ROWS) {
                let left = [0, 1, 2].map(|k| &self.left[(i + k).min(size[0] - 1)][block.clone()]);
                for j in (0..size[1]).step_by(COLUMNS) {
                    let right = [0, 1, 2, 3].map(|k| &self.right[(j + k).min(size[1] - 1)][block.clone()]);
                    add_tile(self.sums, size, [i, j], tile(left, right));
                }
            }
        }
    }
}

/// [`residuals`] as a task.
struct Rest<'a> {
    columns: &'a [&'a [Lane]],
    coefficients: &'a [&'a [f64]],
    weights: Option<&'a [Lane]>,
    found: &'a mut [Residual],
}

impl Task for Rest<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Rest { columns, coefficients, weights, found } = self;
        let mut several = found.chunks_exact_mut(ROWS);
        for (found, coefficients) in several.by_ref().zip(coefficients.chunks_exact(ROWS)) {
            let [a, b, c] = found else { continue };
            subtract([a, b, c], columns, [0, 1, 2].map(|k| coefficients[k]), weights);
        }
        let rest = several.into_remainder();
        let first = coefficients.len() - rest.len();
        for (found, coefficients) in rest.iter_mut().zip(&coefficients[first..]) {
            subtract([found], columns, [coefficients], weights);
        }
    }
}

/// Subtracts coefficients times the first columns from some residuals, and adds the sums of squares and products.
#[inline(always)]
fn subtract<const I: usize>(
    found: [&mut Residual; I],
    columns: &[&[Lane]],
    coefficients: [&[f64]; I],
    weights: Option<&[Lane]>,
) {
    let lanes = found[0].values.len();
    let mut weighted = [[[0.0; LANES]; BLOCK]; I];
    let size = [1, columns.len()];
    for start in (0..lanes).step_by(BLOCK) {
        let block = start..(start + BLOCK).min(lanes);
        let length = block.len();
        for from in (0..length).step_by(STRIP) {
            let strip = start + from..start + (from + STRIP).min(length);
            let targets = core::array::from_fn(|i| &found[i].values[strip.clone()]);
            let left = subtract_strip(targets, columns, coefficients, strip.clone());
            for i in 0..I {
                found[i].values[strip.clone()].copy_from_slice(&left[i][..strip.len()]);
                weighted[i][from..from + strip.len()].copy_from_slice(&left[i][..strip.len()]);
            }
        }
        for i in 0..I {
            // The weight goes to one of the two factors alone, since the residual itself is returned without it.
            let weighted = &mut weighted[i][..length];
            if let Some(weights) = weights {
                for (value, weight) in weighted.iter_mut().zip(&weights[block.clone()]) {
                    (0..LANES).for_each(|lane| value[lane] *= weight[lane]);
                }
            }
            let mut squares = [0.0; LANES];
            for (value, weighted) in found[i].values[block.clone()].iter().zip(weighted.iter()) {
                (0..LANES).for_each(|lane| squares[lane] += value[lane] * weighted[lane]);
            }
            found[i].square += total(squares);
        }
        for j in (0..size[1]).step_by(COLUMNS) {
            let right = [0, 1, 2, 3].map(|k| &columns[(j + k).min(size[1] - 1)][block.clone()]);
            let left: [&[Lane]; I] = core::array::from_fn(|i| &weighted[i][..length]);
            for (i, row) in tile(left, right).into_iter().enumerate() {
                add_tile(&mut found[i].products, size, [0, j], [row]);
            }
        }
    }
}

/// Returns targets less coefficients times the first columns over a strip of lanes that stays in registers.
#[inline(always)]
fn subtract_strip<const I: usize>(
    targets: [&[Lane]; I],
    columns: &[&[Lane]],
    coefficients: [&[f64]; I],
    strip: core::ops::Range<usize>,
) -> [[Lane; STRIP]; I] {
    let length = strip.len();
    let mut left = [[[0.0; LANES]; STRIP]; I];
    for i in 0..I {
        left[i][..length].copy_from_slice(targets[i]);
    }
    let count = coefficients[0].len();
    for (index, column) in columns[..count].iter().enumerate() {
        let column = &column[strip.clone()];
        if length == STRIP {
            let column: [Lane; STRIP] = core::array::from_fn(|k| column[k]);
            for i in 0..I {
                for k in 0..STRIP {
                    (0..LANES).for_each(|lane| left[i][k][lane] -= coefficients[i][index] * column[k][lane]);
                }
            }
        } else {
            for i in 0..I {
                for (value, column) in left[i].iter_mut().zip(column) {
                    (0..LANES).for_each(|lane| value[lane] -= coefficients[i][index] * column[lane]);
                }
            }
        }
    }
    left
}

/// [`combine`] as a task.
struct Combine<'a> {
    columns: &'a [&'a [Lane]],
    coefficients: &'a [f64],
    weights: Option<&'a [Lane]>,
    target: &'a mut [Lane],
}

impl Task for Combine<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for start in (0..self.target.len()).step_by(BLOCK) {
            let block = start..(start + BLOCK).min(self.target.len());
            let target = &mut self.target[block.clone()];
            target.fill([0.0; LANES]);
            for (column, coefficient) in self.columns.iter().zip(self.coefficients) {
                for (target, value) in target.iter_mut().zip(&column[block.clone()]) {
                    (0..LANES).for_each(|lane| target[lane] += coefficient * value[lane]);
                }
            }
            if let Some(weights) = self.weights {
                for (target, weight) in target.iter_mut().zip(&weights[block]) {
                    (0..LANES).for_each(|lane| target[lane] *= weight[lane]);
                }
            }
        }
    }
}

/// [`add_conjugate_product`] as a task.
struct ConjugateProduct<'a> {
    target: [&'a mut [Lane]; 2],
    gain: [&'a [Lane]; 2],
    column: [&'a [Lane]; 2],
}

impl Task for ConjugateProduct<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let [re, im] = self.target;
        let gain = self.gain[0].iter().zip(self.gain[1]);
        let column = self.column[0].iter().zip(self.column[1]);
        for (((re, im), (a, b)), (c, d)) in re.iter_mut().zip(im).zip(gain).zip(column) {
            for lane in 0..LANES {
                re[lane] += a[lane] * c[lane] + b[lane] * d[lane];
                im[lane] += a[lane] * d[lane] - b[lane] * c[lane];
            }
        }
    }
}

/// Returns the sums of products of some columns with others.
#[inline(always)]
fn tile<const I: usize>(left: [&[Lane]; I], right: [&[Lane]; COLUMNS]) -> [[f64; COLUMNS]; I] {
    let length = left[0].len();
    let (left, right) = (left.map(|part| &part[..length]), right.map(|part| &part[..length]));
    let mut sums = [[[0.0; LANES]; COLUMNS]; I];
    for k in 0..length {
        for i in 0..I {
            for j in 0..COLUMNS {
                for lane in 0..LANES {
                    sums[i][j][lane] += left[i][k][lane] * right[j][k][lane];
                }
            }
        }
    }
    sums.map(|row| row.map(total))
}

#[inline(always)]
fn total(sums: Lane) -> f64 {
    (sums[0] + sums[2]) + (sums[1] + sums[3])
}

/// Adds a tile to a matrix by rows from row i and column j on; what is beyond the matrix is left out.
#[inline(always)]
fn add_tile<const I: usize>(sums: &mut [f64], size: [usize; 2], [i, j]: [usize; 2], tile: [[f64; COLUMNS]; I]) {
    for (row, values) in (i..size[0]).zip(tile) {
        for (column, value) in (j..size[1]).zip(values) {
            sums[row * size[1] + column] += value;
        }
    }
}

#[cfg(test)]
mod tests {
    use resonarm_numeric::noise::Noise;

    use super::*;

    fn random(lines: usize, count: usize, seed: u64) -> (Columns, Vec<Vec<Complex<f64>>>) {
        let mut noise = Noise::new(seed, 0);
        let mut column = || (0..lines).map(|_| Complex::new(noise.normal(), noise.normal())).collect::<Vec<_>>();
        let values: Vec<Vec<_>> = (0..count).map(|_| column()).collect();
        (Columns::of_values(lines, values.iter().map(Vec::as_slice)), values)
    }

    /// Sums over several blocks and parts of lanes and tiles are the plain ones.
    #[test]
    fn sums_of_products_are_the_plain_ones() {
        for (lines, count) in [(1, 1), (7, 2), (301, 5), (533, 9)] {
            let (columns, values) = random(lines, count, 3);
            let all: Vec<&[Lane]> = columns.iter().collect();
            let weight = |k: usize| 1.0 + (k % 5) as f64;
            let weights: Vec<Complex<f64>> = (0..lines).map(|k| Complex::new(weight(k), weight(k))).collect();
            let weights = Columns::of_values(lines, [weights.as_slice()].into_iter());
            let plain = |i: usize, j: usize, weighted: bool| -> f64 {
                (0..lines)
                    .map(|k| (values[i][k].conj() * values[j][k]).re * if weighted { weight(k) } else { 1.0 })
                    .sum()
            };
            let [sums, weighted] = [None, Some(weights.column(0))].map(|weights| gram(&all, weights));
            let rectangle = products(&all, &all[1..]);
            for i in 0..count {
                for j in 0..count {
                    assert!((sums[i * count + j] - plain(i, j, false)).abs() < 1e-11, "{lines} {i} {j}");
                    assert!((weighted[i * count + j] - plain(i, j, true)).abs() < 1e-11, "{lines} {i} {j}");
                    if j > 0 {
                        assert!((rectangle[i * (count - 1) + j - 1] - plain(i, j, false)).abs() < 1e-11);
                    }
                }
            }
            let coefficients: Vec<f64> = (1..count).map(|k| k as f64).collect();
            // Four targets: three side by side, and one.
            let factors: Vec<Vec<f64>> = (0..4).map(|t| coefficients.iter().map(|c| c + t as f64).collect()).collect();
            let factors: Vec<&[f64]> = factors.iter().map(Vec::as_slice).collect();
            let found = residuals(&[columns.column(0); 4], &all[1..], &factors, Some(weights.column(0)));
            assert_eq!(found.len(), 4);
            for (found, factors) in found.iter().zip(factors) {
                let expected: Vec<Complex<f64>> = (0..lines)
                    .map(|k| values[0][k] - (1..count).map(|j| values[j][k] * factors[j - 1]).sum::<Complex<f64>>())
                    .collect();
                let square: f64 = (0..lines).map(|k| weight(k) * expected[k].norm_sqr()).sum();
                assert!((found.square - square).abs() < 1e-10 * square.max(1.0));
                for (column, product) in values[1..].iter().zip(&found.products) {
                    let sum: f64 = (0..lines).map(|k| weight(k) * (column[k].conj() * expected[k]).re).sum();
                    assert!((product - sum).abs() < 1e-10 * square.max(1.0));
                }
            }
        }
    }
}
