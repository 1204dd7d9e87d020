//! The modes that `resonarm identify` found, as a document and as a table.

use std::path::{Path, PathBuf};

use nalgebra::Complex;
use serde::Serialize;
use serde_json::{Value, json};

use super::identify::pair;
use super::identify_mac::{Assurance, Shapes};
use crate::failure::Failure;
use crate::output;
use resonarm::identify::{Band, Identification, IdentifiedMode, IdentifyError, ReadingNoise, ResidualTerm};
use resonarm::modal_file::FileMode;
use resonarm_figures::plot::beside;

/// Points of a fitted curve on each side of a mode, and those of its half-power half-width.
const STEPS: i32 = 60;
const STEPS_A_HALF: f64 = 6.0;

/// Modes and the quality of their fit.
#[derive(Serialize)]
pub(super) struct Found {
    /// The degrees of freedom of the shapes' components.
    pub at: Vec<String>,
    pub from_hz: f64,
    pub to_hz: f64,
    pub modes: Vec<NumberedMode>,
    /// Noise as the residuals show it, and that of the instruments.
    pub noise: Vec<ReadingNoise>,
    /// Terms for modes outside the band.
    residual_terms: Vec<ResidualTerm>,
    pub stabilisation: Stabilisation,
    /// Modal assurance criterion with the modes of --mac.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mac: Option<Assurance>,
}

/// A mode with its number in the scenario's structure; none if it is far from its modes.
#[derive(Serialize)]
pub(super) struct NumberedMode {
    pub mode: Option<u8>,
    #[serde(flatten)]
    pub found: IdentifiedMode,
}

impl NumberedMode {
    /// Returns the number of the mode, or its frequency if it has none.
    pub fn name(&self) -> String {
        self.mode.map_or(format!("{:.2} Hz", self.found.pole_frequency_hz), |number| number.to_string())
    }
}

/// Returns the reading that has a noise, with its degree of freedom and unit, and its run if there are several.
pub(super) fn noise_name(noise: &ReadingNoise, has_several_runs: bool) -> String {
    let ReadingNoise { run, reading, at, .. } = noise;
    let unit = if reading == "head" { "N" } else { "m/s²" };
    let run = if has_several_runs { format!("{}: ", run + 1) } else { String::new() };
    format!("{run}{reading}, {at} ({unit})")
}

/// Poles by the order of a polynomial model of the averaged responses: those that come again are the start of the fit.
#[derive(Default, Serialize)]
pub(super) struct Stabilisation {
    pub orders: Vec<OrderPoles>,
    /// Clusters of poles over the orders, each with the share of the orders that have a pole in it.
    clusters: Vec<Value>,
}

#[derive(Serialize)]
pub(super) struct OrderPoles {
    pub order: usize,
    /// Poles in the band, rad/s, as [real, imaginary].
    pub poles_rad_s: Vec<[f64; 2]>,
    /// Whether each of them belongs to a cluster.
    pub stable: Vec<bool>,
}

fn stabilisation(found: &Identification) -> Stabilisation {
    let Some(estimate) = &found.estimate else { return Stabilisation::default() };
    let clusters = &estimate.stabilisation.clusters;
    let orders = estimate.stabilisation.orders.iter().map(|order| OrderPoles {
        order: order.order,
        poles_rad_s: order.poles.iter().map(pair).collect(),
        stable: order.poles.iter().map(|pole| clusters.iter().any(|cluster| cluster.contains(*pole))).collect(),
    });
    let documents = clusters.iter().map(|of| json!({ "pole_rad_s": pair(&of.pole), "share": of.share }));
    Stabilisation { orders: orders.collect(), clusters: documents.collect() }
}

/// A value with its deviation, or a dash in its place.
fn with_deviation(value: String, deviation: Option<f64>) -> String {
    deviation.map_or(format!("{value} ± –    "), |deviation| format!("{value} ± {deviation:.0e}"))
}

/// Returns the frequencies of the lines, and more about each mode: its curve is smooth however far apart the lines are.
pub(super) fn smooth_hz(lines_hz: &[f64], found: &Identification) -> Vec<f64> {
    let [Some(first), Some(last)] = [lines_hz.first(), lines_hz.last()] else { return Vec::new() };
    let mut all = lines_hz.to_vec();
    for mode in &found.modes {
        // ζf is half of the width at half power.
        let half_hz = mode.pole_damping_ratio * mode.pole_frequency_hz;
        let about = (-STEPS..=STEPS).map(|step| mode.pole_frequency_hz + half_hz * f64::from(step) / STEPS_A_HALF);
        all.extend(about.filter(|hz| (*first..=*last).contains(hz)));
    }
    all.sort_by(f64::total_cmp);
    all
}

/// Formats a number with its sign, which is + where it rounds to 0.
pub(super) fn signed(value: f64, places: usize) -> String {
    let text = format!("{value:+.places$}");
    let is_zero = !text.contains(|digit: char| matches!(digit, '1'..='9'));
    if value.is_finite() && is_zero { text.replace('-', "+") } else { text }
}

impl Found {
    pub fn new(found: Identification, numbers: Vec<Option<u8>>, band: Band) -> Found {
        Found {
            stabilisation: stabilisation(&found),
            at: found.at,
            from_hz: band.from_hz,
            to_hz: band.to_hz,
            modes: numbers.into_iter().zip(found.modes).map(|(mode, found)| NumberedMode { mode, found }).collect(),
            noise: found.noise,
            residual_terms: found.residual_terms,
            mac: None,
        }
    }

