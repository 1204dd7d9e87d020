//! The exciter's commands: a force at the tip, or torques at the joints.

use super::payload::Payload;
use crate::error::{DecodeError, EncodeError};
use crate::kind::MessageKind;
use crate::scaling::{FORCE, TORQUE};

/// The force that the exciter applies to the tip of the arm, point C, held until the next command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceCommand {
    /// Force along x of the base frame, in newtons; in the classic profile ±655.34 in steps of 0.02.
    pub force_x_n: f64,
    /// Force along y of the base frame, in newtons; in the classic profile ±655.34 in steps of 0.02.
    pub force_y_n: f64,
    /// The index, modulo 2¹⁶, of the sample that this command answers.
    pub sample: u16,
}

/// The torques that an exciter at the joints applies to the arm, held until the next command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueCommand {
    /// Torque at joint 1, in newton metres; in the classic profile ±1638.35 in steps of 0.05.
    pub torque1_nm: f64,
    /// Torque at joint 2, in newton metres; in the classic profile ±1638.35 in steps of 0.05.
    pub torque2_nm: f64,
    /// The index, modulo 2¹⁶, of the sample that this command answers.
    pub sample: u16,
}

impl ForceCommand {
    pub(super) const SIGNALS: [&'static str; 2] = ["force_x_n", "force_y_n"];

    pub(crate) fn encode(&self) -> Result<Payload, EncodeError> {
        let values = [self.force_x_n, self.force_y_n];
        Payload::from_command(MessageKind::Force, FORCE, Self::SIGNALS, values, self.sample)
    }

    pub(crate) fn decode(payload: &Payload) -> Result<ForceCommand, DecodeError> {
        let ([force_x_n, force_y_n], sample) = payload.to_command(MessageKind::Force, FORCE, Self::SIGNALS)?;
        Ok(ForceCommand { force_x_n, force_y_n, sample })
    }
}

impl TorqueCommand {
    pub(super) const SIGNALS: [&'static str; 2] = ["torque1_nm", "torque2_nm"];

    pub(crate) fn encode(&self) -> Result<Payload, EncodeError> {
        let values = [self.torque1_nm, self.torque2_nm];
        Payload::from_command(MessageKind::Torque, TORQUE, Self::SIGNALS, values, self.sample)
    }

    pub(crate) fn decode(payload: &Payload) -> Result<TorqueCommand, DecodeError> {
        let ([torque1_nm, torque2_nm], sample) = payload.to_command(MessageKind::Torque, TORQUE, Self::SIGNALS)?;
        Ok(TorqueCommand { torque1_nm, torque2_nm, sample })
    }
}
