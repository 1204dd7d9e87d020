//! Reading of one point of a walk: harmonics of load and readings over a window of whole periods.

use core::f64::consts::TAU;

use crate::control::LoadKind;
use crate::control::mode_model::ModeModel;
use crate::control::response::ResponsePoint;
use crate::excitation::{HarmonicFit, Phasor};
use crate::rig::{Load, Measurement, Sampling};

use super::drift_fit::DriftFit;
use crate::control::fourier_filter::{size, unit};

/// Number of channels: the readings, and the command.
const CHANNELS: usize = Measurement::CHANNELS + 1;
/// Number of basis functions of the fit: constant, and sine and cosine of five orders. Clipped readings are
/// left out: with five harmonics fitted to the others, amplitudes are right to parts in a thousand where a
/// third of the readings is clipped.
///
/// Constant, and sine and cosine of five orders: a clipped wave needs more of them than an unclipped one, or the rest
/// is shifted.
const BASIS: usize = 11;

/// Reads a point while its periodic response is held.
#[derive(Clone, Debug)]
pub(super) struct Reader {
    first: u64,
    samples: u64,
    fit: HarmonicFit<CHANNELS, BASIS>,
    clipped: [bool; Measurement::CHANNELS],
    drift: DriftFit,
}

/// Result of a reading.
#[derive(Clone, Debug)]
pub(super) struct Found {
    /// Amplitude of the followed displacement, m.
    pub amplitude: f64,
    /// U/a of the steady response, without the contribution of a remaining drift of a.
    pub stiffness: Phasor,
    /// Part of the command that a shaker's armature takes, over a; noise with an ideal exciter.
    pub taken: Phasor,
    /// Amplitude of the acting load, N or N·m, also without the contribution of the drift.
    pub load: f64,
    /// Load that the drift takes, N or N·m.
    pub taken_by_drift: f64,
    /// Standard deviation of the load's amplitude at the amplitude found, N or N·m.
    pub load_deviation: f64,
    /// Relative change of a over the window.
    pub drift: f64,
    harmonics: [[Phasor; 3]; CHANNELS],
    clipped: [bool; Measurement::CHANNELS],
}

impl Reader {
    pub fn new(first: u64, samples: u64) -> Reader {
        Reader {
            first,
            samples,
            fit: HarmonicFit::new(samples),
            clipped: [false; Measurement::CHANNELS],
            drift: DriftFit::new(samples),
        }
    }

    /// Adds a sample with the phase at which it was read, the phase of the other tone, and the load held at
    /// that time.
    pub fn add(&mut self, sample: &Measurement, model: &ModeModel, phase_rad: f64, other_rad: f64, held: f64) {
        let readings = sample.readings();
        let mut values = [Some(held); CHANNELS];
        for ((value, clipped), reading) in values.iter_mut().zip(&mut self.clipped).zip(&readings) {
            // A clipped value is left out of the fit, and the channel marked.
            *value = reading.within_range();
            *clipped |= reading.clipped;
        }
        let phase_cycles = phase_rad / TAU;
        let k = sample.sample - self.first;
        self.fit.add(k, phase_cycles - libm::floor(phase_cycles), &values);
        self.drift.add(k, phase_rad, other_rad, model.acceleration(sample));
    }

    /// Returns the result at the angular frequency `omega`, rad/s, once the window has ended at sample `now`.
    ///
    /// Readings are divided by the gain of the converters. A load that is held for a period T is a staircase, whose
    /// fundamental is smaller than that of its samples by sin y/y, y = ½ωT. Of its images, which the converters fold
    /// onto the fundamental, the head between shaker and arm reads the share that goes into the arm.
    pub fn finish(
        &self,
        now: u64,
        sampling: &Sampling,
        (kind, unit_load, share): (LoadKind, &Load, f64),
        model: &ModeModel,
        omega: f64,
    ) -> Option<Found> {
        if now + 1 < self.first + self.samples {
            return None;
        }
        let frequency_hz = omega / TAU;
        let mut harmonics = self.fit.harmonics()?;
        for channel in harmonics.iter_mut().take(Measurement::CHANNELS) {
            for (harmonic, order) in channel.iter_mut().zip([1.0, 2.0, 3.0]) {
                *harmonic /= sampling.gain(order * frequency_hz);
            }
        }
        let held = harmonics[CHANNELS - 1][0];
        let fundamental = |channel: usize| harmonics[channel][0];
        let acting = match kind {
            LoadKind::Torque => held * sampling.hold(frequency_hz),
            LoadKind::Force => {
                let head = fundamental(0) * unit_load.force_n.x + fundamental(1) * unit_load.force_n.y;
                // The head reads the images of the held command as well, and they are no force on the arm.
                head - held * (share * sampling.images(frequency_hz))
            }
        };
        let displacement =
            model.across([[fundamental(2), fundamental(3)], [fundamental(4), fundamental(5)]]) / -(omega * omega);
        // Without a drift the reading can't tell a steady response from one that still grows, so there is no
        // result.
        let drift = self.drift.finish()?;
        let windows_1_s = sampling.rate_hz / self.samples as f64;
        // A drift ȧ takes the load 2iωm ȧ, by the envelope's equation in the module documentation of the walk.
        // Without it the result is the steady one.
        let taken_by_drift = Phasor::new(0.0, 2.0 * omega * model.mode.modal_mass * windows_1_s) * drift.change;
        let stiffness = acting / displacement - taken_by_drift;
        let steady = stiffness * displacement;
        Some(Found {
            amplitude: size(displacement),
            stiffness,
            taken: (held * sampling.hold(frequency_hz) - acting) / displacement,
            load: size(steady),
            load_deviation: 2.0 * model.mode.modal_mass / omega * windows_1_s * drift.deviation
                / sampling.gain(frequency_hz),
            taken_by_drift: size(taken_by_drift * displacement),
            drift: size(drift.change),
            // Phases are reported against the acting load, which a caller knows, and not against the
            // controller's displacement.
            harmonics: harmonics.map(|orders| turned(orders, -libm::atan2(steady.im, steady.re))),
            clipped: self.clipped,
        })
    }
}

impl Found {
    /// Returns the point as it is reported, with phases relative to the acting load.
    pub fn response(&self, frequency_hz: f64, lag_rad: f64, tries: u32, settled: bool) -> ResponsePoint {
        let readings = core::array::from_fn(|channel| self.harmonics[channel]);
        let point = ResponsePoint::of_harmonics(frequency_hz, self.load, &readings);
        let load_deviation = Some(self.load_deviation);
        let of_loop = ResponsePoint { lag_rad: Some(lag_rad), load_deviation, drift: self.drift, ..point };
        ResponsePoint { clipped: self.clipped, tries, settled, ..of_loop }
    }
}

/// Turns the harmonics by `angle_rad` of the fundamental, that is, by its multiples.
fn turned(orders: [Phasor; 3], angle_rad: f64) -> [Phasor; 3] {
    core::array::from_fn(|index| orders[index] * unit(angle_rad * (index + 1) as f64))
}
