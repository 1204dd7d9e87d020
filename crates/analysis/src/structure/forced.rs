//! A structure under a sinusoidal drive.

use core::fmt;

use resonarm_dynamics::structure::{Assembly, BodySpec, Dof, Law};

use crate::AnalysisError;

/// A structure and its drive, amplitude · sin Ωt: a force along an axis at a point, or a torque at a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Forced {
    pub(super) assembly: Assembly,
    pub(super) drive: Dof,
    pub(super) amplitude: f64,
}

impl Forced {
    /// The structure under amplitude · sin Ωt at `drive`, one of its degrees of freedom; N, N·m at a joint, or m/s² of
    /// the base.
    pub fn new(assembly: Assembly, drive: Dof, amplitude: f64) -> Forced {
        Forced { assembly, drive, amplitude }
    }

    /// The same without damping: dampers of joints, damping ratios, losses of contacts, dampers between points.
    ///
    /// # Errors
    /// [`AnalysisError::Dissipates`] for an element that has no such part to leave out.
    pub fn undamped(&self) -> Result<Forced, AnalysisError> {
        let mut spec = self.assembly.spec().clone();
        match &mut spec.body {
            BodySpec::Chain(chain) => chain.links.iter_mut().for_each(|link| link.damping_nm_s_rad = 0.0),
            BodySpec::Modal(modal) => modal.modes.iter_mut().for_each(|mode| mode.damping_ratio = 0.0),
        }
        for (index, element) in spec.elements.iter_mut().enumerate() {
            match &mut element.law {
                Law::KelvinVoigt { damping, .. } | Law::HuntCrossley { damping, .. } | Law::Linear { damping, .. } => {
                    *damping = 0.0;
                }
                Law::Cubic { .. } | Law::Gap { .. } => {}
                law => return Err(AnalysisError::Dissipates { element: index + 1, law: law.name() }),
            }
        }
        let acts = |law: &Law| !matches!(law, Law::Linear { stiffness: 0.0, .. });
        spec.elements.retain(|element| acts(&element.law));
        Ok(Forced { assembly: Assembly::new(&spec)?, ..self.clone() })
    }

    /// The structure.
    pub fn assembly(&self) -> &Assembly {
        &self.assembly
    }

    /// Where it is driven.
    pub fn drive(&self) -> Dof {
        self.drive
    }

    /// The peak of the drive, N, or N·m at a joint.
    pub fn amplitude(&self) -> f64 {
        self.amplitude
    }

    /// The unit of the drive.
    pub fn unit(&self) -> &'static str {
        self.drive.load_unit()
    }
}

/// What varies along a branch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coordinate {
    /// Ω/2π, Hz.
    FrequencyHz,
    /// The peak of the drive, N, or N·m at a joint.
    Amplitude,
}

impl Coordinate {
    /// The name in results.
    pub const fn name(self) -> &'static str {
        match self {
            Coordinate::FrequencyHz => "frequency_hz",
            Coordinate::Amplitude => "amplitude",
        }
    }
}

impl fmt::Display for Coordinate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
