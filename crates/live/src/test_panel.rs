//! A vibration or shock test as the page shows it: what its specification asks for, how far the test is, and what it has reached.
//!
//! What it has reached is computed from the readings of the control channel, as an instrument on the bus would do it, and is not
//! taken from the controller, which may be wrong.

use std::collections::VecDeque;
use std::sync::Arc;

use nalgebra::{Complex, Matrix3, Vector3};
use serde::Serialize;

use super::rows::HEAD;
use resonarm_bench::control::{ControlSpec, SpecificationSource, TestPhase};
use resonarm_modal::spectra::{CrossSpectra, Segments, ShockResponse, Signals};
use resonarm_numeric::number::rounded;
use resonarm_scenario::Scenario;
use resonarm_session::run::TestState;
use resonarm_specification::verdict::{Begin, judge_shock, judge_srs};
use resonarm_specification::{RandomTest, ShockTest, SineTest, SrsTest, Test};

/// Half-overlapping segments in the average of a random test.
const SEGMENTS: usize = 32;
/// Lines at each edge of the profile that are not counted.
const EDGE: usize = 2;
/// Points of a sine's amplitude in an octave.
const POINTS_PER_OCTAVE: f64 = 48.0;
/// Time in which the last shot is looked for, s.
const SHOTS_S: f64 = 12.0;
/// Oscillators by which a classical shock is shown: their quality, and their natural frequencies in an octave.
const QUALITY: f64 = 10.0;
const LINES_PER_OCTAVE: f64 = 6.0;
/// Lowest natural frequency times the duration of a pulse, and the sample rate over the highest one.
const LOWEST_CYCLES: f64 = 0.25;
const SAMPLES_PER_CYCLE: f64 = 10.0;

/// What the specification of a test asks for, by frequency.
#[derive(Clone, Debug, Serialize)]
pub struct TestPlan {
    /// Kind of the test: random, sine, shock, srs.
    pub kind: &'static str,
    /// Name of the specification.
    pub name: Option<String>,
    /// Name of the control channel, as c.x.
    pub channel: String,
    /// What is shown over the frequency.
    pub quantity: &'static str,
    /// Unit of what is shown.
    pub unit: &'static str,
    /// Frequencies of the lines, Hz.
    pub frequency_hz: Vec<f64>,
    /// What is specified at full level.
    pub demand: Vec<f64>,
    /// Ends of the tolerance at full level; empty if none is stated by frequency.
    pub low: Vec<f64>,
    /// The same for the upper end.
    pub high: Vec<f64>,
    /// Levels in turn, dB below the full one; empty if none are stated.
    pub levels_db: Vec<f64>,
}

/// How far a test is, and what it has reached.
#[derive(Clone, Debug, Serialize)]
pub struct TestStatus {
    /// Phase of the test, in words; none if the controller has not told.
    pub phase: Option<&'static str>,
    /// Level, dB below the full one.
    pub level_db: Option<f64>,
    /// Time at full level so far, s.
    pub full_level_s: f64,
    /// Frequency of a sine, Hz.
    pub frequency_hz: Option<f64>,
    /// Reason for which the test is stopped.
    pub stopped: Option<String>,
    /// What is specified at the level of `reached`, over the full level.
    pub factor: f64,
    /// What was read, at the frequencies of the plan; none where nothing was read yet.
    pub reached: Vec<Option<f64>>,
    /// What was read, in words.
    pub words: String,
}

/// A test with the latest readings of its control channel.
#[derive(Clone, Debug)]
pub struct TestPanel {
    /// What the specification asks for.
    pub plan: TestPlan,
    source: Arc<SpecificationSource>,
    /// Place of the control channel in a row.
    place: usize,
    rate_hz: f64,
    state: Option<TestState>,
    readings: VecDeque<f64>,
    /// Amplitudes of a sine so far, at the frequencies of the plan, m/s².
    amplitudes: Vec<Option<f64>>,
}

