//! Phase quadrature of the linear system: where backbones begin.
//!
//! About rest, M ẍ + G ẋ + S x = A p sin Ωt has the response x = A (Im h cos Ωt + Re h sin Ωt), h = (S + iΩG − Ω²M)⁻¹
//! p. A mode φ is in quadrature where its modal coordinate φᵀM x is, φᵀM Re h = 0. Without the coupling of the modes by
//! the dampers
//!
//! ```text
//! φᵀM h = φᵀp / (ω² − Ω² + 2iζωΩ)        Re: zero at Ω = ω
//! ```
//!
//! whatever else the excitation moves (at the point where it acts, the other mode can be most of the motion). The real
//! part has its extremes at ω (1 ∓ ζ), up to ζ², the half-power points. With that coupling the zero is still between
//! them, unless the excitation drives the other mode so much more that the mode responds to the dampers rather than to
//! the excitation.

use core::f64::consts::TAU;

use nalgebra::{Complex, Matrix2, Vector2};

use super::{AnalysisError, Instant, LinearMode, Oscillator, Place};

/// Bisections of the bandwidth: 2⁻⁵² of 2ζω.
const BISECTIONS: usize = 52;

/// A small motion in quadrature, of unit size, and the excitation that sustains it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Beginning {
    /// Ω/2π, Hz.
    pub frequency_hz: f64,
    /// The drive, in its unit over rad.
    pub drive: f64,
    /// The components along cos Ωt.
    pub cosine: Vector2<f64>,
    /// The components along sin Ωt.
    pub sine: Vector2<f64>,
    /// φᵀM, of unit length.
    pub modal: Vector2<f64>,
}

/// S, G and M about rest, and p.
#[derive(Clone, Copy, Debug)]
struct AtRest {
    stiffness: Matrix2<f64>,
    damping: Matrix2<f64>,
    mass: Matrix2<f64>,
    load: Vector2<f64>,
}

impl AtRest {
    fn of<O: Oscillator>(oscillator: &O, drive: O::Parameter) -> AtRest {
        let rest = Vector2::zeros();
        let peak = Instant { position: rest, velocity: rest, acceleration: rest, sine: 1.0, cosine: 0.0 };
        let linear = oscillator.linearise(&peak);
        AtRest {
            stiffness: linear.by_position,
            damping: linear.by_velocity,
            mass: linear.by_acceleration,
            load: -oscillator.by_parameter(drive, &peak),
        }
    }

    /// h; not finite where the matrix has no inverse.
    fn response(&self, omega_rad_s: f64) -> Vector2<Complex<f64>> {
        let matrix = Matrix2::from_fn(|i, j| {
            let real = self.stiffness[(i, j)] - omega_rad_s * omega_rad_s * self.mass[(i, j)];
            Complex::new(real, omega_rad_s * self.damping[(i, j)])
        });
        let load = self.load.map(|value| Complex::new(value, 0.0));
        matrix.try_inverse().map_or(Vector2::from_element(Complex::new(f64::NAN, f64::NAN)), |inverse| inverse * load)
    }

    /// φᵀM, of unit length: its product with x is the modal coordinate.
    fn modal(&self, mode: &LinearMode) -> Vector2<f64> {
        self.mass.tr_mul(&mode.shape).normalize()
    }

    /// Ω of quadrature near a mode.
    fn quadrature_rad_s(&self, mode: &LinearMode) -> Option<f64> {
        let weights = self.modal(mode) * self.load.dot(&mode.shape).signum();
        let in_phase = |omega_rad_s: f64| self.response(omega_rad_s).map(|value| value.re).dot(&weights);
        let [mut low, mut high] = [-1.0, 1.0].map(|side| mode.frequency_rad_s * (1.0 + side * mode.damping_ratio));
        if !(in_phase(low) > 0.0 && in_phase(high) < 0.0) {
            return None;
        }
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if in_phase(middle) > 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        Some(0.5 * (low + high))
    }
}

/// The small motion in quadrature of a mode, 0 or 1. Without damping it is the mode itself, and needs no drive.
///
/// # Errors
/// [`AnalysisError::NotDriven`] if there is none.
pub(super) fn beginning<O: Oscillator>(
    oscillator: &O,
    mode: usize,
    drive: O::Parameter,
) -> Result<Beginning, AnalysisError> {
    let linear = oscillator.modes()[mode.min(1)];
    let frequency_hz = linear.frequency_rad_s / TAU;
    let refusal = AnalysisError::NotDriven { mode: mode + 1, at: Place { value: frequency_hz, unit: "Hz" } };
    let at_rest = AtRest::of(oscillator, drive);
    let modal = at_rest.modal(&linear);
    if linear.damping_ratio == 0.0 {
        let driven = at_rest.load.dot(&linear.shape) != 0.0;
        let free = Beginning { frequency_hz, drive: 0.0, cosine: -linear.shape, sine: Vector2::zeros(), modal };
        return if driven { Ok(free) } else { Err(refusal) };
    }
    let Some(omega_rad_s) = at_rest.quadrature_rad_s(&linear) else { return Err(refusal) };
    let response = at_rest.response(omega_rad_s);
    let (cosine, sine) = (response.map(|value| value.im), response.map(|value| value.re));
    let drive = 1.0 / libm::sqrt(cosine.norm_squared() + sine.norm_squared());
    Ok(Beginning { frequency_hz: omega_rad_s / TAU, drive, cosine: cosine * drive, sine: sine * drive, modal })
}
