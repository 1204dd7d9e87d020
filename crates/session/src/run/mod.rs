//! Runs of a scenario by the three run loops, as one session.
//!
//! [`Session`] puts everything together once: plant, exciter, bus, recording, pace and end. A plant on a memory bus,
//! with a controller of one's own at its other end, takes this much:
//!
//! ```
//! use resonarm_bus::memory;
//! use resonarm_session::run::{Mode, Options, PlantOutcome, Session, Signals};
//! use resonarm_scenario::Scenario;
//!
//! let mut ends = memory::hub(2, 1024);
//! let (controller, mut plant) = (ends.pop().unwrap(), ends.pop().unwrap());
//! # drop(controller);
//! let options = Options { patience: Some(std::time::Duration::from_millis(10)), ..Options::default() };
//! let session = Session::new(Scenario::default(), Mode::Lockstep, options)?;
//! let report = session.plant(&mut plant, &Signals::default(), &mut |event| println!("{event:?}"))?;
//! assert_eq!(report.outcome, PlantOutcome::NotArmed); // nobody holds the other end
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! One sample, whatever the loop:
//!
//! ```text
//! measure(k) → frames out → frames in, until the deadline → command held (zero-order) → advance to k + 1
//! ```
//!
//! - [`Mode::RealTime`]: samples at absolute deadlines of the monotonic clock; commands that arrived by then count.
//! - [`Mode::Lockstep`]: simulated time; an armed plant waits for the command that answers the sample before it
//!   advances.
//! - [`Mode::Free`]: simulated time and no bus: plant and exciter in one loop, as fast as possible.
//!
//! For the same commands the three modes produce bit-identical states. Simulated time may be paced by the clock
//! ([`Speed`]), which changes no state either.
//!
//! Every run ends in order: an armed plant is disarmed, or faults if an error ends it, samples continue
//! while the load ramps to zero, and the partner is notified.

mod bench;
mod core_watch;
mod ending;
mod error;
mod event_record;
mod exciter;
mod exciter_end;
mod fault;
mod finish;
mod free;
mod gauges;
mod hold;
mod hosted;
mod lockstep;
mod mistakes;
mod mode;
mod outage;
mod pace;
mod parts;
mod real_time;
mod record_sink;
mod report;
mod round_trip;
mod session;
mod signals;
mod thread;
mod watch;

pub use error::RunError;
pub use event_record::{sample_record, state_record};
pub use exciter_end::ExciterEnd;
pub use fault::Fault;
pub use gauges::{Gauges, Shown};
pub use hosted::{HostPort, HostedExciter, HostedPlant};
pub use mode::{Mode, UnknownMode};
pub use pace::{Pacing, Speed, SpeedError};
pub use report::{
    BothReport, BusCounts, ExciterReport, Histograms, PlantOutcome, PlantReport, RefusedCommands, fault_text,
};
pub use session::{OnShortfall, Options, RecordTo, Session};
pub use signals::{BusLoss, RunEvent, Signals};
pub use watch::{CommandRecord, End, NotAsked, Notice, Request, TestState, Watch, Watched, Watcher, watch};

#[cfg(test)]
mod tests;
