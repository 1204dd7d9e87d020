//! Cases, and what they find.

use alloc::string::String;
use alloc::vec::Vec;
use core::ops::Range;

use resonarm_specification::verdict::{ShockVerdict, SineVerdict};
use resonarm_specification::{Specification, Test};
use serde::Serialize;

use crate::record::Record;

/// What the plant does while the controller runs. Faults act on the control channel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stimulus {
    /// Nothing: the case judges the base run.
    None,
    /// The channel reads 0 from the start.
    DeadFromStart,
    /// The channel reads weak noise from the start, as an open cable.
    OpenFromStart,
    /// The channel reads 0 from the level on.
    Dead,
    /// The channel reads weak noise from the level on.
    Open,
    /// The channel reads this many times its value from the level on.
    Gain(f64),
    /// The channel is clipped at this many times the specified rms, and says so, from the start.
    Clipped(f64),
    /// The channel reads the negative of its value from the start.
    Inverted,
    /// No sample reaches the controller for this time, s, at the level.
    Gap(f64),
    /// The controller is told to stop at the level.
    Stop,
    /// The control channel is lost at the level. [`BACK_S`] later it is back, and [`RESTART_S`] later the controller is told to
    /// start again.
    Restart,
    /// The controller is told at the level to change it by this many dB.
    Level(f64),
    /// From the begin of a sweep on the control channel reads a sine with a second harmonic of this part of its amplitude, where
    /// the specified amplitude is largest.
    Harmonic(f64),
    /// The specification limits a response to this many dB below what it reads in the base run.
    ResponseLimit(f64),
    /// The specification limits the drive to this part of the largest one of the base run.
    DriveLimit(f64),
    /// All modes of the plant have this damping ratio, and the specification sweeps at most 1 octave a minute.
    LightModes(f64),
}

impl Stimulus {
    /// Says whether it acts only once the test is at its level.
    pub const fn is_at_level(self) -> bool {
        matches!(
            self,
            Stimulus::Dead
                | Stimulus::Open
                | Stimulus::Gain(_)
                | Stimulus::Gap(_)
                | Stimulus::Stop
                | Stimulus::Restart
                | Stimulus::Level(_)
                | Stimulus::Harmonic(_)
        )
    }
}

/// Time from the loss of the control channel until it is back, s.
pub const BACK_S: f64 = 2.0;
/// Time from the loss of the control channel until the controller is told to start again, s.
pub const RESTART_S: f64 = 3.0;

/// A figure that a case measured, with its limits.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Measure {
    /// Name of the figure, in words for the report.
    pub name: &'static str,
    /// Measured value, in the unit stated beside it.
    pub value: f64,
    /// Unit; empty for a ratio or a number.
    pub unit: &'static str,
    /// Least value, if there is a limit.
    pub least: Option<f64>,
    /// Largest value, if there is a limit.
    pub most: Option<f64>,
}

impl Measure {
    /// A figure that must be from `least` to `most`.
    pub(crate) const fn within(name: &'static str, value: f64, unit: &'static str, [least, most]: [f64; 2]) -> Measure {
        Measure { name, value, unit, least: Some(least), most: Some(most) }
    }

    /// A figure that must be at least `least`.
    pub(crate) const fn at_least(name: &'static str, value: f64, unit: &'static str, least: f64) -> Measure {
        Measure { name, value, unit, least: Some(least), most: None }
    }

    /// A figure that must be at most `most`.
    pub(crate) const fn at_most(name: &'static str, value: f64, unit: &'static str, most: f64) -> Measure {
        Measure { name, value, unit, least: None, most: Some(most) }
    }

    /// Says whether the figure is within its limits. One that is not a number is not.
    pub fn is_met(&self) -> bool {
        self.least.is_none_or(|least| self.value >= least) && self.most.is_none_or(|most| self.value <= most)
    }
}

/// Result of a case.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "verdict", content = "reason")]
pub enum Verdict {
    /// All figures are within their limits.
    Passed,
    /// A figure is beyond its limit.
    Failed,
    /// Undecided, with the reason.
    Inconclusive(String),
    /// The case was not tried, with the reason.
    Skipped(String),
}

impl Verdict {
    /// Returns the verdict in a word.
    pub const fn name(&self) -> &'static str {
        match self {
            Verdict::Passed => "passed",
            Verdict::Failed => "failed",
            Verdict::Inconclusive(_) => "inconclusive",
            Verdict::Skipped(_) => "skipped",
        }
    }
}

/// What a case found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Whether the controller passed the case.
    #[serde(flatten)]
    pub verdict: Verdict,
    /// The measured figures, each with its bounds.
    pub measured: Vec<Measure>,
}

impl Finding {
    /// Judges figures by their limits.
    pub(crate) fn of(measured: impl Into<Vec<Measure>>) -> Finding {
        let measured = measured.into();
        let verdict = if measured.iter().all(Measure::is_met) { Verdict::Passed } else { Verdict::Failed };
        Finding { verdict, measured }
    }

