//! Backbone curves by phase quadrature, and nonlinear normal modes (M. Krack, J. Gross, "Harmonic Balance for Nonlinear
//! Vibration Problems", 2019, Ch. 4; for the quadrature M. Peeters, G. Kerschen, J. C. Golinval, "Dynamic testing of
//! nonlinear vibrating structures using nonlinear normal modes", J. Sound Vib. 330 (2011)).
//!
//! At resonance the work of the excitation's first harmonic balances that of the dampers: the mode lags the force by
//! 90°. With the force along p · sin Ωt and b₁ the coefficients of sin Ωt this is φᵀM b₁ = 0, φᵀM x being the
//! coordinate of the linear mode φ. The unknowns are the amplitude A of the excitation and X, the equations are R(X, Ω,
//! A) = 0 and φᵀM b₁ = 0, and Ω is the parameter of the continuation. Without dampers A is zero, and the curve is a
//! family of free motions: a nonlinear normal mode. A then only keeps the system square.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use nalgebra::Vector2;

use super::adapt::{Spectral, adapt};
use super::continuation::{Continuation, ContinuationSettings, Point, System, Work};
use super::fourier::Harmonics;
use super::locate::{FINE, search};
use super::orbit::BranchOptions;
use super::quadrature::beginning;
use super::{AnalysisError, Coordinate, EndedEarly, HarmonicBalance, Oscillator};

/// The equations of phase quadrature: unknowns z = (A/stiffness scale, X), parameter Ω/2π in Hz.
#[derive(Clone, Debug)]
struct Quadrature<O: Oscillator> {
    balance: HarmonicBalance<O>,
    drive: Coordinate<O::Parameter>,
    /// φᵀM, of unit length.
    modal: Vector2<f64>,
}

impl<O: Oscillator> System for Quadrature<O> {
    fn dimension(&self) -> usize {
        self.balance.dimension() + 1
    }

    fn evaluate(&mut self, z: &[f64], lambda: f64, residual: &mut [f64], matrix: &mut [f64]) -> bool {
        let (n, stride) = (self.balance.dimension(), self.balance.dimension() + 2);
        let scale = self.balance.oscillator().stiffness_scale();
        let exists = self.balance.set_coordinate(self.drive, z[0] * scale);
        if !(exists && self.balance.set_coordinate(Coordinate::FrequencyHz, lambda)) {
            return false;
        }
        self.balance.linearise(&z[1..]);
        self.balance.residual(residual);
        self.balance.by_coordinate(self.drive, matrix);
        matrix[..n].iter_mut().for_each(|value| *value *= scale);
        self.balance.jacobian(Harmonics::Integer(self.balance.harmonics()), &mut matrix[stride..], stride);
        self.balance.by_coordinate(Coordinate::FrequencyHz, &mut matrix[(n + 1) * stride..]);
        // b₁ is z[5], z[6]: after A, two constants and two cosines.
        residual[n] = self.modal.x * z[5] + self.modal.y * z[6];
        matrix[5 * stride + n] = self.modal.x;
        matrix[6 * stride + n] = self.modal.y;
        true
    }

    fn unit(&self) -> &'static str {
        self.balance.unit(Coordinate::FrequencyHz)
    }
}

impl<O: Oscillator> Spectral for Quadrature<O> {
    type Oscillator = O;

    fn balance_mut(&mut self) -> &mut HarmonicBalance<O> {
        &mut self.balance
    }

    fn others(&self) -> usize {
        1
    }

    fn set_harmonics(&mut self, harmonics: usize) {
        self.balance.set_harmonics(harmonics);
    }
}

/// A motion on a backbone.
#[derive(Clone, Debug, PartialEq)]
pub struct BackbonePoint {
    /// Ω/2π, Hz.
    pub frequency_hz: f64,
    /// The excitation's amplitude that sustains the motion, in the unit of the drive; zero without dampers.
    pub drive: f64,
    /// The largest |α1| and |α2| over the period, rad.
    pub amplitude_rad: [f64; 2],
    /// √(a² + b²) of the component at Ω of α1 and α2, rad.
    pub harmonic1_rad: [f64; 2],
    /// Fourier coefficients, rad.
    pub coefficients: Vec<f64>,
}

/// How the frequency changes with the amplitude.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bending {
    /// It rises: the response curves lean to higher frequencies (stiff).
    Hardening,
    /// It falls (soft).
    Softening,
    /// It first rises, then falls.
    HardeningThenSoftening,
    /// It first falls, then rises.
    SofteningThenHardening,
    /// It turns more than once.
    Mixed,
}

/// Relative changes of frequency below this are none.
const STILL: f64 = 1e-9;
/// The forced response around a backbone is computed this far beyond it, as a fraction of the change of frequency along
/// it, and at least this fraction of the frequency.
const MARGIN: [f64; 2] = [0.5, 0.002];

