//! The report as text and as Markdown.

use core::fmt::Write;

use super::{Claim, Report, Verdict};
use crate::arm::Preset;

impl Report {
    /// A paragraph for each claim.
    pub fn text(&self) -> String {
        let mut text = String::new();
        for claim in &self.claims {
            let Claim { id, section, statement, .. } = claim;
            let _infallible = writeln!(text, "{id} (Section {section})\n  {statement}");
            for finding in &claim.findings {
                let _infallible =
                    writeln!(text, "    {:15} {:14} {}", finding.preset.name(), finding.verdict.words(), finding.value);
            }
        }
        let count = |preset: Preset| {
            let all = self.claims.iter().flat_map(|claim| &claim.findings);
            all.filter(|finding| finding.preset == preset && finding.verdict == Verdict::Holds).count()
        };
        for preset in Preset::ALL {
            let _infallible = writeln!(text, "{preset}: {} of {} hold", count(preset), self.claims.len());
        }
        text
    }

    /// A table, a row for each claim, with the criterion and what was computed for both presets.
    pub fn markdown(&self) -> String {
        let mut text = String::from("| Section | Statement | Judged by |");
        for preset in Preset::ALL {
            let _infallible = write!(text, " `{preset}` |");
        }
        text.push_str("\n|---|---|---|---|---|\n");
        for claim in &self.claims {
            let _infallible = write!(text, "| {} | {} | {} |", claim.section, claim.statement, claim.criterion);
            for finding in &claim.findings {
                let _infallible = write!(text, " **{}**: {} |", finding.verdict.words(), finding.value);
            }
            text.push('\n');
        }
        text
    }
}
