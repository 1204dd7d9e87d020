//! Lockstep: simulated time, advanced by the controller's answers, and paced by the clock if a speed is requested.
//!
//! Sample 0 is published when the plant is armed for the first time. On a user protocol its readings are also sent
//! before that, repeatedly, for a controller that waits for a reading before it does anything. From then on an armed
//! plant waits for the command that answers the sample it published, with the node's own timeout. After a fault or a
//! disarm nobody answers, and the plant continues at the sample rate.

use core::time::Duration;

use super::bench::Bench;
use super::ending::Ending;
use super::error::RunError;
use super::finish::{EndedBy, RETRY_NS, finish};
use super::hold::Hold;
use super::pace::{Pace, Speed};
use super::report::{Histograms, PlantReport};
use super::signals::Signals;
use resonarm_bus::Bus;
use resonarm_realtime::{Clock, HistogramError, LatencyHistogram, SampleRate};

/// Longest sleep between two checks of the stop signal, ns.
pub(super) const LOOK_NS: u64 = 20_000_000;
/// Interval at which a plant that was never armed repeats the readings of sample 0, ns of the clock.
const REPEAT_NS: u64 = 50_000_000;
/// Silence of a plant that has sent readings before it was armed, until it publishes sample 0, ns of the clock.
/// Commands that don't name their sample may still be on their way as answers to those readings: they would count as
/// answers to sample 0, and shift all later ones by a sample. This silence also lets a controller distinguish sample 0
/// from the readings before it, though it or the plant may be stopped for 150 ms by a busy machine.
const SETTLE_NS: u64 = 500_000_000;

/// Runs the plant in lockstep on the calling thread, until its end or until it is asked to stop.
pub(super) fn lockstep<C: Clock>(
    bench: &mut Bench,
    bus: &mut dyn Bus,
    clock: &C,
    (rate, speed): (SampleRate, Speed),
    (ending, hold): (Ending, Option<&Hold>),
    signals: &Signals,
) -> Result<PlantReport, HistogramError> {
    let pace = Pace::start(clock, rate, speed)?;
    let exec = LatencyHistogram::new()?;
    let mut run = Lockstep { bench, bus, pace, rate, ending, hold, signals, exec };
    let ended = run.samples();
    let Lockstep { bench, bus, mut pace, exec, .. } = run;
    let (outcome, error) = finish(bench, bus, &mut pace, ended);
    Ok(PlantReport {
        histograms: Histograms { wakeup: None, exec: Some(exec.clone()) },
        wakeup_us: pace.wakeup_us(),
        exec_us: exec.percentiles(),
        pacing: pace.report(),
        ..PlantReport::new(bench, bench.counts(bus.statistics()), outcome, error)
    })
}

struct Lockstep<'r, 'b, 'c, C: Clock> {
    bench: &'r mut Bench<'b>,
    bus: &'r mut dyn Bus,
    pace: Pace<'c, C>,
    rate: SampleRate,
    ending: Ending,
    hold: Option<&'r Hold>,
    signals: &'r Signals,
    exec: LatencyHistogram,
}

