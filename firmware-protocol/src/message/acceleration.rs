//! The accelerometers at points B and C.

use super::measured::Measured;
use super::payload::Payload;
use crate::error::{DecodeError, EncodeError};
use crate::kind::MessageKind;
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

    /// The readings along x and y.
    pub const fn axes(&self) -> [Measured; 2] {
        [
            Measured { value: self.acceleration_x_m_s2, saturated: self.x_saturated },
            Measured { value: self.acceleration_y_m_s2, saturated: self.y_saturated },
        ]
    }

    pub(crate) fn encode(&self, kind: MessageKind) -> Result<Payload, EncodeError> {
        Payload::from_measured(kind, ACCELERATION, Self::SIGNALS, self.axes(), self.sample)
    }

    pub(crate) fn decode(kind: MessageKind, payload: &Payload) -> Result<Acceleration, DecodeError> {
        let ([x, y], sample) = payload.to_measured(kind, ACCELERATION, Self::SIGNALS)?;
        Ok(Acceleration {
            acceleration_x_m_s2: x.value,
            acceleration_y_m_s2: y.value,
            x_saturated: x.saturated,
            y_saturated: y.saturated,
            sample,
        })
    }
}
