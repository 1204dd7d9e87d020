//! Points of a phase walk, for documents, tables and figures.

use serde::Serialize;

use crate::failure::Failure;
use crate::figures::branch_plot;
use crate::figures::captions;
use resonarm::analysis::{Branch, response_around};
use resonarm::arm::{Arm, Load};
use resonarm::control::{ControlSpec, JointAngles, ResponsePoint};
use resonarm::scenario::Scenario;
use resonarm_figures::plot::{Color, Figure, Marker, Panel, Series};

/// A point of a walk, as the controller read it.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct WalkPoint {
    pub frequency_hz: f64,
    /// Fundamentals of α1 and α2.
    pub harmonic1_rad: [f64; 2],
    /// The largest |α1| and |α2|.
    pub amplitude_rad: [f64; 2],
    /// Lag of the followed angle behind the load.
    pub phase_deg: f64,
    /// Amplitude of the acting load's fundamental, N or N·m.
    pub excitation: f64,
    /// Its standard deviation due to the noise of the readings, at this frequency and amplitude.
    pub excitation_deviation: Option<f64>,
    /// Harmonics 2 and 3 of the head's force over its fundamental, and both together: the computed response is that of
    /// a pure sine.
    pub force_harmonics: Option<[f64; 2]>,
    pub distortion: Option<f64>,
    pub settled: bool,
    pub tries: u32,
    /// Whether α1 and α2 come from an accelerometer with a clipped axis: then they are accurate only to some per cent.
    pub clipped: [bool; 2],
}

impl WalkPoint {
    pub fn new(point: &ResponsePoint, arm: &Arm) -> WalkPoint {
        let angles = JointAngles::of(point, arm);
        WalkPoint {
            frequency_hz: point.frequency_hz,
            harmonic1_rad: angles.harmonic1_rad(),
            amplitude_rad: angles.amplitude_rad,
            phase_deg: point.lag_rad.map_or(f64::NAN, f64::to_degrees),
            excitation: point.load,
            excitation_deviation: point.load_deviation,
            force_harmonics: point.force_harmonics(),
            distortion: point.distortion(),
            settled: point.settled,
            tries: point.tries,
            clipped: angles.clipped,
        }
    }
}

/// The points for people; `unit` is that of the load.
pub(crate) fn table(points: &[WalkPoint], unit: &str) -> String {
    let mut text = format!("  {:>12}  {:>7}  {:>10}  {:>10}  {:>10}  tries\n", "frequency", "lag", "load", "α1", "α2");
    for point in points {
        text += &format!(
            "  {:9.5} Hz  {:6.2}°  {:>10}  {:7.5} rad {:8.5} rad  {:4}  {}\n",
            point.frequency_hz,
            point.phase_deg,
            format!("{:.3} {unit}", point.excitation),
            point.harmonic1_rad[0],
            point.harmonic1_rad[1],
            point.tries,
            remark(point),
        );
    }
    text
}

fn remark(point: &WalkPoint) -> &'static str {
    match (point.settled, point.clipped) {
        (false, _) => "not settled",
        (true, [false, false]) => "",
        (true, [false, true]) => "α2 clipped",
        (true, [true, _]) => "clipped",
    }
}

/// The columns of points in tables; `unit` is that of the load.
pub(crate) fn columns(unit: &str) -> String {
    let unit = if unit == "N" { "n" } else { "nm" };
    format!(
        "frequency_hz,phase_deg,excitation_{unit},harmonic1_alpha1_rad,harmonic1_alpha2_rad,\
         largest_alpha1_rad,largest_alpha2_rad,settled,tries"
    )
}

impl WalkPoint {
    /// Its cells in these columns.
    pub fn cells(&self) -> String {
        let WalkPoint { frequency_hz, phase_deg, excitation, settled, tries, .. } = self;
        let ([h1, h2], [a1, a2]) = (self.harmonic1_rad, self.amplitude_rad);
        format!("{frequency_hz},{phase_deg},{excitation},{h1},{h2},{a1},{a2},{settled},{tries}")
    }
}

