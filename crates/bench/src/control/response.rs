//! The response as the exciter's controller reads it, window by window.

use super::LoadKind;
use crate::excitation::{HarmonicFit, Phasor, Profile, SineFit, Window};
use crate::rig::{Measurement, Sampling};

/// Number of channels: head x, y; B x, y; C x, y.
const CHANNELS: usize = Measurement::CHANNELS;

/// The response at one frequency as the controller reads it: of the continuous motion, corrected for the gain
/// of the instruments' converters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResponsePoint {
    /// Frequency of the drive, Hz.
    pub frequency_hz: f64,
    /// Amplitude of the fundamental of the acting load, N or N·m.
    pub load: f64,
    /// Whether `load` is a force at C or a torque.
    pub load_kind: LoadKind,
    /// Standard deviation of `load` due to the noise of the readings, at the stated frequency and amplitude, N
    /// or N·m; `None` where it is not computed.
    pub load_deviation: Option<f64>,
    /// Force in the impedance head along x and y, N. Its phase is relative to the acting drive, the fundamental
    /// of the held load.
    pub head_force_n: [Phasor; 2],
    /// Acceleration of B along x and y, m/s².
    pub acceleration_b_m_s2: [Phasor; 2],
    /// Acceleration of C along x and y, m/s².
    pub acceleration_c_m_s2: [Phasor; 2],
    /// Harmonics 2 and 3 of head x, y; B x, y; C x, y, relative to the same phase, where they are read.
    pub overtones: Option<[[Phasor; 2]; CHANNELS]>,
    /// Lag of the controlled displacement behind the load, rad; `None` in open loop.
    pub lag_rad: Option<f64>,
    /// Relative change of the response while it was read. In open loop it is the change from the first to the
    /// second half of the window, in the channel with the largest acceleration; in closed loop the change of
    /// the followed displacement over the reading.
    pub drift: f64,
    /// Channels with a clipped reading in the window: head x, y; B x, y; C x, y. Clipped readings are left out
    /// of the fit.
    pub clipped: [bool; CHANNELS],
    /// Number of tries of the point; 1 in open loop.
    pub tries: u32,
    /// Whether the controller considers the response settled.
    pub settled: bool,
}

impl ResponsePoint {
    /// Returns a settled response to a force, from harmonics 1 to 3 of head x, y; B x, y; C x, y.
    pub fn of_harmonics(frequency_hz: f64, load: f64, harmonics: &[[Phasor; 3]; CHANNELS]) -> ResponsePoint {
        let overtones = Some(harmonics.map(|[_, second, third]| [second, third]));
        ResponsePoint {
            overtones,
            ..ResponsePoint::of_fundamentals(frequency_hz, load, harmonics.map(|[first, ..]| first))
        }
    }

    /// Returns a settled response to a force, from the fundamentals of head x, y; B x, y; C x, y.
    fn of_fundamentals(frequency_hz: f64, load: f64, [hx, hy, bx, by, cx, cy]: [Phasor; CHANNELS]) -> ResponsePoint {
        ResponsePoint {
            frequency_hz,
            load,
            load_kind: LoadKind::Force,
            load_deviation: None,
            head_force_n: [hx, hy],
            acceleration_b_m_s2: [bx, by],
            acceleration_c_m_s2: [cx, cy],
            overtones: None,
            lag_rad: None,
            drift: 0.0,
            clipped: [false; CHANNELS],
            tries: 1,
            settled: true,
        }
    }

    /// Returns harmonics 2 and 3 of the head's force over its fundamental. `None` where they are not read, or
    /// where the load is a torque, which does not pass the head, so that the head reads noise.
    pub fn force_harmonics(&self) -> Option<[f64; 2]> {
        let overtones = self.overtones.as_ref()?;
        let size = |pair: [Phasor; 2]| libm::sqrt(pair.iter().map(Phasor::norm_sqr).sum());
        let fundamental = size(self.head_force_n);
        let over = |index: usize| size([overtones[0][index], overtones[1][index]]) / fundamental;
        (self.load_kind == LoadKind::Force && fundamental > 0.0).then(|| [over(0), over(1)])
    }

    /// Returns the harmonic distortion of the head's force: harmonics 2 and 3 together over the fundamental;
    /// `None` in the cases of [`ResponsePoint::force_harmonics`].
    pub fn distortion(&self) -> Option<f64> {
        self.force_harmonics().map(|[second, third]| libm::hypot(second, third))
    }

    /// Returns whether a reading in the window was clipped.
    pub fn is_clipped(&self) -> bool {
        self.clipped.contains(&true)
    }

    /// Returns the harmonic of order `order`, from 1 on, of a channel: head x, y; B x, y; C x, y. Zero if it
    /// was not read.
    pub fn harmonic(&self, channel: usize, order: usize) -> Phasor {
        let pairs = [&self.head_force_n, &self.acceleration_b_m_s2, &self.acceleration_c_m_s2];
        match (order, &self.overtones) {
            (1, _) => pairs[channel / 2][channel % 2],
            (2 | 3, Some(overtones)) => overtones[channel][order - 2],
            _ => Phasor::new(0.0, 0.0),
        }
    }

    /// Returns the fundamental of an accelerometer's displacement along an axis, −a/Ω² of the acceleration a,
    /// m. Channels 2 and 3 are B along x and y, 4 and 5 are C.
    pub fn displacement_m(&self, channel: usize) -> Phasor {
        let omega_rad_s = core::f64::consts::TAU * self.frequency_hz;
        self.harmonic(channel, 1) / -(omega_rad_s * omega_rad_s)
    }

