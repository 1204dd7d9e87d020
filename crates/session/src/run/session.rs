//! A session: assembles plant, nodes, bus, recording and pace of a scenario, and runs them in one of the modes.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread;

use super::bench::Bench;
use super::core_watch::CoreWatch;
use super::ending::Ending;
use super::error::RunError;
use super::exciter::{self, Patience};
use super::free::Free;
use super::hold::{Callback, Hold};
use super::lockstep::lockstep;
use super::mode::{Mode, Network};
use super::pace::{Pace, Speed, SpeedError};
use super::real_time::real_time;
use super::report::{BothReport, BusCounts, ExciterReport, PlantReport};
use super::signals::{RunEvent, Signals};
use super::watch::{End, Watch};
use resonarm_bench::control::Controller;
use resonarm_bench::node::mapped::mapping::{Source, Value};
use resonarm_bench::node::{Timing, WireSpec};
use resonarm_bench::plant::{Plant, Stepped};
use resonarm_bench::rig::Converter;
use resonarm_bench::structure::{ChannelName, joint_channel_name};
use resonarm_bus::fault::Faulty;
use resonarm_bus::{Bus, VirtualBus, memory, timed};
use resonarm_files::recording::{Existing, Recorder};
use resonarm_protocol::Node;
use resonarm_realtime::{Clock, OverrunPolicy, SampleRate, Spin, SystemClock, ThreadSetup, VirtualClock};
use resonarm_scenario::wire::Quantities;
use resonarm_scenario::{Scenario, ScenarioError, StructureSectionError, WireError};

/// Capacity of the queue of overruns with another cause, on their way to the writer.
const CORE_RECORDS_CAPACITY: usize = 1 << 10;
/// Frames that fit a memory bus in each direction.
const BUS_CAPACITY: usize = 1024;
/// Longest time to arm the plant in a free run on a bus with faults or bit rates, or with a user protocol, ns of
/// simulated time.
const ARMING_NS: u64 = 10_000_000_000;

/// File and options of the recording that a run writes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordTo {
    /// Path of the MCAP file.
    pub path: PathBuf,
    /// The action if the file already exists.
    pub existing: Existing,
}

/// The action if the operating system denies a run's thread the requested settings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnShortfall {
    /// Logs a warning and runs all the same.
    #[default]
    Warn,
    /// Does not start the run: [`RunError::NoRealTimeThread`].
    Refuse,
}

/// Options of a run. By default: no recording, as fast as possible, the default policy, the thread as it is, no end but the
/// scenario's.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// File of the recording; `None` records nothing.
    pub record: Option<RecordTo>,
    /// Simulated time: its speed.
    pub speed: Speed,
    /// Real time: what a missed deadline leads to.
    pub overrun: OverrunPolicy,
    /// Real time: whether the plant's loop busy-waits before a deadline.
    pub spin: Spin,
    /// Settings that the plant's thread, which is the calling one, requests from the operating system; `None` leaves it
    /// as it is. The report says what was granted.
    pub thread: Option<ThreadSetup>,
    /// The action if the operating system denies a thread setting.
    pub on_shortfall: OnShortfall,
    /// Whether a run ends when an armed plant is disarmed or faults.
    pub end_on_disarm: bool,
    /// Longest wait of a plant to be armed for the first time, and of an exciter for a plant; `None` waits forever.
    pub patience: Option<Duration>,
    /// Number of restarts of an exciter after a fault: it resets and arms the plant, and plays its profile from the
    /// start.
    pub rearm: u32,
}

/// A scenario ready to run: plant on a bus, exciter on a bus, or both.
#[derive(Clone, Debug)]
pub struct Session {
    pub(super) scenario: Scenario,
    pub(super) mode: Mode,
    pub(super) options: Options,
    pub(super) rate: SampleRate,
    pub(super) timing: Timing,
    pub(super) network: Network,
    pub(super) plant: Plant,
    /// The user protocol of the scenario, if it has one.
    pub(super) wire: Option<WireSpec>,
    ending: Ending,
    /// Makes the replacement of the scenario's controller.
    controller: Option<Callback<Box<dyn Controller>>>,
    /// Where a plant in lockstep holds.
    hold: Option<Hold>,
    /// Watcher that is notified of the loops' events.
    pub(super) watch: Option<Watch>,
}

