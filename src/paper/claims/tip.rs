//! Sections 4 and 5, Figs. 7 and 9: the arm driven by a force along x at the tip.

use super::super::figure::zone_hz;
use super::super::{Drive, ForcedBranch, PaperError, Settings, Subject};
use super::bending::bent;
use super::{Judgement, Number, number};
use crate::analysis::{Bending, modes};

/// A zone (0 or 1) with the tip on the line, under a force.
fn zone(subject: &Subject, beta2_deg: f64, mode: usize, force_n: f64) -> Result<ForcedBranch, PaperError> {
    let arm = subject.on_line(beta2_deg)?;
    let range_hz = zone_hz(modes(&arm)[mode].frequency_hz);
    ForcedBranch::over_frequency(subject, &arm, (Drive::ForceX, force_n), range_hz)
}

/// All frequencies.
const ALL_HZ: [f64; 2] = [0.0, f64::INFINITY];

/// The peak of a link in one zone over that in the other, at each position of Fig. 7.
fn peak_ratios(
    subject: &Subject,
    settings: &Settings,
    link: usize,
    zones: [usize; 2],
) -> Result<Vec<Number>, PaperError> {
    let seven = &settings.figure7;
    let ratio = |beta2_deg: &f64| {
        let peak = |mode| -> Result<f64, PaperError> {
            Ok(zone(subject, *beta2_deg, mode, seven.force_n)?.peak(link, ALL_HZ)?.amplitude_rad[link])
        };
        Ok(number(format!("{beta2_deg}°"), peak(zones[0])? / peak(zones[1])?, ""))
    };
    seven.beta2_deg.iter().map(ratio).collect()
}

fn ratios_judged(numbers: Vec<Number>, least: f64) -> Judgement {
    let listed: Vec<String> = numbers.iter().map(|ratio| format!("{} {:.2}", ratio.of, ratio.value)).collect();
    Judgement {
        holds: numbers.iter().all(|ratio| ratio.value > least),
        value: format!("{} times", listed.join(", ")),
        numbers,
    }
}

pub(super) fn link1_in_the_first_zone(subject: &Subject, settings: &Settings) -> Result<Judgement, PaperError> {
    Ok(ratios_judged(peak_ratios(subject, settings, 0, [0, 1])?, 2.0))
}

pub(super) fn link2_in_the_second_zone(subject: &Subject, settings: &Settings) -> Result<Judgement, PaperError> {
    Ok(ratios_judged(peak_ratios(subject, settings, 1, [1, 0])?, 1.0))
}

pub(super) fn second_zone_leans_more(subject: &Subject, settings: &Settings) -> Result<Judgement, PaperError> {
    let seven = &settings.figure7;
    let (mut numbers, mut listed, mut holds) = (Vec::new(), Vec::new(), true);
    for &beta2_deg in &seven.beta2_deg {
        let natural = modes(&subject.on_line(beta2_deg)?);
        let lean = |mode: usize| -> Result<f64, PaperError> {
            let peak_hz = zone(subject, beta2_deg, mode, seven.force_n)?.peak(mode, ALL_HZ)?.frequency_hz;
            let (f, zeta) = (natural[mode].frequency_hz, natural[mode].damping_ratio);
            Ok((peak_hz - f).abs() / (2.0 * zeta * f))
        };
        let leans = [lean(0)?, lean(1)?];
        holds &= leans[1] > leans[0];
        listed.push(format!("{beta2_deg}° {:.1} and {:.1}", leans[0], leans[1]));
        let of_zone =
            |zone: usize| number(format!("zone {} at {beta2_deg}°", zone + 1), leans[zone], "half-power widths");
        numbers.extend([of_zone(0), of_zone(1)]);
    }
    Ok(Judgement { holds, value: format!("{} widths", listed.join(", ")), numbers })
}

/// Half-power widths of a link in a zone at the detailed position, under each of the forces.
fn widths(branches: &[(f64, ForcedBranch)], link: usize) -> Result<Vec<Number>, PaperError> {
    let width = |(force_n, branch): &(f64, ForcedBranch)| {
        Ok(number(format!("width at {force_n} N"), branch.half_power_width_hz(link, ALL_HZ)?, "Hz"))
    };
    branches.iter().map(width).collect()
}

fn grow(numbers: &[Number]) -> bool {
    numbers.windows(2).all(|pair| pair[1].value > pair[0].value)
}