impl TestPanel {
    /// Makes the panel of the test that a scenario controls; `None` if it controls none.
    pub fn new(scenario: &Scenario) -> Option<TestPanel> {
        let (_, spec) = scenario.control.as_ref().and_then(ControlSpec::test)?;
        let source = Arc::clone(spec.source.as_ref()?);
        let place = HEAD + spec.control_output()?;
        let rate_hz = scenario.simulation.rate_hz;
        let plan = TestPlan::new(&source, rate_hz);
        let amplitudes = vec![None; plan.frequency_hz.len()];
        Some(TestPanel { plan, source, place, rate_hz, state: None, readings: VecDeque::new(), amplitudes })
    }

    /// Takes the state that the controller has told.
    pub fn state(&mut self, state: TestState) {
        // An average belongs to one level, and what was played before the first one is no part of the test.
        let before_db = self.state.and_then(|before| before.progress.level_db);
        let is_random = matches!(self.source.specification.test, Test::Random(_));
        let level_db = state.progress.level_db;
        if before_db.is_some() != level_db.is_some() || (is_random && before_db != level_db) {
            self.readings.clear();
        }
        self.state = Some(state);
    }

    /// Takes the numbers of the next sample.
    pub fn push(&mut self, numbers: &[f32]) {
        let Some(reading) = numbers.get(self.place).copied().filter(|reading| reading.is_finite()) else {
            return self.readings.clear();
        };
        self.readings.push_back(f64::from(reading));
        let most = match &self.source.specification.test {
            // Segments that overlap by half: n of them take n + 1 halves.
            Test::Random(test) => frame(test, self.rate_hz) / 2 * (SEGMENTS + 1),
            Test::Sine(test) => (2.0 / (test.tracking * test.band_hz()[0]) * self.rate_hz) as usize + 1,
            Test::Shock(_) | Test::Srs(_) => (SHOTS_S * self.rate_hz) as usize,
        };
        while self.readings.len() > most {
            self.readings.pop_front();
        }
    }

    /// The next samples don't follow those that came before.
    pub fn interrupt(&mut self) {
        self.readings.clear();
    }

    /// Another series of samples begins.
    pub fn restart(&mut self) {
        self.interrupt();
        self.state = None;
        self.amplitudes.fill(None);
    }

    /// Returns how far the test is, and what it has reached.
    pub fn status(&mut self) -> TestStatus {
        let source = Arc::clone(&self.source);
        let level_db = self.state.and_then(|state| state.progress.level_db);
        let readings: Vec<f64> = self.readings.iter().copied().collect();
        let found = match &source.specification.test {
            Test::Random(test) => self.random(test, level_db, &readings),
            Test::Sine(test) => self.sine(test, level_db, &readings),
            Test::Shock(test) => level_db.and_then(|_| self.shock(test, &readings)),
            Test::Srs(test) => level_db.and_then(|_| self.srs(test, &readings)),
        };
        let progress = self.state.map(|state| state.progress);
        let nothing = || Reached { factor: 1.0, values: self.amplitudes.clone(), words: String::new() };
        let Reached { factor, values, words } = found.unwrap_or_else(nothing);
        TestStatus {
            phase: progress.map(|progress| match progress.phase {
                TestPhase::Silence => "reading the noise in silence",
                TestPhase::LoopCheck => "checking the loop",
                TestPhase::Identification => "identifying the structure",
                TestPhase::Level => "playing",
                TestPhase::Stopping => "stopping",
                TestPhase::Ended => "ended",
            }),
            level_db,
            full_level_s: progress.map_or(0.0, |progress| progress.full_level_s),
            frequency_hz: progress.and_then(|progress| progress.frequency_hz),
            stopped: self.state.and_then(|state| state.stopped).map(|reason| reason.to_string()),
            factor,
            reached: values,
            words,
        }
    }