impl Bending {
    /// The name in results.
    pub const fn name(self) -> &'static str {
        match self {
            Bending::Hardening => "hardening",
            Bending::Softening => "softening",
            Bending::HardeningThenSoftening => "hardening-then-softening",
            Bending::SofteningThenHardening => "softening-then-hardening",
            Bending::Mixed => "mixed",
        }
    }

    /// How a curve with these frequencies bends; none if they don't change.
    pub(crate) fn of(frequencies_hz: impl Iterator<Item = f64>) -> Option<Bending> {
        let (mut rises, mut before) = (Vec::new(), None::<f64>);
        for hz in frequencies_hz {
            let change = before.map_or(0.0, |before| hz / before - 1.0);
            if change.abs() > STILL {
                rises.push(change > 0.0);
            }
            before = Some(hz);
        }
        rises.dedup();
        Some(match rises.as_slice() {
            [] => return None,
            [true] => Bending::Hardening,
            [false] => Bending::Softening,
            [true, false] => Bending::HardeningThenSoftening,
            [false, true] => Bending::SofteningThenHardening,
            _ => Bending::Mixed,
        })
    }
}

/// The band, Hz, in which the forced response around a curve with these frequencies is of interest.
pub(crate) fn window_hz(frequencies_hz: impl Iterator<Item = f64>) -> [f64; 2] {
    let (low, high) = frequencies_hz.fold((f64::INFINITY, 0.0_f64), |(low, high), hz| (low.min(hz), high.max(hz)));
    let margin = (MARGIN[0] * (high - low)).max(MARGIN[1] * high);
    [low - margin, high + margin]
}

/// df/ds at s = 0 of a curve with points (s, f), s the square of an amplitude.
///
/// f is even in the amplitude. The parabola in s through the first point, one at about ten times its amplitude and one
/// at about thirty (or the last two of a shorter curve) has this slope at s = 0, with an error of the order of s₂s₃ f‴.
pub(crate) fn curvature(points: &[(f64, f64)]) -> Option<f64> {
    let (first, rest) = points.split_first()?;
    let (last, between) = rest.split_last()?;
    let beyond = |times: f64, among: &[(f64, f64)]| {
        among.iter().position(|point| point.0 >= times * times * first.0).unwrap_or(among.len() - 1)
    };
    let second = if between.is_empty() { return None } else { beyond(10.0, between) };
    let third = &rest[second + 1..];
    let third = third.get(beyond(30.0, third)).unwrap_or(last);
    let [(s1, f1), (s2, f2), (s3, f3)] = [*first, between[second], *third];
    // Newton's form: f = f1 + d12 (s − s1) + d123 (s − s1)(s − s2).
    let (d12, d23) = ((f2 - f1) / (s2 - s1), (f3 - f2) / (s3 - s2));
    let slope = d12 - (d23 - d12) / (s3 - s1) * (s1 + s2);
    slope.is_finite().then_some(slope)
}

/// A backbone curve.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Backbone {
    /// Its motions, from small to large.
    pub points: Vec<BackbonePoint>,
    /// The work of the continuation.
    pub work: Work,
}

/// How far a backbone is followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BackboneOptions {
    /// The amplitude of the first point, rad: small against the nonlinearity. If the limit of the drive ends the
    /// continuation at less than ten times this, the curve begins at a tenth of that amplitude.
    pub smallest_rad: f64,
    /// The continuation ends where |α1| or |α2| reaches this, rad.
    pub largest_rad: f64,
    /// Or where the drive reaches this, in its unit.
    pub largest_drive: f64,
    /// Harmonics, points and steps; `from` and `to` bound the frequency, Hz.
    pub branch: BranchOptions,
}

/// A backbone begins at this fraction of its largest amplitude: there the frequency is that of the linear arm to 1e-5
/// of its change.
const SMALLEST_PART: f64 = 1.0 / 300.0;

impl BackboneOptions {
    /// The largest amplitude of use, rad: the links have then turned over.
    pub const LARGEST_RAD: f64 = core::f64::consts::PI;

    /// Up to an amplitude, rad, at any load, from a mode of this natural frequency, Hz, between a tenth of it and ten
    /// times it.
    pub fn new(linear_hz: f64, largest_rad: f64) -> BackboneOptions {
        BackboneOptions {
            smallest_rad: SMALLEST_PART * largest_rad,
            largest_rad,
            largest_drive: f64::INFINITY,
            branch: BranchOptions::new(0.1 * linear_hz, 10.0 * linear_hz),
        }
    }
}

/// The first motion is at most this fraction of the motion at which the drive ends the continuation.
const START_PART: f64 = 0.1;

