//! Which way a zone bends, read from its backbone.

use super::super::branch::zone_hz;
use super::super::{Drive, PaperError, Subject};
use resonarm_analysis::{ArmParameter, BackboneOptions, Bending, BranchOptions, ForcedArm, backbone, modes};
use resonarm_dynamics::arm::Arm;

/// A backbone up to some excitation.
#[derive(Clone, Debug)]
pub(super) struct Bent {
    pub bending: Option<Bending>,
    /// The shift of the resonance from small to full excitation, Hz.
    pub shift_hz: f64,
}

impl Bent {
    pub fn words(&self) -> String {
        let bending = match self.bending {
            None => "straight",
            Some(Bending::Hardening) => "stiff",
            Some(Bending::Softening) => "soft",
            Some(Bending::HardeningThenSoftening) => "stiff, then soft",
            Some(Bending::SofteningThenHardening) => "soft, then stiff",
            Some(Bending::Mixed) => "turning more than once",
        };
        format!("{bending} ({} Hz)", format!("{:+.3}", self.shift_hz).replace('-', "−"))
    }

    pub fn is(&self, bending: Bending) -> bool {
        self.bending == Some(bending)
    }

    pub fn is_mixed(&self) -> bool {
        !matches!(self.bending, None | Some(Bending::Hardening | Bending::Softening))
    }
}

/// The amplitude at which a backbone begins, rad: at a thousandth of it the frequency is that of the linear arm to
/// 1e-6.
const SMALLEST_RAD: f64 = 1e-3;

/// The backbone of a mode (0 or 1) up to an amplitude of the excitation.
pub(super) fn bent(subject: &Subject, arm: &Arm, mode: usize, drive: (Drive, f64)) -> Result<Bent, PaperError> {
    let [from, to] = zone_hz(modes(arm)[mode].frequency_hz);
    let options = BackboneOptions {
        smallest_rad: SMALLEST_RAD,
        largest_rad: f64::INFINITY,
        largest_drive: drive.1,
        branch: BranchOptions::new(from, to),
    };
    let forced = ForcedArm::new(arm.clone(), drive.0.direction(), 0.0);
    let curve = backbone(forced, mode, ArmParameter::Amplitude, &options).map_err(|source| PaperError::Analysis {
        preset: subject.preset(),
        beta2_deg: arm.pose().beta2_deg,
        drive: format!("backbone of mode {} to {}", mode + 1, drive.0.words(drive.1)),
        source: source.into(),
    })?;
    let ends =
        [curve.points.first(), curve.points.last()].map(|point| point.map_or(f64::NAN, |point| point.frequency_hz));
    Ok(Bent { bending: curve.bending(), shift_hz: ends[1] - ends[0] })
}
