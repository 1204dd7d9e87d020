//! The description of a run or recording that a viewer gets first.

use serde::Serialize;

use super::rows::{self, Shown};
use super::test_panel::TestPlan;
use super::under_test::{Panels, ResponseAxis, UnderTest};
use resonarm_files::drawing::Drawing;
use resonarm_scenario::Scenario;

/// A request that a viewer may make, by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Action {
    /// Request to arm the plant.
    Arm,
    /// Request to disarm the plant.
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
    /// Version of the running program.
    pub version: &'static str,
    /// The kind of source: plant, exciter, plant and exciter, recording.
    pub role: &'static str,
    /// The bus or the file.
    pub place: String,
    /// The structure under test, in words.
    pub structure: String,
    /// Drawing of the structure; `None` if the positions of its points are unknown.
    pub drawing: Option<Drawing>,
    /// The points of the exciter, B and C; `None` if they are unknown.
    pub rig: Option<[String; 3]>,
    /// Whether an exciter, which knows no coordinates, finds the angles of the links from the accelerations of B and C.
    pub angles_are_read: bool,
    /// The unit of the load, N or N·m.
    pub unit: &'static str,
    /// Sample rate of the run, Hz.
    pub rate_hz: f64,
    /// Frequencies of the modes, Hz.
    pub modes_hz: Vec<f64>,
    /// Names of a sample's channels.
    pub channels: Vec<String>,
    /// Channels that the panels plot.
    pub panels: Panels,
    /// Channels of the coordinates.
    pub coordinates: CoordinateChannels,
    /// The sizes of the responses that are read.
    pub responses: Vec<ResponseAxis>,
    /// Index of the response that is shown at first.
    pub response: usize,
    /// Names of the channels that the bits of the clipped readings refer to, the lowest bit first.
    pub clipped_bits: Vec<String>,
    /// The requests that the token permits.
    pub actions: Vec<Action>,
    /// The limits of a set-point, if one can be set.
    pub steering: Option<Steering>,
    /// What the vibration test asks for that is controlled, if one is.
    pub test: Option<TestPlan>,
    /// The first and the last sample, of a recording.
    pub samples: Option<(u64, u64)>,
}

/// The channels of the coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct CoordinateChannels {
    /// The place of the first.
    pub first: usize,
    /// Number of coordinates of the structure.
    pub count: usize,
}

/// The limits of a set-point. The page and the server refuse values outside them; the controller accepts all within.
#[derive(Clone, Debug, Serialize)]
pub struct Steering {
    /// Load, N or N·m.
    pub load: [f64; 2],
    /// Smallest and largest frequency, Hz.
    pub frequency_hz: [f64; 2],
    /// Smallest and largest phase, degrees.
    pub phase_deg: [f64; 2],
}

impl Steering {
    /// Makes the limits for an exciter that can play up to `load_limit`, N or N·m, at `rate_hz` samples a second. A
    /// sine at half the sample rate or just below would have only two samples a period.
    pub fn new(load_limit: f64, rate_hz: f64) -> Steering {
        Steering { load: [0.0, load_limit], frequency_hz: [0.01, 0.4995 * rate_hz], phase_deg: [-360.0, 360.0] }
    }
}

impl About {
    /// Describes the structure under test of a scenario; permits no requests.
    pub fn new(role: &'static str, place: String, scenario: &Scenario, under_test: &UnderTest) -> About {
        let shown = Shown::new(&under_test.table);
        About {
            version: env!("CARGO_PKG_VERSION"),
            role,
            place,
            structure: under_test.name.clone(),
            drawing: under_test.drawing.clone(),
            rig: under_test.rig(),
            angles_are_read: under_test.angles_are_read(),
            unit: unit(scenario),
            rate_hz: scenario.simulation.rate_hz,
            modes_hz: under_test.modes_hz(),
            channels: shown.names(),
            panels: under_test.panels(),
            coordinates: CoordinateChannels { first: rows::COORDINATES, count: shown.coordinates().len() },
            responses: under_test.responses(),
            response: under_test.driven_response(scenario),
            clipped_bits: shown.clipped_bits(),
            actions: Vec::new(),
            steering: None,
            test: under_test.test.as_ref().map(|test| test.plan.clone()),
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
    use resonarm_bench::rig::Load;
    use resonarm_session::run::Request;

    /// The page and the server use these limits; the controller must accept all values within them.
    #[test]
    fn set_points_within_the_limits_are_accepted_and_those_beyond_refused() {
        let limit = 61.7;
        let rate_hz = 333.3;
        let scenario = Scenario::default();
        let under_test = UnderTest::new(&scenario, String::from("arm"), Default::default()).unwrap();
        let mut about = About::new("exciter", String::new(), &scenario, &under_test);
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
