//! Sections 4 and 6, Figs. 4 and 5: the arm driven by a torque at joint 1.

use core::ops::Range;

use super::cases::{Judgement, Opinion, all_hold, number, once, over};
use super::enough;
use super::survey::{Driven, Seen, Survey, own_torque_nm, torques_nm};
use super::tip::{PROMINENCE, widening};
use crate::paper::branch::{Drive, Traced, natural_hz, zone_hz};
use crate::paper::error::PaperError;
use resonarm_analysis::BifurcationKind;

/// Returns the frequency of the peak of link 1 at a pose, Hz.
fn peak_hz(survey: &Survey<'_>, driven: Driven, beta2_deg: f64, mode: usize) -> Seen<f64> {
    Ok(survey.zone(driven, beta2_deg, mode)?.peak(0)?.frequency_hz)
}

/// Says whether a number falls from each pose of Fig. 4 to the next, and the numbers in words.
fn falls(survey: &Survey<'_>, of: impl Fn(f64) -> Seen<f64>, name: &str) -> Seen<Opinion> {
    let seen: Vec<(f64, Seen<f64>)> =
        survey.settings.figure4.beta2_deg.iter().map(|beta2_deg| (*beta2_deg, of(*beta2_deg))).collect();
    let holds = all_hold(seen.windows(2).map(|pair| Ok(pair[1].1.clone()? < pair[0].1.clone()?)))?;
    let listed: Vec<String> =
        seen.iter().map(|(_, hz)| hz.as_ref().map_or(String::from("?"), |hz| format!("{hz:.2}"))).collect();
    let numbers = seen
        .iter()
        .filter_map(|(beta2_deg, hz)| hz.as_ref().ok().map(|hz| number(format!("{name} at {beta2_deg}°"), *hz, "Hz")));
    Ok(Opinion::new(holds, format!("{} Hz", listed.join(", ")), numbers.collect()))
}

/// "In a nonlinear system the resonance zones move closer together as the absolute value of angle β2 increases"
/// (Section 4): the distance between the peaks of link 1 falls from each pose of Fig. 4 to the next.
pub(super) fn zones_draw_together(survey: &Survey<'_>) -> Judgement {
    survey.over_torques(0, |driven| {
        let apart = |beta2_deg| Ok(peak_hz(survey, driven, beta2_deg, 1)? - peak_hz(survey, driven, beta2_deg, 0)?);
        falls(survey, apart, "peaks apart")
    })
}

/// "As the angle β2 increases […] the curves shift towards lower frequencies" (Section 4, of the second zone): the peak
/// of link 1 falls from each pose of Fig. 4 to the next.
pub(super) fn second_zone_shifts_down(survey: &Survey<'_>) -> Judgement {
    survey.over_torques(1, |driven| falls(survey, |beta2_deg| peak_hz(survey, driven, beta2_deg, 1), "peak"))
}

/// Responses of one frequency are distinct if their amplitudes differ by more than this, relative: more than rounding.
const APART: f64 = 1e-6;

/// "The phenomenon of the dependence of the vibration amplitude on the direction of the frequency change is visible,
/// resulting in a slope of the characteristics in the resonance zones" (Section 4), "within the resonant zones there
/// are instability areas" (Section 6): in each of the two zones, at one pose of Fig. 4 at least, two stable periodic
/// responses share a frequency, with the folds between which the branch runs back.
pub(super) fn direction_matters(survey: &Survey<'_>) -> Judgement {
    let poses = &survey.settings.figure4.beta2_deg;
    survey.over_torques(0, |driven| {
        let count = |mode: usize| -> (usize, Option<String>) {
            let seen: Vec<Seen<bool>> = poses
                .iter()
                .map(|pose| {
                    survey
                        .zone(driven, *pose, mode)
                        .map(|zone| zone.ratio > 1.0 + APART && zone.count(BifurcationKind::Fold) > 1)
                })
                .collect();
            let bistable = seen.iter().filter(|bistable| **bistable == Ok(true)).count();
            (bistable, seen.into_iter().find_map(Result::err))
        };
        let zones = [count(0), count(1)];
        let part = |(bistable, why): &(usize, Option<String>)| match why {
            // A pose that failed matters only where no other pose shows the effect.
            Some(why) if *bistable == 0 => Err(why.clone()),
            _ => Ok(*bistable > 0),
        };
        let holds = all_hold(zones.iter().map(part))?;
        let value = format!("at {} and {} of {} poses", zones[0].0, zones[1].0, poses.len());
        let numbers = vec![
            number("bistable poses, zone 1", zones[0].0 as f64, ""),
            number("bistable poses, zone 2", zones[1].0 as f64, ""),
        ];
        Ok(Opinion::new(holds, value, numbers))
    })
}

