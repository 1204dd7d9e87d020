//! Runs of an audit: the plant with its stimulus, the controller under test, and the record of both.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use toml::{Table, Value};

use crate::failure::Failure;
use crate::session::open_bus;
use crate::specifications;
use resonarm::audit::{BACK_S, Base, RESTART_S, Record, Stimulus};
use resonarm::bus::BusAddress;
use resonarm::judge::channel_name;
use resonarm::realtime::{Clock, SystemClock};
use resonarm::recording::{Existing, Recording, Topic};
use resonarm::rig::{FaultKind, FaultSpec, InstrumentName};
use resonarm::run::{ExciterEnd, Mode, Options, RecordTo, Session, Signals as RunSignals};
use resonarm::scenario::{Scenario, specification as files};
use resonarm::signals::Signals;
use resonarm::specification::{Specification, Test};

/// Time at full level of a random test, s: enough to decide a tolerance of 3 dB.
const FULL_LEVEL_S: f64 = 60.0;
/// Fastest sweep through light modes, octaves a minute: a faster one can't be controlled.
const LIGHT_OCT_MIN: f64 = 1.0;
/// Rms of the noise of an open cable, m/s².
const OPEN_M_S2: f64 = 0.05;
/// Time for which a run waits for the controller's first arming, s: an interpreter on a busy machine takes half a minute to start.
const PATIENCE_S: u64 = 120;
/// Time for which a plant on a bus waits for the answer to a sample, s, if its scenario does not state more: a controller that a
/// busy machine stops is not a late one.
const ANSWER_S: f64 = 10.0;
/// Deadlines of a run with a gap in the samples, s: the nodes note it and go on.
const GAP_DEADLINE_S: f64 = 1.0;
/// Time for a command to end by itself before it is killed, and between two looks, ns.
const END_NS: u64 = 5_000_000_000;
/// Longest time for an operator's command to say its word, ns.
const SPEECH_NS: u64 = 30_000_000_000;
const LOOK_NS: u64 = 20_000_000;

/// Files of a run in its folder: the specification, the recording, and what the commands printed.
pub(super) const FILES: [&str; 4] = ["spec.toml", "run.mcap", "controller.txt", "operator.txt"];

/// The controller under test.
#[derive(Debug)]
pub(super) enum UnderTest {
    /// The control, or the excitation, of a scenario, which runs in one process with the plant.
    Scenario {
        /// Scenario as it stands in its file.
        table: Table,
        /// Folder to which its paths are relative.
        folder: PathBuf,
        /// Name of the file, for messages.
        origin: String,
    },
    /// A command that is started for each run.
    Command {
        /// Bus on which it controls the plant.
        bus: BusAddress,
        /// The program and its arguments.
        words: Vec<String>,
        /// Program and arguments that say an operator's word to it.
        operator: Option<Vec<String>>,
    },
}

impl UnderTest {
    /// Reads the scenario of a controller.
    pub fn scenario(path: &Path) -> Result<UnderTest, Failure> {
        // The first reading finds what is wrong with it; the table keeps what an audit replaces.
        let scenario = Scenario::read(path)?;
        if scenario.control.is_none() && scenario.excitation.is_none() {
            let file = path.display();
            return Err(Failure::usage(format!(
                "{file} has neither a section [control] nor [excitation]: it is no controller"
            )));
        }
        let text =
            fs::read_to_string(path).map_err(|source| Failure::usage(format!("{}: {source}", path.display())))?;
        let table = parsed(&text, path)?;
        let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
        Ok(UnderTest::Scenario { table, folder, origin: path.display().to_string() })
    }

    /// Says whether the controller learns the specification of a run.
    fn is_told(&self) -> bool {
        match self {
            UnderTest::Scenario { table, .. } => {
                table.get("control").and_then(|control| control.get("specification")).is_some()
            }
            UnderTest::Command { words, .. } => words.iter().any(|word| word.contains("{spec}")),
        }
    }

