//! `resonarm audit`: acceptance cases for controllers of vibration and shock tests.

mod bench;
mod report;

use std::path::PathBuf;

use clap::Args;

use super::conformance::chosen;
use crate::failure::{Failure, Verdict};
use crate::help::heading;
use crate::output::{self, Inputs, JsonFlag};
use crate::specifications;
use bench::{AuditBench, Run, UnderTest};
use report::{Document, Row};
use resonarm::audit::{Base, Case, Context, Finding, Stimulus, cases};
use resonarm::bus::BusAddress;
use resonarm::scenario::Scenario;

const EXAMPLES: &str = "\
Examples:
  resonarm audit --scenario plant.toml --specification spec.toml \\
      --controller controller.toml --report audit.html
  resonarm audit --scenario plant.toml --specification spec.toml --bus vcan0 \\
      -- ./controller {bus} {spec}
  resonarm audit --scenario plant.toml --specification spec.toml --bus vcan0 \\
      --operator './tell {bus} {word}' -- ./controller {bus} {spec}
  resonarm audit --scenario plant.toml --specification spec.toml \\
      --controller controller.toml --case R1 --json

Exit codes: 0 if no case failed and one passed, else 1. docs/audit.md describes the cases.";

/// Audits a controller of vibration tests: numbered cases on a plant whose faults are known.
///
/// The controller runs the specification on the simulated plant, once undisturbed, then once for each case. In a case the plant
/// has a dead channel, an open cable, a clipped or inverted sensor or a gap in its samples, or the specification limits the drive
/// or a response. Each case says what was measured, its rule with the numbers, and passed, failed or inconclusive.
///
/// The controller is the [control] or [excitation] of a scenario, which runs in one process with the plant, or a command that
/// is started for each run and controls the plant over the bus in lockstep. In the command {bus} stands for the bus, {spec} for
/// the file of the specification, and {case} for the number of the case. Cases in which an operator stops the test, starts it again
/// or changes its level need a command for a controller on a bus that says the word, --operator.
#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct Audit {
    /// TOML file of the plant.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "FILE")]
    scenario: PathBuf,
    /// Specification, a TOML file, or the name of a preset.
    #[arg(long, help_heading = heading::TEST, value_name = "FILE")]
    specification: PathBuf,
    /// Controller under test, a TOML file with [control] or [excitation].
    #[arg(long, help_heading = heading::TEST, value_name = "FILE", conflicts_with = "bus")]
    controller: Option<PathBuf>,
    /// CAN bus of a controller that is a command, as vcan0.
    #[arg(long, help_heading = heading::BUS, value_name = "BUS", requires = "command")]
    bus: Option<String>,
    /// Only the cases whose numbers begin with this; may be repeated.
    #[arg(long = "case", help_heading = heading::TEST, value_name = "ID")]
    cases: Vec<String>,
    /// Folder for specifications and recordings of the runs.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "DIR", default_value = "resonarm-audit")]
    out: PathBuf,
    /// Also write the results as JUnit XML to this file.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// Also write a report to this file, one HTML page that loads nothing.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "FILE")]
    report: Option<PathBuf>,
    #[command(flatten)]
    overwrite: output::OverwriteFlag,
    #[command(flatten)]
    json: JsonFlag,
    /// Command that says an operator's word to a controller on a bus: {word} is replaced by stop, start or level, and {bus} by the
    /// bus. It is split at spaces.
    #[arg(long, help_heading = heading::TEST, value_name = "COMMAND", requires = "bus")]
    operator: Option<String>,
    /// Command that starts the controller, behind --, with {bus}, {spec} and {case} replaced.
    #[arg(last = true, help_heading = heading::TEST, value_name = "COMMAND", requires = "bus")]
    command: Vec<String>,
}

/// Name of the folder of the base run.
const BASE: &str = "base";

