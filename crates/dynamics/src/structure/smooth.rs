//! Smooth elements of a chain, for one motion or the four stages of a step.

use alloc::vec::Vec;

use super::angle::Angle;
use super::chain::{Chain, Moving};
use super::dof::{At, Dof};
use super::element::{Branch, Element};
use super::polynomial::{MOST_DISPLACEMENTS, Polynomial};
use super::spec::{Axis, Law};
use crate::integrate::Motion;
use crate::real::Real;

/// A displacement of a chain of N links. It is a sum over joints and links,
///
/// ```text
/// x = Σ j_i q_i + Σ a_i (cos θ_i − cos θ₀_i) + Σ b_i (sin θ_i − sin θ₀_i)
/// ```
///
/// and so w by joints is j, and by the turns −a_i sin θ_i + b_i cos θ_i.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SmoothPlace<const N: usize> {
    joints: [f64; N],
    /// a and b, m.
    links_m: [[f64; 2]; N],
}

impl<const N: usize> SmoothPlace<N> {
    /// The sum of the displacements of some degrees of freedom, each with its share.
    pub fn along(dofs: impl Iterator<Item = (Dof, f64)>, chain: &Chain) -> SmoothPlace<N> {
        let mut own = SmoothPlace { joints: [0.0; N], links_m: [[0.0; 2]; N] };
        dofs.for_each(|(dof, share)| own.add(dof, share, chain));
        own
    }

    fn add(&mut self, dof: Dof, sign: f64, chain: &Chain) {
        match dof.0 {
            At::Joint(joint) => self.joints[joint] += sign,
            At::Point { links, axis } => {
                let along = usize::from(axis == Axis::Y);
                for (link, length_m) in self.links_m[..links].iter_mut().zip(chain.length_m) {
                    link[along] += sign * length_m;
                }
            }
            // A chain has no shapes, and its displacements count from the base.
            At::Shape(_) | At::Base(_) => {}
        }
    }

    /// Displacement x and velocity v.
    #[inline(always)]
    fn position_and_velocity<T: Real>(&self, motion: &Motion<T, N>, at: &Moving<T, N>, rest: &[Angle<T>; N]) -> (T, T) {
        let mut position = T::splat(0.0);
        let mut velocity = T::splat(0.0);
        for (i, Angle { sine, cosine }) in rest.iter().copied().enumerate() {
            let joint = T::splat(self.joints[i]);
            let [a, b] = self.links_m[i].map(T::splat);
            position =
                position + joint * motion.x[i] + at.turn[i].weighed(b * cosine - a * sine, a * cosine + b * sine);
            velocity = velocity + joint * motion.v[i] + (b * at.cosine[i] - a * at.sine[i]) * at.rate[i];
        }
        (position, velocity)
    }

    /// Takes a force from the torques at the joints and the forces on the turns.
    #[inline(always)]
    fn pull<T: Real>(&self, own: T, at: &Moving<T, N>, torque: &mut [T; N], force: &mut [T; N]) {
        for i in 0..N {
            let joint = T::splat(self.joints[i]);
            let [a, b] = self.links_m[i].map(T::splat);
            torque[i] = torque[i] - joint * own;
            force[i] = force[i] - (b * at.cosine[i] - a * at.sine[i]) * own;
        }
    }

    /// Returns w and q̇ᵀ ∂w/∂q, and adds `force` ∂w/∂φ to what is summed over the turns.
    fn slopes(&self, force: f64, at: &Moving<f64, N>, turning: &mut [f64; N]) -> [[f64; N]; 2] {
        let [mut w, mut drift] = [[0.0; N]; 2];
        let mut outer = 0.0;
        let mut outer_drift = 0.0;
        for i in (0..N).rev() {
            let [a, b] = self.links_m[i];
            let curvature = -(a * at.cosine[i] + b * at.sine[i]);
            // A joint turns its own link and all beyond it, so that the derivative by a joint is the sum over the turns
            // from there outwards.
            outer += b * at.cosine[i] - a * at.sine[i];
            outer_drift += curvature * at.rate[i];
            w[i] = self.joints[i] + outer;
            drift[i] = outer_drift;
            turning[i] += force * curvature;
        }
        [w, drift]
    }
}

/// A smooth element with one displacement.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SmoothElement<const N: usize> {
    law: Law,
    place: SmoothPlace<N>,
}

impl<const N: usize> SmoothElement<N> {
    pub fn new(element: &Element, chain: &Chain) -> SmoothElement<N> {
        let to = element.to.map(|to| (to, -1.0));
        let place = SmoothPlace::along([(element.at, 1.0)].into_iter().chain(to), chain);
        SmoothElement::at(element.law, place)
    }

    /// An element at a place.
    pub fn at(law: Law, place: SmoothPlace<N>) -> SmoothElement<N> {
        SmoothElement { law, place }
    }

