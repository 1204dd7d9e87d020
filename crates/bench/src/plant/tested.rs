//! A chain of links or vibration modes under test, and where the rig is on it.

use alloc::format;
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;

use nalgebra::Vector2;

use crate::rig::{InstrumentName, Load, MOST_JOINTS, Measured};
use crate::structure::{
    Axis, COIL_CURRENT, Channel, Coordinates, LoadSet, coordinate_channels, element_channel, sensor_channels,
};
use resonarm_dynamics::structure::{Assembly, CoordinateUnit, Dof};

/// What the exciter or an instrument is at: the degrees of freedom that are its x and y, if the structure has them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// Along x and y.
    pub along: [Option<Dof>; 2],
}

impl Placed {
    /// A point of a structure: along x and y, each if it moves so.
    pub fn at_point(assembly: &Assembly, point: &str) -> Placed {
        Placed { along: ["x", "y"].map(|axis| assembly.dof(&format!("{point}.{axis}")).ok()) }
    }

    /// A number of each axis that the structure has there, and zero of one that it hasn't.
    pub(super) fn vector(&self, of: impl Fn(Dof) -> f64) -> Vector2<f64> {
        let [x, y] = self.along.map(|dof| dof.map_or(0.0, &of));
        Vector2::new(x, y)
    }
}

/// A sensor beside B and C where it is on a structure.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedSensor {
    /// The name of the sensor in the scenario.
    pub name: InstrumentName,
    /// The quantity that the sensor measures.
    pub measures: Measured,
    /// Its axes with the degrees of freedom that it reads, at most three.
    pub along: Vec<(Axis, Dof)>,
}

/// Where a rig is on a structure.
#[derive(Clone, Debug, PartialEq)]
pub struct Places {
    /// The exciter, with the impedance head.
    pub exciter: Placed,
    /// The degree of freedom that is the exciter's z, if the structure has it.
    pub exciter_z: Option<Dof>,
    /// The point of accelerometer B, with the axes that it reads.
    pub accelerometer_b: Placed,
    /// The point of accelerometer C, with the axes that it reads.
    pub accelerometer_c: Placed,
    /// The other sensors, in the order of their names.
    pub more: Vec<PlacedSensor>,
}

impl Places {
    /// The channels of the sensors beside B and C.
    pub fn more_channels(&self) -> Vec<Channel> {
        let mut channels = Vec::new();
        for (sensor, number) in self.more.iter().zip(1..) {
            let axes: Vec<Axis> = sensor.along.iter().map(|(axis, _)| *axis).collect();
            channels.extend(sensor_channels(sensor.name, sensor.measures, &axes, number, channels.len()));
        }
        channels
    }
}

/// A chain of links or vibration modes under test.
#[derive(Clone, Debug, PartialEq)]
pub struct TestedAssembly {
    /// The equations of the structure.
    pub assembly: Assembly,
    /// Its coordinates and their rates at sample 0.
    pub initial: Vec<f64>,
    /// Where the rig is on it.
    pub places: Places,
}

/// A degree of freedom that an accelerometer reads.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadDof {
    /// The degree of freedom.
    pub dof: Dof,
    /// Its name, such as `tip.x`.
    pub name: String,
    /// The channel of the reading: head x, y; B x, y; C x, y.
    pub channel: usize,
}

impl TestedAssembly {
    /// A structure at rest: the exciter and accelerometer C are at the point `tip`, accelerometer B at the point `b`.
    pub fn at_rest(assembly: Assembly, tip: &str, b: &str) -> TestedAssembly {
        let exciter_z = assembly.dof(&format!("{tip}.z")).ok();
        let [tip, b] = [tip, b].map(|point| Placed::at_point(&assembly, point));
        let places = Places { exciter: tip, exciter_z, accelerometer_b: b, accelerometer_c: tip, more: Vec::new() };
        TestedAssembly { initial: vec![0.0; 2 * assembly.coordinates()], places, assembly }
    }

    /// The channels of its states: coordinates, rates, the current of a shaker's coil if there is one, states of elements.
    pub fn states(&self, has_coil: bool) -> Vec<Channel> {
        let of = match self.assembly.coordinate_unit() {
            CoordinateUnit::Radian => Coordinates::Joints,
            CoordinateUnit::MetreRootKilogram => Coordinates::Modes,
        };
        let elements = self.assembly.elements().iter().filter(|element| element.state.is_some());
        let of_elements = elements.filter_map(|element| element_channel(element.number - 1, element.at.is_angle()));
        let coil = has_coil.then_some(COIL_CURRENT);
        let coordinates = coordinate_channels(of, self.assembly.coordinates());
        coordinates.into_iter().chain(coil).chain(of_elements).collect()
    }

