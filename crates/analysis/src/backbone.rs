//! Backbones by phase quadrature, and nonlinear normal modes (M. Krack, J. Gross, "Harmonic Balance for Nonlinear
//! Vibration Problems", 2019, Ch. 4; for the quadrature M. Peeters, G. Kerschen, J. C. Golinval, "Dynamic testing of
//! nonlinear vibrating structures using nonlinear normal modes", J. Sound Vib. 330 (2011)).
//!
//! At resonance the work of the excitation's first harmonic balances that of the dampers: the mode lags the force by
//! 90°. With the force along p · sin Ωt and b₁ the coefficients of sin Ωt this is φᵀM b₁ = 0, φᵀM x being the
//! coordinate of the linear mode φ. The unknowns are the amplitude A of the excitation and X, the equations are R(X, Ω,
//! A) = 0 and φᵀM b₁ = 0, and Ω is the parameter of the continuation.
//!
//! The unknowns are z = (A/a₀, X) of a chain, with φᵀM b₁ = 0 beside the balance, and (A/a₀, c, X) of modes: there the
//! first harmonic c cos Ωt of the mode is an unknown of its own, without a part along sin Ωt, with its own balance (see
//! [`super::unknowns`]). a₀ is the drive whose static deflection, of modes that of the mode, has the size 1.
//!
//! Without dampers the curve is a family of free periodic orbits: a nonlinear normal mode. A free vibration that is at
//! rest at an instant runs backwards as it came, so that with this instant at t = 0 it has cosines alone. The unknowns are
//! then these, X = (cosines) of a chain and (c, cosines) of modes, and the equations the cosines' rows: no drive, and no
//! condition for the phase, which would lose its hold where the first harmonic vanishes, as it does in the tongues of
//! internal resonances (G. Kerschen, M. Peeters, J. C. Golinval, A. F. Vakakis, "Nonlinear normal modes, Part I", Mech.
//! Syst. Signal Process. 23 (2009)).

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::Complex;
use resonarm_dynamics::structure::{Assembly, BodySpec, Dof, StructureMode};

use super::adapt::{Spectral, adapt};
use super::balance::{Balance, unit_deflection};
use super::branch;
use super::linear::dynamic_stiffness_solve;
use super::orbit::Reading;
use super::trace_options::TraceOptions;
use super::unknowns::{Body, Kept};
use crate::bending::Bending;
use crate::branch_options::BranchOptions;
use crate::continuation::{Continuation, ContinuationSettings, Point, System, Work};
use crate::dense::norm;
use crate::error::{AnalysisError, EndedEarly, Place};
use crate::forced::{Coordinate, Forced};
use crate::search::{FINE, search};

/// Bisections of the bandwidth of a mode: 2⁻⁵² of 2ζω.
const BISECTIONS: usize = 52;
/// A backbone begins at this fraction of its end.
const SMALLEST_PART: f64 = 1.0 / 300.0;
/// If that is too large to solve for, it begins with smaller vibrations, down to this fraction of it.
const SMALLEST_START: f64 = 1e-6;

/// The forced response around a backbone is computed this far beyond it, as a fraction of the change of frequency along
/// it, and at least this fraction of the frequency.
const MARGIN: [f64; 2] = [0.5, 0.002];

/// A periodic response on a backbone.
#[derive(Clone, Debug, PartialEq)]
pub struct BackboneOrbit {
    /// Frequency of the response, Hz.
    pub frequency_hz: f64,
    /// The drive's peak that sustains the response, N, or N·m at a joint; zero without damping.
    pub drive: f64,
    /// The coordinates, rad of a chain, m·√kg of modes.
    pub coordinates: Vec<Reading>,
    /// The response at each degree of freedom that is read.
    pub readings: Vec<Reading>,
    /// The energy of motion, springs and elements, which without damping is constant, J; `None` with damping.
    pub energy_j: Option<f64>,
    /// Number of harmonics, H.
    pub harmonics: usize,
}