    /// Takes its force from the torques at the joints and the forces on the turns; its power, f v.
    #[inline(always)]
    pub fn act<T: Real>(
        &self,
        motion: &Motion<T, N>,
        at: &Moving<T, N>,
        rest: &[Angle<T>; N],
        torque: &mut [T; N],
        force: &mut [T; N],
    ) -> T {
        let (position, velocity) = self.place.position_and_velocity(motion, at, rest);
        let own = self.law.smooth_force(position, velocity);
        self.place.pull(own, at, torque, force);
        own * velocity
    }

    /// Adds w ∂f/∂q = w (f_x wᵀ + f_v q̇ᵀ ∂w/∂q) and w f_v wᵀ to two N × N matrices by rows, and f ∂w/∂φ to what is
    /// summed over the turns.
    pub fn linearise(
        &self,
        motion: &Motion<f64, N>,
        at: &Moving<f64, N>,
        rest: &[Angle<f64>; N],
        [by_position, by_velocity]: [&mut [f64]; 2],
        turning: &mut [f64; N],
    ) {
        let (position, velocity) = self.place.position_and_velocity(motion, at, rest);
        let reaction = self.law.reaction(Branch::Inner, position, velocity, 0.0);
        let [w, drift] = self.place.slopes(reaction.force, at, turning);
        for row in 0..N {
            for column in 0..N {
                // The velocity v = wᵀq̇ changes with the position as well, since w turns with the links.
                let slope = reaction.by_position * w[column] + reaction.by_velocity * drift[column];
                by_position[row * N + column] += w[row] * slope;
                by_velocity[row * N + column] += reaction.by_velocity * w[row] * w[column];
            }
        }
    }
}

/// A polynomial element: its displacements and their forces.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SmoothPolynomial<const N: usize> {
    of: Polynomial,
    places: Vec<SmoothPlace<N>>,
}

impl<const N: usize> SmoothPolynomial<N> {
    pub fn new(of: &Polynomial, chain: &Chain) -> SmoothPolynomial<N> {
        let place = |dof: &Dof| SmoothPlace::along(core::iter::once((*dof, 1.0)), chain);
        SmoothPolynomial { of: of.clone(), places: of.at().iter().map(place).collect() }
    }

    /// The displacements and their velocities.
    #[inline(always)]
    fn motion<T: Real>(
        &self,
        motion: &Motion<T, N>,
        at: &Moving<T, N>,
        rest: &[Angle<T>; N],
    ) -> [[T; MOST_DISPLACEMENTS]; 2] {
        let [mut x, mut v] = [[T::splat(0.0); MOST_DISPLACEMENTS]; 2];
        for ((x, v), place) in x.iter_mut().zip(&mut v).zip(&self.places) {
            (*x, *v) = place.position_and_velocity(motion, at, rest);
        }
        [x, v]
    }

    /// Works like [`SmoothElement::act`] for all forces.
    #[inline(always)]
    pub fn act<T: Real>(
        &self,
        motion: &Motion<T, N>,
        at: &Moving<T, N>,
        rest: &[Angle<T>; N],
        torque: &mut [T; N],
        force: &mut [T; N],
    ) -> T {
        let [x, v] = self.motion(motion, at, rest);
        let mut power = T::splat(0.0);
        let forces = self.of.forces_in(&x);
        for ((place, own), velocity) in self.places.iter().zip(forces).zip(v) {
            place.pull(own, at, torque, force);
            power = power + own * velocity;
        }
        power
    }

    /// Adds Σ wᵢ ∂²V/∂xᵢ∂xⱼ wⱼᵀ to an N × N matrix by rows, and Σ fᵢ ∂wᵢ/∂φ to what is summed over the turns.
    pub fn linearise(
        &self,
        motion: &Motion<f64, N>,
        at: &Moving<f64, N>,
        rest: &[Angle<f64>; N],
        by_position: &mut [f64],
        turning: &mut [f64; N],
    ) {
        let [x, _] = self.motion(motion, at, rest);
        let size = self.places.len();
        let forces = self.of.forces_in(&x);
        let mut stiffness = [0.0; MOST_DISPLACEMENTS * MOST_DISPLACEMENTS];
        self.of.stiffness(&x[..size], &mut stiffness);
        let mut directions = [[0.0; N]; MOST_DISPLACEMENTS];
        for ((direction, place), force) in directions.iter_mut().zip(&self.places).zip(forces) {
            [*direction, _] = place.slopes(force, at, turning);
        }
        for (i, w) in directions[..size].iter().enumerate() {
            for (j, other) in directions[..size].iter().enumerate() {
                for row in 0..N {
                    let slope = w[row] * stiffness[i * size + j];
                    (0..N).for_each(|column| by_position[row * N + column] += slope * other[column]);
                }
            }
        }
    }
}

