//! Points of a walk, and of a recording, on a structure, against the computed branch.

pub(crate) mod compare;
pub(crate) mod walk;

pub(crate) use crate::figures::captions::label;
pub(crate) use crate::read_at::displacement_unit;
use resonarm::structure::Dof;

/// The unit of a load at a degree of freedom.
pub(crate) fn load_unit(dof: Dof) -> &'static str {
    dof.load_unit()
}
