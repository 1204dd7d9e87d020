//! `resonarm compare` of a recording on a structure: each response against the computed branch.

use std::path::Path;

use serde::Serialize;
use serde_json::Value;

use super::walk::{self, Computed, SAME_LOAD, StructurePoint, StructureScore};
use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::output::{self, JsonFlag};
use resonarm::analysis::structure::Nearest;
use resonarm::control::ResponsePoint;
use resonarm::identification::acting_load_on;
use resonarm::plant::TestedAssembly;
use resonarm::scenario::Scenario;
use resonarm_numeric::number::short;

/// A response and the place of the branch that is nearest to it.
#[derive(Serialize)]
struct Compared {
    #[serde(flatten)]
    point: StructurePoint,
    /// Measured over computed, less 1.
    frequency_deviation: f64,
    amplitude_deviation: f64,
    /// Measured less computed phase.
    phase_deviation_deg: f64,
    computed_stable: Option<bool>,
}

#[derive(Serialize)]
struct Document<'a> {
    configuration: Value,
    coordinates: Value,
    /// The degree of freedom whose fundamental is compared.
    at: &'a str,
    /// The load of the computed branch: the mean of what acted.
    load: &'a str,
    points: Vec<Compared>,
    /// The largest deviations of settled points; none if no point has settled.
    score: Option<StructureScore>,
}

/// Compares `responses` of a scenario on a structure, and prints or plots the deviations.
pub(crate) fn show(
    file: &Path,
    (scenario, tested): (&Scenario, &TestedAssembly),
    responses: &[ResponsePoint],
    plot: Option<&Path>,
    json: JsonFlag,
) -> Result<Verdict, Failure> {
    let amplitude = scenario.amplitude().copied().unwrap_or_default();
    // In open loop a shaker's force on the structure is not the commanded one.
    let acting = |response: &ResponsePoint| {
        let load = acting_load_on(response, scenario, tested).map_err(|error| Failure::usage(error.to_string()))?;
        Ok(ResponsePoint { load, ..*response })
    };
    let acted = responses.iter().map(acting).collect::<Result<Vec<_>, Failure>>()?;
    let responses = &acted[..];
    let Some(computed) = Computed::new(tested, &amplitude, responses)? else {
        let loads = || responses.iter().filter(|response| response.settled).map(|response| response.load);
        let (least, most) = (loads().fold(f64::INFINITY, f64::min), loads().fold(0.0, f64::max));
        return Err(Failure::usage(format!(
            "{}: its responses are not on a single branch: compared are settled responses along one degree of freedom to \
             loads that differ by at most {} %; here they are from {} to {}",
            file.display(),
            short(&(100.0 * SAME_LOAD)),
            short(&least),
            short(&most)
        )));
    };
    let places = responses.iter().map(|response| computed.nearest(response));
    let points = walk::points(tested, responses).into_iter().zip(places).zip(responses);
    let document = Document {
        configuration: configuration::of(scenario, &amplitude.load())?,
        coordinates: configuration::coordinates(&tested.assembly),
        at: computed.name(),
        load: computed.load(),
        points: points
            .filter_map(|((point, place), response)| Some(Compared::new(point, &place?, computed.phase_rad(response))))
            .collect(),
        score: computed.score(responses),
    };
    let figure = || computed.figure("Measured on computed", scenario, tested, responses);
    let files = output::plot(plot, &document, || (figure(), csv(&document)))?;
    json.show(&document, || text(&document), &files)
}

impl Compared {
    fn new(point: StructurePoint, place: &Nearest, phase_rad: f64) -> Compared {
        let off_deg = (phase_rad - place.phase_rad).to_degrees();
        Compared {
            point,
            frequency_deviation: place.frequency_deviation,
            amplitude_deviation: place.amplitude_deviation,
            phase_deviation_deg: off_deg - 360.0 * (off_deg / 360.0).round(),
            computed_stable: place.is_stable,
        }
    }
}

fn text(document: &Document<'_>) -> String {
    let at = document.at;
    let mut text = format!("computed for {}\n", document.load);
    text += &format!("  {:>12}  {at:>13}  {:>12}  {:>9}  {:>9}  computed\n", "frequency", "Δf/f", "ΔA/A", "Δφ");
    for compared in &document.points {
        let Compared { point, frequency_deviation, amplitude_deviation, phase_deviation_deg, computed_stable } =
            compared;
        let stability = match computed_stable {
            Some(true) => "stable",
            Some(false) => "unstable",
            None => "–",
        };
        let remark = if point.settled { "" } else { ", point not settled" };
        text += &format!(
            "  {:9.5} Hz  {:>13}  {frequency_deviation:+12.2e}  {:+7.3} %  {phase_deviation_deg:+8.2}°  {stability}{remark}\n",
            point.frequency_hz,
            point.amplitude_at(at),
            100.0 * amplitude_deviation,
        );
    }
    text + &document.score.as_ref().map_or(String::new(), walk::score_line)
}

fn csv(document: &Document<'_>) -> String {
    let mut text = String::from(
        "frequency_hz,settled,frequency_deviation,amplitude_deviation,phase_deviation_deg,computed_stable\n",
    );
    for compared in &document.points {
        let stable = compared.computed_stable.map_or(String::new(), |stable| stable.to_string());
        text += &format!(
            "{},{},{},{},{},{stable}\n",
            compared.point.frequency_hz,
            compared.point.settled,
            compared.frequency_deviation,
            compared.amplitude_deviation,
            compared.phase_deviation_deg
        );
    }
    text
}
