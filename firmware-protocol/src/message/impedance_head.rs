//! The impedance head at the tip: the force that acts there.

use super::measured::Measured;
use super::payload::Payload;
use crate::error::{DecodeError, EncodeError};
use crate::kind::MessageKind;
use crate::scaling::FORCE;

/// The force that the impedance head measures at the tip, point C.
///
/// The acceleration at the head is [`Message::AccelerometerC`](super::Message::AccelerometerC) with the same sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImpedanceHead {
    /// Force along x of the base frame, in newtons, ±655.34 in steps of 0.02.
    pub force_x_n: f64,
    /// Force along y of the base frame, in newtons, ±655.34 in steps of 0.02.
    pub force_y_n: f64,
    /// The sensor clipped x. Also set in the frame when `force_x_n` is beyond the range of the signal.
    pub x_saturated: bool,
    /// The sensor clipped y. Also set in the frame when `force_y_n` is beyond the range of the signal.
    pub y_saturated: bool,
    /// The index of the sample, modulo 2¹⁶.
    pub sample: u16,
}

impl ImpedanceHead {
    const SIGNALS: [&'static str; 2] = ["force_x_n", "force_y_n"];

    /// The readings along x and y.
    pub const fn axes(&self) -> [Measured; 2] {
        [
            Measured { value: self.force_x_n, saturated: self.x_saturated },
            Measured { value: self.force_y_n, saturated: self.y_saturated },
        ]
    }

    pub(crate) fn encode(&self) -> Result<Payload, EncodeError> {
        Payload::from_measured(MessageKind::Head, FORCE, Self::SIGNALS, self.axes(), self.sample)
    }

    pub(crate) fn decode(payload: &Payload) -> Result<ImpedanceHead, DecodeError> {
        let ([x, y], sample) = payload.to_measured(MessageKind::Head, FORCE, Self::SIGNALS)?;
        let x_saturated = x.saturated;
        let y_saturated = y.saturated;
        Ok(ImpedanceHead { force_x_n: x.value, force_y_n: y.value, x_saturated, y_saturated, sample })
    }
}
