//! Point elements: their force, its derivatives, their energy, and the branches that they are smooth on.
//!
//! A law with a preload is that without at another displacement, less the force at rest; see [`Law::seat`].
//!
//! On each [`Branch`] a law is an analytic function, which holds a little beyond the branch too: what an integrator
//! needs that makes a step with the branch frozen and then looks for where it ends, where a *margin* becomes negative.

use super::dof::Dof;
use super::spec::{Law, Side};

/// The part of its law that an element is on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Branch {
    /// Within the gap; open; sticking. A smooth law has this branch alone.
    #[default]
    Inner,
    /// Beyond the gap at positive displacement; in contact; slipping, or moving, in positive direction.
    Upper,
    /// Beyond the gap at negative displacement; slipping, or moving, in negative direction.
    Lower,
}

/// The force of an element and its derivatives; units are those of [`Law`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reaction {
    /// f, which acts on the structure as −f.
    pub force: f64,
    /// ∂f/∂x, the stiffness there.
    pub by_position: f64,
    /// ∂f/∂v, the damping there.
    pub by_velocity: f64,
    /// ∂f/∂z, by the inner state.
    pub by_state: f64,
}

/// The rate of an element's state and its derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StateRate {
    /// ż, the rate of the inner state.
    pub rate: f64,
    /// ∂ż/∂v, by the velocity.
    pub by_velocity: f64,
    /// ∂ż/∂z, by the state itself.
    pub by_state: f64,
}

/// Distance of an element from leaving its branch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Margin {
    /// Negative beyond the branch.
    pub value: f64,
    /// Rate of the margin, where it goes with the displacement or the state; of one that goes with the velocity none.
    pub rate: Option<f64>,
    /// The branch that the element is on then.
    pub to: Branch,
}

/// An element of an [`Assembly`](super::Assembly) with one displacement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Element {
    /// The number of the element in the structure, from 1: polynomials count, too.
    pub number: usize,
    /// The law of its force.
    pub law: Law,
    /// Degree of freedom at which it acts.
    pub at: Dof,
    /// The other end; `None` is the ground.
    pub to: Option<Dof>,
    /// The place of its state among those of the assembly, if it has one.
    pub state: Option<usize>,
}

impl Element {
    /// Returns the element's state among those of the assembly; 0 for a law without.
    pub(super) fn own(&self, states: &[f64]) -> f64 {
        self.state.map_or(0.0, |state| states[state])
    }

    /// Returns the force at a displacement from rest, a velocity and a state (0 for a law without).
    pub fn force(&self, position: f64, velocity: f64, state: f64) -> Reaction {
        self.law.reaction(self.law.branch(position, velocity, state), position, velocity, state)
    }

    /// The rate of its state; zero for a law without.
    pub fn state_rate(&self, position: f64, velocity: f64, state: f64) -> StateRate {
        self.law.state_rate(self.law.branch(position, velocity, state), velocity, state)
    }
}

/// x beyond a gap on either side.
fn beyond(position: f64, gap: f64) -> f64 {
    (position - gap).max(0.0) + (position + gap).min(0.0)
}

/// x^1.5, zero below 0.
fn power_three_halves(x: f64) -> f64 {
    if x > 0.0 { x * libm::sqrt(x) } else { 0.0 }
}

/// g(v) of LuGre and its derivative.
fn stribeck_force(coulomb: f64, breakaway: f64, stribeck: f64, velocity: f64) -> (f64, f64) {
    let ratio = velocity / stribeck;
    let bell = (breakaway - coulomb) * libm::exp(-ratio * ratio);
    (coulomb + bell, -2.0 * ratio / stribeck * bell)
}

impl Law {
    /// Returns the displacement from where the element is unloaded to rest, m or rad, and its force at rest, N or N·m, if
    /// there is a preload: its force at x is that of a law without at x and this displacement, less this force.
    pub fn seat(&self) -> Option<[f64; 2]> {
        match *self {
            Law::Gap { stiffness, gap, preload } if preload != 0.0 => {
                // Pressed beyond the gap by |F|/k, on the side towards which F points.
                Some([libm::copysign(gap + preload.abs() / stiffness, preload), preload])
            }
            Law::KelvinVoigt { stiffness, side, preload, .. } if preload != 0.0 => {
                Some([side.sign() * (preload / stiffness), side.sign() * preload])
            }
            Law::HuntCrossley { stiffness, side, preload, .. } if preload != 0.0 => {
                // k δ^1.5 = F.
                let root = libm::cbrt(preload / stiffness);
                Some([side.sign() * (root * root), side.sign() * preload])
            }
            _ => None,
        }
    }

