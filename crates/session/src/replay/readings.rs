//! Compares the readings of a re-simulated run with the recorded ones.

use super::error::ReplayError;
use super::verdict::load;
use crate::run::sample_record;
use resonarm_bench::rig::Measurement;
use resonarm_files::recording::{Recording, SampleRecord};
use resonarm_files::starting_plant;
use resonarm_scenario::ScenarioError;

/// Whether the readings of a re-simulated run are the recorded ones.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ReadingsVerdict {
    /// Whether every reading, and whether it was clipped, is bit-identical to the recorded one.
    pub identical: bool,
    /// Samples compared, each with all its readings.
    pub samples: u64,
    /// The first sample with a reading that differs.
    pub first_divergence: Option<u64>,
}

/// Re-simulates arm and instruments from the recorded loads, sample by sample, and compares the readings of every
/// sample whose state is recorded, too.
///
/// # Errors
/// [`ReplayError::Empty`] if there is no such sample.
/// [`ReplayError::NoInstruments`] if the recording begins in the middle of a run without the state of its instruments,
/// or its scenario describes no valid plant; else as [`resimulate`](super::resimulate).
pub fn resimulate_readings(recording: &Recording) -> Result<ReadingsVerdict, ReplayError> {
    let sample = recording.summary().samples.map_or(0, |(first, _)| first);
    // Reports the reason for which an FMU can't be loaded.
    let structure = recording.scenario().ok().map(|scenario| scenario.structure);
    structure.map_or(Ok(()), |structure| structure.check_allowed()).map_err(ScenarioError::from)?;
    let mut plant = starting_plant::plant(recording).ok_or(ReplayError::NoInstruments { sample })?;
    let mut readings = recording.samples()?;
    let mut next = readings.next().transpose()?;
    let mut verdict = ReadingsVerdict { identical: true, samples: 0, first_divergence: None };
    for state in recording.states()? {
        let state = state?;
        // Measured at every state, also where no reading was recorded: each reading advances converters and noise.
        let measured = plant.measure();
        if let Some(recorded) = next.filter(|recorded| recorded.sample == state.sample) {
            verdict.samples += 1;
            if !is_recorded(&measured, &recorded) {
                verdict.identical = false;
                verdict.first_divergence.get_or_insert(recorded.sample);
            }
            next = readings.next().transpose()?;
        }
        if !state.is_end {
            plant.advance(&load(&state, &plant)?)?;
        }
    }
    if verdict.samples == 0 { Err(ReplayError::Empty { what: "readings" }) } else { Ok(verdict) }
}

fn is_recorded(measured: &Measurement, recorded: &SampleRecord) -> bool {
    let measured = sample_record(measured);
    let bits = |value: &f64| value.to_bits();
    measured.values().iter().map(bits).eq(recorded.values().iter().map(bits))
        && measured.clipped_bits() == recorded.clipped_bits()
}