    /// Compares the shapes with others; without modes there is nothing to compare.
    pub fn compare(&mut self, other: &Shapes) -> Result<(), Failure> {
        if self.modes.is_empty() {
            return Ok(());
        }
        let modes = self
            .modes
            .iter()
            .map(|NumberedMode { mode, found }| (*mode, found.pole_frequency_hz, found.complex_shape.as_slice()));
        let own = Shapes::new(String::from("these modes"), &self.at, modes);
        self.mac = Some(Assurance::new(&own, other)?);
        Ok(())
    }

    /// Draws the figure of --mac beside the others, if there is one. Returns the paths.
    pub fn draw_mac(&self, stem: &Path) -> Result<Vec<PathBuf>, Failure> {
        self.mac.as_ref().map_or(Ok(Vec::new()), |mac| output::draw(mac.figure(), &beside(stem, "-mac")))
    }

    /// Returns the modes for a file in the Universal File Format.
    pub fn file_modes(&self) -> Vec<FileMode> {
        let complex = |[re, im]: [f64; 2]| Complex::new(re, im);
        let of = |NumberedMode { found, .. }: &NumberedMode| FileMode {
            pole_rad_s: complex(found.pole_rad_s),
            shape: found
                .complex_shape_per_sqrt_kg
                .as_ref()
                .unwrap_or(&found.complex_shape)
                .iter()
                .map(|component| component.map(complex))
                .collect(),
            modal_mass_kg: found.modal_mass_kg,
        };
        self.modes.iter().map(of).collect()
    }

    /// Warns if there is no mode.
    pub fn warn_of_none(&self) {
        if self.modes.is_empty() {
            tracing::warn!("{}", IdentifyError::NoResonance(Band { from_hz: self.from_hz, to_hz: self.to_hz }));
        }
    }

    /// Returns the tables of modes and noise.
    pub fn text(&self, has_several_runs: bool) -> String {
        let mut text = String::new();
        let is_scaled = self.modes.iter().any(|mode| mode.found.shape_per_sqrt_kg.is_some());
        let (mass, shape) = if is_scaled {
            ("   modal mass (kg)   ", "shape (1/√kg)")
        } else {
            ("", "shape over its largest component")
        };
        let at = self.at.join(", ");
        text += &format!("\n  mode   pole frequency |λ|/2π (Hz)   damping ratio      {mass}   {shape}: {at}\n");
        for NumberedMode { mode: number, found: mode } in &self.modes {
            let number = number.map_or(String::from("–"), |number| number.to_string());
            let frequency =
                with_deviation(format!("{:17.6}", mode.pole_frequency_hz), mode.pole_frequency_deviation_hz);
            let damping = with_deviation(format!("{:.4e}", mode.pole_damping_ratio), mode.pole_damping_ratio_deviation);
            let mass = match mode.modal_mass_kg {
                Some(kg) => with_deviation(format!("   {kg:10.5}"), mode.modal_mass_deviation_kg),
                None if is_scaled => format!("   {:>18}", "–"),
                None => String::new(),
            };
            let part = |part: &Option<f64>| part.map_or(String::from("–"), |part| signed(part, 4));
            let shape = mode.shape_per_sqrt_kg.as_ref().unwrap_or(&mode.shape);
            let shape: Vec<String> = shape.iter().map(part).collect();
            text += &format!("  {number:>4}   {frequency}   {damping}{mass}   {}\n", shape.join(" "));
        }
        text += &self.remarks();
        text += &self.noise_table(has_several_runs);
        text + &self.mac.as_ref().map_or(String::new(), Assurance::text)
    }

    /// Returns the reasons for missing deviations, and warnings, each once with the modes that it holds for.
    fn remarks(&self) -> String {
        let mut text = String::new();
        for (what, of) in [("no deviation", true), ("warning", false)] {
            let mut seen: Vec<(&str, Vec<String>)> = Vec::new();
            for mode in &self.modes {
                for remark in if of { &mode.found.doubts } else { &mode.found.warnings } {
                    match seen.iter_mut().find(|(known, _)| *known == remark.text) {
                        Some((_, modes)) => modes.push(mode.name()),
                        None => seen.push((&remark.text, vec![mode.name()])),
                    }
                }
            }
            for (remark, modes) in seen {
                let plural = if modes.len() == 1 { "" } else { "s" };
                text += &format!("  {what}, mode{plural} {}: {remark}\n", modes.join(", "));
            }
        }
        if text.is_empty() { text } else { format!("\n{text}") }
    }

    fn noise_table(&self, has_several_runs: bool) -> String {
        if self.noise.is_empty() {
            return String::new();
        }
        let mut text = String::from("\n  noise of a sample         estimated   instrument\n");
        for noise in &self.noise {
            let name = noise_name(noise, has_several_runs);
            let estimated = noise.estimated;
            let instrument = noise.instrument.map_or(String::from("–"), |known| format!("{known:.3e}"));
            text += &format!("  {name:<24}   {estimated:9.3e}   {instrument:>10}\n");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_that_rounds_to_zero_has_no_minus() {
        let texts = [-4e-5, -0.0, 4e-5, -6e-5, 6e-5, -12.0, f64::NAN, f64::NEG_INFINITY].map(|value| signed(value, 4));
        let expected = ["+0.0000", "+0.0000", "+0.0000", "-0.0001", "+0.0001", "-12.0000", "NaN", "-inf"];
        assert_eq!(texts, expected);
    }
}
