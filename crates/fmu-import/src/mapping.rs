//! The variables of an FMU by which a plant drives and reads it.

mod variable;

use std::collections::BTreeMap;

use crate::description::Description;
use crate::error::ImportError;
use crate::spec::{OutputsOf, ReadAt, Spec};
use resonarm_bench::rig::{Load, MOST_JOINTS};
use resonarm_bench::structure::{
    Channel, Coordinates, LoadSet, NamedReading, Quantity, coordinate_channels, named_readings,
};
pub(crate) use variable::{Block, Slot};
use variable::{Of, named, parameters, warn_of_unit};

/// The point of the exciter unless the scenario names another.
const TIP: &str = "tip";
/// The point of accelerometer B unless the scenario names another, if something is read there.
const ELBOW: &str = "joint2";

/// The kind of a degree of freedom, and its number.
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

/// The variables of an FMU that are set and read, and the places of loads, states and readings among them.
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
    /// Displacements of the exciter's point along x, y and z.
    pub travel: [Option<Slot>; 3],
    /// Forces in the impedance head.
    pub force: Axes,
    /// The channels of the sensors beside B and C.
    pub sensor_channels: Vec<Channel>,
    /// What the sensors read: B x, y; C x, y; then the channels of the others.
    pub sensors: Vec<Sensed>,
}

/// Displacement, velocity and acceleration of a degree of freedom, as far as they are read.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Sensed {
    pub displacement: Option<Slot>,
    pub velocity: Option<Slot>,
    pub acceleration: Option<Slot>,
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
        for (instrument, at) in [("sensors.b", b), ("sensors.c", c)] {
            mapping.accelerometer(description, spec, (instrument, at))?;
        }
        mapping.at_exciter(description, spec, exciter)?;
        mapping.sensors(description, spec)?;
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
        for (slot, dof) in self.inputs.iter_mut().zip(driven(exciter)) {
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

    /// Adds a variable of a degree of freedom to those that are read, and returns its place there.
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
        let (channels, all) = coordinates(outputs)?;
        self.channels = channels;
        for Coordinate { kind, dof, displacement, .. } in &all {
            let slot = self.slot(description, dof, displacement, Of::Displacement(*kind))?;
            self.states.push(slot);
        }
        for Coordinate { kind, dof, velocity, .. } in &all {
            let slot = self.slot(description, dof, velocity, Of::Velocity(*kind))?;
            self.states.push(slot);
        }
        Ok(())
    }

    /// Maps an accelerometer, B or C: its accelerations, and the velocities that a filter needs.
    fn accelerometer(
        &mut self,
        description: &Description,
        spec: &Spec,
        (instrument, at): (&'static str, &str),
    ) -> Result<(), ImportError> {
        let needs_velocity = spec.is_filtered && spec.read == ReadAt::Middle;
        let mut sensed = [Sensed::default(); 2];
        for (sensed, dof) in sensed.iter_mut().zip(&axes(at)) {
            let Some((dof, of)) = dof.as_ref().and_then(|dof| spec.outputs.get_key_value(dof)) else { continue };
            let Some(acceleration) = &of.acceleration else { continue };
            sensed.acceleration = Some(self.slot(description, dof, acceleration, Of::Acceleration(Dof::Point))?);
            sensed.velocity = match &of.velocity {
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
        if sensed.iter().any(|axis| axis.acceleration.is_some()) {
            self.sensors.extend(sensed);
            return Ok(());
        }
        let known = spec.outputs.iter().filter(|(_, of)| of.acceleration.is_some()).map(|(dof, _)| dof);
        Err(place(instrument, "outputs with acceleration", at, known))
    }

    /// What the sensors beside B and C read.
    fn sensors(&mut self, description: &Description, spec: &Spec) -> Result<(), ImportError> {
        let dofs: Vec<&str> = spec.outputs.keys().map(String::as_str).collect();
        // A filter follows the motion between two steps by all derivatives from the measured one up to the acceleration.
        let is_followed = spec.is_filtered && spec.read == ReadAt::Middle;
        for NamedReading { channel, dof } in named_readings(&spec.sensors, &dofs)? {
            let (dof, kind) = (dofs[dof], Dof::parse("outputs", dofs[dof])?);
            let Some(of) = spec.outputs.get(dof) else { continue };
            let order = match channel.quantity {
                Quantity::Displacement | Quantity::Angle => 0,
                Quantity::Velocity => 1,
                _ => 2,
            };
            let mut slot = |key, name: &Option<String>, number: usize, quantity: Of| {
                let why = match number == order {
                    true => "a sensor of [rig.sensors] measures it",
                    // The velocity also tells the acceleration at the start of a hold.
                    false if is_followed && (number > order || number == 1) => {
                        "the filter of rig.converter needs it; or take the converter `instant`"
                    }
                    false => return Ok(None),
                };
                let missing = || ImportError::Missing { dof: dof.to_owned(), missing: key, why };
                self.slot(description, dof, name.as_ref().ok_or_else(missing)?, quantity).map(Some)
            };
            let sensed = Sensed {
                displacement: slot("displacement", &of.displacement, 0, Of::Displacement(kind))?,
                velocity: slot("velocity", &of.velocity, 1, Of::Velocity(kind))?,
                acceleration: slot("acceleration", &of.acceleration, 2, Of::Acceleration(kind))?,
            };
            self.sensor_channels.push(channel);
            self.sensors.push(sensed);
        }
        Ok(())
    }

    /// Displacement and force at the exciter's point.
    fn at_exciter(&mut self, description: &Description, spec: &Spec, exciter: &str) -> Result<(), ImportError> {
        for (axis, dof) in directions(exciter).iter().enumerate() {
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
            // The head has the axes x and y.
            if let (Some(name), true) = (of.and_then(|of| of.force.as_ref()), axis < self.force.len()) {
                self.force[axis] = Some(self.slot(description, dof, name, Of::Head)?);
            }
        }
        Ok(())
    }
}

/// A degree of freedom that is a coordinate, with the names of its variables.
struct Coordinate<'a> {
    kind: Dof,
    dof: &'a String,
    displacement: &'a String,
    velocity: &'a String,
}

/// The coordinates: degrees of freedom with displacement and velocity, joints and modes by their numbers, points by their
/// names; with the channels of all states.
fn coordinates(outputs: &BTreeMap<String, OutputsOf>) -> Result<(Vec<Channel>, Vec<Coordinate<'_>>), ImportError> {
    let mut all = Vec::new();
    for (dof, of) in outputs {
        if let (Some(displacement), Some(velocity)) = (&of.displacement, &of.velocity) {
            all.push(Coordinate { kind: Dof::parse("outputs", dof)?, dof, displacement, velocity });
        }
    }
    // The sort is stable: points stay in the order of their names.
    all.sort_by_key(|coordinate| coordinate.kind);
    let Some(first) = all.first() else { return Ok((Vec::new(), all)) };
    let kind = core::mem::discriminant(&first.kind);
    if let Some(other) = all.iter().find(|other| core::mem::discriminant(&other.kind) != kind) {
        return Err(ImportError::Kinds { one: first.dof.clone(), other: other.dof.clone() });
    }
    let (of, what) = match first.kind {
        Dof::Point => (Coordinates::Displacements, "points"),
        Dof::Joint(_) => (Coordinates::Joints, "joints"),
        Dof::Mode(_) => (Coordinates::Modes, "modes"),
    };
    let is_in_order = |(index, coordinate): (usize, &Coordinate)| match coordinate.kind {
        Dof::Point => true,
        Dof::Joint(number) | Dof::Mode(number) => number == index + 1,
    };
    if all.len() > of.most() || !all.iter().enumerate().all(is_in_order) {
        return Err(ImportError::Coordinates { what, got: all.len(), most: of.most() });
    }
    Ok((coordinate_channels(of, all.len()), all))
}

/// The channels of an FMU as its specification names them, known without the FMU.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedChannels {
    /// Coordinates and their rates.
    pub states: Vec<Channel>,
    /// The loads, with those that every plant has.
    pub loads: LoadSet,
    /// The readings of the sensors beside B and C.
    pub sensors: Vec<Channel>,
}

