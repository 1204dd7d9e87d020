//! Stiff and soft: which way the zones bend, read from their backbones.

use super::bent::Bent;
use super::cases::{Judgement, Opinion, all_hold, number};
use super::survey::{Driven, Seen, Survey};
use resonarm_analysis::Bending;

/// "Small" are the angles of the first third of the range of Section 4, 0 to 150°, "large" those of the last: 0° and
/// 30°, 120° and 150° of the poses of Fig. 4.
const SMALL_DEG: f64 = 50.0;
const LARGE_DEG: f64 = 100.0;

/// Says whether the backbones of a mode, up to the torque, are of a kind at each of the selected poses of Fig. 4.
fn each(survey: &Survey<'_>, mode: usize, wanted: fn(f64) -> bool, kind: impl Fn(&Bent) -> bool) -> Judgement {
    let poses: Vec<f64> = survey.settings.figure4.beta2_deg.iter().copied().filter(|pose| wanted(*pose)).collect();
    survey.over_torques(mode, |driven| {
        let holds = all_hold(poses.iter().map(|pose| survey.bent(driven, *pose, mode).map(&kind)))?;
        let (value, numbers) = listed(survey, driven, mode, &poses);
        // Settings may leave out all poses of the kind; an empty list must not be a yes.
        Ok(Opinion::new(holds && !poses.is_empty(), value, numbers))
    })
}

/// Returns the backbones at these poses in words and numbers.
fn listed(survey: &Survey<'_>, driven: Driven, mode: usize, poses: &[f64]) -> (String, Vec<super::Number>) {
    let mut words = Vec::new();
    let mut numbers = Vec::new();
    for beta2_deg in poses {
        match survey.bent(driven, *beta2_deg, mode) {
            Ok(bent) => {
                words.push(format!("{beta2_deg}° {}", bent.words()));
                numbers.push(number(format!("shift at {beta2_deg}°"), bent.shift_hz, "Hz"));
            }
            Err(_) => words.push(format!("{beta2_deg}° not computed")),
        }
    }
    (words.join(", "), numbers)
}

/// "For small β2 angles, a stiff resonance curve is obtained around the first natural frequency" (Section 4).
pub(super) fn first_stiff_when_straight(survey: &Survey<'_>) -> Judgement {
    each(survey, 0, |beta2_deg| beta2_deg <= SMALL_DEG, |bent| bent.is(Bending::Hardening))
}

/// "Which for large β2 transits into a mixed softening–hardening curve" (Section 4): the backbone turns, in either
/// order, which the words state.
pub(super) fn first_mixed_when_bent(survey: &Survey<'_>) -> Judgement {
    each(survey, 0, |beta2_deg| beta2_deg >= LARGE_DEG, Bent::is_mixed)
}

/// "In contrast, for the resonance around the second natural frequency (Figure 4c), soft characteristics are obtained"
/// (Section 4).
pub(super) fn second_soft_when_straight(survey: &Survey<'_>) -> Judgement {
    each(survey, 1, |beta2_deg| beta2_deg <= SMALL_DEG, |bent| bent.is(Bending::Softening))
}

/// "As the angle β2 increases, the situation changes: the curves shift towards lower frequencies and become stiff
/// characteristics" (Section 4), the second half.
pub(super) fn second_stiff_when_bent(survey: &Survey<'_>) -> Judgement {
    each(survey, 1, |beta2_deg| beta2_deg >= LARGE_DEG, |bent| bent.is(Bending::Hardening))
}

/// "The dependence of the resonance zones on the position of the arm was demonstrated, and the resonance
/// characteristics changed from stiff to soft or vice versa" (Section 6): each zone is stiff at one of the poses of
/// Fig. 4 at least, and soft at another.
pub(super) fn characters_change(survey: &Survey<'_>) -> Judgement {
    let poses = &survey.settings.figure4.beta2_deg;
    survey.over_torques(0, |driven| {
        let mut words = Vec::new();
        let mut numbers = Vec::new();
        let mut zone = |mode: usize| -> Seen<bool> {
            let all: Vec<Seen<&Bent>> = poses.iter().map(|pose| survey.bent(driven, *pose, mode)).collect();
            let count = |bending| all.iter().filter(|bent| bent.as_ref().is_ok_and(|bent| bent.is(bending))).count();
            let [stiff, soft] = [count(Bending::Hardening), count(Bending::Softening)];
            words.push(format!("zone {}: stiff at {stiff}, soft at {soft} poses", mode + 1));
            numbers.push(number(format!("stiff poses of zone {}", mode + 1), stiff as f64, ""));
            numbers.push(number(format!("soft poses of zone {}", mode + 1), soft as f64, ""));
            // A pose that could not be computed matters only as long as it could still turn the answer into a yes.
            match all.iter().find_map(|bent| bent.as_ref().err()) {
                Some(why) if stiff == 0 || soft == 0 => Err(why.clone()),
                _ => Ok(stiff > 0 && soft > 0),
            }
        };
        let holds = all_hold([zone(0), zone(1)].into_iter())?;
        Ok(Opinion::new(holds, words.join("; "), numbers))
    })
}
