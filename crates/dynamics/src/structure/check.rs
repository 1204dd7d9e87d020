//! The checks of elements.

use alloc::format;
use alloc::vec::Vec;

use super::MOST_ELEMENTS;
use super::assembly::{Assembly, place_name};
use super::element::Element;
use super::error::StructureError;
use super::spec::{ElementSpec, Law, Place, Side};

/// What a value of a law must be.
#[derive(Clone, Copy)]
enum Range {
    Finite,
    NotNegative,
    Positive,
}

/// The elements of a specification at their places.
pub(super) fn elements(of: &Assembly, specs: &[ElementSpec]) -> Result<Vec<Element>, StructureError> {
    if specs.len() > MOST_ELEMENTS {
        return Err(StructureError::Count { what: "elements", got: specs.len(), least: 0, most: MOST_ELEMENTS });
    }
    let (mut elements, mut states) = (Vec::with_capacity(specs.len()), 0);
    for (i, spec) in specs.iter().enumerate() {
        check_values(i + 1, &spec.law)?;
        let at = of.place(&spec.at)?;
        let to = spec.to.as_ref().map(|to| of.place(to)).transpose()?;
        for (end, place) in [(Some(at), Some(&spec.at)), (to, spec.to.as_ref())] {
            if let (Some(end), Some(place)) = (end, place)
                && of.is_fixed(end)
            {
                return Err(StructureError::Fixed { element: i + 1, place: place_name(place) });
            }
        }
        if let (Some(other), Some(place)) = (to, &spec.to) {
            check_ends(i + 1, [&spec.at, place], at.is_angle() != other.is_angle(), at == other)?;
        }
        let state = spec.law.has_state().then_some(states);
        states += usize::from(state.is_some());
        elements.push(Element { law: spec.law, at, to, state });
        check_overlap(specs, i)?;
    }
    Ok(elements)
}

fn check_ends(element: usize, [at, to]: [&Place; 2], mixed: bool, same: bool) -> Result<(), StructureError> {
    let at = place_name(at);
    if mixed {
        return Err(StructureError::MixedEnds { element, at, to: place_name(to) });
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
fn check_overlap(specs: &[ElementSpec], second: usize) -> Result<(), StructureError> {
    let own = &specs[second];
    let meets = |other: &ElementSpec| {
        other.at == own.at && other.to == own.to && sides(&other.law).iter().any(|side| sides(&own.law).contains(side))
    };
    match specs[..second].iter().position(meets) {
        Some(first) => {
            let at = place_name(&own.at);
            Err(StructureError::Overlap { first: first + 1, second: second + 1, at })
        }
        None => Ok(()),
    }
}

/// Checks that such a law can exist.
fn check_values(element: usize, law: &Law) -> Result<(), StructureError> {
    use Range::{Finite, NotNegative, Positive};
    let refuse = |name: &'static str, got: f64, expected: &'static str| {
        Err(StructureError::Value { part: format!("element {element}, {}", law.name()), name, got, expected })
    };
    let values: &[(&'static str, f64, Range)] = match *law {
        Law::Cubic { stiffness3, stiffness5 } => {
            &[("stiffness3", stiffness3, Finite), ("stiffness5", stiffness5, Finite)]
        }
        Law::Gap { stiffness, gap } => &[("stiffness", stiffness, Positive), ("gap", gap, NotNegative)],
        Law::KelvinVoigt { stiffness, damping, gap, .. } | Law::HuntCrossley { stiffness, damping, gap, .. } => {
            &[("stiffness", stiffness, Positive), ("damping", damping, NotNegative), ("gap", gap, NotNegative)]
        }
        Law::Friction { stiffness, slip } => &[("stiffness", stiffness, Positive), ("slip", slip, Positive)],
        Law::Lugre { bristle_stiffness, bristle_damping, viscous, coulomb, breakaway, stribeck } => {
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
    for &(name, got, range) in values {
        let (fits, expected) = match range {
            Finite => (true, "a finite number"),
            NotNegative => (got >= 0.0, "zero or a positive number"),
            Positive => (got > 0.0, "a positive number"),
        };
        if !(got.is_finite() && fits) {
            return refuse(name, got, expected);
        }
    }
    Ok(())
}
