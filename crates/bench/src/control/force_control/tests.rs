//! Force control of a shaker on the arm, and the errors for impossible settings.

use super::*;
use crate::plant::{Plant, PlantSpec, TestedAssembly, tests};
use crate::rig::{Amplifier, Converter, Load, RigSpec, ShakerSpec};
use alloc::string::ToString;
use alloc::vec::Vec;
use resonarm_dynamics::integrate::Scheme;

fn sampling(rate_hz: f64) -> Sampling {
    Sampling { rate_hz, converter: Converter::default() }
}

/// Damping of 40 N·s/m at the tip, so that the arm settles within a second and the force still drops out.
fn plant_spec(amplifier: Amplifier) -> PlantSpec {
    let shaker = ShakerSpec {
        direction_deg: 0.0,
        amplifier,
        moving_mass_kg: 1.0,
        stiffness_n_m: 2e3,
        damping_n_s_m: 40.0,
        force_factor_n_a: 20.0,
        resistance_ohm: 2.0,
        inductance_h: 3e-4,
        stroke_m: 0.05,
        current_limit_a: 30.0,
        voltage_limit_v: 200.0,
    };
    PlantSpec {
        scheme: Scheme::default(),
        sample_rate_hz: 1000.0,
        steps_per_sample: 2,
        rig: RigSpec { shaker: Some(shaker), ..RigSpec::default() },
        seed: 1,
    }
}

const ANGLES_DEG: [f64; 2] = [30.0, 60.0];

fn plant(amplifier: Amplifier) -> Plant {
    Plant::new(&plant_spec(amplifier), &tests::preset(ANGLES_DEG)).unwrap()
}

/// The arm as a chain.
fn arm() -> TestedAssembly {
    tests::preset(ANGLES_DEG)
}

/// Returns the structure as the controller knows it, with the armature of the shaker on it.
fn known(tested: &TestedAssembly) -> Modelled<'_> {
    Modelled::new(tested, &plant_spec(Amplifier::Current).rig).unwrap()
}

fn stepped(force_x_n: f64, settle_s: f64) -> ForceControlSpec {
    let dwell_s = settle_s + 1.0;
    ForceControlSpec::new(&ExcitationSpec {
        amplitude: Load::force_n(force_x_n, 0.0),
        ramp_s: 0.2,
        profile: Waveform::SteppedSine { from_hz: 20.5, to_hz: 23.5, steps: 4, dwell_s, settle_s },
    })
}

fn play(controller: &mut dyn Controller, plant: &mut Plant) -> (Vec<ResponsePoint>, Answer) {
    let mut points = Vec::new();
    loop {
        let answer = controller.answer(&plant.measure());
        points.extend(controller.poll_response());
        let Answer::Hold(load) = answer else { return (points, answer) };
        plant.advance(&load).unwrap();
    }
}

fn force_n(point: &ResponsePoint) -> f64 {
    let [x, _] = point.head_force_n;
    libm::hypot(x.re, x.im)
}

/// In open loop the force in the head drops to less than a third near the resonance; in closed loop it is the wanted
/// force to within half a per cent.
#[test]
fn the_force_is_kept_where_it_would_drop_out() {
    // The coil damps in voltage mode.
    for (amplifier, settle_s) in [(Amplifier::Current, 8.0), (Amplifier::Voltage, 2.0)] {
        let spec = stepped(2.0, settle_s);
        let mut open =
            crate::control::OpenLoop::new(Profile::new(&spec.excitation(), 1000.0).unwrap(), Converter::default());
        let (points, end) = play(&mut open, &mut plant(amplifier));
        assert_eq!((points.len(), end), (4, Answer::Finished));
        let forces: Vec<f64> = points.iter().map(force_n).collect();
        let (least, most) = forces.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), f| (a.min(*f), b.max(*f)));
        assert!(least < most / 3.0, "{amplifier:?}: {forces:?}");
        let mut closed = ForceControl::new(&spec, known(&arm()), sampling(1000.0), 600.0).unwrap();
        let (points, end) = play(&mut closed, &mut plant(amplifier));
        assert_eq!((points.len(), end), (4, Answer::Finished));
        for point in &points {
            assert!(point.settled && (point.load / 2.0 - 1.0).abs() < 5e-3, "{amplifier:?}: {point:?}");
            // Nothing cancels the harmonics here. The bound only shows that they are read.
            assert!(point.distortion().is_some_and(|distortion| distortion < 0.2), "{point:?}");
        }
        if amplifier == Amplifier::Voltage {
            closed.restart();
            assert_eq!(play(&mut closed, &mut plant(amplifier)).0, points);
        }
    }
}

