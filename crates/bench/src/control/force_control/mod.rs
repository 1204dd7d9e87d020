//! Force control: at every frequency of a stepped sine, the fundamental of the force in the impedance head is brought
//! to the wanted amplitude.
//!
//! Between a shaker's coil and the arm is the armature, which near a resonance takes most of the coil's force.
//! The force H that a command c produces in the head therefore depends on arm, shaker and frequency. Once a
//! held command has settled, H/c is constant, and the command that would have given F is
//!
//! ```text
//! c ← c F/H
//! ```
//!
//! exactly for a linear arm. Where the arm's frequency changes with its amplitude, H grows with c to a power s
//! = d ln H/d ln c other than 1, and the step is c ← c (F/H)^(1/s), with s from the last two tries where it is
//! above 1. Where it is below, near a fold, the step is unchanged. Periodic responses with s > 0 attract, those
//! between two folds, with s < 0, repel, so that a sweep jumps where the response at constant force folds.
//!
//! While a command is held there is no feedback, so that no gain has to suit arm and shaker; the vibration
//! settles by the damping of the shaker.
//!
//! With a notch, F is limited to the force at which an acceleration reaches the notch.
//!
//! Harmonics of the force are cancelled on request by harmonics of the command ([`CancelHarmonics`]).
//!
//! A sine that is held from sample to sample has images above its fundamental. The converter folds some of them onto
//! the fundamental ([`Converter::images`](crate::rig::Converter::images)), and the head reads the share of these that
//! passes the armature into the arm.

use alloc::vec::Vec;
use core::f64::consts::TAU;
use core::mem;

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::abort::Abort;
use super::cancellation::{CancelHarmonics, Cancellation};
use super::fourier_filter::{unit, wrapped};
use super::mode_model::Modelled;
use super::response::{Reading, ResponsePoint, SAMPLES_A_PERIOD};
use super::{Answer, Controller, Length, LoadKind, NeededReading};
use crate::excitation::{ExcitationError, ExcitationSpec, Phasor, Profile, Waveform, Window};
use crate::rig::{Load, Measurement, Sampling};
use resonarm_numeric::number::short;

/// Largest relative deviation of the force from the requested one.
const TOLERANCE: f64 = 3e-3;
/// Number of tries after which a point is reported as not settled.
const MOST_TRIES: u32 = 30;
/// Largest factor by which one try changes the command.
const LARGEST_FACTOR: f64 = 4.0;
/// Largest power s that is accepted; the next constant is the least change of ln c from which it is computed.
const LARGEST_POWER: f64 = 10.0;
const TELLING_CHANGE: f64 = 2e-3;

/// Force control as a scenario states it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ForceControlSpec {
    /// Amplitude and direction of the force in the head.
    pub amplitude: Load,
    /// Duration of the ramp from one amplitude to the next, s, not negative.
    #[serde(default)]
    pub ramp_s: f64,
    /// Frequencies, as a dwell, a stepped sine or a list.
    pub profile: Waveform,
    /// Notch at B: largest amplitude of the acceleration, m/s², positive. The force is reduced where B would
    /// exceed it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub notch_b_m_s2: Option<f64>,
    /// Notch at C, m/s². Where the force would exceed it, the acceleration is controlled in place of the force.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub notch_c_m_s2: Option<f64>,
    /// Harmonics of the force that are cancelled. A point settles only with each of them below 0.2 % of the
    /// fundamental.
    #[serde(default, skip_serializing_if = "CancelHarmonics::is_none")]
    pub cancel_harmonics: CancelHarmonics,
}

impl ForceControlSpec {
    /// Returns force control of an excitation, without notches and without cancelled harmonics.
    pub fn new(excitation: &ExcitationSpec) -> ForceControlSpec {
        let ExcitationSpec { amplitude, ramp_s, profile } = excitation.clone();
        let cancel_harmonics = CancelHarmonics::NONE;
        ForceControlSpec { amplitude, ramp_s, profile, notch_b_m_s2: None, notch_c_m_s2: None, cancel_harmonics }
    }

