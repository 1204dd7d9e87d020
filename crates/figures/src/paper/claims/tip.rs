//! Sections 4 and 5, Figs. 7 and 9: the arm driven by a force along x at the tip.

use super::cases::{Judgement, Opinion, all_hold, number};
use super::survey::{Driven, Seen, Survey, Zone, forces_n};
use super::{Number, enough};
use resonarm_analysis::Bending;

/// "Significantly greater", and "so small" in comparison: at least twice.
const SIGNIFICANT: f64 = 2.0;

/// Returns the peak of a link (0 or 1) in one zone over that in the other.
fn peak_ratio(survey: &Survey<'_>, driven: Driven, beta2_deg: f64, link: usize, zones: [usize; 2]) -> Seen<f64> {
    let peak = |mode| Seen::Ok(survey.zone(driven, beta2_deg, mode)?.peak(link)?.amplitude_rad);
    Ok(peak(zones[0])? / peak(zones[1])?)
}

/// Says whether a link moves significantly more in one zone than in the other, at each position of Fig. 7.
fn larger(survey: &Survey<'_>, link: usize, zones: [usize; 2]) -> Judgement {
    let seven = &survey.settings.figure7;
    survey.over_heights_and_forces(seven.force_n, |driven| {
        let seen: Vec<(f64, Seen<f64>)> =
            seven.beta2_deg.iter().map(|pose| (*pose, peak_ratio(survey, driven, *pose, link, zones))).collect();
        let holds = all_hold(seen.iter().map(|(_, ratio)| Ok(ratio.clone()? >= SIGNIFICANT)))?;
        let listed: Vec<String> = seen
            .iter()
            .map(|(pose, ratio)| match ratio {
                Ok(ratio) => format!("{pose}° {ratio:.2}"),
                Err(_) => format!("{pose}° ?"),
            })
            .collect();
        let numbers =
            seen.iter().filter_map(|(pose, ratio)| Some(number(format!("{pose}°"), *ratio.as_ref().ok()?, "")));
        Ok(Opinion::new(holds, format!("{} times", listed.join(", ")), numbers.collect()))
    })
}

/// "The vibration amplitudes of the first link are significantly greater in the first resonance zone than in the second
/// zone" (Section 4): the peak of link 1 is at least twice that in the second, at each position of Fig. 7.
pub(super) fn link1_in_the_first_zone(survey: &Survey<'_>) -> Judgement {
    larger(survey, 0, [0, 1])
}

/// "While the opposite is true for element 2" (Section 4): the same measure, the zones exchanged.
pub(super) fn link2_in_the_second_zone(survey: &Survey<'_>) -> Judgement {
    larger(survey, 1, [1, 0])
}

/// "The phenomenon of the slope of the characteristics […] is more clearly visible in the second resonance zone for
/// both elements" (Section 4): on the common axis the backbone of the second zone moves by more Hz than that of the
/// first, at each position of Fig. 7. Both links have the same backbone.
pub(super) fn second_zone_leans_more(survey: &Survey<'_>) -> Judgement {
    let seven = &survey.settings.figure7;
    survey.over_heights_and_forces(seven.force_n, |driven| {
        let shifts = |pose: f64| -> Seen<[f64; 2]> {
            Ok([survey.bent(driven, pose, 0)?.shift_hz, survey.bent(driven, pose, 1)?.shift_hz])
        };
        let holds = all_hold(
            seven.beta2_deg.iter().map(|pose| shifts(*pose).map(|[first, second]| second.abs() > first.abs())),
        )?;
        let mut listed = Vec::new();
        let mut numbers = Vec::new();
        for pose in &seven.beta2_deg {
            let Ok([first, second]) = shifts(*pose) else {
                listed.push(format!("{pose}° ?"));
                continue;
            };
            listed.push(format!("{pose}° {:.3} and {:.3}", first.abs(), second.abs()));
            numbers.push(number(format!("shift of zone 1 at {pose}°"), first, "Hz"));
            numbers.push(number(format!("shift of zone 2 at {pose}°"), second, "Hz"));
        }
        Ok(Opinion::new(holds, format!("{} Hz", listed.join(", ")), numbers))
    })
}

