//! Displacements from accelerations: double integration above a lower corner.
//!
//! Both methods share one zero-phase high-pass. Butterworth's of second order, run forward and backward, has the gain
//! H(f) = 1/(1 + (f0/f)⁴) with the corner f0. The part it removes is filtered again, and the part that passes is added,
//! twice: (1 − H)³ is then removed, and the gain is
//!
//! ```text
//! g(f) = 1 − (1 − H)³ = 1 − (1 + (f/f0)⁴)⁻³      0.875 at f0, 0.9998 at 2 f0
//! ```
//!
//! In the frequency domain the transform of the record, with silence before and after it, is multiplied by −g/ω², which
//! is zero at ω = 0. In the time domain the filter runs by the bilinear transform, which replaces f in H by
//! tan(πf/rate), and the accelerations are integrated by the formula of Numerov (B. V. Noumerov, "A method of
//! extrapolation of perturbations", Mon. Not. R. Astron. Soc. 84 (1924)),
//!
//! ```text
//! x(n+1) − 2 x(n) + x(n−1) = (a(n+1) + 10 a(n) + a(n−1))/(12 rate²)
//! ```
//!
//! with an error of (ω/rate)⁴/240, against (ω/rate)²/6 of the trapezoidal rule. The filter run forward has the factor
//! (1 − z⁻¹)², by which the integration divides: taken together they are one stable section, and no error grows with
//! time.

use alloc::vec::Vec;
use core::f64::consts::{PI, SQRT_2, TAU};

use nalgebra::Complex;

use resonarm_numeric::dft::Fft;

/// Two signals, such as those along x and y, as one complex signal. Every operation here acts equally on both
/// parts.
pub(super) type Pair = Complex<f64>;

/// Method of double integration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Integration {
    /// Integration in the frequency domain: the transform of the whole record, over −ω².
    #[default]
    Frequency,
    /// Integration in the time domain: a high-pass run forward and backward, and an integration of fourth order.
    Time,
}

/// A double integration prepared for records of one length.
pub(super) struct Integrator {
    way: Way,
    rate_hz: f64,
    corner_hz: f64,
    /// Number of lines of the transform, which covers the record and the silence after it.
    lines: usize,
}

enum Way {
    Frequency(Fft),
    Time { integrating: Section, passing: Section },
}

impl Integrator {
    /// Prepares for records of `samples` samples, with a corner above 0 and below half the rate. `silence`
    /// samples before and after a record count as zero.
    pub fn new(integration: Integration, samples: usize, silence: usize, rate_hz: f64, corner_hz: f64) -> Integrator {
        let fft = Fft::at_least(samples + silence);
        let lines = fft.length();
        let way = match integration {
            Integration::Frequency => Way::Frequency(fft),
            Integration::Time => Way::Time {
                integrating: Section::integrating(corner_hz, rate_hz),
                passing: Section::highpass(corner_hz, rate_hz),
            },
        };
        Integrator { way, rate_hz, corner_hz, lines }
    }

    /// Integrates accelerations, m/s², to displacements, m, filtered by g.
    pub fn displacements(&self, accelerations: &[Pair]) -> Vec<Pair> {
        match &self.way {
            Way::Frequency(fft) => self.weighted(fft, accelerations, |hz| -self.gain_s2(hz)),
            Way::Time { integrating, passing } => {
                // (1 − H) of what is left is added again, twice: the sum 1 + (1 − H) + (1 − H)² times H is 1 −
                // (1 − H)³.
                let once = backward(*passing, forward(*integrating, accelerations));
                let twice = sum(&once, &taken(*passing, &once));
                sum(&once, &taken(*passing, &twice))
            }
        }
    }

    /// Filters signals by g, without integration.
    pub fn passed(&self, values: &[Pair]) -> Vec<Pair> {
        match &self.way {
            Way::Frequency(fft) => self.weighted(fft, values, |hz| gain(fourth(hz / self.corner_hz))),
            Way::Time { passing, .. } => {
                let lost = taken(*passing, &taken(*passing, &taken(*passing, values)));
                values.iter().zip(lost).map(|(value, lost)| value - lost).collect()
            }
        }
    }

