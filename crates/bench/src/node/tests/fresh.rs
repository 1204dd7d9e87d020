//! No load acts that was not freshly commanded, on every protocol.
//!
//! A load that acts names the frame that commanded it: each command has a number of its own as its value. The frame must
//! be of the right form, received since the plant was armed last, for a PDO as it is set up now, and not older than the
//! timeout.
//!
//! `RESONARM_HOSTILE_FRAMES=1000000 cargo test -p resonarm-bench hostile_frames` sends so many on each protocol.

use super::*;
use crate::node::cia402::{Cia402Node, Cia402Spec, DriveSpec};
use crate::node::mapped::MappedNode;
use crate::node::mapped::mapping::{
    Action, Arming, CommandSignal, Counts, EventSignal, Incoming, LoadInput, Lockstep, MappedSignal, Mapping,
    Protection,
};
use crate::rig::GateSpec;
use crate::structure::States;
use resonarm_numeric::noise::Noise;
use resonarm_protocol::{FrameFormat, Heartbeat, Id};
use resonarm_wire::checksum::{DataId, Preset};
use resonarm_wire::counter::Counter;
use resonarm_wire::layout::{ByteOrder, Layout, Number};
use resonarm_wire::multiplex::Presence;
use resonarm_wire::signal::Signal;

/// Load for one unit of a command's number, N or N·m.
const UNIT: f64 = 0.1;
/// The timeout of commands on users' protocols.
const COMMAND_TIMEOUT_NS: u64 = 20 * TICK_NS;
const FD: FrameFormat = FrameFormat::Fd { bit_rate_switch: true, error_state_indicator: false };

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Protocol {
    Native,
    /// A force, enable and reset with counter and checksum, in real time.
    Mapped,
    /// A force of 2 bytes with enable in a message of 4, in lockstep by a SYNC message.
    MappedSync,
    /// Mode, state and torque in messages of their own.
    ODrive,
    /// One drive: RPDO 1 acts at once, RPDO 2 at SYNC.
    CanOpen,
}

const ALL: [Protocol; 5] =
    [Protocol::Native, Protocol::Mapped, Protocol::MappedSync, Protocol::ODrive, Protocol::CanOpen];

/// State of a command that was sent.
#[derive(Clone, Copy, Debug)]
struct Command {
    /// Whether it has the form of its message, and the plant was armed when it had been received.
    is_good: bool,
    arms: u32,
    leaves: u32,
    setups: u32,
    /// Whether SYNC took it over before the PDO was set up anew. It is the drive's target since then, which no later
    /// setup of the PDO revokes.
    is_taken: bool,
    sent_ns: u64,
}

/// A plant with what its controller has sent.
struct Plant {
    protocol: Protocol,
    node: Box<dyn PlantInterface>,
    now_ns: u64,
    sample: u64,
    held: i64,
    native: Transmitter,
    alive: u64,
    /// Commands by their numbers.
    commands: Vec<Option<Command>>,
    /// State of RPDO 2: how often it was set up, its object, and whether it is enabled.
    setups: u32,
    mapped: u16,
    is_enabled: bool,
    /// The mode of ODrive or the controlword, and how often it was changed.
    mode: u32,
    mode_sets: u32,
    /// The number of the command that waits for SYNC in RPDO 2.
    waiting: Option<usize>,
}

fn signal(start: u64, bits: u64, number: Number, scale: f64) -> MappedSignal {
    let layout = Layout::new(start, bits, ByteOrder::Intel, number, 8).unwrap();
    MappedSignal { signal: Signal::new(layout, scale, 0.0).unwrap(), presence: Presence::ALWAYS }
}

fn message(name: &str, id: u16, length: usize) -> Incoming {
    Incoming {
        name: name.into(),
        id: Id::Standard(id),
        format: FrameFormat::Classic,
        length,
        protection: Protection::default(),
        drive: 0,
        commands: Vec::new(),
        timeout_ns: COMMAND_TIMEOUT_NS,
        events: Vec::new(),
        is_sync: false,
    }
}

fn event(name: &str, signal: Option<MappedSignal>, actions: Vec<(f64, Action)>, required: Vec<f64>) -> EventSignal {
    EventSignal { name: name.into(), signal, counts: Counts::InEveryFrame, actions, required }
}

