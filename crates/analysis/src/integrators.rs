//! Errors of the integration schemes: numerical damping, frequency error, drift of energy.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::Complex;
use serde::Serialize;

use resonarm_dynamics::integrate::Scheme;
use resonarm_dynamics::structure::{Assembly, StepError, Stepper, StructureMode};

/// The error of a scheme in one natural mode.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ModeError {
    /// The mode's natural frequency, Hz.
    pub frequency_hz: f64,
    /// Damping ratio that the scheme adds, dimensionless; negative if it makes energy.
    pub damping_ratio: f64,
    /// Frequency seen over the true one, less 1.
    pub frequency_error: f64,
}

/// The change of energy of a structure without damping and load, ideally zero.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct EnergyDrift {
    /// Number of integration steps that were made.
    pub steps: u32,
    /// The mean of the last tenth minus that of the first.
    pub change: f64,
    /// Largest less smallest energy seen, over the energy at the start.
    pub spread: f64,
    /// Mean energy over each tenth of the steps, over the energy at the start, less 1.
    pub tenths: [f64; 10],
}

/// Steps over which [`mode_errors`] measures.
const MODE_STEPS: u32 = 1000;
/// Largest deflection in [`mode_errors`], rad: so small that a chain's nonlinearity, of the order of it, is below
/// rounding.
const MODE_AMPLITUDE_RAD: f64 = 1e-13;

/// The scheme's damping ratio and relative frequency error in each mode of a smooth chain without damping, at `rate_hz`
/// steps a second, measured from the motion in time. Modal structures, and elements that switch, are stepped by other
/// methods, whatever the scheme.
///
/// The chain starts on a mode φ with an amplitude at which it is linear. Its modal coordinate η = φᵀM0 α follows η̈ =
/// −ω²η, so that Z = ωη − iη̇ turns as Z₀ e^{iωt}. A Runge–Kutta method gives Zₙ₊₁ = R(iωh) Zₙ with its stability
/// function R (E. Hairer, G. Wanner, "Solving Ordinary Differential Equations II", 1996, section IV.3), and the
/// exponential scheme e^{iωh} Zₙ. As the motion of an oscillator with damping ratio ζ and frequency (1 + e) ω, to first
/// order in ζ,
///
/// ```text
/// ln(Zₙ/Z₀) = (i (1 + e) − ζ) n ωh        ζ = −Re ln(Zₙ/Z₀) / (n ωh)        e = Im ln(Zₙ/Z₀) / (n ωh) − 1
/// ```
///
/// The logarithm is summed step by step, ln(Zₙ₊₁/Zₙ e^{−iωh}), so no turn is lost and e comes without cancellation. The
/// remaining rounding error is about 1e-15.
///
/// # Errors
/// [`StepError`] if the scheme can't carry the chain at this rate.
pub fn mode_errors(chain: &Assembly, scheme: Scheme, rate_hz: f64) -> Result<Vec<ModeError>, StepError> {
    let mut stepper = Stepper::new(chain, &[], scheme, rate_hz)?;
    chain.modes().iter().map(|mode| mode_error(chain, &mut stepper, mode)).collect()
}

fn mode_error(chain: &Assembly, stepper: &mut Stepper, mode: &StructureMode) -> Result<ModeError, StepError> {
    let n = chain.coordinates();
    let mass = chain.linear().mass;
    let product = |column: usize| (0..n).map(|row| mode.shape[row] * mass[row * n + column]).sum::<f64>();
    let row: Vec<f64> = (0..n).map(product).collect();
    let along = |values: &[f64]| row.iter().zip(values).map(|(weight, value)| weight * value).sum::<f64>();
    let omega = TAU * mode.frequency_hz;
    let phasor = |stepper: &Stepper| Complex::new(omega * along(stepper.position()), -along(stepper.velocity()));
    let (sine, cosine) = libm::sincos(omega * stepper.step_s());
    let one_step_back = Complex::new(cosine, -sine);
    let largest = mode.shape.iter().fold(0.0_f64, |largest, part| largest.max(part.abs()));
    let mut start = vec![0.0; stepper.states()];
    start.iter_mut().zip(&mode.shape).for_each(|(q, part)| *q = part * (MODE_AMPLITUDE_RAD / largest));
    stepper.restore(&start)?;
    let mut phasor_before = phasor(stepper);
    let mut log_amplitude = 0.0;
    let mut phase_rad = 0.0;
    for k in 0..MODE_STEPS {
        stepper.advance(f64::from(k) * stepper.step_s(), &[])?;
        let phasor_after = phasor(stepper);
        // Near 1, or exactly 1 for a perfect scheme.
        let turn = phasor_after / phasor_before * one_step_back;
        log_amplitude += 0.5 * libm::log1p(turn.re * turn.re + turn.im * turn.im - 1.0);
        phase_rad += libm::atan2(turn.im, turn.re);
        phasor_before = phasor_after;
    }
    let exact_phase_rad = omega * stepper.step_s() * f64::from(MODE_STEPS);
    Ok(ModeError {
        frequency_hz: mode.frequency_hz,
        damping_ratio: -log_amplitude / exact_phase_rad,
        frequency_error: phase_rad / exact_phase_rad,
    })
}

