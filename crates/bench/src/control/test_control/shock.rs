//! Shocks: a waveform at the control channel is replicated by the inverse of the identified response, and corrected from shot
//! to shot.
//!
//! The waveform R of a classical shock is the pulse with its compensation ([`ShockTest::compensated`]); that of a shock response
//! spectrum is a sum of damped sines ([`damped_sines`]). The response H is identified by a multisine at low level
//! ([`Identification`]). Over the lines of a frame, which holds the waveform and the time in which the structure comes to rest,
//!
//! ```text
//! U = H⁻¹ R,   U ← U + α H⁻¹ (R − C/L),   H⁻¹ = conj H/(|H|² + σ²)
//! ```
//!
//! with the response C to a shot at the level L. σ is the deviation of H by the noise that was read in silence: a line whose
//! response is below the noise is left out, where it would only amplify noise. The iteration converges where |1 − α H/Ĥ| < 1, so
//! a correction is kept only if the largest error in the waveform fell; else it is taken back and α is halved.
//!
//! Shots at low level come first. Shots of the specification below the full level serve for that; a specification without them
//! is preceded by two shots each at −12 and −6 dB.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::Complex;
use resonarm_modal::spectra::ShockResponse;
use resonarm_specification::{ShockTest, Shots, SrsTest};

use super::line_bank::{Identification, Known, LineBank};
use super::probe::Probe;
use super::stop::StopReason;
use super::{End, Law, LawSettings, Step, TestControlError, TestPhase, TestProgress, TestSample};

const ZERO: Complex<f64> = Complex::new(0.0, 0.0);
/// Least length of a frame, s, and in lengths of the waveform; the waveform begins after `LEAD` of the frame.
const FRAME_S: f64 = 8.0;
const FRAME_LENGTHS: f64 = 4.0;
const LEAD: f64 = 3.0 / 16.0;
/// Part of the frame in which the drive fades in and out: the inverse response is periodic over the frame.
const FADE: f64 = 1.0 / 32.0;
/// Pause between two frames, s.
const PAUSE_S: f64 = 2.0;
/// Lowest line, Hz, and the frequency from which on lines count in full; the same over the sample rate for the highest ones.
const LOW_HZ: [f64; 2] = [1.0, 2.0];
const HIGH: [f64; 2] = [0.3, 0.4];
/// Rms of the response to the identification over the peak of the waveform, and the share of the drive's limit that it uses at
/// most.
const IDENTIFIED_LEVEL: f64 = 0.1;
const IDENTIFIED_DRIVE: f64 = 0.25;
/// Least line of the identification's drive over its largest one.
const LEAST_LINE: f64 = 0.02;
/// Shots before those of a specification that begins at full level.
const FIRST_SHOTS: [Shots; 2] = [Shots { level_db: -12.0, count: 2 }, Shots { level_db: -6.0, count: 2 }];
/// Reading over the peak of the waveform above which a shot is stopped, and samples for which it must be.
const TOO_HIGH: f64 = 1.5;
const TOO_HIGH_SAMPLES: u32 = 3;
/// Energy of the reading over that of the waveform below which the signal is lost.
const LOST: f64 = 0.1;

/// Replicates a waveform: identification first, then shots that are corrected one after the other.
#[derive(Clone, Debug)]
pub(super) struct ShockLaw {
    /// Waveform at full level, m/s², its largest size and its energy, Σ r².
    waveform: Vec<f64>,
    peak_m_s2: f64,
    energy: f64,
    /// First sample of the waveform in the frame.
    lead: usize,
    fade: usize,
    pause: u64,
    /// Levels of the shots as factors.
    levels: Vec<f64>,
    limit_n: f64,
    probe: Probe,
    identification: Identification,
    /// Lines of the waveform, and the share with which a line counts.
    wanted: Vec<Complex<f64>>,
    taper: Vec<f64>,
    /// Inverse response, and lines of the drive at full level.
    inverse: Vec<Complex<f64>>,
    drive: Vec<Complex<f64>>,
    /// Lines of the drive with the least error at this level, and what was missing with it.
    best: Vec<Complex<f64>>,
    missing: Vec<Complex<f64>>,
    least_error: f64,
    /// Share α of the correction that is applied, halved when a shot got worse.
    step: f64,
    /// Lines and samples of the response to the present shot.
    response: Vec<Complex<f64>>,
    reading: Vec<f64>,
    stage: Stage,
    shot: usize,
    /// Largest drive of the last shot over its level, N.
    drive_peak_n: f64,
    shot_peak_n: f64,
    too_high: u32,
}

