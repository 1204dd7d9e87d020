//! Reference controllers of vibration and shock tests: they bring the acceleration at the control channel to what a
//! specification states.
//!
//! A [`TestController`] carries one of three laws, each in a module of its own: `random`, `swept_sine` and `shock`. All begin with
//! the loop check of `probe`, at low level, and end with a ramp to zero, however they end. A law is a function of the samples
//! that it has seen and of a seed: it has no clock, allocates nothing while it runs, and repeats bit for bit.
//!
//! They are a baseline for controllers under test, and are meant to be read. The drive is one force, and the control channel is
//! one axis of the accelerometer C or B, whose *reading* is controlled: what the converter takes off it is not corrected.

mod frames;
mod line_bank;
mod operator;
mod probe;
mod random;
mod shock;
pub(super) mod stop;
mod swept_sine;

use alloc::boxed::Box;
use alloc::string::{String, ToString};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt::Debug;
use core::ops::Range;

use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use operator::{OperatorSpec, OperatorWord, WordFault};
pub use stop::StopReason;

use super::abort::Abort;
use super::response::ResponsePoint;
use super::{Answer, Controller, Length, LoadKind, NeededReading};
use crate::rig::{Load, Measurement};
use crate::structure::OUTPUTS;
use operator::{Deed, Operator};
use random::RandomLaw;
use resonarm_numeric::number::short;
use resonarm_specification::{Limits, Specification, Test};
use shock::ShockLaw;
use swept_sine::SweptSineLaw;

/// Duration of the ramp to zero at the end, s, unless the specification states one.
const RAMP_S: f64 = 0.1;
/// Equal readings in a row after which the control channel counts as stuck. Clipped readings after which the test ends, if they
/// follow each other, or if more than one in so many samples is clipped: peaks of noise are clipped one at a time.
const STUCK_SAMPLES: u32 = 30;
const CLIPPED_SAMPLES: u32 = 5;
const CLIPPED_EVERY: u32 = 50;
/// Lost samples after which the drive fades in again: the plant has ramped its load down meanwhile.
const MOST_LOST: u64 = 5;

/// Control of a test as a scenario states it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TestControlSpec {
    /// Path of the specification, relative to the folder of the scenario.
    pub specification: String,
    /// Direction of the drive, a force, and its largest peak, N.
    pub amplitude: Load,
    /// Seed of the random numbers of the drive.
    #[serde(default, with = "resonarm_numeric::seed")]
    pub seed: u64,
    /// Words that an operator says to the controller.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub operator: Vec<OperatorSpec>,
    /// The specification, once its file has been read.
    #[serde(skip)]
    pub source: Option<Arc<SpecificationSource>>,
}

impl TestControlSpec {
    /// Returns the place of the control channel among the readings of head, B and C; `None` if the specification was not read,
    /// or does not name one channel that the controller reads.
    pub fn control_output(&self) -> Option<usize> {
        match &self.source.as_ref()?.specification.control.channels[..] {
            [channel] => place_of(channel).ok(),
            _ => None,
        }
    }
}

/// A specification with the texts that it was read from, so that a recording can hold them.
#[derive(Clone, Debug, PartialEq)]
pub struct SpecificationSource {
    /// The specification, as it was read and checked.
    pub specification: Specification,
    /// Text of its file.
    pub text: String,
    /// Names and texts of the files of breakpoints that it names.
    pub tables: Vec<(String, String)>,
}

/// Law of a test control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TestLaw {
    /// Random test: the drive's density is equalised line by line.
    Random,
    /// Swept sine: the amplitude follows the specified level.
    SweptSine,
    /// Shocks, classical or by their response spectrum.
    Shock,
}

impl TestLaw {
    /// Returns its name in a scenario.
    pub const fn name(self) -> &'static str {
        match self {
            TestLaw::Random => "random",
            TestLaw::SweptSine => "swept-sine",
            TestLaw::Shock => "shock",
        }
    }
}

