//! The accelerometers at points B and C.

use super::payload::Measured;
use super::{MessageKind, Payload};
use crate::error::{DecodeError, EncodeError};
use crate::scaling::ACCELERATION;

/// The acceleration that an accelerometer measures, at point B (the second joint) or C (the tip).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Acceleration {
    /// Acceleration along x of the base frame, in m/s², ±1638.35 in steps of 0.05.
    pub acceleration_x_m_s2: f64,
    /// Acceleration along y of the base frame, in m/s², ±1638.35 in steps of 0.05.
    pub acceleration_y_m_s2: f64,
    /// The sensor clipped x. Also set in the frame when `acceleration_x_m_s2` is beyond the range of the signal.
    pub x_saturated: bool,
    /// The sensor clipped y. Also set in the frame when `acceleration_y_m_s2` is beyond the range of the signal.
    pub y_saturated: bool,
    /// The index of the sample, modulo 2¹⁶.
    pub sample: u16,
}

impl Acceleration {
    const SIGNALS: [&'static str; 2] = ["acceleration_x_m_s2", "acceleration_y_m_s2"];

    pub(crate) fn encode(&self, kind: MessageKind) -> Result<Payload, EncodeError> {
        let measured = Measured {
            values: [self.acceleration_x_m_s2, self.acceleration_y_m_s2],
            saturated: [self.x_saturated, self.y_saturated],
            sample: self.sample,
        };
        Payload::from_measured(kind, ACCELERATION, Self::SIGNALS, measured)
    }

    pub(crate) fn decode(kind: MessageKind, payload: &Payload) -> Result<Acceleration, DecodeError> {
        let Measured { values, saturated, sample } = payload.to_measured(kind, ACCELERATION, Self::SIGNALS)?;
        let ([acceleration_x_m_s2, acceleration_y_m_s2], [x_saturated, y_saturated]) = (values, saturated);
        Ok(Acceleration { acceleration_x_m_s2, acceleration_y_m_s2, x_saturated, y_saturated, sample })
    }
}
