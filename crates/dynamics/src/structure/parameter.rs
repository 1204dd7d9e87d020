//! The parameters of a structure, by name, and structures that differ in one of them.
//!
//! A parameter has the name of its part, with the part's number from 1, and the key of its value in a scenario:
//! `link2.angle_deg`, `mode3.damping_ratio`, `element1.gap_m`, and `gravity_m_s2` of a chain. The energies of a
//! polynomial's terms are numbered: `element2.energy3`.

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt;

use super::MOST_LINKS;
use super::assembly::Assembly;
use super::error::StructureError;
use super::spec::{BodySpec, ElementSpec, Law, Link, ModeSpec, StructureSpec, Term};

/// A parameter of a structure; [`Assembly::parameter`] finds it by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parameter {
    /// A value of a link, by the link's number from 1.
    Link(u8, LinkField),
    /// A value of a mode, by the mode's number from 1.
    Mode(u8, ModeField),
    /// A value of an element, by the element's number from 1.
    Element(u8, ElementField),
    /// The energy of a term of a polynomial element, by the element's number from 1.
    Energy(u8, EnergyField),
    /// The acceleration of gravity on a chain.
    Gravity,
}

/// A value of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkField {
    /// Length of the link, m.
    Length,
    /// Mass of the link, kg.
    Mass,
    /// The distance of its centre of mass from its joint, m.
    CentreOfMass,
    /// Distance of the link's centre of mass from the line between its joints, m.
    CentreOfMassOff,
    /// Moment of inertia of the link about the centre of mass, kg·m².
    Inertia,
    /// Angle of the link against the one before, degrees.
    Angle,
    /// The stiffness of its joint, N·m/rad.
    Stiffness,
    /// The damping of its joint, N·m·s/rad.
    Damping,
}

/// A value of a mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModeField {
    /// Natural frequency of the mode, Hz.
    Frequency,
    /// Damping ratio of the mode, dimensionless.
    DampingRatio,
}

/// A value of an element's law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ElementField {
    /// Index of the value among the law's values.
    index: u8,
    /// Key of the value in a scenario.
    key: &'static str,
    unit: &'static str,
}

/// The energy of a term of a polynomial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EnergyField {
    /// The number of the term, from 1.
    term: u16,
    unit: &'static str,
}

impl EnergyField {
    /// The energy of term `term`, from 1.
    fn new(term: u16, of: &Term, is_joint: bool) -> EnergyField {
        let degree: u32 = of.powers.iter().map(|power| u32::from(*power)).sum();
        let unit = match (degree, is_joint) {
            (3, false) => "J/m³",
            (4, false) => "J/m⁴",
            (_, false) => "J/m⁵",
            (3, true) => "J/rad³",
            (4, true) => "J/rad⁴",
            (_, true) => "J/rad⁵",
        };
        EnergyField { term, unit }
    }
}

/// Keys and units of a value: those along an axis, then those at a joint.
struct Value([&'static str; 2], [&'static str; 2]);

const STIFFNESS: Value = Value(["stiffness_n_m", "stiffness_nm_rad"], ["N/m", "N·m/rad"]);
const STIFFNESS3: Value = Value(["stiffness3_n_m3", "stiffness3_nm_rad3"], ["N/m³", "N·m/rad³"]);
const STIFFNESS5: Value = Value(["stiffness5_n_m5", "stiffness5_nm_rad5"], ["N/m⁵", "N·m/rad⁵"]);
const HERTZ: Value = Value(["stiffness_n_m1_5", "stiffness_nm_rad1_5"], ["N/m^1.5", "N·m/rad^1.5"]);
const DAMPING: Value = Value(["damping_n_s_m", "damping_nm_s_rad"], ["N·s/m", "N·m·s/rad"]);
const VISCOUS: Value = Value(["viscous_n_s_m", "viscous_nm_s_rad"], ["N·s/m", "N·m·s/rad"]);
const DISSIPATION: Value = Value(["dissipation_s_m", "dissipation_s_rad"], ["s/m", "s/rad"]);
const GAP: Value = Value(["gap_m", "gap_rad"], ["m", "rad"]);
const PRELOAD: Value = Value(["preload_n", "preload_nm"], ["N", "N·m"]);
const SLIP: Value = Value(["slip_force_n", "slip_torque_nm"], ["N", "N·m"]);
const BREAKAWAY: Value = Value(["breakaway_n", "breakaway_nm"], ["N", "N·m"]);
const STRIBECK: Value = Value(["stribeck_m_s", "stribeck_rad_s"], ["m/s", "rad/s"]);
const VELOCITY: Value = Value(["velocity_m_s", "velocity_rad_s"], ["m/s", "rad/s"]);

impl LinkField {
    const ALL: [LinkField; 8] = [
        LinkField::Length,
        LinkField::Mass,
        LinkField::CentreOfMass,
        LinkField::CentreOfMassOff,
        LinkField::Inertia,
        LinkField::Angle,
        LinkField::Stiffness,
        LinkField::Damping,
    ];

