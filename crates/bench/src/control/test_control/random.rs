//! Random control: noise whose density at the control channel is brought to that of the specification.
//!
//! After the loop check the weak noise goes on until the response H of the structure is known. The first drive is D = R/|H|²,
//! R being the specified density. From then on the ratio of the specified and the measured density C corrects it,
//!
//! ```text
//! D ← D (R/C)^α
//! ```
//!
//! at most by a factor of two under the power. A division by the measured response at every correction would be biased at sharp
//! modes, where the leakage of Hann's window fills the notch that the drive has there. A response Y with a limit L is notched by
//! the same rule: the smaller of R/C and mL/Y counts. Lines of the drive are at most 30 dB above their median, since an
//! antiresonance would otherwise take the whole drive.
//!
//! Levels are played in turn. The average starts anew at each, since the level before would bias it. Within a level the average
//! has a memory of 32 frames, and the drive is corrected every eighth.

use alloc::vec;
use alloc::vec::Vec;

use resonarm_specification::{RandomTest, ScheduleStep, Tolerance};

use super::frames::{CONTROL, DRIVE, LIMITED};
use super::probe::Probe;
use super::stop::StopReason;
use super::{
    ControlSpectrum, End, Law, LawSettings, Step, Stuck, TestControlError, TestPhase, TestProgress, TestSample,
};

/// Frames over which the response is identified.
const IDENTIFIED_FRAMES: u32 = 20;
/// Memory of the average at a level, and the frames from one correction to the next.
const MEMORY: u32 = 32;
const CORRECT_EVERY: u32 = 8;
/// Exponent α of a correction, and the largest ratio that it takes.
const EXPONENT: f64 = 0.3;
const LARGEST_RATIO: f64 = 2.0;
/// Largest density of the drive over the median of its lines.
const LARGEST_OVER_MEDIAN: f64 = 1000.0;
/// Share m of a limit at which a response is held: the estimates scatter about it.
const LIMIT_SHARE: f64 = 0.85;
/// Largest peak of the drive in its rms, unless the specification states one.
const SIGMA: f64 = 3.0;
/// Share of the lines beyond `abort_db` that ends the test, unless the specification states one.
const ABORT_SHARE: f64 = 0.1;
/// Frames after which the lines are judged.
const JUDGED_FRAMES: u32 = 8;
/// Time over which the rms is judged, in frames; and in the inverse bandwidth, since the mean square of noise of a bandwidth B
/// over a time T has 2BT degrees of freedom.
const RMS_FRAMES: f64 = 0.2;
const RMS_BANDWIDTHS: f64 = 20.0;
const RMS_BLOCKS: usize = 10;
/// Mean squares, over the expected one, below which the signal is lost (−7 dB) and above which it is too high (5 dB). With 40
/// degrees of freedom or more, noise of the expected mean square is beyond either once in 10⁹ times.
const LOST: f64 = 0.2;
const TOO_HIGH: f64 = 3.16;
/// The same at a lower level (8 dB), as long as that is not too high for the full one. Weak noise of 10 s tells little of a mode
/// that is narrower than a line, and the first drive spreads into it from the lines beside it; corrections take that away.
const TOO_HIGH_BELOW: f64 = 6.3;
/// Hops at a level before its rms is judged.
const SETTLED_HOPS: u32 = 3;

/// Random control by lines.
#[derive(Clone, Debug)]
pub(super) struct RandomLaw {
    /// Specified density, and the limits of the limited channels, (m/s²)²/Hz; a limit is infinite where there is none.
    demand: Vec<f64>,
    limits: Vec<Vec<f64>>,
    /// Smallest and largest density over the specified one; `None` if the specification states none.
    abort: Option<Vec<[f64; 2]>>,
    abort_share: f64,
    steps: Vec<ScheduleStep>,
    /// Hops of each step, of which the first one is the transition.
    step_hops: Vec<u32>,
    sigma: f64,
    limit_n: f64,
    hop_s: f64,
    /// Medians are found by sorting this copy of the lines.
    sorted: Vec<f64>,
    probe: Probe,
    /// Density of the drive at full level, N²/Hz, and the share of the specified density that limits leave.
    density: Vec<f64>,
    notch: Vec<f64>,
    /// Index of the level in the schedule, and the hops at it.
    level: usize,
    hops: u32,
    full_hops: u32,
    rms: RunningRms,
    stuck: Stuck,
    drive_n: f64,
}

