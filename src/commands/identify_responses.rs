//! `resonarm identify` of a file with measured frequency responses.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;

use super::identify::{Identify, first_and_step_hz, pair, write_uff};
use super::identify_figures::{Curve, poles_figure, responses_figure};
use super::identify_found::{Found, smooth_hz};
use super::identify_mac::Shapes;
use crate::failure::{Failure, Verdict};
use crate::figures::response_curves;
use crate::output;
use resonarm::identify::{Band, FunctionOf, Quantity, modes_of_responses};
use resonarm::modal_file::{FileResponse, ModalFile};
use resonarm::responses::{MeasuredQuantity, MeasuredResponse, read_responses};
use resonarm_figures::plot::beside;
use resonarm_numeric::number::short;

#[derive(Serialize)]
struct Document {
    /// File of the responses.
    responses: String,
    /// Functions in it that are no frequency responses.
    others: usize,
    /// Positions of the file's nodes, m.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    positions_m: BTreeMap<String, [f64; 3]>,
    /// Lines through these positions, from name to name.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    lines: Vec<Vec<String>>,
    #[serde(flatten)]
    found: Found,
    frequency_hz: Vec<f64>,
    functions: Vec<Function>,
}

/// A response over all frequencies, complex as [real, imaginary].
#[derive(Serialize)]
struct Function {
    force: String,
    response: String,
    unit: &'static str,
    measured: Vec<[f64; 2]>,
    fitted: Option<Vec<[f64; 2]>>,
    #[serde(skip)]
    smooth: Vec<(f64, [f64; 2])>,
}

/// Identifies the modes in a file, compares them with the shapes, if there are any, writes the figures and prints the tables.
pub(super) fn execute(flags: &Identify, file: &Path, shapes: Option<Shapes>) -> Result<Verdict, Failure> {
    let read = read_responses(file)?;
    let (quantity, unit) = match read.quantity {
        MeasuredQuantity::Acceleration => (Quantity::Acceleration, "m/s² per N"),
        MeasuredQuantity::Velocity => (Quantity::Velocity, "m/s per N"),
        MeasuredQuantity::Displacement => (Quantity::Displacement, "m per N"),
    };
    // The usual band begins above 0 Hz, where a response says nothing of a mode.
    let positive = read.frequency_hz.iter().copied().find(|hz| *hz > 0.0);
    let band = Band {
        from_hz: flags.from_hz.or(positive).unwrap_or(0.0),
        to_hz: flags.to_hz.or(read.frequency_hz.last().copied()).unwrap_or(0.0),
    };
    let functions: Vec<FunctionOf<'_>> = read
        .responses
        .iter()
        .map(|of| FunctionOf { force: &of.force, response: &of.response, values: &of.values })
        .collect();
    let found = modes_of_responses(&read.frequency_hz, &functions, quantity, band)?;
    let in_band: Vec<f64> =
        read.frequency_hz.iter().copied().filter(|hz| (band.from_hz..=band.to_hz).contains(hz)).collect();
    let smooth = smooth_hz(&in_band, &found);
    let function = |(index, of): (usize, &MeasuredResponse)| {
        let fitted = |hz: &f64| Some(pair(&found.fitted(0, index, *hz)?));
        Function {
            force: of.force.clone(),
            response: of.response.clone(),
            unit,
            measured: of.values.iter().map(pair).collect(),
            // At 0 Hz the terms for modes below the band are not finite.
            fitted: read.frequency_hz.iter().map(|hz| fitted(&hz.max(f64::MIN_POSITIVE))).collect(),
            smooth: smooth.iter().filter_map(|hz| Some((*hz, fitted(hz)?))).collect(),
        }
    };
    let functions = read.responses.iter().enumerate().map(function).collect();
    // Such a file names no structure whose modes have numbers.
    let numbers = vec![None; found.modes.len()];
    let mut found = Found::new(found, numbers, band);
    if let Some(shapes) = &shapes {
        found.compare(shapes)?;
    }
    let document = Document {
        responses: file.display().to_string(),
        others: read.others,
        positions_m: read.positions_m,
        lines: read.lines,
        functions,
        found,
        frequency_hz: read.frequency_hz,
    };
    document.found.warn_of_none();
    let drawn = || (responses_figure(&document.found, &document.curves()), document.csv());
    let mut files = output::plot(flags.plot.as_deref(), &document, drawn)?;
    if let Some(stem) = &flags.plot {
        files.extend(output::draw(poles_figure(&document.found, &document.curves()), &beside(stem, "-poles"))?);
        files.extend(document.found.draw_mac(stem)?);
    }
    if let Some(path) = &flags.uff {
        let measured = |of: MeasuredResponse| FileResponse {
            response: of.response,
            force: of.force,
            quantity: read.quantity,
            first_and_step_hz: first_and_step_hz(&document.frequency_hz),
            values: of.values,
        };
        let file = ModalFile {
            title: document.responses.clone(),
            positions_m: document.positions_m.clone(),
            lines: document.lines.clone(),
            at: document.found.at.clone(),
            modes: document.found.file_modes(),
            responses: read.responses.into_iter().map(measured).collect(),
        };
        files.push(write_uff(path, &file)?);
    }
    flags.json.show(&document, || document.text(), &files)?;
    Ok(Verdict::of(!document.found.modes.is_empty()))
}

impl Document {
    fn curves(&self) -> Vec<Curve<'_>> {
        let curves = self.functions.iter().map(|of| Curve {
            title: format!("{} over {}", of.response, of.force),
            label: format!("response ({})", of.unit),
            frequency_hz: &self.frequency_hz,
            measured: &of.measured,
            coherence: None,
            step: 1,
            fitted: &of.smooth,
        });
        curves.collect()
    }

    fn text(&self) -> String {
        let count = |number: usize, what: &str| format!("{number} {what}{}", if number == 1 { "" } else { "s" });
        let others = if self.others == 0 {
            String::new()
        } else {
            format!("; {} left out", count(self.others, "other function"))
        };
        format!(
            "{}: {}, {} to {} Hz{others}\n{}",
            self.responses,
            count(self.functions.len(), "frequency response"),
            short(&self.found.from_hz),
            short(&self.found.to_hz),
            self.found.text(false)
        )
    }

    fn csv(&self) -> String {
        let named = |of: &Function| {
            let name = format!("{}_over_{}", of.response, of.force).replace('.', "_");
            (name, String::from(of.unit).replace(" per ", "_per_"), of.measured.clone())
        };
        response_curves::csv(&self.frequency_hz, &self.functions.iter().map(named).collect::<Vec<_>>())
    }
}
