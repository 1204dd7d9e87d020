//! Phase walk: traces the whole response at a constant load amplitude point by point, stable or not; or the
//! backbone, at a lag of 90° and growing load; or, at one frequency after the other, the load that holds one
//! amplitude of the response.
//!
//! The followed displacement is kept at a chosen amplitude by feedback of its envelope, so that every periodic
//! response is stable under control and settles in a fraction of a second. In steady state the feedback is a
//! pure sine, an excitation like any other, and load and displacement are a point of the open-loop response at
//! any chosen amplitude. As a function of the lag φ of the displacement behind the load that response is
//! single-valued, with or without folds (T. Zhou, G. Kerschen, "Identification of Secondary Resonances of
//! Nonlinear Systems using Phase-Locked Loop Testing", 2024, arXiv:2401.01151). So φ is stepped, and for each φ
//! amplitude and frequency are corrected until the load has the wanted amplitude.
//!
//! With a the complex amplitude of the displacement, U that of the load, and m, ω₀, ζ of the mode, the envelope follows
//! 2iωm ȧ + m(ω₀² − ω² + 2iζω₀ω) a = U. The controller's U = 2iωm (g (A − a) + Ȧ) + D A, with D the dynamic stiffness
//! U/a expected at the target, makes a follow A(t), which is real, with the rate g.
//!
//! Harmonics of the force in the head are cancelled on request ([`CancelHarmonics`](super::CancelHarmonics)).
//!
//! With the default instruments, 14 and 20 N at the tip or 12 N·m at joint 1, and five poses, a point takes 1.2
//! to 3.0 tries, 1.6 on average, in 54 periods of mode 1 or 60 of mode 2. Smaller loads, which noise covers,
//! take more.

mod backbone_model;
mod drift_fit;
mod held;
mod plan;
mod reading;
mod spec;

use alloc::vec::Vec;
use core::f64::consts::TAU;
use core::mem;

pub use plan::{PhaseWalkPlan, ResponseControlSpec};
pub use spec::{PhaseWalkError, PhaseWalkSpec};

use self::backbone_model::BackboneModel;
use self::held::Held;
use self::plan::Wanted;
use self::reading::{Found, Reader};
use self::spec::BAND;
use super::abort::Abort;
use super::cancellation::Cancellation;
use super::fourier_filter::{FourierFilter, real_product, unit, wrapped};
use super::mode_model::{ModeModel, Modelled, SeenMode};
use super::response::ResponsePoint;
use super::{Answer, Controller, Length, LoadKind, NeededReading};
use crate::excitation::Phasor;
use crate::rig::{Load, Measurement, Sampling};

/// Number of tries after which a point is reported as not settled.
const MOST_TRIES: u32 = 6;
/// Number of points in a row that may fail to settle.
const MOST_UNSETTLED: u32 = 2;
/// Largest relative deviation of the load's amplitude from the requested one; the next constant is the most
/// that noise may allow.
const LOAD_TOLERANCE: f64 = 5e-4;
const NOISY_LOAD_TOLERANCE: f64 = 1.1e-3;
/// Largest deviation of the lag from its target, rad.
const LAG_TOLERANCE_RAD: f64 = 0.01;
/// Largest relative deviation of the displacement's amplitude from a requested one.
const AMPLITUDE_TOLERANCE: f64 = 1e-3;
/// Largest relative change of the displacement while a point is read; then the share of the load that this
/// change may take, and the uncertain part of that share.
const DRIFT_TOLERANCE: f64 = 4e-3;
const DRIFT_LOAD_TOLERANCE: f64 = 0.004;
const DRIFT_DOUBT: f64 = 0.6;
/// Amplitude that no periodic response is meant to reach, m.
const LARGEST_AMPLITUDE: f64 = 0.5;
/// Durations of ramp (at least), wait (at least and at most) and reading, in time constants 1/g of the loop.
const RAMP: f64 = 3.0;
const LEAST_SETTLE: f64 = 2.0;
const MOST_SETTLE: f64 = 6.0;
const READ: f64 = 5.0;
/// Rest of a step that may remain after the wait, relative to the amplitude, within the limits of the wait
/// above.
const SETTLED_STEP: f64 = 2.5e-3;
/// Lengthening of a reading with each try, relative to its length.
const RETRY: f64 = 0.25;
/// Largest factor by which noise may lengthen a reading.
const LONGEST_READ: f64 = 1.5;
/// Number of responses that can wait to be fetched.
const RESPONSES: usize = 4;