impl<C: Clock> Lockstep<'_, '_, '_, C> {
    fn ended(&self) -> Option<EndedBy> {
        self.ending.reached(self.bench, self.signals, || self.pace.now_ns())
    }

    fn samples(&mut self) -> Result<EndedBy, RunError> {
        self.bench.start(self.pace.start_ns, self.pace.now_ns());
        if let Some(end) = self.wait_for_arming()? {
            return Ok(end);
        }
        // Sample 0 is due when the plant is armed. Waiting for it must not count as being late.
        self.pace.anchor(0);
        let mut now_ns = self.pace.now_ns();
        // An unpaced round is system calls for the most part, and on some machines each look at the clock is one.
        loop {
            let begun_ns = self.wait_until_due(now_ns)?;
            let begun_ns = self.hold(begun_ns)?;
            // Read before the sample goes out: only a plant that is armed when it publishes waits for an
            // answer.
            let awaited = self.bench.node.is_armed();
            self.pace.note(self.bench.sample());
            self.bench.measure()?;
            self.bench.transmit(begun_ns, self.bus)?;
            let published_ns = self.pace.now_ns();
            let mut answered_ns = published_ns;
            while awaited && self.waits_for_answer() && self.ended().is_none() {
                answered_ns = self.serve(answered_ns, LOOK_NS)?;
            }
            if !self.bench.node.is_armed() {
                answered_ns = self.pass_period(published_ns, answered_ns)?;
            }
            if let Some(end) = self.ended() {
                return Ok(end);
            }
            self.bench.advance(answered_ns)?;
            now_ns = self.pace.now_ns();
            // The time spent waiting for the answer is not work of the plant.
            let exec_ns = published_ns - begun_ns + (now_ns - answered_ns);
            self.exec.record(exec_ns);
            // The plant has advanced since, so the sample that was published is the one before.
            self.bench.notify_pace(self.bench.sample() - 1, self.pace.lag_ns, exec_ns);
            self.bench.show(self.signals.gauges(), self.pace.lag_ns, exec_ns, 0);
            self.signals.set_done(self.bench.sample());
        }
    }

    /// Waits until the plant is armed, and long enough that no earlier frame is still on its way; returns the cause of
    /// the end if the run ends instead.
    fn wait_for_arming(&mut self) -> Result<Option<EndedBy>, RunError> {
        let sends_readings = self.bench.node.sends_unarmed_readings();
        let mut repeat_at_ns = 0;
        let mut armed_at_ns = None;
        let mut now_ns = self.pace.now_ns();
        loop {
            if let Some(end) = self.ended() {
                return Ok(Some(end));
            }
            let mut limit_ns = LOOK_NS;
            if !self.bench.node.is_armed() {
                // If the plant is disarmed again, the silence begins anew with the next arming.
                armed_at_ns = None;
                if sends_readings && now_ns >= repeat_at_ns {
                    self.bench.publish_start()?;
                    repeat_at_ns = now_ns + REPEAT_NS;
                }
                if sends_readings {
                    limit_ns = limit_ns.min(repeat_at_ns - now_ns);
                }
            } else if sends_readings {
                let settled_ns = *armed_at_ns.get_or_insert(now_ns) + SETTLE_NS;
                if now_ns >= settled_ns {
                    return Ok(None);
                }
                limit_ns = limit_ns.min(settled_ns - now_ns);
            } else {
                return Ok(None);
            }
            now_ns = self.serve(now_ns, limit_ns)?;
        }
    }

    fn waits_for_answer(&self) -> bool {
        self.bench.node.is_armed() && !self.bench.node.is_answered()
    }

    /// Waits for the clock and processes incoming frames. Returns the time then.
    fn wait_until_due(&mut self, mut now_ns: u64) -> Result<u64, RunError> {
        loop {
            let left_ns = self.pace.left_ns(self.bench.sample());
            if left_ns == 0 || self.signals.is_stopped() {
                return Ok(now_ns);
            }
            now_ns = self.serve(now_ns, left_ns.min(LOOK_NS))?;
        }
    }

    /// Holds before the sample at which the caller asked for it. Returns the time then.
    fn hold(&mut self, mut now_ns: u64) -> Result<u64, RunError> {
        let Some(hold) = self.hold.filter(|hold| hold.sample == self.bench.sample()) else { return Ok(now_ns) };
        while !hold.is_over.0() && self.ended().is_none() {
            now_ns = self.serve(now_ns, LOOK_NS)?;
        }
        Ok(now_ns)
    }

    /// Lets one sample period pass without an answer and processes incoming frames. Returns the time then.
    fn pass_period(&mut self, published_ns: u64, mut now_ns: u64) -> Result<u64, RunError> {
        // By the clock, though time is simulated: without an answer to wait for, a plant without a pace would run
        // through its whole duration in a moment.
        let due_ns = published_ns + self.rate.offset_ns(1);
        while self.pace.report().is_none() && self.ended().is_none() {
            let left_ns = due_ns.saturating_sub(now_ns);
            if left_ns == 0 {
                break;
            }
            now_ns = self.serve(now_ns, left_ns.min(LOOK_NS))?;
        }
        Ok(now_ns)
    }

    /// Sends the queued frames, sleeps until a frame or a deadline comes, at most `limit_ns`, and processes incoming
    /// frames. Returns the time then.
    fn serve(&mut self, now_ns: u64, limit_ns: u64) -> Result<u64, RunError> {
        let sent = self.bench.transmit(now_ns, self.bus)?;
        // Frames that the bus has not taken are offered again soon.
        let limit_ns = if sent { limit_ns } else { limit_ns.min(RETRY_NS) };
        let due_ns = self.bench.node.next_deadline_ns().saturating_sub(now_ns);
        if let Err(error) = self.bus.wait(Duration::from_nanos(due_ns.min(limit_ns))) {
            self.bench.lose_bus(self.pace.now_ns(), error)?;
            self.pace.clock.sleep_until_ns(self.pace.clock.now_ns() + due_ns.min(limit_ns));
        }
        let now_ns = self.pace.now_ns();
        self.bench.receive(now_ns, self.bus)?;
        self.bench.handle_deadline(now_ns);
        Ok(now_ns)
    }
}
