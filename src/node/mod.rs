//! The CAN nodes as state machines without IO: the plant and the exciter controller.
//!
//! A node is told of frames and of the time, and asked for frames, deadlines and events:
//!
//! ```text
//! handle_frame(now, frame) ─┐                    ┌─ poll_transmit() → frames to send
//! handle_deadline(now) ─────┼──►  node state  ──┼─ next_deadline_ns() → when to be called again
//! publish(measurement) ─────┘                    └─ poll_event() → what happened
//! ```
//!
//! Times are nanoseconds of any clock that only goes forward. Nothing here allocates after construction. The rules are those
//! of the protocol's `SPEC.md`; the states are CANopen's (CiA 301), with its stopped state as fault.

mod event;
mod exciter;
mod link;
mod plant;
mod queue;
mod response;
mod timing;

pub use event::{NodeEvent, Refusal};
pub use exciter::{ExciterNode, Outcome};
pub use plant::PlantNode;
pub use response::ResponsePoint;
pub use timing::Timing;

#[cfg(test)]
mod tests;
