//! The record of a run.

use alloc::vec::Vec;

use serde::Serialize;

/// Record of a run of a controller, sample by sample from the start of the plant on.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Record {
    /// Sample rate of all channels, Hz.
    pub rate_hz: f64,
    /// Force that the controller commanded, N: 0 before it armed the plant, and after the plant was disarmed.
    pub drive: Vec<f64>,
    /// What the control channel read, m/s².
    pub reading: Vec<f64>,
    /// What the channels with a limit read, m/s², in the order of the limits of the specification.
    pub responses: Vec<Vec<f64>>,
    /// Whether the record ends because the controller disarmed the plant, so that no drive follows.
    pub is_disarmed: bool,
}

impl Record {
    /// Returns the number of samples.
    pub fn len(&self) -> usize {
        self.drive.len().min(self.reading.len())
    }

    /// Says whether the record has no sample.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns a time as a number of samples.
    pub(crate) fn samples(&self, seconds: f64) -> usize {
        libm::round(seconds * self.rate_hz) as usize
    }

    /// Returns the largest drive between two samples, N; 0 beyond the ends.
    pub(crate) fn peak(&self, from: usize, to: usize) -> f64 {
        let to = to.min(self.drive.len());
        self.drive.get(from..to).map_or(0.0, largest)
    }

    /// Returns the time without a drive at the end, s; infinite if the plant was disarmed there.
    pub(crate) fn quiet_s(&self) -> f64 {
        let samples = self.len() - self.drive_end().min(self.len());
        if self.is_disarmed { f64::INFINITY } else { samples as f64 / self.rate_hz }
    }

    /// Says whether the drive has ended when the record does.
    pub(crate) fn is_ended(&self) -> bool {
        self.quiet_s() > 0.0
    }

    /// Returns the sample after the last one with a drive.
    pub fn drive_end(&self) -> usize {
        // The last drive counts and not the first silence: a drive may pass through zero.
        self.drive.iter().rposition(|drive| *drive != 0.0).map_or(0, |last| last + 1)
    }
}

/// Returns the largest size of values; 0 of none.
pub(crate) fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |largest, value| value.abs().max(largest))
}

/// Returns the root of the mean square; 0 of no values.
pub(crate) fn rms(values: &[f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    libm::sqrt(values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64)
}

/// Returns the rms of every stretch of `window` values, the first of which begins at the first value; none if the window is
/// longer than the values, or empty.
pub(crate) fn running_rms(values: &[f64], window: usize) -> Vec<f64> {
    if window == 0 || values.len() < window {
        return Vec::new();
    }
    let mut sums = Vec::with_capacity(values.len() + 1);
    let mut sum = 0.0;
    sums.push(sum);
    for value in values {
        sum += value * value;
        sums.push(sum);
    }
    // Rounding of the sums can make the difference of equal ones negative.
    (window..sums.len()).map(|end| libm::sqrt((sums[end] - sums[end - window]).max(0.0) / window as f64)).collect()
}

/// Returns the ratio of two amplitudes in dB; −300 dB at the least.
pub(crate) fn db(ratio: f64) -> f64 {
    20.0 * libm::log10(ratio.max(1e-15))
}