impl NamedChannels {
    /// The channels of a specification.
    ///
    /// # Errors
    /// [`ImportError`] of names that are no degrees of freedom, and of sensors that are at none.
    pub fn new(spec: &Spec) -> Result<NamedChannels, ImportError> {
        let exciter = spec.exciter.as_deref().unwrap_or(TIP);
        let is_named = |dof: &Option<String>| dof.as_ref().is_some_and(|dof| spec.inputs.contains_key(dof));
        let places = driven(exciter).enumerate().filter(|(_, dof)| is_named(dof));
        let dofs: Vec<&str> = spec.outputs.keys().map(String::as_str).collect();
        let sensors = named_readings(&spec.sensors, &dofs)?.into_iter().map(|reading| reading.channel);
        Ok(NamedChannels {
            states: coordinates(&spec.outputs)?.0,
            loads: LoadSet::native_and(places.map(|(place, _)| place)),
            sensors: sensors.collect(),
        })
    }
}

/// The degrees of freedom that loads drive, in the order of [`LOADS`](resonarm_bench::structure::LOADS): the joints, then
/// the exciter's directions.
fn driven(exciter: &str) -> impl Iterator<Item = Option<String>> {
    (1..=MOST_JOINTS).map(|joint| Some(format!("joint{joint}"))).chain(directions(exciter))
}

/// The degrees of freedom along which the exciter pushes: x, y and z of a point, or one for x.
fn directions(exciter: &str) -> [Option<String>; 3] {
    let [x, y] = axes(exciter);
    [x, y, (!exciter.contains('.')).then(|| format!("{exciter}.z"))]
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
