//! `resonarm experiment fig9`: both resonance zones of the paper's measured position, on the emulated bench.

use std::sync::Arc;

use clap::Args;
use serde::Serialize;
use serde_json::{Value, json};

use super::zone_figure;
use crate::configuration;
use crate::drive::Drive;
use crate::failure::{Failure, Verdict};
use crate::figures::captions;
use crate::flags::SessionFlags;
use crate::help::heading;
use crate::measured_points::{self, MeasuredPoint};
use crate::numbers;
use crate::output::{self, Inputs, PlotFlags};
use crate::progress::timed;
use crate::supervise::{Line, supervise};
use resonarm::control::{CancelHarmonics, Length, ModeNumber};
use resonarm::experiment::{Jump, Measured, Score, Zone, ZoneExperiment, ZoneMeasured, score};
use resonarm::plant::TestedAssembly;
use resonarm::rig::Load;
use resonarm::run::{ExciterEnd, Signals};
use resonarm::scenario::Scenario;
use resonarm_numeric::number::short;

/// Repeats section 5 of the paper on the emulated bench: β2 = 120°, 26 to 46 Hz.
///
/// In each resonance zone the command measures the whole response by a phase-resonance test, the backbone, and stepped
/// sines up and down at controlled force. The measurement goes through shaker, impedance head, frames and
/// accelerometers, with the force's harmonics 2 and 3 cancelled. All results are compared with the computed response.
#[derive(Debug, Args)]
#[command(mut_args(output::explained(
    "Plot everything to STEM.svg and STEM.png",
    "The caption is in STEM.txt, the data are in STEM.csv and STEM.json."
)))]
pub(crate) struct Fig9 {
    #[command(flatten)]
    session: SessionFlags,
    /// Force in the first zone, N.
    #[arg(long, help_heading = heading::LOADS, value_name = "N", default_value_t = 100.0)]
    first_force_n: f64,
    /// Force in the second zone, N.
    ///
    /// Above about 16 N accelerations exceed the range of the protocol, 1638 m/s².
    #[arg(long, help_heading = heading::LOADS, value_name = "N", default_value_t = 15.0)]
    second_force_n: f64,
    /// Lowest frequency, Hz.
    ///
    /// The zones meet halfway between the natural frequencies.
    #[arg(long, help_heading = heading::RANGE, value_name = "F", default_value_t = 26.0)]
    from_hz: f64,
    /// Highest frequency, Hz.
    #[arg(long, help_heading = heading::RANGE, value_name = "F", default_value_t = 46.0)]
    to_hz: f64,
    /// Largest step of the sines, Hz; near the resonance the steps are smaller.
    #[arg(long, help_heading = heading::RANGE, value_name = "F", default_value_t = 0.5)]
    step_hz: f64,
    /// Number of points of each walk, from 3 to 1000.
    #[arg(long, help_heading = heading::RANGE, value_name = "N", default_value_t = 40, value_parser = numbers::integer(3..=1000_u16))]
    points: u16,
    #[command(flatten)]
    output: PlotFlags,
}

/// The largest number of steps of a stepped sine, in addition to those of the walk.
const MOST_STEPS: f64 = 1e4;
const BACKBONE_POINTS: usize = 10;

#[derive(Serialize)]
struct Document<'a> {
    configuration: Value,
    coordinates: Value,
    /// Whether it was stopped before all was measured.
    interrupted: bool,
    zones: Vec<ZoneDocument<'a>>,
    simulated_s: f64,
    wall_s: f64,
}

#[derive(Serialize)]
pub(super) struct ZoneDocument<'a> {
    mode_number: u8,
    /// The loads by the degrees of freedom, N.
    drive: Value,
    #[serde(skip)]
    pub force_n: f64,
    /// The computed response, as the figure shows it: also that of a zone whose runs have not finished.
    #[serde(skip)]
    pub score: &'a Score,
    range_hz: [f64; 2],
    pub walk: Run,
    pub backbone: Run,
    pub up: Run,
    pub down: Run,
    /// The comparison with the computed response; none if a run did not finish, since the measurement is then
    /// incomplete.
    computed: Option<Computed<'a>>,
}

/// The responses that a controller read, and how it ended.
#[derive(Serialize)]
pub(super) struct Run {
    pub points: Vec<MeasuredPoint>,
    #[serde(flatten)]
    end: ExciterEnd,
}

#[derive(Serialize)]
struct Computed<'a> {
    #[serde(flatten)]
    score: &'a Score,
    jumps: Option<Value>,
}

impl Fig9 {
    pub(crate) fn scenario(&self) -> Result<Scenario, Failure> {
        self.session.scenario_or(scenario)
    }

