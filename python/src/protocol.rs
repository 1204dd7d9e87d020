//! The protocol's codec, with E2E protection.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use resonarm::protocol::{
    self, DecodeError, Frame, FrameFormat, Id, Message, MessageKind, Node, Profile, Transmitter, dbc,
};

use crate::errors;

/// The frame of `resonarm.Frame`: identifier, whether it has 29 bits, payload, whether it is a CAN FD frame, and
/// whether it has the bit rate switch. A remote frame has no such form.
#[derive(Clone, Debug, FromPyObject)]
pub struct FrameParts(u32, bool, Vec<u8>, bool, bool);

impl FrameParts {
    /// The frame, if the parts are valid.
    pub fn frame(&self) -> PyResult<Frame> {
        let FrameParts(identifier, extended, data, fd, bit_rate_switch) = self;
        let id = id(*identifier, *extended)?;
        let format = match fd {
            true => FrameFormat::Fd { bit_rate_switch: *bit_rate_switch, error_state_indicator: false },
            false => FrameFormat::Classic,
        };
        Frame::new(id, format, data).map_err(errors::value)
    }
}

fn id(identifier: u32, extended: bool) -> PyResult<Id> {
    match (extended, u16::try_from(identifier)) {
        (false, Ok(identifier)) => Ok(Id::Standard(identifier)),
        (false, Err(_)) => {
            Err(errors::value(format!("identifier {identifier:#X} does not fit 11 bits (at most 0x7FF)")))
        }
        (true, _) => Ok(Id::Extended(identifier)),
    }
}

/// Identifier, whether it has 29 bits, payload, FD, bit rate switch.
pub type Parts = (u32, bool, Vec<u8>, bool, bool);

/// The parts of a frame.
pub fn parts(frame: &Frame) -> Parts {
    let (fd, bit_rate_switch) = match frame.format() {
        FrameFormat::Fd { bit_rate_switch, .. } => (true, bit_rate_switch),
        FrameFormat::Classic | FrameFormat::Remote => (false, false),
    };
    (frame.id().raw(), matches!(frame.id(), Id::Extended(_)), frame.data().to_vec(), fd, bit_rate_switch)
}

/// One plant and one exciter on a bus.
#[pyclass(frozen, subclass, module = "resonarm._resonarm")]
#[derive(Debug)]
pub struct Network {
    inner: protocol::Network,
}

#[pymethods]
impl Network {
    #[new]
    #[pyo3(signature = (*, base = 0x200, plant_id = 1, exciter_id = 2, profile = "classic"))]
    fn new(base: i64, plant_id: i64, exciter_id: i64, profile: &str) -> PyResult<Network> {
        let unknown = |error| errors::value(format!("profile is `{profile}`: {error}"));
        let profile: Profile = profile.parse().map_err(unknown)?;
        // Taken as an `i64`, so that a number out of range is a ValueError with the valid range and no OverflowError.
        let base = u16::try_from(base)
            .map_err(|_| errors::value(format!("base is {base}: it must be from 0x180 to 0x570")))?;
        let node_id = |name: &str, id: i64| {
            u8::try_from(id).map_err(|_| errors::value(format!("{name} is {id}: it must be from 1 to 127")))
        };
        let plant_id = node_id("plant_id", plant_id)?;
        let exciter_id = node_id("exciter_id", exciter_id)?;
        let network = protocol::Network::new(base).and_then(|network| network.with_node_ids(plant_id, exciter_id));
        Ok(Network { inner: network.map_err(errors::value)?.with_profile(profile) })
    }

    /// Base identifier of the network.
    #[getter]
    fn base(&self) -> u16 {
        self.inner.base()
    }

    /// Node id of the plant.
    #[getter]
    fn plant_id(&self) -> u8 {
        self.inner.node_id(Node::Plant)
    }

    /// Node id of the exciter.
    #[getter]
    fn exciter_id(&self) -> u8 {
        self.inner.node_id(Node::Exciter)
    }

