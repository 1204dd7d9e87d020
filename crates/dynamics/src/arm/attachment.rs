//! A mass at the tip that moves with it along one direction, such as the armature of a shaker.
//!
//! With the unit vector e, w = Jᵀe and the displacement s = e·(C − C at rest) of the tip along it,
//!
//! ```text
//! ṡ = wᵀα̇      s̈ = wᵀα̈ + α̇ᵀGα̇      G = ∂w/∂α
//! ```
//!
//! a mass m on a spring k and a damper c to the ground takes the force f = m s̈ + c ṡ + k s out of the arm, and M α̈ +
//! … gets w f on its left: M becomes M + m wwᵀ. With P = e·(link 2), Q = e·(link 1) and P', Q' the same of the links
//! turned by +90°, w = (Q' + P', P') and G = −[[Q + P, P], [P, P]].

use nalgebra::{Matrix2, Vector2};

use super::angle::{Angle, Turn};
use super::coefficients::Coefficients;
use super::external::External;
use super::{Arm, ArmError, InverseDynamics, Load, State};
use crate::integrate::{Motion, Rates};
use crate::real::Real;

/// A mass on a spring and a damper to the ground that follows the tip along one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attachment {
    /// Mass m, kg, not negative.
    pub mass_kg: f64,
    /// Stiffness k of the spring, N/m, not negative; it is relaxed at rest.
    pub stiffness_n_m: f64,
    /// Viscous damping c, N·s/m, not negative.
    pub damping_n_s_m: f64,
    /// Direction against the x axis of the base frame, degrees.
    pub direction_deg: f64,
}

/// An attachment with its constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Attached {
    pub(super) attachment: Attachment,
    pub(super) coefficients: AttachedCoefficients<f64>,
}

/// The constants of the attachment of one arm, or of several side by side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AttachedCoefficients<T> {
    /// m, kg; k, N/m; c, N·s/m.
    mass_kg: T,
    stiffness_n_m: T,
    pub(super) damping_n_s_m: T,
    /// e.
    direction: [T; 2],
    /// The links' angles at rest against the direction, with the links' lengths: their cosines are Q and P, their sines
    /// −Q' and −P'.
    links: [Angle<T>; 2],
}

/// The forces from outside under one load on an arm with an attachment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AttachedExternal<T> {
    /// The forces of the torques and the weight.
    torques: External<T>,
    /// The components of the force at the tip along the direction and across it, N.
    along_n: T,
    across_n: T,
}

/// The motion of the tip along the direction.
struct Along<T> {
    w_m: [T; 2],
    /// Q and P, m.
    across_m: [T; 2],
    displacement_m: T,
    velocity_m_s: T,
    /// α̇1² and (α̇1 + α̇2)².
    squares: [T; 2],
    /// α̇ᵀGα̇, m/s².
    drift_m_s2: T,
}

impl Along<f64> {
    fn w_m(&self) -> Vector2<f64> {
        self.w_m.into()
    }

    /// G, m.
    fn gradient_m(&self) -> Matrix2<f64> {
        let [q, p] = self.across_m;
        -Matrix2::new(q + p, p, p, p)
    }

    /// ∂(α̇ᵀGα̇)/∂α, m/s².
    fn drift_by_alpha(&self) -> Vector2<f64> {
        let ([w1, p_turned], [square1, square2]) = (self.w_m, self.squares);
        let q_turned = w1 - p_turned;
        -Vector2::new(q_turned * square1 + p_turned * square2, p_turned * square2)
    }

    /// m s̈ + c ṡ + k s at an α̈, N.
    fn force_n(&self, attachment: &Attachment, acceleration_rad_s2: &Vector2<f64>) -> f64 {
        let acceleration_m_s2 = self.w_m().dot(acceleration_rad_s2) + self.drift_m_s2;
        attachment.mass_kg * acceleration_m_s2
            + attachment.damping_n_s_m * self.velocity_m_s
            + attachment.stiffness_n_m * self.displacement_m
    }
}

