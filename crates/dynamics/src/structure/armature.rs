//! A shaker's armature, bolted to a structure: a mass on a spring and a damper to the ground, with a coil, that follows
//! a point along a direction.
//!
//! With its displacement s(q) from rest, w = ∂s/∂q and the coil's force f, it acts on the structure by
//!
//! ```text
//! f − m s̈ − c ṡ − k s        s̈ = wᵀq̈ + q̇ᵀ ∂²s/∂q² q̇
//! ```
//!
//! so that M becomes M + m wwᵀ and the generalised force w (f − m q̇ᵀ∂²s/∂q² q̇ − c ṡ − k s). A command is the
//! force F of the blocked armature. An amplifier that holds the current makes f = F; one that holds the voltage makes
//!
//! ```text
//! f = Bl i        L di/dt = R (F/Bl − i) − Bl ṡ
//! ```
//!
//! and without inductance f = F − (Bl²/R) ṡ (G. F. Lang, "Electrodynamic Shaker Fundamentals", Sound and Vibration,
//! 1997).

use super::assembly::Assembly;
use super::dof::Dof;
use super::limits::MOST_COORDINATES;
use super::linear::Linear;
use super::position::Position;

/// The coil of a shaker and what its amplifier holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Coil {
    /// The amplifier holds the current.
    Current {
        /// Force factor Bl, N/A, positive.
        force_factor_n_a: f64,
    },
    /// The amplifier holds the voltage.
    Voltage {
        /// Force factor Bl, N/A, positive.
        force_factor_n_a: f64,
        /// Resistance R, Ω, positive.
        resistance_ohm: f64,
        /// Inductance L, H, not negative.
        inductance_h: f64,
    },
}

/// A shaker's armature on a structure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Armature {
    /// Degrees of freedom along which it moves with the structure, with their shares in its direction: s = Σ share ·
    /// displacement. Those of one point along orthogonal axes have the components of a unit vector as shares.
    pub along: [Option<(Dof, f64)>; 2],
    /// m, kg, not negative.
    pub mass_kg: f64,
    /// k, N/m, not negative.
    pub stiffness_n_m: f64,
    /// c, N·s/m, not negative.
    pub damping_n_s_m: f64,
    /// The coil, and what its amplifier holds.
    pub coil: Coil,
}

/// Effect of an armature beside adding to the mass.
pub(super) struct Push {
    /// Force on the structure, along the armature, N.
    pub force_n: f64,
    /// di/dt, A/s, where the current is a state; else zero.
    pub current_a_s: f64,
}

/// The motion of an armature at an instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ArmatureMotion {
    /// Displacement s from rest, m.
    pub displacement_m: f64,
    /// Velocity ṡ of the armature, m/s.
    pub velocity_m_s: f64,
    /// The part of s̈ that is due to the velocity, q̇ᵀ ∂²s/∂q² q̇, m/s².
    pub drift_m_s2: f64,
}

impl Coil {
    /// Force factor Bl of the coil, N/A.
    pub const fn force_factor_n_a(&self) -> f64 {
        match *self {
            Coil::Current { force_factor_n_a } | Coil::Voltage { force_factor_n_a, .. } => force_factor_n_a,
        }
    }

    /// R, Ω, in voltage mode; else zero.
    pub(super) const fn resistance_ohm(&self) -> f64 {
        match *self {
            Coil::Current { .. } => 0.0,
            Coil::Voltage { resistance_ohm, .. } => resistance_ohm,
        }
    }

    /// R/L, 1/s, if the current has a rate of its own: in voltage mode with inductance.
    pub(super) fn rate_1_s(&self) -> Option<f64> {
        match *self {
            Coil::Voltage { resistance_ohm, inductance_h, .. } if inductance_h > 0.0 => {
                Some(resistance_ohm / inductance_h)
            }
            _ => None,
        }
    }

    /// Bl/R, A·s/m, in voltage mode: how much less the current is for the velocity of the armature; else zero.
    fn back_a_s_m(&self) -> f64 {
        match *self {
            Coil::Current { .. } => 0.0,
            Coil::Voltage { force_factor_n_a, resistance_ohm, .. } => force_factor_n_a / resistance_ohm,
        }
    }

