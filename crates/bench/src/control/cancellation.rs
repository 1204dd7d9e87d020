//! Cancellation of harmonics of the force in the impedance head.
//!
//! The armature of a shaker moves with the tip along an arc, so that a sine of the coil produces harmonics in the head.
//! Harmonics c_h of the command, beside its fundamental, produce
//!
//! ```text
//! H_h = d_h + G_h c_h
//! ```
//!
//! where d_h comes from the motion. With the dynamic stiffness Z = k − (hω)²m + ihωc of the armature and the receptance
//! R of the structure where it acts, the coil's force F divides into both, F = H + Z s and s = R H. A command
//! held from sample to sample acts less than its samples by the factor sin y/y, y = ½hωT:
//!
//! ```text
//! G_h = sin y/y · 1/(1 + R Z)        R = wᵀ(K + ihωD − (hω)²M)⁻¹w        w = J₀ᵀe
//! ```
//!
//! d_h grows as the h-th power of the motion and rotates by h times its angle. Where the next try multiplies
//! the fundamental by the complex factor q,
//!
//! ```text
//! c_h ← (c_h − H_h/G_h) q^h
//! ```
//!
//! cancels H_h, as far as G_h is right. The derived G_h includes neither the coil in voltage mode nor the arm's
//! deviation from its model. It is therefore multiplied by a measured ratio: that of the secant ΔH_h/Δc_h to
//! the derived one, from the last change between two tries at one frequency that was large enough.

use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::fourier_filter::{size, unit};
use super::mode_model::Modelled;
use crate::excitation::{HarmonicFit, Phasor};
use crate::rig::{Measurement, Sampling};
use resonarm_dynamics::structure::{Armature, Assembly, StructureMode};

/// Orders that can be cancelled, namely those that are read next to the fundamental.
const ORDERS: [u8; 2] = [2, 3];

/// Share of the fundamental below which a harmonic counts as cancelled. A larger change of the command is
/// enough to determine the transfer.
const CANCELLED: f64 = 2e-3;
/// Largest share that a changed motion may contribute to the change of a harmonic in a secant.
const STRANGE: f64 = 0.2;
/// Largest factor between the measured and the derived transfer.
const LARGEST_RATIO: f64 = 4.0;

/// Orders of the harmonics that are cancelled in the head's force: 2, 3 or both, the fundamental being 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "alloc::vec::Vec<i64>", into = "alloc::vec::Vec<u8>")]
pub struct CancelHarmonics([bool; ORDERS.len()]);

/// Reason why a list of harmonics is rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum CancelHarmonicsError {
    /// The order is not one that is read.
    #[error(
        "`cancel_harmonics`: harmonic {got} can't be cancelled: expected 2 or 3, which are read beside the fundamental"
    )]
    Order {
        /// Order that was given.
        got: i64,
    },
    /// An order is listed twice.
    #[error("`cancel_harmonics`: harmonic {got} is listed twice: list it once")]
    Repeated {
        /// Order that is listed twice.
        got: i64,
    },
}

impl CancelHarmonics {
    /// No harmonics are cancelled.
    pub const NONE: CancelHarmonics = CancelHarmonics([false; ORDERS.len()]);
    /// Harmonics 2 and 3 are cancelled.
    pub const ALL: CancelHarmonics = CancelHarmonics([true; ORDERS.len()]);

    /// Returns whether no harmonic is cancelled.
    pub fn is_none(&self) -> bool {
        *self == CancelHarmonics::NONE
    }
}

// Signed and wide, so that whatever number is written reaches the message about it.
impl TryFrom<alloc::vec::Vec<i64>> for CancelHarmonics {
    type Error = CancelHarmonicsError;

    fn try_from(orders: alloc::vec::Vec<i64>) -> Result<CancelHarmonics, CancelHarmonicsError> {
        let mut found = CancelHarmonics::NONE;
        for got in orders {
            let index = ORDERS.iter().position(|order| i64::from(*order) == got);
            let index = index.ok_or(CancelHarmonicsError::Order { got })?;
            if core::mem::replace(&mut found.0[index], true) {
                return Err(CancelHarmonicsError::Repeated { got });
            }
        }
        Ok(found)
    }
}