    fn random(&self, test: &RandomTest, level_db: Option<f64>, readings: &[f64]) -> Option<Reached> {
        // Without a level the drive is not that of the specification.
        let factor = libm::pow(10.0, level_db? / 10.0);
        let record = Signals { inputs: &[], outputs: &[readings] };
        let segments = Segments::hann(frame(test, self.rate_hz));
        let spectra = CrossSpectra::estimate(self.rate_hz, &[record], &segments).ok()?;
        let [from_hz, to_hz] = test.profile.band_hz();
        let lines = spectra.frequency_hz.iter().zip(spectra.outputs.first()?);
        let within = lines.filter(|(hz, _)| (from_hz..=to_hz).contains(*hz));
        let density: Vec<f64> = within.map(|(_, density)| *density).collect();
        let plan = &self.plan;
        let line_hz = self.rate_hz / segments.length as f64;
        let rms = |values: &[f64]| libm::sqrt(line_hz * values.iter().sum::<f64>());
        // Windows mix the lines at the edges with what lies beyond them.
        let judged = EDGE..density.len().saturating_sub(EDGE);
        let is_beyond =
            |line: &usize| density[*line] < factor * plan.low[*line] || density[*line] > factor * plan.high[*line];
        let beyond = judged.clone().filter(is_beyond).count();
        let words = format!(
            "rms {} m/s² of {} m/s², {} of {} lines beyond the tolerance, {} degrees of freedom",
            rounded(&rms(&density), 3),
            rounded(&(libm::sqrt(factor) * rms(&plan.demand)), 3),
            beyond,
            judged.len(),
            rounded(&spectra.degrees_of_freedom, 0)
        );
        Some(Reached { factor, values: density.into_iter().map(Some).collect(), words })
    }

    fn sine(&mut self, test: &SineTest, level_db: Option<f64>, readings: &[f64]) -> Option<Reached> {
        level_db?;
        let told_hz = self.state.and_then(|state| state.progress.frequency_hz)?;
        let samples = (2.0 / (test.tracking * told_hz) * self.rate_hz) as usize;
        let latest = readings.get(readings.len().checked_sub(samples)?..)?;
        let (hz, amplitude) = tracked(latest, self.rate_hz, told_hz, test.rate_hz_s(told_hz))?;
        let nearest = self.plan.frequency_hz.iter().position(|line_hz| *line_hz >= hz)?;
        self.amplitudes[nearest] = Some(amplitude);
        let demand = rounded(&test.acceleration_m_s2(hz)?, 3);
        let words = format!("{} Hz: {} m/s² of {demand} m/s²", rounded(&hz, 2), rounded(&amplitude, 3));
        Some(Reached { factor: 1.0, values: self.amplitudes.clone(), words })
    }

    fn shock(&self, test: &ShockTest, readings: &[f64]) -> Option<Reached> {
        let verdict = judge_shock(test, self.rate_hz, readings, Begin::Start).ok()?;
        let shot = verdict.shots.last()?;
        let before_s = shot.t_s - test.pre_s.unwrap_or(0.0);
        let after_s = shot.t_s + test.duration_s + test.post_s.unwrap_or(0.0) + 1.0 / self.plan.frequency_hz.first()?;
        let [from, to] = [before_s, after_s].map(|t_s| (t_s * self.rate_hz).max(0.0) as usize);
        let record = readings.get(from..to.min(readings.len()))?;
        let response = ShockResponse::estimate(self.rate_hz, record, QUALITY, &self.plan.frequency_hz).ok()?.maximax();
        let judged = format!(
            ": largest deviation {} %, velocity change {} % off, {}",
            rounded(&(100.0 * shot.error), 1),
            rounded(&(100.0 * shot.velocity_change), 1),
            shot.verdict.name()
        );
        let judged = if shot.is_full { judged } else { String::from(", below the full level") };
        let words = format!("last shot at {} of the peak{judged}", rounded(&shot.amplitude, 2));
        Some(Reached { factor: shot.amplitude, values: response.into_iter().map(Some).collect(), words })
    }

