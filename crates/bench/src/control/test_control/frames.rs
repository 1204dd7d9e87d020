//! Frames of samples: averaged spectra of what is read, and noise of a given density for the drive.
//!
//! A frame has N samples, a power of two, and frames overlap by half. With Hann's window w, a sample rate fs and the transform
//! X(k) = Σ w(n) x(n) e^(−2πi kn/N), the density of a frame is P(k) = 2 |X(k)|²/(fs Σ w²), and the cross density of two channels
//! is 2 X(k) conj Y(k)/(fs Σ w²).
//!
//! The drive is the sum of frames of the density D with new random phases φ each,
//!
//! ```text
//! X(k) = √(D(k) fs N/2) e^(iφ(k)),   frame = √w · inverse transform of X
//! ```
//!
//! √w² of two frames that overlap by half adds up to 1, so that the power of the sum is constant. All memory is allocated by
//! the constructors.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;
use core::ops::Range;

use nalgebra::Complex;
use resonarm_numeric::dft::Fft;
use resonarm_numeric::noise::Noise;

/// Channels of the frames: control, drive, force in the head; then those with a limit.
pub(super) const CONTROL: usize = 0;
pub(super) const DRIVE: usize = 1;
pub(super) const HEAD: usize = 2;
pub(super) const LIMITED: usize = 3;

const ZERO: Complex<f64> = Complex::new(0.0, 0.0);

/// Averages of the spectra of several channels.
#[derive(Clone, Debug)]
pub(super) struct Frames {
    fft: Fft,
    window: Vec<f64>,
    /// Factor from |X|² to a one-sided density, 2/(fs Σ w²).
    scale: f64,
    /// The last N samples of each channel, of which `filled` are there.
    samples: Vec<Vec<f64>>,
    filled: usize,
    /// Transforms of two channels at a time, as real and imaginary part.
    work: Vec<Complex<f64>>,
    /// Spectra of the last frame, of each channel.
    spectra: Vec<Vec<Complex<f64>>>,
    /// Averaged densities of each channel, unit²/Hz.
    pub density: Vec<Vec<f64>>,
    /// Averaged cross densities of the control channel with the drive and with the head.
    pub with_drive: Vec<Complex<f64>>,
    pub with_head: Vec<Complex<f64>>,
    /// Number of frames that were averaged since the last reset.
    pub averages: u32,
    /// Frames in the memory of the average, which is exponential beyond them.
    memory: u32,
    /// Frames that still overlap what was before the last reset.
    skip: u32,
}

impl Frames {
    /// Returns frames of `length` samples, a power of two, of `channels` channels at `rate_hz`.
    pub fn new(length: usize, channels: usize, rate_hz: f64, memory: u32) -> Frames {
        let window: Vec<f64> = hann(length).collect();
        let energy: f64 = window.iter().map(|w| w * w).sum();
        let lines = length / 2 + 1;
        Frames {
            fft: Fft::at_least(length),
            scale: 2.0 / (rate_hz * energy),
            window,
            samples: vec![vec![0.0; length]; channels],
            filled: 0,
            work: vec![ZERO; length],
            spectra: vec![vec![ZERO; lines]; channels],
            density: vec![vec![0.0; lines]; channels],
            with_drive: vec![ZERO; lines],
            with_head: vec![ZERO; lines],
            averages: 0,
            memory,
            skip: 0,
        }
    }

    /// Averages anew, without the frames that overlap what was before.
    pub fn reset(&mut self) {
        // Frames overlap by half, so that the present one and the next hold samples from before.
        self.averages = 0;
        self.skip = 2;
    }

    /// Forgets the samples of the present frame, since samples were lost.
    pub fn interrupt(&mut self) {
        self.reset();
        self.filled = 0;
    }

    /// Takes the next sample of every channel; values of more channels are left out.
    pub fn push(&mut self, values: impl Iterator<Item = f64>) {
        for (samples, value) in self.samples.iter_mut().zip(values) {
            samples.get_mut(self.filled).into_iter().for_each(|slot| *slot = value);
        }
        self.filled += 1;
    }

    /// Transforms the frame if it is complete. Returns whether it was averaged.
    pub fn process(&mut self) -> bool {
        let length = self.window.len();
        if self.filled < length {
            return false;
        }
        let is_averaged = self.skip == 0;
        if is_averaged {
            self.transform();
            self.average();
        } else {
            self.skip -= 1;
        }
        for samples in &mut self.samples {
            samples.copy_within(length / 2.., 0);
        }
        self.filled = length / 2;
        is_averaged
    }

