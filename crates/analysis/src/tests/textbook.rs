//! Structures whose bifurcations are known from the literature.

use nalgebra::{Matrix2, Vector2};

use super::*;
use crate::Bending;
use crate::continuation::ContinuationSettings;

/// A link with a spring at its joint and no damper, of inertia 1 kg·m², under an axial force at its tip: q̈ + k q + F l
/// sin Ωt sin q = 0.
fn link(stiffness_nm_rad: f64) -> Assembly {
    let link = Link {
        length_m: 1.0,
        mass_kg: 0.5,
        centre_of_mass_m: 1.0,
        centre_of_mass_off_m: 0.0,
        inertia_kg_m2: 0.5,
        angle_deg: 0.0,
        stiffness_nm_rad,
        damping_nm_s_rad: 0.0,
    };
    let body = BodySpec::Chain(ChainSpec { links: vec![link], gravity_m_s2: 0.0, unstated: vec![] });
    Assembly::new(&StructureSpec { body, elements: vec![] }).unwrap()
}

/// Small vibrations of the link follow Mathieu's equation, q̈ + (a − 2q cos 2t) q = 0 with a = k, 2q = F l and t
/// shifted. At q = 1 its characteristic values are a₁ = 1.859108072514, b₂ = 3.917024772998 and a₂ = 4.371300982735 (M.
/// Abramowitz, I. A. Stegun, "Handbook of Mathematical Functions", 1964, Ch. 20). At a₁ a periodic orbit of period 2π
/// appears, twice that of the force: a multiplier is −1. At b₂ and a₂ one of period π does: a multiplier is 1, and
/// since rest remains a solution, they are branch points.
#[test]
fn a_link_under_an_axial_force_has_the_characteristic_values_of_mathieu() {
    let assembly = link(0.5);
    let tip = assembly.dof("tip.x").unwrap();
    let stiffness = Coordinate::Parameter(assembly.parameter("link1.stiffness_nm_rad").unwrap());
    let forced = Forced::new(assembly, tip, 2.0);
    let mut options = TraceOptions::new(&forced, stiffness, [0.5, 6.0], vec![tip]);
    // Rest needs no harmonics, but the responses that leave it do.
    options.branch.least_harmonics = 9;
    options.branch.continuation = ContinuationSettings { state_floor: 0.1, ..options.branch.continuation };
    let branch = super::super::trace(&forced, 2.0 / TAU, stiffness, &options).unwrap();
    let expected = [
        (BifurcationKind::PeriodDoubling, 1.859_108_072_514_364),
        (BifurcationKind::BranchPoint, 3.917_024_772_998_471),
        (BifurcationKind::BranchPoint, 4.371_300_982_735_085),
    ];
    let found: Vec<_> = branch.bifurcations.iter().map(|found| (found.kind, found.orbit.value)).collect();
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for (found, expected) in found.iter().zip(expected) {
        assert_eq!(found.0, expected.0, "{found:?}");
        near(found.1, expected.1, 1e-9);
    }
}

/// A mode of 1 rad/s and 1 kg with a cubic spring: q̈ + 2ζq̇ + q + γq³ = F sin Ωt.
pub(super) fn duffing(damping_ratio: f64, gamma: f64, force_n: f64) -> Forced {
    let body = ModalSpec {
        modes: vec![ModeSpec { frequency_hz: 1.0 / TAU, damping_ratio }],
        shapes: vec![ShapeSpec { point: "tip".into(), axis: Axis::X, by_mode: vec![1.0] }],
    };
    let law = Law::Cubic { stiffness3: gamma, stiffness5: 0.0 };
    let elements = vec![ElementSpec::Point { at: place("tip.x"), to: None, law }];
    let assembly = Assembly::new(&StructureSpec { body: BodySpec::Modal(body), elements }).unwrap();
    let tip = assembly.dof("tip.x").unwrap();
    Forced::new(assembly, tip, force_n)
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
    let forced = duffing(zeta, gamma, force);
    let tip = forced.drives()[0].0;
    let mut options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [0.1, 0.4], vec![tip]);
    // One harmonic, as in the closed form, whatever that leaves out.
    options.branch = BranchOptions { truncation: f64::INFINITY, least_harmonics: 1, ..options.branch };
    let branch = super::super::trace(&forced, 0.1, Coordinate::FrequencyHz, &options).unwrap();
    assert_eq!(branch.bifurcations.len(), 2);
    for found in &branch.bifurcations {
        let y = found.orbit.readings[0].harmonic1.norm_sqr();
        // From beside the fold, so that the closed form has to find it by itself.
        let exact = closed(1.01 * y, 1.01 * (TAU * found.orbit.value).powi(2));
        near(found.orbit.value, exact, 1e-10);
    }
}