/// A periodic response to hold: amplitude of the displacement, m, frequency, and the dynamic stiffness U/a
/// expected there.
#[derive(Clone, Copy, Debug)]
struct Target {
    amplitude: f64,
    omega_rad_s: f64,
    stiffness: Phasor,
}

/// Stage of the present point.
#[derive(Clone, Copy, Debug)]
enum Stage {
    /// No sample has come yet.
    Start,
    /// Ramps from one periodic response to the next, from sample `since`, over `length` samples.
    Ramp { from: Target, since: u64, length: u64 },
    /// Waits until sample `until` for transients of the control loop to die out.
    Settle { until: u64 },
    /// Reads the point over whole periods.
    Read,
    /// Has finished or aborted.
    Done(Option<Abort>),
}

/// Controller that traces the response at constant load through a resonance, stable or not, or the backbone, or
/// the load that holds one amplitude.
#[derive(Clone, Debug)]
pub struct PhaseWalk {
    plan: PhaseWalkPlan,
    /// Limit of the exciter, N or N·m.
    limit: f64,
    unit_load: Load,
    /// Share of the coil's force that enters the structure far above its natural frequencies.
    share: f64,
    model: ModeModel,
    sampling: Sampling,
    gain_1_s: f64,
    filter: FourierFilter,
    backbone: BackboneModel,
    /// Load that is lost between the command and the structure, over the displacement, as the last reading
    /// found it: that of a shaker's armature.
    taken: Phasor,
    reader: Reader,
    /// Harmonics of the command, if some are cancelled.
    cancellation: Option<Cancellation>,
    /// Factor by which readings are longer than usual, because of noise.
    read_factor: f64,
    stage: Stage,
    target: Target,
    /// Index of the point; then the number of its tries, and the number of points before it in a row that did
    /// not settle.
    point: usize,
    tries: u32,
    unsettled: u32,
    /// Last answered sample; then its phase in the middle of the hold, angular frequency and held loads.
    last_sample: Option<u64>,
    phase_rad: f64,
    omega_rad_s: f64,
    held: Held,
    responses: Vec<ResponsePoint>,
}

impl PhaseWalk {
    /// Returns a walk on the modelled structure, or a stepped sine that controls the response, with readings at this
    /// `sampling` and an exciter with the limit `limit`, N or N·m.
    ///
    /// # Errors
    /// [`PhaseWalkError`] names the impossible setting.
    pub fn new(
        plan: impl Into<PhaseWalkPlan>,
        of: Modelled<'_>,
        sampling: Sampling,
        limit: f64,
    ) -> Result<PhaseWalk, PhaseWalkError> {
        let plan = plan.into();
        plan.check()?;
        let load = plan.load();
        let unit_load = plan.unit_load();
        // Changing an amplitude takes load beyond that of the steady response, so the whole of the exciter
        // can't be used up.
        let expected = "below the exciter's limit: the controller needs a reserve to change the amplitude";
        spec::check("amplitude", load, load < limit, expected)?;
        let share = of.high_frequency_force_share();
        let model = ModeModel::new(&of, &unit_load, plan.largest_load(), plan.mode_number())?;
        let gain_1_s = spec::gain_1_s(&model, plan.mode_number(), &sampling)?;
        plan.check_mode(&model)?;
        let cancellation = Cancellation::new(plan.cancel_harmonics(), of, unit_load.force_n.xy(), sampling);
        let room = (BackboneModel::new(&model), cancellation, Vec::with_capacity(RESPONSES));
        Ok(PhaseWalk::at_start(plan, (limit, share), model, (sampling, gain_1_s), room))
    }