fn force(signal: MappedSignal, scale: f64) -> Vec<CommandSignal> {
    alloc::vec![CommandSignal { signal, scale, offset: 0.0, input: LoadInput::ForceX }]
}

fn protection() -> Protection {
    let counter = Layout::new(48, 4, ByteOrder::Intel, Number::Unsigned, 8).unwrap();
    let place = Layout::new(56, 8, ByteOrder::Intel, Number::Unsigned, 8).unwrap();
    let checksum = Preset::AutosarP1.checksum(place, Some(counter), &DataId::One(0x123), 8).unwrap();
    Protection { counter: Some(Counter::new(counter, 15).unwrap()), most_lost: 3, checksum: Some(checksum) }
}

/// Enable in bit 16 and reset in bit 17.
fn bits() -> Vec<EventSignal> {
    let bit = |bit| Some(signal(bit, 1, Number::Unsigned, 1.0));
    let enable = event("Enable", bit(16), alloc::vec![(1.0, Action::Arm), (0.0, Action::Disarm)], Vec::new());
    let reset = event("Reset", bit(17), alloc::vec![(1.0, Action::Reset)], Vec::new());
    alloc::vec![EventSignal { counts: Counts::OnChange, ..enable }, reset]
}

fn mapping(protocol: Protocol) -> Mapping {
    let counts = signal(0, 16, Number::Signed, UNIT);
    let drive =
        |length| Incoming { commands: force(counts.clone(), 1.0), events: bits(), ..message("Drive", 0x100, length) };
    let (incoming, lockstep) = match protocol {
        Protocol::MappedSync => {
            (alloc::vec![Incoming { is_sync: true, ..message("Sync", 0x80, 0) }, drive(4)], Lockstep::Sync)
        }
        Protocol::ODrive => {
            let number = |start| Some(signal(start, 32, Number::Unsigned, 1.0));
            let states = alloc::vec![(8.0, Action::Arm), (1.0, Action::Disarm)];
            let modes = [("Control_Mode", 0), ("Input_Mode", 32)]
                .map(|(name, start)| event(name, number(start), Vec::new(), alloc::vec![1.0]));
            let on_frame = |action| alloc::vec![event("", None, alloc::vec![(0.0, action)], Vec::new())];
            let torque = signal(0, 32, Number::Float, 1.0);
            let messages = alloc::vec![
                Incoming { events: on_frame(Action::Stop), ..message("Estop", 0x02, 0) },
                Incoming {
                    events: alloc::vec![event("Axis_Requested_State", number(0), states, Vec::new())],
                    ..message("Set_Axis_State", 0x07, 8)
                },
                Incoming { events: modes.into(), ..message("Set_Controller_Mode", 0x0B, 8) },
                Incoming { commands: force(torque, 1.0), ..message("Set_Input_Torque", 0x0E, 8) },
                Incoming { events: on_frame(Action::Reset), ..message("Clear_Errors", 0x18, 8) },
            ];
            (messages, Lockstep::Command)
        }
        _ => (alloc::vec![Incoming { protection: protection(), ..drive(8) }], Lockstep::Command),
    };
    Mapping { incoming, outgoing: Vec::new(), arming: Arming::Message, lockstep }
}

fn node(protocol: Protocol) -> Box<dyn PlantInterface> {
    let (exciter, limits) = (Exciter::default(), GateSpec::default());
    let rate = (RATE_HZ, if protocol == Protocol::MappedSync { TimeBase::Lockstep } else { TimeBase::Clock });
    match protocol {
        Protocol::Native => Box::new(plant_node()),
        Protocol::CanOpen => {
            let drive = DriveSpec {
                node_id: 1,
                joint: 0,
                gear_ratio: 100.0,
                rated_torque_mnm: 1000,
                encoder_counts_per_turn: 65536,
            };
            let spec = Cia402Spec { drives: alloc::vec![drive], timeout_ns: COMMAND_TIMEOUT_NS };
            Box::new(Cia402Node::new(&spec, rate, Timing::real_time(RATE_HZ), exciter, limits))
        }
        Protocol::MappedSync => {
            let timing = Timing { command_timeout_ns: COMMAND_TIMEOUT_NS, ..Timing::lockstep(COMMAND_TIMEOUT_NS) };
            Box::new(MappedNode::new(mapping(protocol), rate, timing, exciter, limits))
        }
        Protocol::Mapped | Protocol::ODrive => {
            Box::new(MappedNode::new(mapping(protocol), rate, Timing::real_time(RATE_HZ), exciter, limits))
        }
    }
}

