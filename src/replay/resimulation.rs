//! The run simulated again from its recorded loads, and the verdict.

use super::ReplayError;
use crate::arm::{Load, State};
use crate::plant::Plant;
use crate::recording::{Recording, StepRecord};
use crate::scenario::Scenario;

/// Whether a run, simulated again, is the recorded one.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Verdict {
    /// Whether every state is the recorded one, bit for bit.
    pub identical: bool,
    /// States compared.
    pub steps: u64,
    /// The first step whose state differs.
    pub first_divergence: Option<u64>,
    /// The largest difference of a vibration angle, rad.
    pub max_drift_rad: f64,
}

/// Starts from the first recorded state, applies the recorded loads, and compares every state on the way.
///
/// # Errors
/// [`ReplayError`] if the recording can't be read, has gaps or no steps, or its scenario makes no plant.
pub fn resimulate(recording: &Recording) -> Result<Verdict, ReplayError> {
    let mut spec = Scenario::from_configuration(recording.configuration())?.plant_spec()?;
    let mut steps = recording.steps()?;
    let first = steps.next().ok_or(ReplayError::Empty { what: "steps" })??;
    spec.initial = state(&first);
    let mut plant = Plant::new(&spec)?;
    let mut verdict = Verdict { identical: true, steps: 1, first_divergence: None, max_drift_rad: 0.0 };
    let mut load = load(&first);
    for record in steps {
        let record = record?;
        plant.advance(&load)?;
        compare(&mut verdict, plant.state(), &record);
        load = self::load(&record);
    }
    Ok(verdict)
}

fn compare(verdict: &mut Verdict, simulated: &State, record: &StepRecord) {
    let recorded = state(record);
    verdict.steps += 1;
    let bits = |state: &State| {
        let (x, v) = (state.alpha_rad, state.alpha_dot_rad_s);
        [x.x, x.y, v.x, v.y].map(f64::to_bits)
    };
    if bits(simulated) != bits(&recorded) {
        verdict.identical = false;
        verdict.first_divergence.get_or_insert(record.step);
        let drift_rad = (simulated.alpha_rad - recorded.alpha_rad).amax();
        verdict.max_drift_rad = verdict.max_drift_rad.max(drift_rad);
    }
}

fn state(record: &StepRecord) -> State {
    State::new(record.alpha_rad, record.alpha_dot_rad_s)
}

fn load(record: &StepRecord) -> Load {
    Load { torque_nm: record.torque_nm.into(), force_n: record.force_n.into() }
}
