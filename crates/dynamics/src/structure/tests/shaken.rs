//! Structures that a shaker drives.

use super::*;
use crate::integrate::Scheme;
use core::f64::consts::TAU;
use nalgebra::Complex;

const FORCE_FACTOR_N_A: f64 = 20.0;
const RESISTANCE_OHM: f64 = 2.0;
// A current that follows at once, and time constants L/R of 0.15 ms and 5 ms.
const INDUCTANCES_H: [f64; 3] = [0.0, 3e-4, 1e-2];

fn voltage(inductance_h: f64) -> Coil {
    Coil::Voltage { force_factor_n_a: FORCE_FACTOR_N_A, resistance_ohm: RESISTANCE_OHM, inductance_h }
}

fn armature(of: &Assembly, shares: [f64; 2], coil: Coil) -> Armature {
    let along = ["tip.x", "tip.y"].map(|name| of.dof(name).ok());
    let along = core::array::from_fn(|axis| Some((along[axis]?, shares[axis])));
    Armature { along, mass_kg: 0.4, stiffness_n_m: 3000.0, damping_n_s_m: 8.0, coil }
}

fn stepper(of: &Assembly, armature: &Armature, rate_hz: f64) -> Stepper {
    Stepper::shaken(of, armature, Scheme::default(), rate_hz).unwrap()
}

fn saved(stepper: &Stepper) -> Vec<f64> {
    let mut saved = vec![0.0; stepper.saved_len()];
    stepper.save(&mut saved).unwrap();
    saved
}

/// Two links with a spring at the second joint that hardens.
fn chain() -> Assembly {
    chain_with(Law::Cubic { stiffness3: 5e8, stiffness5: 0.0 })
}

/// Two links with an element at the second joint.
fn chain_with(law: Law) -> Assembly {
    let link = |length_m: f64, angle_deg: f64| Link {
        length_m,
        mass_kg: 6.0,
        centre_of_mass_m: 0.2,
        centre_of_mass_off_m: 0.0,
        inertia_kg_m2: 0.09,
        angle_deg,
        stiffness_nm_rad: 3e4,
        damping_nm_s_rad: 4.0,
    };
    let links = vec![link(0.5, 30.0), link(0.4, 50.0)];
    assembly(
        BodySpec::Chain(ChainSpec { links, gravity_m_s2: 0.0, unstated: vec![] }),
        vec![grounded(Place::Joint(2), law)],
    )
}

/// A spring without stiffness makes the explicit steps take the same modes.
#[test]
fn the_exact_flow_is_that_of_the_explicit_steps() {
    let (exact, explicit) = (two_modes(Vec::new()), {
        let nothing = Law::Cubic { stiffness3: 0.0, stiffness5: 0.0 };
        two_modes(vec![grounded(along("tip", Axis::X), nothing)])
    });
    let points = ["tip.x", "mid.x"].map(|name| exact.dof(name).unwrap());
    let coils = INDUCTANCES_H.map(voltage).into_iter().chain([Coil::Current { force_factor_n_a: FORCE_FACTOR_N_A }]);
    for coil in coils {
        let of = |assembly: &Assembly| stepper(assembly, &armature(assembly, [1.0, 0.0], coil), 2000.0);
        let mut both = [of(&exact), of(&explicit)];
        let mut scale = [0.0_f64; 5];
        for step in 0..600 {
            // A command that varies, with a mean from the middle on.
            let blocked_n = 30.0 * libm::sin(0.11 * f64::from(step)) + if step > 300 { 10.0 } else { 0.0 };
            both.iter_mut().for_each(|stepper| stepper.advance(f64::from(step) / 2000.0, &[blocked_n]).unwrap());
            let states = both.each_ref().map(saved);
            for (k, scale) in scale.iter_mut().enumerate() {
                *scale = scale.max(states[0][k].abs());
                assert!((states[0][k] - states[1][k]).abs() <= 1e-8 * *scale, "{coil:?}, step {step}: {states:?}");
            }
            let accelerations = both.each_ref().map(|stepper| {
                let mut out = [[Kinematics::default(); 2]; 2];
                stepper.read(&[blocked_n], &points, &mut out[0]).unwrap();
                stepper.read_at_current(stepper.current_a().unwrap(), &points, &mut out[1]);
                out.map(|read| read.map(|of| of.acceleration))
            });
            let [[one, at_current], [other, _]] = accelerations;
            for k in 0..2 {
                assert!(
                    (one[k] - other[k]).abs() < 1e-5 && (one[k] - at_current[k]).abs() < 1e-9 * (1.0 + one[k].abs())
                );
            }
        }
    }
}