/// A backbone: the periodic responses at the resonance of one mode, from small to large amplitudes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Backbone {
    /// Its periodic responses, from small to large.
    pub points: Vec<BackboneOrbit>,
    /// The work of the continuation.
    pub work: Work,
}

/// The options with which a backbone is followed, and where it ends.
#[derive(Clone, Debug, PartialEq)]
pub struct BackboneOptions {
    /// The linear mode in which the backbone begins, numbered from 0 in the order of frequency.
    pub mode: usize,
    /// The backbone ends where the first degree of freedom that is read reaches this, m, or rad at a joint, positive.
    pub largest: f64,
    /// The backbone ends where the drive reaches this, N, or N·m at a joint, positive. One of the two limits must be
    /// finite.
    pub largest_drive: f64,
    /// Degrees of freedom at which the response is read, at least one.
    pub read: Vec<Dof>,
    /// Harmonics, points and steps; `from` and `to` bound the frequency, Hz.
    pub branch: BranchOptions,
}

impl BackboneOptions {
    /// Usual options for the backbone of a mode, numbered from 0: between a tenth of its natural frequency and ten
    /// times it.
    pub fn new(forced: &Forced, mode: usize, largest: f64, largest_drive: f64, read: Vec<Dof>) -> BackboneOptions {
        let linear_hz = forced.assembly.modes().get(mode).map_or(f64::NAN, |mode| mode.frequency_hz);
        let ends = [0.1 * linear_hz, 10.0 * linear_hz];
        let mut branch = TraceOptions::new(forced, Coordinate::FrequencyHz, ends, vec![]).branch;
        // The harmonics of a smooth backbone grow without bound where it approaches another mode.
        branch.ends_if_truncated = forced.assembly.is_smooth();
        BackboneOptions { mode, largest, largest_drive, read, branch }
    }
}

/// A small vibration in quadrature under the drive 1.
struct Beginning {
    frequency_hz: f64,
    /// The coordinates' components along cos Ωt and sin Ωt.
    cosine: Vec<f64>,
    sine: Vec<f64>,
    /// The drive; 0 without damping.
    drive: f64,
}

impl Beginning {
    /// Returns the mode's small vibration about rest at which its modal coordinate is 90° behind the drive.
    ///
    /// About rest, M ẍ + G ẋ + S x = A p sin Ωt has the response x = A (Im h cos Ωt + Re h sin Ωt), h = (S + iΩG − Ω²M)⁻¹
    /// p. A mode φ is in quadrature where its modal coordinate φᵀM x is, φᵀM Re h = 0. Without the coupling of the modes by
    /// the dampers
    ///
    /// ```text
    /// φᵀM h = φᵀp / (ω² − Ω² + 2iζωΩ)        Re: zero at Ω = ω
    /// ```
    ///
    /// whatever else the excitation moves (at the point where it acts, the other mode can be most of the vibration).
    /// The real part has its extremes at ω (1 ∓ ζ), up to ζ², the half-power points. With that coupling the zero is
    /// still between them, unless the excitation drives the other mode so much more that the mode responds to the
    /// dampers rather than to the excitation.
    fn new(forced: &Forced, mode: &StructureMode, weights: &[f64]) -> Option<Beginning> {
        let linear = forced.assembly.linear();
        let direction = forced.direction_at_rest();
        let along = |weights: &[f64], of: &[f64]| -> f64 { weights.iter().zip(of).map(|(w, x)| w * x).sum() };
        let modal_force = along(&mode.shape, &direction);
        // A drive that does no work on the mode has no quadrature with it.
        if modal_force == 0.0 {
            return None;
        }
        // Without dampers the linear response at ω is infinite, and the mode itself is the direction: −φ cos Ωt is 90°
        // behind sin Ωt.
        if linear.damping.iter().all(|d| *d == 0.0) {
            let cosine = mode.shape.iter().map(|x| -x).collect();
            let sine = vec![0.0; mode.shape.len()];
            return Some(Beginning { frequency_hz: mode.frequency_hz, cosine, sine, drive: 0.0 });
        }
        let response = |rate_rad_s: f64| {
            let mut response: Vec<Complex<f64>> = direction.iter().map(|&p| Complex::new(p, 0.0)).collect();
            dynamic_stiffness_solve(&linear, rate_rad_s, &mut response).map(|()| response)
        };
        let in_phase = |rate_rad_s: f64| {
            let real: Vec<f64> = response(rate_rad_s)?.iter().map(|x| x.re).collect();
            Some(along(weights, &real) * modal_force.signum())
        };
        let omega = TAU * mode.frequency_hz;
        let [mut low, mut high] = [-1.0, 1.0].map(|side| omega * (1.0 + side * mode.damping_ratio));
        // The part in phase is positive below the resonance and negative above it. Bisection needs that change of sign.
        if !(in_phase(low)? > 0.0 && in_phase(high)? < 0.0) {
            return None;
        }
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if in_phase(middle)? > 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        let rate_rad_s = 0.5 * (low + high);
        let in_quadrature = response(rate_rad_s)?;
        let part = |of: fn(&Complex<f64>) -> f64| in_quadrature.iter().map(of).collect::<Vec<f64>>();
        Some(Beginning { frequency_hz: rate_rad_s / TAU, cosine: part(|x| x.im), sine: part(|x| x.re), drive: 1.0 })
    }
}