    /// Returns the state before the first sample, reusing the existing allocations.
    fn at_start(
        plan: PhaseWalkPlan,
        (limit, share): (f64, f64),
        model: ModeModel,
        (sampling, gain_1_s): (Sampling, f64),
        (mut backbone, mut cancellation, mut responses): (BackboneModel, Option<Cancellation>, Vec<ResponsePoint>),
    ) -> PhaseWalk {
        backbone.forget();
        cancellation.iter_mut().for_each(Cancellation::forget);
        responses.clear();
        let SeenMode { angular_frequency_rad_s: omega_rad_s, damping_ratio, modal_mass } = model.mode;
        let damping = 2.0 * damping_ratio * omega_rad_s * modal_mass;
        let other_step = model.tone_rad_s() / sampling.rate_hz;
        PhaseWalk {
            plan,
            limit,
            unit_load: plan.unit_load(),
            share,
            model,
            sampling,
            gain_1_s,
            filter: FourierFilter::new(spec::FILTER_RATE * gain_1_s / sampling.rate_hz, other_step),
            backbone,
            taken: Phasor::new(0.0, 0.0),
            reader: Reader::new(0, 1),
            cancellation,
            read_factor: 1.0,
            stage: Stage::Start,
            target: Target { amplitude: 0.0, omega_rad_s, stiffness: Phasor::new(0.0, damping * omega_rad_s) },
            point: 0,
            tries: 0,
            unsettled: 0,
            last_sample: None,
            phase_rad: 0.0,
            omega_rad_s,
            held: Held::default(),
            responses,
        }
    }

    /// Returns the model of the mode.
    pub fn model(&self) -> &ModeModel {
        &self.model
    }

    /// Returns the gain g of the loop, 1/s.
    pub fn gain_1_s(&self) -> f64 {
        self.gain_1_s
    }

    fn samples_in(&self, seconds: f64) -> u64 {
        libm::ceil(seconds * self.sampling.rate_hz) as u64
    }

    /// Starts towards the point to be tried, from sample `n`, or towards rest after the last point.
    fn set_off(&mut self, n: u64) {
        if self.point == self.plan.points() {
            return self.head_for(n, Target { amplitude: 0.0, ..self.target });
        }
        let near = (self.target.amplitude, self.target.omega_rad_s);
        let wanted = self.plan.wanted(self.point);
        let (amplitude, omega_rad_s) = match wanted {
            Wanted::Lag(lag_rad, load) => match self.backbone.target(lag_rad, load, near) {
                Some(target) => target,
                None => {
                    self.stage = Stage::Done(Some(Abort::NotPredicted { lag_deg: lag_rad.to_degrees() }));
                    return;
                }
            },
            Wanted::Amplitude(amplitude, omega_rad_s) => (amplitude, omega_rad_s),
        };
        let stiffness = match wanted {
            Wanted::Lag(lag_rad, load) => unit(lag_rad) * (load / amplitude),
            Wanted::Amplitude(..) => self.backbone.dynamic_stiffness(amplitude, omega_rad_s),
        };
        let in_band = (omega_rad_s / self.model.mode.angular_frequency_rad_s - 1.0).abs() < BAND;
        if !(in_band && amplitude < LARGEST_AMPLITUDE) {
            let lag_deg = libm::atan2(stiffness.im, stiffness.re).to_degrees();
            let frequency_hz = omega_rad_s / TAU;
            self.stage = Stage::Done(Some(Abort::OutOfBand { lag_deg, frequency_hz, amplitude_m: amplitude }));
            return;
        }
        self.head_for(n, Target { amplitude, omega_rad_s, stiffness });
    }

    /// Starts a ramp to another periodic response. A change of amplitude takes the load 2ωm Ȧ, and the steepest
    /// slope of the smooth step is 3/2 of the mean. Half of the exciter's reserve above the walk's load is used
    /// for it.
    fn head_for(&mut self, n: u64, to: Target) {
        let from = mem::replace(&mut self.target, to);
        if let Some(cancellation) = self.cancellation.as_mut().filter(|_| from.amplitude > 0.0) {
            cancellation.follow(Phasor::new(to.amplitude / from.amplitude, 0.0));
        }
        let change = (to.amplitude - from.amplitude).abs();
        let spare = 0.5 * (self.limit - self.plan.load());
        let seconds = (3.0 * to.omega_rad_s * self.model.mode.modal_mass * change / spare).max(RAMP / self.gain_1_s);
        self.stage = Stage::Ramp { from, since: n, length: self.samples_in(seconds) };
    }

