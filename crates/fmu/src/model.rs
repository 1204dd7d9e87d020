//! Simulation of an instance.

use crate::content::Content;
use crate::fault::{Fault, WrongCall};
use crate::model_state::Saved;
use crate::terminal::Terminal;
use crate::variables::Source;
use resonarm_bench::structure::LOADS;
use resonarm_files::recording::Existing;
use resonarm_scenario::Scenario;
use resonarm_session::run::{Mode, Options, RecordTo, Session};

/// A part of a sample period by which times may differ: importers add up steps, and lose some 1e-10 s in an hour.
pub(crate) const TOLERANCE_SAMPLES: f64 = 1e-3;

/// Parameters that the importer may set before the simulation begins.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Parameters {
    /// The angles of the links of a preset; empty of another structure.
    pub angles_deg: Vec<f64>,
    pub seed: u64,
    pub noise: bool,
    /// Path of the recording; empty if nothing is recorded.
    pub recording: String,
    pub overwrite: bool,
}

impl Parameters {
    /// The parameters that the scenario states.
    pub fn of(scenario: &Scenario) -> Parameters {
        Parameters {
            angles_deg: scenario.structure.angles_deg.clone(),
            seed: scenario.simulation.seed,
            noise: true,
            recording: String::new(),
            overwrite: false,
        }
    }

    /// The content's scenario with these parameters, ready to run.
    pub fn session(&self, content: &Content) -> Result<Session, Fault> {
        let mut scenario = content.scenario.clone();
        scenario.structure.angles_deg.clone_from(&self.angles_deg);
        scenario.simulation.seed = self.seed;
        if !self.noise {
            scenario.rig = scenario.rig.without_noise();
        }
        let existing = if self.overwrite { Existing::Overwrite } else { Existing::Refuse };
        let record = (!self.recording.is_empty()).then(|| RecordTo { path: self.recording.clone().into(), existing });
        Ok(Session::new(scenario, Mode::Free, Options { record, ..Options::default() })?)
    }
}

/// The loads that the importer has set, in the order of [`LOADS`].
pub(crate) type Inputs = [f64; LOADS.len()];

/// A step, in seconds from the start of the simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Span {
    pub from_s: f64,
    pub to_s: f64,
}

/// The number of the last sample that is reached at `time_s` after the start.
pub(crate) fn reached(time_s: f64, rate_hz: f64) -> u64 {
    (time_s * rate_hz + TOLERANCE_SAMPLES) as u64
}

/// The capability by which a description says that a model has no states to save.
pub(crate) const NO_STATES: &str = "canGetAndSetFMUState is false";

/// The simulation behind an instance: the plant by signals, a CAN node or the bus.
pub(crate) trait Model {
    /// The simulation begins: a recording is opened.
    fn begin(&mut self) -> Result<(), Fault> {
        Ok(())
    }

    /// Simulates one step. Returns whether event mode is needed then.
    fn step(&mut self, span: Span, inputs: &Inputs) -> Result<bool, Fault>;

    /// The value of a variable of the type Float64; of a Boolean 0 or 1.
    fn number(&self, _source: Source) -> f64 {
        f64::NAN
    }

    /// The value of a variable of the type UInt64.
    fn count(&self, source: Source) -> u64;

    /// The terminal of this number, from 0.
    fn terminal(&mut self, _index: usize) -> Option<&mut Terminal> {
        None
    }

    /// Ends an iteration of event mode. Returns whether another is needed.
    fn update(&mut self) -> Result<bool, Fault> {
        Ok(false)
    }

    /// The intervals of countdown clocks are asked for.
    fn before_interval(&mut self) {}

    /// Returns a copy of the current state.
    fn save(&mut self) -> Result<Saved, Fault> {
        Err(WrongCall::NotOffered { why: NO_STATES }.into())
    }

    /// Returns to a state.
    fn restore(&mut self, _saved: &Saved) -> Result<(), Fault> {
        Err(WrongCall::NotOffered { why: NO_STATES }.into())
    }

    /// The simulation ends: a recording is finished.
    fn end(&mut self) -> Result<(), Fault> {
        Ok(())
    }
}
