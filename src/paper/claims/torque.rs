//! Section 4, Figs. 4 and 5: the arm driven by a torque at joint 1.

use super::super::figure::zone_hz;
use super::super::{Drive, ForcedBranch, PaperError, Settings, Subject};
use super::{Judgement, Number, number};
use crate::analysis::{BifurcationKind, modes};

/// Both zones at a pose, each under its torque of Fig. 4.
fn zones(subject: &Subject, settings: &Settings, beta2_deg: f64) -> Result<[ForcedBranch; 2], PaperError> {
    let (four, preset, arm) = (&settings.figure4, subject.preset(), subject.bent(beta2_deg)?);
    let natural = modes(&arm);
    let zone = |mode: usize, torque_nm: f64| {
        ForcedBranch::over_frequency(subject, &arm, (Drive::Torque1, torque_nm), zone_hz(natural[mode].frequency_hz))
    };
    Ok([zone(0, *four.torque_nm.of(preset))?, zone(1, *four.second_zone_torque_nm.of(preset))?])
}

/// All frequencies.
const ALL_HZ: [f64; 2] = [0.0, f64::INFINITY];

pub(super) fn zones_draw_together(subject: &Subject, settings: &Settings) -> Result<Judgement, PaperError> {
    let mut numbers: Vec<Number> = Vec::new();
    for &beta2_deg in &settings.figure4.beta2_deg {
        let [first, second] = zones(subject, settings, beta2_deg)?;
        let apart = second.peak(0, ALL_HZ)?.frequency_hz - first.peak(0, ALL_HZ)?.frequency_hz;
        numbers.push(number(format!("peaks at {beta2_deg}°"), apart, "Hz"));
    }
    let listed: Vec<String> = numbers.iter().map(|apart| format!("{:.2}", apart.value)).collect();
    let holds = numbers.windows(2).all(|pair| pair[1].value < pair[0].value);
    Ok(Judgement { holds, value: format!("{} Hz apart", listed.join(", ")), numbers })
}

pub(super) fn symmetric(subject: &Subject, settings: &Settings) -> Result<Judgement, PaperError> {
    let mut largest = 0.0_f64;
    let mut compared = 0;
    for beta2_deg in settings.figure4.beta2_deg.iter().copied().filter(|beta2_deg| *beta2_deg != 0.0) {
        let [down, up] = [zones(subject, settings, beta2_deg)?, zones(subject, settings, -beta2_deg)?];
        for (down, up) in down.iter().zip(&up) {
            let places = |branch: &ForcedBranch| -> Result<Vec<[f64; 2]>, PaperError> {
                let folds = branch.bifurcations(BifurcationKind::Fold).chain([branch.peak(0, ALL_HZ)?]);
                Ok(folds.map(|motion| [motion.frequency_hz, motion.amplitude_rad[0]]).collect())
            };
            let (down, up) = (places(down)?, places(up)?);
            // Another number of folds is a difference of its own.
            largest = if down.len() == up.len() { largest } else { f64::INFINITY };
            compared += down.len();
            for (down, up) in down.as_flattened().iter().zip(up.as_flattened()) {
                largest = largest.max((up / down - 1.0).abs());
            }
        }
    }
    Ok(Judgement {
        holds: largest < 1e-9,
        value: format!("{compared} peaks and folds, differences below {}", if largest < 1e-9 { "1e-9" } else { "1" }),
        numbers: vec![number("relative difference", largest, "")],
    })
}

pub(super) fn folds_over_the_torque(subject: &Subject, settings: &Settings) -> Result<Judgement, PaperError> {
    let (five, preset) = (&settings.figure5, subject.preset());
    let largest_nm = *five.largest_torque_nm.of(preset);
    let (mut numbers, mut listed) = (Vec::new(), Vec::new());
    for &beta2_deg in five.beta2_deg.of(preset) {
        let arm = subject.bent(beta2_deg)?;
        let branch = ForcedBranch::over_amplitude(subject, &arm, (Drive::Torque1, largest_nm), five.frequency_hz)?;
        let folds: Vec<f64> = branch.bifurcations(BifurcationKind::Fold).map(|fold| fold.excitation).collect();
        let words: Vec<String> = folds.iter().map(|torque_nm| format!("{torque_nm:.1}")).collect();
        listed.push(match words.as_slice() {
            [] => format!("{beta2_deg}° none"),
            words => format!("{beta2_deg}° at {} N·m", words.join(", ")),
        });
        numbers.extend(folds.iter().map(|torque_nm| number(format!("fold at {beta2_deg}°"), *torque_nm, "N·m")));
    }
    let differ = numbers.windows(2).any(|pair| pair[0].of != pair[1].of && pair[0].value != pair[1].value);
    Ok(Judgement { holds: differ, value: listed.join("; "), numbers })
}

pub(super) fn largest_ratio(subject: &Subject, settings: &Settings) -> Result<Judgement, PaperError> {
    let mut numbers = Vec::new();
    for &beta2_deg in &settings.figure4.beta2_deg {
        for (zone, branch) in zones(subject, settings, beta2_deg)?.iter().enumerate() {
            let (ratio, _) = branch.largest_ratio(0);
            numbers.push(number(format!("zone {} at {beta2_deg}°", zone + 1), ratio, ""));
        }
    }
    let [first, second] = [0, 1].map(|zone| {
        let of_zone = numbers.iter().skip(zone).step_by(2);
        let listed: Vec<String> = of_zone.map(|ratio| format!("{:.1}", ratio.value)).collect();
        listed.join(", ")
    });
    let holds = numbers.iter().any(|ratio| ratio.value >= 6.0);
    Ok(Judgement { holds, value: format!("zone 1: {first}; zone 2: {second} times"), numbers })
}
