//! Checks the section `[limits]` against the load and the instruments when a scenario is read, so that a limit
//! that could never act, or that would end every run, is an error at once.

use super::Scenario;
use crate::error::ScenarioError;
use resonarm_bench::control::LimitsSpec;
use resonarm_bench::rig::{InstrumentName, Load};
use resonarm_protocol::scaling::{ACCELERATION, FORCE};

/// Largest count of consecutive samples that `clipped_samples` and `stuck_samples` may ask for.
const MOST_SAMPLES: u32 = 1_000_000;

/// Rejects limits that are not numbers of the right kind, lie beyond the instruments, or contradict the load.
pub(super) fn check(scenario: &Scenario) -> Result<(), ScenarioError> {
    let Some(limits) = &scenario.limits else { return Ok(()) };
    check_numbers(limits)?;
    check_instruments(limits, scenario)?;
    check_sensors(limits, scenario)?;
    let spec = scenario.excitation.as_ref().map(|spec| &spec.amplitude);
    // A scenario has one amplitude, either that of its excitation or that of its control. `Scenario::check`
    // rejects both together after this check, so which of the two is taken here does not matter.
    let amplitude = spec.or_else(|| scenario.control.as_ref().map(|spec| spec.amplitude()));
    amplitude.map_or(Ok(()), |amplitude| check_load(limits, amplitude, scenario.control.is_some()))
}

fn check_numbers(limits: &LimitsSpec) -> Result<(), ScenarioError> {
    let positive = |got: f64| got.is_finite() && got > 0.0;
    for (name, value) in [
        ("limits.force_n", limits.force_n),
        ("limits.torque_nm", limits.torque_nm),
        ("limits.acceleration_m_s2", limits.acceleration_m_s2),
        ("limits.distortion", limits.distortion),
    ] {
        refuse_unless(name, value, "a positive number", positive)?;
    }
    let most = f64::from(MOST_SAMPLES);
    let samples = |value: Option<u32>| value.map(f64::from);
    let clipped = samples(limits.clipped_samples);
    let stuck = samples(limits.stuck_samples);
    refuse_unless("limits.clipped_samples", clipped, "from 1 to 1000000", |got| (1.0..=most).contains(&got))?;
    // One sample cannot repeat a value, so a stuck reading takes at least two of them. A single clipped sample
    // is already meaningful.
    refuse_unless("limits.stuck_samples", stuck, "from 2 to 1000000", |got| (2.0..=most).contains(&got))?;
    for (name, value) in
        [("limits.stuck_above_n", limits.stuck_above_n), ("limits.stuck_above_nm", limits.stuck_above_nm)]
    {
        refuse_unless(name, value, "zero or a positive number", |got| got.is_finite() && got >= 0.0)?;
        refuse_unless(name, value, "left out, or `limits.stuck_samples` stated beside it", |_| stuck.is_some())?;
    }
    Ok(())
}

/// Rejects limits at or above the range of the instrument or of the protocol: a reading is clipped there and
/// would never exceed the limit.
fn check_instruments(limits: &LimitsSpec, scenario: &Scenario) -> Result<(), ScenarioError> {
    let rig = &scenario.rig;
    let profile = scenario.network.profile;
    let head_n = rig.head.range.min(FORCE.limit(profile));
    let expected = "below the range of the impedance head and of the protocol (655.34 in the classic profile), because no reading is larger";
    refuse_unless("limits.force_n", limits.force_n, expected, |got| got < head_n)?;
    // `limits.acceleration_m_s2` applies to both accelerometers, so the smaller of their ranges decides.
    let range_m_s2 = rig.sensors.b.range.min(rig.sensors.c.range).min(ACCELERATION.limit(profile));
    let expected = "below the ranges of both accelerometers and of the protocol (1638.35 in the classic profile), because no reading is larger";
    refuse_unless("limits.acceleration_m_s2", limits.acceleration_m_s2, expected, |got| got < range_m_s2)
}

