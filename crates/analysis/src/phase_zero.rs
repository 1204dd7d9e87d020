//! States of a branch's responses at phase 0 of the drive.

use alloc::vec::Vec;

use super::balance::Balance;
use super::detect::point_of;
use crate::continuation::at_parameter;
use crate::forced::{Coordinate, Forced};
use crate::orbit::{Branch, Orbit};
use crate::trace_options::TraceOptions;

/// Returns the states, at phase 0 and at one frequency, Hz, of the responses of a branch over the frequency:
/// coordinates, rates, states of elements. Each is solved for between its neighbours on the branch, or is the first of
/// them if Newton's method fails.
pub(super) fn phase_zero_states(
    forced: &Forced,
    branch: &Branch,
    frequency_hz: f64,
    options: &TraceOptions,
) -> Vec<Vec<f64>> {
    let crosses =
        |pair: &&[Orbit]| (pair[0].frequency_hz - frequency_hz) * (pair[1].frequency_hz - frequency_hz) <= 0.0;
    let state = |pair: &[Orbit]| {
        let harmonics = pair[0].harmonics.max(pair[1].harmonics);
        let mut balance = Balance::new(forced, frequency_hz, Coordinate::FrequencyHz, harmonics);
        let [a, b] = [0, 1].map(|end| point_of(&pair[end]));
        let settings = &options.branch.continuation;
        let found = at_parameter(&mut balance, settings, [&a, &b], frequency_hz).map_or(a.x, |point| point.x);
        // The frequency is that of a map.
        let _ = balance.set_value(frequency_hz);
        balance.evaluate_orbit(&found);
        at_phase_zero(&balance)
    };
    branch.orbits.windows(2).filter(crosses).map(state).collect()
}

/// Returns the state of a response on a branch in a coordinate, at phase 0 of the drive: coordinates, rates, and the states
/// of elements. `None` if the structure does not exist at its value of the coordinate.
pub fn phase_zero_state(forced: &Forced, coordinate: Coordinate, orbit: &Orbit) -> Option<Vec<f64>> {
    let mut balance = Balance::at_orbit(forced, coordinate, orbit)?;
    balance.evaluate_orbit(&orbit.coefficients);
    Some(at_phase_zero(&balance))
}

/// Returns the state of the response last evaluated: q = c₀ + Σ aₖ and q̇ = Σ kΩ bₖ of each coordinate, then z.
pub(super) fn at_phase_zero(balance: &Balance) -> Vec<f64> {
    let n = balance.forced.assembly.coordinates();
    let mut state = Vec::with_capacity(2 * n);
    let mut rates = Vec::<f64>::with_capacity(n);
    for coordinate in 0..n {
        let series = balance.coordinate_series(coordinate);
        let pairs = || series[1..].chunks_exact(2);
        state.push(series[0] + pairs().map(|pair| pair[0]).sum::<f64>());
        let rate = |(k, pair): (u32, &[f64])| f64::from(k) * balance.omega_rad_s() * pair[1];
        rates.push((1..).zip(pairs()).map(rate).sum());
    }
    state.extend(rates);
    state.extend(balance.samples.histories.iter().map(|history| history.state[0]));
    state
}
