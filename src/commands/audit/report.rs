//! The results of an audit as text, JSON, JUnit XML and HTML.

use std::path::PathBuf;

use serde::Serialize;
use serde_json::Value;

use super::bench::Run;
use crate::commands::spec::figure_of;
use crate::failure::Failure;
use crate::junit::{self, Outcome};
use crate::page::{Page, Tone};
use resonarm::audit::{Case, Finding, Measure, Stimulus, Verdict};
use resonarm::specification::verdict::BeginBy;
use resonarm_numeric::number::rounded;

/// Result of a case.
#[derive(Debug, Serialize)]
pub(super) struct Row {
    case: &'static str,
    title: &'static str,
    rule: &'static str,
    stimulus: Stimulus,
    #[serde(flatten)]
    finding: Finding,
    recording: Option<PathBuf>,
    /// What the controller did in a run of the case's own.
    #[serde(flatten)]
    own: Option<Own>,
}

/// The run of a case.
#[derive(Debug, Serialize)]
struct Own {
    /// Sample at which the stimulus began.
    stimulus_sample: usize,
    /// The sample after the last one with a drive.
    drive_end_sample: usize,
    /// Why the controller ended early, if it runs in this process and says so.
    ended_by: Option<String>,
}

impl Row {
    pub fn new(case: &Case, finding: Finding, recording: Option<PathBuf>) -> Row {
        let Case { id, title, rule, stimulus, .. } = *case;
        Row { case: id, title, rule, stimulus, finding, recording, own: None }
    }

    /// A case with a run of its own.
    pub fn of_run(case: &Case, finding: Finding, run: Run) -> Row {
        let own =
            Own { stimulus_sample: run.stimulus, drive_end_sample: run.record.drive_end(), ended_by: run.ended_by };
        Row { own: Some(own), ..Row::new(case, finding, Some(run.recording)) }
    }

    /// Returns the reason of a case without a result.
    fn reason(&self) -> Option<&str> {
        match &self.finding.verdict {
            Verdict::Passed | Verdict::Failed => None,
            Verdict::Inconclusive(reason) | Verdict::Skipped(reason) => Some(reason),
        }
    }

    fn measured(&self) -> String {
        self.finding.measured.iter().map(measured).collect::<Vec<_>>().join("; ")
    }

    pub fn text(&self) -> String {
        let measured = if self.finding.measured.is_empty() { String::new() } else { format!(": {}", self.measured()) };
        let mut text = format!("{:12}  {} {}{measured}\n", self.finding.verdict.name(), self.case, self.title);
        if let Some(reason) = self.reason() {
            text += &format!("{:14}{reason}\n", "");
        }
        if self.finding.verdict == Verdict::Failed {
            text += &format!("{:14}rule: {}\n", "", self.rule);
        }
        text
    }

    fn junit(&self) -> junit::Case {
        let outcome = match &self.finding.verdict {
            Verdict::Passed => Outcome::Passed,
            Verdict::Failed => Outcome::Failed(format!("{}; rule: {}", self.measured(), self.rule)),
            // JUnit has no verdict between success and failure.
            Verdict::Inconclusive(reason) => Outcome::Skipped(format!("inconclusive: {reason}")),
            Verdict::Skipped(reason) => Outcome::Skipped(format!("skipped: {reason}")),
        };
        junit::Case { name: format!("{} {}", self.case, self.title), took_s: None, outcome }
    }
}

/// Returns a figure with its limits, in words.
fn measured(measure: &Measure) -> String {
    let Measure { name, value, unit, least, most } = *measure;
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    let limits = match (least, most) {
        (Some(least), Some(most)) => format!(" ({} to {})", figure_of(least), figure_of(most)),
        (Some(least), None) => format!(" (at least {})", figure_of(least)),
        (None, Some(most)) => format!(" (at most {})", figure_of(most)),
        (None, None) => String::new(),
    };
    format!("{name} {}{unit}{limits}", figure_of(value))
}

/// Says where the test begins in the base run.
pub(super) fn begins_text(base: &Run, begins_s: Option<f64>) -> String {
    match begins_s {
        Some(begins_s) => {
            let by = BeginBy::of(&base.specification.test).name();
            format!("begin of the test: {} s into the undisturbed run, {by}\n", rounded(&begins_s, 3))
        }
        None => String::from("begin of the test: not found in the undisturbed run\n"),
    }
}

/// The JSON document of a whole audit.
#[derive(Debug, Serialize)]
pub(super) struct Document {
    configuration: Value,
    passed: usize,
    failed: usize,
    inconclusive: usize,
    skipped: usize,
    /// Recording of the base run.
    recording: PathBuf,
    /// Time from the start of the base run at which the test begins, s, and what shows it.
    begins_s: Option<f64>,
    begins_by: Option<BeginBy>,
    cases: Vec<Row>,
}

impl Document {
    pub fn new(configuration: Value, base: &Run, begins_s: Option<f64>, cases: Vec<Row>) -> Document {
        let count = |name| cases.iter().filter(|row| row.finding.verdict.name() == name).count();
        Document {
            configuration,
            passed: count("passed"),
            failed: count("failed"),
            inconclusive: count("inconclusive"),
            skipped: count("skipped"),
            recording: base.recording.clone(),
            begins_s,
            begins_by: begins_s.map(|_| BeginBy::of(&base.specification.test)),
            cases,
        }
    }

    /// Says whether no case failed and one passed: a controller that does nothing fails no case.
    pub const fn is_positive(&self) -> bool {
        self.failed == 0 && self.passed > 0
    }

    pub fn summary(&self) -> String {
        let Document { passed, failed, inconclusive, skipped, .. } = self;
        format!("{passed} passed, {failed} failed, {inconclusive} inconclusive, {skipped} skipped\n")
    }

    pub fn junit(&self) -> String {
        let cases: Vec<junit::Case> = self.cases.iter().map(Row::junit).collect();
        junit::document("resonarm audit", &cases)
    }

    /// Returns the report as a page.
    pub fn page(&self, title: &str, base: &Run) -> Result<String, Failure> {
        let mut page = Page::new(title);
        let (tone, word) = if self.is_positive() { (Tone::Good, "passed") } else { (Tone::Bad, "failed") };
        page.verdict(tone, word);
        page.faint(self.summary().trim_end());
        page.faint(begins_text(base, self.begins_s).trim_end());
        page.faint(&format!("Recording of the undisturbed run: {}", base.recording.display()));
        let rows: Vec<(Tone, [String; 4])> = self
            .cases
            .iter()
            .map(|row| {
                let tone = match row.finding.verdict {
                    Verdict::Passed => Tone::Good,
                    Verdict::Failed => Tone::Bad,
                    Verdict::Inconclusive(_) | Verdict::Skipped(_) => Tone::Open,
                };
                let found = row.reason().map_or_else(|| row.measured(), str::to_owned);
                let case = format!("{} {}", row.case, row.title);
                (tone, [case, row.finding.verdict.name().to_owned(), found, row.rule.to_owned()])
            })
            .collect();
        page.table(["case", "verdict", "measured", "rule"], &rows);
        page.sources(&base.specification.sources);
        Ok(page.document())
    }
}
