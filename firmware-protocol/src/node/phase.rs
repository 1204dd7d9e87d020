//! The phases of an exciter's work, and of leaving the bus.

use super::answering::ExciterOutcome;

/// The phase of the work.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Phase<A> {
    /// Looking for the plant and arming it.
    Arming,
    /// Answering samples.
    Playing,
    /// Disarming the plant, for this outcome.
    Disarming(ExciterOutcome<A>),
    /// The work has ended with this outcome.
    Done(ExciterOutcome<A>),
}

/// The phase of leaving the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Leave {
    /// Not asked to.
    Stay,
    /// Asked to; announced when the work is done.
    Asked,
    /// Announced.
    Announced,
}
