//! Causes of a plant's fault beyond its code: what the controller did, with counts and the first frame.

use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;
use core::fmt;

use thiserror::Error;

use resonarm_protocol::node::FrameCheck;
use resonarm_protocol::{DecodeError, Frame};

/// Cause of a plant's fault, beyond the code.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum FaultCause {
    /// A message requested a stop.
    #[error("stopped by {message}{}", signal.as_ref().map_or(String::new(), |(signal, value)| format!(", {signal} = {value}")))]
    Stop {
        /// Name of the message.
        message: Arc<str>,
        /// Signal that requested it, with its value; `None` if every frame of the message requests it.
        signal: Option<(Arc<str>, f64)>,
    },
    /// No command was accepted in time, although something was received.
    #[error("{0}")]
    Unheeded(Unheeded),
}

/// Frames and commands that were received and not used since the plant was armed or all of its drives accepted
/// a command.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Unheeded {
    /// Number of frames that failed a check.
    pub frames: u64,
    /// First frame that failed a check.
    pub first: Option<RefusedFrame>,
    /// Number of commands that came before a condition of the mapping was met.
    pub early: u64,
    /// Message that has to meet the condition.
    pub condition: Option<Arc<str>>,
}

/// A frame that was rejected.
#[derive(Clone, Debug, PartialEq)]
pub struct RefusedFrame {
    /// Frame as it was received.
    pub frame: Frame,
    /// Check that the frame failed.
    pub why: RefusedFor,
}

/// Check that a frame failed.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum RefusedFor {
    /// A check of Resonarm's protocol.
    #[error("{0}")]
    Protocol(DecodeError),
    /// A check of a user protocol's message.
    #[error("{name}: {check}")]
    Message {
        /// Name of the message.
        name: Arc<str>,
        /// Check that the frame failed.
        check: FrameCheck,
    },
    /// A PDO was shorter than its mapping.
    #[error("RPDO {number} needs {mapped} bytes, but the frame has fewer")]
    ShortPdo {
        /// Number of the PDO, from 1.
        number: u16,
        /// Length of its mapping, bytes.
        mapped: usize,
    },
    /// A check of another CANopen frame.
    #[error("{0}")]
    CanOpen(FrameCheck),
}

impl Unheeded {
    /// Returns whether everything that was received was used.
    pub const fn is_empty(&self) -> bool {
        self.frames == 0 && self.early == 0
    }

    /// Notes a frame that was rejected.
    pub(super) fn refuse(&mut self, frame: &Frame, why: RefusedFor) {
        self.frames += 1;
        self.first.get_or_insert(RefusedFrame { frame: *frame, why });
    }

    /// Notes a command that came before the message `condition` had a required value.
    pub(super) fn command_early(&mut self, condition: &Arc<str>) {
        self.early += 1;
        self.condition.get_or_insert_with(|| condition.clone());
    }
}

impl fmt::Display for Unheeded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Unheeded { frames, first, early, condition } = self;
        match (frames, first) {
            (1, Some(RefusedFrame { frame, why })) => write!(f, "1 frame was rejected, {frame}: {why}")?,
            (_, Some(RefusedFrame { frame, why })) => {
                write!(f, "{frames} frames were rejected, the first of them {frame}: {why}")?;
            }
            (_, None) => {}
        }
        if let Some(condition) = condition {
            let separator = if *frames > 0 { "; " } else { "" };
            let (commands, were) = if *early == 1 { ("command", "was") } else { ("commands", "were") };
            write!(
                f,
                "{separator}{early} {commands} came before {condition} had a required value, and {were} rejected"
            )?;
        }
        Ok(())
    }
}
