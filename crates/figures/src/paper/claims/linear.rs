//! Section 3 and the natural frequencies in Section 4: the linear arm. These statements have no open parameters.

use super::super::branch::natural_hz;
use super::cases::{Judgement, Opinion, number, once};
use super::survey::{Seen, Survey};

/// Returns f1 and f2 at a pose, Hz.
fn frequencies(survey: &Survey<'_>, beta2_deg: f64) -> Seen<[f64; 2]> {
    let arm = survey.subject.bent(beta2_deg).map_err(|why| why.to_string())?;
    Ok(natural_hz(&arm))
}

/// "The natural frequencies of the robot arm vibrations depend strongly on its position" (Section 3). No number follows
/// from "strongly": each of the two must vary by more than a tenth. The numbers show how little that threshold matters.
pub(super) fn depend_on_pose(survey: &Survey<'_>) -> Judgement {
    let opinion = || {
        // Whole degrees are dense enough for the extremes: both frequencies are smooth in β2.
        let all = (-180..=180).map(|beta2_deg| frequencies(survey, f64::from(beta2_deg)));
        let all = all.collect::<Result<Vec<_>, _>>()?;
        let ends = |mode: usize| {
            let of = all.iter().map(|frequencies| frequencies[mode]);
            of.fold((f64::INFINITY, 0.0_f64), |(low, high), hz| (low.min(hz), high.max(hz)))
        };
        let [first, second] = [ends(0), ends(1)];
        let ratios = [first.1 / first.0, second.1 / second.0];
        let value = format!(
            "f1 {:.2} to {:.2} Hz ({:.2} times), f2 {:.2} to {:.2} Hz ({:.2} times)",
            first.0, first.1, ratios[0], second.0, second.1, ratios[1]
        );
        let numbers = vec![number("f1", ratios[0], ""), number("f2", ratios[1], "")];
        Ok(Opinion::new(ratios.iter().all(|ratio| *ratio > 1.1), value, numbers))
    };
    once(opinion())
}

/// "The changes are symmetrical with respect to the so-called straight arm configuration" (Section 3): f(β2) = f(−β2)
/// to the rounding of the arithmetic.
pub(super) fn symmetric(survey: &Survey<'_>) -> Judgement {
    let opinion = || {
        let mut largest = 0.0_f64;
        for beta2_deg in 0..=180 {
            let [up, down] = [1.0, -1.0].map(|sign| frequencies(survey, sign * f64::from(beta2_deg)));
            for (up, down) in up?.into_iter().zip(down?) {
                largest = largest.max((up / down - 1.0).abs());
            }
        }
        let value =
            if largest == 0.0 { String::from("no difference") } else { format!("largest difference {largest:.0e}") };
        Ok(Opinion::new(largest < 1e-12, value, vec![number("relative difference", largest, "")]))
    };
    once(opinion())
}

/// "Similar to the natural frequencies in a linear system (Section 3), in a nonlinear system the resonance zones move
/// closer together as the absolute value of angle β2 increases" (Section 4): f2 − f1 falls from each pose of Fig. 4 to
/// the next.
pub(super) fn draw_together(survey: &Survey<'_>) -> Judgement {
    let opinion = || {
        let mut numbers = Vec::new();
        for beta2_deg in &survey.settings.figure4.beta2_deg {
            let [first, second] = frequencies(survey, *beta2_deg)?;
            numbers.push(number(format!("f2 − f1 at {beta2_deg}°"), second - first, "Hz"));
        }
        let listed: Vec<String> = numbers.iter().map(|apart| format!("{:.2}", apart.value)).collect();
        let falls = numbers.windows(2).all(|pair| pair[1].value < pair[0].value);
        Ok(Opinion::new(falls, format!("{} Hz apart", listed.join(", ")), numbers))
    };
    once(opinion())
}

/// Fig. 4a is the "entire spectrum" from 0 to 80 Hz and Fig. 4c shows second zones: f2 is below 80 Hz at all its poses.
pub(super) fn within_the_range(survey: &Survey<'_>) -> Judgement {
    let opinion = || {
        let end_hz = survey.settings.range_hz[1];
        let mut numbers = Vec::new();
        for beta2_deg in &survey.settings.figure4.beta2_deg {
            numbers.push(number(format!("f2 at {beta2_deg}°"), frequencies(survey, *beta2_deg)?[1], "Hz"));
        }
        let inside = numbers.iter().filter(|highest| highest.value < end_hz).count();
        let listed: Vec<String> = numbers.iter().map(|highest| format!("{:.1}", highest.value)).collect();
        let value = format!("at {inside} of {} poses; f2 {} Hz", numbers.len(), listed.join(", "));
        Ok(Opinion::new(inside == numbers.len(), value, numbers))
    };
    once(opinion())
}
