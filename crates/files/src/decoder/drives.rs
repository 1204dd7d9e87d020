//! Frames of CANopen drives explained (CiA 301, CiA 402-2).

use super::check::Fault;
use super::explained::{Decoded, DecodedMessage, DecodedSignal, Outcome};
use super::meaning::{Meaning, ObjectName};
use super::words;
use resonarm_bench::node::cia402::{Cia402Spec, DriveSpec};
use resonarm_bench::structure::{LOAD_NAMES, LOADS, joint_channel_name};
use resonarm_protocol::Frame;
use resonarm_wire::canopen::dictionary::{Address, Dictionary, Value, at};
use resonarm_wire::canopen::listen::{Content, Heard, Listener, Malformed, Part, Sdo};

/// Explains the frames between drives and their master.
#[derive(Clone, Debug)]
pub(super) struct Drives {
    drives: Vec<Drive>,
}

#[derive(Clone, Debug)]
struct Drive {
    spec: DriveSpec,
    listener: Listener,
}

impl Drives {
    /// Starts with drives that have just been reset.
    pub fn new(spec: &Cia402Spec) -> Drives {
        let drive = |spec: &DriveSpec| Drive { spec: *spec, listener: Listener::new(spec.node_id, spec.dictionary()) };
        Drives { drives: spec.drives.iter().map(drive).collect() }
    }

    /// Explains the next frame on the bus. If several drives accept it, as a master may map it, the explanation has the
    /// values of all.
    pub fn decode(&mut self, frame: &Frame) -> Decoded {
        let mut all: Option<DecodedMessage> = None;
        for drive in &mut self.drives {
            match (drive.explain(frame), &mut all) {
                (Decoded::Foreign, _) => {}
                (Decoded::Message(message), None) => all = Some(message),
                (Decoded::Message(message), Some(all)) => join(all, message),
                (request @ Decoded::Request { .. }, None) => return request,
                (Decoded::Request { .. }, Some(_)) => {}
            }
        }
        all.map_or(Decoded::Foreign, Decoded::Message)
    }
}

/// Adds a further drive's explanation of a frame, unless the frame is for all.
fn join(all: &mut DecodedMessage, other: DecodedMessage) {
    if all.message == other.message {
        return;
    }
    // Two drives may map the same frame differently, so every signal names the message that it belongs to.
    for signal in &mut all.signals {
        signal.name = format!("{} in {}", signal.name, all.message);
    }
    let of_other = other.signals.into_iter();
    all.signals.extend(
        of_other.map(|signal| DecodedSignal { name: format!("{} in {}", signal.name, other.message), ..signal }),
    );
    all.message = format!("{}, {}", all.message, other.message);
    all.means.extend(other.means);
    if let (Outcome::Taken { .. }, refused @ Outcome::Refused(_)) = (&all.outcome, other.outcome) {
        all.outcome = refused;
    }
}

impl Drive {
    fn explain(&mut self, frame: &Frame) -> Decoded {
        // Taken before the frame changes it: a command is given by the edges of the controlword, so the previous
        // value is needed.
        let before = self.listener.dictionary().number(at(0x6040, 0)) as u16;
        let node = self.spec.node_id;
        let (name, signals) = match self.listener.hear(frame) {
            Heard::Foreign => return Decoded::Foreign,
            Heard::PdoRequest { number, is_answered } => {
                return Decoded::Request { message: format!("TPDO {number} of node {node}"), is_answered };
            }
            Heard::Sdo(sdo) => return Decoded::Message(self.sdo(frame, before, &sdo)),
            Heard::Pdo { number, is_sent, values, missing } => {
                return Decoded::Message(self.pdo(frame, (number, is_sent), before, (&values, missing)));
            }
            Heard::Malformed { of, fault } => return Decoded::Message(self.malformed(frame, of, fault)),
            Heard::Sync(counter) => {
                let signals = counter.map(|counter| plain("counter", f64::from(counter))).into_iter().collect();
                let sync = self.message(frame, (String::from("SYNC"), false), signals);
                return Decoded::Message(DecodedMessage { means: vec![Meaning::Sync], ..sync });
            }
            Heard::Nmt { command, node } => {
                let command = worded("command", f64::from(command.byte()), command.name());
                let meant = if node == 0 { worded("node", 0.0, "all") } else { plain("node", f64::from(node)) };
                ((String::from("NMT"), false), vec![command, meant])
            }
            Heard::Heartbeat(state) => {
                let name = if state.byte() == 0 { "boot-up" } else { state.name() };
                ((part_name(Part::Heartbeat, node), true), vec![worded("state", f64::from(state.byte()), name)])
            }
            Heard::Emergency { code, register, more: [a, b, c, d, _] } => {
                let number = |bytes| f64::from(u16::from_le_bytes(bytes));
                let signals = vec![
                    worded("code", f64::from(code), &format!("{code:#06x}: {}", words::error(code))),
                    worded("register", f64::from(register), &words::error_register(register)),
                    plain("detail", number([a, b])),
                    plain("sample", number([c, d])),
                ];
                ((part_name(Part::Emergency, node), true), signals)
            }
        };
        Decoded::Message(self.message(frame, name, signals))
    }

