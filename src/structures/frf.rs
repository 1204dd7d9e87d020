//! `resonarm frf` of a structure's linear part.

use std::path::Path;

use serde::Serialize;
use serde_json::Value;

use super::{displacement_unit, dof, label, load_unit};
use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::figures::response_curves::{broken_at_wraps, csv};
use crate::output::{self, JsonFlag};
use resonarm::analysis::Quantity;
use resonarm::analysis::structure::LinearResponse;
use resonarm::plant::TestedAssembly;
use resonarm::scenario::Scenario;
use resonarm::structure::{Assembly, Dof};
use resonarm_figures::plot::{Axis, Color, Figure, Panel, Series};

/// What is asked for.
pub(crate) struct Asked<'a> {
    /// What drives.
    pub drive: &'a str,
    /// Where the response is taken; empty is where it is driven.
    pub responses: Vec<&'a str>,
    /// Displacement, velocity or acceleration over the drive.
    pub quantity: Quantity,
    /// The frequencies, evenly spaced ones and more about each natural frequency, Hz.
    pub frequency_hz: Vec<f64>,
    /// Where the plot goes.
    pub plot: Option<&'a Path>,
    /// How the document is printed.
    pub json: JsonFlag,
}

#[derive(Serialize)]
struct Document<'a> {
    configuration: Value,
    coordinates: Value,
    drive: &'a str,
    quantity: Quantity,
    frequency_hz: Vec<f64>,
    responses: Vec<ResponseCurve<'a>>,
}

/// One response over all frequencies, complex as [real, imaginary].
#[derive(Serialize)]
struct ResponseCurve<'a> {
    response: &'a str,
    unit: String,
    value: Vec<[f64; 2]>,
}

/// Prints or plots the frequency responses.
pub(crate) fn show(scenario: &Scenario, tested: &TestedAssembly, asked: Asked<'_>) -> Result<Verdict, Failure> {
    let assembly = &tested.assembly;
    let drive = dof("--drive", asked.drive, assembly)?;
    let document = Document {
        configuration: configuration::of_arm(scenario)?,
        coordinates: configuration::coordinates(assembly),
        drive: asked.drive,
        quantity: asked.quantity,
        frequency_hz: asked.frequency_hz.clone(),
        responses: curves(&asked, assembly, drive)?,
    };
    let is_still = document.responses.iter().all(|curve| curve.value.iter().all(|z| *z == [0.0; 2]));
    if is_still && asked.plot.is_some() {
        let at: Vec<_> = document.responses.iter().map(|curve| curve.response).collect();
        let (drive, at) = (asked.drive, at.join(", "));
        return Err(Failure::usage(format!("there is nothing to plot: a load at {drive} moves nothing at {at}")));
    }
    let drawn = || (figure(&document, &label(scenario, tested)), table(&document));
    let files = output::plot(asked.plot, &document, drawn)?;
    let text = || if files.is_empty() { table(&document) } else { String::new() };
    asked.json.show(&document, text, &files)
}

/// The responses, of the drive itself if none is named.
fn curves<'a>(asked: &Asked<'a>, assembly: &Assembly, drive: Dof) -> Result<Vec<ResponseCurve<'a>>, Failure> {
    let linear = LinearResponse::new(assembly);
    let wanted = if asked.responses.is_empty() { vec![asked.drive] } else { asked.responses.clone() };
    let time = match asked.quantity {
        Quantity::Receptance => "",
        Quantity::Mobility => "/s",
        Quantity::Accelerance => "/s²",
    };
    let mut curves = Vec::with_capacity(wanted.len());
    for response in wanted {
        let at = dof("--response", response, assembly)?;
        let value = |hz: &f64| linear.at(asked.quantity, drive, at, *hz).map(|z| [z.re, z.im]);
        let value = asked.frequency_hz.iter().map(value).collect::<Result<_, _>>();
        let value = value.map_err(|error| Failure::usage(error.to_string()))?;
        let unit = format!("{}{time} per {}", displacement_unit(at), load_unit(drive));
        curves.push(ResponseCurve { response, unit, value });
    }
    Ok(curves)
}

fn table(document: &Document<'_>) -> String {
    let curve = |curve: &ResponseCurve<'_>| (curve.response.replace('.', "_"), curve.unit.clone(), curve.value.clone());
    csv(&document.frequency_hz, &document.responses.iter().map(curve).collect::<Vec<_>>())
}

/// Moduli, a panel for each unit, above phases.
fn figure(document: &Document<'_>, label: &str) -> Figure {
    const COLORS: [Color; 4] = [Color::Black, Color::Blue, Color::Vermillion, Color::Orange];
    let x = || Axis::linear("frequency (Hz)");
    let mut moduli: Vec<(&str, Panel)> = Vec::new();
    let mut phase = Panel::new(x(), Axis::degrees("phase (°)"));
    for (curve, color) in document.responses.iter().zip(COLORS.into_iter().cycle()) {
        let over = |value: &dyn Fn(&[f64; 2]) -> f64| {
            document.frequency_hz.iter().zip(&curve.value).map(|(hz, z)| (*hz, value(z))).collect::<Vec<_>>()
        };
        // Zeros are left out: they have no logarithm.
        let size = |[re, im]: &[f64; 2]| Some(libm::hypot(*re, *im)).filter(|size| *size > 0.0).unwrap_or(f64::NAN);
        let degrees = |[re, im]: &[f64; 2]| libm::atan2(*im, *re).to_degrees();
        let series = Series::line(curve.response, color, over(&size));
        match moduli.iter_mut().find(|(unit, _)| *unit == curve.unit) {
            Some((_, modulus)) => modulus.series.push(series),
            None => {
                let modulus = Panel::new(x(), Axis::log(format!("{} ({})", document.quantity, curve.unit)));
                moduli.push((&curve.unit, modulus.with(series)));
            }
        }
        let points = broken_at_wraps(over(&degrees));
        phase.series.push(Series::line(curve.response, color, points));
    }
    let figure = Figure::new(format!("Frequency response to a load at {}", document.drive)).subtitle(label);
    moduli.into_iter().fold(figure, |figure, (_, modulus)| figure.with(modulus)).with(phase)
}
