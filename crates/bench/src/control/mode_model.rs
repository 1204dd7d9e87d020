//! The controller's prior model of the structure: one mode, as seen by the drive and by a pair of
//! accelerometers.

use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::excitation::Phasor;
use crate::plant::{Placed, ShakerAcross, TestedAssembly};
use crate::rig::{Load, Measurement, Reading, RigSpec, SensorSpec};
use resonarm_dynamics::structure::{Armature, Dof, MOST_COORDINATES};

/// Ratio of the two accelerometers' motions below which the weaker one is not followed.
const FAINT: f64 = 0.2;

/// Share of an accelerometer's range that the fundamental may use; the rest is for harmonics and other modes.
const USABLE: f64 = 0.8;

/// The structure as a controller models it.
#[derive(Clone, Copy, Debug)]
pub struct Modelled<'a> {
    /// Structure under test with the places of the rig.
    pub tested: &'a TestedAssembly,
    /// Armature of the shaker, if a shaker drives the structure.
    pub armature: Option<Armature>,
    /// Largest accelerations that the accelerometers at B and C can read, m/s².
    pub ranges_m_s2: [f64; 2],
    /// Whether the accelerometer C is where the exciter acts.
    pub c_is_driven: bool,
}

impl<'a> Modelled<'a> {
    /// Returns the model of the structure under a rig.
    ///
    /// # Errors
    /// [`ShakerAcross`] if the rig's shaker pushes along an axis along which the structure can't move there.
    pub fn new(tested: &'a TestedAssembly, rig: &RigSpec) -> Result<Modelled<'a>, ShakerAcross> {
        let armature = rig.shaker.map(|shaker| shaker.armature_at(&tested.places.exciter)).transpose()?;
        let ranges_m_s2 = [&rig.sensors.b, &rig.sensors.c].map(SensorSpec::largest_reading);
        Ok(Modelled { tested, armature, ranges_m_s2, c_is_driven: rig.c_is_driven() })
    }

    /// Returns the share of the exciter's force that enters the structure far above its natural frequencies.
    pub(super) fn high_frequency_force_share(&self) -> f64 {
        let assembly = &self.tested.assembly;
        self.armature.as_ref().map_or(1.0, |armature| armature.high_frequency_force_share(assembly))
    }
}

/// Number of a mode, from 1, in the order of the natural frequencies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "u8", into = "u8")]
pub struct ModeNumber(u8);

impl ModeNumber {
    /// Mode 1, of the lowest frequency.
    pub const FIRST: ModeNumber = ModeNumber(1);
    /// Mode 2, of the second lowest frequency.
    pub const SECOND: ModeNumber = ModeNumber(2);

    /// Returns the index of the mode, from 0.
    pub fn index(self) -> usize {
        usize::from(self.0) - 1
    }
}

impl Default for ModeNumber {
    fn default() -> ModeNumber {
        ModeNumber::FIRST
    }
}

impl From<ModeNumber> for u8 {
    fn from(mode: ModeNumber) -> u8 {
        mode.0
    }
}

impl TryFrom<u8> for ModeNumber {
    type Error = NoSuchMode;

    fn try_from(got: u8) -> Result<ModeNumber, NoSuchMode> {
        let exists = (1..=MOST_COORDINATES).contains(&usize::from(got));
        if exists { Ok(ModeNumber(got)) } else { Err(NoSuchMode::Number { got, modes: MOST_COORDINATES }) }
    }
}

/// Reason why a controller can't work on a mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum NoSuchMode {
    /// The structure has fewer modes.
    #[error("there is no mode {got}: the structure has modes 1 to {modes}")]
    Number {
        /// Number of the mode that was given.
        got: u8,
        /// Number of modes that there are, or can be.
        modes: usize,
    },
    /// The mode is rigid, at 0 Hz, or overdamped.
    #[error("mode {got} does not oscillate: it is rigid, at 0 Hz, or overdamped; choose a mode that has a resonance")]
    NoResonance {
        /// Number of the mode that was given.
        got: u8,
    },
}

/// Accelerometer whose displacement a controller follows, along one direction, m.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Followed {
    /// The displacement of B.
    PointB,
    /// The displacement of C.
    PointC,
}

