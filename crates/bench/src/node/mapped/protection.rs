//! Counter and checksum of a message as its receiver checks them.

use thiserror::Error;

use resonarm_protocol::Frame;
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

/// Why the protection of a message refuses a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum ProtectionFault {
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

/// The protection of a message, with the counter that came last.
#[derive(Clone, Debug)]
pub struct ProtectionCheck {
    protection: Protection,
    counter: CounterCheck,
}

impl ProtectionCheck {
    /// A check that has seen no frame.
    pub fn new(protection: &Protection) -> ProtectionCheck {
        ProtectionCheck { protection: protection.clone(), counter: CounterCheck::new() }
    }

    /// Checks checksum and counter; returns how the counter follows, `None` without one. More frames lost than are
    /// allowed are no fault here.
    ///
    /// # Errors
    /// [`ProtectionFault::Checksum`], [`ProtectionFault::Short`], [`ProtectionFault::Counter`].
    pub fn step(&mut self, frame: &Frame) -> Result<Option<Step>, ProtectionFault> {
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
