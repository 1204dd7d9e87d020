//! Systems whose bifurcations are known from the literature.

use nalgebra::{Matrix2, Normed as _, Vector2};

use crate::continuation::ContinuationSettings;
use crate::*;

/// In the first degree of freedom the equation named, in the second ÿ + ẏ + 7y = 0.
#[derive(Clone, Debug)]
struct Textbook {
    equation: Equation,
    parameter: f64,
    strength: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Equation {
    /// ẍ + 2ζẋ + x + γx³ = F sin Ωt: ζ = 0.02, γ is `strength`, F the parameter.
    Duffing { damping_ratio: f64 },
    /// ẍ + (a − 2q cos Ωt) x + γx³ = 0, Ω = 2: q is `strength`, a the parameter.
    Mathieu { cubic: f64 },
    /// ẍ − ε(1 − x²)ẋ + x = F sin Ωt: ε is `strength`, F the parameter.
    VanDerPol,
}

impl Oscillator for Textbook {
    type Parameter = ();

    fn parameter(&self, (): ()) -> f64 {
        self.parameter
    }

    fn set_parameter(&mut self, (): (), value: f64) -> bool {
        self.parameter = value;
        value.is_finite()
    }

    fn unbalance(&self, at: &Instant) -> Vector2<f64> {
        self.linearise(at).unbalance
    }

    fn linearise(&self, at: &Instant) -> Linearisation {
        let (x, v, p, s) = (at.position.x, at.velocity.x, self.parameter, self.strength);
        let (restoring, by_x, by_v) = match self.equation {
            Equation::Duffing { damping_ratio } => {
                let damping = 2.0 * damping_ratio;
                (damping * v + x + s * x * x * x - p * at.sine, 1.0 + 3.0 * s * x * x, damping)
            }
            Equation::Mathieu { cubic } => {
                let stiffness = p - 2.0 * s * at.cosine;
                (stiffness * x + cubic * x * x * x, stiffness + 3.0 * cubic * x * x, 0.0)
            }
            Equation::VanDerPol => {
                (-s * (1.0 - x * x) * v + x - p * at.sine, 1.0 + 2.0 * s * x * v, -s * (1.0 - x * x))
            }
        };
        Linearisation {
            unbalance: Vector2::new(
                at.acceleration.x + restoring,
                at.acceleration.y + at.velocity.y + 7.0 * at.position.y,
            ),
            by_position: Matrix2::new(by_x, 0.0, 0.0, 7.0),
            by_velocity: Matrix2::new(by_v, 0.0, 0.0, 1.0),
            by_acceleration: Matrix2::identity(),
        }
    }

    fn by_parameter(&self, (): (), at: &Instant) -> Vector2<f64> {
        match self.equation {
            Equation::Duffing { .. } | Equation::VanDerPol => Vector2::new(-at.sine, 0.0),
            Equation::Mathieu { .. } => Vector2::new(at.position.x, 0.0),
        }
    }

    fn stiffness_scale(&self) -> f64 {
        1.0
    }

