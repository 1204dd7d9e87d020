//! The variables of an FMU by which a plant drives and reads it.

mod variable;

use std::collections::BTreeMap;

use crate::description::Description;
use crate::{ImportError, OutputsOf, ReadAt, Spec};
use resonarm_bench::rig::{Load, MOST_JOINTS};
use resonarm_bench::structure::{Channel, Coordinates, LoadSet, coordinate_channels};
pub(crate) use variable::{Block, Slot};
use variable::{Of, named, parameters, warn_of_unit};

/// The point of the exciter unless the scenario names another.
const TIP: &str = "tip";
/// That of accelerometer B, if something is read there.
const ELBOW: &str = "joint2";

/// What a degree of freedom is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Dof {
    /// A point along an axis.
    Point,
    /// A joint, from 1.
    Joint(usize),
    /// A mode, from 1.
    Mode(usize),
}

impl Dof {
    fn parse(key: &'static str, text: &str) -> Result<Dof, ImportError> {
        let numbered = |name: &str| text.strip_prefix(name)?.parse().ok().filter(|number: &usize| *number > 0);
        let is_point = || matches!(text.rsplit_once('.'), Some((point, "x" | "y" | "z")) if !point.is_empty());
        match (numbered("joint"), numbered("mode")) {
            (Some(joint), _) => Ok(Dof::Joint(joint)),
            (_, Some(mode)) => Ok(Dof::Mode(mode)),
            _ if is_point() => Ok(Dof::Point),
            _ => Err(ImportError::Dof { key, got: text.to_owned() }),
        }
    }
}

/// Slots along x and y.
pub(crate) type Axes = [Option<Slot>; 2];

/// What is set and read of an FMU.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Mapping {
    /// Values of parameters by their value reference, set before initialization.
    pub parameters: Vec<(u32, Vec<f64>)>,
    /// Variables that are set, and where each load is in them, in the order of [`LOADS`](resonarm_bench::structure::LOADS).
    pub set: Block,
    pub inputs: [Option<Slot>; Load::PARTS],
    /// Variables that are read.
    pub read: Block,
    /// The states of a recording, and where they are.
    pub channels: Vec<Channel>,
    pub states: Vec<Slot>,
    /// Displacements of the exciter's point.
    pub travel: Axes,
    /// Forces in the impedance head.
    pub force: Axes,
    /// Velocities and accelerations of accelerometers B and C.
    pub velocity: [Axes; 2],
    pub acceleration: [Axes; 2],
}

impl Mapping {
    /// The mapping of a specification; all degrees of freedom in it are checked, read or not.
    pub fn new(description: &Description, spec: &Spec) -> Result<Mapping, ImportError> {
        let parameters = parameters(description, &spec.parameters)?;
        let mut mapping = Mapping { parameters, ..Mapping::default() };
        let exciter = spec.exciter.as_deref().unwrap_or(TIP);
        mapping.drive(description, spec, exciter)?;
        for (dof, of) in &spec.outputs {
            mapping.check(description, spec, dof, of)?;
        }
        mapping.coordinates(description, &spec.outputs)?;
        let is_read = |at: &str| axes(at).iter().flatten().any(|dof| spec.outputs.contains_key(dof));
        let b = spec.accelerometer_b.as_deref().unwrap_or(if is_read(ELBOW) { ELBOW } else { exciter });
        let c = spec.accelerometer_c.as_deref().unwrap_or(exciter);
        for (index, (instrument, at)) in [("sensors.b", b), ("sensors.c", c)].into_iter().enumerate() {
            mapping.accelerometer(description, spec, index, (instrument, at))?;
        }
        mapping.at_exciter(description, spec, exciter)?;
        Ok(mapping)
    }

    /// The variables that are set, without a load.
    pub fn set_at_rest(&self) -> Vec<f64> {
        let mut set = vec![0.0; self.set.count];
        self.inputs.iter().flatten().for_each(|slot| set[slot.index] = slot.conversion.of_si(0.0));
        set
    }

    /// The loads that are set, with those that every plant has.
    pub fn loads(&self) -> LoadSet {
        LoadSet::native_and((0..Load::PARTS).filter(|place| self.inputs[*place].is_some()))
    }