    /// The displacement from where the element is unloaded.
    fn unseated(&self, position: f64) -> f64 {
        self.seat().map_or(position, |[seat, _]| position + seat)
    }

    /// The branch that an element is on. Where two meet, the one that the motion leads into.
    pub(super) fn branch(&self, position: f64, velocity: f64, state: f64) -> Branch {
        let position = self.unseated(position);
        let by_sign = |up: bool, down: bool| match (up, down) {
            (true, _) => Branch::Upper,
            (_, true) => Branch::Lower,
            _ => Branch::Inner,
        };
        match *self {
            Law::Cubic { .. } | Law::Linear { .. } | Law::Tanh { .. } => Branch::Inner,
            // Without a gap it is a spring on both sides.
            Law::Gap { gap, .. } => by_sign(gap == 0.0 || position > gap, position < -gap),
            Law::KelvinVoigt { .. } | Law::HuntCrossley { .. } => {
                let [pressed, pushing] = self.contact(position, velocity);
                by_sign(pressed > 0.0 && pushing > 0.0, false)
            }
            Law::Friction { stiffness, slip } => {
                let most = slip / stiffness;
                // At its limit it slips while it moves outwards; as soon as it turns back, it sticks.
                by_sign(state >= most && velocity > 0.0, state <= -most && velocity < 0.0)
            }
            // |v| has a kink at v = 0, so each direction is a branch.
            Law::Lugre { .. } => by_sign(velocity >= 0.0, true),
        }
    }

    /// δ, and what else must be positive for a contact to push: (k δ + c δ̇)/k, or 1 + λ δ̇.
    fn contact(&self, position: f64, velocity: f64) -> [f64; 2] {
        match *self {
            Law::KelvinVoigt { stiffness, damping, gap, side, .. } => {
                let (depth, rate) = pressed(side, position, velocity, gap);
                [depth, depth + damping / stiffness * rate]
            }
            Law::HuntCrossley { damping, gap, side, .. } => {
                let (depth, rate) = pressed(side, position, velocity, gap);
                [depth, 1.0 + damping * rate]
            }
            _ => [0.0, 0.0],
        }
    }

    /// The margins of a branch: the element leaves it where one becomes negative.
    pub(super) fn margins(&self, branch: Branch, position: f64, velocity: f64, state: f64) -> [Option<Margin>; 2] {
        use Branch::{Inner, Lower, Upper};
        let position = self.unseated(position);
        let moving = |value: f64, rate: f64, to: Branch| Some(Margin { value, rate: Some(rate), to });
        let turning = |value: f64, to: Branch| [Some(Margin { value, rate: None, to }), None];
        match (*self, branch) {
            (Law::Gap { gap: 0.0, .. } | Law::Cubic { .. } | Law::Linear { .. } | Law::Tanh { .. }, _) => [None, None],
            (Law::Gap { gap, .. }, Inner) => {
                [moving(gap - position, -velocity, Upper), moving(gap + position, velocity, Lower)]
            }
            (Law::Gap { gap, .. }, Upper) => [moving(position - gap, velocity, Inner), None],
            (Law::Gap { gap, .. }, Lower) => [moving(-position - gap, -velocity, Inner), None],
            (Law::KelvinVoigt { side, .. } | Law::HuntCrossley { side, .. }, Inner) => {
                let [pressed, pushing] = self.contact(position, velocity);
                // The contact closes where both are positive, that is, where the smaller one is.
                // For Hunt–Crossley one is a length and the other a number: only the sign of the smaller one counts.
                [moving(-pressed.min(pushing), -side.sign() * velocity, Upper), None]
            }
            (Law::KelvinVoigt { side, .. } | Law::HuntCrossley { side, .. }, _) => {
                let [pressed, pushing] = self.contact(position, velocity);
                // A damped contact lets go where it would begin to pull, even while it is still pressed.
                let pushing = Margin { value: pushing, rate: None, to: Inner };
                [moving(pressed, side.sign() * velocity, Inner), Some(pushing)]
            }
            (Law::Friction { stiffness, slip }, Inner) => {
                let most = slip / stiffness;
                [moving(most - state, -velocity, Upper), moving(most + state, velocity, Lower)]
            }
            (Law::Friction { .. }, Upper) => turning(velocity, Inner),
            (Law::Friction { .. }, Lower) => turning(-velocity, Inner),
            (Law::Lugre { .. }, Lower) => turning(-velocity, Upper),
            (Law::Lugre { .. }, _) => turning(velocity, Lower),
        }
    }

