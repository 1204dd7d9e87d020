//! A controller of random tests, equalised by its reading, and its flaws.

use core::f64::consts::TAU;
use std::rc::Rc;

use nalgebra::Complex;
use resonarm_numeric::dft::Fft;
use resonarm_numeric::noise::Noise;
use resonarm_specification::{Specification, Test};

use super::bench::{Controller, Reading, Word};
use super::plant::RATE;

pub const SPECIFICATION: &str = "[spec]
kind = 'random'
sources = []
[random]
unit = '(m/s2)2/Hz'
breakpoints = [[10, 0.02], [20, 0.2], [100, 0.2], [200, 0.05]]
tolerance_db = [-3, 3]
rms_tolerance = 0.1
lines_hz = 1
[schedule]
levels_db = [-12, -6, -3, 0]
seconds = [5, 5, 5, 60]
[limits]
loss_ms = 500
";

/// What is wrong with a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RandomFlaw {
    None,
    /// No flaw either: lines of constant amplitude with random phases, the usual drive, in place of Gaussian ones.
    ConstantLines,
    /// Half of the specified density.
    Half,
    /// 44 % more than the specified density.
    High,
    /// Ten lines of the profile are 7 dB, or 3 dB, too high.
    TenLines(u8),
    /// Frames overlap by half without a window. The loop corrects the power of their sum, but their ends spread it over all lines.
    NoWindow,
    /// The drive has a uniform distribution.
    Uniform,
    /// The drive is clipped at 1.8 times its rms.
    Clipped,
    /// The phases are those of [`TURN`] frames in turn.
    RepeatedPhases,
    /// Eleven lines are equalised by their mean.
    ElevenLines,
    /// Averages go on at a new level.
    KeepsAverages,
    /// The profile is straight between its points over linear axes.
    LinearProfile,
    /// The full level comes first.
    NoSchedule,
    /// The full level ends 5 s early.
    Short,
    /// A sine at 300 Hz with 4 % of the power is added.
    BeyondBand,
    /// After its end it plays a sine.
    DrivesOn,
    /// It begins whatever the loop check finds.
    NoLoopCheck,
    /// It does not notice that the channel is lost, or only when the reading stands still.
    IgnoresLoss,
    SeesStuckOnly,
    /// It does not stop when the level is too high.
    NoAbort,
    /// It never equalises after the identification.
    NeverEqualises,
    IgnoresClipping,
    NoNotch,
    /// It ends without a ramp.
    HardStop,
    IgnoresStop,
    /// It stops 20 s after the word.
    LateStop,
    /// It starts again at full level.
    RestartsFull,
    /// It stops at a gap in the samples.
    StopsAtGap,
    NoDriveLimit,
    /// It does not notice an inverted sensor.
    NoSignCheck,
}

