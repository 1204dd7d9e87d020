//! The points of a recording: the responses of its controller, read again from its frames.

use std::path::Path;

use super::{Bench, BenchPoint, Configuration};
use crate::failure::{Failure, Verdict};
use crate::recordings;
use resonarm::arm::Arm;
use resonarm::control::{JointAngles, ResponsePoint};
use resonarm::identification::{acting_load, common_load};
use resonarm::replay;
use resonarm::scenario::Scenario;

/// Which recordings can be compared.
const HOW: &str = "responses are read with [control] or with an [excitation] with `dwell`, `stepped-sine` or `sine-list`: \
                   `resonarm experiment walk --torque1-nm 20 --record walk.mcap` makes such a recording";

/// The responses in a recording, with its scenario, and whether the recording is whole.
pub(super) fn responses(file: &Path) -> Result<(Scenario, Vec<ResponsePoint>, Verdict), Failure> {
    let recording = recordings::open(file)?;
    let scenario = Scenario::from_configuration(recording.configuration())?;
    let name = file.display();
    let none = |why: &str| Failure::usage(format!("{name} holds no responses: {why}; {HOW}"));
    if scenario.excitation.is_none() && scenario.control.is_none() {
        return Err(none("its scenario does not say what the exciter played"));
    }
    let responses = replay::responses(&recording)?;
    if responses.is_empty() {
        return Err(none("none was read before its end"));
    }
    Ok((scenario, responses, recordings::verdict(&recording)))
}

/// The responses of the arm, with pose and load of the scenario.
pub(super) fn bench(scenario: &Scenario, responses: &[ResponsePoint]) -> Result<Bench, Failure> {
    let arm = scenario.build_arm()?;
    let points = responses.iter().map(|response| point(response, scenario, &arm)).collect::<Result<Vec<_>, _>>()?;
    let acting: Vec<f64> = points.iter().filter_map(|point| point.excitation).collect();
    let load = common_load(scenario, &acting);
    let configuration = Configuration {
        name: scenario.structure.name.clone(),
        preset: scenario.structure.preset.clone().unwrap_or_default(),
        parameters: *arm.parameters(),
        beta1_deg: arm.pose().beta1_deg,
        beta2_deg: arm.pose().beta2_deg,
        torque_nm: load.torque_nm.into(),
        force_n: load.force_n.into(),
    };
    Ok(Bench { configuration, points })
}

/// The angles that belong to a response, and the load that acted.
fn point(response: &ResponsePoint, scenario: &Scenario, arm: &Arm) -> Result<BenchPoint, Failure> {
    let angles = JointAngles::of(response, arm);
    Ok(BenchPoint {
        frequency_hz: response.frequency_hz,
        harmonic1_rad: angles.harmonic1_rad(),
        amplitude_rad: angles.amplitude_rad,
        excitation: Some(acting_load(response, scenario, arm)?),
        settled: response.settled,
        clipped: angles.clipped,
    })
}