    /// A case that was not tried.
    pub fn skipped(reason: &str) -> Finding {
        Finding { verdict: Verdict::Skipped(reason.into()), measured: Vec::new() }
    }
}

/// A numbered case: what is done to the plant, and the rule by which the run is judged.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// Number, as R01: R of random tests, S of swept sines, K of shocks.
    pub id: &'static str,
    /// What the controller must do, in a few words.
    pub title: &'static str,
    /// The rule with its numbers.
    pub rule: &'static str,
    /// What the plant does.
    pub stimulus: Stimulus,
    pub(crate) judge: fn(&Context<'_>) -> Judged,
}

/// What the rule of a case finds, or why it can't decide.
pub(crate) type Judged = Result<Finding, &'static str>;

impl Case {
    /// Judges the run of this case beside the undisturbed one.
    pub fn judge(&self, context: &Context<'_>) -> Finding {
        (self.judge)(context)
            .unwrap_or_else(|reason| Finding { verdict: Verdict::Inconclusive(reason.into()), measured: Vec::new() })
    }
}

/// The base run, without a stimulus.
#[derive(Clone, Debug)]
pub struct Base<'a> {
    /// Record of the run.
    pub record: &'a Record,
    /// Samples of a random test at full level, or of the first sweep of a sine; none if the test did not come so far. What the
    /// controller plays before its test, such as an identification at low level, is no part of it.
    pub level: Option<Range<usize>>,
    /// Time from the start of the run at which the test begins, s: of a random test its full level, of a sine its first sweep,
    /// of a shock its first shot; none if the record does not show it.
    pub begins_s: Option<f64>,
    /// Largest magnitude of the drive, N.
    pub peak_n: f64,
    /// What was found of a sine.
    pub(crate) sine: Option<SineVerdict>,
    /// What was found of a shock.
    pub(crate) shock: Option<ShockVerdict>,
}

/// Time at full level before a stimulus, s.
pub(crate) const SETTLE_S: f64 = 6.0;

impl Base<'_> {
    /// Returns the sample at which a stimulus at the level acts: 6 s into the full level of a random test, in the middle of a
    /// sweep, or with its begin.
    pub fn stimulus(&self, test: &Test, stimulus: Stimulus) -> Option<usize> {
        let level = self.level.as_ref()?;
        Some(match (test, stimulus) {
            (_, Stimulus::Harmonic(_)) => level.start,
            (Test::Sine(_), _) => usize::midpoint(level.start, level.end),
            _ => level.start + self.record.samples(SETTLE_S),
        })
    }
}

/// What a case judges.
#[derive(Clone, Debug)]
pub struct Context<'a> {
    /// Specification of the run, with the limits of the case.
    pub specification: &'a Specification,
    /// The undisturbed run, with which others are compared.
    pub base: &'a Base<'a>,
    /// The run of the case; of one without a stimulus the base run.
    pub record: &'a Record,
    /// Sample at which the stimulus began.
    pub stimulus: usize,
}

impl Context<'_> {
    /// Judges a start after an abort: the drive of the first seconds over the largest one of the base run. Inconclusive if the
    /// controller did not abort before, or did not begin again.
    pub(crate) fn restarted(&self, first_s: f64, most: f64) -> Judged {
        self.check_driven()?;
        let record = self.record;
        let start = self.stimulus + record.samples(RESTART_S);
        // A drive that still ends is not taken for one that goes on.
        const BEFORE_S: f64 = 0.1;
        if record.peak(start.saturating_sub(record.samples(BEFORE_S)), start) > 0.0 {
            return Err("the controller did not stop when its channel was lost, so it had nothing to start again");
        }
        if record.peak(start, record.len()) == 0.0 {
            return Err("the controller did not begin again when it was told to start");
        }
        let peak_n = record.peak(start, start + record.samples(first_s));
        Ok(Finding::of([Measure::at_most("largest drive", peak_n, "N", most * self.base.peak_n)]))
    }

    /// Checks that the drive was not much weaker before the stimulus than in the base run: the stimulus would never have acted.
    pub(crate) fn check_driven(&self) -> Result<(), &'static str> {
        let from = self.stimulus.saturating_sub(self.record.samples(2.0));
        let [own, base] = [self.record, self.base.record].map(|record| record.peak(from, self.stimulus));
        if self.base.level.is_none() {
            Err(NO_LEVEL)
        } else if own < 0.2 * base || own == 0.0 {
            // Both runs are the same up to the stimulus but for the controller's own scatter, so that a drive that is this
            // much weaker is that of a test which has ended, or never began.
            Err("the drive had ended before the stimulus, so it never acted")
        } else {
            Ok(())
        }
    }
}

/// Reason of cases that need a test at its level.
pub(crate) const NO_LEVEL: &str = "the base run did not come to its level, so the case can't be tried";
