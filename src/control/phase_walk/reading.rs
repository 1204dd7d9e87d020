//! Reading one point of a walk: harmonics of load and readings over a window of whole periods.

use core::f64::consts::TAU;

use crate::arm::Load;
use crate::control::{LoadKind, ModeModel, ResponsePoint};
use crate::excitation::{HarmonicFit, Phasor};
use crate::rig::Measurement;

use super::unit;

/// The readings, and the command.
const CHANNELS: usize = Measurement::CHANNELS + 1;
/// Constant, and sine and cosine of five orders: a clipped wave needs more of them than an unclipped one, or the rest
/// is shifted.
const BASIS: usize = 11;

/// Reads while the motion is held.
#[derive(Clone, Debug)]
pub(super) struct Reader {
    first: u64,
    samples: u64,
    fit: HarmonicFit<CHANNELS, BASIS>,
    clipped: [bool; Measurement::CHANNELS],
    /// Σ a and −Σ ẇ a over the samples, the latter a rate in 1/samples.
    angle: Phasor,
    rate: Phasor,
    /// Σ e² of the filter, as of the second half.
    error: f64,
}

/// What was found.
#[derive(Clone, Debug)]
pub(super) struct Found {
    /// Amplitude of the followed angle, rad.
    pub amplitude_rad: f64,
    /// U/a without what a remaining drift of a takes.
    pub stiffness: Phasor,
    /// U/a as it was.
    pub lag: Phasor,
    /// What a shaker takes of the command, over a; with an ideal exciter noise.
    pub taken: Phasor,
    /// Amplitude of the acting load.
    pub load: f64,
    /// Standard deviation of the load's amplitude that goes with `amplitude_rad`.
    pub load_deviation: f64,
    /// Change of a over the window, relative.
    pub drift: f64,
    harmonics: [[Phasor; 3]; CHANNELS],
    clipped: [bool; Measurement::CHANNELS],
}

impl Reader {
    pub fn new(first: u64, samples: u64) -> Reader {
        let zero = Phasor::new(0.0, 0.0);
        Reader {
            first,
            samples,
            fit: HarmonicFit::new(samples),
            clipped: [false; Measurement::CHANNELS],
            angle: zero,
            rate: zero,
            error: 0.0,
        }
    }

    /// Takes in a sample with the phase at which it was read, the load that was held then, and the angle's amplitude.
    pub fn add(&mut self, sample: &Measurement, phase_cycles: f64, held: f64, angle: Phasor, error: f64) {
        let readings = sample.readings();
        let mut values = [Some(held); CHANNELS];
        for ((value, clipped), reading) in values.iter_mut().zip(&mut self.clipped).zip(&readings) {
            *value = reading.within_range();
            *clipped |= reading.clipped;
        }
        let phase_cycles = phase_cycles - libm::floor(phase_cycles);
        let k = sample.sample - self.first;
        self.fit.add(k, phase_cycles, &values);
        // w = 1 − cos 2πx over the window.
        let x = (k as f64 + 0.5) / self.samples as f64;
        // By then transients of the filter have died out.
        if 2 * k >= self.samples {
            self.error += 2.0 * error * error;
        }
        self.angle += angle;
        self.rate -= angle * (TAU / self.samples as f64 * libm::sin(TAU * x));
    }

    /// What was found at the angular frequency `omega`, rad/s, once the window is over at sample `now`.
    ///
    /// What is held for a period T is a staircase, whose fundamental is smaller than that of its samples by
    /// sinc ωT/2. Of the rest, edges that come and go within a sample, the head between shaker and arm reads the share
    /// that goes into the arm.
    pub fn finish(
        &self,
        now: u64,
        rate_hz: f64,
        (kind, unit_load, share): (LoadKind, &Load, f64),
        model: &ModeModel,
        omega: f64,
    ) -> Option<Found> {
        if now + 1 < self.first + self.samples {
            return None;
        }
        let harmonics = self.fit.harmonics()?;
        let half = 0.5 * omega / rate_hz;
        let held = harmonics[CHANNELS - 1][0];
        let fundamental = |channel: usize| harmonics[channel][0];
        let acting = match kind {
            LoadKind::Torque => held,
            LoadKind::Force => fundamental(0) * unit_load.force_n.x + fundamental(1) * unit_load.force_n.y,
        };
        let load = acting + held * (share * (libm::sin(half) / half - 1.0));
        let angle =
            model.across([[fundamental(2), fundamental(3)], [fundamental(4), fundamental(5)]]) / -(omega * omega);
        let lag = load / angle;
        let rate = self.rate / self.angle;
        Some(Found {
            amplitude_rad: size(angle),
            stiffness: lag - Phasor::new(0.0, 2.0 * omega * model.modal_mass * rate_hz) * rate,
            lag,
            taken: (held * (libm::sin(half) / half) - load) / angle,
            load: size(load),
            load_deviation: 2.0 * model.modal_mass / omega * self.rate_deviation(rate_hz, model)?,
            drift: size(rate) * self.samples as f64,
            harmonics: harmonics.map(|orders| turned(orders, -libm::atan2(load.im, load.re))),
            clipped: self.clipped,
        })
    }
}

impl Found {
    /// The point as it is reported: against the phase of the acting load.
    pub fn response(&self, frequency_hz: f64, lag_rad: f64, tries: u32, settled: bool) -> ResponsePoint {
        let readings = core::array::from_fn(|channel| self.harmonics[channel]);
        let point = ResponsePoint::of_harmonics(frequency_hz, self.load, &readings);
        let load_deviation = Some(self.load_deviation);
        let of_loop = ResponsePoint { lag_rad: Some(lag_rad), load_deviation, drift: self.drift, ..point };
        ResponsePoint { clipped: self.clipped, tries, settled, ..of_loop }
    }
}

impl Reader {
    /// Standard deviation of the mean rate of the angular acceleration's amplitude, rad/s³: white noise of standard
    /// deviation σ in n samples, weighted by ẇ, leaves 2πσ f_s/n^(3/2). Of the two that bound σ, what the fit leaves
    /// and what the filter does, the first has the other mode's ringing in it, the second high harmonics.
    fn rate_deviation(&self, rate_hz: f64, model: &ModeModel) -> Option<f64> {
        let n = self.samples as f64;
        let left = [2, 3, 4, 5].map(|channel| self.fit.residual_rms(channel));
        let [bx, by, cx, cy] = left;
        let sigma = model.deviation([[bx?, by?], [cx?, cy?]]).min(libm::sqrt(self.error / n));
        Some(TAU * sigma * rate_hz / (n * libm::sqrt(n)))
    }
}

/// The harmonics against a phase that is further by −`angle_rad`.
fn turned(orders: [Phasor; 3], angle_rad: f64) -> [Phasor; 3] {
    core::array::from_fn(|index| orders[index] * unit(angle_rad * (index + 1) as f64))
}

fn size(phasor: Phasor) -> f64 {
    libm::hypot(phasor.re, phasor.im)
}
