//! Chains of motions, each point begun where the one before ended; several chains at a time, stopped and gone on with.

use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::failure::Failure;
use super::journal::Journal;
use super::supervise::supervise;
use crate::analysis::time_domain::{SettleOptions, Settled, StroboscopicMap, TimeDomainError, settle};
use crate::arm::{Arm, State};
use crate::integrate::Sine;
use crate::run::Signals;

/// One arm under one excitation after the other.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    pub arm: Arm,
    pub excitations: Vec<Sine>,
}

/// Chains that begin in the same state.
#[derive(Clone, Debug)]
pub(super) struct Chains {
    pub chains: Vec<Chain>,
    pub start: State,
    pub options: SettleOptions,
}

/// The motion at one point of a chain, α1, α2, α̇1, α̇2 being a state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Point {
    pub chain: usize,
    pub index: usize,
    pub amplitude_rad: [f64; 2],
    pub harmonic1_rad: [f64; 2],
    pub period: Option<u32>,
    pub largest_multiplier: Option<f64>,
    pub settling_periods: u64,
    pub drift: f64,
    pub section: Vec<[f64; 4]>,
    end: [f64; 4],
}

fn numbers(state: &State) -> [f64; 4] {
    let (x, v) = (&state.alpha_rad, &state.alpha_dot_rad_s);
    [x.x, x.y, v.x, v.y]
}

impl Point {
    fn new(chain: usize, index: usize, settled: &Settled) -> Point {
        Point {
            chain,
            index,
            amplitude_rad: settled.amplitude_rad,
            harmonic1_rad: settled.harmonic1_rad,
            period: settled.period,
            largest_multiplier: settled.largest_multiplier,
            settling_periods: settled.settling_periods,
            drift: settled.drift,
            section: settled.section.iter().map(numbers).collect(),
            end: numbers(&settled.end),
        }
    }

    fn end(&self) -> State {
        let [x1, x2, v1, v2] = self.end;
        State::new([x1, x2], [v1, v2])
    }
}

/// What came of chains.
#[derive(Debug)]
pub(super) struct Walked {
    /// The points of each chain.
    pub points: Vec<Vec<Point>>,
    /// How many there are to be.
    pub total: usize,
    journal: Option<Journal>,
}

impl Walked {
    pub fn done(&self) -> usize {
        self.points.iter().map(Vec::len).sum()
    }

    /// Whether every point is there; if not, the work was stopped, and this says so.
    pub fn is_complete(&self) -> bool {
        let (done, total) = (self.done(), self.total);
        if done < total {
            let advice = match self.journal {
                Some(_) => "the same command goes on from there",
                None => "with --out the same command would go on from there",
            };
            tracing::error!("stopped after {done} of {total} points; {advice}");
        }
        done == total
    }

    /// To be called when the results are written: there is nothing to go on with any more.
    pub fn finish(self) -> Result<(), Failure> {
        Ok(self.journal.map_or(Ok(()), Journal::remove)?)
    }
}

impl Chains {
    /// Computes all points that the journal doesn't have, on as many threads as there are cores, with a progress bar.
    ///
    /// Ctrl-C stops it. A chain is the same however often it was stopped, for each point begins with the exact state in which
    /// the one before ended.
    pub fn walk(self, name: &'static str, journal: Option<(&Path, &Value)>) -> Result<Walked, Failure> {
        self.check()?;
        let (journal, known) = match journal {
            Some((path, configuration)) => {
                let (journal, points) = Journal::open(path, configuration)?;
                let known = self.sorted(points, &journal)?;
                (Some(journal), known)
            }
            None => (None, vec![Vec::new(); self.chains.len()]),
        };
        let done: usize = known.iter().map(Vec::len).sum();
        if done > 0 {
            tracing::warn!("going on after {done} of {} points", self.total());
        }
        let signals = Arc::new(Signals::default());
        let watched = Arc::clone(&signals);
        let total = self.total();
        let work = move || self.compute(known, journal, &watched);
        let (points, journal) = supervise(name, &signals, Some(total as u64), work)??;
        Ok(Walked { points, total, journal })
    }