/// The controllers with their names, and the cases that are meant to find each flaw: one of them must.
pub const CONTROLLERS: &[(RandomFlaw, &str, &[&str])] = &[
    (RandomFlaw::None, "correct, Gaussian lines", &[]),
    (RandomFlaw::ConstantLines, "correct, lines of constant amplitude", &[]),
    (RandomFlaw::Half, "half of the density", &["R01"]),
    (RandomFlaw::TenLines(7), "ten lines 7 dB too high", &["R02"]),
    (RandomFlaw::NoWindow, "frames without a window", &["R01", "R02"]),
    (RandomFlaw::High, "rms 20 % too high", &["R03"]),
    (RandomFlaw::Uniform, "uniform distribution", &["R04"]),
    (RandomFlaw::Clipped, "clipped at 1.8 σ", &["R04"]),
    (RandomFlaw::RepeatedPhases, "phases repeat", &["R05"]),
    (RandomFlaw::KeepsAverages, "averages go on at a new level", &["R01", "R06"]),
    (RandomFlaw::NoSchedule, "full level at once", &["R06"]),
    (RandomFlaw::Short, "5 s too short", &["R07"]),
    (RandomFlaw::BeyondBand, "drive beyond the band", &["R08"]),
    (RandomFlaw::DrivesOn, "drives on after the end", &["R09"]),
    (RandomFlaw::NoLoopCheck, "no loop check", &["R10"]),
    (RandomFlaw::IgnoresLoss, "ignores a lost channel", &["R12"]),
    (RandomFlaw::SeesStuckOnly, "sees a dead channel, not an open one", &["R13"]),
    (RandomFlaw::NoAbort, "no abort", &["R14"]),
    (RandomFlaw::NeverEqualises, "equalises once", &["R15"]),
    (RandomFlaw::IgnoresClipping, "ignores clipping", &["R16"]),
    (RandomFlaw::NoNotch, "no limit of a response", &["R17"]),
    (RandomFlaw::HardStop, "ends without a ramp", &["R18"]),
    (RandomFlaw::IgnoresStop, "ignores the operator", &["R18"]),
    (RandomFlaw::LateStop, "stops 20 s late", &["R18"]),
    (RandomFlaw::RestartsFull, "starts again at full level", &["R19"]),
    (RandomFlaw::StopsAtGap, "stops at a gap", &["R20"]),
    (RandomFlaw::NoDriveLimit, "no limit of the drive", &["R21"]),
    (RandomFlaw::NoSignCheck, "does not check the sign", &["R22"]),
    (RandomFlaw::TenLines(3), "ten lines 3 dB too high", &["R23"]),
    (RandomFlaw::ElevenLines, "equalises eleven lines at once", &["R23"]),
    (RandomFlaw::LinearProfile, "profile straight over linear axes", &["R23"]),
];

const LINES: usize = RATE / 2 + 1;
const HOP: usize = RATE / 2;
/// Averages after which the drive is corrected, by this power of the error, and frames in the memory of the averages.
const EVERY: u32 = 8;
const POWER: f64 = 0.3;
const MEMORY: u32 = 32;
/// Hops of a level, or after a gap, before the averages begin.
const SETTLED: usize = 3;
/// Power of the drive during the identification over that of the specified density, and the hops of it and of the silence.
const WEAK: f64 = 1e-3;
const IDENTIFICATION: usize = 24;
const SILENCE: usize = 6;
/// A response is at least this many times the silence in power, and at least this coherent with the drive.
const LEAST_POWER: f64 = 9.0;
const LEAST_COHERENCE: f64 = 0.3;
/// Power that must come back for an inverted sensor, over the one of force times velocity.
const SIGNED: f64 = 0.02;
/// Lines of the drive are at most this many times their median.
const MOST_OF_MEDIAN: f64 = 1e3;
/// Samples of the ramp at the end, and of that after a gap.
const RAMP: usize = RATE / 10;
/// Samples of the window over which the mean square is watched, and where it ends the test: 5 dB too high, 7 dB too low.
const WATCHED: usize = RATE / 5;
const TOO_HIGH: f64 = 3.16;
const TOO_LOW: f64 = 0.2;
/// Equal readings in a row that are a lost channel.
const STUCK: u32 = 30;
/// Clipped readings that end the test, if no more than one in so many others is clipped.
const CLIPPED: u32 = 5;
const CLIPPED_EVERY: u32 = 50;
/// Frames whose phases repeat.
const TURN: usize = 40;
/// Part of its limit at which a response is held.
const NOTCH: f64 = 0.85;
/// Largest drive over its rms that a test needs.
const SIGMA: f64 = 3.0;

/// What a controller knows from the beginning.
#[derive(Debug)]
struct Plan {
    flaw: RandomFlaw,
    transform: Fft,
    window: Vec<f64>,
    /// Specified density, and the limit of the response, at the lines.
    demand: Vec<f64>,
    limit: Option<Vec<f64>>,
    /// Specified mean square, (m/s²)².
    mean_square: f64,
    drive_limit_n: f64,
    /// Power of each stage over that of the full level, and its hops: silence, identification, levels.
    stages: Vec<(f64, usize)>,
}

