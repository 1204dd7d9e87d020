//! Nodes with one flaw each: the frames they hear and send are altered.

use std::collections::VecDeque;

use super::super::damage::protect;
use super::device::{ExciterDevice, PlantDevice, RATE_HZ};
use resonarm_bench::node::PlantInterface;
use resonarm_bench::rig::Load;
use resonarm_protocol::{
    Acceleration, Cycle, Emergency, EmergencyCode, ForceCommand, Frame, FrameFormat, Heartbeat, Hello, Id,
    ImpedanceHead, Message, MessageKind, Network, Node, NodeState, OperatorCommand, OperatorRequest, Profile,
    StateEvent, Transmitter,
};

/// A flaw of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flaw {
    /// Accepts frames with a wrong CRC.
    IgnoresCrc,
    /// The node accepts any counter.
    IgnoresCounters,
    /// Sends its state only when it changes.
    NoHeartbeats,
    /// Drops the load at once instead of ramping it down.
    NoRamp,
    /// Commands act when it is not armed.
    ActsUnarmed,
    /// Waits for its partner forever.
    NoTimeout,
    /// Waits for its partner for twice as long as it must.
    SlowTimeout,
    /// Clips commands that are too large.
    Cuts,
    /// Accepts any change of the load.
    Jumps,
    /// The plant accepts any travel.
    Strays,
    /// The hello has another hash.
    WrongHash,
    /// Accepts any hello, and one that was never sent.
    BelievesHellos,
    /// Arms when in fault.
    NoLatch,
    /// Ignores that its partner leaves.
    DeafToLeaving,
    /// Ignores a second sender of its messages.
    DeafToItself,
    /// Ignores all states of its partner but operational.
    DeafToStates,
    /// Answers the next sample.
    AnswersNext,
    /// Answers the sample before.
    AnswersLast,
    /// Sets its counters at random.
    LosesCount,
    /// Goes silent when its partner faults.
    Dies,
    /// Ignores everything from a frame of another network until its second tick after it.
    Distracted,
    /// Ignores commands and samples after it has rejected 200.
    Clogs,
    /// Swaps the indices of every two successive pairs of samples.
    SwapsPairs,
    /// Answers the first sample of a pair.
    AnswersFirst,
    /// Doesn't report that it lost the bus.
    HidesBusLoss,
    /// Doesn't mark clipped readings.
    HidesClipping,
    /// Ignores samples with clipped readings.
    DeafToClipping,
    /// The counter of each message steps by so many.
    StepsBy(u8),
    /// All messages have one counter.
    OneCounter,
    /// Takes commands for samples older than the one answered last.
    TakesOlder,
    /// Sends the heartbeat of a state 80 ms late.
    Late(NodeState),
    /// Accepts the frames of any base.
    AnyBase,
    /// The plant ignores a reset.
    IgnoresReset,
    /// Counts the time in which it was stopped as time listened.
    CountsWallClock,
    /// Accepts commands beyond the limits that it states.
    ForgetsLimits,
    /// Commands more than it states.
    BeyondLimits,
    /// Answers a sample when accelerometer C comes, even if it is incomplete.
    AnswersC,
    /// Answers a sample when the head comes.
    AnswersHead,
    /// Never says that it leaves.
    NeverLeaves,
    /// Doesn't say that it leaves after a fault.
    LeavesUnfaulted,
    /// Commands forces without the factor of their counts.
    Unscaled,
    /// Commands forces with their bytes in reverse order.
    Swapped,
    /// The exciter commands along y.
    OtherAxis,
    /// Commands the opposite of its sine.
    OppositeSign,
    /// The time base is fast by so many ppm.
    FastBy(u16),
    /// Clips its commands at so many newtons.
    ClipsAt(i16),
    /// Commands zero for three of four samples.
    MostlyZero,
    /// Leaves out every so-manieth answer.
    Skips(u64),
    /// Sends every heartbeat 31 times.
    FloodsHeartbeats,
    /// Answers each remote frame by a heartbeat.
    AnswersRemote,
    /// Asks for arming 3 s later.
    SlowToArm,
    /// Ignores the plant's emergencies, other than that it leaves.
    DeafToEmergencies,
    /// Once it has faulted, all its counters begin at 7.
    JumpsInFault,
    /// The CRC of its frames has a wrong polynomial.
    OtherPolynomial,
    /// The CRC of its frames has a wrong start value.
    OtherStart,
    /// The CRC of its frames has a wrong data id.
    OtherDataId,
    /// The plant continues without an answer in lockstep.
    RunsOn,
    /// The plant accepts any command as the answer in lockstep.
    TakesOthers,
    /// The plant waits in lockstep no longer than in real time.
    Impatient,
}