/// The equations of phase quadrature, with Ω/2π in Hz as parameter.
#[derive(Clone, Debug)]
struct Quadrature {
    balance: Balance,
    /// a₀, N or N·m.
    drive_unit: f64,
    /// φᵀM, of unit length.
    weights: Vec<f64>,
    /// The factor of c for modes: the size of φ at the places and the drive, 1/√kg.
    kept_scale: f64,
    /// Matrix of the balance.
    inner: Vec<f64>,
    /// Of a free vibration, its equations among all.
    free: Option<Reversible>,
}

/// The unknowns and the equations of a vibration that runs backwards as it came, by their numbers among all.
#[derive(Clone, Debug, Default)]
struct Reversible {
    unknowns: Vec<usize>,
    rows: Vec<usize>,
    /// All unknowns, residuals and derivatives.
    all: Vec<f64>,
    residual: Vec<f64>,
    matrix: Vec<f64>,
}

impl Reversible {
    /// With `m` unknowns of each harmonic up to `harmonics`, and the first harmonic of a mode of its own.
    fn new(m: usize, harmonics: usize, of_modes: bool) -> Reversible {
        // Constants, then of each harmonic the cosines before the sines.
        let cosines = (0..=harmonics).map(|k| (2 * k).saturating_sub(1) * m).flat_map(|first| first..first + m);
        let count = (2 * harmonics + 1) * m;
        let kept = usize::from(of_modes);
        // All unknowns begin with the drive, and those of modes go on with c. The balance of c is the first row after
        // those of the harmonics.
        let unknowns = (1..1 + kept).chain(cosines.clone().map(|at| 1 + kept + at)).collect();
        let rows = cosines.chain(count..count + kept).collect();
        let n = 1 + kept + count;
        Reversible { unknowns, rows, all: vec![0.0; n], residual: vec![0.0; n], matrix: vec![0.0; (n + 1) * (n + 1)] }
    }

    /// Takes the unknowns over into all of them.
    fn expand(&mut self, z: &[f64]) {
        self.unknowns.iter().zip(z).for_each(|(&at, value)| self.all[at] = *value);
    }

    /// Takes the residuals and the derivatives over from all of them.
    fn select(&self, residual: &mut [f64], matrix: &mut [f64]) {
        let stride = self.all.len() + 1;
        let count = residual.len();
        residual.iter_mut().zip(&self.rows).for_each(|(residual, &row)| *residual = self.residual[row]);
        let columns = self.unknowns.iter().copied().chain([self.all.len()]);
        for (column, from) in matrix.chunks_exact_mut(count + 1).zip(columns) {
            column.iter_mut().zip(&self.rows).for_each(|(by, &row)| *by = self.matrix[from * stride + row]);
        }
    }
}

