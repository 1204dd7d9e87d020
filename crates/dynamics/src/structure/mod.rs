//! Structures: a planar chain of links with compliant joints, or vibration modes; with point elements, linear or not,
//! between two of their points or a point and the ground.
//!
//! A [`StructureSpec`] says what a structure is made of, an [`Assembly`] is a valid one. Its equation of motion in n
//! coordinates q, counted from rest, is
//!
//! ```text
//! M(q) q̈ + c(q, q̇) + D q̇ + K q + g(q) − g(0) + Σ w(q) f(x, ẋ, z) = p
//! ```
//!
//! with the generalised forces p, and for each element its force f, its displacement x(q) from rest, w = ∂x/∂q, and
//! for some an inner state z. A polynomial element has several displacements, and a force w ∂V/∂x along each of them.
//! The left side without the elements, less p, is the *unbalance*.
//!
//! A chain has the deflections of its joints as coordinates, rad; modes have modal coordinates, m·√kg.

mod angle;
mod armature;
mod assembly;
mod body;
mod chain;
mod check;
mod coil;
mod dof;
mod element;
mod error;
mod limits;
mod linear;
mod links;
mod modal;
mod modes;
mod parameter;
mod parameter_values;
mod polynomial;
mod position;
mod preset;
mod smooth;
mod spec;
mod step;

pub use armature::{Armature, ArmatureMotion, Coil};
pub use assembly::{Assembly, CoordinateUnit};
pub use coil::{Circuit, Current, LEAST_DECAY, Stroke};
pub use dof::Dof;
pub use element::{Branch, Element, Reaction, StateRate};
pub use error::StructureError;
pub use limits::{MOST_COORDINATES, MOST_ELEMENTS, MOST_LINKS, MOST_MODES};
pub use linear::{Linear, Linearised};
pub use modal::mode_transient;
pub use modes::StructureMode;
pub use parameter::Parameter;
pub use polynomial::{LEAST_DEGREE, MOST_DEGREE, MOST_DISPLACEMENTS, MOST_TERMS, Polynomial, falls_along};
pub use position::{Kinematics, Position};
pub use preset::Preset;
pub use spec::{
    Axis, BASE, BodySpec, ChainSpec, ElementSpec, Law, Link, ModalSpec, ModeSpec, Place, ShapeSpec, Side,
    StructureSpec, Term,
};
pub use step::{LoadHarmonic, MOST_LOAD_HARMONICS, STAGE_TIMES, SineSteps, StepError, StepLoad, Stepper};

#[cfg(test)]
mod tests;
