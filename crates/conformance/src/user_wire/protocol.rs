//! A user protocol, with what the tester's end needs of its scenario.

use thiserror::Error;

use super::constant::Constant;
use crate::settings::Settings;
use crate::stop::{Stop, skipped};
use crate::times::{MARGIN_NS, MS, ms};
use crate::tries::Limits;
use resonarm_bench::node::mapped::mapping::{Arming, Incoming, LoadInput, Mapping, Outgoing, Trigger};
use resonarm_bench::node::{TimeBase, Timing, WireSpec};
use resonarm_bench::plant::Plant;
use resonarm_files::decoder::Decoder;
use resonarm_files::recording::Configuration;
use resonarm_protocol::{Frame, FrameFormat, Id, Node};
use resonarm_scenario::wire::PresetSpec;
use resonarm_scenario::{Scenario, ScenarioError};
use resonarm_session::run::{Mode, Options, RunError, Session};
use resonarm_wire::canopen::{EMERGENCY_BASE, HEARTBEAT_BASE, NMT_ID, SDO_ANSWER_BASE, SYNC_ID};

/// The longest time for which loads are valid that a case waits for, ns.
const LONGEST_WAIT_NS: u64 = 60_000 * MS;

/// A message that comes at least so often can be waited for, ns.
const FREQUENT_NS: u64 = 500 * MS;
/// Plus the node id: RPDO 1 of a drive.
pub(super) const COMMAND_BASE: u16 = 0x200;

/// Reason why no case can be run on a scenario's protocol.
#[derive(Debug, Error)]
pub enum UserWireError {
    /// The scenario has no protocol of its own.
    #[error(
        "the scenario has no [wire], so it maps no user protocol: leave the scenario out to test on Resonarm's protocol"
    )]
    NoWire,
    /// The scenario disturbs its network.
    #[error("the scenario has [[network.faults]], but the cases damage the frames themselves: leave them out")]
    Faults,
    /// The scenario can't be run.
    #[error(transparent)]
    Run(#[from] RunError),
}

impl From<ScenarioError> for UserWireError {
    fn from(error: ScenarioError) -> UserWireError {
        UserWireError::Run(error.into())
    }
}

/// A user protocol, with what the tester's end needs.
#[derive(Clone, Debug)]
pub struct UserWire {
    pub(super) scenario: Scenario,
    pub(super) tested: Node,
    pub(super) mode: Mode,
    /// Protocol of drives that comes with the program; `None` for messages of a DBC.
    pub(super) preset: Option<PresetSpec>,
    pub(super) spec: WireSpec,
    pub(super) rate_hz: u16,
    pub(super) timing: Timing,
    pub(super) plant: Plant,
    pub(super) decoder: Decoder,
}

impl UserWire {
    /// The protocol of a scenario, for cases about this node in this mode.
    ///
    /// # Errors
    /// [`UserWireError`] says why none can be run: also if no message arms or disarms the plant under test.
    pub fn new(scenario: Scenario, tested: Node, mode: Mode) -> Result<UserWire, UserWireError> {
        let (Some(section), Some(spec), Some(decoder)) =
            (&scenario.wire, scenario.wire_spec()?, Decoder::of_scenario(&scenario)?)
        else {
            return Err(UserWireError::NoWire);
        };
        if !scenario.network.faults.is_empty() {
            return Err(UserWireError::Faults);
        }
        let preset = section.preset;
        let _checked = Session::new(scenario.clone(), mode, Options::default())?;
        let timing = match mode {
            Mode::Lockstep => scenario.lockstep_timing()?,
            Mode::RealTime | Mode::Free => scenario.real_time_timing()?,
        };
        let rate_hz = scenario.wire_rate_hz()?;
        let tested_structure = scenario.under_test()?;
        let plant = Plant::new(&scenario.plant_spec(), &tested_structure).map_err(RunError::from)?;
        let wire = UserWire { tested, mode, preset, spec, rate_hz, timing, plant, decoder, scenario };
        // If the emulated exciter can't play on this protocol, that is said now and not within a case.
        if tested == Node::Plant {
            let (constant, _load) = Constant::new(wire.input());
            wire.spec.exciter(wire.rate(), timing, Box::new(constant)).map_err(RunError::from)?;
        }
        Ok(wire)
    }

    /// The scenario of the protocol.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// Describes, for a recording of the cases, how they were run: with it the frames can be explained.
    ///
    /// # Errors
    /// [`UserWireError`] if the scenario can't be written.
    pub fn configuration(&self, settings: Settings) -> Result<Configuration, UserWireError> {
        let beyond_n = settings.beyond_n.map_or_else(|| String::from("none"), |limit| limit.to_string());
        Ok(self
            .scenario
            .configuration(self.mode.name())?
            .with("conformance", self.tested)
            .with("force_n", settings.force_n)
            .with("torque_nm", settings.torque_nm)
            .with("beyond_n", beyond_n))
    }

    /// The mode of the node under test.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// The node under test.
    pub fn tested(&self) -> Node {
        self.tested
    }

    pub(super) fn rate(&self) -> (u16, TimeBase) {
        let base = if self.mode == Mode::Lockstep { TimeBase::Lockstep } else { TimeBase::Clock };
        (self.rate_hz, base)
    }

    pub(super) fn period_ns(&self) -> u64 {
        resonarm_protocol::timing::sample_period_ns(self.rate_hz)
    }

    pub(super) fn mapping(&self) -> Option<&Mapping> {
        match &self.spec {
            WireSpec::Mapped(mapping) => Some(mapping),
            WireSpec::Cia402(_) => None,
        }
    }

    pub(super) fn commands(&self) -> impl Iterator<Item = &Incoming> {
        let incoming = self.mapping().map_or(&[][..], |mapping| &mapping.incoming);
        incoming.iter().filter(|message| !message.commands.is_empty())
    }

