//! Impossible settings, and the message of a walk that gives up.

use super::*;
use crate::control::{CancelHarmonics, ModeNumber};
use crate::plant::{Plant, PlantSpec, TestedAssembly, tests};
use crate::rig::{Converter, Load, RigSpec};
use alloc::collections::VecDeque;
use alloc::string::{String, ToString};
use resonarm_dynamics::integrate::Scheme;

/// The arm as a chain.
fn arm(beta2_deg: f64) -> TestedAssembly {
    tests::preset([0.0, beta2_deg])
}

/// Returns the structure as the controller knows it, under an ideal exciter.
fn known(tested: &TestedAssembly) -> Modelled<'_> {
    Modelled::new(tested, &RigSpec::default()).unwrap()
}

fn sampling(rate_hz: f64) -> Sampling {
    Sampling { rate_hz, converter: Converter::default() }
}

fn torque(torque1_nm: f64) -> PhaseWalkSpec {
    PhaseWalkSpec { points: 5, ..PhaseWalkSpec::new(Load::torque_nm(torque1_nm, 0.0)) }
}

fn plant(beta2_deg: f64, rig: RigSpec) -> Plant {
    let spec = PlantSpec { scheme: Scheme::default(), sample_rate_hz: 1000.0, steps_per_sample: 2, rig, seed: 1 };
    Plant::new(&spec, &arm(beta2_deg)).unwrap()
}

/// Runs to the end of the walk, or stops after a minute and a half of simulated time.
fn walk(controller: &mut PhaseWalk, plant: &mut Plant) -> (Vec<ResponsePoint>, Answer) {
    walk_late(controller, plant, 0)
}

/// The same with every command `late` samples late.
fn walk_late(controller: &mut PhaseWalk, plant: &mut Plant, late: usize) -> (Vec<ResponsePoint>, Answer) {
    let mut points = Vec::new();
    let mut on_their_way: VecDeque<Load> = core::iter::repeat_n(Load::default(), late).collect();
    loop {
        let answer = controller.answer(&plant.measure());
        points.extend(core::iter::from_fn(|| controller.poll_response()));
        let Answer::Hold(load) = answer else { return (points, answer) };
        if plant.sample() > 90_000 {
            return (points, answer);
        }
        on_their_way.push_back(load);
        let acting = on_their_way.pop_front().unwrap();
        if plant.advance(&acting).is_err() {
            return (points, answer);
        }
    }
}

#[test]
fn walks_over_the_resonance_and_again_after_a_restart() {
    let mut plant = plant(60.0, RigSpec::default());
    let mut controller = PhaseWalk::new(torque(10.0), known(&arm(60.0)), sampling(1000.0), 1600.0).unwrap();
    let (points, end) = walk(&mut controller, &mut plant);
    assert_eq!((points.len(), end), (5, Answer::Finished));
    for (point, lag_deg) in points.iter().zip([10.0, 50.0, 90.0, 130.0, 170.0]) {
        assert!(point.settled && (point.load / 10.0 - 1.0).abs() < 2e-3, "{point:?}");
        assert!((point.lag_rad.unwrap().to_degrees() - lag_deg).abs() < 0.6, "{point:?}");
    }
    // The plant is at rest again, except for what the loop leaves after half a second.
    assert!(plant.states().coordinates().iter().all(|alpha_rad| alpha_rad.abs() < 1e-3), "{:?}", plant.states());
    controller.restart();
    let mut fresh = self::plant(60.0, RigSpec::default());
    // Bit for bit: a restart leaves nothing of the first walk. In particular the model of the backbone forgets its
    // points.
    assert_eq!(walk(&mut controller, &mut fresh), (points, Answer::Finished));
}

#[test]
fn a_clipped_reading_of_the_followed_point_ends_the_walk() {
    let mut deaf = RigSpec::default();
    // Less than B reads at the resonance under 20 N·m.
    deaf.sensors.b.range = 300.0;
    let mut plant = plant(60.0, deaf);
    let mut controller = PhaseWalk::new(torque(20.0), known(&arm(60.0)), sampling(1000.0), 1600.0).unwrap();
    let (_, end) = walk(&mut controller, &mut plant);
    let Answer::Aborted(abort) = end else { panic!("{end:?}") };
    assert!(matches!(abort, Abort::Clipped { point: 'B', .. }), "{abort}");
}