    fn modes(&self) -> [LinearMode; 2] {
        let damping_ratio = match self.equation {
            Equation::Duffing { damping_ratio } => damping_ratio,
            Equation::Mathieu { .. } | Equation::VanDerPol => 0.0,
        };
        [
            LinearMode { frequency_rad_s: 1.0, damping_ratio, shape: Vector2::x() },
            LinearMode { frequency_rad_s: libm::sqrt(7.0), damping_ratio: 0.5 / libm::sqrt(7.0), shape: Vector2::y() },
        ]
    }
}

const TAU: f64 = core::f64::consts::TAU;

fn kinds(branch: &Branch) -> Vec<(BifurcationKind, f64)> {
    branch.bifurcations.iter().map(|b| (b.kind, b.orbit.value)).collect()
}

/// With one harmonic, y = A² and w = Ω², the response of Duffing's oscillator is the curve
/// f(y, w) = y ((1 − w + ¾γy)² + 4ζ²w) − F² = 0, and its folds are where ∂f/∂y = 0 too.
#[test]
fn duffing_folds_are_those_of_the_closed_form() {
    let (zeta, gamma, force) = (0.02, 0.5, 0.1);
    let closed = |mut y: f64, mut w: f64| {
        for _ in 0..60 {
            let d = 1.0 - w + 0.75 * gamma * y;
            let f = y * (d * d + 4.0 * zeta * zeta * w) - force * force;
            let f_y = d * d + 4.0 * zeta * zeta * w + 1.5 * gamma * y * d;
            let f_w = y * (4.0 * zeta * zeta - 2.0 * d);
            let f_yy = 3.0 * gamma * d + 1.5 * gamma * (d + 0.75 * gamma * y);
            let f_yw = -2.0 * d + 4.0 * zeta * zeta - 1.5 * gamma * y;
            let step = Matrix2::new(f_y, f_w, f_yy, f_yw).lu().solve(&Vector2::new(f, f_y)).unwrap();
            (y, w) = (y - step.x, w - step.y);
        }
        libm::sqrt(w) / TAU
    };
    let duffing = Textbook { equation: Equation::Duffing { damping_ratio: zeta }, parameter: force, strength: gamma };
    let options = BranchOptions { truncation: f64::INFINITY, least_harmonics: 1, ..BranchOptions::new(0.1, 0.4) };
    let branch = trace(duffing, 0.1, Coordinate::FrequencyHz, &options).unwrap();
    let guess = |b: &Bifurcation| (b.orbit.harmonic1_rad[0].powi(2), (TAU * b.orbit.value).powi(2));
    assert_eq!(branch.bifurcations.len(), 2);
    for b in &branch.bifurcations {
        let (y, w) = guess(b);
        let exact = closed(1.01 * y, 1.01 * w);
        assert!((b.orbit.value / exact - 1.0).abs() < 1e-10, "{} {exact}", b.orbit.value);
    }
}

/// The free undamped oscillator: ω = π √(1 + γa²) / (2 K(m)), m = γa²/(2(1 + γa²)), with K by the arithmetic-geometric
/// mean.
#[test]
fn duffing_backbone_is_the_elliptic_integral() {
    let gamma = 0.5;
    let duffing = Textbook { equation: Equation::Duffing { damping_ratio: 0.0 }, parameter: 0.0, strength: gamma };
    let options = BackboneOptions {
        smallest_rad: 1e-3,
        largest_rad: 3.0,
        largest_drive: f64::INFINITY,
        branch: BranchOptions { truncation: 1e-11, ..BranchOptions::new(0.1, 2.0) },
    };
    let curve = backbone(duffing, 0, (), &options).unwrap();
    assert_eq!(curve.bending(), Some(Bending::Hardening));
    assert!(curve.points.len() > 20);
    for point in &curve.points {
        let square = gamma * point.amplitude_rad[0] * point.amplitude_rad[0];
        let (mut a, mut b) = (1.0_f64, libm::sqrt(1.0 - square / (2.0 * (1.0 + square))));
        for _ in 0..8 {
            (a, b) = (0.5 * (a + b), libm::sqrt(a * b));
        }
        let exact = libm::sqrt(1.0 + square) * a / TAU;
        assert!(
            (point.frequency_hz / exact - 1.0).abs() < 1e-9,
            "{} {exact} {}",
            point.frequency_hz,
            point.amplitude_rad[0]
        );
        assert!(point.drive.abs() < 1e-9);
    }
}

/// Characteristic values at q = 1 (M. Abramowitz, I. A. Stegun, "Handbook of Mathematical Functions", 1964, Ch. 20): a₀
/// = −0.455138604107, b₁ = −0.110248816992, a₁ = 1.859108072514. At a₁ and b₁ the motion of period 2π appears, twice
/// that of the excitation: multiplier −1; at a₀ one of period π: multiplier 1, and since rest stays a solution, a
/// branch point.
#[test]
fn mathieu_doubles_its_period_at_the_characteristic_values() {
    let mathieu = Textbook { equation: Equation::Mathieu { cubic: 1.0 }, parameter: 0.0, strength: 1.0 };
    let frequency_hz = 2.0 / TAU;
    let coordinate = Coordinate::Parameter(());
    let options = |from, to| {
        let options = BranchOptions::new(from, to);
        BranchOptions { continuation: ContinuationSettings { state_floor: 0.1, ..options.continuation }, ..options }
    };
    let branch = trace(mathieu.clone(), frequency_hz, coordinate, &options(-0.6, 2.5)).unwrap();
    let expected = [
        (BifurcationKind::BranchPoint, -0.455_138_604_107_413_5),
        (BifurcationKind::PeriodDoubling, -0.110_248_816_992_095_2),
        (BifurcationKind::PeriodDoubling, 1.859_108_072_514_363_4),
    ];
    let found = kinds(&branch);
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for (found, expected) in found.iter().zip(expected) {
        assert_eq!(found.0, expected.0);
        assert!((found.1 - expected.1).abs() < 1e-12, "{found:?} {expected:?}");
    }

    let last = &branch.bifurcations[2];
    let doubled = trace_doubled(mathieu, last, coordinate, &options(0.5, 2.5)).unwrap();
    assert!(doubled.orbits.iter().all(|orbit| orbit.value < 1.8592));
    assert_eq!(doubled.orbits.last().unwrap().value, 0.5);
}

/// Asynchronous quenching (N. Minorsky, "Nonlinear Oscillations", 1962): far from resonance the response A = F/(1 − Ω²)
/// takes the self-excitation's damping to −ε(1 − A²/2), zero at A = √2 up to terms of the order of ε².
#[test]
fn forced_van_der_pol_loses_its_torus_by_quenching() {
    for strength in [0.02, 0.1] {
        let van_der_pol = Textbook { equation: Equation::VanDerPol, parameter: 8.0, strength };
        let omega: f64 = 2.6;
        let branch =
            trace(van_der_pol, omega / TAU, Coordinate::Parameter(()), &BranchOptions::new(4.0, 12.0)).unwrap();
        let [(kind, force)] = kinds(&branch)[..] else { panic!("{:?}", kinds(&branch)) };
        assert_eq!(kind, BifurcationKind::NeimarkSacker);
        // By its extended system, in a few iterations.
        let [largest, ..] = branch.bifurcations[0].orbit.stability.multipliers;
        assert!((largest.norm() - 1.0).abs() < 1e-12, "{largest}");
        assert!((1..=5).contains(&branch.location_work.evaluations), "{:?}", branch.location_work);
        let expected = libm::sqrt(2.0) * (omega * omega - 1.0);
        assert!((force / expected - 1.0).abs() < strength * strength, "{force} {expected}");
        assert!(!branch.orbits[0].is_stable() && branch.orbits.last().unwrap().is_stable());
    }
}

/// Duffing's free oscillator has ω = 1 + ⅜γa² + O(a⁴) (A. H. Nayfeh, D. T. Mook, "Nonlinear Oscillations", 1979, Sec.
/// 2.3), a being the amplitude of the first harmonic: df/d(a²) = 3γ/(16π), stiff for γ > 0, soft for γ < 0.
#[test]
fn curvature_of_the_backbone_is_that_of_duffing() {
    for (gamma, bending) in [(0.5, Bending::Hardening), (-0.2, Bending::Softening)] {
        let equation = Equation::Duffing { damping_ratio: 0.0 };
        let duffing = Textbook { equation, parameter: 0.0, strength: gamma };
        let options = BackboneOptions {
            smallest_rad: 1e-3,
            largest_rad: 0.5,
            largest_drive: f64::INFINITY,
            branch: BranchOptions::new(0.01, 1.0),
        };
        let curve = backbone(duffing, 0, (), &options).unwrap();
        let expected = 3.0 * gamma / (8.0 * TAU);
        let curvature = curve.curvature_hz_rad2(0).unwrap();
        assert!((curvature / expected - 1.0).abs() < 1e-4, "{curvature} {expected}");
        assert_eq!((curve.bending(), curve.curvature_hz_rad2(1)), (Some(bending), None));
        assert_eq!(curve.shift_hz() > 0.0, gamma > 0.0);
        let short = Backbone { points: curve.points[..2].to_vec(), ..curve.clone() };
        assert_eq!(short.curvature_hz_rad2(0), None);
        let three = Backbone { points: curve.points[..3].to_vec(), ..curve.clone() };
        assert!((three.curvature_hz_rad2(0).unwrap() / expected - 1.0).abs() < 1e-3);
    }
}