/// Says whether a width grows from each excitation to the next, as far as it can be computed. For a yes, enough must
/// have been computed; a single width that falls is a no.
pub(super) fn widening(excitations: &[f64], unit: &str, width: impl Fn(f64) -> Seen<f64>) -> Seen<Opinion> {
    let seen: Vec<Seen<f64>> = excitations.iter().map(|excitation| width(*excitation)).collect();
    // Up to the first that failed: beyond the gap a width would be compared with one that is not its neighbour.
    let computed = seen.iter().take_while(|width| width.is_ok()).count();
    let numbers: Vec<Number> = excitations
        .iter()
        .zip(seen.iter().flatten())
        .take(computed)
        .map(|(excitation, width)| number(format!("width at {excitation} {unit}"), *width, "Hz"))
        .collect();
    let grows = numbers.windows(2).all(|pair| pair[1].value > pair[0].value);
    if let (Some(Err(why)), true) = (seen.get(computed), grows && !enough(computed, seen.len())) {
        return Err(why.clone());
    }
    let listed: Vec<String> = numbers.iter().map(|width| format!("{:.4}", width.value)).collect();
    let ratio = numbers.last().zip(numbers.first()).map_or(f64::NAN, |(last, first)| last.value / first.value);
    let value =
        format!("{} Hz ({ratio:.2} times) under {}", listed.join(", "), computed_at(excitations, computed, unit));
    Ok(Opinion::new(grows, value, numbers))
}

/// Says under which excitations there are results, and under which there are none.
fn computed_at(excitations: &[f64], computed: usize, unit: &str) -> String {
    let words = |excitations: &[f64]| excitations.iter().map(f64::to_string).collect::<Vec<_>>().join(", ");
    let (seen, rest) = excitations.split_at(computed);
    let missing = if rest.is_empty() { String::new() } else { format!(", not computed: {} {unit}", words(rest)) };
    format!("{} {unit}{missing}", words(seen))
}

/// The widening of a zone for a link in the position of Figs. 7c and d.
fn widens(survey: &Survey<'_>, mode: usize, link: usize) -> Judgement {
    let beta2_deg = survey.settings.figure7.detail_beta2_deg;
    survey.over_heights(|height_m| {
        let width = |n: f64| survey.zone(Driven::Force { n, height_m }, beta2_deg, mode)?.width_hz(link);
        widening(&forces_n(survey.settings), "N", width)
    })
}

/// "As a result of the simultaneous slope of the characteristic and the increase in vibration amplitude, there is a
/// significant widening of the second resonance zone" (Section 4, Fig. 7c): the half-power width of link 1 grows from
/// each force to the next.
pub(super) fn second_zone_widens(survey: &Survey<'_>) -> Judgement {
    widens(survey, 1, 0)
}

/// "As the excitation amplitude increases, two maxima appear and the resonance zone widens" (Section 4, Fig. 7d, first
/// zone), the second half: the half-power width of link 2 grows from each force to the next.
pub(super) fn first_zone_widens(survey: &Survey<'_>) -> Judgement {
    widens(survey, 0, 1)
}

/// A maximum visible in a figure: the curve falls by this fraction of its height on both sides.
pub(super) const PROMINENCE: f64 = 0.05;

