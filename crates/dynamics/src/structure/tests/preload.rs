//! Gaps and contacts with a preload, against closed forms.

use core::f64::consts::{PI, TAU};

use super::*;

const OMEGA: f64 = TAU * 20.0;

/// One mode of 20 Hz and 1 kg, with an element at its point.
fn one_mode(law: Law) -> Assembly {
    let modes = vec![ModeSpec { frequency_hz: 20.0, damping_ratio: 0.0 }];
    let shapes = vec![ShapeSpec { point: "tip".into(), axis: Axis::X, by_mode: vec![1.0] }];
    assembly(BodySpec::Modal(ModalSpec { modes, shapes }), vec![grounded(along("tip", Axis::X), law)])
}

/// The displacement and the velocity after so many steps of a period, from rest with a velocity.
fn after_period(law: Law, velocity_m_s: f64, period_s: f64) -> [f64; 2] {
    let assembly = one_mode(law);
    let mut stepper = Stepper::new(&assembly, &[], Scheme::Exponential8, 64.0 / period_s).unwrap();
    stepper.restore(&[0.0, velocity_m_s]).unwrap();
    (0..64).for_each(|_| stepper.advance(0.0, &[]).unwrap());
    assert_eq!(stepper.fallbacks(), 0);
    [stepper.position()[0], stepper.velocity()[0]]
}

/// Free vibration that lets go and returns. Closed, ω₁² = ω² + k; from 0 at the speed v it comes to −d, d = F/k, after
/// t₁ = asin(ω₁ d/v)/ω₁ at the speed √(v² − ω₁²d²). Open, it moves about F/ω² with the amplitude A, and is back after
/// 2 acos((d + F/ω²)/A)/ω. So the period is π/ω₁ + 2 t₁ + 2 t₂.
fn period_s(stiffness: f64, preload: f64, speed_m_s: f64) -> f64 {
    let (closed, d) = ((OMEGA * OMEGA + stiffness).sqrt(), preload / stiffness);
    let beyond = d + preload / (OMEGA * OMEGA);
    let left = speed_m_s * speed_m_s - closed * closed * d * d;
    let amplitude = (beyond * beyond + left / (OMEGA * OMEGA)).sqrt();
    PI / closed + 2.0 * (closed * d / speed_m_s).asin() / closed + 2.0 * (beyond / amplitude).acos() / OMEGA
}

#[test]
fn a_contact_with_a_preload_lets_go_and_returns_as_in_closed_form() {
    let (stiffness, preload, speed) = (3e4, 12.0, 0.3);
    for (side, sign) in [(Side::Positive, -1.0), (Side::Negative, 1.0)] {
        let law = Law::KelvinVoigt { stiffness, damping: 0.0, gap: 0.0, side, preload };
        let [x, v] = after_period(law, sign * speed, period_s(stiffness, preload, speed));
        assert!(x.abs() < 1e-13 && (v - sign * speed).abs() < 1e-11, "{x:e} {v}");
        // It stays closed below this speed, and is a spring.
        // Just below the speed at which the closed contact would come to −F/k, where it lets go.
        let slow = 0.99 * preload / stiffness * (OMEGA * OMEGA + stiffness).sqrt();
        let [x, v] = after_period(law, sign * slow, TAU / (OMEGA * OMEGA + stiffness).sqrt());
        assert!(x.abs() < 1e-13 && (v - sign * slow).abs() < 1e-11, "{x:e} {v}");
    }
}

