//! The loop check, with which every test begins: silence, then weak noise.
//!
//! In silence the noise of the control channel is read. Then the drive plays noise over the band of the test, and the loop is
//! closed if the response is far enough above the silence and coherent with the drive. At the driving point the structure can
//! only take up energy: with the velocity v = a/(iω) and the force F in the head, the power Σ Re(v conj F) must be positive,
//! or a sensor is inverted.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;
use core::ops::Range;

use super::frames::{CONTROL, DRIVE, Frames, LIMITED, NoiseDrive};
use super::stop::StopReason;
use super::{End, LawSettings, TestPhase, TestSample};

/// Rms of the drive during the loop check, N, unless the specification states one.
const LOW_N: f64 = 1.0;
/// Frames over which the silence and the loop check are averaged.
const SILENT_FRAMES: u32 = 4;
const CHECKED_FRAMES: u32 = 10;
/// Least power of the response over that of the silence: an rms of three times.
const LEAST_GAIN: f64 = 9.0;
/// Least coherence, unless the power is `SURE_GAIN` times that of the silence. Leakage lowers the coherence of modes that are
/// narrower than a line to 0.2, while an open cable has 1/10 by chance, so that coherence alone can't decide.
const LEAST_COHERENCE: f64 = 0.3;
const SURE_GAIN: f64 = 1000.0;
/// Spacing of the lines of a loop check whose frames serve nothing else, Hz.
const LINES_HZ: f64 = 1.0;
/// Least accelerance, (m/s²)/N, that of a mass of 10⁹ kg.
const LEAST_ACCELERANCE: f64 = 1e-9;

/// Frames and noise with the loop check.
#[derive(Clone, Debug)]
pub(super) struct Probe {
    pub frames: Frames,
    pub noise: NoiseDrive,
    /// Lines of the band.
    pub band: Range<usize>,
    /// Spacing of the lines, Hz.
    pub line_hz: f64,
    /// Density of the weak noise, N²/Hz, and its rms, N.
    low: Vec<f64>,
    low_n: f64,
    /// Density of the control channel in silence, (m/s²)²/Hz.
    pub silence: Vec<f64>,
    /// Whether the control channel is at the driving point, so that the sign of the power is known.
    checks_sign: bool,
    /// Whether the head has read a force; a protocol need not carry it. Without it the power is not exactly 0, since two
    /// channels are transformed at once, and rounding of one is left in the other.
    has_head: bool,
    pub phase: TestPhase,
    /// Drive of the last sample, N.
    drive_n: f64,
}

impl Probe {
    /// Returns a loop check over a band, for a law that does not go on with its frames.
    pub fn of_check(of: &LawSettings<'_>, band_hz: [f64; 2]) -> Probe {
        Probe::new(of, 0, band_hz, LINES_HZ, u32::MAX)
    }

    /// Returns a loop check over a band, with lines at most `lines_hz` apart and `memory` frames in the memory of averages. The
    /// first `limited` channels with a limit are read, too.
    pub fn new(of: &LawSettings<'_>, limited: usize, band_hz: [f64; 2], lines_hz: f64, memory: u32) -> Probe {
        let rate_hz = of.rate_hz;
        let low_n = of.limits.gain_check_n.unwrap_or(LOW_N);
        // At least 16 samples, so that there are lines at all.
        let length = (libm::ceil(rate_hz / lines_hz) as usize).max(16).next_power_of_two();
        let line_hz = rate_hz / length as f64;
        let lines = length / 2 + 1;
        let [first, last] = [libm::ceil(band_hz[0] / line_hz - 1e-9), libm::floor(band_hz[1] / line_hz + 1e-9)];
        // Line k of the noise has a partner at N − k, which keeps the samples real. Lines 0 and N/2 have none.
        let first = (first as usize).clamp(1, lines - 2);
        let band = first..(last as usize + 1).clamp(first + 1, lines - 1);
        let mut low = vec![0.0; lines];
        low[band.clone()].fill(low_n * low_n / (band.len() as f64 * line_hz));
        let mut frames = Frames::new(length, LIMITED + limited, rate_hz, memory);
        frames.reset();
        Probe {
            frames,
            noise: NoiseDrive::new(length, rate_hz, of.seed),
            silence: vec![0.0; lines],
            band,
            line_hz,
            low,
            low_n,
            checks_sign: of.is_driving_point,
            has_head: false,
            phase: TestPhase::Silence,
            drive_n: 0.0,
        }
    }

    pub fn restart(&mut self) {
        self.frames.interrupt();
        self.noise.restart();
        self.phase = TestPhase::Silence;
        self.drive_n = 0.0;
        self.has_head = false;
    }

    /// Forgets the frame in which samples were lost.
    pub fn interrupt(&mut self) {
        self.frames.interrupt();
        self.noise.interrupt();
    }

