//! Natural modes of a structure at rest.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::Complex;

use super::linear::Linear;
use super::modal::Rates;
use resonarm_numeric::linear_solve::solve_complex;

/// Sweeps of Jacobi's rotations: each squares what is left off the diagonal, and matrices of 32 rows need about eight.
const MOST_SWEEPS: usize = 50;
/// Eigenvalues below this part of the largest, times n, are rounding.
const ROUNDING: f64 = 16.0 * f64::EPSILON;
/// Iterations for an eigenvalue of the damped structure, which converge cubically.
const MOST_ITERATIONS: usize = 30;

/// A natural mode of a structure at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct StructureMode {
    /// Undamped natural frequency ω/(2π) with K φ = ω² M φ, Hz.
    pub frequency_hz: f64,
    /// Damping ratio −Re λ/|λ| of the damped structure's eigenvalue λ that belongs to the mode, dimensionless. It is
    /// φᵀDφ/(2ω) where the damping is modal, and where that is 1 or more. Of a mode at 0 Hz it is 0, or infinite with
    /// damping.
    pub damping_ratio: f64,
    /// φ in the structure's coordinates, of unit modal mass, φᵀMφ = 1; its largest entry is positive.
    pub shape: Vec<f64>,
}

impl StructureMode {
    /// The fastest rate of its free motion, 1/s: ω, or with ζ > 1 that of the faster decay. Of damping on a rigid mode,
    /// whose ratio is infinite, it says nothing.
    pub(super) fn fastest_rad_s(&self) -> f64 {
        let omega = TAU * self.frequency_hz;
        let is_overdamped = self.damping_ratio.is_finite() && self.damping_ratio > 1.0;
        if is_overdamped { Rates::new(omega, self.damping_ratio).fast() } else { omega }
    }
}

/// The modes of a linear structure that is held, by frequency. `None` if M or K is not positive definite, or not finite.
///
/// With K = L Lᵀ and y = Lᵀφ the eigenproblem is S y = λ y for S = L⁻¹ M L⁻ᵀ and λ = 1/ω²; S becomes diagonal by cyclic
/// rotations (C. G. J. Jacobi, 1846; G. H. Golub, C. F. Van Loan, "Matrix Computations", 4th edition 2013, section
/// 8.5). From yᵀy = 1 follows φᵀMφ = 1 for φ = ω L⁻ᵀy.
pub(super) fn modes(of: &Linear) -> Option<Vec<StructureMode>> {
    let n = of.coordinates;
    let (factor, mut s) = reduced(n, &of.stiffness, &of.mass)?;
    let mut vectors = diagonalise(n, &mut s)?;
    let mut modes = Vec::with_capacity(n);
    for (i, y) in vectors.chunks_exact_mut(n).enumerate() {
        let omega = 1.0 / libm::sqrt(s[i * n + i]);
        modes.push(undamped_mode(n, omega, omega, &factor, y)?);
    }
    Some(with_damping(of, modes))
}

/// The modes of a linear structure that may be free, by frequency: K is positive semidefinite. `None` if M is not
/// positive definite, K has a negative eigenvalue, or either is not finite.
///
/// With M = L Lᵀ and y = Lᵀφ the eigenproblem is S y = ω² y for S = L⁻¹ K L⁻ᵀ, and yᵀy = 1 is φᵀMφ = 1. Eigenvalues are
/// exact to rounding of the largest, below which those of rigid modes are 0; where S is diagonal there is no rounding.
pub(super) fn free_modes(of: &Linear) -> Option<Vec<StructureMode>> {
    let n = of.coordinates;
    let (factor, mut s) = reduced(n, &of.mass, &of.stiffness)?;
    let is_diagonal = (0..n * n).all(|k| k / n == k % n || s[k] == 0.0);
    let mut vectors = diagonalise(n, &mut s)?;
    let largest = (0..n).map(|i| s[i * n + i].abs()).fold(0.0, f64::max);
    let rounding = if is_diagonal { 0.0 } else { ROUNDING * n as f64 * largest };
    let mut modes = Vec::with_capacity(n);
    for (i, y) in vectors.chunks_exact_mut(n).enumerate() {
        let square = s[i * n + i];
        if !(square.is_finite() && square >= -rounding) {
            return None;
        }
        // A rigid mode is exactly at 0 Hz: one at a rounding error above would be a mode of some microhertz.
        let omega = if square <= rounding { 0.0 } else { libm::sqrt(square) };
        modes.push(undamped_mode(n, omega, 1.0, &factor, y)?);
    }
    Some(with_damping(of, modes))
}

/// L of A = L Lᵀ, and S = L⁻¹ B L⁻ᵀ, for symmetric A and B. `None` if A is not positive definite.
fn reduced(n: usize, a: &[f64], b: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
    let mut factor = a.to_vec();
    let mut s = b.to_vec();
    cholesky(n, &mut factor)?;
    // L⁻¹ B, by columns since B is symmetric, then (L⁻¹ B) L⁻ᵀ by rows.
    for row in s.chunks_exact_mut(n) {
        solve_lower(n, &factor, row);
    }
    let mut s: Vec<f64> = (0..n * n).map(|k| s[k % n * n + k / n]).collect();
    for row in s.chunks_exact_mut(n) {
        solve_lower(n, &factor, row);
    }
    Some((factor, s))
}

