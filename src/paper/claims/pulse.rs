//! Section 1: the vibration that a force pulse leaves behind, by integration in time.

use core::f64::consts::PI;

use super::super::{PaperError, Pulse, Settings, Subject};
use super::{Judgement, number};
use crate::arm::{Arm, Load, State};
use crate::integrate::{Excitation, Integrator, Scheme};

/// F sin(πt/T) along x for 0 ≤ t ≤ T.
struct HalfSine {
    force_n: f64,
    length_s: f64,
}

impl Excitation for HalfSine {
    fn load(&self, t_s: f64) -> Load {
        let force_n = if t_s < self.length_s { self.force_n * libm::sin(PI * t_s / self.length_s) } else { 0.0 };
        Load::force_n(force_n, 0.0)
    }
}

/// Steps a second: 35 in a period of the fastest mode of both presets, 569 Hz.
const RATE_HZ: f64 = 20_000.0;
/// How long the free vibration is watched, s: some ten periods of the slower mode, in which damping takes 1 % away.
const WATCHED_S: f64 = 0.5;
/// Bisections for the length of the pulse.
const BISECTIONS: usize = 14;

/// The largest displacement of C after a pulse, m.
fn amplitude_m(arm: &Arm, force_n: f64, length_s: f64) -> Result<f64, PaperError> {
    let integrator = Integrator::new(Scheme::Gl6, RATE_HZ, arm)?;
    let pulse = HalfSine { force_n, length_s };
    let rest = arm.points(&State::default().alpha_rad).c_m;
    let (mut state, mut largest) = (State::default(), 0.0_f64);
    for k in 0..((length_s + WATCHED_S) * RATE_HZ) as u64 {
        let t_s = k as f64 / RATE_HZ;
        state = integrator.step(arm, t_s, &state, &pulse)?;
        if t_s >= length_s {
            largest = largest.max((arm.points(&state.alpha_rad).c_m - rest).norm());
        }
    }
    Ok(largest)
}

/// The shortest pulse that leaves an amplitude behind, s: it grows with the length up to that of the pulse that is asked for,
/// or is not reached by it.
fn length_s(arm: &Arm, pulse: &Pulse) -> Result<f64, PaperError> {
    let (mut short, mut long) = (0.0, pulse.length_s);
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (short + long);
        if amplitude_m(arm, pulse.force_n, middle)? < pulse.amplitude_m {
            short = middle;
        } else {
            long = middle;
        }
    }
    Ok(long)
}

pub(super) fn amplitude(subject: &Subject, settings: &Settings) -> Result<Judgement, PaperError> {
    let pulse = &settings.pulse;
    let arm = subject.on_line(pulse.beta2_deg)?;
    let seen_m = amplitude_m(&arm, pulse.force_n, pulse.length_s)?;
    let mut value = format!("{:.3} mm after {} ms", seen_m * 1e3, pulse.length_s * 1e3);
    let mut numbers = vec![number(format!("amplitude after {} s", pulse.length_s), seen_m, "m")];
    if seen_m >= pulse.amplitude_m {
        let exact_s = length_s(&arm, pulse)?;
        value.push_str(&format!("; {} mm after {:.2} ms", pulse.amplitude_m * 1e3, exact_s * 1e3));
        numbers.push(number(format!("length for {} m", pulse.amplitude_m), exact_s, "s"));
    }
    let ratio = seen_m / pulse.amplitude_m;
    Ok(Judgement { holds: (0.5..=2.0).contains(&ratio), value, numbers })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::Preset;

    /// A blow much shorter than the modes' periods gives the arm the momentum JᵀF·2T/π at once: α̇ = M⁻¹ of it, and the joints
    /// swing up with v = J α̇; what follows is linear in the force.
    #[test]
    fn a_short_blow_is_a_momentum() {
        let subject = Subject::new(Preset::Irb1600Fitted, &Settings::embedded().unwrap()).unwrap();
        let arm = subject.on_line(120.0).unwrap();
        let [one, two] = [1.0, 2.0].map(|force_n| amplitude_m(&arm, force_n, 1e-3).unwrap());
        assert!((two / one - 2.0).abs() < 1e-4, "{one} {two}");
        let j = arm.tip_jacobian(&State::default().alpha_rad);
        let m = arm.mass_matrix(&State::default().alpha_rad);
        let momentum = j.transpose() * nalgebra::Vector2::new(2e-3 / PI, 0.0);
        let rates = m.try_inverse().unwrap() * momentum;
        let state = State { alpha_dot_rad_s: rates, ..State::default() };
        let integrator = Integrator::new(Scheme::Gl6, RATE_HZ, &arm).unwrap();
        let rest = arm.points(&state.alpha_rad).c_m;
        let (mut state, mut largest) = (state, 0.0_f64);
        for k in 0..10_000 {
            state = integrator.step(&arm, f64::from(k) / RATE_HZ, &state, &Load::default()).unwrap();
            largest = largest.max((arm.points(&state.alpha_rad).c_m - rest).norm());
        }
        assert!((one / largest - 1.0).abs() < 0.01, "{one} {largest}");
    }
}
