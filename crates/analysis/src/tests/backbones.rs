//! Backbones against closed forms, what the arm's own analysis gave, and the peak of the forced response.

use core::f64::consts::{FRAC_PI_2, TAU};

use super::*;
use crate::Bending;

const HZ: f64 = 20.0;
const PHI: f64 = 0.5;

/// One mode with an element at its point.
fn single(damping_ratio: f64, law: Law) -> Forced {
    let body = ModalSpec {
        modes: vec![ModeSpec { frequency_hz: HZ, damping_ratio }],
        shapes: vec![ShapeSpec { point: "tip".into(), axis: Axis::X, by_mode: vec![PHI] }],
    };
    let elements = vec![ElementSpec::Point { at: place("tip.x"), to: None, law }];
    let assembly = Assembly::new(&StructureSpec { body: BodySpec::Modal(body), elements }).unwrap();
    let tip = assembly.dof("tip.x").unwrap();
    Forced::new(assembly, tip, 1.0)
}

fn followed(forced: &Forced, largest: f64, largest_drive: f64) -> Backbone {
    let options = BackboneOptions::new(forced, 0, largest, largest_drive, vec![forced.drives()[0].0]);
    super::super::backbone(forced, &options).unwrap()
}

/// The mean of a and b of C. F. Gauss.
fn arithmetic_geometric_mean(mut a: f64, mut b: f64) -> f64 {
    // The number of digits doubles in each round.
    for _ in 0..20 {
        (a, b) = (0.5 * (a + b), libm::sqrt(a * b));
    }
    a
}

/// q̈ + ω²q + βq³ = 0 has the frequency √(ω² + βa²) π/(2K(m)), m = βa²/2/(ω² + βa²); of a single mode it is that of the
/// resonance with damping, too, whose drive balances the damper: A φ = 2ζωΩa of a nearly sinusoidal response.
#[test]
fn a_cubic_spring_has_the_frequency_of_an_elliptic_function() {
    let (stiffness3, omega) = (4e7, TAU * HZ);
    let exact_hz = |a: f64| {
        let (square, bend) = (omega * omega, stiffness3 * libm::pow(PHI, 4.0) * a * a);
        let m = 0.5 * bend / (square + bend);
        // K(m) = π/2M with the mean M of 1 and √(1 − m).
        libm::sqrt(square + bend) * arithmetic_geometric_mean(1.0, libm::sqrt(1.0 - m)) / TAU
    };
    let law = Law::Cubic { stiffness3, stiffness5: 0.0 };
    let free = followed(&single(0.0, law), 0.05, f64::INFINITY);
    for point in &free.points {
        let a = point.coordinates[0].largest;
        near(point.frequency_hz, exact_hz(a), 1e-9);
        // At its turning points all energy is in the springs.
        let spring_j = 0.5 * omega * omega * a * a + 0.25 * stiffness3 * libm::pow(PHI * a, 4.0);
        near(point.energy_j.unwrap(), spring_j, 1e-9);
        assert!(point.drive < 1e-6 * omega * omega * point.coordinates[0].largest, "{point:?}");
    }
    let last = free.points.last().unwrap();
    near(last.readings[0].largest, 0.05, 1e-9);
    near(last.coordinates[0].largest, 0.05 / PHI, 1e-9);
    assert!(last.frequency_hz > 1.4 * HZ && free.bending() == Some(Bending::Hardening), "{last:?}");
    // df/d(a²) = 3βω⁻¹/8/2π in q, and 1/φ² of that in the displacement.
    near(free.curvature(0).unwrap(), 0.375 * stiffness3 * PHI * PHI / omega / TAU, 1e-3);

    let zeta = 1e-3;
    let driven = followed(&single(zeta, law), 0.01, f64::INFINITY);
    for point in &driven.points {
        let a = point.coordinates[0].largest;
        near(point.frequency_hz, exact_hz(a), 1e-5);
        near(point.drive * PHI, 2.0 * zeta * omega * TAU * point.frequency_hz * a, 1e-2);
        near(point.readings[0].harmonic1.im, -point.readings[0].harmonic1.norm(), 1e-12);
    }
}

