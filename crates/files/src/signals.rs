//! Channels of a recording as signals: numbers at equal intervals, for spectra and figures.

use thiserror::Error;

use crate::export::{ExportError, RecordingPart, samples};
use crate::recording::{Recording, Topic};
use resonarm_bench::rig::Converter;
use resonarm_bench::structure::Channel;
use resonarm_scenario::Scenario;

/// Channels of a recording, all of its states or all of its samples, without a gap.
#[derive(Clone, Debug, PartialEq)]
pub struct Signals {
    /// Channels, in the order in which they were asked for.
    pub channels: Vec<Channel>,
    /// Values of each channel, in its unit.
    pub values: Vec<Vec<f64>>,
    /// Values of each channel that are beyond the range of its sensor.
    pub clipped: Vec<usize>,
    /// Sample rate of the signals, Hz.
    pub rate_hz: f64,
    /// Simulated time of the first value, s; readings were taken before their sample by the delay of the converters.
    pub start_s: f64,
    /// Converters of readings; `None` of states, which have none, and if the recording does not state them.
    pub converter: Option<Converter>,
}

/// Error of reading signals.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SignalError {
    /// The recording can't be read, a sample is missing, or there is none in the range of time.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// The recording has no such channel.
    #[error("the recording has no channel `{got}`: it has {}", known.join(", "))]
    UnknownChannel {
        /// Name that was asked for.
        got: String,
        /// Names of the channels, and of vectors of channels.
        known: Vec<String>,
    },
    /// Channels of states and of samples can't be shown together.
    #[error(
        "`{state}` is a state and `{reading}` is a reading, which is filtered and delayed by its converter: choose channels \
         of one kind"
    )]
    Mixed {
        /// Name of a state or load.
        state: String,
        /// Name of a reading.
        reading: String,
    },
    /// No channel was asked for.
    #[error("no channel is chosen: the recording has {}", known.join(", "))]
    NoChannel {
        /// Names of the channels, and of vectors of channels.
        known: Vec<String>,
    },
}

impl Signals {
    /// Reads channels by their names; the name of a vector, as `acceleration_b_m_s2`, stands for all of its components. The
    /// range of simulated time, s, is the whole recording where an end is not given.
    ///
    /// # Errors
    /// [`SignalError`] for an unknown name, a mix of states and readings, a gap, or a range without samples.
    pub fn read(
        recording: &Recording,
        names: &[impl AsRef<str>],
        [from_s, to_s]: [Option<f64>; 2],
    ) -> Result<Signals, SignalError> {
        let (topic, places) = places(recording, names)?;
        let all = recording.channels().of(topic);
        let wanted = samples(recording, from_s, to_s)?;
        let mut signals = Signals {
            channels: places.iter().map(|place| all[*place]).collect(),
            values: vec![Vec::new(); places.len()],
            clipped: vec![0; places.len()],
            rate_hz: 1.0 / recording.origin().dt_s,
            start_s: 0.0,
            converter: None,
        };
        let mut first = None;
        for row in recording.rows(topic).map_err(ExportError::from)? {
            let row = row.map_err(ExportError::from)?;
            if wanted.contains(&row.sample) {
                first.get_or_insert(row.sample);
                for ((values, count), place) in signals.values.iter_mut().zip(&mut signals.clipped).zip(&places) {
                    values.push(row.values[*place]);
                    *count += usize::from(row.clipped >> place & 1 != 0);
                }
            }
            if row.sample >= *wanted.end() {
                break;
            }
        }
        let lead = if topic == Topic::Samples { recording.origin().reading_delay_samples } else { 0.0 };
        signals.start_s = (first.unwrap_or_default() as f64 - lead) * recording.origin().dt_s;
        if topic == Topic::Samples {
            // What an import writes there is the converter of the logged bench, if its scenario stated one.
            let scenario = Scenario::from_configuration(recording.configuration());
            signals.converter = scenario.ok().map(|scenario| scenario.rig.converter);
        }
        Ok(signals)
    }

    /// Divides the power spectral densities of a channel by the square of the converters' gain at these frequencies, Hz: what is
    /// left is the density of the motion, and noise and images beyond half the sample rate multiplied by the same factors.
    pub fn correct_droop(&self, frequency_hz: &[f64], densities: &mut [f64]) {
        let Some(converter) = self.converter else { return };
        for (density, hz) in densities.iter_mut().zip(frequency_hz) {
            let gain = converter.gain(hz / self.rate_hz);
            *density /= gain * gain;
        }
    }

    /// Number of values of each channel.
    pub fn count(&self) -> usize {
        self.values.first().map_or(0, Vec::len)
    }
}

/// Finds channels by their names, all of one topic, and returns their places in it.
fn places(recording: &Recording, names: &[impl AsRef<str>]) -> Result<(Topic, Vec<usize>), SignalError> {
    const TOPICS: [Topic; 2] = [RecordingPart::Samples.topic(), RecordingPart::States.topic()];
    let known = || {
        let vectors = TOPICS.iter().flat_map(|topic| recording.channels().vectors(*topic));
        vectors.map(|(name, _)| name.to_owned()).collect()
    };
    let mut found: Vec<(Topic, usize, &str)> = Vec::new();
    for name in names.iter().map(AsRef::as_ref) {
        let before = found.len();
        for topic in TOPICS {
            let all = recording.channels().of(topic).iter().enumerate();
            let own = all.filter(|(_, channel)| channel.name.as_str() == name || channel.vector.as_str() == name);
            found.extend(own.map(|(place, _)| (topic, place, name)));
        }
        if found.len() == before {
            return Err(SignalError::UnknownChannel { got: name.to_owned(), known: known() });
        }
    }
    let of = |wanted: Topic| found.iter().find(|(topic, ..)| *topic == wanted).map(|(.., name)| (*name).to_owned());
    match (of(Topic::States), of(Topic::Samples)) {
        (Some(state), Some(reading)) => Err(SignalError::Mixed { state, reading }),
        (None, None) => Err(SignalError::NoChannel { known: known() }),
        (Some(_), None) => Ok((Topic::States, found.iter().map(|(_, place, _)| *place).collect())),
        (None, Some(_)) => Ok((Topic::Samples, found.iter().map(|(_, place, _)| *place).collect())),
    }
}
