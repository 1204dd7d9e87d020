//! Imports logs of other tools as recordings.
//!
//! An imported recording of Resonarm's protocol holds only frames. It can be replayed; with the scenario of the logged
//! network, the responses that its controller read can be read again (`replay::responses` of the crate
//! `resonarm-session`). It has no states, so it can't be re-simulated.
//!
//! With a scenario that has a user protocol, the recording also holds readings, if the protocol carries all of them
//! every sample, and likewise states with the commanded loads; CANopen drives have states and loads. Nothing is
//! interpolated: missing data is a gap.

mod drives;
mod index;
mod loads;
mod rows;
mod wire;
mod wire_import;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use resonarm_bench::node::WireSpec;
use resonarm_bench::rig::Converter;
use resonarm_protocol::{DecodeError, Frame, MessageKind, Network, Node, Profile, Receiver};
use thiserror::Error;

use crate::can_log::{CanLogError, LogFormat, LoggedFrame, read};
use crate::recording::channels::Channels;
use crate::recording::{
    Channel, Configuration, Direction, Existing, FlushPolicy, FrameRecord, Naming, Options, Record, Recorder,
    RecordingError, RunTime,
};
use crate::staged::{file_kind, same_file};
use resonarm_scenario::wire::Quantities;
use resonarm_scenario::{Scenario, ScenarioError};

use drives::DriveGatherer;
use wire::Gatherer;
pub use wire_import::{Missing, WireImport};

/// Key of the imported log's name in a recording's configuration.
pub const IMPORTED_FROM: &str = "imported_from";
/// Most interfaces left out that are named.
const MOST_INTERFACES: usize = 16;
/// Capacity of the queue of records to the writer.
const CAPACITY: usize = 8192;

/// Options of an import.
#[derive(Clone, Debug)]
pub struct ImportOptions {
    /// Scenario of the logged network, with its sample rate; put into the recording. Without one the identifiers are
    /// the usual ones, and there are 1000 samples a second.
    pub scenario: Option<Scenario>,
    /// The interface, or the channel, whose frames are imported; without one that of the first frame.
    pub interface: Option<String>,
    /// The action if the recording already exists.
    pub existing: Existing,
    /// The clock that counts the samples of CANopen drives.
    pub clock: SampleClock,
}

/// The clock that counts samples in the log of a bus whose frames have neither index nor counter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SampleClock {
    /// Samples are counted by time stamps, at the rate of the scenario.
    #[default]
    TimeStamps,
    /// Samples are counted by SYNC: each begins a sample, as in lockstep, where a sample may take any time.
    Sync,
}

/// Gathers states and readings from the frames of a user protocol.
enum WireLog {
    /// Messages of a DBC.
    Mapped(Box<Gatherer>),
    /// Objects and SYNC messages of CANopen drives.
    Drives(Box<DriveGatherer>),
}

impl WireLog {
    fn new(scenario: &Scenario, clock: SampleClock) -> Result<Option<WireLog>, ImportError> {
        if let Some(WireSpec::Cia402(spec)) = scenario.wire_spec()? {
            let quantities = Quantities::of_scenario(scenario).map_err(ScenarioError::from)?;
            let drives = DriveGatherer::new(&spec, quantities, scenario.simulation.rate_hz, clock);
            return Ok(Some(WireLog::Drives(Box::new(drives))));
        }
        if clock == SampleClock::Sync {
            return Err(ImportError::NoSync);
        }
        Ok(Gatherer::new(scenario)?.map(|gatherer| WireLog::Mapped(Box::new(gatherer))))
    }

    /// Processes a frame; returns its direction and its sample, as far as they are known.
    fn add(&mut self, frame: &Frame, time_ns: u64) -> (Option<Direction>, Option<u64>) {
        match self {
            WireLog::Mapped(gatherer) => (gatherer.direction(frame.id()), gatherer.add(frame, time_ns)),
            WireLog::Drives(gatherer) => gatherer.add(frame, time_ns),
        }
    }

