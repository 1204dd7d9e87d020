//! Errors of the spectral estimators.

use thiserror::Error;

use resonarm_numeric::number::short;

/// Reason why spectra or frequency responses can't be estimated.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SpectraError {
    /// The sample rate is not a positive number.
    #[error("the sample rate is {rate_hz} Hz: it must be a positive number", rate_hz = short(.rate_hz))]
    Rate {
        /// Stated sample rate, Hz.
        rate_hz: f64,
    },
    /// The quality of the oscillators is not above ½, so that they don't oscillate.
    #[error("the quality is {quality}: it must be above 0.5", quality = short(.quality))]
    Quality {
        /// Quality Q = 1/2ζ.
        quality: f64,
    },
    /// A natural frequency is outside the band of the record.
    #[error(
        "the frequency is {} Hz: it must be positive, and at most half of the sample rate, {} Hz",
        short(.frequency_hz),
        short(.most_hz)
    )]
    Frequency {
        /// Natural frequency of an oscillator, Hz.
        frequency_hz: f64,
        /// Half of the sample rate, Hz.
        most_hz: f64,
    },
    /// A segment is longer than a record, or too short.
    #[error("a segment has {segment} samples: it must have from 2 to as many as the shortest record, {samples}")]
    Segment {
        /// Number of samples of a segment.
        segment: usize,
        /// Number of samples of the shortest record.
        samples: usize,
    },
    /// The segments overlap completely.
    #[error("segments of {segment} samples overlap by {overlap}: the overlap must be shorter than a segment")]
    Overlap {
        /// Number of samples of a segment.
        segment: usize,
        /// Number of samples that two segments in turn share.
        overlap: usize,
    },
    /// There is no record.
    #[error("there is no record: expected at least one")]
    NoRecord,
    /// Records have different channels, or the channels of a record have different lengths.
    #[error(
        "record {record}, counted from 0, does not fit: expected {inputs} inputs and {outputs} outputs as in the first record, and the same number of samples in each channel"
    )]
    Channels {
        /// Index of the record, from 0.
        record: usize,
        /// Number of inputs of the first record.
        inputs: usize,
        /// Number of outputs of the first record.
        outputs: usize,
    },
    /// A sample is not a finite number.
    #[error("sample {sample} of record {record}, both counted from 0, is not a finite number")]
    NotFinite {
        /// Index of the record, from 0.
        record: usize,
        /// Index of the sample, from 0.
        sample: usize,
    },
    /// Frequency responses need an input and an output.
    #[error("there are {inputs} inputs and {outputs} outputs: frequency responses need at least one of each")]
    NoResponse {
        /// Number of inputs of the record.
        inputs: usize,
        /// Number of outputs of the record.
        outputs: usize,
    },
    /// The estimator H2 is defined for one input only.
    #[error("the estimator H2 needs a single input, got {inputs}: use H1 or Hv")]
    SeveralInputs {
        /// Number of inputs of the record.
        inputs: usize,
    },
    /// There are too few averages to separate the inputs.
    #[error("{averages} averages can't separate {inputs} inputs: use shorter segments or fewer inputs")]
    TooFewAverages {
        /// Number of segments that were averaged.
        averages: usize,
        /// Number of inputs of the record.
        inputs: usize,
    },
    /// The ratio of noise powers for Hv is not a positive number.
    #[error("the ratio of noise powers is {ratio}: it must be a positive number", ratio = short(.ratio))]
    NoiseRatio {
        /// Ratio of the noise power of an output over that of an input.
        ratio: f64,
    },
}