    fn srs(&self, test: &SrsTest, readings: &[f64]) -> Option<Reached> {
        let verdict = judge_srs(test, self.rate_hz, readings).ok()?;
        let shot = verdict.shots.last()?;
        let judged = format!(
            ", {} % of the lines in the tolerance, {}",
            rounded(&(100.0 * shot.shares[0]), 0),
            shot.verdict.name()
        );
        let judged = if shot.is_full { judged } else { String::from(", below the full level") };
        let level_db = rounded(&shot.level_db, 1);
        let peak_m_s2 = rounded(&shot.peak_m_s2, 2);
        let words = format!("last shot {level_db} dB on average, peak {peak_m_s2} m/s²{judged}");
        // The level of the schedule that is nearest to the shot.
        let distance = |level_db: &&f64| (*level_db - shot.level_db).abs();
        let level_db = self.plan.levels_db.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let factor = level_db.map_or(1.0, |level_db| libm::pow(10.0, level_db / 20.0));
        Some(Reached { factor, values: shot.lines.iter().map(|line| Some(line.response_m_s2)).collect(), words })
    }
}

/// Readings of the control channel, as the panel shows them.
struct Reached {
    /// What is specified at its level, over the full level.
    factor: f64,
    /// Values at the frequencies of the plan.
    values: Vec<Option<f64>>,
    words: String,
}

impl TestPlan {
    fn new(source: &SpecificationSource, rate_hz: f64) -> TestPlan {
        let specification = &source.specification;
        let levels = |shots: &[resonarm_specification::Shots]| shots.iter().map(|shots| shots.level_db).collect();
        let decibels = |demand: f64, db: f64, per_decade: f64| demand * libm::pow(10.0, db / per_decade);
        let mut plan = TestPlan {
            kind: specification.test.kind(),
            name: specification.name.clone(),
            channel: specification.control.channels.first().cloned().unwrap_or_default(),
            quantity: "response",
            unit: "m/s²",
            frequency_hz: Vec::new(),
            demand: Vec::new(),
            low: Vec::new(),
            high: Vec::new(),
            levels_db: Vec::new(),
        };
        match &specification.test {
            Test::Random(test) => {
                plan.quantity = "density";
                plan.unit = "(m/s²)²/Hz";
                let line_hz = rate_hz / frame(test, rate_hz) as f64;
                for hz in (1..).map(|line| f64::from(line) * line_hz).take_while(|hz| *hz <= 0.5 * rate_hz) {
                    let Some(demand) = test.profile.at(hz) else { continue };
                    let [low_db, high_db] = test.tolerance.at(hz);
                    plan.line(hz, demand, [low_db, high_db].map(|db| decibels(demand, db, 10.0)));
                }
                let steps = test.schedule.iter().flat_map(|schedule| &schedule.steps);
                plan.levels_db = steps.map(|step| step.level_db).collect();
            }
            Test::Sine(test) => {
                plan.quantity = "amplitude";
                let [from_hz, to_hz] = test.band_hz();
                let steps = libm::ceil(libm::log2(to_hz / from_hz) * POINTS_PER_OCTAVE) as u32;
                for step in 0..=steps {
                    let hz = (from_hz * libm::exp2(f64::from(step) / POINTS_PER_OCTAVE)).min(to_hz);
                    let Some(demand) = test.acceleration_m_s2(hz) else { continue };
                    plan.line(hz, demand, [1.0 - test.tolerance, 1.0 + test.tolerance].map(|factor| factor * demand));
                }
            }
            Test::Shock(test) => {
                plan.levels_db = levels(&test.shots);
                let from_hz = LOWEST_CYCLES / test.duration_s;
                let octaves = libm::log2(rate_hz / SAMPLES_PER_CYCLE / from_hz);
                let steps = (octaves * LINES_PER_OCTAVE).max(0.0) as u32;
                let line = |step: u32| from_hz * libm::exp2(f64::from(step) / LINES_PER_OCTAVE);
                plan.frequency_hz = (0..=steps).map(line).collect();
                let mut pulse = test.compensated(rate_hz).map_or_else(|| test.samples(rate_hz), |(pulse, _)| pulse);
                pulse.resize(pulse.len() + (rate_hz / from_hz) as usize, 0.0);
                let response = ShockResponse::estimate(rate_hz, &pulse, QUALITY, &plan.frequency_hz);
                plan.demand = response.map(|response| response.maximax()).unwrap_or_default();
            }
            Test::Srs(test) => {
                plan.levels_db = levels(&test.shots);
                for hz in test.frequencies_hz() {
                    let Some(demand) = test.profile.at(hz) else { continue };
                    plan.line(hz, demand, test.tolerance.at(hz).map(|db| decibels(demand, db, 20.0)));
                }
            }
        }
        plan
    }