impl Plant {
    fn new(protocol: Protocol) -> Plant {
        let mut node = node(protocol);
        node.start(0);
        let mut plant = Plant {
            protocol,
            node,
            now_ns: 0,
            sample: 0,
            held: 0,
            native: Transmitter::new(Network::default()),
            alive: 0,
            commands: alloc::vec![None; 6001],
            setups: 0,
            mapped: 0,
            is_enabled: false,
            mode: 0,
            mode_sets: 0,
            waiting: None,
        };
        plant.publish();
        match protocol {
            Protocol::Native => {
                let hello = Message::ExciterHello(Hello::new(WireProfile::Classic, RATE_HZ));
                plant.send_native(&hello);
            }
            Protocol::CanOpen => {
                plant.send(0x000, &[1, 0]);
                plant.map(0x6071);
            }
            _ => {}
        }
        plant
    }

    fn take(&mut self, frame: &Frame) {
        self.node.handle_frame(self.now_ns, frame);
    }

    fn send(&mut self, id: u16, data: &[u8]) {
        self.take(&Frame::classic(Id::Standard(id), data).unwrap());
    }

    fn send_native(&mut self, message: &Message) {
        let frame = self.native.frame(message).unwrap();
        self.take(&frame);
    }

    /// Writes an object of the drive; whether it confirms that.
    fn write(&mut self, index: u16, subindex: u8, value: u32, bytes: u8) -> bool {
        let ([low, high], [a, b, c, d]) = (index.to_le_bytes(), value.to_le_bytes());
        self.send(0x601, &[0x23 | (4 - bytes) << 2, low, high, subindex, a, b, c, d]);
        let mut frames = Vec::new();
        self.node.waiting_frames(64, &mut frames);
        frames.iter().for_each(|_| self.node.frame_sent());
        let answer = frames.iter().find(|frame| frame.id() == Id::Standard(0x581)).unwrap();
        answer.data()[0] == 0x60
    }

    /// Disables RPDO 2, maps it to an object, and enables it as one that acts at SYNC.
    fn map(&mut self, index: u16) {
        let bits = if index == 0x6071 { 16 } else { 32 };
        for (parameter, subindex, value, bytes) in [
            (0x1401, 1, 0x8000_0301, 4),
            (0x1401, 2, 1, 1),
            (0x1601, 0, 0, 1),
            (0x1601, 1, u32::from(index) << 16 | bits, 4),
            (0x1601, 0, 1, 1),
            (0x1401, 1, 0x301, 4),
        ] {
            assert!(self.write(parameter, subindex, value, bytes), "{parameter:x}");
        }
        (self.setups, self.mapped, self.is_enabled) = (self.setups + 1, index, true);
    }

    /// Arms the plant, without a load.
    fn arm(&mut self) {
        match self.protocol {
            Protocol::Native => {
                self.send_native(&Message::Operator(OperatorCommand {
                    request: OperatorRequest::Arm,
                    target: NodeName::Plant,
                }));
            }
            Protocol::Mapped | Protocol::MappedSync => {
                for enable in [0, 1] {
                    let frame = self.drive(0, enable);
                    self.take(&frame);
                }
            }
            Protocol::ODrive => {
                self.set_mode(1);
                self.send(0x07, &[8, 0, 0, 0, 0, 0, 0, 0]);
            }
            Protocol::CanOpen => {
                self.write(0x6060, 0, 10, 1);
                [0x06, 0x07, 0x0F].into_iter().for_each(|word| self.set_mode(word));
            }
        }
    }