    fn excitation(&self) -> ExcitationSpec {
        let ForceControlSpec { amplitude, ramp_s, profile, .. } = self.clone();
        ExcitationSpec { amplitude, ramp_s, profile }
    }
}

/// Reason why a force can't be controlled with these settings.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ForceControlError {
    /// The profile can't be played.
    #[error(transparent)]
    Excitation(#[from] ExcitationError),
    /// A notch is not a positive number.
    #[error("control: `{name}` is {got}: it must be a positive number", got = short(.got))]
    Notch {
        /// Key of the notch in a scenario.
        name: &'static str,
        /// Value that was given, m/s².
        got: f64,
    },
    /// The amplitude is a torque, which the impedance head does not measure.
    #[error(
        "control: force control uses the impedance head, which measures no torque: give `exciter_x` or `exciter_y`"
    )]
    Torque,
    /// The profile does not consist of single frequencies.
    #[error(
        "control: force control sets the amplitude of the force at one frequency after the other: set `waveform` to `dwell`, `stepped-sine` or `sine-list`"
    )]
    NotADwell,
    /// The sample rate is too low for the highest frequency.
    #[error("control: the sample rate of {rate_hz} Hz is too low for force control at {frequency_hz:.2} Hz: it must be at least {:.0} Hz", SAMPLES_A_PERIOD * frequency_hz)]
    Rate {
        /// The sample rate, Hz.
        rate_hz: f64,
        /// The highest frequency, Hz.
        frequency_hz: f64,
    },
}

/// Stage of the present point; it begins at sample `since`.
#[derive(Clone, Copy, Debug)]
enum Stage {
    /// The command ramps from the last one to the present one.
    Ramp { from: Phasor, since: u64 },
    /// The transient of the change dies out.
    Settle { since: u64 },
    /// The response is read until sample `until`.
    Read { until: u64 },
    /// The command ramps to zero at the end.
    Leave { from: Phasor, since: u64 },
}

/// Plays a dwell or a stepped sine, and brings the fundamental of the force in the impedance head to its
/// amplitude at every frequency.
#[derive(Clone, Debug)]
pub struct ForceControl {
    frequencies_hz: Vec<f64>,
    sampling: Sampling,
    limit_n: f64,
    /// Share of the coil's force that enters the arm far above its natural frequencies.
    share: f64,
    amplitude_n: f64,
    /// Notches: largest amplitudes of the accelerations of B and C, m/s².
    notches_m_s2: [Option<f64>; 2],
    direction: Vector2<f64>,
    /// Least durations of a ramp, of settling and of a reading, s.
    ramp_s: f64,
    settle_s: f64,
    read_s: f64,
    stage: Stage,
    /// Response that is being read.
    reading: Option<Reading>,
    /// Index of the frequency; the next field is the number of its tries.
    point: usize,
    tries: u32,
    /// Complex amplitude of the command: Im(c e^{iφ}) at the phase φ, N.
    command_n: Phasor,
    /// Harmonics of the command, if some are cancelled.
    cancellation: Option<Cancellation>,
    /// ln c and ln H of the last try at this frequency; the next field is s.
    tried: Option<[f64; 2]>,
    power: f64,
    last_sample: Option<u64>,
    /// Phase in the middle of the last hold, rad.
    phase_rad: f64,
    response: Option<ResponsePoint>,
}

