//! Re-simulates a run from its recorded loads.

use super::error::ReplayError;
use super::repetition;
use super::verdict::{Verdict, check, compare, load};
use crate::study::on_all_cores;
use resonarm_bench::plant::{Plant, PlantSpec};
use resonarm_bench::rig::{Amplifier, Converter};
use resonarm_bench::structure::States;
use resonarm_files::import::IMPORTED_FROM;
use resonarm_files::recording::{Recording, StateRecord};
use resonarm_files::starting_plant::is_recorded;

/// Samples that are in memory at a time: some MB.
const BLOCK: usize = 1 << 13;
/// Samples that a core takes at a time: some milliseconds of work.
const PART: usize = 1 << 10;

/// Starts from the first recorded state, applies the recorded loads, and compares every state.
///
/// State and current at a sample follow only from state, current and load at the one before. So as long as none
/// differs, all cores simulate parts of the run, each from a recorded state, and the result is the same as that of one
/// core. An FMU is simulated only from its start, and once more where it differs. It is loaded from the file of
/// [`Recording::allow_fmu`], never from the path in the recording.
///
/// # Errors
/// [`ReplayError`] if the recording can't be read, was imported from a log, has gaps or no states; if its scenario
/// describes no valid plant, or another one than was recorded (another sample period, loads beyond its exciter); or if
/// it begins in the middle of a run without the current of its shaker's coil.
pub fn resimulate(recording: &Recording) -> Result<Verdict, ReplayError> {
    let scenario = recording.scenario();
    if let Some(log) = recording.configuration().get(IMPORTED_FROM) {
        return Err(ReplayError::Imported { log: log.to_owned(), has_scenario: scenario.is_ok() });
    }
    let scenario = scenario?;
    if scenario.is_fmu() {
        return repetition::repeat(recording, &scenario);
    }
    let mut spec = scenario.plant_spec();
    // No reading is taken, and of the states none depends on the converters: the one without a filter is the fastest.
    spec.rig.converter = Converter::Instant;
    check(recording, spec.sample_rate_hz)?;
    let mut states = recording.states()?;
    let first = states.next().ok_or(ReplayError::Empty { what: "states" })??;
    // The first state is where the plant starts, so it counts as compared.
    let mut verdict = Verdict { samples: 1, ..Verdict::begin(recording) };
    let fresh = Plant::new(&spec, &scenario.under_test()?)?;
    let mut plant = plant(&fresh, &spec, &first)?;
    load(&first, &plant)?;
    let mut block = Vec::with_capacity(BLOCK + 1);
    block.push(first);
    loop {
        states.read(&mut block, BLOCK)?;
        let [.., last] = block[..] else { return Ok(verdict) };
        // Only the record that the block before has left is there: the recording has ended.
        if block.len() == 1 {
            return Ok(verdict);
        }
        // A part may start from a recorded state only while the recorded states are those of the run. After the first
        // divergence the plant is followed from its own state, which shows how far it drifts.
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

/// Returns the plant in a recorded state. `fresh` is the plant at its start, which takes longer to make than to copy.
fn plant(fresh: &Plant, spec: &PlantSpec, record: &StateRecord) -> Result<Plant, ReplayError> {
    let states = match (spec.rig.shaker, record.states.internal()) {
        // At sample 0 the coil has none, and an amplifier in current mode sets it with the load.
        (Some(shaker), []) if record.sample == 0 || shaker.amplifier == Amplifier::Current => {
            States::new(record.states.moving(), &[0.0])
        }
        (Some(_), []) => None,
        _ => Some(record.states),
    };
    let states = states.ok_or(ReplayError::NoCurrent { sample: record.sample })?;
    Ok(fresh.clone().at(record.sample, &states)?)
}

/// Says whether every state of the block follows from the one before, tried on all cores. If not, or if it can't be
/// tried, the sequential comparison finds the reason.
fn agrees(fresh: &Plant, spec: &PlantSpec, block: &[StateRecord]) -> bool {
    // Parts overlap by one record, the end of the one and the start of the next, so that every step is tried once.
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