impl RandomLaw {
    /// Builds the law of a random test.
    ///
    /// # Errors
    /// [`TestControlError`] if the specification has no schedule or no line.
    pub fn new(test: &RandomTest, of: &LawSettings<'_>) -> Result<RandomLaw, TestControlError> {
        let schedule = test.schedule.as_ref().ok_or(TestControlError::NoSchedule)?;
        let band_hz = test.profile.band_hz();
        of.check_band(band_hz)?;
        let probe = Probe::new(of, of.limits.response.len(), band_hz, test.lines_hz, MEMORY);
        let band = probe.band.clone();
        let line_hz = probe.line_hz;
        let lines = probe.silence.len();
        let over_lines = |outside: f64, level: &dyn Fn(f64) -> Option<f64>| -> Vec<f64> {
            (0..lines).map(|k| level(k as f64 * line_hz).filter(|_| band.contains(&k)).unwrap_or(outside)).collect()
        };
        let demand = over_lines(0.0, &|hz| test.profile.at(hz));
        if band.clone().any(|k| demand[k] <= 0.0) {
            return Err(TestControlError::NoLine { band_hz, line_hz });
        }
        let ratios = |tolerance: &Tolerance| {
            let at = |k| tolerance.at(k as f64 * line_hz).map(|db| libm::pow(10.0, db / 10.0));
            (0..lines).map(at).collect()
        };
        let hop_s = 0.5 / line_hz;
        let hops = |step: &ScheduleStep| 1 + libm::ceil(step.seconds / hop_s - 1e-9) as u32;
        let bandwidth_hz = band.len() as f64 * line_hz;
        let window_s = (RMS_FRAMES / line_hz).max(RMS_BANDWIDTHS / bandwidth_hz);
        Ok(RandomLaw {
            limits: of
                .limits
                .response
                .iter()
                .map(|limit| over_lines(f64::INFINITY, &|hz| limit.profile.at(hz)))
                .collect(),
            abort: test.abort.as_ref().map(ratios),
            abort_share: test.abort_share.unwrap_or(ABORT_SHARE),
            step_hops: schedule.steps.iter().map(hops).collect(),
            steps: schedule.steps.clone(),
            sigma: of.limits.sigma.unwrap_or(SIGMA),
            limit_n: of.limit_n,
            hop_s,
            sorted: Vec::with_capacity(lines),
            demand,
            density: vec![0.0; lines],
            notch: vec![1.0; lines],
            level: 0,
            hops: 0,
            full_hops: 0,
            rms: RunningRms::new(libm::ceil(window_s * of.rate_hz / RMS_BLOCKS as f64) as usize),
            stuck: Stuck::default(),
            drive_n: 0.0,
            probe,
        })
    }

    fn level_db(&self) -> f64 {
        self.steps.get(self.level).map_or(0.0, |step| step.level_db)
    }

    /// Returns the power of the present level over the full one.
    fn level_power(&self) -> f64 {
        libm::pow(10.0, self.level_db() / 10.0)
    }

    /// Finds the first drive by the response to the weak noise.
    fn identify(&mut self) {
        let frames = &self.probe.frames;
        for k in self.probe.band.clone() {
            let drive = frames.density[DRIVE][k].max(f64::MIN_POSITIVE);
            let response = frames.density[CONTROL][k];
            // Where the silence is as loud as the response, a thousandth is left, so that the drive stays finite.
            let gain = (response - self.probe.silence[k]).max(1e-3 * response) / drive;
            self.density[k] = self.demand[k] / gain.max(f64::MIN_POSITIVE);
            self.notch[k] = 1.0;
            for (limit, index) in self.limits.iter().zip(LIMITED..) {
                let limited = frames.density[index][k] / drive * self.density[k];
                self.notch[k] = self.notch[k].min(LIMIT_SHARE * limit[k] / limited);
            }
            self.density[k] *= self.notch[k];
        }
        self.cap();
    }

    /// Corrects the drive by the ratio of what is specified and what is measured.
    fn correct(&mut self) {
        let power = self.level_power();
        let frames = &self.probe.frames;
        for k in self.probe.band.clone() {
            let wanted = self.demand[k] * power / frames.density[CONTROL][k].max(f64::MIN_POSITIVE);
            let mut ratio = wanted;
            for (limit, index) in self.limits.iter().zip(LIMITED..) {
                // Limits are lowered with the level, so that the full level starts within them.
                ratio = ratio.min(LIMIT_SHARE * limit[k] * power / frames.density[index][k].max(f64::MIN_POSITIVE));
            }
            self.notch[k] = ratio / wanted;
            self.density[k] *= libm::pow(ratio.clamp(1.0 / LARGEST_RATIO, LARGEST_RATIO), EXPONENT);
        }
        self.cap();
    }

