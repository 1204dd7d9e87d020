//! A controller of swept sines that regulates its amplitude, and its flaws.

use core::f64::consts::{LN_10, SQRT_2, TAU};
use std::rc::Rc;

use nalgebra::Complex;
use resonarm_specification::{Profile, SineTest, Specification, Test};

use super::bench::{Controller, Reading, Word};
use super::plant::{RATE, Sweep};

/// Specified amplitude, m/s².
pub const LEVEL_M_S2: f64 = 3.0;

/// The specification of a sweep.
pub fn text(sweep: &Sweep) -> String {
    let Sweep { band_hz: [from_hz, to_hz], rate_oct_min, tracking, .. } = sweep;
    format!(
        "[spec]\nkind = 'sine'\nsources = []\n[sine]\nfrom_hz = {from_hz}\nrate_oct_min = {rate_oct_min}\n\
         segments = [{{ to_hz = {to_hz}, acceleration_m_s2 = {LEVEL_M_S2} }}]\ntolerance = 0.1\nrate_tolerance = 0.1\n\
         tracking = {tracking}\n"
    )
}

/// What is wrong with a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SineFlaw {
    None,
    /// √2 times the amplitude.
    High,
    /// The phase is that of the present frequency times the time, f(t)t in place of the integral of f.
    NaivePhase,
    /// The frequency stands still for whole seconds.
    Steps,
    /// The sweep is 12 % too fast.
    Fast,
    /// The frequency rises linearly in place of exponentially.
    Linear,
    /// The phase jumps by 1.9 rad in the middle of the sweep.
    Jump,
    /// The sweep ends at three fifths of its time.
    Short,
    DrivesOn,
    /// The amplitude is half as large again until the sweep.
    StartsHigh,
    /// The amplitude is √2 times the rms, smoothed by the filter.
    Rms,
    /// The amplitude is the largest reading, which decays by 9 % in a period.
    Peak,
    IgnoresLoss,
    SeesStuckOnly,
    IgnoresStop,
    HardStop,
    NoAbort,
    NoCheck,
    /// It starts again with the amplitude it had.
    RestartsHigh,
    /// A new level begins with another phase.
    JumpsAtLevel,
    IgnoresLevel,
    /// It takes missing samples for a lost vibration, and raises its drive at the fastest rate.
    RaisesInGap,
    StopsAtGap,
    NoNotch,
    /// The loop is much slower, or faster, than its modes.
    SlowLoop,
    FastLoop,
}

/// The controllers with their names, and the cases that are meant to find each flaw: one of them must.
pub const CONTROLLERS: &[(SineFlaw, &str, &[&str])] = &[
    (SineFlaw::None, "correct", &[]),
    (SineFlaw::High, "√2 times the amplitude", &["S01"]),
    (SineFlaw::Short, "sweeps 60 % of the band", &["S01"]),
    (SineFlaw::Fast, "sweeps 12 % too fast", &["S02"]),
    (SineFlaw::Linear, "sweeps linearly", &["S02"]),
    (SineFlaw::NaivePhase, "phase f(t)t", &["S02"]),
    (SineFlaw::Steps, "frequency in steps of 1 s", &["S03"]),
    (SineFlaw::Jump, "phase jumps by 1.9 rad", &["S04"]),
    (SineFlaw::DrivesOn, "drives on after the end", &["S05"]),
    (SineFlaw::StartsHigh, "starts 50 % too high", &["S06"]),
    (SineFlaw::Rms, "controls the rms", &["S07"]),
    (SineFlaw::Peak, "controls the peak", &["S07"]),
    (SineFlaw::IgnoresLoss, "ignores a lost channel", &["S08"]),
    (SineFlaw::SeesStuckOnly, "sees a dead channel, not an open one", &["S09"]),
    (SineFlaw::IgnoresStop, "ignores the operator", &["S10"]),
    (SineFlaw::HardStop, "ends without a ramp", &["S10"]),
    (SineFlaw::NoAbort, "no abort", &["S11"]),
    (SineFlaw::NoCheck, "no loop check", &["S12"]),
    (SineFlaw::RestartsHigh, "starts again at the old amplitude", &["S13"]),
    (SineFlaw::JumpsAtLevel, "a new level has a new phase", &["S14"]),
    (SineFlaw::IgnoresLevel, "ignores a new level", &["S14"]),
    (SineFlaw::RaisesInGap, "raises its drive in a gap", &["S15"]),
    (SineFlaw::StopsAtGap, "stops at a gap", &["S15"]),
    (SineFlaw::NoNotch, "no limit of a response", &["S16"]),
    (SineFlaw::SlowLoop, "loop too slow", &["S01", "S17"]),
    (SineFlaw::FastLoop, "loop too fast", &["S01", "S17"]),
];

