//! Model of the mode's backbone: its frequency and damping as functions of the amplitude, from the points so
//! far.

use alloc::vec::Vec;

use nalgebra::{Matrix3, Vector3};

use crate::control::fourier_filter::unit;
use crate::control::mode_model::{ModeModel, SeenMode};
use crate::excitation::Phasor;

/// Frequency and damping of the mode as one point shows them.
#[derive(Clone, Copy, Debug)]
struct Finding {
    /// Square of the amplitude, A².
    square: f64,
    /// Square of the angular frequency, ω₀²(A), 1/s².
    stiffness: f64,
    /// Damping κ, load per rad/s.
    damping: f64,
    /// Standard deviation, relative to the part of the load that works against the damping.
    deviation: f64,
}

/// Polynomial that is fitted over A².
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FittedCurve {
    Line,
    Parabola,
}

/// Returns the compliance R of the other modes at an angular frequency, which is small and taken as linear.
fn compliance(others: &[SeenMode], omega_rad_s: f64) -> Phasor {
    let of = |mode: &SeenMode| {
        let SeenMode { angular_frequency_rad_s: omega, damping_ratio: zeta, modal_mass: mass } = mode;
        let square = omega * omega - omega_rad_s * omega_rad_s;
        (Phasor::new(square, 2.0 * zeta * omega * omega_rad_s) * *mass).inv()
    };
    others.iter().map(of).fold(Phasor::new(0.0, 0.0), |sum, of| sum + of)
}

/// Predicts ω₀²(A²) and κ(A²) from the points so far.
///
/// With the amplitude U of the load and a of the angle, in steady state a/U = 1/D + R: the mode's dynamic stiffness is
/// D = m(ω₀² − ω²) + iκω, and R = Σ 1/(m'(ω'² − ω² + 2iζ'ω'ω)) is the contribution of the other modes, far from
/// their resonances; off the peak, where the mode itself moves little, it shifts load and lag by per cents. So
/// ω₀² = ω² + Re D/m and κ = Im D/ω. The theory of small vibration, (0, ω₀²) and κ = 2ζω₀m, is the first finding.
/// Predictions of ω₀² fit a parabola in A², those of κ a line, by least squares in which near, recent and precise
/// findings weigh more.
#[derive(Clone, Debug, Default)]
pub(super) struct BackboneModel {
    mass: f64,
    others: Vec<SeenMode>,
    findings: Vec<Finding>,
}

/// Regularisation of slope and curvature towards zero, so that few points give a smooth curve.
const PULL: f64 = 1e-6;
/// Expected relative change of κ over the range of A², a standard deviation. Without it two imprecise points at
/// small amplitude could extrapolate to a negative damping at a large one.
const SLOPE: f64 = 0.05;
/// Share of the range of A² at which the weight of a point has fallen to a quarter.
const REACH: f64 = 0.4;
/// Relative deviation of the theory at small amplitude; the next constant is the least deviation of a point,
/// which covers the model's own error.
const THEORY: f64 = 0.01;
const LEAST_DEVIATION: f64 = 2e-4;
/// Ratio of the weights of a point and the next one: beyond the peak the same amplitudes occur at other
/// frequencies.
const FADING: f64 = 0.7;
/// Number of points that are kept, including the theory; older ones have weights below 0.7⁶² ≈ 2.5e-10.
const MOST_FINDINGS: usize = 64;

impl BackboneModel {
    /// Returns the model of the theory alone, with room for points.
    pub fn new(model: &ModeModel) -> BackboneModel {
        let SeenMode { angular_frequency_rad_s: omega, damping_ratio, modal_mass } = model.mode;
        let damping = 2.0 * damping_ratio * omega * modal_mass;
        let mut all = Vec::with_capacity(MOST_FINDINGS);
        all.push(Finding { square: 0.0, stiffness: omega * omega, damping, deviation: THEORY });
        BackboneModel { mass: modal_mass, others: model.others().to_vec(), findings: all }
    }

    /// Forgets all points and returns to the theory.
    pub fn forget(&mut self) {
        self.findings.truncate(1);
    }

    /// Adds U/a found at the amplitude `amplitude_rad` and the angular frequency `omega_rad_s`, with a standard
    /// deviation relative to the load. Off the peak only the share |Im D|/|D| of the load works against the damping,
    /// and determines the mode less well. When full, the oldest finding after the theory is dropped.
    pub fn add(&mut self, amplitude_rad: f64, omega_rad_s: f64, dynamic_stiffness: Phasor, deviation: f64) {
        if self.findings.len() == MOST_FINDINGS {
            // Finding 0 is the theory. It anchors the fit at small amplitudes and is never dropped.
            self.findings.remove(1);
        }
        let own = self.own(dynamic_stiffness, omega_rad_s);
        self.findings.push(Finding {
            square: amplitude_rad * amplitude_rad,
            stiffness: omega_rad_s * omega_rad_s + own.re / self.mass,
            damping: own.im / omega_rad_s,
            deviation: deviation * libm::hypot(own.re / own.im, 1.0),
        });
    }

    /// Returns D, the mode's own dynamic stiffness, from U/a.
    fn own(&self, dynamic_stiffness: Phasor, omega_rad_s: f64) -> Phasor {
        (dynamic_stiffness.inv() - compliance(&self.others, omega_rad_s)).inv()
    }

    /// Returns (ω₀², κ) at an amplitude.
    fn at(&self, amplitude_rad: f64) -> (f64, f64) {
        let square = amplitude_rad * amplitude_rad;
        let stiffness = self.predict(square, FittedCurve::Parabola, |finding| finding.stiffness);
        let damping = self.predict(square, FittedCurve::Line, |finding| finding.damping);
        (stiffness, damping)
    }

