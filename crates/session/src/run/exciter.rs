//! The exciter controller on a bus: answers samples as they come, in real time and in lockstep alike.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;

use super::error::RunError;
use super::event_record::{event_record, request_records, sample_record};
use super::finish::{RETRY_NS, SEND_LIMIT_NS};
use super::lockstep::LOOK_NS;
use super::mistakes::{RefusedFrame, unsent_command};
use super::outage::{self, Outage};
use super::report::{BusCounts, ExciterReport};
use super::signals::{BusLoss, Signals};
use super::watch::{CommandRecord, End, Notice, Request, TestState, Watched};
use resonarm_bench::control::{ResponsePoint, TestReport};
use resonarm_bench::node::{ExciterInterface, ExciterOutcome};
use resonarm_bus::{Bus, BusError, Sent};
use resonarm_files::recording::{Direction, Event, FrameRecord, Record};
use resonarm_protocol::{Emergency, EmergencyCode, Frame, Node, NodeState};
use resonarm_realtime::Clock;
use resonarm_scenario::Scenario;

/// Frames processed between two checks of the stop signal and the deadlines, so that a flooded bus delays neither.
const FRAMES_AT_ONCE: usize = 256;

/// The time to wait for a plant, and the number of restarts after a fault.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patience<'r> {
    /// Longest wait until a plant is armed; `None` waits forever.
    pub wait: Option<Duration>,
    /// Number of times that it may arm again and start anew.
    pub rearm: u32,
    /// In a process with both ends, set once the only plant on the bus has ended; then none is waited for. `None` for
    /// an exciter alone.
    pub plant_ended: Option<&'r AtomicBool>,
}

impl Patience<'_> {
    /// Says whether no plant will appear any more. All frames of the plant are on the bus by then.
    fn has_plant_ended(&self) -> bool {
        self.plant_ended.is_some_and(|ended| ended.load(Ordering::Acquire))
    }
}

/// Runs the exciter on the calling thread until its profile is played, it faults, or it is asked to stop.
pub(super) fn run<C: Clock>(
    node: &mut dyn ExciterInterface,
    bus: &mut dyn Bus,
    clock: &C,
    patience: Patience<'_>,
    (signals, watched): (&Signals, Option<Watched>),
    scenario: &Scenario,
) -> ExciterReport {
    let start_ns = clock.now_ns();
    let mut run = Run {
        node,
        bus,
        clock,
        start_ns,
        patience,
        outage: None,
        jammed_since_ns: None,
        bus_loss: None,
        first_refused: None,
        rearmed: 0,
        signals,
        watched,
        responses: Vec::new(),
    };
    let answered = run.answer();
    let left_unheard = matches!(answered, Ok(Answered::PlantEnded)).then_some(ExciterOutcome::PlantLeft);
    let error = answered.and_then(|_end| run.send_rest()).err();
    let Run { bus, responses, rearmed, bus_loss, first_refused, .. } = run;
    let counts = BusCounts::new(bus.statistics(), node.frames());
    let outcome = left_unheard.or(node.outcome());
    let report = ExciterReport::new(node, outcome, error, first_refused, scenario);
    ExciterReport { responses, rearmed, bus: counts, bus_loss, ..report }
}

/// Cause of the end of the exciter's loop.
enum Answered {
    /// The node has finished its work.
    Node,
    /// The plant has ended, and was never heard to be armed.
    PlantEnded,
}

impl ExciterReport {
    /// Makes the report of `node`'s work in a run of `scenario`, without its responses and the counts of the bus.
    pub(super) fn new(
        node: &dyn ExciterInterface,
        outcome: Option<ExciterOutcome>,
        error: Option<RunError>,
        first_refused: Option<RefusedFrame>,
        scenario: &Scenario,
    ) -> ExciterReport {
        let is_beyond = matches!(
            outcome,
            Some(ExciterOutcome::Faulted(Emergency {
                node: Node::Exciter,
                code: EmergencyCode::CommandOutOfRange,
                ..
            }))
        );
        let unsent = node.carried().last_answer().filter(|_| is_beyond);
        ExciterReport {
            outcome,
            partner_fault: node.plant_fault(),
            bus_loss: None,
            cause: unsent.map(|(sample, load)| unsent_command(sample, &load, scenario)),
            first_refused_frame: first_refused.map(|refused| refused.in_words(scenario)),
            error,
            samples_played: node.samples_played(),
            missed_samples: node.work().missed_samples(),
            slipped_periods: node.slipped_periods(),
            rearmed: 0,
            bus: BusCounts::default(),
            responses: Vec::new(),
            test: TestReport::new(&*node.carried().controller),
        }
    }
}

