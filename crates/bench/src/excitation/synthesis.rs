//! Synthesis of noise and multisines as samples.

use alloc::vec::Vec;
use core::f64::consts::PI;

use nalgebra::Complex;

use super::error::{ExcitationError, samples};
use super::spectrum::Spectrum;
use super::waveform::Phases;
use resonarm_numeric::dft::{Fft, Lines};
use resonarm_numeric::noise::Noise;

/// Stream of the random numbers, far from those of the instruments and their faults.
const STREAM: u64 = 1 << 48;

/// A frequency band, Hz.
#[derive(Clone, Copy, Debug)]
pub(super) struct Band {
    pub from_hz: f64,
    pub to_hz: f64,
}

impl Band {
    /// Returns the multiples of `spacing_hz` in the band, first and count; the spacing follows from `length`.
    fn lines(&self, spacing_hz: f64, length: &'static str) -> Result<(usize, usize), ExcitationError> {
        // A frequency that is a multiple up to rounding counts as one.
        const ROUNDING: f64 = 1e-9;
        let first = libm::ceil(self.from_hz / spacing_hz * (1.0 - ROUNDING)).max(1.0);
        let last = libm::floor(self.to_hz / spacing_hz * (1.0 + ROUNDING));
        if last >= first {
            return Ok((first as usize, (last - first) as usize + 1));
        }
        let Band { from_hz, to_hz } = *self;
        Err(ExcitationError::NoLine { from_hz, to_hz, spacing_hz, length })
    }
}

/// Returns the length `name` in samples, which must be an integer.
pub(super) fn whole_samples(name: &'static str, length_s: f64, rate_hz: f64) -> Result<usize, ExcitationError> {
    const ROUNDING: f64 = 1e-9;
    let whole = libm::round(length_s * rate_hz);
    if libm::fabs(length_s * rate_hz - whole) > ROUNDING * whole {
        return Err(ExcitationError::Value { name, got: length_s, expected: "a whole number of samples" });
    }
    // Slightly shortened, as the rounding up in `samples` would otherwise add a sample for the last bit.
    samples(name, whole / rate_hz * (1.0 - ROUNDING), rate_hz)
}

/// Scales the values to a largest magnitude of 1, unless all are zero.
pub(super) fn with_peak_1(mut values: Vec<f64>) -> Vec<f64> {
    let peak = values.iter().fold(0.0_f64, |peak, value| peak.max(libm::fabs(*value)));
    if peak > 0.0 {
        values.iter_mut().for_each(|value| *value /= peak);
    }
    values
}

/// Returns Gaussian noise: a stretch of Re Σ c_k e^(−2πi kn/N) over the lines k in the band, N a power of two.
/// Real and imaginary parts of the c_k are independent and normal, so the values are jointly normal and
/// stationary. Each part has variance 1, so that every line has the same power, or with a spectrum its level at
/// the line's frequency.
///
/// The band has to be wide enough for the length, called `length` in a scenario.
pub(super) fn noise(
    band: Band,
    (length, samples): (&'static str, usize),
    rate_hz: f64,
    (seed, spectrum): (u64, Option<&Spectrum>),
) -> Result<Vec<f64>, ExcitationError> {
    // The transform is usually longer than the excitation. Cutting a part out of it keeps the noise from being
    // periodic.
    let fft = Fft::at_least(samples);
    let spacing_hz = rate_hz / fft.length() as f64;
    let (first, count) = band.lines(spacing_hz, length)?;
    let mut normal = Noise::new(seed, STREAM);
    let mut values = alloc::vec![Complex::new(0.0, 0.0); fft.length()];
    for (k, value) in values.iter_mut().enumerate().skip(first).take(count) {
        *value = Complex::new(normal.normal(), normal.normal());
        if let Some(spectrum) = spectrum {
            *value *= libm::sqrt(spectrum.level(k as f64 * spacing_hz));
        }
    }
    fft.forward(&mut values);
    Ok(values.iter().take(samples).map(|value| value.re).collect())
}

/// Gates noise: it is on for the first `burst` of every `period` samples, with raised-cosine edges of `ramp`
/// samples.
pub(super) fn gate(values: &mut [f64], burst: f64, period: usize, ramp: f64) {
    for (n, value) in values.iter_mut().enumerate() {
        let at = (n % period) as f64;
        // Negative behind the burst.
        let to_end = at.min(burst - at);
        *value *= if to_end < 0.0 || at >= burst {
            0.0
        } else if to_end >= ramp {
            1.0
        } else {
            0.5 * (1.0 - libm::cos(PI * (to_end / ramp)))
        };
    }
}

/// Returns one period of Σ cos(2πkn/N + φ_k) over the multiples k of 1/`period_s` in the band.
pub(super) fn multisine(
    band: Band,
    samples: usize,
    rate_hz: f64,
    phases: Phases,
    seed: u64,
) -> Result<Vec<f64>, ExcitationError> {
    let (first, count) = band.lines(rate_hz / samples as f64, "period_s")?;
    let mut normal = Noise::new(seed, STREAM);
    // Re e^(iφ) e^(2πi kn/N) is Re e^(−iφ) e^(−2πi kn/N), which a transform sums up. The direction of two normal
    // numbers is uniform.
    let unit = |j: usize| {
        let phase = match phases {
            Phases::Random => libm::atan2(normal.normal(), normal.normal()),
            Phases::Schroeder => -PI * (j as f64 * (j as f64 + 1.0) / count as f64),
        };
        Complex::new(libm::cos(phase), -libm::sin(phase))
    };
    let silent = core::iter::repeat_n(Complex::new(0.0, 0.0), first);
    let transform = Lines::new(samples, first + count, 0, samples);
    Ok(transform.transform(silent.chain((0..count).map(unit))).iter().map(|value| value.re).collect())
}