    /// Says why the controller hears no operator; `None` if it does.
    fn why_deaf(&self) -> Option<&'static str> {
        match self {
            UnderTest::Scenario { table, .. } => {
                let law = table.get("control").and_then(|control| control.get("law")).and_then(Value::as_str);
                let hears = matches!(law, Some("random" | "swept-sine" | "shock"));
                (!hears).then_some("the controller hears no operator: only the laws random, swept-sine and shock do")
            }
            UnderTest::Command { operator, .. } => operator
                .is_none()
                .then_some("no command says an operator's word to the controller: state it by --operator"),
        }
    }
}

/// A run with what it recorded.
#[derive(Debug)]
pub(super) struct Run {
    pub specification: Specification,
    pub record: Record,
    pub recording: PathBuf,
    /// Sample at which the stimulus began.
    pub stimulus: usize,
    /// Why the controller ended early, if it runs in this process and says so.
    pub ended_by: Option<String>,
}

/// Plant, specification and controller of an audit.
#[derive(Debug)]
pub(super) struct AuditBench {
    scenario: Scenario,
    specification: Table,
    under_test: UnderTest,
    out: PathBuf,
    /// Control channel as the specification names it, and another one whose response can have a limit.
    control: String,
    response: String,
    instrument: InstrumentName,
}

impl AuditBench {
    pub fn new(
        scenario: Scenario,
        name: &Path,
        specification: &Specification,
        under_test: UnderTest,
        out: PathBuf,
    ) -> Result<AuditBench, Failure> {
        let control = match &specification.control.channels[..] {
            [] => String::from("c.x"),
            [one] => one.clone(),
            several => {
                let count = several.len();
                return Err(Failure::usage(format!(
                    "an audit has one control channel, the specification names {count}"
                )));
            }
        };
        let (instrument, other) = match control.split_once('.').map(|(sensor, _)| sensor) {
            Some("c") => (InstrumentName::C, "b"),
            Some("b") => (InstrumentName::B, "c"),
            _ => {
                let what =
                    "the control channel must be an axis of the sensor b or c, which the protocol carries, as c.x";
                return Err(Failure::usage(format!("the control channel is {control}: {what}")));
            }
        };
        let axis = control.split_once('.').map_or("x", |(_, axis)| axis);
        let response = format!("{other}.{axis}");
        let specification = table(name, &specification.test)?;
        Ok(AuditBench { scenario, specification, under_test, out, response, control, instrument })
    }

