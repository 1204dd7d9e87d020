//! Errors of structures: impossible values, unknown names, elements that don't fit together.

use alloc::format;
use alloc::string::String;

use thiserror::Error;

use resonarm_numeric::number::short;

/// Error of a specification that is not a structure, or of a name that is not a place of it.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum StructureError {
    /// No parts of a kind, or too many.
    #[error("{part} has {got} {what}: it must have {least} to {most}")]
    Count {
        /// The part that has them: the structure, or an element.
        part: String,
        /// The parts: links, modes, shapes, elements, displacements, terms.
        what: &'static str,
        /// Number that is given.
        got: usize,
        /// Least number that is valid.
        least: usize,
        /// Largest number that is valid.
        most: usize,
    },
    /// A value is impossible.
    #[error("{part}: `{name}` is {got}: it must be {expected}", got = short(.got))]
    Value {
        /// The part that it belongs to, such as `link 2`.
        part: String,
        /// Name of the value.
        name: &'static str,
        /// Value that was given.
        got: f64,
        /// Description of the valid values.
        expected: &'static str,
    },
    /// A list with a number too few or too many: that of a shape, or the powers of a term of a polynomial.
    #[error("{part} has {got} numbers: it must have one for each of the {expected} {of}")]
    Numbers {
        /// The list, such as ``shape `tip.x` ``.
        part: String,
        /// Number that is given.
        got: usize,
        /// Number of modes or displacements, each of which needs a number.
        expected: usize,
        /// What each number belongs to: modes or displacements.
        of: &'static str,
    },
    /// The name of a point that names can't be made of.
    #[error("the name of a point is `{got}`: it must have at least one character, and no dot")]
    PointName {
        /// Name that was given.
        got: String,
    },
    /// Two shapes of one point and axis.
    #[error("the shape `{name}` is given twice: a point must have one for each axis")]
    ShapeTwice {
        /// Point and axis of the shapes.
        name: String,
    },
    /// No place has this name.
    #[error("there is no `{got}` in this structure: expected one of {known}")]
    UnknownPlace {
        /// Name that was given.
        got: String,
        /// Names of the places that there are.
        known: String,
    },
    /// No preset has this name.
    #[error("there is no preset `{got}`: expected one of {known}")]
    UnknownPreset {
        /// Name that was given.
        got: String,
        /// Names of all presets.
        known: String,
    },
    /// A preset's text can't be read.
    #[error("preset `{name}`: {reason}")]
    PresetText {
        /// The name of the preset.
        name: &'static str,
        /// Reason why the preset is invalid.
        reason: String,
    },
    /// Values count that the source of a chain does not state.
    #[error(
        "gravity, and a centre of mass of link {link} away from its joint, need values that the source of this chain does not \
         state: give {missing}{}", about_joint(*link, about_joint_kg_m2)
    )]
    Unstated {
        /// The number of the link, from 1.
        link: u8,
        /// The names of the values.
        missing: String,
        /// The moment of inertia about the joint, which the source states, if that about the centre of mass is missing,
        /// kg·m².
        about_joint_kg_m2: Option<f64>,
    },
    /// No parameter has this name.
    #[error("there is no parameter `{got}` in this structure: expected one of {known}")]
    UnknownParameter {
        /// Name that was given.
        got: String,
        /// Names of the parameters that there are.
        known: String,
    },
    /// A joint that the structure doesn't have.
    #[error("there is no joint {got}: the chain has joints 1 to {most}")]
    UnknownJoint {
        /// The joint that was given, counted from 1.
        got: usize,
        /// The number of joints.
        most: usize,
    },
    /// A joint of a structure without joints.
    #[error("there is no joint {got}: a structure of modes has no joints; name a point and an axis")]
    NoJoints {
        /// The joint that was given, counted from 1.
        got: usize,
    },
    /// An element at a place that doesn't move.
    #[error("element {element} acts at `{place}`, which doesn't move: leave `to` out for the ground")]
    Fixed {
        /// The number of the element, from 1.
        element: usize,
        /// Name of the place.
        place: String,
    },
    /// An element between a joint and a point.
    #[error("element {element} is between `{at}` and `{to}`: both ends must be points, or both joints")]
    MixedEnds {
        /// The number of the element, from 1.
        element: usize,
        /// Place of one end.
        at: String,
        /// Place of the other end.
        to: String,
    },
    /// An element with both ends at one place.
    #[error("element {element} has both ends at `{at}`: they must differ")]
    SameEnds {
        /// The number of the element, from 1.
        element: usize,
        /// Name of the place.
        at: String,
    },
    /// A polynomial with a displacement twice.
    #[error("element {element}, polynomial, has the displacement `{place}` twice: give each once")]
    RepeatedPlace {
        /// The number of the element, from 1.
        element: usize,
        /// Name of the place.
        place: String,
    },
    /// A polynomial over the displacements of a joint and of a point.
    #[error(
        "element {element}, polynomial, is over `{at}` and `{to}`: its displacements must be those of points, or those of joints"
    )]
    MixedPlaces {
        /// The number of the element, from 1.
        element: usize,
        /// The first place of the element.
        at: String,
        /// The first place of another kind.
        to: String,
    },
    /// The powers of a term of a polynomial have an impossible sum.
    #[error(
        "element {element}, term {term}: the sum of `powers` is {got}: it must be 3 to 5 (springs, whose sum is 2, are \
         elements of kind linear)"
    )]
    Degree {
        /// The number of the element, from 1.
        element: usize,
        /// The number of the term, from 1.
        term: usize,
        /// Sum of the powers.
        got: usize,
    },
    /// Two contacts that meet at one place.
    #[error(
        "elements {first} and {second} are both contacts at `{at}` on the same side: combine them into one element"
    )]
    Overlap {
        /// Number of the first element, from 1.
        first: usize,
        /// Number of the second.
        second: usize,
        /// Name of the place.
        at: String,
    },
    /// The springs can't hold the weight.
    #[error(
        "the joints can't hold the chain's weight at {gravity_m_s2} m/s²: no stable equilibrium is found from these angles; \
         raise the stiffnesses or lower the masses", gravity_m_s2 = short(.gravity_m_s2))]
    Collapse {
        /// The acceleration of gravity, m/s².
        gravity_m_s2: f64,
    },
    /// A natural frequency vanishes or overflows, or the modes can't be computed.
    #[error(
        "the structure's natural frequencies are computed as {lowest_hz:.1e} to {highest_hz:.1e} Hz: they must be \
         positive and finite; check the proportion of stiffnesses and inertias"
    )]
    Frequencies {
        /// Estimate of the lowest frequency, Hz.
        lowest_hz: f64,
        /// Estimate of the highest frequency, Hz.
        highest_hz: f64,
    },
}

impl StructureError {
    /// The error of a structure with too few or too many parts of a kind.
    pub(super) fn structure_count(what: &'static str, got: usize, least: usize, most: usize) -> StructureError {
        StructureError::Count { part: String::from("the structure"), what, got, least, most }
    }
}

/// Explains the moment of inertia that is missing.
fn about_joint(link: u8, about_joint_kg_m2: &Option<f64>) -> String {
    about_joint_kg_m2.as_ref().map_or(String::new(), |inertia| {
        format!(
            "; link{link}.inertia_kg_m2 is about the centre of mass, and the source states {} kg·m² about the joint, which is \
             mass_kg · centre_of_mass_m² more",
            short(inertia)
        )
    })
}
