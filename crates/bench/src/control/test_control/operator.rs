//! Words of an operator at stated times: stop softly, start again, change the level.

use alloc::vec::Vec;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{TestControlError, TestLaw};

/// Word of an operator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OperatorWord {
    /// The test is stopped: its drive ramps to zero.
    Stop,
    /// A test that has ended begins anew, with its loop check.
    Start,
    /// The level of a sine changes.
    Level,
}

/// Word of an operator as a scenario states it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OperatorSpec {
    /// Word that the operator says.
    pub word: OperatorWord,
    /// Simulated time from sample 0, s, not negative: the word is heard with sample ⌈`at_s` · rate⌉.
    pub at_s: f64,
    /// New level of a sine, dB over the specified one, at most 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub level_db: Option<f64>,
}

impl OperatorSpec {
    /// What the word makes a controller of this law do.
    fn deed(&self, law: TestLaw) -> Result<Deed, WordFault> {
        if !(self.at_s >= 0.0 && self.at_s.is_finite()) {
            return Err(WordFault::Time { got_s: self.at_s });
        }
        match (self.word, self.level_db) {
            (OperatorWord::Stop, None) => Ok(Deed::Stop),
            (OperatorWord::Start, None) => Ok(Deed::Start),
            (OperatorWord::Level, Some(_)) if law != TestLaw::SweptSine => Err(WordFault::Law { law: law.name() }),
            (OperatorWord::Level, Some(level_db)) if level_db <= 0.0 && level_db.is_finite() => {
                Ok(Deed::Level(level_db))
            }
            (OperatorWord::Level, Some(level_db)) => Err(WordFault::Level { got_db: level_db }),
            (OperatorWord::Level, None) => Err(WordFault::NoLevel),
            (OperatorWord::Stop | OperatorWord::Start, Some(_)) => Err(WordFault::IdleLevel),
        }
    }
}

/// Reason why an operator's word is not possible.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum WordFault {
    /// The time is not one of the run.
    #[error("`at_s` is {got_s}: it must be zero or a positive number")]
    Time {
        /// The stated time of the run, s.
        got_s: f64,
    },
    /// The word asks for more than the specified level.
    #[error("`level_db` is {got_db}: it must be at most 0, the specified level")]
    Level {
        /// The stated level, dB over the specified one.
        got_db: f64,
    },
    /// A level is missing.
    #[error("`level_db` is missing: add it, or change `word`")]
    NoLevel,
    /// A level is stated with a word that takes none.
    #[error("`level_db` does not apply to this word: leave it out")]
    IdleLevel,
    /// The level of another test than a sine can't be changed.
    #[error("the word `level` is for `law` \"swept-sine\", not for \"{law}\": leave it out")]
    Law {
        /// Law of the control.
        law: &'static str,
    },
}

/// What a controller does by a word.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Deed {
    Stop,
    Start,
    /// Level over the specified one, dB.
    Level(f64),
}

/// The words of a run in the order in which they are heard.
#[derive(Clone, Debug)]
pub(super) struct Operator {
    /// Each with its sample.
    words: Vec<(u64, Deed)>,
    heard: usize,
}

impl Operator {
    /// Checks the words of a scenario.
    pub fn new(specs: &[OperatorSpec], law: TestLaw, rate_hz: f64) -> Result<Operator, TestControlError> {
        let mut words = Vec::with_capacity(specs.len());
        for (spec, number) in specs.iter().zip(1..) {
            let deed = spec.deed(law).map_err(|fault| TestControlError::Word { number, fault })?;
            // A time that is a whole number of samples up to rounding counts as one.
            const ROUNDING: f64 = 1e-12;
            words.push((libm::ceil(spec.at_s * rate_hz * (1.0 - ROUNDING)) as u64, deed));
        }
        // The sort is stable: words for the same sample are heard in the order in which they are listed.
        words.sort_by_key(|(sample, _)| *sample);
        Ok(Operator { words, heard: 0 })
    }

    pub fn restart(&mut self) {
        self.heard = 0;
    }

    /// Returns the next word that is heard with a sample, or was heard with one that was lost.
    pub fn hear(&mut self, sample: u64) -> Option<Deed> {
        let (at, deed) = *self.words.get(self.heard)?;
        if at > sample {
            return None;
        }
        self.heard += 1;
        Some(deed)
    }

    /// Says whether a word is still to come by which a test that has ended begins anew.
    pub fn will_start(&self) -> bool {
        self.words[self.heard..].iter().any(|(_, deed)| *deed == Deed::Start)
    }

    /// Says whether there are no words at all.
    pub fn is_silent(&self) -> bool {
        self.words.is_empty()
    }
}
