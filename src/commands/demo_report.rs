//! The demo's introduction.

use crate::failure::Failure;
use resonarm::analysis::modes;
use resonarm::control::ControlSpec;
use resonarm::run::{Mode, Speed};
use resonarm::scenario::Scenario;

/// Describes the run that is about to start.
pub(crate) fn introduction(
    scenario: &Scenario,
    control: &ControlSpec,
    mode: Mode,
    speed: Speed,
) -> Result<String, Failure> {
    let [first, second] = modes(&scenario.build_arm()?);
    let settling_s = 1.0 / (core::f64::consts::TAU * first.frequency_hz * first.damping_ratio);
    let pace = match (mode, speed.times()) {
        (Mode::RealTime, _) => String::from("in real time"),
        (_, 0.0) => String::from("in lockstep, as fast as it goes"),
        (_, times) => format!("in lockstep at {times} times the speed of the clock"),
    };
    let (amplitude, unit) = (control.amplitude(), control.amplitude().unit());
    let load = amplitude.load();
    let size = libm::hypot(load.force_n.norm(), load.torque_nm.norm());
    let law = match control {
        ControlSpec::PhaseWalk(walk) => {
            let (points, from, to) = (walk.points, walk.from_lag_deg, walk.to_lag_deg);
            format!("phase walk of {points} points at {size} {unit}, lags {from}° to {to}°")
        }
        ControlSpec::ForceControl(_) => format!("force control at {size} {unit}"),
        ControlSpec::ResponseControl(spec) => {
            format!("response control at {} rad, {} to {} Hz", spec.angle_rad, spec.from_hz, spec.to_hz)
        }
    };
    Ok(format!(
        "arm          {} at β1 = {}°, β2 = {}°\n\
         modes        {:.2} Hz (damping ratio {:.1e}, time constant {settling_s:.0} s), {:.2} Hz\n\
         control      {law}\n\
         bus          in memory, {} samples a second, {pace}\n\n",
        scenario.arm.label(),
        scenario.arm.beta1_deg,
        scenario.arm.beta2_deg,
        first.frequency_hz,
        first.damping_ratio,
        second.frequency_hz,
        scenario.simulation.rate_hz,
    ))
}
