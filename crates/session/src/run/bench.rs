//! The plant with its node and its recording: the steps that all run loops share.

use super::error::RunError;
use super::event_record::{controller_record, event_record, request_records, sample_record, state_record};
use super::fault::Fault;
use super::gauges::Gauges;
use super::mistakes::{RefusedFrame, last_such_sample};
use super::outage::Outage;
use super::record_sink::RecordSink;
use super::report::BusCounts;
use super::round_trip::RoundTrips;
use super::signals::{BusLoss, RunEvent};
use super::watch::{Notice, Request, Watched};
use resonarm_bench::node::{NodeEvent, PlantInterface, PublishedSample};
use resonarm_bench::plant::{Plant, PlantError};
use resonarm_bench::rig::{Load, Measurement};
use resonarm_bus::{Bus, BusError, ControllerState, Received, Sent, Statistics};
use resonarm_files::recording::{Direction, Event, FrameRecord, Record, TickRecord};
use resonarm_protocol::{Emergency, EmergencyCode, Frame, NodeState, OperatorRequest, Trip};

/// Frames taken from the bus in one go: bounds the work of a sample. At 1 Mbit/s a sample of 1 ms has at most 9 frames.
const FRAMES_AT_ONCE: usize = 256;
/// Frames given to the bus in one go. More wait only after a jam.
const FRAMES_SENT_AT_ONCE: usize = 16;

/// The plant, its node and the sink of its records.
pub(super) struct Bench<'a> {
    pub plant: Plant,
    pub node: Box<dyn PlantInterface>,
    steps_per_sample: u32,
    records: RecordSink,
    watched: Option<Watched>,
    on_event: Box<dyn FnMut(RunEvent) + 'a>,
    /// Memory for the frames that are sent next.
    batch: Vec<Frame>,
    /// The outage of the bus, while it is lost.
    outage: Option<Outage>,
    /// Cause of the last loss of the bus.
    pub bus_loss: Option<BusLoss>,
    /// Whether another sender of the plant's messages has been reported.
    other_sender_reported: bool,
    /// The first frame that the node rejected in one of its checks.
    pub first_refused_frame: Option<RefusedFrame>,
    /// The state of the bus's controller reported last.
    controller: ControllerState,
    /// Round-trip times of commands; `None` if the run is not in real time.
    pub round_trips: Option<RoundTrips>,
    /// Number of samples measured so far.
    pub samples: u64,
    /// Readings of the last sample.
    pub measured: Measurement,
    /// Whether `measured` is of sample 0, which was published before the plant was armed in lockstep.
    is_start_measured: bool,
    /// The load from the sample before to this one.
    held: Load,
}

