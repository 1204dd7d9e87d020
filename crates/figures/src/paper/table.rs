//! The figures' data as comma-separated values (RFC 4180), with the units in the names of the columns.

use core::fmt::Write;

use super::branch::{Drive, stability};
use super::figure::{FigureCurves, NaturalFrequencies};
use resonarm_analysis::BifurcationKind;

impl FigureCurves {
    /// Writes a line for each response. `curve` counts from 0; a bifurcation has its kind in the last column. All
    /// curves of a figure are read at the same degrees of freedom, and have as many angles.
    pub fn csv(&self) -> String {
        let first = self.curves.first().map(|curve| &curve.branch);
        let mut text = String::from("curve");
        for number in 1..=first.map_or(0, |branch| branch.angles_deg.len()) {
            let _infallible = write!(text, ",link{number}_angle_deg");
        }
        text += ",frequency_hz,torque1_nm,force_x_n";
        for name in first.iter().flat_map(|branch| &branch.read.at) {
            // A degree of freedom without an axis is a joint.
            let unit = if name.contains('.') { "m" } else { "rad" };
            let name = name.replace('.', "_");
            let _infallible = write!(text, ",{name}_largest_{unit},{name}_amplitude_{unit}");
        }
        text += ",stability,bifurcation\n";
        for (index, curve) in self.curves.iter().enumerate() {
            let branch = &curve.branch;
            for orbit in &branch.orbits {
                // Both columns in every file, so that one reader takes the files of all figures.
                let (torque, force) = match branch.drive {
                    Drive::Torque1 => (orbit.excitation, 0.0),
                    Drive::ForceX => (0.0, orbit.excitation),
                };
                let stability = stability(orbit.is_stable);
                let angles: String = branch.angles_deg.iter().map(|angle_deg| format!(",{angle_deg}")).collect();
                let sizes = orbit.largest.iter().zip(&orbit.amplitude);
                let sizes: String = sizes.map(|(largest, amplitude)| format!(",{largest},{amplitude}")).collect();
                let bifurcation = orbit.bifurcation.map_or("", BifurcationKind::name);
                let _infallible = writeln!(
                    text,
                    "{index}{angles},{},{torque},{force}{sizes},{stability},{bifurcation}",
                    orbit.frequency_hz
                );
            }
        }
        text
    }
}

impl NaturalFrequencies {
    /// Writes a line for each pose of each preset.
    pub fn csv(presets: &[NaturalFrequencies]) -> String {
        let mut text = String::from("preset,beta2_deg,frequency1_hz,frequency2_hz\n");
        for curves in presets {
            for (beta2_deg, [f1, f2]) in curves.beta2_deg.iter().zip(&curves.frequency_hz) {
                let _infallible = writeln!(text, "{},{beta2_deg},{f1},{f2}", curves.preset);
            }
        }
        text
    }
}