/// Reason why a test can't be controlled.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum TestControlError {
    /// The specification has not been read.
    #[error(
        "control: the specification {file} was not read: it is read only with a scenario file, from that file's folder; read the scenario from a file"
    )]
    NotRead {
        /// Path of the specification.
        file: String,
    },
    /// The specification is of another kind than the law.
    #[error("control: `law` is \"{law}\", but the specification is of kind {kind}")]
    Kind {
        /// Law of the control.
        law: &'static str,
        /// Kind of the specification.
        kind: &'static str,
    },
    /// The drive is not a force.
    #[error("control: the drive of a test is a force: give `amplitude` as `exciter_x` and `exciter_y`")]
    NoForce,
    /// The specification does not name one control channel.
    #[error(
        "control: the controllers of tests have one control channel, and the specification names {got}: name one by `channels` of its [control], as \
         [\"c.x\"]"
    )]
    Channels {
        /// Number of channels that it names.
        got: usize,
    },
    /// A channel is not carried to the exciter's controller.
    #[error("control: there is no channel `{got}`: the controllers of tests read b and c along x and y, as \"c.x\"")]
    Channel {
        /// Name of the channel.
        got: String,
    },
    /// A random test has no schedule.
    #[error(
        "control: the specification has no [schedule]: state `levels_db` and `seconds`, as a controller plays them"
    )]
    NoSchedule,
    /// A classical shock has no compensation.
    #[error(
        "control: the shock has no compensation: state `pre_s` and `post_s`, or the structure would move away with the pulse's velocity change"
    )]
    NoCompensation,
    /// No line, or not every line, is within the profile.
    #[error(
        "control: lines {line_hz} Hz apart don't fit the profile from {} to {} Hz: lower `lines_hz` in the specification",
        short(&.band_hz[0]), short(&.band_hz[1])
    )]
    NoLine {
        /// Band of the profile, Hz.
        band_hz: [f64; 2],
        /// Spacing of the lines, Hz.
        line_hz: f64,
    },
    /// The band goes beyond what the sample rate can control.
    #[error(
        "control: the test goes to {} Hz, but {} samples per second control up to {} Hz: raise `simulation.rate_hz`",
        short(.to_hz), short(.rate_hz), short(.most_hz)
    )]
    Rate {
        /// Highest frequency of the test, Hz.
        to_hz: f64,
        /// Sample rate of the plant, Hz.
        rate_hz: f64,
        /// Highest frequency that can be controlled, Hz.
        most_hz: f64,
    },
    /// An operator's word is not possible.
    #[error("control.operator, number {number}: {fault}")]
    Word {
        /// Number of the word.
        number: usize,
        /// Reason for the rejection.
        fault: WordFault,
    },
}

/// Phase of a test.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum TestPhase {
    /// The drive is silent, and the noise of the control channel is read.
    Silence,
    /// Weak noise shows whether the loop is closed.
    LoopCheck,
    /// The response of the structure is identified at low level.
    Identification,
    /// The test is played at one of its levels.
    Level,
    /// The drive ramps to zero.
    Stopping,
    /// The drive is zero for good.
    Ended,
}

/// State of a test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TestProgress {
    /// Phase of the test.
    pub phase: TestPhase,
    /// Level, dB below the full one, while one is played.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub level_db: Option<f64>,
    /// Time at full level so far, s; of shocks 0.
    pub full_level_s: f64,
    /// Frequency of a sine, Hz.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frequency_hz: Option<f64>,
}

/// Spectrum that a random controller controls by.
#[derive(Clone, Debug, PartialEq)]
pub struct ControlSpectrum<'a> {
    /// Spacing of the lines, Hz; the first one is at 0 Hz.
    pub line_hz: f64,
    /// Lines of the profile.
    pub band: Range<usize>,
    /// Level, dB below the full one.
    pub level_db: f64,
    /// Frames in the average.
    pub averages: u32,
    /// Specified density at full level, (m/s²)²/Hz.
    pub demand: &'a [f64],
    /// Averaged density of the control channel, (m/s²)²/Hz.
    pub control: &'a [f64],
    /// Averaged density of the drive, N²/Hz.
    pub drive: &'a [f64],
}