    /// Returns how long transients take to die out after a step: they are as large as the step and decay as
    /// e^{−gt}.
    fn settling_samples(&self, from: &Target) -> u64 {
        let step = (self.target.amplitude - from.amplitude).abs() / self.target.amplitude;
        // e^{−gt} · step falls to the allowed rest after ln(step/rest) time constants.
        // A step below the allowed rest has a negative logarithm, and waits for the least time all the same.
        let time_constants = libm::log(step / SETTLED_STEP).clamp(LEAST_SETTLE, MOST_SETTLE);
        self.samples_in(time_constants / self.gain_1_s)
    }

    /// Returns amplitude, its rate, angular frequency and U/a wanted at sample `n`.
    fn wanted(&self, n: u64) -> (f64, f64, f64, Phasor) {
        let Target { amplitude: a1, omega_rad_s: w1, stiffness: d1 } = self.target;
        let Stage::Ramp { from, since, length } = self.stage else { return (a1, 0.0, w1, d1) };
        let (s, slope) = ramped((n - since) as f64 / length as f64);
        let slope = slope * self.sampling.rate_hz / length as f64;
        let between = |a: f64, b: f64| a + (b - a) * s;
        // Amplitude, frequency and feed-forward load all follow the same smooth step, so that they fit each
        // other on the way.
        let stiffness = from.stiffness + (d1 - from.stiffness) * s;
        let change = a1 - from.amplitude;
        (between(from.amplitude, a1), change * slope, between(from.omega_rad_s, w1), stiffness)
    }

    /// Moves to the next stage when it is time.
    fn proceed(&mut self, n: u64) {
        match self.stage {
            Stage::Start => self.set_off(n),
            Stage::Ramp { from, since, length } if n >= since + length => {
                let more = self.point < self.plan.points();
                let until = n + self.settling_samples(&from);
                self.stage = if more { Stage::Settle { until } } else { Stage::Done(None) };
            }
            Stage::Settle { until } if n >= until => {
                let period_s = TAU / self.target.omega_rad_s;
                let patience = self.read_factor * (1.0 + RETRY * f64::from(self.tries));
                let periods = libm::ceil(patience * READ / self.gain_1_s / period_s);
                let samples = self.samples_in(periods * period_s);
                // From the next sample on: `answer` adds a sample to the reading before it changes the stage.
                self.reader = Reader::new(n + 1, samples);
                self.cancellation.iter_mut().for_each(|cancellation| cancellation.begin(n + 1, samples));
                self.stage = Stage::Read;
            }
            Stage::Read => {
                let how = (self.load_kind(), &self.unit_load, self.share);
                let omega = self.target.omega_rad_s;
                if let Some(found) = self.reader.finish(n, &self.sampling, how, &self.model, omega) {
                    self.judge(n, &found);
                }
            }
            _ => {}
        }
    }

