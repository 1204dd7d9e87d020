//! An FMU that was read and checked, from which instances are started.

use crate::archive::Archive;
use crate::description::Description;
use crate::error::ImportError;
use crate::mapping::Mapping;
use crate::spec::{ReadAt, Spec};
use resonarm_numeric::number::short;

/// An FMU with what is wanted of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    pub(crate) archive: Archive,
    pub(crate) description: Description,
    pub(crate) mapping: Mapping,
    pub(crate) read: ReadAt,
    /// Length of a communication step, s.
    pub(crate) step_s: f64,
}

/// Whether an FMU is one of `resonarm fmu`.
fn is_ours(tool: &str) -> bool {
    tool.starts_with("resonarm ")
}

/// The part of a step by which a whole number of the FMU's own steps may miss it.
const TOLERANCE: f64 = 1e-6;

impl Source {
    /// Reads the FMU from the bytes of its file, `packed`, and checks what is wanted of it. Nothing of its code runs.
    ///
    /// # Errors
    /// [`ImportError`]: of the archive, the description and the variables.
    pub fn read(packed: Vec<u8>, spec: &Spec) -> Result<Source, ImportError> {
        let archive = Archive::read(packed)?;
        let description = Description::parse(archive.description())?;
        archive.check_platform(&description.library())?;
        if let (ReadAt::Middle, Some(tool)) = (spec.read, description.tool.as_ref().filter(|tool| is_ours(tool))) {
            return Err(ImportError::SamplesItself { tool: tool.clone() });
        }
        let mapping = Mapping::new(&description, spec)?;
        let step_s = match spec.read {
            ReadAt::Middle => spec.sample_s / f64::from(spec.steps_per_sample),
            ReadAt::End => spec.sample_s,
        };
        if let Some(own_s) = description.own_step_s {
            // An FMU that can't divide the step into whole ones of its own may stop short of its end, or interpolate.
            let whole = libm::round(step_s / own_s);
            if whole < 1.0 || (whole * own_s - step_s).abs() > TOLERANCE * step_s {
                let [own_s, step_s] = [own_s, step_s].map(|s| short(&s).to_string());
                tracing::warn!(
                    "the FMU's own step is {own_s} s (fixedInternalStepSize), and it is stepped by {step_s} s: what it gives may be of \
                     another time; choose simulation.rate_hz so that its own step fits"
                );
            }
        }
        Ok(Source { archive, description, mapping, read: spec.read, step_s })
    }
}
