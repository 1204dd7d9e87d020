//! Sensors on a structure of which only the names of its degrees of freedom are known: an FMU, or a program's own.

use alloc::collections::BTreeMap;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use thiserror::Error;

use super::channel::{AXES, Axis, Channel, sensor_channels};
use crate::rig::{InstrumentName, Measured, PlaceName, SensorSpec};

/// A channel of a sensor, and the degree of freedom that it reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NamedReading {
    /// The channel, with the name and the unit of the reading.
    pub channel: Channel,
    /// The place of the degree of freedom among those of the structure.
    pub dof: usize,
}

/// A sensor is where the structure has nothing to read.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("rig.sensors.{sensor}: `at` is `{at}`, and what the structure lets a sensor read are {known}")]
pub struct NothingSensed {
    /// The sensor that has nothing to read.
    pub sensor: InstrumentName,
    /// The place that the scenario gives it.
    pub at: String,
    /// The degrees of freedom that there are.
    pub known: String,
}

/// The readings of sensors on a structure whose degrees of freedom have these names: `tip.x` of a point along an axis,
/// `joint1` of a joint. A sensor at a point reads every axis of the point that is named.
///
/// # Errors
/// [`NothingSensed`] if a sensor is where nothing is named.
pub fn named_readings(
    sensors: &BTreeMap<InstrumentName, SensorSpec>,
    dofs: &[&str],
) -> Result<Vec<NamedReading>, NothingSensed> {
    let mut readings: Vec<NamedReading> = Vec::new();
    for ((name, sensor), number) in sensors.iter().zip(1..) {
        let at = sensor.at.as_ref().map_or("", PlaceName::as_str);
        let place = |wanted: &str| dofs.iter().position(|dof| *dof == wanted);
        let alone = |axis| place(at).map(|dof| (axis, dof)).into_iter().collect();
        let along: Vec<(Axis, usize)> = match at.rsplit_once('.') {
            // An angle is that of a joint, and no joint has an axis in its name.
            Some(_) if sensor.measures == Measured::Angle => Vec::new(),
            None if sensor.measures == Measured::Angle => alone(Axis::AboutZ),
            Some((_, along)) => {
                alone(AXES.into_iter().find(|(_, name)| *name == along).map_or(Axis::Scalar, |(axis, _)| axis))
            }
            None => AXES.into_iter().filter_map(|(axis, name)| Some((axis, place(&format!("{at}.{name}"))?))).collect(),
        };
        if along.is_empty() {
            let known = if dofs.is_empty() { String::from("none") } else { dofs.join(", ") };
            return Err(NothingSensed { sensor: *name, at: at.into(), known });
        }
        let axes: Vec<Axis> = along.iter().map(|(axis, _)| *axis).collect();
        let channels = sensor_channels(*name, sensor.measures, &axes, number, readings.len());
        readings.extend(channels.into_iter().zip(along).map(|(channel, (_, dof))| NamedReading { channel, dof }));
    }
    Ok(readings)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sensors(text: &str) -> BTreeMap<InstrumentName, SensorSpec> {
        let specs: crate::rig::SensorSpecs = toml::from_str(text).unwrap();
        specs.more
    }

    #[test]
    fn a_sensor_reads_the_axes_that_are_named() {
        let dofs = ["tip.x", "mid.x", "mid.z", "joint1"];
        let text =
            "m3.at = 'mid'\nenc = { at = 'joint1', measures = 'angle' }\nv = { at = 'tip.x', measures = 'velocity' }";
        let found = named_readings(&sensors(text), &dofs).unwrap();
        let named: Vec<(&str, usize)> = found.iter().map(|one| (one.channel.name.as_str(), one.dof)).collect();
        assert_eq!(
            named,
            [
                ("angle_enc_rad", 3),
                ("acceleration_m3_x_m_s2", 1),
                ("acceleration_m3_z_m_s2", 2),
                ("velocity_v_x_m_s", 0)
            ]
        );
        let wrong = |text: &str| named_readings(&sensors(text), &dofs).unwrap_err().to_string();
        insta::assert_snapshot!(wrong("m3.at = 'top'"), @"rig.sensors.m3: `at` is `top`, and what the structure lets a sensor read are tip.x, mid.x, mid.z, joint1");
        insta::assert_snapshot!(wrong("m3 = { at = 'tip.x', measures = 'angle' }"), @"rig.sensors.m3: `at` is `tip.x`, and what the structure lets a sensor read are tip.x, mid.x, mid.z, joint1");
    }
}
