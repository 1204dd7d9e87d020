//! Chains with smooth elements: [`Links`] of every number of links behind one trait.

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::{Engine, StateRef, StepError, StepLoad};
use crate::integrate::{Dynamics, Excitation, IntegrateError, Integrator, Motion, Scheme};
use crate::structure::assembly::Assembly;
use crate::structure::chain::Chain;
use crate::structure::dof::{At, Dof};
use crate::structure::links::{Links, LinksLoad};
use crate::structure::spec::Axis;

/// A chain of N links in motion.
#[derive(Clone, Debug)]
struct Stepped<const N: usize> {
    links: Links<N>,
    integrator: Integrator<N>,
    drive: Vec<Dof>,
    motion: Motion<f64, N>,
}

pub(super) fn engine(
    chain: &Chain,
    assembly: &Assembly,
    drive: &[Dof],
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
    drive: &[Dof],
    scheme: Scheme,
    rate_hz: f64,
) -> Result<Box<dyn Engine>, StepError> {
    let links = Links::<N>::new(chain, assembly);
    let integrator = Integrator::new(scheme, rate_hz, &links).map_err(|error| match error {
        IntegrateError::RateTooLow { scheme, got_hz, needed_hz } => StepError::RateTooLow { scheme, got_hz, needed_hz },
        other => StepError::Integrate(other),
    })?;
    let motion = Motion { x: [0.0; N], v: [0.0; N] };
    Ok(Box::new(Stepped { links, integrator, drive: drive.to_vec(), motion }))
}

impl<const N: usize> Stepped<N> {
    /// A force at a point acts on every link up to it.
    fn load(&self, load: &[f64]) -> LinksLoad<f64, N> {
        let (mut torque_nm, mut force_n) = ([0.0; N], [[0.0; 2]; N]);
        for (dof, load) in self.drive.iter().zip(load) {
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
}

/// The loads over a step, held or a sine: one type, so that every scheme is compiled once for both.
struct Driven<'a, const N: usize> {
    load: LinksLoad<f64, N>,
    course: &'a StepLoad<'a>,
}

impl<const N: usize> Excitation<LinksLoad<f64, N>> for Driven<'_, N> {
    fn load(&self, t_s: f64) -> LinksLoad<f64, N> {
        let (mut load, factor) = (self.load, self.course.factor(t_s));
        load.torque_nm.iter_mut().chain(load.force_n.as_flattened_mut()).for_each(|of| *of *= factor);
        load
    }

    fn is_constant(&self) -> bool {
        matches!(self.course, StepLoad::Held(_))
    }
}

impl<const N: usize> Engine for Stepped<N> {
    fn state(&self) -> StateRef<'_> {
        StateRef { q: &self.motion.x, v: &self.motion.v, coil: &[], z: &[], branches: &[] }
    }

    fn set(&mut self, state: StateRef) {
        self.motion.x.copy_from_slice(&state.q[..N]);
        self.motion.v.copy_from_slice(&state.v[..N]);
    }

    fn advance(&mut self, t_s: f64, load: &StepLoad<'_>) -> Result<(), StepError> {
        let driven = Driven { load: self.load(load.numbers()), course: load };
        self.motion = self.integrator.step(&self.links, t_s, &self.motion, &driven)?;
        Ok(())
    }

    fn acceleration(&self, load: &[f64], _current_a: Option<f64>, out: &mut [f64]) {
        let rates = self.links.rates(&self.motion, &self.load(load));
        out.iter_mut().zip(rates.acceleration).for_each(|(out, acceleration)| *out = acceleration);
    }

    fn boxed_clone(&self) -> Box<dyn Engine> {
        Box::new(self.clone())
    }
}
