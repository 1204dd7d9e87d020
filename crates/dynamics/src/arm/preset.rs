//! The presets as the arm's parameters.

use super::{ArmError, Parameters};
pub use crate::structure::Preset;

impl Preset {
    /// The parameters of the preset's chain.
    ///
    /// # Errors
    /// [`ArmError::Structure`] if the preset's file is not valid; tests check that every preset is.
    pub fn parameters(self) -> Result<Parameters, ArmError> {
        let chain = self.chain()?;
        let arm = chain.to_arm().ok_or(ArmError::NotTheArm)?;
        Ok(arm.0)
    }
}
