//! Errors of the integration schemes: numerical damping, frequency error, drift of energy.

use core::f64::consts::TAU;

use nalgebra::{Complex, Vector2};
use serde::Serialize;

use super::modes::{Mode, modes};
use resonarm_dynamics::arm::{Arm, Load, State};
use resonarm_dynamics::integrate::{IntegrateError, Integrator, Scheme};

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

/// The change of energy of an arm without dampers and load, ideally zero.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct EnergyDrift {
    /// Steps made.
    pub steps: u32,
    /// The last of `tenths` minus the first.
    pub change: f64,
    /// Largest less smallest energy seen, over the energy at the start.
    pub spread: f64,
    /// Mean energy over each tenth of the steps, over the energy at the start, less 1.
    pub tenths: [f64; 10],
}

/// Steps over which [`mode_errors`] measures.
const MODE_STEPS: u32 = 1000;
/// Largest deflection in [`mode_errors`], rad: so small that the arm's nonlinearity, of the order of it, is below
/// rounding.
const MODE_AMPLITUDE_RAD: f64 = 1e-13;

/// The scheme's damping ratio and relative frequency error in both modes of the arm without its dampers, at `rate_hz`
/// steps a second, measured from the motion in time.
///
/// The arm starts on a mode φ with an amplitude at which it is linear. Its modal coordinate η = φᵀM0 α follows η̈ =
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
/// [`IntegrateError`] if the scheme can't carry the arm at this rate.
pub fn mode_errors(arm: &Arm, scheme: Scheme, rate_hz: f64) -> Result<[ModeError; 2], IntegrateError> {
    let arm = arm.without_dampers();
    let integrator = Integrator::new(scheme, rate_hz, &arm)?;
    let [low, high] = modes(&arm);
    Ok([mode_error(&arm, &integrator, &low)?, mode_error(&arm, &integrator, &high)?])
}

fn mode_error(arm: &Arm, integrator: &Integrator, mode: &Mode) -> Result<ModeError, IntegrateError> {
    let shape = Vector2::from(mode.shape);
    let row = arm.mass_matrix(&Vector2::zeros()) * shape;
    let omega = TAU * mode.frequency_hz;
    let phasor = |state: &State| Complex::new(omega * row.dot(&state.alpha_rad), -row.dot(&state.alpha_dot_rad_s));
    let (sine, cosine) = libm::sincos(omega * integrator.step_s());
    let one_step_back = Complex::new(cosine, -sine);
    let mut state = State::new((shape * (MODE_AMPLITUDE_RAD / shape.amax())).into(), [0.0; 2]);
    let mut phasor_before = phasor(&state);
    let (mut log_amplitude, mut phase_rad) = (0.0, 0.0);
    for k in 0..MODE_STEPS {
        let t_s = f64::from(k) * integrator.step_s();
        state = integrator.step(arm, t_s, &state, &Load::default())?;
        let phasor_after = phasor(&state);
        // Near 1, or exactly 1 for a perfect scheme.
        let turn = phasor_after / phasor_before * one_step_back;
        log_amplitude += 0.5 * libm::log1p(turn.re * turn.re + turn.im * turn.im - 1.0);
        phase_rad += libm::atan2(turn.im, turn.re);
        phasor_before = phasor_after;
    }
    let exact_phase_rad = omega * integrator.step_s() * f64::from(MODE_STEPS);
    Ok(ModeError {
        frequency_hz: mode.frequency_hz,
        damping_ratio: -log_amplitude / exact_phase_rad,
        frequency_error: phase_rad / exact_phase_rad,
    })
}