impl Session {
    /// Checks everything, before anything is opened or written.
    ///
    /// # Errors
    /// [`RunError`] with the impossible part of the scenario or the options.
    pub fn new(mut scenario: Scenario, mode: Mode, options: Options) -> Result<Session, RunError> {
        match (scenario.is_fmu(), mode) {
            (false, _) => {
                return Session::of(scenario, mode, options, |of| Ok(Plant::new(&of.plant_spec(), &of.under_test()?)?));
            }
            (true, Mode::RealTime) => return Err(ScenarioError::from(StructureSectionError::FmuInRealTime).into()),
            // The recording says which FMU it was, also if the scenario was not read from a file.
            (true, _) => scenario.read_structure(Path::new(""))?,
        }
        Session::of(scenario, mode, options, |scenario| Ok(scenario.plant()?))
    }

    /// Works like [`Session::new`] with a structure of the caller's own, instead of the arm; the scenario has no other.
    /// The recording has the `structure.kind` own, so that nothing mistakes it for the arm's. In real time its steps
    /// must not allocate, lock or block.
    ///
    /// # Errors
    /// [`RunError`] with the impossible part of the scenario, the options or the structure.
    pub fn of_structure(
        mut scenario: Scenario,
        mode: Mode,
        options: Options,
        structure: Box<dyn Stepped>,
    ) -> Result<Session, RunError> {
        scenario.leave_structure_to_program(None);
        Session::of(scenario, mode, options, |scenario| Ok(Plant::stepped(&scenario.own_plant_spec()?, structure)?))
    }

    fn of(
        scenario: Scenario,
        mode: Mode,
        options: Options,
        plant: impl FnOnce(&Scenario) -> Result<Plant, RunError>,
    ) -> Result<Session, RunError> {
        scenario.wire_rate_hz()?;
        if let (Mode::RealTime | Mode::Lockstep, Some(bit_error_rate)) = (mode, scenario.network.bit_error_rate) {
            return Err(RunError::BitErrors { bit_error_rate, mode });
        }
        let network = match (scenario.timed_bus()?, scenario.network.faults.is_empty()) {
            (None, true) => Network::Ideal,
            (timed, _) => Network::Real(timed),
        };
        let timing = match (mode, network) {
            // On a bus that loses or delays frames the timeouts of real time apply, also in simulated time: they are
            // what such a bus is meant to test.
            (Mode::RealTime, _) | (Mode::Free, Network::Real(_)) => scenario.real_time_timing()?,
            (Mode::Lockstep, _) | (Mode::Free, Network::Ideal) => scenario.lockstep_timing()?,
        };
        scenario.network()?;
        let wire = scenario.wire_spec()?;
        if let (Some(section), Mode::Lockstep) = (&scenario.wire, mode)
            && section.lockstep.is_none()
        {
            return Err(ScenarioError::from(WireError::NoLockstep).into());
        }
        let plant = plant(&scenario)?;
        if let Some(wire) = &wire {
            check_sent_states(&scenario, wire, &plant)?;
        }
        let rate = SampleRate::new(scenario.simulation.rate_hz)?;
        check_speed(options.speed, mode, rate, timing.partner_timeout_ns)?;
        if mode == Mode::RealTime {
            options.spin.check(rate)?;
        }
        let ending = Ending {
            after_samples: scenario.duration_samples()?,
            on_disarm: options.end_on_disarm,
            patience_ns: options.patience.map(|patience| u64::try_from(patience.as_nanos()).unwrap_or(u64::MAX)),
        };
        Ok(Session {
            scenario,
            mode,
            options,
            rate,
            timing,
            network,
            plant,
            wire,
            ending,
            controller: None,
            hold: None,
            watch: None,
        })
    }

    /// Replaces the scenario's controller by one of the caller's own; every run of the exciter calls `make` once.
    #[must_use]
    pub fn with_controller(self, make: impl Fn() -> Box<dyn Controller> + Send + Sync + 'static) -> Session {
        Session { controller: Some(Callback(Arc::new(make))), ..self }
    }

