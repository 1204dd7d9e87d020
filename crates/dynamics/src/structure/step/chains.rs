//! Chains with smooth elements: [`Links`] of every number of links behind one trait.

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::driver::Driver;
use super::error::StepError;
use super::lanes::{self, SineSteps};
use super::{Engine, StateRef, StepLoad};
use crate::integrate::{Dynamics, Excitation, Integrator, Motion, Scheme};
use crate::structure::assembly::Assembly;
use crate::structure::chain::Chain;
use crate::structure::coil::Current;
use crate::structure::dof::{At, Dof};
use crate::structure::links::{Links, LinksLoad};
use crate::structure::position::Kinematics;
use crate::structure::spec::Axis;

/// A chain of N links in motion, with what steps and drives it.
#[derive(Clone, Debug)]
pub(super) struct Stepped<const N: usize> {
    pub links: Links<N>,
    integrator: Integrator<N>,
    /// Places where the loads act: the number of the load, and a degree of freedom with its share.
    drive: Vec<(usize, Dof, f64)>,
    pub motion: Motion<f64, N>,
    driver: Option<Driver>,
}

/// Drive of a chain.
#[derive(Clone, Debug)]
pub(super) enum Drive<'a> {
    /// A load along each of some degrees of freedom.
    Loads(&'a [Dof]),
    /// The coil of a shaker.
    Shaker(Driver),
}

pub(super) fn engine(
    chain: &Chain,
    assembly: &Assembly,
    drive: Drive<'_>,
    scheme: Scheme,
    rate_hz: f64,
) -> Result<Box<dyn Engine>, StepError> {
    let new = match chain.n {
        1 => boxed::<1>,
        2 => boxed::<2>,
        3 => boxed::<3>,
        4 => boxed::<4>,
        5 => boxed::<5>,
        6 => boxed::<6>,
        7 => boxed::<7>,
        _ => boxed::<8>,
    };
    new(chain, assembly, drive, scheme, rate_hz)
}

fn boxed<const N: usize>(
    chain: &Chain,
    assembly: &Assembly,
    drive: Drive<'_>,
    scheme: Scheme,
    rate_hz: f64,
) -> Result<Box<dyn Engine>, StepError> {
    let (drive, driver) = match drive {
        Drive::Loads(dofs) => (dofs.iter().enumerate().map(|(load, dof)| (load, *dof, 1.0)).collect(), None),
        Drive::Shaker(driver) => (driver.armature.dofs().map(|(dof, share)| (0, dof, share)).collect(), Some(driver)),
    };
    let links = Links::<N>::new(chain, assembly, driver.as_ref().map(|driver| &driver.armature));
    let integrator = Integrator::new(scheme, rate_hz, &links)?;
    let motion = Motion { x: [0.0; N], v: [0.0; N] };
    Ok(Box::new(Stepped { links, integrator, drive, motion, driver }))
}

impl<const N: usize> Stepped<N> {
    /// A force at a point acts on every link up to it.
    pub(super) fn load(&self, load: &[f64]) -> LinksLoad<f64, N> {
        let mut torque_nm = [0.0; N];
        let mut force_n = [[0.0; 2]; N];
        for (number, dof, share) in &self.drive {
            let load = share * load.get(*number).copied().unwrap_or(0.0);
            if load == 0.0 {
                // Most loads of a structure under test are zero.
                continue;
            }
            match dof.0 {
                At::Joint(joint) => torque_nm[joint] += load,
                At::Point { links, axis } => {
                    let along = usize::from(axis == Axis::Y);
                    force_n[..links].iter_mut().for_each(|force| force[along] += load);
                }
                At::Shape(_) | At::Base(_) => {}
            }
        }
        LinksLoad { torque_nm, force_n }
    }

