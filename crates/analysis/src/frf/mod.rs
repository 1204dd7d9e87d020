//! Frequency response functions of the arm linearised in its pose, dampers included.
//!
//! For α = Re(A e^{iωt}) the linear equation M0 α̈ + D α̇ + K α = u + J0ᵀF is Z A = U with the dynamic stiffness
//! Z = K − ω²M0 + iωD, so that A = H U with the receptance H = Z⁻¹. Quantities as ISO 7626-1 names them.

use core::f64::consts::TAU;

use nalgebra::{Complex, Matrix2, RowVector2, Vector2};
use thiserror::Error;

use resonarm_dynamics::arm::Arm;
use resonarm_numeric::number::short;

mod phase;
mod terms;

pub use phase::continuous_phase;
pub use terms::{Drive, Quantity, Response, UnknownTerm};

/// Why there is no frequency response.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum FrfError {
    /// The frequency is not a number from zero up.
    #[error("frequency {got_hz} Hz: it must be zero or a positive number", got_hz = short(.got_hz))]
    Frequency {
        /// The given value, Hz.
        got_hz: f64,
    },
    /// The response is infinite: an arm without dampers at its natural frequency.
    #[error(
        "the response at {frequency_hz} Hz is infinite: nothing damps this mode; give the joints damping or move off", frequency_hz = short(.frequency_hz))]
    Unbounded {
        /// The frequency, Hz.
        frequency_hz: f64,
    },
    /// Nothing holds the structure at 0 Hz.
    #[error(
        "the response at 0 Hz is infinite: mode {mode} is rigid, so that nothing holds the structure; begin above 0 Hz"
    )]
    Rigid {
        /// The mode, from 1.
        mode: usize,
    },
}

/// The linearised arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrequencyResponse {
    mass: Matrix2<f64>,
    damping: Matrix2<f64>,
    stiffness: Matrix2<f64>,
    /// J0 of the elbow and of the tip: δB = J_B δα, δC = J_C δα, m/rad.
    elbow: Matrix2<f64>,
    tip: Matrix2<f64>,
}

impl FrequencyResponse {
    /// Linearises the arm in its pose.
    pub fn new(arm: &Arm) -> FrequencyResponse {
        let pose = Vector2::zeros();
        let b = arm.points(&pose).b_m;
        FrequencyResponse {
            mass: arm.mass_matrix(&pose),
            damping: arm.tangent_damping_matrix(&pose),
            stiffness: arm.tangent_stiffness_matrix(&pose),
            elbow: Matrix2::new(-b.y, 0.0, b.x, 0.0),
            tip: arm.tip_jacobian(&pose),
        }
    }

    /// H = (K − ω²M0 + iωD)⁻¹ by Cramer's rule, rad/(N·m), at ω = 2π `frequency_hz`.
    ///
    /// # Errors
    /// [`FrfError::Frequency`] if the frequency is negative or no number, [`FrfError::Unbounded`] if Z has no inverse.
    pub fn receptance_matrix(&self, frequency_hz: f64) -> Result<Matrix2<Complex<f64>>, FrfError> {
        if !(frequency_hz.is_finite() && frequency_hz >= 0.0) {
            return Err(FrfError::Frequency { got_hz: frequency_hz });
        }
        let omega = TAU * frequency_hz;
        let real = self.stiffness - self.mass * (omega * omega);
        let z = real.zip_map(&(self.damping * omega), Complex::new);
        let inverse = Complex::new(1.0, 0.0) / (z.m11 * z.m22 - z.m12 * z.m21);
        if !(inverse.re.is_finite() && inverse.im.is_finite()) {
            return Err(FrfError::Unbounded { frequency_hz });
        }
        Ok(Matrix2::new(z.m22, -z.m12, -z.m21, z.m11) * inverse)
    }

