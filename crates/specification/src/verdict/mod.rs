//! Verdicts on measured records: in, out, or undecided by the record.
//!
//! Every verdict states the interval in which the true value lies with 95 % probability. A record is *out* only where it
//! proves that the tolerance is exceeded, so that a good controller is not condemned for the scatter of an estimate, and *in* only
//! where the whole interval is within the tolerance.

mod random;
mod shock;
mod sine;
mod srs;

use serde::Serialize;

use crate::specification::Test;

pub use random::{
    Density, LevelVerdict, LimitVerdict, LineVerdict, RandomOptions, RandomVerdict, RmsVerdict, judge_density,
    judge_level, judge_random, line_verdict, perfect_probability,
};
pub use shock::{ShockVerdict, Shot, judge_shock};
pub use sine::{SinePass, SinePoint, SineVerdict, judge_sine};
pub use srs::{SrsLine, SrsShot, SrsVerdict, judge_srs};

/// Where a test begins in a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Begin {
    /// It is searched for, and what was played before is left out: a check of the loop, an identification, an attempt that was
    /// broken off.
    Searched,
    /// The record starts with the test, and all of it counts.
    Start,
}

/// What shows where a test begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum BeginBy {
    /// The start of the range, which was given.
    Given,
    /// The full level of a random test.
    Level,
    /// The first sweep of a sine.
    Sweep,
    /// The first shot that was found.
    Shot,
}

impl BeginBy {
    /// Returns what shows the begin of a test, unless it is given.
    pub const fn of(test: &Test) -> BeginBy {
        match test {
            Test::Random(_) => BeginBy::Level,
            Test::Sine(_) => BeginBy::Sweep,
            Test::Shock(_) | Test::Srs(_) => BeginBy::Shot,
        }
    }

    /// Returns what shows the begin, in words.
    pub const fn name(self) -> &'static str {
        match self {
            BeginBy::Given => "as given",
            BeginBy::Level => "at full level",
            BeginBy::Sweep => "with the sweep",
            BeginBy::Shot => "with the first shot",
        }
    }
}

/// Verdict on a value, or on a whole record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The whole interval is within the tolerance.
    In,
    /// The interval lies across an end of the tolerance.
    Undecided,
    /// The tolerance is exceeded.
    Out,
}

impl Verdict {
    /// All verdicts, in the order in which counts and shares are stated.
    const ALL: [Verdict; 3] = [Verdict::In, Verdict::Undecided, Verdict::Out];

    /// Returns the verdict in a word.
    pub const fn name(self) -> &'static str {
        match self {
            Verdict::In => "in",
            Verdict::Undecided => "undecided",
            Verdict::Out => "out",
        }
    }

    /// Returns the verdict on an interval, [low, high], by a tolerance.
    pub fn of([low, high]: [f64; 2], tolerance: [f64; 2]) -> Verdict {
        if low >= tolerance[0] && high <= tolerance[1] {
            Verdict::In
        } else if low > tolerance[1] || high < tolerance[0] {
            Verdict::Out
        } else {
            Verdict::Undecided
        }
    }

    /// Returns the verdict on a value with a Gaussian deviation: in by its interval of 95 %, out where none of a thousand such
    /// values of a tolerable record would lie.
    fn of_noisy(value: f64, deviation: f64, tolerance: [f64; 2]) -> Verdict {
        let within = |half: f64| Verdict::of([value - half * deviation, value + half * deviation], tolerance);
        match (within(CONFIDENT), within(PROVEN)) {
            (Verdict::In, _) => Verdict::In,
            (_, Verdict::Out) => Verdict::Out,
            _ => Verdict::Undecided,
        }
    }

    /// Returns the verdict on a share of something that must be reached: `proven` of it is in for certain, `lost` out.
    fn of_share(proven: f64, lost: f64, share: f64) -> Verdict {
        // Shares are sums, which are rounded.
        Verdict::decided(lost > 1.0 - share + ROUNDING, proven >= share - ROUNDING)
    }

    /// Returns the verdict by what is proven.
    const fn decided(is_out: bool, is_in: bool) -> Verdict {
        match (is_out, is_in) {
            (true, _) => Verdict::Out,
            (false, true) => Verdict::In,
            (false, false) => Verdict::Undecided,
        }
    }
}

/// Rounding of a share.
const ROUNDING: f64 = 1e-9;
/// Half of the width of an interval of 95 % confidence of a Gaussian value, in its deviation.
const CONFIDENT: f64 = 1.959_963_984_540_054;
/// Deviations beyond which one of a thousand Gaussian values lies with a probability of 1 %, to either side.
const PROVEN: f64 = 4.42;

/// Returns the mean of values; 0 of none.
fn mean(values: &[f64]) -> f64 {
    if values.is_empty() { 0.0 } else { values.iter().sum::<f64>() / values.len() as f64 }
}