/// Stage of the test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// The loop check, with weak noise.
    Check,
    /// The identification of the responses, at low level.
    Identify,
    /// The drive of the identification fades out, over this number of samples.
    FadeOut(usize),
    /// Silence before a shot, for this number of samples.
    Pause(u64),
    /// A shot, with its lead and what rings after it.
    Shot,
}

impl ShockLaw {
    /// Builds the law of a classical shock.
    ///
    /// # Errors
    /// [`TestControlError`] if the specification states no compensation.
    pub fn classical(test: &ShockTest, of: &LawSettings<'_>) -> Result<ShockLaw, TestControlError> {
        let (waveform, _) = test.compensated(of.rate_hz).ok_or(TestControlError::NoCompensation)?;
        Ok(ShockLaw::new(waveform, &test.shots, of))
    }

    /// Builds the law of a shock by its response spectrum.
    ///
    /// # Errors
    /// [`TestControlError`] if the samples don't carry the spectrum.
    pub fn by_spectrum(test: &SrsTest, of: &LawSettings<'_>) -> Result<ShockLaw, TestControlError> {
        let [_, to_hz] = test.profile.band_hz();
        let rate_hz = of.rate_hz;
        let most_hz = HIGH[0] * of.rate_hz;
        if to_hz > most_hz {
            return Err(TestControlError::Rate { to_hz, rate_hz, most_hz });
        }
        let waveform = damped_sines(test, rate_hz).ok_or(TestControlError::Rate { to_hz, rate_hz, most_hz })?;
        Ok(ShockLaw::new(waveform, &test.shots, of))
    }

    fn new(waveform: Vec<f64>, shots: &[Shots], of: &LawSettings<'_>) -> ShockLaw {
        let rate_hz = of.rate_hz;
        let frame = (FRAME_S * rate_hz).max(FRAME_LENGTHS * waveform.len() as f64);
        let period = libm::ceil(frame) as usize;
        let lead = (LEAD * frame) as usize;
        let band_hz = [LOW_HZ[0], HIGH[1] * rate_hz];
        let mut bank = LineBank::new(period, rate_hz, band_hz);
        let taper = |k: usize| {
            let hz = (bank.first + k) as f64 * rate_hz / period as f64;
            let share = |from: f64, to: f64| ((hz - from) / (to - from)).clamp(0.0, 1.0);
            share(LOW_HZ[0], LOW_HZ[1]) * share(HIGH[1] * rate_hz, HIGH[0] * rate_hz)
        };
        let taper: Vec<f64> = (0..bank.lines()).map(taper).collect();
        let wanted = bank.lines_of(core::iter::repeat_n(0.0, lead).chain(waveform.iter().copied()));
        let starts_low = shots.first().is_some_and(|shots| shots.level_db < 0.0);
        let full = [Shots { level_db: 0.0, count: 1 }];
        let shots = if shots.is_empty() { &full } else { shots };
        let first: &[Shots] = if starts_low { &[] } else { &FIRST_SHOTS };
        let levels = first
            .iter()
            .chain(shots)
            .flat_map(|shots| core::iter::repeat_n(libm::pow(10.0, shots.level_db / 20.0), shots.count as usize));
        let lines = bank.lines();
        let identification = Identification::new(bank, 1, rate_hz, IDENTIFIED_DRIVE * of.limit_n);
        ShockLaw {
            peak_m_s2: waveform.iter().fold(0.0, |peak, sample| peak.max(sample.abs())),
            energy: waveform.iter().map(|sample| sample * sample).sum(),
            waveform,
            lead,
            fade: (FADE * frame) as usize,
            pause: (PAUSE_S * rate_hz) as u64,
            levels: levels.collect(),
            limit_n: of.limit_n,
            probe: Probe::of_check(of, [LOW_HZ[1], HIGH[0] * rate_hz]),
            identification,
            wanted,
            taper,
            inverse: vec![ZERO; lines],
            drive: vec![ZERO; lines],
            best: vec![ZERO; lines],
            missing: vec![ZERO; lines],
            least_error: f64::INFINITY,
            step: 1.0,
            response: vec![ZERO; lines],
            reading: vec![0.0; period],
            stage: Stage::Check,
            shot: 0,
            drive_peak_n: 0.0,
            shot_peak_n: 0.0,
            too_high: 0,
        }
    }

