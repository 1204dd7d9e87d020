//! The excitation of a structure as Python gives it: loads in phase, A·sin(2πft) at degrees of freedom.

use pyo3::prelude::*;
use resonarm::analysis::Forced;
use resonarm::structure::{Dof, LoadHarmonic};

use crate::structure::Assembly;

/// Names of degrees of freedom, each with its share of the amplitude; the amplitude; the frequency, Hz; harmonics by
/// order, amplitude over that of the fundamental, and phase, rad.
#[derive(Debug, FromPyObject)]
pub struct Drive(pub Vec<(String, f64)>, pub f64, pub f64, Vec<(usize, f64, f64)>);

impl Drive {
    /// The degrees of freedom with their shares.
    pub fn shares(&self, structure: &Assembly) -> PyResult<Vec<(Dof, f64)>> {
        self.0.iter().map(|(name, share)| Ok((structure.dof("drive", name)?, *share))).collect()
    }

    /// The harmonics of the loads.
    pub fn harmonics(&self) -> Vec<LoadHarmonic> {
        let harmonic = |&(order, ratio, phase_rad): &(usize, f64, f64)| LoadHarmonic { order, ratio, phase_rad };
        self.3.iter().map(harmonic).collect()
    }

    /// The structure under the loads.
    pub fn forced(&self, structure: &Assembly) -> PyResult<Forced> {
        let forced = Forced::at_several(structure.inner.clone(), &self.shares(structure)?, self.1);
        Ok(forced.with_harmonics(self.harmonics()))
    }
}