impl<'a> Bench<'a> {
    pub fn new(
        plant: Plant,
        node: Box<dyn PlantInterface>,
        steps_per_sample: u32,
        records: RecordSink,
        watched: Option<Watched>,
        on_event: Box<dyn FnMut(RunEvent) + 'a>,
    ) -> Bench<'a> {
        Bench {
            plant,
            node,
            steps_per_sample,
            records,
            watched,
            on_event,
            batch: Vec::with_capacity(FRAMES_SENT_AT_ONCE),
            outage: None,
            bus_loss: None,
            other_sender_reported: false,
            first_refused_frame: None,
            controller: ControllerState::Active,
            round_trips: None,
            samples: 0,
            measured: Measurement::default(),
            is_start_measured: false,
            held: Load::default(),
        }
    }

    /// Returns an independent copy in the same state that keeps its records and reports events to nobody. The original
    /// must do the same.
    pub fn unwatched_copy(&self) -> Bench<'static> {
        let plant = self.plant.clone();
        let node = self.node.boxed_clone();
        let records = self.records.copy_of_kept();
        Bench {
            outage: self.outage,
            bus_loss: self.bus_loss,
            other_sender_reported: self.other_sender_reported,
            first_refused_frame: self.first_refused_frame,
            controller: self.controller,
            samples: self.samples,
            measured: self.measured,
            is_start_measured: self.is_start_measured,
            held: self.held,
            ..Bench::new(plant, node, self.steps_per_sample, records, None, Box::new(|_| {}))
        }
    }

    /// Returns the records that were kept since the last call.
    pub fn take_records(&mut self) -> Vec<Record> {
        self.records.take_kept()
    }

    /// Returns the index of the plant's current sample.
    pub fn sample(&self) -> u64 {
        self.plant.sample()
    }

    /// Returns the number of integration steps made so far.
    pub fn steps(&self) -> u64 {
        self.plant.sample() * u64::from(self.steps_per_sample)
    }

    /// Adds the bus's `statistics` to the node's counts of frames.
    pub fn counts(&self, statistics: Statistics) -> BusCounts {
        BusCounts::new(statistics, self.node.frames())
    }

    /// Says whether the plant was ever armed.
    pub fn was_armed(&self) -> bool {
        self.node.core().arms() > 0
    }

    /// Says whether the plant was armed once and has been disarmed or has faulted.
    pub fn has_left_armed(&self) -> bool {
        self.node.core().leaves() > 0
    }

    /// Boots the node of a run that began when the loop's clock read `clock_ns`.
    pub fn start(&mut self, clock_ns: u64, now_ns: u64) {
        self.records.begin(clock_ns);
        self.node.start(now_ns);
        self.report_events(now_ns);
        (self.on_event)(RunEvent::Ready);
    }

    /// Records a record of the loop itself.
    pub fn record(&mut self, record: &Record) {
        self.notify_watcher(record);
        self.records.record(record);
    }

    /// Notifies watchers, but not the recording, of a sample's delay and execution time in simulated time.
    pub fn notify_pace(&mut self, sample: u64, wakeup_ns: u64, exec_ns: u64) {
        self.notify_watcher(&Record::Tick(TickRecord { sample, wakeup_ns, exec_ns, overruns: 0, cause: None }));
    }

    /// Shows the sample, its delay, its execution time, and the deadlines missed before it in `gauges`.
    pub fn show(&self, gauges: &Gauges, late_ns: u64, work_ns: u64, missed: u32) {
        gauges.count(late_ns, work_ns, missed);
        gauges.set(&self.held, self.node.state());
    }

    fn notify_watcher(&mut self, record: &Record) {
        match (&mut self.watched, record) {
            (Some(watched), Record::Frame(frame)) => watched.notify_frame(|| *frame),
            (Some(watched), record) => watched.notify(Notice::Record(*record)),
            (None, _) => {}
        }
    }

    /// Executes the requests of watchers through the node's own gate, and records them.
    fn handle_requests(&mut self, now_ns: u64) {
        while let Some(request) = self.watched.as_mut().and_then(Watched::request) {
            request_records(&request).into_iter().flatten().for_each(|(name, value)| {
                self.record_event(now_ns, name, value);
            });
            match request {
                Request::Arm => self.node.execute(now_ns, OperatorRequest::Arm),
                Request::Disarm => self.node.execute(now_ns, OperatorRequest::Disarm),
                Request::Reset => self.node.execute(now_ns, OperatorRequest::Reset),
                Request::Set(_) => {} // the exciter's
            }
        }
    }

    fn record_event(&mut self, now_ns: u64, name: &'static str, value: i64) {
        let sample = self.sample();
        self.record(&Record::Event(Event { sample, time_ns: now_ns, name, value }));
    }

    /// Latches a fault from outside the node.
    pub fn fault(&mut self, now_ns: u64, code: EmergencyCode, detail: u64) {
        self.node.fault(now_ns, code, u16::try_from(detail).unwrap_or(u16::MAX));
    }

    /// Makes an armed plant fault if the run can't continue for an error of its own.
    pub fn fail_if_armed(&mut self, now_ns: u64) {
        if self.node.is_armed() {
            self.fault(now_ns, EmergencyCode::SimulationFailed, 0);
        }
    }

    /// Reports that the schedule has moved by `periods`.
    pub fn slipped(&mut self, periods: u32) {
        // The node tells its partner, and the recording.
        self.node.slip(u64::from(periods));
        let sample = self.sample();
        (self.on_event)(RunEvent::Slipped { sample, periods });
    }

    /// Processes all frames that have arrived on the bus.
    pub fn receive(&mut self, now_ns: u64, bus: &mut dyn Bus) -> Result<(), RunError> {
        self.handle_requests(now_ns);
        let mut outcome = Ok(());
        // Bounded, so that a flooded bus can't keep the plant from its next sample.
        for _ in 0..FRAMES_AT_ONCE {
            match bus.receive() {
                Ok(Some(received)) => self.take(now_ns, &received),
                Ok(None) => break,
                Err(error) => {
                    outcome = self.lose_bus(now_ns, error);
                    break;
                }
            }
        }
        self.heed_controller(now_ns, bus.controller());
        outcome
    }

    /// Reports a state change of the CAN controller. The run continues.
    fn heed_controller(&mut self, now_ns: u64, state: ControllerState) {
        if state == self.controller {
            return;
        }
        self.controller = state;
        let sample = self.sample();
        (self.on_event)(RunEvent::Controller { sample, state });
        self.record_event(now_ns, controller_record(state), 0);
    }

    /// Gives a received frame to the node, and records it.
    pub fn take(&mut self, now_ns: u64, received: &Received) {
        // Recorded before it is checked, so that the recording also has the frames that are rejected.
        self.record_frame(Direction::Received, now_ns, received.timestamp_ns, received.frame);
        self.outage.iter_mut().for_each(Outage::hear);
        let refused = self.node.frames().refused;
        self.node.handle_frame(now_ns, &received.frame);
        // The node counts rejected frames and does not say which frame it was, so the count before and after tells.
        if self.node.frames().refused > refused {
            let sample = self.sample();
            self.first_refused_frame.get_or_insert(RefusedFrame { sample, frame: received.frame });
        }
        if let (Some(index), Some(round_trips)) = (self.node.take_echoed(), &mut self.round_trips) {
            round_trips.arrive(index, now_ns, received.timestamp_ns);
        }
    }

    /// Does the work that is due, and records its events.
    pub fn handle_deadline(&mut self, now_ns: u64) {
        self.node.handle_deadline(now_ns);
        self.report_events(now_ns);
    }

    fn report_events(&mut self, now_ns: u64) {
        while let Some(event) = self.node.poll_event() {
            let (name, value) = event_record(&event);
            self.record_event(now_ns, name, value);
            self.report(&event);
        }
    }

    /// Reports an event of the node to watchers.
    fn report(&mut self, event: &NodeEvent) {
        let sample = self.sample();
        match event {
            NodeEvent::State { to: NodeState::Operational, .. } => {
                (self.on_event)(RunEvent::Armed { sample });
            }
            // A fault is reported by its emergency, which has the reason.
            NodeEvent::State { from: NodeState::Operational, to } => {
                if *to == NodeState::PreOperational {
                    (self.on_event)(RunEvent::Disarmed { sample });
                }
            }
            NodeEvent::Emergency(emergency) if emergency.code == EmergencyCode::Incompatible => {
                let fault = self.fault_found(emergency);
                (self.on_event)(RunEvent::NotArmed { fault });
            }
            NodeEvent::Emergency(emergency) if emergency.code.is_notice() => {}
            NodeEvent::Emergency(emergency) => {
                let partner = self.node.fault_reason().map(|reason| self.fault_found(&reason));
                let fault = self.fault_found(emergency);
                (self.on_event)(RunEvent::Faulted { fault, partner });
            }
            // Once a run: another network with the same base would report each of its frames.
            NodeEvent::OtherSender(identifier) if !self.other_sender_reported => {
                self.other_sender_reported = true;
                (self.on_event)(RunEvent::OtherSender { sample, identifier: *identifier });
            }
            NodeEvent::State { .. } | NodeEvent::Refused(_) | NodeEvent::Frame(_) => {}
            NodeEvent::PartnerEmergency(_) | NodeEvent::OtherSender(_) | NodeEvent::Lost(_) => {}
        }
    }

    /// Returns a fault that was found by now, with the full index of its sample.
    pub fn fault_found(&self, emergency: &Emergency) -> Fault {
        Fault::at(emergency, last_such_sample(emergency.sample, self.sample()))
    }

    /// Measures the sample, records and publishes it. A sample that [`Bench::publish_start`] has measured is published
    /// again.
    pub fn measure(&mut self) -> Result<(), RunError> {
        if !core::mem::take(&mut self.is_start_measured) {
            self.measure_and_record();
        }
        self.publish()
    }

    fn measure_and_record(&mut self) {
        self.measured = self.plant.measure();
        self.samples += 1;
        self.record(&Record::Sample(sample_record(&self.measured)));
    }

    /// Publishes sample 0 while nobody has armed the plant. It is measured and recorded once.
    pub fn publish_start(&mut self) -> Result<(), RunError> {
        // A second reading would advance converters and noise, and the run would differ from one whose plant was armed
        // at once.
        if !core::mem::replace(&mut self.is_start_measured, true) {
            self.measure_and_record();
        }
        self.publish()
    }

    fn publish(&mut self) -> Result<(), RunError> {
        let states = self.plant.states();
        let travel_m = self.plant.limited_travel_m();
        Ok(self.node.publish(&PublishedSample { measurement: &self.measured, states, travel_m })?)
    }

    /// Advances to the next sample with the command that is held now, and records the state before. If the simulation
    /// fails the node faults, and the plant stays where it is, at the state that [`Bench::record_end`] records.
    pub fn advance(&mut self, now_ns: u64) -> Result<(), RunError> {
        let load = self.node.load();
        self.held = load;
        if !self.is_observed() {
            return self.advance_plant(now_ns, &load);
        }
        // The record joins the state at the sample with the load held from there on. It is written only if the
        // step succeeds.
        let before = state_record(&self.plant, &load, false);
        self.advance_plant(now_ns, &load)?;
        self.record(&before);
        Ok(())
    }

    fn advance_plant(&mut self, now_ns: u64, load: &Load) -> Result<(), RunError> {
        self.plant.advance(load).map_err(|error| {
            let (code, detail) = match error {
                PlantError::Tripped { .. } => (EmergencyCode::ExciterTripped, Trip::Shaker as u16),
                PlantError::Integrate { .. } | PlantError::Structure { .. } | PlantError::Saved { .. } => {
                    (EmergencyCode::SimulationFailed, 0)
                }
            };
            self.node.fault(now_ns, code, detail);
            RunError::Plant(error)
        })
    }

    /// Says whether the run is recorded or watched.
    fn is_observed(&self) -> bool {
        self.watched.is_some() || !matches!(self.records, RecordSink::Off)
    }

    /// Records the last state of the run, from which nothing is advanced.
    pub fn record_end(&mut self) {
        self.record(&state_record(&self.plant, &Load::default(), true));
    }

    fn record_frame(&mut self, direction: Direction, time_ns: u64, bus_timestamp_ns: Option<u64>, frame: Frame) {
        let sample = self.sample();
        self.record(&Record::Frame(FrameRecord { sample, direction, time_ns, bus_timestamp_ns, frame }));
    }

    /// Sends the queued frames; frames that find the queue full wait for the next call. Returns `true` if all are sent.
    pub fn transmit(&mut self, now_ns: u64, bus: &mut dyn Bus) -> Result<bool, RunError> {
        loop {
            // The memory is used again, since a loop in real time must not allocate.
            let mut batch = core::mem::take(&mut self.batch);
            batch.clear();
            self.node.waiting_frames(FRAMES_SENT_AT_ONCE, &mut batch);
            let outcome = self.send(now_ns, bus, &batch);
            let is_more = batch.len() == FRAMES_SENT_AT_ONCE;
            self.batch = batch;
            match outcome {
                Ok(Sent::Queued) if is_more => {}
                Ok(sent) => return Ok(sent == Sent::Queued),
                Err(error) => {
                    self.lose_bus(now_ns, error)?;
                    return Ok(false);
                }
            }
        }
    }

    /// Works like [`Bench::transmit`], at this UNIX time, from which the round trips of the samples that leave count.
    pub fn transmit_timed(&mut self, now_ns: u64, unix_ns: u64, bus: &mut dyn Bus) -> Result<(), RunError> {
        if self.transmit(now_ns, bus)? {
            // A sample that the node still holds back has not departed.
            let end = self.samples - u64::from(self.node.holds_sample());
            self.round_trips.iter_mut().for_each(|round_trips| round_trips.depart(end, now_ns, unix_ns));
        }
        Ok(())
    }

    /// Sends frames, and records those that the bus accepted.
    fn send(&mut self, now_ns: u64, bus: &mut dyn Bus, frames: &[Frame]) -> Result<Sent, BusError> {
        let mut rest = frames;
        // One call for all frames of a sample: on SocketCAN each call is a system call, and the loop in real time has
        // few of them to spend.
        let outcome = bus.send_all(&mut rest);
        let sent = &frames[..frames.len() - rest.len()];
        if !sent.is_empty() && self.outage.is_some_and(|outage| outage.is_over(bus.controller())) {
            self.regain_bus(now_ns);
        }
        for frame in sent {
            self.node.frame_sent();
            self.record_frame(Direction::Sent, now_ns, None, *frame);
        }
        outcome
    }

    /// Handles a bus that is off or down and may come back: an armed plant faults, and the run continues for a while.
    pub fn lose_bus(&mut self, now_ns: u64, error: BusError) -> Result<(), RunError> {
        if !error.is_recoverable() {
            return Err(error.into());
        }
        // Further errors belong to the same outage, which is reported once.
        if let Some(outage) = &self.outage {
            return if outage.is_too_long(now_ns) { Err(error.into()) } else { Ok(()) };
        }
        let sample = self.sample();
        let outage = Outage::new(now_ns, &error);
        let cause = outage.cause;
        self.outage = Some(outage);
        self.bus_loss = Some(cause);
        self.node.bus_lost(now_ns);
        (self.on_event)(RunEvent::BusLost { sample, cause });
        self.record_event(now_ns, "bus.lost", i64::from(cause == BusLoss::BusOff));
        Ok(())
    }

    fn regain_bus(&mut self, now_ns: u64) {
        self.outage = None;
        let sample = self.sample();
        (self.on_event)(RunEvent::BusBack { sample });
        self.record_event(now_ns, "bus.back", 0);
    }
}