/// Spectra of the control channel, the drive and the limited response, averaged over frames.
#[derive(Clone, Debug)]
struct Averages {
    control: Vec<f64>,
    drive: Vec<f64>,
    response: Vec<f64>,
    cross: Vec<Complex<f64>>,
    count: u32,
}

impl Averages {
    fn new() -> Averages {
        let zeros = || vec![0.0; LINES];
        let cross = vec![Complex::new(0.0, 0.0); LINES];
        Averages { control: zeros(), drive: zeros(), response: zeros(), cross, count: 0 }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Plays,
    /// The drive is multiplied by the number over the length of the ramp.
    Ends(usize),
    Over,
}

/// A controller of random tests.
#[derive(Clone, Debug)]
pub struct RandomLoop {
    plan: Rc<Plan>,
    noise: Noise,
    state: State,
    stage: usize,
    /// Hops of the stage, and since a stage or a gap began.
    hops: usize,
    settled: usize,
    averages: Averages,
    /// Power of the reading in silence.
    silence: f64,
    /// Density of the drive at full level, and the gain of power from it to the response.
    density: Vec<f64>,
    through: Vec<f64>,
    /// The last readings of control and response, and the drives that were held before them.
    control: Vec<f64>,
    response: Vec<f64>,
    drive: Vec<f64>,
    held_n: f64,
    /// Spectra of the frames whose phases a flawed controller plays again.
    phases: Vec<Vec<Complex<f64>>>,
    frames: usize,
    /// Half frame that is played, and the half of the next one.
    frame: Vec<f64>,
    rest: Vec<f64>,
    at: usize,
    /// Squares of the last readings with their sum, and how many of them count.
    squares: Vec<f64>,
    sum: f64,
    watched: usize,
    same: u32,
    clipped: u32,
    share: f64,
    /// Samples until a late stop.
    late: Option<usize>,
    sample: usize,
}

impl RandomLoop {
    /// Follows the specification of a random test, with a flaw.
    pub fn new(specification: &Specification, flaw: RandomFlaw, seed: u64) -> RandomLoop {
        let at = |profile: &resonarm_specification::Profile, absent: f64| -> Vec<f64> {
            (0..LINES).map(|line| profile.at(line as f64).unwrap_or(absent)).collect()
        };
        let mut stages = vec![(0.0, SILENCE), (WEAK, IDENTIFICATION)];
        let mut demand = vec![0.0; LINES];
        if let Test::Random(test) = &specification.test {
            demand =
                if flaw == RandomFlaw::LinearProfile { linear(test.profile.points()) } else { at(&test.profile, 0.0) };
            let steps = test.schedule.iter().flat_map(|schedule| &schedule.steps);
            let levels = steps.map(|step| (libm::pow(10.0, 0.1 * step.level_db), (2.0 * step.seconds) as usize));
            let first = if flaw == RandomFlaw::NoSchedule {
                test.schedule.as_ref().map_or(0, |s| s.steps.len() - 1)
            } else {
                0
            };
            stages.extend(levels.skip(first));
        }
        if let (RandomFlaw::Short, Some((_, hops))) = (flaw, stages.last_mut()) {
            *hops -= 10;
        }
        for (line, density) in demand.iter_mut().enumerate() {
            *density *= match flaw {
                RandomFlaw::Half => 0.5,
                RandomFlaw::High => 1.44,
                RandomFlaw::TenLines(db) if (65..75).contains(&line) => libm::pow(10.0, 0.1 * f64::from(db)),
                _ => 1.0,
            };
        }
        let limits = &specification.limits;
        let plan = Plan {
            flaw,
            transform: Fft::at_least(RATE),
            window: (0..RATE).map(|k| 0.5 - 0.5 * libm::cos(TAU * k as f64 / RATE as f64)).collect(),
            mean_square: demand.iter().sum(),
            limit: limits.response.first().map(|limit| at(&limit.profile, f64::INFINITY)),
            drive_limit_n: limits.drive_peak_n.unwrap_or(f64::INFINITY),
            demand,
            stages,
        };
        RandomLoop {
            density: plan.demand.clone(),
            plan: Rc::new(plan),
            noise: Noise::new(seed, 3),
            state: State::Plays,
            stage: 0,
            hops: 0,
            settled: 0,
            averages: Averages::new(),
            silence: 0.0,
            through: vec![0.0; LINES],
            control: vec![0.0; RATE],
            response: vec![0.0; RATE],
            drive: vec![0.0; RATE],
            held_n: 0.0,
            phases: Vec::new(),
            frames: 0,
            frame: vec![0.0; HOP],
            rest: vec![0.0; HOP],
            at: 0,
            squares: vec![0.0; WATCHED],
            sum: 0.0,
            watched: 0,
            same: 0,
            clipped: 0,
            share: 1.0,
            late: None,
            sample: 0,
        }
    }

