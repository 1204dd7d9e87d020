//! The paper's statements, each with the results for both presets and whether it holds.
//!
//! A statement that depends on a parameter that the paper does not state (the amplitude of an excitation, the line of
//! Fig. 6, the length of a pulse) is judged once for each value of a given range,
//! `Scan` of the settings: these are its cases.

mod bending;
mod bent;
mod cases;
mod linear;
mod pulse;
mod report;
mod statements;
mod survey;
mod tip;
mod torque;

use serde::Serialize;

use super::branch::by_name;
use super::error::PaperError;
use super::settings::Settings;
use super::subject::Subject;
use cases::Judgement;
use resonarm_dynamics::structure::Preset;
use resonarm_session::study::on_all_cores;
use survey::Survey;

/// Whether a statement holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// It holds in all cases that could be computed, and these are at least two thirds of all.
    Holds,
    /// It holds in some cases.
    HoldsInPart,
    /// It holds in no case that could be computed, and these are at least two thirds of all.
    DoesNotHold,
    /// It holds in no case that could be computed, but these are less than two thirds of all.
    Undecided,
    /// No case could be computed; the value states the reason.
    NotComputed,
}

impl Verdict {
    /// The verdict in words.
    pub const fn words(self) -> &'static str {
        match self {
            Verdict::Holds => "holds",
            Verdict::HoldsInPart => "holds in part",
            Verdict::DoesNotHold => "does not hold",
            Verdict::Undecided => "undecided",
            Verdict::NotComputed => "not computed",
        }
    }
}

/// A number behind a verdict.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Number {
    /// Name of what the number belongs to: a pose, a force, a zone.
    pub of: String,
    /// The number, in the unit of `unit`.
    pub value: f64,
    /// Its unit; empty for a ratio.
    pub unit: &'static str,
}

/// A statement judged for one value of an unstated parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Case {
    /// The value; empty without an unstated parameter.
    pub at: String,
    /// Whether the statement holds there.
    pub verdict: Verdict,
    /// The result in words with rounded numbers, or the reason for which it could not be computed.
    pub value: String,
    /// Numbers behind the verdict, not rounded.
    pub numbers: Vec<Number>,
}

/// The verdict on a statement for a preset.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Preset that the statement was judged for.
    #[serde(serialize_with = "by_name")]
    pub preset: Preset,
    /// Whether the statement holds, in all cases together.
    pub verdict: Verdict,
    /// The parameter that varies between the cases; empty if there is none.
    pub over: &'static str,
    /// The index of the figures' case.
    pub own: usize,
    /// Verdicts on the single cases.
    pub cases: Vec<Case>,
}

/// A statement of the paper and its verdicts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Claim {
    /// Name of the statement in lists and documents.
    pub id: &'static str,
    /// The section of the paper that makes it.
    pub section: &'static str,
    /// The statement, in our words.
    pub statement: &'static str,
    /// The criterion: what is computed, and when the statement holds.
    pub rule: &'static str,
    /// Whether I_S2 of `irb1600-fitted` was chosen so that this statement holds: for that preset it is then no
    /// evidence.
    pub chosen_for: bool,
    /// The findings for each preset.
    pub findings: Vec<Finding>,
}

/// The statements, checked against the computed results.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// The statements with their verdicts.
    pub claims: Vec<Claim>,
}

impl Report {
    /// Says whether every statement could be judged in at least one of its cases.
    pub fn is_complete(&self) -> bool {
        self.claims.iter().flat_map(|claim| &claim.findings).all(|finding| finding.verdict != Verdict::NotComputed)
    }
}

/// A statement with the function that judges it.
struct Statement {
    id: &'static str,
    section: &'static str,
    statement: &'static str,
    rule: &'static str,
    chosen_for: bool,
    judge: fn(&Survey<'_>) -> Judgement,
}

/// Judges every statement for both presets, over all cores. `begin` is called with the number of computations, and
/// `done` after each. The report lists those that failed.
///
/// # Errors
/// [`PaperError::Structure`] if a preset can't be read.
pub fn judge(settings: &Settings, begin: impl FnOnce(usize), done: impl Fn() + Sync) -> Result<Report, PaperError> {
    let subjects = Preset::ALL.map(|preset| Subject::new(preset, settings));
    let subjects = subjects.into_iter().collect::<Result<Vec<_>, _>>()?;
    let mut jobs = Vec::new();
    for (index, subject) in subjects.iter().enumerate() {
        jobs.extend(survey::jobs(subject, settings)?.into_iter().map(|job| (index, job)));
    }
    let all = &statements::STATEMENTS;
    // A statement counts as a computation for each preset: some follow curves or integrate on their own.
    begin(jobs.len() + all.len() * subjects.len());
    // First all curves, then the statements: many statements are judged on one curve, which is computed once.
    let seen = on_all_cores(&jobs, |(index, job)| survey::done(&subjects[*index], settings, *job), &done);
    let mut seen = seen.into_iter();
    let surveys: Vec<Survey<'_>> = subjects
        .iter()
        .enumerate()
        .map(|(index, subject)| {
            let own = jobs.iter().filter(|(of, _)| *of == index).count();
            // The results are in the order of the jobs, and the jobs in that of the subjects.
            Survey::new(subject, settings, seen.by_ref().take(own))
        })
        .collect();
    let pairs: Vec<_> =
        all.iter().flat_map(|statement| surveys.iter().map(move |survey| (statement, survey))).collect();
    let findings = on_all_cores(&pairs, |(statement, survey)| finding(survey, (statement.judge)(survey)), &done);
    let mut findings = findings.into_iter();
    let claim = |statement: &Statement| Claim {
        id: statement.id,
        section: statement.section,
        statement: statement.statement,
        rule: statement.rule,
        chosen_for: statement.chosen_for,
        // In the order of the pairs: all subjects of a statement follow each other.
        findings: findings.by_ref().take(subjects.len()).collect(),
    };
    Ok(Report { claims: all.iter().map(claim).collect() })
}

fn finding(survey: &Survey<'_>, judgement: Judgement) -> Finding {
    let Judgement { over, own, cases } = judgement;
    let verdicts: Vec<Verdict> = cases.iter().map(|case| case.verdict).collect();
    let verdict = verdict(&verdicts);
    Finding { preset: survey.subject.preset, verdict, over, own, cases }
}

/// Says whether enough cases could be computed for a verdict: two thirds.
fn enough(computed: usize, all: usize) -> bool {
    // In whole numbers, so that rounding doesn't decide at exactly two thirds.
    3 * computed >= 2 * all
}

/// Returns the verdict on a statement from those on its cases.
fn verdict(cases: &[Verdict]) -> Verdict {
    let count = |verdict| cases.iter().filter(|case| **case == verdict).count();
    let holds = count(Verdict::Holds);
    let not = count(Verdict::DoesNotHold);
    match (holds, not, enough(holds + not, cases.len())) {
        (0, 0, _) => Verdict::NotComputed,
        (0, _, true) => Verdict::DoesNotHold,
        (0, _, false) => Verdict::Undecided,
        (_, 0, true) => Verdict::Holds,
        _ => Verdict::HoldsInPart,
    }
}
