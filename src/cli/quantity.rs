//! What a branch can be followed in, by its name on the command line.

use super::continuation::DriveFlags;
use super::failure::Failure;
use crate::analysis::{ArmParameter, Coordinate};

/// Something that can vary.
#[derive(Clone, Copy, Debug)]
pub(super) struct Quantity {
    /// The name in results, with its unit.
    pub name: &'static str,
    pub coordinate: Coordinate<ArmParameter>,
    /// What stands behind `--from` and `--to`, as `-hz`.
    pub unit: &'static str,
    /// For people, with its unit.
    pub label: &'static str,
}

/// The parameters of the arm by their names in a scenario.
const ARM_PARAMETERS: [(&str, ArmParameter, &str); 10] = [
    ("inertia1_kg_m2", ArmParameter::Inertia1, "I_A1 (kg·m²)"),
    ("inertia2_kg_m2", ArmParameter::Inertia2, "I_S2 (kg·m²)"),
    ("mass2_kg", ArmParameter::Mass2, "m₂ (kg)"),
    ("length1_m", ArmParameter::Length1, "l₁ (m)"),
    ("length2_m", ArmParameter::Length2, "l₂ (m)"),
    ("centre2_m", ArmParameter::Centre2, "lc2 (m)"),
    ("stiffness1_nm_rad", ArmParameter::Stiffness1, "k₁ (N·m/rad)"),
    ("stiffness2_nm_rad", ArmParameter::Stiffness2, "k₂ (N·m/rad)"),
    ("damping1_nm_s_rad", ArmParameter::Damping1, "d₁ (N·m·s/rad)"),
    ("damping2_nm_s_rad", ArmParameter::Damping2, "d₂ (N·m·s/rad)"),
];

impl Quantity {
    /// The quantity that `flag` names; an amplitude is one of the drive.
    pub fn parse(flag: &str, name: &str, drive: &DriveFlags) -> Result<Quantity, Failure> {
        let of_arm =
            |which, name, unit, label| Quantity { name, coordinate: Coordinate::Parameter(which), unit, label };
        Ok(match name {
            "frequency" => Quantity {
                name: "frequency_hz",
                coordinate: Coordinate::FrequencyHz,
                unit: "-hz",
                label: "excitation frequency (Hz)",
            },
            "amplitude" if drive.is_force() => of_arm(ArmParameter::Amplitude, "force_n", "-n", "force at C (N)"),
            "amplitude" => of_arm(ArmParameter::Amplitude, "torque1_nm", "-nm", "torque at joint 1 (N·m)"),
            "beta1_deg" => of_arm(ArmParameter::Beta1Deg, "beta1_deg", "-deg", "β₁ (°)"),
            "beta2_deg" => of_arm(ArmParameter::Beta2Deg, "beta2_deg", "-deg", "β₂ (°)"),
            other => match ARM_PARAMETERS.into_iter().find(|(name, ..)| *name == other) {
                Some((name, which, label)) => of_arm(which, name, "", label),
                None => return Err(unknown(flag, other)),
            },
        })
    }
}

fn unknown(flag: &str, got: &str) -> Failure {
    let known = ["frequency", "amplitude", "beta1_deg", "beta2_deg"].into_iter();
    let known: Vec<&str> = known.chain(ARM_PARAMETERS.iter().map(|(name, ..)| *name)).collect();
    Failure::Usage(format!("{flag} is `{got}`: it must be one of {}", known.join(", ")))
}
