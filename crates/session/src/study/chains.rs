//! Chains of motions, each point begun where the one before ended; several chains at a time, which can be resumed.

use std::path::Path;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Control, Journal, StudyError, on_all_cores};
use resonarm_analysis::Readings;
use resonarm_analysis::time_domain::{SettleOptions, Settled, StroboscopicMap, TimeDomainError, readings, settle};
use resonarm_dynamics::arm::{Arm, Sine, State};

/// One arm under one excitation after the other.
#[derive(Clone, Debug)]
pub struct Chain {
    /// The arm.
    pub arm: Arm,
    /// The excitations in their order.
    pub excitations: Vec<Sine>,
}

/// Chains that begin in the same state.
#[derive(Clone, Debug)]
pub struct Chains {
    /// The chains.
    pub chains: Vec<Chain>,
    /// The state, at phase 0, in which the first motion of each begins.
    pub start: State,
    /// How long each motion is waited for, and what is kept of it.
    pub options: SettleOptions,
}

/// The motion at one point of a chain, α1, α2, α̇1, α̇2 being a state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Point {
    /// Which chain, from 0.
    pub chain: usize,
    /// Which excitation of the chain, from 0.
    pub index: usize,
    /// As [`Settled::amplitude_rad`].
    pub amplitude_rad: [f64; 2],
    /// As [`Settled::harmonic1_rad`].
    pub harmonic1_rad: [f64; 2],
    /// As [`Settled::period`].
    pub period: Option<u32>,
    /// As [`Settled::largest_multiplier`].
    pub largest_multiplier: Option<f64>,
    /// As [`Settled::settling_periods`].
    pub settling_periods: u64,
    /// As [`Settled::drift`].
    pub drift: f64,
    /// As [`Settled::section`].
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

/// Motions in chains, each begun where the one before ended.
pub trait ChainStudy: Sync + Sized {
    /// The motion at one point of a chain.
    type Point: Clone + Serialize + DeserializeOwned + Send + Sync;

    /// How many points each chain has.
    fn lengths(&self) -> Vec<usize>;

    /// Refuses excitations under which nothing can be computed.
    ///
    /// # Errors
    /// [`TimeDomainError`] for the first of them.
    fn check(&self) -> Result<(), TimeDomainError>;

    /// The chain of a point, and its number in it, from 0.
    fn place(point: &Self::Point) -> [usize; 2];

    /// The point at a place, after the one before it.
    ///
    /// # Errors
    /// [`TimeDomainError::Stopped`] if `stop` said so, another if the motion can't be computed.
    fn point(
        &self,
        place: [usize; 2],
        before: Option<&Self::Point>,
        stop: &dyn Fn() -> bool,
    ) -> Result<Self::Point, TimeDomainError>;

    /// The computation, with the points that are in the journal for this configuration.
    ///
    /// # Errors
    /// [`StudyError::TimeDomain`] for an excitation under which nothing can be computed, [`StudyError::Journal`] for a
    /// journal that can't be used.
    fn begin(self, journal: Option<(&Path, &Value)>) -> Result<ChainComputation<Self>, StudyError> {
        self.check()?;
        let lengths = self.lengths();
        let (points, journal) = match journal {
            Some((path, configuration)) => {
                let (journal, points) = Journal::open(path, configuration)?;
                (sorted::<Self>(&lengths, points, &journal)?, Some(journal))
            }
            None => (lengths.iter().map(|_| Vec::new()).collect(), None),
        };
        Ok(ChainComputation { chains: self, lengths, points, journal })
    }
}

/// The points of a journal by chain; those of one chain follow each other in it.
fn sorted<S: ChainStudy>(
    lengths: &[usize],
    points: Vec<S::Point>,
    journal: &Journal,
) -> Result<Vec<Vec<S::Point>>, StudyError> {
    let mut chains: Vec<Vec<S::Point>> = lengths.iter().map(|_| Vec::new()).collect();
    for (k, point) in points.into_iter().enumerate() {
        let [chain, index] = S::place(&point);
        let place = chains.get_mut(chain).filter(|before| before.len() == index && index < lengths[chain]);
        place.ok_or_else(|| journal.damaged(k + 2, "point that follows"))?.push(point);
    }
    Ok(chains)
}

impl ChainStudy for Chains {
    type Point = Point;

