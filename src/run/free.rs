//! Free: plant and exciter in one loop, in simulated time, without a bus.

use super::bench::Bench;
use super::finish::{EndedBy, outcome};
use super::pace::Pace;
use super::{BusCounts, Ending, Outcome, RunError, Signals};
use crate::bus::Received;
use crate::control::ResponsePoint;
use crate::node::ExciterNode;
use crate::realtime::{Clock, SampleRate};

/// A run of both nodes in one loop. The times of everything are those of the samples, so that the same scenario gives the
/// same recording byte for byte.
pub(super) struct Free<'r, 'b, 'c, C: Clock> {
    pub bench: &'r mut Bench<'b>,
    pub exciter: &'r mut ExciterNode,
    pub rate: SampleRate,
    pub pace: Pace<'c, C>,
    pub ending: Ending,
    pub signals: &'r Signals,
    pub responses: Vec<ResponsePoint>,
    /// Frames between the nodes, as the plant sees them.
    pub bus: BusCounts,
}

impl<C: Clock> Free<'_, '_, '_, C> {
    /// Runs until the exciter has finished, the duration has passed, or the run is asked to stop.
    pub fn run(&mut self) -> (Outcome, Option<RunError>) {
        let ended = self.samples();
        let outcome = outcome(self.bench, &ended);
        let simulates = !matches!(ended, Err(RunError::Plant(_)));
        let rest = self.finish(simulates);
        match ended.err().or(rest.err()) {
            Some(error) => (Outcome::Failed, Some(error)),
            None => (outcome, None),
        }
    }

    fn now_ns(&self) -> u64 {
        self.rate.offset_ns(self.bench.sample())
    }

    fn samples(&mut self) -> Result<EndedBy, RunError> {
        self.bench.start(0, 0)?;
        self.exciter.start(0);
        self.exchange()?;
        if !self.bench.node().is_armed() {
            return Err(RunError::Stalled { plant: self.bench.node().state(), exciter: self.exciter.state() });
        }
        loop {
            self.measure()?;
            if let Some(end) = self.ending.reached(self.bench, self.signals, self.now_ns()) {
                return Ok(end);
            }
            self.bench.advance(self.now_ns())?;
        }
    }

    fn measure(&mut self) -> Result<(), RunError> {
        let sample = self.bench.sample();
        self.pace.sleep(sample);
        self.pace.note(sample);
        self.bench.measure()?;
        self.exchange()?;
        self.responses.extend(core::iter::from_fn(|| self.exciter.poll_response()));
        self.signals.set_responses(self.responses.len());
        self.signals.set_done(sample);
        Ok(())
    }

    /// As [`finish`](super::finish::finish), without a bus.
    fn finish(&mut self, simulates: bool) -> Result<(), RunError> {
        self.bench.leave(self.now_ns());
        while simulates && self.bench.node().is_ramping() {
            self.bench.advance(self.now_ns())?;
            self.measure()?;
        }
        self.exchange()?;
        self.bench.record_end()
    }

    /// Carries frames both ways until neither node has one.
    fn exchange(&mut self) -> Result<(), RunError> {
        let now_ns = self.now_ns();
        self.bench.handle_deadline(now_ns)?;
        self.exciter.handle_deadline(now_ns);
        loop {
            let mut quiet = true;
            while let Some(frame) = self.bench.next_frame(now_ns)? {
                self.bus.sent += 1;
                self.exciter.handle_frame(now_ns, &frame);
                quiet = false;
            }
            while let Some(frame) = self.exciter.poll_transmit() {
                self.bus.received += 1;
                self.bench.take(now_ns, &Received { frame, timestamp_ns: None })?;
                quiet = false;
            }
            self.bench.handle_deadline(now_ns)?;
            if quiet {
                return Ok(());
            }
        }
    }
}