    /// Returns the force on a branch, which goes on smoothly beyond it.
    pub fn reaction(&self, branch: Branch, position: f64, velocity: f64, state: f64) -> Reaction {
        let reaction = self.unseated_reaction(branch, self.unseated(position), velocity, state);
        let at_rest = self.seat().map_or(0.0, |[_, force]| force);
        Reaction { force: reaction.force - at_rest, ..reaction }
    }

    /// The force on a branch at a displacement from where the element is unloaded, with the preload.
    fn unseated_reaction(&self, branch: Branch, position: f64, velocity: f64, state: f64) -> Reaction {
        let spring = |force: f64, by_position: f64| Reaction { force, by_position, ..Reaction::default() };
        match *self {
            Law::Cubic { stiffness3, stiffness5 } => {
                let square = position * position;
                let by_position = square * (3.0 * stiffness3 + 5.0 * stiffness5 * square);
                spring(position * square * (stiffness3 + stiffness5 * square), by_position)
            }
            Law::Gap { stiffness, gap, .. } => match branch {
                Branch::Inner => Reaction::default(),
                Branch::Upper => spring(stiffness * (position - gap), stiffness),
                Branch::Lower => spring(stiffness * (position + gap), stiffness),
            },
            Law::KelvinVoigt { .. } | Law::HuntCrossley { .. } if branch == Branch::Inner => Reaction::default(),
            Law::KelvinVoigt { stiffness, damping, gap, side, .. } => {
                let (depth, rate) = pressed(side, position, velocity, gap);
                let force = side.sign() * (stiffness * depth + damping * rate);
                Reaction { force, by_position: stiffness, by_velocity: damping, by_state: 0.0 }
            }
            Law::HuntCrossley { stiffness, damping, gap, side, .. } => {
                let (depth, rate) = pressed(side, position, velocity, gap);
                let power = power_three_halves(depth);
                let pushing = 1.0 + damping * rate;
                Reaction {
                    force: side.sign() * stiffness * power * pushing,
                    by_position: 1.5 * stiffness * libm::sqrt(depth.max(0.0)) * pushing,
                    by_velocity: stiffness * power * damping,
                    by_state: 0.0,
                }
            }
            Law::Friction { stiffness, slip } => match branch {
                Branch::Inner => Reaction { force: stiffness * state, by_state: stiffness, ..Reaction::default() },
                Branch::Upper => spring(slip, 0.0),
                Branch::Lower => spring(-slip, 0.0),
            },
            Law::Lugre { bristle_stiffness, bristle_damping, viscous, .. } => {
                let rate = self.state_rate(branch, velocity, state);
                Reaction {
                    force: bristle_stiffness * state + bristle_damping * rate.rate + viscous * velocity,
                    by_position: 0.0,
                    by_velocity: bristle_damping * rate.by_velocity + viscous,
                    by_state: bristle_stiffness + bristle_damping * rate.by_state,
                }
            }
            Law::Linear { stiffness, damping } => Reaction {
                force: stiffness * position + damping * velocity,
                by_position: stiffness,
                by_velocity: damping,
                by_state: 0.0,
            },
            Law::Tanh { slip, velocity: scale } => {
                let share = libm::tanh(velocity / scale);
                // 1 − tanh² as a product, without cancellation where tanh is near ±1.
                let by_velocity = slip / scale * (1.0 - share) * (1.0 + share);
                Reaction { force: slip * share, by_velocity, ..Reaction::default() }
            }
        }
    }

    /// Returns what the law adds to the linear structure at rest.
    pub(super) fn at_rest(&self) -> Reaction {
        match *self {
            Law::Lugre { viscous, .. } => Reaction { by_velocity: viscous, ..Reaction::default() },
            // A preload keeps the element closed in small vibrations.
            _ if self.is_smooth() || self.seat().is_some() => self.reaction(self.branch(0.0, 0.0, 0.0), 0.0, 0.0, 0.0),
            _ => Reaction::default(),
        }
    }

    /// ż on a branch.
    pub(super) fn state_rate(&self, branch: Branch, velocity: f64, state: f64) -> StateRate {
        match *self {
            Law::Friction { .. } if branch == Branch::Inner => {
                StateRate { rate: velocity, by_velocity: 1.0, by_state: 0.0 }
            }
            Law::Lugre { bristle_stiffness, coulomb, breakaway, stribeck, .. } => {
                let (g, slope) = stribeck_force(coulomb, breakaway, stribeck, velocity);
                let sign = if branch == Branch::Lower { -1.0 } else { 1.0 };
                let by_state = -bristle_stiffness * (sign * velocity) / g;
                // With s = sign v: ∂/∂v of v − σ0 s v z/g(v) is 1 − σ0 s z (1/g − v g′/g²).
                StateRate {
                    rate: velocity + by_state * state,
                    by_velocity: 1.0 - bristle_stiffness * sign * state / g * (1.0 - velocity * slope / g),
                    by_state,
                }
            }
            _ => StateRate::default(),
        }
    }