impl Attached {
    fn new(attachment: Attachment, arm: &Arm) -> Attached {
        let direction_rad = attachment.direction_deg.to_radians();
        let (sine, cosine) = libm::sincos(direction_rad);
        let ([joint1_rad, joint2_rad], [l1_m, l2_m]) = (arm.joint_angles_at_rest_rad(), arm.coefficients.l);
        let link = |angle_rad: f64, length_m: f64| Angle::new(angle_rad - direction_rad).times(length_m);
        let coefficients = AttachedCoefficients {
            mass_kg: attachment.mass_kg,
            stiffness_n_m: attachment.stiffness_n_m,
            damping_n_s_m: attachment.damping_n_s_m,
            direction: [cosine, sine],
            links: [link(joint1_rad, l1_m), link(joint1_rad + joint2_rad, l2_m)],
        };
        Attached { attachment, coefficients }
    }

    fn along(&self, state: &State) -> Along<f64> {
        let motion = Motion::from(state);
        self.coefficients.along(&motion, turns_of_links::<f64, true>(motion.x))
    }

    fn direction(&self) -> Vector2<f64> {
        self.coefficients.direction.into()
    }
}

impl AttachedExternal<f64> {
    #[inline(always)]
    pub fn new(c: &Coefficients<f64>, attached: &AttachedCoefficients<f64>, load: &Load) -> AttachedExternal<f64> {
        let torques = External::new(c, &Load { force_n: Vector2::zeros(), ..*load });
        let ([e1, e2], [f1, f2]): ([f64; 2], [f64; 2]) = (attached.direction, load.force_n.into());
        AttachedExternal { torques, along_n: e1 * f1 + e2 * f2, across_n: e1 * f2 - e2 * f1 }
    }
}

impl<T: Real> AttachedExternal<T> {
    /// The same for `T::WIDTH` arms side by side.
    #[inline(always)]
    pub fn gather(of: impl Fn(usize) -> AttachedExternal<f64>) -> AttachedExternal<T> {
        AttachedExternal {
            torques: External::gather(|i| of(i).torques),
            along_n: T::gather(|i| of(i).along_n),
            across_n: T::gather(|i| of(i).across_n),
        }
    }
}

/// The turns of link 1 and link 2 by the joints' angles, with `FAR` as [`Turn::new`] has it.
#[inline(always)]
fn turns_of_links<T: Real, const FAR: bool>(alpha_rad: [T; 2]) -> [Turn<T>; 2] {
    let [turn1, joint2] = alpha_rad.map(Turn::new::<FAR>);
    [turn1, turn1.and(joint2)]
}