/// A current that follows in a millionth of a step is one that follows at once, but for its time constant L/R.
#[test]
fn a_fast_coil_is_that_without_inductance() {
    let of = two_modes(Vec::new());
    let inductance_h = 1e-9;
    let mut both =
        [0.0, inductance_h].map(|inductance_h| stepper(&of, &armature(&of, [1.0, 0.0], voltage(inductance_h)), 2000.0));
    let mut fastest = 0.0_f64;
    for step in 0..2000 {
        let blocked_n = if step < 100 { 30.0 } else { 0.0 };
        both.iter_mut().for_each(|stepper| stepper.advance(0.0, &[blocked_n]).unwrap());
        let [one, other] = both.each_ref().map(|stepper| stepper.position()[0]);
        fastest = fastest.max(both[0].velocity()[0].abs());
        assert!((one - other).abs() <= 2.0 * inductance_h / RESISTANCE_OHM * fastest, "step {step}: {one} {other}");
    }
}

/// s over F at the drive's point, with R its receptance: the force on the structure moves it by s = R (f − Z s),
/// Z = k − ω²m + iωc, and f = Bl (V − iω Bl s)/(R + iωL) with V = F R/Bl.
fn closed_form(omega: f64, inductance_h: f64) -> Complex<f64> {
    let i = Complex::new(0.0, 1.0);
    let mode = |hz: f64, zeta: f64, shape: f64| {
        let own = TAU * hz;
        shape * shape / (Complex::from(own * own - omega * omega) + i * (2.0 * zeta * own * omega))
    };
    let receptance = mode(20.0, 0.004, 0.5) + mode(57.0, 0.006, -0.4);
    let suspension = Complex::from(3000.0 - omega * omega * 0.4) + i * (8.0 * omega);
    let impedance = RESISTANCE_OHM + i * (omega * inductance_h);
    let drag = FORCE_FACTOR_N_A * FORCE_FACTOR_N_A * i * omega / impedance;
    receptance * (RESISTANCE_OHM / impedance) / (1.0 + receptance * (suspension + drag))
}

/// After two seconds, by when the coil has braked what was before, over the periods of half a second.
#[test]
fn a_shaken_mode_responds_as_the_closed_form_says() {
    const RATE_HZ: f64 = 16000.0;
    let (of, read_steps) = (two_modes(Vec::new()), 8000);
    for inductance_h in INDUCTANCES_H {
        for frequency_hz in [20.0, 50.0] {
            let omega = TAU * frequency_hz;
            let mut stepper = stepper(&of, &armature(&of, [1.0, 0.0], voltage(inductance_h)), RATE_HZ);
            let mut read = Complex::new(0.0, 0.0);
            for step in 0..5 * read_steps {
                let (sine, cosine) = libm::sincos(omega * f64::from(step) / RATE_HZ);
                if step >= 4 * read_steps {
                    let displacement_m = stepper.armature_motion().unwrap().displacement_m;
                    read += Complex::new(sine, cosine) * (displacement_m * 2.0 / f64::from(read_steps));
                }
                stepper.advance(0.0, &[sine]).unwrap();
            }
            // A held sine acts as one that is less by sin y/y and later by y, half a step.
            let half = 0.5 * omega / RATE_HZ;
            let held = Complex::new(libm::cos(half), -libm::sin(half)) * (libm::sin(half) / half);
            let expected = closed_form(omega, inductance_h) * held;
            let off = libm::sqrt((read - expected).norm_sqr() / expected.norm_sqr());
            assert!(off < 1e-6, "{inductance_h} H, {frequency_hz} Hz: {read} {expected} {off}");
        }
    }
}