    fn begin_identification(&mut self) {
        self.identification.begin(IDENTIFIED_LEVEL * self.peak_m_s2 / self.probe.gain());
        self.stage = Stage::Identify;
    }

    /// Answers a sample of the identification, and goes on to the shots when the response is known.
    fn identify(&mut self, control_m_s2: f64) -> f64 {
        let (drive_n, known) = self.identification.step(core::iter::once(control_m_s2));
        match known {
            Known::Nothing => {}
            Known::Roughly => {
                let size = |k: usize| self.taper[k] * libm::sqrt(self.wanted[k].norm_sqr());
                let rms_m_s2 = IDENTIFIED_LEVEL * self.peak_m_s2;
                let noise = self.probe.noise_density();
                self.identification.shape(size, LEAST_LINE, rms_m_s2, noise);
            }
            Known::Well => {
                self.invert();
                self.stage = Stage::FadeOut(self.fade);
            }
        }
        drive_n
    }

    /// Finds the inverse response and the first drive.
    fn invert(&mut self) {
        let noise = self.probe.noise_density();
        for (k, inverse) in self.inverse.iter_mut().enumerate() {
            let response = self.identification.responses[0][k];
            let power = response.norm_sqr() + self.identification.variance(k, noise);
            *inverse = response.conj() * (self.taper[k] / power.max(f64::MIN_POSITIVE));
            self.drive[k] = *inverse * self.wanted[k];
        }
    }

    /// Begins a pause, after which a shot follows.
    fn begin_pause(&mut self) {
        self.stage = Stage::Pause(self.pause);
        self.identification.bank.restart();
        self.response.fill(ZERO);
        self.shot_peak_n = 0.0;
        self.too_high = 0;
    }

    fn level(&self) -> f64 {
        self.levels.get(self.shot).copied().unwrap_or(1.0)
    }

    /// Returns the drive of the present sample of a shot.
    fn shot_drive_n(&self) -> f64 {
        let bank = &self.identification.bank;
        let n = bank.sample;
        let last = bank.period - 1;
        // The frame fades in and out at both of its ends.
        let edge = n.min(last - n);
        raised_cosine(edge as f64 / self.fade as f64) * self.level() * bank.sum(&self.drive)
    }

    /// Answers a sample of a shot.
    fn play(&mut self, sample: &TestSample<'_>) -> Step {
        if sample.lost > 0 {
            return Step { drive_n: 0.0, end: Some(End::Stopped(StopReason::SamplesLost { samples: sample.lost })) };
        }
        let n = self.identification.bank.sample;
        let level = self.level();
        let limit_n = self.limit_n;
        self.reading[n] = sample.control_m_s2;
        self.identification.bank.read(&mut self.response, sample.control_m_s2);
        let drive_n = self.shot_drive_n();
        let needed_n = drive_n.abs();
        self.shot_peak_n = self.shot_peak_n.max(needed_n);
        let mut end = End::of_drive(needed_n, limit_n);
        end = end.or_else(|| self.judge(n, level, sample.control_m_s2));
        if self.identification.bank.advance() && end.is_none() {
            end = self.finish_shot(level);
        }
        Step { drive_n: drive_n.clamp(-limit_n, limit_n), end }
    }

