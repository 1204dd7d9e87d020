//! Waveforms of an excitation, with their checks.

use alloc::string::String;
use alloc::vec::Vec;

use serde::{Deserialize, Serialize};

use super::error::{ExcitationError, check, not_negative, positive};
use super::load_file::LoadFile;
use super::spectrum::Spectrum;

/// Largest number of frequencies of a stepped sine, since each is stored.
const MOST_STEPS: f64 = 1e5;
/// Largest number of periods. They are not stored, but their samples are counted.
const MOST_PERIODS: u32 = 1_000_000;

/// Shape of an excitation in time, with a peak of 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "waveform", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Waveform {
    /// One sine of constant frequency.
    Dwell {
        /// Frequency of the sine, Hz, positive.
        frequency_hz: f64,
        /// Duration of the excitation, s, positive.
        duration_s: f64,
        /// Time to wait before the response is read, s.
        settle_s: f64,
    },
    /// A staircase of sines; every step is whole periods long, so that the phase is continuous.
    SteppedSine {
        /// Frequency of the first step, Hz, positive.
        from_hz: f64,
        /// Frequency of the last step, Hz, positive; below `from_hz` for a downward sweep.
        to_hz: f64,
        /// Number of steps, at least 1.
        steps: u32,
        /// Least length of a step, s, positive; rounded up to whole periods.
        dwell_s: f64,
        /// Part of each step to wait before its response is read, s.
        settle_s: f64,
    },
    /// A staircase of sines at listed frequencies; as in a stepped sine, every step is whole periods long.
    SineList {
        /// The frequencies, Hz, positive, in the order in which they are played; from 1 to 100000 of them.
        frequencies_hz: Vec<f64>,
        /// Least length of a step, s, positive; rounded up to whole periods.
        dwell_s: f64,
        /// Part of each step to wait before its response is read, s.
        settle_s: f64,
    },
    /// A sine whose frequency sweeps from one value to another.
    SweptSine {
        /// Frequency at the start, Hz, positive.
        from_hz: f64,
        /// Frequency at the end, Hz, positive; below `from_hz` for a downward sweep.
        to_hz: f64,
        /// Duration of the excitation, s, positive.
        duration_s: f64,
        /// Law of the frequency over time.
        #[serde(default)]
        law: SweepLaw,
    },
    /// A half-sine pulse, like an impact hammer's, and silence after it.
    Impulse {
        /// Length of the pulse, s, positive.
        pulse_s: f64,
        /// Length of pulse and silence together, s, at least `pulse_s`.
        duration_s: f64,
    },
    /// Gaussian noise in a band, of a flat spectrum unless another is given. Its largest sample is the peak,
    /// about 4 to 5 times the root mean square.
    Random {
        /// Lowest frequency, Hz, positive.
        from_hz: f64,
        /// Highest frequency, Hz, at least `from_hz`.
        to_hz: f64,
        /// Duration of the excitation, s, positive.
        duration_s: f64,
        /// Shape of the power spectral density, from a breakpoint at `from_hz` to one at `to_hz`; flat without it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        spectrum: Option<Spectrum>,
        /// Seed of the noise, apart from that of the instruments' noise.
        #[serde(default, with = "resonarm_numeric::seed")]
        seed: u64,
    },
    /// The same noise, on at the start of every period and then silent. The edges of the bursts spread its spectrum,
    /// unless a ramp softens them.
    BurstRandom {
        /// Lowest frequency, Hz, positive.
        from_hz: f64,
        /// Highest frequency, Hz, at least `from_hz`.
        to_hz: f64,
        /// Length of a burst, s, positive.
        burst_s: f64,
        /// Length of burst and silence, s, at least `burst_s`; whole samples.
        period_s: f64,
        /// Number of periods, from 1 to 1000000; the noise of each is new.
        periods: u32,
        /// Shape of the power spectral density, as of `Random`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        spectrum: Option<Spectrum>,
        /// Seed of the noise, apart from that of the instruments' noise.
        #[serde(default, with = "resonarm_numeric::seed")]
        seed: u64,
    },
    /// Equal sines at all multiples of 1/`period_s` in a band, periodic.
    Multisine {
        /// Lowest frequency, Hz, positive.
        from_hz: f64,
        /// Highest frequency, Hz, at least `from_hz`.
        to_hz: f64,
        /// Length of a period, s, positive; whole samples.
        period_s: f64,
        /// Number of periods, from 1 to 1000000.
        periods: u32,
        /// Phases of the sines.
        #[serde(default)]
        phases: Phases,
        /// Seed of the random phases.
        #[serde(default, with = "resonarm_numeric::seed")]
        seed: u64,
    },
    /// Loads from a CSV file: a line for every sample, or time and load.
    File {
        /// Path of the file, relative to the folder of the scenario.
        path: String,
        /// Contents of the file. Scenario text has no such key: reading a scenario file also reads this file.
        #[serde(skip)]
        load: Option<LoadFile>,
    },
}

/// Law of a swept sine's frequency from `from_hz`, f0, to `to_hz`, f1, over `duration_s`, T.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SweepLaw {
    /// Linear in time: f = f0 + (f1 − f0) t/T.
    #[default]
    Linear,
    /// f = f0 (f1/f0)^(t/T): an octave always takes the same time.
    Logarithmic,
}