/// Two masses of 1 kg between three springs of 1 N/m, with 0.5 N/m³ at the first (G. Kerschen, M. Peeters, J. C.
/// Golinval, A. F. Vakakis, "Nonlinear normal modes, Part I", Mech. Syst. Signal Process. 23 (2009), Sec. 2).
fn two_masses() -> Forced {
    let mode = |rate: f64| ModeSpec { frequency_hz: rate / TAU, damping_ratio: 0.0 };
    let half = libm::sqrt(0.5);
    let shape =
        |point: &str, by_mode: [f64; 2]| ShapeSpec { point: point.into(), axis: Axis::X, by_mode: by_mode.into() };
    let body = ModalSpec {
        modes: vec![mode(1.0), mode(libm::sqrt(3.0))],
        shapes: vec![shape("m1", [half, half]), shape("m2", [half, -half])],
    };
    let law = Law::Cubic { stiffness3: 0.5, stiffness5: 0.0 };
    let elements = vec![ElementSpec::Point { at: place("m1.x"), to: None, law }];
    let assembly = Assembly::new(&StructureSpec { body: BodySpec::Modal(body), elements }).unwrap();
    let m1 = assembly.dof("m1.x").unwrap();
    Forced::new(assembly, m1, 1.0)
}

/// Returns the extremes of the frequency along a curve, rad/s, each with the energy there, J: those of the parabolas
/// through three points.
fn turns(points: &[BackboneOrbit]) -> Vec<[f64; 2]> {
    let of = |three: &[BackboneOrbit]| {
        let [a, b, c] = [0, 1, 2].map(|i| TAU * three[i].frequency_hz);
        let is_turn = (b - a) * (c - b) < 0.0;
        // By the energy: divided differences f[a, b] and f[a, b, c].
        let e = [0, 1, 2].map(|i| three[i].energy_j.unwrap());
        let first = (b - a) / (e[1] - e[0]);
        let second = ((c - b) / (e[2] - e[1]) - first) / (e[2] - e[0]);
        let at = 0.5 * (e[0] + e[1]) - 0.5 * first / second;
        is_turn.then(|| [a + (at - e[0]) * (first + (at - e[1]) * second), at])
    };
    points.windows(3).filter_map(of).collect()
}

/// Where three times the frequency of the first mode is that of the second, the curve runs into a tongue of motions in
/// which both take part, and comes back, with turns that shooting finds, too. It begins with so large a vibration in mind
/// that its first step has to be shortened.
#[test]
fn a_nonlinear_mode_is_followed_through_an_internal_resonance() {
    let forced = two_masses();
    let mut options = BackboneOptions::new(&forced, 0, 10.0, f64::INFINITY, vec![forced.drives()[0].0]);
    options.branch.continuation.largest_step = 0.02;
    let curve = super::super::backbone(&forced, &options).unwrap();
    let oracle: Value = serde_json::from_str(include_str!("../../../../tests/oracles/normal_modes.json")).unwrap();
    let expected = oracle["turns"].as_array().unwrap();
    let got = turns(&curve.points);
    assert!(got.len() >= expected.len() && expected.len() == 2, "{got:?}");
    for ([rate, energy_j], expected) in got.into_iter().zip(expected) {
        near(rate, number(expected, "rate_rad_s"), 1e-5);
        near(energy_j, number(expected, "energy_j"), 1e-2);
    }
    options.largest = 1e3;
    options.branch.most_points = 20;
    let early = super::super::backbone(&forced, &options).unwrap_err();
    assert_eq!(early.so_far.points.len(), 20, "{}", early.reason);
}

/// A free vibration between two stops: sinusoidal between them, and about another centre beyond.
#[test]
fn backlash_has_its_frequency_in_closed_form() {
    let (stiffness, gap, omega) = (2e4, 1e-3, TAU * HZ);
    let beyond = libm::sqrt(omega * omega + stiffness * PHI * PHI);
    let exact_hz = |x: f64| {
        let centre = stiffness * PHI * PHI * gap / (beyond * beyond);
        let (radius, start) = (x - centre, gap - centre);
        let speed = beyond * libm::sqrt(radius * radius - start * start);
        let inner = libm::atan2(gap * omega, speed) / omega;
        FRAC_PI_2 / (inner + libm::acos(start / radius) / beyond) / TAU
    };
    let curve = followed(&single(0.0, Law::Gap { stiffness, gap, preload: 0.0 }), 5e-3, f64::INFINITY);
    let mut compared = 0;
    for point in &curve.points {
        let largest = point.readings[0].largest;
        if largest < gap {
            near(point.frequency_hz, HZ, 1e-9);
        } else {
            near(point.frequency_hz, exact_hz(largest), 5e-6);
            compared += 1;
        }
    }
    assert!(compared > 10 && curve.points[0].readings[0].largest < 0.1 * gap, "{compared}");
}

