//! The paper's statements, each with the number computed for both presets, and whether it holds.

mod bending;
mod linear;
mod pulse;
mod report;
mod statements;
mod strong;
mod tip;
mod torque;

use serde::Serialize;

use super::branch::by_name;
use super::{PaperError, Settings, Subject, on_all_cores};
use crate::arm::Preset;

/// Whether a statement holds for a preset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// It does.
    Holds,
    /// It does not.
    DoesNotHold,
    /// What it is about could not be computed; the value says why.
    NotComputed,
}

impl Verdict {
    /// In words.
    pub const fn words(self) -> &'static str {
        match self {
            Verdict::Holds => "holds",
            Verdict::DoesNotHold => "does not hold",
            Verdict::NotComputed => "not computed",
        }
    }
}

/// A number behind a verdict.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Number {
    /// What it is of: a pose, a force, a zone.
    pub of: String,
    /// The number, with its unit in its name in `unit`.
    pub value: f64,
    /// Its unit; empty for a ratio.
    pub unit: &'static str,
}

/// What became of a statement for a preset.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// The preset.
    #[serde(serialize_with = "by_name")]
    pub preset: Preset,
    /// Whether the statement holds.
    pub verdict: Verdict,
    /// What was computed, in words with rounded numbers.
    pub value: String,
    /// The numbers.
    pub numbers: Vec<Number>,
}

/// A statement of the paper and what became of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Claim {
    /// A name.
    pub id: &'static str,
    /// The section of the paper that makes it.
    pub section: &'static str,
    /// What is said, in our words.
    pub statement: &'static str,
    /// What is computed, and when it counts as holding.
    pub criterion: &'static str,
    /// For each preset.
    pub findings: Vec<Finding>,
}

/// The statements, held against the computed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Each statement.
    pub claims: Vec<Claim>,
}

impl Report {
    /// Whether every number could be computed.
    pub fn is_complete(&self) -> bool {
        self.claims.iter().flat_map(|claim| &claim.findings).all(|finding| finding.verdict != Verdict::NotComputed)
    }
}

/// What a claim's function returns.
struct Judgement {
    holds: bool,
    value: String,
    numbers: Vec<Number>,
}

/// A statement with the function that judges it.
struct Statement {
    id: &'static str,
    section: &'static str,
    statement: &'static str,
    criterion: &'static str,
    judge: fn(&Subject, &Settings) -> Result<Judgement, PaperError>,
}

/// How many computations [`judge`] makes.
pub fn count() -> usize {
    statements::STATEMENTS.len() * Preset::ALL.len()
}

/// Judges every statement for both presets, over all cores; `done` is called after each of [`count`] computations. What can't be
/// computed is said in the report.
///
/// # Errors
/// [`PaperError::Arm`] if a preset can't be read.
pub fn judge(settings: &Settings, done: impl Fn() + Sync) -> Result<Report, PaperError> {
    let subjects = Preset::ALL.map(|preset| Subject::new(preset, settings));
    let subjects = subjects.into_iter().collect::<Result<Vec<_>, _>>()?;
    let all = &statements::STATEMENTS;
    let jobs: Vec<_> =
        all.iter().flat_map(|statement| subjects.iter().map(move |subject| (statement, subject))).collect();
    let work = |(statement, subject): &(&Statement, &Subject)| finding(subject, (statement.judge)(subject, settings));
    let mut findings = on_all_cores(&jobs, work, done).into_iter();
    let claim = |statement: &Statement| Claim {
        id: statement.id,
        section: statement.section,
        statement: statement.statement,
        criterion: statement.criterion,
        findings: findings.by_ref().take(subjects.len()).collect(),
    };
    Ok(Report { claims: all.iter().map(claim).collect() })
}

fn finding(subject: &Subject, judgement: Result<Judgement, PaperError>) -> Finding {
    let preset = subject.preset();
    match judgement {
        Ok(Judgement { holds, value, numbers }) => {
            let verdict = if holds { Verdict::Holds } else { Verdict::DoesNotHold };
            Finding { preset, verdict, value, numbers }
        }
        Err(error) => Finding { preset, verdict: Verdict::NotComputed, value: error.to_string(), numbers: Vec::new() },
    }
}

fn number(of: impl Into<String>, value: f64, unit: &'static str) -> Number {
    Number { of: of.into(), value, unit }
}

/// Angles below this count as small, from `LARGE_DEG` on as large.
const SMALL_DEG: f64 = 45.0;
const LARGE_DEG: f64 = 90.0;

#[cfg(test)]
mod tests;