    fn power(&self) -> f64 {
        self.plan.stages[self.stage].0
    }

    /// Whether a level of the schedule is played.
    fn is_level(&self) -> bool {
        self.stage >= 2
    }

    fn stop(&mut self) {
        if self.state == State::Plays {
            self.state = State::Ends(if self.plan.flaw == RandomFlaw::HardStop { 0 } else { RAMP });
        }
    }

    /// Ends the test if the channel is lost, clipped, or at a wrong level.
    fn watch(&mut self, reading: &Reading, last: f64) {
        let flaw = self.plan.flaw;
        self.same = if reading.control_m_s2 == last { self.same + 1 } else { 0 };
        self.clipped = if reading.is_clipped { self.clipped + CLIPPED_EVERY } else { self.clipped.saturating_sub(1) };
        let slot = &mut self.squares[self.sample % WATCHED];
        let square = reading.control_m_s2 * reading.control_m_s2;
        self.sum += square - *slot;
        *slot = square;
        self.watched += 1;
        if !self.is_level() {
            return;
        }
        let is_stuck = self.same >= STUCK && flaw != RandomFlaw::IgnoresLoss;
        let is_clipped = self.clipped >= CLIPPED * CLIPPED_EVERY && flaw != RandomFlaw::IgnoresClipping;
        // Frames of the level before go on for a moment.
        let is_steady = self.settled >= SETTLED && self.watched >= WATCHED;
        let ratio = self.sum / WATCHED as f64 / (self.power() * self.plan.mean_square);
        let sees_low = !matches!(flaw, RandomFlaw::IgnoresLoss | RandomFlaw::SeesStuckOnly);
        // The limit of a response may take most of the level.
        let least = if self.plan.limit.is_some() { 0.1 * TOO_LOW } else { TOO_LOW };
        let is_low = is_steady && ratio < least && sees_low;
        let is_high = is_steady && ratio > TOO_HIGH && flaw != RandomFlaw::NoAbort;
        if is_stuck || is_clipped || is_low || is_high {
            self.stop();
        }
    }

    /// Adds the spectra of the last frame to the averages.
    fn average(&mut self) {
        let plan = Rc::clone(&self.plan);
        let transformed = |values: &[f64]| {
            let windowed = values.iter().zip(&plan.window).map(|(value, window)| Complex::new(value * window, 0.0));
            let mut lines: Vec<Complex<f64>> = windowed.collect();
            plan.transform.forward(&mut lines);
            lines
        };
        let averages = &mut self.averages;
        averages.count += 1;
        let weight = 1.0 / f64::from(if self.stage < 2 { averages.count } else { averages.count.min(MEMORY) });
        // Hann's window has the mean square 3/8.
        let scale = 2.0 / (0.375 * (RATE * RATE) as f64);
        let add = |average: &mut [f64], lines: &[Complex<f64>]| {
            for (average, line) in average.iter_mut().zip(lines) {
                *average += (scale * line.norm_sqr() - *average) * weight;
            }
        };
        let control = transformed(&self.control);
        add(&mut averages.control, &control);
        if plan.limit.is_some() {
            add(&mut averages.response, &transformed(&self.response));
        }
        if self.stage == 1 {
            let drive = transformed(&self.drive);
            add(&mut averages.drive, &drive);
            for (average, (drive, control)) in averages.cross.iter_mut().zip(drive.iter().zip(&control)) {
                *average += (drive.conj() * control * scale - *average) * weight;
            }
        }
    }

