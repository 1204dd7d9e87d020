//! Small systems of linear equations.
//!
//! The bits of recordings depend on the order of the operations here. `analysis::dense` solves large systems and keeps
//! their factors.

use nalgebra::Complex;

/// Solves matrix · x = `right` in place for M right-hand sides, the columns of `right`; the matrix has n =
/// `right.len()` rows of n numbers, one after the other. Gauss's elimination with partial pivoting (G. H. Golub, C. F.
/// Van Loan, "Matrix Computations", 4th edition 2013, section 3.4). `None` if the matrix is singular or not finite.
#[inline(always)]
pub fn solve<const M: usize>(flat: &mut [f64], right: &mut [[f64; M]]) -> Option<()> {
    let n = right.len();
    for column in 0..n {
        let mut pivot = column;
        let mut largest = flat[column * n + column].abs();
        for row in column + 1..n {
            let size = flat[row * n + column].abs();
            if size > largest {
                pivot = row;
                largest = size;
            }
        }
        // One division a column: the rows below are multiplied by the inverse of the pivot. Where the pivot is 0 or
        // NaN the inverse is not finite, which is how a singular matrix is noticed.
        let inverse = 1.0 / flat[pivot * n + column];
        if !inverse.is_finite() {
            return None;
        }
        if pivot != column {
            for k in column..n {
                flat.swap(pivot * n + k, column * n + k);
            }
            right.swap(pivot, column);
        }
        let (above, below) = flat.split_at_mut((column + 1) * n);
        let (sides_above, sides_below) = right.split_at_mut(column + 1);
        for (row, sides) in below.chunks_exact_mut(n).zip(sides_below) {
            let factor = row[column] * inverse;
            subtract(&mut row[column + 1..], factor, &above[column * n + column + 1..]);
            subtract(sides, factor, &sides_above[column]);
        }
    }
    for row in (0..n).rev() {
        let (left, solved) = right.split_at_mut(row + 1);
        let own = &flat[row * n..(row + 1) * n];
        // Each sum adds in the order of the columns whatever M is, so its bits don't depend on M. It starts at −0,
        // since −0 + x is x for every x, −0 included.
        let mut known = [-0.0; M];
        for (factor, sides) in own[row + 1..].iter().zip(solved) {
            known.iter_mut().zip(sides).for_each(|(sum, side)| *sum += factor * *side);
        }
        left[row].iter_mut().zip(known).for_each(|(side, known)| *side = (*side - known) / own[row]);
    }
    Some(())
}

/// Solves matrix · x = `right` of complex numbers in place, as [`solve`]. `None` if the matrix is singular or not
/// finite.
pub fn solve_complex(matrix: &mut [Complex<f64>], right: &mut [Complex<f64>]) -> Option<()> {
    let n = right.len();
    for column in 0..n {
        // The magnitude decides on the pivot; `hypot` does not overflow where re² + im² would.
        let sizes = (column..n).map(|row| libm::hypot(matrix[row * n + column].re, matrix[row * n + column].im));
        let (pivot, largest) =
            sizes.enumerate().fold((0, 0.0), |best, (i, size)| if size > best.1 { (i, size) } else { best });
        // Written so that NaN is refused as well: no comparison with it holds.
        if !(largest > 0.0 && largest.is_finite()) {
            return None;
        }
        (0..n).for_each(|k| matrix.swap((column + pivot) * n + k, column * n + k));
        right.swap(column + pivot, column);
        for row in column + 1..n {
            let factor = matrix[row * n + column] / matrix[column * n + column];
            for k in column..n {
                let above = matrix[column * n + k];
                matrix[row * n + k] -= factor * above;
            }
            let above = right[column];
            right[row] -= factor * above;
        }
    }
    for row in (0..n).rev() {
        let known: Complex<f64> = (row + 1..n).map(|k| matrix[row * n + k] * right[k]).sum();
        right[row] = (right[row] - known) / matrix[row * n + row];
    }
    Some(())
}

/// `values` less `factor` times `others`.
#[inline(always)]
fn subtract(values: &mut [f64], factor: f64, others: &[f64]) {
    values.iter_mut().zip(others).for_each(|(value, other)| *value -= factor * other);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn solutions_solve(
            matrix in prop::array::uniform16(-1.0..1.0),
            right in prop::array::uniform4(prop::array::uniform2(-1.0..1.0)),
        ) {
            let (mut flat, mut x): ([f64; 16], [[f64; 2]; 4]) = (matrix, right);
            if solve(&mut flat, &mut x).is_some() {
                for side in 0..2 {
                    let mut flat = matrix;
                    let mut alone = right.map(|sides| [sides[side]]);
                    prop_assert!(solve(&mut flat, &mut alone).is_some());
                    prop_assert_eq!(x.map(|sides| sides[side].to_bits()), alone.map(|[value]| value.to_bits()));
                }
                let size = x.as_flattened().iter().fold(1.0_f64, |size, value| size.max(value.abs()));
                for (row, side) in (0..4).flat_map(|row| [(row, 0), (row, 1)]) {
                    let sum: f64 = (0..4).map(|k| matrix[4 * row + k] * x[k][side]).sum();
                    prop_assert!((sum - right[row][side]).abs() < 1e-13 * size, "{sum} {}", right[row][side]);
                }
            }
        }
    }

    #[test]
    fn complex_systems_are_solved_or_refused() {
        let i = Complex::new(0.0, 1.0);
        // The first pivot is 0, so that the solution needs an exchange of rows.
        let matrix = [Complex::new(0.0, 0.0), i, Complex::new(2.0, 0.0), Complex::new(1.0, 1.0)];
        let expected = [Complex::new(1.0, -2.0), Complex::new(3.0, 0.5)];
        let mut x = [matrix[1] * expected[1], matrix[2] * expected[0] + matrix[3] * expected[1]];
        assert_eq!(solve_complex(&mut matrix.clone(), &mut x), Some(()));
        assert!(x.iter().zip(expected).all(|(x, expected)| (x - expected).norm_sqr() < 1e-30), "{x:?}");
        assert_eq!(solve_complex(&mut [i, i, i, i], &mut x), None);
        assert_eq!(solve_complex(&mut [i * f64::NAN, i, i, i], &mut x), None);
    }

    #[test]
    fn needs_a_pivot_or_refuses() {
        let mut x = [[2.0], [3.0]];
        assert_eq!(solve(&mut [0.0, 1.0, 1.0, 0.0], &mut x), Some(()));
        assert_eq!(x, [[3.0], [2.0]]);
        assert_eq!(solve(&mut [0.0, 1.0, 0.0, 1.0], &mut x), None);
        assert_eq!(solve(&mut [f64::NAN, 1.0, 0.0, 1.0], &mut x), None);
    }
}
