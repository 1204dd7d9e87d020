//! The controller's prior model of the arm: one mode, as seen by the drive and a pair of accelerometers.

use core::f64::consts::TAU;

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::excitation::Phasor;
use crate::rig::{Measurement, Reading};
use resonarm_analysis::modes;
use resonarm_dynamics::arm::{Arm, Load};

/// A mode of the arm, by its number: the lower frequency is the first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "u8", into = "u8")]
pub enum ModeNumber {
    /// Mode 1.
    #[default]
    First,
    /// Mode 2.
    Second,
}

impl From<ModeNumber> for u8 {
    fn from(mode: ModeNumber) -> u8 {
        match mode {
            ModeNumber::First => 1,
            ModeNumber::Second => 2,
        }
    }
}

impl TryFrom<u8> for ModeNumber {
    type Error = NoSuchMode;

    fn try_from(got: u8) -> Result<ModeNumber, NoSuchMode> {
        match got {
            1 => Ok(ModeNumber::First),
            2 => Ok(ModeNumber::Second),
            _ => Err(NoSuchMode { got }),
        }
    }
}

/// The arm does not have this mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("mode {got}: the arm has modes 1 and 2")]
pub struct NoSuchMode {
    /// The given number.
    pub got: u8,
}

/// The link whose angle a controller follows, by the accelerometer at its end minus that at its start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Link {
    /// α1, from B.
    First,
    /// α1 + α2, from C minus B.
    Second,
}

/// One natural mode as seen by the drive: with s the angle of the followed link and u the load,
/// m (s̈ + 2ζω₀ ṡ + ω₀² s) = u.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModeModel {
    /// ω₀, rad/s.
    pub angular_frequency_rad_s: f64,
    /// ζ.
    pub damping_ratio: f64,
    /// m, in the load's unit per rad/s², positive: the sign of the angle is chosen so that it has the sign of the load.
    pub modal_mass: f64,
    /// ω of the arm's other mode, rad/s.
    pub other_angular_frequency_rad_s: f64,
    /// ζ of the other mode.
    pub other_damping_ratio: f64,
    /// m of the other mode for the same drive and angle.
    pub other_modal_mass: f64,
    /// The followed link.
    pub link: Link,
    /// s̈ = direction · (difference of accelerations), 1/m.
    direction: Vector2<f64>,
}

impl ModeModel {
    /// The mode `mode` of `arm` as driven by multiples of `unit`.
    ///
    /// With the shape φ of unit modal mass, the generalised load d = u + JᵀF of `unit` at rest and c = (1, 0) or (1, 1)
    /// for the followed link, s = c·φ q and q̈ + 2ζω₀ q̇ + ω₀² q = φ·d u, so m = 1/((c·φ)(φ·d)). Link 1 is followed
    /// unless it moves less than a fifth of link 2: the accelerometer at B has the most range left.
    pub fn new(arm: &Arm, unit: &Load, mode: ModeNumber) -> ModeModel {
        const FAINT: f64 = 0.2;
        let both = modes(arm);
        let (this, other) = match mode {
            ModeNumber::First => (both[0], both[1]),
            ModeNumber::Second => (both[1], both[0]),
        };
        let drive = unit.torque_nm + arm.tip_jacobian(&Vector2::zeros()).tr_mul(&unit.force_n);
        let first_is_faint = this.shape[0].abs() < FAINT * (this.shape[0] + this.shape[1]).abs();
        let link = if first_is_faint { Link::Second } else { Link::First };
        let mass = |shape: [f64; 2]| {
            let angle = match link {
                Link::First => shape[0],
                Link::Second => shape[0] + shape[1],
            };
            1.0 / (angle * Vector2::from(shape).dot(&drive))
        };
        // Load and angle of opposite sign: the sign of the angle is reversed.
        let sign = mass(this.shape).signum();
        let points = arm.points(&Vector2::zeros());
        // The link r turns with s̈ (−r_y, r_x), so s̈ = (−r_y, r_x)·a / r².
        let r = match link {
            Link::First => points.b_m,
            Link::Second => points.c_m - points.b_m,
        };
        ModeModel {
            angular_frequency_rad_s: TAU * this.frequency_hz,
            damping_ratio: this.damping_ratio,
            modal_mass: sign * mass(this.shape),
            other_angular_frequency_rad_s: TAU * other.frequency_hz,
            other_damping_ratio: other.damping_ratio,
            other_modal_mass: sign * mass(other.shape),
            link,
            direction: Vector2::new(-r.y, r.x) * (sign / r.norm_squared()),
        }
    }

    /// s̈ of the followed link from the accelerometers, rad/s², for small vibration: across the link at rest, of sin s.
    pub fn angular_acceleration_rad_s2(&self, sample: &Measurement) -> f64 {
        let b = Vector2::from(sample.acceleration_b_m_s2.map(|reading| reading.value));
        let across = match self.link {
            Link::First => b,
            Link::Second => Vector2::from(sample.acceleration_c_m_s2.map(|reading| reading.value)) - b,
        };
        self.direction.dot(&across)
    }

    /// The same s̈ from the phasors of the accelerations of B and C along x and y.
    pub fn across(&self, [b, c]: [[Phasor; 2]; 2]) -> Phasor {
        let of = |p: [Phasor; 2]| p[0] * self.direction.x + p[1] * self.direction.y;
        match self.link {
            Link::First => of(b),
            Link::Second => of(c) - of(b),
        }
    }

    /// Standard deviation of s̈, rad/s², from those of the accelerations of B and C along x and y.
    pub fn deviation(&self, [b, c]: [[f64; 2]; 2]) -> f64 {
        let of = |p: [f64; 2]| libm::hypot(p[0] * self.direction.x, p[1] * self.direction.y);
        match self.link {
            Link::First => of(b),
            Link::Second => libm::hypot(of(b), of(c)),
        }
    }

    /// Whether a reading that the followed angle depends on was clipped.
    pub fn is_clipped(&self, sample: &Measurement) -> bool {
        let clipped = |pair: [Reading; 2]| pair.iter().any(|reading| reading.clipped);
        clipped(sample.acceleration_b_m_s2) || (self.link == Link::Second && clipped(sample.acceleration_c_m_s2))
    }
}
