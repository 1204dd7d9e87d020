//! The C codec as a process, and what this crate would have answered in its place.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::OnceLock;

use resonarm_protocol::e2e::CounterFault;
use resonarm_protocol::header::Header;
use resonarm_protocol::{
    DecodeError, EncodeError, Frame, FrameFormat, Id, Message, Network, Node, Profile, Receiver, Transmitter,
};

/// Builds one of the programs in `c/tests`; its path.
pub fn build(name: &str) -> PathBuf {
    let out = Path::new(env!("CARGO_TARGET_TMPDIR"));
    make(out, &out.join(name), &[])
}

/// Builds one of the programs for a network, with the header that this crate writes; its path.
pub fn build_for(network: Network, name: &str) -> PathBuf {
    let [plant, exciter] = Node::ALL.map(|node| network.node_id(node));
    let folder = format!("{:x}-{plant}-{exciter}-{}", network.base(), network.profile());
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join(folder);
    let config = out.join("resonarm_config.h");
    std::fs::create_dir_all(&out).unwrap();
    std::fs::write(&config, Header(network).to_string()).unwrap();
    make(&out, &out.join(name), &[format!("CONFIG={}", config.display())])
}

/// Builds what the makefile calls `name` with a setting, in a separate folder; returns its path.
pub fn build_with(folder: &str, setting: &str, name: &str) -> PathBuf {
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join(folder);
    make(&out, &out.join(name), &[setting.to_string()])
}

fn make(out: &Path, program: &Path, settings: &[String]) -> PathBuf {
    let mut make = Command::new("make");
    make.args(["--silent", "--directory", concat!(env!("CARGO_MANIFEST_DIR"), "/c")]);
    make.arg(format!("OUT={}", out.display())).args(settings).arg(program);
    let output = make.output().expect("a C compiler and make: apt-get install build-essential");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    program.to_path_buf()
}

/// The numbers of a message, in the order of the members of the C structures.
pub fn values(message: &Message) -> Vec<f64> {
    let signals = super::common::signals(message);
    let readings = |prefix: &str| {
        let names =
            ["force_x", "force_y", "acceleration_b_x", "acceleration_b_y", "acceleration_c_x", "acceleration_c_y"];
        let units = ["n", "n", "m_s2", "m_s2", "m_s2", "m_s2"];
        let values = names.iter().zip(units).map(|(name, unit)| signals[&format!("{prefix}{name}_{unit}")]);
        values.chain(names.iter().map(|name| signals[&format!("{prefix}{name}_saturated")])).collect::<Vec<_>>()
    };
    let names: &[&str] = match message {
        Message::Operator(_) => &["request", "target"],
        Message::Force(_) => &["force_x_n", "force_y_n", "sample"],
        Message::Torque(_) => &["torque1_nm", "torque2_nm", "sample"],
        Message::Head(_) => &["force_x_n", "force_y_n", "x_saturated", "y_saturated", "sample"],
        Message::AccelerometerB(_) | Message::AccelerometerC(_) => {
            &["acceleration_x_m_s2", "acceleration_y_m_s2", "x_saturated", "y_saturated", "sample"]
        }
        Message::PlantHello(_) | Message::ExciterHello(_) => {
            &["version_major", "version_minor", "dbc_hash", "profile", "rate_hz"]
        }
        Message::Heartbeat(_) => &["state"],
        Message::Emergency(_) => &["code", "detail", "sample"],
        Message::Sensors(_) => return [readings(""), vec![signals["sample"]]].concat(),
        Message::SensorPair(_) => {
            return [readings("first_"), readings("second_"), vec![signals["sample"]]].concat();
        }
        Message::Capabilities(_) => &["samples_per_frame", "force_limit_n", "torque_limit_nm"],
    };
    assert_eq!(names.len(), signals.len());
    names.iter().map(|name| signals[*name]).collect()
}

/// Numbers as the bits that the harness reads and writes.
pub fn bits(values: &[f64]) -> String {
    values.iter().map(|value| format!(" {:016x}", value.to_bits())).collect()
}

fn encoded(result: Result<Frame, EncodeError>) -> String {
    match result {
        Ok(frame) => {
            let data: String = frame.data().iter().map(|byte| format!("{byte:02X}")).collect();
            let format = match frame.format() {
                FrameFormat::Fd { bit_rate_switch: true, error_state_indicator: false } => "f",
                FrameFormat::Classic => "c",
                other => panic!("{other:?} is not sent"),
            };
            format!("frame {:X} {format} {data}", frame.id().raw())
        }
        Err(EncodeError::NotFinite { signal, got, .. }) => format!("refused not-finite {signal}{}", bits(&[got])),
        Err(EncodeError::OutOfRange { signal, got, limit, .. }) => {
            format!("refused out-of-range {signal}{}", bits(&[got, -limit, limit]))
        }
        Err(EncodeError::Invalid { signal, got, min, max, .. }) => {
            format!("refused invalid {signal}{}", bits(&[got, min, max].map(f64::from)))
        }
        Err(EncodeError::OtherProfile { .. }) => format!("refused profile -{}", bits(&[0.0; 3])),
        Err(EncodeError::Negative { signal, got, .. }) => format!("refused negative {signal}{}", bits(&[got])),
    }
}