    /// Judges the reading within a shot.
    fn judge(&mut self, n: usize, level: f64, control_m_s2: f64) -> Option<End> {
        let expected_m_s2 = level * self.peak_m_s2;
        let limit_m_s2 = TOO_HIGH * expected_m_s2;
        self.too_high = if control_m_s2.abs() > limit_m_s2 { self.too_high + 1 } else { 0 };
        if self.too_high >= TOO_HIGH_SAMPLES {
            let got_m_s2 = control_m_s2.abs();
            return Some(End::Stopped(StopReason::TooHigh { got_m_s2, expected_m_s2, limit_m_s2 }));
        }
        let count = self.waveform.len();
        if n + 1 != self.lead + count {
            return None;
        }
        let energy: f64 = self.reading[self.lead..=n].iter().map(|sample| sample * sample).sum();
        let rms = |energy: f64| libm::sqrt(energy / count as f64);
        let got_m_s2 = rms(energy);
        let expected_m_s2 = level * rms(self.energy);
        // A reading that is not a number is lost, too.
        let is_there = energy >= LOST * level * level * self.energy;
        (!is_there).then_some(End::Stopped(StopReason::Lost { got_m_s2, expected_m_s2 }))
    }

    /// Corrects the drive after a shot, and goes on to the next one.
    fn finish_shot(&mut self, level: f64) -> Option<End> {
        let read = &self.reading[self.lead..self.lead + self.waveform.len()];
        let deviation = read.iter().zip(&self.waveform).map(|(got, wanted)| (got / level - wanted).abs());
        let error = deviation.fold(0.0, f64::max) / self.peak_m_s2;
        let is_better = error < self.least_error;
        if is_better {
            self.least_error = error;
            self.best.copy_from_slice(&self.drive);
            for ((missing, wanted), got) in self.missing.iter_mut().zip(&self.wanted).zip(&self.response) {
                *missing = *wanted - *got / level;
            }
        } else {
            self.step *= 0.5;
        }
        self.drive_peak_n = self.shot_peak_n / level;
        self.shot += 1;
        let Some(next) = self.levels.get(self.shot).copied() else { return Some(End::Complete) };
        let is_same_level = next == level;
        // A step that has just proved too long is tried again, shorter, at the same level only: the next level begins with the
        // drive that is known to be best.
        let step = if is_better || is_same_level { self.step } else { 0.0 };
        for (k, drive) in self.drive.iter_mut().enumerate() {
            *drive = self.best[k] + self.inverse[k] * self.missing[k] * step;
        }
        if !is_same_level {
            // The structure may respond otherwise at another level, so that the errors can't be compared.
            self.least_error = f64::INFINITY;
            self.step = 1.0;
        }
        let needed_n = next * self.drive_peak_n;
        let limit_n = self.limit_n;
        let end = End::of_drive(needed_n, limit_n);
        if end.is_none() {
            self.begin_pause();
        }
        end
    }
}

impl Law for ShockLaw {
    fn restart(&mut self) {
        self.probe.restart();
        // Everything else is set when its stage begins. An infinite error makes the first shot the best one so far.
        self.stage = Stage::Check;
        self.shot = 0;
        self.step = 1.0;
        self.least_error = f64::INFINITY;
    }

    fn step(&mut self, sample: &TestSample<'_>) -> Step {
        let quiet = Step { drive_n: 0.0, end: None };
        match self.stage {
            Stage::Check => {
                if sample.lost > 0 {
                    self.probe.interrupt();
                }
                let (drive_n, judged) = self.probe.step(sample);
                if judged == Some(Ok(())) {
                    self.begin_identification();
                }
                Step { drive_n, end: judged.and_then(Result::err) }
            }
            Stage::Identify => {
                if sample.lost > 0 {
                    self.identification.restart();
                }
                Step { drive_n: self.identify(sample.control_m_s2), end: None }
            }
            Stage::FadeOut(0) => {
                self.begin_pause();
                quiet
            }
            Stage::FadeOut(left) => {
                self.stage = Stage::FadeOut(left - 1);
                Step { drive_n: raised_cosine(left as f64 / self.fade as f64) * self.identification.go_on(), end: None }
            }
            Stage::Pause(0) => {
                self.stage = Stage::Shot;
                // Samples that were lost before it are not of the shot.
                self.play(&TestSample { lost: 0, ..*sample })
            }
            Stage::Pause(left) => {
                self.stage = Stage::Pause(left - 1);
                quiet
            }
            Stage::Shot => self.play(sample),
        }
    }

    fn coast(&mut self, sample: &TestSample<'_>) -> f64 {
        match self.stage {
            Stage::Check => self.probe.step(sample).0,
            Stage::Identify => self.identification.go_on(),
            Stage::FadeOut(left) => raised_cosine(left as f64 / self.fade as f64) * self.identification.go_on(),
            Stage::Pause(_) => 0.0,
            Stage::Shot => {
                let drive_n = self.shot_drive_n().clamp(-self.limit_n, self.limit_n);
                self.identification.bank.advance();
                drive_n
            }
        }
    }