impl Followed {
    /// Returns whether the readings of B and of C are used.
    pub fn takes(self) -> [bool; 2] {
        [self == Followed::PointB, self == Followed::PointC]
    }

    /// Returns the element that belongs to the followed accelerometer.
    fn of<T>(self, [b, c]: [T; 2]) -> T {
        match self {
            Followed::PointB => b,
            Followed::PointC => c,
        }
    }
}

/// A mode as seen by the drive: m (s̈ + 2ζω₀ ṡ + ω₀² s) = u with the followed coordinate s and the load u.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SeenMode {
    /// Undamped angular frequency ω₀, rad/s.
    pub angular_frequency_rad_s: f64,
    /// Damping ratio ζ, dimensionless.
    pub damping_ratio: f64,
    /// Modal mass m, in the load's unit over that of s̈; infinite if the load does not drive the mode, or s
    /// does not show it.
    pub modal_mass: f64,
}

/// Largest number of modes in addition to the followed one.
const MOST_OTHERS: usize = MOST_COORDINATES - 1;

/// The mode that is controlled as seen by the drive, together with the other modes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModeModel {
    /// The controlled mode, with a positive modal mass: the followed coordinate is chosen to have the sign of
    /// the load.
    pub mode: SeenMode,
    others: [SeenMode; MOST_OTHERS],
    count: usize,
    /// Accelerometer that is followed.
    pub followed: Followed,
    /// Direction in s̈ = direction · acceleration of the point.
    direction: Vector2<f64>,
}

impl ModeModel {
    /// Builds the model of the mode with this number, without an armature, as driven by multiples of `unit`.
    ///
    /// With the shape φ of unit modal mass and the directions w = ∂x/∂q of the loads and of the accelerometers'
    /// axes at rest, the loads give φ·d with d = Σ w u, and a point moves by (w_x·φ, w_y·φ) q. With e the unit
    /// direction of the followed point's motion in the mode, every mode has m = 1/((e·(w·φ))(φ·d)).
    ///
    /// C is followed, or B where C moves less than a fifth as far: the noise of C would then be more than five
    /// times as large a part of its reading. But a clipped reading ends a walk. So B is followed where the
    /// range of C is too small for the largest response, that at resonance under multiples of `unit` up to
    /// `largest`, and B uses less of its own range. With ζ of the mode, which no spring changes, |ẍ| = |w·φ|
    /// (φ·d) `largest`/2ζ. B is not always preferred for its room, since the farther point shows the mode more
    /// clearly next to the others.
    ///
    /// # Errors
    /// [`NoSuchMode`] if the structure has fewer modes, or this one has no resonance.
    pub fn new(of: &Modelled<'_>, unit: &Load, largest: f64, mode: ModeNumber) -> Result<ModeModel, NoSuchMode> {
        let tested = of.tested;
        let assembly = &tested.assembly;
        let all = assembly.modes();
        let Some(this) = all.get(mode.index()) else {
            return Err(NoSuchMode::Number { got: mode.into(), modes: all.len() });
        };
        // Such a mode has no resonance, at which the lag passes 90°, and nothing to walk through.
        if this.frequency_hz == 0.0 || this.damping_ratio >= 1.0 {
            return Err(NoSuchMode::NoResonance { got: mode.into() });
        }
        let by_mode = |shape: &[f64], dof: Option<Dof>| {
            let mut direction = [0.0; MOST_COORDINATES];
            if let Some(dof) = dof {
                assembly.at(&[0.0; MOST_COORDINATES][..shape.len()]).direction(dof, &mut direction);
            }
            shape.iter().zip(direction).map(|(shape, along)| shape * along).sum::<f64>()
        };
        let motion = |shape: &[f64], placed: &Placed| Vector2::from(placed.along.map(|dof| by_mode(shape, dof)));
        let driven = |shape: &[f64]| {
            let acting = unit.parts().into_iter().zip(tested.loaded()).filter(|(part, _)| *part != 0.0);
            acting.map(|(part, dof)| part * by_mode(shape, dof)).sum::<f64>()
        };
        let places = [&tested.places.accelerometer_b, &tested.places.accelerometer_c];
        let [b, c] = places.map(|placed| motion(&this.shape, placed));
        let [size_b, size_c] = [b.norm(), c.norm()];
        let [range_b, range_c] = of.ranges_m_s2;
        // The response at resonance under the largest load: the worst case for the range of the accelerometer.
        let acceleration_c = size_c * (driven(&this.shape) * largest / (2.0 * this.damping_ratio)).abs();
        // Range decides only if C would clip. See the function's documentation for the reasons.
        let c_clips = acceleration_c > USABLE * range_c;
        // B must see enough of the mode, and use a smaller part of its own range.
        let b_has_more_room = size_b >= FAINT * size_c && size_b / range_b < size_c / range_c;
        let follows_b = size_c < FAINT * size_b || (c_clips && b_has_more_room);
        let (followed, at, e) = match follows_b {
            true => (Followed::PointB, places[0], b / size_b),
            false => (Followed::PointC, places[1], c / size_c),
        };
        let seen: Vec<SeenMode> = all
            .iter()
            .map(|mode| SeenMode {
                angular_frequency_rad_s: TAU * mode.frequency_hz,
                damping_ratio: mode.damping_ratio,
                modal_mass: 1.0 / (e.dot(&motion(&mode.shape, at)) * driven(&mode.shape)),
            })
            .collect();
        Ok(ModeModel::of(&seen, mode.index(), followed, e))
    }

