//! Variables by their names: checked against what they are to be.

use std::collections::BTreeMap;

use super::Dof;
use crate::description::{Description, Variable};
use crate::error::ImportError;
use crate::spec::Numbers;
use crate::units::{self, Conversion, Exponents};

/// The quantity for which a variable is named; it must have its causality and its unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Of {
    Force,
    Torque,
    /// The force in the impedance head.
    Head,
    Displacement(Dof),
    Velocity(Dof),
    Acceleration(Dof),
}

impl Of {
    fn is_input(self) -> bool {
        matches!(self, Of::Force | Of::Torque)
    }

    /// The exponents of kg, m, s and the others; `None` of modal coordinates, which have roots of units.
    fn exponents(self) -> Option<Exponents> {
        let (length, rate) = match self {
            Of::Force | Of::Head => return Some([1, 1, -2, 0, 0, 0, 0]),
            Of::Torque => return Some([1, 2, -2, 0, 0, 0, 0]),
            Of::Displacement(dof) => (dof, 0),
            Of::Velocity(dof) => (dof, -1),
            Of::Acceleration(dof) => (dof, -2),
        };
        match length {
            Dof::Point => Some([0, 1, rate, 0, 0, 0, 0]),
            Dof::Joint(_) => Some([0, 0, rate, 0, 0, 0, 0]),
            Dof::Mode(_) => None,
        }
    }
}

/// A number in a block of variables.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Slot {
    pub index: usize,
    pub conversion: Conversion,
}

/// A number of a variable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Named {
    reference: u32,
    /// How many numbers the variable has, and which of them it is.
    elements: usize,
    element: usize,
    conversion: Conversion,
}

/// Variables that one call sets or reads: their references, and how many numbers they have.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Block {
    pub references: Vec<u32>,
    pub count: usize,
    first: BTreeMap<u32, usize>,
}

impl Block {
    /// Returns the place of a number in the block, to which its variable is added unless it is there.
    pub(super) fn slot(&mut self, named: &Named) -> Slot {
        let Block { references, count, first } = self;
        let first = *first.entry(named.reference).or_insert_with(|| {
            references.push(named.reference);
            let first = *count;
            *count += named.elements;
            first
        });
        Slot { index: first + named.element, conversion: named.conversion }
    }
}

/// The variable `name` and the element of it: the name as it is, or that of an array with a number in brackets.
fn find<'a>(description: &'a Description, key: &str, name: &str) -> Result<(&'a Variable, Option<usize>), ImportError> {
    if let Some(variable) = description.variables.get(name) {
        return Ok((variable, None));
    }
    let element = || {
        let (array, rest) = name.strip_suffix(']')?.rsplit_once('[')?;
        let variable = description.variables.get(array).filter(|variable| variable.elements.is_some())?;
        Some((variable, rest.parse().ok()?))
    };
    if let Some((variable, number)) = element() {
        return Ok((variable, Some(number)));
    }
    let near = description.variables.keys().map(|known| (strsim::normalized_damerau_levenshtein(name, known), known));
    let nearest = near.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(similarity, _)| *similarity > 0.5);
    let nearest = nearest.map(|(_, known)| known.clone());
    Err(ImportError::Variable { key: key.to_owned(), name: name.to_owned(), nearest })
}

fn check_type(description: &Description, key: &str, name: &str, variable: &Variable) -> Result<(), ImportError> {
    let expected = description.version.real();
    if variable.kind == expected {
        return Ok(());
    }
    Err(ImportError::Type { key: key.to_owned(), name: name.to_owned(), got: variable.kind.clone(), expected })
}

/// The number that `name` names, which the key of the section `structure` is to be.
pub(super) fn named(description: &Description, key: &str, name: &str, of: Of) -> Result<Named, ImportError> {
    let (variable, number) = find(description, key, name)?;
    check_type(description, key, name, variable)?;
    let (fits, expected) = match of.is_input() {
        true => (variable.causality == "input", "input"),
        false => (matches!(variable.causality.as_str(), "output" | "local"), "output or local"),
    };
    if !fits {
        let got = variable.causality.clone();
        return Err(ImportError::Causality { key: key.to_owned(), name: name.to_owned(), got, expected });
    }
    let elements = variable.elements.unwrap_or(1);
    let element = match (number, variable.elements) {
        (None, None) => 0,
        (Some(number), Some(elements)) if (1..=elements).contains(&number) => number - 1,
        _ => {
            let name = name.split('[').next().unwrap_or(name).to_owned();
            return Err(ImportError::Element { key: key.to_owned(), name, elements });
        }
    };
    let conversion = conversion(description, key, name, variable, of)?;
    Ok(Named { reference: variable.reference, elements, element, conversion })
}

/// The conversion of a variable's unit. One that says nothing of SI is taken as it is.
fn conversion(
    description: &Description,
    key: &str,
    name: &str,
    variable: &Variable,
    of: Of,
) -> Result<Conversion, ImportError> {
    let unit = variable.unit.as_ref().and_then(|unit| Some((unit, description.units.get(unit)?)));
    let Some((unit_name, unit)) = unit else { return Ok(Conversion::NONE) };
    let Some(got) = unit.exponents else { return Ok(Conversion::NONE) };
    if let Some(expected) = of.exponents().filter(|expected| *expected != got) {
        return Err(ImportError::Unit {
            key: key.to_owned(),
            name: name.to_owned(),
            unit: unit_name.clone(),
            got: units::words(&got),
            expected: units::words(&expected),
        });
    }
    Ok(Conversion::new(unit.factor, if variable.is_relative { 0.0 } else { unit.offset }))
}

/// Warns of a variable whose unit the FMU does not define in SI, which is taken as SI.
pub(super) fn warn_of_unit(description: &Description, key: &str, name: &str, of: Of) -> Result<(), ImportError> {
    let (variable, _) = find(description, key, name)?;
    let unknown = variable.unit.as_ref().filter(|unit| {
        let defined = description.units.get(*unit).and_then(|unit| unit.exponents);
        defined.is_none() && of.exponents().is_some()
    });
    if let Some(unit) = unknown {
        tracing::warn!(
            "structure.{key}: the FMU does not define the unit `{unit}` of `{name}` (no BaseUnit): its numbers are taken as SI"
        );
    }
    Ok(())
}

/// The values of parameters, by their references.
pub(super) fn parameters(
    description: &Description,
    given: &BTreeMap<String, Numbers>,
) -> Result<Vec<(u32, Vec<f64>)>, ImportError> {
    let one = |(name, numbers): (&String, &Numbers)| {
        let key = "parameters";
        let variable = description
            .variables
            .get(name)
            .map_or_else(|| find(description, key, name).map(|(variable, _)| variable), Ok)?;
        check_type(description, key, name, variable)?;
        if !variable.is_exact {
            let key = key.to_owned();
            let name = name.clone();
            let got = variable.causality.clone();
            let expected = "parameter, or have a start value (initial = exact)";
            return Err(ImportError::Causality { key, name, got, expected });
        }
        let numbers = numbers.as_slice();
        let expected = variable.elements.unwrap_or(1);
        if numbers.len() != expected {
            return Err(ImportError::Length { name: name.clone(), got: numbers.len(), expected });
        }
        match numbers.iter().find(|number| !number.is_finite()) {
            Some(got) => Err(ImportError::Value { name: name.clone(), got: *got }),
            None => Ok((variable.reference, numbers.to_vec())),
        }
    };
    given.iter().map(one).collect()
}
