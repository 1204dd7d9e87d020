//! Stiff and soft: which way the zones bend, read off their backbones.

use super::super::figure::zone_hz;
use super::super::{Drive, PaperError, Settings, Subject};
use super::{Judgement, LARGE_DEG, SMALL_DEG, number};
use crate::analysis::{ArmParameter, BackboneOptions, Bending, BranchOptions, ForcedArm, backbone, modes};
use crate::arm::Arm;

/// A backbone up to some excitation.
pub(super) struct Bent {
    pub bending: Option<Bending>,
    /// How far the resonance has moved from small to full excitation, Hz.
    pub shift_hz: f64,
    /// Where it is then, Hz.
    pub frequency_hz: f64,
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
        format!("{bending} ({:+.3} Hz)", self.shift_hz)
    }

    fn is_mixed(&self) -> bool {
        !matches!(self.bending, None | Some(Bending::Hardening | Bending::Softening))
    }
}

/// The amplitude at which a backbone begins, rad: at a thousandth of it the frequency is that of the linear arm to 1e-6.
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
        source,
    })?;
    let ends =
        [curve.points.first(), curve.points.last()].map(|point| point.map_or(f64::NAN, |point| point.frequency_hz));
    Ok(Bent { bending: curve.bending(), shift_hz: ends[1] - ends[0], frequency_hz: ends[1] })
}

/// Backbones of a mode at the poses of Fig. 4 that are asked for.
fn at_poses(
    subject: &Subject,
    settings: &Settings,
    mode: usize,
    wanted: impl Fn(f64) -> bool,
) -> Result<Vec<(f64, Bent)>, PaperError> {
    let four = &settings.figure4;
    let torque_nm = if mode == 0 { &four.torque_nm } else { &four.second_zone_torque_nm }.of(subject.preset());
    let poses = four.beta2_deg.iter().copied().filter(|beta2_deg| wanted(*beta2_deg));
    let backbone =
        |beta2_deg| Ok((beta2_deg, bent(subject, &subject.bent(beta2_deg)?, mode, (Drive::Torque1, *torque_nm))?));
    poses.map(backbone).collect()
}

fn judgement(holds: bool, backbones: &[(f64, Bent)]) -> Judgement {
    let listed: Vec<String> =
        backbones.iter().map(|(beta2_deg, bent)| format!("{beta2_deg}° {}", bent.words())).collect();
    let numbers =
        backbones.iter().map(|(beta2_deg, bent)| number(format!("shift at {beta2_deg}°"), bent.shift_hz, "Hz"));
    Judgement { holds, value: listed.join(", "), numbers: numbers.collect() }
}

fn all(backbones: &[(f64, Bent)], bending: Bending) -> bool {
    !backbones.is_empty() && backbones.iter().all(|(_, bent)| bent.bending == Some(bending))
}

pub(super) fn first_stiff_when_straight(subject: &Subject, settings: &Settings) -> Result<Judgement, PaperError> {
    let backbones = at_poses(subject, settings, 0, |beta2_deg| beta2_deg < SMALL_DEG)?;
    Ok(judgement(all(&backbones, Bending::Hardening), &backbones))
}

pub(super) fn first_mixed_when_bent(subject: &Subject, settings: &Settings) -> Result<Judgement, PaperError> {
    let backbones = at_poses(subject, settings, 0, |beta2_deg| beta2_deg >= LARGE_DEG)?;
    Ok(judgement(backbones.iter().any(|(_, bent)| bent.is_mixed()), &backbones))
}

pub(super) fn second_soft_when_straight(subject: &Subject, settings: &Settings) -> Result<Judgement, PaperError> {
    let backbones = at_poses(subject, settings, 1, |beta2_deg| beta2_deg < SMALL_DEG)?;
    Ok(judgement(all(&backbones, Bending::Softening), &backbones))
}

pub(super) fn second_stiff_when_bent(subject: &Subject, settings: &Settings) -> Result<Judgement, PaperError> {
    let backbones = at_poses(subject, settings, 1, |beta2_deg| beta2_deg >= LARGE_DEG)?;
    let straight_hz = modes(&subject.bent(0.0)?)[1].frequency_hz;
    let lower = backbones.iter().all(|(_, bent)| bent.frequency_hz < straight_hz);
    Ok(judgement(lower && all(&backbones, Bending::Hardening), &backbones))
}