    /// Limits the lines of the drive to a factor over their median.
    fn cap(&mut self) {
        let lines = &mut self.density[self.probe.band.clone()];
        let sorted = &mut self.sorted;
        sorted.clear();
        sorted.extend_from_slice(lines);
        // Selected and not sorted: only the median is needed, and this runs within one sample of the real-time loop.
        let middle = sorted.len() / 2;
        let (_, median, _) = sorted.select_nth_unstable_by(middle, f64::total_cmp);
        let most = LARGEST_OVER_MEDIAN * *median;
        lines.iter_mut().for_each(|line| *line = line.min(most));
    }

    /// Returns the mean square that the control channel should read, (m/s²)².
    fn expected(&self) -> f64 {
        let lines = self.probe.band.clone().map(|k| self.demand[k] * self.notch[k]);
        self.level_power() * self.probe.line_hz * lines.sum::<f64>()
    }

    /// Returns the share of the lines beyond the deviations that end the test.
    fn share_beyond(&self) -> Option<f64> {
        let abort = self.abort.as_ref()?;
        let power = self.level_power();
        let control = &self.probe.frames.density[CONTROL];
        let is_beyond = |k: &usize| {
            let ratio = control[*k] / (power * self.demand[*k] * self.notch[*k]);
            !(ratio >= abort[*k][0] && ratio <= abort[*k][1])
        };
        let band = self.probe.band.clone();
        let beyond = band.clone().filter(is_beyond).count();
        Some(beyond as f64 / band.len() as f64)
    }

    /// Goes on after an averaged frame.
    fn judge_frame(&mut self) -> Option<End> {
        match self.probe.phase {
            TestPhase::Silence | TestPhase::LoopCheck => match self.probe.judge() {
                Some(Ok(())) => {
                    self.probe.phase = TestPhase::Identification;
                    self.probe.frames.reset();
                }
                Some(Err(end)) => return Some(end),
                None => {}
            },
            TestPhase::Identification if self.probe.frames.averages >= IDENTIFIED_FRAMES => {
                self.identify();
                self.go_to(0);
            }
            TestPhase::Level => {
                let averages = self.probe.frames.averages;
                if averages.is_multiple_of(CORRECT_EVERY) {
                    self.correct();
                }
                let limit = self.abort_share;
                if averages >= JUDGED_FRAMES
                    && let Some(share) = self.share_beyond().filter(|share| *share > limit)
                {
                    return Some(End::Stopped(StopReason::Lines { share, limit }));
                }
            }
            _ => {}
        }
        None
    }

    fn go_to(&mut self, level: usize) {
        self.probe.phase = TestPhase::Level;
        self.level = level;
        self.hops = 0;
        self.probe.frames.reset();
        self.rms.clear();
    }

    /// Counts a hop at the level, and goes on to the next level at the end of this one.
    fn count_hop(&mut self) -> Option<End> {
        let last = self.steps.len().saturating_sub(1);
        if self.hops >= self.step_hops.get(self.level).copied().unwrap_or(0) {
            if self.level == last {
                return Some(End::Complete);
            }
            self.go_to(self.level + 1);
        }
        self.hops += 1;
        // The first hop is the transition from the level before.
        if self.level == last && self.hops > 1 {
            self.full_hops += 1;
        }
        None
    }

    /// Makes the next hop of the drive. Returns the reason to stop if the level needs more force than is allowed.
    fn make_hop(&mut self) -> Option<End> {
        if self.probe.phase != TestPhase::Level {
            self.probe.make_low();
            return None;
        }
        let power = self.level_power();
        let rms_n = libm::sqrt(power) * self.probe.noise.rms(&self.density, &self.probe.band);
        let needed_n = self.sigma * rms_n;
        self.probe.noise.make(&self.density, &self.probe.band, power, needed_n.min(self.limit_n));
        End::of_drive(needed_n, self.limit_n)
    }

