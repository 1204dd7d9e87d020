//! The arm under load · sin Ωt (Eqs. 31 and 32), as a system for the analysis.

use nalgebra::Vector2;

use super::{ArmParameter, Instant, LinearMode, Linearisation, Oscillator};
use resonarm_dynamics::arm::{Arm, ArmError, Load, Parameters, Pose, State};

/// The fraction of a parameter by which it is varied if r is not quadratic in it.
const SMALL_PART: f64 = 1e-4;

/// An arm and its sinusoidal load.
#[derive(Clone, Debug, PartialEq)]
pub struct ForcedArm {
    arm: Arm,
    direction: Load,
    amplitude: f64,
}

impl ForcedArm {
    /// The arm under `amplitude` · `direction` · sin Ωt: torques at the joints, a force of any direction at the tip, or
    /// both. An attachment is left out: the force between it and the arm is a load on the arm.
    pub fn new(arm: Arm, direction: Load, amplitude: f64) -> ForcedArm {
        ForcedArm { arm: arm.without_attachment(), direction, amplitude }
    }

    /// The arm.
    pub fn arm(&self) -> &Arm {
        &self.arm
    }

    /// The peak load of the sine.
    pub fn load(&self) -> Load {
        self.direction.scaled(self.amplitude)
    }

    /// The same without dampers: its free periodic motions are the nonlinear normal modes.
    ///
    /// # Errors
    /// As [`Arm::new`]; none for an arm that exists.
    pub fn undamped(&self) -> Result<ForcedArm, ArmError> {
        let parameters = Parameters { damping1_nm_s_rad: 0.0, damping2_nm_s_rad: 0.0, ..*self.arm.parameters() };
        Ok(ForcedArm { arm: Arm::new(parameters, self.arm.pose())?, ..*self })
    }

    fn split(&self, at: &Instant) -> (State, Load) {
        (
            State { alpha_rad: at.position, alpha_dot_rad_s: at.velocity },
            self.direction.scaled(self.amplitude * at.sine),
        )
    }

    /// The arm with one parameter at another value.
    fn arm_with(&self, which: ArmParameter, value: f64) -> Result<Arm, ArmError> {
        let (mut parameters, mut pose) = (*self.arm.parameters(), self.arm.pose());
        match which {
            ArmParameter::Beta1Deg => pose.beta1_deg = value,
            ArmParameter::Beta2Deg => pose.beta2_deg = value,
            _ => {
                if let Some(field) = which.field(&mut parameters) {
                    *field = value;
                }
            }
        }
        Arm::new(parameters, pose)
    }

    /// ∂r/∂p of a physical parameter: r is at most quadratic in each, so that the difference quotient (−3 r(p) + 4
    /// r(p+h) − r(p+2h)) / 2h is exact at any h. It uses larger p, where the arm exists. With gravity the sag depends
    /// on p, too, and the quotient has an error of the order of h².
    fn by_physical(&self, which: ArmParameter, at: &Instant) -> Vector2<f64> {
        let value = self.parameter(which);
        let part = if self.arm.parameters().gravity.is_some() { SMALL_PART } else { 0.25 };
        let h = part * if value == 0.0 { 1.0 } else { value };
        let (state, load) = self.split(at);
        let unbalance = |arm: &Arm| arm.unbalance_nm(&state, &at.acceleration, &load);
        match (self.arm_with(which, value + h), self.arm_with(which, value + 2.0 * h)) {
            (Ok(near), Ok(far)) => (unbalance(&near) * 4.0 - unbalance(&self.arm) * 3.0 - unbalance(&far)) / (2.0 * h),
            _ => Vector2::from_element(f64::NAN),
        }
    }
}

impl Oscillator for ForcedArm {
    type Parameter = ArmParameter;

    fn parameter(&self, which: ArmParameter) -> f64 {
        let Pose { beta1_deg, beta2_deg } = self.arm.pose();
        match which {
            ArmParameter::Amplitude => self.amplitude,
            ArmParameter::Beta1Deg => beta1_deg,
            ArmParameter::Beta2Deg => beta2_deg,
            _ => which.field(&mut self.arm.parameters().clone()).map_or(f64::NAN, |field| *field),
        }
    }

    fn set_parameter(&mut self, which: ArmParameter, value: f64) -> bool {
        if which == ArmParameter::Amplitude {
            if value.is_finite() {
                self.amplitude = value;
            }
            return value.is_finite();
        }
        self.arm_with(which, value).map(|arm| self.arm = arm).is_ok()
    }