/// Follows the backbone of a linear mode (0 the slower, 1 the faster) to larger amplitudes. `drive` is the parameter
/// that multiplies the excitation. For the nonlinear normal mode give a system without dampers.
///
/// # Errors
/// [`AnalysisError::NotDriven`] if the excitation can't bring the mode to quadrature; otherwise as [`super::trace`].
pub fn backbone<O: Oscillator>(
    mut oscillator: O,
    mode: usize,
    drive: O::Parameter,
    options: &BackboneOptions,
) -> Result<Backbone, EndedEarly<Backbone>> {
    let reach = options.largest_drive;
    if reach.is_nan() || reach <= 0.0 || !oscillator.set_parameter(drive, 0.0) {
        let (unit, domain) = (oscillator.unit(drive), "the range of the drive");
        return Err(AnalysisError::Interval { from: 0.0, to: reach, unit, domain }.into());
    }
    let beginning = beginning(&oscillator, mode, drive)?;
    let balance = HarmonicBalance::new(oscillator, beginning.frequency_hz, 1, options.branch.least_harmonics);
    let mut system = Quadrature { balance, drive: Coordinate::Parameter(drive), modal: beginning.modal };
    let rest = vec![0.0; system.dimension()];
    let mut tangent = vec![0.0; system.dimension() + 1];
    tangent[0] = beginning.drive / system.balance.oscillator().stiffness_scale();
    tangent[3..5].copy_from_slice(beginning.cosine.as_slice());
    tangent[5..7].copy_from_slice(beginning.sine.as_slice());
    // Without the nonlinearity the continuation would end at this size of the motion.
    let end_rad = options.largest_drive / beginning.drive;
    let continuation = ContinuationSettings {
        state_floor: options.smallest_rad.min(START_PART * end_rad),
        ..options.branch.continuation
    };
    let options = BackboneOptions { branch: BranchOptions { continuation, ..options.branch }, ..*options };
    let mut continuation =
        Continuation::start_along(&mut system, continuation, &rest, beginning.frequency_hz, &tangent, 1.0)?;
    let mut curve = Backbone::default();
    let reason = follow(&mut system, &mut continuation, &options, &mut curve.points).err();
    curve.work = continuation.work();
    match reason {
        None => Ok(curve),
        Some(reason) => Err(EndedEarly { reason, so_far: Box::new(curve) }),
    }
}

/// Continues to where the motion or the drive is large enough, or the frequency outside.
fn follow<O: Oscillator>(
    system: &mut Quadrature<O>,
    continuation: &mut Continuation,
    options: &BackboneOptions,
    points: &mut Vec<BackbonePoint>,
) -> Result<(), AnalysisError> {
    let branch = &options.branch;
    let mut before: Option<(Point, f64)> = None;
    loop {
        adapt(system, continuation, branch)?;
        let here = continuation.point().clone();
        let motion = measure(&mut system.balance, &here.x, here.lambda);
        let over = motion.beyond(options);
        if let Some((last, short)) = before.as_ref().filter(|_| over > 0.0) {
            let test = |system: &mut Quadrature<O>, point: &Point| {
                measure(&mut system.balance, &point.x, point.lambda).beyond(options)
            };
            let end = search(system, &branch.continuation, [last, &here], [*short, over], FINE, test)?;
            points.push(measure(&mut system.balance, &end.x, end.lambda));
            return Ok(());
        }
        points.push(motion);
        if over >= 0.0 || branch.left_at(here.lambda).is_some() {
            return Ok(());
        }
        if points.len() >= branch.most_points {
            return Err(AnalysisError::TooManyPoints { points: points.len(), at: system.place(here.lambda) });
        }
        before = Some((here, over));
        continuation.advance(system)?;
    }
}

impl BackbonePoint {
    /// How far the motion or its drive is beyond the limit of the continuation, relative to it: negative before the
    /// end.
    fn beyond(&self, options: &BackboneOptions) -> f64 {
        let amplitude = self.amplitude_rad[0].max(self.amplitude_rad[1]) / options.largest_rad;
        amplitude.max(self.drive.abs() / options.largest_drive) - 1.0
    }
}

fn measure<O: Oscillator>(balance: &mut HarmonicBalance<O>, z: &[f64], frequency_hz: f64) -> BackbonePoint {
    let x = &z[1..];
    BackbonePoint {
        frequency_hz,
        drive: z[0] * balance.oscillator().stiffness_scale(),
        amplitude_rad: balance.largest_rad(x),
        harmonic1_rad: [0, 1].map(|dof| libm::sqrt(x[2 + dof] * x[2 + dof] + x[4 + dof] * x[4 + dof])),
        coefficients: x.to_vec(),
    }
}

impl Backbone {
    /// The band, Hz, in which the forced response around the curve is of interest.
    pub fn window_hz(&self) -> [f64; 2] {
        window_hz(self.points.iter().map(|point| point.frequency_hz))
    }

    /// The frequency of the last point less that of the first, Hz.
    pub fn shift_hz(&self) -> f64 {
        match (self.points.first(), self.points.last()) {
            (Some(first), Some(last)) => last.frequency_hz - first.frequency_hz,
            _ => 0.0,
        }
    }

    /// df/d(a²) at a = 0, Hz/rad², a being the first harmonic of α1 (joint 0) or α2 (joint 1): positive where the mode
    /// hardens. None if there are fewer than three points or the joint doesn't move.
    pub fn curvature_hz_rad2(&self, joint: usize) -> Option<f64> {
        let squared = |x: f64| x * x;
        let at = |point: &BackbonePoint| (squared(point.harmonic1_rad[joint.min(1)]), point.frequency_hz);
        curvature(&self.points.iter().map(at).collect::<Vec<_>>())
    }

    /// How the curve bends, from the frequencies of its points; none if the frequency doesn't change.
    pub fn bending(&self) -> Option<Bending> {
        Bending::of(self.points.iter().map(|point| point.frequency_hz))
    }
}