impl Quadrature {
    /// Returns the number of harmonics of a solution.
    fn harmonics_of(&self, z: &[f64]) -> usize {
        let series = (z.len() - self.others()) / self.balance.unknowns.count();
        if self.free.is_some() { series - 1 } else { series / 2 }
    }

    fn of_modes(&self) -> bool {
        self.balance.kept.is_some()
    }

    /// Sets the drive and the mode that is kept.
    fn set(&mut self, z: &[f64]) {
        self.balance.forced.amplitude = z[0] * self.drive_unit;
        if let Some(kept) = &mut self.balance.kept {
            kept.cosine = z[1] / self.kept_scale;
        }
    }

    /// The row of phase quadrature of a chain: b₁ follows the constants and the cosines.
    fn chain_row(&self, z: &[f64], residual: &mut [f64], matrix: &mut [f64]) {
        let n = self.balance.dimension();
        let stride = z.len() + 1;
        let m = self.weights.len();
        residual[n] = 0.0;
        for (i, weight) in self.weights.iter().enumerate() {
            let at = 1 + 2 * m + i;
            residual[n] += weight * z[at];
            matrix[at * stride + n] = *weight;
        }
    }

    /// The rows of the mode that is kept, over ω² and times its scale, and its column in the rows of the places.
    fn kept_rows(&self, z: &[f64], residual: &mut [f64], matrix: &mut [f64]) {
        let n = self.balance.dimension();
        let stride = z.len() + 1;
        let (Some(kept), Body::Condensed(condensed)) = (self.balance.kept, &self.balance.unknowns.body) else { return };
        let [omega, zeta] = condensed.modes[kept.mode];
        let rate = self.balance.omega_rad_s();
        let scale = self.kept_scale / (omega * omega);
        let last = z.len() * stride;
        let mut columns = vec![0.0; 2 * n];
        self.balance.kept_rows(
            |part, value, slope| (residual[n + part], matrix[last + n + part]) = (scale * value, scale * slope),
            |part, column, value| columns[2 * column + part] = value,
        );
        for (column, pair) in columns.chunks_exact(2).enumerate() {
            (0..2).for_each(|part| matrix[(2 + column) * stride + n + part] = scale * pair[part]);
        }
        matrix[n + 1] = -scale * condensed.drive[kept.mode] * self.drive_unit;
        matrix[stride + n] = scale * (omega * omega - rate * rate) / self.kept_scale;
        matrix[stride + n + 1] = -scale * 2.0 * zeta * omega * rate / self.kept_scale;
        let m = condensed.places.len();
        for (i, place) in condensed.places.iter().enumerate() {
            matrix[stride + m + i] = -place[kept.mode] / self.kept_scale;
        }
    }
}

impl System for Quadrature {
    fn dimension(&self) -> usize {
        self.free.as_ref().map_or(self.balance.dimension() + self.before_series(), |free| free.rows.len())
    }

    fn evaluate(&mut self, z: &[f64], lambda: f64, residual: &mut [f64], matrix: &mut [f64]) -> bool {
        let Some(mut free) = self.free.take() else { return self.evaluate_all(z, lambda, residual, matrix) };
        free.expand(z);
        let exists = self.evaluate_all(&free.all, lambda, &mut free.residual, &mut free.matrix);
        free.select(residual, matrix);
        self.free = Some(free);
        exists
    }

    fn unit(&self) -> &'static str {
        "Hz"
    }
}

impl Quadrature {
    /// Evaluates all equations at all unknowns.
    fn evaluate_all(&mut self, z: &[f64], lambda: f64, residual: &mut [f64], matrix: &mut [f64]) -> bool {
        let n = self.balance.dimension();
        let others = self.before_series();
        let stride = z.len() + 1;
        self.set(z);
        self.inner.resize((n + 1) * (n + 1), 0.0);
        if !self.balance.evaluate(&z[others..], lambda, &mut residual[..n], &mut self.inner) {
            return false;
        }
        // The balance fills its own block alone, and the rows of quadrature write few of the other elements.
        matrix.chunks_exact_mut(stride).for_each(|column| column[..stride - 1].fill(0.0));
        for (column, inner) in self.inner.chunks_exact(n + 1).enumerate() {
            matrix[(others + column) * stride..][..n].copy_from_slice(&inner[..n]);
        }
        self.balance.by_amplitude(&mut matrix[..n]);
        matrix[..n].iter_mut().for_each(|by| *by *= self.drive_unit);
        if self.of_modes() {
            self.kept_rows(z, residual, matrix);
        } else {
            self.chain_row(z, residual, matrix);
        }
        true
    }

