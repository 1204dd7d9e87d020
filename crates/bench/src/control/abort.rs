//! Reasons for which a controller aborts.

use core::fmt;

use thiserror::Error;

use super::test_control::stop::StopReason;
use crate::rig::InstrumentName;
use crate::structure::Axis;
use resonarm_numeric::number::{rounded, short};

/// Axis of an instrument, as messages name it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InstrumentAxis {
    /// Name of the instrument.
    pub instrument: InstrumentName,
    /// Axis of the base frame.
    pub axis: Axis,
    /// Unit of its readings.
    pub unit: &'static str,
}

impl InstrumentAxis {
    /// Returns the axis in words that follow those of a reading.
    fn along(&self) -> &'static str {
        match self.axis {
            Axis::X => " along x",
            Axis::Y => " along y",
            Axis::Z => " along z",
            Axis::AboutZ => " about z",
            Axis::Scalar => "",
        }
    }
}

/// The instrument without the axis.
impl fmt::Display for InstrumentAxis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.instrument {
            InstrumentName::HEAD => f.write_str("the impedance head"),
            InstrumentName::B => f.write_str("the accelerometer at B"),
            InstrumentName::C => f.write_str("the accelerometer at C"),
            name => write!(f, "sensor {name}"),
        }
    }
}

/// Limit of a reading in `[limits]`. As text it is its key in a scenario.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum ReadingLimit {
    /// Limit of the force in the impedance head.
    #[error("limits.force_n")]
    Force,
    /// Limit of the accelerometers B and C.
    #[error("limits.acceleration_m_s2")]
    Acceleration,
    /// Limit of the sensor with this name.
    #[error("limits.sensors.{0}")]
    Sensor(InstrumentName),
}