    /// Makes a valid message of this name, sent by the drive or by the master.
    fn message(
        &self,
        frame: &Frame,
        (message, is_sent): (String, bool),
        signals: Vec<DecodedSignal>,
    ) -> DecodedMessage {
        let joint = self.spec.joint + 1;
        let sender =
            if is_sent { format!("node {}, joint {joint}", self.spec.node_id) } else { String::from("master") };
        let bytes = frame.data().len();
        DecodedMessage {
            message,
            senders: vec![sender],
            outcome: Outcome::Taken { lost: 0 },
            bytes,
            expected_bytes: bytes,
            signals,
            means: Vec::new(),
        }
    }

    fn malformed(&self, frame: &Frame, of: Part, fault: Malformed) -> DecodedMessage {
        let is_sent = !matches!(of, Part::Nmt | Part::Sync | Part::ReceivePdo(_) | Part::Request);
        let message = self.message(frame, (part_name(of, self.spec.node_id), is_sent), Vec::new());
        DecodedMessage { outcome: Outcome::Refused(Fault::CanOpen(fault)), ..message }
    }

    fn pdo(
        &self,
        frame: &Frame,
        (number, is_sent): (u16, bool),
        before: u16,
        (values, missing): (&[(Address, Value)], Option<Address>),
    ) -> DecodedMessage {
        let dictionary = self.listener.dictionary();
        let signals = values.iter().map(|(address, value)| DecodedSignal {
            name: words::object(dictionary, *address),
            ..self.signal(*address, value, before)
        });
        let direction = if is_sent { "TPDO" } else { "RPDO" };
        let name = format!("{direction} {number} of node {}", self.spec.node_id);
        let message = self.message(frame, (name, is_sent), signals.collect());
        match missing {
            Some(address) => {
                let signal = words::object(dictionary, address);
                let outcome = Outcome::Refused(Fault::Short { got: frame.data().len(), signal });
                DecodedMessage { outcome, ..message }
            }
            None => {
                let expected_bytes = values.iter().map(|(_, value)| value.len()).sum();
                DecodedMessage { expected_bytes, ..message }
            }
        }
    }

