//! Where an exciter stands in its work, and in leaving the bus.

use super::answering::Outcome;

/// What the controller is at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Phase<A> {
    /// Looking for the plant and arming it.
    Arming,
    /// Answering samples.
    Playing,
    /// Disarming the plant, for this outcome.
    Disarming(Outcome<A>),
    /// The work has ended so.
    Done(Outcome<A>),
}

/// Where a controller stands in leaving the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Leave {
    /// Not asked to.
    Stay,
    /// Asked to; it is told when the work is done.
    Asked,
    /// Told.
    Told,
}