/// The drift of energy over `steps` steps (at least 10) of free vibration of a smooth chain without damping, from
/// `start`, its coordinates and their rates.
///
/// Free vibration without damping is reversible. A symmetric scheme with a fixed step keeps that, and with it, as long
/// as the motion is quasi-periodic, invariants that differ from the true ones by O(hᵖ) (E. Hairer, C. Lubich, G.
/// Wanner, "Geometric Numerical Integration", 2006, chapter XI): the energy oscillates without drift. `spread` shows
/// the oscillation, `change` the drift. No scheme here is symplectic: in (α, α̇) the momenta Mα̇ are not among the
/// variables; so for chaotic motion nothing is guaranteed. The mean over a tenth is weighted by s³(1−s)³, s from 0 to 1
/// over the tenth: the mean of a quasi-periodic oscillation over n of its periods then falls as n⁻⁴, not as n⁻¹ (S.
/// Das, Y. Saiki, E. Sander, J. A. Yorke, "Quantitative quasiperiodicity", Nonlinearity 30 (2017)).
///
/// # Errors
/// [`StepError`] if the scheme can't carry the chain at this rate or can't make a step, or `start` is no state of it.
pub fn energy_drift(
    chain: &Assembly,
    scheme: Scheme,
    rate_hz: f64,
    start: &[f64],
    steps: u32,
) -> Result<EnergyDrift, StepError> {
    let mut stepper = Stepper::new(chain, &[], scheme, rate_hz)?;
    stepper.restore(start)?;
    let energy_j = |stepper: &Stepper| {
        let elements_j = chain.element_energy_j(stepper.position(), stepper.element_states());
        chain.energy_j(stepper.position(), stepper.velocity()) + elements_j
    };
    let first_j = energy_j(&stepper);
    let mut tenths = [0.0; 10];
    let mut smallest = 0.0_f64;
    let mut largest = 0.0_f64;
    let mut done = 0;
    for (tenth, mean) in (1_u64..).zip(&mut tenths) {
        let end = (u64::from(steps) * tenth / 10) as u32;
        let mut sum = 0.0;
        let mut weights = 0.0;
        for k in done..end {
            stepper.advance(f64::from(k) * stepper.step_s(), &[])?;
            // Relative to the start before summing, so that the sum keeps its digits.
            let relative = (energy_j(&stepper) - first_j) / first_j;
            smallest = smallest.min(relative);
            largest = largest.max(relative);
            let s = (f64::from(k - done) + 0.5) / f64::from(end - done);
            let weight = libm::pow(s * (1.0 - s), 3.0);
            sum += weight * relative;
            weights += weight;
        }
        *mean = sum / weights;
        done = end;
    }
    Ok(EnergyDrift { steps, change: tenths[9] - tenths[0], spread: largest - smallest, tenths })
}

#[cfg(test)]
mod tests {
    use nalgebra::ComplexField as _;

    use super::*;
    use crate::tests::assembly_of;
    use resonarm_dynamics::structure::Preset;

    /// The arm as a chain, without its dampers.
    fn undamped(preset: Preset, beta1_deg: f64, beta2_deg: f64) -> Assembly {
        let mut chain = preset.chain().unwrap().at_angles_deg(&[beta1_deg, beta2_deg]);
        chain.links.iter_mut().for_each(|link| link.damping_nm_s_rad = 0.0);
        assembly_of(chain)
    }

    /// The prediction of linear theory for each scheme, to the leading term: ζ and the frequency error as powers of z =
    /// ωh.
    fn theory(scheme: Scheme, z: f64) -> (f64, f64) {
        match scheme {
            Scheme::Rk4 => (libm::pow(z, 5.0) / 144.0, -libm::pow(z, 4.0) / 120.0),
            Scheme::Dop853 => (2.26e-8 * libm::pow(z, 9.0), -6.4e-8 * libm::pow(z, 8.0)),
            Scheme::Gl4 => (0.0, -libm::pow(z, 4.0) / 720.0),
            Scheme::Gl6 => (0.0, -libm::pow(z, 6.0) / 100_800.0),
            Scheme::Exponential | Scheme::Exponential8 => (0.0, 0.0),
        }
    }