    /// Lets a plant in lockstep hold before it publishes a sample, until `is_over` says that time goes on. It is called every 20
    /// ms or more often, and its first call is the moment of the sample: what the caller does then, such as a word to the
    /// controller, happens at a known sample. The bus is served meanwhile.
    #[must_use]
    pub fn held_at(self, sample: u64, is_over: impl Fn() -> bool + Send + Sync + 'static) -> Session {
        Session { hold: Some(Hold { sample, is_over: Callback(Arc::new(is_over)) }), ..self }
    }

    /// Connects a watcher: the loops report their events to it, and accept requests.
    #[must_use]
    pub fn watched(self, watch: Watch) -> Session {
        Session { watch: Some(watch), ..self }
    }

    /// Returns the exciter's controller, with the scenario's limits, at sample 0.
    ///
    /// # Errors
    /// [`RunError`] if the scenario has none.
    pub fn controller(&self) -> Result<Box<dyn Controller>, RunError> {
        self.controller_reading(self.scenario.rig.converter)
    }

    /// Works like [`Session::controller`], for a plant whose instruments have this converter. A controller of the
    /// caller's own knows its plant.
    pub(super) fn controller_reading(&self, converter: Converter) -> Result<Box<dyn Controller>, RunError> {
        let controller = match &self.controller {
            Some(make) => make.0(),
            None => self.scenario.unlimited_controller(converter)?,
        };
        Ok(self.scenario.limited(controller, self.plant.structure().outputs()))
    }

    /// Says whether the controller is one of the caller's own.
    pub(super) fn has_own_controller(&self) -> bool {
        self.controller.is_some()
    }

    /// Returns the scenario of the session.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// Runs the plant on `bus`, on the calling thread, until its end. Events are passed to `on_event`,
    /// which in real time must not allocate, lock or block.
    ///
    /// # Errors
    /// [`RunError`] if the run can't start. An error that ends it early is in the report.
    pub fn plant(
        &self,
        bus: &mut dyn Bus,
        signals: &Signals,
        on_event: &mut dyn FnMut(RunEvent),
    ) -> Result<PlantReport, RunError> {
        self.check_fd(Node::Plant, bus)?;
        self.leave_core();
        let recorder = self.recorder(&bus.name())?;
        let mut bench = self.bench(recorder.as_ref(), on_event)?;
        let bus = &mut self.with_faults(bus, SystemClock, Node::Plant);
        if self.mode == Mode::Lockstep {
            bus.work_on_caller()?;
        }
        // The threads of the recorder and of the watch are there already, and stay ordinary ones.
        let watch = self.core_watch(recorder.as_ref())?;
        let (thread, _awake) = self.become_real_time()?;
        let report = match self.mode {
            Mode::RealTime => self.plant_in_real_time(&mut bench, bus, signals, watch)?,
            Mode::Lockstep => {
                let how = (self.rate, self.options.speed);
                lockstep(&mut bench, bus, &SystemClock, how, (self.ending, self.hold.as_ref()), signals)?
            }
            Mode::Free => return Err(RunError::FreeHasNoBus),
        };
        let report = self.explained(&bench, report);
        drop(bench);
        Ok(finish_recording(recorder, PlantReport { thread, ..report }))
    }

    /// Returns the report with the first frame that the plant rejected, in words.
    fn explained(&self, bench: &Bench, report: PlantReport) -> PlantReport {
        let first_refused_frame = bench.first_refused_frame.map(|refused| refused.in_words(&self.scenario));
        PlantReport { first_refused_frame, ..report }
    }

    /// In real time, starts a thread that checks the use of the calling thread's core.
    fn core_watch(&self, recorder: Option<&Recorder>) -> Result<Option<CoreWatch>, RunError> {
        if self.mode != Mode::RealTime {
            return Ok(None);
        }
        let channel = recorder.map(|recorder| recorder.channel("core-watch", CORE_RECORDS_CAPACITY)).transpose()?;
        let watched = self.watch.as_ref().map(|watch| watch.open(End::CoreWatch));
        CoreWatch::start(channel, watched).map(Some).map_err(|source| RunError::NoThread { source })
    }

