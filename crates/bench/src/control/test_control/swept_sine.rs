//! Swept-sine control: a sine whose frequency rises and falls by the specification, and whose amplitude at the control channel
//! is that of the specification.
//!
//! The phase θ(t) is that of [`SineTest::phase_rad`], in closed form by the index of the sample, so that neither lost samples nor
//! a change of level move it. A tracking filter reads the amplitude: two poles of the bandwidth B = 0.15 f on c e^(−iθ),
//!
//! ```text
//! z₁ ← z₁ + a (c e^(−iθ) − z₁),   z₂ ← z₂ + a (z₁ − z₂),   a = 1 − e^(−2πB/fs),   A = 2 |z₂|
//! ```
//!
//! Regulating the amplitude by A alone can't follow a light mode: a change of the drive δ beside the mode is amplified by
//! δ/(ζ fn), so that the loop is stable only for gains K below 2ζω, and such a slow loop is wrong by η/π at the mode, η = ḟ/(4ζ²fn²).
//! So the responses H are identified first, by multisines at low level ([`Identification`]), and the drive is
//!
//! ```text
//! d = Re[ G A₀(f) e^(iθ)/H(f) ]
//! ```
//!
//! with the specified amplitude A₀. The phase of H matters as much as its size: the response then has the phase θ itself. The
//! force for a response A₀ e^(iθ) of constant amplitude is, with G = 1/H and the rate ω̇ of the sweep,
//!
//! ```text
//! ∫ g(τ) A₀ e^(iθ(t − τ)) dτ = A₀ e^(iθ) (G − ½ i ω̇ G″ + …),   θ(t − τ) = θ − ωτ + ½ ω̇ τ² − …
//! ```
//!
//! of which the first term is played. At a mode G is a polynomial, and the second term is Q ḟ/(2π fn²) of the first, 0.6 % at ζ =
//! 0.5 %, 31 Hz and 1 octave a minute, where η/π is 117 %. At an antiresonance G has a pole, and the second term is 2η/π of the
//! first, with the η of the antiresonance: there the sweep itself must be slow, as for any controller.
//!
//! The slow loop dG/dt = K G ln(A₀/A) corrects what the identification has not seen. K is at most the half
//! bandwidth ω_c of the sharpest feature of H that the filter passes: |d ln H/dω| = 1/ω_c is 1/(ζω) at a mode.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::{FRAC_1_SQRT_2, LN_10, TAU};

use nalgebra::Complex;
use resonarm_specification::{Profile, SineTest};

use super::line_bank::{Identification, Known, LineBank, response_at};
use super::probe::Probe;
use super::stop::StopReason;
use super::{End, Law, LawSettings, Step, Stuck, TestControlError, TestPhase, TestProgress, TestSample};

/// Period of the identification, s: lines are 0.125 Hz apart.
const PERIOD_S: f64 = 8.0;
/// Amplitude of the response to the identification over that of the test, rms to rms: −12 dB.
const IDENTIFIED_LEVEL: f64 = 0.25;
/// Level of the first pass of the identification over that of the second one: its peaks are those of resonances, which it does not
/// know yet.
const FIRST_PASS: f64 = 0.5;
/// Share of the drive's limit that the peaks of the identification use at most.
const IDENTIFIED_DRIVE: f64 = 0.25;
/// Time in which the amplitude rises to its level, by 20 dB, and time at the level before the sweep, s.
const RISE_S: f64 = 2.0;
const RISE_DB: f64 = 20.0;
const SETTLE_S: f64 = 2.0;
/// Gain K at most, 1/s, and in the bandwidth of the filter.
const MOST_GAIN: f64 = 8.0;
const GAIN_BANDWIDTHS: f64 = 2.0;
/// Fastest change of the drive, dB/s, unless the specification states one.
const COMPRESSION_DB_S: f64 = 60.0;
/// Largest correction of the drive, as a factor.
const MOST_CORRECTION: f64 = 10.0;
/// Share of a limit at which a response is held.
const LIMIT_SHARE: f64 = 0.95;
/// Relative deviation of the amplitude at which the test ends, unless the specification states one; and amplitude over the level
/// below which the signal is lost in any case.
const ABORT: f64 = 1.0;
const LOST: f64 = 0.25;
/// Times for which an amplitude must be beyond these, s.
const TOO_HIGH_S: f64 = 0.02;
const LOST_S: f64 = 0.1;