impl Audit {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let of_controller = self.controller.as_deref().map_or(Vec::new(), Scenario::files);
        let inputs = Scenario::files(&self.scenario).into_iter().chain(of_controller);
        let inputs = Inputs::of(inputs.chain(specifications::files(&self.specification)));
        let specification = specifications::read(&self.specification)?;
        let all = cases(&specification.test);
        if all.is_empty() {
            let kind = specification.test.kind();
            return Err(Failure::usage(format!("there are no cases for tests of the kind {kind}")));
        }
        let chosen = chosen(all, |case| case.id, &self.cases)?;
        let folders = core::iter::once(BASE).chain(chosen.iter().map(|case| case.id)).map(|id| self.out.join(id));
        let of_runs = folders.flat_map(|folder| bench::FILES.map(|file| folder.join(file)));
        self.overwrite.check(self.junit.iter().chain(&self.report).cloned().chain(of_runs), &inputs)?;
        let scenario = Scenario::read(&self.scenario)?;
        let bench =
            AuditBench::new(scenario, &self.specification, &specification, self.under_test()?, self.out.clone())?;
        let base_run = bench.run(BASE, Stimulus::None, None)?;
        let base = Base::new(&base_run.specification, &base_run.record);
        let begins_s = base.begins_s;
        if !self.json.json {
            output::print(&report::begins_text(&base_run, begins_s))?;
        }
        let mut rows = Vec::new();
        for case in chosen {
            let row = self.row(&bench, case, &base_run, &base)?;
            if !self.json.json {
                output::print(&row.text())?;
            }
            rows.push(row);
        }
        let document = Document::new(self.configuration(), &base_run, begins_s, rows);
        let mut files = Vec::new();
        if let Some(path) = &self.junit {
            files.push(output::write(path.clone(), &document.junit())?);
        }
        if let Some(path) = &self.report {
            let title = format!("Audit: {}", specifications::title(&specification, &self.specification));
            files.push(output::write(path.clone(), &document.page(&title, &base_run)?)?);
        }
        self.json.show(&document, || document.summary(), &files)?;
        Ok(Verdict::of(document.is_positive()))
    }

    /// Returns the controller under test.
    fn under_test(&self) -> Result<UnderTest, Failure> {
        match (&self.controller, &self.bus) {
            (Some(path), _) => UnderTest::scenario(path),
            (None, Some(bus)) => {
                let bus: BusAddress = bus.parse()?;
                let split = |command: &String| command.split_whitespace().map(str::to_owned).collect();
                let operator: Option<Vec<String>> = self.operator.as_ref().map(split);
                if let Some(words) = &operator
                    && !words.iter().any(|word| word.contains("{word}"))
                {
                    let command = words.join(" ");
                    return Err(Failure::usage(format!(
                        "--operator {command:?} has no {{word}}, so the controller could not tell stop from start: add it"
                    )));
                }
                Ok(UnderTest::Command { bus, words: self.command.clone(), operator })
            }
            (None, None) => {
                let missing = "no controller is given: give --controller FILE, or --bus BUS with a command behind --";
                Err(Failure::usage(missing))
            }
        }
    }

    /// Runs and judges a case.
    fn row(&self, bench: &AuditBench, case: &'static Case, base_run: &Run, base: &Base<'_>) -> Result<Row, Failure> {
        let judge = |run: &Run, stimulus| {
            case.judge(&Context { specification: &run.specification, base, record: &run.record, stimulus })
        };
        if case.stimulus == Stimulus::None {
            return Ok(Row::new(case, judge(base_run, 0), Some(base_run.recording.clone())));
        }
        if let Some(reason) = bench.why_not(case.stimulus) {
            return Ok(Row::new(case, Finding::skipped(reason), None));
        }
        if base.level.is_none() {
            // The case itself says so; the record is not looked at.
            return Ok(Row::new(case, judge(base_run, 0), None));
        }
        let stimulus = base.stimulus(&base_run.specification.test, case.stimulus).unwrap_or(0);
        let run = bench.run(case.id, case.stimulus, Some((base, stimulus)))?;
        Ok(Row::of_run(case, judge(&run, stimulus), run))
    }

    fn configuration(&self) -> serde_json::Value {
        serde_json::json!({
            "scenario": self.scenario,
            "specification": self.specification,
            "controller": self.controller,
            "bus": self.bus,
            "command": self.command,
            "operator": self.operator,
        })
    }
}
