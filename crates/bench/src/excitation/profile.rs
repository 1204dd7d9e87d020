//! An excitation prepared for playing, sample by sample.

use alloc::sync::Arc;
use alloc::vec::Vec;
use core::f64::consts::{PI, TAU};

use super::error::{ExcitationError, samples};
use super::spec::ExcitationSpec;
use super::synthesis::{self, Band};
use super::waveform::{SweepLaw, Waveform};
use crate::rig::Load;

/// An excitation that is ready to be played, as a pure function of the sample's index.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    spec: ExcitationSpec,
    rate_hz: f64,
    shape: Shape,
    duration_s: f64,
}

/// Shape of an excitation in time, with a peak of 1.
#[derive(Clone, Debug, PartialEq)]
enum Shape {
    /// Pieces of sine, one after the other.
    Sines(Vec<Piece>),
    /// A half sine of this length, s.
    Pulse(f64),
    /// Samples, which are repeated.
    Samples(Arc<[f64]>),
}

/// A piece of sine whose frequency runs from `from_hz` to `to_hz`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece {
    start_s: f64,
    duration_s: f64,
    from_hz: f64,
    to_hz: f64,
    law: SweepLaw,
}

impl Piece {
    /// Returns φ/2π at t, cycles: the integral of the frequency, f₀ τ + ½ (f₁ − f₀) τ²/T; for f = f₀ e^(λτ/T),
    /// λ = ln f₁/f₀, it is f₀ T (e^(λτ/T) − 1)/λ.
    fn cycles(&self, t_s: f64) -> f64 {
        let elapsed_s = t_s - self.start_s;
        if self.law == SweepLaw::Logarithmic && self.from_hz != self.to_hz {
            // expm1 keeps the digits of a narrow sweep, for which the exponent is close to 0.
            let growth = libm::log(self.to_hz / self.from_hz);
            return self.from_hz * self.duration_s * (libm::expm1(growth * (elapsed_s / self.duration_s)) / growth);
        }
        let slope = (self.to_hz - self.from_hz) / self.duration_s;
        (self.from_hz + 0.5 * slope * elapsed_s) * elapsed_s
    }
}

/// Window in which the response to one frequency is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// Frequency of the sine, Hz.
    pub frequency_hz: f64,
    /// First sample of the window.
    pub first: u64,
    /// First sample after the window.
    pub end: u64,
}

impl Profile {
    /// Checks the specification and prepares it for `rate_hz` samples per second.
    ///
    /// # Errors
    /// [`ExcitationError`] says why it can't be played.
    pub fn new(spec: &ExcitationSpec, rate_hz: f64) -> Result<Profile, ExcitationError> {
        spec.check(rate_hz)?;
        let (shape, duration_s) = shape(spec, rate_hz)?;
        let profile = Profile { spec: spec.clone(), rate_hz, shape, duration_s };
        profile.check_windows()?;
        Ok(profile)
    }

    /// Returns the specification that it was made of.
    pub fn spec(&self) -> &ExcitationSpec {
        &self.spec
    }

    /// Returns the sample rate, Hz.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Returns the duration, s.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Returns the length in samples; the load is zero from this sample on.
    pub fn samples(&self) -> u64 {
        match &self.shape {
            // A duration of whole samples would be one too long if rounding took it just above an integer.
            Shape::Samples(_) => libm::round(self.duration_s * self.rate_hz) as u64,
            Shape::Sines(_) | Shape::Pulse(_) => libm::ceil(self.duration_s * self.rate_hz) as u64,
        }
    }

