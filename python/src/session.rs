//! Runs: both nodes of a scenario in this process, or one of them on a bus, on a separate thread.

use core::fmt::Display;
use core::time::Duration;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};

use pyo3::prelude::*;
use pyo3::types::PyByteArray;
use resonarm::bus::{self, Bus};
use resonarm::control::ResponsePoint;
use resonarm::excitation::Phasor;
use resonarm::realtime::{FifoPriority, Spin, ThreadSetup};
use resonarm::recording::Existing;
use resonarm::run::{
    BothReport, ExciterEnd, ExciterReport, Mode, OnShortfall, Options, PlantReport, RecordTo, RunError, RunEvent,
    Session, Signals, Speed,
};
use serde::Serialize;

use crate::bus::BusEnd;
use crate::controller::{PyController, load_kind};
use crate::errors::{Raised, taken};
use crate::own_structure::OwnParts;
use crate::rows::Rows;
use crate::scenario::Scenario;
use crate::values;
use crate::watch::{joined, watched};
use crate::{errors, logging};

/// Most events that are kept until Python takes them.
const EVENTS: usize = 1024;

/// How to run, in the form of `resonarm.run` and `resonarm.Node`: mode, recording and whether it may be overwritten,
/// speed, patience, restarts after a fault, whether to end when disarmed, real time.
#[derive(Debug, FromPyObject)]
pub struct How(String, Option<PathBuf>, bool, Option<f64>, Option<f64>, u32, bool, RealTime);

/// Options of a run in real time: the reaction to a missed deadline, how strictly it needs a real-time thread,
/// priority, core, whether the cores are kept awake, how long the loop spins.
#[derive(Debug, FromPyObject)]
pub struct RealTime(Option<String>, Option<String>, Option<i64>, Option<usize>, bool, Option<SpinGiven>);

/// Time for which a loop spins before a deadline, as given.
#[derive(Debug, FromPyObject)]
enum SpinGiven {
    /// The word auto or off.
    Word(String),
    /// A time of the run, s.
    Time(f64),
}

impl SpinGiven {
    fn spin(&self) -> PyResult<Spin> {
        let refuse = |given: &dyn Display| {
            let message =
                format!("spin_s is {given}: it must be auto, off, or a time in seconds, above 0 and at most 1");
            Err(errors::value(message))
        };
        match self {
            SpinGiven::Word(word) if word == "auto" => Ok(Spin::Auto),
            SpinGiven::Word(word) if word == "off" => Ok(Spin::Off),
            SpinGiven::Word(word) => refuse(&format!("`{word}`")),
            SpinGiven::Time(time_s) if *time_s > 0.0 && *time_s <= 1.0 => Ok(Spin::For((time_s * 1e9).round() as u64)),
            SpinGiven::Time(time_s) => refuse(time_s),
        }
    }
}

impl RealTime {
    /// Sets the options of a run in this mode.
    fn set(self, mode: Mode, options: &mut Options) -> PyResult<()> {
        let RealTime(overrun, rt, priority, core, cores_awake, spin) = self;
        let given = [
            ("overrun", overrun.is_some()),
            ("rt", rt.is_some()),
            ("priority", priority.is_some()),
            ("core", core.is_some()),
            ("cores_awake", cores_awake),
            ("spin_s", spin.is_some()),
        ];
        if let (false, Some((name, _))) = (mode == Mode::RealTime, given.iter().find(|(_, is_given)| *is_given)) {
            let message = format!("{name} applies only to the mode real-time, but the mode is {mode}: leave it out");
            return Err(errors::value(message));
        }
        if let Some(policy) = overrun {
            options.overrun = policy.parse().map_err(errors::value)?;
        }
        if let Some(spin) = spin {
            options.spin = spin.spin()?;
        }
        let priority = priority.map(fifo_priority).transpose()?;
        let given = ThreadSetup { priority, lock_memory: priority.is_some(), core, cores_awake };
        let default = ThreadSetup::default();
        let whole = ThreadSetup { priority: priority.or(default.priority), lock_memory: true, ..given };
        let left_out =
            |asked: &str| Err(errors::value(format!("{asked} and rt off exclude each other: give one of them")));
        match (rt.as_deref(), core) {
            // Without `rt` the thread asks for what is given and no more: memory is locked for the sake of a priority
            // alone.
            (None, _) if priority.is_some() || core.is_some() || cores_awake => options.thread = Some(given),
            (Some("off"), Some(core)) => return left_out(&format!("core {core}")),
            (Some("off"), None) if cores_awake => return left_out("cores_awake"),
            (None, _) | (Some("off"), None) => {}
            (Some("auto"), _) => options.thread = Some(whole),
            (Some("require"), _) => {
                // What `auto` asks for, without which the run does not begin.
                options.thread = Some(whole);
                options.on_shortfall = OnShortfall::Refuse;
            }
            (Some(other), _) => {
                return Err(errors::value(format!("rt is `{other}`: it must be one of auto, require, off")));
            }
        }
        Ok(())
    }
}

