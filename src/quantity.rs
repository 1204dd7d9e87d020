//! The quantities in which a branch can be followed, by their names on the command line.

use crate::commands::continuation::DriveFlags;
use crate::failure::Failure;
use resonarm::analysis::{ArmParameter, Coordinate, UnknownArmParameter};

/// A quantity that can vary.
#[derive(Clone, Debug)]
pub(crate) struct Quantity {
    /// The name in results, with its unit.
    pub name: &'static str,
    pub coordinate: Coordinate<ArmParameter>,
    /// The suffix of `--from` and `--to`, as `-hz`.
    pub unit: &'static str,
    /// For people, with its unit.
    pub label: String,
}

impl Quantity {
    /// The quantity that `flag` names; an amplitude is that of the drive.
    pub fn parse(flag: &str, name: &str, drive: &DriveFlags) -> Result<Quantity, Failure> {
        if name == FREQUENCY {
            let label = String::from("excitation frequency (Hz)");
            return Ok(Quantity { name: "frequency_hz", coordinate: Coordinate::FrequencyHz, unit: "-hz", label });
        }
        let which: ArmParameter = name.parse().map_err(|_unknown: UnknownArmParameter| unknown(flag, name))?;
        let with_suffix = |unit| (which.name(), unit, format!("{} ({})", which.symbol(), which.unit()));
        let (name, unit, label) = match which {
            ArmParameter::Amplitude if drive.is_force() => ("force_n", "-n", String::from("force at C (N)")),
            ArmParameter::Amplitude => ("torque1_nm", "-nm", String::from("torque at joint 1 (N·m)")),
            ArmParameter::Beta1Deg | ArmParameter::Beta2Deg => with_suffix("-deg"),
            _ => with_suffix(""),
        };
        Ok(Quantity { name, coordinate: Coordinate::Parameter(which), unit, label })
    }
}

/// The frequency of the excitation, which is not a parameter of the arm.
const FREQUENCY: &str = "frequency";

fn unknown(flag: &str, got: &str) -> Failure {
    let known: Vec<&str> = core::iter::once(FREQUENCY).chain(ArmParameter::ALL.map(ArmParameter::name)).collect();
    Failure::Usage(format!("{flag} is `{got}`: it must be one of {}", known.join(", ")))
}