/// Phases of a multisine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Phases {
    /// Uniform over the circle, from the seed: like noise, with a peak factor of about 3 to 4.
    #[default]
    Random,
    /// −π j (j − 1)/J of the j-th of J sines, like a sweep in each period, with a peak factor of about 1.7 (M. R.
    /// Schroeder, "Synthesis of Low-Peak-Factor Signals and Binary Sequences With Low Autocorrelation", IEEE Trans.
    /// Inf. Theory 16 (1970)).
    Schroeder,
}

impl Waveform {
    /// Returns the part of each sine to wait before its response is read, s; `None` where no response is read.
    pub fn settle_s(&self) -> Option<f64> {
        match self {
            Waveform::Dwell { settle_s, .. }
            | Waveform::SteppedSine { settle_s, .. }
            | Waveform::SineList { settle_s, .. } => Some(*settle_s),
            _ => None,
        }
    }

    /// Returns the least length of each sine, s; `None` where no response is read.
    pub fn dwell_s(&self) -> Option<f64> {
        match self {
            Waveform::Dwell { duration_s: dwell_s, .. }
            | Waveform::SteppedSine { dwell_s, .. }
            | Waveform::SineList { dwell_s, .. } => Some(*dwell_s),
            _ => None,
        }
    }

    /// Checks the numbers and returns the highest frequency, Hz.
    pub(super) fn check(&self) -> Result<f64, ExcitationError> {
        match *self {
            Waveform::Dwell { frequency_hz, duration_s, settle_s } => {
                positive("frequency_hz", frequency_hz)?;
                positive("duration_s", duration_s)?;
                not_negative("settle_s", settle_s)?;
                Ok(frequency_hz)
            }
            Waveform::SteppedSine { from_hz, to_hz, steps, dwell_s, settle_s } => {
                positive("from_hz", from_hz)?;
                positive("to_hz", to_hz)?;
                check_steps("steps", f64::from(steps))?;
                positive("dwell_s", dwell_s)?;
                not_negative("settle_s", settle_s)?;
                Ok(from_hz.max(to_hz))
            }
            Waveform::SineList { ref frequencies_hz, dwell_s, settle_s } => {
                check_steps("frequencies_hz", frequencies_hz.len() as f64)?;
                positive("dwell_s", dwell_s)?;
                not_negative("settle_s", settle_s)?;
                frequencies_hz.iter().try_fold(0.0_f64, |highest, frequency_hz| {
                    positive("frequencies_hz", *frequency_hz)?;
                    Ok(highest.max(*frequency_hz))
                })
            }
            Waveform::SweptSine { from_hz, to_hz, duration_s, .. } => {
                positive("from_hz", from_hz)?;
                positive("to_hz", to_hz)?;
                positive("duration_s", duration_s)?;
                Ok(from_hz.max(to_hz))
            }
            Waveform::Impulse { pulse_s, duration_s } => {
                positive("pulse_s", pulse_s)?;
                let is_valid = duration_s.is_finite() && duration_s >= pulse_s;
                check("duration_s", duration_s, is_valid, "at least `pulse_s`")?;
                // A half sine of length τ is half a period of 1/(2τ), which must be below half the sample rate.
                Ok(0.5 / pulse_s)
            }
            Waveform::Random { from_hz, to_hz, duration_s, ref spectrum, .. } => {
                positive("duration_s", duration_s)?;
                shaped_band(from_hz, to_hz, spectrum.as_ref())
            }
            Waveform::BurstRandom { from_hz, to_hz, burst_s, period_s, periods, ref spectrum, .. } => {
                positive("burst_s", burst_s)?;
                check("period_s", period_s, period_s.is_finite() && period_s >= burst_s, "at least `burst_s`")?;
                check_periods(periods)?;
                shaped_band(from_hz, to_hz, spectrum.as_ref())
            }
            Waveform::Multisine { from_hz, to_hz, period_s, periods, .. } => {
                positive("period_s", period_s)?;
                check_periods(periods)?;
                band(from_hz, to_hz)
            }
            // A file has no frequency of its own. Points that are too dense are rejected when it is sampled.
            Waveform::File { .. } => Ok(0.0),
        }
    }
}

/// Checks a band and returns its highest frequency, Hz.
fn band(from_hz: f64, to_hz: f64) -> Result<f64, ExcitationError> {
    positive("from_hz", from_hz)?;
    positive("to_hz", to_hz)?;
    check("to_hz", to_hz, to_hz >= from_hz, "at least `from_hz`")?;
    Ok(to_hz)
}

/// Checks a band with its spectrum, if one is given, and returns its highest frequency, Hz.
fn shaped_band(from_hz: f64, to_hz: f64, spectrum: Option<&Spectrum>) -> Result<f64, ExcitationError> {
    let highest_hz = band(from_hz, to_hz)?;
    spectrum.map_or(Ok(()), |spectrum| spectrum.check(from_hz, to_hz))?;
    Ok(highest_hz)
}

fn check_steps(name: &'static str, got: f64) -> Result<(), ExcitationError> {
    check(name, got, (1.0..=MOST_STEPS).contains(&got), "from 1 to 100000")
}

fn check_periods(periods: u32) -> Result<(), ExcitationError> {
    check("periods", f64::from(periods), (1..=MOST_PERIODS).contains(&periods), "from 1 to 1000000")
}
