//! The run simulated again from its recorded loads, and the verdict.

use super::{ReplayError, repetition};
use crate::study::on_all_cores;
use resonarm_bench::plant::{Plant, PlantSpec};
use resonarm_bench::rig::Amplifier;
use resonarm_bench::structure::States;
use resonarm_dynamics::arm::Load;
use resonarm_files::import::IMPORTED_FROM;
use resonarm_files::recording::{Integrity, Recording, StateRecord};
use resonarm_files::scenario::Scenario;
use resonarm_files::starting_plant::is_recorded;

/// Whether a run, simulated again, is the recorded one.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Verdict {
    /// Whether every state, and the current of a shaker's coil, is the recorded one, bit for bit. Never of a damaged
    /// recording: there are states that can't be compared. Of one that was cut short it says so of the states that are
    /// there.
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

/// Samples that are in memory at a time: some MB.
const BLOCK: usize = 1 << 14;
/// Samples that a core takes at a time: some milliseconds of work.
const PART: usize = 1 << 11;

/// Starts from the first recorded state, applies the recorded loads, and compares every state on the way.
///
/// State and current at a sample follow from state, current and load at the one before alone. So as long as none
/// differs, all cores simulate parts of the run, each from a recorded state, with the result of one after the other.
/// An FMU is simulated again from its start alone, and once more where it differs.
///
/// # Errors
/// [`ReplayError`] if the recording can't be read, was imported from a log, has gaps or no states, its scenario makes
/// no plant or not the one that was recorded: other samples, loads beyond its exciter; if it begins in the middle of a
/// run without the current of its shaker's coil.
pub fn resimulate(recording: &Recording) -> Result<Verdict, ReplayError> {
    let scenario = Scenario::from_configuration(recording.configuration());
    if let Some(log) = recording.configuration().get(IMPORTED_FROM) {
        return Err(ReplayError::Imported { log: log.to_owned(), has_scenario: scenario.is_ok() });
    }
    let scenario = scenario?;
    if scenario.is_fmu() {
        return repetition::repeat(recording, &scenario);
    }
    let spec = scenario.plant_spec()?;
    check(recording, spec.sample_rate_hz)?;
    let mut states = recording.states()?;
    let first = states.next().ok_or(ReplayError::Empty { what: "states" })??;
    let integrity = recording.integrity().clone();
    let identical = !matches!(integrity, Integrity::Damaged { .. });
    let mut verdict =
        Verdict { identical, integrity, samples: 1, steps: 0, first_divergence: None, max_drift_rad: 0.0 };
    let fresh = Plant::new(&spec)?;
    let mut plant = plant(&fresh, &spec, &first)?;
    load(&first, &plant)?;
    let mut block = vec![first];
    loop {
        for record in states.by_ref().take(BLOCK) {
            block.push(record?);
        }
        let [.., last] = block[..] else { return Ok(verdict) };
        if block.len() == 1 {
            return Ok(verdict);
        }
        if verdict.first_divergence.is_none() && agrees(&fresh, &spec, &block) {
            verdict.samples += block.len() as u64 - 1;
            verdict.steps += u64::from(spec.steps_per_sample) * (block.len() as u64 - 1);
            plant = self::plant(&fresh, &spec, &last)?;
        } else {
            follow(&mut verdict, &mut plant, &block, spec.steps_per_sample)?;
        }
        block.clear();
        block.push(last);
    }
}

/// The plant in a recorded state. `fresh` is the plant at its start, which takes longer to make than to copy.
fn plant(fresh: &Plant, spec: &PlantSpec, record: &StateRecord) -> Result<Plant, ReplayError> {
    let states = match (spec.rig.shaker, record.states.internal()) {
        // At sample 0 the coil has none, and an amplifier in current mode sets it with the load.
        (Some(shaker), []) if record.sample == 0 || shaker.amplifier == Amplifier::Current => {
            States::of_arm(&record.states.arm(), Some(0.0))
        }
        (Some(_), []) => return Err(ReplayError::NoCurrent { sample: record.sample }),
        _ => record.states,
    };
    Ok(fresh.clone().at(record.sample, &states)?)
}

/// Whether every state of the block follows from the one before, tried on all cores. If not, or if it can't be tried,
/// one after the other tells why.
fn agrees(fresh: &Plant, spec: &PlantSpec, block: &[StateRecord]) -> bool {
    let starts: Vec<usize> = (0..block.len() - 1).step_by(PART).collect();
    let part = |start: &usize| {
        let records = &block[*start..block.len().min(start + PART + 1)];
        let mut plant = plant(fresh, spec, &records[0]).ok()?;
        let agree = records.windows(2).all(|pair| {
            let advanced = load(&pair[0], &plant).is_ok_and(|load| plant.advance(&load).is_ok());
            advanced && is_recorded(&plant, &pair[1])
        });
        agree.then_some(())
    };
    on_all_cores(&starts, part, || ()).iter().all(Option::is_some)
}

/// Advances the plant by the loads of the block, from the first of its records, and compares.
fn follow(
    verdict: &mut Verdict,
    plant: &mut Plant,
    block: &[StateRecord],
    steps_per_sample: u32,
) -> Result<(), ReplayError> {
    for pair in block.windows(2) {
        plant.advance(&load(&pair[0], plant)?)?;
        verdict.steps += u64::from(steps_per_sample);
        compare(verdict, plant, &pair[1]);
    }
    Ok(())
}

/// Refuses a scenario with other samples than the recorded ones.
pub(super) fn check(recording: &Recording, sample_rate_hz: f64) -> Result<(), ReplayError> {
    let (recorded_s, configured_s) = (recording.origin().dt_s, 1.0 / sample_rate_hz);
    if recorded_s.to_bits() != configured_s.to_bits() {
        return Err(ReplayError::SamplePeriod { recorded_s, configured_s });
    }
    Ok(())
}

pub(super) fn compare(verdict: &mut Verdict, plant: &Plant, record: &StateRecord) {
    verdict.samples += 1;
    if !is_recorded(plant, record) {
        verdict.identical = false;
        verdict.first_divergence.get_or_insert(record.sample);
        let (states, recorded) = (plant.states(), record.states.coordinates());
        let drifts = states.coordinates().iter().zip(recorded).map(|(one, other)| (one - other).abs());
        verdict.max_drift_rad = drifts.fold(verdict.max_drift_rad, f64::max);
    }
}

/// The recorded load, if the plant's exciter can have produced it.
pub(super) fn load(record: &StateRecord, plant: &Plant) -> Result<Load, ReplayError> {
    let load = record.load();
    let exciter = plant.exciter();
    if exciter.can_produce(&load) {
        return Ok(load);
    }
    let (limit_n, limit_nm) = exciter.limits();
    let (sample, force_n, torque_nm) = (record.sample, record.force_n, record.torque_nm);
    Err(ReplayError::Load { sample, force_n, torque_nm, limit_n, limit_nm })
}
