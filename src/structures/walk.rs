//! `resonarm experiment walk` on a structure: what the controller read, against the computed branch.

use serde::Serialize;

use super::{displacement_unit, label, load_unit};
use crate::failure::Failure;
use crate::figures::branches::stretches;
use crate::walk_point::CLIPPED;
use resonarm::analysis::Distances;
use resonarm::analysis::structure::{Branch, Coordinate, Forced, Nearest, TraceOptions, nearest, trace};
use resonarm::control::ResponsePoint;
use resonarm::excitation::{Amplitude, Phasor};
use resonarm::plant::{ReadDof, TestedAssembly};
use resonarm::scenario::Scenario;
use resonarm_figures::plot::{Axis, Color, Dash, Figure, Marker, Panel, Series, Style};
use resonarm_numeric::number::rounded;

/// Largest turn between two motions of the computed branch: with this it is straight between them, as far as measured
/// points go.
const STRAIGHT_RAD: f64 = 0.01;
/// Largest relative difference between the loads of points on a single branch.
pub(super) const SAME_LOAD: f64 = 0.02;
/// The computed branch goes beyond the points by this part of their frequencies.
const MARGIN: f64 = 0.02;

/// What an accelerometer read along one axis: the fundamental of the displacement.
#[derive(Clone, Debug, Serialize)]
struct ReadingDocument {
    /// The degree of freedom.
    at: String,
    amplitude: f64,
    /// By which the motion leads the load.
    phase_deg: f64,
    unit: &'static str,
    clipped: bool,
}

/// A point of a walk, as the controller read it.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct StructurePoint {
    pub frequency_hz: f64,
    /// Lag of the followed displacement behind the load; none in open loop.
    lag_deg: Option<f64>,
    /// Amplitude of the acting load's fundamental, N or N·m.
    excitation: f64,
    excitation_deviation: Option<f64>,
    force_harmonics: Option<[f64; 2]>,
    distortion: Option<f64>,
    readings: Vec<ReadingDocument>,
    pub settled: bool,
    tries: u32,
}

impl StructurePoint {
    /// The amplitude at a degree of freedom that is read, with its unit.
    pub fn amplitude_at(&self, name: &str) -> String {
        let reading = self.readings.iter().find(|reading| reading.at == name);
        reading.map_or(String::from("–"), |reading| format!("{:.4e} {}", reading.amplitude, reading.unit))
    }
}

/// The largest deviations of settled points from the computed branch of the same load.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct StructureScore {
    /// The degree of freedom whose amplitude is compared.
    at: String,
    settled_points: usize,
    /// Points that lie where the computed motion is unstable.
    unstable_points: usize,
    /// Of the frequency, relative.
    largest_frequency_deviation: f64,
    /// Of the amplitude, relative.
    largest_amplitude_deviation: f64,
}

fn size(phasor: Phasor) -> f64 {
    libm::hypot(phasor.re, phasor.im)
}

/// The points as documents.
pub(crate) fn points(tested: &TestedAssembly, responses: &[ResponsePoint]) -> Vec<StructurePoint> {
    let places = tested.read();
    let reading = |point: &ResponsePoint, ReadDof { dof, name, channel }: &ReadDof| {
        let displacement = point.displacement_m(*channel);
        ReadingDocument {
            at: name.clone(),
            amplitude: size(displacement),
            phase_deg: libm::atan2(displacement.im, displacement.re).to_degrees(),
            unit: displacement_unit(*dof),
            clipped: point.clipped[*channel],
        }
    };
    let document = |point: &ResponsePoint| StructurePoint {
        frequency_hz: point.frequency_hz,
        lag_deg: point.lag_rad.map(f64::to_degrees),
        excitation: point.load,
        excitation_deviation: point.load_deviation,
        force_harmonics: point.force_harmonics(),
        distortion: point.distortion(),
        readings: places.iter().map(|place| reading(point, place)).collect(),
        settled: point.settled,
        tries: point.tries,
    };
    responses.iter().map(document).collect()
}

/// The computed branch of a walk at one load, around its points.
pub(crate) struct Computed {
    branch: Branch,
    /// The degree of freedom that is read.
    at: ReadDof,
    load: String,
}

