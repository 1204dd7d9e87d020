//! The CAN nodes as state machines without IO: the plant and the exciter controller.
//!
//! A node is given frames and the time, and asked for frames, deadlines and events:
//!
//! ```text
//! handle_frame(now, frame) ─┐                    ┌─ next_frame(), frame_sent() → frames to send
//! handle_deadline(now) ─────┼──►  node state  ──┼─ next_deadline_ns() → when to be called again
//! publish(measurement) ─────┘                    └─ poll_event() → what happened
//! ```
//!
//! A frame is made when it is fetched, so a full bus takes it later with the newest values: get it from `next_frame`,
//! and call `frame_sent` once the bus has taken it; `poll_transmit` does both.
//!
//! To end, call `fault` or `leave` (the exciter: `stop`, or `leave`), and continue to call the node until `is_quiet`:
//! the load has ramped to zero and all frames are sent.
//!
//! The exciter's node and the code that all nodes share are in the protocol's crate ([`resonarm_protocol::node`]); here
//! the node carries a [`Controller`](crate::control::Controller). Each node has a
//! [`NodeCore`](resonarm_protocol::node::NodeCore): state, fault, timeouts, counts and events. Beside it a plant has a
//! [`Guard`], and an exciter a [`Work`](resonarm_protocol::node::Work); the protocols differ in their codecs and in
//! their rules of arming.
//!
//! Times are nanoseconds of any monotonic clock. Nothing here allocates after construction. The rules are those of the
//! protocol's `SPEC.md`; the states are CANopen's (CiA 301), with its stopped state as fault.

mod carried;
mod cause;
pub mod cia402;
mod exciter_interface;
mod exciter_lack;
mod guard;
mod hold;
mod interface;
pub mod mapped;
mod plant;
mod refusals;
mod sample;
mod time_base;
mod wire;

pub use carried::{Carried, ExciterNode, ExciterOutcome, carry};
pub use cause::{FaultCause, RefusedFor, RefusedFrame, Unheeded};
pub use exciter_interface::ExciterInterface;
pub use exciter_lack::{ExciterLack, ExciterRemark};
pub use guard::Guard;
pub use interface::{PlantInterface, PublishError, PublishedSample};
pub use plant::PlantNode;
pub use refusals::{Refusals, RefusedLoad};
pub use resonarm_protocol::Refusal;
pub use resonarm_protocol::node::{FrameCheck, FrameCounts, FrameFault, NodeEvent, Timing};
pub use time_base::TimeBase;
pub use wire::WireSpec;

#[cfg(test)]
mod tests;
