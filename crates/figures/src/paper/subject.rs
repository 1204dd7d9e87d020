//! The arm of a preset, in the poses of the paper.

use nalgebra::Vector2;

use super::{MeasuredZones, PaperError, Settings, SettingsError};
use resonarm_dynamics::arm::{Arm, Parameters, Pose, Preset};

/// A preset with the settings' l2, and the line on which its tip is moved.
#[derive(Clone, Debug, PartialEq)]
pub struct Subject {
    preset: Preset,
    parameters: Parameters,
    height_m: f64,
}

impl Subject {
    /// The arm of a preset.
    ///
    /// # Errors
    /// [`PaperError::Arm`] if the preset's file can't be read.
    pub fn new(preset: Preset, settings: &Settings) -> Result<Subject, PaperError> {
        let parameters = Parameters { length2_m: settings.length2_m, ..preset.parameters()? };
        Ok(Subject { preset, parameters, height_m: settings.line.height_m })
    }

    /// The measured arm, with the line at the height of its tip.
    pub(super) fn measured(measured: &MeasuredZones) -> Subject {
        let (preset, arm) = (measured.preset, &measured.arm);
        Subject { preset, parameters: *arm.parameters(), height_m: arm.points(&Vector2::zeros()).c_m.y }
    }

    /// The preset.
    pub fn preset(&self) -> Preset {
        self.preset
    }

    /// The preset's parameters with the settings' l2.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// The preset and the differences from it.
    ///
    /// # Errors
    /// [`PaperError::Arm`] if the preset's file can't be read.
    pub fn label(&self) -> Result<String, PaperError> {
        let (own, preset) = (self.parameters.length2_m, self.preset.parameters()?.length2_m);
        let name = self.preset.name();
        Ok(if own == preset { name.to_string() } else { format!("{name} with length2_m = {own} (preset {preset})") })
    }

    /// The arm at β1 = 0, which does not matter for an arm driven at its joints.
    ///
    /// # Errors
    /// [`PaperError::Arm`] for an impossible angle.
    pub fn bent(&self, beta2_deg: f64) -> Result<Arm, PaperError> {
        Ok(Arm::new(self.parameters, Pose { beta1_deg: 0.0, beta2_deg })?)
    }

    /// The arm with its tip on the line of Fig. 6, at positive x.
    ///
    /// With R (cos γ, sin γ) = (l1 + l2 cos β2, l2 sin β2) the tip is at R (cos(β1 + γ), sin(β1 + γ)), so that its
    /// height h gives β1 = arcsin(h/R) − γ.
    ///
    /// # Errors
    /// [`SettingsError::Line`] if the tip can't reach the line.
    pub fn on_line(&self, beta2_deg: f64) -> Result<Arm, PaperError> {
        self.on_line_at(beta2_deg, self.height_m)
    }

    /// As [`Subject::on_line`], on a line of another height, m.
    ///
    /// # Errors
    /// [`SettingsError::Line`] if the tip can't reach the line.
    pub fn on_line_at(&self, beta2_deg: f64, height_m: f64) -> Result<Arm, PaperError> {
        let (sine, cosine) = libm::sincos(beta2_deg.to_radians());
        let (x, y) = (self.parameters.length1_m + self.parameters.length2_m * cosine, self.parameters.length2_m * sine);
        let reach_m = libm::hypot(x, y);
        if height_m.abs() > reach_m {
            return Err(SettingsError::Line { beta2_deg, reach_m, height_m }.into());
        }
        let beta1_deg = (libm::asin(height_m / reach_m) - libm::atan2(y, x)).to_degrees();
        Ok(Arm::new(self.parameters, Pose { beta1_deg, beta2_deg })?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tip_is_on_the_line_or_the_line_out_of_reach() {
        let mut settings = Settings::embedded().unwrap();
        let subject = |settings: &Settings| Subject::new(Preset::Irb1600Fitted, settings).unwrap();
        for beta2_deg in [0.0, 30.0, 90.0, 150.0] {
            let tip = subject(&settings).on_line(beta2_deg).unwrap().points(&Vector2::zeros()).c_m;
            assert!((tip.y - settings.line.height_m).abs() < 1e-12 && tip.x > 0.0, "{tip}");
        }
        settings.line.height_m = 0.5;
        let beyond = subject(&settings).on_line(150.0).unwrap_err();
        insta::assert_snapshot!(beyond, @"at β2 = 150° the tip is 0.320 m from joint 1 and can't be on the line at a height of 0.5 m: bring line.height_m nearer to 0, or bend the arm less");
    }
}
