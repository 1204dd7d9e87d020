//! Words of an operator at stated times: stop softly, start again, change the level.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use serde::{Deserialize, Serialize};

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
            let at_s = spec.at_s;
            let refused = |fault: String| Err(TestControlError::Word { number, fault });
            if !(at_s >= 0.0 && at_s.is_finite()) {
                return refused(format!("`at_s` is {at_s}: it must be zero or a positive number"));
            }
            let deed = match (spec.word, spec.level_db) {
                (OperatorWord::Stop, None) => Deed::Stop,
                (OperatorWord::Start, None) => Deed::Start,
                (OperatorWord::Level, Some(level_db)) if law == TestLaw::SweptSine => {
                    if !(level_db <= 0.0 && level_db.is_finite()) {
                        return refused(format!("`level_db` is {level_db}: it must be at most 0, the specified level"));
                    }
                    Deed::Level(level_db)
                }
                (OperatorWord::Level, Some(_)) => {
                    let law = law.name();
                    return refused(format!(
                        "the word `level` is for `law` \"swept-sine\", not for \"{law}\": leave it out"
                    ));
                }
                (OperatorWord::Level, None) => {
                    return refused("`level_db` is missing: add it, or change `word`".into());
                }
                (OperatorWord::Stop | OperatorWord::Start, Some(_)) => {
                    return refused("`level_db` does not apply to this word: leave it out".into());
                }
            };
            // A time that is a whole number of samples up to rounding counts as one.
            const ROUNDING: f64 = 1e-12;
            words.push((libm::ceil(at_s * rate_hz * (1.0 - ROUNDING)) as u64, deed));
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