/// State of a test with the spectrum of its last level, as reports state it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TestReport {
    /// State of the test.
    #[serde(flatten)]
    pub progress: TestProgress,
    /// Lines of the average by which a random test is controlled; none before a level, and of other tests.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lines: Vec<TestLine>,
}

/// Line of the average by which a random test is controlled.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TestLine {
    /// Frequency of the line, Hz.
    pub frequency_hz: f64,
    /// Specified density at the level, (m/s²)²/Hz.
    pub demand: f64,
    /// Averaged density of the control channel, (m/s²)²/Hz.
    pub control: f64,
    /// Averaged density of the drive, N²/Hz.
    pub drive: f64,
}

impl TestReport {
    /// Copies the state of a controller; `None` if it controls no test. It allocates, so it is not for the real-time loop.
    pub fn new(controller: &dyn Controller) -> Option<TestReport> {
        let progress = controller.test_progress()?;
        let lines = controller.control_spectrum().map_or(Vec::new(), |spectrum| {
            let power = libm::pow(10.0, spectrum.level_db / 10.0);
            let line = |k: usize| TestLine {
                frequency_hz: k as f64 * spectrum.line_hz,
                demand: power * spectrum.demand[k],
                control: spectrum.control[k],
                drive: spectrum.drive[k],
            };
            spectrum.band.map(line).collect()
        });
        Some(TestReport { progress, lines })
    }
}

/// Readings of a sample that a law works on.
#[derive(Clone, Copy, Debug)]
struct TestSample<'a> {
    /// Index of the sample, from arming.
    index: u64,
    /// Samples that were lost before this one.
    lost: u64,
    /// Acceleration at the control channel, m/s².
    control_m_s2: f64,
    /// Force in the head along the control channel's axis, N; not a number if the protocol does not carry it.
    head_n: f64,
    /// Accelerations of the channels with limits, m/s², in the order of the specification.
    limited_m_s2: &'a [f64],
}

/// Answer of a law to a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Step {
    /// Drive until the next sample, N.
    drive_n: f64,
    /// How the test ends, if it does.
    end: Option<End>,
}

impl End {
    /// Returns the end of a test whose drive exceeds its limit, or is not a number.
    fn of_drive(needed_n: f64, limit_n: f64) -> Option<End> {
        let is_within = needed_n <= limit_n;
        (!is_within).then_some(End::Stopped(StopReason::Drive { needed_n, limit_n }))
    }
}

/// End of a test.
#[derive(Clone, Copy, Debug, PartialEq)]
enum End {
    /// All levels have been played.
    Complete,
    /// The test is stopped.
    Stopped(StopReason),
}

/// A control law: it answers each sample with the drive.
trait Law: Debug + Send {
    /// Starts over at sample 0.
    fn restart(&mut self);

    /// Takes the readings of a sample, and answers with the drive.
    fn step(&mut self, sample: &TestSample<'_>) -> Step;

    /// Continues the drive without judging or learning, while it ramps to zero.
    fn coast(&mut self, sample: &TestSample<'_>) -> f64;

    /// Changes the level, dB over the specified one. Laws whose level is that of a schedule do nothing.
    fn set_level(&mut self, _level_db: f64) {}

    /// Returns the state of the test.
    fn progress(&self) -> TestProgress;

    /// Returns the spectrum that a random law controls by, at a level.
    fn spectrum(&self) -> Option<ControlSpectrum<'_>> {
        None
    }

    /// Returns the number of samples of a test without interruption, up to the one that ends it, as far as it is known
    /// beforehand.
    fn samples(&self) -> Option<u64>;
}

/// What the laws need beside the test itself.
#[derive(Clone, Copy, Debug)]
struct LawSettings<'a> {
    rate_hz: f64,
    /// Largest peak of the drive, N.
    limit_n: f64,
    /// Limits of the specification.
    limits: &'a Limits,
    /// Whether the control channel is where and along which the drive acts.
    is_driving_point: bool,
    seed: u64,
}

