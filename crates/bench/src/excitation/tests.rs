use super::*;
use crate::rig::Load;
use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::Normed as _;

fn force(profile: Waveform) -> ExcitationSpec {
    ExcitationSpec { amplitude: Load::force_n(10.0, 0.0), ramp_s: 0.5, profile }
}

const STEPPED: Waveform = Waveform::SteppedSine { from_hz: 20.0, to_hz: 25.0, steps: 11, dwell_s: 2.0, settle_s: 0.6 };

#[test]
fn stepped_sine_runs_on_without_jumps() {
    let profile = Profile::new(&force(STEPPED), 1000.0).unwrap();
    let loads: Vec<f64> = (0..=profile.samples()).map(|n| profile.load(n).force_n.x).collect();
    // The largest change of a sine of 10 N and 25 Hz within 1 ms. A jump of the phase between two steps would exceed
    // it.
    let steepest = 10.0 * TAU * 25.0 / 1000.0;
    assert!(loads.windows(2).all(|pair| (pair[1] - pair[0]).abs() <= steepest * 1.001));
    assert_eq!((loads[0], *loads.last().unwrap()), (0.0, 0.0));
    let peak = loads.iter().fold(0.0_f64, |peak, load| peak.max(load.abs()));
    assert!((peak - 10.0).abs() < 1e-3);
    let windows: Vec<_> = profile.windows().collect();
    assert_eq!(windows.len(), 11);
    assert_eq!((windows[0].frequency_hz, windows[10].frequency_hz), (20.0, 25.0));
    assert!(windows.windows(2).all(|pair| pair[0].end <= pair[1].first));
}

fn swept(from_hz: f64, to_hz: f64, law: SweepLaw) -> Waveform {
    Waveform::SweptSine { from_hz, to_hz, duration_s: 10.0, law }
}

#[test]
fn swept_sine_passes_the_frequencies_it_names() {
    let profile = Profile::new(&force(swept(10.0, 30.0, SweepLaw::Linear)), 1000.0).unwrap();
    let frequency = |n: u64| {
        let cycles = profile.phase_cycles((n + 1) as f64) - profile.phase_cycles(n as f64);
        1000.0 * (cycles - cycles.floor())
    };
    for (n, hz) in [(0, 10.0), (5_000, 20.0), (9_998, 30.0)] {
        assert!((frequency(n) - hz).abs() < 0.01, "{n}: {}", frequency(n));
    }
    assert_eq!(profile.windows().count(), 0);
}

#[test]
fn impulse_is_a_half_sine() {
    let spec = force(Waveform::Impulse { pulse_s: 0.01, duration_s: 1.0 });
    let profile = Profile::new(&spec, 1000.0).unwrap();
    let impulse: f64 = (0..1000).map(|n| profile.load(n).force_n.x * 1e-3).sum();
    // ∫ 10 N sin(πt/10 ms) dt = 10 · 2/π · 10 ms
    assert!((impulse - 10.0 * 2.0 / core::f64::consts::PI * 0.01).abs() < 1e-3);
    assert_eq!(profile.load(11).force_n.x, 0.0);
}

#[test]
fn fit_finds_amplitude_and_phase_beside_another_mode() {
    let (rate, n) = (1000.0, 4000_u64);
    let mut fit = SineFit::<1>::new(n);
    for k in 0..n {
        let t = k as f64 / rate;
        let wanted = 3.0 * libm::sin(TAU * 20.0 * t) - 4.0 * libm::cos(TAU * 20.0 * t) + 7.0;
        let ringing = 5.0 * libm::sin(TAU * 23.0 * t + 0.3);
        fit.add(k, 20.0 * t, &[Some(wanted + ringing)]);
    }
    let [phasor] = fit.finish().unwrap();
    // Twelve beats away the Hann window leaks less than 1/12³.
    assert!((phasor - Phasor::new(3.0, -4.0)).norm() < 5.0 / 1000.0, "{phasor}");
}

