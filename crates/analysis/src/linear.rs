//! Frequency responses of a structure's linear part at rest.
//!
//! For q = Re(Q e^{iωt}) the linear equation M q̈ + D q̇ + K q = p is Z Q = P with the dynamic stiffness
//! Z = K − ω²M + iωD, for any damping. A unit force at a degree of freedom is P = ∂x/∂q, and the response there
//! ∂x/∂q·Q.

use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::Complex;
use thiserror::Error;

use resonarm_dynamics::structure::{Assembly, Dof, Linear};
use resonarm_numeric::linear_solve::solve_complex;
use resonarm_numeric::number::short;

use super::forced::load_at_rest;
use crate::quantity::Quantity;

/// Error of a frequency response that does not exist.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum FrfError {
    /// The frequency is not zero or a positive number.
    #[error("frequency {got_hz} Hz: it must be zero or a positive number", got_hz = short(.got_hz))]
    Frequency {
        /// The given value, Hz.
        got_hz: f64,
    },
    /// The response is infinite: a structure without damping at a natural frequency.
    #[error(
        "the response at {frequency_hz} Hz is infinite, since nothing damps this mode; give the structure damping, or choose another frequency", frequency_hz = short(.frequency_hz))]
    Unbounded {
        /// Frequency at which it is infinite, Hz.
        frequency_hz: f64,
    },
    /// Nothing holds the structure at 0 Hz.
    #[error("the response at 0 Hz is infinite: mode {mode} is rigid, so nothing holds the structure; start above 0 Hz")]
    Rigid {
        /// The mode, from 1.
        mode: usize,
    },
}

/// The linear part of a structure, with the slopes at rest of its smooth elements.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearResponse {
    assembly: Assembly,
    linear: Linear,
}

impl LinearResponse {
    /// Linearises a structure at rest.
    pub fn new(assembly: &Assembly) -> LinearResponse {
        LinearResponse { assembly: assembly.clone(), linear: assembly.linear() }
    }

    /// Returns the complex ratio of the response to the drive: its modulus is the ratio of the amplitudes, its argument
    /// the phase by which the response leads. Units: m or rad, per s⁰, s¹ or s² as `quantity` says, over N, N·m at a
    /// joint, or m/s² of the base; the acceleration is then absolute, the transmissibility.
    ///
    /// # Errors
    /// [`FrfError::Frequency`] if the frequency is negative or no number, [`FrfError::Rigid`] at 0 Hz of a structure that
    /// nothing holds, [`FrfError::Unbounded`] if Z has no inverse.
    pub fn at(
        &self,
        quantity: Quantity,
        drive: Dof,
        response: Dof,
        frequency_hz: f64,
    ) -> Result<Complex<f64>, FrfError> {
        if !(frequency_hz.is_finite() && frequency_hz >= 0.0) {
            return Err(FrfError::Frequency { got_hz: frequency_hz });
        }
        let omega = TAU * frequency_hz;
        let rigid = self.assembly.modes().iter().position(|mode| mode.frequency_hz == 0.0);
        if let Some(mode) = rigid.filter(|_| omega == 0.0) {
            return Err(FrfError::Rigid { mode: mode + 1 });
        }
        let mut coordinates =
            load_at_rest(&self.assembly, drive).iter().map(|&p| Complex::new(p, 0.0)).collect::<Vec<_>>();
        dynamic_stiffness_solve(&self.linear, omega, &mut coordinates).ok_or(FrfError::Unbounded { frequency_hz })?;
        let displacement: Complex<f64> =
            coordinates.iter().zip(self.assembly.direction_at_rest(response)).map(|(q, w)| q * w).sum();
        // The elimination also passes with a pivot of the size of rounding errors, and its result may then overflow.
        if !(displacement.re.is_finite() && displacement.im.is_finite()) {
            return Err(FrfError::Unbounded { frequency_hz });
        }
        // Accelerations are absolute; displacements and velocities count from the base.
        let carried = if quantity == Quantity::Accelerance { self.assembly.carried(response, drive) } else { 0.0 };
        Ok(displacement * quantity.factor(omega) + carried)
    }
}

/// Solves Z Q = P in place, Z = K − ω²M + iωD. `None` if Z has no inverse.
pub(super) fn dynamic_stiffness_solve(of: &Linear, omega: f64, right: &mut [Complex<f64>]) -> Option<()> {
    let entries = of.stiffness.iter().zip(&of.mass).zip(&of.damping);
    let mut z: Vec<Complex<f64>> = entries.map(|((k, m), d)| Complex::new(k - omega * omega * m, omega * d)).collect();
    solve_complex(&mut z, right)
}
