//! `resonarm survey`: runs that measure the modes of a structure, as one folder of recordings with an index.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;

use crate::commands::survey_labelled;
use crate::failure::{Failure, Verdict};
use crate::flags;
use crate::help::heading;
use crate::numbers;
use crate::output::{Inputs, JsonFlag, OverwriteFlag};
use crate::supervise::{Line, supervise};
use resonarm::control::Length;
use resonarm::run::Signals;
use resonarm::survey::{
    LeftOut, PlanSummary, RunState, Survey as Recordings, SurveyExcitation, SurveyIndex, SurveyPlan, SurveyRequest,
    SurveyRun,
};
use resonarm_numeric::number::short;
use resonarm_numeric::seed;

const EXAMPLES: &str = "\
Examples:
  resonarm survey plate.toml --exciters p1.z,p7.z --out plate
  resonarm identify plate
  resonarm survey hardening.toml --levels 1,2 --force-n 20 --out levels
  resonarm survey bracket.toml --sensors mid.y --sensors tip --out roving
  resonarm survey --from a.mcap,b.mcap --levels 1,2 --out measured";

/// Records runs that measure the modes of a structure into one folder, with an index.
///
/// There is a run for each level of force, each place of the exciter and each group of accelerometers. `resonarm identify
/// FOLDER` fits all of them together. Plant and exciter run in one loop, as with `run --mode free`, on all cores. The same
/// plan produces byte-identical files.
///
/// Each recording holds its own scenario, with the exciter and the accelerometers where the run needs them: one accelerometer
/// is always where the force acts. Instruments at other places are like accelerometer C of the scenario. The bus, a user
/// protocol and a control law play no part.
///
/// A folder with a part of the same survey is continued: complete recordings are kept. A run that fails is in the index with
/// its reason, and the exit code is 1.
///
/// With --from the command lists recordings that exist, such as imported logs of your bench, in place of making some.
#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct Survey {
    /// Scenario with the structure and the instruments, a TOML file.
    #[arg(value_name = "SCENARIO", required_unless_present = "from")]
    scenario: Option<PathBuf>,
    /// List these recordings in place of making some.
    #[arg(long, help_heading = heading::RECORDS, value_name = "FILE", value_delimiter = ',', conflicts_with_all = ["scenario", "exciters", "sensors", "force_n", "excitation", "highest_mode", "from_hz", "to_hz", "duration_s", "seed"])]
    from: Vec<PathBuf>,
    /// Seed from which those of all runs are derived, decimal or as 0x1F.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "N", default_value_t = 0, value_parser = seed::parse)]
    seed: u64,
    /// Length of a run, s [default: from the least damping].
    ///
    /// By default 16 lines of the spectrum are in the least half-power bandwidth 2ζf of the modes in the band; at least 10 and
    /// at most 600 s.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "S")]
    duration_s: Option<f64>,
    /// Points or degrees of freedom of the exciter, a run for each [default: where the scenario's load acts].
    #[arg(long, help_heading = heading::LOADS, value_name = "DOF", value_delimiter = ',')]
    exciters: Vec<String>,
    /// Points or degrees of freedom of the accelerometers, as tip.x,mid; a run for each [default: all degrees of freedom].
    #[arg(long, help_heading = heading::LOADS, value_name = "DOF", value_parser = sensor_group)]
    sensors: Vec<SensorGroup>,
    /// What the exciter plays.
    ///
    /// `random` is noise over the whole run, `burst-random` four bursts and `multisine` four periods. `impact` is one half
    /// sine, as long as a period of the highest frequency. `sine` sweeps through the band.
    #[arg(long, help_heading = heading::LOADS, value_name = "KIND", default_value_t, value_parser = flags::one_of(SurveyExcitation::ALL, SurveyExcitation::name))]
    excitation: SurveyExcitation,
    /// Peak force at level 1, N [default: that of the scenario].
    #[arg(long, help_heading = heading::LOADS, value_name = "N")]
    force_n: Option<f64>,
    /// Factors of the force, as 1,2, a run for each; with --from the level of each recording.
    ///
    /// Two levels tell whether the structure is linear. Without the flag there is one level, 1.
    #[arg(long, help_heading = heading::LOADS, value_name = "X,…", value_delimiter = ',')]
    levels: Vec<f64>,
    /// Highest mode in the band, from 1 [default: the highest that the sample rate allows].
    #[arg(long, help_heading = heading::RANGE, value_name = "N", value_parser = numbers::integer(1..=1_000_usize))]
    highest_mode: Option<usize>,
    /// Lowest frequency, Hz [default: half of the first mode's].
    #[arg(long, help_heading = heading::RANGE, value_name = "F")]
    from_hz: Option<f64>,
    /// Highest frequency, Hz [default: 1.3 times the highest mode's].
    ///
    /// The default is at most the geometric mean with the frequency of the next mode. The largest value is 0.4 times the
    /// sample rate.
    #[arg(long, help_heading = heading::RANGE, value_name = "F")]
    to_hz: Option<f64>,
    /// Write beside the recordings what other programs read, and the truth: labelled.json, UFF and CSV files.
    ///
    /// labelled.json has poles, shapes, modal masses and the noise of all readings. For each run the nodes and the accelerances
    /// H1 are in a UFF file, and the readings in a CSV file.
    #[arg(long, help_heading = heading::OUTPUT, conflicts_with = "from")]
    labelled: bool,
    /// Folder of the recordings and of index.json.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    overwrite: OverwriteFlag,
    #[command(flatten)]
    json: JsonFlag,
}

/// Places of the accelerometers in a run. clap would take a list of lists apart itself.
type SensorGroup = Vec<String>;