/// The work of the amplifier is in the energy, or lost in coil, suspension and structure: by Simpson's rule over pairs
/// of steps under one command.
#[test]
fn energy_is_kept() {
    let gap = Law::Gap { stiffness: 2e5, gap: 2e-4, preload: 0.0 };
    // The first is stepped by the scheme unless its coil is too slow, the second by explicit steps between switches,
    // the third by the exact flow.
    for of in [chain(), two_modes(vec![grounded(along("mid", Axis::X), gap)]), two_modes(Vec::new())] {
        for inductance_h in INDUCTANCES_H {
            let armature = armature(&of, [0.6, 0.8], voltage(inductance_h));
            let mut stepper = stepper(&of, &armature, 64000.0);
            let (mut work_j, mut largest_j) = (0.0, 1e-3_f64);
            for pair in 0..2000 {
                let blocked_n = 60.0 * libm::sin(0.01 * f64::from(pair));
                let voltage_v = blocked_n * RESISTANCE_OHM / FORCE_FACTOR_N_A;
                let power_w = |stepper: &Stepper| {
                    let (motion, v) = (stepper.armature_motion().unwrap(), stepper.velocity());
                    let current_a =
                        armature.coil.current_a(stepper.current_a().unwrap(), blocked_n, motion.velocity_m_s);
                    voltage_v * current_a
                        - RESISTANCE_OHM * current_a * current_a
                        - armature.damping_n_s_m * motion.velocity_m_s * motion.velocity_m_s
                        - loss_w(&of, stepper.position(), v, &[])
                };
                let mut powers_w = [power_w(&stepper); 3];
                for power in &mut powers_w[1..] {
                    stepper.advance(0.0, &[blocked_n]).unwrap();
                    *power = power_w(&stepper);
                }
                work_j += (powers_w[0] + 4.0 * powers_w[1] + powers_w[2]) / 3.0 / 64000.0;
                let (q, v) = (stepper.position(), stepper.velocity());
                let current_a = stepper.current_a().unwrap();
                let own_j = armature.energy_j(&stepper.armature_motion().unwrap(), current_a);
                let energy_j = of.energy_j(q, v) + of.element_energy_j(q, &[]) + own_j;
                largest_j = largest_j.max(energy_j);
                assert!((energy_j - work_j).abs() <= 1e-5 * largest_j, "{inductance_h} H, {pair}: {energy_j} {work_j}");
            }
        }
    }
}

#[test]
fn a_saved_state_continues_with_the_same_bits() {
    for of in [chain(), two_modes(Vec::new())] {
        let mut stepper = stepper(&of, &armature(&of, [1.0, 0.0], voltage(1e-3)), 1000.0);
        (0..50).for_each(|_| stepper.advance(0.0, &[20.0]).unwrap());
        let mut again = self::stepper(&of, &armature(&of, [1.0, 0.0], voltage(1e-3)), 1000.0);
        again.restore(&saved(&stepper)[..stepper.states()]).unwrap();
        (0..50).for_each(|_| [&mut stepper, &mut again].iter_mut().for_each(|of| of.advance(0.0, &[-5.0]).unwrap()));
        assert_eq!(saved(&again), saved(&stepper));
        assert_eq!(stepper.current_a(), saved(&stepper).get(2 * of.coordinates()).copied());
    }
}

#[test]
fn says_what_a_shaker_cannot_be() {
    let of = chain_with(Law::Gap { stiffness: 1e4, gap: 1e-3, preload: 0.0 });
    let says = |inductance_h: f64| {
        Stepper::shaken(&of, &armature(&of, [1.0, 0.0], voltage(inductance_h)), Scheme::default(), 2000.0).unwrap_err()
    };
    insta::assert_snapshot!(says(1e-6), @"the current of the shaker's coil follows the voltage too fast for the step: `inductance_h` is 1e-6; it must be at least 7.8125e-6, or 0 for a current that follows at once");
    let mut stepper = stepper(&of, &armature(&of, [1.0, 0.0], voltage(0.0)), 2000.0);
    let sine = StepLoad::Sine { amplitude: &[1.0], omega_rad_s: 100.0 };
    insta::assert_snapshot!(stepper.advance_under(0.0, &sine).unwrap_err(), @"the shaker's command varies within the step: expected a load that is held over the step");
    let stiff = Armature { stiffness_n_m: 1e15, ..armature(&of, [1.0, 0.0], voltage(0.0)) };
    assert!(matches!(Stepper::shaken(&of, &stiff, Scheme::default(), 2000.0), Err(StepError::TooStiff { .. })));
}
