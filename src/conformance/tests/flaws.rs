//! Nodes with one flaw each: what they hear and say is altered. Which cases fail them stands in a table.

use super::super::damage::protect;
use super::super::*;
use super::device::{Device, ExciterDevice, PlantDevice, RATE_HZ};
use super::{findings, findings_in};
use crate::arm::Load;
use crate::protocol::{
    Cycle, Emergency, Frame, Heartbeat, Hello, Id, Message, MessageKind, NodeState, OperatorCommand, Profile,
    StateEvent,
};

/// What a node does wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flaw {
    /// Takes frames with a wrong CRC.
    IgnoresCrc,
    /// Takes any counter.
    IgnoresCounters,
    /// Says its state only when it changes.
    NoHeartbeats,
    /// Lets go at once in place of the ramp.
    NoRamp,
    /// Commands act when it is not armed.
    ActsUnarmed,
    /// Waits for its partner for ever.
    NoTimeout,
    /// Waits for its partner for twice as long as it must.
    SlowTimeout,
    /// Cuts commands that are too large.
    Cuts,
    /// Takes any change of the load.
    Jumps,
    /// Takes any travel.
    Strays,
    /// Its hello has another hash.
    WrongHash,
    /// Believes in any hello, and in one that was never sent.
    BelievesHellos,
    /// Arms out of a fault.
    NoLatch,
    /// Doesn't hear its partner's emergencies: that it leaves, and why it faults.
    DeafToLeaving,
    /// Doesn't hear a second sender of its messages.
    DeafToItself,
    /// Doesn't hear what its partner's state is, but for operational.
    DeafToStates,
    /// Answers the next sample.
    AnswersNext,
    /// Answers the sample before.
    AnswersLast,
    /// Sets its counters at random.
    LosesCount,
    /// Says nothing more when its partner faults.
    Dies,
    /// Hears nothing from a frame of another network to its second tick after it.
    Distracted,
    /// Hears no command and no sample any more after 200 that it refused.
    Clogs,
    /// Numbers every other pair of samples before the one that it comes after.
    SwapsPairs,
    /// Answers the first sample of a pair.
    AnswersFirst,
    /// Says nothing of it that it lost the bus.
    HidesBusLoss,
    /// Doesn't mark readings that were clipped.
    HidesClipping,
    /// Doesn't hear samples with readings that were clipped.
    DeafToClipping,
    /// In lockstep: goes on without an answer.
    RunsOn,
    /// In lockstep: takes any command for the answer.
    TakesOthers,
    /// In lockstep: waits no longer than in real time.
    Impatient,
}

/// What a node has heard that a flaw depends on.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ears {
    distracted_ticks: u8,
    refused: u32,
    has_heard_pair: bool,
}

impl Ears {
    /// At the next tick.
    pub fn rested(self) -> Ears {
        Ears { distracted_ticks: self.distracted_ticks.saturating_sub(1), ..self }
    }

    /// Whether the flaw has the node miss this frame.
    fn misses(&mut self, flaw: Option<Flaw>, network: Network, frame: &Frame) -> bool {
        let (kind, message) = (kind(network, frame), read(network, frame));
        let is_of_samples = kind.is_some_and(|kind| kind.cycle() == Cycle::Sample);
        if matches!(frame.id(), Id::Standard(_)) && kind.is_none() {
            self.distracted_ticks = 2;
        }
        self.refused += u32::from(is_of_samples && message.is_none());
        self.has_heard_pair |= kind == Some(MessageKind::SensorPair);
        match flaw {
            Some(Flaw::Distracted) => self.distracted_ticks > 0,
            Some(Flaw::Clogs) => is_of_samples && self.refused > 200,
            _ => false,
        }
    }
}

