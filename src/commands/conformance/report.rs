//! The report of `conformance` as text, JSON and JUnit XML.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::{Value, json};

use crate::junit::{self, Outcome};
use resonarm::conformance::{Case, Check, Commands, Finding, Range, Refused, Requirement, UserRefused, Verdict};
use resonarm::protocol::Node;
use resonarm::recording::Summary;
use resonarm_numeric::number::short;

#[derive(Default, Serialize)]
pub(super) struct Row {
    case: &'static str,
    title: &'static str,
    requirements: &'static [&'static str],
    verdict: &'static str,
    reason: Option<String>,
    measured: Vec<String>,
    took_s: f64,
    held_up_ms: f64,
    silent_ms: f64,
    /// Frames taken, by message.
    heard: BTreeMap<String, u64>,
    /// Frames refused, by message and reason.
    refused: Vec<RefusedRow>,
    /// Frames with identifiers of no message of the network.
    others: BTreeMap<String, u64>,
}

/// Frames of one message that were rejected for one reason.
#[derive(Serialize)]
struct RefusedRow {
    message: String,
    count: u64,
    /// Expected and received values of the first of them.
    reason: String,
    /// The first of them, as candump writes it.
    frame: String,
    /// The first frame with the correct CRC, if its CRC was wrong.
    expected_frame: Option<String>,
    /// The whole row in words.
    #[serde(skip)]
    text: String,
}

impl RefusedRow {
    fn new(refused: &Refused) -> RefusedRow {
        RefusedRow {
            message: refused.error.kind().to_string(),
            count: refused.count,
            reason: refused.error.to_string(),
            frame: refused.frame.to_string(),
            expected_frame: refused.expected.map(|frame| frame.to_string()),
            text: refused.to_string(),
        }
    }

    fn of_user(refused: &UserRefused) -> RefusedRow {
        RefusedRow {
            message: refused.message.clone(),
            count: refused.count,
            reason: refused.fault.to_string(),
            frame: refused.frame.to_string(),
            expected_frame: None,
            text: refused.to_string(),
        }
    }
}

/// The verdict on a case that was not started.
const NOT_RUN: &str = "not run";

impl Row {
    pub fn new<S>(case: &Case<S>, finding: &Finding) -> Row {
        let (verdict, reason) = match &finding.verdict {
            Verdict::Passed => ("passed", None),
            Verdict::Failed(reason) => ("failed", Some(reason.clone())),
            Verdict::Inconclusive(reason) => ("inconclusive", Some(reason.clone())),
            Verdict::Skipped(reason) => ("skipped", Some(reason.clone())),
        };
        // A run has one protocol, Resonarm's or the user's, so one of the two lists is empty.
        let traffic = &finding.traffic;
        let heard = traffic.taken.iter().map(|(kind, count)| (kind.to_string(), *count));
        let heard = heard.chain(traffic.user_taken.iter().map(|(message, count)| (message.clone(), *count)));
        let refused = traffic.refused.iter().map(RefusedRow::new);
        let refused = refused.chain(traffic.user_refused.iter().map(RefusedRow::of_user));
        let mut others: BTreeMap<_, _> = traffic.others.iter().map(|(id, count)| (id.to_string(), *count)).collect();
        if traffic.further_others > 0 {
            others.insert(String::from("more"), traffic.further_others);
        }
        Row {
            verdict,
            reason,
            heard: heard.collect(),
            refused: refused.collect(),
            others,
            measured: finding.measured.clone(),
            took_s: finding.took_ns as f64 * 1e-9,
            held_up_ms: finding.held_up_ns as f64 * 1e-6,
            silent_ms: finding.silent_ns as f64 * 1e-6,
            ..Row::not_run(case)
        }
    }

    /// Returns the row of a case after the bus was lost.
    pub fn not_run<S>(case: &Case<S>) -> Row {
        Row {
            case: case.id,
            title: case.title,
            requirements: case.requirements,
            verdict: NOT_RUN,
            reason: Some(String::from("the bus was lost before")),
            ..Row::default()
        }
    }

    pub fn text(&self) -> String {
        let mut text = format!("{:12}  {:26} {}", self.verdict, self.case, self.title);
        if !self.measured.is_empty() {
            text += &format!(" ({})", self.measured.join("; "));
        }
        text.push('\n');
        if let Some(reason) = &self.reason {
            text += &format!("{:14}{reason}  {}\n", "", self.requirements.join(" "));
        }
        // These counts tell a silent node from one that sends something else. For a passed case they would be noise.
        if matches!(self.verdict, "failed" | "inconclusive") {
            text += &format!("{:14}heard: {}\n", "", counted(&self.heard, "nothing"));
            if !self.others.is_empty() {
                let others = counted(&self.others, "");
                text += &format!("{:14}heard with other identifiers: {others}\n", "");
            }
        }
        for refused in &self.refused {
            text += &format!("{:14}{}\n", "", refused.text);
        }
        text
    }