    /// Returns U/a at an amplitude and an angular frequency.
    pub fn dynamic_stiffness(&self, amplitude_rad: f64, omega_rad_s: f64) -> Phasor {
        let (stiffness, damping) = self.at(amplitude_rad);
        let own = Phasor::new(self.mass * (stiffness - omega_rad_s * omega_rad_s), damping * omega_rad_s);
        (own.inv() + compliance(&self.others, omega_rad_s)).inv()
    }

    /// Returns the value at `square` by weighted least squares.
    fn predict(&self, square: f64, curve: FittedCurve, value: impl Fn(&Finding) -> f64) -> f64 {
        let scale = self.findings.iter().fold(square, |most, finding| most.max(finding.square)).max(f64::MIN_POSITIVE);
        // Deviations from the last point are fitted and the last point is added again. The regularisation then
        // pulls towards it, and the sums keep their digits.
        let Some(origin) = self.findings.last().map(&value) else { return 0.0 };
        let mut normal = Matrix3::zeros();
        let mut moment = Vector3::zeros();
        let mut total = 0.0;
        let mut recency = 1.0;
        for finding in self.findings.iter().rev() {
            let x = (finding.square - square) / scale;
            let p = Vector3::new(1.0, x, if curve == FittedCurve::Parabola { x * x } else { 0.0 });
            // The weight falls with the fourth power of a large distance, so distant points still count where no
            // others are.
            let far = 1.0 + (x / REACH) * (x / REACH);
            // The least deviation keeps one very precise point from dominating the curve.
            let variance = finding.deviation * finding.deviation + LEAST_DEVIATION * LEAST_DEVIATION;
            let weight = recency / (far * far * variance);
            recency *= FADING;
            normal += p * p.transpose() * weight;
            moment += p * (weight * (value(finding) - origin));
            total += weight;
        }
        let pull = PULL * total;
        normal.m22 += match curve {
            FittedCurve::Parabola => pull,
            FittedCurve::Line => pull + 1.0 / (SLOPE * SLOPE),
        };
        normal.m33 += pull;
        // The regularisation keeps the matrix positive definite. Should it fail all the same, the last point is
        // the best guess.
        normal.cholesky().map_or(origin, |cholesky| origin + cholesky.solve(&moment).x)
    }

    /// Returns amplitude and angular frequency at which the displacement lags by `lag_rad` behind a load of
    /// amplitude `load`, by iteration from `near`. Without the other modes they are A = F sin φ/(κω) and ω² =
    /// ω₀² − κω cot φ/m. With them, U/a = F e^{iφ}/A gives D, and A Im D = F sin φ and Re D = Im D cot φ no
    /// longer hold; but the factors A Im D/F and Re D/Im D hardly change with A. `None` if the iteration leads to no such
    /// response.
    pub fn target(&self, lag_rad: f64, load: f64, near: (f64, f64)) -> Option<(f64, f64)> {
        const ITERATIONS: usize = 50;
        let (mut amplitude, mut omega) = near;
        // The factors A Im D/F and Re D/Im D start from their values without other modes.
        let mut sine = libm::sin(lag_rad);
        let mut cotangent = 1.0 / libm::tan(lag_rad);
        for _ in 0..ITERATIONS {
            let (stiffness, damping) = self.at(amplitude);
            amplitude = load * sine / (damping * omega);
            let square = stiffness - damping * omega * cotangent / self.mass;
            if !(square > 0.0 && amplitude > 0.0 && amplitude.is_finite()) {
                return None;
            }
            omega = libm::sqrt(square);
            let own = self.own(unit(lag_rad) * (load / amplitude), omega);
            sine = amplitude * own.im / load;
            cotangent = own.re / own.im;
        }
        Some((amplitude, omega))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::{ModeNumber, Modelled};
    use crate::plant::tests;
    use crate::rig::{Load, RigSpec};

    /// Findings of a Duffing oscillator, ω₀² = ω₁² − c A², with a contribution of the other mode, predict the points
    /// between them.
    #[test]
    fn findings_predict_the_next_point() {
        let tested = tests::preset([0.0, 60.0]);
        let of = Modelled::new(&tested, &RigSpec::default()).unwrap();
        let model = ModeModel::new(&of, &Load::torque_nm(1.0, 0.0), 1.0, ModeNumber::FIRST).unwrap();
        let w1 = model.mode.angular_frequency_rad_s;
        let m = model.mode.modal_mass;
        let softening = 2.0e3;
        let damping = 2.0 * model.mode.damping_ratio * w1 * m;
        let stiffness = |a: f64, omega: f64| {
            let own = Phasor::new(m * (w1 * w1 - softening * a * a - omega * omega), damping * omega);
            (own.inv() + compliance(model.others(), omega)).inv()
        };
        let mut backbone = BackboneModel::new(&model);
        for (a, omega) in [(0.01, w1), (0.02, w1), (0.03, w1), (0.04, w1 - 0.02)] {
            backbone.add(a, omega, stiffness(a, omega), 1e-4);
        }
        for lag_deg in [20.0_f64, 45.0, 90.0, 150.0] {
            let (a, omega) = backbone.target(lag_deg.to_radians(), 8.0, (0.02, w1)).unwrap();
            let d = stiffness(a, omega);
            let load = a * libm::hypot(d.re, d.im);
            let lag = libm::atan2(d.im, d.re).to_degrees();
            assert!((load / 8.0 - 1.0).abs() < 5e-3 && (lag - lag_deg).abs() < 0.3, "{lag_deg}: {load} {lag}");
        }
    }
}
