//! Messages as named numbers, with the names of the DBC.

use core::fmt;

use super::Message;
use super::acceleration::Acceleration;
use super::capabilities::{Capabilities, SamplesPerFrame};
use super::command::{ForceCommand, TorqueCommand};
use super::emergency::{Emergency, EmergencyCode};
use super::heartbeat::Heartbeat;
use super::hello::{Hello, Version};
use super::impedance_head::ImpedanceHead;
use super::measured::Measured;
use super::operator::{OperatorCommand, OperatorRequest};
use super::sensors::{SensorPair, SensorValues, Sensors};
use crate::kind::MessageKind;
use crate::network::{Node, Profile};
use crate::state::NodeState;

/// The names of a sample's readings, and of their saturation marks.
struct Names {
    values: [&'static str; 6],
    saturated: [&'static str; 6],
}

/// The names with a prefix.
macro_rules! names {
    ($prefix:literal) => {
        Names {
            values: [
                concat!($prefix, "force_x_n"),
                concat!($prefix, "force_y_n"),
                concat!($prefix, "acceleration_b_x_m_s2"),
                concat!($prefix, "acceleration_b_y_m_s2"),
                concat!($prefix, "acceleration_c_x_m_s2"),
                concat!($prefix, "acceleration_c_y_m_s2"),
            ],
            saturated: [
                concat!($prefix, "force_x_saturated"),
                concat!($prefix, "force_y_saturated"),
                concat!($prefix, "acceleration_b_x_saturated"),
                concat!($prefix, "acceleration_b_y_saturated"),
                concat!($prefix, "acceleration_c_x_saturated"),
                concat!($prefix, "acceleration_c_y_saturated"),
            ],
        }
    };
}

const SAMPLE: Names = names!("");
const PAIR: [Names; 2] = [names!("first_"), names!("second_")];

/// Error of signals that don't make a message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SignalError {
    /// A signal is missing.
    Missing {
        /// The message that lacks the signal.
        kind: MessageKind,
        /// Name of the missing signal.
        signal: &'static str,
    },
    /// A signal has no such value.
    NoSuchValue {
        /// The message with the signal.
        kind: MessageKind,
        /// Name of the signal.
        signal: &'static str,
        /// Value that the signal can't have.
        got: f64,
    },
}

impl fmt::Display for SignalError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SignalError::Missing { kind, signal } => write!(f, "{kind} has no value for {signal}: give one"),
            SignalError::NoSuchValue { kind, signal, got } => write!(f, "{kind}: {got} is not a value of {signal}"),
        }
    }
}

impl core::error::Error for SignalError {}