    /// Returns all unknowns of a solution.
    fn all(&mut self, z: &[f64]) -> Vec<f64> {
        match &mut self.free {
            Some(free) => {
                free.expand(z);
                free.all.clone()
            }
            None => z.to_vec(),
        }
    }

    /// Returns the number of unknowns before the series among all.
    fn before_series(&self) -> usize {
        1 + usize::from(self.of_modes())
    }
}

impl Spectral for Quadrature {
    fn balance(&self) -> &Balance {
        &self.balance
    }

    fn others(&self) -> usize {
        self.before_series() - usize::from(self.free.is_some())
    }

    fn set_harmonics(&mut self, harmonics: usize) {
        self.balance.set_harmonics(harmonics);
        if self.free.is_some() {
            self.free = Some(Reversible::new(self.balance.unknowns.count(), harmonics, self.of_modes()));
        }
    }

    fn evaluate_orbit(&mut self, z: &[f64], lambda: f64) -> bool {
        let all = self.all(z);
        self.set(&all);
        let before = self.before_series();
        Spectral::evaluate_orbit(&mut self.balance, &all[before..], lambda)
    }
}

/// Follows the backbone of a linear mode to larger amplitudes; the amplitude of `forced` doesn't matter. For the
/// nonlinear normal mode give a structure without damping, [`Forced::undamped`].
///
/// # Errors
/// [`AnalysisError::NotLinear`] if an element keeps small vibrations from being linear, [`AnalysisError::NoMode`] if there
/// is no such mode, [`AnalysisError::NotDriven`] if the drive can't bring it to quadrature; otherwise as
/// [`super::trace`].
pub fn backbone(forced: &Forced, options: &BackboneOptions) -> Result<Backbone, EndedEarly<Backbone>> {
    let (mut system, mut continuation, options) = leave_rest(forced, options)?;
    let mut curve = Backbone::default();
    let end = follow(&mut system, &mut continuation, &options, &mut curve.points);
    curve.work = continuation.work();
    EndedEarly::at_end(end, curve)
}

/// Returns the equations of a backbone, a continuation at its first response, and the options with the scale of that.
fn leave_rest(
    forced: &Forced,
    options: &BackboneOptions,
) -> Result<(Quadrature, Continuation, BackboneOptions), AnalysisError> {
    let (mut system, start) = begin(forced, options)?;
    let mut tangent = start.tangent;
    let rest = vec![0.0; system.dimension()];
    tangent.push(0.0);
    // Rest solves the equations at every frequency. The first step's plane is normal to the mode and does not pass
    // through rest, so Newton's method can't fall back to it.
    let mut size = start.size;
    let mut begun = |size: f64| {
        let settings = ContinuationSettings { state_floor: size, ..options.branch.continuation };
        let continuation = Continuation::start_along(&mut system, settings, &rest, start.frequency_hz, &tangent, 1.0)?;
        Ok((settings, continuation))
    };
    let mut started = begun(size);
    // A vibration of this size may be far from linear: a smaller one is nearer.
    while matches!(started, Err(AnalysisError::NoSolution { .. })) && size > SMALLEST_START * start.size {
        size *= 0.1;
        started = begun(size);
    }
    let (settings, continuation) = started?;
    let branch = BranchOptions { continuation: settings, ..options.branch };
    Ok((system, continuation, BackboneOptions { branch, ..options.clone() }))
}

/// A free periodic motion of an undamped structure.
#[derive(Clone, Debug)]
pub(super) struct FreeMotion {
    pub frequency_hz: f64,
    /// The series of the unknowns, see [`super::unknowns`].
    pub series: Vec<f64>,
}