#[test]
fn a_plant_with_a_flaw_is_failed_by_the_cases_for_it() {
    let starved = [
        "plant-wrong-crc",
        "plant-repeated-counter",
        "plant-counter-jump",
        "plant-data-id",
        "plant-other-format",
        "plant-length",
        "plant-extended-id",
        "plant-reserved-bit",
        "plant-not-available",
        "plant-old-command",
        "plant-early-command",
        "plant-same-sample",
        "plant-too-large",
        "plant-too-fast",
        "plant-command-timeout",
        "plant-load-wrong-crc",
    ];
    let table: [(Flaw, &[&str]); 19] = [
        (Flaw::IgnoresCrc, &["plant-wrong-crc", "plant-data-id", "plant-load-wrong-crc", "plant-soak"]),
        (Flaw::IgnoresCounters, &["plant-repeated-counter", "plant-counter-jump", "plant-soak"]),
        (Flaw::NoHeartbeats, &["plant-heartbeats"]),
        (Flaw::NoRamp, &["plant-command-timeout", "plant-disarm"]),
        (Flaw::ActsUnarmed, &["plant-not-armed", "plant-disarm", "plant-too-far"]),
        (Flaw::NoTimeout, &starved),
        (Flaw::Cuts, &["plant-too-large", "plant-too-fast", "plant-too-far"]),
        (Flaw::Jumps, &["plant-too-fast"]),
        (Flaw::Strays, &["plant-too-far"]),
        (Flaw::WrongHash, &["plant-hello", "plant-load-hello"]),
        (Flaw::BelievesHellos, &["plant-arms-for-a-hello", "plant-exciter-leaves"]),
        (Flaw::NoLatch, &["plant-states", "plant-load-states"]),
        (Flaw::DeafToLeaving, &["plant-exciter-leaves"]),
        (Flaw::DeafToItself, &["plant-second-sender"]),
        (Flaw::LosesCount, &["plant-frames", "plant-soak"]),
        (Flaw::Distracted, &["plant-load-wrong-crc", "plant-load-states"]),
        (Flaw::Clogs, &["plant-soak"]),
        (Flaw::HidesBusLoss, &["plant-bus-off"]),
        (Flaw::HidesClipping, &["plant-saturation"]),
    ];
    let network = Network::default();
    let found = table.map(|(flaw, _)| {
        let plant = || Box::new(PlantDevice::with(network, Some(flaw))) as Box<dyn Device>;
        (flaw, failed(&findings(Node::Plant, network, plant)))
    });
    assert_eq!(found, table.map(|(flaw, expected)| (flaw, expected.to_vec())));
}

#[test]
fn a_node_with_a_flaw_in_two_samples_a_frame_is_failed_by_the_case_for_it() {
    let network = Network::default().with_profile(Profile::Fd);
    let plant = || Box::new(PlantDevice::with(network, Some(Flaw::SwapsPairs))) as Box<dyn Device>;
    assert_eq!(failed(&findings(Node::Plant, network, plant)), ["plant-pairs"]);
    let exciter = || Box::new(ExciterDevice::with(network, Some(Flaw::AnswersFirst))) as Box<dyn Device>;
    assert_eq!(failed(&findings(Node::Exciter, network, exciter)), ["exciter-pairs"]);
}

