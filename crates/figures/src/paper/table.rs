//! The figures' data as comma-separated values (RFC 4180), with the units in the names of the columns.

use core::fmt::Write;

use super::branch::Stability;
use super::{Drive, FigureCurves, NaturalFrequencies};

impl FigureCurves {
    /// A line for each motion. `curve` counts from 0; a bifurcation has its kind in the last column.
    pub fn csv(&self) -> String {
        let mut text = String::from(
            "curve,beta1_deg,beta2_deg,frequency_hz,torque1_nm,force_x_n,amplitude1_rad,amplitude2_rad,\
             harmonic1_alpha1_rad,harmonic1_alpha2_rad,stability,bifurcation\n",
        );
        for (index, curve) in self.curves.iter().enumerate() {
            let branch = &curve.branch;
            for motion in &branch.motions {
                let (torque, force) = match branch.drive {
                    Drive::Torque1 => (motion.excitation, 0.0),
                    Drive::ForceX => (0.0, motion.excitation),
                };
                let ([a1, a2], [h1, h2]) = (motion.amplitude_rad, motion.harmonic1_rad);
                let stability = match motion.stability {
                    Stability::Stable => "stable",
                    Stability::Unstable => "unstable",
                    Stability::Marginal => "marginal",
                };
                let bifurcation = motion.bifurcation.map_or("", |event| event.0.name());
                let _infallible = writeln!(
                    text,
                    "{index},{},{},{},{torque},{force},{a1},{a2},{h1},{h2},{stability},{bifurcation}",
                    branch.beta1_deg, branch.beta2_deg, motion.frequency_hz
                );
            }
        }
        text
    }
}

impl NaturalFrequencies {
    /// A line for each pose of each preset.
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