/// The values that round to six.
const SIX: Range<f64> = 5.5..6.5;

/// "The amplitude values can vary by up to six times depending on the direction of changes in the forcing frequency"
/// (Section 6): the largest ratio of stable amplitudes of link 1 at one frequency in Fig. 4 rounds to 6. One zone with
/// a larger ratio is enough for a no.
pub(super) fn largest_ratio(survey: &Survey<'_>) -> Judgement {
    survey.over_torques(0, |driven| {
        let mut numbers = Vec::new();
        let mut unknown = None;
        for beta2_deg in &survey.settings.figure4.beta2_deg {
            for mode in [0, 1] {
                match survey.zone(driven, *beta2_deg, mode) {
                    Ok(zone) => numbers.push(number(format!("zone {} at {beta2_deg}°", mode + 1), zone.ratio, "")),
                    Err(why) => unknown = Some(why),
                }
            }
        }
        let largest = numbers.iter().fold(0.0_f64, |largest, ratio| largest.max(ratio.value));
        match unknown {
            // A zone that failed may have any ratio. It no longer matters once another has a ratio beyond six.
            Some(why) if largest < SIX.end => Err(why),
            unknown => {
                let least = if unknown.is_some() { " at least" } else { "" };
                Ok(Opinion::new(SIX.contains(&largest), format!("up to {largest:.1} times{least}"), numbers))
            }
        }
    })
}

/// "The characteristics for link 2 are qualitatively identical to the characteristics for link 1 shown in Figure 4"
/// (Section 4): in each zone both links have equally many maxima along the branch. Stability and folds are those of the
/// response, the same for both.
pub(super) fn links_alike(survey: &Survey<'_>) -> Judgement {
    survey.over_torques(0, |driven| {
        let places = || survey.settings.figure4.beta2_deg.iter().flat_map(|pose| [(*pose, 0), (*pose, 1)]);
        let alike = |(beta2_deg, mode): (f64, usize)| {
            let zone = survey.zone(driven, beta2_deg, mode)?;
            let count =
                |link: usize| zone.maxima[link].iter().filter(|maximum| maximum.prominence >= PROMINENCE).count();
            Ok(count(0) == count(1))
        };
        let same = places().filter(|place| alike(*place) == Ok(true)).count();
        let holds = all_hold(places().map(alike))?;
        let value = format!("in {same} of {} zones", places().count());
        Ok(Opinion::new(holds, value, vec![number("zones alike", same as f64, "")]))
    })
}

/// "In the range of negative values of β2, the characteristics are identical to those for positive values" (Section 4):
/// peaks and folds agree to 1e-9, at the torques of the figure. The equations say so at any torque.
pub(super) fn symmetric(survey: &Survey<'_>) -> Judgement {
    let opinion = || {
        let mut largest = 0.0_f64;
        let mut compared = 0;
        for beta2_deg in survey.settings.figure4.beta2_deg.iter().copied().filter(|beta2_deg| *beta2_deg != 0.0) {
            for mode in [0, 1] {
                let [down, up] = [beta2_deg, -beta2_deg].map(|beta2_deg| landmarks(survey, beta2_deg, mode));
                let (down, up) = (down.map_err(|why| why.to_string())?, up.map_err(|why| why.to_string())?);
                // A different number of folds is a difference, too.
                largest = if down.len() == up.len() { largest } else { f64::INFINITY };
                compared += down.len();
                for (down, up) in down.as_flattened().iter().zip(up.as_flattened()) {
                    largest = largest.max((up / down - 1.0).abs());
                }
            }
        }
        let holds = largest < 1e-9;
        let differences = if holds { String::from("below 1e-9") } else { format!("up to {largest:.0e}") };
        let value = format!("{compared} peaks and folds, differences {differences}");
        Ok(Opinion::new(holds, value, vec![number("relative difference", largest, "")]))
    };
    once(opinion())
}

/// Returns frequency and amplitude of link 1 at the folds and the peak of a zone, under the torque of Fig. 4.
fn landmarks(survey: &Survey<'_>, beta2_deg: f64, mode: usize) -> Result<Vec<[f64; 2]>, PaperError> {
    let arm = survey.subject.bent(beta2_deg)?;
    let range_hz = zone_hz(natural_hz(&arm)[mode]);
    let traced = Traced::joints(survey.subject, &arm, Drive::Torque1);
    let torque_nm = own_torque_nm(survey.settings, survey.subject.preset, mode);
    let branch = traced.over_frequency(torque_nm, range_hz)?;
    let folds = branch.bifurcations(BifurcationKind::Fold).chain([branch.peak(0, range_hz)?]);
    Ok(folds.map(|orbit| [orbit.frequency_hz, branch.size(orbit, 0)]).collect())
}