    fn next(&mut self, is_end: bool) -> Option<Record> {
        match self {
            WireLog::Mapped(gatherer) => gatherer.next(is_end),
            WireLog::Drives(gatherer) => gatherer.next(is_end),
        }
    }

    fn finish(self) -> WireImport {
        match self {
            WireLog::Mapped(gatherer) => gatherer.finish(),
            WireLog::Drives(gatherer) => gatherer.finish(),
        }
    }
}

/// Result of an import: the new recording, and counts of the parts that were left out.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Imported {
    /// Path of the new recording.
    pub path: PathBuf,
    /// Number of frames in the recording.
    pub frames: u64,
    /// The interface, or the channel, of the frames; `None` if the log names none.
    pub interface: Option<String>,
    /// Number of frames of other interfaces, left out.
    pub of_other_interfaces: u64,
    /// The names of those interfaces.
    pub other_interfaces: BTreeSet<String>,
    /// Number of lines or objects that are no frames, left out: error frames, comments, other events.
    pub others: u64,
    /// Number of lines or objects that can't be read, left out.
    pub unreadable: u64,
    /// Error of the first of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_unreadable: Option<String>,
    /// Time from the first frame to the last, s.
    pub duration_s: f64,
    /// Data gathered from the frames, if the scenario has a user protocol.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wire: Option<WireImport>,
}

/// Error of an import.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The log can't be read.
    #[error(transparent)]
    Log(#[from] CanLogError),
    /// The recording can't be written.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// SYNC can count only samples of CANopen drives.
    #[error("SYNC can count only samples of CANopen drives; use a scenario that has [wire] with `preset = \"cia402\"`")]
    NoSync,
    /// The scenario has no network or rate.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The log is a folder, a pipe or a device.
    #[error("can't read {}: it is {got}, expected a regular file, since a log is read twice", log.display())]
    NotAFile {
        /// Path of the log.
        log: PathBuf,
        /// Kind of the file, such as a folder or a pipe.
        got: &'static str,
    },
    /// There is nothing to import.
    #[error(
        "{} has no frames{}{}", log.display(),
        interface.as_ref().map_or(String::new(), |interface| format!(" of interface {interface}")),
        unreadable.as_ref().map_or(String::new(), |error| format!("; {error}"))
    )]
    Empty {
        /// Path of the log.
        log: PathBuf,
        /// The interface whose frames were requested; `None` for all.
        interface: Option<String>,
        /// Error of the first line or object that can't be read.
        unreadable: Option<String>,
    },
    /// A frame is earlier than the first by more than [`DISORDER_NS`].
    #[error("{}: frame {frame} is {early_ns} ns earlier than the first: the log is not in order", log.display())]
    Order {
        /// Path of the log.
        log: PathBuf,
        /// The frame, from 1 on.
        frame: u64,
        /// The time by which the frame is earlier, ns.
        early_ns: u64,
    },
}

/// Largest time, ns, by which frames may be earlier than the first of a log. A program that logs the frames that it
/// sends and receives stamps frames that waited in a queue with their arrival time. The earliest frame is the
/// beginning.
///
/// On a virtual machine a program may be stopped for 150 ms at any time, and its queue waits for as long.
pub const DISORDER_NS: u64 = 250_000_000;

/// A recording of frames, written frame by frame. Sample k begins k sample periods after the beginning. Frames have the
/// direction that the log states. With a scenario of the logged network, its frames have the direction of their
/// senders; so do those of the usual identifiers in a log without directions, if most of its frames with these
/// identifiers have the checksum of the protocol. All others count as received by the plant.
///
/// With a user protocol the recording also has readings. Their first sample is that of their time; from there on
/// samples are counted by the frames, and other frames belong to the newest sample.
pub struct FrameLog {
    recorder: Recorder,
    channel: Channel,
    log: PathBuf,
    network: Network,
    /// Whether the network is that of a scenario.
    is_known: bool,
    /// Whether a log without directions and scenario is of the usual network.
    is_usual: bool,
    wire: Option<WireLog>,
    rate_hz: f64,
    first_ns: u64,
    frames: u64,
}

