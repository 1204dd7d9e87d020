//! `resonarm frf`: frequency responses of the linearised arm.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use serde_json::Value;

use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::figures::captions;
use crate::flags::{self, ArmFlags};
use crate::output::{self, JsonFlag, OverwriteFlag};
use resonarm::analysis::{Drive, FrequencyResponse, Quantity, Response, continuous_phase, frequencies_hz, modes};
use resonarm::arm::Arm;
use resonarm::scenario::Scenario;
use resonarm_figures::plot::{Axis, Color, Dash, Figure, Panel, Series, Style};
use resonarm_numeric::number::short;

/// Frequency responses of the linearised arm: receptance, mobility or accelerance of α, B and C.
///
/// CSV has a line for each frequency, with modulus and phase; JSON has complex values, [real, imaginary]. Every
/// response names its unit. With --plot both go to files beside the figure, and standard output lists them.
#[derive(Debug, Args)]
pub(crate) struct Frf {
    #[command(flatten)]
    pub(crate) arm: ArmFlags,
    /// What drives the arm.
    #[arg(long, value_parser = flags::one_of(Drive::ALL, Drive::name), default_value_t = Drive::Torque1)]
    drive: Drive,
    /// Displacement, velocity or acceleration over the drive.
    #[arg(long, value_parser = flags::one_of(Quantity::ALL, Quantity::name), default_value_t = Quantity::Receptance)]
    quantity: Quantity,
    /// Where the response is taken, separated by commas [default: all].
    #[arg(long, value_parser = flags::one_of(Response::ALL, Response::name), value_delimiter = ',')]
    response: Vec<Response>,
    /// First frequency, Hz.
    #[arg(long, value_name = "F", default_value_t = 1.0)]
    from_hz: f64,
    /// Last frequency, Hz.
    #[arg(long, value_name = "F", default_value_t = 80.0)]
    to_hz: f64,
    /// Number of frequencies, evenly spaced, at most a million [default: 801, and more about each natural frequency].
    #[arg(long, value_name = "N", value_parser = flags::points())]
    points: Option<u32>,
    /// Plot to STEM.svg and STEM.png; caption, CSV and JSON beside them, instead of CSV on standard output.
    #[arg(long, value_name = "STEM")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteFlag,
    #[command(flatten)]
    json: JsonFlag,
}

/// Beyond any vibration of an arm; its square is still finite.
const HIGHEST_HZ: f64 = 1e9;

/// Evenly spaced frequencies where no number is given.
const EVEN_POINTS: u32 = 801;

/// A colour each; responses along y and of the second angle are dashed, so that they differ in black and white.
pub(crate) const fn style(response: Response) -> Style {
    let (color, dash) = match response {
        Response::Alpha1 => (Color::Blue, Dash::Solid),
        Response::Alpha2 => (Color::Vermillion, Dash::Dashed),
        Response::BX => (Color::Orange, Dash::Solid),
        Response::BY => (Color::Orange, Dash::Dashed),
        Response::CX => (Color::Black, Dash::Solid),
        Response::CY => (Color::Black, Dash::Dashed),
    };
    Style::Line { color, width: 1.6, dash }
}

#[derive(Serialize)]
struct Document {
    configuration: Value,
    drive: Drive,
    quantity: Quantity,
    frequency_hz: Vec<f64>,
    responses: Vec<ResponseCurve>,
}

/// One response over all frequencies, complex as [real, imaginary].
#[derive(Serialize)]
struct ResponseCurve {
    response: Response,
    unit: String,
    value: Vec<[f64; 2]>,
}