    fn plant_in_real_time(
        &self,
        bench: &mut Bench,
        bus: &mut dyn Bus,
        signals: &Signals,
        mut watch: Option<CoreWatch>,
    ) -> Result<PlantReport, RunError> {
        let how = (self.rate, self.options.overrun, self.options.spin);
        let mut report_overrun = |overrun| watch.iter_mut().for_each(|watch| watch.report(overrun));
        let report = real_time(bench, bus, &SystemClock, how, self.ending, (signals, &mut report_overrun))?;
        let causes = report.overrun_causes;
        Ok(PlantReport { overrun_causes: watch.map_or(causes, |watch| watch.finish(causes)), ..report })
    }

    /// Runs the exciter on `bus`, on the calling thread, until its controller has finished, it faults, or a stop is
    /// requested. The plant at the other end need not be the scenario's: its readings are corrected only for a
    /// converter that `network.plant_converter` states.
    ///
    /// # Errors
    /// [`RunError`] if the run can't start. An error that ends it early is in the report.
    pub fn exciter(&self, bus: &mut dyn Bus, signals: &Signals) -> Result<ExciterReport, RunError> {
        if self.mode == Mode::Free {
            return Err(RunError::FreeHasNoBus);
        }
        self.check_fd(Node::Exciter, bus)?;
        let mut node = self.exciter_node(self.scenario.partner_converter())?;
        let watched = self.watch.as_ref().map(|watch| watch.open(End::Exciter));
        let _awake = self.become_real_time()?;
        let patience = self.patience(None);
        let bus = &mut self.with_faults(bus, SystemClock, Node::Exciter);
        if self.mode == Mode::Lockstep {
            bus.work_on_caller()?;
        }
        Ok(exciter::run(&mut *node, bus, &SystemClock, patience, (signals, watched), &self.scenario))
    }

