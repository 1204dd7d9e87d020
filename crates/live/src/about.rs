//! The description of a run or recording that a viewer gets first.

use serde::Serialize;

use super::rows;
use resonarm_dynamics::arm::Arm;
use resonarm_files::scenario::Scenario;

/// A request that a viewer may make, by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Action {
    /// Arm the plant.
    Arm,
    /// Disarm the plant.
    Disarm,
    /// Reset a faulted plant.
    Reset,
    /// Set the sine's set-point.
    Set,
    /// Play, halt and seek a recording.
    Play,
}

/// The run or recording shown, as described to the page.
#[derive(Clone, Debug, Serialize)]
pub struct About {
    /// The program's version.
    pub version: &'static str,
    /// The kind of source: plant, exciter, plant and exciter, recording.
    pub role: &'static str,
    /// The bus or the file.
    pub place: String,
    /// The arm, in words.
    pub arm: String,
    /// Lengths of the links, m.
    pub lengths_m: [f64; 2],
    /// Angles of the pose, rad: β1 against the x axis, β2 against link 1.
    pub beta_rad: [f64; 2],
    /// The unit of the load, N or N·m.
    pub unit: &'static str,
    /// Samples a second.
    pub rate_hz: f64,
    /// Frequencies of the modes, Hz.
    pub modes_hz: [f64; 2],
    /// Names of a sample's channels.
    pub channels: [&'static str; 12],
    /// Names of the channels that the bits of the clipped readings refer to, the lowest bit first.
    pub clipped_bits: [&'static str; 6],
    /// The requests that the token permits.
    pub actions: Vec<Action>,
    /// The limits of a set-point, if one can be set.
    pub steering: Option<Steering>,
    /// The first and the last sample, of a recording.
    pub samples: Option<(u64, u64)>,
}

/// The limits of a set-point. The page and the server refuse values outside them; the controller accepts all within.
#[derive(Clone, Debug, Serialize)]
pub struct Steering {
    /// Load, N or N·m.
    pub load: [f64; 2],
    /// Frequency, Hz.
    pub frequency_hz: [f64; 2],
    /// Phase, degrees.
    pub phase_deg: [f64; 2],
}

impl Steering {
    /// For an exciter that can play up to `load_limit`, N or N·m, at `rate_hz` samples a second. A sine at half the
    /// sample rate or just below would have only two samples a period.
    pub fn new(load_limit: f64, rate_hz: f64) -> Steering {
        Steering { load: [0.0, load_limit], frequency_hz: [0.01, 0.4995 * rate_hz], phase_deg: [-360.0, 360.0] }
    }
}

impl About {
    /// For a scenario's arm; permits no requests.
    pub fn new(role: &'static str, place: String, scenario: &Scenario, arm: &Arm) -> About {
        let (p, pose) = (arm.parameters(), arm.pose());
        About {
            version: env!("CARGO_PKG_VERSION"),
            role,
            place,
            arm: format!(
                "{}, \u{3b2}1 = {}\u{b0}, \u{3b2}2 = {}\u{b0}",
                scenario.arm.label(),
                pose.beta1_deg,
                pose.beta2_deg
            ),
            lengths_m: [p.length1_m, p.length2_m],
            beta_rad: [pose.beta1_deg.to_radians(), pose.beta2_deg.to_radians()],
            unit: unit(scenario),
            rate_hz: scenario.simulation.rate_hz,
            modes_hz: resonarm_analysis::modes(arm).map(|mode| mode.frequency_hz),
            channels: rows::names(),
            clipped_bits: rows::clipped_bits(),
            actions: Vec::new(),
            steering: None,
            samples: None,
        }
    }

    /// Whether this request is permitted.
    pub fn allows(&self, action: Action) -> bool {
        self.actions.contains(&action)
    }
}

/// The unit of the scenario's load.
fn unit(scenario: &Scenario) -> &'static str {
    let control = scenario.control.as_ref().map(|control| control.amplitude().unit());
    control.or_else(|| scenario.excitation.as_ref().map(|excitation| excitation.amplitude.unit())).unwrap_or("N")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::{Order, Wish};
    use resonarm_bench::control::{Controller, SetPoint, Steered};
    use resonarm_dynamics::arm::Load;
    use resonarm_session::run::Request;

    /// The page and the server use these limits; the controller must accept all values within them.
    #[test]
    fn set_points_within_the_limits_are_accepted_and_those_beyond_refused() {
        let (limit, rate_hz) = (61.7, 333.3);
        let scenario = Scenario::default();
        let mut about = About::new("exciter", String::new(), &scenario, &scenario.build_arm().unwrap());
        about.actions = vec![Action::Set];
        about.steering = Some(Steering::new(limit, rate_hz));
        let Steering { load, frequency_hz, phase_deg } = Steering::new(limit, rate_hz);
        let wish =
            |[load, frequency_hz, phase_deg]: [f64; 3]| Wish::Set { load, frequency_hz, phase_deg }.order(&about);
        let mut steered = Steered::new(
            Load::force_n(1.0, 0.0),
            limit,
            resonarm_bench::rig::Sampling { rate_hz, converter: Default::default() },
            10.0,
        );
        let inside = [1.0, 10.0, 0.0];
        for (place, [least, most]) in [load, frequency_hz, phase_deg].into_iter().enumerate() {
            for (end, beyond) in [(least, least.next_down()), (most, most.next_up())] {
                let with = |value| {
                    let mut numbers = inside;
                    numbers[place] = value;
                    numbers
                };
                let [load, frequency_hz, phase_deg] = with(end);
                let set_point = SetPoint { load, frequency_hz, phase_deg };
                assert_eq!(wish(with(end)), Ok(Order::Run(Request::Set(set_point))));
                assert!(steered.steer(&set_point), "{set_point:?}");
                assert_eq!(steered.set_point(), set_point);
                assert!(wish(with(beyond)).is_err_and(|why| why.contains("it must be from")), "{beyond}");
            }
        }
    }
}
