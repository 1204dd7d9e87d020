//! A structure known by its modes: q̈ + 2ζω q̇ + ω² q = Φᵀf with mass-normalised shapes Φ.
//!
//! ω = 0 is a rigid mode, q̈ = Φᵀf, of a structure that nothing holds; its damping ratio says nothing, since 2ζω is 0.
//! With ζ ≥ 1 a mode does not oscillate, as the high modes of a structure with C = αM + βK.
//!
//! A base that moves by z along an axis carries the masses by rz, so that M (ẍ + r z̈) + C ẋ + K x = f for displacements x
//! relative to the base. With x = Φq the acceleration of the base acts as the modal force −Γ z̈ with Γ = ΦᵀMr, and the
//! absolute acceleration of a point along that axis is φᵀq̈ + z̈ (J. Wijker, "Mechanical Vibrations in Spacecraft Design", 2004,
//! chapter 9).

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::f64::consts::TAU;

use super::check::Range::Finite;
use super::error::StructureError;
use super::limits::MOST_MODES;
use super::linear::Linearised;
use super::spec::{BASE, ModalSpec, ShapeSpec};

/// The most shapes: points that forces act on and that are read, one for each axis.
const MOST_SHAPES: usize = 256;

/// The constants of the modes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Modal {
    /// Natural angular frequencies ω, rad/s.
    pub omega_rad_s: Vec<f64>,
    /// Damping ratios ζ, dimensionless.
    pub damping_ratio: Vec<f64>,
    pub shapes: Vec<ShapeSpec>,
}

impl Modal {
    pub fn new(spec: &ModalSpec) -> Result<Modal, StructureError> {
        let counts = [("modes", spec.modes.len(), MOST_MODES), ("shapes", spec.shapes.len(), MOST_SHAPES)];
        for (what, got, most) in counts {
            if !(1..=most).contains(&got) {
                return Err(StructureError::structure_count(what, got, 1, most));
            }
        }
        for (i, mode) in spec.modes.iter().enumerate() {
            for (name, got) in [("frequency_hz", mode.frequency_hz), ("damping_ratio", mode.damping_ratio)] {
                if !(got.is_finite() && got >= 0.0) {
                    let part = format!("mode {}", i + 1);
                    let expected = "a number from 0";
                    return Err(StructureError::Value { part, name, got, expected });
                }
            }
        }
        for (i, shape) in spec.shapes.iter().enumerate() {
            check(shape, spec.modes.len(), &spec.shapes[..i])?;
        }
        Ok(Modal {
            omega_rad_s: spec.modes.iter().map(|mode| TAU * mode.frequency_hz).collect(),
            damping_ratio: spec.modes.iter().map(|mode| mode.damping_ratio).collect(),
            shapes: spec.shapes.clone(),
        })
    }

    /// Whether it has a rigid mode, so that nothing holds it.
    pub fn is_free(&self) -> bool {
        self.omega_rad_s.contains(&0.0)
    }

    /// Every mode's ω and 2ζω, rad/s.
    fn constants(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.omega_rad_s.iter().zip(&self.damping_ratio).map(|(&omega, &zeta)| (omega, 2.0 * zeta * omega))
    }

    pub fn unbalance(&self, [q, v, a]: [&[f64]; 3], force: &[f64], out: &mut [f64]) {
        for (i, (omega, damping)) in self.constants().enumerate() {
            out[i] = a[i] + damping * v[i] + omega * omega * q[i] - force[i];
        }
    }

    /// q̈ with the mass matrix I + m wwᵀ, m and w being `added`: its inverse is I − m wwᵀ/(1 + m wᵀw) (J. Sherman and
    /// W. J. Morrison, Ann. Math. Statist. 21 (1950)).
    pub fn acceleration(&self, [q, v]: [&[f64]; 2], force: &[f64], added: Option<(f64, &[f64])>, out: &mut [f64]) {
        for (i, (omega, damping)) in self.constants().enumerate() {
            out[i] = force[i] - damping * v[i] - omega * omega * q[i];
        }
        if let Some((mass_kg, w)) = added {
            let square: f64 = w.iter().map(|w| w * w).sum();
            let along: f64 = w.iter().zip(&*out).map(|(w, out)| w * out).sum();
            // M is the identity, so that wᵀM⁻¹w of the formula is the square of w.
            let taken = mass_kg * along / (1.0 + mass_kg * square);
            out.iter_mut().zip(w).for_each(|(out, w)| *out -= w * taken);
        }
    }