/// Swept-sine control with feed-forward of the identified response.
#[derive(Clone, Debug)]
pub(super) struct SweptSineLaw {
    test: SineTest,
    limits: Vec<Profile>,
    rate_hz: f64,
    limit_n: f64,
    probe: Probe,
    identification: Identification,
    /// Half bandwidth of the features of H at each line, rad/s.
    sharpness: Vec<f64>,
    phase: TestPhase,
    /// Sample at which the sine began.
    began: u64,
    /// Duration and phase of one sweep.
    sweep_s: f64,
    sweep_rad: f64,
    /// The filters of the control channel and of the limited ones: z₁ and z₂.
    control: Tracking,
    limited: Vec<Tracking>,
    /// Level over the specified one that the operator has asked for, and the one on the way there, as natural logarithms.
    asked_level: f64,
    level: f64,
    /// Logarithm of the correction G of the amplitude.
    correction: f64,
    /// Samples for which the correction is held, after samples were lost.
    hold: u64,
    too_high: u32,
    lost: u32,
    stuck: Stuck,
    full_samples: u64,
    frequency_hz: f64,
}

/// Filter that follows the sine's frequency, and returns the amplitude of its fundamental.
#[derive(Clone, Copy, Debug, Default)]
struct Tracking {
    z1: Complex<f64>,
    z2: Complex<f64>,
}

impl Tracking {
    /// Takes a reading, turned back by the phase of the sine.
    fn push(&mut self, turned: Complex<f64>, weight: f64) {
        self.z1 += (turned - self.z1) * weight;
        self.z2 += (self.z1 - self.z2) * weight;
    }

    fn amplitude(&self) -> f64 {
        2.0 * libm::sqrt(self.z2.norm_sqr())
    }
}

/// State of the sine at a sample.
#[derive(Clone, Copy, Debug)]
struct Sine {
    frequency_hz: f64,
    phase_rad: f64,
    /// Factor of the level while the amplitude rises.
    rise: f64,
    is_over: bool,
}

impl SweptSineLaw {
    /// Builds the law of a swept sine.
    ///
    /// # Errors
    /// [`TestControlError`] if the samples don't carry the band.
    pub fn new(test: &SineTest, of: &LawSettings<'_>) -> Result<SweptSineLaw, TestControlError> {
        let band_hz @ [from_hz, to_hz] = test.band_hz();
        of.check_band(band_hz)?;
        let period = libm::round(PERIOD_S * of.rate_hz) as usize;
        let bank = LineBank::new(period, of.rate_hz, band_hz);
        let peak_n = IDENTIFIED_DRIVE * of.limit_n;
        let identification = Identification::new(bank, 1 + of.limits.response.len(), of.rate_hz, peak_n);
        let sweep_s = test.sweep_s(from_hz, to_hz);
        Ok(SweptSineLaw {
            limits: of.limits.response.iter().map(|limit| limit.profile.clone()).collect(),
            rate_hz: of.rate_hz,
            limit_n: of.limit_n,
            probe: Probe::of_check(of, band_hz),
            sharpness: vec![0.0; identification.bank.lines()],
            identification,
            phase: TestPhase::Silence,
            began: 0,
            sweep_rad: test.phase_rad(sweep_s),
            sweep_s,
            control: Tracking::default(),
            limited: vec![Tracking::default(); of.limits.response.len()],
            asked_level: 0.0,
            level: 0.0,
            correction: 0.0,
            hold: 0,
            too_high: 0,
            lost: 0,
            stuck: Stuck::default(),
            full_samples: 0,
            frequency_hz: from_hz,
            test: test.clone(),
        })
    }

