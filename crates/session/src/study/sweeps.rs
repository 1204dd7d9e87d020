//! Stepped sweeps, in which each response starts where the one before ended; several sweeps at a time, which can be
//! resumed.

use std::path::Path;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::journal::Journal;
use super::parallel::on_all_cores;
use super::{Control, StudyError};
use resonarm_analysis::Reading;
use resonarm_analysis::time_domain::{SettleOptions, TimeDomainError};
use resonarm_analysis::time_domain::{Settled, Sweep, settle};
use resonarm_dynamics::structure::Dof;

/// Stepped sweeps of a structure, or of structures that differ in a parameter, that start in the same state.
#[derive(Clone, Debug)]
pub struct Sweeps {
    /// The sweeps to be computed.
    pub sweeps: Vec<Sweep>,
    /// The degrees of freedom at which responses are read.
    pub read: Vec<Dof>,
    /// The state, at phase 0, in which the first response of each sweep starts: coordinates, rates, states of elements.
    pub start: Vec<f64>,
    /// The longest time for each response to settle, and the number of points of its section that are kept.
    pub options: SettleOptions,
}

/// The response at one value of a sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SweepPoint {
    /// The number of the sweep, from 0.
    sweep: usize,
    /// The number of the value in the sweep, from 0.
    index: usize,
    /// Period of the response, as [`Settled::period`].
    pub period: Option<u32>,
    /// Largest magnitude of the Floquet multipliers, as [`Settled::largest_multiplier`].
    pub largest_multiplier: Option<f64>,
    /// Periods of integration until the end of the transient was proved, as [`Settled::settling_periods`].
    pub settling_periods: u64,
    /// Relative drift of the response, as [`Settled::drift`].
    pub drift: f64,
    coordinates: Vec<[f64; 4]>,
    readings: Vec<[f64; 4]>,
    /// Points of the Poincaré section, as [`Settled::section`].
    pub section: Vec<Vec<f64>>,
    /// State at phase 0 at the end of the integration: coordinates, rates, states of elements.
    pub end: Vec<f64>,
}

impl SweepPoint {
    /// Returns the readings of the coordinates, as [`Settled::coordinates`].
    pub fn coordinates(&self) -> Vec<Reading> {
        self.coordinates.iter().copied().map(Reading::from_numbers).collect()
    }

    /// Returns the readings of the response, as [`Settled::readings`].
    pub fn readings(&self) -> Vec<Reading> {
        self.readings.iter().copied().map(Reading::from_numbers).collect()
    }
}

impl Sweeps {
    /// Starts the computation, with the points that are in the journal for this configuration.
    ///
    /// # Errors
    /// [`StudyError::TimeDomain`] for a value at which nothing can be computed, [`StudyError::Journal`] for a journal
    /// that can't be used.
    pub fn begin(self, journal: Option<(&Path, &Value)>) -> Result<SweepComputation, StudyError> {
        self.sweeps.iter().try_for_each(Sweep::check)?;
        let (points, journal) = match journal {
            Some((path, configuration)) => {
                let (journal, points) = Journal::open(path, configuration)?;
                (self.sorted(points, &journal)?, Some(journal))
            }
            None => (self.sweeps.iter().map(|_| Vec::new()).collect(), None),
        };
        Ok(SweepComputation { sweeps: self, points, journal })
    }

    /// Sorts the points of a journal by sweep; those of one sweep follow each other in it.
    fn sorted(&self, points: Vec<SweepPoint>, journal: &Journal) -> Result<Vec<Vec<SweepPoint>>, StudyError> {
        let mut sweeps: Vec<Vec<SweepPoint>> = self.sweeps.iter().map(|_| Vec::new()).collect();
        for (k, point) in points.into_iter().enumerate() {
            let length = self.sweeps.get(point.sweep).map_or(0, |sweep| sweep.values.len());
            let before = sweeps.get_mut(point.sweep);
            // Sweeps run in parallel, so their points are interleaved in the file. Within a sweep they must be
            // complete from the first on.
            let place = before.filter(|before| before.len() == point.index && point.index < length);
            place.ok_or_else(|| journal.damaged(k + 2, "point that follows"))?.push(point);
        }
        Ok(sweeps)
    }