#[test]
fn says_why_an_excitation_can_t_be_played() {
    let says = |spec: ExcitationSpec, rate_hz| Profile::new(&spec, rate_hz).unwrap_err().to_string();
    insta::assert_snapshot!(says(force(STEPPED), 40.0), @"excitation: the frequency 25 Hz is too high for the sample rate of 40 Hz: it must be below half of that");
    let short = Waveform::Dwell { frequency_hz: 20.0, duration_s: 1.0, settle_s: 0.8 };
    insta::assert_snapshot!(says(force(short), 1000.0), @"excitation: a step of 1.000 s leaves no time to read the response after settling (0.8 s) and the ramps (0.5 s): make the step longer, or settling and ramps shorter");
    let negative = Waveform::Dwell { frequency_hz: -20.0, duration_s: 1.0, settle_s: 0.0 };
    insta::assert_snapshot!(says(force(negative), 1000.0), @"excitation: `frequency_hz` is -20: it must be a positive number");
    let both = Load::planar([1.0, 0.0], [1.0, 0.0]);
    insta::assert_snapshot!(says(ExcitationSpec { amplitude: both, ..force(STEPPED) }, 1000.0), @"excitation: forces and torques are both given: a command carries only one kind; set the other to 0");
    let none = Load::default();
    insta::assert_snapshot!(says(ExcitationSpec { amplitude: none, ..force(STEPPED) }, 1000.0), @"excitation: the amplitude is 0: set `exciter_x`, `exciter_y` or `exciter_z`, or a torque such as `joint1`");
}

#[test]
fn reads_from_toml_and_names_unknown_keys() {
    let text = "amplitude = { exciter_x = 10.0 }\nramp_s = 0.5\n[profile]\nwaveform = 'stepped-sine'\nfrom_hz = 20\nto_hz = 25\nsteps = 11\ndwell_s = 2\nsettle_s = 0.6\n";
    assert_eq!(toml::from_str::<ExcitationSpec>(text).unwrap(), force(STEPPED));
    assert!(
        toml::from_str::<ExcitationSpec>(&text.replace("settle_s", "settel_s"))
            .unwrap_err()
            .to_string()
            .contains("settel_s")
    );
}

/// Every step is stored: so many that they would fill the memory are an error.
#[test]
fn a_staircase_has_a_bound() {
    let stepped =
        |steps| force(Waveform::SteppedSine { from_hz: 20.0, to_hz: 25.0, steps, dwell_s: 2.0, settle_s: 0.6 });
    let refusal = |steps| Profile::new(&stepped(steps), 1000.0).unwrap_err().to_string();
    insta::assert_snapshot!(refusal(u32::MAX), @"excitation: `steps` is 4294967295: it must be from 1 to 100000");
    insta::assert_snapshot!(refusal(0), @"excitation: `steps` is 0: it must be from 1 to 100000");
    assert_eq!(Profile::new(&stepped(100_000), 1000.0).unwrap().windows().count(), 100_000);
}

/// A list is played in its order, each sine in whole periods, and read like the steps of a stepped sine.
#[test]
fn a_list_of_sines_is_played_in_its_order() {
    let list = |frequencies_hz| force(Waveform::SineList { frequencies_hz, dwell_s: 2.0, settle_s: 0.6 });
    let profile = Profile::new(&list(vec![25.0, 20.0, 20.5]), 1000.0).unwrap();
    let windows: Vec<_> = profile.windows().map(|window| (window.frequency_hz, window.first, window.end)).collect();
    // A window begins when its sine has settled for 0.6 s. The last one ends 0.5 s early, where the whole profile
    // ramps down.
    assert_eq!(windows, [(25.0, 600, 2000), (20.0, 2600, 4000), (20.5, 4600, 5500)]);
    assert_eq!(profile.samples(), 6000);
    let refusal = |frequencies_hz| Profile::new(&list(frequencies_hz), 1000.0).unwrap_err().to_string();
    insta::assert_snapshot!(refusal(vec![]), @"excitation: `frequencies_hz` is 0: it must be from 1 to 100000");
    insta::assert_snapshot!(refusal(vec![20.0, -1.0]), @"excitation: `frequencies_hz` is -1: it must be a positive number");
    insta::assert_snapshot!(refusal(vec![20.0, 500.0]), @"excitation: the frequency 500 Hz is too high for the sample rate of 1000 Hz: it must be below half of that");
}