impl FrameLog {
    /// Begins the recording `path` of the log `log`, whose earliest frame is `first`, which has not been written yet.
    /// The file gets its name as `naming` says.
    ///
    /// # Errors
    /// [`ImportError`] if the scenario has no network, or the recording can't be begun.
    pub fn create(
        log: &Path,
        format: &str,
        first: &LoggedFrame,
        (path, naming): (&Path, Naming),
        options: &ImportOptions,
    ) -> Result<FrameLog, ImportError> {
        let (network, rate_hz) = match &options.scenario {
            Some(scenario) => (scenario.network()?, scenario.simulation.rate_hz),
            None => (Network::default(), 1000.0),
        };
        let wire = match &options.scenario {
            Some(scenario) => WireLog::new(scenario, options.clock)?,
            None if options.clock == SampleClock::Sync => return Err(ImportError::NoSync),
            None => None,
        };
        let is_known = options.scenario.is_some();
        // The log is of a plant that need not be the simulated one, so that `rig.converter` does not apply to it.
        // Readers of the recording correct for the converter that is written there: one that changes nothing if it is
        // not known.
        let converter = options.scenario.as_ref().and_then(|known| known.network.plant_converter);
        let converter = converter.unwrap_or(Converter::Instant);
        let configuration = match &options.scenario {
            Some(scenario) => {
                let mut logged = scenario.clone();
                logged.rig.converter = converter;
                logged.configuration("none")?
            }
            None => Configuration::new(),
        };
        let configuration = configuration.with(IMPORTED_FROM, log.display()).with("log_format", format);
        let channels = match &options.scenario {
            Some(scenario) if wire.is_some() => {
                let quantities = Quantities::of_scenario(scenario).map_err(ScenarioError::from)?;
                Channels::new(quantities.moving(), quantities.loads(), quantities.readings())
            }
            _ => Channels::default(),
        };
        let options = Options {
            channels,
            time: RunTime::RealTime,
            clock_epoch_unix_ns: Some(first.time_ns),
            // By samples and not by the clock, so that the same log always makes the same bytes.
            flush: FlushPolicy::Samples(1000),
            existing: options.existing,
            reading_delay_samples: converter.delay_samples(),
            naming,
            ..Options::virtual_time(1.0 / rate_hz, first.interface.as_deref().unwrap_or_default())
        };
        let recorder = Recorder::create(path, &configuration, options)?;
        let channel = recorder.channel("log", CAPACITY)?;
        let log = log.to_path_buf();
        let first_ns = first.time_ns;
        Ok(FrameLog { recorder, channel, log, network, is_known, is_usual: false, wire, rate_hz, first_ns, frames: 0 })
    }

    /// Writes a frame, and returns its time since the beginning, ns.
    ///
    /// # Errors
    /// [`ImportError::Order`] if it is too early; [`ImportError::Recording`].
    pub fn push(&mut self, logged: &LoggedFrame) -> Result<u64, ImportError> {
        let time_ns = logged.time_ns.checked_sub(self.first_ns).ok_or_else(|| ImportError::Order {
            log: self.log.clone(),
            frame: self.frames + 1,
            early_ns: self.first_ns - logged.time_ns,
        })?;
        let frame = self.record(logged, time_ns);
        self.channel.push_blocking(&Record::Frame(frame))?;
        self.frames += 1;
        self.push_gathered(false)?;
        Ok(time_ns)
    }

    /// Writes the data gathered from the frames.
    fn push_gathered(&mut self, is_end: bool) -> Result<(), ImportError> {
        let Some(wire) = &mut self.wire else { return Ok(()) };
        while let Some(record) = wire.next(is_end) {
            self.channel.push_blocking(&record)?;
        }
        Ok(())
    }