/// The drift of energy over `steps` steps (at least 10) of free vibration of the arm without its dampers, from `start`.
///
/// Free vibration without dampers is reversible. A symmetric scheme with a fixed step keeps that, and with it, as long
/// as the motion is quasi-periodic, invariants that differ from the true ones by O(hᵖ) (E. Hairer, C. Lubich, G.
/// Wanner, "Geometric Numerical Integration", 2006, chapter XI): the energy oscillates without drift. `spread` shows
/// the oscillation, `change` the drift. No scheme here is symplectic: in (α, α̇) the momenta Mα̇ are not among the
/// variables; so for chaotic motion nothing is guaranteed. The mean over a tenth is weighted by s³(1−s)³, s from 0 to 1
/// over the tenth: the mean of a quasi-periodic oscillation over n of its periods then falls as n⁻⁴, not as n⁻¹ (S.
/// Das, Y. Saiki, E. Sander, J. A. Yorke, "Quantitative quasiperiodicity", Nonlinearity 30 (2017)).
///
/// # Errors
/// [`IntegrateError`] if the scheme can't carry the arm at this rate or can't make a step.
pub fn energy_drift(
    arm: &Arm,
    scheme: Scheme,
    rate_hz: f64,
    start: &State,
    steps: u32,
) -> Result<EnergyDrift, IntegrateError> {
    let arm = arm.without_dampers();
    let integrator = Integrator::new(scheme, rate_hz, &arm)?;
    let first_j = arm.energy(start).total_j();
    let (mut state, mut tenths) = (*start, [0.0; 10]);
    let (mut smallest, mut largest) = (0.0_f64, 0.0_f64);
    let mut done = 0;
    for (tenth, mean) in (1_u64..).zip(&mut tenths) {
        let end = (u64::from(steps) * tenth / 10) as u32;
        let (mut sum, mut weights) = (0.0, 0.0);
        for k in done..end {
            state = integrator.step(&arm, f64::from(k) * integrator.step_s(), &state, &Load::default())?;
            // Relative to the start before summing, so that the sum keeps its digits.
            let relative = (arm.energy(&state).total_j() - first_j) / first_j;
            (smallest, largest) = (smallest.min(relative), largest.max(relative));
            let s = (f64::from(k - done) + 0.5) / f64::from(end - done);
            let weight = libm::pow(s * (1.0 - s), 3.0);
            (sum, weights) = (sum + weight * relative, weights + weight);
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
    use crate::tests::arm_at;
    use resonarm_dynamics::arm::{Attachment, Preset};

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
        let alone = arm_at(Preset::Irb1600Fitted, 0.0, 60.0);
        let armature = Attachment { mass_kg: 2.0, stiffness_n_m: 2e4, damping_n_s_m: 30.0, direction_deg: 40.0 };
        let driven = alone.clone().with_attachment(armature).unwrap();
        for (arm, scheme) in [&alone, &driven].into_iter().flat_map(|arm| Scheme::ALL.map(|scheme| (arm, scheme))) {
            for error in mode_errors(arm, scheme, 1000.0).unwrap() {
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
        let arm = arm_at(Preset::Irb1600Table1, 0.0, 0.0);
        let rate_hz = 4000.0;
        for scheme in [Scheme::Rk4, Scheme::Gl4, Scheme::Gl6] {
            let [_, error] = mode_errors(&arm, scheme, rate_hz).unwrap();
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
                let arm = arm_at(preset, 0.0, f64::from(beta2_deg));
                for error in mode_errors(&arm, Scheme::Exponential, 1000.0).unwrap() {
                    assert!(error.damping_ratio.abs() < 1e-12 && error.frequency_error.abs() < 1e-12, "{error:?}");
                }
            }
        }
    }

    /// The symmetric schemes conserve energy to rounding, at an amplitude at which the arm is far from linear; rk4 does
    /// not.
    #[test]
    fn symmetric_schemes_keep_the_energy() {
        let start = State::new([0.05, -0.08], [0.5, -1.0]);
        let drift = |preset, beta2_deg, scheme, rate_hz| {
            energy_drift(&arm_at(preset, 20.0, beta2_deg), scheme, rate_hz, &start, 20_000).unwrap()
        };
        let (fitted, table1) = (Preset::Irb1600Fitted, Preset::Irb1600Table1);
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
        let arm = arm_at(Preset::Irb1600Table1, 0.0, 0.0);
        insta::assert_snapshot!(mode_errors(&arm, Scheme::Rk4, 1000.0).unwrap_err(), @"scheme rk4 can't carry this arm at 1000 Hz: its second mode needs at least 1265 Hz");
    }
}