impl<T: Real> AttachedCoefficients<T> {
    /// The attachments of `T::WIDTH` arms side by side.
    #[inline(always)]
    pub fn gather<'a>(of: impl Fn(usize) -> &'a AttachedCoefficients<f64>) -> AttachedCoefficients<T> {
        let number = |pick: fn(&AttachedCoefficients<f64>) -> f64| T::gather(|i| pick(of(i)));
        AttachedCoefficients {
            mass_kg: number(|a| a.mass_kg),
            stiffness_n_m: number(|a| a.stiffness_n_m),
            damping_n_s_m: number(|a| a.damping_n_s_m),
            direction: [number(|a| a.direction[0]), number(|a| a.direction[1])],
            links: [Angle::gather(|i| &of(i).links[0]), Angle::gather(|i| &of(i).links[1])],
        }
    }

    /// At the turns of link 1 and link 2.
    #[inline(always)]
    fn along(&self, motion: &Motion<T>, [turn1, turn2]: [Turn<T>; 2]) -> Along<T> {
        let ([v1, v2], [link1, link2]) = (motion.v, &self.links);
        let rate2_rad_s = v1 + v2;
        let ((sine1, q), (sine2, p)) = (link1.turned(turn1), link2.turned(turn2));
        let w_m = [-sine1 - sine2, -sine2];
        let squares = [v1 * v1, rate2_rad_s * rate2_rad_s];
        Along {
            w_m,
            across_m: [q, p],
            displacement_m: link1.cosine_change(turn1) + link2.cosine_change(turn2),
            velocity_m_s: w_m[0] * v1 + w_m[1] * v2,
            squares,
            drift_m_s2: -(q * squares[0] + p * squares[1]),
        }
    }

    /// α̈: (M + m wwᵀ) α̈ = r − w f with r and M of the arm alone and f at α̈ = 0. The force's share of r is w times
    /// its component along the direction, and (Q + P, P) times the one across. The attachment adds −c ṡ² to the power.
    #[inline(always)]
    fn rates<const FAR: bool>(
        &self,
        c: &Coefficients<T>,
        motion: &Motion<T>,
        external: &AttachedExternal<T>,
    ) -> Rates<T> {
        let [turn1, joint2] = motion.x.map(Turn::new::<FAR>);
        let turn2 = turn1.and(joint2);
        let along = self.along(motion, [turn1, turn2]);
        let (h, t) = c.elbow.turned(joint2);
        let AttachedExternal { torques, along_n, across_n } = external;
        let [u1, u2] = if c.heavy { torques.at(turn1, turn2) } else { torques.at_rest };
        let ([w1, w2], [q, p]) = (along.w_m, along.across_m);
        let force = [(u1 + w1 * *along_n) + (q + p) * *across_n, (u2 + w2 * *along_n) + p * *across_n];
        let damping_n = self.damping_n_s_m * along.velocity_m_s;
        let taken_n = self.mass_kg * along.drift_m_s2 + damping_n + self.stiffness_n_m * along.displacement_m;
        let r = c.torques(motion, h, force);
        let (r1, r2) = (r[0] - w1 * taken_n, r[1] - w2 * taken_n);
        let m12 = c.a3 + t + self.mass_kg * w1 * w2;
        let (m11, m22) = (c.a1 + (t + t) + self.mass_kg * w1 * w1, c.a3 + self.mass_kg * w2 * w2);
        let inverse = T::splat(1.0) / (m11 * m22 - m12 * m12);
        Rates {
            acceleration: [(m22 * r1 - m12 * r2) * inverse, (m11 * r2 - m12 * r1) * inverse],
            power_w: c.power_w(motion.v, force) - damping_n * along.velocity_m_s,
        }
    }

    /// The same at every angle, and fast at small ones.
    #[inline(always)]
    pub fn rates_anywhere(&self, c: &Coefficients<T>, motion: &Motion<T>, external: &AttachedExternal<T>) -> Rates<T> {
        if c.within_reach::<true>(motion.x) {
            self.rates::<false>(c, motion, external)
        } else {
            self.far_rates(c, motion, external)
        }
    }

    #[cold]
    #[inline(never)]
    fn far_rates(&self, c: &Coefficients<T>, motion: &Motion<T>, external: &AttachedExternal<T>) -> Rates<T> {
        self.rates::<true>(c, motion, external)
    }

    /// ½ m ṡ² + ½ k s², J.
    #[inline(always)]
    pub fn energy_j<const FAR: bool>(&self, motion: &Motion<T>) -> T {
        let Along { displacement_m: s, velocity_m_s: rate, .. } =
            self.along(motion, turns_of_links::<T, FAR>(motion.x));
        T::splat(0.5) * (self.mass_kg * (rate * rate) + self.stiffness_n_m * (s * s))
    }
}

impl Arm {
    /// The same arm with an attachment at its tip, in place of any it had.
    ///
    /// # Errors
    /// [`ArmError::Attachment`] names the impossible value.
    pub fn with_attachment(mut self, attachment: Attachment) -> Result<Arm, ArmError> {
        let Attachment { mass_kg, stiffness_n_m, damping_n_s_m, direction_deg } = attachment;
        let not_negative = [("mass_kg", mass_kg), ("stiffness_n_m", stiffness_n_m), ("damping_n_s_m", damping_n_s_m)];
        for (name, got) in not_negative {
            if !(got.is_finite() && got >= 0.0) {
                return Err(ArmError::Attachment { name, got, expected: "zero or a positive number" });
            }
        }
        if !(-360.0..=360.0).contains(&direction_deg) {
            let expected = "from -360 to 360 degrees";
            return Err(ArmError::Attachment { name: "direction_deg", got: direction_deg, expected });
        }
        self.attached = Some(Attached::new(attachment, &self));
        Ok(self)
    }

    /// The arm alone.
    #[must_use]
    pub fn without_attachment(mut self) -> Arm {
        self.attached = None;
        self
    }