/// A free vibration that lets go of a contact with a preload F and returns. Closed, ω₁² = ω² + kφ²; open, it moves about
/// X = Fφ²/ω² with the amplitude A, to the largest displacement A − X. From 0 at the speed v it lets go at d = F/k.
#[test]
fn a_contact_with_a_preload_has_its_frequency_in_closed_form() {
    let (stiffness, preload, omega) = (2e4, 10.0, TAU * HZ);
    let (closed, d) = (libm::sqrt(omega * omega + stiffness * PHI * PHI), preload / stiffness);
    let centre = preload * PHI * PHI / (omega * omega);
    let exact_hz = |largest: f64| {
        if largest <= d {
            return closed / TAU;
        }
        let (radius, start) = (largest + centre, d + centre);
        let squared = omega * omega * (radius * radius - start * start) + closed * closed * d * d;
        let leaving = libm::asin(closed * d / libm::sqrt(squared)) / closed;
        1.0 / (core::f64::consts::PI / closed + 2.0 * leaving + 2.0 * libm::acos(start / radius) / omega)
    };
    let law = Law::KelvinVoigt { stiffness, damping: 0.0, gap: 0.0, side: Side::Positive, preload };
    let curve = followed(&single(0.0, law), 4e-3, f64::INFINITY);
    for point in &curve.points {
        near(point.frequency_hz, exact_hz(point.readings[0].largest), 2e-5);
    }
    let [first, last] = [&curve.points[0], curve.points.last().unwrap()];
    assert!(first.readings[0].largest < 0.1 * d && last.readings[0].largest > 5.0 * d, "{:?}", first.readings);
}

/// A chain of two links has the backbone that the arm's own analysis gave: the periodic response at a largest angle of
/// 0.1 rad of joint 1, with damping and without.
#[test]
fn a_chain_of_two_links_has_the_backbone_of_the_arm() {
    let damped = chain_under(60.0, 1.0);
    let joints = ["joint1", "joint2"].map(|name| damped.assembly().dof(name).unwrap());
    let undamped = damped.undamped().unwrap();
    let of_arm = [
        (damped, 22.141_743_123_216_923, 0.083_380_190_215_721_23, 20.429_055_254_646_954, -1.682_466_757_165_722),
        (undamped, 22.141_741_037_005_637, 0.083_380_700_609_368_47, 0.0, -1.682_568_004_136_655),
    ];
    for (forced, hz, largest2_rad, drive_nm, curvature) in of_arm {
        let options = BackboneOptions::new(&forced, 0, 0.1, f64::INFINITY, joints.into());
        let got = super::super::backbone(&forced, &options).unwrap();
        let last = got.points.last().unwrap();
        near(last.frequency_hz, hz, 1e-10);
        near(last.readings[0].largest, 0.1, 1e-8);
        near(last.readings[1].largest, largest2_rad, 1e-8);
        assert!((last.drive - drive_nm).abs() < 1e-8 * 20.0, "{}", last.drive);
        assert_eq!(got.bending(), Some(Bending::Softening));
        near(got.curvature(0).unwrap(), curvature, 1e-4);
    }
}

/// A free vibration does not depend on a drive: it is that of the arm's own analysis, above, and exists where a force
/// reaches no mode, as one along the straight arm.
#[test]
fn a_free_vibration_needs_no_drive() {
    let bent = chain_of(60.0);
    let joints = ["joint1", "joint2"].map(|name| bent.dof(name).unwrap());
    let end = |forced: &Forced| {
        let options = BackboneOptions::new(forced, 0, 0.1, f64::INFINITY, joints.into());
        let curve = super::super::backbone(forced, &options).unwrap();
        let last = curve.points.last().unwrap().clone();
        assert!(last.drive < 1e-9, "{last:?}");
        (last.frequency_hz, last.readings[1].largest)
    };
    let (hz, largest2_rad) = end(&Forced::free(&bent, 0).unwrap());
    near(hz, 22.141_741_037_005_637, 1e-10);
    near(largest2_rad, 0.083_380_700_609_368_47, 1e-8);
    let straight = chain_of(0.0);
    let joint1 = Forced::new(straight.clone(), joints[0], 1.0).undamped().unwrap();
    let [free, driven] = [Forced::free(&straight, 0).unwrap(), joint1].map(|forced| end(&forced).0);
    near(free, driven, 1e-10);
    let friction = single(1e-3, Law::Friction { stiffness: 1e4, slip: 5.0 });
    let cubic = single(1e-3, Law::Cubic { stiffness3: 1e7, stiffness5: 0.0 });
    let refusal = |forced: &Forced, mode: usize| Forced::free(forced.assembly(), mode).unwrap_err().to_string();
    insta::assert_snapshot!(refusal(&friction, 0), @"element 1, friction, dissipates energy, so the undamped structure is not defined: leave the element out");
    insta::assert_snapshot!(refusal(&cubic, 4), @"there is no mode 5: the structure has modes 1 to 1");
}