impl LawSettings<'_> {
    /// Checks that the samples carry a band: 0.45 of the sample rate leaves two lines to half of it.
    fn check_band(&self, [_, to_hz]: [f64; 2]) -> Result<(), TestControlError> {
        let rate_hz = self.rate_hz;
        let most_hz = HIGHEST * self.rate_hz;
        if to_hz <= most_hz { Ok(()) } else { Err(TestControlError::Rate { to_hz, rate_hz, most_hz }) }
    }
}

/// Highest controlled frequency over the sample rate.
const HIGHEST: f64 = 0.45;

/// Counts equal readings in a row.
#[derive(Clone, Copy, Debug, Default)]
struct Stuck {
    last: Option<f64>,
    same: u32,
}

impl Stuck {
    /// Takes a reading. Returns the reason to stop once it has repeated too often.
    fn judge(&mut self, got_m_s2: f64) -> Option<StopReason> {
        self.same = if self.last == Some(got_m_s2) { self.same + 1 } else { 0 };
        self.last = Some(got_m_s2);
        let samples = self.same;
        (samples >= STUCK_SAMPLES).then_some(StopReason::Stuck { got_m_s2, samples })
    }
}

/// Finds the place of an axis among the outputs by sensor and axis, as `c.x`, or by the name of its channel.
fn place_of(name: &str) -> Result<usize, TestControlError> {
    const NAMES: [(&str, usize); 4] = [("b.x", 2), ("b.y", 3), ("c.x", 4), ("c.y", 5)];
    let short = NAMES.iter().find(|(known, _)| *known == name).map(|(_, place)| *place);
    // Accelerations are controlled, so that the search begins behind the two axes of the head.
    let long = || (2..OUTPUTS.len()).find(|place| OUTPUTS[*place].name.as_str() == name);
    short.or_else(long).ok_or_else(|| TestControlError::Channel { got: name.to_string() })
}

/// Ramp of the drive.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Ramp {
    /// The drive is on; its share rises to 1.
    On,
    /// The drive falls to zero, and the test has ended so.
    Down(End),
}

/// The controller of a test.
#[derive(Debug)]
pub struct TestController {
    law: Box<dyn Law>,
    direction: Load,
    /// Places of the control channel and of the limited ones among the outputs.
    control: usize,
    limited: Vec<usize>,
    /// Readings of the limited channels of the present sample.
    limited_m_s2: Vec<f64>,
    /// Length of the ramp, samples.
    ramp_samples: f64,
    ramp: Ramp,
    /// Share of the drive that is played.
    share: f64,
    last: Option<u64>,
    operator: Operator,
    /// Clipped readings times [`CLIPPED_EVERY`], less the other readings since.
    clipped: u32,
}