/// The mode with the shape φ = `scale` L⁻ᵀy, whose largest entry becomes positive. `None` if it is not finite.
fn undamped_mode(n: usize, omega: f64, scale: f64, factor: &[f64], y: &mut [f64]) -> Option<StructureMode> {
    solve_upper(n, factor, y);
    let largest = y.iter().fold(0.0_f64, |largest, &y| if y.abs() > largest.abs() { y } else { largest });
    let scale = scale * largest.signum();
    let shape: Vec<f64> = y.iter().map(|y| scale * y).collect();
    let is_finite = omega.is_finite() && shape.iter().all(|entry| entry.is_finite());
    is_finite.then_some(StructureMode { frequency_hz: omega / TAU, damping_ratio: 0.0, shape })
}

/// Makes a symmetric matrix diagonal; the eigenvectors are the rows of the result.
///
/// A rotation by the angle of tangent t in the plane of p and q removes s_pq: t = sign(θ)/(|θ| + √(1 + θ²)) with θ =
/// (s_qq − s_pp)/(2 s_pq), c = 1/√(1 + t²), s = t c.
fn diagonalise(n: usize, s: &mut [f64]) -> Option<Vec<f64>> {
    let mut vectors = vec![0.0; n * n];
    (0..n).for_each(|i| vectors[i * n + i] = 1.0);
    for _ in 0..MOST_SWEEPS {
        let mut turned = false;
        for p in 0..n {
            for q in p + 1..n {
                let off = s[p * n + q];
                if !off.is_finite() {
                    return None;
                }
                // Relative to both diagonals, so that small eigenvalues keep their digits.
                if off.abs() <= f64::EPSILON * 0.125 * libm::sqrt(s[p * n + p].abs() * s[q * n + q].abs()) {
                    continue;
                }
                turned = true;
                let theta = (s[q * n + q] - s[p * n + p]) / (2.0 * off);
                // The smaller root, a turn of at most 45°, with which the sweeps converge (Golub and Van Loan,
                // section 8.5).
                let t = libm::copysign(1.0 / (theta.abs() + libm::sqrt(1.0 + theta * theta)), theta);
                rotate(n, s, &mut vectors, [p, q], t);
            }
        }
        if !turned {
            return Some(vectors);
        }
    }
    None
}

fn rotate(n: usize, s: &mut [f64], vectors: &mut [f64], [p, q]: [usize; 2], t: f64) {
    let cosine = 1.0 / libm::sqrt(1.0 + t * t);
    let sine = t * cosine;
    let turn = |values: &mut [f64], a: usize, b: usize| {
        let x = values[a];
        let y = values[b];
        values[a] = cosine * x - sine * y;
        values[b] = sine * x + cosine * y;
    };
    for k in 0..n {
        // Rows here and columns below make JᵀSJ. The eigenvectors are rows, so they turn with the rows alone.
        turn(s, p * n + k, q * n + k);
        turn(vectors, p * n + k, q * n + k);
    }
    for k in 0..n {
        turn(s, k * n + p, k * n + q);
    }
    // Zero but for rounding, and the test for convergence looks at it.
    s[p * n + q] = 0.0;
    s[q * n + p] = 0.0;
}

/// Sorts undamped modes by frequency and adds the damping ratios. In modal coordinates the damped eigenproblem is (λ² + λ C +
/// Ω²) u = 0 with C = ΦᵀDΦ.
fn with_damping(of: &Linear, mut modes: Vec<StructureMode>) -> Vec<StructureMode> {
    modes.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    let n = modes.len();
    let along = |mode: &StructureMode, k: usize| -> f64 {
        of.damping[k * n..(k + 1) * n].iter().zip(&mode.shape).map(|(entry, shape)| entry * shape).sum()
    };
    // D φ of each mode, and C.
    let forces: Vec<f64> = modes.iter().flat_map(|mode| (0..n).map(move |k| along(mode, k))).collect();
    let mut damping = vec![0.0; n * n];
    for (i, mode) in modes.iter().enumerate() {
        for (j, force) in forces.chunks_exact(n).enumerate() {
            damping[i * n + j] = mode.shape.iter().zip(force).map(|(shape, force)| shape * force).sum();
        }
    }
    let omega: Vec<f64> = modes.iter().map(|mode| TAU * mode.frequency_hz).collect();
    for (k, mode) in modes.iter_mut().enumerate() {
        let own = damping[k * n + k];
        // A rigid mode without damping has the ratio 0, where the quotient would be 0/0.
        let modal = if own == 0.0 { 0.0 } else { own / (2.0 * omega[k]) };
        // Where the damping couples no modes, the ratio of the mode alone is exact.
        let is_coupled = (0..n).any(|j| j != k && (damping[k * n + j] != 0.0 || damping[j * n + k] != 0.0));
        let rayleigh = if modal < 1.0 && is_coupled { damped_ratio(&omega, &damping, k) } else { None };
        mode.damping_ratio = rayleigh.unwrap_or(modal);
    }
    modes
}