    /// Sets the mode of ODrive, or writes the controlword.
    fn set_mode(&mut self, mode: u32) {
        if self.protocol == Protocol::ODrive {
            self.send(0x0B, &[mode as u8, 0, 0, 0, 1, 0, 0, 0]);
        } else {
            self.write(0x6040, 0, mode, 2);
        }
        // A change of the drive's state shows in the counts of arms.
        self.mode_sets += u32::from(self.protocol == Protocol::ODrive && self.mode != mode);
        self.mode = mode;
    }

    fn reset(&mut self) {
        match self.protocol {
            Protocol::Native => {
                self.send_native(&Message::Operator(OperatorCommand {
                    request: OperatorRequest::Reset,
                    target: NodeName::Plant,
                }));
            }
            Protocol::Mapped | Protocol::MappedSync => {
                let frame = self.drive(0, 2);
                self.take(&frame);
            }
            Protocol::ODrive => self.send(0x18, &[0]),
            Protocol::CanOpen => {
                [0x00, 0x80].into_iter().for_each(|word| self.set_mode(word));
            }
        }
    }

    /// A frame of the message with a force, and enable in bit 0 and reset in bit 1 of `bits`.
    fn drive(&mut self, number: i16, bits: u8) -> Frame {
        let [low, high] = number.to_le_bytes();
        let id = Id::Standard(0x100);
        if self.protocol == Protocol::MappedSync {
            return Frame::classic(id, &[low, high, bits, 0]).unwrap();
        }
        self.alive = (self.alive + 1) % 15;
        let mut payload = [low, high, bits, 0, 0, 0, self.alive as u8, 0];
        protection().checksum.unwrap().write(id, &mut payload).unwrap();
        Frame::classic(id, &payload).unwrap()
    }

    /// The frame of a command with this number: by RPDO 2 of a drive.
    fn command(&mut self, number: i16) -> Frame {
        let load = f64::from(number) * UNIT;
        match self.protocol {
            Protocol::Native => {
                let sample = self.sample as u16;
                let message = Message::Force(ForceCommand { force_x_n: load, force_y_n: 0.0, sample });
                self.native.frame(&message).unwrap()
            }
            Protocol::Mapped | Protocol::MappedSync => self.drive(number, 1),
            Protocol::ODrive => {
                let [a, b, c, d] = (load as f32).to_le_bytes();
                Frame::classic(Id::Standard(0x0E), &[a, b, c, d]).unwrap()
            }
            Protocol::CanOpen => Frame::classic(Id::Standard(0x301), &number.to_le_bytes()).unwrap(),
        }
    }

    fn publish(&mut self) {
        self.sample += 1;
        let measurement = Measurement { sample: self.sample, ..Measurement::default() };
        let sample = PublishedSample {
            measurement: &measurement,
            states: &States::new(&[0.0; 4], &[]).unwrap(),
            travel_m: None,
        };
        self.node.publish(&sample).unwrap();
        let mut frames = Vec::new();
        self.node.waiting_frames(64, &mut frames);
        frames.iter().for_each(|_| self.node.frame_sent());
    }

    /// Sends SYNC where it answers a sample.
    fn sync(&mut self) {
        if matches!(self.protocol, Protocol::MappedSync | Protocol::CanOpen) {
            self.send(0x80, &[]);
        }
        if let Some(command) = self.waiting.take().and_then(|number| self.commands[number].as_mut()) {
            command.is_taken = command.setups == self.setups;
        }
    }

    /// A sample period; the number of the load that acts, and whether it ramps to zero.
    fn tick(&mut self, syncs: bool) -> (i64, bool) {
        self.now_ns += TICK_NS;
        if syncs {
            self.sync();
        }
        self.node.handle_deadline(self.now_ns);
        let load = self.node.load();
        let acts = load.force_n.x + load.torque_nm[0];
        let is_ramping = self.node.is_ramping() || (acts == 0.0 && !self.node.is_armed());
        self.publish();
        (libm::round(acts / UNIT) as i64, is_ramping)
    }

    /// The largest load that acts in the next samples, beside ramps.
    fn acted(&mut self) -> i64 {
        let mut largest = 0;
        for _ in 0..5 {
            let (load, is_ramping) = self.tick(true);
            if !is_ramping {
                largest = largest.max(load.abs());
            }
        }
        largest
    }
}