/// Duffing's free oscillator has ω = 1 + ⅜γa² + O(a⁴) (A. H. Nayfeh, D. T. Mook, "Nonlinear Oscillations", 1979, Sec.
/// 2.3), a being the amplitude of the first harmonic: df/d(a²) = 3γ/(16π), stiff for γ > 0, soft for γ < 0.
#[test]
fn curvature_of_the_backbone_is_that_of_duffing() {
    for (gamma, bending) in [(0.5, Bending::Hardening), (-0.2, Bending::Softening)] {
        let forced = duffing(0.0, gamma, 1.0);
        let options = BackboneOptions::new(&forced, 0, 0.5, f64::INFINITY, vec![forced.drives()[0].0]);
        let curve = super::super::backbone(&forced, &options).unwrap();
        near(curve.curvature(0).unwrap(), 3.0 * gamma / (8.0 * TAU), 1e-3);
        assert_eq!(curve.bending(), Some(bending));
    }
}

/// A straight chain of two links under an axial force F sin Ωt at its tip stays at rest until it loses its stability by a
/// combination resonance at Ω = ω₁ + ω₂. With M q̈ + D q̇ + (K − F sin Ωt G) q = 0, g = φ₁ᵀGφ₂ of the mass-normalised modes
/// and the decay rates μᵢ, the slowly varying amplitudes obey A₁' = −μ₁A₁ ± F g A₂*/(4ω₁) and the same with 1 and 2
/// exchanged (A. H. Nayfeh, D. T. Mook, "Nonlinear Oscillations", 1979, Sec. 5.4), so that rest is unstable beyond
/// F² = 16 μ₁μ₂ω₁ω₂/g²: a complex pair leaves the unit circle there, up to terms of the order of the damping.
#[test]
fn a_straight_chain_loses_its_rest_by_a_combination_resonance() {
    let (length_m, damping_nm_s_rad) = (0.5, 0.02);
    let link = |stiffness_nm_rad: f64| Link {
        length_m,
        mass_kg: 2.0,
        centre_of_mass_m: 0.25,
        centre_of_mass_off_m: 0.0,
        inertia_kg_m2: 0.05,
        angle_deg: 0.0,
        stiffness_nm_rad,
        damping_nm_s_rad,
    };
    let body =
        BodySpec::Chain(ChainSpec { links: vec![link(2000.0), link(700.0)], gravity_m_s2: 0.0, unstated: vec![] });
    let assembly = Assembly::new(&StructureSpec { body, elements: vec![] }).unwrap();
    let [first, second] = assembly.modes() else { panic!() };
    let [w1, w2] = [first, second].map(|mode| TAU * mode.frequency_hz);
    let [mu1, mu2] = [first.damping_ratio * w1, second.damping_ratio * w2];
    // x of the tip is l (cos q₁ + cos(q₁ + q₂)).
    let by = |a: &[f64], b: &[f64]| length_m * (2.0 * a[0] * b[0] + a[0] * b[1] + a[1] * b[0] + a[1] * b[1]);
    let g = by(&first.shape, &second.shape);
    let expected_n = 4.0 * libm::sqrt(mu1 * mu2 * w1 * w2) / g.abs();
    let (tip, hz) = (assembly.dof("tip.x").unwrap(), (w1 + w2) / TAU);
    let forced = Forced::new(assembly, tip, 0.0);
    let ends = [0.5 * expected_n, 1.5 * expected_n];
    let mut options = TraceOptions::new(&forced, Coordinate::Amplitude, ends, vec![tip]);
    options.branch.least_harmonics = 9;
    options.branch.continuation = ContinuationSettings { state_floor: 0.1, ..options.branch.continuation };
    let branch = super::super::trace(&forced, hz, Coordinate::Amplitude, &options).unwrap();
    let found: Vec<_> = branch.bifurcations.iter().map(|found| (found.kind, found.orbit.value)).collect();
    let [(BifurcationKind::NeimarkSacker, force_n)] = found[..] else { panic!("{found:?}, expected {expected_n} N") };
    near(force_n, expected_n, 1e-3);
    assert_eq!(branch.orbits[0].is_stable(), Some(true));
    assert_eq!(branch.orbits.last().unwrap().is_stable(), Some(false));
}
