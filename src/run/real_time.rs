//! Real time: samples at absolute deadlines.
//!
//! Tick k, due at k/rate: take in what came over the bus since tick k − 1, hold the command, advance from sample k − 1 to k,
//! measure and send sample k. A command that answers sample k − 1 before tick k thus acts from k − 1 on, exactly as in
//! lockstep. Nothing in the tick allocates, locks, logs or blocks; the bus and the tape promise the same.

use super::{BusCounts, End, PlantReport, PlantSide, RunError, Signals};
use crate::bus::Bus;
use crate::protocol::EmergencyCode;
use crate::realtime::{Action, Clock, OverrunPolicy, Periodic, SampleRate, Tick};
use crate::recording::{Record, TickRecord};

/// How to run in real time.
#[derive(Clone, Copy, Debug)]
pub struct RealTimeOptions {
    /// Samples a second.
    pub rate: SampleRate,
    /// What a missed deadline leads to.
    pub overrun: OverrunPolicy,
    /// When the run ends.
    pub end: End,
}

/// Runs the plant in real time on the calling thread, until its end or until it is asked to stop.
///
/// # Errors
/// [`RunError`], with the report of what went before it.
pub fn real_time<C: Clock>(
    side: &mut PlantSide,
    bus: &mut dyn Bus,
    clock: &C,
    options: &RealTimeOptions,
    signals: &Signals,
) -> (PlantReport, Result<(), RunError>) {
    let mut periodic = match Periodic::start(clock, options.rate, options.overrun) {
        Ok(periodic) => periodic,
        Err(error) => return (PlantReport::empty(), Err(error.into())),
    };
    let result = ticks(side, bus, &mut periodic, options, signals).and_then(|()| side.finish());
    let bus = BusCounts::new(bus.statistics(), side.counts());
    let report = PlantReport { timing: periodic.summary(), bus, fault: side.node().latched_fault() };
    (report, result)
}

impl PlantReport {
    /// The report of a run that never began.
    pub(super) fn empty() -> PlantReport {
        use crate::realtime::LoopSummary;
        let timing = LoopSummary { steps: 0, overruns: 0, wakeup_us: None, exec_us: None };
        PlantReport { timing, bus: BusCounts::default(), fault: None }
    }
}

fn ticks<C: Clock>(
    side: &mut PlantSide,
    bus: &mut dyn Bus,
    periodic: &mut Periodic<'_, C>,
    options: &RealTimeOptions,
    signals: &Signals,
) -> Result<(), RunError> {
    let start_ns = periodic.start_ns();
    side.begin(start_ns);
    side.start(0);
    loop {
        let tick = periodic.tick()?;
        let now_ns = tick.woke_ns.saturating_sub(start_ns);
        work(side, bus, &tick, now_ns)?;
        let exec_ns = periodic.finish(&tick);
        let (step, wakeup_ns, overruns) = (tick.index, tick.wakeup_ns, tick.missed);
        side.record(Record::Tick(TickRecord { step, wakeup_ns, exec_ns, overruns }))?;
        signals.set_step(tick.index);
        let over = options.end.after_samples.is_some_and(|samples| tick.index >= samples);
        if over || signals.is_stopped() || (options.end.on_disarm && side.has_left_armed()) {
            return Ok(());
        }
    }
}

fn work(side: &mut PlantSide, bus: &mut dyn Bus, tick: &Tick, now_ns: u64) -> Result<(), RunError> {
    side.receive(now_ns, bus)?;
    if tick.action == Action::Fault {
        side.fault(now_ns, EmergencyCode::Overrun, u16::try_from(tick.missed).unwrap_or(u16::MAX));
    }
    side.handle_deadline(now_ns)?;
    if tick.index > 0 {
        side.advance(now_ns)?;
    }
    side.measure()?;
    side.transmit(now_ns, bus)?;
    Ok(())
}