    #[test]
    fn errors_are_those_of_theory() {
        let chain = undamped(Preset::Irb1600Fitted, 0.0, 60.0);
        for scheme in Scheme::ALL {
            for error in mode_errors(&chain, scheme, 1000.0).unwrap() {
                let z = TAU * error.frequency_hz / 1000.0;
                let (damping, frequency) = theory(scheme, z);
                let near = |got: f64, expected: f64| (got - expected).abs() < 0.06 * expected.abs() + 1e-12;
                assert!(near(error.damping_ratio, damping), "{scheme} {z}: {error:?}, {damping:e}");
                assert!(near(error.frequency_error, frequency), "{scheme} {z}: {error:?}, {frequency:e}");
            }
        }
    }

    /// Where z = ωh is near 1, to all digits: the arguments of the stability functions, Padé approximants of e^{iz}.
    /// For gl4 this is a step in two parts.
    #[test]
    fn errors_are_those_of_the_functions_of_stability() {
        let chain = undamped(Preset::Irb1600Table1, 0.0, 0.0);
        let rate_hz = 4000.0;
        for scheme in [Scheme::Rk4, Scheme::Gl4, Scheme::Gl6] {
            let error = mode_errors(&chain, scheme, rate_hz).unwrap()[1];
            let parts = if scheme == Scheme::Gl4 { 2.0 } else { 1.0 };
            let z = TAU * error.frequency_hz / (rate_hz * parts);
            let z2 = z * z;
            let (re, im) = match scheme {
                Scheme::Rk4 => (1.0 - z2 / 2.0 + z2 * z2 / 24.0, z - z * z2 / 6.0),
                Scheme::Gl4 => (1.0 - z2 / 12.0, z / 2.0),
                _ => (1.0 - z2 / 10.0, z / 2.0 - z * z2 / 120.0),
            };
            // R of a symmetric method is P(z)/P(−z), of modulus 1 and twice the argument of P.
            let log = Complex::new(re, im).ln();
            let log = if scheme.is_symmetric() { Complex::new(0.0, 2.0 * log.im) } else { log };
            assert!((error.damping_ratio + log.re / z).abs() < 1e-12, "{scheme}: {error:?} {log}");
            assert!((error.frequency_error - (log.im / z - 1.0)).abs() < 1e-12, "{scheme}: {error:?} {log}");
        }
    }

    /// At 1 kHz already, the 569 Hz of the straight arm of Table 1 included, where the mode turns by 3.6 rad a step.
    #[test]
    fn exponential_scheme_adds_nothing_at_any_pose() {
        for preset in Preset::ALL {
            for beta2_deg in (-150..=150).step_by(10) {
                let chain = undamped(preset, 0.0, f64::from(beta2_deg));
                for error in mode_errors(&chain, Scheme::Exponential, 1000.0).unwrap() {
                    assert!(error.damping_ratio.abs() < 1e-12 && error.frequency_error.abs() < 1e-12, "{error:?}");
                }
            }
        }
    }

    /// The symmetric schemes conserve energy to rounding, at an amplitude at which the arm is far from linear; rk4 does
    /// not.
    #[test]
    fn symmetric_schemes_keep_the_energy() {
        let start = [0.05, -0.08, 0.5, -1.0];
        let drift = |preset, beta2_deg, scheme, rate_hz| {
            energy_drift(&undamped(preset, 20.0, beta2_deg), scheme, rate_hz, &start, 20_000).unwrap()
        };
        let fitted = Preset::Irb1600Fitted;
        let table1 = Preset::Irb1600Table1;
        // The last two are so slow that the second mode turns by about π a step.
        for (preset, beta2_deg, rate_hz) in [
            (fitted, 60.0, 4000.0),
            (fitted, -120.0, 4000.0),
            (table1, 90.0, 4000.0),
            (table1, 0.0, 4000.0),
            (table1, 0.0, 1000.0),
            (fitted, 60.0, 100.0),
        ] {
            for scheme in Scheme::ALL.into_iter().filter(|scheme| scheme.is_symmetric()) {
                let drift = drift(preset, beta2_deg, scheme, rate_hz);
                // With gl4 the mean over a tenth retains some of the oscillation.
                assert!(drift.change.abs() < 1e-12 + 1e-2 * drift.spread && drift.spread > 0.0, "{scheme}: {drift:?}");
            }
        }
        let rk4 = drift(fitted, 60.0, Scheme::Rk4, 4000.0);
        assert!(rk4.change < -1e-5 && rk4.tenths.is_sorted_by(|a, b| a > b), "{rk4:?}");
    }

    #[test]
    fn says_which_rate_would_do() {
        let chain = undamped(Preset::Irb1600Table1, 0.0, 0.0);
        insta::assert_snapshot!(mode_errors(&chain, Scheme::Rk4, 1000.0).unwrap_err(), @"scheme rk4 is too coarse for this structure at 1000 Hz: its fastest mode needs a rate of at least 1265 Hz");
    }
}
