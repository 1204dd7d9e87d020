//! Counter and checksum of a message, and their check by a receiver.

use thiserror::Error;

use resonarm_protocol::{Frame, FrameFormat};
use resonarm_wire::checksum::{Checksum, ChecksumFault};
use resonarm_wire::counter::{Counter, CounterCheck, CounterFault, Step};

/// Counter and checksum of a message, as far as it has them.
#[derive(Clone, Debug, Default)]
pub struct Protection {
    /// Alive counter of the message.
    pub counter: Option<Counter>,
    /// Largest number of consecutive frames that may be lost.
    pub most_lost: u64,
    /// Checksum of the message.
    pub checksum: Option<Checksum>,
}

/// Format and length of a message's frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Form {
    /// Classical CAN or CAN FD. Whether a frame switches the bit rate does not matter.
    pub format: FrameFormat,
    /// Length of the payload, bytes.
    pub length: usize,
}

impl Form {
    /// Checks that a frame may be one of the message: of its format, and not longer. A shorter one passes;
    /// whether it holds the used signals is found where they are read.
    ///
    /// # Errors
    /// [`ProtectionFault::Format`] or [`ProtectionFault::Long`].
    pub fn check(&self, frame: &Frame) -> Result<(), ProtectionFault> {
        let expected = self.format;
        let got = frame.format();
        let is_fd = |format| matches!(format, FrameFormat::Fd { .. });
        if is_fd(expected) != is_fd(got) || got == FrameFormat::Remote {
            return Err(ProtectionFault::Format { got, expected });
        }
        // CAN FD pads payloads to the next existing length, which is no error of the sender.
        let most = if is_fd(expected) { fd_length(self.length) } else { self.length };
        let got = frame.data().len();
        if got > most { Err(ProtectionFault::Long { got, most }) } else { Ok(()) }
    }
}

/// Returns the length of the CAN FD frame that holds a payload, which is the next existing one.
fn fd_length(length: usize) -> usize {
    [12, 16, 20, 24, 32, 48, 64].into_iter().find(|fd| *fd >= length).filter(|_| length > 8).unwrap_or(length)
}

/// Reason why the protection of a message rejects a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum ProtectionFault {
    /// The frame has another format than the message.
    #[error("it is a {}, but the message is a {}", format_name(*got), format_name(*expected))]
    Format {
        /// Format of the frame.
        got: FrameFormat,
        /// Format of the message.
        expected: FrameFormat,
    },
    /// The payload is longer than the message.
    #[error("it has {got} bytes, but the message has {most}")]
    Long {
        /// Length of the payload, bytes.
        got: usize,
        /// Largest length of a payload, bytes.
        most: usize,
    },
    /// The payload ends before the counter.
    #[error("its {got} bytes end before the counter")]
    Short {
        /// Length of the payload, bytes.
        got: usize,
    },
    /// The checksum, or a field that belongs to it, is wrong.
    #[error(transparent)]
    Checksum(#[from] ChecksumFault),
    /// The counter is repeated or beyond its values.
    #[error(transparent)]
    Counter(#[from] CounterFault),
    /// More consecutive frames were lost than are allowed.
    #[error("{frames} frames were lost before it, but at most {most} may be")]
    Lost {
        /// Number of lost frames according to the counter.
        frames: u64,
        /// Largest number of lost frames.
        most: u64,
    },
}

const fn format_name(format: FrameFormat) -> &'static str {
    match format {
        FrameFormat::Classic => "classic CAN frame",
        FrameFormat::Remote => "remote frame",
        FrameFormat::Fd { .. } => "CAN FD frame",
    }
}

/// Checks form and protection of a message, and remembers the last counter.
#[derive(Clone, Debug)]
pub struct ProtectionCheck {
    form: Form,
    protection: Protection,
    counter: CounterCheck,
}

impl ProtectionCheck {
    /// Returns a check that has seen no frame.
    pub fn new(form: Form, protection: &Protection) -> ProtectionCheck {
        ProtectionCheck { form, protection: protection.clone(), counter: CounterCheck::new() }
    }

    /// Checks format, length, checksum and counter. Returns how the counter follows, `None` without one. Too
    /// many lost frames are not a fault here.
    ///
    /// # Errors
    /// [`ProtectionFault`], but for [`ProtectionFault::Lost`].
    pub fn step(&mut self, frame: &Frame) -> Result<Option<Step>, ProtectionFault> {
        self.form.check(frame)?;
        let payload = frame.data();
        // The checksum comes before the counter, since a damaged counter must not become the last one.
        if let Some(checksum) = &self.protection.checksum {
            checksum.check(frame.id(), payload)?;
        }
        let Some(counter) = &self.protection.counter else { return Ok(None) };
        let value = counter.read(payload).ok_or(ProtectionFault::Short { got: payload.len() })?;
        Ok(Some(self.counter.check(counter, value)?))
    }

    /// Checks a frame and returns the number of frames lost before it.
    ///
    /// # Errors
    /// As [`ProtectionCheck::step`], and [`ProtectionFault::Lost`].
    pub fn lost(&mut self, frame: &Frame) -> Result<u64, ProtectionFault> {
        let most = self.protection.most_lost;
        match self.step(frame)? {
            Some(Step::Lost { frames }) if frames > most => Err(ProtectionFault::Lost { frames, most }),
            Some(Step::Lost { frames }) => Ok(frames),
            Some(Step::First | Step::Next) | None => Ok(0),
        }
    }
}