    /// Computes the point at a place, after the one before it.
    fn point(
        &self,
        sweep: usize,
        index: usize,
        before: Option<&SweepPoint>,
        stop: &dyn Fn() -> bool,
    ) -> Result<SweepPoint, TimeDomainError> {
        let swept = &self.sweeps[sweep];
        let map = swept.map(swept.values[index])?;
        // Each point starts in the state in which the one before ended: that is what makes a sweep show hysteresis,
        // and why the points of one sweep can't be computed in parallel.
        let start = before.map_or(&self.start, |before| &before.end);
        let settled = settle(&map, &self.read, start, &self.options, stop)?;
        let Settled { period, largest_multiplier, settling_periods, drift, coordinates, readings, section, end } =
            settled;
        let [coordinates, readings] = [coordinates, readings].map(|all| all.iter().map(Reading::numbers).collect());
        Ok(SweepPoint {
            sweep,
            index,
            period,
            largest_multiplier,
            settling_periods,
            drift,
            coordinates,
            readings,
            section,
            end,
        })
    }

    /// Continues one sweep after the known points, to its end or until `stop`.
    fn follow(
        &self,
        sweep: usize,
        mut points: Vec<SweepPoint>,
        stop: &dyn Fn() -> bool,
        finished: &impl Fn(&SweepPoint) -> Result<(), StudyError>,
    ) -> Result<Vec<SweepPoint>, StudyError> {
        for index in points.len()..self.sweeps[sweep].values.len() {
            match self.point(sweep, index, points.last(), stop) {
                Ok(point) => {
                    finished(&point)?;
                    points.push(point);
                }
                Err(TimeDomainError::Stopped) => break,
                Err(error) => return Err(error.into()),
            }
        }
        Ok(points)
    }
}

/// Sweeps as far as they are computed, and the journal of their points.
#[derive(Debug)]
pub struct SweepComputation {
    sweeps: Sweeps,
    points: Vec<Vec<SweepPoint>>,
    journal: Option<Journal>,
}

impl SweepComputation {
    /// Returns the points of each sweep.
    pub fn points(&self) -> &[Vec<SweepPoint>] {
        &self.points
    }

    /// Returns the number of points computed so far.
    pub fn done(&self) -> usize {
        self.points.iter().map(Vec::len).sum()
    }

    /// Returns the number of points that all sweeps have when they are complete.
    pub fn total(&self) -> usize {
        self.sweeps.sweeps.iter().map(|sweep| sweep.values.len()).sum()
    }

    /// Says whether all points are computed.
    pub fn is_complete(&self) -> bool {
        self.done() == self.total()
    }

    /// Says whether points are kept in a journal.
    pub fn is_kept(&self) -> bool {
        self.journal.is_some()
    }

    /// Computes the missing points, on as many threads as there are cores, until it is stopped.
    ///
    /// A sweep has the same result however often it was stopped, since each point starts in the exact state in which
    /// the one before ended.
    ///
    /// # Errors
    /// [`StudyError::TimeDomain`] if a response can't be computed, [`StudyError::Journal`] if the journal can't be
    /// written.
    pub fn compute_missing(self, control: &Control<'_>) -> Result<SweepComputation, StudyError> {
        let done = AtomicU64::new(self.done() as u64);
        // The first sweep that has failed, if one has. Those before it continue, so that the same error is reported
        // every time.
        let failed = AtomicUsize::new(usize::MAX);
        let journal = Mutex::new(self.journal);
        let finished = |point: &SweepPoint| {
            if let Some(journal) = journal.lock().unwrap_or_else(PoisonError::into_inner).as_mut() {
                journal.append(point)?;
            }
            (control.done)(done.fetch_add(1, Ordering::Relaxed) + 1);
            Ok(())
        };
        let jobs: Vec<(usize, Vec<SweepPoint>)> = self.points.into_iter().enumerate().collect();
        let work = |(sweep, known): &(usize, Vec<SweepPoint>)| {
            let stop = || (control.stop)() || failed.load(Ordering::Relaxed) < *sweep;
            let points = self.sweeps.follow(*sweep, known.clone(), &stop, &finished);
            points.inspect_err(|_error| _ = failed.fetch_min(*sweep, Ordering::Relaxed))
        };
        let points = on_all_cores(&jobs, work, || ()).into_iter().collect::<Result<_, _>>()?;
        let journal = journal.into_inner().unwrap_or_else(PoisonError::into_inner);
        Ok(SweepComputation { sweeps: self.sweeps, points, journal })
    }

