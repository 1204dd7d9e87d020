//! `resonarm experiment fig9`: both resonance zones of the paper's measured position, on the emulated bench.

use core::fmt::Write;
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use serde::Serialize;
use serde_json::{Value, json};

use crate::configuration;
use resonarm::arm::{Arm, Pose};

use crate::failure::{Failure, Verdict};
use crate::figures::zone_figure;
use crate::flags::SessionFlags;
use crate::output::{self, OverwriteFlag};
use crate::supervise::{Line, supervise};
use crate::walk_point::WalkPoint;
use resonarm::control::{CancelHarmonics, Length, ModeNumber};
use resonarm::excitation::Amplitude;
use resonarm::experiment::{Measured, Score, Zone, ZoneExperiment, ZoneMeasured, score};
use resonarm::realtime::{Clock, SystemClock};
use resonarm::run::{ExciterEnd, Signals};
use resonarm::scenario::Scenario;
use resonarm_numeric::number::short;

/// Section 5 of the paper on the emulated bench: β2 = 120°, 26 to 46 Hz. In each zone a walk over the whole response,
/// the backbone, and stepped sines up and down at controlled force, through shaker, impedance head, frames and
/// accelerometers, with the force's harmonics 2 and 3 cancelled; all against the computed response.
#[derive(Debug, Args)]
pub(crate) struct Fig9 {
    #[command(flatten)]
    session: SessionFlags,
    /// Force in the first zone, N.
    #[arg(long, value_name = "N", default_value_t = 100.0, allow_hyphen_values = true)]
    first_force_n: f64,
    /// Force in the second zone, N: above about 16 N accelerations exceed the range of the wire, 1638 m/s².
    #[arg(long, value_name = "N", default_value_t = 15.0, allow_hyphen_values = true)]
    second_force_n: f64,
    /// Lowest frequency, Hz. The zones meet halfway between the natural frequencies.
    #[arg(long, value_name = "F", default_value_t = 26.0, allow_hyphen_values = true)]
    from_hz: f64,
    /// Highest frequency, Hz.
    #[arg(long, value_name = "F", default_value_t = 46.0, allow_hyphen_values = true)]
    to_hz: f64,
    /// Largest step of the sines, Hz; near the resonance the steps are smaller.
    #[arg(long, value_name = "F", default_value_t = 0.5, allow_hyphen_values = true)]
    step_hz: f64,
    /// Number of points of each walk.
    #[arg(long, value_name = "N", default_value_t = 40, value_parser = clap::value_parser!(u16).range(3..=1000))]
    points: u16,
    /// Draw everything to STEM.svg and STEM.png, with the caption in STEM.txt and the data in STEM.csv and STEM.json.
    #[arg(long, value_name = "STEM")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteFlag,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// Most steps of a stepped sine, in addition to those of the walk.
const MOST_STEPS: f64 = 1e4;
/// Points of each backbone.
const BACKBONE_POINTS: usize = 10;

#[derive(Serialize)]
struct Document {
    configuration: Value,
    /// Whether it was stopped before all was measured.
    interrupted: bool,
    zones: Vec<ZoneDocument>,
    simulated_s: f64,
    wall_s: f64,
}

#[derive(Serialize)]
struct ZoneDocument {
    mode_number: u8,
    force_n: [f64; 2],
    range_hz: [f64; 2],
    walk: Run,
    backbone: Run,
    up: Run,
    down: Run,
    /// The comparison with the computed response; none if a run did not finish, since the measurement is then
    /// incomplete.
    computed: Option<Computed>,
}

/// The responses that a controller read, and how it ended.
#[derive(Serialize)]
struct Run {
    points: Vec<WalkPoint>,
    #[serde(flatten)]
    end: ExciterEnd,
}

#[derive(Serialize)]
struct Computed {
    folds_hz: Vec<f64>,
    /// Points of the walk where the computed motion is unstable.
    unstable_points: usize,
    settled_points: usize,
    largest_frequency_deviation: f64,
    largest_amplitude_deviation: f64,
    largest_backbone_deviation: f64,
    jumps: Option<Value>,
}

impl Fig9 {
    /// The scenario of the flags.
    pub(crate) fn scenario(&self) -> Result<Scenario, Failure> {
        self.session.scenario(scenario)
    }