    /// Returns a logged frame as the plant would have recorded it.
    fn record(&mut self, logged: &LoggedFrame, time_ns: u64) -> FrameRecord {
        let frame = logged.frame;
        let of_wire = self.wire.as_mut().map(|wire| wire.add(&frame, time_ns));
        let (direction, sample) = match of_wire {
            Some(known) => known,
            None => (self.direction(logged), None),
        };
        FrameRecord {
            sample: sample.unwrap_or(libm::floor(time_ns as f64 * 1e-9 * self.rate_hz) as u64),
            direction: direction.or(logged.direction).unwrap_or(Direction::Received),
            time_ns,
            bus_timestamp_ns: None,
            frame,
        }
    }

    /// Returns the direction of a frame: with the scenario of the network that of its sender; without one that of the
    /// log, and if the log has none, that of a network with the usual identifiers if the log is of one.
    fn direction(&self, logged: &LoggedFrame) -> Option<Direction> {
        // A log has the directions of the program that wrote it, which may have been at either end of the bus. A
        // recording has those of the plant.
        let by_sender = direction(self.network, &logged.frame);
        match self.is_known {
            true => by_sender,
            false => logged.direction.or(by_sender.filter(|_| self.is_usual)),
        }
    }

    /// Ends the recording, and returns how many frames are in it, and the data gathered from them if the scenario has a
    /// user protocol.
    ///
    /// # Errors
    /// [`ImportError::Recording`].
    pub fn finish(mut self) -> Result<(u64, Option<WireImport>), ImportError> {
        self.push_gathered(true)?;
        self.recorder.finish(&[("frames", self.frames.to_string())])?;
        Ok((self.frames, self.wire.map(WireLog::finish)))
    }
}

/// Imports a log into a recording, as described at [`FrameLog`].
///
/// The log is read twice, so that none is imported in part: the first pass checks it.
///
/// # Errors
/// [`ImportError`] if the log can't be read, twice, or has no frames, or the recording can't be written: it must not be
/// the log.
pub fn import(log: &Path, format: LogFormat, path: &Path, options: &ImportOptions) -> Result<Imported, ImportError> {
    import_converted(log, (log, format.name()), format, path, options)
}

/// Works like [`import`], of a log that was converted from a file of another format: the recording says that it was
/// imported from `original`, the name of that file and its format.
///
/// # Errors
/// As [`import`].
pub fn import_converted(
    log: &Path,
    original: (&Path, &str),
    format: LogFormat,
    path: &Path,
    options: &ImportOptions,
) -> Result<Imported, ImportError> {
    readable_twice(log)?;
    if same_file(log, path) {
        return Err(RecordingError::SameFile { path: path.to_path_buf() }.into());
    }
    let Checked { first, is_usual } = check(log, format, options)?;
    let mut written = FrameLog::create(original.0, original.1, &first, (path, Naming::Whole), options)?;
    // Only the whole log tells this, and the first frames are written before it is read again: the first pass must
    // decide.
    written.is_usual = is_usual;
    let mut imported = Imported { path: path.to_path_buf(), interface: first.interface.clone(), ..Imported::default() };
    let mut frames = read(log, format)?;
    for logged in &mut frames {
        let logged = logged?;
        // A recording has one interface. Frames of others are counted, so that the summary can say what is missing.
        if logged.interface != first.interface {
            imported.of_other_interfaces += 1;
            let name = logged.interface.unwrap_or_default();
            if imported.other_interfaces.len() < MOST_INTERFACES {
                imported.other_interfaces.insert(name);
            }
            continue;
        }
        let time_ns = written.push(&logged)?;
        imported.duration_s = imported.duration_s.max(time_ns as f64 * 1e-9);
    }
    imported.others = frames.others;
    imported.unreadable = frames.unreadable;
    imported.first_unreadable = frames.first_unreadable.map(|error| error.to_string());
    (imported.frames, imported.wire) = written.finish()?;
    Ok(imported)
}

