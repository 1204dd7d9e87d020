//! The impedance head at the tip: the force that acts there.

use super::payload::Measured;
use super::{MessageKind, Payload};
use crate::error::{DecodeError, EncodeError};
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

    pub(crate) fn encode(&self) -> Result<Payload, EncodeError> {
        let measured = Measured {
            values: [self.force_x_n, self.force_y_n],
            saturated: [self.x_saturated, self.y_saturated],
            sample: self.sample,
        };
        Payload::from_measured(MessageKind::Head, FORCE, Self::SIGNALS, measured)
    }

    pub(crate) fn decode(payload: &Payload) -> Result<ImpedanceHead, DecodeError> {
        let Measured { values, saturated, sample } = payload.to_measured(MessageKind::Head, FORCE, Self::SIGNALS)?;
        let ([force_x_n, force_y_n], [x_saturated, y_saturated]) = (values, saturated);
        Ok(ImpedanceHead { force_x_n, force_y_n, x_saturated, y_saturated, sample })
    }
}
