//! Small systems of linear equations.

use core::array;

/// Solves matrix · x = `right` in place for M right-hand sides, the columns of `right`; the matrix has n = `right.len()` rows of
/// n numbers, one after the other. Gauss's elimination with partial pivoting (G. H. Golub, C. F. Van Loan, "Matrix
/// Computations", section 3.4). `None` if the matrix is singular or not finite.
#[inline(always)]
pub(crate) fn solve<const M: usize>(flat: &mut [f64], right: &mut [[f64; M]]) -> Option<()> {
    let n = right.len();
    for column in 0..n {
        let size = |row: usize| libm::fabs(flat[row * n + column]);
        let pivot = (column + 1..n).fold(column, |best, row| if size(row) > size(best) { row } else { best });
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
        for row in column + 1..n {
            let factor = flat[row * n + column] * inverse;
            for k in column + 1..n {
                flat[row * n + k] -= factor * flat[column * n + k];
            }
            let above = right[column];
            for (value, above) in right[row].iter_mut().zip(above) {
                *value -= factor * above;
            }
        }
    }
    for row in (0..n).rev() {
        right[row] = array::from_fn(|side| {
            let known: f64 = (row + 1..n).map(|k| flat[row * n + k] * right[k][side]).sum();
            (right[row][side] - known) / flat[row * n + row]
        });
    }
    Some(())
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
                let size = x.as_flattened().iter().fold(1.0_f64, |size, value| size.max(value.abs()));
                for (row, side) in (0..4).flat_map(|row| [(row, 0), (row, 1)]) {
                    let sum: f64 = (0..4).map(|k| matrix[4 * row + k] * x[k][side]).sum();
                    prop_assert!((sum - right[row][side]).abs() < 1e-13 * size, "{sum} {}", right[row][side]);
                }
            }
        }
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
