//! Identification from recordings: the readings and the settings that suit what the exciter played, the joints' angles
//! over time, and which modes of the scenario's structure were found.

mod angles;
mod load;
mod missing;

use thiserror::Error;

pub use angles::{RecordedAngles, has_faulty_accelerometer};
pub use load::acting_load;
pub use missing::{KnownPole, MissingMode, Reason, missing_modes, mode_numbers};

use resonarm_bench::excitation::Waveform;
use resonarm_bench::identify::{Averaging, Band, Direction, IdentifyError, Record, RigPlaces};
use resonarm_bench::plant::TestedAssembly;
use resonarm_files::import::IMPORTED_FROM;
use resonarm_files::recording::{Recording, RecordingError};
use resonarm_scenario::{Scenario, ScenarioError};

/// Error of an identification from a recording.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum IdentificationError {
    /// The recording can't be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The recording's scenario has no structure.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The accelerometers don't show the angles of the joints.
    #[error(
        "joint angles can't be computed from these accelerations: they need a chain of two links with the accelerometers at their ends, B at joint2 and C at tip"
    )]
    NoAngles,
    /// The recording was imported from a log that has no readings.
    #[error(
        "the recording was imported from {log} and has no readings: the user protocol does not carry all of them, and `import` lists the missing ones"
    )]
    NoReadings {
        /// Log from which the recording was imported.
        log: String,
    },
    /// The readings do not allow an identification.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
}

/// Number of averaged segments of a record without periods.
const SEGMENTS: usize = 8;
/// Highest frequency if nothing else gives one, as a fraction of the sample rate and in Hz.
const HIGHEST_PART: f64 = 0.4;
const HIGHEST_HZ: f64 = 100.0;

/// Returns the readings of a recording of `scenario`, with the force along `input` as their cause. Those of sample 0
/// are left out: they only show the initial state. `tested` is the scenario's structure; `None` if its equations are not known.
///
/// # Errors
/// [`IdentificationError`] if the recording can't be read or has no readings, a reading is clipped, or nothing drives
/// the structure.
pub fn record(
    recording: &Recording,
    scenario: &Scenario,
    tested: Option<&TestedAssembly>,
    input: Direction,
) -> Result<Record, IdentificationError> {
    check_readings(recording)?;
    let rate_hz = 1.0 / recording.origin().dt_s;
    let mut rows = Vec::new();
    let mut clipped = 0;
    for sample in recording.samples()? {
        let sample = sample?;
        // All clipped samples are counted before the error is returned, so that it states how many there are.
        clipped += usize::from(sample.clipped.any());
        let [bx, by] = sample.acceleration_b_m_s2;
        let [cx, cy] = sample.acceleration_c_m_s2;
        if sample.sample > 0 {
            rows.push((sample.head_force_n, [&[bx, by, cx, cy], sample.more.values()].concat()));
        }
    }
    if clipped > 0 {
        return Err(IdentifyError::Clipped { samples: clipped }.into());
    }
    let places = match tested {
        Some(tested) => RigPlaces::of_structure(tested, &scenario.rig),
        None => RigPlaces::of_rig(&scenario.rig),
    };
    Ok(Record::new(rate_hz, &scenario.rig, &places, rows, input)?)
}

/// Says whether the scenario gives an instrument a fault.
pub fn has_faults(scenario: &Scenario) -> bool {
    !scenario.rig.faults.is_empty()
}

/// Rejects a log without readings.
fn check_readings(recording: &Recording) -> Result<(), IdentificationError> {
    match recording.configuration().get(IMPORTED_FROM) {
        Some(log) if recording.samples()?.next().is_none() => {
            Err(IdentificationError::NoReadings { log: log.to_owned() })
        }
        _ => Ok(()),
    }
}

/// Returns the band in which a recorded excitation excites the arm, at `rate_hz` samples a second.
pub fn band(waveform: Option<&Waveform>, rate_hz: f64) -> Band {
    let highest_hz = HIGHEST_PART * rate_hz;
    let (from_hz, to_hz) = match waveform {
        Some(
            Waveform::SteppedSine { from_hz, to_hz, .. }
            | Waveform::SweptSine { from_hz, to_hz, .. }
            | Waveform::Random { from_hz, to_hz, .. }
            | Waveform::BurstRandom { from_hz, to_hz, .. }
            | Waveform::Multisine { from_hz, to_hz, .. },
        ) => (from_hz.min(*to_hz), from_hz.max(*to_hz)),
        Some(Waveform::SineList { frequencies_hz, .. }) => {
            let ends = |(low, high): (f64, f64), hz: &f64| (low.min(*hz), high.max(*hz));
            frequencies_hz.iter().fold((f64::INFINITY, 0.0), ends)
        }
        // The spectrum of a pulse falls off beyond about 1 over its length.
        Some(Waveform::Impulse { pulse_s, .. }) => (1.0, highest_hz.min(1.0 / pulse_s)),
        Some(Waveform::Dwell { .. } | Waveform::File { .. }) | None => (1.0, highest_hz.min(HIGHEST_HZ)),
    };
    Band { from_hz, to_hz }
}

/// Returns the averaging that suits an excitation.
pub fn averaging(waveform: Option<&Waveform>, record: &Record) -> Averaging {
    match waveform {
        Some(Waveform::Impulse { .. }) => Averaging::Single,
        Some(Waveform::Multisine { period_s, .. } | Waveform::BurstRandom { period_s, .. }) => {
            Averaging::Periods(samples_in(*period_s, record))
        }
        _ => Averaging::Welch(record.samples() / SEGMENTS),
    }
}

/// Returns the number of samples of a record in a time, s.
pub fn samples_in(time_s: f64, record: &Record) -> usize {
    libm::round(time_s * record.rate_hz()) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plate on soft strings has modes at 0 Hz, which have no pole. The others keep their numbers.
    #[test]
    fn modes_beside_one_without_a_pole_have_their_numbers() {
        assert_eq!(mode_numbers(&[63.405, 149.997], &[f64::NAN, 63.4, 150.0]), [Some(2), Some(3)]);
    }

    #[test]
    fn a_band_is_that_of_what_was_played() {
        assert_eq!(band(None, 100.0), Band { from_hz: 1.0, to_hz: 40.0 });
        let list = Waveform::SineList { frequencies_hz: vec![30.0, 20.0], dwell_s: 1.0, settle_s: 0.0 };
        assert_eq!(band(Some(&list), 1000.0), Band { from_hz: 20.0, to_hz: 30.0 });
    }
}
