//! Compares the readings of a re-simulated run with the recorded ones.

use super::ReplayError;
use super::verdict::load;
use resonarm_bench::rig::{Measurement, Reading};
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
    let SampleRecord { acceleration_b_m_s2, acceleration_c_m_s2, head_force_n, clipped, .. } = recorded;
    let pairs = [
        (measured.acceleration_b_m_s2, acceleration_b_m_s2, clipped.acceleration_b),
        (measured.acceleration_c_m_s2, acceleration_c_m_s2, clipped.acceleration_c),
        (measured.head_force_n, head_force_n, clipped.head_force),
    ];
    let same = |reading: Reading, value: f64, clipped| {
        reading.value.to_bits() == value.to_bits() && reading.clipped == clipped
    };
    let (more, recorded_more) = (measured.more.values(), recorded.more.values());
    let same_bits = |(one, other): (&f64, &f64)| one.to_bits() == other.to_bits();
    pairs.iter().all(|(reading, value, clipped)| (0..2).all(|axis| same(reading[axis], value[axis], clipped[axis])))
        && more.len() == recorded_more.len()
        && more.iter().zip(recorded_more).all(same_bits)
        && measured.more.clipped() == recorded.more.clipped()
}
