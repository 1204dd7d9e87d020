//! The parts of a verdict, for JUnit XML and for the report as HTML.

use super::spec::figure_of;
use super::verdict_words::{Undecided, begins_text, db, level_measured, not_begun, percent};
use crate::failure::Failure;
use crate::junit::{self, Outcome};
use crate::page::{Page, Tone};
use resonarm::judge::{Document, Droop, Found};
use resonarm::specification::verdict::{LimitVerdict, Verdict};
use resonarm_figures::plot::Figure;
use resonarm_numeric::number::rounded;

/// One of the questions that a verdict answers.
struct Part {
    name: String,
    verdict: Verdict,
    /// What was measured, in words.
    measured: String,
}

impl Part {
    fn new(name: impl Into<String>, verdict: Verdict, measured: String) -> Part {
        Part { name: name.into(), verdict, measured }
    }
}

fn limits(limits: &[LimitVerdict]) -> impl Iterator<Item = Part> {
    limits.iter().map(|limit| {
        let measured = format!("largest {} at {} Hz", db(limit.largest_db), rounded(&limit.largest_hz, 3));
        Part::new(format!("limit of {}", limit.channel), limit.verdict, measured)
    })
}

/// Returns the part about the number of shots at full level.
fn number_of_shots(full: usize, asked: u32) -> Part {
    let verdict = match full {
        0 => Verdict::Out,
        few if few < asked as usize => Verdict::Undecided,
        _ => Verdict::In,
    };
    Part::new("shots at full level", verdict, format!("{full} of {asked}"))
}

/// Returns the parts. The worst of their verdicts is that of the document.
fn parts(document: &Document<'_>) -> Vec<Part> {
    let mut parts = Vec::new();
    if let Some(level) = document.level {
        parts.push(Part::new("level", level.verdict, level_measured(level)));
    }
    match document.found {
        Found::Random(found) => {
            let [inside, undecided, out] = found.counts;
            let [low, high] = found.deviation_db.map(db);
            let lines = found.lines.len();
            let measured = format!(
                "of {lines} lines {inside} are in, {undecided} undecided, {out} out; {low} to {high}; {} degrees of freedom",
                rounded(&found.degrees_of_freedom, 0)
            );
            parts.push(Part::new("profile", found.profile, measured));
            if let Some(verdict) = found.rms.verdict {
                let rms = figure_of(found.rms.rms_m_s2);
                let demand = figure_of(found.rms.demand_m_s2);
                parts.push(Part::new("rms", verdict, format!("{rms} m/s², specified {demand} m/s²")));
            }
            if found.is_too_short {
                let measured = String::from("fewer than the specification asks for");
                parts.push(Part::new("degrees of freedom", Verdict::Undecided, measured));
            }
            parts.extend(limits(&found.limits));
        }
        Found::Sine(found) => {
            let [inside, undecided, out] = found.shares.map(percent);
            let [low, high] = found.extremes.map(|ratio| percent(ratio - 1.0));
            let measured =
                format!("in for {inside} of the time, undecided for {undecided}, out for {out}; {low} to {high}");
            parts.push(Part::new("amplitude", found.amplitude, measured));
            let verdict = if found.whole < found.asked as usize { Verdict::Undecided } else { Verdict::In };
            parts.push(Part::new("whole sweeps", verdict, format!("{} of {}", found.whole, found.asked)));
            if let Some(verdict) = found.rate {
                let rates: Vec<String> = found.passes.iter().map(|pass| figure_of(pass.rate)).collect();
                parts.push(Part::new("sweep rate", verdict, rates.join(", ")));
            }
            if let Some(is_continuous) = found.is_continuous {
                let (verdict, word) =
                    if is_continuous { (Verdict::In, "continuous") } else { (Verdict::Out, "stepped") };
                parts.push(Part::new("continuity", verdict, String::from(word)));
            }
            parts.extend(limits(&found.limits));
        }
        Found::Shock(found) => {
            parts.push(number_of_shots(found.full, found.asked));
            if let Some(is_low) = found.is_first_low {
                let verdict = if is_low { Verdict::In } else { Verdict::Out };
                let first = found.shots.first().map_or(0.0, |shot| shot.amplitude);
                parts.push(Part::new("first shot", verdict, format!("{} of the full level", percent(first))));
            }
            for (shot, number) in found.shots.iter().filter(|shot| shot.is_full).zip(1..) {
                let error = percent(shot.error);
                let change = percent(shot.velocity_change);
                let measured = format!("error {error} of the peak, velocity change {change} off");
                parts.push(Part::new(format!("shot {number}"), shot.verdict, measured));
            }
        }
        Found::Srs(found) => {
            parts.push(number_of_shots(found.full, found.asked));
            for (shot, number) in found.shots.iter().filter(|shot| shot.is_full).zip(1..) {
                let [inside, undecided, out] = shot.shares.map(percent);
                let measured = format!("{inside} of the lines in, {undecided} undecided, {out} out");
                parts.push(Part::new(format!("shot {number}"), shot.verdict, measured));
            }
        }
        Found::NotBegun(_) => {}
    }
    if let Some(reason) = not_begun(document) {
        parts.push(Part::new("begin of the test", Verdict::Undecided, reason));
    }
    if document.clipped > 0 {
        let measured = format!("{} values are clipped, so the record can't show that the test is in", document.clipped);
        parts.push(Part::new("clipped readings", Verdict::Undecided, measured));
    }
    parts
}

