//! `resonarm frf`: frequency responses of the linearised arm.

use core::fmt::Write;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde::Serialize;
use serde_json::Value;

use super::captions;
use super::configuration;
use super::failure::{Failure, Verdict};
use super::flags::{self, ArmFlags};
use super::output::{self, OverwriteFlag};
use crate::analysis::{Drive, FrequencyResponse, Quantity, Response, frequencies_hz, modes};
use crate::number::short;
use crate::plot::{Axis, Color, Dash, Figure, Legend, Panel, Series, Style};
use crate::scenario::Scenario;

/// Frequency responses of the linearised arm: receptance, mobility or accelerance of α, B and C.
///
/// As CSV a line for each frequency, with modulus and phase; as JSON complex, [real, imaginary]. Every response names its unit. With
/// --plot both go to files beside the figure, and standard output says which.
#[derive(Debug, Args)]
pub(super) struct Frf {
    #[command(flatten)]
    arm: ArmFlags,
    /// What drives the arm.
    #[arg(long, value_enum, default_value_t = DriveFlag::Torque1)]
    drive: DriveFlag,
    /// Displacement, velocity or acceleration over the drive.
    #[arg(long, value_enum, default_value_t = QuantityFlag::Receptance)]
    quantity: QuantityFlag,
    /// Where the response is taken; several with commas [default: all].
    #[arg(long, value_enum, value_delimiter = ',')]
    response: Vec<ResponseFlag>,
    /// First frequency, Hz.
    #[arg(long, value_name = "F", default_value_t = 1.0)]
    from_hz: f64,
    /// Last frequency, Hz.
    #[arg(long, value_name = "F", default_value_t = 80.0)]
    to_hz: f64,
    /// Number of frequencies, evenly spaced, at most a million [default: 801, and more about each natural frequency].
    #[arg(long, value_name = "N", value_parser = flags::points())]
    points: Option<u32>,
    /// Plot to STEM.svg and STEM.png; CSV and JSON beside them, instead of CSV on standard output.
    #[arg(long, value_name = "STEM")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteFlag,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// Beyond any vibration of an arm; squares of it are numbers still.
const HIGHEST_HZ: f64 = 1e9;

/// Evenly spaced frequencies where no number is given.
const EVEN_POINTS: u32 = 801;

#[derive(Clone, Copy, Debug, ValueEnum)]
enum DriveFlag {
    Torque1,
    Torque2,
    ForceX,
    ForceY,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum QuantityFlag {
    Receptance,
    Mobility,
    Accelerance,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ResponseFlag {
    Alpha1,
    Alpha2,
    #[value(name = "b-x")]
    BX,
    #[value(name = "b-y")]
    BY,
    #[value(name = "c-x")]
    CX,
    #[value(name = "c-y")]
    CY,
}

impl From<DriveFlag> for Drive {
    fn from(flag: DriveFlag) -> Drive {
        match flag {
            DriveFlag::Torque1 => Drive::Torque1,
            DriveFlag::Torque2 => Drive::Torque2,
            DriveFlag::ForceX => Drive::ForceX,
            DriveFlag::ForceY => Drive::ForceY,
        }
    }
}

impl DriveFlag {
    const fn label(self) -> &'static str {
        match self {
            DriveFlag::Torque1 => "torque at joint 1",
            DriveFlag::Torque2 => "torque at joint 2",
            DriveFlag::ForceX => "force at C along x",
            DriveFlag::ForceY => "force at C along y",
        }
    }

    const fn unit(self) -> &'static str {
        match self {
            DriveFlag::Torque1 | DriveFlag::Torque2 => "N·m",
            DriveFlag::ForceX | DriveFlag::ForceY => "N",
        }
    }
}

impl From<QuantityFlag> for Quantity {
    fn from(flag: QuantityFlag) -> Quantity {
        match flag {
            QuantityFlag::Receptance => Quantity::Receptance,
            QuantityFlag::Mobility => Quantity::Mobility,
            QuantityFlag::Accelerance => Quantity::Accelerance,
        }
    }
}

impl QuantityFlag {
    const fn name(self) -> &'static str {
        match self {
            QuantityFlag::Receptance => "receptance",
            QuantityFlag::Mobility => "mobility",
            QuantityFlag::Accelerance => "accelerance",
        }
    }

