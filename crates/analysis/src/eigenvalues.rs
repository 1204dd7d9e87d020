//! The eigenvalues of a real matrix of order 4.

use nalgebra::{Complex, Matrix4};

/// Shifts σ: the eigenvalues are those of M + σ less σ.
const SHIFTS: [f64; 4] = [0.0, 0.5, -0.7, 1.3];
/// Deflation tolerance and most iterations of the QR algorithm.
const QR_LIMITS: (f64, usize) = (1e-15, 200);

/// Eigenvalues by the QR algorithm. Its double shift may go round in circles on a matrix that is nearly orthogonal, as
/// the monodromy matrix of a lightly damped system is; so iterations are bounded, and a multiple of the identity is
/// added if needed. NaN if that fails too.
pub(super) fn eigenvalues(matrix: &Matrix4<f64>) -> [Complex<f64>; 4] {
    for shift in SHIFTS {
        let shifted = matrix + Matrix4::identity() * shift;
        if let Some(schur) = shifted.try_schur(QR_LIMITS.0, QR_LIMITS.1) {
            let values: [Complex<f64>; 4] = schur.complex_eigenvalues().into();
            return values.map(|value| value - shift);
        }
    }
    [Complex::new(f64::NAN, f64::NAN); 4]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cyclic permutations are the classical matrices on which the double shift goes round in circles.
    #[test]
    fn eigenvalues_of_orthogonal_matrices_are_found() {
        let cycle = Matrix4::from_fn(|i, j| if i == (j + 1) % 4 { 1.0 } else { 0.0 });
        let mut values = eigenvalues(&cycle);
        values.sort_by(|a, b| (a.re - 0.1 * a.im).total_cmp(&(b.re - 0.1 * b.im)));
        let expected = [(-1.0, 0.0), (0.0, 1.0), (0.0, -1.0), (1.0, 0.0)];
        for (value, (re, im)) in values.iter().zip(expected) {
            assert!((value.re - re).abs() < 1e-14 && (value.im - im).abs() < 1e-14, "{values:?}");
        }
    }
}