    /// The response over the drive, complex: its modulus is the ratio of the amplitudes, its argument the phase by
    /// which the response leads. Units: rad or m, per s⁰, s¹ or s² as `quantity` says, over N·m or N.
    ///
    /// # Errors
    /// As [`FrequencyResponse::receptance_matrix`].
    pub fn at(
        &self,
        quantity: Quantity,
        drive: Drive,
        response: Response,
        frequency_hz: f64,
    ) -> Result<Complex<f64>, FrfError> {
        let h = self.receptance_matrix(frequency_hz)?;
        let (row, column) = (self.response_row(response), self.drive_column(drive));
        let real = (row * h.map(|z| z.re) * column).x;
        let imaginary = (row * h.map(|z| z.im) * column).x;
        Ok(Complex::new(real, imaginary) * quantity.factor(TAU * frequency_hz))
    }

    /// The generalised force of a unit drive: u itself, or a column of J0ᵀ.
    fn drive_column(&self, drive: Drive) -> Vector2<f64> {
        match drive {
            Drive::Torque1 => Vector2::x(),
            Drive::Torque2 => Vector2::y(),
            Drive::ForceX => self.tip.row(0).transpose(),
            Drive::ForceY => self.tip.row(1).transpose(),
        }
    }

    /// The row that takes α to the response.
    fn response_row(&self, response: Response) -> RowVector2<f64> {
        match response {
            Response::Alpha1 => RowVector2::new(1.0, 0.0),
            Response::Alpha2 => RowVector2::new(0.0, 1.0),
            Response::BX => self.elbow.row(0).into_owned(),
            Response::BY => self.elbow.row(1).into_owned(),
            Response::CX => self.tip.row(0).into_owned(),
            Response::CY => self.tip.row(1).into_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Normed as _;

    use super::*;
    use crate::modes;
    use crate::tests::arm_at;
    use proptest::prelude::*;
    use resonarm_dynamics::arm::{Load, Parameters, Pose, Preset, Sine, State};
    use resonarm_dynamics::integrate::{Integrator, Scheme};

    proptest! {
        /// For an arm without dampers H is the sum over its modes φφᵀ/(ω_r² − ω²).
        #[test]
        fn is_the_sum_of_the_modes(
            preset in prop::sample::select(&Preset::ALL[..]), beta2_deg in -180.0..180.0, f in 0.0..1000.0,
        ) {
            let preset = preset.parameters().unwrap();
            let parameters = Parameters { damping1_nm_s_rad: 0.0, damping2_nm_s_rad: 0.0, ..preset };
            let arm = Arm::new(parameters, Pose { beta1_deg: 0.0, beta2_deg }).unwrap();
            let h = FrequencyResponse::new(&arm).receptance_matrix(f).unwrap();
            let sum: Matrix2<f64> = modes(&arm).iter().map(|mode| {
                let (shape, omega_r, omega) = (Vector2::from(mode.shape), TAU * mode.frequency_hz, TAU * f);
                shape * shape.transpose() / ((omega_r - omega) * (omega_r + omega))
            }).sum();
            prop_assert!((h.map(|z| z.re) - sum).norm() < 1e-9 * sum.norm() / modes(&arm).iter()
                .map(|mode| ((mode.frequency_hz - f) / mode.frequency_hz).abs()).fold(1.0, f64::min), "{h} {sum}");
        }

        /// Maxwell's reciprocity, for the two pairs of drive and response at the same point.
        #[test]
        fn is_reciprocal(
            preset in prop::sample::select(&Preset::ALL[..]),
            beta1_deg in -180.0..180.0, beta2_deg in -180.0..180.0, f in 0.1..200.0,
        ) {
            let response = FrequencyResponse::new(&arm_at(preset, beta1_deg, beta2_deg));
            let at = |drive, place| response.at(Quantity::Receptance, drive, place, f).unwrap();
            for (one, other) in [
                (at(Drive::ForceX, Response::CY), at(Drive::ForceY, Response::CX)),
                (at(Drive::Torque1, Response::CX), at(Drive::ForceX, Response::Alpha1)),
                (at(Drive::Torque1, Response::Alpha2), at(Drive::Torque2, Response::Alpha1)),
            ] {
                prop_assert!((one - other).norm() <= 1e-12 * (one.norm() + 1e-9), "{one} {other}");
            }
        }
    }

    /// Started on the steady vibration that H predicts, the arm stays on it: amplitude and phase, near both resonances.
    #[test]
    fn predicts_the_small_vibration_of_the_simulated_arm() {
        let arm = arm_at(Preset::Irb1600Fitted, 35.0, 60.0);
        let response = FrequencyResponse::new(&arm);
        for frequency_hz in [10.0, 22.15, 40.0, 48.9, 70.0] {
            let sine = Sine {
                amplitude: Load { torque_nm: Vector2::zeros(), force_n: Vector2::new(1e-6, 0.0) },
                frequency_hz,
            };
            let amplitude = [Response::Alpha1, Response::Alpha2]
                .map(|place| response.at(Quantity::Receptance, Drive::ForceX, place, frequency_hz).unwrap() * 1e-6);
            // The drive is Im e^{iωt}, so is the response.
            let omega = TAU * frequency_hz;
            let state_at = |t_s: f64| {
                let turned = amplitude.map(|a| a * Complex::new(libm::cos(omega * t_s), libm::sin(omega * t_s)));
                State::new(turned.map(|a| a.im), turned.map(|a| omega * a.re))
            };
            let integrator = Integrator::new(Scheme::Gl6, 2000.0, &arm).unwrap();
            let mut state = state_at(0.0);
            for k in 0..2000 {
                state = integrator.step(&arm, f64::from(k) / 2000.0, &state, &sine).unwrap();
            }
            let error = (state.alpha_rad - state_at(1.0).alpha_rad).norm();
            let size = amplitude.iter().map(|a| a.norm()).fold(0.0, f64::max);
            assert!(error < 1e-6 * size, "{frequency_hz} Hz: {error} of {size}");
        }
    }

    #[test]
    fn derivatives_and_points_follow_from_the_receptance() {
        let arm = arm_at(Preset::Irb1600Fitted, 90.0, 0.0);
        let response = FrequencyResponse::new(&arm);
        let at = |quantity, place| response.at(quantity, Drive::Torque1, place, 15.0).unwrap();
        let (omega, alpha1) = (TAU * 15.0, at(Quantity::Receptance, Response::Alpha1));
        assert_eq!(at(Quantity::Mobility, Response::Alpha1), Complex::new(-omega * alpha1.im, omega * alpha1.re));
        assert_eq!(at(Quantity::Accelerance, Response::Alpha1), alpha1 * (-omega * omega));
        // The straight arm upright: B moves along −x, by l1 α1.
        assert!((at(Quantity::Receptance, Response::BX) + alpha1 * 0.63).norm() < 1e-12 * alpha1.norm());
        // At rest H is the compliance of the springs.
        let still = response.receptance_matrix(0.0).unwrap();
        assert!((still.m11.re * 555_000.0 - 1.0).abs() < 1e-14 && still.m12.norm() < 1e-16);
    }

    #[test]
    fn says_why_there_is_no_response() {
        let preset = Preset::Irb1600Fitted.parameters().unwrap();
        let parameters = Parameters { damping1_nm_s_rad: 0.0, damping2_nm_s_rad: 0.0, ..preset };
        let arm = Arm::new(parameters, Pose::default()).unwrap();
        let mut response = FrequencyResponse::new(&arm);
        let says = |response: &FrequencyResponse, f| response.receptance_matrix(f).unwrap_err();
        insta::assert_snapshot!(says(&response, -1.0), @"frequency -1 Hz: it must be zero or a positive number");
        insta::assert_snapshot!(says(&response, f64::NAN), @"frequency NaN Hz: it must be zero or a positive number");
        // An exact natural frequency: K = ω² M0 with ω² a representable number.
        response.stiffness = response.mass * ((TAU * 8.0) * (TAU * 8.0));
        insta::assert_snapshot!(says(&response, 8.0), @"the response at 8 Hz is infinite: nothing damps this mode; give the joints damping or move off");
    }
}
