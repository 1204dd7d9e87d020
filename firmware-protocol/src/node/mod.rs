//! The exciter's node, and what all nodes have in common: state machines without IO, heap and clock.
//!
//! [`NodeCore`] is the core of every node, also on other protocols: state, fault, timeouts, counts, events. [`Work`] is
//! what an exciter does with it, and [`Link`] a node's connection by Resonarm's protocol.
//!
//! [`ExciterNode`] arms the plant, asks your [`Answering`] for the load at each sample, disarms, and detects
//! faults. Frames and the time go in, frames come out:
//!
//! ```text
//! handle_frame(now, frame) ─┐             ┌─ next_frame(), frame_sent() → frames to send
//! handle_deadline(now) ─────┴─► node ─────┴─ next_deadline_ns() → when to be called again
//! ```
//!
//! Pass all waiting frames before calling `handle_deadline`, and call that at least once per look period of its
//! [`Timing`]: timeouts count the time in which the node listened. A frame is made when it is fetched: fetch it
//! again after any other call, and call `frame_sent` once the bus has taken it. To end, call `leave` and continue until
//! `is_quiet`.
//!
//! ```
//! use resonarm_protocol::node::{Answer, Answering, ExciterNode, Timing};
//! use resonarm_protocol::{Capabilities, Network, Node, SamplesPerFrame, SensorValues};
//!
//! /// Damps the tip: the force answers the force in the impedance head.
//! struct Damping;
//!
//! impl Answering for Damping {
//!     type Abort = core::convert::Infallible;
//!
//!     fn restart(&mut self) {}
//!
//!     fn answer(&mut self, _sample: u64, values: &SensorValues) -> Answer<Self::Abort> {
//!         Answer::HoldForce { force_x_n: -0.1 * values.force_n[0].value, force_y_n: 0.0 }
//!     }
//! }
//!
//! let capabilities = Capabilities {
//!     node: Node::Exciter,
//!     samples_per_frame: SamplesPerFrame::One,
//!     force_limit_n: 100.0,
//!     torque_limit_nm: 0.0,
//! };
//! let mut node = ExciterNode::new(Network::default(), 1000, Timing::real_time(1000), capabilities, Damping);
//! node.start(0);
//! while let Some(frame) = node.poll_transmit() {
//!     // To the CAN controller.
//!     assert!(frame.len() <= 8);
//! }
//! assert!(node.next_deadline_ns() <= 100_000_000);
//! ```
//!
//! Times are nanoseconds of any monotonic clock. The rules are those of `SPEC.md`, sections 5 to 9.

mod answering;
mod event;
mod exciter;
mod frames;
mod link;
mod listening;
mod node_core;
mod outbox;
mod queue;
mod sequence;
mod timing;
mod work;

pub use answering::{Answer, Answering, ExciterOutcome};
pub use event::NodeEvent;
pub use exciter::ExciterNode;
pub use frames::{FrameCheck, FrameCounts, FrameFault};
pub use link::{Link, Unused};
pub use listening::Listening;
pub use node_core::NodeCore;
pub use queue::Queue;
pub use timing::Timing;
pub use work::{Phase, Unanswered, Work};