impl Frf {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        self.overwrite.check_stem(self.plot.as_deref(), output::PLOTTED)?;
        let scenario = self.arm.scenario()?;
        let arm = scenario.build_arm()?;
        let linear = FrequencyResponse::new(&arm);
        let document = self.compute(&scenario, (&arm, &linear))?;
        let drawn = || (self.figure(&scenario, &document, (&arm, &linear)), table(&document));
        let files = output::plot(self.plot.as_deref(), &document, drawn)?;
        let text = || if files.is_empty() { table(&document) } else { String::new() };
        self.json.show(&document, text, &files)
    }

    fn wanted(&self) -> Vec<Response> {
        if self.response.is_empty() { Response::ALL.to_vec() } else { self.response.clone() }
    }

    /// The unit of a response over the drive, as `m/s² per N`.
    fn unit(&self, response: Response) -> String {
        format!("{} per {}", self.quantity.unit(response), self.drive.unit())
    }

    fn compute(&self, scenario: &Scenario, (arm, linear): (&Arm, &FrequencyResponse)) -> Result<Document, Failure> {
        let (from, to) = (self.from_hz, self.to_hz);
        if !(from >= 0.0 && to > from && to <= HIGHEST_HZ) {
            return Err(Failure::usage(format!(
                "--from-hz {} --to-hz {}: the frequencies must rise from 0 or above, to {HIGHEST_HZ:e} at most",
                short(&from),
                short(&to)
            )));
        }
        let (drive, quantity) = (self.drive, self.quantity);
        let frequency_hz = match self.points {
            Some(points) => frequencies_hz(from, to, points, &[]),
            None => frequencies_hz(from, to, EVEN_POINTS, &modes(arm)),
        };
        let curve = |response: Response| -> Result<ResponseCurve, Failure> {
            let value = |hz: &f64| linear.at(quantity, drive, response, *hz).map(|z| [z.re, z.im]);
            let value = frequency_hz.iter().map(value).collect::<Result<_, _>>();
            let unit = self.unit(response);
            Ok(ResponseCurve { response, unit, value: value.map_err(|error| Failure::usage(error.to_string()))? })
        };
        let responses = self.wanted().into_iter().map(curve).collect::<Result<_, Failure>>()?;
        Ok(Document { configuration: configuration::of_arm(scenario)?, drive, quantity, frequency_hz, responses })
    }

    /// The moduli of angles and of displacements in separate panels, since their units differ, above the phases of all.
    fn figure(&self, scenario: &Scenario, document: &Document, (arm, linear): (&Arm, &FrequencyResponse)) -> Figure {
        let natural_hz = modes(arm).map(|mode| mode.frequency_hz);
        let x = || Axis::linear("frequency (Hz)");
        let modulus = |like: Response| Panel::new(x(), Axis::log(format!("{} ({})", self.quantity, self.unit(like))));
        let (mut angles, mut displacements) = (modulus(Response::Alpha1), modulus(Response::CX));
        let mut phase = Panel::new(x(), Axis::degrees("phase (°)"));
        for curve in &document.responses {
            let response = curve.response;
            // Zeros are left out: they have no logarithm.
            let size = |[re, im]: &[f64; 2]| Some(libm::hypot(*re, *im)).filter(|size| *size > 0.0).unwrap_or(f64::NAN);
            let sizes = document.frequency_hz.iter().zip(&curve.value).map(|(hz, value)| (*hz, size(value))).collect();
            let at = |hz: f64| linear.at(self.quantity, self.drive, response, hz).ok();
            let line = |points| Series::line(response.symbol(), Color::Black, points).style(style(response));
            let panel = if response.is_angle() { &mut angles } else { &mut displacements };
            panel.series.push(line(sizes));
            phase.series.push(line(continuous_phase(&document.frequency_hz, natural_hz, &at)));
        }
        let moduli = [angles, displacements].into_iter().filter(|panel| !panel.series.is_empty());
        let figure = Figure::new(format!("Frequency response to {}", self.drive.label()));
        let figure = figure.subtitle(captions::pose(&scenario.arm));
        moduli.fold(figure, Figure::with).with(phase)
    }
}

/// CSV: frequency, then modulus and phase of each response.
fn table(document: &Document) -> String {
    let mut text = String::from("frequency_hz");
    for ResponseCurve { response, unit, .. } in &document.responses {
        let name = response.name().replace('-', "_");
        let unit = unit.replace(' ', "_").replace("/s²", "_s2").replace("/s", "_s");
        let unit = unit.replace("N·m", "nm").replace('N', "n");
        text += &format!(",{name}_modulus_{unit},{name}_phase_deg");
    }
    text.push('\n');
    for (k, hz) in document.frequency_hz.iter().enumerate() {
        text += &format!("{hz}");
        for curve in &document.responses {
            let [re, im] = curve.value[k];
            text += &format!(",{:e},{}", libm::hypot(re, im), libm::atan2(im, re).to_degrees());
        }
        text.push('\n');
    }
    text
}

/// Phases in degrees with a gap wherever they jump from one end of the circle to the other.
pub(crate) fn broken_at_wraps(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let mut broken = Vec::with_capacity(points.len());
    for point in points {
        if broken.last().is_some_and(|before: &(f64, f64)| (point.1 - before.1).abs() > 270.0) {
            broken.push((point.0, f64::NAN));
        }
        broken.push(point);
    }
    broken
}
