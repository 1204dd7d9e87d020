//! `resonarm modes`: the natural modes of the linearised arm, in one pose or over β2.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use serde_json::Value;

use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::figures::captions;
use crate::flags::{self, ArmFlags};
use crate::output::{self, JsonFlag, OverwriteFlag};
use crate::structures;
use resonarm::analysis::{Mode, arm_poles, modes};
use resonarm::arm::Arm;
use resonarm::scenario::{ArmSection, Scenario};
use resonarm_figures::plot::{Axis, Color, Figure, Panel, Series};
use resonarm_numeric::number::short;

/// Natural frequencies of the undamped arm, damping ratios and mode shapes in its pose, or over a range of β2; or of a
/// scenario's structure. Beside them are the poles λ of the damped one, which `resonarm identify` finds: their frequency
/// |λ|/2π and damping ratio −Re λ/|λ|.
///
/// With gravity, α = 0 is the arm at rest under its weight; β is the pose with relaxed springs, before it sags.
///
/// With --from-beta2-deg and --to-beta2-deg it prints CSV, a line for each β2; shapes are normalised to unit modal
/// mass. With --plot CSV and JSON go to files beside the figure, and standard output lists them.
#[derive(Debug, Args)]
pub(crate) struct Modes {
    #[command(flatten)]
    pub(crate) arm: ArmFlags,
    /// First β2 of a range, degrees.
    #[arg(long, value_name = "DEG", requires = "to_beta2_deg", conflicts_with = "beta2_deg")]
    from_beta2_deg: Option<f64>,
    /// Last β2 of a range, degrees.
    #[arg(long, value_name = "DEG", requires = "from_beta2_deg")]
    to_beta2_deg: Option<f64>,
    /// Number of poses in the range, evenly spaced, at most a million.
    #[arg(long, value_name = "N", default_value_t = 181, requires = "from_beta2_deg", value_parser = flags::points())]
    points: u32,
    /// Plot the natural frequencies over the range to STEM.svg and STEM.png; caption, CSV and JSON beside them.
    #[arg(long, value_name = "STEM", requires = "from_beta2_deg")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteFlag,
    #[command(flatten)]
    json: JsonFlag,
}

#[derive(Serialize)]
struct Document {
    configuration: Value,
    modes: [ModeAndPole; 2],
}

/// A mode of the undamped arm and the pole of the damped one, if that oscillates.
#[derive(Serialize)]
struct ModeAndPole {
    #[serde(flatten)]
    mode: Mode,
    pole_frequency_hz: Option<f64>,
    pole_damping_ratio: Option<f64>,
}

impl ModeAndPole {
    fn of(arm: &Arm) -> [ModeAndPole; 2] {
        let (modes, poles) = (modes(arm), arm_poles(arm));
        core::array::from_fn(|k| ModeAndPole {
            mode: modes[k],
            pole_frequency_hz: poles[k].map(|pole| pole.pole_frequency_hz),
            pole_damping_ratio: poles[k].map(|pole| pole.pole_damping_ratio),
        })
    }
}

#[derive(Serialize)]
struct RangeDocument {
    /// The arm and β1.
    configuration: Value,
    poses: Vec<InPose>,
}

#[derive(Serialize)]
struct InPose {
    beta2_deg: f64,
    modes: [Mode; 2],
}