    fn progress(&self) -> TestProgress {
        let phase = match self.stage {
            Stage::Check => self.probe.phase,
            Stage::Identify | Stage::FadeOut(_) => TestPhase::Identification,
            Stage::Pause(_) | Stage::Shot => TestPhase::Level,
        };
        let level_db = (phase == TestPhase::Level).then(|| 20.0 * libm::log10(self.level()));
        TestProgress { phase, level_db, full_level_s: 0.0, frequency_hz: None }
    }

    fn samples(&self) -> Option<u64> {
        let shot = self.pause + self.identification.bank.period as u64;
        let before = self.probe.samples() + self.identification.samples() + self.fade as u64 + 1;
        Some(before + shot * self.levels.len() as u64)
    }
}

/// Returns a smooth step from 0 at 0 to 1 at 1 and beyond.
fn raised_cosine(part: f64) -> f64 {
    0.5 - 0.5 * libm::cos(0.5 * TAU * part.min(1.0))
}

/// Damped sines in an octave, their damping ratio, and their start and length in periods of the lowest one.
const SINES_OCTAVE: f64 = 6.0;
const SINE_DAMPING: f64 = 0.05;
const SINES_START: f64 = 0.4;
const SINES_LENGTH: f64 = 24.0;
/// Frequencies of the two sines that bring velocity and displacement to zero, below the lowest one by these factors, and their
/// damping ratios.
const END_SINES: [(f64, f64); 2] = [(2.5, 1.0), (3.3, 0.9)];
/// Corrections of the amplitudes, exponent of a correction, and the range of its ratio.
const CORRECTIONS: u32 = 60;
const CORRECTION_EXPONENT: f64 = 0.6;
const CORRECTION_RATIO: [f64; 2] = [0.7, 1.4];

/// Returns a waveform with the response spectrum of a test, m/s²: damped sines e^(−ζωt) sin ωt a sixth of an octave apart, with
/// signs in turn, whose amplitudes are corrected by the ratio of the specified and the found response. Two slow sines bring
/// velocity and displacement to zero. `None` if the spectrum can't be computed.
///
/// D. O. Smallwood, A. R. Nord, "Matching shock spectra with sums of decaying sinusoids compensated for shaker velocity and
/// displacement limitations", Shock and Vibration Bulletin 44 (1974).
fn damped_sines(test: &SrsTest, rate_hz: f64) -> Option<Vec<f64>> {
    let [from_hz, to_hz] = test.profile.band_hz();
    let steps = libm::floor(SINES_OCTAVE * libm::log2(to_hz / from_hz) + 1e-9) as usize;
    let mut frequency_hz: Vec<f64> = (0..=steps).map(|k| from_hz * libm::exp2(k as f64 / SINES_OCTAVE)).collect();
    // The last sine is at the highest frequency. Two that are less than half a step apart would work against each other.
    match frequency_hz.last_mut() {
        Some(last) if *last * libm::exp2(0.5 / SINES_OCTAVE) > to_hz => *last = to_hz,
        _ => frequency_hz.push(to_hz),
    }
    let wanted: Vec<f64> = frequency_hz.iter().map(|hz| test.profile.at(hz.min(to_hz))).collect::<Option<_>>()?;
    let count = libm::ceil(SINES_LENGTH / from_hz * rate_hz) as usize;
    let start_s = SINES_START / from_hz;
    let sine = |hz: f64, damping: f64, start_s: f64| -> Vec<f64> {
        let value = |n: usize| {
            let t_s = n as f64 / rate_hz - start_s;
            if t_s < 0.0 { 0.0 } else { libm::exp(-damping * TAU * hz * t_s) * libm::sin(TAU * hz * t_s) }
        };
        (0..count).map(value).collect()
    };
    let sines: Vec<Vec<f64>> = frequency_hz.iter().map(|hz| sine(*hz, SINE_DAMPING, start_s)).collect();
    let [slow, slower] = END_SINES.map(|(factor, damping)| sine(from_hz / factor, damping, 0.0));
    // The sums that stand for ∫a dt and ∬a dt²: a sample at n stays in count − n running sums.
    let ends = |values: &[f64]| {
        values
            .iter()
            .enumerate()
            .fold([0.0, 0.0], |[sum, double], (n, value)| [sum + value, double + value * (count - n) as f64])
    };
    let [a, c] = ends(&slow);
    let [b, d] = ends(&slower);
    let wave = |amplitudes: &[f64]| -> Vec<f64> {
        let mut wave = vec![0.0; count];
        for ((amplitude, sine), index) in amplitudes.iter().zip(&sines).zip(0_usize..) {
            let signed = if index.is_multiple_of(2) { *amplitude } else { -amplitude };
            wave.iter_mut().zip(sine).for_each(|(sum, value)| *sum += signed * value);
        }
        let [velocity, place] = ends(&wave);
        let determinant = a * d - b * c;
        let x = (b * place - d * velocity) / determinant;
        let y = (c * velocity - a * place) / determinant;
        for ((sum, slow), slower) in wave.iter_mut().zip(&slow).zip(&slower) {
            *sum += x * slow + y * slower;
        }
        wave
    };
    let mut amplitudes: Vec<f64> = wanted.iter().map(|level| level / (0.6 * test.quality)).collect();
    let rest = libm::ceil(rate_hz / from_hz) as usize;
    for _ in 0..CORRECTIONS {
        let mut record = wave(&amplitudes);
        record.resize(count + rest, 0.0);
        let found = ShockResponse::estimate(rate_hz, &record, test.quality, &frequency_hz).ok()?.maximax();
        for ((amplitude, wanted), found) in amplitudes.iter_mut().zip(&wanted).zip(&found) {
            let ratio = (wanted / found).clamp(CORRECTION_RATIO[0], CORRECTION_RATIO[1]);
            *amplitude *= libm::pow(ratio, CORRECTION_EXPONENT);
        }
    }
    let wave = wave(&amplitudes);
    wave.iter().all(|sample| sample.is_finite()).then_some(wave)
}