/// A gap in whose play the mass does not cross over moves as the contact at its pressed flank.
#[test]
fn a_gap_with_a_preload_is_pressed_on_one_flank() {
    let (stiffness, speed) = (3e4, 0.3);
    for preload in [12.0, -12.0_f64] {
        let law = Law::Gap { stiffness, gap: 0.1, preload };
        let start = -speed * preload.signum();
        let [x, v] = after_period(law, start, period_s(stiffness, 12.0, speed));
        assert!(x.abs() < 1e-13 && (v - start).abs() < 1e-11, "{x:e} {v}");
    }
    // On the other flank: y = x + g + F/k is below −g, and the force is k (y + g) − F.
    let assembly = one_mode(Law::Gap { stiffness, gap: 0.001, preload: 12.0 });
    let force = |x: f64| assembly.elements()[0].force(x, 0.0, 0.0);
    // From −0.4 mm to −2.4 mm it is in its play, and 0.6 mm beyond it is pressed by 18 N on the other flank.
    for (x, expected) in [(0.0, 0.0), (0.001, 30.0), (-0.0004, -12.0), (-0.002, -12.0), (-0.003, -12.0 - 18.0)] {
        assert!((force(x).force - expected).abs() < 1e-9, "{x}: {:?}", force(x));
    }
}

/// k (x + δ)^1.5 − F with k δ^1.5 = F; its slope at rest is 1.5 k √δ.
#[test]
fn a_round_contact_with_a_preload_balances_at_rest() {
    let (stiffness, preload): (f64, f64) = (2e6, 30.0);
    let law = Law::HuntCrossley { stiffness, damping: 0.5, gap: 0.0, side: Side::Positive, preload };
    let assembly = one_mode(law);
    let depth = libm::pow(preload / stiffness, 2.0 / 3.0);
    let at_rest = assembly.elements()[0].force(0.0, 0.0, 0.0);
    assert!(at_rest.force.abs() < 1e-12, "{at_rest:?}");
    assert!((at_rest.by_position / (1.5 * stiffness * depth.sqrt()) - 1.0).abs() < 1e-12, "{at_rest:?}");
    assert!((at_rest.by_velocity / (preload * 0.5) - 1.0).abs() < 1e-12, "{at_rest:?}");
    let pressed = assembly.elements()[0].force(1e-4, 0.2, 0.0).force;
    let expected = stiffness * libm::pow(1e-4 + depth, 1.5) * 1.1 - preload;
    assert!((pressed / expected - 1.0).abs() < 1e-12, "{pressed} {expected}");
    assert_eq!(assembly.elements()[0].force(-1.01 * depth, 0.0, 0.0).force, -preload);
    // Energy: zero and least at rest, and −∂E/∂x the force without the damper.
    let energy = |x: f64| assembly.element_energy_j(&[x], &[]);
    assert!(energy(0.0) == 0.0 && energy(1e-5) > 0.0 && energy(-1e-5) > 0.0);
    let slope = (energy(1e-4 + 1e-8) - energy(1e-4 - 1e-8)) / 2e-8;
    assert!((slope / assembly.elements()[0].force(1e-4, 0.0, 0.0).force - 1.0).abs() < 1e-6);
}

/// Small vibrations keep the contact closed: its stiffness and its damper count in the modes.
#[test]
fn a_preload_stiffens_the_modes() {
    let law = Law::KelvinVoigt { stiffness: 3e4, damping: 40.0, gap: 0.0, side: Side::Positive, preload: 12.0 };
    let assembly = one_mode(law);
    let mode = &assembly.modes()[0];
    let omega = (OMEGA * OMEGA + 3e4).sqrt();
    assert!(
        (mode.frequency_hz - omega / TAU).abs() < 1e-9 && (mode.damping_ratio - 20.0 / omega).abs() < 1e-9,
        "{mode:?}"
    );
    let preload = assembly.parameter("element1.preload_n").unwrap();
    assert_eq!((preload.unit(), assembly.value(preload)), ("N", Ok(12.0)));
    let refused = |law: Law| {
        let body = one_mode(law).spec().body.clone();
        let gapped = Law::KelvinVoigt { stiffness: 3e4, damping: 0.0, gap: 1e-3, side: Side::Positive, preload: 12.0 };
        let elements = vec![grounded(along("tip", Axis::X), gapped)];
        Assembly::new(&StructureSpec { body, elements }).unwrap_err().to_string()
    };
    insta::assert_snapshot!(refused(law), @"element 1, kelvin-voigt: `gap` is 0.001: it must be 0 with a preload, because the contact is closed at rest");
}
