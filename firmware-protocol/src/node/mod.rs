//! What plant and exciter as nodes have in common, as state machines without IO: they are told of frames and of the
//! time, and asked for frames, deadlines and events.
//!
//! Times are nanoseconds of any clock that only goes forward. Nothing here needs a heap.

mod event;
mod link;
mod listening;
mod outbox;
mod queue;
mod sequence;
mod timing;

pub use event::NodeEvent;
pub use link::Link;
pub use listening::Listening;
pub use queue::Queue;
pub use sequence::{Place, Sequence};
pub use timing::Timing;