#[test]
fn an_exciter_with_a_flaw_is_failed_by_the_cases_for_it() {
    // The first good sample is answered as the last bad one.
    let answers_last = [
        "exciter-answers",
        "exciter-incomplete",
        "exciter-wrong-crc",
        "exciter-repeated-counter",
        "exciter-data-id",
        "exciter-not-available",
        "exciter-load-wrong-crc",
        "exciter-soak",
    ];
    let deaf_to_states =
        ["exciter-plant-faults", "exciter-plant-boots", "exciter-plant-disarmed", "exciter-load-plant-disarmed"];
    let table: [(Flaw, &[&str]); 15] = [
        (Flaw::IgnoresCrc, &["exciter-wrong-crc", "exciter-data-id", "exciter-load-wrong-crc", "exciter-soak"]),
        (Flaw::NoHeartbeats, &["exciter-heartbeats"]),
        (Flaw::NoTimeout, &["exciter-sensor-timeout"]),
        (Flaw::WrongHash, &["exciter-hello", "exciter-load-hello"]),
        (Flaw::BelievesHellos, &["exciter-begins-for-a-hello"]),
        (Flaw::DeafToStates, &deaf_to_states),
        (Flaw::DeafToLeaving, &["exciter-plant-leaves"]),
        (Flaw::DeafToItself, &["exciter-second-sender"]),
        (Flaw::Dies, &["exciter-plant-faults"]),
        (Flaw::Distracted, &["exciter-load-wrong-crc", "exciter-load-plant-disarmed"]),
        (Flaw::Clogs, &["exciter-soak"]),
        (Flaw::HidesBusLoss, &["exciter-bus-off"]),
        (Flaw::DeafToClipping, &["exciter-saturation"]),
        (Flaw::AnswersNext, &["exciter-answers", "exciter-soak"]),
        (Flaw::AnswersLast, &answers_last),
    ];
    let network = Network::default();
    let found = table.map(|(flaw, _)| {
        let exciter = || Box::new(ExciterDevice::with(network, Some(flaw))) as Box<dyn Device>;
        (flaw, failed(&findings(Node::Exciter, network, exciter)))
    });
    assert_eq!(found, table.map(|(flaw, expected)| (flaw, expected.to_vec())));
}

#[test]
fn a_node_with_a_flaw_in_lockstep_is_failed_by_the_cases_for_it() {
    let network = Network::default();
    let plants: [(Flaw, &[&str]); 5] = [
        (Flaw::NoHeartbeats, &["lockstep-plant-heartbeats"]),
        (Flaw::DeafToLeaving, &["lockstep-plant-refused"]),
        (Flaw::RunsOn, &["lockstep-plant-waits", "lockstep-plant-other-samples"]),
        (Flaw::TakesOthers, &["lockstep-plant-other-samples", "lockstep-plant-refused"]),
        (Flaw::NoTimeout, &["lockstep-plant-timeout"]),
    ];
    for (flaw, expected) in plants {
        let plant = || Box::new(PlantDevice::in_mode(Mode::Lockstep, network, Some(flaw))) as Box<dyn Device>;
        assert_eq!(failed(&findings_in(Mode::Lockstep, Node::Plant, network, plant)), expected, "{flaw:?}");
    }
    let exciters: [(Flaw, &[&str]); 4] = [
        (Flaw::NoHeartbeats, &["lockstep-exciter-heartbeats"]),
        (Flaw::AnswersNext, &["lockstep-exciter-answers"]),
        (Flaw::Impatient, &["lockstep-exciter-waits", "lockstep-exciter-timeout"]),
        (Flaw::NoTimeout, &["lockstep-exciter-timeout"]),
    ];
    for (flaw, expected) in exciters {
        let exciter = || Box::new(ExciterDevice::in_mode(Mode::Lockstep, network, Some(flaw))) as Box<dyn Device>;
        assert_eq!(failed(&findings_in(Mode::Lockstep, Node::Exciter, network, exciter)), expected, "{flaw:?}");
    }
}