    /// Says whether the loop is closed, and not inverted: the power Re(F* A/iω) goes into the structure. Of one that takes nearly
    /// none the sign can't be seen.
    fn is_closed(&self) -> bool {
        let flaw = self.plan.flaw;
        let band = || (0..LINES).filter(|k| self.plan.demand[*k] > 0.0);
        let Averages { control, drive, cross, .. } = &self.averages;
        let power: f64 = band().map(|k| control[k]).sum();
        let coherent: f64 = band().map(|k| cross[k].norm_sqr() / drive[k].max(f64::MIN_POSITIVE)).sum();
        let into: f64 = band().map(|k| cross[k].im / k as f64).sum();
        let all: f64 = band().map(|k| libm::hypot(cross[k].re, cross[k].im) / k as f64).sum();
        let is_response = power > LEAST_POWER * self.silence && coherent > LEAST_COHERENCE * power;
        let is_inverted = into < -SIGNED * all;
        flaw == RandomFlaw::NoLoopCheck || is_response && (!is_inverted || flaw == RandomFlaw::NoSignCheck)
    }

    /// Corrects the drive by a power of specified over measured density, which the weak drive of the identification has `level`
    /// times. Lines have a largest drive, and one by the limit of the response.
    fn equalise(&mut self, level: f64, exponent: f64, most: f64) {
        let plan = Rc::clone(&self.plan);
        let [wanted, got] = [&plan.demand, &self.averages.control].map(|values| equalised(values, &plan));
        for k in 0..LINES {
            if plan.demand[k] > 0.0 {
                let ratio = (level * wanted[k] / got[k].max(f64::MIN_POSITIVE)).clamp(1.0 / most, most);
                self.density[k] *= libm::pow(ratio, exponent);
            }
        }
        let mut sorted: Vec<f64> = self.density.iter().copied().filter(|density| *density > 0.0).collect();
        sorted.sort_by(f64::total_cmp);
        let largest = MOST_OF_MEDIAN * sorted[sorted.len() / 2];
        let limit = plan.limit.as_ref().filter(|_| plan.flaw != RandomFlaw::NoNotch);
        for k in 0..LINES {
            let notched = limit.map_or(f64::INFINITY, |limit| NOTCH * limit[k] / self.through[k].max(1e-30));
            self.density[k] = self.density[k].min(largest).min(notched);
        }
    }

    /// Works at the end of half a frame, and makes the next one.
    fn hop(&mut self) {
        let plan = Rc::clone(&self.plan);
        self.hops += 1;
        self.settled += 1;
        let (power, flaw) = (self.power(), plan.flaw);
        if self.settled >= SETTLED || flaw == RandomFlaw::KeepsAverages && self.settled == self.hops {
            self.average();
        }
        if self.is_level() && self.averages.count > 0 && self.averages.count.is_multiple_of(EVERY) {
            if plan.limit.is_some() {
                for k in 0..LINES {
                    self.through[k] = self.averages.response[k] / (power * self.density[k]).max(1e-30);
                }
            }
            if flaw != RandomFlaw::NeverEqualises {
                self.equalise(power, POWER, 2.0);
            }
        }
        if self.hops == plan.stages[self.stage].1 {
            self.next();
        }
        self.synthesise();
    }

