//! The index of a survey: which recordings there are, and how they were made.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::error::SurveyError;
use super::excitation::SurveyExcitation;
use resonarm_bench::identify::{Band, RigPlaces};
use resonarm_bench::rig::Load;
use resonarm_files::import::IMPORTED_FROM;
use resonarm_files::recording::{Integrity, Recording};
use resonarm_files::write_whole;
use resonarm_scenario::Scenario;

/// Version of the index.
const FORMAT: u32 = 1;

/// The index of a survey's recordings, `index.json` in its folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurveyIndex {
    /// Version of the index, 1.
    pub format: u32,
    /// The build that made the recordings; `None` of recordings that were listed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub build: Option<Value>,
    /// The plan of the recordings; `None` of recordings that were listed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plan: Option<PlanSummary>,
    /// The recordings, by level, place of the exciter and group of accelerometers.
    pub runs: Vec<SurveyRun>,
}

/// What the runs of a plan have in common.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanSummary {
    /// The seed from which those of all runs are derived.
    #[serde(with = "resonarm_numeric::seed")]
    pub seed: u64,
    /// What the exciter plays.
    pub excitation: SurveyExcitation,
    /// Lowest frequency of the band, Hz.
    pub from_hz: f64,
    /// Highest frequency of the band, Hz.
    pub to_hz: f64,
    /// Length of each run, s.
    pub duration_s: f64,
    /// Sample rate of the recordings, Hz.
    pub rate_hz: f64,
    /// Peak force at level 1, N.
    pub force_n: f64,
    /// Factors of the force.
    pub levels: Vec<f64>,
    /// Degrees of freedom of the exciter.
    pub exciters: Vec<String>,
    /// Degrees of freedom of each group of accelerometers.
    pub sensors: Vec<Vec<String>>,
    /// Numbers of the modes in the band, from 1.
    pub modes: Vec<usize>,
    /// Modes that are not in the band.
    pub left_out: Vec<LeftOut>,
    /// Least half-power bandwidth 2ζf of the modes in the band, Hz.
    pub bandwidth_hz: f64,
    /// The scenario from which those of the runs are made.
    pub scenario: Value,
}

/// A mode that is not in the band of a survey.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeftOut {
    /// Number of the mode, from 1.
    pub mode: usize,
    /// Where it is: `rigid` at 0 Hz or without vibration, `below` or `above` the band.
    pub place: String,
}

/// How far a run is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RunState {
    /// It has not ended yet.
    Planned,
    /// Its recording is complete.
    Done,
    /// It failed, and its reason says why.
    Failed,
}

impl RunState {
    /// Returns its name, as in the index.
    pub const fn name(self) -> &'static str {
        match self {
            RunState::Planned => "planned",
            RunState::Done => "done",
            RunState::Failed => "failed",
        }
    }
}

/// A run of a survey.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurveyRun {
    /// The recording, relative to the folder of the index.
    pub file: PathBuf,
    /// Factor of the force.
    pub level: f64,
    /// Peak force, N; `None` if the recording does not state it.
    pub force_n: Option<f64>,
    /// Degrees of freedom of the force: one in a plan.
    pub exciter: Vec<String>,
    /// Degrees of freedom that accelerometers read, that of the force among them.
    pub sensors: Vec<String>,
    /// Seed of the instruments' noise; `None` of a real recording.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Seed of the excitation; `None` if it has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub excitation_seed: Option<u64>,
    /// Length of the recording, s.
    pub duration_s: f64,
    /// How far it is.
    pub state: RunState,
    /// Reason of a failure.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

impl SurveyIndex {
    /// Name of the file in the folder of a survey.
    pub const FILE: &str = "index.json";

    /// Returns the index of runs of a plan.
    pub(super) fn new(build: Option<Value>, plan: Option<PlanSummary>, runs: Vec<SurveyRun>) -> SurveyIndex {
        SurveyIndex { format: FORMAT, build, plan, runs }
    }

    /// Returns the index of recordings that exist, of a real structure or of any runs. `levels` has the factor of the force of
    /// each; without any all are of level 1. Files are listed relative to `folder` if they are in it, else by their full path.
    ///
    /// # Errors
    /// [`SurveyError::Recording`] and [`SurveyError::Scenario`] of a recording that can't be read, [`SurveyError::Value`] if there
    /// are not as many levels as recordings.
    pub fn of_recordings(folder: &Path, files: &[PathBuf], levels: &[f64]) -> Result<SurveyIndex, SurveyError> {
        if !levels.is_empty() && levels.len() != files.len() {
            let expected = format!("left out, or one level for each of the {} recordings", files.len());
            return Err(SurveyError::Value { flag: "the number of --levels", got: levels.len() as f64, expected });
        }
        let runs = files.iter().enumerate().map(|(index, file)| {
            let level = levels.get(index).copied().unwrap_or(1.0);
            if level.is_finite() && level > 0.0 {
                recorded(folder, file, level)
            } else {
                Err(SurveyError::Value { flag: "--levels", got: level, expected: String::from("positive numbers") })
            }
        });
        Ok(SurveyIndex::new(None, None, runs.collect::<Result<_, _>>()?))
    }