/// On modes at 20 and 57 Hz the tip moves by F ω²|Σ φ²/(ω₀² − ω² + 2iζω₀ω)| of the structure alone.
#[test]
fn the_force_is_kept_on_a_structure() {
    let tested = crate::plant::shaken_tests::modal(Vec::new());
    let spec = plant_spec(Amplifier::Voltage);
    let frequencies = Waveform::SteppedSine { from_hz: 19.0, to_hz: 21.0, steps: 3, dwell_s: 1.5, settle_s: 0.5 };
    let control = ForceControlSpec { profile: frequencies, ..stepped(2.0, 1.0) };
    let of = Modelled::new(&tested, &spec.rig).unwrap();
    let mut closed = ForceControl::new(&control, of, sampling(1000.0), 600.0).unwrap();
    let (points, end) = play(&mut closed, &mut Plant::new(&spec, &tested).unwrap());
    assert_eq!((points.len(), end), (3, Answer::Finished));
    for point in &points {
        let omega = TAU * point.frequency_hz;
        let mode = |own: f64, shape: f64| {
            Phasor::new(shape * shape, 0.0) / Phasor::new(own * own - omega * omega, 0.02 * own * omega)
        };
        let expected = (mode(20.0 * TAU, 0.5) + mode(57.0 * TAU, -0.4)).norm_sqr().sqrt() * omega * omega * point.load;
        let read = point.acceleration_c_m_s2[0].norm_sqr().sqrt();
        assert!(point.settled && (point.load / 2.0 - 1.0).abs() < 5e-3, "{point:?}");
        assert!((read / expected - 1.0).abs() < 5e-3, "{read} {expected}");
    }
}

/// A dwell at `frequency_hz` with these harmonics cancelled.
fn dwell(force_x_n: f64, frequency_hz: f64, cancel_harmonics: CancelHarmonics) -> ForceControlSpec {
    let excitation = ExcitationSpec {
        amplitude: Load::force_n(force_x_n, 0.0),
        ramp_s: 0.2,
        profile: Waveform::Dwell { frequency_hz, duration_s: 2.5, settle_s: 1.5 },
    };
    ForceControlSpec { cancel_harmonics, ..ForceControlSpec::new(&excitation) }
}

/// In voltage mode the coil damps the motion. The controller does not know this, and learns it.
#[test]
fn harmonics_of_the_force_are_cancelled() {
    let play = |cancel_harmonics| {
        let spec = dwell(20.0, 22.1, cancel_harmonics);
        let mut controller = ForceControl::new(&spec, known(&arm()), sampling(1000.0), 600.0).unwrap();
        let (points, end) = play(&mut controller, &mut plant(Amplifier::Voltage));
        assert_eq!((points.len(), end), (1, Answer::Finished));
        controller.restart();
        assert_eq!(self::play(&mut controller, &mut plant(Amplifier::Voltage)).0, points);
        points[0]
    };
    let (as_it_is, cancelled) = (play(CancelHarmonics::NONE), play(CancelHarmonics::ALL));
    for point in [&as_it_is, &cancelled] {
        assert!(point.settled && (point.load / 20.0 - 1.0).abs() < 4e-3, "{point:?}");
    }
    let [before, after] = [as_it_is, cancelled].map(|point| point.distortion().unwrap());
    assert!(before > 0.1 && after < 5e-3, "{before} {after}");
}