    /// Goes on to the next stage.
    fn next(&mut self) {
        let plan = Rc::clone(&self.plan);
        if self.stage == 0 {
            self.silence = (0..LINES).filter(|k| plan.demand[*k] > 0.0).map(|k| self.averages.control[k]).sum();
        }
        if self.stage == 1 {
            if !self.is_closed() {
                return self.stop();
            }
            for k in 0..LINES {
                self.through[k] = self.averages.response[k] / (WEAK * plan.demand[k]).max(1e-30);
            }
            self.equalise(WEAK, 1.0, f64::INFINITY);
        }
        if self.stage + 1 == plan.stages.len() {
            return self.stop();
        }
        self.stage += 1;
        self.hops = 0;
        self.settled = 0;
        if plan.flaw != RandomFlaw::KeepsAverages || self.stage <= 2 {
            self.averages = Averages::new();
        }
        if self.is_level() && plan.flaw != RandomFlaw::NoDriveLimit && SIGMA * self.rms_n() > plan.drive_limit_n {
            self.stop();
        }
    }

    fn rms_n(&self) -> f64 {
        libm::sqrt(self.density.iter().sum::<f64>() * self.power())
    }

    /// Makes the next half frame. Frames overlap by half under the root of Hann's window, so that the power of their sum is
    /// constant. Lines X of N samples have the density 2|X|²/(fs N).
    fn synthesise(&mut self) {
        let plan = Rc::clone(&self.plan);
        let mut values = vec![Complex::new(0.0, 0.0); RATE];
        for (value, density) in values.iter_mut().zip(&self.density).filter(|(_, density)| **density > 0.0) {
            let size = libm::sqrt(density * self.power() * (RATE * RATE) as f64 / 4.0);
            let line = if plan.flaw == RandomFlaw::ConstantLines {
                let (sine, cosine) = libm::sincos(TAU * self.noise.uniform());
                Complex::new(cosine, sine) * core::f64::consts::SQRT_2
            } else {
                Complex::new(self.noise.normal(), self.noise.normal())
            };
            *value = line * size;
        }
        if plan.flaw == RandomFlaw::RepeatedPhases && self.power() > 0.0 {
            let size = |value: &Complex<f64>| libm::hypot(value.re, value.im);
            if self.phases.len() < TURN {
                self.phases.push(values.iter().map(|value| value / size(value).max(f64::MIN_POSITIVE)).collect());
            }
            self.frames += 1;
            for (value, phase) in values.iter_mut().zip(&self.phases[(self.frames - 1) % TURN]) {
                *value = *phase * size(value);
            }
        }
        plan.transform.backward(&mut values);
        let rms = self.rms_n();
        // The real part of a one-sided spectrum is half of the two-sided one's.
        let sample = |k: usize| {
            let shape = if plan.flaw == RandomFlaw::NoWindow { 1.0 } else { libm::sqrt(plan.window[k]) };
            2.0 * values[k].re / RATE as f64 * shape
        };
        for k in 0..HOP {
            let force = self.rest[k] + sample(k);
            self.frame[k] = match plan.flaw {
                RandomFlaw::Clipped => force.clamp(-1.8 * rms, 1.8 * rms),
                // The distribution function of a normal number, (1 + erf x/√2)/2, is uniform over 0 to 1, with the variance 1/12.
                RandomFlaw::Uniform if rms > 0.0 => {
                    libm::sqrt(3.0) * rms * libm::erf(force / (core::f64::consts::SQRT_2 * rms))
                }
                _ => force,
            };
            self.rest[k] = sample(HOP + k);
        }
        self.at = 0;
    }
}

impl Controller for RandomLoop {
    fn step(&mut self, reading: &Reading) -> Option<f64> {
        self.sample += 1;
        let flaw = self.plan.flaw;
        if self.state == State::Over {
            let drives_on = (flaw == RandomFlaw::DrivesOn).then(|| 2.0 * libm::sin(0.1 * self.sample as f64));
            self.held_n = drives_on.unwrap_or(0.0);
            return drives_on;
        }
        if reading.lost > 0 {
            (self.settled, self.watched, self.same, self.share) = (0, 0, 0, 0.0);
            self.averages = Averages::new();
            if flaw == RandomFlaw::StopsAtGap {
                self.stop();
            }
        }
        if let Some(late) = &mut self.late {
            *late -= 1;
            if *late == 0 {
                self.late = None;
                self.stop();
            }
        }
        let last = self.control[HOP + (self.at + HOP - 1) % HOP];
        self.watch(reading, last);
        self.control[HOP + self.at] = reading.control_m_s2;
        self.response[HOP + self.at] = reading.response_m_s2;
        self.drive[HOP + self.at] = self.held_n;
        let mut force = self.frame[self.at] * self.share;
        self.share = (self.share + 1.0 / RAMP as f64).min(1.0);
        self.at += 1;
        if self.at == HOP {
            self.hop();
            for values in [&mut self.control, &mut self.response, &mut self.drive] {
                values.copy_within(HOP.., 0);
            }
        }
        if flaw == RandomFlaw::BeyondBand && self.is_level() {
            // A share of 4 % of the power.
            let amplitude = 0.2 * core::f64::consts::SQRT_2 * self.rms_n();
            force += amplitude * libm::sin(TAU * 300.0 * self.sample as f64 / RATE as f64);
        }
        if let State::Ends(left) = self.state {
            force *= left as f64 / RAMP as f64;
            self.state = left.checked_sub(1).map_or(State::Over, State::Ends);
        }
        if flaw != RandomFlaw::NoDriveLimit {
            force = force.clamp(-self.plan.drive_limit_n, self.plan.drive_limit_n);
        }
        self.held_n = force;
        Some(force)
    }