    pub fn execute(&self) -> Result<Verdict, Failure> {
        self.session.refuse_duration("the experiment ends by itself")?;
        let scenario = self.scenario()?;
        let arm = scenario.build_arm()?;
        let zones = self.zones(&arm)?;
        let experiment = ZoneExperiment::new(&zones);
        experiment.check(&scenario)?;
        self.overwrite.check_stem(self.plot.as_deref(), output::PLOTTED)?;
        self.plot.as_deref().map_or(Ok(()), output::check_folder)?;
        let start_ns = SystemClock.now_ns();
        let measured = measure(&scenario, &zones, experiment)?;
        let wall_s = SystemClock.now_ns().saturating_sub(start_ns) as f64 * 1e-9;
        let scores = zones.iter().zip(&measured).map(|(zone, measured)| score(&arm, zone, measured));
        let scores = scores.collect::<Result<Vec<_>, _>>()?;
        let results = zones.iter().zip(&measured).zip(&scores);
        let zone_documents = results.map(|((zone, measured), score)| ZoneDocument::new(zone, measured, score, &arm));
        let zone_documents: Vec<_> = zone_documents.collect();
        let interrupted = zone_documents.iter().flat_map(ZoneDocument::runs).any(|(_, run)| run.end.is_stopped());
        let document = Document {
            configuration: configuration::of_arm(&scenario)?,
            interrupted,
            zones: zone_documents,
            simulated_s: measured.iter().map(ZoneMeasured::simulated_s).sum(),
            wall_s,
        };
        let mut files = Vec::new();
        if let Some(stem) = &self.plot {
            let views: Vec<_> = document.zones.iter().zip(&scores).map(|(zone, score)| zone.view(score)).collect();
            let figure = zone_figure::figure(&scenario, &views, interrupted);
            files = output::plot(stem, &figure, &csv(&document.zones), &document)?;
        }
        if self.json {
            output::print_json(&document)?;
        } else {
            output::print(&text(&document))?;
            if !files.is_empty() {
                output::print_written(&files)?;
            }
        }
        if interrupted {
            tracing::error!(
                "interrupted: zones whose runs have not all finished are not judged; the same command begins from the start"
            );
        }
        Ok(Verdict::of(document.zones.iter().flat_map(ZoneDocument::runs).all(|(_, run)| run.end.is_finished())))
    }

