//! Values read from a branch: peaks, widths, and the ratio of its stable responses.

use super::branch::{ForcedBranch, PaperOrbit};
use super::error::PaperError;
use resonarm_analysis::{Maximum, half_power_width_hz, maxima};

impl ForcedBranch {
    /// Returns the response with the largest amplitude of a link (0 or 1).
    ///
    /// # Errors
    /// [`PaperError::NoResponse`] if the branch has none in the range.
    pub fn peak(&self, link: usize, range_hz: [f64; 2]) -> Result<&PaperOrbit, PaperError> {
        let larger = |a: &&PaperOrbit, b: &&PaperOrbit| self.size(a, link).total_cmp(&self.size(b, link));
        self.within(range_hz).max_by(larger).ok_or(PaperError::NoResponse {
            structure: self.structure.clone(),
            beta2_deg: self.angles_deg.get(1).copied().unwrap_or(f64::NAN),
            from_hz: range_hz[0],
            to_hz: range_hz[1],
        })
    }

    /// Returns the maxima of a link's amplitude along the branch, its ends excluded, the highest first.
    pub fn maxima(&self, link: usize) -> Vec<Maximum> {
        maxima(&self.curve(link))
    }

    /// Returns the width of a link's resonance, stable or not, by [`half_power_width_hz`].
    pub fn half_power_width_hz(&self, link: usize) -> Option<f64> {
        // Bifurcations may be beyond the steps next to them.
        let all: Vec<(f64, f64)> =
            self.orbits.iter().map(|orbit| (orbit.frequency_hz, self.size(orbit, link))).collect();
        half_power_width_hz(&self.curve(link), &all)
    }

    /// Returns the largest ratio between amplitudes of a link in stable responses of one frequency, and that frequency
    /// in Hz; 1 if there is only one response at each frequency.
    pub fn largest_ratio(&self, link: usize) -> (f64, f64) {
        let stable: Vec<[(f64, f64); 2]> = self
            .segments()
            .filter(|(.., is_stable)| *is_stable)
            .map(|(a, b, _)| [a, b].map(|orbit| (orbit.frequency_hz, self.size(orbit, link))))
            .collect();
        let mut largest = (1.0, f64::NAN);
        // Between the frequencies of two neighbouring responses all segments are straight, and the quotient of two
        // straight lines is monotonic: the largest ratio is at the frequency of a response.
        for orbit in &self.orbits {
            let hz = orbit.frequency_hz;
            let mut least = f64::INFINITY;
            let mut most = f64::NEG_INFINITY;
            // The stable segments over this frequency, interpolated; a vertical one has no single amplitude there.
            for [a, b] in stable.iter().filter(|[a, b]| a.0.min(b.0) <= hz && hz <= a.0.max(b.0) && a.0 != b.0) {
                let amplitude = a.1 + (b.1 - a.1) * (hz - a.0) / (b.0 - a.0);
                least = least.min(amplitude);
                most = most.max(amplitude);
            }
            // Without a stable segment this is −∞/∞, a NaN, which is not larger.
            if most / least > largest.0 {
                largest = (most / least, hz);
            }
        }
        largest
    }