    fn unit(&self, which: ArmParameter) -> &'static str {
        let (torque, force) = (self.direction.torque_nm.norm() > 0.0, self.direction.force_n.norm() > 0.0);
        match which {
            ArmParameter::Amplitude if torque && force => "times the load",
            ArmParameter::Amplitude if force => "N",
            ArmParameter::Amplitude => "N·m",
            _ => which.unit(),
        }
    }

    fn unbalance(&self, at: &Instant) -> Vector2<f64> {
        let (state, load) = self.split(at);
        self.arm.unbalance_nm(&state, &at.acceleration, &load)
    }

    fn linearise(&self, at: &Instant) -> Linearisation {
        let (state, load) = self.split(at);
        let exact = self.arm.inverse_dynamics(&state, &at.acceleration, &load);
        Linearisation {
            unbalance: exact.unbalance_nm,
            by_position: exact.by_alpha,
            by_velocity: exact.by_alpha_dot,
            by_acceleration: exact.by_alpha_ddot,
        }
    }

    /// The links' angles at rest θ enter as θ + α does, except in Kα and in the weight at rest: ∂r/∂θ = ∂r/∂α − K₀, K₀
    /// being the stiffness at rest. Without gravity θ = β and K₀ = K; with it, θ = β + α_st and K α_st + G(θ) = 0, so
    /// ∂θ/∂β = K₀⁻¹K.
    fn by_parameter(&self, which: ArmParameter, at: &Instant) -> Vector2<f64> {
        let pose = |column: usize| {
            let at_rest = self.arm.tangent_stiffness_matrix(&Vector2::zeros());
            let by_angle = self.linearise(at).by_position - at_rest;
            let mut turn = Vector2::ith(column, 1.0);
            if self.arm.parameters().gravity.is_some() {
                // K₀ is positive definite in every valid arm.
                let stiffness = self.arm.stiffness_matrix() * turn;
                turn = at_rest.try_inverse().map_or(Vector2::from_element(f64::NAN), |inverse| inverse * stiffness);
            }
            by_angle * turn * 1.0_f64.to_radians()
        };
        match which {
            ArmParameter::Amplitude => -self.arm.generalised_force(&at.position, &self.direction) * at.sine,
            ArmParameter::Beta1Deg => pose(0),
            ArmParameter::Beta2Deg => pose(1),
            _ => self.by_physical(which, at),
        }
    }

    fn stiffness_scale(&self) -> f64 {
        let p = self.arm.parameters();
        p.stiffness1_nm_rad.max(p.stiffness2_nm_rad)
    }

    /// (K − ω²M) φ = 0 gives φ by the row that is further from zero; ζ = φᵀDφ / (2ω φᵀMφ).
    fn modes(&self) -> [LinearMode; 2] {
        let rest = Vector2::zeros();
        let (m, k) = (self.arm.mass_matrix(&rest), self.arm.tangent_stiffness_matrix(&rest));
        self.arm.angular_frequencies_rad_s().map(|frequency_rad_s| {
            let z = k - m * (frequency_rad_s * frequency_rad_s);
            let [first, second] = [Vector2::new(-z.m12, z.m11), Vector2::new(z.m22, -z.m21)];
            let shape = if first.norm() > second.norm() { first } else { second }.normalize();
            let damping = shape.dot(&(self.arm.tangent_damping_matrix(&rest) * shape));
            let damping_ratio = damping / (2.0 * frequency_rad_s * shape.dot(&(m * shape)));
            LinearMode { frequency_rad_s, damping_ratio, shape }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::arm_at;
    use resonarm_dynamics::arm::{Gravity, Preset};

    #[test]
    fn derivatives_by_every_parameter_are_exact() {
        let load = Load { torque_nm: [2.0, -1.0].into(), force_n: [0.5, 0.7].into() };
        let arm = arm_at(Preset::Irb1600Fitted, 25.0, 70.0);
        // A gravity under which the joints sag by several degrees.
        let gravity = Some(Gravity { gravity_m_s2: 50.0, mass1_kg: 20.0, centre1_m: 0.3 });
        let soft = Parameters { stiffness1_nm_rad: 2e4, stiffness2_nm_rad: 5e3, gravity, ..*arm.parameters() };
        for arm in [Arm::new(soft, arm.pose()).unwrap(), arm] {
            assert_derivatives(ForcedArm::new(arm, load, 30.0));
        }
    }

    fn assert_derivatives(mut forced: ForcedArm) {
        let at = Instant {
            position: [0.2, -0.3].into(),
            velocity: [20.0, -10.0].into(),
            acceleration: [900.0, 1500.0].into(),
            sine: 0.8,
            cosine: 0.6,
        };
        for which in ArmParameter::ALL {
            let (value, exact) = (forced.parameter(which), forced.by_parameter(which, &at));
            let h = 1e-4 * value;
            assert!(forced.set_parameter(which, value + h));
            let above = forced.unbalance(&at);
            assert!(forced.set_parameter(which, value - h));
            let below = forced.unbalance(&at);
            assert!(forced.set_parameter(which, value));
            let seen = (above - below) / (2.0 * h);
            assert!((seen - exact).norm() < 1e-6 * (1.0 + exact.norm()), "{which:?}: {seen} {exact}");
        }
        assert!(!forced.set_parameter(ArmParameter::Mass2, -1.0) && forced.parameter(ArmParameter::Mass2) == 50.58);
    }

    #[test]
    fn an_amplitude_that_is_no_number_is_refused_and_not_kept() {
        let mut forced = ForcedArm::new(arm_at(Preset::Irb1600Fitted, 25.0, 70.0), Load::torque_nm(1.0, 0.0), 30.0);
        for value in [f64::NAN, f64::INFINITY] {
            assert!(!forced.set_parameter(ArmParameter::Amplitude, value));
            assert_eq!(forced.parameter(ArmParameter::Amplitude), 30.0);
        }
    }
}