    /// Returns the name of the bus between the nodes in a recording of [`Session::both`].
    pub fn interface_of_both(&self) -> &'static str {
        self.network.interface(self.mode)
    }

    /// Runs both: in the mode free in one loop, else on a bus inside this process, the plant on the calling thread and
    /// the exciter on one of its own. The run ends with the exciter's work.
    ///
    /// In lockstep frames take their time by the clock if the scenario names the bit rate of its bus.
    ///
    /// # Errors
    /// [`RunError`] if the run can't start, as in real time with a bit rate. An error that ends it early is in the
    /// report.
    pub fn both(&self, signals: &Signals, on_event: &mut dyn FnMut(RunEvent)) -> Result<BothReport, RunError> {
        let mut session = self.clone();
        // The exciter disarms the plant when its work is done, and nobody would arm it again.
        session.ending.on_disarm = true;
        session.check_load()?;
        match (self.mode, self.network) {
            (Mode::Free, _) => session.free(session.recorder(self.interface_of_both())?, signals, on_event),
            (Mode::Lockstep, Network::Real(Some(spec))) => {
                session.on_threads(timed::pair(&spec, &SystemClock), signals, on_event)
            }
            // The ends of a timed bus share a lock, for which a real-time thread must not wait.
            (Mode::RealTime, Network::Real(Some(timed::Spec { rates, .. }))) => {
                Err(RunError::TimedInRealTime { bit_rate_hz: rates.nominal_hz })
            }
            (Mode::RealTime | Mode::Lockstep, _) => session.on_threads(memory::pair(BUS_CAPACITY), signals, on_event),
        }
    }

    /// Runs the plant on the calling thread at the first end, the exciter on a thread of its own at the other.
    fn on_threads<B: Bus + Send>(
        &self,
        [mut near, far]: [B; 2],
        signals: &Signals,
        on_event: &mut dyn FnMut(RunEvent),
    ) -> Result<BothReport, RunError> {
        let mut node = self.exciter_node(self.scenario.rig.converter)?;
        let mut far = self.with_faults(far, SystemClock, Node::Exciter);
        let watched = self.watch.as_ref().map(|watch| watch.open(End::ExciterBesidePlant));
        let plant_ended = AtomicBool::new(false);
        let patience = self.patience(Some(&plant_ended));
        let scenario = &self.scenario;
        signals.set_exciter_ended(false);
        thread::scope(|scope| {
            // Started before this thread becomes a real-time one and leaves the loop's core, so that it stays an
            // ordinary thread on any: it asks of the kernel only to be woken, and confined it is late more often.
            // The plant keeps the count of samples; the exciter only listens for the stop.
            let work = move || {
                let _ended = AtEnd(|| signals.set_exciter_ended(true));
                exciter::run(&mut *node, &mut far, &SystemClock, patience, (signals, watched), scenario)
            };
            let controller = thread::Builder::new()
                .name(String::from("exciter"))
                .spawn_scoped(scope, work)
                .map_err(|source| RunError::NoThread { source })?;
            // Also if the plant panics: the scope then waits for the exciter, which would wait for the plant for ever.
            let ended = AtEnd(|| plant_ended.store(true, Ordering::Release));
            let plant = self.plant(&mut near, signals, on_event);
            // The exciter would wait for a plant that never began.
            if plant.is_err() {
                signals.stop();
            }
            drop(near);
            drop(ended);
            let exciter = controller.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            Ok(BothReport { plant: plant?, exciter })
        })
    }

    fn patience<'r>(&self, plant_ended: Option<&'r AtomicBool>) -> Patience<'r> {
        Patience { wait: self.options.patience, rearm: self.options.rearm, plant_ended }
    }

    /// Runs both in one loop, recorded by `recorder`.
    pub(crate) fn free(
        &self,
        recorder: Option<Recorder>,
        signals: &Signals,
        on_event: &mut dyn FnMut(RunEvent),
    ) -> Result<BothReport, RunError> {
        let mut exciter = self.exciter_in_loop(self.scenario.rig.converter)?;
        let mut bench = self.bench(recorder.as_ref(), on_event)?;
        let watched = self.watch.as_ref().map(|watch| watch.open(End::ExciterBesidePlant));
        let clock = VirtualClock::default();
        let [mut near, mut far] = self.virtual_ends(&clock);
        let mut run = Free {
            bench: &mut bench,
            exciter: &mut *exciter,
            near: near.as_mut(),
            far: far.as_mut(),
            clock,
            rate: self.rate,
            pace: Pace::start(&SystemClock, self.rate, self.options.speed)?,
            ending: self.ending,
            // On an ideal bus both hellos and the request to arm are exchanged at time 0. A bus with bit rates takes
            // its time for them, and so may a user protocol.
            arming_ns: if self.network == Network::Ideal && self.wire.is_none() { 0 } else { ARMING_NS },
            hands_over: self.hands_over(),
            signals,
            watched,
            responses: Vec::new(),
            first_refused: None,
        };
        let (outcome, error) = run.run();
        let Free { pace, responses, first_refused, .. } = run;
        let bus = bench.counts(near.statistics());
        let plant = PlantReport {
            wakeup_us: pace.wakeup_us(),
            pacing: pace.report(),
            ..self.explained(&bench, PlantReport::new(&bench, bus, outcome, error))
        };
        let bus = BusCounts::new(far.statistics(), exciter.frames());
        let report = ExciterReport::new(&*exciter, exciter.outcome(), None, first_refused, &self.scenario);
        let exciter = ExciterReport { responses, bus, ..report };
        drop(bench);
        Ok(BothReport { plant: finish_recording(recorder, plant), exciter })
    }

    /// Returns both ends of the bus of a free run, the plant's first.
    fn virtual_ends(&self, clock: &VirtualClock) -> [Box<dyn VirtualBus>; 2] {
        match self.network {
            Network::Real(Some(spec)) => self.virtual_pair(timed::pair(&spec, clock), clock),
            Network::Real(None) | Network::Ideal => self.virtual_pair(memory::pair(BUS_CAPACITY), clock),
        }
    }

    fn virtual_pair<B: VirtualBus + 'static>(
        &self,
        [near, far]: [B; 2],
        clock: &VirtualClock,
    ) -> [Box<dyn VirtualBus>; 2] {
        if self.scenario.network.faults.is_empty() {
            return [Box::new(near), Box::new(far)];
        }
        [
            Box::new(self.with_faults(near, clock.clone(), Node::Plant)),
            Box::new(self.with_faults(far, clock.clone(), Node::Exciter)),
        ]
    }

    /// Returns an end with the faults that the scenario gives to `node`.
    fn with_faults<B: Bus, C: Clock>(&self, bus: B, clock: C, node: Node) -> Faulty<B, C> {
        Faulty::new(bus, clock, &self.scenario.network.faults, node, self.scenario.simulation.seed)
    }
}