/// Reason why a controller aborts; the plant is then disarmed.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum Abort {
    /// A reading in the feedback was clipped. It is below the true value, and the loop would increase the load
    /// further.
    #[error(
        "the accelerometer at {point} was clipped at {frequency_hz:.4} Hz: reduce the excitation, or increase its range (`rig.sensors.{point_key}.range_m_s2`; \
         the classic profile carries 1638 m/s\u{b2})"
    )]
    Clipped {
        /// Name of the point, B or C.
        point: char,
        /// Key of the point in a scenario, b or c.
        point_key: char,
        /// Frequency of the drive, Hz.
        frequency_hz: f64,
    },
    /// A reading of the impedance head was clipped while it was in the feedback.
    #[error(
        "the impedance head was clipped at {frequency_hz:.4} Hz: reduce the excitation, or increase its range (`rig.head.range_n`; the classic profile carries 655 N)"
    )]
    HeadClipped {
        /// Frequency of the drive, Hz.
        frequency_hz: f64,
    },
    /// The loop needs more load than the exciter's limit.
    #[error(
        "the controller asks for {got} {unit} at {frequency_hz:.4} Hz, beyond the exciter's limit of {limit} {unit}: reduce the excitation, or raise the limit if the exciter allows it",
        got = short(.got), limit = short(.limit)
    )]
    Load {
        /// Load that the loop needs, N or N·m.
        got: f64,
        /// Limit of the exciter, in the same unit.
        limit: f64,
        /// Unit of both numbers.
        unit: &'static str,
        /// Frequency of the drive, Hz.
        frequency_hz: f64,
    },
    /// Several points in a row have not settled.
    #[error(
        "{points} points in a row did not settle, the last at {frequency_hz:.4} Hz and a lag of {lag_deg:.1}\u{b0} (drift {drift:.1e}): another \
         mode takes part there, or the structure differs from the one in the scenario; check both"
    )]
    NotSettling {
        /// Number of points in a row.
        points: u32,
        /// Frequency of the last one, Hz.
        frequency_hz: f64,
        /// Lag of the last one, degrees.
        lag_deg: f64,
        /// Relative change of the last one while it was read.
        drift: f64,
    },
    /// The points so far predict no next periodic response, as where other modes move the driven point as much as the
    /// followed one.
    #[error(
        "the points found so far predict no response with a lag of {lag_deg:.1}\u{b0} at this load: another mode may move the driven point as much as the \
         followed one; choose lags nearer to 90\u{b0} (`from_lag_deg` and `to_lag_deg` in `[control]`), or another load"
    )]
    NotPredicted {
        /// Lag that the next point should have, degrees.
        lag_deg: f64,
    },
    /// The next periodic response, predicted from the points so far, is out of reach.
    #[error(
        "the points found so far predict no response with a lag of {lag_deg:.1}\u{b0} at this load: its frequency would be {frequency_hz:.3} Hz and its amplitude {amplitude_m:.3} m, but a phase walk stays within a tenth of the mode's frequency; choose lags nearer to 90\u{b0} (`from_lag_deg` and `to_lag_deg` in `[control]`), or another load"
    )]
    OutOfBand {
        /// Lag that the next point should have, degrees.
        lag_deg: f64,
        /// Frequency that is predicted for it, Hz.
        frequency_hz: f64,
        /// Amplitude that is predicted for it, m.
        amplitude_m: f64,
    },
    /// A reading exceeds a limit of the scenario.
    #[error(
        "{key}: {axis} reads {got} {unit}{along} after {} s, beyond the limit of {limit} {unit}: reduce the excitation, check \
         the sensor if the reading is implausible, or raise the limit", rounded(.time_s, 3), unit = .axis.unit, along = .axis.along(),
        got = short(.got), limit = short(.limit)
    )]
    Reading {
        /// The limit that it exceeds.
        key: ReadingLimit,
        /// Axis that reads it.
        axis: InstrumentAxis,
        /// Value of the reading.
        got: f64,
        /// Limit of the scenario, in the same unit.
        limit: f64,
        /// Time after the first answered sample, s.
        time_s: f64,
    },
    /// A command would exceed a limit of the scenario; it has not been sent.
    #[error(
        "limits.{key}: the controller asks for {got} {unit} after {} s, beyond the limit of {limit} {unit}: reduce \
         the excitation, check the controller's readings, or raise the limit", rounded(.time_s, 3), got = rounded(.got, 3), limit = short(.limit)
    )]
    Command {
        /// Key of the limit in `[limits]`.
        key: &'static str,
        /// Load that the controller wanted to command.
        got: f64,
        /// Limit of the scenario.
        limit: f64,
        /// Unit of both numbers.
        unit: &'static str,
        /// Time after the first answered sample, s.
        time_s: f64,
    },
    /// An axis stays clipped for too long.
    #[error(
        "limits.clipped_samples: {axis} is clipped{along} for {samples} {} in a row, up to {} s: reduce the excitation, or increase \
         its range (`{section}.{range_key}`)", if *samples == 1 { "sample" } else { "samples" }, rounded(.time_s, 3),
        along = .axis.along(), section = .axis.instrument.section()
    )]
    StaysClipped {
        /// Axis that is clipped.
        axis: InstrumentAxis,
        /// Number of clipped samples in a row.
        samples: u32,
        /// Key of the instrument's range.
        range_key: &'static str,
        /// Time after the first answered sample, s.
        time_s: f64,
    },
    /// An axis repeats its reading under load: the sensor is stuck or has dropped out.
    #[error(
        "limits.stuck_samples: {axis} reads exactly {value} {unit}{along} for {samples} samples under load, up to {} s: check \
         sensor and cable, or raise the number of samples if the axis has nothing to measure", rounded(.time_s, 3), value = short(.value),
        unit = .axis.unit, along = .axis.along()
    )]
    Stuck {
        /// Axis that repeats its reading.
        axis: InstrumentAxis,
        /// Reading that is repeated.
        value: f64,
        /// Number of equal samples in a row.
        samples: u32,
        /// Time after the first answered sample, s.
        time_s: f64,
    },
    /// The force of a response is more distorted than the scenario allows.
    #[error(
        "limits.distortion: harmonics 2 and 3 of the force are {} of its fundamental at {frequency_hz:.4} Hz after {} s, beyond the limit \
         of {limit}: reduce the excitation, check impedance head and exciter, or raise the limit", rounded(.got, 4), rounded(.time_s, 3), limit = short(.limit)
    )]
    Distorted {
        /// Harmonics 2 and 3 together over the fundamental.
        got: f64,
        /// Limit of the scenario.
        limit: f64,
        /// Frequency of the response, Hz.
        frequency_hz: f64,
        /// Time after the first answered sample, s.
        time_s: f64,
    },
    /// A test by a specification was stopped before its end.
    #[error(transparent)]
    Test(#[from] StopReason),
}
