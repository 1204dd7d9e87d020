//! The tester's own end of the bus: the scenario's plant, or the emulated exciter with a constant load.

use super::monitor::Heard;
use super::protocol::UserWire;
use crate::stop::{Stop, inconclusive};
use resonarm_bench::node::{ExciterInterface, PlantInterface, PublishedSample};
use resonarm_bench::plant::Plant;
use resonarm_protocol::{Frame, NodeState, Refusal};
use resonarm_session::run::Mode;

/// Node that the tester is on the bus.
pub(super) enum End {
    /// The tester only listens.
    Listener,
    Plant(Box<PlantEnd>),
    Exciter(Box<dyn ExciterInterface>),
}

/// The scenario's plant, with its node.
pub(super) struct PlantEnd {
    pub node: Box<dyn PlantInterface>,
    plant: Plant,
    mode: Mode,
    period_ns: u64,
    /// Time at which the next sample is due at the earliest, ns: in lockstep, too, the plant is no faster than its
    /// rate.
    due_ns: u64,
    has_begun: bool,
    /// Whether the sample published last is to be answered, in lockstep.
    is_awaited: bool,
    /// Whether no sample is made.
    pub is_paused: bool,
    /// Whether a load other than zero has acted.
    pub has_acted: bool,
    /// Samples published while armed.
    pub armed_samples: u64,
}

impl PlantEnd {
    pub fn new(on: &UserWire, now_ns: u64) -> PlantEnd {
        let plant = on.plant.clone();
        let mut node = on.patient_spec().node(on.rate(), on.timing, *plant.exciter(), *plant.gate());
        node.start(now_ns);
        PlantEnd {
            node,
            plant,
            mode: on.mode,
            period_ns: on.period_ns(),
            due_ns: now_ns,
            has_begun: false,
            is_awaited: false,
            is_paused: false,
            has_acted: false,
            armed_samples: 0,
        }
    }

    /// The largest force, N, and torque, N·m, that it takes.
    pub fn limits(&self) -> (f64, f64) {
        self.plant.exciter().limits()
    }

    /// Returns in words which loads the plant has rejected because they are beyond its limits, with the largest of those
    /// heard; `None` if it has rejected none.
    pub fn loads_beyond_limits(&self, heard: &[Heard]) -> Option<String> {
        let (force_n, torque_nm) = self.limits();
        let refused = match self.node.refusals().count(Refusal::OutOfRange) {
            0 => return None,
            1 => String::from("1 load is"),
            refused => format!("{refused} loads are"),
        };
        let largest = heard.iter().flat_map(Heard::loads).max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        let largest =
            largest.map_or_else(String::new, |(name, value, unit)| format!(", up to {name} {value:.3} {unit}"));
        Some(format!("{refused} beyond the exciter's {force_n} N, {torque_nm} N m{largest}"))
    }

    /// Returns the time of the next work, at the latest.
    pub fn next_ns(&self) -> u64 {
        match self.mode {
            _ if self.is_paused => self.node.next_deadline_ns(),
            // A frame ends this wait. Until then only the deadlines of the node itself, such as its heartbeats, are
            // due.
            Mode::Lockstep if self.waits() => self.node.next_deadline_ns(),
            _ => self.due_ns,
        }
    }

    /// Whether the plant waits in lockstep: to be armed, or for the answer to the sample published last.
    fn waits(&self) -> bool {
        match (self.has_begun, self.node.is_armed()) {
            (false, is_armed) => !is_armed,
            (true, true) => self.is_awaited && !self.node.is_answered(),
            (true, false) => false,
        }
    }

    /// Does what is due. In real time the node looks at commands once a sample.
    pub fn work(&mut self, now_ns: u64) -> Result<(), Stop> {
        // Events are dropped: the cases judge what is on the bus and the state of the node.
        while self.node.poll_event().is_some() {}
        // In lockstep there may be no next sample for long, so deadlines are handled at every call.
        if self.mode == Mode::Lockstep {
            self.node.handle_deadline(now_ns);
        }
        if self.is_paused || now_ns < self.due_ns || (self.mode == Mode::Lockstep && self.waits()) {
            return Ok(());
        }
        if self.mode != Mode::Lockstep {
            self.node.handle_deadline(now_ns);
        }
        // At least half a period later: a plant that was held up does not catch up in a burst.
        self.due_ns = (self.due_ns + self.period_ns).max(now_ns + self.period_ns / 2);
        self.sample()
    }

    /// Advances to the next sample with the load that is held, and publishes it.
    fn sample(&mut self) -> Result<(), Stop> {
        // The first sample is that of the start, before any load.
        if core::mem::replace(&mut self.has_begun, true) {
            let load = self.node.load();
            self.has_acted |= load.force_n.amax() > 0.0 || load.torque_nm.amax() > 0.0;
            if let Err(error) = self.plant.advance(&load) {
                return inconclusive(error.to_string());
            }
        }
        // A plant that is not armed waits for no answer, as nobody has to send one.
        self.is_awaited = self.node.is_armed();
        self.armed_samples += u64::from(self.is_awaited);
        let measurement = self.plant.measure();
        let states = self.plant.states();
        let travel_m = self.plant.limited_travel_m();
        let published = self.node.publish(&PublishedSample { measurement: &measurement, states, travel_m });
        published.or_else(|error| inconclusive(error.to_string()))
    }
}

impl End {
    /// The state of the node.
    pub fn state(&self) -> NodeState {
        match self {
            End::Listener => NodeState::BootUp,
            End::Plant(end) => end.node.state(),
            End::Exciter(node) => node.state(),
        }
    }

    pub fn handle_frame(&mut self, now_ns: u64, frame: &Frame) {
        match self {
            End::Listener => {}
            End::Plant(end) => end.node.handle_frame(now_ns, frame),
            End::Exciter(node) => node.handle_frame(now_ns, frame),
        }
    }

    pub fn work(&mut self, now_ns: u64) -> Result<(), Stop> {
        match self {
            End::Listener => Ok(()),
            End::Plant(end) => end.work(now_ns),
            End::Exciter(node) => {
                while node.poll_event().is_some() {}
                node.handle_deadline(now_ns);
                Ok(())
            }
        }
    }

    pub fn next_ns(&self) -> u64 {
        match self {
            End::Listener => u64::MAX,
            End::Plant(end) => end.next_ns(),
            End::Exciter(node) => node.next_deadline_ns(),
        }
    }

    /// The next frame to send, which counts as sent.
    pub fn poll_transmit(&mut self) -> Option<Frame> {
        match self {
            End::Listener => None,
            End::Plant(end) => {
                let mut frames = Vec::with_capacity(1);
                end.node.waiting_frames(1, &mut frames);
                let frame = frames.pop()?;
                end.node.frame_sent();
                Some(frame)
            }
            End::Exciter(node) => {
                let frame = node.next_frame()?;
                node.frame_sent();
                Some(frame)
            }
        }
    }
}