    fn junit(&self) -> junit::Case {
        let reason = self.reason.clone().unwrap_or_default();
        let outcome = match self.verdict {
            "passed" => Outcome::Passed,
            "failed" => Outcome::Failed(reason),
            // JUnit has no verdict between success and failure. Inconclusive cases are listed as skipped with their
            // own word in the message; the exit code still tells them apart.
            other => Outcome::Skipped(format!("{other}: {reason}")),
        };
        junit::Case { name: self.case.to_owned(), took_s: Some(self.took_s), outcome }
    }
}

fn counted(counts: &BTreeMap<String, u64>, none: &str) -> String {
    if counts.is_empty() {
        return String::from(none);
    }
    counts.iter().map(|(name, count)| format!("{count} {name}")).collect::<Vec<_>>().join(", ")
}

#[derive(Serialize)]
pub(super) struct Document {
    role: String,
    passed: usize,
    failed: usize,
    inconclusive: usize,
    skipped: usize,
    not_run: usize,
    cases: Vec<Row>,
    /// The ranges of an exciter's commands.
    commands: BTreeMap<&'static str, Option<[f64; 2]>>,
    recording: Option<Summary>,
    /// Requirements that no case can test.
    untested: Vec<Value>,
}

/// Returns the smallest and the largest value of each command, by its name; none where it was not received.
fn ranges(commands: &Commands) -> BTreeMap<&'static str, Option<[f64; 2]>> {
    // A force along a shaker is only among those received, of a protocol that commands it so.
    let always = ["force_x_n", "force_y_n", "torque1_nm", "torque2_nm"].map(|name| (name, None));
    let received = commands.ranges.iter().map(|(name, Range { min, max })| (*name, Some([*min, *max])));
    always.into_iter().chain(received).collect()
}

impl Document {
    /// Makes the report on a node; `requirements` are all demands on it.
    pub fn new(
        (tested, requirements): (Node, &[Requirement]),
        cases: Vec<Row>,
        commands: &Commands,
        recording: Option<Summary>,
    ) -> Document {
        let count = |verdict| cases.iter().filter(|row| row.verdict == verdict).count();
        let untested = requirements.iter().filter_map(|Requirement { id, text, check }| match check {
            Check::Cases => None,
            Check::Elsewhere(why) => Some(json!({ "requirement": id, "text": text, "why": why })),
        });
        Document {
            role: tested.to_string(),
            passed: count("passed"),
            failed: count("failed"),
            inconclusive: count("inconclusive"),
            skipped: count("skipped"),
            not_run: count(NOT_RUN),
            untested: untested.collect(),
            commands: ranges(commands),
            cases,
            recording,
        }
    }

    /// Says whether every case that could be run was passed: an empty bus passes none.
    pub fn is_positive(&self) -> bool {
        // A skipped case says nothing about the node: it needs a setting or a situation that this run did not have.
        self.failed + self.inconclusive + self.not_run == 0
    }

    pub fn summary(&self) -> String {
        let mut text = format!(
            "{} passed, {} failed, {} inconclusive, {} skipped, {} not run\n",
            self.passed, self.failed, self.inconclusive, self.skipped, self.not_run
        );
        // A plant under test commands nothing, so its report has no such line.
        let stated = self.commands.iter().filter_map(|(name, range)| {
            let unit = if name.starts_with("force") { "N" } else { "N m" };
            range.map(|[min, max]| format!("{name} {} to {} {unit}", short(&min), short(&max)))
        });
        let stated = stated.collect::<Vec<_>>().join(", ");
        if !stated.is_empty() {
            text += &format!("commanded: {stated}\n");
        }
        if let Some(Summary { path, bytes, lost, .. }) = &self.recording {
            let lost = lost.values().sum::<u64>();
            text += &format!("recording: {}, {bytes} bytes, {lost} records lost\n", path.display());
        }
        text
    }

    pub fn junit(&self) -> String {
        let cases: Vec<junit::Case> = self.cases.iter().map(Row::junit).collect();
        junit::document(&format!("resonarm conformance {}", self.role), &cases)
    }
}