    /// Loads over a step, which follow a course.
    pub(super) fn driven<'a>(&self, course: Course<'a>, load: &[f64]) -> Driven<'a, N> {
        Driven { load: self.load(load), course }
    }

    pub(super) fn step(&self, t_s: f64, driven: &Driven<'_, N>) -> Result<Motion<f64, N>, StepError> {
        Ok(self.integrator.step(&self.links, t_s, &self.motion, driven)?)
    }

    /// The load at the state: with `current_a` in place of that of a coil.
    fn acting(&self, load: &[f64], current_a: Option<f64>) -> LinksLoad<f64, N> {
        let Some(driver) = &self.driver else { return self.load(load) };
        let coil = &driver.armature.coil;
        let current_a = current_a.unwrap_or_else(|| {
            // The velocity does not depend on the load, so any load will do to read it.
            let velocity_m_s = self.links.armature(&self.motion, &self.load(&[0.0])).velocity;
            coil.current_a(driver.current_a, load.first().copied().unwrap_or(0.0), velocity_m_s)
        });
        self.load(&[coil.force_factor_n_a() * current_a])
    }
}

/// Course of the loads over a step.
#[derive(Clone, Copy, Debug)]
pub(super) enum Course<'a> {
    /// Constant, multiplied by this factor.
    Held(f64),
    /// The loads vary as a step's load does.
    Step(&'a StepLoad<'a>),
    /// The load is the force of a coil, N.
    Coil { current: Current, force_factor_n_a: f64, start_s: f64, step_s: f64 },
}

/// The loads over a step: one type, so that every scheme is compiled once for all courses.
pub(super) struct Driven<'a, const N: usize> {
    load: LinksLoad<f64, N>,
    course: Course<'a>,
}

impl<const N: usize> Excitation<LinksLoad<f64, N>> for Driven<'_, N> {
    fn load(&self, t_s: f64) -> LinksLoad<f64, N> {
        let factor = match &self.course {
            Course::Held(factor) => *factor,
            Course::Step(load) => load.factor(t_s),
            Course::Coil { current, force_factor_n_a, start_s, step_s } => {
                force_factor_n_a * current.at((t_s - start_s) / step_s)
            }
        };
        self.load.times(factor)
    }

    fn is_constant(&self) -> bool {
        matches!(self.course, Course::Held(_) | Course::Step(StepLoad::Held(_)))
    }
}

impl<const N: usize> Engine for Stepped<N> {
    fn state(&self) -> StateRef<'_> {
        let coil = self.driver.as_ref().map_or(&[][..], |driver| core::slice::from_ref(&driver.current_a));
        StateRef { q: &self.motion.x, v: &self.motion.v, coil, z: &[], branches: &[] }
    }

    fn set(&mut self, state: StateRef) {
        self.motion.x.copy_from_slice(&state.q[..N]);
        self.motion.v.copy_from_slice(&state.v[..N]);
        if let (Some(driver), Some(current_a)) = (&mut self.driver, state.coil.first()) {
            driver.current_a = *current_a;
        }
    }

    fn advance(&mut self, t_s: f64, load: &StepLoad<'_>) -> Result<(), StepError> {
        let Some(driver) = &self.driver else {
            self.motion = self.step(t_s, &self.driven(Course::Step(load), load.numbers()))?;
            return Ok(());
        };
        let blocked_n = load.numbers().first().copied().unwrap_or(0.0);
        let (motion, current_a) = self.shaken(driver, t_s, blocked_n)?;
        self.motion = motion;
        if let Some(driver) = &mut self.driver {
            driver.current_a = current_a;
        }
        Ok(())
    }

    fn acceleration(&self, load: &[f64], current_a: Option<f64>, out: &mut [f64]) {
        let rates = self.links.rates(&self.motion, &self.acting(load, current_a));
        out.iter_mut().zip(rates.acceleration).for_each(|(out, acceleration)| *out = acceleration);
    }

    fn read(&self, load: &[f64], current_a: Option<f64>, dofs: &[Dof], out: &mut [Kinematics]) -> bool {
        self.links.read(&self.motion, &self.acting(load, current_a), dofs, out);
        true
    }

    fn advance_together(&self, steps: &SineSteps<'_>, states: &mut [Vec<f64>]) -> bool {
        if const { N <= lanes::MOST_LINKS } && self.driver.is_none() && self.integrator.scheme() == Scheme::Dop853 {
            lanes::advance(&self.links, self.integrator.step_s(), &self.load(steps.amplitude), steps, states);
            return true;
        }
        false
    }

    fn boxed_clone(&self) -> Box<dyn Engine> {
        Box::new(self.clone())
    }
}
