//! The points of a recording: the responses of its controller, read again from its frames.

use std::path::Path;

use nalgebra::Vector2;

use super::{Bench, BenchPoint, Configuration};
use crate::failure::Failure;
use crate::recordings;
use resonarm::arm::{Arm, Load};
use resonarm::control::{JointAngles, ResponsePoint};
use resonarm::excitation::Phasor;
use resonarm::replay;
use resonarm::scenario::Scenario;

/// Which recordings can be compared.
const HOW: &str = "responses are read with [control] or with an [excitation] with `dwell`, `stepped-sine` or `sine-list`: \
                   `resonarm experiment walk --torque1-nm 20 --record walk.mcap` makes such a recording";

/// The responses in a recording, with arm, pose and load of its scenario.
pub(super) fn read(file: &Path) -> Result<Bench, Failure> {
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
    let arm = scenario.build_arm()?;
    let points = responses.iter().map(|response| point(response, &scenario, &arm)).collect::<Result<Vec<_>, _>>()?;
    let load = load(&scenario, &points);
    let configuration = Configuration {
        name: scenario.arm.name.clone(),
        preset: scenario.arm.preset.clone(),
        parameters: scenario.parameters()?,
        beta1_deg: scenario.arm.beta1_deg,
        beta2_deg: scenario.arm.beta2_deg,
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
        excitation: Some(acting(response, scenario, arm)?),
        settled: response.settled,
    })
}

/// Amplitude of the load that acted, N or N·m: in open loop a shaker's force on the arm differs from the commanded one.
///
/// The converters fold images of the held command onto the fundamental; of these the head reads the share that acts on
/// the arm far above the natural frequencies.
fn acting(response: &ResponsePoint, scenario: &Scenario, arm: &Arm) -> Result<f64, Failure> {
    let (Some(spec), Some(shaker)) = (&scenario.excitation, &scenario.rig.shaker) else { return Ok(response.load) };
    let command_n = spec.amplitude.load().force_n;
    let share = arm.clone().with_attachment(shaker.armature())?.high_frequency_force_share();
    let images = share * scenario.sampling().images(response.frequency_hz);
    let head = Vector2::from(response.head_force_n) - command_n.map(|command_n| Phasor::new(images * command_n, 0.0));
    Ok(head.map(|axis| axis.norm_sqr()).sum().sqrt())
}

/// The load of all points: under control the one held by the law, in open loop the mean of those that acted.
fn load(scenario: &Scenario, points: &[BenchPoint]) -> Load {
    match (&scenario.control, &scenario.excitation) {
        (Some(control), _) => control.amplitude().load(),
        (None, Some(excitation)) => {
            let load = excitation.amplitude.load();
            let acting = points.iter().filter_map(|point| point.excitation).sum::<f64>() / points.len() as f64;
            load.scaled(acting / libm::hypot(load.force_n.norm(), load.torque_nm.norm()))
        }
        (None, None) => Load::default(),
    }
}