struct Run<'r, C: Clock> {
    node: &'r mut dyn ExciterInterface,
    bus: &'r mut dyn Bus,
    clock: &'r C,
    start_ns: u64,
    patience: Patience<'r>,
    /// The outage of the bus, while it is lost.
    outage: Option<Outage>,
    /// Time since which its transmit queue has accepted nothing, ns.
    jammed_since_ns: Option<u64>,
    /// Cause of the last loss of the bus.
    bus_loss: Option<BusLoss>,
    /// The first frame that the node rejected in one of its checks.
    first_refused: Option<RefusedFrame>,
    rearmed: u32,
    signals: &'r Signals,
    watched: Option<Watched>,
    responses: Vec<ResponsePoint>,
}

impl<C: Clock> Run<'_, C> {
    fn now_ns(&self) -> u64 {
        self.clock.now_ns().saturating_sub(self.start_ns)
    }

    fn answer(&mut self) -> Result<Answered, RunError> {
        self.node.start(0);
        loop {
            let now_ns = self.now_ns();
            // Looked at before the bus: once nothing is left unread, all that the plant has sent was taken in.
            let has_plant_ended = self.patience.has_plant_ended();
            let came = self.take_in(now_ns);
            let is_all_read = self.survive(now_ns, came)?.unwrap_or(true);
            let plant_ended = has_plant_ended && is_all_read;
            if self.signals.is_stopped() {
                self.node.leave(now_ns);
            }
            self.node.handle_deadline(now_ns);
            let sent = self.transmit();
            // What a lost bus did not take waits for the next look.
            let sent = self.survive(now_ns, sent)?.unwrap_or(true);
            self.read_responses();
            self.serve_watcher(now_ns);
            self.signals.set_responses(self.responses.len());
            self.signals.set_done(self.node.samples_played());
            if self.patience.plant_ended.is_none() {
                self.signals.gauges().set_answered(self.node.samples_played(), self.node.state());
            }
            if plant_ended {
                self.node.plant_ended(now_ns);
            }
            if self.has_ended(now_ns) {
                return Ok(Answered::Node);
            }
            if plant_ended && self.waits_for_plant() {
                return Ok(Answered::PlantEnded);
            }
            self.check_patience(now_ns)?;
            let due_ns = self.node.next_deadline_ns().saturating_sub(now_ns);
            // Nothing tells when a full queue takes frames again, so it is tried again soon.
            self.wait(due_ns.min(if sent { LOOK_NS } else { RETRY_NS }))?;
        }
    }

    /// Says whether the work is done. After a fault with a try left the node restarts, once the bus accepts frames
    /// again: frames heard before then can date from before the fault. A bus whose queue accepts none for long is given
    /// up.
    fn has_ended(&mut self, now_ns: u64) -> bool {
        let Some(outcome) = self.node.outcome() else { return false };
        let begins_anew = matches!(outcome, ExciterOutcome::Faulted(_)) && self.rearmed < self.patience.rearm;
        if !begins_anew || self.signals.is_stopped() {
            return true;
        }
        if let Some(outage) = &self.outage {
            return outage.is_too_long(now_ns);
        }
        if let Some(since_ns) = self.jammed_since_ns {
            return outage::is_too_long(since_ns, now_ns);
        }
        if !self.node.rearm(now_ns) {
            return true;
        }
        self.rearmed += 1;
        // The profile is played from its start again, so the responses of the first try would be there twice.
        self.responses.clear();
        false
    }

    /// Processes and answers at most [`FRAMES_AT_ONCE`] incoming frames; returns `true` if nothing is left unread.
    fn take_in(&mut self, now_ns: u64) -> Result<bool, BusError> {
        // Bounded, so that a flooded bus can't keep the node from its deadlines.
        for _ in 0..FRAMES_AT_ONCE {
            let Some(received) = self.bus.receive()? else { return Ok(true) };
            self.outage.iter_mut().for_each(Outage::hear);
            self.notify_frame(Direction::Received, received.timestamp_ns, received.frame);
            let refused = self.node.frames().refused;
            self.node.handle_frame(now_ns, &received.frame);
            if self.node.frames().refused > refused {
                let sample = self.node.samples_played();
                self.first_refused.get_or_insert(RefusedFrame { sample, frame: received.frame });
            }
            // An answer must not wait for the frames behind the sample.
            self.transmit()?;
        }
        Ok(false)
    }

    /// Sleeps until a frame arrives, at most `limit_ns`.
    fn wait(&mut self, limit_ns: u64) -> Result<(), RunError> {
        let Err(error) = self.bus.wait(Duration::from_nanos(limit_ns)) else { return Ok(()) };
        self.survive::<bool>(self.now_ns(), Err(error))?;
        // A lost bus returns from its wait at once. Without this sleep the loop would spin until the bus is back.
        self.clock.sleep_until_ns(self.clock.now_ns() + limit_ns);
        Ok(())
    }

    /// Handles a bus that is off or down and may come back: a controller at work faults, and the run continues for a
    /// while. Returns `None` while the bus is lost.
    fn survive<T>(&mut self, now_ns: u64, outcome: Result<T, BusError>) -> Result<Option<T>, RunError> {
        let error = match outcome {
            Ok(value) => return Ok(Some(value)),
            Err(error) => error,
        };
        if !error.is_recoverable() {
            return Err(error.into());
        }
        let outage = *self.outage.get_or_insert_with(|| Outage::new(now_ns, &error));
        self.bus_loss = Some(outage.cause);
        if outage.is_too_long(now_ns) {
            return Err(error.into());
        }
        self.node.bus_lost(now_ns);
        Ok(None)
    }

    fn read_responses(&mut self) {
        while let Some(response) = self.node.carried_mut().poll_response() {
            self.responses.push(response);
            self.watched.iter_mut().for_each(|watched| watched.notify(Notice::Response(response)));
        }
    }

    /// Notifies watchers of events, and does what they request.
    fn serve_watcher(&mut self, now_ns: u64) {
        let Some(watched) = &mut self.watched else { return };
        if watched.end == End::Exciter {
            notify_answers(self.node, watched);
            notify_events(self.node, watched);
        }
        if steer(self.node, watched) {
            self.node.leave(now_ns);
        }
    }

    fn check_patience(&self, now_ns: u64) -> Result<(), RunError> {
        let Some(patience) = self.patience.wait.filter(|patience| u128::from(now_ns) > patience.as_nanos()) else {
            return Ok(());
        };
        let waited_s = patience.as_secs_f64();
        // Two errors, since they have different remedies: no plant on the bus, or one that can't be armed.
        if !self.node.has_heard_plant() {
            return Err(RunError::NoPlant { waited_s });
        }
        if self.rearmed == 0 && self.waits_for_plant() {
            return Err(RunError::PlantNotArmed { waited_s });
        }
        Ok(())
    }

    /// Says whether the plant was not heard to be armed yet.
    fn waits_for_plant(&self) -> bool {
        self.node.state() == NodeState::PreOperational && self.node.samples_played() == 0
    }

    /// Sends the queued frames; returns `true` if all are sent.
    fn transmit(&mut self) -> Result<bool, BusError> {
        while let Some(frame) = self.node.next_frame() {
            if self.bus.send(&frame)? == Sent::QueueFull {
                self.jammed_since_ns.get_or_insert(self.now_ns());
                return Ok(false);
            }
            self.node.frame_sent();
            self.jammed_since_ns = None;
            let controller = self.bus.controller();
            // The kernel's queue has taken a frame, which alone does not prove that the bus works.
            self.outage = self.outage.filter(|outage| !outage.is_over(controller));
            self.notify_frame(Direction::Sent, None, frame);
        }
        Ok(true)
    }

    /// Notifies those who watch an exciter alone of a frame. A received frame counts to the next sample, a sent one to
    /// the sample before.
    fn notify_frame(&mut self, direction: Direction, bus_timestamp_ns: Option<u64>, frame: Frame) {
        let next = self.node.samples_played();
        let start_ns = self.start_ns;
        let clock = self.clock;
        let Some(watched) = self.watched.as_mut().filter(|watched| watched.end == End::Exciter) else { return };
        let sample = match direction {
            Direction::Received => next,
            Direction::Sent => next.saturating_sub(1),
        };
        watched.notify_frame(|| FrameRecord {
            sample,
            direction,
            time_ns: clock.now_ns().saturating_sub(start_ns),
            bus_timestamp_ns,
            frame,
        });
    }

    /// Leaves the bus: sends the remaining frames, above all the disarm, which the plant answers if it has not yet. A
    /// plant that sent no sample may report the reason.
    fn send_rest(&mut self) -> Result<(), RunError> {
        self.node.leave(self.now_ns());
        let end_ns = self.now_ns() + SEND_LIMIT_NS;
        let mut lost = None;
        while self.now_ns() < end_ns {
            lost = match self.transmit() {
                Ok(true) if self.node.is_quiet() && !self.node.awaits_reason() => return Ok(()),
                Ok(_) => None,
                Err(error) if error.is_recoverable() => Some(error),
                Err(error) => return Err(error.into()),
            };
            let now_ns = self.now_ns();
            let came = self.take_in(now_ns);
            self.survive(now_ns, came)?;
            // Not the bus's own wait, which unread frames end at once.
            self.clock.sleep_until_ns(self.clock.now_ns() + RETRY_NS);
        }
        // The bus is still lost: this says more than the fault that followed from it.
        lost.map_or(Ok(()), |error| Err(error.into()))
    }
}

