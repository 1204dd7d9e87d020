//! Linear least squares in complex numbers.

use alloc::vec::Vec;

use nalgebra::Complex;

type Column = Vec<Complex<f64>>;

/// Fraction left after projection below which a column depends on those before it.
const DEPENDENT: f64 = 1e-9;

/// Returns the residual of `target`, and the coefficients of the columns: min |target − Σ x_j column_j|².
///
/// Modified Gram–Schmidt, each column twice (Å. Björck, "Solving linear least squares problems by Gram-Schmidt
/// orthogonalization", BIT 7 (1967)): column_j = Σ_i q_i r_ij with orthonormal q_i; the coefficients follow from r
/// backwards. A column that depends on those before it gets the coefficient 0.
pub(super) fn solve(mut columns: Vec<Column>, target: &[Complex<f64>]) -> (Column, Vec<Complex<f64>>) {
    let count = columns.len();
    let zero = Complex::new(0.0, 0.0);
    let mut r = alloc::vec![zero; count * count];
    let mut independent = alloc::vec![true; count];
    for j in 0..count {
        let (before, rest) = columns.split_at_mut(j);
        let Some(column) = rest.first_mut() else { continue };
        let size = norm(column);
        // A second pass removes the components that rounding leaves in the first. Twice is enough, as Björck
        // shows.
        for _twice in 0..2 {
            for (i, q) in before.iter().enumerate().filter(|(i, _)| independent[*i]) {
                let along = dot(q, column);
                r[i * count + j] += along;
                subtract(column, along, q);
            }
        }
        let left = norm(column);
        // Relative to the column's own size, so that the scale of a column does not matter.
        independent[j] = left > DEPENDENT * size;
        r[j * count + j] = Complex::new(left, 0.0);
        if independent[j] {
            column.iter_mut().for_each(|value| *value /= left);
        }
    }
    let mut residual = target.to_vec();
    let mut coefficients = alloc::vec![zero; count];
    for (j, q) in columns.iter().enumerate().filter(|(j, _)| independent[*j]) {
        // Projected from the residual and not from the target, as modified Gram–Schmidt does: rounding then
        // does not add up.
        let along = dot(q, &residual);
        coefficients[j] = along;
        subtract(&mut residual, along, q);
    }
    for j in (0..count).rev().filter(|j| independent[*j]) {
        let later: Complex<f64> =
            (j + 1..count).filter(|k| independent[*k]).map(|k| r[j * count + k] * coefficients[k]).sum();
        coefficients[j] = (coefficients[j] - later) / r[j * count + j].re;
    }
    (residual, coefficients)
}

/// Returns the sum of squares Σ |x|².
pub(super) fn square(values: &[Complex<f64>]) -> f64 {
    values.iter().map(Complex::norm_sqr).sum()
}

fn norm(values: &[Complex<f64>]) -> f64 {
    libm::sqrt(square(values))
}

/// Returns the inner product q* · x.
pub(super) fn dot(q: &[Complex<f64>], x: &[Complex<f64>]) -> Complex<f64> {
    q.iter().zip(x).map(|(q, x)| q.conj() * x).sum()
}

fn subtract(from: &mut [Complex<f64>], factor: Complex<f64>, q: &[Complex<f64>]) {
    from.iter_mut().zip(q).for_each(|(value, q)| *value -= factor * q);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_residual_is_orthogonal_to_every_column_and_dependent_columns_are_left_out() {
        let wave = |a: f64, b: f64| -> Column {
            (0..9).map(|n| Complex::new(libm::cos(a * f64::from(n)), libm::sin(b * f64::from(n)))).collect()
        };
        let twice: Column = wave(1.0, 0.3).iter().map(|value| value * Complex::new(0.0, 2.0)).collect();
        let columns = [wave(1.0, 0.3), twice, wave(0.2, 2.0)].to_vec();
        let target = wave(0.7, 0.9);
        let (residual, x) = solve(columns.clone(), &target);
        for (j, column) in columns.iter().enumerate() {
            assert!(dot(column, &residual).norm_sqr() < 1e-24, "{j}");
        }
        assert_eq!(x[1], Complex::new(0.0, 0.0));
        for (n, left) in residual.iter().enumerate() {
            let sum: Complex<f64> = columns.iter().zip(&x).map(|(column, x)| column[n] * x).sum();
            assert!((target[n] - sum - left).norm_sqr() < 1e-24);
        }
    }
}
