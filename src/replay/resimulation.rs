//! The run simulated again from its recorded loads, and the verdict.

use super::ReplayError;
use crate::arm::{Load, State};
use crate::import::IMPORTED_FROM;
use crate::plant::{Plant, PlantSpec};
use crate::recording::{Integrity, Recording, StateRecord};
use crate::scenario::Scenario;

/// Whether a run, simulated again, is the recorded one.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Verdict {
    /// Whether every state is the recorded one, bit for bit. Never of a damaged recording: there are states that can't
    /// be compared. Of one that was cut short it says so of the states that are there.
    pub identical: bool,
    /// Whether the recording is whole.
    pub integrity: Integrity,
    /// States compared, one a sample.
    pub samples: u64,
    /// Integration steps made.
    pub steps: u64,
    /// The first sample whose state differs.
    pub first_divergence: Option<u64>,
    /// The largest difference of a vibration angle, rad.
    pub max_drift_rad: f64,
}

/// Starts from the first recorded state, applies the recorded loads, and compares every state on the way.
///
/// # Errors
/// [`ReplayError`] if the recording can't be read, was imported from a log, has gaps or no states, its scenario makes no plant or not the one
/// that was recorded: other samples, loads beyond its exciter.
pub fn resimulate(recording: &Recording) -> Result<Verdict, ReplayError> {
    let scenario = Scenario::from_configuration(recording.configuration());
    if let Some(log) = recording.configuration().get(IMPORTED_FROM) {
        return Err(ReplayError::Imported { log: log.to_owned(), has_scenario: scenario.is_ok() });
    }
    let mut spec = scenario?.plant_spec()?;
    check(recording, &spec)?;
    let mut states = recording.states()?;
    let first = states.next().ok_or(ReplayError::Empty { what: "states" })??;
    spec.initial = state(&first);
    let mut plant = Plant::new(&spec)?;
    let integrity = recording.integrity().clone();
    let identical = !matches!(integrity, Integrity::Damaged { .. });
    let mut verdict =
        Verdict { identical, integrity, samples: 1, steps: 0, first_divergence: None, max_drift_rad: 0.0 };
    let mut load = load(&first, &plant)?;
    for record in states {
        let record = record?;
        plant.advance(&load)?;
        verdict.steps += u64::from(spec.steps_per_sample);
        compare(&mut verdict, plant.state(), &record);
        load = self::load(&record, &plant)?;
    }
    Ok(verdict)
}

/// Refuses a scenario with other samples than the recorded ones.
fn check(recording: &Recording, spec: &PlantSpec) -> Result<(), ReplayError> {
    let (recorded_s, configured_s) = (recording.origin().dt_s, 1.0 / spec.sample_rate_hz);
    if recorded_s.to_bits() != configured_s.to_bits() {
        return Err(ReplayError::SamplePeriod { recorded_s, configured_s });
    }
    Ok(())
}

fn compare(verdict: &mut Verdict, simulated: &State, record: &StateRecord) {
    let recorded = state(record);
    verdict.samples += 1;
    let bits = |state: &State| {
        let (x, v) = (state.alpha_rad, state.alpha_dot_rad_s);
        [x.x, x.y, v.x, v.y].map(f64::to_bits)
    };
    if bits(simulated) != bits(&recorded) {
        verdict.identical = false;
        verdict.first_divergence.get_or_insert(record.sample);
        let drift_rad = (simulated.alpha_rad - recorded.alpha_rad).amax();
        verdict.max_drift_rad = verdict.max_drift_rad.max(drift_rad);
    }
}

fn state(record: &StateRecord) -> State {
    State::new(record.alpha_rad, record.alpha_dot_rad_s)
}

/// The recorded load, if the plant's exciter can have produced it.
fn load(record: &StateRecord, plant: &Plant) -> Result<Load, ReplayError> {
    let load = Load { torque_nm: record.torque_nm.into(), force_n: record.force_n.into() };
    let exciter = plant.exciter();
    if exciter.can_produce(&load) {
        return Ok(load);
    }
    let (limit_n, limit_nm) = exciter.limits();
    let (sample, force_n, torque_nm) = (record.sample, record.force_n, record.torque_nm);
    Err(ReplayError::Load { sample, force_n, torque_nm, limit_n, limit_nm })
}
