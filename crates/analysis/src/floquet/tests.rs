//! Multipliers against those of the flow in much smaller steps.

use alloc::vec;
use core::f64::consts::TAU;

use resonarm_dynamics::structure::{
    Assembly, Axis, BodySpec, ElementSpec, Law, ModalSpec, ModeSpec, Place, ShapeSpec, StructureSpec,
};

use resonarm_numeric::noise::Noise;

use super::*;
use crate::{Assess, Coordinate, Forced, TraceOptions, trace};

/// Modes by frequency, damping ratio and shape, with an element at their one point.
fn with_element(modes: &[(f64, f64, f64)], law: Law) -> Forced {
    let by_mode = modes.iter().map(|(_, _, phi)| *phi).collect();
    let shapes = vec![ShapeSpec { point: "tip".into(), axis: Axis::X, by_mode }];
    let at = Place::Dof { point: "tip".into(), axis: Axis::X };
    let modes = modes.iter().map(|&(frequency_hz, damping_ratio, _)| ModeSpec { frequency_hz, damping_ratio });
    let body = BodySpec::Modal(ModalSpec { modes: modes.collect(), shapes });
    let assembly =
        Assembly::new(&StructureSpec { body, elements: vec![ElementSpec::Point { at, to: None, law }] }).unwrap();
    let tip = assembly.dof("tip.x").unwrap();
    Forced::new(assembly, tip, 10.0)
}

/// Modes 30 Hz apart.
fn modes(count: usize, law: Law) -> Forced {
    let mode = |i: f64| (20.0 + 30.0 * i, 0.005, 0.5 / (1.0 + 0.3 * i));
    with_element(&(0..count).map(|i| mode(i as f64)).collect::<Vec<_>>(), law)
}

/// The largest distance between two sets of multipliers, each of one with the nearest of the other.
fn distance(a: &[Complex<f64>], b: &[Complex<f64>]) -> f64 {
    let mut others = b.to_vec();
    assert_eq!(a.len(), others.len());
    let mut largest = 0.0_f64;
    for mu in a {
        let off = |other: &Complex<f64>| (mu - other).norm_sqr();
        let nearest = (0..others.len()).fold(0, |best, k| if off(&others[k]) < off(&others[best]) { k } else { best });
        largest = largest.max(libm::sqrt(off(&others.swap_remove(nearest))));
    }
    largest
}

/// The variations along a periodic response, without storage.
fn variations<'a>(balance: &'a Balance, x: &[f64], steps: f64) -> Variations<'a> {
    Variations::new(balance, x, steps, Samples::new(&balance.forced, &balance.unknowns))
}

fn exponents_of(balance: &Balance, x: &[f64]) -> Option<Vec<Complex<f64>>> {
    exponents::stability(&mut variations(balance, x, LEAST_STEPS[0])).map(|found| found.multipliers)
}

/// The flow with all of its steps so many times.
fn fine_flow(balance: &Balance, x: &[f64], times: f64) -> Vec<Complex<f64>> {
    let Body::Condensed(condensed) = &balance.unknowns.body else { panic!() };
    let fastest_hz = balance.forced.assembly().modes().last().unwrap().frequency_hz;
    let of = variations(balance, x, times * 8.0 * fastest_hz / balance.frequency_hz);
    let [finest, middle, coarsest] = [2, 4, 8].map(|points| modal::flow(&of, condensed, [points, 1]).unwrap());
    multipliers((finest * 64.0 - middle * 20.0 + coarsest) / 45.0).unwrap()
}

/// Along a branch around its folds, with an element that hardens, where all responses have their exponents, and with
/// one that damps, where most have.
#[test]
fn exponents_of_many_modes_are_those_of_their_flow() {
    let laws = [(Law::Cubic { stiffness3: 2e8, stiffness5: 0.0 }, 1.0), (Law::Tanh { slip: 3.0, velocity: 0.1 }, 0.5)];
    for (law, share) in laws {
        let forced = modes(9, law);
        let mut options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [15.0, 28.0], vec![forced.drives()[0].0]);
        options.assess = Assess::Nothing;
        let branch = trace(&forced, 15.0, Coordinate::FrequencyHz, &options).unwrap();
        let (mut tested, mut by_exponents) = (0, 0);
        for orbit in branch.orbits.iter().step_by(6) {
            let mut balance = Balance::new(&forced, orbit.frequency_hz, Coordinate::FrequencyHz, orbit.harmonics);
            assert!(balance.set_value(orbit.value));
            tested += 1;
            let x = &orbit.coefficients;
            let Some(got) = exponents_of(&balance, x) else { continue };
            by_exponents += 1;
            let off = distance(&got, &fine_flow(&balance, x, 4.0));
            assert!(off < 1e-8, "{} at {} Hz: {off:.1e}", law.name(), orbit.value);
        }
        assert!(f64::from(by_exponents) >= share * f64::from(tested), "{}: {by_exponents} of {tested}", law.name());
    }
}

const HZ: f64 = 20.0;

