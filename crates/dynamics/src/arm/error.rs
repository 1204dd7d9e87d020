//! Errors of the arm's parameters and pose.

use resonarm_numeric::number::short;
use thiserror::Error;

use crate::structure::StructureError;

/// Why a set of numbers is not an arm.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ArmError {
    /// A parameter is outside what is physically possible.
    #[error("arm parameter `{name}` is {got}: it must be {expected}", got = short(.got))]
    Parameter {
        /// The name of the parameter in a scenario.
        name: &'static str,
        /// The given value.
        got: f64,
        /// The valid values.
        expected: &'static str,
    },
    /// A value of an attachment is impossible.
    #[error("attachment: `{name}` is {got}: it must be {expected}", got = short(.got))]
    Attachment {
        /// The value.
        name: &'static str,
        /// The given value.
        got: f64,
        /// The valid values.
        expected: &'static str,
    },
    /// A pose angle is not a usable number.
    #[error("pose angle `{name}` is {got}: it must be a number from -360 to 360 degrees", got = short(.got))]
    Pose {
        /// The name of the angle in a scenario.
        name: &'static str,
        /// The given value, degrees.
        got: f64,
    },
    /// The springs can't hold the arm's weight in this pose.
    #[error(
        "the joints can't hold the arm's weight at {gravity_m_s2} m/s²: no stable equilibrium is found from this pose; \
         raise the stiffnesses or lower the masses", gravity_m_s2 = short(.gravity_m_s2))]
    Collapse {
        /// The acceleration of gravity, m/s².
        gravity_m_s2: f64,
    },
    /// The mass matrix of the straight arm can't be solved: its determinant is lost in rounding, or overflows.
    #[error(
        "the mass matrix of the straight arm has a determinant of {got:.1e} of the product of its inertias: it must be at least \
         {least:.0e}; raise `inertia1_kg_m2` or `inertia2_kg_m2`, or lower `mass2_kg`"
    )]
    SingularMass {
        /// det M over a3 (a1 − a3), dimensionless.
        got: f64,
        /// The valid values.
        least: f64,
    },
    /// A natural frequency vanishes or overflows.
    #[error(
        "the arm's natural frequencies come out as {:e} and {:e} Hz: they must be positive and finite; stiffnesses and inertias are out \
         of proportion",
        got_hz[0], got_hz[1]
    )]
    Frequencies {
        /// The two frequencies, Hz.
        got_hz: [f64; 2],
    },
    /// The chain has another number of links, or a centre of mass off its link's line.
    #[error(
        "the chain is no two-link arm: it has another number of links, or a centre of mass off the line of its link"
    )]
    NotTheArm,
    /// The chain is invalid.
    #[error(transparent)]
    Structure(#[from] StructureError),
}