    /// The attachment at the tip.
    pub fn attachment(&self) -> Option<&Attachment> {
        self.attached.as_ref().map(|attached| &attached.attachment)
    }

    pub(super) fn attached_coefficients(&self) -> Option<&AttachedCoefficients<f64>> {
        self.attached.as_ref().map(|attached| &attached.coefficients)
    }

    /// Share of a force on the attachment, far above the natural frequencies, that goes through it into the arm: 1/(1 +
    /// m/M), with m the attachment's mass and M the effective mass of the tip along its direction d, 1/M = dᵀ J M₀⁻¹ Jᵀ
    /// d; 1 without an attachment.
    pub fn high_frequency_force_share(&self) -> f64 {
        let Some(attached) = &self.attached else { return 1.0 };
        let rest = Vector2::zeros();
        let alone = self.clone().without_attachment();
        let moment = alone.tip_jacobian(&rest).transpose() * attached.direction();
        let inverse = alone.mass_matrix(&rest).try_inverse().map_or(0.0, |inverse| moment.dot(&(inverse * moment)));
        1.0 / (1.0 + attached.attachment.mass_kg * inverse)
    }

    /// The displacement s of the tip from rest along the direction of the attachment, m, and its rate, m/s; zero
    /// without one.
    pub fn attachment_motion(&self, state: &State) -> (f64, f64) {
        self.attached.as_ref().map_or((0.0, 0.0), |attached| {
            let along = attached.along(state);
            (along.displacement_m, along.velocity_m_s)
        })
    }

    /// The force that the attachment takes out of the arm at the tip, N; zero without one.
    pub fn attachment_force_n(&self, state: &State, acceleration_rad_s2: &Vector2<f64>) -> Vector2<f64> {
        self.attached.as_ref().map_or(Vector2::zeros(), |attached| {
            attached.direction() * attached.along(state).force_n(&attached.attachment, acceleration_rad_s2)
        })
    }

    /// D + c wwᵀ, N·m·s/rad: D itself without an attachment. Symmetric.
    pub fn tangent_damping_matrix(&self, alpha_rad: &Vector2<f64>) -> Matrix2<f64> {
        self.damping_matrix() + self.attached_at(alpha_rad, |attachment| attachment.damping_n_s_m)
    }

    /// wwᵀ times `factor` of the attachment; zero without one.
    pub(super) fn attached_at(&self, alpha_rad: &Vector2<f64>, factor: impl Fn(&Attachment) -> f64) -> Matrix2<f64> {
        self.attached.as_ref().map_or(Matrix2::zeros(), |attached| {
            let state = State { alpha_rad: *alpha_rad, ..State::default() };
            let w = attached.along(&state).w_m();
            w * w.transpose() * factor(&attached.attachment)
        })
    }

    /// k (wwᵀ + s G), N·m/rad: the attachment's part of the stiffness at a deflection; zero without one.
    pub(super) fn attached_stiffness(&self, alpha_rad: &Vector2<f64>) -> Matrix2<f64> {
        self.attached.as_ref().map_or(Matrix2::zeros(), |attached| {
            let along = attached.along(&State { alpha_rad: *alpha_rad, ..State::default() });
            let w = along.w_m();
            let inner = w * w.transpose() + along.gradient_m() * along.displacement_m;
            inner * attached.attachment.stiffness_n_m
        })
    }

    /// ½ m ṡ² and ½ k s², J.
    pub(super) fn attached_energy_j(&self, state: &State) -> (f64, f64) {
        let (displacement_m, velocity_m_s) = self.attachment_motion(state);
        self.attachment().map_or((0.0, 0.0), |attachment| {
            let half = |factor: f64, x: f64| 0.5 * factor * x * x;
            (half(attachment.mass_kg, velocity_m_s), half(attachment.stiffness_n_m, displacement_m))
        })
    }

    /// c ṡ², W.
    pub(super) fn attached_loss_w(&self, state: &State) -> f64 {
        let (_, velocity_m_s) = self.attachment_motion(state);
        self.attachment().map_or(0.0, |attachment| attachment.damping_n_s_m * velocity_m_s * velocity_m_s)
    }

