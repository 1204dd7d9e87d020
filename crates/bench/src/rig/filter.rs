//! Filters of a conditioner, applied to the samples.
//!
//! Both are the analog filter transformed by s = 2 rate (1 − z⁻¹)/(1 + z⁻¹), the bilinear transform, without
//! prewarping: the response at frequency f is that of the analog filter at (rate/π) tan(πf/rate), exactly. So
//! gain and phase are right where the arm vibrates, far below the sample rate: at a twentieth of the rate the
//! analog frequency is 0.8 % higher, at a tenth 3 %. The corner of a low-pass is at (rate/π)
//! atan(π·lowpass_hz/rate).
//!
//! A filter of samples can't remove components that sampling has aliased. Here they are small: the arm has
//! nothing above its second mode but the edges of the held load, and the instruments sample away from those.

use core::f64::consts::{PI, SQRT_2};

/// Second-order section in the transposed direct form II: y = b0 x + s1, s1 ← b1 x − a1 y + s2, s2 ← b2 x − a2
/// y.
#[derive(Clone, Copy, Debug)]
pub(super) struct Section {
    b: [f64; 3],
    a: [f64; 2],
    s: [f64; 2],
}

impl Section {
    /// First-order high-pass s/(s + ω0). With k = ω0/(2 rate): (1 − z⁻¹)/((1 + k) − (1 − k) z⁻¹).
    pub fn highpass(corner_hz: f64, rate_hz: f64) -> Section {
        let k = PI * corner_hz / rate_hz;
        let b = 1.0 / (1.0 + k);
        Section { b: [b, -b, 0.0], a: [(k - 1.0) * b, 0.0], s: [0.0; 2] }
    }

    /// Second-order Butterworth low-pass ω0²/(s² + √2 ω0 s + ω0²) (S. Butterworth, "On the Theory of Filter
    /// Amplifiers", Experimental Wireless 7 (1930)). With k = ω0/(2 rate) it is k² (1 + z⁻¹)² / ((1 + √2 k +
    /// k²) + 2 (k² − 1) z⁻¹ + (1 − √2 k + k²) z⁻²).
    pub fn lowpass(corner_hz: f64, rate_hz: f64) -> Section {
        let k = PI * corner_hz / rate_hz;
        let square = k * k;
        let a0 = 1.0 + SQRT_2 * k + square;
        // All coefficients are divided by a0, the coefficient of the present output.
        let b = square / a0;
        let a = [2.0 * (square - 1.0) / a0, (1.0 - SQRT_2 * k + square) / a0];
        Section { b: [b, 2.0 * b, b], a, s: [0.0; 2] }
    }

    /// Returns the state of the filter.
    pub fn gathered(&mut self) -> &mut [f64; 2] {
        &mut self.s
    }

    /// Settles the filter on the constant input `x` and returns its output.
    pub fn settle(&mut self, x: f64) -> f64 {
        let [b0, b1, b2] = self.b;
        let [a1, a2] = self.a;
        // The gain at z = 1. Zero change of the states then gives s2 and s1 from the equations of the section.
        let y = (b0 + b1 + b2) / (1.0 + a1 + a2) * x;
        let s2 = b2 * x - a2 * y;
        self.s = [b1 * x - a1 * y + s2, s2];
        y
    }

    /// Returns the output for the next input `x`.
    pub fn next(&mut self, x: f64) -> f64 {
        let [b0, b1, b2] = self.b;
        let [a1, a2] = self.a;
        let y = b0 * x + self.s[0];
        self.s = [b1 * x - a1 * y + self.s[1], b2 * x - a2 * y];
        y
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Complex;

    const RATE_HZ: f64 = 1000.0;

    fn size(number: Complex<f64>) -> f64 {
        libm::hypot(number.re, number.im)
    }

    /// The response in steady state, measured: 40 s of a sine, of which the last 10 s are whole periods.
    fn measured(mut section: Section, frequency_hz: f64) -> Complex<f64> {
        let step = 2.0 * PI * frequency_hz / RATE_HZ;
        let mut sum = Complex::new(0.0, 0.0);
        for n in 0..40_000_u32 {
            let phase = step * f64::from(n);
            let y = section.next(libm::cos(phase));
            if n >= 30_000 {
                sum += Complex::new(libm::cos(phase), -libm::sin(phase)) * y;
            }
        }
        sum * (2.0 / 10_000.0)
    }

    #[test]
    fn filters_respond_as_the_analog_ones_at_the_stated_frequency() {
        for frequency_hz in [1.0, 22.1, 59.0, 150.0, 400.0] {
            let s = Complex::new(0.0, 2.0 * RATE_HZ * libm::tan(PI * frequency_hz / RATE_HZ));
            let w = 2.0 * PI * 0.5;
            let highpass = measured(Section::highpass(0.5, RATE_HZ), frequency_hz) - s / (s + w);
            let w = 2.0 * PI * 200.0;
            let analog = w * w / (s * s + s * SQRT_2 * w + w * w);
            let lowpass = measured(Section::lowpass(200.0, RATE_HZ), frequency_hz) - analog;
            assert!(size(highpass) < 1e-6, "{frequency_hz} Hz: {highpass}");
            assert!(size(lowpass) < 1e-6, "{frequency_hz} Hz: {lowpass}");
        }
    }

    /// Against the analog filter itself, at the arm's frequencies.
    #[test]
    fn gain_and_delay_are_right_where_the_arm_vibrates() {
        let frequency_hz = 22.1;
        let corner_hz = 200.0;
        let s = Complex::new(0.0, 2.0 * PI * frequency_hz);
        let w = 2.0 * PI * corner_hz;
        let ratio =
            measured(Section::lowpass(corner_hz, RATE_HZ), frequency_hz) / (w * w / (s * s + s * SQRT_2 * w + w * w));
        assert!((size(ratio) - 1.0).abs() < 1e-5 && libm::atan2(ratio.im, ratio.re).abs() < 4e-4, "{ratio}");
    }

    #[test]
    fn settled_filters_stay_where_they_are() {
        let mut highpass = Section::highpass(0.5, RATE_HZ);
        let mut lowpass = Section::lowpass(123.0, RATE_HZ);
        assert_eq!(highpass.settle(9.80665), 0.0);
        let settled = lowpass.settle(9.80665);
        for _ in 0..1000 {
            assert!(highpass.next(9.80665).abs() < 1e-12);
            assert!((lowpass.next(9.80665) - settled).abs() < 1e-12);
        }
        assert!((settled - 9.80665).abs() < 1e-12);
    }
}