    /// Takes the readings of a sample, with the drive that answers it.
    pub fn push(&mut self, sample: &TestSample<'_>, drive_n: f64) {
        let head_n = if sample.head_n.is_finite() { sample.head_n } else { 0.0 };
        self.has_head |= head_n != 0.0;
        // The order of `CONTROL`, `DRIVE`, `HEAD` and `LIMITED`.
        let first = [sample.control_m_s2, drive_n, head_n];
        self.frames.push(first.into_iter().chain(sample.limited_m_s2.iter().copied()));
    }

    /// Makes the next hop of the weak noise, or of silence before it.
    pub fn make_low(&mut self) {
        let factor = if self.phase == TestPhase::Silence { 0.0 } else { 1.0 };
        // Fifteen times the rms is beyond every peak: the weak noise is not clipped.
        self.noise.make(&self.low, &self.band, factor, 15.0 * self.low_n);
    }

    /// Judges an averaged frame in silence and in the loop check. Returns how the check ended, once it has.
    pub fn judge(&mut self) -> Option<Result<(), End>> {
        match self.phase {
            TestPhase::Silence if self.frames.averages >= SILENT_FRAMES => {
                self.silence.copy_from_slice(&self.frames.density[CONTROL]);
                self.phase = TestPhase::LoopCheck;
                self.frames.reset();
                None
            }
            TestPhase::LoopCheck if self.frames.averages >= CHECKED_FRAMES => Some(self.closed()),
            _ => None,
        }
    }

    fn closed(&self) -> Result<(), End> {
        let sum = |density: &[f64]| density[self.band.clone()].iter().sum::<f64>();
        let control = &self.frames.density[CONTROL];
        let response = sum(control);
        // Without any noise, what rounding leaves is no response.
        let drive = sum(&self.frames.density[DRIVE]);
        let gain = response / sum(&self.silence).max(LEAST_ACCELERANCE * LEAST_ACCELERANCE * drive);
        // The mean of the lines' coherence γ² = |S|²/(C D), weighted by the response C.
        let shares = self
            .band
            .clone()
            .map(|k| self.frames.with_drive[k].norm_sqr() / self.frames.density[DRIVE][k].max(f64::MIN_POSITIVE));
        let coherence = shares.sum::<f64>() / response.max(f64::MIN_POSITIVE);
        let is_closed = gain >= LEAST_GAIN && (coherence >= LEAST_COHERENCE || gain >= SURE_GAIN);
        // Written so that a reading that is not a number is no response.
        if !is_closed {
            let decibel = |power: f64| 10.0 * libm::log10(power.max(f64::MIN_POSITIVE));
            return Err(End::Stopped(StopReason::OpenLoop {
                drive_n: self.low_n,
                response_db: decibel(gain),
                coherence,
                least_db: decibel(LEAST_GAIN),
                least_coherence: LEAST_COHERENCE,
            }));
        }
        // Re(a conj F/(iω)) = Im(a conj F)/ω.
        let power_w = |k: usize| self.frames.with_head[k].im / (TAU * k as f64 * self.line_hz) * self.line_hz;
        let taken_w: f64 = self.band.clone().map(power_w).sum();
        if self.checks_sign && self.has_head && taken_w < 0.0 {
            Err(End::Stopped(StopReason::Inverted { got_w: -taken_w }))
        } else {
            Ok(())
        }
    }

    /// Returns the density of the control channel's noise in silence, the mean over the band, (m/s²)²/Hz.
    pub fn noise_density(&self) -> f64 {
        let silence = &self.silence[self.band.clone()];
        silence.iter().sum::<f64>() / silence.len() as f64
    }

    /// Returns the rms of the response per rms of the drive, m/s²/N, without the noise of the silence.
    pub fn gain(&self) -> f64 {
        let control = &self.frames.density[CONTROL];
        let response: f64 = self.band.clone().map(|k| (control[k] - self.silence[k]).max(0.0)).sum();
        let drive: f64 = self.frames.density[DRIVE][self.band.clone()].iter().sum();
        libm::sqrt(response / drive)
    }

    /// Returns the number of samples up to the one with which the loop check ends: both it and the silence begin with two frames
    /// that are left out, and the first frame is complete with the second hop.
    pub fn samples(&self) -> u64 {
        u64::from(1 + 2 + SILENT_FRAMES + 2 + CHECKED_FRAMES) * self.hop_samples() + 1
    }

    /// Returns the number of samples from one frame to the next.
    pub fn hop_samples(&self) -> u64 {
        // Lines go from 0 Hz to half the sample rate, one more than a hop has samples.
        self.silence.len() as u64 - 1
    }

    /// Plays silence and weak noise by itself, for laws that do not go on with frames: answers a sample with the drive, and
    /// returns how the check ended, once it has.
    pub fn step(&mut self, sample: &TestSample<'_>) -> (f64, Option<Result<(), End>>) {
        let mut judged = None;
        if self.noise.is_due() {
            if self.frames.process() {
                judged = self.judge();
            }
            self.make_low();
        }
        self.drive_n = self.noise.take();
        self.push(sample, self.drive_n);
        (self.drive_n, judged)
    }
}