    /// Transforms two channels at a time. With z = a + ib, A(k) = (Z(k) + conj Z(N−k))/2 and B(k) = (Z(k) − conj Z(N−k))/2i.
    fn transform(&mut self) {
        let length = self.window.len();
        // Two real signals take one complex transform, which halves the work of the sample that ends a frame.
        for first in (0..self.samples.len()).step_by(2) {
            let second = self.samples.get(first + 1);
            for (n, (slot, w)) in self.work.iter_mut().zip(&self.window).enumerate() {
                *slot = Complex::new(self.samples[first][n] * w, second.map_or(0.0, |samples| samples[n] * w));
            }
            self.fft.forward(&mut self.work);
            for k in 0..=length / 2 {
                let z = self.work[k];
                let mirrored = self.work[(length - k) % length].conj();
                self.spectra[first][k] = (z + mirrored) * 0.5;
                let difference = (z - mirrored) * 0.5;
                if let Some(spectrum) = self.spectra.get_mut(first + 1) {
                    spectrum[k] = Complex::new(difference.im, -difference.re);
                }
            }
        }
    }

    fn average(&mut self) {
        self.averages += 1;
        let weight = 1.0 / f64::from(self.averages.min(self.memory));
        let scale = self.scale;
        for (density, spectrum) in self.density.iter_mut().zip(&self.spectra) {
            for (mean, x) in density.iter_mut().zip(spectrum) {
                *mean = blend(*mean, scale * x.norm_sqr(), weight, self.averages);
            }
        }
        for (mean, other) in [(&mut self.with_drive, DRIVE), (&mut self.with_head, HEAD)] {
            let pairs = self.spectra[CONTROL].iter().zip(&self.spectra[other]);
            for (mean, (x, y)) in mean.iter_mut().zip(pairs) {
                let new = x * y.conj() * scale;
                *mean = Complex::new(
                    blend(mean.re, new.re, weight, self.averages),
                    blend(mean.im, new.im, weight, self.averages),
                );
            }
        }
    }
}

/// Returns the mean with a new value; the first one replaces what was before, even if that was not a number.
fn blend(mean: f64, new: f64, weight: f64, averages: u32) -> f64 {
    if averages == 1 { new } else { mean + weight * (new - mean) }
}

/// Returns Hann's window, periodic.
fn hann(length: usize) -> impl Iterator<Item = f64> {
    (0..length).map(move |n| 0.5 - 0.5 * libm::cos(TAU * n as f64 / length as f64))
}

/// Noise of a given density, made of overlapping frames.
#[derive(Clone, Debug)]
pub(super) struct NoiseDrive {
    fft: Fft,
    /// √w over N, which the inverse transform leaves out.
    window: Vec<f64>,
    rate_hz: f64,
    seed: u64,
    noise: Noise,
    work: Vec<Complex<f64>>,
    /// The sum of the frames so far, from the present hop on.
    sum: Vec<f64>,
    /// The samples of the present hop, and the next one's index.
    hop: Vec<f64>,
    next: usize,
}

impl NoiseDrive {
    /// Returns silence, to be followed by noise with the random numbers of `seed`.
    pub fn new(length: usize, rate_hz: f64, seed: u64) -> NoiseDrive {
        NoiseDrive {
            fft: Fft::at_least(length),
            window: hann(length).map(|w| libm::sqrt(w) / length as f64).collect(),
            rate_hz,
            seed,
            noise: Noise::new(seed, STREAM),
            work: vec![ZERO; length],
            sum: vec![0.0; length],
            hop: vec![0.0; length / 2],
            next: length / 2,
        }
    }

    /// Starts over with the same random numbers.
    pub fn restart(&mut self) {
        // A restarted law must repeat its drive bit for bit.
        self.noise = Noise::new(self.seed, STREAM);
        self.sum.fill(0.0);
        self.next = self.hop.len();
    }

    /// Returns whether all samples of the hop have been taken, so that the next one must be made.
    pub fn is_due(&self) -> bool {
        self.next >= self.hop.len()
    }

    /// Drops what is left of the hop, since samples were lost.
    pub fn interrupt(&mut self) {
        self.next = self.hop.len();
    }