    pub fn execute(&self) -> Result<Verdict, Failure> {
        self.session.refuse_duration("the experiment ends by itself")?;
        let scenario = self.scenario()?;
        let tested = scenario.under_test()?;
        let zones = self.zones(&tested)?;
        let experiment = ZoneExperiment::new(&zones);
        experiment.check(&scenario)?;
        let inputs = Inputs::of_scenario(self.session.structure.scenario.as_deref());
        self.output.check(output::PLOTTED, &inputs)?;
        self.output.plot.as_deref().map_or(Ok(()), output::check_folder)?;
        let (measured, wall_s) = timed(|| measure(&scenario, &zones, experiment));
        let measured = measured?;
        let scores = zones.iter().zip(&measured).map(|(zone, measured)| score(&tested, zone, measured));
        let scores = scores.collect::<Result<Vec<_>, _>>()?;
        let results = zones.iter().zip(&measured).zip(&scores);
        let zone_documents = results.map(|((zone, measured), score)| ZoneDocument::new(zone, measured, score, &tested));
        let zone_documents: Vec<_> = zone_documents.collect();
        let interrupted = zone_documents.iter().flat_map(ZoneDocument::runs).any(|(_, run)| run.end.is_stopped());
        let document = Document {
            configuration: configuration::of_structure(&scenario, &tested),
            coordinates: configuration::coordinates(&tested.assembly),
            interrupted,
            zones: zone_documents,
            simulated_s: measured.iter().map(ZoneMeasured::simulated_s).sum(),
            wall_s,
        };
        let drawn = || {
            let conditions = captions::structure(&scenario, &tested, &[]);
            (zone_figure::figure(conditions, &document.zones, interrupted), csv(&document.zones))
        };
        self.output.show(&document, drawn, || text(&document))?;
        if interrupted {
            tracing::error!(
                "interrupted: zones with unfinished runs are not compared with the computed response; the same command begins from the start"
            );
        }
        Ok(Verdict::of(document.zones.iter().flat_map(ZoneDocument::runs).all(|(_, run)| run.end.is_finished())))
    }

    /// Returns the two zones, which meet halfway between the natural frequencies.
    fn zones(&self, tested: &TestedAssembly) -> Result<[Zone; 2], Failure> {
        let modes = tested.assembly.modes();
        let [first, second, ..] = modes else {
            let count = modes.len();
            return Err(Failure::usage(format!(
                "the structure has {count} mode, but the experiment passes through the resonances of two"
            )));
        };
        let first_hz = first.frequency_hz;
        let second_hz = second.frequency_hz;
        let halfway_hz = 0.5 * (first_hz + second_hz);
        for (flag, got_n) in [("--first-force-n", self.first_force_n), ("--second-force-n", self.second_force_n)] {
            if !(got_n.is_finite() && got_n > 0.0) {
                return Err(Failure::value(flag, got_n, "it must be a positive number"));
            }
        }
        if !(self.from_hz > 0.0 && self.from_hz < first_hz) {
            let why = format!("it must be above 0 and below the first natural frequency, {first_hz:.2} Hz");
            return Err(Failure::value("--from-hz", self.from_hz, why));
        }
        if !(self.to_hz.is_finite() && self.to_hz > second_hz) {
            let why = format!("it must be above the second natural frequency, {second_hz:.2} Hz");
            return Err(Failure::value("--to-hz", self.to_hz, why));
        }
        if !(self.step_hz > 0.0 && self.to_hz - self.from_hz <= MOST_STEPS * self.step_hz) {
            let from_hz = short(&self.from_hz);
            let to_hz = short(&self.to_hz);
            let why = format!("it must be positive, with at most {MOST_STEPS} steps from {from_hz} to {to_hz} Hz");
            return Err(Failure::value("--step-hz", self.step_hz, why));
        }
        let zone = |mode_number, force_x_n, range_hz| Zone {
            mode_number,
            amplitude: Load::force_n(force_x_n, 0.0),
            range_hz,
            step_hz: self.step_hz,
            walk_points: usize::from(self.points),
            backbone_points: BACKBONE_POINTS,
            cancel_harmonics: CancelHarmonics::ALL,
        };
        Ok([
            zone(ModeNumber::FIRST, self.first_force_n, [self.from_hz, halfway_hz]),
            zone(ModeNumber::SECOND, self.second_force_n, [halfway_hz, self.to_hz]),
        ])
    }
}

/// Makes all runs, with one progress bar for them together.
fn measure(scenario: &Scenario, zones: &[Zone], experiment: ZoneExperiment) -> Result<Vec<ZoneMeasured>, Failure> {
    let experiment = Arc::new(experiment);
    let scenario = scenario.clone();
    let watched = Arc::clone(&experiment);
    // The experiment runs many sessions, each with its own signals. Their counts and the request to stop are passed
    // on between them and the progress bar over the whole.
    let on_tick = move |_: &mut Line, whole: &Signals| {
        whole.set_responses(watched.responses() as usize);
        if whole.is_stopped() {
            watched.stop();
        }
    };
    let length = Length::Responses(zones.iter().map(|zone| zone.responses() as u64).sum());
    Ok(supervise("experiment", length, on_tick, move |_| experiment.measure(&scenario))??)
}

