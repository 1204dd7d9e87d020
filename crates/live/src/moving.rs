//! The moving structure for 3D views: the newest state of each update, with its vibration magnified to be visible.
//!
//! With a the largest [`Drawing::vibration`] of the last second of updates, the vibration is magnified m times: the
//! largest m of 1, 2, 5, 10 … with m·a ≤ 1, at least 1. Another m is chosen only if m·a leaves the range from 0.31 to
//! 1.25, as on the page.

use std::collections::VecDeque;

use serde_json::Value;

use resonarm_files::drawing::Drawing;
use resonarm_files::export::scene;
use resonarm_files::recording::StateRecord;

/// Range of 1/a, in units of m, in which m is kept.
const KEPT: core::ops::Range<f64> = 0.8..3.2;
/// Below this the structure stands still.
const STILL: f64 = 5e-9;
/// Updates over which the largest vibration is taken: a second of them.
const UPDATES: usize = 30;

/// Draws the moving structure with its vibrations enlarged.
pub struct Moving {
    drawing: Drawing,
    newest: Option<StateRecord>,
    /// The largest vibration since the last update, and in each update before.
    largest: f64,
    before: VecDeque<f64>,
    magnification: f64,
}

impl Moving {
    /// Draws a structure, to scale at first.
    pub fn new(drawing: Drawing) -> Moving {
        Moving { drawing, newest: None, largest: 0.0, before: VecDeque::new(), magnification: 1.0 }
    }

    /// Takes the state of the next sample.
    pub fn state(&mut self, state: &StateRecord) {
        self.largest = self.largest.max(self.drawing.vibration(state.states.coordinates()));
        self.newest = Some(*state);
    }

    /// The sample and the message of the newest state since the last call; `time_ns` returns the time of a
    /// sample.
    pub fn take(&mut self, time_ns: impl Fn(u64) -> u64) -> Option<(u64, Value)> {
        let state = self.newest.take()?;
        self.before.push_back(core::mem::take(&mut self.largest));
        self.before.drain(..self.before.len().saturating_sub(UPDATES));
        let largest = self.before.iter().copied().fold(0.0, f64::max);
        self.magnification = magnification(largest, self.magnification);
        let time_ns = time_ns(state.sample);
        Some((state.sample, scene::message(&self.drawing, state.states.coordinates(), self.magnification, time_ns)))
    }
}

/// The magnification for vibrations up to `largest`, if it was `now` before.
fn magnification(largest: f64, now: f64) -> f64 {
    if largest.is_nan() || largest < STILL {
        return now;
    }
    let wanted = 1.0 / largest;
    // The range is wider than a step of 1, 2, 5, so that the picture does not alternate between two
    // magnifications.
    if now > 1.0 && KEPT.contains(&(wanted / now)) {
        return now;
    }
    // `wanted` lies from `power` to ten times as much, so a digit fits, except where `power` was rounded up.
    let power = libm::pow(10.0, libm::floor(libm::log10(wanted)));
    let chosen = [5.0, 2.0, 1.0].into_iter().map(|digit| digit * power).find(|chosen| *chosen <= wanted);
    chosen.unwrap_or(power).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use resonarm_bench::rig::Load;
    use resonarm_bench::structure::{LoadSet, States};
    use resonarm_scenario::Scenario;

    fn state(sample: u64, alpha_rad: [f64; 2]) -> StateRecord {
        let zero = [0.0; 2];
        StateRecord {
            sample,
            states: States::new(&[alpha_rad, zero].concat(), &[]).unwrap(),
            load: Load::default(),
            taken: LoadSet::NATIVE,
            is_end: false,
        }
    }

    #[test]
    fn the_magnification_changes_in_steps_and_stays_over_a_range() {
        let for_angle = |angle_rad: f64, now: f64| magnification(angle_rad / 0.22, now);
        assert_eq!(for_angle(0.0, 20.0), 20.0);
        assert_eq!(for_angle(0.5, 1.0), 1.0);
        assert_eq!(for_angle(0.11, 1.0), 2.0);
        assert_eq!(for_angle(0.004, 1.0), 50.0);
        // 0.22/0.0053 = 41.5 and 0.22/0.0014 = 157 are close enough to 50.
        assert_eq!(for_angle(0.0053, 50.0), 50.0);
        assert_eq!(for_angle(0.0014, 50.0), 50.0);
        assert_eq!(for_angle(0.0056, 50.0), 20.0);
        assert_eq!(for_angle(0.0013, 50.0), 100.0);
    }

    #[test]
    fn the_newest_state_of_an_update_is_drawn_where_the_arm_is() {
        let drawing = Drawing::of(&Scenario::default()).unwrap().unwrap();
        let mut moving = Moving::new(drawing.clone());
        assert!(moving.take(|sample| sample).is_none());
        moving.state(&state(7, [2e-3, 2e-3]));
        moving.state(&state(8, [1e-3, -2e-3]));
        let (sample, message) = moving.take(|sample| 1_500_000_000 + sample).unwrap();
        assert_eq!(sample, 8);
        let entity = &message["entities"][0];
        assert_eq!(entity["timestamp"], serde_json::json!({ "sec": 1, "nsec": 500_000_008 }));
        assert_eq!(entity["metadata"], serde_json::json!([{ "key": "magnification", "value": "50" }]));
        let expected = drawing.positions_m(&[1e-3, -2e-3], 50.0);
        let drawn = entity["lines"][0]["points"].as_array().unwrap();
        let found: Vec<_> = drawn.iter().map(|at| ["x", "y", "z"].map(|axis| at[axis].as_f64().unwrap())).collect();
        assert_eq!(found, expected);
        assert!(moving.take(|sample| sample).is_none());
    }
}