impl From<CancelHarmonics> for alloc::vec::Vec<u8> {
    fn from(harmonics: CancelHarmonics) -> alloc::vec::Vec<u8> {
        ORDERS.into_iter().zip(harmonics.0).filter_map(|(order, is_in)| is_in.then_some(order)).collect()
    }
}

/// Transfer from the coil's force to the force in the head, with the armature between them. With an ideal
/// exciter the whole force passes the head.
#[derive(Clone, Debug)]
struct HeadTransfer {
    /// Modes of the structure alone as seen along the shaker: ω₀, rad/s, ζ, and (wᵀφ)², 1/kg. Its receptance is
    /// R = Σ (wᵀφ)²/(ω₀² − ω² + 2iζω₀ω).
    modes: Vec<[f64; 3]>,
    armature: Armature,
}

impl HeadTransfer {
    /// Returns the transfer; `None` with an ideal exciter.
    fn new(of: Modelled<'_>) -> Option<HeadTransfer> {
        let armature = of.armature?;
        Some(HeadTransfer { modes: seen_modes(&of.tested.assembly, &armature), armature })
    }

    /// Returns 1/(1 + R Z); `None` where the structure's response is infinite.
    fn at(&self, frequency_hz: f64) -> Option<Phasor> {
        let one = Phasor::new(1.0, 0.0);
        let omega = TAU * frequency_hz;
        let receptance = self.receptance(omega)?;
        let Armature { mass_kg, stiffness_n_m, damping_n_s_m, .. } = self.armature;
        let stiffness = Phasor::new(stiffness_n_m - omega * omega * mass_kg, omega * damping_n_s_m);
        Some(one / (one + receptance * stiffness))
    }

    /// Returns the receptance R, m/N; `None` where it is infinite.
    fn receptance(&self, omega_rad_s: f64) -> Option<Phasor> {
        let mode = |[own, zeta, square]: &[f64; 3]| {
            let denominator = Phasor::new(own * own - omega_rad_s * omega_rad_s, 2.0 * zeta * own * omega_rad_s);
            Phasor::new(*square, 0.0) / denominator
        };
        let sum = self.modes.iter().map(mode).fold(Phasor::new(0.0, 0.0), |sum, term| sum + term);
        (sum.re.is_finite() && sum.im.is_finite()).then_some(sum)
    }
}

/// Returns ω₀, ζ and (wᵀφ)² of every mode in which the armature moves.
fn seen_modes(of: &Assembly, armature: &Armature) -> Vec<[f64; 3]> {
    let mut w = vec![0.0; of.coordinates()];
    armature.direction(&of.at(&vec![0.0; w.len()]), &mut w);
    let seen = |mode: &StructureMode| {
        let along: f64 = mode.shape.iter().zip(&w).map(|(shape, w)| shape * w).sum();
        [TAU * mode.frequency_hz, mode.damping_ratio, along * along]
    };
    of.modes().iter().map(seen).collect()
}

/// A harmonic of the command, with what is known of its transfer.
#[derive(Clone, Copy, Debug)]
struct Harmonic {
    order: i32,
    /// c_h, and its value before the last change, N.
    command_n: Phasor,
    before_n: Phasor,
    /// c_h and H_h of the last try at this frequency, N, scaled to the fundamental as it was changed since.
    tried_n: Option<[Phasor; 2]>,
    /// Measured G_h over the derived one.
    ratio: Phasor,
}

/// Cancels harmonics of the head's force by harmonics of the command.
#[derive(Clone, Debug)]
pub(super) struct Cancellation {
    harmonics: [Option<Harmonic>; ORDERS.len()],
    transfer: Option<HeadTransfer>,
    /// Share of the coil's force that enters the structure far above its natural frequencies.
    share: f64,
    direction: Vector2<f64>,
    sampling: Sampling,
    /// First sample and length of the reading; the next field holds its two halves.
    first: u64,
    samples: u64,
    halves: [HarmonicFit<2, 7>; 2],
}