/// Samples of silence, of the check, of the rise to the level, and at the level before the sweep.
const SILENCE: usize = RATE;
const CHECK: usize = RATE;
const RISE: usize = 2 * RATE;
const STAY: usize = RATE;
/// Amplitude of the drive in the check, N, and the least response over the rms of silence.
const CHECK_N: f64 = 0.2;
const LEAST: f64 = 3.0;
/// Fastest change of the logarithm of the amplitude, 60 dB/s.
const FASTEST: f64 = 60.0 * LN_10 / 20.0;
const RAMP: usize = RATE / 10;
/// Equal readings in a row that are a lost channel; amplitudes over the level at which the test ends, with the times they last.
const STUCK: u32 = 30;
const LOW: (f64, usize) = (0.25, RATE / 10);
const HIGH: (f64, usize) = (2.0, RATE / 50);
/// Samples after a gap in which the amplitude is not judged, since modes beat.
const AFTER_GAP: usize = RATE / 2;
/// Part of its limit at which a response is held.
const NOTCH: f64 = 0.95;

#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Plays,
    /// The drive is multiplied by the number over the length of the ramp.
    Ends(usize),
    Over,
}

/// A controller that regulates its amplitude A by a filter of two poles with the bandwidth that the specification states: d(ln A)/dt = K ln(level/amplitude), at most [`FASTEST`].
#[derive(Clone, Debug)]
pub struct SineLoop {
    test: Rc<SineTest>,
    limit: Option<Rc<Profile>>,
    flaw: SineFlaw,
    gain_1_s: f64,
    state: State,
    /// Samples since the start.
    sample: usize,
    /// Logarithm of the amplitude of the drive over that by the check, and what the check found, N.
    correction: f64,
    first_n: f64,
    level: f64,
    phase_offset: f64,
    silence: f64,
    control: [Complex<f64>; 2],
    response: [Complex<f64>; 2],
    square: [f64; 2],
    peak: f64,
    last: f64,
    same: u32,
    /// Samples since a gap.
    since_gap: usize,
    low: usize,
    high: usize,
}

impl SineLoop {
    /// Follows the specification of a sine, with a gain K and a flaw.
    pub fn new(specification: &Specification, gain_1_s: f64, flaw: SineFlaw) -> SineLoop {
        let Test::Sine(test) = &specification.test else { panic!("the specification is not one of a sine") };
        let gain_1_s = match flaw {
            SineFlaw::SlowLoop => gain_1_s / 10.0,
            SineFlaw::FastLoop => 10.0 * gain_1_s,
            _ => gain_1_s,
        };
        let limit = specification.limits.response.first().filter(|_| flaw != SineFlaw::NoNotch);
        SineLoop {
            test: Rc::new(test.clone()),
            limit: limit.map(|limit| Rc::new(limit.profile.clone())),
            flaw,
            gain_1_s,
            state: State::Plays,
            sample: 0,
            correction: 0.0,
            first_n: LEVEL_M_S2,
            level: LEVEL_M_S2,
            phase_offset: 0.0,
            silence: 0.0,
            control: [Complex::new(0.0, 0.0); 2],
            response: [Complex::new(0.0, 0.0); 2],
            square: [0.0; 2],
            peak: 0.0,
            last: 0.0,
            same: 0,
            since_gap: AFTER_GAP,
            low: 0,
            high: 0,
        }
    }

