//! An excitation ready to be played, sample by sample.

use alloc::vec::Vec;
use core::f64::consts::{PI, TAU};

use super::{ExcitationError, ExcitationSpec, Waveform};
use crate::arm::Load;

/// An excitation ready to be played: a pure function of the sample's index.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    spec: ExcitationSpec,
    rate_hz: f64,
    /// For sines; empty for an impulse.
    pieces: Vec<Piece>,
    duration_s: f64,
}

/// A stretch of sine whose frequency runs evenly from `from_hz` to `to_hz`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece {
    start_s: f64,
    duration_s: f64,
    start_cycles: f64,
    from_hz: f64,
    to_hz: f64,
}

impl Piece {
    /// φ/2π at t, cycles: φ₀ + f₀ τ + ½ (f₁ − f₀) τ²/T.
    fn cycles(&self, t_s: f64) -> f64 {
        let elapsed_s = t_s - self.start_s;
        let slope = (self.to_hz - self.from_hz) / self.duration_s;
        self.start_cycles + (self.from_hz + 0.5 * slope * elapsed_s) * elapsed_s
    }
}

/// When the response to one frequency is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// The frequency, Hz.
    pub frequency_hz: f64,
    /// First sample that counts.
    pub first: u64,
    /// First sample after it.
    pub end: u64,
}

impl Profile {
    /// Checks the specification and prepares it for `rate_hz` samples a second.
    ///
    /// # Errors
    /// [`ExcitationError`] says what can't be played.
    pub fn new(spec: &ExcitationSpec, rate_hz: f64) -> Result<Profile, ExcitationError> {
        spec.check(rate_hz)?;
        let piece = |from_hz, to_hz, duration_s| Piece { start_s: 0.0, duration_s, start_cycles: 0.0, from_hz, to_hz };
        let pieces = match spec.profile {
            Waveform::Dwell { frequency_hz, duration_s, .. } => {
                alloc::vec![piece(frequency_hz, frequency_hz, duration_s)]
            }
            Waveform::SweptSine { from_hz, to_hz, duration_s } => alloc::vec![piece(from_hz, to_hz, duration_s)],
            Waveform::SteppedSine { from_hz, to_hz, steps, dwell_s, .. } => staircase(from_hz, to_hz, steps, dwell_s),
            Waveform::Impulse { .. } => Vec::new(),
        };
        let duration_s = match spec.profile {
            Waveform::Impulse { duration_s, .. } => duration_s,
            _ => pieces.last().map_or(0.0, |last| last.start_s + last.duration_s),
        };
        let profile = Profile { spec: *spec, rate_hz, pieces, duration_s };
        profile.check_windows()?;
        Ok(profile)
    }

    /// What it was made of.
    pub fn spec(&self) -> &ExcitationSpec {
        &self.spec
    }

    /// Length, s.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Length in samples: the load is zero from this sample on.
    pub fn samples(&self) -> u64 {
        libm::ceil(self.duration_s * self.rate_hz) as u64
    }

    /// The load to hold from sample `n` to the next.
    pub fn load(&self, n: u64) -> Load {
        if n >= self.samples() {
            return Load::default();
        }
        let t_s = n as f64 / self.rate_hz;
        let value = match self.spec.profile {
            Waveform::Impulse { pulse_s, .. } if t_s < pulse_s => libm::sin(PI * (t_s / pulse_s)),
            Waveform::Impulse { .. } => 0.0,
            _ => self.envelope(t_s) * libm::sin(TAU * fraction(self.cycles(t_s))),
        };
        self.spec.amplitude.load().scaled(value)
    }

    /// φ/2π of the sine at sample `n`, in cycles, less whole cycles; 0 for an impulse.
    pub fn phase_cycles(&self, n: u64) -> f64 {
        fraction(self.cycles(n as f64 / self.rate_hz))
    }

    fn cycles(&self, t_s: f64) -> f64 {
        let after = self.pieces.partition_point(|piece| piece.start_s <= t_s);
        self.pieces.get(after.saturating_sub(1)).map_or(0.0, |piece| piece.cycles(t_s))
    }

    /// Raised cosine at both ends: ½ (1 − cos π t/r).
    fn envelope(&self, t_s: f64) -> f64 {
        let to_end_s = t_s.min(self.duration_s - t_s);
        if to_end_s >= self.spec.ramp_s { 1.0 } else { 0.5 * (1.0 - libm::cos(PI * (to_end_s / self.spec.ramp_s))) }
    }

    /// The windows in which responses are read, in order; none for swept sines and impulses.
    pub fn windows(&self) -> impl Iterator<Item = Window> + '_ {
        let settle_s = match self.spec.profile {
            Waveform::Dwell { settle_s, .. } | Waveform::SteppedSine { settle_s, .. } => Some(settle_s),
            Waveform::SweptSine { .. } | Waveform::Impulse { .. } => None,
        };
        settle_s.into_iter().flat_map(move |settle_s| self.pieces.iter().map(move |piece| self.window(piece, settle_s)))
    }

    fn window(&self, piece: &Piece, settle_s: f64) -> Window {
        let start_s = (piece.start_s + settle_s).max(self.spec.ramp_s);
        let end_s = (piece.start_s + piece.duration_s).min(self.duration_s - self.spec.ramp_s);
        let sample = |t_s: f64| libm::ceil(t_s.max(0.0) * self.rate_hz) as u64;
        Window { frequency_hz: piece.from_hz, first: sample(start_s), end: sample(end_s) }
    }

    /// Every window holds at least one period, and eight samples to fit three numbers to.
    fn check_windows(&self) -> Result<(), ExcitationError> {
        for (piece, window) in self.pieces.iter().zip(self.windows()) {
            let samples = window.end.saturating_sub(window.first) as f64;
            if samples < 8.0_f64.max(self.rate_hz / window.frequency_hz) {
                let (Waveform::Dwell { settle_s, .. } | Waveform::SteppedSine { settle_s, .. }) = self.spec.profile
                else {
                    return Ok(());
                };
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

/// The part after the point; keeps the argument of the sine small, and so its digits.
fn fraction(cycles: f64) -> f64 {
    cycles - libm::floor(cycles)
}

/// Pieces of whole periods, at least `dwell_s` long each.
fn staircase(from_hz: f64, to_hz: f64, steps: u32, dwell_s: f64) -> Vec<Piece> {
    let mut start_s = 0.0;
    let last = f64::from(steps.saturating_sub(1)).max(1.0);
    (0..steps)
        .map(|i| {
            let hz = from_hz + (to_hz - from_hz) * (f64::from(i) / last);
            let duration_s = libm::ceil(dwell_s * hz) / hz;
            let piece = Piece { start_s, duration_s, start_cycles: 0.0, from_hz: hz, to_hz: hz };
            start_s += duration_s;
            piece
        })
        .collect()
}