/// The frame in the format of CAN FD, with 8 bytes more.
fn as_fd(frame: &Frame) -> Frame {
    let mut data = frame.data().to_vec();
    data.resize(if data.len() + 8 > 12 { 16 } else { 12 }, 0);
    Frame::new(frame.id(), FD, &data).unwrap()
}

/// The frame without its last byte, or, where that is of no signal, with a byte more.
fn of_other_length(protocol: Protocol, frame: &Frame) -> Frame {
    let data = frame.data();
    match protocol {
        Protocol::MappedSync => Frame::classic(frame.id(), &[data, &[0]].concat()).unwrap(),
        _ => Frame::classic(frame.id(), &data[..data.len() - 1]).unwrap(),
    }
}

/// Commands that must not act, and the load that acted: none, on every protocol.
#[test]
fn nothing_acts_that_is_stale_malformed_or_from_before() {
    const KINDS: [&str; 6] = ["stale", "wrong format", "wrong length", "before arming", "after fault", "after remap"];
    for protocol in ALL {
        for kind in KINDS {
            let mut plant = Plant::new(protocol);
            if kind != "before arming" {
                plant.arm();
                assert!(plant.node.is_armed(), "{protocol:?}");
                plant.tick(true);
            }
            let frame = plant.command(300);
            match kind {
                "stale" => match protocol {
                    // It answers a sample of long ago.
                    Protocol::Native => {
                        for _ in 0..25 {
                            plant.tick(true);
                            let alive = Message::Heartbeat(Heartbeat {
                                node: NodeName::Exciter,
                                state: NodeState::Operational,
                            });
                            plant.send_native(&alive);
                            let zero = plant.command(0);
                            plant.take(&zero);
                        }
                        plant.take(&frame);
                    }
                    // Its counter is behind that of newer frames.
                    Protocol::Mapped => {
                        for _ in 0..2 {
                            let zero = plant.command(0);
                            plant.take(&zero);
                        }
                        plant.take(&frame);
                    }
                    // It waits for longer than the timeout; other targets keep the plant armed.
                    Protocol::MappedSync => {
                        plant.take(&frame);
                        for _ in 0..25 {
                            plant.tick(false);
                        }
                    }
                    Protocol::CanOpen => {
                        plant.take(&frame);
                        for _ in 0..25 {
                            plant.write(0x6071, 0, 0, 2);
                            plant.tick(false);
                        }
                        assert!(plant.node.is_armed());
                    }
                    // It was received in another mode.
                    Protocol::ODrive => {
                        plant.set_mode(3);
                        plant.take(&frame);
                        plant.set_mode(1);
                    }
                },
                "wrong format" => plant.take(&as_fd(&frame)),
                "wrong length" => plant.take(&of_other_length(protocol, &frame)),
                "before arming" => {
                    let is_mapped = matches!(protocol, Protocol::Mapped | Protocol::MappedSync);
                    let frame = if is_mapped { plant.drive(300, 0) } else { frame };
                    plant.take(&frame);
                    plant.arm();
                    assert!(plant.node.is_armed(), "{protocol:?}");
                }
                "after fault" => {
                    plant.take(&frame);
                    plant.node.fault(plant.now_ns, EmergencyCode::Overrun, 1);
                    // The drive's fault reaction ends with the next sample.
                    if protocol == Protocol::CanOpen {
                        plant.tick(false);
                    }
                    plant.reset();
                    plant.arm();
                    assert!(plant.node.is_armed(), "{protocol:?}");
                }
                _ if protocol == Protocol::CanOpen => {
                    plant.map(0x60FF);
                    plant.send(0x301, &[0x2C, 0x01, 0x2C, 0x01]);
                    plant.map(0x6071);
                }
                _ => {}
            }
            assert_eq!(plant.acted(), 0, "{protocol:?}: {kind}");
        }
    }
}

/// The commands of the test above act when nothing is wrong with them.
#[test]
fn a_fresh_command_acts() {
    for protocol in ALL {
        let mut plant = Plant::new(protocol);
        plant.arm();
        plant.tick(true);
        let frame = plant.command(300);
        plant.take(&frame);
        assert_eq!(plant.acted(), 300, "{protocol:?}");
    }
}