fn failed(found: &[(&'static str, Finding)]) -> Vec<&'static str> {
    let is_failed = |finding: &Finding| matches!(finding.verdict, Verdict::Failed(_));
    found.iter().filter(|(_, finding)| is_failed(finding)).map(|(id, _)| *id).collect()
}

/// A frame with other bytes, and the CRC for them.
fn rewritten(network: Network, frame: &Frame, change: impl Fn(&mut [u8])) -> Frame {
    let kind = MessageKind::from_id(network, frame.id()).unwrap();
    let mut data = frame.data().to_vec();
    change(&mut data);
    if let Some(data_id) = kind.data_id(network).filter(|_| matches!(data.len(), 8 | 16 | 32 | 64)) {
        protect(&mut data, data_id);
    }
    Frame::new(frame.id(), frame.format(), &data).unwrap()
}

/// Only frames that the protocol knows under 11 bits are altered.
fn kind(network: Network, frame: &Frame) -> Option<MessageKind> {
    MessageKind::from_id(network, frame.id()).filter(|_| matches!(frame.id(), Id::Standard(_)))
}

/// What a frame says, whatever its counter.
fn read(network: Network, frame: &Frame) -> Option<Message> {
    crate::protocol::Receiver::new(network).accept(frame).ok()?
}

/// A hello with a wrong bit in its hash.
fn hashed_wrongly(network: Network, frame: Frame) -> Frame {
    match kind(network, &frame) {
        Some(MessageKind::PlantHello | MessageKind::ExciterHello) => rewritten(network, &frame, |data| data[3] ^= 1),
        _ => frame,
    }
}

fn says_nothing_new(frame: &Frame, network: Network, said: &mut Option<NodeState>) -> bool {
    let Some(Message::Heartbeat(Heartbeat { state, .. })) = read(network, frame) else { return false };
    said.replace(state) == Some(state)
}

fn tells_bus_loss(network: Network, frame: &Frame) -> bool {
    matches!(read(network, frame), Some(Message::Emergency(Emergency { code: EmergencyCode::BusLoss, .. })))
}

impl PlantDevice {
    /// What the node hears in place of a frame.
    pub fn alter_heard(&mut self, frame: &Frame) -> Vec<Frame> {
        let network = self.network;
        if self.ears.misses(self.flaw, network, frame) {
            return vec![];
        }
        let Some(kind) = kind(network, frame) else { return vec![*frame] };
        let message = read(network, frame);
        let frame = match (self.flaw, message) {
            (Some(Flaw::IgnoresCrc), _) if frame.len() == 8 => rewritten(network, frame, |_| {}),
            (Some(Flaw::IgnoresCounters), Some(_)) if kind.data_id(network).is_some() => {
                let counter = &mut self.counters[kind as usize];
                *counter = (*counter + 1) % 15;
                rewritten(network, frame, |data| data[1] = data[1] & 0xF0 | *counter)
            }
            (Some(Flaw::ActsUnarmed), Some(Message::Force(command))) if !self.node.is_armed() => {
                self.unarmed_load = Load::force_n(command.force_x_n, command.force_y_n);
                return vec![];
            }
            (Some(Flaw::Cuts), Some(Message::Force(command))) if command.force_x_n < -600.0 => {
                rewritten(network, frame, |data| data[2..4].copy_from_slice(&(-30_000_i16).to_le_bytes()))
            }
            (Some(Flaw::BelievesHellos), Some(Message::Operator(_) | Message::ExciterHello(_))) => {
                let hello = Message::ExciterHello(Hello::new(network.profile(), RATE_HZ));
                let hello = self.transmitter.frame(&hello).unwrap();
                return if kind == MessageKind::Operator { vec![hello, *frame] } else { vec![hello] };
            }
            (Some(Flaw::NoLatch), Some(Message::Operator(OperatorCommand { request, .. })))
                if request.event() == StateEvent::Arm && self.node.state() == NodeState::Fault =>
            {
                let reset = rewritten(network, frame, |data| data[2] = OperatorRequest::Reset as u8);
                return vec![reset];
            }
            (Some(Flaw::DeafToLeaving), Some(Message::Emergency(Emergency { .. }))) => return vec![],
            (Some(Flaw::TakesOthers), Some(Message::Force(_))) => {
                let sample = (self.sample as u16).wrapping_sub(1);
                rewritten(network, frame, |data| data[6..8].copy_from_slice(&sample.to_le_bytes()))
            }
            (Some(Flaw::DeafToItself), Some(message)) if message.kind().sender() == Node::Plant => return vec![],
            _ => *frame,
        };
        vec![frame]
    }

    pub fn alter_load(&self, load: Load) -> Load {
        match self.flaw {
            Some(Flaw::NoRamp) if !self.node.is_armed() => Load::default(),
            Some(Flaw::ActsUnarmed) if !self.node.is_armed() && !self.node.is_ramping() => self.unarmed_load,
            _ => load,
        }
    }

    /// What comes on the bus in place of a frame.
    pub fn alter_said(&mut self, frame: Frame) -> Option<Frame> {
        let network = self.network;
        match self.flaw {
            Some(Flaw::WrongHash) => Some(hashed_wrongly(network, frame)),
            Some(Flaw::NoHeartbeats) if says_nothing_new(&frame, network, &mut self.said_state) => None,
            Some(Flaw::LosesCount) if kind(network, &frame) == Some(MessageKind::AccelerometerB) => {
                Some(rewritten(network, &frame, |data| data[1] = data[1] & 0xF0 | (data[1] * 7 % 15) & 0x0F))
            }
            Some(Flaw::HidesBusLoss) if tells_bus_loss(network, &frame) => None,
            Some(Flaw::HidesClipping) if kind(network, &frame) == Some(MessageKind::AccelerometerB) => {
                Some(rewritten(network, &frame, |data| data[1] &= 0x0F))
            }
            Some(Flaw::SwapsPairs) if kind(network, &frame) == Some(MessageKind::SensorPair) => {
                Some(rewritten(network, &frame, |data| data[4] ^= 2))
            }
            _ => Some(frame),
        }
    }
}

impl ExciterDevice {
    pub fn alter_heard(&mut self, frame: &Frame) -> Option<Frame> {
        let network = self.network;
        if self.ears.misses(self.flaw, network, frame) {
            return None;
        }
        let Some(_) = kind(network, frame) else { return Some(*frame) };
        match (self.flaw, read(network, frame)) {
            (Some(Flaw::IgnoresCrc), _) if frame.len() == 8 => Some(rewritten(network, frame, |_| {})),
            (Some(Flaw::BelievesHellos), Some(Message::PlantHello(hello))) => {
                let own = Hello::new(Profile::Classic, hello.rate_hz);
                let hash = own.dbc_hash.to_le_bytes();
                Some(rewritten(network, frame, |data| data[3..6].copy_from_slice(&hash[..3])))
            }
            (Some(Flaw::Dies), Some(Message::Heartbeat(heartbeat))) => {
                self.is_dead |= heartbeat.state == NodeState::Fault;
                Some(*frame)
            }
            (Some(Flaw::DeafToStates), Some(Message::Heartbeat(heartbeat)))
                if heartbeat.state != NodeState::Operational =>
            {
                None
            }
            (Some(Flaw::DeafToLeaving), Some(Message::Emergency(_))) => None,
            (Some(Flaw::DeafToClipping), Some(Message::Head(head))) if head.x_saturated => None,
            (Some(Flaw::DeafToItself), Some(message)) if message.kind().sender() == Node::Exciter => None,
            _ => Some(*frame),
        }
    }

    pub fn alter_said(&mut self, frame: Frame) -> Option<Frame> {
        let network = self.network;
        let by = match self.flaw {
            Some(Flaw::Dies) if self.is_dead => return None,
            Some(Flaw::HidesBusLoss) if tells_bus_loss(network, &frame) => return None,
            Some(Flaw::WrongHash) => return Some(hashed_wrongly(network, frame)),
            Some(Flaw::NoHeartbeats) if says_nothing_new(&frame, network, &mut self.said_state) => return None,
            Some(Flaw::AnswersNext) => 1,
            Some(Flaw::AnswersFirst) if self.ears.has_heard_pair => u16::MAX,
            Some(Flaw::AnswersLast) => u16::MAX,
            _ => return Some(frame),
        };
        match read(network, &frame) {
            Some(Message::Force(command)) => Some(rewritten(network, &frame, |data| {
                let at = if data.len() == 8 { 6 } else { 4 };
                data[at..at + 2].copy_from_slice(&command.sample.wrapping_add(by).to_le_bytes());
            })),
            _ => Some(frame),
        }
    }
}