/// Rejects a file that would be empty, or block, on the second reading.
fn readable_twice(log: &Path) -> Result<(), ImportError> {
    let found = fs::metadata(log).map_err(|source| CanLogError::Read { path: log.to_path_buf(), source })?;
    if found.is_file() {
        return Ok(());
    }
    Err(ImportError::NotAFile { log: log.to_path_buf(), got: file_kind(found.file_type()) })
}

/// Results of the first reading of a log, which the second reading uses.
struct Checked {
    /// The first wanted frame, with the time of the earliest.
    first: LoggedFrame,
    /// Whether most of the frames with the usual identifiers are of Resonarm's protocol.
    is_usual: bool,
}

/// Reads the whole log to check that it can be imported.
fn check(log: &Path, format: LogFormat, options: &ImportOptions) -> Result<Checked, ImportError> {
    let mut first: Option<LoggedFrame> = None;
    let mut earliest_ns = u64::MAX;
    let mut usual = UsualNetwork::new();
    let mut frames = read(log, format)?;
    let mut number = 0;
    for logged in &mut frames {
        let logged = logged?;
        let wanted = options.interface.as_deref().or(first.as_ref().and_then(|first| first.interface.as_deref()));
        // Without --interface the first frame of all decides which interface is imported.
        let is_wanted = (first.is_none() && options.interface.is_none()) || logged.interface.as_deref() == wanted;
        if !is_wanted {
            continue;
        }
        number += 1;
        let first_ns = first.get_or_insert_with(|| logged.clone()).time_ns;
        let early_ns = first_ns.saturating_sub(logged.time_ns);
        if early_ns > DISORDER_NS {
            return Err(ImportError::Order { log: log.to_path_buf(), frame: number, early_ns });
        }
        earliest_ns = earliest_ns.min(logged.time_ns);
        usual.add(&logged.frame);
    }
    match first {
        Some(first) => {
            Ok(Checked { first: LoggedFrame { time_ns: earliest_ns, ..first }, is_usual: usual.is_likely() })
        }
        None => Err(ImportError::Empty {
            log: log.to_path_buf(),
            interface: options.interface.clone(),
            unreadable: frames.first_unreadable.map(|error| error.to_string()),
        }),
    }
}

/// Decides whether frames are of Resonarm's protocol with the usual identifiers, which other networks use as well, by
/// the checksums of those that have one.
struct UsualNetwork {
    receivers: Vec<Receiver>,
    protected: u64,
    valid: u64,
}

impl UsualNetwork {
    fn new() -> UsualNetwork {
        let receivers = Profile::ALL.map(|profile| Receiver::new(Network::default().with_profile(profile)));
        UsualNetwork { receivers: receivers.to_vec(), protected: 0, valid: 0 }
    }

    fn add(&mut self, frame: &Frame) {
        let network = Network::default();
        let Some(kind) = MessageKind::from_id(network, frame.id()) else { return };
        if kind.data_id(network).is_none() {
            return;
        }
        self.protected += 1;
        // Whether frames before it were lost does not matter here.
        let is_of_protocol = |verdict| matches!(verdict, Ok(Some(_)) | Err(DecodeError::Counter { .. }));
        // The frames of both profiles have the same identifiers, so each is tried.
        let is_valid = self.receivers.iter_mut().any(|receiver| is_of_protocol(receiver.accept(frame)));
        self.valid += u64::from(is_valid);
    }

    const fn is_likely(&self) -> bool {
        // A majority: frames that were damaged or lost must not decide, nor must a foreign checksum that fits by
        // chance.
        2 * self.valid > self.protected
    }
}

/// Returns the direction of a frame of the network.
fn direction(network: Network, frame: &Frame) -> Option<Direction> {
    match MessageKind::from_id(network, frame.id()).map(MessageKind::sender)? {
        Node::Plant => Some(Direction::Sent),
        Node::Exciter => Some(Direction::Received),
    }
}

#[cfg(test)]
mod tests;