    /// Refuses what can't be computed before anything is.
    fn check(&self) -> Result<(), Failure> {
        for chain in &self.chains {
            for sine in &chain.excitations {
                StroboscopicMap::new(&chain.arm, *sine)?;
            }
        }
        Ok(())
    }

    fn total(&self) -> usize {
        self.chains.iter().map(|chain| chain.excitations.len()).sum()
    }

    /// The points of a journal by chain; those of one chain follow each other in it.
    fn sorted(&self, points: Vec<Point>, journal: &Journal) -> Result<Vec<Vec<Point>>, Failure> {
        let mut chains = vec![Vec::new(); self.chains.len()];
        for (k, point) in points.into_iter().enumerate() {
            let place = chains.get_mut(point.chain).filter(|before| {
                before.len() == point.index && point.index < self.chains[point.chain].excitations.len()
            });
            place.ok_or_else(|| journal.damaged(k + 2, "point that follows"))?.push(point);
        }
        Ok(chains)
    }

    /// Goes on with each chain behind the points known, until the end or until the signals say stop.
    fn compute(
        &self,
        known: Vec<Vec<Point>>,
        journal: Option<Journal>,
        signals: &Signals,
    ) -> Result<(Vec<Vec<Point>>, Option<Journal>), Failure> {
        let done = AtomicU64::new(known.iter().map(|points| points.len() as u64).sum());
        let (next, journal) = (AtomicUsize::new(0), Mutex::new(journal));
        let chains: Vec<Mutex<Vec<Point>>> = known.into_iter().map(Mutex::new).collect();
        let finished = |point: &Point| {
            if let Some(journal) = journal.lock().unwrap_or_else(PoisonError::into_inner).as_mut() {
                journal.append(point)?;
            }
            signals.set_step(done.fetch_add(1, Ordering::Relaxed) + 1);
            Ok(())
        };
        let worker = || -> Result<(), Failure> {
            loop {
                // Each chain is taken by one thread only.
                let chain = next.fetch_add(1, Ordering::Relaxed);
                let Some(points) = chains.get(chain) else { return Ok(()) };
                let mut points = points.lock().unwrap_or_else(PoisonError::into_inner);
                self.follow(chain, &mut points, signals, &finished).inspect_err(|_failed| signals.stop())?;
            }
        };
        let threads = thread::available_parallelism().map_or(1, NonZeroUsize::get).min(chains.len());
        let results: Vec<_> = thread::scope(|scope| {
            let workers: Vec<_> = (0..threads).map(|_| scope.spawn(worker)).collect();
            workers.into_iter().map(|worker| worker.join()).collect()
        });
        for result in results {
            result.map_err(|_panic| Failure::Panic("computation"))??;
        }
        let unlock = |mutex: Mutex<Vec<Point>>| mutex.into_inner().unwrap_or_else(PoisonError::into_inner);
        Ok((chains.into_iter().map(unlock).collect(), journal.into_inner().unwrap_or_else(PoisonError::into_inner)))
    }