/// State of the frames received that a flaw needs.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReceiveState {
    distracted_ticks: u8,
    refused: u32,
    has_heard_pair: bool,
    /// The newest sample that a command answered.
    answered: Option<u16>,
}

/// State of the frames sent that a flaw needs.
#[derive(Clone, Debug, Default)]
pub struct SendState {
    pub now_ns: u64,
    last_state: Option<NodeState>,
    /// The state of its last heartbeat.
    state: Option<NodeState>,
    commands: u64,
    counters: [u8; MessageKind::COUNT],
    /// Delayed frames, with their times.
    late: VecDeque<(u64, Frame)>,
}

impl SendState {
    /// A delayed frame that is due.
    pub fn due(&mut self) -> Option<Frame> {
        let (at_ns, frame) = *self.late.front()?;
        (self.now_ns >= at_ns).then(|| self.late.pop_front()).flatten().map(|_| frame)
    }

    pub fn is_empty(&self) -> bool {
        self.late.is_empty()
    }

    /// Repeats the last heartbeat.
    fn say_state(&mut self, network: Network, node: Node) {
        let Some(state) = self.state else { return };
        let heartbeat = Message::Heartbeat(Heartbeat { node, state });
        self.late.push_back((self.now_ns, Transmitter::new(network).frame(&heartbeat).unwrap()));
    }

    /// The frame sent instead, for flaws of either node.
    fn alter(&mut self, flaw: Option<Flaw>, network: Network, frame: Frame) -> Option<Frame> {
        let Some(kind) = kind(network, &frame) else { return Some(frame) };
        let is_protected = kind.data_id(network).is_some();
        if let Some(Message::Heartbeat(Heartbeat { state, .. })) = read(network, &frame) {
            self.state = Some(state);
        }
        match flaw {
            Some(Flaw::FloodsHeartbeats) if !is_protected && self.state != Some(NodeState::BootUp) => {
                self.late.extend([(self.now_ns, frame); 30]);
                Some(frame)
            }
            Some(Flaw::SlowToArm) if kind == MessageKind::Operator && self.now_ns < 3_000_000_000 => None,
            Some(Flaw::JumpsInFault) if is_protected && self.state == Some(NodeState::Fault) => {
                Some(rewritten(network, &frame, |data| data[1] = data[1] & 0xF0 | ((data[1] + 7) % 15)))
            }

            Some(Flaw::StepsBy(by)) if is_protected => {
                let counter = self.counters[kind as usize];
                self.counters[kind as usize] = (counter + by) % 15;
                Some(rewritten(network, &frame, |data| data[1] = data[1] & 0xF0 | counter))
            }
            Some(Flaw::OneCounter) if is_protected => {
                let counter = self.counters[0];
                self.counters[0] = (counter + 1) % 15;
                Some(rewritten(network, &frame, |data| data[1] = data[1] & 0xF0 | counter))
            }
            Some(Flaw::Late(state)) if !is_protected => {
                let before = self.last_state;
                let is_late = !repeats_state(&frame, network, &mut self.last_state)
                    && self.last_state == Some(state)
                    && before.is_some_and(|before| before != NodeState::BootUp);
                if is_late {
                    self.late.push_back((self.now_ns + 80_000_000, frame));
                }
                (!is_late).then_some(frame)
            }
            Some(Flaw::OtherPolynomial) if is_protected => Some(with_crc(network, frame, 0x07, 0x00, 0)),
            Some(Flaw::OtherStart) if is_protected => Some(with_crc(network, frame, 0x1D, 0xFF, 0)),
            Some(Flaw::OtherDataId) if is_protected => Some(with_crc(network, frame, 0x1D, 0x00, 0x0100)),
            Some(Flaw::WrongHash) => Some(hashed_wrongly(network, frame)),
            Some(Flaw::NoHeartbeats) if repeats_state(&frame, network, &mut self.last_state) => None,
            Some(Flaw::HidesBusLoss) if reports_bus_loss(network, &frame) => None,
            _ => Some(frame),
        }
    }
}

