//! An FMU that runs: its files in a folder of its own, its library, its variables.

use std::ffi::CString;

use tempfile::TempDir;

use crate::abi::{Called, Fmi, Fmi2, Fmi3, InstanceSpec, Library, StepOutcome, begin};
use crate::description::Version;
use crate::source::Source;
use crate::{ImportError, float_mode};
use resonarm_bench::structure::{ForeignFault, StructureError};

/// The part of a step by which the time that an FMU has reached may differ: it adds up its own steps.
const TOLERANCE_STEPS: f64 = 1e-3;

/// An FMU that runs.
pub(crate) struct Instance {
    fmu: Box<dyn Fmi>,
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
        let spec = InstanceSpec { token: &token, resources: &resources, parameters: &mapping.parameters, inputs };
        let library = Library::load(&folder.path().join(source.description.library()))?;
        let fmu = float_mode::kept("the initialization", || {
            let mut fmu: Box<dyn Fmi> = match version {
                Version::Fmi2 => Box::new(Fmi2::new(library, &spec)?),
                Version::Fmi3 => Box::new(Fmi3::new(library, &spec)?),
            };
            begin(&mut *fmu, &spec).map(|()| fmu)
        })??;
        Ok(Instance { fmu, control: float_mode::control(), _folder: folder })
    }

    /// The fault of a call, unless it succeeded. The processor rounds as before in any case.
    fn check(&self, called: Called, t_s: f64) -> Result<(), StructureError> {
        let is_kept = float_mode::is_kept(self.control);
        if !called.is_good() {
            Err(failed(called.function, t_s, ForeignFault::Status(called.status())))
        } else if !is_kept {
            Err(failed(called.function, t_s, ForeignFault::FloatMode))
        } else {
            Ok(())
        }
    }

    /// Sets variables.
    pub fn set(&mut self, t_s: f64, references: &[u32], values: &[f64]) -> Result<(), StructureError> {
        let called = self.fmu.set(references, values);
        self.check(called, t_s)
    }

    /// Reads variables, all finite.
    pub fn get(&mut self, t_s: f64, references: &[u32], values: &mut [f64]) -> Result<(), StructureError> {
        let called = self.fmu.get(references, values);
        self.check(called, t_s)?;
        match values.iter().find(|value| !value.is_finite()) {
            Some(got) => Err(failed(called.function, t_s, ForeignFault::NotFinite { got: *got })),
            None => Ok(()),
        }
    }

    /// A communication step, which has to come to its end.
    pub fn step(&mut self, from_s: f64, step_s: f64) -> Result<(), StructureError> {
        let StepOutcome { called, terminates, reached_s } = self.fmu.step(from_s, step_s);
        let checked = self.check(called, from_s);
        if terminates {
            return Err(failed(called.function, from_s, ForeignFault::Terminates));
        }
        checked?;
        // Written so that NaN is elsewhere, too.
        let is_there = |reached_s: f64| (reached_s - (from_s + step_s)).abs() <= TOLERANCE_STEPS * step_s;
        match reached_s.filter(|reached_s| !is_there(*reached_s)) {
            Some(reached_s) => Err(failed(called.function, from_s, ForeignFault::Reached { reached_s })),
            None => Ok(()),
        }
    }

    /// The last message of the FMU, once.
    pub fn last_message(&mut self) -> Option<String> {
        self.fmu.handle().last_message()
    }
}
