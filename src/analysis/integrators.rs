//! What a scheme adds to the arm: its own damping, its own frequency error, its drift of energy.

use core::f64::consts::TAU;

use nalgebra::{Complex, Vector2};
use serde::Serialize;

use super::modes::{Mode, modes};
use crate::arm::{Arm, Load, State};
use crate::integrate::{IntegrateError, Integrator, Scheme};

/// A scheme's own error in one natural mode.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ModeError {
    /// The mode's natural frequency, Hz.
    pub frequency_hz: f64,
    /// Damping ratio that the scheme adds, dimensionless; negative if it makes energy.
    pub damping_ratio: f64,
    /// Frequency seen over the true one, less 1.
    pub frequency_error: f64,
}

/// How the energy of an arm without dampers and load changes, which should not.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct EnergyDrift {
    /// Steps made.
    pub steps: u32,
    /// Mean energy of the last tenth of the steps over that of the first, less 1.
    pub change: f64,
    /// Largest less smallest energy seen, over the energy at the start.
    pub spread: f64,
}

/// Steps over which [`mode_errors`] measures.
const MODE_STEPS: u32 = 1000;
/// Largest deflection in [`mode_errors`], rad: so small that the arm's nonlinearity, of the order of it, is below rounding.
const MODE_AMPLITUDE_RAD: f64 = 1e-13;

/// The scheme's own damping ratio and relative frequency error in both modes of the arm without its dampers, at `rate_hz` steps a
/// second.
///
/// The arm starts on the mode φ with an amplitude at which it is linear. The modal coordinate η = φᵀM0 α has
/// Z = ωη − iη̇ = Z₀ e^{iωt}; after n steps a scheme has ln(Z/Z₀) = (iω(1 + e) − ωζ) n h instead. The phase is summed over the
/// steps, each against the true ωh, so no turn is lost.
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
/// # Errors
/// [`IntegrateError`] if the scheme can't carry the arm at this rate or can't go on.
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
    let tenth = (steps / 10).max(1);
    let (mut state, mut first_sum, mut last_sum) = (*start, 0.0, 0.0);
    let (mut smallest, mut largest) = (0.0_f64, 0.0_f64);
    for k in 0..steps {
        state = integrator.step(&arm, f64::from(k) * integrator.step_s(), &state, &Load::default())?;
        // Relative to the start before it is summed, so that the sum keeps its digits.
        let relative = (arm.energy(&state).total_j() - first_j) / first_j;
        (smallest, largest) = (smallest.min(relative), largest.max(relative));
        first_sum += if k < tenth { relative } else { 0.0 };
        last_sum += if k >= steps - tenth { relative } else { 0.0 };
    }
    Ok(EnergyDrift { steps, change: (last_sum - first_sum) / f64::from(tenth), spread: largest - smallest })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::Preset;
    use crate::arm::tests::arm;

    /// What linear theory says of each scheme, to the leading term: ζ and the frequency error as powers of z = ωh.
    fn theory(scheme: Scheme, z: f64) -> (f64, f64) {
        match scheme {
            Scheme::Rk4 => (libm::pow(z, 5.0) / 144.0, -libm::pow(z, 4.0) / 120.0),
            Scheme::Dop853 => (2.26e-8 * libm::pow(z, 9.0), -6.4e-8 * libm::pow(z, 8.0)),
            Scheme::Gl4 => (0.0, -libm::pow(z, 4.0) / 720.0),
            Scheme::Gl6 => (0.0, -libm::pow(z, 6.0) / 100_800.0),
            Scheme::Exponential => (0.0, 0.0),
        }
    }

    #[test]
    fn errors_are_those_of_theory() {
        let arm = arm(Preset::Irb1600Fitted, 0.0, 60.0);
        for scheme in Scheme::ALL {
            for error in mode_errors(&arm, scheme, 1000.0).unwrap() {
                let z = TAU * error.frequency_hz / 1000.0;
                let (damping, frequency) = theory(scheme, z);
                let near = |got: f64, expected: f64| (got - expected).abs() < 0.06 * expected.abs() + 1e-12;
                assert!(near(error.damping_ratio, damping), "{scheme} {z}: {error:?}, {damping:e}");
                assert!(near(error.frequency_error, frequency), "{scheme} {z}: {error:?}, {frequency:e}");
            }
        }
    }

    /// At 1 kHz already, the 569 Hz of the straight arm of Table 1 included, where the mode turns by 3.6 rad a step.
    #[test]
    fn exponential_scheme_adds_nothing_at_any_pose() {
        for preset in Preset::ALL {
            for beta2_deg in (-150..=150).step_by(10) {
                let arm = arm(preset, 0.0, f64::from(beta2_deg));
                for error in mode_errors(&arm, Scheme::Exponential, 1000.0).unwrap() {
                    assert!(error.damping_ratio.abs() < 1e-12 && error.frequency_error.abs() < 1e-12, "{error:?}");
                }
            }
        }
    }

    #[test]
    fn only_symmetric_schemes_keep_the_energy() {
        let arm = arm(Preset::Irb1600Fitted, 20.0, 60.0);
        let start = State::new([0.05, -0.08], [0.5, -1.0]);
        for scheme in Scheme::ALL {
            let drift = energy_drift(&arm, scheme, 4000.0, &start, 20_000).unwrap();
            let keeps = drift.change.abs() < 1e-10;
            assert_eq!(keeps, scheme.is_symmetric() || scheme == Scheme::Dop853, "{scheme}: {drift:?}");
            assert!(drift.spread >= 0.0 && drift.spread < 1e-2, "{scheme}: {drift:?}");
        }
    }

    #[test]
    fn says_which_rate_would_do() {
        let arm = arm(Preset::Irb1600Table1, 0.0, 0.0);
        insta::assert_snapshot!(mode_errors(&arm, Scheme::Rk4, 1000.0).unwrap_err(), @"scheme rk4 can't carry this arm at 1000 Hz: its second mode needs at least 1265 Hz");
    }
}