/// Nothing that waits acts on a PDO that is disabled.
#[test]
fn a_pdo_that_was_disabled_since_never_acts() {
    let mut plant = Plant::new(Protocol::CanOpen);
    plant.arm();
    let frame = plant.command(400);
    plant.take(&frame);
    assert!(plant.write(0x1401, 1, 0x8000_0301, 4));
    assert_eq!(plant.acted(), 0);
    assert_eq!(plant.node.refusals().count(Refusal::Late), 1, "it is counted");
}

/// A random number below `most`.
fn below(random: &mut Noise, most: u64) -> u64 {
    random.bits() % most
}

impl Plant {
    /// Sends a command with this number, perhaps of a wrong form, and remembers it.
    fn hostile_command(&mut self, random: &mut Noise, number: i16) {
        let (right, form) = (self.command(number), below(random, 8));
        let other = match form {
            0 => Some(as_fd(&right)),
            1 => Some(Frame::classic(right.id(), &right.data()[..right.data().len() - 1]).unwrap()),
            2 => Some(Frame::new(right.id(), FrameFormat::Remote, right.data()).unwrap()),
            3 => match right.id() {
                Id::Standard(id) => Some(Frame::classic(Id::Extended(id.into()), right.data()).unwrap()),
                Id::Extended(_) => None,
            },
            4 if self.protocol == Protocol::MappedSync => {
                Some(Frame::classic(right.id(), &[right.data(), &[0; 4]].concat()).unwrap())
            }
            _ => None,
        };
        // A byte less is right where the last byte is of no signal.
        let is_right = other.is_none() || (form == 1 && self.protocol == Protocol::MappedSync);
        self.take(&other.unwrap_or(right));
        let is_mapped = self.protocol != Protocol::CanOpen || (self.is_enabled && self.mapped == 0x6071);
        let (arms, leaves) = (self.node.core().arms(), self.node.core().leaves());
        let is_good = is_right && is_mapped && self.node.is_armed();
        let setups = self.setups + self.mode_sets;
        let command = Command { is_good, arms, leaves, setups, is_taken: false, sent_ns: self.now_ns };
        self.commands[number as usize] = Some(command);
        if is_right && self.protocol == Protocol::CanOpen {
            self.waiting = Some(number as usize);
        }
    }

    /// Something else that a controller, or nobody, sends.
    fn hostile_other(&mut self, random: &mut Noise) {
        match below(random, 10) {
            0..=2 => self.arm(),
            3 => self.reset(),
            4 => self.node.fault(self.now_ns, EmergencyCode::Overrun, 1),
            5 => self.sync(),
            6 if self.protocol == Protocol::CanOpen => match below(random, 4) {
                0 => {
                    let enabled = below(random, 2) == 0;
                    let word = if enabled { 0x301 } else { 0x8000_0301 };
                    if self.write(0x1401, 1, word, 4) {
                        (self.is_enabled, self.setups) = (enabled, self.setups + 1);
                    }
                }
                1 => self.map(0x60FF),
                _ => self.map(0x6071),
            },
            6 if self.protocol == Protocol::ODrive => {
                self.set_mode(1 + 2 * (below(random, 2) as u32));
            }
            7 if self.protocol == Protocol::CanOpen => {
                let word = [0x00, 0x06, 0x07, 0x0F, 0x10F][below(random, 5) as usize];
                self.set_mode(word);
            }
            8 => {
                let (id, data) = (below(random, 0x800) as u16, random.bits().to_le_bytes());
                let is_command = matches!(id, 0x201 | 0x301 | 0x401 | 0x501 | 0x601 | 0x0E | 0x100);
                // A remote frame may ask for anything.
                if !is_command && id != 0 {
                    self.send(id, &data[..below(random, 9) as usize]);
                }
            }
            _ if self.protocol == Protocol::Native => {
                let alive = Message::Heartbeat(Heartbeat { node: NodeName::Exciter, state: NodeState::Operational });
                self.send_native(&alive);
            }
            _ => {}
        }
    }