/// "The oscillations of the link can have different amplitudes depending on the forcing amplitude" (Section 4, Fig. 5),
/// with "bifurcation points whose location depends on the position of the arm described by the angle β2" (Section 6):
/// at 22.5 Hz, of the poses near resonance, at least two have folds, at different torques.
pub(super) fn folds_over_the_torque(survey: &Survey<'_>) -> Judgement {
    let opinion = || {
        let folded: Vec<(f64, &Vec<f64>)> = survey
            .over_torque
            .iter()
            .filter_map(|(pose, folds)| Some((*pose, folds.as_ref().ok()?)))
            .filter(|(_, folds)| !folds.is_empty())
            .collect();
        let failed = survey.over_torque.iter().find_map(|(_, folds)| folds.as_ref().err());
        // Neighbours suffice: if each list equals the one before it, all are equal.
        let differ = folded.windows(2).any(|pair| pair[0].1 != pair[1].1);
        if let (Some(why), false) = (failed, differ) {
            return Err(why.clone());
        }
        let of = |(pose, folds): &(f64, &Vec<f64>)| {
            let torques: Vec<String> = folds.iter().map(|torque_nm| format!("{torque_nm:.1}")).collect();
            format!("{pose:.1}° at {} N·m", torques.join(" and "))
        };
        let ends: Vec<String> = folded.first().into_iter().chain(folded.last()).map(of).collect();
        let count = folded.len();
        let all = survey.over_torque.len();
        let unknown = survey.over_torque.iter().filter(|(_, folds)| folds.is_err()).count();
        let unknown = if unknown > 0 { format!("; not computed: {unknown}") } else { String::new() };
        let value = format!("folds at {count} of {all} poses, {}{unknown}", ends.join(" to "));
        let numbers = folded.iter().flat_map(|(pose, folds)| {
            folds.iter().map(move |torque_nm| number(format!("fold at {pose:.1}°"), *torque_nm, "N·m"))
        });
        Ok(Opinion::new(differ, value, numbers.collect()))
    };
    once(opinion())
}

/// "The resonance zones are more extensive at larger excitation amplitudes than at small amplitudes" (Section 6): the
/// half-power width of link 1 grows from each torque of the scan to the next, at a pose in a zone.
pub(super) fn zones_widen(survey: &Survey<'_>) -> Judgement {
    let places = survey.settings.figure4.beta2_deg.iter().flat_map(|pose| [(*pose, 0), (*pose, 1)]);
    let words = |(beta2_deg, mode): (f64, usize)| format!("{beta2_deg}°, zone {}", mode + 1);
    let judge = |(beta2_deg, mode): (f64, usize)| {
        let torques = torques_nm(survey.settings, survey.subject.preset, mode);
        let width = |nm: f64| survey.zone(Driven::Torque { nm }, beta2_deg, mode)?.width_hz(0);
        widening(&torques, "N·m", width)
    };
    over("poses and zones", (f64::NAN, 0), places, (words, judge))
}

/// "For larger excitation amplitudes, period doubling, saddle-node points and Neimark–Sacker bifurcation were observed"
/// (Section 6): found in one zone of the scans at least. A no requires enough computed zones.
pub(super) fn observed(survey: &Survey<'_>, kind: BifurcationKind) -> Judgement {
    let found: Vec<_> = survey.zones().filter(|(_, zone)| zone.count(kind) > 0).collect();
    let least = |of: fn(Driven) -> Option<f64>| {
        let drives = found.iter().filter_map(|(place, _)| of(place.driven));
        drives.fold((0, f64::INFINITY), |(count, least), drive| (count + 1, least.min(drive)))
    };
    let torque = least(|driven| if let Driven::Torque { nm } = driven { Some(nm) } else { None });
    let force = least(|driven| if let Driven::Force { n, .. } = driven { Some(n) } else { None });
    let from = |(count, least): (usize, f64), unit: &str, by: &str| match count {
        0 => format!("in no zone under {by}"),
        _ => format!("in {count} zones under {by}, from {least} {unit}"),
    };
    let computed = survey.zones().count();
    let all = survey.views.len();
    if found.is_empty() && !enough(computed, all) {
        return once(Err(format!("only {computed} of {all} zones could be computed")));
    }
    let value = format!(
        "{}, {}; {computed} of {all} zones computed",
        from(torque, "N·m", "a torque"),
        from(force, "N", "a force")
    );
    let numbers =
        vec![number("zones under a torque", torque.0 as f64, ""), number("zones under a force", force.0 as f64, "")];
    once(Ok(Opinion::new(!found.is_empty(), value, numbers)))
}
