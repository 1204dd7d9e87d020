//! The direction in which a zone bends, read from its backbone.

use crate::paper::branch::{Drive, beta2_deg, natural_hz, zone_hz};
use crate::paper::error::PaperError;
use crate::paper::subject::Subject;
use resonarm_analysis::Bending;
use resonarm_analysis::{BackboneOptions, backbone};
use resonarm_dynamics::structure::Assembly;

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

/// Returns the backbone of a mode (0 or 1) up to an amplitude of the excitation.
pub(super) fn bent(subject: &Subject, arm: &Assembly, mode: usize, drive: (Drive, f64)) -> Result<Bent, PaperError> {
    let forced = drive.0.forced(arm, drive.1)?;
    let joint1 = arm.dof("joint1")?;
    let mut options = BackboneOptions::new(&forced, mode, f64::INFINITY, drive.1, vec![joint1]);
    [options.branch.from, options.branch.to] = zone_hz(natural_hz(arm)[mode]);
    let curve = backbone(&forced, &options).map_err(|source| PaperError::Analysis {
        structure: subject.preset.name().to_owned(),
        beta2_deg: beta2_deg(arm),
        drive: format!("backbone of mode {} to {}", mode + 1, drive.0.words(drive.1)),
        source: Box::new(source.into()),
    })?;
    let ends =
        [curve.points.first(), curve.points.last()].map(|point| point.map_or(f64::NAN, |point| point.frequency_hz));
    Ok(Bent { bending: curve.bending(), shift_hz: ends[1] - ends[0] })
}
