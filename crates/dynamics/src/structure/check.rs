//! The checks of elements.

use alloc::format;
use alloc::string::String;

use super::error::StructureError;
use super::spec::{ElementSpec, Law, Place, Side};

/// Range in which a value must be.
#[derive(Clone, Copy)]
pub(super) enum Range {
    Finite,
    NotNegative,
    Positive,
}

impl Range {
    /// Checks a value; `part` says what it belongs to.
    pub fn check(self, part: impl FnOnce() -> String, name: &'static str, got: f64) -> Result<(), StructureError> {
        let (fits, expected) = match self {
            Range::Finite => (true, "a finite number"),
            Range::NotNegative => (got >= 0.0, "zero or a positive number"),
            Range::Positive => (got > 0.0, "a positive number"),
        };
        if got.is_finite() && fits { Ok(()) } else { Err(StructureError::Value { part: part(), name, got, expected }) }
    }
}

/// Refuses an element whose ends have different units, or are one place.
pub(super) fn check_ends(element: usize, [at, to]: [&Place; 2], mixed: bool, same: bool) -> Result<(), StructureError> {
    let at = at.name();
    if mixed {
        return Err(StructureError::MixedEnds { element, at, to: to.name() });
    }
    if same { Err(StructureError::SameEnds { element, at }) } else { Ok(()) }
}

/// The sides on which a law touches.
fn sides(law: &Law) -> &'static [Side] {
    match law {
        Law::Gap { .. } => &[Side::Positive, Side::Negative],
        Law::KelvinVoigt { side: Side::Positive, .. } | Law::HuntCrossley { side: Side::Positive, .. } => {
            &[Side::Positive]
        }
        Law::KelvinVoigt { .. } | Law::HuntCrossley { .. } => &[Side::Negative],
        _ => &[],
    }
}

/// Refuses an element that touches where one before it does.
pub(super) fn check_overlap(specs: &[ElementSpec], second: usize) -> Result<(), StructureError> {
    let ElementSpec::Point { at: own_at, to: own_to, law: own } = &specs[second] else { return Ok(()) };
    let meets = |other: &ElementSpec| match other {
        ElementSpec::Point { at, to, law } => {
            at == own_at && to == own_to && sides(law).iter().any(|side| sides(own).contains(side))
        }
        ElementSpec::Polynomial { .. } => false,
    };
    match specs[..second].iter().position(meets) {
        Some(first) => {
            let at = own_at.name();
            Err(StructureError::Overlap { first: first + 1, second: second + 1, at })
        }
        None => Ok(()),
    }
}

/// Checks that such a law can exist.
pub(super) fn check_values(element: usize, law: &Law) -> Result<(), StructureError> {
    use Range::{Finite, NotNegative, Positive};
    let part = || format!("element {element}, {}", law.name());
    let refuse = |name: &'static str, got: f64, expected: &'static str| {
        Err(StructureError::Value { part: part(), name, got, expected })
    };
    let values: &[(&'static str, f64, Range)] = match *law {
        Law::Cubic { stiffness3, stiffness5 } => {
            &[("stiffness3", stiffness3, Finite), ("stiffness5", stiffness5, Finite)]
        }
        Law::Gap { stiffness, gap, preload } => {
            &[("stiffness", stiffness, Positive), ("gap", gap, NotNegative), ("preload", preload, Finite)]
        }
        Law::KelvinVoigt { stiffness, damping, gap, preload, .. }
        | Law::HuntCrossley { stiffness, damping, gap, preload, .. } => {
            if preload > 0.0 && gap != 0.0 {
                return refuse("gap", gap, "0 with a preload, because the contact is closed at rest");
            }
            &[
                ("stiffness", stiffness, Positive),
                ("damping", damping, NotNegative),
                ("gap", gap, NotNegative),
                ("preload", preload, NotNegative),
            ]
        }
        Law::Friction { stiffness, slip } => &[("stiffness", stiffness, Positive), ("slip", slip, Positive)],
        Law::Lugre { bristle_stiffness, bristle_damping, viscous, coulomb, breakaway, stribeck } => {
            // Otherwise g(v) would be below the Coulomb force, by which the steepest decay of the bristles is bounded.
            if breakaway < coulomb {
                return refuse("breakaway", breakaway, "at least `coulomb`");
            }
            &[
                ("bristle_stiffness", bristle_stiffness, Positive),
                ("bristle_damping", bristle_damping, NotNegative),
                ("viscous", viscous, NotNegative),
                ("coulomb", coulomb, Positive),
                ("breakaway", breakaway, Positive),
                ("stribeck", stribeck, Positive),
            ]
        }
        Law::Linear { stiffness: 0.0, damping: 0.0 } => {
            return refuse("stiffness", 0.0, "a positive number where there is no damping");
        }
        Law::Linear { stiffness, damping } => {
            &[("stiffness", stiffness, NotNegative), ("damping", damping, NotNegative)]
        }
        Law::Tanh { slip, velocity } => &[("slip", slip, Positive), ("velocity", velocity, Positive)],
    };
    values.iter().try_for_each(|&(name, got, range)| range.check(part, name, got))
}