    /// Builds the model from all modes; the others are sorted by how strongly the load accelerates them.
    fn of(seen: &[SeenMode], index: usize, followed: Followed, direction: Vector2<f64>) -> ModeModel {
        // Load and coordinate of opposite sign make the modal mass negative. Reversing the coordinate makes it
        // positive.
        let sign = seen[index].modal_mass.signum();
        let signed = |mode: &SeenMode| SeenMode { modal_mass: sign * mode.modal_mass, ..*mode };
        let mut others = [SeenMode::default(); MOST_OTHERS];
        let mut count = 0;
        let is_other = |(at, mode): &(usize, &SeenMode)| *at != index && mode.modal_mass.is_finite();
        for (_, mode) in seen.iter().enumerate().filter(is_other) {
            others[count] = signed(mode);
            count += 1;
        }
        // A small modal mass means that the load moves the mode strongly.
        others[..count].sort_by(|a, b| a.modal_mass.abs().total_cmp(&b.modal_mass.abs()));
        ModeModel { mode: signed(&seen[index]), others, count, followed, direction: direction * sign }
    }

    /// Returns the other modes that the load drives and the followed coordinate shows, the most prominent
    /// first.
    pub fn others(&self) -> &[SeenMode] {
        &self.others[..self.count]
    }

    /// Returns the angular frequency of the tone that is modelled in addition to the harmonics, rad/s: that of
    /// the most prominent other mode that is not rigid, or four times the mode's own if there is none.
    pub fn tone_rad_s(&self) -> f64 {
        // Four times the mode's frequency lies above the modelled harmonics, so that the tone takes nothing
        // from them.
        let mut oscillating = self.others().iter().filter(|other| other.angular_frequency_rad_s > 0.0);
        oscillating.next().map_or(4.0 * self.mode.angular_frequency_rad_s, |other| other.angular_frequency_rad_s)
    }

    /// Returns s̈ of the followed displacement from its accelerometer, m/s².
    pub fn acceleration(&self, sample: &Measurement) -> f64 {
        let pair = |readings: [Reading; 2]| Vector2::from(readings.map(|reading| reading.value));
        let points = [pair(sample.acceleration_b_m_s2), pair(sample.acceleration_c_m_s2)];
        self.direction.dot(&self.followed.of(points))
    }

    /// Returns s̈ from the phasors of the accelerations of B and C along x and y.
    pub fn across(&self, points: [[Phasor; 2]; 2]) -> Phasor {
        self.followed.of(points.map(|p| p[0] * self.direction.x + p[1] * self.direction.y))
    }

    /// Returns whether a reading was clipped that the followed coordinate depends on.
    pub fn is_clipped(&self, sample: &Measurement) -> bool {
        let clipped = [sample.acceleration_b_m_s2, sample.acceleration_c_m_s2]
            .map(|pair| pair.iter().any(|reading| reading.clipped));
        self.followed.takes().into_iter().zip(clipped).any(|(takes, clipped)| takes && clipped)
    }
}