#[cfg(test)]
mod tests {
    use super::*;
    use resonarm_specification::{Specification, SpecificationFile, Test};

    /// The facts of a spectrum from 20 to 100 m/s²: peak 22 m/s², stroke 0.65 mm, as a prototype in Python found.
    #[test]
    fn damped_sines_have_their_spectrum_and_end_at_rest() {
        let text = "[spec]\nkind = 'shock'\nsources = []\n[srs]\nunit = 'm/s2'\nq = 10\n\
                    breakpoints = [[20, 20], [60, 100], [180, 100]]\ntolerance_db = [-1.5, 3]\nlines_per_octave = 6\n";
        let file: SpecificationFile = toml::from_str(text).unwrap();
        let Test::Srs(test) = Specification::new(&file, |_| unreachable!()).unwrap().test else { unreachable!() };
        let wave = damped_sines(&test, 1000.0).unwrap();
        let mut record = wave.clone();
        record.resize(wave.len() + 50, 0.0);
        let lines: Vec<f64> = (0..20).map(|k| 20.0 * libm::exp2(k as f64 / 6.0)).filter(|hz| *hz <= 180.0).collect();
        let found = ShockResponse::estimate(1000.0, &record, 10.0, &lines).unwrap().maximax();
        for (hz, found) in lines.iter().zip(found) {
            let db = 20.0 * libm::log10(found / test.profile.at(*hz).unwrap());
            assert!(db.abs() < 0.05, "{hz}: {db}");
        }
        let mut velocity = 0.0;
        let mut place = 0.0;
        let mut low = 0.0_f64;
        let mut high = 0.0_f64;
        for sample in &wave {
            velocity += sample / 1000.0;
            place += velocity / 1000.0;
            low = low.min(place);
            high = high.max(place);
        }
        assert!(velocity.abs() < 1e-12 && place.abs() < 1e-12, "{velocity} {place}");
        let peak = wave.iter().fold(0.0_f64, |peak, sample| peak.max(sample.abs()));
        assert!((peak - 22.0).abs() < 1.0 && (high - low - 0.65e-3).abs() < 0.1e-3, "{peak} {}", high - low);
    }
}
