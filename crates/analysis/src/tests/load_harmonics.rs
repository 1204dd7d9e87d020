//! Responses to loads of several harmonics.

use super::textbook::duffing;
use super::*;
use crate::phase_zero_state;
use crate::time_domain::StroboscopicMap;

fn harmonic(order: usize, ratio: f64, phase_rad: f64) -> LoadHarmonic {
    LoadHarmonic { order, ratio, phase_rad }
}

/// A linear structure responds to each harmonic by its own frequency response.
#[test]
fn a_linear_response_is_the_sum_of_its_harmonics() {
    let forced = duffing(0.02, 0.0, 0.1).with_harmonics(vec![harmonic(2, 0.5, 0.0), harmonic(5, -3.0, 0.8)]);
    let tip = forced.drives()[0].0;
    let mut options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [0.05, 0.1], vec![tip]);
    options.assess = Assess::Nothing;
    let branch = crate::trace(&forced, 0.05, Coordinate::FrequencyHz, &options).unwrap();
    assert!(branch.orbits.iter().all(|orbit| orbit.harmonics >= 5));
    for orbit in &branch.orbits {
        // The third harmonic, which the load has not, must be absent from the response, too.
        for (order, ratio, phase) in [(1_u32, 1.0, 0.0), (2, 0.5, 0.0), (3, 0.0, 0.0), (5, -3.0, 0.8)] {
            let w = f64::from(order) * TAU * orbit.frequency_hz;
            // Im of H p e^{iφ} e^{ikΩt} with H = 1/(1 − w² + 2iζw): the cosine has its imaginary part, the sine its real
            // part.
            let turn = Complex::new(libm::cos(phase), libm::sin(phase));
            let expected = turn * 0.1 * ratio / Complex::new(1.0 - w * w, 0.04 * w);
            let at = 2 * order as usize;
            let found = Complex::new(orbit.coefficients[at], orbit.coefficients[at - 1]);
            assert!((found - expected).norm() < 1e-9, "{order}: {found} {expected}");
        }
    }
}

/// The state at phase 0 returns after a period of integration in time: of modes with an element, and of a chain, whose
/// load turns with it.
#[test]
fn responses_return_in_time() {
    let arm = preset_at(Preset::Irb1600Fitted, [0.0, 60.0]);
    let tip = arm.dof("tip.x").unwrap();
    let chain = Forced::new(arm, tip, 60.0).with_harmonics(vec![harmonic(2, 0.4, 1.0), harmonic(3, -0.3, 0.0)]);
    let modal = duffing(0.02, 0.5, 0.3).with_harmonics(vec![harmonic(3, 0.5, -0.4)]);
    for (forced, ends) in [(chain, [21.8, 22.4]), (modal, [0.12, 0.2])] {
        let read = forced.drives()[0].0;
        let options = TraceOptions::new(&forced, Coordinate::FrequencyHz, ends, vec![read]);
        let branch = crate::trace(&forced, ends[0], Coordinate::FrequencyHz, &options).unwrap();
        for orbit in [&branch.orbits[branch.orbits.len() / 3], branch.orbits.last().unwrap()] {
            let state = phase_zero_state(&forced, Coordinate::FrequencyHz, orbit).unwrap();
            let map = StroboscopicMap::new(&forced, orbit.frequency_hz).unwrap();
            let end = map.advance(&state).unwrap();
            let mut together = vec![state.clone(); 3];
            map.advance_all(&mut together, 1).unwrap();
            assert!(together.iter().all(|other| *other == end));
            let scale = |i: usize| if i < state.len() / 2 { 1.0 } else { TAU * orbit.frequency_hz };
            let size = (0..state.len()).map(|i| state[i].abs() / scale(i)).fold(0.0, f64::max);
            for (i, (state, end)) in state.iter().zip(&end).enumerate() {
                assert!((state - end).abs() / scale(i) < 2e-7 * size, "{i}: {state} {end} of {size}");
            }
            assert!(orbit.stability.is_some());
        }
    }
}

/// A branch in the amplitude and one in the frequency meet: all harmonics keep their ratio to the first.
#[test]
fn the_amplitude_scales_all_harmonics() {
    let forced = duffing(0.05, 0.5, 0.4).with_harmonics(vec![harmonic(3, 0.5, 0.2)]);
    let read = vec![forced.drives()[0].0];
    let mut options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [0.1, 0.13], read.clone());
    options.assess = Assess::Nothing;
    let over_frequency = crate::trace(&forced, 0.1, Coordinate::FrequencyHz, &options).unwrap();
    let mut options = TraceOptions::new(&forced, Coordinate::Amplitude, [0.05, 0.4], read);
    options.assess = Assess::Nothing;
    let over_amplitude = crate::trace(&forced, 0.13, Coordinate::Amplitude, &options).unwrap();
    let [one, other] = [over_frequency, over_amplitude].map(|branch| branch.orbits.last().unwrap().readings[0].largest);
    near(one, other, 1e-8);
}

#[test]
fn loads_that_make_no_sense_are_refused() {
    let forced = duffing(0.02, 0.5, 0.1).with_harmonics(vec![harmonic(9, 0.5, 0.0)]);
    let read = vec![forced.drives()[0].0];
    let mut options = TraceOptions::new(&forced, Coordinate::FrequencyHz, [0.1, 0.2], read.clone());
    options.branch.most_harmonics = 7;
    let error = crate::trace(&forced, 0.1, Coordinate::FrequencyHz, &options).unwrap_err();
    insta::assert_snapshot!(error.reason, @"the load has the harmonic 9, and responses have at most 7 harmonics: allow more");
    let error = backbone(&forced, &BackboneOptions::new(&forced, 0, 0.1, 1.0, read)).unwrap_err();
    insta::assert_snapshot!(error.reason, @"a backbone is the resonance under a single sine: leave the harmonics of the load out");
}