    /// Bl²/R, N·s/m, the damping by a coil in voltage mode whose current has no rate of its own; else zero.
    pub(super) fn drag_n_s_m(&self) -> f64 {
        if self.rate_1_s().is_some() { 0.0 } else { self.force_factor_n_a() * self.back_a_s_m() }
    }

    /// The current to which the amplifier drives it, A: F/Bl − Bl ṡ/R in voltage mode, else F/Bl.
    pub fn settled_a(&self, blocked_n: f64, velocity_m_s: f64) -> f64 {
        // F/Bl is V/R: the command F is the force of the blocked armature, in which the voltage V drives V/R.
        blocked_n / self.force_factor_n_a() - self.back_a_s_m() * velocity_m_s
    }

    /// The current at an instant, A: `state_a`, where it is a state.
    pub fn current_a(&self, state_a: f64, blocked_n: f64, velocity_m_s: f64) -> f64 {
        if self.rate_1_s().is_some() { state_a } else { self.settled_a(blocked_n, velocity_m_s) }
    }

    /// The force of the blocked armature, N, to which a current that is no state belongs.
    pub(super) fn blocked_n(&self, current_a: f64, velocity_m_s: f64) -> f64 {
        self.force_factor_n_a() * (current_a + self.back_a_s_m() * velocity_m_s)
    }
}

impl Armature {
    /// The degrees of freedom along which it moves, with their shares.
    pub fn dofs(&self) -> impl Iterator<Item = (Dof, f64)> {
        self.along.into_iter().flatten()
    }

    /// Writes w at a position of the structure, n numbers: m over the coordinates' unit.
    pub fn direction(&self, at: &Position<'_>, out: &mut [f64]) {
        let mut row = [0.0; MOST_COORDINATES];
        out.fill(0.0);
        for (dof, share) in self.dofs() {
            at.direction(dof, &mut row);
            out.iter_mut().zip(row).for_each(|(out, w)| *out += share * w);
        }
    }

    /// Returns the motion of the armature at a position and velocity of the structure.
    pub fn motion(&self, at: &Position<'_>, v: &[f64]) -> ArmatureMotion {
        let mut motion = ArmatureMotion::default();
        for (dof, share) in self.dofs() {
            motion.displacement_m += share * at.displacement(dof);
            motion.velocity_m_s += share * at.velocity(dof, v);
            motion.drift_m_s2 += share * at.drift(dof, v);
        }
        motion
    }

    /// s̈ at a velocity and an acceleration of the structure, m/s².
    pub fn acceleration_m_s2(&self, at: &Position<'_>, v: &[f64], a: &[f64]) -> f64 {
        self.dofs().map(|(dof, share)| share * at.acceleration(dof, v, a)).sum()
    }

    /// Returns the part of the coil's force that acts on the structure beside m s̈ of q̈, N.
    pub(super) fn push_n(&self, coil_n: f64, motion: &ArmatureMotion) -> f64 {
        let ArmatureMotion { displacement_m, velocity_m_s, drift_m_s2 } = *motion;
        coil_n - self.mass_kg * drift_m_s2 - self.damping_n_s_m * velocity_m_s - self.stiffness_n_m * displacement_m
    }

    /// Returns the effect of the armature at a position and velocity of the structure, a current and a command.
    pub(super) fn push(&self, at: &Position<'_>, v: &[f64], state_a: f64, blocked_n: f64) -> Push {
        let coil = &self.coil;
        let motion = self.motion(at, v);
        let current_a = coil.current_a(state_a, blocked_n, motion.velocity_m_s);
        // L di/dt = R (F/Bl − i) − Bl ṡ is R times the settled current less i, so that R/L is its rate.
        let settled_a = coil.settled_a(blocked_n, motion.velocity_m_s);
        let force_n = self.push_n(coil.force_factor_n_a() * current_a, &motion);
        Push { force_n, current_a_s: coil.rate_1_s().map_or(0.0, |rate_1_s| rate_1_s * (settled_a - current_a)) }
    }