    /// Judges a point that was read: reports it, or tries again.
    fn judge(&mut self, n: u64, found: &Found) {
        self.tries += 1;
        self.taken = found.taken;
        let wanted = self.plan.wanted(self.point);
        let load = match wanted {
            Wanted::Lag(_, load) => load,
            Wanted::Amplitude(..) => found.load,
        };
        // Noise and the doubtful part of the drift are independent, so their squares add.
        let deviation = libm::hypot(found.load_deviation, DRIFT_DOUBT * found.taken_by_drift) / load;
        // Every reading improves the model, also that of a try that fails: so the next try is closer.
        self.backbone.add(found.amplitude, self.target.omega_rad_s, found.stiffness, deviation);
        let lag_rad = libm::atan2(found.stiffness.im, found.stiffness.re);
        let tolerance = LOAD_TOLERANCE * load;
        // Noise in the reading decreases with the power 3/2 of its length.
        let noise = found.load_deviation / (1.5 * tolerance);
        let longer = self.read_factor * libm::pow(noise, 2.0 / 3.0);
        self.read_factor = longer.clamp(1.0, LONGEST_READ);
        let met = match wanted {
            Wanted::Lag(wanted_rad, _) => {
                // With noise a tighter tolerance could never be met. Two standard deviations are allowed, up to
                // a bound.
                (found.load - load).abs() < tolerance.max((2.0 * found.load_deviation).min(NOISY_LOAD_TOLERANCE * load))
                    && (lag_rad - wanted_rad).abs() < LAG_TOLERANCE_RAD
            }
            Wanted::Amplitude(wanted_rad, _) => (found.amplitude / wanted_rad - 1.0).abs() < AMPLITUDE_TOLERANCE,
        };
        let off = (found.amplitude / self.target.amplitude - 1.0).abs();
        let frequency_hz = self.target.omega_rad_s / TAU;
        let correct = |cancellation: &mut Cancellation| cancellation.correct(frequency_hz, found.load, off);
        let is_cancelled = self.cancellation.as_mut().is_none_or(correct);
        let is_steady = found.drift < DRIFT_TOLERANCE && found.taken_by_drift < DRIFT_LOAD_TOLERANCE * load;
        let settled = met && is_steady && is_cancelled;
        if settled || self.tries == MOST_TRIES {
            self.report(found, lag_rad, settled);
        }
        if !matches!(self.stage, Stage::Done(_)) {
            self.set_off(n);
        }
    }

    fn report(&mut self, found: &Found, lag_rad: f64, settled: bool) {
        let frequency_hz = self.target.omega_rad_s / TAU;
        // A caller that does not fetch loses points. The walk goes on all the same, since it can't wait in real
        // time.
        if self.responses.len() < RESPONSES {
            let point = found.response(frequency_hz, lag_rad, self.tries, settled);
            self.responses.push(ResponsePoint { load_kind: self.load_kind(), ..point });
        }
        self.point += 1;
        self.tries = 0;
        self.unsettled = if settled { 0 } else { self.unsettled + 1 };
        if self.unsettled > MOST_UNSETTLED {
            let points = self.unsettled;
            let lag_deg = lag_rad.to_degrees();
            let drift = found.drift;
            self.stage = Stage::Done(Some(Abort::NotSettling { points, frequency_hz, lag_deg, drift }));
        }
    }

    /// Returns the displacement's complex amplitude: that of the acceleration over −ω², in a steady vibration.
    fn displacement(&self) -> Phasor {
        let gain = self.sampling.gain(self.omega_rad_s / TAU);
        -self.filter.fundamental() / (self.omega_rad_s * self.omega_rad_s * gain)
    }

    /// Returns the load to hold from sample `n` on, at the phase of the middle of the hold.
    fn feedback(&mut self, n: u64) -> f64 {
        let (amplitude, rate, omega, stiffness) = self.wanted(n);
        // The mean of the two frequencies integrates a linear ramp of the frequency exactly.
        self.phase_rad = wrapped(self.phase_rad + 0.5 * (self.omega_rad_s + omega) / self.sampling.rate_hz);
        self.omega_rad_s = omega;
        // The phase reference is the wanted displacement, which is therefore real.
        let envelope = (Phasor::new(amplitude, 0.0) - self.displacement()) * self.gain_1_s + rate;
        let forward = (stiffness + self.taken) * amplitude;
        let u = Phasor::new(0.0, 2.0 * omega * self.model.mode.modal_mass) * envelope + forward;
        // A load that is held for a sample acts less by the factor sin y/y, y = ½ωT. With a shaker, whose
        // command is many times the arm's load, the difference matters.
        let hold = self.sampling.hold(omega / TAU);
        real_product(&(u / hold), &unit(self.phase_rad)) + self.harmonics(n)
    }

    /// Returns the harmonics of the command from sample `n` on, N.
    fn harmonics(&self, n: u64) -> f64 {
        let share = match self.stage {
            Stage::Ramp { since, length, .. } => ramped((n - since) as f64 / length as f64).0,
            _ => 1.0,
        };
        self.cancellation.as_ref().map_or(0.0, |cancellation| cancellation.command_n(self.phase_rad, share))
    }

