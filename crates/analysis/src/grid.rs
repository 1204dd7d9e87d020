//! Frequencies at which a response is computed: dense where a mode makes it narrow.

use alloc::vec::Vec;

/// Even steps of u in [`frequencies_hz`]: next to a peak the modulus at every point is within 1 − 1/√(1 + u²) = 0.8 %
/// of its neighbour's.
const STEP: f64 = 0.125;

/// `points` evenly spaced frequencies from `from_hz` to `to_hz` (at least two), and more about each mode within them,
/// by its frequency, Hz, and damping ratio, in ascending order.
///
/// Near mode r a response follows 1/(1 + ix), where x = (f − f_r)/(ζ_r f_r) is the distance in half widths: the
/// half-power width is 2 ζ_r f_r. Points at x = sinh u with u in even steps h are h half widths apart at the peak, and
/// the fraction h of the distance further off; the peak itself, u = 0, is one of them. They end where they are as far
/// apart as the even ones, h |f − f_r| = Δf. A mode that is wider than the even steps (ζ_r f_r h ≥ Δf), or without
/// damping and so infinitely high, has none.
pub fn frequencies_hz(from_hz: f64, to_hz: f64, points: u32, modes: &[(f64, f64)]) -> Vec<f64> {
    let last = f64::from(points.max(2) - 1);
    let step_hz = (to_hz - from_hz) / last;
    let mut all: Vec<f64> = (0..points.max(2)).map(|k| from_hz + (to_hz - from_hz) * (f64::from(k) / last)).collect();
    for (frequency_hz, damping_ratio) in modes {
        let half_width_hz = damping_ratio * frequency_hz;
        if half_width_hz <= 0.0 || half_width_hz * STEP >= step_hz {
            continue;
        }
        let count = libm::ceil(libm::asinh(step_hz / (STEP * half_width_hz)) / STEP) as i32;
        let around = (-count..=count).map(|k| frequency_hz + half_width_hz * libm::sinh(STEP * f64::from(k)));
        all.extend(around.filter(|hz| *hz > from_hz && *hz < to_hz));
    }
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LinearResponse;
    use crate::Quantity;
    use crate::tests::preset_at;
    use resonarm_dynamics::structure::{Assembly, Dof, Preset};

    /// Frequency and damping ratio of both modes.
    fn widths(arm: &Assembly) -> Vec<(f64, f64)> {
        arm.modes().iter().map(|mode| (mode.frequency_hz, mode.damping_ratio)).collect()
    }

    fn largest(linear: &LinearResponse, tip: Dof, hz: &[f64]) -> f64 {
        let modulus = |hz: &f64| linear.at(Quantity::Accelerance, tip, tip, *hz).unwrap().norm_sqr();
        libm::sqrt(hz.iter().map(modulus).fold(0.0, f64::max))
    }

    /// The default range and number: even points alone miss most of a peak between two of them.
    #[test]
    fn peaks_are_met_that_even_points_clip() {
        let mut least_of_even = f64::INFINITY;
        for preset in Preset::ALL {
            for beta2_deg in [0.0, 60.0, 120.0] {
                let arm = preset_at(preset, [0.0, beta2_deg]);
                let linear = LinearResponse::new(&arm);
                let tip = arm.dof("tip.y").unwrap();
                let modes = widths(&arm);
                for &(frequency_hz, damping_ratio) in modes.iter().filter(|mode| mode.0 < 80.0) {
                    let near = |part: f64| frequency_hz * (1.0 + part * damping_ratio);
                    let fine: Vec<f64> = (-2000..=2000).map(|k| near(f64::from(k) / 500.0)).collect();
                    let low = near(-30.0);
                    let high = near(30.0);
                    let within = |modes: &[(f64, f64)]| -> Vec<f64> {
                        let all = frequencies_hz(1.0, 80.0, 801, modes);
                        all.into_iter().filter(|hz| (low..=high).contains(hz)).collect()
                    };
                    let peak = largest(&linear, tip, &fine);
                    let met = largest(&linear, tip, &within(&modes));
                    assert!(met > 0.9999 * peak, "{preset} {beta2_deg}: {met} of {peak}");
                    least_of_even = least_of_even.min(largest(&linear, tip, &within(&[])) / peak);
                }
            }
        }
        assert!(least_of_even < 0.2, "{least_of_even}");
    }

    #[test]
    fn frequencies_ascend_within_the_range_and_are_few() {
        let modes = widths(&preset_at(Preset::Irb1600Fitted, [0.0, 60.0]));
        let all = frequencies_hz(1.0, 80.0, 801, &modes);
        assert!(all.windows(2).all(|pair| pair[0] < pair[1]) && (all[0], all[all.len() - 1]) == (1.0, 80.0));
        assert!((900..1200).contains(&all.len()), "{}", all.len());
        let apart = |modes: &[(f64, f64)]| frequencies_hz(10.0, 11.0, 5, modes).len();
        assert_eq!((apart(&modes), apart(&[])), (5, 5));
        assert_eq!(frequencies_hz(1.0, 80.0, 801, &[(modes[0].0, 0.0)]).len(), 801);
    }
}
