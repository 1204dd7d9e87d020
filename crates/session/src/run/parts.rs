//! The parts of a run, made from a session: nodes, bench, recording, filters of the bus.

use super::bench::Bench;
use super::error::RunError;
use super::mode::Mode;
use super::mode::Network;
use super::record_sink::RecordSink;
use super::session::{RecordTo, Session};
use super::signals::RunEvent;
use super::watch::End;
use resonarm_bench::node::{self, ExciterInterface, ExciterRemark, PlantInterface, PlantNode, TimeBase, WireSpec};
use resonarm_bench::plant::Plant;
use resonarm_bench::rig::{Converter, Load, Readings};
use resonarm_bus::{Bus, Filter, network_filters};
use resonarm_files::recording::channels::Channels;
use resonarm_files::recording::{self, Recorder};
use resonarm_protocol::{FrameFormat, Id, Node, Profile};
use resonarm_realtime::SystemClock;
use resonarm_scenario::{ScenarioError, check_accepted};

/// Records on their way to the writer: at 1 kHz about four seconds of everything.
const RECORDS_CAPACITY: usize = 1 << 15;

impl Session {
    /// Returns the filters that pass the messages of the session's protocol, including those that only its own node
    /// sends: they reveal a second sender.
    ///
    /// # Errors
    /// [`RunError::Scenario`] for an impossible network.
    pub fn filters(&self) -> Result<Vec<Filter>, RunError> {
        let exactly = |id: Id| Filter { id, mask: if matches!(id, Id::Standard(_)) { 0x7FF } else { 0x1FFF_FFFF } };
        Ok(match &self.wire {
            None => network_filters(self.scenario.network()?).to_vec(),
            Some(wire) => match wire.ids() {
                Some(ids) => ids.into_iter().map(exactly).collect(),
                // A mask of 0 compares no bit of the identifier: a master may choose those of the drives during the
                // run.
                None => vec![Filter { id: Id::Standard(0), mask: 0 }],
            },
        })
    }

    /// Makes the exciter's node, of the user protocol or of Resonarm's, for a plant whose instruments have this
    /// converter.
    pub(super) fn exciter_node(&self, converter: Converter) -> Result<Box<dyn ExciterInterface>, RunError> {
        let node = self.unchecked_exciter_node(converter)?;
        node.check_readings()?;
        if let Some(amplitude) = self.commanded_amplitude() {
            node.check_load(amplitude)?;
        }
        Ok(node)
    }

    /// The exciter's node in one loop with the plant. The loop hands over what Resonarm's protocol does not carry, so
    /// that the structure alone says which readings and loads there are.
    pub(super) fn exciter_in_loop(&self, converter: Converter) -> Result<Box<dyn ExciterInterface>, RunError> {
        if !self.hands_over() {
            return self.exciter_node(converter);
        }
        let mut node = self.unchecked_exciter_node(converter)?;
        node.carried_mut().hand_over(&Readings::NONE);
        Ok(node)
    }

    /// Checks that the structure accepts every part of the scenario's load. A run of both ends would otherwise end in a
    /// fault at its first command.
    pub(super) fn check_load(&self) -> Result<(), RunError> {
        let Some(amplitude) = self.commanded_amplitude() else { return Ok(()) };
        if !self.scenario.structure.kind.is_foreign() {
            return Ok(check_accepted(&self.scenario.under_test()?, amplitude)?);
        }
        // Only the plant knows the loads of an FMU and of a structure of the program's own.
        let inputs = self.plant.inputs();
        let Some((place, got)) = inputs.lacks(amplitude) else { return Ok(()) };
        let accepted = inputs.places().map(|place| format!("`{}`", Load::NAMES[place]));
        Err(ScenarioError::idle_load(Load::NAMES[place], got, accepted).into())
    }

    /// Whether the loop of a free run hands over the readings and loads that Resonarm's protocol does not carry. A bus
    /// with a bit rate or with faults is there to show what a real bus does, so that nothing passes by it. A scenario's
    /// own protocol carries what it maps.
    pub(super) fn hands_over(&self) -> bool {
        self.mode == Mode::Free && self.network == Network::Ideal && self.wire.is_none()
    }

    /// The amplitude of the scenario's load, unless a controller of the caller's own commands.
    fn commanded_amplitude(&self) -> Option<&Load> {
        self.scenario.amplitude().filter(|_| !self.has_own_controller())
    }

    fn unchecked_exciter_node(&self, converter: Converter) -> Result<Box<dyn ExciterInterface>, RunError> {
        let network = self.scenario.network()?;
        let rate_hz = self.scenario.wire_rate_hz()?;
        let controller = self.controller_reading(converter)?;
        let mut node = match &self.wire {
            None => Box::new(node::carry(network, rate_hz, self.timing, controller)),
            Some(wire) => wire.exciter((rate_hz, self.time_base()), self.timing, controller)?,
        };
        // A plant on a user protocol repeats the readings of sample 0 until it is armed. They are no samples to be
        // answered.
        if self.wire.is_some() && self.mode == Mode::Lockstep {
            node.expect_unarmed_readings();
        }
        Ok(node)
    }

