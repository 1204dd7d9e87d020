//! Section 1: the vibration after a force pulse, by integration in time.

use core::f64::consts::PI;

use super::cases::{Judgement, Opinion, number, over};
use super::survey::Survey;
use crate::paper::error::PaperError;
use resonarm_dynamics::integrate::Scheme;
use resonarm_dynamics::structure::{Assembly, Dof, StepLoad, Stepper};

/// A half-sine force F sin(πt/T) for 0 ≤ t ≤ T, along x or y at the tip.
struct HalfSine {
    force_n: f64,
    length_s: f64,
    along: Along,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Along {
    X,
    Y,
}

/// Steps a second: 35 in a period of the fastest mode of both presets, 569 Hz.
const RATE_HZ: f64 = 20_000.0;
/// Length of the free vibration, s: some ten periods of the slower mode, in which damping reduces it by 1 %.
const WATCHED_S: f64 = 0.5;

/// Returns the largest displacement of C after a pulse, m, including the step in which the pulse ends.
fn amplitude_m(arm: &Assembly, pulse: &HalfSine) -> Result<f64, PaperError> {
    let tip = [arm.dof("tip.x")?, arm.dof("tip.y")?];
    let driven = tip[usize::from(pulse.along == Along::Y)];
    let mut stepper = Stepper::new(arm, &[driven], Scheme::Gl6, RATE_HZ)?;
    let mut largest = 0.0_f64;
    for k in 0..((pulse.length_s + WATCHED_S) * RATE_HZ) as u64 {
        let t_s = k as f64 / RATE_HZ;
        // Half a period of a sine is the pulse, and is exact inside the steps.
        let load = if t_s < pulse.length_s {
            StepLoad::Sine { amplitude: &[pulse.force_n], omega_rad_s: PI / pulse.length_s }
        } else {
            StepLoad::Held(&[0.0])
        };
        stepper.advance_under(t_s, &load)?;
        // The pulse displaces the arm, too, but the statement is about the vibration that it leaves.
        if t_s >= pulse.length_s {
            largest = largest.max(displacement_m(arm, stepper.position(), &tip));
        }
    }
    Ok(largest)
}

/// Returns the distance of a point from its place at rest, m.
fn displacement_m(arm: &Assembly, position: &[f64], point: &[Dof; 2]) -> f64 {
    let at = arm.at(position);
    libm::hypot(at.displacement(point[0]), at.displacement(point[1]))
}

/// "The amplitude of the vibrations in the robot caused by a force pulse of 100 N is 0.1 mm" (Section 1). A number with
/// one digit means any value that rounds to it: 0.05 mm or more, less than 0.15 mm.
pub(super) fn amplitude(survey: &Survey<'_>) -> Judgement {
    let settings = survey.settings;
    let mut lengths_s = settings.scan.pulse_length_s.clone();
    // The figures' own length is a case even if the scan leaves it out.
    if !lengths_s.contains(&settings.pulse.length_s) {
        lengths_s.push(settings.pulse.length_s);
    }
    let pulses = lengths_s.iter().flat_map(|length_s| [(*length_s, Along::X), (*length_s, Along::Y)]);
    let words = |(length_s, along): (f64, Along)| {
        format!("{} ms along {}", length_s * 1e3, if along == Along::X { "x" } else { "y" })
    };
    let judge = |(length_s, along): (f64, Along)| {
        let pulse = HalfSine { force_n: settings.pulse.force_n, length_s, along };
        let arm = survey.subject.on_line(settings.pulse.beta2_deg);
        let seen_m = arm.and_then(|arm| amplitude_m(&arm, &pulse)).map_err(|why| why.to_string())?;
        let holds = (0.5..1.5).contains(&(seen_m / settings.pulse.amplitude_m));
        Ok(Opinion::new(holds, format!("{:.3} mm", seen_m * 1e3), vec![number("amplitude", seen_m, "m")]))
    };
    over("pulses", (settings.pulse.length_s, Along::X), pulses, (words, judge))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper::{Settings, Subject};
    use resonarm_dynamics::structure::Preset;

    /// A blow much shorter than the modes' periods gives the arm the momentum w·F·2T/π at once: α̇ = M⁻¹ times it, with
    /// w the generalised force of a unit force; the response after it is linear in the force.
    #[test]
    fn a_short_blow_is_a_momentum() {
        let subject = Subject::new(Preset::Irb1600Fitted, &Settings::embedded().unwrap()).unwrap();
        let arm = subject.on_line(120.0).unwrap();
        let blow = |force_n| HalfSine { force_n, length_s: 1e-3, along: Along::X };
        let [one, two] = [1.0, 2.0].map(|force_n| amplitude_m(&arm, &blow(force_n)).unwrap());
        assert!((two / one - 2.0).abs() < 1e-4, "{one} {two}");
        let tip = ["tip.x", "tip.y"].map(|name| arm.dof(name).unwrap());
        let mut w = [0.0; 2];
        let mass = arm.linear().mass;
        arm.at(&[0.0; 2]).load_direction(tip[0], &mut w);
        let momentum = nalgebra::Vector2::from(w) * (2e-3 / PI);
        let rates = nalgebra::Matrix2::from_row_slice(&mass).try_inverse().unwrap() * momentum;
        let mut stepper = Stepper::new(&arm, &[], Scheme::Gl6, RATE_HZ).unwrap();
        stepper.restore(&[0.0, 0.0, rates.x, rates.y]).unwrap();
        let mut largest = 0.0_f64;
        for k in 0..10_000 {
            stepper.advance(f64::from(k) / RATE_HZ, &[]).unwrap();
            largest = largest.max(displacement_m(&arm, stepper.position(), &tip));
        }
        assert!((one / largest - 1.0).abs() < 0.01, "{one} {largest}");
    }
}
