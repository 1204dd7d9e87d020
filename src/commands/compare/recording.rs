//! The points of a recording: the responses of its controller, read again from its frames.

use std::path::Path;

use crate::drive::Drive;
use crate::failure::{Failure, Verdict};
use crate::measured_points::{self, MeasuredPoint};
use crate::recordings;
use resonarm::control::ResponsePoint;
use resonarm::identification::acting_load;
use resonarm::plant::TestedAssembly;
use resonarm::replay;
use resonarm::scenario::Scenario;

/// The advice on recordings that can be compared.
const HOW: &str = "responses are read with [control] or with an [excitation] with `dwell`, `stepped-sine` or `sine-list`: \
                   `resonarm experiment walk --drive DOF=A --record walk.mcap` makes such a recording";

/// Reads the responses in a recording, with its scenario, and whether the recording is whole.
pub(super) fn responses(file: &Path) -> Result<(Scenario, Vec<ResponsePoint>, Verdict), Failure> {
    let recording = recordings::open(file)?;
    let scenario = Scenario::from_configuration(recording.configuration())?;
    let name = file.display();
    let none = |why: &str| Failure::usage(format!("{name} holds no responses: {why}; {HOW}"));
    if scenario.excitation.is_none() && scenario.control.is_none() {
        return Err(none("its scenario does not state what the exciter played"));
    }
    let responses = replay::responses(&recording)?;
    if responses.is_empty() {
        return Err(none("no response was read before its end"));
    }
    Ok((scenario, responses, recordings::verdict(&recording)))
}

/// Returns the points of a recording with the load that acted: in open loop a shaker's force on the structure is not
/// the commanded one.
pub(super) fn measured(
    file: &Path,
    (scenario, tested): (&Scenario, &TestedAssembly),
    responses: &[ResponsePoint],
) -> Result<(Drive, Vec<MeasuredPoint>), Failure> {
    let acting = |response: &ResponsePoint| {
        let load = acting_load(response, scenario, tested).map_err(|error| Failure::usage(error.to_string()))?;
        Ok(ResponsePoint { load, ..*response })
    };
    let acted = responses.iter().map(acting).collect::<Result<Vec<_>, Failure>>()?;
    // Without an amplitude all loads are 0, which drives nothing and is rejected in the next statement.
    let amplitude = scenario.amplitude().copied().unwrap_or_default();
    let drive = Drive::of_exciter(&amplitude, tested).ok_or_else(|| {
        Failure::usage(format!("{}: the load of its scenario acts at no point of the structure", file.display()))
    })?;
    Ok((drive, measured_points::points(tested, &acted)))
}