    /// Returns the reason to abort at a sample, if there is one.
    fn check_reading(&self, sample: &Measurement) -> Option<Abort> {
        let frequency_hz = self.omega_rad_s / TAU;
        let [_, takes_c] = self.model.followed.takes();
        let (point, point_key) = if takes_c { ('C', 'c') } else { ('B', 'b') };
        self.model.is_clipped(sample).then_some(Abort::Clipped { point, point_key, frequency_hz })
    }

    fn check_load(&self) -> Option<Abort> {
        let unit = self.plan.amplitude().unit();
        let got = self.held.last().abs();
        let limit = self.limit;
        let frequency_hz = self.omega_rad_s / TAU;
        (got > limit).then_some(Abort::Load { got, limit, unit, frequency_hz })
    }
}

/// Progress of a ramp and its slope at the share `x` of its length: a smooth step from 0 to 1.
fn ramped(x: f64) -> (f64, f64) {
    let x = x.min(1.0);
    (x * x * (3.0 - 2.0 * x), 6.0 * x * (1.0 - x))
}

impl Controller for PhaseWalk {
    fn load_kind(&self) -> LoadKind {
        if self.plan.amplitude().has_torque() { LoadKind::Torque } else { LoadKind::Force }
    }

    /// The accelerometer of the followed displacement is needed and, for forces, the head for the acting force.
    fn needs(&self) -> Vec<NeededReading> {
        let head = self.load_kind() == LoadKind::Force;
        let [b, c] = self.model.followed.takes();
        NeededReading::marked([head, head, b, b, c, c])
    }

    fn restart(&mut self) {
        let room = (mem::take(&mut self.backbone), self.cancellation.take(), mem::take(&mut self.responses));
        *self =
            PhaseWalk::at_start(self.plan, (self.limit, self.share), self.model, (self.sampling, self.gain_1_s), room);
    }

    fn answer(&mut self, sample: &Measurement) -> Answer {
        let n = sample.sample;
        // While samples were lost, the plant held the load of the last one and the phase went on.
        let lost = self.last_sample.map_or(0, |last| (n - last).saturating_sub(1));
        let step_rad = self.omega_rad_s / self.sampling.rate_hz;
        self.phase_rad = wrapped(self.phase_rad + lost as f64 * step_rad);
        self.held.hold_on(lost);
        self.last_sample = Some(n);
        let holds_late = self.sampling.converter.holds_late();
        let read_rad = self.phase_rad - holds_late as f64 * step_rad;
        self.filter.update(self.model.acceleration(sample), read_rad);
        if matches!(self.stage, Stage::Read) {
            let other_rad = n as f64 * (self.model.tone_rad_s() / self.sampling.rate_hz);
            self.reader.add(sample, &self.model, read_rad, other_rad, self.held.before(holds_late));
            self.cancellation.iter_mut().for_each(|cancellation| cancellation.add(sample, read_rad / TAU));
        }
        self.proceed(n);
        let load = self.feedback(n);
        self.held.hold(load);
        // The reading comes first. A clipped reading is usually why the load grows.
        let abort = self.check_reading(sample).or_else(|| self.check_load());
        if let (Some(_), false) = (abort, matches!(self.stage, Stage::Done(_))) {
            self.stage = Stage::Done(abort);
        }
        match self.stage {
            Stage::Done(None) => Answer::Finished,
            Stage::Done(Some(abort)) => Answer::Aborted(abort),
            _ => Answer::Hold(self.unit_load.scaled(self.held.last())),
        }
    }

    fn poll_response(&mut self) -> Option<ResponsePoint> {
        // At most four responses wait, so that moving them up costs less than a ring.
        if self.responses.is_empty() { None } else { Some(self.responses.remove(0)) }
    }

    fn length(&self) -> Length {
        Length::Responses(self.plan.points() as u64)
    }
}

#[cfg(test)]
mod structure_tests;
#[cfg(test)]
mod tests;