    /// Judges the reading of a sample at a level.
    fn judge_sample(&mut self, control_m_s2: f64) -> Option<End> {
        if self.probe.phase != TestPhase::Level {
            return None;
        }
        if let Some(reason) = self.stuck.judge(control_m_s2) {
            return Some(End::Stopped(reason));
        }
        let got = self.rms.push(control_m_s2).filter(|_| self.hops > SETTLED_HOPS)?;
        let expected = self.expected();
        let expected_m_s2 = libm::sqrt(expected);
        let got_m_s2 = libm::sqrt(got);
        // A reading that is not a number is lost, too.
        let is_there = got >= LOST * expected;
        if !is_there {
            return Some(End::Stopped(StopReason::Lost { got_m_s2, expected_m_s2 }));
        }
        let is_full = self.level_db() >= 0.0;
        let too_high = if is_full { TOO_HIGH } else { TOO_HIGH_BELOW.min(TOO_HIGH / self.level_power()) };
        let limit_m_s2 = libm::sqrt(too_high) * expected_m_s2;
        (got_m_s2 > limit_m_s2).then_some(End::Stopped(StopReason::TooHigh { got_m_s2, expected_m_s2, limit_m_s2 }))
    }
}

impl Law for RandomLaw {
    fn restart(&mut self) {
        self.probe.restart();
        self.level = 0;
        self.hops = 0;
        self.full_hops = 0;
        self.drive_n = 0.0;
        self.density.fill(0.0);
        self.notch.fill(1.0);
        self.rms.clear();
        self.stuck = Stuck::default();
    }

    fn step(&mut self, sample: &TestSample<'_>) -> Step {
        if sample.lost > 0 {
            // A gap in the readings would be a step in the frame, and a low level in the mean square.
            self.probe.interrupt();
            self.rms.clear();
            self.stuck = Stuck::default();
        }
        let mut end = self.judge_sample(sample.control_m_s2);
        if self.probe.noise.is_due() {
            if self.probe.frames.process() {
                end = end.or_else(|| self.judge_frame());
            }
            if self.probe.phase == TestPhase::Level {
                end = end.or_else(|| self.count_hop());
            }
            // The hop is made whatever has ended the test, since the drive goes on while it ramps to zero.
            let needs_too_much = self.make_hop();
            end = end.or(needs_too_much);
        }
        self.drive_n = self.probe.noise.take();
        self.probe.push(sample, self.drive_n);
        Step { drive_n: self.drive_n, end }
    }

    fn coast(&mut self, _sample: &TestSample<'_>) -> f64 {
        if self.probe.noise.is_due() {
            self.make_hop();
        }
        self.drive_n = self.probe.noise.take();
        self.drive_n
    }

    fn progress(&self) -> TestProgress {
        let phase = self.probe.phase;
        TestProgress {
            phase,
            level_db: (phase == TestPhase::Level).then(|| self.level_db()),
            full_level_s: f64::from(self.full_hops) * self.hop_s,
            frequency_hz: None,
        }
    }

    fn spectrum(&self) -> Option<ControlSpectrum<'_>> {
        let frames = &self.probe.frames;
        (self.probe.phase == TestPhase::Level && frames.averages > 0).then(|| ControlSpectrum {
            line_hz: self.probe.line_hz,
            band: self.probe.band.clone(),
            level_db: self.level_db(),
            averages: frames.averages.min(MEMORY),
            demand: &self.demand,
            control: &frames.density[CONTROL],
            drive: &frames.density[DRIVE],
        })
    }

    fn samples(&self) -> Option<u64> {
        // The first two frames of an average are left out.
        let hops = 2 + IDENTIFIED_FRAMES + self.step_hops.iter().sum::<u32>();
        Some(self.probe.samples() + u64::from(hops) * self.probe.hop_samples())
    }
}

/// Mean square over the last blocks of samples.
#[derive(Clone, Debug)]
struct RunningRms {
    /// Samples of a block.
    block: usize,
    sums: [f64; RMS_BLOCKS],
    /// Blocks that are complete, of which the last ten count; and the samples and the sum of the present one.
    complete: usize,
    count: usize,
    sum: f64,
}

impl RunningRms {
    fn new(block: usize) -> RunningRms {
        RunningRms { block: block.max(1), sums: [0.0; RMS_BLOCKS], complete: 0, count: 0, sum: 0.0 }
    }

    fn clear(&mut self) {
        self.complete = 0;
        self.count = 0;
        self.sum = 0.0;
    }

    /// Takes a sample. Returns the mean square when a block is complete, from the tenth on.
    fn push(&mut self, value: f64) -> Option<f64> {
        self.sum += value * value;
        self.count += 1;
        if self.count < self.block {
            return None;
        }
        self.sums[self.complete % RMS_BLOCKS] = self.sum;
        self.count = 0;
        self.sum = 0.0;
        self.complete += 1;
        (self.complete >= RMS_BLOCKS).then(|| self.sums.iter().sum::<f64>() / (RMS_BLOCKS * self.block) as f64)
    }
}
