//! `resonarm frf`: frequency responses of the linear part of the structure.

use clap::Args;
use serde::Serialize;
use serde_json::Value;

use crate::configuration;
use crate::drive;
use crate::failure::{Failure, Verdict};
use crate::figures::captions;
use crate::figures::response_curves::{csv, style};
use crate::flags::{self, StructureFlags};
use crate::help::heading;
use crate::output::{self, Inputs, PlotFlags};
use crate::read_at::{ReadAt, displacement_unit, dof, read_at};
use resonarm::analysis::{LinearResponse, Quantity, continuous_phase, frequencies_hz};
use resonarm::structure::Assembly;
use resonarm_figures::plot::{Axis, Color, Figure, Panel, Series, Subtitle};
use resonarm_numeric::number::short;

/// Computes frequency responses of the structure, linearised at rest.
///
/// They are receptance, mobility or accelerance over a load at a degree of freedom, which is a point and an axis, as
/// tip.x, or a joint, as joint1.
///
/// CSV has a line for each frequency, with modulus and phase; JSON has complex values, [real, imaginary]. Every
/// response names its unit. With --plot both go to files beside the figure, and standard output lists them.
#[derive(Debug, Args)]
#[command(mut_args(output::explained(output::PLOT, "Standard output then lists the files in place of the CSV.")))]
pub(crate) struct Frf {
    #[command(flatten)]
    pub(crate) structure: StructureFlags,
    /// Degree of freedom of the load, a force, or a torque at a joint [default: joint1 of a chain].
    #[arg(long, help_heading = heading::LOADS, value_name = "DOF")]
    drive: Option<String>,
    /// Displacement, velocity or acceleration over the load.
    #[arg(long, help_heading = heading::LOADS, value_parser = flags::one_of(Quantity::ALL, Quantity::name), default_value_t = Quantity::Receptance)]
    quantity: Quantity,
    /// Degrees of freedom to read, as tip.x,joint1 [default: where the load acts].
    #[arg(long, help_heading = heading::LOADS, value_name = "DOF", value_delimiter = ',')]
    at: Vec<String>,
    /// First frequency, Hz.
    #[arg(long, help_heading = heading::RANGE, value_name = "F", default_value_t = 1.0)]
    from_hz: f64,
    /// Last frequency, Hz.
    #[arg(long, help_heading = heading::RANGE, value_name = "F", default_value_t = 80.0)]
    to_hz: f64,
    /// Number of frequencies, evenly spaced [default: 801, and more about each natural frequency].
    ///
    /// It must be from 2 to 1000000.
    #[arg(long, help_heading = heading::RANGE, value_name = "N", value_parser = flags::points())]
    points: Option<u32>,
    #[command(flatten)]
    output: PlotFlags,
}

/// The highest frequency: beyond any vibration of a structure, and with a finite square.
const HIGHEST_HZ: f64 = 1e9;

/// The number of evenly spaced frequencies without --points.
const EVEN_POINTS: u32 = 801;

#[derive(Serialize)]
struct Document {
    configuration: Value,
    coordinates: Value,
    /// The degree of freedom on which the load acts.
    drive: String,
    quantity: Quantity,
    frequency_hz: Vec<f64>,
    responses: Vec<ResponseCurve>,
}

/// One response over all frequencies, complex as [real, imaginary].
#[derive(Serialize)]
struct ResponseCurve {
    at: String,
    unit: String,
    value: Vec<[f64; 2]>,
    #[serde(skip)]
    read: ReadAt,
}