fn under_forces(
    subject: &Subject,
    settings: &Settings,
    mode: usize,
    forces_n: &[f64],
) -> Result<Vec<(f64, ForcedBranch)>, PaperError> {
    let beta2_deg = settings.figure7.detail_beta2_deg;
    forces_n.iter().map(|force_n| Ok((*force_n, zone(subject, beta2_deg, mode, *force_n)?))).collect()
}

fn listed(numbers: &[Number]) -> String {
    let listed: Vec<String> = numbers.iter().map(|width| format!("{:.4}", width.value)).collect();
    listed.join(", ")
}

fn forces_in_words(forces_n: &[f64]) -> String {
    let listed: Vec<String> = forces_n.iter().map(f64::to_string).collect();
    format!("{} N", listed.join(", "))
}

pub(super) fn second_zone_widens(subject: &Subject, settings: &Settings) -> Result<Judgement, PaperError> {
    let forces_n = settings.figure7.second_zone_force_n.of(subject.preset());
    let numbers = widths(&under_forces(subject, settings, 1, forces_n)?, 0)?;
    let value = format!("{} Hz under {}", listed(&numbers), forces_in_words(forces_n));
    Ok(Judgement { holds: grow(&numbers), value, numbers })
}

/// A maximum stands out if the amplitude falls by this share on both of its sides.
const PROMINENCE: f64 = 0.01;

pub(super) fn second_maximum(subject: &Subject, settings: &Settings) -> Result<Judgement, PaperError> {
    let forces_n = settings.figure7.first_zone_force_n.of(subject.preset());
    let branches = under_forces(subject, settings, 0, forces_n)?;
    let counts: Vec<usize> = branches.iter().map(|(_, branch)| branch.maxima(1, PROMINENCE).len()).collect();
    let more = counts.first() == Some(&1) && counts.last().is_some_and(|count| *count > 1);
    let mut numbers = widths(&branches, 1)?;
    let holds = more && grow(&numbers);
    let words: Vec<String> = counts.iter().map(usize::to_string).collect();
    let value =
        format!("{} maxima, width {} Hz under {}", words.join(", "), listed(&numbers), forces_in_words(forces_n));
    let maxima = forces_n
        .iter()
        .zip(&counts)
        .map(|(force_n, count)| number(format!("maxima at {force_n} N"), *count as f64, ""));
    numbers.extend(maxima);
    Ok(Judgement { holds, value, numbers })
}

pub(super) fn both_zones_measured(subject: &Subject, settings: &Settings) -> Result<Judgement, PaperError> {
    let nine = &settings.figure9;
    let peak = |mode: usize| -> Result<f64, PaperError> {
        Ok(zone(subject, nine.beta2_deg, mode, nine.force_n)?.peak(mode, ALL_HZ)?.frequency_hz)
    };
    let peaks = [peak(0)?, peak(1)?];
    Ok(Judgement {
        holds: peaks.iter().all(|hz| (nine.range_hz[0]..=nine.range_hz[1]).contains(hz)),
        value: format!("{:.2} and {:.2} Hz", peaks[0], peaks[1]),
        numbers: vec![number("zone 1", peaks[0], "Hz"), number("zone 2", peaks[1], "Hz")],
    })
}

pub(super) fn soft_then_stiff(subject: &Subject, settings: &Settings) -> Result<Judgement, PaperError> {
    let nine = &settings.figure9;
    let arm = subject.on_line(nine.beta2_deg)?;
    let bent = |mode| bent(subject, &arm, mode, (Drive::ForceX, nine.force_n));
    let (first, second) = (bent(0)?, bent(1)?);
    let peak = |mode| -> Result<f64, PaperError> {
        Ok(zone(subject, nine.beta2_deg, mode, nine.force_n)?.peak(1, ALL_HZ)?.amplitude_rad[1])
    };
    let ratio = peak(0)? / peak(1)?;
    let bends = first.bending == Some(Bending::Softening) && second.bending == Some(Bending::Hardening);
    Ok(Judgement {
        holds: bends && ratio < 0.5,
        value: format!("{}, {}; link 2 {ratio:.2} times", first.words(), second.words()),
        numbers: vec![
            number("shift of zone 1", first.shift_hz, "Hz"),
            number("shift of zone 2", second.shift_hz, "Hz"),
            number("link 2, zone 1 over zone 2", ratio, ""),
        ],
    })
}