    /// Removes the journal, when the results are written and there is nothing left to resume.
    ///
    /// # Errors
    /// [`StudyError::Journal`] if the journal can't be removed.
    pub fn finish(self) -> Result<(), StudyError> {
        Ok(self.journal.map_or(Ok(()), Journal::remove)?)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{QUIET, folds_hz, hardening};
    use super::*;
    use resonarm_analysis::Coordinate;
    use serde_json::json;

    /// Two sweeps of seven frequencies, up and down, from below both folds to above both.
    fn sweeps() -> Sweeps {
        let (forced, dof) = hardening();
        let folds = folds_hz(&forced, dof);
        let up: Vec<f64> = (0..7).map(|k| folds[1] + (folds[0] - folds[1]) * (f64::from(k) - 1.5) / 4.0).collect();
        let down = up.iter().rev().copied().collect();
        let over = Coordinate::FrequencyHz;
        let sweeps = [up, down].map(|values| Sweep { forced: forced.clone(), frequency_hz: 0.0, over, values });
        let sweeps = sweeps.into();
        let options = SettleOptions::default();
        Sweeps { sweeps, read: vec![dof], start: vec![0.0; 2], options }
    }

    fn computed(sweeps: Sweeps, journal: Option<(&Path, &Value)>) -> Result<SweepComputation, StudyError> {
        sweeps.begin(journal)?.compute_missing(&QUIET)
    }

    /// Up and down the responses differ between the folds, and nowhere else.
    #[test]
    fn sweeps_differ_between_the_folds() {
        let computed = computed(sweeps(), None).unwrap();
        assert!(computed.is_complete() && !computed.is_kept());
        let points = computed.points();
        let size = |point: &SweepPoint| point.readings()[0].largest;
        let differ = |index: usize| (size(&points[0][index]) / size(&points[1][6 - index]) - 1.0).abs() > 1e-6;
        let differing: Vec<usize> = (0..7).filter(|index| differ(*index)).collect();
        assert!(
            !differing.is_empty() && differing.len() < 7 && differing.windows(2).all(|pair| pair[1] == pair[0] + 1)
        );
        let settled = |point: &SweepPoint| {
            point.period == Some(1) && point.drift < 1e-9 && point.section[..] == *std::slice::from_ref(&point.end)
        };
        assert!(points.iter().flatten().all(settled));
    }

    /// A study that was killed after any number of points, in the middle of a line, produces bit-identical results.
    #[test]
    fn a_sweep_continues_as_if_never_stopped() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let configuration = json!({});
        let whole = computed(sweeps(), Some((&path, &configuration))).unwrap();
        let points = whole.points().to_vec();
        drop(whole);
        let text = std::fs::read_to_string(&path).unwrap();
        let lines: Vec<&str> = text.split_inclusive('\n').collect();
        assert_eq!(lines.len(), 15);
        for kept in [1, 7, 14, 15] {
            let torn = lines.get(kept).map_or("", |line| &line[..line.len() / 2]);
            std::fs::write(&path, lines[..kept].concat() + torn).unwrap();
            let resumed = sweeps().begin(Some((&path, &configuration))).unwrap();
            assert_eq!(resumed.done(), kept - 1);
            let resumed = resumed.compute_missing(&QUIET).unwrap();
            assert_eq!(resumed.points(), points, "{kept} lines");
            assert_eq!(std::fs::read_to_string(&path).unwrap().lines().count(), 15);
            resumed.finish().unwrap();
            assert!(!path.exists());
        }
    }

    #[test]
    fn stops_when_asked_to() {
        let stopped = Control { stop: &|| true, done: &|_done| () };
        assert_eq!(sweeps().begin(None).unwrap().compute_missing(&stopped).unwrap().done(), 0);
    }

    /// Whichever fails first, the error is that of the first sweep.
    #[test]
    fn the_same_error_is_reported_every_time() {
        let mut sweeps = sweeps();
        for (sweep, frequency_hz, values) in [(0, 11.0, [1.0, 1e12]), (1, 12.0, [1e12, 1.0])] {
            let forced = sweeps.sweeps[sweep].forced.clone();
            sweeps.sweeps[sweep] = Sweep { forced, frequency_hz, over: Coordinate::Amplitude, values: values.into() };
        }
        let error = computed(sweeps, None).unwrap_err().to_string();
        assert!(error.starts_with("excited at 11 Hz: the response grows without bound"), "{error}");
    }

    #[test]
    fn refuses_points_that_do_not_follow() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let (mut journal, _) = Journal::open::<SweepPoint>(&path, &json!({})).unwrap();
        let first = sweeps().point(0, 0, None, &|| false).unwrap();
        journal.append(&SweepPoint { index: 1, ..first }).unwrap();
        drop(journal);
        let refusal = computed(sweeps(), Some((&path, &json!({})))).unwrap_err().to_string();
        insta::assert_snapshot!(refusal.replace(&path.display().to_string(), "FILE"), @"line 2 of FILE is not a point that follows: delete the file to start again");
    }

    /// A value at which nothing can be computed ends everything, before any point is computed.
    #[test]
    fn says_what_can_not_be_computed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let mut bad = sweeps();
        bad.sweeps[1].values[4] = -1.0;
        insta::assert_snapshot!(computed(bad, Some((&path, &json!({})))).unwrap_err(), @"excitation frequency -1 Hz: it must be a positive number");
        assert!(!path.exists());
    }
}
