//! Faults of instruments, each caught by the limit that is there for it.

use resonarm::control::Abort;
use resonarm::node::ExciterOutcome;
use resonarm::run::{self, Mode, Options, Session, Signals};
use resonarm::scenario::Scenario;

const DWELL: &str = "[excitation]\namplitude = { exciter_x = 40.0 }\nramp_s = 0.1\n\
    profile = { waveform = 'dwell', frequency_hz = 18.0, duration_s = 1.0, settle_s = 0.2 }\n";
const FORCE_WALK: &str =
    "structure.angles_deg = [30, 60]\n[control]\nlaw = 'phase-walk'\namplitude = { exciter_x = 14.0 }\npoints = 3\n";
const TORQUE_WALK: &str =
    "rig.exciter.torque_limit_nm = 100\n[control]\nlaw = 'phase-walk'\namplitude = { joint1 = 10.0 }\npoints = 3\n";

/// How the exciter's work ended, with the plant's outcome.
fn ended(text: &str, mode: Mode) -> (ExciterOutcome, run::PlantOutcome) {
    let session = Session::new(Scenario::parse(text, "test").unwrap(), mode, Options::default()).unwrap();
    let report = session.both(&Signals::default(), &mut |_event| {}).unwrap();
    (report.exciter.outcome.unwrap(), report.plant.outcome)
}

/// The reason why a run with a fault gives up. Without the fault it ends well, and without the limit it does not give
/// up for this reason.
fn abort(work: &str, limits: &str, fault: &str) -> Abort {
    let (limits, fault) = (format!("[limits]\n{limits}\n"), format!("[[rig.faults]]\n{fault}\n"));
    assert_eq!(
        ended(&format!("{work}{limits}"), Mode::Free),
        (ExciterOutcome::Finished, run::PlantOutcome::Disarmed),
        "{limits}"
    );
    let unlimited = ended(&format!("{work}{fault}"), Mode::Free).0;
    let (ExciterOutcome::Aborted(abort), plant) = ended(&format!("{work}{limits}{fault}"), Mode::Free) else {
        panic!("{limits} did not catch {fault}");
    };
    assert_eq!(plant, run::PlantOutcome::Disarmed);
    assert_ne!(unlimited, ExciterOutcome::Aborted(abort));
    abort
}

fn reason(work: &str, limits: &str, fault: &str) -> String {
    abort(work, limits, fault).to_string()
}

#[test]
fn a_spike_of_the_head_is_beyond_the_force() {
    let spike = "instrument = 'head'\naxis = 'y'\nkind = 'spike'\namplitude_n = -100\nfrom_s = 0.3";
    insta::assert_snapshot!(reason(DWELL, "force_n = 60", spike), @"limits.force_n: the impedance head reads -100 N along y after 0.300 s, beyond the limit of 60 N: reduce the excitation, check the sensor if the reading is implausible, or raise the limit");
}

#[test]
fn a_drift_and_the_noise_of_a_cable_are_beyond_the_acceleration() {
    let drift = "instrument = 'c'\naxis = 'y'\nkind = 'drift'\nrate_m_s2_per_s = 500\nfrom_s = 0.3";
    insta::assert_snapshot!(reason(DWELL, "acceleration_m_s2 = 100", drift), @"limits.acceleration_m_s2: the accelerometer at C reads 100.45 m/s² along y after 0.498 s, beyond the limit of 100 m/s²: reduce the excitation, check the sensor if the reading is implausible, or raise the limit");
    let noise = "instrument = 'b'\naxis = 'x'\nkind = 'noise'\nrms_m_s2 = 50\nfrom_s = 0.3";
    insta::assert_snapshot!(reason(DWELL, "acceleration_m_s2 = 100", noise), @"limits.acceleration_m_s2: the accelerometer at B reads 109.05 m/s² along x after 0.311 s, beyond the limit of 100 m/s²: reduce the excitation, check the sensor if the reading is implausible, or raise the limit");
}

