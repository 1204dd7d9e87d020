//! When the commands of a user protocol are judged.

/// Time at which the commands of a user protocol are judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimeBase {
    /// Commands are judged at the deadline of each sample; each message, or drive, has its own timeout.
    Clock,
    /// Commands are judged when the last published sample has its answer; the timeout is that of the run.
    Lockstep,
}
