//! The degrees of freedom at which responses are read, and the readings in documents and tables.

use serde_json::{Value, json};

use crate::failure::Failure;
use resonarm::analysis::Reading;
use resonarm::excitation::Phasor;
use resonarm::structure::{Assembly, Dof};

/// A degree of freedom at which responses are read.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ReadAt {
    pub dof: Dof,
    /// Its name, as `tip.x` or `joint1`.
    pub name: String,
}

impl ReadAt {
    /// Returns the unit of a displacement there.
    pub fn unit(&self) -> &'static str {
        displacement_unit(self.dof)
    }

    /// Returns the name of a column of a table, `tip_x`.
    pub fn column(&self) -> String {
        self.name.replace('.', "_")
    }
}

/// Returns the modulus of a phasor.
pub(crate) fn size(phasor: Phasor) -> f64 {
    libm::hypot(phasor.re, phasor.im)
}

/// Returns the degrees of freedom without their names.
pub(crate) fn dofs(read: &[ReadAt]) -> Vec<Dof> {
    read.iter().map(|at| at.dof).collect()
}

/// Returns the degree of freedom that a flag names.
pub(crate) fn dof(flag: &str, name: &str, assembly: &Assembly) -> Result<Dof, Failure> {
    assembly.dof(name).map_err(|error| Failure::usage(format!("{flag} {name}: {error}")))
}

/// Resolves `--at`. Without it, responses are read at the degrees of freedom that are driven.
pub(crate) fn read_at(at: &[String], driven: &[ReadAt], assembly: &Assembly) -> Result<Vec<ReadAt>, Failure> {
    let named = at.iter().map(|name| Ok(ReadAt { dof: dof("--at", name, assembly)?, name: name.clone() }));
    let named = named.collect::<Result<Vec<_>, Failure>>()?;
    let read = if named.is_empty() { driven.to_vec() } else { named };
    // Displacements count from the base, so at the base itself they would be 0 whatever the load.
    if let Some(ReadAt { name, .. }) = read.iter().find(|at| at.dof.is_base()) {
        let points = assembly.points().join(", ");
        return Err(Failure::usage(format!(
            "{name} is the base, from which displacements count: choose by --at where the response is read, at one of the points {points}"
        )));
    }
    Ok(read)
}

/// Returns the unit of a displacement at a degree of freedom.
pub(crate) fn displacement_unit(dof: Dof) -> &'static str {
    if dof.is_angle() { "rad" } else { "m" }
}

/// Returns the amplitude of the component at the frequency of the drive.
pub(crate) fn amplitude(reading: &Reading) -> f64 {
    size(reading.harmonic1)
}

/// Returns the angle by which this component leads the drive, degrees.
pub(crate) fn phase_deg(reading: &Reading) -> f64 {
    libm::atan2(reading.harmonic1.im, reading.harmonic1.re).to_degrees()
}

/// Returns readings by the names of the degrees of freedom.
pub(crate) fn readings(of: &[Reading], read: &[ReadAt]) -> Value {
    let named = |(reading, at): (&Reading, &ReadAt)| {
        let value = json!({
            "largest": reading.largest, "mean": reading.mean, "amplitude": amplitude(reading),
            "phase_deg": phase_deg(reading), "unit": at.unit(),
        });
        (at.name.clone(), value)
    };
    Value::Object(of.iter().zip(read).map(named).collect())
}

/// Returns the columns of readings in a table, a comma before each.
pub(crate) fn columns(read: &[ReadAt]) -> String {
    let of = |at: &ReadAt| {
        let name = at.column();
        let unit = at.unit();
        format!(",{name}_largest_{unit},{name}_mean_{unit},{name}_amplitude_{unit},{name}_phase_deg")
    };
    read.iter().map(of).collect()
}

/// Returns the cells of readings in a table, a comma before each.
pub(crate) fn cells(of: &[Reading]) -> String {
    let cells = |reading: &Reading| {
        let Reading { largest, mean, .. } = reading;
        format!(",{largest:e},{mean:e},{:e},{}", amplitude(reading), phase_deg(reading))
    };
    of.iter().map(cells).collect()
}

/// States the largest displacements in words: `joint1 1.2e-3 rad, tip.x 4.5e-4 m`.
pub(crate) fn words(of: &[Reading], read: &[ReadAt]) -> String {
    let one = |(reading, at): (&Reading, &ReadAt)| format!("{} {:.6e} {}", at.name, reading.largest, at.unit());
    of.iter().zip(read).map(one).collect::<Vec<_>>().join(", ")
}
