//! `resonarm identify --angles`: the joints' angles over time from the accelerometers in a recording.

use core::fmt::Write;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use serde::Serialize;
use serde_json::Value;

use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::output;
use resonarm::analysis;
use resonarm::identify::{AngleHistory, AngleSettings, CHANNELS, IdentifyError, Integration, joint_angles};
use resonarm::recording::Recording;
use resonarm::rig::InstrumentName;
use resonarm::scenario::Scenario;
use resonarm_numeric::number::{rounded, short};

/// The default lower corner over the lowest natural frequency: at half of the natural frequency the gain is 0.9998.
const CORNER_PART: f64 = 0.25;
/// A residual that exceeds both, over the noise and over the displacements, contradicts rigid links: mean angles alone
/// leave less.
const CONTRADICTION: [f64; 2] = [3.0, 0.02];

/// Domains by their names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Domain {
    /// The transform of the whole record over −ω².
    Frequency,
    /// Butterworth's high-pass forward and backward, and Numerov's formula.
    Time,
}

impl Domain {
    const fn integration(self) -> Integration {
        match self {
            Domain::Frequency => Integration::Frequency,
            Domain::Time => Integration::Time,
        }
    }

    const fn name(self) -> &'static str {
        match self {
            Domain::Frequency => "frequency",
            Domain::Time => "time",
        }
    }
}

/// The request.
pub(crate) struct Request<'a> {
    /// The CSV file.
    pub csv: &'a Path,
    pub domain: Domain,
    pub from_hz: Option<f64>,
    pub json: bool,
}

#[derive(Serialize)]
struct Document {
    /// The arm that was recorded, and its pose.
    configuration: Value,
    recording: PathBuf,
    /// The table of the angles.
    angles: PathBuf,
    integration: &'static str,
    /// The lower corner.
    from_hz: f64,
    samples: usize,
    /// Times of the first and the last row.
    from_s: f64,
    to_s: f64,
    /// Largest magnitudes of α1 and α2.
    largest_rad: [f64; 2],
    /// Largest standard deviations of α1 and α2.
    deviation_rad: [f64; 2],
    /// The residual of the displacements after the fit of rigid links, over the instruments' noise; null for ideal
    /// instruments.
    residual_over_noise: Option<f64>,
    /// The same over the displacements.
    residual_over_displacement: f64,
}

/// The accelerations in a recording.
struct Readings {
    accelerations_m_s2: Vec<[f64; CHANNELS]>,
    /// Index of the first sample in it.
    first_sample: u64,
}

/// Finds the angles, writes them to the file and prints a summary.
pub(crate) fn execute(recording: &Recording, scenario: &Scenario, request: &Request) -> Result<Verdict, Failure> {
    let rate_hz = 1.0 / recording.origin().dt_s;
    let arm = scenario.build_arm()?;
    let [mode, _] = analysis::modes(&arm);
    let readings = read(recording)?;
    let settings = AngleSettings {
        integration: request.domain.integration(),
        from_hz: request.from_hz.unwrap_or(CORNER_PART * mode.frequency_hz),
        starts_at_rest: starts_at_rest(scenario, readings.first_sample),
    };
    let mut found = joint_angles(&arm, rate_hz, &scenario.rig, &readings.accelerations_m_s2, settings)?;
    warn(scenario, &found);
    let delay = recording.origin().reading_delay_samples;
    // The first readings are of the time before the run.
    let before_run = (libm::ceil(delay) as usize).saturating_sub(readings.first_sample as usize + found.first);
    found.leave_out(before_run);
    let time_s = |row: usize| (readings.first_sample as f64 + (found.first + row) as f64 - delay) / rate_hz;
    let file = output::write(request.csv.to_path_buf(), &csv(&found, time_s))?;
    let document = Document {
        configuration: configuration::of_arm(scenario)?,
        recording: recording.path().to_path_buf(),
        angles: file.clone(),
        integration: request.domain.name(),
        from_hz: settings.from_hz,
        samples: found.alpha_rad.len(),
        from_s: time_s(0),
        to_s: time_s(found.alpha_rad.len().saturating_sub(1)),
        largest_rad: largest(&found.alpha_rad),
        deviation_rad: largest(&found.deviation_rad),
        residual_over_noise: found.residual.over_noise,
        residual_over_displacement: found.residual.over_displacement,
    };
    if request.json {
        output::print_json(&document)?;
    } else {
        output::print(&document.text())?;
        output::print_written(&[file])?;
    }
    Ok(Verdict::Positive)
}

