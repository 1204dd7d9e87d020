//! Shock response spectra.
//!
//! An oscillator of natural frequency f and quality Q = 1/2ζ stands on a base that has the acceleration x(t), which is taken
//! as linear between the samples. Its absolute acceleration y at the samples is exact by the recursion (D. O. Smallwood, "An
//! Improved Recursive Formula for Calculating Shock Response Spectra", Shock and Vibration Bulletin 51 (1981)), with ω = 2πf,
//! ω_d = ω√(1 − ζ²), E = e^(−ζωT), C = E cos ω_dT, S = E sin(ω_dT)/ω_dT:
//!
//! ```text
//! yₙ = (1 − S) xₙ + 2(S − C) xₙ₋₁ + (E² − S) xₙ₋₂ + 2C yₙ₋₁ − E² yₙ₋₂
//! ```

use alloc::vec::Vec;
use core::f64::consts::TAU;

use super::error::SpectraError;
use super::{check_finite, check_rate};

/// The shock response spectra of a record: the largest absolute accelerations of oscillators, in the unit of the record.
#[derive(Clone, Debug, PartialEq)]
pub struct ShockResponse {
    /// Natural frequencies of the oscillators, Hz.
    pub frequency_hz: Vec<f64>,
    /// Largest acceleration to the positive side; at least 0.
    pub positive: Vec<f64>,
    /// Largest acceleration to the negative side, as a positive number; at least 0.
    pub negative: Vec<f64>,
}

impl ShockResponse {
    /// Computes the spectra of an acceleration with `rate_hz` samples per second, for oscillators of the quality `quality`.
    ///
    /// They are at rest before the record, and their responses within it count at the samples. Near a tenth of the sample rate
    /// a peak between two samples is up to 5 % higher. A record that ends before the vibration of the lowest oscillator has
    /// turned back must be continued by zeros.
    ///
    /// # Errors
    /// [`SpectraError`] if the rate or a frequency is not positive, a frequency is above half of the rate, `quality` is not
    /// above ½, or a sample is not finite.
    pub fn estimate(
        rate_hz: f64,
        acceleration: &[f64],
        quality: f64,
        frequency_hz: &[f64],
    ) -> Result<ShockResponse, SpectraError> {
        check_rate(rate_hz)?;
        if !(quality > 0.5 && quality.is_finite()) {
            return Err(SpectraError::Quality { quality });
        }
        if let Some(&frequency_hz) = frequency_hz.iter().find(|f| !(**f > 0.0 && **f <= 0.5 * rate_hz)) {
            return Err(SpectraError::Frequency { frequency_hz, most_hz: 0.5 * rate_hz });
        }
        check_finite(0, acceleration)?;
        let extremes = frequency_hz.iter().map(|f| extremes(TAU * f / rate_hz, 0.5 / quality, acceleration));
        let (negative, positive) = extremes.map(|[lowest, highest]| (-lowest, highest)).unzip();
        Ok(ShockResponse { frequency_hz: frequency_hz.to_vec(), positive, negative })
    }

    /// Returns the larger of both sides at each frequency, the maximax spectrum.
    pub fn maximax(&self) -> Vec<f64> {
        self.positive.iter().zip(&self.negative).map(|(positive, negative)| positive.max(*negative)).collect()
    }
}

/// Returns the lowest and the highest response of an oscillator with the phase `turn_rad` = ωT of an undamped step, 0
/// included.
fn extremes(turn_rad: f64, damping_ratio: f64, acceleration: &[f64]) -> [f64; 2] {
    let damped = turn_rad * libm::sqrt(1.0 - damping_ratio * damping_ratio);
    let e = libm::exp(-damping_ratio * turn_rad);
    let (sine, cosine) = libm::sincos(damped);
    let c = e * cosine;
    let s = e * sine / damped;
    let [b0, b1, b2] = [1.0 - s, 2.0 * (s - c), e * e - s];
    let [mut x1, mut x2] = [0.0; 2];
    let [mut y1, mut y2] = [0.0; 2];
    let mut found = [0.0_f64; 2];
    for &x in acceleration {
        // The base is at rest before the record: the values before the first sample are zeros.
        let y = b0 * x + b1 * x1 + b2 * x2 + 2.0 * c * y1 - e * e * y2;
        x2 = x1;
        x1 = x;
        y2 = y1;
        y1 = y;
        found = [found[0].min(y), found[1].max(y)];
    }
    found
}

#[cfg(test)]
mod tests {
    use core::f64::consts::PI;

    use super::*;

    /// Pulses of which pyYeti 1.4.8 (`srs`, `ppc=0`) computed the spectra, continued by 0.05 s of zeros and a period of the
    /// lowest oscillator: amplitude, duration, rate; saw-tooth or half-sine; positive and negative.
    type Case = ([f64; 3], bool, [f64; 5], [f64; 5]);
    const FREQUENCY_HZ: [f64; 5] = [10.0, 20.0, 40.0, 80.0, 160.0];
    const CASES: [Case; 3] = [
        (
            [50.0, 0.011, 10000.0],
            false,
            [20.257339545307808, 39.152365312711005, 68.06999574836907, 82.40795072172736, 65.41121215509138],
            [17.309291746763346, 33.4549004540833, 58.16164740644721, 62.16683206470582, 16.416301438852578],
        ),
        (
            [40.0, 0.011, 10000.0],
            true,
            [12.590570107783842, 24.208098446722584, 41.29374832397129, 43.67123530250969, 41.81354335928913],
            [10.758241476830692, 20.68500346463836, 35.285367659027436, 37.34765371473308, 35.77699587897093],
        ),
        (
            [20.0, 0.02, 1000.0],
            false,
            [14.31985303732912, 25.49081819614148, 32.952048164273386, 27.260263550509915, 22.046110509653815],
            [12.236666451748363, 21.776115419577412, 26.201525357396143, 3.78675756887803, 3.4420375951959534],
        ),
    ];

    #[test]
    fn spectra_of_pulses_are_those_of_independent_code() {
        for ([amplitude, duration_s, rate_hz], is_saw_tooth, positive, negative) in CASES {
            let steps = (duration_s * rate_hz).round();
            let pulse = |k: usize| match is_saw_tooth {
                true if (k as f64) < steps => amplitude * k as f64 / steps,
                false if k as f64 <= steps => amplitude * libm::sin(PI * k as f64 / steps),
                _ => 0.0,
            };
            let count = (steps + (0.05 + 1.0 / FREQUENCY_HZ[0]) * rate_hz) as usize + 1;
            let record: Vec<f64> = (0..count).map(pulse).collect();
            let found = ShockResponse::estimate(rate_hz, &record, 10.0, &FREQUENCY_HZ).unwrap();
            let expected = positive.iter().chain(&negative);
            for (found, expected) in found.positive.iter().chain(&found.negative).zip(expected) {
                assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
            }
        }
    }

    #[test]
    fn impossible_oscillators_are_refused() {
        let refused = |quality, hz| ShockResponse::estimate(1000.0, &[0.0; 9], quality, &[hz]).unwrap_err();
        assert_eq!(refused(0.5, 10.0), SpectraError::Quality { quality: 0.5 });
        assert_eq!(refused(10.0, 501.0), SpectraError::Frequency { frequency_hz: 501.0, most_hz: 500.0 });
    }
}
