//! Reads the responses of a recorded run's controller again, from the recorded frames.

use alloc::collections::BTreeMap;

use super::error::ReplayError;
use super::{wire_controller, wire_responses};
use resonarm_bench::control::ResponsePoint;
use resonarm_bench::node::{self, ExciterOutcome};
use resonarm_bench::rig::{Converter, Load, Readings};
use resonarm_files::recording::{Direction, Recording};
use resonarm_protocol::{Emergency, EmergencyCode, ForceCommand, Message, Receiver, TorqueCommand};
use resonarm_scenario::Scenario;

/// Returns the responses that the controller of the recording's scenario reads from the plant's frames, up to its end
/// or the first fault.
///
/// A controller is a function of the frames it receives. Given those of the recording, it makes the recorded commands
/// again, and reads the same responses. A differing command shows that another controller was recorded.
///
/// The same holds for a control on a user protocol. A controller that played the scenario's excitation there need not
/// be Resonarm's: its commands must be the excitation, within half a count of its signals, and the responses are then
/// read from the recorded readings.
///
/// # Errors
/// [`ReplayError::Command`] if another controller was recorded; [`ReplayError::Incompatible`] if the recorded plant
/// uses another version of the protocol. With a user protocol [`ReplayError::NoExcitation`] and
/// [`ReplayError::NoLoad`], [`ReplayError::WireLacks`] if it can't carry the control, and [`ReplayError::NoReadings`]
/// for a log without readings. [`ReplayError`] if the recording can't be read or its scenario has no controller.
pub fn responses(recording: &Recording) -> Result<Vec<ResponsePoint>, ReplayError> {
    Ok(timed_responses(recording)?.into_iter().map(|(_, response)| response).collect())
}

/// Returns the same responses, each with the sample at which it was read.
///
/// # Errors
/// As [`responses`].
pub fn timed_responses(recording: &Recording) -> Result<Vec<(u64, ResponsePoint)>, ReplayError> {
    let scenario = Scenario::from_configuration(recording.configuration())?;
    // An exciter in the plant's process corrects readings for the plant's converter, as does one that was told the
    // converter; any other corrects nothing. Its commands show which of them it was.
    let stated = scenario.network.plant_converter;
    match responses_reading(recording, &scenario, stated.unwrap_or(scenario.rig.converter)) {
        Err(corrected @ ReplayError::Command { .. }) if stated.is_none() => {
            match responses_reading(recording, &scenario, Converter::Unknown) {
                Err(ReplayError::Command { .. }) => Err(corrected),
                uncorrected => uncorrected,
            }
        }
        read => read,
    }
}

/// Returns the responses of a controller that corrects readings for this converter.
fn responses_reading(
    recording: &Recording,
    scenario: &Scenario,
    converter: Converter,
) -> Result<Vec<(u64, ResponsePoint)>, ReplayError> {
    match (&scenario.wire, &scenario.control) {
        (Some(_), Some(_)) => return wire_controller::timed_responses(recording, scenario, converter),
        (Some(_), None) => return wire_responses::timed_responses(recording, scenario),
        (None, _) => {}
    }
    let network = scenario.network()?;
    let mut made = Receiver::new(network);
    let mut recorded = Receiver::new(network);
    let controller = scenario.controller_reading(converter)?;
    let mut exciter = node::carry(network, scenario.wire_rate_hz()?, scenario.lockstep_timing()?, controller);
    // The recorded frames lack the same parts of a load as those made again.
    exciter.work_mut().controller.hand_over(&Readings::NONE);
    exciter.start(0);
    let mut responses = Vec::new();
    let mut commands = BTreeMap::new();
    for record in recording.frames()? {
        let record = record?;
        match record.direction {
            Direction::Sent => exciter.handle_frame(record.time_ns, &record.frame),
            Direction::Received => {
                let command = recorded.accept(&record.frame).ok().flatten().and_then(command);
                if let Some((wire_sample, got)) = command
                    && let Some(expected) = commands.get(&wire_sample).filter(|expected| **expected != got)
                {
                    return Err(ReplayError::command(record.sample, got, *expected));
                }
            }
        }
        if let Some(ExciterOutcome::Faulted(Emergency { code: EmergencyCode::Incompatible, detail, .. })) =
            exciter.outcome()
        {
            return Err(ReplayError::Incompatible { detail });
        }
        let read = core::iter::from_fn(|| exciter.work_mut().controller.poll_response());
        responses.extend(read.map(|response| (record.sample, response)));
        // Loads are kept by the sample that they answer, until the recorded command for it comes.
        while let Some(frame) = exciter.poll_transmit() {
            // The index of 16 bits goes round. By then the recorded command of the earlier sample has long come.
            commands.extend(made.accept(&frame).ok().flatten().and_then(command));
        }
    }
    Ok(responses)
}

/// Returns the 16-bit index of the sample that a command answers, and its load.
pub(super) fn command(message: Message) -> Option<(u16, Load)> {
    match message {
        Message::Force(ForceCommand { force_x_n, force_y_n, sample }) => {
            Some((sample, Load::force_n(force_x_n, force_y_n)))
        }
        Message::Torque(TorqueCommand { torque1_nm, torque2_nm, sample }) => {
            Some((sample, Load::torque_nm(torque1_nm, torque2_nm)))
        }
        _ => None,
    }
}