/// −Re λ/|λ| of the eigenvalue that belongs to mode k, by Rayleigh's functional from the mode on (J. W. Strutt, Lord
/// Rayleigh; for symmetric quadratic problems P. Lancaster, "Lambda-matrices and Vibrating Systems", 1966): u solves
/// (λ² + λ C + Ω²) u⁺ = u, and λ uᵀu λ + λ uᵀCu + uᵀΩ²u = 0. `None` if it doesn't converge, or leaves the mode.
fn damped_ratio(omega: &[f64], damping: &[f64], k: usize) -> Option<f64> {
    let n = omega.len();
    let mut u = vec![Complex::new(0.0, 0.0); n];
    // Without damping the mode is its own eigenvector, with the eigenvalue iω.
    u[k] = Complex::new(1.0, 0.0);
    let mut lambda = Complex::new(0.0, omega[k]);
    for _ in 0..MOST_ITERATIONS {
        let [mut mass, mut damper, mut stiffness] = [Complex::new(0.0, 0.0); 3];
        for i in 0..n {
            mass += u[i] * u[i];
            stiffness += u[i] * u[i] * (omega[i] * omega[i]);
            (0..n).for_each(|j| damper += u[i] * u[j] * damping[i * n + j]);
        }
        // λ² · mass + λ · damper + stiffness = 0, the quadratic equation of a single oscillator.
        let root = square_root(damper * damper - mass * stiffness * 4.0);
        let roots = [(-damper + root) / (mass * 2.0), (-damper - root) / (mass * 2.0)];
        // Of a conjugate pair the eigenvalue above the real axis.
        let next = if roots[0].im >= roots[1].im { roots[0] } else { roots[1] };
        let change = size(next - lambda);
        lambda = next;
        if !change.is_finite() || lambda.im <= 0.0 {
            return None;
        }
        if change <= 4.0 * f64::EPSILON * size(lambda) {
            return Some(-lambda.re / size(lambda));
        }
        let mut matrix: Vec<Complex<f64>> = damping.iter().map(|&entry| lambda * entry).collect();
        (0..n).for_each(|i| matrix[i * n + i] += lambda * lambda + omega[i] * omega[i]);
        // Exactly singular at an exact eigenvalue, which then is found.
        if solve_complex(&mut matrix, &mut u).is_none() {
            return Some(-lambda.re / size(lambda));
        }
        // Only the direction counts; near the eigenvalue the length grows without bound.
        let largest = u.iter().map(|entry| size(*entry)).fold(0.0, f64::max);
        u.iter_mut().for_each(|entry| *entry /= Complex::new(largest, 0.0));
        // Another mode has taken over, and its eigenvalue would be found.
        if size(u[k]) < 0.5 {
            return None;
        }
    }
    None
}

fn size(z: Complex<f64>) -> f64 {
    libm::hypot(z.re, z.im)
}

fn square_root(z: Complex<f64>) -> Complex<f64> {
    let length = size(z);
    // √z = √((|z| + Re z)/2) ± i √((|z| − Re z)/2), with the sign of Im z. Rounding may leave |z| below |Re z|, hence
    // the limit at zero.
    let re = libm::sqrt(0.5 * (length + z.re).max(0.0));
    let im = libm::sqrt(0.5 * (length - z.re).max(0.0));
    Complex::new(re, libm::copysign(im, z.im))
}

/// A = L Lᵀ in place, L in the lower triangle. `None` if A is not positive definite.
pub(super) fn cholesky(n: usize, a: &mut [f64]) -> Option<()> {
    for i in 0..n {
        for j in 0..=i {
            // Of the sum Σ l_ik l_jk = a_ij all but the last term is known. A pivot that is not positive means that A
            // is not positive definite.
            let known: f64 = (0..j).map(|k| a[i * n + k] * a[j * n + k]).sum();
            let rest = a[i * n + j] - known;
            if i > j {
                a[i * n + j] = rest / a[j * n + j];
            } else if rest > 0.0 && rest.is_finite() {
                a[i * n + i] = libm::sqrt(rest);
            } else {
                return None;
            }
        }
    }
    Some(())
}

/// L Lᵀ x = b in place.
pub(super) fn solve_cholesky(n: usize, factor: &[f64], b: &mut [f64]) {
    solve_lower(n, factor, b);
    solve_upper(n, factor, b);
}

/// L x = b in place.
fn solve_lower(n: usize, factor: &[f64], b: &mut [f64]) {
    for i in 0..n {
        let known: f64 = (0..i).map(|k| factor[i * n + k] * b[k]).sum();
        b[i] = (b[i] - known) / factor[i * n + i];
    }
}

/// Lᵀ x = b in place.
fn solve_upper(n: usize, factor: &[f64], b: &mut [f64]) {
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|k| factor[k * n + i] * b[k]).sum();
        b[i] = (b[i] - known) / factor[i * n + i];
    }
}
