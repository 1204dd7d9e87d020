//! Chains of motions and basins of attraction of a structure.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::{BasinStudy, ChainStudy, StateGrid};
use resonarm_analysis::structure::time_domain::{Settled, StableMotion, StroboscopicMap, Sweep, outcomes, settle};
use resonarm_analysis::structure::{Forced, Reading};
use resonarm_analysis::time_domain::{BasinOutcome, SettleOptions, TimeDomainError};
use resonarm_dynamics::structure::Dof;

/// Stepped sweeps of a structure, or of structures that differ in a parameter, that begin in the same state.
#[derive(Clone, Debug)]
pub struct StructureChains {
    /// The sweeps: each is one chain.
    pub sweeps: Vec<Sweep>,
    /// Where motions are read.
    pub read: Vec<Dof>,
    /// The state, at phase 0, in which the first motion of each begins: coordinates, rates, states of elements.
    pub start: Vec<f64>,
    /// How long each motion is waited for, and how much is kept of its section.
    pub options: SettleOptions,
}

/// The motion at one point of a chain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StructurePoint {
    chain: usize,
    index: usize,
    /// As [`Settled::period`].
    pub period: Option<u32>,
    /// As [`Settled::largest_multiplier`].
    pub largest_multiplier: Option<f64>,
    /// As [`Settled::settling_periods`].
    pub settling_periods: u64,
    /// As [`Settled::drift`].
    pub drift: f64,
    coordinates: Vec<[f64; 4]>,
    readings: Vec<[f64; 4]>,
    /// As [`Settled::section`].
    pub section: Vec<Vec<f64>>,
    end: Vec<f64>,
}

impl StructurePoint {
    /// As [`Settled::coordinates`].
    pub fn coordinates(&self) -> Vec<Reading> {
        self.coordinates.iter().copied().map(Reading::from_numbers).collect()
    }

    /// As [`Settled::readings`].
    pub fn readings(&self) -> Vec<Reading> {
        self.readings.iter().copied().map(Reading::from_numbers).collect()
    }
}

impl ChainStudy for StructureChains {
    type Point = StructurePoint;

    fn lengths(&self) -> Vec<usize> {
        self.sweeps.iter().map(|sweep| sweep.values.len()).collect()
    }

    fn check(&self) -> Result<(), TimeDomainError> {
        self.sweeps.iter().try_for_each(Sweep::check)
    }

    fn place(point: &StructurePoint) -> [usize; 2] {
        [point.chain, point.index]
    }