    fn stop(&mut self) {
        if self.state == State::Plays {
            self.state = State::Ends(if self.flaw == SineFlaw::HardStop { 0 } else { RAMP });
        }
    }

    /// Time from the begin of the sweep, s, and its duration.
    fn time_s(&self) -> f64 {
        (self.sample as f64 - (SILENCE + CHECK + RISE + STAY) as f64) / RATE as f64
    }

    fn duration_s(&self) -> f64 {
        let [from_hz, to_hz] = self.test.band_hz();
        let sweep_s = self.test.sweep_s(from_hz, to_hz);
        if self.flaw == SineFlaw::Fast { sweep_s / 1.12 } else { sweep_s }
    }

    /// Frequency, Hz, and phase, rad, at a time from the begin of the sweep.
    fn turn(&self, t_s: f64) -> [f64; 2] {
        let [from_hz, to_hz] = self.test.band_hz();
        let [hz, phase] = if t_s < 0.0 {
            [from_hz, TAU * from_hz * t_s]
        } else {
            match self.flaw {
                SineFlaw::Fast => {
                    // At 1.12 times the rate of the sweep the phase grows by the integral of f(1.12 t).
                    [self.test.frequency_hz(1.12 * t_s), self.test.phase_rad(1.12 * t_s) / 1.12]
                }
                SineFlaw::Linear => {
                    let rate = (to_hz - from_hz) / self.duration_s();
                    [from_hz + rate * t_s, TAU * (from_hz + 0.5 * rate * t_s) * t_s]
                }
                SineFlaw::NaivePhase => {
                    let hz = self.test.frequency_hz(t_s);
                    [hz, TAU * hz * t_s]
                }
                SineFlaw::Steps => {
                    // Whole seconds at a constant frequency: the sum of the frequencies r^k f is f (r^n − 1)/(r − 1).
                    let whole = t_s.floor();
                    let hz = self.test.frequency_hz(whole);
                    let ratio = self.test.frequency_hz(1.0) / from_hz;
                    [hz, TAU * ((hz - from_hz) / (ratio - 1.0) + hz * (t_s - whole))]
                }
                _ => [self.test.frequency_hz(t_s), self.test.phase_rad(t_s)],
            }
        };
        let jump = if self.flaw == SineFlaw::Jump && t_s > 0.5 * self.duration_s() { 1.9 } else { 0.0 };
        [hz, phase + jump + self.phase_offset]
    }

    /// Ends the test if the channel is lost, or the amplitude far from the level.
    fn watch(&mut self, amplitude: f64, is_limited: bool) {
        let ratio = amplitude / self.level;
        self.low = if ratio < LOW.0 && !is_limited { self.low + 1 } else { 0 };
        self.high = if ratio > HIGH.0 { self.high + 1 } else { 0 };
        let is_stuck = self.same >= STUCK && self.flaw != SineFlaw::IgnoresLoss;
        let is_low = self.low >= LOW.1 && !matches!(self.flaw, SineFlaw::IgnoresLoss | SineFlaw::SeesStuckOnly);
        let is_high = self.high >= HIGH.1 && self.flaw != SineFlaw::NoAbort;
        if is_stuck || is_low || is_high {
            self.stop();
        }
    }
}