    /// Returns the standard deviation of a displacement over that of white noise in the accelerations, s².
    ///
    /// A filter of gain G multiplies the variance σ² of white noise by the mean of |G|² over all lines up to the sample
    /// rate. Here G is g/ω², or g times Numerov's formula: σ_x² = σ_a² mean(g²/ω⁴). The lines around the corner
    /// contribute nearly all of it.
    pub fn noise_gain_s2(&self) -> f64 {
        let half = self.lines / 2;
        // The line at half the rate stands for both signs already.
        let both_signs = |k: usize| if k == half { 1.0 } else { 2.0 };
        let power = |k: usize| both_signs(k) * square(self.gain_s2(k as f64 * self.rate_hz / self.lines as f64));
        libm::sqrt((1..=half).map(power).sum::<f64>() / self.lines as f64)
    }

    /// Returns the magnitude of displacement over acceleration at a frequency, s².
    fn gain_s2(&self, hz: f64) -> f64 {
        if hz == 0.0 {
            return 0.0;
        }
        let theta = TAU * hz / self.rate_hz;
        match self.way {
            Way::Frequency(_) => gain(fourth(hz / self.corner_hz)) / square(TAU * hz),
            Way::Time { .. } => {
                let ratio = libm::tan(0.5 * theta) / libm::tan(PI * self.corner_hz / self.rate_hz);
                let cosine = libm::cos(theta);
                gain(fourth(ratio)) * (10.0 + 2.0 * cosine) / (24.0 * square(self.rate_hz) * (1.0 - cosine))
            }
        }
    }

    /// Multiplies the transform of the values by a weight, which depends on the frequency, Hz.
    fn weighted(&self, fft: &Fft, values: &[Pair], weight: impl Fn(f64) -> f64) -> Vec<Pair> {
        let mut work = values.to_vec();
        // Silence after the record keeps its end from leaking into its beginning: the transform is periodic.
        work.resize(self.lines, Pair::new(0.0, 0.0));
        fft.forward(&mut work);
        for (k, line) in work.iter_mut().enumerate() {
            // The upper half of the lines are the negative frequencies, which have the same real weight.
            let hz = k.min(self.lines - k) as f64 * self.rate_hz / self.lines as f64;
            *line *= weight(hz) / self.lines as f64;
        }
        fft.backward(&mut work);
        work.truncate(values.len());
        work
    }
}

/// Returns g as a function of (f/f0)⁴: with t = 1 − H = 1/(1 + (f/f0)⁴) it is 1 − t³ = (1 − t)(1 + t + t²), a
/// form that keeps its digits where g is small.
fn gain(ratio4: f64) -> f64 {
    let t = 1.0 / (1.0 + ratio4);
    // 1 − t loses no digits for small t, and also holds for an infinite ratio, where ratio4 · t would be NaN.
    let h = if t > 0.5 { ratio4 * t } else { 1.0 - t };
    h * (1.0 + t + t * t)
}

fn square(value: f64) -> f64 {
    value * value
}

fn fourth(value: f64) -> f64 {
    square(square(value))
}

/// Second-order section in the transposed direct form II: y = b0 x + s1, s1 ← b1 x − a1 y + s2, s2 ← b2 x − a2
/// y.
#[derive(Clone, Copy, Debug)]
struct Section {
    b: [f64; 3],
    a: [f64; 2],
}

impl Section {
    /// Butterworth high-pass s²/(s² + √2 ω0 s + ω0²) by the bilinear transform, with the corner where it is
    /// stated: with k = tan(π f0/rate), (1 − z⁻¹)² / ((1 + √2 k + k²) + 2 (k² − 1) z⁻¹ + (1 − √2 k + k²) z⁻²).
    fn highpass(corner_hz: f64, rate_hz: f64) -> Section {
        let k = libm::tan(PI * corner_hz / rate_hz);
        let a0 = 1.0 + SQRT_2 * k + k * k;
        let b = 1.0 / a0;
        Section { b: [b, -2.0 * b, b], a: [2.0 * (k * k - 1.0) * b, (1.0 - SQRT_2 * k + k * k) * b] }
    }

    /// High-pass with Numerov's double integration: (1 + 10 z⁻¹ + z⁻²)/(12 rate²) in place of (1 − z⁻¹)².
    fn integrating(corner_hz: f64, rate_hz: f64) -> Section {
        let highpass = Section::highpass(corner_hz, rate_hz);
        let b = highpass.b[0] / (12.0 * rate_hz * rate_hz);
        Section { b: [b, 10.0 * b, b], a: highpass.a }
    }