/// Returns the verdict as JUnit XML: a case for each part. What is undecided is a failure, or skipped if it passes, which it does
/// only in a record in which a test begins.
pub(super) fn junit(document: &Document<'_>, undecided: Undecided) -> String {
    let undecided = if document.begins_s.is_some() { undecided } else { Undecided::Fail };
    let case = |part: Part| {
        let reason = format!("{}: {}", part.verdict.name(), part.measured);
        let outcome = match (part.verdict, undecided) {
            (Verdict::In, _) => Outcome::Passed,
            (Verdict::Undecided, Undecided::Pass) => Outcome::Skipped(reason),
            (Verdict::Undecided, Undecided::Fail) | (Verdict::Out, _) => Outcome::Failed(reason),
        };
        junit::Case { name: part.name, took_s: None, outcome }
    };
    let cases: Vec<junit::Case> = parts(document).into_iter().map(case).collect();
    junit::document("resonarm verdict", &cases)
}

const fn tone(verdict: Verdict) -> Tone {
    match verdict {
        Verdict::In => Tone::Good,
        Verdict::Undecided => Tone::Open,
        Verdict::Out => Tone::Bad,
    }
}

/// Returns the report: the verdict, its parts, the figure with the tolerance, and where the specification comes from. `judged`
/// says which record was judged.
pub(super) fn report(document: &Document<'_>, title: &str, judged: &str, figure: &Figure) -> Result<String, Failure> {
    let mut page = Page::new(title);
    page.verdict(tone(document.verdict), document.verdict.name());
    page.faint(judged);
    page.faint(&begins_text(document));
    if let Some(Droop { frequency_hz, gain_db }) = document.converters {
        let hz = figure_of(frequency_hz);
        page.faint(&format!("The readings are judged: the converters read {} at {hz} Hz.", db(gain_db)));
    }
    page.figure(figure)?;
    page.heading("Parts of the verdict");
    let rows: Vec<(Tone, [String; 3])> = parts(document)
        .into_iter()
        .map(|part| (tone(part.verdict), [part.name, part.verdict.name().to_owned(), part.measured]))
        .collect();
    page.table(["part", "verdict", "measured"], &rows);
    page.faint(
        "In and out are proven with the confidence of the record; what it does not decide is undecided. \
         docs/specifications.md describes how.",
    );
    page.sources(&document.specification.sources);
    Ok(page.document())
}
