//! The excitation of a structure as Python gives it: loads in phase, A·sin(2πft) at degrees of freedom.

use pyo3::prelude::*;
use resonarm::analysis::Forced;
use resonarm::structure::Dof;

use crate::structure::Assembly;

/// Names of degrees of freedom, each with its share of the amplitude; the amplitude; the frequency, Hz.
#[derive(Debug, FromPyObject)]
pub struct Drive(pub Vec<(String, f64)>, pub f64, pub f64);

impl Drive {
    /// The degrees of freedom with their shares.
    pub fn shares(&self, structure: &Assembly) -> PyResult<Vec<(Dof, f64)>> {
        self.0.iter().map(|(name, share)| Ok((structure.dof("drive", name)?, *share))).collect()
    }

    /// The structure under the loads.
    pub fn forced(&self, structure: &Assembly) -> PyResult<Forced> {
        Ok(Forced::at_several(structure.inner.clone(), &self.shares(structure)?, self.1))
    }
}