/// Modes with frequencies almost equal, or whose sums or differences are almost multiples of [`HZ`].
fn resonant_modes(noise: &mut Noise) -> Vec<(f64, f64, f64)> {
    let damping = 0.02 * libm::pow(10.0, -3.0 * noise.uniform());
    let mut hz = vec![HZ * (0.7 + 0.6 * noise.uniform())];
    for _ in 1..5 + noise.bits() % 5 {
        let detuned_hz = HZ * (noise.uniform() - 0.5) * libm::pow(10.0, -8.0 * noise.uniform());
        let order = HZ * (1 + noise.bits() % 20) as f64;
        let other = hz[(noise.bits() % hz.len() as u64) as usize];
        let near = [other, order + other, (order - other).abs(), 400.0 * noise.uniform()];
        hz.push((near[(noise.bits() % 4) as usize] + detuned_hz).max(3.0));
    }
    hz.sort_by(f64::total_cmp);
    let mode = |hz: &f64| (*hz, damping * (0.5 + noise.uniform()), 0.6 * libm::pow(10.0, -1.5 * noise.uniform()));
    hz.iter().map(mode).collect()
}

/// Along responses with even harmonics or without: where modes resonate with each other, harmonics that are left out,
/// or sweeps that end early, would show, and one exponent could be taken for two.
#[test]
fn exponents_of_modes_that_resonate_are_those_of_their_flow() {
    let harmonics = 9;
    let mut by_exponents = 0;
    for seed in 0..150 {
        let mut noise = Noise::new(seed, 0);
        let law = match seed % 3 {
            0 => Law::Tanh { slip: 10.0 * noise.uniform(), velocity: 0.05 + noise.uniform() },
            _ => Law::Cubic { stiffness3: 2e8, stiffness5: 0.0 },
        };
        let forced = with_element(&resonant_modes(&mut noise), law);
        let mut balance = Balance::new(&forced, HZ, Coordinate::FrequencyHz, harmonics);
        assert!(balance.set_value(HZ));
        let (amplitude_m, ratio) = (0.01 * libm::pow(10.0, -3.0 * noise.uniform()), 0.1 + 0.6 * noise.uniform());
        let mut x = vec![0.0; 2 * harmonics + 1];
        for k in (1..=harmonics).step_by(1 + (noise.bits() % 2) as usize) {
            let (sine, cosine) = libm::sincos(TAU * noise.uniform());
            let of_harmonic = amplitude_m * libm::pow(ratio, k as f64 - 1.0);
            (x[2 * k - 1], x[2 * k]) = (of_harmonic * cosine, of_harmonic * sine);
        }
        let Some(got) = exponents_of(&balance, &x) else { continue };
        by_exponents += 1;
        let off = distance(&got, &fine_flow(&balance, &x, 8.0));
        assert!(off < 1e-8, "seed {seed}, {}: {off:.1e}", law.name());
    }
    assert!(by_exponents >= 100, "{by_exponents}");
}

/// Storage that other responses have used, with other numbers of harmonics, of points and of slips, does not change the
/// result.
#[test]
fn storage_of_another_response_leaves_no_trace() {
    let laws = [
        Law::Cubic { stiffness3: 2e8, stiffness5: 0.0 },
        Law::Gap { stiffness: 2e4, gap: 5e-4, preload: 0.0 },
        Law::Friction { stiffness: 2e4, slip: 5.0 },
    ];
    for law in laws {
        let (forced, mut kept) = (modes(6, law), Floquet::default());
        for (harmonics, amplitude_m, hz) in [(9, 2e-3, 20.0), (13, 1e-4, 3.0), (5, 2e-3, 21.0)] {
            let mut balance = Balance::new(&forced, hz, Coordinate::FrequencyHz, harmonics);
            assert!(balance.set_value(hz));
            let mut x = vec![0.0; 2 * harmonics + 1];
            (x[2], x[5]) = (amplitude_m, 0.1 * amplitude_m);
            let fresh = Floquet::default().stability(&balance, &x);
            assert!(fresh.is_some());
            assert_eq!(kept.stability(&balance, &x), fresh, "{} at {hz} Hz", law.name());
        }
    }
}

/// A symmetric response has the multipliers of its half, and one that isn't has those of the whole period.
#[test]
fn multipliers_of_half_a_period_are_those_of_the_whole() {
    for law in [Law::Gap { stiffness: 2e4, gap: 5e-4, preload: 0.0 }, Law::Friction { stiffness: 2e4, slip: 5.0 }] {
        let forced = modes(6, law);
        for (second, is_symmetric) in [(0.0, true), (1e-4, false)] {
            let balance = Balance::new(&forced, HZ, Coordinate::FrequencyHz, 9);
            let mut x = vec![0.0; 19];
            (x[2], x[3], x[5]) = (2e-3, second, 2e-4);
            let of = variations(&balance, &x, LEAST_STEPS[1]);
            assert_eq!(of.repeat_after_half(), is_symmetric, "{}", law.name());
            let Body::Condensed(condensed) = &balance.unknowns.body else { panic!() };
            let whole = multipliers(modal::flow(&of, condensed, [2, 1]).unwrap()).unwrap();
            let off = distance(&by_flow(&of).unwrap().stability.multipliers, &whole);
            assert!(off < 1e-10, "{}: {off:.1e}", law.name());
        }
    }
}
