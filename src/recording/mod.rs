//! Recordings: MCAP files written by a thread of their own, and read back.
//!
//! This room knows nothing of the arm: it is handed plain numbers ([`Record`]).

mod record;

pub use record::{Direction, Event, FrameRecord, Record, SampleRecord, StepRecord, TickRecord};