    /// Returns the sine at a sample. It stands at the first frequency while it rises and settles, then sweeps up and down in
    /// turn: f(t) on the way down is f(T − t), and its phase goes on by θ(T) − θ(T − t).
    fn sine(&self, index: u64) -> Sine {
        let t_s = index.saturating_sub(self.began) as f64 / self.rate_hz;
        let [from_hz, _] = self.test.band_hz();
        let before_s = RISE_S + SETTLE_S;
        if t_s < before_s {
            let rise_db = RISE_DB * ((t_s / RISE_S).min(1.0) - 1.0);
            let rise = libm::exp(LN_10 / 20.0 * rise_db);
            let phase_rad = TAU * from_hz * t_s;
            return Sine { frequency_hz: from_hz, phase_rad, rise, is_over: false };
        }
        let swept_s = t_s - before_s;
        let sweep = libm::floor(swept_s / self.sweep_s);
        let is_over = sweep >= f64::from(self.test.sweeps);
        let sweep = sweep.min(f64::from(self.test.sweeps) - 1.0);
        let swept_within_s = swept_s - sweep * self.sweep_s;
        // Behind the last sweep the sine stands at its last frequency, while the drive ramps to zero.
        let within_s = swept_within_s.min(self.sweep_s);
        let beyond_s = swept_within_s - within_s;
        let (at_s, within_rad) = if sweep % 2.0 == 0.0 {
            (within_s, self.test.phase_rad(within_s))
        } else {
            let left_s = self.sweep_s - within_s;
            (left_s, self.sweep_rad - self.test.phase_rad(left_s))
        };
        let frequency_hz = self.test.frequency_hz(at_s);
        let swept_rad = sweep * self.sweep_rad + within_rad;
        let phase_rad = TAU * (from_hz * before_s + frequency_hz * beyond_s) + swept_rad;
        Sine { frequency_hz, phase_rad, rise: 1.0, is_over }
    }

    /// Returns the place of a frequency among the lines.
    fn place(&self, frequency_hz: f64) -> f64 {
        let bank = &self.identification.bank;
        frequency_hz * bank.period as f64 / self.rate_hz - bank.first as f64
    }

    /// Returns the specified amplitude at a frequency, m/s².
    fn level_m_s2(&self, frequency_hz: f64) -> f64 {
        // The ends of the sweep are rounded.
        let [from_hz, to_hz] = self.test.band_hz();
        self.test.acceleration_m_s2(frequency_hz.clamp(from_hz, to_hz)).unwrap_or(0.0)
    }

    /// Finds how sharp H is at each line: 1/|d ln H/dω|.
    fn find_sharpness(&mut self) {
        let lines = &self.identification.responses[0];
        let step = TAU * self.rate_hz / self.identification.bank.period as f64;
        for (k, sharpness) in self.sharpness.iter_mut().enumerate() {
            let low = k.saturating_sub(1);
            let high = (k + 1).min(lines.len() - 1);
            let ratio = lines[high] / lines[low];
            let logarithm = libm::hypot(0.5 * libm::log(ratio.norm_sqr()), libm::atan2(ratio.im, ratio.re));
            *sharpness = (high - low) as f64 * step / logarithm;
        }
    }

    /// Returns the gain K of the loop at a frequency, 1/s, for a filter of this bandwidth.
    fn gain(&self, frequency_hz: f64, bandwidth_hz: f64) -> f64 {
        let last = self.sharpness.len() - 1;
        let [low, high] = [-1.0, 1.0].map(|side| self.place(frequency_hz + side * bandwidth_hz));
        let low = (low.max(0.0) as usize).min(last);
        let high = (high.max(0.0) as usize).min(last);
        let sharpest = self.sharpness[low..=high].iter().fold(f64::INFINITY, |least, sharp| least.min(*sharp));
        sharpest.min(GAIN_BANDWIDTHS * bandwidth_hz).min(MOST_GAIN)
    }

    /// Returns the rms of the response to the identification, m/s².
    fn identified_m_s2(&self) -> f64 {
        let ends = self.test.segments.iter().flat_map(|segment| [segment.from_hz, segment.to_hz]);
        let largest_m_s2 = ends.map(|hz| self.level_m_s2(hz)).fold(0.0, f64::max);
        IDENTIFIED_LEVEL * FRAC_1_SQRT_2 * largest_m_s2
    }

    /// Begins the identification at a level by the gain that the loop check found.
    fn begin_identification(&mut self) {
        self.identification.begin(FIRST_PASS * self.identified_m_s2() / self.probe.gain());
        self.phase = TestPhase::Identification;
    }