impl ForceControl {
    /// Returns a controller that plays the frequencies of `spec` on the modelled structure, with readings at
    /// this `sampling` and an exciter with the limit `limit_n`.
    ///
    /// # Errors
    /// [`ForceControlError`] names the impossible setting.
    pub fn new(
        spec: &ForceControlSpec,
        of: Modelled<'_>,
        sampling: Sampling,
        limit_n: f64,
    ) -> Result<ForceControl, ForceControlError> {
        let rate_hz = sampling.rate_hz;
        let notches = [("notch_b_m_s2", spec.notch_b_m_s2), ("notch_c_m_s2", spec.notch_c_m_s2)];
        for (name, got) in notches.into_iter().filter_map(|(name, notch)| Some((name, notch?))) {
            if !(got.is_finite() && got > 0.0) {
                return Err(ForceControlError::Notch { name, got });
            }
        }
        if spec.amplitude.has_torque() {
            return Err(ForceControlError::Torque);
        }
        let profile = Profile::new(&spec.excitation(), rate_hz)?;
        let (Some(dwell_s), Some(settle_s)) = (spec.profile.dwell_s(), spec.profile.settle_s()) else {
            return Err(ForceControlError::NotADwell);
        };
        let frequencies_hz: Vec<f64> = profile.windows().map(|window| window.frequency_hz).collect();
        // The highest frequency has the fewest samples per period.
        let frequency_hz = frequencies_hz.iter().fold(0.0_f64, |most, frequency| most.max(*frequency));
        if rate_hz < SAMPLES_A_PERIOD * frequency_hz {
            return Err(ForceControlError::Rate { rate_hz, frequency_hz });
        }
        let force_n = spec.amplitude.force_n.xy();
        let amplitude_n = force_n.norm();
        let direction = force_n / amplitude_n;
        Ok(ForceControl {
            frequencies_hz,
            sampling,
            limit_n,
            share: of.high_frequency_force_share(),
            amplitude_n,
            notches_m_s2: [spec.notch_b_m_s2, spec.notch_c_m_s2],
            direction,
            ramp_s: spec.ramp_s,
            settle_s,
            read_s: dwell_s - settle_s,
            stage: Stage::Ramp { from: Phasor::new(0.0, 0.0), since: 0 },
            reading: None,
            point: 0,
            tries: 0,
            // The first command is the wanted force itself, which an ideal exciter needs no correction for.
            command_n: Phasor::new(amplitude_n, 0.0),
            cancellation: Cancellation::new(spec.cancel_harmonics, of, direction, sampling),
            tried: None,
            power: 1.0,
            last_sample: None,
            phase_rad: 0.0,
            response: None,
        })
    }

    /// Returns the frequency that is played, Hz; after the end, the last one.
    fn frequency_hz(&self) -> f64 {
        // While the command ramps to zero at the end, the sine keeps its last frequency.
        let last = self.frequencies_hz.len().saturating_sub(1);
        self.frequencies_hz.get(self.point.min(last)).copied().unwrap_or(0.0)
    }

    fn samples(&self, seconds: f64) -> u64 {
        libm::ceil(seconds * self.sampling.rate_hz) as u64
    }

    /// Progress of a ramp that began at `since`: a smooth step from 0 to 1.
    fn ramped(&self, n: u64, since: u64) -> f64 {
        let x = ((n - since) as f64 / self.samples(self.ramp_s).max(1) as f64).min(1.0);
        // The cubic smoothstep begins and ends without a change of slope, so it excites the modes less than a
        // straight ramp.
        x * x * (3.0 - 2.0 * x)
    }

    /// Returns the harmonics of the command from sample `n` on, N.
    fn harmonics_n(&self, n: u64) -> f64 {
        let share = match self.stage {
            Stage::Ramp { since, .. } | Stage::Leave { since, .. } => self.ramped(n, since),
            Stage::Settle { .. } | Stage::Read { .. } => 1.0,
        };
        self.cancellation.as_ref().map_or(0.0, |cancellation| cancellation.command_n(self.phase_rad, share))
    }

    /// Returns the complex amplitude of the command from sample `n` on.
    fn amplitude(&self, n: u64) -> Phasor {
        match self.stage {
            Stage::Ramp { from, since } => from + (self.command_n - from) * self.ramped(n, since),
            Stage::Settle { .. } | Stage::Read { .. } => self.command_n,
            Stage::Leave { from, since } => from * (1.0 - self.ramped(n, since)),
        }
    }