impl Frf {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        self.output.check(output::PLOTTED, &Inputs::of_scenario(self.structure.scenario.as_deref()))?;
        let scenario = self.structure.scenario()?;
        let tested = scenario.under_test()?;
        let assembly = &tested.assembly;
        let linear = LinearResponse::new(&tested.assembly);
        let drive = self.drive(assembly)?;
        let frequency_hz = self.frequencies(assembly)?;
        let document = Document {
            configuration: configuration::of_structure(&scenario, &tested),
            coordinates: configuration::coordinates(assembly),
            responses: self.responses(assembly, &linear, &drive, &frequency_hz)?,
            frequency_hz,
            drive: drive.name.clone(),
            quantity: self.quantity,
        };
        // Zeros have no place on a logarithmic axis: the figure would be empty. The table can state them.
        let is_still = document.responses.iter().all(|curve| curve.value.iter().all(|z| *z == [0.0; 2]));
        if is_still && self.output.plot.is_some() {
            let at: Vec<_> = document.responses.iter().map(|curve| curve.at.as_str()).collect();
            let drive = &drive.name;
            let at = at.join(", ");
            return Err(Failure::usage(format!(
                "there is nothing to plot: a load at {drive} causes no response at {at}; choose another place by --at"
            )));
        }
        let conditions = captions::structure(&scenario, &tested, &[]);
        let drawn = || (self.figure(conditions, &document, (assembly, &linear, &drive)), table(&document));
        let text = || if self.output.plot.is_none() { table(&document) } else { String::new() };
        self.output.show(&document, drawn, text)
    }

    /// Finds the degree of freedom on which the load acts: the one named, or joint 1.
    fn drive(&self, assembly: &Assembly) -> Result<ReadAt, Failure> {
        let name = match &self.drive {
            Some(name) => name,
            None if assembly.dof("joint1").is_ok() => "joint1",
            None => return Err(drive::missing("--drive DOF", assembly)),
        };
        Ok(ReadAt { dof: dof("--drive", name, assembly)?, name: name.to_owned() })
    }

    /// Returns the frequencies of the flags, Hz; without a number of points they are denser at the natural frequencies.
    fn frequencies(&self, assembly: &Assembly) -> Result<Vec<f64>, Failure> {
        let from = self.from_hz;
        let to = self.to_hz;
        if !(from >= 0.0 && to > from && to <= HIGHEST_HZ) {
            return Err(Failure::usage(format!(
                "--from-hz {} --to-hz {}: the frequencies must rise, and be from 0 to {HIGHEST_HZ:e}",
                short(&from),
                short(&to)
            )));
        }
        let modes: Vec<_> = assembly.modes().iter().map(|mode| (mode.frequency_hz, mode.damping_ratio)).collect();
        Ok(match self.points {
            Some(points) => frequencies_hz(from, to, points, &[]),
            None => frequencies_hz(from, to, EVEN_POINTS, &modes),
        })
    }

    /// Computes the responses at the degrees of freedom of `--at`, or where the load acts, even at a base.
    fn responses(
        &self,
        assembly: &Assembly,
        linear: &LinearResponse,
        drive: &ReadAt,
        frequency_hz: &[f64],
    ) -> Result<Vec<ResponseCurve>, Failure> {
        let time = match self.quantity {
            Quantity::Receptance => "",
            Quantity::Mobility => "/s",
            Quantity::Accelerance => "/s²",
        };
        let curve = |read: ReadAt| {
            let value = |hz: &f64| linear.at(self.quantity, drive.dof, read.dof, *hz).map(|z| [z.re, z.im]);
            let value = frequency_hz.iter().map(value).collect::<Result<_, _>>();
            let value = value.map_err(|error| Failure::usage(error.to_string()))?;
            let unit = format!("{}{time} per {}", displacement_unit(read.dof), drive.dof.load_unit());
            Ok(ResponseCurve { at: read.name.clone(), unit, value, read })
        };
        read_at(&self.at, core::slice::from_ref(drive), assembly)?.into_iter().map(curve).collect()
    }

    /// Draws the moduli, a panel for each unit, above the phases of all.
    fn figure(
        &self,
        conditions: Subtitle,
        document: &Document,
        (assembly, linear, drive): (&Assembly, &LinearResponse, &ReadAt),
    ) -> Figure {
        let natural_hz: Vec<f64> = assembly.modes().iter().map(|mode| mode.frequency_hz).collect();
        let x = || Axis::linear("frequency (Hz)");
        let mut moduli: Vec<(&str, Panel)> = Vec::new();
        let mut phase = Panel::new(x(), Axis::degrees("phase (°)"));
        for (k, curve) in document.responses.iter().enumerate() {
            // Zeros are left out: they have no logarithm.
            let size = |[re, im]: &[f64; 2]| Some(libm::hypot(*re, *im)).filter(|size| *size > 0.0).unwrap_or(f64::NAN);
            let sizes = document.frequency_hz.iter().zip(&curve.value).map(|(hz, value)| (*hz, size(value))).collect();
            // The phase is evaluated between the given frequencies, too, where a lightly damped resonance turns it by
            // 180°.
            let at = |hz: f64| linear.at(self.quantity, drive.dof, curve.read.dof, hz).ok();
            let line = |points| Series::line(curve.at.as_str(), Color::Black, points).style(style(k));
            match moduli.iter_mut().find(|(unit, _)| *unit == curve.unit) {
                Some((_, modulus)) => modulus.series.push(line(sizes)),
                None => {
                    let modulus = Panel::new(x(), Axis::log(format!("{} ({})", document.quantity, curve.unit)));
                    moduli.push((&curve.unit, modulus.with(line(sizes))));
                }
            }
            phase.series.push(line(continuous_phase(&document.frequency_hz, &natural_hz, &at)));
        }
        let figure = Figure::new(format!("Frequency response to a load at {}", document.drive)).subtitle(conditions);
        moduli.into_iter().fold(figure, |figure, (_, modulus)| figure.with(modulus)).with(phase)
    }
}

fn table(document: &Document) -> String {
    let curve = |curve: &ResponseCurve| (curve.read.column(), curve.unit.clone(), curve.value.clone());
    csv(&document.frequency_hz, &document.responses.iter().map(curve).collect::<Vec<_>>())
}
