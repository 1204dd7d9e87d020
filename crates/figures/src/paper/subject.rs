//! The arm of a preset, in the poses of the paper.

use super::error::PaperError;
use super::settings::{Settings, SettingsError};
use resonarm_dynamics::structure::{Assembly, BodySpec, ChainSpec, Preset, StructureSpec};

/// A preset with the settings' l2, and the line along which its tip is moved.
#[derive(Clone, Debug, PartialEq)]
pub struct Subject {
    /// The preset that the arm is of.
    pub preset: Preset,
    /// The straight chain with the settings' l2.
    pub chain: ChainSpec,
    height_m: f64,
}

/// Returns the chain of a preset, straight.
fn straight(preset: Preset) -> Result<ChainSpec, PaperError> {
    Ok(preset.chain()?.at_angles_deg(&[0.0, 0.0]))
}

impl Subject {
    /// Makes the arm of a preset.
    ///
    /// # Errors
    /// [`PaperError::Structure`] if the preset's file can't be read.
    pub fn new(preset: Preset, settings: &Settings) -> Result<Subject, PaperError> {
        let mut chain = straight(preset)?;
        // Neither preset knows l2 from the paper: it is a choice of the settings.
        chain.links.iter_mut().skip(1).for_each(|link| link.length_m = settings.length2_m);
        Ok(Subject { preset, chain, height_m: settings.line.height_m })
    }

    /// Returns the lengths of its links, m.
    fn lengths_m(&self) -> [f64; 2] {
        let length_m = |link: usize| self.chain.links.get(link).map_or(f64::NAN, |link| link.length_m);
        [length_m(0), length_m(1)]
    }

    /// Returns the name of the preset and the differences from it.
    ///
    /// # Errors
    /// [`PaperError::Structure`] if the preset's file can't be read.
    pub fn label(&self) -> Result<String, PaperError> {
        let length2_m = |chain: &ChainSpec| chain.links.get(1).map_or(f64::NAN, |link| link.length_m);
        let own = length2_m(&self.chain);
        let preset = length2_m(&straight(self.preset)?);
        let name = self.preset.name();
        Ok(if own == preset {
            name.to_string()
        } else {
            format!("{name} with link2.length_m = {own} (preset {preset})")
        })
    }

    /// Returns the chain at β1 and β2.
    fn posed(&self, angles_deg: [f64; 2]) -> Result<Assembly, PaperError> {
        let chain = self.chain.clone().at_angles_deg(&angles_deg);
        Ok(Assembly::new(&StructureSpec { body: BodySpec::Chain(chain), elements: vec![] })?)
    }

    /// Returns the arm at β1 = 0, which does not matter for an arm driven at its joints.
    ///
    /// # Errors
    /// [`PaperError::Structure`] for an impossible angle.
    pub fn bent(&self, beta2_deg: f64) -> Result<Assembly, PaperError> {
        self.posed([0.0, beta2_deg])
    }

    /// Returns the arm with its tip on the line of Fig. 6, at positive x.
    ///
    /// With R (cos γ, sin γ) = (l1 + l2 cos β2, l2 sin β2) the tip is at R (cos(β1 + γ), sin(β1 + γ)), so that its
    /// height h gives β1 = arcsin(h/R) − γ.
    ///
    /// # Errors
    /// [`SettingsError::Line`] if the tip can't reach the line.
    pub fn on_line(&self, beta2_deg: f64) -> Result<Assembly, PaperError> {
        self.on_line_at(beta2_deg, self.height_m)
    }

    /// Works like [`Subject::on_line`], on a line of another height, m.
    ///
    /// # Errors
    /// [`SettingsError::Line`] if the tip can't reach the line.
    pub fn on_line_at(&self, beta2_deg: f64, height_m: f64) -> Result<Assembly, PaperError> {
        let (sine, cosine) = libm::sincos(beta2_deg.to_radians());
        let [length1_m, length2_m] = self.lengths_m();
        let x = length1_m + length2_m * cosine;
        let y = length2_m * sine;
        let reach_m = libm::hypot(x, y);
        if height_m.abs() > reach_m {
            return Err(SettingsError::Line { beta2_deg, reach_m, height_m }.into());
        }
        self.posed([(libm::asin(height_m / reach_m) - libm::atan2(y, x)).to_degrees(), beta2_deg])
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
            let [.., tip] = subject(&settings).on_line(beta2_deg).unwrap().rest_m().unwrap()[..] else { panic!() };
            assert!((tip[1] - settings.line.height_m).abs() < 1e-12 && tip[0] > 0.0, "{tip:?}");
        }
        settings.line.height_m = 0.5;
        let beyond = subject(&settings).on_line(150.0).unwrap_err();
        insta::assert_snapshot!(beyond, @"at β2 = 150° the tip is 0.320 m from joint 1 and can't be on the line at a height of 0.5 m: bring line.height_m closer to 0, or bend the arm less");
    }
}
