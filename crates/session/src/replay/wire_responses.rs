//! Reads the responses to a controller on a user protocol from the readings in a recording.
//!
//! A scenario with a control is that of Resonarm's exciter, which is run again ([`super::wire_controller`]). Any other
//! controller can't be run again. It must have played the excitation of the scenario: every commanded load is that of
//! the excitation, within half a count of its signals, at most a sample early or late. For CANopen drives the loads are
//! the targets, and a count is a thousandth of the rated torque.

use alloc::collections::BTreeMap;

use super::error::ReplayError;
use resonarm_bench::control::{Answer, ResponsePoint};
use resonarm_bench::excitation::Profile;
use resonarm_bench::node::WireSpec;
use resonarm_bench::node::cia402::Cia402Spec;
use resonarm_bench::node::mapped::mapping::Mapping;
use resonarm_bench::rig::Load;
use resonarm_bench::rig::{Measurement, Reading};
use resonarm_files::decoder::{Decoded, DecodedMessage, Decoder, Outcome};
use resonarm_files::drives::Targets;
use resonarm_files::import::IMPORTED_FROM;
use resonarm_files::recording::{Direction, Recording, SampleRecord};
use resonarm_scenario::Scenario;

/// Returns the responses, each with the sample at which it was read.
///
/// # Errors
/// [`ReplayError::NoExcitation`] if the scenario has no excitation, [`ReplayError::NoLoad`] if no command has a load,
/// [`ReplayError::Command`] if one differs from the excitation, [`ReplayError::NoReadings`] if the recording was
/// imported without readings; [`ReplayError`] if it can't be read.
pub(super) fn timed_responses(
    recording: &Recording,
    scenario: &Scenario,
) -> Result<Vec<(u64, ResponsePoint)>, ReplayError> {
    if scenario.excitation.is_none() {
        return Err(ReplayError::NoExcitation);
    }
    if let (Some(log), None) = (recording.configuration().get(IMPORTED_FROM), recording.samples()?.next()) {
        return Err(ReplayError::NoReadings { log: log.to_owned() });
    }
    let start = start(recording, scenario, &scenario.profile()?)?;
    let mut controller = scenario.controller()?;
    controller.restart();
    let mut responses = Vec::new();
    for sample in recording.samples()? {
        let sample = sample?;
        let Some(index) = sample.sample.checked_sub(start) else { continue };
        let answer = controller.answer(&measurement(index, &sample));
        let read = core::iter::from_fn(|| controller.poll_response());
        responses.extend(read.map(|response| (sample.sample, response)));
        if !matches!(answer, Answer::Hold(_)) {
            break;
        }
    }
    Ok(responses)
}

/// Returns the sample from which the excitation was played: the first commanded load is its first.
fn start(recording: &Recording, scenario: &Scenario, profile: &Profile) -> Result<u64, ReplayError> {
    let (half, commands) = match scenario.wire_spec()? {
        Some(WireSpec::Mapped(mapping)) => (half_count(&mapping), commands(recording, scenario, &mapping)?),
        Some(WireSpec::Cia402(spec)) => {
            let steps = spec.drives.iter().map(|drive| drive.torque_step_nm().abs());
            (with_rounding(0.5 * steps.fold(0.0, f64::max)), targets(recording, &spec)?)
        }
        None => return Err(ReplayError::NoLoad),
    };
    let is_load = |load: &Load| load.parts().iter().any(|part| part.abs() > half);
    let first =
        commands.iter().find(|(_, load)| is_load(load)).map(|(sample, _)| *sample).ok_or(ReplayError::NoLoad)?;
    let expected = |index: u64| profile.load(index);
    let ahead = (0..profile.samples()).find(|index| is_load(&expected(*index))).ok_or(ReplayError::NoLoad)?;
    // A profile may begin with loads too small to be seen in a frame. So the first load of it that can be seen is that
    // of the first command with a load.
    let start = first.saturating_sub(ahead);
    for (sample, got) in commands.range(first..) {
        let index = sample - start;
        if index >= profile.samples() {
            break;
        }
        let near = |index: u64| {
            let pairs = got.parts().into_iter().zip(expected(index).parts());
            pairs.into_iter().all(|(got, expected)| (got - expected).abs() <= half + FLOAT_SHARE * expected.abs())
        };
        if !(index.saturating_sub(1)..=index + 1).any(near) {
            return Err(ReplayError::command(*sample, *got, expected(index)));
        }
    }
    Ok(start)
}

/// Returns the commanded load from these samples on.
fn commands(recording: &Recording, scenario: &Scenario, mapping: &Mapping) -> Result<BTreeMap<u64, Load>, ReplayError> {
    let Some(mut decoder) = Decoder::of_scenario(scenario)? else { return Ok(BTreeMap::new()) };
    let mut held = vec![Load::default(); mapping.incoming.len()];
    let mut commands = BTreeMap::new();
    for record in recording.frames()? {
        let record = record?;
        let decoded = decoder.decode(&record.frame);
        let is_taken = matches!(decoded, Decoded::Message(DecodedMessage { outcome: Outcome::Taken { .. }, .. }));
        let place = mapping.incoming.iter().position(|message| message.id == record.frame.id());
        if let (true, Direction::Received, Some(place)) = (is_taken, record.direction, place)
            && let Ok(Some(load)) = mapping.incoming[place].load(record.frame.data())
        {
            held[place] = load;
            commands.insert(record.sample, held.iter().fold(Load::default(), |sum, one| sum + *one));
        }
    }
    Ok(commands)
}

/// Returns the targets of CANopen drives from these samples on.
fn targets(recording: &Recording, spec: &Cia402Spec) -> Result<BTreeMap<u64, Load>, ReplayError> {
    let mut targets = Targets::new(spec);
    let mut commands = BTreeMap::new();
    for record in recording.frames()? {
        let record = record?;
        if !targets.hear(&record.frame).is_empty() && record.direction == Direction::Received {
            commands.insert(record.sample, targets.load());
        }
    }
    Ok(commands)
}

/// Largest relative rounding of a signal that is a 32-bit float: half of its last bit, 2⁻²⁴.
const FLOAT_SHARE: f64 = 0.5 * f32::EPSILON as f64;

/// Returns half the largest count of all loads, N or N·m, with the rounding of its arithmetic.
fn half_count(mapping: &Mapping) -> f64 {
    let signals = mapping.incoming.iter().flat_map(|message| &message.commands);
    let counts = signals.map(|command| command.signal.signal.resolution().unwrap_or(0.0) * command.scale.abs());
    with_rounding(0.5 * counts.fold(0.0, f64::max))
}

fn with_rounding(half: f64) -> f64 {
    half * (1.0 + 1e-6) + 1e-9
}

fn measurement(index: u64, sample: &SampleRecord) -> Measurement {
    let pair = |values: [f64; 2], clipped: [bool; 2]| {
        [Reading { value: values[0], clipped: clipped[0] }, Reading { value: values[1], clipped: clipped[1] }]
    };
    Measurement {
        sample: index,
        head_force_n: pair(sample.head_force_n, sample.clipped.head_force),
        acceleration_b_m_s2: pair(sample.acceleration_b_m_s2, sample.clipped.acceleration_b),
        acceleration_c_m_s2: pair(sample.acceleration_c_m_s2, sample.clipped.acceleration_c),
        more: sample.more,
    }
}

#[cfg(test)]
#[path = "wire_responses_tests.rs"]
mod tests;