/// The feedback follows what it reads.
#[test]
fn a_spike_of_what_the_loop_reads_makes_it_ask_for_too_much() {
    let spike = "instrument = 'b'\nkind = 'spike'\namplitude_m_s2 = 130\nfrom_s = 0.5\nto_s = 0.52";
    let abort = abort(TORQUE_WALK, "torque_nm = 80", spike);
    assert!(
        matches!(abort, Abort::Command { key: "torque_nm", got, time_s, .. } if got > 80.0 && time_s < 0.52),
        "{abort}"
    );
    let (got, time_s) = (88.9571, 0.502);
    let abort = Abort::Command { key: "torque_nm", got, limit: 80.0, unit: "N·m", time_s };
    insta::assert_snapshot!(abort, @"limits.torque_nm: the controller asks for 88.957 N·m after 0.502 s, beyond the limit of 80 N·m: reduce the excitation, check the controller's readings, or raise the limit");
}

#[test]
fn a_spike_beyond_the_range_stays_clipped() {
    let spike = "instrument = 'b'\naxis = 'y'\nkind = 'spike'\namplitude_m_s2 = 1e4\nfrom_s = 0.3\nto_s = 0.4";
    insta::assert_snapshot!(reason(DWELL, "clipped_samples = 20", spike), @"limits.clipped_samples: the accelerometer at B is clipped along y for 20 samples in a row, up to 0.319 s: reduce the excitation, or increase its range (`rig.sensors.b.range_m_s2`)");
    insta::assert_snapshot!(reason(DWELL, "clipped_samples = 1", spike), @"limits.clipped_samples: the accelerometer at B is clipped along y for 1 sample in a row, up to 0.300 s: reduce the excitation, or increase its range (`rig.sensors.b.range_m_s2`)");
}

#[test]
fn stuck_and_dropped_out_axes_do_not_move() {
    let limits = "stuck_samples = 200\nstuck_above_n = 5";
    let stuck = "instrument = 'c'\naxis = 'y'\nkind = 'stuck'\nfrom_s = 0.3";
    insta::assert_snapshot!(reason(DWELL, limits, stuck), @"limits.stuck_samples: the accelerometer at C reads exactly 0.1 m/s² along y for 200 samples under load, up to 0.515 s: check sensor and cable, or raise the number of samples if the axis has nothing to measure");
    let dropout = "instrument = 'head'\naxis = 'x'\nkind = 'dropout'\nfrom_s = 0.3";
    insta::assert_snapshot!(reason(DWELL, limits, dropout), @"limits.stuck_samples: the impedance head reads exactly 0 N along x for 200 samples under load, up to 0.516 s: check sensor and cable, or raise the number of samples if the axis has nothing to measure");
}

#[test]
fn noise_in_the_head_s_cable_distorts_the_force() {
    let noise = "instrument = 'head'\naxis = 'x'\nkind = 'noise'\nrms_n = 20\nfrom_s = 1";
    let abort = abort(FORCE_WALK, "distortion = 0.05", noise);
    assert!(matches!(abort, Abort::Distorted { got, limit: 0.05, .. } if got > 0.05 && got < 1.0), "{abort}");
    let abort = Abort::Distorted { got: 0.23361, limit: 0.05, frequency_hz: 22.08731, time_s: 9.692 };
    insta::assert_snapshot!(abort, @"limits.distortion: harmonics 2 and 3 of the force are 0.2336 of its fundamental at 22.0873 Hz after 9.692 s, beyond the limit of 0.05: reduce the excitation, check impedance head and exciter, or raise the limit");
}

#[test]
fn limits_end_a_run_in_lockstep_as_in_a_free_one() {
    let fault = "[[rig.faults]]\ninstrument = 'c'\naxis = 'x'\nkind = 'stuck'\nfrom_s = 0.2\n";
    let text = format!("{DWELL}[limits]\nstuck_samples = 100\n{fault}");
    let free = ended(&text, Mode::Free);
    assert!(matches!(free.0, ExciterOutcome::Aborted(_)), "{free:?}");
    assert_eq!(ended(&text, Mode::Lockstep), free);
}