    /// The unit of this derivative of a motion in `motion`.
    fn unit(self, motion: &str) -> String {
        let rate = match self {
            QuantityFlag::Receptance => "",
            QuantityFlag::Mobility => "/s",
            QuantityFlag::Accelerance => "/s²",
        };
        format!("{motion}{rate}")
    }
}

impl ResponseFlag {
    const ALL: [ResponseFlag; 6] = [
        ResponseFlag::Alpha1,
        ResponseFlag::Alpha2,
        ResponseFlag::BX,
        ResponseFlag::BY,
        ResponseFlag::CX,
        ResponseFlag::CY,
    ];

    const fn response(self) -> Response {
        match self {
            ResponseFlag::Alpha1 => Response::Alpha1,
            ResponseFlag::Alpha2 => Response::Alpha2,
            ResponseFlag::BX => Response::BX,
            ResponseFlag::BY => Response::BY,
            ResponseFlag::CX => Response::CX,
            ResponseFlag::CY => Response::CY,
        }
    }

    const fn label(self) -> &'static str {
        match self {
            ResponseFlag::Alpha1 => "α1",
            ResponseFlag::Alpha2 => "α2",
            ResponseFlag::BX => "B x",
            ResponseFlag::BY => "B y",
            ResponseFlag::CX => "C x",
            ResponseFlag::CY => "C y",
        }
    }

    /// The name in a column of CSV.
    const fn column(self) -> &'static str {
        match self {
            ResponseFlag::Alpha1 => "alpha1",
            ResponseFlag::Alpha2 => "alpha2",
            ResponseFlag::BX => "b_x",
            ResponseFlag::BY => "b_y",
            ResponseFlag::CX => "c_x",
            ResponseFlag::CY => "c_y",
        }
    }

    /// A colour each; what lies along y, and the second angle, is dashed, so that print without colours tells them apart.
    const fn style(self) -> Style {
        let (color, dash) = match self {
            ResponseFlag::Alpha1 => (Color::Blue, Dash::Solid),
            ResponseFlag::Alpha2 => (Color::Vermillion, Dash::Dashed),
            ResponseFlag::BX => (Color::Orange, Dash::Solid),
            ResponseFlag::BY => (Color::Orange, Dash::Dashed),
            ResponseFlag::CX => (Color::Black, Dash::Solid),
            ResponseFlag::CY => (Color::Black, Dash::Dashed),
        };
        Style::Line { color, width: 1.6, dash }
    }

    const fn is_angle(self) -> bool {
        matches!(self, ResponseFlag::Alpha1 | ResponseFlag::Alpha2)
    }

    const fn unit(self) -> &'static str {
        if self.is_angle() { "rad" } else { "m" }
    }
}

#[derive(Serialize)]
struct Document {
    /// The arm and its pose.
    configuration: Value,
    drive: Drive,
    quantity: Quantity,
    frequency_hz: Vec<f64>,
    responses: Vec<Curve>,
}

/// One response over all frequencies, complex as [real, imaginary].
#[derive(Serialize)]
struct Curve {
    response: Response,
    unit: String,
    value: Vec<[f64; 2]>,
}