/// The poles promise a margin of nine samples in this pose. The head reads the force that acts, so with late commands
/// the readings are right, though some points miss the wanted load and are reported as not settled.
#[test]
fn commands_may_come_late() {
    let walked = |late| {
        let mut plant = plant(60.0, RigSpec::default());
        let amplitude = Load::force_n(0.0, 10.0);
        let spec = PhaseWalkSpec { points: 5, ..PhaseWalkSpec::new(amplitude) };
        let mut controller = PhaseWalk::new(spec, known(&arm(60.0)), sampling(1000.0), 600.0).unwrap();
        walk_late(&mut controller, &mut plant, late)
    };
    let (points, end) = walked(3);
    let near = |point: &ResponsePoint| (point.load / 10.0 - 1.0).abs() < 1e-2;
    assert!(end == Answer::Finished && points.iter().all(near), "{end:?} {points:?}");
    // Beyond the margin the loop is unstable: the walk has to end by itself, and must report no point of it as
    // settled.
    let (points, end) = walked(14);
    assert!(end != Answer::Finished && !points.iter().any(|point| point.settled), "{end:?} {points:?}");
}

/// An arm in another pose than the controller's model: its mode is elsewhere.
#[test]
fn detects_an_arm_other_than_the_scenario_s() {
    let mut plant = plant(60.0, RigSpec::default());
    let mut controller = PhaseWalk::new(torque(20.0), known(&arm(120.0)), sampling(1000.0), 1600.0).unwrap();
    let (points, end) = walk(&mut controller, &mut plant);
    assert!(matches!(end, Answer::Aborted(_)), "{end:?}");
    assert!(points.iter().all(|point| !point.settled), "{points:?}");
}

/// With a light shaker the second harmonic of the force grows to a fifth of the fundamental. Mode 2 is far from it, so that
/// every point settles.
#[test]
fn harmonics_of_the_force_are_cancelled() {
    let shaker = crate::rig::ShakerSpec {
        direction_deg: 0.0,
        amplifier: crate::rig::Amplifier::Current,
        moving_mass_kg: 0.1,
        stiffness_n_m: 2e3,
        damping_n_s_m: 20.0,
        force_factor_n_a: 20.0,
        resistance_ohm: 2.0,
        inductance_h: 3e-4,
        stroke_m: 0.05,
        current_limit_a: 30.0,
        voltage_limit_v: 200.0,
    };
    let tested = arm(30.0);
    let of = Modelled::new(&tested, &RigSpec { shaker: Some(shaker), ..RigSpec::default() }).unwrap();
    let largest = |cancel_harmonics| {
        let amplitude = Load::force_n(5.0, 0.0);
        let spec = PhaseWalkSpec { points: 5, cancel_harmonics, ..PhaseWalkSpec::new(amplitude) };
        let mut controller = PhaseWalk::new(spec, of, sampling(1000.0), 600.0).unwrap();
        let mut plant = plant(30.0, RigSpec { shaker: Some(shaker), ..RigSpec::default() });
        let (points, end) = walk(&mut controller, &mut plant);
        assert!(end == Answer::Finished && points.iter().all(|point| point.settled), "{end:?} {points:?}");
        points.iter().filter_map(ResponsePoint::distortion).fold(0.0, f64::max)
    };
    let (as_it_is, cancelled) = (largest(CancelHarmonics::NONE), largest(CancelHarmonics::ALL));
    assert!(as_it_is > 0.1 && cancelled < 3e-3, "{as_it_is} {cancelled}");
}