impl Modes {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        self.overwrite.check_stem(self.plot.as_deref(), output::PLOTTED)?;
        let scenario = self.arm.scenario()?;
        match (self.from_beta2_deg, self.to_beta2_deg) {
            (Some(from_deg), Some(to_deg)) => self.over(&scenario, from_deg, to_deg),
            _ => self.in_pose(&scenario),
        }
    }

    fn in_pose(&self, scenario: &Scenario) -> Result<Verdict, Failure> {
        if let Some(tested) = scenario.tested_structure()? {
            return structures::modes::show(scenario, &tested, self.json);
        }
        let arm = scenario.build_arm()?;
        let modes = ModeAndPole::of(&arm);
        let document = Document { configuration: configuration::of_arm(scenario)?, modes };
        self.json.show(&document, || document.text(scenario, &arm), &[])
    }

    fn over(&self, scenario: &Scenario, from_deg: f64, to_deg: f64) -> Result<Verdict, Failure> {
        // False for NaN, too.
        let rises = -360.0 <= from_deg && from_deg < to_deg && to_deg <= 360.0;
        if !rises {
            return Err(Failure::usage(format!(
                "--from-beta2-deg {} --to-beta2-deg {}: the poses must rise from one angle to the other, within -360 to 360",
                short(&from_deg),
                short(&to_deg)
            )));
        }
        let last = f64::from(self.points - 1);
        let in_pose = |k: u32| {
            let beta2_deg = from_deg + (to_deg - from_deg) * (f64::from(k) / last);
            let posed = Scenario { arm: ArmSection { beta2_deg, ..scenario.arm.clone() }, ..scenario.clone() };
            Ok(InPose { beta2_deg, modes: modes(&posed.build_arm()?) })
        };
        let poses = (0..self.points).map(in_pose).collect::<Result<_, Failure>>()?;
        let mut configuration = configuration::of_arm(scenario)?;
        // β2 and the sag vary: each pose has its own.
        if let Some(arm) = configuration.as_object_mut() {
            ["beta2_deg", "static_deflection_rad"].into_iter().for_each(|varied| drop(arm.remove(varied)));
        }
        let document = RangeDocument { configuration, poses };
        let drawn = || (document.figure(&scenario.arm), document.csv());
        let files = output::plot(self.plot.as_deref(), &document, drawn)?;
        let text = || if files.is_empty() { document.csv() } else { String::new() };
        self.json.show(&document, text, &files)
    }
}

impl Document {
    fn text(&self, scenario: &Scenario, arm: &Arm) -> String {
        let mut text = format!(
            "{} at β1 = {}°, β2 = {}°\n{}\n  mode   undamped frequency   damping ratio   α2/α1     pole frequency |λ|/2π   −Re λ/|λ|\n",
            scenario.arm.label(),
            scenario.arm.beta1_deg,
            scenario.arm.beta2_deg,
            sag_text(arm)
        );
        for (k, mode) in self.modes.iter().enumerate() {
            let pole = pole_text(mode.pole_frequency_hz, mode.pole_damping_ratio);
            let ModeAndPole { mode: Mode { frequency_hz, damping_ratio, shape }, .. } = mode;
            let ratio = shape[1] / shape[0];
            text += &format!("  {:4}   {frequency_hz:15.2} Hz   {damping_ratio:13.3e}   {ratio:+.4}   {pole}\n", k + 1);
        }
        text
    }
}

/// The columns of a mode's pole in a table.
pub(crate) fn pole_text(frequency_hz: Option<f64>, damping_ratio: Option<f64>) -> String {
    match (frequency_hz, damping_ratio) {
        (Some(hz), Some(ratio)) => format!("{hz:18.4} Hz   {ratio:9.3e}"),
        _ => format!("{:>21}   {:>9}", "overdamped", "–"),
    }
}

/// A line with the joints' deflection under the weight; empty without gravity.
fn sag_text(arm: &Arm) -> String {
    if arm.parameters().gravity.is_none() {
        return String::new();
    }
    let sag_rad = arm.static_deflection_rad();
    format!(
        "under its weight it sags by {:+.5} rad in joint 1 and {:+.5} rad in joint 2: α counts from there, β is the pose \
         before\n",
        sag_rad.x, sag_rad.y
    )
}

impl RangeDocument {
    fn csv(&self) -> String {
        let mut text = String::from("beta2_deg");
        for k in 1..=2 {
            text += &format!(",frequency{k}_hz,damping_ratio{k},shape{k}_alpha1,shape{k}_alpha2");
        }
        for InPose { beta2_deg, modes } in &self.poses {
            text += &format!("\n{beta2_deg}");
            for Mode { frequency_hz, damping_ratio, shape: [first, second] } in modes {
                text += &format!(",{frequency_hz},{damping_ratio:e},{first},{second}");
            }
        }
        text.push('\n');
        text
    }

    /// As Fig. 3 of the paper.
    fn figure(&self, arm: &ArmSection) -> Figure {
        let mut panel = Panel::new(Axis::degrees("β₂ (°)"), Axis::linear("natural frequency (Hz)"));
        for (k, color) in [Color::Blue, Color::Vermillion].into_iter().enumerate() {
            let points = self.poses.iter().map(|pose| (pose.beta2_deg, pose.modes[k].frequency_hz)).collect();
            panel = panel.with(Series::line(format!("mode {}", k + 1), color, points));
        }
        Figure::new("Natural frequencies of the arm against the angle of link 2")
            .subtitle(captions::pose_without(arm, &["beta2_deg"]))
            .with(panel)
    }
}
