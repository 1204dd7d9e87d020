//! Free: plant and exciter in one loop, in simulated time, with the ends of a virtual bus between them.

use super::bench::Bench;
use super::ending::Ending;
use super::error::RunError;
use super::exciter::steer;
use super::finish::{EndedBy, outcome};
use super::mistakes::RefusedFrame;
use super::pace::Pace;
use super::report::PlantOutcome;
use super::signals::Signals;
use super::watch::{Notice, Watched};
use resonarm_bench::control::ResponsePoint;
use resonarm_bench::node::ExciterInterface;
use resonarm_bus::{BusError, Sent, Statistics, VirtualBus};
use resonarm_realtime::{Clock, SampleRate, VirtualClock};

/// Longest time that frames may still be on their way at the end, ns of simulated time.
const SEND_LIMIT_NS: u64 = 500_000_000;

/// A run of both nodes in one loop. All times are those of the samples and of the bus between them, so that the same
/// scenario produces byte-identical recordings.
pub(super) struct Free<'r, 'b, 'c, C: Clock> {
    pub bench: &'r mut Bench<'b>,
    pub exciter: &'r mut dyn ExciterInterface,
    /// The plant's end of the bus.
    pub near: &'r mut dyn VirtualBus,
    /// The exciter's end of the bus.
    pub far: &'r mut dyn VirtualBus,
    /// The time of the bus and of the nodes.
    pub clock: VirtualClock,
    pub rate: SampleRate,
    pub pace: Pace<'c, C>,
    pub ending: Ending,
    /// Time by which the plant must be armed, ns.
    pub arming_ns: u64,
    /// Whether plant and exciter hand each other the readings and loads that the protocol does not carry.
    pub hands_over: bool,
    pub signals: &'r Signals,
    pub watched: Option<Watched>,
    pub responses: Vec<ResponsePoint>,
    /// The first frame that the exciter rejected in one of its checks.
    pub first_refused: Option<RefusedFrame>,
}