    /// Moves to the next stage when it is time. Returns whether all frequencies are done.
    fn proceed(&mut self, n: u64) -> bool {
        let ramp = self.samples(self.ramp_s);
        match self.stage {
            Stage::Ramp { since, .. } if n >= since + ramp => self.stage = Stage::Settle { since: n },
            Stage::Settle { since } if n >= since + self.samples(self.settle_s) => {
                let frequency_hz = self.frequency_hz();
                let periods = libm::ceil(self.read_s * frequency_hz);
                let until = n + 1 + self.samples(periods / frequency_hz);
                let window = Window { frequency_hz, first: n + 1, end: until };
                self.reading = Some(Reading::new(window, self.amplitude_n, self.sampling));
                self.cancellation.iter_mut().for_each(|cancellation| cancellation.begin(n + 1, until - n - 1));
                self.stage = Stage::Read { until };
            }
            Stage::Read { until } if n + 1 >= until => {
                let read = self.reading.take().and_then(|reading| reading.finish());
                self.judge(n, read);
            }
            Stage::Leave { since, .. } => return n >= since + ramp,
            _ => {}
        }
        false
    }

    /// Judges a response: reports it and moves to the next frequency, or tries again.
    fn judge(&mut self, n: u64, read: Option<ResponsePoint>) {
        self.tries += 1;
        // A window whose samples do not determine the fit gives no point, and the sweep moves on.
        let Some(mut point) = read else { return self.next(n) };
        let [x, y] = point.head_force_n;
        // The head also reads images of the held command that the converter aliases onto the fundamental. They
        // are known and subtracted.
        let images = self.share * self.sampling.images(point.frequency_hz);
        let head_n = x * self.direction.x + y * self.direction.y - self.command_n * images;
        point.load = libm::hypot(head_n.re, head_n.im);
        point.tries = self.tries;
        let wanted_n = self.wanted_n(&point);
        let off = (point.load / wanted_n - 1.0).abs();
        let from = self.command_n;
        // The power is learned from c and H of this try before the command is changed.
        self.learn(libm::log(libm::hypot(from.re, from.im)), libm::log(point.load));
        // The size of the factor is limited, its angle is not: a wrong phase can't overload the exciter.
        let factor = missing(head_n, wanted_n);
        self.command_n = corrected(from, factor, self.power);
        let reached = self.cancel(&point, factor, off) && off < TOLERANCE;
        // A point that does not settle is reported as such after the last try, so that a sweep always ends.
        if (reached && point.settled) || self.tries == MOST_TRIES {
            self.response = Some(ResponsePoint { settled: reached && point.settled, ..point });
            self.next(n);
        } else {
            self.stage = Stage::Ramp { from, since: n };
        }
    }

    /// Corrects the harmonics of the command. Returns whether those of the force are cancelled, as far as
    /// requested.
    fn cancel(&mut self, point: &ResponsePoint, factor: Phasor, off: f64) -> bool {
        let Some(cancellation) = &mut self.cancellation else { return true };
        let is_cancelled = cancellation.correct(point.frequency_hz, point.load, off);
        cancellation.follow(factor);
        is_cancelled
    }

    /// Estimates the power s from this try and the last one.
    fn learn(&mut self, command: f64, head: f64) {
        if let Some([command_before, head_before]) = self.tried {
            let change = command - command_before;
            if change.abs() > TELLING_CHANGE {
                // The lower bound 1 leaves the plain step where H grows less than c: a power below 1 would make
                // the step larger, and overshoot.
                self.power = ((head - head_before) / change).clamp(1.0, LARGEST_POWER);
            }
        }
        self.tried = Some([command, head]);
    }

    /// Returns the force to reach at the frequency of a response: F, or the force at which an acceleration
    /// reaches its notch, whichever is less.
    fn wanted_n(&self, point: &ResponsePoint) -> f64 {
        let accelerations = [&point.acceleration_b_m_s2, &point.acceleration_c_m_s2];
        // The structure is taken as linear between the present force and the notch. The next try corrects what
        // is left.
        let notched = self.notches_m_s2.iter().zip(accelerations).filter_map(|(notch, [x, y])| {
            let size = libm::sqrt(x.norm_sqr() + y.norm_sqr());
            notch.filter(|_| size > 0.0).map(|notch| point.load * notch / size)
        });
        notched.fold(self.amplitude_n, f64::min)
    }

    /// Moves to the next frequency with the present command, or to the end.
    fn next(&mut self, n: u64) {
        self.point += 1;
        self.tries = 0;
        self.tried = None;
        let from = self.command_n;
        let more = self.point < self.frequencies_hz.len();
        if let Some(cancellation) = &mut self.cancellation {
            cancellation.leave_frequency();
            if !more {
                cancellation.end();
            }
        }
        self.stage = if more { Stage::Ramp { from, since: n } } else { Stage::Leave { from, since: n } };
    }

