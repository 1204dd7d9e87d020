//! The values of parameters, and structures that differ in some of them.

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

use super::assembly::Assembly;
use super::error::StructureError;
use super::parameter::{Parameter, Part};
use super::spec::{BodySpec, ElementSpec, Law, Link, StructureSpec, Term};

/// Unit of the energy of a term of a polynomial.
fn energy_unit(of: &Term, is_joint: bool) -> &'static str {
    let degree: u32 = of.powers.iter().map(|power| u32::from(*power)).sum();
    match (degree, is_joint) {
        (3, false) => "J/m³",
        (4, false) => "J/m⁴",
        (_, false) => "J/m⁵",
        (3, true) => "J/rad³",
        (4, true) => "J/rad⁴",
        (_, true) => "J/rad⁵",
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

/// The values of some links with their parameters.
pub(super) fn values_of_links(links: &mut [Link]) -> impl Iterator<Item = (Parameter, &mut f64)> {
    (1..).zip(links).flat_map(|(number, link)| {
        [
            ("length_m", "m", &mut link.length_m),
            ("mass_kg", "kg", &mut link.mass_kg),
            ("centre_of_mass_m", "m", &mut link.centre_of_mass_m),
            ("centre_of_mass_off_m", "m", &mut link.centre_of_mass_off_m),
            ("inertia_kg_m2", "kg·m²", &mut link.inertia_kg_m2),
            ("angle_deg", "°", &mut link.angle_deg),
            ("stiffness_nm_rad", "N·m/rad", &mut link.stiffness_nm_rad),
            ("damping_nm_s_rad", "N·m·s/rad", &mut link.damping_nm_s_rad),
        ]
        .map(|(key, unit, value)| (Parameter { part: Part::Link(number), key, unit }, value))
    })
}

/// The values of a law with their keys and units, in one order.
fn values_of_law(law: &mut Law) -> Vec<(Value, &mut f64)> {
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

/// All values of a specification that are parameters: those of the links or modes, gravity of a chain, those of the elements.
fn values(spec: &mut StructureSpec) -> Vec<(Parameter, &mut f64)> {
    let mut found = Vec::new();
    match &mut spec.body {
        BodySpec::Chain(chain) => {
            found.extend(values_of_links(&mut chain.links));
            found.push((Parameter::GRAVITY, &mut chain.gravity_m_s2));
        }
        BodySpec::Modal(modal) => {
            for (number, mode) in (1..).zip(&mut modal.modes) {
                let part = Part::Mode(number);
                found.push((Parameter { part, key: "frequency_hz", unit: "Hz" }, &mut mode.frequency_hz));
                found.push((Parameter { part, key: "damping_ratio", unit: "" }, &mut mode.damping_ratio));
            }
        }
    }
    for (number, element) in (1..).zip(&mut spec.elements) {
        let is_joint = element.is_at_joint();
        match element {
            ElementSpec::Point { law, .. } => {
                let part = Part::Element(number);
                let place = usize::from(is_joint);
                for (Value(keys, units), value) in values_of_law(law) {
                    found.push((Parameter { part, key: keys[place], unit: units[place] }, value));
                }
            }
            ElementSpec::Polynomial { terms, .. } => {
                for (term, of) in (1..).zip(terms) {
                    let part = Part::Term { element: number, term };
                    let unit = energy_unit(of, is_joint);
                    found.push((Parameter { part, key: "energy", unit }, &mut of.energy));
                }
            }
        }
    }
    found
}

/// Returns a parameter's value in a specification; none if the specification has no such parameter.
fn own_value(parameter: Parameter, spec: &mut StructureSpec) -> Option<&mut f64> {
    // The key takes part in the comparison: the element with this number may have another law in another structure.
    values(spec).into_iter().find_map(|(found, value)| (found == parameter).then_some(value))
}

impl Assembly {
    /// All parameters: those of the links or modes, gravity of a chain, those of the elements.
    pub fn parameters(&self) -> Vec<Parameter> {
        // One walk over a specification serves reading and writing; whoever only reads gives it a copy.
        values(&mut self.spec().clone()).into_iter().map(|(parameter, _)| parameter).collect()
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
        let value = own_value(parameter, &mut self.spec().clone()).map(|value| *value);
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
            let own = own_value(*parameter, &mut spec).ok_or_else(|| self.unknown_parameter(parameter.to_string()))?;
            *own = *value;
            // What is given here is stated, whatever the source leaves out.
            if let BodySpec::Chain(chain) = &mut spec.body {
                chain.unstated.retain(|unstated| unstated != parameter);
            }
        }
        Assembly::new(&spec)
    }
}