    /// Goes on with one chain.
    fn follow(
        &self,
        chain: usize,
        points: &mut Vec<Point>,
        signals: &Signals,
        finished: &impl Fn(&Point) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let Chain { arm, excitations } = &self.chains[chain];
        for (index, sine) in excitations.iter().enumerate().skip(points.len()) {
            let start = points.last().map_or(self.start, Point::end);
            let settled = StroboscopicMap::new(arm, *sine)
                .and_then(|map| settle(&map, &start, &self.options, &|| signals.is_stopped()));
            match settled {
                Ok(settled) => {
                    let point = Point::new(chain, index, &settled);
                    finished(&point)?;
                    points.push(point);
                }
                Err(TimeDomainError::Stopped) => break,
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::{Load, Pose, Preset};
    use serde_json::json;

    fn chains() -> Chains {
        let chain = |beta2_deg, hz: [f64; 5]| Chain {
            arm: Arm::new(Preset::Irb1600Fitted.parameters().unwrap(), Pose { beta1_deg: 0.0, beta2_deg }).unwrap(),
            excitations: hz.map(|frequency_hz| Sine { amplitude: Load::torque_nm(60.0, 0.0), frequency_hz }).to_vec(),
        };
        let mut hz = [22.11, 22.12, 22.13, 22.14, 22.15];
        let up = chain(60.0, hz);
        hz.reverse();
        let chains = vec![up, chain(60.0, hz), chain(90.0, [24.2, 24.22, 24.24, 24.26, 24.28])];
        Chains { chains, start: State::default(), options: SettleOptions::default() }
    }

    /// Killed after any number of points, in the middle of a line: the rest comes out the same, bit for bit.
    #[test]
    fn goes_on_as_if_never_stopped() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let configuration = json!({});
        let whole = chains().walk("test", Some((&path, &configuration))).unwrap();
        assert!(whole.is_complete() && whole.points.iter().all(|chain| chain.len() == 5));
        let unkept = chains().walk("test", None).unwrap();
        assert_eq!(unkept.points, whole.points);
        let text = std::fs::read_to_string(&path).unwrap();
        let points = whole.points.clone();
        drop(whole);
        let lines: Vec<&str> = text.split_inclusive('\n').collect();
        assert_eq!(lines.len(), 16);
        for kept in [1, 7, 15, 16] {
            let torn = lines.get(kept).map_or("", |line| &line[..line.len() / 2]);
            std::fs::write(&path, lines[..kept].concat() + torn).unwrap();
            let resumed = chains().walk("test", Some((&path, &configuration))).unwrap();
            assert_eq!(resumed.points, points, "{kept} lines");
            assert_eq!(std::fs::read_to_string(&path).unwrap().lines().count(), 16);
            resumed.finish().unwrap();
            assert!(!path.exists());
        }
    }

    #[test]
    fn stops_when_it_is_told_to() {
        let signals = Signals::default();
        signals.stop();
        let (points, _) = chains().compute(vec![Vec::new(); 3], None, &signals).unwrap();
        assert!(points.iter().all(Vec::is_empty));
    }

    #[test]
    fn refuses_points_that_do_not_follow() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let (mut journal, _) = Journal::open::<Point>(&path, &json!({})).unwrap();
        let map = chains().chains[0].clone();
        let map = StroboscopicMap::new(&map.arm, map.excitations[0]).unwrap();
        let settled = settle(&map, &State::default(), &SettleOptions::default(), &|| false).unwrap();
        journal.append(&Point::new(0, 1, &settled)).unwrap();
        drop(journal);
        let refusal = chains().walk("test", Some((&path, &json!({})))).unwrap_err().to_string();
        insta::assert_snapshot!(refusal.replace(&path.display().to_string(), "FILE"), @"line 2 of FILE is no point that follows: delete the file to begin anew");
    }

    /// What can't be computed ends everything, with the reason: before anything is computed if that can be told.
    #[test]
    fn says_what_can_not_be_computed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let mut bad = chains();
        bad.chains[1].excitations[4].frequency_hz = -1.0;
        insta::assert_snapshot!(bad.walk("test", Some((&path, &json!({})))).unwrap_err(), @"excitation frequency -1 Hz: it must be a positive number");
        assert!(!path.exists());
        let mut beyond = chains();
        beyond.chains[1].excitations[1].amplitude = Load::torque_nm(1e12, 0.0);
        insta::assert_snapshot!(beyond.walk("test", None).unwrap_err(), @"excited at 22.14 Hz: the motion grows beyond all bounds, 1.08e-3 s after phase 0; try less excitation");
    }
}