    /// Returns the load to hold from sample `n` to the next.
    pub fn load(&self, n: u64) -> Load {
        if n >= self.samples() {
            return Load::default();
        }
        let t_s = n as f64 / self.rate_hz;
        let value = match &self.shape {
            Shape::Pulse(pulse_s) if t_s < *pulse_s => libm::sin(PI * (t_s / pulse_s)),
            Shape::Pulse(_) => 0.0,
            Shape::Samples(values) => {
                let value = values.get((n % values.len().max(1) as u64) as usize);
                self.envelope(t_s) * value.copied().unwrap_or(0.0)
            }
            Shape::Sines(_) => self.envelope(t_s) * libm::sin(TAU * fraction(self.cycles(t_s))),
        };
        self.spec.amplitude.scaled(value)
    }

    /// Returns the amplitude of the load at `frequency_hz` as it acts, N or N·m: a sine held over each sample
    /// period T is smaller than its samples by sin x/x with x = πfT.
    pub fn held_load(&self, frequency_hz: f64) -> f64 {
        let load = self.spec.amplitude;
        let x = PI * frequency_hz / self.rate_hz;
        libm::hypot(load.force_n.norm(), load.torque_nm.norm()) * libm::sin(x) / x
    }

    /// Returns φ/2π of the sine at `samples` sample periods from the start, in cycles without whole cycles; 0
    /// if the profile is not a sine.
    pub fn phase_cycles(&self, samples: f64) -> f64 {
        fraction(self.cycles(samples / self.rate_hz))
    }

    /// Returns the pieces of sine, if there are any.
    fn pieces(&self) -> &[Piece] {
        match &self.shape {
            Shape::Sines(pieces) => pieces,
            Shape::Pulse(_) | Shape::Samples(_) => &[],
        }
    }

    fn cycles(&self, t_s: f64) -> f64 {
        let pieces = self.pieces();
        // Before the first piece the search gives 0, and the first piece is continued backwards: readings lag
        // the load.
        let after = pieces.partition_point(|piece| piece.start_s <= t_s);
        pieces.get(after.saturating_sub(1)).map_or(0.0, |piece| piece.cycles(t_s))
    }

    /// Envelope with raised cosines at both ends: ½ (1 − cos πt/r).
    fn envelope(&self, t_s: f64) -> f64 {
        // Bursts have ramps of their own.
        if matches!(self.spec.profile, Waveform::BurstRandom { .. }) {
            return 1.0;
        }
        let to_end_s = t_s.min(self.duration_s - t_s);
        if to_end_s >= self.spec.ramp_s { 1.0 } else { 0.5 * (1.0 - libm::cos(PI * (to_end_s / self.spec.ramp_s))) }
    }

    /// Returns the windows in which responses are read, in order: one for a dwell, one for each step of a
    /// stepped sine.
    pub fn windows(&self) -> impl Iterator<Item = Window> + '_ {
        self.spec
            .profile
            .settle_s()
            .into_iter()
            .flat_map(move |settle_s| self.pieces().iter().map(move |piece| self.window(piece, settle_s)))
    }

    fn window(&self, piece: &Piece, settle_s: f64) -> Window {
        // The response inside the ramps of the whole profile is not that of the full load.
        let start_s = (piece.start_s + settle_s).max(self.spec.ramp_s);
        let end_s = (piece.start_s + piece.duration_s).min(self.duration_s - self.spec.ramp_s);
        let sample = |t_s: f64| libm::ceil(t_s.max(0.0) * self.rate_hz) as u64;
        Window { frequency_hz: piece.from_hz, first: sample(start_s), end: sample(end_s) }
    }

    /// Checks that every window holds at least one period, and eight samples for the three unknowns of the fit.
    fn check_windows(&self) -> Result<(), ExcitationError> {
        for (piece, window) in self.pieces().iter().zip(self.windows()) {
            let samples = window.end.saturating_sub(window.first) as f64;
            if samples < 8.0_f64.max(self.rate_hz / window.frequency_hz) {
                let Some(settle_s) = self.spec.profile.settle_s() else { return Ok(()) };
                return Err(ExcitationError::NoWindow {
                    dwell_s: piece.duration_s,
                    settle_s,
                    ramp_s: self.spec.ramp_s,
                });
            }
        }
        Ok(())
    }
}

