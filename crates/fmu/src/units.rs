//! Units as an FMU writes them, with their exponents in SI base units.

use resonarm_bench::structure::Quantity;

/// Unit of a variable in the model description.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Unit {
    /// Name of the unit.
    pub name: &'static str,
    /// Attributes of its `BaseUnit`; empty if it has none: roots of base units can't be written.
    pub base: &'static str,
}

/// Unit of time: the second.
pub(crate) const SECOND: Unit = Unit { name: "s", base: "s=\"1\"" };
/// Degree of angle: π/180 rad.
pub(crate) const DEGREE: Unit = Unit { name: "deg", base: "rad=\"1\" factor=\"0.017453292519943295\"" };

/// The unit of a channel; `None` of a number without one.
pub(crate) const fn of(quantity: Quantity) -> Option<Unit> {
    let (name, base) = match quantity {
        Quantity::Angle => ("rad", "rad=\"1\""),
        Quantity::AngularVelocity => ("rad/s", "rad=\"1\" s=\"-1\""),
        Quantity::Torque => ("N.m", "kg=\"1\" m=\"2\" s=\"-2\""),
        Quantity::Force => ("N", "kg=\"1\" m=\"1\" s=\"-2\""),
        Quantity::Acceleration => ("m/s2", "m=\"1\" s=\"-2\""),
        Quantity::Current => ("A", "A=\"1\""),
        Quantity::ModalDisplacement => ("m.kg^0.5", ""),
        Quantity::ModalVelocity => ("m.kg^0.5/s", ""),
        Quantity::Displacement | Quantity::Length => ("m", "m=\"1\""),
        Quantity::Velocity => ("m/s", "m=\"1\" s=\"-1\""),
        Quantity::Branch => return None,
    };
    Some(Unit { name, base })
}