pub(crate) fn scenario() -> Result<Scenario, Failure> {
    Ok(Scenario::parse(include_str!("../../../scenarios/fig9.toml"), "scenarios/fig9.toml")?)
}

impl Run {
    fn new(measured: &Measured, tested: &TestedAssembly) -> Run {
        let points = measured_points::points(tested, &measured.points);
        Run { points, end: ExciterEnd::of(measured.outcome.as_ref()) }
    }

    fn settled(&self) -> usize {
        self.points.iter().filter(|point| point.settled).count()
    }

    /// Returns the largest distortion of the force; `None` without a point.
    fn distortion(&self) -> Option<f64> {
        self.points.iter().filter_map(|point| point.distortion).reduce(f64::max)
    }
}

impl<'a> ZoneDocument<'a> {
    fn new(zone: &Zone, measured: &ZoneMeasured, score: &'a Score, tested: &TestedAssembly) -> ZoneDocument<'a> {
        let [walk, backbone, up, down] = measured.runs().map(|run| Run::new(run, tested));
        let jumps = score.jumps.map(|[up, down]| {
            let jump = |jump: Jump| {
                json!({ "between_hz": jump.between_hz, "fold_hz": jump.fold_hz, "steps_off": jump.steps_off() })
            };
            json!({ "up": jump(up), "down": jump(down) })
        });
        // An incomplete measurement would be scored by the points that happen to exist, and could look better than a
        // complete one.
        let have_finished = [&walk, &backbone, &up, &down].iter().all(|run| run.end.is_finished());
        ZoneDocument {
            mode_number: zone.mode_number.into(),
            drive: Drive::of_exciter(&zone.amplitude, tested).map_or(Value::Null, |drive| drive.document()),
            force_n: zone.amplitude.force_n.x,
            score,
            range_hz: zone.range_hz,
            walk,
            backbone,
            up,
            down,
            computed: have_finished.then_some(Computed { score, jumps }),
        }
    }

    fn runs(&self) -> [(&'static str, &Run); 4] {
        [("walk", &self.walk), ("backbone", &self.backbone), ("up", &self.up), ("down", &self.down)]
    }
}

fn text(document: &Document) -> String {
    let mut text = String::new();
    for zone in &document.zones {
        text += &format!("zone {}: {} N along x\n", zone.mode_number, zone.force_n);
        for (name, run) in zone.runs() {
            let reason = run.end.reason.as_ref().map_or(String::new(), |reason| format!(": {reason}"));
            let distortion = run.distortion().map_or(String::new(), |distortion| {
                format!(", distortion of the force up to {:.1} %", 100.0 * distortion)
            });
            let points = run.points.len();
            let settled = run.settled();
            let outcome = &run.end.outcome;
            text += &format!("  {name:<9} {points:4} points, {settled} settled{distortion}, {outcome}{reason}\n");
        }
        text.push_str(
            &zone
                .computed
                .as_ref()
                .map_or_else(|| String::from("  not compared: not all of its runs have finished\n"), Computed::text),
        );
    }
    let minutes = document.simulated_s / 60.0;
    let interrupted = if document.interrupted { "interrupted after " } else { "" };
    text += &format!("{interrupted}{minutes:.0} simulated minutes in {:.0} s\n", document.wall_s);
    text
}

impl Computed<'_> {
    fn text(&self) -> String {
        let folds: Vec<_> = self.score.folds_hz.iter().map(|hz| format!("{hz:.6} Hz")).collect();
        let folds = if folds.is_empty() { String::from("none") } else { folds.join(", ") };
        let jumps = self.score.jumps.map_or(String::from("none: up and down are the same"), |[up, down]| {
            let between = |jump: Jump| format!("between {:.6} and {:.6} Hz", jump.between_hz[0], jump.between_hz[1]);
            format!("up {}, down {}", between(up), between(down))
        });
        format!(
            "  folds     computed: {folds}\n  jumps     measured: {jumps}\n  \
             walk      {} points on the unstable part; at most {:.1e} off in frequency, {:.3} % in the amplitude of {}\n  \
             backbone  at most {:.1e} off in frequency\n",
            self.score.unstable_points,
            self.score.largest_frequency_deviation,
            100.0 * self.score.largest_amplitude_deviation,
            self.score.at,
            self.score.largest_backbone_deviation,
        )
    }
}

fn csv(zones: &[ZoneDocument]) -> String {
    let runs = || zones.iter().flat_map(|zone| zone.runs().map(|(name, run)| (zone.mode_number, name, run)));
    // All runs read the same degrees of freedom, so the columns are those of any run that has a point.
    let some = runs().map(|(.., run)| &run.points[..]).find(|points| !points.is_empty()).unwrap_or_default();
    let mut text = format!("zone,run,{}\n", measured_points::columns(some, "N"));
    for (zone, name, run) in runs() {
        run.points.iter().for_each(|point| text += &format!("{zone},{name},{}\n", point.cells()));
    }
    text
}