/// Returns the shape of a checked excitation, and its duration, s.
fn shape(spec: &ExcitationSpec, rate_hz: f64) -> Result<(Shape, f64), ExcitationError> {
    let one = |from_hz, to_hz, duration_s, law| {
        (Shape::Sines(alloc::vec![Piece { start_s: 0.0, duration_s, from_hz, to_hz, law }]), duration_s)
    };
    let played = |values: Vec<f64>, periods: u32| {
        let duration_s = values.len() as f64 * f64::from(periods) / rate_hz;
        (Shape::Samples(synthesis::with_peak_1(values).into()), duration_s)
    };
    Ok(match spec.profile {
        Waveform::Dwell { frequency_hz, duration_s, .. } => {
            one(frequency_hz, frequency_hz, duration_s, SweepLaw::Linear)
        }
        Waveform::SweptSine { from_hz, to_hz, duration_s, law } => one(from_hz, to_hz, duration_s, law),
        Waveform::SteppedSine { from_hz, to_hz, steps, dwell_s, .. } => {
            let last = f64::from(steps.saturating_sub(1)).max(1.0);
            staircase((0..steps).map(|i| from_hz + (to_hz - from_hz) * (f64::from(i) / last)), dwell_s)
        }
        Waveform::SineList { ref frequencies_hz, dwell_s, .. } => staircase(frequencies_hz.iter().copied(), dwell_s),
        Waveform::Impulse { pulse_s, duration_s } => (Shape::Pulse(pulse_s), duration_s),
        Waveform::Random { from_hz, to_hz, duration_s, ref spectrum, seed } => {
            let samples = samples("duration_s", duration_s, rate_hz)?;
            let source = (seed, spectrum.as_ref());
            played(synthesis::noise(Band { from_hz, to_hz }, ("duration_s", samples), rate_hz, source)?, 1)
        }
        Waveform::BurstRandom { from_hz, to_hz, burst_s, period_s, periods, ref spectrum, seed } => {
            let period = synthesis::whole_samples("period_s", period_s, rate_hz)?;
            let samples = samples("period_s", period as f64 * f64::from(periods) / rate_hz, rate_hz)?;
            let samples = samples.min(period * periods as usize);
            let source = (seed, spectrum.as_ref());
            let mut values = synthesis::noise(Band { from_hz, to_hz }, ("period_s", samples), rate_hz, source)?;
            synthesis::gate(&mut values, burst_s * rate_hz, period, spec.ramp_s * rate_hz);
            played(values, 1)
        }
        Waveform::Multisine { from_hz, to_hz, period_s, periods, phases, seed } => {
            let period = synthesis::whole_samples("period_s", period_s, rate_hz)?;
            played(synthesis::multisine(Band { from_hz, to_hz }, period, rate_hz, phases, seed)?, periods)
        }
        Waveform::File { ref load, .. } => {
            played(load.as_ref().ok_or(ExcitationError::FileNotRead)?.samples(rate_hz)?, 1)
        }
    })
}

/// Returns the fractional part, which keeps the argument of the sine small and its digits exact.
fn fraction(cycles: f64) -> f64 {
    cycles - libm::floor(cycles)
}

/// Returns pieces of whole periods, each at least `dwell_s` long, and their total duration, s.
fn staircase(frequencies_hz: impl Iterator<Item = f64>, dwell_s: f64) -> (Shape, f64) {
    let mut start_s = 0.0;
    let pieces = frequencies_hz
        // Whole periods make the phase of the next step begin at 0, so that the load does not jump.
        .map(|hz| {
            let duration_s = libm::ceil(dwell_s * hz) / hz;
            let piece = Piece { start_s, duration_s, from_hz: hz, to_hz: hz, law: SweepLaw::Linear };
            start_s += duration_s;
            piece
        })
        .collect();
    (Shape::Sines(pieces), start_s)
}