impl Computed {
    /// `None` without points, if the loads of settled ones differ, or along more than one degree of freedom.
    ///
    /// # Errors
    /// If the branch can't be followed.
    pub fn new(
        tested: &TestedAssembly,
        amplitude: &Amplitude,
        responses: &[ResponsePoint],
    ) -> Result<Option<Computed>, Failure> {
        let loads = || responses.iter().filter(|point| point.settled).map(|point| point.load);
        let (least, most) = (loads().fold(f64::INFINITY, f64::min), loads().fold(0.0, f64::max));
        let is_at_one_load = most <= least * (1.0 + SAME_LOAD);
        let Some((drive, load)) = tested.driven(amplitude).filter(|_| is_at_one_load) else {
            return Ok(None);
        };
        let at = tested.read().into_iter().max_by(|a, b| {
            let largest =
                |channel| responses.iter().map(|point| size(point.displacement_m(channel))).fold(0.0, f64::max);
            largest(a.channel).total_cmp(&largest(b.channel))
        });
        let hz = || responses.iter().map(|point| point.frequency_hz);
        let (Some(at), Some(low_hz), Some(high_hz)) = (at, hz().reduce(f64::min), hz().reduce(f64::max)) else {
            return Ok(None);
        };
        // The load that acted, as the head read it or a hold left it.
        let settled = loads().count();
        let load = if settled > 0 { load.signum() * (loads().sum::<f64>() / settled as f64) } else { load };
        let forced = Forced::new(tested.assembly.clone(), drive, load);
        let ends = [(1.0 - MARGIN) * low_hz, (1.0 + MARGIN) * high_hz];
        let mut options = TraceOptions::new(&forced, Coordinate::FrequencyHz, ends, vec![at.dof]);
        options.branch.continuation.largest_turn_rad = STRAIGHT_RAD;
        let branch = trace(&forced, ends[0], Coordinate::FrequencyHz, &options).map_err(|early| early.reason)?;
        let load = format!("{} {} at {}", rounded(&load, 3), load_unit(drive), tested.dof_name(drive));
        Ok(Some(Computed { branch, at, load }))
    }

    /// The degree of freedom whose fundamental is compared.
    pub fn name(&self) -> &str {
        &self.at.name
    }

    /// The load of the branch, with its unit and place.
    pub fn load(&self) -> &str {
        &self.load
    }

    /// The place of the branch that is nearest to a point.
    pub fn nearest(&self, point: &ResponsePoint) -> Option<Nearest> {
        let read = [point.frequency_hz, size(point.displacement_m(self.at.channel))];
        nearest(&self.branch.orbits, 0, read, Distances::default())
    }

    /// The phase by which the motion leads the load, rad.
    pub fn phase_rad(&self, point: &ResponsePoint) -> f64 {
        let displacement = point.displacement_m(self.at.channel);
        libm::atan2(displacement.im, displacement.re)
    }

    /// How far off the settled points are; `None` if there are none.
    pub fn score(&self, responses: &[ResponsePoint]) -> Option<StructureScore> {
        let mut score = StructureScore {
            at: self.at.name.clone(),
            settled_points: 0,
            unstable_points: 0,
            largest_frequency_deviation: 0.0,
            largest_amplitude_deviation: 0.0,
        };
        for point in responses.iter().filter(|point| point.settled) {
            let Some(place) = self.nearest(point) else { continue };
            score.settled_points += 1;
            score.unstable_points += usize::from(place.is_stable == Some(false));
            let largest = |most: f64, deviation: f64| most.max(deviation.abs());
            score.largest_frequency_deviation = largest(score.largest_frequency_deviation, place.frequency_deviation);
            score.largest_amplitude_deviation = largest(score.largest_amplitude_deviation, place.amplitude_deviation);
        }
        (score.settled_points > 0).then_some(score)
    }

