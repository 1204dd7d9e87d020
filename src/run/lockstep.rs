//! Lockstep: virtual time, advanced by the controller's answers.
//!
//! Sample 0 is published when the plant is armed for the first time. From then on an armed plant waits for the command that
//! answers the sample it published, with the node's own timeout; after a fault or a disarm there is nobody to wait for, and
//! the plant goes on at the sample rate.

use core::time::Duration;

use super::{BusCounts, End, PlantReport, PlantSide, RunError, Signals};
use crate::bus::Bus;
use crate::realtime::{Clock, LatencyHistogram, LoopSummary, SampleRate};

/// Longest sleep between two looks at the stop signal, ns.
const LOOK_NS: u64 = 20_000_000;
/// How long to wait before a full transmit queue is tried again, ns.
const RETRY_NS: u64 = 500_000;

/// Runs the plant in lockstep on the calling thread, until its end or until it is asked to stop.
///
/// # Errors
/// [`RunError`], with the report of what went before it.
pub fn lockstep<C: Clock>(
    side: &mut PlantSide,
    bus: &mut dyn Bus,
    clock: &C,
    rate: SampleRate,
    end: End,
    signals: &Signals,
) -> (PlantReport, Result<(), RunError>) {
    let exec = match LatencyHistogram::new() {
        Ok(exec) => exec,
        Err(error) => return (PlantReport::empty(), Err(error.into())),
    };
    let start_ns = clock.now_ns();
    side.begin(start_ns);
    let mut run = Lockstep { side, bus, clock, rate, end, signals, start_ns, exec };
    let result = run.samples().and_then(|()| run.side.finish());
    let timing =
        LoopSummary { steps: run.side.plant().step(), overruns: 0, wakeup_us: None, exec_us: run.exec.percentiles() };
    let bus = BusCounts::new(run.bus.statistics(), run.side.counts());
    (PlantReport { timing, bus, fault: run.side.node().latched_fault() }, result)
}

struct Lockstep<'a, C: Clock> {
    side: &'a mut PlantSide,
    bus: &'a mut dyn Bus,
    clock: &'a C,
    rate: SampleRate,
    end: End,
    signals: &'a Signals,
    start_ns: u64,
    exec: LatencyHistogram,
}

impl<C: Clock> Lockstep<'_, C> {
    fn now_ns(&self) -> u64 {
        self.clock.now_ns().saturating_sub(self.start_ns)
    }

    fn is_over(&self) -> bool {
        let samples = self.end.after_samples.is_some_and(|samples| self.side.plant().step() >= samples);
        samples || self.signals.is_stopped() || (self.end.on_disarm && self.side.has_left_armed())
    }

    fn samples(&mut self) -> Result<(), RunError> {
        self.side.start(self.now_ns());
        while !self.side.node().is_armed() {
            if self.is_over() {
                return Ok(());
            }
            self.serve(LOOK_NS)?;
        }
        loop {
            let published_ns = self.now_ns();
            let awaited = self.side.node().is_armed();
            self.side.measure()?;
            while awaited && self.side.node().is_armed() && !self.side.node().is_answered() && !self.is_over() {
                self.serve(LOOK_NS)?;
            }
            if !self.side.node().is_armed() {
                self.pass_period(published_ns)?;
            }
            if self.is_over() {
                return self.flush();
            }
            let before_ns = self.clock.now_ns();
            self.side.advance(before_ns.saturating_sub(self.start_ns))?;
            self.exec.record(self.clock.now_ns().saturating_sub(before_ns));
            self.signals.set_step(self.side.plant().step());
        }
    }

    /// Nobody answers: lets one sample period pass, taking in what comes.
    fn pass_period(&mut self, published_ns: u64) -> Result<(), RunError> {
        let due_ns = published_ns + self.rate.offset_ns(1);
        while !self.is_over() {
            let left_ns = due_ns.saturating_sub(self.now_ns());
            if left_ns == 0 {
                break;
            }
            self.serve(left_ns.min(LOOK_NS))?;
        }
        Ok(())
    }

    /// Sends what there is, sleeps until a frame or a deadline comes, `limit_ns` at most, and takes in what came.
    fn serve(&mut self, limit_ns: u64) -> Result<(), RunError> {
        let sent = self.side.transmit(self.now_ns(), self.bus)?;
        let limit_ns = if sent { limit_ns } else { limit_ns.min(RETRY_NS) };
        let due_ns = self.side.node().next_deadline_ns().saturating_sub(self.now_ns());
        self.bus.wait(Duration::from_nanos(due_ns.min(limit_ns)))?;
        let now_ns = self.now_ns();
        self.side.receive(now_ns, self.bus)?;
        self.side.handle_deadline(now_ns)
    }

    /// Sends what is left.
    fn flush(&mut self) -> Result<(), RunError> {
        for _ in 0..100 {
            if self.side.transmit(self.now_ns(), self.bus)? {
                break;
            }
            self.bus.wait(Duration::from_nanos(RETRY_NS))?;
        }
        Ok(())
    }
}