impl Message {
    /// Calls `visit` with the name and the physical value of every signal except those of the protection.
    pub fn signals(&self, mut visit: impl FnMut(&'static str, f64)) {
        match *self {
            Message::Operator(OperatorCommand { request, target }) => {
                visit("request", (request as u8).into());
                visit("target", target.number().into());
            }
            Message::Force(ForceCommand { force_x_n, force_y_n, sample }) => {
                visit("force_x_n", force_x_n);
                visit("force_y_n", force_y_n);
                visit("sample", sample.into());
            }
            Message::Torque(TorqueCommand { torque1_nm, torque2_nm, sample }) => {
                visit("torque1_nm", torque1_nm);
                visit("torque2_nm", torque2_nm);
                visit("sample", sample.into());
            }
            Message::Head(ImpedanceHead { force_x_n, force_y_n, x_saturated, y_saturated, sample }) => {
                visit("force_x_n", force_x_n);
                visit("force_y_n", force_y_n);
                visit_axes(x_saturated, y_saturated, sample, visit);
            }
            Message::AccelerometerB(point) | Message::AccelerometerC(point) => {
                visit("acceleration_x_m_s2", point.acceleration_x_m_s2);
                visit("acceleration_y_m_s2", point.acceleration_y_m_s2);
                visit_axes(point.x_saturated, point.y_saturated, point.sample, visit);
            }
            Message::PlantHello(hello) | Message::ExciterHello(hello) => {
                visit("version_major", hello.version.major.into());
                visit("version_minor", hello.version.minor.into());
                visit("profile", (hello.profile as u8).into());
                visit("dbc_hash", hello.dbc_hash.into());
                visit("rate_hz", hello.rate_hz.into());
            }
            Message::Heartbeat(Heartbeat { state, .. }) => visit("state", state.heartbeat_byte().into()),
            Message::Emergency(Emergency { code, detail, sample, .. }) => {
                visit("code", (code as u16).into());
                visit("detail", detail.into());
                visit("sample", sample.into());
            }
            Message::Sensors(Sensors { values, sample }) => {
                visit("sample", sample.into());
                values.signals(&SAMPLE, &mut visit);
            }
            Message::SensorPair(SensorPair { values, sample }) => {
                visit("sample", sample.into());
                values.iter().zip(&PAIR).for_each(|(values, names)| values.signals(names, &mut visit));
            }
            Message::Capabilities(capabilities) => {
                visit("samples_per_frame", (capabilities.samples_per_frame as u8).into());
                visit("force_limit_n", capabilities.force_limit_n);
                visit("torque_limit_nm", capabilities.torque_limit_nm);
            }
        }
    }

    /// The message of this kind with the signals from `get`. Missing marks are 0.
    ///
    /// # Errors
    /// [`SignalError`] if a signal is missing, or has an impossible value. [`Message::check`] checks whether physical
    /// values can be sent.
    pub fn from_signals(
        kind: MessageKind,
        get: impl FnMut(&'static str) -> Option<f64>,
    ) -> Result<Message, SignalError> {
        let mut get = Getter { kind, get };
        Ok(match kind {
            MessageKind::Operator => Message::Operator(OperatorCommand {
                request: get.one_of("request", |n| OperatorRequest::from_number(n.try_into().ok()?))?,
                target: get.one_of("target", |n| Node::from_number(n.try_into().ok()?))?,
            }),
            MessageKind::Force => Message::Force(ForceCommand {
                force_x_n: get.real("force_x_n")?,
                force_y_n: get.real("force_y_n")?,
                sample: get.sample()?,
            }),
            MessageKind::Torque => Message::Torque(TorqueCommand {
                torque1_nm: get.real("torque1_nm")?,
                torque2_nm: get.real("torque2_nm")?,
                sample: get.sample()?,
            }),
            MessageKind::Head => Message::Head(ImpedanceHead {
                force_x_n: get.real("force_x_n")?,
                force_y_n: get.real("force_y_n")?,
                x_saturated: get.mark("x_saturated")?,
                y_saturated: get.mark("y_saturated")?,
                sample: get.sample()?,
            }),
            MessageKind::AccelerometerB => Message::AccelerometerB(get.acceleration()?),
            MessageKind::AccelerometerC => Message::AccelerometerC(get.acceleration()?),
            MessageKind::PlantHello => Message::PlantHello(get.hello()?),
            MessageKind::ExciterHello => Message::ExciterHello(get.hello()?),
            MessageKind::PlantHeartbeat | MessageKind::ExciterHeartbeat => Message::Heartbeat(Heartbeat {
                node: kind.sender(),
                state: get.one_of("state", |n| NodeState::from_heartbeat_byte(n.try_into().ok()?))?,
            }),
            MessageKind::PlantEmergency | MessageKind::ExciterEmergency => Message::Emergency(Emergency {
                node: kind.sender(),
                code: get.one_of("code", EmergencyCode::from_code)?,
                detail: get.whole("detail", u16::MAX.into())? as u16,
                sample: get.sample()?,
            }),
            MessageKind::Sensors => Message::Sensors(Sensors { values: get.values(&SAMPLE)?, sample: get.sample()? }),
            MessageKind::SensorPair => {
                let values = [get.values(&PAIR[0])?, get.values(&PAIR[1])?];
                Message::SensorPair(SensorPair { values, sample: get.sample()? })
            }
            MessageKind::PlantCapabilities | MessageKind::ExciterCapabilities => Message::Capabilities(Capabilities {
                node: kind.sender(),
                samples_per_frame: get
                    .one_of("samples_per_frame", |n| SamplesPerFrame::from_number(n.try_into().ok()?))?,
                force_limit_n: get.real("force_limit_n")?,
                torque_limit_nm: get.real("torque_limit_nm")?,
            }),
        })
    }
}

fn visit_axes(x_saturated: bool, y_saturated: bool, sample: u16, mut visit: impl FnMut(&'static str, f64)) {
    visit("x_saturated", x_saturated.into());
    visit("y_saturated", y_saturated.into());
    visit("sample", sample.into());
}

impl SensorValues {
    fn signals(&self, names: &Names, visit: &mut impl FnMut(&'static str, f64)) {
        for (k, measured) in self.all().into_iter().enumerate() {
            visit(names.values[k], measured.value);
            visit(names.saturated[k], measured.saturated.into());
        }
    }
}

/// Takes signals by name.
struct Getter<F> {
    kind: MessageKind,
    get: F,
}

impl<F: FnMut(&'static str) -> Option<f64>> Getter<F> {
    fn real(&mut self, signal: &'static str) -> Result<f64, SignalError> {
        (self.get)(signal).ok_or(SignalError::Missing { kind: self.kind, signal })
    }

    /// A whole number from 0 to `max`.
    fn whole(&mut self, signal: &'static str, max: u32) -> Result<u32, SignalError> {
        let got = self.real(signal)?;
        // The conversion saturates, and makes 0 of NaN. So the comparison rejects everything but whole numbers.
        let whole = got as u32;
        if f64::from(whole) == got && whole <= max {
            Ok(whole)
        } else {
            Err(SignalError::NoSuchValue { kind: self.kind, signal, got })
        }
    }

    fn sample(&mut self) -> Result<u16, SignalError> {
        Ok(self.whole("sample", u16::MAX.into())? as u16)
    }

    fn one_of<T>(&mut self, signal: &'static str, known: impl Fn(u16) -> Option<T>) -> Result<T, SignalError> {
        let number = self.whole(signal, u16::MAX.into())?;
        known(number as u16).ok_or(SignalError::NoSuchValue { kind: self.kind, signal, got: number.into() })
    }

    fn mark(&mut self, signal: &'static str) -> Result<bool, SignalError> {
        match (self.get)(signal) {
            None => Ok(false),
            Some(_) => Ok(self.whole(signal, 1)? == 1),
        }
    }

    fn acceleration(&mut self) -> Result<Acceleration, SignalError> {
        Ok(Acceleration {
            acceleration_x_m_s2: self.real("acceleration_x_m_s2")?,
            acceleration_y_m_s2: self.real("acceleration_y_m_s2")?,
            x_saturated: self.mark("x_saturated")?,
            y_saturated: self.mark("y_saturated")?,
            sample: self.sample()?,
        })
    }

    fn hello(&mut self) -> Result<Hello, SignalError> {
        Ok(Hello {
            version: Version {
                major: self.whole("version_major", 15)? as u8,
                minor: self.whole("version_minor", 15)? as u8,
            },
            dbc_hash: self.whole("dbc_hash", Hello::DBC_HASH_MASK)?,
            profile: self.one_of("profile", |n| Profile::ALL.into_iter().find(|profile| *profile as u16 == n))?,
            rate_hz: self.whole("rate_hz", u16::MAX.into())? as u16,
        })
    }

    fn values(&mut self, names: &Names) -> Result<SensorValues, SignalError> {
        let mut all = [Measured::default(); 6];
        for (k, measured) in all.iter_mut().enumerate() {
            *measured = Measured { value: self.real(names.values[k])?, saturated: self.mark(names.saturated[k])? };
        }
        Ok(SensorValues::from_all(all))
    }
}
