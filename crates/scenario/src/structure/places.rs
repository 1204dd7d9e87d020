//! Places of the exciter and of the sensors on a structure.

use super::error::StructureSectionError;
use resonarm_bench::plant::{Placed, PlacedSensor, Places};
use resonarm_bench::rig::{InstrumentName, MOST_CHANNELS, Measured, Measurement, PlaceName, RigSpec, SensorSpec};
use resonarm_bench::structure::Axis;
use resonarm_dynamics::structure::{Assembly, Dof};

/// Name of the point at the end of a chain, the default place of the exciter and of accelerometer C.
const TIP: &str = "tip";

/// The default place where the tip moves along z alone: a load of the rig acts along x or y, unless it is placed at one
/// degree of freedom.
const TIP_Z: &str = "tip.z";

/// Resolves the places of the rig from `at` of the exciter and the accelerometers: a point, or a degree of
/// freedom that becomes their x axis. By default the exciter is at `tip`, or at `tip.z` if the tip moves along z alone,
/// accelerometer C is with the exciter, and B is at joint 2 or, on a structure without it, with the exciter.
pub(super) fn places(assembly: &Assembly, rig: &RigSpec) -> Result<Places, StructureSectionError> {
    let default = |wanted: &str| assembly.points().iter().any(|point| point == wanted);
    let exciter = match &rig.exciter.at {
        Some(at) => at.as_str(),
        None if default(TIP) && Placed::at_point(assembly, TIP).along == [None, None] => TIP_Z,
        None if default(TIP) => TIP,
        None => {
            let points = assembly.points();
            let reason = format!("is missing: name the point that it acts on; there are {}", points.join(", "));
            return Err(StructureSectionError::Rig { instrument: String::from("exciter"), reason });
        }
    };
    let b = rig.sensors.b.at.as_ref().map(PlaceName::as_str);
    let b = b.unwrap_or(if default("joint2") { "joint2" } else { exciter });
    let c = rig.sensors.c.at.as_ref().map_or(exciter, PlaceName::as_str);
    let more = rig.sensors.more.iter().map(|(name, sensor)| placed_sensor(assembly, *name, sensor));
    let more = more.collect::<Result<Vec<_>, _>>()?;
    let got = Measurement::CHANNELS + more.iter().map(|sensor| sensor.along.len()).sum::<usize>();
    if got > MOST_CHANNELS {
        return Err(StructureSectionError::TooManyChannels { got });
    }
    // At a degree of freedom the exciter pushes along it alone, which is its x.
    let exciter_z = if exciter.contains('.') { None } else { point_at(assembly, exciter, "z") };
    Ok(Places {
        exciter: placed(assembly, "exciter", exciter)?,
        exciter_z,
        accelerometer_b: placed(assembly, "sensors.b", b)?,
        accelerometer_c: placed(assembly, "sensors.c", c)?,
        more,
    })
}

/// Axes of a point, by name.
const AXES: [(&str, Axis); 3] = [("x", Axis::X), ("y", Axis::Y), ("z", Axis::Z)];

/// Returns the degree of freedom of a point along an axis, if the structure moves there.
fn point_at(assembly: &Assembly, point: &str, axis: &str) -> Option<Dof> {
    assembly.dof(&format!("{point}.{axis}")).ok().filter(|dof| !dof.is_base())
}

/// Resolves a sensor other than B and C: an angle sensor at a joint, or a sensor at one degree of freedom, or
/// at a point, where it reads every axis along which the structure moves.
fn placed_sensor(
    assembly: &Assembly,
    name: InstrumentName,
    sensor: &SensorSpec,
) -> Result<PlacedSensor, StructureSectionError> {
    let at = sensor.at.as_ref().map_or("", PlaceName::as_str);
    let error = |reason: String| StructureSectionError::Rig { instrument: format!("sensors.{name}"), reason };
    let is_angle = sensor.measures == Measured::Angle;
    let along = match at.rsplit_once('.') {
        _ if is_angle => match assembly.dof(at) {
            Ok(dof) if dof.is_angle() => vec![(Axis::AboutZ, dof)],
            Ok(_) => return Err(error(format!("is `{at}`, where no joint turns: `measures` can't be \"angle\""))),
            Err(unknown) => return Err(error(format!("is `{at}`, and the sensor measures an angle: {unknown}"))),
        },
        Some((_, along)) => {
            let dof = assembly.dof(at).map_err(|unknown| error(format!("is `{at}`: {unknown}")))?;
            if dof.is_base() {
                return Err(error(format!("is `{at}`: a run has no moving base; name a point of the structure")));
            }
            let axis = AXES.into_iter().find(|(name, _)| *name == along).map_or(Axis::Scalar, |(_, axis)| axis);
            vec![(axis, dof)]
        }
        None => AXES.into_iter().filter_map(|(name, axis)| Some((axis, point_at(assembly, at, name)?))).collect(),
    };
    if along.is_empty() {
        return Err(error(format!("is `{at}`: the points are {}", assembly.points().join(", "))));
    }
    Ok(PlacedSensor { name, measures: sensor.measures, along })
}

/// Resolves a place of the rig: a point, with its degrees of freedom along x and y as far as the structure has
/// them, or one degree of freedom as x.
fn placed(assembly: &Assembly, instrument: &str, at: &str) -> Result<Placed, StructureSectionError> {
    let points = assembly.points();
    let refused = |reason| StructureSectionError::Rig { instrument: instrument.to_owned(), reason };
    if at.contains('.') {
        let dof = assembly.dof(at).map_err(|error| refused(format!("is `{at}`: {error}")))?;
        if dof.is_base() {
            return Err(refused(format!(
                "is `{at}`, the moving base: it is driven by an acceleration, but a rig commands forces. To move the base, use frf, \
                 continue, simulate, sweep or basins; for a run, describe the free structure, with the mass of the table and modes \
                 at 0 Hz, and place the exciter at the table"
            )));
        }
        return Ok(Placed { along: [Some(dof), None] });
    }
    let found = Placed::at_point(assembly, at);
    let is_known = points.iter().any(|point| point == at);
    if is_known && found.along.iter().any(Option::is_some) {
        return Ok(found);
    }
    Err(refused(match is_known {
        true => format!("is `{at}`, which moves along z alone: write \"{at}.z\""),
        false => format!("is `{at}`: the points are {}", points.join(", ")),
    }))
}
