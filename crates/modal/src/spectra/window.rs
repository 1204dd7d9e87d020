//! Windows and the removal of trends.

use alloc::vec::Vec;
use core::f64::consts::TAU;

/// Window by which a segment is multiplied before its Fourier transform.
///
/// All are sums of cosines, w(n) = Σⱼ (−1)ʲ aⱼ cos(2πjn/N) for n = 0 … N − 1: periodic, so that the sample after the last
/// one would be the first one again. F. J. Harris, "On the Use of Windows for Harmonic Analysis with the Discrete Fourier
/// Transform", Proc. IEEE 66 (1978). The coefficients are those of `scipy.signal.get_window`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Window {
    /// No window: whole periods of a periodic excitation, and transients that begin and end at rest.
    Rectangular,
    /// Hann's window, for random excitation.
    #[default]
    Hann,
    /// Hamming's window, 0.54 − 0.46 cos.
    Hamming,
    /// Blackman's window, three terms of cosines.
    Blackman,
    /// The minimum four-term window of Blackman and Harris, whose side lobes are 92 dB below the peak.
    BlackmanHarris,
    /// The flat-top window, which shows the amplitude of a sinusoid to 0.1 % between the lines, too.
    FlatTop,
}

impl Window {
    /// All windows, in the order of the documents.
    pub const ALL: [Window; 6] =
        [Window::Hann, Window::Rectangular, Window::Hamming, Window::Blackman, Window::BlackmanHarris, Window::FlatTop];

    /// Returns the name in commands and results.
    pub const fn name(self) -> &'static str {
        match self {
            Window::Hann => "hann",
            Window::Rectangular => "rectangular",
            Window::Hamming => "hamming",
            Window::Blackman => "blackman",
            Window::BlackmanHarris => "blackman-harris",
            Window::FlatTop => "flat-top",
        }
    }

    /// Returns the coefficients aⱼ.
    fn coefficients(self) -> &'static [f64] {
        match self {
            Window::Rectangular => &[1.0],
            Window::Hann => &[0.5, 0.5],
            Window::Hamming => &[0.54, 0.46],
            Window::Blackman => &[0.42, 0.5, 0.08],
            Window::BlackmanHarris => &[0.35875, 0.48829, 0.14128, 0.01168],
            Window::FlatTop => &[0.21557895, 0.41663158, 0.277263158, 0.083578947, 0.006947368],
        }
    }

    /// Returns the values of the window at `length` samples.
    pub fn values(self, length: usize) -> Vec<f64> {
        let value = |n: usize| {
            let mut sum = 0.0;
            for (j, coefficient) in self.coefficients().iter().enumerate() {
                // Whole turns are taken off as integers, so that the argument of the cosine keeps its digits.
                let turns = (j * n % length) as f64 / length as f64;
                let sign = if j % 2 == 0 { 1.0 } else { -1.0 };
                sum += sign * coefficient * libm::cos(TAU * turns);
            }
            sum
        };
        (0..length).map(value).collect()
    }
}

/// Trend that is removed from every segment before it is windowed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Detrend {
    /// Leaves the samples as they are.
    #[default]
    None,
    /// Subtracts the mean of each segment.
    Constant,
    /// Subtracts the straight line of least squares.
    Linear,
}

impl Detrend {
    /// All kinds, in the order of the documents.
    pub const ALL: [Detrend; 3] = [Detrend::None, Detrend::Constant, Detrend::Linear];

    /// Returns the name in commands and results.
    pub const fn name(self) -> &'static str {
        match self {
            Detrend::None => "none",
            Detrend::Constant => "constant",
            Detrend::Linear => "linear",
        }
    }

    /// Removes the trend from a segment in place.
    pub(super) fn remove(self, samples: &mut [f64]) {
        let count = samples.len() as f64;
        let mean = samples.iter().sum::<f64>() / count;
        // Times are counted from the middle of the segment, so that mean and slope are independent.
        let middle = 0.5 * (count - 1.0);
        let slope = match self {
            Detrend::None => return,
            Detrend::Constant => 0.0,
            Detrend::Linear => {
                let moment: f64 = samples.iter().enumerate().map(|(n, x)| (n as f64 - middle) * x).sum();
                // Σ (n − middle)² = N (N² − 1)/12, which is 0 for a single sample.
                moment / (count * (count * count - 1.0) / 12.0).max(f64::MIN_POSITIVE)
            }
        };
        for (n, sample) in samples.iter_mut().enumerate() {
            *sample -= mean + slope * (n as f64 - middle);
        }
    }
}
