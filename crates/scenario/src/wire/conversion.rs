//! Conversion of the units of signals, as DBC files write them.

use super::error::{Place, WireError};
use crate::dbc::Signal;
use resonarm_bench::structure::Quantity;

/// Standard acceleration of free fall, m/s² (ISO 80000-3).
const G_M_S2: f64 = 9.806_65;
/// One turn and, in the next constant, one degree, in rad.
const TURN_RAD: f64 = 2.0 * core::f64::consts::PI;
const DEGREE_RAD: f64 = TURN_RAD / 360.0;

/// Spellings of a unit, without blanks, and its size in the quantity's own unit.
type Unit = (&'static [&'static str], f64);

const FORCE: [Unit; 5] =
    [(&["N"], 1.0), (&["mN"], 1e-3), (&["daN"], 10.0), (&["kN"], 1e3), (&["lbf"], 4.448_221_615_260_5)];
const TORQUE: [Unit; 4] = [
    (&["Nm", "N.m", "N*m", "N·m", "N-m"], 1.0),
    (&["mNm", "mN.m", "mN*m", "mN·m"], 1e-3),
    (&["Ncm", "cNm"], 1e-2),
    (&["kNm", "kN.m", "kN*m", "kN·m"], 1e3),
];
const ACCELERATION: [Unit; 4] = [
    (&["m/s^2", "m/s2", "m/s²", "m/s/s", "mps2", "meters/sec^2"], 1.0),
    (&["mm/s^2", "mm/s2", "mm/s²"], 1e-3),
    // In a DBC of accelerations g is the acceleration of free fall and not the gram.
    (&["g", "G", "gn"], G_M_S2),
    (&["mg", "mG"], 1e-3 * G_M_S2),
];
const ANGLE: [Unit; 6] = [
    (&["rad", "radians"], 1.0),
    (&["mrad"], 1e-3),
    (&["urad", "µrad"], 1e-6),
    (&["deg", "°", "degree", "degrees"], DEGREE_RAD),
    (&["mdeg"], 1e-3 * DEGREE_RAD),
    (&["rev", "turn", "turns", "revolutions"], TURN_RAD),
];
const RATE: [Unit; 5] = [
    (&["rad/s"], 1.0),
    (&["mrad/s"], 1e-3),
    (&["deg/s", "°/s", "degrees/sec"], DEGREE_RAD),
    (&["rev/s", "turn/s", "turns/s"], TURN_RAD),
    (&["rpm", "1/min", "rev/min", "RPM"], TURN_RAD / 60.0),
];
const LENGTH: [Unit; 3] = [(&["m"], 1.0), (&["mm"], 1e-3), (&["um", "µm"], 1e-6)];
const CURRENT: [Unit; 2] = [(&["A"], 1.0), (&["mA"], 1e-3)];

const fn units(quantity: Quantity) -> (&'static [Unit], &'static str) {
    match quantity {
        Quantity::Force => (&FORCE, "N, mN, daN, kN, lbf"),
        Quantity::Torque => (&TORQUE, "Nm, mNm, Ncm, kNm"),
        Quantity::Acceleration => (&ACCELERATION, "m/s2, mm/s2, g, mg"),
        Quantity::Angle => (&ANGLE, "rad, mrad, urad, deg, mdeg, rev"),
        Quantity::AngularVelocity => (&RATE, "rad/s, mrad/s, deg/s, rev/s, rpm"),
        Quantity::Current => (&CURRENT, "A, mA"),
        Quantity::Displacement | Quantity::Length => (&LENGTH, "m, mm, um"),
        Quantity::Velocity => (&[(&["m/s"], 1.0), (&["mm/s"], 1e-3)], "m/s, mm/s"),
        Quantity::Branch => (&[(&["", "1"], 1.0)], "1"),
        Quantity::ModalDisplacement => (&[(&["m·√kg"], 1.0)], "m·√kg"),
        Quantity::ModalVelocity => (&[(&["m·√kg/s"], 1.0)], "m·√kg/s"),
    }
}

/// Returns the size of the signal's unit in the quantity's own unit.
///
/// # Errors
/// [`WireError::Unit`] with the known units if it is none of them.
pub(super) fn signal_factor(place: &Place, quantity: Quantity, signal: &Signal) -> Result<f64, WireError> {
    factor(quantity, signal.unit()).ok_or_else(|| WireError::Unit {
        place: place.clone(),
        got: signal.unit().to_string(),
        expected: quantity.unit(),
        known: units(quantity).1,
    })
}

/// Returns the size of `unit` in the quantity's own unit, if the unit is known.
fn factor(quantity: Quantity, unit: &str) -> Option<f64> {
    // Blanks are dropped, since DBC files write both `deg/s` and `deg / s`.
    let plain: String = unit.chars().filter(|letter| !letter.is_whitespace()).collect();
    let (units, _) = units(quantity);
    units.iter().find(|(names, _)| names.contains(&plain.as_str())).map(|(_, factor)| *factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_those_of_si_and_of_common_writing() {
        assert_eq!(factor(Quantity::Acceleration, "m / s^2"), Some(1.0));
        assert_eq!(factor(Quantity::Acceleration, "mg"), Some(9.80665e-3));
        assert_eq!(factor(Quantity::Torque, "N·m"), Some(1.0));
        assert_eq!(
            factor(Quantity::AngularVelocity, "rpm").map(|rpm| (60.0 * rpm - TURN_RAD).abs() < 1e-15),
            Some(true)
        );
        assert_eq!(factor(Quantity::Angle, "rev"), Some(TURN_RAD));
        assert_eq!(factor(Quantity::Force, "Nm"), None);
        assert_eq!(factor(Quantity::Force, ""), None);
    }
}