    /// The steepest stiffness, N/m, and damping, N·s/m, that it may have within `reach_s`, s, and the rate at which its
    /// state decays, 1/s: of elements with a branch as if it were on the stiffest.
    pub(super) fn steepest(&self, position: f64, velocity: f64, reach_s: f64) -> [f64; 3] {
        let position = self.unseated(position);
        let reach = position.abs() + velocity.abs() * reach_s;
        match *self {
            Law::Cubic { stiffness3, stiffness5 } => {
                let square = reach * reach;
                [square * (3.0 * stiffness3.abs() + 5.0 * stiffness5.abs() * square), 0.0, 0.0]
            }
            Law::Gap { stiffness, .. } | Law::Friction { stiffness, .. } => [stiffness, 0.0, 0.0],
            Law::KelvinVoigt { stiffness, damping, .. } => [stiffness, damping, 0.0],
            Law::HuntCrossley { stiffness, damping, gap, side, .. } => {
                let depth = (side.sign() * position + velocity.abs() * reach_s - gap).max(0.0);
                let root = libm::sqrt(depth);
                let pushing = 1.0 + damping * velocity.abs();
                [1.5 * stiffness * root * pushing, stiffness * depth * root * damping, 0.0]
            }
            Law::Lugre { bristle_stiffness, bristle_damping, viscous, coulomb, .. } => {
                // g(v) is never below the Coulomb force, since the breakaway force is not, so this is the fastest
                // decay.
                let decay = bristle_stiffness * velocity.abs() / coulomb;
                [bristle_stiffness, bristle_damping + viscous, decay]
            }
            Law::Linear { stiffness, damping } => [stiffness, damping, 0.0],
            Law::Tanh { slip, velocity: scale } => [0.0, slip / scale, 0.0],
        }
    }

    /// The state where a branch begins: slipping friction keeps it.
    pub(super) fn state_on(&self, branch: Branch, state: f64) -> f64 {
        match (*self, branch) {
            (Law::Friction { stiffness, slip }, Branch::Upper) => slip / stiffness,
            (Law::Friction { stiffness, slip }, Branch::Lower) => -slip / stiffness,
            _ => state,
        }
    }

    /// The energy stored in an element, J. Where a contact would pull, its spring relaxes without a force, and that energy
    /// is lost.
    pub(super) fn energy_j(&self, position: f64, state: f64) -> f64 {
        let Some([seat, force]) = self.seat() else { return self.unseated_energy_j(position, state) };
        // Zero at rest: the work of the preload, and what it has stored, are left out.
        self.unseated_energy_j(position + seat, state) - self.unseated_energy_j(seat, state) - force * position
    }

    fn unseated_energy_j(&self, position: f64, state: f64) -> f64 {
        match *self {
            Law::Cubic { stiffness3, stiffness5 } => {
                let square = position * position;
                square * square * (0.25 * stiffness3 + stiffness5 * square / 6.0)
            }
            Law::Gap { stiffness, gap, .. } => {
                let stretch = beyond(position, gap);
                0.5 * stiffness * stretch * stretch
            }
            Law::KelvinVoigt { stiffness, gap, side, .. } => {
                let depth = (side.sign() * position - gap).max(0.0);
                0.5 * stiffness * depth * depth
            }
            Law::HuntCrossley { stiffness, gap, side, .. } => {
                let depth = side.sign() * position - gap;
                // ∫ k δ^1.5 dδ = ⅖ k δ^2.5.
                0.4 * stiffness * power_three_halves(depth) * depth
            }
            Law::Friction { stiffness, .. } | Law::Lugre { bristle_stiffness: stiffness, .. } => {
                0.5 * stiffness * state * state
            }
            Law::Linear { stiffness, .. } => 0.5 * stiffness * position * position,
            Law::Tanh { .. } => 0.0,
        }
    }
}

/// Returns how deep a contact is pressed, δ, negative where it is open, and its rate δ̇.
fn pressed(side: Side, position: f64, velocity: f64, gap: f64) -> (f64, f64) {
    (side.sign() * position - gap, side.sign() * velocity)
}