    pub fn linearise(&self, motion: [&[f64]; 3], force: &[f64], at: &mut Linearised) {
        self.unbalance(motion, force, &mut at.unbalance);
        let n = self.omega_rad_s.len();
        for matrix in [&mut at.by_position, &mut at.by_velocity, &mut at.by_acceleration] {
            matrix[..n * n].fill(0.0);
        }
        for (i, (omega, damping)) in self.constants().enumerate() {
            let diagonal = i * n + i;
            at.by_position[diagonal] = omega * omega;
            at.by_velocity[diagonal] = damping;
            at.by_acceleration[diagonal] = 1.0;
        }
    }

    /// ½ Σ q̇² + ω² q², J.
    pub fn energy_j(&self, q: &[f64], v: &[f64]) -> f64 {
        let mode = |(i, &omega): (usize, &f64)| v[i] * v[i] + (omega * q[i]) * (omega * q[i]);
        0.5 * self.omega_rad_s.iter().enumerate().map(mode).sum::<f64>()
    }

    /// The names of its points but the base, each once, in the order of the shapes.
    pub fn points(&self) -> Vec<String> {
        let mut points: Vec<String> = Vec::new();
        for shape in self.shapes.iter().filter(|shape| shape.point != BASE) {
            if !points.contains(&shape.point) {
                points.push(shape.point.to_string());
            }
        }
        points
    }
}

/// C and S of the free motion q = C q₀ + S (q̇₀ + σq₀) of q̈ + 2σ q̇ + ω² q = 0 after a time, with σ = ζω.
///
/// With ω_d = ω √(1 − ζ²) they are e^{−σt} cos ω_d t and e^{−σt} sin(ω_d t)/ω_d; with ω = 0 they are 1 and t. With ζ ≥ 1
/// and s = ω √(ζ² − 1) the rates are a = σ − s = ω²/b and b = σ + s, and
///
/// ```text
/// C = (e^{−at} + e^{−bt})/2 = e^{−at} (1 + e^{−2st})/2        S = (e^{−at} − e^{−bt})/2s = e^{−at} (1 − e^{−2st})/2s
/// ```
///
/// in which nothing overflows or cancels; for s → 0 S becomes t e^{−σt}.
pub fn mode_transient(omega_rad_s: f64, damping_ratio: f64, t_s: f64) -> [f64; 2] {
    if omega_rad_s == 0.0 {
        return [1.0, t_s];
    }
    if damping_ratio < 1.0 {
        // (1 − ζ)(1 + ζ): no cancellation near ζ = 1.
        let damped = omega_rad_s * libm::sqrt((1.0 - damping_ratio) * (1.0 + damping_ratio));
        let decay = libm::exp(-damping_ratio * omega_rad_s * t_s);
        let (sine, cosine) = libm::sincos(damped * t_s);
        return [decay * cosine, decay * sine / damped];
    }
    let Rates { slow, half_gap } = Rates::new(omega_rad_s, damping_ratio);
    let slow = libm::exp(-slow * t_s);
    let gap = -libm::expm1(-2.0 * half_gap * t_s);
    // At ζ = 1 the quotient is 0/0, and its limit is t.
    let s = if half_gap > 0.0 { gap / (2.0 * half_gap) } else { t_s };
    [slow * (1.0 - 0.5 * gap), slow * s]
}

/// The decay rates of a mode with ζ ≥ 1: a, and s, half of what b = a + 2s is more, 1/s.
pub(super) struct Rates {
    pub slow: f64,
    pub half_gap: f64,
}

impl Rates {
    pub fn new(omega_rad_s: f64, damping_ratio: f64) -> Rates {
        let root = libm::sqrt((damping_ratio - 1.0) * (damping_ratio + 1.0));
        // ω/(ζ + √(ζ² − 1)) equals ω (ζ − √(ζ² − 1)), which would cancel for large ζ.
        Rates { slow: omega_rad_s / (damping_ratio + root), half_gap: omega_rad_s * root }
    }

    /// The faster decay rate b, 1/s.
    pub fn fast(&self) -> f64 {
        self.slow + 2.0 * self.half_gap
    }
}

/// Name of a shape, `point.axis`.
pub(super) fn shape_name(shape: &ShapeSpec) -> String {
    format!("{}.{}", shape.point, shape.axis)
}

fn check(shape: &ShapeSpec, modes: usize, before: &[ShapeSpec]) -> Result<(), StructureError> {
    if shape.point.is_empty() || shape.point.contains('.') {
        return Err(StructureError::PointName { got: shape.point.clone() });
    }
    let name = shape_name(shape);
    let got = shape.by_mode.len();
    if before.iter().any(|other| other.point == shape.point && other.axis == shape.axis) {
        return Err(StructureError::ShapeTwice { name });
    }
    if got != modes {
        return Err(StructureError::Numbers { part: format!("shape `{name}`"), got, expected: modes, of: "modes" });
    }
    shape.by_mode.iter().try_for_each(|got| Finite.check(|| format!("shape {name}"), "by_mode", *got))
}