#[test]
fn rejects_impossible_walks() {
    let says = |spec: PhaseWalkSpec, rate_hz, limit| -> String {
        PhaseWalk::new(spec, known(&arm(60.0)), sampling(rate_hz), limit).unwrap_err().to_string()
    };
    let spec = torque(20.0);
    insta::assert_snapshot!(says(PhaseWalkSpec { points: 2, ..spec }, 1000.0, 1600.0), @"control: `points` is 2: it must be from 3 to 10000");
    insta::assert_snapshot!(says(PhaseWalkSpec { from_lag_deg: 0.0, ..spec }, 1000.0, 1600.0), @"control: `from_lag_deg` is 0: it must be above 0 and below 180");
    insta::assert_snapshot!(says(PhaseWalkSpec { to_lag_deg: 5.0, ..spec }, 1000.0, 1600.0), @"control: `to_lag_deg` is 5: it must be above `from_lag_deg` and below 180");
    insta::assert_snapshot!(says(PhaseWalkSpec { from_part: 0.0, ..spec }, 1000.0, 1600.0), @"control: `from_part` is 0: it must be above 0 and at most 1");
    insta::assert_snapshot!(says(torque(0.0), 1000.0, 1600.0), @"control.amplitude: excitation: the amplitude is 0: set `exciter_x`, `exciter_y` or `exciter_z`, or a torque such as `joint1`");
    insta::assert_snapshot!(says(spec, 1000.0, 20.0), @"control: `amplitude` is 20: it must be below the exciter's limit: the controller needs a reserve to change the amplitude");
    insta::assert_snapshot!(says(spec, 200.0, 1600.0), @"control: the sample rate of 200 Hz is too low for a mode at 22.16 Hz: it must be at least 244 Hz");
}

#[test]
fn rejects_impossible_response_control() {
    let amplitude = Load::torque_nm(20.0, 0.0);
    let (from_hz, to_hz, points, cancel_harmonics) = (22.0, 22.3, 5, CancelHarmonics::NONE);
    let spec = ResponseControlSpec {
        amplitude,
        mode_number: ModeNumber::FIRST,
        displacement_m: 0.05,
        from_hz,
        to_hz,
        points,
        cancel_harmonics,
    };
    let says = |spec: ResponseControlSpec| -> String {
        PhaseWalk::new(spec, known(&arm(60.0)), sampling(1000.0), 1600.0).unwrap_err().to_string()
    };
    insta::assert_snapshot!(says(ResponseControlSpec { points: 1, ..spec }), @"control: `points` is 1: it must be from 3 to 10000");
    insta::assert_snapshot!(says(ResponseControlSpec { displacement_m: -0.05, ..spec }), @"control: `displacement_m` is -0.05: it must be above 0 and below 0.5");
    insta::assert_snapshot!(says(ResponseControlSpec { from_hz: 12.0, ..spec }), @"control: `from_hz` is 12: it must be within a tenth of the mode's 22.16 Hz, from 19.94 to 24.37 Hz");
    insta::assert_snapshot!(says(ResponseControlSpec { to_hz: f64::NAN, ..spec }), @"control: `to_hz` is NaN: it must be within a tenth of the mode's 22.16 Hz, from 19.94 to 24.37 Hz");
}

#[test]
fn says_why_it_gives_up() {
    let frequency_hz = 22.131_68;
    let aborts = [
        Abort::Clipped { point: 'B', point_key: 'b', frequency_hz },
        Abort::Load { got: 612.3, limit: 600.0, unit: "N", frequency_hz },
        Abort::NotSettling { points: 3, frequency_hz, lag_deg: 23.26, drift: 5.9e-5 },
        Abort::OutOfBand { lag_deg: 10.0, frequency_hz: 31.5, amplitude_m: 0.7 },
        Abort::NotPredicted { lag_deg: 170.0 },
    ];
    let texts: Vec<String> = aborts.iter().map(ToString::to_string).collect();
    insta::assert_snapshot!(texts.join("\n"), @"
    the accelerometer at B was clipped at 22.1317 Hz: reduce the excitation, or increase its range (`rig.sensors.b.range_m_s2`; the classic profile carries 1638 m/s²)
    the controller asks for 612.3 N at 22.1317 Hz, beyond the exciter's limit of 600 N: reduce the excitation, or raise the limit if the exciter allows it
    3 points in a row did not settle, the last at 22.1317 Hz and a lag of 23.3° (drift 5.9e-5): another mode takes part there, or the structure differs from the one in the scenario; check both
    the points found so far predict no response with a lag of 10.0° at this load: its frequency would be 31.500 Hz and its amplitude 0.700 m, but a phase walk stays within a tenth of the mode's frequency; choose lags nearer to 90° (`from_lag_deg` and `to_lag_deg` in `[control]`), or another load
    the points found so far predict no response with a lag of 170.0° at this load: another mode may move the driven point as much as the followed one; choose lags nearer to 90° (`from_lag_deg` and `to_lag_deg` in `[control]`), or another load
    ");
}
