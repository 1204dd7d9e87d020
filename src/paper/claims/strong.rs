//! Section 6: bifurcations beyond folds, under strong excitation.

use super::super::{Drive, ForcedBranch, PaperError, Settings, Subject};
use super::{Judgement, Number, number};
use crate::analysis::BifurcationKind;

/// The branch through the first zone.
fn branch(subject: &Subject, settings: &Settings) -> Result<ForcedBranch, PaperError> {
    let (strong, preset) = (&settings.strong, subject.preset());
    let arm = subject.bent(strong.beta2_deg)?;
    let torque = (Drive::Torque1, *strong.torque_nm.of(preset));
    ForcedBranch::over_frequency(subject, &arm, torque, *strong.range_hz.of(preset))
}

fn places(branch: &ForcedBranch, kind: BifurcationKind) -> Vec<Number> {
    branch.bifurcations(kind).map(|motion| number(kind.name(), motion.frequency_hz, "Hz")).collect()
}

fn words(places: &[Number]) -> String {
    let listed: Vec<String> = places.iter().map(|place| format!("{:.3}", place.value)).collect();
    if listed.is_empty() { String::from("none") } else { format!("{} Hz", listed.join(", ")) }
}

pub(super) fn period_doubling(subject: &Subject, settings: &Settings) -> Result<Judgement, PaperError> {
    let branch = branch(subject, settings)?;
    let (folds, doublings) = (places(&branch, BifurcationKind::Fold), places(&branch, BifurcationKind::PeriodDoubling));
    let value = format!("{} saddle-nodes; period doublings: {}", folds.len(), words(&doublings));
    let holds = !folds.is_empty() && !doublings.is_empty();
    Ok(Judgement { holds, value, numbers: [folds, doublings].concat() })
}

pub(super) fn neimark_sacker(subject: &Subject, settings: &Settings) -> Result<Judgement, PaperError> {
    let numbers = places(&branch(subject, settings)?, BifurcationKind::NeimarkSacker);
    Ok(Judgement { holds: !numbers.is_empty(), value: words(&numbers), numbers })
}
