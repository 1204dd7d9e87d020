//! The plant of a recording at its first sample: from the scenario if the recording begins with the run, else from the
//! state that [`cut`](crate::cut::cut) has stored.

use crate::recording::{Configuration, Recording, StateRecord};
use resonarm_bench::plant::Plant;

/// The key of a cut's configuration that holds the plant at its first sample: its states, and the state of converters
/// and instruments, as numbers with a space between.
pub const PLANT: &str = "cut.plant";

/// Returns the plant at the first sample of the recording, whose readings continue from there. `None` if it begins in
/// the middle of a run and does not hold the plant, or its scenario has no valid plant.
pub fn plant(recording: &Recording) -> Option<Plant> {
    let scenario = recording.scenario().ok()?;
    let plant = scenario.plant().ok()?;
    let first = recording.summary().samples?.0;
    match recording.configuration().get(PLANT) {
        None => (first == 0).then_some(plant),
        Some(text) => {
            let numbers = text.split(' ').map(str::parse).collect::<Result<Vec<f64>, _>>().ok()?;
            plant.restored(first, &numbers).ok()
        }
    }
}

/// Returns the state of the plant to be stored in a cut that begins at sample `first`: that of the run, re-simulated up
/// to there. `None` if the run can't be re-simulated, or its states are not the recorded ones.
pub(crate) fn noted(recording: &Recording, first: u64) -> Option<String> {
    let scenario = recording.scenario().ok()?;
    // The state of an FMU can't be set.
    if scenario.is_fmu() {
        return None;
    }
    let mut plant = plant(recording)?;
    for record in recording.states().ok()? {
        let record = record.ok()?;
        if record.sample != plant.sample() || !is_recorded(&plant, &record) {
            return None;
        }
        if record.sample == first {
            let numbers = plant.save();
            // The shortest digits that are read back as the same bits.
            return Some(numbers.iter().map(|number| format!("{number:e}")).collect::<Vec<_>>().join(" "));
        }
        // In the order of a run: reading first, then the step. Converters and noise advance with each reading.
        plant.measure();
        plant.advance(&record.load).ok()?;
    }
    None
}

/// Says whether the states of the plant are bit-identical to the recorded ones; those of devices where they are
/// recorded.
pub fn is_recorded(plant: &Plant, record: &StateRecord) -> bool {
    let states = plant.states();
    let same = |(state, recorded): (&f64, &f64)| recorded.to_bits() == state.to_bits();
    states.moving().len() == record.states.moving().len() && states.iter().zip(&*record.states).all(same)
}

/// Returns a recording's description of itself, except the plant at the first sample.
pub(crate) fn without_plant(configuration: &Configuration) -> impl Iterator<Item = (&str, &str)> {
    configuration.iter().filter(|(key, _)| *key != PLANT)
}
