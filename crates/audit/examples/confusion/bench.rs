//! Runs of an audit: a structure, what goes wrong with it, and a controller.

use resonarm_audit::{BACK_S, Base, Case, Context, Finding, RESTART_S, Record, Stimulus, cases};
use resonarm_numeric::noise::Noise;
use resonarm_specification::{Profile, ResponseLimit, Specification, SpecificationFile, SweepRate, Test};

use super::plant::{Plant, RATE, Structure};

/// Rms of the noise of a reading, and of an open cable, m/s².
const NOISE_M_S2: f64 = 0.01;
const OPEN_M_S2: f64 = 0.05;
/// Fastest sweep through light modes, octaves a minute.
const LIGHT_OCT_MIN: f64 = 1.0;
/// Time after which a run ends if the controller does not end it, beyond that of the test, s: for checks and identification.
const OWN_S: f64 = 240.0;

/// Checks the text of a specification, which may name no other file.
pub fn specification(text: &str) -> Result<Specification, String> {
    let file: SpecificationFile = toml::from_str(text).map_err(|error| error.to_string())?;
    Specification::new(&file, |_| Err(String::from("there are no files"))).map_err(|error| error.to_string())
}

/// What a controller reads with a sample.
#[derive(Clone, Copy, Debug)]
pub struct Reading {
    pub control_m_s2: f64,
    pub response_m_s2: f64,
    pub is_clipped: bool,
    /// Samples that were lost before this one.
    pub lost: usize,
}

/// Word of an operator.
#[derive(Clone, Copy, Debug)]
pub enum Word {
    Stop,
    Start,
    /// Change of the level, dB.
    Level(f64),
}

/// A controller under test.
pub trait Controller: Clone {
    /// Answers a sample with the drive, N; `None` once it has disarmed the plant.
    fn step(&mut self, reading: &Reading) -> Option<f64>;

    fn hear(&mut self, word: Word);
}

/// A run, which can be copied at any sample.
#[derive(Clone, Debug)]
pub struct Run<C> {
    controller: C,
    plant: Plant,
    noise: Noise,
    force: f64,
    lost: usize,
    record: Record,
}

impl<C: Controller> Run<C> {
    pub fn new(controller: C, plant: Plant, seed: u64) -> Run<C> {
        let record = Record { rate_hz: RATE as f64, responses: vec![Vec::new()], ..Record::default() };
        Run { controller, plant, noise: Noise::new(seed, 11), force: 0.0, lost: 0, record }
    }

    /// Goes on until a sample, or until the controller disarms the plant. A stimulus acts from the sample `at` on.
    pub fn advance(&mut self, until: usize, test: &Test, stimulus: Stimulus, at: usize) {
        let samples = |seconds: f64| (seconds * RATE as f64) as usize;
        // The specified rms of a random test, and the largest amplitude of a sine.
        let level = match test {
            Test::Random(test) => libm::sqrt(test.profile.moment(0)),
            Test::Sine(test) => {
                test.segments.iter().map(|segment| segment.level.acceleration_m_s2(segment.to_hz)).fold(0.0, f64::max)
            }
            Test::Shock(_) | Test::Srs(_) => 0.0,
        };
        for k in self.record.drive.len()..until {
            let late = k.checked_sub(at);
            let [control, response] = self.plant.step(self.force);
            let read = control + NOISE_M_S2 * self.noise.normal();
            let (mut control_m_s2, mut is_clipped) = (read, false);
            match (stimulus, late) {
                (Stimulus::Stop, Some(0)) => self.controller.hear(Word::Stop),
                (Stimulus::Level(db), Some(0)) => self.controller.hear(Word::Level(db)),
                (Stimulus::Restart, Some(late)) if late < samples(BACK_S) => control_m_s2 = 0.0,
                (Stimulus::Restart, Some(late)) if late == samples(RESTART_S) => self.controller.hear(Word::Start),
                (Stimulus::Dead | Stimulus::DeadFromStart, Some(_)) => control_m_s2 = 0.0,
                (Stimulus::Open | Stimulus::OpenFromStart, Some(_)) => control_m_s2 = OPEN_M_S2 * self.noise.normal(),
                (Stimulus::Gain(factor), Some(_)) => control_m_s2 *= factor,
                (Stimulus::Inverted, _) => control_m_s2 = -read,
                (Stimulus::Clipped(sigma), _) => {
                    let range = sigma * level;
                    is_clipped = read.abs() > range;
                    control_m_s2 = read.clamp(-range, range);
                }
                // A sine of amplitude A has a harmonic of A²/2a, and an offset of the same size, which is taken off.
                (Stimulus::Harmonic(part), Some(_)) => control_m_s2 += part * (2.0 * read * read / level - level),
                _ => {}
            }
            let is_lost = matches!((stimulus, late), (Stimulus::Gap(s), Some(late)) if late < samples(s));
            if is_lost {
                // The plant holds its load.
                self.lost += 1;
            } else {
                let reading = Reading { control_m_s2, response_m_s2: response, is_clipped, lost: self.lost };
                let drive = self.controller.step(&reading);
                self.lost = 0;
                if drive.is_none() && !matches!(stimulus, Stimulus::Restart) {
                    self.record.is_disarmed = true;
                    return;
                }
                self.force = drive.unwrap_or(0.0);
            }
            self.record.drive.push(self.force);
            self.record.reading.push(control_m_s2);
            self.record.responses[0].push(response);
        }
    }
}