impl Frf {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        self.overwrite.check_stem(self.plot.as_deref(), &[".svg", ".png", ".csv", ".json"])?;
        let scenario = self.arm.scenario(|| Ok(Scenario::default()))?;
        let document = self.compute(&scenario)?;
        let files = match &self.plot {
            Some(stem) => {
                Some(output::plot(stem, &self.figure(&scenario, &document), &self.table(&document), &document)?)
            }
            None => None,
        };
        match (self.json, files) {
            (true, _) => output::print_json(&document)?,
            (false, Some(files)) => output::print_written(&files)?,
            (false, None) => output::print(&self.table(&document))?,
        }
        Ok(Verdict::Positive)
    }

    fn wanted(&self) -> Vec<ResponseFlag> {
        if self.response.is_empty() { ResponseFlag::ALL.to_vec() } else { self.response.clone() }
    }

    fn compute(&self, scenario: &Scenario) -> Result<Document, Failure> {
        let (from, to) = (self.from_hz, self.to_hz);
        if !(from >= 0.0 && to > from && to <= HIGHEST_HZ) {
            return Err(Failure::Usage(format!(
                "--from-hz {} --to-hz {}: the frequencies must rise from 0 or above, to {HIGHEST_HZ:e} at most",
                short(&from),
                short(&to)
            )));
        }
        let arm = scenario.build_arm()?;
        let linear = FrequencyResponse::new(&arm);
        let (drive, quantity) = (self.drive.into(), self.quantity.into());
        let frequency_hz = match self.points {
            Some(points) => frequencies_hz(from, to, points, &[]),
            None => frequencies_hz(from, to, EVEN_POINTS, &modes(&arm)),
        };
        let curve = |flag: ResponseFlag| -> Result<Curve, Failure> {
            let response = flag.response();
            let value = |hz: &f64| linear.at(quantity, drive, response, *hz).map(|z| [z.re, z.im]);
            let value = frequency_hz.iter().map(value).collect::<Result<_, _>>();
            let unit = format!("{} per {}", self.quantity.unit(flag.unit()), self.drive.unit());
            Ok(Curve { response, unit, value: value.map_err(|error| Failure::Usage(error.to_string()))? })
        };
        let responses = self.wanted().into_iter().map(curve).collect::<Result<_, Failure>>()?;
        Ok(Document { configuration: configuration::of_arm(scenario)?, drive, quantity, frequency_hz, responses })
    }

    /// CSV: frequency, then modulus and phase of each response.
    fn table(&self, document: &Document) -> String {
        let mut text = String::from("frequency_hz");
        for flag in self.wanted() {
            let name = flag.column();
            let unit = format!("{}_per_{}", self.quantity.unit(flag.unit()), self.drive.unit());
            let unit = unit.replace("/s²", "_s2").replace("/s", "_s").replace("N·m", "nm").replace('N', "n");
            let _infallible = write!(text, ",{name}_modulus_{unit},{name}_phase_deg");
        }
        text.push('\n');
        for (k, hz) in document.frequency_hz.iter().enumerate() {
            let _infallible = write!(text, "{hz}");
            for curve in &document.responses {
                let [re, im] = curve.value[k];
                let _infallible = write!(text, ",{:e},{}", libm::hypot(re, im), libm::atan2(im, re).to_degrees());
            }
            text.push('\n');
        }
        text
    }

    /// The moduli of angles and of displacements in panels of their own, for their units differ, over the phases of all.
    fn figure(&self, scenario: &Scenario, document: &Document) -> Figure {
        let x = || Axis::linear("frequency (Hz)");
        let modulus = |motion: &str| {
            let unit = self.quantity.unit(motion);
            Panel::new(x(), Axis::log(format!("{} ({unit} per {})", self.quantity.name(), self.drive.unit())))
        };
        let (mut angles, mut displacements) = (modulus("rad"), modulus("m"));
        let mut phase = Panel::new(x(), Axis::degrees("phase (°)"));
        for (curve, flag) in document.responses.iter().zip(self.wanted()) {
            let points = |value: &dyn Fn(f64, f64) -> f64| {
                document.frequency_hz.iter().zip(&curve.value).map(|(hz, [re, im])| (*hz, value(*re, *im))).collect()
            };
            // A zero has no logarithm: it is left out.
            let size = |re: f64, im: f64| Some(libm::hypot(re, im)).filter(|size| *size > 0.0).unwrap_or(f64::NAN);
            let angle =
                |re: f64, im: f64| if size(re, im).is_nan() { f64::NAN } else { libm::atan2(im, re).to_degrees() };
            let line = |points| Series::line(flag.label(), Color::Black, points).style(flag.style());
            let panel = if flag.is_angle() { &mut angles } else { &mut displacements };
            panel.series.push(line(points(&size)));
            phase.series.push(line(broken_at_wraps(points(&angle))));
        }
        let moduli = [angles, displacements].into_iter().filter(|panel| !panel.series.is_empty());
        let figure = Figure::new(format!("Frequency response to {}", self.drive.label()));
        let figure = figure.subtitle(captions::pose(&scenario.arm));
        moduli.fold(figure, Figure::with).with(phase.legend(Legend::None))
    }
}

/// Phases in degrees with a gap wherever they jump from one end of the circle to the other.
fn broken_at_wraps(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let mut broken = Vec::with_capacity(points.len());
    for point in points {
        if broken.last().is_some_and(|before: &(f64, f64)| (point.1 - before.1).abs() > 270.0) {
            broken.push((point.0, f64::NAN));
        }
        broken.push(point);
    }
    broken
}