    fn abort(&self, sample: &Measurement, force_n: f64) -> Option<Abort> {
        let frequency_hz = self.frequency_hz();
        if sample.head_force_n.iter().any(|reading| reading.clipped) {
            return Some(Abort::HeadClipped { frequency_hz });
        }
        let got = force_n.abs();
        let limit = self.limit_n;
        (got > limit).then_some(Abort::Load { got, limit, unit: "N", frequency_hz })
    }
}

/// Returns F/H with the rotation that brings the head's force into phase; its size is limited to a factor.
fn missing(head_n: Phasor, wanted_n: f64) -> Phasor {
    // Limited in both directions: near a resonance the head reads almost nothing, and F/H would be a huge
    // step.
    let size = libm::hypot(head_n.re, head_n.im).max(wanted_n / LARGEST_FACTOR).min(wanted_n * LARGEST_FACTOR);
    unit(-libm::atan2(head_n.im, head_n.re)) * (wanted_n / size)
}

/// Returns c |F/H|^(1/s), rotated by the angle of F/H.
fn corrected(command_n: Phasor, missing: Phasor, power: f64) -> Phasor {
    command_n * missing * libm::pow(libm::hypot(missing.re, missing.im), 1.0 / power - 1.0)
}

impl Controller for ForceControl {
    fn load_kind(&self) -> LoadKind {
        LoadKind::Force
    }

    /// The driving point is needed, as its acceleration shows whether a response has settled. B is needed only
    /// for a notch.
    fn needs(&self) -> Vec<NeededReading> {
        let b = self.notches_m_s2[0].is_some();
        NeededReading::marked([true, true, b, b, true, true])
    }

    fn restart(&mut self) {
        let start = Stage::Ramp { from: Phasor::new(0.0, 0.0), since: 0 };
        self.cancellation.iter_mut().for_each(Cancellation::forget);
        *self = ForceControl {
            cancellation: self.cancellation.take(),
            frequencies_hz: mem::take(&mut self.frequencies_hz),
            stage: start,
            reading: None,
            point: 0,
            tries: 0,
            command_n: Phasor::new(self.amplitude_n, 0.0),
            tried: None,
            power: 1.0,
            last_sample: None,
            phase_rad: 0.0,
            response: None,
            ..*self
        };
    }

    fn answer(&mut self, sample: &Measurement) -> Answer {
        let n = sample.sample;
        let step_rad = TAU * self.frequency_hz() / self.sampling.rate_hz;
        // While samples were lost, the plant held the load of the last one and the phase went on.
        let lost = self.last_sample.map_or(0, |last| (n - last).saturating_sub(1));
        self.phase_rad = wrapped(self.phase_rad + lost as f64 * step_rad);
        self.last_sample = Some(n);
        let late = self.sampling.converter.holds_late() as f64;
        let cycles = (self.phase_rad - late * step_rad) / TAU;
        if let Some(reading) = &mut self.reading {
            reading.add(sample, cycles - libm::floor(cycles));
            self.cancellation.iter_mut().for_each(|cancellation| cancellation.add(sample, cycles));
        }
        if self.proceed(n) {
            return Answer::Finished;
        }
        self.phase_rad = wrapped(self.phase_rad + TAU * self.frequency_hz() / self.sampling.rate_hz);
        let command_n = (self.amplitude(n) * unit(self.phase_rad)).im + self.harmonics_n(n);
        match self.abort(sample, command_n) {
            Some(abort) => Answer::Aborted(abort),
            None => {
                let [x_n, y_n] = (self.direction * command_n).into();
                Answer::Hold(Load::force_n(x_n, y_n))
            }
        }
    }

    fn poll_response(&mut self) -> Option<ResponsePoint> {
        self.response.take()
    }

    fn length(&self) -> Length {
        Length::Responses(self.frequencies_hz.len() as u64)
    }
}

#[cfg(test)]
mod tests;