/// A mass m that moves as one end of a smooth element does, without a share of joints: with its displacement s, and w
/// and w′ its first and second derivatives by each turn, it adds m wwᵀ to the mass and takes the force m (Σ w′ φ̇²) w.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SmoothMass<const N: usize> {
    mass_kg: f64,
    along: SmoothPlace<N>,
}

/// The mass at a motion of the links.
pub(super) struct MovingMass<T, const N: usize> {
    /// The mass m, kg.
    pub mass_kg: T,
    /// w and w′ by each turn.
    pub direction: [T; N],
    curvature: [T; N],
}

impl<T: Real, const N: usize> MovingMass<T, N> {
    /// Entry i, j of m wwᵀ.
    #[inline(always)]
    pub fn between(&self, i: usize, j: usize) -> T {
        self.mass_kg * self.direction[i] * self.direction[j]
    }

    /// Σ w′ φ̇², the part of s̈ that is due to the velocity.
    #[inline(always)]
    pub fn drift(&self, at: &Moving<T, N>) -> T {
        let mut drift = T::splat(0.0);
        for i in 0..N {
            drift = drift + self.curvature[i] * (at.rate[i] * at.rate[i]);
        }
        drift
    }

    /// Σ w φ̇, or of other numbers of the turns.
    #[inline(always)]
    pub fn along(&self, of: &[T; N]) -> T {
        let mut sum = T::splat(0.0);
        for (direction, of) in self.direction.iter().zip(of) {
            sum = sum + *direction * *of;
        }
        sum
    }
}

impl<const N: usize> SmoothMass<N> {
    pub fn new(mass_kg: f64, along: SmoothPlace<N>) -> SmoothMass<N> {
        SmoothMass { mass_kg, along }
    }

    /// Displacement s from rest, m.
    pub fn displacement_m(&self, motion: &Motion<f64, N>, at: &Moving<f64, N>, rest: &[Angle<f64>; N]) -> f64 {
        self.along.position_and_velocity(motion, at, rest).0
    }

    #[inline(always)]
    pub fn at<T: Real>(&self, at: &Moving<T, N>) -> MovingMass<T, N> {
        let mut direction = [T::splat(0.0); N];
        let mut curvature = [T::splat(0.0); N];
        for i in 0..N {
            let [a, b] = self.along.links_m[i].map(T::splat);
            direction[i] = b * at.cosine[i] - a * at.sine[i];
            curvature[i] = -(a * at.cosine[i] + b * at.sine[i]);
        }
        MovingMass { mass_kg: T::splat(self.mass_kg), direction, curvature }
    }

    /// Adds the derivatives of w m s̈ by q and q̇ at q̈ to two N × N matrices by rows, and m s̈ w′ to what is summed over
    /// the turns: with s̈ = Σ w φ̈ + Σ w′ φ̇² and w″ = −w, ∂s̈/∂φ = w′ φ̈ − w φ̇² and ∂s̈/∂φ̇ = 2 w′ φ̇.
    pub fn linearise(
        &self,
        acceleration: &[f64; N],
        at: &Moving<f64, N>,
        [by_position, by_velocity]: [&mut [f64]; 2],
        turning: &mut [f64; N],
    ) {
        let own = self.at(at);
        // The turn of a link is the sum of the joints up to it, and so is its acceleration.
        let mut turned = *acceleration;
        for i in 1..N {
            turned[i] += turned[i - 1];
        }
        let force_n = self.mass_kg * (own.along(&turned) + own.drift(at));
        let mut w = [0.0; N];
        let mut slope = [0.0; N];
        let mut by_rate = [0.0; N];
        let mut outer = 0.0;
        let mut outer_slope = 0.0;
        let mut outer_rate = 0.0;
        for i in (0..N).rev() {
            let direction = own.direction[i];
            let curvature = own.curvature[i];
            let rate = at.rate[i];
            outer += direction;
            outer_slope += curvature * turned[i] - direction * (rate * rate);
            outer_rate += 2.0 * curvature * rate;
            w[i] = outer;
            slope[i] = outer_slope;
            by_rate[i] = outer_rate;
            turning[i] += force_n * curvature;
        }
        for row in 0..N {
            for column in 0..N {
                by_position[row * N + column] += self.mass_kg * w[row] * slope[column];
                by_velocity[row * N + column] += self.mass_kg * w[row] * by_rate[column];
            }
        }
    }
}

impl Law {
    /// The force of a smooth law, in every lane; zero of others.
    #[inline(always)]
    fn smooth_force<T: Real>(&self, position: T, velocity: T) -> T {
        match *self {
            Law::Cubic { stiffness3, stiffness5 } => {
                let square = position * position;
                position * square * (T::splat(stiffness3) + T::splat(stiffness5) * square)
            }
            Law::Linear { stiffness, damping } => T::splat(stiffness) * position + T::splat(damping) * velocity,
            Law::Tanh { slip, velocity: scale } => T::gather(|lane| slip * libm::tanh(velocity.lane(lane) / scale)),
            _ => T::splat(0.0),
        }
    }
}
