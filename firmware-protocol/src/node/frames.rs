//! Counts of a node's frames, and the reasons for which it rejects one.

use core::fmt;

use crate::error::DecodeError;
use crate::frame::Id;

/// Counts of the frames that a node dropped, rejected or changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameCounts {
    /// Frames that were never sent, because newer ones replaced them.
    pub unsent: u64,
    /// Frames that were rejected for their checks.
    pub refused: u64,
    /// Frames from another node with identifiers that only this node sends.
    pub other_sender: u64,
    /// Commands of a user protocol that newer ones replaced before they could act.
    pub overwritten: u64,
    /// Values in frames that were sent which their signals could not represent: the nearest was sent.
    pub limited_values: u64,
}

/// The check that a rejected frame failed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FrameFault {
    /// A check of Resonarm's protocol: E2E, length or values.
    Protocol(DecodeError),
    /// A check of a message of another protocol.
    Mapped {
        /// Identifier of the rejected frame.
        id: Id,
        /// Check that the frame failed.
        check: FrameCheck,
    },
}

/// The checks of a message of another protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameCheck {
    /// The frame is a CAN FD frame and the message a classic one, or the reverse.
    Format,
    /// The payload ends before a signal, or is longer than the message.
    Length,
    /// The checksum is wrong.
    Checksum,
    /// The counter repeats, or more frames were lost than are allowed.
    Counter,
    /// A signal is no finite number.
    Value,
}

impl fmt::Display for FrameCheck {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            FrameCheck::Format => "its frame format is wrong: classic CAN in place of CAN FD, or the reverse",
            FrameCheck::Length => "its length is not that of the message",
            FrameCheck::Checksum => "its checksum is wrong",
            FrameCheck::Counter => "its counter is repeated, or too many frames were lost before it",
            FrameCheck::Value => "one of its signals is not a finite number",
        })
    }
}