/// Rejects limits of sensors that the rig does not have, or that would never be exceeded.
fn check_sensors(limits: &LimitsSpec, scenario: &Scenario) -> Result<(), ScenarioError> {
    let rig = &scenario.rig;
    for (&sensor, &got) in &limits.sensors {
        let wrong = |expected| Err(ScenarioError::value(format!("limits.sensors.{sensor}"), got, expected));
        if sensor == InstrumentName::HEAD {
            return wrong("left out: the impedance head has `limits.force_n`");
        }
        let Some((_, spec)) = rig.instruments().find(|(name, _)| *name == sensor) else {
            let names = rig.instruments().map(|(name, _)| name.to_string()).filter(|name| name != "head");
            return Err(ScenarioError::NoSuchSensor { sensor, known: names.collect::<Vec<_>>().join(", ") });
        };
        if !(got.is_finite() && got > 0.0) {
            return wrong("a positive number");
        }
        let is_on_protocol = matches!(sensor, InstrumentName::B | InstrumentName::C);
        // Other sensors are read beside the protocol, which therefore never clips them.
        let most_on_protocol =
            if is_on_protocol { ACCELERATION.limit(scenario.network.profile) } else { f64::INFINITY };
        if got >= spec.largest_reading().min(most_on_protocol) {
            return wrong(
                "below the range of the sensor and, for b and c, of the protocol (1638.35 in the classic profile), because no \
                 reading is larger",
            );
        }
        // The loop of a free run hands over the readings of one sample at a time.
        if !is_on_protocol && scenario.wire.is_none() && scenario.network.samples_per_frame != 1 {
            return Err(ScenarioError::value(
                "network.samples_per_frame",
                scenario.network.samples_per_frame,
                "1 with a limit in [limits.sensors] on a sensor other than b and c: their readings go beside the frames, \
                 one sample at a time",
            ));
        }
    }
    Ok(())
}

fn check_load(limits: &LimitsSpec, amplitude: &Load, is_controlled: bool) -> Result<(), ScenarioError> {
    let peak = amplitude.force_n.amax().max(amplitude.torque_nm.amax());
    let forces = [("limits.force_n", limits.force_n), ("limits.stuck_above_n", limits.stuck_above_n)];
    let torques = [("limits.torque_nm", limits.torque_nm), ("limits.stuck_above_nm", limits.stuck_above_nm)];
    // A load is either forces or torques. Limits on the other kind would watch readings that this load does not
    // drive.
    let (own, other) = if amplitude.has_torque() { (torques, forces) } else { (forces, torques) };
    for (name, value) in other {
        refuse_unless(name, value, "left out, since the load is of the other kind, forces or torques", |_| false)?;
    }
    let [(limit_name, limit), (above_name, above)] = own;
    let expected = "above the amplitude of the load, or the run ends before the load reaches it";
    refuse_unless(limit_name, limit, expected, |got| got > peak)?;
    let expected = "below the amplitude of the load, or no axis is ever watched";
    refuse_unless(above_name, above, expected, |got| got < peak)?;
    let expected = "left out, since harmonics of the force are only watched with a [control] with forces";
    refuse_unless("limits.distortion", limits.distortion, expected, |_| is_controlled && !amplitude.has_torque())
}