    /// A sample period, and who commanded the load that acts.
    fn hostile_tick(&mut self, syncs: bool) {
        let (load, is_ramping) = self.tick(syncs);
        if load != 0 && !is_ramping && load != self.held {
            assert!(self.node.is_armed(), "{:?}: {load}", self.protocol);
            let of = usize::try_from(load).ok().and_then(|number| self.commands.get(number).copied().flatten());
            let command = of.unwrap_or_else(|| panic!("{:?}: nobody commanded {load}", self.protocol));
            let (arms, leaves) = (self.node.core().arms(), self.node.core().leaves());
            let text = alloc::format!("{:?}: load {load} acts at {} ns, of {command:?}", self.protocol, self.now_ns);
            assert!(command.is_good, "{text}: it is malformed, or came before the plant was armed");
            assert_eq!((command.arms, command.leaves), (arms, leaves), "{text}: the plant was armed anew since");
            assert!(self.now_ns - command.sent_ns <= COMMAND_TIMEOUT_NS + TICK_NS, "{text}: it is old");
            let is_of_this_setup = command.is_taken || command.setups == self.setups + self.mode_sets;
            assert!(is_of_this_setup, "{text}: PDO or mode were set anew since");
        }
        self.held = load;
    }
}

#[test]
#[allow(clippy::print_stdout, reason = "whoever sends many wants to see what came of it")]
fn of_hostile_frames_none_acts_that_is_not_fresh() {
    let count = std::env::var("RESONARM_HOSTILE_FRAMES").ok().map(|count| count.parse::<u64>().unwrap());
    let count = count.unwrap_or(20_000);
    for (seed, protocol) in (1..).zip(ALL) {
        let (mut plant, mut random, mut acted) = (Plant::new(protocol), Noise::new(seed, 0), 0_u64);
        let mut number = 0;
        for _ in 0..count {
            if below(&mut random, 3) > 0 {
                number = number % 5000 + 1;
                plant.hostile_command(&mut random, number);
            } else {
                plant.hostile_other(&mut random);
            }
            if below(&mut random, 4) == 0 {
                let syncs = below(&mut random, 3) > 0;
                plant.hostile_tick(syncs);
                acted += u64::from(plant.held != 0 && plant.node.is_armed());
                while plant.node.poll_event().is_some() {}
            }
            // The controller is silent for a while.
            if below(&mut random, 400) == 0 {
                (0..60).for_each(|_| plant.hostile_tick(false));
            }
        }
        assert!(acted > count / 100, "{protocol:?}: good commands act: {acted}");
        std::println!(
            "{protocol:?}: {acted} samples with a load, all freshly commanded; {} arms",
            plant.node.core().arms()
        );
    }
}

/// Three hundred rejected frames before and behind an arm hide neither it nor its end.
#[test]
fn rejected_frames_hide_no_transition() {
    for protocol in ALL {
        let mut plant = Plant::new(protocol);
        let reject = |plant: &mut Plant| {
            for _ in 0..300 {
                match protocol {
                    Protocol::Native => plant.send(0x201, &[0; 8]),
                    Protocol::CanOpen => plant.send(0x201, &[0]),
                    Protocol::ODrive => plant.send(0x0E, &[0]),
                    Protocol::Mapped | Protocol::MappedSync => plant.send(0x100, &[0]),
                }
            }
        };
        reject(&mut plant);
        plant.arm();
        reject(&mut plant);
        assert_eq!((plant.node.core().arms(), plant.node.core().leaves()), (1, 0), "{protocol:?}");
        let refused = plant.node.frames().refused;
        assert_eq!(refused, 600, "{protocol:?}");
        plant.node.fault(plant.now_ns, EmergencyCode::Overrun, 1);
        reject(&mut plant);
        assert_eq!((plant.node.core().arms(), plant.node.core().leaves()), (1, 1), "{protocol:?}");
        let events: Vec<NodeEvent> = core::iter::from_fn(|| plant.node.poll_event()).collect();
        let to = |wanted| events.iter().any(|event| matches!(event, NodeEvent::State { to, .. } if *to == wanted));
        assert!(to(NodeState::Operational) && to(NodeState::Fault), "{protocol:?}: {events:?}");
        assert!(events.iter().any(|event| matches!(event, NodeEvent::Lost(lost) if *lost > 0)), "{protocol:?}");
    }
}

