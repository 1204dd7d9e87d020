//! The report as text and as Markdown.

use core::fmt::Write;

use super::{Claim, Finding, Report, Verdict};
use crate::arm::Preset;

/// More labels of cases than this are not listed.
const LISTED: usize = 7;

impl Finding {
    fn count(&self, verdict: Verdict) -> usize {
        self.cases.iter().filter(|case| case.verdict == verdict).count()
    }

    /// In how many of the cases the statement holds, and in which; empty if nothing is left open.
    fn share(&self) -> String {
        if self.over.is_empty() {
            return String::new();
        }
        let (holds, unknown) = (self.count(Verdict::Holds), self.count(Verdict::NotComputed));
        let mut text = format!("{holds} of {} {}", self.cases.len(), self.over);
        let of_holding = self.cases.iter().filter(|case| case.verdict == Verdict::Holds);
        if self.verdict == Verdict::HoldsInPart && holds <= LISTED {
            let labels: Vec<&str> = of_holding.map(|case| case.at.as_str()).collect();
            let _infallible = write!(text, " ({})", labels.join("; "));
        }
        if unknown > 0 {
            let _infallible = write!(text, ", {unknown} not computed");
        }
        text
    }

    /// What was computed: the share of the cases, and the numbers of the figures' own.
    pub fn value(&self) -> String {
        let Some(own) = self.cases.get(self.own) else { return String::new() };
        if self.over.is_empty() { own.value.clone() } else { format!("{}. {}: {}", self.share(), own.at, own.value) }
    }
}

impl Report {
    fn findings(&self, preset: Preset) -> impl Iterator<Item = (&Claim, &Finding)> {
        let of = move |claim: &'_ Claim| claim.findings.iter().position(|finding| finding.preset == preset);
        self.claims.iter().filter_map(move |claim| Some((claim, &claim.findings[of(claim)?])))
    }

    /// How many statements hold for a preset, in words.
    fn summary(&self, preset: Preset) -> String {
        let count = |verdict, all: bool| {
            let of = self.findings(preset).filter(|(claim, _)| all || !claim.chosen_for);
            of.filter(|(_, finding)| finding.verdict == verdict).count()
        };
        let words = |all: bool, total: usize| {
            let [holds, part, not, unknown] =
                [Verdict::Holds, Verdict::HoldsInPart, Verdict::DoesNotHold, Verdict::NotComputed]
                    .map(|v| count(v, all));
            let unknown = if unknown > 0 { format!(", {unknown} not computed") } else { String::new() };
            format!("of {total} statements {holds} hold, {part} in part, {not} not{unknown}")
        };
        let free = self.claims.iter().filter(|claim| !claim.chosen_for).count();
        let chosen = match preset {
            Preset::Irb1600Fitted => format!("; without those that I_S2 was chosen for, {}", words(false, free)),
            Preset::Irb1600Table1 => String::new(),
        };
        format!("{preset}: {}{chosen}", words(true, self.claims.len()))
    }

    /// A paragraph for each claim.
    pub fn text(&self) -> String {
        let mut text = String::new();
        for claim in &self.claims {
            let Claim { id, section, statement, rule, .. } = claim;
            let _infallible = writeln!(text, "{id} (Section {section})\n  {statement}\n  Rule: {rule}.");
            for finding in &claim.findings {
                let (name, verdict) = (finding.preset.name(), finding.verdict.words());
                let _infallible = writeln!(text, "    {name} {verdict:13}{} {}", mark(claim, finding), finding.value());
            }
        }
        let _infallible = writeln!(text, "{NOTE}");
        for preset in Preset::ALL {
            let _infallible = writeln!(text, "{}", self.summary(preset));
        }
        text
    }

    /// A table, a row for each claim, with the rule and what was computed for both presets.
    pub fn markdown(&self) -> String {
        let mut text = String::from("| Section | Statement | Holds if |");
        for preset in Preset::ALL {
            let _infallible = write!(text, " `{preset}` |");
        }
        text.push_str("\n|---|---|---|---|---|\n");
        for claim in &self.claims {
            let _infallible = write!(text, "| {} | {} | {} |", claim.section, claim.statement, claim.rule);
            for finding in &claim.findings {
                let (verdict, mark) = (finding.verdict.words(), mark(claim, finding).trim());
                let _infallible = write!(text, " **{verdict}**{mark} {} |", finding.value());
            }
            text.push('\n');
        }
        let _infallible = writeln!(text, "\n{NOTE}\n");
        for preset in Preset::ALL {
            let _infallible = writeln!(text, "- {}.", self.summary(preset));
        }
        text
    }
}

const NOTE: &str = "* I_S2 of irb1600-fitted was chosen so that this holds.";

fn mark(claim: &Claim, finding: &Finding) -> &'static str {
    if claim.chosen_for && finding.preset == Preset::Irb1600Fitted { "*" } else { " " }
}