fn accepted(result: Result<Option<Message>, DecodeError>) -> String {
    let error = match result {
        Ok(None) => return "ignored".to_string(),
        Ok(Some(message)) => return format!("accepted {}{}", message.kind() as u8, bits(&values(&message))),
        Err(error) => error,
    };
    let (reason, signal, got, expected) = match error {
        DecodeError::OtherProfile { .. } => ("profile", "-", 0, 0),
        DecodeError::Format { .. } => ("format", "-", 0, 0),
        DecodeError::Length { got, expected, .. } => ("length", "-", got as u16, expected as u16),
        DecodeError::Crc { got, expected, .. } => ("crc", "-", got, expected),
        DecodeError::Counter { fault: CounterFault::Repeated, got, .. } => ("repeated", "-", got.into(), 0),
        DecodeError::Counter { fault: CounterFault::WrongSequence { last }, got, .. } => {
            ("wrong-sequence", "-", got.into(), last.into())
        }
        DecodeError::Counter { fault: CounterFault::Invalid, got, .. } => ("invalid-counter", "-", got.into(), 0),
        DecodeError::Reserved { byte, got, .. } => ("reserved", "-", got.into(), byte as u16),
        DecodeError::NotAvailable { signal, .. } => ("not-available", signal, 0, 0),
        DecodeError::UnknownValue { signal, got, .. } => ("unknown-value", signal, got, 0),
        DecodeError::NotFinite { signal, .. } => ("not-finite", signal, 0, 0),
        DecodeError::Negative { signal, .. } => ("negative", signal, 0, 0),
    };
    format!("refused {reason} {} {signal} {got} {expected}", error.kind() as u8)
}

/// A sender and a receiver in C, and the two of this crate beside them.
pub struct Harness {
    process: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
    transmitter: Transmitter,
    receiver: Receiver,
}

impl Harness {
    /// A new harness for a profile; its program is built once.
    pub fn start(profile: Profile) -> Harness {
        static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
        Harness::of(PROGRAM.get_or_init(|| build("codec_harness")), profile)
    }

    /// A harness of the library without the FD profile, in the classic one.
    pub fn start_classic_only() -> Harness {
        static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
        let build = || build_with("classic-only", "DEFINES=-DRESONARM_CLASSIC_ONLY", "codec_harness");
        Harness::of(PROGRAM.get_or_init(build), Profile::Classic)
    }

    fn of(program: &Path, profile: Profile) -> Harness {
        let mut process = Command::new(program).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let (input, output) = (process.stdin.take(), BufReader::new(process.stdout.take().unwrap()));
        let network = super::common::network(profile);
        let (transmitter, receiver) = (Transmitter::new(network), Receiver::new(network));
        let mut harness = Harness { process, input, output, transmitter, receiver };
        harness.begin(network);
        harness
    }

    /// Returns the answer of the C code to a command.
    pub fn ask(&mut self, command: &str) -> String {
        let input = self.input.as_mut().unwrap();
        input.write_all(format!("{command}\n").as_bytes()).unwrap();
        let mut answer = String::new();
        self.output.read_line(&mut answer).unwrap();
        answer.trim_end().to_string()
    }

    /// New senders and receivers.
    pub fn begin(&mut self, network: Network) {
        (self.transmitter, self.receiver) = (Transmitter::new(network), Receiver::new(network));
        let (base, [plant, exciter]) = (network.base(), Node::ALL.map(|node| network.node_id(node)));
        let profile = network.profile() as u8;
        assert_eq!(self.ask(&format!("network {base} {plant} {exciter} {profile}")), "valid");
    }

    /// Both senders make a frame of a message.
    pub fn encode(&mut self, message: &Message) -> Result<Frame, EncodeError> {
        let answer = self.ask(&format!("encode {}{}", message.kind() as u8, bits(&values(message))));
        let expected = self.transmitter.frame(message);
        match expected {
            // The range that C states as well is not compared.
            Err(EncodeError::NotFinite { .. } | EncodeError::Negative { .. }) => {
                assert!(answer.starts_with(&encoded(expected)), "{answer}: {message:?}")
            }
            _ => assert_eq!(answer, encoded(expected), "{message:?}"),
        }
        expected
    }

    /// Both receivers take a frame.
    pub fn accept(&mut self, frame: &Frame) -> Result<Option<Message>, DecodeError> {
        let (id_format, id) = match frame.id() {
            Id::Standard(id) => ("s", u32::from(id)),
            Id::Extended(id) => ("e", id),
        };
        let format = match frame.format() {
            FrameFormat::Classic => "c",
            FrameFormat::Remote => "r",
            FrameFormat::Fd { .. } => "f",
        };
        let data: String = frame.data().iter().map(|byte| format!("{byte:02X}")).collect();
        let answer = self.ask(&format!("accept {id_format} {format} {id:X} {} {data}", frame.len()));
        let expected = self.receiver.accept(frame);
        assert_eq!(answer, accepted(expected), "{frame}");
        expected
    }

    /// Both have counted as many lost frames.
    pub fn lost(&mut self) -> u64 {
        let lost = self.receiver.lost();
        assert_eq!(self.ask("lost"), lost.to_string());
        lost
    }

    /// Nothing was found by the sanitisers.
    pub fn end(mut self) {
        drop(self.input.take());
        assert!(self.process.wait().unwrap().success());
    }
}

impl Drop for Harness {
    fn drop(&mut self) {
        drop(self.input.take());
        let _ended = self.process.wait();
    }
}
