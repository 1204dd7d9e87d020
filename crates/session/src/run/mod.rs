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
mod error;
mod event_record;
mod exciter;
mod exciter_end;
mod finish;
mod free;
mod gauges;
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
pub use gauges::{Gauges, Shown};
pub use hosted::{HostPort, HostedExciter, HostedPlant};
pub use mode::{Mode, UnknownMode};
pub use pace::{Speed, SpeedError};
pub use report::{
    BothReport, BusCounts, ExciterReport, Fault, Histograms, Pacing, PlantOutcome, PlantReport, RefusedCommands,
    fault_text,
};
pub use session::{OnShortfall, Options, RecordTo, Session};
pub use signals::{BusLoss, RunEvent, Signals};
pub use watch::{CommandRecord, End, NotAsked, Notice, Request, TestState, Watch, Watched, Watcher, watch};

use self::bench::Bench;
use self::finish::EndedBy;

/// Conditions that end a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Ending {
    /// Ends the run after this many samples.
    after_samples: Option<u64>,
    /// Ends the run when an armed plant is disarmed or faults.
    on_disarm: bool,
    /// Ends the run if nobody has armed the plant after this time, ns.
    patience_ns: Option<u64>,
}

impl Ending {
    /// Returns the cause that ends the run now, if any. The time is read only where it matters.
    fn reached(&self, bench: &Bench, signals: &Signals, now_ns: impl Fn() -> u64) -> Option<EndedBy> {
        if signals.is_stopped() {
            Some(EndedBy::Signal)
        } else if self.on_disarm && bench.has_left_armed() {
            Some(EndedBy::Disarm)
        } else if self.after_samples.is_some_and(|samples| bench.sample() >= samples) {
            Some(EndedBy::Duration)
        } else if !bench.was_armed()
            && (signals.has_exciter_ended() || self.patience_ns.is_some_and(|patience_ns| now_ns() >= patience_ns))
        {
            Some(EndedBy::Patience)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests;
