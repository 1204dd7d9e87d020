//! Section 3: the linear arm.

use super::super::{PaperError, Settings, Subject};
use super::{Judgement, number};
use crate::analysis::modes;

/// f1 and f2 at a pose, Hz.
fn frequencies(subject: &Subject, beta2_deg: f64) -> Result<[f64; 2], PaperError> {
    Ok(modes(&subject.bent(beta2_deg)?).map(|mode| mode.frequency_hz))
}

pub(super) fn depend_on_pose(subject: &Subject, _: &Settings) -> Result<Judgement, PaperError> {
    let all = (-180..=180).map(|beta2_deg| frequencies(subject, f64::from(beta2_deg)));
    let all = all.collect::<Result<Vec<_>, _>>()?;
    let ends = |mode: usize| {
        let of = all.iter().map(|frequencies| frequencies[mode]);
        of.fold((f64::INFINITY, 0.0_f64), |(low, high), hz| (low.min(hz), high.max(hz)))
    };
    let [first, second] = [ends(0), ends(1)];
    Ok(Judgement {
        holds: first.1 > 1.1 * first.0 && second.1 > 1.1 * second.0,
        value: format!("f1 {:.2} to {:.2} Hz, f2 {:.2} to {:.2} Hz", first.0, first.1, second.0, second.1),
        numbers: vec![number("f1", first.1 / first.0, ""), number("f2", second.1 / second.0, "")],
    })
}

pub(super) fn symmetric(subject: &Subject, _: &Settings) -> Result<Judgement, PaperError> {
    let mut largest = 0.0_f64;
    for beta2_deg in 0..=180 {
        let [up, down] = [1.0, -1.0].map(|sign| frequencies(subject, sign * f64::from(beta2_deg)));
        for (up, down) in up?.into_iter().zip(down?) {
            largest = largest.max((up / down - 1.0).abs());
        }
    }
    let value = format!("largest difference {largest:.0e}");
    Ok(Judgement { holds: largest < 1e-12, value, numbers: vec![number("relative difference", largest, "")] })
}

pub(super) fn within_the_range(subject: &Subject, settings: &Settings) -> Result<Judgement, PaperError> {
    let end_hz = settings.range_hz[1];
    let mut numbers = Vec::new();
    for beta2_deg in &settings.figure4.beta2_deg {
        let highest = frequencies(subject, *beta2_deg)?[1];
        numbers.push(number(format!("f2 at {beta2_deg}°"), highest, "Hz"));
    }
    let inside = numbers.iter().filter(|highest| highest.value < end_hz).count();
    let listed: Vec<String> = numbers.iter().map(|highest| format!("{:.1}", highest.value)).collect();
    let value = format!("{inside} of {} poses; f2 {} Hz", numbers.len(), listed.join(", "));
    Ok(Judgement { holds: inside == numbers.len(), value, numbers })
}
