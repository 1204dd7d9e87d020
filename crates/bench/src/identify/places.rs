//! Degrees of freedom at which a rig drives a structure and reads its accelerations.

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

use crate::plant::{Placed, TestedAssembly};
use crate::rig::{Measured, PlaceName, RigSpec, SensorSpec};
use crate::structure::Axis;

/// Names of the axes x and y.
const AXES: [(&str, Axis); 2] = [("x", Axis::X), ("y", Axis::Y)];

/// One value of the readings of a sample.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadingPlace {
    /// Name of the reading: the sensor and its axis, such as `c-x`.
    pub name: String,
    /// Degree of freedom whose acceleration it is, such as `tip.x`; `None` if it is another quantity, or the structure has no
    /// such degree of freedom.
    pub at: Option<String>,
    /// The instrument that reads the motion.
    pub sensor: SensorSpec,
    /// The axis along which it reads.
    pub axis: Axis,
}

/// Where a rig drives a structure and reads its motion.
#[derive(Clone, Debug, PartialEq)]
pub struct RigPlaces {
    /// Degrees of freedom along which the exciter pushes with its x and y; `None` where the structure does not move.
    pub exciter: [Option<String>; 2],
    /// Readings of a sample after those of the head: accelerometer B along x and y, C along x and y, other sensors.
    pub readings: Vec<ReadingPlace>,
}

impl RigPlaces {
    /// Returns the places of a rig on a structure whose equations are known.
    pub fn of_structure(tested: &TestedAssembly, rig: &RigSpec) -> RigPlaces {
        let names = |placed: &Placed| placed.along.map(|dof| dof.map(|dof| tested.dof_name(dof)));
        let places = &tested.places;
        let mut readings = Vec::new();
        for (name, sensor, placed) in
            [("b", &rig.sensors.b, &places.accelerometer_b), ("c", &rig.sensors.c, &places.accelerometer_c)]
        {
            readings.extend(pair(name, sensor, names(placed)));
        }
        for placed in &places.more {
            let Some(sensor) = rig.sensors.more.get(&placed.name) else { continue };
            readings.extend(placed.along.iter().map(|(axis, dof)| {
                let at = (placed.measures == Measured::Acceleration).then(|| tested.dof_name(*dof));
                ReadingPlace { name: format!("{}-{}", placed.name, axis.name()), at, sensor: *sensor, axis: *axis }
            }));
        }
        RigPlaces { exciter: names(&places.exciter), readings }
    }

    /// Returns the places that a rig states, for a structure whose equations are not known. Places that it does not state are
    /// those of the arm: `tip` of the exciter and of C, `joint2` of B. Sensors beside B and C are left out.
    pub fn of_rig(rig: &RigSpec) -> RigPlaces {
        let names = |at: &Option<PlaceName>, default: &str| {
            let at = at.as_ref().map_or(default, PlaceName::as_str);
            // A place that names its axis is a single degree of freedom, and x stands for it.
            if at.contains('.') {
                return [Some(at.to_string()), None];
            }
            AXES.map(|(axis, _)| Some(format!("{at}.{axis}")))
        };
        let tip = rig.exciter.at.as_ref().map_or("tip", PlaceName::as_str);
        let b = pair("b", &rig.sensors.b, names(&rig.sensors.b.at, "joint2"));
        let c = pair("c", &rig.sensors.c, names(&rig.sensors.c.at, tip));
        RigPlaces { exciter: names(&rig.exciter.at, tip), readings: b.into_iter().chain(c).collect() }
    }
}

fn pair(name: &str, sensor: &SensorSpec, at: [Option<String>; 2]) -> Vec<ReadingPlace> {
    let reading = |((axis_name, axis), at): ((&str, Axis), Option<String>)| ReadingPlace {
        name: format!("{name}-{axis_name}"),
        at,
        sensor: *sensor,
        axis,
    };
    AXES.into_iter().zip(at).map(reading).collect()
}
