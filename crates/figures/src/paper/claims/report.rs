//! The report as text and as Markdown.

use core::fmt::Write;

use super::{Claim, Finding, Report, Verdict};
use resonarm_dynamics::structure::Preset;

/// The largest number of cases whose labels are listed.
const LISTED: usize = 7;

impl Finding {
    /// The number of cases with a verdict, and their labels if they are few.
    fn of(&self, verdict: Verdict) -> (usize, String) {
        let labels = self.cases.iter().filter(|case| case.verdict == verdict).map(|case| case.at.as_str());
        let labels: Vec<&str> = labels.collect();
        let listed = (1..=LISTED).contains(&labels.len()).then(|| format!(" ({})", labels.join("; ")));
        (labels.len(), listed.unwrap_or_default())
    }

    /// Says in how many and which of the cases the statement holds, and which could not be computed; empty for a
    /// statement without an unstated parameter.
    pub fn share(&self) -> String {
        if self.over.is_empty() {
            return String::new();
        }
        let (holds, which) = self.of(Verdict::Holds);
        // Where it holds in all cases, or in none, a list would say nothing new.
        let which = if self.verdict == Verdict::HoldsInPart { which } else { String::new() };
        let mut text = format!("{holds} of {} {}{which}", self.cases.len(), self.over);
        let (unknown, which) = self.of(Verdict::NotComputed);
        if unknown > 0 {
            let _infallible = write!(text, "; not computed: {unknown}{which}");
        }
        text
    }

    /// Returns the result: the share of the cases, and the numbers of the figures' case.
    pub fn value(&self) -> String {
        let Some(own) = self.cases.get(self.own) else { return String::new() };
        if self.over.is_empty() {
            return own.value.clone();
        }
        format!("{}. At {}: {}", self.share(), own.at, own.value)
    }
}

impl Report {
    /// Returns the number of statements of each verdict for a preset, in words.
    fn summary(&self, preset: Preset) -> String {
        let all: Vec<(bool, Verdict)> = self
            .claims
            .iter()
            .flat_map(|claim| claim.findings.iter().map(move |finding| (claim, finding)))
            .filter(|(_, finding)| finding.preset == preset)
            .map(|(claim, finding)| (claim.chosen_for, finding.verdict))
            .collect();
        let words = |of: &[Verdict]| {
            let count = |verdict| of.iter().filter(|other| **other == verdict).count();
            let verdicts = [
                (Verdict::Holds, "hold"),
                (Verdict::HoldsInPart, "in part"),
                (Verdict::DoesNotHold, "not"),
                (Verdict::Undecided, "undecided"),
                (Verdict::NotComputed, "not computed"),
            ];
            let seen = verdicts.into_iter().filter(|(verdict, _)| count(*verdict) > 0);
            let listed: Vec<String> = seen.map(|(verdict, words)| format!("{} {words}", count(verdict))).collect();
            format!("of {} statements {}", of.len(), listed.join(", "))
        };
        let every: Vec<Verdict> = all.iter().map(|(_, verdict)| *verdict).collect();
        let free: Vec<Verdict> = all.iter().filter(|(chosen, _)| !chosen).map(|(_, verdict)| *verdict).collect();
        match preset {
            Preset::Irb1600Fitted => {
                format!("{preset}: {}; without those that it was fitted to, {}.", words(&every), words(&free))
            }
            Preset::Irb1600Table1 => format!("{preset}: {}.", words(&every)),
        }
    }

    fn summaries(&self) -> [String; 2] {
        Preset::ALL.map(|preset| self.summary(preset))
    }

    /// Returns the report as text, a paragraph for each claim.
    pub fn text(&self) -> String {
        let mut text = String::new();
        for claim in &self.claims {
            let Claim { id, section, statement, rule, .. } = claim;
            let _infallible = writeln!(text, "{id} (Section {section})\n  {statement}\n  Holds if {rule}.");
            for finding in &claim.findings {
                let name = finding.preset.name();
                let verdict = finding.verdict.words();
                let _infallible = writeln!(text, "    {name} {verdict}{}: {}", mark(claim, finding), finding.value());
            }
        }
        let _infallible = write!(text, "\n{NOTE}\n{}\n", self.summaries().join("\n"));
        text
    }

    /// Returns a table of the verdicts, a row for each claim, and below it the rules and the numbers.
    pub fn markdown(&self) -> String {
        let [first, second] = Preset::ALL;
        let mut text = format!("| Section | Statement | `{first}` | `{second}` |\n|---|---|---|---|\n");
        for claim in &self.claims {
            let _infallible = write!(text, "| {} | {} |", cell(claim.section), cell(claim.statement));
            for finding in &claim.findings {
                let share = finding.cases.iter().filter(|case| case.verdict == Verdict::Holds).count();
                let share = match finding.over {
                    "" => String::new(),
                    over => format!(", {share} of {} {over}", finding.cases.len()),
                };
                let _infallible = write!(text, " {}{}{share} |", finding.verdict.words(), plain(mark(claim, finding)));
            }
            text.push('\n');
        }
        let _infallible = writeln!(text, "\n{}\n", plain(NOTE));
        for summary in self.summaries() {
            let _infallible = writeln!(text, "- {}", plain(&summary));
        }
        for claim in &self.claims {
            let Claim { id, section, statement, rule, .. } = claim;
            let statement = plain(statement);
            let rule = plain(rule);
            let _infallible = writeln!(text, "\n**`{id}`** (Section {section}): {statement} Holds if {rule}.\n");
            for finding in &claim.findings {
                let name = finding.preset.name();
                let verdict = finding.verdict.words();
                let _infallible = writeln!(text, "- `{name}` {verdict}: {}", plain(&finding.value()));
            }
        }
        text
    }
}