    /// Drift above which a response counts as not settled.
    pub const SETTLED_DRIFT: f64 = 0.02;
}

/// Least number of samples per period at which harmonics 2 and 3 are read beside the fundamental; more than six are needed.
pub(super) const SAMPLES_A_PERIOD: f64 = 12.0;

/// Reads the responses of a profile as its samples come in.
#[derive(Clone, Debug)]
pub(super) struct ResponseReader {
    /// Windows that are still to come, each with the amplitude of the load in it.
    windows: alloc::vec::IntoIter<(Window, f64)>,
    sampling: Sampling,
    current: Option<Reading>,
}

/// The reading of one response, sample by sample.
#[derive(Clone, Debug)]
pub(super) struct Reading {
    sampling: Sampling,
    pub window: Window,
    load: f64,
    whole: SineFit<CHANNELS>,
    overtones: Option<HarmonicFit<CHANNELS, 7>>,
    halves: [SineFit<CHANNELS>; 2],
    clipped: [bool; CHANNELS],
}

impl Reading {
    /// Returns a reading of a window, with the load that is meant to act in it.
    pub fn new(window: Window, load: f64, sampling: Sampling) -> Reading {
        let samples = window.end - window.first;
        let half = samples / 2;
        let halves = [SineFit::new(half), SineFit::new(samples - half)];
        let has_overtones = sampling.rate_hz >= SAMPLES_A_PERIOD * window.frequency_hz;
        let overtones = has_overtones.then(|| HarmonicFit::new(samples));
        Reading { sampling, window, load, whole: SineFit::new(samples), overtones, halves, clipped: [false; CHANNELS] }
    }

    /// Adds a sample within the window, with the phase of the drive at the time of the reading, cycles.
    pub fn add(&mut self, sample: &Measurement, phase_cycles: f64) {
        let n = sample.sample;
        let readings = sample.readings();
        for (clipped, reading) in self.clipped.iter_mut().zip(&readings) {
            *clipped |= reading.clipped;
        }
        let values = &readings.map(|reading| reading.within_range());
        let k = n - self.window.first;
        let half = (self.window.end - self.window.first) / 2;
        self.whole.add(k, phase_cycles, values);
        if let Some(overtones) = &mut self.overtones {
            overtones.add(k, phase_cycles, values);
        }
        match k.checked_sub(half) {
            None => self.halves[0].add(k, phase_cycles, values),
            Some(k) => self.halves[1].add(k, phase_cycles, values),
        }
    }

    /// Returns the response to a force; `None` if the samples do not determine it.
    pub fn finish(&self) -> Option<ResponsePoint> {
        let whole = self.whole.finish()?;
        let [first, second] = [self.halves[0].finish()?, self.halves[1].finish()?];
        let mut largest = 0.0;
        let mut drift = f64::INFINITY;
        // The head is left out: near a resonance its force may be small and noisy while the structure moves
        // steadily.
        for channel in 2..CHANNELS {
            let size = libm::hypot(whole[channel].re, whole[channel].im);
            // The strongest acceleration shows the drift with the least noise.
            if size > largest {
                let change = second[channel] - first[channel];
                largest = size;
                drift = libm::hypot(change.re, change.im) / size;
            }
        }
        let [first, second, third] = [1.0, 2.0, 3.0].map(|order| self.sampling.gain(order * self.window.frequency_hz));
        // The fit is that of the readings. Dividing by the converter's gain gives the motion itself.
        let fundamentals = whole.map(|phasor| phasor / first);
        let overtones = self.overtones.as_ref().and_then(HarmonicFit::harmonics::<3>);
        let overtones = overtones.map(|channels| channels.map(|[_, b, c]| [b / second, c / third]));
        Some(ResponsePoint {
            overtones,
            drift,
            clipped: self.clipped,
            settled: drift < ResponsePoint::SETTLED_DRIFT,
            ..ResponsePoint::of_fundamentals(self.window.frequency_hz, self.load, fundamentals)
        })
    }
}

impl ResponseReader {
    pub fn new(profile: &Profile, sampling: Sampling) -> ResponseReader {
        let held = |window: Window| (window, profile.held_load(window.frequency_hz));
        let windows: alloc::vec::Vec<_> = profile.windows().map(held).collect();
        let mut windows = windows.into_iter();
        let current = windows.next().map(|(window, load)| Reading::new(window, load, sampling));
        ResponseReader { windows, sampling, current }
    }

    /// Adds a sample with the phase of the drive at the time of the reading, cycles. Returns the response of a
    /// window that ended before it, if one did.
    pub fn add(&mut self, sample: &Measurement, phase_cycles: f64) -> Option<ResponsePoint> {
        let n = sample.sample;
        let mut done = None;
        // The sample at the end of the window may be lost, so that any sample behind it ends the reading.
        if self.current.as_ref().is_some_and(|reading| n >= reading.window.end) {
            done = self.current.take().and_then(|reading| reading.finish());
            self.current = self.windows.next().map(|(window, load)| Reading::new(window, load, self.sampling));
        }
        if let Some(reading) = self.current.as_mut().filter(|reading| n >= reading.window.first) {
            reading.add(sample, phase_cycles);
        }
        done
    }
}
