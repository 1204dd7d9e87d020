//! Why a controller gives up.

use thiserror::Error;

use resonarm_numeric::number::{rounded, short};

/// Why a controller gives up; the plant is disarmed.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum Abort {
    /// A reading that the loop is closed on was clipped: it is below the true value, and the loop would drive on.
    #[error(
        "the accelerometer at {point} was clipped at {frequency_hz:.4} Hz: drive less, or give it more range (`rig.sensors.{point_key}.range_m_s2`; \
         the classic profile carries 1638 m/s\u{b2})"
    )]
    Clipped {
        /// The point.
        point: char,
        /// The point's name in a scenario.
        point_key: char,
        /// Frequency of the drive, Hz.
        frequency_hz: f64,
    },
    /// A reading of the impedance head was clipped, and the loop is closed on it.
    #[error(
        "the impedance head was clipped at {frequency_hz:.4} Hz: drive less, or give it more range (`rig.head.range_n`; the classic profile carries 655 N)"
    )]
    HeadClipped {
        /// Frequency of the drive, Hz.
        frequency_hz: f64,
    },
    /// The loop asks for more than the exciter's limit.
    #[error(
        "the loop asks for {got} {unit} at {frequency_hz:.4} Hz, the exciter has {limit} {unit}: drive less, or raise the limit if the exciter has more",
        got = short(.got), limit = short(.limit)
    )]
    Load {
        /// The load that it asks for, N or N·m.
        got: f64,
        /// The exciter's limit.
        limit: f64,
        /// The unit of both.
        unit: &'static str,
        /// Frequency of the drive, Hz.
        frequency_hz: f64,
    },
    /// Points do not settle.
    #[error(
        "{points} points in a row did not settle, the last at {frequency_hz:.4} Hz and a lag of {lag_deg:.1}\u{b0} (drift {drift:.1e}): another mode takes part \
         there, or the arm is not the one that the scenario describes"
    )]
    NotSettling {
        /// Number of points.
        points: u32,
        /// Frequency of the last, Hz.
        frequency_hz: f64,
        /// Its lag, degrees.
        lag_deg: f64,
        /// Its relative change while it was read.
        drift: f64,
    },
    /// The next motion that follows from the points so far is impossible.
    #[error(
        "no motion of the mode has a lag of {lag_deg:.1}\u{b0} at this load by what was found so far: the frequency would be {frequency_hz:.3} Hz, the amplitude {amplitude_m:.3} m; a walk stays within a tenth of the mode's frequency: take lags nearer to 90\u{b0}, or another load"
    )]
    OutOfBand {
        /// The wanted lag, degrees.
        lag_deg: f64,
        /// The frequency that follows, Hz.
        frequency_hz: f64,
        /// The amplitude there, m.
        amplitude_m: f64,
    },
    /// A reading is beyond a limit of the scenario.
    #[error(
        "limits.{key}: {who} reads {got} {unit} along {axis} after {} s, beyond the limit of {limit} {unit}: drive less, fix the \
         sensor if that can't be, or raise the limit", rounded(.time_s, 3), got = short(.got), limit = short(.limit)
    )]
    Reading {
        /// The limit's key.
        key: &'static str,
        /// The instrument.
        who: &'static str,
        /// The reading.
        got: f64,
        /// The limit.
        limit: f64,
        /// The unit of both.
        unit: &'static str,
        /// The axis of the base frame.
        axis: &'static str,
        /// When, s after the first sample answered.
        time_s: f64,
    },
    /// A command would be beyond a limit of the scenario; it was not given.
    #[error(
        "limits.{key}: the controller asks for {got} {unit} after {} s, beyond the limit of {limit} {unit}: drive less, look at \
         what the controller reads, or raise the limit", rounded(.time_s, 3), got = rounded(.got, 3), limit = short(.limit)
    )]
    Command {
        /// The limit's key.
        key: &'static str,
        /// The load that the controller asks for.
        got: f64,
        /// The limit.
        limit: f64,
        /// The unit of both.
        unit: &'static str,
        /// When, s after the first sample answered.
        time_s: f64,
    },
    /// An axis stays clipped.
    #[error(
        "limits.clipped_samples: {who} is clipped along {axis} for {samples} {} in a row, up to {} s: drive less, or give it more \
         range (`{range_key}`)", if *samples == 1 { "sample" } else { "samples" }, rounded(.time_s, 3)
    )]
    StaysClipped {
        /// The instrument.
        who: &'static str,
        /// The axis of the base frame.
        axis: &'static str,
        /// How many samples.
        samples: u32,
        /// The key of its range.
        range_key: &'static str,
        /// When, s after the first sample answered.
        time_s: f64,
    },
    /// An axis repeats its reading under load: it is stuck or has dropped out.
    #[error(
        "limits.stuck_samples: {who} says {value} {unit} along {axis} and does not move for {samples} samples under load, up to {} s: fix \
         sensor or cable, or state more samples if the axis has nothing to read", rounded(.time_s, 3), value = short(.value)
    )]
    Stuck {
        /// The instrument.
        who: &'static str,
        /// The reading.
        value: f64,
        /// The unit of the reading.
        unit: &'static str,
        /// The axis of the base frame.
        axis: &'static str,
        /// How many samples.
        samples: u32,
        /// When, s after the first sample answered.
        time_s: f64,
    },
    /// The force of a response has more harmonics than the scenario allows.
    #[error(
        "limits.distortion: harmonics 2 and 3 of the force are {} of its fundamental at {frequency_hz:.4} Hz after {} s, beyond the limit \
         of {limit}: drive less, look at impedance head and exciter, or raise the limit", rounded(.got, 4), rounded(.time_s, 3), limit = short(.limit)
    )]
    Distorted {
        /// The share.
        got: f64,
        /// The limit.
        limit: f64,
        /// Frequency of the response, Hz.
        frequency_hz: f64,
        /// When, s after the first sample answered.
        time_s: f64,
    },
}
