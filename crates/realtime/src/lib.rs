//! Real time: the sole user of the system's clocks, and of its scheduler.
//!
//! A real-time run sets up a separate thread ([`ThreadSetup::apply`]), then starts a [`Periodic`] loop on it:
//!
//! ```no_run
//! use resonarm_realtime::{Action, OverrunPolicy, Periodic, SampleRate, SystemClock, ThreadSetup};
//!
//! let (report, _awake) = ThreadSetup::default().apply();
//! for shortfall in &report.shortfalls {
//!     eprintln!("{shortfall}");
//! }
//! let rate = SampleRate::new(1000.0)?;
//! let mut periodic = Periodic::start(&SystemClock, rate, OverrunPolicy::Continue)?;
//! for _ in 0..5000 {
//!     let tick = periodic.tick()?;
//!     if tick.action == Action::Fault { /* the plant's node latches its fault */ }
//!     // the work of step `tick.index`
//!     let bus_ns = 0; // how much of it went to the bus
//!     let exec_ns = periodic.finish(&tick, bus_ns);
//!     // `tick` and `exec_ns` go to the recorder's ring
//! }
//! println!("{} overruns", periodic.summary().overruns);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bare;
mod clock;
mod core_share;
mod idle;
mod latency;
mod overrun_cause;
mod periodic;
mod priority;
mod privileges;
mod rate;
mod shortfall;
mod spin;
mod thread;

pub use bare::bare_wakeups;
pub use clock::{Clock, SystemClock, VirtualClock, unix_time_ns};
pub use core_share::{CoreShare, STEAL_UNIT_NS, Share};
pub use idle::CoresAwake;
pub use latency::{HISTOGRAM_BOUND_NS, HistogramError, LatencyHistogram, Percentiles};
pub use overrun_cause::{OverrunCause, OverrunCauses};
pub use periodic::{
    Action, LoopSummary, MAX_LAG_NS, OverrunPolicy, Periodic, PeriodicError, Tick, UnknownOverrunPolicy,
};
pub use priority::{FifoPriority, PriorityError};
pub use privileges::{Finding, Privileges};
pub use rate::{MAX_RATE_HZ, MIN_RATE_HZ, RateError, SampleRate};
pub use shortfall::{Shortfall, Wanted};
pub use spin::{Spin, SpinChoice, SpinError};
pub use thread::{MemoryLock, PREFAULT_STACK_BYTES, ThreadReport, ThreadSetup};