/// A classical frame with a CRC of another polynomial, start value or data id.
fn with_crc(network: Network, frame: Frame, polynomial: u8, start: u8, data_id_bits: u16) -> Frame {
    let kind = MessageKind::from_id(network, frame.id()).unwrap();
    let mut data = frame.data().to_vec();
    let [low, high] = (kind.data_id(network).unwrap() ^ data_id_bits).to_le_bytes();
    let mut crc = start;
    for byte in [low, high].iter().chain(&data[1..]) {
        crc ^= byte;
        for _ in 0..8 {
            crc = if crc & 0x80 == 0 { crc << 1 } else { crc << 1 ^ polynomial };
        }
    }
    data[0] = crc;
    Frame::new(frame.id(), frame.format(), &data).unwrap()
}

/// The frame with its identifier at the base of the network, if it is at another.
fn rebased(network: Network, frame: &Frame) -> Frame {
    match frame.id() {
        Id::Standard(id) if (0x180..0x580).contains(&id) && id & 0xF < 12 => {
            Frame::new(Id::Standard(network.base() | id & 0xF), frame.format(), frame.data()).unwrap()
        }
        _ => *frame,
    }
}

impl ReceiveState {
    /// Returns the state at the next tick.
    pub fn rested(self) -> ReceiveState {
        ReceiveState { distracted_ticks: self.distracted_ticks.saturating_sub(1), ..self }
    }

    /// Whether the flaw has the node miss this frame.
    fn misses(&mut self, flaw: Option<Flaw>, network: Network, frame: &Frame) -> bool {
        let (kind, message) = (kind(network, frame), read(network, frame));
        let is_of_samples = kind.is_some_and(|kind| kind.cycle() == Cycle::Sample);
        if matches!(frame.id(), Id::Standard(_)) && kind.is_none() {
            self.distracted_ticks = 2;
        }
        self.refused += u32::from(is_of_samples && message.is_none());
        self.has_heard_pair |= matches!(message, Some(Message::SensorPair(_)));
        match flaw {
            Some(Flaw::Distracted) => self.distracted_ticks > 0,
            Some(Flaw::Clogs) => is_of_samples && self.refused > 200,
            _ => false,
        }
    }
}

/// A frame with other bytes, and the matching CRC.
fn rewritten(network: Network, frame: &Frame, change: impl Fn(&mut [u8])) -> Frame {
    let kind = MessageKind::from_id(network, frame.id()).unwrap();
    let mut data = frame.data().to_vec();
    change(&mut data);
    if let Some(data_id) = kind.data_id(network).filter(|_| matches!(data.len(), 8 | 16 | 32 | 64)) {
        protect(&mut data, data_id);
    }
    Frame::new(frame.id(), frame.format(), &data).unwrap()
}

/// A classical ForceCommand with another force along x, N.
fn forced(network: Network, frame: &Frame, force_x_n: f64) -> Frame {
    let count = (force_x_n * 50.0).round() as i16;
    rewritten(network, frame, |data| data[2..4].copy_from_slice(&count.to_le_bytes()))
}

/// The message of a frame; only known messages with 11-bit identifiers are altered.
fn kind(network: Network, frame: &Frame) -> Option<MessageKind> {
    MessageKind::from_id(network, frame.id()).filter(|_| matches!(frame.id(), Id::Standard(_)))
}

/// The message in a frame, whatever its counter.
fn read(network: Network, frame: &Frame) -> Option<Message> {
    resonarm_protocol::Receiver::new(network).accept(frame).ok()?
}

/// A hello with a wrong bit in its hash.
fn hashed_wrongly(network: Network, frame: Frame) -> Frame {
    match kind(network, &frame) {
        Some(MessageKind::PlantHello | MessageKind::ExciterHello) => rewritten(network, &frame, |data| data[3] ^= 1),
        _ => frame,
    }
}

fn repeats_state(frame: &Frame, network: Network, last: &mut Option<NodeState>) -> bool {
    let Some(Message::Heartbeat(Heartbeat { state, .. })) = read(network, frame) else { return false };
    last.replace(state) == Some(state)
}

fn reports_bus_loss(network: Network, frame: &Frame) -> bool {
    matches!(read(network, frame), Some(Message::Emergency(Emergency { code: EmergencyCode::BusLoss, .. })))
}