/// Twice the frequency is that of the second mode, where no command produces a force in the head.
#[test]
fn a_harmonic_at_a_mode_is_never_called_cancelled_wrongly() {
    let second = tests::preset(ANGLES_DEG).assembly.modes()[1].clone();
    for part in [0.49, 0.5, 0.51] {
        let spec = dwell(30.0, part * second.frequency_hz, CancelHarmonics::ALL);
        let mut controller = ForceControl::new(&spec, known(&arm()), sampling(1000.0), 600.0).unwrap();
        let (points, end) = play(&mut controller, &mut plant(Amplifier::Current));
        match end {
            Answer::Finished => assert!(!points[0].settled || points[0].distortion().unwrap() < 5e-3, "{points:?}"),
            // A command that produces nothing in the head grows until the exciter has no more.
            end => assert!(matches!(end, Answer::Aborted(Abort::Load { .. })), "{end:?}"),
        }
    }
}

#[test]
fn stops_where_the_shaker_has_no_more() {
    let mut controller = ForceControl::new(&stepped(2.0, 2.0), known(&arm()), sampling(1000.0), 3.0).unwrap();
    let (_, end) = play(&mut controller, &mut plant(Amplifier::Current));
    let Answer::Aborted(abort) = end else { panic!("{end:?}") };
    assert!(matches!(abort, Abort::Load { limit: 3.0, .. }), "{abort}");
}

/// Off the resonance the force is the wanted one; near it, the one that moves the tip at its notch.
#[test]
fn the_force_is_notched_where_the_tip_would_move_too_fast() {
    let spec = ForceControlSpec { notch_c_m_s2: Some(2.0), ..stepped(2.0, 2.0) };
    let mut controller = ForceControl::new(&spec, known(&arm()), sampling(1000.0), 600.0).unwrap();
    let (points, end) = play(&mut controller, &mut plant(Amplifier::Voltage));
    assert_eq!((points.len(), end), (4, Answer::Finished));
    let tip = |point: &ResponsePoint| {
        let [x, y] = point.acceleration_c_m_s2;
        libm::sqrt(x.norm_sqr() + y.norm_sqr())
    };
    let mut notched = 0;
    for point in &points {
        assert!(point.settled && tip(point) < 2.0 * 1.004 && point.load < 2.0 * 1.004, "{point:?}");
        // Force or acceleration is at its target, and neither is beyond.
        let is_notched = point.load < 2.0 * 0.996;
        let kept = if is_notched { tip(point) } else { point.load };
        assert!((kept / 2.0 - 1.0).abs() < 4e-3, "{point:?}");
        notched += usize::from(is_notched);
    }
    assert!((1..4).contains(&notched), "{points:?}");
}

#[test]
fn names_what_is_wrong_with_impossible_settings() {
    let notch = ForceControlSpec { notch_b_m_s2: Some(-1.0), ..stepped(1.0, 2.0) };
    insta::assert_snapshot!(ForceControl::new(&notch, known(&arm()), sampling(1000.0), 600.0).unwrap_err(), @"control: `notch_b_m_s2` is -1: it must be a positive number");
    let says = |spec: &ForceControlSpec, rate_hz| {
        ForceControl::new(spec, known(&arm()), sampling(rate_hz), 600.0).unwrap_err().to_string()
    };
    let torque = ForceControlSpec { amplitude: Load::torque_nm(1.0, 0.0), ..stepped(1.0, 2.0) };
    insta::assert_snapshot!(says(&torque, 1000.0), @"control: force control uses the impedance head, which measures no torque: give `exciter_x` or `exciter_y`");
    let impulse =
        ForceControlSpec { profile: Waveform::Impulse { pulse_s: 0.01, duration_s: 1.0 }, ..stepped(1.0, 2.0) };
    insta::assert_snapshot!(says(&impulse, 1000.0), @"control: force control sets the amplitude of the force at one frequency after the other: set `waveform` to `dwell`, `stepped-sine` or `sine-list`");
    insta::assert_snapshot!(says(&stepped(1.0, 2.0), 200.0), @"control: the sample rate of 200 Hz is too low for force control at 23.50 Hz: it must be at least 282 Hz");
    insta::assert_snapshot!(says(&stepped(0.0, 2.0), 1000.0), @"excitation: the amplitude is 0: set `exciter_x`, `exciter_y` or `exciter_z`, or a torque such as `joint1`");
}
