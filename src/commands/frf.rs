//! `resonarm frf`: frequency responses of the linearised arm.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use serde_json::Value;

use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::figures::captions;
use crate::figures::response_curves::{csv, style};
use crate::flags::{self, ArmFlags};
use crate::output::{self, Inputs, JsonFlag, OverwriteFlag};
use crate::structures;
use resonarm::analysis::{
    Drive, FrequencyResponse, Quantity, Response, UnknownTerm, continuous_phase, frequencies_hz, modes,
};
use resonarm::arm::Arm;
use resonarm::plant::TestedAssembly;
use resonarm::scenario::Scenario;
use resonarm_figures::plot::{Axis, Color, Figure, Panel, Series};
use resonarm_numeric::number::short;

/// Frequency responses of the linearised arm: receptance, mobility or accelerance of α, B and C; or of the linear part
/// of a scenario's structure.
///
/// CSV has a line for each frequency, with modulus and phase; JSON has complex values, [real, imaginary]. Every
/// response names its unit. With --plot both go to files beside the figure, and standard output lists them.
#[derive(Debug, Args)]
pub(crate) struct Frf {
    #[command(flatten)]
    pub(crate) arm: ArmFlags,
    /// What drives: of the arm torque1, force-x or force-y [default: torque1], of a scenario's structure point and
    /// axis, as tip.x, or a joint, as joint2.
    #[arg(long, value_name = "DOF")]
    drive: Option<String>,
    /// Displacement, velocity or acceleration over the drive.
    #[arg(long, value_parser = flags::one_of(Quantity::ALL, Quantity::name), default_value_t = Quantity::Receptance)]
    quantity: Quantity,
    /// Where the response is taken, separated by commas: of the arm alpha1, alpha2, b-x, b-y, c-x, c-y [default: all],
    /// of a structure as --drive [default: where it is driven].
    #[arg(long, value_name = "DOF", value_delimiter = ',')]
    response: Vec<String>,
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
        let inputs = Inputs::of_scenario(self.arm.scenario.as_deref());
        self.overwrite.check_stem(self.plot.as_deref(), output::PLOTTED, &inputs)?;
        let scenario = self.arm.scenario()?;
        if let Some(tested) = scenario.tested_structure()? {
            return self.of_structure(&scenario, &tested);
        }
        let arm = scenario.build_arm()?;
        let linear = FrequencyResponse::new(&arm);
        let document = self.compute(&scenario, (&arm, &linear))?;
        let drawn = || (self.figure(&scenario, &document, (&arm, &linear)), table(&document));
        let files = output::plot(self.plot.as_deref(), &document, drawn)?;
        let text = || if files.is_empty() { table(&document) } else { String::new() };
        self.json.show(&document, text, &files)
    }

    /// A structure in place of the arm.
    fn of_structure(&self, scenario: &Scenario, tested: &TestedAssembly) -> Result<Verdict, Failure> {
        let Some(drive) = &self.drive else {
            let known = tested.assembly.dof_names().join(", ");
            return Err(Failure::usage(format!(
                "give what drives the structure: --drive DOF, with DOF one of {known}"
            )));
        };
        let modes = tested.assembly.modes().iter().map(|mode| (mode.frequency_hz, mode.damping_ratio));
        let modes: Vec<(f64, f64)> = modes.collect();
        let asked = structures::frf::Asked {
            drive,
            responses: self.response.iter().map(String::as_str).collect(),
            quantity: self.quantity,
            frequency_hz: self.frequencies(&modes)?,
            plot: self.plot.as_deref(),
            json: self.json,
        };
        structures::frf::show(scenario, tested, asked)
    }

    fn drive(&self) -> Result<Drive, Failure> {
        let parse =
            |name: &str| name.parse().map_err(|error: UnknownTerm| Failure::usage(format!("--drive {name}: {error}")));
        self.drive.as_deref().map_or(Ok(Drive::Torque1), parse)
    }

    fn wanted(&self) -> Result<Vec<Response>, Failure> {
        if self.response.is_empty() {
            return Ok(Response::ALL.to_vec());
        }
        let parse = |name: &String| {
            name.parse().map_err(|error: UnknownTerm| Failure::usage(format!("--response {name}: {error}")))
        };
        self.response.iter().map(parse).collect()
    }

    /// The frequencies of the flags, Hz; without their number more about the natural ones.
    fn frequencies(&self, modes: &[(f64, f64)]) -> Result<Vec<f64>, Failure> {
        let (from, to) = (self.from_hz, self.to_hz);
        if !(from >= 0.0 && to > from && to <= HIGHEST_HZ) {
            return Err(Failure::usage(format!(
                "--from-hz {} --to-hz {}: the frequencies must rise from 0 or above, to {HIGHEST_HZ:e} at most",
                short(&from),
                short(&to)
            )));
        }
        Ok(match self.points {
            Some(points) => frequencies_hz(from, to, points, &[]),
            None => frequencies_hz(from, to, EVEN_POINTS, modes),
        })
    }

    /// The unit of a response over the drive, as `m/s² per N`.
    fn unit(&self, response: Response, drive: Drive) -> String {
        format!("{} per {}", self.quantity.unit(response), drive.unit())
    }

    fn compute(&self, scenario: &Scenario, (arm, linear): (&Arm, &FrequencyResponse)) -> Result<Document, Failure> {
        let (drive, quantity) = (self.drive()?, self.quantity);
        let frequency_hz = self.frequencies(&modes(arm).map(|mode| (mode.frequency_hz, mode.damping_ratio)))?;
        let curve = |response: Response| -> Result<ResponseCurve, Failure> {
            let value = |hz: &f64| linear.at(quantity, drive, response, *hz).map(|z| [z.re, z.im]);
            let value = frequency_hz.iter().map(value).collect::<Result<_, _>>();
            let unit = self.unit(response, drive);
            Ok(ResponseCurve { response, unit, value: value.map_err(|error| Failure::usage(error.to_string()))? })
        };
        let responses = self.wanted()?.into_iter().map(curve).collect::<Result<_, Failure>>()?;
        Ok(Document { configuration: configuration::of_arm(scenario)?, drive, quantity, frequency_hz, responses })
    }

    /// The moduli of angles and of displacements in separate panels, since their units differ, above the phases of all.
    fn figure(&self, scenario: &Scenario, document: &Document, (arm, linear): (&Arm, &FrequencyResponse)) -> Figure {
        let natural_hz = modes(arm).map(|mode| mode.frequency_hz);
        let x = || Axis::linear("frequency (Hz)");
        let modulus = |like: Response| {
            Panel::new(x(), Axis::log(format!("{} ({})", self.quantity, self.unit(like, document.drive))))
        };
        let (mut angles, mut displacements) = (modulus(Response::Alpha1), modulus(Response::CX));
        let mut phase = Panel::new(x(), Axis::degrees("phase (°)"));
        for curve in &document.responses {
            let response = curve.response;
            // Zeros are left out: they have no logarithm.
            let size = |[re, im]: &[f64; 2]| Some(libm::hypot(*re, *im)).filter(|size| *size > 0.0).unwrap_or(f64::NAN);
            let sizes = document.frequency_hz.iter().zip(&curve.value).map(|(hz, value)| (*hz, size(value))).collect();
            let at = |hz: f64| linear.at(self.quantity, document.drive, response, hz).ok();
            let line = |points| Series::line(response.symbol(), Color::Black, points).style(style(response));
            let panel = if response.is_angle() { &mut angles } else { &mut displacements };
            panel.series.push(line(sizes));
            phase.series.push(line(continuous_phase(&document.frequency_hz, natural_hz, &at)));
        }
        let moduli = [angles, displacements].into_iter().filter(|panel| !panel.series.is_empty());
        let figure = Figure::new(format!("Frequency response to {}", document.drive.label()));
        let figure = figure.subtitle(captions::pose(&scenario.arm));
        moduli.fold(figure, Figure::with).with(phase)
    }
}

fn table(document: &Document) -> String {
    let curve =
        |curve: &ResponseCurve| (curve.response.name().replace('-', "_"), curve.unit.clone(), curve.value.clone());
    csv(&document.frequency_hz, &document.responses.iter().map(curve).collect::<Vec<_>>())
}