    /// Returns the rms of noise of this density over the lines of `band`, in the unit of its root times √Hz.
    pub fn rms(&self, density: &[f64], band: &Range<usize>) -> f64 {
        libm::sqrt(density[band.clone()].iter().sum::<f64>() * self.rate_hz / self.window.len() as f64)
    }

    /// Makes the next hop of noise of `factor` times the density in the lines of `band`, clipped at `most`; a factor of 0 is
    /// silence.
    pub fn make(&mut self, density: &[f64], band: &Range<usize>, factor: f64, most: f64) {
        let length = self.window.len();
        self.work.fill(ZERO);
        if factor > 0.0 {
            for k in band.clone() {
                let size = libm::sqrt(factor * density[k] * self.rate_hz * length as f64 / 2.0);
                let (sine, cosine) = libm::sincos(TAU * self.noise.uniform());
                self.work[k] = Complex::new(size * cosine, size * sine);
                self.work[length - k] = self.work[k].conj();
            }
            self.fft.backward(&mut self.work);
        }
        for ((sum, value), w) in self.sum.iter_mut().zip(&self.work).zip(&self.window) {
            *sum += value.re * w;
        }
        let half = self.hop.len();
        // The sum is clipped and not its frames: the limit is that of what is played.
        for (slot, sum) in self.hop.iter_mut().zip(&self.sum) {
            *slot = sum.clamp(-most, most);
        }
        self.sum.copy_within(half.., 0);
        self.sum[half..].fill(0.0);
        self.next = 0;
    }

    /// Returns the next sample of the hop; 0 if none is left.
    pub fn take(&mut self) -> f64 {
        let value = self.hop.get(self.next).copied().unwrap_or(0.0);
        self.next += 1;
        value
    }
}

/// Stream of random numbers of the drive.
const STREAM: u64 = 0x7e57;

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Normed as _;

    /// Densities of noise through the frames are those that it was made with, and a delayed, scaled copy is coherent.
    #[test]
    fn noise_has_its_density_and_a_copy_is_coherent() {
        let length = 256;
        let rate_hz = 1000.0;
        let band = 10..100;
        let density: Vec<f64> = (0..=length / 2).map(|k| 1e-3 * k as f64).collect();
        let mut drive = NoiseDrive::new(length, rate_hz, 3);
        let mut frames = Frames::new(length, 3, rate_hz, 100_000);
        frames.reset();
        let mut last = 0.0;
        while frames.averages < 2000 {
            if drive.is_due() {
                frames.process();
                drive.make(&density, &band, 4.0, f64::INFINITY);
            }
            let value = drive.take();
            // The order of `CONTROL`, `DRIVE` and `HEAD`.
            frames.push([-3.0 * last, value, value].into_iter());
            last = value;
        }
        let mut deviations = 0.0;
        for (k, density) in density.iter().enumerate().take(98).skip(12) {
            let ratio = frames.density[DRIVE][k] / (4.0 * density);
            deviations += 10.0 * libm::log10(ratio);
            assert!((ratio - 1.0).abs() < 0.1, "{k}: {ratio}");
            let transfer = frames.with_drive[k] / frames.density[DRIVE][k];
            let angle = TAU * k as f64 / length as f64;
            let delay = Complex::new(libm::cos(angle), -libm::sin(angle)) * -3.0;
            assert!((transfer - delay).norm() < 0.05, "{k}: {transfer}");
        }
        assert!((deviations / 86.0).abs() < 0.02, "{deviations}");
        // Hann's window spreads the edge to the next line, but not to the second one.
        assert!(frames.density[DRIVE][103] < 1e-3 * frames.density[DRIVE][90]);
        let rms = libm::sqrt(4.0) * drive.rms(&density, &band);
        let expected = libm::sqrt(4.0 * (10..100).map(|k| density[k]).sum::<f64>() * rate_hz / length as f64);
        assert!((rms - expected).abs() < 1e-12 * expected);
    }

    #[test]
    fn the_drive_is_clipped_and_repeats_by_its_seed() {
        let density = vec![1.0; 65];
        let run = |seed| {
            let mut drive = NoiseDrive::new(128, 100.0, seed);
            let mut values = Vec::new();
            for _ in 0..50 {
                drive.make(&density, &(5..40), 1.0, 5.0);
                (0..64).for_each(|_| values.push(drive.take()));
            }
            values
        };
        let values = run(1);
        assert!(values.iter().all(|value| value.abs() <= 5.0) && values.contains(&5.0));
        assert_eq!(values, run(1));
        assert_ne!(values, run(2));
    }
}
