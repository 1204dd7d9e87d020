//! Points that a controller measured, one for each frequency: in documents, as a table and as CSV.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::output::or_empty;
use crate::read_at::{displacement_unit, size};
use resonarm::control::ResponsePoint;
use resonarm::plant::{ReadDof, TestedAssembly};

/// The measurement of an accelerometer along one axis: the fundamental of the displacement.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct PointReading {
    pub amplitude: f64,
    /// The phase by which the displacement leads the load; other programs may leave it out.
    #[serde(default)]
    pub phase_deg: Option<f64>,
    /// The unit of the amplitude, `m`; other programs may leave it out.
    #[serde(default)]
    pub unit: Option<String>,
    /// Whether the accelerometer clipped: then the amplitude is accurate only to some per cent.
    #[serde(default)]
    pub clipped: bool,
}

impl PointReading {
    fn unit(&self) -> &str {
        self.unit.as_deref().unwrap_or_default()
    }
}

/// A response that a controller measured at one frequency. Documents of other programs need the frequency, the
/// amplitudes and whether the point settled.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct MeasuredPoint {
    pub frequency_hz: f64,
    /// Lag of the quantity that a closed loop follows behind the load; none in open loop.
    #[serde(default)]
    pub lag_deg: Option<f64>,
    /// Amplitude of the acting load's fundamental, N or N·m.
    #[serde(default)]
    pub excitation: Option<f64>,
    /// Its standard deviation due to the noise of the readings, at this frequency and amplitude.
    #[serde(default)]
    pub excitation_deviation: Option<f64>,
    /// Harmonics 2 and 3 of the head's force over its fundamental: the computed response is that of a pure sine.
    #[serde(default)]
    pub force_harmonics: Option<[f64; 2]>,
    /// Both harmonics together over the fundamental.
    #[serde(default)]
    pub distortion: Option<f64>,
    /// The displacements by degree of freedom.
    pub readings: BTreeMap<String, PointReading>,
    pub settled: bool,
    /// The number of attempts at the point.
    #[serde(default)]
    pub tries: Option<u32>,
}

impl MeasuredPoint {
    /// Returns the amplitude at a degree of freedom; `None` if it was not measured there.
    pub fn amplitude(&self, dof: &str) -> Option<f64> {
        self.readings.get(dof).map(|reading| reading.amplitude)
    }

    /// Says whether the reading of a degree of freedom is clipped.
    pub fn is_clipped(&self, dof: &str) -> bool {
        self.readings.get(dof).is_some_and(|reading| reading.clipped)
    }

    /// Says why the point is doubtful; empty if it is not.
    fn remark(&self) -> String {
        let clipped: Vec<&str> =
            self.readings.iter().filter(|(_, reading)| reading.clipped).map(|(dof, _)| dof.as_str()).collect();
        match (self.settled, &clipped[..]) {
            (false, _) => String::from("not settled"),
            (true, []) => String::new(),
            (true, clipped) => format!("clipped: {}", clipped.join(", ")),
        }
    }
}

/// Returns the responses of a controller as points, with the displacements of the accelerometers.
pub(crate) fn points(tested: &TestedAssembly, responses: &[ResponsePoint]) -> Vec<MeasuredPoint> {
    let places = tested.read();
    let reading = |point: &ResponsePoint, ReadDof { dof, name, channel }: &ReadDof| {
        let displacement = point.displacement_m(*channel);
        let reading = PointReading {
            amplitude: size(displacement),
            phase_deg: Some(libm::atan2(displacement.im, displacement.re).to_degrees()),
            unit: Some(displacement_unit(*dof).to_owned()),
            clipped: point.clipped[*channel],
        };
        (name.clone(), reading)
    };
    let measured = |point: &ResponsePoint| MeasuredPoint {
        frequency_hz: point.frequency_hz,
        lag_deg: point.lag_rad.map(f64::to_degrees),
        excitation: Some(point.load),
        excitation_deviation: point.load_deviation,
        force_harmonics: point.force_harmonics(),
        distortion: point.distortion(),
        readings: places.iter().map(|place| reading(point, place)).collect(),
        settled: point.settled,
        tries: Some(point.tries),
    };
    responses.iter().map(measured).collect()
}

/// Lists the points in a table; `unit` is that of the load.
pub(crate) fn table(points: &[MeasuredPoint], unit: &str) -> String {
    let mut text = format!("  {:>12}  {:>7}  {:>10}", "frequency", "lag", "load");
    for dof in points.iter().take(1).flat_map(|point| point.readings.keys()) {
        text += &format!("  {dof:>12}");
    }
    text += "  tries\n";
    for point in points {
        let load = point.excitation.map_or(String::from("–"), |load| format!("{load:.3} {unit}"));
        let lag = point.lag_deg.map_or(String::from("–"), |lag_deg| format!("{lag_deg:.2}°"));
        text += &format!("  {:9.5} Hz  {lag:>7}  {load:>10}", point.frequency_hz);
        for reading in point.readings.values() {
            text += &format!("  {:>12}", format!("{:.3e} {}", reading.amplitude, reading.unit()));
        }
        let tries = point.tries.map_or(String::from("–"), |tries| tries.to_string());
        text += format!("  {tries:>5}  {}", point.remark()).trim_end();
        text.push('\n');
    }
    text
}

/// Returns the names of the columns of a point; `unit` is that of the load, and all points are read where the first one
/// is.
pub(crate) fn columns(points: &[MeasuredPoint], unit: &str) -> String {
    let load = if unit == "N" { "n" } else { "nm" };
    let mut text = format!("frequency_hz,lag_deg,excitation_{load}");
    // `readings` is a sorted map, so the cells of every point have the order of these columns.
    for (dof, reading) in points.iter().take(1).flat_map(|point| &point.readings) {
        let name = dof.replace('.', "_");
        let unit = reading.unit();
        text += &format!(",{name}_amplitude_{unit},{name}_phase_deg,{name}_clipped");
    }
    text + ",settled,tries"
}

impl MeasuredPoint {
    /// Returns the cells of the point in the order of [`columns`]; what is unknown is empty.
    pub fn cells(&self) -> String {
        let mut text = format!("{},{},{}", self.frequency_hz, or_empty(self.lag_deg), or_empty(self.excitation));
        for reading in self.readings.values() {
            text += &format!(",{:e},{},{}", reading.amplitude, or_empty(reading.phase_deg), reading.clipped);
        }
        text + &format!(",{},{}", self.settled, or_empty(self.tries))
    }
}

/// Returns the points as CSV; `unit` is that of the load.
pub(crate) fn csv(points: &[MeasuredPoint], unit: &str) -> String {
    let mut text = columns(points, unit) + "\n";
    points.iter().for_each(|point| text += &(point.cells() + "\n"));
    text
}