fn sensor_group(text: &str) -> Result<SensorGroup, String> {
    let names: Vec<String> = text.split(',').map(|name| name.trim().to_owned()).collect();
    if names.iter().any(String::is_empty) {
        return Err(String::from("it must be points or degrees of freedom with commas between them, as tip.x,mid"));
    }
    Ok(names)
}

impl Survey {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let index = match &self.scenario {
            Some(scenario) => self.record(scenario)?,
            None => self.list()?,
        };
        let mut written = vec![self.out.join(SurveyIndex::FILE)];
        if self.labelled {
            written.extend(survey_labelled::write(&self.out, &index)?);
        }
        self.json.show(&index, || text(&index), &written)?;
        for run in index.runs.iter().filter(|run| run.state == RunState::Failed) {
            let reason = run.reason.as_deref().unwrap_or("for an unknown reason");
            tracing::error!("{} failed: {reason}", run.file.display());
        }
        Ok(Verdict::of(index.is_complete()))
    }

    /// Makes the recordings that are missing.
    fn record(&self, path: &Path) -> Result<SurveyIndex, Failure> {
        let scenario = flags::read_scenario(path)?;
        let request = SurveyRequest {
            exciters: self.exciters.clone(),
            sensors: self.sensors.clone(),
            levels: if self.levels.is_empty() { vec![1.0] } else { self.levels.clone() },
            force_n: self.force_n,
            excitation: self.excitation,
            highest_mode: self.highest_mode,
            from_hz: self.from_hz,
            to_hz: self.to_hz,
            duration_s: self.duration_s,
            seed: self.seed,
        };
        let plan = SurveyPlan::new(&scenario, &request)?;
        let inputs = Inputs::of_scenario(Some(path));
        for run in &plan.runs {
            inputs.check(&self.out.join(&run.entry.file))?;
        }
        inputs.check(&self.out.join(SurveyIndex::FILE))?;
        if self.labelled {
            let entries: Vec<SurveyRun> = plan.runs.iter().map(|run| run.entry.clone()).collect();
            for file in survey_labelled::files(&entries) {
                inputs.check(&self.out.join(file))?;
            }
        }
        let survey = Arc::new(Recordings::begin(&self.out, plan, self.overwrite.overwrite)?);
        let kept = survey.complete();
        let total = survey.total();
        if kept > 0 {
            tracing::warn!("{}: {kept} of {total} recordings are there already, and are kept", self.out.display());
        }
        let watched = Arc::clone(&survey);
        // Each run has its own signals. Their counts and the request to stop are passed on between them and the progress bar.
        let on_tick = move |_: &mut Line, whole: &Signals| {
            whole.set_done(watched.samples_done());
            if whole.is_stopped() {
                watched.stop();
            }
        };
        let length = Length::Samples(survey.missing_samples());
        let index = supervise("survey", length, on_tick, move |_| survey.run())??;
        let missing = index.runs.iter().filter(|run| run.state == RunState::Planned).count();
        if missing > 0 {
            tracing::error!("stopped before {missing} of {total} runs had ended; the same command resumes from there");
        }
        Ok(index)
    }

    /// Lists recordings that exist.
    fn list(&self) -> Result<SurveyIndex, Failure> {
        let index = self.out.join(SurveyIndex::FILE);
        self.overwrite.check([index], &Inputs::of(&self.from))?;
        let index = SurveyIndex::of_recordings(&self.out, &self.from, &self.levels)?;
        std::fs::create_dir_all(&self.out).map_err(Failure::write(&self.out))?;
        index.write(&self.out)?;
        Ok(index)
    }
}

/// Describes a survey in words.
fn text(index: &SurveyIndex) -> String {
    let mut text = index.plan.as_ref().map_or(String::new(), |plan| plan_text(plan) + "\n");
    text += "  file           level   peak force (N)   exciter          accelerometers   length (s)   state\n";
    for run in &index.runs {
        let force = run.force_n.map_or(String::from("–"), |force_n| short(&force_n).to_string());
        text += &format!(
            "  {:<12}   {:>5}   {force:>14}   {:<14}   {:>14}   {:>10.3}   {}\n",
            run.file.display(),
            short(&run.level).to_string(),
            run.exciter.join(", "),
            run.sensors.len(),
            run.duration_s,
            run.state.name()
        );
    }
    text
}

fn plan_text(plan: &PlanSummary) -> String {
    let PlanSummary { seed, excitation, from_hz, to_hz, duration_s, force_n, modes, left_out, bandwidth_hz, .. } = plan;
    let numbers = |modes: Vec<usize>| match modes.as_slice() {
        [one] => format!("mode {one}"),
        several => {
            let several: Vec<String> = several.iter().map(usize::to_string).collect();
            format!("modes {}", several.join(", "))
        }
    };
    let mut text = format!(
        "{excitation}, peak {} N at level 1, {from_hz:.2} to {to_hz:.2} Hz, {} s a run, seed {seed}\n",
        short(force_n),
        short(duration_s)
    );
    if modes.is_empty() {
        text += "no mode is in the band\n";
    } else {
        let lines = duration_s * bandwidth_hz;
        text += &format!(
            "{} in the band; the least half-power bandwidth, {bandwidth_hz:.3e} Hz, has {lines:.1} lines\n",
            numbers(modes.clone())
        );
    }
    for (place, words) in [("rigid", "rigid"), ("below", "below the band"), ("above", "above the band")] {
        let of: Vec<usize> =
            left_out.iter().filter(|left| left.place == place).map(|LeftOut { mode, .. }| *mode).collect();
        if !of.is_empty() {
            let is = if of.len() == 1 { "is" } else { "are" };
            text += &format!("{} {is} {words}, and left out\n", numbers(of));
        }
    }
    text
}
