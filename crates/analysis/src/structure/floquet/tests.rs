//! Multipliers against those of the flow in much smaller steps.

use alloc::vec;

use resonarm_dynamics::structure::{
    Assembly, Axis, BodySpec, ElementSpec, Law, ModalSpec, ModeSpec, Place, ShapeSpec, StructureSpec,
};

use super::*;
use crate::structure::{Assess, Coordinate, Forced, TraceOptions, trace};

/// Modes 30 Hz apart, with an element at the tip.
fn modes(count: usize, law: Law) -> Forced {
    let mode = |i: usize| ModeSpec { frequency_hz: 20.0 + 30.0 * i as f64, damping_ratio: 0.005 };
    let by_mode = (0..count).map(|i| 0.5 / (1.0 + 0.3 * i as f64)).collect();
    let shapes = vec![ShapeSpec { point: "tip".into(), axis: Axis::X, by_mode }];
    let at = Place::Dof { point: "tip".into(), axis: Axis::X };
    let body = BodySpec::Modal(ModalSpec { modes: (0..count).map(mode).collect(), shapes });
    let assembly = Assembly::new(&StructureSpec { body, elements: vec![ElementSpec { at, to: None, law }] }).unwrap();
    let tip = assembly.dof("tip.x").unwrap();
    Forced::new(assembly, tip, 10.0)
}

/// The largest distance between two sets of multipliers, each of one with the nearest of the other.
fn distance(a: &Stability, b: &Stability) -> f64 {
    let mut others = b.multipliers.clone();
    assert_eq!(a.multipliers.len(), others.len());
    let mut largest = 0.0_f64;
    for mu in &a.multipliers {
        let off = |other: &Complex<f64>| (mu - other).norm_sqr();
        let nearest = (0..others.len()).fold(0, |best, k| if off(&others[k]) < off(&others[best]) { k } else { best });
        largest = largest.max(libm::sqrt(off(&others.swap_remove(nearest))));
    }
    largest
}

/// The flow with all of its steps so many times.
fn fine_flow(balance: &Balance, x: &[f64], times: f64) -> Stability {
    let Body::Condensed(condensed) = &balance.unknowns.body else { panic!() };
    let fastest_hz = balance.forced.assembly().modes().last().unwrap().frequency_hz;
    let of = Variations::new(balance, x, times * 8.0 * fastest_hz / balance.frequency_hz);
    let [finest, middle, coarsest] = [2, 4, 8].map(|points| modal::flow(&of, condensed, points).unwrap());
    multipliers((finest * 64.0 - middle * 20.0 + coarsest) / 45.0).unwrap()
}

/// Along a branch around its folds, with an element that hardens, where all motions have their exponents, and with one
/// that damps, where most have.
#[test]
fn exponents_of_many_modes_are_those_of_their_flow() {
    let laws = [(Law::Cubic { stiffness3: 2e8, stiffness5: 0.0 }, 1.0), (Law::Tanh { slip: 3.0, velocity: 0.1 }, 0.5)];
    for (law, share) in laws {
        let forced = modes(9, law);
        let mut options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [15.0, 28.0], vec![forced.drive()]);
        options.assess = Assess::Nothing;
        let branch = trace(&forced, 15.0, Coordinate::FrequencyHz, &options).unwrap();
        let (mut tested, mut by_exponents) = (0, 0);
        for orbit in branch.orbits.iter().step_by(6) {
            let mut balance = Balance::new(&forced, orbit.frequency_hz, Coordinate::FrequencyHz, orbit.harmonics);
            assert!(balance.set_value(orbit.value));
            tested += 1;
            let x = &orbit.coefficients;
            let Some(got) = exponents::stability(&Variations::new(&balance, x, LEAST_STEPS[0])) else { continue };
            by_exponents += 1;
            let off = distance(&got, &fine_flow(&balance, x, 4.0));
            assert!(off < 1e-8, "{} at {} Hz: {off:.1e}", law.name(), orbit.value);
        }
        assert!(f64::from(by_exponents) >= share * f64::from(tested), "{}: {by_exponents} of {tested}", law.name());
    }
}
