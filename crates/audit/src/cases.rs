//! The cases of each kind of test, and what its base run shows.

use alloc::vec::Vec;

use resonarm_specification::verdict::{Begin, judge_shock, judge_sine};
use resonarm_specification::{Specification, Test};

use crate::case::{Base, Case};
use crate::record::Record;
use crate::{random, shock, sine};

/// Returns the cases of the kind of a test; none of shock response spectra.
pub const fn cases(test: &Test) -> &'static [Case] {
    match test {
        Test::Random(_) => random::CASES,
        Test::Sine(_) => sine::CASES,
        Test::Shock(_) => shock::CASES,
        Test::Srs(_) => &[],
    }
}

impl<'a> Base<'a> {
    /// Searches a record for the level of the test.
    pub fn new(specification: &Specification, record: &'a Record) -> Base<'a> {
        let peak_n = record.peak(0, record.len());
        let mut base = Base { record, level: None, begins_s: None, peak_n, sine: None, shock: None };
        match &specification.test {
            Test::Random(test) => {
                base.level = random::level(test, record);
                base.begins_s = base.level.as_ref().map(|level| level.start as f64 / record.rate_hz);
            }
            Test::Sine(test) => {
                // A run without a limit may record a response all the same.
                let limits = specification.limits.response.len();
                let responses: Vec<&[f64]> = record.responses.iter().take(limits).map(Vec::as_slice).collect();
                let limits = &specification.limits;
                let reading = &record.reading;
                let drive = &record.drive;
                let judged =
                    judge_sine(test, limits, record.rate_hz, reading, Some(drive), &responses, Begin::Searched);
                base.sine = judged.ok();
                base.begins_s = base.sine.as_ref().map(|found| found.begins_s);
                let first = base.sine.as_ref().and_then(|found| found.passes.first());
                base.level = first.map(|pass| record.samples(pass.from_s)..record.samples(pass.to_s));
            }
            Test::Shock(test) => {
                base.shock = judge_shock(test, record.rate_hz, &record.reading, Begin::Searched).ok();
                base.begins_s = base.shock.as_ref().map(|found| found.begins_s);
            }
            Test::Srs(_) => {}
        }
        base
    }

    /// Returns the acceleration at the limited channel of the base run with its frequency band: a limit that is `below_db` lower
    /// holds the test there. Breakpoints [Hz, level], a density of a random test and an amplitude of a sine; none if the base
    /// run has no such channel, or did not come to its level.
    pub fn response_limit(&self, test: &Test, response: &[f64], below_db: f64) -> Option<[[f64; 2]; 2]> {
        match test {
            Test::Random(test) => random::response_limit(test, self, response, below_db),
            Test::Sine(test) => sine::response_limit(test, self, response, below_db),
            Test::Shock(_) | Test::Srs(_) => None,
        }
    }
}