    /// Bounds of what it adds to ω² of the fastest motion, 1/s², and of its decay rate, 1/s: k, with Bl²/L of a coil,
    /// and c, with Bl²/R, over the mass that it meets.
    pub(super) fn bounds(&self, of: &Assembly) -> [f64; 2] {
        // wᵀ(M + m wwᵀ)⁻¹w = wᵀM⁻¹w/(1 + m wᵀM⁻¹w) (J. Sherman, W. J. Morrison, 1950): the armature's own mass counts
        // in what its spring and coil move.
        let mobility = self.mobility_1_kg(of) * self.high_frequency_force_share(of);
        // Bl²/L: much faster than R/L the coil obeys L di/dt = −Bl ṡ, so i = −Bl s/L, and its force −(Bl²/L) s is
        // that of a spring.
        let coil_n_m = self
            .coil
            .rate_1_s()
            .map_or(0.0, |rate_1_s| rate_1_s * self.coil.force_factor_n_a() * self.coil.back_a_s_m());
        let damping_n_s_m = self.damping_n_s_m + self.coil.drag_n_s_m();
        [mobility * (self.stiffness_n_m + coil_n_m), mobility * damping_n_s_m]
    }

    /// The linear part of a structure at rest with the armature on it, without its coil.
    pub(super) fn linear(&self, of: &Assembly) -> Linear {
        let n = of.coordinates();
        let rest = [0.0; MOST_COORDINATES];
        let mut w = [0.0; MOST_COORDINATES];
        self.direction(&of.at(&rest[..n]), &mut w[..n]);
        let mut linear = of.linear();
        // Each gives a matrix of rank 1 along w. The spring's share by the curvature of s is zero, since s = 0 at
        // rest.
        let own = [self.mass_kg, self.damping_n_s_m, self.stiffness_n_m];
        for (matrix, own) in [&mut linear.mass, &mut linear.damping, &mut linear.stiffness].into_iter().zip(own) {
            matrix.iter_mut().enumerate().for_each(|(k, entry)| *entry += own * w[k / n] * w[k % n]);
        }
        linear
    }

    /// The energy of the armature, its spring and the field of its coil at a current, J.
    pub fn energy_j(&self, motion: &ArmatureMotion, current_a: f64) -> f64 {
        let ArmatureMotion { displacement_m: s, velocity_m_s: rate, .. } = *motion;
        // A current that the amplifier holds is no state: the field's energy is the amplifier's, and does not belong to
        // the motion.
        let inductance_h = match self.coil {
            Coil::Current { .. } => 0.0,
            Coil::Voltage { inductance_h, .. } => inductance_h,
        };
        0.5 * (self.mass_kg * (rate * rate) + self.stiffness_n_m * (s * s) + inductance_h * (current_a * current_a))
    }

    /// Share of the coil's force that goes through the armature into the structure far above the natural frequencies:
    /// 1/(1 + m wᵀM⁻¹w) at rest.
    pub fn high_frequency_force_share(&self, of: &Assembly) -> f64 {
        1.0 / (1.0 + self.mass_kg * self.mobility_1_kg(of))
    }

    /// wᵀM⁻¹w of the structure alone at rest, 1/kg; not a number if M can't be factored.
    pub(super) fn mobility_1_kg(&self, of: &Assembly) -> f64 {
        let n = of.coordinates();
        let rest = [0.0; MOST_COORDINATES];
        let mut w = [0.0; MOST_COORDINATES];
        let mut mass = of.linear().mass;
        self.direction(&of.at(&rest[..n]), &mut w[..n]);
        let mut solved = w;
        match super::modes::cholesky(n, &mut mass) {
            Some(()) => super::modes::solve_cholesky(n, &mass, &mut solved[..n]),
            None => solved.fill(f64::NAN),
        }
        w.iter().zip(solved).take(n).map(|(w, solved)| w * solved).sum()
    }
}
