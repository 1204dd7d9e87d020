//! Branches that start near a given state.

use super::textbook::duffing;
use super::*;
use crate::phase_zero::{phase_zero_state, phase_zero_states};

/// The first response of a branch that starts near a state.
fn first_near(forced: &Forced, frequency_hz: f64, state: &[f64]) -> Result<Orbit, AnalysisError> {
    let tip = forced.drives()[0].0;
    let mut options =
        TraceOptions::new(forced, Coordinate::FrequencyHz, [frequency_hz, 1.001 * frequency_hz], vec![tip]);
    (options.assess, options.near) = (Assess::Nothing, Some(state.to_vec()));
    let branch = crate::trace(forced, frequency_hz, Coordinate::FrequencyHz, &options);
    branch.map(|branch| branch.orbits[0].clone()).map_err(|early| early.reason)
}

fn relative_distance(a: &[f64], b: &[f64]) -> f64 {
    let norm = |of: &mut dyn Iterator<Item = f64>| libm::sqrt(of.map(|x| x * x).sum());
    norm(&mut a.iter().zip(b).map(|(a, b)| a - b)) / norm(&mut b.iter().copied())
}

/// Between its folds Duffing's oscillator has three responses, one of them unstable: each is found from its own state,
/// also from one beside it.
#[test]
fn each_of_several_responses_is_found_from_its_state() {
    let forced = duffing(0.02, 0.5, 0.1);
    let tip = forced.drives()[0].0;
    let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [0.1, 0.4], vec![tip]);
    let branch = crate::trace(&forced, 0.1, Coordinate::FrequencyHz, &options).unwrap();
    let [first, second] = [0, 1].map(|fold| branch.bifurcations[fold].orbit.value);
    let frequency_hz = 0.5 * (first + second);
    let states = phase_zero_states(&forced, &branch, frequency_hz, &options);
    assert_eq!(states.len(), 3);
    for state in &states {
        for off in [0.0, 0.01] {
            let beside: Vec<f64> = state.iter().map(|number| number * (1.0 + off)).collect();
            let found = first_near(&forced, frequency_hz, &beside).unwrap();
            let found = phase_zero_state(&forced, Coordinate::FrequencyHz, &found).unwrap();
            let apart = relative_distance(&found, state);
            assert!(apart < 1e-6, "{state:?} {off}: {found:?}");
        }
    }
}

/// The sub-harmonics of order 3 of a Duffing oscillator, which no branch from rest reaches: states by another code's
/// shooting (SciPy, an explicit method of order 8 at a tolerance of 1e-12).
#[test]
fn subharmonics_are_found_from_a_state() {
    let (forced, hz) = (duffing(0.005, 1.0, 4.0), 4.5 / TAU);
    let cases = [
        ([1.168_669_221_164_326_4, 0.115_096_862_609_018_84], 1.200_708_7),
        ([0.947_529_031_185_335_5, -2.026_114_090_757_307], 1.378_036_5),
    ];
    for (state, largest) in cases {
        let found = first_near(&forced, hz, &state).unwrap();
        assert_eq!(found.period, 3);
        near(found.readings[0].largest, largest, 1e-6);
        let again = phase_zero_state(&forced, Coordinate::FrequencyHz, &found).unwrap();
        assert!(relative_distance(&again, &state) < 1e-6, "{again:?} {state:?}");
    }
}

/// States of friction that slips count, and a chain starts as modes do.
#[test]
fn states_of_elements_and_of_chains_are_taken_up() {
    let mut spec = preset_at(Preset::Irb1600Fitted, [0.0, 60.0]).spec().clone();
    let law = Law::Lugre {
        bristle_stiffness: 1e4,
        bristle_damping: 1.0,
        viscous: 0.5,
        coulomb: 2.0,
        breakaway: 3.0,
        stribeck: 0.05,
    };
    spec.elements = vec![ElementSpec::Point { at: Place::Joint(2), to: None, law }];
    let assembly = Assembly::new(&spec).unwrap();
    let joint = assembly.dof("joint1").unwrap();
    let forced = Forced::new(assembly, joint, 60.0);
    let mut options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [21.0, 21.1], vec![joint]);
    options.assess = Assess::Nothing;
    let branch = crate::trace(&forced, 21.0, Coordinate::FrequencyHz, &options).unwrap();
    let state = phase_zero_state(&forced, Coordinate::FrequencyHz, &branch.orbits[0]).unwrap();
    // Two deflections, two rates and the state of the bristles, which is 0 where it is not given.
    assert_eq!(state.len(), 5);
    for given in [&state[..], &state[..4]] {
        let found = first_near(&forced, 21.0, given).unwrap();
        near(found.readings[0].largest, branch.orbits[0].readings[0].largest, 1e-4);
    }
}

#[test]
fn a_state_that_starts_nothing_is_said() {
    let forced = duffing(0.005, 1.0, 4.0);
    let says = |state: &[f64]| first_near(&forced, 4.5 / TAU, state).unwrap_err().to_string();
    insta::assert_snapshot!(says(&[0.1]), @"the state to start from has 1 finite numbers: expected 2, the coordinates and their rates");
    insta::assert_snapshot!(says(&[0.1, f64::NAN]), @"the state to start from has 1 finite numbers: expected 2, the coordinates and their rates");
    let far = says(&[3.0, 7.0]);
    assert!(far.starts_with("no periodic response was found near the given state at 0.716197 Hz. From the state the structure was integrated over 1 period, after which it is off by "), "{far}");
    assert!(far.ends_with("Give a state at phase 0 of the load, at this frequency and load"), "{far}");
}