    /// Key in a scenario, and unit.
    const fn words(self) -> (&'static str, &'static str) {
        match self {
            LinkField::Length => ("length_m", "m"),
            LinkField::Mass => ("mass_kg", "kg"),
            LinkField::CentreOfMass => ("centre_of_mass_m", "m"),
            LinkField::CentreOfMassOff => ("centre_of_mass_off_m", "m"),
            LinkField::Inertia => ("inertia_kg_m2", "kg·m²"),
            LinkField::Angle => ("angle_deg", "°"),
            LinkField::Stiffness => ("stiffness_nm_rad", "N·m/rad"),
            LinkField::Damping => ("damping_nm_s_rad", "N·m·s/rad"),
        }
    }

    fn of(self, link: &mut Link) -> &mut f64 {
        match self {
            LinkField::Length => &mut link.length_m,
            LinkField::Mass => &mut link.mass_kg,
            LinkField::CentreOfMass => &mut link.centre_of_mass_m,
            LinkField::CentreOfMassOff => &mut link.centre_of_mass_off_m,
            LinkField::Inertia => &mut link.inertia_kg_m2,
            LinkField::Angle => &mut link.angle_deg,
            LinkField::Stiffness => &mut link.stiffness_nm_rad,
            LinkField::Damping => &mut link.damping_nm_s_rad,
        }
    }
}

impl ModeField {
    const ALL: [ModeField; 2] = [ModeField::Frequency, ModeField::DampingRatio];

    /// Key in a scenario, and unit.
    const fn words(self) -> (&'static str, &'static str) {
        match self {
            ModeField::Frequency => ("frequency_hz", "Hz"),
            ModeField::DampingRatio => ("damping_ratio", ""),
        }
    }

    fn of(self, mode: &mut ModeSpec) -> &mut f64 {
        match self {
            ModeField::Frequency => &mut mode.frequency_hz,
            ModeField::DampingRatio => &mut mode.damping_ratio,
        }
    }
}

/// The values of a law with their keys and units, in one order.
fn values_of(law: &mut Law) -> Vec<(Value, &mut f64)> {
    match law {
        Law::Cubic { stiffness3, stiffness5 } => [(STIFFNESS3, stiffness3), (STIFFNESS5, stiffness5)].into(),
        Law::Gap { stiffness, gap, preload } => [(STIFFNESS, stiffness), (GAP, gap), (PRELOAD, preload)].into(),
        Law::KelvinVoigt { stiffness, damping, gap, preload, .. } => {
            [(STIFFNESS, stiffness), (DAMPING, damping), (GAP, gap), (PRELOAD, preload)].into()
        }
        Law::HuntCrossley { stiffness, damping, gap, preload, .. } => {
            [(HERTZ, stiffness), (DISSIPATION, damping), (GAP, gap), (PRELOAD, preload)].into()
        }
        Law::Friction { stiffness, slip } => [(STIFFNESS, stiffness), (SLIP, slip)].into(),
        Law::Lugre { bristle_stiffness, bristle_damping, viscous, coulomb, breakaway, stribeck } => [
            (STIFFNESS, bristle_stiffness),
            (DAMPING, bristle_damping),
            (VISCOUS, viscous),
            (SLIP, coulomb),
            (BREAKAWAY, breakaway),
            (STRIBECK, stribeck),
        ]
        .into(),
        Law::Linear { stiffness, damping } => [(STIFFNESS, stiffness), (DAMPING, damping)].into(),
        Law::Tanh { slip, velocity } => [(SLIP, slip), (VELOCITY, velocity)].into(),
    }
}

impl Parameter {
    /// The unit of its value; empty if it has none.
    pub const fn unit(self) -> &'static str {
        match self {
            Parameter::Link(_, field) => field.words().1,
            Parameter::Mode(_, field) => field.words().1,
            Parameter::Element(_, field) => field.unit,
            Parameter::Energy(_, field) => field.unit,
            Parameter::Gravity => "m/s²",
        }
    }

    /// The value of a link with this name; none if there is none, or for more links than a chain has.
    pub(super) fn of_link(name: &str) -> Option<Parameter> {
        let (part, key) = name.split_once('.')?;
        let link: u8 = part.strip_prefix("link")?.parse().ok()?;
        let field = LinkField::ALL.into_iter().find(|field| field.words().0 == key)?;
        (1..=MOST_LINKS).contains(&usize::from(link)).then_some(Parameter::Link(link, field))
    }

    /// Returns the parameter's value in a specification; none if the specification has no such parameter.
    fn of(self, spec: &mut StructureSpec) -> Option<&mut f64> {
        let part = |number: u8| usize::from(number).wrapping_sub(1);
        match (self, &mut spec.body) {
            (Parameter::Link(link, field), BodySpec::Chain(chain)) => {
                chain.links.get_mut(part(link)).map(|link| field.of(link))
            }
            (Parameter::Gravity, BodySpec::Chain(chain)) => Some(&mut chain.gravity_m_s2),
            (Parameter::Mode(mode, field), BodySpec::Modal(modal)) => {
                modal.modes.get_mut(part(mode)).map(|mode| field.of(mode))
            }
            (Parameter::Element(element, field), _) => {
                let element = spec.elements.get_mut(part(element))?;
                let is_joint = usize::from(element.is_at_joint());
                let ElementSpec::Point { law, .. } = element else { return None };
                let (Value(keys, _), value) = values_of(law).into_iter().nth(usize::from(field.index))?;
                // A parameter of another structure may have this place with another key; it is none of this one.
                (keys[is_joint] == field.key).then_some(value)
            }
            (Parameter::Energy(element, field), _) => {
                let element = spec.elements.get_mut(part(element))?;
                let is_joint = element.is_at_joint();
                let ElementSpec::Polynomial { terms, .. } = element else { return None };
                let term = terms.get_mut(usize::from(field.term).wrapping_sub(1))?;
                (EnergyField::new(field.term, term, is_joint) == field).then_some(&mut term.energy)
            }
            _ => None,
        }
    }
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Parameter::Link(link, field) => write!(f, "link{link}.{}", field.words().0),
            Parameter::Mode(mode, field) => write!(f, "mode{mode}.{}", field.words().0),
            Parameter::Element(element, field) => write!(f, "element{element}.{}", field.key),
            Parameter::Energy(element, field) => write!(f, "element{element}.energy{}", field.term),
            Parameter::Gravity => f.write_str("gravity_m_s2"),
        }
    }
}