    /// Returns frequencies, Hz, and amplitudes of a link, rad, at the steps of the continuation. Bifurcations are left
    /// out: one can be so near to a step that the slope between them is dominated by rounding.
    fn curve(&self, link: usize) -> Vec<(f64, f64)> {
        let steps = self.orbits.iter().filter(|orbit| orbit.bifurcation.is_none());
        steps.map(|orbit| (orbit.frequency_hz, self.size(orbit, link))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::Drive;
    use super::super::branch::Read;
    use super::*;
    use resonarm_analysis::BifurcationKind;

    const STABLE: Option<bool> = Some(true);
    const UNSTABLE: Option<bool> = Some(false);
    const MARGINAL: Option<bool> = None;

    fn branch(points: &[(f64, f64, Option<bool>)]) -> ForcedBranch {
        let orbit = |(frequency_hz, amplitude, is_stable): &(f64, f64, Option<bool>)| PaperOrbit {
            frequency_hz: *frequency_hz,
            excitation: 1.0,
            largest: vec![*amplitude; 2],
            amplitude: vec![*amplitude; 2],
            is_stable: *is_stable,
            bifurcation: None,
        };
        ForcedBranch {
            structure: String::from("arm"),
            angles_deg: vec![0.0; 2],
            drive: Drive::Torque1,
            read: Read::joints(),
            natural_hz: [1.0, 2.0],
            orbits: points.iter().map(orbit).collect(),
        }
    }

    #[test]
    fn measures_match_a_curve_drawn_by_hand() {
        // Up to a fold at (4, 3), back below to another at (2, 1), on to (6, 0.5).
        let s = branch(&[
            (0.0, 0.0, STABLE),
            (4.0, 3.0, MARGINAL),
            (3.0, 2.0, UNSTABLE),
            (2.0, 1.0, MARGINAL),
            (6.0, 0.5, STABLE),
        ]);
        // At the upper fold: 3 above, 1 − 0.5 · 2/4 below.
        assert_eq!(s.largest_ratio(0), (4.0, 4.0));
        assert_eq!(s.peak(0, [0.0, 6.0]).unwrap().frequency_hz, 4.0);
        assert_eq!(s.peak(0, [0.0, 3.5]).unwrap().frequency_hz, 3.0);
        assert!(s.peak(0, [7.0, 8.0]).is_err());
        assert_eq!(branch(&[(0.0, 1.0, STABLE), (1.0, 2.0, STABLE)]).half_power_width_hz(0), None);
    }

    #[test]
    fn prominence_is_the_relative_drop_on_both_sides() {
        let waves = [0.0, 2.0, 1.9, 2.5, 1.0, 1.5, 0.0];
        let points: Vec<_> = waves.iter().enumerate().map(|(i, a)| (i as f64, *a, STABLE)).collect();
        let prominences: Vec<f64> = branch(&points).maxima(1).iter().map(|top| top.prominence).collect();
        for (seen, expected) in prominences.iter().zip([1.0, 0.05, 1.0 / 3.0]) {
            assert!((seen - expected).abs() < 1e-12, "{prominences:?}");
        }
        assert_eq!(prominences.len(), 3);
    }

    /// A peak that leans by a hundred of its widths: its sides cover the same frequencies.
    #[test]
    fn the_top_of_a_leaning_peak_is_not_overshot() {
        for offset in [-0.04, 0.0, 0.013, 0.05] {
            let points: Vec<_> = (0..31)
                .map(|k| -1.5 + offset + 0.1 * f64::from(k))
                .map(|phase| (40.0 + 1e-3 * libm::tan(phase) - 0.1 * libm::cos(phase), libm::cos(phase), STABLE))
                .collect();
            let top = branch(&points).maxima(0)[0];
            assert!(
                (top.amplitude_rad - 1.0).abs() < 1e-5 && (top.frequency_hz - 39.9).abs() < 1e-5,
                "{offset} {top:?}"
            );
        }
    }

    /// A linear resonance 1/√(x² + 1), x = (f − f₀)/(ζf₀), is 2ζf₀ wide; sampled every tenth of a radian of its circle,
    /// but not at its peak.
    #[test]
    fn width_and_peak_of_a_sampled_resonance_are_good_to_1e_5() {
        let [f0, half_width] = [40.0, 0.035];
        let points: Vec<_> = (0..31)
            .map(|k| -1.53 + 0.1 * f64::from(k))
            .map(|phase| (f0 + half_width * libm::tan(phase), libm::cos(phase), STABLE))
            .collect();
        let resonance = branch(&points);
        let top = resonance.maxima(0)[0];
        assert!((top.frequency_hz - f0).abs() < 1e-2 * half_width, "{top:?}");
        assert!((top.amplitude_rad - 1.0).abs() < 1e-5, "{top:?}");
        let width = resonance.half_power_width_hz(0).unwrap();
        // Both flanks are found at 1/√2 of the peak, each by interpolation.
        assert!((width / (2.0 * half_width) - 1.0).abs() < 1e-4, "{width}");
        // A bifurcation beside the highest step, off by its location error, changes nothing.
        let mut marked = resonance.clone();
        let highest = 15;
        let mut fold = marked.orbits[highest].clone();
        fold.largest.iter_mut().for_each(|amplitude| *amplitude *= 1.0 - 1e-6);
        fold.frequency_hz -= 1e-9;
        fold.bifurcation = Some(BifurcationKind::Fold);
        marked.orbits.insert(highest, fold);
        assert_eq!((marked.maxima(0)[0], marked.half_power_width_hz(0).unwrap()), (top, width));
    }
}
