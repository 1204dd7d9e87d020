//! `resonarm identify --angles`: the joints' angles over time from the accelerometers in a recording.

use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::Value;

use super::identify::Identify;
use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::output;
use resonarm::identification::{RecordedAngles, has_faulty_accelerometer};
use resonarm::identify::{AngleHistory, Integration};
use resonarm::recording::Recording;
use resonarm::scenario::Scenario;
use resonarm_numeric::number::{rounded, short};

#[derive(Serialize)]
struct Document {
    /// The structure that was recorded.
    configuration: Value,
    recording: PathBuf,
    /// The file with the table of the angles.
    angles: PathBuf,
    integration: &'static str,
    /// Lower corner frequency of the integration, Hz.
    from_hz: f64,
    samples: usize,
    /// Time of the first row of the table, s.
    from_s: f64,
    to_s: f64,
    largest_rad: [f64; 2],
    /// Largest standard deviations of α1 and α2, rad.
    deviation_rad: [f64; 2],
    /// The residual of the displacements after the fit of rigid links, over the instruments' noise; null for ideal
    /// instruments.
    residual_over_noise: Option<f64>,
    /// The residual of the displacements over the displacements.
    residual_over_displacement: f64,
}

/// Finds the angles, writes them to the file and prints a summary.
pub(super) fn execute(
    flags: &Identify,
    file: &Path,
    recording: &Recording,
    scenario: &Scenario,
) -> Result<Verdict, Failure> {
    let found = RecordedAngles::new(recording, scenario, flags.integration(), flags.from_hz)?;
    warn(scenario, &found);
    let history = &found.history;
    let file = output::write(file.to_path_buf(), &csv(&found))?;
    let document = Document {
        configuration: configuration::of_scenario(scenario)?,
        recording: recording.path().to_path_buf(),
        angles: file.clone(),
        integration: match flags.integration() {
            Integration::Frequency => "frequency",
            Integration::Time => "time",
        },
        from_hz: found.from_hz,
        samples: history.alpha_rad.len(),
        from_s: found.time_s(0),
        to_s: found.time_s(history.alpha_rad.len().saturating_sub(1)),
        largest_rad: largest(&history.alpha_rad),
        deviation_rad: largest(&history.deviation_rad),
        residual_over_noise: history.residual.over_noise,
        residual_over_displacement: history.residual.over_displacement,
    };
    flags.json.show(&document, || document.text(), &[file])
}

/// Warns of anything that makes the angles doubtful.
fn warn(scenario: &Scenario, found: &RecordedAngles) {
    if has_faulty_accelerometer(scenario) {
        tracing::warn!("an accelerometer had a fault in this run, so the angles from its readings may be wrong");
    }
    if let Some(over_displacement) = found.contradiction() {
        tracing::warn!(
            "the points move along the links {over_displacement:.3} times as far as across them, which no angles explain: \
             an accelerometer may have a fault, a filter, or another sensitivity than stated"
        );
    }
}

fn largest(values: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|joint| values.iter().fold(0.0, |largest: f64, values| largest.max(values[joint].abs())))
}

fn csv(found: &RecordedAngles) -> String {
    let mut text = String::from("time_s,alpha1_rad,alpha2_rad,alpha1_deviation_rad,alpha2_deviation_rad\n");
    let AngleHistory { alpha_rad, deviation_rad, .. } = &found.history;
    for (row, ([alpha1, alpha2], [sigma1, sigma2])) in alpha_rad.iter().zip(deviation_rad).enumerate() {
        text += &format!("{},{alpha1:e},{alpha2:e},{sigma1:e},{sigma2:e}\n", short(&found.time_s(row)));
    }
    text
}

impl Document {
    fn text(&self) -> String {
        let mut text = format!(
            "{}: angles from {} to {} s, integrated in the {} domain from {} Hz on\n\n",
            self.recording.display(),
            rounded(&self.from_s, 4),
            rounded(&self.to_s, 4),
            self.integration,
            rounded(&self.from_hz, 3)
        );
        text += "  joint   largest (rad)   deviation (rad)\n";
        for (joint, (largest, deviation)) in self.largest_rad.iter().zip(&self.deviation_rad).enumerate() {
            text += &format!("  {:5}   {largest:13.3e}   {deviation:15.1e}\n", joint + 1);
        }
        let over_noise =
            self.residual_over_noise.map_or(String::new(), |residual| format!("; over the noise {residual:.2}"));
        text += &format!("\n  residual over displacement {:.1e}{over_noise}\n", self.residual_over_displacement);
        text
    }
}
