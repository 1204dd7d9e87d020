//! Why a plant faulted, beyond the code of its fault: what its controller did, with counts and the first frame.

use alloc::sync::Arc;
use core::fmt;

use super::FrameCheck;
use resonarm_protocol::{DecodeError, Frame};

/// Why a plant faulted, beyond the code.
#[derive(Clone, Debug, PartialEq)]
pub enum FaultCause {
    /// A message asked it to stop.
    Stop(StopRequest),
    /// No command was taken in time, though something came.
    Unheeded(Unheeded),
}

/// The message that asked a plant to stop.
#[derive(Clone, Debug, PartialEq)]
pub struct StopRequest {
    /// Name of the message.
    pub message: Arc<str>,
    /// The signal that asked, with its value; `None`: every frame of the message asks.
    pub signal: Option<(Arc<str>, f64)>,
}

/// What came and was not used since a plant was armed, or all of its drives took a command.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Unheeded {
    /// Frames that were refused for their checks.
    pub frames: u64,
    /// The first of them.
    pub first: Option<RefusedFrame>,
    /// Commands that came before a condition of the mapping was met.
    pub early: u64,
    /// The message that has to meet it.
    pub condition: Option<Arc<str>>,
}

/// A frame that was refused.
#[derive(Clone, Debug, PartialEq)]
pub struct RefusedFrame {
    /// The frame as it was received.
    pub frame: Frame,
    /// The check that it failed.
    pub why: RefusedFor,
}

/// Why a frame was refused.
#[derive(Clone, Debug, PartialEq)]
pub enum RefusedFor {
    /// A check of Resonarm's protocol.
    Protocol(DecodeError),
    /// A check of a user's message.
    Message {
        /// The name of the message.
        name: Arc<str>,
        /// The check.
        check: FrameCheck,
    },
    /// A PDO that is shorter than its mapping.
    ShortPdo {
        /// The number of the PDO, from 1.
        number: u16,
        /// The bytes of its mapping.
        mapped: usize,
    },
    /// A check of another frame of CANopen.
    CanOpen(FrameCheck),
}

impl Unheeded {
    /// Whether nothing came that was not used.
    pub const fn is_empty(&self) -> bool {
        self.frames == 0 && self.early == 0
    }

    /// Notes a frame that was refused.
    pub(super) fn refuse(&mut self, frame: &Frame, why: RefusedFor) {
        self.frames += 1;
        self.first.get_or_insert(RefusedFrame { frame: *frame, why });
    }

    /// Notes a command that came before the message `condition` had a value that is required.
    pub(super) fn command_early(&mut self, condition: &Arc<str>) {
        self.early += 1;
        self.condition.get_or_insert_with(|| condition.clone());
    }
}

impl fmt::Display for FaultCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FaultCause::Stop(StopRequest { message, signal: None }) => write!(f, "stopped by {message}"),
            FaultCause::Stop(StopRequest { message, signal: Some((signal, value)) }) => {
                write!(f, "stopped by {message}, {signal} = {value}")
            }
            FaultCause::Unheeded(unheeded) => unheeded.fmt(f),
        }
    }
}

impl fmt::Display for Unheeded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Unheeded { frames, first, early, condition } = self;
        match (frames, first) {
            (1, Some(RefusedFrame { frame, why })) => write!(f, "1 frame was refused, {frame}: {why}")?,
            (_, Some(RefusedFrame { frame, why })) => {
                write!(f, "{frames} frames were refused, the first of them {frame}: {why}")?;
            }
            (_, None) => {}
        }
        if let Some(condition) = condition {
            let separator = if *frames > 0 { "; " } else { "" };
            let (commands, were) = if *early == 1 { ("command", "was") } else { ("commands", "were") };
            write!(
                f,
                "{separator}{early} {commands} came before {condition} had a required value, and {were} refused"
            )?;
        }
        Ok(())
    }
}

impl fmt::Display for RefusedFor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RefusedFor::Protocol(error) => error.fmt(f),
            RefusedFor::Message { name, check } => write!(f, "{name}: {check}"),
            RefusedFor::ShortPdo { number, mapped } => {
                write!(f, "RPDO {number} has {mapped} bytes, and this frame fewer")
            }
            RefusedFor::CanOpen(check) => check.fmt(f),
        }
    }
}