    fn lengths(&self) -> Vec<usize> {
        self.chains.iter().map(|chain| chain.excitations.len()).collect()
    }

    fn check(&self) -> Result<(), TimeDomainError> {
        let mut all = self.chains.iter().flat_map(|chain| chain.excitations.iter().map(move |sine| (&chain.arm, sine)));
        all.try_for_each(|(arm, sine)| StroboscopicMap::new(arm, *sine).map(drop))
    }

    fn place(point: &Point) -> [usize; 2] {
        [point.chain, point.index]
    }

    fn point(
        &self,
        [chain, index]: [usize; 2],
        before: Option<&Point>,
        stop: &dyn Fn() -> bool,
    ) -> Result<Point, TimeDomainError> {
        let Chain { arm, excitations } = &self.chains[chain];
        let map = StroboscopicMap::new(arm, excitations[index])?;
        let settled = settle(&map, &before.map_or(self.start, Point::end), &self.options, stop)?;
        Ok(Point::new(chain, index, &settled))
    }
}

/// Chains as far as they are computed, and where their points are kept.
#[derive(Debug)]
pub struct ChainComputation<S: ChainStudy = Chains> {
    chains: S,
    lengths: Vec<usize>,
    points: Vec<Vec<S::Point>>,
    journal: Option<Journal>,
}

impl ChainComputation {
    /// What a bench reads at each point of each chain: over the motion's period, or over 64 periods of the excitation
    /// where it has none.
    ///
    /// # Errors
    /// [`StudyError::TimeDomain`] if a step can't be made.
    pub fn readings(&self) -> Result<Vec<Vec<Readings>>, StudyError> {
        let at = |chain: &Chain, sine: &Sine, point: &Point| {
            StroboscopicMap::new(&chain.arm, *sine).and_then(|map| readings(&map, &point.end(), point.period))
        };
        let of = |(chain, points): (&Chain, &Vec<Point>)| {
            chain.excitations.iter().zip(points).map(|(sine, point)| at(chain, sine, point)).collect()
        };
        let all: Result<_, TimeDomainError> = self.chains.chains.iter().zip(&self.points).map(of).collect();
        Ok(all?)
    }
}

impl<S: ChainStudy> ChainComputation<S> {
    /// The points of each chain.
    pub fn points(&self) -> &[Vec<S::Point>] {
        &self.points
    }

    /// How many points there are.
    pub fn done(&self) -> usize {
        self.points.iter().map(Vec::len).sum()
    }

    /// How many there are to be.
    pub fn total(&self) -> usize {
        self.lengths.iter().sum()
    }

    /// Whether every point is there.
    pub fn is_complete(&self) -> bool {
        self.done() == self.total()
    }

    /// Whether points are kept in a journal.
    pub fn is_kept(&self) -> bool {
        self.journal.is_some()
    }

    /// Computes the points that are missing, on as many threads as there are cores, until it is stopped.
    ///
    /// A chain is the same however often it was stopped, for each point begins with the exact state in which the one
    /// before ended.
    ///
    /// # Errors
    /// [`StudyError::TimeDomain`] if a motion can't be computed, [`StudyError::Journal`] if the journal can't be
    /// written.
    pub fn compute_missing(self, control: &Control<'_>) -> Result<ChainComputation<S>, StudyError> {
        let done = AtomicU64::new(self.done() as u64);
        // The first chain that has failed, if one has. Those before it continue, so that the same error is reported
        // every time.
        let (failed, journal) = (AtomicUsize::new(usize::MAX), Mutex::new(self.journal));
        let finished = |point: &S::Point| {
            if let Some(journal) = journal.lock().unwrap_or_else(PoisonError::into_inner).as_mut() {
                journal.append(point)?;
            }
            (control.done)(done.fetch_add(1, Ordering::Relaxed) + 1);
            Ok(())
        };
        let jobs: Vec<(usize, Vec<S::Point>)> = self.points.into_iter().enumerate().collect();
        let work = |(chain, known): &(usize, Vec<S::Point>)| {
            let stop = || (control.stop)() || failed.load(Ordering::Relaxed) < *chain;
            let points = follow(&self.chains, *chain, self.lengths[*chain], known.clone(), &stop, &finished);
            points.inspect_err(|_error| _ = failed.fetch_min(*chain, Ordering::Relaxed))
        };
        let points = on_all_cores(&jobs, work, || ()).into_iter().collect::<Result<_, _>>()?;
        let journal = journal.into_inner().unwrap_or_else(PoisonError::into_inner);
        Ok(ChainComputation { chains: self.chains, lengths: self.lengths, points, journal })
    }