impl Controller for SineLoop {
    fn step(&mut self, reading: &Reading) -> Option<f64> {
        let flaw = self.flaw;
        self.sample += 1 + reading.lost;
        if self.state == State::Over {
            return (flaw == SineFlaw::DrivesOn).then(|| 0.5 * libm::sin(0.1 * self.sample as f64));
        }
        self.since_gap = if reading.lost > 0 { 0 } else { self.since_gap + 1 };
        match flaw {
            SineFlaw::StopsAtGap if reading.lost > 0 => self.stop(),
            SineFlaw::RaisesInGap => self.correction += FASTEST * reading.lost as f64 / RATE as f64,
            _ => {}
        }
        let read = reading.control_m_s2;
        self.same = if read == self.last { self.same + 1 } else { 0 };
        self.last = read;
        if self.sample <= SILENCE {
            self.silence += read * read / SILENCE as f64;
            return Some(0.0);
        }
        let t_s = self.time_s();
        let [hz, phase] = self.turn(t_s);
        let weight = 1.0 - libm::exp(-TAU * self.test.tracking * hz / RATE as f64);
        let (sine, cosine) = libm::sincos(phase);
        for (filter, read) in [(&mut self.control, read), (&mut self.response, reading.response_m_s2)] {
            filter[0] += (Complex::new(cosine, -sine) * read - filter[0]) * weight;
            filter[1] += (filter[0] - filter[1]) * weight;
        }
        self.square[0] += (read * read - self.square[0]) * weight;
        self.square[1] += (self.square[0] - self.square[1]) * weight;
        self.peak = read.abs().max(self.peak * (1.0 - 0.1 * weight));
        let [tracked, response] =
            [self.control, self.response].map(|filter| 2.0 * libm::hypot(filter[1].re, filter[1].im));
        let amplitude = match flaw {
            SineFlaw::Rms => SQRT_2 * libm::sqrt(self.square[1]),
            SineFlaw::Peak => self.peak,
            _ => tracked,
        };
        let amplitude_n = if self.sample <= SILENCE + CHECK {
            if self.sample == SILENCE + CHECK {
                if tracked <= LEAST * libm::sqrt(self.silence) && flaw != SineFlaw::NoCheck {
                    self.stop();
                } else {
                    self.first_n = CHECK_N * LEVEL_M_S2 / tracked.max(1e-3);
                }
            }
            CHECK_N
        } else {
            // The level rises by 20 dB, and the loop closes when the filter has seen the sine.
            let share = (self.sample - SILENCE - CHECK) as f64 / RISE as f64;
            let rise = libm::pow(10.0, share.min(1.0) - 1.0);
            let factor = match flaw {
                SineFlaw::High => SQRT_2,
                SineFlaw::StartsHigh if t_s < -0.5 => 1.5,
                _ => 1.0,
            };
            let level = self.level * factor * rise;
            let limit = self.limit.as_ref().and_then(|limit| limit.at(hz)).unwrap_or(f64::INFINITY);
            if share > 0.5 {
                let error = libm::log(f64::min(level / amplitude.max(1e-9), NOTCH * limit / response.max(1e-9)));
                self.correction += (self.gain_1_s * error).clamp(-FASTEST, FASTEST) / RATE as f64;
            }
            if t_s > -1.0 && self.since_gap >= AFTER_GAP {
                self.watch(amplitude, response > 0.5 * limit);
            }
            let part = if flaw == SineFlaw::Short { 0.6 } else { 1.0 };
            if t_s > part * self.duration_s() - RAMP as f64 / RATE as f64 {
                self.stop();
            }
            level / LEVEL_M_S2 * self.first_n * libm::exp(self.correction)
        };
        let mut force = amplitude_n * cosine;
        if let State::Ends(left) = self.state {
            force *= left as f64 / RAMP as f64;
            self.state = left.checked_sub(1).map_or(State::Over, State::Ends);
        }
        Some(force)
    }

    fn hear(&mut self, word: Word) {
        match (word, self.flaw) {
            (Word::Stop, SineFlaw::IgnoresStop) | (Word::Level(_), SineFlaw::IgnoresLevel) => {}
            (Word::Stop, _) => self.stop(),
            (Word::Level(db), flaw) => {
                self.level = LEVEL_M_S2 * libm::pow(10.0, 0.05 * db);
                if flaw == SineFlaw::JumpsAtLevel {
                    self.phase_offset = 1.0;
                }
            }
            (Word::Start, flaw) if self.state == State::Over => {
                self.state = State::Plays;
                (self.silence, self.same, self.low, self.high) = (0.0, 0, 0, 0);
                if flaw == SineFlaw::RestartsHigh {
                    self.sample = SILENCE + CHECK + RISE;
                } else {
                    (self.sample, self.correction) = (0, 0.0);
                }
            }
            (Word::Start, _) => {}
        }
    }
}
