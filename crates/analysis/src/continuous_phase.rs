//! The phase of a frequency response, without jumps.

use alloc::vec::Vec;

use nalgebra::Complex;

/// If the phases at two frequencies differ by more than this, rad, the phase is computed in between.
const LARGEST_TURN_RAD: f64 = 0.5;
/// Most halvings of a gap between two frequencies; a jump in the remaining gap is a real jump.
const MOST_HALVINGS: u32 = 40;

/// The phase of a response over frequency, degrees, without jumps at the ends of the circle: it begins within ±180° and
/// is continuous from there, through every zero and through the peaks at the natural frequencies. Without a response
/// there is no phase. The frequencies ascend, Hz; `at` is the response at any of them.
pub fn continuous_phase(
    frequency_hz: &[f64],
    natural_hz: &[f64],
    at: &dyn Fn(f64) -> Option<Complex<f64>>,
) -> Vec<(f64, f64)> {
    let at = |hz: f64| at(hz).filter(|value| value.norm_sqr() > 0.0);
    let mut before: Option<(f64, Complex<f64>, f64)> = None;
    let point = |hz: &f64| {
        let Some(value) = at(*hz) else { return (*hz, f64::NAN) };
        let phase_rad = match before {
            None => libm::atan2(value.im, value.re),
            Some((from_hz, from, phase_rad)) => phase_rad + turn_rad(&at, (from_hz, from), (*hz, value), MOST_HALVINGS),
        };
        before = Some((*hz, value, phase_rad));
        (*hz, phase_rad.to_degrees())
    };
    let [from_hz, to_hz] = [frequency_hz.first(), frequency_hz.last()].map(|end| end.copied().unwrap_or_default());
    // Natural frequencies between the given ones are visited, too: a narrow peak turns the phase by half a circle
    // unseen.
    let between = natural_hz.iter().copied().filter(|hz| (from_hz..=to_hz).contains(hz) && !frequency_hz.contains(hz));
    let mut all: Vec<f64> = frequency_hz.iter().copied().chain(between).collect();
    all.sort_by(f64::total_cmp);
    all.iter().map(point).filter(|(hz, _)| frequency_hz.contains(hz)).collect()
}

/// Returns the change of phase from one frequency to another, rad.
fn turn_rad(
    at: &dyn Fn(f64) -> Option<Complex<f64>>,
    from: (f64, Complex<f64>),
    to: (f64, Complex<f64>),
    halvings: u32,
) -> f64 {
    let ratio = to.1 / from.1;
    let turn = libm::atan2(ratio.im, ratio.re);
    let middle_hz = 0.5 * (from.0 + to.0);
    match at(middle_hz).filter(|_| halvings > 0 && turn.abs() > LARGEST_TURN_RAD) {
        Some(value) => {
            let middle = (middle_hz, value);
            turn_rad(at, from, middle, halvings - 1) + turn_rad(at, middle, to, halvings - 1)
        }
        None => turn,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LinearResponse;
    use crate::tests::preset_at;
    use crate::{Quantity, frequencies_hz};
    use resonarm_dynamics::structure::Preset;

    /// Each pole lowers the phase by half a turn, the zero of a drive point between them raises it again, however
    /// coarse the frequencies are.
    #[test]
    fn the_phase_goes_on_through_every_peak_and_zero() {
        let arm = preset_at(Preset::Irb1600Fitted, [0.0, 60.0]);
        let linear = LinearResponse::new(&arm);
        let natural_hz: Vec<f64> = arm.modes().iter().map(|mode| mode.frequency_hz).collect();
        let drive = arm.dof("joint1").unwrap();
        for points in [3, 30, 801] {
            let hz = frequencies_hz(1.0, 500.0, points, &[]);
            for (response, expected_deg) in [("joint1", -180.0), ("joint2", -360.0)] {
                let read = arm.dof(response).unwrap();
                let at = |hz: f64| linear.at(Quantity::Receptance, drive, read, hz).ok();
                let phase = continuous_phase(&hz, &natural_hz, &at);
                let first = phase[0].1;
                let last = phase[phase.len() - 1].1;
                assert!((last - first - expected_deg).abs() < 1.0, "{response:?}, {points}: {first} {last}");
                for (hz, deg) in phase {
                    let value = at(hz).unwrap();
                    let turns = (deg - libm::atan2(value.im, value.re).to_degrees()) / 360.0;
                    assert!((turns - turns.round()).abs() < 1e-9, "{response:?} at {hz} Hz: {deg}");
                }
            }
        }
    }
}