impl TestController {
    /// Returns a controller of the law `law` with its specification. The exciter has the limit `limit_n`, and the accelerometer C
    /// is at the driving point if `c_is_driven`.
    ///
    /// # Errors
    /// [`TestControlError`] names what the law can't do.
    pub fn new(
        law: TestLaw,
        spec: &TestControlSpec,
        rate_hz: f64,
        limit_n: f64,
        c_is_driven: bool,
    ) -> Result<TestController, TestControlError> {
        let source = spec.source.as_ref();
        let source = source.ok_or_else(|| TestControlError::NotRead { file: spec.specification.clone() })?;
        let specification = &source.specification;
        let amplitude_n = spec.amplitude.force_n.norm();
        let is_force = amplitude_n > 0.0 && !spec.amplitude.has_torque();
        if !is_force {
            return Err(TestControlError::NoForce);
        }
        let [channel] = &specification.control.channels[..] else {
            return Err(TestControlError::Channels { got: specification.control.channels.len() });
        };
        let control = place_of(channel)?;
        let limits = &specification.limits;
        let limited = limits.response.iter().map(|limit| place_of(&limit.channel)).collect::<Result<Vec<_>, _>>()?;
        let direction = spec.amplitude.scaled(1.0 / amplitude_n);
        // The force along an axis that is not the drive's is that of the other axis as well, so its power has no sign.
        let along = if control % 2 == 0 { direction.force_n.x } else { direction.force_n.y };
        let settings = LawSettings {
            rate_hz,
            // The smallest of what the scenario allows, what the exciter has, and what the specification states.
            limit_n: amplitude_n.min(limit_n).min(limits.drive_peak_n.unwrap_or(f64::INFINITY)),
            limits,
            is_driving_point: c_is_driven && control >= PLACE_OF_C && along.abs() > ALONG,
            seed: spec.seed,
        };
        let operator = Operator::new(&spec.operator, law, rate_hz)?;
        let mut ramp_s = RAMP_S;
        let law: Box<dyn Law> = match (law, &specification.test) {
            (TestLaw::Random, Test::Random(test)) => {
                ramp_s = test.schedule.as_ref().and_then(|schedule| schedule.ramp_down_s).unwrap_or(RAMP_S);
                Box::new(RandomLaw::new(test, &settings)?)
            }
            (TestLaw::SweptSine, Test::Sine(test)) => Box::new(SweptSineLaw::new(test, &settings)?),
            (TestLaw::Shock, Test::Shock(test)) => Box::new(ShockLaw::classical(test, &settings)?),
            (TestLaw::Shock, Test::Srs(test)) => Box::new(ShockLaw::by_spectrum(test, &settings)?),
            (law, test) => return Err(TestControlError::Kind { law: law.name(), kind: test.kind() }),
        };
        Ok(TestController {
            law,
            direction,
            control,
            limited_m_s2: alloc::vec![0.0; limited.len()],
            limited,
            ramp_samples: libm::ceil(ramp_s * rate_hz).max(1.0),
            ramp: Ramp::On,
            share: 1.0,
            last: None,
            operator,
            clipped: 0,
        })
    }

    /// Returns the drive for a sample, N, or `None` once it has ramped to zero.
    fn drive_n(&mut self, sample: &Measurement) -> Option<f64> {
        let lost = self.last.map_or(0, |last| sample.sample.saturating_sub(last + 1));
        self.last = Some(sample.sample);
        while let Some(deed) = self.operator.hear(sample.sample) {
            self.obey(deed);
        }
        let all = sample.readings();
        for (slot, place) in self.limited_m_s2.iter_mut().zip(&self.limited) {
            *slot = all[*place].value;
        }
        let control = all[self.control];
        let readings = TestSample {
            index: sample.sample,
            lost,
            control_m_s2: control.value,
            head_n: sample.head_force_n[self.control % 2].value,
            limited_m_s2: &self.limited_m_s2,
        };
        match self.ramp {
            Ramp::On => {
                if lost > MOST_LOST {
                    self.share = 0.0;
                }
                let Step { drive_n, end } = self.law.step(&readings);
                let samples = CLIPPED_SAMPLES;
                let every = CLIPPED_EVERY;
                // A leaky bucket: a clipped reading fills in what `every` others drain. Five in a row overflow it,
                // and so does more than one in fifty for long.
                self.clipped = if control.clipped { self.clipped + every } else { self.clipped.saturating_sub(1) };
                let is_clipped = self.clipped >= samples * every;
                let clipped = is_clipped.then_some(End::Stopped(StopReason::Clipped { samples, every }));
                if let Some(end) = clipped.or(end) {
                    self.ramp = Ramp::Down(end);
                }
                let share = self.share;
                self.share = (share + 1.0 / self.ramp_samples).min(1.0);
                Some(share * drive_n)
            }
            Ramp::Down(_) => {
                // Samples that were lost count, so that the ramp is not longer by them.
                self.share -= (1 + lost) as f64 / self.ramp_samples;
                // The share is a sum of steps, so that its end is zero but for rounding.
                if self.share > 1e-9 {
                    return Some(self.share * self.law.coast(&readings));
                }
                // A test that has ended waits for a start that is still to come.
                self.operator.will_start().then_some(0.0)
            }
        }
    }

