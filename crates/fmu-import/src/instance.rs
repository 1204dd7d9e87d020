//! An FMU that runs: its files in a folder of its own, its library, its variables.

use std::ffi::CString;

use tempfile::TempDir;

use crate::abi::{Fmi2, Fmi3, Library, Made, Stepped, is_good, status_name};
use crate::description::Version;
use crate::source::Source;
use crate::{ImportError, float_mode};
use resonarm_bench::structure::{ForeignFault, StructureError};

/// The part of a step by which the time that an FMU has reached may differ: it adds up its own steps.
const TOLERANCE_STEPS: f64 = 1e-3;

enum Fmu {
    Fmi2(Fmi2),
    Fmi3(Fmi3),
}

/// An FMU that runs.
pub(crate) struct Instance {
    fmu: Fmu,
    /// The control bits of the floating-point unit.
    control: u64,
    /// Removed when the library is unloaded.
    _folder: TempDir,
}

#[allow(unsafe_code, reason = "the pointers of an instance belong to it alone")]
// SAFETY: FMI lets an instance be called from any thread, one at a time: all calls of it need `&mut`.
unsafe impl Send for Instance {}
#[allow(unsafe_code, reason = "as above")]
// SAFETY: nothing is called by `&`.
unsafe impl Sync for Instance {}

impl core::fmt::Debug for Instance {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("Instance")
    }
}

fn failed(call: &'static str, t_s: f64, fault: ForeignFault) -> StructureError {
    StructureError::Foreign { call, t_s, fault }
}

impl Instance {
    /// Loads the FMU, and begins a simulation at 0.
    pub fn start(source: &Source) -> Result<Instance, ImportError> {
        let version = source.description.version;
        let unwritten = |error: std::io::Error| ImportError::Unpack { reason: error.to_string() };
        let folder = tempfile::Builder::new().prefix("resonarm-fmu-").tempdir().map_err(unwritten)?;
        source.archive.unpack(version.platform(), folder.path())?;
        let text =
            |text: &str| CString::new(text).map_err(|_| ImportError::Xml { reason: "a text in it has a NUL".into() });
        let token = text(&source.description.token)?;
        let resources = text(&format!("{}/", folder.path().join("resources").display()))?;
        let mapping = &source.mapping;
        let at_rest = mapping.set_at_rest();
        let inputs = (&*mapping.set.references, &*at_rest);
        let made = Made { token: &token, resources: &resources, parameters: &mapping.parameters, inputs };
        let library = Library::load(&folder.path().join(source.description.library()))?;
        let fmu = float_mode::kept("the initialization", || match version {
            Version::Fmi2 => Fmi2::new(library, &made).map(Fmu::Fmi2),
            Version::Fmi3 => Fmi3::new(library, &made).map(Fmu::Fmi3),
        })??;
        Ok(Instance { fmu, control: float_mode::control(), _folder: folder })
    }

    /// Sets variables.
    pub fn set(&mut self, t_s: f64, references: &[u32], values: &[f64]) -> Result<(), StructureError> {
        let (call, status) = match &mut self.fmu {
            Fmu::Fmi2(fmu) => ("fmi2SetReal", fmu.set(references, values)),
            Fmu::Fmi3(fmu) => ("fmi3SetFloat64", fmu.set(references, values)),
        };
        let fault = failed(call, t_s, ForeignFault::Status(status_name(status)));
        if is_good(status) { Ok(()) } else { Err(fault) }
    }

    /// Reads variables, all finite.
    pub fn get(&mut self, t_s: f64, references: &[u32], values: &mut [f64]) -> Result<(), StructureError> {
        let (call, status) = match &mut self.fmu {
            Fmu::Fmi2(fmu) => ("fmi2GetReal", fmu.get(references, values)),
            Fmu::Fmi3(fmu) => ("fmi3GetFloat64", fmu.get(references, values)),
        };
        if !is_good(status) {
            return Err(failed(call, t_s, ForeignFault::Status(status_name(status))));
        }
        match values.iter().find(|value| !value.is_finite()) {
            Some(got) => Err(failed(call, t_s, ForeignFault::NotFinite { got: *got })),
            None => Ok(()),
        }
    }

    /// A communication step, which has to come to its end.
    pub fn step(&mut self, from_s: f64, step_s: f64) -> Result<(), StructureError> {
        let (call, stepped) = match &mut self.fmu {
            Fmu::Fmi2(fmu) => ("fmi2DoStep", fmu.step(from_s, step_s)),
            Fmu::Fmi3(fmu) => ("fmi3DoStep", fmu.step(from_s, step_s)),
        };
        let Stepped { status, terminates, reached_s } = stepped;
        let is_elsewhere = |reached_s: &f64| {
            // Written so that NaN is elsewhere, too.
            let is_there = (reached_s - (from_s + step_s)).abs() <= TOLERANCE_STEPS * step_s;
            !is_there
        };
        let fault = if terminates {
            ForeignFault::Terminates
        } else if !is_good(status) {
            ForeignFault::Status(status_name(status))
        } else if let Some(reached_s) = reached_s.filter(is_elsewhere) {
            ForeignFault::Reached { reached_s }
        } else if !float_mode::is_kept(self.control) {
            ForeignFault::FloatMode
        } else {
            return Ok(());
        };
        Err(failed(call, from_s, fault))
    }

    /// The last message of the FMU.
    pub fn said(&self) -> Option<String> {
        match &self.fmu {
            Fmu::Fmi2(fmu) => fmu.said().last(),
            Fmu::Fmi3(fmu) => fmu.said().last(),
        }
    }
}