    /// Rejects a bus for classical frames if this node sends CAN FD frames.
    pub(super) fn check_fd(&self, node: Node, bus: &dyn Bus) -> Result<(), RunError> {
        let is_fd = |format: FrameFormat| matches!(format, FrameFormat::Fd { .. });
        let sends_fd = match &self.wire {
            None => self.scenario.network.profile == Profile::Fd,
            Some(WireSpec::Mapped(mapping)) => match node {
                Node::Plant => mapping.outgoing.iter().any(|message| is_fd(message.format)),
                Node::Exciter => mapping.incoming.iter().any(|message| is_fd(message.format)),
            },
            Some(WireSpec::Cia402(_)) => false,
        };
        if sends_fd { Ok(bus.check_fd()?) } else { Ok(()) }
    }

    /// Returns remarks on information that the user protocol lacks for the emulated exciter; empty without a user
    /// protocol.
    ///
    /// # Errors
    /// [`RunError::WireLacks`] if the exciter can't drive the plant with it.
    pub fn exciter_remarks(&self) -> Result<Vec<ExciterRemark>, RunError> {
        Ok(self.exciter_in_loop(self.scenario.partner_converter())?.remarks())
    }

    /// Returns the time base by which the commands of a user protocol are judged. A free run on which every frame
    /// arrives at once is a lockstep within one loop, if the protocol supports it, and produces bit-identical results.
    fn time_base(&self) -> TimeBase {
        let has_lockstep = self.scenario.wire.as_ref().is_some_and(|wire| wire.lockstep.is_some());
        match (self.mode, self.network) {
            (Mode::Lockstep, _) => TimeBase::Lockstep,
            (Mode::Free, Network::Ideal) if has_lockstep => TimeBase::Lockstep,
            (Mode::RealTime | Mode::Free, _) => TimeBase::Clock,
        }
    }

    /// Makes the plant's node, of the user protocol or of Resonarm's.
    fn plant_node(&self) -> Result<Box<dyn PlantInterface>, RunError> {
        let network = self.scenario.network()?;
        let rate_hz = self.scenario.wire_rate_hz()?;
        let exciter = *self.plant.exciter();
        let limits = *self.plant.gate();
        if let Some(wire) = &self.wire {
            return Ok(wire.node((rate_hz, self.time_base()), self.timing, exciter, limits));
        }
        let node = PlantNode::new(network, rate_hz, self.timing, exciter).with_limits(limits);
        Ok(Box::new(node.with_samples_per_frame(self.scenario.network.samples_per_frame()?)))
    }

    pub(super) fn bench<'a>(
        &self,
        recorder: Option<&Recorder>,
        on_event: &'a mut dyn FnMut(RunEvent),
    ) -> Result<Bench<'a>, RunError> {
        let node = self.plant_node()?;
        let channel = recorder.map(|recorder| recorder.channel("plant", RECORDS_CAPACITY)).transpose()?;
        let records = match (channel, self.mode) {
            (None, _) => RecordSink::Off,
            // In real time the loop must not wait for a disk. In simulated time waiting changes nothing, so nothing
            // is lost.
            (Some(channel), Mode::RealTime) => RecordSink::Lossy(channel),
            (Some(channel), Mode::Lockstep | Mode::Free) => RecordSink::Whole(channel),
        };
        let watched = self.watch.as_ref().map(|watch| watch.open(End::Plant));
        let steps = self.scenario.simulation.steps_per_sample();
        Ok(Bench::new(self.plant.clone(), node, steps, records, watched, Box::new(on_event)))
    }

    /// Makes a bench that nobody watches, and that keeps its records.
    pub(super) fn hosted_bench(&self) -> Result<Bench<'static>, RunError> {
        let records = RecordSink::Kept(Vec::new());
        let steps = self.scenario.simulation.steps_per_sample();
        Ok(Bench::new(self.plant.clone(), self.plant_node()?, steps, records, None, Box::new(|_| {})))
    }

    /// Returns the plant at sample 0.
    pub fn plant_at_start(&self) -> Plant {
        self.plant.clone()
    }

    /// Creates the recording of the options, if requested; `interface` is its name of the bus.
    ///
    /// # Errors
    /// [`RunError::Recording`] if it can't be created.
    pub fn recorder(&self, interface: &str) -> Result<Option<Recorder>, RunError> {
        let Some(RecordTo { path, existing }) = &self.options.record else { return Ok(None) };
        let dt_s = 1.0 / self.scenario.simulation.rate_hz;
        let mut options = match self.mode {
            Mode::RealTime => {
                recording::Options::real_time(dt_s, interface, SystemClock.epoch_unix_ns(), SystemClock::elapsed)
            }
            Mode::Lockstep => {
                recording::Options::lockstep(dt_s, interface, SystemClock.epoch_unix_ns(), SystemClock::elapsed)
            }
            Mode::Free => recording::Options::virtual_time(dt_s, interface),
        };
        options.existing = *existing;
        options.plot_every_samples = self.scenario.recording.plot_every_samples;
        options.reading_delay_samples = self.scenario.rig.converter.delay_samples();
        options.channels = Channels::of_structure(self.plant.structure());
        Ok(Some(Recorder::create(path, &self.scenario.configuration(self.mode.name())?, options)?))
    }
}