    fn hear(&mut self, word: Word) {
        let flaw = self.plan.flaw;
        match (word, flaw) {
            (Word::Stop, RandomFlaw::IgnoresStop) | (Word::Level(_), _) => {}
            (Word::Stop, RandomFlaw::LateStop) => self.late = Some(20 * RATE),
            (Word::Stop, _) => self.stop(),
            (Word::Start, _) if self.state == State::Over => {
                self.state = State::Plays;
                (self.stage, self.hops, self.settled, self.watched, self.same, self.clipped) = (0, 0, 0, 0, 0, 0);
                self.averages = Averages::new();
                (self.frame, self.rest, self.at) = (vec![0.0; HOP], vec![0.0; HOP], 0);
                if flaw == RandomFlaw::RestartsFull {
                    self.stage = self.plan.stages.len() - 1;
                } else {
                    self.density.clone_from(&self.plan.demand);
                }
            }
            (Word::Start, _) => {}
        }
    }
}

/// A profile that is straight between its points over linear axes, at the lines.
fn linear(points: &[[f64; 2]]) -> Vec<f64> {
    let at = |hz: f64| {
        let [[low_hz, low], [high_hz, high]] =
            points.windows(2).find(|pair| hz <= pair[1][0]).map(|pair| [pair[0], pair[1]])?;
        (hz >= low_hz).then(|| low + (high - low) * (hz - low_hz) / (high_hz - low_hz))
    };
    (0..LINES).map(|line| at(line as f64).unwrap_or(0.0)).collect()
}

/// Means over five lines to either side within the profile, or the values themselves.
fn equalised(values: &[f64], plan: &Plan) -> Vec<f64> {
    let is_inside = |k: &usize| plan.demand[*k] > 0.0;
    let first = (0..LINES).find(is_inside).unwrap_or(0);
    let last = (0..LINES).rfind(is_inside).unwrap_or(0);
    let reach = if plan.flaw == RandomFlaw::ElevenLines { 5 } else { 0 };
    let mean = |line: usize| {
        let near = &values[line.saturating_sub(reach).max(first)..=(line + reach).min(last)];
        near.iter().sum::<f64>() / near.len() as f64
    };
    (0..LINES).map(|line| if (first..=last).contains(&line) { mean(line) } else { 0.0 }).collect()
}
