//! Amplitude spectra of the latest samples.
//!
//! With a Hann window w(n) = ½ (1 − cos 2πn/N), a sine of amplitude A in the middle of line k has
//! |X(k)| = |Σ w(n) x(n) e^(−2πikn/N)| = ½ A Σ w, so that line k shows 2 |X(k)|/Σ w: amplitudes in the unit of the
//! samples, at most 15 % low between two lines.

use core::f64::consts::TAU;

use nalgebra::Complex;

use resonarm_numeric::dft::Fft;

/// The shortest time that a spectrum covers, s; the longest is twice as much.
const LEAST_S: f64 = 1.5;
/// Most samples in a spectrum.
const MOST: usize = 1 << 13;
/// Highest frequency shown at least, Hz: the arm's frequencies, with a few harmonics.
const SHOWN_HZ: f64 = 125.0;
/// Highest frequency shown at least, over that of the highest mode.
const OVER_MODES: f64 = 1.25;

/// Computes spectra of one length.
#[derive(Debug)]
pub struct Spectrum {
    fft: Fft,
    window: Vec<f64>,
    /// Distance between two lines, Hz.
    pub line_hz: f64,
    shown_hz: f64,
}

impl Spectrum {
    /// Makes a spectrum for samples at `rate_hz` of a structure whose highest mode, if it is known, is at `highest_hz`.
    pub fn new(rate_hz: f64, highest_hz: Option<f64>) -> Spectrum {
        let fft = Fft::at_least(((LEAST_S * rate_hz) as usize).clamp(64, MOST));
        let n = fft.length();
        let window = (0..n).map(|k| 0.5 * (1.0 - libm::cos(TAU * k as f64 / n as f64))).collect();
        let shown_hz = highest_hz.map_or(SHOWN_HZ, |hz| SHOWN_HZ.max(OVER_MODES * hz));
        Spectrum { line_hz: rate_hz / n as f64, fft, window, shown_hz }
    }

    /// Samples in a spectrum.
    pub fn length(&self) -> usize {
        self.window.len()
    }

    /// Amplitudes of the lines from 0 to 125 Hz, or beyond the modes, without the mean. There must be as many `samples`
    /// as [`Spectrum::length`] returns; unknown ones count as 0.
    pub fn amplitudes(&self, samples: impl Iterator<Item = f32>) -> Vec<f32> {
        // A missing sample counts as 0: NaN would spoil every line.
        let known = |value: f32| if value.is_finite() { f64::from(value) } else { 0.0 };
        let samples: Vec<f64> = samples.map(known).collect();
        // The mean is removed, since the window would spread it over the lowest lines.
        let mean = samples.iter().sum::<f64>() / samples.len().max(1) as f64;
        let windowed =
            samples.iter().zip(&self.window).map(|(value, weight)| Complex::new((value - mean) * weight, 0.0));
        let mut values: Vec<Complex<f64>> = windowed.collect();
        self.fft.forward(&mut values);
        let scale = 2.0 / self.window.iter().sum::<f64>();
        let lines = ((self.shown_hz / self.line_hz) as usize).min(values.len() / 2);
        values.iter().take(lines).map(|value| (scale * libm::hypot(value.re, value.im)) as f32).collect()
    }

    /// Frequency of the largest line, Hz, interpolated between it and its neighbours; `None` if all are 0.
    ///
    /// A Hann window spreads a sine whose frequency is δ lines above the largest line b over its neighbours a and c,
    /// with s common to all three: a = s (1 − δ)(2 − δ), b = s (4 − δ²), c = s (1 + δ)(2 + δ). So δ = 2 (c − a)/(a + 2b + c),
    /// which is exact, where a parabola through the logarithms is wrong by up to 1/60 of a line.
    pub fn peak_hz(&self, lines: &[f32]) -> Option<f64> {
        // Line 0 is the mean, which was removed, and the last line has no right neighbour.
        let inner = 1..lines.len().saturating_sub(1);
        let k = inner.max_by(|a, b| lines[*a].total_cmp(&lines[*b]))?;
        let [a, b, c] = [lines[k - 1], lines[k], lines[k + 1]].map(f64::from);
        // With noise δ may leave the line; the sine is nearest to the largest line all the same.
        let shift = (2.0 * (c - a) / (a + 2.0 * b + c)).clamp(-0.5, 0.5);
        (b > 0.0).then_some((k as f64 + shift) * self.line_hz)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_has_its_amplitude_and_its_frequency() {
        let spectrum = Spectrum::new(1000.0, None);
        // Steps of a seventh of a line: the parabola through logarithms was 7 mHz off between two lines.
        let near = (0..7).map(|seventh| 22.0 + f64::from(seventh) * spectrum.line_hz / 7.0);
        for frequency_hz in [10.0, 22.16, 57.3].into_iter().chain(near) {
            let sine = |n: usize| (3.0 + 2.5 * libm::sin(TAU * frequency_hz * n as f64 / 1000.0)) as f32;
            let lines = spectrum.amplitudes((0..spectrum.length()).map(sine));
            let largest = lines.iter().copied().fold(0.0, f32::max);
            // Between two lines the window reads a sine up to 15 % low.
            assert!((0.85 * 2.5..1.001 * 2.5).contains(&f64::from(largest)), "{frequency_hz}: {largest}");
            let peak_hz = spectrum.peak_hz(&lines).unwrap();
            assert!((peak_hz - frequency_hz).abs() < 1e-5, "{frequency_hz}: {peak_hz}");
        }
        let beyond = Spectrum::new(2000.0, Some(388.0));
        let count = beyond.amplitudes(core::iter::repeat_n(0.0, beyond.length())).len();
        assert_eq!(count, (485.0 / beyond.line_hz) as usize);
        assert_eq!(spectrum.peak_hz(&spectrum.amplitudes(core::iter::repeat_n(f32::NAN, 2048))), None);
    }
}