impl Assembly {
    /// All parameters: those of the links or modes, gravity of a chain, those of the elements.
    pub fn parameters(&self) -> Vec<Parameter> {
        let mut found = Vec::new();
        match &self.spec().body {
            BodySpec::Chain(chain) => {
                let of_link = |(number, _)| LinkField::ALL.map(|field| Parameter::Link(number, field));
                found.extend((1..).zip(&chain.links).flat_map(of_link));
                found.push(Parameter::Gravity);
            }
            BodySpec::Modal(modal) => {
                let of_mode = |(number, _)| ModeField::ALL.map(|field| Parameter::Mode(number, field));
                found.extend((1..).zip(&modal.modes).flat_map(of_mode));
            }
        }
        for (number, element) in (1..).zip(&self.spec().elements) {
            let is_joint = element.is_at_joint();
            match element {
                ElementSpec::Point { law, .. } => {
                    let (mut law, place) = (*law, usize::from(is_joint));
                    for (index, (Value(keys, units), _)) in (0..).zip(values_of(&mut law)) {
                        let field = ElementField { index, key: keys[place], unit: units[place] };
                        found.push(Parameter::Element(number, field));
                    }
                }
                ElementSpec::Polynomial { terms, .. } => {
                    let energy = |(term, of)| Parameter::Energy(number, EnergyField::new(term, of, is_joint));
                    found.extend((1..).zip(terms).map(energy));
                }
            }
        }
        found
    }

    /// The parameter of a name: `link2.angle_deg`, `mode3.damping_ratio`, `element1.gap_m`, `gravity_m_s2`.
    ///
    /// # Errors
    /// [`StructureError::UnknownParameter`] lists the names.
    pub fn parameter(&self, name: &str) -> Result<Parameter, StructureError> {
        let parameters = self.parameters();
        let found = parameters.iter().find(|parameter| parameter.to_string() == name).copied();
        found.ok_or_else(|| self.unknown_parameter(name.to_string()))
    }

    fn unknown_parameter(&self, got: String) -> StructureError {
        let names: Vec<String> = self.parameters().iter().map(|parameter| format!("{parameter}")).collect();
        StructureError::UnknownParameter { got, known: names.join(", ") }
    }

    /// The value of a parameter.
    ///
    /// # Errors
    /// [`StructureError::UnknownParameter`] if it is one of another structure.
    pub fn value(&self, parameter: Parameter) -> Result<f64, StructureError> {
        let value = parameter.of(&mut self.spec().clone()).map(|value| *value);
        value.ok_or_else(|| self.unknown_parameter(parameter.to_string()))
    }

    /// The structure with another value of a parameter.
    ///
    /// # Errors
    /// [`StructureError::UnknownParameter`] if it is a parameter of another structure; otherwise as [`Assembly::new`].
    pub fn with(&self, parameter: Parameter, value: f64) -> Result<Assembly, StructureError> {
        self.with_all(&[(parameter, value)])
    }

    /// The structure with other values of several parameters, which need not be possible one by one.
    ///
    /// # Errors
    /// As [`Assembly::with`].
    pub fn with_all(&self, values: &[(Parameter, f64)]) -> Result<Assembly, StructureError> {
        let mut spec = self.spec().clone();
        for (parameter, value) in values {
            let own = parameter.of(&mut spec).ok_or_else(|| self.unknown_parameter(parameter.to_string()))?;
            *own = *value;
            // What is given here is stated, whatever the source leaves out.
            if let BodySpec::Chain(chain) = &mut spec.body {
                chain.unstated.retain(|unstated| unstated != parameter);
            }
        }
        Assembly::new(&spec)
    }
}