impl Cancellation {
    /// Returns a cancellation of `orders` of the force along `direction`; `None` if there are none.
    pub fn new(
        orders: CancelHarmonics,
        of: Modelled<'_>,
        direction: Vector2<f64>,
        sampling: Sampling,
    ) -> Option<Cancellation> {
        if orders.is_none() {
            return None;
        }
        let harmonic = |index: usize| orders.0[index].then(|| Harmonic::new(i32::from(ORDERS[index])));
        Some(Cancellation {
            harmonics: core::array::from_fn(harmonic),
            transfer: HeadTransfer::new(of),
            share: of.high_frequency_force_share(),
            direction,
            sampling,
            first: 0,
            samples: 2,
            halves: [HarmonicFit::new(1), HarmonicFit::new(1)],
        })
    }

    /// Resets to the initial state, keeping the allocations.
    pub fn forget(&mut self) {
        self.harmonics.iter_mut().flatten().for_each(|harmonic| *harmonic = Harmonic::new(harmonic.order));
    }

    /// Returns the harmonics of the command at the phase `phase_rad`, N. `share` is the progress from the last
    /// command to the present one, 0 to 1.
    pub fn command_n(&self, phase_rad: f64, share: f64) -> f64 {
        let at = |harmonic: &Harmonic| {
            let Harmonic { order, command_n, before_n, .. } = *harmonic;
            ((before_n + (command_n - before_n) * share) * unit(f64::from(order) * phase_rad)).im
        };
        self.harmonics.iter().flatten().map(at).sum()
    }

    /// Starts a reading of `samples` samples at sample `first`.
    pub fn begin(&mut self, first: u64, samples: u64) {
        let half = samples / 2;
        self.first = first;
        self.samples = samples;
        // An odd number of samples leaves one more for the second half.
        self.halves = [HarmonicFit::new(half), HarmonicFit::new(samples - half)];
    }

    /// Adds a sample to the reading, with the phase at which it was read, cycles.
    pub fn add(&mut self, sample: &Measurement, phase_cycles: f64) {
        let Some(k) = sample.sample.checked_sub(self.first).filter(|k| *k < self.samples) else { return };
        let values = sample.head_force_n.map(|reading| reading.within_range());
        // Whole cycles are taken off: a phase that has grown over minutes would leave few digits for the angle.
        let half = self.samples / 2;
        let phase_cycles = phase_cycles - libm::floor(phase_cycles);
        match k.checked_sub(half) {
            None => self.halves[0].add(k, phase_cycles, &values),
            Some(k) => self.halves[1].add(k, phase_cycles, &values),
        }
    }

    /// Ends the reading at `frequency_hz`, corrects the command, and returns whether every harmonic is below
    /// its bound in both halves.
    ///
    /// `fundamental_n` is the fundamental of the head's force, and `off` its relative deviation from the one
    /// that the last change was made for. The motion's contribution to a harmonic of order h then deviates by h
    /// times that.
    pub fn correct(&mut self, frequency_hz: f64, fundamental_n: f64, off: f64) -> bool {
        let Some(halves) = self.read(frequency_hz) else { return false };
        let mut is_cancelled = true;
        for (index, harmonic) in self.harmonics.iter_mut().enumerate() {
            let Some(harmonic) = harmonic else { continue };
            let [first, second] = halves.map(|half| half[index]);
            // Both halves must be below the bound. A mean over the whole would also be small for a harmonic
            // that still turns.
            is_cancelled &= size(first).max(size(second)) < CANCELLED * fundamental_n;
            let order = f64::from(harmonic.order);
            let hold = self.sampling.hold(order * frequency_hz);
            // With an ideal exciter nothing stands between command and head, so that G_h is the hold alone.
            let ideal = Some(Phasor::new(1.0, 0.0));
            let transfer = self.transfer.as_ref().map_or(ideal, |transfer| transfer.at(order * frequency_hz));
            if let Some(transfer) = transfer {
                harmonic.correct((first + second) * 0.5, transfer * hold, fundamental_n, order * off);
            }
        }
        is_cancelled
    }

