//! Limits on sensors that Resonarm's protocol does not carry: kept where the exciter reads the sensor, else refused.

use super::*;

/// Accelerometer m3 at the tip, along x; its cable drifts off from 0.1 s on.
const M3: &str = "
    [rig.sensors.m3]
    at = 'tip.x'
    [[rig.faults]]
    instrument = 'm3'
    kind = 'drift'
    rate_m_s2_per_s = 500
    from_s = 0.1
    [limits.sensors]
    m3 = 50
";

const DWELL: &str = "
    [excitation]
    amplitude = { joint1 = 5.0 }
    ramp_s = 0.02
    profile = { waveform = 'dwell', frequency_hz = 15.0, duration_s = 0.5, settle_s = 0.1 }
";

const WALK: &str = "
    rig.exciter.torque_limit_nm = 100
    [control]
    law = 'phase-walk'
    amplitude = { joint1 = 10.0 }
    points = 3
";

/// A protocol that carries m3 in the way of the last keys.
fn wire(folder: &std::path::Path, reading: &str) -> String {
    let dbc = "VERSION \"\"\nBU_: Plant Controller\nBO_ 256 Torque: 5 Controller\n \
        SG_ Torque1 : 0|32@1- (1,0) [0|0] \"Nm\" Plant\n SG_ Enable : 32|8@1+ (1,0) [0|0] \"\" Plant\n\
        BO_ 512 Tip: 8 Plant\n SG_ M3 : 0|32@1- (1,0) [0|0] \"m/s2\" Controller\n \
        SG_ Angle : 32|32@1- (1,0) [0|0] \"rad\" Controller\n\
        BO_ 513 Base: 4 Plant\n SG_ Angle : 0|32@1- (1,0) [0|0] \"rad\" Controller\n\
        SIG_VALTYPE_ 256 Torque1 : 1;\nSIG_VALTYPE_ 512 M3 : 1;\nSIG_VALTYPE_ 512 Angle : 1;\nSIG_VALTYPE_ 513 Angle : 1;\n";
    std::fs::write(folder.join("tip.dbc"), dbc).unwrap();
    format!(
        "[wire]\ndbc = 'tip.dbc'\nlockstep = 'command'\n\
         commands = [{{ message = 'Torque', torque1_nm = {{ signal = 'Torque1' }}, timeout_s = 0.5 }}]\n\
         events = [{{ message = 'Torque', signal = 'Enable', arm = [1], disarm = [0] }}]\n\
         [[wire.readings]]\nmessage = 'Base'\nevery = 1\nsignals.Angle = {{ quantity = 'alpha1_rad' }}\n\
         [[wire.readings]]\nmessage = 'Tip'\n{reading}\nsignals.M3 = {{ quantity = 'acceleration_m3_x_m_s2' }}\n"
    )
}

/// How the exciter ended, or why there was no run.
fn end(text: &str, folder: &std::path::Path, mode: Mode) -> Result<ExciterEnd, RunError> {
    let path = folder.join("scenario.toml");
    std::fs::write(&path, text).unwrap();
    let session = Session::new(Scenario::read(&path).unwrap(), mode, Options::default()).unwrap();
    Ok(ExciterEnd::from(&session.both(&Signals::default(), &mut |_| {})?.exciter))
}

fn reason(text: &str, folder: &std::path::Path, mode: Mode) -> String {
    let end = end(text, folder, mode).unwrap();
    assert_eq!(end.outcome, "aborted", "{end:?}");
    end.reason.unwrap()
}

#[test]
fn a_free_run_keeps_the_limits_of_every_sensor() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    insta::assert_snapshot!(reason(&format!("{DWELL}{M3}"), folder, Mode::Free), @"limits.sensors.m3: sensor m3 reads 50.35 m/s² along x after 0.201 s, beyond the limit of 50 m/s²: reduce the excitation, check the sensor if the reading is implausible, or raise the limit");
    insta::assert_snapshot!(reason(&format!("{WALK}{M3}"), folder, Mode::Free), @"limits.sensors.m3: sensor m3 reads 50.1 m/s² along x after 0.206 s, beyond the limit of 50 m/s²: reduce the excitation, check the sensor if the reading is implausible, or raise the limit");
    let within = M3.replace("m3 = 50", "m3 = 1000");
    assert!(end(&format!("{DWELL}{within}"), folder, Mode::Free).unwrap().is_finished());
}

#[test]
fn a_run_on_a_bus_refuses_a_limit_on_a_sensor_that_the_protocol_does_not_carry() {
    let folder = tempfile::tempdir().unwrap();
    for (mode, network) in [(Mode::Lockstep, ""), (Mode::Free, "[network]\nbit_rate_hz = 1000000\n")] {
        let refused = end(&format!("{DWELL}{M3}{network}"), folder.path(), mode).unwrap_err();
        insta::allow_duplicates! {
            insta::assert_snapshot!(refused, @"the controller reads acceleration_m3_x_m_s2, and Resonarm's protocol carries the impedance head, b and c alone: leave the limit in [limits.sensors] out, or map a protocol of your own by [wire]");
        }
    }
    // B and C are carried.
    let b = format!("{DWELL}[limits.sensors]\nb = 500\nc = 0.01\n");
    let reason = reason(&b, folder.path(), Mode::Lockstep);
    assert!(reason.starts_with("limits.sensors.c: the accelerometer at C reads "), "{reason}");
}

#[test]
fn a_limit_is_kept_by_a_user_protocol_that_carries_the_sensor_with_every_sample() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let every = format!("{DWELL}{M3}{}", wire(folder, "every = 1"));
    let free = reason(&every, folder, Mode::Free);
    insta::assert_snapshot!(free, @"limits.sensors.m3: sensor m3 reads 50.349998474121094 m/s² along x after 0.201 s, beyond the limit of 50 m/s²: reduce the excitation, check the sensor if the reading is implausible, or raise the limit");
    assert_eq!(reason(&every, folder, Mode::Lockstep), free);
    let sparse = format!("{DWELL}{M3}{}", wire(folder, "every = 5"));
    insta::assert_snapshot!(end(&sparse, folder, Mode::Free).unwrap_err(), @"the controller reads acceleration_m3_x_m_s2, but no message of every sample carries it: give a [[wire.readings]] with `every = 1` and that `quantity`");
}
