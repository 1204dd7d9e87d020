//! Runs Resonarm's exciter again on a user protocol to read the responses of a recorded control.
//!
//! A controller is a function of the frames that it receives. Given those that the recorded plant sent, it computes the
//! same loads again. On such a protocol commands name no sample, and a command that waited too long was replaced by the
//! next. So the recorded loads must be the computed ones, each once and in order, from the first that is not zero to
//! the end of the work.

use alloc::vec::Vec;

use super::error::ReplayError;
use resonarm_bench::control::ResponsePoint;
use resonarm_bench::node::mapped::mapping::Mapping;
use resonarm_bench::node::{ExciterInterface, TimeBase, WireSpec};
use resonarm_bench::rig::{Converter, Load};
use resonarm_files::recording::{Direction, Recording};
use resonarm_protocol::{Frame, NodeState};
use resonarm_scenario::Scenario;

/// Returns the responses, each with the sample at which it was read, of an exciter that corrects readings for this
/// converter.
///
/// # Errors
/// [`ReplayError::Command`] if another controller was recorded, [`ReplayError::NoLoad`] if no command has a load;
/// [`ReplayError::WireLacks`] if the protocol can't carry the control; [`ReplayError`] if the recording can't be read.
pub(super) fn timed_responses(
    recording: &Recording,
    scenario: &Scenario,
    converter: Converter,
) -> Result<Vec<(u64, ResponsePoint)>, ReplayError> {
    let Some(spec) = scenario.wire_spec()? else { return Err(ReplayError::NoLoad) };
    let rate = (scenario.wire_rate_hz()?, time_base(recording, scenario)?);
    let mut exciter = spec.exciter(rate, scenario.lockstep_timing()?, scenario.controller_reading(converter)?)?;
    // CANopen drives have no readings on which a control could be closed.
    let WireSpec::Mapped(mapping) = &spec else { return Err(ReplayError::NoLoad) };
    exciter.start(0);
    let armed_ns = armed_ns(recording)?;
    let mut loads = Loads::new(mapping);
    let mut responses = Vec::new();
    loads.make(exciter.as_mut());
    for record in recording.frames()? {
        let record = record?;
        match record.direction {
            // A plant in lockstep sends readings before it is armed. The recorded exciter did not answer them.
            Direction::Sent if rate.1 == TimeBase::Lockstep && record.time_ns < armed_ns => {}
            Direction::Sent => {
                exciter.handle_frame(record.time_ns, &record.frame);
                loads.make(exciter.as_mut());
            }
            Direction::Received => loads.compare(record.sample, &record.frame)?,
        }
        let read = core::iter::from_fn(|| exciter.carried_mut().poll_response());
        responses.extend(read.map(|response| (record.sample, response)));
        if exciter.outcome().is_some() {
            break;
        }
    }
    if loads.has_begun { Ok(responses) } else { Err(ReplayError::NoLoad) }
}

/// Returns the time at which the plant was armed for the first time, ns; 0 if the recording does not say it.
fn armed_ns(recording: &Recording) -> Result<u64, ReplayError> {
    for event in recording.events()? {
        let event = event?;
        if event.name == "state.operational" {
            return Ok(event.time_ns);
        }
    }
    Ok(0)
}

/// Finds how the recorded exciter answered samples: in lockstep, or by the clock.
fn time_base(recording: &Recording, scenario: &Scenario) -> Result<TimeBase, ReplayError> {
    let has_lockstep = scenario.wire.as_ref().is_some_and(|wire| wire.lockstep.is_some());
    let is_ideal = scenario.network.faults.is_empty() && scenario.timed_bus()?.is_none();
    Ok(match recording.configuration().get("run_loop") {
        Some("lockstep") => TimeBase::Lockstep,
        Some("free") if has_lockstep && is_ideal => TimeBase::Lockstep,
        _ => TimeBase::Clock,
    })
}

/// The computed loads of one message.
#[derive(Clone, Debug, Default)]
struct Made {
    loads: Vec<Load>,
    /// Number of them that the recording has reached or passed over.
    seen: usize,
}

/// Compares computed loads with the recorded ones.
struct Loads<'m> {
    mapping: &'m Mapping,
    /// Computed loads by the places of the messages.
    made: Vec<Made>,
    /// Whether a recorded load was one of the computed ones.
    has_begun: bool,
}

impl Loads<'_> {
    fn new(mapping: &Mapping) -> Loads<'_> {
        Loads { mapping, made: vec![Made::default(); mapping.incoming.len()], has_begun: false }
    }

    /// Collects the frames that the exciter would send.
    fn make(&mut self, exciter: &mut dyn ExciterInterface) {
        while let Some(frame) = exciter.next_frame() {
            exciter.frame_sent();
            if let (NodeState::Operational, Some((place, load))) = (exciter.state(), self.load(&frame)) {
                self.made[place].loads.push(load);
            }
        }
    }

    /// Compares a recorded frame: its load is the next computed one, or a later one if some were never sent.
    fn compare(&mut self, sample: u64, frame: &Frame) -> Result<(), ReplayError> {
        let Some((place, got)) = self.load(frame) else { return Ok(()) };
        let Made { loads, seen } = &mut self.made[place];
        let rest = &loads[*seen..];
        if let Some(ahead) = rest.iter().position(|made| *made == got) {
            *seen += ahead + 1;
            self.has_begun |= got != Load::default();
            return Ok(());
        }
        // A frame that arms or disarms the plant has no load.
        // The report names the load that was due, or if none is left, the last one.
        match rest.first().or(loads.last()) {
            _ if got == Load::default() => Ok(()),
            Some(expected) => Err(ReplayError::command(sample, got, *expected)),
            None => Err(ReplayError::command(sample, got, Load::default())),
        }
    }

    /// Returns the place of the message of a command, and its load.
    fn load(&self, frame: &Frame) -> Option<(usize, Load)> {
        let place = self.mapping.incoming.iter().position(|message| message.id == frame.id())?;
        let load = self.mapping.incoming[place].load(frame.data()).ok()??;
        Some((place, load))
    }
}