    /// Answers a sample of the identification, and goes on to the sine when the responses are known.
    fn identify(&mut self, sample: &TestSample<'_>) -> f64 {
        let readings = core::iter::once(sample.control_m_s2).chain(sample.limited_m_s2.iter().copied());
        let (drive_n, known) = self.identification.step(readings);
        match known {
            Known::Nothing => {}
            Known::Roughly => {
                let rms_m_s2 = self.identified_m_s2();
                let noise = self.probe.noise_density();
                self.identification.shape(|_| 1.0, 0.0, rms_m_s2, noise);
            }
            Known::Well => {
                self.find_sharpness();
                self.phase = TestPhase::Level;
                self.began = sample.index + 1;
                // The filter lags while the amplitude rises.
                let rise = (RISE_S * self.rate_hz) as u64;
                self.hold = rise + self.settling_samples(self.frequency_hz);
            }
        }
        drive_n
    }

    /// Answers a sample of the sine.
    fn play(&mut self, sample: &TestSample<'_>, learns: bool) -> Step {
        let sine = self.sine(sample.index);
        let Sine { frequency_hz, phase_rad, rise, is_over } = sine;
        self.frequency_hz = frequency_hz;
        let (sin, cos) = libm::sincos(phase_rad);
        let bandwidth_hz = (self.test.tracking * frequency_hz).max(LEAST_BANDWIDTH_HZ);
        let weight = 1.0 - libm::exp(-TAU * bandwidth_hz / self.rate_hz);
        let back = Complex::new(cos, -sin);
        self.control.push(back * sample.control_m_s2, weight);
        for (tracking, reading) in self.limited.iter_mut().zip(sample.limited_m_s2) {
            tracking.push(back * *reading, weight);
        }
        // The level, less where the drive would bring another response beyond its limit.
        let place = self.place(frequency_hz);
        let response = response_at(&self.identification.responses[0], place);
        self.approach_level(frequency_hz);
        let mut level = self.level_m_s2(frequency_hz) * rise * libm::exp(self.level);
        for (lines, limit) in self.identification.responses[1..].iter().zip(&self.limits) {
            if let Some(limit) = limit.at(frequency_hz) {
                let ratio = libm::sqrt((response_at(lines, place) / response).norm_sqr());
                level = level.min(LIMIT_SHARE * limit / ratio);
            }
        }
        let amplitude = self.control.amplitude();
        let mut end = None;
        if learns {
            self.learn(frequency_hz, bandwidth_hz, level, amplitude);
            end = self.judge(level, amplitude, sample.control_m_s2);
            if rise == 1.0 && self.level == 0.0 {
                self.full_samples += 1;
            }
        }
        let force = 1.0 / response * (level * libm::exp(self.correction));
        let needed_n = libm::sqrt(force.norm_sqr());
        let limit_n = self.limit_n;
        end = end.or(End::of_drive(needed_n, limit_n));
        let drive_n = (force.re * cos - force.im * sin).clamp(-limit_n, limit_n);
        Step { drive_n, end: end.or(is_over.then_some(End::Complete)) }
    }

    /// Goes on towards the level that was asked for, as fast as the drive may change. The filter lags meanwhile.
    fn approach_level(&mut self, frequency_hz: f64) {
        if self.level == self.asked_level {
            return;
        }
        let step = self.fastest() / self.rate_hz;
        self.level += (self.asked_level - self.level).clamp(-step, step);
        self.hold = self.hold.max(self.settling_samples(frequency_hz));
    }

    /// Returns the fastest change of the drive, as a natural logarithm a second.
    fn fastest(&self) -> f64 {
        LN_10 / 20.0 * self.test.compression_db_s.unwrap_or(COMPRESSION_DB_S)
    }

    /// Corrects the drive by the amplitude that was read.
    fn learn(&mut self, frequency_hz: f64, bandwidth_hz: f64, level: f64, amplitude: f64) {
        self.hold = self.hold.saturating_sub(1);
        // The filter must have seen the sine before its amplitude counts.
        if self.hold > 0 || amplitude == 0.0 {
            return;
        }
        let mut error = libm::log(level / amplitude);
        for (tracking, limit) in self.limited.iter().zip(&self.limits) {
            if let Some(limit) = limit.at(frequency_hz) {
                error = error.min(libm::log(LIMIT_SHARE * limit / tracking.amplitude()).max(-1.0));
            }
        }
        let fastest = self.fastest();
        let change = (self.gain(frequency_hz, bandwidth_hz) * error).clamp(-fastest, fastest) / self.rate_hz;
        let most = libm::log(MOST_CORRECTION);
        self.correction = (self.correction + change).clamp(-most, most);
    }

