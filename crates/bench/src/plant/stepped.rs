//! What a structure does that makes integration steps.

use alloc::boxed::Box;
use core::fmt;

use crate::rig::Load;
use crate::structure::{Channel, LoadSet, StructureError};
use resonarm_dynamics::structure::Kinematics;

/// A structure that makes integration steps. [`Plant::stepped`](super::Plant::stepped) adds an ideal exciter,
/// converters and instruments to it.
///
/// The same loads give the same bits, from a saved state on, too. In a run in real time nothing of it may allocate,
/// lock or block.
pub trait Stepped: fmt::Debug + Send + Sync {
    /// The states from which, with the loads, all later ones follow: coordinates, their rates, states of elements.
    fn states(&self) -> &[Channel];

    /// The loads that it can take: without this method those of the native protocol.
    fn inputs(&self) -> LoadSet {
        LoadSet::NATIVE
    }

    /// One integration step from the time `t_s`, s, with the load held.
    ///
    /// # Errors
    /// [`StructureError`]; the caller then restores the state before.
    fn advance(&mut self, t_s: f64, load: &Load) -> Result<(), StructureError>;

    /// The channels of the sensors beside B and C; without this method there are none.
    fn sensors(&self) -> &[Channel] {
        &[]
    }

    /// Writes the motion that the sensors read at the time `t_s`, s, under the load, a degree of freedom each: B x, y;
    /// C x, y; then [`Stepped::sensors`]. Of B and C the displacements are not needed.
    ///
    /// # Errors
    /// [`StructureError`] if it can't take a load, or its equations can't be solved.
    fn read(&self, t_s: f64, load: &Load, out: &mut [Kinematics]) -> Result<(), StructureError>;

    /// The acceleration along a degree of freedom at the start of the first step of a hold, of length `step_s`, s, under
    /// the loads of the hold, of a structure that knows it only afterwards: given are velocity and acceleration that were
    /// read at the start and at the end.
    fn acceleration_at_start(&self, _velocity: [f64; 2], [at_start, _]: [f64; 2], _step_s: f64) -> f64 {
        at_start
    }

    /// The distance of the point that the exciter acts on from rest, m, without sign.
    fn travel_m(&self) -> f64;

    /// Writes the states, as many as there are channels.
    fn save(&self, states: &mut [f64]);

    /// Takes up states, as many as there are channels, all finite.
    ///
    /// # Errors
    /// [`StructureError`] if it can't be in them; nothing changes then.
    fn restore(&mut self, states: &[f64]) -> Result<(), StructureError>;

    /// A copy in the same state.
    fn boxed_clone(&self) -> Box<dyn Stepped>;
}

impl Clone for Box<dyn Stepped> {
    fn clone(&self) -> Box<dyn Stepped> {
        self.boxed_clone()
    }
}