/// The audit of a controller on a structure.
pub struct Audit<'a, C> {
    pub structure: &'a Structure,
    pub specification: &'a Specification,
    pub seed: u64,
    /// Makes the controller that follows a specification.
    pub controller: &'a dyn Fn(&Specification) -> C,
}

impl<C: Controller> Audit<'_, C> {
    fn start(&self, specification: &Specification, plant: Plant) -> Run<C> {
        Run::new((self.controller)(specification), plant, self.seed)
    }

    /// Runs the test without a stimulus.
    pub fn base(&self) -> Record {
        let mut run = self.start(self.specification, Plant::new(self.structure));
        run.advance(longest(&self.specification.test), &self.specification.test, Stimulus::None, 0);
        run.record
    }

    /// Judges all cases, or those that are named.
    pub fn judge(&self, named: &[&str]) -> Vec<(&'static Case, Finding)> {
        let test = &self.specification.test;
        let record = self.base();
        let base = Base::new(self.specification, &record);
        let mut prefix: Option<(usize, Run<C>)> = None;
        let mut found = Vec::new();
        for case in cases(test).iter().filter(|case| named.is_empty() || named.contains(&case.id)) {
            let stimulus = case.stimulus;
            if stimulus == Stimulus::None {
                let context = Context { specification: self.specification, base: &base, record: &record, stimulus: 0 };
                found.push((case, case.judge(&context)));
                continue;
            }
            let Some(at) = base.stimulus(test, stimulus) else {
                found.push((case, Finding::skipped("the base run did not come to its level")));
                continue;
            };
            let specification = self.limited(stimulus, &base);
            let until = until(stimulus, &base, at, &specification.test);
            let at = if stimulus.is_at_level() { at } else { 0 };
            let mut run = if stimulus.is_at_level() {
                // Runs are the same up to the stimulus.
                let is_known = prefix.as_ref().is_some_and(|(known, _)| *known == at);
                if !is_known {
                    let mut run = self.start(self.specification, Plant::new(self.structure));
                    run.advance(at, test, Stimulus::None, 0);
                    prefix = Some((at, run));
                }
                let Some((_, run)) = &prefix else { continue };
                run.clone()
            } else if let Stimulus::LightModes(damping_ratio) = stimulus {
                self.start(&specification, Plant::damped(self.structure, damping_ratio))
            } else {
                self.start(&specification, Plant::new(self.structure))
            };
            run.advance(until, &specification.test, stimulus, at);
            let context = Context { specification: &specification, base: &base, record: &run.record, stimulus: at };
            found.push((case, case.judge(&context)));
        }
        found
    }

    /// Returns the specification of the run of a case.
    fn limited(&self, stimulus: Stimulus, base: &Base<'_>) -> Specification {
        let mut specification = self.specification.clone();
        match (stimulus, &mut specification.test) {
            (Stimulus::DriveLimit(part), _) => specification.limits.drive_peak_n = Some(part * base.peak_n),
            (Stimulus::ResponseLimit(below_db), test) => {
                let limit = base.response_limit(test, &base.record.responses[0], below_db);
                let profile = limit.and_then(|points| Profile::new(&points).ok());
                specification.limits.response = profile
                    .map(|profile| ResponseLimit { channel: String::from("b.x"), profile })
                    .into_iter()
                    .collect();
            }
            (Stimulus::LightModes(_), Test::Sine(test)) => {
                if let SweepRate::OctavesPerMinute(rate) = &mut test.rate {
                    *rate = rate.min(LIGHT_OCT_MIN);
                }
            }
            _ => {}
        }
        specification
    }
}

/// The last sample of a run that the controller does not end.
fn longest(test: &Test) -> usize {
    let seconds = match test {
        Test::Random(test) => test.schedule.as_ref().map_or(0.0, |schedule| schedule.duration_s()),
        Test::Sine(test) => {
            let [from_hz, to_hz] = test.band_hz();
            test.sweep_s(from_hz, to_hz)
        }
        Test::Shock(_) | Test::Srs(_) => 0.0,
    };
    ((OWN_S + seconds) * RATE as f64) as usize
}

/// The last sample of the run of a case, as `resonarm audit` has it.
fn until(stimulus: Stimulus, base: &Base<'_>, at: usize, test: &Test) -> usize {
    let level = base.level.as_ref().map_or(0, |level| level.start);
    let (from, seconds) = match stimulus {
        Stimulus::DeadFromStart | Stimulus::OpenFromStart | Stimulus::Inverted => (level, 2.0),
        Stimulus::Clipped(_) | Stimulus::DriveLimit(_) => (level, 12.0),
        Stimulus::Gain(factor) if factor < 1.0 => (at, 26.0),
        Stimulus::Gap(_) => (at, 9.0),
        Stimulus::LightModes(_) => (longest(test), 0.0),
        Stimulus::ResponseLimit(_) | Stimulus::Level(_) | Stimulus::Harmonic(_) | Stimulus::None => {
            (base.record.len(), 5.0)
        }
        Stimulus::Restart => (at, RESTART_S + 12.0),
        Stimulus::Dead | Stimulus::Open | Stimulus::Gain(_) | Stimulus::Stop => (at, 5.0),
    };
    from + (seconds * RATE as f64) as usize
}