    fn line(&mut self, hz: f64, demand: f64, [low, high]: [f64; 2]) {
        self.frequency_hz.push(hz);
        self.demand.push(demand);
        self.low.push(low);
        self.high.push(high);
    }
}

/// Samples of a segment of a random test.
fn frame(test: &RandomTest, rate_hz: f64) -> usize {
    (libm::round(rate_hz / test.lines_hz) as usize).max(2)
}

/// Returns the frequency, Hz, in the middle of samples of a sweep, and the amplitude there.
///
/// The frequency that was told belongs to a sample nearby. In each half of the samples the phasor about it is found by least
/// squares with the mean; the turn from one to the other gives the true frequency, with which the whole is fitted, its phase being
/// 2π(f t ± ½ ḟ t²) about the middle. Of both directions of the sweep the one that fits better counts.
fn tracked(samples: &[f64], rate_hz: f64, told_hz: f64, sweep_hz_s: f64) -> Option<(f64, f64)> {
    use core::f64::consts::TAU;
    let middle = 0.5 * (samples.len() as f64 - 1.0);
    let at_s = |index: usize| (index as f64 - middle) / rate_hz;
    let fit = |range: core::ops::Range<usize>, hz: f64, sweep_hz_s: f64| -> Option<(Complex<f64>, f64)> {
        let rows = range.clone().map(|index| {
            let t_s = at_s(index);
            let phase = TAU * (hz + 0.5 * sweep_hz_s * t_s) * t_s;
            Vector3::new(libm::cos(phase), libm::sin(phase), 1.0)
        });
        let mut normal = Matrix3::zeros();
        let mut right = Vector3::zeros();
        for (row, sample) in rows.clone().zip(&samples[range.clone()]) {
            normal += row * row.transpose();
            right += row * *sample;
        }
        let found = normal.lu().solve(&right)?;
        let left = rows.zip(&samples[range]).map(|(row, sample)| (sample - row.dot(&found)).powi(2)).sum();
        Some((Complex::new(found[0], -found[1]), left))
    };
    let half = samples.len() / 2;
    let (first, _) = fit(0..half, told_hz, 0.0)?;
    let (second, _) = fit(half..2 * half, told_hz, 0.0)?;
    // The middles of the halves are half of the samples apart.
    let turned = second * first.conj();
    let hz = told_hz + libm::atan2(turned.im, turned.re) * rate_hz / (TAU * half as f64);
    let both = [sweep_hz_s, -sweep_hz_s].map(|sweep_hz_s| fit(0..samples.len(), hz, sweep_hz_s));
    let best = both.into_iter().flatten().min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some((hz, libm::hypot(best.0.re, best.0.im)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The amplitude of a sweep in closed form, 3 m/s² with an offset, told up to 0.1 s too early.
    #[test]
    fn the_amplitude_of_a_sweep_is_found_in_either_direction() {
        for (hz, sweep_hz_s, late_s) in [(12.0, 0.55, 0.0), (12.0, -0.55, 0.1), (120.0, 5.5, -0.1)] {
            let samples: Vec<f64> = (0..(13_333.0 / hz) as usize)
                .map(|n| {
                    let t_s = n as f64 / 1000.0;
                    let phase = core::f64::consts::TAU * (hz + 0.5 * sweep_hz_s * t_s) * t_s;
                    0.4 + 3.0 * libm::sin(phase + 0.7)
                })
                .collect();
            let middle_hz = hz + sweep_hz_s * 0.5 * samples.len() as f64 / 1000.0;
            let (found_hz, amplitude) =
                tracked(&samples, 1000.0, middle_hz + sweep_hz_s * late_s, 0.55_f64.max(sweep_hz_s.abs())).unwrap();
            assert!((found_hz - middle_hz).abs() < 2e-3 * hz, "{hz}: {found_hz}, {middle_hz}");
            assert!((amplitude - 3.0).abs() < 3e-3, "{hz}: {amplitude}");
        }
    }
}