    /// w f: the attachment's part of the unbalanced torque, N·m.
    pub(super) fn attached_unbalance_nm(&self, state: &State, acceleration_rad_s2: &Vector2<f64>) -> Vector2<f64> {
        self.attached.as_ref().map_or(Vector2::zeros(), |attached| {
            let along = attached.along(state);
            along.w_m() * along.force_n(&attached.attachment, acceleration_rad_s2)
        })
    }

    /// Adds w f to the unbalanced torque, and its derivatives: ∂w/∂α = G, ∂s/∂α = wᵀ, ∂ṡ/∂α = (Gα̇)ᵀ,
    /// ∂s̈/∂α = (Gα̈)ᵀ + ∂(α̇ᵀGα̇)/∂α, ∂s̈/∂α̇ = 2 (Gα̇)ᵀ.
    pub(super) fn add_attached(
        &self,
        state: &State,
        acceleration_rad_s2: &Vector2<f64>,
        sum: InverseDynamics,
    ) -> InverseDynamics {
        let Some(attached) = &self.attached else { return sum };
        let (along, a) = (attached.along(state), &attached.attachment);
        let force_n = along.force_n(a, acceleration_rad_s2);
        let (w, g) = (along.w_m(), along.gradient_m());
        let turning = g * state.alpha_dot_rad_s;
        let by_alpha = (g * acceleration_rad_s2 + along.drift_by_alpha()) * a.mass_kg
            + turning * a.damping_n_s_m
            + w * a.stiffness_n_m;
        let by_alpha_dot = turning * (2.0 * a.mass_kg) + w * a.damping_n_s_m;
        InverseDynamics {
            unbalance_nm: sum.unbalance_nm + w * force_n,
            by_alpha: sum.by_alpha + g * force_n + w * by_alpha.transpose(),
            by_alpha_dot: sum.by_alpha_dot + w * by_alpha_dot.transpose(),
            by_alpha_ddot: sum.by_alpha_ddot + w * w.transpose() * a.mass_kg,
        }
    }
}