    /// The two zones, which meet halfway between the natural frequencies.
    fn zones(&self, arm: &Arm) -> Result<[Zone; 2], Failure> {
        let [first_hz, second_hz] = resonarm::analysis::modes(arm).map(|mode| mode.frequency_hz);
        let halfway_hz = 0.5 * (first_hz + second_hz);
        for (flag, got_n) in [("--first-force-n", self.first_force_n), ("--second-force-n", self.second_force_n)] {
            if !(got_n.is_finite() && got_n > 0.0) {
                return Err(Failure::Usage(format!("{flag} is {}: it must be a positive number", short(&got_n))));
            }
        }
        let Pose { beta1_deg, beta2_deg } = arm.pose();
        let pose = format!("at β1 = {}°, β2 = {}°", short(&beta1_deg), short(&beta2_deg));
        let (from_hz, to_hz) = (short(&self.from_hz), short(&self.to_hz));
        if !(self.from_hz > 0.0 && self.from_hz < first_hz) {
            return Err(Failure::Usage(format!(
                "--from-hz is {from_hz}: it must be above 0 and below the first natural frequency, {first_hz:.2} Hz {pose}"
            )));
        }
        if !(self.to_hz.is_finite() && self.to_hz > second_hz) {
            return Err(Failure::Usage(format!(
                "--to-hz is {to_hz}: it must be above the second natural frequency, {second_hz:.2} Hz {pose}"
            )));
        }
        if !(self.step_hz > 0.0 && self.to_hz - self.from_hz <= MOST_STEPS * self.step_hz) {
            return Err(Failure::Usage(format!(
                "--step-hz is {}: it must be positive, and {from_hz} to {to_hz} Hz at most {MOST_STEPS} of it",
                short(&self.step_hz),
            )));
        }
        let zone = |mode_number, force_x_n, range_hz| Zone {
            mode_number,
            amplitude: Amplitude { force_x_n, ..Amplitude::default() },
            range_hz,
            step_hz: self.step_hz,
            walk_points: usize::from(self.points),
            backbone_points: BACKBONE_POINTS,
            cancel_harmonics: CancelHarmonics::ALL,
        };
        Ok([
            zone(ModeNumber::First, self.first_force_n, [self.from_hz, halfway_hz]),
            zone(ModeNumber::Second, self.second_force_n, [halfway_hz, self.to_hz]),
        ])
    }
}

/// All runs, with one progress bar over them.
fn measure(scenario: &Scenario, zones: &[Zone], experiment: ZoneExperiment) -> Result<Vec<ZoneMeasured>, Failure> {
    let (experiment, signals, scenario) = (Arc::new(experiment), Arc::new(Signals::default()), scenario.clone());
    let (watched, whole) = (Arc::clone(&experiment), Arc::clone(&signals));
    let on_tick = move |_line: &mut Line| {
        whole.set_responses(watched.responses() as usize);
        if whole.is_stopped() {
            watched.stop();
        }
    };
    let length = Length::Responses(zones.iter().map(|zone| zone.responses() as u64).sum());
    Ok(supervise("experiment", &signals, length, on_tick, move || experiment.measure(&scenario))??)
}

/// The bench of the experiment.
pub(crate) fn scenario() -> Result<Scenario, Failure> {
    Ok(Scenario::parse(include_str!("../../../scenarios/fig9.toml"), "scenarios/fig9.toml")?)
}

impl Run {
    fn new(measured: &Measured, arm: &Arm) -> Run {
        let points = measured.points.iter().map(|point| WalkPoint::new(point, arm)).collect();
        Run { points, end: ExciterEnd::of(measured.outcome.as_ref()) }
    }

    fn settled(&self) -> usize {
        self.points.iter().filter(|point| point.settled).count()
    }

    /// The largest distortion of the force; none without a point.
    fn distortion(&self) -> Option<f64> {
        self.points.iter().filter_map(|point| point.distortion).reduce(f64::max)
    }
}

impl ZoneDocument {
    fn new(zone: &Zone, measured: &ZoneMeasured, score: &Score, arm: &Arm) -> ZoneDocument {
        let [walk, backbone, up, down] = measured.runs().map(|run| Run::new(run, arm));
        let jumps = score.jumps.map(|[up, down]| {
            let jump = |jump: resonarm::experiment::Jump| {
                json!({ "between_hz": jump.between_hz, "fold_hz": jump.fold_hz, "steps_off": jump.steps_off() })
            };
            json!({ "up": jump(up), "down": jump(down) })
        });
        let computed = Computed {
            folds_hz: score.folds_hz.clone(),
            unstable_points: score.unstable_points,
            settled_points: score.settled_points,
            largest_frequency_deviation: score.largest_frequency_deviation,
            largest_amplitude_deviation: score.largest_amplitude_deviation,
            largest_backbone_deviation: score.largest_backbone_deviation,
            jumps,
        };
        let have_finished = [&walk, &backbone, &up, &down].iter().all(|run| run.end.is_finished());
        ZoneDocument {
            mode_number: zone.mode_number.into(),
            force_n: zone.amplitude.load().force_n.into(),
            range_hz: zone.range_hz,
            walk,
            backbone,
            up,
            down,
            computed: have_finished.then_some(computed),
        }
    }

