//! Re-simulates the run of an FMU from its start.

use super::error::ReplayError;
use super::verdict::{Verdict, check, compare, load};
use resonarm_bench::plant::Plant;
use resonarm_bench::structure::States;
use resonarm_files::recording::Recording;
use resonarm_scenario::Scenario;

/// Loads the FMU, applies the recorded loads from its start on, and compares every state. Where one differs, the FMU is
/// loaded once more: if it then differs from itself, it is not deterministic, and its result says nothing about the
/// recording.
///
/// # Errors
/// As [`resimulate`](super::resimulate); [`ReplayError::FmuFromStart`], [`ReplayError::FmuWithoutStates`] and
/// [`ReplayError::FmuNotRepeating`].
pub(super) fn repeat(recording: &Recording, scenario: &Scenario) -> Result<Verdict, ReplayError> {
    check(recording, scenario.simulation.rate_hz)?;
    let mut plant = scenario.plant()?;
    if plant.states().is_empty() {
        return Err(ReplayError::FmuWithoutStates);
    }
    let mut verdict = Verdict::begin(recording);
    let mut differing = None;
    let mut applied = None;
    for record in recording.states()? {
        let record = record?;
        // The load of a record is held from its sample on, so each step takes the load of the record before.
        if let Some(load) = applied.replace(load(&record, &plant)?) {
            plant.advance(&load)?;
            verdict.steps += u64::from(scenario.simulation.steps_per_sample());
        }
        if record.sample != plant.sample() {
            return Err(ReplayError::FmuFromStart { sample: record.sample });
        }
        compare(&mut verdict, &plant, &record);
        if verdict.first_divergence == Some(record.sample) && differing.is_none() {
            differing = Some(*plant.states());
        }
    }
    match (verdict.first_divergence, differing) {
        _ if verdict.samples == 0 => Err(ReplayError::Empty { what: "states" }),
        (Some(sample), Some(states)) if !repeats(recording, scenario.plant()?, sample, &states)? => {
            Err(ReplayError::FmuNotRepeating { sample })
        }
        _ => Ok(verdict),
    }
}

/// Says whether a plant at its start reaches these states at a sample, too.
fn repeats(recording: &Recording, mut plant: Plant, sample: u64, states: &States) -> Result<bool, ReplayError> {
    for record in recording.states()? {
        let record = record?;
        if record.sample == sample {
            break;
        }
        plant.advance(&load(&record, &plant)?)?;
    }
    let own = plant.states();
    Ok(own.iter().map(|state| state.to_bits()).eq(states.iter().map(|state| state.to_bits())))
}
