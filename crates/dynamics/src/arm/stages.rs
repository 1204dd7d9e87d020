//! The arm as a system for the integrators, with its own kernel for the stages of a step.

use super::attachment::{AttachedCoefficients, AttachedExternal};
use super::coefficients::Coefficients;
use super::explicit;
use super::external::External;
use super::{Arm, Load, State};
use crate::integrate::explicit::{Explicit, by_stages};
use crate::integrate::tableau::DOP853;
use crate::integrate::{
    Dynamics, Excitation, ExplicitMethod, Jacobian, Motion, Rates, SolveStages, StageEquation, StageLoads, Wide,
};

/// The equation of the arm alone; `LINKS` is that of [`Coefficients::acceleration`].
struct Alone<const LINKS: bool> {
    arm: Coefficients<Wide>,
    external: External<Wide>,
}

impl<const LINKS: bool> StageEquation<2> for Alone<LINKS> {
    #[inline(always)]
    fn rates(&self, motion: &Motion<Wide>) -> Rates<Wide> {
        self.arm.rates_anywhere::<LINKS>(motion, &self.external)
    }
}

/// The equation of an arm with an attachment.
struct WithAttachment {
    arm: Coefficients<Wide>,
    attached: AttachedCoefficients<Wide>,
    external: AttachedExternal<Wide>,
}

impl StageEquation<2> for WithAttachment {
    #[inline(always)]
    fn rates(&self, motion: &Motion<Wide>) -> Rates<Wide> {
        self.attached.rates_anywhere(&self.arm, motion, &self.external)
    }
}

impl Dynamics<2> for Arm {
    type Load = Load;
    type State = State;

    #[inline(always)]
    fn rates(&self, motion: &Motion<f64>, load: &Load) -> Rates<f64> {
        self.rates_at(motion, load)
    }

    fn jacobian(&self, motion: &Motion<f64>, load: &Load) -> Jacobian<2> {
        let at = self.acceleration_jacobian(&State::from(*motion), load);
        let rows = |m: &nalgebra::Matrix2<f64>| [[m.m11, m.m12], [m.m21, m.m22]];
        Jacobian {
            acceleration: at.acceleration_rad_s2.into(),
            by_position: rows(&at.by_alpha),
            by_velocity: rows(&at.by_alpha_dot),
        }
    }

    fn linear_part(&self) -> Jacobian<2> {
        self.jacobian(&Motion::from(State::default()), &Load::default())
    }

    fn fastest_rad_s(&self) -> f64 {
        self.angular_frequencies_rad_s()[1]
    }

    #[inline(always)]
    fn frequency_bound_rad_s(&self, position: &[f64; 2]) -> f64 {
        self.angular_frequency_bound_rad_s(&(*position).into())
    }

    /// Without the weight's, which acts as a load.
    #[inline(always)]
    fn energy_j(&self, motion: &Motion<f64>) -> f64 {
        self.energy_of_motion_and_springs_j(motion)
    }

    #[inline(always)]
    fn solve_stages<const S: usize, V: SolveStages<2>>(&self, loads: &StageLoads<Load, S>, solve: V) -> V::Solution {
        let own = &self.coefficients;
        let arm = Coefficients::<Wide>::gather(|_lane| own);
        if let Some(attached) = self.attached_coefficients() {
            let external = loads.map(|load| AttachedExternal::new(own, attached, load));
            let external = AttachedExternal::gather(|lane| external[lane.min(S - 1)]);
            let attached = AttachedCoefficients::<Wide>::gather(|_lane| attached);
            return solve.solve(&WithAttachment { arm, attached, external });
        }
        let external = loads.map(|load| External::new(own, load));
        let external = External::gather(|lane| external[lane.min(S - 1)]);
        if external.follows_links {
            solve.solve(&Alone::<true> { arm, external })
        } else {
            solve.solve(&Alone::<false> { arm, external })
        }
    }

    #[inline(always)]
    fn explicit_step(
        &self,
        method: &ExplicitMethod,
        t_s: f64,
        motion: &Motion<f64>,
        excitation: &impl Excitation<Load>,
    ) -> Motion<f64> {
        if self.attached.is_some() {
            return attached_step(self, method, t_s, motion, excitation);
        }
        let h_s = method.step_s;
        match &method.kind {
            Explicit::Rk4(h) => {
                let at = |part: f64| External::new(&self.coefficients, &excitation.load(t_s + part * h_s));
                explicit::rk4(&self.coefficients, h, motion, &[at(0.0), at(0.5), at(1.0)])
            }
            Explicit::Dop853 => {
                let loads = DOP853.c.map(|part| excitation.load(t_s + part * h_s));
                explicit::dop853(&self.coefficients, h_s, motion, &loads)
            }
        }
    }
}

/// A step of an explicit method of an arm with an attachment.
#[cold]
fn attached_step(
    arm: &Arm,
    method: &ExplicitMethod,
    t_s: f64,
    motion: &Motion<f64>,
    excitation: &impl Excitation<Load>,
) -> Motion<f64> {
    by_stages(method, t_s, motion, |t_s, stage| arm.rates_at(stage, &excitation.load(t_s)).acceleration)
}