/// The points as CSV; `unit` is that of the load.
pub(crate) fn csv(points: &[WalkPoint], unit: &str) -> String {
    let mut text = columns(unit) + ",clipped_alpha1,clipped_alpha2\n";
    for point in points {
        let [c1, c2] = point.clipped;
        text += &format!("{},{c1},{c2}\n", point.cells());
    }
    text
}

/// The label of points that come from clipped readings.
pub(crate) const CLIPPED: &str = "from clipped readings";

/// Largest turn between two motions of the computed branch, for smooth lines.
const SMOOTH_RAD: f64 = 0.05;

/// A point as it is drawn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drawn {
    pub frequency_hz: f64,
    /// The largest |α1| and |α2|.
    pub amplitude_rad: [f64; 2],
    pub settled: bool,
    /// Whether each comes from clipped readings.
    pub clipped: [bool; 2],
}

impl From<&WalkPoint> for Drawn {
    fn from(point: &WalkPoint) -> Drawn {
        let WalkPoint { frequency_hz, amplitude_rad, settled, clipped, .. } = *point;
        Drawn { frequency_hz, amplitude_rad, settled, clipped }
    }
}

/// The points over the computed branch: largest |α1| and |α2| over frequency; `None` without a point.
pub(crate) fn figure(
    scenario: &Scenario,
    control: &ControlSpec,
    points: &[WalkPoint],
) -> Result<Option<Figure>, Failure> {
    if points.is_empty() {
        return Ok(None);
    }
    let (load, points) = (control.amplitude().load(), points.iter().map(Drawn::from).collect::<Vec<_>>());
    let branch = branch(scenario, &load, &points, SMOOTH_RAD)?;
    Ok(Some(drawn("Phase walk over the resonance", scenario, &load, &branch, &points)))
}

/// The computed branch around `points`, at least one, in steps that turn by `largest_turn_rad` at most.
pub(crate) fn branch(
    scenario: &Scenario,
    load: &Load,
    points: &[Drawn],
    largest_turn_rad: f64,
) -> Result<Branch, Failure> {
    let hz = points.iter().map(|point| point.frequency_hz);
    let (low_hz, high_hz) = hz.fold((f64::INFINITY, 0.0_f64), |(low, high), hz| (low.min(hz), high.max(hz)));
    Ok(response_around(&scenario.build_arm()?, load, [low_hz, high_hz], largest_turn_rad)?)
}

/// Points over a branch.
pub(crate) fn drawn(title: &str, scenario: &Scenario, load: &Load, branch: &Branch, points: &[Drawn]) -> Figure {
    let conditions = captions::pose(scenario).and(captions::load(load));
    branch_plot::of_joints(Figure::new(title).subtitle(conditions), "frequency (Hz)", |panel, joint| {
        with_points(branch_plot::with_branch(panel, branch, joint), points, joint)
    })
}

/// Filled markers where a point settled, open ones where it did not, crosses where its readings were clipped.
fn with_points(mut panel: Panel, points: &[Drawn], joint: usize) -> Panel {
    for (label, settled) in [("read, settled", true), ("read, not settled", false)] {
        let read = points.iter().filter(|point| point.settled == settled);
        let places: Vec<_> = read.map(|point| (point.frequency_hz, point.amplitude_rad[joint])).collect();
        panel =
            panel.with_any(Series::markers(label, Color::Vermillion, Marker::Triangle, places).marked(6.0, settled));
    }
    let clipped = points.iter().filter(|point| point.clipped[joint]);
    let places = clipped.map(|point| (point.frequency_hz, point.amplitude_rad[joint])).collect();
    panel.with_any(Series::markers(CLIPPED, Color::Black, Marker::Cross, places).marked(11.0, false))
}
