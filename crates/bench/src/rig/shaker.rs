//! An electrodynamic shaker, bolted to the tip through the impedance head and pushing along one direction.
//!
//! The armature, of mass m on a suspension k, c, moves with the tip by s along the direction; the coil pushes it by
//! Bl·i. The rest of this force shakes the arm, and the head reads it (G. F. Lang, "Electrodynamic Shaker
//! Fundamentals", Sound and Vibration, 1997):
//!
//! ```text
//! H = Bl·i − m s̈ − c ṡ − k s
//! L di/dt + R i + Bl ṡ = V
//! ```
//!
//! Near a resonance m s̈ takes most of Bl·i, and H drops out. A command is the force of the blocked shaker: F = Bl·i
//! with an amplifier in current mode, which holds the current whatever the armature does, and F = Bl·V/R in voltage
//! mode, where the current follows from the coil and its back-electromotive force.

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use super::error::RigError;
use super::load::Load;
use super::name::Section;

/// Largest force across the shaker that counts as rounding: two counts of the protocol, N, and, in the next
/// constant, a share of the force, for sines and cosines that were rounded by hand.
const ACROSS_N: f64 = 0.04;
const ACROSS_SHARE: f64 = 1e-3;

/// Quantity that the amplifier holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Amplifier {
    /// The current: a command F is the current F/Bl.
    #[default]
    Current,
    /// The voltage: a command F is the voltage F·R/Bl.
    Voltage,
}

/// An electrodynamic shaker with its amplifier, as a scenario states it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShakerSpec {
    /// Direction in which it pushes the tip, relative to the x axis of the base frame, degrees.
    #[serde(default)]
    pub direction_deg: f64,
    /// Quantity that the amplifier holds.
    #[serde(default)]
    pub amplifier: Amplifier,
    /// Mass of the armature, with the stinger and attached parts, kg, not negative.
    pub moving_mass_kg: f64,
    /// Stiffness of the suspension, N/m, not negative.
    pub stiffness_n_m: f64,
    /// Viscous damping of the suspension, N·s/m, not negative.
    pub damping_n_s_m: f64,
    /// Force factor Bl, N/A, positive.
    pub force_factor_n_a: f64,
    /// Resistance R of the coil, Ω, positive.
    pub resistance_ohm: f64,
    /// Inductance L of the coil, H, not negative.
    pub inductance_h: f64,
    /// Largest displacement of the armature from rest, m, positive.
    pub stroke_m: f64,
    /// Largest current, A, positive.
    pub current_limit_a: f64,
    /// Largest voltage of the amplifier, V, positive.
    pub voltage_limit_v: f64,
}

/// Limits that trip the amplifier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShakerLimit {
    /// The displacement of the armature.
    Stroke,
    /// The current in the coil.
    Current,
    /// The voltage that the amplifier would need.
    Voltage,
}

impl ShakerLimit {
    /// Returns description, unit, and key of the limit in a scenario.
    pub const fn names(self) -> [&'static str; 3] {
        match self {
            ShakerLimit::Stroke => ["armature's displacement", "m", "stroke_m"],
            ShakerLimit::Current => ["current", "A", "current_limit_a"],
            ShakerLimit::Voltage => ["amplifier's voltage", "V", "voltage_limit_v"],
        }
    }
}

impl ShakerSpec {
    pub(super) fn check(&self) -> Result<(), RigError> {
        let spec = |name, got, expected| Err(RigError::Spec { section: Section::Rig("shaker"), name, got, expected });
        if !(-360.0..=360.0).contains(&self.direction_deg) {
            return spec("direction_deg", self.direction_deg, "from -360 to 360 degrees");
        }
        let not_negative = [
            ("moving_mass_kg", self.moving_mass_kg),
            ("stiffness_n_m", self.stiffness_n_m),
            ("damping_n_s_m", self.damping_n_s_m),
            ("inductance_h", self.inductance_h),
        ];
        for (name, got) in not_negative {
            if !(got.is_finite() && got >= 0.0) {
                return spec(name, got, "zero or a positive number");
            }
        }
        let positive = [
            ("force_factor_n_a", self.force_factor_n_a),
            ("resistance_ohm", self.resistance_ohm),
            ("stroke_m", self.stroke_m),
            ("current_limit_a", self.current_limit_a),
            ("voltage_limit_v", self.voltage_limit_v),
        ];
        for (name, got) in positive {
            if !(got.is_finite() && got > 0.0) {
                return spec(name, got, "a positive number");
            }
        }
        Ok(())
    }

    /// Returns the unit vector in which it pushes.
    pub fn direction(&self) -> Vector2<f64> {
        let (sine, cosine) = libm::sincos(self.direction_deg.to_radians());
        Vector2::new(cosine, sine)
    }

    /// Returns the largest force of the blocked shaker, N: Bl times the largest current, and at most Bl/R times
    /// the largest voltage.
    pub fn force_limit_n(&self) -> f64 {
        // The blocked coil needs V = R i, so the voltage limits the current at rest in both modes.
        let by_voltage_a = self.voltage_limit_v / self.resistance_ohm;
        self.force_factor_n_a * self.current_limit_a.min(by_voltage_a)
    }

    /// Returns the part of a command along the shaker, N.
    pub fn along_n(&self, load: &Load) -> f64 {
        self.direction().dot(&load.force_n.xy())
    }

    /// Returns whether a load points along the shaker, up to rounding.
    pub fn is_along(&self, load: &Load) -> bool {
        let direction = self.direction();
        // The cross product with the unit vector is the component across.
        let across_n = direction.x * load.force_n.y - direction.y * load.force_n.x;
        let rounding_n = ACROSS_N + ACROSS_SHARE * load.force_n.norm();
        across_n.abs() <= rounding_n && load.force_n.z == 0.0 && load.torque_nm.amax() == 0.0
    }

    /// Returns whether a command is within the limits of amplifier and direction.
    pub fn can_produce(&self, load: &Load) -> bool {
        self.is_along(load) && self.along_n(load).abs() <= self.force_limit_n()
    }

    /// Returns the first limit that is exceeded at a current, a displacement and a velocity of the armature,
    /// with the value and the limit. In current mode the amplifier needs R i + Bl ṡ; the voltage that a step of
    /// the current needs across L is not counted.
    pub fn exceeded(
        &self,
        current_a: f64,
        (displacement_m, velocity_m_s): (f64, f64),
    ) -> Option<(ShakerLimit, f64, f64)> {
        // In voltage mode a command is limited to the voltage limit before it acts, so only the current mode
        // needs a check.
        let needed_v = match self.amplifier {
            Amplifier::Current => self.resistance_ohm * current_a + self.force_factor_n_a * velocity_m_s,
            Amplifier::Voltage => 0.0,
        };
        let all = [
            (ShakerLimit::Stroke, displacement_m, self.stroke_m),
            (ShakerLimit::Current, current_a, self.current_limit_a),
            (ShakerLimit::Voltage, needed_v, self.voltage_limit_v),
        ];
        // NaN counts as exceeded: a diverged simulation must trip.
        let beyond = |(_, got, limit): &(ShakerLimit, f64, f64)| got.is_nan() || got.abs() > *limit;
        all.into_iter().find(beyond).map(|(which, got, limit)| (which, got.abs(), limit))
    }
}