    fn runs(&self) -> [(&'static str, &Run); 4] {
        [("walk", &self.walk), ("backbone", &self.backbone), ("up", &self.up), ("down", &self.down)]
    }

    fn view<'a>(&'a self, score: &'a Score) -> zone_figure::View<'a> {
        zone_figure::View {
            joint: usize::from(self.mode_number - 1),
            force_n: self.force_n[0],
            score,
            walk: &self.walk.points,
            backbone: &self.backbone.points,
            up: &self.up.points,
            down: &self.down.points,
        }
    }
}

fn text(document: &Document) -> String {
    let mut text = String::new();
    for zone in &document.zones {
        let _infallible = writeln!(text, "zone {}: {} N along x", zone.mode_number, zone.force_n[0]);
        for (name, run) in zone.runs() {
            let reason = run.end.reason.as_ref().map_or(String::new(), |reason| format!(": {reason}"));
            let distortion = run.distortion().map_or(String::new(), |distortion| {
                format!(", distortion of the force up to {:.1} %", 100.0 * distortion)
            });
            let _infallible = writeln!(
                text,
                "  {name:<9} {:4} points, {} settled{distortion}, {}{reason}",
                run.points.len(),
                run.settled(),
                run.end.outcome
            );
        }
        text.push_str(&zone.computed.as_ref().map_or_else(
            || String::from("  not judged: not all of its runs have finished\n"),
            |computed| computed.text(zone.mode_number),
        ));
    }
    let minutes = document.simulated_s / 60.0;
    let interrupted = if document.interrupted { "interrupted after " } else { "" };
    let _infallible = writeln!(text, "{interrupted}{minutes:.0} simulated minutes in {:.0} s", document.wall_s);
    text
}

impl Computed {
    fn text(&self, mode_number: u8) -> String {
        let folds: Vec<_> = self.folds_hz.iter().map(|hz| format!("{hz:.6} Hz")).collect();
        let folds = if folds.is_empty() { String::from("none") } else { folds.join(", ") };
        let jumps = self.jumps.as_ref().map_or(String::from("none: up and down are the same"), |jumps| {
            let between = |way: &str| {
                let hz = |i: usize| jumps[way]["between_hz"][i].as_f64().unwrap_or(f64::NAN);
                format!("{way} between {:.6} and {:.6} Hz", hz(0), hz(1))
            };
            format!("{}, {}", between("up"), between("down"))
        });
        format!(
            "  folds     computed: {folds}\n  jumps     measured: {jumps}\n  \
             walk      {} points on the unstable part; at most {:.1e} off in frequency, {:.3} % in α{mode_number}\n  \
             backbone  at most {:.1e} off in frequency\n",
            self.unstable_points,
            self.largest_frequency_deviation,
            100.0 * self.largest_amplitude_deviation,
            self.largest_backbone_deviation,
        )
    }
}

fn csv(zones: &[ZoneDocument]) -> String {
    let mut text = String::from(
        "zone,run,frequency_hz,phase_deg,excitation_n,harmonic1_alpha1_rad,harmonic1_alpha2_rad,\
         largest_alpha1_rad,largest_alpha2_rad,settled,tries\n",
    );
    for zone in zones {
        for (name, run) in zone.runs() {
            for point in &run.points {
                let ([h1, h2], [a1, a2]) = (point.harmonic1_rad, point.amplitude_rad);
                let WalkPoint { frequency_hz, phase_deg, excitation, settled, tries, .. } = point;
                let _infallible = writeln!(
                    text,
                    "{},{name},{frequency_hz},{phase_deg},{excitation},{h1},{h2},{a1},{a2},{settled},{tries}",
                    zone.mode_number
                );
            }
        }
    }
    text
}