/// Calls a function when it is dropped, also while a panic unwinds.
struct AtEnd<F: FnMut()>(F);

impl<F: FnMut()> Drop for AtEnd<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}

/// Checks that a paced sample does not take so long that the ends consider each other lost.
fn check_speed(speed: Speed, mode: Mode, rate: SampleRate, timeout_ns: u64) -> Result<(), SpeedError> {
    let got = speed.times();
    let period_s = speed.period_s(rate);
    let timeout_s = timeout_ns as f64 * 1e-9;
    if mode == Mode::RealTime && speed != Speed::UNPACED {
        return Err(SpeedError::RealTime { got });
    }
    // The other half of the timeout is for a machine that is late with a sample.
    if period_s > 0.5 * timeout_s {
        let least = 2.0 / (rate.rate_hz() * timeout_s);
        return Err(SpeedError::TooSlow { got, period_s, timeout_s, least });
    }
    Ok(())
}

/// Closes the recording with the run's figures in it. Its failure counts if nothing failed before.
fn finish_recording(recorder: Option<Recorder>, report: PlantReport) -> PlantReport {
    let Some(recorder) = recorder else { return report };
    let statistics = [
        ("samples", report.samples.to_string()),
        ("steps", report.steps.to_string()),
        ("overruns", report.overruns.to_string()),
        ("overruns_woke_late", report.overrun_causes.woke_late.to_string()),
        ("overruns_step_long", report.overrun_causes.step_long.to_string()),
        ("overruns_bus_long", report.overrun_causes.bus_long.to_string()),
        ("overruns_stolen", report.overrun_causes.stolen.to_string()),
        ("overruns_preempted", report.overrun_causes.preempted.to_string()),
        ("slipped", report.slipped.to_string()),
        ("frames_received", report.bus.received.to_string()),
        ("frames_sent", report.bus.sent.to_string()),
        ("frames_dropped", report.bus.dropped.to_string()),
        ("frames_refused", report.bus.refused.to_string()),
    ];
    match recorder.finish(&statistics) {
        Ok(summary) => PlantReport { recording: Some(summary), ..report },
        Err(error) => {
            let error = report.error.or(Some(RunError::NotRecorded(error)));
            PlantReport { error, ..report }
        }
    }
}

/// Rejects a plant whose states are not those that the messages of a user protocol carry: an FMU, or a program's own
/// structure, which the scenario does not know.
fn check_sent_states(scenario: &Scenario, wire: &WireSpec, plant: &Plant) -> Result<(), RunError> {
    let states = plant.structure().states();
    let is_at = |place: usize, name: ChannelName| match states.get(place) {
        Some(state) if state.name == name => Ok(()),
        _ => {
            let has = states.iter().map(|state| state.name.as_str()).collect::<Vec<_>>().join(", ");
            Err(RunError::SentStates { name, has })
        }
    };
    match wire {
        WireSpec::Cia402(spec) => {
            spec.drives.iter().try_for_each(|drive| is_at(drive.joint, joint_channel_name(drive.joint, false)))
        }
        WireSpec::Mapped(mapping) => {
            let quantities = Quantities::of_scenario(scenario).map_err(ScenarioError::from)?;
            let sources = mapping.outgoing.iter().flat_map(|message| &message.signals).map(|signal| &signal.source);
            let places = sources.filter_map(|source| match source {
                Source::Value { value: Value::State(place), .. } => Some(*place),
                _ => None,
            });
            let mut named = places.filter_map(|place| Some((place, quantities.channel(Value::State(place))?.name)));
            named.try_for_each(|(place, name)| is_at(place, name))
        }
    }
}
