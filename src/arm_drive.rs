//! The excitation of the commands that take the two-link arm alone.

use clap::Args;

use crate::failure::Failure;
use resonarm::arm::Load;
use resonarm_numeric::number::short;

/// The excitation A·sin(2πft): torque at joint 1, or a force at the tip.
#[derive(Clone, Debug, Args)]
pub(crate) struct ArmDriveFlags {
    /// Amplitude of a torque at joint 1, N·m.
    #[arg(long, value_name = "A", conflicts_with_all = ["force_x_n", "force_y_n"])]
    torque1_nm: Option<f64>,
    /// Amplitude of a force at point C along x, N.
    #[arg(long, value_name = "A")]
    force_x_n: Option<f64>,
    /// Amplitude of a force at point C along y, N.
    #[arg(long, value_name = "A")]
    force_y_n: Option<f64>,
}

impl ArmDriveFlags {
    /// Whether a torque or a force is named.
    pub fn is_given(&self) -> bool {
        self.torque1_nm.is_some() || self.is_force()
    }

    fn is_force(&self) -> bool {
        self.force_x_n.is_some() || self.force_y_n.is_some()
    }

    /// The peak load, exactly as given.
    pub fn load(&self) -> Result<Load, Failure> {
        self.direction().map(|_checked| self.given())
    }

    fn given(&self) -> Load {
        match self.torque1_nm {
            Some(torque) => Load::torque_nm(torque, 0.0),
            None => Load::force_n(self.force_x_n.unwrap_or(0.0), self.force_y_n.unwrap_or(0.0)),
        }
    }

    /// The direction of the load, with a largest component of 1, and its amplitude.
    pub fn direction(&self) -> Result<(Load, f64), Failure> {
        if self.torque1_nm.is_some() == self.is_force() {
            return Err(Failure::usage("give the excitation: --torque1-nm A, or --force-x-n A and --force-y-n A"));
        }
        let load = self.given();
        let amplitude = if self.is_force() { load.force_n.norm() } else { load.torque_nm.x.abs() };
        if !amplitude.is_finite() || amplitude == 0.0 {
            return Err(Failure::usage(format!(
                "the excitation's amplitude, of --torque1-nm or --force-x-n and --force-y-n, is {}: it must be a finite number other than 0",
                short(&amplitude)
            )));
        }
        Ok((load.scaled(1.0 / amplitude), amplitude))
    }
}