    fn point(
        &self,
        [chain, index]: [usize; 2],
        before: Option<&StructurePoint>,
        stop: &dyn Fn() -> bool,
    ) -> Result<StructurePoint, TimeDomainError> {
        let sweep = &self.sweeps[chain];
        let map = sweep.map(sweep.values[index])?;
        let start = before.map_or(&self.start, |before| &before.end);
        let settled = settle(&map, &self.read, start, &self.options, stop)?;
        let Settled { period, largest_multiplier, settling_periods, drift, coordinates, readings, section, end } =
            settled;
        let [coordinates, readings] = [coordinates, readings].map(|all| all.iter().map(Reading::numbers).collect());
        Ok(StructurePoint {
            chain,
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
}

/// Basins of a structure to be computed.
#[derive(Clone, Debug)]
pub struct StructureBasins {
    /// The structure and its drive.
    pub forced: Forced,
    /// The frequency of the drive, Hz.
    pub frequency_hz: f64,
    /// The motions that the states may reach.
    pub motions: Vec<StableMotion>,
    /// The initial states, at phase 0 of the drive.
    pub grid: StateGrid<usize, Vec<f64>>,
    /// Longest wait, in time constants of the slowest mode.
    pub time_constants: f64,
}

impl BasinStudy for StructureBasins {
    fn states(&self) -> usize {
        self.grid.len()
    }

    fn check(&self) -> Result<(), TimeDomainError> {
        StroboscopicMap::new(&self.forced, self.frequency_hz).map(drop)
    }

    fn outcomes(&self, states: Range<usize>, stop: &dyn Fn() -> bool) -> Result<Vec<BasinOutcome>, TimeDomainError> {
        let map = StroboscopicMap::new(&self.forced, self.frequency_hz)?;
        let starts: Vec<Vec<f64>> = states.map(|index| self.grid.state(index)).collect();
        outcomes(&map, &self.motions, &starts, self.time_constants, stop)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Control;
    use super::*;
    use resonarm_analysis::structure::time_domain::{reach, stable_motions};
    use resonarm_analysis::structure::{Coordinate, TraceOptions, trace};
    use resonarm_dynamics::structure::{
        Assembly, Axis, BodySpec, ElementSpec, Law, ModalSpec, ModeSpec, Place, ShapeSpec, StructureSpec,
    };

    const QUIET: Control<'static> = Control { stop: &|| false, done: &|_done| () };

    /// An oscillator that hardens so that its resonance folds over.
    fn hardening() -> (Forced, Dof) {
        let tip = Place::Dof { point: "tip".into(), axis: Axis::X };
        let body = ModalSpec {
            modes: vec![ModeSpec { frequency_hz: 10.0, damping_ratio: 0.02 }],
            shapes: vec![ShapeSpec { point: "tip".into(), axis: Axis::X, by_mode: vec![1.0] }],
        };
        let law = Law::Cubic { stiffness3: 4e6, stiffness5: 0.0 };
        let elements = vec![ElementSpec { at: tip, to: None, law }];
        let assembly = Assembly::new(&StructureSpec { body: BodySpec::Modal(body), elements }).unwrap();
        let dof = assembly.dof("tip.x").unwrap();
        (Forced::new(assembly, dof, 2.0), dof)
    }

    /// The frequencies of its folds, Hz.
    fn folds_hz(forced: &Forced, dof: Dof) -> Vec<f64> {
        let options = TraceOptions::new(forced, Coordinate::FrequencyHz, [8.0, 20.0], vec![dof]);
        let branch = trace(forced, 8.0, Coordinate::FrequencyHz, &options).unwrap();
        branch.bifurcations.iter().map(|found| found.orbit.frequency_hz).collect()
    }

    fn chains() -> StructureChains {
        let (forced, dof) = hardening();
        let folds = folds_hz(&forced, dof);
        // From below both folds to above both.
        let up: Vec<f64> = (0..7).map(|k| folds[1] + (folds[0] - folds[1]) * (f64::from(k) - 1.5) / 4.0).collect();
        let down = up.iter().rev().copied().collect();
        let over = Coordinate::FrequencyHz;
        let sweeps = [up, down].map(|values| Sweep { forced: forced.clone(), frequency_hz: 0.0, over, values });
        let (sweeps, options) = (sweeps.into(), SettleOptions::default());
        StructureChains { sweeps, read: vec![dof], start: vec![0.0; 2], options }
    }

    /// Resumed after any number of points it comes out the same, bit for bit; up and down differ between the folds.
    #[test]
    fn a_sweep_continues_as_if_never_stopped() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let configuration = serde_json::json!({});
        let kept = chains().begin(Some((&path, &configuration))).unwrap().compute_missing(&QUIET).unwrap();
        let points = kept.points().to_vec();
        drop(kept);
        let text = std::fs::read_to_string(&path).unwrap();
        let lines: Vec<&str> = text.split_inclusive('\n').collect();
        for kept in [2, 9, 15] {
            std::fs::write(&path, lines[..kept].concat()).unwrap();
            let resumed = chains().begin(Some((&path, &configuration))).unwrap();
            assert_eq!(resumed.done(), kept - 1);
            assert_eq!(resumed.compute_missing(&QUIET).unwrap().points(), points);
        }
        let size = |point: &StructurePoint| point.readings()[0].largest;
        let differ = |index: usize| (size(&points[0][index]) / size(&points[1][6 - index]) - 1.0).abs() > 1e-6;
        let differing: Vec<usize> = (0..7).filter(|index| differ(*index)).collect();
        assert!(
            !differing.is_empty() && differing.len() < 7 && differing.windows(2).all(|pair| pair[1] == pair[0] + 1)
        );
        let settled = |point: &StructurePoint| {
            point.period == Some(1) && point.drift < 1e-9 && point.section[..] == *std::slice::from_ref(&point.end)
        };
        assert!(points.iter().flatten().all(settled));
    }

    /// The fates on all cores are those of one state after the other.
    #[test]
    fn basins_do_not_depend_on_the_threads() {
        let (forced, dof) = hardening();
        let folds = folds_hz(&forced, dof);
        let frequency_hz = 0.5 * (folds[0] + folds[1]);
        let (motions, early) = stable_motions(&forced, &[dof], frequency_hz, &|| false).unwrap();
        assert!(motions.len() == 2 && early.is_none(), "{motions:?}");
        let ends = [0, 1].map(|index| reach(&motions, index, frequency_hz)).map(|far| [-far, far]);
        let grid = StateGrid { coordinates: [0, 1], ends, counts: [13, 11], others: vec![0.0; 2] };
        let basins = StructureBasins { forced, frequency_hz, motions, grid, time_constants: 40.0 };
        let alone: Vec<BasinOutcome> =
            (0..143).map(|state| basins.outcomes(state..state + 1, &|| false).unwrap()[0]).collect();
        let computed = basins.begin(None).unwrap().compute_missing(&QUIET).unwrap().outcomes().unwrap();
        assert_eq!(computed, alone);
        let reached = |wanted| {
            computed
                .iter()
                .filter(|fate| matches!(fate, BasinOutcome::Reaches { motion, .. } if *motion == wanted))
                .count()
        };
        assert!(reached(0) > 5 && reached(1) > 5 && reached(0) + reached(1) == 143, "{computed:?}");
    }
}