    /// Profile of the network: `classic` or `fd`.
    #[getter]
    fn profile(&self) -> &'static str {
        self.inner.profile().name()
    }

    /// The arguments that make the same network again.
    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<((), Bound<'py, PyDict>)> {
        let keywords = PyDict::new(py);
        keywords.set_item("base", self.base())?;
        keywords.set_item("plant_id", self.plant_id())?;
        keywords.set_item("exciter_id", self.exciter_id())?;
        keywords.set_item("profile", self.profile())?;
        Ok(((), keywords))
    }

    /// The DBC of the network.
    fn dbc(&self) -> String {
        dbc::Dbc(self.inner).to_string()
    }

    /// The names of the messages.
    #[staticmethod]
    fn messages() -> Vec<&'static str> {
        MessageKind::ALL.map(MessageKind::name).to_vec()
    }
}

/// Makes frames of a network: each message with its own counter.
#[pyclass(subclass, module = "resonarm._resonarm")]
#[derive(Debug)]
pub struct Encoder {
    inner: Transmitter,
}

#[pymethods]
impl Encoder {
    #[new]
    fn new(network: &Network) -> Encoder {
        Encoder { inner: Transmitter::new(network.inner) }
    }

    /// The parts of the next frame of a message.
    fn encode_parts(&mut self, message: &str, signals: &Bound<'_, PyDict>) -> PyResult<Parts> {
        let known = MessageKind::ALL.into_iter().find(|kind| kind.name() == message);
        let kind = known.ok_or_else(|| {
            let names = MessageKind::ALL.map(MessageKind::name).join(", ");
            errors::value(format!("unknown message {message:?}, expected one of {names}"))
        })?;
        let mut given: Vec<(String, f64)> = Vec::new();
        for (name, value) in signals {
            given.push((name.extract()?, value.extract()?));
        }
        let mut used = Vec::new();
        let message = Message::from_signals(kind, |name| {
            used.push(name);
            given.iter().find(|(given, _)| *given == name).map(|(_, value)| *value)
        });
        let message = message.map_err(errors::value)?;
        // An unknown name is likely a misspelt one, so it is not ignored.
        if let Some((unknown, _)) = given.iter().find(|(given, _)| !used.contains(&given.as_str())) {
            return Err(errors::value(format!("{kind} has no signal {unknown}, expected one of {}", used.join(", "))));
        }
        Ok(parts(&self.inner.frame(&message).map_err(errors::value)?))
    }
}

/// The verdict on a frame: verdict, message, sender, signals, reason.
type Verdict<'py> = (&'static str, &'static str, String, Bound<'py, PyDict>, String);

/// Decodes frames of a network: checks form, E2E protection and content of each, and supervises the counters.
#[pyclass(subclass, module = "resonarm._resonarm")]
#[derive(Debug)]
pub struct Decoder {
    inner: protocol::Receiver,
}

#[pymethods]
impl Decoder {
    #[new]
    fn new(network: &Network) -> Decoder {
        Decoder { inner: protocol::Receiver::new(network.inner) }
    }

    /// Frames lost according to the counters.
    #[getter]
    fn lost(&self) -> u64 {
        self.inner.lost()
    }

    /// The content of a frame, and whether a receiver takes it.
    fn decode_parts<'py>(&mut self, py: Python<'py>, frame: FrameParts) -> PyResult<Verdict<'py>> {
        self.verdict(py, &frame.frame()?)
    }

    /// The verdict on a remote frame: identifier, and whether it has 29 bits.
    fn decode_remote<'py>(&mut self, py: Python<'py>, identifier: u32, extended: bool) -> PyResult<Verdict<'py>> {
        let frame = Frame::new(id(identifier, extended)?, FrameFormat::Remote, &[]).map_err(errors::value)?;
        self.verdict(py, &frame)
    }
}

impl Decoder {
    fn verdict<'py>(&mut self, py: Python<'py>, frame: &Frame) -> PyResult<Verdict<'py>> {
        let signals = PyDict::new(py);
        Ok(match self.inner.accept(frame) {
            Ok(None) => ("foreign", "", String::new(), signals, String::new()),
            Err(error) => {
                let kind = DecodeError::kind(&error);
                ("refused", kind.name(), kind.sender().to_string(), signals, error.to_string())
            }
            Ok(Some(message)) => {
                let mut set = Ok(());
                message.signals(|name, value| {
                    if set.is_ok() {
                        set = signals.set_item(name, value);
                    }
                });
                set?;
                let kind = message.kind();
                ("taken", kind.name(), kind.sender().to_string(), signals, String::new())
            }
        })
    }
}
