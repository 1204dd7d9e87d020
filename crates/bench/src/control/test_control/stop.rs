//! Reasons for which a test is stopped before its end.

use thiserror::Error;

use resonarm_numeric::number::{rounded, short};

/// Reason for which a controller of a vibration test stops before the end. The drive ramps to zero before the plant is
/// disarmed.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum StopReason {
    /// The loop check saw no response to the drive.
    #[error(
        "the loop check found no response: with {} N rms of noise the control channel reads {} dB above its silence, with a coherence of {}; it must be \
         {} dB and {}: check sensor, cable and exciter, or raise `gain_check_n` in the specification's [limits]",
        short(.drive_n), rounded(.response_db, 1), rounded(.coherence, 2), rounded(.least_db, 1), rounded(.least_coherence, 2)
    )]
    OpenLoop {
        /// Rms of the drive, N.
        drive_n: f64,
        /// Power of the response over that in silence, dB.
        response_db: f64,
        /// Coherence of drive and response.
        coherence: f64,
        /// Least response over the silence that closes the loop, dB.
        least_db: f64,
        /// Least coherence of a response that is not far above the silence.
        least_coherence: f64,
    },
    /// The acceleration at the driving point takes energy out of the structure.
    #[error(
        "the loop check found that the sensor is inverted: by its reading the structure gives {} W of power back to the head, which it can't at the \
         driving point; turn the sensor, or the head, or their sign",
        short(.got_w)
    )]
    Inverted {
        /// Power that the structure gives back by the readings, W.
        got_w: f64,
    },
    /// The control channel reads much less than the drive must cause.
    #[error(
        "the control signal is lost: the control channel reads {} m/s\u{b2} rms, where {} m/s\u{b2} are expected: check sensor and cable",
        short(.got_m_s2), short(.expected_m_s2)
    )]
    Lost {
        /// Rms of the control channel's reading, m/s².
        got_m_s2: f64,
        /// Expected reading, m/s² rms.
        expected_m_s2: f64,
    },
    /// The control channel repeats its reading.
    #[error("the control channel reads exactly {} m/s\u{b2} for {samples} samples: check sensor and cable", short(.got_m_s2))]
    Stuck {
        /// Reading of the control channel, m/s².
        got_m_s2: f64,
        /// Number of equal samples in a row.
        samples: u32,
    },
    /// The control channel is clipped.
    #[error(
        "the control channel is clipped for {samples} samples in a row, or more often than once in {every} samples: reduce the level, or \
         increase the sensor's range"
    )]
    Clipped {
        /// Clipped samples in a row that end the test.
        samples: u32,
        /// Samples of which at most one may be clipped for long.
        every: u32,
    },
    /// The control channel reads much more than the test asks for.
    #[error(
        "the control channel reads {} m/s\u{b2}, where the level is {} m/s\u{b2} and the test ends beyond {} m/s\u{b2}",
        short(.got_m_s2), short(.expected_m_s2), short(.limit_m_s2)
    )]
    TooHigh {
        /// Reading, m/s²: rms of a random test, amplitude of a sine, peak of a shock.
        got_m_s2: f64,
        /// Level of the test, m/s².
        expected_m_s2: f64,
        /// Largest reading at which the test goes on, m/s².
        limit_m_s2: f64,
    },
    /// Too many lines are beyond the deviation at which the test ends.
    #[error(
        "{} % of the lines are beyond `abort_db`, more than the {} % of `abort_share`",
        rounded(&(100.0 * .share), 1), rounded(&(100.0 * .limit), 1)
    )]
    Lines {
        /// Share of the lines.
        share: f64,
        /// Largest share at which the test goes on.
        limit: f64,
    },
    /// The level needs more force than is allowed.
    #[error(
        "the level needs a drive of {} N at its peaks, more than the limit of {} N: lower the level, or raise `control.amplitude` and \
         `drive_peak_n` if the exciter has more",
        short(.needed_n), short(.limit_n)
    )]
    Drive {
        /// Peak that the level needs, N.
        needed_n: f64,
        /// Limit of the drive's magnitude, N.
        limit_n: f64,
    },
    /// The operator has stopped the test.
    #[error("the operator has stopped the test")]
    Operator,
    /// Samples were lost while a shot was played.
    #[error("{samples} samples were lost within a shot, which is no longer what was specified")]
    SamplesLost {
        /// Number of lost samples.
        samples: u64,
    },
}