/// The first half of the same sentence: the amplitude of link 2 has one maximum along the branch under the smallest
/// force, and two or more under the largest that can be computed.
pub(super) fn second_maximum(survey: &Survey<'_>) -> Judgement {
    let beta2_deg = survey.settings.figure7.detail_beta2_deg;
    survey.over_heights(|height_m| {
        let forces = forces_n(survey.settings);
        let zones = forces.iter().map(|n| survey.zone(Driven::Force { n: *n, height_m }, beta2_deg, 0));
        let zones: Vec<Seen<&Zone>> = zones.collect();
        let computed = zones.iter().take_while(|zone| zone.is_ok()).count();
        if let (Some(Err(why)), false) = (zones.get(computed), enough(computed, zones.len())) {
            return Err(why.clone());
        }
        let mut counts = Vec::new();
        let mut seconds = Vec::new();
        let mut numbers = Vec::new();
        for (n, zone) in forces.iter().zip(zones.iter().flatten()).take(computed) {
            // The maxima come by their height, and the second highest need not be the second most prominent.
            let mut prominences: Vec<f64> = zone.maxima[1].iter().map(|maximum| maximum.prominence).collect();
            prominences.sort_by(|a, b| b.total_cmp(a));
            let second = prominences.get(1).copied().unwrap_or(0.0);
            counts.push(prominences.iter().filter(|prominence| **prominence >= PROMINENCE).count());
            seconds.push(format!("{:.1}", 100.0 * second));
            numbers.push(number(format!("prominence of the second maximum at {n} N"), second, ""));
        }
        let holds = counts.first() == Some(&1) && counts.last().is_some_and(|count| *count > 1);
        let under = computed_at(&forces, computed, "N");
        let value = format!("second maximum of prominence {} % under {under}", seconds.join(", "));
        Ok(Opinion::new(holds, value, numbers))
    })
}

/// "The excitation frequency was variable in the range 26–46 Hz in order to excite resonant vibrations in the robot in
/// the two expected resonance zones" (Section 5): the peaks of link 1 in the first zone and of link 2 in the second are
/// in this range.
pub(super) fn both_zones_measured(survey: &Survey<'_>) -> Judgement {
    let nine = &survey.settings.figure9;
    survey.over_heights_and_forces(nine.force_n, |driven| {
        let peak_hz = |mode| Seen::Ok(survey.zone(driven, nine.beta2_deg, mode)?.peak(mode)?.frequency_hz);
        let peaks_hz = [peak_hz(0)?, peak_hz(1)?];
        let holds = peaks_hz.iter().all(|hz| (nine.range_hz[0]..=nine.range_hz[1]).contains(hz));
        let numbers = vec![number("zone 1", peaks_hz[0], "Hz"), number("zone 2", peaks_hz[1], "Hz")];
        Ok(Opinion::new(holds, format!("{:.2} and {:.2} Hz", peaks_hz[0], peaks_hz[1]), numbers))
    })
}

/// "In the first resonance zone there are soft resonance curves, while in the second resonance zone there are stiff
/// resonance curves" (Section 5, β2 = 120°): the backbones up to the force.
pub(super) fn soft_then_stiff(survey: &Survey<'_>) -> Judgement {
    let nine = &survey.settings.figure9;
    survey.over_heights_and_forces(nine.force_n, |driven| {
        let bent = |mode| survey.bent(driven, nine.beta2_deg, mode);
        let first = bent(0)?;
        let second = bent(1)?;
        let holds = first.bending == Some(Bending::Softening) && second.bending == Some(Bending::Hardening);
        let numbers =
            vec![number("shift of zone 1", first.shift_hz, "Hz"), number("shift of zone 2", second.shift_hz, "Hz")];
        Ok(Opinion::new(holds, format!("{}, {}", first.words(), second.words()), numbers))
    })
}

/// "As for the first resonance zone for link 2, the vibration amplitudes are so small that it is difficult to observe a
/// clear nonlinear effect" (Section 5): the peak of link 2 there is at most half of that in the second zone.
pub(super) fn link2_small_in_the_first_zone(survey: &Survey<'_>) -> Judgement {
    let nine = &survey.settings.figure9;
    survey.over_heights_and_forces(nine.force_n, |driven| {
        let ratio = peak_ratio(survey, driven, nine.beta2_deg, 1, [0, 1])?;
        let numbers = vec![number("zone 1 over zone 2", ratio, "")];
        Ok(Opinion::new(ratio * SIGNIFICANT <= 1.0, format!("{ratio:.2} times"), numbers))
    })
}