/// The readings from sample 1 on: those of sample 0 only show the initial state.
fn read(recording: &Recording) -> Result<Readings, Failure> {
    let mut readings = Readings { accelerations_m_s2: Vec::new(), first_sample: 0 };
    let mut clipped = 0;
    for sample in recording.samples()? {
        let sample = sample?;
        if sample.sample == 0 {
            continue;
        }
        if readings.accelerations_m_s2.is_empty() {
            readings.first_sample = sample.sample;
        }
        // The head's force is not used.
        let marks = (sample.clipped.acceleration_b, sample.clipped.acceleration_c);
        clipped += usize::from(marks != Default::default());
        let ([bx, by], [cx, cy]) = (sample.acceleration_b_m_s2, sample.acceleration_c_m_s2);
        readings.accelerations_m_s2.push([bx, by, cx, cy]);
    }
    if clipped > 0 {
        return Err(IdentifyError::Clipped { samples: clipped }.into());
    }
    Ok(readings)
}

/// Whether nothing moved before the first reading, and the accelerometers read zero then.
fn starts_at_rest(scenario: &Scenario, first_sample: u64) -> bool {
    let reads_gravity = [&scenario.rig.accelerometer_b, &scenario.rig.accelerometer_c]
        .iter()
        .any(|sensor| sensor.gravity_m_s2.is_some_and(|gravity| gravity != 0.0));
    first_sample == 1 && scenario.arm.initial == [0.0; 4] && !reads_gravity
}

/// Warns of anything that makes the angles doubtful.
fn warn(scenario: &Scenario, found: &AngleHistory) {
    if scenario.rig.faults.iter().any(|fault| fault.instrument != InstrumentName::ImpedanceHead) {
        tracing::warn!("an accelerometer had a fault in this run: the angles are those of its readings");
    }
    let (over_noise, over_displacement) =
        (found.residual.over_noise.unwrap_or(f64::INFINITY), found.residual.over_displacement);
    if over_noise > CONTRADICTION[0] && over_displacement > CONTRADICTION[1] {
        tracing::warn!(
            "the points move along the links by {over_displacement:.3} of what they move across, which no angles explain: \
             an accelerometer has a fault, another sensitivity than stated or a filter"
        );
    }
}

fn largest(values: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|joint| values.iter().fold(0.0, |largest: f64, values| largest.max(values[joint].abs())))
}

fn csv(found: &AngleHistory, time_s: impl Fn(usize) -> f64) -> String {
    let mut text = String::from("time_s,alpha1_rad,alpha2_rad,alpha1_deviation_rad,alpha2_deviation_rad\n");
    for (row, ([alpha1, alpha2], [sigma1, sigma2])) in found.alpha_rad.iter().zip(&found.deviation_rad).enumerate() {
        let _infallible = writeln!(text, "{},{alpha1:e},{alpha2:e},{sigma1:e},{sigma2:e}", short(&time_s(row)));
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
            let _infallible = writeln!(text, "  {:5}   {largest:13.3e}   {deviation:15.1e}", joint + 1);
        }
        let over_noise =
            self.residual_over_noise.map_or(String::new(), |residual| format!("; over the noise {residual:.2}"));
        let _infallible =
            writeln!(text, "\n  residual over displacement {:.1e}{over_noise}", self.residual_over_displacement);
        text
    }
}