impl<C: Clock> Free<'_, '_, '_, C> {
    /// Runs until the exciter has finished, the duration has passed, or a stop is requested.
    pub fn run(&mut self) -> (PlantOutcome, Option<RunError>) {
        let ended = self.samples();
        if !matches!(ended, Ok(_) | Err(RunError::Plant(_))) {
            self.bench.fail_if_armed(self.now_ns());
        }
        let outcome = outcome(self.bench, &ended);
        let simulates = !matches!(ended, Err(RunError::Plant(_)));
        let rest = self.finish(simulates);
        match ended.err().or(rest.err()) {
            Some(error) => (PlantOutcome::Failed, Some(error)),
            None => (outcome, None),
        }
    }

    fn now_ns(&self) -> u64 {
        self.clock.now_ns()
    }

    fn samples(&mut self) -> Result<EndedBy, RunError> {
        self.bench.start(0, 0);
        self.exciter.start(0);
        self.exchange()?;
        loop {
            // In simulated time nobody may come later: who has not armed the plant by then never will.
            if !self.bench.was_armed() && self.now_ns() >= self.arming_ns {
                return Err(RunError::Stalled { plant: self.bench.node.state(), exciter: self.exciter.state() });
            }
            self.measure()?;
            if let Some(end) = self.ending.reached(self.bench, self.signals, || self.now_ns()) {
                return Ok(end);
            }
            self.pass_sample()?;
        }
    }

    fn measure(&mut self) -> Result<(), RunError> {
        let sample = self.bench.sample();
        self.pace.sleep(sample);
        self.pace.note(sample);
        self.bench.measure()?;
        // A frame arrives at once on this bus, so these readings belong to the frames of this sample.
        if self.hands_over {
            self.exciter.carried_mut().hand_over(&self.bench.measured.more);
        }
        self.exchange()?;
        self.responses.extend(core::iter::from_fn(|| {
            let response = self.exciter.carried_mut().poll_response()?;
            self.watched.iter_mut().for_each(|watched| watched.notify(Notice::Response(response)));
            Some(response)
        }));
        if let Some(watched) = &mut self.watched {
            steer(self.exciter, watched);
        }
        self.signals.set_responses(self.responses.len());
        self.bench.show(self.signals.gauges(), self.pace.lag_ns, 0, 0);
        self.signals.set_done(sample);
        Ok(())
    }

    /// Lets the time to the next sample pass on the bus, then advances the plant with the load that is held by then.
    fn pass_sample(&mut self) -> Result<(), RunError> {
        let due_ns = self.rate.offset_ns(self.bench.sample() + 1);
        self.pass_until(due_ns)?;
        self.bench.advance(self.now_ns())?;
        self.clock.advance_to_ns(due_ns);
        Ok(())
    }

    /// Works like [`finish`](super::finish::finish), in simulated time.
    fn finish(&mut self, simulates: bool) -> Result<(), RunError> {
        self.bench.node.leave(self.now_ns());
        // The exciter is told directly, since both are in this loop: it need not find out by a timeout.
        self.exciter.plant_ended(self.now_ns());
        while simulates && self.bench.node.is_ramping() {
            self.pass_sample()?;
            self.measure()?;
        }
        self.exchange()?;
        self.pass_until(self.now_ns() + SEND_LIMIT_NS)?;
        self.bench.record_end();
        Ok(())
    }

    /// Lets the frames that are on their way on the bus arrive, up to `until_ns`.
    fn pass_until(&mut self, until_ns: u64) -> Result<(), RunError> {
        loop {
            // Time jumps from event to event: nothing on the bus changes between them.
            let next_ns = [self.near.next_event_ns(), self.far.next_event_ns()].into_iter().flatten().min();
            let Some(next_ns) = next_ns.filter(|next_ns| *next_ns <= until_ns) else { return Ok(()) };
            self.clock.advance_to_ns(next_ns);
            self.exchange()?;
        }
    }

    /// Carries frames both ways until no more frames move at this time.
    fn exchange(&mut self) -> Result<(), RunError> {
        let now_ns = self.now_ns();
        self.bench.handle_deadline(now_ns);
        self.exciter.handle_deadline(now_ns);
        let mut moved = self.moved();
        loop {
            // A frame may be answered at the same instant, so both ends are served until neither moves one.
            self.bench.transmit(now_ns, self.near)?;
            if let Err(error) = self.answer(now_ns) {
                // A controller that is bus-off comes back.
                if !error.is_recoverable() {
                    return Err(error.into());
                }
                self.exciter.bus_lost(now_ns);
            }
            self.bench.receive(now_ns, self.near)?;
            self.bench.handle_deadline(now_ns);
            let before = core::mem::replace(&mut moved, self.moved());
            if moved == before {
                return Ok(());
            }
        }
    }

    /// Lets the exciter process incoming frames, and sends its frames.
    fn answer(&mut self, now_ns: u64) -> Result<(), BusError> {
        let mut has_heard = false;
        while let Some(received) = self.far.receive()? {
            has_heard = true;
            let refused = self.exciter.frames().refused;
            self.exciter.handle_frame(now_ns, &received.frame);
            if self.exciter.frames().refused > refused {
                let sample = self.exciter.samples_played();
                self.first_refused.get_or_insert(RefusedFrame { sample, frame: received.frame });
            }
        }
        if has_heard
            && self.hands_over
            && let Some((index, load)) = self.exciter.answering_load()
        {
            self.bench.node.hand_over(index, &load);
        }
        while let Some(frame) = self.exciter.next_frame() {
            if self.far.send(&frame)? == Sent::QueueFull {
                break;
            }
            self.exciter.frame_sent();
        }
        Ok(())
    }

    /// Returns how many frames each end has sent and received.
    fn moved(&self) -> [u64; 4] {
        let [near, far]: [Statistics; 2] = [self.near.statistics(), self.far.statistics()];
        [near.sent, near.received, far.sent, far.received]
    }
}
