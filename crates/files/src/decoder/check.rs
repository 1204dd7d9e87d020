//! The checks of a message: checksum and counter.

use thiserror::Error;

use resonarm_bench::node::mapped::mapping::Protection;
use resonarm_protocol::Frame;
use resonarm_wire::checksum::ChecksumFault;
use resonarm_wire::counter::{CounterCheck, CounterFault, Step};

/// Why the receiver of a message refuses a frame of it.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum Fault {
    /// The payload ends before a signal that the mapping uses.
    #[error("its {got} bytes end before {signal}")]
    Short {
        /// The bytes of the payload.
        got: usize,
        /// The signal.
        signal: String,
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
    /// A signal that the mapping uses is no finite number.
    #[error("{signal} is {value}, no finite number")]
    NotFinite {
        /// The signal.
        signal: String,
        /// Its value.
        value: f64,
    },
}

impl Fault {
    /// What is wrong, without its numbers.
    pub const fn kind(&self) -> &'static str {
        match self {
            Fault::Checksum(_) => "checksum",
            Fault::Counter(_) | Fault::Lost { .. } => "counter",
            Fault::Short { .. } | Fault::NotFinite { .. } => "form or content",
        }
    }
}

/// Counter and checksum of a message, with the counter that came last.
#[derive(Clone, Debug)]
pub(crate) struct Checked {
    protection: Protection,
    counter: CounterCheck,
}

impl Checked {
    /// A check that has seen no frame.
    pub fn new(protection: &Protection) -> Checked {
        Checked { protection: protection.clone(), counter: CounterCheck::new() }
    }

    /// Checks checksum and counter of a frame, as the plant does; returns how the counter follows, `None` without one.
    /// More frames lost than are allowed are no fault here.
    ///
    /// # Errors
    /// [`Fault::Checksum`], [`Fault::Counter`]; [`Fault::Short`] if the payload ends before the counter.
    pub fn step(&mut self, frame: &Frame) -> Result<Option<Step>, Fault> {
        let payload = frame.data();
        if let Some(checksum) = &self.protection.checksum {
            checksum.check(frame.id(), payload)?;
        }
        let Some(counter) = &self.protection.counter else { return Ok(None) };
        let Some(value) = counter.read(payload) else {
            return Err(Fault::Short { got: payload.len(), signal: String::from("the counter") });
        };
        Ok(Some(self.counter.check(counter, value)?))
    }

    /// The same; returns the frames lost before.
    ///
    /// # Errors
    /// As [`Checked::step`], and [`Fault::Lost`].
    pub fn lost(&mut self, frame: &Frame) -> Result<u64, Fault> {
        match self.step(frame)? {
            Some(Step::Lost { frames }) if frames > self.protection.most_lost => {
                Err(Fault::Lost { frames, most: self.protection.most_lost })
            }
            Some(Step::Lost { frames }) => Ok(frames),
            Some(Step::First | Step::Next) | None => Ok(0),
        }
    }
}
