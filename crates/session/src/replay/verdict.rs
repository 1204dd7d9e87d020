//! Compares a re-simulated plant with a record.

use super::error::ReplayError;
use resonarm_bench::plant::Plant;
use resonarm_bench::rig::Load;
use resonarm_files::recording::{Integrity, Recording, StateRecord};
use resonarm_files::starting_plant::is_recorded;

/// Whether a re-simulated run is the recorded one.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Verdict {
    /// Whether every state, and the current of a shaker's coil, is bit-identical to the recorded one. Always false for
    /// a damaged recording, which has states that can't be compared. For a recording that was cut short it covers the
    /// states that are there.
    pub identical: bool,
    /// Whether the recording is whole.
    pub integrity: Integrity,
    /// States compared, one a sample.
    pub samples: u64,
    /// Number of integration steps made.
    pub steps: u64,
    /// The first sample whose state differs.
    pub first_divergence: Option<u64>,
    /// The largest difference of a vibration angle, rad.
    pub max_drift_rad: f64,
}

impl Verdict {
    /// Begins the comparison with a recording, with no state compared yet.
    pub(super) fn begin(recording: &Recording) -> Verdict {
        let integrity = recording.integrity().clone();
        let identical = !matches!(integrity, Integrity::Damaged { .. });
        Verdict { identical, integrity, samples: 0, steps: 0, first_divergence: None, max_drift_rad: 0.0 }
    }
}

/// Rejects a scenario whose sample period differs from the recorded one.
pub(super) fn check(recording: &Recording, sample_rate_hz: f64) -> Result<(), ReplayError> {
    let recorded_s = recording.origin().dt_s;
    let configured_s = 1.0 / sample_rate_hz;
    // By bits, since both are 1/rate of the same rate. Another period would shift every sample.
    if recorded_s.to_bits() != configured_s.to_bits() {
        return Err(ReplayError::SamplePeriod { recorded_s, configured_s });
    }
    Ok(())
}

/// Compares the states with the recorded ones.
pub(super) fn compare(verdict: &mut Verdict, plant: &Plant, record: &StateRecord) {
    verdict.samples += 1;
    if !is_recorded(plant, record) {
        verdict.identical = false;
        verdict.first_divergence.get_or_insert(record.sample);
        let states = plant.states();
        let recorded = record.states.coordinates();
        let drifts = states.coordinates().iter().zip(recorded).map(|(one, other)| (one - other).abs());
        verdict.max_drift_rad = drifts.fold(verdict.max_drift_rad, f64::max);
    }
}

/// Returns the recorded load, if the plant's exciter can have produced it.
pub(super) fn load(record: &StateRecord, plant: &Plant) -> Result<Load, ReplayError> {
    let load = record.load;
    let exciter = plant.exciter();
    if exciter.can_produce(&load) {
        return Ok(load);
    }
    let (limit_n, limit_nm) = exciter.limits();
    Err(ReplayError::Load { sample: record.sample, load, limit_n, limit_nm })
}
