//! Errors of the identification.

use thiserror::Error;

use resonarm_numeric::number::short;

use crate::spectra::SpectraError;

/// Reason why no modes can be identified.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ModalError {
    /// The band does not rise, or ends above half the sample rate.
    #[error("the band is from {from_hz} to {to_hz} Hz: it must rise, from above 0 to at most {most_hz} Hz", from_hz = short(.from_hz), to_hz = short(.to_hz), most_hz = short(.most_hz))]
    Band {
        /// Lowest frequency of the band, Hz.
        from_hz: f64,
        /// Highest frequency of the band, Hz.
        to_hz: f64,
        /// Half the sample rate, or the last frequency of the measured responses, Hz.
        most_hz: f64,
    },
    /// The band has too few lines for the unknowns.
    #[error("the band has {lines} lines, but at least {least} are needed: record for longer, or widen the band")]
    TooFewLines {
        /// Number of lines of a run in the band.
        lines: usize,
        /// Least number of lines.
        least: usize,
    },
    /// Records have different sample rates.
    #[error("run {run}, counted from 0, has {rate_hz} samples per second, but the first one has {first_hz}: expected the same rate in all", rate_hz = short(.rate_hz), first_hz = short(.first_hz))]
    Rates {
        /// Index of the run, from 0.
        run: usize,
        /// Its sample rate, Hz.
        rate_hz: f64,
        /// Sample rate of the first run, Hz.
        first_hz: f64,
    },
    /// There is nothing to fit.
    #[error("there is no response: expected at least one reference and one response")]
    NoData,
    /// Frequencies, or the values of a response, don't fit each other.
    #[error("response {response}, counted from 0, has {values} values, but there are {lines} frequencies")]
    Length {
        /// Index of the response, from 0.
        response: usize,
        /// Number of its values.
        values: usize,
        /// Number of frequencies of the responses.
        lines: usize,
    },
    /// Frequencies of measured responses are not equally spaced.
    #[error("frequency {line}, counted from 0, is {frequency_hz} Hz: frequencies must rise in equal steps", frequency_hz = short(.frequency_hz))]
    Frequencies {
        /// Index of the frequency, from 0.
        line: usize,
        /// Frequency at that index, Hz.
        frequency_hz: f64,
    },
    /// A reference has no power in the band.
    #[error(
        "reference {dof} of run {run}, counted from 0, has no power in the band: drive the structure there, or name the band that was driven"
    )]
    NoPower {
        /// Index of the run, from 0.
        run: usize,
        /// Degree of freedom of the reference.
        dof: usize,
    },
    /// A response is zero in the whole band.
    #[error("response {dof} of run {run}, counted from 0, is zero in the band: check the sensor, or leave it out")]
    Silent {
        /// Index of the run, from 0.
        run: usize,
        /// Degree of freedom of the response.
        dof: usize,
    },
    /// The records have a quality that no spectrum can be made of.
    #[error(transparent)]
    Spectra(#[from] SpectraError),
    /// The order of the stabilisation diagram is out of range.
    #[error("the order is {order}: it must be from {least} to {most}")]
    Order {
        /// Order that was given.
        order: usize,
        /// Least order of the model that was asked for.
        least: usize,
        /// Largest order of the model that was asked for.
        most: usize,
    },
    /// A chosen pole can't be the start of a fit.
    #[error("chosen pole {pole}, counted from 0, has {frequency_hz} Hz and damping ratio {damping_ratio}: it must be in the band, with a damping ratio above 0 and below 1", frequency_hz = short(.frequency_hz), damping_ratio = short(.damping_ratio))]
    ChosenPole {
        /// Index of the pole, from 0.
        pole: usize,
        /// Frequency of the mode, Hz.
        frequency_hz: f64,
        /// Damping ratio of the mode.
        damping_ratio: f64,
    },
    /// No pole was found.
    #[error("there is no resonance in the band: widen it, or record for longer")]
    NoModes,
}