const NOTE: &str =
    "* I_S2 of irb1600-fitted was chosen so that this statement holds, so that the agreement is no evidence.";

fn mark(claim: &Claim, finding: &Finding) -> &'static str {
    if claim.chosen_for && finding.preset == Preset::Irb1600Fitted { "*" } else { "" }
}

/// Escapes the characters that have a meaning in Markdown.
fn plain(text: &str) -> String {
    text.replace('*', "\\*").replace('_', "\\_").replace('<', "\\<")
}

/// Escapes text for a cell of a table, which `|` would end.
fn cell(text: &str) -> String {
    plain(text).replace('|', "\\|")
}

#[cfg(test)]
mod tests {
    use super::super::{Case, Claim, Finding, Report, Verdict};
    use resonarm_dynamics::structure::Preset;

    fn finding(preset: Preset, verdicts: &[Verdict]) -> Finding {
        let cases = verdicts.iter().enumerate().map(|(k, verdict)| Case {
            at: format!("{k} N"),
            verdict: *verdict,
            value: String::from("1.00 Hz"),
            numbers: Vec::new(),
        });
        Finding { preset, verdict: super::super::verdict(verdicts), over: "forces", own: 1, cases: cases.collect() }
    }

    #[test]
    fn the_share_of_the_cases_and_the_missing_ones_are_stated() {
        use Verdict::{DoesNotHold as Not, Holds, NotComputed as Unknown};
        let value = |verdicts: &[Verdict]| {
            let finding = finding(Preset::Irb1600Table1, verdicts);
            format!("{}: {}", finding.verdict.words(), finding.value())
        };
        insta::assert_snapshot!(value(&[Holds, Holds, Unknown]), @"holds: 2 of 3 forces; not computed: 1 (2 N). At 1 N: 1.00 Hz");
        insta::assert_snapshot!(value(&[Holds, Unknown, Unknown]), @"holds in part: 1 of 3 forces (0 N); not computed: 2 (1 N; 2 N). At 1 N: 1.00 Hz");
        insta::assert_snapshot!(value(&[Holds, Not, Unknown]), @"holds in part: 1 of 3 forces (0 N); not computed: 1 (2 N). At 1 N: 1.00 Hz");
        insta::assert_snapshot!(value(&[Not, Not, Unknown]), @"does not hold: 0 of 3 forces; not computed: 1 (2 N). At 1 N: 1.00 Hz");
        insta::assert_snapshot!(value(&[Not, Unknown, Unknown]), @"undecided: 0 of 3 forces; not computed: 2 (1 N; 2 N). At 1 N: 1.00 Hz");
        insta::assert_snapshot!(value(&[Unknown, Unknown]), @"not computed: 0 of 2 forces; not computed: 2 (0 N; 1 N). At 1 N: 1.00 Hz");
    }

    #[test]
    fn markdown_is_a_table_and_no_text_breaks_it() {
        let findings = Preset::ALL.map(|preset| finding(preset, &[Verdict::Holds, Verdict::DoesNotHold])).to_vec();
        let id = "name";
        let section = "4";
        let statement = "It grows with |β2|.";
        let claim =
            |chosen_for| Claim { id, section, statement, rule: "|x| < 1", chosen_for, findings: findings.clone() };
        insta::assert_snapshot!(Report { claims: vec![claim(true), claim(false)] }.markdown(), @r"
        | Section | Statement | `irb1600-table1` | `irb1600-fitted` |
        |---|---|---|---|
        | 4 | It grows with \|β2\|. | holds in part, 1 of 2 forces | holds in part\*, 1 of 2 forces |
        | 4 | It grows with \|β2\|. | holds in part, 1 of 2 forces | holds in part, 1 of 2 forces |

        \* I\_S2 of irb1600-fitted was chosen so that this statement holds, so that the agreement is no evidence.

        - irb1600-table1: of 2 statements 2 in part.
        - irb1600-fitted: of 2 statements 2 in part; without those that it was fitted to, of 1 statements 1 in part.

        **`name`** (Section 4): It grows with |β2|. Holds if |x| \< 1.

        - `irb1600-table1` holds in part: 1 of 2 forces (0 N). At 1 N: 1.00 Hz
        - `irb1600-fitted` holds in part: 1 of 2 forces (0 N). At 1 N: 1.00 Hz

        **`name`** (Section 4): It grows with |β2|. Holds if |x| \< 1.

        - `irb1600-table1` holds in part: 1 of 2 forces (0 N). At 1 N: 1.00 Hz
        - `irb1600-fitted` holds in part: 1 of 2 forces (0 N). At 1 N: 1.00 Hz
        ");
    }
}
