//! Runs of a survey on all cores, recorded into its folder, which can be continued.

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use serde_json::{Value, json};

use super::error::SurveyError;
use super::index::{RunState, SurveyIndex, SurveyRun};
use super::plan::{PlannedRun, SurveyPlan};
use crate::run::{ExciterEnd, Mode, Options, RecordTo, RunError, Session, Signals};
use crate::study::{difference, on_all_cores};
use resonarm_files::recording::{Existing, Integrity, Recording, build_info};

/// A survey in its folder.
#[derive(Debug)]
pub struct Survey {
    folder: PathBuf,
    runs: Vec<PlannedRun>,
    index: Mutex<SurveyIndex>,
    /// Signals of each run.
    signals: Vec<Signals>,
    /// Keeps other processes out of the folder.
    _lock: File,
}

impl Survey {
    /// Begins a survey in a folder, which is made if it is not there. Complete recordings of the same plan are kept.
    ///
    /// # Errors
    /// [`SurveyError::Differs`] and [`SurveyError::Exists`] if the folder holds another survey or other files of these names,
    /// unless they may be overwritten; [`SurveyError::InUse`], [`SurveyError::NotAnIndex`], [`SurveyError::Write`].
    pub fn begin(folder: &Path, plan: SurveyPlan, overwrite: bool) -> Result<Survey, SurveyError> {
        let failed = |source| SurveyError::Write { path: folder.to_path_buf(), source };
        fs::create_dir_all(folder).map_err(failed)?;
        // The folder itself is locked: no file of a lock stays behind after a kill.
        let lock = File::open(folder).map_err(failed)?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(SurveyError::InUse { path: folder.to_path_buf() }),
            Err(TryLockError::Error(source)) => return Err(failed(source)),
        }
        let entries = plan.runs.iter().map(|run| run.entry.clone()).collect();
        let build = json!(build_info());
        let mut index = SurveyIndex::new(Some(build), Some(plan.summary), entries);
        let path = folder.join(SurveyIndex::FILE);
        let is_same = match path.exists() {
            true => match difference("", &lasting(&json!(SurveyIndex::read(folder)?)), &lasting(&json!(index))) {
                None => true,
                Some(_) if overwrite => false,
                Some((key, had, has)) => return Err(SurveyError::Differs { path, key, had, has }),
            },
            false => false,
        };
        for (run, entry) in plan.runs.iter().zip(&mut index.runs) {
            let path = folder.join(&entry.file);
            if is_same && is_recorded(&path, run)? {
                entry.state = RunState::Done;
            } else if !is_same && !overwrite && path.symlink_metadata().is_ok() {
                return Err(SurveyError::Exists { path });
            }
        }
        index.write(folder)?;
        let signals = plan.runs.iter().map(|_| Signals::default()).collect();
        Ok(Survey { folder: folder.to_path_buf(), runs: plan.runs, index: Mutex::new(index), signals, _lock: lock })
    }

    /// Returns the number of runs whose recordings are complete.
    pub fn complete(&self) -> usize {
        self.with_index(|index| index.runs.iter().filter(|run| run.state == RunState::Done).count())
    }

    /// Returns the number of runs.
    pub fn total(&self) -> usize {
        self.runs.len()
    }

    /// Returns the number of samples of the runs that are missing.
    pub fn missing_samples(&self) -> u64 {
        let missing = |run: &&SurveyRun| run.state != RunState::Done;
        self.with_index(|index| {
            let runs = self.runs.iter().zip(&index.runs).filter(|(_, entry)| missing(entry));
            runs.map(|(run, _)| samples(run)).sum()
        })
    }

    /// Returns the number of samples that were simulated so far.
    pub fn samples_done(&self) -> u64 {
        self.signals.iter().map(Signals::done).sum()
    }

    /// Asks all runs to end. Those that have not ended by themselves are left out.
    pub fn stop(&self) {
        self.signals.iter().for_each(Signals::stop);
    }

    /// Makes the missing recordings, on all cores, and returns the index. A run that fails is in it with the reason.
    ///
    /// # Errors
    /// [`SurveyError::Write`] if the index can't be written.
    pub fn run(&self) -> Result<SurveyIndex, SurveyError> {
        let missing: Vec<usize> = self.with_index(|index| {
            (0..index.runs.len()).filter(|number| index.runs[*number].state != RunState::Done).collect()
        });
        let work = |number: &usize| {
            let (state, reason) = self.measure(*number);
            self.with_index(|index| {
                index.runs[*number].state = state;
                index.runs[*number].reason = reason;
                index.write(&self.folder).map(drop)
            })
        };
        on_all_cores(&missing, work, || ()).into_iter().collect::<Result<Vec<()>, _>>()?;
        Ok(self.with_index(|index| index.clone()))
    }

    fn with_index<R>(&self, act: impl FnOnce(&mut SurveyIndex) -> R) -> R {
        // Every change puts whole values in place of others, so the index is usable even if a thread has panicked with
        // it.
        act(&mut self.index.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Runs one recording of the plan, and returns how it ended.
    fn measure(&self, number: usize) -> (RunState, Option<String>) {
        let run = &self.runs[number];
        let signals = &self.signals[number];
        if signals.is_stopped() {
            return (RunState::Planned, None);
        }
        let path = self.folder.join(&run.entry.file);
        let record = Some(RecordTo { path: path.clone(), existing: Existing::Overwrite });
        let options = Options { record, ..Options::default() };
        let session = Session::new(run.scenario.clone(), Mode::Free, options);
        let reason = match session.and_then(|session| session.both(signals, &mut |_| {})) {
            Err(error) => Some(error.to_string()),
            Ok(report) => {
                let end = ExciterEnd::of(report.exciter_outcome(signals).as_ref());
                if signals.is_stopped() && !end.is_finished() {
                    // The recording ends in order, before its time. What is left of it is of no use.
                    let _may_stay = fs::remove_file(&path);
                    return (RunState::Planned, None);
                }
                let of_plant = report.plant.error.as_ref().map(RunError::to_string);
                let end = ExciterEnd::from(&report.exciter);
                of_plant.or_else(|| (!end.is_finished()).then(|| end.reason.unwrap_or_else(|| end.outcome.to_owned())))
            }
        };
        let state = if reason.is_some() { RunState::Failed } else { RunState::Done };
        (state, reason)
    }
}

/// Returns an index without what changes as a survey goes on.
fn lasting(index: &Value) -> Value {
    let mut index = index.clone();
    for run in index.get_mut("runs").and_then(Value::as_array_mut).into_iter().flatten() {
        if let Some(run) = run.as_object_mut() {
            run.remove("state");
            run.remove("reason");
        }
    }
    index
}

/// Returns the number of samples of a run's excitation.
fn samples(run: &PlannedRun) -> u64 {
    libm::round(run.entry.duration_s * run.scenario.simulation.rate_hz) as u64
}

/// Says whether a file is the complete recording of a run.
fn is_recorded(path: &Path, run: &PlannedRun) -> Result<bool, SurveyError> {
    // Whatever can't be opened, as after a kill before the first chunk, is recorded anew.
    let Ok(recording) = Recording::open(path) else { return Ok(false) };
    let wanted = run.scenario.configuration(Mode::Free.name())?;
    let is_same = wanted.iter().all(|(key, value)| recording.configuration().get(key) == Some(value));
    // A run that was stopped ends in order, too.
    let recorded = recording.statistics().and_then(|statistics| statistics.get("samples")?.parse::<u64>().ok());
    let is_long = recorded.is_some_and(|recorded| recorded >= samples(run));
    Ok(is_same && is_long && *recording.integrity() == Integrity::Complete)
}
