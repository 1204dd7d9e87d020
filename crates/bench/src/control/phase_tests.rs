//! Phases of the responses that controllers read, against the acting load: for small vibration of the arm, compared
//! with linear theory.

use super::{Answer, Controller, OpenLoop, ResponsePoint, SetPoint, Steered};
use crate::excitation::{ExcitationSpec, Phasor, Profile, Waveform};
use crate::plant::tests::ideal_rig;
use crate::plant::{Plant, PlantSpec, TestedAssembly, tests};
use crate::rig::{Converter, Load, RigSpec, Sampling};
use resonarm_analysis::LinearResponse;
use resonarm_analysis::Quantity;
use resonarm_dynamics::integrate::Scheme;

const FORCE_N: f64 = 0.01;
const RATE_HZ: f64 = 1000.0;

/// The arm with a hundred times its damping, so that it settles within seconds.
fn arm() -> TestedAssembly {
    tests::damped([20.0, 60.0], 100.0)
}

fn spec(converter: Converter) -> PlantSpec {
    let rig = RigSpec { converter, ..ideal_rig() };
    PlantSpec { scheme: Scheme::default(), sample_rate_hz: RATE_HZ, steps_per_sample: 4, rig, seed: 1 }
}

/// The first response that a controller reads from sample `from` on; `before` is called before each of its answers.
fn read<C: Controller>(
    controller: &mut C,
    converter: Converter,
    from: u64,
    mut before: impl FnMut(&mut C, u64),
) -> ResponsePoint {
    let mut plant = Plant::new(&spec(converter), &arm()).unwrap();
    loop {
        before(controller, plant.sample());
        let answer = controller.answer(&plant.measure());
        if let Some(response) = controller.poll_response().filter(|_| plant.sample() >= from) {
            return response;
        }
        let Answer::Hold(load) = answer else { panic!("{answer:?}") };
        plant.advance(&load).unwrap();
    }
}

/// Acceleration of the tip along x over a force there.
fn accelerance(frequency_hz: f64) -> Phasor {
    let assembly = arm().assembly;
    let tip = assembly.dof("tip.x").unwrap();
    LinearResponse::new(&assembly).at(Quantity::Accelerance, tip, tip, frequency_hz).unwrap()
}

/// Checks that force and acceleration of a response, as complex numbers, are those of a load of phase 0.
fn check(response: &ResponsePoint, expected_n: f64, bound: f64, what: &str) {
    assert!((response.load / expected_n - 1.0).abs() < 1e-9, "{what}: {}", response.load);
    // An ideal exciter: the head reads the whole load, and the tip moves as the arm alone does under it.
    let tip = accelerance(response.frequency_hz) * expected_n;
    let head = Phasor::new(expected_n, 0.0);
    for (seen, expected) in [(response.head_force_n[0], head), (response.acceleration_c_m_s2[0], tip)] {
        assert!((seen - expected).norm_sqr() < bound * bound * expected.norm_sqr(), "{what}: {seen} {expected}");
    }
}

/// The images make each converter deviate from the continuous force: an instantaneous one by 1 − sin y/y, y = πfT.
#[test]
fn open_loop_phases_are_against_the_acting_load() {
    for (converter, bound) in
        [(Converter::Instant, 3e-3), (Converter::Sinc1, 3e-3), (Converter::Sinc3, 1e-4), (Converter::Sinc5, 1e-4)]
    {
        for frequency_hz in [15.0, 21.0, 24.0] {
            let amplitude = Load::force_n(FORCE_N, 0.0);
            let profile = Waveform::Dwell { frequency_hz, duration_s: 16.0, settle_s: 10.0 };
            let profile = Profile::new(&ExcitationSpec { amplitude, ramp_s: 1.0, profile }, RATE_HZ).unwrap();
            // A staircase acts less than the sine of its samples.
            let held_n = FORCE_N * Sampling { rate_hz: RATE_HZ, converter }.hold(frequency_hz);
            let response = read(&mut OpenLoop::new(profile, converter), converter, 0, |_, _| {});
            check(&response, held_n, bound, &format!("{converter:?} {frequency_hz}"));
        }
    }
}

#[test]
fn steered_phases_are_against_the_acting_load() {
    for (converter, bound) in [(Converter::Instant, 4e-3), (Converter::Sinc5, 2e-3)] {
        let sampling = Sampling { rate_hz: RATE_HZ, converter };
        for (frequency_hz, phase_deg) in [(15.0, 0.0), (24.0, 70.0)] {
            let mut steered = Steered::new(Load::force_n(1.0, 0.0), 1.0, sampling, frequency_hz);
            let set = SetPoint { load: FORCE_N, frequency_hz, phase_deg };
            // A changed set-point is read again; by then the arm has settled.
            let response = read(&mut steered, converter, 10_000, |steered, n| {
                assert!(![0, 10_000].contains(&n) || steered.steer(&set));
            });
            check(&response, FORCE_N * sampling.hold(frequency_hz), bound, &format!("{converter:?} {frequency_hz}"));
        }
    }
}