/// The same of the exciter; those of users' protocols are in the tests of their exciters.
#[test]
fn rejected_frames_hide_no_transition_of_the_exciter() {
    let mut plant = Transmitter::new(Network::default());
    let armed = Heartbeat { node: NodeName::Plant, state: NodeState::Operational };
    let hello = Message::PlantHello(Hello::new(WireProfile::Classic, RATE_HZ));
    let arming = [hello, Message::Heartbeat(armed)].map(|message| plant.frame(&message).unwrap());
    let rejected = Frame::classic(arming[0].id(), &[0; 8]).unwrap();
    check_that_rejected_frames_hide_no_transition(&mut exciter_node(1.0), &rejected, &arming);
}

/// The cause of the fault, by which the plant's controller is sent to the right place.
fn cause(mut plant: Plant, frame: &Frame) -> alloc::string::String {
    for _ in 0..30 {
        plant.take(frame);
        plant.tick(false);
    }
    let fault = plant.node.latched_fault().unwrap();
    assert_eq!(fault.code, EmergencyCode::CommandTimeout);
    alloc::string::ToString::to_string(&plant.node.fault_cause().unwrap())
}

/// Firmware that sends RPDO 1 with three bytes in place of four, or a torque before the mode.
#[test]
fn a_timeout_names_what_was_refused() {
    let mut plant = Plant::new(Protocol::CanOpen);
    plant.arm();
    let short = Frame::classic(Id::Standard(0x201), &[0x0F, 0x00, 0xC8]).unwrap();
    let said = cause(plant, &short);
    assert_eq!(
        said,
        "20 frames were rejected, the first of them 201#0F00C8: RPDO 1 needs 4 bytes, but the frame has fewer"
    );
    let mut plant = Plant::new(Protocol::ODrive);
    plant.send(0x07, &[8, 0, 0, 0, 0, 0, 0, 0]);
    let torque = plant.command(1);
    let said = cause(plant, &torque);
    assert_eq!(said, "20 commands came before Set_Controller_Mode had a required value, and were rejected");
    let mut plant = Plant::new(Protocol::Mapped);
    plant.arm();
    let other = Frame::classic(Id::Standard(0x100), &[0; 8]).unwrap();
    assert_eq!(
        cause(plant, &other),
        "20 frames were rejected, the first of them 100#0000000000000000: Drive: its checksum is wrong"
    );
}

/// An emergency stop that was asked for is no fault of the partner.
#[test]
fn a_stop_says_which_message_asked_for_it() {
    let mut plant = Plant::new(Protocol::ODrive);
    plant.arm();
    // Some senders pad it.
    plant.send(0x02, &[0; 8]);
    assert_eq!(plant.node.latched_fault().map(|fault| fault.code), Some(EmergencyCode::StopRequested));
    let said = |plant: &Plant| alloc::string::ToString::to_string(&plant.node.fault_cause().unwrap());
    assert_eq!(said(&plant), "stopped by Estop");
    let stop = event("EStop", Some(signal(8, 8, Number::Unsigned, 1.0)), alloc::vec![(1.0, Action::Stop)], Vec::new());
    let mut mapping = mapping(Protocol::Mapped);
    mapping.incoming.push(Incoming { events: alloc::vec![stop], ..message("PanelKeys", 0x300, 2) });
    let rate = (RATE_HZ, TimeBase::Clock);
    let node = MappedNode::new(mapping, rate, Timing::real_time(RATE_HZ), Exciter::default(), GateSpec::default());
    plant.node = Box::new(node);
    plant.node.start(0);
    plant.send(0x300, &[0, 1]);
    assert_eq!(said(&plant), "stopped by PanelKeys, EStop = 1");
}

/// A heartbeat that a drive watches.
#[test]
fn a_drive_whose_watched_heartbeat_is_lost_faults() {
    let mut plant = Plant::new(Protocol::CanOpen);
    assert!(plant.write(0x1016, 1, 0x0020_000A, 4));
    plant.arm();
    plant.send(0x720, &[5]);
    for _ in 0..9 {
        plant.write(0x6071, 0, 0, 2);
        plant.tick(false);
    }
    assert!(plant.node.is_armed());
    plant.tick(false);
    assert_eq!(plant.node.latched_fault().map(|fault| fault.code), Some(EmergencyCode::HeartbeatLost));
}