/// M⁻¹ r by Cramer's rule; M is positive definite.
pub(super) fn solved(m: &Matrix2<f64>, r: &Vector2<f64>) -> Vector2<f64> {
    let inverse = 1.0 / (m.m11 * m.m22 - m.m12 * m.m21);
    Vector2::new((m.m22 * r.x - m.m12 * r.y) * inverse, (m.m11 * r.y - m.m21 * r.x) * inverse)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::tests::arm;
    use crate::arm::{Load, Preset};

    const ATTACHMENT: Attachment =
        Attachment { mass_kg: 3.0, stiffness_n_m: 4e4, damping_n_s_m: 70.0, direction_deg: 35.0 };

    fn attached() -> Arm {
        arm(Preset::Irb1600Fitted, 20.0, 70.0).with_attachment(ATTACHMENT).unwrap()
    }

    /// The arm alone moves the same if the attachment's force on it is given as a load.
    #[test]
    fn is_the_arm_alone_under_the_force_that_is_left() {
        let arm = attached();
        let load = Load { torque_nm: [60.0, -10.0].into(), force_n: [300.0, -250.0].into() };
        let state = State::new([0.2, -0.3], [12.0, -20.0]);
        let acceleration = arm.acceleration(&state, &load);
        let taken = arm.attachment_force_n(&state, &acceleration);
        assert!(taken.norm() > 100.0, "{taken}");
        let left = Load { force_n: load.force_n - taken, ..load };
        let alone = arm.clone().without_attachment().acceleration(&state, &left);
        assert!((alone - acceleration).norm() < 1e-9 * acceleration.norm(), "{alone} {acceleration}");
    }

    /// The force along the direction is m s̈ + c ṡ + k s of the tip's motion.
    #[test]
    fn its_force_is_that_of_the_tip_s_motion() {
        let arm = attached();
        let state = State::new([0.2, -0.3], [12.0, -20.0]);
        let acceleration = arm.acceleration(&state, &Load::default());
        let (s, rate) = arm.attachment_motion(&state);
        let (sine, cosine) = libm::sincos(35.0_f64.to_radians());
        let direction = Vector2::new(cosine, sine);
        let tip = arm.points(&state.alpha_rad).c_m - arm.points(&Vector2::zeros()).c_m;
        assert!((s - direction.dot(&tip)).abs() < 1e-12);
        let velocity = arm.tip_jacobian(&state.alpha_rad) * state.alpha_dot_rad_s;
        assert!((rate - direction.dot(&velocity)).abs() < 1e-12);
        let along = direction.dot(&arm.point_accelerations(&state, &acceleration).c_m_s2);
        let expected = direction * (3.0 * along + 70.0 * rate + 4e4 * s);
        assert!((arm.attachment_force_n(&state, &acceleration) - expected).norm() < 1e-9 * expected.norm());
    }

    #[test]
    fn derivatives_are_exact() {
        let arm = attached();
        let load = Load { torque_nm: [60.0, -10.0].into(), force_n: [30.0, -25.0].into() };
        let (x, v) = (Vector2::new(0.2, -0.3), Vector2::new(12.0, -20.0));
        let state = |x, v| State { alpha_rad: x, alpha_dot_rad_s: v };
        let exact = arm.acceleration_jacobian(&state(x, v), &load);
        let dynamics = arm.inverse_dynamics(&state(x, v), &exact.acceleration_rad_s2, &load);
        assert!(dynamics.unbalance_nm.norm() < 1e-6);
        for column in 0..2 {
            let mut e = Vector2::zeros();
            e[column] = 1e-5;
            let slope = |f: &dyn Fn(Vector2<f64>) -> Vector2<f64>| (f(e) - f(-e)) / 2e-5;
            let near = |exact: Vector2<f64>, seen: Vector2<f64>| {
                assert!((exact - seen).norm() < 1e-6 * (1.0 + exact.norm()), "{exact} {seen}");
            };
            near(exact.by_alpha.column(column).into(), slope(&|e| arm.acceleration(&state(x + e, v), &load)));
            near(exact.by_alpha_dot.column(column).into(), slope(&|e| arm.acceleration(&state(x, v + e), &load)));
            let a = Vector2::new(800.0, -300.0);
            let at = arm.inverse_dynamics(&state(x, v), &a, &load);
            near(at.by_alpha.column(column).into(), slope(&|e| arm.unbalance_nm(&state(x + e, v), &a, &load)));
            near(at.by_alpha_dot.column(column).into(), slope(&|e| arm.unbalance_nm(&state(x, v + e), &a, &load)));
            near(at.by_alpha_ddot.column(column).into(), slope(&|e| arm.unbalance_nm(&state(x, v), &(a + e), &load)));
        }
        let stiffness = arm.inverse_dynamics(&State::default(), &Vector2::zeros(), &Load::default()).by_alpha;
        assert!((stiffness - arm.tangent_stiffness_matrix(&Vector2::zeros())).norm() < 1e-6);
    }

    #[test]
    fn nothing_attached_is_the_arm_alone() {
        let alone = arm(Preset::Irb1600Fitted, 20.0, 70.0);
        let nothing = Attachment { mass_kg: 0.0, stiffness_n_m: 0.0, damping_n_s_m: 0.0, direction_deg: 35.0 };
        let with = alone.clone().with_attachment(nothing).unwrap();
        let state = State::new([0.2, -0.3], [12.0, -20.0]);
        let load = Load::force_n(300.0, -40.0);
        let (a, b) = (alone.acceleration(&state, &load), with.acceleration(&state, &load));
        assert!((a - b).norm() < 1e-12 * a.norm());
        assert_eq!(alone.angular_frequencies_rad_s(), with.angular_frequencies_rad_s());
    }

    #[test]
    fn says_what_can_t_be_attached() {
        let says = |attachment| arm(Preset::Irb1600Fitted, 20.0, 70.0).with_attachment(attachment).unwrap_err();
        insta::assert_snapshot!(says(Attachment { mass_kg: -1.0, ..ATTACHMENT }), @"attachment: `mass_kg` is -1: it must be zero or a positive number");
        insta::assert_snapshot!(says(Attachment { direction_deg: f64::NAN, ..ATTACHMENT }), @"attachment: `direction_deg` is NaN: it must be from -360 to 360 degrees");
    }
}