    /// The variables that take loads: torques about the joints, and forces along x, y and z of the exciter.
    fn drive(&mut self, description: &Description, spec: &Spec, exciter: &str) -> Result<(), ImportError> {
        for dof in spec.inputs.keys() {
            if !matches!(Dof::parse("inputs", dof)?, Dof::Point | Dof::Joint(1..=MOST_JOINTS)) {
                return Err(ImportError::Driven { got: dof.clone() });
            }
        }
        let [x, y] = axes(exciter);
        let z = (!exciter.contains('.')).then(|| format!("{exciter}.z"));
        let joints = (1..=MOST_JOINTS).map(|joint| Some(format!("joint{joint}")));
        for (slot, dof) in self.inputs.iter_mut().zip(joints.chain([x, y, z])) {
            let Some((dof, name)) = dof.and_then(|dof| spec.inputs.get_key_value(&dof)) else { continue };
            let of = if matches!(Dof::parse("inputs", dof)?, Dof::Point) { Of::Force } else { Of::Torque };
            let key = format!("inputs.\"{dof}\"");
            let variable = named(description, &key, name, of)?;
            warn_of_unit(description, &key, name, of)?;
            *slot = Some(self.set.slot(&variable));
        }
        let is_driven = |slots: &[Option<Slot>]| slots.iter().any(Option::is_some);
        // Where the scenario names no exciter, torques at the joints suffice. One that it names must be driven
        // itself.
        if is_driven(&self.inputs[MOST_JOINTS..]) || (spec.exciter.is_none() && is_driven(&self.inputs)) {
            return Ok(());
        }
        Err(place("exciter", "inputs", exciter, spec.inputs.keys()))
    }

    /// Checks the variables of a degree of freedom.
    fn check(&self, description: &Description, spec: &Spec, dof: &str, of: &OutputsOf) -> Result<(), ImportError> {
        let kind = Dof::parse("outputs", dof)?;
        if of.force.is_some() && spec.read != ReadAt::End {
            return Err(ImportError::Force { dof: dof.to_owned() });
        }
        let names = [&of.displacement, &of.velocity, &of.acceleration, &of.force];
        let quantities = [Of::Displacement(kind), Of::Velocity(kind), Of::Acceleration(kind), Of::Head];
        let keys = ["displacement", "velocity", "acceleration", "force"];
        for ((name, quantity), key) in names.into_iter().zip(quantities).zip(keys) {
            if let Some(name) = name {
                let key = format!("outputs.\"{dof}\".{key}");
                named(description, &key, name, quantity)?;
                warn_of_unit(description, &key, name, quantity)?;
            }
        }
        Ok(())
    }

    /// Where a variable of a degree of freedom is among those that are read.
    fn slot(&mut self, description: &Description, dof: &str, name: &str, of: Of) -> Result<Slot, ImportError> {
        let variable = named(description, &format!("outputs.\"{dof}\""), name, of)?;
        Ok(self.read.slot(&variable))
    }

    /// The coordinates: degrees of freedom with displacement and velocity, joints and modes by their numbers, points
    /// by their names.
    fn coordinates(
        &mut self,
        description: &Description,
        outputs: &BTreeMap<String, OutputsOf>,
    ) -> Result<(), ImportError> {
        let mut all = Vec::new();
        for (dof, of) in outputs {
            if let (Some(displacement), Some(velocity)) = (&of.displacement, &of.velocity) {
                all.push((Dof::parse("outputs", dof)?, dof, displacement, velocity));
            }
        }
        // The sort is stable: points stay in the order of their names.
        all.sort_by_key(|(kind, ..)| *kind);
        let Some((first, one, ..)) = all.first().copied() else { return Ok(()) };
        let kind = core::mem::discriminant(&first);
        if let Some((_, other, ..)) = all.iter().find(|(other, ..)| core::mem::discriminant(other) != kind) {
            return Err(ImportError::Kinds { one: one.clone(), other: (*other).clone() });
        }
        let (of, what) = match first {
            Dof::Point => (Coordinates::Displacements, "points"),
            Dof::Joint(_) => (Coordinates::Joints, "joints"),
            Dof::Mode(_) => (Coordinates::Modes, "modes"),
        };
        let in_order = |(index, (dof, ..)): (usize, &(Dof, _, _, _))| match dof {
            Dof::Point => true,
            Dof::Joint(number) | Dof::Mode(number) => *number == index + 1,
        };
        if all.len() > of.most() || !all.iter().enumerate().all(in_order) {
            return Err(ImportError::Coordinates { what, got: all.len(), most: of.most() });
        }
        self.channels = coordinate_channels(of, all.len());
        for (kind, dof, displacement, _) in &all {
            let slot = self.slot(description, dof, displacement, Of::Displacement(*kind))?;
            self.states.push(slot);
        }
        for (kind, dof, _, velocity) in &all {
            let slot = self.slot(description, dof, velocity, Of::Velocity(*kind))?;
            self.states.push(slot);
        }
        Ok(())
    }