    /// Says why a stimulus can't be tried on this controller; `None` if it can.
    pub fn why_not(&self, stimulus: Stimulus) -> Option<&'static str> {
        match stimulus {
            Stimulus::Stop | Stimulus::Restart | Stimulus::Level(_) => self.under_test.why_deaf(),
            Stimulus::Gap(_) if matches!(self.under_test, UnderTest::Command { .. }) => {
                Some("in lockstep time waits for the controller, which notices no gap")
            }
            Stimulus::LightModes(_) if self.scenario.structure.modes.is_empty() => {
                Some("the scenario of the plant has no modes whose damping could be changed")
            }
            Stimulus::ResponseLimit(_) | Stimulus::DriveLimit(_) | Stimulus::LightModes(_)
                if !self.under_test.is_told() =>
            {
                Some("the controller does not read the specification: name it by {spec}, or by control.specification")
            }
            _ => None,
        }
    }

    /// Runs the controller on the plant with a stimulus, which acts from a sample of the base run on.
    pub fn run(&self, id: &str, stimulus: Stimulus, base: Option<(&Base<'_>, usize)>) -> Result<Run, Failure> {
        let folder = self.out.join(id);
        fs::create_dir_all(&folder).map_err(Failure::write(&folder))?;
        // An absolute path: those in the scenario of a controller are relative to its own folder.
        let folder = folder.canonicalize().map_err(Failure::write(&folder))?;
        let [spec, recording, printed, said] = FILES.map(|file| folder.join(file));
        let table = self.limited(stimulus, base);
        fs::write(&spec, table.to_string()).map_err(Failure::write(&spec))?;
        let specification = files::read(&spec)?;
        let mut scenario = self.scenario.clone();
        scenario.simulation.duration_s = Some(match base {
            Some((base, at)) if !matches!(stimulus, Stimulus::LightModes(_)) => duration_s(stimulus, base, at),
            _ => longest_s(&specification.test),
        });
        self.stimulate(&mut scenario, &specification.test, stimulus, base);
        let record = RecordTo { path: recording.clone(), existing: Existing::Overwrite };
        let options =
            Options { record: Some(record), patience: Some(Duration::from_secs(PATIENCE_S)), ..Options::default() };
        let mut ended_by = None;
        match &self.under_test {
            UnderTest::Scenario { table, folder, origin } => {
                let word = word(stimulus, base).map(|(word, at)| (word, at as f64 / self.scenario.simulation.rate_hz));
                let controller = controller_of_run(table, folder, origin, &spec, word)?;
                scenario.control = controller.control;
                scenario.excitation = controller.excitation;
                scenario.limits = controller.limits;
                let session = Session::new(scenario, Mode::Free, options)?;
                let report = session.both(&RunSignals::default(), &mut |_| {})?;
                // A run may end before the controller does.
                let end = ExciterEnd::of_controller(&report.exciter);
                ended_by = end.reason.filter(|_| end.outcome != "plant-left");
            }
            UnderTest::Command { bus, words, operator } => {
                // Whatever the plant's scenario says of a controller, it is the command that controls.
                scenario.control = None;
                scenario.excitation = None;
                scenario.limits = None;
                // A controller that is told to start again may have disarmed the plant.
                let options = Options { end_on_disarm: !matches!(stimulus, Stimulus::Restart), ..options };
                // While a word is said, the nodes wait for each other.
                let least_s = if word(stimulus, base).is_some() { 2e-9 * SPEECH_NS as f64 } else { ANSWER_S };
                let timeout_s = &mut scenario.network.lockstep_timeout_s;
                *timeout_s = timeout_s.max(least_s);
                let mut session = Session::new(scenario, Mode::Lockstep, options)?;
                let mut opened = open_bus(bus, &session, false)?;
                let bus = bus.to_string();
                let mut speech = None;
                if let (Some((word, at)), Some(operator)) = (word(stimulus, base), operator) {
                    let words = operator.iter().map(|part| part.replace("{bus}", &bus).replace("{word}", word.name()));
                    let own = speech.insert(Arc::new(Speech::new(words.collect(), said)));
                    let own = Arc::clone(own);
                    session = session.held_at(at as u64, move || own.is_over());
                }
                let replaced = |word: &String| {
                    word.replace("{bus}", &bus).replace("{spec}", &spec.display().to_string()).replace("{case}", id)
                };
                let words: Vec<String> = words.iter().map(replaced).collect();
                let started = Started::new(&words, &printed)?;
                let ran = session.plant(opened.as_mut(), &RunSignals::default(), &mut |_| {});
                started.end();
                ran?;
                opened.close()?;
                if let Some(failed) = speech.and_then(|speech| speech.failed()) {
                    return Err(failed);
                }
            }
        }
        let record = self.record(&recording, &specification)?;
        // One that does not wait for the level acts from the first sample on.
        let stimulus = base.filter(|_| stimulus.is_at_level()).map_or(0, |(_, at)| at);
        Ok(Run { specification, record, recording, stimulus, ended_by })
    }

    /// Returns the specification with the limits of a case.
    fn limited(&self, stimulus: Stimulus, base: Option<(&Base<'_>, usize)>) -> Table {
        let mut table = self.specification.clone();
        let Some((base, _)) = base else { return table };
        if let (Stimulus::LightModes(_), Some(rate)) =
            (stimulus, table.get_mut("sine").and_then(|sine| sine.get_mut("rate_oct_min")))
        {
            let stated = rate.as_float().or(rate.as_integer().map(|rate| rate as f64)).unwrap_or(LIGHT_OCT_MIN);
            *rate = Value::Float(stated.min(LIGHT_OCT_MIN));
        }
        let limits = table.entry("limits").or_insert_with(|| Value::Table(Table::new()));
        let Value::Table(limits) = limits else { return table };
        match stimulus {
            Stimulus::DriveLimit(part) => {
                limits.insert(String::from("drive_peak_n"), Value::from(part * base.peak_n));
            }
            Stimulus::ResponseLimit(below_db) => {
                let response = base.record.responses.first();
                let test = self.test();
                let limit =
                    response.zip(test).and_then(|(response, test)| base.response_limit(&test, response, below_db));
                if let Some(points) = limit {
                    let points = Value::from(points.map(|point| point.to_vec()).to_vec());
                    let limit = table_of([("channel", Value::from(&*self.response)), ("breakpoints", points)]);
                    limits.insert(String::from("response"), Value::from(vec![limit]));
                }
            }
            _ => {}
        }
        table
    }

    /// Returns the test of the specification.
    fn test(&self) -> Option<Test> {
        let parsed = files::parse(&self.specification.to_string(), "the specification", Path::new(""));
        parsed.ok().map(|specification| specification.test)
    }

    /// Adds what the plant does to its scenario.
    fn stimulate(&self, scenario: &mut Scenario, test: &Test, stimulus: Stimulus, base: Option<(&Base<'_>, usize)>) {
        let rate_hz = scenario.simulation.rate_hz;
        let at_s = base.map_or(0.0, |(_, at)| at as f64 / rate_hz);
        let fault = |kind, from_s| FaultSpec::new(self.instrument, kind, from_s);
        let gain = |factor, from_s| FaultSpec { factor: Some(factor), ..fault(FaultKind::Gain, from_s) };
        let open = |from_s| {
            // The signal is lost, and its cable picks up noise.
            let noise = FaultSpec { rms_m_s2: Some(OPEN_M_S2), ..fault(FaultKind::Noise, from_s) };
            [gain(0.0, from_s), noise]
        };
        let faults = &mut scenario.rig.faults;
        match stimulus {
            Stimulus::DeadFromStart => faults.push(fault(FaultKind::Dropout, 0.0)),
            Stimulus::OpenFromStart => faults.extend(open(0.0)),
            Stimulus::Dead => faults.push(fault(FaultKind::Dropout, at_s)),
            Stimulus::Open => faults.extend(open(at_s)),
            Stimulus::Gain(factor) => faults.push(gain(factor, at_s)),
            Stimulus::Restart => {
                faults.push(FaultSpec { to_s: Some(at_s + BACK_S), ..fault(FaultKind::Dropout, at_s) });
            }
            Stimulus::Harmonic(part) => {
                let Test::Sine(test) = test else { return };
                let ends = test.segments.iter().flat_map(|segment| [segment.from_hz, segment.to_hz]);
                let [from_hz, to_hz] = test.band_hz();
                let levels = ends.filter_map(|hz| test.acceleration_m_s2(hz.clamp(from_hz, to_hz)));
                // A sine of amplitude A has a harmonic of A²/2a, and an offset of the same size, which is taken off.
                let largest = levels.fold(0.0, f64::max);
                let to_s = scenario.simulation.duration_s;
                let distortion = fault(FaultKind::Distortion, at_s);
                faults.push(FaultSpec { amplitude_m_s2: Some(0.5 * largest / part), ..distortion });
                let offset = fault(FaultKind::Spike, at_s);
                faults.push(FaultSpec { to_s, amplitude_m_s2: Some(-part * largest), ..offset });
            }
            Stimulus::Inverted => faults.push(gain(-1.0, 0.0)),
            Stimulus::Clipped(sigma) => {
                let Test::Random(test) = test else { return };
                let range = sigma * libm::sqrt(test.profile.moment(0));
                let sensors = &mut scenario.rig.sensors;
                let sensor = if self.instrument == InstrumentName::C { &mut sensors.c } else { &mut sensors.b };
                sensor.range = range;
            }
            Stimulus::Gap(seconds) => {
                let network = &mut scenario.network;
                network.command_timeout_s = network.command_timeout_s.max(GAP_DEADLINE_S);
                network.partner_timeout_s = network.partner_timeout_s.max(GAP_DEADLINE_S);
                if let Some(wire) = &mut scenario.wire {
                    let of_commands = wire.commands.iter_mut().filter_map(|command| command.timeout_s.as_mut());
                    for timeout_s in of_commands.chain(&mut wire.timeout_s) {
                        *timeout_s = timeout_s.max(GAP_DEADLINE_S);
                    }
                }
                network.faults.push(resonarm::bus::fault::FaultSpec {
                    node: resonarm::bus::fault::FaultNode::Exciter,
                    kind: resonarm::bus::fault::FaultKind::Loss,
                    direction: Some(resonarm::bus::fault::FaultDirection::Both),
                    from_s: at_s,
                    to_s: Some(at_s + seconds),
                    ids: Vec::new(),
                    extended_ids: Vec::new(),
                    probability: Some(1.0),
                    count: None,
                    delay_s: None,
                    rate_hz: None,
                });
            }
            Stimulus::LightModes(damping_ratio) => {
                scenario.structure.modes.iter_mut().for_each(|mode| mode.damping_ratio = damping_ratio);
            }
            Stimulus::None
            | Stimulus::Stop
            | Stimulus::Level(_)
            | Stimulus::ResponseLimit(_)
            | Stimulus::DriveLimit(_) => {}
        }
    }

    /// Reads what the controller commanded and what its channels read.
    fn record(&self, path: &Path, specification: &Specification) -> Result<Record, Failure> {
        let rate_hz = self.scenario.simulation.rate_hz;
        let failed = |error: &dyn core::fmt::Display| Failure::usage(format!("{}: {error}", path.display()));
        let recording = Recording::open(path)?;
        let limited = specification.limits.response.iter().map(|limit| limit.channel.clone());
        let mut names = vec![channel_name(&recording, &self.control)];
        names.extend(limited.map(|name| channel_name(&recording, &name)));
        // The base run has no limit of a response; later ones are made from what is read here.
        if names.len() == 1 {
            names.push(channel_name(&recording, &self.response));
        }
        let readings = match Signals::read(&recording, &names, [None, None]) {
            Ok(readings) => readings,
            // A controller that never armed the plant leaves no sample behind.
            Err(_) if recording.summary().topics.get(Topic::Samples.name()).is_none_or(|topic| topic.records == 0) => {
                return Ok(Record { rate_hz, is_disarmed: true, ..Record::default() });
            }
            Err(error) => return Err(failed(&error)),
        };
        let loads: Vec<String> = recording
            .channels()
            .of(Topic::States)
            .iter()
            .map(|channel| channel.name.to_string())
            .filter(|name| name.starts_with("force_"))
            .collect();
        let loads = Signals::read(&recording, &loads, [None, None]).map_err(|error| failed(&error))?;
        let energy = |values: &Vec<f64>| values.iter().map(|value| value * value).sum::<f64>();
        // The drive is the load with the most energy: along the other axes there is little or none.
        let drive = loads.values.into_iter().max_by(|a, b| energy(a).total_cmp(&energy(b))).unwrap_or_default();
        let (armed, is_disarmed) = armed(&recording, drive.len())?;
        let drive = drive.into_iter().zip(armed).map(|(drive, is_armed)| if is_armed { drive } else { 0.0 }).collect();
        let mut values = readings.values.into_iter();
        let reading = values.next().unwrap_or_default();
        Ok(Record { rate_hz: readings.rate_hz, drive, reading, responses: values.collect(), is_disarmed })
    }
}

/// Says for every sample whether the plant was armed, for only then a load is what the controller commanded, and whether it was
/// disarmed in the end.
fn armed(recording: &Recording, samples: usize) -> Result<(Vec<bool>, bool), Failure> {
    let mut armed = vec![false; samples];
    let mut is_disarmed = false;
    for event in recording.events()? {
        let event = event?;
        if event.name.starts_with("state.") {
            let from = usize::try_from(event.sample).unwrap_or(samples).min(samples);
            armed[from..].fill(event.name == "state.operational");
            // A fault ends the drive, too, but the controller did not end it.
            is_disarmed = event.name != "state.operational" && event.name != "state.fault";
        }
    }
    // The last row is the state in which the run ended, whose load is meaningless.
    if let Some(last) = armed.last_mut() {
        *last = false;
    }
    Ok((armed, is_disarmed))
}

/// Time of simulation after which a run ends if the controller does not end it, s.
fn longest_s(test: &Test) -> f64 {
    // For checks and identification, which no specification states.
    const OWN_S: f64 = 240.0;
    OWN_S
        + match test {
            Test::Random(test) => test.schedule.as_ref().map_or(0.0, |schedule| schedule.duration_s()),
            Test::Sine(test) => {
                let [from_hz, to_hz] = test.band_hz();
                f64::from(test.sweeps) * test.sweep_s(from_hz, to_hz)
            }
            Test::Shock(_) | Test::Srs(_) => 0.0,
        }
}

/// Length of the run of a case, s.
fn duration_s(stimulus: Stimulus, base: &Base<'_>, at: usize) -> f64 {
    let seconds = |sample: usize| sample as f64 / base.record.rate_hz;
    let level_s = base.level.as_ref().map_or(0.0, |level| seconds(level.start));
    let end_s = seconds(base.record.len());
    match stimulus {
        Stimulus::DeadFromStart | Stimulus::OpenFromStart | Stimulus::Inverted => level_s + 2.0,
        Stimulus::Clipped(_) | Stimulus::DriveLimit(_) => level_s + 12.0,
        // The test must be back at its level.
        Stimulus::Gain(factor) if factor < 1.0 => seconds(at) + 26.0,
        Stimulus::Gap(_) => seconds(at) + 9.0,
        Stimulus::ResponseLimit(_)
        | Stimulus::LightModes(_)
        | Stimulus::Level(_)
        | Stimulus::Harmonic(_)
        | Stimulus::None => end_s + 5.0,
        Stimulus::Restart => seconds(at) + RESTART_S + 12.0,
        Stimulus::Dead | Stimulus::Open | Stimulus::Gain(_) | Stimulus::Stop => seconds(at) + 5.0,
    }
}

fn table_of<const N: usize>(entries: [(&str, Value); N]) -> Table {
    entries.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}

fn parsed(text: &str, path: &Path) -> Result<Table, Failure> {
    text.parse().map_err(|error: toml::de::Error| Failure::usage(format!("{}: {error}", path.display())))
}

/// Reads a specification as a table whose files have absolute paths and whose full level takes `FULL_LEVEL_S`.
fn table(name: &Path, test: &Test) -> Result<Table, Failure> {
    let (text, folder) = match specifications::preset(name) {
        Some(preset) => (preset.text.to_owned(), PathBuf::new()),
        None => {
            let failed = |source| Failure::usage(format!("{}: {source}", name.display()));
            let folder = name.canonicalize().map_err(failed)?.parent().map(Path::to_path_buf).unwrap_or_default();
            (fs::read_to_string(name).map_err(failed)?, folder)
        }
    };
    let mut table = parsed(&text, name)?;
    for section in ["random", "shock", "srs"] {
        if let Some(Value::String(file)) = table.get_mut(section).and_then(|section| section.get_mut("file")) {
            *file = folder.join(&*file).display().to_string();
        }
    }
    if matches!(test, Test::Random(_)) {
        let schedule = table.entry("schedule").or_insert_with(|| {
            let floats = |values: [f64; 4]| Value::from(values.to_vec());
            let levels_db = floats([-12.0, -6.0, -3.0, 0.0]);
            let seconds = floats([10.0, 10.0, 10.0, FULL_LEVEL_S]);
            Value::from(table_of([("levels_db", levels_db), ("seconds", seconds)]))
        });
        if let Some(last) = schedule.get_mut("seconds").and_then(Value::as_array_mut).and_then(|all| all.last_mut()) {
            *last = Value::Float(FULL_LEVEL_S);
        }
    }
    Ok(table)
}

/// Returns the word that an operator says in a run, and its sample.
fn word(stimulus: Stimulus, base: Option<(&Base<'_>, usize)>) -> Option<(Word, usize)> {
    let (base, at) = base?;
    match stimulus {
        Stimulus::Stop => Some((Word::Stop, at)),
        Stimulus::Restart => Some((Word::Start, at + (RESTART_S * base.record.rate_hz) as usize)),
        Stimulus::Level(level_db) => Some((Word::Level(level_db), at)),
        _ => None,
    }
}

/// Reads the scenario of a controller that follows the specification of a run, and hears a word of an operator at a time, s.
fn controller_of_run(
    table: &Table,
    folder: &Path,
    origin: &str,
    spec: &Path,
    word: Option<(Word, f64)>,
) -> Result<Scenario, Failure> {
    let mut table = table.clone();
    if let (Some((word, at_s)), Some(Value::Table(control))) = (word, table.get_mut("control")) {
        let mut said = table_of([("word", Value::from(word.name())), ("at_s", Value::from(at_s))]);
        if let Word::Level(level_db) = word {
            said.insert(String::from("level_db"), Value::from(level_db));
        }
        control.insert(String::from("operator"), Value::from(vec![said]));
    }
    if let Some(Value::String(own)) = table.get_mut("control").and_then(|control| control.get_mut("specification")) {
        *own = spec.display().to_string();
    }
    let mut scenario = Scenario::parse(&table.to_string(), origin)?;
    scenario.read_files(folder)?;
    Ok(scenario)
}

/// Word of an operator.
#[derive(Clone, Copy, Debug)]
enum Word {
    Stop,
    Start,
    /// Change of the level, dB.
    Level(f64),
}

impl Word {
    const fn name(self) -> &'static str {
        match self {
            Word::Stop => "stop",
            Word::Start => "start",
            Word::Level(_) => "level",
        }
    }
}

/// A command that says a word to the controller while simulated time stands.
#[derive(Debug)]
struct Speech {
    words: Vec<String>,
    log: PathBuf,
    said: Mutex<Said>,
}

#[derive(Debug)]
enum Said {
    NotYet,
    /// The command runs, at most until this time.
    Runs(Started, u64),
    /// It has ended, or could not be run.
    Over(Option<Failure>),
}

impl Speech {
    const fn new(words: Vec<String>, log: PathBuf) -> Speech {
        Speech { words, log, said: Mutex::new(Said::NotYet) }
    }

    /// Starts the command with the first call, and says whether it has ended.
    fn is_over(&self) -> bool {
        let mut said = self.said.lock().unwrap_or_else(PoisonError::into_inner);
        let problem = |what: String| {
            Said::Over(Some(Failure::usage(format!("the operator's command {:?}{what}", self.words.join(" ")))))
        };
        let next = match &mut *said {
            Said::NotYet => match Started::new(&self.words, &self.log) {
                Ok(started) => Said::Runs(started, SystemClock.now_ns() + SPEECH_NS),
                Err(failure) => Said::Over(Some(failure)),
            },
            Said::Runs(started, until_ns) => match started.0.try_wait() {
                Ok(Some(status)) if status.success() => Said::Over(None),
                Ok(Some(status)) => problem(format!(" ended with {status}; see {}", self.log.display())),
                Ok(None) if SystemClock.now_ns() < *until_ns => return false,
                Ok(None) => problem(format!(" has not ended after {} s", SPEECH_NS / 1_000_000_000)),
                Err(error) => problem(format!(": {error}")),
            },
            Said::Over(_) => return true,
        };
        *said = next;
        matches!(*said, Said::Over(_))
    }

    /// Returns why the word was not said.
    fn failed(&self) -> Option<Failure> {
        match &mut *self.said.lock().unwrap_or_else(PoisonError::into_inner) {
            Said::Over(failure) => failure.take(),
            Said::NotYet | Said::Runs(..) => None,
        }
    }
}

/// A controller that runs, or an operator's command; it is ended when it is dropped.
#[derive(Debug)]
struct Started(Child);

impl Started {
    fn new(words: &[String], log: &Path) -> Result<Started, Failure> {
        let Some((program, arguments)) = words.split_first() else {
            return Err(Failure::usage("the command is empty"));
        };
        let output = fs::File::create(log).map_err(Failure::write(log))?;
        let errors = output.try_clone().map_err(Failure::write(log))?;
        let started = Command::new(program).args(arguments).stdin(Stdio::null()).stdout(output).stderr(errors).spawn();
        started.map(Started).map_err(|source| Failure::usage(format!("can't start {program}: {source}")))
    }

    /// Lets the controller end by itself, as it does when the plant leaves, or ends it.
    fn end(mut self) {
        let until_ns = SystemClock.now_ns() + END_NS;
        while SystemClock.now_ns() < until_ns {
            match self.0.try_wait() {
                Ok(Some(_)) => return,
                Ok(None) => SystemClock.sleep_until_ns(SystemClock.now_ns() + LOOK_NS),
                Err(_) => break,
            }
        }
    }
}

impl Drop for Started {
    fn drop(&mut self) {
        // One that has ended can't be killed, and is only waited for.
        let _ended = self.0.kill();
        let _status = self.0.wait();
    }
}