    /// Judges the tracked amplitude; returns why the test ends, if it does.
    fn judge(&mut self, level: f64, amplitude: f64, control_m_s2: f64) -> Option<End> {
        if let Some(reason) = self.stuck.judge(control_m_s2) {
            return Some(End::Stopped(reason));
        }
        if self.hold > 0 {
            return None;
        }
        let samples = |seconds: f64| (seconds * self.rate_hz) as u32;
        let abort = self.test.abort.unwrap_or(ABORT);
        let limit = (1.0 + abort) * level;
        let least = (1.0 - abort).max(LOST) * level;
        self.too_high = if amplitude > limit { self.too_high + 1 } else { 0 };
        // An amplitude that is not a number is lost, too.
        self.lost = if amplitude >= least { 0 } else { self.lost + 1 };
        if self.too_high > samples(TOO_HIGH_S) {
            let got_m_s2 = amplitude;
            let expected_m_s2 = level;
            let limit_m_s2 = limit;
            return Some(End::Stopped(StopReason::TooHigh { got_m_s2, expected_m_s2, limit_m_s2 }));
        }
        let got_m_s2 = FRAC_1_SQRT_2 * amplitude;
        let expected_m_s2 = FRAC_1_SQRT_2 * level;
        (self.lost > samples(LOST_S)).then_some(End::Stopped(StopReason::Lost { got_m_s2, expected_m_s2 }))
    }

    /// Returns the samples until the filter has seen the sine.
    fn settling_samples(&self, frequency_hz: f64) -> u64 {
        let bandwidth_hz = (self.test.tracking * frequency_hz).max(LEAST_BANDWIDTH_HZ);
        libm::ceil(self.rate_hz * (1.0 / bandwidth_hz + GAP_S)) as u64
    }
}

/// Least bandwidth of the filter, Hz.
const LEAST_BANDWIDTH_HZ: f64 = 0.5;
/// Time after lost samples in which the plant and the drive fade in again, s.
const GAP_S: f64 = 0.15;

impl Law for SweptSineLaw {
    fn restart(&mut self) {
        // What the identification has found is left: it begins anew behind the loop check, before anything uses it.
        self.probe.restart();
        self.phase = TestPhase::Silence;
        self.control = Tracking::default();
        self.limited.fill(Tracking::default());
        self.asked_level = 0.0;
        self.level = 0.0;
        self.correction = 0.0;
        self.hold = 0;
        self.too_high = 0;
        self.lost = 0;
        self.full_samples = 0;
        self.stuck = Stuck::default();
        self.frequency_hz = self.test.band_hz()[0];
    }

    fn step(&mut self, sample: &TestSample<'_>) -> Step {
        if sample.lost > 0 {
            self.probe.interrupt();
            self.stuck = Stuck::default();
            self.hold = self.settling_samples(self.frequency_hz);
            if self.phase == TestPhase::Identification {
                // The period is no longer whole.
                self.identification.restart();
            }
        }
        match self.phase {
            TestPhase::Level => self.play(sample, true),
            TestPhase::Identification => Step { drive_n: self.identify(sample), end: None },
            _ => {
                let (drive_n, judged) = self.probe.step(sample);
                self.phase = self.probe.phase;
                if judged == Some(Ok(())) {
                    self.begin_identification();
                }
                Step { drive_n, end: judged.and_then(Result::err) }
            }
        }
    }

    fn coast(&mut self, sample: &TestSample<'_>) -> f64 {
        match self.phase {
            TestPhase::Level => self.play(sample, false).drive_n,
            TestPhase::Identification => self.identification.go_on(),
            _ => self.probe.step(sample).0,
        }
    }

    fn set_level(&mut self, level_db: f64) {
        self.asked_level = LN_10 / 20.0 * level_db;
    }

    fn progress(&self) -> TestProgress {
        let is_level = self.phase == TestPhase::Level;
        TestProgress {
            phase: self.phase,
            level_db: is_level.then_some(20.0 / LN_10 * self.level),
            full_level_s: self.full_samples as f64 / self.rate_hz,
            frequency_hz: is_level.then_some(self.frequency_hz),
        }
    }

    fn samples(&self) -> Option<u64> {
        let sine_s = RISE_S + SETTLE_S + f64::from(self.test.sweeps) * self.sweep_s;
        Some(self.probe.samples() + self.identification.samples() + libm::ceil(sine_s * self.rate_hz) as u64 + 1)
    }
}