    /// Does what an operator's word asks for. A start is heard only by a test that has ended, a stop only by one that has not.
    fn obey(&mut self, deed: Deed) {
        // A word that does not apply is no error: an operator may say it at any time.
        match (deed, self.ramp) {
            (Deed::Stop, Ramp::On) => self.ramp = Ramp::Down(End::Stopped(StopReason::Operator)),
            (Deed::Start, Ramp::Down(_)) if self.share <= 1e-9 => {
                self.law.restart();
                self.ramp = Ramp::On;
                self.share = 1.0;
                self.clipped = 0;
            }
            (Deed::Level(level_db), _) => self.law.set_level(level_db),
            (Deed::Stop | Deed::Start, _) => {}
        }
    }
}

/// Place of the first axis of the accelerometer C among the outputs.
const PLACE_OF_C: usize = 4;
/// Least share of the drive along an axis at which it is the driven one.
const ALONG: f64 = 0.999;

impl Controller for TestController {
    fn load_kind(&self) -> LoadKind {
        LoadKind::Force
    }

    fn needs(&self) -> Vec<NeededReading> {
        let mut needed = [false; Measurement::CHANNELS];
        core::iter::once(&self.control).chain(&self.limited).for_each(|place| needed[*place] = true);
        NeededReading::marked(needed)
    }

    fn restart(&mut self) {
        self.law.restart();
        self.operator.restart();
        self.ramp = Ramp::On;
        self.share = 1.0;
        self.last = None;
        self.clipped = 0;
    }

    fn answer(&mut self, sample: &Measurement) -> Answer {
        let drive_n = self.drive_n(sample);
        match (drive_n, self.ramp) {
            // A law's arithmetic on readings that are no numbers must not reach the exciter.
            (Some(drive_n), _) if drive_n.is_finite() => Answer::Hold(self.direction.scaled(drive_n)),
            (Some(_), _) => Answer::Hold(Load::default()),
            (None, Ramp::Down(End::Stopped(reason))) => Answer::Aborted(Abort::Test(reason)),
            (None, _) => Answer::Finished,
        }
    }

    fn poll_response(&mut self) -> Option<ResponsePoint> {
        None
    }

    fn length(&self) -> Length {
        if !self.operator.is_silent() {
            return Length::Unknown;
        }
        // The ramp begins behind the sample that ends the test, and the last of its samples has no drive.
        self.law.samples().map_or(Length::Unknown, |samples| Length::Samples(samples + self.ramp_samples as u64 - 1))
    }

    fn test_progress(&self) -> Option<TestProgress> {
        let progress = self.law.progress();
        let phase = match self.ramp {
            Ramp::On => progress.phase,
            Ramp::Down(_) if self.share > 1e-9 => TestPhase::Stopping,
            Ramp::Down(_) => TestPhase::Ended,
        };
        Some(TestProgress { phase, ..progress })
    }

    fn test_stop(&self) -> Option<StopReason> {
        match self.ramp {
            Ramp::Down(End::Stopped(reason)) => Some(reason),
            Ramp::Down(End::Complete) | Ramp::On => None,
        }
    }

    fn control_spectrum(&self) -> Option<ControlSpectrum<'_>> {
        self.law.spectrum()
    }
}

#[cfg(test)]
mod tests;