/// Returns the free motions of a mode of an undamped structure, from small ones to those of the size `largest`, or to
/// where the frequency leaves its interval, or they can't be followed.
///
/// # Errors
/// As [`backbone`], if there are none.
pub(super) fn free_motions(
    forced: &Forced,
    options: &BackboneOptions,
    largest: f64,
) -> Result<Vec<FreeMotion>, AnalysisError> {
    let (mut system, mut continuation, options) = leave_rest(forced, options)?;
    let mut motions = Vec::new();
    while adapt(&mut system, &mut continuation, &options.branch).is_ok() {
        let point = continuation.point();
        let frequency_hz = point.lambda;
        let before = system.before_series();
        let series = system.all(&point.x)[before..].to_vec();
        let is_last = norm(&series) > largest
            || options.branch.left_at(frequency_hz).is_some()
            || motions.len() >= options.branch.most_points;
        motions.push(FreeMotion { frequency_hz, series });
        if is_last || continuation.advance(&mut system).is_err() {
            break;
        }
    }
    Ok(motions)
}

/// Start of the continuation: at rest, in this direction, with a first step of this size.
struct Start {
    tangent: Vec<f64>,
    size: f64,
    frequency_hz: f64,
}

/// Returns the equations and the small vibration that satisfies them.
fn begin(forced: &Forced, options: &BackboneOptions) -> Result<(Quadrature, Start), AnalysisError> {
    let assembly = &forced.assembly;
    if !forced.harmonics().is_empty() {
        return Err(AnalysisError::LoadHarmonics);
    }
    check_small_amplitudes(assembly)?;
    let got = options.mode;
    let modes = assembly.modes();
    let mode = modes.get(got).ok_or(AnalysisError::NoMode { got: got + 1, most: modes.len() })?;
    if mode.frequency_hz == 0.0 || mode.damping_ratio >= 1.0 {
        return Err(AnalysisError::NoResonance { mode: got + 1, damping_ratio: mode.damping_ratio });
    }
    let n = assembly.coordinates();
    let mass = assembly.linear().mass;
    let weights: Vec<f64> = (0..n).map(|i| (0..n).map(|k| mass[k * n + i] * mode.shape[k]).sum()).collect();
    // Of unit length, the row of quadrature has the size of the unknowns, as the scaled rows of the balance have.
    let length = libm::sqrt(weights.iter().map(|w| w * w).sum());
    let weights: Vec<f64> = weights.iter().map(|w| w / length).collect();
    let place = Place { value: mode.frequency_hz, unit: "Hz" };
    let beginning =
        Beginning::new(forced, mode, &weights).ok_or(AnalysisError::NotDriven { mode: got + 1, at: place })?;
    let mut balance = Balance::new(forced, mode.frequency_hz, Coordinate::FrequencyHz, options.branch.least_harmonics);
    balance.unknowns.check_held(assembly)?;
    let mut kept_scale = 0.0;
    let mut drive_unit = 1.0 / unit_deflection(forced);
    if let (BodySpec::Modal(_), Body::Condensed(condensed)) = (&assembly.spec().body, &balance.unknowns.body) {
        // The elements have no stiffness at rest: the modes are those given, in the order of their frequencies.
        let largest = |best: usize, i: usize| if mode.shape[i].abs() > mode.shape[best].abs() { i } else { best };
        let mode = (0..n).fold(0, largest);
        let sizes = condensed.places.iter().chain([&condensed.drive]).map(|place| place[mode] * place[mode]);
        kept_scale = libm::sqrt(sizes.sum());
        // By the mode alone: the places may be at rest under a static drive.
        let [omega, _] = condensed.modes[mode];
        drive_unit = omega * omega / (kept_scale * libm::fabs(condensed.drive[mode]));
        balance.kept = Some(Kept { mode, cosine: 0.0 });
    }
    let free = forced.is_conservative();
    let mut system = Quadrature { balance, drive_unit, weights, kept_scale, inner: vec![], free: None };
    let mut start = system.start(&beginning, options);
    if free {
        let reversible =
            Reversible::new(system.balance.unknowns.count(), system.balance.harmonics(), system.of_modes());
        start.tangent = reversible.unknowns.iter().map(|&at| start.tangent[at]).collect();
        system.free = Some(reversible);
    }
    Ok((system, start))
}

