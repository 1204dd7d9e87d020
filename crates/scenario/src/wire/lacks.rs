//! The functions that a user protocol lacks, and the consequences.

use thiserror::Error;

use super::drives::PresetSpec;
use super::{ArmSpec, WireSection};
use resonarm_numeric::number::short;

/// A protection or function that a user protocol lacks.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum WireLack {
    /// Commands don't name the sample that they answer.
    #[error("commands name no sample, so neither their age nor the round-trip time can be measured")]
    Echo,
    /// A message has no counter.
    #[error("message {message} has no counter, so a repeated or old frame counts as new")]
    Counter {
        /// Name of the message.
        message: String,
    },
    /// A message has no checksum.
    #[error("message {message} has no checksum, so damage that the CAN controller's CRC misses acts as a load")]
    Checksum {
        /// Name of the message.
        message: String,
    },
    /// No message arms the plant; the operator can.
    #[error("no message arms the plant: only the operator can arm it, in the live view (--live)")]
    ArmedByOperator,
    /// No message arms the plant; its first commands near zero arm it.
    #[error(
        "no message arms the plant: its first commands near zero arm it, and after a fault it can't be armed again"
    )]
    ArmedByCommands,
    /// No message clears a fault.
    #[error(
        "no message clears a fault: the operator clears it in the live view (--live), or a new run begins without it"
    )]
    Reset,
}

impl WireSection {
    /// Returns in words what arms the plant.
    pub fn arming(&self) -> String {
        let of_event = |event: &super::EventSpec| match (&event.signal, event.on_frame) {
            (Some(signal), _) if !event.arm.is_empty() => {
                let values: Vec<String> = event.arm.iter().map(|value| short(value).to_string()).collect();
                Some(format!("message {} with {signal} = {}", event.message, values.join(" or ")))
            }
            (None, Some(super::RequestSpec::Arm)) => Some(format!("message {}", event.message)),
            _ => None,
        };
        let events: Vec<String> = self.events.iter().filter_map(of_event).collect();
        match (self.preset, self.arm) {
            (Some(PresetSpec::Odrive), _) => String::from("Set_Axis_State with 8, closed loop control"),
            (Some(PresetSpec::Cia402), _) => String::from("a controlword that enables operation, 0x0F, in the mode 10"),
            (None, Some(ArmSpec::Operator)) => String::from("the operator in the live view (--live)"),
            (None, Some(ArmSpec::ZeroCommand)) => {
                String::from("commands below a hundredth of the exciter's limits, the first that come")
            }
            (None, None) => events.join(", or "),
        }
    }

    /// Returns everything that the protocol lacks.
    pub fn lacks(&self) -> Vec<WireLack> {
        // No user protocol here names the sample that a command answers.
        let mut lacks = vec![WireLack::Echo];
        if self.preset == Some(super::PresetSpec::Cia402) {
            return lacks;
        }
        for command in &self.commands {
            // Counter and checksum of a message are stated once, with its command or with one of its events.
            let event = self.events.iter().filter(|event| event.message == command.message);
            let has = |of_event: fn(&super::EventSpec) -> bool, own: bool| own || event.clone().any(of_event);
            let message = command.message.clone();
            if !has(|event| event.counter.is_some(), command.counter.is_some()) {
                lacks.push(WireLack::Counter { message: message.clone() });
            }
            if !has(|event| event.checksum.is_some(), command.checksum.is_some()) {
                lacks.push(WireLack::Checksum { message });
            }
        }
        match self.arm {
            Some(ArmSpec::Operator) => lacks.push(WireLack::ArmedByOperator),
            Some(ArmSpec::ZeroCommand) => lacks.push(WireLack::ArmedByCommands),
            None => {}
        }
        let resets =
            |event: &super::EventSpec| !event.reset.is_empty() || event.on_frame == Some(super::RequestSpec::Reset);
        if self.preset.is_none() && !self.events.iter().any(resets) {
            lacks.push(WireLack::Reset);
        }
        lacks
    }
}