    /// To be called when the results are written: there is nothing left to resume.
    ///
    /// # Errors
    /// [`StudyError::Journal`] if the journal can't be removed.
    pub fn finish(self) -> Result<(), StudyError> {
        Ok(self.journal.map_or(Ok(()), Journal::remove)?)
    }
}

/// Continues one chain after the known points, to its end or until `stop`.
fn follow<S: ChainStudy>(
    study: &S,
    chain: usize,
    length: usize,
    mut points: Vec<S::Point>,
    stop: &dyn Fn() -> bool,
    finished: &impl Fn(&S::Point) -> Result<(), StudyError>,
) -> Result<Vec<S::Point>, StudyError> {
    for index in points.len()..length {
        match study.point([chain, index], points.last(), stop) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use resonarm_dynamics::arm::{Load, Pose, Preset};
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

    fn computed(chains: Chains, journal: Option<(&Path, &Value)>) -> Result<ChainComputation, StudyError> {
        chains.begin(journal)?.compute_missing(&Control { stop: &|| false, done: &|_done| () })
    }

    /// Killed after any number of points, in the middle of a line: the rest comes out the same, bit for bit.
    #[test]
    fn continues_as_if_never_stopped() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let configuration = json!({});
        let whole = computed(chains(), Some((&path, &configuration))).unwrap();
        assert!(whole.is_complete() && whole.points.iter().all(|chain| chain.len() == 5));
        let unkept = computed(chains(), None).unwrap();
        assert_eq!(unkept.points, whole.points);
        let text = std::fs::read_to_string(&path).unwrap();
        let points = whole.points.clone();
        drop(whole);
        let lines: Vec<&str> = text.split_inclusive('\n').collect();
        assert_eq!(lines.len(), 16);
        for kept in [1, 7, 15, 16] {
            let torn = lines.get(kept).map_or("", |line| &line[..line.len() / 2]);
            std::fs::write(&path, lines[..kept].concat() + torn).unwrap();
            let resumed = computed(chains(), Some((&path, &configuration))).unwrap();
            assert_eq!(resumed.points, points, "{kept} lines");
            assert_eq!(std::fs::read_to_string(&path).unwrap().lines().count(), 16);
            resumed.finish().unwrap();
            assert!(!path.exists());
        }
    }

    #[test]
    fn stops_when_asked_to() {
        let stopped = Control { stop: &|| true, done: &|_done| () };
        assert_eq!(chains().begin(None).unwrap().compute_missing(&stopped).unwrap().done(), 0);
    }

    /// Whichever fails first, the error is that of the first chain.
    #[test]
    fn the_same_error_is_reported_every_time() {
        let mut chains = chains();
        chains.chains.truncate(2);
        let too_much = |frequency_hz| Sine { amplitude: Load::torque_nm(1e9, 0.0), frequency_hz };
        chains.chains[0].excitations[1] = too_much(21.0);
        chains.chains[1].excitations[0] = too_much(23.0);
        let error = computed(chains, None).unwrap_err().to_string();
        assert!(error.starts_with("excited at 21 Hz: "), "{error}");
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
        let refusal = computed(chains(), Some((&path, &json!({})))).unwrap_err().to_string();
        insta::assert_snapshot!(refusal.replace(&path.display().to_string(), "FILE"), @"line 2 of FILE is no point that follows: delete the file to begin anew");
    }

    /// A point that can't be computed ends everything, with the reason: before any is computed if it is known then.
    #[test]
    fn says_what_can_not_be_computed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let mut bad = chains();
        bad.chains[1].excitations[4].frequency_hz = -1.0;
        insta::assert_snapshot!(computed(bad, Some((&path, &json!({})))).unwrap_err(), @"excitation frequency -1 Hz: it must be a positive number");
        assert!(!path.exists());
        let mut beyond = chains();
        beyond.chains[1].excitations[1].amplitude = Load::torque_nm(1e12, 0.0);
        insta::assert_snapshot!(computed(beyond, None).unwrap_err(), @"excited at 22.14 Hz: the motion grows beyond all bounds, 1.08e-3 s after phase 0; try less excitation");
    }
}