/// Checks that small vibrations are linear.
fn check_small_amplitudes(assembly: &Assembly) -> Result<(), AnalysisError> {
    use resonarm_dynamics::structure::Law;
    let bends = |law: &Law| match *law {
        Law::Cubic { .. } | Law::Linear { .. } | Law::Tanh { .. } => false,
        Law::Gap { gap, preload, .. }
        | Law::KelvinVoigt { gap, preload, .. }
        | Law::HuntCrossley { gap, preload, .. } => gap == 0.0 && preload == 0.0,
        Law::Friction { .. } | Law::Lugre { .. } => true,
    };
    // The forces of polynomials are of degree 2 at least.
    match assembly.elements().iter().find(|element| bends(&element.law)) {
        Some(element) => Err(AnalysisError::NotLinear { element: element.number, law: element.law.name() }),
        None => Ok(()),
    }
}

impl Quadrature {
    /// Returns the direction in which the branch leaves rest, and the size of the first response: a fraction of the
    /// limit that ends the branch, as if the structure were linear.
    fn start(&self, beginning: &Beginning, options: &BackboneOptions) -> Start {
        let n = self.balance.dimension();
        let others = self.others();
        let mut tangent = vec![0.0; n + others];
        tangent[0] = beginning.drive / self.drive_unit;
        let m = self.balance.unknowns.count();
        let first = &mut tangent[others..];
        match (&self.balance.unknowns.body, self.balance.kept) {
            (Body::Condensed(condensed), Some(kept)) => {
                let along = |place: &[f64], of: &[f64]| -> f64 { place.iter().zip(of).map(|(w, x)| w * x).sum() };
                for (i, place) in condensed.places.iter().enumerate() {
                    first[m + i] = along(place, &beginning.cosine);
                    first[2 * m + i] = along(place, &beginning.sine);
                }
                tangent[1] = self.kept_scale * beginning.cosine[kept.mode];
            }
            _ => {
                first[m..2 * m].copy_from_slice(&beginning.cosine);
                first[2 * m..3 * m].copy_from_slice(&beginning.sine);
            }
        }
        let length = libm::sqrt(tangent.iter().map(|z| z * z).sum());
        let read = options.read.first().map_or(0.0, |dof| {
            let direction = self.balance.forced.assembly().direction_at_rest(*dof);
            let [c, s] = [&beginning.cosine, &beginning.sine]
                .map(|part| direction.iter().zip(part).map(|(w, x)| w * x).sum::<f64>());
            libm::hypot(c, s)
        });
        // The factor of this vibration at the end; a reading may be at rest, and the drive zero.
        let end = (options.largest / read).min(options.largest_drive / beginning.drive);
        let size = if end.is_finite() && end > 0.0 {
            SMALLEST_PART * end * length
        } else {
            options.branch.continuation.state_floor
        };
        Start { tangent, size, frequency_hz: beginning.frequency_hz }
    }

    /// Returns the periodic response at a point.
    fn orbit(&mut self, point: &Point, read: &[Dof]) -> BackboneOrbit {
        // The number of harmonics may have changed since the point was solved for.
        let current = self.balance.harmonics();
        let needed = self.harmonics_of(&point.x);
        if needed != current {
            self.set_harmonics(needed);
        }
        // The frequency was valid when the point was solved for.
        let _ = Spectral::evaluate_orbit(self, &point.x, point.lambda);
        let balance = &self.balance;
        let coordinate = |i: usize| branch::reading_of(balance, &balance.coordinate_series(i));
        let orbit = BackboneOrbit {
            frequency_hz: point.lambda,
            drive: balance.forced.amplitude.abs(),
            coordinates: (0..balance.forced.assembly.coordinates()).map(coordinate).collect(),
            readings: read.iter().map(|&dof| branch::reading(balance, dof)).collect(),
            energy_j: balance.forced.is_conservative().then(|| energy_j(balance)),
            harmonics: needed,
        };
        if needed != current {
            self.set_harmonics(current);
        }
        orbit
    }
}