    fn sdo(&self, frame: &Frame, before: u16, sdo: &Sdo) -> DecodedMessage {
        let content = |address: &Address, content: &Content| vec![self.content(*address, content, before)];
        let bytes = |bytes: f64| vec![plain("bytes", bytes)];
        let (part, action, address, signals) = match sdo {
            Sdo::Read(address) => (Part::Request, "read", Some(*address), Vec::new()),
            Sdo::Given(address, of) => (Part::Answer, "value of", Some(*address), content(address, of)),
            Sdo::Write(address, of) => (Part::Request, "write", Some(*address), content(address, of)),
            Sdo::Confirmed(address) => (Part::Answer, "written", Some(*address), Vec::new()),
            Sdo::Announced { address, bytes: announced } => (
                self.side(frame),
                "segments of",
                Some(*address),
                announced.map_or(Vec::new(), |announced| bytes(announced.into())),
            ),
            Sdo::Segment { address, bytes: of_segment, whole } => {
                let mut signals = bytes(*of_segment as f64);
                if let (Some(address), Some(whole)) = (address, whole) {
                    signals
                        .push(DecodedSignal { name: String::from("whole"), ..self.content(*address, whole, before) });
                }
                (self.side(frame), "segment of", *address, signals)
            }
            Sdo::NextSegment(address) => (Part::Request, "next segment of", *address, Vec::new()),
            Sdo::SegmentTaken(address) => (Part::Answer, "segment taken of", *address, Vec::new()),
            Sdo::Aborted { address, code } => {
                let text = format!("{code:#010x}: {}", words::abort(*code));
                (self.side(frame), "abort", Some(*address), vec![worded("code", f64::from(*code), &text)])
            }
        };
        let name = part_name(part, self.spec.node_id);
        let message = self.message(frame, (name, part == Part::Answer), signals);
        let object = address.map(|address| ObjectName {
            index: address.index,
            subindex: address.subindex,
            name: words::object(self.listener.dictionary(), address),
        });
        DecodedMessage { means: vec![Meaning::Object { action, object }], ..message }
    }

    /// Says whether a frame of an SDO is a request or an answer.
    fn side(&self, frame: &Frame) -> Part {
        let request = resonarm_wire::canopen::SDO_REQUEST_BASE + u16::from(self.spec.node_id);
        if frame.id() == resonarm_protocol::Id::Standard(request) { Part::Request } else { Part::Answer }
    }

    fn content(&self, address: Address, content: &Content, before: u16) -> DecodedSignal {
        match content {
            Content::Value(Value::Text(text)) => {
                worded("bytes", text.bytes().len() as f64, &String::from_utf8_lossy(text.bytes()))
            }
            Content::Value(value) => self.signal(address, value, before),
            Content::Bytes(bytes) => {
                let hexadecimal: Vec<String> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
                worded("bytes", bytes.len() as f64, &hexadecimal.join(" "))
            }
        }
    }

    /// Describes a value and its meaning to the plant.
    fn signal(&self, address: Address, value: &Value, before: u16) -> DecodedSignal {
        let number = value.number().unwrap_or(0);
        let dictionary: &Dictionary = self.listener.dictionary();
        DecodedSignal {
            name: String::from("value"),
            value: Some(number as f64),
            large: None,
            unit: words::unit(address).to_string(),
            text: words::value(dictionary, address, number, before),
            means: self.meaning(address.index, number as f64).into_iter().collect(),
        }
    }

    fn meaning(&self, index: u16, number: f64) -> Option<Meaning> {
        let spec = &self.spec;
        let joint = self.spec.joint;
        let quantity = |name, value, unit| Some(Meaning::Quantity { name, value, unit });
        match index {
            0x6064 => quantity(joint_channel_name(joint, false), number / spec.counts_per_rad(), "rad"),
            0x606C => quantity(joint_channel_name(joint, true), number / spec.counts_per_rad(), "rad/s"),
            0x6077 => quantity(LOADS[joint].name, number * spec.torque_step_nm(), "N·m"),
            0x6071 => {
                let name = LOAD_NAMES[joint];
                let value = number * spec.torque_step_nm();
                Some(Meaning::Load { name, value, unit: "N·m" })
            }
            _ => None,
        }
    }
}

/// Returns the name of a message of a node.
fn part_name(part: Part, node: u8) -> String {
    match part {
        Part::Nmt => String::from("NMT"),
        Part::Sync => String::from("SYNC"),
        Part::ReceivePdo(number) => format!("RPDO {number} of node {node}"),
        Part::TransmitPdo(number) => format!("TPDO {number} of node {node}"),
        Part::Emergency => format!("EMCY of node {node}"),
        Part::Heartbeat => format!("Heartbeat of node {node}"),
        Part::Request => format!("SDO request to node {node}"),
        Part::Answer => format!("SDO answer of node {node}"),
    }
}

fn plain(name: &str, value: f64) -> DecodedSignal {
    DecodedSignal { name: name.to_string(), value: Some(value), ..DecodedSignal::default() }
}

fn worded(name: &str, value: f64, text: &str) -> DecodedSignal {
    DecodedSignal { text: Some(text.to_string()), ..plain(name, value) }
}