    /// Returns the acting harmonics of both halves, without the images of the command's harmonics that the
    /// converter aliases onto them.
    fn read(&self, frequency_hz: f64) -> Option<[[Phasor; ORDERS.len()]; 2]> {
        let [first, second] = [self.halves[0].harmonics::<3>()?, self.halves[1].harmonics::<3>()?];
        let acting = |[x, y]: [[Phasor; 3]; 2]| {
            core::array::from_fn(|index| {
                let order = ORDERS[index];
                let head = x[usize::from(order) - 1] * self.direction.x + y[usize::from(order) - 1] * self.direction.y;
                let command = self.harmonics[index].map_or(Phasor::new(0.0, 0.0), |harmonic| harmonic.command_n);
                let frequency_hz = f64::from(order) * frequency_hz;
                // The gain undoes the converter's droop. The images are those of the command's own harmonic, so
                // they scale with it.
                head / self.sampling.gain(frequency_hz) - command * (self.share * self.sampling.images(frequency_hz))
            })
        };
        Some([acting(first), acting(second)])
    }

    /// Follows a change of the fundamental by `factor`: the contribution of the motion to a harmonic scales
    /// with its power.
    pub fn follow(&mut self, factor: Phasor) {
        for harmonic in self.harmonics.iter_mut().flatten() {
            // A power by repeated multiplication: exact for the orders 2 and 3, and the same on every platform.
            let power = (1..harmonic.order).fold(factor, |power, _| power * factor);
            harmonic.command_n *= power;
            harmonic.tried_n = harmonic.tried_n.map(|pair| pair.map(|phasor| phasor * power));
        }
    }

    /// Forgets the last try, which tells nothing about another frequency.
    pub fn leave_frequency(&mut self) {
        self.harmonics.iter_mut().flatten().for_each(|harmonic| harmonic.tried_n = None);
    }

    /// Lets the command ramp to zero.
    pub fn end(&mut self) {
        for harmonic in self.harmonics.iter_mut().flatten() {
            harmonic.before_n = harmonic.command_n;
            harmonic.command_n = Phasor::new(0.0, 0.0);
        }
    }
}

impl Harmonic {
    /// Returns a harmonic that is not commanded yet.
    fn new(order: i32) -> Harmonic {
        let zero = Phasor::new(0.0, 0.0);
        Harmonic { order, command_n: zero, before_n: zero, tried_n: None, ratio: Phasor::new(1.0, 0.0) }
    }

    /// Subtracts H_h/G_h from c_h, with `derived_transfer` times the ratio for G_h.
    fn correct(&mut self, head_n: Phasor, derived_transfer: Phasor, fundamental_n: f64, off: f64) {
        if let Some([command_n, head_before_n]) = self.tried_n {
            let change = self.command_n - command_n;
            let effect = head_n - head_before_n;
            let expected = self.ratio * derived_transfer * change;
            let of_motion = head_n - self.ratio * derived_transfer * self.command_n;
            // Two conditions: the change of the command must stand out from the noise, and a change of the
            // motion between the tries must not explain the effect. Otherwise the secant would learn the wrong
            // transfer.
            let is_conclusive =
                size(expected) > CANCELLED * fundamental_n && off * size(of_motion) < STRANGE * size(expected);
            let ratio = effect / change / derived_transfer;
            // A ratio far from 1 is more likely an error than a property of the exciter, so it is not accepted.
            if is_conclusive && (1.0 / LARGEST_RATIO..LARGEST_RATIO).contains(&size(ratio)) {
                self.ratio = ratio;
            }
        }
        self.tried_n = Some([self.command_n, head_n]);
        self.before_n = self.command_n;
        self.command_n -= head_n / (self.ratio * derived_transfer);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A written value reads back the same.
    #[test]
    fn harmonics_are_a_list_of_orders() {
        let written = "law = \"phase-walk\"\npoints = 25\nfrom_lag_deg = 10.0\n\
            to_lag_deg = 170.0\ncancel_harmonics = [3, 2]\n[amplitude]\nexciter_x = 1.0\n";
        let spec: crate::control::ControlSpec = toml::from_str(written).unwrap();
        let crate::control::ControlSpec::PhaseWalk(walk) = &spec else { panic!("{spec:?}") };
        assert_eq!(walk.cancel_harmonics, CancelHarmonics::ALL);
        let again = toml::to_string(&spec).unwrap();
        assert!(again.contains("cancel_harmonics = [2, 3]"), "{again}");
    }
}