/// Returns the energy of the response last evaluated at phase 0, J: there q = Σ cₖ and q̇ = ω Σ k sₖ.
fn energy_j(balance: &Balance) -> f64 {
    let assembly = balance.forced.assembly();
    let at_phase_zero = |coordinate: usize| {
        let series = balance.coordinate_series(coordinate);
        let cosines = series.iter().skip(1).step_by(2);
        let sines = series.iter().skip(2).step_by(2);
        let rates = sines.zip(1..).map(|(sine, k)| f64::from(k) * sine);
        (series[0] + cosines.sum::<f64>(), balance.omega_rad_s() * rates.sum::<f64>())
    };
    let (q, v): (Vec<f64>, Vec<f64>) = (0..assembly.coordinates()).map(at_phase_zero).unzip();
    // Elements that conserve energy have no states.
    assembly.energy_j(&q, &v) + assembly.element_energy_j(&q, &[])
}

impl BackboneOrbit {
    /// Returns how far the response or its drive is beyond the end of the backbone, relative to that end: negative
    /// before it.
    fn beyond(&self, options: &BackboneOptions) -> f64 {
        let read = self.readings.first().map_or(0.0, |reading| reading.largest / options.largest);
        read.max(self.drive / options.largest_drive) - 1.0
    }
}

/// Continues until the response or the drive is large enough, or the frequency leaves its interval.
fn follow(
    system: &mut Quadrature,
    continuation: &mut Continuation,
    options: &BackboneOptions,
    points: &mut Vec<BackboneOrbit>,
) -> Result<(), AnalysisError> {
    let branch = &options.branch;
    let mut before: Option<(Point, f64)> = None;
    loop {
        adapt(system, continuation, branch)?;
        let here = continuation.point().clone();
        let orbit = system.orbit(&here, &options.read);
        let over = orbit.beyond(options);
        // The end is solved for, so that results don't depend on where the steps of the continuation fell.
        if let Some((last, short)) = before.as_ref().filter(|_| over > 0.0) {
            let test = |system: &mut Quadrature, point: &Point| system.orbit(point, &options.read).beyond(options);
            let end = search(system, &branch.continuation, [last, &here], [*short, over], FINE, test)?;
            points.push(system.orbit(&end, &options.read));
            return Ok(());
        }
        points.push(orbit);
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

impl Backbone {
    /// Returns the band, Hz, in which the forced response around the curve is of interest.
    pub fn window_hz(&self) -> [f64; 2] {
        let frequencies_hz = self.points.iter().map(|point| point.frequency_hz);
        let (low, high) = frequencies_hz.fold((f64::INFINITY, 0.0_f64), |(low, high), hz| (low.min(hz), high.max(hz)));
        let margin = (MARGIN[0] * (high - low)).max(MARGIN[1] * high);
        [low - margin, high + margin]
    }

    /// Returns the frequency of the last point minus that of the first, Hz.
    pub fn shift_hz(&self) -> f64 {
        let ends = self.points.first().zip(self.points.last());
        ends.map_or(0.0, |(first, last)| last.frequency_hz - first.frequency_hz)
    }

    /// Returns df/d(a²) at a = 0, Hz over the square of the unit of a, the first harmonic of the degree of freedom with
    /// this number among those read: positive where the mode hardens. `None` for fewer than three points, or if the
    /// degree of freedom doesn't move.
    pub fn curvature(&self, reading: usize) -> Option<f64> {
        let at = |point: &BackboneOrbit| Some((point.readings.get(reading)?.harmonic1.norm_sqr(), point.frequency_hz));
        crate::bending::curvature(&self.points.iter().map(at).collect::<Option<Vec<_>>>()?)
    }

    /// Returns how the curve bends, from the frequencies of its points; `None` if the frequency doesn't change.
    pub fn bending(&self) -> Option<Bending> {
        Bending::of(self.points.iter().map(|point| point.frequency_hz))
    }
}
