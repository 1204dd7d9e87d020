//! The reference controllers of the project.

use std::sync::Arc;

use resonarm_bench::control::{
    Answer, Controller as _, OperatorSpec, OperatorWord, SpecificationSource, TestControlSpec, TestController, TestLaw,
};
use resonarm_bench::rig::{Load, Measurement, Reading as Channel};
use resonarm_specification::{Specification, Test};

use super::bench::{Controller, Reading, Word};
use super::plant::RATE;

/// Largest drive that the exciter can make, N.
const LIMIT_N: f64 = 1e4;
/// Rms of the drive in the loop check, N: the tests of these structures of 1 kg take 15 to 25 N at most.
const CHECK_N: f64 = 0.1;

/// A reference controller with what it has read so far. It knows the words of its operator from the beginning, so that one that hears
/// a word is made anew, and reads the same again; so is a copy.
#[derive(Debug)]
pub struct Reference {
    law: TestLaw,
    spec: TestControlSpec,
    controller: TestController,
    read: Vec<Measurement>,
    held_n: f64,
}

impl Reference {
    /// Follows a specification.
    pub fn new(specification: &Specification, seed: u64) -> Reference {
        let law = match &specification.test {
            Test::Random(_) => TestLaw::Random,
            Test::Sine(_) => TestLaw::SweptSine,
            Test::Shock(_) | Test::Srs(_) => TestLaw::Shock,
        };
        let mut specification = specification.clone();
        specification.control.channels = vec![String::from("c.x")];
        specification.limits.gain_check_n = Some(CHECK_N);
        let source = SpecificationSource { specification, text: String::new(), tables: Vec::new() };
        let spec = TestControlSpec {
            specification: String::from("spec.toml"),
            amplitude: Load::force_n(LIMIT_N, 0.0),
            seed,
            operator: Vec::new(),
            source: Some(Arc::new(source)),
        };
        Reference::after(law, spec, Vec::new())
    }

    /// One that has read samples.
    fn after(law: TestLaw, spec: TestControlSpec, read: Vec<Measurement>) -> Reference {
        let mut controller = TestController::new(law, &spec, RATE as f64, LIMIT_N, true)
            .unwrap_or_else(|error| panic!("the reference controller: {error}"));
        let mut held_n = 0.0;
        for sample in &read {
            held_n = drive_n(&controller.answer(sample)).unwrap_or(0.0);
        }
        Reference { law, spec, controller, read, held_n }
    }
}

fn drive_n(answer: &Answer) -> Option<f64> {
    match answer {
        Answer::Hold(load) => Some(load.force_n.x),
        Answer::Finished | Answer::Aborted(_) => None,
    }
}

impl Clone for Reference {
    fn clone(&self) -> Reference {
        Reference::after(self.law, self.spec.clone(), self.read.clone())
    }
}

impl Controller for Reference {
    fn step(&mut self, reading: &Reading) -> Option<f64> {
        let channel = |value, clipped| [Channel { value, clipped }, Channel { value: 0.0, clipped: false }];
        let sample = Measurement {
            sample: self.read.last().map_or(0, |last| last.sample + 1) + reading.lost as u64,
            head_force_n: channel(self.held_n, false),
            acceleration_b_m_s2: channel(reading.response_m_s2, false),
            acceleration_c_m_s2: channel(reading.control_m_s2, reading.is_clipped),
            ..Measurement::default()
        };
        self.read.push(sample);
        let drive_n = drive_n(&self.controller.answer(&sample));
        self.held_n = drive_n.unwrap_or(0.0);
        drive_n
    }

    fn hear(&mut self, word: Word) {
        let (word, level_db) = match word {
            Word::Stop => (OperatorWord::Stop, None),
            Word::Start => (OperatorWord::Start, None),
            Word::Level(db) => (OperatorWord::Level, Some(db)),
        };
        let next = self.read.last().map_or(0, |last| last.sample + 1);
        let mut spec = self.spec.clone();
        spec.operator.push(OperatorSpec { word, at_s: next as f64 / RATE as f64, level_db });
        *self = Reference::after(self.law, spec, core::mem::take(&mut self.read));
    }
}