    /// Whether a frame commands loads.
    pub(super) fn is_command(&self, frame: &Frame) -> bool {
        match &self.spec {
            WireSpec::Mapped(_) => self.commands().any(|message| message.id == frame.id()),
            WireSpec::Cia402(spec) => {
                spec.drives.iter().any(|drive| frame.id() == Id::Standard(COMMAND_BASE + u16::from(drive.node_id)))
            }
        }
    }

    /// Returns the period at which a message of the plant comes by itself, ns; `None` if it has to be asked for.
    pub(super) fn sent_every_ns(&self, message: &Outgoing) -> Option<u64> {
        match message.trigger {
            Trigger::Every(samples) => Some(samples.saturating_mul(self.period_ns())),
            Trigger::Period(period_ns) => Some(period_ns),
            // The emulated exciter synchronises every sample.
            Trigger::Sync => (self.tested == Node::Plant).then(|| self.period_ns()),
            Trigger::Request => None,
        }
    }

    /// The messages of the plant that come by themselves and so often that a case can wait for them.
    pub(super) fn frequent_readings(&self) -> impl Iterator<Item = &Outgoing> {
        let outgoing = self.mapping().map_or(&[][..], |mapping| &mapping.outgoing);
        outgoing.iter().filter(|message| self.sent_every_ns(message).is_some_and(|ns| ns <= FREQUENT_NS))
    }

    pub(super) fn arming(&self) -> Arming {
        self.mapping().map_or(Arming::Message, |mapping| mapping.arming)
    }

    /// The load that the cases command: the first of the mapping.
    pub(super) fn input(&self) -> LoadInput {
        let first = match &self.spec {
            WireSpec::Mapped(_) => {
                self.commands().flat_map(|message| &message.commands).map(|command| command.input).next()
            }
            WireSpec::Cia402(spec) => spec.drives.first().map(|drive| LoadInput::Torque(drive.joint)),
        };
        first.unwrap_or(LoadInput::ForceX)
    }

    /// Whether the load that the cases command is a torque.
    pub(super) fn commands_torque(&self) -> bool {
        matches!(self.input(), LoadInput::Torque(_))
    }

    /// Returns how long the loads of each message are valid, ns.
    pub(super) fn timeouts_ns(&self) -> Vec<u64> {
        match &self.spec {
            _ if self.mode == Mode::Lockstep => vec![self.timing.command_timeout_ns],
            WireSpec::Mapped(_) => self.commands().map(|message| message.timeout_ns).collect(),
            WireSpec::Cia402(spec) => vec![spec.timeout_ns],
        }
    }

    /// The shortest of them, after which a silent controller is a fault, ns.
    pub(super) fn timeout_ns(&self) -> u64 {
        self.timeouts_ns().into_iter().min().unwrap_or(0)
    }

    /// Skips a case that waits for the longest of them, which is returned, ns, if that is longer than a minute.
    pub(super) fn awaited_ns(&self) -> Result<u64, Stop> {
        match self.timeouts_ns().into_iter().max().unwrap_or(0) {
            longest_ns if longest_ns > LONGEST_WAIT_NS => {
                skipped(format!("loads are valid for {}: no case waits for longer than a minute", ms(longest_ns)))
            }
            longest_ns => Ok(longest_ns),
        }
    }

    /// The protocol as the tester's plant keeps it: loads are valid for longer, by how long a machine may hold a
    /// process up.
    pub(super) fn patient_spec(&self) -> WireSpec {
        let mut spec = self.spec.clone();
        match &mut spec {
            WireSpec::Mapped(mapping) => {
                mapping.incoming.iter_mut().for_each(|message| message.timeout_ns += MARGIN_NS)
            }
            WireSpec::Cia402(spec) => spec.timeout_ns += MARGIN_NS,
        }
        spec
    }

    /// Returns the node that sends frames like this; `None`: the protocol has no such message.
    pub(super) fn sender(&self, frame: &Frame) -> Option<Node> {
        let WireSpec::Mapped(mapping) = &self.spec else { return sender_on_canopen(frame) };
        if mapping.incoming.iter().any(|message| message.id == frame.id()) {
            return Some(Node::Exciter);
        }
        let message = mapping.outgoing.iter().find(|message| message.id == frame.id())?;
        let asks = message.is_on_request && (frame.format() == FrameFormat::Remote || frame.data().is_empty());
        Some(if asks { Node::Exciter } else { Node::Plant })
    }

    pub(super) fn limits(&self) -> Limits {
        match self.tested {
            // The silence of a controller decides nothing: it ends and is started again.
            Node::Exciter => Limits { held_up_ns: MARGIN_NS, silent_ns: u64::MAX },
            Node::Plant => {
                let readings_ns = self.frequent_readings().filter_map(|message| self.sent_every_ns(message));
                let silent_ns = readings_ns.min().unwrap_or(0) + MARGIN_NS;
                Limits { held_up_ns: MARGIN_NS.min(self.timeout_ns() / 4), silent_ns }
            }
        }
    }
}

/// Returns the sender by the identifiers of CiA 301's predefined connections; a master may give a PDO another.
fn sender_on_canopen(frame: &Frame) -> Option<Node> {
    let Id::Standard(id) = frame.id() else { return None };
    Some(match id & 0x780 {
        _ if frame.format() == FrameFormat::Remote => Node::Exciter,
        _ if id == NMT_ID || id == SYNC_ID => Node::Exciter,
        0x180 | 0x280 | 0x380 | 0x480 => Node::Plant,
        EMERGENCY_BASE | HEARTBEAT_BASE | SDO_ANSWER_BASE => Node::Plant,
        _ => Node::Exciter,
    })
}