    /// The loads that it takes, with those that every plant has.
    pub fn load_set(&self) -> LoadSet {
        LoadSet::native_and((0..Load::PARTS).filter(|place| self.loaded()[*place].is_some()))
    }

    /// What the accelerometers read: the axes of C, then of B, that the structure has. An axis that both read is that
    /// of C.
    pub fn read(&self) -> Vec<ReadDof> {
        let mut read: Vec<ReadDof> = Vec::new();
        for (placed, first) in [(&self.places.accelerometer_c, 4), (&self.places.accelerometer_b, 2)] {
            for (dof, axis) in placed.along.iter().zip(0..) {
                let Some(dof) = dof.filter(|dof| read.iter().all(|known| known.dof != *dof)) else { continue };
                read.push(ReadDof { dof, name: self.dof_name(dof), channel: first + axis });
            }
        }
        read
    }

    /// Both links of a chain of two, from start to end at rest, m, if the accelerometers B and C are at their ends and
    /// read both axes there: then the accelerations give the angles.
    pub fn measured_links_m(&self) -> Option<[Vector2<f64>; 2]> {
        let rest_m = self.assembly.rest_m()?;
        let [base, elbow, tip] = rest_m.as_slice() else { return None };
        let at = |point| Placed::at_point(&self.assembly, point);
        let is_measured = self.places.accelerometer_b == at("joint2") && self.places.accelerometer_c == at("tip");
        let link = |start: &[f64; 2], end: &[f64; 2]| Vector2::from(*end) - Vector2::from(*start);
        is_measured.then(|| [link(base, elbow), link(elbow, tip)])
    }

    /// The name of a degree of freedom of the structure.
    pub fn dof_name(&self, dof: Dof) -> String {
        self.assembly.dof_names().into_iter().find(|name| self.assembly.dof(name) == Ok(dof)).unwrap_or_default()
    }

    /// The degree of freedom on which each of [`LOADS`](crate::structure::LOADS) acts: torques about the joints, and
    /// forces of the exciter along x, y and z; `None` of a load that nothing takes.
    pub fn loaded(&self) -> [Option<Dof>; Load::PARTS] {
        let [x, y] = self.places.exciter.along;
        core::array::from_fn(|place| match place.checked_sub(MOST_JOINTS) {
            None => self.assembly.dof(&format!("joint{}", place + 1)).ok(),
            Some(axis) => [x, y, self.places.exciter_z][axis],
        })
    }

    /// The loads that are not zero, by their keys in a scenario, with what they act on.
    fn acting(&self, amplitude: &Load) -> impl Iterator<Item = (&'static str, f64, Option<Dof>)> {
        let all = Load::NAMES.into_iter().zip(amplitude.parts()).zip(self.loaded());
        all.map(|((name, load), dof)| (name, load, dof)).filter(|(_, load, _)| *load != 0.0)
    }

    /// The first load that nothing of the structure takes: its name and its amplitude, N or N·m.
    pub fn idle_load(&self, amplitude: &Load) -> Option<(&'static str, f64)> {
        self.acting(amplitude).find(|(_, _, dof)| dof.is_none()).map(|(name, load, _)| (name, load))
    }

    /// The loads that the structure accepts, by their keys in a scenario. A force comes with the degree of freedom on
    /// which it acts, as "`exciter_x` at tip.z".
    pub fn accepted_loads(&self) -> impl Iterator<Item = String> {
        Load::NAMES.into_iter().zip(self.loaded()).filter_map(|(name, dof)| {
            let acts_on = self.dof_name(dof?);
            Some(if acts_on == name { format!("`{name}`") } else { format!("`{name}` at {acts_on}") })
        })
    }

    /// The degrees of freedom that a load drives, with its amplitude at each, N or N·m; empty if nothing of the structure
    /// takes a part of it.
    pub fn driven(&self, amplitude: &Load) -> Vec<(Dof, f64)> {
        self.acting(amplitude).map(|(_, load, dof)| Some((dof?, load))).collect::<Option<_>>().unwrap_or_default()
    }
}