/// At 74° the fitted arm has f2 ≈ 2 f1, and its first nonlinear mode turns from softening to hardening.
#[test]
fn the_first_mode_changes_its_bending_at_the_internal_resonance() {
    let bendings = [60.0, 70.0, 73.0, 74.0, 75.0, 78.0].map(|beta2_deg| {
        let undamped = chain_under(beta2_deg, 1.0).undamped().unwrap();
        followed(&undamped, 0.35, f64::INFINITY).bending()
    });
    use Bending::*;
    assert_eq!(bendings, [Softening, Softening, Softening, Hardening, Hardening, Hardening].map(Some));
}

/// The forced response has its peak where the backbone has the same drive.
#[test]
fn a_backbone_passes_the_peak_of_the_forced_response() {
    let case = &oracles("modal")[0];
    let (branch, assembly) = (branch_of(case), modal(case));
    let [drive, read] = ["drive", "read"].map(|key| assembly.dof(case[key].as_str().unwrap()).unwrap());
    let forced = Forced::new(assembly, drive, 1.0);
    let options = BackboneOptions::new(&forced, 0, f64::INFINITY, number(case, "force_n"), vec![read]);
    let curve = super::super::backbone(&forced, &options).unwrap();
    let (last, peak) = (curve.points.last().unwrap(), &branch.peaks[0]);
    near(last.drive, number(case, "force_n"), 1e-9);
    near(last.frequency_hz, peak.frequency_hz, 1e-4);
    near(last.readings[0].largest, peak.readings[0].largest, 1e-4);
}

/// A force along the straight arm bends neither joint, so it drives no mode.
#[test]
fn a_mode_that_is_not_driven_is_an_error() {
    let assembly = chain_of(0.0);
    let tip = assembly.dof("tip.x").unwrap();
    let forced = Forced::new(assembly, tip, 1.0);
    let options = BackboneOptions::new(&forced, 0, 0.1, f64::INFINITY, vec![tip]);
    insta::assert_snapshot!(super::super::backbone(&forced, &options).unwrap_err(), @"this excitation does not drive mode 1, 20.429754 Hz: the mode never lags the load by 90°; drive the structure at another point or along another axis");
}

/// A load too weak for the first amplitude still gives a curve, which ends there; one that ends early keeps its points.
#[test]
fn backbones_end_at_the_load_or_keep_what_they_have() {
    let forced = chain_under(60.0, 1.0);
    let mut options = BackboneOptions::new(&forced, 0, f64::INFINITY, 0.1, vec![forced.drives()[0].0]);
    let whole = super::super::backbone(&forced, &options).unwrap();
    near(whole.points.last().unwrap().drive, 0.1, 1e-9);
    assert!(whole.points.len() > 5);
    options.branch.most_points = 4;
    let early = super::super::backbone(&forced, &options).unwrap_err();
    assert_eq!(early.so_far.points, whole.points[..4]);
}

/// A structure without a linear mode is rejected, and so is one without a free vibration.
#[test]
fn a_backbone_refuses_what_it_can_not_begin_with() {
    let friction = single(1e-3, Law::Friction { stiffness: 1e4, slip: 5.0 });
    let refusal = |forced: &Forced, mode: usize| {
        let options = BackboneOptions::new(forced, mode, 0.01, 10.0, vec![forced.drives()[0].0]);
        super::super::backbone(forced, &options).unwrap_err().to_string()
    };
    insta::assert_snapshot!(refusal(&friction, 0), @"element 1, friction, acts at infinitesimal amplitude, but a backbone must begin as a linear mode; leave the element out, or give a contact a gap");
    insta::assert_snapshot!(friction.undamped().unwrap_err(), @"element 1, friction, dissipates energy, so the undamped structure is not defined: leave the element out");
    let cubic = single(1e-3, Law::Cubic { stiffness3: 1e7, stiffness5: 0.0 });
    insta::assert_snapshot!(refusal(&cubic, 4), @"there is no mode 5: the structure has modes 1 to 1");
}