    /// What accelerometer `index`, B or C, reads.
    fn accelerometer(
        &mut self,
        description: &Description,
        spec: &Spec,
        index: usize,
        (instrument, at): (&'static str, &str),
    ) -> Result<(), ImportError> {
        let needs_velocity = spec.is_filtered && spec.read == ReadAt::Middle;
        for (axis, dof) in axes(at).iter().enumerate() {
            let Some((dof, of)) = dof.as_ref().and_then(|dof| spec.outputs.get_key_value(dof)) else { continue };
            let Some(acceleration) = &of.acceleration else { continue };
            self.acceleration[index][axis] =
                Some(self.slot(description, dof, acceleration, Of::Acceleration(Dof::Point))?);
            self.velocity[index][axis] = match &of.velocity {
                Some(velocity) if needs_velocity => {
                    Some(self.slot(description, dof, velocity, Of::Velocity(Dof::Point))?)
                }
                None if needs_velocity => {
                    let why =
                        "the filter of rig.converter needs it beside the acceleration; or take the converter `instant`";
                    return Err(ImportError::Missing { dof: dof.clone(), missing: "velocity", why });
                }
                _ => None,
            };
        }
        if self.acceleration[index].iter().any(Option::is_some) {
            return Ok(());
        }
        let known = spec.outputs.iter().filter(|(_, of)| of.acceleration.is_some()).map(|(dof, _)| dof);
        Err(place(instrument, "outputs with acceleration", at, known))
    }

    /// Displacement and force at the exciter's point.
    fn at_exciter(&mut self, description: &Description, spec: &Spec, exciter: &str) -> Result<(), ImportError> {
        for (axis, dof) in axes(exciter).iter().enumerate() {
            let Some(dof) = dof else { continue };
            let of = spec.outputs.get(dof);
            match of.and_then(|of| of.displacement.as_ref()) {
                Some(name) => {
                    self.travel[axis] = Some(self.slot(description, dof, name, Of::Displacement(Dof::Point))?);
                }
                None if spec.limits_travel && self.inputs[MOST_JOINTS + axis].is_some() => {
                    let why = "rig.gate.travel_limit_m needs it";
                    return Err(ImportError::Missing { dof: dof.clone(), missing: "displacement", why });
                }
                None => {}
            }
            if let Some(name) = of.and_then(|of| of.force.as_ref()) {
                self.force[axis] = Some(self.slot(description, dof, name, Of::Head)?);
            }
        }
        Ok(())
    }
}

/// The degrees of freedom of a place of the rig: along x and y of a point, or one for x.
fn axes(at: &str) -> [Option<String>; 2] {
    if at.contains('.') { [Some(at.to_owned()), None] } else { ["x", "y"].map(|axis| Some(format!("{at}.{axis}"))) }
}

fn place<'a>(
    instrument: &'static str,
    section: &'static str,
    at: &str,
    known: impl Iterator<Item = &'a String>,
) -> ImportError {
    let known: Vec<&str> = known.map(String::as_str).collect();
    let known = if known.is_empty() { String::from("none") } else { known.join(", ") };
    ImportError::Place { instrument, section, at: at.to_owned(), known }
}