    /// Filters the values in place, starting from silence.
    fn run<'a>(&self, values: impl Iterator<Item = &'a mut Pair>) {
        let [b0, b1, b2] = self.b;
        let [a1, a2] = self.a;
        let mut s = [Pair::new(0.0, 0.0); 2];
        for value in values {
            let x = *value;
            let y = x * b0 + s[0];
            s = [x * b1 - y * a1 + s[1], x * b2 - y * a2];
            *value = y;
        }
    }
}

fn forward(section: Section, values: &[Pair]) -> Vec<Pair> {
    let mut values = values.to_vec();
    section.run(values.iter_mut());
    values
}

fn backward(section: Section, mut values: Vec<Pair>) -> Vec<Pair> {
    section.run(values.iter_mut().rev());
    values
}

/// Returns the part that a high-pass removes when it is run forward and backward.
fn taken(passing: Section, values: &[Pair]) -> Vec<Pair> {
    let mut taken = backward(passing, forward(passing, values));
    taken.iter_mut().zip(values).for_each(|(passed, all)| *passed = all - *passed);
    taken
}

fn sum(a: &[Pair], b: &[Pair]) -> Vec<Pair> {
    a.iter().zip(b).map(|(a, b)| a + b).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Normed as _;

    const RATE_HZ: f64 = 1000.0;
    const CORNER_HZ: f64 = 5.0;
    const WAYS: [Integration; 2] = [Integration::Frequency, Integration::Time];

    fn integrator(integration: Integration, samples: usize) -> Integrator {
        Integrator::new(integration, samples, 800, RATE_HZ, CORNER_HZ)
    }

    /// Sines of many frequencies come out with the stated gain, and in phase.
    #[test]
    fn a_sine_keeps_its_phase_and_has_the_stated_gain() {
        for integration in WAYS {
            let integrator = integrator(integration, 4000);
            for hz in [2.0, 5.0, 10.0, 22.1, 59.0, 120.0] {
                let omega = TAU * hz;
                let turn = |n: usize| {
                    let (sine, cosine) = libm::sincos(omega * n as f64 / RATE_HZ);
                    Pair::new(cosine, sine)
                };
                let displacements =
                    integrator.displacements(&(0..4000).map(|n| -turn(n) * (omega * omega)).collect::<Vec<_>>());
                let passed = integrator.passed(&(0..4000).map(turn).collect::<Vec<_>>());
                let expected = 1.0 - 1.0 / libm::pow(1.0 + fourth(hz / CORNER_HZ), 3.0);
                // At 120 Hz Numerov's formula is exact to 1.4e-3, and the bilinear transform bends the corner a little.
                let close = if integration == Integration::Time { 1.5e-3 * fourth(hz / 120.0) + 2e-4 } else { 1e-5 };
                for n in 1000..3000 {
                    for found in [displacements[n], passed[n]] {
                        let off = found / turn(n) - expected;
                        assert!(off.norm() < close, "{integration:?} {hz} Hz {n}: {off}");
                    }
                }
            }
        }
    }

    /// Against the filter's impulse response: Σ of its squares.
    #[test]
    fn the_noise_gain_is_that_of_the_filter() {
        for integration in WAYS {
            let integrator = integrator(integration, 7000);
            let mut impulse = alloc::vec![Pair::new(0.0, 0.0); 7000];
            impulse[3500] = Pair::new(1.0, 0.0);
            let response = integrator.displacements(&impulse);
            let found = libm::sqrt(response.iter().map(|value| square(value.re)).sum());
            let stated = integrator.noise_gain_s2();
            assert!((found / stated - 1.0).abs() < 1e-6, "{integration:?} {found} {stated}");
        }
    }

    /// An offset is no displacement, and does not grow.
    #[test]
    fn an_offset_leaves_nothing() {
        for integration in WAYS {
            let integrator = integrator(integration, 4000);
            let displacements = integrator.displacements(&alloc::vec![Pair::new(1.0, -2.0); 4000]);
            let largest = displacements[1000..3000].iter().fold(0.0_f64, |largest, value| largest.max(value.norm()));
            assert!(largest < 1e-8, "{integration:?}: {largest}");
        }
    }
}
