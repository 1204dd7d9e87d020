//! The commands whose arm is not yet a chain, on a structure of a scenario in its place.

pub(crate) mod basins;
pub(crate) mod compare;
pub(crate) mod sweep;
pub(crate) mod walk;

use clap::Args;
use nalgebra::Complex;
use serde_json::Value;

use crate::failure::Failure;
pub(crate) use crate::figures::captions::{foreign_label, label};
use crate::read_at::{self, ReadAt};
pub(crate) use crate::read_at::{displacement_unit, dof};
use resonarm::analysis::structure::Reading;
use resonarm::structure::{Assembly, Dof};
use resonarm_figures::plot::{Axis, Color, Panel};

/// The excitation of a structure.
#[derive(Clone, Debug, Args)]
pub(crate) struct StructureDriveFlags {
    /// Of a scenario's structure: what is driven, point and axis as tip.x, or a joint as joint2.
    #[arg(long, value_name = "DOF")]
    pub drive: Option<String>,
    /// Amplitude at --drive, N, or N·m at a joint.
    #[arg(long, value_name = "A", requires = "drive")]
    amplitude: Option<f64>,
}

impl StructureDriveFlags {
    /// Refuses them for the two-link arm.
    pub fn refuse(&self) -> Result<(), Failure> {
        match &self.drive {
            Some(drive) => Err(Failure::usage(format!(
                "--drive {drive} is for a scenario with a [structure]: of the arm give --torque1-nm, --force-x-n or --force-y-n"
            ))),
            None => Ok(()),
        }
    }

    /// The degree of freedom that is driven, with its name.
    pub fn dof(&self, assembly: &Assembly) -> Result<(Dof, &str), Failure> {
        let Some(name) = &self.drive else {
            let known = assembly.dof_names().join(", ");
            return Err(Failure::usage(format!(
                "give the excitation of the structure: --drive DOF --amplitude A, with DOF one of {known}"
            )));
        };
        Ok((dof("--drive", name, assembly)?, name))
    }

    /// The amplitude, finite and not 0.
    pub fn needed_amplitude(&self) -> Result<f64, Failure> {
        match self.amplitude {
            Some(amplitude) if amplitude.is_finite() && amplitude != 0.0 => Ok(amplitude),
            Some(amplitude) => Err(Failure::value("--amplitude", amplitude, "it must be a finite number other than 0")),
            None => Err(Failure::usage("give the amplitude of the excitation: --amplitude A")),
        }
    }
}

/// The refusal of a load of the arm on a structure.
pub(crate) fn arm_drive(assembly: &Assembly) -> Failure {
    let known = assembly.dof_names().join(", ");
    Failure::usage(format!(
        "the scenario has a [structure]: give its load by --drive DOF --amplitude A, with DOF one of {known}"
    ))
}

/// The degrees of freedom that are read, with their names.
pub(crate) type Read<'a> = Vec<(Dof, &'a str)>;

/// The degrees of freedom of --at; without them what is driven.
pub(crate) fn read<'a>(at: &'a [String], drive: (Dof, &'a str), assembly: &Assembly) -> Result<Read<'a>, Failure> {
    let named = at.iter().map(|name| Ok((dof("--at", name, assembly)?, name.as_str())));
    let read = named.collect::<Result<Read<'_>, Failure>>()?;
    let still = read
        .iter()
        .find(|(dof, _)| dof.is_base())
        .or(Some(&drive).filter(|drive| read.is_empty() && drive.0.is_base()));
    if let Some((_, name)) = still {
        let points = assembly.points().join(", ");
        return Err(Failure::usage(format!(
            "{name} is the base, from which displacements count: name by --at where the motion is read, on one of the points {points}"
        )));
    }
    Ok(if read.is_empty() { vec![drive] } else { read })
}

/// The colours of the degrees of freedom in figures.
pub(crate) const COLORS: [Color; 4] = [Color::Blue, Color::Vermillion, Color::Orange, Color::Black];

/// The unit of a load at a degree of freedom.
pub(crate) fn load_unit(dof: Dof) -> &'static str {
    dof.load_unit()
}

/// The amplitude of a component.
pub(crate) fn amplitude(harmonic: &Complex<f64>) -> f64 {
    libm::hypot(harmonic.re, harmonic.im)
}

/// Readings by the names of the degrees of freedom.
pub(crate) fn readings(of: &[Reading], read: &Read<'_>) -> Value {
    let at = |(dof, name): &(Dof, &str)| ReadAt { dof: *dof, name: (*name).to_owned() };
    read_at::readings(of, &read.iter().map(at).collect::<Vec<_>>())
}

/// A panel for each unit of what is read, of its largest displacements over `x`; `draw` adds a degree of freedom by its
/// number among those that are read.
pub(crate) fn displacement_panels(
    x: &str,
    read: &Read<'_>,
    mut draw: impl FnMut(Panel, usize, &str, Color) -> Panel,
) -> Vec<Panel> {
    let unit = |(dof, _): &(Dof, &str)| displacement_unit(*dof);
    let units: Vec<_> = ["m", "rad"].into_iter().filter(|wanted| read.iter().any(|of| unit(of) == *wanted)).collect();
    let panel = |wanted: &&str| {
        let empty = Panel::new(Axis::linear(x), Axis::linear(format!("largest displacement ({wanted})")));
        let colored = read.iter().zip(COLORS.into_iter().cycle()).enumerate();
        let of_unit = colored.filter(|(_, (of, _))| unit(of) == *wanted);
        of_unit.fold(empty, |panel, (index, ((_, name), color))| draw(panel, index, name, color))
    };
    units.iter().map(panel).collect()
}