/// Notifies watchers of the answered samples, and of the answers.
fn notify_answers(node: &mut dyn ExciterInterface, watched: &mut Watched) {
    while let Some((measurement, load)) = node.carried_mut().poll_answer() {
        watched.notify(Notice::Record(Record::Sample(sample_record(&measurement))));
        watched.notify(Notice::Command(CommandRecord { sample: measurement.sample, load }));
    }
}

fn notify_events(node: &mut dyn ExciterInterface, watched: &mut Watched) {
    while let Some(event) = node.poll_event() {
        notify_event(node, watched, event_record(&event));
    }
}

/// Notifies watchers of an event at the next sample. Its time on the clock does not matter to them.
fn notify_event(node: &dyn ExciterInterface, watched: &mut Watched, (name, value): (&'static str, i64)) {
    let event = Event { sample: node.samples_played(), time_ns: 0, name, value };
    watched.notify(Notice::Record(Record::Event(event)));
}

/// Passes requested set-points to the controller and reports the current one; returns whether a disarm was requested.
pub(super) fn steer(node: &mut dyn ExciterInterface, watched: &mut Watched) -> bool {
    let mut disarm = false;
    while let Some(request) = watched.request() {
        disarm |= request == Request::Disarm;
        // A plant beside it records the request.
        if watched.end == End::Exciter {
            request_records(&request).into_iter().flatten().for_each(|record| notify_event(node, watched, record));
        }
        if let Request::Set(set_point) = &request
            && !node.carried_mut().controller.steer(set_point)
        {
            notify_event(node, watched, ("request.refused", 0));
        }
    }
    let controller = &node.carried().controller;
    watched.notify_set_point(controller.set_point());
    let test = controller.test_progress().map(|progress| TestState { progress, stopped: controller.test_stop() });
    watched.notify_test(node.samples_played(), test);
    disarm
}
