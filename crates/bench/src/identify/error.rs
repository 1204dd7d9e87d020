//! Errors of the identification from recorded readings.

use alloc::string::String;

use resonarm_modal::{Band, ModalError};
use thiserror::Error;

use resonarm_numeric::number::{rounded, short};

/// Reason why a record can't be identified.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum IdentifyError {
    /// The band is not within that of the record.
    #[error("the band is from {} to {} Hz: it must rise, from above 0 to below half the sample rate, {} Hz", short(&.band.from_hz), short(&.band.to_hz), short(.rate_hz))]
    Band {
        /// Band that was given.
        band: Band,
        /// The sample rate, Hz.
        rate_hz: f64,
    },
    /// The record has too few samples for the request.
    #[error("the record has {samples} samples, but at least {least} are needed: record for longer")]
    TooShort {
        /// Number of samples of the record.
        samples: usize,
        /// Least number of samples.
        least: usize,
    },
    /// The impedance head reads nothing but its own noise.
    #[error(
        "the impedance head reads no force beyond its own noise ({noise_n} N): expected an excitation by a force at the head; apply a larger one", noise_n = rounded(.noise_n, 3))]
    NoForce {
        /// Standard deviation of the head's noise, N.
        noise_n: f64,
    },
    /// The force has no energy in the band.
    #[error("the force has no energy from {} to {} Hz: drive the structure there, or name the band that was driven", short(&.0.from_hz), short(&.0.to_hz))]
    NoEnergy(Band),
    /// No accelerometer reads the motion of the structure.
    #[error("no accelerometer reads an acceleration of the structure: place one at a point that moves")]
    NoResponse,
    /// Records of the same excited point have forces along different directions.
    #[error(
        "recording {run}, counted from 0, has a force along another direction at the same point: expected the same direction, or one along another axis"
    )]
    OtherDirection {
        /// Index of the record, from 0.
        run: usize,
    },
    /// A response is zero in the whole band.
    #[error("the response at {at} is zero in the band: check the sensor, or leave it out")]
    Silent {
        /// Degree of freedom of the response.
        at: String,
    },
    /// A force has no power in the band.
    #[error("the force at {at} has no power in the band: drive the structure there, or name the band that was driven")]
    NoPower {
        /// Degree of freedom of the force.
        at: String,
    },
    /// The estimator rejects the readings.
    #[error(transparent)]
    Modal(#[from] ModalError),
    /// There is no resonance.
    #[error("there is no resonance from {} to {} Hz: widen the band, or record for longer", short(&.0.from_hz), short(&.0.to_hz))]
    NoResonance(Band),
    /// Some readings are beyond the range of their sensor.
    #[error(
        "{samples} samples have a reading beyond the range of its sensor: reduce the force, or increase the sensor's range"
    )]
    Clipped {
        /// Number of samples with such a reading.
        samples: usize,
    },
    /// A segment or period is longer than the record, or too short.
    #[error("a segment has {segment} samples: it must have from 16 to as many as the record, {samples}")]
    Segment {
        /// Number of samples of the segment.
        segment: usize,
        /// Number of samples of the record.
        samples: usize,
    },
    /// The lower corner of a double integration is not valid.
    #[error("the lower corner is {from_hz} Hz: it must be above 0 and below half the sample rate, {rate_hz} Hz", from_hz = short(.from_hz), rate_hz = short(.rate_hz))]
    Corner {
        /// Corner that was given, Hz.
        from_hz: f64,
        /// The sample rate, Hz.
        rate_hz: f64,
    },
    /// The record ends before a double integration has settled.
    #[error("the record has {samples} samples, but at least {least} are needed for angles from {from_hz} Hz on: record for longer, or raise the lower corner", least = rounded(.least, 0), from_hz = rounded(.from_hz, 3))]
    NoMiddle {
        /// Number of samples of the record.
        samples: usize,
        /// Least number of samples.
        least: f64,
        /// Corner that was given, Hz.
        from_hz: f64,
    },
    /// A reading is not a finite number.
    #[error(
        "reading {reading}, counted from 0, has an acceleration that is not a finite number: correct the record, or leave the reading out"
    )]
    NotFinite {
        /// Index of the reading, from 0.
        reading: usize,
    },
    /// The angles are too large for the inverse kinematics.
    #[error("the displacements give angles of up to {angle_rad} rad: a vibration of the arm must have at most {most_rad} rad; check the readings, or raise the lower corner", angle_rad = rounded(.angle_rad, 3), most_rad = short(.most_rad))]
    TooLarge {
        /// The largest angle, rad.
        angle_rad: f64,
        /// Largest angle that is allowed, rad.
        most_rad: f64,
    },
}
