//! Counter and checksum of a message as its receiver checks them.

use thiserror::Error;

use resonarm_protocol::{Frame, FrameFormat};
use resonarm_wire::checksum::{Checksum, ChecksumFault};
use resonarm_wire::counter::{Counter, CounterCheck, CounterFault, Step};

/// Counter and checksum of a message.
#[derive(Clone, Debug, Default)]
pub struct Protection {
    /// The alive counter.
    pub counter: Option<Counter>,
    /// The most frames that may be lost in a row.
    pub most_lost: u64,
    /// The checksum.
    pub checksum: Option<Checksum>,
}

/// The form of a message's frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Form {
    /// Classic CAN or CAN FD. Whether a frame switches the bit rate does not matter.
    pub format: FrameFormat,
    /// The length of the message, bytes.
    pub length: usize,
}

impl Form {
    /// Whether a frame may be one of the message: one of its format, and not longer. A shorter one passes: whether it
    /// holds the signals that are used is seen where they are read.
    ///
    /// # Errors
    /// [`ProtectionFault::Format`] or [`ProtectionFault::Long`].
    pub fn check(&self, frame: &Frame) -> Result<(), ProtectionFault> {
        let (expected, got) = (self.format, frame.format());
        let is_fd = |format| matches!(format, FrameFormat::Fd { .. });
        if is_fd(expected) != is_fd(got) || got == FrameFormat::Remote {
            return Err(ProtectionFault::Format { got, expected });
        }
        let most = if is_fd(expected) { fd_length(self.length) } else { self.length };
        let got = frame.data().len();
        if got > most { Err(ProtectionFault::Long { got, most }) } else { Ok(()) }
    }
}

/// The length of the CAN FD frame that holds a payload: the next that there is.
fn fd_length(length: usize) -> usize {
    [12, 16, 20, 24, 32, 48, 64].into_iter().find(|fd| *fd >= length).filter(|_| length > 8).unwrap_or(length)
}

/// Why the protection of a message refuses a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum ProtectionFault {
    /// The frame is of another format than the message.
    #[error("it is a {}, and the message is a {}", format_name(*got), format_name(*expected))]
    Format {
        /// The format of the frame.
        got: FrameFormat,
        /// That of the message.
        expected: FrameFormat,
    },
    /// The payload is longer than the message.
    #[error("it has {got} bytes, and the message has {most}")]
    Long {
        /// The bytes of the payload.
        got: usize,
        /// The most that it may have.
        most: usize,
    },
    /// The payload ends before the counter.
    #[error("its {got} bytes end before the counter")]
    Short {
        /// The bytes of the payload.
        got: usize,
    },
    /// The checksum, or what belongs to it, is wrong.
    #[error(transparent)]
    Checksum(#[from] ChecksumFault),
    /// The counter repeats or is beyond its values.
    #[error(transparent)]
    Counter(#[from] CounterFault),
    /// More frames were lost in a row than are allowed.
    #[error("{frames} frames were lost before it, and {most} may be")]
    Lost {
        /// The frames lost, according to the counter.
        frames: u64,
        /// The most that may be.
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

/// The form and the protection of a message, with the counter that came last.
#[derive(Clone, Debug)]
pub struct ProtectionCheck {
    form: Form,
    protection: Protection,
    counter: CounterCheck,
}

impl ProtectionCheck {
    /// A check that has seen no frame.
    pub fn new(form: Form, protection: &Protection) -> ProtectionCheck {
        ProtectionCheck { form, protection: protection.clone(), counter: CounterCheck::new() }
    }

    /// Checks format, length, checksum and counter; returns how the counter follows, `None` without one. More frames lost than are
    /// allowed are no fault here.
    ///
    /// # Errors
    /// [`ProtectionFault`], but for [`ProtectionFault::Lost`].
    pub fn step(&mut self, frame: &Frame) -> Result<Option<Step>, ProtectionFault> {
        self.form.check(frame)?;
        let payload = frame.data();
        if let Some(checksum) = &self.protection.checksum {
            checksum.check(frame.id(), payload)?;
        }
        let Some(counter) = &self.protection.counter else { return Ok(None) };
        let value = counter.read(payload).ok_or(ProtectionFault::Short { got: payload.len() })?;
        Ok(Some(self.counter.check(counter, value)?))
    }

    /// The same; returns the frames lost before.
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