    /// The points over the branch: the amplitude of the fundamental over the frequency; unstable motions dashed.
    pub fn figure(
        &self,
        title: &str,
        scenario: &Scenario,
        tested: &TestedAssembly,
        responses: &[ResponsePoint],
    ) -> Figure {
        let ReadDof { dof, name, channel } = &self.at;
        let amplitude = Axis::linear(format!("amplitude of {name} ({})", displacement_unit(*dof)));
        let mut panel = Panel::new(Axis::linear("frequency (Hz)"), amplitude);
        for (stretch, is_stable) in stretches(&self.branch) {
            let size = |orbit: &_| {
                let resonarm::analysis::structure::Orbit { frequency_hz, readings, .. } = orbit;
                (*frequency_hz, readings.first().map_or(f64::NAN, |reading| size(reading.harmonic1)))
            };
            let (title, dash) = match is_stable {
                Some(false) => ("computed, unstable", Dash::Dashed),
                _ => ("computed", Dash::Solid),
            };
            let style = Style::Line { color: Color::Blue, width: 1.6, dash };
            panel.series.push(Series::line(title, Color::Blue, stretch.iter().map(size).collect()).style(style));
        }
        for (title, settled) in [("read, settled", true), ("read, not settled", false)] {
            let read = responses.iter().filter(|point| point.settled == settled);
            let places = read.map(|point| (point.frequency_hz, size(point.displacement_m(*channel)))).collect();
            let markers = Series::markers(title, Color::Vermillion, Marker::Triangle, places);
            panel = panel.with_any(markers.marked(6.0, settled));
        }
        let clipped = responses.iter().filter(|point| point.clipped[*channel]);
        let places = clipped.map(|point| (point.frequency_hz, size(point.displacement_m(*channel)))).collect();
        panel = panel.with_any(Series::markers(CLIPPED, Color::Black, Marker::Cross, places).marked(11.0, false));
        Figure::new(title).subtitle(format!("{}, {}", label(scenario, tested), self.load)).with(panel)
    }
}

/// The points for people; `unit` is that of the load.
pub(crate) fn table(points: &[StructurePoint], unit: &str) -> String {
    let mut text = format!("  {:>12}  {:>7}  {:>10}", "frequency", "lag", "load");
    for reading in points.iter().take(1).flat_map(|point| &point.readings) {
        text += &format!("  {:>12}", reading.at);
    }
    text += "  tries\n";
    for point in points {
        let load = format!("{:.3} {unit}", point.excitation);
        let lag = point.lag_deg.map_or(String::from("–"), |lag_deg| format!("{lag_deg:.2}°"));
        text += &format!("  {:9.5} Hz  {lag:>7}  {load:>10}", point.frequency_hz);
        for reading in &point.readings {
            text += &format!("  {:>12}", format!("{:.3e} {}", reading.amplitude, reading.unit));
        }
        let clipped: Vec<&str> =
            point.readings.iter().filter(|reading| reading.clipped).map(|reading| reading.at.as_str()).collect();
        let remark = match (point.settled, &clipped[..]) {
            (false, _) => String::from("not settled"),
            (true, []) => String::new(),
            (true, clipped) => format!("clipped: {}", clipped.join(", ")),
        };
        text += format!("  {:5}  {remark}", point.tries).trim_end();
        text.push('\n');
    }
    text
}

/// The points as CSV; `unit` is that of the load.
pub(crate) fn csv(points: &[StructurePoint], unit: &str) -> String {
    let load = if unit == "N" { "n" } else { "nm" };
    let mut text = format!("frequency_hz,lag_deg,excitation_{load}");
    for reading in points.iter().take(1).flat_map(|point| &point.readings) {
        let (name, unit) = (reading.at.replace('.', "_"), reading.unit);
        text += &format!(",{name}_amplitude_{unit},{name}_phase_deg,{name}_clipped");
    }
    text += ",settled,tries\n";
    for point in points {
        let lag = point.lag_deg.map_or(String::new(), |lag_deg| lag_deg.to_string());
        text += &format!("{},{lag},{}", point.frequency_hz, point.excitation);
        for reading in &point.readings {
            text += &format!(",{:e},{},{}", reading.amplitude, reading.phase_deg, reading.clipped);
        }
        text += &format!(",{},{}\n", point.settled, point.tries);
    }
    text
}

/// The score in a line.
pub(crate) fn score_line(score: &StructureScore) -> String {
    format!(
        "{} settled points on the computed branch of {} within {:.1e} of the frequency and {:.1e} of the amplitude, {} of \
         them where it is unstable\n",
        score.settled_points,
        score.at,
        score.largest_frequency_deviation,
        score.largest_amplitude_deviation,
        score.unstable_points,
    )
}