/// Returns an error if the limit is given and does not fit.
fn refuse_unless(
    name: &'static str,
    value: Option<f64>,
    expected: &'static str,
    fits: impl Fn(f64) -> bool,
) -> Result<(), ScenarioError> {
    match value.filter(|got| !fits(*got)) {
        Some(got) => Err(ScenarioError::value(name, got, expected)),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_that_contradict_are_refused_when_they_are_read() {
        let forces = "[excitation]\namplitude = { exciter_x = 10, exciter_y = -20 }\n\
            profile = { waveform = 'dwell', frequency_hz = 20, duration_s = 2, settle_s = 0.5 }\n";
        let torques = "[control]\nlaw = 'phase-walk'\namplitude = { joint1 = 10 }\n";
        let read = |text: &str| Scenario::parse(text, "test");
        let says = |limits: &str, rest: &str| read(&format!("[limits]\n{limits}\n{rest}")).unwrap_err().to_string();
        insta::assert_snapshot!(says("force_n = 0", ""), @"limits.force_n is 0: it must be a positive number");
        insta::assert_snapshot!(says("stuck_samples = 1", ""), @"limits.stuck_samples is 1: it must be from 2 to 1000000");
        insta::assert_snapshot!(says("clipped_samples = 0", ""), @"limits.clipped_samples is 0: it must be from 1 to 1000000");
        insta::assert_snapshot!(says("stuck_above_n = 3", forces), @"limits.stuck_above_n is 3: it must be left out, or `limits.stuck_samples` stated beside it");
        insta::assert_snapshot!(says("force_n = 20", forces), @"limits.force_n is 20: it must be above the amplitude of the load, or the run ends before the load reaches it");
        insta::assert_snapshot!(says("force_n = 200", "[rig.head]\nrange_n = 200"), @"limits.force_n is 200: it must be below the range of the impedance head and of the protocol (655.34 in the classic profile), because no reading is larger");
        insta::assert_snapshot!(says("acceleration_m_s2 = 400", "[rig.sensors.c]\nrange_m_s2 = 300"), @"limits.acceleration_m_s2 is 400: it must be below the ranges of both accelerometers and of the protocol (1638.35 in the classic profile), because no reading is larger");
        insta::assert_snapshot!(says("torque_nm = 30", forces), @"limits.torque_nm is 30: it must be left out, since the load is of the other kind, forces or torques");
        insta::assert_snapshot!(says("force_n = 30", torques), @"limits.force_n is 30: it must be left out, since the load is of the other kind, forces or torques");
        insta::assert_snapshot!(says("torque_nm = 9", torques), @"limits.torque_nm is 9: it must be above the amplitude of the load, or the run ends before the load reaches it");
        insta::assert_snapshot!(says("stuck_samples = 9\nstuck_above_nm = 10", torques), @"limits.stuck_above_nm is 10: it must be below the amplitude of the load, or no axis is ever watched");
        for rest in [forces, torques] {
            insta::allow_duplicates! {
                insta::assert_snapshot!(says("distortion = 0.1", rest), @"limits.distortion is 0.1: it must be left out, since harmonics of the force are only watched with a [control] with forces");
            }
        }
        let m3 = "[rig.sensors.m3]\nat = 'tip.x'\nrange_m_s2 = 100\n[rig.sensors.enc]\nat = 'joint1'\n";
        insta::assert_snapshot!(says("sensors.m4 = 20", m3), @"limits.sensors.m4: there is no such sensor: [rig.sensors] has b, c, enc, m3");
        insta::assert_snapshot!(says("sensors.m4 = 20", ""), @"limits.sensors.m4: there is no such sensor: [rig.sensors] has b, c");
        insta::assert_snapshot!(says("sensors.head = 20", m3), @"limits.sensors.head is 20: it must be left out: the impedance head has `limits.force_n`");
        insta::assert_snapshot!(says("sensors.m3 = 0", m3), @"limits.sensors.m3 is 0: it must be a positive number");
        insta::assert_snapshot!(says("sensors.m3 = 100", m3), @"limits.sensors.m3 is 100: it must be below the range of the sensor and, for b and c, of the protocol (1638.35 in the classic profile), because no reading is larger");
        insta::assert_snapshot!(says("sensors.b = 1639", "[rig.sensors.b]\nrange_m_s2 = 5000"), @"limits.sensors.b is 1639: it must be below the range of the sensor and, for b and c, of the protocol (1638.35 in the classic profile), because no reading is larger");
        insta::assert_snapshot!(says("sensors.enc = 0.1", &format!("{m3}[network]\nprofile = 'fd'\nsamples_per_frame = 2")), @"network.samples_per_frame is 2: it must be 1 with a limit in [limits.sensors] on a sensor other than b and c: their readings go beside the frames, one sample at a time");
        read(&format!("[limits.sensors]\nb = 40\nm3 = 99\nenc = 0.5\n{m3}")).unwrap();
        let every = "force_n = 40\nacceleration_m_s2 = 900\nclipped_samples = 1\nstuck_samples = 2\nstuck_above_n = 19";
        read(&format!("[limits]\n{every}\n{forces}")).unwrap();
    }
}