impl PlantDevice {
    /// The frames heard in place of a frame.
    pub fn alter_heard(&mut self, frame: &Frame) -> Vec<Frame> {
        let network = self.network;
        let frame = &if self.flaw == Some(Flaw::AnyBase) { rebased(network, frame) } else { *frame };
        if self.flaw == Some(Flaw::AnswersRemote) && frame.format() == FrameFormat::Remote {
            self.send_state.say_state(network, Node::Plant);
            return vec![];
        }
        if self.receive_state.misses(self.flaw, network, frame) {
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
            (Some(Flaw::IgnoresReset), Some(Message::Operator(command)))
                if command.request == OperatorRequest::Reset =>
            {
                return vec![];
            }
            (Some(Flaw::TakesOlder), Some(Message::Force(command))) => {
                let newest = (self.sample as u16).wrapping_sub(1);
                let is_old = |answered: u16| (1..0x8000).contains(&answered.wrapping_sub(command.sample));
                match self.receive_state.answered.filter(|answered| is_old(*answered)) {
                    Some(_) if newest.wrapping_sub(command.sample) <= 20 => {
                        rewritten(network, frame, |data| data[6..8].copy_from_slice(&newest.to_le_bytes()))
                    }
                    Some(_) => *frame,
                    None => {
                        self.receive_state.answered = Some(command.sample);
                        *frame
                    }
                }
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

    /// The frame sent instead.
    pub fn alter_sent(&mut self, frame: Frame) -> Option<Frame> {
        let network = self.network;
        match (self.flaw, kind(network, &frame)) {
            (Some(Flaw::LosesCount), Some(MessageKind::AccelerometerB)) => {
                Some(rewritten(network, &frame, |data| data[1] = data[1] & 0xF0 | (data[1] * 7 % 15) & 0x0F))
            }
            (Some(Flaw::HidesClipping), Some(MessageKind::AccelerometerB)) => {
                Some(rewritten(network, &frame, |data| data[1] &= 0x0F))
            }
            (Some(Flaw::SwapsPairs), Some(MessageKind::SensorPair)) => {
                Some(rewritten(network, &frame, |data| data[4] ^= 2))
            }
            (Some(Flaw::ForgetsLimits), Some(MessageKind::PlantCapabilities)) => {
                Some(rewritten(network, &frame, |data| data[8..12].copy_from_slice(&600_f32.to_le_bytes())))
            }
            _ => self.send_state.alter(self.flaw, network, frame),
        }
    }
}

impl ExciterDevice {
    /// The frames heard in place of a frame.
    pub fn alter_heard(&mut self, frame: &Frame) -> Vec<Frame> {
        let network = self.network;
        let frame = &if self.flaw == Some(Flaw::AnyBase) { rebased(network, frame) } else { *frame };
        if self.flaw == Some(Flaw::AnswersRemote) && frame.format() == FrameFormat::Remote {
            self.send_state.say_state(network, Node::Exciter);
            return vec![];
        }
        if self.receive_state.misses(self.flaw, network, frame) {
            return vec![];
        }
        let Some(_) = kind(network, frame) else { return vec![*frame] };
        match (self.flaw, read(network, frame)) {
            (Some(Flaw::IgnoresCrc), _) if frame.len() == 8 => vec![rewritten(network, frame, |_| {})],
            (Some(Flaw::BelievesHellos), Some(Message::PlantHello(hello))) => {
                let own = Hello::new(Profile::Classic, hello.rate_hz);
                let hash = own.dbc_hash.to_le_bytes();
                vec![rewritten(network, frame, |data| data[3..6].copy_from_slice(&hash[..3]))]
            }
            (Some(Flaw::Dies), Some(Message::Heartbeat(heartbeat))) => {
                self.is_dead |= heartbeat.state == NodeState::Fault;
                vec![*frame]
            }
            (Some(Flaw::DeafToStates), Some(Message::Heartbeat(heartbeat)))
                if heartbeat.state != NodeState::Operational =>
            {
                vec![]
            }
            (Some(Flaw::DeafToLeaving), Some(Message::Emergency(e))) if e.code == EmergencyCode::Leaving => vec![],
            (Some(Flaw::DeafToEmergencies), Some(Message::Emergency(e))) if e.code != EmergencyCode::Leaving => {
                vec![]
            }
            (Some(Flaw::DeafToClipping), Some(Message::Head(head))) if head.x_saturated => vec![],
            (Some(Flaw::DeafToItself), Some(message)) if message.kind().sender() == Node::Exciter => vec![],
            (Some(Flaw::AnswersC), Some(Message::Head(_) | Message::AccelerometerB(_))) => vec![],
            (Some(Flaw::AnswersC), Some(Message::AccelerometerC(c))) => self.whole(c.sample),
            (Some(Flaw::AnswersHead), Some(Message::AccelerometerB(_) | Message::AccelerometerC(_))) => vec![],
            (Some(Flaw::AnswersHead), Some(Message::Head(head))) => self.whole(head.sample),
            _ => vec![*frame],
        }
    }

    /// A complete sample at rest, as the node believes it heard it.
    fn whole(&mut self, sample: u16) -> Vec<Frame> {
        let (x_saturated, y_saturated) = (false, false);
        let head = ImpedanceHead { force_x_n: 0.0, force_y_n: 0.0, x_saturated, y_saturated, sample };
        let [acceleration_x_m_s2, acceleration_y_m_s2] = [0.0; 2];
        let at_rest = Acceleration { acceleration_x_m_s2, acceleration_y_m_s2, x_saturated, y_saturated, sample };
        let messages = [Message::Head(head), Message::AccelerometerB(at_rest), Message::AccelerometerC(at_rest)];
        messages.map(|message| self.transmitter.frame(&message).unwrap()).to_vec()
    }

    /// The frame sent instead.
    pub fn alter_sent(&mut self, frame: Frame) -> Option<Frame> {
        let network = self.network;
        if self.is_dead {
            return None;
        }
        match (self.flaw, read(network, &frame)) {
            (Some(Flaw::NeverLeaves), Some(Message::Emergency(e))) if e.code == EmergencyCode::Leaving => None,
            (Some(Flaw::LeavesUnfaulted), Some(Message::Emergency(e)))
                if e.code == EmergencyCode::Leaving && self.node.state() == NodeState::Fault =>
            {
                None
            }
            (Some(Flaw::BeyondLimits), Some(Message::Capabilities(_))) => {
                Some(rewritten(network, &frame, |data| data[8..12].copy_from_slice(&10_f32.to_le_bytes())))
            }
            (Some(Flaw::Skips(every)), Some(Message::Force(_))) => {
                self.send_state.commands += 1;
                (!self.send_state.commands.is_multiple_of(every)).then_some(frame)
            }
            (Some(_), Some(Message::Force(command))) => self.alter_command(frame, command),
            _ => self.send_state.alter(self.flaw, network, frame),
        }
    }

    fn alter_command(&mut self, frame: Frame, command: ForceCommand) -> Option<Frame> {
        let network = self.network;
        let by = match self.flaw {
            Some(Flaw::AnswersNext) => 1,
            Some(Flaw::AnswersFirst) if self.receive_state.has_heard_pair => u16::MAX,
            Some(Flaw::AnswersLast) => u16::MAX,
            Some(Flaw::Unscaled) => {
                let count = command.force_x_n.round() as i16;
                return Some(rewritten(network, &frame, |data| data[2..4].copy_from_slice(&count.to_le_bytes())));
            }
            Some(Flaw::OppositeSign) => return Some(forced(network, &frame, -command.force_x_n)),
            Some(Flaw::ClipsAt(end)) => {
                return Some(forced(network, &frame, command.force_x_n.clamp(-f64::from(end), f64::from(end))));
            }
            Some(Flaw::MostlyZero) if !command.sample.is_multiple_of(4) => {
                return Some(forced(network, &frame, 0.0));
            }
            Some(Flaw::Swapped) => return Some(rewritten(network, &frame, |data| data.swap(2, 3))),
            Some(Flaw::OtherAxis) => {
                return Some(rewritten(network, &frame, |data| {
                    data.copy_within(2..4, 4);
                    data[2..4].fill(0);
                }));
            }
            _ => return self.send_state.alter(self.flaw, network, frame),
        };
        Some(rewritten(network, &frame, |data| {
            let at = if data.len() == 8 { 6 } else { 4 };
            data[at..at + 2].copy_from_slice(&command.sample.wrapping_add(by).to_le_bytes());
        }))
    }
}