fn patience(given_s: f64) -> PyResult<Duration> {
    Duration::try_from_secs_f64(given_s).map_err(|error| {
        errors::value(format!("patience_s is {given_s}: {error}; expected a time in seconds, 0 or more"))
    })
}

fn fifo_priority(given: i64) -> PyResult<FifoPriority> {
    let refused = |_| errors::value(format!("the real-time priority is {given}; it must be from 1 to 99"));
    FifoPriority::try_from(u8::try_from(given).map_err(refused)?).map_err(errors::value)
}

impl How {
    fn session(
        self,
        scenario: &Scenario,
        controller: Option<(Py<PyAny>, String)>,
        structure: Option<OwnParts>,
    ) -> PyResult<(Session, Raised)> {
        let How(mode, record, overwrite, speed, patience_s, rearm, end_on_disarm, real_time) = self;
        let mode: Mode = mode.parse().map_err(errors::value)?;
        let read = scenario.files();
        // Such a recording would overwrite the scenario, or a file that it refers to.
        if let Some(path) = record.as_ref().filter(|path| read.iter().any(|file| resonarm::same_file(file, path))) {
            let path = errors::printable(path.display().to_string());
            return Err(errors::value(format!(
                "record is {path}, from which the scenario was read: give another file for the recording"
            )));
        }
        let existing = if overwrite { Existing::Overwrite } else { Existing::Refuse };
        let patience = patience_s.map(patience).transpose()?;
        let mut options = Options {
            record: record.map(|path| RecordTo { path, existing }),
            speed: speed.map_or(Ok(Speed::UNPACED), Speed::new).map_err(errors::value)?,
            end_on_disarm,
            patience,
            rearm,
            ..Options::default()
        };
        real_time.set(mode, &mut options)?;
        let raised = Raised::default();
        let mut scenario = scenario.inner.clone();
        let session = match structure {
            // Each step of it takes the interpreter's lock and may wait for other threads, so no deadline can be
            // kept.
            Some(_) if mode == Mode::RealTime => {
                let message = "a structure in Python steps only in simulated time; use the mode free or lockstep";
                return Err(errors::value(message));
            }
            Some(parts) => {
                parts.name(&mut scenario);
                let structure = parts.structure(&scenario, &raised)?;
                Session::of_structure(scenario, mode, options, structure)
            }
            None => Session::new(scenario, mode, options),
        };
        // An exception of the user's code is the cause, and the session's error only its consequence.
        let mut session = session.map_err(|error| taken(&raised).unwrap_or_else(|| errors::run(error)))?;
        if let Some((call, kind)) = controller {
            let kind = load_kind(&kind)?;
            let raised = Arc::clone(&raised);
            session = session.with_controller(move || Box::new(PyController::new(&call, kind, &raised)));
        }
        Ok((session, raised))
    }
}

/// Report of the exciter.
#[derive(Serialize)]
struct ExciterDocument {
    #[serde(flatten)]
    end: ExciterEnd,
    samples_played: u64,
    missed_samples: u64,
    slipped_periods: u64,
    rearmed: u32,
    bus: resonarm::run::BusCounts,
    /// The first frame that was rejected for its checks, with the reason.
    #[serde(skip_serializing_if = "Option::is_none")]
    first_refused_frame: Option<String>,
}

impl From<&ExciterReport> for ExciterDocument {
    fn from(report: &ExciterReport) -> ExciterDocument {
        let ExciterReport { samples_played, missed_samples, slipped_periods, rearmed, bus, .. } = *report;
        let end = ExciterEnd::from(report);
        let first_refused_frame = report.first_refused_frame.clone();
        ExciterDocument { end, samples_played, missed_samples, slipped_periods, rearmed, bus, first_refused_frame }
    }
}

/// Plant's document, exciter's document, responses.
type BothDocuments<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyByteArray>);

/// Runs both nodes of a scenario. Ctrl-C ends the run in order.
#[pyfunction]
#[pyo3(signature = (scenario, how, controller = None, structure = None))]
pub fn run_both<'py>(
    py: Python<'py>,
    scenario: &Scenario,
    how: How,
    controller: Option<(Py<PyAny>, String)>,
    structure: Option<OwnParts>,
) -> PyResult<BothDocuments<'py>> {
    let (session, raised) = how.session(scenario, controller, structure)?;
    let signals = Signals::default();
    let report = watched(py, &|| signals.stop(), || session.both(&signals, &mut |_event| {}))?;
    taken(&raised).map_or(Ok(()), Err)?;
    let BothReport { plant, exciter } = report.map_err(errors::run)?;
    let documents = (values::document(py, &plant)?, values::document(py, &ExciterDocument::from(&exciter))?);
    Ok((documents.0, documents.1, responses(py, &exciter.responses)?))
}

/// Rows of the responses that an exciter read.
fn responses<'py>(py: Python<'py>, points: &[ResponsePoint]) -> PyResult<Bound<'py, PyByteArray>> {
    let mut rows = Rows::default();
    for point in points {
        // Rows have a fixed length, so a phase that could not be read is NaN.
        rows.numbers(&[point.frequency_hz, point.load, point.lag_rad.map_or(f64::NAN, f64::to_degrees), point.drift]);
        for pair in [point.head_force_n, point.acceleration_b_m_s2, point.acceleration_c_m_s2] {
            pair.iter().for_each(|Phasor { re, im, .. }| rows.numbers(&[*re, *im]));
        }
        rows.word(point.settled);
        rows.word(point.is_clipped());
        rows.word(point.tries);
    }
    rows.into_bytes(py)
}