    /// Reads the index in a folder.
    ///
    /// # Errors
    /// [`SurveyError::Read`], [`SurveyError::NotAnIndex`].
    pub fn read(folder: &Path) -> Result<SurveyIndex, SurveyError> {
        let path = folder.join(SurveyIndex::FILE);
        let text = std::fs::read_to_string(&path).map_err(|source| SurveyError::Read { path: path.clone(), source })?;
        let no_index = |reason| SurveyError::NotAnIndex { path: path.clone(), reason };
        let index: SurveyIndex = serde_json::from_str(&text).map_err(|error| no_index(error.to_string()))?;
        if index.format != FORMAT {
            return Err(no_index(format!("its format is {}, and this program reads {FORMAT}", index.format)));
        }
        Ok(index)
    }

    /// Returns the files of a survey: its index, and the recordings that it lists, as far as it can be read.
    pub fn files(folder: &Path) -> Vec<PathBuf> {
        let listed = SurveyIndex::read(folder).map_or(Vec::new(), |index| index.runs);
        let recordings = listed.into_iter().map(|run| folder.join(run.file));
        core::iter::once(folder.join(SurveyIndex::FILE)).chain(recordings).collect()
    }

    /// Writes the index into a folder, replacing one that is there.
    ///
    /// # Errors
    /// [`SurveyError::Write`].
    pub fn write(&self, folder: &Path) -> Result<PathBuf, SurveyError> {
        let path = folder.join(SurveyIndex::FILE);
        let failed = |source| SurveyError::Write { path: path.clone(), source };
        let text = serde_json::to_string_pretty(self).map_err(|error| failed(error.into()))? + "\n";
        write_whole(&path, text.as_bytes()).map_err(failed)?;
        Ok(path)
    }

    /// Returns the band of the plan.
    pub fn band(&self) -> Option<Band> {
        self.plan.as_ref().map(|plan| Band { from_hz: plan.from_hz, to_hz: plan.to_hz })
    }

    /// Returns the levels, each once, in the order of the runs.
    pub fn levels(&self) -> Vec<f64> {
        let mut levels: Vec<f64> = Vec::new();
        for run in &self.runs {
            if !levels.contains(&run.level) {
                levels.push(run.level);
            }
        }
        levels
    }

    /// Returns the runs with a complete recording at a level.
    pub fn at_level(&self, level: f64) -> impl Iterator<Item = &SurveyRun> {
        self.runs.iter().filter(move |run| run.level == level && run.state == RunState::Done)
    }

    /// Says whether all recordings are complete.
    pub fn is_complete(&self) -> bool {
        self.runs.iter().all(|run| run.state == RunState::Done)
    }
}

/// Returns the entry of a recording.
fn recorded(folder: &Path, file: &Path, level: f64) -> Result<SurveyRun, SurveyError> {
    let recording = Recording::open(file)?;
    let scenario = Scenario::from_configuration(recording.configuration())?;
    let places = match scenario.foreign_structure() {
        Some(_) => RigPlaces::of_rig(&scenario.rig),
        None => RigPlaces::of_structure(&scenario.under_test()?, &scenario.rig),
    };
    let mut sensors: Vec<String> = Vec::new();
    for at in places.readings.into_iter().filter_map(|reading| reading.at) {
        if !sensors.contains(&at) {
            sensors.push(at);
        }
    }
    let (state, reason) = match recording.integrity() {
        Integrity::Complete => (RunState::Done, None),
        _ => (RunState::Failed, Some(String::from("the recording is not complete"))),
    };
    let is_imported = recording.configuration().get(IMPORTED_FROM).is_some();
    Ok(SurveyRun {
        file: listed(folder, file),
        level,
        force_n: scenario.amplitude().map(|amplitude: &Load| amplitude.force_n.norm()).filter(|force| *force > 0.0),
        exciter: places.exciter.into_iter().flatten().collect(),
        sensors,
        seed: (!is_imported).then_some(scenario.simulation.seed),
        excitation_seed: None,
        duration_s: recording.summary().duration_s,
        state,
        reason,
    })
}

/// Returns the path of a file as an index in `folder` lists it.
fn listed(folder: &Path, file: &Path) -> PathBuf {
    let whole = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
    let folder = whole(folder);
    let file = whole(file);
    file.strip_prefix(&folder).map(Path::to_path_buf).unwrap_or(file)
}