/// The result of a node's run.
enum Report {
    Plant(Box<PlantReport>),
    Exciter(Box<ExciterReport>),
}

/// A node that runs on a bus, on a separate thread.
#[pyclass(frozen, subclass, module = "resonarm._resonarm")]
pub struct NodeRun {
    signals: Arc<Signals>,
    thread: Mutex<Option<JoinHandle<Result<Report, RunError>>>>,
    events: Mutex<Receiver<RunEvent>>,
    raised: Raised,
}

#[pymethods]
impl NodeRun {
    /// Starts `role`, plant or exciter, on an end of a bus in memory or on the bus of an address.
    #[new]
    #[pyo3(signature = (role, scenario, how, bus, controller = None, structure = None))]
    fn new(
        role: &str,
        scenario: &Scenario,
        how: How,
        bus: &Bound<'_, PyAny>,
        controller: Option<(Py<PyAny>, String)>,
        structure: Option<OwnParts>,
    ) -> PyResult<NodeRun> {
        if !matches!(role, "plant" | "exciter") {
            return Err(errors::value(format!("role is `{role}`: it must be plant or exciter")));
        }
        if how.0 == Mode::Free.name() {
            return Err(errors::run(RunError::FreeHasNoBus));
        }
        let How(.., RealTime(.., spin)) = &how;
        if role == "exciter" && spin.is_some() {
            return Err(errors::value("spin_s applies only to a plant: leave it out for an exciter"));
        }
        if role == "exciter" && structure.is_some() {
            return Err(errors::value("structure applies only to a plant: leave it out for an exciter"));
        }
        let (session, raised) = how.session(scenario, controller, structure)?;
        // Last of the arguments, so that another one that is wrong leaves the end of the bus with its owner.
        let mut bus: Box<dyn Bus> = match bus.cast::<BusEnd>() {
            Ok(end) => Box::new(end.get().take()?),
            Err(_) => {
                let address: String = bus.extract()?;
                bus::open(&address.parse().map_err(errors::bus)?).map_err(errors::bus)?
            }
        };
        let signals = Arc::new(Signals::default());
        let (sender, events) = sync_channel(EVENTS);
        let watched = Arc::clone(&signals);
        let work: Box<dyn FnOnce() -> Result<Report, RunError> + Send> = match role {
            "plant" => Box::new(move || {
                // A full queue loses events; the recording has them.
                let report = session.plant(bus.as_mut(), &watched, &mut |event| _ = sender.try_send(event))?;
                Ok(Report::Plant(Box::new(report)))
            }),
            _ => Box::new(move || {
                session.controller()?;
                Ok(Report::Exciter(Box::new(session.exciter(bus.as_mut(), &watched)?)))
            }),
        };
        let thread = Mutex::new(Some(thread::spawn(work)));
        Ok(NodeRun { signals, thread, events: Mutex::new(events), raised })
    }

    /// Whether it is still running.
    #[getter]
    fn is_running(&self) -> bool {
        let thread = self.thread.lock().unwrap_or_else(PoisonError::into_inner);
        thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }

    /// Index of the node's current sample.
    #[getter]
    fn sample(&self) -> u64 {
        self.signals.done()
    }

    /// The events since the last call.
    fn take_events<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let events = self.events.lock().unwrap_or_else(PoisonError::into_inner);
        values::document(py, &events.try_iter().collect::<Vec<_>>())
    }

    /// Asks it to end in order, without waiting.
    fn stop(&self) {
        self.signals.stop();
    }

    /// Waits for the end of the node and returns its report, and the responses of an exciter. Only the first call
    /// returns them.
    fn join<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyByteArray>)> {
        let thread = self.thread.lock().unwrap_or_else(PoisonError::into_inner).take();
        let thread = thread.ok_or_else(|| errors::failed("the report of this node was taken before; join it once"))?;
        while !thread.is_finished() {
            // Joining would block Ctrl-C, so the end is polled. Without the interpreter's lock, meanwhile, the node
            // can call a controller or a structure in Python.
            py.detach(|| thread::park_timeout(Duration::from_millis(1)));
            if let Err(error) = py.check_signals() {
                self.signals.stop();
                // The handle goes back, so that the node can be joined once it has ended in order.
                *self.thread.lock().unwrap_or_else(PoisonError::into_inner) = Some(thread);
                return Err(error);
            }
        }
        let report = joined(thread.join())?.map_err(errors::run)?;
        logging::hand_over(py)?;
        taken(&self.raised).map_or(Ok(()), Err)?;
        match report {
            Report::Plant(report) => Ok((values::document(py, &report)?, responses(py, &[])?)),
            Report::Exciter(report) => {
                let document = values::document(py, &ExciterDocument::from(report.as_ref()))?;
                Ok((document, responses(py, &report.responses)?))
            }
        }
    }
}
